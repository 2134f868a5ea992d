use super::*;
use base::random::Stream;
use dem::particles::Body;
use dem::polyhedron::Polyhedron;
use dem::{PlaneSpace as Flat, Volume};
use lbm::lattice::{D2Q9, D3Q19, Velocities};
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::Arc;

const SPACING: f64 = 0.1;

fn new_map(populations: &Populations<f64>) -> BodyMap {
    let grid = MapGrid {
        cells: populations.cells(),
        start: [0; 3],
        periodic: [false; 3],
        mirrored: [[false; 2]; 3],
        origin: [0.0; 3],
        spacing: SPACING,
    };
    let rules = Rules {
        hydraulic_radius_factor: 0.8,
        first_grain: 3,
        narrow: Some(NarrowGaps {
            solid_neighbours: 3,
            velocity: GapVelocity::Mean,
        }),
        interpolated: true,
    };
    BodyMap::new(populations, grid, rules)
}

fn follow<Sp: Space>(
    map: &mut BodyMap,
    particles: &Particles<Sp>,
    populations: &Populations<f64>,
) -> Vec<Load> {
    let mut loads = vec![[0; 6]; particles.len()];
    map.refresh(particles, 1.0, 1.0).unwrap();
    map.update_bodies(particles, populations, Some(&mut loads));
    loads
}

/// Checks that every cell belongs to the body of lowest id that covers its centre, and that an updated map equals a
/// new one.
fn is_true<Sp: Space>(
    map: &BodyMap,
    particles: &Particles<Sp>,
    populations: &Populations<f64>,
) -> usize {
    let mut held = 0;
    for (cell, _) in populations.interior() {
        let centre: [f64; 3] = std::array::from_fn(|a| cell[a] as f64 + 0.5);
        let inside = (0..particles.len()).filter(|&k| {
            let rigid = &map.motion()[k];
            let faces = map.faces(k);
            if faces.is_empty() {
                let square = |a: usize| (centre[a] - rigid.position[a]).powi(2);
                (0..Sp::DIMENSION).map(square).sum::<f64>() < rigid.radius.powi(2)
            } else {
                faces.iter().all(|face| face.height(centre) < 0.0)
            }
        });
        let id = inside.map(|k| particles.body[k].id).min();
        assert_eq!(map.body_at(cell), id, "{cell:?}");
        held += usize::from(id.is_some());
    }
    let mut anew = new_map(populations);
    follow(&mut anew, particles, populations);
    assert!(anew.links() == map.links());
    assert!(anew.owner == map.owner);
    held
}

fn on_threads(count: usize, work: impl FnOnce() + Send) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
    pool.unwrap().install(work);
}

/// Checks discs that overlap, move at all speeds, grow, leave the lattice, and are removed and added.
#[test]
fn discs_hold_the_cells_of_their_places() {
    let populations =
        Populations::new(Velocities::for_lattice::<D2Q9, 9>(), [70, 60, 1], 1).unwrap();
    for threads in [1, 3] {
        on_threads(threads, || {
            let mut draw = Stream::new(7, 0, 0);
            let mut map = new_map(&populations);
            let mut discs: Vec<(u64, f64, [f64; 2])> = (0..150)
                .map(|id| {
                    (
                        id,
                        0.1 + 0.25 * draw.uniform(),
                        [7.5 * draw.uniform() - 0.2, 6.0 * draw.uniform()],
                    )
                })
                .collect();
            let (mut changed, mut covered) = (0, 0);
            for step in 0..60 {
                let mut particles = Particles::<Flat>::new();
                for (id, radius, at) in &mut discs {
                    let pace = [0.0, 1e-3, 0.02, 0.3][(*id % 4) as usize];
                    for x in at.iter_mut() {
                        *x += pace * (draw.uniform() - 0.5);
                    }
                    if *id == 5 && step % 10 == 9 {
                        *radius *= 1.1;
                    }
                    if (*id + step) % 11 != 0 {
                        let mut motion = Motion::<Flat>::default();
                        motion.position.set(0, at[0]);
                        motion.position.set(1, at[1]);
                        particles.insert(Body::uniform::<Flat>(*id, *radius, 2.0, 0), motion);
                    }
                }
                follow(&mut map, &particles, &populations);
                changed += usize::from(!map.is_as_before());
                covered += is_true(&map, &particles, &populations);
            }
            assert!(changed > 50 && covered > 30_000, "{changed} {covered}");
        });
    }
}

/// Checks balls and rotating blocks that pass through each other.
#[test]
fn balls_and_blocks_hold_the_cells_of_their_places() {
    let populations =
        Populations::new(Velocities::for_lattice::<D3Q19, 19>(), [24, 20, 22], 2).unwrap();
    let shape = Polyhedron::cuboid(Vector3::new(0.43, 0.65, 0.81)).unwrap();
    for threads in [1, 2] {
        on_threads(threads, || {
            let mut draw = Stream::new(9, 0, 0);
            let mut map = new_map(&populations);
            let mut places: Vec<[f64; 3]> = (0..40)
                .map(|_| [2.4, 2.0, 2.2].map(|length| length * draw.uniform()))
                .collect();
            let mut covered = 0;
            for step in 0..20 {
                let mut particles = Particles::<Volume>::new();
                particles
                    .set_shapes(Arc::from(vec![shape.clone()]))
                    .unwrap();
                for (id, at) in (0_u32..).zip(&mut places) {
                    for x in at.iter_mut() {
                        *x += if id % 3 == 0 { 0.0 } else { 0.06 } * (draw.uniform() - 0.5);
                    }
                    let motion = Motion::<Volume> {
                        position: Vector3::from(*at),
                        ..Motion::default()
                    };
                    if id % 5 == 0 {
                        let turn = UnitQuaternion::from_scaled_axis(
                            Vector3::new(0.3, -0.8, 0.4) * (f64::from(id) + 0.02 * f64::from(step)),
                        );
                        let block = Body::of_block(id.into(), &shape, 1000.0, 0);
                        particles.add_block(block, motion, 0, turn).unwrap();
                    } else {
                        let body = Body::uniform::<Volume>(id.into(), 0.19, 1000.0, 0);
                        particles.insert(body, motion);
                    }
                }
                follow(&mut map, &particles, &populations);
                covered += is_true(&map, &particles, &populations);
            }
            assert!(covered > 20_000, "{covered}");
        });
    }
}

/// Covers and uncovers cells: a body gains the momentum that the fluid in covered cells loses, and loses it again when
/// it uncovers them.
#[test]
fn covering_and_uncovering_gives_back_what_it_took() {
    let mut populations =
        Populations::new(Velocities::for_lattice::<D2Q9, 9>(), [30, 30, 1], 1).unwrap();
    let mut draw = Stream::new(3, 0, 0);
    for number in populations.numbers_mut() {
        *number = 0.01 * draw.uniform();
    }
    let disc = |x: f64| {
        let mut particles = Particles::<Flat>::new();
        let mut motion = Motion::<Flat>::default();
        motion.position.set(0, x);
        motion.position.set(1, 1.51);
        particles.insert(Body::uniform::<Flat>(1, 0.4, 2.0, 0), motion);
        particles
    };
    let mut map = new_map(&populations);
    follow(&mut map, &disc(1.0), &populations);
    let there = follow(&mut map, &disc(1.43), &populations)[0];
    let back = follow(&mut map, &disc(1.0), &populations)[0];
    assert!(there[0] != 0 && there[5] != 0);
    assert_eq!(there.map(|load| -load), back);
}

/// Follows a joint of three cells of water in a row: it closes, a disc takes its middle cell and leaves again, and it
/// opens. Its mouths are counted by hand.
#[test]
fn cells_of_a_joint_close_where_no_body_is() {
    let populations =
        Populations::new(Velocities::for_lattice::<D2Q9, 9>(), [12, 10, 1], 1).unwrap();
    let none = Particles::<Flat>::new();
    let mut disc = Particles::<Flat>::new();
    let mut motion = Motion::<Flat>::default();
    // It covers the centre of cell (5, 5) and no other one.
    motion.position.set(0, 0.55);
    motion.position.set(1, 0.55);
    disc.insert(Body::uniform::<Flat>(8, 0.06, 2.0, 0), motion);
    let mut map = new_map(&populations);
    let row = [[4, 5, 0], [5, 5, 0], [6, 5, 0]];
    let middle = [5, 5, 0];
    let inside = |cell: [i32; 3]| cell.map(|v| usize::try_from(v).unwrap());
    let of_all = |change| row.map(|cell| (inside(cell), change)).to_vec();
    let mouths = |map: &BodyMap| {
        let links = map.joint_links().0.iter();
        links
            .map(|link| (link.inner, link.direction))
            .collect::<HashSet<_>>()
            .len()
    };

    // Each cell once; a cell beyond a wall and one beyond the ghosts are no water.
    let asked = row.into_iter().chain([middle, [-1, 3, 0], [90, 3, 0]]);
    map.set_joint_cells(asked);
    follow(&mut map, &none, &populations);
    assert_eq!(map.closed_cells(), row);
    assert_eq!(map.joint_changes(), of_all(CellChange::WaterClosed));
    assert!(map.is_closed(inside(middle)) && map.body_at(inside(middle)).is_none());
    // 8 neighbours each, less 1 at the ends and 2 in the middle.
    assert_eq!(mouths(&map), 7 + 6 + 7);

    follow(&mut map, &none, &populations);
    assert!(map.joint_changes().is_empty() && !map.joints_altered());

    follow(&mut map, &disc, &populations);
    assert_eq!(map.closed_cells(), [row[0], row[2]]);
    assert_eq!(
        map.joint_changes(),
        [(inside(middle), CellChange::BodyOpened)]
    );
    assert_eq!(map.body_at(inside(middle)), Some(8));
    assert_eq!(mouths(&map), 7 + 7);

    follow(&mut map, &none, &populations);
    assert_eq!(map.closed_cells(), row);
    assert_eq!(
        map.joint_changes(),
        [(inside(middle), CellChange::BodyClosed)]
    );

    map.set_joint_cells(std::iter::empty());
    follow(&mut map, &none, &populations);
    assert_eq!(map.joint_changes(), of_all(CellChange::WaterOpened));
    assert!(map.closed_cells().is_empty() && !map.is_closed(inside(middle)));
    assert_eq!(mouths(&map), 0);
}

/// Checks the reflection at the mouths of a joint of one cell: what enters returns, and the joint has its momentum,
/// twice that of the populations.
#[test]
fn mouths_of_a_joint_reflect_and_have_the_momentum() {
    let mut populations =
        Populations::new(Velocities::for_lattice::<D2Q9, 9>(), [12, 10, 1], 1).unwrap();
    let mut map = new_map(&populations);
    map.set_joint_cells([[4, 5, 0]].into_iter());
    follow(&mut map, &Particles::<Flat>::new(), &populations);
    let velocities = populations.velocities().clone();
    let parity = populations.parity();
    let links: Vec<_> = map.joint_links().0.to_vec();
    assert_eq!(links.len(), 8);
    let mut momentum = [0.0; 2];
    for link in &links {
        let number = 0.01 * f64::from(u32::try_from(link.direction).unwrap());
        populations.numbers_mut()[link.link.out(parity)] = number;
        for (sum, c) in momentum.iter_mut().zip(velocities.c[link.direction]) {
            *sum += 2.0 * number * f64::from(c);
        }
    }
    let load = map.bounce_at_joints(&mut populations).unwrap();
    for link in &links {
        let number = 0.01 * f64::from(u32::try_from(link.direction).unwrap());
        let back = populations.numbers()[link.link.incoming(parity)];
        assert_eq!(back.to_bits(), number.to_bits());
    }
    for (found, expected) in load.iter().zip(momentum) {
        let found = lbm::quanta::from_quanta(*found);
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    }
}
