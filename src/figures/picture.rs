//! Pictures of a run: fluid, grains and blocks at several times side by side, as one SVG file for any browser:
//! `solver picture`.
//!
//! In 2-D the fluid speed (or another field) is drawn behind the grains. In 3-D grains and blocks are drawn from one
//! side in parallel projection, lit from the upper left, with translucent walls, or a section is drawn, which shows the
//! fluid and the outlines of blocks, structures and walls as well. All panels share one colour scale. The raster is a
//! PNG inside the SVG; text and streamlines are vector graphics.

mod colours;
mod columns;
mod cuts;
mod faces;
mod flow_net;
mod needs;
mod overlays;
mod raster;
mod section;
mod streamlines;
mod walls;

use crate::svg::{Svg, text_element};
use base::error::Error;
use base::number::{real, whole};
use base::vector::dot;
use base64::Engine as _;
use clap::{Args, ValueEnum};
use colours::{grain_colour, water_colour};
use columns::{check_columns, field_of_water};
use cuts::Cuts;
use faces::{Faces, id_of};
use flow_net::{FlowNet, Ground};
use io::OutputTime;
use io::fields::{Values, read_column};
use io::{Alone, Series};
use needs::{check_grains, check_water};
use overlays::{Arrows, Network};
use raster::{Frame, Raster, byte};
use section::Section;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Options of a picture of a run.
#[allow(
    rustdoc::broken_intra_doc_links,
    reason = "comments are the help of the command, with units in brackets"
)]
#[derive(Clone, Debug, Args)]
pub struct PictureOptions {
    /// A time [s], the nearest output of it; may be given several times [default: four over the run].
    #[arg(long = "time", value_name = "SECONDS", value_parser = finite)]
    pub times: Vec<f64>,
    /// Field of the water [default: velocity; without it pressure, head, saturation or another field that is written].
    #[arg(long)]
    pub field: Option<String>,
    /// Column that colours grains and blocks [default: none in the plane and with contacts, velocity in space].
    #[arg(long, value_name = "COLUMN")]
    pub colour: Option<String>,
    /// Vector of each grain to draw as an arrow, such as displacement or velocity.
    #[arg(long, value_name = "COLUMN")]
    pub arrows: Option<String>,
    /// Draw contacts as lines, wider where the normal force is larger, red in tension.
    #[arg(long)]
    pub contacts: bool,
    /// From where a scene in space is seen.
    #[arg(long, value_enum, default_value = "corner")]
    pub view: ViewDirection,
    /// Cut a scene in space by a plane such as y=0.08 [m] and show its water [default: its middle, where there is only
    /// water].
    #[arg(long, value_name = "AXIS=METRES")]
    pub section: Option<Section>,
    /// Draw streamlines of the water in the plane or section.
    #[arg(long)]
    pub streamlines: bool,
    /// Draw the flow net of plane seepage with this number of drops of head, and the names of layers and structures;
    /// needs the fields head and stream_function.
    #[arg(long, value_name = "DROPS", num_args = 0..=1, default_missing_value = "12",
        value_parser = clap::value_parser!(u16).range(2..=200))]
    pub flow_net: Option<u16>,
    /// Show only this part of the plane or section [m].
    #[arg(long, value_name = "LEFT,BOTTOM,RIGHT,TOP", value_parser = crop)]
    pub crop: Option<[f64; 4]>,
    /// Width of a panel [pixels]; the file grows with its square.
    #[arg(long, value_name = "PIXELS", default_value_t = 720, value_parser = clap::value_parser!(u16).range(64..=4096))]
    pub width: u16,
    /// The picture [default: picture.svg in the folder of the run].
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace a file that is not a picture, or a file of a run.
    #[arg(long)]
    pub overwrite: bool,
}

fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|time: &f64| time.is_finite());
    number.ok_or_else(|| "a time in seconds".into())
}

/// Parses the part of a plane that a picture shows.
fn crop(text: &str) -> Result<[f64; 4], String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| finite(part.trim()).ok())
        .collect();
    match numbers.as_deref() {
        Some(&[left, bottom, right, top]) if left < right && bottom < top => {
            Ok([left, bottom, right, top])
        }
        _ => Err("four lengths in m, left and bottom below right and top: 2,0,8,5".into()),
    }
}

/// Refuses to replace anything but a plain file, and, without permission, a file that is not a picture or belongs
/// to a run.
fn check_output(output: &Path, usual: &Path, overwrite: bool) -> Result<(), Error> {
    let refused = |reason: &str| {
        Err(Error::Usage(format!(
            "--output {}: {reason}",
            output.display()
        )))
    };
    let Ok(found) = std::fs::symlink_metadata(output) else {
        return Ok(());
    };
    if !found.is_file() {
        return refused("this is not a regular file; choose another name");
    }
    let folder = output.parent().unwrap_or(output);
    let of_a_run = ["case.json", "summary.json", "run.lock"]
        .iter()
        .any(|name| folder.join(name).exists());
    let picture = output.extension().is_some_and(|ending| ending == "svg");
    if overwrite || output == usual || picture && !of_a_run {
        return Ok(());
    }
    refused(
        "this file exists and is not a picture, or it lies in the folder of a run; choose another name, or \
         replace it with --overwrite",
    )
}

/// Direction of view of a 3-D scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ViewDirection {
    /// Along -x: y to the right, z up.
    X,
    /// Along y: x to the right, z up.
    Y,
    /// From above: x to the right, y up.
    Z,
    /// From a corner above.
    Corner,
}

const SAND: [f64; 3] = [214.0, 176.0, 120.0];
const STONE: [f64; 3] = [150.0, 150.0, 150.0];
const PAPER: [f64; 3] = [255.0, 255.0, 255.0];

/// Draws a run and returns a line with the path of the picture. Runs on one process.
///
/// # Errors
/// If the run has no output to draw or the picture cannot be written, [`Error::Io`]; if the run lacks a column that the
/// request names, [`Error::Usage`].
pub fn picture(run: &Path, request: &PictureOptions) -> Result<String, Error> {
    let usual = run.join("picture.svg");
    let output = request.output.clone().unwrap_or_else(|| usual.clone());
    check_output(&output, &usual, request.overwrite)?;
    let open = |name: &str| {
        Series::open(run, name, &Alone)
            .ok()
            .filter(|series| series.moments().next().is_some())
    };
    let (fluid, grains, blocks) = (open("fluid"), open("grains"), open("blocks"));
    let contacts = request.contacts.then(|| open("contacts")).flatten();
    if request.contacts && contacts.is_none() {
        return Err(failed(
            run,
            "contains no contacts.xmf with outputs: set output.contacts",
        ));
    }
    let structures = open("structures")
        .map(|series| Faces::read(&series.data_path(0), "structure"))
        .transpose()?
        .map(Rc::new);
    let walls = open("walls").map(|series| series.data_path(0));
    let Some(clock) = grains.as_ref().or(blocks.as_ref()).or(fluid.as_ref()) else {
        return Err(failed(
            run,
            "contains no grains.xmf, blocks.xmf or fluid.xmf with outputs",
        ));
    };
    check_water(request, fluid.is_some(), run)?;
    check_grains(request, [grains.is_some(), blocks.is_some()], run)?;
    let moments: Vec<OutputTime> = clock.moments().collect();
    let chosen = choose(&moments, &request.times);
    let ground = Rc::new(
        request
            .flow_net
            .map(|_| Ground::read(run))
            .unwrap_or_default(),
    );
    let domain = domain_of(run);
    // Only outputs of the same step are used: older ones would show earlier positions.
    let file_at = |series: &Option<Series>, step: u64| {
        let series = series.as_ref()?;
        let known = series.moments().any(|m| m.step == step);
        known.then(|| series.data_path(step))
    };
    let first = |series: &Option<Series>| chosen.iter().find_map(|m| file_at(series, m.step));
    let field = first(&fluid).map(|path| field_of_water(&path, request));
    let field = field.transpose()?.flatten();
    let (colour, arrows) = (request.colour.as_deref(), request.arrows.as_deref());
    check_columns(first(&grains), [("--colour", colour), ("--arrows", arrows)])?;
    check_columns(first(&blocks), [("--colour", colour)])?;
    let mut scenes = Vec::new();
    for moment in &chosen {
        let file = |series: &Option<Series>| file_at(series, moment.step);
        let faces = file(&blocks)
            .map(|path| Faces::read(&path, colour.unwrap_or("velocity")))
            .transpose()?;
        let shaped = faces.as_ref().map(|faces| faces.ids.clone());
        let scene = Scene {
            time: moment.time,
            water: (file(&fluid).zip(field.as_deref()))
                .map(|(path, field)| Water::read(&path, field, request.streamlines))
                .transpose()?,
            grains: file(&grains)
                .map(|path| {
                    // Lines of contacts are visible on grains of one light colour.
                    let colour = match (colour, request.contacts) {
                        (Some(column), _) => Some(Some(column)),
                        (None, true) => Some(None),
                        (None, false) => None,
                    };
                    Grains::read(&path, colour, arrows, &shaped.unwrap_or_default())
                })
                .transpose()?,
            contacts: file(&contacts)
                .map(|path| Network::read(&path))
                .transpose()?,
            net: (file(&fluid).filter(|_| request.flow_net.is_some()))
                .map(|path| FlowNet::read(&path, structures.as_deref()))
                .transpose()?,
            ground: Rc::clone(&ground),
            faces,
            structures: structures.clone(),
            walls: (walls.as_deref())
                .map(|path| Faces::walls(path, moment.time))
                .transpose()?,
            domain,
            cuts: None,
        };
        scenes.push(scene.cut(request.section));
    }
    let text = draw(&scenes, field.as_deref().unwrap_or_default(), request)?;
    io::atomic::write(&output, text.as_bytes()).map_err(|e| Error::Io(e.to_string()))?;
    Ok(format!("wrote {}", output.display()))
}

fn failed(path: &Path, reason: impl std::fmt::Display) -> Error {
    Error::Io(format!("{}: {reason}", path.display()))
}

/// Returns the size of the domain of a run in three dimensions from its case; `None` if there is none.
fn domain_of(run: &Path) -> Option<[f64; 3]> {
    size_of_case(run)?.try_into().ok()
}

/// Returns the size of the domain of a run from its case.
fn size_of_case(run: &Path) -> Option<Vec<f64>> {
    let text = io::plain::text(&run.join("case.json"), io::plain::LONGEST_CASE).ok()?;
    let case: serde_json::Value = serde_json::from_str(&text).ok()?;
    let size = &case["domain"]["size"];
    // A size may state its source.
    let size = size.get("value").unwrap_or(size);
    serde_json::from_value(size.clone()).ok()
}

/// Returns the outputs nearest to the requested times; without times, up to four over the run.
fn choose(moments: &[OutputTime], times: &[f64]) -> Vec<OutputTime> {
    let last = moments.len().saturating_sub(1);
    let mut chosen: Vec<OutputTime> = if times.is_empty() {
        let panels = moments.len().min(4);
        (0..panels)
            .map(|k| moments[k * last / (panels - 1).max(1)])
            .collect()
    } else {
        times
            .iter()
            .filter_map(|time| {
                moments
                    .iter()
                    .min_by(|a, b| (a.time - time).abs().total_cmp(&(b.time - time).abs()))
                    .copied()
            })
            .collect()
    };
    chosen.dedup_by_key(|moment| moment.step);
    chosen
}

#[derive(Default)]
struct Scene {
    time: f64,
    water: Option<Water>,
    grains: Option<Grains>,
    contacts: Option<Network>,
    faces: Option<Faces>,
    /// Fields of a flow net, with the layers and structures of the ground.
    net: Option<FlowNet>,
    ground: Rc<Ground>,
    /// Surfaces of stationary structures.
    structures: Option<Rc<Faces>>,
    /// Walls at this time.
    walls: Option<Faces>,
    /// Largest coordinates of the domain, which begins at 0 \[m\]; `None` in two dimensions or if they are not known.
    domain: Option<[f64; 3]>,
    /// Outlines of the solids intersected by a section.
    cuts: Option<Cuts>,
}

impl Scene {
    /// Returns the requested section, or one through the middle if a 3-D scene contains only fluid.
    fn cut(mut self, section: Option<Section>) -> Self {
        let deep = self.water.as_ref().filter(|water| water.cells[2] > 1);
        let alone = self.grains.is_none() && self.faces.is_none();
        // A scene without water at this time is cut too, so that all panels show the same plane.
        let Some(section) = section.or(deep.filter(|_| alone).map(Section::middle)) else {
            return self;
        };
        let domain = (self.domain.map(|size| [[0.0; 3], size])).or(deep.map(Water::corners));
        if let Some(water) = deep {
            self.water = section.water(water);
        }
        if let Some(grains) = self.grains.as_mut().filter(|grains| !grains.flat) {
            section.grains(grains);
        }
        if let Some(contacts) = &mut self.contacts {
            contacts.cut(section);
        }
        let solids = [
            self.faces.as_ref(),
            self.structures.as_deref(),
            self.walls.as_ref(),
        ];
        self.cuts = Some(Cuts {
            frame: domain.map(|ends| ends.map(|end| section.plane().map(|axis| end[axis]))),
            ..Cuts::new(section, solids)
        });
        (self.faces, self.structures, self.walls) = (None, None, None);
        self
    }
}

/// Field on cells; a vector field is reduced to its magnitude.
struct Water {
    /// Number of cells along x, y, z.
    cells: [usize; 3],
    origin: [f64; 3],
    spacing: [f64; 3],
    values: Vec<f64>,
    solid: Vec<bool>,
    /// Velocities (m/s) for streamlines.
    flow: Option<Vec<[f64; 3]>>,
    units: String,
}

impl Water {
    /// Returns the corners of the grid with the smallest and the largest coordinates.
    fn corners(&self) -> [[f64; 3]; 2] {
        let far = |a: usize| self.origin[a] + real(self.cells[a]) * self.spacing[a];
        [self.origin, std::array::from_fn(far)]
    }

    fn read(path: &Path, field: &str, streamlines: bool) -> Result<Self, Error> {
        let wrong = |e: io::Error| Error::Io(e.to_string());
        let image = io::image::open(path)
            .map_err(|_| failed(path, "is not an image with origin and spacing"))?;
        let column = read_column(path, field).map_err(wrong)?;
        let [z, y, x] = column.shape[..3.min(column.shape.len())] else {
            return Err(failed(path, format!("{field} is not a field on cells")));
        };
        let values = magnitudes(&column, z * y * x);
        let solid = read_column(path, "solid")
            .map(|s| s.values.iter().map(|&v| v > 0.5).collect())
            .unwrap_or_else(|_| vec![false; values.len()]);
        let flow = streamlines
            .then(|| read_column(path, "velocity"))
            .transpose()
            .map_err(wrong)?
            .map(|column| {
                let width = (column.values.len() / values.len().max(1)).max(1);
                let each = column.values.chunks_exact(width);
                each.map(|v| std::array::from_fn(|a| v.get(a).copied().unwrap_or(0.0)))
                    .collect()
            });
        let water = Self {
            cells: [x, y, z],
            origin: image.origin,
            spacing: image.spacing,
            values,
            solid,
            flow,
            units: column.units.unwrap_or_default(),
        };
        Ok(match &image.faces {
            Some(faces) => water.on_equal_cells(faces),
            None => water,
        })
    }

    /// Returns the field of cells of different widths on equal cells: each has the values of the cell that contains its
    /// centre.
    fn on_equal_cells(self, faces: &[Vec<f64>; 3]) -> Self {
        let length = |a: usize| faces[a][self.cells[a]] - faces[a][0];
        // Along an axis that is not graded the cells remain as they are.
        let number = |a: usize| {
            let narrow = (length(a) / self.spacing[a] - 1e-6).ceil();
            let most = MOST_PIXELS[usize::from(self.cells[2] > 1)];
            whole(narrow).clamp(self.cells[a], self.cells[a].max(most))
        };
        let cells = [0, 1, 2].map(number);
        let spacing: [f64; 3] = std::array::from_fn(|a| length(a) / real(cells[a]));
        let of_axis = |a: usize| -> Vec<usize> {
            let centre = |n: usize| faces[a][0] + (real(n) + 0.5) * spacing[a];
            let above = |n: usize| faces[a].partition_point(|face| *face <= centre(n));
            let cell = |n: usize| above(n).saturating_sub(1).min(self.cells[a] - 1);
            (0..cells[a]).map(cell).collect()
        };
        let [x, y, z] = [0, 1, 2].map(of_axis);
        let [width, height, _] = self.cells;
        let mut from = Vec::with_capacity(cells.iter().product());
        for k in &z {
            for j in &y {
                from.extend(x.iter().map(|i| (k * height + j) * width + i));
            }
        }
        Self {
            cells,
            origin: self.origin,
            spacing,
            values: from.iter().map(|&n| self.values[n]).collect(),
            solid: from.iter().map(|&n| self.solid[n]).collect(),
            flow: (self.flow.as_ref()).map(|flow| from.iter().map(|&n| flow[n]).collect()),
            units: self.units,
        }
    }
}

/// Maximum number of equal cells along an axis that replace cells of different widths in a picture, in 2-D and in 3-D.
const MOST_PIXELS: [usize; 2] = [2000, 200];

struct Grains {
    positions: Vec<[f64; 3]>,
    radii: Vec<f64>,
    /// Values for the colours, if any.
    values: Option<Vec<f64>>,
    quantity: String,
    units: String,
    arrows: Option<Arrows>,
    flat: bool,
}

impl Grains {
    /// Returns the grains of an output except those drawn with their faces. `colour`: the column, or none for one
    /// colour; by default the velocity in 3-D.
    fn read(
        path: &Path,
        colour: Option<Option<&str>>,
        arrows: Option<&str>,
        shaped: &BTreeSet<i64>,
    ) -> Result<Self, Error> {
        let wrong = |e: io::Error| Error::Io(e.to_string());
        let positions: Vec<[f64; 3]> = read_column(path, "position")
            .map_err(wrong)?
            .values
            .chunks_exact(3)
            .map(|p| [p[0], p[1], p[2]])
            .collect();
        let radii = read_column(path, "radius").map_err(wrong)?.values;
        let flat = positions.iter().all(|p| p[2] == 0.0);
        let quantity = colour.unwrap_or((!flat).then_some("velocity"));
        let column = quantity
            .map(|name| read_column(path, name))
            .transpose()
            .map_err(wrong)?;
        let mut grains = Self {
            values: column.as_ref().map(|c| magnitudes(c, positions.len())),
            quantity: quantity.unwrap_or_default().to_owned(),
            units: column.and_then(|c| c.units).unwrap_or_default(),
            arrows: arrows.map(|name| Arrows::read(path, name)).transpose()?,
            positions,
            radii,
            flat,
        };
        if !shaped.is_empty() {
            let ids = read_column(path, "id").map_err(wrong)?.values;
            grains.retain(|k| !shaped.contains(&id_of(ids[k])));
        }
        Ok(grains)
    }

    fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        let kept: Vec<usize> = (0..self.positions.len()).filter(|&k| keep(k)).collect();
        self.positions = kept.iter().map(|&k| self.positions[k]).collect();
        self.radii = kept.iter().map(|&k| self.radii[k]).collect();
        if let Some(values) = &mut self.values {
            *values = kept.iter().map(|&k| values[k]).collect();
        }
        if let Some(arrows) = &mut self.arrows {
            arrows.vectors = kept.iter().map(|&k| arrows.vectors[k]).collect();
        }
    }
}

/// Returns numbers unchanged, and vectors as their magnitudes.
fn magnitudes(column: &Values, count: usize) -> Vec<f64> {
    if count == 0 {
        return Vec::new();
    }
    let width = (column.values.len() / count).max(1);
    column
        .values
        .chunks_exact(width)
        .map(|v| match v {
            [number] => *number,
            _ => v.iter().map(|x| x * x).sum::<f64>().sqrt(),
        })
        .collect()
}

/// Returns the smallest and largest of the finite values; `None` without finite values.
fn range<'a>(values: impl Iterator<Item = &'a f64>) -> Option<[f64; 2]> {
    values.filter(|v| v.is_finite()).fold(None, |range, &v| {
        Some(range.map_or([v, v], |[low, high]: [f64; 2]| [low.min(v), high.max(v)]))
    })
}

fn fraction_of_range(value: f64, [low, high]: [f64; 2]) -> f64 {
    if high > low {
        (value - low) / (high - low)
    } else {
        0.0
    }
}

/// Returns a round length of about a fifth of `length`.
fn round_length(length: f64) -> f64 {
    let rough = length / 5.0;
    let power = 10.0_f64.powf(rough.log10().floor());
    let lead = rough / power;
    power
        * if lead >= 5.0 {
            5.0
        } else if lead >= 2.0 {
            2.0
        } else {
            1.0
        }
}

fn draw(scenes: &[Scene], field: &str, request: &PictureOptions) -> Result<String, Error> {
    let mut frame = Frame::new(scenes, request.view);
    if let Some([left, bottom, right, top]) = request.crop {
        (frame.low, frame.high) = ([left, bottom], [right, top]);
    }
    if !(frame.high[0] > frame.low[0] && frame.high[1] > frame.low[1]) {
        return Err(Error::Io("there is nothing to draw at these times".into()));
    }
    let scales = Scales::new(scenes);
    let drops = request.flow_net.unwrap_or_default();
    let panel = |scene| Panel::new(scene, &scales, &frame, (request.width.into(), drops));
    let panels: Vec<Panel> = scenes.iter().map(panel).collect();
    let Some(first) = panels.first() else {
        return Err(Error::Io("there is nothing to draw".into()));
    };
    let key = key(scenes, &scales, drops);
    let sheet = Sheet::new(&first.raster, panels.len(), scales.bars(), key.len());
    let mut svg = Svg::file(sheet.size, "font-family=\"sans-serif\" font-size=\"14\"");
    for (k, panel) in panels.iter().enumerate() {
        panel.write(&mut svg, &sheet, sheet.corner(k))?;
    }
    let foot = sheet.foot;
    let length = round_length(real(sheet.panel[0]) * first.raster.pixel);
    svg.put(format_args!(
        "<line x1=\"{GAP}\" y1=\"{foot}\" x2=\"{:.1}\" y2=\"{foot}\" stroke=\"black\" stroke-width=\"3\"/>",
        real(GAP) + length / first.raster.pixel
    ));
    svg.words([GAP, foot + 20], "", &format!("{length} m"));
    scales.write_bars(&mut svg, scenes, field, [sheet.bars, foot]);
    if !key.is_empty() {
        let y = sheet.size[1] - 8;
        svg.words([GAP, y], " font-size=\"11\"", &key);
    }
    Ok(svg.end())
}

const GAP: usize = 24;
const HEAD: usize = 22;
const BAR: usize = 52;

/// Colour and length scales common to all panels.
struct Scales {
    /// Smallest and largest value of the water; none in 3-D, where water is not drawn.
    water: Option<[f64; 2]>,
    /// Smallest and largest value of grains and faces.
    grains: Option<[f64; 2]>,
    /// Magnitude of the longest arrow.
    longest: f64,
    /// Largest contact force.
    largest: f64,
}

impl Scales {
    fn new(scenes: &[Scene]) -> Self {
        let waters = || scenes.iter().filter_map(|s| s.water.as_ref());
        let of_water = waters().flat_map(|w| {
            let cells = w.values.iter().zip(&w.solid);
            cells.filter(|(_, solid)| !**solid).map(|(v, _)| v)
        });
        let of_grains = scenes
            .iter()
            .filter_map(|s| s.grains.as_ref()?.values.as_ref());
        let of_faces = scenes
            .iter()
            .filter_map(|s| Some(&s.faces.as_ref()?.values));
        let arrows = |s: &Scene| Some(s.grains.as_ref()?.arrows.as_ref()?.longest());
        let forces = scenes.iter().filter_map(|s| s.contacts.as_ref());
        Self {
            water: range(of_water).filter(|_| waters().all(|w| w.cells[2] == 1)),
            grains: range(of_grains.chain(of_faces).flatten()),
            longest: scenes.iter().filter_map(arrows).fold(0.0, f64::max),
            largest: forces.map(Network::largest).fold(0.0, f64::max),
        }
    }

    /// Returns the number of colour bars.
    fn bars(&self) -> usize {
        usize::from(self.water.is_some()) + usize::from(self.grains.is_some())
    }

    /// Writes the colour bars one below the other; `field` is the field of the water.
    fn write_bars(&self, svg: &mut Svg, scenes: &[Scene], field: &str, [x, mut y]: [usize; 2]) {
        let named = |quantity: &str, of: &str| {
            if self.bars() > 1 {
                format!("{quantity}, {of}")
            } else {
                quantity.to_owned()
            }
        };
        let water = scenes.iter().find_map(|s| s.water.as_ref());
        if let (Some(scale), Some(water)) = (self.water, water) {
            let name = named(field, "water");
            bar(svg, [x, y], &name, &water.units, scale, water_colour);
            y += BAR;
        }
        let of_grains = scenes.iter().find_map(|s| s.grains.as_ref());
        let of_faces = scenes.iter().find_map(|s| s.faces.as_ref());
        let legend = of_faces
            .map(|faces| (&faces.quantity, &faces.units))
            .or(of_grains.map(|all| (&all.quantity, &all.units)));
        if let (Some(scale), Some((quantity, units))) = (self.grains, legend) {
            let name = named(quantity, "grains");
            bar(svg, [x, y], &name, units, scale, grain_colour);
        }
    }
}

/// Layout of the picture \[pixels\].
struct Sheet {
    /// Number of panels side by side.
    columns: usize,
    /// Width and height of a panel.
    panel: [usize; 2],
    /// Vertical position of the scale bar and of the first colour bar.
    foot: usize,
    /// Left end of the colour bars.
    bars: usize,
    /// Width and height of the picture.
    size: [usize; 2],
}

impl Sheet {
    /// Returns the layout of panels and colour bars, and below them a legend of `key` characters.
    fn new(first: &Raster, panels: usize, bars: usize, key: usize) -> Self {
        let (width, height) = (first.width, first.height);
        // Wide panels are stacked, narrow ones are side by side.
        let columns = if 2 * height < width { 1 } else { panels.min(2) };
        let below = panels.div_ceil(columns) * (height + HEAD + GAP);
        // Position to the right of the scale bar, which has a minimum width in narrow pictures.
        let x = GAP + (width / 3).max(110);
        let size = [
            (columns * width + (columns + 1) * GAP)
                .max(x + 160 + GAP)
                .max(2 * GAP + 6 * key),
            below + 16 + BAR * bars.max(1) + if key == 0 { 0 } else { 20 },
        ];
        Self {
            columns,
            panel: [width, height],
            foot: below + 20,
            bars: x,
            size,
        }
    }

    /// Returns the upper left corner of panel `k`.
    fn corner(&self, k: usize) -> [usize; 2] {
        let [width, height] = self.panel;
        [
            GAP + (k % self.columns) * (width + GAP),
            (k / self.columns) * (height + HEAD + GAP) + HEAD,
        ]
    }
}

/// Drawing of a scene.
struct Panel {
    time: f64,
    raster: Raster,
    /// Vector graphics drawn over the raster.
    lines: String,
}

impl Panel {
    /// Draws a scene; `drops` is the number of head drops of its flow net.
    fn new(scene: &Scene, scales: &Scales, frame: &Frame, (width, drops): (usize, u16)) -> Self {
        let mut raster = Raster::new(frame, width);
        if let (Some(field), Some(scale)) = (&scene.water, scales.water) {
            raster.water(frame, field, scale);
        }
        if let Some(all) = &scene.grains {
            for (k, (&p, &r)) in all.positions.iter().zip(&all.radii).enumerate() {
                let colour = match (&all.values, scales.grains) {
                    (Some(values), Some(scale)) => {
                        grain_colour(fraction_of_range(values[k], scale))
                    }
                    _ => SAND,
                };
                raster.grain(frame, p, r, colour, all.flat);
            }
        }
        if let Some(structures) = &scene.structures {
            structures.paint(&mut raster, frame, |_| STONE);
        }
        if let Some(cuts) = &scene.cuts {
            cuts.paint(&mut raster, frame);
        }
        if let (Some(faces), Some(scale)) = (&scene.faces, scales.grains) {
            faces.paint(&mut raster, frame, |v| {
                grain_colour(fraction_of_range(v, scale))
            });
        }
        if let Some(walls) = &scene.walls {
            walls::paint(walls, &mut raster, frame);
        }
        let flat = scene.water.as_ref().filter(|w| w.cells[2] == 1);
        let lines = flat.filter(|w| w.flow.is_some()).map(|water| {
            streamlines::draw(water, |at| {
                [
                    (water.origin[0] + at[0] * water.spacing[0] - frame.low[0]) / raster.pixel,
                    (frame.high[1] - water.origin[1] - at[1] * water.spacing[1]) / raster.pixel,
                ]
            })
        });
        let net = scene.net.as_ref().map(|net| {
            net.draw(
                drops,
                &scene.ground,
                scene.structures.as_deref(),
                |[x, y]| raster.pixel_of(frame, [x, y, 0.0]),
            )
        });
        let over = overlay_svg(scene, scales, frame, &raster) + &net.unwrap_or_default();
        Self {
            time: scene.time,
            raster,
            lines: lines.unwrap_or_default() + &over,
        }
    }

    fn write(&self, svg: &mut Svg, sheet: &Sheet, [x, y]: [usize; 2]) -> Result<(), Error> {
        let [width, height] = sheet.panel;
        let data = base64::engine::general_purpose::STANDARD.encode(self.raster.to_png()?);
        let time = format!("t = {} s", significant_digits(self.time, 4));
        svg.words([x, y - 6], "", &time);
        svg.put(format_args!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" \
             href=\"data:image/png;base64,{data}\"/>\n\
             <rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#444\"/>"
        ));
        let lines = &self.lines;
        if !lines.is_empty() {
            svg.put(format_args!(
                "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\">\n{lines}</svg>"
            ));
        }
        Ok(())
    }
}

/// Returns the arrows and contacts of a panel as SVG.
fn overlay_svg(scene: &Scene, scales: &Scales, frame: &Frame, raster: &Raster) -> String {
    let mut text = String::new();
    if let Some(cuts) = &scene.cuts {
        text += &cuts.draw(frame, raster);
    }
    if let Some(network) = &scene.contacts {
        text += &network.draw(scales.largest, frame, raster);
    }
    if let Some(grains) = &scene.grains
        && let Some(arrows) = &grains.arrows
    {
        text += &arrows.draw(&grains.positions, scales.longest, frame, raster);
    }
    text
}

/// Returns a text with the longest arrow, the widest line and the flow net of all panels; empty without them.
fn key(scenes: &[Scene], scales: &Scales, drops: u16) -> String {
    let mut parts = Vec::new();
    let arrows = |s: &'_ Scene| -> Option<String> {
        let arrows = s.grains.as_ref()?.arrows.as_ref()?;
        let (name, length) = (
            arrows.quantity.replace('_', " "),
            significant_digits(scales.longest, 3),
        );
        Some(format!("longest arrow: {name} {length} {}", arrows.units))
    };
    let network = |s: &'_ Scene| -> Option<String> {
        let units = &s.contacts.as_ref()?.units;
        Some(format!(
            "widest line: {} {units}",
            significant_digits(scales.largest, 3)
        ))
    };
    parts.extend(scenes.iter().find_map(arrows));
    parts.extend(scenes.iter().find_map(network));
    parts.extend(scenes.iter().find_map(|s| Some(s.net.as_ref()?.key(drops))));
    parts.join("; ")
}

/// Returns a colour bar with ticks at its ends and its middle.
fn bar(
    svg: &mut Svg,
    [x, y]: [usize; 2],
    quantity: &str,
    units: &str,
    scale: [f64; 2],
    colour: fn(f64) -> [f64; 3],
) {
    const STEPS: usize = 40;
    const STEP: usize = 4;
    for k in 0..STEPS {
        let [r, g, b] = colour(real(k) / real(STEPS - 1)).map(byte);
        svg.put(format_args!(
            "<rect x=\"{}\" y=\"{}\" width=\"{STEP}\" height=\"10\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>",
            x + k * STEP,
            y - 8
        ));
    }
    let largest = scale[0].abs().max(scale[1].abs());
    for (place, anchor, value) in [
        (0, "start", scale[0]),
        (STEPS / 2, "middle", f64::midpoint(scale[0], scale[1])),
        (STEPS, "end", scale[1]),
    ] {
        let x = x + place * STEP;
        // Rounding errors are shown as zero.
        let tiny = value.abs() < 1e-9 * largest;
        let value = significant_digits(if tiny { 0.0 } else { value }, 3);
        let more = format!(" font-size=\"11\" text-anchor=\"{anchor}\"");
        svg.put(format_args!(
            "<line x1=\"{x}\" y1=\"{}\" x2=\"{x}\" y2=\"{}\" stroke=\"black\"/>{}",
            y - 8,
            y + 5,
            text_element([x, y + 16], &more, &value)
        ));
    }
    let quantity = quantity.replace('_', " ");
    svg.words([x, y + 32], "", &format!("{quantity} [{units}]"));
}

/// Returns a number with this many significant digits, without trailing zeros.
fn significant_digits(value: f64, digits: usize) -> String {
    let scientific = format!("{value:.*e}", digits - 1);
    let (mantissa, power) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let power: i32 = power.parse().unwrap_or(0);
    let trim = |text: &str| {
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text.to_owned()
        }
    };
    match usize::try_from(power) {
        _ if value == 0.0 => "0".into(),
        Ok(up) if up < 5 => trim(&format!("{value:.*}", (digits - 1).saturating_sub(up))),
        Err(_) if power >= -3 => {
            let down = usize::try_from(-power).unwrap_or(0);
            trim(&format!("{value:.*}", digits - 1 + down))
        }
        _ => format!("{}e{power}", trim(mantissa)),
    }
}

#[cfg(test)]
mod tests;
