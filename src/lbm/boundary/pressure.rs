//! Prescribed pressure with tangential velocity zero: free slip with the sign of anti-bounce-back.
//!
//! f_j(x, t+1) = -f*_i(x - t) + 2 w_i ρ_w (1 + 3 u_n²), i and t as for free slip ([`super::free_slip`]): the population that
//! crosses the face where f_j enters, with the same part along the face.
//!
//! Of the two links that cross the face at one point, the half sum carries the pressure and is returned by anti-bounce-back
//! (Ginzburg, Verhaeghe and d'Humières 2008), so that the pressure holds half-way across the face; the half difference
//! carries the tangential velocity and is returned by bounce-back (Ladd 1994), so that this velocity is zero there. Together
//! they are the rule above. Anti-bounce-back of each link by itself would also reverse the shear stress in the half
//! difference: flow between plates would then lose pressure where it enters and leaves, whatever the resolution. With no
//! velocity along the face the half sum holds no viscous stress, and the rule is second order. u_n, the normal velocity of
//! the cell, enters only squared. Needs no special corner nodes, in two or three dimensions.

use super::free_slip::Mirror;
use crate::lbm::lanes::Stored;
use crate::lbm::populations::{Link, Populations};

/// A cell at a pressure face with its links.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PressureCell {
    pub(crate) cell: usize,
    pub(crate) first: usize,
    pub(crate) count: usize,
}

/// One link through a pressure face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PressureLink {
    pub(crate) link: Link,
    pub(crate) patch: usize,
    pub(crate) direction: usize,
    /// Where the population that is returned lies.
    pub(crate) mirror: Mirror,
    /// Axis normal to the face.
    pub(crate) axis: usize,
    pub(crate) weight: f64,
}

pub(super) fn apply<S: Stored>(
    cells: &[PressureCell],
    links: &[PressureLink],
    density: impl Fn(usize) -> f64,
    populations: &mut Populations<S>,
    half_force: [f64; 3],
) {
    let parity = populations.parity();
    for cell in cells {
        // The collision added F to the momentum; the velocity of the step is that before, plus F/2.
        let (drho, momentum) = populations.outgoing_moments(cell.cell);
        for link in &links[cell.first..cell.first + cell.count] {
            let a = link.axis;
            let normal = (momentum[a] - half_force[a]) / (1.0 + drho);
            let wanted = density(link.patch);
            let even = wanted + (1.0 + wanted) * (3.0 * normal * normal);
            let (from, _) = link.mirror.ends(parity);
            let numbers = populations.numbers_mut();
            let value = 2.0 * link.weight * even - numbers[from].to_f64();
            numbers[link.link.incoming(parity)] = S::from_f64(value);
        }
    }
}
