//! Discharge of seepage between two points of a plane.

use super::quantity::Quantity;
use super::{Heading, Rows, discharge_unit, no_fluid, sampled_if_solved};
use crate::view::StateView;
use base::error::Error;
use coupling::seepage::Seepage;
use decomposition::ExactSum;
use dem::space::Space;
use plan::scene::Scene;
use std::ops::Range;

/// Distance from a face in cells within which a point lies on it.
const SLACK: f64 = 1e-9;

/// Path along cell edges between the cell corners nearest to two points. A point on a face that a structure closes in
/// part, such as the tip of a cut-off, takes the corner on the side of the structure, so that the open part counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    from: [usize; 2],
    to: [usize; 2],
    /// The two points \[m\].
    points: [[f64; 2]; 2],
}

impl Crossing {
    /// Returns the path between two points \[m\].
    pub(super) fn new(scene: &Scene, from: [f64; 3], to: [f64; 3]) -> Result<Self, Error> {
        let scene = scene.seepage.as_ref().ok_or_else(no_fluid)?;
        let points = [from, to].map(|[x, y, _]| [x, y]);
        let corner = |point: [f64; 2]| [0, 1].map(|a: usize| scene.axis(a).nearest_face(point[a]));
        let [from, to] = points.map(corner);
        Ok(Self { from, to, points })
    }

    /// Returns the range of faces of a leg along `axis` at the corner line `line`, from `ends[0]` to `ends[1]`. A point
    /// at an end \[m\] adds the face in which it lies if a structure closes that face in part.
    fn faces<S: Space>(
        seepage: &Seepage<S>,
        (axis, line): (usize, usize),
        ends: [usize; 2],
        points: [Option<f64>; 2],
    ) -> Range<usize> {
        let (grid, open) = (seepage.grid(), &seepage.openness().faces[1 - axis]);
        let mut range = ends[0].min(ends[1])..ends[0].max(ends[1]);
        if range.is_empty() {
            return range;
        }
        let cut = |at: usize| {
            let face = if axis == 1 {
                at * (grid.cells[0] + 1) + line
            } else {
                line * grid.cells[0] + at
            };
            open[face] > 0.0 && open[face] < 1.0
        };
        let along = grid.axis(axis);
        let slack = SLACK * grid.spacing[axis];
        for (end, point) in ends.into_iter().zip(points) {
            let Some(point) = point else { continue };
            let beyond = point - along.face(end);
            if end == range.end && beyond > slack && end < grid.cells[axis] && cut(end) {
                range.end += 1;
            } else if end == range.start && beyond < -slack && end > 0 && cut(end - 1) {
                range.start -= 1;
            }
        }
        range
    }

    /// Returns the discharge across the path from left to right; the path runs along x first, then along y.
    fn discharge<S: Space>(&self, seepage: &Seepage<S>) -> f64 {
        let (grid, pressure) = (seepage.grid(), seepage.pressure());
        let mut sum = ExactSum::new();
        let ([i, j], [k, l]) = (self.from, self.to);
        let [start, end] = self.points;
        let upward = pressure.face_flows(1);
        let last = (j == l).then_some(end[0]);
        for x in Self::faces(seepage, (0, j), [i, k], [Some(start[0]), last]) {
            let flow = upward[j * grid.cells[0] + x];
            sum.add(if k > i { -flow } else { flow });
        }
        let rightward = pressure.face_flows(0);
        let first = (i == k).then_some(start[1]);
        for y in Self::faces(seepage, (1, k), [j, l], [first, Some(end[1])]) {
            let flow = rightward[y * (grid.cells[0] + 1) + k];
            sum.add(if l > j { flow } else { -flow });
        }
        sum.value()
    }
}

impl Quantity for Crossing {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        vec![("discharge", discharge_unit(scene.grid.dimension))]
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        sampled_if_solved(view, |seepage| {
            let discharge = self.discharge(seepage);
            rows.iter_mut().for_each(|row| row.push(discharge));
        })
    }
}
