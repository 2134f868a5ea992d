//! Permeability and pore volume of unsaturated ground that consists of the grains of the case, as they move.
//!
//! ```text
//! K = K_0 [eps^3/(1 - eps)^2] / [eps_0^3/(1 - eps_0)^2],     theta = theta_r + (theta_s eps/eps_0 - theta_r) S_e(psi)
//! ```
//!
//! `K_0` and the contents are stated for the porosity `eps_0`, `eps` is that of the grains in the cell (Kozeny and
//! Carman: [`darcy::resistance::kozeny_carman`]). The suction at which the pores drain stays that of the soil. During
//! an interval the pore volume changes linearly, so that ground that is saturated and compressed expels water over the
//! interval. The volume of water of a cell is a state of its own: grains that leave a cell leave its water behind.

use darcy::resistance::kozeny_carman::kozeny_carman;

/// Ground that follows the grains.
#[derive(Debug, Default)]
pub(super) struct Following {
    /// Porosity to which the stated values of each cell refer, 0 for cells that do not follow; empty if none does.
    reference: Vec<f64>,
    /// Permeability over the stated one.
    factor: Vec<f64>,
    /// Pore volume over the stated one, at the start of an interval and at its end.
    parts: [Vec<f64>; 2],
}

impl Following {
    pub(super) fn new(reference: Vec<f64>) -> Self {
        let ones = vec![1.0; reference.len()];
        Self {
            reference,
            factor: ones.clone(),
            parts: [ones.clone(), ones],
        }
    }

    /// Returns `true` if any cell follows the grains.
    pub(super) fn acts(&self) -> bool {
        !self.reference.is_empty()
    }

    /// Returns the permeability of a cell over the stated one.
    pub(super) fn factor(&self, cell: usize) -> f64 {
        self.factor.get(cell).copied().unwrap_or(1.0)
    }

    /// Returns the pore volumes of the cells over the stated ones, at the start of the interval and at its end.
    pub(super) fn parts(&self) -> [&[f64]; 2] {
        [&self.parts[0], &self.parts[1]]
    }

    /// Takes the porosities at the start of an interval, if they are known, and at its end. The permeability is that
    /// at a porosity between `least` and `most`; pores have at least the volume at `least`.
    pub(super) fn take(
        &mut self,
        before: Option<&[f64]>,
        porosity: &[f64],
        [least, most]: [f64; 2],
    ) {
        for (cell, reference) in self.reference.iter().enumerate() {
            if *reference <= 0.0 {
                continue;
            }
            let now = porosity[cell].clamp(least, 1.0);
            let last = before.map_or(now, |before| before[cell].clamp(least, 1.0));
            self.factor[cell] = kozeny_carman(now.min(most), 1.0) / kozeny_carman(*reference, 1.0);
            self.parts[0][cell] = last / reference;
            self.parts[1][cell] = now / reference;
        }
    }
}
