//! Waiting until grains stand still.
//!
//! The measure is the largest resultant force on any free grain over the largest contact force: both are maxima, so that it is the
//! same on any number of ranks.

use super::particles::Particles;
use super::ranks::Ranks;
use super::space::{Components, Space};
use super::{Dem, Kind};
use crate::error::Error;

/// When to stop waiting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxation {
    /// Stop where the largest resultant is below this part of the largest contact force.
    pub tolerance: f64,
    /// Non-viscous damping meanwhile: 0.7 to 0.8 is usual.
    pub local_damping: f64,
    /// Steps between looks.
    pub look_every: u64,
    /// Stop after so many steps at the latest.
    pub limit: u64,
}

impl Default for Relaxation {
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            local_damping: 0.7,
            look_every: 100,
            limit: 100_000,
        }
    }
}

/// How still the grains are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stillness {
    /// Steps waited.
    pub steps: u64,
    /// Largest resultant force on a free grain (N).
    pub resultant: f64,
    /// Largest spring force of a contact (N), pushing or pulling.
    pub contact: f64,
    /// Speed of the fastest grain (m/s).
    pub speed: f64,
}

impl Stillness {
    /// Largest resultant over largest contact force; 0 without any force.
    #[must_use]
    pub fn unbalanced(&self) -> f64 {
        if self.resultant > 0.0 {
            self.resultant / self.contact
        } else {
            0.0
        }
    }
}

/// An unbalanced force for a line of text: a share of the contact forces, which means nothing where there are none.
#[must_use]
pub fn unbalanced_text(share: f64) -> String {
    if share.is_finite() && share < f64::MAX {
        format!("{share:.1e}")
    } else {
        "- (no contacts)".into()
    }
}

impl<S: Space> Dem<S> {
    /// How still the grains are. Collective.
    ///
    /// # Errors
    /// Where a message failed.
    pub fn stillness(
        &self,
        particles: &Particles<S>,
        ranks: &dyn Ranks,
    ) -> Result<Stillness, Error> {
        let gravity = self.settings().gravity;
        let mut now = Stillness::default();
        for k in (0..particles.owned()).filter(|&k| particles.body[k].kind == Kind::Free) {
            let total = particles.contact[k].force
                + particles.fluid_load(k).force
                + gravity * particles.body[k].mass;
            now.resultant = now.resultant.max(total.length());
            now.speed = now.speed.max(particles.motion[k].velocity.length());
        }
        self.for_each_contact(particles, |contact| {
            now.contact = now.contact.max(contact.normal_force.abs());
        });
        now.resultant = ranks.maximum(now.resultant)?;
        now.contact = ranks.maximum(now.contact)?;
        now.speed = ranks.maximum(now.speed)?;
        Ok(now)
    }

    /// Steps with damping until the grains stand still. The damping is set back; the steps count. Collective.
    ///
    /// # Errors
    /// As [`Dem::advance`].
    pub fn relax(
        &mut self,
        particles: &mut Particles<S>,
        ranks: &dyn Ranks,
        until: &Relaxation,
    ) -> Result<Stillness, Error> {
        let damping = self.settings().local_damping;
        self.set_local_damping(until.local_damping);
        let mut steps = 0;
        let outcome = loop {
            let batch = until.look_every.max(1).min(until.limit - steps);
            if let Err(error) = self.advance_many(particles, ranks, batch) {
                break Err(error);
            }
            steps += batch;
            match self.stillness(particles, ranks) {
                Ok(now) if steps < until.limit && now.unbalanced() > until.tolerance => {}
                Ok(now) => break Ok(Stillness { steps, ..now }),
                Err(error) => break Err(error),
            }
        };
        self.set_local_damping(damping);
        outcome
    }
}

#[cfg(test)]
mod tests {
    use super::unbalanced_text;

    #[test]
    fn an_unbalanced_force_without_contacts_is_no_number() {
        assert_eq!(unbalanced_text(0.0123), "1.2e-2");
        for none in [f64::MAX, f64::INFINITY, f64::NAN] {
            assert_eq!(unbalanced_text(none), "- (no contacts)");
        }
    }
}
