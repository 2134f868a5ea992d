//! The grids of an estimate: coarser or finer cells on which every edge is a whole number of cells, and the case on
//! them.
//!
//! A case on other cells keeps all models and parameters that the program chose for the case itself. Its time step
//! changes by one of two rules, the same for all grids:
//!
//! - **diffusive**: the relaxation time is kept, the time step scales with h² and the lattice velocity with h. All
//!   errors of the method, including that of compressibility, then decrease with h², and the estimate contains
//!   them.
//! - **acoustic**: the lattice velocity is kept and the time step scales with h. It is used where a coarser grid
//!   would exceed the limits of the lattice velocity or of the compression. The error of compressibility is then
//!   the same on all grids: the estimate does not contain it, and a run with half the lattice velocity measures it.
//!
//! The time step is adjusted by less than half a step in the whole run, so that all grids end at the same time.
//!
//! A seepage without grains has no time step that cells limit: its own cells are halved, doubled or quartered,
//! provided that the ends of its openings lie on cell faces. Cells of different widths are halved and quartered, so
//! that their widening away from edges is too: merged cells would widen twice as fast. The steps of a transient flow
//! are of second order. Their permitted error changes with the square of the cells, and the time between results,
//! which is their largest length, with the cells: the error in time decreases with h² like that of the cells, and the
//! estimate contains both. A seepage through grains has cells of the size of grains and is not refined.

use base::error::{Error, Problem};
use base::number::{common_divisor, real, to_u32, whole};
use case::coupling::{Coupling, Scheme};
use case::darcy::Zone;
use case::fluid::Initial;
use darcy::{Condition, Retention};
use plan::Plan;
use plan::scene::Scene;
use plan::scene::flow::Lattice;
use plan::scene::seepage::{Seepage, rescaled_widths};
use serde::Serialize;
use serde_json::{Value, json};

/// Refinement ratios in 2-D and 3-D: the coarser grids together then cost about a tenth of the case, because the
/// cost scales with h^-4 or h^-5.
const RATIO: [f64; 2] = [1.8, 1.6];
/// Refinement ratio of a finer grid.
const FINER_RATIO: f64 = 1.5;
/// Minimum ratio of neighbouring grids (Celik et al. 2008).
const MIN_RATIO: f64 = 1.3;
/// Minimum ratio of a grid to one that failed.
const MIN_STEP: f64 = 1.05;
/// Minimum number of cells across the smallest round body on the coarsest grid; the plan refuses fewer.
const MIN_CELLS: f64 = 4.0;

/// Scaling of the time step with the cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scaling {
    /// Time step proportional to h²: the relaxation time is kept.
    Diffusive,
    /// Time step proportional to h: the lattice velocity is kept.
    Acoustic,
    /// No time step: a steady seepage.
    Steady,
}

impl Scaling {
    /// Returns a description of the quantity that is kept and of the consequence.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Diffusive => {
                "diffusive: the same relaxation time on all grids; the compressibility error decreases with h^2 \
                 and is part of the uncertainty"
            }
            Self::Acoustic => {
                "acoustic: the same lattice velocity on all grids, because diffusive scaling exceeds the limits \
                 on coarser cells; the compressibility error is not part of the uncertainty"
            }
            Self::Steady => {
                "seepage cells; the permitted error of the steps of a transient flow decreases with h^2, and is part \
                 of the uncertainty"
            }
        }
    }

    /// Returns the factor of the time step for cells that are `ratio` times as large.
    fn of_time(self, ratio: f64) -> f64 {
        match self {
            Self::Diffusive => ratio * ratio,
            Self::Acoustic => ratio,
            Self::Steady => 1.0,
        }
    }
}

/// Maximum number of cells of a refined seepage in an estimate.
const MAX_SEEPAGE_CELLS: usize = 8_000_000;

/// Returns the seepage of a scene if its cells can be refined, that is, if it has no grains.
#[must_use]
pub fn refinable_seepage(scene: &Scene) -> Option<&Seepage> {
    scene.seepage.as_ref().filter(|_| !scene.has_solids())
}

/// Returns `true` if the cells of a grid are halves of wider ones along each axis.
fn has_equal_pairs(seepage: &Seepage, dimension: usize) -> bool {
    (0..dimension).all(|a| {
        let axis = seepage.axis(a);
        axis.cells.is_multiple_of(2)
            && (0..axis.cells).step_by(2).all(|cell| {
                let [one, other] = [axis.width(cell), axis.width(cell + 1)];
                (one - other).abs() <= 1e-9 * one
            })
    })
}

/// Returns the spacings divided by that of the case, in ascending order: 2 and 4 if openings and edges allow it,
/// otherwise 1/2; 1/4 and 1/2 for cells of different widths, as far as their number permits.
fn ratios_of_seepage(seepage: &Seepage, dimension: usize, finer: bool) -> Vec<f64> {
    let divides = |number: usize| {
        let even = |cells: &usize| cells.is_multiple_of(number);
        seepage.cells[..dimension]
            .iter()
            .all(|cells| even(cells) && cells / number >= 2)
            && seepage.patches.iter().all(|patch| {
                let ends = patch.from.iter().zip(&patch.to).take(dimension);
                let mut ends = ends
                    .enumerate()
                    .filter(|(axis, _)| *axis != patch.face.axis());
                ends.all(|(_, (from, to))| even(from) && even(to))
            })
    };
    let cells: usize = seepage.cells[..dimension].iter().product();
    let fits = |times: usize| cells * times.pow(to_u32(dimension)) <= MAX_SEEPAGE_CELLS;
    let coarser: Vec<f64> = [2, 4]
        .into_iter()
        .take_while(|n| divides(*n))
        .map(real)
        .collect();
    let finest: Vec<f64> = [2, 4]
        .into_iter()
        .take_while(|n| fits(*n))
        .map(|n| 1.0 / real(n))
        .collect();
    // Merged cells of different widths widen faster, unless pairs of them are equal.
    let nested = !seepage.is_graded() || has_equal_pairs(seepage, dimension);
    let from_fine = match (finer, coarser.len()) {
        _ if !nested => 2,
        (false, 2) => 0,
        (true, 1..) | (false, 1) => 1,
        _ => 2,
    };
    let from_fine = from_fine.min(finest.len());
    let mut chosen: Vec<f64> = finest[..from_fine].iter().rev().copied().collect();
    chosen.extend(coarser.iter().take(2 - from_fine));
    chosen
}

/// Returns the spacings of the other grids divided by that of the case, in ascending order: coarser ones, and a
/// finer one on request or if no coarser cells divide the edges.
#[must_use]
pub fn ratios(scene: &Scene, finer: bool) -> Vec<f64> {
    let grid = &scene.grid;
    if let Some(seepage) = refinable_seepage(scene) {
        return ratios_of_seepage(seepage, grid.dimension, finer);
    }
    let Coarsening {
        common,
        wanted,
        allowed,
    } = Coarsening::new(scene);
    let mut chosen = Vec::new();
    let coarser = coarser_ratios(common, wanted, allowed, if finer { 1 } else { 2 });
    // If no coarser cells divide the edges, a finer grid is used.
    if finer || coarser.is_empty() {
        let cells = whole((FINER_RATIO * real(common)).round()).max(common + 1);
        chosen.push(real(common) / real(cells));
    }
    chosen.extend(coarser);
    chosen
}

/// Returns a grid in place of one that failed, given the ratios of the grids that ran, including the case, and of
/// those that failed. Runs fail because cells are too coarse: the new grid has finer cells than all coarser grids
/// that failed, and is as near as possible to the middle between these and the next finer ones that ran. If no
/// coarser grid failed, it is coarser than all that ran. The last choice is a grid finer than that of the case.
#[must_use]
pub fn replacement_grid(scene: &Scene, usable: &[f64], failed: &[f64]) -> Option<f64> {
    if scene.seepage.is_some() {
        return None;
    }
    let Coarsening {
        common,
        wanted,
        allowed,
    } = Coarsening::new(scene);
    common_divisor_grid(common, wanted, allowed, usable, failed)
}

/// Limits of coarser grids of a scene.
struct Coarsening {
    /// Cells in the common divisor of the edges.
    common: usize,
    /// Wanted ratio of two grids.
    wanted: f64,
    /// Largest ratio at which the smallest body has enough cells.
    allowed: f64,
}

impl Coarsening {
    fn new(scene: &Scene) -> Self {
        let grid = &scene.grid;
        let cells = grid.cells[..grid.dimension].iter();
        let diameter = smallest_diameter(scene);
        Self {
            common: cells.fold(0, |a, b| common_divisor(a, *b)),
            wanted: RATIO[usize::from(grid.dimension == 3)],
            allowed: diameter.map_or(f64::INFINITY, |d| d / (MIN_CELLS * grid.spacing)),
        }
    }
}

/// Returns the result of [`replacement_grid`] for edges with `common` cells in their common divisor.
fn common_divisor_grid(
    common: usize,
    wanted: f64,
    allowed: f64,
    usable: &[f64],
    failed: &[f64],
) -> Option<f64> {
    let apart = |a: f64, b: f64| (a / b).max(b / a);
    let new = |ratio: f64| {
        usable
            .iter()
            .all(|known| apart(ratio, *known) >= MIN_RATIO - 1e-9)
            && failed.iter().all(|known| apart(ratio, *known) >= MIN_STEP)
    };
    let lowest = failed.iter().copied().filter(|ratio| *ratio > 1.0);
    let lowest = lowest.fold(f64::INFINITY, f64::min);
    let last = usable.iter().copied().filter(|ratio| *ratio < lowest);
    let last = last.fold(1.0, f64::max);
    let target = if lowest.is_finite() {
        (last * MIN_RATIO * lowest).sqrt()
    } else {
        last * wanted
    };
    let coarser = (1..common)
        .map(|cells| real(common) / real(cells))
        .filter(|&ratio| ratio < lowest && ratio <= allowed + 1e-9 && new(ratio))
        .min_by(|a, b| apart(*a, target).total_cmp(&apart(*b, target)));
    let finer = || {
        let cells = whole((FINER_RATIO * real(common)).round()).max(common + 1);
        let tried = usable.iter().chain(failed).any(|ratio| *ratio < 1.0);
        Some(real(common) / real(cells)).filter(|ratio| !tried && new(*ratio))
    };
    coarser.or_else(finer)
}

/// Returns up to `number` coarser grids, each as near as possible to the wanted ratio to the previous one, with
/// cells at most `allowed` times as large.
fn coarser_ratios(common: usize, wanted: f64, allowed: f64, number: u8) -> Vec<f64> {
    let steps = f64::from(number);
    let wanted = wanted.min(allowed.powf(1.0 / steps)).max(MIN_RATIO);
    let mut before = common;
    let mut chosen = Vec::new();
    for left in (0..number).rev() {
        let away = |cells: &usize| (real(before) / real(*cells) / wanted).ln().abs();
        let near = |limit: f64| {
            let fits = |cells: &usize| {
                real(before) / real(*cells) >= MIN_RATIO - 1e-9
                    && real(common) / real(*cells) <= limit + 1e-9
            };
            (1..before)
                .filter(fits)
                .min_by(|a, b| away(a).total_cmp(&away(b)))
        };
        // The first grid must allow a second one, if two fit.
        let best = near(allowed / MIN_RATIO.powi(i32::from(left))).or_else(|| near(allowed));
        let Some(best) = best else { break };
        chosen.push(real(common) / real(best));
        before = best;
    }
    chosen
}

/// Returns the diameter of the smallest disc or sphere in the water \[m\].
fn smallest_diameter(scene: &Scene) -> Option<f64> {
    let bodies = scene.bodies.iter().map(|body| body.radius);
    let grains = scene.grains.iter().filter_map(|g| g.radii).map(|r| r.0);
    let smallest = bodies.chain(grains).fold(f64::INFINITY, f64::min);
    smallest.is_finite().then_some(2.0 * smallest)
}

/// Returns `true` if a seepage has edges that no cells resolve: edges of structures and of imposed heads that end
/// within a face, where the velocity is singular; ends of drains and limits of zones within a cell; and water
/// tables, which end in a cell of a seepage face, or are as thick as a tenth of a cell where the ground has no
/// suction.
fn has_edges(seepage: &Seepage, dimension: usize) -> bool {
    let ends = seepage.patches.iter().any(|patch| {
        let across = (0..dimension).filter(|axis| *axis != patch.face.axis());
        let mut partial = across.map(|a| patch.from[a] > 0 || patch.to[a] < seepage.cells[a]);
        patch.condition.holds() && partial.any(|partial| partial)
    });
    let in_air = |condition: &Condition| matches!(condition, Condition::SeepageFace { .. });
    let written = &seepage.written;
    let limited =
        |zone: &Zone| zone.region.is_some() || zone.polygon.is_some() || zone.raster.is_some();
    let dry = (written.unsaturated.as_ref())
        .is_some_and(|soil| matches!(soil.retention, Retention::SaturatedOnly(_)));
    let drained = seepage.drains.iter().any(|drain| drain.condition.holds());
    !seepage.solids.is_empty()
        || ends
        || drained
        || dry
        || seepage.conditions().any(|condition| in_air(&condition))
        || written.zones.iter().any(limited)
}

/// Returns the formal order of the method: 2; or 1 if surfaces of bodies are staircases or partly covered cells, or
/// if water flows or seeps round edges or the tip of a pipe, where stress or velocity is singular.
#[must_use]
pub fn formal_order(scene: &Scene) -> f64 {
    if let Some(seepage) = &scene.seepage {
        let edges = has_edges(seepage, scene.grid.dimension) || seepage.piping.is_some();
        return if edges { 1.0 } else { 2.0 };
    }
    let stairs = match &scene.coupling {
        Some(Coupling::BounceBack(links)) => links.scheme == Scheme::HalfWay,
        Some(Coupling::PartiallySaturated(_)) => true,
        None => false,
    };
    let edges = scene.structures.iter().any(|s| s.stops.water());
    if stairs && scene.has_solids() || edges {
        1.0
    } else {
        2.0
    }
}

/// Returns the case with all automatic choices of the program stated, and without fields for ParaView.
///
/// # Errors
/// If the plan is not that of a case, [`Error::Internal`].
pub fn with_choices_stated(plan: &Plan) -> Result<Value, Error> {
    let wrong = |e: serde_json::Error| Error::Internal(format!("the case as planned: {e}"));
    let mut tree: Value = serde_json::from_str(&plan.case_text).map_err(wrong)?;
    let scene = &plan.scene;
    let Some(case) = tree.as_object_mut() else {
        return Err(Error::Internal("the case is not a JSON object".into()));
    };
    case.remove("accuracy");
    case.insert("output".into(), json!({}));
    if let Some(law) = &scene.chosen.law {
        case.insert("contact".into(), serde_json::to_value(law).map_err(wrong)?);
    }
    if let Some(coupling) = &scene.coupling {
        let mut coupling = coupling.clone();
        if let (Coupling::PartiallySaturated(cells), Some(flow)) = (&mut coupling, &scene.flow) {
            cells.solid_operator = Some(flow.solid_operator(cells));
        }
        let coupling = serde_json::to_value(coupling).map_err(wrong)?;
        case.insert("coupling".into(), coupling);
    }
    tree["domain"]["spacing"] = scene.grid.spacing.into();
    if let Some(size) = &scene.chosen.size {
        tree["domain"]["size"] = json!(size);
    }
    if let Some(domain) = tree["domain"].as_object_mut() {
        domain.remove("slab_bounds");
    }
    if let Some(flow) = &scene.flow {
        let lbm = &mut tree["fluid"]["lattice_boltzmann"];
        lbm["collision"] = serde_json::to_value(flow.models.collision).map_err(wrong)?;
        lbm["lattice"] = match flow.models.lattice {
            Lattice::D2Q9 => "d2q9",
            Lattice::D3Q19 => "d3q19",
            Lattice::D3Q27 => "d3q27",
        }
        .into();
        lbm["turbulence"] = match flow.models.turbulence {
            Some(model) => serde_json::to_value(model).map_err(wrong)?,
            None => "none".into(),
        };
        lbm["storage"] = serde_json::to_value(flow.storage).map_err(wrong)?;
        lbm["arithmetic"] = serde_json::to_value(flow.arithmetic).map_err(wrong)?;
        if flow.fixed_by == "accuracy" {
            lbm["relaxation_time"] = flow.relaxation_time.into();
        }
    }
    if scene.seepage.is_some() {
        let interval = plan.clock.solid_steps_per_step;
        tree["fluid"]["darcy"]["coupling_interval"] = interval.into();
    }
    Ok(tree)
}

/// Returns the stated case on cells that are `ratio` times as large.
#[must_use]
pub fn on_cells(stated: &Value, plan: &Plan, ratio: f64, scaling: Scaling) -> Value {
    let mut tree = stated.clone();
    let (clock, scene) = (&plan.clock, &plan.scene);
    if let Some(seepage) = refinable_seepage(scene) {
        tree["fluid"]["darcy"]["grid"] = seepage_grid(seepage, scene.grid.dimension, ratio);
        let soil = seepage.written.unsaturated.as_ref();
        if let Some(transient) = soil.and_then(|soil| soil.transient.as_ref()) {
            let error = transient.content_error * ratio * ratio;
            tree["fluid"]["darcy"]["unsaturated"]["transient"]["content_error"] = error.into();
            // A step ends at a result at the latest: the time between results changes with the cells.
            let steps = real(clock.steps);
            let number = (steps / ratio).round().max(1.0);
            tree["time"]["solid_time_step"] = (clock.solid_time_step * steps / number).into();
            tree["time"]["end"] = (clock.time_step * steps).into();
        }
        return tree;
    }
    tree["domain"]["spacing"] = (scene.grid.spacing * ratio).into();
    let factor = scaling.of_time(ratio);
    with_time_step(&mut tree, plan, factor);
    if let Some(change) = tree.pointer_mut("/time/warm_up/fluid_only/relative_change")
        && let Some(number) = change.as_f64()
    {
        // The field is a relative change over a hundred steps.
        *change = (number * factor).min(0.5).into();
    }
    if let Some(steps) = tree.pointer_mut("/time/solid_steps_per_fluid_step")
        && steps.is_number()
    {
        // The solid time step is kept.
        let number = f64::from(clock.solid_steps_per_step) * factor;
        *steps = whole(number.ceil().max(1.0)).into();
    }
    tree
}

/// Returns the `grid` of a seepage in a case with cells `ratio` times as large.
pub(super) fn seepage_grid(seepage: &Seepage, dimension: usize, ratio: f64) -> Value {
    let numbers = |of: &dyn Fn(usize) -> f64| (0..dimension).map(of).collect::<Vec<f64>>();
    if seepage.is_graded() {
        let widths = |a: usize| json!({"widths": rescaled_widths(&seepage.axis(a), ratio)});
        let widths: Vec<Value> = (0..dimension).map(widths).collect();
        return json!({
            "from": numbers(&|a| seepage.origin[a]),
            "to": numbers(&|a| seepage.axis(a).end()),
            "spacing": widths,
        });
    }
    let to = |a: usize| real(seepage.cells[a]).mul_add(seepage.spacing[a], seepage.origin[a]);
    let cells: Vec<usize> = (0..dimension)
        .map(|a| whole((real(seepage.cells[a]) / ratio).round()))
        .collect();
    json!({"from": numbers(&|a| seepage.origin[a]), "to": numbers(&to), "cells": cells})
}

/// Sets a time step that is about `factor` times that of the plan and divides the same end time.
pub(super) fn with_time_step(tree: &mut Value, plan: &Plan, factor: f64) {
    let clock = &plan.clock;
    let steps = real(clock.steps);
    let number = (steps / factor).round().max(1.0);
    let lbm = &mut tree["fluid"]["lattice_boltzmann"];
    if let Some(lbm) = lbm.as_object_mut() {
        for field in ["relaxation_time", "reference_velocity", "lattice_velocity"] {
            lbm.remove(field);
        }
    }
    lbm["time_step"] = (clock.time_step * (steps / number)).into();
    tree["time"]["end"] = (clock.time_step * steps).into();
}

/// Checks that the case can be run on other cells.
///
/// # Errors
/// If the case cannot be run on other cells; the error contains the field and a remedy.
pub fn check(stated: &Value) -> Result<(), Error> {
    let path = "fluid.lattice_boltzmann.initial";
    let initial = &stated["fluid"]["lattice_boltzmann"]["initial"];
    if let Ok(Initial::File { .. }) = serde_json::from_value(initial.clone()) {
        return Err(Error::Case(vec![Problem::error(
            path,
            initial.to_string(),
            "a field from a file has one spacing, but an estimate runs several",
            "start from another initial state, or warm up the fluid",
        )]));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_leave_whole_cells_and_are_near_the_wanted_ones() {
        for (cells, number) in [
            (40, 2),
            (100, 2),
            (24, 2),
            (6, 2),
            (4, 2),
            (3, 2),
            (2, 1),
            (1, 0),
        ] {
            let found = coarser_ratios(cells, 1.8, f64::INFINITY, 2);
            assert_eq!(found.len(), number, "{cells}: {found:?}");
            let mut before = 1.0;
            for ratio in found {
                let coarse = real(cells) / ratio;
                assert!((coarse - coarse.round()).abs() < 1e-9, "{cells} by {ratio}");
                assert!(ratio / before >= MIN_RATIO - 1e-9, "{cells}: {ratio}");
                before = ratio;
            }
        }
        // 40, 22, 12 cells: 1.82 and 1.83. They cost 0.09 and 0.008 of the case in 2-D.
        let found = coarser_ratios(40, 1.8, f64::INFINITY, 2);
        assert_eq!(found, [40.0 / 22.0, 40.0 / 12.0]);
        // A body of eight cells keeps four of them, one of six cells allows one grid, one of five none.
        let found = coarser_ratios(40, 1.8, 2.0, 2);
        assert!(found.len() == 2 && found[1] <= 2.0, "{found:?}");
        let found = coarser_ratios(40, 1.8, 1.5, 2);
        assert!(found.len() == 1 && found[0] <= 1.5, "{found:?}");
        assert!(coarser_ratios(40, 1.8, 1.25, 2).is_empty());
    }

    #[test]
    fn a_grid_that_failed_is_replaced_by_one_between() {
        let none = f64::INFINITY;
        let near = |found: Option<f64>, cells: f64, of: f64| {
            assert!((found.unwrap() - of / cells).abs() < 1e-12, "{found:?}");
        };
        // Of 40, 22 and 12 cells, 12 fail: ratios from 2.36 to 3.33 are possible, their middle is 2.82, and 14
        // cells give 2.86.
        let usable = [1.0, 40.0 / 22.0];
        near(
            common_divisor_grid(40, 1.8, none, &usable, &[40.0 / 12.0]),
            14.0,
            40.0,
        );
        // Next 15 cells; 17 are within a ratio of 1.3 of 22, and 29 are between those that ran. The finer grid is
        // the last choice.
        let mut failed = vec![40.0 / 14.0, 40.0 / 12.0];
        near(
            common_divisor_grid(40, 1.8, none, &usable, &failed),
            15.0,
            40.0,
        );
        failed[0] = 40.0 / 16.0;
        near(
            common_divisor_grid(40, 1.8, none, &usable, &failed),
            29.0,
            40.0,
        );
        failed[0] = 40.0 / 29.0;
        near(
            common_divisor_grid(40, 1.8, none, &usable, &failed),
            60.0,
            40.0,
        );
        let usable = [2.0 / 3.0, 1.0, 40.0 / 22.0];
        assert_eq!(common_divisor_grid(40, 1.8, none, &usable, &failed), None);
        // All coarser ones failed: 26 cells lie between the ratios 1.3 and 1.82.
        let failed = [40.0 / 22.0, 40.0 / 12.0];
        near(
            common_divisor_grid(40, 1.8, none, &[1.0], &failed),
            26.0,
            40.0,
        );
        // The finer one failed: the new one is coarser than all.
        let usable = [1.0, 40.0 / 22.0];
        near(
            common_divisor_grid(40, 1.8, none, &usable, &[2.0 / 3.0]),
            12.0,
            40.0,
        );
        // If a body requires its cells, one grid between the others.
        near(
            common_divisor_grid(40, 1.8, 2.0, &usable, &[2.0 / 3.0]),
            29.0,
            40.0,
        );
    }
}
