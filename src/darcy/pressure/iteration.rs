//! Linear solver: conjugate gradients with a multigrid cycle, starting from the last pressure.
//!
//! It stops when the largest imbalance of a cell is below the tolerance times the largest flow through an imposed
//! pressure, or the largest source.
//!
//! The multigrid cycle has single precision. Where conductances differ by more than it resolves, the flow through
//! the tight ground around a permeable layer is lost in the rounding of the flow inside of the layer. If the cycle
//! then does not converge, the diagonal in double precision takes its place: it needs more iterations, each much
//! cheaper.

use super::Pressure;
use crate::SeepageError;
use crate::multigrid::inflow;
use crate::reproducible::{dot, power_above};
use base::number::single;

/// Ratio of conductances above which the rounding of the multigrid cycle can prevent convergence.
pub(super) const CYCLE_CONTRAST: f64 = 1e5;
/// Maximum number of iterations with the diagonal, in those with the cycle.
const DIAGONAL_ITERATIONS: u32 = 40;

impl Pressure {
    /// Performs conjugate gradient iterations; returns their number and the relative residual.
    pub(super) fn iterate(&mut self) -> Result<(u32, f64), SeepageError> {
        if self.fresh {
            // Water without a drive is then exactly stationary.
            self.phi.fill(0.0);
            self.fresh = false;
        }
        let drive = self.size();
        let mut largest = self.first_residual();
        if !largest.is_finite() || !drive.is_finite() {
            return Err(SeepageError::NotFinite("the first residual"));
        }
        // If only rounding drives the flow, or nothing does, the residual is relative to the size of the terms that
        // cancel.
        let least = 1e-12 * drive.max(self.largest_term());
        let mut scale = drive.max(least);
        let mut iterations = 0;
        let mut last = None;
        let mut with_cycle = true;
        let mut allowed = self.settings.iterations;
        loop {
            if largest <= self.settings.tolerance * scale {
                // Next to open water the imbalance at uniform pressure is far larger than the final flow.
                let flowing = self.flowing().max(least);
                if flowing >= scale || largest <= self.settings.tolerance * flowing {
                    break;
                }
                scale = flowing;
            }
            self.interruption.check(&self.slab.communicator)?;
            if iterations >= allowed
                && with_cycle
                && contrast(&self.system.matrix.t) > CYCLE_CONTRAST
            {
                with_cycle = false;
                allowed = DIAGONAL_ITERATIONS.saturating_mul(self.settings.iterations);
                last = None;
                largest = self.first_residual();
            }
            if iterations >= allowed {
                return Err(SeepageError::NotConverged {
                    iterations,
                    residual: largest / scale,
                    tolerance: self.settings.tolerance,
                });
            }
            let rz = if with_cycle {
                self.next_direction(largest, last)
            } else {
                self.next_diagonal_direction(last)
            };
            largest = self.move_along_direction(rz)?;
            last = Some(rz);
            iterations += 1;
        }
        Ok((iterations, largest / scale.max(f64::MIN_POSITIVE)))
    }

    /// Finds the next direction of descent from the `largest` residual by a multigrid cycle. `last` is the product of
    /// residual and cycle of the previous iteration, if there was one; returns that of this one.
    fn next_direction(&mut self, largest: f64, last: Option<f64>) -> f64 {
        let here = (self.slab.layout, self.slab.part.clone());
        let here = (&here.0, &here.1);
        // The cycle uses single precision, so that the residual is scaled to near 1.
        let unit = 1.0 / power_above(largest);
        let residual = &self.system.residual;
        here.0
            .sweep(here.1, self.system.multigrid.right_side(), |start, out| {
                for (b, r) in out.iter_mut().zip(&residual[start..]) {
                    *b = single(r * unit);
                }
            });
        self.system.multigrid.cycle();
        let z = self.system.multigrid.solution();
        let rz = dot(here, &self.system.residual, z, &self.slab.communicator) / unit;
        let beta = last.map_or(0.0, |last| rz / last);
        here.0
            .sweep(here.1, &mut self.system.direction, |start, out| {
                let z = &z[start..start + out.len()];
                for (p, z) in out.iter_mut().zip(z) {
                    *p = f64::from(*z) / unit + beta * *p;
                }
            });
        self.slab.halo.fill(&mut self.system.direction);
        rz
    }

    /// Finds the next direction of descent from the residual over the diagonal; otherwise as [`Self::next_direction`].
    fn next_diagonal_direction(&mut self, last: Option<f64>) -> f64 {
        let here = (self.slab.layout, self.slab.part.clone());
        let here = (&here.0, &here.1);
        let (residual, diagonal) = (&self.system.residual, &self.system.matrix.diagonal);
        here.0
            .sweep(here.1, &mut self.system.product, |start, out| {
                let rows = residual[start..].iter().zip(&diagonal[start..]);
                for (z, (r, d)) in out.iter_mut().zip(rows) {
                    *z = r / d;
                }
            });
        let z = &self.system.product;
        let rz = dot(here, residual, z, &self.slab.communicator);
        let beta = last.map_or(0.0, |last| rz / last);
        here.0
            .sweep(here.1, &mut self.system.direction, |start, out| {
                for (p, z) in out.iter_mut().zip(&z[start..]) {
                    *p = z + beta * *p;
                }
            });
        self.slab.halo.fill(&mut self.system.direction);
        rz
    }

    /// Moves the solution along the direction to the smallest error; `rz` is the product of residual and cycle.
    /// Returns the largest residual.
    fn move_along_direction(&mut self, rz: f64) -> Result<f64, SeepageError> {
        let here = (self.slab.layout, self.slab.part.clone());
        let here = (&here.0, &here.1);
        let (layout, matrix, p) = (
            &self.slab.layout,
            &self.system.matrix,
            &self.system.direction,
        );
        layout.sweep(here.1, &mut self.system.product, |start, out| {
            let n = out.len();
            let (leak, row) = (&matrix.leak[start..start + n], &p[start..start + n]);
            inflow(matrix, layout, p, start, n, |i, sum| {
                out[i] = leak[i] * row[i] - sum;
            });
        });
        let mut product = std::mem::take(&mut self.system.product);
        self.add_tensor(&self.system.direction, &mut product, -1.0);
        self.system.product = product;
        let energy = dot(
            here,
            &self.system.direction,
            &self.system.product,
            &self.slab.communicator,
        );
        let alpha = rz / energy;
        if !alpha.is_finite() {
            return Err(SeepageError::NotFinite("the iteration"));
        }
        let mut most = 0.0_f64;
        let mut bad = 0.0_f64;
        for row in self.slab.layout.rows(here.1) {
            let (p, q) = (
                &self.system.direction[row.clone()],
                &self.system.product[row.clone()],
            );
            let (x, r) = (&mut self.phi[row.clone()], &mut self.system.residual[row]);
            for i in 0..x.len() {
                x[i] += alpha * p[i];
                r[i] -= alpha * q[i];
                let size = r[i].abs();
                most = if size > most { size } else { most };
                bad += size * 0.0;
            }
        }
        let largest = self.slab.communicator.all_reduce_max_f64(if bad.is_nan() {
            f64::INFINITY
        } else {
            most
        });
        if !largest.is_finite() {
            return Err(SeepageError::NotFinite("the iteration"));
        }
        Ok(largest)
    }

    /// Returns the largest flow through an imposed pressure, or the largest source, at the pressure of the last
    /// iteration. Collective.
    fn flowing(&self) -> f64 {
        let mut most = 0.0_f64;
        for face in &self.boundary {
            let along = self.slab.grid.cell(face.cell)[self.slab.part.axis];
            if self.slab.part.planes.contains(&along) {
                most = most.max(self.inflow(face).abs());
            }
        }
        for row in self.slab.layout.rows(&self.slab.part) {
            for at in row {
                if self.system.right[at].abs() > 0.0 && !self.is_ground(at) {
                    most = most.max(self.system.right[at].abs());
                }
            }
        }
        self.slab.communicator.all_reduce_max_f64(most)
    }

    /// Returns the largest right side, which drives the flow: the imbalance at the uniform midpoint of the imposed
    /// pressures. It is computed over the whole grid, so that no message is needed.
    fn size(&self) -> f64 {
        let rows = self.slab.layout.rows(&self.slab.layout.whole());
        rows.flatten()
            .fold(0.0, |most, at| self.system.right[at].abs().max(most))
    }

    /// Returns the largest term of the left sides at the start pressure.
    fn largest_term(&self) -> f64 {
        let rows = self.slab.layout.rows(&self.slab.layout.whole());
        rows.flatten().fold(0.0, |most, at| {
            (self.system.matrix.diagonal[at] * self.phi[at])
                .abs()
                .max(most)
        })
    }

    fn is_ground(&self, at: usize) -> bool {
        self.ground.binary_search_by_key(&at, |one| one.at).is_ok()
    }

    /// Computes `residual = right - A phi`, and returns its largest magnitude on any rank.
    fn first_residual(&mut self) -> f64 {
        self.slab.halo.fill(&mut self.phi);
        let (layout, matrix, phi, right) = (
            &self.slab.layout,
            &self.system.matrix,
            &self.phi,
            &self.system.right,
        );
        layout.sweep(&self.slab.part, &mut self.system.residual, |start, out| {
            let n = out.len();
            let (leak, row) = (&matrix.leak[start..start + n], &phi[start..start + n]);
            let right = &right[start..start + n];
            inflow(matrix, layout, phi, start, n, |i, sum| {
                out[i] = (right[i] - leak[i] * row[i]) + sum;
            });
        });
        let mut residual = std::mem::take(&mut self.system.residual);
        self.add_tensor(&self.phi, &mut residual, 1.0);
        self.system.residual = residual;
        let mut most = 0.0_f64;
        for row in self.slab.layout.rows(&self.slab.part) {
            for r in &self.system.residual[row] {
                most = if r.is_finite() {
                    most.max(r.abs())
                } else {
                    f64::INFINITY
                };
            }
        }
        self.slab.communicator.all_reduce_max_f64(most)
    }
}

/// Returns the ratio of the largest to the smallest conductance of faces, those of closed ones left out.
pub(super) fn contrast(faces: &[Vec<f64>; 3]) -> f64 {
    let range = |[low, high]: [f64; 2], t: &f64| [low.min(*t), high.max(*t)];
    let open = faces.iter().flatten().filter(|t| **t > 0.0);
    let [low, high] = open.fold([f64::INFINITY, 0.0], range);
    high / low
}
