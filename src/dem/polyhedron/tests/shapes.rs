//! Shapes from vertices, half-spaces, boxes and triangles.

use approx::assert_relative_eq;
use nalgebra::{UnitQuaternion, Vector3};

use super::super::{HalfSpace, PlacedPolyhedron, Polyhedron, ShapeError};
use super::{between, random_hull, random_orientation};
use base::random::Stream;

/// Returns the triangles of a solid in its position.
fn triangles(solid: &PlacedPolyhedron) -> Vec<[Vector3<f64>; 3]> {
    let at = |v: u32| solid.position + solid.orientation * solid.shape.vertices()[v as usize];
    let mut found = Vec::new();
    for face in 0..solid.shape.half_spaces().len() {
        let corners = solid.shape.face(face);
        for k in 1..corners.len() - 1 {
            found.push([at(corners[0]), at(corners[k]), at(corners[k + 1])]);
        }
    }
    found
}

/// Checks Euler's formula, planes through vertices, the centroid at the origin.
fn check(shape: &Polyhedron) {
    let (v, e, f) = (
        shape.vertices().len(),
        shape.edges().len(),
        shape.half_spaces().len(),
    );
    assert_eq!(v + f, e + 2, "{v} vertices, {e} edges, {f} faces");
    let size = shape.radius();
    for (face, plane) in shape.half_spaces().iter().enumerate() {
        assert_relative_eq!(plane.normal.norm(), 1.0, epsilon = 1e-14);
        for &corner in shape.face(face) {
            let height = plane.height(&shape.vertices()[corner as usize]);
            assert!(height.abs() < 1e-10 * size, "{height:e}");
        }
        for vertex in shape.vertices() {
            assert!(plane.height(vertex) < 1e-10 * size);
        }
    }
}

#[test]
fn a_box_is_a_box_from_all_sides() {
    let edges = Vector3::new(0.3, 2.0, 1.1);
    let cuboid = Polyhedron::cuboid(edges).unwrap();
    check(&cuboid);
    assert_relative_eq!(cuboid.volume(), 0.66, epsilon = 1e-14);
    let expected = Vector3::new(4.0 + 1.21, 0.09 + 1.21, 0.09 + 4.0) * (0.66 * 2600.0 / 12.0);
    assert_relative_eq!(cuboid.inertia(2600.0), expected, max_relative = 1e-13);

    // Turned, and a thousand kilometres away.
    let turn = UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0);
    let place = Vector3::new(1e6, -2e5, 3e3);
    for (from, tolerance) in [(Vector3::zeros(), 1e-12), (place, 1e-8)] {
        let moved: Vec<Vector3<f64>> = cuboid.vertices().iter().map(|v| from + turn * v).collect();
        let by_vertices = Polyhedron::from_vertices(&moved).unwrap();
        let by_planes = Polyhedron::from_half_spaces(&by_vertices.half_spaces()).unwrap();
        let by_triangles = Polyhedron::from_triangles(&triangles(&by_vertices)).unwrap();
        for solid in [by_vertices, by_planes, by_triangles] {
            check(&solid.shape);
            assert_eq!(solid.shape.vertices().len(), 8);
            assert_eq!(solid.shape.half_spaces().len(), 6);
            assert_relative_eq!(solid.position, from, epsilon = tolerance);
            assert_relative_eq!(solid.shape.volume(), 0.66, max_relative = tolerance);
            let mut moments = solid.shape.inertia(2600.0);
            let mut sorted = expected;
            moments.as_mut_slice().sort_by(f64::total_cmp);
            sorted.as_mut_slice().sort_by(f64::total_cmp);
            assert_relative_eq!(moments, sorted, max_relative = 10.0 * tolerance);
        }
    }
}

#[test]
fn a_tetrahedron_has_its_volume_and_principal_axes() {
    let corners = [
        Vector3::new(0.0, 0.0, 0.0),
        Vector3::new(1.0, 0.0, 0.0),
        Vector3::new(0.0, 2.0, 0.0),
        Vector3::new(0.0, 0.0, 3.0),
    ];
    let solid = Polyhedron::from_vertices(&corners).unwrap();
    check(&solid.shape);
    assert_relative_eq!(solid.shape.volume(), 1.0, epsilon = 1e-14);
    assert_relative_eq!(
        solid.position,
        Vector3::new(0.25, 0.5, 0.75),
        epsilon = 1e-14
    );
    // About the centroid: V/80 (L^2) on the diagonal of second moments times 3, -V/80 L_i L_j off it.
    let lengths = Vector3::new(1.0, 2.0, 3.0);
    let mut second = -lengths * lengths.transpose() / 80.0;
    for k in 0..3 {
        second[(k, k)] = 3.0 * lengths[k] * lengths[k] / 80.0;
    }
    let inertia = nalgebra::Matrix3::identity() * second.trace() - second;
    let axes = solid.orientation.to_rotation_matrix().into_inner();
    let turned = axes.transpose() * inertia * axes;
    assert_relative_eq!(
        turned.diagonal(),
        solid.shape.inertia(1.0),
        max_relative = 1e-12
    );
    assert!(turned[(0, 1)].abs() < 1e-14 && turned[(1, 2)].abs() < 1e-14);
    assert_relative_eq!(axes.determinant(), 1.0, epsilon = 1e-14);
}

#[test]
fn random_hulls_survive_every_way_round() {
    for id in 0..60 {
        let mut draw = Stream::new(11, id, 0);
        let count = 4 + usize::try_from(id).unwrap() / 2;
        let shape = random_hull(&mut draw, count);
        check(&shape);
        assert!(shape.vertices().len() <= count);
        let solid = PlacedPolyhedron {
            orientation: random_orientation(&mut draw),
            position: Vector3::from_fn(|_, _| between(&mut draw, -9.0, 9.0)),
            shape,
        };
        let mut planes = solid.half_spaces();
        let again = Polyhedron::from_half_spaces(&planes).unwrap();
        assert_eq!(again.shape.vertices().len(), solid.shape.vertices().len());
        assert_relative_eq!(
            again.shape.volume(),
            solid.shape.volume(),
            max_relative = 1e-11
        );
        assert_relative_eq!(again.position, solid.position, epsilon = 1e-11);
        // A plane that cuts nothing off, and one twice, change nothing; normals need no unit length.
        planes.push(planes[0]);
        planes[1].normal *= 3.0;
        planes[1].offset *= 3.0;
        let far = planes[0].offset + 0.5;
        planes.push(HalfSpace {
            offset: far,
            ..planes[0]
        });
        let third = Polyhedron::from_half_spaces(&planes).unwrap();
        assert_eq!(
            third.shape.half_spaces().len(),
            again.shape.half_spaces().len()
        );
        // Triangles in the single precision of STL: 24 bits.
        let coarse: Vec<[Vector3<f64>; 3]> = triangles(&solid)
            .into_iter()
            .map(|t| t.map(|c| c.map(|x| x + 2_f64.powi(29) * x - 2_f64.powi(29) * x)))
            .collect();
        let stl = Polyhedron::from_triangles(&coarse).unwrap();
        check(&stl.shape);
        assert_relative_eq!(
            stl.shape.volume(),
            solid.shape.volume(),
            max_relative = 1e-4
        );
    }
}

#[test]
fn thin_and_long_blocks_are_blocks() {
    for edges in [[1.0, 1.0, 1e-4], [1e-4, 1e-4, 1.0], [10.0, 1.0, 1e-5]] {
        let plate = Polyhedron::cuboid(Vector3::from(edges)).unwrap();
        check(&plate);
        let turn = UnitQuaternion::from_euler_angles(0.7, 0.2, -0.4);
        let corners: Vec<Vector3<f64>> = plate.vertices().iter().map(|v| turn * v).collect();
        let again = Polyhedron::from_vertices(&corners).unwrap();
        assert_eq!(again.shape.half_spaces().len(), 6);
        assert_relative_eq!(again.shape.volume(), plate.volume(), max_relative = 1e-10);
    }
}

#[test]
fn a_ball_of_many_faces_has_nearly_the_volume_of_a_ball() {
    // Points on circles of latitude: many on one plane.
    let mut points = vec![Vector3::z(), -Vector3::z()];
    for i in 1..12 {
        let polar = std::f64::consts::PI * f64::from(i) / 12.0;
        for j in 0..12 {
            let around = std::f64::consts::TAU * f64::from(j) / 12.0;
            points.push(Vector3::new(
                polar.sin() * around.cos(),
                polar.sin() * around.sin(),
                polar.cos(),
            ));
        }
    }
    let ball = Polyhedron::from_vertices(&points).unwrap().shape;
    check(&ball);
    assert_eq!(ball.vertices().len(), points.len());
    let volume = 4.0 / 3.0 * std::f64::consts::PI;
    assert!(ball.volume() < volume && ball.volume() > 0.9 * volume);
}

#[test]
fn what_is_no_block_is_refused_with_a_reason() {
    let e = [Vector3::x(), Vector3::y(), Vector3::z()];
    let square = [Vector3::zeros(), e[0], e[1], e[0] + e[1]];
    assert!(matches!(
        Polyhedron::from_vertices(&square),
        Err(ShapeError::Flat { .. })
    ));
    assert!(matches!(
        Polyhedron::from_vertices(&square[..3]),
        Err(ShapeError::Few { .. })
    ));
    let mut bad = [Vector3::zeros(), e[0], e[1], e[2]];
    bad[2].x = f64::NAN;
    assert!(matches!(
        Polyhedron::from_vertices(&bad),
        Err(ShapeError::Unusable { index: 2, .. })
    ));
    assert!(Polyhedron::cuboid(Vector3::new(1.0, 0.0, 1.0)).is_err());
    assert!(Polyhedron::cuboid(Vector3::new(1.0, 1e-12, 1.0)).is_err());

    let cube = PlacedPolyhedron {
        shape: Polyhedron::cuboid(Vector3::new(1.0, 1.0, 1.0)).unwrap(),
        position: Vector3::new(5.0, 0.0, 0.0),
        orientation: UnitQuaternion::identity(),
    }
    .half_spaces();
    // Without one face the surface is open.
    for face in 0..6 {
        let mut open = cube.clone();
        let gone = open.remove(face);
        let Err(ShapeError::Unbounded { direction }) = Polyhedron::from_half_spaces(&open) else {
            panic!("open towards {:?}", gone.normal);
        };
        assert_relative_eq!(Vector3::from(direction), gone.normal, epsilon = 1e-9);
    }
    // A prism without ends; one half-space four times.
    let prism: Vec<HalfSpace> = cube[..4].to_vec();
    assert!(matches!(
        Polyhedron::from_half_spaces(&prism),
        Err(ShapeError::Unbounded { .. })
    ));
    assert!(matches!(
        Polyhedron::from_half_spaces(&[cube[0]; 4]),
        Err(ShapeError::Unbounded { .. })
    ));
    let mut empty = cube.clone();
    empty[1].offset = 3.0;
    assert!(matches!(
        Polyhedron::from_half_spaces(&empty),
        Err(ShapeError::Empty { .. })
    ));
    empty[1].offset = 4.5;
    assert!(matches!(
        Polyhedron::from_half_spaces(&empty),
        Err(ShapeError::Flat { .. })
    ));

    // A surface with a dent, and one with a hole.
    let solid =
        Polyhedron::from_vertices(&[Vector3::zeros(), e[0] * 2.0, e[1] * 2.0, e[2] * 2.0]).unwrap();
    let whole = triangles(&solid);
    let mut dented: Vec<_> = whole[1..].to_vec();
    let inside = whole[0].iter().sum::<Vector3<f64>>() / 3.0 * 0.7 + solid.position * 0.3;
    for k in 0..3 {
        dented.push([whole[0][k], whole[0][(k + 1) % 3], inside]);
    }
    assert!(matches!(
        Polyhedron::from_triangles(&dented),
        Err(ShapeError::NotConvex { .. })
    ));
    assert!(matches!(
        Polyhedron::from_triangles(&whole[1..]),
        Err(ShapeError::NotClosed { .. })
    ));
    // Turned inside out it is the same block.
    let out: Vec<_> = whole.iter().map(|t| [t[0], t[2], t[1]]).collect();
    assert_relative_eq!(
        Polyhedron::from_triangles(&out).unwrap().shape.volume(),
        solid.shape.volume(),
        max_relative = 1e-5
    );
    let text = Polyhedron::from_triangles(&dented).unwrap_err().to_string();
    assert!(
        text.contains("not convex") && text.contains("triangle"),
        "{text}"
    );
}
