//! The largest stable time step of contacts, from the highest frequency of the bodies that they connect.
//!
//! A contact is a spring K and a dashpot C between two bodies with masses M, in the normal and tangential directions;
//! rotation also moves the contact point. For small motions, the explicit step with velocities half a step behind is
//!
//! ```text
//! x(n+1) - 2 x(n) + x(n-1) = -dt² M⁻¹ K x(n) - dt M⁻¹ C [x(n) - x(n-1)]
//! ```
//!
//! The solution grows and changes its sign in every step if the largest eigenvalue of `M⁻¹ (dt² K + 2 dt C)` is
//! above 4. Without dashpots this is dt > 2/w with the highest angular frequency w. Dashpots reduce the limit, that of
//! one oscillator by the factor sqrt(1 + zeta²) - zeta. Source: T. Belytschko, W. K. Liu, B. Moran, Nonlinear Finite
//! Elements for Continua and Structures, 2000, chapter 6. The maps of `benches/stability` confirm the limit.
//!
//! The step is compared with two limits:
//!
//! * The limit of the initial contacts of a listed or read sample, by power iteration, which converges to it from
//!   above. Above the limit without shear springs the case is refused; shear springs are left out because contacts
//!   under low pressure slip. Above the limit with shear springs, and with the largest overlaps that the law expects,
//!   the case is unstable.
//! * The limit of a packing of the smallest grains. `lambda m/k` of the normal springs is 6 or 8 in the densest packing
//!   of discs or spheres. That of the shear springs is 16 or 20 if all grains rotate in the same sense on 4 or 6
//!   neighbours, the number in a random packing. Z neighbours give at most `2 Z max(k_n, k_s (1 + m r²/I))/m`, the
//!   bound of a single element (B. M. Irons). Above this limit, grains that start apart or are prepared are unstable; a
//!   sample that its initial contacts hold together gets a warning.
//!
//! The limit of a block assumes springs on all its faces, with neighbours that move against it. Above the limit of a
//! single face the case is refused.
//!
//! Springs and dashpots of a contact come from its law: [`ContactModel::springs`].

mod blocks;
mod bonds;
mod network;

use super::Clock;
use super::critical_step::{critical_solid_time_step, largest_radius, moving};
use super::margin::{Margin, margin};
use crate::scene::Scene;
use crate::scene::findings::{Findings, at_least, at_most, number};
use crate::scene::grains::GrainSource;
use base::error::Remedy;
use base::number::to_u32;
use dem::contact::{BondOpening, ContactModel, Depth, StaticContact};

/// Returns the time step at which `dt² stiffness + 2 dt dashpot` is 4, with both divided by the mass.
fn limit(stiffness: f64, dashpot: f64) -> f64 {
    4.0 / (dashpot + (dashpot * dashpot + 4.0 * stiffness).sqrt())
}

/// Returns m r²/I of a disc or sphere.
fn mass_over_inertia(dimension: usize) -> f64 {
    if dimension == 2 { 2.0 } else { 2.5 }
}

/// Returns the limit of the densest packing of one kind of grain, each with at most `partners` neighbours of its size,
/// and that of a grain between two of the largest bodies.
fn densest_limit(scene: &Scene, law: &dyn ContactModel, kind: (usize, f64), partners: f64) -> f64 {
    let (material, radius) = kind;
    let mass = scene.mass(material, radius);
    let dimension = scene.grid.dimension;
    let (lattice, kissing): ([f64; 2], f64) = if dimension == 2 {
        ([6.0, 16.0], 6.0)
    } else {
        ([8.0, 20.0], 12.0)
    };
    let round = 2.0 * partners.min(kissing);
    let factors = [
        lattice[0].min(round),
        lattice[1].min(round * (1.0 + mass_over_inertia(dimension))),
    ];
    let largest = largest_radius(scene).max(radius);
    let heavy = scene.mass(material, largest);
    // The heavier body moves less against the grain than one of its own mass.
    let between = partners.min(2.0) * (1.0 + mass / heavy);
    let between = [between, between * (1.0 + mass_over_inertia(dimension))];
    let mut shortest = f64::INFINITY;
    for other in 0..law.materials() {
        let touching = |radius_of_other: f64, mass_of_other: f64| StaticContact {
            materials: [to_u32(material), other],
            diameter: radius + radius_of_other,
            radius: radius / (1.0 + radius / radius_of_other),
            mass: mass / (1.0 + mass / mass_of_other),
            overlap: None,
            depth: Depth::Expected,
            bonded: bonds(scene, law),
        };
        for (contact, factors) in [
            (touching(radius, mass), factors),
            (touching(largest, heavy), between),
        ] {
            let found = law.springs(&contact);
            for (n, factor) in factors.into_iter().enumerate() {
                let [k, c] = [found.stiffness[n], found.dashpots[n]].map(|v| factor * v / mass);
                shortest = shortest.min(limit(k, c));
            }
        }
    }
    shortest
}

/// Returns `true` if contacts are bonded at the start.
fn bonds(scene: &Scene, law: &dyn ContactModel) -> bool {
    law.bonds() && scene.grains.as_ref().is_some_and(|g| g.bond_at_start)
}

/// Returns the maximum number of bodies that a grain can touch: all other bodies and the walls.
fn max_partners(scene: &Scene) -> f64 {
    let grains = scene.grains.as_ref().map_or(0, |grains| grains.expected);
    let appear = usize::from(!scene.regions.is_empty()) * 12;
    let all = grains + scene.bodies.len() + scene.walls.len() + appear;
    base::number::real(all.saturating_sub(1))
}

/// Returns the limit of the densest packing of the grains divided by their critical step; infinite if nothing
/// moves.
pub fn packing_limit(scene: &Scene) -> f64 {
    match (&scene.contact, critical_solid_time_step(scene)) {
        (Some(contact), Some(critical)) if contact.model().blocks().is_none() => {
            sphere_limit(scene, contact.model(), 0.0).packing / critical.time_step
        }
        _ => f64::INFINITY,
    }
}

/// Compares the solid step with the limits of the contacts.
pub(super) fn check(
    scene: &Scene,
    clock: &Clock,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let Some(contact) = &scene.contact else {
        return;
    };
    let (law, dt) = (contact.model(), clock.solid_time_step);
    openings(scene, law, findings);
    if bonds(scene, law) {
        bonds::check_bonds(scene, law, findings);
    }
    let limits = match law.blocks() {
        Some(law) => {
            blocks::energy(scene, law, findings);
            blocks::limits(scene, law)
        }
        None => sphere_limit(scene, law, dt),
    };
    let (sure, worst) = (limits.slipping, limits.sticking.min(limits.packing));
    let path = path(scene);
    if worst.is_finite() {
        margins.push(margin(
            "solid time step / limit of the densest contacts",
            dt,
            worst,
            path,
        ));
    }
    if sure.is_finite() {
        margins.push(margin(
            "solid time step / limit of the initial contacts",
            dt,
            sure,
            path,
        ));
    }
    // Blocks that move with the water of joints have one solid step, and a finding if it is too long.
    if findings.concerns("fluid.lattice_boltzmann.joints") {
        return;
    }
    let step = number(dt);
    if dt > sure {
        findings.error(
            path,
            format!(
                "a solid time step of {step} s is above {} s, the stability limit of the initial contacts",
                number(sure)
            ),
            remedy(scene, clock, sure),
        );
        if scene.joints.is_some() && scene.flow.is_none() {
            // The step is that of the water in joints.
            findings.depends(&["fluid"]);
        }
    } else if dt > worst {
        let reason = format!(
            "a solid time step of {step} s is above {} s, the stability limit of bodies with contacts on all sides",
            number(worst)
        );
        let remedy = remedy(scene, clock, worst);
        if dt > limits.sticking || !limits.held {
            findings.unstable(path, reason, remedy);
        } else {
            findings.warn(path, reason, remedy);
        }
    }
}

/// Returns the longest solid step \[s\] of at most `step` that [`check`] accepts, which is the automatic one.
pub(super) fn longest_accepted_step(scene: &Scene, step: f64) -> f64 {
    /// Maximum number of iterations: the stiffness of compressed contacts depends slightly on the step.
    const ROUNDS: usize = 4;
    let Some(contact) = &scene.contact else {
        return step;
    };
    let law = contact.model();
    let mut step = step;
    for _ in 0..ROUNDS {
        let limits = match law.blocks() {
            Some(law) => blocks::limits(scene, law),
            None => sphere_limit(scene, law, step),
        };
        let Some(longest) = limits.exceeded_limit(step) else {
            break;
        };
        step = 0.99 * longest;
    }
    step
}

impl Limits {
    /// Returns the limit \[s\] that a step exceeds, if the step is refused.
    fn exceeded_limit(&self, step: f64) -> Option<f64> {
        let worst = self.sticking.min(self.packing);
        let unstable = step > worst && (step > self.sticking || !self.held);
        let limit = if unstable {
            worst.min(self.slipping)
        } else {
            self.slipping
        };
        (step > limit).then_some(limit)
    }
}

/// Stable time steps of bodies \[s\], by assumption about their contacts.
struct Limits {
    /// Limit with the initial contacts, which may slip; infinite if they are not known or far from the limit.
    slipping: f64,
    /// Limit with the initial contacts, which stick and are compressed.
    sticking: f64,
    /// Limit in a packing of the smallest grains.
    packing: f64,
    /// `true` if initial contacts hold all bodies, so that they do not form a new packing at once.
    held: bool,
}

/// Opening of a bond, in diameters of the smallest grain, above which a third grain fits between the two.
const THIRD_GRAIN_FITS: f64 = 1.0;
/// Opening of a bond, in diameters of the smallest grain, above which the bond is longer than the contact that it
/// represents.
const LONG_BOND: f64 = 0.1;

/// Checks the opening at which a bond breaks, which is the range of the neighbour lists. A spring too soft for the
/// strength gives bonds across other grains, and very long lists.
fn openings(scene: &Scene, law: &dyn ContactModel, findings: &mut Findings) {
    let kinds = moving(scene);
    let smallest = 2.0 * kinds.iter().map(|k| k.1).fold(f64::INFINITY, f64::min);
    let mut widest: Option<BondOpening> = None;
    for &(material, radius) in &kinds {
        if material >= scene.materials.len() {
            continue;
        }
        for other in 0..law.materials() {
            let opening = law.bond_opening([to_u32(material), other], 2.0 * radius);
            let wider = |o: &BondOpening| o.widest() > widest.map_or(0.0, |known| known.widest());
            widest = opening.filter(wider).or(widest);
        }
    }
    let Some(bond) = widest else {
        return;
    };
    let (opening, path) = (bond.widest(), bond.path);
    let reason = |than: String| {
        format!(
            "a bond of {} N on a spring of {} N/m opens by {} m before it breaks, {than}",
            number(bond.strength),
            number(bond.stiffness),
            number(opening)
        )
    };
    let room = |part: f64| (part * smallest - bond.gap).max(0.0);
    let remedy = |part: f64| {
        if room(part) <= 0.0 {
            return format!("use a bonding gap below {} m", number(part * smallest));
        }
        format!(
            "use at most {} N, or a normal stiffness of at least {} N/m",
            number(at_most(bond.stiffness * room(part))),
            number(at_least(bond.strength / room(part)))
        )
    };
    if opening > THIRD_GRAIN_FITS * smallest {
        let than = format!(
            "more than the size of the smallest grain, {} m: the bond would act across other grains",
            number(smallest)
        );
        findings.error(path, reason(than), remedy(THIRD_GRAIN_FITS));
    } else if opening > LONG_BOND * smallest {
        let than = format!(
            "a large part of the size of the smallest grain, {} m",
            number(smallest)
        );
        findings.warn(path, reason(than), remedy(LONG_BOND));
    }
}

/// Fraction of the limit of the densest packing above which the initial contacts are evaluated: they can be stiffer
/// by the inverse of this factor if compressed or between unequal grains.
const EVALUATION_THRESHOLD: f64 = 0.25;

fn sphere_limit(scene: &Scene, law: &dyn ContactModel, dt: f64) -> Limits {
    let partners = max_partners(scene);
    let mut kinds = moving(scene);
    kinds.retain(|(material, _)| *material < scene.materials.len());
    kinds.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    // The smallest grains of a material have the highest frequency.
    kinds.dedup_by_key(|(material, _)| *material);
    let limits = kinds
        .into_iter()
        .map(|kind| densest_limit(scene, law, kind, partners));
    let packing = limits.fold(f64::INFINITY, f64::min);
    if dt < EVALUATION_THRESHOLD * packing {
        return Limits {
            slipping: f64::INFINITY,
            sticking: f64::INFINITY,
            packing,
            held: false,
        };
    }
    let prepared = scene.grains.as_ref().is_some_and(|grains| {
        !matches!(
            grains.source,
            GrainSource::List(_) | GrainSource::File { .. }
        )
    });
    let network = network::Network::for_scene(scene, law, !prepared, Depth::Expected);
    let held = !prepared && scene.regions.is_empty() && network.holds_all();
    let sticking = network.stiffest_part().limit();
    let mut network = network::Network::for_scene(scene, law, !prepared, Depth::Start);
    network.let_slip();
    Limits {
        slipping: network.stiffest_part().limit(),
        sticking,
        packing,
        held,
    }
}

/// Returns the JSON path of the field that determines the solid step.
fn path(scene: &Scene) -> &'static str {
    if scene.flow.is_some() {
        "time.solid_steps_per_fluid_step"
    } else if scene.time.solid_time_step.is_some() {
        "time.solid_time_step"
    } else {
        "time.solid_time_step_safety"
    }
}

fn remedy(scene: &Scene, clock: &Clock, limit: f64) -> Remedy {
    // The limit of compressed contacts depends slightly on the step. The allowed fraction of the critical step may
    // be shorter.
    let critical = clock.critical_solid_time_step.unwrap_or(f64::INFINITY);
    let safe = if scene.flow.is_some() || scene.time.solid_time_step.is_some() {
        critical * scene.time.solid_time_step_safety
    } else {
        f64::INFINITY
    };
    let limit = (0.99 * limit).min(safe);
    if scene.flow.is_some() {
        let steps = (clock.time_step / limit).ceil();
        Remedy::from(format!("use at least {steps} solid steps per fluid step"))
            .set(path(scene), base::number::whole(steps))
    } else if scene.time.solid_time_step.is_some() {
        let step = at_most(limit);
        Remedy::from(format!("use a solid time step of at most {step:?} s")).set(path(scene), step)
    } else {
        let safety = at_most(scene.time.solid_time_step_safety * limit / clock.solid_time_step);
        Remedy::from(format!("use a safety of at most {safety:?}")).set(path(scene), safety)
    }
}

#[cfg(test)]
mod tests;
