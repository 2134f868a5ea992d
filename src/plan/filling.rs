//! Basins without an outlet that a discharge fills to the lid.
//!
//! A discharge states how much water enters, whatever the water inside does. Where no opening lets water out, the
//! free volume above the water at the start is full after a known time. From then on the discharge compresses the
//! water until its density leaves the range of the lattice.

use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::Flow;
use base::error::Remedy;
use base::history::TimeTable;
use base::number::real;
use lbm::boundary::Condition;

/// Number of intervals in which the discharge is summed over the run.
const INTERVALS: u32 = 1000;
/// Part of the time until the basin is full that a remedy proposes.
const PROPOSED: f64 = 0.95;

/// Reports a basin that is full before the end of the run.
pub(super) fn check(scene: &Scene, flow: &Flow, findings: &mut Findings) {
    let Some(surface) = &scene.surface else {
        return;
    };
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

    /// Checks a free volume of 0.4 x 0.02 m, which 0.05 m2/s fill in 0.16 s.
    #[test]
    fn a_basin_without_an_outlet_is_full_after_a_known_time() {
        assert!(!fills(0.15, ""));
        assert!(fills(0.2, ""));
        let outlet = r#", {"name": "out", "face": "x_max", "condition": {"outfall": {}}}"#;
        assert!(!fills(0.2, outlet));
    }
}
