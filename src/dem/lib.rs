//! Discrete elements: grains and blocks, their contacts, forces and motion.
//!
//! [`Particles`] holds the grains of a rank. [`Dem`] holds the contacts: the law, the walls, the lists and the
//! histories. One call of [`Dem::advance`] is one solid step:
//!
//! ```text
//! half kick, drift  ->  ghosts (or, when due, migration and new lists)  ->  contact forces  ->  half kick
//! ```
//!
//! The code is generic over [`Space`]: discs, spheres and blocks share the engine. It is compiled once for each contact
//! law. The bits of a result do not depend on the number of ranks and threads, on when lists are built, or on
//! restarts.
//!
//! | file | content |
//! |---|---|
//! | `space` | two and three dimensions |
//! | `particles` | the list of arrays of a grain, and their store |
//! | `columns`, `table`, `message` | generated code: struct of arrays, columns of a checkpoint, bytes of a message |
//! | `region` | the box |
//! | `census` | counts and radii of the grains of all ranks; agreement on an error |
//! | `ghosts`, `ghost_plan` | copies of grains on other ranks; their messages |
//! | `blocks` | shapes and orientations of the blocks among the grains |
//! | `buckets` | counting sort by threads |
//! | `neighbors` | candidate pairs |
//! | `contact` | contact laws, one file each, with their parameters in a case and their limits |
//! | `walls`, `surface` | planes, polygons, triangulated surfaces |
//! | `servo` | plane walls whose mean normal stress follows a stress that is given |
//! | `integrate` | velocity Verlet |
//! | `polyhedron` | convex polyhedra: shape, contact, force and rotation, for one body or one pair |
//! | `engine` | the step, the lists, the ownership and migration of grains and histories |
//! | `dashpot` | the normal dashpot of a contact over time steps |
//! | `deepest` | the deepest contact of all steps |
//! | `relax` | unbalanced force |
//! | `clusters` | grains that contacts connect to something stationary |
//! | `escape` | a grain that left the box |
//! | `state` | contacts as named columns |

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

mod blocks;
mod buckets;
mod census;
mod clusters;
mod columns;
pub mod contact;
mod dashpot;
pub mod deepest;
mod engine;
pub mod escape;
mod ghost_plan;
mod ghosts;
pub mod instances;
mod integrate;
mod message;
mod neighbors;
pub mod particles;
pub mod polyhedron;
mod region;
pub mod relax;
pub mod servo;
pub mod space;
pub mod state;
pub mod surface;
mod table;
pub mod walls;

pub use blocks::BlockMotion;
pub use contact::{Failure, Law, PairProperties, PairTable};
pub use deepest::Deepest;
pub use neighbors::Search;
pub use particles::{Body, EXTRA, Kind, Load, Motion, Particles, ParticlesView};
pub use region::GrainDomain;
pub use relax::{EquilibriumState, Relaxation};
pub use servo::Servo;
pub use space::{Components, PlaneSpace, Space, Volume};
pub use surface::FacetSurface;
pub use walls::Wall;

use contact::family::Family;
use engine::{AnyEngine, MakeEngine};

use base::error::Error;
use decomposition::{Domain, SplitAxis};

/// Returns a domain of one rank that owns all grains; needs no MPI.
#[must_use]
pub fn alone() -> Domain {
    Domain::serial(SplitAxis::X, 1, false)
}

/// Parameters of the step and of the lists.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DemSettings<S: Space> {
    /// Box of the grains, and planes along which ranks divide it.
    pub region: GrainDomain<S>,
    /// Solid time step \[s\].
    pub time_step: f64,
    /// Gravity [m/s²].
    pub gravity: S::Vector,
    /// Non-viscous damping, 0 (none) to below 1.
    pub local_damping: f64,
    /// Largest gap between surfaces of listed pairs \[m\]. A larger skin makes lists longer and their rebuilds less
    /// frequent. No result depends on it.
    pub skin: f64,
    /// Distance beyond a slab within which grains are ghosts for reasons other than contacts, added to the radius
    /// \[m\].
    pub ghost_margin: f64,
}

impl<S: Space> DemSettings<S> {
    /// Returns settings without gravity, damping and ghost margin.
    #[must_use]
    pub fn new(region: GrainDomain<S>, time_step: f64, skin: f64) -> Self {
        Self {
            region,
            time_step,
            gravity: S::Vector::default(),
            local_damping: 0.0,
            skin,
            ghost_margin: 0.0,
        }
    }
}

/// Failed bond. Exactly one rank reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BondBreak<S: Space> {
    /// Number of solid steps done, including this one.
    pub step: u64,
    /// Time \[s\] at the end of the step.
    pub time: f64,
    /// Id of the grain, the lower of the two.
    pub grain: u64,
    /// Id of the other grain; none at a wall.
    pub other: Option<u64>,
    /// Index of the wall; none between grains.
    pub wall: Option<u32>,
    /// Contact point \[m\].
    pub position: S::Vector,
    /// Mode of failure: tension or shear.
    pub mode: Failure,
    /// Magnitude of the force of the fluid on `grain` \[N\].
    pub fluid_force: f64,
}

/// Present state of a contact, of a bond or of a capillary bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<S: Space> {
    /// Entry of the first grain, which has the lower id and is owned by this rank.
    pub grain: usize,
    /// Entry of the other grain; none at a wall.
    pub other: Option<usize>,
    /// Index of the wall; none between grains.
    pub wall: Option<u32>,
    /// Overlap \[m\], negative for a bond in tension and a bridge across a gap.
    pub overlap: f64,
    /// Unit normal from the first grain to the second, or from the wall to the grain.
    pub normal: S::Vector,
    /// Contact point \[m\].
    pub position: S::Vector,
    /// Force of the normal spring less that of the bridge \[N\], positive in compression.
    pub normal_force: f64,
    /// Force of the shear spring on the second grain, or at a wall on the grain \[N\]; zero for contacts of
    /// polyhedra.
    pub shear_force: S::Vector,
    /// `true` if the contact is bonded.
    pub bonded: bool,
    /// Attraction of the capillary bridge \[N\]; 0 without one.
    pub bridge: f64,
}

impl<S: Space> Contact<S> {
    /// Returns `true` if the surfaces overlap or are bonded: a bridge across a gap is no contact.
    #[must_use]
    pub fn touches(&self) -> bool {
        self.overlap > 0.0 || self.bonded
    }
}

/// Counts on one rank; sums over ranks count each item once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Number of owned grains.
    pub owned: u64,
    /// Number of ghosts.
    pub ghosts: u64,
    /// Number of pairs in the lists.
    pub listed: u64,
    /// Number of pairs tested in each step.
    pub active: u64,
    /// Number of contacts, including those with walls.
    pub contacts: u64,
    /// Number of contacts with a bond.
    pub bonds: u64,
    /// Number of capillary bridges, at contacts and across gaps.
    pub bridges: u64,
    /// Largest overlap divided by the smaller diameter.
    pub largest_overlap: f64,
    /// Number of times that lists were built.
    pub rebuilds: u64,
    /// Number of pairs tested since the beginning.
    pub tested: u64,
}

/// Contacts, walls and lists of one rank.
#[derive(Debug)]
pub struct Dem<S: Space> {
    engine: Box<dyn AnyEngine<S>>,
}

impl<S: Space> Dem<S> {
    /// Returns a solver for contacts under `law` between grains, and with `walls`.
    ///
    /// # Errors
    /// If time step, skin or damping is out of range, a wall is normal to a periodic axis, or the law of blocks is
    /// used in 2-D.
    #[inline(never)]
    pub fn new(law: Law, settings: DemSettings<S>, walls: Vec<Wall<S>>) -> Result<Self, Error> {
        Self::of_family(&law, settings, walls)
    }

    /// Returns a solver with a law of any family.
    fn of_family(
        law: &impl Family,
        settings: DemSettings<S>,
        walls: Vec<Wall<S>>,
    ) -> Result<Self, Error> {
        let refuse = |what: String| Err(Error::Numerical(what));
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !positive(settings.time_step) {
            return refuse(format!(
                "the solid time step is {} s; it must be above 0",
                settings.time_step
            ));
        }
        if !positive(settings.skin) {
            return refuse(format!(
                "the neighbour skin is {} m; it must be above 0",
                settings.skin
            ));
        }
        if !(0.0..1.0).contains(&settings.local_damping) {
            return refuse(format!(
                "the local damping is {}; it must be at least 0 and below 1",
                settings.local_damping
            ));
        }
        for axis in (0..S::DIMENSION).filter(|&axis| settings.region.periodic[axis]) {
            if walls.iter().any(|wall| wall.normal.get(axis).abs() > 0.0) {
                return refuse(format!("a wall lies across the periodic axis {axis}"));
            }
        }
        let (lower, lengths) = (settings.region.origin(), settings.region.periodic_lengths());
        let mut surfaces = walls.iter().filter_map(|wall| wall.surface.as_ref());
        if !surfaces.all(|surface| surface.repeats_by(lower, lengths)) {
            return refuse("a wall of facets does not repeat with the periodic domain".into());
        }
        log::info!(
            "contacts: solid time step {:.3e} s, skin {:.3e} m, local damping {}, {} walls",
            settings.time_step,
            settings.skin,
            settings.local_damping,
            walls.len()
        );
        let engine = law.visit(MakeEngine { settings, walls })?;
        Ok(Self { engine })
    }

    /// Makes one solid step. Collective.
    ///
    /// # Errors
    /// If a grain was lost or its motion is not finite (all ranks get the error), or a message fails.
    pub fn advance(&mut self, particles: &mut Particles<S>, domain: &Domain) -> Result<(), Error> {
        self.advance_many(particles, domain, 1)
    }

    /// Makes `steps` solid steps with constant loads of the fluid, with the same bits as that many calls of
    /// [`Self::advance`]. Collective.
    ///
    /// # Errors
    /// If [`Self::advance`] fails.
    pub fn advance_many(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        steps: u64,
    ) -> Result<(), Error> {
        self.engine.advance(particles, domain, steps)
    }

    /// Computes the contact loads of a step in which the caller moves the bodies together with the water in joints: the
    /// loads half a step ahead, constant over the step. Histories of contacts advance by the step; no body moves.
    /// Collective.
    ///
    /// # Errors
    /// Those of [`Self::advance`].
    pub fn loads_ahead(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<(), Error> {
        self.engine.loads_ahead(particles, domain)
    }

    /// Ends a step in which the caller moved the bodies, on this rank by at most `path` \[m\]. Collective.
    ///
    /// # Errors
    /// Those of [`Self::advance`].
    pub fn carried(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        path: f64,
    ) -> Result<(), Error> {
        self.engine.carried(particles, domain, path)
    }

    /// Updates migration, ghosts and lists for grains that were added, removed or changed, and contact loads that are
    /// not known yet. Every step begins with this; callers that need ghosts before the next step call it themselves.
    /// Collective.
    ///
    /// # Errors
    /// If [`Self::advance`] fails.
    pub fn prepare(&mut self, particles: &mut Particles<S>, domain: &Domain) -> Result<(), Error> {
        self.engine.prepare(particles, domain)
    }

    /// Bonds all present contacts, including those with walls; the contact-bond law also bonds pairs within its
    /// bonding gap. Bonds that break later do not heal. Returns the number of bonds that this rank reports.
    /// Collective.
    ///
    /// # Errors
    /// If [`Self::advance`] fails.
    pub fn bond_existing_contacts(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<u64, Error> {
        self.prepare(particles, domain)?;
        Ok(self.engine.bond_all(particles))
    }

    /// Returns the bonds reported by this rank that failed since the last call.
    pub fn take_breaks(&mut self) -> Vec<BondBreak<S>> {
        self.engine.take_breaks()
    }

    /// Visits every contact reported by this rank: those whose lower id it owns, and those of its grains with
    /// walls.
    pub fn for_each_contact(&self, particles: &Particles<S>, mut visit: impl FnMut(Contact<S>)) {
        self.engine.for_each_contact(particles, &mut visit);
    }

    /// Returns the present counts of this rank.
    #[must_use]
    pub fn statistics(&self, particles: &Particles<S>) -> Statistics {
        self.engine.statistics(particles)
    }

    /// Returns the deepest contact of any solid step so far, on this rank.
    #[must_use]
    pub fn deepest(&self) -> Deepest {
        self.engine.deepest()
    }

    /// Resets the deepest contact.
    pub fn forget_deepest(&mut self) {
        self.engine.forget_deepest();
    }

    /// Returns the number of solid steps done.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.engine.steps()
    }

    /// Returns the number of solid steps done times the time step \[s\].
    #[must_use]
    pub fn time(&self) -> f64 {
        self.engine.time()
    }

    /// Returns the settings.
    #[must_use]
    pub fn settings(&self) -> &DemSettings<S> {
        self.engine.settings()
    }

    /// Sets the non-viscous damping, 0 (none) to below 1; other values are clamped.
    pub fn set_local_damping(&mut self, damping: f64) {
        let damping = damping.clamp(0.0, 1.0 - f64::EPSILON);
        self.engine.settings_mut().local_damping = damping;
    }

    /// Returns the present walls.
    #[must_use]
    pub fn walls(&self) -> &[Wall<S>] {
        self.engine.walls()
    }

    /// Deactivates walls, given by their indices, with their contacts and bonds. Must be called with the same walls on
    /// all ranks.
    pub fn open_walls(&mut self, walls: &[usize]) {
        self.engine.open_walls(walls);
    }

    /// Activates walls, given by their indices, without contacts. Must be called with the same walls on all ranks.
    pub fn close_walls(&mut self, walls: &[usize]) {
        self.engine.close_walls(walls);
    }

    /// Sets the controls of the servo walls, the same on all ranks; an empty list removes them.
    pub fn set_servos(&mut self, servos: Vec<Servo<S>>) {
        *self.engine.servos_mut() = servos;
    }

    /// Sets the stress \[Pa\] that a control must reach, the same on all ranks; `place` is the index of the control in
    /// the list.
    pub fn set_servo_stress(&mut self, place: usize, stress: f64) {
        if let Some(servo) = self.engine.servos_mut().get_mut(place) {
            servo.stress = stress;
        }
    }
}

#[cfg(test)]
mod tests;
