//! Grains, walls and bodies of a scene, and that they start apart.

use super::block::Block;
use super::findings::{Findings, number};
use super::grid::{Grid, count};
use super::pairs::{self, Ball};
use super::{blocks, material, rain, sample, stl, unique};
use crate::case::Case;
use crate::case::geometry::{Face, Rotation, Vector};
use crate::case::grains::{
    Amount, Deposition as WrittenRain, Grading, GrainSource as Written, Growth, Radii, SizeClass,
};
use crate::case::solids::{Motion as WrittenMotion, Shape, WallShape, WallStage};
use crate::dem::Surface;
use crate::dem::polyhedron::{Piece, Solid};
use crate::error::Remedy;
use nalgebra::Vector3;
use serde::Serialize;
use serde_json::json;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A plane or surface that grains touch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wall {
    /// Name in tables.
    pub name: String,
    /// A point of the plane [m].
    pub point: [f64; 3],
    /// Unit normal of the plane towards the grains.
    pub normal: [f64; 3],
    /// The facets, if it is not a plane.
    #[serde(skip)]
    pub surface: Option<Arc<Surface>>,
    /// Velocity [m/s].
    pub velocity: [f64; 3],
    /// Index of its material.
    pub material: usize,
    /// Whether it is gone as the run begins.
    pub temporary: bool,
    /// The face of the domain it lies on, if it is a box wall.
    pub face: Option<Face>,
}

/// A named disc (2-D), or sphere or polyhedron (3-D).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Body {
    /// Its name.
    pub name: String,
    /// Radius [m]; of a polyhedron that of the sphere round its centroid that holds it.
    pub radius: f64,
    /// The polyhedron, if it is one, where it stands.
    #[serde(skip)]
    pub solid: Option<Solid>,
    /// Centre [m].
    pub position: [f64; 3],
    /// Velocity at the start [m/s], or at all times if driven.
    pub velocity: [f64; 3],
    /// Rotation rate at the start [rad/s], or at all times if driven.
    pub angular_velocity: [f64; 3],
    /// How it moves.
    pub mobility: Mobility,
    /// Index of its material.
    pub material: usize,
}

impl Body {
    /// Diameter of the largest sphere in a polyhedron [m].
    #[must_use]
    pub fn thickness(&self) -> Option<f64> {
        self.solid
            .as_ref()
            .map(|solid| Piece::of(solid).thickness())
    }
}

/// How a body moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mobility {
    /// Not at all.
    Fixed,
    /// With its velocity, whatever acts on it.
    Driven,
    /// By the forces on it.
    Free,
}

/// Grains and their preparation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Grains {
    /// Index of the material of grains that name none.
    pub material: usize,
    /// Where they come from.
    pub source: GrainSource,
    /// File to which the prepared sample goes; relative to the output folder.
    pub save: Option<PathBuf>,
    /// Boxes emptied after the preparation, with their names.
    pub cut: Vec<(String, Block)>,
    /// Whether contacts are bonded after preparation and cutting.
    pub bond_at_start: bool,
    /// Smallest and largest radius [m].
    pub radii: Option<(f64, f64)>,
    /// How many before cutting.
    pub expected: usize,
}

/// Where grains come from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum GrainSource {
    /// Growth of a loose cloud in a box.
    Growth {
        /// The box.
        block: Block,
        /// How many grains.
        number: usize,
        /// The rest as written.
        growth: Growth,
    },
    /// A cloud that falls from a box.
    Rain {
        /// The box.
        block: Block,
        /// Sizes.
        grading: rain::Grading,
        /// The rest as written.
        rain: WrittenRain,
    },
    /// A saved sample, read already.
    File {
        /// The file.
        path: PathBuf,
        /// Its grains.
        #[serde(skip)]
        grains: Vec<Grain>,
    },
    /// One by one.
    List(Vec<Grain>),
}

/// A grain of a list.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Grain {
    /// Centre [m].
    pub position: [f64; 3],
    /// Radius [m].
    pub radius: f64,
    /// Velocity [m/s].
    pub velocity: [f64; 3],
    /// Rotation rate [rad/s].
    pub angular_velocity: [f64; 3],
    /// Index of its material.
    pub material: usize,
}

pub(crate) fn walls(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Vec<Wall> {
    let mut walls = Vec::new();
    let mut known = Vec::new();
    for (n, wall) in case.walls.iter().enumerate() {
        let path = format!("walls[{n}]");
        unique(&mut known, &wall.name, &format!("{path}.name"), findings);
        let mut plane = ([0.0; 3], [0.0; 3]);
        let mut surface = None;
        match &wall.shape {
            WallShape::Plane(written) => {
                let path = format!("{path}.shape.plane");
                let point = Block::vector(grid, &written.point, &format!("{path}.point"), findings);
                let path = format!("{path}.normal");
                let normal = Block::vector(grid, &written.normal, &path, findings);
                let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
                if !(length > 0.0 && length.is_finite()) {
                    findings.error(
                        &path,
                        "a normal needs a direction",
                        "write for example [0, 1]",
                    );
                }
                plane = (point, normal.map(|n| n / length));
            }
            shape => surface = facets(case, grid, shape, &format!("{path}.shape"), findings),
        }
        let velocity = wall.velocity.as_ref().map_or([0.0; 3], |v| {
            Block::vector(grid, v, &format!("{path}.velocity"), findings)
        });
        let index = material(names, &wall.material, &format!("{path}.material"), findings);
        walls.push(Wall {
            name: wall.name.clone(),
            point: plane.0,
            normal: plane.1,
            surface: surface.map(Arc::new),
            velocity,
            material: index.unwrap_or(0),
            temporary: wall.during == WallStage::Preparation,
            face: None,
        });
    }
    let grains = case.grains.as_ref().map(|g| g.material.as_str());
    let of_grains = grains.or(case.blocks.as_ref().map(|b| b.material.as_str()));
    let mut taken = [false; 6];
    for (n, face) in case.box_walls.iter().enumerate() {
        let path = format!("box_walls[{n}]");
        if face.axis() >= grid.dimension {
            findings.error(
                &path,
                "there is no such face in a 2-D problem",
                "take it out",
            );
        } else if grid.periodic[face.axis()] {
            findings.error(
                &path,
                "the domain is periodic there: a wall contradicts this",
                "take it out",
            );
        } else if std::mem::replace(&mut taken[face.index()], true) {
            findings.error(&path, "this face is named twice", "take one out");
        }
        let index = match (&case.box_wall_material, of_grains) {
            (Some(name), _) => material(names, name, "box_wall_material", findings),
            (None, Some(name)) => names.iter().position(|known| known == name),
            (None, None) => {
                if n == 0 {
                    findings.error(
                        "box_wall_material",
                        "the walls need a material: there are no grains or blocks to take it from",
                        match names.first() {
                            Some(first) => Remedy::from(format!(
                                "add `box_wall_material`, for example `{first}`"
                            ))
                            .set("box_wall_material", first.as_str()),
                            None => "add `box_wall_material`, and the material".into(),
                        },
                    );
                }
                None
            }
        };
        let mut point = [0.0; 3];
        if face.is_max() {
            point[face.axis()] = grid.size[face.axis()];
        }
        walls.push(Wall {
            name: face.name().into(),
            point,
            normal: face.inward(),
            surface: None,
            velocity: [0.0; 3],
            material: index.unwrap_or(0),
            temporary: false,
            face: Some(*face),
        });
    }
    walls
}

/// The facets of a wall that is not a plane, or findings.
fn facets(
    case: &Case,
    grid: &Grid,
    shape: &WallShape,
    path: &str,
    findings: &mut Findings,
) -> Option<Surface> {
    if grid.dimension == 2 {
        findings.error(
            path,
            "in 2-D a wall is a plane",
            "write {\"plane\": {\"point\": .., \"normal\": ..}}",
        );
        return None;
    }
    if grid.periodic.contains(&true) {
        findings.error(
            path,
            "a wall of facets cannot stand in a domain with a periodic axis",
            "use planes, or take out `domain.periodic`",
        );
    }
    let (path, made, remedy) = match shape {
        WallShape::Plane(_) => return None,
        WallShape::Polygon(corners) => {
            let path = format!("{path}.polygon");
            let vertices: Vec<Vector3<f64>> = corners
                .iter()
                .enumerate()
                .map(|(n, at)| Block::vector(grid, at, &format!("{path}[{n}]"), findings).into())
                .collect();
            let all = (0..u32::try_from(vertices.len()).unwrap_or(u32::MAX)).collect();
            let made = Surface::new(vertices, &[all]).map_err(|e| e.to_string());
            (
                path,
                made,
                "give the corners of a plane convex polygon in order",
            )
        }
        WallShape::Box(extent) => {
            let path = format!("{path}.box");
            let from = Block::vector(grid, &extent.from, &format!("{path}.from"), findings);
            let to = Block::vector(grid, &extent.to, &format!("{path}.to"), findings);
            let made = if (0..3).all(|a| from[a] < to[a]) {
                Surface::of_box(from.into(), to.into()).map_err(|e| e.to_string())
            } else {
                Err("the box has no volume".into())
            };
            (
                path,
                made,
                "give the corners with the smallest and the largest coordinates",
            )
        }
        WallShape::Mesh(mesh) => {
            let path = format!("{path}.mesh");
            let origin = mesh.origin.as_ref().map_or([0.0; 3], |at| {
                Block::vector(grid, at, &format!("{path}.origin"), findings)
            });
            let file = case.directory.join(&mesh.path);
            let made = io::plain::bytes(&file, io::plain::LONGEST_INPUT)
                .map_err(|e| e.to_string())
                .and_then(|bytes| stl::read(&bytes, mesh.scale, &Vector3::from(origin)))
                .map_err(|e| format!("{}: {e}", mesh.path.display()));
            (
                format!("{path}.path"),
                made,
                "correct the path (relative to the case) or the file",
            )
        }
    };
    match made {
        Ok(surface) => Some(surface),
        Err(reason) => {
            findings.error(&path, reason, remedy);
            None
        }
    }
}

pub(crate) fn bodies(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Vec<Body> {
    let mut known = Vec::new();
    let mut bodies = Vec::new();
    for (n, body) in case.bodies.iter().enumerate() {
        let path = format!("bodies[{n}]");
        unique(&mut known, &body.name, &format!("{path}.name"), findings);
        let flat = matches!(body.shape, Shape::Disc { .. });
        if flat != (grid.dimension == 2) {
            let right = if flat { "sphere" } else { "disc" };
            findings.error(
                &format!("{path}.shape"),
                format!("this shape does not fit a {}-D problem", grid.dimension),
                format!("use {right}"),
            );
        }
        let position = Block::vector(grid, &body.position, &format!("{path}.position"), findings);
        let (solid, radius) = match &body.shape {
            Shape::Disc { radius } | Shape::Sphere { radius } => {
                if body.orientation.is_some() {
                    findings.error(
                        &format!("{path}.orientation"),
                        "a disc or sphere looks the same from all sides",
                        Remedy::take_out("take it out", &format!("{path}.orientation")),
                    );
                }
                (None, *radius)
            }
            shape => {
                let turn = body.orientation.as_ref();
                let Some(mut solid) = blocks::solid(case, shape, turn, &path, findings) else {
                    continue;
                };
                solid.position = position.into();
                let radius = solid.shape.radius();
                (Some(solid), radius)
            }
        };
        if !grid.contains(position) {
            findings.error(
                &format!("{path}.position"),
                "the centre lies outside the domain",
                "move it inside",
            );
        }
        for a in 0..grid.dimension {
            let along = Vector3::from_fn(|axis, _| if axis == a { 1.0 } else { 0.0 });
            let width = solid.as_ref().map_or(2.0 * radius, |solid| {
                let (low, high) = Piece::of(solid).extent(&along);
                high - low
            });
            // As wide as the domain, but for the rounding of its corners, closes it.
            if width > grid.size[a] * (1.0 + 1e-9) {
                findings.error(
                    &format!("{path}.shape"),
                    format!(
                        "the body is wider than the domain along {}",
                        ["x", "y", "z"][a]
                    ),
                    "make it smaller, or the domain larger",
                );
                break;
            }
        }
        let at = format!("{path}.motion");
        let (mobility, velocity, angular_velocity) = match &body.motion {
            WrittenMotion::Fixed {} => (Mobility::Fixed, [0.0; 3], [0.0; 3]),
            WrittenMotion::Driven {
                velocity,
                angular_velocity,
            } => {
                let (v, w) = motion(
                    grid,
                    velocity.as_ref(),
                    angular_velocity.as_ref(),
                    &format!("{at}.driven"),
                    findings,
                );
                (Mobility::Driven, v, w)
            }
            WrittenMotion::Free {
                velocity,
                angular_velocity,
            } => {
                let (v, w) = motion(
                    grid,
                    velocity.as_ref(),
                    angular_velocity.as_ref(),
                    &format!("{at}.free"),
                    findings,
                );
                (Mobility::Free, v, w)
            }
        };
        let index = material(names, &body.material, &format!("{path}.material"), findings);
        if mobility == Mobility::Free && index.is_some() {
            needs_density(case, &body.material, findings);
        }
        bodies.push(Body {
            name: body.name.clone(),
            radius,
            solid,
            position,
            velocity,
            angular_velocity,
            mobility,
            material: index.unwrap_or(0),
        });
    }
    bodies
}

/// Whatever moves freely has a mass.
pub(super) fn needs_density(case: &Case, name: &str, findings: &mut Findings) {
    if case
        .materials
        .get(name)
        .is_some_and(|m| m.density.is_none())
    {
        findings.error(
            &format!("materials.{name}.density"),
            "what moves freely needs the density of its material",
            Remedy::from("add it in kg/m3, for example 2650")
                .set(format!("materials.{name}.density"), 2650),
        );
    }
}

pub(super) fn motion(
    grid: &Grid,
    velocity: Option<&Vector>,
    rotation: Option<&Rotation>,
    path: &str,
    findings: &mut Findings,
) -> ([f64; 3], [f64; 3]) {
    let v = velocity.map_or([0.0; 3], |v| {
        Block::vector(grid, v, &format!("{path}.velocity"), findings)
    });
    if let Some(rotation) = rotation
        && matches!(rotation, Rotation::AboutZ(_)) != (grid.dimension == 2)
    {
        findings.error(
            &format!("{path}.angular_velocity"),
            "a rotation is one number in 2-D and three in 3-D",
            "write it so",
        );
    }
    (v, rotation.map_or([0.0; 3], Rotation::to_array))
}

pub(crate) fn grains(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Option<Grains> {
    let grains = case.grains.as_ref()?;
    let index = material(names, &grains.material, "grains.material", findings).unwrap_or(0);
    needs_density(case, &grains.material, findings);
    let mut known = Vec::new();
    let cut = grains
        .cut
        .iter()
        .enumerate()
        .map(|(n, cut)| {
            let path = format!("grains.cut[{n}]");
            unique(&mut known, &cut.name, &format!("{path}.name"), findings);
            (
                cut.name.clone(),
                Block::resolve(grid, &cut.region, &format!("{path}.box"), findings),
            )
        })
        .collect();
    let (source, radii, expected) = match &grains.initial {
        Written::Growth(growth) => grow(growth, grid, findings)?,
        Written::Deposition(written) => falls(case, written, grid, findings)?,
        Written::File { path } => sample(
            &case.directory.join(path),
            path,
            grid,
            names,
            index,
            findings,
        ),
        Written::List(list) => {
            if list.is_empty() {
                findings.error(
                    "grains.initial.list",
                    "the list holds no grain",
                    "add one, or leave `grains` out",
                );
            }
            let mut resolved = Vec::with_capacity(list.len());
            for (n, grain) in list.iter().enumerate() {
                let plain = grain.position.0.len() == grid.dimension
                    && grid.contains(grain.position.to_array())
                    && grain.velocity.is_none()
                    && grain.angular_velocity.is_none()
                    && grain.material.is_none();
                if plain {
                    // Paths of grains are written only where there may be something to say.
                    resolved.push(Grain {
                        position: grain.position.to_array(),
                        radius: grain.radius,
                        velocity: [0.0; 3],
                        angular_velocity: [0.0; 3],
                        material: index,
                    });
                    continue;
                }
                let path = format!("grains.initial.list[{n}]");
                let (velocity, angular_velocity) = motion(
                    grid,
                    grain.velocity.as_ref(),
                    grain.angular_velocity.as_ref(),
                    &path,
                    findings,
                );
                let position =
                    Block::vector(grid, &grain.position, &format!("{path}.position"), findings);
                if !grid.contains(position) {
                    findings.error(
                        &format!("{path}.position"),
                        "the centre lies outside the domain",
                        "move it inside",
                    );
                }
                let own = grain.material.as_ref().map(|name| {
                    needs_density(case, name, findings);
                    material(names, name, &format!("{path}.material"), findings).unwrap_or(0)
                });
                resolved.push(Grain {
                    position,
                    radius: grain.radius,
                    velocity,
                    angular_velocity,
                    material: own.unwrap_or(index),
                });
            }
            let (radii, expected) = (bounds(&resolved), resolved.len());
            (GrainSource::List(resolved), radii, expected)
        }
    };
    Some(Grains {
        material: index,
        source,
        save: grains.save.clone(),
        cut,
        bond_at_start: grains.bond_at_start,
        radii,
        expected,
    })
}

type Source = (GrainSource, Option<(f64, f64)>, usize);

/// Smallest and largest radius.
fn bounds(grains: &[Grain]) -> Option<(f64, f64)> {
    let bounds = grains.iter().fold((f64::INFINITY, 0.0_f64), |(lo, hi), g| {
        (lo.min(g.radius), hi.max(g.radius))
    });
    Some(bounds).filter(|b| b.1 > 0.0)
}

/// A saved sample, or findings.
fn sample(
    file: &Path,
    written: &Path,
    grid: &Grid,
    names: &[String],
    material: usize,
    findings: &mut Findings,
) -> Source {
    let path = "grains.initial.file.path";
    let read = io::plain::text(file, io::plain::LONGEST_INPUT)
        .map_err(|e| e.to_string())
        .and_then(|text| {
            sample::read(&text, grid.dimension, names, material)
                .map_err(|e| format!("{}: {e}", written.display()))
        });
    let grains = read.unwrap_or_else(|reason| {
        findings.error(
            path,
            reason,
            "correct the path (relative to the case) or the file",
        );
        Vec::new()
    });
    if let Some(n) = grains.iter().position(|g| !grid.contains(g.position)) {
        findings.error(
            path,
            format!("grain {} of the sample lies outside the domain", n + 1),
            "use the domain the sample was made for",
        );
    }
    let (radii, expected) = (bounds(&grains), grains.len());
    (
        GrainSource::File {
            path: file.to_path_buf(),
            grains,
        },
        radii,
        expected,
    )
}

/// A radius distribution that can be used, or findings.
pub(crate) fn check_radii(radii: &Radii, path: &str, findings: &mut Findings) -> bool {
    let good = match radii {
        Radii::Uniform { min, max } => {
            if min > max {
                findings.error(
                    &format!("{path}.uniform"),
                    "the smallest radius is above the largest",
                    Remedy::from("exchange min and max")
                        .set(format!("{path}.uniform.min"), *max)
                        .set(format!("{path}.uniform.max"), *min),
                );
            }
            min <= max && *min > 0.0
        }
        Radii::List(list) => {
            let good = !list.is_empty() && list.iter().all(|r| *r > 0.0);
            if !good {
                findings.error(
                    &format!("{path}.list"),
                    "radii must be above 0, and there must be one",
                    "correct the list",
                );
            }
            good
        }
    };
    good && radii.bounds().1.is_finite()
}

/// Rain that can fall, or findings.
fn falls(
    case: &Case,
    written: &WrittenRain,
    grid: &Grid,
    findings: &mut Findings,
) -> Option<Source> {
    let path = "grains.initial.deposition";
    let block = Block::resolve(grid, &written.region, &format!("{path}.box"), findings);
    let classes = |list: &[SizeClass]| {
        let class = |c: &SizeClass| rain::Class {
            min: c.min,
            max: c.max,
            part: c.fraction,
        };
        list.iter().map(class).collect()
    };
    let (grading, name) = match &written.grading {
        Grading::ByCount(list) => (rain::Grading::ByCount(classes(list)), "by_count"),
        Grading::ByMass(list) => (rain::Grading::ByMass(classes(list)), "by_mass"),
    };
    let number_of = written.number as usize;
    let measure = match grading.measure(number_of, grid.dimension) {
        Ok(measure) => measure,
        Err(reason) => {
            findings.error(
                &format!("{path}.grading.{name}"),
                reason,
                "correct the classes, or let more grains fall",
            );
            return None;
        }
    };
    let widest = 2.0 * grading.bounds().1;
    let narrowest = (0..grid.dimension)
        .map(|a| block.to[a] - block.from[a])
        .fold(f64::INFINITY, f64::min);
    if widest > narrowest {
        findings.error(
            &format!("{path}.grading.{name}"),
            format!(
                "a grain of {} m is wider than the box of {} m",
                number(widest),
                number(narrowest)
            ),
            "use smaller radii; they are in m",
        );
        return None;
    }
    let most = rain::densest_cloud(grid.dimension);
    let fraction = measure / block.measure();
    if fraction > most {
        findings.error(
            &format!("{path}.number"),
            format!(
                "these grains would fill {} of the cloud's box; a loose cloud fills at most {most}",
                number(fraction)
            ),
            {
                // Part of the classes: a little less than in proportion.
                let fewer = (0.99 * count(number_of) * most / fraction).floor();
                Remedy::from(format!(
                    "use a box {} times as high, or smaller grains, or {fewer} of these at most",
                    number(fraction / most)
                ))
                .set(format!("{path}.number"), super::grid::whole(fewer))
            },
        );
    }
    let along = (0..grid.dimension)
        .filter(|&a| {
            case.gravity
                .as_ref()
                .is_some_and(|g| g.to_array()[a].abs() > 0.0)
        })
        .count();
    if along != 1 {
        let down = if grid.dimension == 2 {
            json!([0, -9.81])
        } else {
            json!([0, 0, -9.81])
        };
        findings.error(
            "gravity",
            "rain needs gravity along one axis",
            Remedy::from(format!("write for example {down}")).set("gravity", down),
        );
    }
    let bounds = grading.bounds();
    Some((
        GrainSource::Rain {
            block,
            grading,
            rain: written.clone(),
        },
        Some(bounds),
        number_of,
    ))
}

fn grow(growth: &Growth, grid: &Grid, findings: &mut Findings) -> Option<Source> {
    let path = "grains.initial.growth";
    let block = growth.region.as_ref().map_or(
        Block {
            from: [0.0; 3],
            to: grid.size,
            dimension: grid.dimension,
        },
        |extent| Block::resolve(grid, extent, &format!("{path}.box"), findings),
    );
    if !check_radii(&growth.radii, &format!("{path}.radii"), findings) {
        return None;
    }
    let flat = grid.dimension == 2;
    let pi = std::f64::consts::PI;
    let mean = if flat {
        pi * growth.radii.mean_power(2)
    } else {
        4.0 / 3.0 * pi * growth.radii.mean_power(3)
    };
    let largest = 2.0 * growth.radii.bounds().1;
    let narrowest = (0..grid.dimension)
        .map(|a| block.to[a] - block.from[a])
        .fold(f64::INFINITY, f64::min);
    if largest > narrowest {
        findings.error(
            &format!("{path}.radii"),
            format!(
                "a grain of {} m is wider than the box of {} m",
                number(largest),
                number(narrowest)
            ),
            "use smaller radii; they are in m",
        );
        return None;
    }
    let (least, most) = if flat { (0.7, 0.9) } else { (0.5, 0.72) };
    let (amount_path, number_of, fraction) = match growth.amount {
        Amount::Number(n) => (
            format!("{path}.amount.number"),
            f64::from(n),
            f64::from(n) * mean / block.measure(),
        ),
        Amount::SolidFraction(fraction) => (
            format!("{path}.amount.solid_fraction"),
            (fraction * block.measure() / mean).round().max(1.0),
            fraction,
        ),
    };
    if fraction > most {
        findings.error(
            &amount_path,
            format!(
                "the grains would fill {} of the box at full size; a packing holds at most {most}",
                number(fraction)
            ),
            match growth.amount {
                Amount::SolidFraction(_) => Remedy::from(format!(
                    "use fewer or smaller grains, a fraction of {most} at most"
                ))
                .set(&*amount_path, most),
                Amount::Number(_) => {
                    let fewer = (number_of * most / fraction).floor();
                    Remedy::from(format!(
                        "use fewer or smaller grains, {fewer} of these at most"
                    ))
                    .set(&*amount_path, super::grid::whole(fewer))
                }
            },
        );
    } else if fraction < least {
        findings.warn(
            &amount_path,
            format!("the grains fill {} of the box at full size: a compact sample needs about {least} or more", number(fraction)),
            "use more or larger grains if the sample should hold together",
        );
    }
    if number_of > 1e8 {
        findings.error(
            &amount_path,
            format!("this makes {} grains; at most 1e8", number(number_of)),
            "use larger grains or a smaller box",
        );
        return None;
    }
    let number_of = super::grid::whole(number_of);
    Some((
        GrainSource::Growth {
            block,
            number: number_of,
            growth: growth.clone(),
        },
        Some(growth.radii.bounds()),
        number_of,
    ))
}

/// Grains of a list, bodies and walls start apart: an overlap of more than a twentieth of the smaller radius is a slip
/// in the coordinates, which the springs would turn into an explosion.
pub(crate) fn overlaps(
    grid: &Grid,
    grains: Option<&Grains>,
    bodies: &[Body],
    walls: &[Wall],
    findings: &mut Findings,
) {
    const ALLOWED: f64 = 0.05;
    /// Pairs that are named, and pairs that are counted.
    const NAMED: usize = 20;
    const COUNTED: usize = 100_000;
    let listed = match grains.map(|grains| &grains.source) {
        Some(GrainSource::List(list)) => list.as_slice(),
        _ => &[],
    };
    let round = bodies.iter().enumerate().filter(|(_, b)| b.solid.is_none());
    let bodies: Vec<(usize, &Body)> = round.collect();
    let name = |solid: usize| match solid.checked_sub(listed.len()) {
        None => format!("grains.initial.list[{solid}]"),
        Some(body) => format!("bodies[{}]", bodies[body].0),
    };
    let of_grains = listed.iter().map(|g| (g.position, g.radius));
    let of_bodies = bodies.iter().map(|(_, b)| (b.position, b.radius));
    let solids: Vec<Ball> = of_grains
        .chain(of_bodies)
        .map(|(mut at, reach)| {
            at[grid.dimension..].fill(0.0);
            Ball { at, reach }
        })
        .collect();
    for (n, solid) in solids.iter().enumerate() {
        for wall in walls {
            let distance = wall.surface.as_ref().map_or_else(
                || {
                    (0..3)
                        .map(|a| (solid.at[a] - wall.point[a]) * wall.normal[a])
                        .sum::<f64>()
                },
                |surface| surface.clearance(&Vector3::from(solid.at)),
            );
            let depth = solid.reach - distance;
            if depth > ALLOWED * solid.reach {
                findings.error(
                    &format!("{}.position", name(n)),
                    format!(
                        "this overlaps the wall `{}` by {} m at the start",
                        wall.name,
                        number(depth)
                    ),
                    "move it away from the wall",
                );
            }
        }
    }
    let mut found = Vec::new();
    let all = pairs::near(&solids, [None; 3], |one, other| {
        let squared: f64 = (0..grid.dimension)
            .map(|a| (solids[one].at[a] - solids[other].at[a]).powi(2))
            .sum();
        let [a, b] = [solids[one].reach, solids[other].reach];
        let depth = a + b - squared.sqrt();
        if depth > ALLOWED * a.min(b) {
            found.push((other, one, depth));
        }
        if found.len() < COUNTED {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    found.sort_unstable_by_key(|(other, one, _)| (*other, *one));
    for (other, one, depth) in found.iter().take(NAMED) {
        findings.error(
            &format!("{}.position", name(*other)),
            format!(
                "this overlaps {} by {} m at the start",
                name(*one),
                number(*depth)
            ),
            "move them apart",
        );
    }
    if found.len() > NAMED {
        let least = if all.is_break() { "at least " } else { "" };
        findings.error(
            "grains.initial.list",
            format!(
                "{least}{} more pairs overlap",
                number(count(found.len() - NAMED))
            ),
            "move them apart",
        );
    }
}
