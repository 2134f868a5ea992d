//! Drag of Ergun in dense, of Wen and Yu in dilute beds, as joined by Gidaspow.
//!
//! ```text
//! f = V b (u - v)/(1 - eps),   u - v = U/eps
//! eps < 0.8:  b = 150 (1 - eps)^2 mu/(eps d^2) + 1.75 (1 - eps) rho |u - v|/d
//! else:       b = 3/4 C_d (1 - eps) rho eps |u - v| eps^-2.65/d
//!             C_d = 24/Re (1 + 0.15 Re^0.687), 0.44 from Re = 1000;  Re = rho eps |u - v| d/mu
//! ```
//!
//! (S. Ergun, Chem. Eng. Prog. 48 (1952) 89; C. Y. Wen and Y. H. Yu 1966; D. Gidaspow, Multiphase Flow and Fluidization, 1994.)
//! The pressure gradient acts on grains and water alike, so that a bed at rest has Ergun's loss of pressure.

use super::{Bed, Grain};

/// Force over superficial velocity \[kg/s\] at superficial speed `speed` \[m/s\].
#[must_use]
pub fn coefficient(bed: &Bed, grain: &Grain, speed: f64) -> f64 {
    let (eps, d) = (bed.porosity, grain.diameter);
    let share = if eps < 0.8 {
        150.0 * (1.0 - eps) * bed.viscosity / (eps * d * d) + 1.75 * bed.density * speed / (eps * d)
    } else {
        let reynolds = bed.density * speed * d / bed.viscosity;
        // C_d times the speed, finite at rest.
        let drag = if reynolds < 1000.0 {
            24.0 * bed.viscosity / (bed.density * d) * (1.0 + 0.15 * reynolds.powf(0.687))
        } else {
            0.44 * speed
        };
        0.75 * drag * bed.density * eps.powf(-2.65) / d
    };
    grain.volume * share / eps
}
