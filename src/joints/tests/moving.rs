//! Blocks that move in the water of their joints: squeezed, lifted, held by suction.

use super::steady::{Fronts, boxes, rocks, settings, water};
use crate::flow::JointFlow;
use crate::motion::Mover;
use crate::network::Network;
use nalgebra::{Matrix3, Vector6};

/// Returns a plate of these sides above a fixed one at a distance \[m\], and the front of its open edges.
fn plate(length: f64, width: f64, gap: f64, cell: f64, mass: f64) -> (Network, Mover) {
    let solids = boxes(&[
        [[0.0, 0.0, 0.0], [length, width, 0.1]],
        [[0.0, 0.0, 0.1 + gap], [length, width, 0.2]],
    ]);
    let network = Network::new(&rocks(&solids), &settings(cell));
    let mover = Mover::new(1, mass, Matrix3::identity() * mass, solids[1].position);
    (network, mover)
}

#[test]
fn a_plate_sinks_like_stefan_at_any_step() {
    // A strip between closed sides under a constant force: 1/h² - 1/h0² = 2 F t/(mu L³ w), without inertia of the
    // plate.
    let (length, width, start, force) = (0.1_f64, 0.02, 1e-3_f64, 0.02);
    let exact = |time: f64| {
        let rate = 2.0 * force / (1e-3 * length.powi(3) * width);
        (start.powi(-2) + rate * time).powf(-0.5)
    };
    for steps in [400, 25] {
        let (network, mut mover) = plate(length, width, start, length / 40.0, 1e-6);
        mover.load[2] = -force;
        let drive = Fronts::new(&network, |at, _| {
            (at.x < 1e-9 || at.x > 0.1 - 1e-9).then_some(0.0)
        });
        let mut flow = JointFlow::with_movers(network, water(), vec![mover]);
        let end = 2.0;
        let step = end / f64::from(steps);
        let mut entered = 0.0;
        let before = flow.stored();
        for k in 0..steps {
            entered += flow
                .advance(&drive, step * f64::from(k), step)
                .unwrap()
                .entered;
        }
        let found = flow.gaps()[0].constant;
        let by_motion = start + flow.movers()[0].displacement[2];
        println!("{steps} steps: {found:e} m, exact {:e} m", exact(end));
        assert!((found / exact(end) - 1.0).abs() < 0.01);
        assert!((found - by_motion).abs() < 1e-12);
        assert!((flow.stored() - before - entered).abs() < 1e-10 * before);
        // The damping time of the plate is a millionth of a step.
        assert!(flow.movers()[0].velocity[2] < 0.0);
        let turned = flow.movers()[0].displacement.fixed_rows::<3>(3).norm();
        assert!(turned < 1e-9, "{turned:e}");
    }
}

#[test]
fn a_plate_starts_with_the_added_mass_of_its_layer() {
    // Inertia of the water in a strip between closed sides: rho L³ w/(12 h).
    let (length, width, gap, mass, force) = (0.1_f64, 0.02, 5e-3, 0.05, 1.0);
    let (network, mut mover) = plate(length, width, gap, length / 50.0, mass);
    mover.load[2] = force;
    let drive = Fronts::new(&network, |at, _| {
        (at.x < 1e-9 || at.x > 0.1 - 1e-9).then_some(0.0)
    });
    let mut settings = water();
    settings.inertia = true;
    let mut flow = JointFlow::with_movers(network, settings, vec![mover]);
    let added = 1000.0 * length.powi(3) * width / (12.0 * gap);
    let end = 2e-3;
    for k in 0..200 {
        flow.advance(&drive, 1e-5 * f64::from(k), 1e-5).unwrap();
    }
    let found = force * end / flow.movers()[0].velocity[2] - mass;
    // The layer at the walls, 2 sqrt(nu t/pi) thick on each, lowers the inertia that has answered.
    println!("added mass {found:.5} kg, inviscid {added:.5} kg");
    let walls = 4.0 * (1e-6 * end / std::f64::consts::PI).sqrt() / gap;
    assert!(found > added * 0.99 && found < added * (1.01 + 2.0 * walls));
}

#[test]
fn a_block_that_is_torn_off_is_held_by_suction_down_to_vapour() {
    // A pull of a tenth of the atmospheric pressure lifts slowly; twice the atmospheric pressure accelerates the
    // plate by the force in excess of the suction limit.
    let (length, width, gap, mass) = (0.2_f64, 0.2, 1e-4, 20.0);
    let area = length * width;
    for (pull, torn) in [(1e4 * area, false), (2e5 * area, true)] {
        let (network, mut mover) = plate(length, width, gap, length / 10.0, mass);
        mover.load[2] = pull;
        let drive = Fronts::new(&network, |_, _| Some(0.0));
        let mut flow = JointFlow::with_movers(network, water(), vec![mover]);
        let limit = flow.settings().water.vapour_gauge();
        let step = 2e-5;
        let mut least = 0.0_f64;
        for k in 0..100 {
            flow.advance(&drive, step * f64::from(k), step).unwrap();
            least = flow.pressures().iter().fold(least, |m, p| m.min(*p));
        }
        let mover = flow.movers()[0];
        let free = pull / mass * step * 100.0;
        println!(
            "pull {pull} N: speed {:e} m/s of {free:e} m/s without water, least pressure {least:.0} Pa",
            mover.velocity[2]
        );
        assert!(least > limit - crate::water::VAPOUR);
        if torn {
            // Suction beyond the vapour pressure is impossible; next to the open edges it is less.
            let left = (pull + limit * area) / mass * step * 100.0;
            assert!(mover.velocity[2] > 0.999 * left, "{left}");
            assert!(mover.velocity[2] < 0.5 * (left + free));
            assert!(least < limit);
        } else {
            // Stefan: F = 0.42173 mu V L⁴/h³.
            let found = pull * (gap + mover.displacement[2]).powi(3) / (1e-3 * length.powi(4));
            assert!((found / 0.42173 / mover.velocity[2] - 1.0).abs() < 0.05);
        }
    }
}

#[test]
fn a_block_in_the_middle_of_a_slit_turns_back_by_its_pressures_alone() {
    // Rotation about y couples with the slope of the gap: the moment of a rotating plate is mu w L^5 W/(60 h³).
    let (length, width, gap) = (0.1_f64, 0.02, 1e-3);
    let (network, mut mover) = plate(length, width, gap, length / 60.0, 1e-6);
    // The joint is at the foot of the block; the rotation is about the centroid above it, along y.
    let moment = 1e-4;
    mover.load[4] = moment;
    let drive = Fronts::new(&network, |at, _| {
        (at.x < 1e-9 || at.x > 0.1 - 1e-9).then_some(0.0)
    });
    let mut flow = JointFlow::with_movers(network, water(), vec![mover]);
    for k in 0..10 {
        flow.advance(&drive, 1e-3 * f64::from(k), 1e-3).unwrap();
    }
    let rate = flow.movers()[0].velocity[4];
    let exact = moment * 60.0 * gap.powi(3) / (1e-3 * width * length.powi(5));
    println!(
        "rate {rate:e}, exact {exact:e}; {:?}",
        flow.movers()[0].velocity
    );
    assert!((rate.abs() / exact - 1.0).abs() < 0.01);
    // The wedge that it opens lifts it as well; nothing acts across.
    let zero = Vector6::new(0.0, 1.0, 0.0, 1.0, 0.0, 1.0);
    assert!(flow.movers()[0].velocity.dot(&zero).abs() < 1e-6 * rate.abs());
}

#[test]
fn a_block_on_closed_faces_is_lifted_by_a_hundred_times_gravity() {
    // The faces touch: the joint has its residual aperture of a micrometre.
    let (length, mass) = (0.2, 20.0);
    for inertia in [false, true] {
        let (network, mut mover) = plate(length, length, 0.0, length / 8.0, mass);
        mover.load[2] = 100.0 * 9.81 * mass;
        let drive = Fronts::new(&network, |_, _| Some(0.0));
        let mut settings = water();
        settings.inertia = inertia;
        settings.water.air = 0.2;
        let mut flow = JointFlow::with_movers(network, settings, vec![mover]);
        let (mut entered, before) = (0.0, flow.stored());
        let step = 1e-5;
        for k in 0..500 {
            entered += flow
                .advance(&drive, step * f64::from(k), step)
                .unwrap()
                .entered;
        }
        let limit = flow.settings().water.vapour_gauge();
        let least = flow.pressures().iter().fold(0.0_f64, |m, p| m.min(*p));
        let rise = flow.movers()[0].displacement[2];
        let free = 0.5 * 100.0 * 9.81 * (500.0 * step).powi(2);
        println!(
            "inertia {inertia}: rise {rise:e} m, {free:e} m without water, pressure {least:.0} Pa"
        );
        assert!(rise > 0.0 && rise < free && least > limit - crate::water::VAPOUR);
        assert!((flow.stored() - before - entered).abs() < 1e-10 * flow.stored());
    }
}

#[test]
fn a_plate_that_is_placed_after_each_step_sinks_and_turns_like_one_that_is_not() {
    use nalgebra::UnitQuaternion;
    // An eccentric load turns the plate; linear rotations and placed ones agree to second order.
    let (length, width, start, force) = (0.1_f64, 0.02, 1e-3, 0.02);
    let solids = boxes(&[
        [[0.0, 0.0, 0.0], [length, width, 0.1]],
        [[0.0, 0.0, 0.1 + start], [length, width, 0.2]],
    ]);
    let run = |placed: bool| {
        // Without weight it would slide down its own wedge.
        let (network, mut mover) = plate(length, width, start, length / 40.0, 1.0);
        mover.inertia = Matrix3::identity() * 1e-5;
        mover.load[2] = -force;
        mover.load[4] = 0.02 * force * length;
        let drive = Fronts::new(&network, |at, _| {
            (at.x < 1e-9 || at.x > 0.1 - 1e-9).then_some(0.0)
        });
        let mut flow = JointFlow::with_movers(network, water(), vec![mover]);
        let mut now = solids.clone();
        let (step, mut entered, before) = (1e-2, 0.0, flow.stored());
        for k in 0..60 {
            entered += flow
                .advance(&drive, step * f64::from(k), step)
                .unwrap()
                .entered;
            if placed {
                let moved = flow.movers()[0].displacement;
                now[1].position += moved.fixed_rows::<3>(0);
                let turn = UnitQuaternion::from_scaled_axis(moved.fixed_rows::<3>(3).into_owned());
                now[1].orientation = turn * now[1].orientation;
                flow.move_to(&rocks(&now));
            }
        }
        assert!((flow.stored() - before - entered).abs() < 1e-10 * before);
        let gap = flow.gaps()[0];
        [gap.constant, gap.slope.x]
    };
    let (free, placed) = (run(false), run(true));
    println!("gap and slope {free:?}, placed {placed:?}");
    // The normal of the placed face turns with it: the force has an arm of 0.05 m times the slope about the centroid,
    // against the 0.002 m of the load.
    let arm = 0.05 * free[1].abs() / 0.002;
    assert!((placed[0] / free[0] - 1.0).abs() < 1e-3 && (placed[1] / free[1] - 1.0).abs() < arm);
    assert!(free[1].abs() * 0.5 * length > 0.1 * free[0]);
}
