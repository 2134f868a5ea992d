//! Bodies of a contact law. The lists, ghosts and histories of the engine are those of spheres; a law for other
//! bodies defines here how they move, which pairs of nearby spheres may touch, and how forces are computed. The
//! defaults are those of spheres.

use super::Engine;
use super::facets::AtFacets;
use super::pairs::{Pair, WallPair};
use crate::contact::ContactLaw;
use crate::integrate::{self, Fastest, Kick, Phase};
use crate::particles::{Particles, SPHERE};
use crate::polyhedron::Narrow;
use crate::space::Space;
use crate::walls::Wall;
use crate::{Contact, DemSettings};
use base::error::Error;

/// Contact law together with the treatment of its bodies: see the module.
pub(crate) trait Bodies<S: Space>: ContactLaw<S> + 'static {
    /// Buffers for the computation of forces.
    type Scratch: std::fmt::Debug + Default + Send + Sync;

    /// Minimum number of owned bodies per thread.
    const PER_THREAD: usize = 300;

    /// `true` if forces are computed by parts ([`super::parts`]).
    const IN_PARTS: bool = true;

    /// Returns the engine of the law.
    fn engine(law: Self, settings: DemSettings<S>, walls: Vec<Wall<S>>) -> Engine<S, Self> {
        Engine::new(law, settings, walls)
    }

    /// Refuses bodies that the law does not support.
    fn check(particles: &mut Particles<S>) -> Result<(), Error> {
        let shapes = particles.shape.iter();
        match shapes
            .zip(&particles.body)
            .find(|(shape, _)| **shape != SPHERE)
        {
            None => Ok(()),
            Some((_, body)) => Err(Error::Internal(format!(
                "body {} is a block, but the contact law is for spheres",
                body.id
            ))),
        }
    }

    /// Moves all owned bodies; returns the speed of the fastest point of any body.
    fn advance(
        &self,
        particles: &mut Particles<S>,
        kick: &Kick<S>,
        phase: Phase,
        parallel: bool,
    ) -> Fastest {
        integrate::advance(particles, kick, phase, parallel)
    }

    /// Computes for every entry, at its present position, the data needed by [`Self::near`] and the forces.
    fn pose(_: &mut Self::Scratch, _: &Particles<S>, _parallel: bool) {}

    /// Returns `true` if the gap of a pair, with the second centre `between` \[m\] from the first, may be at most
    /// `gap` \[m\]; called only if that holds for their enclosing spheres.
    #[inline(always)]
    fn near(_: &Self::Scratch, _: (usize, usize), _between: &S::Vector, _gap: f64) -> bool {
        true
    }

    /// Distributes the work of new lists over threads.
    fn distribute_work(engine: &mut Engine<S, Self>, particles: &Particles<S>) {
        engine.cut_into_parts(particles);
    }

    /// Computes the contact loads of all owned bodies; returns the largest speed if it also moved them in `phase`.
    fn forces(
        engine: &mut Engine<S, Self>,
        particles: &mut Particles<S>,
        dt: f64,
        phase: Option<(&Kick<S>, Phase)>,
    ) -> Option<Fastest> {
        engine.sphere_forces(particles, dt, phase)
    }

    /// Returns the contact of a listed pair, or none.
    fn contact(
        engine: &Engine<S, Self>,
        particles: &Particles<S>,
        pair: &Pair<Self::Scale, Self::History>,
        _: &mut Narrow,
    ) -> Option<Contact<S>> {
        engine.sphere_contact(particles, pair)
    }

    /// Returns the contact of a listed pair of a body and a plane, or none.
    fn plane_contact(
        engine: &Engine<S, Self>,
        particles: &Particles<S>,
        pair: &WallPair<Self::Constants, Self::History>,
        _: &mut Narrow,
    ) -> Option<Contact<S>> {
        engine.sphere_plane_contact(particles, pair)
    }

    /// Calls `visit` with the contacts of a listed pair of a body and a wall of facets.
    fn facet_contacts(
        engine: &Engine<S, Self>,
        particles: &Particles<S>,
        at: AtFacets<'_, Self::Constants, Self::History>,
        _: &mut Narrow,
        visit: &mut impl FnMut(Contact<S>),
    ) {
        engine.sphere_facet_contacts(particles, at, visit);
    }

    /// Bonds every present contact; returns the number reported by this rank.
    fn bond_all(engine: &mut Engine<S, Self>, particles: &Particles<S>) -> u64 {
        engine.bond(particles)
    }
}
