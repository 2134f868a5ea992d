//! Links of a network in a stage: their response to the pressures, their discharges and modes.

use super::{Channel, FlowSettings, JointFlow, LinkResponse};
use crate::friction::{Turbulence, cube, inertial, rough};
use crate::network::{End, Link, Network};
use crate::slot::{MODES, Modes};

/// Returns the ends of a link: two nodes, or a node and an open piece.
pub(super) fn ends(link: &Link) -> [u32; 2] {
    let to = match link.to {
        End::Node(number) | End::Open(number) => number,
    };
    [link.from, to].map(|number| u32::try_from(number).unwrap_or(u32::MAX))
}

/// Returns the weight of the water between the ends of each link, positive along the link \[Pa\].
pub(super) fn lifts(network: &Network, settings: &FlowSettings) -> Vec<f64> {
    let density = settings.water.mixture_density();
    let lift = |link: &Link| {
        let end = match link.to {
            End::Node(node) => network.positions[node],
            End::Open(piece) => network.open[piece].middle,
        };
        density * settings.gravity.dot(&(end - network.positions[link.from]))
    };
    network.links.iter().map(lift).collect()
}

/// Returns the sum of the products of the numbers of modes, in four partial sums.
fn sum_over_modes(one: &[f64; MODES], other: &[f64; MODES]) -> f64 {
    let mut sums = [0.0; 4];
    for mode in 0..MODES {
        sums[mode % 4] += one[mode] * other[mode];
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Returns the parts of the modes that a stage leaves, for the product of its duration and the rate of the modes, and
/// the sum of these parts with the weights of the modes.
fn decays(modes: &Modes, rate: f64) -> ([f64; MODES], f64) {
    let mut decays = [0.0; MODES];
    for (decay, own) in decays.iter_mut().zip(&modes.rates) {
        *decay = 1.0 / (1.0 + rate * own);
    }
    (decays, sum_over_modes(&modes.weights, &decays))
}

impl JointFlow {
    /// Returns the coefficients of a link at the present gaps.
    pub(super) fn channel(&self, link: usize) -> Channel {
        let network = &self.network;
        let link = &network.links[link];
        let (water, gap) = (&self.settings.water, &self.gaps[link.joint]);
        let apertures = link
            .path
            .map(|at| gap.value(&at).max(network.settings.residual_aperture));
        let (cube, inertial) = (cube(apertures), inertial(apertures));
        let density = water.mixture_density();
        let per_width = 12.0 * water.viscosity * link.length / cube;
        let turbulence = match self.settings.roughness {
            Some(roughness) => Turbulence {
                reynolds: 2.0 * density / (water.viscosity * link.width),
                scale: density * link.length / (4.0 * link.width * link.width * cube),
                rough: rough(roughness, cube.cbrt()),
            },
            None => Turbulence::default(),
        };
        Channel {
            resistance: per_width / link.width,
            gain: link.width * inertial / (density * link.length),
            rate: 4.0 * water.viscosity / density * inertial / cube,
            turbulence,
        }
    }

    /// Returns the increase of the pressure at the end of a link per discharge [Pa s/m³].
    fn outside(&self, link: usize) -> f64 {
        if link < self.inner {
            return 0.0;
        }
        self.work.outside[self.ends[link][1] as usize]
    }

    /// Computes the responses of all links for a stage of this duration \[s\] from the initial modes.
    pub(super) fn prepare_answers(&mut self, interval: f64) {
        if self.decays_of != Some(interval) {
            for link in 0..self.channels.len() {
                self.set_decays(link, interval);
            }
            self.decays_of = Some(interval);
        }
        for link in 0..self.channels.len() {
            self.work.answers[link] = self.answer(link);
        }
    }

    /// Computes the responses of links whose channels have changed.
    pub(super) fn renew_answers(&mut self, links: &[usize], interval: f64) {
        for &link in links {
            self.channels[link] = self.channel(link);
            self.set_decays(link, interval);
            self.work.answers[link] = self.answer(link);
        }
    }

    /// Sets the responses of all links to those of steady flow.
    pub(super) fn answer_steadily(&mut self) {
        let channels = self.channels.iter().zip(&self.lifts);
        for (answer, (channel, lift)) in self.work.answers.iter_mut().zip(channels) {
            let slope = 1.0 / channel.resistance;
            *answer = LinkResponse {
                free: slope * lift,
                slope,
            };
        }
    }

    /// Computes the parts of the modes of a link that a stage of this duration \[s\] leaves, and its response.
    fn set_decays(&mut self, link: usize, interval: f64) {
        let channel = &self.channels[link];
        if !self.settings.inertia {
            self.slopes[link] = 1.0 / channel.resistance;
            return;
        }
        let (decays, sum) = decays(&self.modes, interval * channel.rate);
        self.decays[link] = decays;
        self.slopes[link] = sum * interval * channel.gain;
    }

    /// Returns the response of a link in a stage.
    fn answer(&self, link: usize) -> LinkResponse {
        let mut slope = self.slopes[link];
        let mut free = if self.settings.inertia {
            sum_over_modes(&self.mode[link], &self.decays[link])
        } else {
            0.0
        };
        let resistance = self.outside(link);
        if resistance > 0.0 {
            let part = 1.0 / (1.0 + slope * resistance);
            free *= part;
            slope *= part;
        }
        free += slope * self.lifts[link];
        LinkResponse { free, slope }
    }

    /// Returns the pressure at the start of a link minus that at its end, without the weight of the water \[Pa\];
    /// `None` if its end is closed.
    fn difference(&self, link: usize, pressure: &[f64]) -> Option<f64> {
        let [from, to] = self.ends[link].map(|end| end as usize);
        let end = if link < self.inner {
            pressure[to]
        } else {
            self.work.fronts[to]?
        };
        Some(pressure[from] - end)
    }

    /// Returns the discharge of a link and its derivative with respect to the driving pressure; zeros if its end is
    /// closed.
    pub(super) fn discharge_of(&self, link: usize, pressure: &[f64]) -> (f64, f64) {
        let Some(difference) = self.difference(link, pressure) else {
            return (0.0, 0.0);
        };
        let (answer, channel) = (self.work.answers[link], &self.channels[link]);
        let laminar = answer.free + answer.slope * difference;
        let law = &channel.turbulence;
        let (discharge, part) = law.discharge(laminar, answer.slope, channel.resistance);
        (discharge, part * answer.slope)
    }

    /// Computes the discharges of all links at these pressures.
    pub(super) fn set_discharges(&mut self, pressure: &[f64]) {
        let mut discharges = std::mem::take(&mut self.discharge);
        if self.settings.roughness.is_some() {
            for (link, discharge) in discharges.iter_mut().enumerate() {
                *discharge = self.discharge_of(link, pressure).0;
            }
            self.discharge = discharges;
            return;
        }
        let (inner, outer) = discharges.split_at_mut(self.inner);
        let answers = self.work.answers.iter().zip(&self.ends);
        for (discharge, (answer, [from, to])) in inner.iter_mut().zip(answers) {
            let difference = pressure[*from as usize] - pressure[*to as usize];
            *discharge = answer.free + answer.slope * difference;
        }
        let answers = self.work.answers.iter().zip(&self.ends).skip(self.inner);
        for (discharge, (answer, [from, piece])) in outer.iter_mut().zip(answers) {
            *discharge = self.work.fronts[*piece as usize].map_or(0.0, |front| {
                answer.free + answer.slope * (pressure[*from as usize] - front)
            });
        }
        self.discharge = discharges;
    }

    /// Computes the modes from the pressures and discharges of the end of a stage. If another stage follows, it begins
    /// with the modes before this one and a number of times their change.
    pub(super) fn set_modes(&mut self, interval: f64, carried: Option<f64>) {
        if !self.settings.inertia {
            return;
        }
        let mut modes = std::mem::take(&mut self.mode);
        let weights = &self.modes.weights;
        for (link, modes) in modes.iter_mut().enumerate() {
            let (channel, discharge) = (&self.channels[link], self.discharge[link]);
            let (excess, _) = channel
                .turbulence
                .excess(discharge.abs(), channel.resistance);
            let lost = excess.copysign(discharge) + self.outside(link) * discharge;
            let difference = self.difference(link, &self.pressure);
            let drive = difference.map_or(0.0, |difference| difference + self.lifts[link] - lost);
            let gain = interval * channel.gain * drive;
            let decays = &self.decays[link];
            let after = |mode: usize, before: f64| (before + gain * weights[mode]) * decays[mode];
            if let Some(carried) = carried {
                for mode in 0..MODES {
                    modes[mode] += carried * (after(mode, modes[mode]) - modes[mode]);
                }
            } else {
                for mode in 0..MODES {
                    modes[mode] = after(mode, modes[mode]);
                }
            }
        }
        self.mode = modes;
    }

    /// Sets the modes of all links to those of the present discharges in steady flow.
    pub(super) fn set_steady_modes(&mut self) {
        let links = self.channels.iter().zip(&self.discharge);
        for (modes, (channel, discharge)) in self.mode.iter_mut().zip(links) {
            // In the steady state the modes share the discharge in proportion to their conductances.
            let groups = self.modes.weights.iter().zip(&self.modes.rates);
            for (mode, (weight, rate)) in modes.iter_mut().zip(groups) {
                let conductance = channel.gain * weight / (channel.rate * rate);
                *mode = discharge * channel.resistance * conductance;
            }
        }
    }
}
