//! Walls of a scene in space: translucent faces with their edges, so that they hide no grain.
//!
//! The faces and edges are drawn after everything else. A part behind grains, blocks or structures is not drawn. Edges
//! between facets that are nearly in one plane are left out, unless they are the outline that the viewer sees.

use super::faces::Faces;
use super::raster::{Frame, Raster};
use base::number::{real, whole};
use base::vector::dot;
use std::collections::BTreeMap;

/// Colour of walls and of their edges.
const WALL: [f64; 3] = [110.0, 130.0, 160.0];
const EDGE: [f64; 3] = [60.0, 70.0, 90.0];
/// Opacity of a face over paper and over what lies behind it, and of an edge.
const OVER_PAPER: f64 = 0.2;
const OVER_SOLIDS: f64 = 0.08;
const OF_EDGE: f64 = 0.8;
/// Cosine of the angle between two facets up to which their common edge is drawn: 20 degrees.
const SHARP: f64 = 0.94;

/// Edge by the bits of both ends, the smaller end first.
type EdgeKey = [[u64; 3]; 2];

/// Edge of a wall: its ends, and the unit normals of its facets.
struct Edge {
    ends: [[f64; 3]; 2],
    normals: Vec<[f64; 3]>,
}

impl Edge {
    /// Returns `true` if the edge is a border, a sharp edge or an outline for the viewer.
    fn is_drawn(&self, near: [f64; 3]) -> bool {
        let [a, b] = self.normals[..] else {
            return true;
        };
        let (front, back) = (dot(a, near), dot(b, near));
        dot(a, b) < SHARP || (front > 0.0) != (back > 0.0)
    }
}

/// Returns the edges of all faces, each once.
fn edges(faces: &Faces) -> BTreeMap<EdgeKey, Edge> {
    let mut all: BTreeMap<EdgeKey, Edge> = BTreeMap::new();
    for corners in faces.outlines() {
        let Some(normal) = super::faces::unit_normal(&corners) else {
            continue;
        };
        for (k, &from) in corners.iter().enumerate() {
            let to = corners[(k + 1) % corners.len()];
            // Zero has two signs; both are one place.
            let bits = |p: [f64; 3]| p.map(|x| (x + 0.0).to_bits());
            let mut key = [bits(from), bits(to)];
            key.sort_unstable();
            let ends = [from, to];
            let normals = Vec::new();
            let edge = all.entry(key).or_insert(Edge { ends, normals });
            edge.normals.push(normal);
        }
    }
    all
}

/// Draws walls over a panel.
pub(super) fn paint(walls: &Faces, raster: &mut Raster, frame: &Frame) {
    for mut corners in walls.outlines() {
        let Some(normal) = super::faces::unit_normal(&corners) else {
            continue;
        };
        if dot(normal, frame.near) < 0.0 {
            corners.reverse();
        }
        raster.face_pixels(frame, &corners, |raster, pixel| {
            let behind = raster.depth[pixel.place];
            if pixel.depth > behind && pixel.inside >= 0.0 {
                let free = behind == f64::NEG_INFINITY;
                let part = if free { OVER_PAPER } else { OVER_SOLIDS };
                raster.blend(pixel.place, WALL.map(|c| c * pixel.light), part);
            }
        });
    }
    for edge in edges(walls).values() {
        if edge.is_drawn(frame.near) {
            line(raster, frame, edge.ends);
        }
    }
}

/// Draws an edge where nothing lies in front of it.
fn line(raster: &mut Raster, frame: &Frame, [from, to]: [[f64; 3]; 2]) {
    let [a, b] = [from, to].map(|end| raster.pixel_of(frame, end));
    let length = (b[0] - a[0]).abs().max((b[1] - a[1]).abs());
    let longest = 8.0 * real(raster.width + raster.height);
    let steps = whole(length.ceil().clamp(1.0, longest));
    let [near, far] = [dot(from, frame.near), dot(to, frame.near)];
    let mut last = None;
    for step in 0..=steps {
        let part = real(step) / real(steps);
        let at = [0, 1].map(|axis| a[axis] + part * (b[axis] - a[axis]));
        // An edge on the frame belongs to the outermost pixels.
        let sides = [real(raster.width), real(raster.height)];
        if (0..2).any(|axis| !(-1.0..=sides[axis] + 1.0).contains(&at[axis])) {
            continue;
        }
        let column = whole(at[0].max(0.0)).min(raster.width - 1);
        let row = whole(at[1].max(0.0)).min(raster.height - 1);
        let place = row * raster.width + column;
        let depth = near + part * (far - near) + 1.5 * raster.pixel;
        if depth >= raster.depth[place] && last != Some(place) {
            raster.blend(place, EDGE, OF_EDGE);
            last = Some(place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Grains, PAPER, Scales, Scene, ViewDirection};
    use super::*;

    /// Returns two triangles that form the rectangle between two corners in a plane of constant z.
    fn rectangle([low, high]: [[f64; 2]; 2], z: f64) -> Vec<Vec<[f64; 3]>> {
        let at = |x: f64, y: f64| [x, y, z];
        let [a, b, c, d] = [
            at(low[0], low[1]),
            at(high[0], low[1]),
            at(high[0], high[1]),
            at(low[0], high[1]),
        ];
        vec![vec![a, b, c], vec![a, c, d]]
    }

    fn scene(grain: [f64; 3], walls: Vec<Vec<[f64; 3]>>) -> Scene {
        let grains = Grains {
            positions: vec![grain],
            radii: vec![1.0],
            values: Some(vec![0.0]),
            quantity: "velocity".into(),
            units: "m/s".into(),
            arrows: None,
            flat: false,
        };
        Scene {
            grains: Some(grains),
            walls: Some(Faces::from_corners(&walls)),
            ..Scene::default()
        }
    }

    fn panel(scenes: &[Scene]) -> (Frame, Raster) {
        let frame = Frame::new(scenes, ViewDirection::Z);
        let scales = Scales::new(scenes);
        let panel = super::super::Panel::new(&scenes[0], &scales, &frame, (400, 0));
        (frame, panel.raster)
    }

    /// Checks a ball of radius 1 above and below a square plate of 10 m: the frame contains the plate, the plate and
    /// its border are visible next to the ball, its diagonal is not, and the ball is visible in both cases.
    #[test]
    fn walls_in_space_are_drawn_and_hide_no_grain() {
        let plate = rectangle([[-5.0; 2], [5.0; 2]], 0.0);
        let mut balls = Vec::new();
        for height in [2.0, -2.0] {
            let scenes = [scene([0.0, 0.0, height], plate.clone())];
            let (frame, raster) = panel(&scenes);
            assert_eq!((frame.low, frame.high), ([-5.0; 2], [5.0; 2]));
            let at = |x: f64, y: f64| {
                let [column, row] = raster.pixel_of(&frame, [x, y, 0.0]).map(whole);
                raster.colours[row * raster.width + column]
            };
            let dark = |colour: [f64; 3]| colour.iter().sum::<f64>() < 400.0;
            assert!(
                at(3.0, 1.0) != PAPER && !dark(at(3.0, 1.0)),
                "{:?}",
                at(3.0, 1.0)
            );
            assert!(dark(at(4.99, 0.0)) && dark(at(0.0, -4.99)));
            assert!(!dark(at(3.01, 3.0)) && !dark(at(-3.0, -3.0)));
            balls.push(at(0.1, 0.1));
        }
        let apart = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).sum::<f64>();
        assert!(apart(balls[0], balls[1]) > 1.0, "{balls:?}");
        assert!(apart(balls[0], balls[1]) < 60.0, "{balls:?}");
    }
}
