//! Newton's method for the unsaturated flow, and the linear solver of its steps.

use super::Unsaturated;
use crate::SeepageError;
use crate::pressure::Pressure;
use crate::pressure::iteration::{CYCLE_CONTRAST, contrast};
use crate::reproducible::{dot, power_above};
use crate::retention::{NEARLY_SATURATED, RetentionLaw};
use base::number::single;

/// Maximum number of halvings of a step.
const HALVINGS: u32 = 12;
/// Fraction of the first-order decrease of the norm that a step must reach (L. Armijo, Pac. J. Math. 16 (1966) 1).
const DECREASE: f64 = 1e-4;
/// Number of norms of which a step must stay below the largest, where the permeability has an infinite slope at
/// saturation (L. Grippo, F. Lampariello and S. Lucidi, SIAM J. Numer. Anal. 23 (1986) 707): a step that crosses the
/// edge of saturation increases the norm, and the next one, with the derivatives of the other side, decreases it.
const MEMORY: usize = 4;
/// Number of halvings after which a whole step is made, where the permeability has an infinite slope.
const FEW_HALVINGS: u32 = 4;
/// Number of whole Newton steps of a stage that are made where no fraction of a step decreases the norm.
const FREE_STEPS: u32 = 6;
/// Largest increase of the norm by such a step, unless the imbalance remains small relative to the largest flow.
const HIGHEST_RISE: f64 = 10.0;
const SMALL_IMBALANCE: f64 = 1e-3;
/// Maximum number of steps that follow the content of each cell, after the Newton steps of a stage.
const FOLLOWING_STEPS: u32 = 40;
/// Ratio of the heads after such steps to those before them that is no solution: in the rounding of such heads all
/// flow would be balanced.
const FARTHEST: f64 = 1e6;
/// Ratio of the norms after and before such a step above which the norm no longer falls.
const STILL: f64 = 0.5;
/// Ratio of an imbalance to the largest storage rate of a cell that changes no content.
const NO_CONTENT: f64 = 1e-13;
/// Relative residual at which the linear solver stops.
const FORCING: f64 = 1e-5;
/// Fraction of the tolerance at which a time step ends, so that the stored water of the pressure agrees with the
/// fluxes.
const CLOSURE: f64 = 1e-3;
/// Ratio of imbalance to the largest term of a cell that is rounding.
const ROUNDING: f64 = 1e-15;

/// Maximum ratio of the suction after a step to that before it, which is at least a capillary length. A cell that is
/// too dry conducts nothing, so that the norm of the imbalances does not show by how much.
pub(super) const DRIER: f64 = 10.0;

/// Pressure head at the edge of saturation, as a fraction of the capillary length: well above the rounding of a
/// pressure, and the water released by it well below that of a step.
const EDGE: f64 = -1e-11;
/// Minimum ratio of the capacity at the edge of saturation to the content over the capillary length that is a jump.
const JUMP: f64 = 1e-3;

/// Returns the pressure head at the edge of saturation \[m\] of a soil whose capacity has a jump there.
fn edge_of_saturation(soil: &dyn RetentionLaw) -> Option<f64> {
    let length = soil.capillary_length();
    let edge = EDGE * length;
    let state = soil.state(edge);
    (state.capacity * length > JUMP * state.content).then_some(edge)
}

/// Limits of the change of the pressure head of a soil in a Newton step.
struct StepLimits {
    /// Capillary length \[m\].
    length: f64,
    /// Exponent of the permeability near saturation.
    exponent: f64,
    /// Pressure head at the edge of saturation \[m\]; none if the capacity has no jump there.
    edge: Option<f64>,
}

impl StepLimits {
    fn new(soil: &dyn RetentionLaw, stores: bool) -> Self {
        let exponent = soil.saturation_exponent();
        Self {
            length: soil.capillary_length(),
            exponent,
            edge: if exponent < 1.0 {
                Some(EDGE * soil.capillary_length())
            } else {
                edge_of_saturation(soil).filter(|_| stores)
            },
        }
    }

    /// Returns the pressure head \[m\] after a step of Newton's method that changes it by `change`, for a permeability
    /// with an infinite slope at saturation. Newton's method does not converge there in the pressure head: its steps
    /// lead from a cell under a slight suction far beyond saturation, and from a saturated cell, whose permeability
    /// does not change, far into suction. The step is made in the variable w of the suction s in capillary lengths,
    ///
    /// ```text
    /// w = -s^q,  s < 1;     w = -1 - q (s - 1),  s > 1;     w = -s,  s < 0
    /// ```
    ///
    /// of which the permeability is a smooth function. A cell under suction reaches at most the edge of saturation.
    fn stepped(&self, head: f64, change: f64) -> f64 {
        let (q, steepest) = (self.exponent, NEARLY_SATURATED.powf(self.exponent - 1.0));
        let suction = -head / self.length;
        let (w, slope) = if suction <= 0.0 {
            (-suction, 1.0)
        } else if suction < NEARLY_SATURATED {
            (-suction * steepest, steepest)
        } else if suction < 1.0 {
            (-suction.powf(q), q * suction.powf(q - 1.0))
        } else {
            (-1.0 - q * (suction - 1.0), q)
        };
        let next = w + slope * change / self.length;
        let suction_next = if next >= 0.0 {
            if suction > 0.0 {
                -next.min(NEARLY_SATURATED)
            } else {
                -next
            }
        } else if next < -1.0 {
            1.0 + (-next - 1.0) / q
        } else {
            (-next / steepest)
                .min(NEARLY_SATURATED)
                .max((-next).powf(1.0 / q))
        };
        -suction_next * self.length
    }
}

/// Norms of the imbalances of the last Newton steps.
struct EarlierNorms {
    /// The norms, in a cycle; empty if every step must decrease the norm.
    norms: Vec<f64>,
    next: usize,
    /// Number of whole steps that may still be made although they increase the norm.
    free: u32,
}

impl EarlierNorms {
    fn new(own: &Unsaturated) -> Self {
        let (count, free) = if own.steep() {
            (MEMORY, FREE_STEPS)
        } else {
            (0, 0)
        };
        Self {
            norms: vec![0.0; count],
            next: 0,
            free,
        }
    }

    /// Returns `true` if a whole step may be made although it increases the norm.
    fn may_rise(&mut self) -> bool {
        if self.free == 0 {
            return false;
        }
        self.free -= 1;
        true
    }

    /// Forgets the norms before a step that increased the norm.
    fn forget(&mut self) {
        self.norms.fill(0.0);
    }

    /// Adds a norm and returns the largest one.
    fn largest_with(&mut self, norm: f64) -> f64 {
        if self.norms.is_empty() {
            return norm;
        }
        self.norms[self.next] = norm;
        self.next = (self.next + 1) % self.norms.len();
        self.norms.iter().copied().fold(norm, f64::max)
    }
}

/// Vectors of the linear solver.
pub(super) struct Krylov {
    /// Change of the reduced pressure.
    pub(super) change: Vec<f64>,
    residual: Vec<f64>,
    shadow: Vec<f64>,
    direction: Vec<f64>,
    /// Preconditioned direction, and its product with the matrix.
    ready: Vec<f64>,
    product: Vec<f64>,
    /// Preconditioned direction of the second half of a step, and its product with the matrix.
    second: Vec<f64>,
    second_product: Vec<f64>,
    /// Reciprocal pivots of the columns along gravity, and the residual after the columns.
    pivot: Vec<f64>,
    column_residual: Vec<f64>,
}

impl Krylov {
    pub(super) fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Self {
            change: zeros(),
            residual: zeros(),
            shadow: zeros(),
            direction: zeros(),
            ready: zeros(),
            product: zeros(),
            second: zeros(),
            second_product: zeros(),
            pivot: zeros(),
            column_residual: zeros(),
        }
    }
}

/// Outcome of Newton's method.
pub(super) struct Outcome {
    pub(super) converged: bool,
    /// Number of iterations of the linear solver.
    pub(super) iterations: u32,
    /// Largest imbalance of a cell over the largest flow.
    pub(super) residual: f64,
}

impl Pressure {
    /// Applies Newton's method from the present pressure, with at most this number of steps. Within a time step,
    /// steps that follow the content of each cell continue where fractions of Newton steps do not converge.
    /// Collective.
    pub(super) fn newton(
        &mut self,
        own: &mut Unsaturated,
        steps: u32,
    ) -> Result<Outcome, SeepageError> {
        let mut iterations = 0;
        self.evaluate(own);
        let mut norm = self.norm();
        let mut earlier = EarlierNorms::new(own);
        let stores = (own.transient.as_ref()).is_some_and(|transient| transient.advances());
        let most = steps + if stores { FOLLOWING_STEPS } else { 0 };
        let (mut follows, mut before, mut farthest) = (false, f64::INFINITY, f64::INFINITY);
        for step in 0..=most {
            let (residual, converged) = self.imbalance(own);
            let still = follows && norm > STILL * before && self.is_rounding(own, residual);
            let lost = farthest.is_finite() && self.reach(own) > farthest || !norm.is_finite();
            if converged || still || lost || step == most {
                return Ok(Outcome {
                    converged: (converged || still) && !lost,
                    iterations,
                    residual,
                });
            }
            if follows || step >= steps {
                if farthest.is_infinite() {
                    farthest = FARTHEST * self.reach(own);
                }
                follows = true;
                self.soften(own);
                iterations += self.find_change(own, true)?;
                self.follow_content(own);
                self.evaluate(own);
                before = norm;
                norm = self.norm();
                continue;
            }
            iterations += self.find_change(own, false)?;
            if let Some(next) = self.search(own, (norm, residual), &mut earlier) {
                norm = next;
            } else if stores {
                follows = true;
                self.phi.copy_from_slice(&own.start);
                self.evaluate(own);
            } else {
                break;
            }
        }
        Ok(Outcome {
            converged: false,
            iterations,
            residual: f64::NAN,
        })
    }

    /// Finds the change of the pressure in a Newton step; returns the number of iterations. If `thorough`, the columns
    /// alone are the preconditioner where the iteration does not converge with the multigrid cycle. Collective.
    fn find_change(&mut self, own: &mut Unsaturated, thorough: bool) -> Result<u32, SeepageError> {
        self.set_symmetric(own);
        let iterations = self.solve_linear(own, thorough)?;
        if let Some(gather) = &mut self.slab.gather {
            gather.fill(&mut own.krylov.change);
        }
        own.start.copy_from_slice(&self.phi);
        Ok(iterations)
    }

    /// Makes the largest fraction of a Newton step that decreases the norm of the imbalances enough; returns the norm
    /// after it, or none. `residual` is the relative imbalance before it. Collective.
    fn search(
        &mut self,
        own: &mut Unsaturated,
        (norm, residual): (f64, f64),
        earlier: &mut EarlierNorms,
    ) -> Option<f64> {
        let mut length = 1.0;
        let reference = earlier.largest_with(norm);
        for halvings in 0..=HALVINGS {
            self.try_change(own, length);
            self.evaluate(own);
            let next = self.norm();
            if next <= (1.0 - DECREASE * length) * reference {
                return Some(next);
            }
            if halvings == FEW_HALVINGS && earlier.may_rise() {
                self.try_change(own, 1.0);
                self.evaluate(own);
                let next = self.norm();
                if next <= norm * HIGHEST_RISE.max(SMALL_IMBALANCE / residual) {
                    earlier.forget();
                    return Some(next);
                }
            }
            length *= 0.5;
        }
        None
    }

    /// Sets the pressure after a fraction of a Newton step.
    ///
    /// A saturated cell without storage does not know in advance how little suction releases water from a soil whose
    /// capacity has a jump at saturation, and the shorter the time step, the smaller that suction is. Such a cell
    /// changes only to the edge of saturation, where the next Newton step has its capacity.
    ///
    /// Soils whose permeability has an infinite slope at saturation change as [`StepLimits::stepped`] describes.
    ///
    /// The suction of a cell grows at most by the factor [`DRIER`], and a cell under suction gets at most a pressure
    /// head of a capillary length.
    fn try_change(&mut self, own: &Unsaturated, length: f64) {
        let stores = own
            .transient
            .as_ref()
            .is_some_and(|transient| transient.advances());
        let limits: Vec<StepLimits> = (own.soils.iter())
            .map(|soil| StepLimits::new(soil.model(), stores))
            .collect();
        let (start, change) = (&own.start, &own.krylov.change);
        for row in self.slab.layout.rows(&self.slab.layout.whole()) {
            for at in row {
                let soil = &limits[usize::from(own.soil_of[at])];
                let of_head = |head: f64| own.weight * (own.elevation[at] + head) - self.level;
                let head = (self.level + start[at]) / own.weight - own.elevation[at];
                let mut phi = if soil.exponent < 1.0 {
                    of_head(soil.stepped(head, length * change[at] / own.weight))
                } else {
                    start[at] + length * change[at]
                };
                phi = phi.max(of_head(DRIER * head.min(-soil.length)));
                if head < 0.0 {
                    phi = phi.min(of_head(soil.length));
                }
                if let Some(edge) = soil.edge {
                    let least = of_head(edge);
                    if start[at] > least && phi < least {
                        phi = least;
                    }
                }
                self.phi[at] = phi;
            }
        }
    }

    /// Returns the norm of the imbalances. Collective.
    fn norm(&self) -> f64 {
        let here = (&self.slab.layout, &self.slab.part);
        let residual = &self.system.residual;
        dot(here, residual, residual, &self.slab.communicator).sqrt()
    }

    /// Returns the largest imbalance divided by the largest flow through the boundary, and `true` if it is within
    /// the tolerance or is rounding.
    fn imbalance(&self, own: &Unsaturated) -> (f64, bool) {
        let (mut most, mut term) = (0.0_f64, 0.0_f64);
        let steepest = (own.steep()).then(|| NEARLY_SATURATED * own.capillary_length());
        for row in self.slab.layout.rows(&self.slab.layout.whole()) {
            for at in row {
                most = most.max(self.system.residual[at].abs());
                let pressure = self.level.abs() + self.phi[at].abs();
                // The storage depends on the pressure as the fluxes do.
                term = term.max(own.diagonal[at] * pressure);
                for (axis, faces) in own.faces.iter().enumerate() {
                    let upper = at + self.slab.layout.stride[axis];
                    let conductance = faces[at].conductance + faces[upper].conductance;
                    term = term.max(conductance * pressure);
                    // Rounding of a pressure changes the permeability on both sides of saturation.
                    if let Some(edge) = steepest
                        && own.states[at].head > -edge
                    {
                        let rise = self.slab.grid.spacing[axis];
                        term = term.max(conductance * pressure * (rise / edge));
                    }
                }
            }
        }
        let rates = self.boundary.iter().map(|face| face.rate.abs());
        let sources = own.source.iter().map(|q| q.abs());
        let stored = own
            .transient
            .as_ref()
            .map(|transient| transient.largest_net());
        let flow = rates.chain(sources).chain(stored).fold(0.0, f64::max);
        let scale = flow.max(1e-12 * term).max(f64::MIN_POSITIVE);
        let stores = own
            .transient
            .as_ref()
            .filter(|transient| transient.advances());
        let part = stores.map_or(1.0, |_| CLOSURE);
        let term = stores.map_or(term, |transient| term.max(transient.largest_term()));
        let enough = most <= part * self.settings.tolerance * scale || most <= ROUNDING * term;
        (most / scale, enough)
    }

    /// Returns `true` if the imbalances are rounding where steps no longer decrease them: within the tolerance of a
    /// steady flow, or of a content that is a rounding of the largest. The fluxes carry the rest to the next step.
    fn is_rounding(&self, own: &Unsaturated, residual: f64) -> bool {
        let term = (own.transient.as_ref()).map_or(0.0, |transient| transient.largest_term());
        let rows = self.slab.layout.rows(&self.slab.layout.whole());
        let most = rows.flatten().fold(0.0, |most: f64, at| {
            most.max(self.system.residual[at].abs())
        });
        residual <= self.settings.tolerance || most <= NO_CONTENT * term
    }

    /// Solves the linear system of a Newton step; returns the number of iterations. The line search judges the
    /// result. Collective.
    ///
    /// The columns alone are the preconditioner where the iteration does not converge with the multigrid cycle and
    /// conductances at saturation differ by more than its single precision resolves, or `thorough` is set.
    ///
    /// # Errors
    /// If a stop is requested.
    fn solve_linear(&mut self, own: &mut Unsaturated, thorough: bool) -> Result<u32, SeepageError> {
        let (iterations, converged) = self.iterate_linear(own, true)?;
        if converged || !thorough && contrast(&own.saturated) <= CYCLE_CONTRAST {
            return Ok(iterations);
        }
        let (more, _) = self.iterate_linear(own, false)?;
        Ok(iterations + more)
    }

    /// Performs iterations from zero, with or without the multigrid cycle in the preconditioner; returns their number,
    /// and `true` if they converged. Collective.
    fn iterate_linear(
        &mut self,
        own: &mut Unsaturated,
        with_cycle: bool,
    ) -> Result<(u32, bool), SeepageError> {
        let (layout, part) = (self.slab.layout, self.slab.part.clone());
        let here = (&layout, &part);
        let communicator = self.slab.communicator.clone();
        let dot = |a: &[f64], b: &[f64]| dot(here, a, b, &communicator);
        let mut own_vectors = std::mem::replace(&mut own.krylov, Krylov::new(0));
        let all = &mut own_vectors;
        all.residual.copy_from_slice(&self.system.residual);
        all.shadow.copy_from_slice(&self.system.residual);
        for vector in [&mut all.change, &mut all.direction, &mut all.product] {
            vector.fill(0.0);
        }
        self.factorise_columns(own, &mut all.pivot);
        let (mut rho, mut alpha, mut omega) = (1.0, 1.0, 1.0);
        let first = self.largest(&all.residual);
        let mut iterations = 0;
        let mut converged = false;
        let mut requested = Ok(());
        while iterations < self.settings.iterations {
            requested = self.interruption.check(&communicator);
            if requested.is_err() {
                break;
            }
            let rho_next = dot(&all.shadow, &all.residual);
            let beta = (rho_next / rho) * (alpha / omega);
            if !beta.is_finite() {
                break;
            }
            rho = rho_next;
            let (residual, product) = (&all.residual, &all.product);
            layout.sweep(&part, &mut all.direction, |start, out| {
                for (i, p) in out.iter_mut().enumerate() {
                    let at = start + i;
                    *p = residual[at] + beta * (*p - omega * product[at]);
                }
            });
            self.precondition(
                (own, with_cycle),
                &mut all.direction,
                (&all.pivot, &mut all.column_residual),
                &mut all.ready,
            );
            self.multiply(own, &all.ready, &mut all.product);
            alpha = rho / dot(&all.shadow, &all.product);
            if !alpha.is_finite() {
                break;
            }
            let product = &all.product;
            layout.sweep(&part, &mut all.residual, |start, out| {
                for (i, r) in out.iter_mut().enumerate() {
                    *r -= alpha * product[start + i];
                }
            });
            self.precondition(
                (own, with_cycle),
                &mut all.residual,
                (&all.pivot, &mut all.column_residual),
                &mut all.second,
            );
            self.multiply(own, &all.second, &mut all.second_product);
            let square = dot(&all.second_product, &all.second_product);
            omega = if square > 0.0 {
                dot(&all.second_product, &all.residual) / square
            } else {
                0.0
            };
            let (ready, second) = (&all.ready, &all.second);
            layout.sweep(&part, &mut all.change, |start, out| {
                for (i, x) in out.iter_mut().enumerate() {
                    *x += alpha * ready[start + i] + omega * second[start + i];
                }
            });
            let product = &all.second_product;
            layout.sweep(&part, &mut all.residual, |start, out| {
                for (i, r) in out.iter_mut().enumerate() {
                    *r -= omega * product[start + i];
                }
            });
            iterations += 1;
            let largest = self.largest(&all.residual);
            converged = largest <= FORCING * first;
            if largest.is_nan() || converged {
                break;
            }
        }
        own.krylov = own_vectors;
        requested.map(|()| (iterations, converged))
    }

    /// Returns the largest magnitude in a vector on any rank. Collective.
    fn largest(&self, vector: &[f64]) -> f64 {
        let rows = self.slab.layout.rows(&self.slab.part);
        let most = rows
            .flat_map(|row| &vector[row])
            .fold(0.0_f64, |most, x| most.max(x.abs()));
        self.slab.communicator.all_reduce_max_f64(most)
    }

    /// Factorises the columns of cells along gravity: reciprocal pivots of their tridiagonal systems.
    fn factorise_columns(&self, own: &Unsaturated, pivot: &mut [f64]) {
        let layout = self.slab.layout;
        let (axis, stride) = (own.axis, layout.stride[own.axis]);
        for plane in 0..layout.cells[axis] {
            for at in layout.plane(axis, plane) {
                let mut sum = own.diagonal[at];
                for (a, faces) in own.faces.iter().enumerate() {
                    sum += faces[at].upper + faces[at + layout.stride[a]].lower;
                }
                let below = own.faces[axis][at];
                let reduced = sum - below.lower * below.upper * pivot[at - stride];
                pivot[at] = if reduced > 0.0 { 1.0 / reduced } else { 0.0 };
            }
        }
    }

    /// Multiplies by an approximate inverse: the columns along gravity exactly, where water falls through
    /// unsaturated cells, then, if asked for, one multigrid cycle for the remainder; sets `out` including its halo.
    /// Collective.
    fn precondition(
        &mut self,
        (own, with_cycle): (&Unsaturated, bool),
        vector: &mut [f64],
        (pivot, column_residual): (&[f64], &mut [f64]),
        out: &mut [f64],
    ) {
        let (layout, part) = (self.slab.layout, self.slab.part.clone());
        if let Some(gather) = &mut self.slab.gather {
            gather.fill(vector);
        }
        let (axis, stride) = (own.axis, layout.stride[own.axis]);
        let faces = &own.faces[axis];
        for plane in 0..layout.cells[axis] {
            for at in layout.plane(axis, plane) {
                let below = at - stride;
                out[at] = vector[at] + faces[at].lower * (out[below] * pivot[below]);
            }
        }
        for plane in (0..layout.cells[axis]).rev() {
            for at in layout.plane(axis, plane) {
                let above = at + stride;
                out[at] = (out[at] + faces[above].upper * out[above]) * pivot[at];
            }
        }
        if !with_cycle {
            self.slab.halo.fill(out);
            return;
        }
        self.multiply(own, out, column_residual);
        layout.sweep(&part, column_residual, |start, column_residual| {
            for (column_residual, v) in column_residual.iter_mut().zip(&vector[start..]) {
                *column_residual = v - *column_residual;
            }
        });
        let largest = self.largest(column_residual);
        // The cycle uses single precision, so that the vector is scaled to near 1.
        let unit = 1.0 / power_above(largest.max(f64::MIN_POSITIVE));
        layout.sweep(&part, self.system.multigrid.right_side(), |start, out| {
            for (b, r) in out.iter_mut().zip(&column_residual[start..]) {
                *b = single(r * unit);
            }
        });
        self.system.multigrid.cycle();
        let found = self.system.multigrid.solution();
        // Vector and matrix of the cycle are scaled by powers of two.
        let back = own.matrix_scale / unit;
        layout.sweep(&part, out, |start, out| {
            for (i, (out, z)) in out.iter_mut().zip(&found[start..]).enumerate() {
                *out += back * f64::from(*z) * own.scale[start + i];
            }
        });
        self.slab.halo.fill(out);
    }

    /// Multiplies by the derivatives of the imbalances with respect to minus the reduced pressures, for the cells
    /// of the part.
    fn multiply(&self, own: &Unsaturated, x: &[f64], out: &mut [f64]) {
        let layout = self.slab.layout;
        let (faces, diagonal) = (&own.faces, &own.diagonal);
        layout.sweep(&self.slab.part, out, |start, out| {
            for (i, out) in out.iter_mut().enumerate() {
                let at = start + i;
                let net = |axis: usize| {
                    let stride = layout.stride[axis];
                    let (below, above) = (faces[axis][at], faces[axis][at + stride]);
                    (above.lower * x[at] - above.upper * x[at + stride])
                        - (below.lower * x[at - stride] - below.upper * x[at])
                };
                *out = ((net(0) + net(1)) + net(2)) + diagonal[at] * x[at];
            }
        });
    }
}
