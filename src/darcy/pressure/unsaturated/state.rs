//! State of unsaturated ground, cell by cell: saturation, and the gradient by which values are extrapolated from a
//! centre.
//!
//! It is separate from the solver because outputs and probes read it.

use super::Unsaturated;
use crate::pressure::boundary::head_pressure;
use crate::pressure::{Condition, Pressure};
use base::vector::dot;

impl Pressure {
    /// Returns the degree of saturation of a cell: volume of water over volume of pores \[1\]; 1 where all ground is
    /// saturated, 0 outside the walls.
    #[must_use]
    pub fn saturation(&self, cell: usize) -> f64 {
        if !self.conduction.conducts[cell] {
            return 0.0;
        }
        let Some(own) = &self.unsaturated else {
            return 1.0;
        };
        let at = self.slab.layout.position(self.slab.grid.cell(cell));
        own.law(at).saturation(self.pressure_head(own, at))
    }

    /// Returns the degree of saturation and the effective one in the soil of a cell at a pressure \[Pa\]; 1 where all
    /// ground is saturated.
    #[must_use]
    pub fn saturations(&self, cell: usize, pressure: f64) -> [f64; 2] {
        let Some(own) = &self.unsaturated else {
            return [1.0; 2];
        };
        let at = self.slab.layout.position(self.slab.grid.cell(cell));
        let (law, head) = (own.law(at), pressure / own.weight);
        [law.saturation(head), law.effective_saturation(head)]
    }

    /// Returns the pressure in front of a boundary face of a cell \[Pa\]: the imposed one, and that of the air in
    /// front of seepage faces above water, under rain and under evaporation; none where a wall or a stated flux is in
    /// front of the face.
    #[must_use]
    pub fn outside(&self, cell: usize, axis: usize, upper: bool) -> Option<f64> {
        let (grid, weight) = (&self.slab.grid, self.weight());
        let mut at = grid.centre(grid.cell(cell));
        let half = 0.5 * grid.width(axis, grid.cell(cell));
        at[axis] += if upper { half } else { -half };
        let below = dot(weight, at);
        let of_head = |head: f64| head_pressure(&self.liquid, &self.settings, head) + below;
        match self.condition(cell, axis, upper)? {
            Condition::Pressure { value } => Some(value),
            Condition::Head { value } => Some(of_head(value)),
            Condition::SeepageFace { level } => {
                Some(level.map_or(0.0, |head| of_head(head).max(0.0)))
            }
            Condition::Rain { .. } | Condition::Evaporation { .. } => Some(0.0),
            _ => None,
        }
    }

    /// Returns the pressure head at a position of the layout \[m\].
    pub(super) fn pressure_head(&self, own: &Unsaturated, at: usize) -> f64 {
        (self.level + self.phi[at]) / own.weight - own.elevation[at]
    }

    /// Returns the gradient of the reduced pressure inside a cell \[Pa/m\]: the mean of its two halves along each
    /// axis, which divide the differences to the next cells by their permeabilities at saturation. It equals
    /// [`Self::reduced_gradient`] if all ground is saturated.
    #[must_use]
    pub fn inner_gradient(&self, cell: usize) -> [f64; 3] {
        let Some(own) = &self.unsaturated else {
            let dipping = self.dipping_gradient(cell);
            return dipping.unwrap_or_else(|| self.reduced_gradient(cell));
        };
        let at = self.slab.layout.position(self.slab.grid.cell(cell));
        let mut driven: [f64; 3] = std::array::from_fn(|axis| {
            let stride = self.slab.layout.stride[axis];
            let face = |at: usize| {
                let per_area = self.conduction.per_area[axis][at];
                own.saturated[axis][at] * per_area * (self.phi[at - stride] - self.phi[at])
            };
            0.5 * (face(at) + face(at + stride))
        });
        for face in self
            .boundary
            .iter()
            .filter(|face| face.cell == cell && !face.source)
        {
            let imposed = self.imposed(face).filter(|_| face.rate.abs() > 0.0);
            let rate = match imposed {
                Some(phi) => face.conductance * (phi - self.level - self.phi[at]),
                None => face.rate * (-own.states[at].log_permeability).exp(),
            };
            let along = if face.upper { -rate } else { rate };
            driven[face.axis] += 0.5 * along / face.area;
        }
        let conductivities = self.conductivities(cell);
        std::array::from_fn(|axis| {
            let k = conductivities[axis];
            if k > 0.0 { -driven[axis] / k } else { 0.0 }
        })
    }
}
