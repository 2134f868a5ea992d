//! Settings of models that are independent of the cells: one run for each, with the next more accurate value.
//!
//! The change of an answer measures its sensitivity to the model. It is not part of the uncertainty of the cells.
//!
//! | setting | applies to | more accurate value |
//! |---|---|---|
//! | contact stiffness | springs as given or chosen, between moving bodies | four times |
//! | solid time step | grains without a lattice | half |
//! | coupling interval | seepage through grains | half |
//! | cells of the seepage | seepage through grains | half, if a cell still contains a mean grain |
//! | resistance | seepage through grains in saturated ground | the law of another source |
//! | steps in time | transient seepage through grains | a quarter of the error of the content |
//! | eddy viscosity | lattice with eddies | WALE for Smagorinsky; for WALE the constant 0.325 |
//! | lattice velocity | lattice under acoustic scaling | half |
//!
//! The constant of WALE is 0.325 in channels and 0.5 in decaying turbulence (Nicoud and Ducros 1999).

use super::grids;
use super::grids::Scaling;
use darcy::Resistance;
use plan::Plan;
use plan::scene::seepage::Seepage;
use serde_json::{Value, json};

/// Setting with the case under its next more accurate value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Name of the setting in words.
    pub name: &'static str,
    /// Name as part of a folder's name.
    pub folder: &'static str,
    /// Description of the change: old value to new value.
    pub change: String,
    /// Changed case.
    pub case: Value,
}

/// Factor by which contacts become stiffer.
const STIFFER: f64 = 4.0;
/// Constant of WALE in the comparison.
const OTHER_WALE: f64 = 0.325;

/// Function that changes a setting of the case with stated cells and returns a description of the change; `None` if the
/// scene does not have the setting.
type Change = fn(&mut Value, &Plan, Scaling) -> Option<String>;

/// Setting before it is applied to a case.
struct Alternative {
    name: &'static str,
    folder: &'static str,
    change: Change,
}

/// Returns an alternative.
const fn alternative(name: &'static str, folder: &'static str, change: Change) -> Alternative {
    Alternative {
        name,
        folder,
        change,
    }
}

/// All settings.
const SETTINGS: &[Alternative] = &[
    alternative("contact stiffness", "stiffness", stiffness),
    alternative("solid time step", "solid-step", solid_step),
    alternative("coupling interval", "interval", interval),
    alternative("cells of the seepage", "seepage-cells", cells),
    alternative("law of resistance", "resistance", resistance),
    alternative("steps in time", "content-error", content_error),
    alternative("eddy viscosity", "eddies", eddies),
    alternative("lattice velocity", "velocity", velocity),
];

/// Returns the settings of a scene.
#[must_use]
pub fn scene_settings(case: &Value, plan: &Plan, scaling: Scaling) -> Vec<Setting> {
    let one = |alternative: &Alternative| {
        let mut case = case.clone();
        let change = (alternative.change)(&mut case, plan, scaling)?;
        Some(Setting {
            name: alternative.name,
            folder: alternative.folder,
            change,
            case,
        })
    };
    SETTINGS.iter().filter_map(one).collect()
}

fn stiffness(case: &mut Value, plan: &Plan, _: Scaling) -> Option<String> {
    // Without moving bodies in contact there is no critical time step.
    plan.clock.critical_solid_time_step?;
    let contact = case.get_mut("contact")?;
    if stiffen(contact) == 0 {
        return None;
    }
    // The critical time step scales with the inverse square root of the stiffness.
    let steps = case.pointer_mut("/time/solid_steps_per_fluid_step");
    if let Some((steps, number)) = steps.and_then(|s| s.as_u64().map(|n| (s, n))) {
        *steps = (2 * number).into();
    } else if plan.scene.flow.is_none() {
        halve_solid_step(case, plan);
    }
    Some(format!("x {STIFFER}"))
}

/// Multiplies all normal stiffnesses below a value; returns their number.
fn stiffen(value: &mut Value) -> usize {
    match value {
        Value::Object(map) => {
            let mut count = 0;
            for (key, child) in map {
                if key == "normal_stiffness" {
                    count += scale(child);
                } else {
                    count += stiffen(child);
                }
            }
            count
        }
        Value::Array(list) => list.iter_mut().map(stiffen).sum(),
        _ => 0,
    }
}

/// Multiplies a number or the numbers of an object.
fn scale(value: &mut Value) -> usize {
    if let Some(number) = value.as_f64() {
        *value = (STIFFER * number).into();
        return 1;
    }
    let children = value
        .as_object_mut()
        .into_iter()
        .flat_map(|map| map.values_mut());
    children.map(scale).sum()
}

/// Halves the solid time step of the plan; the times of coupling are kept.
fn halve_solid_step(case: &mut Value, plan: &Plan) {
    case["time"]["solid_time_step"] = (0.5 * plan.clock.solid_time_step).into();
    if let Some(interval) = case.pointer_mut("/fluid/darcy/coupling_interval")
        && let Some(steps) = interval.as_u64()
    {
        *interval = (2 * steps).into();
    }
}

fn solid_step(case: &mut Value, plan: &Plan, _: Scaling) -> Option<String> {
    plan.clock.critical_solid_time_step?;
    if plan.scene.flow.is_some() {
        return None;
    }
    halve_solid_step(case, plan);
    Some("x 0.5".into())
}

/// Returns the seepage through grains: without grains there is no coupling, and zones give the resistance.
fn seepage_through_grains(plan: &Plan) -> Option<&Seepage> {
    let seepage = plan.scene.seepage.as_ref();
    seepage.filter(|_| plan.scene.has_solids())
}

fn interval(case: &mut Value, plan: &Plan, _: Scaling) -> Option<String> {
    seepage_through_grains(plan)?;
    let steps = plan.clock.solid_steps_per_step;
    if steps < 2 {
        return None;
    }
    case["fluid"]["darcy"]["coupling_interval"] = (steps / 2).into();
    Some(format!("{steps} to {} solid steps", steps / 2))
}

/// Divides the permitted error of the content by four, which halves the time steps. Without grains it changes with the
/// cells, and is part of the uncertainty.
fn content_error(case: &mut Value, plan: &Plan, _: Scaling) -> Option<String> {
    let seepage = seepage_through_grains(plan)?;
    let transient = seepage.written.unsaturated.as_ref()?.transient.as_ref()?;
    let (now, next) = (transient.content_error, 0.25 * transient.content_error);
    case["fluid"]["darcy"]["unsaturated"]["transient"]["content_error"] = next.into();
    Some(format!("{now} to {next}"))
}

fn cells(case: &mut Value, plan: &Plan, _: Scaling) -> Option<String> {
    let seepage = plan.scene.seepage.as_ref()?;
    let dimension = plan.scene.grid.dimension;
    let (low, high) = plan.scene.grains.as_ref()?.radii?;
    let smallest = seepage.smallest_edge(dimension);
    // A cell that contains no grain has no mean over grains.
    if 0.5 * smallest < low + high {
        return None;
    }
    case["fluid"]["darcy"]["grid"] = grids::seepage_grid(seepage, dimension, 0.5);
    Some(format!("{smallest:.3e} to {:.3e} m", 0.5 * smallest))
}

fn resistance(case: &mut Value, plan: &Plan, _: Scaling) -> Option<String> {
    let saturated = |seepage: &&Seepage| seepage.written.unsaturated.is_none();
    let seepage = seepage_through_grains(plan).filter(saturated)?;
    let now = seepage.written.resistance();
    let other = match now {
        Resistance::KozenyCarman => Resistance::Ergun,
        Resistance::Ergun | Resistance::Gidaspow => Resistance::DiFelice,
        Resistance::DiFelice => Resistance::Gidaspow,
    };
    let [now, other] = [now, other].map(|law| json!(law));
    let text = |law: &Value| law.as_str().unwrap_or_default().to_owned();
    let change = format!("{} to {}", text(&now), text(&other));
    case["fluid"]["darcy"]["resistance"] = other;
    Some(change)
}

fn eddies(case: &mut Value, plan: &Plan, _: Scaling) -> Option<String> {
    let model = json!(plan.scene.flow.as_ref()?.models.turbulence?);
    let wale = model.get("wale").is_some();
    let constant = if wale { OTHER_WALE } else { 0.5 };
    case["fluid"]["lattice_boltzmann"]["turbulence"] = json!({"wale": {"constant": constant}});
    Some(format!("{model} to WALE with {constant}"))
}

fn velocity(case: &mut Value, plan: &Plan, scaling: Scaling) -> Option<String> {
    plan.scene.flow.as_ref()?;
    if scaling == Scaling::Diffusive {
        return None;
    }
    let step = case.pointer("/fluid/lattice_boltzmann/time_step");
    let step = step.and_then(Value::as_f64).unwrap_or(plan.clock.time_step);
    let factor = 0.5 * step / plan.clock.time_step;
    grids::with_time_step(case, plan, factor);
    Some("x 0.5".into())
}
