//! Launch of runs: MPI and threads, the folder of the run, a new start or a checkpoint.
//!
//! | file | content |
//! |---|---|
//! | `start` | the steps from a plan or a checkpoint to a run before its first step |
//! | `outside` | options, folder, requests and messages during the start |
//! | `grains` | grains and bodies: generated or read, and relaxed |
//! | `restore` | the state from a checkpoint |
//! | `warm_up` | the flow around grains at rest before the run |
//! | `runner` | the loop, requests, checkpoints |
//! | `summary` | the table at the end and `summary.json` |

mod grains;
mod outside;
mod restore;
mod runner;
mod start;
mod summary;
mod warm_up;

use super::Simulation;
use super::affinity::{self, Cores};
use super::agreement;
use super::folder::{Entry, RunFolder};
use super::resume::{self, Resumed};
use super::setup;
use base::error::{Error, Problem, Severity};
use case::fluid::Precision;
use decomposition::{Communicator, Slabs, World};
use dem::space::{PlaneSpace, Space, Volume};
use output::checkpoint::SavedNumber;
use plan::Plan;
use plan::scene::grid::Grid;
use runner::Runner;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Options of a run or restart that are not part of its case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunOptions {
    /// Folder for all files of the run; none for a restart, which continues in its own folder.
    pub output: Option<PathBuf>,
    /// The case file, which output of the run must not replace.
    pub case: Option<PathBuf>,
    /// `true` if an earlier run in the folder may be replaced.
    pub overwrite: bool,
    /// `true` if the end of the run is saved as a checkpoint.
    pub final_checkpoint: bool,
    /// Time at which the program started, from which the walltime counts.
    pub begun: Instant,
    /// Threads of each rank; none for the number of cores of the machine divided by its ranks.
    pub threads: Option<usize>,
    /// Wall-clock time after which the run stops.
    pub max_walltime: Option<Duration>,
    /// `true` if tables are printed as JSON.
    pub json: bool,
    /// `true` if a restart may continue although the case is unstable.
    pub allow_unstable: bool,
}

/// Runs a plan from its start. The first rank calls `accepted` when the plan is known to fit the number of ranks,
/// before the run writes any file.
///
/// # Errors
/// If the run ends early; [`Error::Stopped`] after a request; the error of `accepted`.
pub fn run(
    plan: Plan,
    options: RunOptions,
    accepted: impl FnOnce(&Plan) -> Result<(), Error>,
) -> Result<(), Error> {
    on_world(options.threads, |communicator, threads| {
        listed_slabs(&plan.scene.grid, communicator.size())?;
        agreement::on_first(communicator, || accepted(&plan))?;
        let path = options.output.as_deref().unwrap_or(Path::new("results"));
        let entry = Entry::Fresh {
            overwrite: options.overwrite,
            case: options.case.clone(),
        };
        let folder = RunFolder::enter(path, &entry, communicator)?;
        start_on(communicator, plan, Start::new(folder, &options, threads))
    })
}

/// Continues a run from the newest checkpoint in its folder, with the fields changed that `set` names.
///
/// # Errors
/// If [`run`] fails, if there is no checkpoint, or if the saved state does not allow a change.
pub fn restart(folder: &Path, set: &[String], options: RunOptions) -> Result<(), Error> {
    let path = folder.join("case.json");
    let text = io::plain::text(&path, io::plain::LONGEST_CASE).map_err(|e| {
        Error::Io(format!(
            "{e}; the folder of a run that can continue contains its case"
        ))
    })?;
    resume::read(&text, set, folder)?;
    on_world(options.threads, |communicator, threads| {
        let entered = RunFolder::enter(folder, &Entry::Resume, communicator)?;
        let found = resume::find(&entered, communicator)?;
        let (plan, resumed) = resume::plan(&text, set, folder, found, options.allow_unstable)?;
        let start = Start {
            resumed: Some(resumed),
            ..Start::new(entered, &options, threads)
        };
        start_on(communicator, plan, start)
    })
}

/// Limits of work that consists of several runs.
#[derive(Clone, Debug)]
pub struct WorkLimits {
    /// Folder in which a file STOP ends the work.
    pub folder: PathBuf,
    /// Time at which the work started.
    pub begun: Instant,
    /// Maximum wall time of the work.
    pub limit: Option<Duration>,
}

/// Runs a plan on existing ranks, without printed messages; continues an earlier attempt that was stopped.
/// Collective.
///
/// # Errors
/// If [`run`] would fail.
pub fn trial(
    communicator: &Communicator,
    threads: usize,
    plan: Plan,
    folder: &Path,
    bounds: &WorkLimits,
) -> Result<(), Error> {
    let resumes = agreement::on_first(communicator, || Ok(resume::is_open(folder, &plan)))?;
    let resumes = communicator.all_reduce_max_u64(u64::from(resumes)) > 0;
    let entry = if resumes {
        Entry::Resume
    } else {
        Entry::Fresh {
            overwrite: true,
            case: None,
        }
    };
    let entered = RunFolder::enter(folder, &entry, communicator)?;
    let resumed = resumes
        .then(|| resume::find(&entered, communicator).map(Resumed::unchanged))
        .transpose()?;
    let start = Start {
        folder: entered,
        parent: Some(bounds.folder.clone()),
        resumed,
        slabs: None,
        limit: bounds.limit,
        begun: bounds.begun,
        threads,
        json: false,
        quiet: true,
        final_checkpoint: false,
    };
    start_on(communicator, plan, start)
}

/// Returns `true` if a folder contains exactly this run, finished. Collective.
///
/// # Errors
///
/// If the first rank panics or another rank fails.
pub fn is_done(communicator: &Communicator, plan: &Plan, folder: &Path) -> Result<bool, Error> {
    let done = agreement::on_first(communicator, || {
        let text = io::plain::text(&folder.join("summary.json"), io::plain::LONGEST_CASE)
            .unwrap_or_default();
        let summary: Value = serde_json::from_str(&text).unwrap_or_default();
        Ok(summary["outcome"] == "done" && summary["case_hash"] == plan.case_hash.as_str())
    })?;
    Ok(communicator.all_reduce_max_u64(u64::from(done)) > 0)
}

/// Starts MPI and the threads of this rank and does the work; if it fails on some ranks only, no rank is left
/// waiting.
///
/// # Errors
/// If the work fails.
pub fn on_world<T>(
    threads: Option<usize>,
    work: impl FnOnce(&Communicator, usize) -> Result<T, Error>,
) -> Result<T, Error> {
    let world = World::start().map_err(|e| Error::Internal(e.to_string()))?;
    let communicator = world.communicator();
    let result =
        start_threads(threads, &communicator).and_then(|threads| work(&communicator, threads));
    if let Err(error) = &result
        && !matches!(error, Error::Stopped(_))
        && !communicator.all_arrive(PATIENCE)
    {
        // The other ranks do not know of the error and wait for this rank.
        log::error!("rank {}: {error}", communicator.rank());
        communicator.abort(error.exit_code());
    }
    result
}

/// Starts the threads of this rank, as many as requested or its part of the machine's cores, and returns their
/// number.
fn start_threads(asked: Option<usize>, communicator: &Communicator) -> Result<usize, Error> {
    let local = std::env::var("OMPI_COMM_WORLD_LOCAL_SIZE");
    let local = local.ok().and_then(|n| n.parse::<usize>().ok());
    // Without a launcher that states the ranks of this machine, assume that all ranks run here.
    let ranks = local.unwrap_or_else(|| communicator.size()).max(1);
    let threads = asked.unwrap_or_else(|| {
        (std::thread::available_parallelism().map_or(1, usize::from) / ranks).max(1)
    });
    let first = communicator.rank() == 0;
    match affinity::bind_cores(threads) {
        // A launcher gives the same number of cores to all its ranks, so that one message suffices.
        Cores::TooFew(had) if first => log::warn!(
            "the {threads} threads of a rank share {had} core(s), which is slower than {had} thread(s): use \
             `--threads {had}`, or more cores per rank (`mpirun --bind-to none`, `--map-by slot:PE={threads}`)"
        ),
        Cores::Extended(had) if first => log::info!(
            "each rank was started on {had} core(s); its {threads} threads now have as many"
        ),
        _ => {}
    }
    let cores = affinity::allowed();
    let known = local.is_some() || communicator.size() == 1;
    if known && ranks * threads > cores && first {
        log::warn!(
            "{ranks} rank(s) with {threads} thread(s) each are more than the {cores} core(s) available here, \
             which is slower than `--threads {}`",
            (cores / ranks).max(1)
        );
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .use_current_thread()
        .build_global()
        .map_err(|e| Error::Internal(format!("{threads} threads: {e}")))?;
    Ok(threads)
}

/// Executes the run, and writes the outcome to the summary if the run failed before its own summary. Collective.
fn start_on(communicator: &Communicator, plan: Plan, start: Start) -> Result<(), Error> {
    let summary = start.folder.path().join("summary.json");
    let folder = start.folder.path().display().to_string();
    match choose(communicator, plan, start) {
        Err(Ended::BetweenSteps(error, step)) => {
            let error = match error {
                Error::Stopped(text) => {
                    Error::Stopped(format!("{text}; continue with `solver restart {folder}`"))
                }
                error => error,
            };
            if communicator.rank() == 0 {
                let outcome = if matches!(error, Error::Stopped(_)) {
                    "stopped"
                } else {
                    "failed"
                };
                let text = json!({ "outcome": outcome, "error": error.to_string(), "steps": step });
                // Failure to write the outcome must not hide the error itself.
                let _ = io::atomic::write_json(&summary, &text);
            }
            Err(error)
        }
        Err(Ended::Later(error)) => Err(error),
        Ok(()) => Ok(()),
    }
}

/// Time at which a run ended with an error.
enum Ended {
    /// Error before the first step, or between this step and the next one while the slabs changed; it is not in the
    /// summary yet.
    BetweenSteps(Error, u64),
    /// Later error, which the run itself has reported.
    Later(Error),
}

/// Selects the types for dimension and storage, and runs. Collective.
fn choose(communicator: &Communicator, plan: Plan, start: Start) -> Result<(), Ended> {
    let grid = &plan.scene.grid;
    let communicator = communicator.clone();
    let storage = plan
        .scene
        .flow
        .as_ref()
        .map_or(Precision::F64, |flow| flow.storage);
    match (grid.dimension, storage) {
        (2, Precision::F64) => Runner::<PlaneSpace, f64>::run_to_end(plan, communicator, start),
        (2, Precision::F32) => Runner::<PlaneSpace, f32>::run_to_end(plan, communicator, start),
        (_, Precision::F64) => Runner::<Volume, f64>::run_to_end(plan, communicator, start),
        (_, Precision::F32) => Runner::<Volume, f32>::run_to_end(plan, communicator, start),
    }
}

/// Time for which a rank with an error waits for the other ranks to fail too, before it aborts the job.
const PATIENCE: Duration = Duration::from_secs(5);

/// Returns the slabs that a case lists.
fn listed_slabs(grid: &Grid, ranks: usize) -> Result<Option<Slabs>, Error> {
    let axis = setup::axis(grid.split_axis);
    let (planes, periodic) = (grid.cells[grid.split_axis], grid.periodic[grid.split_axis]);
    let Some(inner) = &grid.slab_bounds else {
        return Ok(None);
    };
    if inner.len() + 1 != ranks {
        return Err(Error::Case(vec![Problem {
            path: "domain.slab_bounds".into(),
            value: format!("{inner:?}"),
            reason: format!(
                "this list makes {} slabs, but there are {ranks} ranks",
                inner.len() + 1
            ),
            remedy: format!(
                "start {} ranks, write {} numbers, or remove the list",
                inner.len() + 1,
                ranks - 1
            )
            .into(),
            severity: Severity::Error,
        }]));
    }
    let mut bounds = Vec::with_capacity(ranks + 1);
    bounds.push(0);
    bounds.extend(inner);
    bounds.push(planes);
    Slabs::from_bounds(axis, bounds, periodic)
        .map(Some)
        .map_err(|e| Error::Internal(format!("domain.slab_bounds: {e}")))
}

/// Returns a run before its first step on this process alone, without printed messages, for callers that advance it
/// themselves: tests and measurements. Outputs go to `folder`.
///
/// # Errors
/// If [`run`] would fail.
pub fn ready<Sp: Space, S: SavedNumber>(
    plan: Plan,
    folder: &Path,
) -> Result<Simulation<Sp, S>, Error> {
    let communicator = Communicator::serial();
    let entry = Entry::Fresh {
        overwrite: true,
        case: None,
    };
    let start = Start {
        folder: RunFolder::enter(folder, &entry, &communicator)?,
        parent: None,
        resumed: None,
        slabs: None,
        limit: None,
        begun: Instant::now(),
        threads: rayon::current_num_threads(),
        json: false,
        quiet: true,
        final_checkpoint: false,
    };
    Runner::begin(plan, communicator, start).map(|runner| runner.simulation)
}

struct Start {
    folder: RunFolder,
    /// Further folder in which a file STOP ends this run.
    parent: Option<PathBuf>,
    resumed: Option<Resumed>,
    /// Slabs to use instead of those of the plan.
    slabs: Option<Slabs>,
    limit: Option<Duration>,
    begun: Instant,
    threads: usize,
    json: bool,
    quiet: bool,
    final_checkpoint: bool,
}

impl Start {
    /// Returns the start of a run in its folder.
    fn new(folder: RunFolder, options: &RunOptions, threads: usize) -> Self {
        Self {
            folder,
            parent: None,
            resumed: None,
            slabs: None,
            limit: options.max_walltime,
            begun: options.begun,
            threads,
            json: options.json,
            quiet: false,
            final_checkpoint: options.final_checkpoint,
        }
    }
}
