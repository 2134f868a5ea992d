//! Remedies for a grain that left through an open face, as changes of the case.

use base::error::Error;
use case::geometry::{Extent, Face, Vector};
use case::observe::{Action, Region, When};
use dem::escape::Escape;
use plan::Plan;
use serde_json::{Value, json};

/// Returns an error of a step that began at `time` \[s\], with a remedy if the error reports a grain
/// that left the box.
pub(super) fn with_remedy(error: Error, plan: &Plan, step: u64, time: f64) -> Error {
    let Error::Numerical(text) = &error else {
        return error;
    };
    let Some(escape) = Escape::in_text(text) else {
        return error;
    };
    let scene = &plan.scene;
    let face = Face::ALL[2 * escape.axis + usize::from(escape.upper)];
    let name = name_of(face);
    let mut closed: Vec<Face> = scene.walls.iter().filter_map(|wall| wall.face).collect();
    let remedy = if closed.contains(&face) {
        format!(
            "the grain passed through the wall of the face {name} within one solid step: use a smaller solid \
             time step or a stiffer contact"
        )
    } else {
        closed.push(face);
        closed.sort_by_key(|face| face.index());
        let close = format!("close the face with \"box_walls\": {}", json!(closed));
        if escape.grain < scene.first_grain() {
            format!("{close} (a named body or block is never removed by a region)")
        } else {
            let region = region_at(face, plan);
            format!("remove such grains with a region, \"regions\": [{region}], or {close}")
        }
    };
    Error::Numerical(format!(
        "{text}, in step {} at t = {time:.6e} s; {remedy}",
        step + 1
    ))
}

fn name_of(face: Face) -> String {
    json!(face).as_str().unwrap_or_default().to_owned()
}

/// Returns a region that removes grains with their centre in the cells at a face or beyond it, in
/// addition to the regions of the case.
fn region_at(face: Face, plan: &Plan) -> Value {
    let grid = &plan.scene.grid;
    let mut from = vec![0.0; grid.dimension];
    let mut to = grid.size[..grid.dimension].to_vec();
    let axis = face.axis();
    if face.index().is_multiple_of(2) {
        to[axis] = grid.spacing;
    } else {
        from[axis] = grid.size[axis] - grid.spacing;
    }
    let mut name = format!("out_{}", name_of(face));
    while plan.scene.regions.iter().any(|region| region.name == name) {
        name.push('_');
    }
    let region = Region {
        name,
        region: Extent {
            from: Vector(from),
            to: Vector(to),
        },
        action: Action::Remove { when: When::Centre },
    };
    json!(region)
}
