//! Message about a cell that fails a check: position, values, surroundings, and a remedy.
//!
//! A remedy is named only if it worked in a similar case. Those cases are in `tests/suite/guards.rs`, which records
//! the outcomes. For all other failures the message names the nearest limit and refers to `solver plan`.

use super::covered::covered_openings;
use super::state_check::LatticeOrder;
use base::error::Error;
use base::number::real;
use base::vector::norm;
use coupling::lattice::LatticeFlow;
use decomposition::Communicator;
use dem::deepest::{Deepest, OtherSide};
use dem::escape::Escape;
use dem::particles::Particles;
use dem::space::{Components, Space};
use lbm::lanes::Stored;
use plan::Plan;
use plan::margin::Margin;
use plan::scene::findings::number;

/// Kind of failure of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Numbers that are not finite.
    NotFinite,
    /// Speed above `guards.max_lattice_velocity`.
    TooFast,
    /// Density deviation larger than `guards.max_compression`.
    TooDense,
}

/// Cell that failed a check.
#[derive(Clone, Copy, Debug)]
pub(super) struct Failure {
    pub(super) kind: Kind,
    /// Index of the cell in the order of the lattice; the same on every rank.
    pub(super) place: u64,
}

impl Failure {
    /// Returns the complete message, on every rank; `flows` are inflow and outflow through the openings in words, and
    /// `true` if water only enters or only leaves the domain. Collective.
    pub(super) fn describe<Sp: Space, S: Stored>(
        self,
        flow: &dyn LatticeFlow<Sp, S>,
        particles: &Particles<Sp>,
        plan: &Plan,
        flows: Option<(String, bool)>,
        communicator: &Communicator,
    ) -> String {
        let cell = LatticeOrder::from_flow(flow).cell(self.place);
        let centre = plan.scene.grid.centre(cell);
        let state = state(self.kind, cell, flow, plan);
        // One rank holds the cell and reports for all.
        let state = match communicator.agree(state.map_or(Ok(()), Err)) {
            Ok(()) => String::new(),
            Err(told) => told.message,
        };
        let mut parts = vec![format!(
            "cell {cell:?} at {} m {state}",
            point(centre, plan)
        )];
        let lost = if self.kind == Kind::NotFinite {
            lost(flow, communicator)
        } else {
            0
        };
        if real(lost) > SPREAD * real(plan.scene.grid.cell_count()) {
            let often = (plan.scene.guards.check_every_steps / 20).max(1);
            parts.push(format!(
                "{lost} of {} cells are no longer finite, so that the failure may have begun in another cell: \
                 --set guards.check_every_steps={often} finds it earlier",
                plan.scene.grid.cell_count()
            ));
            parts.extend(nearest_of_water(plan).map(limit));
            parts.push(remedy(self.kind, false, plan));
            return parts.join("; ");
        }
        let mut near = Vec::new();
        near.extend(boundary(cell, plan).map(|(name, away)| (format!("boundary {name}"), away)));
        near.extend(solid(centre, particles, plan, communicator));
        near.sort_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((name, away)) = near.first() {
            let away = number(away.max(0.0));
            parts.push(format!(
                "the nearest object is {name}, at a distance of {away} m"
            ));
        }
        let covered = match self.kind {
            Kind::NotFinite => None,
            Kind::TooFast | Kind::TooDense => covered_openings(flow, plan, communicator),
        };
        parts.extend(covered);
        let one_way = flows.as_ref().is_some_and(|(_, one_way)| *one_way);
        parts.extend(
            flows
                .filter(|_| self.kind == Kind::TooDense)
                .map(|(text, _)| text),
        );
        parts.extend(nearest_of_water(plan).map(limit));
        parts.push(remedy(self.kind, one_way, plan));
        parts.join("; ")
    }
}

/// Fraction of non-finite cells above which the first such cell no longer shows where the failure began.
const SPREAD: f64 = 0.01;

/// Returns the number of cells with non-finite values. Collective.
fn lost<Sp: Space, S: Stored>(flow: &dyn LatticeFlow<Sp, S>, communicator: &Communicator) -> usize {
    let fluid = flow.fluid();
    let broken = |&(_, cell): &([usize; 3], usize)| {
        let (drho, u) = fluid.state(cell);
        !(drho + u[0] + u[1] + u[2]).is_finite()
    };
    let count = fluid.populations().interior().filter(broken).count();
    base::number::whole(real(communicator.all_reduce_sum_u64(count as u64)))
}

pub(super) fn point(at: [f64; 3], plan: &Plan) -> String {
    let numbers: Vec<String> = at[..plan.scene.grid.dimension]
        .iter()
        .map(|x| number(*x))
        .collect();
    format!("[{}]", numbers.join(", "))
}

/// Returns the state of a cell of the domain in words; none if another rank owns the cell.
fn state<Sp: Space, S: Stored>(
    kind: Kind,
    cell: [usize; 3],
    flow: &dyn LatticeFlow<Sp, S>,
    plan: &Plan,
) -> Option<String> {
    let fluid = flow.fluid();
    let (start, cells) = (fluid.start(), fluid.populations().cells());
    let inside = (0..3).all(|a| (start[a]..start[a] + cells[a]).contains(&cell[a]));
    let local: [usize; 3] = std::array::from_fn(|a| cell[a].wrapping_sub(start[a]));
    let units = plan.units.filter(|_| inside)?;
    let (drho, u) = fluid.state(fluid.populations().interior_cell(local));
    let speed = norm(u);
    let guards = &plan.scene.guards;
    let velocity = format!("lattice velocity {} (|u| dt/h), {} m/s", number(speed), {
        number(units.velocity_to_si(speed))
    });
    let density = density(drho, plan);
    Some(match kind {
        Kind::NotFinite => "is not finite".into(),
        Kind::TooFast => format!(
            "moves at {velocity}, above guards.max_lattice_velocity = {}; its density is {density}",
            guards.max_lattice_velocity
        ),
        Kind::TooDense => format!(
            "has a density {density}, beyond guards.max_compression = {}; it moves at {velocity}",
            guards.max_compression
        ),
    })
}

/// Returns a density deviation in words, in per cent and as a pressure.
pub(super) fn density(drho: f64, plan: &Plan) -> String {
    let pressure = plan
        .units
        .map(|units| units.density_deviation_to_pressure(drho));
    format!(
        "{} % {} the density at rest (pressure {} Pa)",
        number(100.0 * drho.abs()),
        if drho < 0.0 { "below" } else { "above" },
        number(pressure.unwrap_or(f64::NAN))
    )
}

/// Returns the boundary nearest to a cell: its name and its distance from the centre of the cell \[m\].
fn boundary(cell: [usize; 3], plan: &Plan) -> Option<(String, f64)> {
    let (flow, grid) = (plan.scene.flow.as_ref()?, &plan.scene.grid);
    let away = |axis: usize, upper: bool| {
        let cells = if upper {
            grid.cells[axis] - 1 - cell[axis]
        } else {
            cell[axis]
        };
        (real(cells) + 0.5) * grid.spacing
    };
    let holds = |patch: &&plan::scene::boundaries::ScenePatch| {
        let axis = patch.face.axis();
        (0..grid.dimension).all(|a| a == axis || (patch.from[a]..patch.to[a]).contains(&cell[a]))
    };
    flow.patches()
        .filter(holds)
        .map(|patch| {
            let away = away(patch.face.axis(), patch.face.is_max());
            (patch.name.clone(), away)
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Returns the body, block or grain nearest to a point: its name and the distance of its surface \[m\]; for
/// polyhedra that of the enclosing sphere. Collective.
fn solid<Sp: Space>(
    at: [f64; 3],
    particles: &Particles<Sp>,
    plan: &Plan,
    communicator: &Communicator,
) -> Option<(String, f64)> {
    let grid = &plan.scene.grid;
    let mut nearest = (f64::INFINITY, u64::MAX);
    for k in 0..particles.owned() {
        let (motion, body) = (&particles.motion[k], &particles.body[k]);
        let squared: f64 = (0..Sp::DIMENSION)
            .map(|a| {
                let mut d = (at[a] - motion.position.get(a)).abs();
                if grid.periodic[a] {
                    d = d.min((grid.size[a] - d).abs());
                }
                d * d
            })
            .sum();
        let away = squared.sqrt() - body.radius;
        if away < nearest.0 || (away <= nearest.0 && body.id < nearest.1) {
            nearest = (away, body.id);
        }
    }
    let away = communicator.all_reduce_min_f64(nearest.0);
    let mine = if nearest.0 <= away {
        nearest.1
    } else {
        u64::MAX
    };
    let id = communicator.all_reduce_min_u64(mine);
    (id != u64::MAX && away.is_finite()).then(|| (name(id, plan), away))
}

/// Returns the name of a body, block or grain.
pub(super) fn name(id: u64, plan: &Plan) -> String {
    let bodies = &plan.scene.bodies;
    match usize::try_from(id).ok().and_then(|n| bodies.get(n)) {
        Some(body) => format!("body {}", body.name),
        None if id < plan.scene.first_grain() => format!("block {id}"),
        None => format!("grain {id}"),
    }
}

/// Returns the message about a grain, block or body with values that are not finite.
pub(super) fn of_grain(id: u64, plan: &Plan) -> String {
    let mut parts = vec![format!(
        "{} has a position or velocity that is not finite",
        name(id, plan)
    )];
    parts.extend(nearest(plan, |limit| limit.starts_with(SOLID)).map(limit));
    parts.push("`solver plan` shows all limits".into());
    parts.join("; ")
}

/// Returns the message for a contact deeper than `guards.max_overlap`.
pub(super) fn of_overlap(deepest: &Deepest, plan: &Plan) -> String {
    let with = match deepest.with {
        OtherSide::Unknown => "another body".into(),
        OtherSide::Body(id) => name(id, plan),
        OtherSide::Wall(wall) => {
            let wall = plan.scene.walls.get(wall as usize);
            wall.map_or_else(|| "a wall".into(), |wall| format!("wall {}", wall.name))
        }
    };
    let body = if deepest.with == OtherSide::Unknown {
        "a body".into()
    } else {
        name(deepest.body, plan)
    };
    let mut parts = vec![format!(
        "{body} overlapped {with} by {} of the smaller radius, above guards.max_overlap = {}",
        number(deepest.part),
        plan.scene.guards.max_overlap
    )];
    parts.extend(nearest(plan, |limit| limit.starts_with(IMPACT)).map(limit));
    parts.extend(moving_walls(plan));
    parts.push(
        "the contact is too soft for this load or impact: raise the normal stiffness by the square of the ratio of \
         this overlap to the limit"
            .into(),
    );
    parts.join("; ")
}

/// Returns the part of a message that names the walls which move whatever the forces on them are; none without.
fn moving_walls(plan: &Plan) -> Option<String> {
    let walls = plan.scene.walls.iter();
    let moving =
        walls.filter(|wall| wall.servo.is_none() && wall.velocity.iter().any(|v| *v != 0.0));
    let names: Vec<String> = moving.map(|wall| format!("`{}`", wall.name)).collect();
    (!names.is_empty()).then(|| {
        format!(
            "no stiffness helps where the moving wall {} leaves a body no room: stop it earlier",
            names.join(" or ")
        )
    })
}

/// Beginning of the name of the limit of [`plan`] for impacts.
pub(super) const IMPACT: &str = "overlap of an impact";

/// Returns the engine's message about a failure, extended by the nearest limit and a remedy.
#[must_use]
pub fn of_solids(error: Error, plan: &Plan) -> Error {
    let Error::Numerical(text) = error else {
        return error;
    };
    // For a grain that left the box there is a more specific message.
    if Escape::in_text(&text).is_some() {
        return Error::Numerical(text);
    }
    let mut parts = vec![text];
    parts.extend(nearest(plan, |limit| limit.starts_with(SOLID)).map(limit));
    parts.push(
        "in similar cases, where contacts threw grains apart, a smaller time.solid_time_step_safety helped".into(),
    );
    Error::Numerical(parts.join("; "))
}

/// Beginning of the names of the limits of the solids.
const SOLID: &str = "solid time step";
/// Beginning of the name of the limit of [`plan`] for the cell Reynolds number.
const CELL_REYNOLDS: &str = "cell Reynolds number";

/// Beginning of the names of the limits of imposed pressures.
const PRESSURE: &str = "density change";

/// Returns the limit of the plan with the smallest margin among the selected limits.
fn nearest(plan: &Plan, asked: impl Fn(&str) -> bool) -> Option<&Margin> {
    plan.margins
        .iter()
        .filter(|margin| margin.used.is_finite() && asked(&margin.limit))
        .max_by(|a, b| a.used.total_cmp(&b.used))
}

/// Returns the [`nearest`] limit among those for the water, except tau > 1/2, and except limits at which the
/// program itself placed the time step.
fn nearest_of_water(plan: &Plan) -> Option<&Margin> {
    let own = |limit: &str| {
        limit.starts_with(SOLID)
            || limit.starts_with("time step for")
            || limit.starts_with("relaxation time")
    };
    nearest(plan, |limit| !own(limit))
}

fn limit(margin: &Margin) -> String {
    format!(
        "the nearest limit of the plan is `{}`, {} of {} ({})",
        margin.limit,
        number(margin.value),
        number(margin.allowed),
        margin.path
    )
}

/// Returns a remedy that helped in a similar case; otherwise a hint.
///
/// Failed runs, with changes that did not help and changes that did:
///
/// - Channel, parabolic inlet, cell Reynolds number 15, TRT at tau = 0.52. Still failed with 1/2 and 1/4 of the
///   time step, larger time steps, slower ramp, other outlets, BGK, the MRT of Suga; completed with half the
///   spacing, 2/3 of the speed, 3/2 of the viscosity, cumulants.
/// - Lid at cell Reynolds number 1000, tau = 0.5006. Still failed with 1/3 and 1/15 of the time step, 1/2 to 1/8 of
///   the spacing, cumulants, MRT; completed with a viscosity that reduces the cell Reynolds number to 25.
/// - Vortices at cell Reynolds number 300, TRT. Still failed with half the time step, half the spacing; completed
///   with a tenth of the speed, ten times the viscosity, BGK, MRT, cumulants.
/// - Wires across a channel without a gap. Completed after every second wire was removed.
/// - Disc in a channel, lattice velocity 0.3 in the gaps, tau = 0.6. Completed with half the time step (tau =
///   0.55), also with half the spacing or half the speed in addition.
/// - Pressure imposed at once, 30 % compression, tau = 0.8. Still failed with larger time steps, a ramp; completed
///   with half the time step (tau = 0.65).
fn remedy(kind: Kind, one_way: bool, plan: &Plan) -> String {
    let crossed = nearest(plan, |limit| limit.starts_with(CELL_REYNOLDS));
    if let Some(margin) = crossed.filter(|margin| margin.used > 1.0) {
        let finest = plan.scene.grid.spacing / margin.used;
        return format!(
            "in similar cases a smaller time step did not help, but a cell Reynolds number of at most {} did: \
             use a spacing of at most {} m, a slower flow or a larger viscosity",
            number(margin.allowed),
            number(finest)
        );
    }
    let pressure = nearest_of_water(plan).is_some_and(|margin| margin.limit.starts_with(PRESSURE));
    match kind {
        Kind::TooDense if one_way => "check that an open path of several cells leads from inlet to outlet",
        Kind::TooFast => "in similar cases a smaller time step (a smaller relaxation time at the same viscosity) \
                          helped",
        Kind::TooDense if pressure => {
            "in similar cases with an imposed pressure, a smaller time step (a smaller relaxation time at the \
             same viscosity) helped, but a ramp did not"
        }
        Kind::TooDense | Kind::NotFinite => "`solver plan` shows all limits",
    }
    .into()
}
