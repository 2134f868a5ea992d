//! Load of the water on grains in unsaturated ground, and the moisture around them.
//!
//! ```text
//! f = -S rho g + d [-grad(chi p) + S rho g]/(1 - eps),   chi = S_e      force per volume of grains
//! ```
//!
//! `sigma' = sigma + chi p` is the effective stress of Bishop, with air at pressure 0 and `p` negative under suction;
//! `chi` is the effective saturation (Lu et al.). Its divergence, the weight of the water that the pores hold, and the
//! buoyancy of the grains are this force: in saturated ground `-grad p` on the grains and the resistance of the pores,
//! in dry ground nothing. `d` is 1 in a bed and falls to 0 between the porosities 0.8 and 0.95: the buoyancy alone
//! acts on loose grains. The strength from suction is then `S_e s tan(phi)` for grains with the friction angle `phi`.
//!
//! `chi p` is 0 where the ground ends: at a boundary in contact with air, and at a face to a cell without grains.
//! There suction confines the grains like a stress on the surface. At a wall it continues with the weight of the
//! water. Capillary bridges, if grains have them, are the suction. The gradient of `chi` is then left out: `f = -S rho
//! g + d [-S_e grad p + S rho g]/(1 - eps)`.
//!
//! The water flows as in ground without grains ([`darcy::pressure::Pressure`] with a soil): permeability and retention
//! are those of the zones, and follow the grains where a zone says so ([`super::following`]). Grains that move through
//! the water meet no resistance of their own. Cells above the surface of the ground contain air: no water loads grains
//! there.
//!
//! Sources: A. W. Bishop, Teknisk Ukeblad 106 (1959) 859; N. Lu, J. W. Godt, D. T. Wu, Water Resour. Res. 46 (2010)
//! W05515, doi:10.1029/2009WR008646.

use super::{FILLED, Seepage, components};
use base::error::Error;
use dem::particles::{Load, Particles};
use dem::space::{Components, Space};

/// Porosity above which grains count as loose.
const LOOSE_POROSITY: f64 = 0.8;
/// Minimum solid fraction of a cell for its water to be distributed over its grains.
const MIN_SOLID: f64 = 1.0 - FILLED;

/// Returns the fraction of the load of a bed that acts at a porosity, divided by the solid fraction.
fn bed(porosity: f64) -> f64 {
    let part = ((FILLED - porosity) / (FILLED - LOOSE_POROSITY)).clamp(0.0, 1.0);
    part / (1.0 - porosity).max(MIN_SOLID)
}

/// Water of the cells of unsaturated ground.
#[derive(Debug, Default)]
pub(super) struct Moist {
    /// Pressure times Bishop's factor \[Pa\].
    stress: Vec<f64>,
    /// Force per volume of grains \[N/m³\].
    force: Vec<[f64; 3]>,
    /// Degree of saturation, and volume of water per volume of grains \[1\].
    moisture: Vec<[f64; 2]>,
}

impl<Sp: Space> Seepage<Sp> {
    /// Computes the water of unsaturated ground, and the load and moisture of each grain. Collective.
    ///
    /// # Errors
    /// If the flow does not converge, or a load is not finite.
    pub(super) fn wet(&mut self, particles: &mut Particles<Sp>) -> Result<(), Error> {
        particles.keep_moisture();
        self.solve_pressure(&particles.view())?;
        self.moisten();
        let (mut fastest, mut finite) = (0.0_f64, true);
        for (k, parts) in self.parts.each() {
            let (radius, mut force, mut moisture) = (particles.body[k].radius, [0.0; 3], [0.0; 2]);
            let volume = darcy::drag::GrainSize::new(Sp::DIMENSION, radius).volume;
            for &(cell, part) in parts {
                for (sum, own) in force.iter_mut().zip(self.moist.force[cell]) {
                    *sum += part * volume * own;
                }
                for (sum, own) in moisture.iter_mut().zip(self.moist.moisture[cell]) {
                    *sum += part * own;
                }
            }
            let mut load = Load::<Sp>::default();
            for (a, force) in force.into_iter().enumerate().take(Sp::DIMENSION) {
                load.force.set(a, force);
                finite &= force.is_finite();
            }
            particles.fluid[k] = load;
            particles.moisture[k] = moisture;
            let velocity = components(&particles.motion[k].velocity);
            fastest = fastest.max(velocity.iter().map(|v| v * v).sum());
        }
        self.keep_extremes(fastest.sqrt());
        let bad = self.communicator.all_reduce_sum_u64(u64::from(!finite));
        if bad > 0 {
            return Err(Error::Numerical(
                "the force of the water on the grains is not finite".into(),
            ));
        }
        Ok(())
    }

    /// Computes stresses, forces and moisture of all cells.
    fn moisten(&mut self) {
        let cells = self.grid().count();
        let (porosity, density) = (self.pores.porosity(), self.pressure.weight());
        let moist = &mut self.moist;
        moist.stress.resize(cells, 0.0);
        moist.force.resize(cells, [0.0; 3]);
        moist.moisture.resize(cells, [0.0; 2]);
        for cell in 0..cells {
            if !self.pressure.conducts(cell) {
                (moist.stress[cell], moist.moisture[cell]) = (0.0, [0.0; 2]);
                continue;
            }
            let pressure = self.pressure.pressure(cell);
            let [saturation, effective] = self.pressure.saturations(cell, pressure);
            moist.stress[cell] = effective * pressure;
            let solid = (1.0 - porosity[cell]).max(MIN_SOLID);
            moist.moisture[cell] = [saturation, saturation * porosity[cell] / solid];
        }
        for cell in 0..cells {
            let mut force = [0.0; 3];
            if self.pressure.conducts(cell) && self.pores.solid_volume(cell) > 0.0 {
                let bed = bed(porosity[cell]);
                let gradient = self.stress_gradient(cell);
                let saturation = self.moist.moisture[cell][0];
                for (a, force) in force.iter_mut().enumerate() {
                    let weight = saturation * density[a];
                    *force = (weight - gradient[a]) * bed - weight;
                }
            }
            self.moist.force[cell] = force;
        }
    }

    /// Returns the gradient of the pressure times Bishop's factor in a cell \[Pa/m\]; with bridges the factor times
    /// the gradient of the pressure.
    fn stress_gradient(&self, cell: usize) -> [f64; 3] {
        let (grid, weight) = (self.grid(), self.pressure.weight());
        let place = grid.cell(cell);
        if self.settings.bridges {
            let pressure = self.pressure.pressure(cell);
            let [_, effective] = self.pressure.saturations(cell, pressure);
            let reduced = self.pressure.inner_gradient(cell);
            return std::array::from_fn(|a| {
                if a < grid.dimension {
                    effective * (reduced[a] + weight[a])
                } else {
                    0.0
                }
            });
        }
        std::array::from_fn(|a| {
            if a >= grid.dimension {
                return 0.0;
            }
            let face = |upper: bool| {
                let ends = if upper {
                    place[a] + 1 == grid.cells[a]
                } else {
                    place[a] == 0
                };
                if ends {
                    return self.stress_at_end(cell, a, upper);
                }
                let mut next = place;
                next[a] = if upper { place[a] + 1 } else { place[a] - 1 };
                self.stress_between(cell, grid.index(next), (a, upper))
            };
            (face(true) - face(false)) / grid.spacing[a]
        })
    }

    /// Returns the stress at the face between two cells \[Pa\].
    fn stress_between(&self, cell: usize, next: usize, side: (usize, bool)) -> f64 {
        if self.openness.blocked(next) {
            return self.stress_at_wall(cell, side.0, side.1);
        }
        if !self.pressure.conducts(next) {
            return self.stress_at_end(cell, side.0, side.1);
        }
        let [own, other] = [self.moist.stress[cell], self.moist.stress[next]];
        if self.pores.porosity()[next] < FILLED {
            0.5 * (own + other)
        } else {
            // The surface of the grains: water under pressure passes, suction ends.
            0.5 * (own.max(0.0) + other.max(0.0))
        }
    }

    /// Returns the stress at a face of the grid, or at the surface of the ground \[Pa\].
    fn stress_at_end(&self, cell: usize, axis: usize, upper: bool) -> f64 {
        match self.pressure.outside(cell, axis, upper) {
            Some(pressure) => pressure * self.pressure.saturations(cell, pressure)[1],
            None => self.stress_at_wall(cell, axis, upper),
        }
    }

    /// Returns the stress at an impermeable wall \[Pa\].
    fn stress_at_wall(&self, cell: usize, axis: usize, upper: bool) -> f64 {
        let half = 0.5 * self.grid().spacing[axis];
        let rise = self.pressure.weight()[axis] * if upper { half } else { -half };
        let pressure = self.pressure.pressure(cell) + rise;
        pressure * self.pressure.saturations(cell, pressure)[1]
    }
}
