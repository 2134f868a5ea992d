//! A closed joint under a pulse at its mouth: transfer function, wave speed, conservation, cavitation.

use super::steady::{Fronts, boxes, rocks, settings, water};
use crate::flow::{FlowSettings, JointFlow};
use crate::network::Network;
use crate::water::{Mixture, VAPOUR};
use nalgebra::{Complex, Vector3};
use std::f64::consts::PI;

/// Length of the joint \[m\].
const LENGTH: f64 = 1.0;

/// Returns a joint with one row of cells between two slabs.
fn slabs(aperture: f64, cell: f64) -> Network {
    let solids = boxes(&[
        [[0.0, 0.0, 0.0], [LENGTH, cell, 0.1]],
        [[0.0, 0.0, 0.1 + aperture], [LENGTH, cell, 0.2]],
    ]);
    Network::new(&rocks(&solids), &settings(cell * 1.0001))
}

/// Returns water of 1000 kg/m³ and 1e-6 m²/s with this wave speed [m/s].
fn water_of(speed: f64) -> FlowSettings {
    let mut settings = water();
    settings.inertia = true;
    settings.water.bulk_modulus = 1000.0 * speed * speed;
    settings
}

/// Returns the pressure of a pulse at the mouth \[Pa\].
fn pulse(time: f64, duration: f64) -> f64 {
    if (0.0..duration).contains(&time) {
        (PI * time / duration).sin().powi(2)
    } else {
        0.0
    }
}

/// Returns the time step and the pressures at the mouth and at the end of the joint under a pulse.
fn response(aperture: f64, speed: f64, periods: u32, steps: u32) -> (f64, Vec<[f64; 2]>) {
    let network = slabs(aperture, LENGTH / 50.0);
    let last = network.cells.len() - 1;
    assert_eq!(network.cells.len(), 50);
    let end = (0..=last).max_by(|&a, &b| network.positions[a].x.total_cmp(&network.positions[b].x));
    let end = end.unwrap();
    let period = 4.0 * LENGTH / speed;
    let drive = Fronts::new(&network, move |at, time| {
        (at.x < 1e-9).then(|| pulse(time, period))
    });
    let mut flow = JointFlow::new(network, water_of(speed));
    let step = period / f64::from(steps);
    let mut record = vec![[0.0; 2]];
    for k in 0..periods * steps {
        let time = step * f64::from(k);
        flow.advance(&drive, time, step).unwrap();
        record.push([pulse(time + step, period), flow.pressures()[end]]);
    }
    (step, record)
}

/// Returns the transfer function of a record at a frequency \[Hz\].
fn transfer(step: f64, record: &[[f64; 2]], frequency: f64) -> Complex<f64> {
    let mut sums = [Complex::new(0.0, 0.0); 2];
    for (k, row) in (0_u32..).zip(record) {
        let turn = Complex::new(0.0, -2.0 * PI * frequency * step * f64::from(k)).exp();
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += turn * *value;
        }
    }
    sums[1] / sums[0]
}

/// Returns the transfer function of the exact laminar layer: 1/cosh(G L) with
/// G = (i w/c)/sqrt(1 - tanh(s)/s), s² = i w a²/(4 nu).
fn exact(aperture: f64, speed: f64, frequency: f64) -> Complex<f64> {
    let turn = Complex::new(0.0, 2.0 * PI * frequency);
    let root = (turn * (aperture * aperture / 4e-6)).sqrt();
    let one = Complex::new(1.0, 0.0);
    one / (turn * (LENGTH / speed) / (one - root.tanh() / root).sqrt()).cosh()
}

#[test]
fn the_transfer_function_of_a_closed_joint_is_that_of_the_exact_layer() {
    // Aperture, speed of waves, peak over f0 = c/4L and its height (zero: none), heights at f0/2 and f0.
    let rows = [
        (0.1e-3, 1000.0, 0.840, 1.814, 1.3418, 1.6423, 20),
        (0.3e-3, 100.0, 0.822, 1.647, 1.3069, 1.4918, 20),
        (0.3e-3, 1000.0, 0.942, 9.157, 1.4993, 6.9226, 50),
        (1e-3, 100.0, 0.944, 9.731, 1.4964, 7.3306, 50),
        (1e-3, 1000.0, 0.982, 34.10, 1.4423, 24.57, 160),
    ];
    for (aperture, speed, place, peak, half, full, periods) in rows {
        let (step, record) = response(aperture, speed, periods, 128);
        let resonance = speed / (4.0 * LENGTH);
        for (part, height) in [(0.5, half), (1.0, full), (place, peak)] {
            let found = transfer(step, &record, part * resonance);
            let exact = exact(aperture, speed, part * resonance);
            println!(
                "{} mm, {speed} m/s, f/f0 {part}: {:.4}, exact {:.4}, published {height}; phase {:.4}, exact {:.4}",
                1e3 * aperture,
                found.norm(),
                exact.norm(),
                found.arg(),
                exact.arg()
            );
            assert!((exact.norm() / height - 1.0).abs() < 2e-3);
            assert!((found - exact).norm() < 0.02 * exact.norm());
        }
        // The peak is searched for over a range of frequencies.
        let found = (600..1100).map(|k| {
            let part = f64::from(k) / 1000.0;
            (transfer(step, &record, part * resonance).norm(), part)
        });
        let (height, at) = found.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        println!("    peak {height:.3} at {at}");
        assert!((height / peak - 1.0).abs() < 0.02 && (at / place - 1.0).abs() < 0.005);
    }
}

#[test]
fn waves_run_with_the_speed_of_the_content_of_air() {
    for air in [0.0, 1e-3, 1e-2, 0.1] {
        let network = slabs(5e-3, LENGTH / 200.0);
        let count = network.cells.len();
        let end =
            (0..count).max_by(|&a, &b| network.positions[a].x.total_cmp(&network.positions[b].x));
        let end = end.unwrap();
        let mut settings = water();
        settings.inertia = true;
        settings.water.air = air;
        settings.water.vapour = 0.0;
        let speed = settings.water.wave_speed(0.0);
        // A front that rises within a tenth of the time to the end, so small that the air is linear.
        let rise = 0.1 * LENGTH / speed;
        let front = move |time: f64| (time / rise).clamp(0.0, 1.0);
        let drive = Fronts::new(&network, move |at, time| (at.x < 1e-9).then(|| front(time)));
        let mut flow = JointFlow::new(network, settings);
        let step = rise / 20.0;
        // The end reflects: its pressure passes 1 as the middle of the front arrives.
        let mut before = 0.0;
        let mut arrived = None;
        for k in 0..400 {
            flow.advance(&drive, step * f64::from(k), step).unwrap();
            let now = flow.pressures()[end];
            if before < 1.0 && now >= 1.0 {
                arrived = Some(step * (f64::from(k) + (1.0 - before) / (now - before)));
                break;
            }
            before = now;
        }
        let found = LENGTH / (arrived.unwrap() - 0.5 * rise);
        println!("air {air}: {found:.2} m/s, formula {speed:.2} m/s");
        assert!((found / speed - 1.0).abs() < 0.01);
    }
}

#[test]
fn a_joint_that_opens_fast_is_held_by_suction_down_to_the_vapour_pressure() {
    use crate::flow::Drive;
    use crate::polygon::LinearField;
    struct Opening<F>(Fronts<F>);
    impl<F: Fn(&Vector3<f64>, f64) -> Option<f64>> Drive for Opening<F> {
        fn pressure(&self, open: usize, time: f64) -> Option<f64> {
            self.0.pressure(open, time)
        }
        fn gap(&self, _joint: usize, time: f64) -> Option<LinearField> {
            Some(LinearField {
                constant: 1e-4 + 0.5 * time,
                ..LinearField::default()
            })
        }
    }
    let network = slabs(1e-4, LENGTH / 20.0);
    let drive = Opening(Fronts::new(&network, |at, _| (at.x < 1e-9).then_some(0.0)));
    for inertia in [false, true] {
        let mut settings = water();
        settings.inertia = inertia;
        let mut flow = JointFlow::new(network.clone(), settings);
        let limit = settings.water.vapour_gauge();
        let (mut entered, before) = (0.0, flow.stored());
        let mut least = 0.0_f64;
        let step = 2e-5;
        for k in 0..100 {
            let report = flow.advance(&drive, step * f64::from(k), step).unwrap();
            entered += report.entered;
            least = flow.pressures().iter().fold(least, |m, p| m.min(*p));
        }
        // The volume grows eleven-fold.
        println!(
            "inertia {inertia}: least {least:.1} Pa, vapour {limit:.1} Pa, entered {entered:e} m³"
        );
        assert!(least < limit && least > limit - VAPOUR);
        assert!((flow.stored() - before - entered).abs() < 1e-10 * before);
        // Vapour fills the volume that water could not fill.
        assert!(entered < 0.5 * 10.0 * before);
    }
}

#[test]
fn a_state_that_is_restored_goes_on_with_the_same_bits() {
    let network = slabs(5e-4, LENGTH / 20.0);
    let drive = Fronts::new(&network, |at, time| {
        (at.x < 1e-9).then(|| 1e3 * (300.0 * time).sin())
    });
    let mut settings = water();
    settings.inertia = true;
    settings.roughness = Some(1e-4);
    settings.water.air = 0.01;
    let mut whole = JointFlow::new(network.clone(), settings);
    let mut state = Vec::new();
    for k in 0..60 {
        whole.advance(&drive, 1e-4 * f64::from(k), 1e-4).unwrap();
        if k == 29 {
            state = whole.state();
        }
    }
    let mut second = JointFlow::new(network, settings);
    assert!(!second.restore(&state[1..]) && second.restore(&state));
    for k in 30..60 {
        second.advance(&drive, 1e-4 * f64::from(k), 1e-4).unwrap();
    }
    assert_eq!(whole.state(), second.state());
    assert!(Mixture::default().air == 0.0);
}
