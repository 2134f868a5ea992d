//! The case file as written: SI units, no derived values, unknown fields are refused.
//!
//! The comment of a field states its unit. The JSON schema (`solver schema`) and the reference (`solver reference`) are
//! generated from these comments. A case is read in four steps, and each step reports all errors that it finds:
//!
//! 1. [`text`]: JSON text to a tree; duplicate keys are refused.
//! 2. [`set`]: `--set path=value` changes the tree.
//! 3. [`annotation`]: `{"value": 0.2, "source": "assumed", "note": ".."}` is replaced by its value; the source of
//!    each value is stored.
//! 4. [`check`]: the tree is compared with the schema: unknown and missing fields, wrong types, values out of range.
//!
//! [`plan::scene`] and [`plan`] then check whether the values are consistent.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]
#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "comments are the texts of the schema, with units in brackets: [m]"
)]

pub mod accuracy;
pub mod annotation;
pub mod backward_erosion;
pub mod blocks;
pub mod boundary;
pub mod check;
pub mod collapse;
pub mod contact;
pub mod coupling;
pub mod darcy;
pub mod domain;
pub mod element_test;
pub mod examples;
pub mod fluid;
pub mod free_surface;
pub mod grains;
pub mod joints;
pub mod observe;
pub mod reference;
pub mod restart;
pub mod set;
pub mod sieve;
pub mod solids;
pub mod structures;
pub mod text;
pub mod time;

pub use base::geometry;

use annotation::Source;
use base::error::Problem;
use geometry::{Face, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A problem to solve, in SI units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// One line that names the run, without control characters.
    #[serde(default)]
    pub title: String,
    /// Purpose of the run.
    #[serde(default)]
    pub description: String,
    /// Target accuracy of the fluid forces. The program chooses the missing ones of cell size, time step, collision
    /// operator, eddy viscosity and storage precision to meet it. A case that leaves out the cell size or the time step
    /// and names no accuracy gets `normal`.
    #[serde(default)]
    pub accuracy: Option<accuracy::Accuracy>,
    /// The box and its cells.
    pub domain: domain::Domain,
    /// Acceleration of gravity [m/s2]. Default: none.
    #[serde(default)]
    pub gravity: Option<Vector>,
    /// Materials by name.
    #[serde(default)]
    pub materials: BTreeMap<String, domain::Material>,
    /// The fluid. Without it the grains are dry.
    #[serde(default)]
    pub fluid: Option<fluid::Fluid>,
    /// The grains.
    #[serde(default)]
    pub grains: Option<grains::Grains>,
    /// Convex polyhedral blocks (3-D).
    #[serde(default)]
    pub blocks: Option<blocks::Blocks>,
    /// Contact law of grains, bodies and blocks. Default for spheres: `hertz_mindlin` if all materials have elastic
    /// moduli. Default for discs, and for spheres without moduli: `linear`, with a stiffness that limits overlaps to 1
    /// % of a diameter.
    #[serde(default)]
    pub contact: Option<contact::Contact>,
    /// Stationary solids that act on water and grains: sheet piles, weirs, steps, piers.
    #[serde(default)]
    pub structures: Vec<structures::Structure>,
    /// Walls for grains and blocks, anywhere in the domain. They do not act on water: see `structures`.
    #[serde(default)]
    pub walls: Vec<solids::Wall>,
    /// Faces of the domain that act as walls for grains and blocks.
    #[serde(default)]
    pub box_walls: Vec<Face>,
    /// Material of the `box_walls`. Default: the material of the grains, otherwise of the blocks, otherwise of the
    /// first free body.
    #[serde(default)]
    pub box_wall_material: Option<String>,
    /// Named solids in the fluid.
    #[serde(default)]
    pub bodies: Vec<solids::Body>,
    /// Method that couples fluid and solids. Default: interpolated bounce-back at discs and spheres, partially
    /// saturated cells at polyhedra, and at spheres that grow or fall into a packing.
    #[serde(default)]
    pub coupling: Option<coupling::Coupling>,
    /// Duration and time steps.
    pub time: time::Time,
    /// Boxes in which grains are removed, generated or recorded.
    #[serde(default)]
    pub regions: Vec<observe::Region>,
    /// Quantities sampled over time and written as CSV.
    #[serde(default)]
    pub probes: Vec<observe::Probe>,
    /// Fields written for ParaView.
    #[serde(default)]
    pub output: observe::Output,
    /// Checkpoints to restart from.
    #[serde(default)]
    pub checkpoint: time::Checkpoint,
    /// Limits that end the run when they are exceeded.
    #[serde(default)]
    pub guards: time::Guards,
    /// Analyses computed during the run.
    #[serde(default)]
    pub analysis: observe::Analysis,
    /// Folder to which paths in the case are relative.
    #[serde(skip)]
    pub directory: PathBuf,
}

/// Case with the sources of its values.
#[derive(Clone, Debug)]
pub struct Document {
    /// Values of the case.
    pub case: Case,
    /// Problems of single fields (out of range, unknown name) found so far; the case is complete nevertheless.
    pub problems: Vec<Problem>,
    /// Sources of values, by JSON path.
    pub sources: BTreeMap<String, Source>,
    /// Case as compact JSON: keys sorted, annotations and null removed, `--set` applied, paths of input files
    /// absolute, so that it has the same meaning in any folder.
    pub canonical: String,
}

impl Document {
    /// Reads the text of a case.
    ///
    /// `set` contains the arguments of `--set`; relative paths start in `directory`.
    ///
    /// # Errors
    /// If the text is not a valid case; all problems are returned.
    pub fn read(text: &str, set: &[String], directory: &Path) -> Result<Self, Vec<Problem>> {
        let (tree, mut problems) = text::parse(text);
        let Some(mut tree) = tree else {
            return Err(problems);
        };
        let mut sources = annotation::strip(&mut tree);
        for assignment in set {
            match set::apply(&mut tree, assignment) {
                Ok(path) => {
                    sources.retain(|known, _| !set::covers(&path, known));
                    sources.insert(path, Source::without_note("command line"));
                }
                Err(problem) => problems.push(*problem),
            }
        }
        sources.extend(annotation::strip(&mut tree));
        let cut_short = text::cut_short(&problems);
        let checked = check::against_schema(&mut tree);
        problems.extend(checked.problems);
        // After the check, so that 40.0 and 40 in a field of whole numbers, and null and no field, are the same case.
        let mut written = Vec::new();
        anchor(&mut tree, directory, &mut written);
        let canonical = tree.to_string();
        if !written.is_empty() {
            put_back(&mut tree, &mut written.into_iter());
        }
        if cut_short {
            // Fields that seem to be missing may be among the keys that were not read.
            problems.retain(|problem| problem.value != "missing");
        }
        if cut_short || checked.wrong_shape {
            return Err(problems);
        }
        // The walk over the schema has reported all problems with their paths; a remaining one is an error of the
        // schema.
        match Case::deserialize(&tree) {
            Ok(mut case) => {
                case.directory = directory.to_path_buf();
                Ok(Self {
                    case,
                    problems,
                    sources,
                    canonical,
                })
            }
            Err(error) => {
                if problems.is_empty() {
                    problems.push(Problem::error(
                        "the case",
                        "not readable",
                        error.to_string(),
                        "compare with `solver schema`",
                    ));
                }
                Err(problems)
            }
        }
    }
}

/// Makes the path of every input file absolute: `{"file": {"path": ..}}`, and the same for `mesh`, `raster`, `polygon`,
/// `surface` and `dxf`. The original paths are appended to `written`.
fn anchor(tree: &mut Value, directory: &Path, written: &mut Vec<String>) {
    each_path(tree, &mut |path| {
        written.push(path.clone());
        if let Ok(whole) = std::path::absolute(directory.join(path.as_str()))
            && let Some(whole) = whole.to_str()
        {
            *path = whole.to_owned();
        }
    });
}

/// Restores the paths changed by [`anchor`].
fn put_back(tree: &mut Value, written: &mut impl Iterator<Item = String>) {
    each_path(tree, &mut |path| {
        if let Some(old) = written.next() {
            *path = old;
        }
    });
}

/// Calls a function with the paths of all input files, in an order that does not depend on the paths.
fn each_path(tree: &mut Value, with: &mut impl FnMut(&mut String)) {
    match tree {
        Value::Object(map) => {
            for (key, child) in map {
                if matches!(
                    key.as_str(),
                    "file" | "mesh" | "raster" | "polygon" | "surface" | "dxf"
                ) && let Some(Value::String(path)) = child.get_mut("path")
                {
                    with(path);
                }
                each_path(child, with);
            }
        }
        Value::Array(list) => list.iter_mut().for_each(|child| each_path(child, with)),
        _ => {}
    }
}

/// Returns the JSON schema of a case, for editors: every value may also be annotated with its source.
#[must_use]
pub fn schema() -> Value {
    restart::mark(annotation::allow(check::bare_schema()))
}

/// Returns the default of factors.
fn one() -> f64 {
    1.0
}

/// Returns `true`, the default of what a case may turn off.
fn yes() -> bool {
    true
}
