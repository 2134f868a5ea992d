//! Unbalanced force: a measure of how far grains are from equilibrium.
//!
//! The measure is the largest resultant force on any free grain, divided by the largest contact force. Both are maxima,
//! so that the measure is the same on any number of ranks.

use super::particles::Particles;
use super::space::{Components, Space};
use super::{Dem, Kind};
use base::error::Error;
use decomposition::Domain;

/// Criteria for grains in equilibrium, and the damping used to reach it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxation {
    /// Largest resultant force in equilibrium, as a fraction of the largest contact force.
    pub tolerance: f64,
    /// Non-viscous damping during the relaxation, usually 0.7 to 0.8.
    pub local_damping: f64,
    /// Solid steps between two measurements.
    pub check_every: u64,
    /// Maximum number of solid steps.
    pub limit: u64,
}

impl Default for Relaxation {
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            local_damping: 0.7,
            check_every: 100,
            limit: 100_000,
        }
    }
}

/// Unbalanced force and speed of the grains.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EquilibriumState {
    /// Largest resultant force on a free grain \[N\].
    pub resultant: f64,
    /// Largest spring force of a contact \[N\], compressive or tensile.
    pub contact: f64,
    /// Largest speed of a grain [m/s].
    pub speed: f64,
}

impl EquilibriumState {
    /// Returns the largest resultant divided by the largest contact force; 0 without forces.
    #[must_use]
    pub fn unbalanced(&self) -> f64 {
        if self.resultant > 0.0 {
            self.resultant / self.contact
        } else {
            0.0
        }
    }
}

/// Returns an unbalanced force as text: a fraction of the contact forces, undefined without contacts.
#[must_use]
pub fn unbalanced_text(share: f64) -> String {
    if share.is_finite() && share < f64::MAX {
        format!("{share:.1e}")
    } else {
        "- (no contacts)".into()
    }
}

impl<S: Space> Dem<S> {
    /// Sets the strengths of all bonds, present and new, to a multiple of those of the law: 1 restores them, with the
    /// same bits for powers of two. Saved contacts hold the multiple, so that it must be 1 when they are saved.
    /// Collective.
    ///
    /// # Errors
    /// If [`Self::advance`] fails.
    pub fn set_bond_strength(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        factor: f64,
    ) -> Result<(), Error> {
        self.engine.set_bond_strength(particles, domain, factor)
    }

    /// Breaks the bonds whose springs exceed their strength at the present positions, without motion; returns their
    /// number on all ranks. If there are none, contacts and loads keep their bits. Collective.
    ///
    /// # Errors
    /// If [`Self::advance`] fails.
    pub fn break_overloaded(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<u64, Error> {
        self.engine.break_overloaded(particles, domain)
    }

    /// Measures the unbalanced force and the speed of the grains. Collective.
    #[must_use]
    pub fn equilibrium_state(&self, particles: &Particles<S>, domain: &Domain) -> EquilibriumState {
        let gravity = self.settings().gravity;
        let mut now = EquilibriumState::default();
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
        let most = |value| domain.communicator().all_reduce_max_f64(value);
        now.resultant = most(now.resultant);
        now.contact = most(now.contact);
        now.speed = most(now.speed);
        now
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
