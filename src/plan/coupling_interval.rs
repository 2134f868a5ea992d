//! The longest coupling interval of a seepage: the time for which the load of the water on a bed may stay constant.
//!
//! The load anticipates the effect of drag on a grain within the interval T, but not that of its contacts
//! ([`coupling::seepage`]). This does not matter if the interval resolves the contacts. Otherwise the drag of an
//! outdated velocity adds energy to the contacts, slowly if the drag is weak, and dashpots must dissipate it. Four
//! times decide, for a bed of height H with grains of diameter d, density rho_s and contact stiffness k:
//!
//! ```text
//! contact        1/w = (m/k)^½
//! drag           tau = rho_s (1 - eps) K/mu           the water stops a bed that moves through it
//! bed            1/w_1 = 2 H/(pi w d)                 its slowest elastic oscillation
//! consolidation  t_1 = 1/(w_1² tau)                   decay of the pressure of the pores (4 H²/(pi² c_v))
//!
//! T <= 0.7/w,    or    T <= tau/2  and  T² <= 40 zeta tau/w  and  T <= 0.35 max(1/w_1, t_1)
//! ```
//!
//! with the damping ratio zeta of the contacts. The factors are measured (`jobs/verification/coupling-interval`):
//! within them the settlement of columns and beds differs from that of an interval of one step by at most 2 % at
//! any time; from about twice as much on beds without dashpots explode. Sampled drag feeds a mode of frequency w_i
//! with at most 0.5/(w_i T) of the energy that it dissipates in a slow mode; the dashpots dissipate `zeta w_i²/w`,
//! and the ratio of dissipation to input is smallest at `w_i T = 4.5`.

use super::Clock;
use super::critical_step::{largest_radius, moving};
use super::explicit_drag::{bed_properties, porosity, stopping_times};
use super::margin::{Margin, margin};
use crate::scene::Scene;
use crate::scene::auto::Subject;
use crate::scene::findings::{Findings, number};
use crate::scene::grains::GrainSource;
use crate::scene::seepage::Seepage;
use base::error::Remedy;
use base::number::to_u32;
use darcy::drag::GrainSize;
use dem::contact::{Depth, StaticContact};
use std::f64::consts::PI;

/// Factors of the formulas of this module.
const CONTACT_FACTOR: f64 = 0.7;
const DRAG_FACTOR: f64 = 0.5;
const DAMPING_FACTOR: f64 = 40.0;
const BED_FACTOR: f64 = 0.35;
/// Porosity of a bed in which listed grains may settle.
const PACKED_POROSITY: f64 = 0.4;
/// Porosity of prepared beds: random close packing of spheres; in 2-D of discs.
const CLOSE_POROSITY: [f64; 2] = [0.16, 0.36];
const PATH: &str = "fluid.darcy.coupling_interval";

/// Limits of the interval \[s\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    /// Limit from the period of the contacts.
    pub(crate) contact: f64,
    /// Limit from the stopping time of the bed by drag.
    pub(crate) drag: f64,
    /// Limit from the dissipation in the dashpots of the contacts.
    pub(crate) damping: f64,
    /// Limit from the slowest oscillation and the consolidation of the bed.
    pub(crate) bed: f64,
}

impl Limits {
    /// Returns the longest interval \[s\].
    pub(crate) fn longest(&self) -> f64 {
        self.contact.max(self.drag.min(self.damping).min(self.bed))
    }

    /// Returns the name and value of the deciding limit, as printed by the plan.
    pub(crate) fn deciding(&self) -> (&'static str, f64) {
        let slow = [
            ("the time in which drag stops a bed", self.drag),
            ("the damping by the dashpots of the contacts", self.damping),
            ("the oscillation and consolidation of the bed", self.bed),
        ];
        let least = slow.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
        least
            .filter(|(_, time)| *time > self.contact)
            .unwrap_or(("the period of the contacts", self.contact))
    }
}

/// Returns the limits of a scene; none without seepage, in unsaturated ground, or without grains that the water can
/// move.
pub(crate) fn limits(scene: &Scene) -> Option<Limits> {
    let seepage = scene.seepage.as_ref()?;
    let (dimension, written) = (scene.grid.dimension, &seepage.written);
    if written.unsaturated.is_some() {
        // The load of unsaturated ground does not depend on the velocity of the grains.
        return None;
    }
    let law = scene.contact.as_ref()?.model();
    let packed = match scene.grains.as_ref().map(|grains| &grains.source) {
        Some(GrainSource::List(_) | GrainSource::File { .. }) => {
            porosity(scene, seepage).min(PACKED_POROSITY)
        }
        _ => CLOSE_POROSITY[dimension - 2],
    };
    // Exceeded limits are reported separately.
    let eps = packed
        .max(written.least_porosity)
        .min(written.porosity_cap());
    let liquid = written.liquid();
    let height = seepage.height(scene.gravity, dimension);
    let mut all: Option<Limits> = None;
    let largest = largest_radius(scene);
    for (material, radius) in moving(scene) {
        if material >= scene.materials.len() || radius <= 0.0 {
            continue;
        }
        let (density, diameter, mass) = (
            scene.density(material),
            2.0 * radius,
            scene.mass(material, radius),
        );
        let period = 0.5
            * law
                .time_limits(to_u32(material), [radius, largest], mass)
                .spring;
        let grain = GrainSize::new(dimension, radius);
        let of_beds = bed_properties(seepage, (eps, diameter), liquid, 0.0).into_iter();
        let stops = of_beds
            .map(|(_, k)| density * (1.0 - eps) * k / written.viscosity)
            .chain(stopping_times(
                seepage,
                &grain,
                scene.mass(material, radius),
                eps,
            ))
            .fold(f64::INFINITY, f64::min);
        let slowest = 2.0 * height * period / (PI * diameter);
        let consolidation = slowest * slowest / stops;
        let contact = CONTACT_FACTOR * period;
        let drag = DRAG_FACTOR * stops;
        let found = Limits {
            // Drag evaluated at the start of the interval is stable only up to the stopping time of a grain.
            contact: if written.semi_implicit_drag {
                contact
            } else {
                contact.min(drag)
            },
            drag,
            damping: (DAMPING_FACTOR * damping(scene, material, radius) * stops * period).sqrt(),
            bed: BED_FACTOR * slowest.max(consolidation),
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

/// Returns the reason for the coupling interval of a plan.
pub(super) fn reason(scene: &Scene, seepage: &Seepage, clock: &Clock) -> String {
    if seepage.written.coupling_interval.is_some() {
        return "requested".into();
    }
    let step = clock.solid_time_step;
    let wanted = seepage.coupling_interval(step, None);
    let limits = limits(scene).map(|limits| (limits.longest(), limits.deciding().0));
    let longest = limits.map(|(longest, _)| longest);
    let allowed = seepage.coupling_interval(step, longest);
    let mut text = match (limits, scene.chosen.reason_of(Subject::CouplingInterval)) {
        (Some((longest, name)), _) if allowed < wanted => {
            format!(
                "the longest stable one: {name} allows {} s",
                number(longest)
            )
        }
        (_, Some(chosen)) => chosen.to_owned(),
        (limits, None) => {
            let kind = if seepage.is_transient() {
                "transient"
            } else {
                "steady"
            };
            let below = limits.map_or_else(String::new, |(longest, name)| {
                format!(", below the {} s that {name} allows", number(longest))
            });
            format!(
                "the usual number of solid steps between two solutions of {kind} seepage{below}"
            )
        }
    };
    if clock.solid_steps_per_step < allowed {
        text += ", shortened so that the end and the times of outputs fall on its multiples";
    }
    text
}

/// Returns the damping ratio of the normal dashpot between two grains of this radius.
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
pub(super) fn check(
    scene: &Scene,
    clock: &Clock,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let Some(limits) = limits(scene) else {
        return;
    };
    let interval = clock.time_step;
    // Either of the two limits suffices: the table lists the one that allows the longer interval.
    let of_contact = [("coupling interval / period of the contacts", limits.contact)];
    let of_bed = [
        ("coupling interval / stopping time of a bed", limits.drag),
        (
            "coupling interval / damping of the contacts",
            limits.damping,
        ),
        ("coupling interval / settling time of the bed", limits.bed),
    ];
    let of_contact_decides = limits.longest() <= limits.contact;
    let decisive: &[(&str, f64)] = if of_contact_decides {
        &of_contact
    } else {
        &of_bed
    };
    for (limit, allowed) in decisive {
        margins.push(margin(limit, interval, *allowed, PATH));
    }
    let longest = limits.longest();
    // Coupling at each solid step is the shortest interval possible.
    if interval <= longest * (1.0 + 1e-9) || clock.solid_steps_per_step <= 1 {
        return;
    }
    let most = (longest / clock.solid_time_step * (1.0 + 1e-9))
        .floor()
        .max(1.0);
    let (name, _) = limits.deciding();
    findings.unstable(
        PATH,
        format!(
            "the load of the water is constant for {} s, longer than the limit of {} s, which follows from \
             {name}: in runs above this limit beds oscillated, settled by a wrong amount or exploded",
            number(interval),
            number(longest)
        ),
        Remedy::from(format!(
            "use at most {} solid steps per interval, or omit `coupling_interval`",
            number(most)
        ))
        .set(PATH, to_u32(base::number::whole(most))),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plan;
    use base::error::Severity;
    use case::Document;
    use std::path::Path;

    /// Returns eight grains of 1 mm on top of each other in a column of liquid.
    fn column(
        viscosity: f64,
        damping: f64,
        set: &[&str],
    ) -> Result<Plan, Vec<base::error::Problem>> {
        let grains: Vec<String> = (0..8)
            .map(|k| {
                let z = 0.0005 + 0.001 * f64::from(k);
                format!(r#"{{"position": [0.0005, 0.0005, {z}], "radius": 0.0005}}"#)
            })
            .collect();
        let text = format!(
            r#"{{
                "gravity": [0, 0, -9.81],
                "domain": {{"size": [0.001, 0.001, 0.012], "spacing": 0.001}},
                "materials": {{"g": {{"density": 2650}}}},
                "fluid": {{"darcy": {{"density": 1000, "viscosity": {viscosity}, "resistance": "kozeny_carman",
                    "grid": {{"from": [0, 0, 0], "to": [0.001, 0.001, 0.008], "cells": [1, 1, 8]}},
                    "boundaries": [{{"name": "top", "face": "z_max", "condition": {{"pressure": {{"value": 0}}}}}}]}}}},
                "grains": {{"material": "g", "initial": {{"list": [{}]}}}},
                "contact": {{"linear": {{"normal_stiffness": {{"absolute": 1000}}, "normal_damping_ratio": {damping},
                    "friction_angle_degrees": 30}}}},
                "box_walls": ["x_min", "x_max", "y_min", "y_max", "z_min"], "box_wall_material": "g",
                "time": {{"end": 0.05}}
            }}"#,
            grains.join(", ")
        );
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let document = Document::read(&text, &set, Path::new("."))?;
        Plan::prepare(document)
    }

    /// Checks the limits with 1/w = 3.73e-5 s: in oil of 1 Pa s a bed stops within 3.0e-6 s, in water within 3.0e-3
    /// s; the slowest oscillation involves 8 grains.
    #[test]
    fn limits_are_those_of_contacts_drag_and_bed() {
        let period = (2650.0 * PI / 6.0 * 1e-9 / 1000.0_f64).sqrt();
        let eps = 0.4;
        let stops =
            |mu: f64| 2650.0 * (1.0 - eps) * darcy::resistance::kozeny_carman(eps, 1e-3) / mu;
        for (viscosity, damping) in [(1.0, 0.0), (1e-3, 0.0), (1e-3, 0.2)] {
            let plan = column(viscosity, damping, &["fluid.darcy.coupling_interval=1"]).unwrap();
            let found = limits(&plan.scene).unwrap();
            let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 0.02, "{a} {b}");
            close(found.contact, 0.7 * period);
            close(found.drag, 0.5 * stops(viscosity));
            let slowest = 16.0 / PI * period;
            close(
                found.bed,
                0.35 * slowest.max(slowest * slowest / stops(viscosity)),
            );
            if damping > 0.0 {
                close(
                    found.damping,
                    (40.0 * damping * stops(viscosity) * period).sqrt(),
                );
                assert!(found.longest() > found.contact);
            } else {
                assert_eq!(found.longest(), found.contact);
            }
        }
    }

    /// Checks that the plan prints the interval with its reason: stated, usual, and limited by stability.
    #[test]
    fn the_plan_gives_the_reason_of_the_interval() {
        let told = |plan: &Plan| {
            let choice = plan
                .models
                .iter()
                .find(|choice| choice.what == "coupling interval");
            let choice = choice.unwrap_or_else(|| panic!("{:?}", plan.models));
            assert!(plan.to_string().contains(&choice.reason), "{plan}");
            (choice.model.clone(), choice.reason.clone())
        };
        let (model, reason) =
            told(&column(1e-3, 0.3, &["fluid.darcy.coupling_interval=2"]).unwrap());
        assert!(
            model.starts_with("2 solid steps, ") && reason == "requested",
            "{model} {reason}"
        );
        let limited = column(1.0, 0.0, &[]).unwrap();
        let longest = limits(&limited.scene).unwrap().longest();
        let (model, reason) = told(&limited);
        let steps = limited.clock.solid_steps_per_step;
        assert!(
            model.starts_with(&format!("{steps} solid steps, ")),
            "{model}"
        );
        let words = format!(
            "the longest stable one: the period of the contacts allows {} s",
            number(longest)
        );
        assert_eq!(reason, words);
        let short = column(1e-3, 0.3, &["time.solid_time_step=1e-8"]).unwrap();
        let (_, reason) = told(&short);
        assert!(
            reason.starts_with("the usual number of solid steps"),
            "{reason}"
        );
    }

    #[test]
    fn the_default_keeps_the_limits_and_a_stated_interval_beyond_them_is_unstable() {
        for (viscosity, damping) in [(1.0, 0.0), (0.1, 0.3), (1e-3, 0.0), (1e-3, 0.3)] {
            let plan = column(viscosity, damping, &[]).unwrap();
            let longest = limits(&plan.scene).unwrap().longest();
            assert!(plan.clock.time_step <= longest && plan.clock.solid_steps_per_step >= 3);
            let mut more = plan.clock.solid_steps_per_step + 2;
            for interval in [more, 100] {
                more = interval.max(more);
                let set = format!("fluid.darcy.coupling_interval={more}");
                let plan = column(viscosity, damping, &[&set]).unwrap();
                let said = plan.warnings.iter().find(|finding| finding.path == PATH);
                let said = said.unwrap_or_else(|| panic!("{viscosity} {damping} {more}"));
                assert_eq!(said.severity, Severity::Unstable);
                assert!(said.reason.contains("exploded"), "{}", said.reason);
            }
        }
    }
}
