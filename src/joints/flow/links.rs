//! Links of a network in a stage: their response to the pressures, their discharges and modes.

use super::{Channel, FlowSettings, JointFlow, LinkResponse, LinkShape, Links};
use crate::friction::{Turbulence, cube, inertial, rough};
use crate::network::{End, Link, Network};
use crate::slot::{MODES, Modes};
use base::thread_pool::{each_of, evenly, threads};

/// Returns the ends of a link: two nodes, or a node and an open piece.
fn ends(link: &Link) -> [u32; 2] {
    let to = match link.to {
        End::Node(number) | End::Open(number) => number,
    };
    [link.from, to].map(|number| u32::try_from(number).unwrap_or(u32::MAX))
}

/// Returns the weight of the water between the ends of each link, positive along the link \[Pa\].
fn lifts(network: &Network, settings: &FlowSettings) -> Vec<f64> {
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

/// Returns the links of a network with the properties of the water.
fn shapes(network: &Network, settings: &FlowSettings) -> Vec<LinkShape> {
    let (viscosity, density) = (settings.water.viscosity, settings.water.mixture_density());
    let shape = |link: &Link| LinkShape {
        joint: link.joint,
        path: link.path,
        resistance: 12.0 * viscosity * link.length / link.width,
        gain: link.width / (density * link.length),
    };
    network.links.iter().map(shape).collect()
}

/// Number of partial sums over modes.
const SUMS: usize = 4;
/// Minimum number of links of a thread.
const LINKS_OF_THREAD: usize = 1500;

/// Returns the number of pieces of work for a number of links.
fn pieces(links: usize) -> usize {
    threads().min(links / LINKS_OF_THREAD).max(1)
}

/// Returns the sum over the modes of the discharge that a stage leaves of their present discharges, and of their
/// weights. `rate` is the product of the duration of the stage and the rate of the modes.
#[inline]
fn respond(modes: &Modes, mode: &[f64; MODES], rate: f64) -> [f64; 2] {
    let mut sums = [[0.0; SUMS]; 2];
    for first in (0..MODES).step_by(SUMS) {
        for k in 0..SUMS {
            let left = 1.0 / (1.0 + rate * modes.rates[first + k]);
            sums[0][k] += mode[first + k] * left;
            sums[1][k] += modes.weights[first + k] * left;
        }
    }
    sums.map(|sums| (sums[0] + sums[1]) + (sums[2] + sums[3]))
}

impl Links {
    /// Returns the links of a network without flow, whose channels are computed later.
    pub(super) fn new(network: &Network, settings: &FlowSettings) -> Self {
        let links = network.links.len();
        let modes = if settings.inertia { links } else { 0 };
        let rough = if settings.roughness.is_some() {
            links
        } else {
            0
        };
        Self {
            ends: network.links.iter().map(ends).collect(),
            inner: links - network.open.len(),
            lifts: lifts(network, settings),
            shapes: shapes(network, settings),
            relaxation: 4.0 * settings.water.viscosity / settings.water.mixture_density(),
            channels: vec![Channel::default(); links],
            turbulences: vec![Turbulence::default(); rough],
            mode: vec![[0.0; MODES]; modes],
            responses: vec![LinkResponse::default(); links],
            responses_of: None,
            discharge: vec![0.0; links],
        }
    }
}

impl JointFlow {
    /// Returns the coefficients of a link at the gap that its channel follows.
    pub(super) fn channel(&self, link: usize) -> Channel {
        let shape = &self.links.shapes[link];
        let gap = &self.walls.followed[shape.joint];
        let residual = self.network.settings.residual_aperture;
        let [from, to] = &shape.path;
        let apertures = [gap.value(from).max(residual), gap.value(to).max(residual)];
        let (cube, inertial) = (cube(apertures), inertial(apertures));
        Channel {
            resistance: shape.resistance / cube,
            gain: shape.gain * inertial,
            rate: self.links.relaxation * inertial / cube,
        }
    }

    /// Returns the coefficients of turbulent friction of a link at the gap that its channel follows; those of laminar
    /// flow without a roughness.
    pub(super) fn turbulence(&self, link: usize) -> Turbulence {
        let Some(roughness) = self.settings.roughness else {
            return Turbulence::default();
        };
        let width = self.network.links[link].width;
        let water = &self.settings.water;
        let shape = &self.links.shapes[link];
        let cube = shape.resistance / self.channel(link).resistance;
        Turbulence {
            reynolds: 2.0 * water.mixture_density() / (water.viscosity * width),
            scale: 1.0 / (4.0 * width * shape.gain * cube),
            rough: rough(roughness, cube.cbrt()),
        }
    }

    /// Updates the coefficients of a link.
    pub(super) fn set_channel(&mut self, link: usize) {
        self.links.channels[link] = self.channel(link);
        if self.settings.roughness.is_some() {
            self.links.turbulences[link] = self.turbulence(link);
        }
    }

    /// Returns the increase of the pressure at the end of a link per discharge [Pa s/m³].
    fn outside(&self, link: usize) -> f64 {
        if link < self.links.inner {
            return 0.0;
        }
        self.work.outside[self.links.ends[link][1] as usize]
    }

    /// Computes the responses of all links for a stage of this duration \[s\] from the initial modes.
    pub(super) fn prepare_answers(&mut self, interval: f64) {
        if self.links.responses_of != Some(interval) {
            for link in 0..self.links.channels.len() {
                self.links.responses[link] =
                    self.response(link, &self.links.channels[link], interval);
            }
            self.links.responses_of = Some(interval);
        }
        for link in 0..self.links.channels.len() {
            self.work.answers[link] = self.answer(link, self.links.responses[link]);
        }
    }

    /// Computes the channels of the links in joints that have moved, and their responses.
    pub(super) fn renew_answers(&mut self, interval: f64) {
        let mut channels = std::mem::take(&mut self.links.channels);
        let mut answers = std::mem::take(&mut self.work.answers);
        let mut responses = std::mem::take(&mut self.links.responses);
        let mut turbulences = std::mem::take(&mut self.links.turbulences);
        let (count, rough) = (channels.len(), !turbulences.is_empty());
        let pieces = pieces(count);
        let shared = (
            evenly(&mut channels, pieces),
            evenly(&mut answers, pieces),
            evenly(&mut responses, pieces),
            evenly(&mut turbulences, pieces),
        );
        each_of(
            pieces,
            shared,
            |piece, (channels, answers, responses, turbulences)| {
                let links = channels.iter_mut().zip(answers).zip(responses).enumerate();
                for (at, ((channel, answer), response)) in links {
                    let link = count * piece / pieces + at;
                    if !self.walls.renews[self.links.shapes[link].joint] {
                        continue;
                    }
                    *channel = self.channel(link);
                    *response = self.response(link, channel, interval);
                    *answer = self.answer(link, *response);
                    if rough {
                        turbulences[at] = self.turbulence(link);
                    }
                }
            },
        );
        self.links.responses = responses;
        self.links.channels = channels;
        self.work.answers = answers;
        self.links.turbulences = turbulences;
    }

    /// Sets the responses of all links to those of steady flow.
    pub(super) fn answer_steadily(&mut self) {
        let channels = self.links.channels.iter().zip(&self.links.lifts);
        for (answer, (channel, lift)) in self.work.answers.iter_mut().zip(channels) {
            let slope = 1.0 / channel.resistance;
            *answer = LinkResponse {
                free: slope * lift,
                slope,
            };
        }
    }

    /// Returns the response of a link to the pressures in a stage of this duration \[s\], without the weight of the
    /// water and the water outside.
    fn response(&self, link: usize, channel: &Channel, interval: f64) -> LinkResponse {
        if !self.settings.inertia {
            return LinkResponse {
                free: 0.0,
                slope: 1.0 / channel.resistance,
            };
        }
        let [free, sum] = respond(&self.modes, &self.links.mode[link], interval * channel.rate);
        LinkResponse {
            free,
            slope: sum * interval * channel.gain,
        }
    }

    /// Returns the response of a link with the weight of the water and the water outside.
    fn answer(&self, link: usize, response: LinkResponse) -> LinkResponse {
        let LinkResponse {
            mut free,
            mut slope,
        } = response;
        let resistance = self.outside(link);
        if resistance > 0.0 {
            let part = 1.0 / (1.0 + slope * resistance);
            free *= part;
            slope *= part;
        }
        free += slope * self.links.lifts[link];
        LinkResponse { free, slope }
    }

    /// Returns the pressure at the start of a link minus that at its end, without the weight of the water \[Pa\];
    /// `None` if its end is closed.
    fn difference(&self, link: usize, pressure: &[f64]) -> Option<f64> {
        let [from, to] = self.links.ends[link].map(|end| end as usize);
        let end = if link < self.links.inner {
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
        let answer = self.work.answers[link];
        let laminar = answer.free + answer.slope * difference;
        let Some(law) = self.links.turbulences.get(link) else {
            return (laminar, answer.slope);
        };
        let resistance = self.links.channels[link].resistance;
        let (discharge, part) = law.discharge(laminar, answer.slope, resistance);
        (discharge, part * answer.slope)
    }

    /// Computes the discharges of all links at these pressures.
    pub(super) fn set_discharges(&mut self, pressure: &[f64]) {
        let mut discharges = std::mem::take(&mut self.links.discharge);
        if self.settings.roughness.is_some() {
            for (link, discharge) in discharges.iter_mut().enumerate() {
                *discharge = self.discharge_of(link, pressure).0;
            }
            self.links.discharge = discharges;
            return;
        }
        let (inner, outer) = discharges.split_at_mut(self.links.inner);
        let answers = self.work.answers.iter().zip(&self.links.ends);
        for (discharge, (answer, [from, to])) in inner.iter_mut().zip(answers) {
            let difference = pressure[*from as usize] - pressure[*to as usize];
            *discharge = answer.free + answer.slope * difference;
        }
        let answers = self
            .work
            .answers
            .iter()
            .zip(&self.links.ends)
            .skip(self.links.inner);
        for (discharge, (answer, [from, piece])) in outer.iter_mut().zip(answers) {
            *discharge = self.work.fronts[*piece as usize].map_or(0.0, |front| {
                answer.free + answer.slope * (pressure[*from as usize] - front)
            });
        }
        self.links.discharge = discharges;
    }

    /// Computes the modes from the pressures and discharges of the end of a stage. If another stage follows, it begins
    /// with the modes before this one and a number of times their change.
    pub(super) fn set_modes(&mut self, interval: f64, carried: Option<f64>) {
        if !self.settings.inertia {
            return;
        }
        let mut modes = std::mem::take(&mut self.links.mode);
        let mut responses = std::mem::take(&mut self.links.responses);
        let count = modes.len();
        let pieces = pieces(count);
        let shared = (evenly(&mut modes, pieces), evenly(&mut responses, pieces));
        each_of(pieces, shared, |piece, (modes, responses)| {
            let links = modes.iter_mut().zip(responses).enumerate();
            for (at, (modes, response)) in links {
                let link = count * piece / pieces + at;
                response.free = self.end_modes(link, interval, carried, modes);
            }
        });
        self.links.mode = modes;
        self.links.responses = responses;
    }

    /// Computes the modes of a link at the end of a stage ([`Self::set_modes`]); returns the discharge that they leave
    /// in the next one, if the walls stay where they are.
    fn end_modes(
        &self,
        link: usize,
        interval: f64,
        carried: Option<f64>,
        modes: &mut [f64; MODES],
    ) -> f64 {
        let Modes { weights, rates } = &self.modes;
        let (channel, discharge) = (&self.links.channels[link], self.links.discharge[link]);
        let mut lost = self.outside(link) * discharge;
        if let Some(law) = self.links.turbulences.get(link) {
            let (excess, _) = law.excess(discharge.abs(), channel.resistance);
            lost += excess.copysign(discharge);
        }
        let difference = self.difference(link, &self.pressure);
        let drive = difference.map_or(0.0, |difference| difference + self.links.lifts[link] - lost);
        let gain = interval * channel.gain * drive;
        let rate = interval * channel.rate;
        let mut sums = [0.0; SUMS];
        for first in (0..MODES).step_by(SUMS) {
            for k in 0..SUMS {
                let (mode, weight) = (&mut modes[first + k], weights[first + k]);
                let left = 1.0 / (1.0 + rate * rates[first + k]);
                let after = (*mode + gain * weight) * left;
                *mode = carried.map_or(after, |carried| *mode + carried * (after - *mode));
                sums[k] += *mode * left;
            }
        }
        (sums[0] + sums[1]) + (sums[2] + sums[3])
    }

    /// Sets the modes of all links to those of the present discharges in steady flow.
    pub(super) fn set_steady_modes(&mut self) {
        let links = self.links.channels.iter().zip(&self.links.discharge);
        for (modes, (channel, discharge)) in self.links.mode.iter_mut().zip(links) {
            // In the steady state the modes share the discharge in proportion to their conductances.
            let groups = self.modes.weights.iter().zip(&self.modes.rates);
            for (mode, (weight, rate)) in modes.iter_mut().zip(groups) {
                let conductance = channel.gain * weight / (channel.rate * rate);
                *mode = discharge * channel.resistance * conductance;
            }
        }
    }
}
