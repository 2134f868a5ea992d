//! Equal bits on any number of ranks and threads, with any skin, in any number of calls, and across restarts.
//!
//! Ranks are threads here ([`decomposition::on_threads`]).

use std::collections::BTreeMap;

use decomposition::{Domain, Slabs, SplitAxis, on_threads};
use nalgebra::Vector2;

use super::super::state::{Contacts, NamedColumns};
use super::*;
use base::random::Stream;

/// Runs `work` on ranks whose slabs have these bounds along an axis; returns the results by rank.
pub(super) fn on_slabs<T: Send>(
    axis: SplitAxis,
    bounds: &[usize],
    work: impl Fn(Domain) -> T + Sync,
) -> Vec<T> {
    on_threads(bounds.len() - 1, |communicator| {
        let slabs = Slabs::from_bounds(axis, bounds.to_vec(), false).unwrap();
        work(Domain::new(communicator, slabs).unwrap())
    })
}

/// Scene with all features: a periodic axis, a giant, a wall, a driven grain, gravity, bonds and shear.
#[derive(Clone, Copy)]
struct Scene {
    periodic: bool,
    bonded: bool,
    skin: f64,
}

const STEPS: u64 = 1200;

fn settings(scene: Scene) -> DemSettings<PlaneSpace> {
    let mut region =
        GrainDomain::<PlaneSpace>::closed(Vector2::zeros(), Vector2::new(0.04, 0.03), 1e-3);
    region.periodic[0] = scene.periodic;
    let mut settings = DemSettings::new(region, 2e-6, scene.skin);
    settings.gravity = Vector2::new(3.0, -9.81);
    settings.local_damping = 0.1;
    settings.ghost_margin = 1e-3;
    settings
}

fn dem(scene: Scene) -> Dem<PlaneSpace> {
    let region = settings(scene).region;
    let walls = Wall::of_box(
        region.lower,
        region.upper,
        [!scene.periodic, true, false],
        0,
    );
    if scene.bonded {
        let parameters = cohesive_frictional::CohesiveFrictionalParameters {
            linear: linear::LinearParameters {
                normal_stiffness: Scaled::Absolute(5e5),
                normal_damping_ratio: 0.05,
                shear_damping_ratio: 0.05,
                ..PAPER.linear
            },
            cohesion: Scaled::Absolute(0.8),
        };
        cohesive(parameters, settings(scene), walls)
    } else {
        let parameters = linear::LinearParameters {
            normal_stiffness: Scaled::Absolute(5e5),
            normal_damping_ratio: 0.1,
            shear_damping_ratio: 0.1,
            ..SPRINGS
        };
        linear(parameters, settings(scene), walls)
    }
}

fn grains() -> Vec<(Body, Motion<PlaneSpace>)> {
    let mut all = Vec::new();
    // A lattice with small overlaps at some places; the ids are in random order.
    for row in 0..12_u64 {
        for column in 0..19_u64 {
            let n = row * 19 + column;
            let mut draw = Stream::new(5, n, 0);
            #[expect(clippy::cast_precision_loss, reason = "small")]
            let at = Vector2::new(
                0.0011 + 0.002 * column as f64,
                0.0011 + 0.00199 * row as f64,
            );
            if (at - Vector2::new(0.02, 0.012)).norm() < 0.0062 {
                continue;
            }
            let body = Body::uniform::<PlaneSpace>(
                (n * 131) % 997,
                0.00099 + 3e-5 * draw.uniform(),
                2600.0,
                0,
            );
            let velocity = Vector2::new(draw.uniform() - 0.2, draw.uniform() - 0.5) * 2.0;
            all.push((
                body,
                Motion {
                    position: at,
                    velocity,
                    spin: 100.0 * (draw.uniform() - 0.5),
                },
            ));
        }
    }
    // A grain wider than a slab, moved by contacts, and a driven grain.
    let giant = Body::uniform::<PlaneSpace>(500_000, 0.005, 2600.0, 0);
    all.push((
        giant,
        Motion {
            position: Vector2::new(0.02, 0.012),
            ..Motion::default()
        },
    ));
    let driven = Body {
        kind: Kind::Driven,
        ..Body::uniform::<PlaneSpace>(3_000, 0.001, 2600.0, 0)
    };
    let velocity = Vector2::new(-1.5, -1.0);
    all.push((
        driven,
        Motion {
            position: Vector2::new(0.02, 0.027),
            velocity,
            spin: 50.0,
        },
    ));
    all
}

/// All bits of the state that a next step depends on, by id, plus the bond events.
type State = (
    BTreeMap<u64, Vec<u64>>,
    Vec<(u64, u64, Option<u64>, Option<u32>)>,
);

#[derive(Clone, Default)]
struct Saved {
    grains: NamedColumns,
    contacts: Contacts,
    breaks: Vec<BondBreak<PlaneSpace>>,
    migrated: bool,
}

/// Returns all bits of grains and contacts, by id.
pub(super) fn bits(grains: &NamedColumns, contacts: &Contacts) -> BTreeMap<u64, Vec<u64>> {
    let mut rows: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
    let column = |values: &state::Values| match values {
        state::Values::Real(values) => values.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
        state::Values::Whole(values) => values.clone(),
    };
    let ids = column(&grains.columns[0].1);
    for (name, values) in &grains.columns {
        assert_eq!(values.len(), ids.len(), "{name}");
        for (id, bits) in ids.iter().zip(column(values)) {
            rows.entry(*id).or_default().push(bits);
        }
    }
    for table in [&contacts.grains, &contacts.walls] {
        let columns: Vec<_> = table
            .columns
            .iter()
            .map(|(_, values)| column(values))
            .collect();
        let mut keyed: Vec<Vec<u64>> = (0..table.rows())
            .map(|row| columns.iter().map(|column| column[row]).collect())
            .collect();
        keyed.sort();
        for row in keyed {
            rows.entry(row[0]).or_default().extend(&row[1..]);
        }
    }
    rows
}

impl Saved {
    fn state(&self) -> State {
        let rows = bits(&self.grains, &self.contacts);
        let mut breaks: Vec<_> = self
            .breaks
            .iter()
            .map(|b| (b.step, b.grain, b.other, b.wall))
            .collect();
        breaks.sort_unstable();
        (rows, breaks)
    }
}

/// Makes `steps` steps on the ranks, from a saved state or from the start; the grains are distributed at random.
fn run(
    scene: Scene,
    axis: SplitAxis,
    bounds: &[usize],
    from: Option<&Saved>,
    steps: u64,
    batch: u64,
) -> Saved {
    let size = bounds.len() - 1;
    let parts = on_slabs(axis, bounds, |domain| {
        let rank = domain.rank();
        let mut dem = dem(scene);
        let mut particles = match from {
            Some(saved) => {
                dem.restore(&saved.contacts).unwrap();
                Particles::from_table(&saved.grains.filter(|row| row % size == rank)).unwrap()
            }
            None => {
                let mut particles = Particles::new();
                for (body, motion) in grains() {
                    if usize::try_from(body.id).unwrap() % size == rank {
                        particles.insert(body, motion);
                    }
                }
                particles
            }
        };
        if from.is_none() && scene.bonded {
            dem.bond_existing_contacts(&mut particles, &domain).unwrap();
        }
        dem.prepare(&mut particles, &domain).unwrap();
        let ids = |particles: &Particles<PlaneSpace>| -> Vec<u64> {
            let own = particles.body[..particles.owned()].iter();
            own.map(|body| body.id).collect()
        };
        let before = ids(&particles);
        for _ in 0..steps / batch {
            dem.advance_many(&mut particles, &domain, batch).unwrap();
        }
        Saved {
            grains: particles.table(),
            contacts: dem.contacts(),
            breaks: dem.take_breaks(),
            migrated: before != ids(&particles),
        }
    });
    let mut whole = Saved::default();
    for part in parts {
        append(
            (&mut whole.grains, &mut whole.contacts),
            (&part.grains, part.contacts),
        );
        whole.breaks.extend(part.breaks);
        whole.migrated |= part.migrated;
    }
    whole
}

const SCENES: [Scene; 4] = [
    Scene {
        periodic: false,
        bonded: false,
        skin: 3e-4,
    },
    Scene {
        periodic: true,
        bonded: false,
        skin: 3e-4,
    },
    Scene {
        periodic: false,
        bonded: true,
        skin: 3e-4,
    },
    Scene {
        periodic: true,
        bonded: true,
        skin: 3e-4,
    },
];

fn on_one_rank(scene: Scene) -> Saved {
    run(scene, SplitAxis::X, &[0, 40], None, STEPS, STEPS)
}

#[test]
fn ranks_do_not_show() {
    for scene in SCENES {
        let one = on_one_rank(scene);
        assert!(
            one.contacts.grains.rows() > 30,
            "the scene must have contacts with a history: {}",
            one.contacts.grains.rows()
        );
        assert!(one.contacts.walls.rows() > 0);
        assert_eq!(
            scene.bonded,
            !one.breaks.is_empty(),
            "bonds must break where there are any"
        );
        let splits: [(SplitAxis, &[usize]); 6] = [
            (SplitAxis::X, &[0, 20, 40]),
            (SplitAxis::Y, &[0, 12, 30]),
            (SplitAxis::X, &[0, 10, 22, 40]),
            // An empty slab in between, and slabs thinner than the giant.
            (SplitAxis::X, &[0, 18, 18, 21, 40]),
            (SplitAxis::Y, &[0, 7, 9, 30]),
            (SplitAxis::X, &[0, 5, 10, 15, 20, 25, 30, 40]),
        ];
        for (axis, bounds) in splits {
            let many = run(scene, axis, bounds, None, STEPS, STEPS);
            assert!(many.migrated, "grains must change ranks");
            assert!(
                one.state() == many.state(),
                "axis {axis:?} bounds {bounds:?}"
            );
        }
    }
}

#[test]
fn skins_and_calls_do_not_show() {
    for scene in SCENES {
        let one = on_one_rank(scene).state();
        for skin in [2e-5, 1e-3] {
            assert!(
                one == on_one_rank(Scene { skin, ..scene }).state(),
                "skin {skin}"
            );
        }
        assert!(one == run(scene, SplitAxis::X, &[0, 40], None, STEPS, 1).state());
        assert!(one == run(scene, SplitAxis::X, &[0, 14, 40], None, STEPS, 60).state());
    }
}

#[test]
fn restarts_on_other_ranks_do_not_show() {
    for scene in SCENES {
        let one = on_one_rank(scene);
        let a = run(scene, SplitAxis::X, &[0, 40], None, 300, 300);
        let b = run(scene, SplitAxis::X, &[0, 21, 40], Some(&a), 300, 300);
        let c = run(scene, SplitAxis::Y, &[0, 9, 15, 30], Some(&b), 300, 300);
        let mut d = run(scene, SplitAxis::X, &[0, 40], Some(&c), 300, 300);
        for earlier in [a, b, c] {
            d.breaks.extend(earlier.breaks);
        }
        assert_eq!(d.contacts.steps, STEPS);
        assert!(one.state() == d.state());
    }
}

/// Returns a heap large enough for threads to be used.
fn heap(threads: usize) -> (NamedColumns, u64) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        let mut region =
            GrainDomain::<PlaneSpace>::closed(Vector2::zeros(), Vector2::new(0.21, 0.3), 1e-3);
        region.periodic[0] = true;
        let mut settings = DemSettings::new(region, 2e-6, 3e-4);
        settings.gravity = Vector2::new(1.0, -9.81);
        let walls = Wall::of_box(region.lower, region.upper, [false, true, false], 0);
        let parameters = cohesive_frictional::CohesiveFrictionalParameters {
            linear: linear::LinearParameters {
                normal_stiffness: Scaled::Absolute(5e5),
                ..PAPER.linear
            },
            cohesion: Scaled::Absolute(0.3),
        };
        let mut dem = cohesive(parameters, settings, walls);
        let mut particles = Particles::new();
        for n in 0..7_000_u32 {
            let mut draw = Stream::new(9, u64::from(n), 0);
            let at = Vector2::new(
                0.0011 + 0.002_08 * f64::from(n % 100),
                0.001 + 0.002 * f64::from(n / 100),
            );
            let body = Body::uniform::<PlaneSpace>(
                u64::from(n),
                0.000_99 + 8e-5 * draw.uniform(),
                2600.0,
                0,
            );
            let velocity = Vector2::new(draw.uniform() - 0.5, draw.uniform() - 0.5) * 3.0;
            particles.insert(
                body,
                Motion {
                    position: at,
                    velocity,
                    spin: 0.0,
                },
            );
        }
        dem.bond_existing_contacts(&mut particles, &alone())
            .unwrap();
        dem.advance_many(&mut particles, &alone(), 200).unwrap();
        (particles.table(), dem.take_breaks().len() as u64)
    })
}

#[test]
fn threads_do_not_show() {
    let (one, breaks) = heap(1);
    assert!(breaks > 100, "bonds must break");
    let (two, breaks_by_two) = heap(2);
    assert_eq!(breaks, breaks_by_two);
    assert!(one == two);
}

/// Checks a bonded layer round a periodic box whose lists are valid for many steps: contacts with ghosts between two
/// calls, and steps after all bonds were removed.
#[test]
fn threads_do_not_show_in_lists_that_last() {
    let layer = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| {
            let (radius, pitch) = (1e-3, 1.999e-3);
            let size = Vector2::new(60.0 * pitch, 22.0 * pitch);
            let mut region = GrainDomain::<PlaneSpace>::closed(Vector2::zeros(), size, 1e-3);
            region.periodic[0] = true;
            let mut settings = DemSettings::new(region, 2e-6, 3e-4);
            settings.gravity = Vector2::new(0.0, -9.81);
            let walls = Wall::of_box(region.lower, region.upper, [false, true, false], 0);
            let mut dem = cohesive(PAPER, settings, walls);
            let mut particles = Particles::new();
            for n in 0..1200_u32 {
                let mut draw = Stream::new(4, u64::from(n), 0);
                let motion = Motion {
                    position: Vector2::new(f64::from(n / 20) + 0.5, f64::from(n % 20) + 0.5)
                        * pitch,
                    velocity: Vector2::new(draw.uniform() - 0.5, draw.uniform() - 0.5) * 0.01,
                    spin: 0.0,
                };
                let body = Body::uniform::<PlaneSpace>(u64::from(n), radius, 2600.0, 0);
                particles.insert(body, motion);
            }
            dem.bond_existing_contacts(&mut particles, &alone())
                .unwrap();
            dem.advance_many(&mut particles, &alone(), 41).unwrap();
            let bonded = particles.table();
            let (mut contacts, mut with_ghosts) = (Vec::new(), 0);
            dem.for_each_contact(&particles, |contact| {
                with_ghosts += usize::from(contact.other.is_some_and(|k| k >= particles.owned()));
                contacts.push(contact);
            });
            assert!(with_ghosts >= 20, "{with_ghosts}");
            dem.advance_many(&mut particles, &alone(), 10).unwrap();
            let rebuilds = dem.statistics(&particles).rebuilds;
            assert_eq!(rebuilds, 1);
            (bonded, contacts, particles.table())
        })
    };
    let one = layer(1);
    assert!(one.0 != one.2);
    for threads in [2, 3] {
        assert!(one == layer(threads), "{threads} threads");
    }
}

/// Checks that integers from ghosts arrive at their owners, each once.
#[test]
fn ghost_entries_are_summed_at_the_owner() {
    let scene = SCENES[1];
    let sums = |bounds: &[usize]| {
        let parts = on_slabs(SplitAxis::X, bounds, |domain| {
            let mut particles = Particles::new();
            if domain.rank() == 0 {
                for (body, motion) in grains() {
                    particles.insert(body, motion);
                }
            }
            dem(scene).prepare(&mut particles, &domain).unwrap();
            // Each rank counts, for every image, its own planes that the body covers.
            let mut values: Vec<[i128; 2]> = (0..particles.len())
                .map(|k| {
                    let (x, r) = (particles.location(k)[0], particles.body[k].radius);
                    let covered = domain
                        .range()
                        .filter(|&plane| ((plane as f64 + 0.5) * 1e-3 - x).abs() < r)
                        .count();
                    [i128::try_from(covered).unwrap(), -1]
                })
                .collect();
            particles.reduce_to_owners(&mut values, &domain).unwrap();
            (0..particles.owned())
                .map(|k| (particles.body[k].id, values[k][0]))
                .collect::<Vec<_>>()
        });
        let mut all: Vec<(u64, i128)> = parts.into_iter().flatten().collect();
        all.sort_unstable();
        all
    };
    let one = sums(&[0, 40]);
    // The giant covers 10 planes of 1 mm.
    assert_eq!(one.last(), Some(&(500_000, 10)));
    assert_eq!(one, sums(&[0, 20, 40]));
    assert_eq!(one, sums(&[0, 18, 18, 21, 40]));
}
