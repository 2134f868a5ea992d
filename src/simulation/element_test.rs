//! The answers of an element test, from the tables of its probes.
//!
//! The tables hold every sample to the bit, on any number of ranks and across restarts. Samples of all probes are
//! joined by their steps.

use analysis::element_test::{TestRecord, TestResult};
use case::element_test::{TestAnswer, TestQuantity};
use io::table::{self, Rows};
use plan::Plan;
use plan::scene::element_test::ElementTest;
use plan::scene::observe::Probe;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Names of the axes in column names.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Results of a test in the order of the case; none for a quantity that the records do not contain.
pub(super) struct TestResults(Vec<(TestAnswer, Option<TestResult>)>);

impl TestResults {
    /// Reads the answers of the test of a plan from the folder of its run; none without a test.
    pub(super) fn read(plan: &Plan, folder: &Path) -> Option<Self> {
        let test = plan.scene.element_test.as_ref()?;
        let record = match record(plan, test, folder) {
            Ok(record) => record,
            Err(error) => {
                log::warn!("the results of the element test could not be computed: {error}");
                TestRecord::default()
            }
        };
        let answers = test.answers.iter();
        let answers = answers.map(|asked| (asked.clone(), compute_answer(&record, asked.quantity)));
        Some(Self(answers.collect()))
    }

    /// Returns the entry of `summary.json`: each quantity with value, interval, unit and time, the known value, and the
    /// relative difference from it.
    pub(super) fn summary(&self) -> Value {
        let mut entries = Map::new();
        for (asked, answer) in &self.0 {
            let (name, unit) = asked.quantity.name_and_unit();
            let mut entry = json!({
                "value": answer.map(|answer| answer.value),
                "interval": answer.map(|answer| answer.interval),
                "time": answer.map(|answer| answer.time),
                "unit": unit,
            });
            if let Some(answer) = answer.filter(|answer| answer.peak_at_end) {
                entry["peak_at_end"] = answer.peak_at_end.into();
            }
            if let Some(known) = asked.known {
                entry["known"] = known.into();
                entry["source"] = json!(asked.source);
                entry["difference"] = json!(answer.map(|answer| answer.value / known - 1.0));
            }
            entries.insert(name.to_owned(), entry);
        }
        entries.into()
    }

    /// Returns a table of the answers.
    pub(super) fn lines(&self) -> Vec<String> {
        let number = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.6}"));
        let scientific = |x: f64| {
            if (1e-2..1e5).contains(&x.abs()) {
                number(Some(x))
            } else {
                format!("{x:.5e}")
            }
        };
        let text = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), scientific);
        let mut lines = vec![format!(
            "{:<24} {:>13} {:>13} {:>13} {:>13} {:>11}",
            "element test", "answer", "from", "to", "known", "difference"
        )];
        for (asked, answer) in &self.0 {
            let (name, unit) = asked.quantity.name_and_unit();
            let difference = answer.zip(asked.known).map(|(answer, known)| {
                let percent = 100.0 * (answer.value / known - 1.0);
                format!("{percent:.3} %")
            });
            let note = match answer {
                Some(answer) if answer.peak_at_end => " (last reading)",
                _ => "",
            };
            lines.push(format!(
                "{:<24} {:>13} {:>13} {:>13} {:>13} {:>11} {}{note}",
                name.replace('_', " "),
                text(answer.map(|a| a.value)),
                text(answer.map(|a| a.interval[0])),
                text(answer.map(|a| a.interval[1])),
                text(asked.known),
                difference.unwrap_or_else(|| "-".to_owned()),
                if unit == "-" { "" } else { unit }
            ));
        }
        lines
    }

    /// Returns a warning about the peaks that are the last reading.
    pub(super) fn warnings(&self) -> Option<String> {
        let at_end = |answer: &Option<TestResult>| answer.is_some_and(|answer| answer.peak_at_end);
        let names = self.0.iter().filter(|(_, answer)| at_end(answer));
        let names: Vec<&str> = names
            .map(|(asked, _)| asked.quantity.name_and_unit().0)
            .collect();
        (!names.is_empty()).then(|| {
            format!(
                "element test: the largest value of {} is the last reading, so that the peak may not be reached yet; \
                 let the test go on until the value falls",
                names.join(", ")
            )
        })
    }
}

/// Returns the answer of a quantity.
fn compute_answer(record: &TestRecord, quantity: TestQuantity) -> Option<TestResult> {
    match quantity {
        TestQuantity::AxialStress => record.axial_stress(),
        TestQuantity::AxialStrain => record.axial_strain(),
        TestQuantity::SecantModulus => record.secant_modulus(),
        TestQuantity::Strength => record.strength(),
        TestQuantity::PeakStressRatio => record.peak_stress_ratio(),
        TestQuantity::PeakFrictionAngle => record.peak_friction_angle(),
        TestQuantity::LateralStressRatio => record.lateral_stress_ratio(),
        TestQuantity::PeakShearRatio => record.peak_shear_ratio(),
    }
}

/// Table of a probe, with the rows of the steps that all probes have.
struct Sampled {
    rows: Rows,
    kept: Vec<usize>,
}

impl Sampled {
    fn column(&self, name: &str) -> Result<Vec<f64>, String> {
        let column = self.rows.column(name);
        let column = column.ok_or_else(|| format!("no column {name}"))?;
        Ok(self.kept.iter().map(|&row| column[row]).collect())
    }
}

/// Reads the probes of a test from its start time on, joined by their steps.
fn read(plan: &Plan, test: &ElementTest, folder: &Path) -> Result<Vec<(usize, Sampled)>, String> {
    let inside = test.inside.map(|(probe, _)| probe);
    let named = test.axial.iter().chain(&test.lateral).copied();
    let mut tables = Vec::new();
    for probe in named.chain(inside) {
        let Probe { name, .. } = &plan.scene.probes[probe];
        let path = folder.join(format!("probe_{name}.csv"));
        tables.push((probe, table::read(&path).map_err(|e| e.to_string())?));
    }
    // An interval has one step at least.
    let first = match test.from {
        from if from > 0.0 => plan.clock.interval_to_steps(from),
        _ => 0,
    };
    let steps = tables.first().map_or(&[][..], |(_, rows)| &rows.steps);
    let common: Vec<u64> = steps
        .iter()
        .copied()
        .filter(|step| *step >= first)
        .filter(|step| {
            tables
                .iter()
                .all(|(_, rows)| rows.steps.binary_search(step).is_ok())
        })
        .collect();
    let sampled = tables.into_iter().map(|(probe, rows)| {
        let place = |step: &u64| rows.steps.binary_search(step).ok();
        let kept = common.iter().filter_map(place).collect();
        (probe, Sampled { rows, kept })
    });
    Ok(sampled.collect())
}

/// Returns the record of a test.
fn record(plan: &Plan, test: &ElementTest, folder: &Path) -> Result<TestRecord, String> {
    let tables = read(plan, test, folder)?;
    let table = |probe: usize| {
        let found = tables.iter().find(|(known, _)| *known == probe);
        found
            .map(|(_, sampled)| sampled)
            .ok_or("no table of a probe")
    };
    let mut record = TestRecord {
        time: table(test.axial[0])?.column("time")?,
        height: test.height,
        ..TestRecord::default()
    };
    record.shortening = vec![0.0; record.time.len()];
    for (probe, normal) in test.axial.iter().zip(test.normals) {
        let table = table(*probe)?;
        for (axis, part) in AXES.iter().zip(normal) {
            let moved = table.column(&format!("displacement_{axis}"))?;
            for (sum, moved) in record.shortening.iter_mut().zip(moved) {
                *sum += part * moved;
            }
        }
        let normal = table.column("normal_stress")?;
        let shear = table.column("shear_stress")?;
        record.shear_over_normal.push(quotients(&shear, &normal));
        record.axial.push(normal);
    }
    record.start = record.shortening.first().copied().unwrap_or(0.0);
    for probe in &test.lateral {
        let lateral = table(*probe)?.column("normal_stress")?;
        let ratios = record.axial.iter().map(|axial| quotients(&lateral, axial));
        record.lateral_over_axial.extend(ratios);
    }
    if let Some((probe, axis)) = test.inside {
        let stress = |a: usize| table(probe)?.column(&format!("stress_{0}{0}", AXES[a]));
        let axial = stress(axis)?;
        for a in (0..plan.scene.grid.dimension).filter(|a| *a != axis) {
            let ratio = quotients(&stress(a)?, &axial);
            record.lateral_over_axial.push(ratio);
        }
    }
    Ok(record)
}

/// Returns the quotients of two series, value by value.
fn quotients(above: &[f64], below: &[f64]) -> Vec<f64> {
    above.iter().zip(below).map(|(a, b)| a / b).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that a peak at the last reading is named in the answers, in the lines and as a warning.
    #[test]
    fn a_peak_that_is_the_last_reading_is_named() {
        let results = |stresses: [f64; 3]| {
            let record = TestRecord {
                time: vec![1.0, 2.0, 3.0],
                height: 0.1,
                shortening: vec![0.0, 0.01, 0.02],
                axial: vec![stresses.to_vec()],
                ..TestRecord::default()
            };
            let asked = TestAnswer {
                quantity: TestQuantity::Strength,
                known: None,
                source: None,
            };
            TestResults(vec![(
                asked,
                compute_answer(&record, TestQuantity::Strength),
            )])
        };
        let rising = results([10.0, 20.0, 30.0]);
        assert_eq!(rising.summary()["strength"]["peak_at_end"], true);
        let words = "the largest value of strength is the last reading";
        assert!(rising.lines()[1].ends_with("(last reading)"));
        assert!(rising.warnings().unwrap().contains(words));
        let failed = results([10.0, 30.0, 20.0]);
        assert_eq!(failed.summary()["strength"]["peak_at_end"], Value::Null);
        assert!(!failed.lines()[1].contains("reading"));
        assert_eq!(failed.warnings(), None);
    }
}
