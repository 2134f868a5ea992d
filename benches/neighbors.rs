//! The program's search for neighbours compared with the bare idea of CGRID (Williams, Perkins and Cook 2004; after its
//! description alone): one grid in which every body is listed in all the cells that its box overlaps.
//!
//! Both find the pairs whose surfaces are closer than a gap; the bench stops if they differ. Time is that of finding,
//! before any order of pairs is made; of the second the best of several widths of its cells is shown, which a program
//! would have to guess. `cargo bench --bench neighbors`, on an idle core.

#![expect(clippy::print_stdout, reason = "a bench prints its results")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "cells of a box that starts at 0, far fewer than 2^31"
)]

use std::hint::black_box;
use std::time::Instant;

use nalgebra::Vector3;
use solver::dem::{Body, Motion, Particles, Search, Space, Volume};
use solver::preparation::numbering::curve_order;
use solver::random::Stream;

/// Bodies in a box of edge `length`.
struct Scene {
    places: Vec<[f64; 3]>,
    radii: Vec<f64>,
    length: f64,
}

/// Returns a scene of spheres whose sizes range over 1:`ratio` with numbers proportional to r^-3, and which fill 0.3 of
/// the box.
fn scene(count: u64, ratio: f64) -> Scene {
    let radii: Vec<f64> = (0..count)
        .map(|id| {
            let draw = Stream::new(7, id, 0).uniform();
            1e-3 * (1.0 - draw * (1.0 - ratio.powf(-2.0))).powf(-0.5)
        })
        .collect();
    let filled: f64 = radii.iter().map(|&r| Volume::measure(r)).sum();
    let length = (filled / 0.3_f64).cbrt();
    let places: Vec<Vector3<f64>> = (0..count)
        .map(|id| {
            let mut draw = Stream::new(8, id, 0);
            Vector3::from_fn(|_, _| length * draw.uniform())
        })
        .collect();
    let order = curve_order::<Volume>(&places);
    Scene {
        places: order.iter().map(|&k| places[k].into()).collect(),
        radii: order.iter().map(|&k| radii[k]).collect(),
        length,
    }
}

/// Returns the shortest time of three runs [s], and the result of the work.
fn timed<T>(mut work: impl FnMut() -> T) -> (f64, T) {
    let mut best = f64::INFINITY;
    let mut result = None;
    for _ in 0..3 {
        let start = Instant::now();
        let now = black_box(work());
        best = best.min(start.elapsed().as_secs_f64());
        result = Some(now);
    }
    (best, result.expect("three runs"))
}

/// Buffers of the one grid, kept between calls as a program would.
#[derive(Default)]
struct OneGrid {
    start: Vec<u32>,
    entries: Vec<u32>,
    spans: Vec<[[u32; 2]; 3]>,
    pairs: Vec<[u32; 2]>,
}

impl OneGrid {
    /// Finds the pairs closer than `gap` in a grid with cells of `width`; returns the number of entries in the grid.
    fn find(&mut self, scene: &Scene, gap: f64, width: f64) -> usize {
        let n = ((scene.length / width).floor() as u32).max(1);
        let cell = |x: f64| ((x / scene.length * f64::from(n)).max(0.0) as u32).min(n - 1);
        let at = |x: u32, y: u32, z: u32| ((z * n + y) * n + x) as usize;
        self.spans.clear();
        self.start.clear();
        self.start.resize((n * n * n) as usize + 1, 0);
        for (place, radius) in scene.places.iter().zip(&scene.radii) {
            let reach = radius + 0.5 * gap;
            let span = place.map(|x| [cell(x - reach), cell(x + reach)]);
            for z in span[2][0]..=span[2][1] {
                for y in span[1][0]..=span[1][1] {
                    for x in span[0][0]..=span[0][1] {
                        self.start[at(x, y, z) + 1] += 1;
                    }
                }
            }
            self.spans.push(span);
        }
        for k in 1..self.start.len() {
            self.start[k] += self.start[k - 1];
        }
        let total = *self.start.last().expect("one at least") as usize;
        self.entries.resize(total, 0);
        for (k, span) in (0_u32..).zip(&self.spans) {
            for z in span[2][0]..=span[2][1] {
                for y in span[1][0]..=span[1][1] {
                    for x in span[0][0]..=span[0][1] {
                        let slot = &mut self.start[at(x, y, z)];
                        self.entries[*slot as usize] = k;
                        *slot += 1;
                    }
                }
            }
        }
        self.pairs.clear();
        let mut from = 0;
        for z in 0..n {
            for y in 0..n {
                for x in 0..n {
                    // `start` ran ahead by one cell while filling.
                    let to = self.start[at(x, y, z)] as usize;
                    let here = &self.entries[from..to];
                    from = to;
                    for (i, &a) in here.iter().enumerate() {
                        let (p, s) = (scene.places[a as usize], self.spans[a as usize]);
                        for &b in &here[i + 1..] {
                            let (q, t) = (scene.places[b as usize], self.spans[b as usize]);
                            // A pair counts in the first of the cells that it shares.
                            let first = |axis: usize| s[axis][0].max(t[axis][0]);
                            if [first(0), first(1), first(2)] != [x, y, z] {
                                continue;
                            }
                            let squared: f64 = (0..3).map(|axis| (p[axis] - q[axis]).powi(2)).sum();
                            let reach = scene.radii[a as usize] + scene.radii[b as usize] + gap;
                            if squared <= reach * reach {
                                self.pairs.push([a, b]);
                            }
                        }
                    }
                }
            }
        }
        total
    }
}

fn main() {
    println!(
        "{:>8} {:>6} {:>14} {:>14} {:>7} {:>22} {:>18} {:>10}",
        "bodies",
        "sizes",
        "ours ns/body",
        "one grid",
        "ratio",
        "its cells / mean width",
        "entries per body",
        "pairs"
    );
    for (count, ratio) in [
        (1_000, 1.0001),
        (10_000, 1.0001),
        (100_000, 1.0001),
        (1_000_000, 1.0001),
        (1_000, 10.0),
        (10_000, 10.0),
        (100_000, 10.0),
        (1_000_000, 10.0),
        (10_000, 100.0),
        (100_000, 100.0),
        (1_000_000, 100.0),
    ] {
        let scene = scene(count, ratio);
        let mut particles = Particles::<Volume>::new();
        for (id, (place, radius)) in (0..).zip(scene.places.iter().zip(&scene.radii)) {
            let motion = Motion {
                position: Vector3::from(*place),
                ..Motion::default()
            };
            particles.insert(Body::uniform::<Volume>(id, *radius, 2600.0, 0), motion);
        }
        let gap = 1e-4;
        let mut search = Search::default();
        let (classes, pairs) = timed(|| search.find_pairs(&particles, gap));
        let mean = 2.0 * scene.radii.iter().sum::<f64>() / scene.radii.len() as f64;
        let mut grid = OneGrid::default();
        let mut best = (f64::INFINITY, 0.0, 0);
        for factor in [0.7, 1.0, 1.5, 2.0, 3.0, 5.0] {
            let (time, entries) = timed(|| grid.find(&scene, gap, factor * mean));
            assert_eq!(grid.pairs.len(), pairs, "both must find the same pairs");
            if time < best.0 {
                best = (time, factor, entries);
            }
        }
        let each = count as f64;
        println!(
            "{count:8} 1:{:<4.0} {:15.0} {:14.0} {:7.2} {:22.1} {:18.1} {pairs:10}",
            ratio.round(),
            classes / each * 1e9,
            best.0 / each * 1e9,
            best.0 / classes,
            best.1,
            best.2 as f64 / each,
        );
    }
}
