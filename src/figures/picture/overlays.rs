//! Overlays of a picture: arrows of a vector of each grain, and the network of contacts.

use super::{Frame, Raster, Section, failed};
use crate::svg::{Svg, add_segment};
use base::error::Error;
use base::number::{real, whole};
use base::vector::norm;
use io::fields::read_column;
use std::path::Path;

/// Length of the longest arrow divided by the width of a panel.
const LONGEST: f64 = 0.08;
/// Length of arrows and lines below which they are omitted [pixels].
const SHORTEST: f64 = 0.5;
/// Widths of contact lines; the largest force has the last one [pixels].
const WIDTHS: [f64; 4] = [0.4, 1.0, 1.8, 3.0];

/// Vector of each grain.
pub(super) struct Arrows {
    pub(super) vectors: Vec<[f64; 3]>,
    pub(super) quantity: String,
    pub(super) units: String,
}

impl Arrows {
    pub(super) fn read(path: &Path, quantity: &str) -> Result<Self, Error> {
        let column = read_column(path, quantity).map_err(|e| Error::Io(e.to_string()))?;
        if column.shape.get(1) != Some(&3) {
            return Err(failed(
                path,
                format!("{quantity} is not a vector of the grains"),
            ));
        }
        Ok(Self {
            vectors: column.values.as_chunks::<3>().0.to_vec(),
            quantity: quantity.to_owned(),
            units: column.units.unwrap_or_default(),
        })
    }

    pub(super) fn longest(&self) -> f64 {
        let lengths = self.vectors.iter().map(|v| norm(*v));
        lengths.filter(|l| l.is_finite()).fold(0.0, f64::max)
    }

    /// Returns the arrows of grains at these positions as one path; `longest` is the vector with the longest arrow.
    pub(super) fn draw(
        &self,
        positions: &[[f64; 3]],
        longest: f64,
        frame: &Frame,
        raster: &Raster,
    ) -> String {
        let mut path = String::new();
        let pixels = LONGEST * real(raster.width) / longest;
        for (p, v) in positions.iter().zip(&self.vectors) {
            let [x, y] = raster.pixel_of(frame, *p);
            let [right, up] = frame.project(*v);
            let (dx, dy) = (pixels * right, -pixels * up);
            let size = dx.hypot(dy);
            if !(longest > 0.0 && size.is_finite() && size > SHORTEST) {
                continue;
            }
            // Head of the arrow: two strokes, a third of the arrow and at most five pixels long.
            let head = (size / 3.0).min(5.0) / size;
            let (tx, ty) = (x + dx, y + dy);
            add_segment(&mut path, [[x, y], [tx, ty]]);
            for side in [-0.5, 0.5] {
                let back = [tx - head * (dx + side * dy), ty - head * (dy - side * dx)];
                add_segment(&mut path, [[tx, ty], back]);
            }
        }
        let mut svg = Svg::default();
        svg.line(&path, "black", 0.8, "");
        svg.elements()
    }
}

/// Contacts as lines between centres, or from a centre to a wall.
pub(super) struct Network {
    ends: Vec<[[f64; 3]; 2]>,
    /// Normal contact forces; negative in tension.
    forces: Vec<f64>,
    pub(super) units: String,
}

impl Network {
    pub(super) fn read(path: &Path) -> Result<Self, Error> {
        let read = |name: &str| read_column(path, name).map_err(|e| Error::Io(e.to_string()));
        let points = read("position")?.values;
        let points = points.as_chunks::<3>().0;
        let named = read("/VTKHDF/Lines/Connectivity")?.values;
        let ends: Option<Vec<[[f64; 3]; 2]>> = (named.as_chunks::<2>().0.iter())
            .map(|[a, b]| Some([*points.get(whole(*a))?, *points.get(whole(*b))?]))
            .collect();
        let forces = read("normal_force")?;
        match ends {
            Some(ends) if ends.len() == forces.values.len() => Ok(Self {
                ends,
                forces: forces.values,
                units: forces.units.unwrap_or_default(),
            }),
            _ => Err(failed(path, "refers to ends that it does not contain")),
        }
    }

    /// Selects the contacts closer to a section than half their length, in the axes of the section.
    pub(super) fn cut(&mut self, section: Section) {
        let [right, up] = section.plane();
        let away = |p: &[f64; 3]| p[section.axis] - section.at;
        let near: Vec<bool> = (self.ends.iter())
            .map(|[a, b]| {
                let size = norm(std::array::from_fn(|axis| a[axis] - b[axis]));
                away(a) * away(b) <= 0.0 || away(a).abs().min(away(b).abs()) < 0.5 * size
            })
            .collect();
        let mut keep = near.iter();
        self.forces.retain(|_| *keep.next().unwrap_or(&false));
        let mut keep = near.iter();
        self.ends.retain(|_| *keep.next().unwrap_or(&false));
        for ends in &mut self.ends {
            *ends = ends.map(|p| [p[right], p[up], 0.0]);
        }
    }

    pub(super) fn largest(&self) -> f64 {
        let sizes = self.forces.iter().map(|f| f.abs());
        sizes.filter(|f| f.is_finite()).fold(0.0, f64::max)
    }

    /// Returns the contact lines, compression in black and tension in red, wider for larger forces.
    pub(super) fn draw(&self, largest: f64, frame: &Frame, raster: &Raster) -> String {
        let mut paths = [const { [const { String::new() }; WIDTHS.len()] }; 2];
        for ([a, b], force) in self.ends.iter().zip(&self.forces) {
            if !(largest > 0.0 && force.is_finite() && *force != 0.0) {
                continue;
            }
            let class = whole(force.abs() / largest * real(WIDTHS.len())).min(WIDTHS.len() - 1);
            let ends = [*a, *b].map(|end| raster.pixel_of(frame, end));
            add_segment(&mut paths[usize::from(*force < 0.0)][class], ends);
        }
        let mut svg = Svg::default();
        for (paths, colour) in paths.iter().zip(["black", "#d62728"]) {
            for (path, width) in paths.iter().zip(WIDTHS) {
                svg.line(path, colour, width, "");
            }
        }
        svg.elements()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(scene: &super::super::Scene) -> (Frame, Raster) {
        let frame = Frame::new(std::slice::from_ref(scene), super::super::ViewDirection::Z);
        let raster = Raster::new(&frame, 200);
        (frame, raster)
    }

    /// Checks ten by ten metres on 200 pixels: the longest arrow has 16 pixels, one of half its length eight, and one
    /// of a thousandth of a pixel is omitted.
    #[test]
    fn arrows_are_as_long_as_their_vectors() {
        let scene = super::super::tests::square();
        let (frame, raster) = ball(&scene);
        let arrows = Arrows {
            vectors: vec![[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.001, 0.0, 0.0]],
            quantity: "displacement".into(),
            units: "m".into(),
        };
        assert!((arrows.longest() - 2.0).abs() < 1e-12);
        let text = arrows.draw(&[[5.0, 5.0, 0.0]; 3], 2.0, &frame, &raster);
        assert!(text.contains("M100.0 100.0L116.0 100.0"), "{text}");
        assert!(text.contains("M100.0 100.0L100.0 92.0"), "{text}");
        assert_eq!(text.matches('M').count(), 2 * 3);
    }

    #[test]
    fn contacts_near_a_section_are_lines_of_their_force() {
        let mut network = Network {
            ends: vec![
                [[1.0, 4.8, 2.0], [2.0, 5.3, 2.0]],
                [[1.0, 7.0, 2.0], [2.0, 7.0, 2.0]],
                [[3.0, 5.2, 4.0], [3.0, 5.2, 5.0]],
            ],
            forces: vec![4.0, 9.0, -0.5],
            units: "N".into(),
        };
        network.cut(Section { axis: 1, at: 5.0 });
        assert_eq!(network.forces, [4.0, -0.5]);
        assert_eq!(network.ends[1], [[3.0, 4.0, 0.0], [3.0, 5.0, 0.0]]);
        let scene = super::super::tests::square();
        let (frame, raster) = ball(&scene);
        let text = network.draw(network.largest(), &frame, &raster);
        assert!(
            text.contains(
                "d=\"M20.0 160.0L40.0 160.0\" fill=\"none\" stroke=\"black\" stroke-width=\"3\""
            ),
            "{text}"
        );
        assert!(
            text.contains("stroke=\"#d62728\" stroke-width=\"0.4\""),
            "{text}"
        );
    }
}
