//! Lists of blocks in files: four formats are read, one is written.
//!
//! The format of this program is one JSON object. Each block has an `id`, which determines the order of the blocks, and
//! either `half_spaces`, each `[a, b, c, d]` for `a x + b y + c z <= d`, or `vertices`. A `material` and whether it is
//! `fixed` are optional. Lengths are in m:
//!
//! ```json
//! {"blocks": [{"id": 0, "half_spaces": [[1, 0, 0, 2.5]], "material": "granite", "fixed": true}]}
//! ```
//!
//! The format of `SparkRocks` (github.com/cb-geo/spark-rocks, `Json.scala`) is one object for each block, one per
//! line or in an array: `centerX`, `centerY`, `centerZ` and `faces` of `a`, `b`, `c`, `d`, where `d` is the face's
//! distance from the centre. Friction (`phi`) and cohesion of a face are not used, because the contact law defines
//! friction.
//!
//! Polyhedra of a legacy VTK file are the third format ([`vtk`]), polyhedra of LMGC90 the fourth ([`lmgc90`]).

mod error;
mod faces;
mod lmgc90;
mod vtk;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use dem::polyhedron::{HalfSpace, PlacedPolyhedron, Polyhedron, ShapeError};

pub use error::{ListError, Origin};

/// Maximum number of errors listed for one file.
const MAX_LISTED_ERRORS: usize = 20;

/// Block of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Listed {
    /// Shape and position.
    pub solid: PlacedPolyhedron,
    /// Name of its material; none for the default material.
    pub material: Option<String>,
    /// `true` if the block never moves.
    pub fixed: bool,
}

/// Block list in the format of this program.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    blocks: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    id: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    half_spaces: Option<Vec<[f64; 4]>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    vertices: Option<Vec<[f64; 3]>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<String>,
    #[serde(default)]
    fixed: bool,
}

/// Block in the format of `SparkRocks`; other fields are ignored.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Slice {
    center_x: f64,
    center_y: f64,
    center_z: f64,
    faces: Vec<Face>,
}

#[derive(Deserialize)]
struct Face {
    a: f64,
    b: f64,
    c: f64,
    d: f64,
}

/// Returns the blocks of a file in one of the formats.
///
/// # Errors
/// If blocks are invalid; each text names its block.
pub fn read(text: &str) -> Result<Vec<Listed>, Vec<ListError>> {
    if vtk::is_vtk(text) {
        return collected(vtk::read(text).map_err(|e| vec![e])?);
    }
    if lmgc90::is_bodies(text) {
        return collected(lmgc90::read(text));
    }
    let mut values = Vec::new();
    for value in serde_json::Deserializer::from_str(text).into_iter::<Value>() {
        values.push(value.map_err(|e| vec![ListError::NotJson(e)])?);
    }
    let own = matches!(&values[..], [Value::Object(map)] if !map.contains_key("faces"));
    let made = if own {
        own_form(values)?
    } else {
        sliced(values)
    };
    collected(made)
}

/// Reads the format of this program.
fn own_form(values: Vec<Value>) -> Result<Vec<Result<Listed, ListError>>, Vec<ListError>> {
    let whole = values.into_iter().next().unwrap_or_default();
    let mut file: File =
        serde_path_to_error::deserialize(whole).map_err(|e| vec![ListError::Field(e)])?;
    file.blocks.sort_by_key(|entry| entry.id);
    let mut last = None;
    let made = file.blocks.into_iter().map(|entry| {
        let id = entry.id;
        let listed = if last.replace(id) == Some(id) {
            Err(ListError::KnownId)
        } else {
            entry.listed()
        };
        listed.map_err(|e| e.with_origin(Origin::Block(id)))
    });
    Ok(made.collect())
}

impl Entry {
    fn listed(self) -> Result<Listed, ListError> {
        let solid = match (&self.half_spaces, &self.vertices) {
            (Some(planes), None) => {
                let planes: Vec<HalfSpace> = planes.iter().map(half_space).collect();
                Polyhedron::from_half_spaces(&planes)
            }
            (None, Some(vertices)) => {
                let points: Vec<Vector3<f64>> = vertices.iter().map(|&v| v.into()).collect();
                Polyhedron::from_vertices(&points)
            }
            _ => return Err(ListError::NoGeometry),
        };
        Ok(Listed {
            solid: solid?,
            material: self.material,
            fixed: self.fixed,
        })
    }
}

/// Reads the format of `SparkRocks`.
fn sliced(values: Vec<Value>) -> Vec<Result<Listed, ListError>> {
    let blocks = values.into_iter().flat_map(|value| match value {
        Value::Array(list) => list,
        other => vec![other],
    });
    let made = (0..).zip(blocks).map(|(n, value): (u64, Value)| {
        let slice = serde_path_to_error::deserialize(value).map_err(ListError::Field);
        let listed = slice.and_then(|slice: Slice| Ok(slice.listed()?));
        listed.map_err(|e| e.with_origin(Origin::Block(n)))
    });
    made.collect()
}

impl Slice {
    fn listed(&self) -> Result<Listed, ShapeError> {
        let centre = Vector3::new(self.center_x, self.center_y, self.center_z);
        let plane = |face: &Face| {
            // The centre lies inside: a negative distance means a normal that points inwards.
            let sign = 1_f64.copysign(face.d);
            let normal = Vector3::new(face.a, face.b, face.c) * sign;
            HalfSpace {
                normal,
                offset: face.d.abs() + normal.dot(&centre),
            }
        };
        let planes: Vec<HalfSpace> = self.faces.iter().map(plane).collect();
        Ok(Listed {
            solid: Polyhedron::from_half_spaces(&planes)?,
            material: None,
            fixed: false,
        })
    }
}

/// Returns all blocks, or the first errors and the number of the others.
fn collected(made: Vec<Result<Listed, ListError>>) -> Result<Vec<Listed>, Vec<ListError>> {
    let mut blocks = Vec::with_capacity(made.len());
    let mut problems = Vec::new();
    for one in made {
        match one {
            Ok(block) => blocks.push(block),
            Err(problem) => problems.push(problem),
        }
    }
    if problems.len() > MAX_LISTED_ERRORS {
        let more = problems.len() - MAX_LISTED_ERRORS;
        problems.truncate(MAX_LISTED_ERRORS);
        problems.push(ListError::More(more));
    }
    match (blocks.is_empty(), problems.is_empty()) {
        (_, false) => Err(problems),
        (true, true) => Err(vec![ListError::NoBlock]),
        (false, true) => Ok(blocks),
    }
}

/// Returns the half-space of a row `[a, b, c, d]`.
pub(crate) fn half_space(row: &[f64; 4]) -> HalfSpace {
    HalfSpace {
        normal: Vector3::new(row[0], row[1], row[2]),
        offset: row[3],
    }
}

/// Block as [`write()`] saves it.
#[derive(Clone, Copy, Debug)]
pub struct SavedBlock<'a> {
    /// Shape in its initial position.
    pub solid: &'a PlacedPolyhedron,
    /// Name of the material.
    pub material: &'a str,
    /// `true` if it never moves.
    pub fixed: bool,
}

/// Returns the text of a file in the format of this program, with blocks numbered in order.
#[must_use]
pub fn write<'a>(blocks: impl Iterator<Item = SavedBlock<'a>>) -> String {
    let row = |plane: &HalfSpace| {
        let n = plane.normal;
        [n.x, n.y, n.z, plane.offset]
    };
    let mut lines = Vec::new();
    for (id, block) in (0..).zip(blocks) {
        let entry = Entry {
            id,
            half_spaces: Some(block.solid.half_spaces().iter().map(row).collect()),
            vertices: None,
            material: Some(block.material.to_owned()),
            fixed: block.fixed,
        };
        lines.extend(serde_json::to_string(&entry));
    }
    format!("{{\"blocks\": [\n{}\n]}}\n", lines.join(",\n"))
}

#[cfg(test)]
mod tests;
