//! Collisions in f32.

use super::super::*;
use super::{EVERYWHERE, swirl};
use crate::boundary::{Ramp, Rule, pressure, velocity};
use crate::collision::{bgk, cumulant, mrt, trt};
use crate::saturation::{SolidOperator, Weighting};
use crate::turbulence::wale::Wale;
use std::f64::consts::PI;

/// Half of the distance between two numbers of f32 next to one.
const UNIT: f64 = 1.0 / 16_777_216.0;

fn setup(set: VelocitySet, operator: Operator, cells: [usize; 3]) -> Setup<f32> {
    Setup {
        periodic: [true, false, true],
        single: true,
        ..Setup::new(Models::new(set, operator), 0.7, cells)
    }
}

fn serial<S: Stored>(axis: usize, setup: Setup<S>) -> Result<Fluid<S>, FluidError> {
    use decomposition::SplitAxis::{X, Y, Z};
    let domain = Domain::serial([X, Y, Z][axis], setup.cells[axis], setup.periodic[axis]);
    Fluid::new(setup, &domain)
}

fn trt() -> Operator {
    Operator::Trt(trt::TrtParameters { magic: 0.25 })
}

/// All operators with collisions in f32 on a velocity set.
fn operators(set: VelocitySet) -> Vec<Operator> {
    let mut all = vec![Operator::Bgk(bgk::BgkParameters {}), trt()];
    if set == VelocitySet::D3Q27 {
        all.push(Operator::Mrt(mrt::MrtParameters::default()));
        all.push(Operator::Mrt(mrt::MrtParameters {
            higher: Some(1.0),
            ..mrt::MrtParameters::default()
        }));
    }
    all
}

fn patch(axis: usize, rule: Box<dyn Rule<f32>>) -> Patch<f32> {
    Patch {
        name: format!("{axis}"),
        axis,
        upper: true,
        range: EVERYWHERE,
        rule,
    }
}

fn lid() -> Patch<f32> {
    patch(
        1,
        Box::new(velocity::VelocityLinks::uniform([0.03, 0.0, 0.0])),
    )
}

/// Incoming populations of all cells as bits, in an order that does not depend on the layout.
fn bits(fluid: &Fluid<f32>, cells: [usize; 3]) -> Vec<u32> {
    let populations = fluid.populations();
    let mut all = Vec::new();
    for x in 0..cells[0] {
        for y in 0..cells[1] {
            for z in 0..cells[2] {
                let cell = populations.interior_cell([x, y, z]);
                for i in 0..populations.velocities().q() {
                    all.push(populations.numbers()[populations.incoming(cell, i)].to_bits());
                }
            }
        }
    }
    all
}

/// Checks rows of whole vectors of several widths, and rows that end with a part of a vector.
#[test]
fn every_width_of_lanes_gives_the_same_bits() {
    let mut levels = vec![Level::Scalar, Level::best()];
    #[cfg(target_arch = "x86_64")]
    if Level::best() == Level::Avx512 {
        levels.push(Level::Avx2);
    }
    for (set, cells) in [
        (VelocitySet::D2Q9, [24, 7, 1]),
        (VelocitySet::D2Q9, [9, 37, 1]),
        (VelocitySet::D3Q19, [5, 6, 8]),
        (VelocitySet::D3Q27, [5, 6, 17]),
        (VelocitySet::D3Q27, [4, 16, 3]),
    ] {
        for operator in operators(set) {
            for forced in [false, true] {
                let run = |level: Level| {
                    let mut s = setup(set, operator, cells);
                    s.periodic = [false, false, true];
                    if forced {
                        s.force = Force::Constant([1e-5, -2e-5, 0.0]);
                    }
                    let ramp = Ramp {
                        start: 0.0,
                        end: 1e-3,
                        steps: 5.0,
                    };
                    s.patches = vec![
                        lid(),
                        patch(0, Box::new(pressure::PressureLinks::new(0, ramp))),
                    ];
                    let pass = Choice::from_setup(&s, level).in_single().unwrap();
                    let mut fluid = serial(0, s).unwrap();
                    fluid.pass = pass;
                    fluid.initialise(&swirl);
                    for _ in 0..9 {
                        fluid.advance();
                    }
                    bits(&fluid, cells)
                };
                let first = run(levels[0]);
                assert!(first.iter().all(|&b| f32::from_bits(b).is_finite()));
                for &level in &levels[1..] {
                    assert!(
                        first == run(level),
                        "{set:?} {operator:?} {forced} {level:?}"
                    );
                }
            }
        }
    }
}

/// Checks that no axis of the slabs, number of threads or sweep changes a bit.
#[test]
fn slabs_threads_and_sweeps_do_not_show() {
    for (set, cells) in [
        (VelocitySet::D2Q9, [40, 37, 1]),
        (VelocitySet::D3Q27, [21, 19, 18]),
    ] {
        for operator in operators(set) {
            let run = |split: usize, threads: usize, at_once: bool| {
                let mut s = setup(set, operator, cells);
                s.periodic = [true, false, false];
                s.patches = vec![lid()];
                s.force = Force::Constant([1e-5, 0.0, 0.0]);
                let mut fluid = serial(split, s).unwrap();
                fluid.threads = threads;
                fluid.initialise(&swirl);
                for _ in 0..5 {
                    if at_once {
                        fluid.advance_two();
                    } else {
                        fluid.advance();
                        fluid.advance();
                    }
                }
                bits(&fluid, cells)
            };
            let first = run(0, 1, false);
            assert!(first.iter().any(|&b| f32::from_bits(b).abs() > 1e-3));
            for split in 0..set.velocities().dimension {
                for (threads, at_once) in [(1, true), (2, true), (3, false)] {
                    let other = run(split, threads, at_once);
                    assert!(first == other, "{set:?} {operator:?} {split} {threads}");
                }
            }
        }
    }
}

/// Checks that deviations from the state at rest are exact in stationary water.
#[test]
fn water_at_rest_stays_at_rest() {
    for set in [VelocitySet::D2Q9, VelocitySet::D3Q19, VelocitySet::D3Q27] {
        let cells = [5, 6, if set == VelocitySet::D2Q9 { 1 } else { 4 }];
        for operator in operators(set) {
            let mut fluid = serial(0, setup(set, operator, cells)).unwrap();
            for _ in 0..10 {
                fluid.advance();
            }
            assert!(
                bits(&fluid, cells)
                    .iter()
                    .all(|&b| f32::from_bits(b) == 0.0)
            );
        }
    }
}

/// Checks the decay of a shear wave, u = U exp(-nu k² t) sin ky: the velocity differs from the exact solution of the
/// lattice in f64 by no more than a few roundings in each step, and the viscosity is right.
#[test]
fn a_shear_wave_decays_as_in_f64() {
    let n = 32;
    for set in [VelocitySet::D2Q9, VelocitySet::D3Q19, VelocitySet::D3Q27] {
        for operator in operators(set) {
            let k = 2.0 * PI / n as f64;
            let wave = |p: [f64; 3]| (0.0, [0.04 * (k * p[1]).sin(), 0.0, 0.0]);
            let steps = 400;
            let cells = [2, n, if set == VelocitySet::D2Q9 { 1 } else { 2 }];
            let velocities = |single: bool| -> Vec<f64> {
                let mut s = setup(set, operator, cells);
                s.periodic = [true; 3];
                s.single = single;
                let mut fluid = serial(0, s).unwrap();
                fluid.initialise(&wave);
                for _ in 0..steps {
                    fluid.advance();
                }
                let cell = |y: usize| fluid.populations().interior_cell([1, y, 0]);
                (0..n).map(|y| fluid.state(cell(y)).1[0]).collect()
            };
            let (one, other) = (velocities(true), velocities(false));
            let differs = one.iter().zip(&other).map(|(a, b)| (a - b).abs());
            let largest = differs.fold(0.0, f64::max);
            // The errors of single steps have either sign, and those of 400 steps add up like the square root.
            assert!(largest > 0.0, "arithmetic in f64");
            let bound = 0.04 * UNIT * f64::from(steps) * 0.5;
            assert!(largest < bound, "{set:?} {operator:?} {largest} {bound}");
            let amplitude = |u: &[f64]| {
                let sines = u.iter().enumerate();
                sines
                    .map(|(y, u)| 2.0 / n as f64 * u * (k * (y as f64 + 0.5)).sin())
                    .sum::<f64>()
            };
            let nu = -(amplitude(&one) / 0.04).ln() / (k * k * f64::from(steps));
            assert!(
                (nu / (0.2 / 3.0) - 1.0).abs() < 0.5 * k * k,
                "{set:?} {operator:?} {nu}"
            );
        }
    }
}

#[test]
fn what_has_no_collision_in_f32_is_refused() {
    let cells = [8, 8, 8];
    let plain = || setup(VelocitySet::D3Q27, trt(), cells);
    let reason = |setup: Setup<f32>| {
        let refused = serial(0, setup).err();
        refused.map_or(String::new(), |error| error.to_string())
    };
    assert_eq!(reason(plain()), "");
    let mut eddies = plain();
    eddies.models.turbulence = Some(EddyViscosity::Wale(Wale { constant: 0.5 }));
    assert!(reason(eddies).contains("no collision in f32"));
    let mut covered = plain();
    covered.saturation = Some(SaturationMethod {
        operator: SolidOperator::Superposition,
        weighting: Weighting::Viscous,
    });
    assert!(reason(covered).contains("no collision in f32"));
    let cumulants = Operator::Cumulant(cumulant::CumulantParameters::default());
    let mut other = plain();
    other.models.collision = cumulants;
    assert!(reason(other).contains("no collision in f32"));
    assert!(collides_in_single(trt()) && !collides_in_single(cumulants));
    let mut on_gpu = plain();
    on_gpu.device = Device::Gpu;
    assert!(reason(on_gpu).contains("a GPU does not run"));
    let mut double = super::setup(VelocitySet::D2Q9, trt(), 0.7, [8, 8, 1]);
    double.single = true;
    let refused = serial(0, double).err().unwrap();
    assert!(refused.to_string().contains("no collision in f32"));
}
