//! Initial populations from a field of density deviation and velocity.
//!
//! g_i = g_i^eq(δρ, u) + g_i^neq with g_i^neq = -3 w_i ρ τ Σ_ab (c_a c_b - δ_ab/3) ∂_a u_b (first order of
//! Chapman-Enskog). Without the second part a decaying vortex starts with the wrong stress.

use super::lanes::Stored;
use super::lattice::Velocities;
use super::populations::Populations;
use base::vector::dot;

use base::thread_pool;

/// Maximum number of populations of a cell.
const MAX_POPULATIONS: usize = 27;

/// Density deviation and velocity (lattice units) at a position in cells of the whole domain.
pub trait Field: Sync {
    /// Returns the state at a position; the first cell's centre is (½, ½, ½).
    fn state_at(&self, position: [f64; 3]) -> (f64, [f64; 3]);
}

impl<F: Fn([f64; 3]) -> (f64, [f64; 3]) + Sync> Field for F {
    fn state_at(&self, position: [f64; 3]) -> (f64, [f64; 3]) {
        self(position)
    }
}

/// Returns the equilibrium deviation of one population.
#[inline(always)]
#[must_use]
pub fn equilibrium(w: f64, c: [i8; 3], drho: f64, u: [f64; 3]) -> f64 {
    let rho = 1.0 + drho;
    let cu = f64::from(c[0]) * u[0] + f64::from(c[1]) * u[1] + f64::from(c[2]) * u[2];
    let uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    w * (drho + rho * (3.0 * cu + 4.5 * cu * cu - 1.5 * uu))
}

/// Pointer to the populations of a slab while threads fill their planes.
struct Numbers<S>(*mut S);
// SAFETY: each thread writes to the cells of its own planes, whose positions differ from all others.
unsafe impl<S: Send> Sync for Numbers<S> {}

/// Fills every interior cell; `start` is the first cell of the slab, `half_force` is F/2, so that u includes it.
/// Each thread fills the planes of its passes, so that their memory is close to it.
pub fn fill<S: Stored>(
    populations: &mut Populations<S>,
    start: [usize; 3],
    relaxation_time: f64,
    half_force: [f64; 3],
    field: &dyn Field,
    threads: usize,
) {
    populations.set_home();
    let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
    let numbers = &numbers;
    let populations = &*populations;
    let (cells, order) = (populations.cells(), populations.order());
    let planes = cells[order[0]];
    let threads = threads.clamp(1, planes.max(1));
    let state = State {
        velocities: populations.velocities(),
        relaxation_time,
        half_force,
    };
    thread_pool::each(threads, |thread| {
        let mut last = None;
        for plane in planes * thread / threads..planes * (thread + 1) / threads {
            for row in 0..cells[order[1]] {
                for place in 0..cells[order[2]] {
                    let mut local = [0; 3];
                    for (axis, at) in order.into_iter().zip([plane, row, place]) {
                        local[axis] = at;
                    }
                    let cell = populations.cell(local.map(usize::cast_signed));
                    #[expect(
                        clippy::cast_precision_loss,
                        reason = "cell counts are far below 2^53"
                    )]
                    let position = std::array::from_fn(|a| (local[a] + start[a]) as f64 + 0.5);
                    let given = state.given(field, position);
                    // Most cells have the same state as the previous one.
                    let of_cell = match &last {
                        Some((before, of_cell)) if same(before, &given) => of_cell,
                        _ => {
                            let of_cell = state.populations(&given);
                            &last.insert((given, of_cell)).1
                        }
                    };
                    for (i, number) in of_cell.iter().enumerate().take(state.velocities.q()) {
                        let slot = populations.slot(cell, i);
                        // SAFETY: the position of a cell of the slab, which is within the memory and belongs to
                        // this thread.
                        unsafe { *numbers.0.add(slot) = S::from_f64(*number) };
                    }
                }
            }
        }
    });
}

/// State of a cell from which its populations follow.
struct Given {
    /// Density deviation.
    drho: f64,
    velocity: [f64; 3],
    /// Gradient ∂_a u_b of the velocity.
    gradient: [[f64; 3]; 3],
}

/// Returns `true` if two cells start with the same bits.
fn same(a: &Given, b: &Given) -> bool {
    let same = |a: &[f64; 3], b: &[f64; 3]| (0..3).all(|k| a[k].to_bits() == b[k].to_bits());
    let rows = a.gradient.iter().zip(&b.gradient);
    a.drho.to_bits() == b.drho.to_bits()
        && same(&a.velocity, &b.velocity)
        && rows.into_iter().all(|(a, b)| same(a, b))
}

/// Data for the initial populations of all cells in addition to the field.
struct State<'a> {
    velocities: &'a Velocities,
    relaxation_time: f64,
    half_force: [f64; 3],
}

impl State<'_> {
    fn given(&self, field: &dyn Field, position: [f64; 3]) -> Given {
        let (drho, velocity) = field.state_at(position);
        let mut gradient = [[0.0; 3]; 3];
        for (a, row) in gradient
            .iter_mut()
            .enumerate()
            .take(self.velocities.dimension)
        {
            let side = |shift: f64| {
                let mut p = position;
                p[a] += shift;
                field.state_at(p).1
            };
            let (high, low) = (side(0.5), side(-0.5));
            for b in 0..3 {
                row[b] = high[b] - low[b];
            }
        }
        Given {
            drho,
            velocity,
            gradient,
        }
    }

    fn populations(
        &self,
        &Given {
            drho,
            velocity: u,
            gradient,
        }: &Given,
    ) -> [f64; MAX_POPULATIONS] {
        let half_force = self.half_force;
        let divergence = gradient[0][0] + gradient[1][1] + gradient[2][2];
        let uf = dot(u, half_force);
        let mut all = [0.0; MAX_POPULATIONS];
        for (i, number) in all.iter_mut().enumerate().take(self.velocities.q()) {
            let (w, c) = (self.velocities.w[i], self.velocities.c[i]);
            let mut strain = -divergence / 3.0;
            for a in 0..3 {
                for b in 0..3 {
                    strain += f64::from(c[a]) * f64::from(c[b]) * gradient[a][b];
                }
            }
            let departure = -3.0 * w * (1.0 + drho) * self.relaxation_time * strain;
            // Half of the term that the collision adds for the force (Guo, Zheng and Shi 2002), so that water at
            // rest remains at rest.
            let along = |v: [f64; 3]| (0..3).map(|a| f64::from(c[a]) * v[a]).sum::<f64>();
            let cf = along(half_force);
            let half_source = w * (3.0 * (cf - uf) + 9.0 * along(u) * cf);
            *number = equilibrium(w, c, drho, u) + departure - half_source;
        }
        all
    }
}
