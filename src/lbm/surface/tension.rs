//! Surface tension: the curvature of the surface, and the density that its pressure adds at the surface.
//!
//! The pressure below a surface of mean curvature κ is σκ above that of the gas (Laplace). It enters the traction of
//! [`super::facet`] as a density 3σκ at the surface, so that only the populations from the gas change: mass is
//! conserved as without it. A surface without tension is compiled without any of it ([`super::jump`]).
//!
//! κ follows from height functions (S. J. Cummins, M. M. Francois, D. B. Kothe, Comput. Struct. 83 (2005) 425): sums of
//! the fill levels along the axis closest to the normal, in three columns (in 3-D nine) of up to three cells to each
//! side of the cell; κ of a resolved surface is of the second order. Where a column does not reach from water to gas,
//! another axis is tried; then κ is the divergence of the normals at the corners of the cell, which is rough.
//!
//! At a wall the surface meets it at the contact angle θ, measured in the water (S. Afkhami, M. Bussmann, Int. J.
//! Numer. Meth. Fluids 57 (2008) 453): a column beyond a wall along which the surface climbs is higher than its
//! neighbour by cot θ, and a wedge that a wall cuts off is continued behind the wall with the slope tan θ.
//!
//! The fill levels are those of the middle of the step, moved by half of the step with the velocity of the cell: a
//! delay of half a step would amplify a wave of frequency ω at the rate ω²/4. They are computed in each cell and sent
//! to the neighbours, so that the bits do not depend on the number of ranks.
//!
//! The pressure in drops of 5, 10 and 20 cells of radius has errors of 0.8, 0.3 and 0.04 % in 2-D, of 1.3 and 0.9 % in
//! drops of 5 and 8 cells in 3-D. Waves of 20 and 40 cells have errors of the frequency of 2 to 3 % and of 1 %, and are
//! damped 1.2 and 1.1 times as strongly as in the theory. At walls the normals that extrapolate the traction do not
//! know the contact angle: menisci with angles far from 90 degrees are too small by up to half a cell.

use super::cells::Cells;
use super::cut;
use super::exchange::least;
use super::facet::normal;
use super::ghosts::Ends;
use super::kind::{GAS, LIQUID, SOLID};
use super::lists::Plane;
use super::stencil::{Numbers, Stencil};
use crate::lanes::Stored;
use crate::lattice::Lattice;
use crate::populations::Populations;
use base::thread_pool;
use base::vector::norm;
use decomposition::{Domain, HaloBytes, HaloExchange};

/// Number of cells to each side of a cell that a column may need.
const REACH: usize = 3;

/// Message tag of the fill levels.
const TAG: u8 = 5;

/// Minimum component of the normal along the columns.
const MIN_UPRIGHT: f64 = 0.3;

/// Maximum slope of a wedge at a wall that is continued behind it.
const MAX_SLOPE: f64 = 3.0;

/// Curvature of the smallest resolved waves, for the bound of the pressure where the curvature passes through zero.
const MIN_CURVATURE: f64 = 0.05;

/// Half of the change of the fill level by which the area of a plane in a cell is found.
const CHANGE: f64 = 0.01;

/// Surface tension in lattice units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceTension {
    /// Surface tension σ, for a density of 1.
    pub tension: f64,
    /// Contact angle at the lower and the upper end of each axis, in the water \[rad\].
    pub contact_angles: [[f64; 2]; 3],
}

/// Surface tension of a slab.
pub(super) struct SlabTension {
    pub(super) levels: Levels,
    exchange: HaloExchange,
    /// Levels of the planes to send; reusable buffers.
    sent: [Vec<f64>; 2],
}

/// Fill levels in the middle of the step, in the slab and round it.
pub(super) struct Levels {
    settings: SurfaceTension,
    ends: Ends,
    cells: [isize; 3],
    order: [usize; 3],
    dimension: usize,
    /// `true` for each end of the slab with a neighbour.
    neighbours: [bool; 2],
    /// Levels of the layers beyond the lower and the upper end, nearest first; not a number for solids.
    beyond: [[Vec<f64>; REACH]; 2],
    /// Fill levels of interface cells in the middle of the step, by position.
    middle: Vec<f64>,
}

impl SlabTension {
    /// Returns the tension of a slab. Collective.
    ///
    /// # Errors
    /// If the slabs of two neighbours do not fit each other.
    pub(super) fn new<S: Stored>(
        populations: &Populations<S>,
        ends: Ends,
        domain: &Domain,
        settings: SurfaceTension,
    ) -> Result<Self, String> {
        let order = populations.order();
        let cells = populations.cells();
        let plane = cells[order[1]] * cells[order[2]];
        let bytes = HaloBytes::symmetric(plane * size_of::<f64>());
        let levels = Levels {
            settings,
            ends,
            cells: cells.map(usize::cast_signed),
            order,
            dimension: populations.velocities().dimension,
            neighbours: [
                domain.lower_neighbour().is_some(),
                domain.upper_neighbour().is_some(),
            ],
            beyond: std::array::from_fn(|_| std::array::from_fn(|_| vec![f64::NAN; plane])),
            middle: vec![0.0; populations.cell_positions()],
        };
        let exchange = HaloExchange::new(domain, TAG, bytes).map_err(|e| e.to_string())?;
        Ok(Self {
            levels,
            exchange,
            sent: [const { Vec::new() }; 2],
        })
    }

    /// Sends the levels of the outer planes, one layer after the other, so that slabs may be thinner than the reach.
    /// Collective.
    pub(super) fn spread<S: Stored>(&mut self, cells: &Cells, populations: &Populations<S>) {
        let [slow, middle, fast] = self.levels.order;
        let count = self.levels.cells[slow];
        for layer in 0..REACH {
            let depth = layer.cast_signed();
            // The buffers are filled from this slab and from the layers received before.
            for (side, plane) in self.sent.iter_mut().enumerate() {
                plane.clear();
                if !self.levels.neighbours[side] {
                    continue;
                }
                plane.reserve(self.levels.beyond[side][layer].len());
                let mut at = [0; 3];
                at[slow] = if side == 0 { depth } else { count - 1 - depth };
                for row in 0..self.levels.cells[middle] {
                    for n in 0..self.levels.cells[fast] {
                        (at[middle], at[fast]) = (row, n);
                        plane.push(self.levels.level_at((cells, populations), at));
                    }
                }
            }
            let (lower, upper) = self.exchange.send_buffers_mut::<f64>();
            for (buffer, plane) in [lower, upper].into_iter().zip(&self.sent) {
                if let Some(buffer) = buffer {
                    buffer.copy_from_slice(plane);
                }
            }
            self.exchange.start();
            self.exchange.finish();
            let (lower, upper) = self.exchange.received::<f64>();
            for (side, buffer) in [lower, upper].into_iter().enumerate() {
                if let Some(buffer) = buffer {
                    self.levels.beyond[side][layer].copy_from_slice(buffer);
                }
            }
        }
    }
}

impl Levels {
    /// Returns the density that a mean curvature of 1 adds.
    pub(super) fn density(&self) -> f64 {
        3.0 * self.settings.tension
    }

    /// Returns the change of density over a cell caused by the pressure of the smallest resolved waves.
    pub(super) fn density_of_waves(&self) -> f64 {
        MIN_CURVATURE * self.density()
    }

    /// Returns the fill level of a cell of the slab in the middle of the step; not a number for a solid.
    #[inline(always)]
    fn level(&self, cells: &Cells, cell: usize) -> f64 {
        match cells.kind[cell] {
            GAS => 0.0,
            LIQUID => 1.0,
            SOLID => f64::NAN,
            _ => self.middle[cell],
        }
    }

    /// Returns the fill level at indices in the slab or up to [`REACH`] cells outside; not a number for a solid and
    /// beyond a wall.
    fn level_at<S: Stored>(
        &self,
        (cells, populations): (&Cells, &Populations<S>),
        mut at: [isize; 3],
    ) -> f64 {
        let [slow, middle, fast] = self.order;
        for axis in 0..self.dimension {
            let count = self.cells[axis];
            // A slab may be thinner than the reach: a reflected index may lie beyond the other end.
            for _ in 0..=2 * REACH {
                if (0..count).contains(&at[axis]) {
                    break;
                }
                let upper = usize::from(at[axis] >= count);
                if self.ends.mirrored[axis][upper] {
                    let beyond = if upper == 1 { 2 * count } else { 0 };
                    at[axis] = beyond - 1 - at[axis];
                } else if self.ends.periodic[axis] {
                    at[axis] = at[axis].rem_euclid(count);
                } else if axis == slow && self.neighbours[upper] {
                    break;
                } else {
                    return f64::NAN;
                }
            }
        }
        let count = self.cells[slow];
        if (0..count).contains(&at[slow]) {
            return self.level(cells, populations.cell(at));
        }
        let upper = at[slow] >= count;
        let layer = if upper {
            at[slow] - count
        } else {
            -1 - at[slow]
        };
        let place = at[middle] * self.cells[fast] + at[fast];
        self.beyond[usize::from(upper)][layer.unsigned_abs()][place.unsigned_abs()]
    }

    /// Returns the curvature of the surface in a cell with this normal, from levels at offsets.
    fn curvature(&self, normal: [f64; 3], level: impl Fn([isize; 3]) -> f64) -> f64 {
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| normal[b].abs().total_cmp(&normal[a].abs()));
        let upright = axes
            .into_iter()
            .filter(|&axis| axis < self.dimension && normal[axis].abs() > MIN_UPRIGHT);
        let found = upright.map(|up| Columns::new(self, up, normal).curvature(&level));
        let found = found.flatten().next();
        let most = base::number::real(self.dimension) - 1.0;
        found
            .unwrap_or_else(|| self.divergence(&level))
            .clamp(-most, most)
    }

    /// Returns the divergence of the normals at the corners of a cell.
    fn divergence(&self, level: &impl Fn([isize; 3]) -> f64) -> f64 {
        // Beyond a wall the level is that in front of it.
        let inside = |mut at: [isize; 3]| {
            for axis in 0..=self.dimension {
                let found = level(at);
                if !found.is_nan() {
                    return found.clamp(0.0, 1.0);
                }
                if axis < self.dimension {
                    at[axis] = 0;
                }
            }
            0.0
        };
        let deep = if self.dimension == 3 { 2 } else { 1 };
        let corner = |at: [isize; 3]| {
            let mut gradient = [0.0; 3];
            for z in 0..deep {
                for y in 0..2 {
                    for x in 0..2 {
                        let k: [isize; 3] = [x, y, z];
                        let found = inside(std::array::from_fn(|a| at[a] + k[a]));
                        for (sum, k) in gradient.iter_mut().zip(k) {
                            *sum += if k == 1 { found } else { -found };
                        }
                    }
                }
            }
            if deep == 1 {
                gradient[2] = 0.0;
            }
            let length = norm(gradient);
            gradient.map(|g| if length > 0.0 { -g / length } else { 0.0 })
        };
        let mut sum = 0.0;
        for z in 1 - deep..1 {
            for y in -1..1 {
                for x in -1..1 {
                    let at = [x, y, z];
                    let found = corner(at);
                    for axis in 0..self.dimension {
                        sum += if at[axis] == 0 {
                            found[axis]
                        } else {
                            -found[axis]
                        };
                    }
                }
            }
        }
        sum / if deep == 2 { 4.0 } else { 2.0 }
    }
}

/// Columns of fill levels round a cell.
struct Columns<'a> {
    tension: &'a Levels,
    /// Axis of the columns, and the direction of the gas along it.
    up: usize,
    sign: isize,
    /// Other axes; the second one is unused in 2-D.
    across: [usize; 2],
    /// Direction of the gas along the other axes, of length 1 or 0.
    outward: [f64; 2],
}

/// Surface in a column.
#[derive(Clone, Copy)]
enum Column {
    /// Height of the surface above the lower side of the cell in the middle, towards the gas.
    Height(f64),
    /// Column beyond the wedge that a wall cuts off with this slope.
    Cut(f64),
    /// Column beyond a wall.
    Beyond,
}

impl<'a> Columns<'a> {
    fn new(tension: &'a Levels, up: usize, normal: [f64; 3]) -> Self {
        let across = match up {
            0 => [1, 2],
            1 => [0, 2],
            _ => [0, 1],
        };
        let along = across.map(|axis| normal[axis]);
        let length = along[0].hypot(along[1]);
        Self {
            tension,
            up,
            sign: if normal[up] < 0.0 { -1 } else { 1 },
            across,
            outward: along.map(|n| if length > 0.0 { n / length } else { 0.0 }),
        }
    }

    /// Returns the offset of a cell of a column.
    fn offset(&self, column: [isize; 2], k: isize) -> [isize; 3] {
        let mut at = [0; 3];
        at[self.up] = k * self.sign;
        (at[self.across[0]], at[self.across[1]]) = (column[0], column[1]);
        at
    }

    /// Returns the surface in a column; `None` if the column does not reach from water to gas.
    fn column(&self, column: [isize; 2], level: &impl Fn([isize; 3]) -> f64) -> Option<Column> {
        let of = |k: isize| level(self.offset(column, k));
        let reach = REACH.cast_signed();
        if of(0).is_nan() {
            return Some(Column::Beyond);
        }
        let mut height = 0.0;
        let (mut floor, mut ceiling) = (None, None);
        let mut k = -1;
        loop {
            let found = of(k);
            if found.is_nan() {
                floor = Some(k + 1);
                break;
            }
            height += found - 1.0;
            if found >= 1.0 {
                break;
            }
            k -= 1;
            if k < -reach {
                return None;
            }
        }
        let mut k = 0;
        loop {
            let found = of(k);
            if found.is_nan() {
                ceiling = Some(k);
                break;
            }
            height += found;
            if found <= 0.0 {
                break;
            }
            k += 1;
            if k > reach {
                return None;
            }
        }
        let real = |k: isize| {
            base::number::real(k.unsigned_abs()).copysign(if k < 0 { -1.0 } else { 1.0 })
        };
        // The wedge of water above a floor, and of gas below a ceiling.
        for (end, side) in [(floor, -1), (ceiling, 1)] {
            let Some(end) = end else { continue };
            let upper = usize::from(side * self.sign > 0);
            let angle = self.tension.settings.contact_angles[self.up][upper];
            let slope = if side < 0 { angle.tan() } else { -angle.tan() };
            let thickness = (height - real(end)).abs();
            if !(slope > 0.0 && slope <= MAX_SLOPE) {
                return None;
            }
            if thickness <= 0.0 {
                return Some(Column::Cut(slope));
            }
            if thickness < 0.5 * slope {
                // The wetted part of the column has the width (2 thickness/slope)^½.
                let continued = slope * ((2.0 * thickness / slope).sqrt() - 0.5);
                let outward = if side < 0 { 1.0 } else { -1.0 };
                height = real(end) + outward * continued;
            }
        }
        Some(Column::Height(height))
    }

    /// Returns the curvature; `None` if a column has no surface within reach.
    fn curvature(&self, level: &impl Fn([isize; 3]) -> f64) -> Option<f64> {
        let Some(Column::Height(middle)) = self.column([0, 0], level) else {
            return None;
        };
        let second = self.tension.dimension == 3;
        let mut heights = [[f64::NAN; 3]; 3];
        heights[1][1] = middle;
        for i in -1..=1_isize {
            for j in -1..=1_isize {
                if (i, j) == (0, 0) || !second && j != 0 {
                    continue;
                }
                let [a, b] = [i, j].map(|n| {
                    if n < 0 {
                        -1.0
                    } else {
                        f64::from(u8::from(n > 0))
                    }
                });
                heights[(i + 1).unsigned_abs()][(j + 1).unsigned_abs()] =
                    match self.column([i, j], level)? {
                        Column::Height(height) => height,
                        Column::Cut(slope) => {
                            middle - slope * (a * self.outward[0] + b * self.outward[1])
                        }
                        Column::Beyond => f64::NAN,
                    };
            }
        }
        self.continue_behind_walls(&mut heights);
        let [below, mid, above] = heights;
        let slope = 0.5 * (above[1] - below[1]);
        let bend = above[1] - 2.0 * mid[1] + below[1];
        if !second {
            return Some(-bend / (1.0 + slope * slope).powf(1.5));
        }
        let other = 0.5 * (mid[2] - mid[0]);
        let other_bend = mid[2] - 2.0 * mid[1] + mid[0];
        let twist = 0.25 * (above[2] - above[0] - below[2] + below[0]);
        let sum = bend * (1.0 + other * other) + other_bend * (1.0 + slope * slope)
            - 2.0 * twist * slope * other;
        Some(-sum / (1.0 + slope * slope + other * other).powf(1.5))
    }

    /// Sets the heights of columns beyond walls so that the surface meets the walls at the contact angle.
    fn continue_behind_walls(&self, heights: &mut [[f64; 3]; 3]) {
        let cotangent = |axis: usize, n: usize| {
            let angle =
                self.tension.settings.contact_angles[self.across[axis]][usize::from(n == 2)];
            angle.cos() / angle.sin()
        };
        let along = |row: [f64; 3]| {
            let slope = match row.map(f64::is_nan) {
                [false, _, false] => 0.5 * (row[2] - row[0]),
                [true, _, false] => row[2] - row[1],
                [false, _, true] => row[1] - row[0],
                _ => 0.0,
            };
            (1.0 + slope * slope).sqrt()
        };
        if self.tension.dimension == 2 {
            for n in [0, 2] {
                if heights[n][1].is_nan() {
                    heights[n][1] = heights[1][1] + cotangent(0, n);
                }
            }
            return;
        }
        for n in [0, 2] {
            if heights[n][1].is_nan() {
                let rise = cotangent(0, n) * along(heights[1]);
                for k in 0..3 {
                    heights[n][k] = heights[1][k] + rise;
                }
            }
        }
        for n in [0, 2] {
            if heights[1][n].is_nan() {
                let rise = cotangent(1, n) * along([0, 1, 2].map(|k| heights[k][1]));
                for row in heights.iter_mut() {
                    row[n] = row[1] + rise;
                }
            }
        }
    }
}

/// Returns the area of a plane with this normal in a cell of this fill level.
fn area(fill: f64, normal: [f64; 3]) -> f64 {
    let [low, high] = [fill - CHANGE, fill + CHANGE].map(|part| part.clamp(0.0, 1.0));
    if high > low {
        (high - low) / (cut::distance(high, normal) - cut::distance(low, normal))
    } else {
        0.0
    }
}

/// Computes the fill level of each interface cell in the middle of the step.
pub(super) fn advance<L: Lattice<Q>, S: Stored, const Q: usize>(
    tension: &mut Levels,
    cells: &Cells,
    planes: &mut [Plane],
    populations: &Populations<S>,
    half_force: [f64; 3],
) {
    let least = least(planes);
    let stencil = &Stencil::<L, Q>::new(populations);
    let numbers = &Numbers::to_read(populations);
    let levels = &Numbers::from_list(&mut tension.middle);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for &cell in &plane.surface {
            let cell = cell as usize;
            // SAFETY: an interface cell of the slab, whose numbers are only read.
            let (density, momentum) = unsafe { stencil.momentum(numbers, cell) };
            let kinds = stencil.kinds(cells, cell);
            let mut fill = cells.fill[cell];
            if let Some(normal) = normal(cells, stencil, (cell, &kinds)) {
                let along: f64 = (0..3)
                    .map(|a| (half_force[a] + momentum[a]) * normal[a])
                    .sum();
                fill += 0.5 * along / (1.0 + density) * area(fill, normal);
            }
            // SAFETY: each interface cell belongs to one thread.
            unsafe { levels.write(cell, fill) };
        }
    });
}

/// Computes the density that the tension adds in each interface cell.
pub(super) fn press<L: Lattice<Q>, S: Stored, const Q: usize>(
    tension: &Levels,
    cells: &Cells,
    planes: &mut [Plane],
    populations: &Populations<S>,
) {
    let least = least(planes);
    let stencil = &Stencil::<L, Q>::new(populations);
    let reach = REACH.cast_signed();
    let stride = |axis: usize| {
        let mut at = [0; 3];
        at[axis] = 1;
        populations.cell(at).cast_signed() - populations.cell([0; 3]).cast_signed()
    };
    let strides: [isize; 3] = std::array::from_fn(stride);
    let within = |at: [isize; 3]| {
        (0..tension.dimension).all(|a| (reach..tension.cells[a] - reach).contains(&at[a]))
    };
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        plane.capillary.resize(plane.surface.len(), 0.0);
        for (&cell, density) in plane.surface.iter().zip(&mut plane.capillary) {
            let cell = cell as usize;
            *density = 0.0;
            let kinds = stencil.kinds(cells, cell);
            let Some(normal) = normal(cells, stencil, (cell, &kinds)) else {
                continue;
            };
            let at = populations.coordinates(cell);
            let curvature = if within(at) {
                tension.curvature(normal, |by| {
                    let by: isize = by
                        .into_iter()
                        .zip(strides)
                        .map(|(n, stride)| n * stride)
                        .sum();
                    tension.level(cells, cell.wrapping_add_signed(by))
                })
            } else {
                tension.curvature(normal, |by| {
                    let at = std::array::from_fn(|a| at[a] + by[a]);
                    tension.level_at((cells, populations), at)
                })
            };
            *density = tension.density() * curvature;
        }
    });
}
