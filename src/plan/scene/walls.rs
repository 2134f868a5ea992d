//! Walls of a scene: planes, surfaces, and faces of the domain.

mod flush;
mod in_water;
mod servo;

use base::vector::norm;
pub(crate) use in_water::walls_in_water;
pub use servo::SceneServo;

use super::aligned_box::AlignedBox;
use super::auto::features::grain_diameters;
use super::findings::{Findings, number};
use super::grid::Grid;
use super::motion::{factors, first_and_largest};
use super::structures::Structure;
use super::{material, stl, unique, usual_material};
use base::error::{Error, Remedy};
use case::Case;
use case::geometry::{Face, Vector};
use case::grains::GrainSource;
use case::observe::Action;
use case::solids::{Mesh, Plane as WrittenPlane, Wall as WrittenWall, WallShape, WallStage};
use dem::FacetSurface;
use nalgebra::Vector3;
use serde::Serialize;
use std::sync::Arc;
use structure::crossing;
use structure::surface::judge_unit;

/// Plane or surface that grains can touch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneWall {
    /// Name in tables.
    pub name: String,
    /// Point on the plane \[m\].
    pub point: [f64; 3],
    /// Unit normal of the plane, towards the grains.
    pub normal: [f64; 3],
    /// Facets; none for a plane.
    #[serde(skip)]
    pub surface: Option<Arc<FacetSurface>>,
    /// Velocity [m/s], which `history` multiplies.
    pub velocity: [f64; 3],
    /// Times \[s\] and factors of the velocity; none if it is constant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub history: Option<Vec<[f64; 2]>>,
    /// Control by the mean normal stress; none for a surface, or for a plane without a control.
    pub servo: Option<SceneServo>,
    /// Index of its material.
    pub material: usize,
    /// `true` if the wall is removed when the run begins.
    pub temporary: bool,
    /// Time at which the wall is inserted \[s\]; none if it exists from the start.
    pub from: Option<f64>,
    /// Time at which the wall is removed \[s\]; none if it exists to the end.
    pub until: Option<f64>,
    /// Face of the domain, if this is a box wall.
    pub face: Option<Face>,
    /// Structure whose surface this wall is, by index in [`super::Scene::structures`].
    pub structure: Option<usize>,
}

impl SceneWall {
    /// Returns `true` if the wall is inserted or removed during the run.
    #[must_use]
    pub fn is_timed(&self) -> bool {
        self.from.is_some() || self.until.is_some()
    }

    /// Returns the largest velocity of the wall [m/s]; with a servo towards the grains.
    pub(crate) fn largest_velocity(&self) -> [f64; 3] {
        let limit = self.servo.as_ref().map_or(0.0, |s| s.velocity_limit);
        let [_, largest] = first_and_largest(self.history.as_ref());
        std::array::from_fn(|a| largest * self.velocity[a] + limit * self.normal[a])
    }

    /// Returns the velocity of the wall at the start of the run [m/s].
    #[must_use]
    pub fn velocity_at_start(&self) -> [f64; 3] {
        let [first, _] = first_and_largest(self.history.as_ref());
        self.velocity.map(|v| v * first)
    }

    /// Returns `true` if the wall exists at a time of the run \[s\].
    #[must_use]
    pub fn exists(&self, time: f64) -> bool {
        !self.temporary
            && self.from.is_none_or(|from| time >= from)
            && self.until.is_none_or(|until| time < until)
    }
}

/// Reports grains that would fall out of the domain.
fn no_floor(case: &Case, grid: &Grid, no_walls: bool, findings: &mut Findings) {
    let Some(gravity) = case.gravity.as_ref().map(Vector::to_array) else {
        return;
    };
    let Some(down) =
        (0..grid.dimension).max_by(|&a, &b| gravity[a].abs().total_cmp(&gravity[b].abs()))
    else {
        return;
    };
    let face = Face::ALL[2 * down + usize::from(gravity[down] > 0.0)];
    let pulled = gravity[down].abs() > 0.0 && !grid.periodic[down];
    let only_recorded = case
        .regions
        .iter()
        .all(|region| matches!(region.action, Action::Record {}));
    let nothing = no_walls && case.bodies.is_empty() && case.blocks.is_none() && only_recorded;
    if case.grains.is_some() && pulled && nothing && !case.box_walls.contains(&face) {
        let mut with = case.box_walls.clone();
        with.push(face);
        findings.warn(
            "box_walls",
            format!(
                "gravity pulls the grains through the face {}, where no wall stops them",
                face.name()
            ),
            Remedy::from(format!(
                "add \"{}\" to `box_walls`, or a wall or structure below them",
                face.name()
            ))
            .set("box_walls", serde_json::json!(with)),
        );
    }
}

/// Returns the walls of a case: those written, those of the structures, then those on faces of the domain.
pub(crate) fn walls(
    case: &Case,
    grid: &Grid,
    names: &[String],
    solids: &[Structure],
    findings: &mut Findings,
) -> Vec<SceneWall> {
    let mut walls = Vec::new();
    let mut known = Vec::new();
    for (n, wall) in case.walls.iter().enumerate() {
        let path = format!("walls[{n}]");
        unique(&mut known, &wall.name, &format!("{path}.name"), findings);
        walls.push(written_wall(case, grid, names, wall, &path, findings));
    }
    walls.extend(in_water::walls_of_structures(case, grid, solids, findings));
    no_floor(case, grid, walls.is_empty(), findings);
    let mut taken = [false; 6];
    for (n, face) in case.box_walls.iter().enumerate() {
        let twice = std::mem::replace(&mut taken[face.index()], true);
        check_face(grid, *face, twice, &format!("box_walls[{n}]"), findings);
        let material = box_material(case, names, n == 0, findings);
        let mut point = [0.0; 3];
        if face.is_max() {
            point[face.axis()] = grid.size[face.axis()];
        }
        walls.push(SceneWall {
            name: face.name().into(),
            point,
            normal: face.inward(),
            surface: None,
            velocity: [0.0; 3],
            history: None,
            servo: None,
            material: material.unwrap_or(0),
            temporary: false,
            from: None,
            until: None,
            face: Some(*face),
            structure: None,
        });
    }
    flush::check(case, &walls, findings);
    servo::check_areas(&walls, grid, findings);
    walls
}

/// Resolves a wall of the case.
fn written_wall(
    case: &Case,
    grid: &Grid,
    names: &[String],
    wall: &WrittenWall,
    path: &str,
    findings: &mut Findings,
) -> SceneWall {
    let shape = format!("{path}.shape");
    let mut plane = Plane::default();
    let mut surface = None;
    match &wall.shape {
        WallShape::Plane(written) => {
            plane = Plane::resolve(grid, written, &format!("{shape}.plane"), findings);
        }
        facetted => surface = facets(case, grid, facetted, &shape, findings),
    }
    let stationary = wall.velocity.is_none() && wall.history.is_none() && wall.servo.is_none();
    if stationary {
        check_reach(grid, (&plane, surface.as_ref()), &shape, findings);
    }
    let velocity = wall.velocity.as_ref().map_or([0.0; 3], |v| {
        AlignedBox::vector(grid, v, &format!("{path}.velocity"), findings)
    });
    let index = material(names, &wall.material, &format!("{path}.material"), findings);
    let temporary = wall.during == WallStage::Preparation;
    if temporary {
        has_a_preparation(case, path, findings);
    }
    check_times(case, wall, path, findings);
    let servo = servo::resolve(case, wall, (plane.normal, velocity), path, findings);
    let history = factors(wall.history.as_ref(), [velocity, [0.0; 3]], path, findings);
    if servo.is_some() && history.is_some() {
        let at = format!("{path}.history");
        findings.error(
            &at,
            "a servo wall moves as its stress requires; its velocity along the plane is constant",
            Remedy::take_out("remove the table, or the servo", &at),
        );
    }
    SceneWall {
        name: wall.name.clone(),
        point: plane.point,
        normal: plane.normal,
        surface: surface.map(Arc::new),
        velocity,
        history,
        servo,
        material: index.unwrap_or(0),
        temporary,
        from: wall.from,
        until: wall.until,
        face: None,
        structure: None,
    }
}

/// Plane with a unit normal.
#[derive(Default)]
struct Plane {
    point: [f64; 3],
    normal: [f64; 3],
}

impl Plane {
    /// Resolves a plane; reports a finding for one without a direction or across a periodic axis.
    fn resolve(grid: &Grid, written: &WrittenPlane, path: &str, findings: &mut Findings) -> Self {
        let point = AlignedBox::vector(grid, &written.point, &format!("{path}.point"), findings);
        let path = format!("{path}.normal");
        let normal = AlignedBox::vector(grid, &written.normal, &path, findings);
        let length = norm(normal);
        if !(length > 0.0 && length.is_finite()) {
            findings.error(
                &path,
                "the normal has zero length",
                "write for example [0, 1]",
            );
        }
        let normal = normal.map(|n| n / length);
        if let Some(axis) = across_periodic(grid, normal) {
            let reason = format!(
                "the wall lies across the periodic axis {axis}, so that grains would be on both sides of it"
            );
            let remedy = format!(
                "use a normal without a component along {axis}, or remove {axis} from `domain.periodic`"
            );
            findings.error(&path, reason, remedy);
        }
        Self { point, normal }
    }
}

/// Refuses stationary facets that lie outside the domain, and warns of a stationary plane far behind the domain:
/// neither ever acts. Such walls are written in another unit.
fn check_reach(
    grid: &Grid,
    (plane, surface): (&Plane, Option<&FacetSurface>),
    path: &str,
    findings: &mut Findings,
) {
    let axes = 0..grid.dimension;
    // A wall near the domain stops bodies whose centres are inside; none is larger than the shortest edge.
    let slack = axes
        .clone()
        .map(|a| grid.size[a])
        .fold(f64::INFINITY, f64::min);
    let Some(surface) = surface else {
        let lowest: f64 = axes
            .map(|a| {
                let heights = [0.0, grid.size[a]].map(|x| (x - plane.point[a]) * plane.normal[a]);
                heights[0].min(heights[1])
            })
            .sum();
        if lowest > slack {
            findings.warn(
                path,
                format!(
                    "the wall lies outside the domain, {} m from its nearest corner, so that it never acts",
                    number(lowest)
                ),
                "correct its point or the direction of its normal, which leads into the grains",
            );
        }
        return;
    };
    let corners = || (0..surface.len()).flat_map(|facet| surface.corners(facet));
    let ends = |a: usize| {
        corners().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
            [low.min(v[a]), high.max(v[a])]
        })
    };
    let outside = |a: &usize| {
        let [low, high] = ends(*a);
        low > grid.size[*a] + slack || high < -slack
    };
    if axes
        .clone()
        .filter(|a| !grid.periodic[*a])
        .any(|a| outside(&a))
    {
        let list = |n: usize| {
            axes.clone()
                .map(|a| number(ends(a)[n]))
                .collect::<Vec<_>>()
                .join(", ")
        };
        let size = axes
            .clone()
            .map(|a| number(grid.size[a]))
            .collect::<Vec<_>>()
            .join(", ");
        findings.error(
            path,
            format!("the wall lies outside the domain: it reaches from {} to {} m", list(0), list(1)),
            format!("the domain is 0 … {size} m along its axes: move the wall into it, or correct its unit"),
        );
    }
}

/// Refuses a wall on a face that does not exist, is periodic, or already has a wall.
fn check_face(grid: &Grid, face: Face, twice: bool, path: &str, findings: &mut Findings) {
    if face.axis() >= grid.dimension {
        findings.error(path, "a 2-D problem does not have this face", "remove it");
    } else if grid.periodic[face.axis()] {
        findings.error(
            path,
            "the domain is periodic across this face, so that it cannot have a wall",
            "remove it",
        );
    } else if twice {
        findings.error(path, "this face is named twice", "remove one of them");
    }
}

/// Returns the index of the material of walls on faces; a missing or unknown one is reported at the first wall only.
fn box_material(
    case: &Case,
    names: &[String],
    first: bool,
    findings: &mut Findings,
) -> Option<usize> {
    let path = "box_wall_material";
    if let Some(name) = &case.box_wall_material {
        return if first {
            material(names, name, path, findings)
        } else {
            names.iter().position(|known| known == name)
        };
    }
    let usual = usual_material(case);
    if usual.is_none() && first {
        findings.error(
            path,
            "the walls need a material, because the case has no grains, blocks or bodies whose material they \
             could use",
            match names.first() {
                Some(first) => Remedy::from(format!("add `{path}`, for example `{first}`"))
                    .set(path, first.as_str()),
                None => format!("add `{path}`, and the material").into(),
            },
        );
    }
    names.iter().position(|known| Some(known.as_str()) == usual)
}

/// Returns the periodic axis along which a unit normal points, at least in part.
fn across_periodic(grid: &Grid, normal: [f64; 3]) -> Option<&'static str> {
    (0..grid.dimension)
        .find(|&a| grid.periodic[a] && normal[a].abs() > 0.0)
        .map(|a| ["x", "y", "z"][a])
}

/// Returns the periods of the domain \[m\]; 0 along axes that are not periodic.
fn periods(grid: &Grid) -> [f64; 3] {
    std::array::from_fn(|a| {
        if a < grid.dimension && grid.periodic[a] {
            grid.size[a]
        } else {
            0.0
        }
    })
}

/// Returns the lowest and the highest coordinates of a surface \[m\].
fn extent(surface: &FacetSurface) -> [[f64; 3]; 2] {
    let corners = (0..surface.len()).flat_map(|facet| surface.corners(facet));
    let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    corners.fold(none, |[low, high], corner| {
        [
            std::array::from_fn(|a| low[a].min(corner[a])),
            std::array::from_fn(|a| high[a].max(corner[a])),
        ]
    })
}

/// Reports grains that are too large for facets in a domain with a short period.
fn report_large_grains(case: &Case, surface: &FacetSurface, path: &str, findings: &mut Findings) {
    let largest = grain_diameters(case).map_or(0.0, |(_, high)| 0.5 * high);
    let reach = surface.longest_reach();
    if largest >= reach {
        findings.error(
            path,
            format!(
                "grains with a radius of {} m are too large for walls of facets in a domain that repeats every \
                 {} m",
                number(largest),
                number(2.0 * reach)
            ),
            "use a period longer than the largest diameter plus the neighbour skin, plane walls, or no periodic \
             axis",
        );
        findings.depends(&["grains", "regions"]);
    }
}

/// Checks the times at which a wall is inserted and removed.
fn check_times(case: &Case, wall: &WrittenWall, path: &str, findings: &mut Findings) {
    let stated = [("from", wall.from), ("until", wall.until)];
    let end = case.time.end;
    for (field, time) in stated {
        let Some(time) = time else {
            continue;
        };
        let path = format!("{path}.{field}");
        if wall.during == WallStage::Preparation {
            findings.error(
                &path,
                "a wall of the preparation is removed when the run begins, so that this field has no effect",
                Remedy::take_out("remove it, or `during`", &path),
            );
        } else if time >= end {
            let what = if field == "from" { "comes" } else { "goes" };
            findings.warn(
                &path,
                format!(
                    "the wall `{}` {what} at {} s, but the run ends at {} s",
                    wall.name,
                    number(time),
                    number(end)
                ),
                "use a time before the end of the run",
            );
        }
    }
    if let (Some(from), Some(until)) = (wall.from, wall.until)
        && from >= until
    {
        findings.error(
            &format!("{path}.until"),
            format!(
                "the wall would be removed at {} s, before it is inserted at {} s",
                number(until),
                number(from)
            ),
            "make `until` larger than `from`",
        );
    }
}

/// Checks that a case with a wall of the preparation has a preparation in which grains move: a deposition, or the
/// relaxation of bonded grains. For a sample from a file this is only a warning, because such a wall may have held
/// the sample when it was made.
fn has_a_preparation(case: &Case, path: &str, findings: &mut Findings) {
    let source = case.grains.as_ref().map(|grains| &grains.initial);
    let bonded = case.grains.as_ref().is_some_and(|g| g.bond_at_start);
    let (what, held_before) = match source {
        Some(GrainSource::Deposition(_)) => return,
        Some(_) if bonded => return,
        Some(GrainSource::List(_)) => ("listed grains do not move before the run", false),
        Some(GrainSource::File { .. }) => ("grains from a file do not move before the run", true),
        Some(GrainSource::Growth(_)) => (
            "growing grains are stopped by the faces of their box only",
            false,
        ),
        None => ("there are no grains in this case", false),
    };
    let at = format!("{path}.during");
    let reason = format!(
        "this wall never acts: {what}, nothing else is prepared, and the wall is removed when the run begins"
    );
    let keep = "write \"always\" to keep the wall during the run";
    let remedy = if held_before {
        Remedy::from(format!("{keep}, or remove the wall"))
    } else {
        Remedy::from(format!("{keep}, or use a deposition or bond_at_start"))
    }
    .set(&*at, "always");
    if held_before {
        findings.warn(&at, reason, remedy);
    } else {
        findings.error(&at, reason, remedy);
    }
}

/// Returns the corners of a plane polygon along the two axes that are most nearly in its plane; empty without an area.
fn in_its_plane(corners: &[Vector3<f64>]) -> Vec<[f64; 2]> {
    let normals = corners.windows(2).map(|ends| {
        let [a, b] = [0, 1].map(|k| ends[k] - corners[0]);
        a.cross(&b)
    });
    let largest = normals.max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    let Some(normal) = largest.filter(|normal| normal.norm_squared() > 0.0) else {
        return Vec::new();
    };
    let across = normal.iamax();
    let [first, second] = [(across + 1) % 3, (across + 2) % 3];
    corners.iter().map(|at| [at[first], at[second]]).collect()
}

/// Returns the facets of a wall that is not a plane; reports a finding if they are invalid.
fn facets(
    case: &Case,
    grid: &Grid,
    shape: &WallShape,
    path: &str,
    findings: &mut Findings,
) -> Option<FacetSurface> {
    if grid.dimension == 2 {
        findings.error(
            path,
            "in 2-D a wall must be a plane",
            "write {\"plane\": {\"point\": .., \"normal\": ..}}",
        );
        return None;
    }
    let (path, made, remedy) = match shape {
        WallShape::Plane(_) => return None,
        WallShape::Polygon(corners) => {
            let path = format!("{path}.polygon");
            let made = polygon(grid, corners, &path, findings);
            (
                path,
                made,
                "list the corners of a plane convex polygon in their order along the outline",
            )
        }
        WallShape::Box(extent) => {
            let path = format!("{path}.box");
            let from = AlignedBox::vector(grid, &extent.from, &format!("{path}.from"), findings);
            let to = AlignedBox::vector(grid, &extent.to, &format!("{path}.to"), findings);
            let made = if (0..3).all(|a| from[a] < to[a]) {
                FacetSurface::of_box(from.into(), to.into()).map_err(Error::into_reason)
            } else {
                Err("the box has no volume".into())
            };
            (
                path,
                made,
                "give the corners with the smallest and the largest coordinates",
            )
        }
        WallShape::Mesh(mesh) => {
            let path = format!("{path}.mesh");
            let made = triangles(case, grid, mesh, &path, findings);
            (
                format!("{path}.path"),
                made,
                "correct the path (relative to the case) or the file",
            )
        }
    };
    // With a surface in another unit the number of periodic images would be excessive.
    let unit = match (shape, &made) {
        (WallShape::Mesh(mesh), Ok(surface)) => {
            let corners = (0..surface.len()).flat_map(|facet| surface.corners(facet));
            let wall = path.trim_end_matches(".mesh.path");
            judge_unit(mesh, &stl::extent(corners), &grid.size, wall, findings)
        }
        _ => true,
    };
    if !unit {
        return None;
    }
    let made = made.and_then(|surface| {
        let repeated = surface.repeated([0.0; 3], periods(grid));
        repeated.map_err(|e| e.to_string())
    });
    match made {
        Ok(surface) => {
            report_large_grains(case, &surface, &path, findings);
            in_water::warn_of_size(case, extent(&surface), &path, findings);
            Some(surface)
        }
        Err(reason) => {
            findings.error(&path, reason, remedy);
            None
        }
    }
}

/// Returns the facet of a polygon, or why its corners form none.
fn polygon(
    grid: &Grid,
    corners: &[Vector],
    path: &str,
    findings: &mut Findings,
) -> Result<FacetSurface, String> {
    let vertices: Vec<Vector3<f64>> = corners
        .iter()
        .enumerate()
        .map(|(n, at)| AlignedBox::vector(grid, at, &format!("{path}[{n}]"), findings).into())
        .collect();
    if let Some((k, n)) = crossing(&in_its_plane(&vertices)) {
        return Err(format!(
            "the polygon crosses or touches itself: the edge from corner {k} meets the edge from corner {n}"
        ));
    }
    let all = (0..u32::try_from(vertices.len()).unwrap_or(u32::MAX)).collect();
    FacetSurface::new(vertices, &[all]).map_err(|error| {
        let reason = error.into_reason();
        let about = reason.strip_prefix("facet 0 ");
        about.map_or(reason.clone(), |about| format!("the polygon {about}"))
    })
}

/// Returns the facets of a mesh from its file, or why it has none.
fn triangles(
    case: &Case,
    grid: &Grid,
    mesh: &Mesh,
    path: &str,
    findings: &mut Findings,
) -> Result<FacetSurface, String> {
    let origin = mesh.origin.as_ref().map_or([0.0; 3], |at| {
        AlignedBox::vector(grid, at, &format!("{path}.origin"), findings)
    });
    stl::load(&case.directory, mesh, origin, stl::read)
}
