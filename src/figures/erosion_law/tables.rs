//! The tables of the erosion law as CSV.

use super::plots::{line_stresses, thinned_records};
use analysis::erosion_law::{FittedErosionLaw, Interval, LinearLaw};
use analysis::study::{CohesionReport, measured, points};
use std::fmt;
use std::fmt::Write as _;

/// Returns the columns of a fitted law: critical stress and coefficient, each with its interval, and R².
fn fitted(fit: &LinearLaw) -> String {
    let (stress, coefficient) = (fit.critical_shear_interval, fit.coefficient_interval);
    format!(
        "{:e},{:e},{:e},{:e},{:e},{:e},{}",
        fit.critical_shear,
        stress.low,
        stress.high,
        fit.coefficient,
        coefficient.low,
        coefficient.high,
        fit.r_squared,
    )
}

/// Returns the fitted law of each cohesion.
pub(super) fn law(cohesions: &[CohesionReport]) -> String {
    let mut text = "cohesion [N/m],law,critical_shear [Pa],critical_shear_low [Pa],critical_shear_high [Pa],\
                    coefficient [s/m],coefficient_low [s/m],coefficient_high [s/m],r_squared [1],scatter [1],\
                    runs [1],points [1],eroding_points [1],coefficient_median [s/m],critical_shear_median [Pa]\n"
        .to_owned();
    for cohesion in cohesions {
        let points = points(cohesion);
        let counts = format!(
            "{},{},{}",
            cohesion.runs.len(),
            points.len(),
            points.iter().filter(|point| point.eroding).count()
        );
        let c = cohesion.cohesion;
        // Writing to a string cannot fail.
        let _ = match &cohesion.law {
            Some(FittedErosionLaw::Fitted(fit)) => writeln!(
                text,
                "{c},fitted,{},{},{counts},{:e},{:e}",
                fitted(fit),
                fit.scatter,
                fit.coefficient_median,
                fit.critical_shear_median,
            ),
            Some(FittedErosionLaw::LowerBound { at_least }) => {
                writeln!(text, "{c},lower_bound,,{at_least:e},,,,,,,{counts},,")
            }
            Some(FittedErosionLaw::Bracketed { above, below }) => {
                writeln!(text, "{c},bracketed,,{above:e},{below:e},,,,,,{counts},,")
            }
            Some(FittedErosionLaw::Undetermined) => {
                writeln!(text, "{c},undetermined,,,,,,,,,{counts},,")
            }
            None => writeln!(text, "{c},none,,,,,,,,,{counts},,"),
        };
    }
    text
}

/// Returns the fitted law of each cohesion for each choice of points and stress.
pub(super) fn readings(cohesions: &[CohesionReport]) -> String {
    let mut text = "cohesion [N/m],points,stress,law,critical_shear [Pa],critical_shear_low [Pa],critical_shear_high \
        [Pa],\
                    coefficient [s/m],coefficient_low [s/m],coefficient_high [s/m],r_squared [1]\n"
        .to_owned();
    for cohesion in cohesions {
        for reading in &cohesion.readings {
            let name = |value: &dyn fmt::Debug| format!("{value:?}").to_lowercase();
            let head = format!(
                "{},{},{}",
                cohesion.cohesion,
                name(&reading.points),
                name(&reading.stress)
            );
            // Writing to a string cannot fail.
            let _ = match &reading.law {
                Some(FittedErosionLaw::Fitted(fit)) => {
                    writeln!(text, "{head},fitted,{}", fitted(fit))
                }
                Some(FittedErosionLaw::LowerBound { at_least }) => {
                    writeln!(text, "{head},lower_bound,,{at_least:e},,,,,")
                }
                Some(FittedErosionLaw::Bracketed { above, below }) => {
                    writeln!(text, "{head},bracketed,,{above:e},{below:e},,,,")
                }
                Some(FittedErosionLaw::Undetermined) => {
                    writeln!(text, "{head},undetermined,,,,,,,")
                }
                None => writeln!(text, "{head},none,,,,,,,"),
            };
        }
    }
    text
}

/// Returns windows and whole runs, one row each.
pub(super) fn windows(cohesions: &[CohesionReport]) -> String {
    let mut text = "points,cohesion [N/m],pressure_difference [Pa],start [s],end [s],grains [1],eroding,\
                    shear_gradient [Pa],shear_spread [Pa],shear_balance [Pa],shear_traction [Pa],hole_width [m],\
                    hole_length [m],rate [kg/(m^2 s)],rate_error [kg/(m^2 s)],rate_median [kg/(m^2 s)]\n"
        .to_owned();
    for cohesion in cohesions {
        for run in &cohesion.runs {
            let windows = run.windows.iter().map(|w| ("window", w));
            for (kind, w) in windows.chain(run.whole.iter().map(|w| ("run", w))) {
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "{kind},{},{},{},{},{},{},{:e},{:e},{:e},{:e},{:e},{:e},{:e},{:e},{:e}",
                    cohesion.cohesion,
                    run.pressure_difference,
                    w.start,
                    w.end,
                    w.grains,
                    w.eroding,
                    w.shear,
                    w.shear_spread,
                    w.shear_balance,
                    w.shear_traction,
                    w.width,
                    w.length,
                    w.rate,
                    w.rate_error,
                    w.rate_median
                );
            }
        }
    }
    text
}

/// Returns the eroded mass against time.
pub(super) fn series(cohesions: &[CohesionReport]) -> String {
    let mut text =
        "cohesion [N/m],pressure_difference [Pa],time [s],eroded_fraction [1]\n".to_owned();
    for cohesion in cohesions {
        for run in &cohesion.runs {
            for record in thinned_records(&run.records) {
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "{},{},{},{}",
                    cohesion.cohesion, run.pressure_difference, record.time, record.eroded_fraction
                );
            }
        }
    }
    text
}

/// Returns the points of the runs and the fitted line.
pub(super) fn line(cohesions: &[CohesionReport]) -> String {
    let mut text = "cohesion [N/m],kind,pressure_difference [Pa],shear [Pa],rate [kg/(m^2 s)],rate_low [kg/(m^2 s)],\
                    rate_high [kg/(m^2 s)]\n"
        .to_owned();
    for cohesion in cohesions {
        for run in &cohesion.runs {
            for w in measured(run, cohesion.points) {
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "{},point,{},{:e},{:e},{:e},{:e}",
                    cohesion.cohesion,
                    run.pressure_difference,
                    w.shear,
                    w.rate,
                    (w.rate - 1.96 * w.rate_error).max(0.0),
                    w.rate + 1.96 * w.rate_error
                );
            }
        }
        if let Some(FittedErosionLaw::Fitted(fit)) = &cohesion.law {
            for shear in line_stresses(cohesion, fit) {
                let Interval { low, high } = fit.rate_interval(shear);
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "{},fit,,{shear:e},{:e},{low:e},{high:e}",
                    cohesion.cohesion,
                    fit.rate(shear)
                );
            }
        }
    }
    text
}
