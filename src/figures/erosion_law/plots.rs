//! The plots of the erosion law.

use super::{Published, digits};
use crate::plot::{
    BandPoint, CATEGORY, Figure, Layer, Legend, Mark, Panel, PlotAxis, PlotShape, Style, sequential,
};
use analysis::erosion_law::{ErosionRecord, FittedErosionLaw, Interval, LinearLaw};
use analysis::study::{CohesionReport, measured, points};
use std::fmt::Write as _;

/// Returns at most 400 of the records, including the first and the last: the resolution of a figure.
pub(super) fn thinned_records(records: &[ErosionRecord]) -> Vec<ErosionRecord> {
    let count = records.len().min(400);
    (0..count)
        .map(|k| records[k * (records.len() - 1) / (count - 1).max(1)])
        .collect()
}

/// Returns the stresses at which the line of a fit is drawn.
pub(super) fn line_stresses(cohesion: &CohesionReport, fit: &LinearLaw) -> Vec<f64> {
    let most = points(cohesion).iter().map(|p| p.shear).fold(0.0, f64::max);
    let mut stresses: Vec<f64> = (0..=120_u32)
        .map(|k| most * 1.04 * f64::from(k) / 120.0)
        .collect();
    stresses.push(fit.critical_shear);
    stresses.sort_by(f64::total_cmp);
    stresses
}

/// Returns the eroded mass against time.
pub(super) fn eroded_mass(cohesion: &CohesionReport) -> Figure {
    let count = cohesion.runs.len();
    // The highest pressure is first, in the order of the curves.
    let layers = cohesion
        .runs
        .iter()
        .enumerate()
        .rev()
        .map(|(index, run)| {
            let points = thinned_records(&run.records)
                .iter()
                .map(|record| (record.time, record.eroded_fraction))
                .collect();
            Layer::new(
                PlotShape::Line {
                    points,
                    dashed: false,
                },
                &sequential(index, count),
                &format!("{:.2}", run.pressure_difference),
            )
        })
        .collect();
    let top = cohesion
        .runs
        .iter()
        .map(|run| run.eroded_fraction)
        .fold(0.0, f64::max);
    let y = PlotAxis::linear("eroded mass M_{e} / M_{0}", "");
    Figure {
        panels: vec![Panel {
            title: format!("Eroded mass, C/d = {} N/m", cohesion.cohesion),
            x: PlotAxis::linear("time", "s"),
            y: if top > 0.5 {
                y.with_range(0.0, 1.0)
            } else {
                y.with_range(0.0, (1.08 * top).max(1e-3))
            },
            layers,
            legend: Legend::Right,
            legend_title: "ΔP (Pa)".to_owned(),
        }],
    }
}

/// Returns the number for a figure, `9.71·10^{-4}`.
fn digits_in_figure(value: f64) -> String {
    match digits(value).split_once('e') {
        Some((mantissa, power)) => {
            format!("{mantissa}·10^{{{}}}", power.replace('-', "\u{2212}"))
        }
        None => digits(value),
    }
}

/// Returns the erosion rate against shear stress.
pub(super) fn rate(cohesion: &CohesionReport) -> Figure {
    let mut layers = Vec::new();
    let mut title = format!("Erosion rate, C/d = {} N/m", cohesion.cohesion);
    if let Some(FittedErosionLaw::Fitted(fit)) = &cohesion.law {
        let stresses = line_stresses(cohesion, fit);
        let band = stresses
            .iter()
            .map(|&shear| {
                let Interval { low, high } = fit.rate_interval(shear);
                BandPoint {
                    x: shear,
                    low,
                    high,
                }
            })
            .collect();
        layers.push(Layer::new(
            PlotShape::Band { points: band },
            CATEGORY[1],
            "95 % band",
        ));
        let line = stresses
            .iter()
            .map(|&shear| (shear, fit.rate(shear)))
            .collect();
        let label = format!("k_{{d}} = {} s/m", digits_in_figure(fit.coefficient));
        layers.push(Layer::new(
            PlotShape::Line {
                points: line,
                dashed: false,
            },
            CATEGORY[1],
            &label,
        ));
        // A second line of the legend.
        let words = PlotShape::Texts { words: Vec::new() };
        let label = format!("τ_{{c}} = {} Pa", digits_in_figure(fit.critical_shear));
        layers.push(Layer::new(words, CATEGORY[1], &label));
        if fit.r_squared < 0.0 {
            title += ": a constant fits better than the line";
        } else if !fit.r_squared.is_nan() {
            let _ = write!(title, ", R^{{2}} = {:.3}", fit.r_squared);
        }
    }
    for (eroding, label) in [
        (false, "no erosion or too few grains, 95 % bars"),
        (true, "runs, 95 % bars"),
    ] {
        let marks: Vec<Mark> = cohesion
            .runs
            .iter()
            .flat_map(|run| measured(run, cohesion.points))
            .filter(|w| w.eroding == eroding)
            .map(|w| Mark {
                x: w.shear,
                y: w.rate,
                x_bar: None,
                // One or two loose grains give a rate as well, which is as uncertain as its bar.
                y_bar: (eroding || w.rate > 0.0).then(|| {
                    (
                        (w.rate - 1.96 * w.rate_error).max(0.0),
                        w.rate + 1.96 * w.rate_error,
                    )
                }),
            })
            .collect();
        if !marks.is_empty() {
            layers.push(Layer::new(
                PlotShape::Marks {
                    marks,
                    style: if eroding {
                        Style::Filled
                    } else {
                        Style::Hollow
                    },
                },
                CATEGORY[0],
                label,
            ));
        }
    }
    Figure {
        panels: vec![Panel {
            title,
            x: PlotAxis::linear("hydraulic shear stress τ_{h}", "Pa"),
            y: PlotAxis::linear("erosion rate", "kg m^{\u{2212}2} s^{\u{2212}1}"),
            layers,
            legend: Legend::Right,
            legend_title: String::new(),
        }],
    }
}

/// Points of the law against cohesion.
#[derive(Default)]
struct Points {
    /// Critical shear stresses of fits.
    thresholds: Vec<Mark>,
    /// Erosion coefficients of fits.
    slopes: Vec<Mark>,
    /// Lower bounds of critical shear stresses.
    lower: Vec<(f64, f64)>,
    /// Intervals of critical shear stresses.
    brackets: Vec<Mark>,
}

impl Points {
    fn new(cohesions: &[CohesionReport]) -> Self {
        let mut points = Self::default();
        let bar = |interval: Interval| Some((interval.low, interval.high));
        for cohesion in cohesions {
            let x = cohesion.cohesion;
            match &cohesion.law {
                Some(FittedErosionLaw::Fitted(fit)) => {
                    points.thresholds.push(Mark {
                        y_bar: bar(fit.critical_shear_interval),
                        ..Mark::without_bars(x, fit.critical_shear)
                    });
                    points.slopes.push(Mark {
                        y_bar: bar(fit.coefficient_interval),
                        ..Mark::without_bars(x, fit.coefficient)
                    });
                }
                Some(FittedErosionLaw::LowerBound { at_least }) => {
                    points.lower.push((x, *at_least))
                }
                Some(FittedErosionLaw::Bracketed { above, below }) => points.brackets.push(Mark {
                    y_bar: Some((*above, *below)),
                    ..Mark::without_bars(x, 0.5 * (above + below))
                }),
                Some(FittedErosionLaw::Undetermined) | None => {}
            }
        }
        points
    }
}

/// Returns the axis of the cohesions, with space for one point at each end.
fn cohesion_axis(cohesions: &[CohesionReport], published: Option<Published>) -> PlotAxis {
    let (low, high) = cohesions
        .iter()
        .map(|c| c.cohesion)
        .filter(|c| *c > 0.0)
        .chain(published.map(|p| p.cohesion))
        .fold((f64::INFINITY, 0.0_f64), |(low, high), c| {
            (low.min(c), high.max(c))
        });
    let axis = PlotAxis::log("cohesion C/d", "N/m");
    // In a study of soil without bonds no cohesion is above 0.
    if high > 0.0 {
        axis.with_range(low / 1.6, high * 1.6)
    } else {
        axis
    }
}

/// Draws critical shear stress and erosion coefficient against cohesion.
pub(super) fn law(cohesions: &[CohesionReport], published: Option<Published>) -> Figure {
    let Points {
        thresholds,
        slopes,
        lower,
        brackets,
    } = Points::new(cohesions);
    let mark_published = |value: fn(Published) -> f64| {
        published.map(|p| {
            Layer::new(
                PlotShape::Marks {
                    marks: vec![Mark::without_bars(p.cohesion, value(p))],
                    style: Style::Ring,
                },
                CATEGORY[2],
                &format!("published, C/d = {} N/m", p.cohesion),
            )
        })
    };
    let marks = |marks: Vec<Mark>, style, label: &str| {
        Layer::new(PlotShape::Marks { marks, style }, CATEGORY[1], label)
    };
    let mut first = Vec::new();
    if !brackets.is_empty() {
        first.push(marks(brackets, Style::Hollow, "bracket"));
    }
    if !lower.is_empty() {
        let points = PlotShape::LowerBounds { points: lower };
        first.push(Layer::new(points, CATEGORY[1], "no erosion: lower bound"));
    }
    first.push(marks(thresholds, Style::Filled, "fit, 95 % interval"));
    first.extend(mark_published(|p| p.critical_shear));
    let tops = slopes.iter().filter_map(|mark| mark.y_bar);
    let tops = tops.map(|bar| bar.1);
    let tops = tops.chain(published.map(|p| p.coefficient));
    let top = tops.fold(0.0, f64::max);
    let mut second = vec![marks(slopes, Style::Filled, "fit, 95 % interval")];
    second.extend(mark_published(|p| p.coefficient));
    let panel = |title: &str, y, layers| Panel {
        title: title.to_owned(),
        x: cohesion_axis(cohesions, published),
        y,
        layers,
        legend: Legend::Right,
        legend_title: String::new(),
    };
    let coefficient =
        PlotAxis::linear("k_{d}", "s/m").with_range(0.0, if top > 0.0 { 1.3 * top } else { 1.0 });
    Figure {
        panels: vec![
            panel(
                "(a) Critical shear stress",
                PlotAxis::log("τ_{c}", "Pa"),
                first,
            ),
            panel("(b) Erosion coefficient", coefficient, second),
        ],
    }
}
