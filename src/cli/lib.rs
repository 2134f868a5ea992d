//! The commands of the program. This module prints to the terminal; during a run [`simulation::progress`] prints
//! as well.
//!
//! The errors of a case are found before MPI starts, by every rank and with the same result. Errors that depend on
//! the number of ranks are found after the start of MPI, before the verdict is printed. Only the first rank reports
//! errors.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

mod cite;
mod estimate;
mod first_rank;
mod manual;
mod reference;
mod threshold;
mod usage;

use base::error::{ALLOW_UNSTABLE, Error, Problem, Severity, Verdict, printable_lines};
use base::provenance;
use case::{Document, examples, schema};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use figures::erosion_law::Published;
use figures::jet_erosion::JetApparatus;
use figures::picture::PictureOptions;
use first_rank::first_rank;
use plan::Plan;
use simulation::run::RunOptions;
use simulation::watch;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};
use studies::critical_gradient::{self, Search};
use studies::sweep;
use studies::sweep::study::Run;
use studies::sweep::{Sweep, Task, study};
use studies::uncertainty::pilot;

/// Water eroding soil and rock: lattice Boltzmann, discrete elements and Darcy seepage on MPI.
#[derive(Debug, Parser)]
#[command(name = "solver", version = VERSION.as_str(), about = ABOUT, after_help = EXIT_CODES,
    subcommand_required = true, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Version with the commit, by which a sweep recognises members of the same program. `--version` prints more details.
static VERSION: LazyLock<String> =
    LazyLock::new(|| format!("{} ({})", provenance::VERSION, provenance::commit()));

const ABOUT: &str =
    "Water eroding grains and rock: lattice Boltzmann, discrete elements and Darcy seepage on MPI";

const EXIT_CODES: &str = "`solver CASE` runs a case, also as `mpirun -n N solver CASE`.

Exit codes: 0 done, 2 usage, 3 invalid case, 4 numerical failure, 5 input or output, 6 internal or MPI,
75 stopped early with a checkpoint, 101 panic, 128 + n ended by signal n.";

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a case (the default command).
    Run(StartArgs),
    /// Check a case and list all errors and warnings.
    Validate {
        #[command(flatten)]
        case: CaseArgs,
        #[command(flatten)]
        stability: Stability,
    },
    /// Check a case and show models, time steps, limits and costs.
    Plan(PlanArgs),
    /// List the papers of the models that a case uses.
    Cite {
        #[command(flatten)]
        case: CaseArgs,
        /// Format of the references.
        #[arg(long, default_value = "text")]
        format: cite::Format,
    },
    /// Print the JSON schema of a case, of a study or of a search for a threshold.
    Schema {
        /// Document that the schema describes.
        #[arg(default_value = "case")]
        of: Text,
    },
    /// Write the reference of all parameters of a case: one page for each section.
    Reference {
        /// Format of the pages.
        #[arg(long, default_value = "html")]
        format: reference::Format,
        /// Folder for the pages; files of the same names are replaced.
        #[arg(long, value_name = "DIR", default_value = "reference")]
        output: PathBuf,
    },
    /// List the example cases, or print one.
    Example {
        /// Name of the example.
        name: Option<String>,
        /// Print the list as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Describe an output file, an output folder or a checkpoint.
    Info {
        /// File or folder.
        file: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Continue a run from its newest checkpoint, on any number of ranks. A later `time.end` extends a finished run.
    Restart {
        /// Output folder of the run.
        directory: PathBuf,
        /// Change a field that a restart may change (`solver reference` lists them): path=value.
        #[arg(long = "set", value_name = "PATH=VALUE", value_parser = assignment)]
        set: Vec<String>,
        #[command(flatten)]
        run: RunArgs,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Draw fluid and grains of a run at several times as one SVG file.
    Picture {
        /// Output folder of the run.
        run: PathBuf,
        #[command(flatten)]
        options: PictureOptions,
    },
    /// Fit the erosion law across runs, or to the records of jet erosion tests (`--nozzle`, `--head`).
    ErosionLaw {
        /// Output folders of the runs; with `--nozzle` tables of jet erosion tests, one for each specimen, with the
        /// columns `time` and `distance` (from the nozzle to the soil).
        #[arg(required = true)]
        runs: Vec<PathBuf>,
        #[command(flatten)]
        jet: JetArgs,
        /// Folder for CSV and SVG files.
        #[arg(long, value_name = "DIR", default_value = ".")]
        output: PathBuf,
        /// Published result to mark in the figures: C/d [N/m], critical shear stress [Pa], erosion coefficient [s/m].
        #[arg(long, value_name = "C,TAU,K", allow_hyphen_values = true)]
        published: Option<Published>,
        /// Print the fit as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Run the members of a study; write a table and a picture of error against cost.
    Sweep {
        /// Study file.
        study: PathBuf,
        /// Output folder [default: next to the study, with its name].
        #[arg(long, value_name = "DIR")]
        output: Option<PathBuf>,
        #[command(flatten)]
        task: TaskArgs,
        /// Stop before this wall-clock time has passed. The same command continues later.
        #[arg(long, value_name = "H:M:S", value_parser = walltime)]
        max_walltime: Option<Duration>,
    },
    /// Search the value of a field at which a criterion changes, with several runs side by side.
    Threshold(threshold::Arguments),
    /// Run a case on several grids; give the numerical uncertainty of every answer.
    Estimate(estimate::Arguments),
    /// Print the completion script of a shell.
    Completions {
        /// Shell.
        shell: clap_complete::Shell,
    },
    /// Print the manual page: `solver man | man -l -`.
    Man,
    /// Find by bisection the smallest pressure, head or flux at which the seepage erodes grains.
    CriticalGradient(CriticalArgs),
}

/// Arguments of a run.
#[derive(Debug, Args)]
struct StartArgs {
    #[command(flatten)]
    case: CaseArgs,
    /// Output folder [default: results/NAME-OF-THE-CASE].
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Replace the run in the output folder.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    run: RunArgs,
}

/// Apparatus of a jet erosion test.
#[derive(Debug, Args)]
struct JetArgs {
    /// Diameter of the nozzle of a jet erosion test [m].
    #[arg(long, value_name = "M", value_parser = |text: &str| within(text, 1e-5, 10.0), requires = "head",
        conflicts_with = "published")]
    nozzle: Option<f64>,
    /// Head above the nozzle [m].
    #[arg(long, value_name = "M", value_parser = |text: &str| within(text, 1e-4, 1e4), requires = "nozzle")]
    head: Option<f64>,
    /// Density of the water [kg/m3].
    #[arg(long, value_name = "KG/M3", value_parser = |text: &str| within(text, 100.0, 1e4), requires = "nozzle",
        default_value_t = 1000.0)]
    water_density: f64,
    /// Coefficient of friction C_f of the jet on the soil [1].
    #[arg(long, value_parser = |text: &str| within(text, 1e-6, 1.0), requires = "nozzle",
        default_value_t = JetApparatus::FRICTION)]
    jet_friction: f64,
    /// Length of the core of the jet over the diameter of the nozzle [1].
    #[arg(long, value_parser = |text: &str| within(text, 0.1, 100.0), requires = "nozzle",
        default_value_t = JetApparatus::CORE)]
    jet_core: f64,
    /// Bulk density of the dry soil [kg/m3]. With it the coefficient is also given in s/m, the unit of hole erosion
    /// tests.
    #[arg(long, value_name = "KG/M3", value_parser = |text: &str| within(text, 10.0, 1e5), requires = "nozzle")]
    bulk_density: Option<f64>,
}

impl JetArgs {
    /// Returns the apparatus; none without a nozzle.
    fn apparatus(&self) -> Option<JetApparatus> {
        Some(JetApparatus {
            nozzle: self.nozzle?,
            head: self.head?,
            density: self.water_density,
            gravity: 9.81,
            friction: self.jet_friction,
            core: self.jet_core,
        })
    }
}

/// Arguments of a plan.
#[derive(Debug, Args)]
struct PlanArgs {
    #[command(flatten)]
    case: CaseArgs,
    /// Estimate the time on this number of MPI ranks, too.
    #[arg(short = 'n', long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    ranks: Option<u32>,
    /// Estimate the time with this number of threads per rank, at most 1024 [default: cores of the machine divided by
    /// its ranks].
    #[arg(long, value_parser = usage::threads)]
    threads: Option<u16>,
    /// First run the case on coarse cells, for at most a tenth of its cost, and take speed and pressure of the
    /// water from there; the case with these numbers is written to NAME.pilot.json.
    #[arg(long)]
    pilot: bool,
    /// Print every feature of the promised accuracy with its cells and its measured bound.
    #[arg(long)]
    details: bool,
    #[command(flatten)]
    stability: Stability,
}

/// Arguments of the search for a critical gradient.
#[derive(Debug, Args)]
struct CriticalArgs {
    #[command(flatten)]
    case: CaseArgs,
    #[command(flatten)]
    stability: Stability,
    /// Driving boundary [default: the one with the highest head].
    #[arg(long, value_name = "NAME")]
    boundary: Option<String>,
    /// Value that does not erode, in the unit of the boundary condition.
    #[arg(long, allow_hyphen_values = true)]
    from: f64,
    /// Value that erodes, in the same unit.
    #[arg(long, allow_hyphen_values = true)]
    to: f64,
    /// Width of the final bracket over its upper end [1].
    #[arg(long, default_value_t = 0.05, value_parser = fraction)]
    tolerance: f64,
    /// Minimum outflow counted as erosion: number of grains that leave in a run.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    grains: u64,
    /// Folder of the runs [default: results/NAME-OF-THE-CASE].
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Threads per rank, at most 1024 [default: cores of the machine divided by its ranks].
    #[arg(long, value_parser = usage::threads)]
    threads: Option<u16>,
    /// Stop before this wall-clock time has passed. The same command continues later.
    #[arg(long, value_name = "H:M:S", value_parser = walltime)]
    max_walltime: Option<Duration>,
}

/// Documents with a schema.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Text {
    Case,
    Study,
    Threshold,
}

#[derive(Debug, Args)]
#[group(multiple = false)]
struct TaskArgs {
    /// Only list the members, their costs and their states.
    #[arg(long)]
    list: bool,
    /// Only run the member with this number in the list, for a job array.
    #[arg(long, value_name = "K")]
    member: Option<usize>,
    /// Only write table and picture from the members that are done.
    #[arg(long)]
    collect: bool,
    /// Only print a Slurm job array script.
    #[arg(long)]
    slurm: bool,
}

impl TaskArgs {
    fn task(&self) -> Task {
        match self.member {
            Some(number) => Task::Member(number),
            None if self.list => Task::List,
            None if self.collect => Task::Collect,
            None if self.slurm => Task::Slurm,
            None => Task::Run,
        }
    }
}

#[derive(Debug, Args)]
struct CaseArgs {
    /// Case file.
    case: PathBuf,
    /// Set a field of the case: path=value, for example time.end=2 or probes[0].every=0.1.
    #[arg(long = "set", value_name = "PATH=VALUE", value_parser = assignment)]
    set: Vec<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct RunArgs {
    /// Threads per rank, at most 1024 [default: cores of the machine divided by its ranks].
    #[arg(long, value_parser = usage::threads)]
    threads: Option<u16>,
    /// Stop with a checkpoint before this wall-clock time has passed.
    #[arg(long, value_name = "H:M:S", value_parser = walltime)]
    max_walltime: Option<Duration>,
    /// Write no checkpoint at the end of the run. The run cannot be extended then.
    #[arg(long)]
    no_final_checkpoint: bool,
    #[command(flatten)]
    stability: Stability,
}

#[derive(Clone, Copy, Debug, Args)]
struct Stability {
    /// Run a case although similar runs failed.
    #[arg(long)]
    allow_unstable: bool,
}

/// Parses the arguments (the first is the program's name), carries out the command, returns the exit code.
#[must_use]
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> i32 {
    // A write beyond the limit of `ulimit -f` then fails with an error instead of killing the process silently. The
    // flag itself is not used.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    let begun = Instant::now();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    if arguments.get(1).is_some_and(|first| first == "--version") {
        let text = format!("solver {}\n{}", *VERSION, simulation::versions::report());
        return ended(print(&text));
    }
    let arguments = match with_default_command(arguments) {
        Ok(arguments) => arguments,
        Err(error) => return ended(Err(error)),
    };
    let matches = with_negative_numbers(Cli::command()).try_get_matches_from(arguments);
    let cli = match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => {
            if first_rank() {
                // If the terminal is closed, the message is lost.
                let _ = error.print();
            }
            return error.exit_code();
        }
    };
    let runs = matches!(
        cli.command,
        Command::Run(_) | Command::Restart { .. } | Command::CriticalGradient(_)
    );
    if runs && let Err(error) = watch::catch_signals() {
        return ended(Err(error));
    }
    ended(run_command(cli.command, begun))
}

/// Lets the options of a command and of its subcommands take negative numbers, so that the check of an option names
/// it instead of an unknown argument.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let number = |option: clap::Arg| {
        let takes = option.get_long().is_some() && option.get_action().takes_values();
        option.allow_negative_numbers(takes)
    };
    command
        .mut_args(number)
        .mut_subcommands(with_negative_numbers)
}

fn run_command(command: Command, begun: Instant) -> Result<(), Error> {
    match command {
        Command::Run(arguments) => start(arguments, begun),
        Command::Validate { case, stability } => validate(&case, stability),
        Command::Plan(arguments) => plan(&arguments),
        Command::Cite { case, format } => {
            let plan = prepare(&case)?;
            if case.json {
                print(&pretty(&plan::citations::citations(&plan)))
            } else {
                print(&cite::text(&plan, format))
            }
        }
        Command::Schema { of: Text::Case } => print(&pretty(&schema())),
        Command::Schema { of: Text::Study } => print(&pretty(&study::schema())),
        Command::Schema {
            of: Text::Threshold,
        } => print(&pretty(&studies::threshold::study::schema())),
        Command::Reference { format, output } => print(&reference::write(format, &output)?),
        Command::Example { name, json } => example(name.as_deref(), json),
        Command::Info { file, json } => print(&output::info::info(&file, json)?),
        Command::Restart {
            directory,
            set,
            run,
            json,
        } => {
            let options = options(run, json, begun);
            report_with_verdict(
                simulation::run::restart(&directory, &set, options),
                &directory,
            )
        }
        Command::Completions { shell } => write_output(&manual::completions::<Cli>(shell)),
        Command::Man => {
            let page = manual::page::<Cli>();
            write_output(&page.map_err(|e| Error::Internal(format!("the manual page: {e}")))?)
        }
        Command::Picture { run, options } => print(&figures::picture::picture(&run, &options)?),
        Command::Sweep {
            study,
            output,
            task,
            max_walltime,
        } => sweep(&Sweep {
            study,
            output,
            task: task.task(),
            max_walltime,
        }),
        Command::Threshold(arguments) => threshold::command(arguments),
        Command::Estimate(arguments) => estimate::command(arguments),
        Command::CriticalGradient(arguments) => search(arguments, begun),
        Command::ErosionLaw {
            runs,
            jet,
            output,
            published,
            json,
        } => match jet.apparatus() {
            Some(apparatus) => {
                let command = figures::jet_erosion::command;
                print(&command(&runs, apparatus, jet.bulk_density, &output, json)?)
            }
            None => {
                let command = figures::erosion_law::command;
                print(&command(&runs, &output, published, json)?)
            }
        },
    }
}

/// Searches for the critical gradient of a case.
fn search(arguments: CriticalArgs, begun: Instant) -> Result<(), Error> {
    let CriticalArgs { case, output, .. } = arguments;
    let search = Search {
        output: output.unwrap_or_else(|| folder_of(&case.case)),
        case: case.case.clone(),
        set: case.set,
        boundary: arguments.boundary,
        from: arguments.from,
        to: arguments.to,
        tolerance: arguments.tolerance,
        grains: arguments.grains,
        threads: arguments.threads.map(usize::from),
        begun,
        max_walltime: arguments.max_walltime,
        allow_unstable: arguments.stability.allow_unstable,
    };
    let found = critical_gradient::command(&search, case.json);
    report_with_verdict(found.and_then(|text| print(&text)), &case.case)
}

/// Reports an error and returns the exit code.
fn ended(result: Result<(), Error>) -> i32 {
    match result {
        Ok(()) => 0,
        Err(error) => {
            // Problems of a case have been listed by `report_problems`.
            if !matches!(error, Error::Case(_)) {
                report_error(&format!("solver: {error}"));
            }
            if !first_rank() {
                // mpirun ends all ranks as soon as one ends with an error. The first rank therefore reports before
                // that.
                std::thread::sleep(SILENT_RANKS_WAIT);
            }
            error.exit_code()
        }
    }
}

/// Delay of the other ranks behind the first rank, which reports the error.
const SILENT_RANKS_WAIT: Duration = Duration::from_millis(500);

/// Adds the default command: `solver case.json` is `solver run case.json`.
///
/// # Errors
/// If the first word is neither a command nor a file, [`Error::Usage`].
fn with_default_command(mut arguments: Vec<OsString>) -> Result<Vec<OsString>, Error> {
    let command = Cli::command();
    let known = |word: &str| {
        matches!(word, "help" | "-h" | "--help" | "-V" | "--version")
            || command.get_subcommands().any(|sub| sub.get_name() == word)
    };
    if let Some(first) = arguments.get(1)
        && !first.to_str().is_some_and(known)
    {
        let commands: Vec<&str> = command.get_subcommands().map(|c| c.get_name()).collect();
        usage::command_or_file(first, &commands)?;
        arguments.insert(1, "run".into());
    }
    Ok(arguments)
}

/// Runs a case.
fn start(arguments: StartArgs, begun: Instant) -> Result<(), Error> {
    let case = &arguments.case;
    let output = arguments.output.unwrap_or_else(|| folder_of(&case.case));
    let options = RunOptions {
        output: Some(output),
        case: Some(case.case.clone()),
        overwrite: arguments.overwrite,
        ..options(arguments.run, case.json, begun)
    };
    let plan = prepare(case)?;
    let stability = Stability {
        allow_unstable: options.allow_unstable,
    };
    let accept = |plan: &Plan| {
        print_plan(plan, case)?;
        print_verdict(&plan.warnings, case, stability)
    };
    if !Verdict::from_findings(&plan.warnings).runs(stability.allow_unstable) {
        return accept(&plan);
    }
    // The number of ranks may still refuse the case, and a case has a single verdict: it is printed when the number
    // of ranks is known.
    let mut accepted = false;
    let outcome = simulation::run::run(plan, options, |plan| {
        accepted = true;
        accept(plan)
    });
    match outcome {
        Err(Error::Case(problems)) if !accepted => list_problems(problems, case),
        outcome => report_problems(outcome),
    }
}

/// Runs a sweep, whose members are separate processes. If several ranks were started, only the first one runs them.
fn sweep(sweep: &Sweep) -> Result<(), Error> {
    if !first_rank() {
        return Ok(());
    }
    // A reader that has closed the output is no reason to stop.
    report_problems(sweep::command(sweep, &|line| drop(print(line))))
}

/// Returns the default output folder of a case.
fn folder_of(case: &Path) -> PathBuf {
    Path::new("results").join(case.file_stem().unwrap_or(case.as_os_str()))
}

/// Parses a fraction above 0 and below 1.
fn fraction(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(share) if share > 0.0 && share < 1.0 => Ok(share),
        _ => Err("a number above 0 and below 1".into()),
    }
}

/// Parses a number of a range that includes its ends.
fn within(text: &str, low: f64, high: f64) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if (low..=high).contains(&number) => Ok(number),
        _ => Err(format!("use a number from {low} to {high}")),
    }
}

/// Lists problems that are found only during the work.
fn report_problems(outcome: Result<(), Error>) -> Result<(), Error> {
    if let Err(Error::Case(problems)) = &outcome {
        list(problems);
    }
    outcome
}

/// Reports problems like [`report_problems`], with the verdict on a case that has not been read before.
fn report_with_verdict(outcome: Result<(), Error>, name: &Path) -> Result<(), Error> {
    let outcome = report_problems(outcome);
    if let Err(Error::Case(findings)) = &outcome {
        report_error(&refusal(findings, name));
    }
    outcome
}

/// Returns the verdict on a case that is not run.
fn refusal(findings: &[Problem], name: &Path) -> String {
    let sentence = match Verdict::from_findings(findings) {
        // Files that are not text have no findings.
        Verdict::Valid => Verdict::Refused.name().to_owned(),
        _ => Verdict::sentence(findings),
    };
    let how = match Verdict::from_findings(findings) {
        Verdict::Unstable => format!("; use {ALLOW_UNSTABLE} to run it"),
        _ => String::new(),
    };
    format!("{}: {sentence}; the case was not run{how}", name.display())
}

fn options(run: RunArgs, json: bool, begun: Instant) -> RunOptions {
    RunOptions {
        output: None,
        case: None,
        overwrite: false,
        final_checkpoint: !run.no_final_checkpoint,
        begun,
        threads: run.threads.map(usize::from),
        max_walltime: run.max_walltime,
        json,
        allow_unstable: run.stability.allow_unstable,
    }
}

fn validate(case: &CaseArgs, stability: Stability) -> Result<(), Error> {
    let plan = prepare(case)?;
    if case.json {
        print(&pretty(&report(&plan.warnings, stability)))?;
    } else {
        list(&plan.warnings);
    }
    print_verdict(&plan.warnings, case, stability)
}

fn plan(arguments: &PlanArgs) -> Result<(), Error> {
    let PlanArgs {
        ref case,
        ranks,
        threads,
        pilot,
        details,
        stability,
    } = *arguments;
    let mut plan = prepare(case)?;
    if pilot && !first_rank() {
        return Ok(());
    }
    if pilot {
        plan = match piloted(&plan, case) {
            Ok(Some(piloted)) => piloted,
            Ok(None) => plan,
            Err(error) => return report_with_verdict(Err(error), &case.case),
        };
    }
    plan.on_machine(simulation::calibration::machine(&plan));
    if ranks.is_some() || threads.is_some() {
        let ranks = ranks.map_or(1, |ranks| ranks as usize);
        let threads = threads.map_or_else(|| (usage::cores() / ranks).max(1), usize::from);
        let crowded = simulation::calibration::crowded(&plan, ranks * threads);
        plan.on_cores(ranks, threads, crowded);
    }
    if case.json {
        let mut tree = plan_as_data(&plan);
        tree["uncertainty_estimate"] = estimate::costs_as_data(&plan, stability);
        print(&pretty(&tree))?;
    } else {
        print_plan(&plan, case)?;
        print(&estimate::costs(&plan, stability))?;
        if details {
            print(&plan.details())?;
        }
    }
    print_verdict(&plan.warnings, case, stability)
}

/// Runs the pilot of a case, writes it to the folder of the case, and returns the plan with its results; `None` if the
/// case needs no pilot.
fn piloted(plan: &Plan, case: &CaseArgs) -> Result<Option<Plan>, Error> {
    let report = |line: &str| {
        if !case.json {
            // A reader that has closed the output is no reason to stop.
            drop(print(line));
        }
    };
    let mut folder = folder_of(&case.case).into_os_string();
    folder.push("-pilot");
    let threads = u32::try_from(usage::cores()).unwrap_or(1);
    let run = Run {
        threads,
        ..Run::default()
    };
    let Some((found, tree)) = pilot::command(plan, Path::new(&folder), &run, &report)? else {
        report(&format!(
            "no pilot: none on coarser cells costs at most {} % of this run; the plan keeps its own estimates",
            100.0 * pilot::MAX_COST
        ));
        return Ok(None);
    };
    let path = case.case.with_extension("pilot.json");
    pilot::write(&tree, &path)?;
    report(&format!(
        "{}; `solver {}` runs the case with it",
        pilot::description(&found),
        path.display()
    ));
    let directory = case.case.parent().unwrap_or_else(|| Path::new(""));
    let document = Document::read(&tree.to_string(), &[], directory).map_err(Error::Case)?;
    Plan::prepare(document).map(Some).map_err(Error::Case)
}

/// Prints the findings, then the plan.
fn print_plan(plan: &Plan, case: &CaseArgs) -> Result<(), Error> {
    if case.json {
        print(&pretty(&plan_as_data(plan)))
    } else {
        list(&plan.warnings);
        print(&plan.to_string())
    }
}

/// Returns the plan and its verdict as data.
fn plan_as_data(plan: &Plan) -> serde_json::Value {
    let mut tree = serde_json::to_value(plan).unwrap_or_default();
    tree["verdict"] = Verdict::from_findings(&plan.warnings).name().into();
    tree
}

/// Returns the findings as data.
fn report(findings: &[Problem], stability: Stability) -> serde_json::Value {
    let verdict = Verdict::from_findings(findings);
    let allowed = stability.allow_unstable;
    serde_json::json!({
        "verdict": verdict.name(),
        "valid": verdict.runs(allowed),
        "exit_code": verdict.exit_code(allowed),
        "findings": findings,
    })
}

/// Prints the verdict unless the JSON contains it.
///
/// # Errors
/// If the case is not run, [`Error::Case`].
fn print_verdict(findings: &[Problem], case: &CaseArgs, stability: Stability) -> Result<(), Error> {
    let accepted = Verdict::from_findings(findings).runs(stability.allow_unstable);
    if !accepted {
        if !case.json {
            report_error(&refusal(findings, &case.case));
        }
        return Err(Error::Case(findings.to_vec()));
    }
    if case.json {
        return Ok(());
    }
    let sentence = Verdict::sentence(findings);
    print(&format!("{}: {sentence}", case.case.display()))
}

/// Reads, checks and plans the case; lists all problems.
fn prepare(case: &CaseArgs) -> Result<Plan, Error> {
    let path = &case.case;
    let text = io::plain::text(path, io::plain::LONGEST_CASE);
    let text = match text {
        Ok(text) => text,
        Err(io::Error::Corrupt { reason, .. }) => {
            // The remedy says how to save it.
            let found = reason.split(": save").next().unwrap_or_default();
            let reason = format!("a case is JSON text in UTF-8, and this file is not: {found}");
            let remedy = "save the file as text in UTF-8 and read it again";
            let problem = Problem::error("the text", "not UTF-8", reason, remedy);
            return list_problems(vec![problem], case);
        }
        Err(other) => return unreadable(&other, case),
    };
    let directory = path.parent().unwrap_or(Path::new(""));
    Document::read(&text, &case.set, directory)
        .and_then(Plan::prepare)
        .or_else(|problems| list_problems(problems, case))
}

/// Reports a case whose file cannot be read, as a finding if data are asked for.
///
/// # Errors
/// If nothing else fails, [`Error::Io`]; otherwise the error of the output.
fn unreadable<T>(error: &io::Error, case: &CaseArgs) -> Result<T, Error> {
    let error = Error::Io(format!("the case: {error}"));
    if case.json {
        let remedy = "name a file that exists and can be read";
        let file = case.case.display().to_string();
        let finding = Problem::error("the case", file, error.to_string(), remedy);
        let allowed = Stability {
            allow_unstable: false,
        };
        let mut tree = report(&[finding], allowed);
        tree["exit_code"] = error.exit_code().into();
        print(&pretty(&tree))?;
    }
    Err(error)
}

/// Lists problems with the verdict.
///
/// # Errors
/// If nothing else fails, [`Error::Case`] with the problems; otherwise the error of the output.
fn list_problems<T>(problems: Vec<Problem>, case: &CaseArgs) -> Result<T, Error> {
    if case.json {
        let stability = Stability {
            allow_unstable: false,
        };
        print(&pretty(&report(&problems, stability)))?;
    } else {
        list(&problems);
        report_error(&refusal(&problems, &case.case));
    }
    Err(Error::Case(problems))
}

fn example(name: Option<&str>, json: bool) -> Result<(), Error> {
    let Some(name) = name else {
        if json {
            let list: Vec<_> = examples::EXAMPLES
                .iter()
                .map(|e| serde_json::json!({"name": e.name, "summary": e.summary}))
                .collect();
            return print(&pretty(&list));
        }
        let lines: Vec<String> = examples::EXAMPLES
            .iter()
            .map(|e| format!("{:14}  {}", e.name, e.summary))
            .collect();
        let last = "\nsolver example NAME > case.json; mpirun -n 2 solver case.json\nsolver example sweep > \
            study.json; solver sweep study.json\nsolver example threshold > search.json; solver threshold search.json";
        return print(&format!("{}\n{last}", lines.join("\n")));
    };
    let studies = [&examples::STUDY, &examples::SEARCH];
    let study = studies.into_iter().find(|study| study.name == name);
    match examples::find(name).or(study) {
        Some(example) => print(example.text.trim_end()),
        None => {
            let known: Vec<&str> = examples::EXAMPLES.iter().map(|e| e.name).collect();
            let meant = match case::check::nearest(name, &known) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("use one of: {}", known.join(", ")),
            };
            Err(Error::Usage(format!(
                "there is no example `{name}`; {meant}"
            )))
        }
    }
}

fn list(problems: &[Problem]) {
    for problem in problems {
        let weight = match problem.severity {
            Severity::Error => "error",
            Severity::Unstable => "unstable",
            Severity::Warning => "warning",
        };
        report_error(&format!("{weight}: {problem}"));
    }
}

fn pretty(value: &impl serde::Serialize) -> String {
    serde_json::to_string_pretty(value).unwrap_or_default()
}

/// Prints a text to the standard output; a closed output is not an error.
fn print(text: &str) -> Result<(), Error> {
    if !first_rank() {
        return Ok(());
    }
    write_output(format!("{}\n", printable_lines(text)).as_bytes())
}

/// Writes bytes to the standard output; a closed output is not an error.
fn write_output(bytes: &[u8]) -> Result<(), Error> {
    if !first_rank() {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(Error::Io(format!(
            "cannot write to the standard output: {error}"
        ))),
        _ => Ok(()),
    }
}

/// Prints a text to the standard error; failures are ignored.
fn report_error(text: &str) {
    if first_rank() {
        let _ = writeln!(std::io::stderr(), "{}", printable_lines(text));
    }
}

fn assignment(text: &str) -> Result<String, String> {
    match text.split_once('=') {
        Some((path, _)) if !path.trim().is_empty() => Ok(text.to_string()),
        _ => Err("write path=value, for example time.end=2".into()),
    }
}

fn walltime(text: &str) -> Result<Duration, String> {
    let wrong = || format!("`{text}` is not H:M:S, for example 1:30:00");
    let parts: Vec<u64> = text
        .split(':')
        .map(|part| part.parse().map_err(|_| wrong()))
        .collect::<Result<_, _>>()?;
    let [hours, minutes, seconds] = parts[..] else {
        return Err(wrong());
    };
    if minutes > 59 || seconds > 59 || hours > 100_000 || hours + minutes + seconds == 0 {
        return Err(wrong());
    }
    Ok(Duration::from_secs(hours * 3600 + minutes * 60 + seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_case_without_a_command_is_run() {
        let line = |words: &[&str]| {
            with_default_command(words.iter().map(OsString::from).collect())
                .unwrap()
                .into_iter()
                .map(|w| w.into_string().unwrap())
                .collect::<Vec<_>>()
        };
        assert_eq!(line(&["solver", "a.json"]), ["solver", "run", "a.json"]);
        assert_eq!(line(&["solver", "--threads", "2", "a.json"])[1], "run");
        assert_eq!(line(&["solver", "validate", "a.json"])[1], "validate");
        assert_eq!(line(&["solver", "--help"])[1], "--help");
        assert_eq!(line(&["solver"]).len(), 1);
        let words = ["solver", "frobnicate"].map(OsString::from);
        assert!(with_default_command(words.to_vec()).is_err());
    }

    #[test]
    fn completions_and_manual_know_every_command() {
        use clap::ValueEnum;
        let page = String::from_utf8(manual::page::<Cli>().unwrap()).unwrap();
        let scripts = clap_complete::Shell::value_variants().iter().map(|&shell| {
            let script = manual::completions::<Cli>(shell);
            (shell.to_string(), String::from_utf8(script).unwrap())
        });
        let mut seen = 0;
        for (what, text) in scripts.chain([("man".to_owned(), page.replace("\\-", "-"))]) {
            for command in Cli::command().get_subcommands() {
                assert!(text.contains(command.get_name()), "{what}: {text}");
                seen += 1;
            }
        }
        assert!(seen > 60, "{seen}");
        assert_eq!(
            page.matches("\n.TH ").count() + usize::from(page.starts_with(".TH ")),
            1
        );
        for word in ["SOLVER RESTART", "EXIT CODES", "max\\-walltime"] {
            assert!(
                page.to_uppercase().contains(&word.to_uppercase()),
                "{word}: {page}"
            );
        }
    }

    #[test]
    fn walltime_is_hours_minutes_seconds() {
        assert_eq!(walltime("1:02:03"), Ok(Duration::from_secs(3723)));
        for bad in [
            "",
            "1:2",
            "1:60:00",
            "a:0:0",
            "0:0:0",
            "-1:0:0",
            "1:2:3:4",
            "99999999999999999:0:0",
        ] {
            assert!(walltime(bad).is_err(), "{bad}");
        }
    }
}
