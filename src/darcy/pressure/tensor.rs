//! Permeability whose principal axes are inclined to the axes of the grid, in 2-D.
//!
//! ```text
//! K = | K1 c^2 + K2 s^2    (K1 - K2) s c   |      K1 along the bedding, K2 across it,
//!     | (K1 - K2) s c      K1 s^2 + K2 c^2 |      c and s: cosine and sine of the dip
//! ```
//!
//! The multi-point flux approximation of I. Aavatsmark, T. Barkve, O. Boe and T. Mannseth (J. Comput. Phys. 127
//! (1996) 2), in the form that a variational principle gives on boxes: around each corner of cells the head is
//! linear in the quarter of each cell, with a value at the middle of each face; these values minimise the energy of
//! the flow, so that the flux through each half of a face is continuous. The scheme has nine points, is symmetric
//! and positive, exact for every uniform gradient and for layers along the grid, and equals the two-point scheme
//! without inclination. A closed face has zero flux, a face with a condition its pressure or its flux.
//!
//! The difference to the two-point scheme is stored separately: the multigrid cycle of the two-point flow is the
//! preconditioner. The condition number of the preconditioned system is (1 + r)/(1 - r), r = |Kxy|/sqrt(Kxx Kyy).
//! Couplings along one diagonal are negative wherever the ground dips, so that the system has no maximum principle;
//! [`Pressure::overshoot`] returns by how much a solution leaves the range of the heads that drive it.

use super::{Condition, Pressure};
use crate::layout::Layout;

/// Maximum number of nodes of a corner: four cells, then at most eight values on faces.
const NODES: usize = 12;
/// Index that marks the absence of a boundary face.
const NONE: u32 = u32::MAX;

/// Differences of the flow with inclined permeability to the two-point flow.
pub(super) struct Tensor {
    /// Cross term of the conductivity divided by the geometric mean of those along the axes, for each cell.
    shear: Vec<f64>,
    /// Indices of the boundary faces of each cell: below and above along x, then along y.
    faces: Vec<[u32; 4]>,
    /// Couplings of each cell with its neighbours to the east, north, north-east and north-west.
    coupling: [Vec<f64>; 4],
    /// Couplings with imposed pressures.
    leak: Vec<f64>,
    /// Flow through the lower face of each cell along x and y, in addition to the two-point flow \[m²/s\].
    pub(super) flow: [Vec<f64>; 2],
}

/// Value on a face at a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Edge {
    /// Free value, for which this flow into the ground is given.
    Free(f64),
    /// Imposed value, relative to the level.
    Known(f64),
}

/// System of equations of a corner.
struct Corner {
    /// Positions of the cells south-west, south-east, north-west and north-east; none for a cell without water.
    cells: [Option<usize>; 4],
    /// Nodes of the faces of each cell normal to x and y.
    nodes: [[usize; 2]; 4],
    /// Number of nodes.
    count: usize,
    edges: [Edge; NODES],
    /// Conductances of each quarter along x and y, and between them.
    quarters: [[f64; 3]; 4],
    matrix: [[f64; NODES]; NODES],
    right: [f64; NODES],
}

/// Signs of the position of each cell at a corner: 1 if the cell is below the corner along an axis, -1 if above.
const SIDES: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];

/// Cells on both sides of the two half faces normal to an axis at a corner.
const HALF_FACES: [[(usize, usize); 2]; 2] = [[(0, 1), (2, 3)], [(0, 2), (1, 3)]];

impl Corner {
    /// Adds the energy of each quarter of a cell; with the cross term if `shear`.
    fn assemble(&mut self, shear: bool) {
        self.matrix = [[0.0; NODES]; NODES];
        self.right = [0.0; NODES];
        for s in 0..4 {
            if self.cells[s].is_none() {
                continue;
            }
            let [a, b, c] = self.quarters[s];
            let c = if shear {
                c * SIDES[s][0] * SIDES[s][1]
            } else {
                0.0
            };
            let [x, y] = self.nodes[s];
            let m = &mut self.matrix;
            m[x][x] += a;
            m[y][y] += b;
            m[s][s] += a + b + 2.0 * c;
            for (p, q, value) in [(x, y, c), (x, s, -(a + c)), (y, s, -(b + c))] {
                m[p][q] += value;
                m[q][p] += value;
            }
        }
        for node in 4..self.count {
            if let Edge::Free(flow) = self.edges[node] {
                self.right[node] = flow;
            }
        }
    }

    /// Eliminates the free values.
    fn eliminate(&mut self) {
        for e in 4..self.count {
            let pivot = self.matrix[e][e];
            if !matches!(self.edges[e], Edge::Free(_)) || pivot <= 0.0 {
                continue;
            }
            for i in 0..self.count {
                let done = i >= 4 && i <= e && matches!(self.edges[i], Edge::Free(_));
                let factor = self.matrix[i][e] / pivot;
                if done || factor == 0.0 {
                    continue;
                }
                for j in 0..self.count {
                    self.matrix[i][j] -= factor * self.matrix[e][j];
                }
                self.right[i] -= factor * self.right[e];
                self.matrix[i][e] = 0.0;
            }
        }
    }

    /// Returns the values of all nodes for given pressures of the cells, after [`Self::eliminate`].
    fn values(&self, phi: &[f64]) -> [f64; NODES] {
        let mut values = [0.0; NODES];
        for (value, cell) in values.iter_mut().zip(self.cells) {
            *value = cell.map_or(0.0, |at| phi[at]);
        }
        for e in 4..self.count {
            if let Edge::Known(value) = self.edges[e] {
                values[e] = value;
            }
        }
        for e in (4..self.count).rev() {
            if matches!(self.edges[e], Edge::Free(_)) && self.matrix[e][e] > 0.0 {
                // Values eliminated earlier are not in the row.
                let mut sum = self.right[e];
                for (j, value) in values.iter().enumerate().take(self.count) {
                    let before = j >= 4 && j < e && matches!(self.edges[j], Edge::Free(_));
                    if j != e && !before {
                        sum -= self.matrix[e][j] * value;
                    }
                }
                values[e] = sum / self.matrix[e][e];
            }
        }
        values
    }

    /// Returns the flow out of a cell through its face along an axis; with the cross term if `shear` is `true`.
    fn outflow(&self, s: usize, axis: usize, values: &[f64; NODES], shear: bool) -> f64 {
        let [a, b, c] = self.quarters[s];
        let c = if shear {
            c * SIDES[s][0] * SIDES[s][1]
        } else {
            0.0
        };
        let [x, y] = self.nodes[s].map(|node| values[node] - values[s]);
        if axis == 0 {
            -(a * x + c * y)
        } else {
            -(b * y + c * x)
        }
    }
}

impl Tensor {
    /// Returns the inflow of a cell in addition to the two-point flow, without imposed pressures.
    #[inline]
    fn inflow(&self, layout: &Layout, x: &[f64], at: usize) -> f64 {
        let row = layout.stride[1];
        let [east, north, north_east, north_west] = &self.coupling;
        let here = x[at];
        let to = |coupling: f64, other: usize| coupling * (x[other] - here);
        ((to(east[at], at + 1) + to(east[at - 1], at - 1))
            + (to(north[at], at + row) + to(north[at - row], at - row)))
            + ((to(north_east[at], at + row + 1) + to(north_east[at - row - 1], at - row - 1))
                + (to(north_west[at], at + row - 1) + to(north_west[at - row + 1], at - row + 1)))
            - self.leak[at] * here
    }
}

impl Pressure {
    /// Sets the inclination of the principal axes of the permeability; `shear` is the cross term divided by the
    /// geometric mean of the conductivities along the axes, for each cell. For saturated ground in 2-D.
    #[must_use]
    pub fn with_shear(mut self, shear: &[f64]) -> Self {
        let (grid, layout) = (&self.slab.grid, self.slab.layout);
        let zeros = || vec![0.0; layout.len()];
        let mut own = Tensor {
            shear: zeros(),
            faces: vec![[NONE; 4]; layout.len()],
            coupling: std::array::from_fn(|_| zeros()),
            leak: zeros(),
            flow: [zeros(), zeros()],
        };
        for (cell, shear) in shear.iter().enumerate() {
            own.shear[layout.position(grid.cell(cell))] = *shear;
        }
        for (n, face) in self.boundary.iter().enumerate() {
            if !face.source {
                own.faces[face.at][2 * face.axis + usize::from(face.upper)] =
                    base::number::to_u32(n);
            }
        }
        log::info!("permeability whose principal axes dip");
        self.tensor = Some(Box::new(own));
        self
    }

    /// Returns by how much the reduced pressure of a cell lies outside the range of the imposed ones, relative to
    /// that range; none without inclination or if a flux drives the water.
    #[must_use]
    pub fn overshoot(&self) -> Option<f64> {
        self.tensor.as_ref()?;
        let drives = |face: &super::Boundary| self.imposed(face).is_none();
        if self.boundary.iter().any(drives) {
            return None;
        }
        let imposed = self.boundary.iter().filter_map(|face| self.imposed(face));
        let (low, high) = imposed.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), phi| {
            (low.min(phi), high.max(phi))
        });
        let cells = (0..self.slab.grid.count()).filter(|&cell| self.conduction.conducts[cell]);
        let beyond = cells.map(|cell| {
            let phi = self.reduced(cell);
            (low - phi).max(phi - high)
        });
        let most = beyond.fold(0.0, f64::max);
        Some(if high > low { most / (high - low) } else { 0.0 })
    }

    /// Returns the pressure gradient of a flux with inclined permeability: the inverse of the tensor times the
    /// flux.
    pub(super) fn dipping_gradient(&self, cell: usize) -> Option<[f64; 3]> {
        let own = self.tensor.as_ref()?;
        let at = self.slab.layout.position(self.slab.grid.cell(cell));
        let [kx, ky, _] = self.conductivities(cell);
        let kxy = own.shear[at] * (kx * ky).sqrt();
        let determinant = kx * ky - kxy * kxy;
        let [u, v, _] = self.conduction.driven[cell];
        Some(if determinant > 0.0 {
            [
                (kxy * v - ky * u) / determinant,
                (kxy * u - kx * v) / determinant,
                0.0,
            ]
        } else {
            [0.0; 3]
        })
    }

    /// Returns the corner below the cell (i, j); none if no cell around it is inclined.
    fn corner(&self, own: &Tensor, [i, j]: [usize; 2]) -> Option<Corner> {
        let (grid, layout) = (&self.slab.grid, &self.slab.layout);
        let places = [(1, 1), (0, 1), (1, 0), (0, 0)].map(|(x, y)| {
            let cell = [i.wrapping_sub(x), j.wrapping_sub(y), 0];
            let inside = cell[0] < grid.cells[0] && cell[1] < grid.cells[1];
            inside
                .then_some(cell)
                .filter(|cell| self.conduction.conducts[grid.index(*cell)])
        });
        let cells = places.map(|cell| cell.map(|cell| layout.position(cell)));
        if !cells.iter().flatten().any(|&at| own.shear[at].abs() > 0.0) {
            return None;
        }
        let mut corner = Corner {
            cells,
            nodes: [[0; 2]; 4],
            count: 4,
            edges: [Edge::Free(0.0); NODES],
            quarters: [[0.0; 3]; 4],
            matrix: [[0.0; NODES]; NODES],
            right: [0.0; NODES],
        };
        let mut parts = [[1.0; 2]; 4];
        for axis in 0..2 {
            for (lower, upper) in HALF_FACES[axis] {
                let between = cells[lower].zip(cells[upper]).map(|(_, upper)| upper);
                let factor = between.map_or(0.0, |at| self.conduction.factor[axis][at]);
                if factor > 0.0 {
                    let node = corner.count;
                    corner.count += 1;
                    let cell = places[upper].unwrap_or_default();
                    let open = 0.5 * factor * grid.spacing[axis] / grid.area(axis, cell);
                    for s in [lower, upper] {
                        corner.nodes[s][axis] = node;
                        parts[s][axis] = open;
                    }
                    continue;
                }
                for (s, up) in [(lower, 1), (upper, 0)] {
                    let Some(at) = cells[s] else {
                        continue;
                    };
                    let node = corner.count;
                    corner.count += 1;
                    corner.nodes[s][axis] = node;
                    let number = own.faces[at][2 * axis + up];
                    if number != NONE {
                        let (edge, open) = self.edge(number as usize);
                        corner.edges[node] = edge;
                        parts[s][axis] = open;
                    }
                }
            }
        }
        for s in 0..4 {
            if let (Some(at), Some(cell)) = (cells[s], places[s]) {
                let [hx, hy, _] = grid.widths(cell);
                let [fx, fy] = parts[s];
                let [kx, ky, _] = self.conductivities(grid.index(cell));
                let cross = own.shear[at] * (kx * ky).sqrt();
                corner.quarters[s] = [
                    kx * fx * hy / hx * grid.spacing[2],
                    ky * fy * hx / hy * grid.spacing[2],
                    cross * (fx * fy).sqrt() * grid.spacing[2],
                ];
            }
        }
        Some(corner)
    }

    /// Returns half of a boundary face: its value or flow, and its open fraction.
    fn edge(&self, number: usize) -> (Edge, f64) {
        let face = &self.boundary[number];
        let cell = self.slab.grid.cell(face.cell);
        let open = face.area / self.slab.grid.area(face.axis, cell);
        let edge = match self.patches[face.patch].condition {
            Condition::Flux { value } => Edge::Free(0.5 * value * face.area),
            Condition::Discharge { value } => Edge::Free(0.5 * value * face.share),
            Condition::Rain { rate } => Edge::Free(0.5 * rate * face.area * face.up),
            _ => match self.imposed(face) {
                Some(phi) => Edge::Known(phi - self.level),
                None => Edge::Free(0.0),
            },
        };
        (edge, open)
    }

    /// Computes the couplings, and adds the contributions of imposed pressures and fluxes to the right sides.
    pub(super) fn assemble_tensor(&mut self) {
        let Some(mut own) = self.tensor.take() else {
            return;
        };
        for coupling in &mut own.coupling {
            coupling.fill(0.0);
        }
        own.leak.fill(0.0);
        self.each_corner(&mut own, |this, own, corner, (_, sign)| {
            this.add_corner(own, corner, sign);
        });
        self.tensor = Some(own);
    }

    /// Eliminates the unknowns of each corner, with and without the shear, and passes it to `act` with `true` for the
    /// shear and the sign of its contribution.
    fn each_corner(
        &mut self,
        own: &mut Tensor,
        mut act: impl FnMut(&mut Self, &mut Tensor, &Corner, (bool, f64)),
    ) {
        let [nx, ny, _] = self.slab.grid.cells;
        for j in 0..=ny {
            for i in 0..=nx {
                let Some(mut corner) = self.corner(own, [i, j]) else {
                    continue;
                };
                for (shear, sign) in [(true, 1.0), (false, -1.0)] {
                    corner.assemble(shear);
                    corner.eliminate();
                    act(self, own, &corner, (shear, sign));
                }
            }
        }
    }

    /// Adds or subtracts the couplings of a corner.
    fn add_corner(&mut self, own: &mut Tensor, corner: &Corner, sign: f64) {
        // Pairs of cells: the array of their coupling belongs to the first.
        for (a, b, array) in [
            (0, 1, 0),
            (2, 3, 0),
            (0, 2, 1),
            (1, 3, 1),
            (0, 3, 2),
            (1, 2, 3),
        ] {
            if let (Some(at), Some(_)) = (corner.cells[a], corner.cells[b]) {
                own.coupling[array][at] -= sign * corner.matrix[a][b];
            }
        }
        for s in 0..4 {
            let Some(at) = corner.cells[s] else {
                continue;
            };
            self.system.right[at] += sign * corner.right[s];
            for node in 4..corner.count {
                if let Edge::Known(value) = corner.edges[node] {
                    let coupling = -sign * corner.matrix[s][node];
                    own.leak[at] += coupling;
                    self.system.right[at] += coupling * value;
                }
            }
        }
    }

    /// Adds the inflow of the cells of the part in addition to the two-point flow, times a sign.
    pub(super) fn add_tensor(&self, x: &[f64], out: &mut [f64], sign: f64) {
        let Some(own) = &self.tensor else {
            return;
        };
        let layout = &self.slab.layout;
        layout.sweep(&self.slab.part, out, |start, out| {
            for (i, out) in out.iter_mut().enumerate() {
                *out += sign * own.inflow(layout, x, start + i);
            }
        });
    }

    /// Computes the flow through the faces in addition to the two-point flow, at the present pressure.
    pub(super) fn take_tensor_flows(&mut self) {
        let Some(mut own) = self.tensor.take() else {
            return;
        };
        own.flow.iter_mut().for_each(|flow| flow.fill(0.0));
        for face in &mut self.boundary {
            face.extra = 0.0;
        }
        self.each_corner(&mut own, |this, own, corner, part| {
            let values = corner.values(&this.phi);
            this.add_flows(own, corner, &values, part);
        });
        self.tensor = Some(own);
    }

    /// Adds the flows through the half faces at a corner.
    fn add_flows(
        &mut self,
        own: &mut Tensor,
        corner: &Corner,
        values: &[f64; NODES],
        (shear, sign): (bool, f64),
    ) {
        for axis in 0..2 {
            for (lower, upper) in HALF_FACES[axis] {
                let shared = corner.nodes[lower][axis] == corner.nodes[upper][axis];
                if let (Some(_), Some(at), true) =
                    (corner.cells[lower], corner.cells[upper], shared)
                {
                    own.flow[axis][at] += sign * corner.outflow(lower, axis, values, shear);
                    continue;
                }
                for (s, up) in [(lower, 1), (upper, 0)] {
                    let Some(at) = corner.cells[s] else {
                        continue;
                    };
                    let number = own.faces[at][2 * axis + up];
                    let known = matches!(corner.edges[corner.nodes[s][axis]], Edge::Known(_));
                    if number != NONE && known {
                        self.boundary[number as usize].extra -=
                            sign * corner.outflow(s, axis, values, shear);
                    }
                }
            }
        }
    }

    /// Adds the mean of the extra flows of its two faces to the flux through each cell.
    pub(super) fn add_tensor_fluxes(&mut self) {
        let Some(own) = &self.tensor else {
            return;
        };
        let (grid, layout) = (&self.slab.grid, &self.slab.layout);
        for (cell, driven) in self.conduction.driven.iter_mut().enumerate() {
            let at = layout.position(grid.cell(cell));
            for axis in 0..2 {
                let above = at + layout.stride[axis];
                let per_area = &self.conduction.per_area[axis];
                let flow = &own.flow[axis];
                driven[axis] += 0.5 * (flow[at] * per_area[at] + flow[above] * per_area[above]);
            }
        }
    }
}

#[cfg(test)]
mod tests;
