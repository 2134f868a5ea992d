//! Flow through a part of a plane between cells.

use super::{Pressure, SeepageGrid};
use decomposition::ExactSum;
use std::ops::Range;

/// Flow, area and pressures at a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionFlow {
    /// Discharge of water and grains along the axis \[m³/s; m²/s in 2-D\].
    pub discharge: f64,
    /// Open area \[m2; m in 2-D\].
    pub area: f64,
    /// Mean reduced pressure of the open cells before and behind the section \[Pa\]; NaN if there are none.
    pub reduced: [f64; 2],
}

/// Returns the weight of a cell in a mean over a plane normal to an axis: its area if the cells differ, otherwise 1.
pub(super) fn weight_of(grid: &SeepageGrid, axis: usize, cell: [usize; 3]) -> f64 {
    if grid.is_graded() {
        grid.area(axis, cell)
    } else {
        1.0
    }
}

impl Pressure {
    /// Returns the flow through the faces below the cells of a plane normal to `axis`, for cells in these ranges
    /// along the other axes. The plane may be one past the last.
    #[must_use]
    pub fn flow_through_section(
        &self,
        axis: usize,
        plane: usize,
        ranges: &[Range<usize>; 3],
    ) -> SectionFlow {
        let mut discharge = ExactSum::new();
        let mut area = ExactSum::new();
        let mut beside = [ExactSum::new(), ExactSum::new()];
        let mut counts = [0.0; 2];
        let held = |cell: [usize; 3]| (0..3).all(|a| a == axis || ranges[a].contains(&cell[a]));
        for index in 0..self.slab.grid.count() {
            let cell = self.slab.grid.cell(index);
            let (before, behind) = (cell[axis] + 1 == plane, cell[axis] == plane);
            if !held(cell) || !(before || behind) {
                continue;
            }
            if self.conduction.conducts[index] {
                let side = usize::from(behind);
                let weight = weight_of(&self.slab.grid, axis, cell);
                beside[side].add(weight * self.reduced(index));
                counts[side] += weight;
            }
            let at = self.slab.layout.position(cell);
            if behind && plane > 0 && self.conduction.factor[axis][at] > 0.0 {
                discharge.add(self.face_flow(axis, at));
                area.add(self.area(axis, at));
            }
        }
        for face in &self.boundary {
            let cell = self.slab.grid.cell(face.cell);
            let level = cell[axis] + usize::from(face.upper);
            if face.axis == axis && level == plane && held(cell) && !face.source {
                let inflow = self.inflow(face);
                discharge.add(if face.upper { -inflow } else { inflow });
                area.add(face.area);
            }
        }
        let mean = |side: usize| beside[side].value() / counts[side];
        SectionFlow {
            discharge: discharge.value(),
            area: area.value(),
            reduced: [mean(0), mean(1)],
        }
    }

    /// Returns the flow along an axis through the lower faces of all cells \[m³/s; m²/s in 2-D\], for a grid with
    /// one more cell along that axis. Faces of drains have the flow of both sides.
    #[must_use]
    pub fn face_flows(&self, axis: usize) -> Vec<f64> {
        let (grid, layout) = (&self.slab.grid, &self.slab.layout);
        let mut faces = grid.clone();
        faces.cells[axis] += 1;
        let mut flows = vec![0.0; faces.count()];
        for (index, flow) in flows.iter_mut().enumerate() {
            let cell = faces.cell(index);
            if cell[axis] == 0 || cell[axis] == grid.cells[axis] {
                continue;
            }
            let at = layout.position(cell);
            if self.conduction.factor[axis][at] > 0.0 {
                *flow = self.face_flow(axis, at);
            }
        }
        for face in self
            .boundary
            .iter()
            .filter(|face| face.axis == axis && !face.source)
        {
            let mut place = grid.cell(face.cell);
            place[axis] += usize::from(face.upper);
            let inflow = self.inflow(face);
            flows[faces.index(place)] += if face.upper { -inflow } else { inflow };
        }
        flows
    }

    /// Returns the flow of water and grains through the open face below a cell \[m³/s\].
    fn face_flow(&self, axis: usize, at: usize) -> f64 {
        let below = at - self.slab.layout.stride[axis];
        let dipping = self.tensor.as_ref().map(|own| own.flow[axis][at]);
        let driven = self.system.matrix.t[axis][at] * (self.phi[below] - self.phi[at])
            + dipping.unwrap_or(0.0);
        if self.conduction.carries {
            driven + self.area(axis, at) * self.face_velocity(axis, at)
        } else {
            driven
        }
    }

    /// Returns the reduced pressure on the lower face of a cell, which may be one past the last along the axis
    /// \[Pa\]: the imposed one at an end of the grid, otherwise that of the flux through the half cells on both
    /// sides; NaN if neither cell has water.
    #[must_use]
    pub fn face_reduced(&self, axis: usize, upper: [usize; 3]) -> f64 {
        let grid = &self.slab.grid;
        let mut lower = upper;
        lower[axis] = upper[axis].wrapping_sub(1);
        let wet = |cell: [usize; 3]| {
            let inside = cell[axis] < grid.cells[axis];
            inside
                .then(|| grid.index(cell))
                .filter(|&cell| self.conduction.conducts[cell])
        };
        let value = |cell: usize| {
            let at = self.slab.layout.position(grid.cell(cell));
            (self.reduced(cell), self.along(axis)[at])
        };
        match (wet(lower), wet(upper)) {
            (Some(below), Some(above)) => {
                let ((p, k), (q, l)) = (value(below), value(above));
                (p * k + q * l) / (k + l)
            }
            (Some(cell), None) | (None, Some(cell)) => {
                let upper_end = wet(lower).is_some();
                let on_face = |face: &&super::Boundary| {
                    face.cell == cell
                        && face.axis == axis
                        && face.upper == upper_end
                        && !face.source
                };
                let face = self.boundary.iter().find(on_face);
                let imposed = face.and_then(|face| self.imposed(face));
                imposed.unwrap_or_else(|| self.reduced(cell))
            }
            (None, None) => f64::NAN,
        }
    }

    /// Returns the stream function at the corners of the cells of a plane grid \[m2/s\], 0 at the lower corner: the
    /// discharge between two corners is its difference. Values are in an array with x fastest and one more than the
    /// cells along each axis. It is exact if there are no storage and no wells within the ground.
    #[must_use]
    pub fn stream_function(&self) -> Vec<f64> {
        let [nx, ny, _] = self.slab.grid.cells;
        let (along_x, along_y) = (self.face_flows(0), self.face_flows(1));
        let mut stream = vec![0.0; (nx + 1) * (ny + 1)];
        for i in 0..nx {
            stream[i + 1] = stream[i] - along_y[i];
        }
        for j in 0..ny {
            for i in 0..=nx {
                let (here, next) = (j * (nx + 1) + i, (j + 1) * (nx + 1) + i);
                stream[next] = stream[here] + along_x[here];
            }
        }
        stream
    }

    /// Returns the hydraulic head for a reduced pressure \[m\]; NaN without gravity.
    #[must_use]
    pub fn head(&self, reduced: f64) -> f64 {
        reduced / super::head_pressure(&self.liquid, &self.settings, 1.0)
    }
}
