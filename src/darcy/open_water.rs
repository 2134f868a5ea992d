//! Resistance of open water: cells and voids without grains.
//!
//! The water of a void moves between the walls of its channel. Along an axis the cross-section of the
//! channel at a cell is the rectangle
//! of the two lengths over which the void extends through this cell along the other axes, and the loss is
//! that of a duct:
//!
//! ```text
//! |grad phi| = f rho u^2/(2 D),     D = 2 a b/(a + b),     K = mu u/|grad phi|
//! laminar:   K = h^2/12 [1 - (192/pi^5) (h/w) sum over odd n of tanh(n pi w/(2 h))/n^5]
//!            h = min(a, b), w = max(a, b)
//! any flow:  f = 8 [(P/(8 Re))^12 + (A + B)^-1.5]^(1/12),  P = 2 D^2/K,  Re = rho u D/mu
//!            A = [2.457 ln(1/((7/Re)^0.9 + 0.27 k/D))]^16,  B = (37530/Re)^16
//! ```
//!
//! (R. K. Shah and A. L. London, Laminar Flow Forced Convection in Ducts, 1978; S. W. Churchill, Chem. Eng. 84
//! (1977) 91, with the laminar friction of the duct in place of 64/Re.) `k` is the roughness height. A slot has the
//! loss of plane Poiseuille flow.
//!
//! **Inertia.** Water that enters a void gains its velocity head there, and loses it at the exit. The loss is
//! distributed over the length L of the void along the axis:
//!
//! ```text
//! |grad phi| = C rho u^2,    C = 1/(2 L) from one imposed face to another,   C = 3/(2 L) where an end is closed
//! ```
//!
//! A channel between two reservoirs (imposed heads) loses one velocity head in addition to its friction. So does a
//! channel with a closed end that is fed evenly through its walls: the mean of `u^2` over its length is a third of
//! that at its mouth. The water in them is never faster than Bernoulli's equation allows. Between two faces with an
//! imposed pressure, which is that of the moving water, the loss of a channel is its friction, or one velocity head
//! if that is larger: a short passage has at least the losses of its ends.
//!
//! **Walls** are cells of soil, blocked cells, closed faces, and the faces of the grid that the case declares as
//! walls. A void ends where the openness of the next cell falls to 0; the openness falls from 1 to 0 while the
//! solid fraction rises from
//! 0.05 to 0.2, so that lengths and losses are continuous in the porosity. A face of the grid with an imposed
//! condition is a frictionless surface: the channel is mirrored there. The same holds for two opposite faces of the
//! grid without any declaration, if the void extends from one to the other: such a face cuts through wider water.
//! Any other undeclared face is a wall.

use super::Liquid;
use super::enclosure::Openness;
use super::grid::SeepageGrid;
use std::f64::consts::PI;

/// Solid fraction up to which a cell is open water; above the next one it is soil.
const OPEN: f64 = 0.05;
const SOIL: f64 = 0.2;
/// Maximum ratio of roughness height to hydraulic diameter: the friction of a duct filled by its roughness is not
/// known.
const ROUGHEST: f64 = 0.2;

/// Coefficient of the inertial loss over a void between two imposed faces, multiplied by C and the length of the void.
const OPEN_LOSS: f64 = 0.5;
const CLOSED_LOSS: f64 = 1.5;

/// Boundary of open water at a face of a boundary cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Face {
    /// Wall declared by the case.
    Wall,
    /// Reservoir: the head of stationary water is imposed.
    Reservoir,
    /// Stream: the pressure or the flux of the moving water is imposed.
    Stream,
    /// Face without a condition: impermeable.
    #[default]
    Unstated,
}

/// Returns the openness of a cell with the solid fraction `solid`: 1 in open water, 0 in soil.
#[must_use]
pub fn openness(solid: f64) -> f64 {
    1.0 - rise((solid - OPEN) / (SOIL - OPEN))
}

/// Returns a smooth step function that rises from 0 at 0 to 1 at 1.
#[must_use]
pub fn rise(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Returns the permeability \[m²\] of laminar flow in a duct with edges `a` and `b` \[m\]; one may be infinite.
#[must_use]
pub fn laminar(a: f64, b: f64) -> f64 {
    let (h, w) = (a.min(b), a.max(b));
    if h.is_infinite() {
        return f64::INFINITY;
    }
    let ratio = h / w;
    if ratio <= 0.0 {
        return h * h / 12.0;
    }
    let term = |n: f64| (0.5 * n * PI / ratio).tanh() / n.powi(5);
    let sum = term(1.0) + term(3.0) + term(5.0) + term(7.0);
    h * h / 12.0 * (1.0 - 192.0 / PI.powi(5) * ratio * sum)
}

/// Returns the hydraulic diameter \[m\] of a duct with edges `a` and `b` \[m\].
fn hydraulic_diameter(a: f64, b: f64) -> f64 {
    2.0 / (1.0 / a + 1.0 / b)
}

/// Channel along one axis at one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Duct {
    /// Hydraulic diameter \[m\].
    pub diameter: f64,
    /// Permeability of laminar flow \[m2\].
    pub laminar: f64,
    /// Inertial loss over `rho u^2` \[1/m\].
    pub inertia: f64,
    /// Degree to which the pressures at both ends are those of the moving water, 0 to 1.
    pub stream: f64,
}

impl Duct {
    /// Returns a channel without inertia, with a rectangular cross-section of edges `a` and `b` \[m\], one of which
    /// may be infinite.
    #[must_use]
    pub fn new(a: f64, b: f64) -> Self {
        Self {
            diameter: hydraulic_diameter(a, b),
            laminar: laminar(a, b),
            inertia: 0.0,
            stream: 0.0,
        }
    }

    /// Returns the loss of reduced pressure over the speed \[Pa s/m²\] at a mean `speed` \[m/s\] and a roughness
    /// height \[m\].
    #[must_use]
    pub fn resistance(&self, liquid: Liquid, roughness: f64, speed: f64) -> f64 {
        let friction = self.friction(liquid, roughness, speed);
        let inertia = self.inertia * liquid.density * speed;
        friction + inertia - self.stream * friction.min(inertia)
    }

    /// Returns the contribution of friction.
    fn friction(&self, liquid: Liquid, roughness: f64, speed: f64) -> f64 {
        let viscous = liquid.viscosity / self.laminar;
        let reynolds = liquid.density * speed * self.diameter / liquid.viscosity;
        // Churchill's turbulent branch is far below rounding here.
        if reynolds < 100.0 {
            return viscous;
        }
        let rough = (roughness / self.diameter).min(ROUGHEST);
        let a = (2.457 * -((7.0 / reynolds).powf(0.9) + 0.27 * rough).ln()).powi(16);
        let b = (37530.0 / reynolds).powi(16);
        // Friction factor relative to that of laminar flow: 8 (1 + x^12)^(1/12)/8 with x the ratio of the turbulent
        // to the laminar branch.
        let laminar = 0.25 * self.diameter * self.diameter / (self.laminar * reynolds);
        let turbulent = (a + b).powf(-0.125);
        viscous * (1.0 + (turbulent / laminar).powi(12)).powf(1.0 / 12.0)
    }
}

/// Channels of all cells.
#[derive(Clone, Debug)]
pub struct OpenWater {
    grid: SeepageGrid,
    /// Openness of each cell, 0 to 1.
    open: Vec<f64>,
    /// Fraction of each cell that no stationary solid fills.
    free: Vec<f64>,
    /// Boundaries of open water at the lower and the upper face of each cell along each axis.
    faces: Vec<[[Face; 2]; 3]>,
    /// Length over which the void of a cell extends along each axis \[m\]; empty as long as no cell is open, as are the
    /// losses and channels.
    lengths: Vec<[f64; 3]>,
    /// Inertial loss of a void along each axis over `rho u^2` \[1/m\], and the degree to which both its ends are
    /// those of a stream.
    losses: Vec<[(f64, f64); 3]>,
    /// Channels along each axis.
    ducts: Vec<[Duct; 3]>,
    /// Length that no void exceeds \[m\], used in place of an infinite one.
    longest: f64,
}

impl OpenWater {
    /// Returns open water on a grid. `faces` returns the boundary of each boundary cell, below and above along each
    /// axis.
    #[must_use]
    pub fn new(grid: SeepageGrid, faces: impl Fn(usize, usize, bool) -> Face) -> Self {
        let n = grid.count();
        let extent = (0..grid.dimension).map(|a| grid.axis(a).length(0, grid.cells[a]));
        let longest = extent.fold(0.0, |sum: f64, length| sum + length);
        let of_cell =
            |cell: usize| std::array::from_fn(|a| [false, true].map(|upper| faces(cell, a, upper)));
        Self {
            grid,
            open: vec![0.0; n],
            free: vec![1.0; n],
            faces: (0..n).map(of_cell).collect(),
            lengths: Vec::new(),
            losses: Vec::new(),
            ducts: Vec::new(),
            longest,
        }
    }

    /// Returns the openness of a cell.
    #[must_use]
    pub fn open(&self, cell: usize) -> f64 {
        self.open[cell]
    }

    /// Returns the channel along an axis at an open cell.
    #[must_use]
    pub fn duct(&self, cell: usize, axis: usize) -> Duct {
        self.ducts[cell][axis]
    }

    /// Measures the channels. `cell` returns the openness of a cell and the fraction of it that no solid fills.
    /// Returns `true` if any cell is open.
    pub fn measure(&mut self, openness: &Openness, cell: impl Fn(usize) -> (f64, f64)) -> bool {
        let mut any = false;
        for at in 0..self.open.len() {
            (self.open[at], self.free[at]) = cell(at);
            let cell = at;
            any |= self.open[cell] > 0.0;
        }
        if !any {
            return false;
        }
        let cells = self.open.len();
        self.lengths.resize(cells, [0.0; 3]);
        self.losses.resize(cells, [(0.0, 0.0); 3]);
        let longest = Duct::new(self.longest, self.longest);
        self.ducts.resize(cells, [longest; 3]);
        for axis in 0..self.grid.dimension {
            self.measure_lengths(openness, axis);
        }
        for cell in 0..self.open.len() {
            if self.open[cell] <= 0.0 {
                continue;
            }
            let lengths = self.lengths[cell];
            let edge = |a: usize| {
                if a < self.grid.dimension {
                    lengths[a]
                } else {
                    f64::INFINITY
                }
            };
            for axis in 0..self.grid.dimension {
                let (a, b) = (edge((axis + 1) % 3), edge((axis + 2) % 3));
                // If both edges are infinite, no wall is next to the water; walls that the water flows towards are
                // as far away as the void is long.
                let longest = self.longest.min(lengths[axis]);
                let (a, b) = if a.min(b) > self.longest {
                    (longest, b)
                } else {
                    (a, b)
                };
                let (inertia, stream) = self.losses[cell][axis];
                self.ducts[cell][axis] = Duct {
                    inertia,
                    stream,
                    ..Duct::new(a, b)
                };
            }
        }
        true
    }

    /// Measures the extent of the void of each cell along an axis, row by row.
    fn measure_lengths(&mut self, openness: &Openness, axis: usize) {
        let grid = &self.grid;
        let step = |i: usize| grid.axis(axis).width(i);
        let (others, n) = ([(axis + 1) % 3, (axis + 2) % 3], grid.cells[axis]);
        let mut row = vec![0; n];
        // Lengths below and above each cell of a row, and the degrees to which the void is open to the two ends of
        // the row.
        let mut reach = [vec![0.0; n], vec![0.0; n]];
        let mut way = [vec![0.0; n], vec![0.0; n]];
        for j in 0..grid.cells[others[0]] {
            for k in 0..grid.cells[others[1]] {
                for (i, at) in row.iter_mut().enumerate() {
                    let mut cell = [0; 3];
                    (cell[axis], cell[others[0]], cell[others[1]]) = (i, j, k);
                    *at = grid.index(cell);
                }
                if row.iter().all(|at| self.open[*at] <= 0.0) {
                    continue;
                }
                // Openness of the face below cell i of the row: 1 or 0.
                let passes = |i: usize| {
                    let mut cell = grid.cell(row[i.min(n - 1)]);
                    cell[axis] = i;
                    f64::from(u8::from(
                        openness.faces[axis][openness.face(axis, cell)] > 0.5,
                    ))
                };
                for i in 0..n {
                    let before = if i == 0 {
                        (0.0, passes(0))
                    } else {
                        let o = passes(i) * self.open[row[i - 1]];
                        (o * (step(i - 1) + reach[0][i - 1]), o * way[0][i - 1])
                    };
                    (reach[0][i], way[0][i]) = before;
                }
                for i in (0..n).rev() {
                    let beyond = if i + 1 == n {
                        (0.0, passes(n))
                    } else {
                        let o = passes(i + 1) * self.open[row[i + 1]];
                        (o * (step(i + 1) + reach[1][i + 1]), o * way[1][i + 1])
                    };
                    (reach[1][i], way[1][i]) = beyond;
                }
                let ends = [self.faces[row[0]][axis][0], self.faces[row[n - 1]][axis][1]];
                for i in 0..n {
                    let at = row[i];
                    let own = self.free[at] * step(i);
                    let length = own + reach[0][i] + reach[1][i];
                    let to =
                        |end: usize, face: Face| if ends[end] == face { way[end][i] } else { 0.0 };
                    let imposed = |end: usize| to(end, Face::Reservoir) + to(end, Face::Stream);
                    let mirrored = imposed(0).max(imposed(1));
                    let unstated = to(0, Face::Unstated) * to(1, Face::Unstated);
                    let both = imposed(0) * imposed(1);
                    let stream = to(0, Face::Stream) * to(1, Face::Stream);
                    let endless = unstated.max(both);
                    self.lengths[at][axis] = length * (1.0 + mirrored) / (1.0 - endless);
                    let inertia = (CLOSED_LOSS + (OPEN_LOSS - CLOSED_LOSS) * both) / length;
                    self.losses[at][axis] = (inertia, stream);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Enclosure;

    const WATER: Liquid = Liquid {
        density: 1000.0,
        viscosity: 1e-3,
    };

    /// Checks against Shah and London 1978, table 42: friction factor times Reynolds number of rectangular ducts,
    /// Fanning.
    #[test]
    fn laminar_ducts_have_the_published_friction() {
        for (aspect, fanning) in [
            (1.0, 14.22708),
            (0.5, 15.54806),
            (0.25, 18.23278),
            (0.1, 21.16888),
            (0.0, 24.0),
        ] {
            let b = if aspect > 0.0 {
                1.0 / aspect
            } else {
                f64::INFINITY
            };
            let duct = Duct::new(1.0, b);
            let found = 2.0 * duct.diameter * duct.diameter / duct.laminar / 4.0;
            assert!(
                (found / fanning - 1.0_f64).abs() < 1e-4,
                "{aspect}: {found}"
            );
        }
    }

    /// Checks against Colebrook's equation for a smooth and for a rough pipe, and laminar flow below its end.
    #[test]
    fn turbulent_ducts_have_the_friction_of_colebrook() {
        // A circular pipe of 0.1 m.
        let pipe = Duct {
            diameter: 0.1,
            laminar: 0.01 / 32.0,
            inertia: 0.0,
            stream: 0.0,
        };
        let friction = |reynolds: f64, rough: f64| {
            let u = reynolds * 1e-6 / 0.1;
            pipe.resistance(WATER, rough * 0.1, u) * u * 0.2 / (1000.0 * u * u)
        };
        assert!((friction(1000.0, 0.0) / 0.064 - 1.0).abs() < 1e-3);
        for reynolds in [1e4, 1e5, 1e6] {
            for rough in [0.0, 1e-3, 3e-2] {
                let mut f: f64 = 0.02;
                for _ in 0..100 {
                    f = (-2.0 * (rough / 3.7 + 2.51 / (reynolds * f.sqrt())).log10()).powi(-2);
                }
                let found = friction(reynolds, rough);
                assert!(
                    (found / f - 1.0).abs() < 0.035,
                    "{reynolds} {rough}: {found} {f}"
                );
            }
        }
    }

    fn grid(dimension: usize) -> SeepageGrid {
        SeepageGrid {
            cells: [6, 5, if dimension == 3 { 4 } else { 1 }],
            origin: [0.0; 3],
            spacing: [0.01, 0.01, if dimension == 3 { 0.01 } else { 1.0 }],
            dimension,
            ..SeepageGrid::default()
        }
    }

    #[test]
    fn a_slot_between_soil_is_plane_and_a_pipe_is_square() {
        for dimension in [2, 3] {
            let grid = grid(dimension);
            let openness = Openness::measure(&grid, &Enclosure::Everything);
            let mut water = OpenWater::new(grid.clone(), |_, _, _| Face::Unstated);
            // Two layers of open water.
            let open = |cell: usize| {
                (
                    f64::from(u8::from((2..4).contains(&grid.cell(cell)[1]))),
                    1.0,
                )
            };
            assert!(water.measure(&openness, open));
            let slot = water.duct(grid.index([3, 2, 0]), 0);
            assert!(
                (slot.laminar / (4e-4 / 12.0) - 1.0).abs() < 1e-12,
                "{slot:?}"
            );
            assert!((slot.diameter / 0.04 - 1.0).abs() < 1e-12);
        }
        let grid = grid(3);
        let openness = Openness::measure(&grid, &Enclosure::Everything);
        let mut water = OpenWater::new(grid.clone(), |_, _, _| Face::Unstated);
        let inside = |cell: usize| {
            let [_, y, z] = grid.cell(cell);
            (f64::from(u8::from(y == 2 && z == 2)), 1.0)
        };
        assert!(water.measure(&openness, inside));
        let pipe = water.duct(grid.index([0, 2, 2]), 0);
        assert!((pipe.laminar / laminar(0.01, 0.01) - 1.0).abs() < 1e-12);
        // Without open water nothing is measured.
        assert!(!water.measure(&openness, |_| (0.0, 1.0)));
    }

    #[test]
    fn faces_of_the_grid_bound_a_void_as_the_case_states() {
        let grid = grid(2);
        let openness = Openness::measure(&grid, &Enclosure::Everything);
        let top = |cell: usize| (f64::from(u8::from(grid.cell(cell)[1] == 4)), 1.0);
        let height = |face: Face| {
            let mut water = OpenWater::new(grid.clone(), |_, axis, upper| {
                if axis == 1 && upper {
                    face
                } else {
                    Face::Unstated
                }
            });
            water.measure(&openness, top);
            water.lengths[grid.index([3, 4, 0])][1]
        };
        assert!((height(Face::Wall) - 0.01).abs() < 1e-12);
        assert!((height(Face::Unstated) - 0.01).abs() < 1e-12);
        assert!((height(Face::Stream) - 0.02).abs() < 1e-12);
    }

    #[test]
    fn lengths_are_continuous_in_the_openness() {
        let grid = grid(2);
        let openness = Openness::measure(&grid, &Enclosure::Everything);
        let length = |o: f64| {
            let mut water = OpenWater::new(grid.clone(), |_, _, _| Face::Wall);
            water.measure(&openness, |cell| match grid.cell(cell)[1] {
                2 => (1.0, 1.0),
                3 => (o, 1.0),
                _ => (0.0, 1.0),
            });
            water.lengths[grid.index([3, 2, 0])][1]
        };
        assert!((length(0.0) - 0.01).abs() < 1e-15 && (length(1.0) - 0.02).abs() < 1e-15);
        assert!((length(0.3) - 0.013).abs() < 1e-15);
        assert!((super::openness(0.05), super::openness(0.2)) == (1.0, 0.0));
    }
}
