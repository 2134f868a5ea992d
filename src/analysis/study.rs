//! The erosion law across runs: reads run folders and fits the law of each cohesion.
//!
//! A run folder contains `erosion.csv` and `summary.json` with the key `erosion` ([`ErosionSummary`]);
//! `removed.csv` is used if it exists. A run that has not finished has no summary yet. Its pressure, cohesion and
//! hole are then read from its `case.json`, and its masses from the record.
//!
//! The law is fitted to one point per run and to the stress from the velocity gradient. With fewer than three runs it
//! is fitted to the windows of the runs. The report also contains the fits with the other definitions; their
//! differences are the uncertainty of the definition. `figures::erosion_law` writes tables and figures.

use super::erosion_law::{
    CohesionTrend, ErosionRecord, ErosionSummary, FitOptions, FittedErosionLaw, RatePoint,
    RateWindow, RemovedGrain, WindowOptions, cohesion_trend, erosion_windows, fit_law, mean_jump,
    read_rows, run_point,
};
use base::error::Error;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Displacement in mean diameters above which the bulk counts as failed; a bulk next to eroding faces is
/// stationary.
const FAILURE_DISPLACEMENT: f64 = 1.0;

/// Data of one run.
#[derive(Clone, Debug, serde::Serialize)]
pub struct RunReport {
    /// Folder of the run.
    pub folder: PathBuf,
    /// `outcome` of the summary; `unfinished` without a summary.
    pub outcome: String,
    /// Pressure difference \[Pa\].
    pub pressure_difference: f64,
    /// C/d [N/m].
    pub cohesion: f64,
    /// Last time of the records \[s\].
    pub end: f64,
    /// M_e / M_0 at the end.
    pub eroded_fraction: f64,
    /// Number of grains that left.
    pub eroded_grains: u64,
    /// Fraction of the bonds broken before a tenth of the mass had left that broke at the wall of the hole; none if
    /// no bond broke.
    pub face_share: Option<f64>,
    /// Mean displacement of the bulk at the time at which a tenth of the mass had left, or at the end if less has
    /// left, in mean diameters.
    pub bulk_displacement: Option<f64>,
    /// Windows of the run.
    pub windows: Vec<RateWindow>,
    /// The run as one hole erosion test.
    pub whole: Option<RateWindow>,
    /// Rows of `erosion.csv`.
    #[serde(skip)]
    pub records: Vec<ErosionRecord>,
}

/// Runs of one cohesion and their law.
#[derive(Clone, Debug, serde::Serialize)]
pub struct CohesionReport {
    /// C/d [N/m].
    pub cohesion: f64,
    /// Runs in order of pressure.
    pub runs: Vec<RunReport>,
    /// Kind of points to which the law is fitted.
    pub points: Points,
    /// Fitted law; `None` if no run has a point.
    pub law: Option<FittedErosionLaw>,
    /// Fits with all kinds of points and stresses, including the law's own.
    pub readings: Vec<Reading>,
}

/// Kind of the points of the law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Points {
    /// Each run as a whole.
    Runs,
    /// Each window of each run.
    Windows,
}

/// Method by which the stress is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stress {
    /// Velocity gradient at the faces (the paper's equation 10).
    Gradient,
    /// Balance of forces on the hole.
    Balance,
    /// Summed traction on the grains of the faces.
    Traction,
}

/// Law fitted with one kind of points and one kind of stress.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Reading {
    /// Kind of points.
    pub points: Points,
    /// Kind of stress.
    pub stress: Stress,
    /// Fitted law; `None` without points.
    pub law: Option<FittedErosionLaw>,
}

/// Results and files of `solver erosion-law`.
#[derive(Clone, Debug, serde::Serialize)]
pub struct ErosionLawReport {
    /// Reports by cohesion.
    pub cohesions: Vec<CohesionReport>,
    /// Trend over the cohesions; `None` for fewer than two fits.
    pub trend: Option<CohesionTrend>,
    /// Files that were written.
    pub files: Vec<PathBuf>,
    /// Warnings for the reader, such as runs that ended early.
    pub warnings: Vec<String>,
}

/// Reads the runs and fits their laws.
///
/// # Errors
/// If a run cannot be read, or holds no pressure or cohesion, [`Error::Io`].
pub fn fit(runs: &[PathBuf]) -> Result<ErosionLawReport, Error> {
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
    let laws: Vec<(f64, FittedErosionLaw)> = cohesions
        .iter()
        .filter_map(|c| c.law.clone().map(|law| (c.cohesion, law)))
        .collect();
    Ok(ErosionLawReport {
        trend: cohesion_trend(&laws),
        cohesions,
        files: Vec::new(),
        warnings,
    })
}

/// Returns `true` if the numbers are equal within the rounding of their text.
#[must_use]
pub fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs())
}

/// Returns the points to which the law is fitted.
#[must_use]
pub fn points(cohesion: &CohesionReport) -> Vec<RatePoint> {
    points_of(cohesion, cohesion.points, Stress::Gradient)
}

/// Returns the windows of a run, or the whole run as one window.
#[must_use]
pub fn measured(run: &RunReport, points: Points) -> Vec<RateWindow> {
    match points {
        Points::Runs => run.whole.into_iter().collect(),
        Points::Windows => run.windows.clone(),
    }
}

/// Returns the points of a reading.
#[must_use]
pub fn points_of(cohesion: &CohesionReport, points: Points, stress: Stress) -> Vec<RatePoint> {
    let mut all = Vec::new();
    for (index, run) in cohesion.runs.iter().enumerate() {
        let measured = measured(run, points);
        // Some grains left the whole run, but no point of it counts as eroding.
        let undecided = run.whole.is_some_and(|whole| whole.rate > 0.0)
            && !measured.iter().any(|window| window.eroding);
        for mut window in measured {
            window.shear = match stress {
                Stress::Gradient => window.shear,
                Stress::Balance => window.shear_balance,
                Stress::Traction => window.shear_traction,
            };
            all.push(RatePoint::new(index, &window, undecided));
        }
    }
    all
}

fn read_run(folder: &Path, warnings: &mut Vec<String>) -> Result<RunReport, Error> {
    let table = folder.join("erosion.csv");
    if !table.exists() {
        return Err(Error::Io(if folder.is_dir() {
            format!(
                "{}: the run has no erosion.csv, which a case with `analysis.erosion_law` writes; add it to the case \
                 and run it again",
                folder.display()
            )
        } else {
            format!(
                "{}: there is no such folder; name the folder of a run with its erosion.csv",
                folder.display()
            )
        }));
    }
    let records = read_rows::<ErosionRecord>(&table, |row| row.step)?;
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
            "{}: {outcome}, used up to {end:.4} s",
            folder.display()
        ));
    }
    let options = WindowOptions::default();
    // If no grain has left, the mean mass of a grain is unknown and is taken as 1e-4 of the sample.
    let jump = mean_jump(&removed, &records).unwrap_or(1e-4 * about.initial_mass);
    let mut windows = erosion_windows(&records, jump, about.ramp_end, options);
    let mut whole = run_point(&records, jump, about.ramp_end, options);
    let left = records.last().map_or(0, |record| record.eroded_grains);
    if about.cohesion > 0.0 && left > 0 && records.iter().all(|r| r.bonds_broken == 0) {
        // Cutting a hole frees some grains from all their bonds. The water removes them at any cohesion, although
        // the soil is intact.
        for window in windows.iter_mut().chain(whole.as_mut()) {
            window.eroding = false;
            window.rate = 0.0;
            window.rate_median = 0.0;
        }
        warnings.push(format!(
            "{}: no bond broke: the {left} grains that were removed were loose after the cut and do not count as \
             erosion",
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
    let known = |value: f64| value.is_finite().then_some(value);
    let face_share = about
        .face_share
        .or_else(|| known(last.map_or(f64::NAN, |record| record.face_share)));
    let bulk_displacement = about.bulk_displacement.or_else(|| {
        let rows = records.iter().rev();
        let before = rows.filter(|row| row.eroded_fraction < 0.1);
        before.map(|row| row.bulk_displacement).find_map(known)
    });
    if let Some(moved) = bulk_displacement
        && moved > FAILURE_DISPLACEMENT
    {
        warnings.push(format!(
            "{}: the bulk failed: it had moved by {moved:.1} mean diameters before a tenth of the mass was \
             eroded, but the law describes erosion of the faces only",
            folder.display(),
        ));
    }
    Ok(RunReport {
        folder: folder.to_path_buf(),
        outcome,
        pressure_difference: about.pressure_difference,
        cohesion: about.cohesion,
        end: last.map_or(0.0, |record| record.time),
        eroded_fraction: last.map_or(0.0, |record| record.eroded_fraction),
        eroded_grains: last.map_or(0, |record| record.eroded_grains),
        face_share,
        bulk_displacement,
        windows,
        whole,
        records,
    })
}

/// Returns the contents of a JSON file; `None` if it does not exist.
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

/// Returns the contents of the summary, computed from the case file.
fn summary_from_case(folder: &Path, records: &[ErosionRecord]) -> Result<ErosionSummary, Error> {
    let path = folder.join("case.json");
    let missing = |what: &str| Error::Io(format!("{}: {what}", path.display()));
    let case = read_json(&path)?.ok_or_else(|| {
        missing("no summary.json with `erosion` in the run folder, and no case.json either")
    })?;
    let cohesion = &without_source(&case["contact"])["cohesive_frictional"]["cohesion"];
    let cohesion = without_source(&without_source(cohesion)["per_diameter"])
        .as_f64()
        .ok_or_else(|| missing("contact.cohesive_frictional.cohesion.per_diameter is missing"))?;
    let boundaries = without_source(&case["fluid"]["lattice_boltzmann"]["boundaries"]);
    let (mut pressures, mut ramp_end) = (Vec::new(), 0.0_f64);
    for boundary in boundaries.as_array().into_iter().flatten() {
        let condition = &boundary["condition"]["pressure"];
        if let Some(value) = without_source(&condition["value"]).as_f64() {
            pressures.push(value);
            let duration = &without_source(&condition["ramp"])["duration"];
            ramp_end = ramp_end.max(without_source(duration).as_f64().unwrap_or(0.0));
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
        contacts_per_grain: None,
        bonds_per_grain: None,
        face_share: None,
        bulk_displacement: None,
    })
}

/// Returns the value without its source, if the source is stated with it.
fn without_source(value: &Value) -> &Value {
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
