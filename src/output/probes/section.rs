//! Discharge of seepage through a section between cells of the coarse grid, its open area and mean heads.
//!
//! Every rank knows the whole coarse grid, so that nothing is gathered.

use super::quantity::Quantity;
use super::{Heading, Rows, area_unit, discharge_unit, no_fluid, sampled_if_solved};
use crate::view::StateView;
use base::error::Error;
use dem::space::Space;
use plan::scene::Scene;
use plan::scene::aligned_box::AlignedBox;
use std::ops::Range;

/// A part of a plane between cells of the coarse grid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    pub(super) axis: usize,
    /// Index of the plane, above the indices of the cells below it.
    pub(super) plane: usize,
    /// Cells of the part; the range along the axis is not used.
    pub(super) ranges: [Range<usize>; 3],
}

impl Section {
    /// Returns the plane between cells nearest to a position \[m\], limited to the cells whose centres lie in a
    /// box.
    pub(super) fn new(
        scene: &Scene,
        axis: usize,
        position: f64,
        part: Option<&AlignedBox>,
    ) -> Result<Self, Error> {
        let scene = scene.seepage.as_ref().ok_or_else(no_fluid)?;
        let ranges = std::array::from_fn(|a| match part {
            Some(part) if a != axis && a < part.dimension => {
                let axis = scene.axis(a);
                axis.first_centre(part.from[a])..axis.first_centre(part.to[a])
            }
            _ => 0..scene.cells[a],
        });
        Ok(Self {
            axis,
            plane: scene.axis(axis).nearest_face(position),
            ranges,
        })
    }
}

impl Quantity for Section {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        let dimension = scene.grid.dimension;
        vec![
            ("discharge", discharge_unit(dimension)),
            ("open_area", area_unit(dimension)),
            ("head_before", "m"),
            ("head_behind", "m"),
        ]
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        sampled_if_solved(view, |seepage| {
            let pressure = seepage.pressure();
            let through = pressure.flow_through_section(self.axis, self.plane, &self.ranges);
            let [before, behind] = through.reduced.map(|phi| pressure.head(phi));
            for row in rows {
                row.extend([through.discharge, through.area, before, behind]);
            }
        })
    }
}
