//! Regions, probes, outputs and analyses of a scene.

mod bed;
mod probes;
mod seepage;

use super::aligned_box::AlignedBox;
use super::findings::{Findings, at_least, number};
use super::grains::{check_radii, fits_domain};
use super::grid::Grid;
use super::structures::Structure;
use super::{material, unique};
use base::error::Remedy;
use base::number::real;
pub use bed::ObservedBed;
use case::Case;
use case::fluid::Fluid;
use case::geometry::{Axis, Face};
use case::grains::Radii;
use case::observe::{Action as Written, FieldName, When};
use darcy::Condition;
use darcy::Prisms;
pub(crate) use probes::{Measured, probes};
use serde::Serialize;

/// Box in which grains are removed, generated or recorded.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObservedRegion {
    /// Name of the region.
    pub name: String,
    /// Box of the region.
    pub block: AlignedBox,
    /// Action in the region.
    pub action: RegionAction,
}

/// Action in a region.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum RegionAction {
    /// Removal of grains.
    Remove {
        /// Condition for the removal.
        when: When,
    },
    /// Generation of grains.
    Generate {
        /// Grains per second [1/s].
        rate: f64,
        /// Radii \[m\].
        radii: Radii,
        /// Velocity [m/s].
        velocity: [f64; 3],
        /// Seed of the random numbers.
        seed: u64,
        /// Index of the material.
        material: usize,
        /// Maximum number of grains, if any.
        at_most: Option<u32>,
    },
    /// Log of entering and leaving grains.
    Record,
}

/// Quantity sampled at an interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Probe {
    /// Name of its file.
    pub name: String,
    /// Time between samples \[s\].
    pub every: f64,
    /// Location of the samples.
    pub at: ProbeAt,
}

/// Location of the samples of a probe.
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
        /// Axis normal to the plane: 0, 1 or 2.
        axis: usize,
        /// Coordinate of the plane \[m\].
        position: f64,
    },
    /// Force and torque on a body, by index in [`super::Scene::bodies`].
    Body(usize),
    /// Force on a structure.
    Structure {
        /// Index among the structures in contact with water.
        index: usize,
        /// Reference point of the torque \[m\].
        about: [f64; 3],
    },
    /// Discharge of seepage between two points of a plane.
    Crossing {
        /// First point \[m\].
        from: [f64; 3],
        /// Last point \[m\].
        to: [f64; 3],
    },
    /// Heave of prisms of ground.
    Heave(Prisms),
    /// Discharge of seepage through a part of a plane.
    Section {
        /// Axis normal to the plane: 0, 1 or 2.
        axis: usize,
        /// Coordinate of the plane \[m\].
        position: f64,
        /// Part of the plane; none for the whole plane.
        part: Option<AlignedBox>,
    },
    /// Water table of the seepage; the number is that of the columns of cells.
    WaterTable(usize),
    /// Water balance of the seepage.
    WaterBalance,
    /// Force of the water of a seepage on a part of a plane.
    Uplift {
        /// Axis normal to the plane: 0, 1 or 2.
        axis: usize,
        /// Coordinate of the plane \[m\].
        position: f64,
        /// Part of the plane; none for the whole plane.
        part: Option<AlignedBox>,
        /// Reference point of the torque \[m\].
        about: [f64; 3],
    },
    /// Load of the grains on a wall.
    WallLoad {
        /// Index in [`super::Scene::walls`].
        wall: usize,
        /// Reference point of the torque \[m\].
        about: [f64; 3],
    },
    /// Surface elevation in the column of this cell.
    Gauge([usize; 3]),
    /// Cell of a joint nearest to a point \[m\].
    Joint([f64; 3]),
    /// Mouth of the joints, by its index.
    Mouth(usize),
    /// Load on a block, by its index in [`super::blocks::PlacedBlocks`].
    Block(usize),
    /// Force on a face.
    Wall(Face),
    /// A bed of grains.
    Bed(Box<ObservedBed>),
    /// Grains in a box.
    Grains {
        /// Box in which the grains are measured.
        part: AlignedBox,
        /// Start of the time means \[s\].
        mean_from: f64,
    },
}

/// Erosion law analysis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErosionLaw {
    /// Box of the hole before erosion.
    pub hole: AlignedBox,
    /// Axis of the flow: 0, 1 or 2.
    pub flow_axis: usize,
    /// Time between samples \[s\].
    pub every: f64,
    /// Indices of the regions whose removals count as eroded.
    pub outlets: Vec<usize>,
    /// Eroded fraction of the mass at which the run ends.
    pub end_at_eroded_fraction: Option<f64>,
}

/// Returns the regions; refuses feeds that lie in a structure. `names` are those of the materials.
pub(crate) fn regions(
    case: &Case,
    grid: &Grid,
    (names, structures): (&[String], &[Structure]),
    findings: &mut Findings,
) -> Vec<ObservedRegion> {
    let mut known = Vec::new();
    let mut regions = Vec::new();
    for (n, region) in case.regions.iter().enumerate() {
        let path = format!("regions[{n}]");
        unique(&mut known, &region.name, &format!("{path}.name"), findings);
        let block = AlignedBox::resolve(grid, &region.region, &format!("{path}.box"), findings);
        let action = match &region.action {
            Written::Remove { when } => RegionAction::Remove { when: *when },
            Written::Record {} => RegionAction::Record,
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
                    fits_domain(grid, largest, &format!("{path}.radii"), findings);
                }
                let velocity = velocity.as_ref().map_or([0.0; 3], |v| {
                    AlignedBox::vector(grid, v, &format!("{path}.velocity"), findings)
                });
                let name = name.as_ref().or(case.grains.as_ref().map(|g| &g.material));
                let path = format!("{path}.material");
                let index = generated(name, names, &path, findings);
                let (smallest, _) = radii.bounds();
                if let Some(rock) = covering(&block, smallest, structures) {
                    findings.error(
                        &format!("regions[{n}].box"),
                        format!(
                            "no grain of a radius of {} m has room in this region outside the structure `{rock}`",
                            number(smallest)
                        ),
                        "move the region out of the structure",
                    );
                }
                RegionAction::Generate {
                    rate: *rate,
                    radii: radii.clone(),
                    velocity,
                    seed: *seed,
                    material: index.unwrap_or(0),
                    at_most: *at_most,
                }
            }
        };
        regions.push(ObservedRegion {
            name: region.name.clone(),
            block,
            action,
        });
    }
    let source = regions
        .iter()
        .any(|r| matches!(r.action, RegionAction::Generate { .. }));
    if !regions.is_empty() && !source && case.grains.is_none() {
        findings.warn(
            "regions",
            "there are no grains in this case",
            "add `grains`, or remove the regions",
        );
    }
    regions
}

/// Number of positions along each axis that are tried for a grain of a feed.
const TRIED: usize = 12;

/// Returns the name of the structure that covers the middle of a region if grains of this radius \[m\] have no space
/// outside the structures at any of [`TRIED`] positions along each axis.
fn covering<'a>(block: &AlignedBox, radius: f64, structures: &'a [Structure]) -> Option<&'a str> {
    let solid = |at: [f64; 3]| {
        let mut stopping = structures.iter().filter(|one| one.stops.grains());
        stopping.find(|one| one.solid.distance(at) < radius)
    };
    let at = |share: f64, axis: usize| {
        let (from, to) = (block.from[axis] + radius, block.to[axis] - radius);
        if from < to {
            from + share * (to - from)
        } else {
            0.5 * (from + to)
        }
    };
    let tried = |axis| if axis < block.dimension { TRIED } else { 1 };
    for n in 0..tried(0) * tried(1) * tried(2) {
        let number = [n % TRIED, n / TRIED % TRIED, n / TRIED / TRIED];
        let point = std::array::from_fn(|axis| {
            if axis < block.dimension {
                at(real(number[axis]) / real(TRIED - 1), axis)
            } else {
                0.0
            }
        });
        solid(point)?;
    }
    let middle = std::array::from_fn(|axis| {
        if axis < block.dimension {
            at(0.5, axis)
        } else {
            0.0
        }
    });
    solid(middle).map(|rock| rock.name.as_str())
}

/// Returns the index of the material of generated grains.
fn generated(
    name: Option<&String>,
    names: &[String],
    path: &str,
    findings: &mut Findings,
) -> Option<usize> {
    if name.is_none() {
        findings.error(path, "the grains need a material", "name one");
    }
    material(names, name?, path, findings)
}

/// Returns the start of the time means of a probe \[s\].
fn averaging_start(case: &Case, from: Option<f64>, path: &str, findings: &mut Findings) -> f64 {
    let end = case.time.end;
    if from.is_some_and(|from| from >= end) {
        findings.error(
            &format!("{path}.mean_from"),
            format!(
                "the run ends at {} s, before the averaging begins",
                number(end)
            ),
            Remedy::from(format!("use less than {end}"))
                .set(format!("{path}.mean_from"), 0.5 * end),
        );
    }
    from.unwrap_or(0.5 * end)
}

/// Checks that periodic events occur at least once, except in a run that was shortened on purpose.
pub(super) fn due(case: &Case, every: f64, path: &str, findings: &mut Findings) {
    // A run without a duration is refused for that reason.
    if case.time.end > 0.0 && every > case.time.end * (1.0 + 1e-12) {
        findings.warn(
            path,
            format!(
                "the run ends at {} s, before the first interval has passed",
                number(case.time.end)
            ),
            Remedy::from(format!("use at most {}", case.time.end)).set(path, case.time.end),
        );
    }
    if every > 0.0 && case.time.end / every > 1e7 {
        findings.error(
            path,
            format!(
                "this makes {} samples; at most 1e7 are allowed",
                number(case.time.end / every)
            ),
            Remedy::from(format!(
                "use a longer interval, of {} s or more",
                number(at_least(case.time.end / 1e7))
            ))
            .set(path, at_least(case.time.end / 1e7)),
        );
        findings.depends(&["time"]);
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
            findings.depends(&["fluid"]);
        }
        if fluid.fields.is_empty() {
            findings.error(
                "output.fluid.fields",
                "the list of fields is empty",
                Remedy::take_out("add a field, or remove this output", "output.fluid"),
            );
        }
        check_fields(case, &fluid.fields, findings);
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
                findings.depends(&["grains", "blocks", "bodies"]);
            }
        }
    }
    if let Some(every) = case.checkpoint.every {
        due(case, every, "checkpoint.every", findings);
    }
}

/// Refuses fields that the fluid does not have, and fields named twice.
fn check_fields(case: &Case, fields: &[FieldName], findings: &mut Findings) {
    let seeps = matches!(case.fluid, Some(Fluid::Darcy(_)));
    let drains = matches!(&case.fluid, Some(Fluid::Darcy(darcy)) if darcy.unsaturated.is_some());
    let weightless =
        (case.gravity.as_ref()).is_none_or(|g| g.to_array().iter().all(|g| g.abs() <= 0.0));
    for (n, field) in fields.iter().enumerate() {
        let path = format!("output.fluid.fields[{n}]");
        match field {
            FieldName::Velocity | FieldName::Pressure => {}
            FieldName::Head if !seeps => findings.error(
                &path,
                "the hydraulic head is a field of seepage, but this fluid is computed on a lattice",
                "use `pressure`",
            ),
            FieldName::Head if weightless => findings.error(
                &path,
                "a head needs gravity, but this case has none",
                "add `gravity`, or use `pressure`",
            ),
            FieldName::Head => {}
            FieldName::StreamFunction => check_stream_function(case, &path, findings),
            FieldName::Saturation if drains => {}
            FieldName::Saturation => findings.error(
                &path,
                "saturation is a field of unsaturated ground, and this case has none",
                "add `fluid.darcy.unsaturated`, or remove the field",
            ),
            _ if seeps => findings.error(
                &path,
                "seepage does not have this field",
                "use velocity, pressure, head, stream_function or saturation",
            ),
            _ => {}
        }
        if fields[..n].contains(field) {
            findings.error(&path, "this field is named twice", "remove one of them");
        }
    }
}

/// Refuses a stream function for a flow that has none.
fn check_stream_function(case: &Case, path: &str, findings: &mut Findings) {
    let Some(Fluid::Darcy(written)) = &case.fluid else {
        findings.error(
            path,
            "the stream function is a field of seepage, but this fluid is computed on a lattice",
            "use `velocity`, and `picture --streamlines`",
        );
        return;
    };
    let transient = written
        .unsaturated
        .as_ref()
        .is_some_and(|soil| soil.transient.is_some());
    let reason = if case.domain.size.0.len() != 2 {
        "a stream function needs a plane flow, and this is a 3-D problem"
    } else if transient {
        "ground that stores water has no stream function, because inflow and outflow of a cell differ"
    } else if case.grains.is_some() || !case.bodies.is_empty() {
        "water between moving grains has no stream function, because the grains displace it"
    } else if written.drains.iter().any(|drain| is_inside(case, drain)) {
        "around a drain or a well inside the ground a stream function has no single value"
    } else {
        return;
    };
    findings.error(path, reason, "use `velocity`, and `picture --streamlines`");
}

/// Returns `true` if a drain that takes water touches no face of the domain.
fn is_inside(case: &Case, drain: &case::darcy::Drain) -> bool {
    let (from, to) = (drain.region.from.to_array(), drain.region.to.to_array());
    let size = case.domain.size.0.iter().enumerate();
    let touches = size.clone().any(|(a, size)| {
        let slack = 1e-9 * size;
        from[a] <= slack || to[a] >= size - slack
    });
    !touches && drain.condition != Condition::NoFlow {}
}

fn averages(case: &Case, findings: &mut Findings) {
    let Some(averages) = &case.output.averages else {
        return;
    };
    let path = "output.averages";
    if !matches!(case.fluid, Some(Fluid::LatticeBoltzmann(_))) {
        findings.error(
            path,
            "averages are computed for a fluid on a lattice, and this case has none",
            Remedy::take_out("remove this output", path),
        );
        findings.depends(&["fluid"]);
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

const EROSION_LAW: &str = "analysis.erosion_law";

pub(crate) fn erosion_law(
    case: &Case,
    grid: &Grid,
    regions: &[ObservedRegion],
    findings: &mut Findings,
) -> Option<ErosionLaw> {
    let law = case.analysis.erosion_law.as_ref()?;
    let path = EROSION_LAW;
    let hole = AlignedBox::resolve(grid, &law.hole, &format!("{path}.hole"), findings);
    due(case, law.every, &format!("{path}.every"), findings);
    let flow_axis = law.flow_axis.index();
    if flow_axis >= grid.dimension {
        findings.error(
            &format!("{path}.flow_axis"),
            "there is no z in a 2-D problem",
            "use x or y",
        );
    }
    // A hole needs two faces; a stream above a bed has only one.
    let across = usize::from(flow_axis == 0);
    if flow_axis < grid.dimension
        && (hole.from[across] < grid.spacing || hole.to[across] > grid.size[across] - grid.spacing)
    {
        findings.error(
            &format!("{path}.hole"),
            format!(
                "along {}, across the flow, the hole reaches the face of the domain: it is not bounded by grains \
                 on both sides, so that its width and shear stress are not defined",
                ["x", "y"][across]
            ),
            "place grains on both sides of the hole; for a bed under a stream use a probe at a `bed`",
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
            findings.depends(&["fluid", "grains"]);
        }
    }
    let outlets = outlets(law.outlet.as_deref(), regions, findings);
    Some(ErosionLaw {
        hole,
        flow_axis,
        every: law.every,
        outlets,
        end_at_eroded_fraction: law.end_at_eroded_fraction,
    })
}

/// Returns the indices of the regions whose removals count as eroded.
fn outlets(
    outlet: Option<&str>,
    regions: &[ObservedRegion],
    findings: &mut Findings,
) -> Vec<usize> {
    let removes = |r: &ObservedRegion| matches!(r.action, RegionAction::Remove { .. });
    let outlets: Vec<usize> = regions
        .iter()
        .enumerate()
        .filter(|(_, r)| removes(r) && outlet.is_none_or(|name| r.name == name))
        .map(|(n, _)| n)
        .collect();
    if outlets.is_empty() {
        let (at, reason) = match outlet {
            Some(_) => (
                format!("{EROSION_LAW}.outlet"),
                "no region with this name removes grains",
            ),
            None => (
                EROSION_LAW.to_string(),
                "no region removes grains, so that no erosion could be measured",
            ),
        };
        findings.error(
            &at,
            reason,
            "add a region with {\"remove\": {}} and name it",
        );
        findings.depends(&["regions"]);
    }
    outlets
}
