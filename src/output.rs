//! Output of fields and series: selection, schedule, and conversion to SI.
//!
//! [`Outputs`] connects the run and the files. It determines the outputs due at a step, requests them from the [`View`], converts them with
//! [`crate::units`] and passes named arrays to [`io`]. A step without output costs one comparison.
//!
//! | file | content |
//! |---|---|
//! | `group` | the ranks as a group that writes |
//! | `schedule` | the steps of an output |
//! | `view` | access to the state of a run |
//! | `fluid`, `vorticity` | fields of the fluid; the vorticity, with the adjacent planes of other slabs |
//! | `averages` | time averages and their profile |
//! | `grains`, `contacts`, `blocks`, `order` | grains, contacts and faces of blocks, in an order that does not depend on the ranks |
//! | `structures` | surfaces at rest, once |
//! | `probes` | values over time |
//! | `info` | description of a file or folder |
//!
//! No file depends on the number of ranks.

pub mod averages;
mod blocks;
mod contacts;
mod fluid;
mod grains;
pub mod group;
pub mod info;
mod order;
mod probes;
mod schedule;
mod seepage;
mod structures;
pub mod view;
mod vorticity;

use crate::case::geometry::Axis;
use crate::dem::space::Space;
use crate::error::Error;
use crate::output::view::View;
use crate::plan::Plan;
use crate::plan::interval::Interval;
use averages::AverageFields;
use blocks::Blocks;
use contacts::Contacts;
use decomposition::Domain;
use fluid::Fields;
use grains::Grains;
use group::RankGroup;
use io::{Mode, Moment, Series};
use probes::Probe;
use schedule::Schedule;
use seepage::SeepageFields;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A series of files and when it is due.
#[derive(Debug)]
struct Output<T> {
    series: Series,
    schedule: Schedule,
    last: Option<u64>,
    buffers: T,
}

/// Fields of whichever fluid there is.
#[derive(Debug)]
enum FluidFields {
    Lattice(Box<Fields>),
    Seepage(SeepageFields),
}

/// All outputs of a run over time, except checkpoints and analyses.
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
    /// Writes the series `structures` and opens `fluid`, `grains`, `contacts`, `blocks` and the tables `probe_NAME.csv` in `folder`, which is there.
    ///
    /// Without `resumed_at` what an earlier run left under these names is removed; with it, a step, what was written up to
    /// that step is kept and what came later is dropped. `provenance` goes into every series file. Collective.
    ///
    /// # Errors
    /// [`Error::Io`], the same on all ranks.
    pub fn create(
        plan: &Plan,
        folder: &Path,
        provenance: Vec<(String, String)>,
        domain: &Domain,
        resumed_at: Option<u64>,
    ) -> Result<Self, Error> {
        let written = &plan.scene.output;
        let group = RankGroup(domain.communicator());
        let every = |interval: f64| Some(plan.clock.every(interval));
        if resumed_at.is_none() && !plan.scene.structures.is_empty() {
            structures::write(&plan.scene, folder, &provenance, &group)?;
        }
        let fluid = match &written.fluid {
            Some(output) => {
                let fields = if plan.scene.seepage.is_some() {
                    FluidFields::Seepage(SeepageFields::new(&output.fields, output.precision))
                } else {
                    FluidFields::Lattice(Box::new(Fields::new(&output.fields, output.precision)))
                };
                let every = every(output.every);
                Some(Output::open(
                    folder, "fluid", every, fields, &group, resumed_at,
                )?)
            }
            None => None,
        };
        let grains = match &written.grains {
            Some(output) => {
                let every = every(output.every);
                let columns = Grains::new(output.displacement);
                Some(Output::open(
                    folder, "grains", every, columns, &group, resumed_at,
                )?)
            }
            None => None,
        };
        let contacts = match &written.contacts {
            Some(output) => {
                let every = every(output.every);
                let columns = Contacts::default();
                Some(Output::open(
                    folder, "contacts", every, columns, &group, resumed_at,
                )?)
            }
            None => None,
        };
        let blocks = match &written.blocks {
            Some(output) => {
                let every = every(output.every);
                let faces = Blocks::default();
                Some(Output::open(
                    folder, "blocks", every, faces, &group, resumed_at,
                )?)
            }
            None => None,
        };
        let averages = match &written.averages {
            Some(output) => {
                // Without an interval only the end of the run is left.
                let every = output.every.and_then(every);
                let fields = AverageFields::new(output.profile.map(Axis::index));
                let mut output =
                    Output::open(folder, "averages", every, fields, &group, resumed_at)?;
                output.open_profile(folder, &group, resumed_at)?;
                Some(output)
            }
            None => None,
        };
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
        let series = [
            ("fluid", outputs.fluid.is_some()),
            ("grains", outputs.grains.is_some()),
            ("contacts", outputs.contacts.is_some()),
            ("blocks", outputs.blocks.is_some()),
            ("averages", outputs.averages.is_some()),
        ];
        let series: Vec<&str> = series.iter().filter(|s| s.1).map(|s| s.0).collect();
        log::debug!(
            "series {series:?} and {} probes in {}, the first due at step {}",
            outputs.probes.len(),
            folder.display(),
            outputs.next
        );
        Ok(outputs)
    }

    /// Writes the outputs due at the step of the view. Call it before the first step, after a restart too, and after every
    /// step, before the checkpoint of that step. Collective: every rank calls it at the same steps.
    ///
    /// # Errors
    /// [`Error::Io`], the same on all ranks; a write that fails on some ranks ends the job with exit code 5.
    pub fn write_due<S: Space>(&mut self, view: &View<S>) -> Result<(), Error> {
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
            "what was due at step {} took {:.4} s; next at step {}",
            view.step,
            begun.elapsed().as_secs_f64(),
            self.next
        );
        Ok(())
    }

    /// Writes everything as it is now, unless that was done at this step: the end of a run is the last output of each series and
    /// the last row of each probe. Collective.
    ///
    /// # Errors
    /// As [`Self::write_due`].
    pub fn write_all_now<S: Space>(&mut self, view: &View<S>) -> Result<(), Error> {
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

    /// Drops what is there of `step` only because a run ended there. Call it where a run that was resumed at `step` is about to go
    /// on, so that its files become those of a run that never ended there. Collective.
    ///
    /// # Errors
    /// [`Error::Io`], the same on all ranks.
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

    /// The next step at which an output is due; `u64::MAX` if none is.
    #[must_use]
    pub fn next_due(&self) -> u64 {
        self.next
    }

    /// Flushes all tables to the disk itself, as before a checkpoint. Collective.
    ///
    /// # Errors
    /// [`Error::Io`], the same on all ranks.
    pub fn sync(&self, domain: &Domain) -> Result<(), Error> {
        let profile = self.averages.as_ref();
        let profile = profile.and_then(|output| output.buffers.table.as_ref());
        if self.probes.is_empty() && self.averages.is_none() {
            return Ok(());
        }
        RankGroup(domain.communicator()).on_root(|| {
            profile.map_or(Ok(()), io::Table::sync)?;
            self.probes.iter().try_for_each(Probe::sync)
        })
    }

    fn write_series<S: Space>(
        &mut self,
        view: &View<S>,
        due: impl Fn(&Schedule) -> bool,
    ) -> Result<(), Error> {
        let grid = &view.plan.scene.grid;
        let communicator = view.domain.communicator();
        let group = RankGroup(communicator);
        let provenance = &self.provenance;
        let when = Moment {
            step: view.step,
            time: view.time,
        };
        if let Some(output) = &mut self.fluid {
            if output.is_wanted(view.step, &due) {
                let first = communicator.rank() == 0;
                let image = match (&mut output.buffers, view.seepage) {
                    (FluidFields::Seepage(fields), Some(seepage)) => {
                        fields.read(seepage, first);
                        fields.image(seepage, first)
                    }
                    (FluidFields::Seepage(_), None) => return Err(probes::no_fluid()),
                    (FluidFields::Lattice(fields), _) => {
                        let fluid = probes::fluid(view)?;
                        fields.read(fluid, grid, view.domain)?;
                        fields.image(fluid, grid)
                    }
                };
                let mode = Mode::Collective;
                group.checked(
                    output
                        .series
                        .write_image(when, &image, provenance, &group, mode),
                )?;
                output.last = Some(view.step);
            }
            output.schedule.pass(view.step);
        }
        if let Some(output) = &mut self.grains {
            if output.is_wanted(view.step, &due) {
                output.buffers.read(view.particles, grid, communicator)?;
                let mesh = output.buffers.mesh(grid.dimension);
                let mode = Mode::Collective;
                group.checked(
                    output
                        .series
                        .write_mesh(when, &mesh, provenance, &group, mode),
                )?;
                output.last = Some(view.step);
            }
            output.schedule.pass(view.step);
        }
        if let Some(output) = &mut self.contacts {
            if output.is_wanted(view.step, &due) {
                let (dem, particles) = (view.dem, view.particles);
                output.buffers.read(dem, particles, grid, communicator)?;
                let mesh = output.buffers.mesh(grid.dimension);
                let mode = Mode::Collective;
                group.checked(
                    output
                        .series
                        .write_mesh(when, &mesh, provenance, &group, mode),
                )?;
                output.last = Some(view.step);
            }
            output.schedule.pass(view.step);
        }
        if let Some(output) = &mut self.blocks {
            if output.is_wanted(view.step, &due) {
                let scene = &view.plan.scene;
                output.buffers.read(view.particles, scene, communicator)?;
                let mesh = output.buffers.mesh();
                let mode = Mode::Collective;
                group.checked(
                    output
                        .series
                        .write_mesh(when, &mesh, provenance, &group, mode),
                )?;
                output.last = Some(view.step);
            }
            output.schedule.pass(view.step);
        }
        self.write_averages(view, due)
    }

    fn write_averages<S: Space>(
        &mut self,
        view: &View<S>,
        due: impl Fn(&Schedule) -> bool,
    ) -> Result<(), Error> {
        let Some(output) = &mut self.averages else {
            return Ok(());
        };
        let group = RankGroup(view.domain.communicator());
        let averages = view.averages.ok_or_else(averages::none)?;
        if averages.samples() > 0 && output.is_wanted(view.step, &due) {
            let fluid = probes::fluid(view)?;
            let grid = &view.plan.scene.grid;
            if let Some(axis) = output.buffers.profile {
                let rows = averages::profile(averages, fluid, grid, axis, group.0);
                group.on_root(|| {
                    let table = output.buffers.table.as_mut();
                    table.map_or(Ok(()), |table| {
                        rows.iter().try_for_each(|row| {
                            table.row(view.step, &[&[view.time], row.as_slice()].concat())
                        })
                    })
                })?;
            }
            output.buffers.read(averages, fluid.units());
            let image = output.buffers.image(fluid, grid);
            let when = Moment {
                step: view.step,
                time: view.time,
            };
            let (provenance, mode) = (&self.provenance, Mode::Collective);
            group.checked(
                output
                    .series
                    .write_image(when, &image, provenance, &group, mode),
            )?;
            output.last = Some(view.step);
        }
        output.schedule.pass(view.step);
        Ok(())
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

impl<T> Output<T> {
    fn open(
        folder: &Path,
        name: &str,
        every: Option<Interval>,
        buffers: T,
        group: &RankGroup,
        resumed_at: Option<u64>,
    ) -> Result<Self, Error> {
        let (series, schedule, last) = match resumed_at {
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
        Ok(Self {
            series,
            schedule,
            last,
            buffers,
        })
    }

    /// Drops the output of `step` where it is not one of its interval; whether it did. Collective.
    fn drop_end(&mut self, step: u64, group: &RankGroup) -> Result<bool, Error> {
        if self.schedule.falls_on(step) {
            return Ok(false);
        }
        // Step 0 has an output of every interval; only averages without one have none.
        let Some(before) = step.checked_sub(1) else {
            return Ok(false);
        };
        group.checked(self.series.truncate_after(before, group))?;
        self.last = None;
        Ok(true)
    }

    fn is_wanted(&self, step: u64, due: impl Fn(&Schedule) -> bool) -> bool {
        self.last != Some(step) && due(&self.schedule)
    }
}

impl Output<AverageFields> {
    /// The table of the profile, on rank 0, if one is requested. Its rows are written before the fields of the same step.
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
