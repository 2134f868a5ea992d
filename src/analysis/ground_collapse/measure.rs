//! Voids over the seepage points, the front of the moving ground, and the settlement of the surface, from the grains.
//!
//! [`super`] defines the quantities. All functions are pure. The order of the grains affects the rounding; grains
//! are passed in ascending order of id.

use base::number::real;
use serde::{Deserialize, Serialize};

/// Minimum solid fraction of a cell of ground at time 0: a quarter of that of a packing, so that cells cut in half
/// by the surface or a wall belong to the ground.
pub const GROUND: f64 = 0.15;

/// Maximum gap between surfaces of neighbouring grains of the ground surface, in mean diameters.
pub const GAP: f64 = 0.5;

/// Minimum number of such neighbours: a grain in flight has none, one on a slope at a wall has two.
pub const NEIGHBOURS: usize = 2;

/// Number of highest grains of a column at time 0 that form its surface. The median of their displacements is the
/// settlement, because a single large grain on top may roll down by more than a mean diameter.
pub const SKIN: usize = 3;

/// Grain in the frame of the analysis: long axis, transverse axis, upward axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredGrain {
    /// Id of the grain.
    pub id: u64,
    /// Centre \[m\].
    pub at: [f64; 3],
    /// Displacement from its position at time 0 \[m\].
    pub moved: [f64; 3],
    /// Radius \[m\].
    pub radius: f64,
}

/// Cells: the box from the origin, divided evenly along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cells {
    /// Number of cells along each axis.
    pub count: [usize; 3],
    /// Edges of one cell \[m\].
    pub size: [f64; 3],
}

/// Seepage point: its box in the frame of the analysis \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Lower corner.
    pub from: [f64; 3],
    /// Upper corner.
    pub to: [f64; 3],
}

/// Volume of a sphere (centre, radius) inside a box (lower, upper corner) \[m3\].
pub type Overlap = fn([f64; 3], f64, [f64; 3], [f64; 3]) -> f64;

/// Ground at time 0, which a restart needs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InitialGround {
    /// Cells of the ground.
    pub cells: Cells,
    /// Mean diameter of the grains \[m\].
    pub diameter: f64,
    /// Solid fraction of each cell, rounded to four decimals for a short record.
    pub solid: Vec<f64>,
    /// Elevation of the surface of each column \[m\]; none without a grain.
    pub surface: Vec<Option<f64>>,
    /// Minimum elevation of the grains that formed the surface of each column at time 0 \[m\]; none without a
    /// grain.
    pub skin: Vec<Option<f64>>,
}

/// Thresholds for void, moving and settled cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Fraction of the initial solid below which a cell is void.
    pub void_below: f64,
    /// Mean downward displacement of its grains above which a cell counts as moving \[m\].
    pub moving: f64,
    /// Minimum settlement of a column in the depression \[m\].
    pub settled: f64,
    /// Percentile of the settlement to be computed.
    pub percentile: f64,
}

/// Quantities over one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMeasures {
    /// Volume of soil missing in the void connected with the point \[m3\].
    pub void_volume: f64,
    /// Height of the top of that void above the lowest ground at the point \[m\].
    pub arch_height: f64,
    /// Thickness of the ground over the point at time 0 \[m\].
    pub cover: f64,
    /// Upper end of the moving ground, as a fraction of the cover.
    pub front: f64,
    /// Moving length of the long section in the upper half below the front divided by that in the lower half; NaN
    /// if no cell moves.
    pub front_shape: f64,
}

/// Area where the surface has settled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Depression {
    /// Total length along the long axis over which any column has settled \[m\].
    pub length: f64,
    /// Longest continuous part of this length \[m\].
    pub longest: f64,
    /// Extent along the transverse axis \[m\].
    pub width: f64,
}

/// Measured quantities of the ground at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Number of voids connected with points, each counted once.
    pub voids: u64,
    /// Volume of these voids \[m3\].
    pub void_volume: f64,
    /// Quantities over each point.
    pub points: Vec<PointMeasures>,
    /// Elevation of each column \[m\].
    pub surface: Vec<Option<f64>>,
    /// Settlement of each column \[m\].
    pub settlement: Vec<Option<f64>>,
    /// Largest settlement \[m\].
    pub settlement_max: f64,
    /// Largest settlement of a column over a point, or of both of two neighbouring columns \[m\].
    pub sinkhole: f64,
    /// Mean settlement over the middle third along the long axis \[m\].
    pub settlement_middle: f64,
    /// The requested percentile of the settlement \[m\].
    pub settlement_percentile: f64,
    /// Area of settled columns.
    pub depression: Depression,
    /// Mean displacement of the soil at the sides of the points towards the points \[m\].
    pub inward: f64,
}
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the range of the cells before"
)]
fn index_along(x: f64, size: f64, count: usize) -> usize {
    (x / size).floor().clamp(0.0, real(count.max(1) - 1)) as usize
}

impl Cells {
    /// Returns `count` cells that fill a box with edges `domain` \[m\].
    #[must_use]
    pub fn new(domain: [f64; 3], count: [usize; 3]) -> Self {
        Self {
            count,
            size: std::array::from_fn(|axis| domain[axis] / real(count[axis].max(1))),
        }
    }

    /// Returns the cell that contains a position; positions outside the box belong to the nearest cell.
    #[must_use]
    pub fn cell_of(&self, at: [f64; 3]) -> [usize; 3] {
        std::array::from_fn(|axis| index_along(at[axis], self.size[axis], self.count[axis]))
    }

    /// Returns the index of a cell in arrays over cells.
    #[must_use]
    pub fn index(&self, cell: [usize; 3]) -> usize {
        (cell[2] * self.count[1] + cell[1]) * self.count[0] + cell[0]
    }

    /// Returns the index of a column in arrays over columns.
    #[must_use]
    pub fn column(&self, long: usize, across: usize) -> usize {
        across * self.count[0] + long
    }

    /// Returns the number of cells.
    #[must_use]
    pub fn total(&self) -> usize {
        self.count.iter().product()
    }

    /// Returns the volume of one cell \[m3\].
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.size.iter().product()
    }

    fn lower(&self, cell: usize, axis: usize) -> f64 {
        real(cell) * self.size[axis]
    }

    /// Returns the range of cells that an interval covers along an axis; at least one.
    fn covered(&self, axis: usize, from: f64, to: f64) -> std::ops::Range<usize> {
        let size = self.size[axis];
        // A box that ends on a face does not cover the cell beyond it.
        let slack = 1e-9 * size;
        let first = index_along(from + slack, size, self.count[axis]);
        let last = index_along(to - slack, size, self.count[axis]).max(first);
        first..last + 1
    }
}

/// Returns the solid fraction of every cell.
#[must_use]
pub fn solid_fractions(cells: &Cells, grains: &[MeasuredGrain], overlap: Overlap) -> Vec<f64> {
    let mut solid = vec![0.0; cells.total()];
    for grain in grains {
        let [low, high] = [-1.0, 1.0].map(|side| {
            cells.cell_of(std::array::from_fn(|axis| {
                grain.at[axis] + side * grain.radius
            }))
        });
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let cell = [x, y, z];
                    let [lower, upper] = [0, 1].map(|side| {
                        std::array::from_fn(|axis| cells.lower(cell[axis] + side, axis))
                    });
                    solid[cells.index(cell)] += overlap(grain.at, grain.radius, lower, upper);
                }
            }
        }
    }
    for value in &mut solid {
        *value /= cells.volume();
    }
    solid
}

/// Returns the elevation of every column: the top of its highest grain with [`NEIGHBOURS`] others nearer than [`GAP`].
#[must_use]
pub fn surface(cells: &Cells, grains: &[MeasuredGrain], diameter: f64) -> Vec<Option<f64>> {
    let mut inside: Vec<Vec<usize>> = vec![Vec::new(); cells.total()];
    let mut columns: Vec<Vec<usize>> = vec![Vec::new(); cells.count[0] * cells.count[1]];
    let mut largest: f64 = 0.0;
    for (k, grain) in grains.iter().enumerate() {
        let cell = cells.cell_of(grain.at);
        inside[cells.index(cell)].push(k);
        columns[cells.column(cell[0], cell[1])].push(k);
        largest = largest.max(grain.radius);
    }
    let gap = GAP * diameter;
    let in_company = |k: usize| {
        let grain = &grains[k];
        let reach = grain.radius + largest + gap;
        let [low, high] = [-reach, reach]
            .map(|side| cells.cell_of(std::array::from_fn(|axis| grain.at[axis] + side)));
        let mut near = 0;
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    for &other in &inside[cells.index([x, y, z])] {
                        let (at, limit) =
                            (grains[other].at, grain.radius + grains[other].radius + gap);
                        let squared: f64 = (0..3).map(|a| (at[a] - grain.at[a]).powi(2)).sum();
                        near += usize::from(other != k && squared <= limit * limit);
                    }
                }
            }
        }
        near >= NEIGHBOURS
    };
    let top = |k: usize| grains[k].at[2] + grains[k].radius;
    columns
        .into_iter()
        .map(|mut column| {
            column.sort_by(|&a, &b| top(b).total_cmp(&top(a)));
            column.into_iter().find(|&k| in_company(k)).map(top)
        })
        .collect()
}

/// Returns the top of the lowest of the [`SKIN`] highest grains of every column.
fn skin(cells: &Cells, grains: &[MeasuredGrain]) -> Vec<Option<f64>> {
    let mut tops: Vec<Vec<f64>> = vec![Vec::new(); cells.count[0] * cells.count[1]];
    for grain in grains {
        let [long, across, _] = cells.cell_of(grain.at);
        tops[cells.column(long, across)].push(grain.at[2] + grain.radius);
    }
    let lowest = |mut tops: Vec<f64>| {
        tops.sort_by(|a, b| b.total_cmp(a));
        tops.into_iter().take(SKIN).next_back()
    };
    tops.into_iter().map(lowest).collect()
}

impl InitialGround {
    /// Returns the ground at time 0 from the current grains.
    #[must_use]
    pub fn new(cells: Cells, grains: &[MeasuredGrain], diameter: f64, overlap: Overlap) -> Self {
        let solid = solid_fractions(&cells, grains, overlap);
        Self {
            cells,
            diameter,
            solid: solid
                .iter()
                .map(|part| (part * 1e4).round() / 1e4)
                .collect(),
            surface: surface(&cells, grains, diameter),
            skin: skin(&cells, grains),
        }
    }

    /// Returns the median solid fraction of the ground; 1 without ground.
    fn packing(&self) -> f64 {
        let mut ground: Vec<f64> = (self.solid.iter().copied())
            .filter(|part| *part >= GROUND)
            .collect();
        ground.sort_by(f64::total_cmp);
        ground.get(ground.len() / 2).copied().unwrap_or(1.0)
    }

    fn is_ground(&self, cell: [usize; 3]) -> bool {
        self.solid[self.cells.index(cell)] >= GROUND
    }

    /// Returns the elevation of the lowest ground of a column \[m\].
    fn floor(&self, long: usize, across: usize) -> Option<f64> {
        (0..self.cells.count[2])
            .find(|&z| self.is_ground([long, across, z]))
            .map(|z| self.cells.lower(z, 2))
    }

    /// Returns the settlement of every column: the smaller of the decrease of its elevation and the descent of the
    /// grains that formed its surface.
    #[must_use]
    pub fn settlement(&self, now: &[Option<f64>], grains: &[MeasuredGrain]) -> Vec<Option<f64>> {
        let [nx, ny, _] = self.cells.count;
        let descent = self.descent(grains);
        let columns = (0..ny).flat_map(|across| (0..nx).map(move |long| (long, across)));
        columns
            .map(|(long, across)| {
                let k = self.cells.column(long, across);
                let before = self.surface[k]?;
                let bare = || self.floor(long, across);
                let fall = before - now[k].or_else(bare).unwrap_or(before);
                Some(descent[k].map_or(fall, |descent| fall.min(descent)))
            })
            .collect()
    }

    /// Returns the settlement of the median of the grains that formed the surface of every column at time 0, at
    /// their current positions (the lower median of an even number); none if all of them have left.
    fn descent(&self, grains: &[MeasuredGrain]) -> Vec<Option<f64>> {
        let mut down: Vec<Vec<f64>> = vec![Vec::new(); self.skin.len()];
        // The recorded position at time 0 is rounded.
        let slack = 1e-9 * self.diameter;
        for grain in grains {
            let start = std::array::from_fn(|axis| grain.at[axis] - grain.moved[axis]);
            let [long, across, _] = self.cells.cell_of(start);
            let k = self.cells.column(long, across);
            if self.skin[k].is_some_and(|lowest| start[2] + grain.radius >= lowest - slack) {
                down[k].push(-grain.moved[2]);
            }
        }
        let middle = |mut down: Vec<f64>| {
            down.sort_by(f64::total_cmp);
            down.get(down.len().saturating_sub(1) / 2).copied()
        };
        down.into_iter().map(middle).collect()
    }

    /// Returns the cells of the ground at time 0 that have lost their solid.
    #[must_use]
    pub fn void_cells(&self, solid: &[f64], void_below: f64) -> Vec<bool> {
        let both = self.solid.iter().zip(solid);
        both.map(|(&before, &now)| before >= GROUND && now < void_below * before)
            .collect()
    }

    /// Returns the void cells connected through faces with those at the box of a point or just above it, in
    /// ascending order.
    #[must_use]
    pub fn void_over(&self, point: &Point, void: &[bool]) -> Vec<usize> {
        let cells = &self.cells;
        let [xs, ys] = [0, 1].map(|axis| cells.covered(axis, point.from[axis], point.to[axis]));
        // The lowest ground over the opening may begin a little above it.
        let lowest = self.cover(point).0.max(point.to[2]);
        let zs = cells.covered(2, point.from[2], lowest + cells.size[2]);
        let mut seen = vec![false; cells.total()];
        let mut queue = Vec::new();
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    queue.push([x, y, z]);
                }
            }
        }
        while let Some(cell) = queue.pop() {
            let k = cells.index(cell);
            if !void[k] || seen[k] {
                continue;
            }
            seen[k] = true;
            for axis in 0..3 {
                for up in [false, true] {
                    let mut next = cell;
                    if up && cell[axis] + 1 < cells.count[axis] {
                        next[axis] += 1;
                        queue.push(next);
                    } else if !up && cell[axis] > 0 {
                        next[axis] -= 1;
                        queue.push(next);
                    }
                }
            }
        }
        let all = seen.iter().enumerate();
        all.filter(|(_, seen)| **seen).map(|(k, _)| k).collect()
    }

    /// Returns the volume of soil missing in the listed cells \[m3\].
    fn missing(&self, cells: &[usize], solid: &[f64]) -> f64 {
        let lost: f64 = cells
            .iter()
            .map(|&k| (self.solid[k] - solid[k]).max(0.0))
            .sum();
        lost * self.cells.volume() / self.packing()
    }

    /// Returns the elevations of the lowest ground and of the surface over a point at time 0 \[m\].
    fn cover(&self, point: &Point) -> (f64, f64) {
        let cells = &self.cells;
        let [xs, ys] = [0, 1].map(|axis| cells.covered(axis, point.from[axis], point.to[axis]));
        let (mut base, mut top) = (f64::INFINITY, f64::NEG_INFINITY);
        for across in ys {
            for long in xs.clone() {
                base = base.min(self.floor(long, across).unwrap_or(f64::INFINITY));
                top =
                    top.max(self.surface[cells.column(long, across)].unwrap_or(f64::NEG_INFINITY));
            }
        }
        // For a point inside the ground, only the ground above its lower face counts.
        (base.max(point.from[2]), top)
    }

    /// Measures the ground at the current time.
    #[must_use]
    pub fn measure(
        &self,
        grains: &[MeasuredGrain],
        points: &[Point],
        limits: &Limits,
        overlap: Overlap,
    ) -> Sample {
        let solid = solid_fractions(&self.cells, grains, overlap);
        let void = self.void_cells(&solid, limits.void_below);
        let moving = self.moving_cells(grains, &void, limits.moving);
        let mut distinct: Vec<Vec<usize>> = Vec::new();
        let mut above = Vec::new();
        for (n, point) in points.iter().enumerate() {
            let hole = self.void_over(point, &void);
            let (base, top) = self.cover(point);
            let cover = (top - base).max(0.0);
            let highest = hole
                .last()
                .map(|k| k / (self.cells.count[0] * self.cells.count[1]));
            let roof = highest.map_or(base, |z| self.cells.lower(z + 1, 2).min(top));
            let front = self.front(grains, point, base, top, limits.moving);
            above.push(PointMeasures {
                void_volume: self.missing(&hole, &solid),
                arch_height: (roof - base).max(0.0),
                cover,
                front: if cover > 0.0 {
                    ((front - base) / cover).clamp(0.0, 1.0)
                } else {
                    0.0
                },
                front_shape: self.front_shape(&moving, n, points, base, front),
            });
            // Merged voids of two points count once.
            if !hole.is_empty() && !distinct.contains(&hole) {
                distinct.push(hole);
            }
        }
        let surface = surface(&self.cells, grains, self.diameter);
        let settlement = self.settlement(&surface, grains);
        let mut sorted: Vec<f64> = settlement.iter().flatten().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let rank = limits.percentile / 100.0 * real(sorted.len().max(1) - 1);
        let rank = index_along(rank.round(), 1.0, sorted.len());
        Sample {
            voids: distinct.len() as u64,
            void_volume: distinct.iter().map(|hole| self.missing(hole, &solid)).sum(),
            points: above,
            settlement_max: sorted.last().copied().unwrap_or(0.0),
            sinkhole: self.sinkhole(&settlement, points),
            settlement_percentile: sorted.get(rank).copied().unwrap_or(0.0),
            settlement_middle: self.middle(&settlement),
            depression: self.depression(&settlement, limits.settled),
            inward: self.inward(grains, points),
            surface,
            settlement,
        }
    }

    /// Returns the largest settlement of a column over a point (along the long axis), or of both of two columns
    /// that share an edge or a corner. Away from the points a single settled column is a loose grain.
    #[must_use]
    pub fn sinkhole(&self, settlement: &[Option<f64>], points: &[Point]) -> f64 {
        let [nx, ny, _] = self.cells.count;
        let of = |long, across| settlement[self.cells.column(long, across)].unwrap_or(0.0);
        let mut most: f64 = 0.0;
        for long in 0..nx {
            let middle = self.cells.lower(long, 0) + 0.5 * self.cells.size[0];
            let over = points.iter().any(|point| distance(point, middle) <= 0.0);
            for across in 0..ny {
                let here = of(long, across);
                if over {
                    most = most.max(here);
                    continue;
                }
                // The two neighbours along the row and the three of each adjacent row.
                for other in long.saturating_sub(1)..(long + 2).min(nx) {
                    for row in across.saturating_sub(1)..(across + 2).min(ny) {
                        if (other, row) != (long, across) {
                            most = most.max(here.min(of(other, row)));
                        }
                    }
                }
            }
        }
        most
    }

    /// Returns the mean settlement over the middle third along the long axis.
    fn middle(&self, settlement: &[Option<f64>]) -> f64 {
        let [nx, ny, _] = self.cells.count;
        let third = nx / 3;
        let (mut sum, mut n) = (0.0, 0_usize);
        for across in 0..ny {
            for long in third..nx - third {
                if let Some(value) = settlement[self.cells.column(long, across)] {
                    sum += value;
                    n += 1;
                }
            }
        }
        sum / real(n.max(1))
    }

    /// Returns the area where the columns have settled by at least `settled`.
    #[must_use]
    pub fn depression(&self, settlement: &[Option<f64>], settled: f64) -> Depression {
        let [nx, ny, _] = self.cells.count;
        let down = |long, across| {
            settlement[self.cells.column(long, across)].is_some_and(|value| value >= settled)
        };
        let (mut slices, mut run, mut longest) = (0_usize, 0, 0_usize);
        for long in 0..nx {
            if (0..ny).any(|across| down(long, across)) {
                slices += 1;
                run += 1;
                longest = longest.max(run);
            } else {
                run = 0;
            }
        }
        let rows = (0..ny)
            .filter(|&across| (0..nx).any(|long| down(long, across)))
            .count();
        Depression {
            length: real(slices) * self.cells.size[0],
            longest: real(longest) * self.cells.size[0],
            width: real(rows) * self.cells.size[1],
        }
    }

    /// Returns the cells of the ground that are void or whose grains have moved down by more than `moving` on average.
    fn moving_cells(&self, grains: &[MeasuredGrain], void: &[bool], moving: f64) -> Vec<bool> {
        let mut down = vec![(0.0, 0_usize); self.cells.total()];
        for grain in grains {
            let (sum, n) = &mut down[self.cells.index(self.cells.cell_of(grain.at))];
            *sum -= grain.moved[2];
            *n += 1;
        }
        let all = self.solid.iter().zip(void).zip(down);
        all.map(|((&solid, &void), (sum, n))| {
            solid >= GROUND && (void || (n > 0 && sum / real(n) > moving))
        })
        .collect()
    }

    /// Returns the elevation up to which the ground over a point moves \[m\].
    fn front(
        &self,
        grains: &[MeasuredGrain],
        point: &Point,
        base: f64,
        top: f64,
        moving: f64,
    ) -> f64 {
        let cells = &self.cells;
        if base >= top {
            return base;
        }
        let [xs, ys] = [0, 1].map(|axis| cells.covered(axis, point.from[axis], point.to[axis]));
        let mut down = vec![(0.0, 0_usize); cells.count[2]];
        for grain in grains {
            let [x, y, z] = cells.cell_of(grain.at);
            if xs.contains(&x) && ys.contains(&y) {
                down[z].0 -= grain.moved[2];
                down[z].1 += 1;
            }
        }
        let mut front = base;
        for z in cells.covered(2, base, top) {
            let ground = ys
                .clone()
                .any(|across| xs.clone().any(|long| self.is_ground([long, across, z])));
            let (sum, n) = down[z];
            if ground && n > 0 && sum / real(n) <= moving {
                break;
            }
            front = cells.lower(z + 1, 2).min(top);
        }
        front
    }

    /// Returns the moving length above half the front divided by that below it, over the length nearest to point
    /// `n`.
    ///
    /// Each column of the long section is weighted with the moving fraction of its width, so that a fissure that
    /// widens upwards (V-shaped) does not appear as more moving ground above.
    fn front_shape(
        &self,
        moving: &[bool],
        n: usize,
        points: &[Point],
        base: f64,
        front: f64,
    ) -> f64 {
        let half = 0.5 * (base + front);
        let [along, up] = [0, 2].map(|axis| self.cells.size[axis]);
        let (mut upper, mut lower) = (0.0, 0.0);
        for z in 0..self.cells.count[2] {
            // The middle layer belongs to both halves.
            let bottom = self.cells.lower(z, 2);
            let part = |from: f64, to: f64| ((bottom + up).min(to) - bottom.max(from)).max(0.0);
            let (above, below) = (part(half, front), part(base, half));
            for long in 0..self.cells.count[0] {
                let x = self.cells.lower(long, 0) + 0.5 * along;
                if nearest(points, x) != Some(n) {
                    continue;
                }
                let (mut ground, mut moves) = (0_usize, 0_usize);
                for across in 0..self.cells.count[1] {
                    let cell = [long, across, z];
                    ground += usize::from(self.is_ground(cell));
                    moves += usize::from(moving[self.cells.index(cell)]);
                }
                if ground > 0 {
                    let width = real(moves) / real(ground);
                    upper += width * above;
                    lower += width * below;
                }
            }
        }
        if lower > 0.0 { upper / lower } else { f64::NAN }
    }

    /// Returns the mean displacement of the soil at the sides of the points towards the nearest point.
    fn inward(&self, grains: &[MeasuredGrain], points: &[Point]) -> f64 {
        let covers: Vec<f64> = points
            .iter()
            .map(|point| {
                let (base, top) = self.cover(point);
                (top - base).max(0.0)
            })
            .collect();
        let (mut sum, mut count) = (0.0, 0_usize);
        for grain in grains {
            let start = grain.at[0] - grain.moved[0];
            let Some(n) = nearest(points, start) else {
                continue;
            };
            let beyond = distance(&points[n], start);
            if beyond > 0.0 && beyond <= covers[n] {
                let inwards = if start < points[n].from[0] { 1.0 } else { -1.0 };
                sum += inwards * grain.moved[0];
                count += 1;
            }
        }
        sum / real(count.max(1))
    }
}

/// Returns the distance of a coordinate along the long axis from a point; 0 inside it.
fn distance(point: &Point, x: f64) -> f64 {
    (point.from[0] - x).max(x - point.to[0]).max(0.0)
}

/// Returns the index of the nearest point along the long axis; the first one of equally near points.
fn nearest(points: &[Point], x: f64) -> Option<usize> {
    let all = points.iter().enumerate();
    all.min_by(|(_, a), (_, b)| distance(a, x).total_cmp(&distance(b, x)))
        .map(|(n, _)| n)
}

#[cfg(test)]
mod tests;
