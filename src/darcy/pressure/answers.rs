//! Derived results of the seepage: exit gradients on its boundary, heave of prisms of ground.
//!
//! They are separate from the solver because probes and the summary of a run read them.

use super::Pressure;
use super::section::weight_of;
use decomposition::ExactSum;
use serde::Serialize;

/// Largest exit gradient on a patch, and its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExitGradient {
    /// Loss of head over length in the half cell below the face, outwards \[1\].
    pub gradient: f64,
    /// Centre of the face \[m\].
    pub centre: [f64; 3],
}

/// Prisms of ground in front of a structure, as cells of the coarse grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Prisms {
    /// Axis of gravity.
    pub vertical: usize,
    /// `true` if the coordinate along gravity increases upwards.
    pub rises: bool,
    /// Axis along which widths are measured.
    pub across: usize,
    /// `true` if widths are measured from the upper end.
    pub from_upper: bool,
    /// First cell of the widest prism along each axis.
    pub first: [usize; 3],
    /// One past the last cell of the widest prism.
    pub end: [usize; 3],
    /// Unit weight of the submerged ground \[N/m3\].
    pub submerged_weight: f64,
}

impl Prisms {
    /// Returns the number of widths.
    #[must_use]
    pub fn widths(&self) -> usize {
        self.end[self.across] - self.first[self.across]
    }
}

/// Heave of a prism of ground, without friction on its sides: K. Terzaghi, Theoretical Soil Mechanics (1943).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Heave {
    /// Width of the prism \[m\].
    pub width: f64,
    /// Mean head at its base minus that at the surface \[m\].
    pub excess_head: f64,
    /// Excess head over the depth \[1\].
    pub gradient: f64,
    /// Submerged weight over the force of the water \[1\]; infinite if the water exerts no uplift.
    pub factor_of_safety: f64,
}

impl Pressure {
    /// Returns the largest hydraulic gradient with which water leaves through each patch, over the half cell below
    /// the face; none if no water leaves at an imposed pressure, or without gravity.
    #[must_use]
    pub fn exit_gradients(&self) -> Vec<Option<ExitGradient>> {
        let mut found: Vec<Option<ExitGradient>> = vec![None; self.patches.len()];
        let grid = &self.slab.grid;
        for face in &self.boundary {
            let rate = self.inflow(face);
            let Some(phi) = self.imposed(face).filter(|_| rate < 0.0) else {
                continue;
            };
            let half = 0.5 * grid.width(face.axis, grid.cell(face.cell));
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

    /// Returns the heave of prisms of every width, from a layer of cells to all of them.
    #[must_use]
    pub fn heave(&self, prisms: &Prisms) -> Vec<Heave> {
        let grid = &self.slab.grid;
        let (up, across) = (prisms.vertical, prisms.across);
        let third = 3 - up - across;
        let mut levels = [prisms.first[up], prisms.end[up]];
        if !prisms.rises {
            levels.reverse();
        }
        let depth = grid.axis(up).length(prisms.first[up], prisms.end[up]);
        let (weight, widths) = (self.weight()[up].abs(), grid.axis(across));
        let mut sums = [ExactSum::new(), ExactSum::new()];
        let (mut area, mut dry) = (0.0, false);
        let layer = |n: usize| {
            let mut cell = [0; 3];
            cell[across] = if prisms.from_upper {
                prisms.end[across] - 1 - n
            } else {
                prisms.first[across] + n
            };
            for k in prisms.first[third]..prisms.end[third] {
                cell[third] = k;
                let weight = weight_of(grid, up, cell);
                for (sum, level) in sums.iter_mut().zip(levels) {
                    cell[up] = level;
                    let value = self.face_reduced(up, cell);
                    dry |= !value.is_finite();
                    sum.add(if value.is_finite() {
                        weight * value
                    } else {
                        0.0
                    });
                }
                area += weight;
            }
            // A prism that contains part of a structure or a cavity has no heave.
            let excess_head = if dry {
                f64::NAN
            } else {
                self.head((sums[0].value() - sums[1].value()) / area)
            };
            let gradient = excess_head / depth;
            Heave {
                width: if prisms.from_upper {
                    widths.length(prisms.end[across] - 1 - n, prisms.end[across])
                } else {
                    widths.length(prisms.first[across], prisms.first[across] + n + 1)
                },
                excess_head,
                gradient,
                factor_of_safety: if gradient <= 0.0 {
                    f64::INFINITY
                } else {
                    prisms.submerged_weight / (weight * gradient)
                },
            }
        };
        (0..prisms.widths()).map(layer).collect()
    }

    /// Returns the heave of the prism whose width is closest to half its depth, and of the width with the smallest
    /// safety factor.
    #[must_use]
    pub fn critical_heave(&self, prisms: &Prisms) -> Option<[Heave; 2]> {
        let grid = &self.slab.grid;
        let up = prisms.vertical;
        let half = 0.5 * grid.axis(up).length(prisms.first[up], prisms.end[up]);
        let all = self.heave(prisms);
        let nearest = all
            .iter()
            .min_by(|a, b| (a.width - half).abs().total_cmp(&(b.width - half).abs()));
        let least = all
            .iter()
            .min_by(|a, b| a.factor_of_safety.total_cmp(&b.factor_of_safety));
        Some([*nearest?, *least?])
    }
}
