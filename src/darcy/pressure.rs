//! Pressure and flux of water in the pores: Darcy's law and the mass balance.
//!
//! ```text
//! div q = -d eps/dt,     q = -(K/mu) (grad p - rho g) = -(K/mu) grad phi,     phi = p - rho g·x
//! ```
//!
//! The unknown is the reduced pressure `phi`, so that stationary water remains exactly stationary. The
//! discretisation uses cell-centred finite volumes. The flux of a face is `t (phi_i - phi_j)` with the harmonic
//! mean of the two cells times its open area. The layers of a column are therefore in series exactly, and the flux
//! out of one cell is the flux into the next. The matrix is stored as its faces only. Conjugate gradients with one
//! multigrid cycle ([`super::multigrid`]) solve it, starting from the last solution.
//!
//! The volume of moving grains and water together is conserved. The flux through a cell is a linear function of the
//! gradient ([`Medium`]; `coupling::seepage` derives it):
//!
//! ```text
//! div j = 0,     j = c - k grad phi        c: carried by the grains, k: conductivity
//! ```
//!
//! `j` is equal in the half cells on both sides of a face, so that the flux carried through a face is that of its
//! two cells, weighted by their resistances. The water of a cell without grains has almost no resistance: it
//! follows the adjacent bed.
//!
//! In the published fissure model the balance is `div (K/(mu eps) grad p) = 0`, without gravity, and its velocity
//! is interstitial ([`Equations::Paper`]); signs are those of Darcy's law in both.
//!
//! Flux and gradient of a cell are the means of its two faces along each axis. `-sum V grad phi` is then exactly the
//! force of the imposed pressures; the closure of momentum relies on this.

mod answers;
mod boundary;
mod condition;
mod conduction;
mod interruption;
mod iteration;
pub mod section;
mod tensor;
mod twin;
pub mod unsaturated;

use super::SeepageError;
use super::enclosure::Openness;
use super::grid::SeepageGrid;
use super::layout::{Gather, Halo, Layout, Part};
use super::multigrid::{Ground, Matrix, Multigrid};
use super::reproducible::power_above;
pub use answers::{Heave, Prisms};
use boundary::{Boundary, boundary, head_pressure, slabs};
pub use condition::Condition;
use conduction::{Conduction, Directions};
use decomposition::{Communicator, Domain, ExactSum};
use interruption::Interruption;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tensor::Tensor;
use unsaturated::Unsaturated;

/// Form of the equations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Equations {
    /// Conductivity K/mu, gravity in the water, superficial velocity in the drag.
    #[default]
    Corrected,
    /// Equations as printed in the paper on ground fissures: conductivity K/(mu eps), no gravity in the water,
    /// interstitial velocity in the drag; signs follow Darcy's law.
    Paper,
}

/// Properties of the water.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Liquid {
    /// Density \[kg/m3\].
    pub density: f64,
    /// Dynamic viscosity \[Pa s\].
    pub viscosity: f64,
}

/// Part of a face of the grid, or drain in the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressurePatch {
    /// Axis of the normal.
    pub axis: usize,
    /// `true` for the upper end of the axis.
    pub upper: bool,
    /// First cell along each axis; without effect along the normal.
    pub from: [usize; 3],
    /// One past the last cell along each axis; without effect along the normal.
    pub to: [usize; 3],
    /// Condition on the patch.
    pub condition: Condition,
    /// `true` for a drain: its faces are those of [`crate::Openness::drain_faces`], in the order of the drains;
    /// axis, end and cells have no effect.
    pub inside: bool,
}

impl PressurePatch {
    /// Returns `true` if the patch covers the face of a cell.
    fn covers(&self, axis: usize, upper: bool, cell: [usize; 3]) -> bool {
        let covers = |a: usize| a == axis || (self.from[a]..self.to[a]).contains(&cell[a]);
        !self.inside && self.axis == axis && self.upper == upper && (0..3).all(covers)
    }
}

/// Number of values per cell in a saved run: reduced pressure, porosity, gradient of the reduced pressure, flux of
/// the water, resistance of open water.
pub const NUMBERS: usize = 9;

/// Returns the number of values in a saved run for a grid with this many cells; `transient` adds the stored water
/// of each cell.
#[must_use]
pub fn numbers(cells: usize, transient: bool) -> usize {
    let stored = if transient {
        cells + unsaturated::EXTRA_NUMBERS
    } else {
        0
    };
    NUMBERS * cells + stored
}

/// Equations and parameters of the pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressureSettings {
    /// Form of the equations.
    pub equations: Equations,
    /// Gravity \[m/s2\].
    pub gravity: [f64; 3],
    /// Maximum imbalance of a cell, relative to that at uniform pressure.
    pub tolerance: f64,
    /// Maximum number of iterations; more are an error.
    pub iterations: u32,
}

/// Coefficients of water and grains in all cells: in a cell they move together with `carried - conductivity grad
/// phi`.
#[derive(Clone, Copy, Debug)]
pub struct Medium<'a> {
    /// Ratio of flux to gradient of the reduced pressure [m²/(Pa s)], for each cell.
    pub conductivity: &'a [f64],
    /// Volume flux without a gradient \[m/s\], for each cell; none if all grains are stationary.
    pub carried: Option<&'a [[f64; 3]]>,
    /// Source of water per volume inside the walls \[1/s\], for each cell.
    pub source: Option<&'a [f64]>,
}

/// Cost and quality of a solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolutionReport {
    /// Number of iterations.
    pub iterations: u32,
    /// Largest imbalance of a cell, relative to that at uniform pressure.
    pub residual: f64,
    /// Inflow \[m³/s\].
    pub inflow: f64,
    /// Outflow \[m³/s\].
    pub outflow: f64,
}

/// Cells of a rank, and their exchange with other ranks.
struct Slab {
    grid: SeepageGrid,
    layout: Layout,
    part: Part,
    communicator: Communicator,
    halo: Halo,
    gather: Option<Gather>,
}

/// Linear system of a solution, and the vectors of conjugate gradients.
struct System {
    matrix: Matrix<f64>,
    multigrid: Multigrid,
    right: Vec<f64>,
    residual: Vec<f64>,
    direction: Vec<f64>,
    product: Vec<f64>,
}

/// Pressure field of a grid and its solver state.
pub struct Pressure {
    slab: Slab,
    conduction: Conduction,
    system: System,
    liquid: Liquid,
    settings: PressureSettings,
    patches: Vec<PressurePatch>,
    boundary: Vec<Boundary>,
    ground: Vec<Ground>,
    /// Reduced pressure above `level` \[Pa\]: small differences from a large level keep their digits.
    phi: Vec<f64>,
    /// Midpoint of the imposed reduced pressures \[Pa\].
    level: f64,
    /// `true` if no pressure has been computed or restored yet.
    fresh: bool,
    /// State of unsaturated ground; none if all ground is saturated.
    unsaturated: Option<Box<Unsaturated>>,
    /// Data of ground whose principal permeabilities are inclined to the axes; none otherwise.
    tensor: Option<Box<Tensor>>,
    interruption: Interruption,
}

impl Pressure {
    /// Returns the solver with zero pressure differences and zero conductivity. Collective.
    ///
    /// # Errors
    /// If connected cells have no face with imposed pressure ([`SeepageError::Pocket`]), or if no cell is open
    /// ([`SeepageError::NoOpenCell`]).
    pub fn new(
        openness: &Openness,
        patches: Vec<PressurePatch>,
        liquid: Liquid,
        settings: PressureSettings,
        communicator: &Communicator,
    ) -> Result<Self, SeepageError> {
        let all = Self::without_outlets(openness, patches, liquid, settings, communicator)?;
        all.check_outlets()?;
        Ok(all)
    }

    /// Returns a solver like [`Self::new`] whose water may be enclosed: its pressure follows from the water that is
    /// stored at the start of a transient flow.
    ///
    /// # Errors
    /// If the ranks disagree, or no cell is open.
    pub fn without_outlets(
        openness: &Openness,
        patches: Vec<PressurePatch>,
        liquid: Liquid,
        settings: PressureSettings,
        communicator: &Communicator,
    ) -> Result<Self, SeepageError> {
        let grid = openness.grid.clone();
        let layout = Layout::new(grid.cells);
        let message = |e: decomposition::Disagreement| SeepageError::Messages(e.to_string());
        let domain = Domain::new(communicator.clone(), slabs(&grid, communicator.size()))
            .map_err(|e| SeepageError::Messages(e.to_string()))?;
        let part = Part {
            axis: domain.axis().index(),
            planes: domain.range(),
        };
        let ranges: Vec<_> = (0..communicator.size())
            .map(|rank| domain.slabs().range(rank))
            .collect();
        let multigrid = Multigrid::new(
            &grid,
            part.clone(),
            Halo::new::<f32>(layout, &domain, 41).map_err(message)?,
            &ranges,
            communicator,
            42,
        )?;
        let gather = if communicator.size() > 1 {
            Some(Gather::new::<f64>(
                layout,
                part.axis,
                &ranges,
                communicator,
                43,
            )?)
        } else {
            None
        };
        let n = layout.len();
        let conduction = Conduction::new(openness, &layout);
        Ok(Self {
            boundary: boundary(openness, &layout, &patches, &liquid, &settings),
            slab: Slab {
                grid,
                layout,
                halo: Halo::new::<f64>(layout, &domain, 40).map_err(message)?,
                part,
                communicator: communicator.clone(),
                gather,
            },
            conduction,
            system: System {
                matrix: Matrix::new(&layout),
                multigrid,
                right: vec![0.0; n],
                residual: vec![0.0; n],
                direction: vec![0.0; n],
                product: vec![0.0; n],
            },
            liquid,
            settings,
            patches,
            ground: Vec::new(),
            phi: vec![0.0; n],
            level: 0.0,
            fresh: true,
            unsaturated: None,
            tensor: None,
            interruption: Interruption::default(),
        })
    }

    /// Checks that each set of connected cells has a face with an imposed pressure.
    fn check_outlets(&self) -> Result<(), SeepageError> {
        let mut held = vec![false; self.slab.layout.len()];
        for face in &self.boundary {
            held[face.at] |= self.patches[face.patch].condition.holds();
        }
        let mut seen = vec![false; self.slab.layout.len()];
        let mut stack = Vec::new();
        let mut open = false;
        for index in 0..self.slab.grid.count() {
            let first = self.slab.layout.position(self.slab.grid.cell(index));
            if !self.conduction.conducts[index] || seen[first] {
                continue;
            }
            open = true;
            let (mut cells, mut outlet) = (0, false);
            seen[first] = true;
            stack.push(first);
            while let Some(at) = stack.pop() {
                cells += 1;
                outlet |= held[at];
                for axis in 0..3 {
                    let step = self.slab.layout.stride[axis];
                    for (face, next) in [(at, at - step), (at + step, at + step)] {
                        if self.conduction.factor[axis][face] > 0.0 && !seen[next] {
                            seen[next] = true;
                            stack.push(next);
                        }
                    }
                }
            }
            if !outlet {
                return Err(SeepageError::Pocket {
                    cells,
                    at: self.slab.grid.centre(self.slab.grid.cell(index)),
                });
            }
        }
        if open {
            Ok(())
        } else {
            Err(SeepageError::NoOpenCell)
        }
    }

    /// Returns the grid.
    #[must_use]
    pub fn grid(&self) -> &SeepageGrid {
        &self.slab.grid
    }

    /// Returns the relative tolerance of a solution.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.settings.tolerance
    }

    /// Changes the condition of a patch; its kind must remain the same.
    pub fn set_condition(&mut self, patch: usize, condition: Condition) {
        self.patches[patch].condition = condition;
    }

    /// Returns the condition that is stated for a boundary face of a cell; none without one.
    #[must_use]
    pub fn condition(&self, cell: usize, axis: usize, upper: bool) -> Option<Condition> {
        let place = self.slab.grid.cell(cell);
        let last = place[axis] + 1 == self.slab.grid.cells[axis];
        let on_face = if upper { last } else { place[axis] == 0 };
        let holds = |p: &&PressurePatch| p.covers(axis, upper, place);
        let patch = self.patches.iter().rev().find(holds);
        patch.filter(|_| on_face).map(|p| p.condition)
    }

    /// Sets the ratios of the conductivity of every cell along each axis to that passed to [`Self::solve`]. Initially
    /// they are 1.
    pub fn set_directions(&mut self, ratios: &[[f64; 3]]) {
        let n = self.slab.layout.len();
        let directions = &mut self.conduction.directions;
        let directions =
            directions.get_or_insert_with(|| Box::new(Directions::new(ratios.len(), n)));
        directions.ratios.copy_from_slice(ratios);
    }

    /// Returns the ratios of the conductivity of a cell along each axis to the given one.
    #[must_use]
    pub fn direction(&self, cell: usize) -> [f64; 3] {
        let directions = self.conduction.directions.as_ref();
        directions.map_or([1.0; 3], |directions| directions.ratios[cell])
    }

    /// Returns the total conductivity along an axis, water plus grains, times the width of the narrowest cell over
    /// that of each cell: half a cell conducts twice this value times its area over the width of the narrowest cell.
    fn along(&self, axis: usize) -> &[f64] {
        let directions = self.conduction.directions.as_ref();
        directions.map_or(&self.conduction.conductivity, |directions| {
            &directions.conductivity[axis]
        })
    }

    /// Solves for the pressure in a medium, starting from the last pressure. If nothing is carried and there is no
    /// source the flow is quasi-steady. Collective.
    ///
    /// # Errors
    /// If the solution is not finite ([`SeepageError::NotFinite`]) or does not converge
    /// ([`SeepageError::NotConverged`]); the error is the same on every rank.
    pub fn solve(&mut self, medium: Medium<'_>) -> Result<SolutionReport, SeepageError> {
        if self.unsaturated.is_some() {
            return self.solve_unsaturated(medium);
        }
        self.assemble(medium)?;
        let (iterations, residual) = self.iterate()?;
        if let Some(gather) = &mut self.slab.gather {
            gather.fill(&mut self.phi);
        }
        self.take_tensor_flows();
        Ok(self.report(iterations, residual))
    }

    /// Returns the report of a solution with the flow through the boundary.
    fn report(&mut self, iterations: u32, residual: f64) -> SolutionReport {
        let (inflow, outflow) = self.fluxes();
        SolutionReport {
            iterations,
            residual,
            inflow,
            outflow,
        }
    }

    fn assemble(&mut self, medium: Medium<'_>) -> Result<(), SeepageError> {
        let mut bad = self.take(medium);
        bad |= self.direct();
        if bad {
            return Err(SeepageError::NotFinite("the permeability"));
        }
        self.join_cells();
        self.centre();
        self.impose();
        if let Some(source) = medium.source {
            self.add_source(source);
        }
        self.carry();
        self.assemble_tensor();
        self.sum_faces();
        let (mut largest, mut bad) = (0.0_f64, false);
        for row in self.slab.layout.rows(&self.slab.layout.whole()) {
            for i in row {
                largest = largest.max(self.system.matrix.diagonal[i]);
                bad |= !self.system.right[i].is_finite() || !self.phi[i].is_finite();
                // A blocked cell is not part of the system: a coarse correction there has no effect.
                if self.system.matrix.diagonal[i] <= 0.0 {
                    self.system.right[i] = 0.0;
                    self.phi[i] = 0.0;
                }
            }
        }
        if bad {
            return Err(SeepageError::NotFinite("the source or the boundary"));
        }
        self.system.multigrid.set(
            &self.system.matrix,
            &self.ground,
            1.0 / power_above(largest),
        );
        Ok(())
    }

    /// Stores the conductivities and the flux carried by grains; returns `true` if a value is not a number.
    fn take(&mut self, medium: Medium<'_>) -> bool {
        let nx = self.slab.grid.cells[0];
        let whole = self.slab.layout.whole();
        let mut bad = false;
        for (row, first) in self.slab.layout.rows(&whole).zip((0..).step_by(nx)) {
            for (at, cell) in row.zip(first..) {
                let k = if self.conduction.conducts[cell] {
                    medium.conductivity[cell]
                } else {
                    0.0
                };
                bad |= !(0.0..f64::MAX).contains(&k);
                self.conduction.conductivity[at] = k;
            }
        }
        self.conduction.carries = medium.carried.is_some();
        if let Some(carried) = medium.carried {
            for (row, first) in self.slab.layout.rows(&whole).zip((0..).step_by(nx)) {
                for (at, cell) in row.zip(first..) {
                    for (a, carried) in carried[cell].iter().enumerate() {
                        self.conduction.carried[a][at] = if self.conduction.conducts[cell] {
                            *carried
                        } else {
                            0.0
                        };
                        bad |= !carried.is_finite();
                    }
                }
            }
        }
        bad
    }

    /// Computes the matrix of the faces: the harmonic mean of the two cells times the open area.
    fn join_cells(&mut self) {
        let whole = self.slab.layout.whole();
        for axis in 0..3 {
            let stride = self.slab.layout.stride[axis];
            let k = match &self.conduction.directions {
                Some(directions) => &directions.conductivity[axis],
                None => &self.conduction.conductivity,
            };
            let factor = &self.conduction.factor[axis];
            self.slab
                .layout
                .sweep(&whole, &mut self.system.matrix.t[axis], |start, out| {
                    let n = out.len();
                    let lower = &k[start - stride..start - stride + n];
                    let upper = &k[start..start + n];
                    let factor = &factor[start..start + n];
                    for i in 0..n {
                        let product = factor[i] * lower[i] * upper[i];
                        out[i] = product / (lower[i] + upper[i] + f64::MIN_POSITIVE);
                    }
                });
        }
    }

    /// Shifts the unknowns to the level of the midpoint of the imposed pressures.
    fn centre(&mut self) {
        let level = self.middle();
        if level.total_cmp(&self.level).is_ne() {
            for row in self.slab.layout.rows(&self.slab.layout.whole()) {
                self.phi[row]
                    .iter_mut()
                    .for_each(|phi| *phi += self.level - level);
            }
            self.level = level;
        }
    }

    /// Adds the boundary conditions to the matrix and the right sides.
    fn impose(&mut self) {
        let level = self.level;
        self.ground.clear();
        self.system.right.fill(0.0);
        for face in &mut self.boundary {
            let k = match &self.conduction.directions {
                Some(directions) => directions.conductivity[face.axis][face.at],
                None => self.conduction.conductivity[face.at],
            };
            face.conductance = 2.0 * k * face.area / self.slab.grid.spacing[face.axis];
            match self.patches[face.patch].condition {
                Condition::Pressure { value: p } => {
                    self.ground.push(face.ground(face.conductance));
                    self.system.right[face.at] += face.conductance * (p + face.lift - level);
                }
                Condition::Head { value: h } => {
                    let phi = head_pressure(&self.liquid, &self.settings, h);
                    self.ground.push(face.ground(face.conductance));
                    self.system.right[face.at] += face.conductance * (phi - level);
                }
                Condition::Flux { value: q } => self.system.right[face.at] += q * face.area,
                Condition::Discharge { value: q } => self.system.right[face.at] += q * face.share,
                Condition::Rain { rate: q } => {
                    self.system.right[face.at] += q * face.area * face.up
                }
                Condition::SeepageFace { .. }
                | Condition::Evaporation { .. }
                | Condition::NoFlow {} => {}
            }
        }
    }

    /// Adds the sources of the cells to the right sides.
    fn add_source(&mut self, source: &[f64]) {
        let nx = self.slab.grid.cells[0];
        let grid = &self.slab.grid;
        // Of equal cells the volume is computed once.
        let equal = (!grid.is_graded()).then(|| grid.volume([0; 3]));
        let volume = |cell: usize| equal.unwrap_or_else(|| grid.volume(grid.cell(cell)));
        let rows = self.slab.layout.rows(&self.slab.layout.whole());
        for (row, first) in rows.zip((0..).step_by(nx)) {
            for (at, cell) in row.zip(first..) {
                if self.conduction.conducts[cell] {
                    self.system.right[at] += source[cell] * volume(cell);
                }
            }
        }
    }

    /// Sums the faces of each cell to the diagonal.
    fn sum_faces(&mut self) {
        let [sx, sy, sz] = self.slab.layout.stride;
        let t = &self.system.matrix.t;
        for row in self.slab.layout.rows(&self.slab.layout.whole()) {
            for i in row {
                self.system.matrix.diagonal[i] = ((t[0][i] + t[0][i + sx])
                    + (t[1][i] + t[1][i + sy]))
                    + (t[2][i] + t[2][i + sz]);
            }
        }
        self.system.matrix.leak.fill(0.0);
        for one in &self.ground {
            self.system.matrix.diagonal[one.at] += one.conductance;
            self.system.matrix.leak[one.at] += one.conductance;
        }
    }

    /// Computes the conductivities along each axis for anisotropic cells; returns `true` if a value is not a
    /// number.
    fn direct(&mut self) -> bool {
        let Some(directions) = &mut self.conduction.directions else {
            return false;
        };
        let mut bad = false;
        for (axis, along) in directions.conductivity.iter_mut().enumerate() {
            along.copy_from_slice(&self.conduction.conductivity);
            for (cell, ratios) in directions.ratios.iter().enumerate() {
                let at = self.slab.layout.position(self.slab.grid.cell(cell));
                along[at] *= ratios[axis];
                bad |= !(0.0..f64::MAX).contains(&along[at]);
            }
        }
        let grid = &self.slab.grid;
        for axis in (0..3).filter(|&axis| grid.graded[axis].is_some()) {
            let (along, widths) = (&mut directions.conductivity[axis], grid.axis(axis));
            for index in 0..grid.count() {
                let cell = grid.cell(index);
                along[self.slab.layout.position(cell)] *= widths.spacing / widths.width(cell[axis]);
            }
        }
        bad
    }

    /// Adds the displacement by the grains to the right sides.
    fn carry(&mut self) {
        if !self.conduction.carries {
            return;
        }
        for axis in 0..self.slab.grid.dimension {
            let stride = self.slab.layout.stride[axis];
            for row in self.slab.layout.rows(&self.slab.layout.whole()) {
                for at in row {
                    let through = self.area(axis, at) * self.face_velocity(axis, at);
                    self.system.right[at] += through;
                    self.system.right[at - stride] -= through;
                }
            }
        }
        for face in &self.boundary {
            if self.imposed(face).is_some() {
                let outward = if face.upper { 1.0 } else { -1.0 };
                self.system.right[face.at] -=
                    outward * face.area * self.conduction.carried[face.axis][face.at];
            }
        }
    }

    /// Returns the open area of the face below a cell \[m2\].
    fn area(&self, axis: usize, at: usize) -> f64 {
        0.5 * self.conduction.factor[axis][at] * self.slab.grid.spacing[axis]
    }

    /// Returns the flux carried through the face below a cell \[m/s\]: the mean of both cells, weighted by their
    /// resistances; 0 at a closed face.
    fn face_velocity(&self, axis: usize, at: usize) -> f64 {
        let below = at - self.slab.layout.stride[axis];
        let (k, v) = (self.along(axis), &self.conduction.carried[axis]);
        if self.conduction.factor[axis][at] > 0.0 {
            (v[below] * k[at] + v[at] * k[below]) / (k[below] + k[at] + f64::MIN_POSITIVE)
        } else {
            0.0
        }
    }

    /// Returns the midpoint of the imposed reduced pressures \[Pa\]; 0 without any.
    fn middle(&self) -> f64 {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for face in &self.boundary {
            if let Some(phi) = self.imposed(face) {
                least = least.min(phi);
                most = most.max(phi);
            }
        }
        if least <= most {
            0.5 * (least + most)
        } else {
            0.0
        }
    }

    /// Returns the reduced pressure imposed on a face \[Pa\]; none without one.
    fn imposed(&self, face: &Boundary) -> Option<f64> {
        match self.patches[face.patch].condition {
            Condition::Pressure { value: p } => Some(p + face.lift),
            Condition::Head { value: h } => Some(head_pressure(&self.liquid, &self.settings, h)),
            Condition::SeepageFace { level } => {
                let below = level.map(|h| head_pressure(&self.liquid, &self.settings, h));
                Some(below.map_or(face.lift, |phi| phi.max(face.lift)))
            }
            _ => None,
        }
    }

    /// Returns the flow through a boundary face, into the grid \[m3/s\].
    fn inflow(&self, face: &Boundary) -> f64 {
        if self.unsaturated.is_some() {
            return face.rate;
        }
        match self.patches[face.patch].condition {
            Condition::Flux { value: q } => q * face.area,
            Condition::Discharge { value: q } => q * face.share,
            Condition::Rain { rate: q } => q * face.area * face.up,
            Condition::SeepageFace { .. }
            | Condition::Evaporation { .. }
            | Condition::NoFlow {} => 0.0,
            Condition::Pressure { .. } | Condition::Head { .. } => {
                let inward = if face.upper { -1.0 } else { 1.0 };
                let carried = inward * face.area * self.conduction.carried[face.axis][face.at];
                self.imposed(face).map_or(0.0, |phi| {
                    face.conductance * (phi - self.level - self.phi[face.at]) + carried + face.extra
                })
            }
        }
    }

    /// Computes the flow driven by the gradient through each cell, from its faces; returns total inflow and
    /// outflow.
    fn fluxes(&mut self) -> (f64, f64) {
        let layout = self.slab.layout;
        let [_, sy, sz] = layout.stride;
        let nx = self.slab.grid.cells[0];
        let (t, w, phi) = (&self.system.matrix.t, &self.conduction.per_area, &self.phi);
        for (row, first) in layout.rows(&layout.whole()).zip((0..).step_by(nx)) {
            let mut west = 0.0;
            for (at, driven) in row.zip(&mut self.conduction.driven[first..first + nx]) {
                let face = |axis: usize, at: usize, stride: usize| {
                    (t[axis][at] * w[axis][at]) * (phi[at - stride] - phi[at])
                };
                let east = face(0, at + 1, 1);
                *driven = [
                    0.5 * (west + east),
                    0.5 * (face(1, at, sy) + face(1, at + sy, sy)),
                    0.5 * (face(2, at, sz) + face(2, at + sz, sz)),
                ];
                west = east;
            }
        }
        if self.conduction.carries {
            for (row, first) in layout.rows(&layout.whole()).zip((0..).step_by(nx)) {
                for (at, cell) in row.zip(first..) {
                    for axis in 0..self.slab.grid.dimension {
                        let faces = self.face_velocity(axis, at)
                            + self.face_velocity(axis, at + layout.stride[axis]);
                        self.conduction.driven[cell][axis] +=
                            0.5 * faces - self.conduction.carried[axis][at];
                    }
                }
            }
        }
        self.add_tensor_fluxes();
        let (mut inflow, mut outflow) = (ExactSum::new(), ExactSum::new());
        for k in 0..self.boundary.len() {
            let face = self.boundary[k];
            let rate = self.inflow(&face);
            if rate > 0.0 {
                inflow.add(rate);
            } else {
                outflow.add(-rate);
            }
            let along = if face.upper { -rate } else { rate };
            self.conduction.driven[face.cell][face.axis] += 0.5 * along / face.area;
        }
        (inflow.value(), outflow.value())
    }

    /// Returns the volume flux of water and grains through a cell \[m/s\].
    #[must_use]
    pub fn flux(&self, cell: usize) -> [f64; 3] {
        if self.conduction.carries {
            let at = self.slab.layout.position(self.slab.grid.cell(cell));
            std::array::from_fn(|a| {
                self.conduction.driven[cell][a] + self.conduction.carried[a][at]
            })
        } else {
            self.conduction.driven[cell]
        }
    }

    /// Returns the ratio of flux to gradient of the reduced pressure in a cell [m²/(Pa s)]; 0 outside the walls.
    #[must_use]
    pub fn conductivity(&self, cell: usize) -> f64 {
        self.conduction.conductivity[self.slab.layout.position(self.slab.grid.cell(cell))]
    }

    /// Returns the conductivity of a cell along each axis: water plus grains.
    fn conductivities(&self, cell: usize) -> [f64; 3] {
        let grid = &self.slab.grid;
        let place = grid.cell(cell);
        let at = self.slab.layout.position(place);
        std::array::from_fn(|a| {
            let along = self.along(a)[at];
            match &grid.graded[a] {
                None => along,
                Some(_) => along * (grid.width(a, place) / grid.spacing[a]),
            }
        })
    }

    /// Returns the gradient of the reduced pressure in a cell \[Pa/m\].
    #[must_use]
    pub fn reduced_gradient(&self, cell: usize) -> [f64; 3] {
        let conductivities = self.conductivities(cell);
        std::array::from_fn(|a| {
            let k = conductivities[a];
            if k > 0.0 {
                -self.conduction.driven[cell][a] / k
            } else {
                0.0
            }
        })
    }

    /// Returns the weight of the water rho g \[N/m³\]; 0 in the equations as printed.
    #[must_use]
    pub fn weight(&self) -> [f64; 3] {
        match self.settings.equations {
            Equations::Corrected => self.settings.gravity.map(|g| g * self.liquid.density),
            Equations::Paper => [0.0; 3],
        }
    }

    /// Returns the gradient of the pressure in a cell \[Pa/m\].
    #[must_use]
    pub fn gradient(&self, cell: usize) -> [f64; 3] {
        let (gradient, weight) = (self.reduced_gradient(cell), self.weight());
        std::array::from_fn(|a| gradient[a] + weight[a])
    }

    /// Returns `true` for a cell inside the walls that no drain and no surface of the ground has removed.
    #[must_use]
    pub fn conducts(&self, cell: usize) -> bool {
        self.conduction.conducts[cell]
    }

    /// Returns the reduced pressure of a cell \[Pa\]; 0 outside the walls.
    #[must_use]
    pub fn reduced(&self, cell: usize) -> f64 {
        if !self.conduction.conducts[cell] {
            return 0.0;
        }
        self.level + self.phi[self.slab.layout.position(self.slab.grid.cell(cell))]
    }

    /// Returns the values for [`Self::restore`]: the reduced pressure of every cell relative to the midpoint of the
    /// imposed ones \[Pa\].
    pub fn saved(&self) -> impl Iterator<Item = f64> {
        (0..self.slab.grid.count())
            .map(|index| self.phi[self.slab.layout.position(self.slab.grid.cell(index))])
    }

    /// Returns the largest difference of the reduced pressure between cells and imposed values \[Pa\].
    #[must_use]
    pub fn largest_difference(&self) -> f64 {
        let cells = (0..self.slab.grid.count()).filter(|cell| self.conduction.conducts[*cell]);
        let imposed = self.boundary.iter().filter_map(|face| self.imposed(face));
        let (low, high) = cells
            .map(|cell| self.reduced(cell))
            .chain(imposed)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        (high - low).max(0.0)
    }

    /// Returns the pressure in the centre of a cell \[Pa\]; 0 outside the walls.
    #[must_use]
    pub fn pressure(&self, cell: usize) -> f64 {
        if !self.conduction.conducts[cell] {
            return 0.0;
        }
        let (x, weight) = (
            self.slab.grid.centre(self.slab.grid.cell(cell)),
            self.weight(),
        );
        self.reduced(cell) + (weight[0] * x[0] + weight[1] * x[1] + weight[2] * x[2])
    }

    /// Restores the values of [`Self::saved`] as the start of the next iteration.
    ///
    /// # Errors
    /// If their number differs from the number of cells.
    pub fn restore(&mut self, saved: &[f64]) -> Result<(), SeepageError> {
        if saved.len() != self.slab.grid.count() {
            return Err(SeepageError::Messages(format!(
                "{} pressures for {} cells",
                saved.len(),
                self.slab.grid.count()
            )));
        }
        for (index, phi) in saved.iter().enumerate() {
            self.phi[self.slab.layout.position(self.slab.grid.cell(index))] = *phi;
        }
        self.level = self.middle();
        self.fresh = false;
        Ok(())
    }

    /// Returns the inflow through each patch \[m³/s\].
    #[must_use]
    pub fn patch_inflows(&self) -> Vec<f64> {
        let mut sums: Vec<ExactSum> = self.patches.iter().map(|_| ExactSum::new()).collect();
        for face in &self.boundary {
            sums[face.patch].add(self.inflow(face));
        }
        sums.iter().map(ExactSum::value).collect()
    }
}

#[cfg(test)]
mod tests;
