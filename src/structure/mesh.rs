//! Signed distance of a triangulated surface, and the parts of a line inside it.
//!
//! The nearest triangle is found in a tree of boxes. The sign is that of the angle-weighted pseudo-normal at the
//! nearest point, which is right at faces, edges and vertices of a closed surface (J. A. Baerentzen, H. Aanaes,
//! IEEE Trans. Vis. Comput. Graph. 11 (2005) 243). For shells that may intersect or touch each other the sign is
//! that of the winding number ([`crossings`]): a point is inside if it is inside at least one of them. An open
//! surface has a distance without a sign.
//!
//! Triangles are wound consistently, and shells that are inside out are reversed ([`shells`]).

mod crossings;
mod shells;

use super::{Point, cross, dot, minus, norm, plus, times};
use crossings::Line;
use shells::Shells;
use std::collections::{HashMap, HashSet};

/// Depth of the midpoint of a part of a line, relative to the length of the line, above which the part is inside.
const INSIDE_DEPTH: f64 = 1e-9;

/// Maximum number of triangles of a leaf of the tree.
const LEAF: usize = 4;

/// Triangles with shared vertices, in a tree of boxes.
#[derive(Debug)]
pub struct TriangleMesh {
    vertices: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    /// Normals of each triangle: of its face, of its edges from each corner to the next, and at its corners.
    normals: Vec<[Point; 7]>,
    nodes: Vec<Node>,
    extent: [Point; 2],
    open_edges: usize,
    /// `true` if shells may intersect or touch each other.
    crossed: bool,
}

/// Box of the tree with its triangles, or with two child boxes from `first` on.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Point,
    high: Point,
    first: usize,
    /// Number of triangles of a leaf; 0 for a branch.
    count: usize,
}

impl Node {
    /// Returns the square of the distance of a point from the box.
    fn squared(&self, at: Point) -> f64 {
        (0..3)
            .map(|a| (self.low[a] - at[a]).max(at[a] - self.high[a]).max(0.0))
            .map(|d| d * d)
            .sum()
    }
}

/// Point of a triangle.
#[derive(Clone, Copy)]
struct Foot {
    /// Squared distance.
    squared: f64,
    point: Point,
    /// Index of the normal there.
    feature: usize,
}

/// Returns the nearest point of a triangle.
fn nearest(at: Point, [a, b, c]: [Point; 3]) -> Foot {
    // Voronoi regions as in C. Ericson, Real-Time Collision Detection (2005), 5.1.5.
    let (ab, ac, ap) = (minus(b, a), minus(c, a), minus(at, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    let result = |point: Point, feature: usize| {
        let gap = minus(at, point);
        Foot {
            squared: dot(gap, gap),
            point,
            feature,
        }
    };
    if d1 <= 0.0 && d2 <= 0.0 {
        return result(a, 4);
    }
    let bp = minus(at, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return result(b, 5);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return result(plus(a, times(ab, d1 / (d1 - d3))), 1);
    }
    let cp = minus(at, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return result(c, 6);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return result(plus(a, times(ac, d2 / (d2 - d6))), 3);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return result(plus(b, times(minus(c, b), t)), 2);
    }
    let sum = va + vb + vc;
    let foot = plus(a, plus(times(ab, vb / sum), times(ac, vc / sum)));
    result(foot, 0)
}

impl TriangleMesh {
    /// Merges the corners of triangles \[m\] that lie closer than 1e-7 of the extent, and winds the triangles
    /// consistently. Triangles without area are dropped, and so are duplicates.
    ///
    /// # Errors
    /// If no triangle remains, or if the surface is not orientable.
    pub fn new(corners: &[[Point; 3]]) -> Result<Self, String> {
        let (vertices, mut triangles) = shared(corners);
        triangles.retain(|t| {
            let [a, b, c] = t.map(|k| vertices[k as usize]);
            let longest = dot(minus(b, a), minus(b, a)).max(dot(minus(c, a), minus(c, a)));
            norm(cross(minus(b, a), minus(c, a))) > 1e-10 * longest
        });
        if triangles.is_empty() {
            return Err("the file contains no triangle with an area above 0".into());
        }
        remove_duplicates(&mut triangles);
        let shells = shells::wind(&mut triangles)?;
        if shells.open_edges == 0 {
            shells::turn_outward(&shells, &vertices, &mut triangles);
        }
        let mut mesh = Self {
            extent: extent_of(&vertices, &triangles),
            crossed: shells.open_edges == 0 && may_cross(&shells, &vertices, &triangles),
            vertices,
            triangles,
            normals: Vec::new(),
            nodes: Vec::new(),
            open_edges: shells.open_edges,
        };
        mesh.build_tree();
        mesh.compute_normals();
        Ok(mesh)
    }

    /// Returns the number of edges with only one triangle; 0 for a closed surface.
    #[must_use]
    pub fn open_edges(&self) -> usize {
        self.open_edges
    }

    /// Returns the volume inside a closed surface \[m3\].
    #[must_use]
    pub fn volume(&self) -> f64 {
        let base = self.vertices[0];
        let of = |k: usize| {
            let [a, b, c] = self.corners(k).map(|at| minus(at, base));
            dot(a, cross(b, c)) / 6.0
        };
        (0..self.triangles.len()).map(of).sum()
    }

    /// Returns the bounding box.
    #[must_use]
    pub fn extent(&self) -> [Point; 2] {
        self.extent
    }

    /// Returns the triangles, oriented outwards.
    pub fn triangles(&self) -> impl Iterator<Item = [Point; 3]> + '_ {
        (0..self.triangles.len()).map(|k| self.corners(k))
    }

    fn corners(&self, k: usize) -> [Point; 3] {
        self.triangles[k].map(|v| self.vertices[v as usize])
    }

    /// Returns the distance of a point; negative inside a closed surface.
    #[must_use]
    pub fn distance(&self, at: Point) -> f64 {
        let mut best = Foot {
            squared: f64::INFINITY,
            point: [0.0; 3],
            feature: 0,
        };
        let mut holder = 0;
        let mut stack = vec![(0, self.nodes[0].squared(at))];
        while let Some((place, squared)) = stack.pop() {
            if squared >= best.squared {
                continue;
            }
            let node = self.nodes[place];
            if node.count == 0 {
                let children = [node.first, node.first + 1];
                let mut pair = children.map(|child| (child, self.nodes[child].squared(at)));
                // The nearer box is searched first.
                if pair[0].1 < pair[1].1 {
                    pair.swap(0, 1);
                }
                stack.extend(pair);
                continue;
            }
            for k in node.first..node.first + node.count {
                let found = nearest(at, self.corners(k));
                if found.squared < best.squared {
                    (best, holder) = (found, k);
                }
            }
        }
        let distance = best.squared.sqrt();
        let inside = if self.crossed {
            self.winding(at) > 0
        } else {
            self.open_edges == 0
                && dot(minus(at, best.point), self.normals[holder][best.feature]) < 0.0
        };
        if inside { -distance } else { distance }
    }

    /// Returns the winding number of the surface around a point.
    fn winding(&self, at: Point) -> i32 {
        let [low, high] = self.extent;
        let size = norm(minus(high, low));
        let mut found = Vec::new();
        self.crossings(&Line::new(at, [size, 0.0, 0.0], size), &mut found);
        found.iter().map(|(_, sign)| sign).sum()
    }

    /// Adds the crossings of a line beyond its start to `found`.
    fn crossings(&self, line: &Line, found: &mut Vec<(f64, i32)>) {
        let mut stack = vec![0];
        while let Some(place) = stack.pop() {
            let node = self.nodes[place];
            if !line.meets(&node.low, &node.high) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
                continue;
            }
            let triangles = node.first..node.first + node.count;
            let crossings = triangles.filter_map(|k| line.crossing(&self.corners(k)));
            found.extend(crossings.filter(|(place, _)| *place > 0.0));
        }
    }

    /// Adds the parts of the line from `from` by `along` inside a closed surface to `found`, as fractions of its
    /// length between 0 and 1, disjoint and ascending.
    pub fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        let length = norm(along);
        let distance = self.distance(from);
        if length <= 0.0 || distance.abs() > length * (1.0 + INSIDE_DEPTH) {
            if distance < 0.0 {
                found.push([0.0, 1.0]);
            }
            return;
        }
        let [low, high] = self.extent;
        let mut crossings = Vec::new();
        let line = Line::new(from, along, norm(minus(high, low)));
        self.crossings(&line, &mut crossings);
        crossings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        // A point is inside if the line beyond it leaves the solid more often than it enters.
        let mut winding: i32 = crossings.iter().map(|(_, sign)| sign).sum();
        let mut entered = (winding > 0).then_some(0.0);
        let mut add = |first: f64, last: f64| {
            let middle = plus(from, times(along, 0.5 * (first + last)));
            if last > first && self.distance(middle) < -INSIDE_DEPTH * length {
                found.push([first, last]);
            }
        };
        for (place, sign) in crossings {
            if place >= 1.0 {
                break;
            }
            let before = winding;
            winding -= sign;
            if before <= 0 && winding > 0 {
                entered = Some(place);
            } else if before > 0
                && winding <= 0
                && let Some(first) = entered.take()
            {
                add(first, place);
            }
        }
        if let Some(first) = entered {
            add(first, 1.0);
        }
    }

    /// Sorts the triangles into a tree of boxes, each divided in half along its longest edge.
    fn build_tree(&mut self) {
        let middle = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| self.vertices[v as usize]);
            plus(a, plus(b, c))
        };
        let mut order: Vec<([u32; 3], Point)> =
            self.triangles.iter().map(|t| (*t, middle(t))).collect();
        let mut nodes = vec![Node {
            low: [0.0; 3],
            high: [0.0; 3],
            first: 0,
            count: 0,
        }];
        let mut open = vec![(0, 0..order.len())];
        while let Some((place, range)) = open.pop() {
            let part = &mut order[range.clone()];
            let ids: Vec<[u32; 3]> = part.iter().map(|(t, _)| *t).collect();
            let [low, high] = extent_of(&self.vertices, &ids);
            let mut node = Node {
                low,
                high,
                first: range.start,
                count: part.len(),
            };
            if part.len() > LEAF {
                let edge = |a: usize| high[a] - low[a];
                let axis = (0..3).max_by(|&a, &b| edge(a).total_cmp(&edge(b)));
                let axis = axis.unwrap_or(0);
                part.sort_by(|a, b| a.1[axis].total_cmp(&b.1[axis]));
                let half = range.start + part.len() / 2;
                (node.first, node.count) = (nodes.len(), 0);
                nodes.extend([node, node]);
                open.push((node.first, range.start..half));
                open.push((node.first + 1, half..range.end));
            }
            nodes[place] = node;
        }
        self.triangles = order.into_iter().map(|(t, _)| t).collect();
        self.nodes = nodes;
    }

    /// Computes the normals of faces, edges and vertices; those of vertices are weighted by the angles of their
    /// triangles.
    fn compute_normals(&mut self) {
        let mut edges: HashMap<(u32, u32), Point> = HashMap::new();
        let mut vertices = vec![[0.0; 3]; self.vertices.len()];
        let mut faces = Vec::with_capacity(self.triangles.len());
        for (k, t) in self.triangles.iter().enumerate() {
            let corners = self.corners(k);
            let [a, b, c] = corners;
            let normal = cross(minus(b, a), minus(c, a));
            let normal = times(normal, 1.0 / norm(normal));
            for k in 0..3 {
                let (from, to, last) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
                let (u, v) = (minus(to, from), minus(last, from));
                let angle = norm(cross(u, v)).atan2(dot(u, v));
                let vertex = &mut vertices[t[k] as usize];
                *vertex = plus(*vertex, times(normal, angle));
                let (low, high) = (t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3]));
                let edge = edges.entry((low, high)).or_insert([0.0; 3]);
                *edge = plus(*edge, normal);
            }
            faces.push(normal);
        }
        let edge = |a: u32, b: u32| {
            edges
                .get(&(a.min(b), a.max(b)))
                .copied()
                .unwrap_or([0.0; 3])
        };
        self.normals = (self.triangles.iter().zip(&faces))
            .map(|(&[a, b, c], face)| {
                let [x, y, z] = [a, b, c].map(|v| vertices[v as usize]);
                [*face, edge(a, b), edge(b, c), edge(c, a), x, y, z]
            })
            .collect();
    }
}

/// Removes duplicates of equal triangles, and both of two triangles with opposite orientation, which separate two
/// solids such as adjacent cubes.
fn remove_duplicates(triangles: &mut Vec<[u32; 3]>) {
    let sorted = |t: &[u32; 3]| {
        let mut corners = *t;
        corners.sort_unstable();
        corners
    };
    let mut counts: HashMap<[u32; 3], usize> = HashMap::new();
    for t in triangles.iter() {
        *counts.entry(sorted(t)).or_default() += 1;
    }
    if counts.len() == triangles.len() {
        return;
    }
    let alone: Vec<[u32; 3]> = (triangles.iter().copied())
        .filter(|t| counts[&sorted(t)] % 2 == 1)
        .collect();
    let mut edges: HashMap<[u32; 2], usize> = HashMap::new();
    for t in &alone {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let closed = !alone.is_empty() && edges.values().all(|count| count % 2 == 0);
    let mut known = HashSet::new();
    triangles.retain(|t| {
        let corners = sorted(t);
        (!closed || counts[&corners] % 2 == 1) && known.insert(corners)
    });
}

/// Returns `true` if the boxes of two shells overlap, or more than two triangles share an edge.
fn may_cross(shells: &Shells, vertices: &[Point], triangles: &[[u32; 3]]) -> bool {
    if shells.count == 1 {
        return shells.many_at_an_edge;
    }
    let mut boxes = vec![[[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]]; shells.count];
    for (t, &shell) in triangles.iter().zip(&shells.of) {
        for at in t.map(|v| vertices[v as usize]) {
            for (a, x) in at.into_iter().enumerate() {
                let [low, high] = &mut boxes[shell];
                (low[a], high[a]) = (low[a].min(x), high[a].max(x));
            }
        }
    }
    boxes.sort_by(|a, b| a[0][0].total_cmp(&b[0][0]));
    boxes.iter().enumerate().any(|(n, one)| {
        let after = boxes[n + 1..]
            .iter()
            .take_while(|other| other[0][0] <= one[1][0]);
        let mut meeting = after
            .filter(|other| (1..3).all(|a| other[0][a] <= one[1][a] && one[0][a] <= other[1][a]));
        meeting.next().is_some()
    })
}

fn extent_of(vertices: &[Point], triangles: &[[u32; 3]]) -> [Point; 2] {
    let mut extent = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for at in triangles.iter().flatten().map(|&v| vertices[v as usize]) {
        for a in 0..3 {
            extent[0][a] = extent[0][a].min(at[a]);
            extent[1][a] = extent[1][a].max(at[a]);
        }
    }
    extent
}

/// Merges equal corners; returns the vertices, and the triangles by their indices.
fn shared(corners: &[[Point; 3]]) -> (Vec<Point>, Vec<[u32; 3]>) {
    const MERGE: f64 = 1e-7;
    let all = corners.as_flattened();
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for at in all {
        for a in 0..3 {
            (low[a], high[a]) = (low[a].min(at[a]), high[a].max(at[a]));
        }
    }
    let near = (MERGE * norm(minus(high, low))).max(f64::MIN_POSITIVE);
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut vertices: Vec<Point> = Vec::new();
    let mut find = |at: &Point| {
        let cell = minus(*at, low).map(|x| base::number::floor_i64(x / near));
        let around = (0..27_i64).map(|k| {
            [
                cell[0] + k % 3 - 1,
                cell[1] + k / 3 % 3 - 1,
                cell[2] + k / 9 - 1,
            ]
        });
        for beside in around {
            let known = cells.get(&beside).into_iter().flatten();
            for &v in known {
                if norm(minus(vertices[v as usize], *at)) <= near {
                    return v;
                }
            }
        }
        let number = base::number::to_u32(vertices.len());
        vertices.push(*at);
        cells.entry(cell).or_default().push(number);
        number
    };
    let triangles = corners.iter().map(|t| [&t[0], &t[1], &t[2]].map(&mut find));
    let triangles = triangles.collect();
    (vertices, triangles)
}
