//! Response of the ground along the path of a pipe: heads without a pipe, their rise with the drive, and their fall by
//! a withdrawal from each cell.
//!
//! The flow of saturated ground is linear. A second solver of the same ground computes one solution for each, so that
//! the state of a run is not touched. The solutions for withdrawals have the head 0 on all boundaries with a head and
//! no flux elsewhere, so that nothing is lost in differences.

use super::{PipePath, PipingSettings, SLIT, SoilResponse, across};
use crate::SeepageError;
use crate::enclosure::Openness;
use crate::grid::SeepageGrid;
use crate::pressure::{Condition, Medium, Pressure};
use nalgebra::DMatrix;
use std::f64::consts::PI;

/// Returns the response of saturated ground along the path of a pipe. Collective; the same on all ranks.
///
/// # Errors
/// If a solution fails.
pub fn along(
    pressure: &Pressure,
    openness: &Openness,
    settings: &PipingSettings,
) -> Result<SoilResponse, SeepageError> {
    let (grid, path) = (&openness.grid, &settings.path);
    let conductivity: Vec<f64> = (0..grid.count())
        .map(|k| pressure.conductivity(k))
        .collect();
    let cells: Vec<usize> = path.cells().map(|cell| grid.index(cell)).collect();
    let mut twin = pressure.twin(openness)?;
    let heads = |twin: &Pressure| -> Vec<f64> {
        let head = |cell: &usize| twin.head(twin.reduced(*cell));
        cells.iter().map(head).collect()
    };
    let conditions: Vec<Condition> = pressure.conditions().collect();
    let exit = match conditions.get(settings.exit) {
        Some(Condition::Head { value }) => *value,
        _ => 0.0,
    };
    twin.set_condition(settings.drive, Condition::Head { value: exit });
    twin.solve(still(&conductivity, None))?;
    let background = heads(&twin).into_iter().map(|head| head - exit).collect();
    for (patch, mut condition) in conditions.into_iter().enumerate() {
        condition.set_value(if patch == settings.drive { 1.0 } else { 0.0 });
        twin.set_condition(patch, condition);
    }
    twin.solve(still(&conductivity, None))?;
    let drive = heads(&twin);
    twin.set_condition(settings.drive, Condition::Head { value: 0.0 });
    let mut fall = DMatrix::zeros(cells.len(), cells.len());
    let mut source = vec![0.0; grid.count()];
    let weight = pressure.unit_weight();
    for (column, cell) in cells.iter().enumerate() {
        // A withdrawal that lowers the head in the cell by about 1 m.
        let rate = conductivity[*cell] * weight * grid.area(path.axis, [0; 3])
            / grid.spacing[path.vertical];
        source[*cell] = -rate / grid.volume([0; 3]);
        twin.solve(still(&conductivity, Some(&source)))?;
        source[*cell] = 0.0;
        for (row, head) in heads(&twin).into_iter().enumerate() {
            fall[(row, column)] = -head / rate;
        }
    }
    let slit = settings.width.map(|_| SLIT * across(grid, path));
    let entry = cells.iter().map(|cell| {
        let k = conductivity[*cell] * twin.direction(*cell)[path.vertical] * weight;
        match slit {
            Some(_) => 1.0 / (PI * k * grid.spacing[path.axis]),
            None => half_cell(grid, path) / k,
        }
    });
    Ok(SoilResponse {
        background,
        drive,
        fall,
        entry: entry.collect(),
        slit,
        length: grid.spacing[path.axis],
    })
}

/// Returns half the height of a cell over the area of its roof \[1/m\].
fn half_cell(grid: &SeepageGrid, path: &PipePath) -> f64 {
    0.5 * grid.spacing[path.vertical] / grid.area(path.vertical, [0; 3])
}

/// Returns stationary ground with a source of water per volume \[1/s\].
fn still<'a>(conductivity: &'a [f64], source: Option<&'a [f64]>) -> Medium<'a> {
    Medium {
        conductivity,
        carried: None,
        source,
    }
}
