//! Openings of water with a free surface: conditions outside, and features that do not work.

use super::FreeSurface;
use crate::scene::boundaries::ScenePatch;
use crate::scene::findings::{Findings, LATTICE_PATH, number};
use crate::scene::grid::Grid;
use base::error::Remedy;
use lbm::boundary::{Condition, ImposedSpeed, Strength, SurfaceKind, WithSurface};
use serde::Serialize;

/// Minimum number of cells over the depth of an inflow: with fewer, the surface lies within a cell.
const MIN_CELLS: f64 = 2.0;
/// Number of cells over the depth of an inflow below which the plan warns.
const FEW_CELLS: f64 = 8.0;

/// Water or air outside an opening.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Opening {
    /// Name of the boundary.
    pub name: String,
    /// JSON path of the field that determines the condition outside.
    pub path: String,
    /// Height of the lower side of the opening above the lowest point of the domain \[m\].
    pub floor: f64,
    /// Lowest height above the lowest point of the domain to which water falls through the opening \[m\]; none for
    /// an inflow.
    pub lowest: Option<f64>,
    /// Largest height of the energy line outside above the lowest point of the domain \[m\]; none without water.
    pub head: Option<f64>,
    /// Depth of the inflow \[m\]: that of a stream, the initial or the critical depth of a discharge, or the largest
    /// depth below a level.
    pub depth: Option<f64>,
    /// Height of the initial water in front of the opening above the lowest point of the domain \[m\]; that of the
    /// lower side of the opening without water.
    pub inside: f64,
    /// Froude number U/(g depth)^½ of the inflow; none if it follows from the flow.
    pub froude: Option<f64>,
}

impl Opening {
    /// Returns the lowest and the highest level outside \[m\] above the lowest point of the domain; none if the opening
    /// has no level.
    #[must_use]
    pub fn levels(&self) -> Option<[f64; 2]> {
        match (self.lowest, self.head, self.froude) {
            (Some(low), Some(high), None) => Some([low, high]),
            _ => None,
        }
    }

    /// Returns a sentence about the opening, with the depth in cells of this spacing \[m\].
    #[must_use]
    pub fn describe(&self, spacing: f64) -> String {
        let mut text = format!("`{}`: ", self.name);
        match self.depth {
            Some(depth) => {
                let cells = (depth / spacing).round();
                text += &format!("depth {} m, {} cells", number(depth), number(cells));
            }
            None => text += "air outside",
        }
        if let Some(froude) = self.froude {
            text += &format!(", Froude number {}", number(froude));
        }
        text
    }
}

/// Refuses openings that need a free surface in a case without one.
pub(super) fn refuse_without_surface(patches: &[Vec<ScenePatch>; 6], findings: &mut Findings) {
    for patch in patches.iter().flatten() {
        let only = patch.condition.model().with_surface() == WithSurface::Only;
        if let (Some(n), true) = (patch.index, only) {
            findings.error(
                &format!("{LATTICE_PATH}.boundaries[{n}].condition"),
                format!(
                    "{} needs water with a free surface, but this case has none",
                    patch.condition.name()
                ),
                "add `surface`, or use velocity, pressure or outflow",
            );
        }
    }
}

/// Refuses boundaries that do not work with a free surface.
pub(super) fn refuse(
    patches: &[Vec<ScenePatch>; 6],
    is_whole: impl Fn(usize) -> bool,
    findings: &mut Findings,
) {
    refuse_parts_of_slip(patches, findings);
    for patch in patches.iter().flatten() {
        let model = patch.condition.model();
        let Some(n) = patch.index else { continue };
        let path = format!("{LATTICE_PATH}.boundaries[{n}]");
        if model.with_surface() == WithSurface::Never {
            let (reason, remedy) = if let Condition::Velocity(_) = patch.condition {
                (
                    "an opening that absorbs sound does not work with a free surface, which already releases the \
                     pressure",
                    "remove `sound`",
                )
            } else if model.passes_water() {
                (
                    "this opening does not work with a free surface, because its condition ignores the water \
                     level",
                    "use level, discharge, outfall or velocity",
                )
            } else {
                (
                    "a wall that moves does not work with a free surface yet",
                    "use no_slip or free_slip",
                )
            };
            findings.error(&format!("{path}.condition"), reason, remedy);
        } else if !is_whole(n) && model.kind().surface == SurfaceKind::Symmetry {
            findings.error(
                &format!("{path}.patch"),
                "free slip on a part of a face does not work with a free surface yet",
                Remedy::take_out(
                    "remove the patch, so that the whole face has free slip",
                    &format!("{path}.patch"),
                ),
            );
        }
    }
}

/// Refuses a free-slip face with another condition on a part of it.
fn refuse_parts_of_slip(patches: &[Vec<ScenePatch>; 6], findings: &mut Findings) {
    for face in patches {
        let [whole, parts @ ..] = face.as_slice() else {
            continue;
        };
        let slips = whole.condition.model().kind().surface == SurfaceKind::Symmetry;
        let other = parts.iter().find_map(|part| part.index);
        if let (true, Some(n)) = (slips, other) {
            findings.error(
                &format!("{LATTICE_PATH}.boundaries[{n}].patch"),
                format!(
                    "`{}` has free slip on the whole face, and a patch with another condition on this face does \
                     not work with a free surface yet",
                    whole.name
                ),
                "use a no-slip wall for the rest of the face, or move the patch to another face",
            );
        }
    }
}

/// Returns the openings of a surface; reports those that do not work.
pub(super) fn resolve(
    surface: &FreeSurface,
    grid: &Grid,
    (patches, gravity): (&[Vec<ScenePatch>; 6], [f64; 3]),
    findings: &mut Findings,
) -> Vec<Opening> {
    let open = patches.iter().flatten().filter(|patch| {
        let model = patch.condition.model();
        model.passes_water() && model.with_surface() != WithSurface::Never
    });
    let found = open.map(|patch| one(surface, grid, (patch, gravity), findings));
    found.collect()
}

/// Returns the opening of a patch, or reports why it does not work with a free surface.
fn one(
    surface: &FreeSurface,
    grid: &Grid,
    (patch, gravity): (&ScenePatch, [f64; 3]),
    findings: &mut Findings,
) -> Opening {
    let up = surface.axis;
    let height = |coordinate: f64| surface.above(coordinate);
    let ends = patch.ends[up].map(|cell| height(cell * grid.spacing));
    let mut floor = ends[0].min(ends[1]);
    let mut top = ends[0].max(ends[1]);
    if patch.face.axis() == up {
        let face = if patch.face.is_max() {
            grid.size[up]
        } else {
            0.0
        };
        (floor, top) = (height(face), height(face));
    }
    let model = patch.condition.model();
    let mut opening = Opening {
        name: patch.name.clone(),
        path: patch.path("value").unwrap_or_default(),
        floor,
        lowest: Some(floor),
        head: None,
        depth: None,
        inside: floor + initial_depth(surface, grid, patch),
        froude: None,
    };
    let sideways = patch.face.axis() != up;
    if let Some((levels, field)) = model.levels() {
        opening.path = patch.path(field).unwrap_or_default();
        check_level(
            surface,
            grid,
            (patch, gravity),
            (levels, &opening.path),
            findings,
        );
        let levels = levels.map(height);
        opening.lowest = Some(levels[0].min(levels[1]).max(floor));
        let highest = levels[0].max(levels[1]);
        opening.head = Some(highest);
        opening.depth = Some((highest - floor).max(0.0));
    } else if let Some(discharge) = model.discharge() {
        opening.lowest = None;
        check_side(surface, patch, &opening.path, findings);
        if discharge > 0.0 && surface.gravity > 0.0 {
            let width = (0..grid.dimension)
                .filter(|a| *a != up && *a != patch.face.axis())
                .map(|a| (patch.ends[a][1] - patch.ends[a][0]) * grid.spacing)
                .product::<f64>();
            let unit = discharge / width;
            let critical = (unit * unit / surface.gravity).cbrt();
            // Below deep water the inflow is as deep as the water, else critical.
            let depth = initial_depth(surface, grid, patch).max(critical);
            let speed = unit / depth;
            opening.depth = Some(depth);
            opening.froude = Some(speed / (surface.gravity * depth).sqrt());
            opening.head = Some(floor + depth + speed * speed / (2.0 * surface.gravity));
            check_depth(grid, (&opening, depth), findings);
        }
    } else if let (Some(ImposedSpeed { field, value, .. }), Strength::Velocity) =
        (model.speed(), model.kind().strength)
    {
        opening.path = patch.path(field).unwrap_or_default();
        opening.lowest = None;
        let velocity_head = if surface.gravity > 0.0 {
            value * value / (2.0 * surface.gravity)
        } else {
            0.0
        };
        opening.head = Some(top + velocity_head);
        if sideways && top > floor {
            opening.depth = Some(top - floor);
            if surface.gravity > 0.0 {
                opening.froude = Some(value / (surface.gravity * (top - floor)).sqrt());
            }
            check_depth(grid, (&opening, top - floor), findings);
        }
    }
    opening
}

/// Returns the initial depth of the water above the lower side of an opening \[m\].
fn initial_depth(surface: &FreeSurface, grid: &Grid, patch: &ScenePatch) -> f64 {
    let (up, h) = (surface.axis, grid.spacing);
    let mut at: [f64; 3] = std::array::from_fn(|a| 0.5 * (patch.ends[a][0] + patch.ends[a][1]) * h);
    let normal = patch.face.axis();
    at[normal] = if patch.face.is_max() {
        grid.size[normal] - 0.5 * h
    } else {
        0.5 * h
    };
    at[up] = if surface.rises {
        (patch.ends[up][0] + 0.5) * h
    } else {
        (patch.ends[up][1] - 0.5) * h
    };
    match surface.depth(at) {
        depth if depth > 0.0 => depth + 0.5 * h,
        _ => 0.0,
    }
}

/// Checks that an opening with a level lies on a vertical side, and that there is gravity.
fn check_side(surface: &FreeSurface, patch: &ScenePatch, path: &str, findings: &mut Findings) {
    if surface.gravity <= 0.0 {
        findings.error(
            path,
            format!("without gravity {} has no depth", patch.condition.name()),
            "add `gravity`, or impose a velocity",
        );
    } else if patch.face.axis() == surface.axis {
        findings.error(
            path,
            format!(
                "{} works on lateral faces only, but the face {} is horizontal",
                patch.condition.name(),
                patch.face.name()
            ),
            "use a lateral face, or velocity or outfall on this face",
        );
    }
}

/// Checks the levels of an opening.
fn check_level(
    surface: &FreeSurface,
    grid: &Grid,
    (patch, gravity): (&ScenePatch, [f64; 3]),
    (levels, path): ([f64; 2], &str),
    findings: &mut Findings,
) {
    check_side(surface, patch, path, findings);
    let size = grid.size[surface.axis];
    if !(levels[0] >= 0.0 && levels[1] <= size) {
        findings.error(
            path,
            format!(
                "a level lies outside the domain, which goes from 0 to {} m along {}",
                number(size),
                ["x", "y", "z"][surface.axis]
            ),
            format!("use 0 to {} m", number(size)),
        );
    }
    let across = (0..grid.dimension).find(|a| *a != surface.axis && *a != patch.face.axis());
    if let Some(across) = across.filter(|a| gravity[*a] != 0.0) {
        findings.error(
            path,
            format!(
                "gravity has a component along {}, normal to this opening, so that the water outside would not \
                 be level",
                ["x", "y", "z"][across]
            ),
            "rotate the domain so that gravity has no component normal to the opening",
        );
    }
}

/// Refuses an inflow with too few cells over its depth, and warns of one with few.
fn check_depth(grid: &Grid, (opening, depth): (&Opening, f64), findings: &mut Findings) {
    let cells = depth / grid.spacing;
    let reason = format!(
        "the water that enters through `{}` is {} m ({} cells) deep",
        opening.name,
        number(depth),
        number(cells)
    );
    if cells < MIN_CELLS {
        let most = number(depth / MIN_CELLS);
        let remedy = format!("use a spacing of at most {most} m, or deeper water");
        findings.error(&opening.path, reason, remedy);
    } else if cells < FEW_CELLS {
        let most = number(depth / FEW_CELLS);
        let reason = format!("{reason}: the surface is resolved to about one cell");
        let remedy = format!("use a spacing of at most {most} m, or deeper water");
        findings.warn(&opening.path, reason, remedy);
    }
}
