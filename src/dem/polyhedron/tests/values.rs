//! Contacts of cubes with known values (validation 4.9, polyhedra_contacts.csv), spheres, planes.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4};

use approx::assert_relative_eq;
use nalgebra::{UnitQuaternion, Vector3};

use super::super::force::Approach;
use super::super::linear_program::{NO_BASIS, Verdict, solve};
use super::super::{
    BlockContactModel, BlockHistory, BlockPairLaw, HalfSpace, Narrow, Polyhedron, Stiffness,
    penetration,
};
use super::{between, direction, placed, random_hull, random_orientation};
use base::random::Stream;

struct Case {
    name: &'static str,
    orientations: [UnitQuaternion<f64>; 2],
    separation: Vector3<f64>,
    depth: f64,
    centre: Vector3<f64>,
    volume: f64,
    centroid: Vector3<f64>,
}

fn cases() -> Vec<Case> {
    let none = UnitQuaternion::identity();
    let about = |axis: Vector3<f64>, angle| UnitQuaternion::from_scaled_axis(axis * angle);
    let x = |x| Vector3::new(x, 0.0, 0.0);
    // A corner of the cube turned towards -x.
    let corner =
        UnitQuaternion::rotation_between(&Vector3::new(-1.0, -1.0, -1.0), &-Vector3::x()).unwrap();
    vec![
        Case {
            name: "face on face",
            orientations: [none, none],
            separation: x(0.98),
            depth: 0.01,
            centre: x(0.49),
            volume: 0.02,
            centroid: x(0.49),
        },
        Case {
            name: "face on face, offset",
            orientations: [none, none],
            separation: Vector3::new(0.98, 0.3, 0.1),
            depth: 0.01,
            centre: Vector3::new(0.49, 0.15, 0.05),
            volume: 0.0126,
            centroid: Vector3::new(0.49, 0.15, 0.05),
        },
        Case {
            name: "vertex into face",
            orientations: [none, corner],
            separation: x(0.48 + 0.75_f64.sqrt()),
            depth: 0.007320508,
            centre: x(0.494986059),
            volume: 6.928e-6,
            centroid: x(0.495),
        },
        Case {
            name: "edge on edge",
            orientations: [
                about(Vector3::z(), FRAC_PI_4),
                about(Vector3::y(), FRAC_PI_4),
            ],
            separation: x(2.0 * FRAC_1_SQRT_2 - 0.02),
            depth: 0.007071068,
            centre: x(0.697106781),
            volume: 5.333e-6,
            centroid: x(0.697106781),
        },
        Case {
            name: "edge into face",
            orientations: [none, about(Vector3::z(), FRAC_PI_4)],
            separation: x(0.48 + FRAC_1_SQRT_2),
            depth: 0.008284271,
            centre: x(0.493320849),
            volume: 4e-4,
            centroid: x(0.493333333),
        },
    ]
}

/// Returns the half-spaces of both, in space about the first's centre.
pub(super) fn together(
    shapes: [&Polyhedron; 2],
    orientations: &[UnitQuaternion<f64>; 2],
    separation: &Vector3<f64>,
) -> Vec<HalfSpace> {
    let mut planes = Vec::new();
    for (k, shape) in shapes.into_iter().enumerate() {
        let place = if k == 0 {
            Vector3::zeros()
        } else {
            *separation
        };
        for plane in shape.half_spaces() {
            let normal = orientations[k] * plane.normal;
            planes.push(HalfSpace {
                normal,
                offset: plane.offset + normal.dot(&place),
            });
        }
    }
    planes
}

#[test]
fn cubes_touch_where_the_table_says() {
    let cube = Polyhedron::cuboid(Vector3::new(1.0, 1.0, 1.0)).unwrap();
    let mut narrow = Narrow::default();
    for case in cases() {
        let name = case.name;
        let planes = together([&cube, &cube], &case.orientations, &case.separation);
        let Verdict::Overlap { point, depth } = solve(&planes, 6, 4.0, &mut NO_BASIS.clone())
        else {
            panic!("{name}: no overlap");
        };
        assert_relative_eq!(depth, case.depth, epsilon = 1e-9);
        assert!(
            planes
                .iter()
                .all(|plane| plane.height(&point) < -depth + 1e-12)
        );
        let [one, two] = [0, 1].map(|k| placed(&cube, &case.orientations[k]));
        let published = BlockContactModel::Point { rounding: 0.05 };
        let touch = narrow
            .blocks(
                &one,
                &two,
                &case.separation,
                &published,
                &mut BlockHistory::default(),
            )
            .unwrap();
        assert_relative_eq!(touch.arm, case.centre, epsilon = 1e-9);
        assert_relative_eq!(touch.normal, Vector3::x(), epsilon = 1e-9);
        assert_relative_eq!(touch.depth, 0.02, epsilon = 1e-9);
        let touch = narrow
            .blocks(
                &one,
                &two,
                &case.separation,
                &BlockContactModel::Patch,
                &mut BlockHistory::default(),
            )
            .unwrap();
        assert_relative_eq!(touch.arm, case.centroid, epsilon = 2e-9);
        // Offset, the surfaces at the sides tilt the vector area by the overlap over the width.
        let tilt = if name.contains("offset") { 0.03 } else { 1e-9 };
        assert_relative_eq!(touch.normal, Vector3::x(), epsilon = tilt);
        let tolerance = if name.contains("offset") { 1e-9 } else { 1e-3 };
        assert_relative_eq!(
            touch.depth * touch.area,
            case.volume,
            max_relative = tolerance
        );
        assert!(touch.polar() > 0.0);
    }
    assert_eq!(narrow.method_counts.exhaustive, 0);
    assert_eq!(narrow.method_counts.off_centre, 0);
}

#[test]
fn a_gap_is_a_gap() {
    let cube = Polyhedron::cuboid(Vector3::new(1.0, 1.0, 1.0)).unwrap();
    let none = UnitQuaternion::identity();
    let mut narrow = Narrow::default();
    let mut history = BlockHistory::default();
    let look = |narrow: &mut Narrow, history: &mut BlockHistory, x| {
        let cube = placed(&cube, &none);
        narrow.blocks(
            &cube,
            &cube,
            &Vector3::new(x, 0.0, 0.0),
            &BlockContactModel::Patch,
            history,
        )
    };
    assert!(look(&mut narrow, &mut history, 1.01).is_none());
    assert_eq!(narrow.method_counts.programs, 1);
    // The axis is stored: no linear program is solved until the axis no longer separates the blocks.
    assert!(look(&mut narrow, &mut history, 1.000001).is_none());
    assert_eq!(narrow.method_counts.programs, 1);
    assert!(look(&mut narrow, &mut history, 0.999999).is_some());
    assert_eq!(narrow.method_counts.programs, 2);
    // Exact touching is not a contact.
    assert!(look(&mut narrow, &mut history, 1.0).is_none());
}

/// Checks that blocks that coincide, nearly coincide or lie within each other have a finite depth: the surface of the
/// inner block is closed and has no vector area to divide by.
#[test]
fn a_block_within_a_block_has_a_finite_depth() {
    let cube = Polyhedron::cuboid(Vector3::repeat(1.0)).unwrap();
    let inner = Polyhedron::cuboid(Vector3::repeat(0.5)).unwrap();
    let none = UnitQuaternion::identity();
    for (second, shift, way) in [
        (&cube, 0.0, 1.0),
        (&cube, 1e-12, 1.0),
        (&inner, 0.0, 0.75),
        (&inner, 0.1, 0.65),
    ] {
        let separation = Vector3::new(shift, 0.0, 0.0);
        for [a, b] in [[&cube, second], [second, &cube]] {
            let (a, b) = (placed(a, &none), placed(b, &none));
            let found = penetration(&a, &b, &separation);
            assert!((found - way).abs() < 1e-11, "{shift}: {found} {way}");
            for model in [BlockContactModel::Patch, BlockContactModel::Pressure] {
                let history = &mut BlockHistory::default();
                let touch = Narrow::default().blocks(&a, &b, &separation, &model, history);
                let depth = touch.unwrap().depth;
                assert!(depth > 0.0 && depth < 100.0, "{model:?} {shift}: {depth}");
            }
        }
    }
}

#[test]
fn thin_overlaps_have_a_centre() {
    // Face on face, turned in space, from a percent of the width down to rounding.
    let cube = Polyhedron::cuboid(Vector3::new(1.0, 1.0, 1.0)).unwrap();
    let plate = Polyhedron::cuboid(Vector3::new(2.0, 1.5, 1e-3)).unwrap();
    let mut narrow = Narrow::default();
    for id in 0..40 {
        let mut draw = Stream::new(5, id, 0);
        let turn = random_orientation(&mut draw);
        let about = UnitQuaternion::from_scaled_axis(Vector3::z() * between(&mut draw, -1.0, 1.0));
        for overlap in [1e-3, 1e-6, 1e-9, 1e-12] {
            if overlap > 0.5e-3 {
                continue;
            }
            let (x, y) = (between(&mut draw, -0.3, 0.3), between(&mut draw, -0.2, 0.2));
            let separation = turn * Vector3::new(x, y, 0.5005 - overlap);
            let (one, two) = (turn, turn * about);
            let mut history = BlockHistory::default();
            let touch = narrow
                .blocks(
                    &placed(&cube, &one),
                    &placed(&plate, &two),
                    &separation,
                    &BlockContactModel::Point { rounding: 1e-4 },
                    &mut history,
                )
                .unwrap();
            assert_relative_eq!(touch.normal, turn * Vector3::z(), epsilon = 1e-9);
            assert_relative_eq!(touch.depth, overlap, epsilon = 1e-15, max_relative = 1e-6);
            // The centre between planes that do not depend on the overlap.
            let flat = turn.inverse() * touch.arm;
            assert!(flat.x.abs() < 0.5 && flat.y.abs() < 0.5, "{flat:?}");
        }
    }
    assert_eq!(narrow.method_counts.off_centre, 0);
    assert_eq!(narrow.method_counts.exhaustive, 0);
}

#[test]
fn a_block_on_a_plane_is_a_bed_of_springs() {
    let size = Vector3::new(1.0, 0.8, 0.6);
    let cuboid = Polyhedron::cuboid(size).unwrap();
    let mut narrow = Narrow::default();
    let up = Vector3::z();
    for tilt in [0.0, 1e-6, -3e-4, 0.01, 0.1] {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::y() * tilt);
        let block = placed(&cuboid, &turn);
        for depth in [1e-3, 1e-5] {
            let height = 0.3 - depth;
            let touch = narrow
                .plane(
                    &block,
                    &up,
                    height,
                    &BlockContactModel::Patch,
                    &mut BlockHistory::default(),
                )
                .unwrap();
            // The integral of the depth under the plane over the bottom, and over the plane.
            let (sin, cos) = (tilt.sin(), tilt.cos());
            let n: i32 = 4000;
            let (mut volume, mut moment) = (0.0, 0.0);
            for k in 0..n {
                let s = (f64::from(k) + 0.5) / f64::from(n) - 0.5;
                // A strip of the bottom.
                let z = height - sin * s - cos * 0.3;
                let x = cos * s - sin * 0.3;
                if z < 0.0 {
                    let part = -z * 0.8 / f64::from(n);
                    volume += part * cos;
                    moment += part * cos * x;
                }
            }
            if tilt.abs() < 0.005 {
                assert_relative_eq!(touch.depth * touch.area, volume, max_relative = 1e-3);
                assert_relative_eq!(touch.arm.x, moment / volume, epsilon = 1e-3);
            }
            assert_relative_eq!(touch.normal, -up, epsilon = 1e-15);
            let point = narrow
                .plane(
                    &block,
                    &up,
                    height,
                    &BlockContactModel::Point { rounding: 1e-2 },
                    &mut BlockHistory::default(),
                )
                .unwrap();
            assert!(point.depth > 0.0 && point.normal.z < -0.9);
        }
        assert!(
            narrow
                .plane(
                    &block,
                    &up,
                    0.6,
                    &BlockContactModel::Patch,
                    &mut BlockHistory::default()
                )
                .is_none()
        );
    }
}

#[test]
fn spheres_touch_the_closest_point() {
    let cuboid = Polyhedron::cuboid(Vector3::new(2.0, 2.0, 2.0)).unwrap();
    let narrow = Narrow::default();
    let none = UnitQuaternion::identity();
    let block = placed(&cuboid, &none);
    for (centre, distance) in [
        ([1.3, 0.2, 0.1], 0.3),
        ([1.3, 1.4, 0.1], 0.5),
        ([1.1, -1.2, 1.2], 0.3),
        ([0.9, 0.0, 0.0], -0.1),
    ] {
        let at = Vector3::from(centre);
        let touch = narrow.sphere(&block, &at, 0.6).unwrap();
        assert_relative_eq!(touch.depth, 0.6 - distance, epsilon = 1e-12);
        let foot = touch.arm + touch.normal * (0.5 * touch.depth);
        assert_relative_eq!(foot + touch.normal * distance, at, epsilon = 1e-12);
        if distance > 0.0 {
            assert!(narrow.sphere(&block, &at, distance - 1e-9).is_none());
        }
    }
    // Compared with many points on the surface.
    for id in 0..20 {
        let mut draw = Stream::new(8, id, 0);
        let shape = random_hull(&mut draw, 10);
        let turn = random_orientation(&mut draw);
        let block = placed(&shape, &turn);
        let centre = direction(&mut draw) * between(&mut draw, 1.0, 1.6);
        let mut best = f64::INFINITY;
        for face in 0..shape.half_spaces().len() {
            let corners = shape.face(face);
            for k in 1..corners.len() - 1 {
                let t = [0, k, k + 1].map(|k| turn * shape.vertices()[corners[k] as usize]);
                for i in 0..=60 {
                    for j in 0..=60 - i {
                        let (a, b) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                        let p = t[0] * a + t[1] * b + t[2] * (1.0 - a - b);
                        best = best.min((p - centre).norm());
                    }
                }
            }
        }
        let touch = narrow.sphere(&block, &centre, 2.0).unwrap();
        let distance = 2.0 - touch.depth;
        assert!(
            distance <= best + 1e-12 && distance > best - 0.02,
            "{distance} {best}"
        );
    }
}

/// Checks a box on its edge, a strip of length L: the dashpots resist a rotation normal to the edge like a beam, with
/// c_n L²/12, but hardly a rotation about the edge, because the strip has almost no width.
#[test]
fn a_block_turns_freely_about_its_edge() {
    let (length, depth, tilt) = (0.4, 1e-5, 0.3);
    let shape = Polyhedron::cuboid(Vector3::new(0.2, length, 0.5)).unwrap();
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt);
    let block = placed(&shape, &turn);
    let below = shape.support(&(turn.inverse() * -Vector3::z())).1;
    let law = |damping| BlockPairLaw {
        stiffness: Stiffness::PerContact {
            normal: 1e8,
            shear: 1e8,
        },
        friction: 0.5,
        normal_damping_ratio: damping,
        shear_damping_ratio: 0.0,
    };
    let mut narrow = Narrow::default();
    let mut history = BlockHistory::default();
    let touch = narrow
        .plane(
            &block,
            &Vector3::z(),
            below - depth,
            &BlockContactModel::Patch,
            &mut history,
        )
        .unwrap();
    // The bottom and the side cut the plane at a right angle: the strip is between their feet.
    let width = depth / tilt.tan() + depth * tilt.tan();
    let dashpot = 2.0 * 0.3 * (100.0_f64 * 1e8).sqrt();
    let resisting = |spin: Vector3<f64>| {
        let approach = Approach {
            // The contact point is stationary.
            velocity: spin.cross(&touch.arm),
            spins: [spin, Vector3::zeros()],
            separation: Vector3::new(0.0, 0.0, depth - below),
            mass: 100.0,
            time_step: 1e-6,
            part: 1.0,
            damped: 1.0,
        };
        let [with, without] = [0.3, 0.0].map(|damping| {
            let mut history = BlockHistory::default();
            law(damping).act(&touch, &mut history, &approach).on_first
        });
        with - without
    };
    let across = resisting(Vector3::new(1e-3, 0.0, 0.0));
    let beam = Vector3::new(-1e-3 * dashpot * length * length / 12.0, 0.0, 0.0);
    assert_relative_eq!(across, beam, max_relative = 1e-6);
    let about = resisting(Vector3::new(0.0, 1e-3, 0.0)).norm();
    assert!(about <= 1e-3 * dashpot * width * width, "{about:e}");
}
