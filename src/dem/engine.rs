//! Solid step, compiled once for each contact law. [`bodies`] defines how a law treats bodies other than spheres.
//!
//! Lists are built when a grain may have moved half the skin since the last lists. No result depends on when this
//! happens:
//!
//! - Separations come from raw positions and whole box lengths.
//! - Forces are added in the order of the other grain's id, walls after grains.
//! - The history of a contact lives exactly as long as the surfaces overlap or the bond holds.
//!
//! | file | holds |
//! |---|---|
//! | `lists` | listed and active pairs |
//! | `ahead` | loads for bodies that another program moves |
//! | `pairs` | one pair: separation, action of the law |
//! | `facets` | contacts with walls of facets |
//! | `near_facets` | search for the facets near grains |
//! | `flush` | walls in one plane |
//! | `parts` | forces and motion of spheres, by threads |
//! | `blocks` | bodies that are polyhedra |
//! | `keys` | keys of contacts |
//! | `histories` | contact histories between lists and runs |
//! | `rebuild` | grains and histories sent to the owners of the grains, then ghosts and lists |
//! | `bond_events` | bonds made, failed and removed |
//! | `report` | contacts and counts for output |

mod ahead;
mod any;
mod blocks;
pub(super) mod bodies;
mod bond_events;
mod drive;
mod facets;
mod flush;
mod histories;
mod keys;
mod lists;
mod near_facets;
mod pairs;
mod parts;
pub(super) mod rebuild;
mod report;

use super::census::agree;
use super::contact::{Failure, PairTable};
use super::deepest::{Deepest, Record};
use super::integrate::{self, Fastest, Kick, Phase};
use super::particles::Particles;
use super::servo::Servos;
use super::space::{Components, Space};
use super::walls::Wall;
use super::{BondBreak, DemSettings};
pub(super) use any::{AnyEngine, MakeEngine};
use base::error::Error;
use bodies::Bodies;
use decomposition::Domain;
use facets::Facets;
pub(super) use keys::{Key, WallKey};
use pairs::{Pair, WallPair};
use parts::Parts;
use std::marker::PhantomData;

/// Bond at a wall that failed.
#[derive(Clone, Copy, Debug)]
struct WallFailure<S: Space> {
    grain: u32,
    wall: u32,
    /// Vector from the grain's centre to the contact \[m\].
    arm: S::Vector,
    mode: Failure,
}

/// Effect of a pair in one step.
#[derive(Clone, Copy, Debug)]
struct Action<S: Space> {
    /// Force on the second body; the first is subject to the opposite force.
    force: S::Vector,
    on_first: S::Spin,
    on_second: S::Spin,
    failure: Option<Failure>,
}

impl<S: Space> Default for Action<S> {
    fn default() -> Self {
        Self {
            force: S::Vector::default(),
            on_first: S::Spin::default(),
            on_second: S::Spin::default(),
            failure: None,
        }
    }
}

/// Lists of pairs of nearby grains.
#[derive(Debug)]
struct Lists<S: Space, L: Bodies<S>> {
    pairs: Vec<Pair<L::Scale, L::History>>,
    /// Indices of the pairs that may be in contact.
    active: Vec<u32>,
    /// Active pairs found by each thread.
    chosen: Vec<Vec<u32>>,
    /// Offsets of the periodic axes for separations \[m\]: zero first, then each that a pair has.
    offsets: Vec<S::Vector>,
    /// Id and shift of each entry when the lists were built, and the number of owned entries.
    names: Vec<(u64, [i32; 3])>,
    named_owned: usize,
    parts: Parts<S, L::Scale, L::History>,
}

/// Lists of grains near walls.
#[derive(Debug)]
struct SolidLists<S: Space, L: Bodies<S>> {
    wall_pairs: Vec<WallPair<L::Constants, L::History>>,
    /// Buffers for the pairs that each thread finds.
    planes_found: Vec<Vec<WallPair<L::Constants, L::History>>>,
    /// Facet contacts of each part; a single entry without parts.
    facets: Vec<Facets<L::Constants, L::History>>,
    space: PhantomData<S>,
}

/// Range in which the lists are valid.
#[derive(Debug, Default)]
pub(super) struct Validity {
    /// `true` if the lists belong to the present grains.
    listed: bool,
    /// Longest path of any grain or wall since the lists were built \[m\].
    path: f64,
    /// Path up to which the active pairs are complete \[m\], and the step at which they were determined.
    activated: f64,
    activated_at: u64,
    /// Path of a grain between two checks of all gaps \[m\].
    check_path: f64,
    grain_count: Option<u64>,
    pub(super) rebuilds: u64,
    pub(super) tested: u64,
}

/// Results of a step in addition to loads.
#[derive(Debug)]
pub(super) struct Events<S: Space> {
    pub(super) breaks: Vec<BondBreak<S>>,
    actions: Vec<Action<S>>,
    failures: Vec<(u32, Failure)>,
    wall_failures: Vec<WallFailure<S>>,
    /// Deepest contact of this step, if it is deeper than all earlier ones.
    record: Record,
    pub(super) deepest: Deepest,
}

/// Contacts and lists for one law.
#[derive(Debug)]
pub(super) struct Engine<S: Space, L: Bodies<S>> {
    pub(super) law: L,
    rows: PairTable<L::Row>,
    pub(super) settings: DemSettings<S>,
    pub(super) walls: Vec<Wall<S>>,
    pub(super) servos: Servos<S>,
    pub(super) steps: u64,
    lists: Lists<S, L>,
    solids: SolidLists<S, L>,
    pub(super) validity: Validity,
    pub(super) events: Events<S>,
    pub(super) histories: Vec<(Key, L::History)>,
    pub(super) wall_histories: Vec<(WallKey, L::History)>,
    parallel: bool,
    /// Factor of the strengths of bonds: 1 except in [`super::Dem::set_bond_strength`].
    bond_strength: f64,
    scratch: L::Scratch,
}

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Deactivates walls, given by their indices, or activates them again; contacts with other walls are kept.
    pub(super) fn set_walls_open(&mut self, walls: &[usize], open: bool) {
        for &wall in walls {
            if let Some(wall) = self.walls.get_mut(wall) {
                wall.open = open;
                self.validity.listed = false;
            }
        }
    }

    pub(super) fn new(law: L, settings: DemSettings<S>, walls: Vec<Wall<S>>) -> Self {
        Self {
            rows: law.table(),
            law,
            settings,
            walls,
            servos: Servos::default(),
            steps: 0,
            lists: Lists {
                pairs: Vec::new(),
                active: Vec::new(),
                chosen: Vec::new(),
                offsets: Vec::new(),
                names: Vec::new(),
                named_owned: 0,
                parts: Parts::default(),
            },
            solids: SolidLists {
                wall_pairs: Vec::new(),
                planes_found: Vec::new(),
                facets: vec![Facets::default()],
                space: PhantomData,
            },
            validity: Validity {
                check_path: settings.skin / 64.0,
                ..Validity::default()
            },
            events: Events {
                breaks: Vec::new(),
                actions: Vec::new(),
                failures: Vec::new(),
                wall_failures: Vec::new(),
                record: Record::default(),
                deepest: Deepest::default(),
            },
            histories: Vec::new(),
            wall_histories: Vec::new(),
            parallel: false,
            bond_strength: 1.0,
            scratch: L::Scratch::default(),
        }
    }

    /// Builds lists and ghosts for the present grains, and computes the contact loads if they are not known yet.
    /// Collective.
    pub(super) fn prepare(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<(), Error> {
        // Flags of missing data on any rank: loads, or lists and then perhaps loads.
        let flag = |set: bool| -> f64 { if set { 1.0 } else { 0.0 } };
        let listed = self.validity.listed && particles.listed;
        let mut missing = largest(domain, flag(!particles.loaded).max(2.0 * flag(!listed)));
        if missing > 1.5 {
            self.rebuild(particles, domain)?;
            missing = largest(domain, flag(!particles.loaded));
        }
        if missing > 0.5 {
            self.all_forces(particles, 0.0, None);
        }
        particles.loaded = true;
        Ok(())
    }

    /// Makes `steps` solid steps. Collective.
    pub(super) fn advance(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        steps: u64,
    ) -> Result<(), Error> {
        self.prepare(particles, domain)?;
        let kick = Kick {
            gravity: self.settings.gravity,
            time_step: self.settings.time_step,
            damping: self.settings.local_damping,
        };
        let dt = kick.time_step;
        let mut fastest = Fastest::default();
        if steps > 0 {
            fastest = (self.law).advance(particles, &kick, Phase::First, self.parallel);
        }
        for step in 1..=steps {
            self.steps += 1;
            let mut speed = fastest.speed_squared.sqrt();
            for wall in self.walls.iter_mut().filter(|wall| !wall.open) {
                let drift = wall.drift();
                wall.point += drift * dt;
                speed = speed.max(match wall.surface {
                    None => wall.normal.scalar(&drift).abs(),
                    Some(_) => drift.length(),
                });
            }
            // Larger than the true path by more than any rounding error.
            let path = self.validity.path + speed * dt * (1.0 + 1e-9);
            self.validity.path = largest(domain, if fastest.bad { f64::INFINITY } else { path });
            if self.validity.path == f64::INFINITY {
                return agree(domain, all_bounded(particles)).and(Err(Error::Numerical(
                    "a grain moves too far in one step".into(),
                )));
            }
            if self.validity.path >= 0.5 * self.settings.skin {
                self.rebuild(particles, domain)?;
            } else {
                particles.refresh_ghosts(domain)?;
                L::pose(&mut self.scratch, particles, self.parallel);
                if self.validity.path > self.validity.activated {
                    self.activate(particles);
                }
            }
            if !self.servos.list.is_empty() {
                self.drive_servos(particles, domain);
            }
            let phase = if step < steps {
                Phase::Between
            } else {
                Phase::Last
            };
            fastest = self.all_forces(particles, dt, Some((&kick, phase)));
        }
        Ok(())
    }

    /// Computes the contact loads of all owned bodies and records the deepest contact. Then the bodies move in
    /// `phase`.
    fn all_forces(
        &mut self,
        particles: &mut Particles<S>,
        dt: f64,
        phase: Option<(&Kick<S>, Phase)>,
    ) -> Fastest {
        self.events.record = Record::beyond(self.events.deepest.part);
        let moved = L::forces(self, particles, dt, phase);
        let id = |entry: u32| self.lists.names[entry as usize].0;
        if let Some(deeper) = self.events.record.named(id) {
            self.events.deepest = deeper;
        }
        match (moved, phase) {
            (Some(fastest), _) => fastest,
            (None, Some((kick, phase))) => self.law.advance(particles, kick, phase, self.parallel),
            (None, None) => Fastest::default(),
        }
    }

    /// Computes the contact loads of all owned spheres at the present positions and velocities; histories advance
    /// by `dt` \[s\]. With several threads the spheres then also move in `phase`, and the largest speed is
    /// returned.
    fn sphere_forces(
        &mut self,
        particles: &mut Particles<S>,
        dt: f64,
        phase: Option<(&Kick<S>, Phase)>,
    ) -> Option<Fastest> {
        self.validity.tested += self.lists.active.len() as u64;
        self.events.failures.clear();
        self.events.wall_failures.clear();
        let fastest = if self.settings.region.any_periodic() {
            self.forces_by_parts::<true>(particles, dt, phase)
        } else {
            self.forces_by_parts::<false>(particles, dt, phase)
        };
        if !(self.events.failures.is_empty() && self.events.wall_failures.is_empty()) {
            self.report_failures(particles);
        }
        if fastest.is_some() {
            self.take_moved(particles);
        }
        fastest
    }
}

/// Returns the maximum of a value over all ranks. Collective.
fn largest(domain: &Domain, value: f64) -> f64 {
    domain.communicator().all_reduce_max_f64(value)
}

/// Returns an error that names the first owned grain with non-finite values.
fn all_bounded<S: Space>(particles: &Particles<S>) -> Result<(), Error> {
    let finite = |v: &S::Vector| v.scalar(v).is_finite();
    match (0..particles.owned()).find(|&k| {
        let motion = &particles.motion[k];
        !(finite(&motion.position)
            && motion.velocity.scalar(&motion.velocity) < integrate::SPEED_LIMIT
            && motion.spin.scalar(&motion.spin).is_finite())
    }) {
        None => Ok(()),
        Some(k) => Err(rebuild::lost(particles, k, "has no finite motion")),
    }
}
