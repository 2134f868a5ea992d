//! Basins that are filled to the lid: by a discharge without an outlet, or from the start up to a small part of a cell.
//!
//! An interface cell of the last row below a lid has no air above it. With less than [`NEARLY`] of the cell free it
//! counts as full, like a cell that the surface has passed, and water without a source fills the rest: levels 0.05 and
//! 0.15 cells below a lid rose to it, and levels 0.25 cells and more below it stayed.
//!
//! A discharge states how much water enters, whatever the water inside does. Where no opening lets water out, the
//! free volume above the water at the start is full after a known time. From then on the discharge compresses the
//! water until its density leaves the range of the lattice.

use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::free_surface::{FreeSurface, WaterPart};
use base::error::Remedy;
use base::history::TimeTable;
use base::number::real;
use lbm::boundary::Condition;

/// Free part of a cell below which an interface cell without air next to it becomes full.
const NEARLY: f64 = 0.2;
/// Number of intervals in which the discharge is summed over the run.
const INTERVALS: u32 = 1000;
/// Difference between a level and the lid that is rounding \[cells\].
const LEVEL_SLACK: f64 = 1e-6;
/// Part of the time until the basin is full that a remedy proposes.
const PROPOSED: f64 = 0.95;

/// Reports a basin that is full before the end of the run.
pub(super) fn check(scene: &Scene, flow: &Flow, findings: &mut Findings) {
    let Some(surface) = &scene.surface else {
        return;
    };
    check_lid(scene, surface, findings);
    let mut tables = Vec::new();
    for patch in flow.patches() {
        match &patch.condition {
            Condition::Discharge(one) => {
                tables.push(TimeTable::new(one.history.as_deref(), one.value));
            }
            other if other.model().passes_water() => return,
            _ => {}
        }
    }
    let Some(opening) = surface.openings.first().filter(|_| !tables.is_empty()) else {
        return;
    };
    let solids = || scene.structures.iter().filter(|s| s.stops.water());
    let is_solid = |at: [f64; 3]| solids().any(|s| s.solid.distance(at) < 0.0);
    let grid = &scene.grid;
    let cell = grid.spacing.powi(if grid.dimension == 3 { 3 } else { 2 });
    let free = surface.cells_empty(grid.cells, is_solid) * cell;
    let Some(full) = time_of_filling(&tables, free, scene.time.end) else {
        return;
    };
    let proposed = PROPOSED * full;
    let unit = ["m2", "m3"][usize::from(grid.dimension == 3)];
    findings.unstable(
        &opening.path,
        format!(
            "no opening lets water out, and the discharge fills the {} {unit} above the water of the start after {} s, \
             before the end of the run at {} s; then it compresses the water until the run fails",
            number(free),
            number(full),
            number(scene.time.end)
        ),
        Remedy::from(format!(
            "add an opening through which water leaves, such as `outfall` or `level`, or end the run after {} s",
            number(proposed)
        ))
        .set("time.end", proposed),
    );
}

/// Warns of a level in the last row of cells that fills up to the lid.
fn check_lid(scene: &Scene, surface: &FreeSurface, findings: &mut Findings) {
    let (h, height) = (scene.grid.spacing, scene.grid.size[surface.axis]);
    for (n, part) in surface.parts.iter().enumerate() {
        let WaterPart::Level(level) = part else {
            continue;
        };
        let free = (height - surface.above(*level)) / h;
        if free <= LEVEL_SLACK || free > NEARLY {
            continue;
        }
        let path = format!("{PATH}.surface.water[{n}].level");
        let below = if surface.rises {
            h * ((height / h).round() - 1.0)
        } else {
            h
        };
        findings.warn(
            &path,
            format!(
                "the level is {} cells below the lid: the last row of cells counts as full, and water without a source \
                 fills it",
                number(free)
            ),
            Remedy::from(format!(
                "use a domain that is higher by a cell, or a level one cell from the lid, {} m",
                number(below)
            ))
            .set(&*path, below),
        );
        return;
    }
}

/// Returns the time at which discharges have filled a volume \[s\]; none if that is after `end`.
fn time_of_filling(tables: &[TimeTable], volume: f64, end: f64) -> Option<f64> {
    let discharge = |time: f64| tables.iter().map(|table| table.value(time)).sum::<f64>();
    let step = end / f64::from(INTERVALS);
    let mut entered = 0.0;
    for n in 0..INTERVALS {
        let middle = (f64::from(n) + 0.5) * step;
        entered += discharge(middle) * step;
        if entered > volume {
            return Some(real((n + 1) as usize) * step);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::Severity;
    use case::Document;
    use std::path::Path;

    /// Returns `true` if a basin of 0.4 x 0.3 m with water 0.28 m deep and a discharge of 0.05 m2/s is found to be full
    /// before the end.
    fn fills(end: f64, others: &str) -> bool {
        let text = format!(
            r#"{{
              "title": "basin", "gravity": [0, -9.81],
              "domain": {{"size": [0.4, 0.3], "spacing": 0.02}},
              "fluid": {{"lattice_boltzmann": {{
                "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 5e-4,
                "surface": {{"water": [{{"level": 0.28}}]}},
                "boundaries": [
                  {{"name": "in", "face": "x_min", "condition": {{"discharge": {{"value": 0.05}}}}}}{others}]
              }}}},
              "time": {{"end": {end}}}
            }}"#
        );
        let document = Document::read(&text, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let mut unstable = plan
            .warnings
            .iter()
            .filter(|w| w.severity == Severity::Unstable);
        unstable.any(|w| w.reason.contains("no opening lets water out"))
    }

    /// Checks levels in the last row of cells: those up to 0.2 cells below the lid fill up in a run.
    #[test]
    fn a_level_just_below_the_lid_is_named() {
        let found = |level: f64| {
            let text = format!(
                r#"{{"gravity": [0, -9.81], "domain": {{"size": [0.4, 0.3], "spacing": 0.02}},
                    "fluid": {{"lattice_boltzmann": {{"density": 1000, "kinematic_viscosity": 1e-3, "time_step": 5e-4,
                        "surface": {{"water": [{{"level": {level}}}]}}}}}}, "time": {{"end": 0.1}}}}"#
            );
            let document = Document::read(&text, &[], Path::new(".")).unwrap();
            let warnings = Plan::prepare(document).unwrap().warnings;
            let named = |w: &&base::error::Problem| w.reason.contains("below the lid");
            warnings
                .iter()
                .find(named)
                .map(|w| w.remedy.proposal()[0].value.clone())
        };
        assert_eq!(found(0.299).and_then(|level| level.as_f64()), Some(0.28));
        assert!(found(0.297).is_some());
        for level in [0.3, 0.295, 0.28, 0.15] {
            assert_eq!(found(level), None, "{level}");
        }
    }

    /// Checks a free volume of 0.4 x 0.02 m, which 0.05 m2/s fill in 0.16 s.
    #[test]
    fn a_basin_without_an_outlet_is_full_after_a_known_time() {
        assert!(!fills(0.15, ""));
        assert!(fills(0.2, ""));
        let outlet = r#", {"name": "out", "face": "x_max", "condition": {"outfall": {}}}"#;
        assert!(!fills(0.2, outlet));
    }
}
