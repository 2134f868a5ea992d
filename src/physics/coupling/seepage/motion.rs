//! The grains of each cell as a bed that moves with its water: see the module above for the equations.

use super::{Seepage, Settings, components};
use crate::darcy::porosity::measure;
use crate::darcy::{BedMotion, Moving};
use crate::dem::particles::{Kind, View};
use crate::dem::space::Space;

/// Porosity up to which the water goes with the grains of a cell, and from which it does not.
const DENSE: f64 = 0.95;
const DILUTE: f64 = 0.98;
/// The grains of each cell as a bed that moves.
pub(super) struct Motion {
    pub(super) means: BedMotion,
    /// Gradient at the last coupling \[Pa/m\].
    pub(super) last: Vec<[f64; 3]>,
    /// Velocity of the bed without a gradient \[m/s\].
    pub(super) velocity: Vec<[f64; 3]>,
    /// What a gradient takes from it [m2/(Pa s)].
    pub(super) response: Vec<f64>,
    /// How much of a change of velocity until the next coupling counts, 0 to 1.
    pub(super) part: Vec<f64>,
}

impl Motion {
    pub(super) fn new(cells: usize) -> Self {
        Self {
            means: BedMotion::new(cells),
            last: vec![[0.0; 3]; cells],
            velocity: vec![[0.0; 3]; cells],
            response: vec![0.0; cells],
            part: vec![0.0; cells],
        }
    }

    /// The bed for the permeabilities of a round, over an interval \[s\].
    pub(super) fn respond(
        &mut self,
        permeability: &[f64],
        porosity: &[f64],
        viscosity: f64,
        interval: f64,
    ) {
        for (cell, k) in permeability.iter().enumerate() {
            let solid = 1.0 - porosity[cell].min(1.0);
            let lightness = self.means.lightness()[cell];
            // Without grains, or with grains that nothing moves, there is nothing to respond.
            let whole = if lightness > 0.0 && solid > 0.0 {
                interval * lightness / solid
            } else {
                0.0
            };
            let own = k / viscosity;
            let part = if whole > own { 1.0 - own / whole } else { 0.0 };
            let carried = ((DILUTE - porosity[cell]) / (DILUTE - DENSE)).clamp(0.0, 1.0);
            self.response[cell] = carried * part * whole;
            self.part[cell] = carried * part;
            let (velocity, gain) = (self.means.velocity()[cell], self.means.gain()[cell]);
            let last = self.last[cell];
            self.velocity[cell] = std::array::from_fn(|a| {
                carried * (velocity[a] + part * (gain[a] + whole * last[a]))
            });
        }
    }

    /// Velocity of the bed under a gradient \[m/s\].
    pub(super) fn under(&self, cell: usize, gradient: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.velocity[cell][a] - self.response[cell] * gradient[a])
    }
}

impl<Sp: Space> Seepage<Sp> {
    /// At the first coupling, what the gradient of a bed at rest will take from the velocity of each grain that contacts hold until the
    /// next one \[m/s\]; empty at all others.
    pub(super) fn held(&self, particles: &View<'_, Sp>) -> Vec<[f64; 3]> {
        if self.motion.is_none() || self.has_before {
            return Vec::new();
        }
        let interval = self.settings.interval;
        let mut held = vec![[0.0; 3]; particles.owned];
        for (k, parts) in self.parts.each() {
            if !matches!(start(particles, k), Start::Held) {
                continue;
            }
            let lightness = moving(&self.settings, particles, k).lightness;
            for &(cell, part) in parts {
                let solid = (1.0 - self.pores.porosity()[cell]).max(f64::MIN_POSITIVE);
                let kept = part * interval * lightness / solid;
                for (held, g) in held[k].iter_mut().zip(self.gradient[cell]) {
                    *held += kept * g;
                }
            }
        }
        held
    }
}

pub(super) fn add(sum: &mut [f64; 3], more: Option<&[f64; 3]>) {
    for (sum, more) in sum.iter_mut().zip(more.unwrap_or(&[0.0; 3])) {
        *sum += more;
    }
}

fn is_zero(vector: [f64; 3]) -> bool {
    vector.iter().all(|x| x.abs() <= 0.0)
}

/// What is known of a grain before a coupling.
pub(super) enum Start {
    /// It has met no water yet, and contacts hold it.
    Held,
    /// It has met no water yet, and nothing touches it.
    Free,
    /// Its load and its velocity at the last coupling are known.
    Known,
}

pub(super) fn start<Sp: Space>(particles: &View<'_, Sp>, k: usize) -> Start {
    if !is_zero(components(&particles.fluid[k].force)) {
        Start::Known
    } else if is_zero(components(&particles.contact[k].force)) {
        Start::Free
    } else {
        Start::Held
    }
}

/// A grain as the motion of the bed counts it.
pub(super) fn moving<Sp: Space>(settings: &Settings, particles: &View<'_, Sp>, k: usize) -> Moving {
    let body = &particles.body[k];
    let velocity = components(&particles.motion[k].velocity);
    if body.kind != Kind::Free {
        return Moving {
            velocity,
            ..Moving::default()
        };
    }
    let lightness = measure(Sp::DIMENSION, body.radius) / body.mass;
    let last = components(&particles.last_velocity[k]);
    let falls = settings.interval * (1.0 - lightness * settings.liquid.density);
    Moving {
        velocity,
        gain: std::array::from_fn(|a| match start(particles, k) {
            Start::Held => 0.0,
            Start::Free => falls * settings.gravity[a],
            Start::Known => velocity[a] - last[a],
        }),
        lightness,
    }
}
