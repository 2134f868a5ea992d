//! The erosion law across runs: reads run folders, fits each cohesion, writes tables and figures.
//!
//! A run folder holds `erosion.csv` and `summary.json` with the key `erosion` ([`ErosionSummary`]); `removed.csv` is used
//! where it is there. A run that is still going on, or was stopped, has no such summary yet: pressure, cohesion and hole
//! are then read from its `case.json`, and the masses from the record.
//!
//! | file | holds |
//! |---|---|
//! | `erosion_law.csv` | one row per cohesion: tau_c and k_d with intervals, or the bound |
//! | `erosion_points.csv` | one row per window and one per whole run: stress three ways, rate, errors |
//! | `erosion_readings.csv` | the law by each reading: runs or windows, stress by gradient, balance or traction |
//! | `figure4.csv`, `.svg` | M_e / M_0 against time for each pressure |
//! | `figure5.csv`, `.svg` | rate against stress with the fitted line, its band, error bars |
//! | `figure6.csv`, `.svg` | tau_c and k_d against C/d; lower bounds as arrows |
//! | `erosion_law.json` | the report |
//!
//! The law is fitted to one point per run and the stress from the velocity gradient, as in the paper's figure 5; where fewer than
//! three runs are there, to the windows of the runs. The other readings stand beside it: how far they differ is what the
//! reading costs.
//!
//! Figures 4 and 5 without a suffix are those of the paper's C/d = 0.506 N/m, or else of the cohesion with the most
//! runs; those of the others end in `_C<value>`.

use super::erosion_law::{
    CohesionTrend, ErosionRecord, ErosionSummary, FitOptions, Interval, Law, LinearLaw, RatePoint,
    RateWindow, RemovedGrain, WindowOptions, cohesion_trend, erosion_windows, fit_law, mean_jump,
    read_rows, run_point,
};
use super::plot::{Axis, CATEGORY, Figure, Layer, Legend, Mark, Panel, Shape, Style, sequential};
use crate::error::Error;
use serde_json::Value;
use std::fmt;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// The cohesion whose figures the paper shows, N/m.
const PAPER_COHESION: f64 = 0.506;
/// The paper's critical shear stress there, Pa.
const PAPER_CRITICAL_SHEAR: f64 = 9e-4;
/// The paper's erosion coefficient there, s/m.
const PAPER_COEFFICIENT: f64 = 9.1;

/// One run as read.
#[derive(Clone, Debug, serde::Serialize)]
pub struct RunReport {
    /// Its folder.
    pub folder: PathBuf,
    /// `outcome` of its summary; `unfinished` without one.
    pub outcome: String,
    /// Pressure difference, Pa.
    pub pressure_difference: f64,
    /// C/d, N/m.
    pub cohesion: f64,
    /// Time reached, s.
    pub end: f64,
    /// M_e / M_0 at the end.
    pub eroded_fraction: f64,
    /// Grains that left.
    pub eroded_grains: u64,
    /// The windows.
    pub windows: Vec<RateWindow>,
    /// The run as one hole erosion test.
    pub whole: Option<RateWindow>,
    #[serde(skip)]
    records: Vec<ErosionRecord>,
}

/// The runs of one cohesion and their law.
#[derive(Clone, Debug, serde::Serialize)]
pub struct CohesionReport {
    /// C/d, N/m.
    pub cohesion: f64,
    /// Its runs, by pressure.
    pub runs: Vec<RunReport>,
    /// What the law is fitted to.
    pub points: Points,
    /// The law; `None` where no run has a point.
    pub law: Option<Law>,
    /// All readings, the law's own among them.
    pub readings: Vec<Reading>,
}

/// What counts as a point of the law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Points {
    /// Each run as a whole.
    Runs,
    /// Each window of each run.
    Windows,
}

/// How the stress is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stress {
    /// From the gradient of the velocity at the faces (the paper's equation 10).
    Gradient,
    /// From the balance of forces on the hole.
    Balance,
    /// From the summed traction on the grains of the faces.
    Traction,
}

/// The law by one choice of points and stress.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Reading {
    /// The points.
    pub points: Points,
    /// The stress.
    pub stress: Stress,
    /// The law; `None` without points.
    pub law: Option<Law>,
}

/// What `solver erosion-law` found and wrote.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// By cohesion.
    pub cohesions: Vec<CohesionReport>,
    /// Over the cohesions; `None` for fewer than two fits.
    pub trend: Option<CohesionTrend>,
    /// Files written.
    pub files: Vec<PathBuf>,
    /// What a reader should know, such as runs that ended early.
    pub warnings: Vec<String>,
}

/// Fits the runs and writes tables and figures into `output`, which is made if it is not there.
///
/// # Errors
/// [`Error::Io`] where a run cannot be read, holds no pressure or cohesion, or a file cannot be written.
pub fn run(runs: &[PathBuf], output: &Path) -> Result<Report, Error> {
    if runs.is_empty() {
        return Err(Error::Io(
            "erosion-law needs at least one run folder".to_owned(),
        ));
    }
    let mut warnings = Vec::new();
    let mut reports = runs
        .iter()
        .map(|folder| read_run(folder, &mut warnings))
        .collect::<Result<Vec<_>, _>>()?;
    reports.sort_by(|a, b| {
        (a.cohesion.total_cmp(&b.cohesion))
            .then(a.pressure_difference.total_cmp(&b.pressure_difference))
            .then(a.folder.cmp(&b.folder))
    });
    let mut cohesions: Vec<CohesionReport> = Vec::new();
    for report in reports {
        match cohesions.last_mut() {
            Some(last) if close(last.cohesion, report.cohesion) => last.runs.push(report),
            _ => cohesions.push(CohesionReport {
                cohesion: report.cohesion,
                runs: vec![report],
                points: Points::Windows,
                law: None,
                readings: Vec::new(),
            }),
        }
    }
    for cohesion in &mut cohesions {
        let tests = cohesion.runs.iter().filter(|run| run.whole.is_some());
        if tests.count() >= 3 {
            cohesion.points = Points::Runs;
        }
        for points in [Points::Runs, Points::Windows] {
            for stress in [Stress::Gradient, Stress::Balance, Stress::Traction] {
                let law = fit_law(&points_of(cohesion, points, stress), FitOptions::default());
                if points == cohesion.points && stress == Stress::Gradient {
                    cohesion.law.clone_from(&law);
                }
                cohesion.readings.push(Reading {
                    points,
                    stress,
                    law,
                });
            }
        }
    }
    let laws: Vec<(f64, Law)> = cohesions
        .iter()
        .filter_map(|c| c.law.clone().map(|law| (c.cohesion, law)))
        .collect();
    let mut report = Report {
        trend: cohesion_trend(&laws),
        cohesions,
        files: Vec::new(),
        warnings,
    };
    write_all(&mut report, output)?;
    Ok(report)
}

/// Equal but for rounding in text.
fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs())
}

/// The points that the law is fitted to.
fn points(cohesion: &CohesionReport) -> Vec<RatePoint> {
    points_of(cohesion, cohesion.points, Stress::Gradient)
}

/// The windows, or the whole, of a run.
fn measured(run: &RunReport, points: Points) -> Vec<RateWindow> {
    match points {
        Points::Runs => run.whole.into_iter().collect(),
        Points::Windows => run.windows.clone(),
    }
}

fn points_of(cohesion: &CohesionReport, points: Points, stress: Stress) -> Vec<RatePoint> {
    let mut all = Vec::new();
    for (index, run) in cohesion.runs.iter().enumerate() {
        for mut window in measured(run, points) {
            window.shear = match stress {
                Stress::Gradient => window.shear,
                Stress::Balance => window.shear_balance,
                Stress::Traction => window.shear_traction,
            };
            all.push(RatePoint::new(index, &window));
        }
    }
    all
}

fn read_run(folder: &Path, warnings: &mut Vec<String>) -> Result<RunReport, Error> {
    let records = read_rows::<ErosionRecord>(&folder.join("erosion.csv"), |row| row.step)?;
    let removed = folder.join("removed.csv");
    let removed = if removed.is_file() {
        read_rows::<RemovedGrain>(&removed, |row| row.id)?
    } else {
        Vec::new()
    };
    let summary = read_json(&folder.join("summary.json"))?;
    let outcome = summary
        .as_ref()
        .and_then(|summary| summary["outcome"].as_str())
        .unwrap_or("unfinished")
        .to_owned();
    let about = match summary.as_ref().and_then(|summary| summary.get("erosion")) {
        Some(value) => {
            serde_json::from_value::<ErosionSummary>(value.clone()).map_err(|error| {
                Error::Io(format!(
                    "{}: erosion: {error}",
                    folder.join("summary.json").display()
                ))
            })?
        }
        None => summary_from_case(folder, &records)?,
    };
    if !matches!(outcome.as_str(), "done" | "finished" | "completed") {
        let end = records.last().map_or(0.0, |record| record.time);
        warnings.push(format!(
            "{}: {outcome}, used as far as it got ({end:.4} s)",
            folder.display()
        ));
    }
    let options = WindowOptions::default();
    // Without a grain gone, the mean grain is unknown; one ten-thousandth of the sample stands in.
    let jump = mean_jump(&removed, &records).unwrap_or(1e-4 * about.initial_mass);
    let mut windows = erosion_windows(&records, jump, about.ramp_end, options);
    let mut whole = run_point(&records, jump, about.ramp_end, options);
    let left = records.last().map_or(0, |record| record.eroded_grains);
    if about.cohesion > 0.0 && left > 0 && records.iter().all(|r| r.bonds_broken == 0) {
        // Cutting a hole frees some grains of all their bonds. The water carries them away at any cohesion; the soil is whole.
        for window in windows.iter_mut().chain(whole.as_mut()) {
            window.eroding = false;
            window.rate = 0.0;
            window.rate_median = 0.0;
        }
        warnings.push(format!(
            "{}: no bond broke: the {left} grains that left were loose after the cut, which is no erosion",
            folder.display()
        ));
    }
    if windows.is_empty() {
        warnings.push(format!(
            "{}: too short for a window: fewer than two records after {} s",
            folder.display(),
            about.ramp_end
        ));
    }
    let last = records.last();
    Ok(RunReport {
        folder: folder.to_path_buf(),
        outcome,
        pressure_difference: about.pressure_difference,
        cohesion: about.cohesion,
        end: last.map_or(0.0, |record| record.time),
        eroded_fraction: last.map_or(0.0, |record| record.eroded_fraction),
        eroded_grains: last.map_or(0, |record| record.eroded_grains),
        windows,
        whole,
        records,
    })
}

/// The file as JSON; `None` where there is none.
fn read_json(path: &Path) -> Result<Option<Value>, Error> {
    if !path.exists() {
        return Ok(None);
    }
    let text = io::plain::text(path, io::plain::LONGEST_CASE)
        .map_err(|error| Error::Io(error.to_string()))?;
    serde_json::from_str(&text)
        .map(Some)
        .map_err(|error| Error::Io(format!("{}: {error}", path.display())))
}

/// What the summary would say, from the case as written.
fn summary_from_case(folder: &Path, records: &[ErosionRecord]) -> Result<ErosionSummary, Error> {
    let path = folder.join("case.json");
    let missing = |what: &str| Error::Io(format!("{}: {what}", path.display()));
    let case = read_json(&path)?.ok_or_else(|| {
        missing("no summary.json with `erosion` in the run folder, and no case.json either")
    })?;
    let cohesion = &bare(&case["contact"])["cohesive_frictional"]["cohesion"];
    let cohesion = bare(&bare(cohesion)["per_diameter"])
        .as_f64()
        .ok_or_else(|| missing("contact.cohesive_frictional.cohesion.per_diameter is missing"))?;
    let boundaries = bare(&case["fluid"]["lattice_boltzmann"]["boundaries"]);
    let (mut pressures, mut ramp_end) = (Vec::new(), 0.0_f64);
    for boundary in boundaries.as_array().into_iter().flatten() {
        let condition = &boundary["condition"]["pressure"];
        if let Some(value) = bare(&condition["value"]).as_f64() {
            pressures.push(value);
            let duration = &bare(&condition["ramp"])["duration"];
            ramp_end = ramp_end.max(bare(duration).as_f64().unwrap_or(0.0));
        }
    }
    let most = pressures.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = pressures.iter().copied().fold(f64::INFINITY, f64::min);
    if pressures.len() < 2 {
        return Err(missing(
            "fluid.lattice_boltzmann.boundaries holds fewer than two pressure conditions",
        ));
    }
    let eroded = records
        .iter()
        .rev()
        .find(|record| record.eroded_fraction > 0.0);
    let first = records.first();
    Ok(ErosionSummary {
        cohesion,
        pressure_difference: most - least,
        ramp_end,
        initial_mass: eroded.map_or(f64::NAN, |r| r.eroded_mass / r.eroded_fraction),
        eroded_mass: records.last().map_or(0.0, |r| r.eroded_mass),
        hole_width: first.map_or(f64::NAN, |r| r.hole_width),
        hole_length: first.map_or(f64::NAN, |r| r.hole_length),
    })
}

/// The value itself where it is written with its source.
fn bare(value: &Value) -> &Value {
    match value {
        Value::Object(map)
            if map.contains_key("value")
                && (map.contains_key("source") || map.contains_key("note")) =>
        {
            &map["value"]
        }
        other => other,
    }
}

fn write_all(report: &mut Report, output: &Path) -> Result<(), Error> {
    let fail =
        |path: &Path, error: std::io::Error| Error::Io(format!("{}: {error}", path.display()));
    fs::create_dir_all(output).map_err(|error| fail(output, error))?;
    let main = main_cohesion(&report.cohesions);
    let mut files: Vec<(String, String)> = vec![
        ("erosion_law.csv".to_owned(), law_table(&report.cohesions)),
        (
            "erosion_points.csv".to_owned(),
            points_table(&report.cohesions),
        ),
        (
            "erosion_readings.csv".to_owned(),
            readings_table(&report.cohesions),
        ),
        ("figure4.csv".to_owned(), series_table(&report.cohesions)),
        ("figure5.csv".to_owned(), line_table(&report.cohesions)),
        ("figure6.csv".to_owned(), law_table(&report.cohesions)),
    ];
    for (index, cohesion) in report.cohesions.iter().enumerate() {
        let suffix = if index == main {
            String::new()
        } else {
            format!("_C{}", cohesion.cohesion)
        };
        files.push((format!("figure4{suffix}.svg"), figure4(cohesion).to_svg()));
        files.push((format!("figure5{suffix}.svg"), figure5(cohesion).to_svg()));
    }
    files.push((
        "figure6.svg".to_owned(),
        figure6(&report.cohesions).to_svg(),
    ));
    for (name, text) in files {
        let path = output.join(name);
        fs::write(&path, text).map_err(|error| fail(&path, error))?;
        report.files.push(path);
    }
    let path = output.join("erosion_law.json");
    report.files.push(path.clone());
    let text = serde_json::to_string_pretty(report)
        .map_err(|error| Error::Internal(format!("the report as JSON: {error}")))?;
    fs::write(&path, text + "\n").map_err(|error| fail(&path, error))
}

/// The cohesion whose figures bear no suffix.
fn main_cohesion(cohesions: &[CohesionReport]) -> usize {
    cohesions
        .iter()
        .position(|c| close(c.cohesion, PAPER_COHESION))
        .or_else(|| {
            (0..cohesions.len())
                .rev()
                .max_by_key(|&k| cohesions[k].runs.len())
        })
        .unwrap_or(0)
}

fn law_table(cohesions: &[CohesionReport]) -> String {
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
            Some(Law::Fitted(fit)) => writeln!(
                text,
                "{c},fitted,{:e},{:e},{:e},{:e},{:e},{:e},{},{},{counts},{:e},{:e}",
                fit.critical_shear,
                fit.critical_shear_interval.low,
                fit.critical_shear_interval.high,
                fit.coefficient,
                fit.coefficient_interval.low,
                fit.coefficient_interval.high,
                fit.r_squared,
                fit.scatter,
                fit.coefficient_median,
                fit.critical_shear_median,
            ),
            Some(Law::LowerBound { at_least }) => {
                writeln!(text, "{c},lower_bound,,{at_least:e},,,,,,,{counts},,")
            }
            Some(Law::Bracketed { above, below }) => {
                writeln!(text, "{c},bracketed,,{above:e},{below:e},,,,,,{counts},,")
            }
            None => writeln!(text, "{c},none,,,,,,,,,{counts},,"),
        };
    }
    text
}

fn readings_table(cohesions: &[CohesionReport]) -> String {
    let mut text = "cohesion [N/m],points,stress,law,critical_shear [Pa],critical_shear_low [Pa],critical_shear_high [Pa],\
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
                Some(Law::Fitted(fit)) => writeln!(
                    text,
                    "{head},fitted,{:e},{:e},{:e},{:e},{:e},{:e},{}",
                    fit.critical_shear,
                    fit.critical_shear_interval.low,
                    fit.critical_shear_interval.high,
                    fit.coefficient,
                    fit.coefficient_interval.low,
                    fit.coefficient_interval.high,
                    fit.r_squared,
                ),
                Some(Law::LowerBound { at_least }) => {
                    writeln!(text, "{head},lower_bound,,{at_least:e},,,,,")
                }
                Some(Law::Bracketed { above, below }) => {
                    writeln!(text, "{head},bracketed,,{above:e},{below:e},,,,")
                }
                None => writeln!(text, "{head},none,,,,,,,"),
            };
        }
    }
    text
}

fn points_table(cohesions: &[CohesionReport]) -> String {
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

/// At most 400 of the records, first and last among them: what a figure can show.
fn thinned(records: &[ErosionRecord]) -> Vec<ErosionRecord> {
    let count = records.len().min(400);
    (0..count)
        .map(|k| records[k * (records.len() - 1) / (count - 1).max(1)])
        .collect()
}

fn series_table(cohesions: &[CohesionReport]) -> String {
    let mut text =
        "cohesion [N/m],pressure_difference [Pa],time [s],eroded_fraction [1]\n".to_owned();
    for cohesion in cohesions {
        for run in &cohesion.runs {
            for record in thinned(&run.records) {
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

/// Stresses at which the line of a fit is drawn.
fn line_stresses(cohesion: &CohesionReport, fit: &LinearLaw) -> Vec<f64> {
    let most = points(cohesion).iter().map(|p| p.shear).fold(0.0, f64::max);
    let mut stresses: Vec<f64> = (0..=120_u32)
        .map(|k| most * 1.04 * f64::from(k) / 120.0)
        .collect();
    stresses.push(fit.critical_shear);
    stresses.sort_by(f64::total_cmp);
    stresses
}

fn line_table(cohesions: &[CohesionReport]) -> String {
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
        if let Some(Law::Fitted(fit)) = &cohesion.law {
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

fn figure4(cohesion: &CohesionReport) -> Figure {
    let count = cohesion.runs.len();
    // The highest pressure first, as the curves lie.
    let layers = cohesion
        .runs
        .iter()
        .enumerate()
        .rev()
        .map(|(index, run)| {
            let points = thinned(&run.records)
                .iter()
                .map(|record| (record.time, record.eroded_fraction))
                .collect();
            Layer::new(
                Shape::Line {
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
    let y = Axis::linear("eroded mass M_{e} / M_{0}", "");
    Figure {
        panels: vec![Panel {
            title: format!("Eroded mass, C/d = {} N/m", cohesion.cohesion),
            x: Axis::linear("time", "s"),
            y: if top > 0.5 {
                y.over(0.0, 1.0)
            } else {
                y.over(0.0, (1.08 * top).max(1e-3))
            },
            layers,
            legend: Legend::Right,
            legend_title: "ΔP (Pa)".to_owned(),
        }],
    }
}

/// A value with its interval as text: `9.1 [8.2, 10.0]`.
fn with_interval(value: f64, interval: Interval) -> String {
    format!(
        "{} [{}, {}]",
        digits(value),
        digits(interval.low),
        digits(interval.high)
    )
}

/// Three significant digits.
fn digits(value: f64) -> String {
    if (0.01..1000.0).contains(&value.abs()) {
        let decimals = match value.abs() {
            100.0.. => 0,
            10.0.. => 1,
            1.0.. => 2,
            0.1.. => 3,
            _ => 4,
        };
        format!("{value:.decimals$}")
    } else if value.abs() < f64::MIN_POSITIVE {
        "0".to_owned()
    } else {
        format!("{value:.2e}")
    }
}

/// The same for a figure, `9.71·10^{-4}`.
fn digits_in_figure(value: f64) -> String {
    match digits(value).split_once('e') {
        Some((mantissa, power)) => {
            format!("{mantissa}·10^{{{}}}", power.replace('-', "\u{2212}"))
        }
        None => digits(value),
    }
}

fn figure5(cohesion: &CohesionReport) -> Figure {
    let mut layers = Vec::new();
    let mut title = format!("Erosion rate, C/d = {} N/m", cohesion.cohesion);
    if let Some(Law::Fitted(fit)) = &cohesion.law {
        let stresses = line_stresses(cohesion, fit);
        let band = stresses
            .iter()
            .map(|&shear| {
                let Interval { low, high } = fit.rate_interval(shear);
                (shear, low, high)
            })
            .collect();
        layers.push(Layer::new(
            Shape::Band { points: band },
            CATEGORY[1],
            "95 % band",
        ));
        let line = stresses
            .iter()
            .map(|&shear| (shear, fit.rate(shear)))
            .collect();
        let label = format!(
            "k_{{d}} = {} s/m, τ_{{c}} = {} Pa",
            digits_in_figure(fit.coefficient),
            digits_in_figure(fit.critical_shear)
        );
        layers.push(Layer::new(
            Shape::Line {
                points: line,
                dashed: false,
            },
            CATEGORY[1],
            &label,
        ));
        let _ = write!(title, ", R^{{2}} = {:.3}", fit.r_squared);
    }
    for (eroding, label) in [(false, "no erosion"), (true, "runs, 95 % bars")] {
        let marks: Vec<Mark> = cohesion
            .runs
            .iter()
            .flat_map(|run| measured(run, cohesion.points))
            .filter(|w| w.eroding == eroding)
            .map(|w| Mark {
                x: w.shear,
                y: w.rate,
                x_bar: None,
                y_bar: eroding.then(|| {
                    (
                        (w.rate - 1.96 * w.rate_error).max(0.0),
                        w.rate + 1.96 * w.rate_error,
                    )
                }),
            })
            .collect();
        if !marks.is_empty() {
            layers.push(Layer::new(
                Shape::Marks {
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
            x: Axis::linear("hydraulic shear stress τ_{h}", "Pa"),
            y: Axis::linear("erosion rate", "kg m^{\u{2212}2} s^{\u{2212}1}"),
            layers,
            legend: Legend::TopLeft,
            legend_title: String::new(),
        }],
    }
}

fn figure6(cohesions: &[CohesionReport]) -> Figure {
    let (mut thresholds, mut slopes, mut lower, mut brackets) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for cohesion in cohesions {
        let x = cohesion.cohesion;
        match &cohesion.law {
            Some(Law::Fitted(fit)) => {
                let bar = |interval: Interval| Some((interval.low, interval.high));
                thresholds.push(Mark {
                    y_bar: bar(fit.critical_shear_interval),
                    ..Mark::at(x, fit.critical_shear)
                });
                slopes.push(Mark {
                    y_bar: bar(fit.coefficient_interval),
                    ..Mark::at(x, fit.coefficient)
                });
            }
            Some(Law::LowerBound { at_least }) => lower.push((x, *at_least)),
            Some(Law::Bracketed { above, below }) => brackets.push(Mark {
                y_bar: Some((*above, *below)),
                ..Mark::at(x, 0.5 * (above + below))
            }),
            None => {}
        }
    }
    let paper = |y: f64| {
        Layer::new(
            Shape::Marks {
                marks: vec![Mark::at(PAPER_COHESION, y)],
                style: Style::Ring,
            },
            CATEGORY[2],
            "paper, C/d = 0.506 N/m",
        )
    };
    let marks = |marks: Vec<Mark>, style, label: &str| {
        Layer::new(Shape::Marks { marks, style }, CATEGORY[1], label)
    };
    let mut first = Vec::new();
    if !brackets.is_empty() {
        first.push(marks(brackets, Style::Hollow, "bracket"));
    }
    if !lower.is_empty() {
        first.push(Layer::new(
            Shape::LowerBounds { points: lower },
            CATEGORY[1],
            "no erosion: lower bound",
        ));
    }
    first.push(marks(thresholds, Style::Filled, "fit, 95 % interval"));
    first.push(paper(PAPER_CRITICAL_SHEAR));
    let top = slopes
        .iter()
        .filter_map(|mark| mark.y_bar)
        .map(|bar| bar.1)
        .fold(PAPER_COEFFICIENT, f64::max);
    let second = vec![
        marks(slopes, Style::Filled, "fit, 95 % interval"),
        paper(PAPER_COEFFICIENT),
    ];
    // Both panels share the cohesions, with room for a point at either end.
    let (low, high) = cohesions
        .iter()
        .map(|c| c.cohesion)
        .filter(|c| *c > 0.0)
        .fold((PAPER_COHESION, PAPER_COHESION), |(low, high), c| {
            (low.min(c), high.max(c))
        });
    let x = || Axis::log("cohesion C/d", "N/m").over(low / 1.6, high * 1.6);
    let panel = |title: &str, y, layers, legend| Panel {
        title: title.to_owned(),
        x: x(),
        y,
        layers,
        legend,
        legend_title: String::new(),
    };
    Figure {
        panels: vec![
            panel(
                "(a) Critical shear stress",
                Axis::log("τ_{c}", "Pa"),
                first,
                Legend::TopLeft,
            ),
            panel(
                "(b) Erosion coefficient",
                Axis::linear("k_{d}", "s/m").over(0.0, 1.3 * top),
                second,
                Legend::TopLeft,
            ),
        ],
    }
}

/// Threshold, coefficient and R2 of a law, for the terminal.
fn words(law: Option<&Law>) -> [String; 3] {
    match law {
        Some(Law::Fitted(fit)) => [
            with_interval(fit.critical_shear, fit.critical_shear_interval),
            with_interval(fit.coefficient, fit.coefficient_interval),
            format!("{:.3}", fit.r_squared),
        ],
        Some(Law::LowerBound { at_least }) => [
            format!(">= {}", digits(*at_least)),
            "no erosion".to_owned(),
            String::new(),
        ],
        Some(Law::Bracketed { above, below }) => [
            format!("between {} and {}", digits(*above), digits(*below)),
            "one stress erodes".to_owned(),
            String::new(),
        ],
        None => ["no point".to_owned(), String::new(), String::new()],
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:>10}  {:>4}  {:>6}  {:>8}  {:>32}  {:>26}  {:>6}",
            "C/d (N/m)", "runs", "points", "stress", "tau_c (Pa)", "k_d (s/m)", "R2"
        )?;
        for cohesion in &self.cohesions {
            for (stress, name) in [(Stress::Gradient, "gradient"), (Stress::Balance, "balance")] {
                let of = |reading: &&Reading| {
                    reading.points == cohesion.points && reading.stress == stress
                };
                let law = cohesion.readings.iter().find(of);
                let [threshold, slope, fit] = words(law.and_then(|reading| reading.law.as_ref()));
                writeln!(
                    f,
                    "{:>10}  {:>4}  {:>6}  {name:>8}  {threshold:>32}  {slope:>26}  {fit:>6}",
                    cohesion.cohesion,
                    cohesion.runs.len(),
                    points_of(cohesion, cohesion.points, stress).len(),
                )?;
            }
        }
        writeln!(
            f,
            "Stress by the gradient of the velocity at the faces (the paper's equation 10), which the figures have, and by the balance of forces on the hole."
        )?;
        writeln!(
            f,
            "Intervals are 95 %. Paper at C/d = {PAPER_COHESION} N/m: tau_c = {PAPER_CRITICAL_SHEAR:.1e} Pa, k_d = {PAPER_COEFFICIENT} s/m."
        )?;
        if let Some(trend) = &self.trend {
            if let (Some(slope), Some(interval)) = (
                trend.coefficient_exponent,
                trend.coefficient_exponent_interval,
            ) {
                writeln!(
                    f,
                    "k_d ~ C^{slope:.2} [{:.2}, {:.2}]: {}; (max - min)/mean of k_d = {:.2}",
                    interval.low,
                    interval.high,
                    if trend.coefficient_has_trend {
                        "a trend"
                    } else {
                        "no significant trend"
                    },
                    trend.coefficient_variation
                )?;
            }
            writeln!(
                f,
                "tau_c {} with C",
                if trend.critical_shear_increases {
                    "increases"
                } else {
                    "does not increase steadily"
                }
            )?;
        }
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        for file in &self.files {
            writeln!(f, "wrote {}", file.display())?;
        }
        Ok(())
    }
}

/// `solver erosion-law`: the tables of [`run`] as text or JSON.
///
/// # Errors
/// As [`run`].
pub fn command(runs: &[PathBuf], output: &Path, json: bool) -> Result<String, Error> {
    let report = run(runs, output)?;
    if json {
        serde_json::to_string_pretty(&report).map_err(|e| Error::Internal(e.to_string()))
    } else {
        Ok(report.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::super::erosion_law::fit::tests::Draws;
    use super::super::erosion_law::{Row, write_rows};
    use super::*;

    const GRAIN: f64 = 8.5e-5;
    const INITIAL: f64 = 0.12;
    const LENGTH: f64 = 1.2e-2;

    /// A run folder of a hole that follows the law: grains leave at random, the hole widens.
    fn write_run(
        root: &Path,
        pressure: f64,
        cohesion: f64,
        law: (f64, f64),
        summary: bool,
    ) -> PathBuf {
        let folder = root.join(format!("C{cohesion}_P{pressure}"));
        fs::create_dir_all(&folder).unwrap();
        let mut draws = Draws::new(1 + (pressure * 1e3).to_bits() % 1000);
        let (mut width, mut mass, mut grains) = (8e-4, 0.0, 0_u64);
        let (mut removed, mut records) = (Vec::new(), Vec::new());
        let dt = 0.05;
        for step in 0..=600_u32 {
            let time = dt * f64::from(step);
            let shear = pressure * width / (2.0 * LENGTH);
            let jitter = |draws: &mut Draws| shear * (1.0 + 0.03 * draws.normal());
            records.push(ErosionRecord {
                step: u64::from(step) * 100,
                time,
                eroded_mass: mass,
                eroded_fraction: mass / INITIAL,
                eroded_grains: grains,
                lower_face: 2e-3 - 0.5 * width,
                upper_face: 2e-3 + 0.5 * width,
                hole_width: width,
                hole_length: LENGTH,
                shear_gradient: jitter(&mut draws),
                shear_balance: shear,
                shear_traction: jitter(&mut draws),
                pressure_difference: pressure,
                discharge: 0.0,
                bonds_broken: grains,
                bonds_broken_inside: 0,
                bonds_broken_at_wall: grains,
                mach: 0.05,
                mass_error: 0.0,
            });
            let expected = law.1 * (shear - law.0).max(0.0) * 2.0 * LENGTH * dt / GRAIN;
            let mut clock = draws.exponential(1.0);
            while clock < expected && mass + GRAIN < INITIAL {
                mass += GRAIN;
                width += GRAIN / (2200.0 * LENGTH);
                removed.push(RemovedGrain {
                    step: u64::from(step) * 100,
                    time,
                    id: grains,
                    mass: GRAIN,
                    radius: 1e-4,
                    x: 1.68e-2,
                    y: 2e-3,
                    z: 0.0,
                });
                grains += 1;
                clock += draws.exponential(1.0);
            }
        }
        write_rows(&folder.join("erosion.csv"), &records).unwrap();
        write_rows(&folder.join("removed.csv"), &removed).unwrap();
        if summary {
            let erosion = ErosionSummary {
                cohesion,
                pressure_difference: pressure,
                ramp_end: 0.0,
                initial_mass: INITIAL,
                eroded_mass: mass,
                hole_width: 8e-4,
                hole_length: LENGTH,
            };
            let summary = serde_json::json!({"outcome": "done", "erosion": erosion});
            fs::write(folder.join("summary.json"), summary.to_string()).unwrap();
        } else {
            let case = serde_json::json!({
                "contact": {"cohesive_frictional": {"cohesion": {"per_diameter": {"value": cohesion, "source": "paper"}}}},
                "fluid": {"lattice_boltzmann": {"boundaries": [
                    {"condition": {"pressure": {"value": {"value": pressure + 1.0, "source": "paper"}}}},
                    {"condition": {"pressure": {"value": 1.0}}},
                    {"condition": {"no_slip": {}}},
                ]}},
            });
            fs::write(folder.join("case.json"), case.to_string()).unwrap();
        }
        folder
    }

    const PRESSURES: [f64; 10] = [0.01, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5];

    /// `PLOT_TO` names a folder where a person can look at the figures.
    fn figures(folder: &Path) -> PathBuf {
        std::env::var_os("PLOT_TO").map_or_else(|| folder.join("out"), PathBuf::from)
    }

    #[test]
    fn a_study_gives_the_laws_it_was_made_with() {
        let root = tempfile::tempdir().unwrap();
        let series = [(0.253, 6e-4), (0.506, 9e-4), (1.27, 2.4e-3), (12.7, 1.0)];
        let mut runs = Vec::new();
        for (cohesion, threshold) in series {
            for pressure in PRESSURES {
                runs.push(write_run(
                    root.path(),
                    pressure,
                    cohesion,
                    (threshold, 9.1),
                    true,
                ));
            }
        }
        let output = figures(root.path());
        let report = run(&runs, &output).unwrap();
        assert_eq!(report.cohesions.len(), 4);
        for (cohesion, (_, threshold)) in report.cohesions[..3].iter().zip(series) {
            let Some(Law::Fitted(fit)) = &cohesion.law else {
                panic!("{:?}", cohesion.law)
            };
            assert!(fit.coefficient_interval.contains(9.1), "{fit:?}");
            assert!(fit.critical_shear_interval.contains(threshold), "{fit:?}");
            assert!(fit.r_squared > 0.9);
        }
        let Some(Law::LowerBound { at_least }) = report.cohesions[3].law else {
            panic!("{:?}", report.cohesions[3].law)
        };
        assert!((at_least / (0.5 * 8e-4 / (2.0 * LENGTH)) - 1.0).abs() < 0.01);
        let trend = report.trend.as_ref().unwrap();
        assert!(!trend.coefficient_has_trend && trend.critical_shear_increases);
        for name in [
            "erosion_law.csv",
            "erosion_points.csv",
            "figure4.csv",
            "figure4.svg",
            "figure4_C0.253.svg",
            "figure5.csv",
            "figure5.svg",
            "figure6.csv",
            "figure6.svg",
            "erosion_law.json",
        ] {
            assert!(output.join(name).is_file(), "{name}");
        }
        let table = fs::read_to_string(output.join("erosion_law.csv")).unwrap();
        let widths: Vec<usize> = table.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(widths, [15; 5], "{table}");
        let shown = report.to_string();
        assert!(
            shown.contains("no erosion") && shown.contains("no significant trend"),
            "{shown}"
        );
    }

    /// Grains that the cut left loose leave at any cohesion; without a broken bond nothing eroded.
    #[test]
    fn loose_grains_are_no_erosion() {
        let root = tempfile::tempdir().unwrap();
        let runs: Vec<PathBuf> = [0.3, 0.5]
            .map(|pressure| write_run(root.path(), pressure, 12.7, (1e-3, 9.1), true))
            .into();
        let law = |output: &str| {
            run(&runs, &root.path().join(output))
                .unwrap()
                .cohesions
                .remove(0)
                .law
        };
        assert!(matches!(law("bonds"), Some(Law::Fitted(_))));
        for folder in &runs {
            let file = folder.join("erosion.csv");
            let mut rows = read_rows::<ErosionRecord>(&file, |row| row.step).unwrap();
            assert!(rows.last().unwrap().eroded_grains > 3);
            for row in &mut rows {
                row.bonds_broken = 0;
            }
            write_rows(&file, &rows).unwrap();
        }
        let found = law("none");
        assert!(matches!(found, Some(Law::LowerBound { .. })), "{found:?}");
    }

    #[test]
    fn a_run_without_summary_is_read_from_its_case() {
        let root = tempfile::tempdir().unwrap();
        let with = write_run(root.path(), 0.3, 0.506, (9e-4, 9.1), true);
        let first = run(&[with], &root.path().join("a")).unwrap();
        let without = write_run(&root.path().join("b"), 0.3, 0.506, (9e-4, 9.1), false);
        let second = run(&[without], &root.path().join("b")).unwrap();
        let (a, b) = (&first.cohesions[0].runs[0], &second.cohesions[0].runs[0]);
        assert!((a.pressure_difference - b.pressure_difference).abs() < 1e-12);
        assert!(close(a.cohesion, b.cohesion));
        assert_eq!(a.windows, b.windows);
        assert_eq!(b.outcome, "unfinished");
        assert_eq!(second.warnings.len(), 1);
    }

    #[test]
    fn the_same_runs_give_the_same_files() {
        let root = tempfile::tempdir().unwrap();
        let mut runs: Vec<PathBuf> = PRESSURES
            .iter()
            .map(|&pressure| write_run(root.path(), pressure, 0.506, (9e-4, 9.1), true))
            .collect();
        run(&runs, &root.path().join("a")).unwrap();
        runs.reverse();
        run(&runs, &root.path().join("b")).unwrap();
        for name in [
            "erosion_law.csv",
            "figure4.svg",
            "figure5.svg",
            "figure5.csv",
            "figure6.svg",
        ] {
            let read =
                |folder: &str| fs::read_to_string(root.path().join(folder).join(name)).unwrap();
            assert_eq!(read("a"), read("b"), "{name}");
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let root = tempfile::tempdir().unwrap();
        let error = run(&[], root.path()).unwrap_err().to_string();
        assert!(error.contains("at least one run"), "{error}");
        let error = run(&[root.path().join("nowhere")], root.path())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("nowhere") && error.contains("erosion.csv"),
            "{error}"
        );
        let folder = write_run(root.path(), 0.3, 0.506, (9e-4, 9.1), true);
        fs::remove_file(folder.join("summary.json")).unwrap();
        let error = run(std::slice::from_ref(&folder), root.path())
            .unwrap_err()
            .to_string();
        assert!(error.contains("case.json"), "{error}");
        fs::write(folder.join("case.json"), "{}").unwrap();
        let error = run(std::slice::from_ref(&folder), root.path())
            .unwrap_err()
            .to_string();
        assert!(error.contains("per_diameter"), "{error}");
        fs::write(folder.join("erosion.csv"), ErosionRecord::header() + "\n").unwrap();
        fs::write(folder.join("summary.json"), "{").unwrap();
        assert!(run(&[folder], root.path()).is_err());
    }
}
