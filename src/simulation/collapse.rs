//! Records of a ground collapse: `collapse.csv`, `collapse_points.csv`, `clusters.csv`, `surface.csv`,
//! and two figures at its end. [`analysis::ground_collapse`] defines the quantities.
//!
//! Every `ground_collapse.every` seconds rank 0 collects the grains of all ranks, sorts them by id,
//! transforms them into the frame of the analysis (long axis, across, up) and evaluates them, so that
//! the rows have the same bits on any number of ranks. This costs 64 bytes per grain and a few
//! milliseconds per 10,000 grains and row. The grains removed between two rows are known to all ranks.

mod gathered;

use super::agreement::agree;
use super::removal::DepartedGrain;
use super::table::{Table, append};
use super::view::StateView;
use analysis::erosion_law::{RecordRow, read_rows};
use analysis::ground_collapse::clusters::{clusters, histogram, sizes_of_left};
use analysis::ground_collapse::measure::{
    Cells, InitialGround, Limits, MeasuredGrain, Point, PointMeasures, Sample,
};
use analysis::ground_collapse::record::{
    ClusterKind, ClusterRecord, CollapseRecord, CollapseSummary, PointRecord, PointSummary,
    StageTimes, SurfaceRecord,
};
use analysis::ground_collapse::stages::{Evidence, NAMES, Stages, Thresholds};
use base::error::Error;
use base::number::real;
use base::vector::norm;
use darcy::overlap::sphere_box;
use decomposition::{Domain, ExactSum};
use dem::space::Space;
use figures::ground_collapse as figures;
use gathered::{gather, in_frame};
use plan::Plan;
use plan::interval::Interval;
use plan::scene::collapse::GroundCollapse;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Quantities measured once on every rank, at the first call, while the ground is whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Start {
    /// Mass of all grains \[kg\].
    mass: f64,
    /// Mean diameter of the grains \[m\].
    diameter: f64,
}

/// Number and mass of the grains that left through one seepage point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct OutflowCount {
    grains: u64,
    mass: f64,
}

/// State of the recorder in a checkpoint. On ranks other than 0 only `start` and `points` are current.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CollapseState {
    start: Option<Start>,
    ground: Option<InitialGround>,
    points: Vec<OutflowCount>,
    stages: Stages,
    /// Time \[s\] and extension \[m\] of the last row.
    extension: Option<[f64; 2]>,
    /// Ids of the grains of each loose cluster with more than one grain, at the last row.
    blocks: Vec<Vec<u64>>,
    /// Ids of the grains that left since the last row.
    left: Vec<u64>,
    last_row: Option<u64>,
}

/// Tables that rank 0 writes.
#[derive(Debug, Default)]
struct Tables {
    rows: Option<Table>,
    points: Option<Table>,
    clusters: Option<Table>,
    surface: Option<Table>,
}

/// Writes the tables of a collapse: see the module. Methods with a view or a domain are collective.
#[derive(Debug)]
pub struct CollapseRecorder {
    settings: Option<GroundCollapse>,
    interval: Option<Interval>,
    first_grain: u64,
    state: CollapseState,
    tables: Tables,
    messages: Vec<String>,
}

impl CollapseRecorder {
    /// Opens the tables in `folder` on rank 0: new ones, or those of a run resumed at step `resumed_at` cut back to
    /// that step. Nothing is opened if the case requests no ground collapse.
    ///
    /// # Errors
    /// If a table cannot be written, [`Error::Io`] on every rank.
    pub fn create(
        plan: &Plan,
        folder: &Path,
        domain: &Domain,
        resumed_at: Option<u64>,
    ) -> Result<Self, Error> {
        let settings = plan.scene.ground_collapse.clone();
        let mut recorder = Self {
            interval: settings
                .as_ref()
                .map(|settings| plan.clock.every(settings.every)),
            first_grain: plan.scene.first_grain(),
            state: CollapseState::default(),
            tables: Tables::default(),
            messages: Vec::new(),
            settings,
        };
        let Some(settings) = &recorder.settings else {
            return Ok(recorder);
        };
        recorder.state.points = vec![OutflowCount::default(); settings.points.len()];
        let opened = if domain.rank() == 0 {
            let open = |name: &str, header: String| {
                Table::open(folder.join(name), &header, resumed_at).map(Some)
            };
            (|| {
                Ok(Tables {
                    rows: open("collapse.csv", CollapseRecord::header())?,
                    points: open("collapse_points.csv", PointRecord::header())?,
                    clusters: open("clusters.csv", ClusterRecord::header())?,
                    surface: open("surface.csv", SurfaceRecord::header())?,
                })
            })()
        } else {
            Ok(Tables::default())
        };
        recorder.tables = agree(domain.communicator(), opened)?;
        Ok(recorder)
    }

    /// Returns `true` if there is anything to measure; the measurement needs current ghosts.
    #[must_use]
    pub const fn measures(&self) -> bool {
        self.settings.is_some()
    }

    /// Records a step: the grains that left, and the state of the ground if a row is due. Call it after
    /// every step, and once at step 0 before the first.
    ///
    /// # Errors
    /// If a table cannot be written, [`Error::Io`] on every rank.
    pub fn record_due<S: Space>(
        &mut self,
        view: &StateView<'_, S>,
        removed: &[DepartedGrain],
    ) -> Result<(), Error> {
        let Some(settings) = &self.settings else {
            return Ok(());
        };
        for departed in removed {
            // A grain leaves through one point: the first that contains it.
            let through = settings.points.iter().position(|point| match point.region {
                Some(region) => region == departed.region,
                None => point.block.contains(departed.at),
            });
            if let Some(left) = through.and_then(|n| self.state.points.get_mut(n)) {
                left.grains += 1;
                // Grains are summed in the order of ids within a step, independently of ranks and
                // restarts.
                left.mass += departed.grain.mass;
            }
            self.state.left.push(departed.grain.id);
        }
        if self.state.start.is_none() {
            self.state.start = Some(self.measure_start(view));
        }
        let due = self.interval.is_some_and(|every| every.falls_on(view.step));
        if due && self.state.last_row != Some(view.step) {
            self.write_row(view)?;
        }
        Ok(())
    }

    /// Writes a row at the end of a run, unless there is one for this step. Afterwards [`Self::state`]
    /// must not be saved for a run that continues.
    ///
    /// # Errors
    /// If a table cannot be written, [`Error::Io`] on every rank.
    pub fn record_end<S: Space>(&mut self, view: &StateView<'_, S>) -> Result<(), Error> {
        if self.settings.is_none() {
            return Ok(());
        }
        if self.state.last_row != Some(view.step) {
            // A finished run that is resumed has already written these rows.
            self.drop_end(view.step, view.domain)?;
            self.write_row(view)?;
        }
        Ok(())
    }

    /// Drops the rows of `step` that were written only because a run ended at that step. Call it after
    /// [`Self::restore`] if the run continues.
    ///
    /// # Errors
    /// If a table cannot be written, [`Error::Io`] on every rank.
    pub fn drop_end(&mut self, step: u64, domain: &Domain) -> Result<(), Error> {
        if self.state.last_row == Some(step) {
            return Ok(());
        }
        let tables = &mut self.tables;
        let dropped = [
            &mut tables.rows,
            &mut tables.points,
            &mut tables.clusters,
            &mut tables.surface,
        ]
        .into_iter()
        .flatten()
        .try_for_each(|table| table.drop_from(step));
        agree(domain.communicator(), dropped)
    }

    /// Returns one line for each stage that began since the last call; on rank 0 only.
    pub fn take_events(&mut self) -> Vec<String> {
        std::mem::take(&mut self.messages)
    }

    /// Draws `collapse.svg` and `settlement.svg` from the tables. Call it at the end of a run.
    ///
    /// # Errors
    /// If a table cannot be read or a figure not written, [`Error::Io`] on every rank.
    pub fn draw(&self, folder: &Path, domain: &Domain) -> Result<(), Error> {
        if self.settings.is_none() {
            return Ok(());
        }
        let drawn = (|| {
            let Some(ground) = self.state.ground.as_ref().filter(|_| domain.rank() == 0) else {
                return Ok(());
            };
            let rows = read_rows(&folder.join("collapse.csv"), |row: &CollapseRecord| {
                row.step
            })?;
            let [long, across] = [0, 1].map(|axis| ground.cells.count[axis] as u64);
            let key = |row: &SurfaceRecord| (row.step * across + row.iy) * long + row.ix;
            let surface = read_rows(&folder.join("surface.csv"), key)?;
            for (name, figure) in [
                ("collapse.svg", figures::collapse(&rows, &self.times())),
                ("settlement.svg", figures::settlement(&surface)),
            ] {
                io::atomic::write(&folder.join(name), figure.to_svg().as_bytes())
                    .map_err(|error| Error::Io(error.to_string()))?;
            }
            Ok(())
        })();
        agree(domain.communicator(), drawn)
    }

    /// Returns the state for a checkpoint, equal on every rank; none if the case requests no such
    /// analysis. The tables are synchronised to disk before it returns.
    ///
    /// # Errors
    /// If a table cannot be written, [`Error::Io`] on every rank.
    pub fn state(&self, domain: &Domain) -> Result<Option<CollapseState>, Error> {
        if self.settings.is_none() {
            return Ok(None);
        }
        let tables = &self.tables;
        let synced = [
            &tables.rows,
            &tables.points,
            &tables.clusters,
            &tables.surface,
        ]
        .into_iter()
        .flatten()
        .try_for_each(Table::sync);
        agree(domain.communicator(), synced)?;
        let broken = |error: serde_json::Error| Error::Internal(error.to_string());
        // Rank 0 has the complete state.
        let mut bytes = serde_json::to_vec(&self.state).map_err(broken)?;
        domain.communicator().broadcast_bytes(0, &mut bytes);
        serde_json::from_slice(&bytes).map(Some).map_err(broken)
    }

    /// Restores the state returned by [`Self::state`].
    ///
    /// # Errors
    /// If the state is missing or does not fit the case, [`Error::Io`].
    pub fn restore(&mut self, state: Option<CollapseState>) -> Result<(), Error> {
        let Some(settings) = &self.settings else {
            return Ok(());
        };
        let Some(state) = state else {
            return Err(Error::Io(
                "the checkpoint does not contain the ground at time 0, because its run had no \
                 `analysis.ground_collapse`; remove `analysis.ground_collapse`, or start a new run"
                    .into(),
            ));
        };
        if state.points.len() != settings.points.len() {
            return Err(Error::Io(format!(
                "the checkpoint has {} seepage points, but the case has {}",
                state.points.len(),
                settings.points.len()
            )));
        }
        if let Some(ground) = &state.ground {
            let [x, y, z] = ground.cells.count;
            let columns = x.checked_mul(y);
            let good = columns.and_then(|n| n.checked_mul(z)) == Some(ground.solid.len())
                && columns == Some(ground.surface.len())
                && columns == Some(ground.skin.len())
                && ground.cells.size.iter().all(|h| *h > 0.0 && h.is_finite());
            if !good {
                return Err(Error::Io(
                    "the checkpoint cannot be used: the ground at time 0 does not fit its own cells".into(),
                ));
            }
        }
        self.state = state;
        Ok(())
    }

    /// Returns the value of the key `collapse` of `summary.json`, a [`CollapseSummary`]; none on ranks
    /// other than 0, and if the case requests no such analysis.
    ///
    /// # Errors
    /// If the summary cannot be written as JSON.
    pub fn summary(&self) -> Result<Option<Value>, Error> {
        let (Some(settings), Some(start), Some(ground)) =
            (&self.settings, &self.state.start, &self.state.ground)
        else {
            return Ok(None);
        };
        let points = settings.points.iter().zip(&self.state.points);
        let summary = CollapseSummary {
            stages: self.times(),
            points: points
                .map(|(point, left)| PointSummary {
                    name: point.name.clone(),
                    eroded_grains: left.grains,
                    eroded_mass: left.mass,
                })
                .collect(),
            initial_mass: start.mass,
            mean_diameter: start.diameter,
            cell: ground.cells.size,
        };
        serde_json::to_value(summary)
            .map(Some)
            .map_err(|error| Error::Internal(error.to_string()))
    }

    fn times(&self) -> StageTimes {
        let [hidden_hole, arch, sinkhole, extension] = self.state.stages.times;
        StageTimes {
            hidden_hole,
            arch,
            sinkhole,
            extension,
            arch_shape: self.state.stages.shapes[0],
            sinkhole_shape: self.state.stages.shapes[1],
        }
    }

    fn measure_start<S: Space>(&self, view: &StateView<'_, S>) -> Start {
        let (mut mass, mut diameter, mut grains) = (ExactSum::new(), ExactSum::new(), 0);
        let owned = &view.particles.body[..view.particles.owned()];
        for body in owned.iter().filter(|body| body.id >= self.first_grain) {
            mass.add(body.mass);
            diameter.add(2.0 * body.radius);
            grains += 1;
        }
        let communicator = view.domain.communicator();
        mass.all_reduce(communicator);
        diameter.all_reduce(communicator);
        let grains = communicator.all_reduce_sum_i64(grains).max(1);
        Start {
            mass: mass.value(),
            diameter: diameter.value() / real(grains),
        }
    }

    fn write_row<S: Space>(&mut self, view: &StateView<'_, S>) -> Result<(), Error> {
        let (Some(settings), Some(start)) = (self.settings.clone(), self.state.start) else {
            return Ok(());
        };
        self.state.last_row = Some(view.step);
        let loose = settings.loose_diameters * start.diameter;
        let gathered = gather(view, &settings, loose);
        // Only rank 0 detects a corrupt message.
        let written = gathered.and_then(|gathered| match gathered {
            Some(all) => self.analyse(view, &settings, start, &all.grains, &all.bonds),
            None => Ok(()),
        });
        self.state.left.clear();
        agree(view.domain.communicator(), written)
    }

    /// Measures the ground and writes the rows; on rank 0.
    fn analyse<S: Space>(
        &mut self,
        view: &StateView<'_, S>,
        settings: &GroundCollapse,
        start: Start,
        grains: &[MeasuredGrain],
        bonds: &[[u64; 2]],
    ) -> Result<(), Error> {
        let (step, time) = (view.step, view.time);
        let domain = view.plan.scene.grid.size;
        let ground = self.state.ground.get_or_insert_with(|| {
            let size = settings.cell_size.unwrap_or(2.0 * start.diameter);
            let cells = Cells::new(
                settings.axes.map(|axis| domain[axis]),
                settings.cells(domain, size),
            );
            InitialGround::new(cells, grains, start.diameter, sphere_box)
        });
        let limits = Limits {
            void_below: settings.void_below,
            moving: settings.stages.moving_diameters * start.diameter,
            settled: settings.stages.sinkhole_diameters * start.diameter,
            percentile: settings.settlement_percentile,
        };
        let points: Vec<Point> = settings
            .points
            .iter()
            .map(|p| in_frame(settings, domain, p))
            .collect();
        let seen = ground.measure(grains, &points, &limits, sphere_box);
        let thresholds = thresholds(settings, start, ground);
        let cells = ground.cells;
        let evidence = self.evidence(&seen, &thresholds);
        for stage in self.state.stages.note(time, &evidence, &thresholds) {
            let began = self.state.stages.times[stage].unwrap_or(time);
            self.messages.push(format!(
                "stage t{} ({}) began at {began:.6} s: {} grains lost through a seepage point, void {:.2e} m3, \
                 {:.0} % of the cover above a void moving (shape {:.2}), settlement {:.2e} m, depression {:.2e} \
                 m long",
                stage + 1,
                NAMES[stage],
                evidence.eroded_grains,
                evidence.void_volume,
                100.0 * evidence.front,
                evidence.shape,
                evidence.settlement,
                evidence.longest
            ));
        }
        let row = self.row(step, time, start, &seen);
        self.state.extension = Some([time, seen.depression.length]);
        append(&mut self.tables.rows, &(row.to_csv() + "\n"))?;
        let mut lines = String::new();
        for (n, (above, left)) in seen.points.iter().zip(&self.state.points).enumerate() {
            let row = PointRecord {
                step,
                time,
                point: n as u64,
                eroded_mass: left.mass,
                eroded_grains: left.grains,
                void_volume: above.void_volume,
                arch_height: above.arch_height,
                cover: above.cover,
                front: above.front,
                front_shape: above.front_shape,
            };
            lines += &(row.to_csv() + "\n");
        }
        append(&mut self.tables.points, &lines)?;
        let lines = surface_lines(step, time, &cells, &seen);
        append(&mut self.tables.surface, &lines)?;
        self.write_clusters(
            step,
            time,
            settings.loose_diameters * start.diameter,
            grains,
            bonds,
        )
    }

    fn write_clusters(
        &mut self,
        step: u64,
        time: f64,
        loose: f64,
        grains: &[MeasuredGrain],
        bonds: &[[u64; 2]],
    ) -> Result<(), Error> {
        let away = grains.iter().filter(|grain| norm(grain.moved) > loose);
        let ids: Vec<u64> = away.map(|grain| grain.id).collect();
        let groups = clusters(&ids, bonds);
        let left = sizes_of_left(&self.state.left, &self.state.blocks);
        let mut lines = String::new();
        for (kind, counts) in [
            (
                ClusterKind::Loose,
                histogram(groups.iter().map(|group| group.len() as u64)),
            ),
            (ClusterKind::Left, histogram(left)),
        ] {
            for (size, count) in counts {
                let row = ClusterRecord {
                    step,
                    time,
                    kind,
                    size,
                    count,
                };
                lines += &(row.to_csv() + "\n");
            }
        }
        self.state.blocks = groups.into_iter().filter(|group| group.len() > 1).collect();
        append(&mut self.tables.clusters, &lines)
    }

    fn evidence(&self, seen: &Sample, from: &Thresholds) -> Evidence {
        let farthest = |void: f64| {
            let over = (seen.points.iter()).filter(|above| above.void_volume >= void);
            over.max_by(|a, b| a.front.total_cmp(&b.front))
        };
        let arched = farthest(from.arch_void);
        let most =
            |value: fn(&PointMeasures) -> f64| seen.points.iter().map(value).fold(0.0, f64::max);
        Evidence {
            eroded_grains: self
                .state
                .points
                .iter()
                .map(|left| left.grains)
                .max()
                .unwrap_or(0),
            void_volume: most(|above| above.void_volume),
            front: arched.map_or(0.0, |above| above.front),
            shape: arched
                .or(farthest(0.0))
                .map_or(f64::NAN, |above| above.front_shape),
            settlement: seen.sinkhole,
            longest: seen.depression.longest,
            width: seen.depression.width,
            inward: seen.inward,
        }
    }

    fn row(&self, step: u64, time: f64, start: Start, seen: &Sample) -> CollapseRecord {
        let left = &self.state.points;
        let mass: f64 = left.iter().map(|left| left.mass).sum();
        let length = seen.depression.length;
        let highest = seen.points.iter().map(|above| above.arch_height);
        let farthest = seen
            .points
            .iter()
            .max_by(|a, b| a.front.total_cmp(&b.front));
        CollapseRecord {
            step,
            time,
            eroded_mass: mass,
            eroded_fraction: if start.mass > 0.0 {
                mass / start.mass
            } else {
                0.0
            },
            eroded_grains: left.iter().map(|left| left.grains).sum(),
            voids: seen.voids,
            void_volume: seen.void_volume,
            arch_height: highest.fold(0.0, f64::max),
            front: farthest.map_or(0.0, |above| above.front),
            front_shape: farthest.map_or(f64::NAN, |above| above.front_shape),
            settlement_max: seen.settlement_max,
            sinkhole: seen.sinkhole,
            settlement_middle: seen.settlement_middle,
            settlement_percentile: seen.settlement_percentile,
            extension: length,
            extension_rate: match self.state.extension {
                Some([before, old]) if time > before => (length - old) / (time - before),
                _ => 0.0,
            },
            inward: seen.inward,
            stages: self.state.stages.stages_begun() as u64,
        }
    }
}

fn thresholds(settings: &GroundCollapse, start: Start, ground: &InitialGround) -> Thresholds {
    let stages = &settings.stages;
    Thresholds {
        samples: stages.samples,
        eroded_grains: u64::from(stages.hole_grains),
        void_volume: stages.hole_volume.unwrap_or(ground.cells.volume()),
        front: stages.arch_reach,
        arch_void: stages.arch_void.unwrap_or(ground.cells.volume()),
        settlement: stages.sinkhole_diameters * start.diameter,
        extension: stages.extension_ratio,
        inward: stages.inward_diameters * start.diameter,
    }
}

/// Returns a row of `surface.csv` for every column that was ground at the start.
fn surface_lines(step: u64, time: f64, cells: &Cells, seen: &Sample) -> String {
    let mut lines = String::new();
    for across in 0..cells.count[1] {
        for long in 0..cells.count[0] {
            let k = cells.column(long, across);
            let Some(settlement) = seen.settlement[k] else {
                continue;
            };
            let row = SurfaceRecord {
                step,
                time,
                ix: long as u64,
                iy: across as u64,
                long: (real(long) + 0.5) * cells.size[0],
                across: (real(across) + 0.5) * cells.size[1],
                elevation: seen.surface[k].unwrap_or(f64::NAN),
                settlement,
            };
            lines += &(row.to_csv() + "\n");
        }
    }
    lines
}
