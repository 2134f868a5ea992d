//! Engine of a law that is selected when a run starts: dispatched once per step, outside of all loops.

use super::Engine;
use super::bodies::Bodies;
use crate::contact::family::Visitor;
use crate::deepest::Deepest;
use crate::particles::Particles;
use crate::servo::Servo;
use crate::space::Space;
use crate::state::{self, Contacts};
use crate::walls::Wall;
use crate::{BondBreak, Contact, DemSettings, Statistics};
use base::error::Error;
use decomposition::Domain;

/// Engine of any contact law.
pub(crate) trait AnyEngine<S: Space>: std::fmt::Debug + Send + Sync {
    /// Makes solid steps with constant loads of the fluid.
    fn advance(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        steps: u64,
    ) -> Result<(), Error>;
    /// Computes the contact loads of a step in which the caller moves the bodies.
    fn loads_ahead(&mut self, particles: &mut Particles<S>, domain: &Domain) -> Result<(), Error>;
    /// Records that the bodies were moved over a step by at most `path` \[m\].
    fn carried(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        path: f64,
    ) -> Result<(), Error>;
    /// Updates migration, ghosts, lists and loads for grains that changed.
    fn prepare(&mut self, particles: &mut Particles<S>, domain: &Domain) -> Result<(), Error>;
    /// Bonds every present contact; returns the number reported by this rank.
    fn bond_all(&mut self, particles: &Particles<S>) -> u64;
    /// Sets the strengths of all bonds to a multiple of those of the law.
    fn set_bond_strength(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        factor: f64,
    ) -> Result<(), Error>;
    /// Breaks the bonds that are overloaded at the present positions; returns their number on all ranks.
    fn break_overloaded(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<u64, Error>;
    /// Returns the bonds that failed since the last call.
    fn take_breaks(&mut self) -> Vec<BondBreak<S>>;
    /// Calls `visit` with every contact reported by this rank.
    fn for_each_contact(&self, particles: &Particles<S>, visit: &mut dyn FnMut(Contact<S>));
    /// Calls `visit` with the entries of every listed pair of spheres with a gap below a fraction of the smaller
    /// radius, and with those of spheres that near to a wall.
    fn for_each_near(
        &self,
        particles: &Particles<S>,
        fraction: f64,
        visit: &mut dyn FnMut(usize, Option<usize>),
    );
    /// Makes the next [`Self::prepare`] build the lists again.
    fn forget_lists(&mut self);
    /// Returns the present counts of this rank.
    fn statistics(&self, particles: &Particles<S>) -> Statistics;
    /// Returns the deepest contact so far, on this rank.
    fn deepest(&self) -> Deepest;
    /// Resets the deepest contact.
    fn forget_deepest(&mut self);
    /// Returns the solid steps done.
    fn steps(&self) -> u64;
    /// Returns the number of solid steps done times the time step \[s\].
    fn time(&self) -> f64;
    /// Returns the settings.
    fn settings(&self) -> &DemSettings<S>;
    /// Returns the settings for changes.
    fn settings_mut(&mut self) -> &mut DemSettings<S>;
    /// Returns the walls.
    fn walls(&self) -> &[Wall<S>];
    /// Returns the walls for changes.
    fn walls_mut(&mut self) -> &mut [Wall<S>];
    /// Returns the servo walls.
    fn servos_mut(&mut self) -> &mut Vec<Servo<S>>;
    /// Deactivates the walls of these indices.
    fn open_walls(&mut self, walls: &[usize]);
    /// Activates walls again, given by their indices.
    fn close_walls(&mut self, walls: &[usize]);
    /// Returns the contacts reported by this rank, the walls, and the number of steps done.
    fn save(&self) -> Contacts;
    /// Visits each contact reported by this rank, with the numbers of its history.
    fn each_contact(
        &self,
        grains: &mut dyn FnMut([u64; 2], &[f64]),
        walls: &mut dyn FnMut([u64; 3], &[f64]),
    );
    /// Restores saved contacts.
    fn restore(&mut self, contacts: &Contacts) -> Result<(), Error>;
}

impl<S: Space, L: Bodies<S>> AnyEngine<S> for Engine<S, L> {
    fn advance(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        steps: u64,
    ) -> Result<(), Error> {
        self.advance(particles, domain, steps)
    }

    fn loads_ahead(&mut self, particles: &mut Particles<S>, domain: &Domain) -> Result<(), Error> {
        self.loads_ahead(particles, domain)
    }

    fn carried(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        path: f64,
    ) -> Result<(), Error> {
        self.carried(particles, domain, path)
    }

    fn prepare(&mut self, particles: &mut Particles<S>, domain: &Domain) -> Result<(), Error> {
        self.prepare(particles, domain)
    }

    fn bond_all(&mut self, particles: &Particles<S>) -> u64 {
        L::bond_all(self, particles)
    }

    fn set_bond_strength(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        factor: f64,
    ) -> Result<(), Error> {
        self.set_bond_strength(particles, domain, factor)
    }

    fn break_overloaded(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<u64, Error> {
        self.break_overloaded(particles, domain)
    }

    fn take_breaks(&mut self) -> Vec<BondBreak<S>> {
        std::mem::take(&mut self.events.breaks)
    }

    fn for_each_contact(&self, particles: &Particles<S>, visit: &mut dyn FnMut(Contact<S>)) {
        self.for_each_contact(particles, visit);
    }

    fn for_each_near(
        &self,
        particles: &Particles<S>,
        fraction: f64,
        visit: &mut dyn FnMut(usize, Option<usize>),
    ) {
        self.for_each_near(particles, fraction, visit);
    }

    fn forget_lists(&mut self) {
        self.validity.listed = false;
    }

    fn statistics(&self, particles: &Particles<S>) -> Statistics {
        self.statistics(particles)
    }

    fn deepest(&self) -> Deepest {
        self.events.deepest
    }

    fn forget_deepest(&mut self) {
        self.events.deepest = Deepest::default();
    }

    fn steps(&self) -> u64 {
        self.steps
    }

    fn time(&self) -> f64 {
        self.time()
    }

    fn settings(&self) -> &DemSettings<S> {
        &self.settings
    }

    fn settings_mut(&mut self) -> &mut DemSettings<S> {
        &mut self.settings
    }

    fn walls(&self) -> &[Wall<S>] {
        &self.walls
    }

    fn walls_mut(&mut self) -> &mut [Wall<S>] {
        &mut self.walls
    }

    fn servos_mut(&mut self) -> &mut Vec<Servo<S>> {
        &mut self.servos.list
    }

    fn open_walls(&mut self, walls: &[usize]) {
        self.set_walls_open(walls, true);
    }

    fn close_walls(&mut self, walls: &[usize]) {
        self.set_walls_open(walls, false);
    }

    fn save(&self) -> Contacts {
        state::save(self)
    }

    fn each_contact(
        &self,
        grains: &mut dyn FnMut([u64; 2], &[f64]),
        walls: &mut dyn FnMut([u64; 3], &[f64]),
    ) {
        state::each_contact(self, grains, walls);
    }

    fn restore(&mut self, contacts: &Contacts) -> Result<(), Error> {
        state::restore(self, contacts)
    }
}

/// Operation that constructs the engine of a law.
pub(crate) struct MakeEngine<S: Space> {
    pub(crate) settings: DemSettings<S>,
    pub(crate) walls: Vec<Wall<S>>,
}

impl<S: Space> Visitor<S> for MakeEngine<S> {
    type Output = Result<Box<dyn AnyEngine<S>>, Error>;

    fn visit<L: Bodies<S>>(self, law: &L) -> Self::Output {
        // The condition is known when the law is compiled, so that its engine in two dimensions is not.
        if const { L::SPATIAL && S::DIMENSION == 2 } {
            let what = "this contact law does not work in two dimensions";
            return Err(Error::Numerical(what.into()));
        }
        Ok(Box::new(L::engine(law.clone(), self.settings, self.walls)))
    }
}
