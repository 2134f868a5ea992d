//! Gradients next to bodies: those next to a wall at the same position, exact where the motion is rigid, and those of
//! the pass.

use crate::boundary::{Patch, Strength, outfall, velocity};
use crate::collision::{Operator, bgk};
use crate::fluid::{Fluid, Models, Setup};
use crate::lattice::VelocitySet;
use crate::links::Rigid;
use crate::links::fixed::FixedLink;
use crate::saturation::{CoveringBody, SaturationMethod, SolidOperator, Weighting};
use crate::surface::Outside;
use crate::turbulence::EddyViscosity;
use base::number::single;
use decomposition::{Domain, SplitAxis};

const TAU: f64 = 0.6;

fn fluid(cells: [usize; 3]) -> Fluid<f64> {
    open_fluid(cells, Vec::new())
}

/// Returns a fluid between walls across y, with conditions on parts of them.
fn open_fluid(cells: [usize; 3], patches: Vec<Patch>) -> Fluid<f64> {
    let smagorinsky = serde_json::from_str::<EddyViscosity>(r#"{"smagorinsky": {}}"#).unwrap();
    let models = Models {
        turbulence: Some(smagorinsky),
        ..Models::new(VelocitySet::D3Q19, Operator::Bgk(bgk::BgkParameters {}))
    };
    let setup = Setup {
        periodic: [true, false, true],
        patches,
        saturation: Some(SaturationMethod {
            operator: SolidOperator::NonEquilibriumBounceBack,
            weighting: Weighting::Fraction,
        }),
        ..Setup::new(models, TAU, cells)
    };
    Fluid::new(setup, &Domain::serial(SplitAxis::X, cells[0], true)).unwrap()
}

fn position(fluid: &Fluid<f64>, at: [usize; 3]) -> usize {
    fluid.populations().cell(at.map(usize::cast_signed))
}

/// Covers parts of the cells of the lower layers by a body with this motion.
fn cover(fluid: &mut Fluid<f64>, parts: &[f32], motion: Rigid) {
    let cells = fluid.populations().cells();
    let mut covered = Vec::new();
    for (y, part) in parts.iter().enumerate() {
        for x in 0..cells[0] {
            for z in 0..cells[2] {
                covered.push((position(fluid, [x, y, z]), *part));
            }
        }
    }
    let cover = fluid.cover_mut().unwrap();
    cover.make_room(1);
    cover.set(
        0,
        CoveringBody {
            motion,
            ..CoveringBody::default()
        },
    );
    for (position, part) in &covered {
        cover.cover(*position, 0, *part);
    }
    let share = |thread: usize, threads: usize| {
        let all = covered.iter().skip(thread).step_by(threads);
        all.map(|(position, _)| *position)
    };
    fluid.record_covered::<3, _>(share);
}

/// Sets the velocity of all cells as a function of their centres, `below` for those under a height.
fn stir(fluid: &mut Fluid<f64>, below: (usize, [f32; 3]), velocity: impl Fn([f64; 3]) -> [f64; 3]) {
    let cells: Vec<_> = fluid.populations().interior().collect();
    let field = fluid.velocities_mut().unwrap();
    for (at, cell) in cells {
        let u = velocity(at.map(|n| n as f64 + 0.5)).map(single);
        field.set_velocity(cell, if at[1] < below.0 { below.1 } else { u });
    }
    fluid.spread_velocities();
}

/// Returns a smooth flow as a function of the height above a wall.
fn flow(at: [f64; 3], wall: f64) -> [f64; 3] {
    let y = at[1] - wall;
    [0.02 * y - 0.001 * y * y, 1e-4 * y * y, 0.003 * y]
}

#[test]
fn a_body_is_seen_as_a_wall_at_the_same_place() {
    let (mut wall, mut body) = (fluid([4, 8, 4]), fluid([4, 10, 4]));
    stir(&mut wall, (0, [0.0; 3]), |at| flow(at, 0.0));
    // Velocities in covered cells have no effect.
    cover(&mut body, &[1.0, 1.0], Rigid::default());
    stir(&mut body, (2, [0.3, -0.2, 0.1]), |at| flow(at, 2.0));
    for y in 0..3 {
        let (at_wall, at_body) = (position(&wall, [1, y, 2]), position(&body, [1, y + 2, 2]));
        let known = wall.velocities().unwrap().gradient(at_wall);
        let found = body.velocities().unwrap().gradient(at_body);
        for (known, found) in known.as_flattened().iter().zip(found.as_flattened()) {
            approx::assert_abs_diff_eq!(known, found, epsilon = 1e-8);
        }
        // The parabola's own derivative, 0.02 - 0.002 y.
        let exact = 0.02 - 0.002 * (y as f64 + 0.5);
        approx::assert_abs_diff_eq!(found[0][1], exact, epsilon = 1e-8);
    }
}

#[test]
fn rigid_motion_has_its_gradient_beside_a_body_that_joins_in() {
    let motion = Rigid {
        position: [1.3, 2.2, 0.7],
        velocity: [0.01, 0.02, -0.01],
        spin: [1e-3, -2e-3, 4e-3],
        radius: 1.0,
    };
    let rigid = |at: [f64; 3]| -> [f64; 3] {
        let arm: [f64; 3] = std::array::from_fn(|a| at[a] - motion.position[a]);
        let (w, v) = (motion.spin, motion.velocity);
        [
            v[0] + w[1] * arm[2] - w[2] * arm[1],
            v[1] + w[2] * arm[0] - w[0] * arm[2],
            v[2] + w[0] * arm[1] - w[1] * arm[0],
        ]
    };
    for part in [1.0, 0.8, 0.5] {
        let mut fluid = fluid([4, 8, 4]);
        cover(&mut fluid, &[1.0, part], motion);
        stir(&mut fluid, (2, [0.3, -0.2, 0.1]), rigid);
        let cell = position(&fluid, [1, 2, 2]);
        let found = fluid.velocities().unwrap().gradient(cell);
        let w = motion.spin;
        let exact = [[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]];
        for a in 0..3 {
            for b in 0..3 {
                approx::assert_abs_diff_eq!(found[a][b], exact[a][b], epsilon = 1e-7);
            }
        }
    }
}

/// Checks that a disturbance without mass and momentum leaves its cell multiplied by 1 - ω.
#[test]
fn the_pass_has_the_rate_of_the_gradient_beside_a_body() {
    let mut fluid = fluid([4, 8, 5]);
    fluid.initialise(&|_: [f64; 3]| (0.0, [0.0; 3]));
    cover(&mut fluid, &[1.0, 1.0], Rigid::default());
    stir(&mut fluid, (2, [0.3, -0.2, 0.1]), |at| flow(at, 2.0));
    let at = [1, 2, 2];
    let cell = position(&fluid, at);
    let omega = 1.0 / (3.0 * ((TAU - 0.5) / 3.0 + fluid.eddy_viscosity(cell)) + 0.5);
    assert!(omega < 1.0 / TAU - 1e-3, "{omega}");
    let velocities = fluid.populations().velocities();
    let along = |c: [i8; 3]| (0..19).find(|&i| velocities.c[i] == c).unwrap();
    let [up, back] = [along([1, 1, 0]), along([-1, 1, 0])];
    for (i, sign) in [
        (up, 1.0),
        (back, -1.0),
        (along([-1, -1, 0]), 1.0),
        (along([1, -1, 0]), -1.0),
    ] {
        let place = fluid.populations().incoming(cell, i);
        fluid.populations_mut().numbers_mut()[place] = 1e-6 * sign;
    }
    fluid.advance();
    for (i, x, sign) in [(up, 2, 1.0), (back, 0, -1.0)] {
        let there = position(&fluid, [x, 3, 2]);
        let populations = fluid.populations();
        let arrived = populations.numbers()[populations.incoming(there, i)];
        approx::assert_relative_eq!(arrived, sign * 1e-6 * (1.0 - omega), max_relative = 1e-7);
    }
}

/// Returns the links upwards from the lowest cells, which a stationary surface cuts at this distance.
fn ceiling(fluid: &Fluid<f64>, distance: f64) -> Vec<FixedLink> {
    let populations = fluid.populations();
    let up = (populations.velocities().c.iter()).position(|c| *c == [0, 1, 0]);
    let up = up.unwrap();
    let lowest = populations.interior().filter(|(at, _)| at[1] == 0);
    lowest
        .map(|(_, cell)| FixedLink {
            link: populations.link(cell, up),
            middle: [0; 3],
            direction: u8::try_from(up).unwrap(),
            wet: [true, false],
            kappa: [(1.0 - 2.0 * distance) / (1.0 + 2.0 * distance), 0.0],
        })
        .collect()
}

/// Checks gradients in a gap of one cell below a structure, at a wall, at a moving wall and at an opening: those of the
/// flow in the gap. The velocities of the cells inside the structure have no effect.
#[test]
fn a_structure_one_cell_from_a_face_bounds_the_flow_in_the_gap() {
    let patch = |rule| {
        vec![Patch {
            name: "floor".into(),
            axis: 1,
            upper: false,
            range: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
            rule,
        }]
    };
    let slide = [0.02, 0.0, -0.01];
    for distance in [0.5, 0.2, 0.8] {
        let wall = Vec::new();
        let moving = patch(Box::new(velocity::VelocityLinks::uniform(slide)));
        let open = patch(Box::new(outfall::Links {
            strength: Strength::Pressure,
            outside: Outside::Air,
        }));
        // A parabola with the velocity of the face at -1/2 and 0 at the surface, or a line at an opening: the factors
        // of the distances from the face and from the surface, and of their product.
        let bent = [0.03, 0.0, 0.01];
        for (patches, face, bent) in [
            (wall, Some([0.0; 3]), bent),
            (moving, Some(slide), bent),
            (open, None, [0.0; 3]),
        ] {
            let mut fluid = open_fluid([4, 5, 4], patches);
            let links = [ceiling(&fluid, distance)];
            fluid.bound_velocities::<3>(&links);
            fluid.record_fixed_links::<3>(&links);
            let width = 0.5 + distance;
            let slope = face.unwrap_or([-0.01, 0.02, 0.03]).map(|u| -u / width);
            let flow = |y: f64| -> [f64; 3] {
                let (below, above) = (y, width - y);
                std::array::from_fn(|a| -slope[a] * above + bent[a] * below * above)
            };
            for inside in [0.3, 1e3] {
                let inside = [inside, -inside, 0.1];
                let cells: Vec<_> = fluid.populations().interior().collect();
                let field = fluid.velocities_mut().unwrap();
                for (at, cell) in cells {
                    let u = if at[1] == 0 {
                        flow(0.5).map(single)
                    } else {
                        inside
                    };
                    field.set_velocity(cell, u);
                }
                fluid.spread_velocities();
                let cell = position(&fluid, [1, 0, 2]);
                let found = fluid.velocities().unwrap().gradient(cell);
                for a in 0..3 {
                    let exact = slope[a] + bent[a] * (width - 1.0);
                    approx::assert_abs_diff_eq!(found[a][1], exact, epsilon = 1e-7);
                }
            }
        }
    }
}
