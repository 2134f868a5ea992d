//! Imposed pressure with zero tangential velocity: free slip with the sign of anti-bounce-back.
//!
//! f_j(x, t+1) = -f*_i(x - t) + 2 w_i ρ_w (1 + 3 u_n²), with i and t as for free slip ([`super::free_slip`]): the
//! population that crosses the face at the point where f_j enters, with the same component along the face.
//!
//! Two links cross the face at one point. Their half sum carries the pressure and is returned by anti-bounce-back
//! (Ginzburg, Verhaeghe and d'Humières 2008), so that the pressure holds half-way across the face; the half
//! difference carries the tangential velocity and is returned by bounce-back (Ladd 1994), so that this velocity is
//! zero there. Together they are the rule above. Anti-bounce-back of each single link would also reverse the shear
//! stress in the half difference: flow between plates would then lose pressure where it enters and leaves, whatever
//! the resolution. With zero velocity along the face the half sum contains no viscous stress, and the rule is of
//! second order. The normal velocity of the cell u_n enters only squared. The rule needs no special corner nodes,
//! in two or three dimensions.

use super::convective_outflow::{self, Carried};
use super::links::{LINKS_PER_THREAD, each_part, sums};
use super::profile::ReadTable;
use super::sound::{Forecast, PlaneWave, forecast};
use super::{
    BoundaryKind, BoundaryModel, Crossing, FaceLink, Giver, ImposedPressure, Mirror, Opening,
    Place, Rule, RuleStep, Site, Sound, Strength, Sums, SurfaceKind, quanta,
};
use crate::lanes::Stored;
use crate::populations::Populations;
use base::error::{Error, Report};
use base::geometry::Vector;
use base::history::{self, TimeTable};
use base::number::real;
use base::thread_pool;
use base::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Imposed pressure, with zero tangential velocity: anti-bounce-back for the pressure (Ginzburg, Verhaeghe and
/// d'Humières 2008), bounce-back for the velocity along the face (Ladd 1994).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Pressure {
    /// Pressure above the reference \[Pa\].
    pub value: f64,
    /// Linear change to `value`. Default: the pressure acts at once, which causes a pressure wave.
    #[serde(default)]
    pub ramp: Option<Change>,
    /// Table of times \[s\], counted from the first fluid step, warm-up included, and pressures \[Pa\] that replace
    /// `value` and `ramp`: linear between the rows, constant before and after; two pressures at one time are a jump.
    /// Default: none.
    #[serde(default)]
    pub history: Option<Vec<[f64; 2]>>,
    /// Behaviour of the opening for sound. `absorb` lets plane waves out; `value` is then imposed as a mean over
    /// several transit times of sound through the domain, and exactly once the flow is steady. `reflect` keeps `value`
    /// at every step. Default: `absorb` if all other openings impose velocities, otherwise `reflect`.
    #[serde(default)]
    pub sound: Option<Sound>,
    /// Extent over which the pressure is imposed. `mean`: as the mean over the face; eddies leave, and the pressure
    /// varies over the face. `each_cell`: in each cell, without velocity along the face. Default: `mean` with an eddy
    /// viscosity, or if all other openings impose velocities and no body moves; otherwise `each_cell`.
    #[serde(default)]
    pub held: Option<Held>,
    /// Gradient of the pressure over the face [Pa/m], without a component normal to it; `value` is then the pressure in
    /// the middle of the opening, and the pressure is imposed in each cell. Water at rest under the gravity g has the
    /// gradient ρ g. Default: none; with `mean` the flow determines the gradient.
    #[serde(default)]
    pub gradient: Option<Vector>,
}

/// Extent over which a pressure is imposed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Held {
    /// Imposed in each cell.
    EachCell,
    /// Imposed as the mean over the face.
    Mean,
}

/// Linear change in time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Ramp")]
pub struct Change {
    /// Duration of the change \[s\], counted from the first fluid step, warm-up included.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub duration: f64,
    /// Initial pressure \[Pa\].
    #[serde(default)]
    pub from: f64,
}

const KIND: BoundaryKind = BoundaryKind {
    surface: SurfaceKind::Opening,
    strength: Strength::Pressure,
};

impl Pressure {
    /// Returns `true` if this is the only opening in addition to imposed velocities.
    fn is_the_outlet(openings: &[Opening]) -> bool {
        let imposing = |strength| {
            let alike = openings.iter().filter(|o| o.strength == strength);
            alike.count()
        };
        let (pressures, velocities) = (imposing(Strength::Pressure), imposing(Strength::Velocity));
        pressures == 1 && velocities > 0 && openings.len() == pressures + velocities
    }

    /// Returns the behaviour for sound, given the openings of the domain. Between two imposed pressures an
    /// absorbing opening would add an inertia of ρL/σ to that of the water; with imposed velocities elsewhere the
    /// flow is not affected.
    fn sound(&self, openings: &[Opening]) -> Sound {
        self.sound.unwrap_or(if Self::is_the_outlet(openings) {
            Sound::Absorb
        } else {
            Sound::Reflect
        })
    }

    /// Returns the extent over which the pressure is imposed, given the openings of the domain.
    fn held(&self, openings: &[Opening]) -> Held {
        self.held.unwrap_or(
            if Self::is_the_outlet(openings) && self.gradient.is_none() {
                Held::Mean
            } else {
                Held::EachCell
            },
        )
    }

    fn imposed(&self) -> ImposedPressure {
        let ramp = self.ramp.as_ref();
        let ramp = ramp.map(|ramp| [[0.0, ramp.from], [ramp.duration, self.value]]);
        let history = ramp.as_ref().map(|ramp| ramp.as_slice());
        let history = self.history.as_deref().or(history);
        ImposedPressure {
            field: if self.history.is_some() {
                "history"
            } else {
                "value"
            },
            history: TimeTable::new(history, self.value),
        }
    }
}

impl BoundaryModel for Pressure {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn resolve(&mut self, site: &Site<'_>, _: ReadTable<'_>, report: &mut dyn Report) {
        if let Some(table) = &self.history {
            let path = format!("{}.history", site.path);
            history::check(table, &path, report);
            if self.ramp.is_some() {
                report.error(
                    &path,
                    "the table replaces the ramp, and both are stated".into(),
                    "remove the ramp, and begin the table with it".into(),
                );
            }
        }
        let Some(gradient) = &self.gradient else {
            return;
        };
        let path = format!("{}.gradient", site.path);
        let along = gradient.resolve(site.dimension, &path, report);
        if along[site.face.axis()] != 0.0 {
            report.error(
                &path,
                "the pressure gradient on a face cannot have a component normal to the face".into(),
                "set that component to 0".into(),
            );
        }
        if self.held == Some(Held::Mean) {
            report.error(
                &path,
                "with a pressure that is imposed as a mean, the flow determines the gradient, and it cannot be \
                 prescribed"
                    .into(),
                "remove the gradient, or write \"held\": \"each_cell\"".into(),
            );
        }
    }

    fn pressure(&self) -> Option<ImposedPressure> {
        Some(self.imposed())
    }

    fn rule<S: Stored>(
        &self,
        place: &Place<'_>,
        units: &LatticeUnits,
    ) -> Result<Box<dyn Rule<S>>, Error> {
        let imposed = self.imposed();
        let density = imposed.history.scaled(
            |time| units.time_to_lattice(time),
            |pressure| units.pressure_to_density_deviation(pressure),
        );
        let face = place.site.face;
        let axis = face.axis();
        let absorbs = self.sound(place.openings) == Sound::Absorb;
        let length = real(place.site.cells[axis]);
        if self.held(place.openings) == Held::Mean {
            let (wave, forecast) = if absorbs {
                (PlaneWave::at_pressure(length), forecast(place, units))
            } else {
                (PlaneWave::reflected(), None)
            };
            let links = convective_outflow::ConvectiveOutflowLinks::new(
                (axis, face.is_max()),
                Carried::Local,
            )
            .evening(place.bodies_move);
            return Ok(Box::new(
                links.with_kind(KIND).holding(wave, density, forecast),
            ));
        }
        let mut links = PressureLinks::new(axis, density);
        if let Some(gradient) = &self.gradient {
            let per_cell = gradient
                .to_array()
                .map(|g| units.pressure_to_density_deviation(g * units.spacing));
            links = links.inclined(place.ends.map(|[low, high]| 0.5 * (low + high)), per_cell);
        }
        if absorbs {
            links = links.absorbing(PlaneWave::at_pressure(length), forecast(place, units));
        }
        Ok(Box::new(links))
    }
}

/// Minimum number of cells per thread.
const CELLS_PER_THREAD: usize = 128;

/// Cell at the face with its links.
#[derive(Clone, Copy, Debug)]
struct PressureCell {
    cell: usize,
    first: usize,
    count: usize,
    /// Density deviation relative to that in the middle of the opening.
    beyond: f64,
}

/// Positions of the populations of a link with a returned population, and weight w_i.
#[derive(Clone, Copy, Debug)]
struct Returned {
    mirror: Mirror,
    weight: f64,
}

/// Links of a patch with imposed pressure.
pub struct PressureLinks {
    /// Axis normal to the face.
    axis: usize,
    /// Density deviation δρ_w = 3 p, with p the pressure above the reference in lattice units.
    density: TimeTable,
    /// Middle of the opening in cells, and gradient of the density deviation per cell.
    incline: [[f64; 3]; 2],
    cells: Vec<PressureCell>,
    links: Vec<FaceLink>,
    /// Data of the links.
    returned: Vec<Returned>,
    /// Buffer for the populations that enter through the links in a step.
    entering: Vec<f64>,
    /// Plane wave for absorption of sound, with the predicted velocity.
    sound: Option<(PlaneWave, Option<Forecast>)>,
}

impl PressureLinks {
    /// Returns the rule of a face normal to an axis with the density deviation δρ = 3 p.
    #[must_use]
    pub fn new(axis: usize, density: impl Into<TimeTable>) -> Self {
        Self {
            axis,
            density: density.into(),
            incline: [[0.0; 3]; 2],
            cells: Vec::new(),
            links: Vec::new(),
            returned: Vec::new(),
            entering: Vec::new(),
            sound: None,
        }
    }

    /// Returns the velocity of a cell along the normal.
    fn normal<S: Stored>(
        &self,
        cell: &PressureCell,
        populations: &Populations<S>,
        moment: &RuleStep,
    ) -> f64 {
        // The collision added F to the momentum; the velocity of the step is that before the collision plus F/2.
        let (drho, momentum) = populations.outgoing_moments(cell.cell);
        (momentum[self.axis] - moment.half_force[self.axis]) / (1.0 + drho)
    }

    /// Returns the rule with a density deviation that varies linearly over the face; the imposed value applies at
    /// `middle`.
    #[must_use]
    pub(super) fn inclined(mut self, middle: [f64; 3], per_cell: [f64; 3]) -> Self {
        self.incline = [middle, per_cell];
        self
    }

    /// Adds the plane wave that absorbs sound.
    #[must_use]
    pub(super) fn absorbing(mut self, wave: PlaneWave, forecast: Option<Forecast>) -> Self {
        self.sound = Some((wave, forecast));
        self
    }
}

impl<S: Stored> Rule<S> for PressureLinks {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn take(&mut self, crossing: &Crossing<'_, S>) -> Giver {
        match self.cells.last_mut() {
            Some(last) if last.cell == crossing.cell => last.count += 1,
            _ => self.cells.push(PressureCell {
                cell: crossing.cell,
                first: self.links.len(),
                count: 1,
                beyond: {
                    let [middle, per_cell] = self.incline;
                    let part = |a: usize| per_cell[a] * (real(crossing.at[a]) + 0.5 - middle[a]);
                    (0..3).filter(|a| *a != self.axis).map(part).sum()
                },
            }),
        }
        self.links.push(crossing.face_link());
        self.returned.push(Returned {
            mirror: Mirror::new(crossing),
            weight: crossing.weight(),
        });
        self.entering.push(0.0);
        Giver::Rule
    }

    fn ramp_end(&self) -> f64 {
        self.density.end()
    }

    fn sums(&self) -> bool {
        self.sound.is_some()
    }

    fn measure(&self, populations: &Populations<S>, moment: &RuleStep) -> Sums {
        let Some((wave, _)) = &self.sound else {
            return Sums::default();
        };
        let [squares] = sums(self.cells.len(), CELLS_PER_THREAD, |part| {
            let mut squares = 0;
            for cell in &self.cells[part] {
                let normal = self.normal(cell, populations, moment);
                let returned = &self.returned[cell.first..][..cell.count];
                let area: f64 = returned.iter().map(|returned| 6.0 * returned.weight).sum();
                squares += i128::from(quanta(area * normal * normal));
            }
            [squares]
        });
        wave.measure(&self.links, squares, populations)
    }

    fn receive_sums(&mut self, sums: Sums, moment: &RuleStep) {
        if let Some((wave, forecast)) = &mut self.sound {
            let forecast = forecast.as_ref().map(|forecast| forecast(moment.step));
            wave.update_pressure_excess(sums, self.density.value(moment.step), forecast);
        }
    }

    fn memory(&self) -> Option<f64> {
        self.sound.as_ref().and_then(|(wave, _)| wave.memory())
    }

    fn recall(&mut self, memory: Option<f64>) {
        if let Some((wave, _)) = &mut self.sound {
            wave.recall(memory);
        }
    }

    fn apply(&mut self, populations: &mut Populations<S>, moment: &RuleStep) {
        let parity = populations.parity();
        let excess = self.sound.as_ref().map_or(0.0, |(wave, _)| wave.excess());
        let wanted = self.density.value(moment.step) + excess;
        // Leaving numbers are read and entering ones written; no number is both.
        let mut entering = std::mem::take(&mut self.entering);
        let (rule, water) = (&*self, &*populations);
        let count = rule.cells.len();
        let pieces = thread_pool::threads().min(count / CELLS_PER_THREAD).max(1);
        let first = |piece: usize| {
            let cell = rule.cells.get(count * piece / pieces);
            cell.map_or(rule.links.len(), |cell| cell.first)
        };
        let shared = thread_pool::cut(&mut entering, pieces, first);
        thread_pool::each_of(pieces, shared, |piece, entering| {
            let mut entering = entering.iter_mut();
            for cell in &rule.cells[count * piece / pieces..count * (piece + 1) / pieces] {
                let normal = rule.normal(cell, water, moment);
                let wanted = wanted + cell.beyond;
                let even = wanted + (1.0 + wanted) * (3.0 * normal * normal);
                let links = rule.returned[cell.first..][..cell.count].iter();
                for (returned, entering) in links.zip(&mut entering) {
                    let (from, _) = returned.mirror.ends(parity);
                    *entering = 2.0 * returned.weight * even - water.numbers()[from].to_f64();
                }
            }
        });
        each_part(
            entering.len(),
            LINKS_PER_THREAD,
            populations,
            |part, numbers| {
                for (link, value) in self.links[part.clone()].iter().zip(&entering[part]) {
                    // SAFETY: a position in the slab, of this link alone.
                    unsafe {
                        numbers
                            .add(link.link.incoming(parity))
                            .write(S::from_f64(*value))
                    };
                }
            },
        );
        self.entering = entering;
    }

    fn links(&self) -> &[FaceLink] {
        &self.links
    }
}
