//! The folder of a run. Only one run at a time uses it, and a new run never mixes its files with those of an
//! earlier run.
//!
//! A run holds the file `run.lock` in its folder: a lock of the operating system, which ends with the process, and
//! which states host, process and start time of the holder. On a file system whose locks do not reach other hosts, a
//! lock of another host is valid while its file was touched within [`STALE_AFTER`]; a run touches it every
//! [`BEAT_EVERY`]. A job that its batch system has requeued takes over from its earlier attempt at once.
//!
//! A new run refuses a folder that holds another run, unless it is allowed to replace it. All files of the earlier run
//! are then deleted before the first file of the new one is written, checkpoints first, so that a restart never finds a
//! state that belongs to other files.

use super::agreement;
use super::progress::clock;
use base::error::Error;
use decomposition::Communicator;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Name of the lock file in the folder.
pub const LOCK: &str = "run.lock";
/// Folder of the checkpoints within the folder of the run.
pub const CHECKPOINTS: &str = "checkpoints";
/// Folder of an unfinished preparation within the folder of the run.
pub const PREPARATION: &str = "preparation";
/// Interval at which a run touches its lock.
const BEAT_EVERY: Duration = Duration::from_secs(20);
/// Age of an untouched lock of another host above which its job is considered dead.
const STALE_AFTER: Duration = Duration::from_secs(600);
/// Maximum size of a lock file \[bytes\].
const LOCK_BYTES: u64 = 4096;

/// Tables and pictures that runs write in addition to series and probes.
const FILES: [&str; 15] = [
    "backward_erosion.csv",
    "crossings.csv",
    "case.json",
    "summary.json",
    "erosion.csv",
    "removed.csv",
    "bonds.csv",
    "collapse.csv",
    "collapse_points.csv",
    "surface.csv",
    "clusters.csv",
    "collapse.svg",
    "settlement.svg",
    "averages_profile.csv",
    "run.lock",
];
/// Series that runs write: `NAME.xmf` and `NAME_000000100.vtkhdf`.
const SERIES: [&str; 5] = ["fluid", "grains", "contacts", "blocks", "averages"];

/// Returns `true` if a run writes a file of this name into its folder.
#[must_use]
pub fn is_of_a_run(name: &str) -> bool {
    let whole = name.strip_suffix(".part").unwrap_or(name);
    FILES.contains(&whole)
        || whole.starts_with("probe_") && whole.ends_with(".csv")
        || SERIES.iter().any(|series| {
            whole.strip_prefix(series).is_some_and(|rest| {
                rest == ".xmf" || rest.starts_with('_') && rest.ends_with(".vtkhdf")
            })
        })
}

/// Way in which a run enters its folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Entry {
    /// New run.
    Fresh {
        /// `true` if the run replaces an earlier run in the folder.
        overwrite: bool,
        /// File from which the case was read.
        case: Option<PathBuf>,
    },
    /// Continuation of the run in the folder.
    Resume,
}

/// Process that holds the lock of a folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct LockHolder {
    host: String,
    process: u32,
    /// Start time \[s\], as seconds since 1970.
    started: u64,
    /// Batch job and attempt number.
    #[serde(default)]
    job: Option<[String; 2]>,
}

impl LockHolder {
    fn this_process() -> Self {
        Self {
            host: fs::read_to_string("/proc/sys/kernel/hostname")
                .map_or_else(|_| "unknown".to_owned(), |name| name.trim().to_owned()),
            process: std::process::id(),
            started: SystemTime::now()
                .duration_since(SystemTime::UNIX_EPOCH)
                .map_or(0, |since| since.as_secs()),
            job: job(),
        }
    }

    fn describe(&self) -> String {
        let since = SystemTime::now()
            .duration_since(SystemTime::UNIX_EPOCH)
            .map_or(0, |now| now.as_secs().saturating_sub(self.started));
        let job = self
            .job
            .as_ref()
            .map_or(String::new(), |[job, _]| format!(" (job {job})"));
        format!(
            "process {} on {}{job} has been running in it for {} (h:min:s)",
            self.process,
            self.host,
            clock(Duration::from_secs(since).as_secs_f64())
        )
    }

    /// Returns `true` if this process is an earlier attempt of the same batch job: batch systems end one attempt before
    /// they start the next.
    fn was_requeued_as(&self, me: &Self) -> bool {
        match (&self.job, &me.job) {
            (Some([mine, attempt]), Some([theirs, next])) => mine == theirs && attempt != next,
            _ => false,
        }
    }
}

/// Returns the batch job of this process and the number of the attempt.
fn job() -> Option<[String; 2]> {
    let of = |name: &str| std::env::var(name).ok().filter(|text| !text.is_empty());
    let attempt = || {
        ["SLURM_RESTART_COUNT", "PBS_RUNCOUNT"]
            .iter()
            .find_map(|name| of(name))
            .unwrap_or_default()
    };
    ["SLURM_JOB_ID", "PBS_JOBID", "LSB_JOBID"]
        .iter()
        .find_map(|name| of(name))
        .map(|job| [job, attempt()])
}

/// Folder in use by this run. Dropping it removes the lock.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    /// Open lock file; on the first rank.
    lock: Option<File>,
    last_touch: Instant,
}

impl RunFolder {
    /// Locks the folder for this run, creates it if it is missing, and deletes an earlier run if requested.
    /// Collective; the first rank acts.
    ///
    /// # Errors
    /// If another run uses the folder or is in it ([`Error::Usage`]), or if the file system refuses an operation
    /// ([`Error::Io`]); the error is the same on all ranks.
    pub fn enter(path: &Path, entry: &Entry, communicator: &Communicator) -> Result<Self, Error> {
        let lock = agreement::on_first(communicator, || {
            if let Entry::Fresh {
                case: Some(case), ..
            } = entry
            {
                keep_case(path, case)?;
            }
            fs::create_dir_all(path.join(CHECKPOINTS)).map_err(|e| failed(path, &e))?;
            let lock = lock_file(&path.join(LOCK))?;
            if let Entry::Fresh { overwrite, .. } = entry
                && let Some(found) = Found::in_folder(path)?
            {
                if !overwrite {
                    // A refused folder keeps its contents: the lock file of this process is removed.
                    drop(Release(path.join(LOCK), &lock));
                    if !found.can_continue {
                        return Err(Error::Usage(format!(
                            "{} contains files of a run that ended before its first step ({}); replace it with \
                             --overwrite, or choose another --output",
                            path.display(),
                            found.describe()
                        )));
                    }
                    return Err(Error::Usage(format!(
                        "{} holds another run ({}); continue it with `solver restart {0}`, choose another --output, \
                         or replace it with --overwrite",
                        path.display(),
                        found.describe()
                    )));
                }
                found.remove(path)?;
            }
            Ok(Some(lock))
        })?;
        Ok(Self {
            path: path.to_owned(),
            lock,
            last_touch: Instant::now(),
        })
    }

    /// Returns the path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the path of the checkpoints.
    #[must_use]
    pub fn checkpoints(&self) -> PathBuf {
        self.path.join(CHECKPOINTS)
    }

    /// Returns the path of an unfinished sample.
    #[must_use]
    pub fn preparation(&self) -> PathBuf {
        self.path.join(PREPARATION)
    }

    /// Removes an unfinished sample once a checkpoint of the run replaces it. First rank.
    pub fn forget_preparation(&self) {
        if self.lock.is_some() {
            // A remaining file is older than the checkpoint, which a restart prefers.
            let _ = fs::remove_dir_all(self.preparation());
        }
    }

    /// Touches the lock at intervals of [`BEAT_EVERY`], so that other hosts see that this run is alive.
    pub fn touch_lock(&mut self) {
        if let Some(lock) = &self.lock
            && self.last_touch.elapsed() >= BEAT_EVERY
        {
            self.last_touch = Instant::now();
            // A deleted folder is detected at the next write.
            let _ = lock.set_modified(SystemTime::now());
        }
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        if let Some(lock) = &self.lock {
            drop(Release(self.path.join(LOCK), lock));
        }
    }
}

/// Removes the file of a held lock when dropped.
struct Release<'a>(PathBuf, &'a File);

impl Drop for Release<'_> {
    fn drop(&mut self) {
        if is_at(self.1, &self.0) {
            // A file that cannot be removed becomes stale when this process ends.
            let _ = fs::remove_file(&self.0);
        }
    }
}

fn failed(path: &Path, error: &std::io::Error) -> Error {
    Error::Io(format!("{}: {error}", path.display()))
}

/// Returns `true` if an open file is still the file at this path.
fn is_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::metadata(path)) {
        (Ok(open), Ok(named)) => open.dev() == named.dev() && open.ino() == named.ino(),
        _ => false,
    }
}

/// Refuses to replace the case file by output of the run.
fn keep_case(folder: &Path, case: &Path) -> Result<(), Error> {
    let (Ok(folder), Ok(file)) = (fs::canonicalize(folder), fs::canonicalize(case)) else {
        // A missing folder contains nothing.
        return Ok(());
    };
    let name = file.file_name().and_then(|name| name.to_str());
    if file.parent() == Some(&folder) && name.is_some_and(is_of_a_run) {
        return Err(Error::Usage(format!(
            "the run would overwrite its own case, because it writes a file named {} into {}; choose another \
             --output, or rename the case",
            case.display(),
            folder.display()
        )));
    }
    Ok(())
}

/// Locks the file of this name, or returns an error that names the process that holds it.
fn lock_file(path: &Path) -> Result<File, Error> {
    // If the holder ends between opening and locking, the file has been unlinked: try again.
    for _ in 0..100 {
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .custom_flags(io::atomic::NO_LINKS)
            .open(path)
            .map_err(|e| {
                if path.is_symlink() {
                    Error::Io(format!("{}: this is a link; remove it", path.display()))
                } else {
                    failed(path, &e)
                }
            })?;
        let locks = match file.try_lock() {
            Ok(()) => true,
            Err(TryLockError::WouldBlock) => {
                return Err(in_use(path, read(&mut file).as_ref()));
            }
            // The file system has no locks.
            Err(TryLockError::Error(_)) => false,
        };
        if !is_at(&file, path) {
            continue;
        }
        let me = LockHolder::this_process();
        if let Some(holder) = read(&mut file)
            && may_still_run(&holder, &me, locks, &file)
        {
            return Err(in_use(path, Some(&holder)));
        }
        let text = serde_json::to_string(&me).map_err(|e| Error::Internal(e.to_string()))?;
        file.set_len(0)
            .and_then(|()| file.seek(SeekFrom::Start(0)))
            .and_then(|_| file.write_all(text.as_bytes()))
            .map_err(|e| failed(path, &e))?;
        return Ok(file);
    }
    Err(in_use(path, None))
}

fn read(file: &mut File) -> Option<LockHolder> {
    let mut text = String::new();
    file.seek(SeekFrom::Start(0)).ok()?;
    file.take(LOCK_BYTES).read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

/// Returns `true` if the process named in a lock may still run although its lock could be taken.
fn may_still_run(holder: &LockHolder, me: &LockHolder, locks: bool, file: &File) -> bool {
    if holder.host == me.host {
        // The lock of the system decides; on a file system without locks, the process.
        return !locks
            && holder.process != me.process
            && Path::new("/proc").join(holder.process.to_string()).exists();
    }
    let touched = file
        .metadata()
        .and_then(|data| data.modified())
        .ok()
        .and_then(|time| time.elapsed().ok());
    !holder.was_requeued_as(me) && touched.is_none_or(|since| since < STALE_AFTER)
}

fn in_use(path: &Path, holder: Option<&LockHolder>) -> Error {
    let folder = path.parent().unwrap_or(path).display();
    let who = holder.map_or_else(
        || "another process is running in it".to_owned(),
        LockHolder::describe,
    );
    Error::Usage(format!(
        "{folder} is in use: {who}; wait for its end, stop it (`touch {folder}/STOP`), or choose another --output; if \
         that process certainly no longer exists, remove {}",
        path.display()
    ))
}

/// Files of an earlier run in a folder.
struct Found {
    /// Files except checkpoints and the lock.
    files: Vec<PathBuf>,
    checkpoints: usize,
    outcome: Option<String>,
    /// `true` if the folder contains a case with which the run can be continued.
    can_continue: bool,
}

/// Refuses a folder that holds a run, for results of another kind. A case alone is no run.
///
/// # Errors
/// If the folder holds files of a run besides a case, [`Error::Usage`]; if it cannot be read, [`Error::Io`].
pub fn refuse_run(folder: &Path) -> Result<(), Error> {
    if !folder.is_dir() {
        return Ok(());
    }
    let found = Found::in_folder(folder)?;
    let of_a_run = |found: &Found| {
        found.checkpoints > 0 || found.files.iter().any(|file| !file.ends_with("case.json"))
    };
    match found.filter(of_a_run) {
        None => Ok(()),
        Some(found) => Err(Error::Usage(format!(
            "{} holds a run ({}), among whose files the members of a study cannot lie; choose another --output",
            folder.display(),
            found.describe()
        ))),
    }
}

impl Found {
    /// Lists the files of an earlier run; none if there is only the lock.
    fn in_folder(folder: &Path) -> Result<Option<Self>, Error> {
        let mut files = Vec::new();
        for entry in fs::read_dir(folder).map_err(|e| failed(folder, &e))? {
            let entry = entry.map_err(|e| failed(folder, &e))?;
            let name = entry.file_name();
            let ours = name
                .to_str()
                .is_some_and(|name| is_of_a_run(name) && name != LOCK);
            if ours {
                files.push(entry.path());
            }
        }
        let saved = |name: &str| -> usize {
            fs::read_dir(folder.join(name)).map_or(0, |entries| {
                entries
                    .flatten()
                    .filter(|entry| entry.path().extension().is_some_and(|e| e == "json"))
                    .count()
            })
        };
        let checkpoints = saved(CHECKPOINTS) + saved(PREPARATION);
        if files.is_empty() && checkpoints == 0 {
            return Ok(None);
        }
        let json = |name: &str| -> Option<Value> {
            let text = io::plain::text(&folder.join(name), io::plain::LONGEST_CASE).ok()?;
            serde_json::from_str(&text).ok()
        };
        let outcome = json("summary.json")
            .and_then(|summary| Some(summary.get("outcome")?.as_str()?.to_owned()));
        // Samples that the case saved are files of the run too.
        if let Some(case) = json("case.json") {
            for part in ["grains", "blocks"] {
                let name = case[part]["save"].as_str().map(Path::new);
                let plain = name.filter(|name| name.components().count() == 1);
                files.extend(plain.map(|name| folder.join(name)).filter(|p| p.is_file()));
            }
        }
        let can_continue = folder.join("case.json").is_file() || checkpoints > 0;
        Ok(Some(Self {
            files,
            checkpoints,
            outcome,
            can_continue,
        }))
    }

    fn describe(&self) -> String {
        let outcome = self.outcome.as_deref().unwrap_or("not ended");
        format!(
            "{outcome}, {} checkpoint{}, {} other file{}",
            self.checkpoints,
            if self.checkpoints == 1 { "" } else { "s" },
            self.files.len(),
            if self.files.len() == 1 { "" } else { "s" }
        )
    }

    /// Removes all files, checkpoints first.
    fn remove(&self, folder: &Path) -> Result<(), Error> {
        for name in [CHECKPOINTS, PREPARATION] {
            let inner = folder.join(name);
            match fs::remove_dir_all(&inner) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                    return Err(failed(&inner, &e));
                }
                _ => {}
            }
        }
        for file in &self.files {
            match fs::remove_file(file) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(failed(file, &e)),
                _ => {}
            }
        }
        let inner = folder.join(CHECKPOINTS);
        fs::create_dir_all(&inner).map_err(|e| failed(&inner, &e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fresh(overwrite: bool) -> Entry {
        Entry::Fresh {
            overwrite,
            case: None,
        }
    }

    fn enter(path: &Path, entry: &Entry) -> Result<RunFolder, Error> {
        RunFolder::enter(path, entry, &Communicator::serial())
    }

    #[test]
    fn names_of_a_run_are_known_and_others_are_not() {
        for name in [
            "case.json",
            "probe_flux.csv",
            "fluid.xmf",
            "grains_000000100.vtkhdf",
            "fluid_000000100.vtkhdf.part",
        ] {
            assert!(is_of_a_run(name), "{name}");
        }
        for name in ["STOP", "my.json", "log.txt", "fluid.png", "sample.csv"] {
            assert!(!is_of_a_run(name), "{name}");
        }
    }

    #[test]
    fn one_run_at_a_time_uses_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let held = enter(folder.path(), &fresh(false)).unwrap();
        for entry in [fresh(true), Entry::Resume] {
            let error = enter(folder.path(), &entry).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            let text = error.to_string();
            assert!(
                text.contains("in use") && text.contains(&std::process::id().to_string()),
                "{text}"
            );
        }
        drop(held);
        assert!(!folder.path().join(LOCK).exists());
        enter(folder.path(), &Entry::Resume).unwrap();
    }

    #[test]
    fn a_lock_of_a_process_that_is_gone_is_taken_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOCK);
        let me = LockHolder::this_process();
        let holder = |host: &str, job: Option<[&str; 2]>| LockHolder {
            host: host.into(),
            process: 4_000_000,
            started: me.started,
            job: job.map(|job| job.map(str::to_owned)),
        };
        let write = |holder: &LockHolder| {
            fs::write(&path, serde_json::to_string(holder).unwrap()).unwrap();
        };
        write(&holder(&me.host, None));
        drop(enter(folder.path(), &Entry::Resume).unwrap());
        // A run on another host that touched its lock recently must be assumed alive.
        write(&holder("elsewhere", None));
        assert!(enter(folder.path(), &Entry::Resume).is_err());
        let long_ago = SystemTime::now() - 2 * STALE_AFTER;
        let file = OpenOptions::new().write(true).open(&path).unwrap();
        file.set_modified(long_ago).unwrap();
        drop(enter(folder.path(), &Entry::Resume).unwrap());
        // A damaged lock file does not block entry.
        fs::write(&path, "{").unwrap();
        drop(enter(folder.path(), &Entry::Resume).unwrap());
        let first = holder("elsewhere", Some(["7", ""]));
        assert!(first.was_requeued_as(&holder("here", Some(["7", "1"]))));
        assert!(!first.was_requeued_as(&holder("here", Some(["7", ""]))));
        assert!(!first.was_requeued_as(&holder("here", None)));
    }

    #[test]
    fn another_run_is_refused_or_removed_whole() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at(CHECKPOINTS)).unwrap();
        for name in [
            "checkpoints/checkpoint_000000100.json",
            "checkpoints/checkpoint_000000100.h5",
            "probe_a.csv",
            "erosion.csv",
            "mine.csv",
            "notes.txt",
        ] {
            fs::write(at(name), "x").unwrap();
        }
        fs::write(at("case.json"), r#"{"grains": {"save": "mine.csv"}}"#).unwrap();
        fs::write(at("summary.json"), r#"{"outcome": "done"}"#).unwrap();
        let error = enter(folder.path(), &fresh(false)).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        let text = error.to_string();
        assert!(
            text.contains("done, 1 checkpoint, 5 other files") && text.contains("--overwrite"),
            "{text}"
        );
        assert!(!at(LOCK).exists() && at("erosion.csv").exists());
        drop(enter(folder.path(), &fresh(true)).unwrap());
        let mut left: Vec<_> = fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        left.sort();
        assert_eq!(left, ["checkpoints", "notes.txt"]);
        assert_eq!(fs::read_dir(at(CHECKPOINTS)).unwrap().count(), 0);
        drop(enter(folder.path(), &fresh(false)).unwrap());
    }

    #[test]
    fn the_case_itself_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let case = folder.path().join("case.json");
        fs::write(&case, "{}").unwrap();
        let entry = Entry::Fresh {
            overwrite: true,
            case: Some(case.clone()),
        };
        let error = enter(folder.path(), &entry).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("its own case"), "{error}");
        assert_eq!(fs::read_to_string(&case).unwrap(), "{}");
    }
}
