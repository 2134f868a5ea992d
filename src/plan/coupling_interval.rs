//! The longest coupling interval of a seepage: how long the load of the water on a bed may stay constant.
//!
//! The load foresees what drag does to a grain within the interval T, but not what its contacts do ([`crate::coupling::seepage`]). Where the
//! interval resolves the contacts that does not matter. Where it does not, the drag of an outdated velocity pumps energy into the
//! contacts, slowly if it is weak, and dashpots have to take it out. Four times of a bed of grains of diameter d, density rho_s and springs k,
//! of the height H, decide:
//!
//! ```text
//! contact        1/w = (m/k)^½
//! drag           tau = rho_s (1 - eps) K/mu           the water stops a bed that moves through it
//! bed            1/w_1 = 2 H/(pi w d)                 its slowest elastic oscillation
//! consolidation  t_1 = 1/(w_1² tau)                   decay of the pressure of the pores (K. Terzaghi 1943: 4 H²/(pi² c_v))
//!
//! T <= 0.7/w,    or    T <= tau/2  and  T² <= 40 zeta tau/w  and  T <= 0.35 max(1/w_1, t_1)
//! ```
//!
//! with the damping ratio zeta of the contacts. The factors are measured ([`benches/accuracy`](../../benches/accuracy/coupling_interval.py)): within them the
//! settlement of columns and beds differs from that of an interval of one step by at most 2 % at any time; from about twice as much on
//! beds without dashpots explode. Sampled drag feeds a mode of frequency w_i with at most 0.5/(w_i T) of what it takes from a slow one; the
//! dashpots take `zeta w_i²/w`, which is least beside it at `w_i T = 4.5`.

use super::Clock;
use super::critical_step::{critical_solid_time_step, moving};
use super::explicit_drag::{beds, porosity, stopping_times};
use super::margin::{Margin, margin};
use crate::darcy::Liquid;
use crate::darcy::drag::Grain;
use crate::dem::contact::{Depth, StaticContact};
use crate::error::Remedy;
use crate::number::to_u32;
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::grains::GrainSource;
use std::f64::consts::PI;

/// Factors of the module's formulas.
const OF_CONTACT: f64 = 0.7;
const OF_DRAG: f64 = 0.5;
const OF_DAMPING: f64 = 40.0;
const OF_BED: f64 = 0.35;
/// Porosity of a bed in which listed grains may gather.
const PACKED: f64 = 0.4;
/// Porosity of prepared beds: random close packing of spheres; in 2-D of discs.
const CLOSE: [f64; 2] = [0.16, 0.36];
const PATH: &str = "fluid.darcy.coupling_interval";

/// The limits of the interval \[s\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    /// By the period of the contacts.
    pub(crate) contact: f64,
    /// By the time in which drag stops a bed.
    pub(crate) drag: f64,
    /// By what the dashpots of the contacts take out.
    pub(crate) damping: f64,
    /// By the slowest oscillation and the consolidation of the bed.
    pub(crate) bed: f64,
}

impl Limits {
    /// Returns the longest interval \[s\].
    pub(crate) fn longest(&self) -> f64 {
        self.contact.max(self.drag.min(self.damping).min(self.bed))
    }

    /// Returns the limit that decides, as the plan names it.
    fn deciding(&self) -> (&'static str, f64) {
        let slow = [
            ("the time in which drag stops a bed", self.drag),
            ("what the dashpots of the contacts take out", self.damping),
            ("the oscillation and consolidation of the bed", self.bed),
        ];
        let least = slow.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
        least
            .filter(|(_, time)| *time > self.contact)
            .unwrap_or(("the period of the contacts", self.contact))
    }
}

/// Returns the limits of a scene; none without seepage, or without grains that it moves.
pub(crate) fn limits(scene: &Scene) -> Option<Limits> {
    let seepage = scene.seepage.as_ref()?;
    let (dimension, written) = (scene.grid.dimension, &seepage.written);
    let period = 0.5 * critical_solid_time_step(scene)?.limits.spring;
    let packed = match scene.grains.as_ref().map(|grains| &grains.source) {
        Some(GrainSource::List(_) | GrainSource::File { .. }) => porosity(scene, seepage).min(PACKED),
        _ => CLOSE[dimension - 2],
    };
    let eps = packed.clamp(written.least_porosity, written.porosity_cap());
    let liquid = Liquid {
        density: written.density,
        viscosity: written.viscosity,
    };
    let height = seepage.height(scene.gravity, dimension);
    let mut all: Option<Limits> = None;
    for (material, radius) in moving(scene) {
        if material >= scene.materials.len() || radius <= 0.0 {
            continue;
        }
        let (density, diameter) = (scene.density(material), 2.0 * radius);
        let grain = Grain::new(dimension, radius);
        let of_beds = beds(seepage, (eps, diameter), liquid, 0.0).into_iter();
        let stops = of_beds
            .map(|(_, k)| density * (1.0 - eps) * k / written.viscosity)
            .chain(stopping_times(seepage, &grain, scene.mass(material, radius), eps))
            .fold(f64::INFINITY, f64::min);
        let slowest = 2.0 * height * period / (PI * diameter);
        let consolidation = slowest * slowest / stops;
        let contact = OF_CONTACT * period;
        let drag = OF_DRAG * stops;
        let found = Limits {
            // Drag that is taken at the start of the interval is stable no longer than it takes to stop a grain.
            contact: if written.semi_implicit_drag { contact } else { contact.min(drag) },
            drag,
            damping: (OF_DAMPING * damping(scene, material, radius) * stops * period).sqrt(),
            bed: OF_BED * slowest.max(consolidation),
        };
        all = Some(all.map_or(found, |known| Limits {
            contact: known.contact.min(found.contact),
            drag: known.drag.min(found.drag),
            damping: known.damping.min(found.damping),
            bed: known.bed.min(found.bed),
        }));
    }
    all
}

/// Damping ratio of the normal dashpot between two grains of a size.
fn damping(scene: &Scene, material: usize, radius: f64) -> f64 {
    let Some(contact) = &scene.contact else {
        return 0.0;
    };
    let mass = 0.5 * scene.mass(material, radius);
    let springs = contact.model().springs(&StaticContact {
        materials: [to_u32(material); 2],
        diameter: 2.0 * radius,
        radius: 0.5 * radius,
        mass,
        overlap: None,
        depth: Depth::Expected,
        bonded: false,
    });
    let (stiffness, dashpot) = (springs.stiffness[0], springs.dashpots[0]);
    let ratio = dashpot / (2.0 * (mass * stiffness).sqrt());
    if ratio.is_finite() { ratio } else { 0.0 }
}

/// Compares the interval with its limits.
pub(super) fn check(scene: &Scene, clock: &Clock, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let Some(limits) = limits(scene) else {
        return;
    };
    let interval = clock.time_step;
    // One of the two ways is enough.
    let ways: &[(&str, f64)] = if interval <= limits.contact {
        &[("coupling interval / period of the contacts", limits.contact)]
    } else {
        &[
            ("coupling interval / stopping time of a bed", limits.drag),
            ("coupling interval / damping of the contacts", limits.damping),
            ("coupling interval / settling time of the bed", limits.bed),
        ]
    };
    for (limit, allowed) in ways {
        margins.push(margin(limit, interval, allowed.max(f64::MIN_POSITIVE), PATH));
    }
    let longest = limits.longest();
    // Coupled in each solid step there is no shorter one.
    if interval <= longest * (1.0 + 1e-9) || clock.solid_steps_per_step <= 1 {
        return;
    }
    let most = (longest / clock.solid_time_step * (1.0 + 1e-9)).floor().max(1.0);
    let (name, _) = limits.deciding();
    findings.unstable(
        PATH,
        format!(
            "the load of the water stays constant for {} s, longer than the {} s that {name} allow: in runs beds oscillated, settled by a wrong \
             amount or exploded",
            number(interval),
            number(longest)
        ),
        Remedy::from(format!(
            "use at most {} solid steps per interval, or omit `coupling_interval`",
            number(most)
        ))
        .set(PATH, most),
    );
}
