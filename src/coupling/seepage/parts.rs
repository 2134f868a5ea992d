//! Cells that contain parts of each owned grain, computed once per coupling, by threads.

use base::thread_pool;
use darcy::Pores;
use dem::particles::ParticlesView;
use dem::space::Space;
use std::ops::Range;

/// Minimum number of grains per thread.
const PER_THREAD: usize = 100;

/// Number of kinds of values that are summed in each cell; each kind has a common unit.
pub(super) const UNITS: usize = 6;
/// Number of values that are summed in each cell: each kind along each axis.
pub(super) const NUMBERS: usize = 3 * UNITS;

/// Part of a grain in a cell, between two couplings: its velocity at the end is `answer [known + compliance (drag
/// flux - V grad phi)]`, the force on it `drag (flux - measure velocity) - V grad p`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Term {
    /// Ratio of force to superficial slip along each axis \[kg/s\].
    pub(super) drag: [f64; 3],
    /// Ratio of the reaction on the water to superficial slip along each axis \[kg/s\].
    pub(super) reaction: [f64; 3],
    /// Part of the interval divided by the mass of the grain \[s/kg\]; 0 if the present velocity of the grain is used.
    pub(super) compliance: f64,
    /// 1/(1 + compliance drag measure) along each axis.
    pub(super) response: [f64; 3],
    /// Velocity without flux and gradient \[m/s\].
    pub(super) known: [f64; 3],
    /// `true` if drag stops the grain within the interval, so that its velocity is taken later than in the middle of
    /// the interval.
    pub(super) late: bool,
}

impl Term {
    /// Returns the drag of a flux \[m/s\] and a gradient of the reduced pressure \[Pa/m\] on the whole grain \[N\].
    pub(super) fn drag(
        &self,
        volume: f64,
        measure: f64,
        flux: [f64; 3],
        gradient: [f64; 3],
    ) -> [f64; 3] {
        let push = self.compliance * volume;
        std::array::from_fn(|a| {
            let slip = flux[a] - measure * (self.known[a] - push * gradient[a]);
            self.drag[a] * self.response[a] * slip
        })
    }
}

/// Load of the water on a grain.
#[derive(Clone, Copy, Debug)]
pub(super) struct GrainLoad {
    /// Force \[N\].
    pub(super) force: [f64; 3],
    /// Part of the force that the balance of momentum includes \[N\].
    pub(super) counted: [f64; 3],
    /// `true` if the drag stops the grain within the interval.
    pub(super) implicit: bool,
}

/// Parts of the grains that one thread processes.
#[derive(Debug, Default)]
pub(super) struct Share {
    /// Index of the first grain.
    first: usize,
    /// End of the parts of each grain in `parts`.
    ends: Vec<usize>,
    /// Cells that contain a part of a grain, each with the fraction of the grain.
    pub(super) parts: Vec<(usize, f64)>,
    /// Drag and motion of each part.
    pub(super) terms: Vec<Term>,
    /// Contribution of each part to the sums of its cell, and the largest number of each kind.
    pub(super) numbers: Vec<[f64; NUMBERS]>,
    pub(super) largest: [f64; UNITS],
    /// Load of each grain.
    pub(super) loads: Vec<GrainLoad>,
}

impl Share {
    /// Returns the index range of the grains.
    pub(super) fn grains(&self) -> Range<usize> {
        self.first..self.first + self.ends.len()
    }

    /// Returns the index range of the parts of a grain.
    pub(super) fn places(&self, grain: usize) -> Range<usize> {
        let n = grain - self.first;
        let start = n.checked_sub(1).map_or(0, |before| self.ends[before]);
        start..self.ends[n]
    }

    /// Returns the cells that contain parts of a grain, each with the fraction of the grain.
    pub(super) fn cells_of(&self, grain: usize) -> &[(usize, f64)] {
        &self.parts[self.places(grain)]
    }
}

/// Parts of all owned grains.
#[derive(Debug, Default)]
pub(super) struct Parts {
    pub(super) shares: Vec<Share>,
}

impl Parts {
    /// Computes the parts of the grains at their present positions.
    pub(super) fn find<Sp: Space>(&mut self, pores: &Pores, grains: &ParticlesView<'_, Sp>) {
        let owned = grains.owned;
        let threads = thread_pool::threads().min(owned / PER_THREAD).max(1);
        self.shares.resize_with(threads, Share::default);
        thread_pool::each_item(&mut self.shares, 1, |t, share| {
            share.first = owned * t / threads;
            share.ends.clear();
            share.parts.clear();
            for k in share.first..owned * (t + 1) / threads {
                let centre = super::components(&grains.location(k));
                pores.append_parts(centre, grains.body[k].radius, &mut share.parts);
                share.ends.push(share.parts.len());
            }
        });
    }

    /// Returns every owned grain with its parts.
    pub(super) fn each(&self) -> impl Iterator<Item = (usize, &[(usize, f64)])> {
        let shares = self.shares.iter();
        shares.flat_map(|share| share.grains().map(|k| (k, share.cells_of(k))))
    }
}
