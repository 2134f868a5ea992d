//! Measurements in the hole of an erosion run: sums over its cells, and the force on its faces.

use super::Start;
use crate::removal::boxed;
use crate::view::StateView;
use analysis::erosion_law::hole::HoleProfile;
use analysis::erosion_law::{HoleFaces, shear_by_gradient};
use base::number::{real, whole};
use base::units::LatticeUnits;
use decomposition::{Communicator, ExactSum, Fixed};
use dem::space::{Components, Space};
use plan::Plan;
use plan::scene::observe::ErosionLaw;

/// Maximum depth of a grain behind a face, in mean diameters, to count for the traction.
pub(super) const DEPTH_BEHIND: f64 = 2.0;
/// Maximum distance of a grain in front of a face, in mean diameters, to count for the traction: rough
/// faces protrude.
const DISTANCE_BEFORE: f64 = 0.5;
/// Box of the hole in the case, and its axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hole {
    pub(super) along: usize,
    pub(super) across: usize,
    pub(super) from: [f64; 3],
    pub(super) to: [f64; 3],
    /// Cells of the box along each axis: first cell, and one past the last.
    pub(super) cells: [[usize; 2]; 3],
    /// Depth of the box \[m\]; 1 in 2-D.
    pub(super) depth: f64,
}

impl Hole {
    pub(super) fn new(law: &ErosionLaw, plan: &Plan) -> Self {
        let grid = &plan.scene.grid;
        let along = law.flow_axis;
        let across = usize::from(along == 0);
        let cells = std::array::from_fn(|axis| {
            if axis >= grid.dimension {
                return [0, 1];
            }
            // A cell belongs to the box if its centre does.
            let edge = |x: f64| whole((x / grid.spacing - 0.5).ceil()).min(grid.cells[axis]);
            [edge(law.hole.from[axis]), edge(law.hole.to[axis])]
        });
        let third = 3 - along - across;
        Self {
            along,
            across,
            from: law.hole.from,
            to: law.hole.to,
            cells,
            depth: if third < grid.dimension {
                law.hole.to[third] - law.hole.from[third]
            } else {
                1.0
            },
        }
    }

    pub(super) fn third(&self) -> usize {
        3 - self.along - self.across
    }

    pub(super) fn length(&self) -> f64 {
        self.to[self.along] - self.from[self.along]
    }

    pub(super) fn width(&self) -> f64 {
        self.to[self.across] - self.from[self.across]
    }

    pub(super) fn middle(&self) -> f64 {
        0.5 * (self.from[self.across] + self.to[self.across])
    }

    /// Returns `true` if a coordinate is in the box along an axis. In 2-D the box has no bounds along the third axis.
    pub(super) fn spans(&self, axis: usize, x: f64, dimension: usize) -> bool {
        axis >= dimension || (self.from[axis]..self.to[axis]).contains(&x)
    }

    pub(super) fn covers(&self, axis: usize, cell: usize) -> bool {
        (self.cells[axis][0]..self.cells[axis][1]).contains(&cell)
    }
}

/// Sums over the cells of all ranks, in lattice units.
pub(super) struct Sums {
    /// Sums per row across the hole: velocity along the hole, number of solid cells, number of cells,
    /// and velocity in the mid-plane.
    pub(super) velocity: Vec<Fixed>,
    pub(super) solid: Vec<i64>,
    pub(super) cells: Vec<i64>,
    pub(super) middle: Vec<Fixed>,
    /// Sums per row in the planes directly before and behind the hole: density deviation and number of water cells.
    pub(super) deviation: [Vec<Fixed>; 2],
    pub(super) water: [Vec<i64>; 2],
    /// Largest speed of the water.
    pub(super) speed: f64,
}

impl Sums {
    /// Adds the sums of all ranks; the speed becomes the root of the largest square. Collective.
    fn reduce(&mut self, communicator: &Communicator) {
        let [before, behind] = &mut self.deviation;
        for fixed in [&mut self.velocity, &mut self.middle, before, behind] {
            Fixed::all_reduce(fixed, communicator);
        }
        let [before, behind] = &mut self.water;
        for counts in [&mut self.solid, &mut self.cells, before, behind] {
            communicator.all_reduce_sum_i64s(counts);
        }
        self.speed = communicator.all_reduce_max_f64(self.speed).sqrt();
    }

    /// Returns the solid fraction of each row.
    pub(super) fn solid_fractions(&self) -> Vec<f64> {
        let rows = self.solid.iter().zip(&self.cells);
        rows.map(|(&solid, &cells)| real(solid) / real(cells.max(1)))
            .collect()
    }

    /// Returns the mean solid fraction of the rows next to the hole.
    pub(super) fn solid_fraction_around(&self, hole: &Hole) -> f64 {
        let beside = |values: &[i64]| -> i64 {
            let rows = values.iter().enumerate();
            rows.filter(|(row, _)| !hole.covers(hole.across, *row))
                .map(|(_, n)| n)
                .sum()
        };
        real(beside(&self.solid)) / real(beside(&self.cells).max(1))
    }

    /// Returns the mean shear stress \[Pa\] at the faces from the velocity gradient; NaN if it cannot
    /// be measured.
    pub(super) fn shear(&self, units: &LatticeUnits, faces: HoleFaces, viscosity: f64) -> f64 {
        let rows = self.velocity.iter().zip(&self.cells);
        let velocity: Vec<f64> = rows
            .map(|(sum, &cells)| units.velocity_to_si(sum.to_f64() / real(cells.max(1))))
            .collect();
        shear_by_gradient(profile(units.spacing, &velocity), faces, viscosity)
            .map_or(f64::NAN, |shear| shear.mean())
    }

    /// Returns the mean pressures \[Pa\] upstream and downstream of the hole, up to a depth `reach`
    /// behind a face; NaN without water there.
    pub(super) fn end_pressures(
        &self,
        units: &LatticeUnits,
        faces: HoleFaces,
        reach: f64,
    ) -> [f64; 2] {
        [0, 1].map(|end: usize| {
            let (mut sum, mut cells) = (Fixed::ZERO, 0);
            for (row, deviation) in self.deviation[end].iter().enumerate() {
                let depth = depth(faces, (real(row) + 0.5) * units.spacing);
                if (0.0..=reach).contains(&depth) {
                    sum.merge(*deviation);
                    cells += self.water[end][row];
                }
            }
            units.density_deviation_to_pressure(if cells > 0 {
                sum.to_f64() / real(cells)
            } else {
                f64::NAN
            })
        })
    }

    /// Returns the discharge per depth between the faces of the hole \[m²/s\]; in 3-D the mean over the depth of the
    /// box.
    pub(super) fn discharge(
        &self,
        units: &LatticeUnits,
        faces: HoleFaces,
        depth: Option<f64>,
    ) -> f64 {
        let spacing = units.spacing;
        let mut through = Fixed::ZERO;
        for (row, sum) in self.middle.iter().enumerate() {
            let at = (real(row) + 0.5) * spacing;
            if faces.lower <= at && at <= faces.upper {
                through.merge(*sum);
            }
        }
        let area = depth.map_or(spacing, |depth| spacing * spacing / depth);
        units.velocity_to_si(through.to_f64()) * area
    }
}

/// Returns row values as a profile across the box.
pub(super) fn profile(spacing: f64, values: &[f64]) -> HoleProfile<'_> {
    HoleProfile {
        origin: 0.0,
        spacing,
        values,
    }
}

/// Returns sums over the cells of this rank in one pass, reduced over all ranks. Collective.
pub(super) fn cell_sums<S: Space>(view: &StateView<'_, S>, hole: &Hole) -> Sums {
    let grid = &view.plan.scene.grid;
    let across = grid.cells[hole.across];
    let mut sums = Sums {
        velocity: vec![Fixed::ZERO; across],
        solid: vec![0; across],
        cells: vec![0; across],
        middle: vec![Fixed::ZERO; across],
        deviation: [vec![Fixed::ZERO; across], vec![Fixed::ZERO; across]],
        water: [vec![0; across], vec![0; across]],
        speed: 0.0,
    };
    let [first, end] = hole.cells[hole.along];
    let middle = usize::midpoint(first, end);
    let ends = [
        first.saturating_sub(1),
        end.min(grid.cells[hole.along].saturating_sub(1)),
    ];
    if let Some(fluid) = view.fluid {
        let (cells, start) = (fluid.cells(), fluid.start());
        for z in 0..cells[2] {
            for y in 0..cells[1] {
                for x in 0..cells[0] {
                    let cell = [x, y, z];
                    let at: [usize; 3] = std::array::from_fn(|axis| cell[axis] + start[axis]);
                    let (row, column) = (at[hole.across], at[hole.along]);
                    let deep = hole.covers(hole.third(), at[hole.third()]);
                    let beside = deep && hole.covers(hole.along, column);
                    if beside {
                        sums.cells[row] += 1;
                    }
                    if fluid.solid_at(cell) {
                        sums.solid[row] += i64::from(beside);
                        continue;
                    }
                    let (deviation, velocity) = fluid.state(cell);
                    let squared: f64 = velocity.iter().map(|u| u * u).sum();
                    sums.speed = sums.speed.max(squared);
                    for (end, _) in ends.iter().enumerate().filter(|(_, end)| **end == column) {
                        if deep {
                            sums.deviation[end][row].add(deviation);
                            sums.water[end][row] += 1;
                        }
                    }
                    if !beside {
                        continue;
                    }
                    sums.velocity[row].add(velocity[hole.along]);
                    if column == middle {
                        sums.middle[row].add(velocity[hole.along]);
                    }
                }
            }
        }
    }
    sums.reduce(view.domain.communicator());
    sums
}

/// Returns the force along the hole on the grains of both faces in excess of the seepage force of
/// `gradient` = -dp/dx \[Pa/m\], in N/m.
pub(super) fn excess_force<S: Space>(
    view: &StateView<'_, S>,
    hole: &Hole,
    start: &Start,
    faces: HoleFaces,
    gradient: f64,
) -> f64 {
    let grid = &view.plan.scene.grid;
    let (behind, before) = (
        DEPTH_BEHIND * start.diameter,
        DISTANCE_BEFORE * start.diameter,
    );
    let first_grain = view.plan.scene.first_grain();
    let (mut force, mut volume) = (ExactSum::new(), ExactSum::new());
    for k in 0..view.particles.owned() {
        let body = &view.particles.body[k];
        let at = boxed(&view.particles.motion[k].position, grid);
        let depth = depth(faces, at[hole.across]);
        if body.id >= first_grain
            && (-before..=behind).contains(&depth)
            && hole.spans(hole.along, at[hole.along], grid.dimension)
            && hole.spans(hole.third(), at[hole.third()], grid.dimension)
        {
            force.add(view.particles.fluid_load(k).force.get(hole.along));
            volume.add(S::measure(body.radius));
        }
    }
    let communicator = view.domain.communicator();
    force.all_reduce(communicator);
    volume.all_reduce(communicator);
    let seepage = if start.packing > 0.0 {
        gradient * volume.value() / start.packing
    } else {
        0.0
    };
    (force.value() - seepage) / hole.depth
}

/// Returns the distance of a point behind the nearer face, across the hole \[m\]; negative in the hole.
pub(super) fn depth(faces: HoleFaces, at: f64) -> f64 {
    (faces.lower - at).max(at - faces.upper)
}
