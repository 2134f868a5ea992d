//! Density of water that contains air, and cavitation.
//!
//! The mixture has the volume fraction `x` of air at atmospheric pressure `P`. With the gauge pressure `p`, the
//! bulk modulus `K` of water and the exponent `n` of the air (1 isothermal, 1.4 adiabatic), its density relative to
//! that at `p = 0` is
//!
//! ```text
//! 1/r = x (P/(P + p))^(1/n) + (1 - x) (1 - p/K)
//! ```
//!
//! At `p = 0` waves have the speed `c² = 1/(rho (x/(n P) + (1 - x)/K))` with the density `rho = (1 - x) rho_w` of the
//! mixture (Wood, A Textbook of Sound, 1930): 1 % of air at 1 bar gives 101 m/s. The mass of the air is left out, and
//! air neither dissolves nor rises.
//!
//! Water carries no tension: below the vapour pressure, vapour fills part of the volume. There the density
//! decreases linearly to zero within [`VAPOUR`] pascals, so that mass is conserved and no pressure is lower than
//! the vapour pressure minus this number. This is the smooth form of the mass-conserving conditions of Jakobsson,
//! Floberg and Olsson (Elrod, J. Lubrication Technol. 103, 350 (1981)). The density is a concave function of the
//! pressure, for which Newton's method converges from any pressures where the friction is laminar: after one step
//! it rises to the solution.

/// Pressure range below the vapour pressure within which the density decreases to zero \[Pa\].
pub const VAPOUR: f64 = 100.0;

/// Mixture of water and air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixture {
    /// Density of the water without air [kg/m³].
    pub density: f64,
    /// Dynamic viscosity \[Pa s\].
    pub viscosity: f64,
    /// Bulk modulus of the water without air \[Pa\].
    pub bulk_modulus: f64,
    /// Volume fraction of air at atmospheric pressure.
    pub air: f64,
    /// Exponent of the compression of air: 1 isothermal, 1.4 adiabatic.
    pub exponent: f64,
    /// Atmospheric pressure \[Pa\], the reference of all pressures.
    pub atmosphere: f64,
    /// Absolute vapour pressure \[Pa\].
    pub vapour: f64,
}

impl Default for Mixture {
    /// Returns water at 20 °C without air.
    fn default() -> Self {
        Self {
            density: 998.2,
            viscosity: 1.002e-3,
            bulk_modulus: 2.18e9,
            air: 0.0,
            exponent: 1.0,
            atmosphere: 101_325.0,
            vapour: 2339.0,
        }
    }
}

impl Mixture {
    /// Returns the density of the mixture at atmospheric pressure [kg/m³].
    #[must_use]
    pub fn mixture_density(&self) -> f64 {
        (1.0 - self.air) * self.density
    }

    /// Returns the wave speed at a gauge pressure above the vapour pressure [m/s].
    #[must_use]
    pub fn wave_speed(&self, pressure: f64) -> f64 {
        let (_, slope) = self.compression(pressure);
        1.0 / (self.mixture_density() * slope).sqrt()
    }

    /// Returns the gauge pressure below which water turns into vapour \[Pa\].
    #[must_use]
    pub fn vapour_gauge(&self) -> f64 {
        self.vapour - self.atmosphere
    }

    /// Returns the density relative to that at atmospheric pressure, minus 1, and its derivative [1/Pa].
    #[must_use]
    pub fn compression(&self, pressure: f64) -> (f64, f64) {
        let boiling = self.vapour_gauge();
        if pressure >= boiling {
            return self.compression_of_liquid(pressure);
        }
        let (at_boiling, _) = self.compression_of_liquid(boiling);
        let slope = (1.0 + at_boiling) / VAPOUR;
        (at_boiling + slope * (pressure - boiling), slope)
    }

    fn compression_of_liquid(&self, pressure: f64) -> (f64, f64) {
        if self.air <= 0.0 {
            let volume = 1.0 - pressure / self.bulk_modulus;
            let slope = 1.0 / self.bulk_modulus / (volume * volume);
            return (pressure / self.bulk_modulus / volume, slope);
        }
        // Differences from 1 preserve the digits of small pressures.
        let gained = -(pressure / self.atmosphere).ln_1p() / self.exponent;
        let (air, water) = (self.air, 1.0 - self.air);
        let shrunk = water * pressure / self.bulk_modulus - air * gained.exp_m1();
        let volume = 1.0 - shrunk;
        let absolute = pressure + self.atmosphere;
        let slope = air * gained.exp() / (self.exponent * absolute) + water / self.bulk_modulus;
        (shrunk / volume, slope / (volume * volume))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wave speeds at 1 bar in water of 1000 kg/m³ and 2.2 GPa, from the formula in the module documentation.
    const SPEEDS: [(f64, f64); 8] = [
        (0.0, 1483.0),
        (1e-5, 1343.0),
        (1e-4, 829.2),
        (1e-3, 309.4),
        (1e-2, 100.3),
        (0.05, 45.9),
        (0.1, 33.3),
        (0.5, 20.0),
    ];

    #[test]
    fn the_speed_of_waves_follows_the_content_of_air() {
        for (air, speed) in SPEEDS {
            let water = Mixture {
                density: 1000.0,
                bulk_modulus: 2.2e9,
                air,
                atmosphere: 1e5,
                ..Mixture::default()
            };
            let mixture = water.wave_speed(0.0);
            // The numbers use the density of water without air, for up to a tenth of air.
            let plain = mixture * (1.0 - air).sqrt();
            let nearest = (mixture - speed).abs().min((plain - speed).abs());
            println!("air {air}: {mixture:.1} m/s, {plain:.1} with the density of water; {speed}");
            assert!(nearest < 6e-4 * speed + 0.05);
        }
    }

    #[test]
    fn density_and_slope_belong_together_and_vapour_bounds_the_pressure() {
        for air in [0.0, 0.02, 0.2] {
            let water = Mixture {
                air,
                ..Mixture::default()
            };
            assert_eq!(water.compression(0.0).0, 0.0);
            for pressure in [-99_300.0, -99_000.0, -50_000.0, 2e5] {
                let step = 0.5;
                let [low, high] = [-step, step].map(|d| water.compression(pressure + d).0);
                let (_, slope) = water.compression(pressure);
                let error = (high - low) / (2.0 * step) / slope - 1.0;
                assert!(error.abs() < 1e-3, "{error}");
            }
            let (boiling, _) = water.compression(water.vapour_gauge());
            let (opened, _) = water.compression(water.vapour_gauge() - 0.9 * VAPOUR);
            assert!(((1.0 + opened) / (1.0 + boiling) - 0.1).abs() < 1e-10);
        }
    }
}
