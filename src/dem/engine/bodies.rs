//! The bodies of a contact law. The engine's lists, ghosts and histories are those of spheres; a law of other bodies
//! defines here how they move, which pairs of near spheres may touch, and how forces are computed. The defaults are
//! those of spheres.

use super::super::Contact;
use super::super::particles::SPHERE;
use super::super::polyhedron::Narrow;
use super::*;

/// A law together with what its bodies are: see the module.
pub(crate) trait Bodies<S: Space>: ContactLaw<S> + 'static {
    /// Buffers of the forces.
    type Scratch: std::fmt::Debug + Default + Send + Sync;

    /// Own bodies per thread from which threads pay.
    const PER_THREAD: usize = 300;

    /// `true` if forces are computed by parts ([`super::parts`]).
    const IN_PARTS: bool = true;

    /// Returns the engine of the law.
    ///
    /// # Errors
    /// If the law has no such dimension.
    fn engine(
        law: Self,
        settings: DemSettings<S>,
        walls: Vec<Wall<S>>,
    ) -> Result<Engine<S, Self>, Error> {
        Ok(Engine::new(law, settings, walls))
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
                "body {} is a block, under a contact law of spheres",
                body.id
            ))),
        }
    }

    /// Moves all owned bodies. The speed is that of the fastest point of any body.
    fn advance(
        &self,
        particles: &mut Particles<S>,
        kick: &Kick<S>,
        phase: Phase,
        parallel: bool,
    ) -> Fastest {
        integrate::advance(particles, kick, phase, parallel)
    }

    /// Computes the data of every entry at its present position that [`Self::near`] and the forces need.
    fn pose(_: &mut Self::Scratch, _: &Particles<S>, _parallel: bool) {}

    /// Returns `true` if a pair, the second centre `between` (m) from the first's, may be within `gap` (m); called only
    /// if their spheres are.
    #[inline(always)]
    fn near(_: &Self::Scratch, _: (usize, usize), _between: &S::Vector, _gap: f64) -> bool {
        true
    }

    /// Shares the work of new lists out to threads.
    fn share_out(engine: &mut Engine<S, Self>, particles: &Particles<S>) {
        engine.cut_into_parts(particles);
    }

    /// Returns the contact loads of all owned bodies. Returns the fastest body where it has moved them in `phase` too.
    fn forces(
        engine: &mut Engine<S, Self>,
        particles: &mut Particles<S>,
        dt: f64,
        phase: Option<(&Kick<S>, Phase)>,
    ) -> Option<Fastest> {
        engine.sphere_forces(particles, dt, phase)
    }

    /// Returns a listed pair as a contact, where it is one.
    fn contact(
        engine: &Engine<S, Self>,
        particles: &Particles<S>,
        pair: &Pair<Self::Scale, Self::History>,
        _: &mut Narrow,
    ) -> Option<Contact<S>> {
        engine.sphere_contact(particles, pair)
    }

    /// Returns a listed pair of a body and a plane as a contact, where it is one.
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

    /// Bonds every contact that exists now; how many this rank reports.
    fn bond_all(engine: &mut Engine<S, Self>, particles: &Particles<S>) -> u64 {
        engine.bond(particles)
    }
}
