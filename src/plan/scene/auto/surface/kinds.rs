//! Kinds of flow with a free surface whose errors were measured, found in a scene.

use crate::scene::Scene;
use crate::scene::flow::Flow as Fluid;
use crate::scene::free_surface::{FreeSurface, SolitaryForm, WaterPart, WaveForm};
use crate::scene::observe::ProbeAt;
use crate::scene::structures::Structure;
use base::number::real;
use case::fluid::{Collision, Turbulence};
use lbm::boundary::SurfaceKind;
use serde::Serialize;

/// Largest lattice velocity U dt/h of the rows.
const MOST_LATTICE_VELOCITY: f64 = 0.1;
/// Largest change of the density under the weight of the water: the rows have up to 0.8 %.
const MOST_DENSITY_CHANGE: f64 = 0.01;
/// Gauges closer to the end of a tank, in depths, see the wave and its reflection at once.
const CLEAR_OF_AN_END: f64 = 5.0;
/// Speed of the front of a dam over a dry bed in (g H)^½, by A. Ritter (Z. VDI 36 (1892) 947): an upper bound.
const FRONT: f64 = 2.0;

/// Kind of flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flow {
    StandingWave,
    SolitaryWave,
    Film,
    DryDam,
    WetDam,
    Sluice,
}

impl Flow {
    fn name(self) -> &'static str {
        match self {
            Self::StandingWave => "standing wave",
            Self::SolitaryWave => "solitary wave",
            Self::Film => "film",
            Self::DryDam => "dam over a dry bed",
            Self::WetDam => "dam over a wet bed",
            Self::Sluice => "sluice gate",
        }
    }
}

/// Flow with a free surface, with the lengths and numbers on which its errors depend.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceFlow {
    /// Kind of flow.
    #[serde(skip)]
    pub(super) flow: Flow,
    /// Kind of flow with its operator, as in the table of measured errors.
    pub kind: String,
    /// Lengths that the cells must resolve, the shortest first.
    pub lengths: Vec<SurfaceLength>,
    /// Speed of the water or of its waves [m/s].
    pub speed: f64,
    /// Cell Reynolds number U h/ν.
    pub cell_reynolds: f64,
    /// Dimensionless number of the flow.
    pub shape: f64,
    /// Name of this number.
    pub shape_name: &'static str,
    /// Height to which errors of elevations are relative \[m\].
    #[serde(skip)]
    pub(super) scale: f64,
}

/// Length that the cells must resolve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceLength {
    /// Part of the flow.
    pub what: &'static str,
    /// Length \[m\].
    pub size: f64,
    /// Cells across it.
    pub cells: f64,
}

impl SurfaceFlow {
    /// Returns the number of cells across the shortest length.
    #[must_use]
    pub fn cells(&self) -> f64 {
        self.lengths.first().map_or(0.0, |length| length.cells)
    }
}

/// Numbers of a flow before its cells are known.
struct Found {
    flow: Flow,
    lengths: Vec<(&'static str, f64)>,
    speed: f64,
    shape: (&'static str, f64),
    scale: f64,
}

/// Returns the flow of a scene.
///
/// # Errors
/// If no error was measured for it, with the reason.
pub(super) fn find(scene: &Scene) -> Result<SurfaceFlow, String> {
    let (Some(surface), Some(fluid)) = (&scene.surface, &scene.flow) else {
        return Err("there is no free surface".into());
    };
    covered(scene, surface)?;
    let found = of_parts(scene, surface, fluid)?;
    let h = scene.grid.spacing;
    let lattice_velocity = found.speed * fluid.time_step / h;
    if lattice_velocity > MOST_LATTICE_VELOCITY * (1.0 + 1e-6) {
        return Err(format!(
            "the lattice velocity {lattice_velocity:.3} is above the measured {MOST_LATTICE_VELOCITY}"
        ));
    }
    let weight = 3.0 * surface.gravity * surface.head() * (fluid.time_step / h).powi(2);
    if weight > MOST_DENSITY_CHANGE {
        return Err(format!(
            "the density changes by {:.1} % under the weight of the water, above the measured {} %; use a shorter \
             time step",
            100.0 * weight,
            100.0 * MOST_DENSITY_CHANGE
        ));
    }
    let mut lengths: Vec<SurfaceLength> = (found.lengths.into_iter())
        .map(|(what, size)| SurfaceLength {
            what,
            size,
            cells: size / h,
        })
        .collect();
    lengths.sort_by(|a, b| a.size.total_cmp(&b.size));
    Ok(SurfaceFlow {
        flow: found.flow,
        kind: format!("{} ({})", found.flow.name(), operator(fluid)?),
        lengths,
        speed: found.speed,
        cell_reynolds: found.speed * h / fluid.kinematic_viscosity,
        shape: found.shape.1,
        shape_name: found.shape.0,
        scale: found.scale,
    })
}

/// Checks that a scene has nothing that no row has.
fn covered(scene: &Scene, surface: &FreeSurface) -> Result<(), String> {
    let none = |what: &str| Err(format!("no error was measured for {what}"));
    if scene.grid.dimension == 3 {
        return none("water with a free surface in three dimensions");
    }
    if scene.has_solids() {
        return none("bodies in water with a free surface");
    }
    if surface.tension.is_some() {
        return none("a surface tension");
    }
    if let Some(term) = scene.terms.first() {
        return none(&format!("{} below a free surface", term.model().name()));
    }
    Ok(())
}

/// Returns the operator with its eddy viscosity.
fn operator(fluid: &Fluid) -> Result<&'static str, String> {
    match (&fluid.models.collision, &fluid.models.turbulence) {
        (Collision::Trt(_), None) => Ok("TRT"),
        (Collision::Bgk(_), Some(Turbulence::Smagorinsky(_))) => Ok("BGK with Smagorinsky"),
        _ => Err(
            "the errors below a free surface were measured with TRT, and with BGK and Smagorinsky, not with this \
             operator and eddy viscosity"
                .into(),
        ),
    }
}

/// Returns `true` if the whole lower face along an axis, or the upper one, is one of free slip.
fn slips(scene: &Scene, fluid: &Fluid, axis: usize, upper: bool) -> bool {
    let face = &fluid.faces[2 * axis + usize::from(upper)];
    let whole = face.iter().all(|patch| {
        let axes = (0..scene.grid.dimension).filter(|a| *a != axis);
        let mut axes = axes.map(|a| patch.from[a] == 0 && patch.to[a] == scene.grid.cells[a]);
        axes.all(|whole| whole)
    });
    let last = face.last();
    whole && last.is_some_and(|p| p.condition.model().kind().surface == SurfaceKind::Symmetry)
}

/// Returns the flow that follows from the initial water, the openings and the structures.
fn of_parts(scene: &Scene, surface: &FreeSurface, fluid: &Fluid) -> Result<Found, String> {
    let bed = slips(scene, fluid, surface.axis, !surface.rises);
    let along = 1 - surface.axis;
    let ends = scene.grid.periodic[along]
        || [false, true].map(|upper| slips(scene, fluid, along, upper)) == [true; 2];
    let frictionless = |what: &str, holds: bool| {
        if holds {
            Ok(())
        } else {
            Err(format!(
                "no error was measured for a {what} with friction at its bed or its ends"
            ))
        }
    };
    let solids: Vec<&Structure> = (scene.structures.iter())
        .filter(|structure| structure.stops.water())
        .collect();
    if !surface.openings.is_empty() {
        frictionless("channel", bed)?;
        return past_structure(scene, surface, &solids);
    }
    if !solids.is_empty() {
        return Err("no error was measured for structures in a closed tank".into());
    }
    match &surface.parts[..] {
        [WaterPart::Wave(wave)] => {
            frictionless("standing wave", bed && ends)?;
            Ok(standing(surface, wave))
        }
        [WaterPart::Solitary(wave)] => {
            frictionless("solitary wave", bed)?;
            Ok(solitary(wave))
        }
        [WaterPart::Level(_)] => film(scene, surface, fluid, along),
        parts => {
            frictionless("dam", bed)?;
            dam(scene, surface, parts)
        }
    }
}

fn standing(surface: &FreeSurface, wave: &WaveForm) -> Found {
    let depth = surface.above(wave.level());
    let k = wave.wave_number();
    Found {
        flow: Flow::StandingWave,
        lengths: vec![("wave length over 2 pi", 1.0 / k), ("depth", depth)],
        speed: (surface.gravity / k * (k * depth).tanh()).sqrt(),
        shape: ("amplitude times wave number", k * wave.amplitude()),
        scale: wave.amplitude(),
    }
}

fn solitary(wave: &SolitaryForm) -> Found {
    let [depth, height] = [wave.depth(), wave.crest_height()];
    Found {
        flow: Flow::SolitaryWave,
        lengths: vec![("depth", depth)],
        speed: wave.speed(),
        shape: ("height over depth", height / depth),
        scale: height,
    }
}

fn film(
    scene: &Scene,
    surface: &FreeSurface,
    fluid: &Fluid,
    along: usize,
) -> Result<Found, String> {
    let depth = surface.standing_head();
    let pull = scene.gravity[along].abs();
    if pull == 0.0 {
        return Err("water with a level surface is at rest: no answer was measured".into());
    }
    let wall = !slips(scene, fluid, surface.axis, !surface.rises);
    if !(scene.grid.periodic[along] && wall) {
        return Err(
            "no error was measured for a stream down a slope that is not periodic, or without friction".into(),
        );
    }
    let speed = pull * depth * depth / (2.0 * fluid.kinematic_viscosity);
    Ok(Found {
        flow: Flow::Film,
        lengths: vec![("depth", depth)],
        speed,
        shape: ("Froude number", speed / (surface.gravity * depth).sqrt()),
        scale: depth,
    })
}

fn dam(scene: &Scene, surface: &FreeSurface, parts: &[WaterPart]) -> Result<Found, String> {
    let other = || "no error was measured for this initial water".to_owned();
    let mut columns = parts.iter().filter_map(|part| match part {
        WaterPart::Solid(solid) => Some(solid),
        _ => None,
    });
    let levels: Vec<f64> = (parts.iter())
        .filter_map(|part| match part {
            WaterPart::Level(height) => Some(surface.above(*height)),
            _ => None,
        })
        .collect();
    let (Some(column), None, true) = (columns.next(), columns.next(), levels.len() < 2) else {
        return Err(other());
    };
    if levels.len() + 1 != parts.len() {
        return Err(other());
    }
    let (up, along) = (surface.axis, 1 - surface.axis);
    let mut boxes = column.extents();
    let (Some([low, high]), None) = (boxes.next(), boxes.next()) else {
        return Err(other());
    };
    let (size, h) = (scene.grid.size[along], scene.grid.spacing);
    let [left, right] = [low[along].max(0.0), high[along].min(size)];
    let heights = [surface.above(low[up]), surface.above(high[up])];
    let [foot, height] = [heights[0].min(heights[1]), heights[0].max(heights[1])];
    // A box contains points near its corners.
    let inside = |x: f64, y: f64| {
        let mut at = [0.0; 3];
        (at[along], at[up]) = (x, y);
        column.distance(at) < 0.0
    };
    let near = [0.01, 0.99];
    let filled = near.iter().all(|a| {
        near.iter().all(|b| {
            inside(
                low[along] + a * (high[along] - low[along]),
                low[up] + b * (high[up] - low[up]),
            )
        })
    });
    let at_left = left < 0.5 * h;
    let at_right = right > size - 0.5 * h;
    if !filled || foot > 0.5 * h || at_left == at_right {
        return Err(
            "no error was measured for water that does not stand as a column on the bed at one end"
                .into(),
        );
    }
    let level = levels.first().copied().unwrap_or(0.0);
    if level >= height {
        return Err(other());
    }
    let speed = (2.0 * surface.gravity * height).sqrt();
    let ahead = if at_left { size - right } else { left };
    let reached = FRONT * (surface.gravity * height).sqrt() * scene.time.end;
    if reached > ahead * (1.0 + 1e-6) {
        return Err(format!(
            "the run ends {:.3} s after the water can reach the other end: no error was measured for its return",
            scene.time.end - ahead / (FRONT * (surface.gravity * height).sqrt())
        ));
    }
    let duration = scene.time.end / (height / surface.gravity).sqrt();
    let mut lengths = vec![
        ("height of the column", height),
        ("width of the column", right - left),
    ];
    let flow = if level > 0.0 {
        lengths.push(("depth of the tailwater times three", 3.0 * level));
        Flow::WetDam
    } else {
        Flow::DryDam
    };
    Ok(Found {
        flow,
        lengths,
        speed,
        shape: ("duration over (H/g)^½", duration),
        scale: height,
    })
}

/// Returns the flow below a gate between a level and an outfall.
fn past_structure(
    scene: &Scene,
    surface: &FreeSurface,
    solids: &[&Structure],
) -> Result<Found, String> {
    let other = "no error was measured for flow between these openings";
    let levels: Vec<[f64; 2]> = surface.openings.iter().filter_map(|o| o.levels()).collect();
    let outfalls = (surface.openings.iter())
        .filter(|o| o.head.is_none() && o.depth.is_none())
        .count();
    let ([[low, high]], 1, 2) = (&levels[..], outfalls, surface.openings.len()) else {
        return Err(other.into());
    };
    if (high - low).abs() > 1e-9 * high {
        return Err("no error was measured for a level that changes".into());
    }
    let [structure] = solids else {
        return Err(format!("{other} with {} structures", solids.len()));
    };
    let mut boxes = structure.solid.extents();
    let (Some([from, to]), None) = (boxes.next(), boxes.next()) else {
        return Err(other.into());
    };
    let up = surface.axis;
    let heights = [surface.above(from[up]), surface.above(to[up])];
    let [foot, top] = [heights[0].min(heights[1]), heights[0].max(heights[1])];
    let h = scene.grid.spacing;
    if foot > h && top > *high {
        return Ok(Found {
            flow: Flow::Sluice,
            lengths: vec![("opening below the gate", foot)],
            speed: (2.0 * surface.gravity * (high - foot)).sqrt(),
            shape: ("head over opening", high / foot),
            scale: foot,
        });
    }
    Err("no error was measured for this structure below a free surface".into())
}

/// Returns `true` for a gauge whose column is close to an end of the domain along the flow.
pub(super) fn is_beside_an_end(scene: &Scene, cell: [usize; 3]) -> bool {
    let Some(surface) = &scene.surface else {
        return false;
    };
    let along = 1 - surface.axis;
    let depth = surface.parts.iter().find_map(|part| match part {
        WaterPart::Solitary(wave) => Some(wave.depth()),
        _ => None,
    });
    let at = (real(cell[along]) + 0.5) * scene.grid.spacing;
    let clear = CLEAR_OF_AN_END * depth.unwrap_or(0.0);
    at.min(scene.grid.size[along] - at) < clear
}

/// Returns `true` for a gauge whose column has no water at the start.
pub(super) fn is_dry(scene: &Scene, cell: [usize; 3]) -> bool {
    let Some(surface) = &scene.surface else {
        return true;
    };
    (0..scene.grid.cells[surface.axis]).all(|n| {
        let mut cell = cell;
        cell[surface.axis] = n;
        surface.fill(cell) <= 0.0
    })
}

/// Returns the name of what a probe measures.
pub(super) fn quantity(at: &ProbeAt) -> &'static str {
    match at {
        ProbeAt::Gauge(_) => "elevation",
        ProbeAt::Plane { .. } => "discharge",
        ProbeAt::Point(_) | ProbeAt::Line { .. } => "velocity and pressure",
        ProbeAt::Wall(_) | ProbeAt::Structure { .. } | ProbeAt::Body(_) => "force",
        _ => "value",
    }
}
