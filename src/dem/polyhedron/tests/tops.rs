//! Free rigid bodies: order, energy and angular momentum of the rotation.

use approx::assert_relative_eq;
use nalgebra::{UnitQuaternion, Vector3};

use super::super::rotation::{Damping, RotationState};

/// Returns the angular velocity [rad/s] along the principal axes.
fn body_spin(state: &RotationState, inertia: &Vector3<f64>) -> Vector3<f64> {
    (state.orientation.inverse() * state.angular_momentum).component_div(inertia)
}

/// Returns the quaternion of a symmetric top: the precession in space about L, then the rotation of the body about its
/// axis.
fn symmetric(start: &RotationState, inertia: &Vector3<f64>, time: f64) -> UnitQuaternion<f64> {
    let spin = body_spin(start, inertia);
    let about_l = start.angular_momentum * (time / inertia.x);
    let about_axis = spin.z * time * (1.0 - inertia.z / inertia.x);
    UnitQuaternion::from_scaled_axis(about_l)
        * start.orientation
        * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), about_axis)
}

fn turned(start: &RotationState, inertia: &Vector3<f64>, time: f64, steps: u32) -> RotationState {
    let mut now = *start;
    for _ in 0..steps {
        now.drift(inertia, time / f64::from(steps));
    }
    now
}

fn tops() -> [(Vector3<f64>, Vector3<f64>); 4] {
    [
        (Vector3::new(1.0, 1.0, 2.0), Vector3::new(0.3, 0.0, 1.0)),
        (Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, 0.2, 1.0)),
        // Rotation about the intermediate axis, which is unstable.
        (Vector3::new(1.0, 2.0, 3.0), Vector3::new(1e-3, 1.0, 1e-3)),
        // A rod.
        (Vector3::new(0.01, 1.0, 1.01), Vector3::new(2.0, 0.7, 0.2)),
    ]
}

#[test]
fn a_symmetric_top_precesses_as_the_table_says() {
    let (inertia, spin) = tops()[0];
    let start = RotationState::new(UnitQuaternion::identity(), &spin, &inertia);
    // free_rigid_body.csv: t, w1, w2, q0 … q3.
    for (time, w1, w2, q) in [
        (
            2.0,
            -0.1248440510,
            0.2727892280,
            [0.5129643316, 0.0721145346, 0.1123117333, 0.8479700248],
        ),
        (
            10.0,
            -0.2517214587,
            -0.1632063333,
            [0.3822147917, -0.0266902308, 0.0902267257, -0.9192707014],
        ),
        (
            20.0,
            0.1224246185,
            0.2738835752,
            [-0.6915419819, -0.1220704493, -0.0791456975, -0.7075340636],
        ),
    ] {
        let exact = symmetric(&start, &inertia, time);
        let table =
            UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]));
        assert!(exact.angle_to(&table) < 1e-9, "the formula is the table's");
        let steps = if time < 3.0 {
            200
        } else if time < 11.0 {
            1000
        } else {
            2000
        };
        let now = turned(&start, &inertia, time, steps);
        let body = body_spin(&now, &inertia);
        assert_relative_eq!(body.x, w1, epsilon = 1e-3);
        assert_relative_eq!(body.y, w2, epsilon = 1e-3);
        assert!(now.orientation.angle_to(&table) < 2e-3);
    }
}

#[test]
fn tops_keep_momentum_to_the_bit_and_energy_without_drift() {
    for (inertia, spin) in tops() {
        let start = RotationState::new(
            UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3),
            &spin,
            &inertia,
        );
        let energy = start.energy(&inertia);
        let mut now = start;
        let mut worst = [0.0_f64; 2];
        for step in 0..6000 {
            now.drift(&inertia, 0.01);
            let off = (now.energy(&inertia) / energy - 1.0).abs();
            let half = usize::from(step >= 3000);
            worst[half] = worst[half].max(off);
            assert!((now.orientation.quaternion().norm() - 1.0).abs() < 1e-15);
        }
        assert_eq!(now.angular_momentum, start.angular_momentum);
        println!("I {:?}: energy off by {worst:?}", inertia.as_slice());
        assert!(worst[0] < 1e-4, "{worst:?}");
        assert!(worst[1] < 1.2 * worst[0] + 1e-12, "drifts: {worst:?}");
    }
}

#[test]
fn the_order_is_two() {
    for (inertia, spin) in tops() {
        let start = RotationState::new(UnitQuaternion::identity(), &spin, &inertia);
        let time = 4.0;
        let exact = if (inertia.x - inertia.y).abs() < 1e-12 {
            symmetric(&start, &inertia, time)
        } else {
            // Extrapolated from two fine runs of an even method: fourth order.
            let [coarse, fine] =
                [20_000, 40_000].map(|steps| turned(&start, &inertia, time, steps).orientation);
            let off = coarse.rotation_to(&fine).scaled_axis() / 3.0;
            UnitQuaternion::from_scaled_axis(off) * fine
        };
        let errors = [100, 200, 400, 800].map(|steps| {
            turned(&start, &inertia, time, steps)
                .orientation
                .angle_to(&exact)
        });
        let orders = [0, 1, 2].map(|k| (errors[k] / errors[k + 1]).log2());
        println!(
            "I {:?}: errors {errors:?} orders {orders:?}",
            inertia.as_slice()
        );
        assert!(orders.iter().all(|&o| o > 1.9 && o < 2.2), "{orders:?}");
    }
}

#[test]
fn orientation_at_the_target_step() {
    let (inertia, spin) = tops()[0];
    let start = RotationState::new(UnitQuaternion::identity(), &spin, &inertia);
    let now = turned(&start, &inertia, 60.0, 6000);
    let off = now.orientation.angle_to(&symmetric(&start, &inertia, 60.0));
    println!("orientation off by {off:e} after 60 s");
    assert!(off < 1e-2);
}

#[test]
fn time_runs_back() {
    for (inertia, spin) in tops() {
        let start = RotationState::new(UnitQuaternion::identity(), &spin, &inertia);
        let mut now = turned(&start, &inertia, 5.0, 500);
        now = turned(&now, &inertia, -5.0, 500);
        assert!(now.orientation.angle_to(&start.orientation) < 1e-12);
    }
}

#[test]
fn damping_by_mass_decays_as_the_exponential() {
    let inertia = Vector3::new(1.0, 2.0, 3.0);
    let spin = Vector3::new(0.3, 0.2, 1.0);
    let mut now = RotationState::new(UnitQuaternion::identity(), &spin, &inertia);
    let start = now.angular_momentum;
    let damping = Damping::new(0.5, 0.005);
    let moment = Vector3::new(0.0, 0.0, 0.7);
    for _ in 0..400 {
        now.kick(&moment, &damping);
        now.drift(&inertia, 0.01);
        now.kick(&moment, &damping);
    }
    // dL/dt = M - alpha L.
    let decay = (-0.5_f64 * 4.0).exp();
    let exact = start * decay + moment * ((1.0 - decay) / 0.5);
    assert_relative_eq!(now.angular_momentum, exact, epsilon = 1e-12);
    let none = Damping::new(0.0, 0.005);
    assert_relative_eq!(
        none.kick(&start, &moment),
        start + moment * 0.005,
        epsilon = 1e-15
    );
}
