//! Balance of momentum of water and grains, and extreme values of a run.

use super::Seepage;
use super::medium::pores_of;
use base::vector::norm;
use decomposition::ExactSum;
use dem::space::Space;

/// Momentum balance of a coupling.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance {
    /// Sum of the forces on grains \[N\].
    pub on_grains: [f64; 3],
    /// Integral of -grad p over the cells that contain grains, inside the walls \[N\].
    pub pressure: [f64; 3],
    /// Weight of the water in those cells \[N\].
    pub weight: [f64; 3],
    /// Reaction of grains in dilute water and friction of open water in those cells, absorbed by walls and inertia
    /// \[N\].
    pub open_water: [f64; 3],
    /// Magnitude of the residual divided by the largest of the four.
    pub closure: f64,
    /// Largest Reynolds number `rho q d/mu` of the flux past the grains of a cell.
    pub reynolds: f64,
    /// Number of grains whose drag was taken at the end of the interval.
    pub implicit: u64,
}

/// Extreme values over all couplings of a run since its last restart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extremes {
    /// Largest closure of momentum.
    pub closure: f64,
    /// Largest Reynolds number of the pores.
    pub reynolds: f64,
    /// Largest speed of a grain of this rank \[m/s\].
    pub speed: f64,
    /// Largest speed of a grain of this rank at the first coupling \[m/s\].
    pub first_speed: f64,
    /// Largest difference of the reduced pressure \[Pa\].
    pub pressure: f64,
    /// Largest speed of the water in a cell \[m/s\].
    pub water: f64,
}

impl<Sp: Space> Seepage<Sp> {
    /// Returns the extreme values of the couplings so far, with the speeds of all ranks. Collective.
    #[must_use]
    pub fn extremes(&self) -> Extremes {
        let mine = self.extremes.unwrap_or_default();
        let most = |speed: f64| self.communicator.all_reduce_max_f64(speed);
        Extremes {
            speed: most(mine.speed),
            first_speed: most(mine.first_speed),
            ..mine
        }
    }

    /// Records the extreme values of a coupling; `speed` is the largest speed of a grain of this rank \[m/s\].
    pub(super) fn keep_extremes(&mut self, speed: f64) {
        let before = self.extremes.unwrap_or(Extremes {
            first_speed: speed,
            ..Extremes::default()
        });
        let water = self.water.flux.iter().map(|q| norm(*q)).fold(0.0, f64::max);
        self.extremes = Some(Extremes {
            closure: before.closure.max(self.balance.closure),
            reynolds: before.reynolds.max(self.balance.reynolds),
            speed: before.speed.max(speed),
            first_speed: before.first_speed,
            pressure: before.pressure.max(self.pressure.largest_difference()),
            water: before.water.max(water),
        });
    }

    /// Returns `true` if the cell contains grains whose forces are part of the balance.
    fn counts(&self, cell: usize) -> bool {
        self.pores.solid_volume(cell) > 0.0 && !self.is_body(cell)
    }

    /// Returns the flux past the grains of a cell \[m/s\].
    pub(super) fn slip(&self, cell: usize) -> [f64; 3] {
        let (flux, sum) = (self.water.flux[cell], self.sums.cell(cell));
        if self.settings.moves() {
            let mean = sum.mean();
            std::array::from_fn(|a| flux[a] - mean[a])
        } else {
            flux
        }
    }

    /// Returns the momentum absorbed by walls and inertia of open water in a cell along an axis \[N\].
    fn taken_up(&self, cell: usize, axis: usize) -> f64 {
        let water = &self.water;
        let flux = water.flux[cell][axis];
        let pores = pores_of(&self.openness, self.pores.porosity(), cell);
        let friction = pores * water.still[cell][axis] * flux;
        if water.ground[cell].is_none() {
            return 0.0;
        }
        if !self.settings.moves() {
            return -friction;
        }
        let sum = self.sums.cell(cell);
        let gradient = water.gradient[cell][axis];
        let drag = sum.drag[axis] * flux - sum.held[axis] + sum.pushed[axis] * gradient;
        (1.0 - water.coupled[cell]) * drag - friction
    }

    /// Computes the momentum balance. Collective.
    pub(super) fn close(&mut self, mut on_grains: [ExactSum; 3], implicit: u64) {
        let mut balance = Balance {
            implicit: self.communicator.all_reduce_sum_u64(implicit),
            ..Balance::default()
        };
        let liquid = self.settings.liquid;
        for cell in (0..self.grid().count()).filter(|cell| self.counts(*cell)) {
            let speed = norm(self.slip(cell));
            let number = liquid.density * speed * self.pores.diameter()[cell] / liquid.viscosity;
            balance.reynolds = balance.reynolds.max(number);
        }
        let (mut largest, mut missing) = (0.0_f64, 0.0);
        for a in 0..3 {
            on_grains[a].all_reduce(&self.communicator);
            let [mut pressure, mut weight, mut open] = std::array::from_fn(|_| ExactSum::new());
            for cell in (0..self.grid().count()).filter(|cell| self.counts(*cell)) {
                let volume = self.openness.volume(cell);
                pressure.add(-volume * self.pressure.gradient(cell)[a]);
                weight.add(volume * self.pores.porosity()[cell] * self.pressure.weight()[a]);
                open.add(self.taken_up(cell, a));
            }
            let terms = [
                on_grains[a].value(),
                pressure.value(),
                weight.value(),
                open.value(),
            ];
            [
                balance.on_grains[a],
                balance.pressure[a],
                balance.weight[a],
                balance.open_water[a],
            ] = terms;
            let [force, pressure, weight, open] = terms;
            missing += (force - pressure - weight - open).powi(2);
            largest = terms
                .iter()
                .fold(largest, |most, term| most.max(term.abs()));
        }
        balance.closure = if largest > 0.0 {
            missing.sqrt() / largest
        } else {
            0.0
        };
        self.balance = balance;
    }
}
