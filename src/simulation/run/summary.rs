//! The summary of a run: `summary.json` and the messages at its end.

use super::super::agreement;
use super::super::blocks;
use super::super::energy;
use super::super::guards;
use super::super::means;
use super::super::progress::clock;
use super::super::settled;
use super::super::versions::versions;
use super::runner::Runner;
use crate::checkpoint::Saved;
use crate::coupling::seepage::Extremes;
use crate::dem::space::Space;
use crate::error::Error;
use crate::number::real;
use crate::scene::Scene;
use serde_json::json;

/// Relative change of the mass of enclosed water from which a run warns.
const LOST: f64 = 1e-3;

/// A grain is thrown, not carried, where it is this many times as fast as the water can make it.
const LEAPS: f64 = 1.1;

/// The largest speed that grains can have by Bernoulli: that of water at the largest difference of its reduced pressure, a fall over the height of the
/// domain, and the speed at the start \[m/s\].
fn bernoulli_speed(scene: &Scene, extremes: &Extremes) -> f64 {
    let density = scene.seepage.as_ref().map_or(1.0, |s| s.written.density);
    let fall: f64 = (0..3)
        .map(|axis| 2.0 * scene.gravity[axis].abs() * scene.grid.size[axis])
        .sum();
    let squared = 2.0 * extremes.pressure / density + fall + extremes.first_speed.powi(2);
    squared.sqrt()
}

impl<Sp: Space, S: Saved> Runner<Sp, S> {
    /// What the water without an opening has lost or gained.
    fn lost_mass(&self, change: f64) -> Option<String> {
        let plan = &self.simulation.now.plan;
        let units = plan.units.as_ref()?;
        let enclosed = self.simulation.guards.through(plan).is_none();
        (enclosed && change.abs() > LOST).then(|| {
            format!(
                "the mass of the enclosed water changed by {:.2} %, its mean pressure with it by {:.3e} Pa: links that interpolate and grains that \
                 cover and uncover cells do not keep it; partially saturated cells do",
                100.0 * change,
                units.pressure_scale() * change / 3.0
            )
        })
    }

    pub(super) fn summarise(&mut self, outcome: &str, as_json: bool) -> Result<(), Error> {
        let simulation = &self.simulation;
        let communicator = simulation.now.domain.communicator();
        let account = simulation.phases.reduce(communicator);
        let wall = self.watch.elapsed().as_secs_f64();
        let looped = account.looped();
        let steps = real(simulation.now.step - self.first_step);
        let cells = if simulation.now.lattice().is_some() {
            simulation.now.plan.scene.grid.cell_count()
        } else {
            0
        };
        let mlups = real(cells) * steps / looped.max(1e-9) / 1e6;
        let grains = communicator.all_reduce_sum_u64(simulation.now.particles.owned() as u64);
        let solid_steps = f64::from(simulation.now.plan.clock.solid_steps_per_step);
        let rate = if simulation.now.dem.is_some() {
            real(grains) * steps * solid_steps / looped.max(1e-9)
        } else {
            0.0
        };
        let rss = communicator.all_reduce_max_u64(peak_rss());
        let rss_total = communicator.all_reduce_sum_u64(peak_rss());
        let hash = simulation.now.state().hash(communicator);
        let drift = self.mass() - self.initial_mass;
        let mut warnings = simulation.guards.warnings(&simulation.now.plan);
        let seepage = simulation.now.seepage();
        warnings.extend(seepage.iter().flat_map(|seepage| seepage.warnings()));
        let extremes = seepage
            .map(|seepage| seepage.extremes())
            .unwrap_or_default();
        warnings.extend(self.lost_mass(drift / real(cells.max(1))));
        let mut summary = json!({
            "outcome": outcome,
            "steps": simulation.now.step,
            "steps_of_this_run": simulation.now.step - self.first_step,
            "time": simulation.now.time(),
            "wall_seconds": wall,
            "loop_seconds": looped,
            "phases": account.phases,
            "waiting_seconds": account.waiting,
            "traffic": account.traffic,
            "imbalance": account.imbalance,
            "mlups": mlups,
            "particle_steps_per_second": rate,
            "grains": grains,
            "peak_rss_bytes": rss,
            "peak_rss_bytes_all_ranks": rss_total,
            "mass_error": simulation.guards.mass_error(),
            "mass_change": drift / real(cells.max(1)),
            "momentum_error": simulation.guards.momentum_error(),
            "lattice_velocity": simulation.guards.lattice_velocity(),
            "mach": simulation.guards.lattice_velocity().map(guards::mach),
            "compression": simulation.guards.compression(),
            "overlap": simulation.guards.overlap(),
            "inflow": null,
            "outflow": null,
            "flow_imbalance": simulation.guards.imbalance(),
            "ranks": communicator.size(),
            "threads": self.threads,
            "case_hash": simulation.now.plan.case_hash,
            "state_hash": hash,
            "notes": self.notes,
            "versions": versions(communicator),
        });
        if let Some([inflow, outflow]) = simulation.guards.through(&simulation.now.plan) {
            summary["inflow"] = inflow.into();
            summary["outflow"] = outflow.into();
        }
        if let Some(seepage) = simulation.now.seepage() {
            let (report, balance) = (seepage.report(), seepage.balance());
            let grains = simulation.now.dem.is_some();
            let bernoulli = bernoulli_speed(&simulation.now.plan.scene, &extremes);
            if grains && extremes.speed > LEAPS * bernoulli {
                warnings.push(format!(
                    "a grain reached {:.3e} m/s, and the differences of pressure and height give {bernoulli:.3e} m/s at most (Bernoulli): \
                     contacts that were pressed into each other threw it",
                    extremes.speed
                ));
            }
            if extremes.water > LEAPS * bernoulli && bernoulli > 0.0 {
                warnings.push(format!(
                    "the water reached {:.3e} m/s in a cell, and the differences of pressure and height give \
                     {bernoulli:.3e} m/s at most (Bernoulli): grains that moved pushed it, or a flux that is imposed \
                     drives it through a narrow way",
                    extremes.water
                ));
            }
            let most = report.inflow.max(report.outflow);
            summary["inflow"] = report.inflow.into();
            summary["outflow"] = report.outflow.into();
            summary["flow_imbalance"] =
                json!((most > 0.0).then(|| (report.inflow - report.outflow) / most));
            summary["seepage"] = json!({
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
                "bernoulli_speed": bernoulli,
                "patch_inflows": seepage.pressure().patch_inflows(),
                "mean_porosity": (simulation.now.dem.is_some()).then(|| seepage.mean_porosity()),
            });
        }
        summary["warnings"] = json!(warnings);
        // The first rank alone has the files of the probes, and alone speaks of them.
        let (settled, means) = if communicator.rank() == 0 {
            let (plan, time) = (&simulation.now.plan, simulation.now.time());
            let folder = self.folder.path();
            (settled::read(plan, folder, time), means::read(plan, folder))
        } else {
            (settled::End::default(), Vec::new())
        };
        summary["settled"] = json!(settled.values);
        summary["not_known_to_have_settled"] = json!(settled.unknown);
        if !means.is_empty() {
            summary["means"] = json!(means);
        }
        let particles = &simulation.now.particles;
        if simulation.now.dem.is_some() {
            summary["kinetic_energy"] = energy::of_motion(particles, communicator).into();
        }
        if let Some(report) = blocks::summary(&simulation.now.plan, particles, communicator) {
            summary["blocks"] = report;
        }
        if let Some(erosion) = simulation.recorder.summary(&simulation.now.plan)? {
            summary["erosion"] = erosion;
        }
        if let Some(collapse) = simulation.collapse.summary()? {
            summary["collapse"] = collapse;
        }
        if log::log_enabled!(log::Level::Debug)
            && let Some(dem) = &simulation.now.dem
        {
            let lists = dem.statistics(&simulation.now.particles);
            log::debug!(
                "rank {}: neighbour lists built {} times, {} pairs tested; {} contacts now, {} of them bonded",
                communicator.rank(),
                lists.rebuilds,
                lists.tested,
                lists.contacts,
                lists.bonds
            );
        }
        agreement::on_first(communicator, || {
            io::atomic::write_json(&self.folder.path().join("summary.json"), &summary)
                .map_err(|e| Error::Io(e.to_string()))
        })?;
        if as_json {
            self.progress
                .note(&serde_json::to_string_pretty(&summary).unwrap_or_default());
        } else {
            self.progress.note(&account.table());
            let scene = &simulation.now.plan.scene;
            let on_lattice = scene.flow.is_some();
            let mut speeds = Vec::new();
            if on_lattice {
                speeds.push(format!("{mlups:.1} MLUPS"));
            }
            if simulation.now.dem.is_some() {
                speeds.push(format!("{:.2} M particle-steps/s", rate / 1e6));
            }
            let speeds = match speeds[..] {
                [] => String::new(),
                _ => format!(" ({})", speeds.join(", ")),
            };
            self.progress.note(&format!(
                "{outcome}: {} steps in {}{speeds}, peak {:.0} MB a rank",
                simulation.now.step - self.first_step,
                clock(wall),
                real(rss) / 1e6
            ));
            let measured = |number: Option<f64>| {
                number.map_or_else(|| "-".to_owned(), |number| format!("{number:.1e}"))
            };
            let unit = if scene.grid.dimension == 2 {
                "m2/s"
            } else {
                "m3/s"
            };
            let guards = &simulation.guards;
            if simulation.now.seepage().is_none() {
                self.progress.note(&format!(
                    "mass error {} a step, momentum error {} of the largest force; state {hash}",
                    measured(guards.mass_error()),
                    measured(guards.momentum_error())
                ));
                let named = |name: &str| measured(summary[name].as_f64());
                self.progress.note(&format!(
                    "largest lattice velocity {}, largest Mach number {}, largest compression {}, inflow {}, outflow {} {unit}",
                    named("lattice_velocity"),
                    named("mach"),
                    named("compression"),
                    named("inflow"),
                    named("outflow"),
                ));
            } else {
                self.progress.note(&format!("state {hash}"));
            }
            if let Some(seepage) = simulation.now.seepage() {
                let report = seepage.report();
                self.progress.note(&format!(
                    "inflow {:.4e}, outflow {:.4e} {unit}",
                    report.inflow, report.outflow
                ));
                if simulation.now.dem.is_some() {
                    self.progress.note(&format!(
                        "closure of momentum between water and grains at most {:.1e}, Reynolds number of the pores up to {:.2e}, fastest grain {:.2e} m/s",
                        extremes.closure, extremes.reynolds, extremes.speed
                    ));
                }
            }
            for line in means::lines(&means) {
                self.progress.note(&line);
            }
            for line in settled::lines(&simulation.now.plan, &settled) {
                self.progress.note(&line);
            }
            for warning in &warnings {
                self.progress.note(&format!("warning: {warning}"));
            }
            self.progress.note(&format!(
                "files in {}: open *.xmf in ParaView; summary.json for scripts",
                self.folder.path().display()
            ));
        }
        Ok(())
    }
}

/// Peak resident memory of this process \[bytes\].
pub(super) fn peak_rss() -> u64 {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|l| l.starts_with("VmHWM:"))?;
            line.split_whitespace().nth(1)?.parse::<u64>().ok()
        })
        .map_or(0, |kib| kib * 1024)
}
