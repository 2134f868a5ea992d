//! Conditions of the flow on the faces of the domain.

use super::aligned_box::AlignedBox;
use super::findings::LATTICE_PATH as PATH;
use super::findings::{Findings, number};
use super::grid::Grid;
use super::profile;
use base::number::{real, whole};
use case::fluid::LatticeBoltzmann;
use case::geometry::Face;
use lbm::boundary::no_slip::NoSlip;
use lbm::boundary::{Condition, Inflow, Opening, Place, Site, Strength, SurfaceKind};
use serde::Serialize;
use std::path::Path;

/// Condition on the cells next to a part of a face.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScenePatch {
    /// Name in the case; that of the face for a default wall.
    pub name: String,
    /// The face.
    pub face: Face,
    /// First cell along each axis; 0 along the normal.
    pub from: [usize; 3],
    /// One past the last cell along each axis; 1 along the normal.
    pub to: [usize; 3],
    /// Lower and upper ends along each axis, in cells: those of its cells, except for an imposed velocity, which
    /// may end within a cell.
    pub ends: [[f64; 2]; 3],
    /// For each axis, lower face first: `true` if the face of the domain is a wall.
    pub walls: [[bool; 2]; 3],
    /// Condition imposed on these cells.
    pub condition: Condition,
    /// Index in the list of boundaries of the case; none for a default wall.
    pub index: Option<usize>,
}

impl ScenePatch {
    /// Returns the range of cells along an axis; empty if a case gives the ends in the wrong order, which is
    /// refused separately.
    #[must_use]
    pub fn cells(&self, axis: usize) -> usize {
        self.to[axis].saturating_sub(self.from[axis])
    }

    /// Returns the JSON path of a field of the condition; none for a default wall.
    #[must_use]
    pub fn path(&self, field: &str) -> Option<String> {
        let name = self.condition.name();
        let path = |n| format!("{PATH}.boundaries[{n}].condition.{name}.{field}");
        self.index.map(path)
    }

    /// Returns the position at which the condition is imposed; `path` is that of its parameters.
    #[must_use]
    pub fn imposed_at<'a>(&self, grid: &Grid, path: &'a str) -> Place<'a> {
        Place {
            site: site(grid, self.face, path, self.walls),
            from: self.from,
            to: self.to,
            ends: self.ends,
            openings: &[],
            bodies_move: false,
        }
    }
}

/// Returns the openings among some patches.
pub fn openings<'a>(patches: impl Iterator<Item = &'a ScenePatch>, grid: &Grid) -> Vec<Opening> {
    let open = patches.filter(|patch| patch.condition.model().passes_water());
    let opening = |patch: &ScenePatch| {
        let (model, place) = (patch.condition.model(), patch.imposed_at(grid, PATH));
        Opening {
            strength: model.kind().strength,
            area: place.area(),
            inflow: model.inflow(&place),
            ramp_time: model.ramp_time(),
        }
    };
    open.map(opening).collect()
}

fn site<'a>(grid: &Grid, face: Face, path: &'a str, walls: [[bool; 2]; 3]) -> Site<'a> {
    Site {
        path,
        face,
        dimension: grid.dimension,
        spacing: grid.spacing,
        cells: grid.cells,
        periodic: grid.periodic,
        walls,
    }
}

/// Returns `true` for each face of the domain that is a wall to the water, including faces without a condition.
fn walls(lbm: &LatticeBoltzmann) -> [[bool; 2]; 3] {
    let mut walls = [[true; 2]; 3];
    for boundary in lbm
        .boundaries
        .iter()
        .filter(|boundary| boundary.patch.is_none())
    {
        let surface = boundary.condition.model().kind().surface;
        walls[boundary.face.axis()][usize::from(boundary.face.is_max())] =
            matches!(surface, SurfaceKind::Wall | SurfaceKind::MovingWall);
    }
    walls
}

/// Returns the patches of every face of the domain.
pub(super) fn faces(
    lbm: &LatticeBoltzmann,
    grid: &Grid,
    directory: &Path,
    findings: &mut Findings,
) -> [Vec<ScenePatch>; 6] {
    let walls = walls(lbm);
    let mut faces = closed(grid, walls);
    let mut named = [false; 6];
    let mut names: Vec<&str> = Vec::new();
    for (n, boundary) in lbm.boundaries.iter().enumerate() {
        let path = format!("{PATH}.boundaries[{n}]");
        let face = boundary.face;
        super::unique(
            &mut names,
            &boundary.name,
            &format!("{path}.name"),
            findings,
        );
        let read = |file: &Path| profile::read(&directory.join(file), grid, face.axis());
        let condition_path = format!("{path}.condition");
        let site = site(grid, face, &condition_path, walls);
        if !has_conditions(grid, face, &format!("{path}.face"), findings) {
            continue;
        }
        let condition = boundary.condition.resolved(&site, &read, findings);
        let patches = &mut faces[face.index()];
        if let Some(extent) = &boundary.patch {
            let whole = ScenePatch {
                name: boundary.name.clone(),
                condition,
                index: Some(n),
                ..closed_face(grid, face, walls)
            };
            let path = format!("{path}.patch");
            let block = tangential(grid, face, extent, &path, findings);
            let patch = part(whole, &block, grid, &path, findings);
            check_overlap(&patch, &patches[1..], &path, findings);
            patches.push(patch);
            continue;
        }
        if std::mem::replace(&mut named[face.index()], true) {
            findings.error(
                &format!("{path}.face"),
                format!("the whole face {} has two conditions", face.name()),
                "keep one of them, or restrict one to a patch",
            );
        }
        let base = &mut patches[0];
        base.name.clone_from(&boundary.name);
        base.condition = condition;
        base.index = Some(n);
    }
    if lbm.surface.is_none() {
        closed_volume(&faces, grid, findings);
    }
    check_cells(&faces, grid, findings);
    faces
}

/// Returns the faces without conditions: walls, except periodic faces.
fn closed(grid: &Grid, walls: [[bool; 2]; 3]) -> [Vec<ScenePatch>; 6] {
    let mut faces: [Vec<ScenePatch>; 6] = Default::default();
    for face in Face::ALL {
        if face.axis() < grid.dimension && !grid.periodic[face.axis()] {
            faces[face.index()].push(closed_face(grid, face, walls));
        }
    }
    faces
}

/// Returns a patch that covers a whole face as a wall without a name.
fn closed_face(grid: &Grid, face: Face, walls: [[bool; 2]; 3]) -> ScenePatch {
    let mut to = grid.cells;
    to[face.axis()] = 1;
    ScenePatch {
        name: face.name().into(),
        face,
        from: [0; 3],
        to,
        ends: to.map(|end| [0.0, real(end)]),
        walls,
        condition: Condition::NoSlip(NoSlip {}),
        index: None,
    }
}

/// Returns `true` if a face can have conditions; otherwise reports a finding.
fn has_conditions(grid: &Grid, face: Face, path: &str, findings: &mut Findings) -> bool {
    if face.axis() >= grid.dimension {
        findings.error(
            path,
            "a 2-D problem does not have this face",
            "remove this condition",
        );
        return false;
    }
    let periodic = grid.periodic[face.axis()];
    if periodic {
        let axis = ["x", "y", "z"][face.axis()];
        findings.error(
            path,
            format!(
                "the domain is periodic along {axis}, so that this face cannot have a condition"
            ),
            format!("remove this condition, or remove {axis} from domain.periodic"),
        );
    }
    !periodic
}

/// Returns the part of a patch of a whole face that lies in a box.
fn part(
    mut patch: ScenePatch,
    block: &AlignedBox,
    grid: &Grid,
    path: &str,
    findings: &mut Findings,
) -> ScenePatch {
    let cut = patch.condition.model().kind().strength == Strength::Velocity;
    for a in (0..grid.dimension).filter(|a| *a != patch.face.axis()) {
        let written = [block.from[a], block.to[a]];
        let within = |cell: f64| whole(cell).min(grid.cells[a]);
        // A cell belongs to a patch if its centre does.
        let mut cells = written.map(|x| within((x / grid.spacing - 0.5).ceil()));
        patch.ends[a] = cells.map(real);
        if cut && written[0] < written[1] {
            // An imposed velocity is weighted by area in cells that the end of its patch cuts.
            let ends = written.map(|x| on_face(x / grid.spacing));
            patch.ends[a] = ends;
            cells = [within(ends[0].floor()), within(ends[1].ceil())];
        }
        [patch.from[a], patch.to[a]] = cells;
        // A box outside the domain is reported where it is read.
        let inside = written[0] < grid.size[a] && written[1] > 0.0;
        if cells[0] >= cells[1] && written[0] < written[1] && inside {
            findings.error(
                path,
                "the patch does not contain the centre of any cell",
                "enlarge the patch, or use a smaller spacing",
            );
        }
    }
    if patch.condition.model().passes_water() && !cut {
        moved(grid, &patch, block, path, findings);
    }
    patch
}

/// Returns a coordinate in cells, moved to a face between cells if it differs from it by rounding.
fn on_face(x: f64) -> f64 {
    if (x - x.round()).abs() < ON_FACE {
        x.round()
    } else {
        x
    }
}

/// Refuses a patch that shares cells with an earlier one.
fn check_overlap(patch: &ScenePatch, others: &[ScenePatch], path: &str, findings: &mut Findings) {
    let shares = |other: &&ScenePatch| {
        (0..3).all(|a| other.from[a] < patch.to[a] && patch.from[a] < other.to[a])
    };
    if let Some(other) = others.iter().find(shares) {
        findings.error(
            path,
            format!("this patch overlaps the patch of `{}`", other.name),
            "separate them, so that they share no cell",
        );
    }
}

/// Distance in cells between an end of a patch and a face between cells below which it counts as on the face.
const ON_FACE: f64 = 1e-6;
/// Fraction of the width of an opening by which an end may be moved to a face between cells without a warning.
const MAX_SHIFT: f64 = 0.02;

/// Warns of an opening whose ends lie between faces of cells, because its width is rounded to whole cells.
fn moved(
    grid: &Grid,
    patch: &ScenePatch,
    written: &AlignedBox,
    path: &str,
    findings: &mut Findings,
) {
    for a in (0..grid.dimension).filter(|a| *a != patch.face.axis()) {
        let ends = [patch.from[a], patch.to[a]].map(|cell| real(cell) * grid.spacing);
        let asked = [written.from[a], written.to[a]];
        let width = asked[1] - asked[0];
        let most = (ends[0] - asked[0]).abs().max((ends[1] - asked[1]).abs());
        if ends[0] < ends[1] && most > MAX_SHIFT * width {
            let axis = ["x", "y", "z"][a];
            findings.warn(
                path,
                format!(
                    "`{}` consists of whole cells: along {axis} it reaches from {} to {} m instead of from {} to \
                     {} m",
                    patch.name,
                    number(ends[0]),
                    number(ends[1]),
                    number(asked[0]),
                    number(asked[1])
                ),
                "place its ends on faces between cells, or use a spacing that divides their coordinates",
            );
        }
    }
}

/// Returns the box of a patch; its extent along the normal has no effect.
fn tangential(
    grid: &Grid,
    face: Face,
    extent: &case::geometry::Extent,
    path: &str,
    findings: &mut Findings,
) -> AlignedBox {
    let mut extent = extent.clone();
    let axis = face.axis();
    if let (Some(from), Some(to)) = (extent.from.0.get_mut(axis), extent.to.0.get_mut(axis)) {
        (*from, *to) = (0.0, grid.size[axis]);
    }
    AlignedBox::resolve(grid, &extent, path, findings)
}

/// Runs the checks that depend on the cells of the patches.
fn check_cells(faces: &[Vec<ScenePatch>; 6], grid: &Grid, findings: &mut Findings) {
    for patch in faces.iter().flatten() {
        if let Some(n) = patch.index {
            let name = patch.condition.name();
            let path = format!("{PATH}.boundaries[{n}].condition.{name}");
            let place = patch.imposed_at(grid, &path);
            patch.condition.model().check(&place, findings);
        }
    }
}

/// Refuses velocities with more inflow than outflow, since the fluid is nearly incompressible.
fn closed_volume(faces: &[Vec<ScenePatch>; 6], grid: &Grid, findings: &mut Findings) {
    let mut inflow = 0.0;
    let mut through = 0.0;
    let mut first: Option<&ScenePatch> = None;
    for patch in faces.iter().flatten() {
        match patch
            .condition
            .model()
            .inflow(&patch.imposed_at(grid, PATH))
        {
            Inflow::None => {}
            Inflow::Any => return,
            Inflow::Mean(normal) => {
                let area = patch.imposed_at(grid, PATH).area();
                inflow += normal * area;
                through += f64::abs(normal * area);
                first = first.or(Some(patch));
            }
        }
    }
    if let Some(patch) = first
        && inflow.abs() > 1e-9 * through
    {
        findings.error(
            &format!("{PATH}.boundaries"),
            format!(
                "`{}` imposes a velocity, but no other face lets the same amount of fluid out",
                patch.name
            ),
            "impose a pressure or an outflow on another face",
        );
    }
}
