//! Outlines of blocks, structures and walls in a section.
//!
//! A plane intersects a convex face in one line, directed by the orientation of the face. Solids are filled at
//! pixels with a nonzero winding number of the lines of all their faces, so that overlapping solids form one area.
//! Walls, which need not be closed, are drawn as lines.

use super::STONE;
use super::faces::Faces;
use super::raster::{Frame, Raster};
use super::section::{Line, Section};
use crate::svg::{Svg, add_segment};
use base::number::{real, whole};

/// Colour of blocks.
const BLOCK: [f64; 3] = [205.0, 198.0, 188.0];

/// Intersection lines of a section with all solids.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Cuts {
    pub(super) blocks: Vec<Line>,
    pub(super) structures: Vec<Line>,
    pub(super) walls: Vec<Line>,
    /// Corners of the domain in the plane; `None` if they are not known.
    pub(super) frame: Option<[[f64; 2]; 2]>,
}

impl Cuts {
    /// Returns the lines in which a section intersects blocks, structures and walls.
    pub(super) fn new(section: Section, faces: [Option<&Faces>; 3]) -> Self {
        let lines = |faces: Option<&Faces>| faces.map_or_else(Vec::new, |f| f.cut(section));
        let [blocks, structures, walls] = faces.map(lines);
        Self {
            blocks,
            structures,
            walls,
            frame: None,
        }
    }

    /// Extends a frame by the domain, or by all lines if it is not known.
    pub(super) fn extend_frame(&self, frame: &mut Frame) {
        if let Some(corners) = self.frame {
            for [x, y] in corners {
                frame.include([x, y, 0.0], 0.0);
            }
            return;
        }
        let all = [&self.blocks, &self.structures, &self.walls];
        for end in all.into_iter().flatten().flatten() {
            frame.include([end[0], end[1], 0.0], 0.0);
        }
    }

    /// Paints structures and blocks.
    pub(super) fn paint(&self, raster: &mut Raster, frame: &Frame) {
        fill(raster, frame, &self.structures, STONE);
        fill(raster, frame, &self.blocks, BLOCK);
    }

    /// Returns the outlines as vector graphics.
    pub(super) fn draw(&self, frame: &Frame, raster: &Raster) -> String {
        let mut svg = Svg::default();
        for (lines, width) in [
            (&self.blocks, 0.6),
            (&self.structures, 0.8),
            (&self.walls, 1.6),
        ] {
            let mut path = String::new();
            for line in lines {
                let ends = line.map(|[x, y]| raster.pixel_of(frame, [x, y, 0.0]));
                add_segment(&mut path, ends);
            }
            svg.line(&path, "#333", width, "");
        }
        svg.elements()
    }
}

/// Colours the pixels with a nonzero winding number of the lines.
fn fill(raster: &mut Raster, frame: &Frame, lines: &[Line], colour: [f64; 3]) {
    let mut crossings: Vec<(f64, i32)> = Vec::new();
    for row in 0..raster.height {
        let level = raster.middle(frame, 0, row)[1];
        crossings.clear();
        for [a, b] in lines {
            if (a[1] > level) == (b[1] > level) {
                continue;
            }
            let x = a[0] + (level - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
            crossings.push((x, if b[1] > a[1] { 1 } else { -1 }));
        }
        crossings.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut winds = 0;
        for pair in crossings.windows(2) {
            winds += pair[0].1;
            if winds == 0 {
                continue;
            }
            let column = |x: f64| {
                let place = (x - frame.low[0]) / raster.pixel + 0.5;
                whole(place.clamp(0.0, real(raster.width)))
            };
            let from = row * raster.width;
            raster.colours[from + column(pair[0].0)..from + column(pair[1].0)].fill(colour);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{PAPER, Scene, ViewDirection, Water};
    use super::*;

    /// Returns the faces of a box, counter-clockwise seen from outside.
    fn faces(low: [f64; 3], high: [f64; 3]) -> Vec<Vec<[f64; 3]>> {
        let corner = |k: usize| -> [f64; 3] {
            std::array::from_fn(|a| if k >> a & 1 == 0 { low[a] } else { high[a] })
        };
        let sides = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        sides.iter().map(|side| side.map(corner).to_vec()).collect()
    }

    fn cut(section: Section, bodies: &[Vec<Vec<[f64; 3]>>]) -> Vec<Line> {
        let faces = bodies.iter().flatten();
        faces.filter_map(|face| section.line(face)).collect()
    }

    /// Boxes of 2 by 3 and 4 by 1 m overlap in 1 by 1 m: 9 of 30 m2. A box next to the plane is not filled.
    #[test]
    fn overlapping_boxes_are_filled_once() {
        let section = Section { axis: 1, at: 0.5 };
        let boxes = [
            faces([0.0, 0.0, 0.0], [2.0, 1.0, 3.0]),
            faces([1.0, -1.0, 1.0], [5.0, 2.0, 2.0]),
            faces([0.0, 0.6, 0.0], [6.0, 1.0, 5.0]),
        ];
        let structures = cut(section, &boxes);
        assert_eq!(structures.len(), 8);
        let cuts = Cuts {
            structures,
            ..Cuts::default()
        };
        let scenes = [Scene {
            cuts: Some(cuts),
            ..Scene::default()
        }];
        let frame = Frame::new(&scenes, ViewDirection::Z);
        assert_eq!((frame.low, frame.high), ([0.0; 2], [5.0, 3.0]));
        let mut raster = Raster::new(&frame, 500);
        let cuts = scenes[0].cuts.as_ref().unwrap();
        cuts.paint(&mut raster, &frame);
        let filled = raster.colours.iter().filter(|c| **c != PAPER).count();
        let part = real(filled) / real(raster.colours.len());
        assert!((part - 9.0 / 15.0).abs() < 2e-3, "{part}");
        assert_eq!(cuts.draw(&frame, &raster).matches('M').count(), 8);
    }

    /// Checks that the frame of a section is the domain, of water and of grains alone, whether the solids reach beyond
    /// it or fill a part of it, and that water is painted inside its grid only.
    #[test]
    fn the_frame_of_a_section_is_the_domain() {
        let section = Section { axis: 1, at: 0.5 };
        let water = || Water {
            cells: [4, 2, 3],
            origin: [0.0; 3],
            spacing: [0.5; 3],
            values: vec![1.0; 24],
            solid: vec![false; 24],
            flow: None,
            units: "m/s".into(),
        };
        let deep = faces([0.5, -1.0, -1.0], [1.0, 2.0, 0.25]);
        let small = faces([0.5, 0.25, 0.5], [1.0, 0.75, 1.0]);
        for (body, watered, domain) in [
            (&deep, true, Some([2.0, 1.0, 1.5])),
            (&deep, true, None),
            (&deep, false, Some([2.0, 1.0, 1.5])),
            (&small, false, Some([2.0, 1.0, 1.5])),
        ] {
            let scene = Scene {
                water: watered.then(water),
                walls: Some(Faces::from_corners(body)),
                domain,
                ..Scene::default()
            };
            let scenes = [scene.cut(Some(section))];
            let frame = Frame::new(&scenes, ViewDirection::Z);
            assert_eq!((frame.low, frame.high), ([0.0; 2], [2.0, 1.5]));
        }
        let scenes = [Scene {
            water: Some(water()),
            ..Scene::default()
        }
        .cut(Some(section))];
        let mut frame = Frame::new(&scenes, ViewDirection::Z);
        frame.low[1] = -1.5;
        let mut raster = Raster::new(&frame, 100);
        raster.water(&frame, scenes[0].water.as_ref().unwrap(), [0.0, 1.0]);
        let painted = raster.colours.iter().filter(|c| **c != PAPER).count();
        let part = real(painted) / real(raster.colours.len());
        // One row more than half of the panel may be painted.
        assert!((0.5..0.52).contains(&part), "{part}");
    }

    /// Checks that a plane through corners intersects an octahedron in four lines, and that a plane along a face of a
    /// box gives the lines of the other faces or none.
    #[test]
    fn a_plane_through_corners_cuts_each_face_once() {
        let section = Section { axis: 2, at: 0.0 };
        let tips = |sign: f64| [0.0, 0.0, sign];
        let ring = [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, -1.0, 0.0],
        ];
        let octahedron: Vec<Vec<[f64; 3]>> = (0..4)
            .flat_map(|k| {
                let (a, b) = (ring[k], ring[(k + 1) % 4]);
                [vec![a, b, tips(1.0)], vec![b, a, tips(-1.0)]]
            })
            .collect();
        assert_eq!(cut(section, &[octahedron]).len(), 4);
        let below = faces([0.0; 3], [1.0; 3]);
        assert_eq!(
            cut(Section { axis: 2, at: 1.0 }, std::slice::from_ref(&below)).len(),
            4
        );
        assert_eq!(cut(Section { axis: 2, at: 0.0 }, &[below]).len(), 0);
    }
}
