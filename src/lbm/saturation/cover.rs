//! Cover of the cells of a slab by solids: fractions, bodies, and sums of the forces on the bodies.
//!
//! It is separate from the passes, which read it by address (`pass.rs`), because only the processor changes it.

pub use super::solid::CoveringBody;
use super::solid::{BETWEEN, DEEP, NONE, SHARED, STILL, Shares};
use super::solid::{Share, total};
use super::sums::Sums;
use super::{CoveredFluid, SaturationMethod};
use crate::collision::trt::AntisymmetricRate;
use crate::lanes::{Stored, WIDEST, prefetch};
use crate::links::{Load, surface_velocity};
use crate::populations::Populations;
use crate::quanta::{from_quanta, quanta};
use base::thread_pool;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Cover of the cells of a slab by solids.
#[derive(Debug)]
pub struct Cover {
    /// Method by which the solids act on the fluid, and parameters of the fluid.
    pub(super) method: SaturationMethod,
    pub(super) fluid: CoveredFluid,
    /// Axes from slowest to fastest in memory.
    pub(super) order: [usize; 3],
    /// Solid fraction ε by position of a cell; in ghost cells its negative.
    pub(super) fraction: Vec<f32>,
    /// Slot of the body of a cell, or [`SHARED`] and an index into the lists: index in a list, times the number of
    /// lists, plus the number of the list.
    pub(super) owner: Vec<u32>,
    /// Lists of shared cells, one for each worker.
    lists: Vec<WorkerLists>,
    /// Addresses of the lists for the pass.
    shares: Vec<Shares>,
    /// Bodies by slot.
    pub(super) solids: Vec<CoveringBody>,
    /// Sums of the forces of each worker.
    pub(super) sums: Vec<Sums>,
    /// Distance between cells along each axis in positions.
    pub(super) strides: [isize; 3],
    /// Half of the body force on the fluid inside solids, in lattice units.
    pub(super) inside: [f64; 3],
    /// `true` if cells or motions have changed since the last query.
    changed: AtomicBool,
    /// Number of changes of cells.
    version: AtomicU64,
    /// `true` if all bodies are balls with exact fractions, so that the fractions follow from `solids`.
    balls: bool,
    /// Number of changes of position, size or slot of bodies, and number of any changes.
    moves: u64,
    motions: u64,
}

// SAFETY: through `&Cover` the addresses in `shares` are never dereferenced: only the pass does so, with exclusive
// access to the cover. All other changes are atomic or protected by a lock.
unsafe impl Sync for Cover {}

impl Cover {
    /// Returns a cover without bodies over the cells of `populations`, for passes by this many `workers`.
    #[must_use]
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        method: SaturationMethod,
        relaxation_time: f64,
        antisymmetric: AntisymmetricRate,
        workers: usize,
    ) -> Self {
        let positions = populations.cell_positions();
        let origin = populations.cell([0; 3]);
        let stride = |axis: usize| {
            let mut at = [0; 3];
            at[axis] = 1;
            (populations.cell(at) - origin).cast_signed()
        };
        Self {
            method,
            fluid: CoveredFluid {
                weighting: method.weighting,
                time: relaxation_time - 0.5,
                antisymmetric,
            },
            order: populations.order(),
            fraction: vec![0.0; positions],
            // A vector of neighbours may extend beyond the last cell.
            owner: vec![NONE; positions + WIDEST],
            lists: (0..workers.max(1))
                .map(|_| WorkerLists::default())
                .collect(),
            shares: Vec::new(),
            solids: Vec::new(),
            sums: (0..workers.max(1)).map(|_| Sums::default()).collect(),
            strides: [stride(0), stride(1), stride(2)],
            inside: [0.0; 3],
            changed: AtomicBool::new(true),
            version: AtomicU64::new(1),
            balls: false,
            moves: 0,
            motions: 0,
        }
    }

    /// Sets whether all bodies are balls that cover the cells exactly as given by their positions, so that a GPU can
    /// compute the cover.
    pub fn set_balls(&mut self, balls: bool) {
        self.balls = balls;
    }

    /// Returns the number of moves of the bodies if all are balls that a GPU can map; otherwise `None`.
    pub fn balls(&self) -> Option<u64> {
        self.balls.then_some(self.moves)
    }

    /// Sets the body force of the next pass. Along periodic axes no pressure balances it, and it does not act on the
    /// fluid inside solids.
    pub(crate) fn set_force(&mut self, force: [f64; 3], periodic: [bool; 3]) {
        self.inside = std::array::from_fn(|a| if periodic[a] { 0.0 } else { 0.5 * force[a] });
    }

    /// Returns half of the body force on the fluid inside solids.
    pub(crate) fn inside(&self) -> [f64; 3] {
        self.inside
    }

    /// Returns the number of changes of the bodies.
    pub(crate) fn motions(&self) -> u64 {
        self.motions
    }

    /// Returns the axes from slowest to fastest.
    pub(crate) fn order(&self) -> [usize; 3] {
        self.order
    }

    /// Returns a number that increases with each change of cells.
    pub(crate) fn version(&self) -> u64 {
        self.version.load(Ordering::Relaxed)
    }

    /// Returns the owner and fraction of all cells, by position.
    pub fn cells(&self) -> (&[u32], &[f32]) {
        (&self.owner, &self.fraction)
    }

    /// Returns the bodies by slot.
    pub fn solids(&self) -> &[CoveringBody] {
        &self.solids
    }

    /// Returns the bodies with their fractions for each shared cell, in the order of the index in its owner.
    pub fn shared<'a>(&'a mut self) -> impl Iterator<Item = &'a [Share]> {
        let lists = self.lists.iter_mut().map(WorkerLists::get);
        let lists: Vec<&'a [Vec<Share>]> = lists.map(|lists| &*lists.shared).collect();
        let longest = lists.iter().map(|shared| shared.len()).max().unwrap_or(0);
        (0..longest * lists.len()).map(move |place| {
            let shared = lists[place % lists.len()];
            shared
                .get(place / lists.len())
                .map_or(&[][..], Vec::as_slice)
        })
    }

    /// Returns the addresses of the shared cells for the next pass.
    pub(super) fn list_shares(&mut self) -> *const Shares {
        let count = self.lists.len();
        self.shares.clear();
        for (shelf, lists) in self.lists.iter_mut().enumerate() {
            let shared = &lists.get().shared;
            let length = shared.len() * count;
            if self.shares.len() < length {
                self.shares.resize(length, Shares::from_parts(&[]));
            }
            for (k, parts) in shared.iter().enumerate() {
                self.shares[k * count + shelf] = Shares::from_parts(parts);
            }
        }
        self.shares.as_ptr()
    }

    /// Calls `read` with the bodies of a shared cell, given by its owner.
    fn with_shares<R>(&self, owner: u32, read: impl FnOnce(&[Share]) -> R) -> R {
        let (shelf, place) = shelved(owner, self.lists.len());
        let lists = self.lists[shelf].lock();
        read(lists.shared.get(place).map_or(&[][..], Vec::as_slice))
    }

    /// Adds a load computed on a GPU to the sum of a slot.
    pub(crate) fn receive(&mut self, slot: u32, load: &Load) {
        if let Some(sums) = self.sums.first_mut() {
            sums.add_load(slot, load);
        }
    }

    /// Returns `true` if cells or motions have changed since the last call.
    pub fn take_changed(&mut self) -> bool {
        std::mem::take(self.changed.get_mut())
    }

    /// Marks ghost cells as filled by a stationary wall.
    pub fn wall_off(&mut self, ghosts: impl Iterator<Item = usize>) {
        for position in ghosts {
            self.fraction[position] = -1.0;
            self.owner[position] = STILL;
        }
    }

    /// Bytes per cell in addition to the populations.
    pub const BYTES: usize = size_of::<f32>() + size_of::<u32>();

    /// Sets the number of slots for bodies.
    pub fn make_room(&mut self, slots: usize) {
        self.moves += 1;
        self.motions += 1;
        self.solids.resize(slots, CoveringBody::default());
        for sums in &mut self.sums {
            sums.fit(slots);
        }
    }

    /// Sets the body of a slot and its motion.
    pub fn set(&mut self, slot: u32, solid: CoveringBody) {
        if let Some(there) = self.solids.get_mut(slot as usize) {
            *self.changed.get_mut() |= there.motion != solid.motion || there.frame != solid.frame;
            let place =
                |solid: &CoveringBody| (solid.motion.position, solid.motion.radius, solid.frame);
            self.motions += u64::from(*there != solid);
            self.moves += u64::from(place(there) != place(&solid) || there.name != solid.name);
            *there = solid;
        }
    }

    /// Sets the `fraction` of the cell at a position that body `slot` fills, or [`DEEP`]; 0 removes the body. For a
    /// ghost cell the fraction is negative.
    pub fn cover(&mut self, position: usize, slot: u32, fraction: f32) {
        self.whole().cover(position, slot, fraction);
    }

    /// Returns all cells for a single worker.
    pub fn whole(&mut self) -> CoverPart<'_> {
        CoverPart {
            first: 0,
            fraction: &mut self.fraction,
            owner: &mut self.owner,
            lists: Access::Alone(&mut self.lists),
            solids: &self.solids,
            all_changed: &self.changed,
            version: &self.version,
            changed: false,
        }
    }

    /// Divides the cells at the ascending positions `cuts`, and calls `work` with each part on a worker.
    pub fn each_part(&mut self, cuts: &[usize], work: impl Fn(&mut CoverPart<'_>) + Sync) {
        let mut parts = Vec::with_capacity(cuts.len() + 1);
        let (mut fractions, mut owners) = (&mut self.fraction[..], &mut self.owner[..]);
        let mut first = 0;
        for &cut in cuts.iter().chain([&usize::MAX]) {
            let count = cut.saturating_sub(first).min(fractions.len());
            let (fraction, fractions_beyond) = fractions.split_at_mut(count);
            let (owner, owners_beyond) = owners.split_at_mut(count);
            (fractions, owners) = (fractions_beyond, owners_beyond);
            parts.push(CoverPart {
                first,
                fraction,
                owner,
                lists: Access::Shared(&self.lists, parts.len() % self.lists.len()),
                solids: &self.solids,
                all_changed: &self.changed,
                version: &self.version,
                changed: false,
            });
            first += count;
        }
        thread_pool::each_item(&mut parts, 1, |_, part| work(part));
    }

    /// Returns the solid fraction of a cell.
    #[must_use]
    pub fn fraction(&self, position: usize) -> f64 {
        f64::from(self.fraction[position].min(1.0))
    }

    /// Returns the fraction as stored: [`DEEP`] deep inside a body, negative in a ghost cell.
    #[must_use]
    pub fn held(&self, position: usize) -> f32 {
        self.fraction[position]
    }

    /// Returns the id of the body with the largest fraction of a cell, if solids fill at least half of the cell.
    #[must_use]
    pub fn body_at(&self, position: usize) -> Option<u64> {
        if self.fraction[position] < 0.5 {
            return None;
        }
        let owner = self.owner[position];
        let slot = if owner & SHARED == 0 {
            owner
        } else {
            self.with_shares(owner, |shares| {
                let mut most = shares.first()?;
                for share in shares {
                    if share.fraction > most.fraction {
                        most = share;
                    }
                }
                Some(most.slot)
            })?
        };
        self.solids.get(slot as usize).map(|solid| solid.name.id)
    }

    /// Returns the weight B of a cell (or ε) in quanta: the fraction of its body force that does not act on the
    /// water.
    #[must_use]
    pub fn weight(&self, position: usize) -> i64 {
        let fraction = self.fraction(position);
        quanta(if self.fraction[position] > 1.0 {
            1.0
        } else {
            self.method.operator.force_left_out(&self.fluid, fraction)
        })
    }

    /// Returns the velocity of the solids in a cell: `at` are its local coordinates.
    #[must_use]
    pub fn velocity<const D: usize>(&self, position: usize, at: [i32; 3]) -> [f64; 3] {
        let owner = self.owner[position];
        let mean_of = |shares: &[Share]| {
            let mut mean = [0.0; 3];
            for share in shares {
                if let Some(solid) = self.solids.get(share.slot as usize) {
                    let v = solid.velocity::<D>(solid.raw(at));
                    let part = f64::from(share.fraction) / total(shares);
                    for a in 0..D {
                        mean[a] += part * v[a];
                    }
                }
            }
            mean
        };
        let fraction = 1.0;
        if owner == NONE {
            [0.0; 3]
        } else if owner & SHARED == 0 {
            let slot = owner;
            mean_of(&[Share { slot, fraction }])
        } else {
            self.with_shares(owner, mean_of)
        }
    }

    /// Returns the velocity of the solids in a cell at least half filled by them, at a point `offset` from its
    /// centre: `at` are its local coordinates. Ghost cells are included, cells behind walls are not.
    #[must_use]
    pub fn velocity_near<const D: usize>(
        &self,
        position: usize,
        at: [i32; 3],
        offset: [f64; 3],
    ) -> [f64; 3] {
        let owner = self.owner[position];
        let of = |slot: u32| {
            let Some(solid) = self.solids.get(slot as usize) else {
                return [0.0; 3];
            };
            let raw = solid.raw(at);
            let mut arm = [0.0; 3];
            for a in 0..D {
                arm[a] = f64::from(raw[a]) + 0.5 + offset[a] - solid.motion.position[a];
            }
            surface_velocity::<D>(&solid.motion, arm)
        };
        if owner & SHARED == 0 {
            return of(owner);
        }
        self.with_shares(owner, |shares| {
            let all = total(shares);
            let mut mean = [0.0; 3];
            for share in shares {
                let v = of(share.slot);
                let part = f64::from(share.fraction) / all;
                for a in 0..D {
                    mean[a] += part * v[a];
                }
            }
            mean
        })
    }

    /// Returns the fraction of a cell or ghost cell filled by bodies; 0 behind a wall.
    #[must_use]
    pub fn part(&self, position: usize) -> f64 {
        match self.owner[position] {
            NONE | STILL => 0.0,
            _ => f64::from(self.fraction[position].abs().min(1.0)),
        }
    }

    /// Hides a cell from the pass, or restores it: a hidden fraction is negative like that of a ghost cell.
    pub(crate) fn hide(&mut self, position: usize, hidden: bool) {
        let part = self.fraction[position].abs();
        self.fraction[position] = if hidden { 0.0 - part } else { part };
    }

    /// Calls `give` for each body of a cell: with its slot, the body, the fraction of the cell that it fills, and this
    /// fraction divided by the sum over all bodies of the cell.
    pub(crate) fn each_body(
        &self,
        position: usize,
        mut give: impl FnMut(u32, &CoveringBody, f64, f64),
    ) {
        let owner = self.owner[position];
        let mut of = |slot: u32, fraction: f64, part: f64| {
            if let Some(solid) = self.solids.get(slot as usize) {
                give(slot, solid, fraction, part);
            }
        };
        if owner == NONE || owner == STILL {
            return;
        }
        if owner & SHARED == 0 {
            return of(owner, self.fraction(position), 1.0);
        }
        self.with_shares(owner, |shares| {
            let all = total(shares);
            for share in shares {
                let fraction = f64::from(share.fraction);
                // Overlapping bodies fill a cell once.
                of(share.slot, fraction / all.max(1.0), fraction / all);
            }
        });
    }

    /// Returns the number of slots of bodies.
    #[must_use]
    pub fn slots(&self) -> usize {
        self.solids.len()
    }

    /// Calls `give` with each slot on which a force has acted since the last call, and the sum of its loads: force, and
    /// twice the moment about the origin of the raw frame of the body, in quanta. Then clears the sums.
    pub fn collect(&mut self, mut give: impl FnMut(u32, &Load)) {
        for sums in &mut self.sums {
            for &slot in &sums.touched {
                let k = slot as usize;
                give(slot, &sums.loads[k]);
                sums.loads[k] = [0; 6];
                sums.known[k] = false;
            }
            sums.touched.clear();
        }
    }
}

/// Lists of the bodies of shared cells.
#[derive(Debug, Default)]
struct Lists {
    /// Bodies of the shared cells with their fractions, ordered by id and image.
    shared: Vec<Vec<Share>>,
    /// Bodies inside which the cell is deep.
    deep: Vec<Vec<u32>>,
    /// Indices of free entries.
    unused: Vec<usize>,
}

/// Lists of a worker, on separate cache lines.
#[derive(Debug, Default)]
#[repr(align(128))]
struct WorkerLists(Mutex<Lists>);

impl WorkerLists {
    fn get(&mut self) -> &mut Lists {
        self.0.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    fn lock(&self) -> MutexGuard<'_, Lists> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the list and the index in it of a shared cell, given by its owner; `count` is the number of lists.
fn shelved(owner: u32, count: usize) -> (usize, usize) {
    let place = (owner & !SHARED) as usize;
    (place % count, place / count)
}

/// Location of a shared cell: list, number of lists, and index in the list, which is `None` if the cell has had a
/// single body so far.
#[derive(Clone, Copy, Debug)]
struct Place {
    shelf: usize,
    count: usize,
    place: Option<usize>,
}

/// Access of a worker to the lists of all workers; few cells have several bodies.
#[derive(Debug)]
enum Access<'a> {
    /// Access without other workers.
    Alone(&'a mut [WorkerLists]),
    /// Access with other workers: new entries are taken from the list of this number, and only rarely from that of
    /// another worker.
    Shared(&'a [WorkerLists], usize),
}

/// Range of cells covered by one worker, on separate cache lines, because the parts of other workers are adjacent
/// in memory.
#[derive(Debug)]
#[repr(align(128))]
pub struct CoverPart<'a> {
    /// Position of the first cell.
    first: usize,
    fraction: &'a mut [f32],
    owner: &'a mut [u32],
    lists: Access<'a>,
    solids: &'a [CoveringBody],
    /// Flag and number of changes of the whole cover, updated once at the end if this part has changed.
    all_changed: &'a AtomicBool,
    version: &'a AtomicU64,
    changed: bool,
}

impl Drop for CoverPart<'_> {
    fn drop(&mut self) {
        if self.changed {
            self.all_changed.store(true, Ordering::Relaxed);
            self.version.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl CoverPart<'_> {
    /// Returns the positions of the part.
    #[must_use]
    pub fn positions(&self) -> Range<usize> {
        self.first..self.first + self.fraction.len()
    }

    /// Prefetches the data of the cell at a position.
    #[inline(always)]
    pub fn ask(&self, position: usize) {
        let at = position.wrapping_sub(self.first);
        prefetch(self.owner.as_ptr().wrapping_add(at));
        prefetch(self.fraction.as_ptr().wrapping_add(at));
    }

    /// Covers a cell of this part: see [`Cover::cover`].
    #[inline]
    pub fn cover(&mut self, position: usize, slot: u32, fraction: f32) {
        let at = position - self.first;
        let owner = self.owner[at];
        if owner == STILL {
            return;
        }
        self.changed = true;
        let held = self.fraction[at];
        let sign = if held < 0.0 || fraction < 0.0 {
            -1.0
        } else {
            1.0
        };
        let fraction = fraction.abs();
        if owner == NONE || owner == slot {
            // Adding 0 turns -0 into 0, so that an uncovered cell has a single representation.
            self.fraction[at] = sign * fraction + 0.0;
            self.owner[at] = if fraction > 0.0 { slot } else { NONE };
        } else {
            self.add_share(at, slot, sign, fraction);
        }
    }

    /// Covers consecutive cells of this part, from a position on, like [`Cover::cover`], if body `slot` and no other
    /// covers each of them before and after the call. Returns `true` in this case; otherwise changes nothing and
    /// returns `false`.
    #[inline]
    pub fn cover_alone(&mut self, position: usize, slot: u32, parts: &[f32]) -> bool {
        let first = position - self.first;
        let cells = first..first + parts.len();
        let (fractions, owners) = (&mut self.fraction[cells.clone()], &self.owner[cells]);
        let (mut alone, mut changed) = (true, false);
        for ((held, owner), part) in fractions.iter().zip(owners).zip(parts) {
            // Both belong to a cell of the slab, or both to a ghost cell, and neither is 0.
            alone &= (*owner == slot) & (held * part > 0.0);
            changed |= held.to_bits() != part.to_bits();
        }
        if alone && changed {
            fractions.copy_from_slice(parts);
            self.changed = true;
        }
        alone
    }

    /// Covers a cell that another body also covers, at an index relative to the first position.
    #[inline(never)]
    fn add_share(&mut self, at: usize, slot: u32, sign: f32, fraction: f32) {
        let cell = (&mut self.owner[at], &mut self.fraction[at]);
        if *cell.0 & SHARED == 0 && fraction <= 0.0 {
            return;
        }
        let (own, count) = match &self.lists {
            Access::Alone(lists) => (0, lists.len()),
            Access::Shared(lists, own) => (*own, lists.len()),
        };
        let known = *cell.0 & SHARED != 0;
        let (shelf, place) = if known {
            let (shelf, place) = shelved(*cell.0, count);
            (shelf, Some(place))
        } else {
            (own, None)
        };
        let place = Place {
            shelf,
            count,
            place,
        };
        match &mut self.lists {
            Access::Alone(lists) => {
                let lists = lists[shelf].get();
                lists.add_share(cell, place, self.solids, (slot, sign, fraction));
            }
            Access::Shared(lists, _) => {
                let mut lists = lists[shelf].lock();
                lists.add_share(cell, place, self.solids, (slot, sign, fraction));
            }
        }
    }
}

impl Lists {
    /// Adds the fraction that body `slot` fills of a cell with another body, given by its owner and fraction.
    fn add_share(
        &mut self,
        (owner, held): (&mut u32, &mut f32),
        at: Place,
        solids: &[CoveringBody],
        (slot, sign, fraction): (u32, f32, f32),
    ) {
        let Self {
            shared,
            deep,
            unused,
        } = self;
        let place = at.place.unwrap_or_else(|| {
            let first = Share {
                slot: *owner,
                fraction: held.abs().min(1.0),
            };
            let place = unused.pop().unwrap_or_else(|| {
                shared.push(Vec::new());
                deep.push(Vec::new());
                shared.len() - 1
            });
            shared[place].push(first);
            if held.abs() > BETWEEN {
                deep[place].push(*owner);
            }
            *owner = SHARED | number(place * at.count + at.shelf);
            place
        });
        let (shares, deep) = (&mut shared[place], &mut deep[place]);
        deep.retain(|&other| other != slot);
        if fraction > BETWEEN {
            deep.push(slot);
        }
        match shares.iter().position(|share| share.slot == slot) {
            Some(at) if fraction > 0.0 => shares[at].fraction = fraction.min(1.0),
            Some(at) => {
                shares.remove(at);
            }
            None if fraction > 0.0 => {
                let name = |slot: u32| solids.get(slot as usize).map(|solid| solid.name);
                let at = shares.partition_point(|share| name(share.slot) < name(slot));
                let fraction = fraction.min(1.0);
                shares.insert(at, Share { slot, fraction });
            }
            None => {}
        }
        if let [only] = shares[..] {
            shares.clear();
            unused.push(place);
            *owner = only.slot;
            // The cell has the state of a cell with this body only.
            *held = sign * if deep.is_empty() { only.fraction } else { DEEP };
            deep.clear();
        } else {
            *held = sign * rounded(total(shares).min(1.0));
        }
    }
}

/// Returns a fraction rounded to the precision in which it is stored.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a cell holds its fraction in f32"
)]
fn rounded(fraction: f64) -> f32 {
    fraction as f32
}

/// Returns the index of a shared cell as part of its owner.
#[expect(
    clippy::cast_possible_truncation,
    reason = "far fewer than 2^31 cells are shared"
)]
fn number(n: usize) -> u32 {
    n as u32
}

/// Returns a sum of B in quanta as a number of cells.
#[must_use]
pub fn cells(weight: i128) -> f64 {
    from_quanta(weight)
}
