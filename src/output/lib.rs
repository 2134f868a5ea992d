//! Output of fields and series: selection, schedule, and conversion to SI.
//!
//! [`Outputs`] connects the run and the files. It determines the outputs due at a step, requests them from the
//! [`StateView`], converts them with [`base::units`] and passes named arrays to [`io`]. A step without output costs one
//! comparison.
//!
//! | file | content |
//! |---|---|
//! | `group` | the ranks as a group that writes |
//! | `schedule` | the steps of an output |
//! | `view` | access to the state of a run |
//! | `fluid`, `vorticity` | fields of the fluid; the vorticity, with the adjacent planes of other slabs |
//! | `averages` | time averages and their profile |
//! | `grains`, `contacts`, `blocks`, `order` | grains, contacts and faces of blocks, in an order independent of the
//! ranks |
//! | `structures` | stationary surfaces, written once |
//! | `walls` | walls at time 0, written once |
//! | `probes` | values over time |
//! | `info` | description of a file or folder |
//!
//! No file depends on the number of ranks.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

pub mod averages;
mod blocks;
pub mod checkpoint;
mod contacts;
mod fluid;
mod grains;
pub mod group;
pub mod info;
mod order;
mod polygons;
mod probes;
mod schedule;
mod seepage;
mod structures;
pub mod view;
mod vorticity;
mod walls;

pub use probes::columns as probe_columns;

use crate::view::StateView;
use averages::{AverageFields, Averages};
use base::error::Error;
use blocks::Blocks;
use case::geometry::Axis;
use case::observe::FluidOutput;
use contacts::Contacts;
use decomposition::Domain;
use dem::space::Space;
use fluid::Fields;
use grains::Grains;
use group::RankGroup;
use io::{Image, MeshData, Mode, OutputTime, Series};
use plan::Plan;
use probes::Probe;
use schedule::Schedule;
use seepage::SeepageFields;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Series of files and its schedule.
#[derive(Debug)]
struct Output<T> {
    series: Series,
    schedule: Schedule,
    last: Option<u64>,
    buffers: T,
}

/// Output fields of the lattice or of the seepage.
#[derive(Debug)]
enum FluidFields {
    Lattice(Box<Fields>),
    Seepage(SeepageFields),
}

/// All outputs of a run over time, except checkpoints and the tables of analyses.
#[derive(Debug)]
pub struct Outputs {
    folder: PathBuf,
    provenance: Vec<(String, String)>,
    fluid: Option<Output<FluidFields>>,
    grains: Option<Output<Grains>>,
    contacts: Option<Output<Contacts>>,
    blocks: Option<Output<Blocks>>,
    averages: Option<Output<AverageFields>>,
    probes: Vec<Probe>,
    next: u64,
}

impl Outputs {
    /// Writes the series `structures` and `walls` and opens `fluid`, `grains`, `contacts`, `blocks` and the tables
    /// `probe_NAME.csv` in the existing folder `folder`.
    ///
    /// Without `resumed_at` the files of an earlier run with these names are removed; otherwise rows and files up
    /// to that step are kept and later ones dropped. `provenance` goes into every series file. Collective.
    ///
    /// # Errors
    /// If a file cannot be written, [`Error::Io`]; the error is the same on all ranks.
    pub fn create(
        plan: &Plan,
        folder: &Path,
        provenance: Vec<(String, String)>,
        domain: &Domain,
        resumed_at: Option<u64>,
    ) -> Result<Self, Error> {
        let written = &plan.scene.output;
        let place = Place {
            plan,
            folder,
            group: RankGroup(domain.communicator()),
            resumed_at,
        };
        if resumed_at.is_none() && !plan.scene.structures.is_empty() {
            structures::write(&plan.scene, folder, &provenance, &place.group)?;
        }
        if resumed_at.is_none() && walls::surfaces(&plan.scene).next().is_some() {
            walls::write(&plan.scene, folder, &provenance, &place.group)?;
        }
        let fluid = written.fluid.as_ref().map(|output| {
            let fields = FluidFields::new(output, plan.scene.seepage.is_some());
            place.open("fluid", Some(output.every), fields)
        });
        let fluid = fluid.transpose()?;
        let grains = written.grains.as_ref().map(|output| {
            let columns = Grains::new(output.displacement);
            place.open("grains", Some(output.every), columns)
        });
        let grains = grains.transpose()?;
        let contacts = written.contacts.as_ref();
        let contacts = contacts
            .map(|output| {
                let law = plan.scene.contact.as_ref();
                let bridges = law.is_some_and(|contact| contact.model().bridges());
                place.open("contacts", Some(output.every), Contacts::new(bridges))
            })
            .transpose()?;
        let blocks = written.blocks.as_ref();
        let blocks = blocks
            .map(|output| place.open("blocks", Some(output.every), Blocks::default()))
            .transpose()?;
        let averages = written.averages.as_ref().map(|output| {
            // Without an interval there is output only at the end of the run.
            let fields = AverageFields::new(output.profile.map(Axis::index));
            let mut averages = place.open("averages", output.every, fields)?;
            averages.open_profile(folder, &place.group, resumed_at)?;
            Ok::<_, Error>(averages)
        });
        let averages = averages.transpose()?;
        let probes = Probe::all(plan, folder, domain, resumed_at)?;
        let mut outputs = Self {
            folder: folder.to_owned(),
            provenance,
            fluid,
            grains,
            contacts,
            blocks,
            averages,
            probes,
            next: 0,
        };
        outputs.next = outputs.earliest();
        outputs.log_series();
        Ok(outputs)
    }

    fn log_series(&self) {
        let series = [
            ("fluid", self.fluid.is_some()),
            ("grains", self.grains.is_some()),
            ("contacts", self.contacts.is_some()),
            ("blocks", self.blocks.is_some()),
            ("averages", self.averages.is_some()),
        ];
        let series: Vec<&str> = series.iter().filter(|s| s.1).map(|s| s.0).collect();
        log::debug!(
            "series {series:?} and {} probes in {}, the first due at step {}",
            self.probes.len(),
            self.folder.display(),
            self.next
        );
    }

    /// Writes the outputs due at the step of the view. Must be called before the first step, also after a restart, and
    /// after every step before the checkpoint of that step. Collective: every rank calls it at the same steps.
    ///
    /// # Errors
    /// If a file cannot be written, [`Error::Io`]; the error is the same on all ranks. A write that fails on some
    /// ranks ends the job with exit code 5.
    pub fn write_due<S: Space>(&mut self, view: &StateView<S>) -> Result<(), Error> {
        if view.step < self.next {
            return Ok(());
        }
        let begun = Instant::now();
        self.write_series(view, |schedule| schedule.is_due(view.step))?;
        for probe in &mut self.probes {
            if probe.schedule.is_due(view.step) {
                probe.write(view)?;
            }
            probe.schedule.pass(view.step);
        }
        self.next = self.earliest();
        log::debug!(
            "the outputs of step {} took {:.4} s; the next are due at step {}",
            view.step,
            begun.elapsed().as_secs_f64(),
            self.next
        );
        Ok(())
    }

    /// Writes all outputs for the present state, unless they were written at this step: the end of a run is the
    /// last output of each series and the last row of each probe. Collective.
    ///
    /// # Errors
    /// If [`Self::write_due`] fails.
    pub fn write_all_now<S: Space>(&mut self, view: &StateView<S>) -> Result<(), Error> {
        self.write_series(view, |_| true)?;
        for probe in &mut self.probes {
            if probe.last != Some(view.step) {
                probe.write(view)?;
            }
            probe.schedule.pass(view.step);
        }
        self.next = self.earliest();
        Ok(())
    }

    /// Drops the outputs of `step` that were written only because a run ended there. Must be called before a run
    /// resumed at `step` continues, so that its files equal those of a run that did not end there. Collective.
    ///
    /// # Errors
    /// If a file cannot be written, [`Error::Io`]; the error is the same on all ranks.
    pub fn drop_end(&mut self, step: u64, domain: &Domain) -> Result<(), Error> {
        let group = RankGroup(domain.communicator());
        if let Some(output) = &mut self.fluid {
            output.drop_end(step, &group)?;
        }
        if let Some(output) = &mut self.grains {
            output.drop_end(step, &group)?;
        }
        if let Some(output) = &mut self.contacts {
            output.drop_end(step, &group)?;
        }
        if let Some(output) = &mut self.blocks {
            output.drop_end(step, &group)?;
        }
        if let Some(output) = &mut self.averages
            && output.drop_end(step, &group)?
            && let (Some(before), Some(_)) = (step.checked_sub(1), output.buffers.profile)
        {
            let (folder, table) = (&self.folder, &mut output.buffers.table);
            group.on_root(|| {
                *table = Some(averages::open(
                    &averages::profile_path(folder),
                    Some((before, true)),
                )?);
                Ok(())
            })?;
        }
        for probe in &mut self.probes {
            probe.drop_end(step, &group)?;
        }
        Ok(())
    }

    /// Returns the next step at which an output is due; `u64::MAX` if none is.
    #[must_use]
    pub fn next_due(&self) -> u64 {
        self.next
    }

    /// Synchronises all tables to disk, as before a checkpoint. Collective.
    ///
    /// # Errors
    /// If a file cannot be written, [`Error::Io`]; the error is the same on all ranks.
    pub fn sync(&self, domain: &Domain) -> Result<(), Error> {
        let profile = self.averages.as_ref();
        let profile = profile.and_then(|output| output.buffers.table.as_ref());
        if self.probes.is_empty() && self.averages.is_none() {
            return Ok(());
        }
        RankGroup(domain.communicator()).on_root(|| {
            profile.map_or(Ok(()), io::CsvTable::sync)?;
            self.probes.iter().try_for_each(Probe::sync)
        })
    }

    fn write_series<S: Space>(
        &mut self,
        view: &StateView<S>,
        due: impl Fn(&Schedule) -> bool,
    ) -> Result<(), Error> {
        let (scene, grid) = (&view.plan.scene, &view.plan.scene.grid);
        let communicator = view.domain.communicator();
        let file = File::new(view, &self.provenance);
        if let Some(output) = &mut self.fluid {
            output.write(view.step, &due, |fields, series| {
                fields.write(view, &file, series)
            })?;
        }
        if let Some(output) = &mut self.grains {
            output.write(view.step, &due, |columns, series| {
                columns.read(view.particles, grid, communicator)?;
                file.write_mesh(series, &columns.mesh(grid.dimension))
            })?;
        }
        if let Some(output) = &mut self.contacts {
            output.write(view.step, &due, |columns, series| {
                columns.read(view.dem, view.particles, grid, communicator)?;
                file.write_mesh(series, &columns.mesh(grid.dimension))
            })?;
        }
        if let Some(output) = &mut self.blocks {
            output.write(view.step, &due, |faces, series| {
                faces.read(view.particles, scene, communicator)?;
                file.write_mesh(series, &faces.mesh())
            })?;
        }
        let Some(output) = &mut self.averages else {
            return Ok(());
        };
        let averages = view.averages.ok_or_else(averages::none)?;
        let due = |schedule: &Schedule| averages.samples() > 0 && due(schedule);
        output.write(view.step, due, |fields, series| {
            fields.write(averages, view, &file, series)
        })
    }

    fn earliest(&self) -> u64 {
        let series = [
            self.fluid.as_ref().map(|o| o.schedule),
            self.grains.as_ref().map(|o| o.schedule),
            self.contacts.as_ref().map(|o| o.schedule),
            self.blocks.as_ref().map(|o| o.schedule),
            self.averages.as_ref().map(|o| o.schedule),
        ];
        let probes = self.probes.iter().map(|probe| probe.schedule);
        series
            .into_iter()
            .flatten()
            .chain(probes)
            .map(|schedule| schedule.next())
            .min()
            .unwrap_or(u64::MAX)
    }
}

/// Folder of all outputs, and the step at which a resumed run opens them.
struct Place<'a> {
    plan: &'a Plan,
    folder: &'a Path,
    group: RankGroup<'a>,
    resumed_at: Option<u64>,
}

impl Place<'_> {
    /// Opens a series with an output every `every` seconds; without an interval only at the end of the run.
    /// Collective.
    fn open<T>(&self, name: &str, every: Option<f64>, buffers: T) -> Result<Output<T>, Error> {
        let (group, folder) = (&self.group, self.folder);
        let every = every.map(|interval| self.plan.clock.every(interval));
        let (series, schedule, last) = match self.resumed_at {
            None => {
                let series = group.checked(Series::create(folder, name, group))?;
                (series, Schedule::new(every), None)
            }
            Some(step) => {
                let mut series = group.checked(Series::open(folder, name, group))?;
                group.checked(series.truncate_after(step, group))?;
                let written = group.on_root(|| Ok(series.moments().any(|m| m.step == step)))?;
                let last = written.then_some(step);
                (series, Schedule::resumed(every, step, written), last)
            }
        };
        Ok(Output {
            series,
            schedule,
            last,
            buffers,
        })
    }
}

/// Parts that the files of all series at one step have in common.
struct File<'a> {
    when: OutputTime,
    provenance: &'a [(String, String)],
    group: RankGroup<'a>,
}

impl<'a> File<'a> {
    fn new<S: Space>(view: &StateView<'a, S>, provenance: &'a [(String, String)]) -> Self {
        Self {
            when: OutputTime {
                step: view.step,
                time: view.time,
            },
            provenance,
            group: RankGroup(view.domain.communicator()),
        }
    }

    fn write_image(&self, series: &mut Series, image: &Image) -> Result<(), Error> {
        let (group, mode) = (&self.group, Mode::Collective);
        let written = series.write_image(self.when, image, self.provenance, group, mode);
        group.checked(written).map(drop)
    }

    fn write_mesh(&self, series: &mut Series, mesh: &MeshData) -> Result<(), Error> {
        let (group, mode) = (&self.group, Mode::Collective);
        let written = series.write_mesh(self.when, mesh, self.provenance, group, mode);
        group.checked(written).map(drop)
    }
}

impl FluidFields {
    fn new(output: &FluidOutput, seeps: bool) -> Self {
        let (fields, precision) = (&output.fields, output.precision);
        if seeps {
            Self::Seepage(SeepageFields::new(fields, precision))
        } else {
            Self::Lattice(Box::new(Fields::new(fields, precision)))
        }
    }

    fn write<S: Space>(
        &mut self,
        view: &StateView<S>,
        file: &File,
        series: &mut Series,
    ) -> Result<(), Error> {
        let first = view.domain.rank() == 0;
        let image = match (self, view.seepage) {
            // Before its first solution the water has no state.
            (Self::Seepage(_), Some(seepage)) if !seepage.is_known() => return Ok(()),
            (Self::Seepage(fields), Some(seepage)) => {
                fields.read(seepage, first);
                fields.image(seepage, first)
            }
            (Self::Seepage(_), None) => return Err(probes::no_fluid()),
            (Self::Lattice(fields), _) => {
                let (fluid, grid) = (probes::fluid(view)?, &view.plan.scene.grid);
                fields.read(fluid, grid, view.domain)?;
                fields.image(fluid, grid)
            }
        };
        file.write_image(series, &image)
    }
}

impl AverageFields {
    /// Writes a row of the profile, if requested, and the fields. Collective.
    fn write<S: Space>(
        &mut self,
        averages: &Averages,
        view: &StateView<S>,
        file: &File,
        series: &mut Series,
    ) -> Result<(), Error> {
        let (fluid, grid) = (probes::fluid(view)?, &view.plan.scene.grid);
        if let Some(axis) = self.profile {
            let rows = averages::profile(averages, fluid, grid, axis, file.group.0);
            file.group.on_root(|| {
                let table = self.table.as_mut();
                table.map_or(Ok(()), |table| {
                    rows.iter().try_for_each(|row| {
                        table.row(view.step, &[&[view.time], row.as_slice()].concat())
                    })
                })
            })?;
        }
        self.read(averages, fluid.units());
        file.write_image(series, &self.image(fluid, grid))
    }
}

impl<T> Output<T> {
    /// Drops the output of `step` if the schedule has no output at this step; returns `true` if it was dropped.
    /// Collective.
    fn drop_end(&mut self, step: u64, group: &RankGroup) -> Result<bool, Error> {
        if self.schedule.falls_on(step) {
            return Ok(false);
        }
        // Every schedule has an output at step 0, except averages without an interval.
        let Some(before) = step.checked_sub(1) else {
            return Ok(false);
        };
        group.checked(self.series.truncate_after(before, group))?;
        self.last = None;
        Ok(true)
    }

    /// Writes the output of `step` if it is due and not written yet. Collective.
    fn write(
        &mut self,
        step: u64,
        due: impl Fn(&Schedule) -> bool,
        write: impl FnOnce(&mut T, &mut Series) -> Result<(), Error>,
    ) -> Result<(), Error> {
        if self.last != Some(step) && due(&self.schedule) {
            write(&mut self.buffers, &mut self.series)?;
            self.last = Some(step);
        }
        self.schedule.pass(step);
        Ok(())
    }
}

impl Output<AverageFields> {
    /// Opens the table of the profile, on rank 0, if one is requested. Its rows are written before the fields of the
    /// same step.
    fn open_profile(
        &mut self,
        folder: &Path,
        group: &RankGroup,
        resumed_at: Option<u64>,
    ) -> Result<(), Error> {
        if self.buffers.profile.is_none() {
            return Ok(());
        }
        let path = averages::profile_path(folder);
        let resumed_at = resumed_at.map(|step| (step, self.last == Some(step)));
        let table = &mut self.buffers.table;
        group.on_root(|| {
            *table = Some(averages::open(&path, resumed_at)?);
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests;
