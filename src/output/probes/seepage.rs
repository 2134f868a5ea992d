//! Values of the seepage: the state in the cell that contains a point, and the flow through a section between
//! cells.
//!
//! Every rank knows the whole coarse grid, so that nothing is gathered.

use base::number::{real, whole};
use coupling::seepage::Seepage;
use darcy::surface::Solids;
use darcy::{Prisms, WettedSurface};
use decomposition::ExactSum;
use dem::space::Space;
use plan::scene::block::AlignedBox;
use plan::scene::seepage::Seepage as Scene;
use std::ops::Range;

/// A part of a plane between cells of the coarse grid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    axis: usize,
    plane: usize,
    ranges: [Range<usize>; 3],
}

impl Section {
    /// Returns the plane between cells nearest to a position \[m\], limited to the cells whose centres lie in a
    /// box.
    pub(super) fn new(
        scene: &Scene,
        axis: usize,
        position: f64,
        part: Option<&AlignedBox>,
    ) -> Self {
        let place = (position - scene.origin[axis]) / scene.spacing[axis];
        let ranges = std::array::from_fn(|a| match part {
            Some(part) if a != axis && a < part.dimension => {
                let first = |x: f64| {
                    let place = (x - scene.origin[a]) / scene.spacing[a] - 0.5;
                    whole(place.ceil().clamp(0.0, real(scene.cells[a])))
                };
                first(part.from[a])..first(part.to[a])
            }
            _ => 0..scene.cells[a],
        });
        Self {
            axis,
            plane: whole(place.round()).min(scene.cells[axis]),
            ranges,
        }
    }

    /// Returns the discharge, the open area, and the mean heads upstream and downstream.
    pub(super) fn sample<S: Space>(&self, seepage: &Seepage<S>) -> [f64; 4] {
        let pressure = seepage.pressure();
        let through = pressure.through(self.axis, self.plane, &self.ranges);
        let [before, behind] = through.reduced.map(|phi| pressure.head(phi));
        [through.discharge, through.area, before, behind]
    }

    /// Returns the force of the pressure in the cells before the plane along the axis, its torque about a point,
    /// the mean pressure and the area. The pressure of a face is that of its cell, extrapolated by the gradient in
    /// the cell.
    pub(super) fn uplift<S: Space>(&self, seepage: &Seepage<S>, about: [f64; 3]) -> [f64; 6] {
        let (grid, pressure) = (seepage.grid(), seepage.pressure());
        let (axis, area) = (self.axis, grid.area(self.axis));
        let mut sums: [ExactSum; 4] = std::array::from_fn(|_| ExactSum::new());
        let mut whole = ExactSum::new();
        for index in 0..grid.count() {
            let cell = grid.cell(index);
            let held = (0..3).all(|a| a == axis || self.ranges[a].contains(&cell[a]));
            if !held || cell[axis] + 1 != self.plane || seepage.pores().porosity()[index] <= 0.0 {
                continue;
            }
            let (gradient, weight) = (pressure.inner_gradient(index), pressure.weight());
            let slope: [f64; 3] = std::array::from_fn(|a| gradient[a] + weight[a]);
            let mut arm = grid.centre(cell);
            arm[axis] += 0.5 * grid.spacing[axis];
            let force = area * (pressure.pressure(index) + 0.5 * grid.spacing[axis] * slope[axis]);
            // Computes first moments of the linear pressure over the face, then the torque r x F.
            let moment: [f64; 3] = std::array::from_fn(|a| {
                let across = if a == axis || a >= grid.dimension {
                    0.0
                } else {
                    area * slope[a] * grid.spacing[a].powi(2) / 12.0
                };
                force * (arm[a] - about[a]) + across
            });
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            sums[0].add(force);
            sums[1 + b].add(moment[c]);
            sums[1 + c].add(-moment[b]);
            whole.add(area);
        }
        let [force, x, y, z] = sums.map(|sum| sum.value());
        let area = whole.value();
        [force, x, y, z, force / area, area]
    }
}

/// Returns the velocity of the cell that contains a point, and pressure and head at the point from the gradient in
/// this cell; NaN outside the grid and in cells without water. Adjacent cells are not used: a sheet pile may lie
/// between.
pub(super) fn values_at<S: Space>(seepage: &Seepage<S>, point: [f64; 3]) -> [f64; 5] {
    let grid = seepage.grid();
    let pressure = seepage.pressure();
    let cell = grid.holding(point).map(|cell| grid.index(cell));
    match cell.filter(|&cell| seepage.pores().porosity()[cell] > 0.0) {
        Some(cell) => {
            let [u, v, w] = seepage.water_velocity(cell);
            let (centre, gradient) = (grid.centre(grid.cell(cell)), pressure.inner_gradient(cell));
            let weight = pressure.weight();
            let (mut reduced, mut hydrostatic) = (pressure.reduced(cell), 0.0);
            for a in 0..grid.dimension {
                reduced += gradient[a] * (point[a] - centre[a]);
                hydrostatic += weight[a] * point[a];
            }
            [u, v, w, reduced + hydrostatic, pressure.head(reduced)]
        }
        None => [f64::NAN; 5],
    }
}

/// Load on the surface of a structure, which is divided by the cells at the first sample.
#[derive(Clone, Debug)]
pub(super) struct SurfaceLoad {
    solids: Solids,
    index: usize,
    about: [f64; 3],
    surface: Option<WettedSurface>,
}

impl SurfaceLoad {
    /// Returns the load on the structure of an index, with the torque about a point \[m\].
    pub(super) fn new(scene: &Scene, index: usize, about: [f64; 3]) -> Self {
        Self {
            solids: scene.solids.clone(),
            index,
            about,
            surface: None,
        }
    }

    /// Returns force and torque of the water.
    pub(super) fn sample<S: Space>(&mut self, seepage: &Seepage<S>) -> [f64; 6] {
        let surface = self.surface.get_or_insert_with(|| {
            let wet = |cell: usize| seepage.pores().porosity()[cell] > 0.0;
            WettedSurface::new(seepage.grid(), &self.solids, self.index, &wet)
        });
        seepage.pressure().load(surface, self.about)
    }
}

/// Path along cell edges between the cell corners nearest to two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    from: [usize; 2],
    to: [usize; 2],
}

impl Crossing {
    /// Returns the path between two points \[m\].
    pub(super) fn new(scene: &Scene, from: [f64; 3], to: [f64; 3]) -> Self {
        let corner = |point: [f64; 3]| {
            [0, 1].map(|a: usize| {
                let place = (point[a] - scene.origin[a]) / scene.spacing[a];
                whole(place.round().clamp(0.0, real(scene.cells[a])))
            })
        };
        Self {
            from: corner(from),
            to: corner(to),
        }
    }

    /// Returns the discharge across the path from left to right; the path runs along x first, then along y.
    pub(super) fn sample<S: Space>(&self, seepage: &Seepage<S>) -> f64 {
        let (grid, pressure) = (seepage.grid(), seepage.pressure());
        let mut sum = ExactSum::new();
        let ([i, j], [k, l]) = (self.from, self.to);
        let upward = pressure.face_flows(1);
        for x in i.min(k)..i.max(k) {
            let flow = upward[j * grid.cells[0] + x];
            sum.add(if k > i { -flow } else { flow });
        }
        let rightward = pressure.face_flows(0);
        for y in j.min(l)..j.max(l) {
            let flow = rightward[y * (grid.cells[0] + 1) + k];
            sum.add(if l > j { flow } else { -flow });
        }
        sum.value()
    }
}

/// Returns width, excess head, gradient and safety factor of the prism of each width.
pub(super) fn heave<S: Space>(seepage: &Seepage<S>, prisms: &Prisms) -> Vec<[f64; 4]> {
    let all = seepage.pressure().heave(prisms).into_iter();
    all.map(|h| [h.width, h.excess_head, h.gradient, h.factor_of_safety])
        .collect()
}

/// Returns the volume of water in the ground, the volumes that entered and left since the start, and the present
/// inflow and outflow.
pub(super) fn balance<S: Space>(seepage: &Seepage<S>) -> [f64; 5] {
    let report = seepage.report();
    let water = seepage.pressure().water_balance().unwrap_or_default();
    [
        water.stored,
        water.entered,
        water.left,
        report.inflow,
        report.outflow,
    ]
}
