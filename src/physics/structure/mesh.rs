//! Signed distance of a triangulated surface.
//!
//! The nearest triangle is found in a tree of boxes. The sign is that of the angle-weighted pseudo-normal at the nearest point, which is
//! right at faces, edges and vertices of any closed surface (J. A. Baerentzen, H. Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005) 243).
//! An open surface has a distance without a sign.

use super::{Point, cross, dot, minus, norm, plus, times};
use std::collections::HashMap;

/// Triangles of a leaf of the tree.
const LEAF: usize = 4;

/// Triangles with shared vertices, in a tree.
#[derive(Debug)]
pub struct Mesh {
    vertices: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    /// Of each triangle: its face, its edges from each corner to the next, its corners.
    normals: Vec<[Point; 7]>,
    nodes: Vec<Node>,
    extent: [Point; 2],
    open_edges: usize,
}

/// A box of the tree with its triangles, or with two boxes from `first` on.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Point,
    high: Point,
    first: usize,
    /// Triangles of a leaf; 0 of a branch.
    count: usize,
}

impl Node {
    /// Square of the distance of a point from the box.
    fn squared(&self, at: Point) -> f64 {
        (0..3)
            .map(|a| (self.low[a] - at[a]).max(at[a] - self.high[a]).max(0.0))
            .map(|d| d * d)
            .sum()
    }
}

/// The nearest point of a triangle: its square distance, and which of the seven normals holds there.
fn nearest(at: Point, [a, b, c]: [Point; 3]) -> (f64, Point, usize) {
    // C. Ericson, Real-Time Collision Detection (2005), 5.1.5: the regions of Voronoi.
    let (ab, ac, ap) = (minus(b, a), minus(c, a), minus(at, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    let result = |foot: Point, feature: usize| {
        let gap = minus(at, foot);
        (dot(gap, gap), foot, feature)
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

impl Mesh {
    /// Joins the corners of triangles \[m\] that lie closer than 1e-7 of the extent. Triangles without an area are left out.
    ///
    /// # Errors
    /// A sentence where nothing is left, or where an edge has more than two triangles or runs the same way in both.
    pub fn new(corners: &[[Point; 3]]) -> Result<Self, String> {
        let (vertices, mut triangles) = shared(corners);
        triangles.retain(|t| {
            let [a, b, c] = t.map(|k| vertices[k as usize]);
            let longest = dot(minus(b, a), minus(b, a)).max(dot(minus(c, a), minus(c, a)));
            norm(cross(minus(b, a), minus(c, a))) > 1e-10 * longest
        });
        if triangles.is_empty() {
            return Err("the file holds no triangle with an area".into());
        }
        let mut edges: HashMap<(u32, u32), usize> = HashMap::new();
        for t in &triangles {
            for k in 0..3 {
                let count = edges.entry((t[k], t[(k + 1) % 3])).or_default();
                *count += 1;
                if *count > 1 {
                    return Err(
                        "two triangles run the same way along an edge: the surface is not oriented, or more than two triangles meet"
                            .into(),
                    );
                }
            }
        }
        let open_edges = edges.keys().filter(|(a, b)| !edges.contains_key(&(*b, *a)));
        let open_edges = open_edges.count();
        let mut mesh = Self {
            extent: extent_of(&vertices, &triangles),
            vertices,
            triangles,
            normals: Vec::new(),
            nodes: Vec::new(),
            open_edges,
        };
        if open_edges == 0 && mesh.volume() < 0.0 {
            // Inside out.
            mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        mesh.plant();
        mesh.weigh();
        Ok(mesh)
    }

    /// Edges that only one triangle has; 0 of a closed surface.
    #[must_use]
    pub fn open_edges(&self) -> usize {
        self.open_edges
    }

    /// Volume inside a closed surface \[m3\].
    #[must_use]
    pub fn volume(&self) -> f64 {
        let base = self.vertices[0];
        let of = |k: usize| {
            let [a, b, c] = self.corners(k).map(|at| minus(at, base));
            dot(a, cross(b, c)) / 6.0
        };
        (0..self.triangles.len()).map(of).sum()
    }

    /// The box that holds it.
    #[must_use]
    pub fn extent(&self) -> [Point; 2] {
        self.extent
    }

    /// The triangles, facing outwards.
    pub fn triangles(&self) -> impl Iterator<Item = [Point; 3]> + '_ {
        (0..self.triangles.len()).map(|k| self.corners(k))
    }

    fn corners(&self, k: usize) -> [Point; 3] {
        self.triangles[k].map(|v| self.vertices[v as usize])
    }

    /// Distance of a point; negative inside a closed surface.
    #[must_use]
    pub fn distance(&self, at: Point) -> f64 {
        let mut best = (f64::INFINITY, [0.0; 3], 0);
        let mut holder = 0;
        let mut stack = vec![(0, self.nodes[0].squared(at))];
        while let Some((place, squared)) = stack.pop() {
            if squared >= best.0 {
                continue;
            }
            let node = self.nodes[place];
            if node.count == 0 {
                let children = [node.first, node.first + 1];
                let mut pair = children.map(|child| (child, self.nodes[child].squared(at)));
                // The nearer one is looked at first.
                if pair[0].1 < pair[1].1 {
                    pair.swap(0, 1);
                }
                stack.extend(pair);
                continue;
            }
            for k in node.first..node.first + node.count {
                let found = nearest(at, self.corners(k));
                if found.0 < best.0 {
                    (best, holder) = (found, k);
                }
            }
        }
        let distance = best.0.sqrt();
        let side = dot(minus(at, best.1), self.normals[holder][best.2]);
        if self.open_edges == 0 && side < 0.0 {
            -distance
        } else {
            distance
        }
    }

    /// Orders the triangles by a tree that halves boxes along their longest edge.
    fn plant(&mut self) {
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

    /// Normals of faces, edges and vertices; those of vertices are weighted by the angles of the triangles there.
    fn weigh(&mut self) {
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

/// Vertices that corners share, and the triangles by them.
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
        let cell = minus(*at, low).map(|x| crate::number::floor_i64(x / near));
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
        let number = crate::number::to_u32(vertices.len());
        vertices.push(*at);
        cells.entry(cell).or_default().push(number);
        number
    };
    let triangles = corners.iter().map(|t| [&t[0], &t[1], &t[2]].map(&mut find));
    let triangles = triangles.collect();
    (vertices, triangles)
}
