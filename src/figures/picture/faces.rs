//! Faces of blocks in a picture: plane convex polygons with their edges, with hidden surfaces removed.

use super::section::Line;
use super::{Frame, Raster, Section, dot, failed, magnitudes, real};
use base::error::Error;
use base::number::whole;
use io::fields::read_column;
use std::collections::BTreeSet;
use std::path::Path;

/// Faces of all blocks at one time.
pub(super) struct Faces {
    pub(super) points: Vec<[f64; 3]>,
    /// Corners of each face, counter-clockwise seen from outside.
    corners: Vec<Vec<usize>>,
    /// Values for the colours of the faces.
    pub(super) values: Vec<f64>,
    pub(super) quantity: String,
    pub(super) units: String,
    /// Ids of the blocks.
    pub(super) ids: BTreeSet<i64>,
}

impl Faces {
    /// Returns the faces of an output, coloured by a column.
    pub(super) fn read(path: &Path, quantity: &str) -> Result<Self, Error> {
        let read = |name: &str| read_column(path, name).map_err(|e| Error::Io(e.to_string()));
        let points = read("position")?.values;
        let points: Vec<[f64; 3]> = points.as_chunks::<3>().0.to_vec();
        let named = read("/VTKHDF/Polygons/Connectivity")?.values;
        let starts = read("/VTKHDF/Polygons/Offsets")?.values;
        let face = |ends: &[f64]| {
            let corners = named.get(whole(ends[0])..whole(ends[1]))?;
            let corners = corners.iter().map(|&corner| whole(corner));
            corners
                .map(|c| (c < points.len()).then_some(c))
                .collect::<Option<Vec<usize>>>()
        };
        let corners: Option<Vec<Vec<usize>>> = starts.windows(2).map(face).collect();
        let Some(corners) = corners else {
            return Err(failed(path, "refers to corners that it does not contain"));
        };
        let column = read(quantity)?;
        Ok(Self {
            values: magnitudes(&column, corners.len()),
            quantity: quantity.to_owned(),
            units: column.units.unwrap_or_default(),
            ids: read("id")?.values.iter().map(|&id| id_of(id)).collect(),
            points,
            corners,
        })
    }

    /// Reads the walls that exist at a time, with their positions: each face moves with its velocity.
    pub(super) fn walls(path: &Path, time: f64) -> Result<Self, Error> {
        let mut walls = Self::read(path, "wall")?;
        let read = read_column(path, "velocity").map_err(|e| Error::Io(e.to_string()))?;
        let velocities = read.values.as_chunks::<3>().0;
        for (corners, velocity) in walls.corners.iter().zip(velocities) {
            for &corner in corners {
                let moved = walls.points[corner].iter_mut().zip(velocity);
                moved.for_each(|(x, v)| *x += v * time);
            }
        }
        // Runs of earlier versions have no times of walls.
        let times = |name: &str| read_column(path, name).map(|column| column.values);
        if let (Ok(from), Ok(until)) = (times("from"), times("until")) {
            let exists = |k: usize| {
                from.get(k).is_none_or(|from| time >= *from)
                    && until.get(k).is_none_or(|until| time < *until)
            };
            let kept = (0..walls.corners.len()).filter(|&k| exists(k));
            let kept: Vec<usize> = kept.collect();
            walls.values = kept.iter().map(|&k| walls.values[k]).collect();
            walls.corners = kept.iter().map(|&k| walls.corners[k].clone()).collect();
        }
        Ok(walls)
    }

    /// Returns faces with these corners, without values.
    #[cfg(test)]
    pub(super) fn from_corners(faces: &[Vec<[f64; 3]>]) -> Self {
        let mut points = Vec::new();
        let corners = faces.iter().map(|face| {
            let first = points.len();
            points.extend(face);
            (first..points.len()).collect()
        });
        let corners: Vec<Vec<usize>> = corners.collect();
        Self {
            values: vec![0.0; corners.len()],
            quantity: "wall".into(),
            units: "-".into(),
            ids: BTreeSet::new(),
            points,
            corners,
        }
    }

    /// Returns the corners of each face.
    pub(super) fn outlines(&self) -> impl Iterator<Item = Vec<[f64; 3]>> + '_ {
        let points = |corners: &Vec<usize>| corners.iter().map(|&c| self.points[c]).collect();
        self.corners.iter().map(points)
    }

    /// Returns the lines in which a section intersects the faces.
    pub(super) fn cut(&self, section: Section) -> Vec<Line> {
        let lines = self.corners.iter().filter_map(|corners| {
            let corners: Vec<[f64; 3]> = corners.iter().map(|&c| self.points[c]).collect();
            section.line(&corners)
        });
        lines.collect()
    }

    /// Paints the faces whose fronts are towards the viewer; `colour` returns the colour of a value.
    pub(super) fn paint(
        &self,
        raster: &mut Raster,
        frame: &Frame,
        colour: impl Fn(f64) -> [f64; 3],
    ) {
        for (corners, &value) in self.corners.iter().zip(&self.values) {
            let corners: Vec<[f64; 3]> = corners.iter().map(|&c| self.points[c]).collect();
            raster.face(frame, &corners, colour(value));
        }
    }
}

/// Returns the id of a block from its number in a file.
#[expect(
    clippy::cast_possible_truncation,
    reason = "ids are whole numbers below 2^53"
)]
pub(super) fn id_of(number: f64) -> i64 {
    number as i64
}

/// Returns twice the vector area of a polygon.
fn twice_area(corners: &[[f64; 3]]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for k in 2..corners.len() {
        let [a, b] = [k - 1, k].map(|n| -> [f64; 3] {
            std::array::from_fn(|axis| corners[n][axis] - corners[0][axis])
        });
        for axis in 0..3 {
            let (p, q) = ((axis + 1) % 3, (axis + 2) % 3);
            sum[axis] += a[p] * b[q] - a[q] * b[p];
        }
    }
    sum
}

impl Raster {
    /// Draws a convex polygon, darker within a pixel of its edges; nothing if its back is towards the viewer.
    fn face(&mut self, frame: &Frame, corners: &[[f64; 3]], colour: [f64; 3]) {
        self.face_pixels(frame, corners, |raster, pixel| {
            let n = pixel.place;
            if pixel.depth > raster.depth[n] {
                raster.depth[n] = pixel.depth;
                let edge = if pixel.inside < raster.pixel {
                    0.6
                } else {
                    1.0
                };
                raster.colours[n] = colour.map(|c| c * pixel.light * edge);
            }
        });
    }

    /// Calls `visit` with each pixel of a convex polygon; with none if its back is towards the viewer.
    pub(super) fn face_pixels(
        &mut self,
        frame: &Frame,
        corners: &[[f64; 3]],
        mut visit: impl FnMut(&mut Self, &FacePixel),
    ) {
        let Some(normal) = unit_normal(corners) else {
            return;
        };
        let normal = [frame.right, frame.up, frame.near].map(|axis| dot(normal, axis));
        if normal[2] <= 1e-6 {
            return;
        }
        let light = 0.35 + 0.65 * dot(normal, [-0.4, 0.5, 0.768]).max(0.0);
        let at: Vec<[f64; 2]> = corners.iter().map(|&p| frame.project(p)).collect();
        let [low, high] = [f64::min, f64::max].map(|of| {
            let start = at[0];
            at.iter()
                .fold(start, |m, p| [of(m[0], p[0]), of(m[1], p[1])])
        });
        let span = |from: f64, to: f64, count: usize| {
            let from = whole((from / self.pixel - 0.5).floor().max(0.0));
            let to = whole((to / self.pixel + 0.5).ceil().max(0.0));
            from.min(count)..to.min(count)
        };
        let columns = span(low[0] - frame.low[0], high[0] - frame.low[0], self.width);
        let rows = span(frame.high[1] - high[1], frame.high[1] - low[1], self.height);
        let away = dot(corners[0], frame.near);
        // A sheet thinner than a pixel lies between the centres of pixels and would be invisible.
        let count = real(at.len());
        let centre = [0, 1].map(|axis| at.iter().map(|p| p[axis]).sum::<f64>() / count);
        let margin = (0.5 * self.pixel - clearance(&at, centre).max(0.0)).max(0.0);
        for row in rows {
            for column in columns.clone() {
                let here = self.middle(frame, column, row);
                let inside = clearance(&at, here);
                if inside < -margin {
                    continue;
                }
                let [x, y] = [here[0] - at[0][0], here[1] - at[0][1]];
                let pixel = FacePixel {
                    place: row * self.width + column,
                    depth: away - (normal[0] * x + normal[1] * y) / normal[2],
                    inside,
                    light,
                };
                visit(self, &pixel);
            }
        }
    }

    /// Mixes a colour into a pixel; `part` is its opacity.
    pub(super) fn blend(&mut self, place: usize, colour: [f64; 3], part: f64) {
        let below = &mut self.colours[place];
        *below = std::array::from_fn(|c| below[c] + part * (colour[c] - below[c]));
    }
}

/// Pixel of a face.
pub(super) struct FacePixel {
    /// Index of the pixel in the raster.
    pub(super) place: usize,
    /// Coordinate of the face towards the viewer \[m\].
    pub(super) depth: f64,
    /// Distance from the nearest edge in the frame \[m\]; negative outside.
    pub(super) inside: f64,
    /// Brightness of the face.
    pub(super) light: f64,
}

/// Returns the unit normal of a polygon, towards a viewer who sees it counter-clockwise; `None` without an area.
pub(super) fn unit_normal(corners: &[[f64; 3]]) -> Option<[f64; 3]> {
    let area = twice_area(corners);
    let size = dot(area, area).sqrt();
    (size > 0.0 && size.is_finite()).then(|| area.map(|a| a / size))
}

/// Returns the distance of a point inside a counter-clockwise polygon from its edges; negative outside.
fn clearance(corners: &[[f64; 2]], [x, y]: [f64; 2]) -> f64 {
    let edges = (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()]));
    edges
        .map(|(a, b)| {
            let along = [b[0] - a[0], b[1] - a[1]];
            let length = along[0].hypot(along[1]);
            if length > 0.0 {
                (along[0] * (y - a[1]) - along[1] * (x - a[0])) / length
            } else {
                f64::INFINITY
            }
        })
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::super::{PAPER, Scene, ViewDirection};
    use super::*;

    /// Checks a unit cube with a triangle above a quarter of it: seen from above, the top of the cube is visible except
    /// where the triangle hides it.
    #[test]
    fn a_face_covers_its_pixels_and_the_nearer_one_wins() {
        let faces = Faces {
            points: vec![
                [0.0, 0.0, 1.0],
                [1.0, 0.0, 1.0],
                [1.0, 1.0, 1.0],
                [0.0, 1.0, 1.0],
                [0.0, 0.0, 2.0],
                [1.0, 0.0, 2.0],
                [0.0, 0.5, 2.0],
            ],
            corners: vec![vec![4, 5, 6], vec![0, 1, 2, 3], vec![3, 2, 1, 0]],
            values: vec![1.0, 0.0, 0.5],
            quantity: "velocity".into(),
            units: "m/s".into(),
            ids: BTreeSet::new(),
        };
        let scenes = [Scene {
            faces: Some(faces),
            ..Scene::default()
        }];
        let frame = Frame::new(&scenes, ViewDirection::Z);
        assert_eq!((frame.low, frame.high), ([0.0; 2], [1.0; 2]));
        let mut raster = Raster::new(&frame, 720);
        let colour = |value: f64| [200.0 * value, 200.0 * (1.0 - value), 0.0];
        if let Some(faces) = &scenes[0].faces {
            faces.paint(&mut raster, &frame, colour);
        }
        let red = raster.colours.iter().filter(|c| c[0] > 0.0).count();
        let part = real(red) / real(raster.colours.len());
        assert!((part - 0.25).abs() < 3e-3, "{part}");
        assert!(raster.colours.iter().all(|c| *c != PAPER));
    }
}
