//! Ways of the water of a lattice past solids that never move: water that an opening imposes must reach another
//! opening, and water that leaves with its own state must reach an opening that holds a pressure.

use super::blocks::PlacedBlocks;
use super::bodies::{Mobility, NamedBody};
use super::boundaries::{ScenePatch, openings};
use super::findings::Findings;
use super::flow::{Flow, PATH};
use super::grid::Grid;
use super::structures::Structure;
use base::error::Remedy;
use base::number::{real, whole};
use case::geometry::Face;
use dem::polyhedron::PlacedPolyhedron;
use lbm::boundary::Inflow;
use lbm::lattice::VelocitySet;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Maximum number of cells among which ways are sought.
const MAX_CELLS: usize = 2_000_000;
/// Part of the imposed flow that counts if it has no way out; less enters pockets between bodies and the face.
const CONSIDERABLE: f64 = 0.25;
/// Open part of an opening below which it does not hold the pressure of the water.
const MOSTLY_COVERED: f64 = 0.25;
/// Velocity at the rim of an opening, in mean velocities: that of a parabola half a cell from the wall is 3 over the
/// number of cells.
const RIM: f64 = 0.1;
/// Sections without errors on which the findings depend.
const DEPENDS: &[&str] = &[
    "domain",
    "fluid.lattice_boltzmann.boundaries",
    "structures",
    "bodies",
    "blocks",
];
/// Mark of a cell inside a solid, and of one that was not reached yet.
const SOLID: u32 = u32::MAX;
const NEW: u32 = u32::MAX - 1;

/// Solids of a scene that may never move.
pub(crate) struct Obstacles<'a> {
    pub(crate) structures: &'a [Structure],
    pub(crate) bodies: &'a [NamedBody],
    pub(crate) blocks: Option<&'a PlacedBlocks>,
}

/// Water in pockets between solids with links or discs. Blocks in saturated cells let it pass through the cells that
/// they cover in part.
#[derive(Clone, Copy)]
pub(crate) struct Pockets {
    /// End of the run \[s\].
    pub(crate) end: f64,
    /// Change of the density that ends the run.
    pub(crate) max_compression: f64,
}

/// Reports openings whose imposed flow cannot leave because solids close the domain, and openings with a free
/// pressure in a part of the water that reaches no pressure.
pub(crate) fn check(
    flow: &Flow,
    grid: &Grid,
    solids: &Obstacles<'_>,
    pockets: Option<Pockets>,
    findings: &mut Findings,
) {
    let stops = |structure: &&Structure| structure.stops.water();
    let structures: Vec<&Structure> = solids.structures.iter().filter(stops).collect();
    let fixed = |body: &&NamedBody| body.mobility == Mobility::Fixed;
    let bodies: Vec<&NamedBody> = solids.bodies.iter().filter(fixed).collect();
    let blocks = solids.blocks.iter().flat_map(|blocks| &blocks.list);
    let blocks: Vec<&PlacedPolyhedron> = blocks
        .filter(|block| block.fixed)
        .map(|block| &block.solid)
        .collect();
    let stand = !bodies.is_empty() || !blocks.is_empty();
    let opens = |patch: &ScenePatch| patch.condition.model().passes_water();
    if structures.is_empty() && !stand
        || grid.cells.iter().product::<usize>() > MAX_CELLS
        || !flow.patches().any(opens)
    {
        return;
    }
    let beside = neighbours(grid, 1);
    let met = |marks: &[u32], beside: &[[usize; 3]]| {
        openings_met(flow, grid, &parts(grid, marks.to_vec(), beside))
    };
    let mut marks = vec![NEW; grid.cells.iter().product()];
    mark_structures(&mut marks, grid, &structures);
    if !structures.is_empty()
        && let Some(patch) = imposed_without_way_out(&met(&marks, &beside))
    {
        findings.error(
            &path_of_imposed(patch),
            format!(
                "the water of `{}` cannot reach another opening: structures block every path",
                patch.name
            ),
            "leave a gap of at least one cell, or remove the opening",
        );
        findings.depends(DEPENDS);
        return;
    }
    for body in bodies {
        let ball = (body.position, body.radius);
        mark_body(&mut marks, grid, ball, body.solid.as_ref());
    }
    for block in blocks {
        let ball = (block.position.into(), block.shape.radius());
        mark_body(&mut marks, grid, ball, Some(block));
    }
    let all = met(&marks, &beside);
    if let Some(patch) = imposed_without_way_out(&all) {
        findings.unstable(
            &path_of_imposed(patch),
            format!(
                "the water of `{}` cannot reach another opening: fixed bodies and structures block every path, and \
                 its density changes until the run ends",
                patch.name
            ),
            "leave a gap of at least one cell, or remove the opening",
        );
        findings.depends(DEPENDS);
        return;
    }
    free_pressures(&all, findings);
    if let Some(pockets) = pockets {
        let reach = reach_of_links(flow);
        let part = parts(grid, marks, &neighbours(grid, reach));
        fed_pocket(
            &openings_met(flow, grid, &part),
            grid,
            &part,
            pockets,
            findings,
        );
    }
}

/// Reports the first opening that feeds a closed pocket of water until the guard of the density ends the run.
fn fed_pocket(
    openings: &[MetOpening<'_>],
    grid: &Grid,
    part: &[u32],
    pockets: Pockets,
    findings: &mut Findings,
) {
    let open = |number: &u32| {
        let mut free = openings.iter().filter(|one| one.free);
        free.any(|one| one.parts.contains_key(number))
    };
    for one in openings.iter().filter(|one| one.imposed != 0.0) {
        for (number, cells) in one.parts.iter().filter(|(number, _)| !open(number)) {
            let size = part.iter().filter(|known| *known == number).count();
            let way = RIM * one.imposed.abs() * pockets.end / grid.spacing;
            // A single cell ran.
            if size < 2 || way * real(*cells) <= pockets.max_compression * real(size) {
                continue;
            }
            findings.unstable(
                &path_of_imposed(one.patch),
                format!(
                    "the water of `{}` in {cells} of its {} cells cannot reach another opening: fixed bodies enclose a \
                     pocket of {size} cells there, whose density changes until the run ends",
                    one.patch.name, one.cells
                ),
                "move the bodies away from the opening, or end its patch in front of them",
            );
            findings.depends(DEPENDS);
            return;
        }
    }
}

/// Reports the first opening with the state of the water that reaches an imposed flow but no imposed pressure, if
/// there is a pressure elsewhere: nothing determines the pressure of its water. Pockets of an opening that reaches
/// the pressure elsewhere do not count.
fn free_pressures(openings: &[MetOpening<'_>], findings: &mut Findings) {
    let Some(holding) = openings.iter().find(|one| one.holds) else {
        return;
    };
    let holds = |part: &u32| {
        let mut held = openings.iter().filter(|one| one.holds);
        held.any(|one| {
            let here = one.parts.get(part).copied().unwrap_or(0);
            real(here) >= MOSTLY_COVERED * real(one.cells)
        })
    };
    let driven = |part: &u32| {
        let mut imposing = openings.iter().filter(|one| one.imposed != 0.0);
        imposing.any(|one| one.parts.contains_key(part))
    };
    let mut free = openings
        .iter()
        .filter(|one| one.floats && one.parts.keys().any(driven) && !one.parts.keys().any(holds));
    if let Some(MetOpening { patch, .. }) = free.next()
        && let Some(path) = patch.path("mean_pressure")
    {
        findings.unstable(
            &path,
            format!(
                "nothing determines the pressure of the water at `{}`: fixed bodies and structures part it from `{}` \
                 and from every other opening that holds a pressure, or cover nearly all of that opening",
                patch.name, holding.patch.name
            ),
            Remedy::from("state its mean pressure, or leave a wider gap".to_owned())
                .set(path.clone(), 0.0),
        );
        findings.depends(DEPENDS);
    }
}

/// Opening with the connected parts of the water that it meets.
struct MetOpening<'a> {
    patch: &'a ScenePatch,
    /// Mean imposed inflow; 0 if the flow is free.
    imposed: f64,
    /// `true` if the flow is free.
    free: bool,
    /// `true` if the opening holds a pressure, or takes that of the water.
    holds: bool,
    floats: bool,
    /// Number of its cells.
    cells: usize,
    /// Number of its cells in each part of the water.
    parts: BTreeMap<u32, usize>,
}

/// Returns the first opening with a considerable part of the imposed flow that has no way out.
fn imposed_without_way_out<'a>(openings: &[MetOpening<'a>]) -> Option<&'a ScenePatch> {
    let size = |one: &MetOpening<'_>, part: u32| {
        one.imposed * real(one.parts.get(&part).copied().unwrap_or(0))
    };
    let all: f64 = (openings.iter())
        .flat_map(|one| one.parts.keys().map(|part| size(one, *part).abs()))
        .sum();
    let closed = |part: &u32| {
        let sum: f64 = openings.iter().map(|one| size(one, *part)).sum();
        let free = |one: &MetOpening<'_>| one.free && one.parts.contains_key(part);
        sum.abs() > CONSIDERABLE * all && !openings.iter().any(free)
    };
    let imposing = |one: &&MetOpening<'_>| one.imposed != 0.0 && one.parts.keys().any(closed);
    openings.iter().find(imposing).map(|one| one.patch)
}

fn path_of_imposed(patch: &ScenePatch) -> String {
    let path = patch.path("profile");
    path.unwrap_or_else(|| format!("{PATH}.boundaries"))
}

/// Returns the openings with the connected parts of the water that they meet; `part` has that of each cell, or the
/// mark of a solid.
fn openings_met<'a>(flow: &'a Flow, grid: &Grid, part: &[u32]) -> Vec<MetOpening<'a>> {
    let openings = openings(flow.patches(), grid);
    let mut found: Vec<MetOpening<'a>> = Vec::new();
    for face in Face::ALL {
        let patches = &flow.faces[face.index()];
        let first = found.len();
        found.extend(patches.iter().map(|patch| {
            let model = patch.condition.model();
            let inflow = model.largest_inflow(&patch.imposed_at(grid, PATH));
            let free = inflow == Inflow::Any;
            let holds = model.holds_pressure(&openings);
            MetOpening {
                patch,
                imposed: if let Inflow::Mean(mean) = inflow {
                    mean
                } else {
                    0.0
                },
                free,
                holds: free && holds,
                floats: free && !holds,
                cells: 0,
                parts: BTreeMap::new(),
            }
        }));
        for cell in face_cells(grid, face) {
            let holds = |one: &MetOpening<'_>| {
                let mut others = (0..3).filter(|a| *a != face.axis());
                others.all(|a| (one.patch.from[a]..one.patch.to[a]).contains(&cell[a]))
            };
            let here = part[index(grid, cell)];
            if let Some(one) = found[first..].iter_mut().rev().find(|one| holds(one)) {
                one.cells += 1;
                if here < NEW {
                    *one.parts.entry(here).or_default() += 1;
                }
            }
        }
    }
    found
}

/// Returns the position of a cell in a list of all cells.
fn index(grid: &Grid, cell: [usize; 3]) -> usize {
    (cell[2] * grid.cells[1] + cell[1]) * grid.cells[0] + cell[0]
}

/// Returns the cells at a face.
pub(crate) fn face_cells(grid: &Grid, face: Face) -> Vec<[usize; 3]> {
    let axis = face.axis();
    if axis >= grid.dimension || grid.periodic[axis] {
        return Vec::new();
    }
    let (mut from, mut to) = ([0; 3], grid.cells);
    if face.is_max() {
        from[axis] = grid.cells[axis] - 1;
    } else {
        to[axis] = 1;
    }
    let mut cells = Vec::new();
    for z in from[2]..to[2] {
        for y in from[1]..to[1] {
            cells.extend((from[0]..to[0]).map(|x| [x, y, z]));
        }
    }
    cells
}

/// Marks the cells with centres inside structures.
fn mark_structures(marks: &mut [u32], grid: &Grid, structures: &[&Structure]) {
    if structures.is_empty() {
        return;
    }
    let cells = grid.cells;
    for z in 0..cells[2] {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let cell = [x, y, z];
                let mut at = grid.centre(cell);
                if grid.dimension == 2 {
                    at[2] = 0.0;
                }
                if structures.iter().any(|one| one.solid.distance(at) < 0.0) {
                    marks[index(grid, cell)] = SOLID;
                }
            }
        }
    }
}

/// Marks the cells with centres inside a ball, or inside a polyhedron in it, and inside their periodic images.
fn mark_body(
    marks: &mut [u32],
    grid: &Grid,
    (centre, radius): ([f64; 3], f64),
    solid: Option<&PlacedPolyhedron>,
) {
    let planes = solid.map_or_else(Vec::new, PlacedPolyhedron::half_spaces);
    // Cells along an axis that the ball reaches, each with its place relative to the centre.
    let reached = |a: usize| -> Vec<(usize, f64)> {
        if a >= grid.dimension {
            return vec![(0, 0.0)];
        }
        let (count, h) = (real(grid.cells[a]), grid.spacing);
        let inside = grid.periodic[a];
        let [first, last] = [-1.0, 1.0].map(|sign| {
            let end = (centre[a] + sign * radius) / h - 0.5;
            let most = if inside { 2.0 * count } else { count - 1.0 };
            end.clamp(if inside { -count } else { 0.0 }, most)
        });
        let mut cells = Vec::new();
        let mut cell = first.ceil();
        while cell <= last {
            let own = whole(cell.rem_euclid(count)).min(grid.cells[a] - 1);
            cells.push((own, (cell + 0.5) * h - centre[a]));
            cell += 1.0;
        }
        cells
    };
    let [xs, ys, zs] = [reached(0), reached(1), reached(2)];
    for (k, z) in &zs {
        for (j, y) in &ys {
            for (i, x) in &xs {
                let from = Vector3::new(*x, *y, *z);
                let at = from + Vector3::from(centre);
                let within =
                    |plane: &dem::polyhedron::HalfSpace| plane.normal.dot(&at) < plane.offset;
                if from.norm() < radius && planes.iter().all(within) {
                    marks[index(grid, [*i, *j, *k])] = SOLID;
                }
            }
        }
    }
}

/// Returns the offsets to the neighbours of a cell that are at most `most` steps along axes away, one along each.
fn neighbours(grid: &Grid, most: usize) -> Vec<[usize; 3]> {
    // An offset of -1 as that of a periodic axis.
    let offsets = |a: usize| {
        if a < grid.dimension {
            vec![0, 1, grid.cells[a] - 1]
        } else {
            vec![0]
        }
    };
    let mut all = Vec::new();
    for z in offsets(2) {
        for y in offsets(1) {
            all.extend(offsets(0).into_iter().map(|x| [x, y, z]));
        }
    }
    let steps = |offset: &[usize; 3]| offset.iter().filter(|n| **n > 0).count();
    all.retain(|offset| (1..=most).contains(&steps(offset)));
    all
}

/// Water among the solids that never move, for solids that come and go.
pub(crate) struct Ways<'a> {
    flow: &'a Flow,
    grid: &'a Grid,
    marks: Vec<u32>,
    reach: Vec<[usize; 3]>,
}

impl<'a> Ways<'a> {
    /// Returns the water of a scene; none if it has too many cells.
    pub(crate) fn new(flow: &'a Flow, grid: &'a Grid, solids: &Obstacles<'_>) -> Option<Self> {
        let cells = grid.cells.iter().product::<usize>();
        if cells > MAX_CELLS / 10 {
            return None;
        }
        let mut marks = vec![NEW; cells];
        let structures = solids.structures.iter().filter(|one| one.stops.water());
        mark_structures(&mut marks, grid, &structures.collect::<Vec<_>>());
        for body in solids.bodies {
            if body.mobility == Mobility::Fixed {
                let ball = (body.position, body.radius);
                mark_body(&mut marks, grid, ball, body.solid.as_ref());
            }
        }
        let reach = neighbours(grid, reach_of_links(flow));
        Some(Self {
            flow,
            grid,
            marks,
            reach,
        })
    }

    /// Returns the first opening whose imposed flow has no way out with a ball at a place \[m\], and the relative
    /// change of the density of its water per time \[1/s\]; none if all have one.
    pub(crate) fn closed_by(&self, centre: [f64; 3], radius: f64) -> Option<(&'a ScenePatch, f64)> {
        let mut marks = self.marks.clone();
        mark_body(&mut marks, self.grid, (centre, radius), None);
        let part = parts(self.grid, marks, &self.reach);
        let met = openings_met(self.flow, self.grid, &part);
        let patch = imposed_without_way_out(&met)?;
        let here = met.iter().find(|one| std::ptr::eq(one.patch, patch))?;
        let (number, cells) = here.parts.iter().max_by_key(|(_, cells)| **cells)?;
        let water = part.iter().filter(|known| *known == number).count();
        let inflow = here.imposed.abs() * real(*cells);
        Some((patch, inflow / (self.grid.spacing * real(water))))
    }
}

/// Connected parts of the water among solids that never move.
pub(crate) struct WaterParts(Vec<u32>);

impl WaterParts {
    /// Returns the parts of the water of a scene; none if it has too many cells.
    pub(crate) fn new(flow: &Flow, grid: &Grid, solids: &Obstacles<'_>) -> Option<Self> {
        let cells = grid.cells.iter().product::<usize>();
        if cells > MAX_CELLS {
            return None;
        }
        let mut marks = vec![NEW; cells];
        let structures = solids.structures.iter().filter(|one| one.stops.water());
        mark_structures(&mut marks, grid, &structures.collect::<Vec<_>>());
        let bodies = solids.bodies.iter();
        for body in bodies.filter(|body| body.mobility == Mobility::Fixed) {
            let ball = (body.position, body.radius);
            mark_body(&mut marks, grid, ball, body.solid.as_ref());
        }
        let blocks = solids.blocks.iter().flat_map(|blocks| &blocks.list);
        for block in blocks.filter(|block| block.fixed) {
            let ball = (block.solid.position.into(), block.solid.shape.radius());
            mark_body(&mut marks, grid, ball, Some(&block.solid));
        }
        let reach = neighbours(grid, reach_of_links(flow));
        Some(Self(parts(grid, marks, &reach)))
    }

    /// Returns the part to which a cell belongs; none in a solid.
    pub(crate) fn part(&self, grid: &Grid, cell: [usize; 3]) -> Option<u32> {
        let part = self.0[index(grid, cell)];
        (part < NEW).then_some(part)
    }
}

/// Returns the largest number of axes along which a link leads: populations pass between two cells of a solid that
/// touch at an edge or a corner.
fn reach_of_links(flow: &Flow) -> usize {
    if flow.models.lattice == VelocitySet::D3Q27 {
        3
    } else {
        2
    }
}

/// Returns the connected part to which each cell belongs, where each cell is connected to its neighbours.
fn parts(grid: &Grid, mut part: Vec<u32>, neighbours: &[[usize; 3]]) -> Vec<u32> {
    let cells = grid.cells;
    let mut next = 0;
    let mut stack = Vec::new();
    for start in 0..part.len() {
        if part[start] != NEW {
            continue;
        }
        part[start] = next;
        stack.push(start);
        while let Some(at) = stack.pop() {
            let cell = [
                at % cells[0],
                at / cells[0] % cells[1],
                at / (cells[0] * cells[1]),
            ];
            for offset in neighbours {
                let other: [usize; 3] = std::array::from_fn(|a| (cell[a] + offset[a]) % cells[a]);
                let near = (0..3).all(|a| grid.periodic[a] || cell[a].abs_diff(other[a]) <= 1);
                let to = index(grid, other);
                if near && part[to] == NEW {
                    part[to] = next;
                    stack.push(to);
                }
            }
        }
        next += 1;
    }
    part
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::Severity;
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns the finding with some words on water of 40 x 20 cells that enters on the left and leaves on the right
    /// with its own state, above a pressure in a patch of the floor; a fixed disc of 8 cells in radius stands at some
    /// place.
    fn finding(disc: [f64; 2], outlet: &Value, words: &str) -> Option<Severity> {
        let case = json!({
            "domain": {"size": [0.04, 0.02], "spacing": 0.001},
            "materials": {"steel": {"density": 7800}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8, "boundaries": [
                    {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [1e-3, 0]},
                        "ramp_time": 1}}},
                    {"name": "out", "face": "x_max", "condition": outlet},
                    {"name": "drain", "face": "y_min", "condition": {"pressure": {"value": 0}},
                     "patch": {"from": [0.016, 0], "to": [0.024, 0.02]}}]}},
            "bodies": [{"name": "plug", "shape": {"disc": {"radius": 0.008}}, "position": disc,
                        "motion": {"fixed": {}}, "material": "steel"}],
            "time": {"end": 20}
        });
        let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let found = plan.warnings.iter().find(|p| p.reason.contains(words));
        found.map(|p| p.severity)
    }

    #[test]
    fn water_that_no_opening_holds_at_a_pressure_is_named() {
        let words = "nothing determines the pressure of the water at `out`";
        let outflow = json!({"outflow": {}});
        let convective = json!({"convective_outflow": {}});
        // The disc covers the drain, or leaves half of it open.
        assert_eq!(
            finding([0.02, 0.002], &outflow, words),
            Some(Severity::Unstable)
        );
        assert_eq!(
            finding([0.02, 0.002], &convective, words),
            Some(Severity::Unstable)
        );
        assert_eq!(finding([0.028, 0.002], &outflow, words), None);
        let held = json!({"outflow": {"mean_pressure": 0}});
        assert_eq!(finding([0.02, 0.002], &held, words), None);
        let pressure = json!({"pressure": {"value": 0}});
        assert_eq!(finding([0.02, 0.002], &pressure, words), None);
    }

    #[test]
    fn imposed_water_that_fixed_bodies_enclose_is_named() {
        let words = "fixed bodies and structures block every path";
        let wall = json!({"no_slip": {}});
        assert_eq!(
            finding([0.02, 0.002], &wall, words),
            Some(Severity::Unstable)
        );
        assert_eq!(finding([0.028, 0.002], &wall, words), None);
    }

    /// Checks that a disc of 5 cells in radius that closes the corner of an inlet is named, not one a cell away
    /// from the wall. Its runs ended at a density 27 % too high, with links and in saturated cells.
    #[test]
    fn a_pocket_that_an_inlet_feeds_is_named() {
        let severity = |y: f64, coupling: Value| {
            let case = json!({
                "domain": {"size": [0.008, 0.013], "spacing": 0.0005},
                "materials": {"steel": {"density": 7800}},
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8, "boundaries": [
                        {"name": "in", "face": "x_min", "condition": {"velocity": {
                            "profile": {"parabolic": {"peak": 0.004}}, "ramp_time": 0.1}}},
                        {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
                "bodies": [{"name": "plug", "shape": {"disc": {"radius": 0.0025}}, "position": [0.0027, y],
                            "motion": {"fixed": {}}, "material": "steel"}],
                "coupling": coupling,
                "time": {"end": 5}
            });
            let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
            let plan = Plan::prepare(document).unwrap();
            let mut found = plan.warnings.iter();
            found
                .find(|p| p.reason.contains("enclose a pocket"))
                .map(|p| p.severity)
        };
        let links = json!({"bounce_back": {"scheme": "half_way"}});
        assert_eq!(severity(0.0103, links.clone()), Some(Severity::Unstable));
        let cells = json!({"partially_saturated": {}});
        assert_eq!(severity(0.0103, cells), Some(Severity::Unstable));
        assert_eq!(severity(0.0097, links), None);
    }
}
