//! Porous zones: cells with a linear and a quadratic resistance to the water (Darcy and Forchheimer).
//!
//! ```text
//! -∇p = ρ (ν/K + β |u|) u
//! ```
//!
//! u is the superficial velocity (discharge per area), K the permeability and β the inertial coefficient. Inertia and
//! viscosity of the water in the zone are those of open water, as usual for screens, racks, filters and rockfill in
//! resolved flow.
//!
//! In lattice units the force on a cell of density ρ is D = -ρ (a + b |u|) u with a = ν Δt/K and b = β h,
//! multiplied by φ if the zone fills the fraction φ of the cell. The velocity contains half of every force,
//! u = (m + (G + D)/2)/ρ with the momentum m that comes in and the body force G, so that D is known without iteration
//! (Guo and Zhao 2002, equations 15 to 17):
//!
//! ```text
//! u = 2 v/(c + (c² + 2 b |v|)^½),   v = (m + G/2)/ρ,   c = 1 + a/2
//! ```
//!
//! D enters before the collision by the exact difference of two equilibria (Kupershtokh et al. 2009), g_i +=
//! g_i^eq(v + D/ρ) - g_i^eq(v), whatever the collision operator. A plug flow in equilibrium, G = -D, is constant up
//! to rounding. The rule is the trapezoidal one: stable for every a, without oscillations up to a + b |u| = 2.
//!
//! The eddy viscosity uses velocities without D/2, so that its gradients at the surface of a zone have an error of
//! (a + b |u|)/2 of the velocity there. The plan therefore requires shorter steps in zones of flows with an eddy
//! viscosity.
//!
//! Sources: Z. Guo, T. S. Zhao, Phys. Rev. E 66 (2002) 036304; A. L. Kupershtokh, D. A. Medvedev, D. I. Karpov, Comput.
//! Math. Appl. 58 (2009) 965; S. Ergun, Chem. Eng. Prog. 48 (1952) 89.

use super::Term;
use crate::initial::equilibrium;
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::quanta::quanta;
use crate::saturation::Cover;
use base::thread_pool;
use base::vector::norm;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Minimum number of cells per thread.
const CELLS_PER_THREAD: usize = 256;

/// Resistance of a porous zone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Resistance {
    /// Darcy-Forchheimer law with given coefficients: -∇p = ρ (ν/K + β |u|) u. At least one of the two coefficients
    /// is required.
    DarcyForchheimer {
        /// Permeability K \[m2\]. Default: no linear part.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0))]
        permeability: Option<f64>,
        /// Inertial coefficient β [1/m]: a screen with a loss coefficient k and a thickness L has β = k/(2 L).
        /// Default: 0.
        #[serde(default)]
        #[schemars(extend("minimum" = 0))]
        inertial_coefficient: f64,
    },
    /// Packed bed of grains (Ergun 1952): K = ε³ d²/(150 (1 - ε)²), β = 1.75 (1 - ε)/(ε³ d).
    Ergun {
        /// Diameter of the grains d \[m\].
        #[schemars(extend("exclusiveMinimum" = 0))]
        grain_diameter: f64,
        /// Porosity ε \[1\].
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        porosity: f64,
    },
}

/// Coefficients of a resistance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Coefficients {
    /// Linear coefficient ν/K [1/s].
    pub linear: f64,
    /// Quadratic coefficient β [1/m].
    pub quadratic: f64,
}

impl Resistance {
    /// Returns the coefficients in a fluid of kinematic viscosity ν [m2/s].
    #[must_use]
    pub fn coefficients(&self, viscosity: f64) -> Coefficients {
        match *self {
            Self::DarcyForchheimer {
                permeability,
                inertial_coefficient,
            } => Coefficients {
                linear: permeability.map_or(0.0, |permeability| viscosity / permeability),
                quadratic: inertial_coefficient,
            },
            Self::Ergun {
                grain_diameter: d,
                porosity: e,
            } => {
                let solid = (1.0 - e) / (e * e * e * d);
                Coefficients {
                    linear: 150.0 * viscosity * (1.0 - e) * solid / d,
                    quadratic: 1.75 * solid,
                }
            }
        }
    }
}

impl Coefficients {
    /// Returns the deceleration [m/s2] at a superficial velocity [m/s].
    #[must_use]
    pub fn deceleration(&self, velocity: f64) -> f64 {
        (self.linear + self.quadratic * velocity) * velocity
    }

    /// Returns the superficial velocity [m/s] at which the resistance equals a deceleration [m/s2]; infinite
    /// without resistance.
    #[must_use]
    pub fn velocity(&self, deceleration: f64) -> f64 {
        let root = (self.linear * self.linear + 4.0 * self.quadratic * deceleration).sqrt();
        2.0 * deceleration / (self.linear + root)
    }
}

/// Cell of a zone in lattice units: its coordinates in the domain and the coefficients a and b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resisted {
    /// Indices of the cell in the domain.
    pub cell: [usize; 3],
    /// Linear coefficient a \[1\].
    pub linear: f64,
    /// Quadratic coefficient b \[1\].
    pub quadratic: f64,
}

/// Cell of the slab with a resistance.
#[derive(Clone, Copy, Debug)]
struct Cell {
    position: usize,
    linear: f64,
    quadratic: f64,
    /// Coefficients of the part free of solids.
    open: [f64; 2],
    /// Momentum that the cell received in the last step, in quanta.
    given: [i64; 3],
}

impl Cell {
    /// Returns the coefficients a and b of the part of the cell free of solids.
    fn coefficients(&self, cover: Option<&Cover>) -> [f64; 2] {
        let open = cover.map_or(1.0, |cover| 1.0 - cover.fraction(self.position));
        [open * self.linear, open * self.quadratic]
    }
}

/// Porous zones of a slab.
pub struct Porous {
    /// Cells in ascending order of position.
    cells: Vec<Cell>,
    /// Index in `cells` plus one for each position; 0 for open water.
    places: Vec<u32>,
}

impl Porous {
    /// Places the zones in the slab of `populations`, whose first cell is `start` in the domain. Cells of other
    /// slabs are omitted; no cell may occur twice.
    #[must_use]
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        start: [usize; 3],
        resisted: &[Resisted],
    ) -> Self {
        let size = populations.cells();
        let local = |cell: [usize; 3]| -> Option<[usize; 3]> {
            let mut at = [0; 3];
            for axis in 0..3 {
                at[axis] = cell[axis].checked_sub(start[axis])?;
                if at[axis] >= size[axis] {
                    return None;
                }
            }
            Some(at)
        };
        let mut cells: Vec<Cell> = resisted
            .iter()
            .filter_map(|resisted| {
                Some(Cell {
                    position: populations.interior_cell(local(resisted.cell)?),
                    linear: resisted.linear,
                    quadratic: resisted.quadratic,
                    open: [resisted.linear, resisted.quadratic],
                    given: [0; 3],
                })
            })
            .collect();
        cells.sort_unstable_by_key(|cell| cell.position);
        let mut places = vec![0; populations.cell_positions()];
        for (place, cell) in (1..).zip(&cells) {
            places[cell.position] = place;
        }
        Self { cells, places }
    }

    /// Returns the cell at a position; `None` for open water.
    fn resisted_cell(&self, position: usize) -> Option<&Cell> {
        let place = self.places[position].checked_sub(1)?;
        self.cells.get(place as usize)
    }
}

/// Returns the velocity u of a cell from v = (m + G/2)/ρ and the coefficients.
#[inline(always)]
fn resisted(v: [f64; 3], linear: f64, quadratic: f64) -> [f64; 3] {
    let speed = norm(v);
    let c = 1.0 + 0.5 * linear;
    let part = 2.0 / (c + (c * c + 2.0 * quadratic * speed).sqrt());
    v.map(|x| x * part)
}

/// Pointer to the populations, shared by threads.
struct Numbers<S>(*mut S);
// SAFETY: each thread accesses the incoming populations of its own cells, and each number is incoming in one cell.
unsafe impl<S: Send> Sync for Numbers<S> {}

impl<S: Stored> Term<S> for Porous {
    fn name(&self) -> &'static str {
        "porous zones"
    }

    fn act(&mut self, populations: &mut Populations<S>, half: [f64; 3], cover: Option<&Cover>) {
        if cover.is_some() {
            for cell in &mut self.cells {
                cell.open = cell.coefficients(cover);
            }
        }
        let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
        let numbers = &numbers;
        let populations = &*populations;
        let velocities = populations.velocities();
        let count = velocities.q();
        thread_pool::each_item(&mut self.cells, CELLS_PER_THREAD, |_, cell| {
            let [linear, quadratic] = cell.open;
            let mut g = [0.0; 27];
            let (mut drho, mut m) = (0.0, [0.0; 3]);
            for (i, g) in g.iter_mut().enumerate().take(count) {
                let position = populations.incoming(cell.position, i);
                // SAFETY: within the array, and of this cell alone.
                *g = unsafe { numbers.0.add(position).read() }.to_f64();
                drho += *g;
                for a in 0..3 {
                    m[a] += f64::from(velocities.c[i][a]) * *g;
                }
            }
            let rho = 1.0 + drho;
            let v: [f64; 3] = std::array::from_fn(|a| (m[a] + half[a]) / rho);
            let u = resisted(v, linear, quadratic);
            let speed = norm(u);
            let factor = linear + quadratic * speed;
            let after: [f64; 3] = std::array::from_fn(|a| v[a] - factor * u[a]);
            cell.given = std::array::from_fn(|a| quanta(-rho * factor * u[a]));
            for (i, g) in g.iter().enumerate().take(count) {
                let (w, c) = (velocities.w[i], velocities.c[i]);
                let change = equilibrium(w, c, drho, after) - equilibrium(w, c, drho, v);
                let position = populations.incoming(cell.position, i);
                // SAFETY: as above.
                unsafe { numbers.0.add(position).write(S::from_f64(g + change)) };
            }
        });
    }

    fn impulse(
        &self,
        populations: &Populations<S>,
        counts: &dyn Fn([usize; 3]) -> bool,
    ) -> [i128; 3] {
        let mut sum = [0; 3];
        for cell in &self.cells {
            let at = populations.coordinates(cell.position);
            if counts(at.map(isize::cast_unsigned)) {
                for a in 0..3 {
                    sum[a] += i128::from(cell.given[a]);
                }
            }
        }
        sum
    }

    fn changes_velocities(&self) -> bool {
        !self.cells.is_empty()
    }

    fn velocity(&self, position: usize, v: [f64; 3], cover: Option<&Cover>) -> [f64; 3] {
        let Some(cell) = self.resisted_cell(position) else {
            return v;
        };
        let [linear, quadratic] = cell.coefficients(cover);
        resisted(v, linear, quadratic)
    }

    fn of_momentum(&self, position: usize, u: [f64; 3], cover: Option<&Cover>) -> [f64; 3] {
        let Some(cell) = self.resisted_cell(position) else {
            return u;
        };
        let [linear, quadratic] = cell.coefficients(cover);
        let speed = norm(u);
        u.map(|u| u * (1.0 + 0.5 * (linear + quadratic * speed)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::Operator;
    use crate::collision::{bgk, cumulant, mrt, trt};
    use crate::fluid::{Fluid, Force, Models, Setup};
    use crate::lattice::VelocitySet;
    use approx::{assert_abs_diff_eq, assert_relative_eq};
    use base::number::real;
    use decomposition::{Domain, SplitAxis};

    /// Returns a periodic fluid, with walls normal to y if `walls`, and with the same resistance in every cell.
    fn fluid(
        (set, operator): (VelocitySet, Operator),
        cells: [usize; 3],
        walls: bool,
        (linear, quadratic): (f64, f64),
        force: [f64; 3],
    ) -> Fluid<f64> {
        let mut resisted = Vec::new();
        for z in 0..cells[2] {
            for y in 0..cells[1] {
                for x in 0..cells[0] {
                    resisted.push(Resisted {
                        cell: [x, y, z],
                        linear,
                        quadratic,
                    });
                }
            }
        }
        let make: super::super::TermBuilder<f64> = Box::new(move |populations, start| {
            Box::new(Porous::new(populations, start, &resisted))
        });
        let setup = Setup {
            force: Force::Constant(force),
            periodic: [true, !walls, true],
            terms: vec![make],
            ..Setup::new(Models::new(set, operator), 0.7, cells)
        };
        Fluid::new(setup, &Domain::serial(SplitAxis::X, cells[0], true)).unwrap()
    }

    fn operators() -> Vec<(VelocitySet, Operator)> {
        use VelocitySet::{D2Q9, D3Q19, D3Q27};
        let trt = Operator::Trt(trt::TrtParameters::default());
        vec![
            (D2Q9, Operator::Bgk(bgk::BgkParameters::default())),
            (D2Q9, trt),
            (D3Q19, trt),
            (D3Q27, Operator::Mrt(mrt::MrtParameters::default())),
            (
                D3Q27,
                Operator::Cumulant(cumulant::CumulantParameters::default()),
            ),
        ]
    }

    #[test]
    fn plug_flow_at_the_balance_stays_and_is_reached() {
        let (linear, quadratic) = (0.01, 0.8);
        let speed = 0.05;
        // The flow is oblique to the lattice.
        for (set, operator) in operators() {
            let flat = set == VelocitySet::D2Q9;
            let n = if flat {
                [0.6, 0.8, 0.0]
            } else {
                [0.48, 0.6, 0.64]
            };
            let u = n.map(|n| n * speed);
            let force = u.map(|u| (linear + quadratic * speed) * u);
            let cells = if flat { [5, 4, 1] } else { [5, 4, 3] };
            let mut fluid = fluid((set, operator), cells, false, (linear, quadratic), force);
            let middle = fluid.populations().cell([1, 2, 0]);
            fluid.initialise(&|_: [f64; 3]| (0.0, u));
            for _ in 0..50 {
                fluid.advance();
            }
            let kept = fluid.state(middle).1;
            fluid.initialise(&|_: [f64; 3]| (0.0, [0.0; 3]));
            for _ in 0..2000 {
                fluid.advance();
            }
            let reached = fluid.state(middle).1;
            for a in 0..3 {
                assert_abs_diff_eq!(kept[a], u[a], epsilon = 1e-15);
                assert_abs_diff_eq!(reached[a], u[a], epsilon = 1e-14);
            }
        }
    }

    /// Checks Brinkman's flow between plates, u = G/a (1 - cosh(k y)/cosh(k H/2)) with k² = a/ν: the error decreases
    /// with the square of the cell size.
    #[test]
    fn flow_between_plates_follows_brinkman_to_second_order() {
        let trt = (
            VelocitySet::D2Q9,
            Operator::Trt(trt::TrtParameters::default()),
        );
        let viscosity = 0.2 / 3.0;
        let error = |n: usize| {
            let height = real(n);
            // The grids have the same k H = 6 and the same maximum velocity.
            let linear = viscosity * (6.0 / height).powi(2);
            let force = [0.01 * linear, 0.0, 0.0];
            let mut fluid = fluid(trt, [1, n, 1], true, (linear, 0.0), force);
            fluid.initialise(&|_: [f64; 3]| (0.0, [0.0; 3]));
            for _ in 0..40 * n * n {
                fluid.advance();
            }
            let errors = (0..n).map(|y| {
                let place = (real(y) + 0.5) / height - 0.5;
                let exact = 0.01 * (1.0 - (6.0 * place).cosh() / 3.0_f64.cosh());
                let found = fluid.state(fluid.populations().interior_cell([0, y, 0])).1[0];
                (found - exact).abs() / 0.01
            });
            errors.fold(0.0, f64::max)
        };
        let [coarse, fine] = [16, 32].map(error);
        assert!(coarse < 5e-3, "{coarse}");
        assert_relative_eq!(coarse / fine, 4.0, max_relative = 0.15);
    }

    #[test]
    fn a_packed_bed_has_the_pressure_drop_of_ergun() {
        let bed = Resistance::Ergun {
            grain_diameter: 2e-3,
            porosity: 0.4,
        };
        // Water through beads of 2 mm at 1 cm/s: 150 mu (1-e)² U/(e³ d²) + 1.75 (1-e) rho U²/(e³ d) = 2109.4 +
        // 820.3 Pa/m.
        let drop = 1000.0 * bed.coefficients(1e-6).deceleration(0.01);
        assert_relative_eq!(drop, 2109.375 + 820.3125, max_relative = 1e-12);
        let back = bed.coefficients(1e-6).velocity(drop / 1000.0);
        assert_relative_eq!(back, 0.01, max_relative = 1e-12);
    }
}
