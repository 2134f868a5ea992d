//! A block that slides to a stop over ledges and seams of boxes, polygons, meshes and planes: the distance is
//! v²/(2 mu g) on all of them.

use std::sync::Arc;

use approx::assert_relative_eq;
use nalgebra::{UnitQuaternion, Vector3};

use super::super::contact::blocks::BlockLaw;
use super::super::polyhedron::{self, BlockContactModel, Polyhedron, Stiffness};
use super::*;

const GRAVITY: f64 = 9.81;
const DENSITY: f64 = 2600.0;
const SPEED: f64 = 1.0;

/// Time steps \[s\]: nine, six and four per cent of the period of the block on its springs.
const STEPS: [f64; 3] = [1e-4, 7e-5, 5e-5];

fn wall(surface: FacetSurface) -> Wall<Volume> {
    Wall::of_surface(Arc::new(surface), 0)
}

/// A box of facets between two corners.
fn cuboid(from: [f64; 3], to: [f64; 3]) -> Wall<Volume> {
    wall(FacetSurface::of_box(from.into(), to.into()).unwrap())
}

/// A box 3 m long below z = 0 that ends at `x`.
fn before(x: f64) -> Wall<Volume> {
    cuboid([-3.0, -1.0, -0.5], [x, 1.0, 0.0])
}

/// A box 3 m long below z = 0 that begins at `x`.
fn after(x: f64) -> Wall<Volume> {
    cuboid([x, -1.0, -0.5], [3.0, 1.0, 0.0])
}

/// A convex polygon in z = 0.
fn polygon(corners: &[[f64; 2]]) -> Wall<Volume> {
    let all = (0..u32::try_from(corners.len()).unwrap()).collect();
    let corners = corners.iter().map(|[x, y]| Vector3::new(*x, *y, 0.0));
    wall(FacetSurface::new(corners.collect(), &[all]).unwrap())
}

/// A rectangle in z = 0, 2 m wide.
fn tile(from: f64, to: f64) -> Wall<Volume> {
    polygon(&[[from, -1.0], [to, -1.0], [to, 1.0], [from, 1.0]])
}

/// A rectangle in z = 0, 2 m wide, as `n` by `n` rectangles of two triangles each, every third facing down.
fn mesh(from: f64, to: f64, n: u32) -> Wall<Volume> {
    let part = |k: u32| f64::from(k) / f64::from(n);
    let vertices = (0..=n).flat_map(|j| {
        let at = move |i| Vector3::new(from + (to - from) * part(i), 2.0 * part(j) - 1.0, 0.0);
        (0..=n).map(at)
    });
    let mut facets = Vec::new();
    for first in (0..n).flat_map(|j| (0..n).map(move |i| j * (n + 1) + i)) {
        facets.push(vec![first, first + 1, first + n + 2]);
        facets.push(vec![first, first + n + 2, first + n + 1]);
    }
    for facet in facets.iter_mut().step_by(3) {
        facet.reverse();
    }
    wall(FacetSurface::new(vertices.collect(), &facets).unwrap())
}

/// A closed box of triangles below z = 0.
fn solid_mesh(from: [f64; 3], to: [f64; 3]) -> Wall<Volume> {
    let corner = |k: usize| {
        Vector3::from_fn(|axis, _| {
            if k >> axis & 1 == 0 {
                from[axis]
            } else {
                to[axis]
            }
        })
    };
    let sides = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let halves = sides
        .iter()
        .flat_map(|[a, b, c, d]| [vec![*a, *b, *c], vec![*a, *c, *d]]);
    let facets: Vec<Vec<u32>> = halves.collect();
    wall(FacetSurface::new((0..8).map(corner).collect(), &facets).unwrap())
}

fn plane() -> Wall<Volume> {
    Wall::new(Vector3::zeros(), Vector3::z(), 0)
}

/// Returns the floors: name, walls, and the angle by which the block is rotated about the vertical.
fn floors() -> Vec<(&'static str, Vec<Wall<Volume>>, f64)> {
    let slanted = [[-3.0, -1.0], [0.0, -1.0], [0.1, 1.0], [-3.0, 1.0]];
    let beyond = [[0.0, -1.0], [3.0, -1.0], [3.0, 1.0], [0.1, 1.0]];
    vec![
        ("ledge of a box", vec![before(0.25)], 0.0),
        ("ledge of a box, turned block", vec![before(0.25)], 0.4),
        ("ledge of a polygon", vec![tile(-3.0, 0.25)], 0.0),
        ("ledge of a mesh", vec![mesh(-3.0, 0.25, 9)], 0.3),
        (
            "ledge of a closed mesh",
            vec![solid_mesh([-3.0, -1.0, -0.5], [0.25, 1.0, 0.0])],
            0.0,
        ),
        (
            "ledge of a thin plate",
            vec![cuboid([-3.0, -1.0, -0.004], [0.25, 1.0, 0.0])],
            0.0,
        ),
        ("boxes", vec![before(0.05), after(0.05)], 0.0),
        ("boxes, turned block", vec![before(0.05), after(0.05)], 0.7),
        (
            "unequal boxes",
            vec![before(0.05), cuboid([0.05, -0.7, -0.2], [3.0, 0.8, 0.0])],
            0.0,
        ),
        (
            "a narrow box between two",
            vec![
                before(0.05),
                cuboid([0.05, -1.0, -0.3], [0.08, 1.0, 0.0]),
                after(0.08),
            ],
            0.0,
        ),
        (
            "a seam along the way",
            vec![
                cuboid([-3.0, -1.0, -0.5], [3.0, 0.03, 0.0]),
                cuboid([-3.0, 0.03, -0.5], [3.0, 1.0, 0.0]),
            ],
            0.0,
        ),
        (
            "four boxes at a corner",
            vec![
                cuboid([-3.0, -1.0, -0.5], [0.1, -0.02, 0.0]),
                cuboid([-3.0, -0.02, -0.4], [0.1, 1.0, 0.0]),
                cuboid([0.1, -1.0, -0.3], [3.0, -0.02, 0.0]),
                cuboid([0.1, -0.02, -0.2], [3.0, 1.0, 0.0]),
            ],
            0.0,
        ),
        ("polygons", vec![tile(-3.0, 0.05), tile(0.05, 3.0)], 0.0),
        (
            "overlapping polygons",
            vec![tile(-3.0, 0.15), tile(0.0, 3.0)],
            0.2,
        ),
        (
            "slanted polygons",
            vec![polygon(&slanted), polygon(&beyond)],
            0.0,
        ),
        (
            "a box and a polygon",
            vec![before(0.05), tile(0.05, 3.0)],
            0.0,
        ),
        (
            "a box and a mesh",
            vec![before(0.05), mesh(0.05, 3.0, 11)],
            0.0,
        ),
        (
            "two meshes",
            vec![mesh(-3.0, 0.05, 8), mesh(0.05, 3.0, 13)],
            0.5,
        ),
        (
            "closed meshes",
            vec![
                solid_mesh([-3.0, -1.0, -0.5], [0.05, 1.0, 0.0]),
                solid_mesh([0.05, -1.0, -0.5], [3.0, 1.0, 0.0]),
            ],
            0.0,
        ),
        ("a plane and a box in it", vec![plane(), after(0.05)], 0.0),
        (
            "a plane and a polygon in it",
            vec![tile(-0.1, 0.2), plane()],
            0.3,
        ),
        (
            "a plane and a mesh in it",
            vec![plane(), mesh(0.05, 3.0, 11)],
            0.0,
        ),
    ]
}

fn law(friction: f64) -> Law {
    let law = polyhedron::BlockPairLaw {
        stiffness: Stiffness::PerArea {
            normal: 1e9,
            shear: 5e8,
        },
        friction,
        normal_damping_ratio: 0.3,
        shear_damping_ratio: 0.3,
    };
    Law::Blocks(BlockLaw {
        parameters: PairTable::uniform(1, law),
        model: BlockContactModel::Pressure,
        mass_damping: 0.0,
    })
}

/// Checks 22 floors at three time steps: the distance agrees within 1 %, without sideways motion or rotation.
#[test]
fn a_block_stops_after_the_same_distance_on_all_floors() {
    let friction = 20.0_f64.to_radians().tan();
    let distance = SPEED * SPEED / (2.0 * friction * GRAVITY);
    let mut failed = Vec::new();
    for (name, walls, turned) in floors() {
        for step in STEPS {
            let shape = Polyhedron::cuboid(Vector3::new(0.4, 0.4, 0.2)).unwrap();
            let sunk = DENSITY * 0.2 * GRAVITY / 1e9;
            let mut particles = Particles::new();
            particles.set_shapes([shape.clone()].into()).unwrap();
            let motion = Motion {
                position: Vector3::new(0.0, 0.0, 0.1 - sunk),
                velocity: Vector3::new(SPEED, 0.0, 0.0),
                spin: Vector3::zeros(),
            };
            let orientation = UnitQuaternion::from_euler_angles(0.0, 0.0, turned);
            let body = Body::of_block(0, &shape, DENSITY, 0);
            particles.add_block(body, motion, 0, orientation).unwrap();
            let mut settings = DemSettings::new(about_origin(10.0), step, 0.02);
            settings.gravity = Vector3::z() * -GRAVITY;
            let mut dem = Dem::new(law(friction), settings, walls.clone()).unwrap();
            let steps = base::number::whole(0.32 / step) as u64;
            dem.advance_many(&mut particles, &alone(), steps).unwrap();
            let now = particles.motion[0];
            let (_, state) = particles.polyhedron(0).unwrap();
            let turn = state.orientation.angle_to(&orientation);
            let off = now.position.x / distance - 1.0;
            let aside = now.position.y.abs() / distance;
            if !(off.abs() < 0.01 && aside < 0.01 && turn < 0.01 && now.velocity.norm() < 1e-3) {
                failed.push(format!("{name} at {step}: {off:.4} {aside:.4} {turn:.4}"));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

/// Checks that a block that falls onto a plane wall with facets in it moves as on the plane alone.
#[test]
fn a_block_falls_on_a_plane_wall_with_facets_in_it() {
    let fall = |walls: Vec<Wall<Volume>>| {
        let shape = Polyhedron::cuboid(Vector3::new(0.4, 0.3, 0.2)).unwrap();
        let mut particles = Particles::<Volume>::new();
        particles.set_shapes([shape.clone()].into()).unwrap();
        let motion = Motion {
            position: Vector3::new(0.02, 0.01, 0.16),
            velocity: Vector3::new(0.3, 0.0, -0.5),
            spin: Vector3::zeros(),
        };
        let orientation = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
        let body = Body::of_block(0, &shape, DENSITY, 0);
        particles.add_block(body, motion, 0, orientation).unwrap();
        let mut settings = DemSettings::new(about_origin(10.0), 1e-4, 0.02);
        settings.gravity = Vector3::z() * -GRAVITY;
        let mut dem = Dem::new(law(0.4), settings, walls).unwrap();
        dem.advance_many(&mut particles, &alone(), 4000).unwrap();
        particles.motion[0]
    };
    let alone = fall(vec![plane()]);
    for second in [after(0.05), tile(-1.0, 0.05), mesh(-0.5, 2.0, 7), plane()] {
        for walls in [vec![plane(), second.clone()], vec![second, plane()]] {
            let both = fall(walls);
            assert_relative_eq!(both.position, alone.position, epsilon = 1e-12);
            assert_relative_eq!(both.spin, alone.spin, epsilon = 1e-9);
        }
    }
}
