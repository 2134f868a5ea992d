//! Regions, probes, outputs and analysis of a scene.

mod bed;

use super::block::Block;
use super::bodies::Body;
use super::findings::{Findings, at_least, number};
use super::grains::{check_radii, fits_period};
use super::grid::Grid;
use super::structures::Structure;
use super::{material, unique};
use crate::case::Case;
use crate::case::fluid::Fluid;
use crate::case::geometry::{Axis, Face};
use crate::case::grains::Radii;
use crate::case::observe::{Action as Written, FieldName, ProbeAt as WrittenAt, When};
use crate::dem::contact::Contact;
use crate::error::Remedy;
pub use bed::Bed;
use serde::Serialize;

/// A box in which something happens to grains.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Region {
    /// Its name.
    pub name: String,
    /// Where.
    pub block: Block,
    /// What.
    pub action: Action,
}

/// What happens in a region.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Action {
    /// Grains are taken out.
    Remove {
        /// When.
        when: When,
    },
    /// Grains appear.
    Generate {
        /// Grains per second [1/s].
        rate: f64,
        /// Radii \[m\].
        radii: Radii,
        /// Velocity [m/s].
        velocity: [f64; 3],
        /// Seed.
        seed: u64,
        /// Index of the material.
        material: usize,
        /// At most this many.
        at_most: Option<u32>,
    },
    /// Entries and exits are logged.
    Record,
}

/// A quantity sampled in time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Probe {
    /// Name of its file.
    pub name: String,
    /// Time between samples \[s\].
    pub every: f64,
    /// Where.
    pub at: ProbeAt,
}

/// Where a probe samples.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum ProbeAt {
    /// Velocity and pressure at a point \[m\].
    Point([f64; 3]),
    /// Velocity and pressure along a line.
    Line {
        /// First point \[m\].
        from: [f64; 3],
        /// Last point \[m\].
        to: [f64; 3],
        /// Number of points.
        points: usize,
    },
    /// Discharge and means in a plane.
    Plane {
        /// Axis normal to it: 0, 1 or 2.
        axis: usize,
        /// Its coordinate \[m\].
        position: f64,
    },
    /// Force and torque on a body, by index in [`super::Scene::bodies`].
    Body(usize),
    /// Force on a structure, by its index among those that water meets.
    Structure(usize),
    /// Discharge of seepage through a part of a plane.
    Section {
        /// Axis normal to it: 0, 1 or 2.
        axis: usize,
        /// Its coordinate \[m\].
        position: f64,
        /// The part.
        part: Option<Block>,
    },
    /// Force on a face.
    Wall(Face),
    /// A bed of grains.
    Bed(Box<Bed>),
    /// Grains in a box.
    Grains {
        /// The box.
        part: Block,
        /// Start of the means over time \[s\].
        mean_from: f64,
    },
}

/// Erosion law analysis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErosionLaw {
    /// The hole before erosion.
    pub hole: Block,
    /// Axis of the flow: 0, 1 or 2.
    pub flow_axis: usize,
    /// Time between samples \[s\].
    pub every: f64,
    /// Indices of the regions whose removals count as eroded.
    pub outlets: Vec<usize>,
    /// Eroded part of the mass at which the run is done.
    pub end_at_eroded_fraction: Option<f64>,
}

pub(crate) fn regions(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Vec<Region> {
    let mut known = Vec::new();
    let mut regions = Vec::new();
    for (n, region) in case.regions.iter().enumerate() {
        let path = format!("regions[{n}]");
        unique(&mut known, &region.name, &format!("{path}.name"), findings);
        let block = Block::resolve(grid, &region.region, &format!("{path}.box"), findings);
        let action = match &region.action {
            Written::Remove { when } => Action::Remove { when: *when },
            Written::Record {} => Action::Record,
            Written::Generate {
                rate,
                radii,
                velocity,
                seed,
                material: name,
                at_most,
            } => {
                let path = format!("{path}.action.generate");
                if check_radii(radii, &format!("{path}.radii"), findings) {
                    let (_, largest) = radii.bounds();
                    fits_period(grid, largest, &format!("{path}.radii"), findings);
                }
                let velocity = velocity.as_ref().map_or([0.0; 3], |v| {
                    Block::vector(grid, v, &format!("{path}.velocity"), findings)
                });
                let name = name.as_ref().or(case.grains.as_ref().map(|g| &g.material));
                let index = match name {
                    Some(name) => material(names, name, &format!("{path}.material"), findings),
                    None => {
                        findings.error(
                            &format!("{path}.material"),
                            "the grains need a material",
                            "name one",
                        );
                        None
                    }
                };
                Action::Generate {
                    rate: *rate,
                    radii: radii.clone(),
                    velocity,
                    seed: *seed,
                    material: index.unwrap_or(0),
                    at_most: *at_most,
                }
            }
        };
        regions.push(Region {
            name: region.name.clone(),
            block,
            action,
        });
    }
    let source = regions
        .iter()
        .any(|r| matches!(r.action, Action::Generate { .. }));
    if !regions.is_empty() && !source && case.grains.is_none() {
        findings.warn(
            "regions",
            "there are no grains in this case",
            "add `grains`, or remove the regions",
        );
    }
    regions
}

pub(crate) fn probes(
    case: &Case,
    grid: &Grid,
    (bodies, structures): (&[Body], &[Structure]),
    findings: &mut Findings,
) -> Vec<Probe> {
    let mut known = Vec::new();
    let mut probes = Vec::new();
    for (n, probe) in case.probes.iter().enumerate() {
        let path = format!("probes[{n}]");
        unique(&mut known, &probe.name, &format!("{path}.name"), findings);
        due(case, probe.every, &format!("{path}.every"), findings);
        let inside = |point: [f64; 3], path: &str, findings: &mut Findings| {
            if !grid.contains(point) {
                findings.error(path, "the probe lies outside the domain", "move it inside");
            }
            point
        };
        let needs_fluid = !matches!(probe.at, WrittenAt::Body { .. } | WrittenAt::Grains { .. });
        if needs_fluid && case.fluid.is_none() {
            findings.error(
                &format!("{path}.at"),
                "there is no fluid to probe",
                "add `fluid`, or remove the probe",
            );
        }
        let seeps = matches!(case.fluid, Some(Fluid::Darcy(_)));
        let of_pores = matches!(
            probe.at,
            WrittenAt::Point { .. } | WrittenAt::Section { .. }
        );
        if needs_fluid && seeps && !of_pores {
            findings.error(
                &format!("{path}.at"),
                "this probe samples a fluid on a lattice; this is seepage",
                "use a point, a section, or `output.fluid`, which has the pressure and velocity of every cell",
            );
        }
        let at = match &probe.at {
            WrittenAt::Point { position } => {
                let path = format!("{path}.at.point.position");
                let point = Block::vector(grid, position, &path, findings);
                let holds = |s: &&Structure| s.stops.water() && s.solid.distance(point) < 0.0;
                if let Some(structure) = structures.iter().find(holds) {
                    findings.error(
                        &path,
                        format!("the point lies in the structure `{}`", structure.name),
                        "move it into the water",
                    );
                }
                ProbeAt::Point(inside(point, &path, findings))
            }
            WrittenAt::Line { from, to, points } => {
                let ends = [("from", from), ("to", to)].map(|(name, end)| {
                    let path = format!("{path}.at.line.{name}");
                    let point = Block::vector(grid, end, &path, findings);
                    inside(point, &path, findings)
                });
                ProbeAt::Line {
                    from: ends[0],
                    to: ends[1],
                    points: usize::try_from(*points).unwrap_or(usize::MAX),
                }
            }
            WrittenAt::Plane { axis, position } => {
                let axis = axis.index();
                if axis >= grid.dimension {
                    findings.error(
                        &format!("{path}.at.plane.axis"),
                        "there is no z in a 2-D problem",
                        "use x or y",
                    );
                } else if !(0.0..=grid.size[axis]).contains(position) {
                    findings.error(
                        &format!("{path}.at.plane.position"),
                        format!(
                            "the plane lies outside the domain, which is 0 … {} m there",
                            number(grid.size[axis])
                        ),
                        "move it inside",
                    );
                }
                ProbeAt::Plane {
                    axis,
                    position: *position,
                }
            }
            WrittenAt::Body { name } => {
                let index = bodies.iter().position(|b| b.name == *name);
                if index.is_none() {
                    let names: Vec<&str> = bodies.iter().map(|b| b.name.as_str()).collect();
                    let remedy = crate::case::check::nearest(name, &names).map_or_else(
                        || format!("bodies here: {}", names.join(", ")).into(),
                        |near| {
                            Remedy::from(format!("did you mean `{near}`?"))
                                .set(format!("{path}.at.body.name"), near)
                        },
                    );
                    findings.error(
                        &format!("{path}.at.body.name"),
                        "there is no body of this name",
                        remedy,
                    );
                }
                ProbeAt::Body(index.unwrap_or(0))
            }
            WrittenAt::Structure { name } => {
                let mut water = structures.iter().filter(|s| s.stops.water());
                let index = water.position(|s| s.name == *name);
                if index.is_none() {
                    let names: Vec<&str> = (structures.iter().filter(|s| s.stops.water()))
                        .map(|s| s.name.as_str())
                        .collect();
                    findings.error(
                        &format!("{path}.at.structure.name"),
                        "there is no structure of this name that stops water",
                        format!("structures here: {}", names.join(", ")),
                    );
                }
                ProbeAt::Structure(index.unwrap_or(0))
            }
            WrittenAt::Section {
                axis,
                position,
                part,
            } => {
                let path = format!("{path}.at.section");
                if case.fluid.is_some() && !seeps {
                    findings.error(
                        &path,
                        "a section is one of seepage; this is a fluid on a lattice",
                        "use a plane",
                    );
                }
                let axis = axis.index();
                if axis >= grid.dimension || !(0.0..=grid.size[axis.min(2)]).contains(position) {
                    findings.error(
                        &format!("{path}.position"),
                        "the section lies outside the domain",
                        "move it inside",
                    );
                }
                let part = part.as_ref().map(|part| {
                    let from =
                        Block::vector(grid, &part.from, &format!("{path}.part.from"), findings);
                    let to = Block::vector(grid, &part.to, &format!("{path}.part.to"), findings);
                    Block {
                        from,
                        to,
                        dimension: grid.dimension,
                    }
                });
                ProbeAt::Section {
                    axis,
                    position: *position,
                    part,
                }
            }
            WrittenAt::Wall { face } => {
                if face.axis() >= grid.dimension || grid.periodic[face.axis()] {
                    findings.error(
                        &format!("{path}.at.wall.face"),
                        "there is no wall at this face",
                        "name another face",
                    );
                }
                ProbeAt::Wall(*face)
            }
            WrittenAt::Grains(written) => {
                let path = format!("{path}.at.grains");
                if case.grains.is_none() {
                    findings.error(
                        &path,
                        "there are no grains in this case",
                        "add `grains`, or remove the probe",
                    );
                }
                if matches!(case.contact, Some(Contact::Blocks(_))) {
                    findings.error(
                        &path,
                        "the law `blocks` has contacts over areas, of which the stress of single forces and the number of contacts say nothing",
                        "use another law, or remove the probe",
                    );
                }
                ProbeAt::Grains {
                    part: match &written.part {
                        Some(part) => Block::resolve(grid, part, &format!("{path}.part"), findings),
                        None => Block {
                            from: [0.0; 3],
                            to: grid.size,
                            dimension: grid.dimension,
                        },
                    },
                    mean_from: means(case, written.mean_from, &path, findings),
                }
            }
            WrittenAt::Bed(written) => {
                let path = format!("{path}.at.bed");
                match bed::resolve(case, grid, written, &path, findings) {
                    Some(bed) => ProbeAt::Bed(Box::new(bed)),
                    None => continue,
                }
            }
        };
        probes.push(Probe {
            name: probe.name.clone(),
            every: probe.every,
            at,
        });
    }
    probes
}

/// Start of the means over time of a probe \[s\].
fn means(case: &Case, from: Option<f64>, path: &str, findings: &mut Findings) -> f64 {
    let end = case.time.end;
    if from.is_some_and(|from| from >= end) {
        findings.error(
            &format!("{path}.mean_from"),
            format!("the run ends at {} s, before the means begin", number(end)),
            Remedy::from(format!("use less than {end}"))
                .set(format!("{path}.mean_from"), 0.5 * end),
        );
    }
    from.unwrap_or(0.5 * end)
}

/// Something that happens every so often happens at least once, but for a run that was made shorter on purpose.
pub(super) fn due(case: &Case, every: f64, path: &str, findings: &mut Findings) {
    // A run without a length is refused for that.
    if case.time.end > 0.0 && every > case.time.end * (1.0 + 1e-12) {
        findings.warn(
            path,
            format!(
                "the run ends at {} s, before this interval has passed once",
                number(case.time.end)
            ),
            Remedy::from(format!("use at most {}", case.time.end)).set(path, case.time.end),
        );
    }
    if every > 0.0 && case.time.end / every > 1e7 {
        findings.error(
            path,
            format!(
                "this makes {} samples; at most 1e7",
                number(case.time.end / every)
            ),
            Remedy::from(format!(
                "use a longer interval, of {} s or more",
                at_least(case.time.end / 1e7)
            ))
            .set(path, at_least(case.time.end / 1e7)),
        );
    }
}

pub(crate) fn outputs(case: &Case, solids: bool, findings: &mut Findings) {
    let output = &case.output;
    if let Some(fluid) = &output.fluid {
        due(case, fluid.every, "output.fluid.every", findings);
        if case.fluid.is_none() {
            findings.error(
                "output.fluid",
                "there is no fluid in this case",
                Remedy::take_out("remove this output", "output.fluid"),
            );
        }
        if fluid.fields.is_empty() {
            findings.error(
                "output.fluid.fields",
                "no field is named",
                Remedy::take_out("name one, or remove this output", "output.fluid"),
            );
        }
        let seeps = matches!(case.fluid, Some(Fluid::Darcy(_)));
        let weightless =
            (case.gravity.as_ref()).is_none_or(|g| g.to_array().iter().all(|g| g.abs() <= 0.0));
        for (n, field) in fluid.fields.iter().enumerate() {
            let path = format!("output.fluid.fields[{n}]");
            match field {
                FieldName::Velocity | FieldName::Pressure => {}
                FieldName::Head if !seeps => findings.error(
                    &path,
                    "a hydraulic head is one of seepage; this is a fluid on a lattice",
                    "use `pressure`",
                ),
                FieldName::Head if weightless => findings.error(
                    &path,
                    "a head needs gravity, and there is none in this case",
                    "add `gravity`, or use `pressure`",
                ),
                FieldName::Head => {}
                _ if seeps => findings.error(
                    &path,
                    "seepage has no such field",
                    "use velocity, pressure or head",
                ),
                _ => {}
            }
            if fluid.fields[..n].contains(field) {
                findings.error(
                    &format!("output.fluid.fields[{n}]"),
                    "this field is named twice",
                    "remove one of them",
                );
            }
        }
    }
    averages(case, findings);
    let others = [
        ("output.grains", output.grains.as_ref().map(|o| o.every)),
        ("output.contacts", output.contacts.as_ref().map(|o| o.every)),
        ("output.blocks", output.blocks.as_ref().map(|o| o.every)),
    ];
    for (path, every) in others {
        if let Some(every) = every {
            due(case, every, &format!("{path}.every"), findings);
            if !solids {
                findings.error(
                    path,
                    "there are no grains, blocks or bodies in this case",
                    "remove this output",
                );
            }
        }
    }
    if let Some(every) = case.checkpoint.every {
        due(case, every, "checkpoint.every", findings);
    }
}

fn averages(case: &Case, findings: &mut Findings) {
    let Some(averages) = &case.output.averages else {
        return;
    };
    let path = "output.averages";
    if !matches!(case.fluid, Some(Fluid::LatticeBoltzmann(_))) {
        findings.error(
            path,
            "averages are those of a fluid on a lattice, and there is none in this case",
            Remedy::take_out("remove this output", path),
        );
    }
    due(
        case,
        averages.sample_every,
        &format!("{path}.sample_every"),
        findings,
    );
    if let Some(every) = averages.every {
        due(case, every, &format!("{path}.every"), findings);
    }
    if averages.from >= case.time.end {
        findings.error(
            &format!("{path}.from"),
            format!(
                "the run ends at {} s, before the first sample",
                number(case.time.end)
            ),
            Remedy::from(format!("use less than {}", case.time.end))
                .set(format!("{path}.from"), 0.5 * case.time.end),
        );
    }
    if averages.profile == Some(Axis::Z) && case.domain.size.0.len() == 2 {
        findings.error(
            &format!("{path}.profile"),
            "there is no z in a 2-D problem",
            "use x or y",
        );
    }
}

pub(crate) fn erosion_law(
    case: &Case,
    grid: &Grid,
    regions: &[Region],
    findings: &mut Findings,
) -> Option<ErosionLaw> {
    let law = case.analysis.erosion_law.as_ref()?;
    let path = "analysis.erosion_law";
    let hole = Block::resolve(grid, &law.hole, &format!("{path}.hole"), findings);
    due(case, law.every, &format!("{path}.every"), findings);
    let flow_axis = law.flow_axis.index();
    if flow_axis >= grid.dimension {
        findings.error(
            &format!("{path}.flow_axis"),
            "there is no z in a 2-D problem",
            "use x or y",
        );
    }
    // A hole has two faces; a stream above a bed has one.
    let across = usize::from(flow_axis == 0);
    if flow_axis < grid.dimension
        && (hole.from[across] < grid.spacing || hole.to[across] > grid.size[across] - grid.spacing)
    {
        findings.error(
            &format!("{path}.hole"),
            format!(
                "the hole reaches the face of the domain across the flow, along {}, so that it does not have two faces of grains and its width and shear stress are not defined",
                ["x", "y"][across]
            ),
            "leave grains on both sides of the hole; for a bed under a stream use a probe at a `bed`",
        );
    }
    for (what, there) in [
        ("fluid", case.fluid.is_some()),
        ("grains", case.grains.is_some()),
    ] {
        if !there {
            findings.error(
                path,
                format!("there is no {what} in this case"),
                format!("add `{what}`, or remove the analysis"),
            );
        }
    }
    let removes = |r: &Region| matches!(r.action, Action::Remove { .. });
    let outlets: Vec<usize> = regions
        .iter()
        .enumerate()
        .filter(|(_, r)| removes(r) && law.outlet.as_ref().is_none_or(|name| r.name == *name))
        .map(|(n, _)| n)
        .collect();
    if outlets.is_empty() {
        let (at, reason) = match law.outlet {
            Some(_) => (
                format!("{path}.outlet"),
                "there is no region of this name that removes grains",
            ),
            None => (
                path.to_string(),
                "no region removes grains, so that no erosion would be counted",
            ),
        };
        findings.error(
            &at,
            reason,
            "add a region with {\"remove\": {}} and name it",
        );
    }
    Some(ErosionLaw {
        hole,
        flow_axis,
        every: law.every,
        outlets,
        end_at_eroded_fraction: law.end_at_eroded_fraction,
    })
}
