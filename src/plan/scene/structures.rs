//! Structures of a scene, which are also walls for grains.

use super::findings::{Findings, number};
use super::grid::Grid;
use super::{material, stl, unique, usual_material};
use crate::scene::flow::Flow;
use base::error::Remedy;
use base::number::{floor_i64, real, whole};
use case::Case;
use case::fluid::Fluid;
use case::structures::Stops;
use serde::Serialize;
use std::sync::Arc;
use structure::{Frame, Images, Shape};

/// Stationary solid.
#[derive(Clone, Debug, Serialize)]
pub struct Structure {
    /// Name of the structure.
    pub name: String,
    /// Solid with its periodic images.
    #[serde(skip)]
    pub solid: Arc<Images>,
    /// Materials that the structure stops: water, grains or both.
    pub stops: Stops,
    /// Index of its material.
    pub material: Option<usize>,
}

/// Margin around the domain, in cells, within which solids are evaluated.
const MARGIN: f64 = 3.0;

/// Returns the structures of a case.
pub(crate) fn structures(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Vec<Structure> {
    let mut known: Vec<&str> = case.walls.iter().map(|wall| wall.name.as_str()).collect();
    let usual = usual_material(case);
    let mut all = Vec::new();
    for (n, written) in case.structures.iter().enumerate() {
        let path = format!("structures[{n}]");
        unique(&mut known, &written.name, &format!("{path}.name"), findings);
        let shape = format!("{path}.shape");
        let Some(images) = images(case, grid, &written.shape, &shape, findings) else {
            continue;
        };
        let index = match (&written.material, usual) {
            (Some(name), _) => material(names, name, &format!("{path}.material"), findings),
            (None, Some(name)) => names.iter().position(|known| known == name),
            (None, None) => None,
        };
        if written.stops == Stops::Water && case.fluid.is_none() {
            findings.error(
                &format!("{path}.stops"),
                "this case has no water that the structure could stop",
                Remedy::from("write all").set(format!("{path}.stops"), "all"),
            );
        }
        if written.stops.water() {
            check_cells(case, grid, &images, &shape, findings);
        }
        all.push(Structure {
            name: written.name.clone(),
            solid: Arc::new(images),
            stops: written.stops,
            material: index,
        });
    }
    all
}

/// Warns of a solid that acts on water but covers no cell of the lattice.
pub(crate) fn check_cells(
    case: &Case,
    grid: &Grid,
    images: &Images,
    path: &str,
    findings: &mut Findings,
) {
    let in_lattice = matches!(case.fluid, Some(Fluid::LatticeBoltzmann(_)));
    if in_lattice && is_lost(images, grid) {
        findings.warn(
            path,
            format!(
                "the solid is smaller than a cell of {} m and covers no cell, so that it has no effect on the \
                 water",
                number(grid.spacing)
            ),
            "check that lengths are in m (the unit of a mesh is its `scale`), or use a smaller domain.spacing",
        );
    }
}

/// Returns a solid with its periodic images; reports a finding if it cannot be read or lies outside the domain.
pub(crate) fn images(
    case: &Case,
    grid: &Grid,
    written: &Shape,
    path: &str,
    findings: &mut Findings,
) -> Option<Images> {
    let frame = Frame {
        dimension: grid.dimension,
        size: grid.size,
    };
    let read = |mesh: &base::geometry::Mesh| {
        let origin = mesh.origin.as_ref().map_or([0.0; 3], |at| at.to_array());
        let triangles = stl::load(&case.directory, mesh, origin, stl::triangles)?;
        Ok(triangles.into_iter().map(|t| t.map(Into::into)).collect())
    };
    let solid = written.solid(&frame, path, &read, findings)?;
    let images = Images::new(solid, frame, grid.periodic, MARGIN * grid.spacing);
    if images.is_empty() || !meets(&images, grid) {
        let reaches = images.solid().extent().map(|corner| {
            let corner = corner[..grid.dimension].iter();
            corner.map(|x| number(*x)).collect::<Vec<_>>().join(", ")
        });
        findings.error(
            path,
            format!(
                "the solid lies outside the domain: it reaches from {} to {} m",
                reaches[0], reaches[1]
            ),
            format!(
                "the domain is 0 … {} m along its axes: move the solid into it",
                grid.size[..grid.dimension]
                    .iter()
                    .map(|x| number(*x))
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        );
        return None;
    }
    Some(images)
}

/// Size of a solid below which it has no effect: in cells, even if it cuts a link of the lattice, and in diameters of
/// the smallest grain.
pub(super) const NO_SHAPE: f64 = 0.1;

/// Returns `true` if a solid smaller than a cell contains no cell centre, and either cuts no link between cell
/// centres or is smaller than [`NO_SHAPE`].
fn is_lost(images: &Images, grid: &Grid) -> bool {
    let [low, high] = images.solid().extent();
    let axes = 0..grid.dimension;
    // A negated comparison, so that an infinite solid does not count as small.
    if !axes.clone().all(|a| high[a] - low[a] < grid.spacing) {
        return false;
    }
    let tiny = axes
        .clone()
        .all(|a| high[a] - low[a] < NO_SHAPE * grid.spacing);
    let first = |a: usize| floor_i64(low[a] / grid.spacing - 0.5);
    let centre = |offsets: [i64; 3]| -> [f64; 3] {
        std::array::from_fn(|a| {
            if a < grid.dimension {
                (real(first(a) + offsets[a]) + 0.5) * grid.spacing
            } else {
                0.0
            }
        })
    };
    // Both ends of such a link lie within a cell of the solid.
    let corners = if grid.dimension == 2 { 9 } else { 27 };
    let place = |n: i64| [n % 3, n / 3 % 3, n / 9];
    let mut found = Vec::new();
    (0..corners).all(|n| {
        let from = centre(place(n));
        let lies_in = images.solid().distance(from) < 0.0;
        let cut = (0..corners).any(|m| {
            let to = centre(place(m));
            found.clear();
            let along = std::array::from_fn(|a| to[a] - from[a]);
            images.solid().chords(from, along, &mut found);
            n != m && !found.is_empty()
        });
        !lies_in && (!cut || tiny)
    })
}

/// Returns `true` if any part of the solid, however thin, is in the domain.
fn meets(images: &Images, grid: &Grid) -> bool {
    images
        .extents()
        .any(|[low, high]| (0..grid.dimension).all(|a| low[a] < grid.size[a] && high[a] > 0.0))
        && images.solid().plane().is_none_or(|(point, normal)| {
            // Corner of the domain that lies deepest behind the plane.
            let deepest: f64 = (0..grid.dimension)
                .map(|a| (-point[a] * normal[a]).min((grid.size[a] - point[a]) * normal[a]))
                .sum();
            deepest < 0.0
        })
}

/// Maximum initial overlap of a grain with a structure, as a fraction of its radius.
const ALLOWED: f64 = 0.05;

/// Returns the overlap of a grain with a structure that stops grains \[m\], if it exceeds the allowed overlap.
fn depth(structure: &Structure, grain: &super::sample::ListedGrain) -> Option<f64> {
    let depth = grain.radius - structure.solid.distance(grain.position);
    (structure.stops.grains() && depth > ALLOWED * grain.radius).then_some(depth)
}

/// Returns `true` if a grain starts in a structure, deeper than a twentieth of its radius.
#[must_use]
pub fn inside(structures: &[Structure], grain: &super::sample::ListedGrain) -> bool {
    structures.iter().any(|one| depth(one, grain).is_some())
}

/// Returns all cells of a grid in an order that is spread over it, so that a search soon finds a cell of any large
/// part.
pub(crate) fn spread([nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let count = nx * ny * nz;
    let divides = |a: usize, b: usize| {
        let (mut a, mut b) = (a, b);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a > 1
    };
    // The golden ratio spreads the places evenly; a stride without a common divisor reaches each once.
    let mut stride = whole(0.618 * real(count)).max(1);
    while divides(stride, count) {
        stride += 1;
    }
    let places = (0..count).scan(0, move |at, _| {
        *at = (*at + stride) % count;
        Some(*at)
    });
    places.map(move |at| [at % nx, at / nx % ny, at / (nx * ny)])
}

/// Returns `true` if a point lies in a structure that stops water.
fn in_structures(structures: &[Structure], at: [f64; 3]) -> bool {
    let mut water = structures.iter().filter(|s| s.stops.water());
    water.any(|s| s.solid.distance(at) < 0.0)
}

/// Refuses structures that leave the lattice no cell for the water, and openings that they close completely.
pub(crate) fn water(grid: &Grid, structures: &[Structure], flow: &Flow, findings: &mut Findings) {
    let fill = |structures: &[Structure]| {
        let mut centres = spread(grid.cells).map(|cell| grid.centre(cell));
        centres.all(|at| in_structures(structures, at))
    };
    if structures.is_empty() || !fill(structures) {
        openings(grid, structures, flow, findings);
        return;
    }
    let (path, what) = match (0..structures.len()).find(|n| fill(&structures[*n..=*n])) {
        Some(n) => (format!("structures[{n}].shape"), "the solid covers"),
        None => ("structures".to_owned(), "the solids together cover"),
    };
    findings.error(
        &path,
        format!("{what} the whole domain, so that no cell is left for the water"),
        "make it smaller, move it, or check that lengths are in m (the unit of a mesh is its `scale`)",
    );
}

/// Refuses openings that structures close completely.
fn openings(grid: &Grid, structures: &[Structure], flow: &Flow, findings: &mut Findings) {
    let solid = |at: [f64; 3]| in_structures(structures, at);
    for patch in flow.patches() {
        let Some(n) = patch.index.filter(|_| !structures.is_empty()) else {
            continue;
        };
        if !patch.condition.model().passes_water() {
            continue;
        }
        let axis = patch.face.axis();
        let across: Vec<usize> = (0..grid.dimension).filter(|&a| a != axis).collect();
        let count: usize = across.iter().map(|&a| patch.cells(a)).product();
        let layer = if patch.face.is_max() {
            grid.cells[axis] - 1
        } else {
            0
        };
        let closed = (0..count).all(|mut k| {
            let mut cell = [0; 3];
            cell[axis] = layer;
            for &a in &across {
                let cells = patch.cells(a);
                cell[a] = patch.from[a] + k % cells;
                k /= cells;
            }
            solid(grid.centre(cell))
        });
        if closed && count > 0 {
            findings.error(
                &format!("fluid.lattice_boltzmann.boundaries[{n}]"),
                format!(
                    "structures cover `{}` completely, so that no water can pass",
                    patch.name
                ),
                "move the opening or the structure",
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::{Problem, Severity};
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    fn findings(case: &Value, folder: &Path) -> Vec<Problem> {
        let read = Document::read(&case.to_string(), &[], folder).and_then(Plan::prepare);
        read.map_or_else(|problems| problems, |plan| plan.warnings)
    }

    /// Returns `true` if a ball of this radius \[cells\] at a position \[cells\] is lost on the lattice.
    fn is_lost(centre: [f64; 3], radius: f64) -> bool {
        let case = json!({
            "domain": {"size": [0.02, 0.02, 0.02], "spacing": 0.001, "periodic": ["x", "y"]},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8,
                "body_force": {"constant": [1, 0, 0]}}},
            "structures": [{"name": "ball", "shape": {"sphere": {
                "centre": centre.map(|x| 1e-3 * x), "radius": 1e-3 * radius}}}],
            "time": {"end": 0.01}
        });
        let found = findings(&case, Path::new("."));
        found
            .iter()
            .any(|p| p.path == "structures[0].shape" && p.reason.contains("covers no cell"))
    }

    /// Checks that a case without a cell of water is refused once, with the path of what covers it, and that one with a
    /// narrow passage is not.
    #[test]
    fn a_solid_that_covers_the_whole_domain_is_refused() {
        let found = |structures: Value| {
            let case = json!({
                "domain": {"size": [0.02, 0.01], "spacing": 0.001},
                "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8,
                    "boundaries": [
                        {"name": "in", "face": "x_min", "condition": {"pressure": {"value": 0.1}}},
                        {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
                    ]}},
                "structures": structures,
                "time": {"end": 0.01}
            });
            let found = findings(&case, Path::new("."));
            let errors = found.into_iter().filter(|p| p.severity == Severity::Error);
            errors.map(|p| (p.path, p.reason)).collect::<Vec<_>>()
        };
        let slab = |name: &str, from: f64, to: f64| {
            let shape = json!({"box": {"from": [-0.01, from], "to": [0.03, to]}});
            json!({"name": name, "shape": shape})
        };
        for (structures, path) in [
            (json!([slab("all", -0.01, 0.02)]), "structures[0].shape"),
            (
                json!([slab("low", -0.01, 0.002), slab("all", 0.0, 0.01)]),
                "structures[1].shape",
            ),
            (
                json!([slab("low", -0.01, 0.006), slab("high", 0.005, 0.02)]),
                "structures",
            ),
        ] {
            let errors = found(structures);
            assert_eq!(errors.len(), 1, "{errors:?}");
            assert_eq!(errors[0].0, path);
            assert!(errors[0].1.contains("the whole domain"), "{errors:?}");
        }
        let passage = json!([slab("low", -0.01, 0.005), slab("high", 0.006, 0.02)]);
        assert_eq!(found(passage), []);
    }

    #[test]
    fn a_search_through_spread_cells_reaches_each_once() {
        for counts in [[1, 1, 1], [2, 3, 1], [13, 1, 1], [5, 6, 7], [8, 8, 8]] {
            let mut cells: Vec<_> = super::spread(counts).collect();
            cells.sort_unstable();
            cells.dedup();
            assert_eq!(cells.len(), counts.iter().product::<usize>());
            assert!(cells.iter().all(|cell| (0..3).all(|a| cell[a] < counts[a])));
        }
    }

    #[test]
    fn a_solid_that_covers_nothing_is_reported() {
        // The balls lie between all centres and links, on a centre, on a link (a tiny and a larger one), and one is
        // as wide as a cell.
        assert!(is_lost([10.3, 10.0, 10.2], 0.01));
        assert!(!is_lost([10.5, 10.5, 10.5], 0.01));
        assert!(is_lost([11.0, 10.5, 10.5], 0.01));
        assert!(!is_lost([11.0, 10.5, 10.5], 0.06));
        assert!(!is_lost([10.3, 10.0, 10.2], 0.6));
    }

    /// Checks a structure that stops grains: without any grains, much smaller than each grain, and as large as one.
    #[test]
    fn a_structure_that_stops_no_grain_is_reported() {
        let case = |radius: f64, grains: bool, stops: &str| {
            let mut case = json!({
                "domain": {"size": [0.02, 0.02, 0.02], "spacing": 0.001},
                "materials": {"glass": {"density": 2500}},
                "contact": {"linear": {"normal_stiffness": {"absolute": 1e3}, "friction_angle_degrees": 30}},
                "structures": [{"name": "screen", "stops": stops, "material": "glass", "shape": {"sphere": {
                    "centre": [0.01, 0.01, 0.005], "radius": radius}}}],
                "time": {"end": 0.01}
            });
            if grains {
                case["grains"] = json!({"material": "glass", "initial": {"list": [
                    {"position": [0.005, 0.005, 0.015], "radius": 0.001}]}});
            } else {
                case["fluid"] = json!({"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-5,
                    "relaxation_time": 0.8}});
            }
            findings(&case, Path::new("."))
        };
        let told = |found: &[Problem], path: &str, words: &str| {
            let told = found
                .iter()
                .any(|p| p.path == path && p.reason.contains(words));
            assert!(told, "{path}, {words}: {found:?}");
        };
        told(
            &case(2e-3, false, "grains"),
            "structures[0].stops",
            "no effect",
        );
        told(
            &case(5e-5, true, "grains"),
            "structures[0].shape",
            "smallest grain",
        );
        told(
            &case(5e-5, true, "all"),
            "structures[0].shape",
            "smallest grain",
        );
        let mut text = json!({
            "domain": {"size": [0.02, 0.02, 0.02], "spacing": 0.001},
            "materials": {"glass": {"density": 2500}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e3}, "friction_angle_degrees": 30}},
            "grains": {"material": "glass", "initial": {"list": [
                {"position": [0.005, 0.005, 0.015], "radius": 0.001}]}},
            "walls": [{"name": "cup", "material": "glass", "shape": {"box": {
                "from": [0.01, 0.01, 0.01], "to": [0.01004, 0.01004, 0.01004]}}}],
            "time": {"end": 0.01}
        });
        told(
            &findings(&text, Path::new(".")),
            "walls[0].shape.box",
            "smallest grain",
        );
        text["walls"][0]["shape"]["box"]["to"] = json!([0.014, 0.014, 0.014]);
        let wall = findings(&text, Path::new("."));
        assert!(
            !wall.iter().any(|p| p.path.starts_with("walls")),
            "{wall:?}"
        );
        for found in [case(2e-3, true, "grains"), case(2e-3, false, "all")] {
            assert!(
                !found.iter().any(|p| p.path.starts_with("structures")),
                "{found:?}"
            );
        }
    }

    /// Checks that a drawing in millimetres is refused for every kind of surface: structure, wall, block and body.
    #[test]
    fn the_unit_of_every_surface_is_checked() {
        let folder = tempfile::tempdir().unwrap();
        let corner = |k: usize| [0, 1, 2].map(|a| if k >> a & 1 == 0 { 20.0 } else { 60.0 });
        let faces = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let mut text = "solid cube\n".to_owned();
        for [a, b, c, d] in faces {
            for t in [[a, b, c], [a, c, d]] {
                text += "facet normal 0 0 0\nouter loop\n";
                for [x, y, z] in t.map(corner) {
                    text += &format!("vertex {x} {y} {z}\n");
                }
                text += "endloop\nendfacet\n";
            }
        }
        text += "endsolid\n";
        std::fs::write(folder.path().join("cube.stl"), text).unwrap();
        let mesh = |scale: f64| json!({"path": "cube.stl", "scale": scale});
        let case = |parts: Value| {
            let mut case = json!({
                "domain": {"size": [0.1, 0.1, 0.1], "spacing": 0.005},
                "materials": {"rock": {"density": 2600}},
                "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 30}},
                "bodies": [{"name": "ball", "material": "rock", "shape": {"sphere": {"radius": 0.005}},
                    "position": [0.01, 0.01, 0.01], "motion": {"free": {}}}],
                "time": {"end": 1e-3}
            });
            for (key, part) in parts.as_object().unwrap() {
                case[key] = part.clone();
            }
            findings(&case, folder.path())
        };
        let uses = |scale: f64| {
            let mesh = mesh(scale);
            [
                json!({"structures": [{"name": "s", "shape": {"surface": {"mesh": mesh}}}]}),
                json!({"walls": [{"name": "w", "material": "rock", "shape": {"mesh": mesh}}]}),
                json!({"blocks": {"material": "rock", "initial": {"list": [{"shape": {"mesh": mesh}}]}}}),
                json!({"bodies": [{"name": "b", "material": "rock", "shape": {"mesh": mesh},
                    "position": [0.04, 0.04, 0.04], "motion": {"free": {}}}]}),
            ]
        };
        for parts in uses(1.0) {
            let found = case(parts.clone());
            let errors: Vec<&Problem> = found
                .iter()
                .filter(|p| p.path.ends_with("mesh.scale"))
                .collect();
            assert_eq!(errors.len(), 1, "{parts}: {found:?}");
            assert!(
                errors[0].reason.contains("400 times the domain"),
                "{}",
                errors[0]
            );
        }
        for parts in uses(1e-3) {
            let found = case(parts.clone());
            assert!(
                found.iter().all(|p| !p.path.contains("mesh")),
                "{parts}: {found:?}"
            );
        }
    }
}
