//! Rebuild of the lists: grains are wrapped into the box and sent to their owners with the histories of their contacts,
//! then sorted by id; ghosts and lists follow.
//!
//! A grain belongs to the rank whose planes contain its centre: plane `floor((x - origin) / spacing)` along the
//! split axis, clamped to the outermost planes if the axis is not periodic. Ownership changes only here.

use super::bodies::Bodies;
use super::histories::{pack_history, unpack_history};
use super::{Engine, Key, WallKey};
use crate::census::{Census, agree, census};
use crate::columns::Crosses;
use crate::escape::Escape;
use crate::ghosts;
use crate::message::{Reader, Writer};
use crate::particles::{Motion, Particles, image_position};
use crate::region::{GrainDomain, plane_of, wraps};
use crate::space::{Components, Space};
use crate::walls::Wall;
use base::error::Error;
use base::thread_pool;
use decomposition::{Domain, exchange};
use std::sync::atomic::{AtomicBool, Ordering};

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Sends grains to their owners, and builds ghosts and lists.
    pub(super) fn rebuild(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<(), Error> {
        self.validity.rebuilds += 1;
        let region = self.settings.region;
        self.remember();
        particles.lengths = region.periodic_lengths();
        particles.origin = region.origin();
        particles.drop_ghosts();
        agree(
            domain,
            L::check(particles).and_then(|()| wrap(particles, &region)),
        )?;
        if domain.communicator().size() > 1 {
            self.migrate(particles, &region, domain)?;
        }
        let census = settle(particles, &mut self.validity.grain_count, domain)?;
        let sizes = census.iter().map(|one| [one.smallest, one.largest]);
        let [smallest, largest] = sizes.fold([f64::INFINITY, 0.0], |all, one| {
            [all[0].min(one[0]), all[1].max(one[1])]
        });
        let total: u64 = census.iter().map(|one| one.owned).sum();
        let opening = if total > 0 {
            self.law.widest_opening([2.0 * smallest, 2.0 * largest])
        } else {
            0.0
        };
        let gap = self.settings.skin + opening;
        check_reach(&self.walls, largest, gap)?;
        ghosts::make(
            particles,
            &region,
            &census,
            gap,
            self.settings.ghost_margin,
            domain,
        )?;
        L::pose(&mut self.scratch, particles, self.parallel);
        self.list(particles, gap);
        particles.listed = true;
        self.validity.listed = true;
        // The log reports powers of two, so that it shows a run that builds lists in every step and remains short.
        if self.validity.rebuilds.is_power_of_two() {
            log::debug!(
                "rank {}: lists made {} times in {} solid steps: {} grains of {total} owned, {} ghosts, {} pairs, {} \
                 at plane walls, {} at facets; skin {:.3e} m",
                domain.rank(),
                self.validity.rebuilds,
                self.steps,
                particles.owned(),
                particles.len() - particles.owned(),
                self.lists.pairs.len(),
                self.solids.wall_pairs.len(),
                self.facet_pairs(),
                self.settings.skin
            );
        }
        Ok(())
    }

    /// Sends grains that left the slab, with their contacts, to their owners.
    fn migrate(
        &mut self,
        particles: &mut Particles<S>,
        region: &GrainDomain<S>,
        domain: &Domain,
    ) -> Result<(), Error> {
        let owners = owners(particles, region, domain)?;
        let mut messages = Vec::new();
        let mut numbers = Vec::new();
        for target in (0..domain.communicator().size()).filter(|&target| target != domain.rank()) {
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
                self.histories
                    .iter()
                    .filter(|(key, _)| leaves(key.first) || leaves(key.second))
            };
            let walls = || {
                self.wall_histories
                    .iter()
                    .filter(|(key, _)| leaves(key.grain))
            };
            writer.integer(grains().count() as u64);
            for (key, history) in grains() {
                writer.integer(key.first);
                writer.integer(key.second);
                for n in key.shift {
                    writer.signed(n);
                }
                pack_history::<S, L>(history, &mut numbers, &mut writer);
            }
            writer.integer(walls().count() as u64);
            for (key, history) in walls() {
                writer.integer(key.grain);
                writer.integer(u64::from(key.wall));
                writer.integer(u64::from(key.facet));
                pack_history::<S, L>(history, &mut numbers, &mut writer);
            }
            messages.push((target, writer.0));
        }
        particles.keep(|k| owners[k] == domain.rank());
        for (_, bytes) in exchange(domain.communicator(), messages) {
            let mut reader = Reader(&bytes);
            unpack_grains(particles, &mut reader)?;
            for _ in 0..reader.integer()? {
                let (first, second) = (reader.integer()?, reader.integer()?);
                let shift = [reader.signed()?, reader.signed()?, reader.signed()?];
                let history = unpack_history::<S, L>(&mut numbers, &mut reader)?;
                self.histories.push((
                    Key {
                        first,
                        second,
                        shift,
                    },
                    history,
                ));
            }
            for _ in 0..reader.integer()? {
                let grain = reader.integer()?;
                let mut small = || {
                    u32::try_from(reader.integer()?)
                        .map_err(|_| Error::Internal("the index of a wall exceeds 32 bits".into()))
                };
                let (wall, facet) = (small()?, small()?);
                let history = unpack_history::<S, L>(&mut numbers, &mut reader)?;
                self.wall_histories
                    .push((WallKey { grain, wall, facet }, history));
            }
        }
        self.put_histories_in_order();
        Ok(())
    }
}

/// Sorts the grains that have come to their owners, and checks that none was lost; `before` is their number at the last
/// call. Returns the census of every rank. Collective.
fn settle<S: Space>(
    particles: &mut Particles<S>,
    before: &mut Option<u64>,
    domain: &Domain,
) -> Result<Vec<Census>, Error> {
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
    let census = census(particles, domain)?;
    let total: u64 = census.iter().map(|one| one.owned).sum();
    if let Some(before) = *before {
        let added: u64 = census.iter().map(|one| one.added).sum();
        let removed: u64 = census.iter().map(|one| one.removed).sum();
        if before + added != total + removed {
            return Err(Error::Internal(format!(
                "grains were lost: there were {before}, {added} were added and {removed} removed, but now \
                 there are {total}"
            )));
        }
    }
    *before = Some(total);
    particles.added = 0;
    particles.removed = 0;
    Ok(census)
}

/// Checks that a body of radius `largest` with neighbours at a distance of up to `gap` \[m\] meets no facet twice.
fn check_reach<S: Space>(walls: &[Wall<S>], largest: f64, gap: f64) -> Result<(), Error> {
    let surfaces = walls.iter().filter_map(|wall| wall.surface.as_ref());
    let reach = surfaces.map(|surface| surface.longest_reach());
    let reach = reach.fold(f64::INFINITY, f64::min);
    if largest + gap > reach {
        return Err(Error::Numerical(format!(
            "a body with a radius of {largest} m and a neighbour gap of {gap} m reaches farther than half a \
             period of the domain, {reach} m, so that its contacts with walls of facets are ambiguous"
        )));
    }
    Ok(())
}

/// Sets the shift of every owned grain so that its image lies in the box, and checks that no grain is lost.
fn wrap<S: Space>(particles: &mut Particles<S>, region: &GrainDomain<S>) -> Result<(), Error> {
    let owned = particles.owned();
    let lengths = particles.lengths;
    let (motion, shifts) = (&particles.motion[..owned], &mut particles.shift[..owned]);
    let astray = AtomicBool::new(false);
    thread_pool::each_item(shifts, PER_THREAD, |k, shift| {
        match shift_of::<S>(&motion[k], *shift, &lengths, region) {
            Ok(into) => *shift = into,
            Err(_) => astray.store(true, Ordering::Relaxed),
        }
    });
    if astray.into_inner() {
        for k in 0..owned {
            let found = shift_of::<S>(&particles.motion[k], particles.shift[k], &lengths, region);
            match found {
                Ok(_) => {}
                Err(StrayReason::Lost) => return Err(lost(particles, k, "is lost")),
                Err(StrayReason::Out { axis, upper }) => {
                    let grain = particles.body[k].id;
                    let escape = Escape { grain, axis, upper };
                    return Err(named(particles, k, &escape.to_string()));
                }
            }
        }
    }
    Ok(())
}

/// Minimum number of grains per thread.
const PER_THREAD: usize = 1000;

/// Reason why a grain is outside the box.
enum StrayReason {
    /// Position very far away or not finite.
    Lost,
    /// Position beyond the box by more than its length.
    Out { axis: usize, upper: bool },
}

/// Returns the shift that moves a grain into the box.
fn shift_of<S: Space>(
    motion: &Motion<S>,
    mut shift: [i32; 3],
    lengths: &[f64; 3],
    region: &GrainDomain<S>,
) -> Result<[i32; 3], StrayReason> {
    let place = image_position(motion, shift, lengths);
    for axis in 0..S::DIMENSION {
        let at = place.get(axis);
        let (lower, length) = (region.lower.get(axis), region.length(axis));
        if !at.is_finite() || (at - lower).abs() > 1e6 * length {
            return Err(StrayReason::Lost);
        }
        if region.periodic[axis] {
            shift[axis] = wraps(motion.position.get(axis), lower, length);
        } else if !(lower - length..=lower + 2.0 * length).contains(&at)
            && !region.passed_an_exit(&place)
        {
            let upper = at > lower;
            return Err(StrayReason::Out { axis, upper });
        }
    }
    Ok(shift)
}

/// Returns the error that names a grain.
pub(super) fn lost<S: Space>(particles: &Particles<S>, k: usize, what: &str) -> Error {
    named(
        particles,
        k,
        &format!("grain {} {what}", particles.body[k].id),
    )
}

/// Returns an error about a grain with its position and velocity.
fn named<S: Space>(particles: &Particles<S>, k: usize, what: &str) -> Error {
    let motion = &particles.motion[k];
    let show = |v: &S::Vector| {
        let numbers: Vec<String> = (0..S::DIMENSION)
            .map(|axis| format!("{:e}", v.get(axis)))
            .collect();
        numbers.join(", ")
    };
    Error::Numerical(format!(
        "{what}: position ({}) m, velocity ({}) m/s",
        show(&particles.location(k)),
        show(&motion.velocity)
    ))
}

/// Returns the present owner of each owned grain.
fn owners<S: Space>(
    particles: &Particles<S>,
    region: &GrainDomain<S>,
    domain: &Domain,
) -> Result<Vec<usize>, Error> {
    let (axis, slabs) = (domain.axis().index(), domain.slabs());
    (0..particles.owned())
        .map(|k| {
            let at = particles.location(k).get(axis);
            let plane = plane_of(at, region.lower.get(axis), region.spacing, slabs.planes());
            slabs
                .owner_of_plane(plane)
                .ok_or_else(|| Error::Internal(format!("plane {plane} belongs to no rank")))
        })
        .collect()
}

/// Writes owned grains for their new owner.
pub(crate) fn pack_grains<S: Space>(particles: &Particles<S>, leaving: &[usize], to: &mut Writer) {
    to.integer(leaving.len() as u64);
    for &k in leaving {
        particles.pack(k, particles.shift[k], Crosses::Migration, to);
    }
}

/// Appends the grains written by [`pack_grains`] on another rank; call it when there are no ghosts.
pub(crate) fn unpack_grains<S: Space>(
    particles: &mut Particles<S>,
    from: &mut Reader<'_>,
) -> Result<(), Error> {
    for _ in 0..from.integer()? {
        particles.unpack(Crosses::Migration, from)?;
        particles.owned += 1;
    }
    Ok(())
}
