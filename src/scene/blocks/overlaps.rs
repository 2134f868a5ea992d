//! Checks that blocks, bodies, listed grains and walls do not overlap at the start: a deep overlap is an error in the coordinates, and the springs
//! would throw the bodies apart. Walls of facets count where they reach into the largest sphere around the centroid.
//! [`super::super::solids`] checks pairs of spheres.

use super::super::bodies::{Body, Mobility};
use super::super::findings::{Findings, number};
use super::super::grains::{GrainSource, Grains};
use super::super::walls::Wall;
use super::Blocks;
use crate::case::Case;
use crate::case::blocks::BlockSource;
use crate::dem::polyhedron::{History, Model, Narrow, Piece, Placed, Solid};
use crate::number::real;
use nalgebra::Vector3;

/// Solids overlap at the start by no more than this, over the radius of the smaller one's largest sphere.
const ALLOWED: f64 = 0.05;
/// No more sentences than this about one kind of finding.
const MOST_FINDINGS: usize = 20;

/// A solid that may overlap others: a sphere where it has no shape.
struct Standing<'a> {
    solid: Option<&'a Solid>,
    position: Vector3<f64>,
    radius: f64,
    fixed: bool,
    /// Blocks of one rock mass do not overlap.
    mass: bool,
    /// JSON path of where it stands.
    path: String,
    name: String,
}

impl Standing<'_> {
    fn placed(&self) -> Option<Placed<'_>> {
        self.solid.map(|solid| Placed {
            shape: &solid.shape,
            rotation: solid.orientation.to_rotation_matrix().into_inner(),
        })
    }

    /// Radius (m) of the largest sphere in it.
    fn inner(&self) -> f64 {
        self.solid
            .map_or(self.radius, |solid| 0.5 * Piece::of(solid).thickness())
    }

    /// How far it reaches into a wall (m); into facets at least so far.
    fn reaches_into(&self, wall: &Wall) -> f64 {
        if let Some(surface) = &wall.surface {
            let away = surface.clearance(&self.position);
            let inner = self.solid.map_or(self.radius, |solid| {
                let faces = solid.shape.half_spaces().iter();
                faces.map(|face| face.offset).fold(f64::INFINITY, f64::min)
            });
            return inner - away;
        }
        let normal = Vector3::from(wall.normal);
        let height = |v: &Vector3<f64>| normal.dot(&(v - Vector3::from(wall.point)));
        match self.solid {
            None => self.radius - height(&self.position),
            Some(solid) => -solid
                .vertices()
                .iter()
                .map(height)
                .fold(f64::INFINITY, f64::min),
        }
    }
}

/// What overlaps, as findings.
pub(crate) fn overlaps(
    case: &Case,
    blocks: Option<&Blocks>,
    bodies: &[Body],
    grains: Option<&Grains>,
    walls: &[Wall],
    findings: &mut Findings,
) {
    let mut all = standing(case, blocks, bodies, grains);
    if all.iter().all(|one| one.solid.is_none()) {
        return;
    }
    let mut found = 0;
    let mut report = |one: &Standing, other: &str, depth: f64, findings: &mut Findings| {
        found += 1;
        if found <= MOST_FINDINGS {
            let (name, depth) = (&one.name, number(depth));
            let reason = format!("{name} overlaps {other} by {depth} m at the start");
            findings.error(&one.path, reason, "move them apart");
        }
    };
    for one in all.iter().filter(|one| one.solid.is_some() && !one.fixed) {
        for wall in walls {
            let depth = one.reaches_into(wall);
            if depth > 0.0 && depth > ALLOWED * one.inner() {
                report(one, &format!("the wall `{}`", wall.name), depth, findings);
            }
        }
    }
    all.sort_by(|a, b| (a.position.x - a.radius).total_cmp(&(b.position.x - b.radius)));
    let mut narrow = Narrow::default();
    for (n, one) in all.iter().enumerate() {
        for other in &all[n + 1..] {
            if other.position.x - other.radius > one.position.x + one.radius {
                break;
            }
            if one.fixed && other.fixed || one.mass && other.mass {
                continue;
            }
            let depth = depth(&mut narrow, one, other);
            if depth > 0.0 && depth > ALLOWED * one.inner().min(other.inner()) {
                report(other, &one.name, depth, findings);
            }
        }
    }
    if found > MOST_FINDINGS {
        let more = number(real(found - MOST_FINDINGS));
        findings.error(
            "blocks.initial",
            format!("{more} more overlaps"),
            "move them apart",
        );
    }
}

/// How deep two solids overlap (m); zero for two spheres.
fn depth(narrow: &mut Narrow, one: &Standing, other: &Standing) -> f64 {
    let separation = other.position - one.position;
    let geometry = match (one.placed(), other.placed()) {
        (Some(a), Some(b)) => {
            narrow.blocks(&a, &b, &separation, &Model::Patch, &mut History::default())
        }
        (Some(a), None) => narrow.sphere(&a, &separation, other.radius),
        (None, Some(b)) => narrow.sphere(&b, &-separation, one.radius),
        (None, None) => None,
    };
    geometry.map_or(0.0, |touch| touch.depth)
}

/// All that stands there at the start with a place of its own.
fn standing<'a>(
    case: &Case,
    blocks: Option<&'a Blocks>,
    bodies: &'a [Body],
    grains: Option<&'a Grains>,
) -> Vec<Standing<'a>> {
    let source = case.blocks.as_ref().map(|blocks| &blocks.initial);
    let mass = matches!(source, Some(BlockSource::Joints(_)));
    let mut all = Vec::new();
    for (n, block) in blocks.iter().flat_map(|b| &b.list).enumerate() {
        all.push(Standing {
            solid: Some(&block.solid),
            position: block.solid.position,
            radius: block.solid.shape.radius(),
            fixed: block.fixed,
            mass,
            path: match source {
                Some(BlockSource::List(_)) => format!("blocks.initial.list[{n}].position"),
                _ => "blocks.initial".into(),
            },
            name: format!("block {n}"),
        });
    }
    for (n, body) in bodies.iter().enumerate() {
        all.push(Standing {
            solid: body.solid.as_ref(),
            position: body.position.into(),
            radius: body.radius,
            fixed: body.mobility == Mobility::Fixed,
            mass: false,
            path: format!("bodies[{n}].position"),
            name: format!("the body `{}`", body.name),
        });
    }
    if let Some(GrainSource::List(list) | GrainSource::File { grains: list, .. }) =
        grains.map(|grains| &grains.source)
    {
        for (n, grain) in list.iter().enumerate() {
            all.push(Standing {
                solid: None,
                position: grain.position.into(),
                radius: grain.radius,
                fixed: false,
                mass: false,
                path: "grains.initial".into(),
                name: format!("grain {n}"),
            });
        }
    }
    all
}
