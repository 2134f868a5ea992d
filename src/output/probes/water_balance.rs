//! Water balance of a seepage: water in the ground, what entered and left since the start, present inflow and outflow.

use super::quantity::Quantity;
use super::{Heading, Rows, discharge_unit, sampled_if_solved, volume_unit};
use crate::view::StateView;
use base::error::Error;
use dem::space::Space;
use plan::scene::Scene;

/// Water balance of the seepage.
#[derive(Debug)]
pub(super) struct WaterBalance;

impl Quantity for WaterBalance {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        let dimension = scene.grid.dimension;
        let (volume, flow) = (volume_unit(dimension), discharge_unit(dimension));
        vec![
            ("stored", volume),
            ("entered", volume),
            ("left", volume),
            ("inflow", flow),
            ("outflow", flow),
        ]
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        sampled_if_solved(view, |seepage| {
            let report = seepage.report();
            let water = seepage.pressure().water_balance().unwrap_or_default();
            let flows = [report.inflow, report.outflow];
            for row in rows {
                row.extend([water.stored, water.entered, water.left]);
                row.extend(flows);
            }
        })
    }
}
