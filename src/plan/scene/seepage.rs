//! Seepage of a scene: its coarse grid, and the conditions on parts of the faces.

mod coarse;
mod drains;
mod piping;
mod polygons;
mod terrain;
mod unsaturated;
mod zones;

use base::vector::{dot, norm};
pub(crate) use coarse::grid_of;
pub use coarse::rescaled_widths;
pub use drains::Drain;
pub use piping::PipingScene;

use super::aligned_box::AlignedBox;
use super::findings::{Findings, number};
use super::grains::Grains;
use super::grid::Grid;
use super::machine;
use super::structures::{Structure, spread};
use super::unique;
use base::error::Remedy;
use base::number::{real, whole};
use case::Case;
use case::darcy::{self as written_as, Darcy, InitialState};
use case::fluid::Fluid;
use case::geometry::Face;
use darcy::cut_cells::centre_of_water;
use darcy::grid::GradedFaces;
use darcy::{Condition, GridAxis, SeepageGrid as CoarseGrid, Zones};
use serde::Serialize;
use serde_json::json;
use std::sync::Arc;
use structure::Images;

/// Path of the seepage in a case.
pub(crate) const PATH: &str = "fluid.darcy";
/// Memory per cell, on every rank \[bytes\]: coefficients, vectors, multigrid levels and the state before a coupling.
/// Measured as the difference of two sizes: 1,068 in space (216,000 and 729,000 cells), 1,145 in a plane.
pub(crate) const CELL_BYTES: f64 = 1150.0;
/// Default number of solid steps between two couplings, then the maximum.
const USUAL_INTERVAL: u32 = 100;
const MAX_INTERVAL: u32 = 1_000_000;
/// Default number of clock steps between outputs of a transient flow.
const TRANSIENT_INTERVAL: u32 = 10;
/// Maximum edge of a cell in median diameters, above which the plan warns (Cundall 2000 and the published model of
/// ground fissures use 1 to 4 mean diameters).
const USUAL_DIAMETERS: f64 = 4.0;

/// Resolved seepage, in SI.
#[derive(Clone, Debug, Serialize)]
pub struct Seepage {
    /// Fields as written.
    pub written: Darcy,
    /// Longest coupling interval for the requested accuracy \[s\]; none if the case states the interval or no accuracy.
    pub coupling_time: Option<f64>,
    /// Cells of the coarse grid; 1 along z in 2-D.
    pub cells: [usize; 3],
    /// Lower corner \[m\].
    pub origin: [f64; 3],
    /// Width of the cells along each axis, of the narrowest ones if the axis is graded \[m\]; 1 along z in 2-D.
    pub spacing: [f64; 3],
    /// Faces of graded axes \[m\].
    #[serde(skip)]
    pub graded: GradedFaces,
    /// Unit normals n away from the water and offsets d of the planes n·x ≤ d that enclose it \[m\].
    pub planes: Vec<([f64; 3], f64)>,
    /// `true` for the faces of the grid that are walls for grains and open water, lower and upper face along each
    /// axis.
    pub walls: [[bool; 2]; 3],
    /// Name of the boundary.
    pub patches: Vec<SeepagePatch>,
    /// Parts of the surface of the ground, then drains in it.
    pub drains: Vec<Drain>,
    /// Backward erosion piping.
    pub piping: Option<PipingScene>,
    /// Permeabilities and porosities by zone, on the grid.
    #[serde(skip)]
    pub zones: Option<Arc<Zones>>,
    /// Index of the soil of each cell: 0 for the soil of `unsaturated`, then the zones with a soil of their own in
    /// their order; empty if no zone has one.
    #[serde(skip)]
    pub soil_of: Vec<u8>,
    /// Porosity to which the values of each cell refer where unsaturated ground follows the grains, 0 for other cells;
    /// empty if no zone follows them.
    #[serde(skip)]
    pub following: Vec<f64>,
    /// Structures in contact with the water.
    #[serde(skip)]
    pub solids: Vec<Arc<Images>>,
}

/// Condition on a part of a face of the coarse grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeepagePatch {
    /// Name.
    pub name: String,
    /// The face.
    pub face: Face,
    /// First cell along each axis.
    pub from: [usize; 3],
    /// One past the last cell along each axis.
    pub to: [usize; 3],
    /// Condition at time 0.
    pub condition: Condition,
    /// Times \[s\] and values of the condition; empty if it is constant.
    pub history: Vec<[f64; 2]>,
}

impl SeepagePatch {
    /// Returns the range of cells along an axis; empty if a case gives the ends in the wrong order, which is
    /// refused separately.
    fn cells(&self, axis: usize) -> usize {
        self.to[axis].saturating_sub(self.from[axis])
    }
}

/// Returns `true` if the memory suffices for the cells; reports a finding if it does not, before anything is allocated
/// for each cell.
fn fits(cells: &[usize; 3], case: &Case, findings: &mut Findings) -> bool {
    let number_of_cells: f64 = cells.iter().map(|n| real(*n)).product();
    let needed = number_of_cells * CELL_BYTES;
    let available = machine::memory(case.guards.memory_gib);
    let Some(available) = available.filter(|available| needed > *available) else {
        return true;
    };
    let gigabytes = |bytes: f64| number(bytes / 1e9);
    findings.error(
        &format!("{PATH}.grid"),
        format!(
            "the grid has {} cells, which need {} GB of memory, but {} GB are available",
            number(number_of_cells),
            gigabytes(needed),
            gigabytes(available)
        ),
        format!(
            "use at most {} cells, or set guards.memory_gib to the memory of all machines",
            number((0.75 * available / CELL_BYTES).floor())
        ),
    );
    false
}

impl Seepage {
    pub(crate) fn resolve(
        case: &Case,
        grid: &Grid,
        grains: Option<&Grains>,
        structures: &[Structure],
        findings: &mut Findings,
    ) -> Option<Self> {
        let Some(Fluid::Darcy(written)) = &case.fluid else {
            return None;
        };
        if grid.periodic.iter().any(|p| *p) {
            findings.error(
                "domain.periodic",
                "seepage does not support periodic axes",
                Remedy::from("omit `periodic`").set("domain.periodic", json!([])),
            );
        }
        let coarse = coarse::resolve(written, grid, findings)?;
        if !fits(&coarse.cells, case, findings) {
            return None;
        }
        let planes = planes(written, grid, findings);
        let mut scene = Self {
            written: written.clone(),
            coupling_time: None,
            cells: coarse.cells,
            origin: coarse.origin,
            spacing: coarse.spacing,
            graded: coarse.graded,
            planes,
            walls: [[false; 2]; 3],
            patches: Vec::new(),
            drains: Vec::new(),
            piping: None,
            zones: None,
            soil_of: Vec::new(),
            following: Vec::new(),
            solids: (structures.iter().filter(|s| s.stops.water()))
                .map(|s| Arc::clone(&s.solid))
                .collect(),
        };
        let (origin, end) = (scene.origin, scene.end());
        for face in &case.box_walls {
            let (a, upper) = (face.axis(), usize::from(face.is_max()));
            let (at, edge) = if face.is_max() {
                (end[a], grid.size[a])
            } else {
                (origin[a], 0.0)
            };
            scene.walls[a][upper] = (at - edge).abs() <= 1e-6 * scene.spacing[a];
        }
        if let Some(gravity) = &case.gravity {
            scene.resolve_surface(gravity.to_array());
        }
        scene.patches = scene.patches_of(grid, grains.is_some(), findings);
        scene.drains = scene.terrain_of(case, grid, findings);
        scene.drains.extend(scene.drains_of(grid, findings));
        scene.zones = scene.zones_of(case, grid, findings);
        scene.soil_of = scene.soils(case, grid);
        scene.following = scene.following(case, grid, findings);
        scene.piping = scene.piping_of(case, grid, findings);
        scene.check(case, grid, grains, findings);
        Some(scene)
    }

    /// Returns the number of cells.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        self.cells.iter().product()
    }

    /// Returns the conditions of boundaries and drains.
    pub fn conditions(&self) -> impl Iterator<Item = Condition> {
        let drains = self.drains.iter().map(|drain| drain.condition);
        self.patches
            .iter()
            .map(|patch| patch.condition)
            .chain(drains)
    }

    /// Returns `true` if the flow is transient.
    #[must_use]
    pub fn is_transient(&self) -> bool {
        let soil = self.written.unsaturated.as_ref();
        soil.is_some_and(|soil| soil.transient.is_some())
    }

    /// Returns `true` if the water stored at the start of a transient flow determines the pressure, so that no
    /// condition has to.
    #[must_use]
    pub fn has_stored_start(&self) -> bool {
        let soil = self.written.unsaturated.as_ref();
        soil.and_then(|soil| soil.transient.as_ref())
            .is_some_and(|flow| flow.initial != InitialState::Steady)
    }

    /// Returns the number of solid steps \[each of this time, s\] between two couplings; `longest` is the longest
    /// time between couplings that is known to be accurate \[s\].
    #[must_use]
    pub fn coupling_interval(&self, solid_time_step: f64, longest: Option<f64>) -> u32 {
        let steps = |time: f64| {
            let steps = whole((time / solid_time_step).clamp(1.0, f64::from(MAX_INTERVAL)));
            u32::try_from(steps).unwrap_or(MAX_INTERVAL)
        };
        let usual = if self.is_transient() {
            TRANSIENT_INTERVAL
        } else {
            USUAL_INTERVAL
        };
        let wanted = self.coupling_time.map_or(usual, steps);
        let chosen = longest.map_or(wanted, |time| wanted.min(steps(time)));
        self.written.coupling_interval.unwrap_or(chosen)
    }

    /// Returns the centre of a patch \[m\].
    #[must_use]
    pub fn centre(&self, patch: &SeepagePatch) -> [f64; 3] {
        std::array::from_fn(|a| {
            let at = if a != patch.face.axis() {
                if let Some(faces) = &self.graded[a] {
                    return 0.5 * (faces[patch.from[a]] + faces[patch.to[a]]);
                }
                0.5 * (real(patch.from[a]) + real(patch.to[a]))
            } else if patch.face.is_max() {
                return self.axis(a).end();
            } else {
                0.0
            };
            self.origin[a] + at * self.spacing[a]
        })
    }

    /// Returns the smallest edge of a cell \[m\].
    #[must_use]
    pub fn smallest_edge(&self, dimension: usize) -> f64 {
        self.spacing[..dimension]
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns the height of the grid along gravity, or its longest edge without gravity \[m\].
    pub(crate) fn height(&self, gravity: [f64; 3], dimension: usize) -> f64 {
        let edge = |a: usize| self.axis(a).length(0, self.cells[a]);
        let axis = (0..dimension).max_by(|&a, &b| {
            let order = gravity[a].abs().total_cmp(&gravity[b].abs());
            order.then(edge(a).total_cmp(&edge(b)))
        });
        axis.map_or(0.0, edge)
    }

    /// Returns the largest difference between imposed pressures beyond hydrostatic differences \[Pa\].
    pub(crate) fn pressure_drop(&self, gravity: [f64; 3]) -> f64 {
        let density = self.written.density;
        let strength = norm(gravity);
        let excess = |patch: &SeepagePatch| match patch.condition {
            Condition::Pressure { value } => {
                let place = self.centre(patch);
                let below = dot(gravity, place);
                Some(value - density * below)
            }
            Condition::Head { value } => Some(density * strength * value),
            Condition::SeepageFace { level } => {
                let lowest = self.lowest(patch, gravity);
                Some(density * strength * level.map_or(lowest, |level| level.max(lowest)))
            }
            _ => None,
        };
        let imposed = || {
            let drains = self.drains.iter();
            let of_drains = drains.filter_map(|drain| self.drain_pressure(drain, gravity));
            self.patches.iter().filter_map(excess).chain(of_drains)
        };
        let high = imposed().fold(f64::NEG_INFINITY, f64::max);
        let low = imposed().fold(f64::INFINITY, f64::min);
        (high - low).max(0.0)
    }

    /// Returns the lowest elevation of a patch \[m\].
    fn lowest(&self, patch: &SeepagePatch, gravity: [f64; 3]) -> f64 {
        let strength = norm(gravity);
        let lower = |a: usize| {
            let up = -gravity[a] / strength;
            let ends = if a != patch.face.axis() {
                [patch.from[a], patch.to[a]]
            } else if patch.face.is_max() {
                [self.cells[a]; 2]
            } else {
                [0; 2]
            };
            let at = ends.map(|end| up * self.axis(a).face(end));
            at[0].min(at[1])
        };
        (0..3).map(lower).sum()
    }

    fn patches_of(
        &self,
        grid: &Grid,
        with_grains: bool,
        findings: &mut Findings,
    ) -> Vec<SeepagePatch> {
        let mut patches = Vec::new();
        let mut known = Vec::new();
        for (n, boundary) in self.written.boundaries.iter().enumerate() {
            let path = format!("{PATH}.boundaries[{n}]");
            unique(
                &mut known,
                &boundary.name,
                &format!("{path}.name"),
                findings,
            );
            let axis = boundary.face.axis();
            if axis >= grid.dimension {
                findings.error(
                    &format!("{path}.face"),
                    "a 2-D problem does not have this face",
                    "use x_min, x_max, y_min or y_max",
                );
                continue;
            }
            let Some([from, to]) = self.cells_of_patch(boundary, grid, &path, findings) else {
                continue;
            };
            for a in (0..grid.dimension).filter(|&a| a != axis) {
                let across = to[a] - from[a];
                let odd = across % 2 == 1 && across < self.cells[a];
                if with_grains && boundary.patch.is_some() && odd {
                    findings.warn(
                        &format!("{path}.patch"),
                        format!(
                            "the opening is an odd number of cells ({}) wide along {}, which loads the grains \
                             unevenly",
                            across,
                            ["x", "y", "z"][a]
                        ),
                        "use an even number of cells, by a wider opening or finer cells",
                    );
                }
            }
            let mut patch = SeepagePatch {
                name: boundary.name.clone(),
                face: boundary.face,
                from,
                to,
                condition: boundary.condition,
                history: boundary.history.clone().unwrap_or_default(),
            };
            if let Some([_, value]) = patch.history.first() {
                patch.condition.set_value(*value);
            }
            if self.closed(&patch, grid.dimension) {
                let whole = boundary.patch.is_none();
                let path = format!("{path}.{}", if whole { "face" } else { "patch" });
                findings.error(
                    &path,
                    "the boundary lies completely behind a plane of the enclosure, so that no water can pass",
                    "move it into the water, or move the plane",
                );
            }
            if self.covered(&patch, grid.dimension) {
                let whole = boundary.patch.is_none();
                findings.error(
                    &format!("{path}.{}", if whole { "face" } else { "patch" }),
                    "structures cover the boundary completely, so that no water can pass",
                    "move the boundary or the structure",
                );
            }
            patches.push(patch);
        }
        patches
    }

    /// Returns the first cells and the ends of a patch, by axis; reports a finding if it contains no cell centre.
    fn cells_of_patch(
        &self,
        boundary: &written_as::SeepageBoundary,
        grid: &Grid,
        path: &str,
        findings: &mut Findings,
    ) -> Option<[[usize; 3]; 2]> {
        let (mut from, mut to) = ([0; 3], self.cells);
        let Some(extent) = &boundary.patch else {
            return Some([from, to]);
        };
        let low = AlignedBox::vector(grid, &extent.from, &format!("{path}.patch.from"), findings);
        let high = AlignedBox::vector(grid, &extent.to, &format!("{path}.patch.to"), findings);
        let axis = boundary.face.axis();
        for a in (0..grid.dimension).filter(|&a| a != axis) {
            // A cell belongs to a patch if its centre does.
            let axis = self.axis(a);
            (from[a], to[a]) = (axis.first_centre(low[a]), axis.first_centre(high[a]));
        }
        if !self.solids.is_empty() {
            let ends = [&low, &high];
            self.end_at_structures(boundary.face, ends, [&mut from, &mut to], grid);
        }
        if (0..grid.dimension).any(|a| a != axis && from[a] >= to[a]) {
            findings.error(
                &format!("{path}.patch"),
                "the patch contains no cell centre of the coarse grid",
                format!(
                    "the grid reaches from {:?} to {:?} m in cells of {}{:?} m",
                    &self.origin[..grid.dimension],
                    &self.end()[..grid.dimension],
                    if self.is_graded() { "at least " } else { "" },
                    &self.spacing[..grid.dimension]
                ),
            );
            return None;
        }
        Some([from, to])
    }

    /// Moves the ends of a patch by a cell where a structure cuts the end cells and leaves their water on the other
    /// side: water that a sheet pile separates from a patch does not belong to it.
    fn end_at_structures(
        &self,
        face: Face,
        ends: [&[f64; 3]; 2],
        found: [&mut [usize; 3]; 2],
        grid: &Grid,
    ) {
        let coarse = self.coarse_grid(grid.dimension);
        let axis = face.axis();
        let level = if face.is_max() {
            self.cells[axis] - 1
        } else {
            0
        };
        let [from, to] = found;
        let (first, last) = (*from, *to);
        // Mean position of the water in a layer of cells across an axis, over the patch; none if there is no water.
        let water = |a: usize, at: usize| {
            let others: Vec<usize> = (0..grid.dimension)
                .filter(|&b| b != a && b != axis)
                .collect();
            let count = others.iter().map(|&b| last[b].saturating_sub(first[b]));
            let (mut sum, mut wet) = (0.0, 0_usize);
            for mut n in 0..count.product() {
                let mut cell = [0; 3];
                (cell[axis], cell[a]) = (level, at);
                for &b in &others {
                    let count = last[b] - first[b];
                    cell[b] = first[b] + n % count;
                    n /= count;
                }
                if let Some(centre) = centre_of_water(&coarse, &self.solids, cell) {
                    sum += centre[a];
                    wet += 1;
                }
            }
            let middle = self.axis(a).centre(at);
            let mean = (wet > 0).then(|| sum / real(wet));
            // Cells that no structure cuts keep their position.
            mean.filter(|mean| (mean - middle).abs() > 1e-6 * self.axis(a).width(at))
        };
        for (end, found) in ends.into_iter().zip([from, to]) {
            for a in (0..grid.dimension).filter(|&a| a != axis) {
                let (cell, x) = (found[a], end[a]);
                if cell > 0 && water(a, cell - 1).is_some_and(|w| w >= x) {
                    found[a] = cell - 1;
                } else if cell < self.cells[a] && water(a, cell).is_some_and(|w| w < x) {
                    found[a] = cell + 1;
                }
            }
        }
    }

    /// Returns the coarse grid in `dimension` dimensions.
    #[must_use]
    pub fn coarse_grid(&self, dimension: usize) -> CoarseGrid {
        CoarseGrid {
            cells: self.cells,
            origin: self.origin,
            spacing: self.spacing,
            dimension,
            graded: self.graded.clone(),
        }
    }

    /// Returns `true` if structures fill the cells of a patch.
    fn covered(&self, patch: &SeepagePatch, dimension: usize) -> bool {
        let axis = patch.face.axis();
        let across: Vec<usize> = (0..dimension).filter(|&a| a != axis).collect();
        let cells = across.iter().map(|&a| patch.cells(a));
        (0..cells.product()).all(|mut n: usize| {
            let mut at = [0.0; 3];
            let level = if patch.face.is_max() {
                self.cells[axis] - 1
            } else {
                0
            };
            at[axis] = self.axis(axis).centre(level);
            for &a in &across {
                let cells = patch.cells(a);
                at[a] = self.axis(a).centre(patch.from[a] + n % cells);
                n /= cells;
            }
            let least = 0.5 * self.smallest_edge(dimension);
            self.solids.iter().any(|solid| solid.distance(at) < -least)
        })
    }

    /// Returns `true` if the enclosure closes a patch: every cell face of it lies entirely behind one plane.
    fn closed(&self, patch: &SeepagePatch, dimension: usize) -> bool {
        let axis = patch.face.axis();
        let level = if patch.face.is_max() {
            self.end()[axis]
        } else {
            self.origin[axis]
        };
        let across: Vec<usize> = (0..dimension).filter(|&a| a != axis).collect();
        let cells = across.iter().map(|&a| patch.cells(a));
        (0..cells.product()).all(|mut n: usize| {
            let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
            (low[axis], high[axis]) = (level, level);
            for &a in &across {
                let cells = patch.cells(a);
                let cell = patch.from[a] + n % cells;
                low[a] = self.axis(a).face(cell);
                high[a] = low[a] + self.axis(a).width(cell);
                n /= cells;
            }
            self.planes.iter().any(|(outward, offset)| {
                // Corner of the face farthest on the side of the water.
                let deepest: f64 = (0..3)
                    .map(|a| (outward[a] * low[a]).min(outward[a] * high[a]))
                    .sum();
                deepest >= offset - 1e-9 * self.spacing[axis]
            })
        })
    }

    fn end(&self) -> [f64; 3] {
        std::array::from_fn(|a| self.axis(a).end())
    }

    /// Returns the cells of the coarse grid along an axis.
    #[must_use]
    pub fn axis(&self, axis: usize) -> GridAxis<'_> {
        GridAxis {
            cells: self.cells[axis],
            origin: self.origin[axis],
            spacing: self.spacing[axis],
            faces: self.graded[axis].as_deref(),
        }
    }

    /// Returns the width of the widest cells along an axis \[m\].
    #[must_use]
    pub fn widest(&self, axis: usize) -> f64 {
        let axis = self.axis(axis);
        (0..axis.cells).fold(axis.spacing, |most, cell| most.max(axis.width(cell)))
    }

    /// Returns `true` if the cells along any axis differ.
    #[must_use]
    pub fn is_graded(&self) -> bool {
        self.graded.iter().any(Option::is_some)
    }

    /// Checks the seepage against the rest of the case.
    fn check(&self, case: &Case, grid: &Grid, grains: Option<&Grains>, findings: &mut Findings) {
        self.check_conditions(case, findings);
        self.check_solids(grid.dimension, findings);
        self.check_laws(findings);
        self.check_unsaturated(case, grid, findings);
        let path = if let Some(own) = &self.written.grid {
            let name = if own.spacing.is_some() {
                "spacing"
            } else {
                "cells"
            };
            format!("{PATH}.grid.{name}")
        } else {
            "domain.spacing".to_owned()
        };
        if self.is_graded() {
            self.check_graded(case, findings);
        }
        if let Some(grains) = grains {
            self.check_edges(grains, grid.dimension, &path, findings);
        }
        if (0..grid.dimension).any(|a| self.cells[a] < 5) {
            findings.warn(
                &path,
                "the seepage grid has fewer than 5 cells along an axis",
                "use at least 5",
            );
        }
        if case.coupling.is_some() {
            findings.error(
                "coupling",
                "seepage acts on the grains through its own drag law, so that no coupling is needed",
                Remedy::take_out("remove the coupling", "coupling"),
            );
        }
        if case.time.warm_up.is_some() {
            findings.error(
                "time.warm_up",
                "seepage is steady at every coupling, so that it needs no warm-up",
                Remedy::take_out("remove it", "time.warm_up"),
            );
        }
        if case.grains.is_none() && case.bodies.is_empty() {
            self.check_without_grains(findings);
        }
    }

    /// Refuses what needs equal cells.
    fn check_graded(&self, case: &Case, findings: &mut Findings) {
        let equal = "state the number of equal cells along each axis in `cells`";
        if case.grains.is_some() || !case.bodies.is_empty() || case.blocks.is_some() {
            findings.error(
                &format!("{PATH}.grid.spacing"),
                "the porosity and the drag of grains and bodies need equal cells, but these cells have different \
                 widths",
                equal,
            );
        }
        if self.written.backward_erosion.is_some() {
            findings.error(
                &format!("{PATH}.backward_erosion"),
                "a pipe of backward erosion needs equal cells, but the cells of the grid have different widths",
                equal,
            );
        }
    }

    /// Checks that a condition determines the pressure, and that there is gravity if a condition needs it.
    fn check_conditions(&self, case: &Case, findings: &mut Findings) {
        if !self.has_stored_start() && !self.conditions().any(|condition| condition.holds()) {
            findings.error(
                &format!("{PATH}.boundaries"),
                "no boundary imposes a pressure or a head: the water has no outlet and its pressure is \
                 undetermined",
                "add a boundary with {\"pressure\": {\"value\": 0}} or {\"head\": {\"value\": 0}}",
            );
        }
        let weightless = case
            .gravity
            .as_ref()
            .is_none_or(|g| g.to_array().iter().all(|g| g.abs() <= 0.0));
        for (n, patch) in self.patches.iter().enumerate() {
            let needs = needs_gravity(&patch.condition);
            if needs && weightless {
                findings.error(
                    &format!("{PATH}.boundaries[{n}].condition"),
                    WEIGHTLESS,
                    "add `gravity`, or impose a pressure or a flux",
                );
            }
        }
        for drain in &self.drains {
            if weightless && needs_gravity(&drain.condition) {
                findings.error(
                    &format!("{PATH}.{}.condition", drain.path),
                    WEIGHTLESS,
                    "add `gravity`, or impose a pressure or a discharge",
                );
            }
        }
    }

    /// Refuses structures that leave the seepage no cell.
    fn check_solids(&self, dimension: usize, findings: &mut Findings) {
        if self.solids.is_empty() {
            return;
        }
        // The outermost cells of a solid that ends with the grid lie half an edge deep, up to rounding.
        let least = 0.5 * self.smallest_edge(dimension) * (1.0 - 1e-9);
        let axes: [GridAxis<'_>; 3] = std::array::from_fn(|a| self.axis(a));
        let filled = spread(self.cells).all(|cell| {
            let at = std::array::from_fn(|a| axes[a].centre(cell[a]));
            self.solids.iter().any(|solid| solid.distance(at) < -least)
        });
        if filled {
            findings.error(
                "structures",
                "structures cover the whole grid of the seepage, so that no cell is left for the water",
                "make them smaller, move them, or check that lengths are in m (the unit of a mesh is its `scale`)",
            );
        }
    }

    /// Checks the minimum porosity and the resistance law.
    fn check_laws(&self, findings: &mut Findings) {
        let written = &self.written;
        let cap = written.porosity_cap();
        if written.least_porosity >= cap {
            findings.error(
                &format!("{PATH}.least_porosity"),
                "the minimum porosity must be below `porosity_cap`",
                Remedy::from(format!("use a value below {cap}"))
                    .set(format!("{PATH}.least_porosity"), 0.5 * cap),
            );
        }
        if !written
            .resistance()
            .model()
            .supports_equations(written.equations)
        {
            findings.error(
                &format!("{PATH}.resistance"),
                "the equations \"as_printed\" allow only the resistance of Kozeny and Carman",
                Remedy::from(
                    "use \"equations\": \"corrected\", or \"resistance\": \"kozeny_carman\"",
                )
                .set(format!("{PATH}.equations"), "corrected"),
            );
        }
    }

    /// Checks the edges of the cells against the sizes of the grains.
    fn check_edges(&self, grains: &Grains, dimension: usize, path: &str, findings: &mut Findings) {
        let edge = self.smallest_edge(dimension);
        let diameter = 2.0 * grains.radii.map_or(0.0, |(_, largest)| largest);
        if edge < diameter {
            findings.error(
                path,
                format!(
                    "a seepage cell has an edge of {} m, but the largest grain has a diameter of {} m: a cell \
                     must be large enough to contain grains",
                    number(edge),
                    number(diameter)
                ),
                format!("use cells of at least {} m", number(diameter)),
            );
        }
        let spacing = self.spacing[..dimension].iter().copied();
        let widest = spacing.fold(0.0, f64::max);
        let too_small = |least: f64| widest > USUAL_DIAMETERS * 2.0 * least;
        // A bed has more grains than cells; fewer grains are a continuum. The percentiles are computed only if the
        // smallest grain could be too small.
        if grains.expected >= self.cell_count()
            && grains.radii.is_some_and(|(least, _)| too_small(least))
            && let Some(sizes) = grains.percentiles(dimension)
            && widest > USUAL_DIAMETERS * sizes.d50 * (1.0 + 1e-9)
        {
            findings.warn(
                path,
                format!(
                    "a seepage cell has an edge of {} m, {} times the median diameter d50 of {} m: pressure and \
                     porosity are means over a cell, so that smaller voids and openings are not resolved",
                    number(widest),
                    number(widest / sizes.d50),
                    number(sizes.d50)
                ),
                format!(
                    "use cells of 1 to {USUAL_DIAMETERS} median diameters, at most {} m",
                    number(USUAL_DIAMETERS * sizes.d50)
                ),
            );
        }
    }

    /// Checks zones in a case without grains: they form the bed, and all other cells are open water.
    fn check_without_grains(&self, findings: &mut Findings) {
        let Some(zones) = &self.zones else {
            findings.error(
                "grains",
                "seepage needs ground, but the case has neither grains nor zones",
                "add `grains`, or `zones` with a permeability",
            );
            return;
        };
        if !zones.need_no_grains() {
            findings.error(
                &format!("{PATH}.zones"),
                "the case has no grains, and a zone has no permeability that applies without grains",
                "define the permeability of each zone by `value`, `hydraulic_conductivity` or a raster, or add \
                 `grains`",
            );
        }
    }
}

const WEIGHTLESS: &str =
    "heads, rain, evaporation and seepage faces need gravity, but this case has none";

/// Returns `true` if a condition has no meaning without gravity.
fn needs_gravity(condition: &Condition) -> bool {
    matches!(
        condition,
        Condition::Head { .. }
            | Condition::Rain { .. }
            | Condition::SeepageFace { .. }
            | Condition::Evaporation { .. }
    )
}

fn planes(written: &Darcy, grid: &Grid, findings: &mut Findings) -> Vec<([f64; 3], f64)> {
    let written_as::Enclosure::Planes(planes) = &written.enclosure else {
        return Vec::new();
    };
    let mut all = Vec::new();
    for (n, plane) in planes.iter().enumerate() {
        let path = format!("{PATH}.enclosure.planes[{n}]");
        let point = AlignedBox::vector(grid, &plane.point, &format!("{path}.point"), findings);
        let normal = AlignedBox::vector(grid, &plane.normal, &format!("{path}.normal"), findings);
        let length = norm(normal);
        if !(length > 0.0 && length.is_finite()) {
            findings.error(
                &format!("{path}.normal"),
                "the normal has zero length",
                "write the direction from the plane to the water",
            );
            continue;
        }
        let outward = normal.map(|x| -x / length);
        all.push((outward, dot(outward, point)));
    }
    all
}
