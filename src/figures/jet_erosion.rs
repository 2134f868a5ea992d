//! The erosion law of jet erosion tests: `solver erosion-law TABLE... --nozzle D --head H`.
//!
//! A table has the columns `time` and `distance` (from the nozzle to the soil); units may be in brackets.
//!
//! | file | content |
//! |---|---|
//! | `jet_erosion.csv` | one row per specimen: tau_c and k_d with intervals, Blaisdell's reading |
//! | `jet_erosion.svg` | readings and fitted laws |
//! | `jet_erosion.json` | the report |

use crate::erosion_law::{digits, with_interval};
use crate::plot::{CATEGORY, Figure, Layer, Legend, Mark, Panel, PlotAxis, PlotShape, Style};
pub use analysis::erosion_law::jet::JetApparatus;
use analysis::erosion_law::jet::{
    JetFit, JetLaw, JetMeans, JetOutcome, JetReading, fit_jet, jet_means,
};
use base::error::Error;
use io::sheet::{Column, Refusal, Sheet, Unit};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// Columns of a record.
const COLUMNS: [Column; 2] = [
    Column {
        name: "time",
        aliases: &[("t", 1.0), ("elapsed_time", 1.0)],
        unit: Unit::Time,
        required: true,
    },
    Column {
        name: "distance",
        aliases: &[("j", 1.0), ("nozzle_distance", 1.0)],
        unit: Unit::Length,
        required: true,
    },
];
/// Cubic centimetres in a cubic metre: the coefficient is also stated in cm3/(N s).
const CUBIC_CENTIMETRES: f64 = 1e6;

/// Specimen with its law.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Specimen {
    /// Table of the record.
    pub table: PathBuf,
    /// Readings of the test.
    pub readings: Vec<JetReading>,
    /// Law, or the reason why there is none.
    pub outcome: JetOutcome,
}

/// The laws of all specimens, in SI units.
#[derive(Clone, Debug, serde::Serialize)]
pub struct JetReport {
    /// Apparatus of the test.
    pub apparatus: JetApparatus,
    /// Bulk density of the dry soil [kg/m3], if it is stated.
    pub bulk_density: Option<f64>,
    /// The specimens in the order of the command.
    pub specimens: Vec<Specimen>,
    /// Means over the specimens with a law, for at least two.
    pub means: Option<JetMeans>,
    /// Paths of the files written.
    pub files: Vec<PathBuf>,
}

/// Fits the records and writes table and figure into `output`, which is made if it does not exist; returns the report
/// as text or JSON.
///
/// # Errors
/// If a record cannot be read or is none of a jet erosion test, or a file cannot be written: [`Error::Io`].
pub fn command(
    tables: &[PathBuf],
    apparatus: JetApparatus,
    bulk_density: Option<f64>,
    output: &Path,
    json: bool,
) -> Result<String, Error> {
    let report = run(tables, apparatus, bulk_density, output)?;
    if json {
        serde_json::to_string_pretty(&report).map_err(|e| Error::Internal(e.to_string()))
    } else {
        Ok(text(&report))
    }
}

fn run(
    tables: &[PathBuf],
    apparatus: JetApparatus,
    bulk_density: Option<f64>,
    output: &Path,
) -> Result<JetReport, Error> {
    let fail = |path: &Path, error: &dyn std::fmt::Display| {
        Error::Io(format!("{}: {error}", path.display()))
    };
    let mut specimens = Vec::new();
    for table in tables {
        let readings = read(table).map_err(|sentence| fail(table, &sentence))?;
        let outcome = fit_jet(&apparatus, &readings).map_err(|sentence| fail(table, &sentence))?;
        specimens.push(Specimen {
            table: table.clone(),
            readings,
            outcome,
        });
    }
    let fits: Vec<&JetFit> = specimens.iter().filter_map(Specimen::fit).collect();
    let means = jet_means(&fits);
    let mut report = JetReport {
        apparatus,
        bulk_density,
        specimens,
        means,
        files: Vec::new(),
    };
    fs::create_dir_all(output).map_err(|error| fail(output, &error))?;
    let names = ["jet_erosion.csv", "jet_erosion.svg", "jet_erosion.json"];
    report.files = names.map(|name| output.join(name)).into();
    let document = serde_json::to_string_pretty(&report)
        .map_err(|error| Error::Internal(format!("the report as JSON: {error}")))?;
    let texts = [csv(&report), figure(&report).to_svg(), document + "\n"];
    for (path, text) in report.files.iter().zip(texts) {
        fs::write(path, text).map_err(|error| fail(path, &error))?;
    }
    Ok(report)
}

/// Reads a record.
fn read(table: &Path) -> Result<Vec<JetReading>, String> {
    let text = io::plain::text(table, io::plain::LONGEST_INPUT).map_err(|e| e.to_string())?;
    let sheet = Sheet::new(&text, &COLUMNS).map_err(|refusal| match refusal {
        Refusal::Sentence(sentence) => sentence,
        Refusal::Unknown(name) => {
            format!("the column `{name}` is unknown. A jet erosion test has: time, distance")
        }
    })?;
    let mut readings = Vec::new();
    sheet.each(|row| {
        readings.push(JetReading {
            time: row.number(0)?,
            distance: row.number(1)?,
        });
        Ok(())
    })?;
    Ok(readings)
}

impl Specimen {
    fn fit(&self) -> Option<&JetFit> {
        match &self.outcome {
            JetOutcome::Fitted(fit) => Some(fit),
            JetOutcome::LowerBound { .. } => None,
        }
    }

    /// Returns the name of the table without its folder and ending.
    fn name(&self) -> String {
        let stem = self.table.file_stem().unwrap_or(self.table.as_os_str());
        stem.to_string_lossy().into_owned()
    }
}

fn csv(report: &JetReport) -> String {
    let mut text = String::from(
        "specimen,critical_shear,critical_shear_low,critical_shear_high,coefficient,coefficient_low,coefficient_high,\
         first_distance,equilibrium,scatter,blaisdell_critical_shear,blaisdell_coefficient\n\
         # -,Pa,Pa,Pa,m3/(N s),m3/(N s),m3/(N s),m,m,m,Pa,m3/(N s)\n",
    );
    for specimen in &report.specimens {
        // Writing to a string cannot fail.
        let _ = match &specimen.outcome {
            JetOutcome::Fitted(fit) => {
                let (c, k) = (fit.critical_shear_interval, fit.coefficient_interval);
                let equilibrium = fit.equilibrium.unwrap_or(f64::INFINITY);
                let other = fit.blaisdell.unwrap_or(JetLaw {
                    critical_shear: f64::NAN,
                    coefficient: f64::NAN,
                });
                writeln!(
                    text,
                    "{},{:?},{:?},{:?},{:?},{:?},{:?},{:?},{equilibrium:?},{:?},{:?},{:?}",
                    specimen.name(),
                    fit.law.critical_shear,
                    c.low,
                    c.high,
                    fit.law.coefficient,
                    k.low,
                    k.high,
                    fit.first_distance,
                    fit.scatter,
                    other.critical_shear,
                    other.coefficient
                )
            }
            JetOutcome::LowerBound { at_least } => writeln!(
                text,
                "{},NaN,{at_least:?},NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN",
                specimen.name()
            ),
        };
    }
    text
}

fn figure(report: &JetReport) -> Figure {
    let mut layers = Vec::new();
    for (n, specimen) in report.specimens.iter().enumerate() {
        let colour = CATEGORY[1 + n % (CATEGORY.len() - 1)];
        if let Some(fit) = specimen.fit() {
            let begun = specimen.readings.first().map_or(0.0, |r| r.time);
            let end = specimen.readings.last().map_or(0.0, |r| r.time);
            let points = (0..=200)
                .map(|k| {
                    let time = begun + (end - begun) * f64::from(k) / 200.0;
                    let distance =
                        report
                            .apparatus
                            .distance(fit.law, fit.first_distance, time - begun);
                    (time, 1e3 * distance)
                })
                .collect();
            let shape = PlotShape::Line {
                points,
                dashed: false,
            };
            layers.push(Layer::new(shape, colour, ""));
        }
        let marks = specimen.readings.iter();
        let marks = marks
            .map(|reading| Mark::without_bars(reading.time, 1e3 * reading.distance))
            .collect();
        let shape = PlotShape::Marks {
            marks,
            style: Style::Filled,
        };
        layers.push(Layer::new(shape, colour, &specimen.name()));
    }
    Figure {
        panels: vec![Panel {
            title: "Jet erosion test".to_owned(),
            x: PlotAxis::linear("time", "s"),
            y: PlotAxis::linear("distance from the nozzle J", "mm"),
            layers,
            legend: Legend::Right,
            legend_title: String::new(),
        }],
    }
}

/// Returns the report for the terminal.
fn text(report: &JetReport) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_text(&mut text, report);
    text
}

fn write_text(f: &mut String, report: &JetReport) -> std::fmt::Result {
    let jet = &report.apparatus;
    writeln!(
        f,
        "Jet of {} m/s; {} Pa within its core of {} mm.",
        digits(jet.velocity()),
        digits(jet.stress_in_core()),
        digits(1e3 * jet.core_length())
    )?;
    writeln!(
        f,
        "{:>16}  {:>8}  {:>26}  {:>26}  {:>12}",
        "specimen", "readings", "tau_c (Pa)", "k_d (cm3/(N s))", "scatter (mm)"
    )?;
    for specimen in &report.specimens {
        match &specimen.outcome {
            JetOutcome::Fitted(fit) => writeln!(
                f,
                "{:>16}  {:>8}  {:>26}  {:>26}  {:>12}",
                specimen.name(),
                fit.readings,
                with_interval(fit.law.critical_shear, fit.critical_shear_interval),
                in_centimetres(fit.law.coefficient, fit.coefficient_interval),
                digits(1e3 * fit.scatter)
            )?,
            JetOutcome::LowerBound { at_least } => writeln!(
                f,
                "{:>16}  {:>8}  {:>26}  {:>26}",
                specimen.name(),
                specimen.readings.len(),
                format!(">= {}", digits(*at_least)),
                "no erosion"
            )?,
        }
    }
    let mut laws: Vec<(&str, JetLaw)> = Vec::new();
    if let Some(means) = &report.means {
        writeln!(
            f,
            "{:>16}  {:>8}  {:>26}  {:>26}",
            "mean",
            format!("of {}", means.specimens),
            with_interval(means.law.critical_shear, means.critical_shear_interval),
            in_centimetres(means.law.coefficient, means.coefficient_interval)
        )?;
        laws.push(("mean", means.law));
    } else if let Some(fit) = report.specimens.iter().find_map(Specimen::fit) {
        laws.push(("law", fit.law));
    }
    writeln!(
        f,
        "Intervals are 95 %{}.",
        if report.means.is_some() {
            "; those of the mean include the scatter between specimens"
        } else {
            ""
        }
    )?;
    for (name, law) in laws {
        write!(
            f,
            "k_d of the {name}: {} cm3/(N s) = {:.3e} m3/(N s)",
            digits(CUBIC_CENTIMETRES * law.coefficient),
            law.coefficient
        )?;
        if let Some(density) = report.bulk_density {
            write!(f, " = {:.3e} s/m of dry mass", density * law.coefficient)?;
        }
        let beds = JetLaw::coefficient_of_stream_beds(law.critical_shear);
        if beds.is_finite() {
            writeln!(
                f,
                "; stream beds of this tau_c have {} cm3/(N s) (Hanson and Simon 2001)",
                digits(CUBIC_CENTIMETRES * beds)
            )?;
        } else {
            writeln!(f, "; no relation of stream beds covers this tau_c")?;
        }
    }
    for specimen in &report.specimens {
        if let Some(law) = specimen.fit().and_then(|fit| fit.blaisdell) {
            writeln!(
                f,
                "Blaisdell's reading of {}: tau_c = {} Pa, k_d = {} cm3/(N s)",
                specimen.name(),
                digits(law.critical_shear),
                digits(CUBIC_CENTIMETRES * law.coefficient)
            )?;
        }
    }
    for file in &report.files {
        writeln!(f, "wrote {}", file.display())?;
    }
    Ok(())
}

/// Returns a coefficient with its interval in cm3/(N s).
fn in_centimetres(value: f64, interval: analysis::erosion_law::Interval) -> String {
    let scaled = analysis::erosion_law::Interval {
        low: CUBIC_CENTIMETRES * interval.low,
        high: CUBIC_CENTIMETRES * interval.high,
    };
    with_interval(CUBIC_CENTIMETRES * value, scaled)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apparatus() -> JetApparatus {
        JetApparatus {
            nozzle: 6.35e-3,
            head: 0.6,
            density: 1000.0,
            gravity: 9.81,
            friction: JetApparatus::FRICTION,
            core: JetApparatus::CORE,
        }
    }

    /// Writes a record of a soil in minutes and millimetres, the usual units of a laboratory.
    fn write(folder: &Path, name: &str, law: JetLaw) -> PathBuf {
        let mut text = String::from("time [min],distance [mm]\n");
        for n in 0..14 {
            let time = 60.0 * f64::from(n * n);
            let distance = apparatus().distance(law, 0.06, time);
            text += &format!("{},{}\n", time / 60.0, 1e3 * distance);
        }
        let path = folder.join(name);
        fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn records_give_the_law_in_all_customary_units() {
        let folder = tempfile::tempdir().unwrap();
        let law = |critical_shear: f64, coefficient: f64| JetLaw {
            critical_shear,
            coefficient,
        };
        let tables = [
            write(folder.path(), "one.csv", law(2.0, 1e-6)),
            write(folder.path(), "two.csv", law(2.2, 1.1e-6)),
        ];
        let out = folder.path().join("out");
        let report = run(&tables, apparatus(), Some(1600.0), &out).unwrap();
        let means = report.means.unwrap();
        assert!((means.law.critical_shear - 2.1).abs() < 1e-3, "{means:?}");
        let words = text(&report);
        assert!(
            words.contains("k_d of the mean: 1.05 cm3/(N s) = 1.049e-6 m3/(N s)"),
            "{words}"
        );
        assert!(words.contains("1.678e-3 s/m of dry mass"), "{words}");
        let table = fs::read_to_string(out.join("jet_erosion.csv")).unwrap();
        assert_eq!(table.lines().count(), 4, "{table}");
        assert!(out.join("jet_erosion.svg").exists() && out.join("jet_erosion.json").exists());
    }

    #[test]
    fn a_record_that_is_none_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record.csv");
        for (text, words) in [
            ("time,depth\n0,1\n", "depth"),
            ("time,distance\n0,0.06\n", "at least 4"),
            (
                "time,distance\n0,0.06\n1,0.07\n1,0.08\n2,0.09\n",
                "increase",
            ),
        ] {
            fs::write(&path, text).unwrap();
            let error = run(
                std::slice::from_ref(&path),
                apparatus(),
                None,
                folder.path(),
            );
            let error = error.unwrap_err().to_string();
            assert!(
                error.contains(words) && error.contains("record.csv"),
                "{error}"
            );
        }
    }
}
