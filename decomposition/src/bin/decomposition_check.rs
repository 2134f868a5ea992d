//! Checks an MPI installation, and this crate on it: `mpirun -n 4 decomposition_check`.
//!
//! Prints one `ok` line for each guarantee and ends with exit code 0, or prints the rank and the fault and ends
//! with 1. `decomposition_check panic` lets the last rank panic while the others wait for it: the job must end with
//! exit code 101 without hanging.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a program whose product is its report"
)]

use decomposition::{
    Communicator, Domain, ExactSum, Fixed, FixedExchange, HaloBytes, HaloExchange, Slabs,
    SplitAxis, StateHash, World, exchange, field_key,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};

type Outcome = Result<(), String>;
type Check = fn(&Communicator) -> Outcome;

/// Maximum number of bytes per message in checks with divided messages.
const SMALL_LIMIT: usize = 7;

const CHECKS: [(&str, Check); 10] = [
    ("reductions", reductions),
    ("bytes", bytes),
    ("agreement", agreement),
    ("halo patterns", halos),
    ("several halos at once", halos_at_once),
    ("unequal halos refused by all", unequal_halos),
    ("sparse exchange", sparse_exchange),
    ("fixed exchange", fixed_exchange),
    ("exact sums", exact_sums),
    ("state hash", state_hash),
];

fn main() -> ExitCode {
    let world = match World::start() {
        Ok(world) => world,
        Err(error) => {
            eprintln!("decomposition_check: {error}");
            return ExitCode::FAILURE;
        }
    };
    let communicator = world.communicator();
    if std::env::args().nth(1).as_deref() == Some("panic") {
        return panic_on_one_rank(&communicator);
    }
    let first = communicator.rank() == 0;
    if first {
        println!(
            "{} ranks, {}",
            communicator.size(),
            communicator.mpi_version()
        );
    }
    let variants = [
        ("", communicator.clone()),
        (", in pieces", communicator.with_message_limit(SMALL_LIMIT)),
    ];
    for (variant, communicator) in &variants {
        for (name, check) in CHECKS {
            if let Err(error) = check(communicator) {
                // The other ranks may already be in the next exchange, so that the whole job is ended.
                let rank = communicator.rank();
                eprintln!("FAILED {name}{variant}, rank {rank}: {error}");
                communicator.abort(1);
            }
            communicator.barrier();
            if first {
                println!("ok {name}{variant}");
            }
        }
    }
    // `variants` outlives the world; dropping the last handle finalises MPI.
    drop(world);
    ExitCode::SUCCESS
}

#[expect(clippy::panic, reason = "shows what a panic does to the job")]
fn panic_on_one_rank(communicator: &Communicator) -> ExitCode {
    if communicator.rank() + 1 == communicator.size() {
        panic!("this rank was told to panic");
    }
    communicator.barrier();
    ExitCode::SUCCESS
}

fn expect<T: PartialEq + std::fmt::Debug>(what: &str, got: T, wanted: T) -> Outcome {
    if got == wanted {
        Ok(())
    } else {
        Err(format!("{what}: got {got:?}, expected {wanted:?}"))
    }
}

/// Returns a random word for each key, the same on every rank (SplitMix64).
fn random(key: u64) -> u64 {
    let mut word = key.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

/// Returns a random number with magnitudes from about 1e-9 to 1e9 and both signs.
fn random_f64(key: u64) -> f64 {
    let bits = random(key);
    // Sign and mantissa are random; the exponent is between -30 and 30.
    let exponent = 1023 - 30 + random(key ^ 0xabcd) % 61;
    f64::from_bits((bits & !(0x7ff << 52)) | (exponent << 52))
}

fn reductions(communicator: &Communicator) -> Outcome {
    let (rank, size) = (communicator.rank() as u64, communicator.size() as u64);
    let last = size - 1;
    let signed = rank.cast_signed();
    expect("min", communicator.all_reduce_min_i64(signed - 5), -5)?;
    expect(
        "max",
        communicator.all_reduce_max_i64(signed - 5),
        last.cast_signed() - 5,
    )?;
    expect("min", communicator.all_reduce_min_u64(rank + 3), 3)?;
    expect("max", communicator.all_reduce_max_u64(rank + 3), last + 3)?;
    let triangle = size * last / 2;
    expect("sum", communicator.all_reduce_sum_u64(rank), triangle)?;
    expect(
        "sum",
        communicator.all_reduce_sum_i64(-signed),
        -triangle.cast_signed(),
    )?;
    expect(
        "wrapping sum",
        communicator.all_reduce_sum_u64(u64::MAX),
        size.wrapping_neg(),
    )?;
    expect(
        "wrapping sum",
        communicator.all_reduce_sum_u128(u128::MAX - u128::from(rank)),
        u128::from(size + triangle).wrapping_neg(),
    )?;

    let low = if rank == last { -1e9 } else { 1e-9 };
    expect(
        "min",
        communicator.all_reduce_min_f64(low).to_bits(),
        (-1e9_f64).to_bits(),
    )?;
    expect(
        "max",
        communicator.all_reduce_max_f64(-low).to_bits(),
        1e9_f64.to_bits(),
    )?;
    let poisoned = if rank == last { f64::NAN } else { 1.0 };
    expect(
        "NaN",
        communicator.all_reduce_min_f64(poisoned).is_nan()
            && communicator.all_reduce_max_f64(poisoned).is_nan(),
        true,
    )?;

    // The list is longer than one chunk of the reduction.
    let mut many: Vec<i64> = (0..1500).map(|index| index - signed).collect();
    let allocations = allocations_of(|| communicator.all_reduce_sum_i64s(&mut many));
    expect("allocations", allocations, 0)?;
    let sums: Vec<i64> = (0..1500)
        .map(|index| index * size.cast_signed() - triangle.cast_signed())
        .collect();
    expect("sums", many, sums)?;
    let mut wide: Vec<u128> = (0..300)
        .map(|index| (index << 90) + u128::from(rank))
        .collect();
    communicator.all_reduce_sum_u128s(&mut wide);
    let sums: Vec<u128> = (0..300)
        .map(|index| (index << 90) * u128::from(size) + u128::from(triangle))
        .collect();
    expect("wide sums", wide, sums)?;

    expect("all true", communicator.all_true(true), true)?;
    expect("not all true", communicator.all_true(rank != last), false)?;
    expect(
        "scan",
        communicator.exclusive_scan_u64(rank + 1),
        (rank * (rank + 1) / 2, size * (size + 1) / 2),
    )
}

/// Returns bytes that depend on the sender, the receiver and the position.
fn letter(from: usize, to: usize, length: usize) -> Vec<u8> {
    let key = (from * 1000 + to) as u64;
    (0..length as u64)
        .map(|index| random(key << 32 | index).to_le_bytes()[0])
        .collect()
}

fn bytes(communicator: &Communicator) -> Outcome {
    let (rank, size) = (communicator.rank(), communicator.size());
    // Rank 0 has no bytes; the number grows with the rank.
    let mine = letter(rank, rank, 50 * rank);
    let all: Vec<Vec<u8>> = (0..size)
        .map(|from| letter(from, from, 50 * from))
        .collect();
    expect(
        "all gather",
        communicator.all_gather_bytes(&mine),
        all.clone(),
    )?;
    for root in 0..size {
        let gathered = communicator.gather_bytes(root, &mine);
        expect("gather", gathered, (rank == root).then(|| all.clone()))?;
        let mut text = mine.clone();
        communicator.broadcast_bytes(root, &mut text);
        expect("broadcast", text, all[root].clone())?;
    }
    expect(
        "numbers",
        communicator.all_gather_u64(rank as u64 * 3),
        (0..size as u64).map(|rank| rank * 3).collect(),
    )
}

fn agreement(communicator: &Communicator) -> Outcome {
    let (rank, size) = (communicator.rank(), communicator.size());
    let value = communicator.agree(Ok::<_, String>(rank * 2));
    expect("no failure", value, Ok(rank * 2))?;
    for failing in 0..size {
        // All ranks from `failing` on fail; the error of the lowest is reported.
        let outcome = if rank >= failing {
            Err(format!("trouble at {rank}"))
        } else {
            Ok(())
        };
        let heard = communicator
            .agree(outcome)
            .err()
            .map(|error| error.to_string());
        let wanted = format!("rank {failing}: trouble at {failing}");
        expect("failure", heard, Some(wanted))?;
    }
    Ok(())
}

/// Returns splits with special cases: even, thin and uneven slabs, and empty slabs at each position.
fn splits(size: usize) -> Vec<Slabs> {
    let mut splits = Vec::new();
    for periodic in [false, true] {
        for planes in [1, size.saturating_sub(1).max(1), size, 3 * size + 1] {
            splits.push(Slabs::even(SplitAxis::X, planes, size, periodic));
        }
        for seed in 0..12 {
            let mut bounds = vec![0];
            for rank in 0..size {
                // The thickness is 0 to 3; the domain must have at least one plane.
                let random = random(seed * 100 + rank as u64).to_le_bytes()[0] % 4;
                let thickness = usize::from(random) + usize::from(rank == 0 && size == 1);
                bounds.push(bounds[rank] + thickness);
            }
            splits.extend(Slabs::from_bounds(SplitAxis::Z, bounds, periodic));
        }
    }
    splits
}

/// Returns the number that a plane sends in a round. It differs for every plane, direction and round.
fn item_value(plane: usize, upwards: bool, round: usize, item: usize) -> f64 {
    let number = ((plane * 2 + usize::from(upwards)) * 10 + round) * 10 + item;
    random_f64(number as u64)
}

/// Fills the send buffers with the numbers of the outermost planes of this rank.
fn fill(halo: &mut HaloExchange, domain: &Domain, round: usize) {
    let range = domain.range();
    let (lower, upper) = halo.send_buffers_mut::<f64>();
    let pack = |buffer: Option<&mut [f64]>, plane: usize, upwards: bool| {
        for (item, value) in buffer.into_iter().flatten().enumerate() {
            *value = item_value(plane, upwards, round, item);
        }
    };
    pack(lower, range.start, false);
    pack(upper, range.end.saturating_sub(1), true);
}

/// Compares the received numbers with those of the planes next to the planes of this rank.
fn compare(halo: &HaloExchange, domain: &Domain, round: usize, down: usize, up: usize) -> Outcome {
    let (range, planes) = (domain.range(), domain.slabs().planes());
    let closed = !domain.slabs().periodic();
    let (from_lower, from_upper) = halo.received::<f64>();
    let packed = |plane: usize, upwards: bool, items: usize| -> Vec<f64> {
        (0..items)
            .map(|item| item_value(plane, upwards, round, item))
            .collect()
    };
    let below = if range.is_empty() || (range.start == 0 && closed) {
        None
    } else {
        Some(packed((range.start + planes - 1) % planes, true, up))
    };
    let above = if range.is_empty() || (range.end == planes && closed) {
        None
    } else {
        Some(packed(range.end % planes, false, down))
    };
    let what = format!("{:?}, round {round}", domain.slabs());
    expect(&what, from_lower.map(<[f64]>::to_vec), below)?;
    expect(&what, from_upper.map(<[f64]>::to_vec), above)
}

fn halos(communicator: &Communicator) -> Outcome {
    for (down, up) in [(3, 3), (5, 2), (0, 1)] {
        for slabs in splits(communicator.size()) {
            let domain = Domain::new(communicator.clone(), slabs).map_err(|e| e.to_string())?;
            let sizes = HaloBytes::crossing(8 * down, 8 * up);
            let mut halo = HaloExchange::new(&domain, 0, sizes).map_err(|e| e.to_string())?;
            let mut outcome = Ok(());
            for round in 0..4 {
                fill(&mut halo, &domain, round);
                let allocations = allocations_of(|| {
                    halo.start();
                    halo.finish();
                });
                outcome = outcome
                    .and_then(|()| expect("allocations", allocations, 0))
                    .and_then(|()| compare(&halo, &domain, round, down, up));
            }
            // The other ranks are in the same round, so that all end together.
            communicator.agree(outcome).map_err(|e| e.to_string())?;
        }
    }
    Ok(())
}

fn halos_at_once(communicator: &Communicator) -> Outcome {
    let slabs = Slabs::even(
        SplitAxis::Y,
        2 * communicator.size(),
        communicator.size(),
        true,
    );
    let domain = Domain::new(communicator.clone(), slabs).map_err(|e| e.to_string())?;
    let mut halos = Vec::new();
    for tag in 0..4 {
        let sizes = HaloBytes::symmetric(32);
        halos.push(HaloExchange::new(&domain, tag, sizes).map_err(|e| e.to_string())?);
    }
    for (round, halo) in halos.iter_mut().enumerate() {
        fill(halo, &domain, round);
    }
    // The exchanges start in a different order on every other rank, and finish in a third order.
    let started: Vec<usize> = if communicator.rank().is_multiple_of(2) {
        vec![0, 1, 2, 3]
    } else {
        vec![3, 1, 0, 2]
    };
    for index in started {
        halos[index].start();
    }
    for index in [2, 0] {
        halos[index].finish();
    }
    // The remaining exchanges are waited for when they are read; one is dropped before its end.
    let outcome = [0, 1, 2]
        .into_iter()
        .try_for_each(|round| compare(&halos[round], &domain, round, 4, 4));
    drop(halos);
    outcome
}

fn unequal_halos(communicator: &Communicator) -> Outcome {
    let (rank, size) = (communicator.rank(), communicator.size());
    let slabs = Slabs::even(SplitAxis::X, size, size, true);
    let domain = Domain::new(communicator.clone(), slabs).map_err(|e| e.to_string())?;
    // The last rank sends more to its upper neighbour, rank 0, than that rank expects.
    let mut sizes = HaloBytes::symmetric(16);
    if rank + 1 == size {
        sizes.to_upper = 24;
    }
    let refused = HaloExchange::new(&domain, 0, sizes)
        .err()
        .map(|error| error.to_string());
    let wanted = format!(
        "rank 0: rank {} sends 24 bytes to rank 0, which expects 16",
        size - 1
    );
    expect("refusal", refused, Some(wanted))
}

/// Returns the length of the message between two ranks in a random pattern; most pairs have none.
fn pattern(seed: u64, from: usize, to: usize) -> usize {
    let word = random(seed << 20 | (from as u64) << 10 | to as u64).to_le_bytes();
    if word[0] < 150 {
        0
    } else {
        usize::from(word[1]) * usize::from(word[2]) / 16
    }
}

fn sparse_exchange(communicator: &Communicator) -> Outcome {
    let (rank, size) = (communicator.rank(), communicator.size());
    for seed in 0..40 {
        // The list is in descending order and has empty messages; the receiver sorts them.
        let sends = (0..size)
            .rev()
            .map(|to| (to, letter(rank, to, pattern(seed, rank, to))))
            .collect();
        let wanted: Vec<(usize, Vec<u8>)> = (0..size)
            .map(|from| (from, letter(from, rank, pattern(seed, from, rank))))
            .filter(|(_, bytes)| !bytes.is_empty())
            .collect();
        expect("pattern", exchange(communicator, sends), wanted)?;
    }
    // All ranks send to rank 0, in two parts.
    let sends = vec![(0, vec![1, 2]), (0, letter(rank, 0, 9))];
    let wanted: Vec<(usize, Vec<u8>)> = (0..size)
        .filter(|_| rank == 0)
        .map(|from| (from, [vec![1, 2], letter(from, 0, 9)].concat()))
        .collect();
    expect("funnel", exchange(communicator, sends), wanted)?;
    expect("silence", exchange(communicator, vec![]), vec![])
}

fn fixed_exchange(communicator: &Communicator) -> Outcome {
    let (rank, size) = (communicator.rank(), communicator.size());
    let words = |seed, from, to| pattern(seed, from, to) / 8;
    for seed in 0..20 {
        let partners = |words: &dyn Fn(usize) -> usize| -> Vec<(usize, usize)> {
            (0..size)
                .map(|partner| (partner, 8 * words(partner)))
                .filter(|&(_, bytes)| bytes > 0)
                .collect()
        };
        let sends = partners(&|to| words(seed, rank, to));
        let receives = partners(&|from| words(seed, from, rank));
        // Exchanges with known sizes and with discovered sizes at the same time.
        let mut known = FixedExchange::new(communicator, 1, &sends, &receives)
            .map_err(|error| error.to_string())?;
        let (mut discovered, found) =
            FixedExchange::discover(communicator, 2, &sends).map_err(|error| error.to_string())?;
        let mut outcome = expect("discovered", found, receives.clone());
        for round in 0..3 {
            let key = |from: usize, to: usize| (seed * 100 + round) << 20 | (from * 16 + to) as u64;
            for (index, &(to, _)) in sends.iter().enumerate() {
                known.send_buffer_mut::<u64>(index).fill(key(rank, to));
            }
            for (buffer, &(to, _)) in discovered.send_buffers_mut::<u64>().zip(&sends) {
                buffer.fill(!key(rank, to));
            }
            let allocations = allocations_of(|| {
                known.start();
                discovered.start();
                known.finish();
                discovered.finish();
            });
            outcome = outcome.and_then(|()| expect("allocations", allocations, 0));
            for (index, &(from, bytes)) in receives.iter().enumerate() {
                let wanted = vec![key(from, rank); bytes / 8];
                let inverted: Vec<u64> = wanted.iter().map(|word| !word).collect();
                outcome = outcome
                    .and_then(|()| expect("known", known.received(index), &wanted[..]))
                    .and_then(|()| expect("learnt", discovered.received(index), &inverted[..]));
            }
        }
        communicator.agree(outcome).map_err(|e| e.to_string())?;
    }
    Ok(())
}

/// Returns the rank that owns an item in one of several partitions.
fn owner(partition: u64, item: u64, size: usize) -> usize {
    let size = size as u64;
    let owner = match partition {
        0 => item % size,
        1 => random(item) % size,
        2 => item * size / 1000,
        _ => size - 1,
    };
    owner.to_le_bytes()[0].into()
}

fn exact_sums(communicator: &Communicator) -> Outcome {
    let (rank, size) = (communicator.rank(), communicator.size());
    let small = |item: u64| random_f64(item) * 2.0_f64.powi(-31);
    let mut whole = ExactSum::new();
    let mut whole_fixed = [Fixed::ZERO; 3];
    for item in 0..1000 {
        whole.add(random_f64(item));
        whole_fixed[0].add(small(item));
        whole_fixed[1].add(-small(item));
    }
    whole_fixed[2] = Fixed::INVALID;
    for partition in 0..4 {
        let mut mine = ExactSum::new();
        let mut fixed = [Fixed::ZERO; 3];
        for item in (0..1000).filter(|&item| owner(partition, item, size) == rank) {
            mine.add(random_f64(item));
            fixed[0].add(small(item));
            fixed[1].add(-small(item));
            // The value is out of range on one rank only.
            fixed[2].add(if item == 500 { 2.0 } else { 0.5 });
        }
        let allocations = allocations_of(|| {
            mine.all_reduce(communicator);
            Fixed::all_reduce(&mut fixed, communicator);
        });
        expect("allocations", allocations, 0)?;
        expect("exact", mine.value().to_bits(), whole.value().to_bits())?;
        expect("exact beyond rounding", mine == whole, true)?;
        expect("fixed", fixed, whole_fixed)?;
        expect("opposite", fixed[0].steps(), -fixed[1].steps())?;
        mine.add(if rank + 1 == size { f64::NAN } else { 1.0 });
        mine.all_reduce(communicator);
        expect("NaN", mine.value().is_nan(), true)?;
    }
    Ok(())
}

fn state_hash(communicator: &Communicator) -> Outcome {
    let (rank, size) = (communicator.rank(), communicator.size());
    let fields = [field_key("density"), field_key("velocity_x")];
    let entry = |field: u64, item: u64| random_f64(item ^ field);
    let mut whole = StateHash::new();
    for field in fields {
        let values: Vec<f64> = (0..1000).map(|item| entry(field, item)).collect();
        whole.add_f64s(field, 0, &values);
    }
    for partition in 0..4 {
        for changed in [false, true] {
            let mut mine = StateHash::new();
            for item in (0..1000).filter(|&item| owner(partition, item, size) == rank) {
                for field in fields {
                    let flip = u64::from(changed && item == 321 && field == fields[1]);
                    mine.add(field, item, entry(field, item).to_bits() ^ flip);
                }
            }
            let total = mine.all_reduce(communicator);
            expect("equal", total == whole, !changed)?;
            let length = total.hex().len();
            expect("digits", length, 32)?;
        }
    }
    Ok(())
}

/// Allocator that counts allocations, to show that exchanges make none.
struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call is passed to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as promised by the caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as promised by the caller.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Returns the number of allocations during a call.
fn allocations_of(call: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    call();
    ALLOCATIONS.load(Ordering::Relaxed) - before
}
