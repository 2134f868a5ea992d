//! Darcy seepage with drag on grains.
//!
//! A coupling computes the porosity and the mean diameter of the cells from the grains, then the pressure,
//! the flux of the water and the load
//! of every grain. The load stays constant over the solid steps of the interval T:
//!
//! ```text
//! F = sum over cells of w { -V grad p + b [q - eps v*] }      w: the part of the grain in the cell
//! ```
//!
//! `q` is the superficial velocity of the water in the cell and `eps v*` that of the grain, so that `U = q - eps v` is
//! the superficial slip. The coefficient `b(|U|)` of the drag law is taken at the slip of each grain. The pressure
//! includes the hydrostatic part, so that `-V grad p` contains buoyancy.
//!
//! **Resistance is the reaction.** The water of a cell of volume `V_c` loses the momentum that its grains gain, and
//! the momentum that stationary walls and solids absorb:
//!
//! ```text
//! -eps V_c grad phi = c sum of w b_r [q - eps v*] + eps V_c R q
//! ```
//!
//! With `drag: reaction` `b_r = b`: in a bed both are `V eps R_bed/(1 - eps)` with the loss over flux `R_bed(|U|)` of
//! the law of resistance, in dilute water the drag of a grain alone
//! ([`darcy::resistance::ResistanceFormula::dilute`]), and between them a weighted mean
//! ([`dense_share`](darcy::drag::gidaspow::dense_share)). The porosity of the drag in dilute water is that of the
//! neighbourhood ([`darcy::neighbourhood`]): a lone grain falls like an isolated sphere, however small its cell. `R`
//! is the resistance of open water ([`darcy::open_water`]) and of zones without grains.
//!
//! **Dilute water.** A few grains do not move the water around them, which is held by its inertia and the walls.
//! The factor `c` falls from 1 at a solid fraction of 0.05 to 0 at 0.02; the rest of the reaction is counted as
//! absorbed by open water. In a uniform cloud the reaction would build up a gradient of `n b U/eps`; instead, the
//! drag in dilute water is raised by `(1 - c) (1 - eps)/eps`.
//!
//! **The velocity of a grain** is taken in the middle of the interval, or later if drag stops the grain within the
//! interval:
//!
//! ```text
//! v* = v + theta [v - v_last + T/m (F - F_last)],     theta = max(1/2, 1 - 1/s),   s = T b/(m eps)
//! ```
//!
//! The change of velocity over the last interval, `v - v_last`, represents the mean of all forces in it. Without
//! contacts `theta = 1` is an implicit Euler step. `v*` is linear in `q` and in the gradient, so that sums over the
//! grains give the momentum of the water and the volume that grains displace, `j = q + sum of w V v*/V_c`, as
//! linear functions of the gradient alone; the pressure follows from `div j = 0`. A bed and its water are thus
//! solved as one. A grain that lies in several cells has a `v*` in each. The forces of contacts within an interval
//! are not foreseen: the plan limits the interval (`plan::coupling_interval`).
//!
//! At its first coupling a grain counts with its present velocity if contacts hold it, and as falling freely
//! otherwise. Without `transient_porosity` the bed is treated as stationary in the balances of momentum and volume
//! of the water, whose permeability is that of the law at the gradient. The same holds for the equations as printed
//! in the published fissure model, where both velocities are interstitial, `b (u - v)` with `u = -K/(mu eps) grad
//! p`, there is no buoyancy, and open water has the resistance of the largest porosity.
//!
//! **Unsaturated ground** has a load of its own, which depends on the suction ([`moist`]). Its permeability and pore
//! volume may follow the grains ([`following`]).
//!
//! **Rounds.** Coefficients and pressure are computed alternately until they no longer change. A round takes the
//! coefficients at the speed that solves the law of its cell for the present gradient to first order, or, from the
//! second round on, at the speed extrapolated from the response of the cell to the last round. If grains move, the
//! rounds end at a change of 2e-3 and continue in the next coupling.
//!
//! **Zones** ([`darcy::zones`]) replace the permeability of cells, and the porosity of the law of resistance. The
//! porosity of the grains remains that of the balances. Most zones apply only where there are grains: from a
//! porosity of 0.8 to 0.95 the drag changes to that of the grains, and a cell without grains is open water. A cell
//! that a boundary of zones cuts has a permeability along each axis; so has its drag.
//!
//! **Closure of momentum**: the forces on grains should add up to `-integral of grad p - weight of the water` and
//! the momentum absorbed by open water, over the volume inside the walls of the cells that hold grains. The
//! difference, relative to the largest term, is reported at every coupling. Cells that a zone fills without grains
//! are left out. It is of the order of rounding with the reaction of the resistance, and the mismatch between drag
//! law and resistance otherwise.

mod balance;
mod bed;
mod following;
mod medium;
mod moist;
mod parts;
mod water;

use super::Flow;
pub use balance::{Balance, Extremes};
use base::error::Error;
use base::thread_pool;
use bed::Sums;
use darcy::pressure;
use darcy::zones::ZonePermeability;
use darcy::{
    DragLaw, Equations, Liquid, Openness, Pores, Pressure, ResistanceSettings, SeepageGrid,
    SolutionReport, Zones,
};
use decomposition::{Communicator, Domain, ExactSum};
use dem::particles::{Load, Particles};
use dem::space::{Components, Space};
use following::Following;
use moist::Moist;
use parts::Parts;
use std::marker::PhantomData;
use std::sync::Arc;
use water::Water;

/// Closure of momentum, the relative residual of its balance, above which a run warns.
const OPEN: f64 = 0.1;
/// Maximum Reynolds number for Darcy's law.
const DARCY: f64 = 1.0;
/// Porosity below which a cell counts as filled with grains.
const FILLED: f64 = 0.95;

/// Settings of the coupling.
#[derive(Clone, Copy, Debug)]
pub struct SeepageSettings {
    /// Properties of the water.
    pub liquid: Liquid,
    /// Law of flow resistance, with the limits of the porosity.
    pub resistance: ResistanceSettings,
    /// The drag law.
    pub drag: DragLaw,
    /// Form of the equations.
    pub equations: Equations,
    /// `true` if moving grains displace water: the bed moves, or the change of porosity is a source in the equations
    /// as printed.
    pub transient_porosity: bool,
    /// `true` if the drag on a grain is taken at the end of the interval if it stops the grain within the interval.
    pub semi_implicit_drag: bool,
    /// Gravity on the grains \[m/s2\].
    pub gravity: [f64; 3],
    /// Time between two couplings \[s\].
    pub interval: f64,
    /// Roughness height of channels of open water \[m\]; none for the mean diameter of the grains of their walls.
    pub roughness: Option<f64>,
    /// `true` if capillary bridges between the grains carry the suction of unsaturated ground; otherwise it acts as a
    /// part of the load of the water.
    pub bridges: bool,
    /// `true` for faces of the grid that are walls for open water, lower and upper face along each axis.
    pub walls: [[bool; 2]; 3],
}

impl SeepageSettings {
    /// Returns `true` if the motion of the bed and its water are solved together.
    fn moves(&self) -> bool {
        self.transient_porosity && self.equations == Equations::Corrected
    }

    /// Returns the weight of the water per volume \[N/m3\]; 0 in the equations as printed.
    fn water_weight(&self) -> [f64; 3] {
        match self.equations {
            Equations::Corrected => self.gravity.map(|g| g * self.liquid.density),
            Equations::Paper => [0.0; 3],
        }
    }
}

/// Porosity of the cells in the previous coupling.
struct EarlierPorosity {
    porosity: Vec<f64>,
    /// `true` if there was a previous coupling.
    known: bool,
}

/// State for a coupling that may be interrupted.
#[derive(Default)]
struct InterruptedCoupling {
    /// `true` if a coupling may be interrupted ([`Seepage::interrupt_when`]).
    may_stop: bool,
    /// State before the present coupling, if it may be interrupted.
    kept: Vec<f64>,
}

/// Seepage with grains in it.
pub struct Seepage<Sp: Space> {
    settings: SeepageSettings,
    openness: Openness,
    pores: Pores,
    pressure: Pressure,
    communicator: Communicator,
    permeability: Vec<f64>,
    limited: Vec<f64>,
    source: Vec<f64>,
    earlier: EarlierPorosity,
    /// Permeabilities by zone.
    zones: Option<(Arc<Zones>, ZonePermeability)>,
    report: SolutionReport,
    balance: Balance,
    extremes: Option<Extremes>,
    parts: Parts,
    sums: Sums,
    water: Water,
    moist: Moist,
    interruption: InterruptedCoupling,
    /// Unsaturated ground that follows the grains.
    following: Following,
    space: PhantomData<Sp>,
}

impl<Sp: Space> Seepage<Sp> {
    /// Returns a coupling of a pressure with grains.
    #[must_use]
    #[inline(never)]
    pub fn new(
        openness: Openness,
        pores: Pores,
        pressure: Pressure,
        settings: SeepageSettings,
        communicator: &Communicator,
    ) -> Self {
        let n = openness.grid.count();
        log::info!("coupling of grains and seepage by drag, {n} cells of pores: {settings:?}");
        Self {
            settings,
            water: Water::new(openness.grid.clone(), &pressure, settings.walls),
            openness,
            pores,
            pressure,
            communicator: communicator.clone(),
            permeability: vec![0.0; n],
            limited: vec![0.0; n],
            source: vec![0.0; n],
            earlier: EarlierPorosity {
                porosity: vec![0.0; n],
                known: false,
            },
            zones: None,
            report: SolutionReport::default(),
            balance: Balance::default(),
            extremes: None,
            parts: Parts::default(),
            sums: Sums::default(),
            moist: Moist::default(),
            interruption: InterruptedCoupling::default(),
            following: Following::default(),
            space: PhantomData,
        }
    }

    /// Adds permeabilities and porosities by zone.
    #[must_use]
    pub fn with_zones(mut self, zones: Arc<Zones>) -> Self {
        let permeability_of_zones = ZonePermeability::new(&zones, self.grid().count());
        self.zones = Some((zones, permeability_of_zones));
        self
    }

    /// Makes permeability and pore volume of unsaturated ground follow the grains: `reference` is the porosity to
    /// which the values of each cell refer, 0 for cells that do not follow.
    #[must_use]
    pub fn with_following(mut self, reference: Vec<f64>) -> Self {
        self.following = Following::new(reference);
        self
    }

    /// Returns the grid of the water.
    #[must_use]
    pub fn grid(&self) -> &SeepageGrid {
        &self.openness.grid
    }

    /// Returns the open parts of the cells and faces.
    #[must_use]
    pub fn openness(&self) -> &Openness {
        &self.openness
    }

    /// Returns the pressure.
    #[must_use]
    pub fn pressure(&self) -> &Pressure {
        &self.pressure
    }

    /// Returns `true` if the pressure has been computed.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.earlier.known
    }

    /// Returns the pores.
    #[must_use]
    pub fn pores(&self) -> &Pores {
        &self.pores
    }

    /// Returns the mean porosity of the cells that grains fill: those below the maximum of the permeability law,
    /// and at most
    /// 0.95.
    #[must_use]
    pub fn mean_porosity(&self) -> f64 {
        let most = self.settings.resistance.porosity_cap.min(FILLED);
        let full = self.pores.porosity().iter();
        let full = full.filter(|e| **e > 0.0 && **e < most);
        let (sum, cells) = full.fold((0.0, 0.0), |(sum, cells), e| (sum + e, cells + 1.0));
        if cells > 0.0 { sum / cells } else { 1.0 }
    }

    /// Returns the cost of the last solution.
    #[must_use]
    pub fn report(&self) -> &SolutionReport {
        &self.report
    }

    /// Returns the balance of momentum at the last coupling.
    #[must_use]
    pub fn balance(&self) -> &Balance {
        &self.balance
    }

    /// Returns the state that a run needs to continue, equal on every rank: per cell the pressure in the form used
    /// by the solver, the porosity at the last coupling, the three components of the pressure gradient, those of
    /// the water flux, and the speed that determines its friction. Empty before the first coupling.
    #[must_use]
    pub fn state(&self) -> Vec<f64> {
        let mut state = Vec::new();
        self.save(&mut state);
        state
    }

    /// Replaces the values of `state` by those of [`Self::state`].
    fn save(&self, state: &mut Vec<f64>) {
        state.clear();
        if !self.earlier.known {
            return;
        }
        let water = &self.water;
        state.extend(self.pressure.saved());
        state.extend_from_slice(&self.earlier.porosity);
        state.extend_from_slice(water.gradient.as_flattened());
        state.extend_from_slice(water.flux.as_flattened());
        state.extend_from_slice(&water.speed);
        state.extend(self.pressure.saved_water());
    }

    /// Ends couplings early where `requested` returns `true` on some rank ([`Pressure::interrupt_when`]). The state is
    /// then that of the previous coupling.
    pub fn interrupt_when(&mut self, requested: Box<dyn Fn() -> bool + Send + Sync>) {
        self.pressure.interrupt_when(requested);
        self.interruption.may_stop = true;
    }

    /// Restores the state from [`Self::state`].
    ///
    /// # Errors
    /// If the state is for another grid.
    #[inline(never)]
    pub fn restore(&mut self, state: &[f64]) -> Result<(), Error> {
        let n = self.grid().count();
        if state.is_empty() {
            return Ok(());
        }
        let expected = pressure::numbers(n, self.pressure.water_balance().is_some());
        if state.len() != expected {
            return Err(Error::Io(format!(
                "the checkpoint holds {} numbers of the seepage, not {expected}",
                state.len(),
            )));
        }
        self.pressure.restore(&state[..n]).map_err(failed)?;
        self.pressure
            .restore_water(&state[pressure::numbers(n, false)..])
            .map_err(failed)?;
        self.earlier.porosity.copy_from_slice(&state[n..2 * n]);
        let water = &mut self.water;
        water
            .gradient
            .as_flattened_mut()
            .copy_from_slice(&state[2 * n..5 * n]);
        water
            .flux
            .as_flattened_mut()
            .copy_from_slice(&state[5 * n..8 * n]);
        water.speed.copy_from_slice(&state[8 * n..9 * n]);
        water.update_gradient_magnitudes();
        self.earlier.known = true;
        Ok(())
    }

    /// Returns the superficial velocity of the water in a cell \[m/s\]; interstitial in the equations as printed.
    #[must_use]
    pub fn water_velocity(&self, cell: usize) -> [f64; 3] {
        self.water.flux[cell]
    }

    /// Returns warnings about the couplings, for users of the results.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut all = Vec::new();
        let (balance, settings) = (&self.extremes.unwrap_or_default(), &self.settings);
        if balance.closure > OPEN {
            all.push(format!(
                "the forces of the water on the grains differ from the pressure loss by {:.0} % (closure of \
                 momentum {:.2}); above {OPEN} the drag law and the law of resistance are inconsistent: choose a \
                 matching pair",
                100.0 * balance.closure,
                balance.closure
            ));
        }
        if balance.reynolds > DARCY && !settings.resistance.law.model().depends_on_the_gradient() {
            all.push(format!(
                "the Reynolds number of the seepage reaches {:.1}: above about {DARCY} there are inertial \
                 losses, which the law of resistance does not include",
                balance.reynolds
            ));
        }
        all
    }

    /// Returns `true` if a body that the case does not resolve carries the pressure of a cell.
    fn is_body(&self, cell: usize) -> bool {
        let zones = self.zones.as_ref();
        zones.is_some_and(|(_, permeability_of_zones)| permeability_of_zones.is_body(cell))
    }
}

fn component<V: Components>(vector: &V, axis: usize) -> f64 {
    if axis < V::COUNT {
        vector.get(axis)
    } else {
        0.0
    }
}

fn components<V: Components>(vector: &V) -> [f64; 3] {
    std::array::from_fn(|a| component(vector, a))
}

fn failed(error: darcy::SeepageError) -> Error {
    match error {
        darcy::SeepageError::Messages(text) => Error::Internal(text),
        stopped @ darcy::SeepageError::Stopped => Error::Stopped(stopped.to_string()),
        other => Error::Numerical(other.to_string()),
    }
}

impl<Sp: Space> Flow<Sp> for Seepage<Sp> {
    fn advance(&mut self, particles: &mut Particles<Sp>, _: &Domain) -> Result<(), Error> {
        let mut kept = std::mem::take(&mut self.interruption.kept);
        if self.interruption.may_stop {
            self.save(&mut kept);
        }
        let advanced = self.load(particles);
        if matches!(advanced, Err(Error::Stopped(_))) {
            self.restore(&kept)?;
        }
        self.interruption.kept = kept;
        advanced
    }

    fn update_bodies(&mut self, _: &mut Particles<Sp>, _: &Domain) -> Result<(), Error> {
        Ok(())
    }
}

impl<Sp: Space> Seepage<Sp> {
    /// Computes the water, and the load of each grain. Collective.
    fn load(&mut self, particles: &mut Particles<Sp>) -> Result<(), Error> {
        particles.allocate_fluid_loads();
        if self.pressure.drains() {
            return self.wet(particles);
        }
        if self.settings.semi_implicit_drag {
            particles.keep_last_velocity();
        }
        let grains = particles.view();
        self.solve_pressure(&grains)?;
        let mut shares = std::mem::take(&mut self.parts.shares);
        let (water, weight) = (&self.water, self.pressure.weight());
        thread_pool::each_item(&mut shares, 1, |_, share| {
            bed::load((water, weight), &grains, share);
        });
        self.parts.shares = shares;
        let mut sums: [ExactSum; 3] = std::array::from_fn(|_| ExactSum::new());
        let (mut implicit, mut fastest) = (0, 0.0_f64);
        let loads = self.parts.shares.iter().flat_map(|share| &share.loads);
        for ((k, _), own) in self.parts.each().zip(loads) {
            let mut load = Load::<Sp>::default();
            for a in 0..Sp::DIMENSION {
                load.force.set(a, own.force[a]);
                sums[a].add(own.counted[a]);
            }
            implicit += u64::from(own.implicit);
            let velocity: [f64; 3] = components(&particles.motion[k].velocity);
            fastest = fastest.max(velocity.iter().map(|v| v * v).sum());
            particles.fluid[k] = load;
            if particles.last_velocity.is_allocated() {
                particles.last_velocity[k] = particles.motion[k].velocity;
            }
        }
        self.close(sums, implicit);
        self.keep_extremes(fastest.sqrt());
        if !self.balance.closure.is_finite() {
            return Err(Error::Numerical(
                "the force of the water on the grains is not finite".into(),
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
