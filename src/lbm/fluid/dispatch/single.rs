//! Selection of a pass with arithmetic in f32, by operator, force, velocity set and processor.

#[cfg(test)]
use super::cell_by_cell;
use super::{Choice, Chosen, Models, Step};
use crate::collision::{Dispatch, Kernels, Operator};
use crate::kernel;
use crate::lanes::Stored;
use crate::lattice::{D2Q9, D3Q19, D3Q27, Lattice, VelocitySet};
use crate::turbulence::Resolved;
use std::any::Any;
use std::marker::PhantomData;

/// Receiver of kernels that only detects that there are any.
struct Existence;

impl Dispatch for Existence {
    type Output = ();

    fn on_any_set<K: Kernels>(self, _: K) {}

    fn on_d3q27<K: Kernels>(self, _: K) {}
}

/// Returns `true` if an operator has a pass with arithmetic in f32, for open cells without eddy viscosity.
#[must_use]
pub fn collides_in_single(operator: Operator) -> bool {
    operator.dispatch_single(Existence).is_some()
}

impl Choice {
    /// Returns the pass in f32; none for populations in f64, cells that solids may cover, an eddy
    /// viscosity, or an operator without a pass in f32.
    pub(in crate::fluid) fn in_single<S: Stored>(self) -> Option<Box<dyn Step<S>>> {
        let step: Box<dyn Any> = Box::new(self.step_in_single()?);
        // The types of `Step<f32>` and `Step<S>` are equal if populations are stored in f32.
        step.downcast::<Box<dyn Step<S>>>().ok().map(|step| *step)
    }

    fn step_in_single(self) -> Option<Box<dyn Step<f32>>> {
        let Models {
            lattice,
            collision,
            turbulence,
        } = self.models;
        if self.covered || turbulence.is_some() {
            return None;
        }
        match lattice {
            VelocitySet::D2Q9 => collision.dispatch_single(ForVelocitySet::<D2Q9, 9>::new(self)),
            VelocitySet::D3Q19 => collision.dispatch_single(ForVelocitySet::<D3Q19, 19>::new(self)),
            VelocitySet::D3Q27 => collision.dispatch_single(ForVelocitySet::<D3Q27, 27>::new(self)),
        }
    }

    fn step_of<L: Lattice<Q>, K: Kernels, const Q: usize>(self, kernels: K) -> Box<dyn Step<f32>> {
        if self.forced {
            self.forced_or_not::<L, K, true, Q>(kernels)
        } else {
            self.forced_or_not::<L, K, false, Q>(kernels)
        }
    }

    fn forced_or_not<L: Lattice<Q>, K: Kernels, const FORCED: bool, const Q: usize>(
        self,
        kernels: K,
    ) -> Box<dyn Step<f32>> {
        let omega = 1.0 / self.relaxation_time;
        Box::new(Chosen {
            pass: kernel::single::choose::<L, K::Uniform<FORCED>, Q>(self.level),
            operator: move |force| kernels.uniform::<FORCED>(omega, force),
            eddies: Resolved,
            viscosity: (self.relaxation_time - 0.5) / 3.0,
            // No kernel of a GPU has this arithmetic.
            without_eddies: None,
            covered: false,
            #[cfg(test)]
            cells: cell_by_cell::<L, K::Uniform<FORCED>, f32, Q>,
        })
    }
}

/// Choice for a given velocity set.
struct ForVelocitySet<L, const Q: usize> {
    choice: Choice,
    lattice: PhantomData<L>,
}

impl<L: Lattice<Q>, const Q: usize> ForVelocitySet<L, Q> {
    fn new(choice: Choice) -> Self {
        let lattice = PhantomData;
        Self { choice, lattice }
    }
}

impl<L: Lattice<Q>, const Q: usize> Dispatch for ForVelocitySet<L, Q> {
    type Output = Box<dyn Step<f32>>;

    fn on_any_set<K: Kernels>(self, kernels: K) -> Self::Output {
        self.choice.step_of::<L, K, Q>(kernels)
    }

    /// The moments are those of D3Q27 for any velocity set.
    fn on_d3q27<K: Kernels>(self, kernels: K) -> Self::Output {
        self.choice.step_of::<D3Q27, K, 27>(kernels)
    }
}
