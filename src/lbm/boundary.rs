//! Boundaries of the domain: a rule for each population that would enter from outside.
//!
//! Every rule acts on links half-way across the face, so the fluid fills the domain exactly from face to face. A link
//! that leaves through an edge or a corner belongs to the face with the strongest condition, in the order wall,
//! velocity (turbulent or not), pressure, outflow (convective or not), free slip; a wall therefore always closes its corners.

pub mod convective;
mod covered;
mod flux;
pub mod free_slip;
pub mod outflow;
pub mod pressure;
pub mod turbulent;
pub mod wall;

pub use super::quanta::{QUANTA, from_quanta, quanta};
pub use flux::Flux;

use super::lanes::Stored;
use super::populations::{Parity, Populations};
use std::ops::Range;

/// A value that goes linearly from `start` to `end` during `steps`, then stays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    /// Value at step 0.
    pub start: f64,
    /// Value from `steps` on.
    pub end: f64,
    /// Length in steps; 0 for a step change.
    pub steps: f64,
}

impl Ramp {
    /// The same value always.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self {
            start: value,
            end: value,
            steps: 0.0,
        }
    }

    /// Value at a step.
    #[must_use]
    pub fn at(&self, step: f64) -> f64 {
        if step >= self.steps {
            self.end
        } else {
            self.start + (self.end - self.start) * (step / self.steps)
        }
    }
}

/// Velocity on a face as a function of the position in cells (lattice units).
pub type Profile = Box<dyn Fn([f64; 3]) -> [f64; 3] + Send + Sync>;

/// What happens at a patch of a face.
pub enum Condition {
    /// The fluid sticks to a wall at rest.
    NoSlip,
    /// The fluid sticks to a wall, or enters, with the velocity of the profile times the ramp.
    Velocity(Profile, Ramp),
    /// The same with turbulence over the profile.
    Turbulent(Profile, Ramp, turbulent::Synthetic),
    /// Density deviation δρ = 3 p (pressure above the reference, in lattice units).
    Pressure(Ramp),
    /// The fluid leaves with the state it has.
    Outflow,
    /// The fluid is carried out with this velocity \[cells per step\]; without one with its own.
    Convective(Option<f64>),
    /// No flow through, no friction along.
    FreeSlip,
}

impl Condition {
    fn strength(&self) -> u8 {
        match self {
            Self::NoSlip => 4,
            Self::Velocity(..) | Self::Turbulent(..) => 3,
            Self::Pressure(_) => 2,
            Self::Outflow | Self::Convective(_) => 1,
            Self::FreeSlip => 0,
        }
    }
}

/// A named part of one face.
pub struct Patch {
    /// Name in outputs.
    pub name: String,
    /// Axis of the face normal.
    pub axis: usize,
    /// At the upper end of the axis.
    pub upper: bool,
    /// Corners of the part in cells (the components along the axis are not used); later patches win.
    pub range: [[f64; 2]; 3],
    /// The rule.
    pub condition: Condition,
}

impl Patch {
    /// Whether water goes through the face at a point, in cells.
    fn lets_through(&self, position: [f64; 3]) -> bool {
        match &self.condition {
            Condition::NoSlip | Condition::FreeSlip => false,
            Condition::Velocity(profile, _) | Condition::Turbulent(profile, ..) => {
                profile(position)[self.axis] != 0.0
            }
            Condition::Pressure(_) | Condition::Outflow | Condition::Convective(_) => true,
        }
    }

    fn holds(&self, position: [f64; 3]) -> bool {
        (0..3).all(|a| {
            a == self.axis || (self.range[a][0] <= position[a] && position[a] < self.range[a][1])
        })
    }
}

/// The last patch that holds a position on a face; none where only the default wall does.
#[must_use]
pub fn holder(patches: &[Patch], axis: usize, upper: bool, position: [f64; 3]) -> Option<usize> {
    patches
        .iter()
        .rposition(|patch| patch.axis == axis && patch.upper == upper && patch.holds(position))
}

/// All boundary links of one slab, grouped by rule, ready to be applied without a choice in the loop.
pub struct Boundaries {
    patches: Vec<Patch>,
    walls: wall::Walls,
    pressures: Vec<pressure::PressureCell>,
    pressure_links: Vec<pressure::PressureLink>,
    mirrors: Vec<free_slip::Mirror>,
    outflows: Vec<outflow::OutflowLink>,
    convective: convective::Convective,
    inlets: Vec<turbulent::Inlet>,
    open: covered::OpenCells,
}

/// Where a cell lies relative to the whole domain.
pub struct Frame {
    /// Cells of the whole domain.
    pub cells: [usize; 3],
    /// First cell of the slab.
    pub start: [usize; 3],
    /// Periodic axes.
    pub periodic: [bool; 3],
}

fn factor(patches: &[Patch], patch: usize, step: f64) -> f64 {
    match &patches[patch].condition {
        Condition::Velocity(_, ramp) | Condition::Turbulent(_, ramp, _) => ramp.at(step),
        _ => 0.0,
    }
}

impl Boundaries {
    /// Finds the boundary links of a slab. Faces without a patch are no-slip walls. `coverable`: solids may cover cells.
    #[must_use]
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        frame: &Frame,
        patches: Vec<Patch>,
        coverable: bool,
    ) -> Self {
        let mut all = Self {
            patches,
            walls: wall::Walls::default(),
            pressures: Vec::new(),
            pressure_links: Vec::new(),
            mirrors: Vec::new(),
            outflows: Vec::new(),
            convective: convective::Convective::default(),
            inlets: Vec::new(),
            open: covered::OpenCells::default(),
        };
        let mut walls = Vec::new();
        for axis in 0..3 {
            // Last resort, weakest in the search below because later patches win.
            for upper in [false, true] {
                let name = format!(
                    "{}_{}",
                    ["x", "y", "z"][axis],
                    if upper { "max" } else { "min" }
                );
                let range = [[f64::NEG_INFINITY, f64::INFINITY]; 3];
                let patch = Patch {
                    name,
                    axis,
                    upper,
                    range,
                    condition: Condition::NoSlip,
                };
                all.patches.push(patch);
            }
        }
        let defaults = all.patches.len() - 6;
        let velocities = populations.velocities().clone();
        let dimension = velocities.dimension;
        let [slow, ..] = populations.order();
        for (local, cell) in populations.interior() {
            let at: [usize; 3] = std::array::from_fn(|a| local[a] + frame.start[a]);
            let at_face = (0..dimension)
                .any(|a| !frame.periodic[a] && (at[a] == 0 || at[a] + 1 == frame.cells[a]));
            if !at_face {
                continue;
            }
            let mut pressure_cell: Option<(usize, usize)> = None;
            for i in 1..velocities.q() {
                let c = velocities.c[i];
                let outside: [bool; 3] = std::array::from_fn(|a| {
                    a < dimension
                        && !frame.periodic[a]
                        && ((c[a] < 0 && at[a] == 0) || (c[a] > 0 && at[a] + 1 == frame.cells[a]))
                });
                if !outside.contains(&true) {
                    continue;
                }
                // The middle of the link, in cells; the first cell spans 0..1.
                let middle: [f64; 3] = std::array::from_fn(|a| {
                    #[expect(
                        clippy::cast_precision_loss,
                        reason = "cell counts are far below 2^53"
                    )]
                    let x = at[a] as f64;
                    // Along a face through which the link does not leave, the crossing point; through a face, the face.
                    x + 0.5 + 0.5 * f64::from(c[a])
                });
                let patch = (0..3)
                    .filter(|&a| outside[a])
                    .map(|axis| {
                        let upper = c[axis] > 0;
                        holder(&all.patches[..defaults], axis, upper, middle)
                            .unwrap_or(defaults + 2 * axis + usize::from(upper))
                    })
                    .max_by_key(|&p| all.patches[p].condition.strength())
                    .unwrap_or(defaults);
                let link = populations.link(cell, i);
                let weight = velocities.w[i];
                if coverable && all.patches[patch].lets_through(middle) {
                    all.open.add(cell, link);
                }
                match &all.patches[patch].condition {
                    Condition::NoSlip => {
                        walls.push(wall::WallLink {
                            link,
                            patch,
                            direction: i,
                            plane: local[slow],
                            term: 0.0,
                        });
                    }
                    Condition::Velocity(profile, _) | Condition::Turbulent(profile, ..) => {
                        let u = profile(middle);
                        let held = &all.patches[patch];
                        if let Condition::Turbulent(_, _, synthetic) = &held.condition {
                            let side = (held.axis, held.upper);
                            let known = all.inlets.iter().position(|inlet| inlet.patch == patch);
                            let n = known.unwrap_or_else(|| {
                                let inlet =
                                    turbulent::Inlet::new(patch, side, synthetic, frame.cells);
                                all.inlets.push(inlet);
                                all.inlets.len() - 1
                            });
                            let speed = (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]).sqrt();
                            let strength = synthetic.intensity * speed;
                            all.inlets[n].add(at, strength, link, weight, c);
                        }
                        let term = wall::term(weight, c, u);
                        walls.push(wall::WallLink {
                            link,
                            patch,
                            direction: i,
                            plane: local[slow],
                            term,
                        });
                    }
                    Condition::Pressure(_) => {
                        let axis = all.patches[patch].axis;
                        match &mut pressure_cell {
                            Some((_, n)) => *n += 1,
                            None => pressure_cell = Some((all.pressure_links.len(), 1)),
                        }
                        all.pressure_links.push(pressure::PressureLink {
                            link,
                            patch,
                            direction: i,
                            mirror: free_slip::Mirror::new(populations, cell, i, outside, patch),
                            axis,
                            weight,
                        });
                    }
                    Condition::Outflow => {
                        all.outflows.push(outflow::OutflowLink::new(
                            populations,
                            cell,
                            i,
                            outside,
                            patch,
                        ));
                    }
                    Condition::Convective(speed) => {
                        let link = outflow::OutflowLink::new(populations, cell, i, outside, patch);
                        let side = (all.patches[patch].axis, all.patches[patch].upper);
                        all.convective.add(link, cell, side, *speed);
                    }
                    Condition::FreeSlip => {
                        all.mirrors.push(free_slip::Mirror::new(
                            populations,
                            cell,
                            i,
                            outside,
                            patch,
                        ));
                    }
                }
            }
            if let Some((first, count)) = pressure_cell {
                all.pressures
                    .push(pressure::PressureCell { cell, first, count });
            }
        }
        all.walls = wall::Walls::new(walls, populations.cells()[slow]);
        all
    }

    /// Positions of the ghost cells that links to walls at rest lead to; some of them more than once.
    pub fn behind_walls_at_rest<S: Stored>(
        &self,
        populations: &Populations<S>,
    ) -> impl Iterator<Item = usize> {
        let first = |i: usize| populations.slot(0, i);
        self.walls
            .links()
            .filter(|wall| matches!(self.patches[wall.patch].condition, Condition::NoSlip))
            .map(move |wall| wall.link.far as usize - first(wall.direction))
    }

    /// Factor of the velocity of a patch at a step: that of its ramp.
    #[must_use]
    pub fn velocity_factor(&self, patch: usize, step: f64) -> f64 {
        factor(&self.patches, patch, step)
    }

    /// Names of the patches, in the order of [`Boundaries::fluxes`].
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.patches.iter().map(|p| p.name.as_str())
    }

    /// Notes what the rules need of the state before a pass.
    pub fn remember<S: Stored>(&mut self, populations: &Populations<S>, half_force: [f64; 3]) {
        self.convective.remember(populations, half_force);
    }

    /// Whether the links at walls of a plane may be given as soon as the cells round it have collided: other rules read numbers that the walls
    /// give, or ghosts beside them.
    #[must_use]
    pub fn walls_stand_alone(&self) -> bool {
        self.outflows.is_empty() && self.convective.is_empty() && self.mirrors.is_empty()
    }

    /// Gives what comes back from the walls to the cells of some planes, ahead of [`Self::apply`].
    ///
    /// # Safety
    /// `numbers` must be those of the slab, in the order of `parity`, and nobody may work on the cells of these planes or of those
    /// beside them.
    pub(crate) unsafe fn give_walls<S: Stored>(
        &self,
        planes: Range<usize>,
        step: f64,
        parity: Parity,
        numbers: *mut S,
    ) {
        let speed = |patch: usize| factor(&self.patches, patch, step);
        // SAFETY: forwarded from the caller: a link's numbers lie in the plane of its cell or beside it.
        unsafe { self.walls.give(planes, speed, parity, numbers) };
    }

    /// Gives every population that enters through a face its value. `half_force` is F/2 of the body force; the walls of the planes
    /// `given` have been given theirs.
    pub fn apply<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
        step: f64,
        half_force: [f64; 3],
        given: impl Iterator<Item = Range<usize>>,
    ) {
        // Pressure reads whole cells, so it goes first; the others touch only their own two numbers.
        pressure::apply(
            &self.pressures,
            &self.pressure_links,
            |patch| match self.patches[patch].condition {
                Condition::Pressure(ramp) => ramp.at(step),
                _ => 0.0,
            },
            populations,
            half_force,
        );
        outflow::apply(&self.outflows, populations);
        self.convective.apply(populations);
        free_slip::apply(&self.mirrors, populations);
        let speed = |patch: usize| factor(&self.patches, patch, step);
        let [slow, ..] = populations.order();
        let planes = populations.cells()[slow];
        let mut next = 0;
        for given in given.chain(std::iter::once(planes..planes)) {
            self.walls.apply(next..given.start, speed, populations);
            next = given.end;
        }
        for inlet in &mut self.inlets {
            inlet.apply(populations, step, factor(&self.patches, inlet.patch, step));
        }
    }

    /// Closes open faces where solids cover their cells, after [`Self::apply`]: `fraction` is the solid part of a cell.
    pub fn close_covered<S: Stored>(
        &self,
        fraction: impl Fn(usize) -> f64,
        populations: &mut Populations<S>,
    ) {
        self.open.close(fraction, populations);
    }

    /// The last step in which a value at a face still changes by its ramp.
    #[must_use]
    pub fn ramps_end(&self) -> f64 {
        let ramps = self.patches.iter().map(|patch| match &patch.condition {
            Condition::Velocity(_, ramp)
            | Condition::Turbulent(_, ramp, _)
            | Condition::Pressure(ramp) => ramp.steps,
            _ => 0.0,
        });
        ramps.fold(0.0, f64::max)
    }

    /// Whether any rule needs the cell behind the first (outflow), so that a slab at a face must be two planes thick.
    #[must_use]
    pub fn needs_two_planes(&self) -> bool {
        !(self.outflows.is_empty() && self.convective.links().is_empty())
    }
}
