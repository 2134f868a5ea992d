//! The solid step, compiled once per contact law; [`bodies`] says where a law has other bodies than spheres.
//!
//! Lists are made when a grain may have moved half the skin since they were last made. Nothing depends on when: separations
//! come from raw positions and whole box lengths, forces are added in the order of the other grain's id (walls after
//! grains), and the memory of a contact lives exactly as long as the surfaces overlap or the bond holds.
//! Of the listed pairs only the *active* ones are tested: those that grains can close before the next look at all gaps, which
//! comes when a grain may have moved as far as the last look allowed for. In a bed nearly at rest these are the contacts.

mod blocks;
pub(super) mod bodies;
mod ledger;
mod pairs;
mod parts;

use super::contact::{ContactLaw, Failure, PairTable, Partners, Touch};
use super::ghosts;
use super::integrate::{self, Fastest, Kick};
use super::message::{Reader, Writer};
use super::migration::{self, pack_grains, unpack_grains};
use super::neighbors::Search;
use super::particles::{Body, Load, Motion, Particles};
use super::ranks::{Ranks, agree};
use super::region::Region;
use super::space::{Components, Space};
use super::surface::{Nearest, Surface};
use super::walls::Wall;
use super::{BondBreak, Settings, Statistics};
use crate::error::Error;
use bodies::Bodies;
use pairs::*;
use parts::Parts;

/// A listed pair: the lower id first. The step is bound by reading these: 64 bytes in the linear law.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair<C, M> {
    first: u32,
    second: u32,
    /// Sum of the radii (m).
    reach: f64,
    /// Radius of the first (m).
    radius: f64,
    /// Place in the table of material pairs.
    row: u32,
    /// Place in the table of separations to add.
    offset: u32,
    scale: C,
    memory: M,
}

impl<C, M> Pair<C, M> {
    #[inline(always)]
    fn ends(&self) -> (usize, usize) {
        (self.first as usize, self.second as usize)
    }
}

/// A listed pair of a wall and an owned grain.
#[derive(Clone, Copy, Debug)]
pub(super) struct WallPair<C, M> {
    wall: u32,
    grain: u32,
    radius: f64,
    constants: C,
    memory: M,
}

/// An owned grain and a wall of facets that it is close to.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfacePair<C> {
    wall: u32,
    grain: u32,
    radius: f64,
    /// The widest gap (m) over which a bond acts.
    opening: f64,
    /// Facets within reach: a part of `Facets::near`.
    near: (u32, u32),
    /// Contacts: a part of `Facets::held`.
    held: (u32, u32),
    constants: C,
}

/// The memory of a contact with a facet.
#[derive(Clone, Copy, Debug)]
struct Held<M> {
    facet: u32,
    memory: M,
}

/// Contacts with facets. A grain touches a surface at any number of places, so that contacts are listed anew in each step, and
/// take over the memory of the same facet, or else of a facet beside it: shear survives an interior edge.
#[derive(Debug)]
struct Facets<C, M> {
    pairs: Vec<SurfacePair<C>>,
    near: Vec<u32>,
    held: Vec<Held<M>>,
    next: Vec<Held<M>>,
    /// Pairs to look at until the next look at all gaps.
    active: Vec<u32>,
    found: Vec<Nearest>,
    taken: Vec<bool>,
    close: Vec<[u32; 3]>,
}

impl<C, M> Default for Facets<C, M> {
    fn default() -> Self {
        Self {
            pairs: Vec::new(),
            near: Vec::new(),
            held: Vec::new(),
            next: Vec::new(),
            active: Vec::new(),
            found: Vec::new(),
            taken: Vec::new(),
            close: Vec::new(),
        }
    }
}

impl<C: Copy, M: Copy + Default + PartialEq> Facets<C, M> {
    /// The contacts of the sphere of pair `k` with its surface, added to its load; they are held for the next step.
    #[inline(always)]
    fn act_on_sphere<S: Space, L: ContactLaw<S, Constants = C, Memory = M>>(
        &mut self,
        k: usize,
        walls: &[Wall<S>],
        motion: &[Motion<S>],
        contact: &mut [Load<S>],
        failures: &mut Vec<WallFailure<S>>,
        dt: f64,
    ) {
        let pair = &mut self.pairs[k];
        let wall = &walls[pair.wall as usize];
        let Some(surface) = &wall.surface else {
            return;
        };
        let grain = &motion[pair.grain as usize];
        let held = &self.held[pair.held.0 as usize..pair.held.1 as usize];
        let reach = if held.iter().any(|old| L::bonded(&old.memory)) {
            pair.radius + pair.opening
        } else {
            pair.radius
        };
        let near = &self.near[pair.near.0 as usize..pair.near.1 as usize];
        surface.contacts(near, &wall.local(&grain.position), reach, &mut self.found);
        self.taken.clear();
        self.taken.resize(held.len(), false);
        let start = ghosts::index(self.next.len());
        for one in &self.found {
            let mut memory = memory_of(surface, held, &mut self.taken, &self.found, one.facet);
            if one.distance >= pair.radius && !L::bonded(&memory) {
                continue;
            }
            let normal = S::from_volume(&one.normal);
            let failure = act_at_wall::<S, L>(
                (&pair.constants, &mut memory),
                (pair.radius, one.distance, &normal),
                (grain, &wall.velocity),
                &mut contact[pair.grain as usize],
                dt,
            );
            if let Some(mode) = failure {
                failures.push(WallFailure {
                    grain: pair.grain,
                    wall: pair.wall,
                    arm: normal * -one.distance,
                    mode,
                });
            }
            // A fresh memory is none, whether lists were made meanwhile or not.
            if (one.distance < pair.radius || L::bonded(&memory)) && memory != M::default() {
                self.next.push(Held {
                    facet: one.facet,
                    memory,
                });
            }
        }
        pair.held = (start, ghosts::index(self.next.len()));
    }

    /// Facets near a pair's grain.
    fn near(&self, pair: &SurfacePair<C>) -> &[u32] {
        &self.near[pair.near.0 as usize..pair.near.1 as usize]
    }

    /// The contacts of a pair.
    fn held(&self, pair: &SurfacePair<C>) -> &[Held<M>] {
        &self.held[pair.held.0 as usize..pair.held.1 as usize]
    }
}

/// The memory among `held` of a contact with `facet`: its own, else that of a facet beside it which no contact in `found` has.
fn memory_of<M: Copy + Default>(
    surface: &Surface,
    held: &[Held<M>],
    taken: &mut [bool],
    found: &[Nearest],
    facet: u32,
) -> M {
    let own = held.iter().position(|old| old.facet == facet);
    let at = own.or_else(|| {
        held.iter().zip(&*taken).position(|(old, taken)| {
            !taken
                && surface.adjacent(old.facet, facet)
                && found.iter().all(|other| other.facet != old.facet)
        })
    });
    at.map_or(M::default(), |at| {
        taken[at] = true;
        held[at].memory
    })
}

/// Which contact at a wall: id of the grain, wall, facet (0 for a plane).
pub(super) type WallKey = (u64, u32, u32);

/// A bond at a wall that failed.
#[derive(Clone, Copy, Debug)]
struct WallFailure<S: Space> {
    grain: u32,
    wall: u32,
    /// From the grain's centre to the contact (m).
    arm: S::Vector,
    mode: Failure,
}

/// Which contact: ids, and how many box lengths further the second's raw position stands than the first's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    pub(super) first: u64,
    pub(super) second: u64,
    pub(super) shift: [i32; 3],
}

/// What a pair does in one step.
#[derive(Clone, Copy, Debug)]
struct Action<S: Space> {
    /// On the second; the first feels the opposite.
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

/// Contacts and lists of one law.
#[derive(Debug)]
pub(super) struct Engine<S: Space, L: Bodies<S>> {
    pub(super) law: L,
    rows: PairTable<L::Row>,
    pub(super) settings: Settings<S>,
    pub(super) walls: Vec<Wall<S>>,
    pub(super) steps: u64,
    pub(super) breaks: Vec<BondBreak<S>>,
    pub(super) rebuilds: u64,
    pub(super) tested: u64,
    listed: bool,
    total: Option<u64>,
    search: Search,
    pairs: Vec<Pair<L::Scale, L::Memory>>,
    /// What periodic axes add to separations (m): none first, then each that occurs, and by how many box lengths.
    offsets: Vec<S::Vector>,
    offset_shifts: Vec<[i32; 3]>,
    active: Vec<u32>,
    wall_pairs: Vec<WallPair<L::Constants, L::Memory>>,
    facets: Facets<L::Constants, L::Memory>,
    /// Id and shift of each entry when the lists were made, and how many were owned.
    names: Vec<(u64, [i32; 3])>,
    named_owned: usize,
    pub(super) memories: Vec<(Key, L::Memory)>,
    pub(super) wall_memories: Vec<(WallKey, L::Memory)>,
    /// How far any grain or wall may have moved since the lists were made (m).
    path: f64,
    /// The active pairs hold up to this path (m), and since this step.
    activated: f64,
    activated_at: u64,
    /// How far a grain may move between two looks at all gaps (m).
    look: f64,
    parallel: bool,
    parts: Parts<S>,
    actions: Vec<Action<S>>,
    failures: Vec<(u32, Failure)>,
    wall_failures: Vec<WallFailure<S>>,
    scratch: L::Scratch,
}

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Takes the walls of these indices out of the way; the contacts of all others stay.
    pub(super) fn open_walls(&mut self, walls: &[usize]) {
        for &wall in walls {
            if let Some(wall) = self.walls.get_mut(wall) {
                wall.open = true;
                self.listed = false;
            }
        }
    }

    pub(super) fn new(law: L, settings: Settings<S>, walls: Vec<Wall<S>>) -> Self {
        Self {
            rows: law.table(),
            law,
            settings,
            walls,
            steps: 0,
            breaks: Vec::new(),
            rebuilds: 0,
            tested: 0,
            listed: false,
            total: None,
            search: Search::default(),
            pairs: Vec::new(),
            offsets: Vec::new(),
            offset_shifts: Vec::new(),
            active: Vec::new(),
            wall_pairs: Vec::new(),
            facets: Facets::default(),
            names: Vec::new(),
            named_owned: 0,
            memories: Vec::new(),
            wall_memories: Vec::new(),
            path: 0.0,
            activated: 0.0,
            activated_at: 0,
            look: settings.skin / 64.0,
            parallel: false,
            parts: Parts::default(),
            actions: Vec::new(),
            failures: Vec::new(),
            wall_failures: Vec::new(),
            scratch: L::Scratch::default(),
        }
    }

    /// Lists and ghosts for the present grains, and the contact loads where they are not known yet. Collective.
    pub(super) fn prepare(
        &mut self,
        particles: &mut Particles<S>,
        ranks: &dyn Ranks,
    ) -> Result<(), Error> {
        let flag = |set: bool| if set { 1.0 } else { 0.0 };
        let listed = self.listed && particles.listed;
        if ranks.maximum(flag(!listed))? > 0.5 {
            self.rebuild(particles, ranks)?;
        }
        if ranks.maximum(flag(!particles.loaded))? > 0.5 {
            L::forces(self, particles, 0.0);
        }
        particles.loaded = true;
        Ok(())
    }

    /// `steps` solid steps. Collective.
    pub(super) fn advance(
        &mut self,
        particles: &mut Particles<S>,
        ranks: &dyn Ranks,
        steps: u64,
    ) -> Result<(), Error> {
        self.prepare(particles, ranks)?;
        let kick = Kick {
            gravity: self.settings.gravity,
            time_step: self.settings.time_step,
            damping: self.settings.local_damping,
        };
        let dt = kick.time_step;
        for step in 0..steps {
            let fastest = self.law.drift(particles, &kick, step > 0, self.parallel);
            self.steps += 1;
            let mut speed = fastest.speed_squared.sqrt();
            for wall in self.walls.iter_mut().filter(|wall| !wall.open) {
                wall.point += wall.velocity * dt;
                speed = speed.max(match wall.surface {
                    None => wall.normal.scalar(&wall.velocity).abs(),
                    Some(_) => wall.velocity.length(),
                });
            }
            // Longer than the true path by more than any rounding.
            let path = self.path + speed * dt * (1.0 + 1e-9);
            self.path = ranks.maximum(if fastest.bad { f64::INFINITY } else { path })?;
            if self.path == f64::INFINITY {
                return agree(ranks, sane(particles)).and(Err(Error::Numerical(
                    "a grain moves too far in one step".into(),
                )));
            }
            if self.path >= 0.5 * self.settings.skin {
                self.rebuild(particles, ranks)?;
            } else {
                particles.refresh_ghosts(ranks)?;
                L::pose(&mut self.scratch, particles, self.parallel);
                if self.path > self.activated {
                    self.activate(particles);
                }
            }
            L::forces(self, particles, dt);
        }
        if steps > 0 {
            self.law.finish(particles, &kick);
        }
        Ok(())
    }

    /// Hands grains to their owners, makes ghosts and lists.
    fn rebuild(&mut self, particles: &mut Particles<S>, ranks: &dyn Ranks) -> Result<(), Error> {
        self.rebuilds += 1;
        let region = self.settings.region;
        self.remember();
        particles.lengths = region.periodic_lengths();
        particles.origin = region.origin();
        particles.drop_ghosts();
        agree(
            ranks,
            L::check(particles).and_then(|()| migration::wrap(particles, &region)),
        )?;
        if ranks.size() > 1 {
            self.migrate(particles, &region, ranks)?;
        }
        particles.sort();
        if let Some(pair) = particles
            .body
            .windows(2)
            .find(|pair| pair[0].id == pair[1].id)
        {
            return Err(Error::Internal(format!(
                "two grains have the id {}",
                pair[0].id
            )));
        }
        let census = migration::census(particles, ranks)?;
        let total: u64 = census.iter().map(|one| one.owned).sum();
        if let Some(before) = self.total {
            let added: u64 = census.iter().map(|one| one.added).sum();
            let removed: u64 = census.iter().map(|one| one.removed).sum();
            if before + added != total + removed {
                return Err(Error::Internal(format!(
                    "grains were lost: {before} + {added} added - {removed} removed are now {total}"
                )));
            }
        }
        self.total = Some(total);
        particles.added = 0;
        particles.removed = 0;
        let smallest = census
            .iter()
            .map(|one| one.smallest)
            .fold(f64::INFINITY, f64::min);
        let largest = census.iter().map(|one| one.largest).fold(0.0, f64::max);
        let gap = self.settings.skin
            + if total > 0 {
                self.law.widest_opening([2.0 * smallest, 2.0 * largest])
            } else {
                0.0
            };
        ghosts::make(
            particles,
            &region,
            &census,
            gap,
            self.settings.ghost_margin,
            ranks,
        )?;
        L::pose(&mut self.scratch, particles, self.parallel);
        self.list(particles, gap);
        particles.listed = true;
        self.listed = true;
        // Twice as many each time: a run that makes lists in every step shows, and its log stays short.
        if self.rebuilds.is_power_of_two() {
            log::debug!(
                "rank {}: lists made {} times in {} solid steps: {} grains of {total} owned, {} ghosts, {} pairs, {} at plane walls, {} at facets; skin {:.3e} m",
                ranks.rank(),
                self.rebuilds,
                self.steps,
                particles.owned(),
                particles.len() - particles.owned(),
                self.pairs.len(),
                self.wall_pairs.len(),
                self.facets.pairs.len(),
                self.settings.skin
            );
        }
        Ok(())
    }

    /// Moves the memories of all contacts out of the lists, by rising key, each once.
    fn remember(&mut self) {
        let with_memory = |pair: &&Pair<L::Scale, L::Memory>| pair.memory != L::Memory::default();
        self.memories
            .reserve_exact(self.pairs.iter().filter(with_memory).count());
        for pair in &self.pairs {
            if pair.memory != L::Memory::default() {
                let key = key(
                    self.names[pair.first as usize],
                    self.names[pair.second as usize],
                );
                self.memories.push((key, pair.memory));
            }
        }
        for pair in &self.wall_pairs {
            if pair.memory != L::Memory::default() {
                let id = self.names[pair.grain as usize].0;
                self.wall_memories.push(((id, pair.wall, 0), pair.memory));
            }
        }
        for pair in &self.facets.pairs {
            let id = self.names[pair.grain as usize].0;
            for held in self.facets.held(pair) {
                if held.memory != L::Memory::default() {
                    self.wall_memories
                        .push(((id, pair.wall, held.facet), held.memory));
                }
            }
        }
        self.pairs.clear();
        self.wall_pairs.clear();
        self.facets.pairs.clear();
        self.facets.held.clear();
        self.names.clear();
        self.put_memories_in_order();
    }

    fn put_memories_in_order(&mut self) {
        self.memories.sort_unstable_by_key(|(key, _)| *key);
        self.memories.dedup_by_key(|(key, _)| *key);
        self.wall_memories.sort_unstable_by_key(|(key, _)| *key);
        self.wall_memories.dedup_by_key(|(key, _)| *key);
    }

    /// Sends grains that left the slab, with their contacts, to their owners.
    fn migrate(
        &mut self,
        particles: &mut Particles<S>,
        region: &Region<S>,
        ranks: &dyn Ranks,
    ) -> Result<(), Error> {
        let owners = migration::owners(particles, region, ranks)?;
        let mut messages = Vec::new();
        let mut numbers = Vec::new();
        for target in (0..ranks.size()).filter(|&target| target != ranks.rank()) {
            let leaving: Vec<usize> = (0..owners.len()).filter(|&k| owners[k] == target).collect();
            if leaving.is_empty() {
                continue;
            }
            let mut ids: Vec<u64> = leaving.iter().map(|&k| particles.body[k].id).collect();
            ids.sort_unstable();
            let leaves = |id: u64| ids.binary_search(&id).is_ok();
            let mut writer = Writer::default();
            pack_grains(particles, &leaving, &mut writer);
            let grains = || {
                self.memories
                    .iter()
                    .filter(|(key, _)| leaves(key.first) || leaves(key.second))
            };
            let walls = || self.wall_memories.iter().filter(|(key, _)| leaves(key.0));
            writer.integer(grains().count() as u64);
            for (key, memory) in grains() {
                writer.integer(key.first);
                writer.integer(key.second);
                for n in key.shift {
                    writer.signed(n);
                }
                pack_memory::<S, L>(memory, &mut numbers, &mut writer);
            }
            writer.integer(walls().count() as u64);
            for ((id, wall, facet), memory) in walls() {
                writer.integer(*id);
                writer.integer(u64::from(*wall));
                writer.integer(u64::from(*facet));
                pack_memory::<S, L>(memory, &mut numbers, &mut writer);
            }
            messages.push((target, writer.0));
        }
        particles.keep(|k| owners[k] == ranks.rank());
        for (_, bytes) in ranks.exchange(messages)? {
            let mut reader = Reader(&bytes);
            unpack_grains(particles, &mut reader)?;
            for _ in 0..reader.integer()? {
                let (first, second) = (reader.integer()?, reader.integer()?);
                let shift = [reader.signed()?, reader.signed()?, reader.signed()?];
                let memory = unpack_memory::<S, L>(&mut numbers, &mut reader)?;
                self.memories.push((
                    Key {
                        first,
                        second,
                        shift,
                    },
                    memory,
                ));
            }
            for _ in 0..reader.integer()? {
                let id = reader.integer()?;
                let mut small = || {
                    u32::try_from(reader.integer()?)
                        .map_err(|_| Error::Internal("a wall beyond 32 bits".into()))
                };
                let (wall, facet) = (small()?, small()?);
                let memory = unpack_memory::<S, L>(&mut numbers, &mut reader)?;
                self.wall_memories.push(((id, wall, facet), memory));
            }
        }
        self.put_memories_in_order();
        Ok(())
    }

    /// Lists all pairs whose surfaces are at most `gap` (m) apart, and gives each contact its memory back.
    fn list(&mut self, particles: &mut Particles<S>, gap: f64) {
        let periodic = self.settings.region.any_periodic();
        self.names.extend(
            particles
                .body
                .iter()
                .zip(&particles.shift)
                .map(|(body, shift)| (body.id, *shift)),
        );
        self.named_owned = particles.owned();
        self.offsets.clear();
        self.offset_shifts.clear();
        self.offsets.push(S::Vector::default());
        self.offset_shifts.push([0; 3]);
        let mut search = std::mem::take(&mut self.search);
        // No more room than needed: these lists are most of the memory of a grain.
        self.pairs.reserve_exact(search.look(particles, gap));
        search.each(|i, j| {
            let (a, b) = (&particles.body[i], &particles.body[j]);
            let key = key(self.names[i], self.names[j]);
            // The last ones are the likely ones.
            let shift = if periodic { key.shift } else { [0; 3] };
            let known = self.offset_shifts.iter().rposition(|known| *known == shift);
            let place = known.unwrap_or_else(|| {
                let mut offset = S::Vector::default();
                for axis in 0..S::DIMENSION {
                    offset.set(axis, f64::from(shift[axis]) * particles.lengths[axis]);
                }
                self.offset_shifts.push(shift);
                self.offsets.push(offset);
                self.offsets.len() - 1
            });
            let offset = self.offsets[place];
            let partners = Partners {
                materials: [a.material, b.material],
                diameter: a.radius + b.radius,
                mass: effective_mass(particles, i, j),
                rolling_radius: a.radius * b.radius / (a.radius + b.radius),
                rolling_inertia: rolling_inertia(particles, i, j),
            };
            let row = self.rows.place(a.material, b.material);
            let reach = a.radius + b.radius;
            let (between, squared) = separation(&particles.motion, (i, j), &offset, periodic);
            if !L::near(&self.scratch, (i, j), &between, gap) {
                return;
            }
            let held = self
                .memories
                .binary_search_by_key(&key, |(key, _)| *key)
                .map_or(L::Memory::default(), |at| self.memories[at].1);
            let lives = squared < reach * reach || L::bonded(&held);
            self.pairs.push(Pair {
                first: ghosts::index(i),
                second: ghosts::index(j),
                reach,
                radius: a.radius,
                row,
                offset: ghosts::index(place),
                scale: L::scale(self.rows.at(row), &partners),
                memory: if lives { held } else { L::Memory::default() },
            });
        });
        self.list_facets(particles, gap, &search);
        self.search = search;
        for k in (0..particles.owned()).filter(|&k| particles.mobility[k].free > 0.0) {
            let (body, motion) = (&particles.body[k], &particles.motion[k]);
            for (w, wall) in self.walls.iter().enumerate() {
                if wall.open || wall.surface.is_some() {
                    continue;
                }
                let distance = wall.distance(&motion.position);
                if distance > body.radius + gap {
                    continue;
                }
                let wall_index = ghosts::index(w);
                let held = self
                    .wall_memories
                    .binary_search_by_key(&(body.id, wall_index, 0), |(key, _)| *key)
                    .map_or(L::Memory::default(), |at| self.wall_memories[at].1);
                let lives = distance < body.radius || L::bonded(&held);
                let partners = at_wall(wall.material, body);
                self.wall_pairs.push(WallPair {
                    wall: wall_index,
                    grain: ghosts::index(k),
                    radius: body.radius,
                    constants: self.at_wall(&partners),
                    memory: if lives { held } else { L::Memory::default() },
                });
            }
        }
        self.memories.clear();
        self.wall_memories.clear();
        self.path = 0.0;
        let threads = rayon::current_num_threads();
        self.parallel = threads > 1 && particles.owned() >= L::PER_THREAD * threads;
        L::share_out(self, particles);
        self.activate(particles);
    }

    fn at_wall(&self, partners: &Partners) -> L::Constants {
        let [wall, grain] = partners.materials;
        L::between(self.rows.get(wall, grain), partners)
    }

    /// Lists the facets that owned grains are close to, by grain, wall and facet.
    fn list_facets(&mut self, particles: &Particles<S>, gap: f64, search: &Search) {
        let facets = &mut self.facets;
        facets.close.clear();
        for (w, wall) in (0..).zip(&self.walls) {
            let Some(surface) = wall.surface.as_ref().filter(|_| !wall.open) else {
                continue;
            };
            for facet in 0..surface.len() {
                let (mut low, mut high) = (None::<S::Vector>, None::<S::Vector>);
                for corner in surface.corners(facet) {
                    let corner = S::from_volume(&corner) + wall.point;
                    low = Some(low.map_or(corner, |low| low.combine(&corner, f64::min)));
                    high = Some(high.map_or(corner, |high| high.combine(&corner, f64::max)));
                }
                let (Some(low), Some(high)) = (low, high) else {
                    continue;
                };
                search.near::<S>(&low, &high, gap, |k| {
                    if k < particles.owned()
                        && particles.mobility[k].free > 0.0
                        && surface.distance(facet, &wall.local(&particles.motion[k].position))
                            <= particles.body[k].radius + gap
                    {
                        facets
                            .close
                            .push([ghosts::index(k), w, ghosts::index(facet)]);
                    }
                });
            }
        }
        facets.close.sort_unstable();
        facets.near.clear();
        facets.active.clear();
        for group in facets.close.chunk_by(|a, b| a[..2] == b[..2]) {
            let [grain, w, _] = group[0];
            let (body, wall) = (&particles.body[grain as usize], &self.walls[w as usize]);
            let near = ghosts::index(facets.near.len());
            facets.near.extend(group.iter().map(|[_, _, facet]| *facet));
            let held = ghosts::index(facets.held.len());
            let from = self
                .wall_memories
                .partition_point(|(key, _)| *key < (body.id, w, 0));
            let remembered = self.wall_memories[from..]
                .iter()
                .take_while(|(key, _)| (key.0, key.1) == (body.id, w));
            facets
                .held
                .extend(remembered.map(|((_, _, facet), memory)| Held {
                    facet: *facet,
                    memory: *memory,
                }));
            let diameter = 2.0 * body.radius;
            facets.pairs.push(SurfacePair {
                wall: w,
                grain,
                radius: body.radius,
                opening: self.law.widest_opening([diameter, diameter]),
                near: (near, ghosts::index(facets.near.len())),
                held: (held, ghosts::index(facets.held.len())),
                constants: L::between(
                    self.rows.get(wall.material, body.material),
                    &at_wall(wall.material, body),
                ),
            });
        }
    }

    /// Chooses the pairs to test until grains have moved by another look's distance.
    fn activate(&mut self, particles: &Particles<S>) {
        let skin = self.settings.skin;
        let since = self.steps - self.activated_at;
        if since < 30 {
            self.look = (2.0 * self.look).min(0.5 * skin);
        } else if since > 240 {
            self.look = (0.5 * self.look).max(skin / 1024.0);
        }
        self.activated_at = self.steps;
        self.activated = self.path + self.look;
        let periodic = self.settings.region.any_periodic();
        self.active.clear();
        for (k, pair) in (0..).zip(&mut self.pairs) {
            let offset = &self.offsets[pair.offset as usize];
            let (between, squared) = separation(&particles.motion, pair.ends(), offset, periodic);
            // The slack is far above the rounding of a separation, far below any gap that costs.
            let gap = 2.0 * self.look * (1.0 + 1e-9);
            let far = pair.reach * (1.0 + 1e-12) + gap;
            let near = squared <= far * far && L::near(&self.scratch, pair.ends(), &between, gap);
            if near || L::bonded(&pair.memory) {
                self.active.push(k);
            } else {
                pair.memory = L::Memory::default();
            }
        }
        let facets = &mut self.facets;
        facets.active.clear();
        for (k, pair) in (0..).zip(&mut facets.pairs) {
            let wall = &self.walls[pair.wall as usize];
            let at = wall.local(&particles.motion[pair.grain as usize].position);
            let far = pair.radius * (1.0 + 1e-12) + 2.0 * self.look * (1.0 + 1e-9);
            let closes = || {
                wall.surface.as_ref().is_some_and(|surface| {
                    let near = &facets.near[pair.near.0 as usize..pair.near.1 as usize];
                    near.iter()
                        .any(|&facet| surface.distance(facet as usize, &at) <= far)
                })
            };
            if pair.held.0 < pair.held.1 || closes() {
                facets.active.push(k);
            } else {
                // It is not looked at again before it is active, and others come and go meanwhile.
                pair.held = (0, 0);
            }
        }
        self.parts
            .note(&self.active, |k| self.pairs[k as usize].second);
    }

    /// Contact loads of all owned spheres at the present positions and velocities; histories advance by `dt` (s).
    fn sphere_forces(&mut self, particles: &mut Particles<S>, dt: f64) {
        self.tested += self.active.len() as u64;
        self.failures.clear();
        self.wall_failures.clear();
        match (self.settings.region.any_periodic(), self.parallel) {
            (false, false) => self.grain_forces::<false>(particles, dt),
            (true, false) => self.grain_forces::<true>(particles, dt),
            (false, true) => self.grain_forces_by_threads::<false>(particles, dt),
            (true, true) => self.grain_forces_by_threads::<true>(particles, dt),
        }
        self.facet_forces(particles, dt);
        if !(self.failures.is_empty() && self.wall_failures.is_empty()) {
            self.report_failures(particles);
        }
    }

    /// Loads of grains on each other and of planes on them.
    fn grain_forces<const PERIODIC: bool>(&mut self, particles: &mut Particles<S>, dt: f64) {
        let Particles {
            motion, contact, ..
        } = particles;
        contact.fill(Load::default());
        let mut spans = Spans::default();
        for block in self.active.chunks(BLOCK) {
            spans.measure::<L, PERIODIC>(block, &self.pairs, 0, motion, &self.offsets);
            for (&k, span) in block.iter().zip(spans.iter()) {
                let pair = &mut self.pairs[k as usize];
                let Some(action) = act::<S, L>(&self.rows, pair, motion, span, dt) else {
                    continue;
                };
                let first = &mut contact[pair.first as usize];
                first.force -= action.force;
                first.torque += action.on_first;
                let second = &mut contact[pair.second as usize];
                second.force += action.force;
                second.torque += action.on_second;
                if let Some(failure) = action.failure {
                    self.failures.push((k, failure));
                }
            }
        }
        for pair in &mut self.wall_pairs {
            let wall = &self.walls[pair.wall as usize];
            let load = &mut contact[pair.grain as usize];
            let failure = act_at_plane::<S, L>(pair, wall, motion, load, dt);
            self.wall_failures.extend(failure);
        }
    }

    /// Contacts with facets: found anew, each with the memory it had.
    fn facet_forces(&mut self, particles: &mut Particles<S>, dt: f64) {
        let Particles {
            motion, contact, ..
        } = particles;
        let (facets, failures) = (&mut self.facets, &mut self.wall_failures);
        facets.next.clear();
        for k in 0..facets.active.len() {
            let k = facets.active[k] as usize;
            facets.act_on_sphere::<S, L>(k, &self.walls, motion, contact, failures, dt);
        }
        std::mem::swap(&mut facets.held, &mut facets.next);
    }
}

/// An error that names the first own grain whose numbers went bad.
fn sane<S: Space>(particles: &Particles<S>) -> Result<(), Error> {
    let finite = |v: &S::Vector| v.scalar(v).is_finite();
    match (0..particles.owned()).find(|&k| {
        let motion = &particles.motion[k];
        !(finite(&motion.position)
            && motion.velocity.scalar(&motion.velocity) < integrate::SPEED_LIMIT
            && motion.spin.scalar(&motion.spin).is_finite())
    }) {
        None => Ok(()),
        Some(k) => Err(migration::lost(particles, k, "has no finite motion")),
    }
}
