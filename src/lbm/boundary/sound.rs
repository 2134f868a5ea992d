//! Openings that absorb sound.
//!
//! An opening with a fixed pressure or a fixed velocity returns every sound wave that reaches it, with a phase of π
//! or 0. Between two of them sound from the start of the flow continues until viscosity has damped it. An absorbing
//! opening responds to the plane wave at its face with the impedance ρc of the fluid, and returns slowly to its
//! target:
//!
//! d/dt [(p - P) - ρc (u - û)] = -K (p - P)   where the pressure P is imposed, u the mean velocity out of the domain,
//! d/dt [(v - U) + (p - P₀)/(ρc)] = -K (v - U)   where the velocity U is imposed, v the mean velocity into the domain,
//!
//! with K = σ c/L, L the length of the domain along the normal of the face. These are the locally one-dimensional
//! inviscid relations of Poinsot and Lele (1992, doi:10.1016/0021-9991(92)90046-2) with the relaxation of Rudy and
//! Strikwerda (1980, doi:10.1016/0021-9991(80)90174-6); Izquierdo and Fueyo (2008, doi:10.1103/PhysRevE.78.046707) used
//! them with the lattice Boltzmann method. A wave of frequency ω returns with the amplitude K/(K² + 4ω²)^½; a
//! steady state has p = P or v = U exactly, for any loss of pressure between the openings.
//!
//! *The mean over the face.* Only the mean of the face enters, and the same change of pressure or velocity acts on
//! all of it. In a channel sound between the ends is a plane wave; vortices and boundary layers, whose velocities
//! differ over the face, are not absorbed. An impedance in each cell would act on them with ρc u' instead of ρ U
//! u'. Waves across the channel are not absorbed.
//!
//! *The forecast.* If all other openings impose velocities, the mean velocity û out of the domain follows from
//! the balance of mass at any time. The opening then imposes the right incoming wave from the first step on, and a
//! start from rest settles to 1.3 % within 4 L/c. Without a forecast û is the velocity at the start.
//!
//! *On the lattice.* Of the populations f* that leave along the links of a face of area A the sum s = (1/A) Σ 2 f*
//! is p + ρu² + j, with the mass flux j out of the domain. With one of p and j imposed the other follows, and thus
//! the unknown of the step: the excess b of the density deviation over the imposed one, or the excess a of the
//! velocity. One number per patch is stored between steps: the left side without d/dt. Sums of integers make it
//! independent of the number of ranks.
//!
//! σ = 0.278 gives the strongest damping of the slowest wave between an absorbing opening and a reflecting one:
//! the roots of
//! -σ/(σ + z) = exp(z), z = 2 s L/c, meet at z = -1.278, a decay as exp(-0.639 c t/L).

use super::links::{FaceLink, LINKS_PER_THREAD, sums};
use super::{Inflow, Place, Ramp};
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::quanta::{from_quanta, quanta};
use base::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Behaviour of an opening for sound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sound {
    /// Lets plane waves out, and imposes the value as a mean over several transit times of sound through the domain.
    Absorb,
    /// Imposes the value at every step, which reflects sound.
    Reflect,
}

/// Relaxation rate times the transit time of sound through the domain.
const SIGMA: f64 = 0.278;
/// Speed of sound [cells per step].
const C: f64 = 0.577_350_269_189_625_8;

/// Quantity imposed by an opening.
#[derive(Clone, Copy, Debug)]
enum ImposedQuantity {
    Pressure,
    Velocity,
}

/// Five sums over the links of a patch, in quanta.
pub type Sums = [i128; 5];

/// Plane wave at a patch.
#[derive(Debug)]
pub(super) struct PlaneWave {
    asks: ImposedQuantity,
    /// Relaxation rate K per step.
    rate: f64,
    /// `true` if the imposed value applies at every step.
    reflects: bool,
    /// Value stored at the previous step; `None` before the first step.
    memory: Option<f64>,
    /// Excess of the density deviation (b) or of the velocity into the domain (a) in this step.
    excess: f64,
}

/// Mean velocity out of the domain that follows from the other openings at a step \[cells per step\].
pub(super) type Forecast = Box<dyn Fn(f64) -> f64 + Send + Sync>;

impl PlaneWave {
    /// Returns the wave of a face with an imposed pressure; `length` is that of the domain along its normal in
    /// cells.
    pub(super) fn at_pressure(length: f64) -> Self {
        Self::new(ImposedQuantity::Pressure, length)
    }

    /// Returns the wave of a face with an imposed velocity.
    pub(super) fn at_velocity(length: f64) -> Self {
        Self::new(ImposedQuantity::Velocity, length)
    }

    /// Returns the wave of a face whose mean pressure is imposed exactly at every step; only for
    /// [`Self::update_outflow_excess`].
    pub(super) fn reflected() -> Self {
        Self {
            reflects: true,
            ..Self::new(ImposedQuantity::Pressure, f64::INFINITY)
        }
    }

    fn new(asks: ImposedQuantity, length: f64) -> Self {
        Self {
            asks,
            rate: SIGMA * C / length,
            reflects: false,
            memory: None,
            excess: 0.0,
        }
    }

    /// Returns the excess of this step.
    pub(super) fn excess(&self) -> f64 {
        self.excess
    }

    pub(super) fn memory(&self) -> Option<f64> {
        self.memory
    }

    pub(super) fn recall(&mut self, memory: Option<f64>) {
        self.memory = memory;
    }

    /// Returns sums over the links of a rank: twice the leaving populations, the area, and a sum of the rule.
    /// Before the first step of an imposed velocity the first is the density deviation.
    pub(super) fn measure<S: Stored>(
        &self,
        links: &[FaceLink],
        third: i128,
        populations: &Populations<S>,
    ) -> Sums {
        let (parity, numbers) = (populations.parity(), populations.numbers());
        let velocities = populations.velocities();
        let begins = matches!((self.asks, self.memory), (ImposedQuantity::Velocity, None));
        let [first, second] = sums(links.len(), LINKS_PER_THREAD, |part| {
            let mut sums = [0; 2];
            for FaceLink { link, direction } in &links[part] {
                let area = 6.0 * velocities.w[*direction];
                let value = if begins {
                    let back = velocities.opposite[*direction];
                    let cell = link.near as usize - populations.slot(0, back);
                    area * populations.outgoing_moments(cell).0
                } else {
                    2.0 * numbers[link.out(parity)].to_f64()
                };
                sums[0] += i128::from(quanta(value));
                sums[1] += i128::from(quanta(area));
            }
            sums
        });
        [first, second, third, 0, 0]
    }

    /// Computes the excess of this step at an imposed density deviation from the sums of all ranks, the third of
    /// which is the square of the normal velocity in the rule; `forecast` is the velocity out of the domain.
    pub(super) fn update_pressure_excess(
        &mut self,
        sums: Sums,
        imposed: f64,
        forecast: Option<f64>,
    ) {
        let Some([mean, square, _]) = means(sums) else {
            return;
        };
        // The links let the mass flux j = s - δρ/3 - b/3 - q out, with q for u², and u = j/ρ; the pressure at the
        // face is b/3 + q - u².
        let flux = mean - imposed / 3.0 - square;
        let out = flux * (1.0 - imposed);
        let own = 3.0 * (square - out * out);
        let memory = self.memory.unwrap_or(match forecast {
            Some(_) => 0.0,
            None => own - 3.0 * C * out,
        });
        let slope = (1.0 + 3.0 * flux) * (C + 2.0 * out);
        let known = memory - own + 3.0 * C * (out - forecast.unwrap_or(0.0));
        self.excess = known / (1.0 + slope + self.rate);
        self.memory = Some(memory - self.rate * self.excess);
    }

    /// Computes the excess κ of this step at an outflow with an imposed mean density deviation from the sums of all
    /// ranks: leaving populations (a), area, square of the normal velocity (q), and populations that would enter
    /// without κ (b).
    ///
    /// The momentum through the face is a + b + κ = p + j²/(1 + 3 p), the mass flux j = a - b - κ. The plane wave
    /// has this pressure p and the velocity u = j/(1 + 3 p); the imposed pressure is a + b + κ - q, with the
    /// velocities of the profile: (p - P) - c (u - û) + K (a + b + κ - q - P) = the memory, linear in κ.
    pub(super) fn update_outflow_excess(
        &mut self,
        sums: Sums,
        imposed: f64,
        forecast: Option<f64>,
    ) {
        let Some([leaves, square, enters]) = means(sums) else {
            return;
        };
        let wanted = imposed / 3.0;
        let above = leaves + enters - square - wanted;
        if self.reflects {
            self.excess = -above;
            return;
        }
        let flux = leaves - enters;
        let of_density = 1.0 - 3.0 * flux * flux;
        let pressure = (leaves + enters - flux * flux) / of_density;
        let speed = flux * (1.0 - 3.0 * pressure);
        // Derivatives with respect to κ.
        let of_pressure = (1.0 + 2.0 * flux) / of_density;
        let of_speed = -(1.0 - 3.0 * pressure) - 3.0 * flux * of_pressure;
        let wave = pressure - wanted - C * (speed - forecast.unwrap_or(0.0));
        let memory = self.memory.unwrap_or(match forecast {
            Some(_) => 0.0,
            None => wave,
        });
        let known = memory - wave - self.rate * above;
        self.excess = known / (of_pressure + self.rate - C * of_speed);
        self.memory = Some(memory - self.rate * (above + self.excess));
    }

    /// Computes the excess of this step at an imposed velocity from the sums of all ranks.
    pub(super) fn update_velocity_excess(&mut self, sums: Sums) {
        let Some([mean, imposed, _]) = means(sums) else {
            return;
        };
        let Some(memory) = self.memory else {
            self.excess = 0.0;
            self.memory = Some(mean / 3.0);
            return;
        };
        // The entering mass flux is j = ρu: p = s + j - j². For a wave u' = j' - 3 u p', so that j' = -p' (1/c - 3
        // u).
        let p = mean + imposed - imposed * imposed;
        let admittance = 1.0 / C - 3.0 * imposed;
        let slope = admittance * (1.0 - 2.0 * imposed);
        self.excess = admittance * (memory - p) / (1.0 + slope + self.rate);
        self.memory = Some(memory - self.rate * self.excess / admittance);
    }
}

/// Returns the first, third and fourth sum divided by the area, which is the second.
fn means([first, area, third, fourth, _]: Sums) -> Option<[f64; 3]> {
    (area != 0).then(|| [first, third, fourth].map(|sum| from_quanta(sum) / from_quanta(area)))
}

/// Returns the mean velocity out of the domain that follows from imposed velocities; `None` if the flow through
/// other openings is free.
pub(super) fn forecast(place: &Place<'_>, units: &LatticeUnits) -> Option<Forecast> {
    let mut inflows = Vec::new();
    let mut free = 0;
    for opening in place.openings {
        match opening.inflow {
            Inflow::None => {}
            Inflow::Any => free += 1,
            Inflow::Mean(speed) => {
                let share = opening.area / place.area();
                inflows.push(Ramp {
                    start: 0.0,
                    end: units.velocity_to_lattice(speed) * share,
                    steps: units.time_to_lattice(opening.ramp_time),
                });
            }
        }
    }
    (free == 1).then(|| -> Forecast {
        Box::new(move |step| inflows.iter().map(|inflow| inflow.value_at(step)).sum())
    })
}

#[cfg(test)]
mod tests {
    use super::{C, Forecast, PlaneWave};
    use crate::boundary::convective_outflow::{self, Carried};
    use crate::boundary::{Patch, Rule, pressure, velocity};
    use crate::collision::{Operator, trt};
    use crate::fluid::{Fluid, Models, Setup};
    use crate::lattice::VelocitySet;
    use base::history::TimeTable;
    use base::number::{real, to_u32, whole};
    use decomposition::{Domain, SplitAxis};

    const LENGTH: usize = 400;

    fn length() -> f64 {
        real(LENGTH)
    }

    fn inlet(speed: f64, absorbs: bool) -> Box<dyn Rule<f64>> {
        let links = velocity::VelocityLinks::uniform([speed, 0.0, 0.0]);
        Box::new(if absorbs {
            links.absorbing(PlaneWave::at_velocity(length()))
        } else {
            links
        })
    }

    fn outlet(absorbs: bool, forecast: Option<Forecast>) -> Box<dyn Rule<f64>> {
        let links = pressure::PressureLinks::new(0, TimeTable::constant(0.0));
        Box::new(if absorbs {
            links.absorbing(PlaneWave::at_pressure(length()), forecast)
        } else {
            links
        })
    }

    /// Returns a duct without walls between two openings.
    fn duct(inlet: Box<dyn Rule<f64>>, outlet: Box<dyn Rule<f64>>, tau: f64) -> Fluid<f64> {
        let patch = |upper, rule| Patch {
            name: format!("{upper}"),
            axis: 0,
            upper,
            range: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
            rule,
        };
        let setup = Setup {
            periodic: [false, true, true],
            patches: vec![patch(false, inlet), patch(true, outlet)],
            ..Setup::new(
                Models::new(
                    VelocitySet::D2Q9,
                    Operator::Trt(trt::TrtParameters { magic: 3.0 / 16.0 }),
                ),
                tau,
                [LENGTH, 2, 1],
            )
        };
        Fluid::new(setup, &Domain::serial(SplitAxis::X, LENGTH, false)).unwrap()
    }

    /// Returns the largest amplitudes (density deviation) of the upstream and downstream waves relative to a flow
    /// of `speed`.
    fn waves(fluid: &Fluid<f64>, speed: f64) -> [f64; 2] {
        let mut largest = [0.0; 2];
        for x in 0..LENGTH {
            let cell = fluid.populations().cell([x.cast_signed(), 0, 0]);
            let (drho, u) = fluid.state(cell);
            let part = (u[0] - speed) / C;
            largest[0] = f64::max(largest[0], 0.5 * (drho - part).abs());
            largest[1] = f64::max(largest[1], 0.5 * (drho + part).abs());
        }
        largest
    }

    /// Returns the number of steps in which sound crosses the duct.
    fn passage() -> u32 {
        to_u32(whole(length() / C) + 1)
    }

    const AMPLITUDE: f64 = 1e-4;

    /// Returns the fraction of a wave packet that an opening reflects.
    fn returned(mut fluid: Fluid<f64>, speed: f64, wavelength: f64, downstream: bool) -> f64 {
        let sign = if downstream { 1.0 } else { -1.0 };
        let width = wavelength.min(0.1 * length());
        fluid.initialise(&|p: [f64; 3]| {
            let x = p[0] - 0.5 * length();
            let group = (-0.5 * (x / width).powi(2)).exp();
            let wave = AMPLITUDE * group * (std::f64::consts::TAU * x / wavelength).sin();
            (wave, [speed + sign * C * wave, 0.0, 0.0])
        });
        let begun = waves(&fluid, speed)[usize::from(downstream)];
        for _ in 0..passage() {
            fluid.advance();
        }
        waves(&fluid, speed)[usize::from(!downstream)] / begun
    }

    /// Committed table of reflection coefficients at normal incidence.
    const TABLE: &str = include_str!("../../../benches/accuracy/sound/returned.csv");

    /// Measures the reflection again and compares it with the table.
    #[test]
    fn sound_leaves_through_openings_that_absorb() {
        let (mut text, mut others) = (TABLE.lines().next().unwrap().to_owned(), Vec::new());
        for row in TABLE.lines().skip(1) {
            let cells: Vec<&str> = row.split(',').collect();
            let number = |n: usize| cells[n].parse::<f64>().unwrap();
            let (tau, speed, wavelength) = (number(0), number(1), number(2));
            let out = |absorbs| {
                let fluid = duct(inlet(speed, false), outlet(absorbs, None), tau);
                returned(fluid, speed, wavelength, true)
            };
            let into = |absorbs| {
                let fluid = duct(inlet(speed, absorbs), outlet(false, None), tau);
                returned(fluid, speed, wavelength, false)
            };
            let found = [out(true), out(false), into(true), into(false)];
            text += &format!("\n{}", cells[..3].join(","));
            for (n, found) in found.into_iter().enumerate() {
                text += &format!(",{found:.4}");
                if (found - number(3 + n)).abs() > 1e-4 {
                    others.push(row);
                }
            }
            // Water of small viscosity, and waves of at most a fifth of the domain.
            if tau < 1.0 && wavelength <= 0.2 * length() {
                assert!(found[0] < 0.01 && found[2] < 0.01, "{row}: {found:?}");
            }
        }
        println!("{text}");
        assert_eq!(others, Vec::<&str>::new());
    }

    /// Returns an outflow with an imposed mean pressure equal to the reference.
    fn holding(carried: Carried, forecast: Option<Forecast>) -> Box<dyn Rule<f64>> {
        let links = convective_outflow::ConvectiveOutflowLinks::new((0, true), carried);
        let wave = PlaneWave::at_pressure(length());
        Box::new(links.holding(wave, TimeTable::constant(0.0), forecast))
    }

    /// Checks that each outflow with an imposed mean pressure reflects less than 1 % of waves of at most a fifth of the
    /// domain.
    #[test]
    fn sound_leaves_through_outflows() {
        for carried in [Carried::Local, Carried::Whole, Carried::Given(0.05)] {
            for (tau, speed) in [(0.501, 0.0), (0.51, 0.05), (0.55, 0.1), (0.8, 0.02)] {
                for wavelength in [20.0, 40.0, 80.0] {
                    let fluid = duct(inlet(speed, false), holding(carried, None), tau);
                    let back = returned(fluid, speed, wavelength, true);
                    assert!(
                        back < 0.01,
                        "{carried:?} {tau} {speed} {wavelength}: {back}"
                    );
                }
            }
        }
    }

    /// Checks that water without friction between a pressure by table and a constant one has the momentum ∫ Δp dt per
    /// area, after rises, rests and a jump.
    #[test]
    fn a_pressure_by_table_gives_the_impulse_of_its_table() {
        const DEVIATION: f64 = 6e-5;
        let rows = [
            [1000.0, 0.0],
            [4000.0, DEVIATION],
            [8000.0, DEVIATION],
            [8000.0, -0.5 * DEVIATION],
            [11000.0, 0.0],
        ];
        let table = TimeTable::new(Some(&rows), 0.0);
        let driven = pressure::PressureLinks::new(0, table.clone());
        let mut fluid = duct(Box::new(driven), outlet(false, None), 0.51);
        fluid.initialise(&|_| (0.0, [0.0; 3]));
        for until in [4000, 8000, 12000_u32] {
            while fluid.steps() < u64::from(until) {
                fluid.advance();
            }
            let speed = |x: usize| {
                let cell = fluid.populations().cell([x.cast_signed(), 0, 0]);
                fluid.state(cell).1[0]
            };
            let mean = (0..LENGTH).map(speed).sum::<f64>() / length();
            let time = f64::from(until);
            let exact = table.mean(0.0, time) * time / 3.0 / length();
            assert!(
                (mean / exact - 1.0).abs() < 0.01,
                "{until}: {mean}, {exact}"
            );
        }
    }

    /// Checks that a start from rest settles as with an absorbing pressure, to the imposed pressure and velocity.
    #[test]
    fn a_start_before_an_outflow_settles() {
        const SPEED: f64 = 0.01;
        for carried in [Carried::Local, Carried::Whole] {
            let forecast: Forecast = Box::new(|_| SPEED);
            let mut fluid = duct(inlet(SPEED, false), holding(carried, Some(forecast)), 1.5);
            for _ in 0..16 * passage() {
                fluid.advance();
            }
            let [a, b] = waves(&fluid, SPEED);
            assert!(a.max(b) * C / SPEED < 2e-3, "{carried:?} {a} {b}");
        }
    }

    /// Returns the largest deviation from the steady flow after each passage of sound, for a start from rest.
    fn start(absorbs: [bool; 2], foreseen: bool) -> (Fluid<f64>, Vec<f64>) {
        const SPEED: f64 = 0.01;
        let forecast = foreseen.then(|| -> Forecast { Box::new(|_| SPEED) });
        let mut fluid = duct(inlet(SPEED, absorbs[0]), outlet(absorbs[1], forecast), 1.5);
        let left = (0..16).map(|_| {
            for _ in 0..passage() {
                fluid.advance();
            }
            let [a, b] = waves(&fluid, SPEED);
            a.max(b) * C / SPEED
        });
        let left = left.collect();
        (fluid, left)
    }

    #[test]
    fn a_start_settles() {
        let (_, rings) = start([false, false], false);
        let (_, settles) = start([false, true], false);
        let (fluid, foreseen) = start([false, true], true);
        println!("rings {rings:.3?}\nsettles {settles:.4?}\nforeseen {foreseen:.4?}");
        assert!(rings[15] > 0.3);
        // Decay exp(-0.639 c t/L) of a double root.
        assert!(settles[15] < 2e-3 && settles[8] < 0.05, "{settles:?}");
        assert!(foreseen[3] < 0.015 && foreseen[7] < 7e-3, "{foreseen:?}");
        // The steady state is the imposed one, and the stored value is the only lasting state.
        let memory = fluid.memories().flatten().next().unwrap();
        assert!(memory.abs() < 1e-3, "{memory}");
        let (_, both) = start([true, true], true);
        // At an absorbing inlet the velocity rises from zero as slowly as it returns to its target.
        assert!(both[1] < 0.1 && both[15] < 0.02, "{both:?}");
    }
}
