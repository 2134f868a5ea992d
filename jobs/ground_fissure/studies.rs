//! `fissure_studies RUNS RESULTS`: tables and figures of error against cost, from the members run by
//! `jobs/ground_fissure/studies.sh`.
//!
//! Each study gives one `study_NAME.csv` and one `study_NAME.svg`. The error of a member is its difference from the
//! reference of its soil (the stiffest contact, one solid step per coupling, exact porosity): the largest error of
//! the stage times reached by both, and the error of the eroded mass at the end. The cost is processor time.
//! Missing or failed members are omitted.

#![expect(
    clippy::print_stderr,
    reason = "what went wrong is said on the terminal"
)]

use serde_json::Value;
use solver::analysis::erosion_law::read_rows;
use solver::analysis::ground_collapse::record::{CollapseRecord, CollapseSummary};
use solver::error::Error;
use solver::figures::plot::{
    Figure, Layer, Legend, Mark, Panel, PlotAxis, PlotShape, Style, sequential,
};
use solver::sweep::table::machine;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::ExitCode;

const SOILS: [&str; 2] = ["sand", "clay"];

/// Study with its members from the cheapest to the reference. A member after the reference is compared with it as
/// well.
struct Study {
    name: &'static str,
    knob: &'static str,
    values: &'static [&'static str],
    reference: &'static str,
}

const STUDIES: [Study; 3] = [
    Study {
        name: "stiffness",
        knob: "stiffness [N/m]",
        values: &["1e3", "1e4", "1e5", "1e6", "1e6_other"],
        reference: "1e6",
    },
    Study {
        name: "interval",
        knob: "solid steps per coupling",
        values: &["8", "4", "2", "1"],
        reference: "1",
    },
    Study {
        name: "porosity",
        knob: "porosity method",
        values: &["centroid", "divided", "exact"],
        reference: "exact",
    },
];

/// Result of one run.
struct Member {
    value: &'static str,
    /// Processor time [s].
    seconds: f64,
    /// Stage times t1 ... t4 [s].
    stages: [Option<f64>; 4],
    /// Fraction of the mass that has left at the end.
    eroded: f64,
    /// Percentile of the settlement at the end [m].
    settlement: f64,
    /// Physical time at the end [s].
    end: f64,
    commit: String,
}

/// Relative differences from the reference.
struct Deviation {
    stages: f64,
    eroded: f64,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [runs, results] = &arguments[..] else {
        eprintln!("fissure_studies RUNS RESULTS");
        return ExitCode::from(2);
    };
    let (runs, results) = (Path::new(runs), Path::new(results));
    match STUDIES
        .iter()
        .try_for_each(|study| write(study, runs, results))
    {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn write(study: &Study, runs: &Path, results: &Path) -> Result<(), Error> {
    let mut table = String::new();
    let mut series = Vec::new();
    let mut made = String::new();
    for soil in SOILS {
        let members: Vec<Member> = (study.values.iter())
            .filter_map(|value| {
                read(
                    &runs.join(study.name).join(format!("{soil}_{value}")),
                    value,
                )
            })
            .collect();
        let Some(reference) = members
            .iter()
            .find(|member| member.value == study.reference)
        else {
            continue;
        };
        made = format!("solver {}, {:.1} ms", reference.commit, 1e3 * reference.end);
        for member in &members {
            let deviation = deviation(member, reference);
            row(&mut table, soil, member, &deviation);
            if study.name == "stiffness" {
                bed(&mut table, soil, member.value, runs)?;
            }
            table.push('\n');
            if member.value != study.reference {
                series.push((soil, member.value, member.seconds, deviation));
            }
        }
    }
    if table.is_empty() {
        return Ok(());
    }
    let header = format!(
        "# {made} of physical time, {}, one core; bash jobs/ground_fissure/studies.sh {}\nsoil,{},processor time [s],\
         t1 [ms],t2 [ms],t3 [ms],t4 [ms],eroded [%],settlement [mm],error of stages [%],error of eroded mass [%]{}\n",
        machine(),
        study.name,
        study.knob,
        if study.name == "stiffness" {
            ",settled porosity,holds [MPa],erodes [MPa]"
        } else {
            ""
        }
    );
    save(
        &results.join(format!("study_{}.csv", study.name)),
        &(header + &table),
    )?;
    let svg = figure(study, &series).to_svg();
    save(&results.join(format!("study_{}.svg", study.name)), &svg)
}

/// Returns a finished run; `None` if the folder has none.
fn read(folder: &Path, value: &'static str) -> Option<Member> {
    let summary = json(&folder.join("summary.json"))?;
    if summary["outcome"] != "done" {
        return None;
    }
    let collapse: CollapseSummary = serde_json::from_value(summary["collapse"].clone()).ok()?;
    let rows = read_rows(&folder.join("collapse.csv"), |row: &CollapseRecord| {
        row.step
    })
    .ok()?;
    let last = rows.last()?;
    let stages = collapse.stages;
    Some(Member {
        value,
        seconds: fs::read_to_string(folder.with_extension("log.seconds"))
            .ok()?
            .trim()
            .parse()
            .ok()?,
        stages: [
            stages.hidden_hole,
            stages.arch,
            stages.sinkhole,
            stages.extension,
        ],
        eroded: last.eroded_fraction,
        settlement: last.settlement_percentile,
        end: last.time,
        commit: summary["versions"]["commit"].as_str()?.to_owned(),
    })
}

fn json(path: &Path) -> Option<Value> {
    serde_json::from_str(&fs::read_to_string(path).ok()?).ok()
}

fn deviation(member: &Member, reference: &Member) -> Deviation {
    let pairs = member.stages.iter().zip(&reference.stages);
    let each = pairs.filter_map(|(a, b)| Some((((*a)? - (*b)?) / (*b)?).abs()));
    Deviation {
        stages: each.fold(0.0, f64::max),
        eroded: ((member.eroded - reference.eroded) / reference.eroded).abs(),
    }
}

fn row(table: &mut String, soil: &str, member: &Member, deviation: &Deviation) {
    // Writing to a string cannot fail.
    let _ = write!(table, "{soil},{},{:.1}", member.value, member.seconds);
    for time in member.stages {
        let _ = match time {
            Some(time) => write!(table, ",{:.2}", 1e3 * time),
            None => write!(table, ","),
        };
    }
    let _ = write!(
        table,
        ",{:.2},{:.2},{:.1},{:.1}",
        100.0 * member.eroded,
        1e3 * member.settlement,
        100.0 * deviation.stages,
        100.0 * deviation.eroded
    );
}

/// Writes the settled porosity and the pressures between which the clay erodes.
fn bed(table: &mut String, soil: &str, value: &str, runs: &Path) -> Result<(), Error> {
    let sample = runs.join("packing").join(value).join("sample.csv");
    let text = fs::read_to_string(&sample)
        .map_err(|error| Error::Io(format!("{}: {error}", sample.display())))?;
    let _ = write!(table, ",{:.4}", porosity(&text));
    let critical = json(&runs.join("critical").join(format!("{value}.json")));
    for bound in ["holds", "erodes"] {
        let pressure = critical.as_ref().and_then(|found| found[bound].as_f64());
        let _ = match pressure.filter(|_| soil == "clay") {
            Some(pressure) => write!(table, ",{:.3}", 1e-6 * pressure),
            None => write!(table, ","),
        };
    }
    Ok(())
}

/// Returns the porosity of the packing (`x,y,z,radius,...` [m]) between two heights in the fissure of the smaller pair:
/// away from the barrier and from the surface.
fn porosity(sample: &str) -> f64 {
    const BETWEEN: [f64; 2] = [0.015, 0.035];
    const LENGTH: f64 = 0.1;
    /// Returns half the width at height z: 4 mm at 10 mm, 18 mm at 45 mm.
    fn half_width(z: f64) -> f64 {
        0.004 + 0.4 * (z - 0.01)
    }
    let grains = sample.lines().skip(1).filter_map(|line| {
        let mut numbers = line.split(',').map_while(|word| word.parse::<f64>().ok());
        Some((numbers.nth(2)?, numbers.next()?))
    });
    let solid: f64 = grains
        .map(|(z, r)| {
            let [low, high] = BETWEEN.map(|height| (height - z).clamp(-r, r));
            let below = |h: f64| PI * (r * r * h - h.powi(3) / 3.0);
            below(high) - below(low)
        })
        .sum();
    let [low, high] = BETWEEN;
    1.0 - solid / ((half_width(low) + half_width(high)) * (high - low) * LENGTH)
}

fn figure(study: &Study, series: &[(&str, &str, f64, Deviation)]) -> Figure {
    let panel = |title: &str, error: fn(&Deviation) -> f64, legend| Panel {
        title: title.to_owned(),
        x: PlotAxis::log("processor time", "s"),
        y: PlotAxis::linear("error", "%"),
        layers: series
            .iter()
            .map(|(soil, value, seconds, deviation)| {
                let marks = vec![Mark::without_bars(*seconds, 100.0 * error(deviation))];
                let style = if *soil == "sand" {
                    Style::Filled
                } else {
                    Style::Hollow
                };
                let place = study.values.iter().position(|v| v == value).unwrap_or(0);
                let colour = sequential(place, study.values.len());
                Layer::new(
                    PlotShape::Marks { marks, style },
                    &colour,
                    &format!("{soil} {value}"),
                )
            })
            .collect(),
        legend,
        legend_title: study.knob.to_owned(),
    };
    Figure {
        panels: vec![
            panel("Times of the stages", |d| d.stages, Legend::None),
            panel("Eroded mass at the end", |d| d.eroded, Legend::Right),
        ],
    }
}

fn save(path: &Path, text: &str) -> Result<(), Error> {
    io::atomic::write(path, text.as_bytes()).map_err(|error| Error::Io(error.to_string()))
}
