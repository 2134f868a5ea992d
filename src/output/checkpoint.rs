//! Conversion of the state to named arrays and back, and the hash of the state.
//!
//! A checkpoint contains the whole state in global order, so that any number of ranks can continue from it: every
//! incoming population of every cell as `[z][y][x][i]`, the grains and contacts as columns keyed by id, and the
//! counters of the run in its manifest. A continued run gives the same bits as an uninterrupted one.

mod check;

pub use check::{Expected, ExpectedPopulations, StateLimits};

use crate::averages::{Averages, SUMS};
use crate::group::RankGroup;
use base::error::Error;
use base::number::to_usize;
use decomposition::{Communicator, StateHash, field_key};
use dem::Dem;
use dem::particles::Particles;
use dem::space::Space;
use dem::state::{Contacts, NamedColumns, Values};
use io::checkpoint::{Array, Reader};
use io::{FunctionSource, Numbers};
use lbm::fluid::Fluid;
use lbm::lanes::Stored;
use lbm::populations::Populations;
use lbm::surface::Passed;
use lbm::surface::SlabSurface;
use lbm::surface::kind::is_wet;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

fn as_error(error: io::Error) -> Error {
    Error::Io(error.to_string())
}

/// Calls `visit` for each cell of a slab whose numbers intersect a range of an array in the order `[z][y][x]` with
/// `per_cell` numbers per cell; passes the position of the cell and its part of the range.
fn each_cell_of<S: Stored>(
    populations: &Populations<S>,
    per_cell: usize,
    range: &Range<usize>,
    mut visit: impl FnMut(usize, Range<usize>),
) {
    let [nx, ny, _] = populations.cells();
    for n in range.start / per_cell..range.end.div_ceil(per_cell) {
        let at = [n % nx, n / nx % ny, n / (nx * ny)];
        let numbers =
            range.start.max(n * per_cell) - n * per_cell..(range.end - n * per_cell).min(per_cell);
        visit(populations.cell(at.map(usize::cast_signed)), numbers);
    }
}

/// Returns the incoming populations of a slab in the order `[z][y][x][i]`, generated while they are written: a copy
/// would double the memory of a run.
fn gather<S: SavedNumber>(fluid: &Fluid<S>) -> impl io::NumberSource + '_ {
    let populations = fluid.populations();
    let q = populations.velocities().q();
    let count = populations.cells().iter().product::<usize>() * q;
    FunctionSource::new(count, move |range, all: &mut Vec<S>| {
        each_cell_of(populations, q, &range, |cell, which| {
            all.extend(which.map(|i| fluid.saved_number(cell, i)));
        });
    })
}

/// Stores the populations of a range of the array of [`gather`] in the lattice.
fn scatter<S: Stored>(populations: &mut Populations<S>, range: &Range<usize>, some: &[S]) {
    let q = populations.velocities().q();
    let mut slots = Vec::with_capacity(some.len());
    each_cell_of(populations, q, range, |cell, which| {
        slots.extend(which.map(|i| populations.incoming(cell, i)));
    });
    let numbers = populations.numbers_mut();
    for (slot, value) in slots.into_iter().zip(some) {
        numbers[slot] = *value;
    }
}

/// Returns the local cells of a slab in the order `[z][y][x]` with their positions.
fn cells_of<S: Stored>(fluid: &Fluid<S>) -> impl Iterator<Item = ([usize; 3], usize)> + '_ {
    let populations = fluid.populations();
    let [nx, ny, nz] = populations.cells();
    (0..nz)
        .flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
        .map(|at| (at, populations.cell(at.map(usize::cast_signed))))
}

/// Returns the velocities of a slab from which the next eddy viscosity is computed, in the order
/// `[z][y][x][component]`; none without turbulence.
fn gather_velocities<S: Stored>(fluid: &Fluid<S>) -> Option<impl io::NumberSource + '_> {
    let field = fluid.velocities()?;
    let populations = fluid.populations();
    let count = populations.cells().iter().product::<usize>() * 3;
    Some(FunctionSource::new(
        count,
        move |range, all: &mut Vec<f32>| {
            each_cell_of(populations, 3, &range, |cell, which| {
                let velocity = if fluid.holds_water(cell) {
                    field.velocity(cell)
                } else {
                    [0.0; 3]
                };
                all.extend_from_slice(&velocity[which]);
            });
        },
    ))
}

/// Returns the kind, mass and unshared excess mass of the cells of a slab below a free surface, in the order
/// `[z][y][x][number]`; none without a free surface.
fn gather_surface<S: Stored>(fluid: &Fluid<S>) -> Option<impl io::NumberSource + '_> {
    let surface = fluid.surface()?;
    let populations = fluid.populations();
    let count = populations.cells().iter().product::<usize>() * SURFACE_NUMBERS;
    Some(FunctionSource::new(
        count,
        move |range, all: &mut Vec<f64>| {
            each_cell_of(populations, SURFACE_NUMBERS, &range, |cell, which| {
                all.extend_from_slice(&surface.saved(cell)[which]);
            });
        },
    ))
}

/// Returns the box of a slab in an array of `q` numbers per cell: shape, start and count.
fn box_of<S: Stored>(fluid: &Fluid<S>, q: usize) -> [[usize; 4]; 3] {
    let (all, start, count) = (
        fluid.domain_cells(),
        fluid.start(),
        fluid.populations().cells(),
    );
    [
        [all[2], all[1], all[0], q],
        [start[2], start[1], start[0], 0],
        [count[2], count[1], count[0], q],
    ]
}

/// Returns the part of a slab in an array with `q` numbers per cell.
fn slab<'a, S: Stored>(fluid: &Fluid<S>, name: &'a str, q: usize, data: Numbers<'a>) -> Array<'a> {
    let [shape, start, count] = box_of(fluid, q).map(|v| v.to_vec());
    Array {
        name,
        shape,
        start,
        count,
        data,
    }
}

/// Returns the names of the arrays of all columns of the tables.
fn column_names(tables: &[NamedColumns; 3]) -> Vec<String> {
    let tables = TABLES.iter().zip(tables);
    let names = tables.flat_map(|(kind, table)| {
        let columns = table.columns.iter();
        columns.map(move |(name, _)| format!("{kind}_{name}"))
    });
    names.collect()
}

/// Adds the columns of the tables that have rows on any rank; returns the number of rows of each table. Collective.
fn add_tables<'a>(
    arrays: &mut Vec<Array<'a>>,
    tables: &'a [NamedColumns; 3],
    names: &'a [String],
    communicator: &Communicator,
) -> [u64; 3] {
    let mut names = names.iter();
    tables.each_ref().map(|table| {
        let mine = table.rows();
        let (offset, rows) = communicator.exclusive_scan_u64(mine as u64);
        let (offset, total) = (to_usize(offset), to_usize(rows));
        for ((_, values), name) in table.columns.iter().zip(&mut names) {
            if total > 0 {
                arrays.push(Array {
                    name,
                    shape: vec![total],
                    start: vec![offset],
                    count: vec![mine],
                    data: match values {
                        Values::Real(values) => values.as_slice().into(),
                        Values::Whole(values) => values.as_slice().into(),
                    },
                });
            }
        }
        rows
    })
}

/// Returns names and kinds of the columns of a table.
fn columns_to_json(table: &NamedColumns) -> Value {
    let kind = |values: &Values| match values {
        Values::Real(_) => "real",
        Values::Whole(_) => "whole",
    };
    let columns = table.columns.iter();
    columns
        .map(|(name, values)| json!([name, kind(values)]))
        .collect()
}

/// Stored number type that files support.
pub trait SavedNumber: Stored + io::data::Element {}
impl SavedNumber for f64 {}
impl SavedNumber for f32 {}

/// State of a run, borrowed for saving.
pub struct RunState<'a, Sp: Space, S: Stored> {
    /// Fluid, if any.
    pub fluid: Option<&'a Fluid<S>>,
    /// Time averages, if any.
    pub averages: Option<&'a Averages>,
    /// State of the seepage or of the water in joints, the same on every rank; empty without these.
    pub seepage: Vec<f64>,
    /// Grains and bodies.
    pub particles: &'a Particles<Sp>,
    /// Solver of contacts and motion, if any.
    pub dem: Option<&'a Dem<Sp>>,
    /// Velocities of the fluid at an earlier step, three numbers per cell in the order `[z][y][x]`, to which a
    /// warm-up compares the present ones; not part of the hash.
    pub earlier: Option<&'a [f64]>,
}

impl<'a, Sp: Space, S: Stored> RunState<'a, Sp, S> {
    /// Returns the state of grains without water.
    #[must_use]
    pub fn of_grains(particles: &'a Particles<Sp>, dem: &'a Dem<Sp>) -> Self {
        Self {
            fluid: None,
            averages: None,
            seepage: Vec::new(),
            particles,
            dem: Some(dem),
            earlier: None,
        }
    }
}

/// Numbers per cell below a free surface.
const SURFACE_NUMBERS: usize = 3;
const SURFACE: &str = "free_surface";
const SURFACE_LOSS: &str = "free_surface_loss";
/// Name of the array of the masses that have entered and left through each opening of a free surface, in quanta.
const SURFACE_PASSED: &str = "free_surface_passed";
const OPENINGS: &str = "openings";
const EARLIER: &str = "earlier_velocities";
const TABLES: [&str; 3] = ["grains", "contacts", "wall_contacts"];

impl<Sp: Space, S: SavedNumber> RunState<'_, Sp, S> {
    /// Writes a checkpoint. Collective.
    ///
    /// # Errors
    /// If a file cannot be written; [`io::Error::Space`] leaves all files as they were.
    pub fn write(
        &self,
        folder: &Path,
        step: u64,
        time: f64,
        mut attributes: Value,
        keep: usize,
        communicator: &Communicator,
    ) -> Result<(), io::Error> {
        let begun = Instant::now();
        let group = RankGroup(communicator);
        let populations = self.fluid.map(gather);
        let velocities = self.fluid.and_then(gather_velocities);
        let surface = self.fluid.and_then(gather_surface);
        let contacts = self.dem.map(Dem::contacts).unwrap_or_default();
        let tables = [self.particles.table(), contacts.grains, contacts.walls];
        let names = column_names(&tables);
        let mut arrays = Vec::new();
        if let Some(fluid) = self.fluid {
            let q = fluid.populations().velocities().q();
            let slab = |name, q, data| slab(fluid, name, q, data);
            let made = populations.as_ref().map(|made| Numbers::Generated(made));
            arrays.extend(made.map(|made| slab("populations", q, made)));
            let made = velocities.as_ref().map(|made| Numbers::Generated(made));
            arrays.extend(made.map(|made| slab("velocities", 3, made)));
            let made = surface.as_ref().map(|made| Numbers::Generated(made));
            arrays.extend(made.map(|made| slab(SURFACE, SURFACE_NUMBERS, made)));
            let averages = self.averages.map(|averages| averages.sums().into());
            arrays.extend(averages.map(|sums| slab("averages", SUMS, sums)));
            let earlier = self.earlier.map(|earlier| earlier.into());
            arrays.extend(earlier.map(|earlier| slab(EARLIER, 3, earlier)));
        }
        let first = communicator.rank() == 0;
        arrays.extend(self.seepage_array(first));
        let rows = add_tables(&mut arrays, &tables, &names, communicator);
        if let Some(surface) = self.fluid.and_then(Fluid::surface) {
            let lost = sum_of_ranks(communicator, surface.lost());
            attributes[SURFACE_LOSS] = json!(lost.to_string());
            let passed = surface
                .passed()
                .flat_map(|(_, passed)| [passed.entered, passed.left]);
            let passed = passed.map(|mass| sum_of_ranks(communicator, mass).to_string());
            attributes[SURFACE_PASSED] = passed.collect();
        }
        attributes["velocities"] = json!(velocities.is_some());
        attributes["averages"] = json!(self.averages.map_or(0, Averages::samples));
        attributes["seepage"] = json!(self.seepage.len());
        attributes["rows"] = json!(rows);
        attributes["columns"] = tables.iter().map(columns_to_json).collect();
        if self.dem.is_some() {
            attributes["walls"] = table_to_json(&contacts.faces);
            attributes["solid_steps"] = json!(contacts.steps);
        }
        if let Some(fluid) = self.fluid {
            attributes["fluid_steps"] = json!(fluid.steps());
            // Stored as bits, so that nothing is rounded.
            let memories = fluid.memories();
            attributes[OPENINGS] = memories.map(|memory| memory.map(f64::to_bits)).collect();
        }
        io::checkpoint::write(
            folder,
            step,
            time,
            &arrays,
            &attributes,
            &group,
            io::hdf::Mode::default(),
            keep,
        )?;
        if first {
            log::info!(
                "checkpoint of step {step} with {} arrays written and verified in {:.3} s",
                arrays.len(),
                begun.elapsed().as_secs_f64()
            );
        }
        Ok(())
    }

    /// Returns the state of the seepage as an array, which the first rank writes; none without seepage.
    fn seepage_array(&self, first: bool) -> Option<Array<'_>> {
        let total = self.seepage.len();
        let mine = if first { total } else { 0 };
        (total > 0).then(|| Array {
            name: "seepage",
            shape: vec![total],
            start: vec![0],
            count: vec![mine],
            data: self.seepage[..mine].into(),
        })
    }

    /// Returns the hash of the whole state: 32 hexadecimal digits, the same for any number of ranks and threads.
    /// Collective.
    #[must_use]
    pub fn hash(&self, communicator: &Communicator) -> String {
        let mut hash = StateHash::new();
        if let Some(fluid) = self.fluid {
            let key = field_key("populations");
            let [shape, start, _] = box_of(fluid, fluid.populations().velocities().q());
            let populations = fluid.populations();
            let cells = populations.cells();
            let kinds = fluid.surface().map(SlabSurface::kinds);
            // The sum does not depend on the order: planes are added in parallel, and in a plane the populations
            // one after the other, as they lie in memory.
            let [slow, middle, fast] = populations.order();
            let of_plane = |plane: usize| {
                let mut part = StateHash::new();
                for i in 0..shape[3] {
                    for row in 0..cells[middle] {
                        let entries = (0..cells[fast]).map(|k| {
                            let mut at = [0; 3];
                            (at[slow], at[middle], at[fast]) = (plane, row, k);
                            let [x, y, z] = at;
                            let cell = populations.cell(at.map(usize::cast_signed));
                            let wet = kinds.is_none_or(|kinds| is_wet(kinds[cell]));
                            let number = if wet {
                                populations.numbers()[populations.incoming(cell, i)]
                            } else {
                                S::from_f64(0.0)
                            };
                            let global = ((start[0] + z) * shape[1] + start[1] + y) * shape[2]
                                + start[2]
                                + x;
                            ((global * shape[3] + i) as u64, number.to_f64().to_bits())
                        });
                        part.add_entries(key, entries);
                    }
                }
                part
            };
            let merged = |mut a: StateHash, b| {
                a.merge(b);
                a
            };
            let planes = (0..cells[slow]).into_par_iter();
            hash.merge(planes.map(of_plane).reduce(StateHash::new, merged));
            if communicator.rank() == 0 {
                let key = field_key(OPENINGS);
                for (patch, memory) in (0..).zip(fluid.memories()) {
                    if let Some(memory) = memory {
                        hash.add(key, patch, memory.to_bits());
                    }
                }
            }
            if let Some(surface) = fluid.surface() {
                let key = field_key(SURFACE);
                for ([x, y, z], at) in cells_of(fluid) {
                    let cell = ((start[0] + z) * shape[1] + start[1] + y) * shape[2] + start[2] + x;
                    for (n, number) in surface.saved(at).into_iter().enumerate() {
                        let index = cell * SURFACE_NUMBERS + n;
                        hash.add(key, index as u64, number.to_bits());
                    }
                }
            }
            if let Some(field) = fluid.velocities() {
                let key = field_key("velocities");
                let wet = cells_of(fluid).filter(|(_, at)| fluid.holds_water(*at));
                for ([x, y, z], at) in wet {
                    let cell = ((start[0] + z) * shape[1] + start[1] + y) * shape[2] + start[2] + x;
                    for (a, u) in field.velocity(at).into_iter().enumerate() {
                        hash.add(key, (cell * 3 + a) as u64, u64::from(u.to_bits()));
                    }
                }
            }
        }
        if let (Some(fluid), Some(averages)) = (self.fluid, self.averages) {
            let key = field_key("averages");
            let [shape, start, _] = box_of(fluid, SUMS);
            for (([x, y, z], _), sums) in cells_of(fluid).zip(averages.sums().chunks_exact(SUMS)) {
                let cell = ((start[0] + z) * shape[1] + start[1] + y) * shape[2] + start[2] + x;
                for (k, sum) in sums.iter().enumerate() {
                    hash.add(key, (cell * SUMS + k) as u64, sum.to_bits());
                }
            }
        }
        if communicator.rank() == 0 {
            let key = field_key("seepage");
            for (index, value) in (0..).zip(&self.seepage) {
                hash.add(key, index, value.to_bits());
            }
        }
        self.add_grains(&mut hash);
        hash.all_reduce(communicator).hex()
    }

    /// Adds grains and contacts, column by column and contact by contact, so that the hash needs no copy of the
    /// state.
    fn add_grains(&self, hash: &mut StateHash) {
        let mut ids = Vec::new();
        self.particles.each_hashed_column(|name, values| {
            if let ("id", Values::Whole(values)) = (name, values) {
                ids.clone_from(values);
            }
            let key = field_key(&format!("grains_{name}"));
            match values {
                Values::Real(values) => {
                    for (id, value) in ids.iter().zip(values) {
                        hash.add(key, *id, value.to_bits());
                    }
                }
                Values::Whole(values) => {
                    for (id, value) in ids.iter().zip(values) {
                        hash.add(key, *id, *value);
                    }
                }
            }
        });
        let Some(dem) = self.dem else { return };
        let [first, second] = ["contacts_first", "contacts_second"].map(field_key);
        let [grain, wall, facet] =
            ["grain", "wall", "facet"].map(|name| field_key(&format!("wall_contacts_{name}")));
        // Contacts are identified by both partners.
        let (mut with_grains, mut with_walls) = (StateHash::new(), StateHash::new());
        let (mut history, mut at_wall) = (Vec::new(), Vec::new());
        dem.each_contact(
            &mut |[a, b], numbers| {
                let index = a | (b << 32);
                with_grains.add(first, index, a);
                with_grains.add(second, index, b);
                for (key, number) in history_keys(&mut history, "contacts", numbers) {
                    with_grains.add(*key, index, number.to_bits());
                }
            },
            &mut |[a, b, c], numbers| {
                let index = a | (b << 32);
                with_walls.add(grain, index, a);
                with_walls.add(wall, index, b);
                with_walls.add(facet, index, c);
                for (key, number) in history_keys(&mut at_wall, "wall_contacts", numbers) {
                    with_walls.add(*key, index, number.to_bits());
                }
            },
        );
        hash.merge(with_grains);
        hash.merge(with_walls);
    }
}

/// Returns the numbers of a contact that a law stores, each with the key of its column; `keys` are computed once.
fn history_keys<'a>(
    keys: &'a mut Vec<u64>,
    kind: &str,
    numbers: &'a [f64],
) -> impl Iterator<Item = (&'a u64, &'a f64)> {
    for n in keys.len()..numbers.len() {
        keys.push(field_key(&format!("{kind}_memory_{n}")));
    }
    keys.iter().zip(numbers)
}
fn table_to_json(table: &NamedColumns) -> Value {
    table
        .columns
        .iter()
        .map(|(name, values)| match values {
            // Stored as bits, so that nothing is rounded.
            Values::Real(values) => json!([
                name,
                "real",
                values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
            ]),
            Values::Whole(values) => json!([name, "whole", values]),
        })
        .collect()
}

fn table_from_json(value: &Value) -> NamedColumns {
    let mut table = NamedColumns::default();
    for column in value.as_array().into_iter().flatten() {
        let name = column[0].as_str().unwrap_or_default().to_owned();
        let bits: Vec<u64> = column[2]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_u64)
            .collect();
        let values = if column[1] == "real" {
            Values::Real(bits.into_iter().map(f64::from_bits).collect())
        } else {
            Values::Whole(bits)
        };
        table.columns.push((name, values));
    }
    table
}

/// Refuses values that are not finite, which no run would have written.
fn finite(name: &str, all_finite: bool) -> Result<(), Error> {
    if all_finite {
        return Ok(());
    }
    Err(Error::Io(format!(
        "the checkpoint is damaged: not all values of its {name} are finite"
    )))
}

/// Fills the populations of a slab from a checkpoint.
///
/// # Errors
/// If the populations of the checkpoint do not fit the slab.
pub fn read_fluid<S: SavedNumber>(fluid: &mut Fluid<S>, reader: &Reader) -> Result<(), Error> {
    let q = fluid.populations().velocities().q();
    let [_, start, count] = box_of(fluid, q).map(|v| v.to_vec());
    let mut all_finite = true;
    let read = reader.read_in_pieces("populations", &start, &count, |range, some: &[S]| {
        all_finite &= some.iter().all(|x| x.to_f64().is_finite());
        scatter(fluid.populations_mut(), &range, some);
        Ok(())
    });
    read.map_err(as_error)?;
    finite("populations", all_finite)?;
    fluid.set_steps(reader.attributes()["fluid_steps"].as_u64().unwrap_or(0));
    let saved = reader.attributes()[OPENINGS].as_array();
    let memories: Vec<Option<f64>> = saved
        .into_iter()
        .flatten()
        .map(|bits| bits.as_u64().map(f64::from_bits))
        .collect();
    finite(OPENINGS, memories.iter().flatten().all(|x| x.is_finite()))?;
    fluid.recall(memories.into_iter());
    read_surface(fluid, reader)?;
    if reader.attributes()["velocities"] != json!(true) {
        // Turbulence was added at this restart.
        fluid.renew_velocities();
        return Ok(());
    }
    let [_, start, count] = box_of(fluid, 3).map(|v| v.to_vec());
    let velocities: Vec<f32> = reader
        .read("velocities", &start, &count)
        .map_err(as_error)?;
    finite("velocities", velocities.iter().all(|u| u.is_finite()))?;
    let cells: Vec<usize> = cells_of(fluid).map(|(_, cell)| cell).collect();
    if let Some(field) = fluid.velocities_mut() {
        for (&cell, u) in cells.iter().zip(velocities.chunks_exact(3)) {
            field.set_velocity(cell, [u[0], u[1], u[2]]);
        }
    }
    fluid.spread_velocities();
    fluid.continue_velocities();
    Ok(())
}

/// Reads the free surface, if there is one. The first rank takes the mass loss of all ranks.
fn read_surface<S: SavedNumber>(fluid: &mut Fluid<S>, reader: &Reader) -> Result<(), Error> {
    if fluid.surface().is_none() {
        return Ok(());
    }
    let [_, start, count] = box_of(fluid, SURFACE_NUMBERS).map(|v| v.to_vec());
    let numbers: Vec<f64> = reader.read(SURFACE, &start, &count).map_err(as_error)?;
    finite(SURFACE, numbers.iter().all(|x| x.is_finite()))?;
    let cells: Vec<usize> = cells_of(fluid).map(|(_, cell)| cell).collect();
    let saved: Vec<[f64; SURFACE_NUMBERS]> = numbers
        .chunks_exact(SURFACE_NUMBERS)
        .map(|numbers| [numbers[0], numbers[1], numbers[2]])
        .collect();
    let first = fluid.start() == [0; 3] && !fluid.populations().cells().contains(&0);
    let lost = reader.attributes()[SURFACE_LOSS].as_str();
    let lost = lost.filter(|_| first).and_then(|text| text.parse().ok());
    fluid.restore_surface(&cells, &saved, lost.unwrap_or(0));
    let passed = reader.attributes()[SURFACE_PASSED].as_array();
    if let (Some(surface), Some(passed), true) = (fluid.surface_mut(), passed, first) {
        let number = |n: usize| passed.get(n)?.as_str()?.parse().ok();
        let of_opening = |n: usize| Passed {
            entered: number(2 * n).unwrap_or(0),
            left: number(2 * n + 1).unwrap_or(0),
        };
        surface.set_passed((0..passed.len() / 2).map(of_opening));
    }
    Ok(())
}

/// Returns the sum over all ranks of a number in quanta. Collective.
fn sum_of_ranks(communicator: &Communicator, value: i128) -> i128 {
    communicator
        .all_reduce_sum_u128(value.cast_unsigned())
        .cast_signed()
}

/// Returns the velocities of a slab at an earlier step from a checkpoint, as in [`RunState::earlier`].
///
/// # Errors
/// If the checkpoint contains none.
pub fn read_earlier<S: SavedNumber>(fluid: &Fluid<S>, reader: &Reader) -> Result<Vec<f64>, Error> {
    let [_, start, count] = box_of(fluid, 3).map(|v| v.to_vec());
    reader.read(EARLIER, &start, &count).map_err(as_error)
}

/// Returns the local cells of a slab in the order of the arrays of checkpoints.
pub fn cells_in_order<S: Stored>(fluid: &Fluid<S>) -> Vec<usize> {
    cells_of(fluid).map(|(_, cell)| cell).collect()
}

/// Reads the time averages of a slab from a checkpoint; they remain empty if the checkpoint contains none.
///
/// # Errors
/// If they cannot be read.
pub fn read_averages<S: SavedNumber>(
    averages: &mut Averages,
    fluid: &Fluid<S>,
    reader: &Reader,
) -> Result<(), Error> {
    let samples = reader.attributes()["averages"].as_u64().unwrap_or(0);
    if samples == 0 {
        return Ok(());
    }
    let [_, start, count] = box_of(fluid, SUMS).map(|v| v.to_vec());
    let sums: Vec<f64> = reader.read("averages", &start, &count).map_err(as_error)?;
    finite("averages", sums.iter().all(|x| x.is_finite()))?;
    averages.restore(samples, sums);
    Ok(())
}

/// Returns the state of the seepage in a checkpoint, on every rank; empty if the checkpoint contains none.
///
/// # Errors
/// If they cannot be read.
pub fn read_seepage(reader: &Reader) -> Result<Vec<f64>, Error> {
    match to_usize(reader.attributes()["seepage"].as_u64().unwrap_or(0)) {
        0 => Ok(Vec::new()),
        n => {
            let numbers: Vec<f64> = reader.read("seepage", &[0], &[n]).map_err(as_error)?;
            finite("seepage", numbers.iter().all(|x| x.is_finite()))?;
            Ok(numbers)
        }
    }
}

/// Returns grains and contacts of a checkpoint. Every rank reads all contacts; the first rank reads the grains, which
/// are later sent to their owners.
///
/// # Errors
/// If a column is missing or malformed.
pub fn read_tables(reader: &Reader, rank: usize) -> Result<(NamedColumns, Contacts), Error> {
    let attributes = reader.attributes();
    let mut tables = Vec::new();
    for (n, kind) in TABLES.iter().enumerate() {
        let total = to_usize(attributes["rows"][n].as_u64().unwrap_or(0));
        let count = if n == 0 && rank != 0 { 0 } else { total };
        let mut table = NamedColumns::default();
        for column in attributes["columns"][n].as_array().into_iter().flatten() {
            let name = column[0].as_str().unwrap_or_default();
            let array = format!("{kind}_{name}");
            let real = column[1] == "real";
            let values = match (real, count) {
                (true, 0) => Values::Real(Vec::new()),
                (false, 0) => Values::Whole(Vec::new()),
                (true, _) => Values::Real(reader.read(&array, &[0], &[count]).map_err(as_error)?),
                (false, _) => Values::Whole(reader.read(&array, &[0], &[count]).map_err(as_error)?),
            };
            table.columns.push((name.to_owned(), values));
        }
        tables.push(table);
    }
    let [grains, contacts, walls] = <[NamedColumns; 3]>::try_from(tables).unwrap_or_default();
    let mut saved = Contacts::default();
    saved.grains = contacts;
    saved.walls = walls;
    saved.faces = table_from_json(&attributes["walls"]);
    saved.steps = attributes["solid_steps"].as_u64().unwrap_or(0);
    Ok((grains, saved))
}

#[cfg(test)]
mod columns;
