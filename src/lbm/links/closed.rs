//! Bounce-back at stationary surfaces below a free surface: interpolated links that together keep the mass of the
//! water.
//!
//! Interpolation ([`super::fixed`]) returns another population than the one that left. Along a smooth flow the sum of
//! the differences over a surface vanishes with the order of the scheme only; below a free surface the rest would raise
//! or lower the water. It is therefore divided among the ends of the structure that are in liquid, by the weights w_i
//! of their directions:
//!
//! f_ī(x, t+1) = f*_i(x) + κ [f_i(x, t+1) - f*_ī(x)] - w_i e,
//!
//! with e from the sum over all ranks. In water at rest there is no difference.
//!
//! Next to the free surface links are half-way, because the cell behind may have no water. Interface cells take no
//! part in the sum: their mass does not follow from their populations ([`crate::surface`]).

use super::fixed::FixedLink;
use super::{Direction, Load, Numbers, Table, add_along};
use crate::lanes::Stored;
use crate::populations::{Parity, Populations};
use crate::quanta::{from_quanta, quanta};
use crate::surface::kind::LIQUID;
use base::thread_pool;

/// Number of groups of links per thread and batch.
const PER_THREAD: usize = 4;

/// Positions of the cells at both ends of a link.
pub type LinkCells = [u32; 2];

/// Populations of the links of a group during a step, and their sums; the buffer is reused.
#[derive(Clone, Debug, Default)]
pub struct Reflected {
    /// Populations that leave and that return at both ends of each link.
    values: Vec<[[f64; 2]; 2]>,
    /// Mass returned beyond that which left, and sum of the weights, of the ends in liquid, in quanta.
    pub sums: [i128; 2],
    /// Load on the surface.
    pub load: Load,
}

/// Computes the populations that return on the links of each group, without the share of the rest of the mass.
/// `kinds` are those of the cells of the free surface.
pub fn reflect<S: Stored>(
    populations: &mut Populations<S>,
    (groups, ends): (&[Vec<FixedLink>], &[Vec<LinkCells>]),
    kinds: &[u8],
    reflected: &mut [Reflected],
) {
    let state = State::new(populations, kinds);
    thread_pool::each_item(reflected, PER_THREAD, |k, group| {
        group.values.clear();
        group.sums = [0; 2];
        for (link, ends) in groups[k].iter().zip(&ends[k]) {
            // SAFETY: positions made by `Populations::link` lie in the array, and nothing writes it meanwhile; the
            // cell behind an interpolated end is at most one cell beyond the slab.
            let values = [0, 1].map(|end| unsafe { state.returns(link, ends, end) });
            for end in (0..2).filter(|&end| state.counts(link, ends, end)) {
                let [leaves, returns] = values[end];
                group.sums[0] += i128::from(quanta(returns) - quanta(leaves));
                group.sums[1] += i128::from(quanta(weight(&state, link)));
            }
            group.values.push(values);
        }
    });
}

/// Writes the populations that return and sums the loads. `shares` are the mass e of each group per weight.
pub fn complete<S: Stored, const D: usize>(
    populations: &mut Populations<S>,
    (groups, ends): (&[Vec<FixedLink>], &[Vec<LinkCells>]),
    kinds: &[u8],
    (reflected, shares): (&mut [Reflected], &[f64]),
) {
    let parity = populations.parity();
    let state = State::new(populations, kinds);
    thread_pool::each_item(reflected, PER_THREAD, |k, group| {
        let mut load = [0; 6];
        for ((link, ends), values) in groups[k].iter().zip(&ends[k]).zip(&group.values) {
            let returns = [0, 1].map(|end| {
                let share = if state.counts(link, ends, end) {
                    weight(&state, link) * shares[k]
                } else {
                    0.0
                };
                values[end][1] - share
            });
            let positions = [link.link.incoming(parity), link.link.out(parity)];
            for (position, value) in positions.into_iter().zip(returns) {
                // SAFETY: every link is in one group once, so that no other thread accesses its two numbers.
                unsafe { state.numbers.0.add(position).write(S::from_f64(value)) };
            }
            let c = state.direction(link, 0).ci;
            for (end, sign) in [(0, 1), (1, -1)] {
                if link.wet[end] {
                    let passed = sign * quanta(values[end][0] + returns[end]);
                    add_along::<D>(&mut load, passed, c, link.middle);
                }
            }
        }
        group.load = load;
    });
}

/// Returns the mass per weight that the sums of all ranks leave, e.
#[must_use]
pub fn rest_per_weight(sums: [i128; 2]) -> f64 {
    if sums[1] > 0 {
        from_quanta(sums[0]) / from_quanta(sums[1])
    } else {
        0.0
    }
}

/// Populations and the data on which the links depend.
struct State<'a, S> {
    numbers: Numbers<S>,
    parity: Parity,
    table: Table,
    opposite: [u8; 32],
    kinds: &'a [u8],
}

impl<'a, S: Stored> State<'a, S> {
    fn new(populations: &mut Populations<S>, kinds: &'a [u8]) -> Self {
        let v = populations.velocities();
        let opposite = std::array::from_fn(|i| {
            let back = v.opposite.get(i).copied().unwrap_or(0);
            u8::try_from(back).unwrap_or(0)
        });
        Self {
            parity: populations.parity(),
            table: Table::new(populations),
            opposite,
            kinds,
            numbers: Numbers(populations.numbers_mut().as_mut_ptr()),
        }
    }

    /// Returns the data of the direction from an end of a link to the other one.
    #[inline(always)]
    fn direction(&self, link: &FixedLink, end: usize) -> &Direction {
        let forth = usize::from(link.direction % 32);
        let back = usize::from(self.opposite[forth] % 32);
        &self.table.0[[forth, back][end]]
    }

    /// Returns `true` if a cell is liquid.
    #[inline(always)]
    fn is_liquid(&self, cell: usize) -> bool {
        self.kinds[cell] == LIQUID
    }

    /// Returns `true` if an end takes part in the sum of the mass.
    #[inline(always)]
    fn counts(&self, link: &FixedLink, ends: &LinkCells, end: usize) -> bool {
        link.wet[end] && self.is_liquid(ends[end] as usize)
    }

    /// Returns the populations that leave an end and that return to it.
    ///
    /// # Safety
    /// The positions must be those of the populations, and no thread may write the numbers.
    #[inline(always)]
    unsafe fn returns(&self, link: &FixedLink, ends: &LinkCells, end: usize) -> [f64; 2] {
        // SAFETY: promised by the caller.
        let read = |position: usize| unsafe { self.numbers.0.add(position).read().to_f64() };
        let positions = [link.link.out(self.parity), link.link.incoming(self.parity)];
        let leaves = read(positions[end]);
        let cell = ends[end] as usize;
        if !link.wet[end] {
            return [leaves, leaves];
        }
        let along = self.direction(link, end);
        let behind = cell.wrapping_add_signed(along.behind);
        let kappa = link.kappa[end];
        let between = kappa != 0.0 && self.is_liquid(cell) && self.is_liquid(behind);
        let mut returns = leaves;
        if between {
            let near = [link.link.near, link.link.far][end] as usize;
            let home = near.wrapping_add_signed(along.swap);
            let behind = near.wrapping_add_signed(along.behind);
            let (entering, returning) = match self.parity {
                Parity::Home => (home, behind),
                Parity::Reversed => (behind, home),
            };
            returns += kappa * (read(entering) - read(returning));
        }
        [leaves, returns]
    }
}

/// Returns the weight of the direction of a link.
#[inline(always)]
fn weight<S: Stored>(state: &State<S>, link: &FixedLink) -> f64 {
    state.direction(link, 0).six_weights / 6.0
}
