//! The conditions of the flow on the faces of the domain.

use super::block::Block;
use super::findings::Findings;
use super::findings::LATTICE_PATH as PATH;
use super::grid::Grid;
use super::initial::resolved;
use super::profile::Table;
use crate::case::boundary::{Condition as Written, Fluctuations, VelocityProfile as Profile};
use crate::case::fluid::LatticeBoltzmann;
use crate::case::geometry::Face;
use crate::number::{real, whole};
use serde::Serialize;
use std::path::Path;

/// A condition on the cells next to a part of a face.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Patch {
    /// Name in the case; that of the face for a wall nobody named.
    pub name: String,
    /// The face.
    pub face: Face,
    /// First cell along each axis; 0 along the normal.
    pub from: [usize; 3],
    /// One past the last cell along each axis; 1 along the normal.
    pub to: [usize; 3],
    /// What holds there.
    pub condition: Condition,
    /// Position in the list of boundaries of the case; none for a wall nobody named.
    pub index: Option<usize>,
}

/// What the fluid does at a patch, in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Condition {
    /// A wall at rest.
    NoSlip,
    /// A wall that slides with this velocity [m/s].
    MovingWall([f64; 3]),
    /// A plane of symmetry.
    FreeSlip,
    /// Velocity imposed.
    Velocity {
        /// The profile.
        profile: VelocityProfile,
        /// It grows linearly from zero over this time \[s\]; 0 for at once.
        ramp_time: f64,
        /// What fluctuates about the profile.
        turbulence: Option<Fluctuations>,
    },
    /// Pressure imposed: from `from` linearly to `value` \[Pa\] over `ramp_time` \[s\]; 0 for at once.
    Pressure {
        /// Final pressure above the reference \[Pa\].
        value: f64,
        /// Pressure at the start \[Pa\].
        from: f64,
        /// Time of the change \[s\].
        ramp_time: f64,
    },
    /// No gradient along the normal.
    Outflow,
    /// Carried out with this velocity [m/s]; without one with that of the fluid.
    ConvectiveOutflow(Option<f64>),
}

/// A velocity over a patch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum VelocityProfile {
    /// The same everywhere [m/s].
    Uniform([f64; 3]),
    /// A parabola along the inward normal with this peak [m/s], zero at the edges of the patch.
    Parabolic(f64),
    /// From a CSV file.
    File(Table),
}

/// Turbulence enters with the mean flow; a table is asked once its patch is known.
fn carried_in(profile: &Profile, face: Face, path: &str, findings: &mut Findings) {
    let inflow = match profile {
        Profile::Uniform(velocity) => {
            let inward = face.inward();
            let parts = velocity.0.iter().zip(inward);
            parts.map(|(u, n)| u * n).sum()
        }
        Profile::Parabolic { peak } => *peak,
        Profile::File { .. } => return,
    };
    if inflow <= 0.0 {
        findings.error(path, OUTWARD, TURN_ROUND);
    }
}

/// Mean velocity of a table into the domain over the cells of a patch [m/s]; none where it is not worth the time.
fn mean_inflow(table: &Table, patch: &Patch, grid: &Grid) -> Option<f64> {
    let (axis, inward) = (patch.face.axis(), patch.face.inward());
    let cells = (0..3).map(|a| patch.to[a].saturating_sub(patch.from[a]));
    let cells = cells.fold(1, usize::saturating_mul);
    let looks = if grid.dimension == 2 { 20 } else { table.len() };
    if cells.saturating_mul(looks) > MOST_LOOKS || cells == 0 {
        return None;
    }
    let mut sum = 0.0;
    for z in patch.from[2]..patch.to[2] {
        for y in patch.from[1]..patch.to[1] {
            for x in patch.from[0]..patch.to[0] {
                let centre = grid.centre([x, y, z]);
                let across: Vec<f64> = (0..grid.dimension)
                    .filter(|&a| a != axis)
                    .map(|a| centre[a])
                    .collect();
                let u = table.at(&across);
                sum += (0..3).map(|a| u[a] * inward[a]).sum::<f64>();
            }
        }
    }
    Some(sum / real(cells))
}

/// Rows of a profile that are looked at before the run, at most.
const MOST_LOOKS: usize = 20_000_000;

/// Turbulence enters with the mean flow, that of a table too.
fn tables_flow_in(faces: &[Vec<Patch>; 6], grid: &Grid, findings: &mut Findings) {
    for patch in faces.iter().flatten() {
        let (
            Some(n),
            Condition::Velocity {
                profile: VelocityProfile::File(table),
                turbulence: Some(_),
                ..
            },
        ) = (patch.index, &patch.condition)
        else {
            continue;
        };
        if !table.is_empty() && mean_inflow(table, patch, grid).is_some_and(|mean| mean <= 0.0) {
            findings.error(
                &format!("{PATH}.boundaries[{n}].condition.velocity.turbulence"),
                OUTWARD,
                TURN_ROUND,
            );
        }
    }
}

const OUTWARD: &str =
    "turbulence is carried in by the mean flow, but this profile does not flow into the domain";
const TURN_ROUND: &str = "turn the profile round, or take the turbulence out";

/// The patches of every face of the domain.
pub(super) fn faces(
    lbm: &LatticeBoltzmann,
    grid: &Grid,
    directory: &Path,
    findings: &mut Findings,
) -> [Vec<Patch>; 6] {
    let mut faces: [Vec<Patch>; 6] = Default::default();
    for face in Face::ALL {
        if face.axis() < grid.dimension && !grid.periodic[face.axis()] {
            let (from, to) = whole_face(grid, face);
            faces[face.index()].push(Patch {
                name: face.name().into(),
                face,
                from,
                to,
                condition: Condition::NoSlip,
                index: None,
            });
        }
    }
    let mut named = [false; 6];
    let mut names: Vec<&str> = Vec::new();
    for (n, boundary) in lbm.boundaries.iter().enumerate() {
        let path = format!("{PATH}.boundaries[{n}]");
        let face = boundary.face;
        super::unique(
            &mut names,
            &boundary.name,
            &format!("{path}.name"),
            findings,
        );
        let condition = condition(&boundary.condition, face, grid, directory, &path, findings);
        if face.axis() >= grid.dimension {
            findings.error(
                &format!("{path}.face"),
                "there is no such face in a 2-D problem",
                "take this condition out",
            );
            continue;
        }
        if grid.periodic[face.axis()] {
            let axis = ["x", "y", "z"][face.axis()];
            findings.error(
                &format!("{path}.face"),
                format!("the domain is periodic along {axis}: this face has no condition"),
                format!("take this condition out, or {axis} out of domain.periodic"),
            );
            continue;
        }
        let Some(extent) = &boundary.patch else {
            if std::mem::replace(&mut named[face.index()], true) {
                findings.error(
                    &format!("{path}.face"),
                    format!("the whole face {} has two conditions", face.name()),
                    "keep one, or give one of them a patch",
                );
            }
            let base = &mut faces[face.index()][0];
            base.name.clone_from(&boundary.name);
            base.condition = condition;
            base.index = Some(n);
            continue;
        };
        let patch_path = format!("{path}.patch");
        let block = tangential(grid, face, extent, &patch_path, findings);
        let (mut from, mut to) = whole_face(grid, face);
        for a in (0..grid.dimension).filter(|a| *a != face.axis()) {
            // A cell belongs to a patch if its centre does.
            from[a] = whole((block.from[a] / grid.spacing - 0.5).ceil()).min(grid.cells[a]);
            to[a] = whole((block.to[a] / grid.spacing - 0.5).ceil()).min(grid.cells[a]);
            if from[a] >= to[a] && block.from[a] < block.to[a] {
                findings.error(
                    &patch_path,
                    "the patch holds the centre of no cell",
                    "make it larger, or the spacing finer",
                );
            }
        }
        let overlaps = faces[face.index()][1..]
            .iter()
            .find(|other| (0..3).all(|a| other.from[a] < to[a] && from[a] < other.to[a]));
        if let Some(other) = overlaps {
            findings.error(
                &patch_path,
                format!("this patch overlaps the patch of `{}`", other.name),
                "make them share no cell",
            );
        }
        faces[face.index()].push(Patch {
            name: boundary.name.clone(),
            face,
            from,
            to,
            condition,
            index: Some(n),
        });
    }
    closed_volume(&faces, grid, findings);
    tables_flow_in(&faces, grid, findings);
    faces
}

/// The box of a patch; what it says along the normal does not matter.
fn tangential(
    grid: &Grid,
    face: Face,
    extent: &crate::case::geometry::Extent,
    path: &str,
    findings: &mut Findings,
) -> Block {
    let mut extent = extent.clone();
    let axis = face.axis();
    if let (Some(from), Some(to)) = (extent.from.0.get_mut(axis), extent.to.0.get_mut(axis)) {
        (*from, *to) = (0.0, grid.size[axis]);
    }
    Block::resolve(grid, &extent, path, findings)
}

fn whole_face(grid: &Grid, face: Face) -> ([usize; 3], [usize; 3]) {
    let mut to = grid.cells;
    to[face.axis()] = 1;
    ([0; 3], to)
}

fn condition(
    written: &Written,
    face: Face,
    grid: &Grid,
    directory: &Path,
    path: &str,
    findings: &mut Findings,
) -> Condition {
    match written {
        Written::NoSlip {} => Condition::NoSlip,
        Written::FreeSlip {} => Condition::FreeSlip,
        Written::Outflow {} => Condition::Outflow,
        Written::MovingWall { velocity } => {
            let path = format!("{path}.condition.moving_wall.velocity");
            let velocity = Block::vector(grid, velocity, &path, findings);
            if velocity[face.axis()] != 0.0 {
                findings.error(
                    &path,
                    "a wall slides in its own plane, but this velocity has a part normal to the face",
                    "make that component 0, or impose a velocity",
                );
            }
            Condition::MovingWall(velocity)
        }
        Written::ConvectiveOutflow { velocity } => Condition::ConvectiveOutflow(*velocity),
        Written::Velocity {
            profile,
            ramp_time,
            turbulence,
        } => {
            if let Some(turbulence) = turbulence {
                let path = format!("{path}.condition.velocity.turbulence");
                resolved(turbulence, grid, &path, findings);
                carried_in(profile, face, &path, findings);
            }
            let path = format!("{path}.condition.velocity.profile");
            let profile = match profile {
                Profile::Uniform(velocity) => VelocityProfile::Uniform(Block::vector(
                    grid,
                    velocity,
                    &format!("{path}.uniform"),
                    findings,
                )),
                Profile::Parabolic { peak } => VelocityProfile::Parabolic(*peak),
                Profile::File { path: file } => {
                    let file = directory.join(file);
                    let empty = Table::empty(file.clone(), grid.dimension);
                    VelocityProfile::File(Table::read(file, grid.dimension).unwrap_or_else(
                        |reason| {
                            let remedy = "correct the path (relative to the case) or the file";
                            findings.error(&format!("{path}.file.path"), reason, remedy);
                            empty
                        },
                    ))
                }
            };
            Condition::Velocity {
                profile,
                ramp_time: ramp_time.unwrap_or(0.0),
                turbulence: *turbulence,
            }
        }
        Written::Pressure { value, ramp } => Condition::Pressure {
            value: *value,
            from: ramp.as_ref().map_or(*value, |r| r.from),
            ramp_time: ramp.as_ref().map_or(0.0, |r| r.duration),
        },
    }
}

/// Water is nearly incompressible: what flows in must find a way out.
fn closed_volume(faces: &[Vec<Patch>; 6], grid: &Grid, findings: &mut Findings) {
    let mut inflow = 0.0;
    let mut through = 0.0;
    let mut first: Option<&Patch> = None;
    for patch in faces.iter().flatten() {
        match &patch.condition {
            Condition::Pressure { .. } | Condition::Outflow | Condition::ConvectiveOutflow(_) => {
                return;
            }
            Condition::Velocity { profile, .. } => {
                let cells: f64 = (0..3)
                    .map(|a| real(patch.to[a] - patch.from[a].min(patch.to[a])))
                    .product();
                let axes = grid.dimension - 1;
                let normal = match profile {
                    VelocityProfile::Uniform(velocity) => {
                        let inward = patch.face.inward();
                        (0..3).map(|a| velocity[a] * inward[a]).sum()
                    }
                    VelocityProfile::Parabolic(peak) => {
                        peak * if axes == 1 { 2.0 / 3.0 } else { 4.0 / 9.0 }
                    }
                    VelocityProfile::File(_) => return,
                };
                inflow += normal * cells;
                through += f64::abs(normal * cells);
                first = first.or(Some(patch));
            }
            _ => {}
        }
    }
    if let Some(patch) = first
        && inflow.abs() > 1e-9 * through
    {
        findings.error(
            &format!("{PATH}.boundaries"),
            format!(
                "`{}` imposes a velocity, but no face lets as much fluid out",
                patch.name
            ),
            "give another face a pressure or an outflow",
        );
    }
}
