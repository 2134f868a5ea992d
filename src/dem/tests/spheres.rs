//! Equal bits of spheres on any number of ranks and threads, for any skin and across restarts, for each contact law
//! of the fissure and each kind of wall.

use std::sync::Arc;

use nalgebra::Vector3;

use super::super::contact::bridges::{self, Bridged};
use super::super::contact::contact_bond::{self, ContactBond};
use super::super::contact::hertz_mindlin::{self, HertzMindlin};
use super::super::contact::rolling::{self, Rolling};
use super::super::state::{Contacts, NamedColumns};
use super::same_bits::{bits, on_slabs};
use super::*;
use base::random::Stream;
use decomposition::SplitAxis;

#[derive(Clone, Copy, Debug)]
enum Which {
    RollingLinear,
    Bonds,
    RollingBonds,
    Elastic,
    Bridges,
}

const STEPS: u64 = 600;

fn dem(which: Which, skin: f64, time_step: f64) -> Dem<Volume> {
    let clay = ContactBond {
        parameters: PairTable::uniform(
            1,
            contact_bond::ContactBondParameters {
                linear: linear::LinearParameters {
                    normal_stiffness: Scaled::Absolute(2e4),
                    normal_damping_ratio: 0.1,
                    shear_damping_ratio: 0.1,
                    ..SPRINGS
                },
                tensile_strength: 0.02,
                shear_strength: 0.03,
                bonding_gap: 1e-5,
                unstressed: true,
            },
        ),
    };
    let parameters = PairTable::uniform(
        1,
        rolling::RollingParameters {
            friction: 0.2,
            damping_ratio: 0.1,
        },
    );
    let law = match which {
        Which::RollingLinear => Law::RollingLinear(Rolling {
            law: Linear {
                parameters: clay.parameters.map(|p| p.linear),
            },
            parameters,
        }),
        Which::Bonds => Law::ContactBond(clay),
        Which::RollingBonds => Law::RollingContactBond(Rolling {
            law: clay,
            parameters,
        }),
        Which::Bridges => Law::BridgedRollingLinear(Bridged {
            law: Rolling {
                law: Linear {
                    parameters: clay.parameters.map(|p| p.linear),
                },
                parameters,
            },
            parameters: PairTable::uniform(
                1,
                bridges::BridgeParameters {
                    surface_tension: 0.0728,
                    contact_angle: 0.2,
                    volume: bridges::BridgeVolume::Moisture(bridges::BridgeMoisture {
                        bridges_per_grain: 6.0,
                        merging_saturation: 0.3,
                    }),
                },
            ),
            path: "contact.linear.bridges",
        }),
        // As stiff as the springs of the others at the overlaps of this heap.
        Which::Elastic => Law::HertzMindlin(HertzMindlin {
            parameters: PairTable::uniform(
                1,
                hertz_mindlin::HertzMindlinParameters {
                    moduli: [1.2e8, 5e7],
                    friction: 0.4,
                    damping: 0.1,
                    attraction: false,
                    impact_speed: 0.3,
                },
            ),
            materials: Vec::new(),
        }),
    };
    let region = GrainDomain::closed(Vector3::zeros(), Vector3::new(0.03, 0.012, 0.014), 1e-3);
    let mut settings = DemSettings::new(region, time_step, skin);
    settings.gravity = Vector3::new(2.0, 0.5, -9.81);
    // A mesh as the floor, small triangles and large, a polygon at one end, a box that moves into the grains, and
    // planes.
    let mut vertices = Vec::new();
    for y in [-0.001, 0.013] {
        for x in [-0.001_f64, 0.006, 0.0091, 0.0117, 0.0152, 0.031] {
            vertices.push(Vector3::new(x, y, 2e-3 * (300.0 * x).sin().abs()));
        }
    }
    let strips = (0..5).flat_map(|k| [vec![k, k + 1, k + 7], vec![k, k + 7, k + 6]]);
    let floor = FacetSurface::new(vertices, &strips.collect::<Vec<_>>()).unwrap();
    let end = [
        [-0.001, -0.001],
        [0.013, -0.001],
        [0.013, 0.02],
        [-0.001, 0.02],
    ];
    let end = end.map(|[y, z]| Vector3::new(0.0, y, z)).to_vec();
    let end = FacetSurface::new(end, &[vec![0, 1, 2, 3]]).unwrap();
    let plunger = FacetSurface::of_box(
        Vector3::new(0.012, 0.004, 0.011),
        Vector3::new(0.016, 0.008, 0.0135),
    );
    let mut plunger = Wall::of_surface(Arc::new(plunger.unwrap()), 0);
    plunger.velocity = Vector3::new(0.1, 0.0, -0.6);
    let walls = vec![
        Wall::of_surface(Arc::new(floor), 0),
        Wall::new(Vector3::new(0.03, 0.0, 0.0), -Vector3::x(), 0),
        Wall::of_surface(Arc::new(end), 0),
        Wall::new(Vector3::zeros(), Vector3::y(), 0),
        plunger,
        Wall::new(Vector3::new(0.0, 0.012, 0.0), -Vector3::y(), 0),
    ];
    Dem::new(law, settings, walls).unwrap()
}

fn grains() -> Vec<(Body, Motion<Volume>)> {
    let mut all = Vec::new();
    for n in 0..15 * 6 * 5_u32 {
        let mut draw = Stream::new(5, u64::from(n), 0);
        let cell = Vector3::new(f64::from(n % 15), f64::from(n / 15 % 6), f64::from(n / 90));
        let position = Vector3::new(1.002e-3, 1.002e-3, 3.0e-3) + cell * 1.995e-3;
        if position[0] > 0.011 && position[0] < 0.017 && position[2] > 0.010 {
            continue;
        }
        let radius = 0.9955e-3 + 4e-6 * draw.uniform();
        let body = Body::uniform::<Volume>(u64::from(n * 131 % 997), radius, 2600.0, 0);
        let velocity = Vector3::from_fn(|_, _| 0.3 * (draw.uniform() - 0.5));
        let spin = Vector3::from_fn(|_, _| 100.0 * (draw.uniform() - 0.5));
        all.push((
            body,
            Motion {
                position,
                velocity,
                spin,
            },
        ));
    }
    all
}

/// Both grains, or grain and wall, and the mode of failure.
type Broken = (u64, u64, Option<u64>, Option<u32>, Failure);

#[derive(Clone, Default)]
struct Saved {
    grains: NamedColumns,
    contacts: Contacts,
    breaks: Vec<Broken>,
}

impl Saved {
    fn same(&self, other: &Self) -> bool {
        let sorted = |one: &Self| {
            let mut breaks = one.breaks.clone();
            breaks.sort_unstable_by_key(|b| (b.0, b.1, b.2, b.3));
            breaks
        };
        bits(&self.grains, &self.contacts) == bits(&other.grains, &other.contacts)
            && sorted(self) == sorted(other)
            && self.contacts.faces == other.contacts.faces
    }
}

fn run(
    which: Which,
    skin: f64,
    axis: SplitAxis,
    bounds: &[usize],
    from: Option<&Saved>,
    steps: u64,
) -> Saved {
    let size = bounds.len() - 1;
    let parts = on_slabs(axis, bounds, |domain| {
        let rank = domain.rank();
        let mut dem = dem(which, skin, 4e-6);
        let mut particles = Particles::new();
        if let Some(saved) = from {
            dem.restore(&saved.contacts).unwrap();
            let mine = saved.grains.filter(|row| row % size == rank);
            particles = Particles::from_table(&mine).unwrap();
        } else {
            for (body, motion) in grains() {
                if usize::try_from(body.id).unwrap() % size == rank {
                    particles.insert(body, motion);
                }
            }
            dem.bond_existing_contacts(&mut particles, &domain).unwrap();
        }
        let mut done = 0;
        if matches!(which, Which::Bridges) {
            // The moisture comes after the first messages to ghosts, which it makes longer.
            dem.advance(&mut particles, &domain).unwrap();
            done = 1;
            particles.keep_moisture();
            for k in 0..particles.owned() {
                let id = f64::from(u32::try_from(particles.body[k].id).unwrap());
                particles.moisture[k] = [0.1 * (id % 11.0), 0.005 * (id % 7.0)];
            }
        }
        dem.advance_many(&mut particles, &domain, steps - done)
            .unwrap();
        let breaks = dem.take_breaks();
        Saved {
            grains: particles.table(),
            contacts: dem.contacts(),
            breaks: breaks
                .iter()
                .map(|b| (b.step, b.grain, b.other, b.wall, b.mode))
                .collect(),
        }
    });
    let mut whole = Saved::default();
    for part in parts {
        append(
            (&mut whole.grains, &mut whole.contacts),
            (&part.grains, part.contacts),
        );
        whole.breaks.extend(part.breaks);
    }
    whole
}

#[test]
fn ranks_skins_and_restarts_do_not_show() {
    let mut touched = std::collections::BTreeSet::new();
    for which in [
        Which::RollingLinear,
        Which::Bonds,
        Which::RollingBonds,
        Which::Elastic,
        Which::Bridges,
    ] {
        let one = run(which, 2e-4, SplitAxis::X, &[0, 30], None, STEPS);
        assert!(
            one.contacts.grains.rows() > 50,
            "{which:?}: {} contacts with a history",
            one.contacts.grains.rows()
        );
        let at_walls = one.contacts.walls.get_whole("wall").unwrap();
        let facets = one.contacts.walls.get_whole("facet").unwrap();
        touched.extend(at_walls.iter().copied());
        assert!(facets.iter().max() > Some(&5));
        let bonded = matches!(which, Which::Bonds | Which::RollingBonds);
        assert_eq!(
            bonded,
            one.breaks.len() > 20,
            "{which:?}: {} breaks",
            one.breaks.len()
        );
        if bonded {
            assert!(
                one.breaks.iter().any(|b| b.3.is_some()),
                "a bond at a wall must break"
            );
            assert!(one.breaks.iter().any(|b| b.4 == Failure::Shear));
            assert!(one.breaks.iter().any(|b| b.4 == Failure::Tension));
        }
        for (axis, bounds) in [
            (SplitAxis::X, &[0, 14, 30][..]),
            (SplitAxis::Y, &[0, 5, 12]),
            (SplitAxis::Z, &[0, 3, 6, 14]),
            (SplitAxis::X, &[0, 8, 14, 15, 30]),
        ] {
            let many = run(which, 2e-4, axis, bounds, None, STEPS);
            assert!(
                one.same(&many),
                "{which:?}: axis {axis:?} bounds {bounds:?}"
            );
        }
        for skin in [3e-5, 6e-4] {
            assert!(
                one.same(&run(which, skin, SplitAxis::X, &[0, 30], None, STEPS)),
                "{which:?}: skin {skin}"
            );
        }
        let mut a = run(which, 2e-4, SplitAxis::X, &[0, 30], None, STEPS / 3);
        let b = run(which, 2e-4, SplitAxis::Z, &[0, 4, 14], Some(&a), STEPS / 3);
        let mut c = run(
            which,
            2e-4,
            SplitAxis::X,
            &[0, 11, 20, 30],
            Some(&b),
            STEPS / 3,
        );
        c.breaks.append(&mut a.breaks);
        c.breaks.extend(b.breaks);
        assert!(one.same(&c), "{which:?}: restarts");
    }
    assert_eq!(touched.into_iter().collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
}

/// Checks a heap that is large enough for two threads.
#[test]
fn threads_do_not_show() {
    let heap = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut dem = dem(Which::RollingBonds, 2e-4, 5e-7);
            let mut particles = Particles::new();
            for n in 0..6400_u32 {
                let mut draw = Stream::new(9, u64::from(n), 0);
                let cell = Vector3::new(
                    f64::from(n % 20),
                    f64::from(n / 20 % 20),
                    f64::from(n / 400),
                );
                let position = Vector3::new(0.4e-3, 0.4e-3, 2.6e-3)
                    + cell.component_mul(&Vector3::new(1.5e-3, 0.58e-3, 0.58e-3));
                if position[0] > 0.011 && position[0] < 0.017 && position[2] > 0.010 {
                    continue;
                }
                let body = Body::uniform::<Volume>(
                    u64::from(n),
                    0.29e-3 + 3e-6 * draw.uniform(),
                    2600.0,
                    0,
                );
                let velocity = Vector3::from_fn(|_, _| draw.uniform() - 0.5);
                particles.insert(
                    body,
                    Motion {
                        position,
                        velocity,
                        spin: Vector3::zeros(),
                    },
                );
            }
            dem.bond_existing_contacts(&mut particles, &alone())
                .unwrap();
            dem.advance_many(&mut particles, &alone(), 100).unwrap();
            (particles.table(), dem.contacts(), dem.take_breaks().len())
        })
    };
    let one = heap(1);
    assert!(one.2 > 50, "bonds must break");
    for threads in [2, 3] {
        assert!(one == heap(threads), "{threads} threads");
    }
}
