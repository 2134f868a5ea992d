//! Writes every kind of file on the given number of ranks; `tests/mpi.rs` compares the results.
//!
//! `check write DIR collective|gather x|y|z` writes, and reads the checkpoint back in other boxes; `check fail DIR
//! collective|gather all|RANK N` makes the disk fail on some ranks after N agreements of the second checkpoint. The
//! exit status is 0, 5 after a failed write like that of `solver`, or 1 on another error.
#![allow(
    clippy::print_stderr,
    reason = "a program started by a test: its words are the test's report"
)]

use std::cell::Cell;
use std::path::Path;
use std::process::ExitCode;

use io::{
    Array, Cells, Column, Data, Error, Group, Image, MeshData, Mode, OutputTime, Reader, Series,
};
use mpi::collective::SystemOperation;
use mpi::datatype::PartitionMut;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{AsRaw, Communicator, CommunicatorCollectives};

/// All ranks of the job.
struct Ranks {
    world: SimpleCommunicator,
    /// Number of agreements until the disk of this rank fails; none for an intact disk.
    fails_in: Cell<Option<u32>>,
}

impl Group for Ranks {
    fn rank(&self) -> usize {
        usize::try_from(self.world.rank()).unwrap_or_default()
    }
    fn size(&self) -> usize {
        usize::try_from(self.world.size()).unwrap_or_default()
    }
    fn raw(&self) -> Option<mpi_sys::MPI_Comm> {
        Some(self.world.as_raw())
    }
    fn give_up(&self, error: &Error) {
        eprintln!("rank {}: {error}", self.rank());
        self.world.abort(5);
    }
    fn all_ok(&self, ok: bool) -> bool {
        match self.fails_in.get() {
            Some(0) => limit_files(300_000),
            Some(n) => self.fails_in.set(Some(n - 1)),
            None => {}
        }
        let mut all = 0_u8;
        self.world
            .all_reduce_into(&u8::from(ok), &mut all, SystemOperation::min());
        all == 1
    }
    fn offset_and_total(&self, n: u64) -> (u64, u64) {
        let (mut offset, mut total) = (0, 0);
        self.world
            .exclusive_scan_into(&n, &mut offset, SystemOperation::sum());
        self.world
            .all_reduce_into(&n, &mut total, SystemOperation::sum());
        (if self.rank() == 0 { 0 } else { offset }, total)
    }
    fn gather(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mine = i32::try_from(bytes.len()).unwrap_or(i32::MAX);
        let mut counts = vec![0_i32; self.size()];
        self.world.all_gather_into(&mine, &mut counts[..]);
        let lengths: Vec<usize> = counts
            .iter()
            .map(|&n| usize::try_from(n).unwrap_or_default())
            .collect();
        let mut offsets = vec![0_i32; counts.len()];
        for i in 1..counts.len() {
            offsets[i] = offsets[i - 1] + counts[i - 1];
        }
        let mut all = vec![0_u8; lengths.iter().sum()];
        self.world
            .all_gather_varcount_into(bytes, &mut PartitionMut::new(&mut all[..], counts, offsets));
        let mut rest = &all[..];
        lengths
            .iter()
            .map(|&n| {
                let (head, tail) = rest.split_at(n);
                rest = tail;
                head.to_vec()
            })
            .collect()
    }
    fn barrier(&self) {
        self.world.barrier();
    }
}

/// Returns rank `rank`'s part of `n` items: all ranks but rank 1 take part, so that one of several is empty.
fn part_of_rank(n: usize, group: &dyn Group) -> (usize, usize) {
    let (rank, size) = (group.rank(), group.size());
    if size < 2 {
        return (0, n);
    }
    let (workers, mine) = (size - 1, rank.saturating_sub(1));
    let cut = |w: usize| n * w / workers;
    match rank {
        1 => (cut(1), 0),
        0 => (0, cut(1)),
        _ => (cut(mine), cut(mine + 1) - cut(mine)),
    }
}

/// Returns a number that is unique for each position and not round.
fn value(i: usize) -> f64 {
    let mut x = 0.1_f64;
    for bit in 0..40 {
        x = 1.7 * x + if i >> bit & 1 == 1 { 0.3 } else { 0.0 };
        x -= x.floor();
    }
    x
}

const CELLS: [usize; 3] = [7, 5, 4];

fn image_step(
    series: &mut Series,
    when: OutputTime,
    axis: usize,
    group: &dyn Group,
    mode: Mode,
) -> Result<(), Error> {
    let (first, n) = part_of_rank(CELLS[axis], group);
    let (mut start, mut count) = ([0; 3], CELLS);
    (start[axis], count[axis]) = (first, n);
    let mut velocity = Vec::new();
    let mut density = Vec::new();
    let mut flag = Vec::new();
    for z in start[2]..start[2] + count[2] {
        for y in start[1]..start[1] + count[1] {
            for x in start[0]..start[0] + count[0] {
                let cell = x + CELLS[0] * (y + CELLS[1] * z);
                #[expect(clippy::cast_possible_truncation, reason = "fields are written as f32")]
                velocity.extend((0..3).map(|c| value(3 * cell + c) as f32));
                density.push(value(cell));
                flag.push(u8::from(cell.is_multiple_of(3)));
            }
        }
    }
    let column = |name, units, components, data| Column {
        name,
        units,
        components,
        data,
    };
    let image = Image {
        origin: [0.0, -1.0, 0.5],
        spacing: [0.1, 0.2, 0.3],
        faces: None,
        cells: CELLS,
        start,
        count,
        fields: vec![
            column("velocity", "m/s", 3, Data::F32(&velocity)),
            column("density", "kg/m3", 1, Data::F64(&density)),
            column("flag", "-", 1, Data::U8(&flag)),
        ],
    };
    let provenance = [
        ("version".to_owned(), "1.0".to_owned()),
        ("case".to_owned(), "{ }".repeat(20_000)),
    ];
    series.write_image(when, &image, &provenance, group, mode)?;
    Ok(())
}

fn meshes(
    when: OutputTime,
    grains: usize,
    group: &dyn Group,
    mode: Mode,
    series: &mut [Series; 3],
) -> Result<(), Error> {
    let provenance = [("version".to_owned(), "1.0".to_owned())];
    let (first, n) = part_of_rank(grains, group);
    let position: Vec<f64> = (3 * first..3 * (first + n)).map(value).collect();
    let stress: Vec<f64> = (9 * first..9 * (first + n)).map(value).collect();
    let id: Vec<i64> = (first..first + n)
        .map(|i| i64::try_from(i).unwrap_or_default())
        .collect();
    let column = |name, units, components, data| Column {
        name,
        units,
        components,
        data,
    };
    let particles = MeshData {
        points: Data::F64(&position),
        cells: Cells::Vertices,
        point_columns: vec![
            column("id", "-", 1, Data::I64(&id)),
            column("velocity", "m/s", 3, Data::F64(&position)),
            column("stress", "Pa", 9, Data::F64(&stress)),
        ],
        cell_columns: vec![],
    };
    series[0].write_mesh(when, &particles, &provenance, group, mode)?;

    // One contact per grain, with separate points in f32.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "positions of contacts are written as f32"
    )]
    let ends: Vec<f32> = (6 * first..6 * (first + n))
        .map(|i| value(i) as f32)
        .collect();
    let lines: Vec<[usize; 2]> = (0..n).map(|i| [2 * i, 2 * i + 1]).collect();
    let force: Vec<f64> = (first..first + n).map(value).collect();
    let contacts = MeshData {
        points: Data::F32(&ends),
        cells: Cells::Lines(&lines),
        point_columns: vec![],
        cell_columns: vec![column("normal_force", "N", 1, Data::F64(&force))],
    };
    series[1].write_mesh(when, &contacts, &provenance, group, mode)?;

    // One pyramid per grain: a square and four triangles.
    let corners: Vec<f64> = (first..first + n)
        .flat_map(|i| {
            let x = 2.0 * value(i);
            [
                [0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [1.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.5, 0.5, 1.0],
            ]
            .into_iter()
            .flat_map(move |p| [p[0] + x, p[1], p[2]])
        })
        .collect();
    let faces: Vec<usize> = (0..n)
        .flat_map(|i| {
            [0, 1, 2, 3, 0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4]
                .into_iter()
                .map(move |c| 5 * i + c)
        })
        .collect();
    let sizes: Vec<usize> = (0..n).flat_map(|_| [4, 3, 3, 3, 3]).collect();
    let block: Vec<i32> = (first..first + n)
        .flat_map(|i| [i32::try_from(i).unwrap_or_default(); 5])
        .collect();
    let blocks = MeshData {
        points: Data::F64(&corners),
        cells: Cells::Polygons {
            sizes: &sizes,
            corners: &faces,
        },
        point_columns: vec![],
        cell_columns: vec![column("id", "-", 1, Data::I32(&block))],
    };
    series[2].write_mesh(when, &blocks, &provenance, group, mode)?;
    Ok(())
}

/// Writes and reads `planes` planes of 64 x 64 numbers, split along the first axis, and the number of each plane.
fn checkpoint(
    folder: &Path,
    step: u64,
    planes: usize,
    group: &dyn Group,
    mode: Mode,
) -> Result<(), Error> {
    let (first, n) = part_of_rank(planes, group);
    let population: Vec<f64> = (4096 * first..4096 * (first + n)).map(value).collect();
    let id: Vec<u64> = (first..first + n).map(|i| i as u64).collect();
    let arrays = [
        Array {
            name: "fluid/population",
            shape: vec![planes, 64, 64],
            start: vec![first, 0, 0],
            count: vec![n, 64, 64],
            data: Data::F64(&population).into(),
        },
        Array {
            name: "id",
            shape: vec![planes],
            start: vec![first],
            count: vec![n],
            data: Data::U64(&id).into(),
        },
    ];
    let attributes = serde_json::json!({"case_hash": "00ff"});
    io::checkpoint::write(folder, step, 0.5, &arrays, &attributes, group, mode, 2)?;
    Ok(())
}

fn read_checkpoint(folder: &Path, planes: usize, group: &dyn Group) -> Result<(), Error> {
    let wrong = |what: &str| Error::Invalid {
        what: what.to_owned(),
        reason: "is not what was written".to_owned(),
    };
    let found = io::newest(folder, group)?;
    let reader = Reader::open(&found)?;
    // Columns along y instead of planes, with other bounds than at writing, and an empty box on the last of several
    // ranks.
    let (rank, size) = (group.rank(), group.size());
    let (from, mut to) = (64 * rank / size, 64 * (rank + 1) / size);
    if size > 1 && rank + 1 == size {
        to = from;
    }
    let numbers: Vec<f64> = reader.read("fluid/population", &[1, from, 0], &[2, to - from, 64])?;
    let expected =
        (1..3).flat_map(|z| (from..to).flat_map(move |y| (0..64).map(move |x| (z, y, x))));
    let same = numbers.len() == 2 * (to - from) * 64
        && expected
            .zip(&numbers)
            .all(|((z, y, x), v)| v.to_bits() == value(4096 * z + 64 * y + x).to_bits());
    let ids: Vec<u64> = reader.read_all("id")?;
    let refused = reader.read::<u64>("id", &[planes], &[1]).is_err();
    let right = same && refused && ids == (0..planes as u64).collect::<Vec<_>>();
    io::group::agree(group, if right { Ok(()) } else { Err(wrong("a box")) })
}

/// Checks that an error that only one rank sees becomes an error of all, with equal words.
fn one_rank_errs(folder: &Path, group: &dyn Group, mode: Mode) -> Result<(), Error> {
    let last = group.rank() + 1 == group.size();
    let id = vec![0_u64; usize::from(!last)];
    let array = Array {
        name: "id",
        shape: vec![group.size()],
        start: vec![group.rank()],
        count: vec![1],
        data: Data::U64(&id).into(),
    };
    let none = serde_json::Value::Null;
    let told = io::checkpoint::write(folder, 1, 0.0, &[array], &none, group, mode, 2)
        .err()
        .map(|e| e.to_string())
        .unwrap_or_default();
    let all = group.gather(told.as_bytes());
    let same = told.contains("0 numbers for a box") && all.iter().all(|t| t == told.as_bytes());
    let verdict = if same {
        Ok(())
    } else {
        Err(Error::Invalid {
            what: "the error of one rank".to_owned(),
            reason: format!("is here {told:?}"),
        })
    };
    io::group::agree(group, verdict)
}

fn write(folder: &Path, mode: Mode, axis: usize, group: &dyn Group) -> Result<(), Error> {
    one_rank_errs(folder, group, mode)?;
    let mut fluid = Series::create(folder, "fluid", group)?;
    let mut rest = [
        Series::create(folder, "particles", group)?,
        Series::create(folder, "contacts", group)?,
        Series::create(folder, "blocks", group)?,
    ];
    // No grains, many, fewer than ranks, and again none.
    for (i, grains) in (0_u32..).zip([0, 23, 1, 0]) {
        let when = OutputTime {
            step: u64::from(i) * 100,
            time: f64::from(i) * 0.1,
        };
        image_step(&mut fluid, when, axis, group, mode)?;
        meshes(when, grains, group, mode, &mut rest)?;
    }
    checkpoint(folder, 300, 5, group, mode)?;
    read_checkpoint(folder, 5, group)
}

/// Makes the system refuse files above `bytes` in this process, like a disk that fails while it is written.
fn limit_files(bytes: u64) {
    let limit = libc::rlimit {
        rlim_cur: bytes,
        rlim_max: bytes,
    };
    // SAFETY: ignoring a signal installs no handler, and setrlimit only reads the struct, which lives here.
    let code = unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
        libc::setrlimit(libc::RLIMIT_FSIZE, &raw const limit)
    };
    if code != 0 {
        eprintln!("the limit on file sizes was refused");
        std::process::exit(1);
    }
}

/// Makes the disk fail on the chosen ranks after some agreements of the second checkpoint; the first must still be
/// found.
fn fail(folder: &Path, mode: Mode, who: &str, when: u32, group: &Ranks) -> Result<(), Error> {
    checkpoint(folder, 1, 64, group, mode)?;
    if who == "all" || who == group.rank().to_string() {
        group.fails_in.set(Some(when));
    }
    checkpoint(folder, 2, 64, group, mode)
}

fn run(arguments: &[String], group: &Ranks) -> Result<(), Error> {
    let usage = || Error::Invalid {
        what: "usage".to_owned(),
        reason:
            "check write DIR collective|gather x|y|z, check fail DIR collective|gather all|RANK N"
                .to_owned(),
    };
    let [_, command, folder, mode, last, rest @ ..] = arguments else {
        return Err(usage());
    };
    let mode = match mode.as_str() {
        "collective" => Mode::Collective,
        "gather" => Mode::Gather,
        _ => return Err(usage()),
    };
    let folder = Path::new(folder);
    match command.as_str() {
        "write" => {
            let axis = "xyz".find(last.as_str()).ok_or_else(usage)?;
            write(folder, mode, axis, group)
        }
        "fail" => {
            let when = rest
                .first()
                .and_then(|n| n.parse().ok())
                .ok_or_else(usage)?;
            fail(folder, mode, last, when, group)
        }
        _ => Err(usage()),
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let Some((_universe, _)) = mpi::initialize_with_threading(mpi::Threading::Funneled) else {
        eprintln!("MPI is already there");
        return ExitCode::FAILURE;
    };
    let group = Ranks {
        world: SimpleCommunicator::world(),
        fails_in: Cell::new(None),
    };
    match run(&arguments, &group) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if error.must_abort() {
                group.give_up(&error);
            }
            eprintln!("rank {}: {error}", group.rank());
            match error {
                Error::Io { .. } | Error::Space { .. } => ExitCode::from(5),
                _ => ExitCode::FAILURE,
            }
        }
    }
}
