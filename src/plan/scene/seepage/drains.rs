//! Drains, wells and cavities inside the ground, resolved on the coarse grid.

use super::{PATH, Seepage};
use crate::scene::aligned_box::AlignedBox;
use crate::scene::findings::Findings;
use crate::scene::grid::Grid;
use crate::scene::unique;
use base::number::{real, whole};
use base::vector::norm;
use darcy::{Condition, DrainCells};
use serde::Serialize;

/// Drain inside the ground, or part of the surface of the ground.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drain {
    /// Name of the drain.
    pub name: String,
    /// Path in the case, without that of the seepage.
    #[serde(skip)]
    pub path: String,
    /// Cells of the drain, or its plane between cells.
    #[serde(skip)]
    pub cells: DrainCells,
    /// Condition at time 0.
    pub condition: Condition,
    /// Times \[s\] and values of the condition; empty if it is constant.
    pub history: Vec<[f64; 2]>,
}

impl Seepage {
    /// Returns the drains of the case; reports a finding for one that does not lie in the ground.
    pub(super) fn drains_of(&self, grid: &Grid, findings: &mut Findings) -> Vec<Drain> {
        let mut known: Vec<&str> = self
            .patches
            .iter()
            .map(|patch| patch.name.as_str())
            .chain(self.drains.iter().map(|drain| drain.name.as_str()))
            .collect();
        let mut all = Vec::new();
        for (n, written) in self.written.drains.iter().enumerate() {
            let path = format!("{PATH}.drains[{n}]");
            unique(&mut known, &written.name, &format!("{path}.name"), findings);
            if matches!(
                written.condition,
                Condition::Rain { .. } | Condition::Evaporation { .. } | Condition::NoFlow {}
            ) {
                findings.error(
                    &format!("{path}.condition"),
                    "rain and evaporation act on faces of the grid only, and an impermeable body is a structure",
                    "use a pressure, head, seepage_face, flux or discharge, or add a structure",
                );
            }
            let block =
                AlignedBox::resolve(grid, &written.region, &format!("{path}.box"), findings);
            let Some(mut cells) = self.drain_cells(&block, grid.dimension, &path, findings) else {
                continue;
            };
            cells.stays = matches!(written.condition, Condition::Discharge { .. });
            let history = written.history.clone().unwrap_or_default();
            let mut condition = written.condition;
            if let Some([_, value]) = history.first() {
                condition.set_value(*value);
            }
            all.push(Drain {
                name: written.name.clone(),
                path: format!("drains[{n}]"),
                cells,
                condition,
                history,
            });
        }
        all
    }

    /// Returns the cells of a box, or the plane between cells nearest to a box thinner than a cell.
    fn drain_cells(
        &self,
        block: &AlignedBox,
        dimension: usize,
        path: &str,
        findings: &mut Findings,
    ) -> Option<DrainCells> {
        let (mut from, mut to) = ([0; 3], self.cells);
        let mut thin = Vec::new();
        for a in 0..dimension {
            let axis = self.axis(a);
            (from[a], to[a]) = (
                axis.first_centre(block.from[a]),
                axis.first_centre(block.to[a]),
            );
            if from[a] == to[a] {
                thin.push(a);
            }
        }
        match thin[..] {
            [] => {}
            [a] => {
                let plane = self.nearest_plane(block, a);
                if !(1..self.cells[a]).contains(&plane) {
                    findings.error(
                        &format!("{path}.box"),
                        "the sheet lies on a face of the coarse grid or outside it",
                        "use a boundary with this condition and a patch, or move the sheet into the ground",
                    );
                    return None;
                }
                (from[a], to[a]) = (plane, plane);
            }
            // A line or a point becomes the cells that contain it.
            _ => {
                for a in thin {
                    let at = self.middle_cell(block, a);
                    (from[a], to[a]) = (at, at + 1);
                }
            }
        }
        Some(DrainCells {
            from,
            to,
            stays: false,
            only: None,
        })
    }

    /// Returns the plane between cells nearest to the middle of a box.
    fn nearest_plane(&self, block: &AlignedBox, a: usize) -> usize {
        match &self.graded[a] {
            None => {
                let middle = block.from[a] + block.to[a] - 2.0 * self.origin[a];
                let place = (0.5 * middle / self.spacing[a]).round();
                whole(place.clamp(0.0, real(self.cells[a])))
            }
            Some(_) => self
                .axis(a)
                .nearest_face(0.5 * (block.from[a] + block.to[a])),
        }
    }

    /// Returns the cell that contains the middle of a box, or the nearest one.
    fn middle_cell(&self, block: &AlignedBox, a: usize) -> usize {
        let last = self.cells[a] - 1;
        match &self.graded[a] {
            None => {
                let middle = block.from[a] + block.to[a] - 2.0 * self.origin[a];
                let place = (0.5 * middle / self.spacing[a]).floor();
                whole(place.clamp(0.0, real(last)))
            }
            Some(faces) => {
                let middle = 0.5 * (block.from[a] + block.to[a]);
                let above = faces.partition_point(|face| *face <= middle);
                above.saturating_sub(1).min(last)
            }
        }
    }

    /// Returns the reduced pressure that a drain imposes \[Pa\].
    pub(super) fn drain_pressure(&self, drain: &Drain, gravity: [f64; 3]) -> Option<f64> {
        let density = self.written.density;
        let strength = norm(gravity);
        // The reference point is half way between the ends; for air the lowest point.
        let place = |part: f64| -> f64 {
            let at = |a: usize| {
                if self.graded[a].is_some() {
                    let axis = self.axis(a);
                    let ends = [drain.cells.from[a], drain.cells.to[a]].map(|n| axis.face(n));
                    let [low, high] = if gravity[a] > 0.0 {
                        [ends[1], ends[0]]
                    } else {
                        ends
                    };
                    return low + part * (high - low);
                }
                let (low, high) = (real(drain.cells.from[a]), real(drain.cells.to[a]));
                let [low, high] = if gravity[a] > 0.0 {
                    [high, low]
                } else {
                    [low, high]
                };
                self.origin[a] + (low + part * (high - low)) * self.spacing[a]
            };
            (0..3).map(|a| gravity[a] * at(a)).sum()
        };
        match drain.condition {
            Condition::Pressure { value } => Some(value - density * place(0.5)),
            Condition::Head { value } => Some(density * strength * value),
            Condition::SeepageFace { level } => {
                let lowest = -density * place(0.0);
                Some(level.map_or(lowest, |level| lowest.max(density * strength * level)))
            }
            _ => None,
        }
    }
}
