//! Numbers and neighbours of a cell at fixed distances, for a velocity set that the compiler knows.
//!
//! Interface cells are few, and each needs its populations, those of the liquid cell inside and the kinds of all
//! neighbours several times in a step. With the distances in tables and the loops over the directions written out, a
//! sum over the populations is one load and few additions for each.

use super::cells::Cells;
use super::kind::SOLID;
use super::moments::{Moments, PAIRS, from_sums};
use crate::lanes::Stored;
use crate::lattice::{Lattice, unroll};
use crate::populations::Populations;
use std::marker::PhantomData;

/// Numbers of a slab, divided among threads by cell.
pub(super) struct Numbers<S>(*mut S);
// SAFETY: each number belongs to one link end of one interface cell, and each cell to one thread.
unsafe impl<S: Send> Sync for Numbers<S> {}

impl<S: Stored> Numbers<S> {
    /// Returns the numbers of the populations.
    pub(super) fn new(populations: &mut Populations<S>) -> Self {
        Self(populations.numbers_mut().as_mut_ptr())
    }

    /// Returns the numbers of the populations, which no thread writes.
    pub(super) fn to_read(populations: &Populations<S>) -> Self {
        Self(populations.numbers().as_ptr().cast_mut())
    }

    /// Returns the numbers of a list.
    pub(super) fn from_list(list: &mut [S]) -> Self {
        Self(list.as_mut_ptr())
    }

    /// Returns the address of the first number.
    #[inline(always)]
    pub(super) fn start(&self) -> *const S {
        self.0
    }

    /// Reads a number.
    ///
    /// # Safety
    /// The position lies in the slab, and no other thread writes it.
    #[inline(always)]
    pub(super) unsafe fn read(&self, position: usize) -> f64 {
        // SAFETY: promised by the caller.
        unsafe { self.0.add(position).read().to_f64() }
    }

    /// Writes a number.
    ///
    /// # Safety
    /// The position lies in the slab, and no other thread reads or writes it.
    #[inline(always)]
    pub(super) unsafe fn write(&self, position: usize, value: f64) {
        // SAFETY: promised by the caller.
        unsafe { self.0.add(position).write(S::from_f64(value)) }
    }
}

/// Square roots of 0 to 3.
const ROOTS: [f64; 4] = [0.0, 1.0, std::f64::consts::SQRT_2, 1.732_050_807_568_877_2];

/// Distances from the position of a cell to its numbers and its neighbours, between two passes; they wrap.
pub(super) struct Stencil<L, const Q: usize> {
    incoming: [usize; Q],
    out: [usize; Q],
    back: [usize; Q],
    neighbours: [usize; Q],
    lattice: PhantomData<L>,
}

impl<L: Lattice<Q>, const Q: usize> Stencil<L, Q> {
    /// Velocity of each population.
    pub(super) const C: [[f64; 3]; Q] = {
        let mut c = [[0.0; 3]; Q];
        let mut i = 0;
        while i < Q {
            c[i] = [L::C[i][0] as f64, L::C[i][1] as f64, L::C[i][2] as f64];
            i += 1;
        }
        c
    };

    /// Length of the link along each direction.
    pub(super) const LENGTHS: [f64; Q] = {
        let mut lengths = [0.0; Q];
        let mut i = 0;
        while i < Q {
            let c = L::C[i];
            let axes = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]).unsigned_abs();
            lengths[i] = ROOTS[axes as usize];
            i += 1;
        }
        lengths
    };

    /// Returns the distances after the last pass.
    pub(super) fn new<S: Stored>(populations: &Populations<S>) -> Self {
        let parity = populations.parity();
        let cell = populations.cell([0; 3]);
        let from = |position: usize| position.wrapping_sub(cell);
        let link = |i: usize| populations.link(cell, i);
        let rest = populations.incoming(cell, 0);
        Self {
            incoming: std::array::from_fn(|i| from(populations.incoming(cell, i))),
            out: std::array::from_fn(|i| from(if i == 0 { rest } else { link(i).out(parity) })),
            back: std::array::from_fn(|i| {
                from(if i == 0 {
                    rest
                } else {
                    link(i).incoming(parity)
                })
            }),
            neighbours: std::array::from_fn(|i| populations.offset(i).cast_unsigned()),
            lattice: PhantomData,
        }
    }

    /// Returns the position of the incoming population of a cell.
    #[inline(always)]
    pub(super) fn incoming(&self, cell: usize, i: usize) -> usize {
        cell.wrapping_add(self.incoming[i])
    }

    /// Returns the position of the population that left a cell; that at rest for direction 0.
    #[inline(always)]
    pub(super) fn out(&self, cell: usize, i: usize) -> usize {
        cell.wrapping_add(self.out[i])
    }

    /// Returns the position of the population that comes back along a direction.
    #[inline(always)]
    pub(super) fn back(&self, cell: usize, i: usize) -> usize {
        cell.wrapping_add(self.back[i])
    }

    /// Returns the position of the neighbour of a cell.
    #[inline(always)]
    pub(super) fn neighbour(&self, cell: usize, i: usize) -> usize {
        cell.wrapping_add(self.neighbours[i])
    }

    /// Returns the kinds of the neighbours of a cell, solid behind sheets and in direction 0.
    #[inline(always)]
    pub(super) fn kinds(&self, cells: &Cells, cell: usize) -> [u8; Q] {
        let mut kinds = [SOLID; Q];
        for i in 1..Q {
            kinds[i] = cells.kind[self.neighbour(cell, i)];
        }
        let closed = cells.closed(cell);
        if closed > 1 {
            for (i, kind) in kinds.iter_mut().enumerate() {
                if closed & (1 << i) != 0 {
                    *kind = SOLID;
                }
            }
        }
        kinds
    }

    /// Returns the density of a cell.
    ///
    /// # Safety
    /// The cell lies in the slab, and no other thread writes its incoming numbers.
    #[inline(always)]
    pub(super) unsafe fn density<S: Stored>(&self, numbers: &Numbers<S>, cell: usize) -> f64 {
        // SAFETY: promised by the caller.
        density::<Q>(|i| unsafe { numbers.read(self.incoming(cell, i)) })
    }

    /// Returns the density and the momentum of a cell.
    ///
    /// # Safety
    /// The conditions are those of [`Self::density`].
    #[inline(always)]
    pub(super) unsafe fn momentum<S: Stored>(
        &self,
        numbers: &Numbers<S>,
        cell: usize,
    ) -> (f64, [f64; 3]) {
        // SAFETY: promised by the caller.
        momentum::<L, Q>(|i| unsafe { numbers.read(self.incoming(cell, i)) })
    }

    /// Returns the moments of a cell.
    ///
    /// # Safety
    /// The conditions are those of [`Self::density`].
    #[inline(always)]
    pub(super) unsafe fn moments<S: Stored>(&self, numbers: &Numbers<S>, cell: usize) -> Moments {
        // SAFETY: promised by the caller.
        sums::<L, Q>(|i| unsafe { numbers.read(self.incoming(cell, i)) })
    }
}

/// Returns the density of incoming populations.
#[inline(always)]
pub(super) fn density<const Q: usize>(number: impl Fn(usize) -> f64) -> f64 {
    let mut density = 0.0;
    unroll!(populations i < Q => {
        density += number(i);
    });
    density
}

/// Adds the momentum of incoming population `i`, the number `g`.
#[inline(always)]
fn add_momentum<L: Lattice<Q>, const Q: usize>(momentum: &mut [f64; 3], i: usize, g: f64) {
    unroll!(axes a < 3 => {
        match L::C[i][a] {
            1 => momentum[a] += g,
            -1 => momentum[a] -= g,
            _ => {}
        }
    });
}

/// Returns the density and the momentum of incoming populations.
#[inline(always)]
pub(super) fn momentum<L: Lattice<Q>, const Q: usize>(
    number: impl Fn(usize) -> f64,
) -> (f64, [f64; 3]) {
    let mut density = 0.0;
    let mut momentum = [0.0; 3];
    unroll!(populations i < Q => {
        let g = number(i);
        density += g;
        add_momentum::<L, Q>(&mut momentum, i, g);
    });
    (density, momentum)
}

/// Returns the moments of incoming populations.
#[inline(always)]
pub(super) fn sums<L: Lattice<Q>, const Q: usize>(number: impl Fn(usize) -> f64) -> Moments {
    let mut density = 0.0;
    let mut momentum = [0.0; 3];
    let mut second = [0.0; 6];
    unroll!(populations i < Q => {
        let g = number(i);
        density += g;
        add_momentum::<L, Q>(&mut momentum, i, g);
        unroll!(six n < 6 => {
            let [a, b] = PAIRS[n];
            match L::C[i][a] * L::C[i][b] {
                1 => second[n] += g,
                -1 => second[n] -= g,
                _ => {}
            }
        });
    });
    from_sums(L::DIMENSION, density, momentum, second)
}

/// Calls a function for the velocity set of populations: `with_set!(populations, function(arguments))` calls
/// `function::<L, _, Q>(arguments)`.
macro_rules! with_set {
    ($populations:expr, $($function:ident)::+($($argument:expr),* $(,)?)) => {
        match $populations.velocities().q() {
            9 => $($function)::+::<crate::lattice::D2Q9, _, 9>($($argument),*),
            19 => $($function)::+::<crate::lattice::D3Q19, _, 19>($($argument),*),
            _ => $($function)::+::<crate::lattice::D3Q27, _, 27>($($argument),*),
        }
    };
}
pub(super) use with_set;
