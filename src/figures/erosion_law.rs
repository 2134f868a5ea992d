//! Tables and figures of the erosion law across runs: `solver erosion-law`.
//!
//! | file | content |
//! |---|---|
//! | `erosion_law.csv` | one row per cohesion: tau_c and k_d with intervals, or the bound |
//! | `erosion_points.csv` | one row per window and one per whole run: three stresses, rate, errors |
//! | `erosion_readings.csv` | the law for each definition: runs or windows; stress from gradient, balance or traction |
//! | `figure4.csv`, `.svg` | M_e / M_0 against time for each pressure |
//! | `figure5.csv`, `.svg` | rate against stress with the fitted line, its band, error bars |
//! | `figure6.csv`, `.svg` | tau_c and k_d against C/d; lower bounds as arrows; a published result |
//! | `erosion_law.json` | the report |
//!
//! Figures 4 and 5 without a suffix show the cohesion of the published result, otherwise the cohesion with the most
//! runs. Figures of the other cohesions have the suffix `_C<value>`.

mod plots;
mod tables;

use analysis::erosion_law::{FittedErosionLaw, Interval};
use analysis::study::{self, CohesionReport, ErosionLawReport, Reading, Stress, close, points_of};
use base::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Published result that the figures mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// C/d [N/m].
    pub cohesion: f64,
    /// Critical shear stress \[Pa\].
    pub critical_shear: f64,
    /// Erosion coefficient [s/m].
    pub coefficient: f64,
}

/// Range of valid numbers of an erosion law in SI units.
const PUBLISHED: std::ops::RangeInclusive<f64> = 1e-12..=1e12;

impl FromStr for Published {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text
            .split(',')
            .map(|word| word.trim().parse::<f64>())
            .collect::<Result<_, _>>()
            .map_err(|e| e.to_string())?;
        match numbers[..] {
            [cohesion, critical_shear, coefficient]
                if numbers.iter().all(|x| PUBLISHED.contains(x)) =>
            {
                Ok(Self {
                    cohesion,
                    critical_shear,
                    coefficient,
                })
            }
            _ => Err("write three numbers above 0: C/d [N/m], tau_c [Pa], k_d [s/m]".into()),
        }
    }
}

/// Fits the runs and writes tables and figures into `output`, which is created if it does not exist.
///
/// # Errors
/// If a run cannot be read, holds no pressure or cohesion, or a file cannot be written, [`Error::Io`].
pub fn run(
    runs: &[PathBuf],
    output: &Path,
    published: Option<Published>,
) -> Result<ErosionLawReport, Error> {
    let mut report = study::fit(runs)?;
    write_all(&mut report, output, published)?;
    Ok(report)
}

/// Runs `solver erosion-law`: returns the report of [`run`] as text or JSON.
///
/// # Errors
/// If [`run`] fails.
pub fn command(
    runs: &[PathBuf],
    output: &Path,
    published: Option<Published>,
    json: bool,
) -> Result<String, Error> {
    let report = run(runs, output, published)?;
    if json {
        serde_json::to_string_pretty(&report).map_err(|e| Error::Internal(e.to_string()))
    } else {
        Ok(text(&report, published))
    }
}

fn write_all(
    report: &mut ErosionLawReport,
    output: &Path,
    published: Option<Published>,
) -> Result<(), Error> {
    let fail =
        |path: &Path, error: std::io::Error| Error::Io(format!("{}: {error}", path.display()));
    fs::create_dir_all(output).map_err(|error| fail(output, error))?;
    let main = main_cohesion(&report.cohesions, published);
    let mut files: Vec<(String, String)> = vec![
        ("erosion_law.csv".to_owned(), tables::law(&report.cohesions)),
        (
            "erosion_points.csv".to_owned(),
            tables::windows(&report.cohesions),
        ),
        (
            "erosion_readings.csv".to_owned(),
            tables::readings(&report.cohesions),
        ),
        ("figure4.csv".to_owned(), tables::series(&report.cohesions)),
        ("figure5.csv".to_owned(), tables::line(&report.cohesions)),
        ("figure6.csv".to_owned(), tables::law(&report.cohesions)),
    ];
    for (index, cohesion) in report.cohesions.iter().enumerate() {
        let suffix = if index == main {
            String::new()
        } else {
            format!("_C{}", cohesion.cohesion)
        };
        files.push((
            format!("figure4{suffix}.svg"),
            plots::eroded_mass(cohesion).to_svg(),
        ));
        files.push((
            format!("figure5{suffix}.svg"),
            plots::rate(cohesion).to_svg(),
        ));
    }
    files.push((
        "figure6.svg".to_owned(),
        plots::law(&report.cohesions, published).to_svg(),
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

/// Returns the cohesion whose figures have no suffix.
fn main_cohesion(cohesions: &[CohesionReport], published: Option<Published>) -> usize {
    let of_published = |p: Published| cohesions.iter().position(|c| close(c.cohesion, p.cohesion));
    published
        .and_then(of_published)
        .or_else(|| {
            (0..cohesions.len())
                .rev()
                .max_by_key(|&k| cohesions[k].runs.len())
        })
        .unwrap_or(0)
}

/// Returns a value with its interval as text: `9.1 [8.2, 10.0]`.
pub(crate) fn with_interval(value: f64, interval: Interval) -> String {
    format!(
        "{} [{}, {}]",
        digits(value),
        digits(interval.low),
        digits(interval.high)
    )
}

/// Returns a number with three significant digits.
pub(crate) fn digits(value: f64) -> String {
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

/// Returns threshold, coefficient and R2 of a law as texts for the terminal.
fn words(law: Option<&FittedErosionLaw>) -> [String; 3] {
    match law {
        Some(FittedErosionLaw::Fitted(fit)) => [
            with_interval(fit.critical_shear, fit.critical_shear_interval),
            with_interval(fit.coefficient, fit.coefficient_interval),
            if fit.r_squared.is_nan() {
                "-".to_owned()
            } else {
                format!("{:.3}", fit.r_squared)
            },
        ],
        Some(FittedErosionLaw::LowerBound { at_least }) => [
            format!(">= {}", digits(*at_least)),
            "no erosion up to there".to_owned(),
            String::new(),
        ],
        Some(FittedErosionLaw::Bracketed { above, below }) => [
            format!("between {} and {}", digits(*above), digits(*below)),
            "one stress erodes".to_owned(),
            String::new(),
        ],
        Some(FittedErosionLaw::Undetermined) => [
            "unknown: no stress decides".to_owned(),
            "unknown".to_owned(),
            String::new(),
        ],
        None => ["no point".to_owned(), String::new(), String::new()],
    }
}

/// Returns the report for the terminal.
fn text(report: &ErosionLawReport, published: Option<Published>) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_text(&mut text, report, published);
    text
}

fn write_text(
    f: &mut String,
    report: &ErosionLawReport,
    published: Option<Published>,
) -> std::fmt::Result {
    writeln!(
        f,
        "{:>10}  {:>4}  {:>6}  {:>8}  {:>32}  {:>26}  {:>6}",
        "C/d (N/m)", "runs", "points", "stress", "tau_c (Pa)", "k_d (s/m)", "R2"
    )?;
    for cohesion in &report.cohesions {
        for (stress, name) in [(Stress::Gradient, "gradient"), (Stress::Balance, "balance")] {
            let of =
                |reading: &&Reading| reading.points == cohesion.points && reading.stress == stress;
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
        "Stress by the gradient of the velocity at the faces (used by the figures) and by the balance of forces on \
         the hole."
    )?;
    writeln!(f, "Intervals are 95 %.")?;
    if let Some(p) = published {
        writeln!(
            f,
            "Published at C/d = {} N/m: tau_c = {:.1e} Pa, k_d = {} s/m.",
            p.cohesion, p.critical_shear, p.coefficient
        )?;
    }
    if let Some(trend) = &report.trend {
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
    for warning in &report.warnings {
        writeln!(f, "warning: {warning}")?;
    }
    for file in &report.files {
        writeln!(f, "wrote {}", file.display())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use analysis::erosion_law::{
        ErosionRecord, ErosionSummary, RecordRow, RemovedGrain, read_rows, write_rows,
    };
    use base::random::Draws;

    const PUBLISHED: Published = Published {
        cohesion: 0.506,
        critical_shear: 9e-4,
        coefficient: 9.1,
    };
    const GRAIN: f64 = 8.5e-5;
    const INITIAL: f64 = 0.12;
    const LENGTH: f64 = 1.2e-2;

    /// Writes a run folder of a hole that follows the law: grains leave at random times and the hole widens.
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
                lattice_velocity: 0.05,
                mass_error: 0.0,
                face_share: f64::NAN,
                bulk_displacement: f64::NAN,
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
                contacts_per_grain: None,
                bonds_per_grain: None,
                face_share: None,
                bulk_displacement: None,
            };
            let summary = serde_json::json!({"outcome": "done", "erosion": erosion});
            fs::write(folder.join("summary.json"), summary.to_string()).unwrap();
        } else {
            let case = serde_json::json!({
                "contact": {"cohesive_frictional": {"cohesion": {"per_diameter": {"value": cohesion,
                    "source": "paper"}}}},
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

    /// Returns the folder of the figures; `PLOT_TO` sets another one for visual inspection.
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
        let report = run(&runs, &output, Some(PUBLISHED)).unwrap();
        assert_eq!(report.cohesions.len(), 4);
        for (cohesion, (_, threshold)) in report.cohesions[..3].iter().zip(series) {
            let Some(FittedErosionLaw::Fitted(fit)) = &cohesion.law else {
                panic!("{:?}", cohesion.law)
            };
            assert!(fit.coefficient_interval.contains(9.1), "{fit:?}");
            assert!(fit.critical_shear_interval.contains(threshold), "{fit:?}");
            assert!(fit.r_squared > 0.9);
        }
        let Some(FittedErosionLaw::LowerBound { at_least }) = report.cohesions[3].law else {
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
        let shown = text(&report, Some(PUBLISHED));
        assert!(
            shown.contains("no erosion") && shown.contains("no significant trend"),
            "{shown}"
        );
    }

    #[test]
    fn a_bulk_that_fails_is_distinguished_from_faces_that_erode() {
        let root = tempfile::tempdir().unwrap();
        let folder = write_run(root.path(), 0.3, 0.506, (1e-3, 9.1), false);
        let file = folder.join("erosion.csv");
        for (moved, told) in [(2.5, 1), (0.1, 0), (f64::NAN, 0)] {
            let mut rows = read_rows::<ErosionRecord>(&file, |row| row.step).unwrap();
            for row in &mut rows {
                // Later displacements are not part of the mechanism.
                let late = row.eroded_fraction >= 0.1;
                row.bulk_displacement = if late { 50.0 } else { moved };
            }
            write_rows(&file, &rows).unwrap();
            let runs = std::slice::from_ref(&folder);
            let report = run(runs, &root.path().join("out"), None).unwrap();
            let found = report.warnings.iter();
            let of_bulk = found.filter(|w| w.contains("moved by 2.5 mean diameters"));
            assert_eq!(of_bulk.count(), told, "{:?}", report.warnings);
            let known = report.cohesions[0].runs[0].bulk_displacement;
            assert_eq!(known.is_some(), moved.is_finite());
        }
    }

    /// Checks that grains without bonds after the cut do not count as erosion at any cohesion, and that there is no
    /// erosion without a broken bond.
    #[test]
    fn loose_grains_are_no_erosion() {
        let root = tempfile::tempdir().unwrap();
        let runs: Vec<PathBuf> = [0.3, 0.5]
            .map(|pressure| write_run(root.path(), pressure, 12.7, (1e-3, 9.1), true))
            .into();
        let law = |output: &str| {
            run(&runs, &root.path().join(output), None)
                .unwrap()
                .cohesions
                .remove(0)
                .law
        };
        assert!(matches!(law("bonds"), Some(FittedErosionLaw::Fitted(_))));
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
        assert!(
            matches!(found, Some(FittedErosionLaw::LowerBound { .. })),
            "{found:?}"
        );
    }

    /// Checks a run in which one grain leaves shortly before its end, among runs that erode: its point has a bar, the
    /// report has its error, and the law is that of the other runs.
    #[test]
    fn one_grain_in_a_short_time_is_no_rate() {
        let root = tempfile::tempdir().unwrap();
        let mut runs: Vec<PathBuf> = PRESSURES[2..]
            .iter()
            .map(|&pressure| write_run(root.path(), pressure, 0.506, (9e-4, 9.1), true))
            .collect();
        let law = |runs: &[PathBuf], output: &str| {
            let report = run(runs, &root.path().join(output), None).unwrap();
            match report.cohesions[0].law {
                Some(FittedErosionLaw::Fitted(ref fit)) => (fit.critical_shear, fit.coefficient),
                ref other => panic!("{other:?}"),
            }
        };
        let alone = law(&runs, "alone");
        let folder = write_run(root.path(), 0.05, 0.506, (9e-4, 9.1), true);
        let file = folder.join("erosion.csv");
        let mut rows = read_rows::<ErosionRecord>(&file, |row| row.step).unwrap();
        // A run of a second, in whose last twentieth the only grain leaves.
        rows.truncate(21);
        for (n, row) in rows.iter_mut().enumerate() {
            let left = n == 20;
            row.eroded_grains = u64::from(left);
            row.bonds_broken = u64::from(left);
            row.eroded_mass = if left { GRAIN } else { 0.0 };
            row.eroded_fraction = row.eroded_mass / INITIAL;
        }
        write_rows(&file, &rows).unwrap();
        // Alone, the run gives neither a rate nor a bound.
        let report = run(
            std::slice::from_ref(&folder),
            &root.path().join("one"),
            None,
        )
        .unwrap();
        let found = &report.cohesions[0].law;
        assert_eq!(*found, Some(FittedErosionLaw::Undetermined));
        let told = text(&report, None);
        assert!(
            told.contains("unknown") && !told.contains("no erosion"),
            "{told}"
        );
        runs.push(folder);
        let with = law(&runs, "with");
        assert!((with.0 / alone.0 - 1.0).abs() < 0.2, "{with:?} {alone:?}");
        assert!((with.1 / alone.1 - 1.0).abs() < 0.05, "{with:?} {alone:?}");
        let output = root.path().join("with");
        let report = fs::read_to_string(output.join("erosion_law.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        let point = &report["cohesions"][0]["runs"][0]["whole"];
        // The grain counts over the whole second, and its error is that of a count of one.
        let rate = GRAIN / (2.0 * LENGTH * 1.0);
        assert_eq!(point["grains"], 1, "{point}");
        assert!(
            (point["rate"].as_f64().unwrap() / rate - 1.0).abs() < 1e-9,
            "{point}"
        );
        assert!(
            point["rate_error"].as_f64().unwrap() >= 0.999 * rate,
            "{point}"
        );
        let figure = fs::read_to_string(output.join("figure5.svg")).unwrap();
        assert!(
            figure.contains("no erosion or too few grains, 95 % bars"),
            "{figure}"
        );
        // The hollow point is drawn with the three segments of its bar.
        let hollow = figure.find("fill=\"white\" stroke=").unwrap();
        let before = &figure[..hollow];
        let last = before.rfind("<path").max(before.rfind("<line")).unwrap();
        assert!(hollow - last < 200, "{}", &figure[last..hollow]);
    }

    #[test]
    fn a_run_without_summary_is_read_from_its_case() {
        let root = tempfile::tempdir().unwrap();
        let with = write_run(root.path(), 0.3, 0.506, (9e-4, 9.1), true);
        let first = run(&[with], &root.path().join("a"), None).unwrap();
        let without = write_run(&root.path().join("b"), 0.3, 0.506, (9e-4, 9.1), false);
        let second = run(&[without], &root.path().join("b"), None).unwrap();
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
        run(&runs, &root.path().join("a"), None).unwrap();
        runs.reverse();
        run(&runs, &root.path().join("b"), None).unwrap();
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
        let error = run(&[], root.path(), None).unwrap_err().to_string();
        assert!(error.contains("at least one run"), "{error}");
        let error = run(&[root.path().join("nowhere")], root.path(), None)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("nowhere") && error.contains("erosion.csv"),
            "{error}"
        );
        let folder = write_run(root.path(), 0.3, 0.506, (9e-4, 9.1), true);
        fs::remove_file(folder.join("summary.json")).unwrap();
        let error = run(std::slice::from_ref(&folder), root.path(), None)
            .unwrap_err()
            .to_string();
        assert!(error.contains("case.json"), "{error}");
        fs::write(folder.join("case.json"), "{}").unwrap();
        let error = run(std::slice::from_ref(&folder), root.path(), None)
            .unwrap_err()
            .to_string();
        assert!(error.contains("per_diameter"), "{error}");
        fs::write(folder.join("erosion.csv"), ErosionRecord::header() + "\n").unwrap();
        fs::write(folder.join("summary.json"), "{").unwrap();
        assert!(run(&[folder], root.path(), None).is_err());
    }
}
