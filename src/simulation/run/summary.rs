//! Summary of a run: `summary.json` and the messages at its end.

use super::super::agreement;
use super::super::blocks;
use super::super::element_test::TestResults;
use super::super::energy;
use super::super::guards;
use super::super::means::{self, Means};
use super::super::phases::PhaseTimes;
use super::super::piping::{self, PipingAnswers};
use super::super::progress::clock;
use super::super::settled;
use super::super::versions::versions;
use super::super::watch;
use super::runner::Runner;
use base::error::Error;
use base::number::real;
use coupling::joint_water::JointWater;
use coupling::seepage::{Extremes, Seepage};
use darcy::Pressure;
use dem::Relaxation;
use dem::relax::unbalanced_text;
use dem::space::Space;
use lbm::quanta::from_quanta;
use output::checkpoint::SavedNumber;
use plan::scene::Scene;
use plan::scene::observe::{Probe, ProbeAt};
use plan::scene::seepage::Seepage as SeepageScene;
use serde_json::{Value, json};

/// Relative change of the mass of enclosed water above which a run warns.
const WARNED_MASS_LOSS: f64 = 1e-3;

/// Fraction of the water with a free surface whose loss causes a warning.
const LOST_WATER: f64 = 1e-2;

/// Ratio of the speed of a grain to the largest speed that water can give it, above which the grain counts as
/// thrown by contacts.
const THROWN_SPEED_RATIO: f64 = 1.1;

/// Returns the largest speed \[m/s\] that grains can reach by Bernoulli: from the largest difference of the reduced
/// pressure of the water, a fall over the height of the domain, and the initial speed.
fn bernoulli_speed(scene: &Scene, extremes: &Extremes) -> f64 {
    let density = scene.seepage.as_ref().map_or(1.0, |s| s.written.density);
    let fall: f64 = (0..3)
        .map(|axis| 2.0 * scene.gravity[axis].abs() * scene.grid.size[axis])
        .sum();
    let squared = 2.0 * extremes.pressure / density + fall + extremes.first_speed.powi(2);
    squared.sqrt()
}

/// Mass of water that has passed an opening, in cells.
struct OpeningMass {
    name: String,
    entered: f64,
    left: f64,
}

impl<Sp: Space, S: SavedNumber> Runner<Sp, S> {
    /// Returns the warning about mass per cell lost or gained by water without an opening.
    fn lost_mass(&self, change: f64) -> Option<String> {
        let plan = &self.simulation.now.plan;
        let units = plan.units.as_ref()?;
        let enclosed = self.simulation.guards.inflow_and_outflow(plan).is_none()
            && plan.scene.surface.is_none();
        (enclosed && change.abs() > WARNED_MASS_LOSS).then(|| {
            format!(
                "the mass of the enclosed water changed by {:.2} %, and its mean pressure therefore by {:.3e} \
                 Pa: interpolated links and grains that cover and uncover cells do not conserve mass; partially \
                 saturated cells do",
                100.0 * change,
                units.pressure_scale() * change / 3.0
            )
        })
    }

    /// Writes `summary.json` and prints it, or the messages at the end of a run. Collective.
    ///
    /// # Errors
    /// If a file cannot be written, the same on all ranks.
    pub(super) fn summarise(&mut self, outcome: &str, as_json: bool) -> Result<(), Error> {
        let measures = self.measure();
        let mut warnings = self.warnings(&measures);
        let mut values = self.values(outcome, &measures);
        warnings.extend(self.add_water(&mut values));
        if let Some(seepage) = self.simulation.now.seepage() {
            self.add_seepage(seepage, &measures.extremes, &mut values);
        }
        if let Some(joints) = self.simulation.now.joints() {
            self.add_joints(joints, &mut values);
        }
        let piping = self.backward_erosion()?;
        if let Some(piping) = &piping {
            warnings.extend(piping.warnings());
            values["backward_erosion"] = piping.summary();
        }
        let probes = self.read_probes();
        warnings.extend(probes.answers.as_ref().and_then(TestResults::warnings));
        values["warnings"] = json!(warnings);
        let feeds = self
            .simulation
            .removal
            .feed_counts(&self.simulation.now.plan);
        if !feeds.is_empty() {
            values["feeds"] = json!(feeds);
        }
        values["settled"] = json!(probes.settled.values);
        values["not_known_to_have_settled"] = json!(probes.settled.unknown);
        if !probes.means.is_empty() {
            values["means"] = json!(probes.means);
        }
        if let Some(answers) = &probes.answers {
            values["element_test"] = answers.summary();
        }
        self.add_records(&mut values)?;
        self.log_lists();
        let communicator = self.simulation.now.domain.communicator();
        agreement::on_first(communicator, || {
            let folder = self.folder.path();
            if let Some(piping) = &piping {
                io::atomic::write(&folder.join(piping::TABLE), piping.table().as_bytes())
                    .map_err(|e| Error::Io(e.to_string()))?;
            }
            io::atomic::write_json(&folder.join("summary.json"), &values)
                .map_err(|e| Error::Io(e.to_string()))
        })?;
        if as_json {
            let text = serde_json::to_string_pretty(&values).unwrap_or_default();
            self.progress.note(&text);
            return Ok(());
        }
        self.progress.note(&measures.account.table());
        self.print_speed(outcome, &measures);
        self.print_state(&measures, &values);
        for line in piping.iter().flat_map(PipingAnswers::lines) {
            self.progress.note(&line);
        }
        self.print_probes(&probes);
        for warning in &warnings {
            self.progress.note(&format!("warning: {warning}"));
        }
        self.progress.note(&format!(
            "files in {}: open *.xmf in ParaView; summary.json for scripts",
            self.folder.path().display()
        ));
        Ok(())
    }

    /// Computes the backward erosion below the structure of the case; none without one, or if the run has not computed
    /// its seepage yet. Collective.
    fn backward_erosion(&self) -> Result<Option<PipingAnswers>, Error> {
        let now = &self.simulation.now;
        let scene = now.plan.scene.seepage.as_ref();
        let scene = scene.and_then(|seepage| seepage.piping.as_ref());
        let seepage = now.seepage().filter(|seepage| seepage.is_known());
        let Some((scene, seepage)) = scene.zip(seepage) else {
            return Ok(None);
        };
        PipingAnswers::compute(scene, seepage).map(Some)
    }

    /// Measures the speed, memory and state of the run. Collective.
    fn measure(&self) -> Measures {
        let simulation = &self.simulation;
        let now = &simulation.now;
        let communicator = now.domain.communicator();
        let account = simulation.phases.reduce(communicator);
        let wall = self.watch.elapsed().as_secs_f64();
        let looped = account.looped();
        let steps = real(now.step - self.first_step);
        let cells = if now.lattice().is_some() {
            now.plan.scene.grid.cell_count()
        } else {
            0
        };
        let grains = communicator.all_reduce_sum_u64(now.particles.owned() as u64);
        let solid_steps = f64::from(now.plan.clock.solid_steps_per_step);
        let rate = if now.dem.is_some() {
            real(grains) * steps * solid_steps / looped.max(1e-9)
        } else {
            0.0
        };
        Measures {
            account,
            wall,
            looped,
            mlups: real(cells) * steps / looped.max(1e-9) / 1e6,
            rate,
            grains,
            rss: communicator.all_reduce_max_u64(peak_rss()),
            rss_total: communicator.all_reduce_sum_u64(peak_rss()),
            hash: now.state().hash(communicator),
            mass_change: (self.mass() - self.initial_mass) / real(cells.max(1)),
            extremes: (now.seepage().map(Seepage::extremes)).unwrap_or_default(),
        }
    }

    /// Returns a warning for each region that generated fewer grains than were due.
    fn feed_warnings(&self) -> Vec<String> {
        let feeds = self
            .simulation
            .removal
            .feed_counts(&self.simulation.now.plan);
        let late = feeds.iter().filter(|feed| feed.generated < feed.due);
        late.map(|feed| {
            format!(
                "the region `{}` generated {} of {} grains and had no free position for the others; enlarge it, \
                 reduce the rate, or let grains leave it faster",
                feed.region, feed.generated, feed.due
            )
        })
        .collect()
    }

    fn warnings(&self, measures: &Measures) -> Vec<String> {
        let now = &self.simulation.now;
        let mut warnings = self.simulation.guards.warnings(&now.plan);
        let seepage = now.seepage();
        warnings.extend(seepage.iter().flat_map(|seepage| seepage.warnings()));
        warnings.extend(self.lost_mass(measures.mass_change));
        if self.notes["settling"]["bonds"] == 0 {
            warnings.push(
                "no contact was bonded at the start (grains.bond_at_start): no grain touched another or a wall"
                    .into(),
            );
        }
        if self.notes["settling"]["at_rest"] == false {
            warnings.push(format!(
                "the bonded grains were not at rest when the run began: after {} solid steps the unbalanced force was \
                 still {} of the largest contact force (tolerance {}), and {} bonds had broken; let neighbours overlap \
                 slightly or use a bonding gap, so that all contacts are bonded, or raise the strength of the bonds",
                self.notes["settling"]["solid_steps"],
                unbalanced_text(self.notes["settling"]["unbalanced_force"].as_f64().unwrap_or(f64::MAX)),
                Relaxation::default().tolerance,
                self.notes["settling"]["bonds_broken"],
            ));
        }
        warnings.extend(self.simulation.departures.warnings(&now.plan.scene));
        warnings.extend(self.feed_warnings());
        if let Some((step, lack)) = &self.unsaved {
            let newest = self.newest_checkpoint.map_or_else(
                || "there is no checkpoint".to_owned(),
                |saved| format!("the newest checkpoint is that of step {saved}"),
            );
            warnings.push(format!(
                "no checkpoints were written from step {step} on, because disk space was lacking ({lack}); \
                 {newest}"
            ));
        }
        if seepage.is_none() {
            return warnings;
        }
        let extremes = &measures.extremes;
        let bernoulli = bernoulli_speed(&now.plan.scene, extremes);
        if now.dem.is_some() && extremes.speed > THROWN_SPEED_RATIO * bernoulli {
            warnings.push(format!(
                "a grain reached {:.3e} m/s, but differences of pressure and height explain at most \
                 {bernoulli:.3e} m/s (Bernoulli): the elastic energy of overlapping contacts accelerated it",
                extremes.speed
            ));
        }
        if extremes.water > THROWN_SPEED_RATIO * bernoulli && bernoulli > 0.0 {
            warnings.push(format!(
                "the water reached {:.3e} m/s in a cell, but differences of pressure and height explain at most \
                 {bernoulli:.3e} m/s (Bernoulli): moving grains accelerated it, or an imposed flux drives it \
                 through a narrow channel",
                extremes.water
            ));
        }
        warnings
    }

    /// Returns the values that every summary has. Collective.
    fn values(&self, outcome: &str, measures: &Measures) -> Value {
        let now = &self.simulation.now;
        let guards = &self.simulation.guards;
        let communicator = now.domain.communicator();
        // Processor time of all ranks [s], which does not depend on other work of the machine.
        let used = u64::try_from(watch::processor_time().as_micros()).unwrap_or(u64::MAX);
        let processor = 1e-6 * real(communicator.all_reduce_sum_u64(used));
        let mut values = json!({
            "outcome": outcome,
            "steps": now.step,
            "steps_of_this_run": now.step - self.first_step,
            "time": now.time(),
            "wall_seconds": measures.wall,
            "processor_seconds": processor,
            "loop_seconds": measures.looped,
            "phases": measures.account.phases,
            "waiting_seconds": measures.account.waiting,
            "traffic": measures.account.traffic,
            "imbalance": measures.account.imbalance,
            "mlups": measures.mlups,
            "particle_steps_per_second": measures.rate,
            "grains": measures.grains,
            "peak_rss_bytes": measures.rss,
            "peak_rss_bytes_all_ranks": measures.rss_total,
            "mass_error": guards.mass_error(),
            "mass_change": measures.mass_change,
            "momentum_error": guards.momentum_error(),
            "lattice_velocity": guards.lattice_velocity(),
            "mach": guards.lattice_velocity().map(guards::mach),
            "compression": guards.compression(),
            "overlap": guards.overlap(),
            "inflow": null,
            "outflow": null,
            "flow_imbalance": guards.imbalance(),
            "ranks": communicator.size(),
            "threads": self.threads,
            "case_hash": now.plan.case_hash,
            "state_hash": measures.hash,
            "notes": self.notes,
            "versions": versions(communicator),
        });
        if let Some([inflow, outflow]) = guards.inflow_and_outflow(&now.plan) {
            values["inflow"] = inflow.into();
            values["outflow"] = outflow.into();
        }
        values
    }

    /// Adds the water below a free surface: its mass [kg; kg/m in 2-D], the mass lost, and the masses that entered and
    /// left through the openings. Returns a warning if much is lost. Collective.
    fn add_water(&self, values: &mut Value) -> Option<String> {
        let now = &self.simulation.now;
        let surface = now.lattice().and_then(|flow| flow.fluid().surface())?;
        let units = now.plan.units.as_ref()?;
        let dimension = if now.plan.scene.grid.dimension == 2 {
            2
        } else {
            3
        };
        let cell = units.density * units.spacing.powi(dimension);
        let communicator = now.domain.communicator();
        let lost = communicator.all_reduce_sum_u128(surface.lost().cast_unsigned());
        let lost = from_quanta(lost.cast_signed());
        let (mass, before) = (self.mass(), self.initial_mass);
        let all = |mass: i128| {
            let mass = communicator.all_reduce_sum_u128(mass.cast_unsigned());
            from_quanta(mass.cast_signed())
        };
        let names: Vec<String> = now.lattice().map_or_else(Vec::new, |flow| flow.patches());
        let passed = surface.passed().map(|(patch, passed)| {
            let name = names.get(patch).cloned().unwrap_or_default();
            OpeningMass {
                name,
                entered: all(passed.entered),
                left: all(passed.left),
            }
        });
        let passed: Vec<OpeningMass> = passed.collect();
        let entered: f64 = passed.iter().map(|opening| opening.entered).sum();
        let left: f64 = passed.iter().map(|opening| opening.left).sum();
        let handled = (before + entered).max(f64::MIN_POSITIVE);
        values["water"] = json!({
            "mass": cell * mass,
            "mass_at_start": cell * before,
            "lost": cell * lost,
            "mass_error": (mass + lost + left - before - entered) / handled,
        });
        if !passed.is_empty() {
            values["water"]["entered"] = json!(cell * entered);
            values["water"]["left"] = json!(cell * left);
            let rows = passed.into_iter().map(|one| {
                json!({"name": one.name, "entered": cell * one.entered, "left": cell * one.left})
            });
            values["water"]["openings"] = rows.collect();
        }
        (lost.abs() > LOST_WATER * handled).then(|| {
            let part = 100.0 * lost.abs() / handled;
            if lost > 0.0 {
                format!(
                    "{part:.1} % of the water is lost in drops of one cell and in enclosed air; finer cells lose less"
                )
            } else {
                format!(
                    "{part:.1} % more water than entered fills enclosed air and the last cells below a lid; finer \
                     cells gain less"
                )
            }
        })
    }

    fn add_joints(&self, joints: &JointWater, values: &mut Value) {
        let Some(scene) = &self.simulation.now.plan.scene.joints else {
            return;
        };
        let balance = joints.balance();
        let mouths = scene.mouths.iter().enumerate().map(|(n, mouth)| {
            let [inflow, pressure] = joints.mouth(n);
            json!({"name": mouth.name, "inflow": inflow, "pressure": pressure})
        });
        let departures = joints.departures().into_iter();
        let departures = departures.map(|one| json!({"block": one.block, "time": one.time}));
        values["joints"] = json!({
            "joints": scene.counts.joints,
            "cells": scene.counts.cells,
            "mouths": mouths.collect::<Vec<_>>(),
            "stored_water": joints.flow().water(),
            "initial_water": balance.initial,
            "water_in": balance.entered,
            "water_released": balance.released,
            "water_taken_over": balance.taken_over,
            "water_opened": balance.opened,
            "water_into_rock": balance.into_rock,
            "mass_error": joints.mass_error(),
            "blocks_left": departures.collect::<Vec<_>>(),
            "smallest_pressure": balance.pressures().map(|[low, _]| low),
            "largest_pressure": balance.pressures().map(|[_, high]| high),
        });
    }

    fn add_seepage(&self, seepage: &Seepage<Sp>, extremes: &Extremes, values: &mut Value) {
        let now = &self.simulation.now;
        let (report, balance) = (seepage.report(), seepage.balance());
        let grains = now.dem.is_some();
        let most = report.inflow.max(report.outflow);
        values["inflow"] = report.inflow.into();
        values["outflow"] = report.outflow.into();
        values["flow_imbalance"] =
            json!((most > 0.0).then(|| (report.inflow - report.outflow) / most));
        let water = seepage.pressure().water_balance();
        let scene = now.plan.scene.seepage.as_ref();
        if water.is_some() {
            // Below a free surface the difference of inflow and outflow is stored water, not an imbalance.
            values["flow_imbalance"] = Value::Null;
        }
        values["seepage"] = json!({
            "iterations": report.iterations,
            "residual": report.residual,
            "inflow": report.inflow,
            "outflow": report.outflow,
            "force_on_grains": balance.on_grains,
            "force_of_pressure": balance.pressure,
            "weight_of_water": balance.weight,
            "closure": balance.closure,
            "largest_closure": extremes.closure,
            "reynolds": balance.reynolds,
            "largest_reynolds": extremes.reynolds,
            "open_water": balance.open_water,
            "fastest_water": extremes.water,
            "fastest_grain": grains.then_some(extremes.speed),
            "bernoulli_speed": bernoulli_speed(&now.plan.scene, extremes),
            "patch_inflows": seepage.pressure().patch_inflows(),
            "exit_gradients": exits(seepage.pressure(), scene),
            "heave": heave(seepage.pressure(), &now.plan.scene.probes),
            "overshoot": seepage.pressure().overshoot(),
            "mean_porosity": grains.then(|| seepage.mean_porosity()),
            "stored_water": water.map(|water| water.stored),
            "initial_water": water.map(|water| water.initial),
            "water_in": water.map(|water| water.entered),
            "water_out": water.map(|water| water.left),
            "mass_error": water.map(|water| water.error()),
        });
    }

    /// Reads the tables of the probes. Only the first rank has them and reports about them.
    fn read_probes(&self) -> Probes {
        let now = &self.simulation.now;
        if now.domain.rank() != 0 {
            return Probes::default();
        }
        let folder = self.folder.path();
        Probes {
            settled: settled::read(&now.plan, folder, now.time()),
            means: means::read(&now.plan, folder),
            answers: TestResults::read(&now.plan, folder),
        }
    }

    /// Adds the energy of the grains and the results of blocks and recorders. Collective.
    fn add_records(&self, values: &mut Value) -> Result<(), Error> {
        let now = &self.simulation.now;
        let communicator = now.domain.communicator();
        if now.dem.is_some() {
            values["kinetic_energy"] = energy::kinetic_energy(&now.particles, communicator).into();
        }
        if let Some(report) = blocks::summary(&now.plan, &now.particles, communicator) {
            values["blocks"] = report;
        }
        if let Some(erosion) = self.simulation.recorder.summary(&now.plan)? {
            values["erosion"] = erosion;
        }
        if let Some((entry, left)) = self.simulation.departures.summary(&now.plan.scene) {
            values[entry] = left;
        }
        if let Some(crossings) = self.simulation.crossings.summary() {
            values["crossings"] = crossings;
        }
        if let Some(collapse) = self.simulation.collapse.summary()? {
            values["collapse"] = collapse;
        }
        Ok(())
    }

    fn log_lists(&self) {
        let now = &self.simulation.now;
        if log::log_enabled!(log::Level::Debug)
            && let Some(dem) = &now.dem
        {
            let lists = dem.statistics(&now.particles);
            log::debug!(
                "rank {}: neighbour lists built {} times, {} pairs tested; {} contacts now, {} of them bonded, \
                 {} bridges",
                now.domain.rank(),
                lists.rebuilds,
                lists.tested,
                lists.contacts,
                lists.bonds,
                lists.bridges
            );
        }
    }

    fn print_speed(&self, outcome: &str, measures: &Measures) {
        let now = &self.simulation.now;
        let mut speeds = Vec::new();
        if now.plan.scene.flow.is_some() {
            speeds.push(format!("{:.1} MLUPS", measures.mlups));
        }
        if now.dem.is_some() {
            let rate = measures.rate / 1e6;
            speeds.push(format!("{rate:.2} M particle-steps/s"));
        }
        let speeds = match speeds[..] {
            [] => String::new(),
            _ => format!(" ({})", speeds.join(", ")),
        };
        self.progress.note(&format!(
            "{outcome}: {} steps in {}{speeds}, peak {:.0} MB per rank",
            now.step - self.first_step,
            clock(measures.wall),
            real(measures.rss) / 1e6
        ));
    }

    /// Prints the hash of the state and the values of the water.
    fn print_state(&self, measures: &Measures, values: &Value) {
        let (hash, extremes) = (&measures.hash, &measures.extremes);
        let now = &self.simulation.now;
        let unit = if now.plan.scene.grid.dimension == 2 {
            "m2/s"
        } else {
            "m3/s"
        };
        if let Some(joints) = now.joints() {
            let pressures = joints.balance().pressures();
            let pressures = pressures.map_or_else(String::new, |[low, high]| {
                format!(", pressures from {low:.4e} to {high:.4e} Pa")
            });
            self.progress.note(&format!(
                "mass error {:.1e} of the water in the joints{pressures}; state {hash}",
                joints.mass_error()
            ));
            return;
        }
        if let Some(seepage) = now.seepage() {
            self.progress.note(&format!("state {hash}"));
            let report = seepage.report();
            self.progress.note(&format!(
                "inflow {:.4e}, outflow {:.4e} {unit}",
                report.inflow, report.outflow
            ));
            if now.dem.is_some() {
                self.progress.note(&format!(
                    "closure of momentum between water and grains at most {:.1e}, \
                     Reynolds number of the pores up to {:.2e}, fastest grain {:.2e} m/s",
                    extremes.closure, extremes.reynolds, extremes.speed
                ));
            }
            return;
        }
        let measured = |number: Option<f64>| {
            number.map_or_else(|| "-".to_owned(), |number| format!("{number:.1e}"))
        };
        let guards = &self.simulation.guards;
        self.progress.note(&format!(
            "mass error {} per step, momentum error {} of the largest force; state {hash}",
            measured(guards.mass_error()),
            measured(guards.momentum_error())
        ));
        let named = |name: &str| measured(values[name].as_f64());
        self.progress.note(&format!(
            "largest lattice velocity {}, largest Mach number {}, largest compression {}, inflow {}, outflow {} {unit}",
            named("lattice_velocity"),
            named("mach"),
            named("compression"),
            named("inflow"),
            named("outflow"),
        ));
    }

    fn print_probes(&self, probes: &Probes) {
        for line in means::lines(&probes.means) {
            self.progress.note(&line);
        }
        for line in probes.answers.iter().flat_map(TestResults::lines) {
            self.progress.note(&line);
        }
        for line in settled::lines(&self.simulation.now.plan, &probes.settled) {
            self.progress.note(&line);
        }
    }
}

/// Measurements of a run at its end.
struct Measures {
    account: PhaseTimes,
    /// Wall-clock time of the whole run \[s\], then that of its loop.
    wall: f64,
    looped: f64,
    /// Million cell updates per second, then million steps of grains per second.
    mlups: f64,
    rate: f64,
    /// Number of grains on all ranks.
    grains: u64,
    /// Peak memory \[bytes\]: the maximum over the ranks, then the sum.
    rss: u64,
    rss_total: u64,
    hash: String,
    /// Change of the mass of the lattice per cell, in lattice units.
    mass_change: f64,
    /// Extremes of the seepage; initial values without seepage.
    extremes: Extremes,
}

/// Results of the probes.
#[derive(Default)]
struct Probes {
    settled: settled::End,
    means: Vec<Means>,
    answers: Option<TestResults>,
}

/// Returns the peak resident memory of this process \[bytes\].
pub(super) fn peak_rss() -> u64 {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|l| l.starts_with("VmHWM:"))?;
            line.split_whitespace().nth(1)?.parse::<u64>().ok()
        })
        .map_or(0, |kib| kib * 1024)
}

/// Returns the largest gradient with which water leaves each patch, and the face where it occurs, by names of
/// patches.
fn exits(pressure: &Pressure, scene: Option<&SeepageScene>) -> Value {
    let patches = scene.into_iter().flat_map(|scene| &scene.patches);
    let drains = scene.into_iter().flat_map(|scene| &scene.drains);
    let names = patches.map(|p| &p.name).chain(drains.map(|d| &d.name));
    let found = names.zip(pressure.exit_gradients());
    let found = found.filter_map(|(name, exit)| {
        let exit = exit?;
        Some((
            name.clone(),
            json!({"gradient": exit.gradient, "position": exit.centre}),
        ))
    });
    found.collect::<serde_json::Map<String, Value>>().into()
}

/// Returns the safety factors against heave of the heave probes, by name: for Terzaghi's width of half the depth, and
/// the minimum with its width.
fn heave(pressure: &Pressure, probes: &[Probe]) -> Value {
    let found = probes.iter().filter_map(|probe| {
        let ProbeAt::Heave(prisms) = &probe.at else {
            return None;
        };
        let [half, least] = pressure.critical_heave(prisms)?;
        let finite = |factor: f64| factor.is_finite().then_some(factor);
        Some((
            probe.name.clone(),
            json!({
                "factor_of_safety": finite(half.factor_of_safety),
                "width": half.width,
                "least_factor": finite(least.factor_of_safety),
                "least_width": least.width,
            }),
        ))
    });
    found.collect::<serde_json::Map<String, Value>>().into()
}
