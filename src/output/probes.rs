//! Values over time at points, lines, planes, bodies and faces: one CSV file `probe_NAME.csv` each.
//!
//! Every file begins with the columns `step` and `time`. Forces on walls and structures are means over the last step,
//! so that their `time` is half a step before the end of `step`; the load of the water on a body is the mean over the
//! last two steps, at `fluid_force_time`. The columns are the same in 2-D and 3-D. Every value is gathered from the
//! ranks that own it, or summed without rounding, so that it does not depend on their number.
//!
//! | probe | columns |
//! |---|---|
//! | point | velocity, pressure; in seepage also the hydraulic head, of the cell that holds the point |
//! | line | distance from the first point, position, velocity, pressure; head in seepage; a row per point and time |
//! | plane | discharge, means over the fluid cells, largest speed, fluid fraction |
//! | gauge | elevation of a free surface, depth of the water below it |
//! | body | position (never wrapped), velocity, angular velocity, force and torque of fluid and contacts |
//! | structure | force and torque of the fluid, the torque about a point |
//! | section | of seepage: discharge, open area, mean heads before and behind |
//! | crossing | of seepage: discharge between two points |
//! | heave | of seepage: width, excess head, gradient and factor of safety of prisms; one row per width and time |
//! | water table | of seepage: position of zero pressure; one row per column of cells and time |
//! | water balance | of seepage in time: water in the ground, in and out since the start, inflow, outflow |
//! | joint | of water in joints: pressure, aperture and position of the cell nearest to a point |
//! | mouth | of water in joints: discharge into the joints and mean pressure in front of the mouth |
//! | block | of water in joints: force and torque on a block, pressures, area, position and velocity |
//! | uplift | of seepage: force on a part of a plane, its torque about a point, mean pressure, area |
//! | wall | force of the fluid, its parts, mean pressure and shear stress, mass flux |
//! | grains | number, solid fraction, coordination number and mean stress of the grains in a box; d50 |
//! | bed | surface, scour, shear stress, Shields number and bedload of a bed of grains |
//!
//! **Points** are interpolated linearly along each axis from the cell centres; in the half cell next to a face the
//! values are extrapolated. Covered cells count with their values. **Planes** are interpolated between the two adjacent
//! planes of cells; only cells whose centre is in the fluid count, below a free surface by their fill levels.
//! **Faces**: see [`wall`]. **Beds**: see [`bed`]. **Grains**: see [`fabric`].

mod bed;
mod fabric;
mod gauge;
mod joints;
mod points;
mod seepage;
mod wall;
mod water_table;

use super::grains::{force_unit, space_vector, spin_vector, torque_unit};
use super::group::RankGroup;
use super::schedule::Schedule;
use crate::view::StateView;
use base::error::Error;
use base::number::real;
use base::units::LatticeUnits;
use bed::Bed;
use coupling::FluidView;
use coupling::loads::about_centre;
use darcy::Prisms;
use decomposition::{Domain, ExactSum};
use dem::space::Space;
use fabric::Fabric;
use gauge::Gauge;
use io::CsvTable;
use lbm::links::Load;
use plan::Plan;
use plan::scene::Scene;
use plan::scene::observe::{ProbeAt, RegionAction};
use points::{Points, along, clamped};
use seepage::{Crossing, Section, SurfaceLoad};
use std::path::{Path, PathBuf};
use wall::Wall;
use water_table::Columns;

/// A probe with its file.
#[derive(Debug)]
pub(crate) struct Probe {
    pub(crate) schedule: Schedule,
    at: At,
    /// The step of the last sample, where it is known.
    pub(crate) last: Option<u64>,
    path: PathBuf,
    headings: Vec<Heading>,
    /// Table of the probe, on rank 0.
    table: Option<CsvTable>,
    /// The rows of one sample, on rank 0; reused.
    rows: Vec<Vec<f64>>,
}

#[derive(Debug)]
enum At {
    Point(Points),
    Line(Points),
    Plane {
        axis: usize,
        position: f64,
    },
    Body(u64),
    Structure(usize, [f64; 3]),
    /// The surface of a structure in seepage.
    SurfaceLoad(SurfaceLoad),
    /// A point in seepage \[m\].
    Pores([f64; 3]),
    /// Points along a line in seepage \[m\].
    PoresLine(Vec<[f64; 3]>),
    Crossing(Crossing),
    Heave(Prisms),
    Section(Section),
    WaterTable(Columns),
    WaterBalance,
    Uplift(Section, [f64; 3]),
    /// A point in a joint \[m\].
    Joint([f64; 3]),
    Mouth(usize),
    Block(usize),
    Gauge(Gauge),
    Wall(Box<Wall>),
    Bed(Box<Bed>),
    Grains(Box<Fabric>),
}

/// Steps between the force of the water on a body and its row: it is the mean over the last two steps.
const LOAD_OF_A_BODY: f64 = 1.0;

/// A column and its unit.
type Heading = (&'static str, &'static str);

const TIME: Heading = ("time", "s");
const VELOCITY: [Heading; 3] = [
    ("velocity_x", "m/s"),
    ("velocity_y", "m/s"),
    ("velocity_z", "m/s"),
];
const POSITION: [Heading; 3] = [("x", "m"), ("y", "m"), ("z", "m")];

impl Probe {
    /// Returns all probes of the plan. Collective.
    pub(crate) fn all(
        plan: &Plan,
        folder: &Path,
        domain: &Domain,
        resumed_at: Option<u64>,
    ) -> Result<Vec<Self>, Error> {
        let probes = plan.scene.probes.iter();
        probes
            .map(|probe| {
                let mut at = At::new(plan, &probe.at, folder, domain, resumed_at)?;
                let headings = headings(&plan.scene, &probe.at);
                let path = folder.join(format!("probe_{}.csv", probe.name));
                let every = Some(plan.clock.every(probe.every));
                let mut table = None;
                let group = RankGroup(domain.communicator());
                let written = group.on_root(|| {
                    let (opened, written) = open(&path, &headings, resumed_at, at.rows() as u64)?;
                    table = Some(opened);
                    if resumed_at.is_some() {
                        at.remember(&path)?;
                    }
                    Ok(written)
                })?;
                let schedule = match resumed_at {
                    Some(step) => Schedule::resumed(every, step, written),
                    None => Schedule::new(every),
                };
                Ok(Self {
                    schedule,
                    at,
                    last: resumed_at.filter(|_| written),
                    path,
                    headings,
                    table,
                    rows: Vec::new(),
                })
            })
            .collect()
    }

    /// Samples and writes the rows of this step. Collective.
    pub(crate) fn write<S: Space>(&mut self, view: &StateView<S>) -> Result<(), Error> {
        let width = self.headings.len();
        let time = (view.time - self.at.delay() * view.plan.clock.time_step).max(0.0);
        self.rows.resize_with(self.at.rows(), Vec::new);
        for row in &mut self.rows {
            row.clear();
            row.reserve(width);
            row.push(time);
        }
        let here = self.at.sample(view, &mut self.rows)?;
        self.last = Some(view.step);
        RankGroup(view.domain.communicator()).on_root(|| {
            if let (Some(table), true) = (&mut self.table, here) {
                for row in &self.rows {
                    table.row(view.step, row)?;
                }
            }
            Ok(())
        })
    }

    /// Drops the sample of `step` where that is none of its interval. Collective.
    pub(crate) fn drop_end(&mut self, step: u64, group: &RankGroup) -> Result<(), Error> {
        if self.last != Some(step) || self.schedule.falls_on(step) {
            return Ok(());
        }
        self.last = None;
        let Self {
            path,
            headings,
            table,
            ..
        } = self;
        group.on_root(|| {
            *table = Some(before(path, headings, step)?);
            Ok(())
        })
    }

    /// Flushes the rows to the disk itself, on rank 0.
    pub(crate) fn sync(&self) -> io::Result<()> {
        self.table.as_ref().map_or(Ok(()), CsvTable::sync)
    }
}

/// Opens a new table, or that of an earlier part of the run; returns also `true` if it holds a whole sample of the step
/// that the run continues from.
fn open(
    path: &Path,
    headings: &[Heading],
    resumed_at: Option<u64>,
    rows: u64,
) -> io::Result<(CsvTable, bool)> {
    let Some(step) = resumed_at else {
        return Ok((CsvTable::create(path, headings)?, false));
    };
    let table = CsvTable::resume(path, headings, step)?;
    let steps = io::table::read(path)?.steps;
    let there = steps.iter().rev().take_while(|&&s| s == step).count() as u64;
    if there == 0 || there == rows {
        return Ok((table, there > 0));
    }
    // A sample cut short by the end of the run is taken again.
    Ok((before(path, headings, step)?, false))
}

/// Returns the table without its rows from `step` on.
fn before(path: &Path, headings: &[Heading], step: u64) -> io::Result<CsvTable> {
    match step.checked_sub(1) {
        Some(before) => CsvTable::resume(path, headings, before),
        None => CsvTable::create(path, headings),
    }
}

/// Returns the names of the columns of the table of a probe.
#[must_use]
pub fn columns(scene: &Scene, at: &ProbeAt) -> Vec<&'static str> {
    let names = headings(scene, at).into_iter().map(|(name, _)| name);
    std::iter::once("step").chain(names).collect()
}

/// Returns the columns of the table of a probe with their units, without the step.
fn headings(scene: &Scene, at: &ProbeAt) -> Vec<Heading> {
    let dimension = scene.grid.dimension;
    let flat = dimension == 2;
    let (force, torque) = (force_unit(dimension), torque_unit(dimension));
    let mut headings = vec![TIME];
    match at {
        ProbeAt::Bed(_) => return bed::HEADINGS.to_vec(),
        ProbeAt::Grains { .. } => return fabric::HEADINGS.to_vec(),
        ProbeAt::Point(_) => {
            headings.extend(VELOCITY);
            headings.push(("pressure", "Pa"));
            headings.extend(scene.seepage.iter().map(|_| ("head", "m")));
        }
        ProbeAt::Line { .. } => {
            headings.push(("distance", "m"));
            headings.extend(POSITION);
            headings.extend(VELOCITY);
            headings.push(("pressure", "Pa"));
            headings.extend(scene.seepage.iter().map(|_| ("head", "m")));
        }
        ProbeAt::Crossing { .. } => {
            headings.push(("discharge", if flat { "m2/s" } else { "m3/s" }));
        }
        ProbeAt::Heave(_) => headings.extend([
            ("width", "m"),
            ("excess_head", "m"),
            ("gradient", "-"),
            ("factor_of_safety", "-"),
        ]),
        ProbeAt::WaterTable(_) => headings.extend(POSITION),
        ProbeAt::Uplift { .. } => headings.extend([
            ("force", force),
            ("torque_x", torque),
            ("torque_y", torque),
            ("torque_z", torque),
            ("mean_pressure", "Pa"),
            ("area", if flat { "m" } else { "m2" }),
        ]),
        ProbeAt::WaterBalance => {
            let (volume, flow) = if flat { ("m2", "m2/s") } else { ("m3", "m3/s") };
            headings.extend([
                ("stored", volume),
                ("entered", volume),
                ("left", volume),
                ("inflow", flow),
                ("outflow", flow),
            ]);
        }
        ProbeAt::Joint(_) => {
            headings.extend([("pressure", "Pa"), ("aperture", "m")]);
            headings.extend(POSITION);
        }
        ProbeAt::Mouth(_) => headings.extend([("inflow", "m3/s"), ("pressure", "Pa")]),
        ProbeAt::Block(_) => headings.extend(joints::BLOCK),
        ProbeAt::Gauge(_) => headings.extend([("elevation", "m"), ("depth", "m")]),
        ProbeAt::Section { .. } => headings.extend([
            ("discharge", if flat { "m2/s" } else { "m3/s" }),
            ("open_area", if flat { "m" } else { "m2" }),
            ("head_before", "m"),
            ("head_behind", "m"),
        ]),
        ProbeAt::Structure { .. } => headings.extend([
            ("fluid_force_x", force),
            ("fluid_force_y", force),
            ("fluid_force_z", force),
            ("fluid_torque_x", torque),
            ("fluid_torque_y", torque),
            ("fluid_torque_z", torque),
        ]),
        ProbeAt::Plane { .. } => {
            headings.push(("discharge", if flat { "m2/s" } else { "m3/s" }));
            headings.extend([
                ("mean_velocity_x", "m/s"),
                ("mean_velocity_y", "m/s"),
                ("mean_velocity_z", "m/s"),
                ("mean_pressure", "Pa"),
                ("largest_speed", "m/s"),
                ("fluid_share", "-"),
            ]);
        }
        ProbeAt::Body(_) => {
            headings.extend(POSITION);
            headings.extend(VELOCITY);
            headings.extend([
                ("angular_velocity_x", "rad/s"),
                ("angular_velocity_y", "rad/s"),
                ("angular_velocity_z", "rad/s"),
                ("fluid_force_time", "s"),
                ("fluid_force_x", force),
                ("fluid_force_y", force),
                ("fluid_force_z", force),
                ("fluid_torque_x", torque),
                ("fluid_torque_y", torque),
                ("fluid_torque_z", torque),
                ("contact_force_x", force),
                ("contact_force_y", force),
                ("contact_force_z", force),
                ("contact_torque_x", torque),
                ("contact_torque_y", torque),
                ("contact_torque_z", torque),
            ]);
        }
        ProbeAt::Wall(_) => headings.extend([
            ("force_x", force),
            ("force_y", force),
            ("force_z", force),
            ("normal_force", force),
            ("shear_force", force),
            ("mean_pressure", "Pa"),
            ("mean_shear_stress", "Pa"),
            ("mass_flux", if flat { "kg/(m s)" } else { "kg/s" }),
        ]),
    }
    headings
}

impl At {
    fn new(
        plan: &Plan,
        at: &ProbeAt,
        folder: &Path,
        domain: &Domain,
        resumed_at: Option<u64>,
    ) -> Result<Self, Error> {
        let scene = &plan.scene;
        Ok(match at {
            ProbeAt::Point(point) if scene.seepage.is_some() => Self::Pores(*point),
            ProbeAt::Point(point) => Self::Point(Points::new(&[*point], &scene.grid, domain)?),
            ProbeAt::Line { from, to, points } if scene.seepage.is_some() => {
                Self::PoresLine(along(*from, *to, *points))
            }
            ProbeAt::Crossing { from, to } => {
                let seepage = scene.seepage.as_ref().ok_or_else(no_fluid)?;
                Self::Crossing(Crossing::new(seepage, *from, *to))
            }
            ProbeAt::Heave(heave) => Self::Heave(*heave),
            ProbeAt::Line { from, to, points } => Self::Line(Points::new(
                &along(*from, *to, *points),
                &scene.grid,
                domain,
            )?),
            ProbeAt::Plane { axis, position } => Self::Plane {
                axis: *axis,
                position: *position,
            },
            // Named bodies have the ids 0, 1, … in the order of the case.
            ProbeAt::Body(index) => Self::Body(*index as u64),
            ProbeAt::Structure { index, about } => match &scene.seepage {
                Some(seepage) => Self::SurfaceLoad(SurfaceLoad::new(seepage, *index, *about)),
                None => Self::Structure(*index, *about),
            },
            ProbeAt::Section {
                axis,
                position,
                part,
            } => {
                let seepage = scene.seepage.as_ref().ok_or_else(no_fluid)?;
                Self::Section(Section::new(seepage, *axis, *position, part.as_ref()))
            }
            ProbeAt::WaterBalance => Self::WaterBalance,
            ProbeAt::Joint(point) => Self::Joint(*point),
            ProbeAt::Mouth(index) => Self::Mouth(*index),
            ProbeAt::Block(index) => Self::Block(*index),
            ProbeAt::Uplift {
                axis,
                position,
                part,
                about,
            } => {
                let seepage = scene.seepage.as_ref().ok_or_else(no_fluid)?;
                let section = Section::new(seepage, *axis, *position, part.as_ref());
                Self::Uplift(section, *about)
            }
            ProbeAt::WaterTable(_) => {
                let seepage = scene.seepage.as_ref().ok_or_else(no_fluid)?;
                Self::WaterTable(Columns::new(seepage, scene.gravity))
            }
            ProbeAt::Gauge(cell) => {
                let surface = scene.surface.as_ref().ok_or_else(no_fluid)?;
                let grid = &scene.grid;
                let cells = grid.cells[surface.axis];
                Self::Gauge(Gauge::new(surface, *cell, cells, grid.spacing))
            }
            ProbeAt::Wall(face) => {
                let flow = scene.flow.as_ref().ok_or_else(no_fluid)?;
                Self::Wall(Box::new(Wall::new(
                    *face,
                    flow,
                    &scene.grid,
                    // A checkpoint holds no fluxes.
                    resumed_at.or((plan.clock.warm_up_steps == 0).then_some(0)),
                )))
            }
            ProbeAt::Grains { part, .. } => {
                let removes = |action: &RegionAction| matches!(action, RegionAction::Remove { .. });
                let removes = scene.regions.iter().any(|region| removes(&region.action));
                Self::Grains(Box::new(Fabric::new(
                    *part,
                    removes.then(|| folder.join("removed.csv")),
                )))
            }
            ProbeAt::Bed(bed) => Self::Bed(Box::new(Bed::new(bed))),
        })
    }

    /// Takes from the rows of an earlier part of the run what later rows depend on.
    fn remember(&mut self, path: &Path) -> io::Result<()> {
        if let Self::Bed(bed) = self
            && bed.level.is_none()
        {
            let rows = io::table::read(path)?;
            let surfaces = rows.column("surface_height").unwrap_or_default();
            bed.level = surfaces.into_iter().find(|height| height.is_finite());
        }
        Ok(())
    }

    /// Returns the rows of one sample.
    fn rows(&self) -> usize {
        match self {
            Self::Line(points) => points.len(),
            Self::PoresLine(points) => points.len(),
            Self::WaterTable(columns) => columns.len(),
            Self::Heave(heave) => heave.widths(),
            _ => 1,
        }
    }

    /// Appends this step's values to the rows, which hold the time, on rank 0; whether there is anything to sample.
    /// Collective.
    fn sample<S: Space>(
        &mut self,
        view: &StateView<S>,
        rows: &mut [Vec<f64>],
    ) -> Result<bool, Error> {
        match self {
            Self::Point(points) => {
                let samples = points.sample(fluid(view)?, view.domain)?;
                for (row, (_, velocity, pressure)) in rows.iter_mut().zip(samples) {
                    row.extend(velocity);
                    row.push(pressure);
                }
            }
            Self::Line(points) => {
                let samples = points.sample(fluid(view)?, view.domain)?;
                let mut first = None;
                for (row, (at, velocity, pressure)) in rows.iter_mut().zip(samples) {
                    let from: [f64; 3] = *first.get_or_insert(at);
                    let squared: f64 = (0..3).map(|a| (at[a] - from[a]).powi(2)).sum();
                    row.push(squared.sqrt());
                    row.extend(at);
                    row.extend(velocity);
                    row.push(pressure);
                }
            }
            Self::Plane { axis, position } => {
                let values = plane(view, fluid(view)?, *axis, *position);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Pores(_)
            | Self::PoresLine(_)
            | Self::SurfaceLoad(_)
            | Self::Crossing(_)
            | Self::Heave(_)
            | Self::Section(_)
            | Self::WaterTable(_)
            | Self::WaterBalance
            | Self::Uplift(..)
                if view.seepage.is_some_and(|s| !s.is_known()) =>
            {
                // There is no pressure before the first coupling.
                return Ok(false);
            }
            Self::Pores(point) => {
                let values = seepage::values_at(view.seepage.ok_or_else(no_fluid)?, *point);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::PoresLine(points) => {
                let seepage = view.seepage.ok_or_else(no_fluid)?;
                let first = points.first().copied().unwrap_or_default();
                for (row, point) in rows.iter_mut().zip(&*points) {
                    let squared: f64 = (0..3).map(|a| (point[a] - first[a]).powi(2)).sum();
                    row.push(squared.sqrt());
                    row.extend(point);
                    row.extend(seepage::values_at(seepage, *point));
                }
            }
            Self::SurfaceLoad(load) => {
                let values = load.sample(view.seepage.ok_or_else(no_fluid)?);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Crossing(crossing) => {
                let discharge = crossing.sample(view.seepage.ok_or_else(no_fluid)?);
                rows.iter_mut().for_each(|row| row.push(discharge));
            }
            Self::Heave(heave) => {
                let values = seepage::heave(view.seepage.ok_or_else(no_fluid)?, heave);
                for (row, values) in rows.iter_mut().zip(values) {
                    row.extend(values);
                }
            }
            Self::Section(section) => {
                let values = section.sample(view.seepage.ok_or_else(no_fluid)?);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Uplift(section, about) => {
                let values = section.uplift(view.seepage.ok_or_else(no_fluid)?, *about);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::WaterBalance => {
                let values = seepage::balance(view.seepage.ok_or_else(no_fluid)?);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::WaterTable(columns) => {
                let seepage = view.seepage.ok_or_else(no_fluid)?;
                for (column, row) in rows.iter_mut().enumerate() {
                    row.extend(columns.sample(seepage, column));
                }
            }
            Self::Joint(point) => {
                let values = joints::nearest(view.joints.ok_or_else(no_fluid)?, *point);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Mouth(mouth) => {
                let values = view.joints.ok_or_else(no_fluid)?.mouth(*mouth);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Block(block) => {
                let values = joints::block(view.joints.ok_or_else(no_fluid)?, *block);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Gauge(gauge) => {
                let values = gauge.sample(fluid(view)?, view.domain.communicator());
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Structure(index, about) => {
                let values = structure(view, fluid(view)?, *index, *about);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Body(id) => {
                let values = body(view, *id)?;
                let (motion, loads) = values.split_at(POSITION.len() + 2 * VELOCITY.len());
                let delay = view.fluid.map_or(0.0, |_| view.plan.clock.time_step);
                for row in rows {
                    row.extend_from_slice(motion);
                    row.push((view.time - LOAD_OF_A_BODY * delay).max(0.0));
                    row.extend_from_slice(loads);
                }
            }
            Self::Grains(grains) => {
                let values = grains.sample(view);
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Bed(bed) => {
                let values = bed.sample(view)?;
                rows.iter_mut().for_each(|row| row.extend(values));
            }
            Self::Wall(wall) => {
                if !wall.has_flux(view.step) {
                    return Ok(false);
                }
                let values = wall.sample(fluid(view)?, view.domain.communicator())?;
                rows.iter_mut().for_each(|row| row.extend(values));
            }
        }
        Ok(true)
    }
}

impl At {
    /// Returns how many steps before its row a sample holds: what crosses links in a step is the mean force over this
    /// step.
    fn delay(&self) -> f64 {
        match self {
            Self::Wall(_) | Self::Structure(..) => 0.5,
            _ => 0.0,
        }
    }
}

pub(super) fn no_fluid() -> Error {
    Error::Internal("there is no fluid to sample".into())
}

pub(super) fn fluid<'a, S: Space>(view: &StateView<'a, S>) -> Result<&'a dyn FluidView, Error> {
    view.fluid.ok_or_else(no_fluid)
}

/// Returns the edge (2-D, m) or face (3-D, m²) of a cell.
fn face_area(units: &LatticeUnits) -> f64 {
    if units.dimension == 2 {
        units.spacing
    } else {
        units.spacing * units.spacing
    }
}

/// Returns the discharge through a plane, means over its fluid cells, largest speed, share of fluid; NaN if there is no
/// fluid.
fn plane<S: Space>(
    view: &StateView<S>,
    fluid: &dyn FluidView,
    axis: usize,
    position: f64,
) -> [f64; 7] {
    let (grid, units) = (&view.plan.scene.grid, fluid.units());
    let neighbours = clamped(position, grid, axis);
    let mut sums: [ExactSum; 5] = std::array::from_fn(|_| ExactSum::new());
    let mut largest = f64::NEG_INFINITY;
    let (start, cells) = (fluid.start(), fluid.cells());
    for (plane, weight) in neighbours {
        let Some(local) = plane
            .checked_sub(start[axis])
            .filter(|local| *local < cells[axis] && weight > 0.0)
        else {
            continue;
        };
        let (mut from, mut to) = ([0; 3], cells);
        (from[axis], to[axis]) = (local, local + 1);
        for z in from[2]..to[2] {
            for y in from[1]..to[1] {
                for x in from[0]..to[0] {
                    let fill = fluid.fill([x, y, z]);
                    if fluid.solid_at([x, y, z]) || fill <= 0.0 {
                        continue;
                    }
                    let weight = weight * fill;
                    let (deviation, [u, v, w]) = fluid.state([x, y, z]);
                    for (sum, value) in sums.iter_mut().zip([u, v, w, deviation, 1.0]) {
                        sum.add(weight * value);
                    }
                    largest = largest.max(u * u + v * v + w * w);
                }
            }
        }
    }
    let communicator = view.domain.communicator();
    let [u, v, w, deviation, number] = sums.map(|mut sum| {
        sum.all_reduce(communicator);
        sum.value()
    });
    let largest = communicator.all_reduce_max_f64(largest);
    let all: f64 = (0..3)
        .filter(|&a| a != axis)
        .map(|a| real(grid.cells[a]))
        .product();
    let discharge = units.velocity_to_si([u, v, w][axis]) * face_area(units);
    let speed = if number > 0.0 {
        units.velocity_to_si(largest.sqrt())
    } else {
        f64::NAN
    };
    [
        discharge,
        units.velocity_to_si(u / number),
        units.velocity_to_si(v / number),
        units.velocity_to_si(w / number),
        units.density_deviation_to_pressure(deviation / number),
        speed,
        number / all,
    ]
}

/// Returns the force and torque of the water on a structure in the last step, the torque about a point \[m\].
fn structure<S: Space>(
    view: &StateView<S>,
    fluid: &dyn FluidView,
    index: usize,
    about: [f64; 3],
) -> [f64; 6] {
    let mine = fluid.structure_loads().get(index).copied();
    let communicator = view.domain.communicator();
    let load: Load = mine.unwrap_or([0; 6]).map(|part| {
        let sum = communicator.all_reduce_sum_u128(part.cast_unsigned());
        sum.cast_signed()
    });
    let units = fluid.units();
    let [x, y, z, a, b, c] = about_centre([0.0; 3], &load);
    let [x, y, z] = [x, y, z].map(|f| units.force_to_si(f));
    let [a, b, c] = [a, b, c].map(|m| units.torque_to_si(m));
    // Without a point of its own the bits are those about the corner.
    let [p, q, r] = about;
    [
        x,
        y,
        z,
        a - (q * z - r * y),
        b - (r * x - p * z),
        c - (p * y - q * x),
    ]
}

/// Returns the motion and loads of a body; NaN once it is gone.
fn body<S: Space>(view: &StateView<S>, id: u64) -> Result<[f64; 21], Error> {
    let particles = view.particles;
    let mut bytes = Vec::new();
    if let Some(k) = (0..particles.owned()).find(|&k| particles.body[k].id == id) {
        let (motion, fluid, contact) = (
            &particles.motion[k],
            &particles.fluid_load(k),
            &particles.contact[k],
        );
        let vectors = [
            space_vector(&motion.position),
            space_vector(&motion.velocity),
            spin_vector(&motion.spin),
            space_vector(&fluid.force),
            spin_vector(&fluid.torque),
            space_vector(&contact.force),
            spin_vector(&contact.torque),
        ];
        for value in vectors.as_flattened() {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
    }
    let mut values = [f64::NAN; 21];
    for message in view
        .domain
        .communicator()
        .gather_bytes(0, &bytes)
        .unwrap_or_default()
    {
        let (numbers, rest) = message.as_chunks::<8>();
        if !rest.is_empty() || !(numbers.is_empty() || numbers.len() == values.len()) {
            return Err(Error::Internal(format!(
                "{} bytes about body {id}",
                message.len()
            )));
        }
        for (value, number) in values.iter_mut().zip(numbers) {
            *value = f64::from_le_bytes(*number);
        }
    }
    Ok(values)
}
