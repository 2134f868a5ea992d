//! Discharge of seepage between two points of a plane.

use super::quantity::Quantity;
use super::{Heading, discharge_unit, no_fluid, solved};
use crate::view::StateView;
use base::error::Error;
use coupling::seepage::Seepage;
use decomposition::ExactSum;
use dem::space::Space;
use plan::scene::Scene;

/// Path along cell edges between the cell corners nearest to two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    from: [usize; 2],
    to: [usize; 2],
}

impl Crossing {
    /// Returns the path between two points \[m\].
    pub(super) fn new(scene: &Scene, from: [f64; 3], to: [f64; 3]) -> Result<Self, Error> {
        let scene = scene.seepage.as_ref().ok_or_else(no_fluid)?;
        let corner = |point: [f64; 3]| [0, 1].map(|a: usize| scene.axis(a).nearest_face(point[a]));
        Ok(Self {
            from: corner(from),
            to: corner(to),
        })
    }

    /// Returns the discharge across the path from left to right; the path runs along x first, then along y.
    fn discharge<S: Space>(&self, seepage: &Seepage<S>) -> f64 {
        let (grid, pressure) = (seepage.grid(), seepage.pressure());
        let mut sum = ExactSum::new();
        let ([i, j], [k, l]) = (self.from, self.to);
        let upward = pressure.face_flows(1);
        for x in i.min(k)..i.max(k) {
            let flow = upward[j * grid.cells[0] + x];
            sum.add(if k > i { -flow } else { flow });
        }
        let rightward = pressure.face_flows(0);
        for y in j.min(l)..j.max(l) {
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

    fn sample<S: Space>(
        &mut self,
        view: &StateView<S>,
        rows: &mut [Vec<f64>],
    ) -> Result<bool, Error> {
        let Some(seepage) = solved(view)? else {
            return Ok(false);
        };
        let discharge = self.discharge(seepage);
        rows.iter_mut().for_each(|row| row.push(discharge));
        Ok(true)
    }
}
