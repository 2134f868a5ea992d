//! The structures of a scene, and the walls that grains meet at them.

use super::findings::{Findings, number};
use super::grid::Grid;
use super::{material, stl, unique, usual_material};
use crate::case::Case;
use crate::case::structures::Stops;
use crate::error::Remedy;
use crate::scene::flow::Flow;
use crate::structure::{Frame, Images, Shape};
use nalgebra::Vector3;
use serde::Serialize;
use std::sync::Arc;

/// A solid at rest.
#[derive(Clone, Debug, Serialize)]
pub struct Structure {
    /// Its name.
    pub name: String,
    /// The solid with its periodic images.
    #[serde(skip)]
    pub solid: Arc<Images>,
    /// What it stops.
    pub stops: Stops,
    /// Index of its material.
    pub material: Option<usize>,
}

/// Cells round the domain in which solids are known.
const MARGIN: f64 = 3.0;

/// The structures of a case.
pub(crate) fn structures(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Vec<Structure> {
    let mut known: Vec<&str> = case.walls.iter().map(|wall| wall.name.as_str()).collect();
    let usual = usual_material(case);
    let mut all = Vec::new();
    for (n, written) in case.structures.iter().enumerate() {
        let path = format!("structures[{n}]");
        unique(&mut known, &written.name, &format!("{path}.name"), findings);
        let shape = format!("{path}.shape");
        let Some(images) = images(case, grid, &written.shape, &shape, findings) else {
            continue;
        };
        let index = match (&written.material, usual) {
            (Some(name), _) => material(names, name, &format!("{path}.material"), findings),
            (None, Some(name)) => names.iter().position(|known| known == name),
            (None, None) => None,
        };
        if written.stops == Stops::Water && case.fluid.is_none() {
            findings.error(
                &format!("{path}.stops"),
                "there is no water in this case: the structure would stop nothing",
                Remedy::from("write all").set(format!("{path}.stops"), "all"),
            );
        }
        all.push(Structure {
            name: written.name.clone(),
            solid: Arc::new(images),
            stops: written.stops,
            material: index,
        });
    }
    all
}

/// A solid with its periodic images; findings where it cannot be had, or lies outside the domain.
pub(crate) fn images(
    case: &Case,
    grid: &Grid,
    written: &Shape,
    path: &str,
    findings: &mut Findings,
) -> Option<Images> {
    let frame = Frame {
        dimension: grid.dimension,
        size: grid.size,
    };
    let read = |mesh: &crate::geometry::Mesh| {
        let origin = mesh.origin.as_ref().map_or([0.0; 3], |at| at.to_array());
        let file = case.directory.join(&mesh.path);
        let triangles = io::plain::bytes(&file, io::plain::LONGEST_INPUT)
            .map_err(|e| e.to_string())
            .and_then(|bytes| stl::triangles(&bytes, mesh.scale, &Vector3::from(origin)))
            .map_err(|e| format!("{}: {e}", mesh.path.display()))?;
        Ok(triangles.into_iter().map(|t| t.map(Into::into)).collect())
    };
    let solid = written.solid(&frame, path, &read, findings)?;
    let images = Images::new(solid, frame, grid.periodic, MARGIN * grid.spacing);
    if images.is_empty() || !meets(&images, grid) {
        let reaches = images.solid().extent().map(|corner| {
            let corner = corner[..grid.dimension].iter();
            corner.map(|x| number(*x)).collect::<Vec<_>>().join(", ")
        });
        findings.error(
            path,
            format!(
                "the solid lies outside the domain: it reaches from {} to {} m",
                reaches[0], reaches[1]
            ),
            format!(
                "the domain is 0 … {} m along its axes: move the solid into it",
                grid.size[..grid.dimension]
                    .iter()
                    .map(|x| number(*x))
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        );
        return None;
    }
    Some(images)
}

/// Whether a part of the solid, however thin, lies in the domain.
fn meets(images: &Images, grid: &Grid) -> bool {
    images
        .extents()
        .any(|[low, high]| (0..grid.dimension).all(|a| low[a] < grid.size[a] && high[a] > 0.0))
        && images.solid().plane().is_none_or(|(point, normal)| {
            // The corner of the domain that lies deepest behind the plane.
            let deepest: f64 = (0..grid.dimension)
                .map(|a| (-point[a] * normal[a]).min((grid.size[a] - point[a]) * normal[a]))
                .sum();
            deepest < 0.0
        })
}

/// Grains reach into a structure at the start where they do by more than this part of their radius.
const ALLOWED: f64 = 0.05;

/// How deep a grain reaches into a structure that stops grains \[m\], where that is more than contacts explain.
fn depth(structure: &Structure, grain: &super::sample::Grain) -> Option<f64> {
    let depth = grain.radius - structure.solid.distance(grain.position);
    (structure.stops.grains() && depth > ALLOWED * grain.radius).then_some(depth)
}

/// Whether a grain starts in a structure, deeper than a twentieth of its radius.
#[must_use]
pub fn inside(structures: &[Structure], grain: &super::sample::Grain) -> bool {
    structures.iter().any(|one| depth(one, grain).is_some())
}

/// Openings that structures close completely.
pub(crate) fn openings(
    grid: &Grid,
    structures: &[Structure],
    flow: &Flow,
    findings: &mut Findings,
) {
    let solid = |at: [f64; 3]| {
        let mut water = structures.iter().filter(|s| s.stops.water());
        water.any(|s| s.solid.distance(at) < 0.0)
    };
    for patch in flow.patches() {
        let Some(n) = patch.index.filter(|_| !structures.is_empty()) else {
            continue;
        };
        if !patch.condition.model().passes_water() {
            continue;
        }
        let axis = patch.face.axis();
        let across: Vec<usize> = (0..grid.dimension).filter(|&a| a != axis).collect();
        let count: usize = across.iter().map(|&a| patch.cells(a)).product();
        let layer = if patch.face.is_max() {
            grid.cells[axis] - 1
        } else {
            0
        };
        let closed = (0..count).all(|mut k| {
            let mut cell = [0; 3];
            cell[axis] = layer;
            for &a in &across {
                let cells = patch.cells(a);
                cell[a] = patch.from[a] + k % cells;
                k /= cells;
            }
            solid(grid.centre(cell))
        });
        if closed && count > 0 {
            findings.error(
                &format!("fluid.lattice_boltzmann.boundaries[{n}]"),
                format!("structures cover all of `{}`: no water passes", patch.name),
                "move the opening or the structure",
            );
        }
    }
}
