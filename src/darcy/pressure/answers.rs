//! Answers of the seepage on its boundary: exit gradients.
//!
//! Apart from the solver because the summary of a run reads them.

use super::Pressure;

/// Steepest exit of water through a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExitGradient {
    /// Loss of head over length in the half cell below the face, outwards \[1\].
    pub gradient: f64,
    /// Centre of the face \[m\].
    pub centre: [f64; 3],
}

impl Pressure {
    /// Returns the largest hydraulic gradient with which water leaves through each patch, over the half cell below the
    /// face; none where none leaves at an imposed pressure, and without gravity.
    #[must_use]
    pub fn exit_gradients(&self) -> Vec<Option<ExitGradient>> {
        let mut found: Vec<Option<ExitGradient>> = vec![None; self.patches.len()];
        let grid = &self.slab.grid;
        for face in &self.boundary {
            let rate = self.inflow(face);
            let Some(phi) = self.imposed(face).filter(|_| rate < 0.0) else {
                continue;
            };
            let half = 0.5 * grid.spacing[face.axis];
            let gradient = self.head(self.level + self.phi[face.at] - phi) / half;
            let steeper = found[face.patch].is_none_or(|known| gradient > known.gradient);
            if gradient.is_finite() && steeper {
                let mut centre = grid.centre(grid.cell(face.cell));
                centre[face.axis] += if face.upper { half } else { -half };
                found[face.patch] = Some(ExitGradient { gradient, centre });
            }
        }
        found
    }
}
