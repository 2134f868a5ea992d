//! Edges of joints: junctions with other joints, and open edges.
//!
//! The edges of two joints meet where they run along each other and are no farther apart than the apertures of
//! both: the four joints round the edge of four blocks end half an aperture from the line in which their planes
//! meet. Edges that meet, directly or through others, share a line. The ends of their pieces divide the line into
//! intervals, and each interval that two or more joints have in common is a junction, a point without volume whose
//! discharges add up to zero. Pieces of edges that meet no other joint are open; water enters and leaves there if
//! the scene has water outside them. Under a lattice, whose cells know where water is, so are the pieces of a junction
//! next to a sector around its line that no block fills: below a block that stands on others with its edge above a
//! joint, and where joints cross at the surface of the rock. The head loss of the corner itself, of the order of the
//! aperture divided by the cell size, is neglected.

use crate::cells::{Cell, Side};
use crate::pairs::{Joint, PairLimits};
use crate::sets::root;
use base::number::real;
use nalgebra::{Vector2, Vector3};
use std::collections::BTreeMap;

/// Maximum distance of touching edges, divided by their length.
const TOUCHING: f64 = 1e-6;
/// Length of an interval, divided by that of its line, below which it is omitted.
const SHORT: f64 = 1e-9;

/// Half of a link: from the point of a cell to a piece of an edge of its joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Number of the joint.
    pub joint: usize,
    /// Number of the cell in the network.
    pub cell: usize,
    /// Start and end of the flow path, in the plane of the joint \[m\].
    pub path: [Vector2<f64>; 2],
    /// Width of the piece \[m\].
    pub width: f64,
    /// Outward direction of the joint, in space.
    pub outward: Vector3<f64>,
    /// Midpoint of the piece \[m\].
    pub middle: Vector3<f64>,
    /// `true` if other joints meet there.
    pub meets: bool,
}

/// Junction of two or more joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Junction {
    /// Position \[m\].
    pub position: Vector3<f64>,
    /// Pieces of edges that meet in the junction.
    pub pieces: Vec<Piece>,
}

/// Junctions and open pieces of edges.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ends {
    /// Junctions.
    pub junctions: Vec<Junction>,
    /// Pieces without another joint.
    pub open: Vec<Piece>,
}

/// Edge of a joint in space, with its pieces.
struct Edge {
    joint: usize,
    ends: [Vector3<f64>; 2],
    direction: Vector3<f64>,
    length: f64,
    /// Apertures at both ends \[m\].
    apertures: [f64; 2],
    outward: Vector2<f64>,
    /// Pieces of the edge: cell, start and end along the edge \[m\], and distance of the point of the cell from the
    /// edge \[m\].
    parts: Vec<(usize, [f64; 2], f64)>,
}

impl Edge {
    /// Returns the aperture at a position along the edge \[m\].
    fn aperture(&self, along: f64) -> f64 {
        let part = (along / self.length).clamp(0.0, 1.0);
        self.apertures[0] + (self.apertures[1] - self.apertures[0]) * part
    }

    fn position(&self, along: f64) -> Vector3<f64> {
        self.ends[0] + self.direction * along
    }

    /// Returns the coordinate of a point along the edge \[m\].
    fn along(&self, point: &Vector3<f64>) -> f64 {
        self.direction.dot(&(point - self.ends[0]))
    }

    /// Returns the distance \[m\] of another edge that runs along this one within the apertures of both; none if it
    /// does not. Half of an aperture counts if it is wider than a limit \[m\]: the edge of a joint lies in the middle
    /// between its faces, and the opposite edge of a neighbour may be only its aperture away.
    fn meets(&self, other: &Self, parallel: f64, limit: f64) -> Option<f64> {
        if self.direction.dot(&other.direction).abs() < parallel {
            return None;
        }
        let ends = other.ends.map(|end| self.along(&end));
        let from = ends[0].min(ends[1]).max(0.0);
        let to = ends[0].max(ends[1]).min(self.length);
        if to - from <= SHORT * self.length.max(other.length) {
            return None;
        }
        let along = 0.5 * (from + to);
        let middle = self.position(along);
        let there = other.along(&middle);
        let reach = |aperture: f64| {
            if aperture > limit {
                0.5 * aperture
            } else {
                aperture
            }
        };
        let reaches = reach(self.aperture(along)) + reach(other.aperture(there));
        let near = reaches + TOUCHING * self.length.max(other.length);
        let distance = (other.position(there) - middle).norm();
        (distance <= near).then_some(distance)
    }

    /// Returns `true` if the edge has an aperture above a limit \[m\].
    fn is_wide(&self, limit: f64) -> bool {
        self.apertures.iter().any(|aperture| *aperture > limit)
    }

    /// Returns the half link of a piece of the edge between two positions along the edge \[m\].
    fn piece(&self, joint: &Joint, cells: &[Cell], part: usize, [from, to]: [f64; 2]) -> Piece {
        let (cell, _, distance) = self.parts[part];
        let middle = self.position(0.5 * (from + to));
        let offset = middle - joint.origin;
        let flat = Vector2::new(joint.axes[0].dot(&offset), joint.axes[1].dot(&offset));
        debug_assert!(cells[cell].area > 0.0, "a cell without area");
        Piece {
            joint: self.joint,
            cell,
            path: [flat - self.outward * distance, flat],
            width: to - from,
            outward: joint.direction(&self.outward),
            middle,
            meets: false,
        }
    }
}

/// Finds junctions and open pieces of the edges of all joints. `cells` are the cells of the joints one after the other,
/// `firsts` the index of the first cell of each joint, and `residual` the smallest aperture \[m\].
#[must_use]
pub fn ends(
    joints: &[Joint],
    cells: &[Cell],
    firsts: &[usize],
    limits: &PairLimits,
    residual_aperture: f64,
) -> Ends {
    let edges = edges(joints, cells, firsts, residual_aperture);
    let groups = groups(&edges, limits);
    let mut found = Ends::default();
    for group in groups {
        divide(&group, &edges, (joints, cells), &mut found);
    }
    found
}

/// Returns the edges of all joints with pieces, in the order of joints and edges.
fn edges(joints: &[Joint], cells: &[Cell], firsts: &[usize], residual_aperture: f64) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (number, joint) in joints.iter().enumerate() {
        let own = firsts[number]..firsts[number + 1];
        for (from, to, edge) in joint.overlap.edges() {
            let length = (to - from).norm();
            let along = (to - from) / length;
            let outward = Vector2::new(along.y, -along.x);
            let mut parts = Vec::new();
            for cell in own.clone() {
                for (start, end, side) in cells[cell].outline.edges() {
                    if side == Side::Edge(edge) {
                        let span = [along.dot(&(start - from)), along.dot(&(end - from))];
                        let distance = outward.dot(&(from - cells[cell].point));
                        parts.push((cell, span, distance));
                    }
                }
            }
            parts.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
            edges.push(Edge {
                joint: number,
                ends: [joint.point(&from), joint.point(&to)],
                direction: joint.direction(&along),
                length,
                apertures: [from, to].map(|end| joint.gap.value(&end).max(residual_aperture)),
                outward,
                parts,
            });
        }
    }
    edges
}

/// Returns groups of edges on a common line, each in the order of the edges, in the order of their first edges.
fn groups(edges: &[Edge], limits: &PairLimits) -> Vec<Vec<usize>> {
    let parallel = limits.angle.cos();
    let mut parents: Vec<usize> = (0..edges.len()).collect();
    let widest = |edge: &Edge| edge.apertures[0].max(edge.apertures[1]);
    let most = edges.iter().map(widest).fold(0.0, f64::max);
    let longest = edges.iter().map(|edge| edge.length).fold(0.0, f64::max);
    let margin = 2.0 * most + TOUCHING * longest;
    let low = |edge: &Edge| edge.ends[0].inf(&edge.ends[1]);
    let high = |edge: &Edge| edge.ends[0].sup(&edge.ends[1]);
    let mut order: Vec<usize> = (0..edges.len()).collect();
    order.sort_by(|&a, &b| {
        let (one, other) = (low(&edges[a]).x, low(&edges[b]).x);
        one.total_cmp(&other).then(a.cmp(&b))
    });
    let mut met = Vec::new();
    for (at, &a) in order.iter().enumerate() {
        let reach = high(&edges[a]).add_scalar(margin);
        let from = low(&edges[a]).add_scalar(-margin);
        for &b in &order[at + 1..] {
            if low(&edges[b]).x > reach.x {
                break;
            }
            let apart =
                (1..3).any(|k| low(&edges[b])[k] > reach[k] || high(&edges[b])[k] < from[k]);
            if apart || edges[a].joint == edges[b].joint {
                continue;
            }
            if let Some(distance) = edges[a].meets(&edges[b], parallel, limits.distance) {
                met.push((a, b, distance));
            }
        }
    }
    // A wide joint reaches beyond the near end of a short neighbour to its far end, which does not meet it.
    let wide = |a: usize, b: usize| {
        let both = [&edges[a], &edges[b]];
        both.iter().any(|edge| edge.is_wide(limits.distance))
    };
    let mut nearest: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    for &(a, b, distance) in met.iter().filter(|(a, b, _)| wide(*a, *b)) {
        for key in [(a, edges[b].joint), (b, edges[a].joint)] {
            let least = nearest.entry(key).or_insert(distance);
            *least = least.min(distance);
        }
    }
    for (a, b, distance) in met {
        let tolerance = TOUCHING * longest;
        let is_nearest = |key: (usize, usize)| distance <= nearest[&key] + tolerance;
        if wide(a, b) && !(is_nearest((a, edges[b].joint)) && is_nearest((b, edges[a].joint))) {
            continue;
        }
        let (one, other) = (root(&mut parents, a), root(&mut parents, b));
        parents[one.max(other)] = one.min(other);
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); edges.len()];
    for edge in 0..edges.len() {
        let first = root(&mut parents, edge);
        groups[first].push(edge);
    }
    groups.retain(|group| !group.is_empty());
    groups
}

/// Returns the numbers of the pieces of a junction next to a sector around its line that no block fills: the joints at
/// both sides of a sector face different blocks.
fn beside_open_sectors(
    pieces: &[Piece],
    joints: &[Joint],
    line: &Vector3<f64>,
) -> impl Iterator<Item = usize> {
    // A joint extends from the line against its outward direction. Around the line, at growing angles, it has a block
    // behind it and one ahead of it.
    let first = -pieces[0].outward;
    let second = line.cross(&first);
    let mut around: Vec<(f64, usize, [usize; 2])> = Vec::new();
    for (number, piece) in pieces.iter().enumerate() {
        let into = -piece.outward;
        let joint = &joints[piece.joint];
        let mut blocks = joint.faces.map(|face| face.rock);
        if joint.normal.dot(&line.cross(&into)) < 0.0 {
            blocks.reverse();
        }
        let angle = second.dot(&into).atan2(first.dot(&into));
        around.push((angle, number, blocks));
    }
    around.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut beside = vec![false; pieces.len()];
    for (at, (_, number, [_, ahead])) in around.iter().enumerate() {
        let (_, next, [behind, _]) = around[(at + 1) % around.len()];
        if *ahead != behind {
            (beside[*number], beside[next]) = (true, true);
        }
    }
    let numbers = 0..pieces.len();
    numbers.filter(move |number| beside[*number])
}

/// Divides the line of a group of edges into intervals, and adds their junctions and open pieces.
fn divide(group: &[usize], edges: &[Edge], (joints, cells): (&[Joint], &[Cell]), to: &mut Ends) {
    let piece = |edge: usize, part: usize, span: [f64; 2]| {
        let edge = &edges[edge];
        edge.piece(&joints[edge.joint], cells, part, span)
    };
    if let &[alone] = group {
        let parts = edges[alone].parts.iter().enumerate();
        to.open
            .extend(parts.map(|(part, (_, span, _))| piece(alone, part, *span)));
        return;
    }
    // Positions along the line are measured along its first edge.
    let line = &edges[group[0]];
    let mut spans = Vec::new();
    for &edge in group {
        let own = &edges[edge];
        for (part, (_, span, _)) in own.parts.iter().enumerate() {
            let ends = span.map(|along| line.along(&own.position(along)));
            spans.push((ends[0].min(ends[1]), ends[0].max(ends[1]), edge, part));
        }
    }
    let mut breaks: Vec<f64> = spans.iter().flat_map(|span| [span.0, span.1]).collect();
    breaks.sort_by(f64::total_cmp);
    let least = SHORT * (breaks.last().unwrap_or(&0.0) - breaks.first().unwrap_or(&0.0));
    breaks.dedup_by(|next, kept| *next - *kept <= least);
    for ends in breaks.windows(2) {
        let middle = 0.5 * (ends[0] + ends[1]);
        let covering = spans
            .iter()
            .filter(|span| span.0 < middle && middle < span.1);
        let mut pieces: Vec<Piece> = covering
            .map(|&(.., edge, part)| {
                let own = &edges[edge];
                let along = [ends[0], ends[1]].map(|at| own.along(&line.position(at)));
                let along = [along[0].min(along[1]), along[0].max(along[1])];
                piece(edge, part, along)
            })
            .collect();
        if pieces.len() < 2 {
            to.open.extend(pieces);
            continue;
        }
        for piece in &mut pieces {
            piece.meets = true;
        }
        let beside = beside_open_sectors(&pieces, joints, &line.direction);
        to.open.extend(beside.map(|piece| pieces[piece].clone()));
        let middles: Vector3<f64> = pieces.iter().map(|piece| piece.middle).sum();
        to.junctions.push(Junction {
            position: middles / real(pieces.len()),
            pieces,
        });
    }
}
