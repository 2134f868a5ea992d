//! Tests of pictures.

use super::*;
use base::number::whole;

fn moments(times: &[f64]) -> Vec<OutputTime> {
    (0..)
        .zip(times)
        .map(|(step, &time)| OutputTime { step, time })
        .collect()
}

#[test]
fn numbers_are_short_at_every_size() {
    let three = [
        0.0,
        1e-5,
        0.000_123_4,
        0.001_234,
        0.05,
        0.5,
        12.34,
        6.0,
        -11_710.0,
        21_250.0,
        2.5e7,
    ];
    let texts = [
        "0", "1e-5", "1.23e-4", "0.00123", "0.05", "0.5", "12.3", "6", "-11710", "21250", "2.5e7",
    ];
    assert_eq!(three.map(|value| significant_digits(value, 3)), texts);
    assert_eq!(significant_digits(0.300_112, 4), "0.3001");
}

#[test]
fn times_are_the_nearest_or_spread_over_the_run() {
    let all = moments(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let steps =
        |times: &[f64]| -> Vec<u64> { choose(&all, times).iter().map(|m| m.step).collect() };
    assert_eq!(steps(&[]), [0, 2, 4, 6]);
    assert_eq!(steps(&[2.4, 2.6, 99.0]), [2, 3, 6]);
    assert_eq!(choose(&moments(&[0.5]), &[]).len(), 1);
}

/// Axis of a plot.
pub(super) fn square() -> Scene {
    let corner = |x: f64| [x, x, 0.0];
    Scene {
        grains: Some(Grains {
            positions: vec![corner(1.0), corner(9.0)],
            radii: vec![1.0; 2],
            values: None,
            quantity: String::new(),
            units: String::new(),
            arrows: None,
            flat: true,
        }),
        ..Scene::default()
    }
}

#[test]
fn a_disc_covers_its_pixels_and_the_nearer_sphere_wins() {
    let scene = |grains| Scene {
        grains: Some(grains),
        ..Scene::default()
    };
    let grains = Grains {
        positions: vec![[0.0, 0.0, 0.0], [0.0, 0.0, 5.0]],
        radii: vec![2.0, 1.0],
        values: Some(vec![0.0, 1.0]),
        quantity: "speed".into(),
        units: "m/s".into(),
        arrows: None,
        flat: false,
    };
    let scenes = [scene(grains)];
    let frame = Frame::new(&scenes, ViewDirection::Z);
    assert_eq!((frame.low, frame.high), ([-2.0; 2], [2.0; 2]));
    let mut raster = Raster::new(&frame, 720);
    // The near one first: the far one must not paint over it.
    raster.grain(&frame, [0.0, 0.0, 5.0], 1.0, [200.0, 0.0, 0.0], false);
    raster.grain(&frame, [0.0, 0.0, 0.0], 2.0, [0.0, 200.0, 0.0], false);
    let at = |x: f64, y: f64| {
        let column = whole((x + 2.0) / raster.pixel);
        let row = whole((2.0 - y) / raster.pixel);
        raster.colours[row * raster.width + column]
    };
    assert!(at(0.0, 0.0)[0] > 100.0 && at(0.0, 0.0)[1] == 0.0);
    assert!(at(1.5, 0.0)[1] > 50.0 && at(1.5, 0.0)[0] == 0.0);
    assert_eq!(at(1.99, 1.99), PAPER);
    let covered = raster.colours.iter().filter(|c| **c != PAPER).count();
    let part = real(covered) / real(raster.colours.len());
    assert!((part - std::f64::consts::PI / 4.0).abs() < 2e-3, "{part}");
}

#[test]
fn every_view_is_a_right_handed_frame() {
    for view in [
        ViewDirection::X,
        ViewDirection::Y,
        ViewDirection::Z,
        ViewDirection::Corner,
    ] {
        let ball = Grains {
            positions: vec![[0.0, 0.0, 1.0]],
            radii: vec![1.0],
            values: None,
            quantity: String::new(),
            units: String::new(),
            arrows: None,
            flat: false,
        };
        let f = Frame::new(
            &[Scene {
                grains: Some(ball),
                ..Scene::default()
            }],
            view,
        );
        for v in [f.right, f.up, f.near] {
            assert!((dot(v, v) - 1.0).abs() < 1e-12, "{view:?}");
        }
        assert!(dot(f.right, f.up).abs() < 1e-12 && dot(f.up, f.near).abs() < 1e-12);
        let cross = [
            f.right[1] * f.up[2] - f.right[2] * f.up[1],
            f.right[2] * f.up[0] - f.right[0] * f.up[2],
            f.right[0] * f.up[1] - f.right[1] * f.up[0],
        ];
        assert!(
            (dot(cross, f.near) - 1.0).abs() < 1e-12,
            "{view:?} {cross:?}"
        );
    }
}

#[test]
fn a_scale_bar_is_a_round_length() {
    assert!((round_length(0.0084) - 0.001).abs() < 1e-12);
    assert!((round_length(1.3) - 0.2).abs() < 1e-12);
    assert!((round_length(30.0) - 5.0).abs() < 1e-12);
}
