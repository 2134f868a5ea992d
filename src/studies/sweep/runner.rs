//! Members as processes of this program, one or several at a time.
//!
//! The file `STOP` in its folder stops a member: the run writes a checkpoint and ends with exit code 75 on any number
//! of ranks. A member that has not ended after one minute is killed. Members are stopped when a signal, a file `STOP`
//! in the folder of the sweep or its wall time ends the sweep, and when a member reaches its time limit.
//!
//! Environment variables, as for the scripts under `jobs`: SOLVER (the program; default: this one), LAUNCH (the command
//! that starts MPI; default: `mpirun -n RANKS`, and none for one rank).

use super::LineReport;
use super::members::Member;
use super::record::{FILE, Outcome, Record};
use super::study::Run;
use base::error::{ALLOW_UNSTABLE, Error};
use serde_json::Value;
use std::collections::VecDeque;
use std::fs::{self, OpenOptions};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Interval between two checks of the running members; their times are measured separately.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Maximum time for a member to write its checkpoint.
const PATIENCE: Duration = Duration::from_secs(60);
/// Part of the wall time of a sweep reserved for the checkpoints of its members.
const RESERVE: Duration = Duration::from_secs(5);
/// Clock ticks per second in `/proc/PID/stat`: USER_HZ, 100 on all current Linux machines.
const TICKS: f64 = 100.0;

/// Runner of members, with its output folder.
pub struct Runner<'a> {
    run: &'a Run,
    allow_unstable: bool,
    output: &'a Path,
    report: LineReport<'a>,
    solver: PathBuf,
    version: String,
    stop: Arc<AtomicBool>,
    end: Option<Instant>,
}

/// Running member.
struct Job<'a> {
    number: usize,
    member: &'a Member,
    folder: PathBuf,
    child: Child,
    begun: Instant,
    asked: Option<Instant>,
    given_up: bool,
    /// Processor time used so far \[s\].
    processor: f64,
    record: Record,
}

/// Returns the path of the program that runs members.
fn solver() -> Result<PathBuf, Error> {
    match std::env::var_os("SOLVER") {
        Some(path) => Ok(path.into()),
        None => std::env::current_exe()
            .map_err(|e| Error::Internal(format!("this program cannot be found: {e}"))),
    }
}

/// Returns the version that the program of the members prints.
///
/// # Errors
/// If it cannot be started, [`Error::Io`].
pub fn solver_version() -> Result<String, Error> {
    let path = solver()?;
    let done = remove_rank_variables(Command::new(&path).arg("-V"))
        .output()
        .map_err(|e| Error::Io(format!("{}: {e}", path.display())))?;
    Ok(String::from_utf8_lossy(&done.stdout).trim().to_owned())
}

/// Removes the environment variables that would make the process a rank of another MPI job.
fn remove_rank_variables(command: &mut Command) -> &mut Command {
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        let of_a_rank = ["OMPI_COMM_WORLD_", "PMI_", "SLURM_PROCID"];
        let pmix = text.starts_with("PMIX_") && !text.starts_with("PMIX_MCA_");
        if pmix || of_a_rank.iter().any(|start| text.starts_with(start)) {
            command.env_remove(&name);
        }
    }
    command
}

impl<'a> Runner<'a> {
    /// Creates the output folder and registers signal handlers. Unstable members run if this is allowed.
    ///
    /// # Errors If the folder holds a run ([`Error::Usage`]), if it cannot be created ([`Error::Io`]), or if
    /// signals cannot be caught ([`Error::Internal`]).
    pub fn new(
        run: &'a Run,
        allow_unstable: bool,
        output: &'a Path,
        walltime: Option<Duration>,
        report: LineReport<'a>,
    ) -> Result<Self, Error> {
        use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR2};
        simulation::folder::refuse_run(output)?;
        fs::create_dir_all(output).map_err(|e| Error::Io(format!("{}: {e}", output.display())))?;
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM, SIGUSR2] {
            signal_hook::flag::register(signal, Arc::clone(&stop))
                .map_err(|e| Error::Internal(format!("signal {signal} cannot be caught: {e}")))?;
        }
        Ok(Self {
            run,
            allow_unstable,
            output,
            report,
            solver: solver()?,
            version: solver_version()?,
            stop,
            end: walltime.map(|walltime| Instant::now() + walltime.saturating_sub(RESERVE)),
        })
    }

    /// Returns `true` if a signal, the file STOP or the time limit requests an end.
    fn is_to_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
            || self.end.is_some_and(|end| Instant::now() >= end)
            || self.output.join("STOP").exists()
    }

    /// Runs the unfinished members and waits for all of them.
    ///
    /// # Errors
    /// If not all members ended ([`Error::Stopped`]), or if a file or process failed ([`Error::Io`]).
    pub fn run(&self, members: &[Member]) -> Result<(), Error> {
        let mut queue: VecDeque<(usize, &Member)> = self.missing(members).collect();
        let mut planned: f64 = queue.iter().map(|(_, m)| seconds(m)).sum();
        if queue.len() < members.len() {
            let done = members.len() - queue.len();
            (self.report)(&format!("{done} of {} members need no run", members.len()));
        }
        let mut jobs: Vec<Job<'_>> = Vec::new();
        let (mut spent, mut of_plan, mut stopped) = (0.0, 0.0, 0_usize);
        loop {
            let stopping = self.is_to_stop();
            while !stopping && jobs.len() < self.run.at_once as usize {
                let Some((number, member)) = queue.pop_front() else {
                    break;
                };
                jobs.push(self.start(number, member)?);
            }
            let mut running = Vec::new();
            for mut job in jobs {
                if !self.check(&mut job, stopping)? {
                    running.push(job);
                    continue;
                }
                spent += job.begun.elapsed().as_secs_f64();
                of_plan += seconds(job.member);
                planned -= seconds(job.member);
                stopped += usize::from(job.record.outcome == Outcome::Stopped);
                let left =
                    planned.max(0.0) * spent / of_plan.max(1e-9) / f64::from(self.run.at_once);
                self.report(&job, members.len(), left);
            }
            jobs = running;
            if jobs.is_empty() && (stopping || queue.is_empty()) {
                break;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        // The next call must not stop at once.
        let _ = fs::remove_file(self.output.join("STOP"));
        if stopped + queue.len() == 0 {
            return Ok(());
        }
        Err(Error::Stopped(format!(
            "{} members are not finished; run the same command again to continue",
            stopped + queue.len()
        )))
    }

    fn missing<'m>(&self, members: &'m [Member]) -> impl Iterator<Item = (usize, &'m Member)> {
        members.iter().enumerate().filter(|(_, member)| {
            let record = Record::read(&self.output.join(&member.name));
            let done = record.is_some_and(|r| r.holds(member, &self.version, self.run.time_limit));
            member.prepared.is_some() && !done
        })
    }

    fn report(&self, job: &Job<'_>, count: usize, left: f64) {
        let record = &job.record;
        let why = if record.message.is_empty() {
            String::new()
        } else {
            format!(" ({})", record.message)
        };
        (self.report)(&format!(
            "member {} of {count}: {} {}{why} after {:.1} s; about {left:.0} s left",
            job.number + 1,
            job.member.name,
            record.outcome.name(),
            job.begun.elapsed().as_secs_f64(),
        ));
    }

    fn start<'m>(&self, number: usize, member: &'m Member) -> Result<Job<'m>, Error> {
        let folder = self.output.join(&member.name);
        let fail = |e: std::io::Error| Error::Io(format!("{}: {e}", folder.display()));
        let prepared = member.prepared.as_ref().ok_or_else(|| {
            Error::Internal(format!("{} has no case that can be run", member.name))
        })?;
        let earlier = Record::read(&folder).filter(|record| record.is_of(member, &self.version));
        let resumes = earlier.filter(|record| {
            let open = [Outcome::Stopped, Outcome::Running, Outcome::TimeLimit];
            open.contains(&record.outcome) && has_checkpoint(&folder)
        });
        let again = resumes.is_some();
        let mut record = if let Some(mut record) = resumes {
            record.timed &= record.outcome != Outcome::Running;
            record
        } else {
            empty(&folder)?;
            fs::create_dir_all(&folder).map_err(fail)?;
            Record::new(&prepared.hash, &self.version, self.run.time_limit)
        };
        record.outcome = Outcome::Running;
        record.time_limit = self.run.time_limit;
        record.message.clear();
        record.write(&folder)?;
        for old in ["STOP", "summary.json"] {
            // A missing file need not be removed.
            let _ = fs::remove_file(folder.join(old));
        }
        // The run writes its own case.json.
        let case = folder.join("member_case.json");
        if !again {
            io::atomic::write(&case, prepared.text.as_bytes())
                .map_err(|e| Error::Io(e.to_string()))?;
        }
        let mut command = self.launcher();
        if again {
            command.arg("restart").arg(&folder);
        } else {
            command.arg(&case).arg("--output").arg(&folder);
        }
        command.args(["--threads", &self.run.threads.to_string()]);
        if self.allow_unstable {
            command.arg(ALLOW_UNSTABLE);
        }
        let mut how = OpenOptions::new();
        how.create(true).append(true);
        let log = how.open(folder.join("log.txt")).map_err(fail)?;
        let errors = fs::File::create(folder.join("errors.txt")).map_err(fail)?;
        command.stdin(Stdio::null()).stdout(log).stderr(errors);
        log::debug!(
            "member {} {}: {command:?}",
            member.name,
            if again { "continues" } else { "starts" }
        );
        let child = command
            .spawn()
            .map_err(|e| Error::Io(format!("{:?}: {e}", command.get_program())))?;
        Ok(Job {
            number,
            member,
            folder,
            child,
            begun: Instant::now(),
            asked: None,
            given_up: false,
            processor: 0.0,
            record,
        })
    }

    /// Returns the command that runs a member, without the launcher of its ranks.
    fn launcher(&self) -> Command {
        let launch = std::env::var("LAUNCH")
            .ok()
            .or_else(|| (self.run.ranks > 1).then(|| format!("mpirun -n {}", self.run.ranks)));
        let mut words = launch.iter().flat_map(|text| text.split_whitespace());
        let mut command = match words.next() {
            None => Command::new(&self.solver),
            Some(first) => {
                let mut command = Command::new(first);
                command.args(words).arg(&self.solver);
                command
            }
        };
        remove_rank_variables(&mut command);
        // Ctrl-C reaches this process only: mpirun would end its ranks before they can write a checkpoint.
        command.process_group(0);
        command
    }

    /// Checks if a member has ended, and stops it if required; returns `true` if it has ended and its record is
    /// written.
    fn check(&self, job: &mut Job<'_>, stopping: bool) -> Result<bool, Error> {
        let fail = |e: std::io::Error| Error::Io(format!("{}: {e}", job.member.name));
        let (ended, processor) = processor_time(job.child.id());
        job.processor = job.processor.max(processor);
        let limit = self.run.time_limit.map_or(Duration::MAX, |limit| {
            Duration::try_from_secs_f64(limit).unwrap_or(Duration::MAX)
        });
        if !ended {
            job.given_up |= !stopping && job.begun.elapsed() >= limit;
            match job.asked {
                None if stopping || job.given_up => {
                    io::atomic::write(&job.folder.join("STOP"), b"")
                        .map_err(|e| Error::Io(e.to_string()))?;
                    job.asked = Some(Instant::now());
                }
                Some(asked) if asked.elapsed() >= PATIENCE => job.child.kill().map_err(fail)?,
                _ => {}
            }
            return Ok(false);
        }
        let status = job.child.wait().map_err(fail)?;
        let mut outcome = Outcome::of_code(status.code());
        if job.asked.is_some() && matches!(outcome, Outcome::Stopped | Outcome::Failed) {
            outcome = if job.given_up {
                Outcome::TimeLimit
            } else {
                Outcome::Stopped
            };
        }
        job.close(outcome, status);
        job.record.write(&job.folder)?;
        Ok(true)
    }
}

impl Job<'_> {
    /// Adds the cost of this attempt, as measured by the run.
    fn close(&mut self, outcome: Outcome, status: ExitStatus) {
        let text = io::plain::text(&self.folder.join("summary.json"), io::plain::LONGEST_CASE)
            .unwrap_or_default();
        let summary: Value = serde_json::from_str(&text).unwrap_or_default();
        let seconds = |key: &str| summary[key].as_f64();
        let record = &mut self.record;
        let whole = seconds("wall_seconds").unwrap_or_else(|| self.begun.elapsed().as_secs_f64());
        record.wall_seconds += whole;
        record.loop_seconds += seconds("loop_seconds").unwrap_or(0.0);
        // A killed run has no record of the time of its steps.
        record.timed &= seconds("loop_seconds").is_some();
        record.processor_seconds += self.processor;
        record.outcome = outcome;
        if outcome != Outcome::Finished {
            record.message = last_words(&self.folder);
            if let Some(signal) = status.signal() {
                record.message = format!("ended by signal {signal}; {}", record.message);
            } else if record.message.is_empty() {
                record.message = status.to_string();
            }
        }
    }
}

/// Returns the planned time of a member on one core \[s\].
fn seconds(member: &Member) -> f64 {
    member.prepared.as_ref().map_or(0.0, |p| p.seconds.max(0.1))
}

fn has_checkpoint(folder: &Path) -> bool {
    fs::read_dir(folder.join("checkpoints")).is_ok_and(|mut entries| entries.next().is_some())
}

/// Removes the folder of a member. A folder of another kind is not touched.
fn empty(folder: &Path) -> Result<(), Error> {
    if !folder.exists() {
        return Ok(());
    }
    if !folder.join(FILE).exists() {
        return Err(Error::Io(format!(
            "{} exists and is not the folder of a member; move it or choose another --output",
            folder.display()
        )));
    }
    fs::remove_dir_all(folder).map_err(|e| Error::Io(format!("{}: {e}", folder.display())))
}

/// Returns the last error message of a run.
fn last_words(folder: &Path) -> String {
    let text =
        io::plain::text(&folder.join("errors.txt"), io::plain::LONGEST_CASE).unwrap_or_default();
    let mut lines = text.lines().rev().filter(|line| !line.trim().is_empty());
    let last = lines.clone().next();
    let reported = lines.find(|line| line.starts_with("solver:") || line.starts_with("error:"));
    let line = reported.or(last).unwrap_or_default();
    line.chars().take(300).collect()
}

/// Returns `true` if a child process has ended (it remains a zombie until it is waited for), and the processor time
/// \[s\] of the process and of the children it has waited for, such as the ranks of mpirun.
fn processor_time(process: u32) -> (bool, f64) {
    let Ok(text) = fs::read_to_string(format!("/proc/{process}/stat")) else {
        return (true, 0.0);
    };
    // The name of the program is in brackets and may contain any character.
    let fields = text.rsplit_once(')').map_or("", |(_, rest)| rest);
    let mut fields = fields.split_whitespace();
    let ended = matches!(fields.next(), Some("Z" | "X"));
    let ticks = fields
        .skip(10)
        .take(4)
        .filter_map(|word| word.parse::<f64>().ok());
    (ended, ticks.sum::<f64>() / TICKS)
}
