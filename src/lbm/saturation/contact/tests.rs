use super::super::super::links::Load;
use super::super::*;
use crate::collision::{Operator, trt};
use crate::fluid::{Fluid, Models, Setup};
use crate::lattice::VelocitySet;
use crate::links::Rigid;
use crate::quanta::from_quanta;
use decomposition::{Domain, SplitAxis};

const OPERATORS: [SolidOperator; 4] = [
    SolidOperator::NonEquilibriumBounceBack,
    SolidOperator::Superposition,
    SolidOperator::BounceBackAboutSolid,
    SolidOperator::ViscosityMatched,
];

/// Height of the channel, and of the top of the bodies \[cells\].
const HEIGHT: usize = 20;
const TOP: usize = 12;

/// Returns a channel with walls below and above.
fn channel(solid_operator: SolidOperator, set: VelocitySet, tau: f64) -> Fluid<f64> {
    let cells = match set {
        VelocitySet::D2Q9 => [4, HEIGHT, 1],
        _ => [4, HEIGHT, 5],
    };
    let setup = Setup {
        periodic: [true, false, true],
        saturation: Some(SaturationMethod {
            operator: solid_operator,
            weighting: Weighting::Viscous,
        }),
        ..Setup::new(
            Models::new(set, Operator::Trt(trt::TrtParameters { magic: 3.0 / 16.0 })),
            tau,
            cells,
        )
    };
    Fluid::new(setup, &Domain::serial(SplitAxis::X, cells[0], true)).unwrap()
}

fn solid(id: u64, u: f64) -> CoveringBody {
    CoveringBody {
        name: (id, [0; 3]).into(),
        motion: Rigid {
            velocity: [u, 0.0, 0.0],
            ..Rigid::default()
        },
        frame: [0; 3],
        alone: false,
    }
}

/// Adds bodies on top of each other up to [`TOP`]. Each is given by its first cell, its velocity, and the fraction of
/// this cell that it fills; the body below fills the remaining fraction. Ghost cells of the periodic faces are covered
/// as in a run.
fn stack(fluid: &mut Fluid<f64>, bodies: &[(usize, f64, f32)]) {
    let [nx, _, nz] = fluid.populations().cells().map(usize::cast_signed);
    let deep_z = if nz > 1 { -1..nz + 1 } else { 0..1 };
    let mut all = Vec::new();
    for (slot, &(first, _, part)) in (0_u32..).zip(bodies) {
        let next = bodies.get(slot as usize + 1);
        let end = next.map_or(TOP, |next| next.0);
        for x in -1..nx + 1 {
            for z in deep_z.clone() {
                let inside = (0..nx).contains(&x) && (0..nz).contains(&z);
                let sign = if inside { 1.0 } else { -1.0 };
                let mut add = |y: usize, part: f32| {
                    let position = fluid.populations().cell([x, y.cast_signed(), z]);
                    all.push((position, slot, sign * part));
                };
                for y in first..end {
                    let deep = y > first + 1 && y + 1 < end;
                    let whole = if deep { DEEP } else { 1.0 };
                    add(y, if y == first { part } else { whole });
                }
                if let Some(&(y, _, above)) = next
                    && above < 1.0
                {
                    add(y, 1.0 - above);
                }
            }
        }
    }
    let cover = fluid.cover_mut().unwrap();
    cover.make_room(bodies.len());
    for (slot, body) in (0_u32..).zip(bodies) {
        cover.set(slot, solid(u64::from(slot), body.1));
    }
    for (position, slot, part) in all {
        cover.cover(position, slot, part);
    }
}

fn loads(fluid: &mut Fluid<f64>, bodies: usize) -> Vec<[f64; 2]> {
    let mut loads: Vec<Load> = vec![[0; 6]; bodies];
    fluid.cover_mut().unwrap().collect(|slot, load| {
        for (sum, part) in loads[slot as usize].iter_mut().zip(load) {
            *sum += part;
        }
    });
    let cells = fluid.populations().cells();
    let area = (cells[0] * cells[2]) as f64;
    loads
        .iter()
        .map(|load| [0, 1].map(|a| from_quanta(load[a]) / area))
        .collect()
}

fn run(fluid: &mut Fluid<f64>, bodies: usize, steps: usize) -> Vec<[f64; 2]> {
    for _ in 0..steps {
        loads(fluid, bodies);
        fluid.advance();
    }
    loads(fluid, bodies)
}

/// Checks the drag of a block that slides on a stationary one, which lies on the floor: the upper block receives the
/// drag of the water above, the lower one none, for joints between cells and inside cells.
#[test]
fn bodies_that_slide_on_each_other_do_not_drag() {
    for solid_operator in OPERATORS {
        for (set, tau) in [
            (VelocitySet::D2Q9, 0.6),
            (VelocitySet::D2Q9, 0.51),
            (VelocitySet::D3Q19, 0.6),
        ] {
            for part in [1.0, 0.3] {
                let mut fluid = channel(solid_operator, set, tau);
                // From the exact profile the profile of the lattice develops fastest, in two to three times
                // (HEIGHT - TOP)^2/(pi^2 nu).
                fluid.initialise(&|at: [f64; 3]| {
                    let y = at[1];
                    let above = 0.01 * (HEIGHT as f64 - y) / (HEIGHT - TOP) as f64;
                    let u = if y < 6.0 { 0.0 } else { above.min(0.01) };
                    (0.0, [u, 0.0, 0.0])
                });
                stack(&mut fluid, &[(0, 0.0, 1.0), (6, 0.01, part)]);
                let steps = if tau > 0.55 { 600 } else { 4000 };
                let [below, above] = run(&mut fluid, 2, steps)[..] else {
                    panic!("two bodies")
                };
                let exact = -(tau - 0.5) / 3.0 * 0.01 / (HEIGHT - TOP) as f64;
                // The limit is that of the surface alone (`couette_flow_beside_a_covered_slab`).
                assert!(
                    (above[0] / exact - 1.0).abs() < 0.05,
                    "{solid_operator:?} {set:?} {tau} {part}: {above:?}, exact {exact:e}"
                );
                assert!(
                    below[0].abs() < 1e-3 * exact.abs(),
                    "{solid_operator:?} {set:?} {tau} {part}: {below:?}, exact {exact:e}"
                );
            }
        }
    }
}

/// Checks that a block that slides on the floor receives the drag of the water above only.
#[test]
fn a_wall_at_rest_does_not_drag() {
    for solid_operator in OPERATORS {
        let mut fluid = channel(solid_operator, VelocitySet::D2Q9, 0.6);
        stack(&mut fluid, &[(0, 0.01, 1.0)]);
        let drag = run(&mut fluid, 1, 2500)[0][0];
        let exact = -0.1 / 3.0 * 0.01 / (HEIGHT - TOP) as f64;
        assert!(
            (drag / exact - 1.0).abs() < 0.05,
            "{solid_operator:?}: {drag:e}, exact {exact:e}"
        );
    }
}

/// Checks that a joint transfers the pressure of the water on the upper block, stationary or sliding.
#[test]
fn the_joint_keeps_the_pressure_of_the_water() {
    for solid_operator in OPERATORS {
        for u in [0.0, 0.01] {
            let mut fluid = channel(solid_operator, VelocitySet::D2Q9, 0.6);
            fluid.initialise(&|_: [f64; 3]| (0.03, [0.0; 3]));
            stack(&mut fluid, &[(0, 0.0, 1.0), (6, u, 1.0)]);
            let [below, above] = run(&mut fluid, 2, 2500)[..] else {
                panic!("two bodies")
            };
            // At a uniform pressure p = 0.03/3 there is no uplift. Without the pressure in the joint it would be p.
            assert!(
                above[1].abs() < 1e-4 * 0.01,
                "{solid_operator:?} {u}: {above:?}"
            );
            assert!(
                below[1].abs() < 1e-4 * 0.01,
                "{solid_operator:?} {u}: {below:?}"
            );
        }
    }
}
