//! Smagorinsky (1963): ν_t = (C_s Δ)² √(2 S:S), S the rate of strain and Δ one cell.
//!
//! Not zero in laminar shear, nor at walls; WALE ([`super::wale`]) is.

use super::Eddies;
use crate::lbm::lanes::Lanes;

/// The model with its constant.
#[derive(Clone, Copy, Debug)]
pub struct Smagorinsky {
    /// C_s; 0.1 in channels to 0.18 in free turbulence.
    pub constant: f64,
}

impl Eddies for Smagorinsky {
    const ACTIVE: bool = true;

    #[inline(always)]
    fn fraction<N: Lanes>(&self, g: &[[N; 3]; 3]) -> (N, N) {
        let strain = super::wale::strain_squared(g);
        let root = (strain * N::splat(2.0)).sqrt();
        (
            root * N::splat(self.constant * self.constant),
            N::splat(1.0),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_pure_shear_it_is_the_rate_of_shear() {
        let mut g = [[0.0; 3]; 3];
        g[0][1] = 0.02;
        let nu = Smagorinsky { constant: 0.17 }.viscosity(&g);
        approx::assert_relative_eq!(nu, 0.17 * 0.17 * 0.02, max_relative = 1e-14);
    }
}
