//! The case with the closed ends of its seepage moved outwards.
//!
//! The ends move to three leakage lengths from the imposed heads ([`plan::ends`]), and at least to twice their
//! distance. Everything that has a position moves with the lower end: patches, zones, planes, structures and probes.
//! Patches, boxes and layers that reach an end reach the new one. A case without ends, or with a field that this module
//! does not know to be a position, cannot be moved.

use super::grids;
use base::number::whole;
use darcy::GridAxis;
use plan::Plan;
use plan::ends::FarEnds;
use serde_json::{Value, json};

/// Lists and objects in which all positions are known to this module.
const SECTIONS: [&str; 4] = [
    "/fluid/darcy/boundaries",
    "/fluid/darcy/zones",
    "/fluid/darcy/enclosure",
    "/structures",
];
/// Fields whose value is a point.
const POINTS: [&str; 6] = ["from", "to", "point", "position", "centre", "origin"];
/// Fields whose value is a vector or a list without a position.
const FREE: [&str; 2] = ["normal", "cells"];

/// Positions along an axis before and after the ends move.
struct Shift {
    axis: usize,
    dimension: usize,
    /// Old ends \[m\].
    old: [f64; 2],
    /// Displacement of all positions \[m\].
    by: f64,
    new: [f64; 2],
}

impl Shift {
    /// Returns the new position of a coordinate; `stretches` is `true` if it belongs to an extent that may reach an
    /// end.
    fn position(&self, x: f64, stretches: bool) -> f64 {
        let near = 1e-9 * (self.old[1] - self.old[0]);
        if stretches && x <= self.old[0] + near {
            self.new[0]
        } else if stretches && x >= self.old[1] - near {
            self.new[1]
        } else {
            x + self.by
        }
    }

    /// Moves the positions of an object or a list; `None` if it contains numbers of unknown meaning.
    fn walk(&self, value: &mut Value) -> Option<()> {
        match value {
            Value::Object(map) => {
                let extent = map.contains_key("from") && map.contains_key("to");
                // Coordinates along one axis: of a layer, a plane or a prism.
                let own = match map.get("axis").and_then(Value::as_str) {
                    Some(name) => ["x", "y", "z"].iter().position(|axis| *axis == name),
                    None => Some(self.dimension - 1),
                };
                let prism = map.get("points").is_some_and(Value::is_array);
                if prism && self.dimension == 3 {
                    return None;
                }
                for (name, child) in map.iter_mut() {
                    let point = POINTS.contains(&name.as_str());
                    match child {
                        Value::Number(number) if point => {
                            if own == Some(self.axis) {
                                let x = self.position(number.as_f64()?, extent);
                                *child = json!(x);
                            }
                        }
                        Value::Array(list) if point => self.point(list, extent)?,
                        Value::Array(list) if name == "points" => {
                            for corner in list.iter_mut() {
                                self.point(corner.as_array_mut()?, false)?;
                            }
                        }
                        Value::Array(_) if FREE.contains(&name.as_str()) => {}
                        other => self.walk(other)?,
                    }
                }
                Some(())
            }
            Value::Array(list) if list.iter().all(Value::is_object) => {
                list.iter_mut().try_for_each(|child| self.walk(child))
            }
            Value::Array(_) => None,
            _ => Some(()),
        }
    }

    fn point(&self, list: &mut [Value], extent: bool) -> Option<()> {
        let number = list.get_mut(self.axis)?;
        *number = json!(self.position(number.as_f64()?, extent));
        Some(())
    }
}

/// Returns `true` if a mesh in the tree has no `origin`: its position is then unknown.
fn has_a_fixed_mesh(value: &Value) -> bool {
    match value {
        Value::Object(map) => {
            let fixed = |mesh: &Value| mesh.get("origin").is_none_or(Value::is_null);
            map.get("mesh").is_some_and(fixed) || map.values().any(has_a_fixed_mesh)
        }
        Value::Array(list) => list.iter().any(has_a_fixed_mesh),
        _ => false,
    }
}

/// Moves the ends in a case with stated cells, and returns a description of the change; `None` if the case has no
/// closed ends beyond imposed heads, or cannot be moved.
pub(super) fn move_ends(case: &mut Value, plan: &Plan) -> Option<String> {
    let scene = &plan.scene;
    let seepage = grids::refinable_seepage(scene)?;
    let far = FarEnds::find(scene, seepage)?;
    let (axis, dimension) = (far.axis, scene.grid.dimension);
    if SECTIONS
        .iter()
        .any(|path| case.pointer(path).is_some_and(has_a_fixed_mesh))
    {
        return None;
    }
    let rasters = case.pointer("/fluid/darcy/zones")?.as_array()?;
    if rasters
        .iter()
        .any(|zone| zone.get("raster").is_some_and(|raster| !raster.is_null()))
    {
        return None;
    }
    let cells = seepage.axis(axis);
    let stated = ["from", "to", "cells"].map(|field| {
        let list = case.pointer(&format!("/fluid/darcy/grid/{field}"));
        list.is_some_and(Value::is_array)
    });
    if stated.contains(&false) {
        case["fluid"]["darcy"]["grid"] = grids::seepage_grid(seepage, dimension, 1.0);
    }
    let grid = case.pointer("/fluid/darcy/grid")?.clone();
    let at = |field: &str| grid.get(field)?.get(axis)?.as_f64();
    let (low, high) = (at("from")?, at("to")?);
    // The length is a whole number of cells of the domain, and of equal cells.
    let unit = match (seepage.is_graded(), at("cells")) {
        (true, _) => scene.grid.spacing,
        (false, cells) => ((high - low) / cells?).max(scene.grid.spacing),
    };
    let added = far.added().map(|length| unit * (length / unit).ceil());
    let size = scene.grid.size[axis] + added[0] + added[1];
    let shift = Shift {
        axis,
        dimension,
        old: [low, high],
        by: added[0],
        new: [low, high + added[0] + added[1]],
    };
    for path in SECTIONS {
        if let Some(section) = case.pointer_mut(path) {
            shift.walk(section)?;
        }
    }
    for probe in case
        .pointer_mut("/probes")
        .and_then(Value::as_array_mut)
        .into_iter()
        .flatten()
    {
        shift.walk(probe.get_mut("at")?)?;
    }
    case["domain"]["size"][axis] = json!(size);
    case["fluid"]["darcy"]["grid"]["to"][axis] = json!(shift.new[1]);
    if seepage.is_graded() {
        let widths = extended(&cells, added);
        case["fluid"]["darcy"]["grid"]["spacing"][axis] = json!({"widths": widths});
    } else {
        let cells = at("cells")?;
        let number = whole(((shift.new[1] - low) * cells / (high - low)).round());
        case["fluid"]["darcy"]["grid"]["cells"][axis] = json!(number);
    }
    let distances = far
        .distances
        .iter()
        .zip(added)
        .filter_map(|(distance, added)| {
            distance.map(|distance| format!("{distance:.4} to {:.4} m", distance + added))
        });
    let name = ["x", "y", "z"][axis];
    let moved = distances.collect::<Vec<_>>().join(" and ");
    Some(format!("along {name}, {moved} from the heads"))
}

/// Returns the widths of the cells of an axis with these lengths added at its ends, in cells like the last ones there.
fn extended(cells: &GridAxis<'_>, added: [f64; 2]) -> Vec<f64> {
    let of_end = |length: f64, width: f64| {
        let number = (length / width - 1e-6).ceil().max(0.0);
        vec![length / number; whole(number)]
    };
    let own = (0..cells.cells).map(|cell| cells.width(cell));
    let before = of_end(added[0], cells.width(0));
    let behind = of_end(added[1], cells.width(cells.cells - 1));
    before.into_iter().chain(own).chain(behind).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use case::Document;
    use std::path::Path;

    /// Returns the plan of a dam of 20 m on 4 m of gravel under a cover of 2 m, with ends at a distance `beyond` from
    /// the heads; the leakage length is 44.7 m.
    fn plan(beyond: f64) -> Plan {
        let length = 20.0 + 2.0 * beyond;
        let case = json!({
            "domain": {"size": [length, 6], "spacing": 1},
            "gravity": [0, -9.81],
            "fluid": {"darcy": {
                "density": 1000, "viscosity": 1e-3,
                "zones": [
                    {"name": "gravel", "permeability": {"hydraulic_conductivity": 1e-3}},
                    {"name": "cover", "region": {"layer": {"from": 4}},
                     "permeability": {"hydraulic_conductivity": 4e-6}}
                ],
                "boundaries": [
                    {"name": "up", "face": "y_max", "patch": {"from": [0, 0], "to": [beyond, 0]},
                     "condition": {"head": {"value": 10}}},
                    {"name": "down", "face": "y_max",
                     "patch": {"from": [beyond + 20.0, 0], "to": [length, 0]},
                     "condition": {"head": {"value": 6}}}
                ]
            }},
            "probes": [{"name": "under", "every": 1,
                        "at": {"section": {"axis": "x", "position": beyond + 10.0}}}],
            "time": {"end": 1}
        });
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"))
    }

    #[test]
    fn ends_move_to_three_leakage_lengths_with_all_that_lies_between() {
        let plan = plan(40.0);
        let mut case = grids::with_choices_stated(&plan).unwrap();
        let change = move_ends(&mut case, &plan).unwrap();
        assert!(change.contains("40.0000 to 135.0000 m"), "{change}");
        assert_eq!(case["domain"]["size"][0], json!(290.0));
        assert_eq!(case["fluid"]["darcy"]["grid"]["cells"], json!([290, 6]));
        let patch = |n: usize, end: &str| {
            case["fluid"]["darcy"]["boundaries"][n]["patch"][end][0]
                .as_f64()
                .unwrap()
        };
        assert_eq!([patch(0, "from"), patch(0, "to")], [0.0, 135.0]);
        assert_eq!([patch(1, "from"), patch(1, "to")], [155.0, 290.0]);
        assert_eq!(case["probes"][0]["at"]["section"]["position"], json!(145.0));
        let zone = &case["fluid"]["darcy"]["zones"][1]["region"]["layer"]["from"];
        assert_eq!(zone.as_f64(), Some(4.0));
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        let moved = Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
        assert!(moved.warnings.iter().all(|p| p.path != "domain.size[0]"));
    }

    #[test]
    fn ends_far_away_move_to_twice_their_distance() {
        let plan = plan(140.0);
        let mut case = grids::with_choices_stated(&plan).unwrap();
        let change = move_ends(&mut case, &plan).unwrap();
        assert!(change.contains("140.0000 to 280.0000 m"), "{change}");
    }
}
