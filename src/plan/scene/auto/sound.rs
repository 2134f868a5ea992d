//! Time for the pressure to settle in a lattice fluid, which is compressible with the speed of sound c = h/(3^½
//! Δt).
//!
//! *Openings.* A start between an imposed velocity and an imposed pressure sends sound through the domain. If the
//! pressure opening absorbs it ([`lbm::boundary::Sound`]) the velocity error is 5 % after three passages of the
//! length L, 1.3 % after four and 0.6 % after eight; `lbm::boundary::sound` tests this. Therefore c t ≥ n L with n
//! = 4.
//!
//! *Inflows that change.* Incompressible water has the discharge of a table at every section at once; in the lattice
//! the front travels the length L between openings in L/c and returns from a reflecting opening. A velocity that
//! changes by the part r of its largest value per second is late, or too large after the reflection, by r L/c of this
//! value.
//!
//! *Narrow passages.* Before water flows steadily through a narrow passage, the pressure upstream must rise. A
//! passage of resistance I per density and viscosity (flow per depth q = Δp/(12 μ I)) fills a volume V per depth,
//! which stores V/(ρ c²), with the time constant
//!
//! T = 12 ν I V/c²
//!
//! A slot of width g and length b has I = b/g³. Between round solids, where the width is g + x²/(2r) at x along the
//! passage, lubrication theory gives I = ∫ dx/(g + x²/(2r))³ = (3π/8) (2 r g)^½/g³; 1/r is the sum of the
//! curvatures of the two sides. After m T the pressure is built up to exp(-m).
//!
//! *Sudden starts.* A body that starts suddenly sends sound through a domain without openings, where only friction
//! at walls and bodies damps it. The slowest wave has the angular frequency ω = 2πc/L with a period L, πc/L between
//! walls. With a surface S around a volume V its amplitude decays at the rate (G. Kirchhoff, Ann. Phys. 210 (1868)
//! 177-193, without heat conduction)
//!
//! γ = (S/2V) (ν ω/2)^½,
//!
//! or, if the layers fill the passage (S/V = 2/H), at γ = 6ν/H². For γ > ω there is no oscillation, and the
//! pressure equalises at the rate ω²/(2γ).
//!
//! *Oscillating forces.* Solids and walls under a force that oscillates with ω = 2π/T cause standing waves of
//! sound. Incompressible water would respond at once; the slowest wave, ω₀ = 2πc/λ, responds like an oscillator
//! with the damping rate γ above, with the relative error
//!
//! e = |x² - i d|/|1 - x² + i d|,  x = ω/ω₀ = λ/(cT),  d = 2γω/ω₀².

use super::gaps::Gap;
use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::body_force::BodyForce;
use crate::scene::findings::number;
use crate::scene::flow::Flow;
use crate::scene::initial::Initial;
use base::number::real;
use lbm::boundary::{Condition, Inflow, Strength};
use std::f64::consts::PI;

/// Number of passages of sound between openings after which a start has settled to 1.3 %.
const PASSAGES: f64 = 4.0;
/// Number of time constants after which the pressure upstream of a narrow passage has risen to within one per cent.
const TIME_CONSTANTS: f64 = 4.6;

/// Returns the time at which results are used first \[s\]: the start of averages, or the end of the run.
fn first_use_time(scene: &Scene) -> f64 {
    let averages = scene.output.averages.iter().map(|averages| averages.from);
    averages
        .filter(|from| *from > 0.0)
        .fold(scene.time.end, f64::min)
}

/// Returns the longest time step \[s\] for which sound passes often enough between openings, with a description of
/// the requirement; none if nothing causes sound.
pub(super) fn passages(scene: &Scene, flow: &Flow) -> Option<(String, f64)> {
    let mut axes = [false; 3];
    let mut driven = false;
    for patch in flow.patches() {
        let model = patch.condition.model();
        if model.passes_water() {
            axes[patch.face.axis()] = true;
        }
        let place = patch.imposed_at(&scene.grid, "");
        driven |= model.kind().strength == Strength::Velocity
            && matches!(model.inflow(&place), Inflow::Mean(speed) if speed.abs() > 0.0);
    }
    if !driven {
        return None;
    }
    let lengths = (0..3).filter(|a| axes[*a]).map(|a| scene.grid.size[a]);
    let length = lengths.fold(0.0, f64::max);
    let time = first_use_time(scene);
    let what = format!(
        "sound that passes {PASSAGES} times the {} m between openings in {} s",
        number(length),
        number(time)
    );
    let step = scene.grid.spacing * time / (3.0_f64.sqrt() * PASSAGES * length);
    Some((what, step))
}

/// Inflow whose velocity changes with time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transit {
    /// Length between openings \[m\].
    length: f64,
    /// Largest change per second, as a fraction of the largest velocity [1/s].
    rate: f64,
    /// `true` if the velocity jumps during the run.
    pub(super) jumps: bool,
}

/// Returns the fastest change of an imposed velocity by its table; none if all are constant. A ramp is a start, after
/// which the flow settles.
pub(super) fn transit(scene: &Scene, flow: &Flow) -> Option<Transit> {
    let mut found: Option<Transit> = None;
    let mut length = 0.0_f64;
    for patch in flow.patches() {
        if patch.condition.model().passes_water() {
            length = length.max(scene.grid.size[patch.face.axis()]);
        }
        let Condition::Velocity(velocity) = &patch.condition else {
            continue;
        };
        if let Some(table) = &velocity.history {
            let largest = table.iter().map(|row| row[1].abs()).fold(0.0, f64::max);
            for rows in table.windows(2) {
                let [from, to] = [rows[0], rows[1]];
                let change = (to[1] - from[1]).abs() / largest;
                if !(change > 0.0 && from[0] < scene.time.end) {
                    continue;
                }
                let known = found.get_or_insert(Transit {
                    length: 0.0,
                    rate: 0.0,
                    jumps: false,
                });
                if to[0] > from[0] {
                    known.rate = known.rate.max(change / (to[0] - from[0]));
                } else {
                    known.jumps = true;
                }
            }
        }
    }
    found.map(|found| Transit { length, ..found })
}

impl Transit {
    /// Returns the error of the flow relative to its largest value, at a spacing \[m\] and a time step \[s\].
    pub(super) fn error(&self, spacing: f64, time_step: f64) -> f64 {
        self.rate * self.length * 3.0_f64.sqrt() * time_step / spacing
    }

    /// Returns the longest time step \[s\] with at most this error, and a description of the requirement.
    pub(super) fn longest_step(&self, spacing: f64, error: f64) -> (String, f64) {
        let what = format!(
            "sound that passes the {} m between openings while the inflow changes by {} %",
            number(self.length),
            number(100.0 * error)
        );
        (
            what,
            error * spacing / (3.0_f64.sqrt() * self.length * self.rate),
        )
    }
}

/// Returns the decay rate \[1/s\] of sound of this angular frequency, for a ratio of surface to volume \[1/m\].
#[must_use]
pub fn damping(frequency: f64, viscosity: f64, surface_over_volume: f64) -> f64 {
    let swinging = damping_of(frequency, viscosity, surface_over_volume);
    if swinging > frequency {
        0.5 * frequency * frequency / swinging
    } else {
        swinging
    }
}

/// Returns the decay rate [1/s] of sound by friction in boundary layers, or in layers that fill the passage.
fn damping_of(frequency: f64, viscosity: f64, surface_over_volume: f64) -> f64 {
    let layers = 0.5 * surface_over_volume * (0.5 * viscosity * frequency).sqrt();
    let filled = 1.5 * viscosity * surface_over_volume * surface_over_volume;
    layers.max(filled)
}

/// Returns a body that starts suddenly, and the fraction of its sound that remains when values are used; none if
/// sound leaves through openings.
pub(super) fn left_of_a_start<'a>(scene: &'a Scene, flow: &Flow) -> Option<(&'a NamedBody, f64)> {
    if flow.patches().any(|p| p.condition.model().passes_water()) {
        return None;
    }
    let Initial::Uniform { velocity, .. } = flow.initial else {
        return None;
    };
    let started = |body: &&NamedBody| {
        let moves = body.mobility != Mobility::Fixed;
        let differs =
            (body.motion_at_start()[0].iter().zip(&velocity)).any(|(a, b)| (a - b).abs() > 0.0);
        differs && (moves || velocity.iter().any(|u| u.abs() > 0.0))
    };
    let body = scene.bodies.iter().find(started)?;
    let grid = &scene.grid;
    let sound = grid.spacing / (3.0_f64.sqrt() * flow.time_step);
    let frequency = (0..grid.dimension).map(|axis| 2.0 * PI * sound / longest_wave(scene, axis));
    let slowest = frequency.fold(f64::INFINITY, f64::min);
    let over = surface_over_volume(scene);
    let rate = damping(slowest, flow.kinematic_viscosity, over);
    Some((body, (-rate * first_use_time(scene)).exp()))
}

/// Returns the longest standing wave along an axis \[m\]: a period, or twice the distance between walls.
fn longest_wave(scene: &Scene, axis: usize) -> f64 {
    let waves = if scene.grid.periodic[axis] { 1.0 } else { 2.0 };
    waves * scene.grid.size[axis]
}

/// Returns the surface of walls and round bodies divided by the volume of the water [1/m].
fn surface_over_volume(scene: &Scene) -> f64 {
    let grid = &scene.grid;
    let axes = 0..grid.dimension;
    let volume: f64 = axes.clone().map(|axis| grid.size[axis]).product();
    let walls = axes.filter(|axis| !grid.periodic[*axis]);
    let walls: f64 = walls.map(|axis| 2.0 * volume / grid.size[axis]).sum();
    let (mut surface, mut open) = (walls, volume);
    for radius in scene.bodies.iter().map(|body| body.radius) {
        let (of_it, inside) = if grid.dimension == 2 {
            (2.0 * PI * radius, PI * radius * radius)
        } else {
            (4.0 * PI * radius * radius, 4.0 / 3.0 * PI * radius.powi(3))
        };
        surface += of_it;
        open -= inside;
    }
    surface / open.max(0.1 * volume)
}

/// Standing waves of sound caused by an oscillating force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Waves {
    /// Length of the longest wave \[m\].
    length: f64,
    /// Period of the force \[s\].
    period: f64,
    surface_over_volume: f64,
    viscosity: f64,
}

/// Returns the waves of the body force; none if the force does not oscillate, or drives nothing against walls and
/// solids.
pub(super) fn waves(scene: &Scene, flow: &Flow) -> Option<Waves> {
    let BodyForce::Oscillating {
        amplitude, period, ..
    } = flow.body_force
    else {
        return None;
    };
    let grid = &scene.grid;
    let solid = scene.has_solids() || scene.structures.iter().any(|s| s.stops.water());
    let opens = |axis: usize| {
        let mut patches = flow.patches();
        patches.any(|p| p.face.axis() == axis && p.condition.model().passes_water())
    };
    let length = |axis: usize| {
        let driven = amplitude[axis].abs() > 0.0;
        if opens(axis) {
            // Between a velocity and a pressure opening the wave is four times as long as the domain.
            (driven || solid).then_some(4.0 * grid.size[axis])
        } else if grid.periodic[axis] {
            solid.then(|| longest_wave(scene, axis))
        } else {
            (driven || solid).then(|| longest_wave(scene, axis))
        }
    };
    let length = (0..grid.dimension).filter_map(length).reduce(f64::max)?;
    Some(Waves {
        length,
        period,
        surface_over_volume: surface_over_volume(scene),
        viscosity: flow.kinematic_viscosity,
    })
}

impl Waves {
    /// Returns the relative error of the flow at a spacing \[m\] and a time step \[s\].
    pub(super) fn error(&self, spacing: f64, time_step: f64) -> f64 {
        let sound = spacing / (3.0_f64.sqrt() * time_step);
        let own = 2.0 * PI * sound / self.length;
        let driven = 2.0 * PI / self.period;
        let rate = damping_of(own, self.viscosity, self.surface_over_volume);
        let (x, d) = ((driven / own).powi(2), 2.0 * rate * driven / (own * own));
        x.hypot(d) / (1.0 - x).hypot(d)
    }

    /// Returns the longest time step \[s\] with at most this error, and a description of the requirement.
    pub(super) fn longest_step(&self, spacing: f64, error: f64) -> (String, f64) {
        let mut time_step = spacing * self.period * error.sqrt() / (3.0_f64.sqrt() * self.length);
        while self.error(spacing, time_step) > error {
            time_step *= 0.9;
        }
        let what = format!(
            "sound that passes waves of {} m in a small part of the period of {} s",
            number(self.length),
            number(self.period)
        );
        (what, time_step)
    }
}

/// Narrow passage of the water.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Width \[m\].
    pub width: f64,
    /// Kind of the adjacent solids.
    pub adjacent: AdjacentSolids,
}

impl Passage {
    /// Returns the passage through a gap.
    pub(crate) fn through_gap(gap: &Gap) -> Self {
        let adjacent = if gap.faces {
            AdjacentSolids::Flat(gap.adjacent_width)
        } else {
            AdjacentSolids::Round(gap.radius)
        };
        Self {
            width: gap.width,
            adjacent,
        }
    }
}

/// Kind of solids next to a narrow passage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AdjacentSolids {
    /// Round solids: the inverse of the sum of the curvatures of both sides \[m\], half the radius between equal
    /// discs.
    Round(f64),
    /// Flat walls of this length along the passage \[m\].
    Flat(f64),
}

/// Returns the resistance I of a passage [1/m²].
#[must_use]
pub fn resistance(passage: &Passage) -> f64 {
    let Passage { width, adjacent } = *passage;
    match adjacent {
        AdjacentSolids::Round(radius) => {
            3.0 * PI / 8.0 * (2.0 * radius * width).sqrt() / width.powi(3)
        }
        AdjacentSolids::Flat(length) => length / width.powi(3),
    }
}

/// Cells, water and duration of the filling of a chamber.
#[derive(Clone, Copy, Debug)]
pub struct FillingScale {
    /// Spacing \[m\].
    pub spacing: f64,
    /// Kinematic viscosity [m²/s].
    pub viscosity: f64,
    /// Time after which the pressure has risen \[s\].
    pub time: f64,
}

/// Returns the longest time step \[s\] for which the pressure upstream of `rows` such passages in series has risen
/// after the time of `scale`. Each passage fills a volume of `length` along the flow and `height` across it \[m\].
#[must_use]
pub fn filling(
    passage: &Passage,
    rows: usize,
    [length, height]: [f64; 2],
    scale: &FillingScale,
) -> f64 {
    let FillingScale {
        spacing,
        viscosity,
        time,
    } = *scale;
    let series = 12.0 * viscosity * real(rows) * resistance(passage) * length * height;
    // t = m T = m series/c² with c² = h²/(3 Δt²).
    spacing * (time / (3.0 * TIME_CONSTANTS * series)).sqrt()
}

/// Returns the longest time step \[s\] for which the pressure upstream of a narrow gap along `axis` rises in time,
/// and a description of the requirement. The gap fills the volume of the water next to its solids.
pub(super) fn building_up(scene: &Scene, viscosity: f64, axis: usize, gap: &Gap) -> (String, f64) {
    let passage = Passage::through_gap(gap);
    let sides = (0..scene.grid.dimension).filter(|side| *side != axis);
    let across = sides
        .map(|side| scene.grid.size[side])
        .fold(gap.adjacent_width + gap.width, f64::min);
    let time = first_use_time(scene);
    let scale = FillingScale {
        spacing: scene.grid.spacing,
        viscosity,
        time,
    };
    let step = filling(&passage, 1, [scene.grid.size[axis], across], &scale);
    let what = format!(
        "the build-up of the pressure in front of the {} in {} s",
        gap.what,
        number(time)
    );
    (what, step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks a chamber of 4.5 by 1.12 mm, minus half a disc, behind a gap of 0.12 mm between discs of 1 mm, in
    /// cells of 0.02 mm at a relaxation time of one: in a run the pressure at its end followed 1 - exp(-t/T) with T
    /// = 0.325 s between
    /// 0.57 and 1.17 s.
    #[test]
    fn a_chamber_fills_in_the_time_of_a_run() {
        let passage = Passage {
            width: 1.2e-4,
            adjacent: AdjacentSolids::Round(2.5e-4),
        };
        let (spacing, viscosity) = (2e-5, 1e-6);
        let measured = 0.325;
        let chamber = 4.5e-3 * 1.12e-3 - 0.5 * PI * 2.5e-7;
        let step = filling(
            &passage,
            1,
            [chamber / 1.12e-3, 1.12e-3],
            &FillingScale {
                spacing,
                viscosity,
                time: TIME_CONSTANTS * measured,
            },
        );
        let of_the_run = spacing * spacing / (6.0 * viscosity);
        approx::assert_relative_eq!(step, of_the_run, max_relative = 0.03);
    }

    /// Checks the limit of slots in series over the whole length: they form a channel in which the pressure
    /// diffuses with c² k/ν, k = g²/12, in a time L²/D.
    #[test]
    fn slots_over_the_whole_length_are_a_channel() {
        let (width, length) = (1e-4, 5e-3);
        let passage = Passage {
            width,
            adjacent: AdjacentSolids::Flat(length),
        };
        let (spacing, viscosity, time) = (1e-5, 1e-6, 2.0);
        let scale = FillingScale {
            spacing,
            viscosity,
            time,
        };
        let step = filling(&passage, 1, [length, width], &scale);
        let sound = spacing / (3.0_f64.sqrt() * step);
        let diffusivity = sound * sound * width * width / (12.0 * viscosity);
        let constant = length * length / diffusivity;
        approx::assert_relative_eq!(time, TIME_CONSTANTS * constant, max_relative = 1e-12);
    }

    /// Checks water in a closed box of length L under an oscillating force, without friction: the pressure at the
    /// ends is that of incompressible water times tan(z)/z, z = ωL/(2c) (L. D. Landau and E. M. Lifshitz, Fluid
    /// Mechanics, 1987, section 64).
    #[test]
    fn waves_under_a_force_are_as_large_as_in_a_closed_box() {
        let waves = Waves {
            length: 2.0,
            period: 1.0,
            surface_over_volume: 0.0,
            viscosity: 0.0,
        };
        for x in [0.05, 0.1, 0.3, 0.6, 0.9] {
            // c = λ/(xT).
            let time_step = x / (3.0_f64.sqrt() * waves.length);
            let z = 0.5 * PI * x;
            let exact = z.tan() / z - 1.0;
            let found = waves.error(1.0, time_step);
            assert!(
                exact <= found && found <= 1.3 * exact,
                "{x}: {exact} {found}"
            );
        }
        let (_, step) = waves.longest_step(1.0, 0.01);
        assert!(waves.error(1.0, step) <= 0.01 && waves.error(1.0, 1.2 * step) > 0.01);
    }

    /// Checks waves between plates at a distance H: they oscillate with ω² = c² k² (1 - tanh(z)/z), z = (iω/ν)^½
    /// H/2 (C. Zwikker and C. Kosten, Sound absorbing materials, 1949, without heat conduction). The imaginary part
    /// of ω is the decay rate.
    #[test]
    fn sound_dies_away_as_between_plates() {
        type Complex = nalgebra::Complex<f64>;
        let (height, length, viscosity) = (5.5e-3, 1e-2, 1e-4_f64);
        for sound in [2.0, 8.0, 32.0] {
            let wave = 2.0 * PI / length * sound;
            let next = |omega: Complex| {
                let z = (Complex::i() * omega / viscosity).sqrt() * (0.5 * height);
                (Complex::from(1.0) - z.tanh() / z).sqrt() * wave
            };
            let mut omega = Complex::from(wave);
            for _ in 0..200 {
                omega = (omega + next(omega)) * 0.5;
            }
            assert!((next(omega) - omega).norm() < 1e-9 * wave, "{omega}");
            let rate = damping(wave, viscosity, 2.0 / height);
            approx::assert_relative_eq!(rate, omega.im, max_relative = 0.1);
        }
    }
}
