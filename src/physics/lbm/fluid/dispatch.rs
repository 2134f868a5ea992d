//! The choice of the pass, made once at the start, by operator, force, eddy viscosity, solids, velocity set, storage precision and processor.

use super::Setup;
use crate::lbm::block::Block;
use crate::lbm::collision::{Collision, Dispatch, Kernels, Operator};
use crate::lbm::fluid::force::Force;
use crate::lbm::kernel::{Pass, Shared, Update, choose};
use crate::lbm::lanes::{Level, Stored};
use crate::lbm::lattice::{D2Q9, D3Q19, D3Q27, Lattice, VelocitySet};
use crate::lbm::saturation::{Covered, Open, Solids};
use crate::lbm::turbulence::{Eddies, EddyViscosity, Resolved};
use std::marker::PhantomData;

/// Operator, force and eddies, chosen once: what a step does to some cells at a time.
pub(super) trait Step<S: Stored>: Send + Sync {
    /// One pass over the cells of a block by a worker; `force` is that of this step.
    ///
    /// # Safety
    /// The slab must have these cells; no other thread may work on them or be the same worker.
    unsafe fn pass(&self, shared: &Shared<S>, force: [f64; 3], block: &Block, worker: usize);
}

/// A pass function with the operator as a function of the force.
struct Chosen<S: Stored, C, T, F> {
    pass: Pass<S, C, T>,
    operator: F,
    eddies: T,
    viscosity: f64,
}

impl<S, C, T, F> Step<S> for Chosen<S, C, T, F>
where
    S: Stored,
    C: Collision,
    T: Eddies,
    F: Fn([f64; 3]) -> C + Send + Sync,
{
    unsafe fn pass(&self, shared: &Shared<S>, force: [f64; 3], block: &Block, worker: usize) {
        let update = Update {
            collision: (self.operator)(force),
            eddies: self.eddies,
            viscosity: self.viscosity,
            worker,
        };
        // SAFETY: the cells are the caller's promise; the level was chosen from what the processor offers.
        unsafe { (self.pass)(shared, &update, block) };
    }
}

/// What a pass is chosen by, beside the types.
#[derive(Clone, Copy)]
pub(super) struct Choice {
    operator: Operator,
    eddies: Option<EddyViscosity>,
    relaxation_time: f64,
    forced: bool,
    covered: bool,
    level: Level,
}

impl Choice {
    pub(super) fn of<S: Stored>(setup: &Setup<S>, level: Level) -> Self {
        Self {
            operator: setup.operator,
            eddies: setup.turbulence,
            relaxation_time: setup.relaxation_time,
            forced: setup.force != Force::None,
            covered: setup.saturation.is_some(),
            level,
        }
    }

    /// The pass on a velocity set.
    pub(super) fn on<S: Stored>(self, set: VelocitySet) -> Box<dyn Step<S>> {
        match set {
            VelocitySet::D2Q9 => self.operator.dispatch(On::<D2Q9, S, 9>::new(self)),
            VelocitySet::D3Q19 => self.operator.dispatch(On::<D3Q19, S, 19>::new(self)),
            VelocitySet::D3Q27 => self.operator.dispatch(On::<D3Q27, S, 27>::new(self)),
        }
    }

    fn pass<L: Lattice<Q>, K: Kernels, S: Stored, const Q: usize>(
        self,
        kernels: K,
    ) -> Box<dyn Step<S>> {
        let omega = 1.0 / self.relaxation_time;
        if self.covered {
            let kernel = move |force| kernels.covered(omega, force);
            self.boxed::<L, _, _, Covered, S, Q>(kernel, self.eddies)
        } else if self.eddies.is_some() {
            let kernel = move |force| kernels.local(omega, force);
            self.boxed::<L, _, _, Open, S, Q>(kernel, self.eddies)
        } else if self.forced {
            let kernel = move |force| kernels.uniform::<true>(omega, force);
            self.boxed::<L, _, _, Open, S, Q>(kernel, Resolved)
        } else {
            let kernel = move |force| kernels.uniform::<false>(omega, force);
            self.boxed::<L, _, _, Open, S, Q>(kernel, Resolved)
        }
    }

    fn boxed<L, C, T, P, S, const Q: usize>(
        self,
        operator: impl Fn([f64; 3]) -> C + Send + Sync + 'static,
        eddies: T,
    ) -> Box<dyn Step<S>>
    where
        L: Lattice<Q>,
        C: Collision + 'static,
        T: Eddies,
        P: Solids,
        S: Stored,
    {
        Box::new(Chosen {
            pass: choose::<L, C, T, P, S, Q>(self.level),
            operator,
            eddies,
            viscosity: (self.relaxation_time - 0.5) / 3.0,
        })
    }
}

/// The choice on a velocity set.
struct On<L, S, const Q: usize> {
    choice: Choice,
    types: PhantomData<(L, S)>,
}

impl<L: Lattice<Q>, S: Stored, const Q: usize> On<L, S, Q> {
    fn new(choice: Choice) -> Self {
        let types = PhantomData;
        Self { choice, types }
    }
}

impl<L: Lattice<Q>, S: Stored, const Q: usize> Dispatch for On<L, S, Q> {
    type Output = Box<dyn Step<S>>;

    fn on_any_set<K: Kernels>(self, kernels: K) -> Self::Output {
        self.choice.pass::<L, K, S, Q>(kernels)
    }

    /// The moments are those of D3Q27 for any velocity set.
    fn on_d3q27<K: Kernels>(self, kernels: K) -> Self::Output {
        self.choice.pass::<D3Q27, K, S, 27>(kernels)
    }
}
