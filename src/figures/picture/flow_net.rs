//! Flow nets of plane steady seepage: equipotentials at equal drops of the head and streamlines at equal discharges,
//! with layers, structures and their names.
//!
//! The discharge between two streamlines is chosen so that the fields of the net are squares in uniform ground: it is
//! the drop of head times the mean conductivity, that of the gradients of both fields weighted by the steepness of the
//! head.

use super::faces::Faces;
use super::{failed, significant_digits};
use crate::svg::{self, Point, Svg, add_segment};
use base::error::Error;
use base::geometry::{Axis, Region};
use base::number::{real, whole};
use io::fields::read_column;
use serde_json::Value;
use std::path::Path;

/// Maximum number of streamlines.
const MAX_LINES: f64 = 60.0;

/// Both fields of a flow net at the centres of cells and at the ends of the grid.
pub(super) struct FlowNet {
    /// Coordinates of the points along each axis \[m\].
    nodes: [Vec<f64>; 2],
    head: Vec<f64>,
    stream: Vec<f64>,
    /// Pressure, if the ground drains.
    pressure: Option<Vec<f64>>,
    wet: Vec<bool>,
    /// `true` for each point if no structure intersects the square to its lower left.
    free: Vec<bool>,
}

/// Layer or box of the ground.
#[derive(Clone, Debug, PartialEq)]
struct ZoneBox {
    name: String,
    /// Lower corner \[m\].
    from: Point,
    /// Upper corner \[m\].
    to: Point,
}

/// Names and outlines of the ground, from the case of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Ground {
    /// Layers and boxes.
    zones: Vec<ZoneBox>,
    /// Polygons: name and corners \[m\].
    polygons: Vec<(String, Vec<Point>)>,
    /// Points of the surface of the ground \[m\].
    surface: Vec<Point>,
    structures: Vec<String>,
}

impl Ground {
    /// Reads the case of a run; without a case, the layers have no names.
    pub(super) fn read(run: &Path) -> Self {
        let text = io::plain::text(&run.join("case.json"), io::plain::LONGEST_CASE);
        let case: Value = text
            .ok()
            .and_then(|text| serde_json::from_str(&text).ok())
            .unwrap_or_default();
        let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
        let name = |value: &Value| value["name"].as_str().unwrap_or_default().to_owned();
        let zones = list(&case["fluid"]["darcy"]["zones"]);
        let zone = |zone: &Value| {
            let region = serde_json::from_value(zone["region"].clone()).ok();
            let [from, to] = extent(region?);
            Some(ZoneBox {
                name: name(zone),
                from,
                to,
            })
        };
        let polygon = |zone: &Value| {
            let points = serde_json::from_value(zone["polygon"]["points"].clone()).ok();
            Some((name(zone), points?))
        };
        Self {
            zones: zones.iter().filter_map(zone).collect(),
            polygons: zones.iter().filter_map(polygon).collect(),
            surface: serde_json::from_value(
                case["fluid"]["darcy"]["terrain"]["surface"]["points"].clone(),
            )
            .unwrap_or_default(),
            structures: list(&case["structures"]).iter().map(name).collect(),
        }
    }
}

/// Returns the corners of a region; infinite where it is unbounded.
fn extent(region: Region) -> [Point; 2] {
    match region {
        Region::Box(extent) => [extent.from, extent.to].map(|corner| {
            let [x, y, _] = corner.to_array();
            [x, y]
        }),
        Region::Layer(layer) => {
            let axis = layer.axis.map_or(1, Axis::index).min(1);
            let (mut from, mut to) = ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
            from[axis] = layer.from.unwrap_or(f64::NEG_INFINITY);
            to[axis] = layer.to.unwrap_or(f64::INFINITY);
            [from, to]
        }
    }
}

/// Returns the centres of cells between faces, and both ends.
fn nodes_between(faces: &[f64]) -> Vec<f64> {
    let ends = [faces[0], faces[faces.len() - 1]];
    let middles = faces.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
    std::iter::once(ends[0])
        .chain(middles)
        .chain(std::iter::once(ends[1]))
        .collect()
}

/// Levels of the lines of a flow net.
struct Levels {
    heads: Vec<f64>,
    streams: Vec<f64>,
    drop: f64,
    tube: f64,
}

impl FlowNet {
    /// Reads the fields of an output, and the structures in the ground.
    pub(super) fn read(path: &Path, structures: Option<&Faces>) -> Result<Self, Error> {
        let image = io::image::open(path)
            .map_err(|_| failed(path, "is not an image with origin and spacing"))?;
        let (origin, spacing) = (image.origin, image.spacing);
        let read = |name: &str| {
            read_column(path, name).map_err(|_| {
                failed(
                    path,
                    format!(
                        "does not contain {name}, which a flow net needs: write \"fields\": [\"velocity\", \
                         \"head\", \"stream_function\"] in output.fluid"
                    ),
                )
            })
        };
        let (head, stream) = (read("head")?, read("stream_function")?);
        let [1, rows, columns] = head.shape[..3.min(head.shape.len())] else {
            return Err(failed(path, "is not a plane flow"));
        };
        let drains = read_column(path, "saturation").is_ok();
        let pressure = drains.then(|| read_column(path, "pressure").ok()).flatten();
        let cells = [columns, rows];
        let wet: Vec<bool> = head.values.iter().map(|h| h.is_finite()).collect();
        let field = |values: &[f64]| extended(values, &wet, cells);
        let nodes = [0, 1].map(|a| {
            if let Some(faces) = &image.faces {
                return nodes_between(&faces[a]);
            }
            let at = |k: f64| origin[a] + k * spacing[a];
            let middles = (0..cells[a]).map(|k| at(real(k) + 0.5));
            let ends = std::iter::once(at(0.0)).chain(middles);
            ends.chain(std::iter::once(at(real(cells[a])))).collect()
        });
        let mut net = Self {
            head: field(&head.values),
            stream: field(&stream.values),
            pressure: pressure.map(|pressure| field(&pressure.values)),
            wet: (0..(columns + 2) * (rows + 2))
                .map(|k| wet[inner(k, cells)])
                .collect(),
            free: Vec::new(),
            nodes,
        };
        net.free = net.uncut(&structures.map(edges).unwrap_or_default());
        Ok(net)
    }

    /// Returns `true` for the points whose square to the lower left no edge intersects.
    fn uncut(&self, edges: &[[Point; 2]]) -> Vec<bool> {
        let width = self.nodes[0].len();
        let point = |k: usize| [self.nodes[0][k % width], self.nodes[1][k / width]];
        let open = |corners: [usize; 4]| {
            let apart = |n: usize| {
                let (a, b) = (point(corners[n]), point(corners[(n + 1) % 4]));
                edges.iter().any(|edge| crosses([a, b], *edge))
            };
            !(0..4).any(apart)
        };
        let free = |k: usize| {
            let inside = !k.is_multiple_of(width) && k >= width;
            inside && open([k - width - 1, k - width, k, k - 1])
        };
        (0..self.wet.len()).map(free).collect()
    }

    /// Returns `true` if a point is in saturated ground.
    fn counts(&self, k: usize) -> bool {
        self.wet[k]
            && self
                .pressure
                .as_ref()
                .is_none_or(|pressure| pressure[k] >= 0.0)
    }

    /// Returns the levels of a flow net with this number of head drops; `None` without flow.
    fn levels(&self, drops: u16) -> Option<Levels> {
        let range = |field: &[f64]| {
            let points = (0..field.len()).filter(|&k| self.counts(k));
            points.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], k| {
                [low.min(field[k]), high.max(field[k])]
            })
        };
        let ([low, high], [least, most]) = (range(&self.head), range(&self.stream));
        let drop = (high - low) / f64::from(drops);
        let [width, height] = [self.nodes[0].len(), self.nodes[1].len()];
        let (mut products, mut squares) = (0.0, 0.0);
        for j in 1..height {
            for i in 1..width {
                let k = j * width + i;
                let known = [k, k - 1, k - width].into_iter().all(|k| self.counts(k));
                if !known || !self.free[k] {
                    continue;
                }
                let [x, y] = [
                    self.nodes[0][i] - self.nodes[0][i - 1],
                    self.nodes[1][j] - self.nodes[1][j - 1],
                ];
                let slope = |f: &[f64]| ((f[k] - f[k - 1]) / x).hypot((f[k] - f[k - width]) / y);
                let (steep, flow) = (slope(&self.head), slope(&self.stream));
                products += steep * flow * x * y;
                squares += steep * steep * x * y;
            }
        }
        let tube = (drop * products / squares).max((most - least) / MAX_LINES);
        if !(drop > 0.0 && tube > 0.0 && tube.is_finite()) {
            return None;
        }
        let tubes = whole(((most - least) / tube).floor());
        Some(Levels {
            heads: (1..drops).map(|k| low + f64::from(k) * drop).collect(),
            // The first and the last streamline are ends of the ground.
            streams: (1..=tubes)
                .map(|k| least + real(k) * tube)
                .filter(|level| most - level > 1e-6 * (most - least))
                .collect(),
            drop,
            tube,
        })
    }

    /// Returns a text with the drop of head and the discharge between two lines of the flow net.
    pub(super) fn key(&self, drops: u16) -> String {
        self.levels(drops).map_or_else(String::new, |levels| {
            format!(
                "flow net: {} m of head between equipotentials, {} m2/s between streamlines",
                significant_digits(levels.drop, 3),
                significant_digits(levels.tube, 3)
            )
        })
    }

    /// Returns the segments of the contour line of a field, each in a square of four points.
    fn contour(
        &self,
        field: &[f64],
        level: f64,
        shown: &dyn Fn([usize; 4]) -> bool,
    ) -> Vec<[Point; 2]> {
        let [width, height] = [self.nodes[0].len(), self.nodes[1].len()];
        let mut pieces = Vec::new();
        for j in 1..height {
            for i in 1..width {
                let k = j * width + i;
                let corners = [k - width - 1, k - width, k, k - 1];
                if !shown(corners) {
                    continue;
                }
                let places = [(i - 1, j - 1), (i, j - 1), (i, j), (i - 1, j)]
                    .map(|(i, j)| [self.nodes[0][i], self.nodes[1][j]]);
                let above = corners.map(|k| field[k] > level);
                let mut ends: Vec<Point> = Vec::new();
                for n in 0..4 {
                    let next = (n + 1) % 4;
                    if above[n] != above[next] {
                        let (a, b) = (field[corners[n]], field[corners[next]]);
                        let t = (level - a) / (b - a);
                        ends.push(
                            [0, 1].map(|x| places[n][x] + t * (places[next][x] - places[n][x])),
                        );
                    }
                }
                match ends[..] {
                    [a, b] => pieces.push([a, b]),
                    [a, b, c, d] => {
                        // At a saddle, the mean decides which corners are connected.
                        let mean = 0.25 * corners.iter().map(|&k| field[k]).sum::<f64>();
                        if (mean > level) == above[0] {
                            pieces.extend([[a, b], [c, d]]);
                        } else {
                            pieces.extend([[d, a], [b, c]]);
                        }
                    }
                    _ => {}
                }
            }
        }
        pieces
    }

    /// Returns the flow net as SVG; `place` maps a point \[m\] to the picture.
    pub(super) fn draw(
        &self,
        drops: u16,
        ground: &Ground,
        structures: Option<&Faces>,
        place: impl Fn(Point) -> Point,
    ) -> String {
        let Some(levels) = self.levels(drops) else {
            return String::new();
        };
        let wet = |corners: [usize; 4]| {
            self.free[corners[2]] && corners.into_iter().all(|k| self.counts(k))
        };
        let mut svg = Svg::default();
        svg.put(format_args!("<g fill=\"none\" stroke-linecap=\"round\">"));
        let mut line = |pieces: &[[Point; 2]], colour: &str, width: f64| {
            let mut path = String::new();
            for ends in pieces {
                add_segment(&mut path, ends.map(&place));
            }
            if !path.is_empty() {
                svg.put(format_args!(
                    "<path d=\"{path}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>"
                ));
            }
        };
        for level in &levels.streams {
            line(&self.contour(&self.stream, *level, &wet), "#1f4e79", 0.9);
        }
        let mut labels = Svg::default();
        for level in &levels.heads {
            let pieces = self.contour(&self.head, *level, &wet);
            line(&pieces, "#a11", 0.9);
            if let Some([at, _]) = pieces.get(pieces.len() / 2) {
                let [x, y] = place(*at);
                label(
                    &mut labels,
                    [x + 2.0, y],
                    &significant_digits(*level, 4),
                    10,
                );
            }
        }
        if let Some(pressure) = &self.pressure {
            let known = |corners: [usize; 4]| {
                self.free[corners[2]] && corners.into_iter().all(|k| self.wet[k])
            };
            line(&self.contour(pressure, 0.0, &known), "#0a58ca", 2.0);
        }
        svg.put(format_args!("</g>"));
        svg.add(&labels.elements());
        self.names(&mut svg, ground, structures, &place);
        svg.elements()
    }

    /// Writes outlines and names of layers and names of structures.
    fn names(
        &self,
        svg: &mut Svg,
        ground: &Ground,
        structures: Option<&Faces>,
        place: &impl Fn(Point) -> Point,
    ) {
        let end = |a: usize| {
            let nodes = &self.nodes[a];
            [nodes[0], nodes[nodes.len() - 1]]
        };
        let ends = [end(0), end(1)];
        for ZoneBox { name, from, to } in &ground.zones {
            let low = [0, 1].map(|a: usize| from[a].max(ends[a][0]));
            let high = [0, 1].map(|a: usize| to[a].min(ends[a][1]));
            let ([x0, y1], [x1, y0]) = (place(low), place(high));
            svg.put(format_args!(
                "<rect x=\"{x0:.1}\" y=\"{y0:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"none\" stroke=\"#555\" \
                 stroke-dasharray=\"6 4\"/>",
                x1 - x0,
                y1 - y0
            ));
            label(svg, [x0 + 6.0, y0 + 15.0], name, 12);
        }
        for (name, corners) in &ground.polygons {
            svg.put(format_args!(
                "<polygon points=\"{}\" fill=\"none\" stroke=\"#555\" stroke-dasharray=\"6 4\"/>",
                svg::points(corners.iter().map(|point| place(*point)))
            ));
            let count = real(corners.len().max(1));
            let middle = [0, 1].map(|a: usize| corners.iter().map(|p| p[a]).sum::<f64>() / count);
            label(svg, place(middle), name, 12);
        }
        if !ground.surface.is_empty() {
            let inside = |[x, y]: &Point| {
                place([
                    x.clamp(ends[0][0], ends[0][1]),
                    y.clamp(ends[1][0], ends[1][1]),
                ])
            };
            svg.put(format_args!(
                "<polyline points=\"{}\" fill=\"none\" stroke=\"#6b4b2a\" stroke-width=\"1.5\"/>",
                svg::points(ground.surface.iter().map(inside))
            ));
        }
        for (n, name) in ground.structures.iter().enumerate() {
            if let Some([x, y]) = structures.and_then(|faces| middle(faces, n)) {
                label(svg, place([x, y]), name, 12);
            }
        }
    }
}

/// Writes a label with a white rim, readable on lines.
fn label(svg: &mut Svg, [x, y]: Point, words: &str, size: u32) {
    // The rim is a text of its own: converters do not know the attribute `paint-order`.
    for paint in ["stroke=\"white\" stroke-width=\"3\"", "fill=\"#222\""] {
        let place = [x, y].map(|at| format!("{at:.1}"));
        svg.words(place, &format!(" font-size=\"{size}\" {paint}"), words);
    }
}

/// Returns the index of the cell at a point of the extended grid; at the ends the index of the adjacent cell.
fn inner(k: usize, [columns, rows]: [usize; 2]) -> usize {
    let near = |place: usize, cells: usize| place.saturating_sub(1).min(cells - 1);
    let width = columns + 2;
    near(k / width, rows) * columns + near(k % width, columns)
}

/// Returns a field at the centres of cells and, extrapolated linearly, at the ends of the grid.
fn extended(values: &[f64], wet: &[bool], cells: [usize; 2]) -> Vec<f64> {
    let [columns, rows] = cells;
    let width = columns + 2;
    (0..width * (rows + 2))
        .map(|k| {
            let own = inner(k, cells);
            let mut value = values[own];
            for (place, cells, stride) in [(k % width, columns, 1), (k / width, rows, columns)] {
                let next = if place == 0 && cells > 1 {
                    own + stride
                } else if place == cells + 1 && cells > 1 {
                    own - stride
                } else {
                    continue;
                };
                if wet[own] && wet[next] {
                    value += 0.5 * (values[own] - values[next]);
                }
            }
            value
        })
        .collect()
}

/// Returns the edges of the faces of structures in the plane.
fn edges(faces: &Faces) -> Vec<[Point; 2]> {
    let mut all = Vec::new();
    for corners in faces.outlines() {
        for (n, corner) in corners.iter().enumerate() {
            let next = corners[(n + 1) % corners.len()];
            all.push([[corner[0], corner[1]], [next[0], next[1]]]);
        }
    }
    all
}

/// Returns the centre of the faces of a structure; `None` without faces.
fn middle(faces: &Faces, structure: usize) -> Option<Point> {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for (corners, value) in faces.outlines().zip(&faces.values) {
        if (value - real(structure)).abs() < 0.5 {
            for corner in corners {
                for a in 0..2 {
                    (low[a], high[a]) = (low[a].min(corner[a]), high[a].max(corner[a]));
                }
            }
        }
    }
    (low[0] <= high[0]).then(|| [0, 1].map(|a: usize| f64::midpoint(low[a], high[a])))
}

/// Returns `true` if two line segments intersect.
fn crosses([a, b]: [Point; 2], [c, d]: [Point; 2]) -> bool {
    let side = |p: Point, q: Point, r: Point| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the flow net of a flow along x with a head that falls by 1 m over a length of 4 m, in 8 by 4 cells
    /// of 0.5 m.
    fn uniform() -> FlowNet {
        let cells = [8, 4];
        let centres =
            || (0..32_usize).map(|k| (0.5 * real(k % 8) + 0.25, 0.5 * real(k / 8) + 0.25));
        let wet = vec![true; 32];
        let head: Vec<f64> = centres().map(|(x, _)| 1.0 - x / 4.0).collect();
        let stream: Vec<f64> = centres().map(|(_, y)| 3e-5 * y / 4.0).collect();
        let nodes = cells.map(|n| {
            let middles = (0..n).map(|k| 0.5 * real(k) + 0.25);
            let ends = std::iter::once(0.0).chain(middles);
            ends.chain(std::iter::once(0.5 * real(n))).collect()
        });
        FlowNet {
            head: extended(&head, &wet, cells),
            stream: extended(&stream, &wet, cells),
            pressure: None,
            wet: vec![true; 60],
            free: (0..60).map(|k| k % 10 > 0 && k > 9).collect(),
            nodes,
        }
    }

    #[test]
    fn a_net_of_a_uniform_flow_is_of_squares() {
        let net = uniform();
        let levels = net.levels(8).unwrap();
        // Drops of 1/8 m over 0.5 m; the discharge through a height of 0.5 m.
        assert!((levels.drop - 0.125).abs() < 1e-12);
        assert!((levels.tube - 3e-5 / 8.0).abs() < 1e-16, "{}", levels.tube);
        assert_eq!((levels.heads.len(), levels.streams.len()), (7, 3));
        let all = |_: [usize; 4]| true;
        for (n, level) in levels.heads.iter().enumerate() {
            let x = 4.0 - 0.5 * real(n + 1);
            let pieces = net.contour(&net.head, *level, &all);
            assert_eq!(pieces.len(), 5);
            assert!(pieces.iter().flatten().all(|p| (p[0] - x).abs() < 1e-9));
        }
        assert!(net.key(8).contains("0.125 m of head"), "{}", net.key(8));
        let text = net.draw(8, &Ground::default(), None, |p| p);
        // Each label has a rim of its own.
        assert_eq!(text.matches("fill=\"#222\"").count(), 7);
        assert_eq!(text.matches("stroke=\"white\"").count(), 7);
    }

    #[test]
    fn lines_across_a_sheet_differ_from_lines_next_to_it() {
        let sheet = [[1.0, 0.0], [1.0, 1.0]];
        assert!(crosses([[0.5, 0.5], [1.5, 0.6]], sheet));
        assert!(!crosses([[0.5, 1.5], [1.5, 1.6]], sheet));
    }

    #[test]
    fn a_layer_without_ends_reaches_those_of_the_ground() {
        let layer = r#"{"layer": {"to": 2}}"#;
        let [from, to] = extent(serde_json::from_str(layer).unwrap());
        assert_eq!((from[1], to), (f64::NEG_INFINITY, [f64::INFINITY, 2.0]));
    }
}
