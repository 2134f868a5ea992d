//! Blocks that move in the water of their joints, with the contact engine, against closed solutions.

use super::{JointWater, MouthFront, NetworkBlock};
use base::error::Error;
use decomposition::Domain;
use dem::contact::blocks::BlockLaw;
use dem::polyhedron::{BlockContactModel, BlockPairLaw, PlacedPolyhedron, Polyhedron, Stiffness};
use dem::space::Volume;
use dem::{Body, Dem, DemSettings, GrainDomain, Kind, Law, Motion, PairTable, Particles};
use joints::flow::FlowSettings;
use joints::history::PressureHistory;
use joints::network::{Network, NetworkSettings};
use joints::pairs::PairLimits;
use joints::water::Mixture;
use nalgebra::{UnitQuaternion, Vector3};

const DENSITY: f64 = 2650.0;
const WATER: f64 = 1000.0;
const VISCOSITY: f64 = 1e-3;
const GRAVITY: f64 = 9.81;
const STIFFNESS: f64 = 1e8;
/// Sides and height of the block in its socket \[m\].
const SIDE: f64 = 0.2;
const HEIGHT: f64 = 0.1;

/// Box of rock between two corners, and `true` if it moves.
type Rock = ([f64; 3], [f64; 3], bool);

/// Returns a block in a socket of fixed rock, with these gaps below it and at its sides \[m\].
fn socket(below: f64, beside: f64) -> Vec<Rock> {
    let (far, thick) = (SIDE + beside, 0.05);
    let sides = [
        ([-beside - thick, -beside, 0.0], [-beside, far, HEIGHT]),
        ([far, -beside, 0.0], [far + thick, far, HEIGHT]),
        ([-beside, -beside - thick, 0.0], [far, -beside, HEIGHT]),
        ([-beside, far, 0.0], [far, far + thick, HEIGHT]),
    ];
    let mut rocks = vec![
        ([0.0, 0.0, 0.0], [SIDE, SIDE, HEIGHT], true),
        (
            [-beside, -beside, -below - thick],
            [far, far, -below],
            false,
        ),
    ];
    rocks.extend(sides.map(|(low, high)| (low, high, false)));
    rocks
}

/// Water, contacts and blocks.
struct Scene {
    water: JointWater,
    dem: Dem<Volume>,
    particles: Particles<Volume>,
    domain: Domain,
    step: f64,
}

impl Scene {
    fn new(
        rocks: &[Rock],
        pressure: PressureHistory,
        presses: bool,
        (residual_aperture, cell): (f64, f64),
        step: f64,
    ) -> Self {
        let solid = |&(low, high, _): &Rock| {
            let (low, high) = (Vector3::from(low), Vector3::from(high));
            PlacedPolyhedron {
                shape: Polyhedron::cuboid(high - low).unwrap(),
                position: 0.5 * (low + high),
                orientation: UnitQuaternion::identity(),
            }
        };
        let blocks: Vec<NetworkBlock> = rocks
            .iter()
            .map(|rock| NetworkBlock {
                solid: solid(rock),
                density: rock.2.then_some(DENSITY),
                velocity: Vector3::zeros(),
            })
            .collect();
        let mut particles = Particles::new();
        let shapes: Vec<_> = blocks.iter().map(|b| b.solid.shape.clone()).collect();
        particles.set_shapes(shapes.into()).unwrap();
        for (k, block) in (0..).zip(&blocks) {
            let mut body = Body::of_block(u64::from(k), &block.solid.shape, DENSITY, 0);
            if block.density.is_none() {
                body.kind = Kind::Fixed;
            }
            let motion = Motion {
                position: block.solid.position,
                ..Motion::default()
            };
            let turn = block.solid.orientation;
            particles.add_block(body, motion, k, turn).unwrap();
        }
        let law = BlockPairLaw {
            stiffness: Stiffness::PerArea {
                normal: STIFFNESS,
                shear: 0.5 * STIFFNESS,
            },
            friction: 0.5,
            normal_damping_ratio: 0.3,
            shear_damping_ratio: 0.3,
        };
        let law = Law::Blocks(BlockLaw {
            parameters: PairTable::uniform(1, law),
            model: BlockContactModel::Pressure,
            mass_damping: 0.0,
        });
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY);
        let region = GrainDomain::closed(Vector3::repeat(-9.0), Vector3::repeat(9.0), 18.0);
        let mut settings = DemSettings::new(region, step, 0.01);
        settings.gravity = gravity;
        let dem = Dem::new(law, settings, Vec::new()).unwrap();
        Self {
            water: water(&blocks, pressure, presses, (residual_aperture, cell), step).unwrap(),
            dem,
            particles,
            domain: dem::alone(),
            step,
        }
    }

    fn advance(&mut self) -> Result<(), Error> {
        self.dem.loads_ahead(&mut self.particles, &self.domain)?;
        let path = self.water.carry(&mut self.particles, &self.domain)?;
        self.dem.carried(&mut self.particles, &self.domain, path)
    }

    fn rise(&self) -> f64 {
        self.particles.motion[0].position.z - 0.5 * HEIGHT
    }

    fn speed(&self) -> f64 {
        self.particles.motion[0].velocity.z
    }
}

/// Returns the water round blocks; all edges at the top of the socket are open.
fn water(
    blocks: &[NetworkBlock],
    pressure: PressureHistory,
    presses: bool,
    (residual_aperture, cell): (f64, f64),
    step: f64,
) -> Result<JointWater, Error> {
    let settings = NetworkSettings {
        limits: PairLimits {
            distance: 0.02,
            angle: 0.1,
        },
        residual_aperture,
        cell,
        under: None,
    };
    let solids: Vec<_> = blocks.iter().map(|block| block.solid.clone()).collect();
    let network = Network::new(&super::rocks(&solids), &settings);
    let flow = FlowSettings {
        water: Mixture {
            density: WATER,
            viscosity: VISCOSITY,
            ..Mixture::default()
        },
        roughness: None,
        inertia: false,
        gravity: Vector3::new(0.0, 0.0, -GRAVITY),
    };
    // The pressure holds at the top of the block.
    let mouth = MouthFront {
        pressure,
        region: [[-1.0, -1.0, HEIGHT - 0.01], [1.0, 1.0, HEIGHT + 0.01]],
        presses_on_blocks: presses,
    };
    JointWater::new(network, flow, vec![mouth], blocks, (0, step))
}

/// Returns the pressure at the top at which the lift of the whole base is the weight of the block \[Pa\].
fn threshold() -> f64 {
    (DENSITY - WATER) * GRAVITY * HEIGHT
}

#[test]
fn a_block_leaves_its_socket_by_the_law_of_its_film() {
    // The momentum of the block: F t = integral of (film + sides) over the rise + m V, with the film of a square,
    // 0.42173 mu L⁴/h³, and the side joints as one resistance in front of it.
    let (start, beside, more) = (2e-4_f64, 5e-3_f64, 1250.0);
    let force = more * SIDE * SIDE;
    let mass = DENSITY * SIDE * SIDE * HEIGHT;
    let sides = 4.0 * SIDE * beside.powi(3) / (12.0 * VISCOSITY * HEIGHT);
    let film = |gap: f64| {
        0.5 * 0.42173 * VISCOSITY * SIDE.powi(4) * (start.powi(-2) - gap.powi(-2))
            + SIDE.powi(4) / sides * (gap - start)
    };
    for (step, steps) in [(1e-3, 120), (2.5e-4, 480)] {
        let pressure = PressureHistory::Constant(threshold() + more);
        let rocks = socket(start, beside);
        let mut scene = Scene::new(&rocks, pressure, false, (1e-5, 0.01), step);
        for _ in 0..steps {
            scene.advance().unwrap();
        }
        let time = f64::from(steps) * step;
        let gap = start + scene.rise();
        let exact = (film(gap) + mass * scene.speed()) / force;
        println!(
            "step {step}: gap {gap:e} m after {time} s, {exact} s exact; mass error {:e}",
            scene.water.mass_error()
        );
        assert!(gap > 1.5 * start && (time / exact - 1.0).abs() < 0.01);
        assert!(scene.water.mass_error().abs() < 1e-10);
        let tilt = scene.particles.motion[0].spin.norm();
        assert!(tilt < 1e-9, "{tilt:e}");
    }
}

#[test]
fn a_block_stays_below_the_threshold_and_leaves_above_it() {
    // It rests on its base. Below the threshold the contact carries what the water leaves of the weight.
    for part in [0.99, 1.01] {
        let pressure = PressureHistory::Constant(part * threshold());
        let mut scene = Scene::new(&socket(0.0, 2e-3), pressure, false, (2e-4, 0.04), 4e-4);
        for _ in 0..1000 {
            scene.advance().unwrap();
        }
        let weight = DENSITY * SIDE * SIDE * HEIGHT * GRAVITY;
        let (_, [contact, _]) = scene.particles.block_motion(0).unwrap();
        println!(
            "{part} of the threshold: rise {:e} m, contact {} N of a weight of {weight} N",
            scene.rise(),
            contact.z
        );
        if part < 1.0 {
            let carried = 0.01 * threshold() * SIDE * SIDE;
            let sunk = carried / (STIFFNESS * SIDE * SIDE);
            assert!((contact.z / carried - 1.0).abs() < 1e-3);
            assert!((scene.rise() / sunk + 1.0).abs() < 1e-3);
            let load = scene.water.loads()[0].force.z;
            assert!((load + carried - weight).abs() < 1e-6 * weight);
        } else {
            assert!(scene.rise() > 1e-7 && contact.z == 0.0);
        }
        assert!(scene.water.mass_error().abs() < 1e-10);
    }
}

#[test]
fn without_a_film_a_block_moves_like_a_free_one() {
    // A wide joint far from its neighbours: the block falls with its submerged weight, and the step is exact.
    let pressure = PressureHistory::Constant(0.0);
    let rocks = [
        ([0.0, 0.0, 0.0], [SIDE, SIDE, HEIGHT], true),
        ([5.0, 5.0, 5.0], [5.1, 5.1, 5.1], false),
        ([5.0, 5.0, 5.101], [5.1, 5.1, 5.2], false),
    ];
    let mut scene = Scene::new(&rocks, pressure, true, (1e-5, 0.05), 1e-3);
    for _ in 0..100 {
        scene.advance().unwrap();
    }
    let exact = -0.5 * GRAVITY * (1.0 - WATER / DENSITY) * 0.1_f64.powi(2);
    println!("fall {:e} m, exact {exact:e} m", scene.rise());
    assert!((scene.rise() / exact - 1.0).abs() < 1e-10);
}

#[test]
fn a_block_parts_from_its_base_and_closes_again() {
    let rows = vec![
        [0.0, 0.0],
        [0.02, 4.0 * threshold()],
        [0.06, 4.0 * threshold()],
        [0.08, 0.0],
    ];
    let pressure = PressureHistory::Table(rows);
    let mut scene = Scene::new(&socket(0.0, 1e-3), pressure, false, (2e-4, 0.04), 4e-4);
    let mut highest = 0.0_f64;
    for _ in 0..4000 {
        scene.advance().unwrap();
        highest = highest.max(scene.rise());
    }
    let weight = (DENSITY - WATER) * SIDE * SIDE * HEIGHT * GRAVITY;
    let (_, [contact, _]) = scene.particles.block_motion(0).unwrap();
    println!(
        "highest {highest:e} m, at the end {:e} m, contact {} N of {weight} N; mass error {:e}",
        scene.rise(),
        contact.z,
        scene.water.mass_error()
    );
    assert!(highest > 5e-5 && scene.water.mass_error().abs() < 1e-10);
    assert!((contact.z / weight - 1.0).abs() < 1e-3);
    let sunk = weight / (STIFFNESS * SIDE * SIDE);
    assert!((scene.rise() / sunk + 1.0).abs() < 1e-3);
}

#[test]
fn a_block_is_thrown_out_of_its_socket() {
    // A pressure of a hundred times the weight, from closed faces, until the block has left.
    let weight = DENSITY * GRAVITY * HEIGHT;
    let pressure = PressureHistory::Constant(100.0 * weight);
    let mut scene = Scene::new(&socket(0.0, 2e-3), pressure, false, (1e-4, 0.02), 1e-4);
    let mut steps = 0;
    while scene.water.departures().is_empty() && steps < 4000 {
        scene.advance().unwrap();
        steps += 1;
    }
    let free = (2.0 * HEIGHT / (99.0 * GRAVITY)).sqrt();
    let left = scene.water.departures();
    println!(
        "left {left:?}, {free} s without friction; rise {} m, mass error {:e}",
        scene.rise(),
        scene.water.mass_error()
    );
    assert_eq!(left.len(), 1);
    assert!(left[0].time > free && left[0].time < 4.0 * free);
    assert!((scene.rise() / HEIGHT - 1.0).abs() < 0.2);
    assert!(scene.water.mass_error().abs() < 1e-10);
}

#[test]
fn a_state_restores_the_bits() {
    let pressure = PressureHistory::Constant(20.0 * threshold());
    let mut one = Scene::new(
        &socket(0.0, 2e-3),
        pressure.clone(),
        true,
        (1e-4, 0.02),
        1e-4,
    );
    for _ in 0..300 {
        one.advance().unwrap();
    }
    let mut other = Scene::new(&socket(0.0, 2e-3), pressure, true, (1e-4, 0.02), 1e-4);
    other.water.restore(&one.water.state(), 300).unwrap();
    assert_eq!(one.water.state(), other.water.state());
    assert_eq!(one.water.loads(), other.water.loads());
    // Solids and contacts are those of the first.
    std::mem::swap(&mut one.particles, &mut other.particles);
    std::mem::swap(&mut one.dem, &mut other.dem);
    let before = other.water.state();
    other.advance().unwrap();
    assert!(before != other.water.state() && other.step > 0.0);
}
