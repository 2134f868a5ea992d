//! Prescribed pressure by anti-bounce-back (Ginzburg, Verhaeghe and d'Humières 2008; A-08).
//!
//! f_ī(x, t+1) = -f*_i(x, t) + 2 w_i ρ_w [1 + 9/2 (c_i·u)² - 3/2 u²]: the even part of the incoming population is the
//! equilibrium at the wanted density, so the pressure holds half-way across the face. u is the velocity of the cell
//! itself; it enters only squared. Needs no special corner nodes, in two or three dimensions.

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
    pub(crate) weight: f64,
    pub(crate) c: [f64; 3],
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
        let u: [f64; 3] = std::array::from_fn(|a| (momentum[a] - half_force[a]) / (1.0 + drho));
        let uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
        for link in &links[cell.first..cell.first + cell.count] {
            let wanted = density(link.patch);
            let cu = link.c[0] * u[0] + link.c[1] * u[1] + link.c[2] * u[2];
            let even = wanted + (1.0 + wanted) * (4.5 * cu * cu - 1.5 * uu);
            let numbers = populations.numbers_mut();
            let value = 2.0 * link.weight * even - numbers[link.link.out(parity)].to_f64();
            numbers[link.link.incoming(parity)] = S::from_f64(value);
        }
    }
}
