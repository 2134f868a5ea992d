//! Transient flow in unsaturated ground: the mixed form of M. A. Celia, E. T. Bouloutas and R. L. Zarba (Water
//! Resour. Res. 26 (1990) 1483) with adaptive steps.
//!
//! ```text
//! M_1 = M_n + g dt F_1,     M_n+1 = M_n + dt [(1 - g) F_1 + g F_2],     g = 1 - 1/sqrt(2)
//! ```
//!
//! `M` is the water of a cell, `F` the sum of the fluxes into it. The two implicit stages are those of R. Alexander
//! (SIAM J. Numer. Anal. 14 (1977) 1006): second order, L-stable, and the second stage is the end of the step, so
//! that faces in air and saturated ground without storage are solved at the end. The water content after a step is
//! computed from the fluxes: the residual imbalance of Newton's method enters the next step and does not
//! accumulate. The difference `g dt (F_2 - F_1)` of the step to one of first order is kept below the stated error
//! of the content.
//!
//! It is separate from the steady flow because only a transient flow has a state in addition to the pressure.

use super::{CellState, Unsaturated};
use crate::SeepageError;
use crate::pressure::Pressure;
use base::history::TimeTable;
use decomposition::ExactSum;

/// Fraction of a step in a stage: 1 - 1/sqrt(2).
const STAGE: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
/// Maximum number of Newton steps in a stage.
const NEWTON_STEPS: u32 = 20;
/// Ratio of the first step to the interval.
const FIRST_STEP: f64 = 1e-3;
/// Minimum ratio of a step to the interval.
const SHORTEST_STEP: f64 = 1e-12;
/// Maximum number of steps of an interval that may fail. More failures mean that the conditions demand more than the
/// ground can deliver, such as the discharge of a well that has run dry, and the steps would remain short for hours.
const MAX_FAILURES: u32 = 50;
/// Minimum volume of the pores beyond the residual water over the stated one.
const LEAST_PORES: f64 = 0.05;
/// Factors of the next step: safety factor on the step with the stated error, minimum, maximum, and after a
/// failure.
const SAFETY: f64 = 0.9;
const FALL: f64 = 0.2;
const RISE: f64 = 2.0;
const FAILED: f64 = 0.25;
/// Number of values of a state in addition to the content of each cell.
pub(crate) const EXTRA_NUMBERS: usize = 6;

/// Initial state of a transient flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InitialWater {
    /// Steady flow under the conditions at time 0.
    Steady,
    /// Stationary water below and above a head \[m\].
    Head(f64),
    /// One pressure head everywhere \[m\].
    PressureHead(f64),
}

/// Settings of a transient flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransientSettings {
    /// State at the start.
    pub initial: InitialWater,
    /// Specific storage of saturated ground \[1/m\].
    pub specific_storage: f64,
    /// Largest error of the content of a cell in a step \[1\].
    pub content_error: f64,
    /// Time advanced by a call of [`Pressure::solve`] \[s\].
    pub interval: f64,
}

/// Values of the condition of a patch over time.
#[derive(Clone, Debug, PartialEq)]
pub struct ConditionHistory {
    /// Index of the patch.
    pub patch: usize,
    /// Values by time \[s\].
    pub values: TimeTable,
}

/// Volumes of water since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WaterBalance {
    /// Water in the ground, computed from the pressure \[m³\].
    pub stored: f64,
    /// Water in the ground at the start \[m3\].
    pub initial: f64,
    /// Volume of water that entered \[m³\].
    pub entered: f64,
    /// Volume of water that left \[m³\].
    pub left: f64,
}

impl WaterBalance {
    /// Returns the missing volume divided by the larger of inflow and outflow \[1\]; 0 without flow.
    #[must_use]
    pub fn error(&self) -> f64 {
        let moved = self.entered.max(self.left);
        if moved > 0.0 {
            ((self.stored - self.initial) - (self.entered - self.left)) / moved
        } else {
            0.0
        }
    }
}

/// State and vectors of a transient flow.
pub(super) struct Transient {
    settings: TransientSettings,
    histories: Vec<ConditionHistory>,
    /// Volume of each cell inside the walls \[m3\].
    volume: Vec<f64>,
    /// Volume of cells whose pores change, at the start of an interval and at its end \[m3\]; empty if none changes.
    changing: Vec<[f64; 2]>,
    /// Volume of each cell with the stated pores \[m3\], and its residual content; empty if none changes.
    whole: Vec<[f64; 2]>,
    /// Residual water of each cell that its content at the present volume leaves out \[m3\]; empty if no pores change.
    bound: Vec<f64>,
    /// Reciprocal time of a stage \[1/s\]; 0 in a steady flow.
    rate: f64,
    /// Volume at the start of a stage, at the present pressure, and from the fluxes of all steps \[m³\].
    known: Vec<f64>,
    content: Vec<f64>,
    stored: Vec<f64>,
    /// Sum of the fluxes into each cell \[m³/s\]; the next field is that of the first stage.
    net: Vec<f64>,
    first: Vec<f64>,
    /// Derivative of the stored water with respect to the reduced pressure, divided by the time of a stage.
    pub(super) capacity: Vec<f64>,
    begin: Vec<f64>,
    began: bool,
    /// Length of the next step, and time \[s\].
    step: f64,
    time: f64,
    entered: f64,
    left: f64,
    initial: f64,
    /// Inflow and outflow in the first stage \[m³/s\].
    crossed: (f64, f64),
}

impl Transient {
    /// Adds the change of the stored water to the imbalances, and its derivative to the diagonal.
    pub(super) fn store(
        &mut self,
        states: &[CellState],
        weight: f64,
        (residual, diagonal): (&mut [f64], &mut [f64]),
    ) {
        let specific = self.settings.specific_storage;
        for (at, state) in states.iter().enumerate() {
            let volume = self.volume[at];
            if volume <= 0.0 {
                continue;
            }
            let wet = if state.head > 0.0 { specific } else { 0.0 };
            self.content[at] = volume * (state.content + wet * state.head.max(0.0));
            self.net[at] = residual[at];
            if self.rate > 0.0 {
                residual[at] -= (self.content[at] - self.known[at]) * self.rate;
                self.capacity[at] = volume * (state.capacity + wet) * self.rate / weight;
                diagonal[at] += self.capacity[at];
            }
        }
    }

    /// Returns `true` during a time step.
    pub(super) fn advances(&self) -> bool {
        self.rate > 0.0
    }

    /// Returns the volume of a cell divided by the time of a stage \[m³/s\], and the specific storage \[1/m\].
    pub(super) fn storing(&self, at: usize) -> (f64, f64) {
        (self.volume[at] * self.rate, self.settings.specific_storage)
    }

    /// Returns `true` if the initial state is known.
    pub(super) fn began(&self) -> bool {
        self.began
    }

    /// Returns the largest storage rate of a cell \[m³/s\], whose rounding limits the imbalance.
    pub(super) fn largest_term(&self) -> f64 {
        let most = self
            .content
            .iter()
            .fold(0.0, |most: f64, m| most.max(m.abs()));
        most * self.rate
    }

    /// Returns the largest sum of the fluxes into a cell \[m3/s\].
    pub(super) fn largest_net(&self) -> f64 {
        self.net.iter().fold(0.0, |most, net| net.abs().max(most))
    }

    /// Returns the part of an interval that has passed at a time.
    fn part(&self, time: f64) -> f64 {
        (time - self.time) / self.settings.interval
    }

    /// Sets the volumes of cells whose pores change, after a part of an interval.
    fn set_volumes(&mut self, part: f64) {
        for (at, [first, last]) in self.changing.iter().enumerate() {
            let [whole, residual] = self.whole[at];
            self.volume[at] = part.mul_add(last - first, *first);
            self.bound[at] = residual * (whole - self.volume[at]);
        }
    }

    /// Takes the residual water out of the water at the start of a stage, or adds it to the water at its end.
    fn leave_bound(&mut self, sign: f64) {
        for (known, bound) in self.known.iter_mut().zip(&self.bound) {
            *known -= sign * bound;
        }
    }

    /// Starts a step of a length from a pressure.
    fn start_step(&mut self, dt: f64, phi: &[f64]) {
        self.begin.copy_from_slice(phi);
        self.known.copy_from_slice(&self.stored);
        self.rate = 1.0 / (STAGE * dt);
    }

    /// Starts the second stage; `crossed` are inflow and outflow in the first \[m³/s\].
    fn start_second(&mut self, dt: f64, crossed: (f64, f64)) {
        self.first.copy_from_slice(&self.net);
        self.crossed = crossed;
        for at in 0..self.known.len() {
            self.known[at] = self.stored[at] + (1.0 - STAGE) * dt * self.first[at];
        }
    }

    /// Accepts a step; `crossed` are inflow and outflow in the second stage \[m³/s\].
    fn accept(&mut self, dt: f64, crossed: (f64, f64)) {
        self.leave_bound(-1.0);
        for at in 0..self.stored.len() {
            self.stored[at] = self.known[at] + STAGE * dt * self.net[at];
        }
        self.entered += dt * ((1.0 - STAGE) * self.crossed.0 + STAGE * crossed.0);
        self.left += dt * ((1.0 - STAGE) * self.crossed.1 + STAGE * crossed.1);
    }

    /// Returns the largest error of the water content in a step of this length, divided by the stated one. In
    /// saturated cells the stated error refers to the water that specific storage takes up over `scale`, the
    /// difference of the heads \[m\].
    fn error(&self, dt: f64, states: &[CellState], scale: f64) -> f64 {
        let elastic = (self.settings.specific_storage * scale).min(1.0);
        let mut most = 0.0_f64;
        for (at, state) in states.iter().enumerate() {
            let part = if state.head > 0.0 { elastic } else { 1.0 };
            let allowed = part * self.volume[at];
            if allowed > 0.0 {
                let difference = (self.net[at] - self.first[at]).abs();
                most = most.max(STAGE * dt * difference / allowed);
            }
        }
        most / self.settings.content_error
    }
}

/// Sums numbers without rounding.
fn sum(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut sum = ExactSum::new();
    numbers.for_each(|number| sum.add(number));
    sum.value()
}

impl Pressure {
    /// Makes the unsaturated flow transient: afterwards [`Pressure::solve`] advances it by an interval. `volume` is
    /// the volume of each cell inside the walls \[m³\].
    #[must_use]
    pub fn with_transient(mut self, settings: TransientSettings, volume: &[f64]) -> Self {
        let (grid, layout) = (&self.slab.grid, self.slab.layout);
        let mut inside = vec![0.0; layout.len()];
        for (cell, volume) in volume.iter().enumerate() {
            if self.conduction.conducts[cell] {
                inside[layout.position(grid.cell(cell))] = *volume;
            }
        }
        let zeros = || vec![0.0; layout.len()];
        if let Some(own) = &mut self.unsaturated {
            own.transient = Some(Box::new(Transient {
                settings,
                histories: Vec::new(),
                volume: inside,
                changing: Vec::new(),
                whole: Vec::new(),
                bound: Vec::new(),
                rate: 0.0,
                known: zeros(),
                content: zeros(),
                stored: zeros(),
                net: zeros(),
                first: zeros(),
                capacity: zeros(),
                begin: zeros(),
                began: false,
                step: FIRST_STEP * settings.interval,
                time: 0.0,
                entered: 0.0,
                left: 0.0,
                initial: 0.0,
                crossed: (0.0, 0.0),
            }));
        }
        self
    }

    /// Sets the pore volumes of the cells over the stated ones, at the start of the next interval and at its end: they
    /// change linearly in it, and the volume of water of a cell does not change with them. The pores beyond the
    /// residual water change, `M = V [theta_r + (p theta_s - theta_r) S_e]`, so that ground that opens can keep its
    /// water. No effect in a steady flow.
    pub fn set_pore_volumes(&mut self, parts: [&[f64]; 2]) {
        let (grid, layout) = (&self.slab.grid, self.slab.layout);
        let Some(own) = self.unsaturated.as_mut() else {
            return;
        };
        let contents: Vec<[f64; 2]> = (own.soils.iter())
            .map(|soil| {
                let law = soil.model();
                [law.residual_content(), law.state(0.0).content]
            })
            .collect();
        let Some(transient) = own.transient.as_mut() else {
            return;
        };
        if transient.whole.is_empty() {
            let residual = |soil: &u8| contents[usize::from(*soil)][0];
            let volumes = transient.volume.iter().zip(&own.soil_of);
            transient.whole = volumes.map(|(v, soil)| [*v, residual(soil)]).collect();
            transient.changing = transient.volume.iter().map(|v| [*v; 2]).collect();
            transient.bound = vec![0.0; transient.volume.len()];
        }
        for cell in 0..grid.count() {
            let at = layout.position(grid.cell(cell));
            let [residual, saturated] = contents[usize::from(own.soil_of[at])];
            let drained = saturated - residual;
            let volume = |part: f64| {
                let pores = saturated
                    .mul_add(part, -residual)
                    .max(LEAST_PORES * drained);
                transient.whole[at][0] * pores / drained
            };
            transient.changing[at] = parts.map(|part| volume(part[cell]));
        }
        transient.set_volumes(0.0);
    }

    /// Adds tables of condition values over time to a transient flow.
    #[must_use]
    pub fn with_histories(mut self, histories: Vec<ConditionHistory>) -> Self {
        let own = self.unsaturated.as_mut();
        if let Some(transient) = own.and_then(|own| own.transient.as_mut()) {
            transient.histories = histories;
        }
        self
    }

    /// Imposes the conditions of a time.
    fn impose_histories(&mut self, own: &Unsaturated, time: f64) {
        let histories = own
            .transient
            .iter()
            .flat_map(|transient| &transient.histories);
        for history in histories {
            let value = history.values.value(time);
            self.patches[history.patch].condition.set_value(value);
        }
    }

    /// Returns the volumes of water since the start; none in a steady flow.
    #[must_use]
    pub fn water_balance(&self) -> Option<WaterBalance> {
        let own = self.unsaturated.as_ref()?;
        let transient = own.transient.as_ref()?;
        Some(WaterBalance {
            stored: sum(transient.content.iter().chain(&transient.bound).copied()),
            initial: transient.initial,
            entered: transient.entered,
            left: transient.left,
        })
    }

    /// Returns the state of a transient flow in addition to [`Self::saved`]; empty in a steady flow.
    pub fn saved_water(&self) -> impl Iterator<Item = f64> {
        let own = self.unsaturated.as_ref();
        let transient = own.and_then(|own| own.transient.as_ref());
        transient.into_iter().flat_map(|transient| {
            let (grid, layout) = (&self.slab.grid, self.slab.layout);
            let cells = (0..grid.count())
                .map(move |cell| transient.stored[layout.position(grid.cell(cell))]);
            cells.chain([
                transient.step,
                transient.time,
                transient.entered,
                transient.left,
                transient.initial,
                self.level,
            ])
        })
    }

    /// Restores the values of [`Self::saved_water`].
    ///
    /// # Errors
    /// If the values are not those of this grid.
    pub fn restore_water(&mut self, saved: &[f64]) -> Result<(), SeepageError> {
        let (grid, layout) = (&self.slab.grid, self.slab.layout);
        let Some(mut own) = self.unsaturated.take() else {
            return Ok(());
        };
        let mut wrong = false;
        if let Some(transient) = &mut own.transient {
            match saved.split_at_checked(grid.count()) {
                Some((cells, &[step, time, entered, left, initial, level])) => {
                    self.level = level;
                    for (cell, stored) in cells.iter().enumerate() {
                        transient.stored[layout.position(grid.cell(cell))] = *stored;
                    }
                    (transient.step, transient.time) = (step, time);
                    (transient.entered, transient.left) = (entered, left);
                    (transient.initial, transient.began) = (initial, true);
                    transient.content.copy_from_slice(&transient.stored);
                }
                _ => wrong = true,
            }
        }
        self.unsaturated = Some(own);
        if wrong {
            return Err(SeepageError::Messages(format!(
                "{} numbers of the stored water for {} cells",
                saved.len(),
                grid.count()
            )));
        }
        Ok(())
    }

    /// Computes the initial state.
    fn begin(&mut self, own: &mut Unsaturated) -> Result<(), SeepageError> {
        let Some(settings) = own.transient.as_ref().map(|transient| transient.settings) else {
            return Ok(());
        };
        let (layout, level) = (self.slab.layout, self.level);
        for row in layout.rows(&layout.whole()) {
            for at in row {
                match settings.initial {
                    InitialWater::Steady => {}
                    InitialWater::Head(head) => self.phi[at] = own.weight * head - level,
                    InitialWater::PressureHead(head) => {
                        self.phi[at] = own.weight * (head + own.elevation[at]) - level;
                    }
                }
            }
        }
        if settings.initial == InitialWater::Steady {
            self.find_steady(own)?;
        }
        (own.power, own.floor) = (1.0, 0.0);
        self.evaluate(own);
        if let Some(transient) = &mut own.transient {
            transient.stored.copy_from_slice(&transient.content);
            for (stored, bound) in transient.stored.iter_mut().zip(&transient.bound) {
                *stored += bound;
            }
            transient.initial = sum(transient.stored.iter().copied());
            transient.began = true;
        }
        Ok(())
    }

    /// Advances by adaptive steps to the end of the interval; returns iterations and residual.
    pub(super) fn advance_steps(
        &mut self,
        own: &mut Unsaturated,
    ) -> Result<(u32, f64), SeepageError> {
        if own
            .transient
            .as_ref()
            .is_some_and(|transient| !transient.began)
        {
            self.begin(own)?;
        }
        let state = own
            .transient
            .as_ref()
            .map(|t| (t.time, t.settings.interval));
        let Some((start, interval)) = state else {
            return Ok((0, 0.0));
        };
        // The end of an interval is an exact multiple of it, independent of the rounding of its steps.
        let end = (start / interval).round().mul_add(interval, interval);
        let (mut iterations, mut residual) = (0, 0.0);
        let (mut time, mut failures) = (start, 0);
        while time < end {
            let wanted = own.transient.as_ref().map_or(interval, |t| t.step);
            let stop = own.transient.as_ref().map_or(end, |transient| {
                let times = transient
                    .histories
                    .iter()
                    .filter_map(|h| h.values.next(time));
                times.fold(end, f64::min)
            });
            let pieces = ((stop - time) / wanted).ceil().max(1.0);
            let dt = (stop - time) / pieces;
            let found = self.try_step(own, (time, dt), &mut iterations)?;
            let scale = self.largest_difference() / own.weight;
            let Some(transient) = &mut own.transient else {
                break;
            };
            let error = found.map_or(f64::INFINITY, |found| {
                residual = found;
                transient.error(dt, &own.states, scale)
            });
            if error <= 1.0 {
                time = if pieces > 1.0 { time + dt } else { stop };
                transient.accept(dt, self.crossed());
            } else {
                self.phi.copy_from_slice(&transient.begin);
            }
            let factor = if error.is_finite() {
                (SAFETY / error.max(1e-12).sqrt()).clamp(FALL, RISE)
            } else {
                FAILED
            };
            transient.step = (factor * dt).min(interval);
            failures += u32::from(!error.is_finite());
            if transient.step < SHORTEST_STEP * interval || failures > MAX_FAILURES {
                return Err(SeepageError::UnsteadyFlow {
                    time,
                    length: own.capillary_length(),
                });
            }
        }
        if let Some(transient) = &mut own.transient {
            (transient.time, transient.rate) = (end, 0.0);
        }
        Ok((iterations, residual))
    }

    /// Solves both stages of a step; returns the imbalance, or none if Newton's method fails. Collective.
    fn try_step(
        &mut self,
        own: &mut Unsaturated,
        (time, dt): (f64, f64),
        iterations: &mut u32,
    ) -> Result<Option<f64>, SeepageError> {
        if let Some(transient) = &mut own.transient {
            transient.start_step(dt, &self.phi);
            transient.set_volumes(transient.part(time + STAGE * dt));
            transient.leave_bound(1.0);
        }
        self.impose_histories(own, time + STAGE * dt);
        let first = self.newton(own, NEWTON_STEPS)?;
        *iterations += first.iterations;
        if !first.converged {
            return Ok(None);
        }
        let crossed = self.crossed();
        if let Some(transient) = &mut own.transient {
            transient.start_second(dt, crossed);
            transient.set_volumes(transient.part(time + dt));
            transient.leave_bound(1.0);
        }
        self.impose_histories(own, time + dt);
        let second = self.newton(own, NEWTON_STEPS)?;
        *iterations += second.iterations;
        Ok(second.converged.then_some(second.residual))
    }

    /// Returns the present inflow and outflow through the boundary \[m³/s\].
    fn crossed(&self) -> (f64, f64) {
        let rates = || self.boundary.iter().map(|face| face.rate);
        (
            sum(rates().filter(|rate| *rate > 0.0)),
            -sum(rates().filter(|rate| *rate < 0.0)),
        )
    }
}
