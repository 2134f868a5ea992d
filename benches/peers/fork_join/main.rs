//! Time of a round in which all threads do one piece of work each and meet, for pieces of 1 µs to 1 ms, with a serial
//! part between the rounds in which the helpers wait.
//!
//! A row has the pool, the piece and the pause, the median time of a round beyond the piece \[µs\], and the processor
//! time over the wall time: the cores that waiting helpers and the pause burn. `--busy` starts another process
//! that never waits, as another user of the machine does.

use std::hint::{black_box, spin_loop};
use std::num::NonZero;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// Minimum wall time of each measurement.
const LEAST: Duration = Duration::from_millis(400);
/// Durations of the pieces of work \[µs\].
const PIECES: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];
/// Serial parts between two rounds \[µs\].
const PAUSES: [f64; 3] = [0.0, 20.0, 500.0];

/// Returns the number of turns of [`work`] in a microsecond on this machine.
fn turns_in_a_microsecond() -> f64 {
    let turns = 20_000_000;
    let begun = Instant::now();
    work(turns);
    turns as f64 / begun.elapsed().as_secs_f64() / 1e6
}

/// Computes for a given number of turns without accessing memory.
fn work(turns: u64) {
    let mut x = 1.000_000_1_f64;
    for _ in 0..turns {
        x = black_box(x * 1.000_000_01);
    }
    black_box(x);
}

/// Returns the processor time of this process [s].
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = text
        .rsplit(')')
        .next()
        .unwrap_or("")
        .split_whitespace()
        .collect();
    let ticks = |n: usize| {
        fields
            .get(n)
            .and_then(|f| f.parse::<f64>().ok())
            .unwrap_or(f64::NAN)
    };
    // Fields 14 and 15 of the line; 100 ticks are a second on Linux.
    (ticks(11) + ticks(12)) / 100.0
}

/// Returns the median time of a round in excess of its piece \[µs\], and the processor time divided by the wall time.
fn measure(piece: f64, pause: f64, rate: f64, round: &mut dyn FnMut(u64)) -> (f64, f64) {
    let turns = (piece * rate) as u64;
    for _ in 0..100 {
        round(turns);
    }
    let (mut times, begun, burnt) = (Vec::new(), Instant::now(), processor_time());
    while begun.elapsed() < LEAST {
        let from = Instant::now();
        round(turns);
        times.push(from.elapsed().as_secs_f64() * 1e6 - piece);
        let from = Instant::now();
        while from.elapsed().as_secs_f64() * 1e6 < pause {
            spin_loop();
        }
    }
    let share = (processor_time() - burnt) / begun.elapsed().as_secs_f64();
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], share)
}

/// Divides a range of threads in half until one is left, as a join of two does.
fn halve(scope: &mut chili::Scope<'_>, from: usize, to: usize, turns: u64) {
    if to - from == 1 {
        return work(turns);
    }
    let middle = from.midpoint(to);
    scope.join(
        |scope| halve(scope, from, middle, turns),
        |scope| halve(scope, middle, to, turns),
    );
}

fn main() {
    let words: Vec<String> = std::env::args().collect();
    if words.iter().any(|word| word == "--spin") {
        loop {
            spin_loop();
        }
    }
    let value = |name: &str| {
        let at = words.iter().position(|word| word == name)?;
        words.get(at + 1)
    };
    let threads = value("--threads")
        .and_then(|n| n.parse().ok())
        .unwrap_or(2_usize);
    // Helpers of one pool would take cores from another: each pool has a process of its own.
    let Some(pool) = value("--pool") else {
        println!("pool,piece,pause,overhead,cores");
        println!("# -,us,us,us,-");
        for pool in ["base", "rayon", "chili", "fork_union"] {
            let mut own = Command::new(&words[0]);
            own.args(&words[1..]).args(["--pool", pool]);
            own.status().expect("this program can be started again");
        }
        return;
    };
    let other: Option<Child> = words.iter().any(|word| word == "--busy").then(|| {
        let spin = Command::new(&words[0]).arg("--spin").spawn();
        spin.expect("this program can be started again")
    });
    let rate = turns_in_a_microsecond();
    let rayon = rayon::ThreadPoolBuilder::new().num_threads(threads);
    rayon.build_global().expect("the pool is built once");
    let mut union = (pool == "fork_union")
        .then(|| fork_union::ThreadPool::try_spawn(threads).expect("threads can be started"));
    let chili = (pool == "chili").then(|| {
        chili::ThreadPool::with_config(chili::Config {
            thread_count: NonZero::new(threads - 1),
            ..chili::Config::default()
        })
    });
    let mut round = |turns: u64| match (&mut union, &chili) {
        (Some(union), _) => drop(union.for_threads(|_, _| work(turns))),
        (_, Some(chili)) => halve(&mut chili.scope(), 0, threads, turns),
        _ if pool == "rayon" => {
            rayon::broadcast(|_| work(turns));
        }
        _ => base::thread_pool::each(threads, |_| work(turns)),
    };
    for pause in PAUSES {
        for piece in PIECES {
            let (overhead, cores) = measure(piece, pause, rate, &mut round);
            println!("{pool},{piece},{pause},{overhead:.2},{cores:.2}");
        }
    }
    if let Some(mut other) = other {
        let _ = other.kill();
        let _ = other.wait();
    }
}
