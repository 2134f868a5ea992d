//! Time series at points, lines, planes, bodies and faces: one CSV file `probe_NAME.csv` each.
//!
//! Every file begins with the columns `step` and `time`. Forces on walls and structures are means over the last
//! step, so that their `time` is half a step before the end of `step`; the load of the water on a body is the mean
//! over the last two steps, at `fluid_force_time`. The columns are the same in 2-D and 3-D. Every value is gathered
//! from the rank that owns it, or summed without rounding, so that it does not depend on the number of ranks.
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
//! | wall load | displacement and velocity of a wall, force, torque and mean stress of the grains on it, contacts |
//! | grains | number, solid fraction, coordination number and mean stress of the grains in a box; d50 |
//! | bed | surface, scour, shear stress, Shields number and bedload of a bed of grains |
//!
//! **Points** are interpolated linearly along each axis from the cell centres; in the half cell next to a face the
//! values are extrapolated. Covered cells are included with their values. **Planes** are interpolated between the
//! two adjacent planes of cells; only cells whose centre is in the fluid count, below a free surface by their fill
//! levels.
//! **Faces**: see [`wall`]. **Walls of grains**: see [`wall_load`]. **Beds**: see [`bed`]. **Grains**: see [`fabric`].
//!
//! A quantity is one file here, which holds its columns and its samples, and a line in the list [`sampled`];
//! `case::observe` has its fields and `plan::scene::observe` its checks.

mod bed;
mod body;
mod crossing;
mod fabric;
mod gauge;
mod heave;
mod joints;
mod plane;
mod points;
mod pores;
mod quantity;
mod sampled;
mod section;
mod structure;
mod surface_load;
mod uplift;
mod wall;
mod wall_load;
mod water_balance;
mod water_table;

use super::group::RankGroup;
use super::schedule::Schedule;
use crate::view::StateView;
use base::error::Error;
use base::units::LatticeUnits;
use coupling::FluidView;
use coupling::seepage::Seepage;
use decomposition::Domain;
use dem::space::Space;
use io::CsvTable;
use plan::Plan;
use plan::scene::Scene;
use plan::scene::observe::ProbeAt;
use quantity::Quantity;
use sampled::Sampled;
use std::path::{Path, PathBuf};

/// Probe with its table.
#[derive(Debug)]
pub(crate) struct Probe {
    pub(crate) schedule: Schedule,
    quantity: Sampled,
    /// Step of the last sample, if known.
    pub(crate) last: Option<u64>,
    path: PathBuf,
    headings: Vec<Heading>,
    /// Table of the probe, on rank 0.
    table: Option<CsvTable>,
    /// Rows of one sample, on rank 0; the buffer is reused.
    rows: Vec<Vec<f64>>,
}

/// Name of a column and its unit.
type Heading = (&'static str, &'static str);

/// Rows of one sample, which begin with the time.
type Rows = [Vec<f64>];

const VELOCITY: [Heading; 3] = [
    ("velocity_x", "m/s"),
    ("velocity_y", "m/s"),
    ("velocity_z", "m/s"),
];
const POSITION: [Heading; 3] = [("x", "m"), ("y", "m"), ("z", "m")];

/// Run of which a probe is a part.
struct Run<'a> {
    plan: &'a Plan,
    folder: &'a Path,
    /// Step at which the run continues an earlier one.
    resumed_at: Option<u64>,
}

impl Probe {
    /// Returns all probes of the plan. Collective.
    pub(crate) fn all(
        plan: &Plan,
        folder: &Path,
        domain: &Domain,
        resumed_at: Option<u64>,
    ) -> Result<Vec<Self>, Error> {
        let run = Run {
            plan,
            folder,
            resumed_at,
        };
        let probes = plan.scene.probes.iter();
        probes
            .map(|probe| {
                let mut quantity = Sampled::new(&plan.scene, &probe.at)?;
                quantity.begin(&run)?;
                let headings = headings(&plan.scene, &quantity);
                let path = folder.join(format!("probe_{}.csv", probe.name));
                let every = Some(plan.clock.every(probe.every));
                let mut table = None;
                let group = RankGroup(domain.communicator());
                let written = group.on_root(|| {
                    let (opened, written) =
                        open(&path, &headings, resumed_at, quantity.rows() as u64)?;
                    table = Some(opened);
                    if resumed_at.is_some() {
                        quantity.remember(&path)?;
                    }
                    Ok(written)
                })?;
                let schedule = match resumed_at {
                    Some(step) => Schedule::resumed(every, step, written),
                    None => Schedule::new(every),
                };
                Ok(Self {
                    schedule,
                    quantity,
                    last: resumed_at.filter(|_| written),
                    path,
                    headings,
                    table,
                    rows: Vec::new(),
                })
            })
            .collect()
    }

    /// Samples the quantity and writes the rows of this step. Collective.
    pub(crate) fn write<S: Space>(&mut self, view: &StateView<S>) -> Result<(), Error> {
        let width = self.headings.len();
        let time = (view.time - self.quantity.delay() * view.plan.clock.time_step).max(0.0);
        self.rows.resize_with(self.quantity.rows(), Vec::new);
        for row in &mut self.rows {
            row.clear();
            row.reserve(width);
            row.push(time);
        }
        let here = self.quantity.sample(view, &mut self.rows)?;
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

    /// Drops the sample of `step` if the schedule has no sample at this step. Collective.
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

    /// Synchronises the table to disk, on rank 0.
    pub(crate) fn sync(&self) -> io::Result<()> {
        self.table.as_ref().map_or(Ok(()), CsvTable::sync)
    }
}

/// Opens a new table, or that of an earlier part of the run; returns also `true` if the table contains a complete
/// sample of the step at which the run continues.
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
    // A sample that was cut off at the end of the run is taken again.
    Ok((before(path, headings, step)?, false))
}

/// Returns the table without the rows from `step` on.
fn before(path: &Path, headings: &[Heading], step: u64) -> io::Result<CsvTable> {
    match step.checked_sub(1) {
        Some(before) => CsvTable::resume(path, headings, before),
        None => CsvTable::create(path, headings),
    }
}

/// Returns the names of the columns of the table of a probe; none without the fluid that it samples.
#[must_use]
pub fn columns(scene: &Scene, at: &ProbeAt) -> Vec<&'static str> {
    let quantity = Sampled::new(scene, at);
    let headings = quantity.map_or(Vec::new(), |quantity| headings(scene, &quantity));
    let names = headings.into_iter().map(|(name, _)| name);
    std::iter::once("step").chain(names).collect()
}

/// Returns the columns of the table of a quantity with their units, without the step.
fn headings(scene: &Scene, quantity: &Sampled) -> Vec<Heading> {
    let mut headings = vec![("time", "s")];
    headings.extend(quantity.headings(scene));
    headings
}

pub(super) fn no_fluid() -> Error {
    Error::Internal("there is no fluid to sample".into())
}

pub(super) fn fluid<'a, S: Space>(view: &StateView<'a, S>) -> Result<&'a dyn FluidView, Error> {
    view.fluid.ok_or_else(no_fluid)
}

/// Samples the seepage and returns `true`; `false` before its first solution, when it has no pressure.
fn sampled_if_solved<S: Space>(
    view: &StateView<S>,
    sample: impl FnOnce(&Seepage<S>),
) -> Result<bool, Error> {
    let seepage = view.seepage.ok_or_else(no_fluid)?;
    let known = seepage.is_known();
    if known {
        sample(seepage);
    }
    Ok(known)
}

/// Returns the unit of a volume, in 2-D per depth.
fn volume_unit(dimension: usize) -> &'static str {
    if dimension == 2 { "m2" } else { "m3" }
}

/// Returns the unit of a discharge, in 2-D per depth.
fn discharge_unit(dimension: usize) -> &'static str {
    if dimension == 2 { "m2/s" } else { "m3/s" }
}

/// Returns the unit of an area, in 2-D per depth.
fn area_unit(dimension: usize) -> &'static str {
    if dimension == 2 { "m" } else { "m2" }
}

/// Returns the edge length (2-D, m) or face area (3-D, m²) of a cell.
fn face_area(units: &LatticeUnits) -> f64 {
    if units.dimension == 2 {
        units.spacing
    } else {
        units.spacing * units.spacing
    }
}
