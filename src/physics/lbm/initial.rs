//! Initial populations from a field of density deviation and velocity.
//!
//! g_i = g_i^eq(δρ, u) + g_i^neq with g_i^neq = -3 w_i ρ τ Σ_ab (c_a c_b - δ_ab/3) ∂_a u_b (first order of
//! Chapman-Enskog). Without the second part a decaying vortex starts with the wrong stress.

use super::lanes::Stored;
use super::populations::Populations;

/// Density deviation and velocity (lattice units) at a position in cells of the whole domain.
pub trait Field: Sync {
    /// State at a position; the first cell's centre is (½, ½, ½).
    fn at(&self, position: [f64; 3]) -> (f64, [f64; 3]);
}

impl<F: Fn([f64; 3]) -> (f64, [f64; 3]) + Sync> Field for F {
    fn at(&self, position: [f64; 3]) -> (f64, [f64; 3]) {
        self(position)
    }
}

/// Equilibrium deviation of one population.
#[must_use]
pub fn equilibrium(w: f64, c: [i8; 3], drho: f64, u: [f64; 3]) -> f64 {
    let rho = 1.0 + drho;
    let cu = f64::from(c[0]) * u[0] + f64::from(c[1]) * u[1] + f64::from(c[2]) * u[2];
    let uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    w * (drho + rho * (3.0 * cu + 4.5 * cu * cu - 1.5 * uu))
}

/// Fills every interior cell; `start` is the first cell of the slab, `half_force` is F/2 so that u includes it.
pub fn fill<S: Stored>(
    populations: &mut Populations<S>,
    start: [usize; 3],
    relaxation_time: f64,
    half_force: [f64; 3],
    field: &dyn Field,
) {
    let velocities = populations.velocities().clone();
    let [nx, ny, nz] = populations.cells();
    populations.set_home();
    let rows = (0..nz).flat_map(|z| (0..ny).map(move |y| (y, z)));
    for local in rows.flat_map(|(y, z)| (0..nx).map(move |x| [x, y, z])) {
        let cell = populations.cell(local.map(usize::cast_signed));
        #[expect(clippy::cast_precision_loss, reason = "cell counts are far below 2^53")]
        let position: [f64; 3] = std::array::from_fn(|a| (local[a] + start[a]) as f64 + 0.5);
        let (drho, u) = field.at(position);
        let mut gradient = [[0.0; 3]; 3];
        for (a, row) in gradient.iter_mut().enumerate().take(velocities.dimension) {
            let side = |shift: f64| {
                let mut p = position;
                p[a] += shift;
                field.at(p).1
            };
            let (high, low) = (side(0.5), side(-0.5));
            for b in 0..3 {
                row[b] = high[b] - low[b];
            }
        }
        let divergence = gradient[0][0] + gradient[1][1] + gradient[2][2];
        let uf: f64 = (0..3).map(|a| u[a] * half_force[a]).sum();
        for i in 0..velocities.q() {
            let (w, c) = (velocities.w[i], velocities.c[i]);
            let mut strain = -divergence / 3.0;
            for a in 0..3 {
                for b in 0..3 {
                    strain += f64::from(c[a]) * f64::from(c[b]) * gradient[a][b];
                }
            }
            let departure = -3.0 * w * (1.0 + drho) * relaxation_time * strain;
            // Half of the term that the collision adds for the force (Guo, Zheng and Shi 2002): water at rest then stays at rest.
            let along = |v: [f64; 3]| (0..3).map(|a| f64::from(c[a]) * v[a]).sum::<f64>();
            let cf = along(half_force);
            let half_source = w * (3.0 * (cf - uf) + 9.0 * along(u) * cf);
            let slot = populations.slot(cell, i);
            populations.numbers_mut()[slot] =
                S::from_f64(equilibrium(w, c, drho, u) + departure - half_source);
        }
    }
}
