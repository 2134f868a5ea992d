//! A bed of grains under a stream: surface, scour, shear stress, Shields number and bedload.
//!
//! Let x be the axis of the stream, y the axis across the bed, b and L the width and the length of the part that is
//! measured (b = 1 in 2-D) and A = b L.
//!
//! - **Surface.** The part is divided into columns two diameters wide along the bed. A column has the solid fraction
//!   s(y) of its cells, averaged over one diameter of height. Its surface is the lowest y at which s falls below the
//!   threshold and stays there for one diameter, so that neither grains in suspension nor gaps between layers of
//!   grains, as on a rough floor, count. Lines of cells that are solid up to the top of the part, as in a pier, are
//!   left out. `surface_height` is the mean of the columns, h; `lowest_height` is the lowest one; both scours are
//!   measured down from the level.
//! - **Shear stress by the balance of forces** on the water above the plane y = h, of volume V:
//!
//!   ```text
//!   tau = [(f + G) V + T_top + T_sides] / A,    G = (P_1 - P_2)/L',    P = <p + rho u^2 - sigma_xx>
//!   ```
//!
//!   f is the force per volume along the stream (body force, and gravity where it acts on the water), G the gradient
//!   between the first and the last plane of cells of the part (L' apart; none if the stream is periodic over the
//!   whole part), and T the force on the top and on the sides by sigma_xy - rho u v and sigma_xz - rho u w,
//!   extrapolated to walls. At a free-slip face T is zero. In uniform flow without side walls this is tau = rho g h_w
//!   sin(slope), h_w the depth of the water. The balance holds for a stream that is steady in the mean. It includes the
//!   drag on grains that move above y = h, and on any other solid in the stream there.
//! - **Shear stress by the profile.** The mean of sigma_xy - rho u v over each plane of cells above the bed,
//!   viscous and resolved stress, is a straight line in a uniform stream without side walls. A least-squares line
//!   gives the value at y = h. The planes are those from the top down to the last plane without a solid, except the
//!   plane next to a solid. The value is NaN with fewer than three planes, and between side walls that do not slip.
//! - **Shields number** (Shields 1936): theta = tau / ((rho_s - rho) g d) with tau by the balance, gravity g across the
//!   bed and the mean density rho_s of the grains.
//! - **Bedload** per width: q = sum of V u / A over the grains with their centre above or in the part, V the volume of
//!   a grain (2-D: area) and u its velocity along the stream; dimensionless (Einstein 1950): q / sqrt((rho_s/rho - 1) g
//!   d^3).
//!
//! Sums over cells are integers and those over grains exact, so that no value depends on the number of ranks.

use super::quantity::Quantity;
use super::{Heading, Rows, no_fluid};
use crate::view::StateView;
use base::error::Error;
use base::number::{real, to_i64, whole};
use coupling::FluidView;
use decomposition::{Communicator, ExactSum, Fixed};
use dem::space::{Components, Space};
use lbm::boundary::SurfaceKind;
use plan::scene::Scene;
use plan::scene::grid::Grid;
use plan::scene::observe;
use std::path::Path;

/// Width of a column, in mean diameters.
const COLUMN: f64 = 2.0;
/// Minimum number of planes of cells for a least-squares line.
const MIN_ROWS: usize = 3;
/// Number of sums per plane of cells: velocity, stress across the bed, momentum in the first and last plane along
/// the stream, and stress on the outer and inner plane at the lower and the upper side.
const SUMS: usize = 8;
/// Number of counts per plane of cells: water cells in the whole plane and in its first and last rows.
const COUNTS: usize = 3;

/// Columns of the table.
const HEADINGS: [Heading; 11] = [
    ("surface_height", "m"),
    ("lowest_height", "m"),
    ("scour_depth", "m"),
    ("deepest_scour", "m"),
    ("mean_velocity", "m/s"),
    ("shear_stress_balance", "Pa"),
    ("shear_stress_profile", "Pa"),
    ("diameter", "m"),
    ("shields_number", "-"),
    ("bedload_flux", "m2/s"),
    ("dimensionless_flux", "-"),
];

/// Probe of a bed.
#[derive(Debug)]
pub(super) struct Bed {
    scene: observe::ObservedBed,
    /// Height from which scour is measured \[m\]; none before it is known.
    level: Option<f64>,
}

impl Bed {
    pub(super) fn new(scene: &observe::ObservedBed) -> Self {
        Self {
            level: scene.level,
            scene: scene.clone(),
        }
    }

    /// Returns the values of this step without the time. Collective.
    fn measure<S: Space>(&mut self, view: &StateView<S>) -> Result<[f64; 11], Error> {
        let fluid = view.fluid.ok_or_else(no_fluid)?;
        let (bed, grid) = (&self.scene, &view.plan.scene.grid);
        let grains = Grains::measure(view, bed);
        let spacing = grid.spacing;
        let heights = heights(view, fluid, bed, grains.median / spacing);
        let bottom = real(bed.cells[bed.axes[1]][0]);
        let mean = bottom + heights.iter().sum::<f64>() / real(heights.len());
        let lowest = bottom + heights.iter().copied().fold(f64::NAN, f64::min);
        let stream = Stream::above(view, fluid, bed, mean);
        let (surface, lowest) = (spacing * mean, spacing * lowest);
        if surface.is_finite() {
            self.level.get_or_insert(surface);
        }
        let level = self.level.unwrap_or(f64::NAN);
        let units = fluid.units();
        let balance = units.stress_to_si(stream.balance);
        let diameter = bed.diameter.unwrap_or(grains.median);
        let submerged = (grains.density - units.density) * bed.gravity * diameter;
        let scale = (submerged / units.density).sqrt() * diameter;
        Ok([
            surface,
            lowest,
            level - surface,
            level - lowest,
            units.velocity_to_si(stream.velocity),
            balance,
            units.stress_to_si(stream.profile),
            diameter,
            balance / submerged,
            grains.flux,
            grains.flux / scale,
        ])
    }
}

impl Quantity for Bed {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        HEADINGS.to_vec()
    }

    /// Reads the level of the first sample, from which scour is measured, from the table.
    fn remember(&mut self, table: &Path) -> io::Result<()> {
        if self.level.is_none() {
            let rows = io::table::read(table)?;
            let surfaces = rows.column("surface_height").unwrap_or_default();
            self.level = surfaces.into_iter().find(|height| height.is_finite());
        }
        Ok(())
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = self.measure(view)?;
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}

/// Quantities of a bed computed from the grains alone.
struct Grains {
    /// Median diameter by volume, of all grains \[m\]; NaN without grains.
    median: f64,
    /// Mean density [kg/m3].
    density: f64,
    /// Volume transported per width and time [m²/s].
    flux: f64,
}

impl Grains {
    /// Computes the quantities. Collective.
    fn measure<S: Space>(view: &StateView<S>, bed: &observe::ObservedBed) -> Self {
        let (scene, particles) = (&view.plan.scene, view.particles);
        let grid = &scene.grid;
        let along = bed.axes[0];
        let mut radii = Vec::new();
        let mut sums: [ExactSum; 3] = std::array::from_fn(|_| ExactSum::new());
        for k in 0..particles.owned() {
            let body = &particles.body[k];
            if body.id < scene.first_grain() {
                continue;
            }
            let volume = S::measure(body.radius);
            radii.push(body.radius);
            sums[0].add(body.mass);
            sums[1].add(volume);
            let motion = &particles.motion[k];
            if [bed.axes[0], bed.axes[2]]
                .into_iter()
                .all(|axis| axis >= grid.dimension || spans(bed, grid, axis, &motion.position))
            {
                sums[2].add_product(volume, motion.velocity.get(along));
            }
        }
        let communicator = view.domain.communicator();
        let [mass, volume, moved] = sums.map(|mut sum| {
            sum.all_reduce(communicator);
            sum.value()
        });
        let mut all = of_all_ranks(&radii, communicator);
        let area: f64 = [bed.axes[0], bed.axes[2]]
            .into_iter()
            .filter(|&axis| axis < grid.dimension)
            .map(|axis| grid.spacing * real(bed.cells[axis][1] - bed.cells[axis][0]))
            .product();
        Self {
            median: median_diameter(&mut all, S::measure),
            density: mass / volume,
            flux: moved / area,
        }
    }
}

/// Returns `true` if a coordinate is in the measured part; periodic axes are wrapped.
fn spans<V: Components>(
    bed: &observe::ObservedBed,
    grid: &Grid,
    axis: usize,
    position: &V,
) -> bool {
    let mut x = position.get(axis);
    if grid.periodic[axis] {
        x -= (x / grid.size[axis]).floor() * grid.size[axis];
    }
    let [from, to] = bed.cells[axis].map(|cell| grid.spacing * real(cell));
    (from..to).contains(&x)
}

/// Returns the values of all ranks, in the order of the ranks. Collective.
pub(super) fn of_all_ranks(own: &[f64], communicator: &Communicator) -> Vec<f64> {
    let bytes: Vec<u8> = own.iter().copied().flat_map(f64::to_le_bytes).collect();
    let gathered = communicator.all_gather_bytes(&bytes);
    let numbers = gathered.iter().flat_map(|bytes| bytes.as_chunks::<8>().0);
    numbers.copied().map(f64::from_le_bytes).collect()
}

/// Returns the diameter below which half of the volume lies; NaN without radii. Sorts the radii.
pub(super) fn median_diameter(radii: &mut [f64], measure: impl Fn(f64) -> f64) -> f64 {
    radii.sort_unstable_by(f64::total_cmp);
    let whole: f64 = radii.iter().map(|&r| measure(r)).sum();
    let mut below = 0.0;
    for &radius in &*radii {
        below += measure(radius);
        if 2.0 * below >= whole {
            return 2.0 * radius;
        }
    }
    f64::NAN
}

/// Returns the surface heights of the columns that have a surface, in cells above the bottom of the part.
/// Collective.
fn heights<S: Space>(
    view: &StateView<S>,
    fluid: &dyn FluidView,
    bed: &observe::ObservedBed,
    diameter: f64,
) -> Vec<f64> {
    // Without grains there is no column, on any rank.
    if diameter.is_nan() {
        return Vec::new();
    }
    let length = |axis: usize| bed.cells[axis][1] - bed.cells[axis][0];
    let columns = bed.axes.map(|axis| {
        if axis == bed.axes[1] {
            length(axis)
        } else {
            whole(real(length(axis)) / (COLUMN * diameter)).max(1)
        }
    });
    let [along, layers, aside] = columns;
    // The layers of a column are contiguous in memory.
    let mut solid = vec![0_i64; along * aside * layers];
    let mut cells = vec![0_i64; along * aside];
    let place = |at: [usize; 3]| {
        let [x, y, z]: [usize; 3] = std::array::from_fn(|k| {
            let axis = bed.axes[k];
            (at[axis] - bed.cells[axis][0]) * columns[k] / length(axis)
        });
        (z * along + x, y)
    };
    // A line of cells that is solid up to the top belongs to a pier or a wall.
    let line = |at: [usize; 3]| {
        let [x, _, z] = bed.axes.map(|axis| at[axis] - bed.cells[axis][0]);
        z * length(bed.axes[0]) + x
    };
    let mut lines = vec![0_i64; length(bed.axes[0]) * length(bed.axes[2])];
    each_cell(fluid, &bed.cells, |cell, at| {
        lines[line(at)] += i64::from(fluid.solid_at(cell));
    });
    let communicator = view.domain.communicator();
    communicator.all_reduce_sum_i64s(&mut lines);
    let pier = |at: [usize; 3]| lines[line(at)] == to_i64(layers as u64);
    let mut at = [0; 3];
    at[bed.axes[1]] = bed.cells[bed.axes[1]][0];
    for z in bed.cells[bed.axes[2]][0]..bed.cells[bed.axes[2]][1] {
        for x in bed.cells[bed.axes[0]][0]..bed.cells[bed.axes[0]][1] {
            (at[bed.axes[0]], at[bed.axes[2]]) = (x, z);
            cells[place(at).0] += i64::from(!pier(at));
        }
    }
    each_cell(fluid, &bed.cells, |cell, at| {
        if fluid.solid_at(cell) && !pier(at) {
            let (column, layer) = place(at);
            solid[column * layers + layer] += 1;
        }
    });
    communicator.all_reduce_sum_i64s(&mut solid);
    let half = whole((0.5 * diameter).round()).max(1);
    let columns = solid.chunks_exact(layers).zip(&cells);
    columns
        .filter(|(_, cells)| **cells > 0)
        .filter_map(|(solid, &cells)| height(solid, cells, half, bed.threshold))
        .collect()
}

/// Returns the lowest height at which the solid fraction, averaged over `half` layers below and above, falls below
/// the threshold and stays there for twice as many layers, interpolated between edges of layers; none if it never
/// does. Averaging windows are cut at the ends of the column.
fn height(solid: &[i64], cells: i64, half: usize, threshold: f64) -> Option<f64> {
    let mean = |edge: usize| {
        let window = &solid[edge.saturating_sub(half)..(edge + half).min(solid.len())];
        real(window.iter().sum::<i64>()) / (real(window.len()) * real(cells))
    };
    let mut first = None;
    for edge in 0..=solid.len() {
        if mean(edge) >= threshold {
            first = None;
        } else if edge - *first.get_or_insert(edge) >= 2 * half {
            break;
        }
    }
    first.map(|edge| {
        if edge == 0 {
            return 0.0;
        }
        let (before, here) = (mean(edge - 1), mean(edge));
        real(edge - 1) + (before - threshold) / (before - here)
    })
}

/// Calls `visit` with each cell of this rank in a box of cells of the domain: its coordinates in the slab and in the
/// domain.
fn each_cell(
    fluid: &dyn FluidView,
    part: &[[usize; 2]; 3],
    mut visit: impl FnMut([usize; 3], [usize; 3]),
) {
    let (start, cells) = (fluid.start(), fluid.cells());
    let range = |axis: usize| {
        let low = part[axis][0].max(start[axis]);
        low..part[axis][1].min(start[axis] + cells[axis]).max(low)
    };
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let at = [x, y, z];
                visit(std::array::from_fn(|axis| at[axis] - start[axis]), at);
            }
        }
    }
}

/// Quantities of the stream above the bed, in lattice units.
struct Stream {
    velocity: f64,
    balance: f64,
    profile: f64,
}

/// Sums over each plane of cells parallel to the bed.
struct Planes {
    sums: Vec<Fixed>,
    counts: Vec<i64>,
    /// Number of cells per plane.
    cells: f64,
}

impl Planes {
    fn sum(&self, row: usize, which: usize) -> f64 {
        self.sums[row * SUMS + which].to_f64()
    }

    fn count(&self, row: usize, which: usize) -> f64 {
        real(self.counts[row * COUNTS + which])
    }

    /// Computes the sums over the planes of cells. Collective.
    fn measure<S: Space>(
        view: &StateView<S>,
        fluid: &dyn FluidView,
        bed: &observe::ObservedBed,
    ) -> Self {
        let grid = &view.plan.scene.grid;
        let [along, across, aside] = bed.axes;
        let bottom = bed.cells[across][0];
        let rows = grid.cells[across] - bottom;
        let mut part = bed.cells;
        part[across][1] = grid.cells[across];
        let mut planes = Self {
            sums: vec![Fixed::ZERO; rows * SUMS],
            counts: vec![0; rows * COUNTS],
            cells: real(part[along][1] - part[along][0]) * real(part[aside][1] - part[aside][0]),
        };
        let flat = grid.dimension == 2;
        let [first, end] = part[along];
        let [low, high] = part[aside];
        each_cell(fluid, &part, |cell, at| {
            if fluid.solid_at(cell) {
                return;
            }
            let (deviation, velocity) = fluid.state(cell);
            let stress = fluid.stress(cell);
            let row = at[across] - bottom;
            let sums = &mut planes.sums[row * SUMS..(row + 1) * SUMS];
            let counts = &mut planes.counts[row * COUNTS..(row + 1) * COUNTS];
            let passed = |axis: usize| {
                stress[along][axis] - (1.0 + deviation) * velocity[along] * velocity[axis]
            };
            sums[0].add(velocity[along]);
            sums[1].add(passed(across));
            counts[0] += 1;
            for (n, plane) in [first, end - 1].into_iter().enumerate() {
                if at[along] == plane {
                    sums[2 + n].add(deviation / 3.0 - passed(along));
                    counts[1 + n] += 1;
                }
            }
            if !flat {
                for (n, plane) in [low, low + 1, high - 1, high - 2].into_iter().enumerate() {
                    if at[aside] == plane {
                        sums[4 + n].add(passed(aside));
                    }
                }
            }
        });
        let communicator = view.domain.communicator();
        Fixed::all_reduce(&mut planes.sums, communicator);
        communicator.all_reduce_sum_i64s(&mut planes.counts);
        planes
    }
}

impl Stream {
    /// Returns the quantities of the stream above a height in cells. Collective.
    fn above<S: Space>(
        view: &StateView<S>,
        fluid: &dyn FluidView,
        bed: &observe::ObservedBed,
        height: f64,
    ) -> Self {
        let scene = &view.plan.scene;
        let grid = &scene.grid;
        let [along, across, aside] = bed.axes;
        let planes = Planes::measure(view, fluid, bed);
        let bottom = bed.cells[across][0];
        let rows = grid.cells[across] - bottom;
        let share = |row: usize| (real(bottom + row + 1) - height).clamp(0.0, 1.0);
        let total =
            |of: &dyn Fn(usize) -> f64| -> f64 { (0..rows).map(|row| share(row) * of(row)).sum() };
        let volume = total(&|row| planes.count(row, 0));
        let whole = |axis: usize| {
            grid.periodic[axis] && bed.cells[axis][1] - bed.cells[axis][0] == grid.cells[axis]
        };
        let mut force = fluid.force()[along] * volume;
        if !whole(along) {
            let [first, last] = [0, 1].map(|end| {
                let (sum, cells) = (
                    total(&|row| planes.sum(row, 2 + end)),
                    total(&|row| planes.count(row, 1 + end)),
                );
                sum / cells
            });
            let apart = real(bed.cells[along][1] - bed.cells[along][0] - 1);
            force += (first - last) / apart * volume;
        }
        if !slips(scene, across, true) && rows > 1 {
            force += 1.5 * planes.sum(rows - 1, 1) - 0.5 * planes.sum(rows - 2, 1);
        }
        let mut walled = false;
        if aside < grid.dimension && !whole(aside) {
            for upper in [false, true] {
                let edge = bed.cells[aside][usize::from(upper)];
                let at_face = edge == if upper { grid.cells[aside] } else { 0 };
                let side = 4 + 2 * usize::from(upper);
                let outer = total(&|row| planes.sum(row, side));
                let traction = if grid.periodic[aside] || !at_face {
                    outer
                } else if slips(scene, aside, upper) {
                    0.0
                } else {
                    walled = true;
                    1.5 * outer - 0.5 * total(&|row| planes.sum(row, side + 1))
                };
                force += if upper { traction } else { -traction };
            }
        }
        Self {
            velocity: total(&|row| planes.sum(row, 0)) / volume,
            balance: force / planes.cells,
            profile: if walled {
                f64::NAN
            } else {
                profile(&planes, rows, height - real(bottom))
            },
        }
    }
}

/// Returns `true` if the whole of a face is a free-slip wall.
fn slips(scene: &Scene, axis: usize, upper: bool) -> bool {
    let patches = (scene.flow.iter())
        .flat_map(|flow| flow.patches())
        .filter(|patch| patch.face.axis() == axis && patch.face.is_max() == upper);
    let mut surfaces = patches.map(|patch| patch.condition.model().kind().surface);
    let first = surfaces.next();
    first == Some(SurfaceKind::Symmetry) && surfaces.all(|surface| surface == SurfaceKind::Symmetry)
}

/// Returns the value at a height, in cells above the first plane, of the least-squares line through the stresses of
/// the planes above the last solid.
fn profile(planes: &Planes, rows: usize, height: f64) -> f64 {
    let covered = |row: &usize| planes.count(*row, 0) < planes.cells;
    let first = (0..rows).rev().find(covered).map_or(0, |row| row + 2);
    if first + MIN_ROWS > rows {
        return f64::NAN;
    }
    let number = real(rows - first);
    let points =
        || (first..rows).map(|row| (real(row) + 0.5 - height, planes.sum(row, 1) / planes.cells));
    let (x, y) = points().fold((0.0, 0.0), |(x, y), (a, b)| (x + a, y + b));
    let (x, y) = (x / number, y / number);
    let (xx, xy) = points().fold((0.0, 0.0), |(xx, xy), (a, b)| {
        (xx + (a - x).powi(2), xy + (a - x) * (b - y))
    });
    y - x * xy / xx
}

#[cfg(test)]
mod tests {
    use super::*;
    use dem::space::{PlaneSpace, Space, Volume};

    #[test]
    fn half_of_the_volume_lies_below_the_median() {
        // The volumes are 1, 8 and 27 of 36: half of the volume is reached in the third grain. By area, 1, 4 and 9
        // of 14, too. By number it would be the second grain.
        let radii = [3.0, 1.0, 2.0];
        let close = |found: f64, expected: f64| (found - expected).abs() < 1e-15;
        assert!(close(
            median_diameter(&mut radii.clone(), Volume::measure),
            6.0
        ));
        assert!(close(
            median_diameter(&mut radii.clone(), PlaneSpace::measure),
            6.0
        ));
        assert!(close(
            median_diameter(&mut [1.0, 1.0, 1.1], PlaneSpace::measure),
            2.0
        ));
        assert!(median_diameter(&mut [], PlaneSpace::measure).is_nan());
    }

    #[test]
    fn the_surface_of_a_column_is_where_its_mean_fraction_falls() {
        // Ten cells per layer: full up to 5, empty above.
        let full: Vec<i64> = (0..12)
            .map(|layer| if layer < 5 { 10 } else { 0 })
            .collect();
        assert_eq!(height(&full, 10, 2, 0.5), Some(5.0));
        // The window of four layers has a solid fraction of a quarter one layer higher.
        assert_eq!(height(&full, 10, 2, 0.25), Some(6.0));
        assert_eq!(height(&full, 10, 2, 0.375), Some(5.5));
        // A grain in suspension is not part of the bed; a bare floor has no height; a pier has no surface.
        let mut above = full.clone();
        above[9] = 10;
        assert_eq!(height(&above, 10, 2, 0.5), Some(5.0));
        assert_eq!(height(&[0; 12], 10, 2, 0.5), Some(0.0));
        // A gap between layers that is narrower than a grain, as on a rough floor, does not count either: full to
        // layer 1, from 3 to 7.
        let gap = [10, 0, 0, 10, 10, 10, 10, 0, 0, 0, 0, 0];
        let found = height(&gap, 10, 1, 0.3).unwrap();
        assert!((found - 7.4).abs() < 1e-12, "{found}");
        assert_eq!(height(&[10; 12], 10, 2, 0.5), None);
    }
}
