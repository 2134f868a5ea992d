//! Water in partly saturated ground: the equation of L. A. Richards (Physics 1 (1931) 318) in its mixed form.
//!
//! ```text
//! dM/dt + div q = 0,     q = -(K/mu) k_r(psi) grad phi,     M = theta(psi) + S_s max(psi, 0),     psi = p/(rho g)
//! ```
//!
//! The unknown is the reduced pressure `phi` as in saturated ground ([`super`]); `theta` and `k_r` follow from the
//! pressure head by the model of the soil ([`crate::retention`]). `S_s` is the specific storage of the
//! saturated part.
//!
//! **Space.** Cell-centred finite volumes on the faces of the saturated system. The flux of a face is its
//! conductance at saturation times `k_f (phi_i - phi_j)`, with the mean `k_f` of [`crate::retention::mean`]. Each
//! flux increases with the pressure on one side and decreases with that on the other, stationary water remains
//! stationary, and the scheme is conservative.
//!
//! **Boundaries.** The flux of a face with a stated pressure head `psi_f` is `T k_f (phi_f - phi_c)` over the half
//! cell. A seepage face is in contact with air: either water leaves and its pressure is 0, or nothing crosses it and
//! its pressure is not above 0. In one cell this complementarity has the closed solution
//!
//! ```text
//! seepage face:   outflow = max[0, T k_f (phi_c - phi_f)]      at psi_f = 0
//! rain:           inflow  = min[rate, T k_f (phi_f - phi_c)]   at psi_f = 0
//! evaporation:    outflow = min{rate, max[0, T k_f (phi_c - phi_f)]}   at psi_f = -suction, the driest surface
//! ```
//!
//! so that no list of wet faces is needed. Rain that the soil cannot absorb runs off: ponded water has zero depth.
//!
//! **Solution.** Newton's method with the exact derivatives of the fluxes; Picard's iteration does not converge
//! where the permeability changes within a cell. The Jacobian is not symmetric: the stabilised biconjugate
//! gradients of H. A. van der Vorst (SIAM J. Sci. Stat. Comput. 13 (1992) 631) solve it. The preconditioner solves
//! the columns of cells along gravity exactly, in which water falls through unsaturated ground, and adds a
//! multigrid cycle for the remainder. The cycle takes the symmetric part of the Jacobian over `k_r` of each column
//! of the matrix: in Kirchhoff's potential the flux along a horizontal axis is symmetric and as strong as at
//! saturation. A step of Newton's method is halved until the norm of the imbalance falls. Where Newton's method
//! fails, the permeability is first replaced by `k_r^s` with a small `s`, and `s` is raised to 1 from solution to
//! solution; Gardner's soil with a power is Gardner's soil with a longer capillary length. Where that fails too, as in
//! coarse soils far above the water table, the relative permeability gets a floor that is lowered to 1e-10.
//!
//! The slope of the permeability of van Genuchten's soil with n below 2 is infinite at saturation. There ponded rain
//! keeps the ground at the edge of saturation, and no step of Newton's method in the pressure decreases the norm. The
//! step is then made in a variable of which the permeability is a smooth function, and the norm may rise for a few
//! steps.
//!
//! Cells follow the content of the linear step instead of its pressure where no fraction of a step decreases the norm
//! within a time step ([`following`]): saturated ground without storage that begins to drain in a short time step,
//! where the capacity is zero at saturation. A step that does not converge even so is shortened.
//!
//! **Parallel.** Every rank evaluates the fluxes of the whole grid and solves the linear system in its slab. All sums
//! are exact, so that the bits do not depend on ranks and threads.

mod following;
mod newton;
mod state;
mod transient;

use super::boundary::Boundary;
use super::{Condition, Medium, Pressure, SolutionReport};
use crate::retention::{Mean, Retention, RetentionLaw, Side, mean};
use crate::{SeepageError, multigrid};
use base::vector::{dot, norm};
use newton::Krylov;
pub(super) use transient::EXTRA_NUMBERS;
use transient::Transient;
pub use transient::{ConditionHistory, InitialWater, TransientSettings, WaterBalance};

/// Maximum number of Newton steps in a steady flow.
const STEPS: u32 = 40;
/// Maximum number of continuation steps from a permeability that does not decrease with the suction.
const ATTEMPTS: u32 = 60;
/// Exponent of the relative permeability after the first failure.
const FIRST_POWER: f64 = 0.125;
/// Factor by which the exponent is raised after a success.
const RAISE: f64 = 4.0;
/// Minimum ratio of two exponents, and of two floors.
const CLOSEST: f64 = 1.02;
/// First and last floor of the relative permeability after the continuation in the exponent has failed: the last one
/// changes flows by less than the tolerance of the solution.
const FIRST_FLOOR: f64 = 1e-2;
const LAST_FLOOR: f64 = 1e-10;
/// Pressure head at which water boils \[m\].
const BOILS: f64 = -10.0;
/// Pressure head of dry soil \[m\], at a suction of 1e6 kPa (D. G. Fredlund, A. Xing, Can. Geotech. J. 31 (1994) 521).
const DRY: f64 = -1.02e5;
/// Factor by which the floor falls after a success.
const LOWER: f64 = 0.1;

/// Unsaturated soil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Soil {
    /// Retention and relative permeability.
    pub retention: Retention,
}

/// Face between two cells: flux from the lower cell to the upper one \[m³/s\], its derivatives with respect to the
/// reduced pressure of the lower and minus that of the upper cell, and its conductance \[m³/(Pa s)\].
#[derive(Clone, Copy, Debug, Default)]
struct FaceFlux {
    flux: f64,
    lower: f64,
    upper: f64,
    conductance: f64,
}

/// State of a cell.
#[derive(Clone, Copy, Debug, Default)]
struct CellState {
    head: f64,
    log_permeability: f64,
    slope: f64,
    potential: Option<f64>,
    content: f64,
    capacity: f64,
}

impl CellState {
    fn side(self) -> Side {
        Side {
            head: self.head,
            log_permeability: self.log_permeability,
            slope: self.slope,
            potential: self.potential,
        }
    }
}

/// Cells on both sides of the faces normal to an axis.
struct FacePair<'a> {
    states: &'a [CellState],
    soil_of: &'a [u8],
    phi: &'a [f64],
    /// Conductances of the faces at saturation.
    saturated: &'a [f64],
    /// Weight of the water \[N/m3\].
    weight: f64,
    /// Distance of the positions of two neighbours.
    stride: usize,
}

impl FacePair<'_> {
    /// Returns the flux of the face below a position; the elevation rises by `rise` between the centres \[m\].
    #[inline(always)]
    fn flux(&self, at: usize, rise: f64) -> FaceFlux {
        let (below, t) = (at - self.stride, self.saturated[at]);
        if t > 0.0 {
            let (lower, upper) = (self.states[below], self.states[at]);
            let difference = self.phi[below] - self.phi[at];
            let k = if self.soil_of[below] == self.soil_of[at] {
                mean(lower.side(), upper.side(), rise)
            } else {
                upstream([lower, upper], difference)
            };
            face_flux(t, k, difference, self.weight)
        } else {
            FaceFlux::default()
        }
    }
}

/// State of partly saturated ground.
pub(super) struct Unsaturated {
    /// Retentions of the soils, then the soil index of each cell.
    soils: Vec<Retention>,
    soil_of: Vec<u8>,
    /// Weight of the water \[N/m3\].
    weight: f64,
    /// Rise of the elevation from a cell to the next along each axis \[m\]; none along a graded axis.
    rise: [Option<f64>; 3],
    /// Elevation of the centre of each cell \[m\].
    elevation: Vec<f64>,
    /// Conductances of the faces at saturation.
    saturated: [Vec<f64>; 3],
    /// Source of water in each cell \[m³/s\].
    source: Vec<f64>,
    /// Exponent of the relative permeability: 1 except in a continuation.
    power: f64,
    /// Floor of the relative permeability: 0 except in a continuation, and in coarse soils at its end.
    floor: f64,
    states: Vec<CellState>,
    faces: [Vec<FaceFlux>; 3],
    /// Derivatives of the boundary inflow and of the storage with respect to minus the reduced pressure.
    diagonal: Vec<f64>,
    krylov: Krylov,
    /// Axis closest to gravity.
    axis: usize,
    /// Reciprocal relative permeability of each cell, which scales the unknowns of the cycle.
    scale: Vec<f64>,
    /// Factor of the matrix of the cycle.
    matrix_scale: f64,
    /// Reduced pressures of the last solution of a continuation or of a Newton step.
    kept: Vec<f64>,
    start: Vec<f64>,
    /// State of a transient flow; none if the flow is steady.
    transient: Option<Box<Transient>>,
}

impl Unsaturated {
    /// Returns the soil of a position of the layout.
    fn law(&self, at: usize) -> &dyn RetentionLaw {
        self.soils[usize::from(self.soil_of[at])].model()
    }

    /// Returns the state of a soil at a pressure head \[m\], with the exponent and the floor of a continuation.
    fn state(&self, soil: usize, head: f64) -> CellState {
        conditioned(self.soils[soil].model(), head, self.power, self.floor)
    }

    /// Returns `true` if the permeability of a soil has an infinite slope at saturation.
    fn steep(&self) -> bool {
        (self.soils.iter()).any(|soil| soil.model().saturation_exponent() < 1.0)
    }

    /// Returns the shortest capillary length of the soils \[m\].
    fn capillary_length(&self) -> f64 {
        let lengths = self
            .soils
            .iter()
            .map(|soil| soil.model().capillary_length());
        lengths.fold(f64::INFINITY, f64::min)
    }
}

impl Pressure {
    /// Adds an unsaturated soil: afterwards [`Pressure::solve`] finds steady flow in saturated and unsaturated
    /// ground.
    #[must_use]
    pub fn with_soil(mut self, soil: Soil) -> Self {
        let (grid, layout) = (&self.slab.grid, self.slab.layout);
        let n = layout.len();
        let gravity = self.settings.gravity;
        let strength = norm(gravity);
        let up = gravity.map(|g| -g / strength);
        let mut elevation = vec![0.0; n];
        for cell in 0..grid.count() {
            let centre = grid.centre(grid.cell(cell));
            elevation[layout.position(grid.cell(cell))] = dot(up, centre);
        }
        log::info!("ground that is saturated in part: {soil:?}");
        self.unsaturated = Some(Box::new(Unsaturated {
            soils: vec![soil.retention],
            soil_of: vec![0; n],
            weight: self.liquid.density * strength,
            rise: std::array::from_fn(|a| {
                grid.graded[a].is_none().then(|| up[a] * grid.spacing[a])
            }),
            elevation,
            saturated: std::array::from_fn(|_| vec![0.0; n]),
            source: vec![0.0; n],
            power: 1.0,
            floor: 0.0,
            states: vec![CellState::default(); n],
            faces: std::array::from_fn(|_| vec![FaceFlux::default(); n]),
            diagonal: vec![0.0; n],
            krylov: Krylov::new(n),
            axis: (0..3).fold(0, |best, a| {
                if up[a].abs() > up[best].abs() {
                    a
                } else {
                    best
                }
            }),
            scale: vec![1.0; n],
            matrix_scale: 1.0,
            kept: vec![0.0; n],
            start: vec![0.0; n],
            transient: None,
        }));
        self
    }

    /// Adds soils of other cells: `layers` follow the soil of [`Self::with_soil`], and `soil_of` has the soil index of
    /// each cell, 0 for that of [`Self::with_soil`]. The permeability of a face between two soils is that of the
    /// upstream side, so that a fine soil above a coarse one retains its water.
    #[must_use]
    pub fn with_layers(mut self, layers: &[Retention], soil_of: &[u8]) -> Self {
        let (grid, layout) = (&self.slab.grid, self.slab.layout);
        if let Some(own) = &mut self.unsaturated {
            own.soils.extend(layers);
            for (cell, soil) in soil_of.iter().enumerate() {
                own.soil_of[layout.position(grid.cell(cell))] = *soil;
            }
        }
        self
    }

    /// Returns `true` if the ground may be unsaturated.
    #[must_use]
    pub fn drains(&self) -> bool {
        self.unsaturated.is_some()
    }

    /// Finds the flow in unsaturated ground: the steady one, or that at the end of an interval. Collective.
    pub(super) fn solve_unsaturated(
        &mut self,
        medium: Medium<'_>,
    ) -> Result<SolutionReport, SeepageError> {
        let Some(mut own) = self.unsaturated.take() else {
            return Ok(SolutionReport::default());
        };
        let solved = self.prepare(&mut own, medium);
        let solved = solved.and_then(|()| {
            if own.transient.is_some() {
                self.advance_steps(&mut own)
            } else {
                self.find_steady(&mut own)
            }
        });
        self.take_fluxes(&own);
        let solved = solved.and_then(|found| self.check_outflows(&own).map(|()| found));
        // From here on the boundary inflow is that of unsaturated ground.
        self.unsaturated = Some(own);
        let (iterations, residual) = solved?;
        Ok(self.report(iterations, residual))
    }

    /// Checks that no well takes so much that its water would boil, and no stated flux so much that the ground would be
    /// drier than dry soil.
    fn check_outflows(&self, own: &Unsaturated) -> Result<(), SeepageError> {
        for face in self.boundary.iter().filter(|face| face.rate < 0.0) {
            let head = own.states[face.at].head;
            let at = || self.slab.grid.centre(self.slab.grid.cell(face.cell));
            match self.patches[face.patch].condition {
                Condition::Discharge { .. } if head < BOILS => {
                    return Err(SeepageError::DryWell { at: at(), head });
                }
                Condition::Flux { .. } if head < DRY => {
                    return Err(SeepageError::DryGround { at: at(), head });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Stores conductivities and sources, and starts a new solution from stationary water at the highest head.
    fn prepare(&mut self, own: &mut Unsaturated, medium: Medium<'_>) -> Result<(), SeepageError> {
        let mut bad = self.take(medium);
        bad |= self.direct();
        if bad {
            return Err(SeepageError::NotFinite("the permeability"));
        }
        self.join_cells();
        for (saturated, t) in own.saturated.iter_mut().zip(&self.system.matrix.t) {
            saturated.copy_from_slice(t);
        }
        // The level of a transient flow remains that of its start.
        if own
            .transient
            .as_ref()
            .is_none_or(|transient| !transient.began())
        {
            self.centre();
        }
        for k in 0..self.boundary.len() {
            let face = self.boundary[k];
            let along = self.along(face.axis)[face.at];
            self.boundary[k].conductance =
                2.0 * along * face.area / self.slab.grid.spacing[face.axis];
        }
        self.system.right.fill(0.0);
        if let Some(source) = medium.source {
            self.add_source(source);
        }
        own.source.copy_from_slice(&self.system.right);
        if own.source.iter().any(|q| !q.is_finite()) || !self.level.is_finite() {
            return Err(SeepageError::NotFinite("the source or the boundary"));
        }
        if self.fresh {
            let highest = self.boundary.iter().filter_map(|face| self.imposed(face));
            let highest = highest.fold(f64::NEG_INFINITY, f64::max) - self.level;
            // Without an imposed pressure the state at the start follows.
            let highest = if highest.is_finite() { highest } else { 0.0 };
            self.phi.fill(0.0);
            for row in self.slab.layout.rows(&self.slab.layout.whole()) {
                self.phi[row].fill(highest);
            }
            self.fresh = false;
        }
        Ok(())
    }

    /// Applies Newton's method, with a continuation in the exponent of the permeability if it fails; returns
    /// iterations and residual.
    fn find_steady(&mut self, own: &mut Unsaturated) -> Result<(u32, f64), SeepageError> {
        own.kept.copy_from_slice(&self.phi);
        let first = self.phi.clone();
        (own.power, own.floor) = (1.0, 0.0);
        let (mut known, mut iterations) = (0.0, 0);
        for _ in 0..ATTEMPTS {
            let done = self.newton(own, STEPS)?;
            iterations += done.iterations;
            if done.converged {
                if own.power >= 1.0 {
                    return Ok((iterations, done.residual));
                }
                known = own.power;
                own.kept.copy_from_slice(&self.phi);
                own.power = (RAISE * known).min(1.0);
            } else {
                self.phi.copy_from_slice(&own.kept);
                own.power = if known > 0.0 {
                    (known * own.power).sqrt()
                } else {
                    FIRST_POWER * own.power
                };
                if known > 0.0 && own.power < CLOSEST * known {
                    break;
                }
            }
            log::debug!("relative permeability to the power {:.4}", own.power);
        }
        self.phi.copy_from_slice(&first);
        self.lower_floor(own, iterations)
    }

    /// Applies Newton's method with a floor of the relative permeability, which falls from solution to solution;
    /// returns iterations and residual.
    fn lower_floor(
        &mut self,
        own: &mut Unsaturated,
        mut iterations: u32,
    ) -> Result<(u32, f64), SeepageError> {
        own.kept.copy_from_slice(&self.phi);
        (own.power, own.floor) = (1.0, FIRST_FLOOR);
        let mut known = 1.0;
        for _ in 0..ATTEMPTS {
            let done = self.newton(own, STEPS)?;
            iterations += done.iterations;
            log::debug!(
                "floor {:e} of the relative permeability: {}",
                own.floor,
                done.converged
            );
            if done.converged {
                if own.floor <= LAST_FLOOR {
                    log::info!("the relative permeability has a floor of {LAST_FLOOR:e}");
                    return Ok((iterations, done.residual));
                }
                known = own.floor;
                own.kept.copy_from_slice(&self.phi);
                own.floor = (LOWER * known).max(LAST_FLOOR);
            } else {
                self.phi.copy_from_slice(&own.kept);
                own.floor = (known * own.floor).sqrt();
                if own.floor * CLOSEST > known {
                    break;
                }
            }
        }
        own.floor = 0.0;
        Err(SeepageError::Unsaturated {
            iterations,
            length: own.capillary_length(),
        })
    }

    /// Evaluates states, fluxes, imbalances and their derivatives at the present pressure, on the whole grid.
    fn evaluate(&mut self, own: &mut Unsaturated) {
        let (layout, whole) = (self.slab.layout, self.slab.layout.whole());
        let (weight, level, power, floor) = (own.weight, self.level, own.power, own.floor);
        let (phi, elevation) = (&self.phi, &own.elevation);
        let (soils, soil_of) = (&own.soils, &own.soil_of);
        layout.sweep(&whole, &mut own.states, |start, out| {
            for (i, state) in out.iter_mut().enumerate() {
                let head = (level + phi[start + i]) / weight - elevation[start + i];
                let law = soils[usize::from(soil_of[start + i])].model();
                *state = conditioned(law, head, power, floor);
            }
        });
        let states = &own.states;
        for axis in 0..3 {
            let (stride, rise) = (layout.stride[axis], own.rise[axis]);
            let pair = FacePair {
                states,
                soil_of,
                phi,
                saturated: &own.saturated[axis],
                weight,
                stride,
            };
            let faces = &mut own.faces[axis];
            match rise {
                Some(rise) => layout.sweep(&whole, faces, |start, out| {
                    for (i, face) in out.iter_mut().enumerate() {
                        *face = pair.flux(start + i, rise);
                    }
                }),
                None => layout.sweep(&whole, faces, |start, out| {
                    for (i, face) in out.iter_mut().enumerate() {
                        let at = start + i;
                        *face = pair.flux(at, elevation[at] - elevation[at - stride]);
                    }
                }),
            }
        }
        let faces = &own.faces;
        let source = &own.source;
        layout.sweep(&whole, &mut self.system.residual, |start, out| {
            for (i, residual) in out.iter_mut().enumerate() {
                let at = start + i;
                let net =
                    |axis: usize| faces[axis][at].flux - faces[axis][at + layout.stride[axis]].flux;
                *residual = ((net(0) + net(1)) + net(2)) + source[at];
            }
        });
        own.diagonal.fill(0.0);
        for k in 0..self.boundary.len() {
            let face = self.boundary[k];
            let (rate, response) = self.crossing(own, &face);
            self.boundary[k].rate = rate;
            self.boundary[k].response = response;
            self.system.residual[face.at] += rate;
            own.diagonal[face.at] += response;
        }
        if let Some(transient) = &mut own.transient {
            let balance = (&mut self.system.residual[..], &mut own.diagonal[..]);
            transient.store(&own.states, own.weight, balance);
        }
    }

    /// Returns the inflow through a boundary face \[m³/s\], and its derivative with respect to minus the reduced
    /// pressure of the cell.
    fn crossing(&self, own: &Unsaturated, face: &Boundary) -> (f64, f64) {
        let surface = face.lift;
        let held = |phi: f64| {
            let cell = own.states[face.at];
            let head = (phi - surface) / own.weight;
            let outside = own.state(usize::from(own.soil_of[face.at]), head);
            let k = mean(
                cell.side(),
                outside.side(),
                surface / own.weight - own.elevation[face.at],
            );
            let difference = phi - self.level - self.phi[face.at];
            let rate = face.conductance * k.permeability * difference;
            let by_head = k.derivatives[0] / own.weight * difference;
            (rate, face.conductance * (k.permeability - by_head))
        };
        match self.patches[face.patch].condition {
            Condition::NoFlow {} => (0.0, 0.0),
            Condition::Flux { value } => (value * face.area, 0.0),
            Condition::Discharge { value } => (value * face.share, 0.0),
            Condition::Evaporation { rate, suction } => {
                let most = rate * face.area * face.up;
                let (drawn, response) = held(surface - own.weight * suction);
                if -drawn > most {
                    (-most, 0.0)
                } else if drawn < 0.0 {
                    (drawn, response)
                } else {
                    (0.0, 0.0)
                }
            }
            Condition::Pressure { .. } | Condition::Head { .. } => {
                self.imposed(face).map_or((0.0, 0.0), held)
            }
            Condition::SeepageFace { .. } => match self.imposed(face) {
                Some(phi) if phi > surface => held(phi),
                _ => {
                    let (rate, response) = held(surface);
                    if rate < 0.0 {
                        (rate, response)
                    } else {
                        (0.0, 0.0)
                    }
                }
            },
            Condition::Rain { rate } => {
                let rain = rate * face.area * face.up;
                let (taken, response) = held(surface);
                if rain > taken {
                    (taken, response)
                } else {
                    (rain, 0.0)
                }
            }
        }
    }

    /// Stores the conductances of the faces, from which fluxes, sections and probes are computed.
    fn take_fluxes(&mut self, own: &Unsaturated) {
        let (layout, whole) = (self.slab.layout, self.slab.layout.whole());
        for (t, faces) in self.system.matrix.t.iter_mut().zip(&own.faces) {
            layout.sweep(&whole, t, |start, out| {
                for (t, face) in out.iter_mut().zip(&faces[start..]) {
                    *t = face.conductance;
                }
            });
        }
    }

    /// Sets the matrix of the preconditioner: the symmetric part of the derivatives.
    fn set_symmetric(&mut self, own: &mut Unsaturated) {
        let (layout, whole) = (self.slab.layout, self.slab.layout.whole());
        let states = &own.states;
        layout.sweep(&whole, &mut own.scale, |start, out| {
            for (i, scale) in out.iter_mut().enumerate() {
                *scale = (-states[start + i].log_permeability).exp();
            }
        });
        // The cycle also corrects cells without ground, whose pressure would drift to infinity.
        let grid = &self.slab.grid;
        for (cell, _) in (self.conduction.conducts.iter().enumerate()).filter(|(_, is)| !**is) {
            own.scale[layout.position(grid.cell(cell))] = 0.0;
        }
        let scale = &own.scale;
        for (axis, (t, faces)) in self.system.matrix.t.iter_mut().zip(&own.faces).enumerate() {
            let stride = layout.stride[axis];
            layout.sweep(&whole, t, |start, out| {
                for (i, t) in out.iter_mut().enumerate() {
                    let at = start + i;
                    let face = faces[at];
                    let middle = 0.5 * (face.lower * scale[at - stride] + face.upper * scale[at]);
                    *t = if middle > 0.0 {
                        middle
                    } else {
                        face.conductance
                    };
                }
            });
        }
        self.ground.clear();
        for face in &self.boundary {
            if face.response > 0.0 {
                let response = face.response * own.scale[face.at];
                self.ground.push(face.ground(response));
            }
        }
        if let Some(transient) = own
            .transient
            .as_ref()
            .filter(|transient| transient.advances())
        {
            for row in layout.rows(&whole) {
                for at in row {
                    let stored = transient.capacity[at] * own.scale[at];
                    if stored > 0.0 {
                        self.ground.push(multigrid::Ground {
                            at,
                            axis: multigrid::STORED,
                            conductance: stored,
                        });
                    }
                }
            }
        }
        self.sum_faces();
        let diagonal = &self.system.matrix.diagonal;
        let largest = diagonal.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let scale = 1.0 / crate::power_above(largest);
        own.matrix_scale = scale;
        let ground: &[multigrid::Ground] = &self.ground;
        self.system
            .multigrid
            .set(&self.system.matrix, ground, scale);
    }
}

/// Returns the state of a soil at a pressure head \[m\] with the relative permeability `f + (1 - f) k^s` for the
/// exponent `s` and the floor `f`.
fn conditioned(law: &dyn RetentionLaw, head: f64, power: f64, floor: f64) -> CellState {
    let found = law.state(head);
    let mut state = CellState {
        head,
        log_permeability: power * found.log_permeability,
        slope: power * found.slope,
        potential: law.potential(head, power),
        content: found.content,
        capacity: found.capacity,
    };
    if floor > 0.0 {
        let part = (1.0 - floor) * state.log_permeability.exp();
        state.log_permeability = (floor + part).ln();
        state.slope *= part / (floor + part);
        state.potential = (state.potential).map(|known| (1.0 - floor) * known + floor * head);
    }
    state
}

/// Returns the permeability of a face between two soils: that of the upstream side.
fn upstream([lower, upper]: [CellState; 2], difference: f64) -> Mean {
    let side = usize::from(difference < 0.0);
    let from = [lower, upper][side];
    let permeability = from.log_permeability.exp();
    let mut derivatives = [0.0; 2];
    derivatives[side] = permeability * from.slope;
    Mean {
        permeability,
        derivatives,
    }
}

/// Returns the flux of a face for a difference of the reduced pressure.
fn face_flux(saturated: f64, mean: Mean, difference: f64, weight: f64) -> FaceFlux {
    let conductance = saturated * mean.permeability;
    let by = |side: usize| saturated * (mean.derivatives[side] / weight) * difference;
    FaceFlux {
        flux: conductance * difference,
        lower: conductance + by(0),
        upper: conductance - by(1),
        conductance,
    }
}

#[cfg(test)]
mod tests;
