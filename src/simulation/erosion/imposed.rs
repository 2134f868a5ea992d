//! Conditions that a piping case imposes: its pressures and the cohesion of its bonds.

use base::history::TimeTable;
use base::number::to_u32;
use dem::contact::Scaled;
use plan::Plan;

/// Returns every imposed pressure \[Pa\] as a function of the time after the first fluid step \[s\].
pub(super) fn pressures(plan: &Plan) -> impl Iterator<Item = TimeTable> {
    let patches = plan.scene.flow.iter().flat_map(|flow| flow.patches());
    patches.filter_map(|patch| Some(patch.condition.model().pressure()?.history))
}

/// Returns the largest value minus the smallest; NaN for fewer than two.
pub(super) fn spread(values: impl Iterator<Item = f64>) -> f64 {
    let (mut n, mut low, mut high) = (0, f64::INFINITY, f64::NEG_INFINITY);
    for value in values {
        n += 1;
        low = low.min(value);
        high = high.max(value);
    }
    if n < 2 { f64::NAN } else { high - low }
}

/// Returns the cohesion over the diameter, C/d [N/m], of a pair of grains of mean size.
pub(super) fn cohesion_per_diameter(plan: &Plan, diameter: f64) -> f64 {
    let (Some(table), Some(grains)) = (&plan.scene.contact, &plan.scene.grains) else {
        return 0.0;
    };
    let material = to_u32(grains.material);
    match table.model().cohesion([material; 2]) {
        Scaled::PerDiameter(value) => value,
        Scaled::Absolute(value) if diameter > 0.0 => value / diameter,
        Scaled::Absolute(_) => 0.0,
    }
}

/// Returns the difference of the imposed pressures \[Pa\] at a time after the start of the fluid, ramps
/// included.
pub(super) fn pressure_difference(plan: &Plan, time: f64) -> f64 {
    spread(pressures(plan).map(|history| history.value(time)))
}
