//! Imposed velocity: half-way bounce-back with the velocity of a profile ([`super::wall`]), optionally with
//! turbulence ([`super::turbulent`]).

use super::links::{LINKS_PER_THREAD, each_part};
use super::profile::{FaceVelocity, ReadTable, VelocityProfile};
use super::sound::PlaneWave;
use super::turbulent::{Inlet, Synthetic};
use super::{
    BoundaryKind, BoundaryModel, Crossing, FaceLink, Giver, ImposedSpeed, Inflow, Place, Ramp,
    Rule, RuleStep, Site, Sound, Strength, Sums, SurfaceKind, WithSurface, from_quanta, quanta,
    wall,
};
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::surface::Outside;
use crate::synthetic::Fluctuations;
use base::error::{Error, Problem, Report, Severity};
use base::history::{self, TimeTable};
use base::number::real;
use base::units::LatticeUnits;
use base::vector::{dot, norm};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Imposed velocity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Velocity {
    /// Velocity profile over the face or patch.
    pub profile: VelocityProfile,
    /// Time over which the velocity grows linearly from zero \[s\], counted from the first fluid step, warm-up
    /// included. Default: the full velocity from the first step on.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub ramp_time: Option<f64>,
    /// Table of times \[s\], counted from the first fluid step, warm-up included, and factors of the profile \[1\]:
    /// linear between the rows, constant before and after; two factors at one time are a jump. A factor below 0
    /// reverses the flow. Default: constant.
    #[serde(default)]
    pub history: Option<Vec<[f64; 2]>>,
    /// Turbulent fluctuations of the inflow. The profile is then the mean velocity. Default: none.
    #[serde(default)]
    pub turbulence: Option<Fluctuations>,
    /// Behaviour of the opening for sound. `absorb` lets plane waves out; the profile is then imposed as a mean over
    /// several transit times of sound through the domain, and exactly once the flow is steady. `reflect` keeps the
    /// profile at every step.
    #[serde(default = "reflect")]
    pub sound: Sound,
}

/// Maximum fraction of a discharge that may be missing because links at the rim belong to walls; above it the flow
/// would differ from the stated one.
const MAX_MISSING_DISCHARGE: f64 = 0.5;

fn reflect() -> Sound {
    Sound::Reflect
}

const KIND: BoundaryKind = BoundaryKind {
    surface: SurfaceKind::Opening,
    strength: Strength::Velocity,
};

const OUTWARD: &str =
    "the mean flow carries the turbulence into the domain, but this profile points out of it";
const REVERSE_ADVICE: &str = "reverse the profile, or remove `turbulence`";

impl Velocity {
    /// Returns the mean velocity into the domain without ramp and table of factors [m/s]; none if too many cells would
    /// have to be evaluated.
    #[must_use]
    pub fn mean_inflow(&self, place: &Place<'_>) -> Option<f64> {
        let stated = self.profile.mean_inflow(place);
        stated.or_else(|| self.profile.mean_of_table(place))
    }
}

impl BoundaryModel for Velocity {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn resolve(&mut self, site: &Site<'_>, read: ReadTable<'_>, report: &mut dyn Report) {
        if let Some(turbulence) = &self.turbulence {
            let path = format!("{}.turbulence", site.path);
            turbulence.check(site.spacing, &path, report);
        }
        if self.turbulence.is_some() && self.sound == Sound::Absorb {
            let path = format!("{}.sound", site.path);
            report.error(
                &path,
                "an opening through which turbulence enters does not absorb sound".into(),
                "let the outlet absorb sound, and remove this field".into(),
            );
        }
        if let Some(table) = &self.history {
            history::check(table, &format!("{}.history", site.path), report);
        }
        let path = format!("{}.profile", site.path);
        self.profile.resolve((site, &path), read, report);
    }

    /// Checks that the mean flow is into the domain, so that it carries turbulence in.
    fn check(&self, place: &Place<'_>, report: &mut dyn Report) {
        if self.turbulence.is_some() && self.mean_inflow(place).is_some_and(|mean| mean <= 0.0) {
            let path = format!("{}.turbulence", place.site.path);
            report.error(&path, OUTWARD.into(), REVERSE_ADVICE.into());
        }
    }

    fn with_surface(&self) -> WithSurface {
        if self.sound == Sound::Absorb {
            WithSurface::Never
        } else {
            WithSurface::Also
        }
    }

    fn speed(&self) -> Option<ImposedSpeed> {
        let (field, fastest) = self.profile.fastest();
        Some(ImposedSpeed {
            what: "the imposed velocity",
            field,
            value: fastest
                * largest_factor(self.history.as_deref())
                * Fluctuations::gusts(self.turbulence.as_ref()),
        })
    }

    fn inflow(&self, place: &Place<'_>) -> Inflow {
        if self.history.is_some() {
            return Inflow::Any;
        }
        self.profile
            .mean_inflow(place)
            .map_or(Inflow::Any, Inflow::Mean)
    }

    fn largest_inflow(&self, place: &Place<'_>) -> Inflow {
        let largest = largest_factor(self.history.as_deref());
        self.profile
            .mean_inflow(place)
            .map_or(Inflow::Any, |mean| Inflow::Mean(largest * mean))
    }

    fn ramp_time(&self) -> f64 {
        self.ramp_time.unwrap_or(0.0)
    }

    fn rule<S: Stored>(
        &self,
        place: &Place<'_>,
        units: &LatticeUnits,
    ) -> Result<Box<dyn Rule<S>>, Error> {
        let profile = self.profile.on_lattice(place, units);
        let synthetic = match &self.turbulence {
            None => None,
            Some(written) => Some(synthetic(written, place, &profile, units)?),
        };
        let ramp = Ramp {
            start: 0.0,
            end: 1.0,
            steps: units.time_to_lattice(self.ramp_time.unwrap_or(0.0)),
        };
        let mean = self.mean_inflow(place);
        let discharge = mean.map(|mean| units.velocity_to_lattice(mean) * place.area());
        let history = in_steps(self.history.as_deref(), units);
        let links = VelocityLinks::new(profile, ramp).following(history);
        let mut links = links.within(place).balanced(discharge);
        if let Some(synthetic) = synthetic {
            let face = place.site.face;
            links = links.turbulent(synthetic, (face.axis(), face.is_max()));
        }
        if self.sound == Sound::Absorb {
            let length = place.site.cells[place.site.face.axis()];
            links = links.absorbing(PlaneWave::at_velocity(real(length)));
        }
        Ok(Box::new(links))
    }
}

/// Returns the largest absolute factor of a table; 1 without a table.
pub(super) fn largest_factor(table: Option<&[[f64; 2]]>) -> f64 {
    let [low, high] = TimeTable::new(table, 1.0).range();
    low.abs().max(high.abs())
}

/// Returns the factors of a table as a function of the step.
pub(super) fn in_steps(table: Option<&[[f64; 2]]>, units: &LatticeUnits) -> Option<TimeTable> {
    let history = table.map(|table| TimeTable::new(Some(table), 1.0));
    history.map(|history| history.scaled(|time| units.time_to_lattice(time), |factor| factor))
}

/// Returns the turbulence that the mean velocity of a profile carries in through the cells of its patch.
fn synthetic(
    written: &Fluctuations,
    place: &Place<'_>,
    profile: &FaceVelocity,
    units: &LatticeUnits,
) -> Result<Synthetic, Error> {
    let Place { site, from, to, .. } = place;
    let (axis, inward) = (site.face.axis(), site.face.inward());
    let (mut sum, mut cells) = (0.0, 0.0);
    for x in from[0]..to[0] {
        for y in from[1]..to[1] {
            for z in from[2]..to[2] {
                let mut at = [x, y, z].map(|n| real(n) + 0.5);
                at[axis] = if site.face.is_max() {
                    real(site.cells[axis])
                } else {
                    0.0
                };
                let u = profile(at);
                sum += dot(u, inward);
                cells += 1.0;
            }
        }
    }
    let speed = sum / f64::max(cells, 1.0);
    if speed <= 0.0 {
        return Err(Error::Case(vec![Problem {
            path: site.path.into(),
            value: format!("mean velocity of {speed} into the domain, in lattice units"),
            reason: "the mean flow carries the turbulence into the domain, but the profile points out of it"
                .into(),
            remedy: REVERSE_ADVICE.into(),
            severity: Severity::Error,
        }]));
    }
    let lengths = std::array::from_fn(|a| site.periodic[a].then(|| real(site.cells[a])));
    Ok(Synthetic {
        // Along periodic axes the field is periodic like the fluid; otherwise it would be discontinuous.
        modes: written.modes(site.dimension, units).periodic(lengths),
        intensity: written.intensity,
        speed,
    })
}

/// Rule of a wall or inlet with the velocity of the profile times the ramp.
pub struct VelocityLinks {
    kind: BoundaryKind,
    profile: FaceVelocity,
    ramp: Ramp,
    /// Factors of the profile as a function of the step.
    history: Option<TimeTable>,
    /// Axis of the face and ends of the patch in cells; `None` for a whole face.
    within: Option<(usize, [[f64; 2]; 3])>,
    /// Stated discharge at full speed; `None` if none is stated.
    discharge: Option<f64>,
    /// Discharge of this rank's links at a factor of one, in quanta.
    given: i128,
    /// Factor of the velocities with which all links together have the stated discharge.
    balance: f64,
    /// Fluctuations, and axis and end of the face.
    turbulence: Option<(Synthetic, (usize, bool))>,
    /// Links with fluctuations, created with the first link.
    inlet: Option<Inlet>,
    /// Plane wave that absorbs sound, with its links.
    sound: Option<Absorbing>,
}

/// Links of an inlet that absorbs sound.
#[derive(Debug)]
struct Absorbing {
    wave: PlaneWave,
    links: Vec<FaceLink>,
    /// Term 6 w_i c_i·u of each link at full speed.
    terms: Vec<f64>,
}

impl VelocityLinks {
    /// Returns the rule of a profile with a ramp.
    #[must_use]
    pub fn new(profile: FaceVelocity, ramp: Ramp) -> Self {
        Self {
            kind: KIND,
            profile,
            ramp,
            history: None,
            within: None,
            discharge: None,
            given: 0,
            balance: 1.0,
            turbulence: None,
            inlet: None,
            sound: None,
        }
    }

    /// Returns the rule with a table of factors.
    #[must_use]
    pub(super) fn following(mut self, history: Option<TimeTable>) -> Self {
        self.history = history;
        self
    }

    /// Returns the factor of ramp and table at a step.
    fn grown(&self, step: f64) -> f64 {
        let factor = self
            .history
            .as_ref()
            .map_or(1.0, |history| history.value(step));
        factor * self.ramp.value_at(step)
    }

    /// Returns the rule of a uniform constant velocity \[cells per step\].
    #[must_use]
    pub fn uniform(velocity: [f64; 3]) -> Self {
        Self::new(Box::new(move |_| velocity), Ramp::constant(1.0))
    }

    /// Returns the rule for a patch whose ends may lie within cells.
    #[must_use]
    fn within(mut self, place: &Place<'_>) -> Self {
        let axis = place.site.face.axis();
        let whole = |a: usize| place.from[a] == 0 && place.to[a] == place.site.cells[a];
        let all = (0..place.site.dimension).filter(|a| *a != axis).all(whole);
        self.within = (!all).then_some((axis, place.ends));
        self
    }

    /// Returns the rule with a stated discharge into the domain \[cells² per step times cells\].
    #[must_use]
    pub(super) fn balanced(mut self, discharge: Option<f64>) -> Self {
        self.discharge = discharge;
        self
    }

    /// Adds turbulence to the profile; `side` is the axis of the face, and `true` for its upper end.
    #[must_use]
    pub fn turbulent(mut self, synthetic: Synthetic, side: (usize, bool)) -> Self {
        self.turbulence = Some((synthetic, side));
        self
    }

    /// Adds the plane wave that absorbs sound.
    #[must_use]
    pub(super) fn absorbing(mut self, wave: PlaneWave) -> Self {
        self.sound = Some(Absorbing {
            wave,
            links: Vec::new(),
            terms: Vec::new(),
        });
        self
    }

    /// Sets the kind of the boundary.
    pub(super) fn with_kind(mut self, kind: BoundaryKind) -> Self {
        self.kind = kind;
        self
    }
}

impl<S: Stored> Rule<S> for VelocityLinks {
    fn kind(&self) -> BoundaryKind {
        self.kind
    }

    fn take(&mut self, crossing: &Crossing<'_, S>) -> Giver {
        let u = (self.profile)(crossing.middle).map(|u| crossing.share * u);
        let only = |counts: &dyn Fn(usize) -> bool| -> [f64; 3] {
            std::array::from_fn(|a| if counts(a) { u[a] } else { 0.0 })
        };
        let counted = only(&|a| crossing.counted[a]);
        // What crosses an edge along the normals of other faces passes through these.
        let own = only(&|a| crossing.counted[a] && (a == crossing.normal || !crossing.outside[a]));
        let (weight, c) = (crossing.weight(), crossing.velocity());
        if let Some((synthetic, side)) = &self.turbulence {
            let inlet = self
                .inlet
                .get_or_insert_with(|| Inlet::new(*side, synthetic, crossing.cells));
            let speed = norm(u);
            let strength = synthetic.intensity * speed;
            inlet.add(crossing.at, strength, crossing.link, weight, c);
        }
        let term = wall::term(weight, c, counted);
        self.given -= i128::from(quanta(wall::term(weight, c, own)));
        if let Some(sound) = &mut self.sound {
            sound.links.push(crossing.face_link());
            sound.terms.push(term);
        }
        Giver::Wall { term }
    }

    fn is_wall(&self) -> bool {
        self.turbulence.is_none() && self.sound.is_none()
    }

    fn velocity(&self, position: [f64; 3]) -> Option<[f64; 3]> {
        Some((self.profile)(position))
    }

    fn part(&self, centre: [f64; 3]) -> f64 {
        let Some((axis, ends)) = self.within else {
            return 1.0;
        };
        let along = |a: usize| {
            let ([low, high], at) = (ends[a], centre[a]);
            (high.min(at + 0.5) - low.max(at - 0.5)).clamp(0.0, 1.0)
        };
        (0..3).filter(|a| *a != axis).map(along).product()
    }

    fn outside(&self) -> Option<Outside> {
        (self.kind == KIND).then_some(Outside::Stream)
    }

    fn factor(&self, step: f64) -> f64 {
        self.balance * self.grown(step)
    }

    fn add_beside(&mut self, term: f64) {
        self.given -= i128::from(quanta(term));
    }

    fn given(&self) -> i128 {
        self.given
    }

    fn balance(&mut self, given: i128) {
        let given = from_quanta(given);
        if let Some(discharge) = self.discharge
            && (given - discharge).abs() < MAX_MISSING_DISCHARGE * discharge.abs()
        {
            self.balance = discharge / given;
        }
    }

    fn ramp_end(&self) -> f64 {
        let table = self.history.as_ref().map_or(0.0, TimeTable::end);
        self.ramp.steps.max(table)
    }

    fn sums(&self) -> bool {
        self.sound.is_some()
    }

    fn measure(&self, populations: &Populations<S>, moment: &RuleStep) -> Sums {
        let factor = self.balance * self.grown(moment.step);
        self.sound.as_ref().map_or_else(Sums::default, |sound| {
            let into = sound
                .terms
                .iter()
                .map(|term| -i128::from(quanta(term * factor)));
            (sound.wave).measure(&sound.links, into.sum(), populations)
        })
    }

    fn receive_sums(&mut self, sums: Sums, _: &RuleStep) {
        if let Some(sound) = &mut self.sound {
            sound.wave.update_velocity_excess(sums);
        }
    }

    fn memory(&self) -> Option<f64> {
        self.sound.as_ref().and_then(|sound| sound.wave.memory())
    }

    fn recall(&mut self, memory: Option<f64>) {
        if let Some(sound) = &mut self.sound {
            sound.wave.recall(memory);
        }
    }

    fn apply_over_walls(&mut self, populations: &mut Populations<S>, moment: &RuleStep) {
        if let Some(sound) = &self.sound {
            let parity = populations.parity();
            let mut weights = [0.0; 27];
            for (weight, w) in weights.iter_mut().zip(&populations.velocities().w) {
                *weight = *w;
            }
            let (links, excess) = (&sound.links, sound.wave.excess());
            each_part(
                links.len(),
                LINKS_PER_THREAD,
                populations,
                |part, numbers| {
                    for FaceLink { link, direction } in &links[part] {
                        let change = 6.0 * weights[*direction] * excess;
                        // SAFETY: a position in the slab, of this link alone.
                        unsafe {
                            let number = numbers.add(link.incoming(parity));
                            number.write(S::from_f64(number.read().to_f64() + change));
                        }
                    }
                },
            );
        }
        let grown = self.grown(moment.step);
        if let Some(inlet) = &mut self.inlet {
            inlet.apply(populations, moment.step, grown);
        }
    }
}
