//! Records of the erosion in a piping run: `removed.csv`, `bonds.csv` and `erosion.csv`.
//!
//! Removed grains and broken bonds are recorded after every fluid step. Every `erosion_law.every` seconds the state of
//! the hole is written as one row. Let x be the axis of the flow, y the axis across the hole and L, d_h its length and
//! width:
//!
//! - **Profiles.** V_x(y) and the solid fraction s(y) are means over the length of the hole box, with zero velocity in
//!   solid cells. [`hole_faces`] finds the faces in s(y), relative to the mean of s outside the hole at the first row.
//! - **Gradient.** [`analysis::erosion_law::shear_by_gradient`] of V_x(y) at those faces, times the dynamic
//!   viscosity.
//! - **Balance.** dP d_h / (2 L) with dP the difference of the *imposed* pressures at this time, ramp included, as in
//!   hole erosion tests. Losses in the chambers make it an upper bound.
//! - **Traction.** The force of the water on the grains of the faces, from the momentum exchange with each grain, and
//!   therefore independent of the other two. A grain of volume V inside a packing of solid fraction phi carries in any
//!   case the seepage force G V / phi, with G the pressure drop over L, because there the grains carry the whole
//!   pressure drop. The additional force on the grains behind a face is the traction of the flow in the hole: `tau =
//!   sum_k (F_k - G V_k / phi) / (2 L)`. The sum is over grains with their centre within [`DEPTH_BEHIND`] mean
//!   diameters behind a face or `hole::DISTANCE_BEFORE` in front of it. The shear stress decays within less than a
//!   diameter, so that a deeper layer adds only noise. G is the difference of the mean pressures of the water at the
//!   two ends of that layer, in the planes of cells just outside the hole box; phi is measured once, from the grains
//!   next to the hole at the first row.
//! - **Bonds.** A bond breaks at the wall of the hole if its contact point lies between the faces of the last row or
//!   within [`NEAR_WALL`] mean diameters of one, and not further than that beyond the ends of the hole; otherwise
//!   inside. Before the first row the faces are those of the box in the case. Bonds that broke in the relaxation before
//!   the run have rows at step 0, but do not count as broken by the erosion.
//!
//! - **Mechanism.** Erosion grain by grain at the faces, or failure of the bulk: [`mechanism`].
//!
//! All sums over cells and grains are exact, so that the rows have the same bits on any number of ranks. In 2-D masses
//! are kg/m; in 3-D they are kg, and velocities, forces and discharge are per depth of the hole box.
//!
//! Rank 0 writes. Rows are appended. A resumed run first truncates the tables to its checkpoint, so that they equal
//! those of an uninterrupted run.

mod hole;
mod imposed;
mod mechanism;

use super::agreement::agree;
use super::removal::{DepartedGrain, boxed, rows};
use super::table::{Table, append};
use super::view::StateView;
use ::preparation::rest::EarlyBreak;
use analysis::erosion_law::{
    BondBreak as BreakRow, BreakMode, BreakPlace, ErosionRecord, ErosionSummary, HoleFaces,
    RecordRow, RemovedGrain, hole_faces, shear_by_balance, shear_by_traction,
};
use base::error::Error;
use base::number::real;
use decomposition::{Domain, ExactSum};
use dem::space::{Components, Space};
use dem::{BondBreak, Failure};
use hole::{DEPTH_BEHIND, Hole, Sums, cell_sums, excess_force, profile};
use imposed::{cohesion_per_diameter, pressure_difference, pressures, spread};
use mechanism::{Mechanism, bulk_displacement, contacts_per_grain};
use plan::Plan;
use plan::interval::Interval;
use plan::scene::observe::RegionAction;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Maximum distance of a bond from a face, in mean grain diameters, at which it counts as broken at the
/// wall of the hole.
const NEAR_WALL: f64 = 2.0;

/// Quantities measured once, at the first call, while the sample is whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Start {
    /// Initial mass M_0 of all grains [kg/m].
    mass: f64,
    /// Mean diameter of the grains \[m\].
    diameter: f64,
    /// Solid fraction of the grains next to the hole, from the radii of the grains.
    packing: f64,
    /// Mean numbers of contacts and bonds per grain.
    #[serde(default)]
    contacts: Option<[f64; 2]>,
}

/// State of the recorder in a checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErosionState {
    start: Option<Start>,
    /// Solid fraction next to the hole in the cells of the lattice, at the first row.
    intact: Option<f64>,
    /// Positions of the two faces of the hole at the last row \[m\].
    faces: Option<[f64; 2]>,
    eroded_mass: f64,
    eroded_grains: u64,
    bonds_inside: u64,
    bonds_at_wall: u64,
    /// Time for which the fluid had run before time 0 \[s\].
    flow_age: f64,
    last_row: Option<u64>,
    #[serde(default)]
    mechanism: Mechanism,
}

/// Broken bond that is yet to be sent to rank 0.
#[derive(Clone, Copy, Debug)]
struct PendingBreak {
    step: u64,
    time: f64,
    solid_step: u64,
    id_a: u64,
    id_b: u64,
    x: f64,
    y: f64,
    shear: bool,
    at_wall: bool,
    /// `true` if the bond broke before the run began: it does not count as eroded.
    early: bool,
}

/// Writes the tables of an erosion run: see the module. Methods with a view or a domain are collective.
#[derive(Debug)]
pub struct ErosionRecorder {
    law: Option<Hole>,
    interval: Option<Interval>,
    first_grain: u64,
    state: ErosionState,
    /// Bonds broken on this rank since the last flush.
    pending: Vec<PendingBreak>,
    removed: Option<Table>,
    bonds: Option<Table>,
    rows: Option<Table>,
    /// Largest speed over C in the last row; none after [`Self::take_speed`].
    speed: Option<f64>,
}

impl ErosionRecorder {
    /// Opens the tables in `folder` on rank 0: new ones, or those of a run resumed at step `resumed_at` cut back to
    /// that step. `removed.csv` is written where a region removes grains, `bonds.csv` where bonds can break,
    /// `erosion.csv` where the case asks for the erosion law.
    ///
    /// # Errors
    /// If a table cannot be written, [`Error::Io`] on every rank.
    pub fn create(
        plan: &Plan,
        folder: &Path,
        domain: &Domain,
        resumed_at: Option<u64>,
    ) -> Result<Self, Error> {
        let scene = &plan.scene;
        let writer = domain.rank() == 0;
        let open = |wanted: bool, name: &str, header: String| -> Result<Option<Table>, Error> {
            (wanted && writer)
                .then(|| Table::open(folder.join(name), &header, resumed_at))
                .transpose()
        };
        let removes = scene
            .regions
            .iter()
            .any(|region| matches!(region.action, RegionAction::Remove { .. }));
        let bonded = scene.contact.as_ref().is_some_and(|c| c.model().bonds());
        let opened = (|| {
            Ok::<_, Error>((
                open(removes, "removed.csv", RemovedGrain::header())?,
                open(bonded, "bonds.csv", BreakRow::header())?,
                open(
                    scene.erosion_law.is_some(),
                    "erosion.csv",
                    ErosionRecord::header(),
                )?,
            ))
        })();
        let (removed, bonds, rows) = agree(domain.communicator(), opened)?;
        Ok(Self {
            speed: None,
            law: scene.erosion_law.as_ref().map(|law| Hole::new(law, plan)),
            interval: scene
                .erosion_law
                .as_ref()
                .map(|law| plan.clock.every(law.every)),
            first_grain: scene.first_grain(),
            state: ErosionState::default(),
            pending: Vec::new(),
            removed,
            bonds,
            rows,
        })
    }

    /// Sets the time \[s\] for which the fluid had run when the clock started: pressure ramps count
    /// from the start of the fluid. Call it once at the end of the warm-up; the time is part of the
    /// state.
    pub fn set_flow_age(&mut self, seconds: f64) {
        self.state.flow_age = seconds;
    }

    /// Returns the fraction of the initial mass of the grains that left through the outlets.
    #[must_use]
    pub fn eroded_fraction(&self) -> f64 {
        match self.state.start {
            Some(start) if start.mass > 0.0 => self.state.eroded_mass / start.mass,
            _ => 0.0,
        }
    }

    /// Returns the numbers of bonds broken inside and at the wall of the hole, as of the last flush.
    fn broken(&self) -> [u64; 2] {
        [self.state.bonds_inside, self.state.bonds_at_wall]
    }

    /// Returns `true` if a row of `erosion.csv` is due at this step.
    #[must_use]
    pub fn is_due(&self, step: u64) -> bool {
        self.interval.is_some_and(|every| every.falls_on(step))
    }

    /// Returns `true` if there may be anything to measure; the measurement needs current ghosts.
    #[must_use]
    pub const fn measures(&self) -> bool {
        self.law.is_some() || self.interval.is_some()
    }

    /// Records a fluid step: the grains that left, the bonds that broke on this rank, and the state of
    /// the hole if a row is due. Call it after every fluid step, and once at step 0 before the first,
    /// so that M_0 and the intact packing are those of the whole sample. `mass_error` is the fluid mass
    /// over the expected mass, minus one; NaN before it is first measured. It is read only if
    /// [`Self::is_due`] returns `true`.
    ///
    /// # Errors
    /// If a table cannot be written, [`Error::Io`] on every rank.
    pub fn record_due<S: Space>(
        &mut self,
        view: &StateView<'_, S>,
        removed: &[DepartedGrain],
        breaks: Vec<BondBreak<S>>,
        mass_error: f64,
    ) -> Result<(), Error> {
        if self.state.start.is_none() {
            self.state.start = Some(self.measure_start(view, removed));
        }
        self.note_breaks(view, breaks);
        if !removed.is_empty() {
            let outlets = view.plan.scene.erosion_law.as_ref();
            let mut lines = String::new();
            for departed in removed {
                if outlets.is_some_and(|law| law.outlets.contains(&departed.region)) {
                    self.state.eroded_grains += 1;
                    // Masses are summed in the order of the rows, independently of ranks and restarts.
                    self.state.eroded_mass += departed.grain.mass;
                }
                lines.push_str(&departed.grain.to_csv());
                lines.push('\n');
            }
            agree(
                view.domain.communicator(),
                append(&mut self.removed, &lines),
            )?;
        }
        if self.state.mechanism.is_due(self.eroded_fraction()) {
            self.flush(view.domain)?;
            self.state.mechanism.note_bonds(self.broken());
        }
        if self.is_due(view.step) && self.state.last_row != Some(view.step) {
            self.flush(view.domain)?;
            self.write_row(view, mass_error)?;
        }
        Ok(())
    }

    /// Records the bonds that broke on this rank.
    pub fn note_breaks<S: Space>(&mut self, view: &StateView<'_, S>, breaks: Vec<BondBreak<S>>) {
        for broken in breaks {
            let at_wall = self.at_wall(&broken.position, view.plan);
            self.pending.push(PendingBreak {
                step: view.step,
                time: view.time,
                solid_step: broken.step,
                id_a: broken.grain,
                id_b: match (broken.other, broken.wall) {
                    (Some(other), _) => other,
                    (None, wall) => u64::MAX - wall.map_or(0, u64::from),
                },
                x: broken.position.get(0),
                y: broken.position.get(1),
                shear: broken.mode == Failure::Shear,
                at_wall,
                early: false,
            });
        }
    }

    /// Records the bonds that broke before the run began, with the step and time 0. They do not count as eroded.
    pub fn note_early_breaks<S: Space>(&mut self, view: &StateView<'_, S>, breaks: &[EarlyBreak]) {
        if view.domain.rank() > 0 {
            return;
        }
        for broken in breaks {
            let [x, y] = broken.position.map(f64::from_bits);
            let mut position = S::Vector::default();
            position.set(0, x);
            position.set(1, y);
            self.pending.push(PendingBreak {
                step: 0,
                time: 0.0,
                solid_step: broken.solid_step,
                id_a: broken.ids[0],
                id_b: broken.ids[1],
                x,
                y,
                shear: broken.shear,
                at_wall: self.at_wall(&position, view.plan),
                early: true,
            });
        }
    }

    /// Writes the remaining rows at the end of a run: bonds broken since the last row, and a row unless
    /// there is one for this step. Afterwards [`Self::state`] must not be saved for a run that
    /// continues.
    ///
    /// # Errors
    /// If a table cannot be written, [`Error::Io`] on every rank.
    pub fn record_end<S: Space>(
        &mut self,
        view: &StateView<'_, S>,
        mass_error: f64,
    ) -> Result<(), Error> {
        self.flush(view.domain)?;
        if self.state.last_row != Some(view.step) {
            // A finished run that is resumed has already written this row.
            self.drop_end(view.step, view.domain)?;
            self.write_row(view, mass_error)?;
        }
        Ok(())
    }

    /// Drops a row of `step` that was written only because a run ended at that step. Call it after
    /// [`Self::restore`] if the run continues.
    ///
    /// # Errors
    /// If the table cannot be written, [`Error::Io`] on every rank.
    pub fn drop_end(&mut self, step: u64, domain: &Domain) -> Result<(), Error> {
        if self.state.last_row == Some(step) {
            return Ok(());
        }
        let rows = self.rows.as_mut();
        agree(
            domain.communicator(),
            rows.map_or(Ok(()), |rows| rows.drop_from(step)),
        )
    }

    /// Writes the bonds that broke since the last row; call it before [`Self::state`] and before every
    /// row.
    ///
    /// # Errors
    /// If the table cannot be written, [`Error::Io`] on every rank.
    pub fn flush(&mut self, domain: &Domain) -> Result<(), Error> {
        let communicator = domain.communicator();
        if communicator.all_reduce_max_u64(self.pending.len() as u64) == 0 {
            return Ok(());
        }
        let mut bytes = Vec::new();
        for p in self.pending.drain(..) {
            let fields = [
                p.step,
                p.time.to_bits(),
                p.solid_step,
                p.id_a,
                p.id_b,
                p.x.to_bits(),
                p.y.to_bits(),
                u64::from(p.shear) + 2 * u64::from(p.at_wall) + 4 * u64::from(p.early),
            ];
            bytes.extend(fields.iter().flat_map(|field| field.to_le_bytes()));
        }
        let mut all = Vec::new();
        for bytes in communicator.all_gather_bytes(&bytes) {
            all.extend(rows::<8>(&bytes)?);
        }
        all.sort_unstable_by_key(|&[step, _, solid_step, id_a, id_b, ..]| {
            (step, solid_step, id_a, id_b)
        });
        let mut lines = String::new();
        for [step, time, _, id_a, id_b, x, y, kind] in all {
            let at_wall = kind & 2 != 0;
            let early = kind & 4 != 0;
            if at_wall && !early {
                self.state.bonds_at_wall += 1;
            } else if !early {
                self.state.bonds_inside += 1;
            }
            let row = BreakRow {
                step,
                time: f64::from_bits(time),
                id_a,
                id_b,
                x: f64::from_bits(x),
                y: f64::from_bits(y),
                mode: if kind & 1 != 0 {
                    BreakMode::Shear
                } else {
                    BreakMode::Tension
                },
                place: if at_wall {
                    BreakPlace::HoleWall
                } else {
                    BreakPlace::Inside
                },
            };
            lines.push_str(&row.to_csv());
            lines.push('\n');
        }
        agree(domain.communicator(), append(&mut self.bonds, &lines))
    }

    /// Returns the state for a checkpoint, equal on every rank. The tables are synchronised to disk
    /// before it returns.
    ///
    /// # Errors
    /// If a table cannot be written, [`Error::Io`] on every rank.
    pub fn state(&mut self, domain: &Domain) -> Result<ErosionState, Error> {
        self.flush(domain)?;
        let synced = [&self.removed, &self.bonds, &self.rows]
            .into_iter()
            .flatten()
            .try_for_each(Table::sync);
        agree(domain.communicator(), synced)?;
        Ok(self.state.clone())
    }

    /// Restores the state returned by [`Self::state`].
    pub fn restore(&mut self, state: ErosionState) {
        self.state = state;
    }

    /// Returns the value of the key `erosion` of `summary.json`, an [`ErosionSummary`]; none if the
    /// case requests no erosion law or nothing has been recorded yet.
    ///
    /// # Errors
    /// If the summary cannot be written as JSON.
    pub fn summary(&self, plan: &Plan) -> Result<Option<Value>, Error> {
        let (Some(hole), Some(start)) = (&self.law, &self.state.start) else {
            return Ok(None);
        };
        let ramp = pressures(plan).fold(0.0, |end: f64, history| end.max(history.end()));
        let summary = ErosionSummary {
            cohesion: cohesion_per_diameter(plan, start.diameter),
            pressure_difference: spread(
                pressures(plan).map(|history| history.value(f64::INFINITY)),
            ),
            ramp_end: (ramp - self.state.flow_age).max(0.0),
            initial_mass: start.mass,
            eroded_mass: self.state.eroded_mass,
            hole_width: hole.width(),
            hole_length: hole.length(),
            contacts_per_grain: start.contacts.map(|[contacts, _]| contacts),
            bonds_per_grain: start.contacts.map(|[_, bonds]| bonds),
            face_share: self.state.mechanism.face_share(self.broken()),
            bulk_displacement: self.state.mechanism.displacement(),
        };
        serde_json::to_value(summary)
            .map(Some)
            .map_err(|error| Error::Internal(error.to_string()))
    }

    fn measure_start<S: Space>(&self, view: &StateView<'_, S>, removed: &[DepartedGrain]) -> Start {
        let grid = &view.plan.scene.grid;
        let (mut mass, mut diameter, mut beside) =
            (ExactSum::new(), ExactSum::new(), ExactSum::new());
        let mut grains = 0;
        for (k, body) in view.particles.body[..view.particles.owned()]
            .iter()
            .enumerate()
            .filter(|(_, body)| body.id >= self.first_grain)
        {
            grains += 1;
            mass.add(body.mass);
            diameter.add(2.0 * body.radius);
            let at = boxed(&view.particles.motion[k].position, grid);
            if self.law.is_some_and(|hole| {
                hole.spans(hole.along, at[hole.along], grid.dimension)
                    && hole.spans(hole.third(), at[hole.third()], grid.dimension)
                    && !hole.spans(hole.across, at[hole.across], grid.dimension)
            }) {
                beside.add(S::measure(body.radius));
            }
        }
        let communicator = view.domain.communicator();
        for sum in [&mut mass, &mut diameter, &mut beside] {
            sum.all_reduce(communicator);
        }
        grains = communicator.all_reduce_sum_u64(grains);
        // Grains that left in the very first step belonged to the sample.
        for departed in removed {
            mass.add(departed.grain.mass);
            diameter.add(2.0 * departed.grain.radius);
            grains += 1;
        }
        let area = self.law.map_or(1.0, |hole| {
            hole.length() * hole.depth * (grid.size[hole.across] - hole.width())
        });
        Start {
            mass: mass.value(),
            diameter: if grains == 0 {
                0.0
            } else {
                diameter.value() / real(grains)
            },
            packing: if area > 0.0 {
                beside.value() / area
            } else {
                0.0
            },
            contacts: contacts_per_grain(view, self.first_grain, grains),
        }
    }

    /// Returns the faces of the hole at the last row, or those of the case before the first row.
    fn present_faces(&self, hole: &Hole) -> HoleFaces {
        let [lower, upper] = self
            .state
            .faces
            .unwrap_or([hole.from[hole.across], hole.to[hole.across]]);
        HoleFaces { lower, upper }
    }

    fn at_wall<V: Components>(&self, position: &V, plan: &Plan) -> bool {
        let (Some(hole), Some(start)) = (&self.law, &self.state.start) else {
            return false;
        };
        let at = boxed(position, &plan.scene.grid);
        let near = NEAR_WALL * start.diameter;
        let faces = self.present_faces(hole);
        (faces.lower - near..=faces.upper + near).contains(&at[hole.across])
            && (hole.from[hole.along] - near..=hole.to[hole.along] + near).contains(&at[hole.along])
    }

    /// Returns the largest speed over C in a row written since the last call.
    pub fn take_speed(&mut self) -> Option<f64> {
        self.speed.take()
    }

    /// Writes the state of the hole as a row. Collective.
    fn write_row<S: Space>(
        &mut self,
        view: &StateView<'_, S>,
        mass_error: f64,
    ) -> Result<(), Error> {
        let (Some(hole), Some(start)) = (self.law, self.state.start) else {
            return Ok(());
        };
        let (Some(flow), Some(units)) = (&view.plan.scene.flow, &view.plan.units) else {
            return Ok(());
        };
        let sums = cell_sums(view, &hole);
        let faces = self.find_faces(&sums, &hole, units.spacing);
        let of_faces = |measure: &dyn Fn(HoleFaces) -> f64| faces.map_or(f64::NAN, measure);
        let pressure_difference = pressure_difference(view.plan, view.time + self.state.flow_age);
        let length = hole.length();
        let viscosity = flow.density * flow.kinematic_viscosity;
        let gradient = of_faces(&|faces| sums.shear(units, faces, viscosity));
        let traction = of_faces(&|faces| {
            let ends = sums.end_pressures(units, faces, DEPTH_BEHIND * start.diameter);
            let gradient = (ends[0] - ends[1]) / length;
            shear_by_traction(excess_force(view, &hole, &start, faces, gradient), length)
        });
        let depth = (view.plan.scene.grid.dimension == 3).then_some(hole.depth);
        let discharge = of_faces(&|faces| sums.discharge(units, faces, depth));
        let width = of_faces(&|faces| faces.width());
        let displacement = of_faces(&|faces| bulk_displacement(view, &hole, start.diameter, faces));
        self.state.mechanism.note_displacement(displacement);
        let share = self.state.mechanism.face_share(self.broken());
        let row = ErosionRecord {
            step: view.step,
            time: view.time,
            eroded_mass: self.state.eroded_mass,
            eroded_fraction: self.state.eroded_mass / start.mass,
            eroded_grains: self.state.eroded_grains,
            lower_face: of_faces(&|faces| faces.lower),
            upper_face: of_faces(&|faces| faces.upper),
            hole_width: width,
            hole_length: length,
            shear_gradient: gradient,
            shear_balance: shear_by_balance(pressure_difference, width, length),
            shear_traction: traction,
            pressure_difference,
            discharge,
            bonds_broken: self.state.bonds_inside + self.state.bonds_at_wall,
            bonds_broken_inside: self.state.bonds_inside,
            bonds_broken_at_wall: self.state.bonds_at_wall,
            lattice_velocity: sums.speed,
            mass_error,
            face_share: share.unwrap_or(f64::NAN),
            bulk_displacement: displacement,
        };
        self.state.last_row = Some(view.step);
        self.speed = Some(sums.speed);
        agree(
            view.domain.communicator(),
            append(&mut self.rows, &(row.to_csv() + "\n")),
        )
    }

    /// Finds the faces of the hole and stores them; at the first row also the solid fraction next to
    /// the hole.
    fn find_faces(&mut self, sums: &Sums, hole: &Hole, spacing: f64) -> Option<HoleFaces> {
        let intact = *(self.state.intact).get_or_insert_with(|| sums.solid_fraction_around(hole));
        let solid = sums.solid_fractions();
        let faces = hole_faces(profile(spacing, &solid), intact, hole.middle());
        self.state.faces = faces.map(|faces| [faces.lower, faces.upper]);
        faces
    }
}

#[cfg(test)]
mod tests;
