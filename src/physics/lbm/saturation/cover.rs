//! The cover of the cells of a slab: solid fractions, bodies, and the sums of forces on the bodies.

use super::{CoveredFluid, Method};
use crate::lbm::collision::trt::AntisymmetricRate;
use crate::lbm::lanes::{Stored, WIDEST, prefetch};
use crate::lbm::links::{Load, Rigid, add_force, add_moment, surface_velocity};
use crate::lbm::populations::Populations;
use crate::lbm::quanta::{from_quanta, quanta};

/// Fraction of a cell so deep inside a body that no water is beside it.
pub const DEEP: f32 = 2.0;

/// Between the fraction of a full cell and [`DEEP`].
pub(super) const BETWEEN: f32 = 1.5;

/// No body.
pub(super) const NONE: u32 = u32::MAX;
/// A ghost cell behind a wall at rest.
pub(super) const STILL: u32 = u32::MAX - 1;
/// Cells of several bodies are numbered from here.
pub(super) const SHARED: u32 = 1 << 31;
/// A body as the cells know it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solid {
    /// Id and image: they order the bodies of a cell.
    pub name: (u64, [i32; 3]),
    /// Its motion in lattice units; positions in its raw frame.
    pub motion: Rigid,
    /// From its raw frame to the cells of the slab: local = raw + frame.
    pub frame: [i32; 3],
    /// Known to stand so far from other bodies and from walls that no full cell of it is beside one of theirs.
    pub alone: bool,
}

impl Solid {
    /// A local cell in the raw frame.
    #[inline(always)]
    pub(super) fn raw(&self, cell: [i32; 3]) -> [i32; 3] {
        [
            cell[0] - self.frame[0],
            cell[1] - self.frame[1],
            cell[2] - self.frame[2],
        ]
    }

    /// Velocity of the body at the centre of a cell of its raw frame.
    #[inline(always)]
    pub(super) fn velocity<const D: usize>(&self, raw: [i32; 3]) -> [f64; 3] {
        let mut arm = [0.0; 3];
        for a in 0..D {
            arm[a] = f64::from(raw[a]) + 0.5 - self.motion.position[a];
        }
        surface_velocity::<D>(&self.motion, arm)
    }
}

/// A body's part of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Share {
    pub(super) slot: u32,
    pub(super) fraction: f32,
}

/// Sums of one worker.
#[derive(Debug, Default)]
pub(super) struct Sums {
    loads: Vec<Load>,
    touched: Vec<u32>,
    known: Vec<bool>,
}

impl Sums {
    fn fit(&mut self, slots: usize) {
        self.loads.resize(slots, [0; 6]);
        self.known.resize(slots, false);
        self.touched
            .reserve(slots.saturating_sub(self.touched.len()));
    }

    #[inline(always)]
    pub(super) fn add<const D: usize>(&mut self, slot: u32, raw: [i32; 3], force: [f64; 3]) {
        let k = slot as usize;
        if let (Some(known), Some(load)) = (self.known.get_mut(k), self.loads.get_mut(k)) {
            if !*known {
                *known = true;
                self.touched.push(slot);
            }
            let force = [quanta(force[0]), quanta(force[1]), quanta(force[2])];
            let middle = [2 * raw[0] + 1, 2 * raw[1] + 1, 2 * raw[2] + 1];
            add_force::<D>(load, force, middle);
        }
    }

    /// Adds the forces, in quanta, on cells of a row that one body covers: what [`Self::add`] adds one by one. `raw` is the first cell, `fast`
    /// the axis of the row, `force` the sum over the cells, `weighted` that of the forces times their place from 0.
    #[inline(always)]
    pub(super) fn add_row<const D: usize>(
        &mut self,
        slot: u32,
        raw: [i32; 3],
        fast: usize,
        force: [i64; 3],
        weighted: [i64; 3],
    ) {
        let k = slot as usize;
        if let (Some(known), Some(load)) = (self.known.get_mut(k), self.loads.get_mut(k)) {
            if !*known {
                *known = true;
                self.touched.push(slot);
            }
            let middle = [2 * raw[0] + 1, 2 * raw[1] + 1, 2 * raw[2] + 1];
            add_force::<D>(load, force, middle);
            // The places of the others, in half cells from the first.
            let mut along = [0; 3];
            along[fast] = 2;
            add_moment::<D>(load, weighted, along);
        }
    }
}

/// What covers the cells of a slab.
#[derive(Debug)]
pub struct Cover {
    pub(super) method: Method,
    pub(super) fluid: CoveredFluid,
    /// Axes from slowest to fastest.
    pub(super) order: [usize; 3],
    /// ε by position of a cell; of a ghost cell its negative.
    pub(super) fraction: Vec<f32>,
    /// Slot of its body, or [`SHARED`] and a place in `shared`.
    pub(super) owner: Vec<u32>,
    pub(super) shared: Vec<Vec<Share>>,
    /// Places in `shared` to use again.
    unused: Vec<u32>,
    pub(super) solids: Vec<Solid>,
    pub(super) sums: Vec<Sums>,
    /// From a cell to its neighbours.
    pub(super) offsets: [isize; 27],
    /// Something changed since this was last asked.
    changed: bool,
}

impl Cover {
    /// No body over the cells of `populations`, for passes by this many `workers`.
    #[must_use]
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        method: Method,
        relaxation_time: f64,
        antisymmetric: AntisymmetricRate,
        workers: usize,
    ) -> Self {
        let positions = populations.cell_positions();
        let mut offsets = [0; 27];
        for i in 0..populations.velocities().q() {
            offsets[i] = populations.offset(i);
        }
        Self {
            method,
            fluid: CoveredFluid {
                weighting: method.weighting,
                time: relaxation_time - 0.5,
                antisymmetric,
            },
            order: populations.order(),
            fraction: vec![0.0; positions],
            // A vector of neighbours may reach beyond the last cell.
            owner: vec![NONE; positions + WIDEST],
            shared: Vec::new(),
            unused: Vec::new(),
            solids: Vec::new(),
            sums: (0..workers.max(1)).map(|_| Sums::default()).collect(),
            offsets,
            changed: true,
        }
    }

    /// Whether cells or motions have changed since this was last asked.
    pub fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.changed)
    }

    /// A wall at rest fills these ghost cells.
    pub fn wall_off(&mut self, ghosts: impl Iterator<Item = usize>) {
        for position in ghosts {
            self.fraction[position] = -1.0;
            self.owner[position] = STILL;
        }
    }

    /// Bytes beside the populations for each cell.
    pub const BYTES: usize = size_of::<f32>() + size_of::<u32>();

    /// Room for bodies in these many slots.
    pub fn make_room(&mut self, slots: usize) {
        self.solids.resize(slots, Solid::default());
        for sums in &mut self.sums {
            sums.fit(slots);
        }
    }

    /// Who is in a slot and how it moves.
    pub fn set(&mut self, slot: u32, solid: Solid) {
        if let Some(there) = self.solids.get_mut(slot as usize) {
            self.changed |= there.motion != solid.motion || there.frame != solid.frame;
            *there = solid;
        }
    }

    /// Fetches what is known of the cell at a position into the cache.
    #[inline(always)]
    pub fn ask(&self, position: usize) {
        prefetch(self.owner.as_ptr().wrapping_add(position));
        prefetch(self.fraction.as_ptr().wrapping_add(position));
    }

    /// Body `slot` fills `fraction` of the cell at a position, or [`DEEP`]; 0 takes it out. Of a ghost cell give the negative.
    #[inline]
    pub fn cover(&mut self, position: usize, slot: u32, fraction: f32) {
        let owner = self.owner[position];
        if owner == STILL {
            return;
        }
        self.changed = true;
        let held = self.fraction[position];
        let sign = if held < 0.0 || fraction < 0.0 {
            -1.0
        } else {
            1.0
        };
        let fraction = fraction.abs();
        if owner == NONE || owner == slot {
            self.fraction[position] = sign * fraction;
            self.owner[position] = if fraction > 0.0 { slot } else { NONE };
        } else {
            self.share(position, slot, sign, fraction);
        }
    }

    /// The same where another body is too.
    #[inline(never)]
    fn share(&mut self, position: usize, slot: u32, sign: f32, fraction: f32) {
        let (owner, held) = (self.owner[position], self.fraction[position]);
        let place = if owner & SHARED == 0 {
            if fraction <= 0.0 {
                return;
            }
            let first = Share {
                slot: owner,
                fraction: held.abs().min(1.0),
            };
            let place = self.unused.pop().unwrap_or_else(|| {
                self.shared.push(Vec::new());
                number(self.shared.len() - 1)
            });
            self.shared[place as usize].push(first);
            self.owner[position] = SHARED | place;
            place
        } else {
            owner & !SHARED
        };
        let solids = &self.solids;
        let shares = &mut self.shared[place as usize];
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
            self.unused.push(place);
            self.owner[position] = only.slot;
            self.fraction[position] = sign * only.fraction;
        } else {
            self.fraction[position] = sign * rounded(total(shares).min(1.0));
        }
    }

    /// The part of a cell that is solid.
    #[must_use]
    pub fn fraction(&self, position: usize) -> f64 {
        f64::from(self.fraction[position].min(1.0))
    }

    /// The fraction as it is held: [`DEEP`] deep inside a body, negative in a ghost cell.
    #[cfg(test)]
    pub(crate) fn held(&self, position: usize) -> f32 {
        self.fraction[position]
    }

    /// Id of the body that fills most of a cell, if solids fill half of it.
    #[must_use]
    pub fn body_at(&self, position: usize) -> Option<u64> {
        if self.fraction[position] < 0.5 {
            return None;
        }
        let owner = self.owner[position];
        let slot = if owner & SHARED == 0 {
            owner
        } else {
            let shares = self.shared.get((owner & !SHARED) as usize)?;
            let mut most = shares.first()?;
            for share in shares {
                if share.fraction > most.fraction {
                    most = share;
                }
            }
            most.slot
        };
        self.solids.get(slot as usize).map(|solid| solid.name.0)
    }

    /// B of a cell (or ε) in quanta: how much of the body force on it the water does not feel.
    #[must_use]
    pub fn weight(&self, position: usize) -> i64 {
        let fraction = self.fraction(position);
        quanta(if self.fraction[position] > 1.0 {
            1.0
        } else {
            self.method.operator.share(&self.fluid, fraction)
        })
    }

    /// Velocity of the solids in a cell: `at` are its local coordinates.
    #[must_use]
    pub fn velocity<const D: usize>(&self, position: usize, at: [i32; 3]) -> [f64; 3] {
        let owner = self.owner[position];
        let single = [Share {
            slot: owner,
            fraction: 1.0,
        }];
        let shares = if owner == NONE {
            &[][..]
        } else if owner & SHARED == 0 {
            &single[..]
        } else {
            self.shared
                .get((owner & !SHARED) as usize)
                .map_or(&[][..], Vec::as_slice)
        };
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
    }

    /// Velocity of the solids in a cell that they fill by half and more, at a point `offset` from its centre: `at` are its local
    /// coordinates. Ghost cells count, what is behind walls does not.
    #[must_use]
    pub fn velocity_beside<const D: usize>(
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
        let shares = self.shared.get((owner & !SHARED) as usize);
        let shares = shares.map_or(&[][..], Vec::as_slice);
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
    }

    /// The part of a cell or ghost cell that bodies fill; none behind a wall.
    #[must_use]
    pub fn part(&self, position: usize) -> f64 {
        match self.owner[position] {
            NONE | STILL => 0.0,
            _ => f64::from(self.fraction[position].abs().min(1.0)),
        }
    }

    /// Hands out what each slot received since the last call: forces, and twice the moments about the origin of its raw frame.
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

#[expect(
    clippy::cast_possible_truncation,
    reason = "a cell holds its fraction in f32"
)]
fn rounded(fraction: f64) -> f32 {
    fraction as f32
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "far fewer than 2^31 cells are shared"
)]
fn number(n: usize) -> u32 {
    n as u32
}

/// ε of a cell: the sum in the order of the bodies.
#[inline(always)]
pub(super) fn total(shares: &[Share]) -> f64 {
    let mut sum = 0.0;
    for share in shares {
        sum += f64::from(share.fraction);
    }
    sum
}

/// Sum of quanta of B as a number of cells.
#[must_use]
pub fn cells(weight: i128) -> f64 {
    from_quanta(weight)
}
