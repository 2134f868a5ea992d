//! The models of a scene, each with its reason, and the models that it does not need.

use super::Clock;
use super::device::device;
use crate::case::coupling::{Coupling, Scheme, SolidFraction};
use crate::case::fluid::Device;
use crate::case::fluid::Precision;
use crate::family::Description;
use crate::lbm::lattice::VelocitySet;
use crate::scene::Scene;
use crate::scene::findings::number;
use crate::scene::flow::Flow;
use crate::scene::gravity;
use crate::scene::observe::ProbeAt;
use serde::Serialize;

/// A model and its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Choice {
    /// The choice.
    pub what: String,
    /// The model.
    pub model: String,
    /// Why.
    pub reason: String,
}

pub(crate) fn choices(scene: &Scene, clock: &Clock) -> Vec<Choice> {
    let mut list = Vec::new();
    let mut choose = |what: &str, model: String, reason: String| {
        // Automatic choices have their own reasons.
        let own = scene.chosen.why(what);
        list.push(Choice {
            what: what.into(),
            model,
            reason: own.map_or(reason, str::to_owned),
        });
    };
    if let Some(accuracy) = scene.chosen.accuracy {
        let level = accuracy.name();
        let target = number(100.0 * accuracy.target());
        let promised = scene.chosen.promised.map_or_else(
            || String::from("nothing promised"),
            |error| format!("{} % promised", number(100.0 * error)),
        );
        choose(
            "accuracy",
            format!("{level}: {target} % of forces, {promised}"),
            "no measured row covers these cells".into(),
        );
    }
    if scene.chosen.why("spacing").is_some() {
        let cells = scene.grid.cell_count();
        choose(
            "spacing",
            format!("{} m, {cells} cells", number(scene.grid.spacing)),
            String::new(),
        );
    }
    if scene.chosen.why("time step").is_some() {
        choose(
            "time step",
            format!("{} s", number(clock.time_step)),
            String::new(),
        );
    }
    for wall in scene.walls.iter().filter(|wall| wall.is_timed()) {
        let at = |time: f64| {
            let step = clock.interval_to_steps(time);
            format!("{} s (step {step})", number(time))
        };
        let from = wall.from.map(|time| format!("from {}", at(time)));
        let until = wall.until.map(|time| format!("until {}", at(time)));
        let exists: Vec<String> = from.into_iter().chain(until).collect();
        choose(
            &format!("wall {}", wall.name),
            exists.join(" "),
            "requested".into(),
        );
    }
    let dimension = scene.grid.dimension;
    if let Some(grains) = &scene.grains
        && let Some(grading) = grains.percentiles(dimension)
    {
        choose(
            "grading",
            grading.to_string(),
            format!("requested; {} grains, passing by mass", grains.expected),
        );
    }
    for cloud in scene.grains.iter().flat_map(|grains| grains.layers()) {
        let material = &scene.materials[cloud.material].name;
        let sizes = cloud
            .percentiles(dimension)
            .map_or_else(String::new, |p| format!(", {p}"));
        choose(
            &format!("grains of layer {}", cloud.name.as_deref().unwrap_or("1")),
            format!("{material}{sizes}"),
            format!("requested; {} grains", cloud.number),
        );
    }
    for zone in scene.grains.iter().flat_map(|grains| &grains.zones) {
        let material = &scene.materials[zone.material].name;
        let grains = zone.listed.map_or_else(
            || "requested; assigned after the preparation".into(),
            |count| format!("requested; {count} grains"),
        );
        choose(
            &format!("grains of zone {}", zone.name),
            material.clone(),
            grains,
        );
    }
    if let Some(seepage) = &scene.seepage {
        let written = &seepage.written;
        let without_grains = scene.grains.is_none() && scene.bodies.is_empty();
        let [x, y, z] = seepage.cells;
        choose(
            "fluid",
            "Darcy seepage".into(),
            if without_grains {
                format!("requested; {x} x {y} x {z} cells, steady: no grain moves")
            } else {
                let steps = clock.solid_steps_per_step;
                format!("requested; {x} x {y} x {z} cells, coupled every {steps} solid steps")
            },
        );
        if without_grains {
            choose(
                "permeability",
                "that of the zones".into(),
                "there are no grains".into(),
            );
        } else {
            choose(
                "permeability",
                format!(
                    "{}, {:?} mean diameter",
                    written.resistance().model().description(),
                    written.mean_diameter
                ),
                format!(
                    "porosity by {}, at most {}",
                    written.porosity.model().description(),
                    written.porosity_cap()
                ),
            );
        }
        for [zone, states, reason] in seepage.describe_zones(without_grains) {
            choose(&zone, states, reason);
        }
        if let Some(cut) = seepage.zones.as_ref().map(|z| z.cut()).filter(|n| *n > 0) {
            choose(
                "cells cut by zones",
                cut.to_string(),
                "harmonic mean of the permeability across layers, arithmetic mean along them"
                    .into(),
            );
        }
        choose(
            "pressure",
            "conjugate gradients with multigrid".into(),
            format!("to {:e} of the driving terms", written.tolerance),
        );
        if !without_grains {
            let flow = super::pore_flow::reynolds(scene).map_or_else(
                || "no pressure and no flux drives the water".to_owned(),
                |re| {
                    let re = number(re);
                    format!("the water seeps at a Reynolds number of about {re}")
                },
            );
            choose("equations", format!("{:?}", written.equations), flow);
            let balance = if written.drag().model().balances() {
                "balances the loss of pressure"
            } else {
                "independent of the resistance: see the closure of momentum in the log"
            };
            choose("drag", written.drag().model().description(), balance.into());
        }
    }
    match &scene.flow {
        None if scene.seepage.is_some() => {}
        None => choose(
            "fluid",
            "none".into(),
            "the case has no fluid: no lattice is allocated".into(),
        ),
        Some(flow) => {
            let operator = flow.collision.model();
            let (name, reason) = match flow.lattice {
                VelocitySet::D2Q9 => ("D2Q9", "the domain is 2-D"),
                VelocitySet::D3Q19 => (
                    "D3Q19",
                    "the domain is 3-D; the smallest velocity set that is accurate at these velocities",
                ),
                VelocitySet::D3Q27 if operator.only_on().is_some() => {
                    ("D3Q27", "the moments of the operator are those of this set")
                }
                VelocitySet::D3Q27 => ("D3Q27", "requested: isotropic to fourth order"),
            };
            choose("lattice", name.into(), reason.into());
            let Description { model, reason } = operator.describe(flow.relaxation_time);
            choose("collision", model, reason);
            let Description { model, reason } = flow.turbulence.map_or_else(
                || {
                    Description::new(
                        "none",
                        "not requested: all eddies are assumed to be resolved, no velocity field is stored",
                    )
                },
                |model| model.describe(),
            );
            choose("turbulence", model, reason);
            if let Some((model, reason)) = gravity::describe(scene.gravity, flow.gravity_acts) {
                choose("gravity on the fluid", model, reason);
            }
            choose(
                "populations",
                match flow.storage {
                    Precision::F64 => "f64, deviations from rest".into(),
                    Precision::F32 => "f32, deviations from rest".into(),
                },
                "streamed in place: one array; arithmetic in f64".into(),
            );
            match device(scene) {
                Device::Cpu if flow.device == Device::Auto => choose(
                    "device",
                    "the processor".into(),
                    "a GPU does not run this scene yet".into(),
                ),
                Device::Cpu => {}
                Device::Gpu => choose("device", "a GPU".into(), "requested".into()),
                Device::Auto => choose(
                    "device",
                    "a GPU where there is one, else the processor".into(),
                    "requested; the state is the same on both".into(),
                ),
            }
        }
    }
    match (&scene.coupling, &scene.flow) {
        (Some(coupling), Some(flow)) => choose(
            "coupling",
            name(coupling, flow),
            "there are solids in the fluid".into(),
        ),
        (None, Some(_)) => choose(
            "coupling",
            "none".into(),
            "there are no solids in the fluid".into(),
        ),
        _ => {}
    }
    let solid = scene.has_solids();
    let kind = if dimension == 2 { "discs" } else { "spheres" };
    match &scene.contact {
        Some(table) if solid => {
            let polyhedra = scene.polyhedra().count();
            let reason = if polyhedra == 0 {
                format!("requested; {kind}, without orientation")
            } else {
                format!("requested; {polyhedra} polyhedra")
            };
            choose("contact law", table.model().describe(), reason);
            if table.is_elastic() {
                choose(
                    "contact damping",
                    "none".into(),
                    "no damping is set: bodies rebound from an impact as fast as they came".into(),
                );
            }
            choose(
                "solid steps",
                format!("{} per fluid step", clock.solid_steps_per_step),
                "the smallest number within the safety of the critical time step, or as requested"
                    .into(),
            );
        }
        _ => choose("contact law", "none".into(), "nothing moves freely".into()),
    }
    for probe in &scene.probes {
        if let ProbeAt::Bed(bed) = &probe.at {
            let [along, across, _] = bed.axes.map(|axis| ["x", "y", "z"][axis]);
            choose(
                "bed",
                format!(
                    "probe `{}`: stream along {along}, bed across {across}",
                    probe.name
                ),
                format!(
                    "surface at a solid fraction of {}, means from {} s on",
                    number(bed.threshold),
                    number(bed.mean_from)
                ),
            );
        }
    }
    choose(
        "slabs",
        format!("along {}", ["x", "y", "z"][scene.grid.split_axis.min(2)]),
        format!("{} planes", scene.grid.cells[scene.grid.split_axis.min(2)]),
    );
    list
}

/// The coupling in words.
fn name(coupling: &Coupling, flow: &Flow) -> String {
    let written = match coupling {
        Coupling::BounceBack(written) => {
            return match written.scheme {
                Scheme::HalfWay => "moving bounce-back, half-way".into(),
                Scheme::Interpolated => "moving bounce-back, interpolated".into(),
            };
        }
        Coupling::PartiallySaturated(written) => written,
    };
    let chosen = flow.solid_operator(written).model();
    let operator = chosen.describe();
    let weighting = if chosen.weighted() {
        written.weighting.describe()
    } else {
        "no weighting"
    };
    let fraction = match written.solid_fraction {
        SolidFraction::Exact => "exact fractions".into(),
        SolidFraction::Samples(n) => format!("solid fractions from {n} samples along an edge"),
        SolidFraction::Linear => "linear fractions".into(),
    };
    format!("partially saturated cells, {operator}, {weighting}, {fraction}")
}
