//! Figures as SVG: axes, lines, points with error bars, bands and bounds.
//!
//! A [`Figure`] contains panels side by side; a [`Panel`] contains two axes and layers drawn in order. The text
//! is the same for the same data on any machine. Categories use the colours of Okabe and Ito ([`CATEGORY`]),
//! ordered values use viridis ([`sequential`]). Both are distinguishable for colour-blind readers and in grey.
//!
//! Labels may contain `_{sub}` and `^{super}`.

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
const LINE: f64 = 18.0;
const INK: &str = "#222222";
const PALE: &str = "#e4e4e4";

impl Figure {
    /// Returns the figure as the text of an SVG file.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let side = |panel: &Panel| match panel.legend {
            Legend::Right => legend_width(panel) + 14.0,
            Legend::None => 0.0,
        };
        let width: f64 = self
            .panels
            .iter()
            .map(|panel| LEFT + PLOT_WIDTH + RIGHT + side(panel))
            .sum();
        let beside = |panel: &Panel| match panel.legend {
            Legend::Right => TOP + legend_height(panel) + 12.0,
            Legend::None => 0.0,
        };
        let height = (self.panels.iter().map(beside)).fold(TOP + PLOT_HEIGHT + BOTTOM, f64::max);
        let mut pen = Pen::default();
        // Spaces are preserved; otherwise those next to a superscript or subscript are dropped.
        pen.put(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" xml:space=\"preserve\" width=\"{width:.0}\" \
             height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', \
             sans-serif\" \
             font-size=\"{TEXT}\" fill=\"{INK}\">"
        ));
        pen.put(format_args!(
            "<rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"white\"/>"
        ));
        let mut left = LEFT;
        for (index, panel) in self.panels.iter().enumerate() {
            Drawing::new(panel, left, index).draw(&mut pen);
            left += PLOT_WIDTH + RIGHT + side(panel) + LEFT;
        }
        pen.put(format_args!("</svg>"));
        pen.text
    }
}

/// Collects the lines of the file.
#[derive(Default)]
struct Pen {
    text: String,
}

impl Pen {
    fn put(&mut self, line: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = self.text.write_fmt(line);
        self.text.push('\n');
    }

    fn segment(&mut self, from: (f64, f64), to: (f64, f64), colour: &str, width: f64) {
        self.put(format_args!(
            "<line x1=\"{:.2}\" y1=\"{:.2}\" x2=\"{:.2}\" y2=\"{:.2}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>",
            from.0, from.1, to.0, to.1
        ));
    }

    fn words(&mut self, x: f64, y: f64, anchor: &str, extra: &str, text: &str) {
        self.put(format_args!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"{anchor}\"{extra}>{}</text>",
            with_subscripts(text)
        ));
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
        let few = (high / low).log10() < 1.6;
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
                    1 => format!("10^{{{}}}", minus(decade)),
                    2 | 5 if few && simple => plain(value),
                    2 | 5 if few => format!("{digit}·10^{{{}}}", minus(decade)),
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

/// Returns an integer with a typographic minus sign.
fn minus(value: i32) -> String {
    value.to_string().replace('-', "\u{2212}")
}

/// Escapes text and converts `_{..}` and `^{..}` to subscripts and superscripts.
fn with_subscripts(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    // Vertical shift that returns the text after a superscript or subscript to its line.
    let mut back = 0.0;
    let mut run = |text: &str, shift: f64, small: bool| {
        let size = if small { " font-size=\"10\"" } else { "" };
        // Writing to a string cannot fail.
        let _ = if text.is_empty() {
            Ok(())
        } else if shift.abs() > 0.0 || small {
            write!(out, "<tspan dy=\"{shift}\"{size}>{}</tspan>", escape(text))
        } else {
            write!(out, "{}", escape(text))
        };
    };
    while let Some(at) = rest.find("_{").into_iter().chain(rest.find("^{")).min() {
        let (before, mark) = rest.split_at(at);
        let inner = &mark[2..];
        let Some(end) = inner.find('}') else { break };
        run(before, back, false);
        // For two successive spans, as in `x_{i}^{2}`, the second starts from the position of the first.
        let from = if before.is_empty() { back } else { 0.0 };
        let shift = if mark.starts_with('_') { 3.5 } else { -5.0 };
        run(&inner[..end], from + shift, true);
        back = -shift;
        rest = &inner[end + 1..];
    }
    run(rest, back, false);
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// Returns the approximate width of a text: glyphs of the listed fonts are about 0.55 em wide on average.
fn text_width(text: &str) -> f64 {
    let glyphs = text.chars().filter(|c| !"_^{}".contains(*c)).count();
    0.56 * TEXT * real(glyphs)
}

fn entries(panel: &Panel) -> Vec<&Layer> {
    panel
        .layers
        .iter()
        .filter(|layer| !layer.label.is_empty())
        .collect()
}

fn legend_width(panel: &Panel) -> f64 {
    let widest = entries(panel)
        .iter()
        .map(|layer| text_width(&layer.label) + 38.0)
        .fold(text_width(&panel.legend_title) + 4.0, f64::max);
    widest + 12.0
}

fn legend_height(panel: &Panel) -> f64 {
    let rows = entries(panel).len() + usize::from(!panel.legend_title.is_empty());
    real(rows) * LINE + 10.0
}

/// Panel that is being drawn.
struct Drawing<'a> {
    panel: &'a Panel,
    left: f64,
    index: usize,
    x: Mapping,
    y: Mapping,
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
            x: Mapping::new(&panel.x, &xs),
            y: Mapping::new(&panel.y, &ys),
        }
    }

    fn position(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        // Points far outside are drawn to the clip region only, because some viewers fail at huge coordinates.
        let x = self.x.fraction(x)?.clamp(-3.0, 4.0);
        let y = self.y.fraction(y)?.clamp(-3.0, 4.0);
        Some((self.left + x * PLOT_WIDTH, TOP + (1.0 - y) * PLOT_HEIGHT))
    }

    fn draw(&self, pen: &mut Pen) {
        let (left, right) = (self.left, self.left + PLOT_WIDTH);
        let bottom = TOP + PLOT_HEIGHT;
        pen.put(format_args!(
            "<clipPath id=\"plot{}\"><rect x=\"{left:.2}\" y=\"{TOP:.2}\" width=\"{PLOT_WIDTH}\" \
             height=\"{PLOT_HEIGHT}\"/></clipPath>",
            self.index
        ));
        self.grid(pen);
        pen.put(format_args!("<g clip-path=\"url(#plot{})\">", self.index));
        for layer in &self.panel.layers {
            self.layer(pen, layer);
        }
        pen.put(format_args!("</g>"));
        pen.put(format_args!(
            "<path d=\"M{left:.2} {TOP:.2}V{bottom:.2}H{right:.2}\" fill=\"none\" stroke=\"{INK}\" \
             stroke-width=\"1.2\"/>"
        ));
        self.ticks(pen);
        let middle = left + 0.5 * PLOT_WIDTH;
        pen.words(
            left,
            TOP - 16.0,
            "start",
            " font-size=\"14\" font-weight=\"bold\"",
            &self.panel.title,
        );
        pen.words(
            middle,
            bottom + 44.0,
            "middle",
            "",
            &label(&self.panel.x, self.x.power),
        );
        let (x, y) = (left - 54.0, TOP + 0.5 * PLOT_HEIGHT);
        let turn = format!(" transform=\"rotate(-90 {x:.2} {y:.2})\"");
        pen.words(x, y, "middle", &turn, &label(&self.panel.y, self.y.power));
        self.legend(pen);
    }

    fn grid(&self, pen: &mut Pen) {
        let bottom = TOP + PLOT_HEIGHT;
        for (value, text) in &self.x.ticks {
            if let (Some(share), false) = (self.x.fraction(*value), text.is_empty()) {
                let x = self.left + share * PLOT_WIDTH;
                pen.segment((x, TOP), (x, bottom), PALE, 0.8);
            }
        }
        for (value, text) in &self.y.ticks {
            if let (Some(share), false) = (self.y.fraction(*value), text.is_empty()) {
                let y = bottom - share * PLOT_HEIGHT;
                pen.segment((self.left, y), (self.left + PLOT_WIDTH, y), PALE, 0.8);
            }
        }
    }

    fn ticks(&self, pen: &mut Pen) {
        let bottom = TOP + PLOT_HEIGHT;
        for (value, text) in &self.x.ticks {
            let Some(share) = self.x.fraction(*value) else {
                continue;
            };
            let x = self.left + share * PLOT_WIDTH;
            let length = if text.is_empty() { 3.0 } else { 6.0 };
            pen.segment((x, bottom), (x, bottom + length), INK, 1.0);
            if !text.is_empty() {
                pen.words(x, bottom + 21.0, "middle", "", text);
            }
        }
        for (value, text) in &self.y.ticks {
            let Some(share) = self.y.fraction(*value) else {
                continue;
            };
            let y = bottom - share * PLOT_HEIGHT;
            let length = if text.is_empty() { 3.0 } else { 6.0 };
            pen.segment((self.left - length, y), (self.left, y), INK, 1.0);
            if !text.is_empty() {
                pen.words(self.left - 10.0, y + 4.5, "end", "", text);
            }
        }
    }

    fn layer(&self, pen: &mut Pen, layer: &Layer) {
        let colour = &layer.colour;
        match &layer.shape {
            PlotShape::Line { points, dashed } => {
                let dash = if *dashed {
                    " stroke-dasharray=\"6 4\""
                } else {
                    ""
                };
                let path = self.path(points.iter().copied());
                if !path.is_empty() {
                    pen.put(format_args!(
                        "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\" \
                         stroke-linejoin=\"round\"{dash}/>"
                    ));
                }
            }
            PlotShape::Band { points } => {
                let there = points.iter().map(|point| (point.x, point.low));
                let back = points.iter().rev().map(|point| (point.x, point.high));
                let path = self.path(there.chain(back));
                if !path.is_empty() {
                    pen.put(format_args!(
                        "<path d=\"{path}Z\" fill=\"{colour}\" fill-opacity=\"0.18\"/>"
                    ));
                }
            }
            PlotShape::Marks { marks, style } => {
                for mark in marks {
                    self.bars(pen, mark, colour);
                }
                for place in marks
                    .iter()
                    .filter_map(|mark| self.position(mark.x, mark.y))
                {
                    dot(pen, place, colour, *style);
                }
            }
            PlotShape::Texts { words } => {
                for word in words {
                    if let Some((x, y)) = self.position(word.x, word.y) {
                        pen.words(x + 6.0, y - 7.0, "start", "", &word.text);
                    }
                }
            }
            PlotShape::LowerBounds { points } => {
                for place in points.iter().filter_map(|&(x, y)| self.position(x, y)) {
                    arrow(pen, place, colour);
                }
            }
        }
    }

    fn path(&self, points: impl Iterator<Item = (f64, f64)>) -> String {
        let mut path = String::new();
        let mut command = 'M';
        for (x, y) in points {
            match self.position(x, y) {
                Some((x, y)) => {
                    let _ = write!(path, "{command}{x:.2} {y:.2}");
                    command = 'L';
                }
                None => command = 'M',
            }
        }
        path
    }

    fn bars(&self, pen: &mut Pen, mark: &Mark, colour: &str) {
        let Some((x, y)) = self.position(mark.x, mark.y) else {
            return;
        };
        let bottom = TOP + PLOT_HEIGHT;
        if let Some((low, high)) = mark.y_bar {
            // An error bar that extends below a logarithmic axis ends at the axis.
            let low = self
                .position(mark.x, low)
                .map_or(bottom + 9.0, |place| place.1);
            let high = self.position(mark.x, high).map_or(y, |place| place.1);
            pen.segment((x, low), (x, high), colour, 1.2);
            for end in [low, high] {
                pen.segment((x - 3.0, end), (x + 3.0, end), colour, 1.2);
            }
        }
        if let Some((low, high)) = mark.x_bar {
            let low = self
                .position(low, mark.y)
                .map_or(self.left - 9.0, |place| place.0);
            let high = self.position(high, mark.y).map_or(x, |place| place.0);
            pen.segment((low, y), (high, y), colour, 1.2);
            for end in [low, high] {
                pen.segment((end, y - 3.0), (end, y + 3.0), colour, 1.2);
            }
        }
    }

    fn legend(&self, pen: &mut Pen) {
        let entries = entries(self.panel);
        if entries.is_empty() || self.panel.legend == Legend::None {
            return;
        }
        let titled = !self.panel.legend_title.is_empty();
        let (left, top) = (self.left + PLOT_WIDTH + 14.0, TOP);
        let mut y = top + 0.5 * LINE + 5.0;
        if titled {
            pen.words(left + 6.0, y + 4.5, "start", "", &self.panel.legend_title);
            y += LINE;
        }
        for layer in entries {
            let (from, to) = (left + 6.0, left + 30.0);
            let colour = &layer.colour;
            match &layer.shape {
                PlotShape::Line { dashed, .. } => {
                    let dash = if *dashed { " stroke-dasharray=\"6 4\"" } else { "" };
                    pen.put(format_args!(
                        "<path d=\"M{from:.2} {y:.2}H{to:.2}\" stroke=\"{colour}\" stroke-width=\"2.2\"{dash}/>"
                    ));
                }
                PlotShape::Band { .. } => pen.put(format_args!(
                    "<rect x=\"{from:.2}\" y=\"{:.2}\" width=\"24\" height=\"10\" fill=\"{colour}\" \
                     fill-opacity=\"0.18\"/>",
                    y - 5.0
                )),
                PlotShape::Marks { style, .. } => {
                    dot(pen, (0.5 * (from + to), y), colour, *style);
                }
                PlotShape::Texts { .. } => {}
                PlotShape::LowerBounds { .. } => arrow(pen, (0.5 * (from + to), y + 7.0), colour),
            }
            pen.words(to + 8.0, y + 4.5, "start", "", &layer.label);
            y += LINE;
        }
    }
}

fn dot(pen: &mut Pen, (x, y): (f64, f64), colour: &str, style: Style) {
    let (fill, radius) = match style {
        Style::Filled => (colour, 3.8),
        Style::Hollow => ("white", 3.8),
        Style::Ring => ("none", 7.0),
        Style::Square => return square(pen, (x, y), colour, colour),
        Style::OpenSquare => return square(pen, (x, y), colour, "white"),
    };
    pen.put(format_args!(
        "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.4\"/>"
    ));
}

fn square(pen: &mut Pen, (x, y): (f64, f64), colour: &str, fill: &str) {
    pen.put(format_args!(
        "<rect x=\"{:.2}\" y=\"{:.2}\" width=\"13\" height=\"13\" fill=\"{fill}\" stroke=\"{colour}\" \
         stroke-width=\"1.8\"/>",
        x - 6.5,
        y - 6.5
    ));
}

/// Draws a bar with an arrow that points up.
fn arrow(pen: &mut Pen, (x, y): (f64, f64), colour: &str) {
    pen.put(format_args!(
        "<path d=\"M{:.2} {y:.2}H{:.2}M{x:.2} {y:.2}V{:.2}M{:.2} {:.2}L{x:.2} {:.2}L{:.2} {:.2}\" fill=\"none\" \
         stroke=\"{colour}\" stroke-width=\"1.6\"/>",
        x - 5.0,
        x + 5.0,
        y - 14.0,
        x - 3.5,
        y - 9.5,
        y - 14.0,
        x + 3.5,
        y - 9.5
    ));
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
    let factor = if power == 0 {
        String::new()
    } else {
        format!("10^{{{}}}", minus(power))
    };
    match (factor.is_empty(), axis.unit.is_empty()) {
        (true, true) => axis.quantity.clone(),
        (true, false) => format!("{} ({})", axis.quantity, axis.unit),
        (false, true) => format!("{} ({factor})", axis.quantity),
        (false, false) => format!("{} ({factor} {})", axis.quantity, axis.unit),
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
        assert_eq!(mapping.fraction(0.0), None);
        assert_eq!(mapping.fraction(-1.0), None);
    }

    #[test]
    fn text_is_escaped_and_marks_become_spans() {
        assert_eq!(with_subscripts("a < b & c"), "a &lt; b &amp; c");
        assert_eq!(
            with_subscripts("τ_{h} x"),
            "τ<tspan dy=\"3.5\" font-size=\"10\">h</tspan><tspan dy=\"-3.5\"> x</tspan>"
        );
        assert_eq!(with_subscripts("open_{"), "open_{");
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
            drawing.position(5.0, 10.0),
            Some((LEFT + 0.5 * PLOT_WIDTH, TOP + 0.5 * PLOT_HEIGHT))
        );
        assert_eq!(drawing.position(0.0, 1.0), Some((LEFT, TOP + PLOT_HEIGHT)));
    }

    #[test]
    fn colours_of_an_order_run_from_dark_to_light() {
        assert_eq!(sequential(0, 10), "rgb(68,1,84)");
        assert_eq!(sequential(9, 10), "rgb(151,204,56)");
        assert_eq!(sequential(0, 1), "rgb(68,1,84)");
    }
}
