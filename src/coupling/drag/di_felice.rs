//! Drag of Di Felice (C-14; E-16 … E-18).
//!
//! ```text
//! f = C_d rho A |U| U eps^-chi / 2,   chi = 3.7 - 0.65 exp[-(1.5 - log10 Re)^2/2],   Re = rho d |U|/mu
//! ```
//!
//! with the drag coefficient of [`super::dallavalle`], the projected area A and the superficial velocity U of the water past the
//! grain (R. Di Felice, Int. J. Multiphase Flow 20 (1994) 153). The fissure paper puts in the interstitial velocity.

use super::dallavalle;
use super::{Bed, Grain};

/// The exponent chi.
#[must_use]
pub fn exponent(reynolds: f64) -> f64 {
    let x = 1.5 - reynolds.max(f64::MIN_POSITIVE).log10();
    3.7 - 0.65 * (-0.5 * x * x).exp()
}

/// Force over velocity \[kg/s\] at speed `speed` \[m/s\].
#[must_use]
pub fn coefficient(bed: &Bed, grain: &Grain, speed: f64) -> f64 {
    let reynolds = bed.density * grain.diameter * speed / bed.viscosity;
    dallavalle::coefficient(bed, grain, speed) * bed.porosity.powf(-exponent(reynolds))
}
