//! Whole runs: the real binary under the real `mpirun`, always with a timeout.

use serde_json::Value;
use std::cell::Cell;
use std::fs::File;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::sync::{Condvar, Mutex, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::{Duration, Instant};

/// Lock of the machine: jobs observed during their run have exclusive use; all others run simultaneously.
static MACHINE: RwLock<()> = RwLock::new(());

thread_local! {
    /// `true` if this thread has [`Alone`]: its jobs do not wait for others.
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Exclusive use of the machine for one test.
pub(crate) struct Alone {
    _cores: Cores,
    _machine: RwLockWriteGuard<'static, ()>,
}

impl Drop for Alone {
    fn drop(&mut self) {
        IS_ALONE.set(false);
    }
}

/// Waits until no other test runs a job.
pub(crate) fn alone() -> Alone {
    let machine = MACHINE.write().unwrap_or_else(PoisonError::into_inner);
    let cores = Cores::acquire(2);
    IS_ALONE.set(true);
    Alone {
        _cores: cores,
        _machine: machine,
    }
}

/// Waits until no job with exclusive use of the machine runs.
pub(crate) fn beside_others() -> RwLockReadGuard<'static, ()> {
    MACHINE.read().unwrap_or_else(PoisonError::into_inner)
}

/// Binary under test.
pub(crate) const SOLVER: &str = env!("CARGO_BIN_EXE_solver");

/// Time after which a job counts as hanging [s]: the longest takes half a minute on an idle machine.
/// `SOLVER_TEST_PATIENCE` multiplies it.
const LIMIT: f64 = 300.0;

/// Returns the factor of every time limit.
fn patience() -> f64 {
    let text = std::env::var("SOLVER_TEST_PATIENCE").ok();
    let number = text.and_then(|text| text.parse::<f64>().ok());
    number.unwrap_or(1.0).max(0.01)
}

/// Returns this limit on this machine [s].
fn limit(usual: f64) -> String {
    format!("{:.0}", usual * patience())
}

/// Returns the time after which an operation that takes `usual` seconds on an idle machine counts as hanging:
/// twenty times as long.
pub(crate) fn hang(usual: f64) -> Duration {
    Duration::from_secs_f64(20.0 * usual * patience())
}

/// Numbers of cores and jobs in use.
struct CoreUse {
    cores: usize,
    /// Number of jobs of several ranks that wait for the machine.
    waiting: usize,
}

static CORE_USE: (Mutex<CoreUse>, Condvar) = (
    Mutex::new(CoreUse {
        cores: 0,
        waiting: 0,
    }),
    Condvar::new(),
);

/// Cores reserved by a job or a long calculation of a test: one, or the whole machine for several ranks. Ranks
/// yield while they wait for a message: next to a computing process, a job of two ranks takes six times as long.
pub(crate) struct Cores(usize);

impl Cores {
    /// Waits for a core, or for the whole machine. One process more than there are cores may run, because starting
    /// and ending leave cores idle. On an idle machine a job of several ranks has priority; single processes run
    /// together with others.
    pub(crate) fn acquire(ranks: usize) -> Self {
        if IS_ALONE.get() {
            return Self(0);
        }
        let all = std::thread::available_parallelism().map_or(1, usize::from) + 1;
        let mut now = CORE_USE.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mine = if ranks > 1 {
            now.waiting += 1;
            let wait = |now: &mut CoreUse| now.cores > 0;
            now = (CORE_USE.1.wait_while(now, wait)).unwrap_or_else(PoisonError::into_inner);
            now.waiting -= 1;
            all
        } else {
            let wait = |now: &mut CoreUse| now.cores == all || (now.cores == 0 && now.waiting > 0);
            now = (CORE_USE.1.wait_while(now, wait)).unwrap_or_else(PoisonError::into_inner);
            1
        };
        now.cores += mine;
        Self(mine)
    }
}

impl Drop for Cores {
    fn drop(&mut self) {
        CORE_USE
            .0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .cores -= self.0;
        CORE_USE.1.notify_all();
    }
}

/// Environment of every job: the variables of `jobs/install.sh`, and those that shorten starts and ends on one
/// machine.
pub(crate) const ENVIRONMENT: [(&str, &str); 8] = [
    ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
    ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
    ("OMPI_MCA_btl_vader_single_copy_mechanism", "none"),
    // A Munge socket without a server delays every start by two seconds.
    ("PMIX_MCA_psec", "native"),
    // Ranks share memory; the search for cluster hardware would take most of a start.
    ("OMPI_MCA_pml", "ob1"),
    ("OMPI_MCA_btl", "self,vader"),
    // mpirun binds the first rank of every job to the first core, which simultaneous jobs would share.
    ("OMPI_MCA_hwloc_base_binding_policy", "none"),
    // There are more ranks than cores: a waiting rank yields its core.
    ("OMPI_MCA_mpi_yield_when_idle", "1"),
];

/// Disables the daemon of Open MPI for a process without mpirun, because its start dominates. Such processes share
/// one session folder, and the first that ends would remove it while another is about to use it: here each has its
/// own in `folder`.
pub(crate) fn without_daemon(command: &mut Command, folder: &Path) {
    command.env("OMPI_MCA_ess_singleton_isolated", "1");
    command.env("OMPI_MCA_orte_tmpdir_base", folder);
}

/// Returns the program on `ranks` ranks, with [`ENVIRONMENT`]; 0 is without mpirun.
fn command(ranks: usize) -> Command {
    let mut command = launcher(ranks, LIMIT);
    command.arg(SOLVER);
    // mpirun waits twice this long at every unsuccessful end.
    command.env("OMPI_MCA_odls_base_sigkill_timeout", "1");
    command
}

/// Script that waits until no process locks the file of the first argument (empty for none), then runs the program
/// directly on the first rank. The others delay their end after an error, so that the first rank has reported it and
/// ended before mpirun kills the others.
const FIRST_RANK_ENDS_FIRST: &str = r#"
[ -z "$1" ] || { exec 9<"$1" && flock --shared 9 && exec 9<&-; } || exit
shift
[ "${OMPI_COMM_WORLD_RANK:-0}" -ne 0 ] || exec "$0" "$@"
"$0" "$@" || { code=$?; sleep 5 <&- >/dev/null 2>&1; exit "$code"; }"#;

/// Returns a [`command`] for jobs without signals: mpirun need not wait after an error. Several ranks wait until `gate`
/// is not locked.
fn prompt_command(ranks: usize, gate: &Path) -> Command {
    // Ranks that wait for the machine wait for a few other jobs at most.
    let waiting = if ranks > 1 { 4.0 } else { 1.0 };
    let mut command = launcher(ranks, waiting * LIMIT);
    if ranks > 1 {
        command.args(["bash", "-c", FIRST_RANK_ENDS_FIRST, SOLVER]);
        command.arg(gate);
    } else {
        command.arg(SOLVER);
    }
    command.env("OMPI_MCA_odls_base_sigkill_timeout", "0");
    command
}

/// Returns the command that starts programs on `ranks` ranks, with a time limit [s].
fn launcher(ranks: usize, usual: f64) -> Command {
    let mut command = Command::new("timeout");
    command.args(["--kill-after=5", &limit(usual)]);
    if ranks > 0 {
        command.args(["mpirun", "--oversubscribe", "-n"]);
        command.arg(ranks.to_string());
    }
    command.envs(ENVIRONMENT);
    // Variables of a job within which the tests may run.
    for name in [
        "OMPI_COMM_WORLD_RANK",
        "OMPI_COMM_WORLD_SIZE",
        "PMIX_RANK",
        "PMI_RANK",
        "SLURM_PROCID",
        "RUST_BACKTRACE",
        "RUST_LOG",
    ] {
        command.env_remove(name);
    }
    command
}

/// Result of a job.
#[derive(Debug)]
pub(crate) struct Done {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    pub(crate) elapsed: Duration,
}

impl Done {
    /// Fails unless the job ended as expected.
    #[track_caller]
    pub(crate) fn expect(self, code: i32) -> Self {
        assert_eq!(
            self.code,
            Some(code),
            "after {:?}\n{}\n{}",
            self.elapsed,
            self.stdout,
            self.stderr
        );
        self
    }
}

/// Running job.
pub(crate) struct Running {
    child: Child,
    start: Instant,
    logs: tempfile::TempDir,
}

/// Starts the program; the caller must hold [`alone`] or [`beside_others`]. The output goes to files, so that no
/// pipe kept open by a rank can delay the end.
pub(crate) fn start(ranks: usize, arguments: &[String]) -> Running {
    begin(command(ranks), ranks, arguments)
}

/// Starts a job like [`start`], but mpirun kills the other ranks immediately when one has ended with an error.
pub(crate) fn start_impatient(ranks: usize, arguments: &[String]) -> Running {
    let mut command = command(ranks);
    command.env("OMPI_MCA_odls_base_sigkill_timeout", "0");
    begin(command, ranks, arguments)
}

/// Starts a job like [`start`] without signals: mpirun need not wait after an error.
pub(crate) fn start_prompt(ranks: usize, arguments: &[String]) -> Running {
    begin(prompt_command(ranks, Path::new("")), ranks, arguments)
}

fn begin(mut command: Command, ranks: usize, arguments: &[String]) -> Running {
    let logs = tempfile::tempdir().unwrap();
    if ranks == 0 {
        without_daemon(&mut command, logs.path());
    }
    let file = |name: &str| File::create(logs.path().join(name)).unwrap();
    command.args(arguments);
    command.stdout(file("stdout")).stderr(file("stderr"));
    let child = command.spawn().expect("`timeout` (coreutils) starts");
    Running {
        child,
        start: Instant::now(),
        logs,
    }
}

/// Returns the number of ranks that mpirun starts: none for one.
fn launched(ranks: usize) -> usize {
    if ranks == 1 { 0 } else { ranks }
}

/// Runs the program to its end. mpirun starts several ranks while other jobs run, because that takes time and little
/// work; they wait until the machine is theirs.
pub(crate) fn run(ranks: usize, arguments: &[String]) -> Done {
    if ranks < 2 {
        let _cores = Cores::acquire(ranks);
        return start_prompt(ranks, arguments).wait();
    }
    let gate = tempfile::NamedTempFile::new().unwrap();
    gate.as_file().lock().unwrap();
    let mut job = begin(prompt_command(ranks, gate.path()), ranks, arguments);
    let _cores = Cores::acquire(ranks);
    job.start = Instant::now();
    gate.as_file().unlock().unwrap();
    job.wait()
}

/// Runs a job like [`run`], with more variables of the environment.
pub(crate) fn run_with(ranks: usize, arguments: &[String], more: &[(&str, &str)]) -> Done {
    let _cores = Cores::acquire(ranks);
    let mut command = prompt_command(ranks, Path::new(""));
    command.envs(more.iter().copied());
    begin(command, ranks, arguments).wait()
}

impl Running {
    /// Waits for the end.
    pub(crate) fn wait(mut self) -> Done {
        let status = self.child.wait().unwrap();
        self.done(status)
    }

    fn done(&self, status: ExitStatus) -> Done {
        let read = |name: &str| {
            let bytes = std::fs::read(self.logs.path().join(name)).unwrap();
            String::from_utf8_lossy(&bytes).into_owned()
        };
        Done {
            code: status.code().or(status.signal().map(|signal| -signal)),
            stdout: read("stdout"),
            stderr: read("stderr"),
            elapsed: self.start.elapsed(),
        }
    }

    /// Polls until `found` returns a result; fails if the job ends before.
    #[track_caller]
    pub(crate) fn until<T>(&mut self, what: &str, mut found: impl FnMut() -> Option<T>) -> T {
        loop {
            if let Some(found) = found() {
                return found;
            }
            if let Some(status) = self.child.try_wait().unwrap() {
                let done = self.done(status);
                panic!("ended before {what}: {done:#?}");
            }
            // An observer that only yields would occupy a core.
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Returns the process of mpirun.
    #[track_caller]
    pub(crate) fn mpirun(&mut self) -> i32 {
        let timer = self.child.id();
        self.until("mpirun starts", || {
            children(timer)
                .into_iter()
                .find(|(_, name)| name == "mpirun")
        })
        .0
    }

    /// Returns the processes of the ranks, or the single process without mpirun.
    #[track_caller]
    pub(crate) fn ranks(&mut self, ranks: usize) -> Vec<i32> {
        let parent = if ranks == 0 {
            self.child.id()
        } else {
            u32::try_from(self.mpirun()).unwrap()
        };
        self.until("the ranks start", || {
            let solvers: Vec<i32> = children(parent)
                .into_iter()
                .filter(|(_, name)| name == "solver")
                .map(|(id, _)| id)
                .collect();
            (solvers.len() == ranks.max(1)).then_some(solvers)
        })
    }
}

/// Sends a signal.
pub(crate) fn signal(process: i32, signal: &str) {
    let sent = Command::new("kill")
        .args([&format!("-{signal}"), &process.to_string()])
        .status()
        .unwrap();
    assert!(sent.success(), "kill -{signal} {process}");
}

/// Returns the children of a process with their names.
fn children(parent: u32) -> Vec<(i32, String)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir("/proc").unwrap().flatten() {
        let Some(id) = entry.file_name().to_str().and_then(|n| n.parse().ok()) else {
            continue;
        };
        // A process may have ended by now.
        let Ok(stat) = std::fs::read_to_string(entry.path().join("stat")) else {
            continue;
        };
        if let Some((head, tail)) = stat.rsplit_once(')')
            && tail.split_whitespace().nth(1) == Some(&parent.to_string())
            && let Some((_, name)) = head.split_once('(')
        {
            all.push((id, name.to_owned()));
        }
    }
    all.sort_unstable();
    all
}

/// Case in its own folder, which also contains the folders of its runs.
pub(crate) struct Study {
    folder: tempfile::TempDir,
    case: PathBuf,
    set: Vec<String>,
    /// Additional arguments of every command.
    flags: Vec<String>,
}

impl Study {
    /// Returns an example with changes for all runs.
    pub(crate) fn from_example(example: &str, set: &[(&str, &str)]) -> Self {
        let mut study = Self::new(solver::case::examples::find(example).unwrap().text);
        let set = set.iter().map(|(path, value)| format!("{path}={value}"));
        study.set.extend(set);
        study
    }

    /// Returns the study of a case given as text.
    pub(crate) fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let case = folder.path().join("case.json");
        std::fs::write(&case, text).unwrap();
        Self {
            folder,
            case,
            set: Vec::new(),
            flags: Vec::new(),
        }
    }

    /// Returns the study of a small hole in a bonded packing that erodes at once: in 300 steps most bonds break and the
    /// first grains leave.
    pub(crate) fn eroding(more: &[(&str, &str)]) -> Self {
        let mut study = Self::from_example(
            "piping",
            &[
                ("domain.size", "[0.003, 0.0016]"),
                ("domain.spacing", "2e-5"),
                ("grains.initial", r#"{"file": {"path": "sample.csv"}}"#),
                ("grains.save", "null"),
                ("grains.cut", "[]"),
                (
                    "regions[0].box",
                    r#"{"from": [0.00254, 0], "to": [0.003, 0.0016]}"#,
                ),
                ("probes[0].at.plane.position", "0.0015"),
                ("probes[0].every", "0.0004"),
                (
                    "analysis.erosion_law.hole",
                    r#"{"from": [0.0004, 0.0006], "to": [0.0026, 0.001]}"#,
                ),
                ("analysis.erosion_law.every", "0.0004"),
                ("time.warm_up", "null"),
                ("time.end", "0.024"),
                ("output.fluid.every", "0.012"),
                ("output.grains.every", "0.012"),
                ("output.contacts.every", "0.012"),
                (
                    "fluid.lattice_boltzmann.boundaries[0].condition.pressure.value",
                    "1.5",
                ),
                (
                    "fluid.lattice_boltzmann.boundaries[0].condition.pressure.ramp.duration",
                    "0.002",
                ),
                ("contact.cohesive_frictional.cohesion.per_diameter", "0.03"),
                ("contact.cohesive_frictional.normal_damping_ratio", "0.2"),
                ("contact.cohesive_frictional.local_damping", "0"),
                ("time.solid_time_step_safety", "0.1"),
            ],
        );
        std::fs::write(study.folder.path().join("sample.csv"), sample()).unwrap();
        study
            .set
            .extend(more.iter().map(|(path, value)| format!("{path}={value}")));
        study
    }

    /// Returns a study of the hole in a packing that is grown, bonded and relaxed first; then the water is warmed
    /// up.
    pub(crate) fn preparing() -> Self {
        let chambers = r#"[
            {"name": "inlet", "box": {"from": [0, 0], "to": [0.0004, 0.0016]}},
            {"name": "outlet", "box": {"from": [0.0026, 0], "to": [0.003, 0.0016]}},
            {"name": "hole", "box": {"from": [0.0004, 0.0006], "to": [0.0026, 0.001]}}]"#;
        Self::eroding(&[
            (
                "grains.initial",
                r#"{"growth": {"amount": {"solid_fraction": 0.82}, "radii": {"uniform": {"min": 5.5e-5, "max": 7e-5}},
                    "seed": 3, "friction_angle_degrees": 20}}"#,
            ),
            ("grains.cut", chambers),
            (
                "time.warm_up",
                r#"{"fluid_only": {"relative_change": 1e-14, "at_most": 0.5}}"#,
            ),
            ("time.end", "0.0016"),
            ("output", "{}"),
        ])
    }

    /// Returns the path of a folder or file next to the case.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Returns the arguments of a run into the folder `name`, with more changes.
    pub(crate) fn arguments(&self, name: &str, threads: usize, set: &[&str]) -> Vec<String> {
        let mut arguments = vec![
            self.case.to_str().unwrap().to_owned(),
            "--output".into(),
            self.path(name).to_str().unwrap().into(),
            "--threads".into(),
            threads.to_string(),
        ];
        let own = self.set.iter().map(String::as_str);
        for assignment in own.chain(set.iter().copied()) {
            arguments.push("--set".into());
            arguments.push(assignment.into());
        }
        arguments.extend(self.flags.iter().cloned());
        arguments
    }

    /// Returns the study with permission for the verdict `unstable`.
    pub(crate) fn unstable(mut self) -> Self {
        self.flags.push("--allow-unstable".into());
        self
    }

    /// Runs to the end of the case; a single rank without mpirun, whose start would take most of a short run.
    #[track_caller]
    pub(crate) fn run(&self, name: &str, ranks: usize, threads: usize, set: &[&str]) -> Done {
        run(launched(ranks), &self.arguments(name, threads, set)).expect(0)
    }

    /// Continues the run in the folder `name`; a single rank without mpirun.
    pub(crate) fn restart(&self, name: &str, ranks: usize, set: &[&str]) -> Done {
        run(launched(ranks), &self.restart_arguments(name, set))
    }

    pub(crate) fn restart_arguments(&self, name: &str, set: &[&str]) -> Vec<String> {
        let mut arguments = vec![
            "restart".to_owned(),
            self.path(name).to_str().unwrap().into(),
            "--threads".into(),
            "1".into(),
        ];
        for assignment in set {
            arguments.push("--set".into());
            arguments.push((*assignment).into());
        }
        arguments.extend(self.flags.iter().cloned());
        arguments
    }

    /// Returns the summary of a run.
    #[track_caller]
    pub(crate) fn summary(&self, name: &str) -> Value {
        let path = self.path(name).join("summary.json");
        let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        serde_json::from_slice(&bytes).unwrap()
    }

    /// Returns the hash of the state at the end of a run.
    #[track_caller]
    pub(crate) fn hash(&self, name: &str) -> String {
        let summary = self.summary(name);
        assert_eq!(summary["outcome"], "done", "{name}: {summary:#}");
        summary["state_hash"].as_str().unwrap().to_owned()
    }

    /// Returns the number of lines of a table without its header.
    pub(crate) fn rows(&self, name: &str, table: &str) -> usize {
        let text = std::fs::read_to_string(self.path(name).join(table)).unwrap();
        text.lines().count() - 1
    }

    /// Runs the case on each layout (name, ranks, threads, one setting or none) and fails unless each run is the same
    /// as `straight`.
    #[track_caller]
    pub(crate) fn same_on(&self, layouts: &[(&str, usize, usize, &str)]) {
        for (name, ranks, threads, set) in layouts {
            let set = [*set];
            let settings = if set[0].is_empty() { &[][..] } else { &set[..] };
            self.run(name, *ranks, *threads, settings);
            self.same("straight", name);
        }
    }

    /// Fails unless two runs ended in the same state and wrote the same data: tables and series byte for byte,
    /// fields by their numbers (their headers contain the ranks).
    #[track_caller]
    pub(crate) fn same(&self, a: &str, b: &str) {
        assert_eq!(self.hash(a), self.hash(b), "{a} and {b}");
        let (left, right) = (self.path(a), self.path(b));
        let names = |folder: &Path| -> Vec<String> {
            let mut names: Vec<String> = std::fs::read_dir(folder)
                .unwrap()
                .map(|entry| entry.unwrap().file_name().into_string().unwrap())
                .filter(|name| {
                    name != "checkpoints" && name != "case.json" && name != "summary.json"
                })
                .collect();
            names.sort();
            names
        };
        let all = names(&left);
        assert_eq!(all, names(&right), "{a} and {b}");
        for name in all {
            let (one, other) = (left.join(&name), right.join(&name));
            if name.ends_with(".vtkhdf") {
                assert!(numbers(&one) == numbers(&other), "{a} and {b}: {name}");
            } else {
                let text = |path: &Path| String::from_utf8(std::fs::read(path).unwrap()).unwrap();
                let (one, other) = (text(&one), text(&other));
                let first = one
                    .lines()
                    .zip(other.lines())
                    .find(|(one, other)| one != other);
                assert_eq!(first, None, "{a} and {b}: {name}");
                assert_eq!(one.len(), other.len(), "{a} and {b}: {name}");
            }
        }
    }
}

/// Returns the names, shapes and bits of all datasets of a file.
fn numbers(path: &Path) -> Vec<(String, Vec<usize>, Vec<u64>)> {
    let mut all: Vec<_> = io::fields::inspect(path)
        .unwrap()
        .datasets
        .into_iter()
        // Texts are excluded: a long case is a dataset, a short one an attribute, and cases may differ in their
        // checkpoints and slabs.
        .filter(|d| !d.path.trim_start_matches('/').starts_with("provenance/"))
        .map(|d| {
            let start = vec![0; d.shape.len()];
            let values = io::fields::read_f64(path, &d.path, &start, &d.shape).unwrap();
            let bits = values.iter().map(|x| x.to_bits()).collect();
            (d.path, d.shape, bits)
        })
        .collect();
    all.sort();
    all
}

/// Returns rows of touching discs above and below a hole, one in eleven of which is slightly smaller.
fn sample() -> String {
    const RADIUS: f64 = 1e-4;
    let step = 2.0 * RADIUS * (1.0 - 1e-7);
    let mut text = String::from("x,y,radius\n");
    let (mut y, mut row, mut n) = (0.5 * step, 0, 0);
    while y < 1.52e-3 {
        let mut x = 5e-4 + if row % 2 == 1 { 0.5 * step } else { 0.0 };
        while x < 2.45e-3 {
            if !(0.62e-3..0.98e-3).contains(&y) {
                let radius = if n % 11 == 3 { 0.97 * RADIUS } else { RADIUS };
                text += &format!("{x},{y},{radius}\n");
                n += 1;
            }
            x += step;
        }
        y += step * 0.75_f64.sqrt();
        row += 1;
    }
    text
}
