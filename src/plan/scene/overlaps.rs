//! Checks that no solids overlap at the start: grains, blocks and bodies with each other, with walls and with
//! structures.
//!
//! An overlap of more than a twentieth of the radius of the smaller solid is an error in the coordinates, which the
//! springs would turn into an explosion. The sources differ only in the path of their findings: grains and blocks
//! of a list or a file, blocks of a rock mass and bodies are compared by one function, also across periodic faces.
//! The depth of a facet in a polyhedron is the largest distance of one of its points from the faces of the polyhedron
//! inside it. Prepared grains have no positions before the run: they are checked by the box in which they start.

use super::aligned_box::AlignedBox;
use super::blocks::PlacedBlocks;
use super::bodies::{Mobility, NamedBody, longer_than_domain};
use super::findings::{Findings, number};
use super::grains::{GrainSource, Grains};
use super::grid::Grid;
use super::pairs::{self, Ball};
use super::structures::Structure;
use super::walls::SceneWall;
use base::number::real;
use case::Case;
use case::blocks::BlockSource;
use dem::polyhedron::{
    BlockContactModel, BlockHistory, HalfSpace, Narrow, Piece, Placed, PlacedPolyhedron,
    penetration,
};
use dem::surface::FacetSurface;
use nalgebra::Vector3;
use std::ops::ControlFlow;

/// Maximum initial overlap as a fraction of the smaller solid's inscribed radius.
const ALLOWED: f64 = 0.05;
/// Depth of a solid in a box that is rounding, as a fraction of its radius.
const TOUCHES: f64 = 1e-9;
/// Maximum number of findings of one kind that are listed.
const NAMED: usize = 20;
/// Maximum number of pairs that are counted.
const COUNTED: usize = 100_000;

/// Initial solids of a scene.
pub(crate) struct Start<'a> {
    /// Case from which the scene is resolved.
    pub(crate) case: &'a Case,
    /// Grid of the domain.
    pub(crate) grid: &'a Grid,
    /// Acceleration of gravity [m/s2].
    pub(crate) gravity: [f64; 3],
    /// Grains, if any.
    pub(crate) grains: Option<&'a Grains>,
    /// Blocks, if any.
    pub(crate) blocks: Option<&'a PlacedBlocks>,
    /// Named bodies.
    pub(crate) bodies: &'a [NamedBody],
    /// Walls of grains.
    pub(crate) walls: &'a [SceneWall],
    /// Structures.
    pub(crate) structures: &'a [Structure],
}

/// Source of a solid, with the index of the solid in it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Origin {
    Listed(usize),
    FromFile(usize),
    Body(usize),
    ListedBlock(usize),
    Block(usize),
}

/// Solid with a known position; a disc or sphere if it has no shape.
struct Standing<'a> {
    solid: Option<&'a PlacedPolyhedron>,
    position: Vector3<f64>,
    /// Radius of the enclosing sphere \[m\].
    radius: f64,
    /// Radius of the inscribed sphere \[m\].
    inner: f64,
    fixed: bool,
    /// `true` for a block of a rock mass; such blocks do not overlap each other within the domain.
    mass: bool,
    origin: Origin,
}

impl<'a> Standing<'a> {
    fn round(position: [f64; 3], radius: f64, fixed: bool, origin: Origin) -> Self {
        Self {
            solid: None,
            position: position.into(),
            radius,
            inner: radius,
            fixed,
            mass: false,
            origin,
        }
    }

    fn polyhedron(solid: &'a PlacedPolyhedron, fixed: bool, mass: bool, origin: Origin) -> Self {
        Self {
            solid: Some(solid),
            position: solid.position,
            radius: solid.shape.radius(),
            inner: 0.5 * Piece::from_polyhedron(solid).thickness(),
            fixed,
            mass,
            origin,
        }
    }

    fn placed(&self) -> Option<Placed<'_>> {
        self.solid.map(|solid| Placed {
            shape: &solid.shape,
            rotation: solid.orientation.to_rotation_matrix().into_inner(),
        })
    }

    /// Returns the radius of the largest sphere around the centroid inside the solid \[m\].
    fn around_centroid(&self) -> f64 {
        self.solid.map_or(self.radius, |solid| {
            let faces = solid.shape.half_spaces().iter();
            faces.map(|face| face.offset).fold(f64::INFINITY, f64::min)
        })
    }

    /// Returns the depth \[m\] by which the solid overlaps a wall, if it exceeds the allowed overlap.
    fn depth_in_wall(&self, wall: &SceneWall) -> Option<f64> {
        let depth = if let Some(surface) = &wall.surface {
            self.depth_of_facets(surface)?
        } else {
            let normal = Vector3::from(wall.normal);
            let height = |v: &Vector3<f64>| normal.dot(&(v - Vector3::from(wall.point)));
            match self.solid {
                None => self.radius - height(&self.position),
                Some(solid) => {
                    let corners = solid.vertices();
                    -corners.iter().map(height).fold(f64::INFINITY, f64::min)
                }
            }
        };
        self.counts(depth)
    }

    /// Returns the depth \[m\] of the deepest facet in the solid, if it exceeds the allowed overlap.
    fn depth_of_facets(&self, surface: &FacetSurface) -> Option<f64> {
        let allowed = ALLOWED * self.inner;
        let Some(solid) = self.solid else {
            if !surface.is_within(&self.position, self.radius - allowed) {
                return None;
            }
            return Some(self.radius - surface.clearance(&self.position));
        };
        if !surface.is_within(&self.position, self.radius) {
            return None;
        }
        let faces = solid.half_spaces();
        let near = (0..surface.len())
            .filter(|facet| surface.distance(*facet, &self.position) < self.radius);
        let mut deepest = allowed;
        for facet in near {
            let corners: Vec<_> = surface.corners(facet).collect();
            // Most facets are not deeper than those before them.
            if part_inside(&corners, &faces, deepest) {
                deepest = depth_of_polygon(&corners, &faces, [deepest, self.radius]);
            }
        }
        (deepest > allowed).then_some(deepest)
    }

    /// Returns the depth \[m\] by which the solid overlaps a structure with these facets, if it exceeds the allowed
    /// overlap.
    fn depth_in_structure(
        &self,
        structure: &Structure,
        facets: Option<&FacetSurface>,
    ) -> Option<f64> {
        if !structure.stops.grains() {
            return None;
        }
        let distance = structure.solid.distance(self.position.into());
        if distance > self.radius {
            return None;
        }
        let of_corners = self.solid.map_or(f64::NEG_INFINITY, |solid| {
            let corners = solid.vertices();
            let depths = corners
                .iter()
                .map(|at| -structure.solid.distance((*at).into()));
            depths.fold(f64::NEG_INFINITY, f64::max)
        });
        // A structure that is thinner than a block can pierce it without reaching its corners or its centroid.
        let of_facets = self.solid.and(facets);
        let of_facets = of_facets.and_then(|facets| self.depth_of_facets(facets));
        let of_points = (self.around_centroid() - distance).max(of_corners);
        self.counts(of_points.max(of_facets.unwrap_or(f64::NEG_INFINITY)))
    }

    fn counts(&self, depth: f64) -> Option<f64> {
        (depth > ALLOWED * self.inner).then_some(depth)
    }

    /// Returns the overlap \[m\] with another solid shifted by `shift`, the shortest way out of it; not positive if
    /// they are separate.
    fn depth(&self, other: &Self, shift: &Vector3<f64>, narrow: &mut Narrow) -> f64 {
        let separation = other.position + shift - self.position;
        let geometry = match (self.placed(), other.placed()) {
            (Some(a), Some(b)) => {
                let model = &BlockContactModel::Patch;
                let history = &mut BlockHistory::default();
                let touches = narrow.blocks(&a, &b, &separation, model, history);
                return touches.map_or(0.0, |_| penetration(&a, &b, &separation));
            }
            (Some(a), None) => narrow.sphere(&a, &separation, other.radius),
            (None, Some(b)) => narrow.sphere(&b, &-separation, self.radius),
            (None, None) => return self.radius + other.radius - separation.norm(),
        };
        geometry.map_or(0.0, |touch| touch.depth)
    }
}

/// Returns `true` if a part of a polygon lies deeper than `depth` \[m\] in the convex solid of these faces.
fn part_inside(corners: &[Vector3<f64>], faces: &[HalfSpace], depth: f64) -> bool {
    let mut kept = corners.to_vec();
    for face in faces {
        let height = |point: &Vector3<f64>| face.height(point) + depth;
        let mut next = Vec::with_capacity(kept.len() + 1);
        for (n, one) in kept.iter().enumerate() {
            let other = &kept[(n + 1) % kept.len()];
            let [from, to] = [height(one), height(other)];
            if from < 0.0 {
                next.push(*one);
            }
            if from * to < 0.0 {
                next.push(one + (other - one) * (from / (from - to)));
            }
        }
        if next.is_empty() {
            return false;
        }
        kept = next;
    }
    true
}

/// Returns the largest depth \[m\] of a point of a polygon in a convex solid; it lies between the two depths.
fn depth_of_polygon(
    corners: &[Vector3<f64>],
    faces: &[HalfSpace],
    [mut low, mut high]: [f64; 2],
) -> f64 {
    while high - low > 1e-6 * high {
        let middle = 0.5 * (low + high);
        if part_inside(corners, faces, middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Overlapping pair of solids.
struct Pair {
    one: usize,
    other: usize,
    depth: f64,
    /// `true` if the solids overlap across a periodic face.
    across: bool,
}

/// Refuses solids that overlap at the start.
pub(crate) fn overlaps(start: &Start<'_>, findings: &mut Findings) {
    let all = start.standing();
    start.own_images(&all, findings);
    start.at_walls(&all, findings);
    start.in_structures(&all, findings);
    start.pairs(&all, findings);
    start.prepared(findings);
}

impl<'a> Start<'a> {
    /// Returns all solids with a known position: blocks, bodies, and grains that no cut removes.
    fn standing(&self) -> Vec<Standing<'a>> {
        let source = self.case.blocks.as_ref().map(|blocks| &blocks.initial);
        let mass = matches!(source, Some(BlockSource::Joints(_)));
        let blocks = self.blocks.iter().flat_map(|blocks| &blocks.list);
        let blocks = blocks.enumerate().map(|(n, block)| {
            let origin = match source {
                Some(BlockSource::List(_)) => Origin::ListedBlock(n),
                _ => Origin::Block(n),
            };
            Standing::polyhedron(&block.solid, block.fixed, mass, origin)
        });
        let bodies = self.bodies.iter().enumerate().map(|(n, body)| {
            let fixed = body.mobility == Mobility::Fixed;
            let origin = Origin::Body(n);
            match &body.solid {
                Some(solid) => Standing::polyhedron(solid, fixed, false, origin),
                None => Standing::round(self.flat(body.position), body.radius, fixed, origin),
            }
        });
        let (list, from_file) = match self.grains.map(|grains| &grains.source) {
            Some(GrainSource::List(list)) => (&list[..], false),
            Some(GrainSource::File { grains, .. }) => (&grains[..], true),
            _ => (&[][..], false),
        };
        let cuts = self.grains.map_or(&[][..], |grains| &grains.cut);
        let grains = list.iter().enumerate().filter(|(_, grain)| {
            let mut cuts = cuts.iter();
            !cuts.any(|(_, cut)| cut.touches(grain.position, grain.radius))
        });
        let grains = grains.map(|(n, grain)| {
            let origin = if from_file {
                Origin::FromFile(n)
            } else {
                Origin::Listed(n)
            };
            Standing::round(self.flat(grain.position), grain.radius, false, origin)
        });
        blocks.chain(bodies).chain(grains).collect()
    }

    /// Returns a position with the unused third coordinate set to zero in 2-D.
    fn flat(&self, mut at: [f64; 3]) -> [f64; 3] {
        at[self.grid.dimension..].fill(0.0);
        at
    }

    /// Returns the path of the field that states the position of a solid.
    fn path(&self, origin: Origin) -> String {
        match origin {
            Origin::Listed(n) => format!("grains.initial.list[{n}].position"),
            Origin::FromFile(_) => "grains.initial.file.path".into(),
            Origin::Body(n) => format!("bodies[{n}].position"),
            Origin::ListedBlock(n) => format!("blocks.initial.list[{n}].position"),
            Origin::Block(_) => "blocks.initial".into(),
        }
    }

    fn name(&self, origin: Origin) -> String {
        match origin {
            Origin::Listed(n) => format!("grain {n}"),
            Origin::FromFile(n) => format!("grain {} of the sample", n + 1),
            Origin::Body(n) => format!("the body `{}`", self.bodies[n].name),
            Origin::ListedBlock(n) | Origin::Block(n) => format!("block {n}"),
        }
    }

    /// Refuses blocks that are longer than a period: they would overlap their own images.
    fn own_images(&self, all: &[Standing<'_>], findings: &mut Findings) {
        let blocks = (all.iter())
            .filter(|one| matches!(one.origin, Origin::ListedBlock(_) | Origin::Block(_)));
        let mut named = 0;
        for (one, solid) in blocks.filter_map(|one| Some((one, one.solid?))) {
            let Some((axis, width)) = longer_than_domain(self.grid, solid, &self.grid.periodic)
            else {
                continue;
            };
            let path = match one.origin {
                Origin::ListedBlock(n) => format!("blocks.initial.list[{n}].shape"),
                other => self.path(other),
            };
            let name = ["x", "y", "z"][axis];
            let reason = format!(
                "{} is {} m long along the periodic axis {name}, where the domain repeats every {} m: it would \
                 overlap its own image",
                self.name(one.origin),
                number(width),
                number(self.grid.size[axis])
            );
            let remedy = format!(
                "make it shorter, use a longer domain, or remove {name} from domain.periodic"
            );
            findings.error(&path, reason, remedy);
            named += 1;
            if named == NAMED {
                break;
            }
        }
    }

    /// Refuses solids that overlap walls. Structures have an inside and are checked by [`Self::in_structures`].
    fn at_walls(&self, all: &[Standing<'_>], findings: &mut Findings) {
        // A surface that could not be read, or a plane without a direction, is reported separately.
        let known = |wall: &SceneWall| {
            wall.surface.is_some() || Vector3::from(wall.normal).norm_squared() > 0.5
        };
        let standing = |wall: &&SceneWall| {
            wall.structure.is_none() && wall.from.is_none_or(|at| at <= 0.0) && known(wall)
        };
        for wall in self.walls.iter().filter(standing) {
            let checked = all.iter().filter(|one| one.solid.is_none() || !one.fixed);
            let reaching = checked.filter_map(|one| Some((one, one.depth_in_wall(wall)?)));
            let reaching: Vec<_> = reaching.collect();
            let other = format!("overlap the wall `{}`", wall.name);
            let remedy = "move it away from the wall";
            let cut = "remove these grains with `grains.cut`, or move the wall";
            self.report(&reaching, &other, [remedy, cut], findings);
        }
    }

    /// Refuses solids that overlap structures.
    fn in_structures(&self, all: &[Standing<'_>], findings: &mut Findings) {
        for (n, structure) in self.structures.iter().enumerate() {
            let mut surfaces = self.walls.iter().filter(|wall| wall.structure == Some(n));
            let facets = surfaces.find_map(|wall| wall.surface.as_deref());
            let free = all.iter().filter(|one| !one.fixed);
            let reaching =
                free.filter_map(|one| Some((one, one.depth_in_structure(structure, facets)?)));
            let reaching: Vec<_> = reaching.collect();
            let other = format!("reach into the structure `{}`", structure.name);
            let remedy = "move it away from the structure";
            let cut = "remove these grains with `grains.cut`, or move the structure";
            self.report(&reaching, &other, [remedy, cut], findings);
        }
    }

    /// Reports solids of the case that overlap a stationary obstacle, and counts those of a sample.
    fn report(
        &self,
        reaching: &[(&Standing<'_>, f64)],
        other: &str,
        [remedy, cut]: [&str; 2],
        findings: &mut Findings,
    ) {
        let sampled = |origin| matches!(origin, Origin::FromFile(_));
        let (verb, what) = other.split_once(' ').unwrap_or((other, ""));
        let named = reaching.iter().filter(|(one, _)| !sampled(one.origin));
        for (one, depth) in named.clone().take(NAMED) {
            let suffix = if verb == "reach" { "es" } else { "s" };
            let reason = format!(
                "{} {verb}{suffix} {what} by {} m at the start",
                self.name(one.origin),
                number(*depth)
            );
            findings.error(&self.path(one.origin), reason, remedy);
        }
        let more = named.count().saturating_sub(NAMED);
        if more > 0 {
            let path = self.path(reaching[0].0.origin);
            let reason = format!("{} more {other} at the start", number(real(more)));
            findings.error(&path, reason, remedy);
        }
        let of_sample = reaching.iter().filter(|(one, _)| sampled(one.origin));
        let deepest = of_sample.clone().max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((one, depth)) = deepest {
            let reason = format!(
                "{} grains of the sample {other} at the start; the deepest, {}, by {} m",
                number(real(of_sample.count())),
                self.name(one.origin),
                number(*depth)
            );
            findings.error(&self.path(one.origin), reason, cut);
        }
    }

    /// Refuses pairs of solids that overlap, also across periodic faces.
    fn pairs(&self, all: &[Standing<'_>], findings: &mut Findings) {
        let balls: Vec<Ball> = all
            .iter()
            .map(|one| Ball {
                at: one.position.into(),
                reach: one.radius,
            })
            .collect();
        let period = std::array::from_fn(|a| {
            (a < self.grid.dimension && self.grid.periodic[a]).then(|| self.grid.size[a])
        });
        let shifts = shifts(period);
        let mut narrow = Narrow::default();
        let mut found = Vec::new();
        let complete = pairs::near(&balls, period, |one, other| {
            found.extend(overlap((one, other), all, &shifts, &mut narrow));
            if found.len() < COUNTED {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
        found.sort_unstable_by_key(|pair| (pair.other, pair.one));
        let is_sampled = |pair: &&Pair| matches!(all[pair.other].origin, Origin::FromFile(_));
        let named: Vec<&Pair> = found.iter().filter(|pair| !is_sampled(pair)).collect();
        for pair in named.iter().take(NAMED) {
            let origin = all[pair.other].origin;
            findings.error(
                &self.path(origin),
                self.sentence(pair, all),
                "move them apart",
            );
        }
        let least = if complete.is_break() { "at least " } else { "" };
        if named.len() > NAMED {
            let path = match all[named[0].other].origin {
                Origin::Listed(_) => "grains.initial.list",
                Origin::Body(_) => "bodies",
                _ => "blocks.initial",
            };
            let more = number(real(named.len() - NAMED));
            findings.error(
                path,
                format!("{least}{more} more pairs overlap"),
                "move them apart",
            );
        }
        let sampled = found.iter().filter(is_sampled);
        let deepest = sampled.clone().max_by(|a, b| a.depth.total_cmp(&b.depth));
        if let Some(pair) = deepest {
            let count = sampled.count();
            let sentence = self.sentence(pair, all);
            let reason = if count == 1 {
                sentence
            } else {
                let count = number(real(count));
                format!("{least}{count} pairs of the sample overlap; the deepest: {sentence}")
            };
            let remedy = "use a sample whose grains overlap by at most a twentieth of their radius, in the \
                          domain for which it was made; check that the file contains radii, not diameters, in m";
            findings.error("grains.initial.file.path", reason, remedy);
        }
    }

    fn sentence(&self, pair: &Pair, all: &[Standing<'_>]) -> String {
        let [one, other] = [pair.one, pair.other].map(|n| self.name(all[n].origin));
        let across = if pair.across {
            " across a periodic face"
        } else {
            ""
        };
        let depth = number(pair.depth);
        format!("{other} overlaps {one} by {depth} m at the start{across}")
    }

    /// Refuses prepared grains near obstacles that their preparation does not include: bodies and blocks, and for
    /// growing grains also walls. Boxes emptied by a cut are exempt.
    fn prepared(&self, findings: &mut Findings) {
        let Some(grains) = self.grains else {
            return;
        };
        let (boxes, what): (Vec<AlignedBox>, _) = match &grains.source {
            GrainSource::Deposition { clouds, .. } => {
                let Some(boxes) = self.paths_of_fall(clouds.iter().map(|cloud| cloud.block)) else {
                    return;
                };
                (boxes, "grains of the deposition fall onto the position of")
            }
            GrainSource::Growth { block, .. } => (vec![*block], "grains grow at the position of"),
            _ => return,
        };
        let emptied = |at: &Vector3<f64>, radius: f64| {
            grains.cut.iter().any(|(_, cut)| {
                (0..self.grid.dimension)
                    .all(|a| cut.from[a] <= at[a] - radius && cut.to[a] >= at[a] + radius)
            })
        };
        let standing = self.standing();
        let hit = standing.iter().filter(|one| {
            // A body may touch the box.
            let radius = one.radius * (1.0 - TOUCHES);
            let meets = |space: &AlignedBox| space.touches(one.position.into(), radius);
            boxes.iter().any(meets) && !emptied(&one.position, one.radius)
        });
        for one in hit.take(NAMED) {
            findings.error(
                &self.path(one.origin),
                format!(
                    "{what} {}, but the preparation of the grains ignores bodies and blocks",
                    self.name(one.origin)
                ),
                "define it under `structures`, remove the grains at its position with `grains.cut`, or move it",
            );
        }
        if let GrainSource::Growth { block, .. } = &grains.source {
            self.growth_behind_walls(block, grains, findings);
        }
    }

    /// Returns the boxes through which grains fall from clouds to the end of the domain; none without gravity.
    fn paths_of_fall(&self, clouds: impl Iterator<Item = AlignedBox>) -> Option<Vec<AlignedBox>> {
        let down = (0..self.grid.dimension).find(|&a| self.gravity[a].abs() > 0.0)?;
        let to_the_end = clouds.map(|mut path| {
            if self.gravity[down] < 0.0 {
                path.from[down] = 0.0;
            } else {
                path.to[down] = self.grid.size[down];
            }
            path
        });
        Some(to_the_end.collect())
    }

    /// Refuses growth in a box that extends behind a plane wall, unless a cut empties that part.
    fn growth_behind_walls(&self, block: &AlignedBox, grains: &Grains, findings: &mut Findings) {
        let smallest = grains.radii.map_or(0.0, |(low, _)| low);
        if !grains.cut.is_empty() {
            return;
        }
        let lasting = |wall: &&SceneWall| {
            wall.structure.is_none()
                && wall.surface.is_none()
                && wall.exists(0.0)
                && Vector3::from(wall.normal).norm_squared() > 0.5
        };
        for wall in self.walls.iter().filter(lasting) {
            let lowest: f64 = (0..self.grid.dimension)
                .map(|a| {
                    let ends = [block.from[a], block.to[a]];
                    let heights = ends.map(|x| (x - wall.point[a]) * wall.normal[a]);
                    heights[0].min(heights[1])
                })
                .sum();
            if -lowest > ALLOWED * smallest {
                findings.error(
                    "grains.initial.growth.box",
                    format!(
                        "the box reaches {} m behind the wall `{}`, but growing grains are stopped by the faces \
                         of their box only",
                        number(-lowest),
                        wall.name
                    ),
                    "end the box at the wall, or remove the grains behind it with `grains.cut`",
                );
            }
        }
    }
}

/// Returns the shifts to a solid and its images across periodic faces.
fn shifts(period: [Option<f64>; 3]) -> Vec<Vector3<f64>> {
    let mut shifts = vec![Vector3::zeros()];
    for (axis, length) in period.into_iter().enumerate() {
        let Some(length) = length else { continue };
        for n in 0..shifts.len() {
            for turn in [-length, length] {
                let mut shift = shifts[n];
                shift[axis] = turn;
                shifts.push(shift);
            }
        }
    }
    shifts
}

/// Returns the largest overlap of two solids or their images, if it exceeds the allowed overlap.
fn overlap(
    (one, other): (usize, usize),
    all: &[Standing<'_>],
    shifts: &[Vector3<f64>],
    narrow: &mut Narrow,
) -> Option<Pair> {
    let [a, b] = [one, other].map(|n| &all[n]);
    let round = a.solid.is_none() && b.solid.is_none();
    if !round && a.fixed && b.fixed {
        return None;
    }
    let allowed = ALLOWED * a.inner.min(b.inner);
    let mut deepest: Option<Pair> = None;
    for (n, shift) in shifts.iter().enumerate() {
        let across = n > 0;
        let separation = b.position + shift - a.position;
        if separation.norm() > a.radius + b.radius || !across && a.mass && b.mass {
            continue;
        }
        let depth = a.depth(b, shift, narrow);
        if depth > allowed && deepest.as_ref().is_none_or(|known| depth > known.depth) {
            deepest = Some(Pair {
                one,
                other,
                depth,
                across,
            });
        }
    }
    deepest
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::{Problem, Severity};
    use case::{Document, examples};
    use std::path::Path;

    #[test]
    fn a_body_may_touch_the_box_of_growing_grains() {
        let refused = |below: f64| {
            let case = serde_json::json!({
                "domain": {"size": [0.04, 0.044], "spacing": 0.002},
                "materials": {"glass": {"density": 2500}},
                "grains": {"material": "glass", "initial": {"growth": {
                    "amount": {"solid_fraction": 0.8}, "radii": {"uniform": {"min": 8e-4, "max": 1.2e-3}},
                    "box": {"from": [0, 0.002], "to": [0.04, 0.04]}}}},
                "contact": {"linear": {"normal_stiffness": {"absolute": 2e6}, "friction_angle_degrees": 20}},
                "bodies": [
                    {"name": "below", "shape": {"disc": {"radius": 0.001}}, "position": [0.02, below],
                     "motion": {"fixed": {}}, "material": "glass"},
                    {"name": "above", "shape": {"disc": {"radius": 0.001}}, "position": [0.02, 0.041],
                     "motion": {"fixed": {}}, "material": "glass"}],
                "time": {"end": 0.01}
            });
            let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
            let problems = Plan::prepare(document).err().unwrap_or_default();
            problems.iter().any(|p| p.reason.contains("grains grow at"))
        };
        assert!(!refused(0.001));
        assert!(refused(0.00101));
    }

    #[test]
    fn grains_do_not_fall_through_a_body() {
        let text = examples::find("deposition").unwrap().text;
        let problems = |height: f64, cut: bool| {
            let mut set = vec![format!(
                r#"bodies=[{{"name": "ball", "material": "soil", "shape": {{"sphere": {{"radius": 0.002}}}},
                    "position": [0.012, 0.01, {height}], "motion": {{"fixed": {{}}}}}}]"#
            )];
            if cut {
                set.push(
                    r#"grains.cut=[{"name": "hole", "box": {"from": [0.008, 0.006, 0.01], "to": [0.016, 0.014,
                        0.02]}}]"#.into(),
                );
            }
            let document = Document::read(text, &set, Path::new(".")).unwrap();
            let problems = match Plan::prepare(document) {
                Ok(plan) => plan.warnings,
                Err(problems) => problems,
            };
            let about_it = problems.into_iter().filter(|problem| {
                problem.path == "bodies[0].position" && problem.reason.contains("deposition")
            });
            about_it.count()
        };
        assert_eq!(problems(0.03, false), 1, "in the cloud");
        assert_eq!(problems(0.015, false), 1, "below the cloud");
        assert_eq!(problems(0.015, true), 0, "in a hole");
    }

    /// Returns the errors of a case of glass in a box of 0.1 m that is periodic along x; `parts` are the other fields
    /// of the case.
    fn errors(parts: &serde_json::Value, folder: &Path) -> Vec<Problem> {
        let mut case = serde_json::json!({
            "domain": {"size": [0.1, 0.1, 0.1], "spacing": 0.005, "periodic": ["x"]},
            "materials": {"glass": {"density": 2500}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 2e4}}},
            "time": {"end": 0.001}
        });
        for (key, part) in parts.as_object().expect("parts of a case") {
            case[key] = part.clone();
        }
        let read = Document::read(&case.to_string(), &[], folder).and_then(Plan::prepare);
        let problems = read.map_or_else(|problems| problems, |plan| plan.warnings);
        let errors = problems.into_iter();
        errors.filter(|p| p.severity == Severity::Error).collect()
    }

    /// Returns the errors for grains of a list, and for the same grains in a file.
    fn of_both_sources(grains: &[[f64; 4]], more: &serde_json::Value) -> [Vec<Problem>; 2] {
        let folder = tempfile::tempdir().expect("a folder");
        let rows = grains
            .iter()
            .map(|[x, y, z, r]| format!("{x:?},{y:?},{z:?},{r:?}\n"));
        let text = "x,y,z,radius\n".to_owned() + &rows.collect::<String>();
        std::fs::write(folder.path().join("sample.csv"), text).expect("a sample");
        let list: Vec<_> = (grains.iter())
            .map(|[x, y, z, r]| serde_json::json!({"position": [x, y, z], "radius": r}))
            .collect();
        let sources = [
            serde_json::json!({ "list": list }),
            serde_json::json!({"file": {"path": "sample.csv"}}),
        ];
        sources.map(|source| {
            let mut parts = more.clone();
            parts["grains"] = serde_json::json!({"material": "glass", "initial": source});
            errors(&parts, folder.path())
        })
    }

    fn refuses(grains: &[[f64; 4]], more: &serde_json::Value, words: &str) {
        for problems in of_both_sources(grains, more) {
            assert_eq!(problems.len(), 1, "{words}: {problems:?}");
            assert!(problems[0].reason.contains(words), "{}", problems[0]);
        }
    }

    #[test]
    fn grains_of_a_list_and_of_a_file_are_compared_alike() {
        let none = serde_json::json!({});
        let r = 0.005;
        let apart = of_both_sources(&[[0.005, 0.05, 0.05, r], [0.095, 0.05, 0.05, r]], &none);
        assert!(apart.iter().all(Vec::is_empty), "{apart:?}");
        let inside = [[0.05, 0.05, 0.05, r], [0.0585, 0.05, 0.05, r]];
        refuses(&inside, &none, "by 0.0015 m at the start");
        let across = [[0.00425, 0.05, 0.05, r], [0.09575, 0.05, 0.05, r]];
        refuses(
            &across,
            &none,
            "by 0.0015 m at the start across a periodic face",
        );
        let same = [[0.0, 0.05, 0.05, r], [0.1, 0.05, 0.05, r]];
        refuses(
            &same,
            &none,
            "by 0.01 m at the start across a periodic face",
        );
        let floor = serde_json::json!({"box_walls": ["z_min"]});
        refuses(&[[0.05, 0.05, 0.002, r]], &floor, "the wall `z_min`");
        let weir = serde_json::json!({"structures": [{"name": "weir", "material": "glass",
            "shape": {"box": {"from": [0.0, 0.0, 0.0], "to": [0.1, 0.1, 0.05]}}}]});
        refuses(&[[0.05, 0.05, 0.02, r]], &weir, "the structure `weir`");
        refuses(
            &[[0.05, 0.05, 0.05, 1e-20]],
            &none,
            "smaller than that of an atom",
        );
        refuses(&[[0.05, 0.05, 0.05, 1e6]], &none, "covers the whole domain");
    }

    #[test]
    fn grains_that_a_cut_takes_out_may_overlap() {
        let folder = tempfile::tempdir().expect("a folder");
        let grain = |x: f64| serde_json::json!({"position": [x, 0.05, 0.05], "radius": 0.005});
        let parts = serde_json::json!({"grains": {
            "material": "glass",
            "initial": {"list": [grain(0.03), grain(0.07), grain(0.073)]},
            "cut": [{"name": "hole", "box": {"from": [0.06, 0, 0], "to": [0.1, 0.1, 0.1]}}]
        }});
        assert_eq!(errors(&parts, folder.path()), []);
    }

    #[test]
    fn blocks_are_compared_with_images_and_with_the_inside_of_structures() {
        let block = |x: f64, long: f64| {
            serde_json::json!({"shape": {"cuboid": {"edges": [long, 0.02, 0.02]}},
                "position": [x, 0.05, 0.05]})
        };
        let list = |blocks: serde_json::Value| {
            serde_json::json!({
                "blocks": {"material": "glass", "initial": {"list": blocks}},
                "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}}}
            })
        };
        let one = |parts: &serde_json::Value, words: &str| {
            let problems = errors(parts, Path::new("."));
            assert_eq!(problems.len(), 1, "{words}: {problems:?}");
            assert!(problems[0].reason.contains(words), "{}", problems[0]);
        };
        assert_eq!(
            errors(&list(serde_json::json!([block(0.05, 0.1)])), Path::new(".")),
            []
        );
        one(
            &list(serde_json::json!([block(0.05, 0.15)])),
            "its own image",
        );
        let pair = serde_json::json!([block(0.01, 0.04), block(0.07, 0.04)]);
        assert_eq!(errors(&list(pair), Path::new(".")), []);
        let pair = serde_json::json!([block(0.01, 0.04), block(0.075, 0.04)]);
        one(
            &list(pair),
            "by 0.005 m at the start across a periodic face",
        );
        // Blocks that coincide, nearly coincide or lie within another: both are named, with the way out.
        let cube = |[x, y]: [f64; 2], edge: f64, angle: f64| {
            serde_json::json!({"shape": {"cuboid": {"edges": [edge, edge, edge]}}, "position": [x, y, 0.05],
                "orientation": {"axis": [0, 0, 1], "angle_degrees": angle}})
        };
        for (other, way) in [
            (cube([0.05, 0.05], 0.02, 0.0), "0.02"),
            (cube([0.05 + 1e-12, 0.05], 0.02, 0.0), "0.02"),
            (cube([0.05, 0.05 - 1e-17], 0.02, 1e-12), "0.02"),
            (cube([0.05, 0.05], 0.01, 0.0), "0.015"),
            (cube([0.052, 0.05], 0.01, 0.0), "0.013"),
            (cube([0.05, 0.05], 0.01, 90.0), "0.015"),
        ] {
            for pair in [
                [cube([0.05, 0.05], 0.02, 0.0), other.clone()],
                [other.clone(), cube([0.05, 0.05], 0.02, 0.0)],
            ] {
                let words = format!("block 1 overlaps block 0 by {way} m at the start");
                one(&list(serde_json::json!(pair)), &words);
            }
        }
        // This grain is deep in a structure, far from its surface.
        let mut hidden = list(serde_json::json!([block(0.05, 0.02)]));
        hidden["structures"] = serde_json::json!([{"name": "rock", "material": "glass",
            "shape": {"box": {"from": [0, 0, 0], "to": [0.1, 0.1, 0.09]}}}]);
        one(
            &hidden,
            "block 0 reaches into the structure `rock` by 0.05 m",
        );
    }

    /// Checks that a beam is compared with walls and structures that pierce it far from its centroid and its corners.
    #[test]
    fn a_beam_is_compared_with_what_pierces_it() {
        let beam = |more: serde_json::Value| {
            let mut parts = serde_json::json!({
                "bodies": [{"name": "beam", "material": "glass", "position": [0.05, 0.05, 0.05],
                    "shape": {"cuboid": {"edges": [0.08, 0.01, 0.01]}}, "motion": {"free": {}}}],
                "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}}}
            });
            for (key, part) in more.as_object().expect("parts of a case") {
                parts[key] = part.clone();
            }
            errors(&parts, Path::new("."))
        };
        let sheet = |x: f64| {
            serde_json::json!({"walls": [{"name": "sheet", "material": "glass", "shape": {"polygon": [
                [x, 0.0, 0.0], [x, 0.1, 0.0], [x, 0.1, 0.1], [x, 0.0, 0.1]]}}]})
        };
        let post = |x: f64| {
            serde_json::json!({"structures": [{"name": "post", "material": "glass", "shape": {"box": {
                "from": [x, 0.048, 0.0], "to": [x + 0.002, 0.052, 0.1]}}}]})
        };
        for (parts, words) in [
            (sheet(0.08), "the wall `sheet` by 0.005 m"),
            (post(0.08), "the structure `post` by 0.005 m"),
        ] {
            let problems = beam(parts);
            assert_eq!(problems.len(), 1, "{words}: {problems:?}");
            assert!(problems[0].reason.contains(words), "{}", problems[0]);
        }
        // The end face of the beam lies in the wall, and the post stands behind it.
        assert_eq!(beam(sheet(0.09)), []);
        assert_eq!(beam(post(0.09)), []);
    }

    #[test]
    fn grains_do_not_grow_where_something_stands() {
        let growth = serde_json::json!({"material": "glass", "initial": {"growth": {
            "radii": {"uniform": {"min": 0.004, "max": 0.005}}, "amount": {"number": 1000},
            "seed": 1, "box": {"from": [0, 0, 0.02], "to": [0.1, 0.1, 0.1]}
        }}});
        let words = |mut parts: serde_json::Value| {
            parts["grains"] = growth.clone();
            let problems = errors(&parts, Path::new("."));
            problems.iter().map(ToString::to_string).collect::<String>()
        };
        let ball = |z: f64| {
            serde_json::json!({"bodies": [{"name": "ball", "material": "glass", "motion": {"fixed": {}},
                "shape": {"sphere": {"radius": 0.005}}, "position": [0.05, 0.05, z]}]})
        };
        assert_eq!(words(ball(0.01)), "");
        assert!(words(ball(0.06)).contains("grains grow at the position of the body `ball`"));
        let plane = |z: f64| {
            serde_json::json!({"walls": [{"name": "sheet", "material": "glass",
                "shape": {"plane": {"point": [0, 0, z], "normal": [0, 0, 1]}}}]})
        };
        assert_eq!(words(plane(0.02)), "");
        assert!(words(plane(0.05)).contains("behind the wall `sheet`"));
    }
}
