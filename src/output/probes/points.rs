//! The state of the fluid at points, interpolated linearly along each axis from the cell centres around them.

use super::quantity::Quantity;
use super::{Heading, POSITION, Rows, VELOCITY, fluid};
use crate::view::StateView;
use base::error::Error;
use base::number::{real, whole};
use base::vector::distance;
use coupling::FluidView;
use decomposition::Domain;
use dem::space::Space;
use plan::scene::Scene;
use plan::scene::grid::Grid;

/// A point in the fluid of a lattice.
#[derive(Debug)]
pub(super) struct Point(Located);

impl Point {
    /// Returns the point of a position \[m\].
    pub(super) fn new(position: [f64; 3]) -> Self {
        Self(Located::new(vec![position]))
    }
}

impl Quantity for Point {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        [VELOCITY.as_slice(), &[("pressure", "Pa")]].concat()
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        for (row, state) in rows.iter_mut().zip(self.0.sample(view)?) {
            row.extend(state.velocity);
            row.push(state.pressure);
        }
        Ok(true)
    }
}

/// Points at equal distances along a line in the fluid of a lattice.
#[derive(Debug)]
pub(super) struct Line(Located);

impl Line {
    /// Returns a number of points between two ends \[m\], which are included.
    pub(super) fn new(from: [f64; 3], to: [f64; 3], points: usize) -> Self {
        Self(Located::new(along(from, to, points)))
    }
}

/// Returns the columns of points along a line, before those of the state.
pub(super) fn line_headings() -> Vec<Heading> {
    [&[("distance", "m")], POSITION.as_slice(), &VELOCITY].concat()
}

impl Quantity for Line {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        let mut headings = line_headings();
        headings.push(("pressure", "Pa"));
        headings
    }

    fn rows(&self) -> usize {
        self.0.positions.len()
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let first = self.0.positions.first().copied().unwrap_or_default();
        for (row, state) in rows.iter_mut().zip(self.0.sample(view)?) {
            row.push(distance(first, state.position));
            row.extend(state.position);
            row.extend(state.velocity);
            row.push(state.pressure);
        }
        Ok(true)
    }
}

/// Positions whose cells are found at the first sample, when the slabs are known.
#[derive(Debug)]
struct Located {
    positions: Vec<[f64; 3]>,
    points: Option<Points>,
}

impl Located {
    fn new(positions: Vec<[f64; 3]>) -> Self {
        Self {
            positions,
            points: None,
        }
    }

    /// Returns the state at every point, in the order of the points, on rank 0; nothing on other ranks. Collective.
    fn sample<S: Space>(&mut self, view: &StateView<S>) -> Result<Vec<PointState>, Error> {
        let points = match self.points.take() {
            Some(points) => points,
            None => Points::new(&self.positions, &view.plan.scene.grid, view.domain)?,
        };
        self.points.insert(points).sample(fluid(view)?, view.domain)
    }
}

/// Points with the cells around each.
#[derive(Debug)]
struct Points {
    points: Vec<Corners>,
    /// Cells that any point needs, each listed once with its owner; the same on every rank.
    cells: Vec<([usize; 3], usize)>,
}

#[derive(Debug)]
struct Corners {
    /// Position \[m\].
    position: [f64; 3],
    /// Indices in [`Points::cells`] and weights.
    around: Vec<(usize, f64)>,
}

/// Density deviation and velocity, in lattice units.
type State = [f64; 4];

/// State of the fluid at a point.
struct PointState {
    /// Position \[m\].
    position: [f64; 3],
    /// Velocity [m/s].
    velocity: [f64; 3],
    /// Pressure \[Pa\].
    pressure: f64,
}

impl Points {
    fn new(positions: &[[f64; 3]], grid: &Grid, domain: &Domain) -> Result<Self, Error> {
        let corners: Vec<Vec<([usize; 3], f64)>> =
            positions.iter().map(|p| corners(*p, grid)).collect();
        let mut all: Vec<[usize; 3]> = corners.iter().flatten().map(|c| c.0).collect();
        all.sort_unstable();
        all.dedup();
        let points = positions
            .iter()
            .zip(&corners)
            .map(|(position, corners)| Corners {
                position: *position,
                around: corners
                    .iter()
                    .filter_map(|(cell, weight)| Some((all.binary_search(cell).ok()?, *weight)))
                    .collect(),
            })
            .collect();
        let axis = domain.axis().index();
        let cells = all
            .into_iter()
            .map(|cell| match domain.slabs().owner_of_plane(cell[axis]) {
                Some(owner) => Ok((cell, owner)),
                None => Err(Error::Internal(format!("no rank owns the cell {cell:?}"))),
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { points, cells })
    }

    /// Returns the state at every point, in the order of the points, on rank 0; nothing on other ranks. Collective.
    fn sample(&self, fluid: &dyn FluidView, domain: &Domain) -> Result<Vec<PointState>, Error> {
        let start = fluid.start();
        let mut bytes = Vec::new();
        for (cell, _) in self.cells.iter().filter(|c| c.1 == domain.rank()) {
            let (deviation, [u, v, w]) =
                fluid.state(std::array::from_fn(|a| cell[a].wrapping_sub(start[a])));
            for value in [deviation, u, v, w] {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
        }
        let Some(messages) = domain.communicator().gather_bytes(0, &bytes) else {
            return Ok(Vec::new());
        };
        let mut streams: Vec<_> = messages
            .iter()
            .map(|m| m.as_chunks::<8>().0.as_chunks::<4>().0.iter())
            .collect();
        let states = self
            .cells
            .iter()
            .map(|(cell, owner)| {
                streams
                    .get_mut(*owner)
                    .and_then(Iterator::next)
                    .map(|state| state.map(f64::from_le_bytes))
                    .ok_or_else(|| Error::Internal(format!("the cell {cell:?} did not arrive")))
            })
            .collect::<Result<Vec<State>, _>>()?;
        let units = fluid.units();
        let sample = |point: &Corners| {
            let mut sum = [0.0; 4];
            for (place, weight) in &point.around {
                for (to, value) in sum.iter_mut().zip(states[*place]) {
                    *to += weight * value;
                }
            }
            let [deviation, u, v, w] = sum;
            PointState {
                position: point.position,
                velocity: [u, v, w].map(|u| units.velocity_to_si(u)),
                pressure: units.density_deviation_to_pressure(deviation),
            }
        };
        Ok(self.points.iter().map(sample).collect())
    }
}

/// Returns points at equal distances, both ends included.
pub(super) fn along(from: [f64; 3], to: [f64; 3], points: usize) -> Vec<[f64; 3]> {
    let last = real(points.max(2) - 1);
    (0..points)
        .map(|n| {
            let t = real(n) / last;
            std::array::from_fn(|a| from[a] * (1.0 - t) + to[a] * t)
        })
        .collect()
}

/// Returns the cells around a point and their weights, which add up to one.
fn corners(position: [f64; 3], grid: &Grid) -> Vec<([usize; 3], f64)> {
    let mut corners = vec![([0; 3], 1.0)];
    for axis in 0..grid.dimension {
        let ends = continued(position[axis], grid, axis);
        corners = corners
            .iter()
            .flat_map(|(cell, weight)| {
                ends.iter().map(move |(plane, share)| {
                    let mut cell: [usize; 3] = *cell;
                    cell[axis] = *plane;
                    (cell, weight * share)
                })
            })
            .filter(|c| c.1 != 0.0)
            .collect();
    }
    corners
}

/// Returns the two planes of cells next to a coordinate and their weights: extrapolated beyond the last centres,
/// wrapped if the axis is periodic.
fn continued(position: f64, grid: &Grid, axis: usize) -> [(usize, f64); 2] {
    let cells = grid.cells[axis];
    if cells == 1 {
        return [(0, 1.0), (0, 0.0)];
    }
    let at = position / grid.spacing - 0.5;
    if grid.periodic[axis] {
        let low = at.floor();
        let first = whole(low + real(cells)) % cells;
        return [(first, 1.0 - (at - low)), ((first + 1) % cells, at - low)];
    }
    let low = at.floor().clamp(0.0, real(cells - 2));
    let first = whole(low);
    [(first, 1.0 - (at - low)), (first + 1, at - low)]
}

/// Returns the planes and weights of a coordinate, constant beyond the last centres: weights are never negative.
pub(super) fn clamped(position: f64, grid: &Grid, axis: usize) -> [(usize, f64); 2] {
    continued(position, grid, axis).map(|(plane, weight)| (plane, weight.clamp(0.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn grid(periodic: bool) -> Grid {
        Grid {
            dimension: 2,
            cells: [4, 3, 1],
            size: [2.0, 1.5, 0.5],
            spacing: 0.5,
            periodic: [periodic, false, false],
            split_axis: 0,
            slab_bounds: None,
        }
    }

    /// Checks that a linear function of position is reproduced everywhere, up to the faces.
    #[test]
    fn a_linear_field_is_interpolated_exactly() {
        let grid = grid(false);
        for point in [[0.0, 0.0, 0.0], [2.0, 1.5, 0.0], [0.9, 0.31, 0.0]] {
            let corners = corners(point, &grid);
            let weights: f64 = corners.iter().map(|c| c.1).sum();
            let value: f64 = corners
                .iter()
                .map(|(cell, weight)| {
                    let [x, y, _] = grid.centre(*cell);
                    weight * (3.0 * x - 2.0 * y)
                })
                .sum();
            assert_relative_eq!(weights, 1.0, epsilon = 1e-14);
            assert_relative_eq!(value, 3.0 * point[0] - 2.0 * point[1], epsilon = 1e-13);
        }
    }

    #[test]
    fn a_periodic_axis_wraps() {
        let grid = grid(true);
        assert_eq!(continued(0.0, &grid, 0), [(3, 0.5), (0, 0.5)]);
        assert_eq!(continued(2.0, &grid, 0), [(3, 0.5), (0, 0.5)]);
        assert_eq!(continued(0.75, &grid, 0), [(1, 1.0), (2, 0.0)]);
        assert_eq!(clamped(0.0, &grid, 1), [(0, 1.0), (1, 0.0)]);
        assert_eq!(clamped(1.5, &grid, 1), [(1, 0.0), (2, 1.0)]);
    }

    #[test]
    fn a_line_has_both_ends() {
        let line = along([0.0; 3], [1.0, 2.0, 0.0], 5);
        assert_eq!(line.len(), 5);
        assert_eq!((line[0], line[4]), ([0.0; 3], [1.0, 2.0, 0.0]));
        assert_eq!(line[2], [0.5, 1.0, 0.0]);
    }
}
