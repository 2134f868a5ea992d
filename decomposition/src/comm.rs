//! Start of MPI, and the collective calls.
//!
//! All ranks must make every collective call in the same order. Sums are sums of integers: they do not depend on
//! the order of the ranks. Floats are only compared. The error handler of MPI remains "errors are fatal", because
//! Open MPI 4.1 otherwise delivers a truncated message without an error.

mod gather;

use crate::post::Post;
use crate::waiting::{Wait, called_together, sent, timed, until};
use mpi::Threading;
use mpi::environment::{self, Universe};
use mpi::ffi::{self, MPI_Comm, MPI_Datatype, MPI_Op, MPI_Request};
use mpi::traits::{AsRaw, Communicator as _};
use std::backtrace::{Backtrace, BacktraceStatus};
use std::ffi::{c_int, c_void};
use std::fmt::{self, Display};
use std::io::Write;
use std::ops::Range;
use std::panic;
use std::ptr;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Exit code of a job ended by a panic, equal to that of a panicking Rust program.
const PANIC_EXIT_CODE: c_int = 101;

/// Maximum length in bytes of a message passed to MPI in one piece; its counts have 32 bits.
const MESSAGE_LIMIT: usize = 1 << 30;

/// Number of values reduced in one call with a buffer on the stack.
const REDUCTION_CHUNK: usize = 512;

/// Tag of the messages of [`crate::exchange()`] and of gathering; halos and fixed exchanges use
/// tags whose remainder by 4 is 0, 1 or 2.
const TAG_SPARSE: c_int = 3;

/// MPI's own handle of a communicator, as used by the parallel HDF5 bindings.
pub type RawCommunicator = MPI_Comm;

/// Reason why MPI cannot be started.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StartError {
    /// MPI was already started in this process; it can be started only once.
    #[error("MPI was already started in this process; it can be started only once")]
    AlreadyStarted,
    /// MPI does not support worker threads in addition to the thread that calls it.
    #[error(
        "MPI granted thread level {granted}, but worker threads need at least Funneled: \
         use an MPI library built with thread support"
    )]
    Threads {
        /// Thread level that MPI granted.
        granted: String,
    },
}

/// Error that all ranks return when at least one of them failed: the message of the lowest failing rank.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("rank {rank}: {message}")]
pub struct Disagreement {
    /// Lowest rank that failed.
    pub rank: usize,
    /// Error as text.
    pub message: String,
}

/// Running MPI library: it is started once, in `main`, before any communication.
///
/// MPI is finalised when the `World` and every [`Communicator`] made from it are gone, so the order
/// in which they are dropped does not matter.
#[derive(Debug)]
pub struct World {
    communicator: Communicator,
}

impl World {
    /// Starts MPI for one calling thread among several (level Funneled), and installs a panic hook that prints the
    /// rank and ends the whole job with exit code 101.
    ///
    /// Without the hook the panicking rank would wait forever in `MPI_Finalize` for the others, and they for its
    /// messages. The hook acts on every panic, including one that would be caught.
    ///
    /// # Errors
    /// If MPI was started before or does not support threads, [`StartError`].
    pub fn start() -> Result<Self, StartError> {
        let (universe, granted) = environment::initialize_with_threading(Threading::Funneled)
            .ok_or(StartError::AlreadyStarted)?;
        if granted < Threading::Funneled {
            return Err(StartError::Threads {
                granted: format!("{granted:?}"),
            });
        }
        let world = universe.world();
        let rank = index(world.rank());
        let size = index(world.size());
        install_panic_hook(rank, size);
        let mut raw = world.as_raw();
        // SAFETY: MPI runs; `raw` is overwritten by a new communicator with the same ranks, whose messages cannot
        // be confused with those of a library that uses the world itself.
        unsafe { ffi::MPI_Comm_dup(world.as_raw(), &raw mut raw) };
        let mut exit_communicator = world.as_raw();
        // SAFETY: as above; only `all_arrive` uses it, so that it cannot interfere with a collective call of other
        // ranks.
        unsafe { ffi::MPI_Comm_dup(world.as_raw(), &raw mut exit_communicator) };
        let context = Context {
            raw,
            exit_communicator,
            rank,
            size,
            universe: Some(universe),
        };
        Ok(Self {
            communicator: Communicator {
                kind: Kind::Mpi(Rc::new(context)),
                message_limit: MESSAGE_LIMIT,
            },
        })
    }

    /// Returns a communicator of all ranks of the job.
    #[must_use]
    pub fn communicator(&self) -> Communicator {
        self.communicator.clone()
    }
}

/// Returns the name and version of the MPI library that this program is linked with, one line; MPI need not have been
/// started.
#[must_use]
pub fn mpi_library() -> String {
    let (major, minor) = environment::version();
    let library = environment::library_version().unwrap_or_default();
    let library = library
        .split(['\n', '\0'])
        .next()
        .unwrap_or_default()
        .trim();
    format!("MPI {major}.{minor}, {library}")
}

/// Ends the job when any thread of this rank panics.
fn install_panic_hook(rank: usize, size: usize) {
    let previous = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if environment::is_finalized() {
            return previous(info);
        }
        let mut text = format!("rank {rank} of {size}: {info}\n");
        let trace = Backtrace::capture();
        if trace.status() == BacktraceStatus::Captured {
            text = format!("{text}{trace}\n");
        }
        // The text is written in one call, so that the lines of several ranks do not mix; a failure is ignored.
        let mut stderr = std::io::stderr().lock();
        let _ = stderr.write_all(text.as_bytes());
        let _ = stderr.flush();
        // SAFETY: MPI runs; aborting needs no other agreement. In practice every library accepts
        // this call from a worker thread too, and there is no other way to end the job.
        unsafe { ffi::MPI_Abort(ffi::RSMPI_COMM_WORLD, PANIC_EXIT_CODE) };
        std::process::exit(PANIC_EXIT_CODE);
    }));
}

/// Duplicated world communicator and, dropped last, MPI itself.
struct Context {
    raw: MPI_Comm,
    exit_communicator: MPI_Comm,
    rank: usize,
    size: usize,
    universe: Option<Universe>,
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: `raw` was made by MPI_Comm_dup, is freed once, and MPI still runs.
        unsafe { ffi::MPI_Comm_free(&raw mut self.raw) };
        // SAFETY: likewise.
        unsafe { ffi::MPI_Comm_free(&raw mut self.exit_communicator) };
        // Finalises MPI.
        self.universe = None;
    }
}

#[derive(Clone)]
enum Kind {
    Serial,
    Threads(Rc<Post>),
    Mpi(Rc<Context>),
}

/// Group of ranks: all ranks of an MPI job, this process alone without MPI, or threads of this process
/// ([`crate::on_threads`]). Cloning is cheap.
#[derive(Clone)]
pub struct Communicator {
    kind: Kind,
    message_limit: usize,
}

impl fmt::Debug for Communicator {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            Kind::Serial => "serial",
            Kind::Threads(_) => "threads",
            Kind::Mpi(_) => "MPI",
        };
        write!(
            formatter,
            "Communicator({kind}, rank {} of {})",
            self.rank(),
            self.size()
        )
    }
}

/// Operation of a reduction.
#[derive(Clone, Copy)]
enum Reduction {
    Min,
    Max,
    Sum,
}

impl Reduction {
    fn raw(self) -> MPI_Op {
        // SAFETY: constants of the MPI library, initialised at load time.
        unsafe {
            match self {
                Self::Min => ffi::RSMPI_MIN,
                Self::Max => ffi::RSMPI_MAX,
                Self::Sum => ffi::RSMPI_SUM,
            }
        }
    }
}

/// An integer that MPI can reduce.
///
/// # Safety
/// `datatype` must describe exactly this type.
unsafe trait Reducible: bytemuck::Pod + Default + Ord {
    fn datatype() -> MPI_Datatype;
    fn wrapping_sum(self, other: Self) -> Self;
}

// SAFETY: MPI_INT64_T is a signed 64-bit integer.
unsafe impl Reducible for i64 {
    fn datatype() -> MPI_Datatype {
        // SAFETY: a constant of the MPI library.
        unsafe { ffi::RSMPI_INT64_T }
    }
    fn wrapping_sum(self, other: Self) -> Self {
        self.wrapping_add(other)
    }
}

// SAFETY: MPI_UINT64_T is an unsigned 64-bit integer.
unsafe impl Reducible for u64 {
    fn datatype() -> MPI_Datatype {
        // SAFETY: a constant of the MPI library.
        unsafe { ffi::RSMPI_UINT64_T }
    }
    fn wrapping_sum(self, other: Self) -> Self {
        self.wrapping_add(other)
    }
}

impl Communicator {
    /// Returns a communicator of this process alone, without MPI.
    #[must_use]
    pub fn serial() -> Self {
        Self {
            kind: Kind::Serial,
            message_limit: MESSAGE_LIMIT,
        }
    }

    /// Returns a communicator of the same ranks that divides messages into pieces of at most `bytes` (at least 1,
    /// at most 1 GiB).
    ///
    /// MPI counts in 32 bits, so that longer messages are always divided; a smaller limit is for networks that fail
    /// on large messages. All ranks must set the same limit.
    #[must_use]
    pub fn with_message_limit(&self, bytes: usize) -> Self {
        Self {
            kind: self.kind.clone(),
            message_limit: bytes.clamp(1, MESSAGE_LIMIT),
        }
    }

    /// Returns the number of this rank, from 0.
    #[must_use]
    pub fn rank(&self) -> usize {
        match &self.kind {
            Kind::Serial => 0,
            Kind::Threads(post) => post.rank(),
            Kind::Mpi(context) => context.rank,
        }
    }

    /// Returns the number of ranks, at least 1.
    #[must_use]
    pub fn size(&self) -> usize {
        match &self.kind {
            Kind::Serial => 1,
            Kind::Threads(post) => post.size(),
            Kind::Mpi(context) => context.size,
        }
    }

    /// Returns MPI's handle for libraries that use MPI themselves; `None` without MPI.
    #[must_use]
    pub fn raw(&self) -> Option<RawCommunicator> {
        match &self.kind {
            Kind::Serial | Kind::Threads(_) => None,
            Kind::Mpi(context) => Some(context.raw),
        }
    }

    /// Returns the channels of a rank that is a thread.
    pub(crate) fn post(&self) -> Option<&Post> {
        match &self.kind {
            Kind::Threads(post) => Some(post),
            Kind::Serial | Kind::Mpi(_) => None,
        }
    }

    /// Returns a rank that is a thread.
    pub(crate) fn of_thread(post: Post) -> Self {
        Self {
            kind: Kind::Threads(Rc::new(post)),
            message_limit: MESSAGE_LIMIT,
        }
    }

    /// Returns the name and version of the MPI library, one line, for logs and provenance.
    #[must_use]
    pub fn mpi_version(&self) -> String {
        if self.raw().is_none() {
            return "serial, no MPI".to_owned();
        }
        mpi_library()
    }

    /// Waits until all ranks have called this function.
    pub fn barrier(&self) {
        if let Some(post) = self.post() {
            post.all_gather(&[]);
        }
        if let Some(raw) = self.raw() {
            // SAFETY: a live communicator.
            self.waits(Wait::Collectives, || unsafe { ffi::MPI_Barrier(raw) });
        }
    }

    /// Returns `true` if every rank calls this within `patience` of this rank. It precedes an exit on error: if all
    /// ranks end, they may finalise MPI; a rank that ends alone must call [`Self::abort`]. After `false` no other
    /// call is allowed.
    #[must_use]
    pub fn all_arrive(&self, patience: Duration) -> bool {
        let Kind::Mpi(context) = &self.kind else {
            return true;
        };
        // SAFETY: the null request is a constant of the library.
        let mut request = unsafe { ffi::RSMPI_REQUEST_NULL };
        // SAFETY: a live communicator that nothing else uses.
        unsafe { ffi::MPI_Ibarrier(context.exit_communicator, &raw mut request) };
        let start = Instant::now();
        loop {
            let mut done = 0;
            // SAFETY: a live request; the status is not asked for.
            unsafe { ffi::MPI_Test(&raw mut request, &raw mut done, ffi::RSMPI_STATUS_IGNORE) };
            if done != 0 {
                return true;
            }
            if start.elapsed() > patience {
                return false;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Ends the job on all ranks immediately with exit code `code`. This is for emergencies: ranks agree on an
    /// ordinary error with [`Self::agree`] and return it.
    pub fn abort(&self, code: i32) -> ! {
        if let Some(raw) = self.raw() {
            // SAFETY: a live communicator.
            unsafe { ffi::MPI_Abort(raw, code) };
        }
        std::process::exit(code)
    }

    /// Makes a call that waits for other ranks, and measures its time if there are any.
    fn waits<T>(&self, wait: Wait, call: impl FnOnce() -> T) -> T {
        if self.size() > 1 {
            // The lengths of unannounced messages are also exchanged in a collective call.
            called_together();
            timed(wait, call)
        } else {
            call()
        }
    }

    // ---- reductions -------------------------------------------------------------------------

    fn reduce<T: Reducible>(&self, values: &mut [T], reduction: Reduction) {
        if let Some(post) = self.post() {
            reduce_on_threads(post, values, reduction);
            return;
        }
        let Some(raw) = self.raw() else { return };
        // The bindings do not provide MPI_IN_PLACE, so that the result needs a second buffer: on the stack, to
        // avoid an allocation.
        let mut result = [T::default(); REDUCTION_CHUNK];
        for chunk in values.chunks_mut(REDUCTION_CHUNK) {
            self.waits(Wait::Collectives, || {
                // SAFETY: the constant of a running MPI.
                let mut request = unsafe { ffi::RSMPI_REQUEST_NULL };
                // SAFETY: both buffers hold `chunk.len()` values of the datatype, do not overlap, and live until the
                // request is done.
                unsafe {
                    ffi::MPI_Iallreduce(
                        chunk.as_ptr().cast(),
                        result.as_mut_ptr().cast(),
                        count(chunk.len()),
                        T::datatype(),
                        reduction.raw(),
                        raw,
                        &raw mut request,
                    )
                };
                until(|| {
                    let mut done = 0;
                    // SAFETY: a live request, or none once it is done.
                    unsafe {
                        ffi::MPI_Test(&raw mut request, &raw mut done, ffi::RSMPI_STATUS_IGNORE)
                    };
                    done != 0
                });
            });
            chunk.copy_from_slice(&result[..chunk.len()]);
        }
    }

    fn reduce_one<T: Reducible>(&self, value: T, reduction: Reduction) -> T {
        let mut values = [value];
        self.reduce(&mut values, reduction);
        values[0]
    }

    /// Returns the smallest value of all ranks; -0.0 counts as smaller than 0.0, and NaN on any rank gives NaN.
    #[must_use]
    pub fn all_reduce_min_f64(&self, value: f64) -> f64 {
        let key = if value.is_nan() {
            i64::MIN
        } else {
            ordered(value)
        };
        unordered(self.reduce_one(key, Reduction::Min))
    }

    /// Returns the largest value of all ranks; 0.0 counts as larger than -0.0, and NaN on any rank gives NaN.
    #[must_use]
    pub fn all_reduce_max_f64(&self, value: f64) -> f64 {
        let key = if value.is_nan() {
            i64::MAX
        } else {
            ordered(value)
        };
        unordered(self.reduce_one(key, Reduction::Max))
    }

    /// Returns the smallest value of all ranks.
    #[must_use]
    pub fn all_reduce_min_i64(&self, value: i64) -> i64 {
        self.reduce_one(value, Reduction::Min)
    }

    /// Returns the largest value of all ranks.
    #[must_use]
    pub fn all_reduce_max_i64(&self, value: i64) -> i64 {
        self.reduce_one(value, Reduction::Max)
    }

    /// Returns the sum over all ranks, modulo 2^64.
    #[must_use]
    pub fn all_reduce_sum_i64(&self, value: i64) -> i64 {
        // Unsigned numbers are used, because their overflow is also defined in C.
        self.all_reduce_sum_u64(value.cast_unsigned()).cast_signed()
    }

    /// Returns the smallest value of all ranks.
    #[must_use]
    pub fn all_reduce_min_u64(&self, value: u64) -> u64 {
        self.reduce_one(value, Reduction::Min)
    }

    /// Returns the largest value of all ranks.
    #[must_use]
    pub fn all_reduce_max_u64(&self, value: u64) -> u64 {
        self.reduce_one(value, Reduction::Max)
    }

    /// Returns the sum over all ranks, modulo 2^64.
    #[must_use]
    pub fn all_reduce_sum_u64(&self, value: u64) -> u64 {
        self.reduce_one(value, Reduction::Sum)
    }

    /// Sums each entry over all ranks, modulo 2^64. The length must be the same on all ranks.
    pub fn all_reduce_sum_i64s(&self, values: &mut [i64]) {
        self.reduce(bytemuck::cast_slice_mut::<i64, u64>(values), Reduction::Sum);
    }

    /// Returns the sum over all ranks, modulo 2^128.
    #[must_use]
    pub fn all_reduce_sum_u128(&self, value: u128) -> u128 {
        let mut values = [value];
        self.all_reduce_sum_u128s(&mut values);
        values[0]
    }

    /// Sums each entry over all ranks, modulo 2^128. The length must be the same on all ranks.
    pub fn all_reduce_sum_u128s(&self, values: &mut [u128]) {
        const DIGITS: usize = 4;
        if self.size() == 1 {
            return;
        }
        // Digits of 32 bits in words of 64: 2^32 ranks fit before a word overflows.
        let mut digits = [0_u64; REDUCTION_CHUNK];
        for chunk in values.chunks_mut(REDUCTION_CHUNK / DIGITS) {
            for (value, digit) in chunk.iter().zip(digits.chunks_exact_mut(DIGITS)) {
                for (place, digit) in digit.iter_mut().enumerate() {
                    *digit = low_digit(value >> (32 * place));
                }
            }
            let used = chunk.len() * DIGITS;
            self.reduce(&mut digits[..used], Reduction::Sum);
            for (value, digit) in chunk.iter_mut().zip(digits.chunks_exact(DIGITS)) {
                *value = (0..DIGITS).fold(0_u128, |sum, place| {
                    sum.wrapping_add(u128::from(digit[place]) << (32 * place))
                });
            }
        }
    }

    /// Returns `true` if `value` is true on all ranks.
    #[must_use]
    pub fn all_true(&self, value: bool) -> bool {
        self.all_reduce_min_i64(i64::from(value)) == 1
    }

    /// Returns the sum of `value` over the lower ranks and the sum over all ranks: the start of this rank's items
    /// in a global list, and the length of that list.
    #[must_use]
    pub fn exclusive_scan_u64(&self, value: u64) -> (u64, u64) {
        if self.post().is_some() {
            let all = self.all_gather_u64(value);
            return (all[..self.rank()].iter().sum(), all.iter().sum());
        }
        let Some(raw) = self.raw() else {
            return (0, value);
        };
        let mut offset = 0_u64;
        // SAFETY: one value in, one value out, both of the datatype.
        self.waits(Wait::Collectives, || unsafe {
            ffi::MPI_Exscan(
                ptr::from_ref(&value).cast(),
                ptr::from_mut(&mut offset).cast(),
                1,
                u64::datatype(),
                Reduction::Sum.raw(),
                raw,
            )
        });
        if self.rank() == 0 {
            // MPI does not define the first rank's result.
            offset = 0;
        }
        (offset, self.all_reduce_sum_u64(value))
    }

    // ---- agreement --------------------------------------------------------------------------

    /// Makes all ranks continue or fail together: returns `Ok` with each rank's own value if every rank has `Ok`,
    /// otherwise the message of the lowest failing rank on every rank.
    ///
    /// A rank that returned its error alone would leave the others waiting for its messages.
    ///
    /// # Errors
    /// If any rank passes `Err`, [`Disagreement`] on all ranks.
    pub fn agree<T, E: Display>(&self, outcome: Result<T, E>) -> Result<T, Disagreement> {
        let (mine, value, message) = match outcome {
            Ok(value) => (u64::MAX, Some(value), String::new()),
            Err(error) => (self.rank() as u64, None, error.to_string()),
        };
        let first = self.all_reduce_min_u64(mine);
        let Ok(rank) = usize::try_from(first) else {
            return value.ok_or_else(|| self.no_value());
        };
        if rank >= self.size() {
            return value.ok_or_else(|| self.no_value());
        }
        let mut bytes = message.into_bytes();
        self.broadcast_bytes(rank, &mut bytes);
        Err(Disagreement {
            rank,
            message: String::from_utf8_lossy(&bytes).into_owned(),
        })
    }

    /// Returns the error of an impossible state: no rank failed, so that this rank has a value.
    fn no_value(&self) -> Disagreement {
        Disagreement {
            rank: self.rank(),
            message: "the ranks did not call `agree` in the same order".to_owned(),
        }
    }

    // ---- bytes ------------------------------------------------------------------------------

    /// Sends the bytes of rank `root` to every rank; they replace the contents on other ranks.
    pub fn broadcast_bytes(&self, root: usize, bytes: &mut Vec<u8>) {
        if self.size() == 1 {
            return;
        }
        let mut length = [bytes.len() as u64];
        self.broadcast(root, bytemuck::bytes_of_mut(&mut length));
        bytes.resize(length_in_memory(length[0]), 0);
        self.broadcast(root, bytes);
    }

    fn broadcast(&self, root: usize, bytes: &mut [u8]) {
        if let Some(post) = self.post() {
            bytes.copy_from_slice(&post.all_gather(bytes)[root]);
            return;
        }
        let Some(raw) = self.raw() else { return };
        for piece in bytes.chunks_mut(self.message_limit) {
            // SAFETY: `piece` holds that many bytes; all ranks pass the same length.
            self.waits(Wait::Collectives, || unsafe {
                ffi::MPI_Bcast(
                    piece.as_mut_ptr().cast(),
                    count(piece.len()),
                    ffi::RSMPI_UINT8_T,
                    raw_rank(root),
                    raw,
                )
            });
        }
    }

    /// Sends `outgoing[r]` to each rank r and returns the bytes received from each rank. Empty entries send no
    /// message. The lengths are exchanged first, so that receivers need not know the senders.
    pub(crate) fn all_to_all_bytes(&self, mut outgoing: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        if let Some(post) = self.post() {
            return post.all_to_all(&outgoing);
        }
        let Some(raw) = self.raw() else {
            return outgoing;
        };
        let sizes: Vec<u64> = outgoing.iter().map(|bytes| bytes.len() as u64).collect();
        let mut lengths = vec![0_u64; self.size()];
        // SAFETY: `size` values in and out, one for each rank, all of the datatype.
        self.waits(Wait::Messages, || unsafe {
            ffi::MPI_Alltoall(
                sizes.as_ptr().cast(),
                1,
                u64::datatype(),
                lengths.as_mut_ptr().cast(),
                1,
                u64::datatype(),
                raw,
            )
        });
        let mut incoming = vec![Vec::new(); self.size()];
        let mut requests = Vec::new();
        for (rank, &length) in lengths.iter().enumerate() {
            if rank == self.rank() {
                incoming[rank] = std::mem::take(&mut outgoing[rank]);
            } else {
                incoming[rank] = vec![0; length_in_memory(length)];
                self.post_receive(&mut incoming[rank], rank, &mut requests);
            }
        }
        for (rank, bytes) in outgoing.iter().enumerate() {
            self.post_send(bytes, rank, &mut requests);
        }
        wait_all(&mut requests);
        incoming
    }

    /// Starts sending; `bytes` must not be moved or changed until the requests are complete.
    fn post_send(&self, bytes: &[u8], to: usize, requests: &mut Vec<MPI_Request>) {
        let Some(raw) = self.raw() else { return };
        for piece in bytes.chunks(self.message_limit) {
            // SAFETY: the null request is a constant of the library.
            let mut request = unsafe { ffi::RSMPI_REQUEST_NULL };
            // SAFETY: the callers in this file wait for the requests while `bytes` is alive.
            unsafe {
                ffi::MPI_Isend(
                    piece.as_ptr().cast(),
                    count(piece.len()),
                    ffi::RSMPI_UINT8_T,
                    raw_rank(to),
                    TAG_SPARSE,
                    raw,
                    &raw mut request,
                )
            };
            requests.push(request);
            sent(1, piece.len() as u64);
        }
    }

    /// Starts receiving; `bytes` must not be moved or read until the requests are complete.
    fn post_receive(&self, bytes: &mut [u8], from: usize, requests: &mut Vec<MPI_Request>) {
        let Some(raw) = self.raw() else { return };
        for piece in bytes.chunks_mut(self.message_limit) {
            // SAFETY: the null request is a constant of the library.
            let mut request = unsafe { ffi::RSMPI_REQUEST_NULL };
            // SAFETY: the callers in this file wait for the requests before they access `bytes`.
            unsafe {
                ffi::MPI_Irecv(
                    piece.as_mut_ptr().cast(),
                    count(piece.len()),
                    ffi::RSMPI_UINT8_T,
                    raw_rank(from),
                    TAG_SPARSE,
                    raw,
                    &raw mut request,
                )
            };
            requests.push(request);
        }
    }

    // ---- persistent requests ----------------------------------------------------------------

    /// Makes the persistent requests of one message of `bytes` bytes at `buffer`, divided according to the message
    /// limit, and appends them.
    ///
    /// # Safety
    /// The buffer must stay allocated until the requests are freed, must not be touched while they
    /// are active (only written for a receive, only read by others for a send), and the requests
    /// must be freed before the last handle of this communicator is dropped.
    pub(crate) unsafe fn make_persistent(
        &self,
        direction: Direction,
        buffer: *mut u8,
        bytes: usize,
        partner: usize,
        tag: c_int,
        requests: &mut Vec<MPI_Request>,
    ) {
        let Some(raw) = self.raw() else { return };
        for piece in pieces(bytes, self.message_limit) {
            // SAFETY: the piece lies inside the buffer.
            let start: *mut c_void = unsafe { buffer.add(piece.start) }.cast();
            let (length, partner) = (count(piece.len()), raw_rank(partner));
            // SAFETY: the null request is a constant of the library.
            let mut request = unsafe { ffi::RSMPI_REQUEST_NULL };
            let created = &raw mut request;
            // SAFETY: promised by the caller.
            unsafe {
                let datatype = ffi::RSMPI_UINT8_T;
                match direction {
                    Direction::Send => {
                        ffi::MPI_Send_init(start, length, datatype, partner, tag, raw, created)
                    }
                    Direction::Receive => {
                        ffi::MPI_Recv_init(start, length, datatype, partner, tag, raw, created)
                    }
                }
            };
            requests.push(request);
        }
    }
}

/// Joins the values of ranks that are threads, in the order of the ranks.
fn reduce_on_threads<T: Reducible>(post: &Post, values: &mut [T], reduction: Reduction) {
    let all = post.all_gather(bytemuck::cast_slice(values));
    for (rank, bytes) in all.iter().enumerate() {
        let theirs = bytes.chunks_exact(size_of::<T>());
        for (value, other) in values.iter_mut().zip(theirs) {
            let other = bytemuck::pod_read_unaligned(other);
            *value = match reduction {
                _ if rank == 0 => other,
                Reduction::Min => other.min(*value),
                Reduction::Max => other.max(*value),
                Reduction::Sum => value.wrapping_sum(other),
            };
        }
    }
}

/// Direction of a persistent message.
#[derive(Clone, Copy)]
pub(crate) enum Direction {
    Send,
    Receive,
}

/// Waits for all requests and clears the list.
fn wait_all(requests: &mut Vec<MPI_Request>) {
    if !requests.is_empty() {
        let all = count(requests.len());
        let live = requests.as_mut_ptr();
        let arrived = || {
            let mut done = 0;
            // SAFETY: live requests of a running MPI.
            unsafe { ffi::MPI_Testall(all, live, &raw mut done, ffi::RSMPI_STATUSES_IGNORE) };
            done != 0
        };
        timed(Wait::Messages, || until(arrived));
        requests.clear();
    }
}

/// Returns the ranges of pieces of at most `limit` bytes that cover `bytes` bytes.
fn pieces(bytes: usize, limit: usize) -> impl Iterator<Item = Range<usize>> {
    (0..bytes)
        .step_by(limit)
        .map(move |start| start..bytes.min(start + limit))
}

/// Returns a float as an integer in the same order (that of `f64::total_cmp`).
fn ordered(value: f64) -> i64 {
    let bits = value.to_bits().cast_signed();
    bits ^ ((bits >> 63).cast_unsigned() >> 1).cast_signed()
}

/// Returns the float from which [`ordered`] made `key`.
fn unordered(key: i64) -> f64 {
    let bits = key ^ ((key >> 63).cast_unsigned() >> 1).cast_signed();
    f64::from_bits(bits.cast_unsigned())
}

/// Returns the lowest 32 bits.
fn low_digit(value: u128) -> u64 {
    (value & 0xffff_ffff) as u64
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "pieces are at most 2^30 long"
)]
pub(crate) fn count(length: usize) -> c_int {
    length as c_int
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "MPI numbers its ranks in 32 bits"
)]
fn raw_rank(rank: usize) -> c_int {
    rank as c_int
}

#[expect(
    clippy::cast_sign_loss,
    reason = "MPI's rank and size are not negative"
)]
fn index(rank: c_int) -> usize {
    rank as usize
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the length of a vector on another rank of the same program"
)]
fn length_in_memory(length: u64) -> usize {
    length as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn serial_needs_no_mpi() {
        let one = Communicator::serial();
        assert_eq!((one.rank(), one.size()), (0, 1));
        one.barrier();
        assert_eq!(one.all_reduce_min_f64(-2.5).to_bits(), (-2.5_f64).to_bits());
        assert_eq!(one.all_reduce_max_f64(7.5).to_bits(), 7.5_f64.to_bits());
        assert!(one.all_reduce_max_f64(f64::NAN).is_nan());
        assert!(one.all_reduce_min_f64(f64::NAN).is_nan());
        assert_eq!(one.all_reduce_sum_i64(-3), -3);
        assert_eq!(one.all_reduce_sum_u128(u128::MAX), u128::MAX);
        assert!(one.all_true(true));
        assert!(!one.all_true(false));
        assert_eq!(one.exclusive_scan_u64(5), (0, 5));
        let mut bytes = vec![1, 2];
        one.broadcast_bytes(0, &mut bytes);
        assert_eq!(bytes, [1, 2]);
        assert_eq!(one.gather_bytes(0, &bytes), Some(vec![vec![1, 2]]));
        assert_eq!(one.all_gather_bytes(&bytes), vec![vec![1, 2]]);
        assert!(one.all_arrive(Duration::ZERO));
        assert!(one.raw().is_none());
        assert!(one.mpi_version().contains("serial"));
    }

    #[test]
    fn a_serial_failure_names_rank_0() {
        let one = Communicator::serial();
        assert_eq!(one.agree(Ok::<_, String>(4)), Ok(4));
        let error = one.agree(Err::<(), _>("no space left")).unwrap_err();
        assert_eq!(error.to_string(), "rank 0: no space left");
    }

    #[test]
    fn ordered_keeps_the_order_of_floats() {
        let rising = [
            f64::NEG_INFINITY,
            f64::MIN,
            -1.0,
            -f64::MIN_POSITIVE,
            -0.0,
            0.0,
            5e-324,
            1.0,
            1.0 + f64::EPSILON,
            f64::MAX,
            f64::INFINITY,
        ];
        for pair in rising.windows(2) {
            assert!(ordered(pair[0]) < ordered(pair[1]), "{pair:?}");
        }
        for value in rising {
            assert_eq!(unordered(ordered(value)).to_bits(), value.to_bits());
        }
        assert!(unordered(i64::MAX).is_nan());
        assert!(unordered(i64::MIN).is_nan());
    }

    #[test]
    fn pieces_cover_a_message_once() {
        let cut: Vec<_> = pieces(7, 3).collect();
        assert_eq!(cut, [0..3, 3..6, 6..7]);
        assert_eq!(pieces(0, 3).count(), 0);
        assert_eq!(pieces(6, 3).count(), 2);
    }
}
