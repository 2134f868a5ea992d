//! Turbulence that enters with a prescribed velocity: synthetic fluctuations ([`crate::synthetic`]) over the mean
//! profile.
//!
//! u(x, t) = U(x) + I |U(x)| u'(x - U_b t n)
//!
//! A frozen field u' of unit root mean square is carried through the face with the mean U_b of the profile along
//! the inward normal n (Taylor 1938), so that the intensity is I everywhere and walls remain stationary. The rule
//! adds -6 w_i c_i·(u - U) to the result of [`super::wall`], with u' and U at the point where the link crosses the
//! face. With their values at the centre of the cell's face for all links, the error would be of first order: a
//! tenth of the intensity at L = 6 cells.
//!
//! The flux through the whole face fluctuates too, by about I U_b times the root of the number of eddies over the face:
//! the fluid responds with sound, which an outflow should absorb.
//!
//! Cost: the phase of a wave is a sum over the axes, so that cosines are computed once for rows and columns of
//! the face, followed by two multiplications for each point where links cross. Each cell has four or fewer of these
//! points, because adjacent cells share them.

use super::links::{LINKS_PER_THREAD, each_part};
use crate::lanes::Stored;
use crate::populations::{Link, Populations};
use crate::synthetic::Modes;
use base::thread_pool;
use std::collections::BTreeMap;

/// Fluctuating velocity at a face.
pub struct Synthetic {
    /// Frozen field of velocities.
    pub modes: Modes,
    /// Root mean square of each component divided by the mean speed.
    pub intensity: f64,
    /// Velocity with which the field is carried into the domain \[cells per step\].
    pub speed: f64,
}

#[derive(Clone, Copy, Debug)]
struct InletLink {
    link: Link,
    /// Term 6 w_i c_i I |U|.
    term: [f64; 3],
    /// Index of the crossing point.
    place: usize,
}

/// Points where links cross the face.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Twice the coordinates along the two axes of the face.
    at: [usize; 2],
    /// Fluctuation u' in this step.
    velocity: [f64; 3],
}

/// Complex number as real and imaginary part.
type Turn = [f64; 2];

fn turn(angle: f64) -> Turn {
    let (sin, cos) = angle.sin_cos();
    [cos, sin]
}

fn product(a: Turn, b: Turn) -> Turn {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// Minimum number of crossing points per thread.
const PLACES_PER_THREAD: usize = 20;

/// Patch with its links in a slab.
#[derive(Debug)]
pub(crate) struct Inlet {
    places: Vec<Place>,
    known: BTreeMap<[usize; 2], usize>,
    links: Vec<InletLink>,
    /// Phase on the face at the start and its change in a step, for each wave.
    time: Vec<[f64; 2]>,
    amplitudes: Vec<[f64; 3]>,
    /// Values of exp(i k x) along the two axes of the face, for each half cell and wave.
    across: [Vec<Turn>; 2],
    /// Values along the second axis, multiplied by the present phase.
    now: Vec<Turn>,
    axes: [usize; 2],
}

impl Inlet {
    pub(super) fn new(
        (axis, upper): (usize, bool),
        synthetic: &Synthetic,
        cells: [usize; 3],
    ) -> Self {
        let waves = synthetic.modes.list();
        let axes = [usize::from(axis == 0), 2 - usize::from(axis == 2)];
        #[expect(clippy::cast_precision_loss, reason = "cell counts are far below 2^53")]
        let turns = |a: usize| -> Vec<Turn> {
            (0..=2 * cells[a])
                .flat_map(|n| {
                    waves
                        .iter()
                        .map(move |mode| turn(mode.wave[a] * 0.5 * n as f64))
                })
                .collect()
        };
        #[expect(clippy::cast_precision_loss, reason = "cell counts are far below 2^53")]
        let (face, inward) = if upper {
            (cells[axis] as f64, -1.0)
        } else {
            (0.0, 1.0)
        };
        let carried = synthetic.speed * inward;
        let across = axes.map(turns);
        Self {
            places: Vec::new(),
            known: BTreeMap::new(),
            links: Vec::new(),
            time: waves
                .iter()
                .map(|mode| {
                    let wave = mode.wave[axis];
                    [mode.phase + wave * face, -wave * carried]
                })
                .collect(),
            amplitudes: waves.iter().map(|mode| mode.amplitude).collect(),
            now: across[1].clone(),
            across,
            axes,
        }
    }

    /// Adds a link of a cell of the whole domain along `c`; `strength` is I |U| at the crossing point.
    pub(super) fn add(
        &mut self,
        cell: [usize; 3],
        strength: f64,
        link: Link,
        weight: f64,
        c: [i8; 3],
    ) {
        let at = self
            .axes
            .map(|a| (2 * cell[a] + 1).wrapping_add_signed(isize::from(c[a])));
        let places = &mut self.places;
        let place = *self.known.entry(at).or_insert_with(|| {
            places.push(Place {
                at,
                velocity: [0.0; 3],
            });
            places.len() - 1
        });
        let term = c.map(|c| 6.0 * weight * strength * f64::from(c));
        self.links.push(InletLink { link, term, place });
    }

    /// Adds the fluctuations of a step; `factor` is the factor of the ramp.
    pub(super) fn apply<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
        step: f64,
        factor: f64,
    ) {
        let waves = self.time.len();
        for (wave, [phase, rate]) in self.time.iter().enumerate() {
            let present = turn(phase + rate * step);
            let places = self.now.iter_mut().zip(&self.across[1]).skip(wave);
            for (now, &fixed) in places.step_by(waves) {
                *now = product(fixed, present);
            }
        }
        let mut places = std::mem::take(&mut self.places);
        thread_pool::each_item(&mut places, PLACES_PER_THREAD, |_, place| {
            let [a, b] = place.at.map(|at| at * waves);
            place.velocity = self.velocity(a, b).map(|u| u * factor);
        });
        self.places = places;
        let parity = populations.parity();
        let count = self.links.len();
        each_part(count, LINKS_PER_THREAD, populations, |part, numbers| {
            for link in &self.links[part] {
                let ([x, y, z], u) = (link.term, self.places[link.place].velocity);
                // SAFETY: a position in the slab, of this link alone.
                unsafe {
                    let number = numbers.add(link.link.incoming(parity));
                    let value = number.read().to_f64() - (x * u[0] + y * u[1] + z * u[2]);
                    number.write(S::from_f64(value));
                }
            }
        });
    }

    /// Returns u' for waves with the values from index `a` on along the first axis and from `b` on along the
    /// second.
    fn velocity(&self, a: usize, b: usize) -> [f64; 3] {
        let waves = self.time.len();
        let mut u = [0.0; 3];
        let turns = self.across[0][a..a + waves]
            .iter()
            .zip(&self.now[b..b + waves]);
        for ((first, second), amplitude) in turns.zip(&self.amplitudes) {
            let c = first[0] * second[0] - first[1] * second[1];
            for (u, amplitude) in u.iter_mut().zip(amplitude) {
                *u += amplitude * c;
            }
        }
        u
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boundary::{Patch, convective_outflow, velocity};
    use crate::collision::{Operator, cumulant};
    use crate::fluid::{Fluid, Models, Setup};
    use crate::lattice::VelocitySet;
    use decomposition::{Domain, SplitAxis};

    const LENGTH: f64 = 4.0;

    fn modes(cells: [usize; 3]) -> Modes {
        let across = |a: usize| Some(cells[a] as f64);
        Modes::new(3, LENGTH, 3).periodic([None, across(1), across(2)])
    }

    fn tunnel(cells: [usize; 3], intensity: f64, upper: bool) -> Fluid<f64> {
        let patch = |upper, rule| Patch {
            name: format!("{upper}"),
            axis: 0,
            upper,
            range: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
            rule,
        };
        let speed = if upper { -0.1 } else { 0.1 };
        let synthetic = Synthetic {
            modes: modes(cells),
            intensity,
            speed: 0.1,
        };
        let inlet =
            velocity::VelocityLinks::uniform([speed, 0.0, 0.0]).turbulent(synthetic, (0, upper));
        let outlet = convective_outflow::ConvectiveOutflowLinks::new(
            (0, !upper),
            convective_outflow::Carried::Local,
        );
        let setup = Setup {
            periodic: [false, true, true],
            patches: vec![
                patch(upper, Box::new(inlet)),
                patch(!upper, Box::new(outlet)),
            ],
            ..Setup::new(
                Models::new(
                    VelocitySet::D3Q27,
                    Operator::Cumulant(cumulant::CumulantParameters::default()),
                ),
                0.505,
                cells,
            )
        };
        let domain = Domain::serial(SplitAxis::X, cells[0], false);
        let mut fluid = Fluid::new(setup, &domain).unwrap();
        fluid.initialise(&|_: [f64; 3]| (0.0, [speed, 0.0, 0.0]));
        fluid
    }

    /// Checks that the links receive the sum of the waves, at both ends of an axis.
    #[test]
    fn the_rule_is_the_frozen_field_at_the_face() {
        for upper in [false, true] {
            let cells = [4, 5, 6];
            let steps = 3_u32;
            let mut fluid = tunnel(cells, 0.2, upper);
            for _ in 0..steps {
                fluid.advance();
            }
            let modes = modes(cells);
            let populations = fluid.populations();
            let velocities = populations.velocities();
            let x = if upper { cells[0] - 1 } else { 0 };
            let carried = if upper { -0.1 } else { 0.1 };
            let face = if upper { 4.0 } else { 0.0 };
            for (y, z) in [(0, 0), (2, 3), (4, 5)] {
                let cell = populations.cell([x, y, z].map(usize::cast_signed));
                for i in 1..velocities.q() {
                    let c = velocities.c[i].map(f64::from);
                    // Through the face: the entering population minus the one that left is -6 w c·u.
                    if c[0] * carried >= 0.0 {
                        continue;
                    }
                    let place = [
                        face - carried * f64::from(steps),
                        y as f64 + 0.5 + 0.5 * c[1],
                        z as f64 + 0.5 + 0.5 * c[2],
                    ];
                    let u = modes.velocity_at(place).map(|u| 0.2 * 0.1 * u);
                    let link = populations.link(cell, i);
                    let parity = populations.parity();
                    let numbers = populations.numbers();
                    let given = numbers[link.incoming(parity)] - numbers[link.out(parity)];
                    let total = [carried + u[0], u[1], u[2]];
                    let exact = -6.0
                        * velocities.w[i]
                        * (c[0] * total[0] + c[1] * total[1] + c[2] * total[2]);
                    approx::assert_abs_diff_eq!(given, exact, epsilon = 1e-15);
                }
            }
        }
    }

    /// Checks that the fluid behind the inlet has the requested intensity and correlation.
    #[test]
    fn intensity_and_length_behind_the_inlet() {
        let cells = [12, 20, 20];
        let mut fluid = tunnel(cells, 0.1, false);
        let (mut squares, mut shifted, mut count) = ([0.0; 3], [0.0; 3], 0.0);
        for step in 0..1600 {
            fluid.advance();
            if step < 300 || step % 5 != 0 {
                continue;
            }
            let at = |y: usize, z: usize| {
                let cell = fluid.populations().cell([1, y, z].map(usize::cast_signed));
                let mut u = fluid.state(cell).1;
                u[0] -= 0.1;
                u
            };
            for y in 0..cells[1] {
                for z in 0..cells[2] {
                    let (here, there) = (at(y, z), at((y + 4) % cells[1], z));
                    for a in 0..3 {
                        squares[a] += here[a] * here[a];
                        shifted[a] += here[a] * there[a];
                    }
                    count += 1.0;
                }
            }
        }
        let intensity = squares.map(|s: f64| (s / count).sqrt() / 0.1);
        let correlation: [f64; 3] = std::array::from_fn(|a| shifted[a] / squares[a]);
        println!("intensity {intensity:?}, correlation at L {correlation:?}");
        // r = L along y: f = exp(-pi/4) for the velocity along y, g = f (1 - pi/4) for the others.
        let f = (-std::f64::consts::FRAC_PI_4).exp();
        let g = f * (1.0 - std::f64::consts::FRAC_PI_4);
        // The mean squares of the field at the face are exact; viscosity takes 2 % of them over the 1.5 cells to here,
        // and the lattice its part at four cells a length. In the correlation 96 waves share the energy unevenly over
        // lengths: 1/sqrt(2 * 96) = 0.07 is one standard error.
        for (a, exact) in [g, f, g].into_iter().enumerate() {
            assert!((intensity[a] - 0.1).abs() < 0.015, "{a} {intensity:?}");
            assert!(
                (correlation[a] - exact).abs() < 0.15,
                "{a} {exact} {correlation:?}"
            );
        }
    }
}
