//! Density changes in the lattice fluid, estimated before the run: a pressure p is a relative density change p/(ρ
//! c²), c the speed of sound.
//!
//! In addition to the pressures stated in a case, the flow itself requires pressures, estimated from above:
//!
//! ```text
//! drive     ρ c U, at most 2 ρ U L/T      a velocity that changes by U, at once or during the time T
//! rim       ρ U (0.35 c + k ν/h)          a uniform profile that ends at a wall; k = 1.8 in 2-D, 3.9 in 3-D
//! lid       ρ U (0.05 c + k ν/h)          a moving wall that meets one at rest; k = 2.8 in 2-D, 3.15 in 3-D
//! channel   12 ρ ν U L/(a² (1 - 0.63 a/b))    between plates (b infinite) or in a duct a x b
//!           f L ρ U²/(2 D), f = 0.316 Re^(-1/4)    if larger, from Re = 2300; D the hydraulic diameter
//! solids    see [`super::sections`]
//! gap       12 ρ ν I q + 0.75 ρ (q/g)²    width g, resistance I ([`super::sound`]), discharge per depth q
//! force     f L                           a body force against walls
//! ```
//!
//! The first is the pressure of a closing valve (Joukowsky); behind a uniform inlet between walls it is 1.1 times as
//! high. The second and the third were measured behind uniform inlets and under lids at relaxation times of 0.51 to
//! 1.5. The fourth is laminar flow (R. K. Shah and A. L. London 1978) or Blasius' friction. With the lattice velocity u
//! = U dt/h the changes of density are 3^½ u for a start and 3 p dt²/(ρ h²) for a steady pressure.

use super::gaps::Gap;
use super::sections::{self, End, Sections};
use super::sound;
use crate::scene::Scene;
use crate::scene::boundaries::ScenePatch;
use crate::scene::flow::{Flow, PATH};
use crate::scene::initial::Initial;
use crate::scene::speed::{PILOT_MARGIN, passage};
use base::history::TimeTable;
use lbm::boundary::profile::VelocityProfile;
use lbm::boundary::{Condition, Inflow, Strength, SurfaceKind};
use serde::Serialize;

/// Factor of the sound pressure of a sudden start behind a uniform profile between walls.
const RIM_SOUND_FACTOR: f64 = 1.1;
/// Ratio of the velocity that determines the sound pressure of a sudden start to the mean of the profile, for profiles
/// that vanish at walls.
const PROFILE_SOUND_FACTOR: f64 = 1.2;
/// Coefficients of the pressure at the rim of an inlet: of ρ U C, and of ρ U ν/h in 2-D and 3-D.
const RIM_OF_INERTIA: f64 = 0.2;
const RIM_OF_FRICTION: [f64; 2] = [1.8, 3.9];

/// Loss along a winding passage between structures relative to that of its sections: for baffles it was 1.7 to 2
/// times as large.
const WINDING: f64 = 2.0;
/// Coefficients of the pressure at the corner of a moving and a stationary wall.
const LID_OF_INERTIA: f64 = 0.03;
const LID_OF_FRICTION: [f64; 2] = [2.8, 3.15];

/// Ratio of the estimates to the results of runs: behind inlets 1.2 to 1.5; in the corners of fast lids the change
/// grows faster than the velocity.
const ESTIMATE_RATIO: f64 = 1.3;
const LID_ESTIMATE_RATIO: f64 = 0.9;
/// Ratio for the sound of a start, which is exact except for spreading.
const START_ESTIMATE_RATIO: f64 = 1.0;

/// Change of a velocity that drives the water: its size [m/s] and its duration \[s\], 0 for an immediate change.
pub(super) type Change = [f64; 2];

/// Returns the changes of a velocity by a table of factors before `end` \[s\]: the start from rest, within `ramp_time`
/// \[s\], and the changes between rows. `value` [m/s] is the velocity for a factor of 1, `start` that of the water.
pub(super) fn changes(
    table: Option<&[[f64; 2]]>,
    [value, start]: [f64; 2],
    ramp_time: f64,
    end: f64,
) -> Vec<Change> {
    let first = TimeTable::new(table, 1.0).value_after(0.0);
    let rows = table.unwrap_or(&[]).windows(2);
    let rows = rows.filter(|rows| rows[0][0] < end && rows[1][0] > 0.0);
    let between = rows.map(|rows| {
        let [from, to] = [rows[0], rows[1]];
        [(value * (to[1] - from[1])).abs(), to[0] - from[0]]
    });
    let from_rest = [(value * first - start).abs(), ramp_time];
    let all = std::iter::once(from_rest).chain(between);
    all.filter(|[size, _]| *size > 0.0).collect()
}

/// Cause of a density change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// Name of the cause.
    pub what: &'static str,
    /// JSON path of the field that determines the cause.
    pub path: String,
    /// Pressure that does not depend on the time step \[Pa\].
    pub pressure: f64,
    /// Velocity whose sound or inertia changes the density: by `sound` times the lattice velocity.
    pub velocity: f64,
    /// Relative density change divided by the lattice velocity of `velocity`.
    pub sound: f64,
    /// Upper bound of the sound pressure \[Pa\]: that of a slow change; infinite for a sudden one.
    pub most: f64,
    /// Minimum ratio of the estimate to the results of runs.
    pub over: f64,
}

impl Cause {
    fn steady(what: &'static str, path: String, pressure: f64) -> Self {
        Self {
            what,
            path,
            pressure,
            velocity: 0.0,
            sound: 0.0,
            most: f64::INFINITY,
            over: ESTIMATE_RATIO,
        }
    }

    /// Returns the sound of a drive whose velocity changes, for a relative density change of `sound` times the lattice
    /// velocity and a path of the sound of `length` \[m\]; none if it does not change. A change within T has at most
    /// the pressure 2 ρ U L/T.
    pub(super) fn drive(
        (what, path): (&'static str, String),
        changes: &[Change],
        (sound, density, length): (f64, f64, f64),
        over: f64,
    ) -> Option<Self> {
        let bound = |[size, time]: Change| {
            if time > 0.0 {
                2.0 * density * size * length / time
            } else {
                f64::INFINITY
            }
        };
        let velocity = changes.iter().map(|change| change[0]).fold(0.0, f64::max);
        (velocity > 0.0).then(|| Self {
            what,
            path,
            pressure: 0.0,
            velocity,
            sound,
            most: changes.iter().copied().map(bound).fold(0.0, f64::max),
            over,
        })
    }

    /// Returns `true` for the sound of a drive that changes gradually: results while it changes are those of sound.
    pub(crate) fn is_gradual(&self) -> bool {
        self.sound > 0.0 && self.most.is_finite()
    }

    /// Returns `true` for a pressure loss along the flow, whose density change is an error of the flow.
    pub(crate) fn is_loss(&self) -> bool {
        self.velocity == 0.0
    }

    /// Returns the relative density change at a time step \[s\] and a spacing \[m\].
    pub(crate) fn change(&self, time_step: f64, spacing: f64, density: f64) -> f64 {
        let of = |pressure: f64| 3.0 * pressure * (time_step / spacing).powi(2) / density;
        let sound = self.sound * self.velocity * time_step / spacing;
        of(self.pressure) + sound.min(of(self.most))
    }
}

/// Returns the sum of all changes of density at a time step.
pub(crate) fn total(causes: &[Cause], time_step: f64, spacing: f64, density: f64) -> f64 {
    let changes = causes
        .iter()
        .map(|cause| cause.change(time_step, spacing, density));
    changes.sum()
}

/// Returns the smallest density change that a run is expected to show at a time step: that of its largest cause,
/// because causes act at different times and places.
pub(crate) fn smallest_change(causes: &[Cause], time_step: f64, spacing: f64, density: f64) -> f64 {
    let changes = causes
        .iter()
        .map(|cause| cause.change(time_step, spacing, density) / cause.over);
    changes.fold(0.0, f64::max)
}

/// Bound of the density change of a lattice fluid.
pub(crate) struct DensityBound {
    /// Largest relative change.
    pub(crate) bound: f64,
    /// Spacing \[m\].
    pub(crate) spacing: f64,
    /// Density at rest [kg/m³].
    pub(crate) density: f64,
}

/// Returns the longest time step \[s\] for which the sum of all density changes stays within a bound, and the
/// largest cause; none without causes.
pub(crate) fn longest_step<'a>(
    causes: &'a [Cause],
    &DensityBound {
        bound,
        spacing,
        density,
    }: &DensityBound,
) -> Option<(&'a Cause, f64)> {
    // A lattice velocity of one exceeds every limit.
    let fastest = causes
        .iter()
        .map(|cause| cause.velocity)
        .fold(0.0, f64::max);
    let pressure: f64 = causes.iter().map(|cause| cause.pressure).sum();
    if fastest <= 0.0 && pressure <= 0.0 {
        return None;
    }
    let mut high = 1.0;
    while total(causes, high, spacing, density) > bound && high > f64::MIN_POSITIVE {
        high *= 0.5;
    }
    while total(causes, 2.0 * high, spacing, density) <= bound && high < 1e300 {
        high *= 2.0;
    }
    let (mut low, mut high) = (high, 2.0 * high);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if total(causes, middle, spacing, density) <= bound {
            low = middle;
        } else {
            high = middle;
        }
    }
    let deciding = causes.iter().max_by(|a, b| {
        let change = |cause: &Cause| cause.change(low, spacing, density);
        change(a).total_cmp(&change(b))
    });
    deciding.map(|cause| (cause, low))
}

/// Returns the causes of density changes by the flow of a scene, in addition to the pressures stated in the case.
/// `narrow_gaps` are the narrow gaps along axes.
pub(crate) fn flow_causes(scene: &Scene, flow: &Flow, narrow_gaps: &[(usize, Gap)]) -> Vec<Cause> {
    let sections: [Option<Sections>; 3] = std::array::from_fn(|axis| {
        let imposed = |patch: &ScenePatch| imposes_a_velocity(patch) && patch.face.axis() == axis;
        let open = flow.patches().any(imposed);
        open.then(|| sections::along(scene, flow, axis, |across| ends(scene, flow, across)))?
    });
    let inlets = flow.patches().filter(|patch| imposes_a_velocity(patch));
    let inlets: Vec<Inlet> = inlets.filter_map(Inlet::new).collect();
    let mut causes = Vec::new();
    for inlet in &inlets {
        let open = sections[inlet.axis].as_ref().map(|found| found.open);
        causes.extend(inlet.start(scene, flow, open));
        causes.extend(inlet.rim_pressure(scene, flow));
    }
    causes.extend(flow.patches().filter_map(|patch| lid(scene, flow, patch)));
    for (axis, sections) in sections.iter().enumerate() {
        let largest = largest_discharge(scene, &inlets, axis);
        if let Some((discharge, inlet)) = largest {
            let loss = loss(scene, flow, axis, discharge, sections.as_ref(), narrow_gaps);
            causes.extend(
                loss.map(|(what, pressure)| Cause::steady(what, inlet.path.clone(), pressure)),
            );
            let terms = scene.terms.iter();
            let losses = terms.flat_map(|term| term.model().losses(&scene.grid, axis, discharge));
            causes.extend(
                losses.map(|one| Cause::steady(one.what, one.path, flow.density * one.loss)),
            );
        }
    }
    causes.extend(force_against_walls(scene, flow));
    if let Some(pilot) = &flow.pilot {
        // A loss measured in a pilot replaces the losses from formulas.
        causes.retain(|cause| !cause.is_loss());
        let pressure = PILOT_MARGIN * pilot.pressure;
        let path = format!("{PATH}.pilot.pressure");
        causes.push(Cause::steady("the pressure in a pilot", path, pressure));
    }
    causes
}

/// Returns the opening with the largest discharge along an axis, and that discharge.
fn largest_discharge<'a, 'b>(
    scene: &Scene,
    inlets: &'b [Inlet<'a>],
    axis: usize,
) -> Option<(f64, &'b Inlet<'a>)> {
    let through = inlets.iter().filter(|inlet| inlet.axis == axis);
    let discharges = through.filter_map(|inlet| Some((inlet.discharge(scene)?, inlet)));
    discharges.fold(None, |known, found| match known {
        Some(known) if known.0 >= found.0 => Some(known),
        _ => (found.0 > 0.0).then_some(found),
    })
}

/// Water that an opening drives through the narrowest section between solids along an axis.
pub(crate) struct Jet {
    /// JSON path of the field that determines its speed.
    pub(crate) path: String,
    /// Mean velocity in the section [m/s].
    pub(crate) speed: f64,
    /// Open fraction of the section.
    pub(crate) open: f64,
}

/// Returns the jets in the narrowest sections along each axis.
pub(crate) fn jets(scene: &Scene, flow: &Flow) -> Vec<Jet> {
    let inlets = flow.patches().filter(|patch| imposes_a_velocity(patch));
    let inlets: Vec<Inlet> = inlets.filter_map(Inlet::new).collect();
    let jets = (0..scene.grid.dimension).filter_map(|axis| {
        let (discharge, inlet) = largest_discharge(scene, &inlets, axis)?;
        let found = sections::along(scene, flow, axis, |across| ends(scene, flow, across))?;
        Some(Jet {
            path: inlet.path.clone(),
            speed: discharge / found.smallest,
            open: found.open,
        })
    });
    jets.collect()
}

fn imposes_a_velocity(patch: &ScenePatch) -> bool {
    let nature = patch.condition.model().kind();
    nature.surface == SurfaceKind::Opening && nature.strength == Strength::Velocity
}

/// Opening that imposes a velocity.
struct Inlet<'a> {
    patch: &'a ScenePatch,
    axis: usize,
    /// Speed imposed by the opening [m/s].
    speed: f64,
    /// JSON path of the field that determines the speed.
    path: String,
}

impl<'a> Inlet<'a> {
    fn new(patch: &'a ScenePatch) -> Option<Self> {
        let speed = patch.condition.model().speed()?;
        Some(Self {
            patch,
            axis: patch.face.axis(),
            speed: speed.value,
            path: patch.path(speed.field)?,
        })
    }

    /// Returns the velocity [m/s] of a uniform profile that ends at walls, where pressure rises at the rim.
    fn uniform_at_walls(&self, flow: &Flow) -> Option<[f64; 3]> {
        uniform(self.patch).filter(|_| ends_at_walls(flow, self.patch))
    }

    /// Returns the sound of the start; none if the fluid starts from a file or a given flow. `open` is the open
    /// fraction of the narrowest section.
    fn start(&self, scene: &Scene, flow: &Flow, open: Option<f64>) -> Option<Cause> {
        let Initial::Uniform {
            velocity: start, ..
        } = flow.initial
        else {
            return None;
        };
        let (axis, model) = (self.axis, self.patch.condition.model());
        let table = match &self.patch.condition {
            Condition::Velocity(velocity) => velocity.history.as_deref(),
            _ => None,
        };
        let velocities = match uniform(self.patch) {
            Some(velocity) => [velocity[axis], start[axis]],
            // Waves across the face decay within some steps.
            None => {
                let largest = TimeTable::new(table, 1.0).largest();
                let own = match model.largest_inflow(&self.patch.imposed_at(&scene.grid, PATH)) {
                    Inflow::Mean(mean) => (PROFILE_SOUND_FACTOR * mean.abs()).min(self.speed),
                    _ => self.speed,
                };
                [own / largest, -start[axis].abs()]
            }
        };
        let changes = changes(table, velocities, model.ramp_time(), scene.time.end);
        let rim = self.uniform_at_walls(flow).is_some();
        // Solids reflect part of the sound, which the opening reflects again: p (1 + 2 R), R = (1 - a)/(1 + a) for
        // the open fraction a.
        let back = open.map_or(0.0, |open| (1.0 - open) / (1.0 + open));
        let sound = 3.0_f64.sqrt() * (1.0 + 2.0 * back) * if rim { RIM_SOUND_FACTOR } else { 1.0 };
        let what = if table.is_some() {
            "the pressure wave of the changing inflow"
        } else {
            "the pressure wave of the start"
        };
        let over = if rim {
            ESTIMATE_RATIO
        } else {
            START_ESTIMATE_RATIO
        };
        let path = self.path.clone();
        let of = (sound, flow.density, scene.grid.size[axis]);
        Cause::drive((what, path), &changes, of, over)
    }

    fn rim_pressure(&self, scene: &Scene, flow: &Flow) -> Option<Cause> {
        let normal = self.uniform_at_walls(flow)?[self.axis].abs();
        let friction = RIM_OF_FRICTION[scene.grid.dimension - 2];
        Some(Cause {
            what: "a uniform profile next to a wall",
            path: self.path.clone(),
            pressure: friction * flow.density * flow.kinematic_viscosity * normal
                / scene.grid.spacing,
            velocity: normal,
            sound: 3.0 * RIM_OF_INERTIA,
            most: f64::INFINITY,
            over: ESTIMATE_RATIO,
        })
    }

    /// Returns the discharge [m²/s in 2-D, m³/s in 3-D]; none for a profile without a stated mean.
    fn discharge(&self, scene: &Scene) -> Option<f64> {
        let grid = &scene.grid;
        let place = self.patch.imposed_at(grid, PATH);
        let Inflow::Mean(mean) = self.patch.condition.model().largest_inflow(&place) else {
            return None;
        };
        let depth = grid.spacing.powi(if grid.dimension == 2 { 1 } else { 2 });
        Some(mean.abs() * place.area() * depth)
    }
}

/// Returns the pressure in the corner between a wall that moves in its plane and a stationary wall.
fn lid(scene: &Scene, flow: &Flow, patch: &ScenePatch) -> Option<Cause> {
    let model = patch.condition.model();
    let moves = model.kind().surface == SurfaceKind::MovingWall;
    let speed = model
        .speed()
        .filter(|_| moves && lid_meets_wall(flow, patch))?;
    let friction = LID_OF_FRICTION[scene.grid.dimension - 2];
    Some(Cause {
        what: "the corner of a moving wall",
        path: patch.path(speed.field)?,
        pressure: friction * flow.density * flow.kinematic_viscosity * speed.value
            / scene.grid.spacing,
        velocity: speed.value,
        sound: 3.0 * LID_OF_INERTIA,
        most: f64::INFINITY,
        over: LID_ESTIMATE_RATIO,
    })
}

/// Returns the pressure loss \[Pa\] along an axis at a discharge, and its name: the largest of the losses in the
/// channel, between solids and in narrow gaps, each of which applies to the whole path.
fn loss(
    scene: &Scene,
    flow: &Flow,
    axis: usize,
    discharge: f64,
    sections: Option<&Sections>,
    narrow_gaps: &[(usize, Gap)],
) -> Option<(&'static str, f64)> {
    let (density, viscosity) = (flow.density, flow.kinematic_viscosity);
    let channel = in_channel(scene, flow, axis, discharge);
    let channel = channel.map(|pressure| ("friction in the channel", pressure));
    let between = sections.map(|sections| {
        let speed = discharge / sections.smallest * (1.0 - sections.open);
        let winding = if scene.structures.is_empty() {
            1.0
        } else {
            WINDING
        };
        let friction = viscosity * sections.friction * discharge;
        let pressure = winding * density * (friction + 0.75 * speed * speed);
        ("the narrow opening between solids", pressure)
    });
    let narrow = narrow_gaps
        .iter()
        .filter(|(a, gap)| *a == axis && gap.width > 0.0);
    let narrow = narrow.map(|(_, gap)| {
        let resistance = sound::resistance(&sound::Passage::through_gap(gap));
        let speed = discharge / gap.width;
        let pressure = density * (12.0 * viscosity * resistance * discharge + 0.75 * speed * speed);
        ("a narrow passage", pressure)
    });
    let all = channel.into_iter().chain(between).chain(narrow);
    all.max_by(|a, b| a.1.total_cmp(&b.1))
}

fn force_against_walls(scene: &Scene, flow: &Flow) -> Option<Cause> {
    let grid = &scene.grid;
    let force = flow.body_force.largest();
    let against: f64 = (0..grid.dimension)
        .filter(|a| !grid.periodic[*a] && !opens(flow, *a))
        .map(|a| force[a].abs() * grid.size[a])
        .sum();
    let path = format!("{PATH}.body_force");
    (against > 0.0).then(|| Cause::steady("the body force against walls", path, against))
}

/// Returns the kinds of boundary at both ends of an axis.
fn ends(scene: &Scene, flow: &Flow, axis: usize) -> [End; 2] {
    if scene.grid.periodic[axis] {
        return [End::Periodic; 2];
    }
    [false, true].map(|upper| {
        let faces = flow
            .patches()
            .filter(|patch| patch.face.axis() == axis && patch.face.is_max() == upper);
        let mut walls = faces.map(|patch| is_wall(patch.condition.model().kind().surface));
        if walls.any(|wall| wall) {
            End::Wall
        } else {
            End::Slip
        }
    })
}

/// Returns the velocity of a uniform profile [m/s]; none for another condition.
fn uniform(patch: &ScenePatch) -> Option<[f64; 3]> {
    match &patch.condition {
        Condition::Velocity(velocity) => match &velocity.profile {
            VelocityProfile::Uniform(uniform) => Some(uniform.velocity.to_array()),
            _ => None,
        },
        _ => None,
    }
}

fn surfaces(flow: &Flow, axis: usize) -> impl Iterator<Item = SurfaceKind> + '_ {
    let faces = flow
        .patches()
        .filter(move |patch| patch.face.axis() == axis);
    faces.map(|patch| patch.condition.model().kind().surface)
}

fn is_wall(surface: SurfaceKind) -> bool {
    matches!(surface, SurfaceKind::Wall | SurfaceKind::MovingWall)
}

fn opens(flow: &Flow, axis: usize) -> bool {
    surfaces(flow, axis).any(|surface| surface == SurfaceKind::Opening)
}

/// Returns `true` if the patch has adjacent walls, on perpendicular faces or on its own face.
fn ends_at_walls(flow: &Flow, patch: &ScenePatch) -> bool {
    let axis = patch.face.axis();
    let across = (0..3).filter(|a| *a != axis);
    let beside = flow
        .patches()
        .any(|other| other.face == patch.face && is_wall(other.condition.model().kind().surface));
    beside || across.into_iter().any(|a| surfaces(flow, a).any(is_wall))
}

/// Returns `true` if a stationary wall is perpendicular to the moving wall.
fn lid_meets_wall(flow: &Flow, lid: &ScenePatch) -> bool {
    (0..3)
        .filter(|a| *a != lid.face.axis())
        .any(|a| surfaces(flow, a).any(|surface| surface == SurfaceKind::Wall))
}

/// Returns the pressure loss \[Pa\] along an axis through the whole domain; none if nothing bounds the channel.
fn in_channel(scene: &Scene, flow: &Flow, axis: usize, discharge: f64) -> Option<f64> {
    let grid = &scene.grid;
    let (length, _) = passage(scene, axis);
    let mut heights = Vec::new();
    let mut section = 1.0;
    for a in (0..grid.dimension).filter(|a| *a != axis) {
        section *= grid.size[a];
        let walls = surfaces(flow, a)
            .filter(|surface| is_wall(*surface))
            .count();
        match walls {
            _ if grid.periodic[a] => {}
            0 => {}
            // A plane of symmetry represents the other half.
            1 => heights.push(2.0 * grid.size[a]),
            _ => heights.push(grid.size[a]),
        }
    }
    heights.sort_by(f64::total_cmp);
    let narrow = *heights.first()?;
    let aspect = heights.get(1).map_or(0.0, |wide| narrow / wide);
    let speed = discharge / section;
    let laminar = 12.0 * flow.kinematic_viscosity * speed * length
        / (narrow * narrow * (1.0 - 0.63 * aspect));
    let hydraulic = 2.0 * narrow / (1.0 + aspect);
    let reynolds = speed * hydraulic / flow.kinematic_viscosity;
    let turbulent = 0.316 * reynolds.powf(-0.25) * length / hydraulic * 0.5 * speed * speed;
    Some(flow.density * laminar.max(if reynolds > 2300.0 { turbulent } else { 0.0 }))
}
