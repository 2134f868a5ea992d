//! Boundary faces crossed by water, and the slabs of the solver.

use super::{Condition, Equations, Liquid, PressurePatch, PressureSettings};
use crate::enclosure::Openness;
use crate::grid::SeepageGrid;
use crate::layout::Layout;
use crate::multigrid::{Ground, cuts};
use base::vector::{dot, norm};
use decomposition::{ExactSum, Slabs, SplitAxis};

/// Boundary face of the grid, or of a drain in it, that may be crossed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Boundary {
    /// Index of the cell in the grid.
    pub(super) cell: usize,
    /// Position of the cell in the layout.
    pub(super) at: usize,
    /// Axis normal to the face.
    pub(super) axis: usize,
    /// `true` for the upper face of the cell.
    pub(super) upper: bool,
    /// Open area \[m2\].
    pub(super) area: f64,
    /// Fraction of the area of the patch, or of the volume of a well.
    pub(super) share: f64,
    /// `true` for a source of the cell, whose area is infinite, so that it has no flux.
    pub(super) source: bool,
    /// Index of the patch.
    pub(super) patch: usize,
    /// Reduced pressure on the face at zero pressure of its patch \[Pa\].
    pub(super) lift: f64,
    /// Fraction of the area that faces upwards.
    pub(super) up: f64,
    /// Conductance from the centre of the cell.
    pub(super) conductance: f64,
    /// Inflow beyond the two-point flux, where the permeability is inclined \[m³/s\].
    pub(super) extra: f64,
    /// Inflow in unsaturated ground \[m³/s\].
    pub(super) rate: f64,
    /// Derivative of the inflow beyond the two-point flux with respect to minus the reduced pressure of the cell.
    pub(super) response: f64,
}

impl Boundary {
    /// Returns the face with an imposed pressure and this conductance.
    pub(super) fn ground(&self, conductance: f64) -> Ground {
        Ground {
            at: self.at,
            axis: self.axis,
            conductance,
        }
    }
}

/// Returns the reduced pressure of a head: rho g h \[Pa\].
pub(super) fn head_pressure(liquid: &Liquid, settings: &PressureSettings, head: f64) -> f64 {
    let g = settings.gravity;
    liquid.density * norm(g) * head
}

/// Returns the slabs along the longest axis, cut between cells that the coarser grid merges.
pub(super) fn slabs(grid: &SeepageGrid, size: usize) -> Slabs {
    let axis = SplitAxis::longest(grid.cells);
    let cuts = cuts(grid, axis.index());
    let pairs = Slabs::even(axis, cuts.len() - 1, size, false);
    let bounds = pairs.bounds().iter().map(|b| cuts[*b]).collect();
    Slabs::from_bounds(axis, bounds, false).unwrap_or(pairs)
}

/// Returns the boundary faces of a patch, in ascending order of the positions of their cells.
pub(super) fn boundary(
    openness: &Openness,
    layout: &Layout,
    patches: &[PressurePatch],
    liquid: &Liquid,
    settings: &PressureSettings,
) -> Vec<Boundary> {
    let grid = &openness.grid;
    let gravity = settings.gravity;
    let strength = (gravity.iter().map(|g| g * g).sum::<f64>()).sqrt();
    let make = |index: usize, axis: usize, upper: bool, open: f64, patch: usize| {
        let cell = grid.cell(index);
        let mut centre = grid.centre(cell);
        centre[axis] += if upper { 0.5 } else { -0.5 } * grid.width(axis, cell);
        let lift = match settings.equations {
            Equations::Corrected => -liquid.density * dot(gravity, centre),
            Equations::Paper => 0.0,
        };
        let outward = if upper { 1.0 } else { -1.0 };
        let up = if strength > 0.0 {
            (-gravity[axis] * outward / strength).max(0.0)
        } else {
            0.0
        };
        Boundary {
            cell: index,
            at: layout.position(cell),
            axis,
            upper,
            area: open * grid.area(axis, cell),
            share: open * grid.area(axis, cell),
            source: false,
            patch,
            lift,
            up,
            conductance: 0.0,
            extra: 0.0,
            rate: 0.0,
            response: 0.0,
        }
    };
    let mut all = Vec::new();
    for index in 0..grid.count() {
        let cell = grid.cell(index);
        for axis in 0..grid.dimension {
            for upper in [false, true] {
                let edge = if upper { grid.cells[axis] - 1 } else { 0 };
                if cell[axis] != edge || openness.blocked(index) {
                    continue;
                }
                let covers = |p: &PressurePatch| p.covers(axis, upper, cell);
                let Some(patch) = patches.iter().rposition(covers) else {
                    continue;
                };
                let mut place = cell;
                place[axis] += usize::from(upper);
                let open = openness.faces[axis][openness.face(axis, place)];
                if open > 0.0 {
                    all.push(make(index, axis, upper, open, patch));
                }
            }
        }
    }
    let inside = |p: &(usize, &PressurePatch)| p.1.inside;
    let drains: Vec<usize> = patches
        .iter()
        .enumerate()
        .filter(inside)
        .map(|(n, _)| n)
        .collect();
    for face in &openness.drain_faces {
        if let Some(&patch) = drains.get(face.drain) {
            let mut face_of_drain = make(face.cell, face.axis, face.upper, face.open, patch);
            if face.source {
                face_of_drain.area = f64::INFINITY;
                face_of_drain.source = true;
                if grid.is_graded() {
                    face_of_drain.share = face.open * grid.volume(grid.cell(face.cell));
                }
            }
            all.push(face_of_drain);
        }
    }
    all.retain(|face| patches[face.patch].condition != (Condition::NoFlow {}));
    all.sort_by_key(|face| face.cell);
    divide_patches(&mut all, patches.len());
    all
}

/// Divides the area or volume of each face by that of its patch.
fn divide_patches(faces: &mut [Boundary], patches: usize) {
    let mut areas: Vec<ExactSum> = (0..patches).map(|_| ExactSum::new()).collect();
    for face in &*faces {
        areas[face.patch].add(face.share);
    }
    let areas: Vec<f64> = areas.iter().map(ExactSum::value).collect();
    for face in faces {
        face.share /= areas[face.patch];
    }
}
