//! Figures as SVG: axes, lines, points with error bars, bands and bounds.
//!
//! A [`Figure`] contains panels side by side; a [`Panel`] contains two axes and layers drawn in order. The text
//! is the same for the same data on any machine. Categories use the colours of Okabe and Ito ([`CATEGORY`]),
//! ordered values use viridis ([`sequential`]). Both are distinguishable for colour-blind readers and in grey.
//!
//! Labels may contain `_{sub}` and `^{super}`.
//!
//! The plots are drawn here and not by a crate, after two were tried on these figures. The coordinates of `plotters`
//! are whole pixels, lines are moved onto the edge of the axes where they leave it, a logarithmic axis below one
//! decade has no tick, and there is no legend outside the axes. `kuva` draws all but hollow points, rings and arrows
//! in a legend; it clamps logarithmic values below 1e-10 and linear ranges below 2e-16, so that units have to be taken
//! out before. With it this module was as long (859 lines against 883 without tests), and a build took 49 s of
//! processor time longer. Neither sets the subscripts c and d.

use crate::svg::{self, Label, Point, Svg};
use base::number::real;
use std::fmt::Write as _;

/// Colours of categories: black, blue, vermillion, green, purple, orange, sky, yellow (Okabe and Ito, 2008).
pub const CATEGORY: [&str; 8] = [
    "#222222", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442",
];

/// Returns the colour of entry `index` of `count` in an order, from dark violet to light green (after viridis, van der
/// Walt and Smith, SciPy 2015; the yellow end, unreadable on white, is left out).
#[must_use]
pub fn sequential(index: usize, count: usize) -> String {
    const STOPS: [[f64; 3]; 6] = [
        [68.0, 1.0, 84.0],
        [68.0, 57.0, 131.0],
        [49.0, 104.0, 142.0],
        [33.0, 145.0, 140.0],
        [53.0, 183.0, 121.0],
        [151.0, 204.0, 56.0],
    ];
    let share = if count > 1 {
        real(index) / real(count - 1)
    } else {
        0.0
    };
    let place = share.clamp(0.0, 1.0) * 5.0;
    let below = (0..5).rev().find(|&k| real(k) <= place).unwrap_or(0);
    let t = place - real(below);
    let mix = |c: usize| STOPS[below][c] * (1.0 - t) + STOPS[below + 1][c] * t;
    format!("rgb({:.0},{:.0},{:.0})", mix(0), mix(1), mix(2))
}
/// Mapping of values to an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisScale {
    /// Linear scale.
    Linear,
    /// Logarithmic scale; values that are not positive are not drawn.
    Log,
}

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct PlotAxis {
    /// The quantity, as `τ_{h}` or `eroded mass`.
    pub quantity: String,
    /// Unit; empty for none.
    pub unit: String,
    /// Mapping of values.
    pub scale: AxisScale,
    /// First and last value; `None` takes them from the data.
    pub range: Option<(f64, f64)>,
}

impl PlotAxis {
    /// Returns a linear axis that starts at zero if the data are not negative.
    #[must_use]
    pub fn linear(quantity: &str, unit: &str) -> Self {
        Self {
            quantity: quantity.to_owned(),
            unit: unit.to_owned(),
            scale: AxisScale::Linear,
            range: None,
        }
    }

    /// Returns a logarithmic axis.
    #[must_use]
    pub fn log(quantity: &str, unit: &str) -> Self {
        Self {
            scale: AxisScale::Log,
            ..Self::linear(quantity, unit)
        }
    }

    /// Returns the axis with a fixed range.
    #[must_use]
    pub fn with_range(self, low: f64, high: f64) -> Self {
        Self {
            range: Some((low, high)),
            ..self
        }
    }
}

/// Point with error bars, each given by its `(low, high)` ends; `None` without a bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Position along x.
    pub x: f64,
    /// Position along y.
    pub y: f64,
    /// Ends of the horizontal bar.
    pub x_bar: Option<(f64, f64)>,
    /// Ends of the vertical bar.
    pub y_bar: Option<(f64, f64)>,
}

impl Mark {
    /// Returns a point without bars.
    #[must_use]
    pub fn without_bars(x: f64, y: f64) -> Self {
        Self {
            x,
            y,
            x_bar: None,
            y_bar: None,
        }
    }
}

/// Symbol of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Filled disc.
    Filled,
    /// White disc with a rim.
    Hollow,
    /// Wide ring, through which underlying points are visible.
    Ring,
    /// Filled square: a point of a map.
    Square,
    /// White square with a rim.
    OpenSquare,
}

/// Section of a band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandPoint {
    /// Position along the x axis.
    pub x: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Text at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct PlotLabel {
    /// Position along the x axis.
    pub x: f64,
    /// Position along the y axis.
    pub y: f64,
    /// Text.
    pub text: String,
}

/// Shape that a layer draws.
#[derive(Clone, Debug, PartialEq)]
pub enum PlotShape {
    /// Line through points.
    Line {
        /// Points `(x, y)`; the line breaks where one is not finite.
        points: Vec<(f64, f64)>,
        /// `true` if the line is dashed.
        dashed: bool,
    },
    /// Area between two lines.
    Band {
        /// Sections of the area.
        points: Vec<BandPoint>,
    },
    /// Points with error bars.
    Marks {
        /// Points with their error bars.
        marks: Vec<Mark>,
        /// Mark of the points.
        style: Style,
    },
    /// Texts to the upper right of points.
    Texts {
        /// Points with their texts.
        words: Vec<PlotLabel>,
    },
    /// Lower bounds: a bar from which an arrow points up.
    LowerBounds {
        /// Points `(x, y)`.
        points: Vec<(f64, f64)>,
    },
}

/// Shape with its colour and its entry in the legend (none if empty).
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Shape to draw.
    pub shape: PlotShape,
    /// Any SVG colour.
    pub colour: String,
    /// Entry in the legend.
    pub label: String,
}

impl Layer {
    /// Returns a layer.
    #[must_use]
    pub fn new(shape: PlotShape, colour: &str, label: &str) -> Self {
        Self {
            shape,
            colour: colour.to_owned(),
            label: label.to_owned(),
        }
    }
}

/// Position of the legend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Legend {
    /// No legend.
    None,
    /// Position to the right of the panel, where no point lies.
    Right,
}

/// Two axes and their layers.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Title above the panel.
    pub title: String,
    /// Horizontal axis.
    pub x: PlotAxis,
    /// Vertical axis.
    pub y: PlotAxis,
    /// Layers in the order of drawing.
    pub layers: Vec<Layer>,
    /// Position of the legend.
    pub legend: Legend,
    /// Title above the entries of the legend.
    pub legend_title: String,
}

/// Panels side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Panels from left to right.
    pub panels: Vec<Panel>,
}

const PLOT_WIDTH: f64 = 430.0;
const PLOT_HEIGHT: f64 = 310.0;
const LEFT: f64 = 72.0;
const RIGHT: f64 = 22.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 58.0;
const TEXT: f64 = 13.0;
/// Height of an entry of a legend.
const ENTRY: f64 = 18.0;
const INK: &str = "#222222";
const PALE: &str = "#e4e4e4";

impl Figure {
    /// Returns the figure as the text of an SVG file.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let legends = self.panels.iter().map(Panel::legend_size);
        let (mut width, mut height) = (0.0, TOP + PLOT_HEIGHT + BOTTOM);
        for [beside, below] in legends {
            width += LEFT + PLOT_WIDTH + RIGHT + beside;
            height = f64::max(height, TOP + below);
        }
        let attributes = format!(
            "font-family=\"Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif\" \
             font-size=\"{TEXT}\" fill=\"{INK}\""
        );
        let mut svg = Svg::file([width, height].map(f64::round), &attributes);
        let mut left = LEFT;
        for (index, panel) in self.panels.iter().enumerate() {
            Drawing::new(panel, left, index).draw(&mut svg);
            left += PLOT_WIDTH + RIGHT + panel.legend_size()[0] + LEFT;
        }
        svg.end()
    }
}

impl Panel {
    /// Returns the layers with an entry in the legend.
    fn entries(&self) -> impl Iterator<Item = &Layer> {
        let shown = self.legend == Legend::Right;
        let layers = self.layers.iter();
        layers.filter(move |layer| shown && !layer.label.is_empty())
    }

    /// Returns the width and height of the legend with the space around it; 0 without one.
    fn legend_size(&self) -> [f64; 2] {
        if self.legend == Legend::None {
            return [0.0; 2];
        }
        let labels = self
            .entries()
            .map(|layer| TEXT * svg::width_of(&layer.label) + 38.0);
        let title = TEXT * svg::width_of(&self.legend_title) + 4.0;
        let rows = self.entries().count() + usize::from(!self.legend_title.is_empty());
        [
            labels.fold(title, f64::max) + 26.0,
            real(rows) * ENTRY + 22.0,
        ]
    }
}

/// Range of an axis, its ticks, and the map of values to the unit interval.
struct Mapping {
    scale: AxisScale,
    low: f64,
    high: f64,
    /// Ticks with their labels; an empty label is a minor tick.
    ticks: Vec<(f64, String)>,
    /// Power of ten factored out of the labels.
    power: i32,
}

impl Mapping {
    fn new(axis: &PlotAxis, values: &[f64]) -> Self {
        match axis.scale {
            AxisScale::Linear => Self::linear(axis, values),
            AxisScale::Log => Self::log(axis, values),
        }
    }

    fn linear(axis: &PlotAxis, values: &[f64]) -> Self {
        let (least, most) = bounds(values.iter().copied().filter(|v| v.is_finite()));
        let (mut low, mut high) = axis.range.unwrap_or_else(|| {
            let least = if least > 0.0 && least < 0.6 * most {
                0.0
            } else {
                least
            };
            let room = 0.04 * (most - least);
            // Zero remains the end of the axis if the data begin there.
            (
                if least.abs() < f64::MIN_POSITIVE {
                    0.0
                } else {
                    least - room
                },
                most + room,
            )
        });
        if high - low <= 1e-12 * high.abs().max(low.abs()) {
            (low, high) = (
                low - 0.5 * low.abs().max(1.0),
                high + 0.5 * high.abs().max(1.0),
            );
        }
        let step = nice_step((high - low) / 6.0);
        let largest = high.abs().max(low.abs());
        let power = if (1e-2..1e4).contains(&largest) {
            0
        } else {
            3 * whole((largest.log10() / 3.0).floor())
        };
        let decimals = (-((step / 10_f64.powi(power)).log10() + 1e-9).floor()).max(0.0);
        let decimals = usize::try_from(whole(decimals)).unwrap_or(0);
        let first = whole((low / step - 1e-9).ceil());
        let last = whole((high / step + 1e-9).floor());
        let ticks = (first..=last)
            .map(|k| {
                let value = f64::from(k) * step;
                (value, format!("{:.decimals$}", value / 10_f64.powi(power)))
            })
            .collect();
        Self {
            scale: AxisScale::Linear,
            low,
            high,
            ticks,
            power,
        }
    }

    fn log(axis: &PlotAxis, values: &[f64]) -> Self {
        let positive = values.iter().copied().filter(|v| v.is_finite() && *v > 0.0);
        let (low, high) = axis.range.unwrap_or_else(|| {
            let (least, most) = bounds(positive);
            if least > 0.0 {
                let room = (most / least).powf(0.06).max(1.25);
                (least / room, most * room)
            } else {
                (0.1, 1.0)
            }
        });
        let within = high.log10().floor() - low.log10().ceil();
        let few = within < 1.0 || (high / low).log10() < 1.6;
        let mut ticks = Vec::new();
        let decades = whole(low.log10().floor())..=whole(high.log10().ceil());
        // All labels are plain or all are powers of ten.
        let simple = low > 0.9e-2 && high < 1.1e4;
        for decade in decades {
            for digit in 1..10 {
                let value = f64::from(digit) * 10_f64.powi(decade);
                if value < low * (1.0 - 1e-9) || value > high * (1.0 + 1e-9) {
                    continue;
                }
                let label = match digit {
                    1 if simple => plain(value),
                    1 => ten_to(decade),
                    2 | 5 if few && simple => plain(value),
                    2 | 5 if few => format!("{digit}·{}", ten_to(decade)),
                    _ => String::new(),
                };
                ticks.push((value, label));
            }
        }
        Self {
            scale: AxisScale::Log,
            low,
            high,
            ticks,
            power: 0,
        }
    }

    /// Returns the position of a value on the axis, 0 at the low end and 1 at the high end; `None` for values that
    /// cannot be drawn.
    fn fraction(&self, value: f64) -> Option<f64> {
        let share = match self.scale {
            AxisScale::Linear => (value - self.low) / (self.high - self.low),
            AxisScale::Log if value > 0.0 => (value / self.low).ln() / (self.high / self.low).ln(),
            AxisScale::Log => return None,
        };
        share.is_finite().then_some(share)
    }
}

/// Returns the smallest and largest value; (0, 1) without values.
fn bounds(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    });
    if low > high { (0.0, 1.0) } else { (low, high) }
}

/// Returns the next larger number that is 1, 2 or 5 times a power of ten.
fn nice_step(rough: f64) -> f64 {
    let power = 10_f64.powf(rough.log10().floor());
    let digit = rough / power;
    let nice = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|n| digit <= n * (1.0 + 1e-9));
    nice.unwrap_or(10.0) * power
}

/// Returns a rounded number as an integer; counts of ticks and powers of ten are small.
#[expect(
    clippy::cast_possible_truncation,
    reason = "clamped to a small range first"
)]
fn whole(value: f64) -> i32 {
    value.round().clamp(-1e6, 1e6) as i32
}

fn plain(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Returns a power of ten as a label, with a typographic minus sign.
fn ten_to(power: i32) -> String {
    format!("10^{{{power}}}").replace('-', "\u{2212}")
}

/// Panel that is being drawn.
struct Drawing<'a> {
    panel: &'a Panel,
    left: f64,
    index: usize,
    axes: [Mapping; 2],
}

impl<'a> Drawing<'a> {
    fn new(panel: &'a Panel, left: f64, index: usize) -> Self {
        let (mut xs, mut ys) = (Vec::new(), Vec::new());
        for layer in &panel.layers {
            collect(&layer.shape, &mut xs, &mut ys);
        }
        Self {
            panel,
            left,
            index,
            axes: [Mapping::new(&panel.x, &xs), Mapping::new(&panel.y, &ys)],
        }
    }

    /// Returns the point at these fractions of both axes.
    fn pixels(&self, [x, y]: [f64; 2]) -> Point {
        [self.left + x * PLOT_WIDTH, TOP + (1.0 - y) * PLOT_HEIGHT]
    }

    fn position(&self, [x, y]: [f64; 2]) -> Option<Point> {
        // Points far outside are drawn to the clip region only, because some viewers fail at huge coordinates.
        let x = self.axes[0].fraction(x)?.clamp(-3.0, 4.0);
        let y = self.axes[1].fraction(y)?.clamp(-3.0, 4.0);
        Some(self.pixels([x, y]))
    }

    fn draw(&self, svg: &mut Svg) {
        let (left, index) = (self.left, self.index);
        svg.put(format_args!(
            "<clipPath id=\"plot{index}\"><rect x=\"{left:.2}\" y=\"{TOP:.2}\" width=\"{PLOT_WIDTH}\" \
             height=\"{PLOT_HEIGHT}\"/></clipPath>"
        ));
        self.grid(svg);
        svg.put(format_args!("<g clip-path=\"url(#plot{index})\">"));
        for layer in &self.panel.layers {
            self.layer(svg, layer);
        }
        svg.put(format_args!("</g>"));
        let [right, bottom] = self.pixels([1.0, 0.0]);
        let frame = format!("M{left:.2} {TOP:.2}V{bottom:.2}H{right:.2}");
        svg.line(&frame, INK, 1.2, "");
        self.ticks(svg);
        let [x, y] = &self.axes;
        let title = Label {
            size: 14.0,
            bold: true,
            ..words(&self.panel.title, [left, TOP - 16.0], "start")
        };
        svg.label(title);
        let below = [left + 0.5 * PLOT_WIDTH, bottom + 44.0];
        let beside = [left - 54.0, TOP + 0.5 * PLOT_HEIGHT];
        svg.label(words(&label(&self.panel.x, x.power), below, "middle"));
        svg.label(Label {
            upwards: true,
            ..words(&label(&self.panel.y, y.power), beside, "middle")
        });
        self.legend(svg);
    }

    /// Returns the ends of the line of the grid at each tick of an axis, and the label of the tick.
    fn lines(&self, axis: usize) -> impl Iterator<Item = ([Point; 2], &str)> {
        self.axes[axis]
            .ticks
            .iter()
            .filter_map(move |(value, text)| {
                let share = self.axes[axis].fraction(*value)?;
                let end = |other: f64| {
                    self.pixels(if axis == 0 {
                        [share, other]
                    } else {
                        [other, share]
                    })
                };
                Some(([end(0.0), end(1.0)], text.as_str()))
            })
    }

    fn grid(&self, svg: &mut Svg) {
        let mut path = String::new();
        let labelled = [0, 1].into_iter().flat_map(|axis| self.lines(axis));
        for (ends, _) in labelled.filter(|(_, text)| !text.is_empty()) {
            svg::add_segment(&mut path, ends);
        }
        svg.line(&path, PALE, 0.8, "");
    }

    fn ticks(&self, svg: &mut Svg) {
        let mut path = String::new();
        for axis in [0, 1] {
            for ([[x, y], _], text) in self.lines(axis) {
                let length = if text.is_empty() { 3.0 } else { 6.0 };
                let (end, place, anchor) = if axis == 0 {
                    ([x, y + length], [x, y + 21.0], "middle")
                } else {
                    ([x - length, y], [x - 10.0, y + 4.5], "end")
                };
                svg::add_segment(&mut path, [[x, y], end]);
                if !text.is_empty() {
                    svg.label(words(text, place, anchor));
                }
            }
        }
        svg.line(&path, INK, 1.0, "");
    }

    fn layer(&self, svg: &mut Svg, layer: &Layer) {
        let colour = &layer.colour;
        match &layer.shape {
            PlotShape::Line { points, dashed } => {
                let path = self.path(points.iter().map(|&(x, y)| [x, y]));
                svg.line(&path, colour, 1.8, stroke(*dashed));
            }
            PlotShape::Band { points } => {
                let there = points.iter().map(|point| [point.x, point.low]);
                let back = points.iter().rev().map(|point| [point.x, point.high]);
                let path = self.path(there.chain(back));
                if !path.is_empty() {
                    svg.put(format_args!(
                        "<path d=\"{path}Z\" fill=\"{colour}\" fill-opacity=\"0.18\"/>"
                    ));
                }
            }
            PlotShape::Marks { marks, style } => {
                let bars: String = marks.iter().map(|mark| self.bars(mark)).collect();
                svg.line(&bars, colour, 1.2, "");
                for place in marks
                    .iter()
                    .filter_map(|mark| self.position([mark.x, mark.y]))
                {
                    symbol(svg, place, colour, *style);
                }
            }
            PlotShape::Texts { words: texts } => {
                for word in texts {
                    if let Some([x, y]) = self.position([word.x, word.y]) {
                        svg.label(words(&word.text, [x + 6.0, y - 7.0], "start"));
                    }
                }
            }
            PlotShape::LowerBounds { points } => {
                for place in points.iter().filter_map(|&(x, y)| self.position([x, y])) {
                    arrow(svg, place, colour);
                }
            }
        }
    }

    fn path(&self, points: impl Iterator<Item = [f64; 2]>) -> String {
        let mut path = String::new();
        let mut command = 'M';
        for point in points {
            match self.position(point) {
                Some([x, y]) => {
                    // Writing to a string cannot fail.
                    let _ = write!(path, "{command}{x:.2} {y:.2}");
                    command = 'L';
                }
                None => command = 'M',
            }
        }
        path
    }

    /// Returns the error bars of a point as a path.
    fn bars(&self, mark: &Mark) -> String {
        let mut path = String::new();
        let value = [mark.x, mark.y];
        let Some(place) = self.position(value) else {
            return path;
        };
        for (axis, bar) in [mark.x_bar, mark.y_bar].into_iter().enumerate() {
            let Some((low, high)) = bar else { continue };
            let end = |along: f64| {
                let mut end = value;
                end[axis] = along;
                self.position(end)
            };
            // An error bar that extends below a logarithmic axis ends beyond the axis.
            let mut beyond = place;
            beyond[axis] = self.pixels([-0.03; 2])[axis];
            let ends = [end(low).unwrap_or(beyond), end(high).unwrap_or(place)];
            svg::add_segment(&mut path, ends);
            for end in ends {
                let side = |by: f64| {
                    let mut side = end;
                    side[1 - axis] += by;
                    side
                };
                svg::add_segment(&mut path, [side(-3.0), side(3.0)]);
            }
        }
        path
    }

    fn legend(&self, svg: &mut Svg) {
        let from = self.left + PLOT_WIDTH + 20.0;
        let to = from + 24.0;
        let mut y = TOP + 0.5 * ENTRY + 5.0;
        if !self.panel.legend_title.is_empty() && self.panel.entries().next().is_some() {
            svg.label(words(&self.panel.legend_title, [from, y + 4.5], "start"));
            y += ENTRY;
        }
        for layer in self.panel.entries() {
            let middle = 0.5 * (from + to);
            let colour = &layer.colour;
            match &layer.shape {
                PlotShape::Line { dashed, .. } => {
                    let path = format!("M{from:.2} {y:.2}H{to:.2}");
                    svg.line(&path, colour, 2.2, stroke(*dashed));
                }
                PlotShape::Band { .. } => svg.put(format_args!(
                    "<rect x=\"{from:.2}\" y=\"{:.2}\" width=\"24\" height=\"10\" fill=\"{colour}\" \
                     fill-opacity=\"0.18\"/>",
                    y - 5.0
                )),
                PlotShape::Marks { style, .. } => symbol(svg, [middle, y], colour, *style),
                PlotShape::Texts { .. } => {}
                PlotShape::LowerBounds { .. } => arrow(svg, [middle, y + 7.0], colour),
            }
            svg.label(words(&layer.label, [to + 8.0, y + 4.5], "start"));
            y += ENTRY;
        }
    }
}

/// Returns a label in the usual font.
fn words<'a>(text: &'a str, place: Point, anchor: &'static str) -> Label<'a> {
    Label {
        text,
        place,
        anchor,
        size: TEXT,
        bold: false,
        upwards: false,
    }
}

/// Returns the attributes of a line.
fn stroke(dashed: bool) -> &'static str {
    if dashed {
        " stroke-linejoin=\"round\" stroke-dasharray=\"6 4\""
    } else {
        " stroke-linejoin=\"round\""
    }
}

fn symbol(svg: &mut Svg, [x, y]: Point, colour: &str, style: Style) {
    let (fill, radius) = match style {
        Style::Filled => (colour, 3.8),
        Style::Hollow => ("white", 3.8),
        Style::Ring => ("none", 7.0),
        Style::Square | Style::OpenSquare => {
            let fill = if style == Style::Square {
                colour
            } else {
                "white"
            };
            let [x, y] = [x - 6.5, y - 6.5];
            return svg.put(format_args!(
                "<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"13\" height=\"13\" fill=\"{fill}\" stroke=\"{colour}\" \
                 stroke-width=\"1.8\"/>"
            ));
        }
    };
    svg.put(format_args!(
        "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.4\"/>"
    ));
}

/// Draws a bar with an arrow that points up.
fn arrow(svg: &mut Svg, [x, y]: Point, colour: &str) {
    let mut path = String::new();
    let tip = [x, y - 14.0];
    for ends in [
        [[x - 5.0, y], [x + 5.0, y]],
        [[x, y], tip],
        [[x - 3.5, y - 9.5], tip],
        [[x + 3.5, y - 9.5], tip],
    ] {
        svg::add_segment(&mut path, ends);
    }
    svg.line(&path, colour, 1.6, " stroke-linecap=\"round\"");
}

/// Collects the values of a shape along both axes.
fn collect(shape: &PlotShape, xs: &mut Vec<f64>, ys: &mut Vec<f64>) {
    match shape {
        PlotShape::Line { points, .. } => {
            xs.extend(points.iter().map(|p| p.0));
            ys.extend(points.iter().map(|p| p.1));
        }
        PlotShape::Texts { words } => {
            xs.extend(words.iter().map(|word| word.x));
            ys.extend(words.iter().map(|word| word.y));
        }
        PlotShape::LowerBounds { points } => {
            xs.extend(points.iter().map(|p| p.0));
            // The range includes space for the arrow and for the legend above it.
            ys.extend(points.iter().flat_map(|p| [p.1, 2.0 * p.1]));
        }
        PlotShape::Band { points } => {
            xs.extend(points.iter().map(|point| point.x));
            ys.extend(points.iter().flat_map(|point| [point.low, point.high]));
        }
        PlotShape::Marks { marks, .. } => {
            for mark in marks {
                xs.push(mark.x);
                ys.push(mark.y);
                xs.extend(mark.x_bar.iter().flat_map(|bar| [bar.0, bar.1]));
                ys.extend(mark.y_bar.iter().flat_map(|bar| [bar.0, bar.1]));
            }
        }
    }
}

/// Returns the label of an axis: quantity, and in brackets the unit with the power of ten factored out of the
/// ticks.
fn label(axis: &PlotAxis, power: i32) -> String {
    let factor = (power != 0).then(|| ten_to(power));
    let unit = Some(axis.unit.clone()).filter(|unit| !unit.is_empty());
    let unit: Vec<String> = [factor, unit].into_iter().flatten().collect();
    if unit.is_empty() {
        axis.quantity.clone()
    } else {
        format!("{} ({})", axis.quantity, unit.join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(mapping: &Mapping) -> Vec<&str> {
        mapping
            .ticks
            .iter()
            .map(|(_, label)| label.as_str())
            .filter(|label| !label.is_empty())
            .collect()
    }

    #[test]
    fn linear_ticks_are_round_and_small_numbers_lend_their_power_to_the_label() {
        let axis = PlotAxis::linear("t", "s");
        let mapping = Mapping::new(&axis, &[0.0, 9.7]);
        assert_eq!(labels(&mapping), ["0", "2", "4", "6", "8", "10"]);
        let mapping = Mapping::new(&axis, &[0.0, 0.0031]);
        assert_eq!(mapping.power, -3);
        assert_eq!(
            labels(&mapping),
            ["0.0", "1.0", "2.0", "3.0"].map(|s| &s[..1])
        );
        assert_eq!(label(&axis, -3), "t (10^{\u{2212}3} s)");
    }

    #[test]
    fn logarithmic_ticks_are_decades_and_over_a_short_range_also_2_and_5() {
        let axis = PlotAxis::log("C", "N/m");
        let mapping = Mapping::new(&axis, &[0.152, 12.7]);
        assert_eq!(labels(&mapping), ["1", "10"]);
        let mapping = Mapping::new(&axis, &[0.9, 11.0]);
        assert_eq!(labels(&mapping), ["1", "2", "5", "10"]);
        let mapping = Mapping::new(&axis, &[2.0, 50.0]);
        assert_eq!(labels(&mapping), ["2", "5", "10", "20", "50"]);
        assert_eq!(mapping.fraction(0.0), None);
        assert_eq!(mapping.fraction(-1.0), None);
    }

    #[test]
    fn a_figure_of_nothing_and_of_odd_values_is_still_a_figure() {
        let panel = |layers| Panel {
            title: String::new(),
            x: PlotAxis::log("x", ""),
            y: PlotAxis::linear("y", ""),
            layers,
            legend: Legend::Right,
            legend_title: String::new(),
        };
        let odd = Layer::new(
            PlotShape::Line {
                points: vec![
                    (f64::NAN, 1.0),
                    (-1.0, 2.0),
                    (1.0, f64::INFINITY),
                    (2.0, 2.0),
                ],
                dashed: false,
            },
            "black",
            "odd",
        );
        let figure = Figure {
            panels: vec![panel(vec![]), panel(vec![odd])],
        };
        let svg = figure.to_svg();
        assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert_eq!(svg, figure.to_svg());
    }

    #[test]
    fn points_land_where_the_axes_say() {
        let panel = Panel {
            title: String::new(),
            x: PlotAxis::linear("x", "").with_range(0.0, 10.0),
            y: PlotAxis::log("y", "").with_range(1.0, 100.0),
            layers: vec![],
            legend: Legend::None,
            legend_title: String::new(),
        };
        let drawing = Drawing::new(&panel, LEFT, 0);
        assert_eq!(
            drawing.position([5.0, 10.0]),
            Some([LEFT + 0.5 * PLOT_WIDTH, TOP + 0.5 * PLOT_HEIGHT])
        );
        assert_eq!(
            drawing.position([0.0, 1.0]),
            Some([LEFT, TOP + PLOT_HEIGHT])
        );
    }

    #[test]
    fn colours_of_an_order_run_from_dark_to_light() {
        assert_eq!(sequential(0, 10), "rgb(68,1,84)");
        assert_eq!(sequential(9, 10), "rgb(151,204,56)");
        assert_eq!(sequential(0, 1), "rgb(68,1,84)");
    }
}
