use super::*;
use base::random::SplitMix;
use dem::particles::{Body, Motion};
use dem::polyhedron::Polyhedron;
use dem::{PlaneSpace, Volume};
use lbm::collision::trt::AntisymmetricRate;
use lbm::gpu::host::{CoveredPositions, SlabPositions};
use lbm::lattice::{D2Q9, D3Q19, Velocities};
use lbm::saturation::{SaturationMethod as Action, SolidOperator, Weighting};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use std::sync::Arc;

const CELLS: [usize; 3] = [20, 17, 13];

fn populations(split: usize) -> Populations<f64> {
    Populations::new(Velocities::for_lattice::<D3Q19, 19>(), CELLS, split).unwrap()
}

fn map(populations: &Populations<f64>) -> (CoverMap, Cover) {
    map_of(populations, [0; 3])
}

fn map_of(populations: &Populations<f64>, start: [usize; 3]) -> (CoverMap, Cover) {
    let grid = MapGrid {
        cells: CELLS,
        start,
        periodic: [true; 3],
        mirrored: [[false; 2]; 3],
        origin: [0.0; 3],
        spacing: 0.1,
    };
    cover_of(populations, grid)
}

fn cover_of(populations: &Populations<f64>, grid: MapGrid) -> (CoverMap, Cover) {
    let action = Action {
        operator: SolidOperator::ViscosityMatched,
        weighting: Weighting::Fraction,
    };
    (
        CoverMap::new(
            populations,
            grid,
            FractionMethod::Exact,
            populations.order(),
        ),
        Cover::new(populations, action, 0.8, AntisymmetricRate::AsSymmetric, 2),
    )
}

fn solid(populations: &Populations<f64>, cover: &Cover) -> f64 {
    populations
        .interior()
        .map(|(_, position)| cover.fraction(position))
        .sum()
}

fn motion_at(x: f64, y: f64, z: f64) -> Motion<Volume> {
    Motion {
        position: Vector3::new(x, y, z),
        ..Motion::default()
    }
}

/// Returns a ball and a rotated block next to it, with the block's shape.
fn ball_and_block(x: f64) -> (Particles<Volume>, Polyhedron) {
    let mut particles = Particles::<Volume>::new();
    let shape = Polyhedron::cuboid(Vector3::new(0.43, 0.25, 0.61)).unwrap();
    particles
        .set_shapes(Arc::from(vec![shape.clone()]))
        .unwrap();
    particles.insert(
        Body::uniform::<Volume>(1, 0.37, 1000.0, 0),
        motion_at(0.71, 0.82, 0.55),
    );
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.8, 0.4));
    let block = Body::of_block(2, &shape, 1000.0, 0);
    particles
        .add_block(block, motion_at(x, 0.77, 0.64), 0, turn)
        .unwrap();
    (particles, shape)
}

/// Checks that the cover of a body has the volume of the body at every position and for every order of the axes, and
/// that no cover remains at previous positions.
#[test]
fn the_cover_follows_and_adds_up_to_the_volume() {
    for split in 0..3 {
        let populations = populations(split);
        let (mut map, mut cover) = map(&populations);
        let (mut particles, shape) = ball_and_block(1.43);
        let exact = (4.0 / 3.0 * std::f64::consts::PI * 0.37_f64.powi(3) + shape.volume()) * 1e3;
        for _ in 0..40 {
            map.update_bodies(&particles, &mut cover, 1.0, 1.0);
            let found = solid(&populations, &cover);
            assert!(
                (found / exact - 1.0).abs() < 1e-6,
                "{split} {found} {exact}"
            );
            for motion in &mut particles.motion {
                motion.position += Vector3::new(0.0031, -0.0043, 0.0012);
            }
        }
        let gone = Particles::<Volume>::new();
        map.update_bodies(&gone, &mut cover, 1.0, 1.0);
        assert!(solid(&populations, &cover) == 0.0);
    }
}

/// Checks that a moving disc covers each cell by the fraction of it that the disc fills, for both orders of the axes
/// and at walls.
#[test]
fn discs_cover_what_they_fill() {
    const CELLS: [usize; 3] = [30, 21, 1];
    let mut draws = SplitMix::new(8);
    let mut edges = 0;
    for split in [0, 1] {
        let populations =
            Populations::<f64>::new(Velocities::for_lattice::<D2Q9, 9>(), CELLS, split);
        let populations = populations.unwrap();
        let grid = MapGrid {
            cells: CELLS,
            start: [0; 3],
            periodic: [false; 3],
            mirrored: [[false; 2]; 3],
            origin: [0.0; 3],
            spacing: 0.1,
        };
        let (mut map, mut cover) = cover_of(&populations, grid);
        for step in 0..200 {
            let radius = 0.02 + 0.7 * draws.uniform();
            let position = [3.4 * draws.uniform() - 0.2, 2.5 * draws.uniform() - 0.2];
            let mut particles = Particles::<PlaneSpace>::new();
            let motion = Motion {
                position: Vector2::from(position),
                ..Motion::default()
            };
            particles.insert(Body::uniform::<PlaneSpace>(1, radius, 1000.0, 0), motion);
            map.update_bodies(&particles, &mut cover, 1.0, 1.0);
            let form = Form::Disc {
                centre: [position[0] / 0.1, position[1] / 0.1, 0.0],
                radius: radius / 0.1,
            };
            let mut scratch = Scratch::default();
            for (cell, cell_position) in populations.interior() {
                let fraction = form.fraction(FractionMethod::Exact, cell.map(real), &mut scratch);
                let found = cover.fraction(cell_position);
                assert!(
                    (found - fraction).abs() < 1e-7,
                    "{split} {step} {cell:?}: {found} {fraction}"
                );
                edges += u32::from(found > 0.0 && found < 1.0);
            }
        }
    }
    assert!(edges > 5000, "{edges}");
}

/// Checks that the fractions of ghost cells are the negatives of those of the same cells in the next slab, for any
/// cuts.
#[test]
fn ghost_cells_are_covered_as_in_the_next_slab() {
    let (particles, _) = ball_and_block(1.13);
    for split in 0..3 {
        let cut = CELLS[split] / 2 + 1;
        let slab = |start: usize, planes: usize| {
            let (mut cells, mut from) = (CELLS, [0; 3]);
            cells[split] = planes;
            from[split] = start;
            let populations =
                Populations::<f64>::new(Velocities::for_lattice::<D3Q19, 19>(), cells, split)
                    .unwrap();
            let (mut map, mut cover) = map_of(&populations, from);
            map.update_bodies(&particles, &mut cover, 1.0, 1.0);
            (populations, cover)
        };
        let (lower, upper) = (slab(0, cut), slab(cut, CELLS[split] - cut));
        let mut covered = 0;
        let [p, q] = [0, 1, 2]
            .into_iter()
            .filter(|&a| a != split)
            .collect::<Vec<_>>()[..]
        else {
            panic!("two other axes")
        };
        for i in 0..CELLS[p] {
            for j in 0..CELLS[q] {
                let cell = |slab: &(Populations<f64>, Cover), k: usize, up: bool| {
                    let mut at = [0; 3];
                    at[p] = i.cast_signed();
                    at[q] = j.cast_signed();
                    at[split] = if up {
                        k.cast_signed()
                    } else {
                        k.cast_signed() - 1
                    };
                    slab.1.held(slab.0.cell(at))
                };
                let pairs = [
                    (cell(&lower, cut, true), cell(&upper, 0, true)),
                    (cell(&upper, 0, false), cell(&lower, cut, false)),
                ];
                for (ghost, there) in pairs {
                    assert!(
                        ghost.to_bits() == (-there).to_bits() || (ghost == 0.0 && there == 0.0)
                    );
                    covered += u32::from(there > 0.0);
                }
            }
        }
        assert!(covered > 20, "{split}: {covered}");
    }
}

/// Checks that bodies that overlap, move and leave cover the same cells by the same fractions with one worker and with
/// several that have separate planes.
#[test]
fn workers_cover_what_one_covers() {
    let grains = |step: i32| {
        let mut particles = Particles::<Volume>::new();
        for n in (0..40).filter(|n| n % 7 != step % 7) {
            let mix = |k: i32| f64::from(n.wrapping_mul(0x9e37_79b1_u32.cast_signed()) >> k & 63);
            let away = 0.004 * f64::from(step);
            let motion = motion_at(0.03 * mix(3) + away, 0.026 * mix(9), 0.02 * mix(15));
            let body = Body::uniform::<Volume>(n.unsigned_abs().into(), 0.21, 1000.0, 0);
            particles.insert(body, motion);
        }
        particles
    };
    for split in 0..3 {
        let populations = populations(split);
        let mapped = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new();
            let pool = pool.num_threads(threads).build().unwrap();
            pool.install(|| {
                let (mut map, mut cover) = map(&populations);
                let mut all = Vec::new();
                for step in 0..9 {
                    map.update_bodies(&grains(step), &mut cover, 1.0, 1.0);
                    // The parts of several bodies, by the velocity of the cell.
                    for (cell, position) in populations.interior() {
                        let v = cover.velocity::<3>(position, cell.map(to_i32));
                        all.push((cover.held(position).to_bits(), v.map(f64::to_bits)));
                    }
                }
                (all, map.cuts().len())
            })
        };
        let (one, _) = mapped(1);
        for threads in [2, 3, 5] {
            let (several, cuts) = mapped(threads);
            assert!(one == several, "{split} {threads}");
            assert!(cuts > 0, "{split} {threads}");
        }
    }
}

/// Checks a rotated block and a ball, few enough to be divided by planes.
#[test]
fn workers_cover_planes_of_a_block() {
    for split in 0..3 {
        let populations = populations(split);
        let mapped = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new();
            let pool = pool.num_threads(threads).build().unwrap();
            pool.install(|| {
                let (mut map, mut cover) = map(&populations);
                let mut all = Vec::new();
                for step in 0..6 {
                    let (particles, _) = ball_and_block(1.13 + 0.03 * f64::from(step));
                    map.update_bodies(&particles, &mut cover, 1.0, 1.0);
                    let cells = populations.interior();
                    all.extend(cells.map(|(_, position)| cover.held(position).to_bits()));
                }
                (all, map.pieces.len())
            })
        };
        let (one, none) = mapped(1);
        assert_eq!(none, 0);
        for threads in [2, 3, 5] {
            let (several, pieces) = mapped(threads);
            assert!(one == several, "{split} {threads}");
            assert!(pieces > 2, "{split} {threads}: {pieces}");
        }
    }
}

/// Checks balls of all sizes that overlap, are at walls and beyond the slab, move, are added and removed: a GPU finds
/// the same owners, fractions and parts.
#[test]
fn a_gpu_finds_the_same_cells() {
    let mut several = 0;
    for split in 0..3 {
        let populations = populations(split);
        let (mut map, mut cover) = map(&populations);
        let origin = populations.cell([0; 3]);
        let stride = |axis: usize| {
            let mut at = [0; 3];
            at[axis] = 1;
            to_i32(populations.cell(at) - origin)
        };
        let slab = SlabPositions {
            origin: to_u32(origin),
            strides: [stride(0), stride(1), stride(2)],
            cells: CELLS.map(to_i32),
            order: populations.order().map(to_u32),
        };
        // A wall at rest on one side.
        let mut walled = Vec::new();
        for j in 0..CELLS[1] {
            for k in 0..CELLS[2] {
                walled.push(populations.cell([-1, j.cast_signed(), k.cast_signed()]));
            }
        }
        cover.wall_off(walled.into_iter());
        let mut draws = SplitMix::new(17 + split as u64);
        for step in 0..12 {
            let mut particles = Particles::<Volume>::new();
            for id in 0..40 {
                let radius = 0.02 + 0.3 * draws.uniform().powi(2);
                let [x, y, z] = CELLS.map(|n| draws.uniform() * (0.1 * real(n) + 0.2) - 0.1);
                // Some of them stay away for a while.
                if (id + step) % 7 != 0 {
                    particles.insert(
                        Body::uniform::<Volume>((id * 7) % 41, radius, 1000.0, 0),
                        motion_at(x, y, z),
                    );
                }
            }
            map.place_bodies(&particles, &mut cover, 1.0, 1.0);
            assert!(cover.balls().is_some());
            let (before, _) = cover.cells();
            let before = CoveredPositions {
                owner: before.to_vec(),
                fraction: vec![-1.0; before.len()],
                shared: Vec::new(),
            };
            map.cover_cells(&mut cover);
            let CoveredPositions {
                owner,
                fraction,
                shared,
            } = lbm::gpu::host::cover(cover.solids(), before, &slab);
            let here: Vec<Vec<_>> = cover.shared().map(<[_]>::to_vec).collect();
            let (owners, fractions) = cover.cells();
            for (position, held) in fractions.iter().enumerate() {
                if owners[position] == u32::MAX - 1 {
                    assert_eq!(owner[position], owners[position]);
                    continue;
                }
                assert_eq!(
                    held.to_bits(),
                    fraction[position].to_bits(),
                    "{split} {step} {position} {held} {}",
                    fraction[position]
                );
                let parts = |owner: u32, lists: &[Vec<_>]| {
                    let list = (owner >> 31 == 1 && owner != u32::MAX)
                        .then(|| lists[(owner & !(1 << 31)) as usize].clone());
                    (list.is_none().then_some(owner), list)
                };
                let (one, other) = (
                    parts(owners[position], &here),
                    parts(owner[position], &shared),
                );
                assert_eq!(one, other, "{split} {step} {position}");
                several += usize::from(one.1.is_some_and(|list| list.len() > 2));
            }
        }
    }
    assert!(several > 300, "{several}");
}
