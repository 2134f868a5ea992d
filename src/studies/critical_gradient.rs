//! `solver critical-gradient`: the critical hydraulic gradient of a soil, by bisection.
//!
//! The runs of one case differ only in the pressure, head or flux of one boundary (the drive). The search bisects
//! the interval ([`crate::section`]) for the smallest drive that erodes. A run erodes if at least the given number of
//! grains leaves at any time of the run, so that a bed that has left in the first half counts as eroded. Loose grains
//! above an opening count too; such ground requires a larger number. The gradient is the difference of head between
//! the inlet and the lowest outlet, over the distance of their centres. The report also gives Terzaghi's gradient for
//! an upward flow, `(1 - n)(G_s - 1)`, with the porosity n of the run below the critical one and G_s the density of
//! the grains over that of the water (K. Terzaghi, Theoretical Soil Mechanics, 1943).
//!
//! A stopped search continues when the command is repeated: finished runs are read, and a stopped run is resumed.

use crate::section::{Bracket, Round, Section, Tolerance};
use analysis::erosion_law::{RemovedGrain, read_rows};
use base::error::{Error, Problem, Verdict};
use base::vector::{distance, dot, norm};
use case::Document;
use darcy::Condition;
use decomposition::Communicator;
use plan::Plan;
use plan::scene::observe::{ObservedRegion, RegionAction};
use plan::scene::seepage::{Seepage, SeepagePatch};
use serde::Serialize;
use serde_json::Value;
use simulation::agreement;
use simulation::progress::Progress;
use simulation::run::{self, WorkLimits};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Options of a search.
#[derive(Clone, Debug)]
pub struct Search {
    /// Case file.
    pub case: PathBuf,
    /// Changes of fields of the case.
    pub set: Vec<String>,
    /// Name of the driving boundary; none for the one with the highest head.
    pub boundary: Option<String>,
    /// Drive without erosion, in the unit of the boundary's condition.
    pub from: f64,
    /// Drive with erosion, in the same unit.
    pub to: f64,
    /// Width of the final interval divided by its upper end.
    pub tolerance: f64,
    /// Minimum number of grains that leave in an eroding run.
    pub grains: u64,
    /// Folder of the runs.
    pub output: PathBuf,
    /// Threads of each rank; none for the cores of the machine divided by its ranks.
    pub threads: Option<usize>,
    /// Time at which the program started, from which the wall time counts; a stopped search can be continued.
    pub begun: Instant,
    /// Wall time after which the search stops.
    pub max_walltime: Option<Duration>,
    /// `true` if the search may run an unstable case.
    pub allow_unstable: bool,
}

/// Run of the search with one drive.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Drive, in the unit of the boundary's condition.
    pub drive: f64,
    /// Hydraulic gradient; none if inlet or outlet have no head.
    pub gradient: Option<f64>,
    /// Number of grains that left in the first half of the run.
    pub early: u64,
    /// Number of grains that left in the second half of the run.
    pub late: u64,
    /// Mean porosity of the cells with grains, at the end.
    pub porosity: f64,
    /// `true` if the run eroded.
    pub erodes: bool,
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Critical {
    /// Name of the driving boundary.
    pub boundary: String,
    /// Quantity of the drive, with its unit.
    pub quantity: String,
    /// Highest drive without erosion.
    pub holds: f64,
    /// Lowest drive with erosion.
    pub erodes: f64,
    /// Hydraulic gradients of these two drives.
    pub gradient: Option<[f64; 2]>,
    /// Terzaghi's gradient `(1 - n)(G_s - 1)`.
    pub terzaghi: f64,
    /// All runs in the order of their execution.
    pub trials: Vec<Trial>,
}

/// Runs the search; the first rank prints. Collective.
///
/// # Errors
/// If the case or the bounds are invalid, or a run fails.
pub fn command(search: &Search, json: bool) -> Result<String, Error> {
    let text = io::plain::text(&search.case, io::plain::LONGEST_CASE)
        .map_err(|e| Error::Io(e.to_string()))?;
    let plan = planned(&text, search, &[])?;
    let inlet = Inlet::find(&plan, search)?;
    let found = run::on_world(search.threads, |communicator, threads| {
        Searching {
            search,
            text: &text,
            inlet: &inlet,
            communicator,
            threads,
            progress: Progress::new(communicator.rank() == 0 && !json, 0),
            sample: None,
            trials: Vec::new(),
        }
        .find()
    })?;
    if json {
        return serde_json::to_string_pretty(&found).map_err(|e| Error::Internal(e.to_string()));
    }
    let mut lines = vec![format!(
        "{}: holds at {} and erodes at {} {}",
        found.boundary, found.holds, found.erodes, found.quantity
    )];
    if let Some([low, high]) = found.gradient {
        lines.push(format!("critical gradient between {low:.4} and {high:.4}"));
    }
    lines.push(format!("Terzaghi, upward flow: {:.4}", found.terzaghi));
    Ok(lines.join("\n"))
}

/// Returns the plan of the case with additional changes.
fn planned(text: &str, search: &Search, more: &[String]) -> Result<Plan, Error> {
    let set: Vec<String> = search.set.iter().chain(more).cloned().collect();
    let directory = search.case.parent().unwrap_or(Path::new(""));
    let plan = Document::read(text, &set, directory)
        .and_then(Plan::prepare)
        .map_err(Error::Case)?;
    if Verdict::from_findings(&plan.warnings).runs(search.allow_unstable) {
        Ok(plan)
    } else {
        Err(Error::Case(plan.warnings))
    }
}

/// Boundary with the driving head or pressure.
struct Inlet {
    name: String,
    /// Path of the drive in the case.
    path: String,
    quantity: &'static str,
    /// Head per unit of drive and head at zero drive \[m\]; none for a flux.
    head: Option<[f64; 2]>,
    /// Lowest head of an outlet \[m\], and the distance of its centre from that of the inlet \[m\].
    outlet: Option<[f64; 2]>,
    liquid: f64,
    solid: f64,
}

/// Returns the error of an unsuitable case.
fn refusal(path: &str, value: String, reason: &str, remedy: &str) -> Error {
    Error::Case(vec![Problem::error(path, value, reason, remedy)])
}

/// Hydraulic heads at the boundaries.
struct Heads<'a> {
    seepage: &'a Seepage,
    gravity: [f64; 3],
    strength: f64,
    /// Head per pressure \[m/Pa\]; a case without gravity uses the standard gravity of the earth.
    per_pascal: f64,
}

impl<'a> Heads<'a> {
    fn new(gravity: [f64; 3], seepage: &'a Seepage) -> Self {
        let strength = norm(gravity);
        let per_volume = if strength > 0.0 { strength } else { 9.80665 };
        Self {
            seepage,
            gravity,
            strength,
            per_pascal: 1.0 / (seepage.written.density * per_volume),
        }
    }

    fn elevation(&self, at: [f64; 3]) -> f64 {
        if self.strength > 0.0 {
            -dot(at, self.gravity) / self.strength
        } else {
            0.0
        }
    }

    /// Returns the imposed head of a boundary; none if another quantity is imposed.
    fn of_patch(&self, patch: &SeepagePatch) -> Option<f64> {
        match patch.condition {
            Condition::Pressure { value } => {
                let elevation = self.elevation(self.seepage.centre(patch));
                Some(value * self.per_pascal + elevation)
            }
            Condition::Head { value } => Some(value),
            _ => None,
        }
    }
}

/// Returns the driving boundary: the one with this name, or the one with the highest head.
fn driving<'a>(
    heads: &Heads<'a>,
    name: Option<&String>,
) -> Result<(usize, &'a SeepagePatch), Error> {
    let patches = heads.seepage.patches.iter().enumerate();
    let chosen = patches.filter(|(_, patch)| {
        name.map_or_else(
            || heads.of_patch(patch).is_some(),
            |name| *name == patch.name,
        )
    });
    let value = |patch| heads.of_patch(patch).unwrap_or(f64::NEG_INFINITY);
    let chosen = chosen.max_by(|(_, a), (_, b)| value(a).total_cmp(&value(b)));
    chosen.ok_or_else(|| {
        refusal(
            "--boundary",
            name.cloned().unwrap_or_else(|| "missing".into()),
            "no boundary with this name drives the water",
            "use the name of one of `fluid.darcy.boundaries`",
        )
    })
}

impl Inlet {
    fn find(plan: &Plan, search: &Search) -> Result<Self, Error> {
        let Some(seepage) = &plan.scene.seepage else {
            return Err(if plan.scene.flow.is_some() {
                refusal(
                    "fluid.lattice_boltzmann",
                    "the fluid of the case is computed on a lattice".into(),
                    "this command varies the head, pressure or flux of seepage, not the velocity of a stream",
                    "vary the velocity with `solver sweep`, and find the velocity at which grains start to move",
                )
            } else {
                refusal(
                    "fluid.darcy",
                    "missing".into(),
                    "a critical gradient requires seepage, and this case has no water",
                    "add `fluid.darcy` to the case",
                )
            });
        };
        if !(search.from.is_finite() && search.to.is_finite() && search.from < search.to) {
            return Err(Error::Usage(format!(
                "--from {} must be below --to {}; give a value that does not erode and one that erodes",
                search.from, search.to
            )));
        }
        let removes =
            |region: &ObservedRegion| matches!(region.action, RegionAction::Remove { .. });
        if !plan.scene.regions.iter().any(removes) {
            return Err(refusal(
                "regions",
                "no region of the case removes grains".into(),
                "erosion is measured by the number of grains that regions remove",
                "add a region with the action `remove` below the openings",
            ));
        }
        let heads = Heads::new(plan.scene.gravity, seepage);
        let (n, patch) = driving(&heads, search.boundary.as_ref())?;
        let (field, quantity, own) = match patch.condition {
            Condition::Pressure { .. } => (
                "pressure.value",
                "Pa",
                Some([heads.per_pascal, heads.elevation(seepage.centre(patch))]),
            ),
            Condition::Head { .. } => ("head.value", "m", Some([1.0, 0.0])),
            Condition::Flux { .. } => ("flux.value", "m/s", None),
            Condition::Rain { .. } => ("rain.rate", "m/s", None),
            Condition::Discharge { .. } => ("discharge.value", "m3/s", None),
            Condition::SeepageFace { .. }
            | Condition::Evaporation { .. }
            | Condition::NoFlow {} => {
                return Err(refusal(
                    "--boundary",
                    patch.name.clone(),
                    "no water flows through this boundary",
                    "use a boundary with a pressure, head, flux or rain",
                ));
            }
        };
        let material = plan.scene.grains.as_ref().map(|grains| grains.material);
        let liquid = seepage.written.density;
        Ok(Self {
            name: patch.name.clone(),
            path: format!("fluid.darcy.boundaries[{n}].condition.{field}"),
            quantity,
            head: own,
            outlet: lowest(seepage, n, |patch| heads.of_patch(patch)),
            liquid,
            solid: material
                .and_then(|material| plan.scene.materials[material].density)
                .unwrap_or(liquid),
        })
    }

    fn gradient(&self, drive: f64) -> Option<f64> {
        let ([slope, rest], [outlet, distance]) = (self.head?, self.outlet?);
        Some((slope * drive + rest - outlet) / distance)
    }
}

/// Returns the lowest head of the other boundaries, and the distance of its centre from that of the inlet.
fn lowest(
    seepage: &Seepage,
    inlet: usize,
    head: impl Fn(&SeepagePatch) -> Option<f64>,
) -> Option<[f64; 2]> {
    let from = seepage.centre(&seepage.patches[inlet]);
    let others = seepage
        .patches
        .iter()
        .enumerate()
        .filter(|(n, _)| *n != inlet);
    let outlets = others.filter_map(|(_, patch)| {
        let to = seepage.centre(patch);
        head(patch).map(|head| [head, distance(from, to)])
    });
    outlets.min_by(|a, b| a[0].total_cmp(&b[0]))
}

struct Searching<'a> {
    search: &'a Search,
    text: &'a str,
    inlet: &'a Inlet,
    communicator: &'a Communicator,
    threads: usize,
    progress: Progress,
    /// Sample prepared by the first run.
    sample: Option<PathBuf>,
    trials: Vec<Trial>,
}

impl Searching<'_> {
    fn find(mut self) -> Result<Critical, Error> {
        let (mut low, mut high) = (self.search.from, self.search.to);
        if self.erodes(low)? {
            let left: u64 = self
                .trials
                .iter()
                .map(|trial| trial.early + trial.late)
                .sum();
            return Err(Error::Usage(format!(
                "{} already erodes at {low} {}, where {left} grains were removed; use a lower --from, or \
                 --grains above {left} if these grains lay loose in an opening",
                self.inlet.name, self.inlet.quantity
            )));
        }
        if !self.erodes(high)? {
            return Err(Error::Usage(format!(
                "{} does not erode at {high} {}; use a higher --to, or a longer run (time.end)",
                self.inlet.name, self.inlet.quantity
            )));
        }
        let section = Section {
            from: low,
            to: high,
            tolerance: Tolerance::Relative(self.search.tolerance),
            parts: 2,
        };
        loop {
            let trials = self.trials.iter();
            let tried: Vec<_> = trials
                .map(|trial| (trial.drive, Some(trial.erodes)))
                .collect();
            match section.next(&tried) {
                Round::Try(drives) => {
                    for drive in drives {
                        self.erodes(drive)?;
                    }
                }
                Round::Found(Bracket { ends, .. }) => {
                    [low, high] = ends;
                    break;
                }
                // Both ends have been run, with different verdicts.
                Round::SameVerdict(_) | Round::Undecided(_) => break,
            }
        }
        let whole = self.trials.iter().rfind(|trial| !trial.erodes);
        let porosity = whole.map_or(f64::NAN, |trial| trial.porosity);
        let gradient = |drive| self.inlet.gradient(drive);
        Ok(Critical {
            boundary: self.inlet.name.clone(),
            quantity: self.inlet.quantity.into(),
            holds: low,
            erodes: high,
            gradient: gradient(low).zip(gradient(high)).map(|(a, b)| [a, b]),
            terzaghi: (1.0 - porosity) * (self.inlet.solid / self.inlet.liquid - 1.0),
            trials: self.trials,
        })
    }

    /// Runs the case with a drive; returns `true` if it erodes. Collective.
    fn erodes(&mut self, drive: f64) -> Result<bool, Error> {
        let folder = self
            .search
            .output
            .join(format!("run_{:02}", self.trials.len() + 1));
        let mut more = vec![
            format!("{}={drive:e}", self.inlet.path),
            "output={}".to_owned(),
            "probes=[]".to_owned(),
            "analysis={}".to_owned(),
        ];
        match &self.sample {
            Some(sample) => {
                let path = Value::from(sample.display().to_string());
                more.push(format!("grains.initial={{\"file\": {{\"path\": {path}}}}}"));
                more.push("grains.save=null".to_owned());
            }
            None => more.push("grains.save=sample.csv".to_owned()),
        }
        let plan = planned(self.text, self.search, &more)?;
        let half = plan.clock.steps / 2;
        let bounds = WorkLimits {
            folder: self.search.output.clone(),
            begun: self.search.begun,
            limit: self.search.max_walltime,
        };
        if !run::is_done(self.communicator, &plan, &folder)? {
            run::trial(self.communicator, self.threads, plan, &folder, &bounds)?;
        }
        if self.sample.is_none() {
            let sample = folder.join("sample.csv");
            self.sample = Some(std::path::absolute(&sample).unwrap_or(sample));
        }
        let found = agreement::on_first(self.communicator, || read(&folder, half))?;
        let words = [found.early, found.late, found.porosity.to_bits()];
        let mut bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        self.communicator.broadcast_bytes(0, &mut bytes);
        let (words, _) = bytes.as_chunks::<8>();
        let [early, late, porosity] = *words else {
            return Err(Error::Internal(
                "a message between ranks has the wrong length".into(),
            ));
        };
        let (early, late) = (u64::from_le_bytes(early), u64::from_le_bytes(late));
        let erodes = early + late >= self.search.grains;
        let gradient = self.inlet.gradient(drive);
        self.progress.note(&format!(
            "{drive:.6e} {}{}: {early} grains were removed in the first half, {late} in the second: {}",
            self.inlet.quantity,
            gradient.map_or(String::new(), |i| format!(" (gradient {i:.4})")),
            if erodes { "erodes" } else { "holds" }
        ));
        self.trials.push(Trial {
            drive,
            gradient,
            early,
            late,
            porosity: f64::from_le_bytes(porosity),
            erodes,
        });
        Ok(erodes)
    }
}

/// Result of a trial.
#[derive(Default)]
struct TrialRecord {
    /// Grains that left in the first half.
    early: u64,
    /// Grains that left after it.
    late: u64,
    /// Mean porosity at the end.
    porosity: f64,
}

/// Returns the numbers of grains that left up to step `half` and after it, and the mean porosity at the end.
fn read(folder: &Path, half: u64) -> Result<TrialRecord, Error> {
    let removed = folder.join("removed.csv");
    let (mut early, mut late) = (0, 0);
    if removed.exists() {
        for grain in read_rows(&removed, |grain: &RemovedGrain| grain.id)? {
            *(if grain.step > half {
                &mut late
            } else {
                &mut early
            }) += 1;
        }
    }
    let path = folder.join("summary.json");
    let wrong = |e: String| Error::Io(format!("{}: {e}", path.display()));
    let text =
        io::plain::text(&path, io::plain::LONGEST_CASE).map_err(|e| Error::Io(e.to_string()))?;
    let summary: Value = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
    let porosity = summary["seepage"]["mean_porosity"].as_f64();
    Ok(TrialRecord {
        early,
        late,
        porosity: porosity.unwrap_or(f64::NAN),
    })
}
