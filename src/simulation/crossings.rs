//! Regions that record the grains that enter and leave them: `crossings.csv` and the counts in `summary.json`.
//!
//! A grain is in a region if its centre is in the box; named bodies and blocks do not count. The state after a fluid
//! step is compared with that before it. Grains that are in a region when the run starts have not entered it. A grain
//! that another region generates in the box enters it, and one that is removed there leaves it, with its last position.
//!
//! Each rank compares its own grains. A grain that changed its rank is new on one and missing on the other; both are
//! the same grain after the exchange, which takes place in steps with a change only. Rows are in ascending order of
//! regions and ids, so that the table has the same bits on any number of ranks. The grains inside follow from the
//! positions, so that no checkpoint contains them.

use super::agreement::agree;
use super::removal::{boxed, rows};
use super::table::{Table, append};
use base::error::Error;
use decomposition::Domain;
use dem::particles::Particles;
use dem::space::{Components, Space};
use plan::Plan;
use plan::scene::aligned_box::AlignedBox;
use plan::scene::observe::RegionAction;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Name of the table.
pub const TABLE: &str = "crossings.csv";
/// Columns of the table.
const HEADER: &str = "step,time [s],region,event,id,mass [kg; 2-D kg/m],radius [m],x [m],y [m],z [m],u_x [m/s],\
                      u_y [m/s],u_z [m/s]";

/// Entries and exits of one region so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CrossingCount {
    /// Grains that entered.
    entered: u64,
    /// Mass of these grains [kg; in 2-D kg/m].
    entered_mass: f64,
    /// Grains that left.
    left: u64,
    /// Mass of these grains [kg; in 2-D kg/m].
    left_mass: f64,
}

/// Grain of a row: bits of mass, radius, position and velocity.
type Sighting = [u64; 8];
/// Region in the scene and id of a grain.
type Inside = (u64, u64);

/// Region that records entries and exits.
#[derive(Debug)]
struct RecordingRegion {
    /// Index in the scene.
    number: u64,
    name: String,
    block: AlignedBox,
}

/// Recorder of entries and exits: see the module. Methods with particles are collective.
#[derive(Debug)]
pub struct Crossings {
    first_grain: u64,
    regions: Vec<RecordingRegion>,
    /// Grains of this rank in the regions after the last step; none before the first.
    inside: Option<BTreeMap<Inside, Sighting>>,
    /// Counts of each region of the scene.
    counts: Vec<CrossingCount>,
    table: Option<Table>,
}

impl Crossings {
    /// Opens the table in `folder` on rank 0, cut back to step `resumed_at`, if a region records.
    ///
    /// # Errors
    /// If the table cannot be written, [`Error::Io`] on every rank.
    pub fn create(
        plan: &Plan,
        folder: &Path,
        domain: &Domain,
        resumed_at: Option<u64>,
    ) -> Result<Self, Error> {
        let all = (0..).zip(&plan.scene.regions);
        let regions: Vec<RecordingRegion> = all
            .filter(|(_, region)| matches!(region.action, RegionAction::Record))
            .map(|(number, region)| RecordingRegion {
                number,
                name: region.name.clone(),
                block: region.block,
            })
            .collect();
        let opened = (!regions.is_empty() && domain.rank() == 0)
            .then(|| Table::open(folder.join(TABLE), HEADER, resumed_at))
            .transpose();
        Ok(Self {
            first_grain: plan.scene.first_grain(),
            table: agree(domain.communicator(), opened)?,
            counts: vec![CrossingCount::default(); plan.scene.regions.len()],
            regions,
            inside: None,
        })
    }

    /// Returns the grains of this rank that are in a region.
    fn find_inside<S: Space>(
        &self,
        particles: &Particles<S>,
        plan: &Plan,
    ) -> BTreeMap<Inside, Sighting> {
        let mut found = BTreeMap::new();
        for k in 0..particles.owned() {
            let id = particles.body[k].id;
            if id < self.first_grain {
                continue;
            }
            let at = boxed(&particles.motion[k].position, &plan.scene.grid);
            for region in &self.regions {
                if region.block.contains(at) {
                    found.insert((region.number, id), sighting(particles, k, at));
                }
            }
        }
        found
    }

    /// Takes the grains that are in the regions before the first step of the run.
    pub fn begin<S: Space>(&mut self, particles: &Particles<S>, plan: &Plan) {
        if self.inside.is_none() && !self.regions.is_empty() {
            self.inside = Some(self.find_inside(particles, plan));
        }
    }

    /// Writes the entries and exits of the last step. Collective.
    ///
    /// # Errors
    /// If the table cannot be written, [`Error::Io`] on every rank.
    pub fn record<S: Space>(
        &mut self,
        particles: &Particles<S>,
        plan: &Plan,
        domain: &Domain,
        (step, time): (u64, f64),
    ) -> Result<(), Error> {
        let Some(before) = self.inside.take() else {
            return Ok(());
        };
        let now = self.find_inside(particles, plan);
        let communicator = domain.communicator();
        let pack = |of: &BTreeMap<Inside, Sighting>, other: &BTreeMap<Inside, Sighting>| {
            let changed = of.iter().filter(|(key, _)| !other.contains_key(*key));
            let words = changed.flat_map(|((region, id), seen)| {
                [*region, *id].into_iter().chain(seen.iter().copied())
            });
            words.flat_map(u64::to_le_bytes).collect::<Vec<u8>>()
        };
        let [came, went] = [pack(&now, &before), pack(&before, &now)];
        self.inside = Some(now);
        let changes = came.len().max(went.len()) as u64;
        if communicator.all_reduce_max_u64(changes) == 0 {
            return Ok(());
        }
        let gather = |bytes: &[u8]| -> Result<BTreeMap<Inside, Sighting>, Error> {
            let mut all = BTreeMap::new();
            for part in communicator.all_gather_bytes(bytes) {
                for [region, id, seen @ ..] in rows::<10>(&part)? {
                    all.insert((region, id), seen);
                }
            }
            Ok(all)
        };
        let (mut came, mut went) = (gather(&came)?, gather(&went)?);
        // Grains that changed their rank inside.
        came.retain(|key, _| went.remove(key).is_none());
        // Those that left are where their owners have them; removed grains are where they were.
        let gone: BTreeSet<u64> = went.keys().map(|(_, id)| *id).collect();
        let mut present = Vec::new();
        for k in 0..particles.owned() {
            if gone.contains(&particles.body[k].id) {
                let at = boxed(&particles.motion[k].position, &plan.scene.grid);
                let words = [0, particles.body[k].id].into_iter();
                let words = words.chain(sighting(particles, k, at));
                present.extend(words.flat_map(u64::to_le_bytes));
            }
        }
        let present = gather(&present)?;
        for ((_, id), seen) in &mut went {
            if let Some(later) = present.get(&(0, *id)) {
                *seen = *later;
            }
        }
        let lines = self.lines(&came, &went, (step, time));
        agree(communicator, append(&mut self.table, &lines))
    }

    /// Counts the entries and exits of a step and returns their rows.
    fn lines(
        &mut self,
        came: &BTreeMap<Inside, Sighting>,
        went: &BTreeMap<Inside, Sighting>,
        (step, time): (u64, f64),
    ) -> String {
        let mut lines = String::new();
        for RecordingRegion { number, name, .. } in &self.regions {
            for (event, seen) in [("in", came), ("out", went)] {
                for ((_, id), seen) in seen.range((*number, 0)..=(*number, u64::MAX)) {
                    let values = seen.map(f64::from_bits);
                    if let Some(count) = usize::try_from(*number)
                        .ok()
                        .and_then(|n| self.counts.get_mut(n))
                    {
                        // Masses are summed in the order of the rows, independently of ranks and restarts.
                        if event == "in" {
                            count.entered += 1;
                            count.entered_mass += values[0];
                        } else {
                            count.left += 1;
                            count.left_mass += values[0];
                        }
                    }
                    let values = values.map(|value| value.to_string()).join(",");
                    lines.push_str(&format!("{step},{time},{name},{event},{id},{values}\n"));
                }
            }
        }
        lines
    }

    /// Returns the counts for a checkpoint, after the table is synchronised to disk; the same on every rank.
    ///
    /// # Errors
    /// If the table cannot be written, [`Error::Io`] on every rank.
    pub fn state(&self, domain: &Domain) -> Result<Vec<CrossingCount>, Error> {
        let synced = self.table.as_ref().map_or(Ok(()), Table::sync);
        agree(domain.communicator(), synced)?;
        Ok(self.counts.clone())
    }

    /// Restores the counts of [`Self::state`]; `origins` has for each region of the scene the index of the same region
    /// in the saved run. A checkpoint without counts leaves them at 0.
    pub fn restore(&mut self, counts: &[CrossingCount], origins: Option<&[Option<usize>]>) {
        for (region, count) in self.counts.iter_mut().enumerate() {
            let origin = origins.map_or(Some(region), |all| all.get(region).copied().flatten());
            *count = origin
                .and_then(|old| counts.get(old).copied())
                .unwrap_or_default();
        }
    }

    /// Returns the counts of each region that records, by name; `None` without such a region.
    #[must_use]
    pub fn summary(&self) -> Option<Value> {
        let counts = self
            .regions
            .iter()
            .filter_map(|RecordingRegion { number, name, .. }| {
                let count = self.counts.get(usize::try_from(*number).ok()?)?;
                Some((name.clone(), json!(count)))
            });
        (!self.regions.is_empty()).then(|| Value::Object(counts.collect()))
    }
}

/// Returns the values of a row for owned grain `k` at a position in the box.
fn sighting<S: Space>(particles: &Particles<S>, k: usize, at: [f64; 3]) -> Sighting {
    let (body, velocity) = (&particles.body[k], &particles.motion[k].velocity);
    let speed = |axis: usize| {
        if axis < S::DIMENSION {
            velocity.get(axis)
        } else {
            0.0
        }
    };
    [
        body.mass,
        body.radius,
        at[0],
        at[1],
        at[2],
        speed(0),
        speed(1),
        speed(2),
    ]
    .map(f64::to_bits)
}
