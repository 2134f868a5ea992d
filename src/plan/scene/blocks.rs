//! The blocks of a scene: a jointed rock mass, a file or a list, and their positions.

use super::aligned_box::AlignedBox as Extent;
use super::findings::{Findings, number};
use super::grid::Grid;
use super::motion::{motion, needs_density};
use super::rock::joints::{JointSet, Spacing, upward_normal};
use super::rock::{RockMass, list};
use super::sample::REMEDY;
use super::{material, stl};
use base::number::real;
use case::Case;
use case::blocks::{Block as Written, BlockSource, Joints, Mass, Spacing as WrittenSpacing};
use case::geometry::Rotation;
use case::solids::{Mesh, Orientation, Shape};
use dem::polyhedron::{HalfSpace, Piece, PlacedPolyhedron, Polyhedron, ShapeError};
use nalgebra::{Unit, UnitQuaternion, Vector3};
use serde::Serialize;
use std::path::PathBuf;
use structure::surface::judge_unit;

/// Maximum number of blocks of a rock mass, all of which every rank generates before the run starts. Larger masses
/// come from a file.
const MAX_BLOCKS: f64 = 2e4;
/// Maximum number of planes of a joint set.
const MAX_PLANES: f64 = 1e5;

/// Blocks and their positions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlacedBlocks {
    /// Number of blocks.
    pub number: usize,
    /// Number of blocks that never move.
    pub fixed: usize,
    /// Volume of all blocks together \[m³\].
    pub volume: f64,
    /// Blocks in the order of their ids.
    #[serde(skip)]
    pub list: Vec<RockBlock>,
    /// File to which the blocks are saved at the start; relative to the output folder.
    pub save: Option<PathBuf>,
}

impl PlacedBlocks {
    /// Returns the diameter of the inscribed sphere of the thinnest block \[m\].
    #[must_use]
    pub fn thinnest(&self) -> Option<f64> {
        let blocks = self.list.iter();
        blocks
            .map(|block| Piece::from_polyhedron(&block.solid).thickness())
            .min_by(f64::total_cmp)
    }
}

/// Block in its initial state.
#[derive(Clone, Debug, PartialEq)]
pub struct RockBlock {
    /// Shape and position.
    pub solid: PlacedPolyhedron,
    /// Velocity [m/s].
    pub velocity: [f64; 3],
    /// Rotation rate [rad/s].
    pub angular_velocity: [f64; 3],
    /// Index of its material.
    pub material: usize,
    /// `true` if the block never moves.
    pub fixed: bool,
}

impl RockBlock {
    /// Returns a free, stationary block.
    fn resting(solid: PlacedPolyhedron, material: usize) -> Self {
        Self {
            solid,
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            material,
            fixed: false,
        }
    }
}

pub(crate) fn blocks(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Option<PlacedBlocks> {
    let written = case.blocks.as_ref()?;
    if grid.dimension == 2 {
        findings.error(
            "blocks",
            "blocks require a 3-D domain",
            "add a third value to `domain.size`",
        );
        return None;
    }
    let index = material(names, &written.material, "blocks.material", findings).unwrap_or(0);
    needs_density(case, &written.material, findings);
    let mut list = match &written.initial {
        BlockSource::Joints(joints) => jointed(case, grid, joints, findings)?
            .into_iter()
            .map(|solid| RockBlock::resting(solid, index))
            .collect(),
        BlockSource::File { path, origin } => {
            let mut blocks = read(case, path, names, index, findings)?;
            if let Some(origin) = origin {
                let origin = origin.resolve(3, "blocks.initial.file.origin", findings);
                for block in &mut blocks {
                    block.solid.position += Vector3::from(origin);
                }
            }
            blocks
        }
        BlockSource::List(list) => listed(case, grid, list, names, index, findings)?,
    };
    let boxes: Vec<Extent> = (written.fixed.iter().enumerate())
        .map(|(n, extent)| Extent::resolve(grid, extent, &format!("blocks.fixed[{n}]"), findings))
        .collect();
    for block in &mut list {
        let at = block.solid.position.into();
        block.fixed |= boxes.iter().any(|extent| extent.contains(at));
    }
    let outside = |block: &&RockBlock| !grid.contains(block.solid.position.into());
    if let Some(n) = list.iter().position(|block| outside(&block)) {
        let all = real(list.iter().filter(outside).count());
        findings.error(
            "blocks.initial",
            format!(
                "the centroid of block {n} lies outside the domain; this is the case for {} blocks in total",
                number(all)
            ),
            "move them inside, or make the domain larger",
        );
    }
    Some(PlacedBlocks {
        number: list.len(),
        fixed: list.iter().filter(|block| block.fixed).count(),
        volume: list.iter().map(|block| block.solid.shape.volume()).sum(),
        list,
        save: written.save.clone(),
    })
}

/// Returns the blocks of a jointed mass, or reports findings.
fn jointed(
    case: &Case,
    grid: &Grid,
    joints: &Joints,
    findings: &mut Findings,
) -> Option<Vec<PlacedPolyhedron>> {
    let path = "blocks.initial.joints";
    let mass = rock_mass(case, grid, joints, path, findings)?;
    let blocks = mass.expected();
    if blocks > MAX_BLOCKS {
        findings.error(
            &format!("{path}.sets"),
            format!(
                "the joints create up to {} blocks; at most {} are allowed",
                number(blocks),
                number(MAX_BLOCKS)
            ),
            "use a larger spacing, in m, or a smaller rock mass",
        );
        return None;
    }
    let narrowest = 0.5 * mass.smallest_thickness;
    if mass.aperture > narrowest {
        findings.error(
            &format!("{path}.aperture"),
            format!(
                "the aperture must be smaller than the thinnest block: it can be at most {} m, half of \
                 smallest_thickness",
                number(narrowest)
            ),
            "use a smaller aperture, or a larger smallest_thickness",
        );
        return None;
    }
    match mass.blocks() {
        Ok(blocks) => Some(blocks),
        Err(error) => {
            findings.error(
                path,
                format!("a block cannot be made: {error}"),
                "use a larger smallest_thickness",
            );
            None
        }
    }
}

/// Returns the rock before it is cut, with its joint sets, or reports findings.
fn rock_mass(
    case: &Case,
    grid: &Grid,
    joints: &Joints,
    path: &str,
    findings: &mut Findings,
) -> Option<RockMass> {
    let whole = match &joints.rock_mass {
        Mass::Box(extent) => {
            let path = format!("{path}.rock_mass.box");
            let extent = Extent::resolve(grid, extent, &path, findings);
            let [from, to] = [extent.from, extent.to].map(Vector3::from);
            let made = Polyhedron::cuboid(to - from).map(|shape| PlacedPolyhedron {
                shape,
                position: 0.5 * (from + to),
                orientation: UnitQuaternion::identity(),
            });
            usable(made.map_err(|e| e.to_string()), &path, findings)?
        }
        Mass::Mesh(mesh) => surface(case, mesh, &format!("{path}.rock_mass.mesh"), findings)?,
    };
    let mut planes = whole.half_spaces();
    for (n, plane) in joints.excavation.iter().enumerate() {
        let path = format!("{path}.excavation[{n}]");
        let point = Extent::vector(grid, &plane.point, &format!("{path}.point"), findings);
        let normal = Extent::vector(grid, &plane.normal, &format!("{path}.normal"), findings);
        let (point, normal) = (Vector3::from(point), Vector3::from(normal));
        planes.push(HalfSpace {
            normal,
            offset: normal.dot(&point),
        });
    }
    let solid = if joints.excavation.is_empty() {
        whole
    } else {
        let left = Polyhedron::from_half_spaces(&planes).map_err(|e| match e {
            ShapeError::Empty { .. } | ShapeError::Flat { .. } => {
                "the cuts leave no block of the rock mass".to_owned()
            }
            other => format!("the half-spaces after those of the rock mass are wrong: {other}"),
        });
        usable(left, &format!("{path}.excavation"), findings)?
    };
    let whole = Piece::from_polyhedron(&solid);
    let mut sets = Vec::with_capacity(joints.sets.len());
    for (n, set) in joints.sets.iter().enumerate() {
        let path = format!("{path}.sets[{n}]");
        let origin = set.origin.as_ref().map_or(solid.position, |at| {
            Extent::vector(grid, at, &format!("{path}.origin"), findings).into()
        });
        let set = JointSet {
            normal: upward_normal(set.dip_degrees, set.dip_direction_degrees),
            origin,
            spacing: spacing(&set.spacing, &format!("{path}.spacing"), findings)?,
            persistence: set.persistence,
        };
        let (low, high) = whole.extent(&set.normal);
        let first = set.normal.dot(&set.origin);
        let planes = (high.max(first) - low.min(first)) / set.spacing.mean();
        if planes.is_nan() || planes > MAX_PLANES {
            findings.error(
                &format!("{path}.spacing"),
                format!(
                    "this makes {} joints between the origin of the set and the far end of the rock mass; at \
                     most {} are allowed",
                    number(planes),
                    number(MAX_PLANES)
                ),
                "use a larger spacing, in m, or an origin nearer to the rock",
            );
            return None;
        }
        sets.push(set);
    }
    let closest = sets
        .iter()
        .map(|set| set.spacing.mean())
        .fold(f64::INFINITY, f64::min);
    let default = if closest.is_finite() {
        0.05 * closest
    } else {
        0.0
    };
    Some(RockMass {
        solid,
        sets,
        seed: joints.seed,
        aperture: joints.aperture,
        smallest_thickness: joints.smallest_thickness.unwrap_or(default),
        smallest_volume: joints.smallest_volume,
    })
}

fn spacing(written: &WrittenSpacing, path: &str, findings: &mut Findings) -> Option<Spacing> {
    let spacing = match *written {
        WrittenSpacing::Constant(gap) => Spacing::Constant(gap),
        WrittenSpacing::Uniform { min, max } => Spacing::Uniform { min, max },
        WrittenSpacing::Exponential { mean } => Spacing::Exponential { mean },
        WrittenSpacing::Normal {
            mean,
            standard_deviation,
        } => Spacing::Normal {
            mean,
            standard_deviation,
        },
    };
    let wrong = match spacing {
        Spacing::Uniform { min, max } if min > max => Some((
            "uniform",
            "the smallest spacing is above the largest",
            "exchange min and max",
        )),
        Spacing::Normal {
            mean,
            standard_deviation,
        } if standard_deviation > 0.5 * mean => Some((
            "normal.standard_deviation",
            "the standard deviation is above half of the mean, so that too many spacings would be below zero",
            "use a smaller deviation, or another distribution",
        )),
        other if other.mean() > 0.0 => None,
        _ => Some(("", "the spacing must be above 0", "give it in m")),
    };
    let Some((part, reason, remedy)) = wrong else {
        return Some(spacing);
    };
    let path = format!("{path}.{part}");
    findings.error(path.trim_end_matches('.'), reason, remedy);
    None
}

/// Returns the solid, or reports a finding if it could not be constructed.
fn usable(
    made: Result<PlacedPolyhedron, String>,
    path: &str,
    findings: &mut Findings,
) -> Option<PlacedPolyhedron> {
    match made {
        Ok(solid) => Some(solid),
        Err(reason) => {
            findings.error(path, reason, "give a convex solid with a volume");
            None
        }
    }
}

/// Returns a convex solid from a file, or reports a finding.
fn surface(
    case: &Case,
    mesh: &Mesh,
    path: &str,
    findings: &mut Findings,
) -> Option<PlacedPolyhedron> {
    let origin = mesh.origin.as_ref().map_or([0.0; 3], |at| at.to_array());
    let path_of_file = format!("{path}.path");
    let triangles = match stl::load(&case.directory, mesh, origin, stl::triangles) {
        Ok(triangles) => triangles,
        Err(reason) => {
            findings.error(&path_of_file, reason, REMEDY);
            return None;
        }
    };
    let size = case.domain.size.to_array();
    if size.iter().all(|length| *length > 0.0) {
        let extent = stl::extent(triangles.iter().flatten().copied());
        let shape = path.trim_end_matches(".mesh");
        if !judge_unit(mesh, &extent, &size, shape, findings) {
            return None;
        }
    }
    let made =
        Polyhedron::from_triangles(&triangles).map_err(|e| format!("{}: {e}", mesh.path.display()));
    usable(made, &path_of_file, findings)
}

/// Returns the solid of a shape, rotated about its centroid, or reports findings.
pub(super) fn solid(
    case: &Case,
    shape: &Shape,
    orientation: Option<&Orientation>,
    path: &str,
    findings: &mut Findings,
) -> Option<PlacedPolyhedron> {
    let at = format!("{path}.shape");
    let made = match shape {
        Shape::Disc { .. } | Shape::Sphere { .. } => {
            let remedy = "use cuboid, vertices, half_spaces or mesh; spheres are grains or bodies";
            findings.error(&at, "a block is a polyhedron", remedy);
            return None;
        }
        Shape::Cuboid { edges } => {
            Polyhedron::cuboid((*edges).into()).map(|shape| PlacedPolyhedron {
                shape,
                position: Vector3::zeros(),
                orientation: UnitQuaternion::identity(),
            })
        }
        Shape::Vertices(vertices) => {
            let points: Vec<Vector3<f64>> = vertices.iter().map(|&v| v.into()).collect();
            Polyhedron::from_vertices(&points)
        }
        Shape::HalfSpaces(rows) => {
            let planes: Vec<HalfSpace> = rows.iter().map(list::half_space).collect();
            Polyhedron::from_half_spaces(&planes)
        }
        Shape::Mesh(mesh) => {
            let solid = surface(case, mesh, &format!("{at}.mesh"), findings)?;
            return Some(turned(solid, orientation, path, findings));
        }
    };
    let solid = usable(made.map_err(|e| e.to_string()), &at, findings)?;
    Some(turned(solid, orientation, path, findings))
}

fn turned(
    mut solid: PlacedPolyhedron,
    orientation: Option<&Orientation>,
    path: &str,
    findings: &mut Findings,
) -> PlacedPolyhedron {
    let Some(written) = orientation else {
        return solid;
    };
    match Unit::try_new(Vector3::from(written.axis), 0.0) {
        Some(axis) if axis.norm_squared().is_finite() => {
            let angle = written.angle_degrees.to_radians();
            solid.orientation = UnitQuaternion::from_axis_angle(&axis, angle) * solid.orientation;
        }
        _ => findings.error(
            &format!("{path}.orientation.axis"),
            "the axis has zero length",
            "write for example [0, 1, 0]",
        ),
    }
    solid
}

/// Returns the blocks of a file, or reports findings.
fn read(
    case: &Case,
    path: &PathBuf,
    names: &[String],
    index: usize,
    findings: &mut Findings,
) -> Option<Vec<RockBlock>> {
    let file = case.directory.join(path);
    let read = io::plain::text(&file, io::plain::LONGEST_INPUT)
        .map_err(|e| vec![e.to_string()])
        .and_then(|text| {
            list::read(&text).map_err(|e| e.iter().map(ToString::to_string).collect())
        });
    let at = "blocks.initial.file.path";
    let remedy = "correct the path (relative to the case) or the file";
    let found = match read {
        Ok(found) => found,
        Err(reasons) => {
            for reason in reasons {
                findings.error(at, reason, remedy);
            }
            return None;
        }
    };
    let mut blocks = Vec::with_capacity(found.len());
    for listed in found {
        let mut block = RockBlock::resting(listed.solid, index);
        if let Some(name) = &listed.material {
            block.material = material(names, name, at, findings)?;
            needs_density(case, name, findings);
        }
        block.fixed = listed.fixed;
        blocks.push(block);
    }
    Some(blocks)
}

/// Returns the blocks of a list, or reports findings.
fn listed(
    case: &Case,
    grid: &Grid,
    written: &[Written],
    names: &[String],
    index: usize,
    findings: &mut Findings,
) -> Option<Vec<RockBlock>> {
    let at = "blocks.initial.list";
    if written.is_empty() {
        findings.error(
            at,
            "the list contains no block",
            "add one, or omit `blocks`",
        );
    }
    let mut blocks = Vec::with_capacity(written.len());
    for (n, block) in written.iter().enumerate() {
        let path = format!("{at}[{n}]");
        let made = solid(
            case,
            &block.shape,
            block.orientation.as_ref(),
            &path,
            findings,
        );
        let rotation = block.angular_velocity.map(Rotation::Vector);
        let (velocity, angular_velocity) = motion(
            grid,
            block.velocity.as_ref(),
            rotation.as_ref(),
            &path,
            findings,
        );
        let own = block.material.as_ref().map(|name| {
            needs_density(case, name, findings);
            material(names, name, &format!("{path}.material"), findings).unwrap_or(0)
        });
        let Some(mut solid) = made else { continue };
        if let Some(position) = &block.position {
            let path = format!("{path}.position");
            solid.position = Extent::vector(grid, position, &path, findings).into();
        }
        blocks.push(RockBlock {
            velocity,
            angular_velocity,
            ..RockBlock::resting(solid, own.unwrap_or(index))
        });
    }
    (blocks.len() == written.len() && !blocks.is_empty()).then_some(blocks)
}

#[cfg(test)]
mod tests;
