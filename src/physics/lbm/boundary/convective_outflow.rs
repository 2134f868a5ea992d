//! Convective outflow: what leaves is carried through the face, ∂f/∂t + U ∂f/∂n = 0 for every entering population.
//!
//! f_j(x, t+1) = (f_j(x, t) + U f_j(x', t+1)) / (1 + U),  x' the next cell upstream
//!
//! the implicit upwind difference of Lou, Guo and Shi 2013 (doi:10.1103/PhysRevE.87.063301, their CBC), stable for every U ≥ 0.
//! For large U it is the condition of no gradient ([`super::outflow`]). U is given, or the velocity of the cell out of the domain
//! in the step before; where fluid comes back it is zero, and what enters stays as it is. A vortex leaves with little reflection;
//! the pressure floats, as with every outflow.
//!
//! f_j(x, t) is taken from the lattice before each pass, so that a restart needs nothing else.

use super::links::{LINKS_PER_THREAD, each_part};
use super::outflow::{NATURE, Upstream};
use super::{Crossing, FaceLink, Giver, Inflow, Model, Moment, Nature, Place, Rule};
use crate::error::Error;
use crate::lbm::lanes::Stored;
use crate::lbm::populations::Populations;
use crate::thread_pool;
use crate::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Convective outflow: df/dt + U df/dn = 0. Vortices leave with little reflection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct ConvectiveOutflow {
    /// Convection velocity U [m/s]. Default: the local velocity of the fluid at the face.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub velocity: Option<f64>,
}

impl Model for ConvectiveOutflow {
    fn nature(&self) -> Nature {
        NATURE
    }

    fn pressure_floats(&self) -> bool {
        true
    }

    fn inflow(&self, _: &Place<'_>) -> Inflow {
        Inflow::Any
    }

    fn rule<S: Stored>(
        &self,
        place: &Place<'_>,
        units: &LatticeUnits,
    ) -> Result<Box<dyn Rule<S>>, Error> {
        let face = place.site.face;
        let speed = self.velocity.map(|v| units.velocity_to_lattice(v));
        Ok(Box::new(Links::new((face.axis(), face.is_max()), speed)))
    }
}

/// One population with its face.
#[derive(Clone, Copy, Debug)]
struct Leaving {
    cell: usize,
    upstream: Upstream,
    /// f_j(x, t) and U of the coming step.
    before: f64,
    carried: f64,
}

/// The links of a patch through which the fluid is carried out.
#[derive(Debug)]
pub struct Links {
    axis: usize,
    /// +1 at the upper end of the axis, -1 at the lower.
    outward: f64,
    /// U where it is given \[cells per step\].
    speed: Option<f64>,
    links: Vec<FaceLink>,
    /// For each link.
    leaving: Vec<Leaving>,
}

impl Links {
    /// The fluid is carried out with a velocity \[cells per step\], without one with its own, through the face normal to an axis at its
    /// upper end or its lower one.
    #[must_use]
    pub fn new((axis, upper): (usize, bool), speed: Option<f64>) -> Self {
        Self {
            axis,
            outward: if upper { 1.0 } else { -1.0 },
            speed,
            links: Vec::new(),
            leaving: Vec::new(),
        }
    }
}

impl<S: Stored> Rule<S> for Links {
    fn nature(&self) -> Nature {
        NATURE
    }

    fn take(&mut self, crossing: &Crossing<'_, S>) -> Giver {
        self.links.push(crossing.face_link());
        self.leaving.push(Leaving {
            cell: crossing.cell,
            upstream: Upstream::new(crossing),
            before: 0.0,
            carried: 0.0,
        });
        Giver::Rule
    }

    fn walls_stand_alone(&self) -> bool {
        self.links.is_empty()
    }

    fn remember(&mut self, populations: &Populations<S>, half_force: [f64; 3]) {
        let parity = populations.parity();
        let (axis, outward, speed) = (self.axis, self.outward, self.speed);
        let count = self.links.len();
        let pieces = thread_pool::threads().min(count / LINKS_PER_THREAD).max(1);
        let shared = (
            thread_pool::evenly(&mut self.links, pieces),
            thread_pool::evenly(&mut self.leaving, pieces),
        );
        thread_pool::each_of(pieces, shared, |_, (links, leaving)| {
            let mut last = (usize::MAX, 0.0);
            for (link, leaving) in links.iter().zip(leaving) {
                leaving.before = populations.numbers()[link.link.incoming(parity)].to_f64();
                leaving.carried = speed.unwrap_or_else(|| {
                    // Links of one cell stand together.
                    if last.0 != leaving.cell {
                        let (drho, momentum) = populations.moments(leaving.cell);
                        let u = (momentum[axis] + half_force[axis]) / (1.0 + drho);
                        last = (leaving.cell, u);
                    }
                    (outward * last.1).max(0.0)
                });
            }
        });
    }

    fn apply(&mut self, populations: &mut Populations<S>, _: &Moment) {
        let parity = populations.parity();
        let count = self.links.len();
        each_part(count, LINKS_PER_THREAD, populations, |part, numbers| {
            for (link, leaving) in self.links[part.clone()].iter().zip(&self.leaving[part]) {
                let (from, to) = (leaving.upstream.at(parity), link.link.incoming(parity));
                // SAFETY: positions in the slab: of this link alone, and of a cell further inside, to which the rule gives nothing.
                unsafe {
                    let upstream = numbers.add(from).read().to_f64();
                    let value =
                        (leaving.before + leaving.carried * upstream) / (1.0 + leaving.carried);
                    numbers.add(to).write(S::from_f64(value));
                }
            }
        });
    }

    fn links(&self) -> &[FaceLink] {
        &self.links
    }
}

#[cfg(test)]
mod tests {
    use super::Links;
    use crate::lbm::boundary::{Patch, Rule, outflow, velocity};
    use crate::lbm::collision::{Operator, trt};
    use crate::lbm::fluid::{Fluid, Force, Setup};
    use crate::lbm::lattice::VelocitySet;
    use decomposition::{Axis, Domain};

    const SPEED: f64 = 0.1;
    const CELLS: [usize; 3] = [80, 48, 1];

    fn stream(length: usize, outlet: Box<dyn Rule<f64>>) -> Fluid<f64> {
        let patch = |upper, rule| Patch {
            name: format!("{upper}"),
            axis: 0,
            upper,
            range: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
            rule,
        };
        let inlet = Box::new(velocity::Links::uniform([SPEED, 0.0, 0.0]));
        let cells = [length, CELLS[1], 1];
        let setup = Setup {
            set: VelocitySet::D2Q9,
            operator: Operator::Trt(trt::Parameters { magic: 3.0 / 16.0 }),
            relaxation_time: 0.53,
            turbulence: None,
            force: Force::None,
            cells,
            periodic: [false, true, true],
            patches: vec![patch(false, inlet), patch(true, outlet)],
            saturation: None,
            device: crate::lbm::gpu::Device::Cpu,
        };
        Fluid::new(setup, &Domain::serial(Axis::X, length, false)).unwrap()
    }

    /// Root mean square of the disturbance in the box of [`CELLS`].
    fn disturbance(fluid: &Fluid<f64>, from: &Fluid<f64>) -> f64 {
        let mut sum = 0.0;
        for x in 0..CELLS[0] {
            for y in 0..CELLS[1] {
                let at = [x, y, 0].map(usize::cast_signed);
                let u = |f: &Fluid<f64>| f.state(f.populations().cell(at)).1;
                let (a, b) = (u(fluid), u(from));
                sum += (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
            }
        }
        (sum / (CELLS[0] * CELLS[1]) as f64).sqrt()
    }

    /// A Gaussian vortex in a stream, 24 cells before the outlet.
    fn vortex(p: [f64; 3]) -> (f64, [f64; 3]) {
        let (x, y, r) = (p[0] - 56.0, p[1] - 24.0, 6.0);
        let strength = 0.02 * (0.5 - 0.5 * (x * x + y * y) / (r * r)).exp();
        let (u, v) = (-strength * y / r, strength * x / r);
        // Balance of the vortex: p = -rho/2 times the square of the peak.
        (-1.5 * strength * strength, [SPEED + u, v, 0.0])
    }

    fn convective(speed: Option<f64>) -> Box<dyn Rule<f64>> {
        Box::new(Links::new((0, true), speed))
    }

    fn plain() -> Box<dyn Rule<f64>> {
        Box::<outflow::Links>::default()
    }

    /// What is left of a vortex after it has gone, against the same stream in a channel four times as long.
    #[test]
    fn a_vortex_leaves_with_less_reflection_than_without_gradient() {
        let left = |outlet| {
            let mut fluid = stream(CELLS[0], outlet);
            let mut long = stream(4 * CELLS[0], convective(Some(SPEED)));
            let mut still = stream(CELLS[0], plain());
            still.initialise(&|_: [f64; 3]| (0.0, [SPEED, 0.0, 0.0]));
            fluid.initialise(&vortex);
            long.initialise(&vortex);
            let begun = disturbance(&fluid, &still);
            let mut largest: f64 = 0.0;
            for step in 0..480 {
                fluid.advance();
                long.advance();
                if step % 20 == 0 {
                    largest = largest.max(disturbance(&fluid, &long) / begun);
                }
            }
            (largest, disturbance(&fluid, &long) / begun)
        };
        let plain = left(plain());
        let local = left(convective(None));
        let given = left(convective(Some(SPEED)));
        println!(
            "largest and last error over the vortex: none {plain:?}, local {local:?}, given {given:?}"
        );
        assert!(local.0 < plain.0 && given.0 < plain.0);
    }
}
