//! Flow through a part of a plane between cells.

use super::Pressure;
use base::number::real;
use decomposition::ExactSum;
use std::ops::Range;

/// Flow, area and pressures at a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Through {
    /// Water and grains that cross it along the axis in a second \[m3/s; m2/s in 2-D\].
    pub discharge: f64,
    /// Open area \[m2; m in 2-D\].
    pub area: f64,
    /// Mean reduced pressure of the open cells before it and behind it \[Pa\]; NaN if there are none.
    pub reduced: [f64; 2],
}

impl Pressure {
    /// Returns the flow through the faces below the cells of a plane across `axis`, of the cells in these ranges along
    /// the other axes. The plane may be one past the last.
    #[must_use]
    pub fn through(&self, axis: usize, plane: usize, ranges: &[Range<usize>; 3]) -> Through {
        let mut discharge = ExactSum::new();
        let mut area = ExactSum::new();
        let mut beside = [ExactSum::new(), ExactSum::new()];
        let mut counts = [0_usize; 2];
        let held = |cell: [usize; 3]| (0..3).all(|a| a == axis || ranges[a].contains(&cell[a]));
        for index in 0..self.slab.grid.count() {
            let cell = self.slab.grid.cell(index);
            let (before, behind) = (cell[axis] + 1 == plane, cell[axis] == plane);
            if !held(cell) || !(before || behind) {
                continue;
            }
            if self.conduction.conducts[index] {
                let side = usize::from(behind);
                beside[side].add(self.reduced(index));
                counts[side] += 1;
            }
            let at = self.slab.layout.at(cell);
            if behind && plane > 0 && self.conduction.factor[axis][at] > 0.0 {
                let below = at - self.slab.layout.stride[axis];
                discharge.add(self.system.matrix.t[axis][at] * (self.phi[below] - self.phi[at]));
                if self.conduction.carries {
                    discharge.add(self.area(axis, at) * self.face_velocity(axis, at));
                }
                area.add(self.area(axis, at));
            }
        }
        for face in &self.boundary {
            let cell = self.slab.grid.cell(face.cell);
            let level = if face.upper {
                self.slab.grid.cells[axis]
            } else {
                0
            };
            if face.axis == axis && level == plane && held(cell) {
                let inflow = self.inflow(face);
                discharge.add(if face.upper { -inflow } else { inflow });
                area.add(face.area);
            }
        }
        let mean = |side: usize| beside[side].value() / real(counts[side]);
        Through {
            discharge: discharge.value(),
            area: area.value(),
            reduced: [mean(0), mean(1)],
        }
    }

    /// Returns the hydraulic head of a reduced pressure \[m\]; NaN without gravity.
    #[must_use]
    pub fn head(&self, reduced: f64) -> f64 {
        reduced / super::head_pressure(&self.liquid, &self.settings, 1.0)
    }
}
