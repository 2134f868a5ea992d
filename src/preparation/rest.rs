//! Relaxation of bonded grains before the run, without the fluid.
//!
//! Existing contacts become bonds, then damped steps bring the grains to rest, so that bonds carry their load when the
//! run starts. Only what contacts and bonds connect to a wall or to a fixed or driven body moves in these steps: an
//! agglomerate in the air, a named body above a bed and a grain that touches nothing have no equilibrium but the floor,
//! so they are held at their positions ([`Kind::Held`]), unless no gravity acts. Where bonds break, the grains that
//! lose their support are held from the next check on.
//!
//! Gravity acts at once, so that bonds carry more than their load at rest while the grains oscillate (a suddenly loaded
//! spring twice as much). A bond therefore breaks only if it is overloaded in the state at rest: during the steps bonds
//! have [`HELD`] times their strength, and at rest those whose load exceeds their strength break at once; the remaining
//! ones relax again.
//! The report gives the number of bonds that break in this
//! relaxation, before the flow starts, `bonds.csv` lists them with the time 0, and the report gives the largest
//! displacement: a supported piece that slides to a new position does so before time 0. Driven bodies and walls are
//! stationary during the relaxation. Afterwards each grain, body and wall receives its velocity in the case.

use super::supervision::{Request, Requests};
use base::error::Error;
use decomposition::{Communicator, Domain};
use dem::contact::{Depth, StaticContact};
use dem::particles::Particles;
use dem::relax::unbalanced_text;
use dem::space::{Components, Space};
use dem::{BondBreak, Dem, EquilibriumState, Failure, Kind, Relaxation};
use plan::scene::Scene;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::HashMap;

/// Strength of the bonds during the steps, over that of the law. A spring that is loaded at once carries twice its load
/// at rest; the same again is a margin for chains of springs. A power of two restores the strengths exactly.
const HELD: f64 = 4.0;

/// Velocity and spin by id.
type Velocities = HashMap<u64, [f64; 6]>;

/// Returns the velocity and spin of all moving bodies by id, equal on all ranks, because grains may change their
/// rank during the relaxation. Collective.
fn velocities<S: Space>(particles: &Particles<S>, domain: &Domain) -> Velocities {
    let mut mine = Vec::new();
    for k in 0..particles.owned() {
        let motion = &particles.motion[k];
        let velocity: [f64; 6] = std::array::from_fn(|n| match n {
            0..3 if n < S::DIMENSION => motion.velocity.get(n),
            3.. if n - 3 < S::Spin::COUNT => motion.spin.get(n - 3),
            _ => 0.0,
        });
        if velocity.iter().any(|v| v.to_bits() != 0) {
            mine.extend(particles.body[k].id.to_le_bytes());
            mine.extend(velocity.iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    let mut all = HashMap::new();
    for message in domain.communicator().all_gather_bytes(&mine) {
        let (words, _) = message.as_chunks::<8>();
        let (entries, _) = words.as_chunks::<7>();
        for [id, velocity @ ..] in entries {
            all.insert(u64::from_le_bytes(*id), velocity.map(f64::from_le_bytes));
        }
    }
    all
}

fn set_velocity<S: Space>(particles: &mut Particles<S>, k: usize, velocity: &[f64; 6]) {
    let motion = &mut particles.motion[k];
    for a in 0..S::DIMENSION {
        motion.velocity.set(a, velocity[a]);
    }
    for a in 0..S::Spin::COUNT {
        motion.spin.set(a, velocity[3 + a]);
    }
}

/// Holds the free grains and bodies that nothing stationary supports, if gravity acts. Without it nothing falls, and
/// the contacts of a free sample only come to equilibrium with each other. Collective.
fn hold_unsupported<S: Space>(
    dem: &mut Dem<S>,
    particles: &mut Particles<S>,
    domain: &Domain,
) -> Result<(), Error> {
    if dem.settings().gravity.length() <= 0.0 {
        return Ok(());
    }
    let supported = dem.supported(particles, domain)?;
    for (k, supported) in supported.into_iter().enumerate() {
        if particles.body[k].kind == Kind::Free && !supported {
            particles.set_kind(k, Kind::Held);
        }
    }
    dem.prepare(particles, domain)
}

/// Returns the force \[N\] by which the rounding of positions changes the stiffest contact of grains, with a margin.
fn force_of_rounding(scene: &Scene) -> f64 {
    /// Number of roundings of a position that add up in a force.
    const ROUNDINGS: f64 = 16.0;
    let (Some(contact), Some((_, radius))) = (
        &scene.contact,
        scene.grains.as_ref().and_then(|grains| grains.radii),
    ) else {
        return 0.0;
    };
    let law = contact.model();
    let stiffness = |materials: [u32; 2]| {
        let mass = scene.mass(materials[0] as usize, radius);
        let springs = law.springs(&StaticContact {
            materials,
            diameter: 2.0 * radius,
            radius: 0.5 * radius,
            mass: 0.5 * mass,
            overlap: None,
            depth: Depth::Expected,
            bonded: true,
        });
        springs.stiffness[0]
    };
    let count = law.materials();
    let pairs = (0..count).flat_map(|a| (0..count).map(move |b| [a, b]));
    let stiffest = pairs.map(stiffness).fold(0.0, f64::max);
    let length = scene.grid.size.iter().copied().fold(0.0, f64::max);
    ROUNDINGS * f64::EPSILON * length * stiffest
}

/// Displacement of the grain or body that moved most during the relaxation.
#[derive(Clone, Copy, Debug)]
struct Moved {
    /// Distance \[m\].
    distance: f64,
    id: u64,
    /// Distance in radii.
    parts: f64,
}

/// Returns the largest displacement of a grain or body from its start; none if nothing moved, or without start
/// positions from an earlier checkpoint. Collective.
fn farthest<S: Space>(particles: &Particles<S>, domain: &Domain) -> Option<Moved> {
    let mut own = (0.0, u64::MAX, 0.0);
    for k in 0..particles.owned() {
        let distance = particles
            .displacement(k)
            .map_or(0.0, |moved| moved.length());
        let body = &particles.body[k];
        if distance.total_cmp(&own.0).then(own.1.cmp(&body.id)).is_gt() {
            own = (distance, body.id, body.radius);
        }
    }
    let communicator = domain.communicator();
    let distance = communicator.all_reduce_max_f64(own.0);
    let has_it = own.0.to_bits() == distance.to_bits();
    let id = communicator.all_reduce_min_u64(if has_it { own.1 } else { u64::MAX });
    let radius = communicator.all_reduce_max_f64(if id == own.1 { own.2 } else { 0.0 });
    (distance > 0.0).then(|| Moved {
        distance,
        id,
        parts: distance / radius,
    })
}

/// Returns the number of grains and bodies of this kind on all ranks. Collective.
fn count_kind<S: Space>(particles: &Particles<S>, kind: Kind, domain: &Domain) -> u64 {
    let own = &particles.body[..particles.owned()];
    let count = own.iter().filter(|body| body.kind == kind).count();
    domain.communicator().all_reduce_sum_u64(count as u64)
}

/// State of a [`BondRelaxation`] in a checkpoint.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize)]
pub struct SavedRest {
    bonds: u64,
    broken: u64,
    broken_at_check: u64,
    steps: u64,
    /// Bits of [`BondRelaxation::rounding`].
    rounding: u64,
    /// Id, and the bits of the six components of velocity and spin.
    velocities: Vec<(u64, [u64; 6])>,
    #[serde(default)]
    breaks: Vec<EarlyBreak>,
}

/// Bond that broke before the run began.
#[derive(Clone, Copy, Debug, Deserialize, Eq, Ord, PartialEq, PartialOrd, Serialize)]
pub struct EarlyBreak {
    /// Solid step of the relaxation.
    pub solid_step: u64,
    /// Ids of both grains, the lower first; of a wall `u64::MAX` minus its index.
    pub ids: [u64; 2],
    /// Bits of the coordinates x and y of the contact \[m\].
    pub position: [u64; 2],
    /// `true` if the bond broke in shear, `false` if in tension.
    pub shear: bool,
}

/// Returns the breaks of all ranks, in the order of steps and ids. Collective.
fn gather<S: Space>(
    breaks: Vec<BondBreak<S>>,
    communicator: &Communicator,
) -> Result<Vec<EarlyBreak>, Error> {
    let early = breaks.into_iter().map(|broken| EarlyBreak {
        solid_step: broken.step,
        ids: [
            broken.grain,
            match (broken.other, broken.wall) {
                (Some(other), _) => other,
                (None, wall) => u64::MAX - wall.map_or(0, u64::from),
            },
        ],
        position: [0, 1].map(|axis| broken.position.get(axis).to_bits()),
        shear: broken.mode == Failure::Shear,
    });
    let own = serde_json::to_vec(&early.collect::<Vec<_>>());
    let own = own.map_err(|error| Error::Internal(error.to_string()))?;
    let mut all = Vec::new();
    for bytes in communicator.all_gather_bytes(&own) {
        let part: Vec<EarlyBreak> =
            serde_json::from_slice(&bytes).map_err(|error| Error::Internal(error.to_string()))?;
        all.extend(part);
    }
    all.sort_unstable();
    Ok(all)
}

/// Relaxation of bonded grains without the fluid.
#[derive(Clone, Debug)]
pub struct BondRelaxation {
    bonds: u64,
    /// Number of bonds broken during the relaxation.
    broken: u64,
    /// Number of them at the last check of the supports.
    broken_at_check: u64,
    /// Number of solid steps.
    steps: u64,
    /// Force of a contact \[N\] below which it is due to the rounding of positions.
    rounding: f64,
    /// Velocities of grains and bodies to be restored after the relaxation.
    velocities: Velocities,
    /// Bonds broken during the relaxation.
    breaks: Vec<EarlyBreak>,
}

impl BondRelaxation {
    /// Bonds the contacts, stops all bodies and holds those without support; returns `None` if the case has no bonds.
    /// Collective.
    ///
    /// # Errors
    /// If [`Dem::advance`] fails.
    pub fn begin<S: Space>(
        scene: &Scene,
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<Option<Self>, Error> {
        if !scene.grains.as_ref().is_some_and(|g| g.bond_at_start) {
            return Ok(None);
        }
        let velocities = velocities(particles, domain);
        for k in 0..particles.owned() {
            set_velocity(particles, k, &[0.0; 6]);
        }
        particles.mark_start();
        let bonds = dem.bond_existing_contacts(particles, domain)?;
        hold_unsupported(dem, particles, domain)?;
        Ok(Some(Self {
            bonds: domain.communicator().all_reduce_sum_u64(bonds),
            broken: 0,
            broken_at_check: 0,
            steps: 0,
            rounding: force_of_rounding(scene),
            velocities,
            breaks: Vec::new(),
        }))
    }

    /// Returns the state for a checkpoint.
    #[must_use]
    pub fn state(&self) -> SavedRest {
        let mut velocities: Vec<(u64, [u64; 6])> = self
            .velocities
            .iter()
            .map(|(id, velocity)| (*id, velocity.map(f64::to_bits)))
            .collect();
        velocities.sort_unstable();
        SavedRest {
            bonds: self.bonds,
            broken: self.broken,
            broken_at_check: self.broken_at_check,
            steps: self.steps,
            rounding: self.rounding.to_bits(),
            velocities,
            breaks: self.breaks.clone(),
        }
    }

    /// Restores the state from [`Self::state`].
    #[must_use]
    pub fn restore(state: SavedRest) -> Self {
        Self {
            bonds: state.bonds,
            broken: state.broken,
            broken_at_check: state.broken_at_check,
            steps: state.steps,
            rounding: f64::from_bits(state.rounding),
            velocities: state
                .velocities
                .into_iter()
                .map(|(id, velocity)| (id, velocity.map(f64::from_bits)))
                .collect(),
            breaks: state.breaks,
        }
    }

    /// Runs damped steps until the grains are stationary and no bond is overloaded. `save` is called at each request
    /// and may end the run with an error. Returns a line to print and the entry of the summary, in which `breaks` lists
    /// the bonds that broke as [`EarlyBreak`]. Collective.
    ///
    /// # Errors
    /// If [`Dem::advance`] or `save` fails.
    pub fn run<S: Space, R: Requests>(
        mut self,
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
        domain: &Domain,
        requests: &mut R,
        mut save: impl FnMut(&Self, &Particles<S>, &Dem<S>, &mut R, Request) -> Result<(), Error>,
    ) -> Result<(String, Value), Error> {
        let until = Relaxation::default();
        let damping = dem.settings().local_damping;
        let driven: Vec<S::Vector> = dem.walls().iter().map(|wall| wall.velocity).collect();
        dem.drive_walls(&vec![S::Vector::default(); driven.len()]);
        dem.set_local_damping(until.local_damping);
        dem.set_bond_strength(particles, domain, HELD)?;
        let communicator = domain.communicator();
        let still: EquilibriumState = loop {
            if count_kind(particles, Kind::Free, domain) == 0 {
                break EquilibriumState::default();
            }
            // The checks follow the same steps, independently of interruptions between them.
            let to_check = until.check_every - self.steps % until.check_every;
            let batch = requests.steps().min(to_check).min(until.limit - self.steps);
            dem.advance_many(particles, domain, batch)?;
            self.steps += batch;
            self.note_breaks(dem, communicator)?;
            let checks = self.steps.is_multiple_of(until.check_every) || self.steps >= until.limit;
            if checks {
                self.hold_after_breaks(dem, particles, domain)?;
                let now = dem.equilibrium_state(particles, domain);
                let ends = self.steps >= until.limit;
                if ends || self.at_rest(&now) {
                    dem.set_bond_strength(particles, domain, 1.0)?;
                    let overloaded = dem.break_overloaded(particles, domain)?;
                    self.note_breaks(dem, communicator)?;
                    if ends || overloaded == 0 {
                        break now;
                    }
                    self.hold_after_breaks(dem, particles, domain)?;
                    dem.set_bond_strength(particles, domain, HELD)?;
                }
            }
            let request = requests.ask(communicator);
            if request != Request::None {
                dem.set_bond_strength(particles, domain, 1.0)?;
                save(&self, particles, dem, requests, request)?;
                dem.set_bond_strength(particles, domain, HELD)?;
            }
        };
        dem.set_bond_strength(particles, domain, 1.0)?;
        dem.set_local_damping(damping);
        dem.drive_walls(&driven);
        let held = count_kind(particles, Kind::Held, domain);
        let moved = farthest(particles, domain);
        particles.forget_start();
        for k in 0..particles.owned() {
            if particles.body[k].kind == Kind::Held {
                particles.set_kind(k, Kind::Free);
            }
            let velocity = self.velocities.get(&particles.body[k].id);
            set_velocity(particles, k, velocity.unwrap_or(&[0.0; 6]));
        }
        dem.prepare(particles, domain)?;
        let report = json!({
            "bonds": self.bonds,
            "bonds_broken": self.broken,
            "breaks": self.breaks,
            "held": held,
            "at_rest": self.at_rest(&still),
            "solid_steps": self.steps,
            "unbalanced_force": still.unbalanced(),
            "largest_contact_force": still.contact,
            "largest_displacement": moved.map(|moved| moved.distance),
        });
        Ok((self.line(held, &still, moved), report))
    }

    /// Records the bonds that broke since the last call. Collective.
    fn note_breaks<S: Space>(
        &mut self,
        dem: &mut Dem<S>,
        communicator: &Communicator,
    ) -> Result<(), Error> {
        let breaks = dem.take_breaks();
        let broken = communicator.all_reduce_sum_u64(breaks.len() as u64);
        if broken > 0 {
            self.broken += broken;
            self.breaks.extend(gather(breaks, communicator)?);
        }
        Ok(())
    }

    /// Holds the grains that have lost their support, once bonds broke. Collective.
    fn hold_after_breaks<S: Space>(
        &mut self,
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<(), Error> {
        // At every check: a grain whose bond broke at rest counts as in contact until it has moved away.
        if self.broken > 0 {
            self.broken_at_check = self.broken;
            hold_unsupported(dem, particles, domain)?;
        }
        Ok(())
    }

    /// Returns `true` if the resultants are small compared with the forces of the contacts, or are those of rounding.
    /// In a sample that nothing loads, both vanish.
    fn at_rest(&self, now: &EquilibriumState) -> bool {
        now.unbalanced() <= Relaxation::default().tolerance || now.resultant <= self.rounding
    }

    /// Returns the line to print. It does not claim equilibrium where the relaxation ended at its limit of steps.
    fn line(&self, held: u64, still: &EquilibriumState, moved: Option<Moved>) -> String {
        if self.bonds == 0 {
            return "no bonds: no grain touches another or a wall at the start".to_owned();
        }
        let bonds = self.bonds;
        let unsupported = match held {
            0 => String::new(),
            1 => "; 1 grain or body touches nothing that holds it and keeps its position and velocity".into(),
            held => format!(
                "; {held} grains or bodies touch nothing that holds them and keep their positions and velocities"
            ),
        };
        if self.steps == 0 {
            return format!("{bonds} bonds{unsupported}");
        }
        let moved = moved.map_or_else(String::new, |Moved { distance, id, parts }| {
            let percent = 100.0 * parts;
            format!(
                "; the grain or body of id {id} moved most, by {distance:.2e} m ({percent:.2} % of its radius)"
            )
        });
        let state = if self.at_rest(still) {
            "at rest"
        } else {
            "not at rest"
        };
        format!(
            "{bonds} bonds; {state} after {} solid steps (unbalanced force {}); {} bonds broke during the \
             relaxation{moved}{unsupported}",
            self.steps,
            unbalanced_text(still.unbalanced()),
            self.broken
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decomposition::Communicator;
    use dem::contact::Scaled;
    use dem::contact::cohesive_frictional::{CohesiveFrictional, CohesiveFrictionalParameters};
    use dem::contact::contact_bond::{ContactBond, ContactBondParameters};
    use dem::contact::linear::{self, Linear};
    use dem::particles::{Body, Motion};
    use dem::{DemSettings, GrainDomain, Law, PairTable, Volume, Wall, alone};
    use nalgebra::Vector3;

    /// Supervisor without requests.
    struct NoRequests;

    impl Requests for NoRequests {
        fn steps(&self) -> u64 {
            30
        }

        fn ask(&mut self, _: &Communicator) -> Request {
            Request::None
        }
    }

    const SPRINGS: linear::LinearParameters = linear::LinearParameters {
        normal_stiffness: Scaled::Absolute(1e3),
        stiffness_ratio: 1.0,
        friction: 0.5,
        normal_damping_ratio: 0.3,
        shear_damping_ratio: 0.3,
        attraction: false,
    };

    fn springs() -> Law {
        Law::Linear(Linear {
            parameters: PairTable::uniform(1, SPRINGS),
        })
    }

    /// Returns a law whose bonds bear more than any force of the tests.
    fn bonds() -> Law {
        bonds_of(1e3)
    }

    /// Returns a law whose bonds bear forces up to a strength \[N\].
    fn bonds_of(strength: f64) -> Law {
        let parameters = ContactBondParameters {
            linear: SPRINGS,
            tensile_strength: strength,
            shear_strength: strength,
            bonding_gap: 0.0,
            unstressed: false,
        };
        Law::ContactBond(ContactBond {
            parameters: PairTable::uniform(1, parameters),
        })
    }

    /// Returns the relaxation of a sample with one bond.
    fn relaxation() -> BondRelaxation {
        BondRelaxation {
            bonds: 1,
            broken: 0,
            broken_at_check: 0,
            steps: 0,
            rounding: 1e-11,
            velocities: Velocities::new(),
            breaks: Vec::new(),
        }
    }

    fn keep(
        _: &BondRelaxation,
        _: &Particles<Volume>,
        _: &Dem<Volume>,
        _: &mut NoRequests,
        _: Request,
    ) -> Result<(), Error> {
        Ok(())
    }

    /// Relaxes two bonded grains that overlap by 10 nm, without gravity; returns the line and the report.
    fn relaxed_pair(law: Law) -> (String, Value) {
        let corner = Vector3::repeat(0.01);
        let region = GrainDomain::closed(Vector3::zeros(), corner, 1e-3);
        let mut dem =
            Dem::<Volume>::new(law, DemSettings::new(region, 1e-5, 1e-4), Vec::new()).unwrap();
        let domain = alone();
        let mut particles = Particles::new();
        for (id, x) in [(1, 0.004), (2, 0.005_999_99)] {
            let motion = Motion {
                position: Vector3::new(x, 0.005, 0.005),
                ..Motion::default()
            };
            particles.insert(Body::uniform::<Volume>(id, 1e-3, 2600.0, 0), motion);
        }
        assert_eq!(
            dem.bond_existing_contacts(&mut particles, &domain).unwrap(),
            1
        );
        relaxation()
            .run(&mut dem, &mut particles, &domain, &mut NoRequests, keep)
            .unwrap()
    }

    /// Checks that two bonded grains without gravity whose forces vanish are at rest long before the limit of steps.
    #[test]
    fn a_free_pair_comes_to_rest() {
        let (line, report) = relaxed_pair(bonds());
        assert_eq!(report["at_rest"], true, "{line}");
        assert!(report["solid_steps"].as_u64().unwrap() < 20_000, "{line}");
        assert_eq!(report["breaks"], json!([]), "{line}");
    }

    /// Checks that a bond which breaks in the relaxation, as the overlap pushes the grains apart, is listed.
    #[test]
    fn bonds_that_break_are_listed() {
        let (line, report) = relaxed_pair(bonds_of(1e-7));
        assert_eq!(report["bonds_broken"], 1, "{line}");
        let breaks: Vec<EarlyBreak> = serde_json::from_value(report["breaks"].clone()).unwrap();
        assert_eq!(breaks.len(), 1, "{line}");
        assert_eq!((breaks[0].ids, breaks[0].shear), ([1, 2], false));
        let [x, y] = breaks[0].position.map(f64::from_bits);
        assert!(
            (x - 0.005).abs() < 1e-6 && (y - 0.005).abs() < 1e-9,
            "{x} {y}"
        );
    }

    /// Relaxes three bonded spheres that hang from a ceiling, with a strength of the bonds in weights of one sphere;
    /// returns the report.
    fn hanging_chain(law: fn(f64) -> Law, weights: f64) -> Value {
        let radius = 0.05;
        let weight = 2500.0 * 4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius * 9.81;
        let size = Vector3::repeat(1.0);
        let mut settings = DemSettings::new(
            GrainDomain::closed(Vector3::zeros(), size, 0.01),
            2e-5,
            0.01,
        );
        settings.gravity = Vector3::new(0.0, 0.0, -9.81);
        let ceiling = Wall::new(size, -Vector3::z(), 0);
        let mut dem = Dem::<Volume>::new(law(weights * weight), settings, vec![ceiling]).unwrap();
        let domain = alone();
        let mut particles = Particles::new();
        for (id, z) in [(1, 0.95), (2, 0.85), (3, 0.75)] {
            let motion = Motion {
                position: Vector3::new(0.5, 0.5, z + 1e-7 * f64::from(id)),
                ..Motion::default()
            };
            let id = u64::try_from(id).unwrap();
            particles.insert(Body::uniform::<Volume>(id, radius, 2500.0, 0), motion);
        }
        let bonds = dem.bond_existing_contacts(&mut particles, &domain).unwrap();
        assert_eq!(bonds, 3);
        let (line, report) = relaxation()
            .run(&mut dem, &mut particles, &domain, &mut NoRequests, keep)
            .unwrap();
        assert_eq!(report["at_rest"], true, "{line}");
        report
    }

    fn stiff() -> linear::LinearParameters {
        linear::LinearParameters {
            normal_stiffness: Scaled::Absolute(1e6),
            ..SPRINGS
        }
    }

    fn chain_of_contact_bonds(strength: f64) -> Law {
        Law::ContactBond(ContactBond {
            parameters: PairTable::uniform(
                1,
                ContactBondParameters {
                    linear: stiff(),
                    tensile_strength: strength,
                    shear_strength: strength,
                    bonding_gap: 0.0,
                    unstressed: false,
                },
            ),
        })
    }

    fn chain_of_cohesion(strength: f64) -> Law {
        Law::CohesiveFrictional(CohesiveFrictional {
            parameters: PairTable::uniform(
                1,
                CohesiveFrictionalParameters {
                    linear: stiff(),
                    cohesion: Scaled::Absolute(strength),
                },
            ),
        })
    }

    /// Checks that the upper bond of a chain of three spheres, which carries three weights at rest, breaks only if it
    /// is weaker, although the sudden weight loads it with more while the chain oscillates.
    #[test]
    fn a_bond_breaks_only_by_its_load_at_rest() {
        for law in [chain_of_contact_bonds, chain_of_cohesion] {
            for (weights, broken) in [(3.02, 0), (3.3, 0), (4.0, 0), (2.9, 1), (1.5, 2)] {
                let report = hanging_chain(law, weights);
                assert_eq!(report["bonds_broken"], broken, "{weights}: {report}");
            }
        }
    }

    /// Checks that a piston that moves in the run is stationary during the relaxation, and moves afterwards.
    #[test]
    fn walls_stand_still() {
        let corner = Vector3::repeat(0.01);
        let settings = DemSettings::new(
            GrainDomain::closed(Vector3::zeros(), corner, 1e-3),
            1e-5,
            1e-4,
        );
        let up = Vector3::new(0.0, 0.0, 0.3);
        let mut piston = Wall::new(Vector3::zeros(), Vector3::z(), 0);
        piston.velocity = up;
        let mut dem = Dem::<Volume>::new(springs(), settings, vec![piston]).unwrap();
        let domain = alone();
        let mut particles = Particles::new();
        let motion = Motion {
            position: Vector3::new(0.005, 0.005, 0.000_99),
            ..Motion::default()
        };
        particles.insert(Body::uniform::<Volume>(1, 1e-3, 2600.0, 0), motion);
        relaxation()
            .run(&mut dem, &mut particles, &domain, &mut NoRequests, keep)
            .unwrap();
        assert_eq!(dem.walls()[0].point, Vector3::zeros());
        assert_eq!(dem.walls()[0].velocity, up);
    }
}
