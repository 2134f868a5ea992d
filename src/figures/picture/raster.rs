//! Frame of a panel and its pixels.

use super::faces::Faces;
use super::{PAPER, Scene, ViewDirection, Water, fraction_of_range, water_colour};
use base::error::Error;
use base::number::{real, whole};
use base::vector::dot;

/// Rectangle that a panel shows, and the directions of its axes.
pub(super) struct Frame {
    pub(super) right: [f64; 3],
    pub(super) up: [f64; 3],
    /// Direction towards the viewer.
    pub(super) near: [f64; 3],
    pub(super) low: [f64; 2],
    pub(super) high: [f64; 2],
}

impl Frame {
    pub(super) fn new(scenes: &[Scene], view: ViewDirection) -> Self {
        let flat = scenes.iter().all(|scene| {
            scene.faces.is_none()
                && scene.walls.is_none()
                && scene.grains.as_ref().is_none_or(|g| g.flat)
                && scene.water.as_ref().is_none_or(|w| w.cells[2] == 1)
        });
        let (right, up, near) = match view {
            _ if flat => ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
            ViewDirection::Z => ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
            ViewDirection::Y => ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]),
            ViewDirection::X => ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]),
            ViewDirection::Corner => {
                let (s, c) = (30.0_f64.to_radians().sin(), 30.0_f64.to_radians().cos());
                let (t, d) = (25.0_f64.to_radians().sin(), 25.0_f64.to_radians().cos());
                ([c, s, 0.0], [-t * s, t * c, d], [d * s, -d * c, t])
            }
        };
        let mut frame = Self {
            right,
            up,
            near,
            low: [f64::INFINITY; 2],
            high: [f64::NEG_INFINITY; 2],
        };
        for scene in scenes {
            // The frame of a section is the domain: solids, walls and grains may reach beyond it.
            if let Some(cuts) = scene.cuts.as_ref().filter(|cuts| cuts.frame.is_some()) {
                cuts.extend_frame(&mut frame);
                continue;
            }
            if let Some(water) = &scene.water {
                let ends = water.corners();
                for corner in 0..8 {
                    frame.include(std::array::from_fn(|a| ends[corner >> a & 1][a]), 0.0);
                }
            }
            if let Some(grains) = &scene.grains
                // The grid of the seepage may be smaller than the scene.
                && scene.water.as_ref().is_none_or(|water| water.cells[2] > 1)
            {
                for (&p, &r) in grains.positions.iter().zip(&grains.radii) {
                    frame.include(p, r);
                }
            }
            if let Some(cuts) = &scene.cuts {
                cuts.extend_frame(&mut frame);
            }
            for &p in scene.faces.iter().flat_map(|faces| &faces.points) {
                frame.include(p, 0.0);
            }
            for p in scene.walls.iter().flat_map(Faces::outlines).flatten() {
                frame.include(p, 0.0);
            }
        }
        frame
    }

    pub(super) fn project(&self, p: [f64; 3]) -> [f64; 2] {
        [dot(p, self.right), dot(p, self.up)]
    }

    pub(super) fn include(&mut self, p: [f64; 3], r: f64) {
        let at = self.project(p);
        for a in 0..2 {
            self.low[a] = self.low[a].min(at[a] - r);
            self.high[a] = self.high[a].max(at[a] + r);
        }
    }
}

/// Pixels of a panel, row by row from the upper left corner.
pub(super) struct Raster {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) colours: Vec<[f64; 3]>,
    pub(super) depth: Vec<f64>,
    /// Size of a pixel \[m\].
    pub(super) pixel: f64,
}

impl Raster {
    /// Returns a white raster, `most` pixels wide, or twice as high if the frame is narrower than that.
    pub(super) fn new(frame: &Frame, most: usize) -> Self {
        let size = [frame.high[0] - frame.low[0], frame.high[1] - frame.low[1]];
        let pixel = (size[0] / real(most)).max(size[1] / (2.0 * real(most)));
        let width = whole((size[0] / pixel).round()).clamp(1, most);
        let height = whole((size[1] / pixel).round()).clamp(1, 2 * most);
        Self {
            width,
            height,
            colours: vec![PAPER; width * height],
            depth: vec![f64::NEG_INFINITY; width * height],
            pixel,
        }
    }

    /// Returns the position of a point of the scene \[pixels from the upper left corner\].
    pub(super) fn pixel_of(&self, frame: &Frame, p: [f64; 3]) -> [f64; 2] {
        let [x, y] = frame.project(p);
        [
            (x - frame.low[0]) / self.pixel,
            (frame.high[1] - y) / self.pixel,
        ]
    }

    /// Returns the position of the centre of a pixel in the frame.
    pub(super) fn middle(&self, frame: &Frame, column: usize, row: usize) -> [f64; 2] {
        [
            frame.low[0] + (real(column) + 0.5) * self.pixel,
            frame.high[1] - (real(row) + 0.5) * self.pixel,
        ]
    }

    pub(super) fn water(&mut self, frame: &Frame, water: &Water, scale: [f64; 2]) {
        for row in 0..self.height {
            for column in 0..self.width {
                let at = self.middle(frame, column, row);
                // A crop may show more than the water. The last row may reach half a pixel beyond it.
                let outside = (0..2).any(|a| {
                    let beyond = water.origin[a] - at[a];
                    beyond.max(-beyond - real(water.cells[a]) * water.spacing[a]) > self.pixel
                });
                if outside {
                    continue;
                }
                let cell = [0, 1].map(|a| {
                    let k = ((at[a] - water.origin[a]) / water.spacing[a])
                        .floor()
                        .max(0.0);
                    whole(k).min(water.cells[a] - 1)
                });
                let n = cell[1] * water.cells[0] + cell[0];
                self.colours[row * self.width + column] = if water.solid[n] {
                    [225.0, 225.0, 225.0]
                } else {
                    water_colour(fraction_of_range(water.values[n], scale))
                };
            }
        }
    }

    pub(super) fn grain(
        &mut self,
        frame: &Frame,
        p: [f64; 3],
        r: f64,
        colour: [f64; 3],
        flat: bool,
    ) {
        let at = frame.project(p);
        let away = dot(p, frame.near);
        let span = |middle: f64, count: usize| {
            let from = ((middle - r) / self.pixel - 0.5).floor().max(0.0);
            let to = ((middle + r) / self.pixel + 0.5).ceil().max(0.0);
            whole(from).min(count)..whole(to).min(count)
        };
        let columns = span(at[0] - frame.low[0], self.width);
        for row in span(frame.high[1] - at[1], self.height) {
            for column in columns.clone() {
                let here = self.middle(frame, column, row);
                let d = [here[0] - at[0], here[1] - at[1]];
                let inside = r * r - d[0] * d[0] - d[1] * d[1];
                if inside < 0.0 {
                    continue;
                }
                let height = inside.sqrt();
                let n = row * self.width + column;
                if away + height <= self.depth[n] {
                    continue;
                }
                self.depth[n] = away + height;
                let light = if flat {
                    // The outline is about one pixel wide.
                    if height < (3.0 * r * self.pixel).sqrt() {
                        0.7
                    } else {
                        1.0
                    }
                } else {
                    let normal = [d[0] / r, d[1] / r, height / r];
                    0.35 + 0.65 * dot(normal, [-0.4, 0.5, 0.768]).max(0.0)
                };
                self.colours[n] = colour.map(|c| c * light);
            }
        }
    }

    pub(super) fn to_png(&self) -> Result<Vec<u8>, Error> {
        let wrong = |e: png::EncodingError| Error::Internal(format!("picture: {e}"));
        let mut bytes = Vec::new();
        let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        let mut encoder = png::Encoder::new(&mut bytes, side(self.width), side(self.height));
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header().map_err(wrong)?;
        let pixels: Vec<u8> = self.colours.iter().flat_map(|c| c.map(byte)).collect();
        writer.write_image_data(&pixels).map_err(wrong)?;
        writer.finish().map_err(wrong)?;
        Ok(bytes)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to a byte"
)]
pub(super) fn byte(c: f64) -> u8 {
    c.round().clamp(0.0, 255.0) as u8
}
