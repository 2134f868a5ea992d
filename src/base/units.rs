//! Conversion between SI and lattice units.
//!
//! On the lattice the spacing h, the time step dt and the density at rest rho_0 are 1. Every other scale follows:
//! velocity C = h/dt, pressure rho_0 C², kinematic viscosity h C. In 2-D forces are per metre of depth, so that the
//! unit of force is rho_0 h³/dt² [N/m]; in 3-D it is rho_0 h⁴/dt² \[N\]. The same holds for torque, with one more
//! power of h.

use serde::Serialize;

/// Scales of the conversion between SI and lattice units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LatticeUnits {
    /// Edge of a cell h \[m\].
    pub spacing: f64,
    /// Time step dt \[s\].
    pub time_step: f64,
    /// Density at rest rho_0 [kg/m3].
    pub density: f64,
    /// Number of dimensions, 2 or 3: forces and torques are per metre of depth in 2-D.
    pub dimension: usize,
}

impl LatticeUnits {
    /// Square of the speed of sound in lattice units.
    pub const SOUND_SPEED_SQUARED: f64 = 1.0 / 3.0;

    /// Returns the velocity scale C = h/dt [m/s].
    #[must_use]
    pub fn velocity_scale(&self) -> f64 {
        self.spacing / self.time_step
    }

    /// Returns the speed of sound C/√3 [m/s].
    #[must_use]
    pub fn speed_of_sound(&self) -> f64 {
        self.velocity_scale() * Self::SOUND_SPEED_SQUARED.sqrt()
    }

    /// Converts the velocity [m/s] to the lattice.
    #[must_use]
    pub fn velocity_to_lattice(&self, velocity: f64) -> f64 {
        velocity / self.velocity_scale()
    }

    /// Converts the velocity on the lattice to m/s.
    #[must_use]
    pub fn velocity_to_si(&self, velocity: f64) -> f64 {
        velocity * self.velocity_scale()
    }

    /// Converts the length \[m\] to cells.
    #[must_use]
    pub fn length_to_lattice(&self, length: f64) -> f64 {
        length / self.spacing
    }

    /// Converts the time \[s\] to fluid steps (not rounded).
    #[must_use]
    pub fn time_to_lattice(&self, time: f64) -> f64 {
        time / self.time_step
    }

    /// Converts a rotation rate [rad/s] to rad per fluid step.
    #[must_use]
    pub fn angular_velocity_to_lattice(&self, rate: f64) -> f64 {
        rate * self.time_step
    }

    /// Converts the kinematic viscosity [m2/s] to the lattice.
    #[must_use]
    pub fn viscosity_to_lattice(&self, viscosity: f64) -> f64 {
        viscosity / (self.spacing * self.velocity_scale())
    }

    /// Converts the kinematic viscosity on the lattice to m2/s.
    #[must_use]
    pub fn viscosity_to_si(&self, viscosity: f64) -> f64 {
        viscosity * (self.spacing * self.velocity_scale())
    }

    /// Returns the relaxation time tau = 3 nu + 1/2 for a kinematic viscosity [m2/s].
    #[must_use]
    pub fn relaxation_time(&self, viscosity: f64) -> f64 {
        self.viscosity_to_lattice(viscosity) / Self::SOUND_SPEED_SQUARED + 0.5
    }

    /// Returns the time step \[s\] that gives the relaxation time `tau` to the viscosity [m2/s] on the spacing \[m\].
    #[must_use]
    pub fn time_step_for(tau: f64, spacing: f64, viscosity: f64) -> f64 {
        (tau - 0.5) * Self::SOUND_SPEED_SQUARED * spacing * spacing / viscosity
    }

    /// Returns the scale of pressure and stress, rho_0 C² \[Pa\].
    #[must_use]
    pub fn pressure_scale(&self) -> f64 {
        self.density * self.velocity_scale().powi(2)
    }

    /// Converts the pressure above the reference \[Pa\] to the density deviation rho/rho_0 - 1 on the lattice: p =
    /// c_s² rho.
    #[must_use]
    pub fn pressure_to_density_deviation(&self, pressure: f64) -> f64 {
        pressure / (self.pressure_scale() * Self::SOUND_SPEED_SQUARED)
    }

    /// Converts the density deviation on the lattice to the pressure above the reference \[Pa\].
    #[must_use]
    pub fn density_deviation_to_pressure(&self, deviation: f64) -> f64 {
        deviation * self.pressure_scale() * Self::SOUND_SPEED_SQUARED
    }

    /// Returns the density [kg/m3] for a deviation rho/rho_0 - 1.
    #[must_use]
    pub fn density_deviation_to_density(&self, deviation: f64) -> f64 {
        self.density * (1.0 + deviation)
    }

    /// Converts the stress on the lattice to Pa.
    #[must_use]
    pub fn stress_to_si(&self, stress: f64) -> f64 {
        stress * self.pressure_scale()
    }

    /// Converts the rate of strain or vorticity per fluid step to 1/s.
    #[must_use]
    pub fn rate_to_si(&self, rate: f64) -> f64 {
        rate / self.time_step
    }

    /// Converts the acceleration [m/s2] to the lattice.
    #[must_use]
    pub fn acceleration_to_lattice(&self, acceleration: f64) -> f64 {
        acceleration * self.time_step / self.velocity_scale()
    }

    /// Converts the force per volume [N/m3] to the lattice, where it acts on a cell of unit volume and mass.
    #[must_use]
    pub fn force_density_to_lattice(&self, force: f64) -> f64 {
        self.acceleration_to_lattice(force / self.density)
    }

    /// Returns the unit of force: N in 3-D, N/m in 2-D (h²/dt times a momentum density).
    #[must_use]
    pub fn force_scale(&self) -> f64 {
        self.pressure_scale() * self.area_scale()
    }

    /// Converts the force on the lattice to N (2-D: N per metre of depth).
    #[must_use]
    pub fn force_to_si(&self, force: f64) -> f64 {
        force * self.force_scale()
    }

    /// Converts the force \[N\] (2-D: per metre of depth) to the lattice.
    #[must_use]
    pub fn force_to_lattice(&self, force: f64) -> f64 {
        force / self.force_scale()
    }

    /// Converts the torque on the lattice, arms in cells, to N m (2-D: per metre of depth).
    #[must_use]
    pub fn torque_to_si(&self, torque: f64) -> f64 {
        torque * self.force_scale() * self.spacing
    }

    /// Converts the torque \[N m\] (2-D: per metre of depth) to the lattice.
    #[must_use]
    pub fn torque_to_lattice(&self, torque: f64) -> f64 {
        torque / (self.force_scale() * self.spacing)
    }

    /// Returns the mass of a cell of fluid at the reference density \[kg\] (2-D: per metre of depth).
    #[must_use]
    pub fn mass_scale(&self) -> f64 {
        self.density * self.area_scale() * self.spacing
    }

    /// Returns the area of a cell face: h² in 3-D, h in 2-D.
    fn area_scale(&self) -> f64 {
        if self.dimension == 2 {
            self.spacing
        } else {
            self.spacing * self.spacing
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Returns the units of the piping paper: h = 2e-5 m, tau = 1.1, water.
    fn piping() -> LatticeUnits {
        LatticeUnits {
            spacing: 2e-5,
            time_step: LatticeUnits::time_step_for(1.1, 2e-5, 1e-6),
            density: 1000.0,
            dimension: 2,
        }
    }

    #[test]
    fn tau_of_the_piping_paper_gives_viscosity_one_fifth() {
        let units = piping();
        assert_relative_eq!(units.viscosity_to_lattice(1e-6), 0.2, max_relative = 1e-12);
        assert_relative_eq!(units.relaxation_time(1e-6), 1.1, max_relative = 1e-12);
        assert_relative_eq!(units.time_step, 8e-5, max_relative = 1e-12);
        assert_relative_eq!(units.velocity_scale(), 0.25, max_relative = 1e-12);
    }

    #[test]
    fn a_pressure_is_its_density_deviation_times_the_sound_speed_squared() {
        let units = piping();
        let deviation = units.pressure_to_density_deviation(0.3);
        assert_relative_eq!(
            deviation * 1000.0 * units.speed_of_sound().powi(2),
            0.3,
            max_relative = 1e-12
        );
        assert_relative_eq!(
            units.density_deviation_to_pressure(deviation),
            0.3,
            max_relative = 1e-12
        );
    }

    #[test]
    fn forces_are_pressures_times_areas_in_both_dimensions() {
        let flat = piping();
        let solid = LatticeUnits {
            dimension: 3,
            ..flat
        };
        let pressure = flat.stress_to_si(0.01);
        assert_relative_eq!(
            flat.force_to_si(0.01),
            pressure * 2e-5,
            max_relative = 1e-12
        );
        assert_relative_eq!(
            solid.force_to_si(0.01),
            pressure * 4e-10,
            max_relative = 1e-12
        );
        assert_relative_eq!(
            flat.torque_to_si(1.0),
            flat.force_scale() * 2e-5,
            max_relative = 1e-12
        );
        assert_relative_eq!(
            solid.force_to_lattice(solid.force_to_si(0.7)),
            0.7,
            max_relative = 1e-12
        );
        assert_relative_eq!(
            solid.torque_to_lattice(solid.torque_to_si(0.7)),
            0.7,
            max_relative = 1e-12
        );
    }

    #[test]
    fn mass_times_acceleration_is_force_on_the_lattice_too() {
        for dimension in [2, 3] {
            let units = LatticeUnits {
                dimension,
                ..piping()
            };
            let (mass, acceleration) = (3.0, 9.81);
            let lattice = (mass / units.mass_scale()) * units.acceleration_to_lattice(acceleration);
            assert_relative_eq!(
                units.force_to_si(lattice),
                mass * acceleration,
                max_relative = 1e-12
            );
        }
    }
}
