//! Poiseuille flow between two packings: prescribed, and computed with momentum exchange on discs.

use super::*;
use analysis::erosion_law::read_rows;
use base::units::LatticeUnits;
use case::Document;
use coupling::body_map::Rules;
use coupling::bounce_back::{BounceBack, BounceBackSettings};
use coupling::{Flow as _, FluidView};
use decomposition::SplitAxis;
use dem::space::PlaneSpace;
use dem::{Body, Kind, Motion, Particles, alone};
use lbm::boundary::{Flux, Patch, Ramp, pressure};
use lbm::collision::{Operator, trt};
use lbm::fluid::{Fluid, Models, Setup};
use lbm::lattice::VelocitySet;
use lbm::links::Scheme;
use nalgebra::Vector2;
use std::fs::{self, OpenOptions};
use std::io::Write as _;

/// Pressure difference, Pa, and its ramp, s.
const DROP: f64 = 0.02;
const RAMP: f64 = 0.02;
/// Spacing of the discs, m.
const PITCH: f64 = 2e-4;

/// Returns a box of 4 mm x 1.6 mm on a spacing of 40 um with a hole of 2.8 mm x 0.8 mm.
fn plan() -> Plan {
    let text = r#"{"title": "hole", "domain": {"size": [0.004, 0.0016], "spacing": 4e-5},
        "materials": {"soil": {"density": 2000}},
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": 1.1,
            "boundaries": [
                {"name": "inlet", "face": "x_min", "condition": {"pressure": {"value": 0.02,
                "ramp": {"duration": 0.02}}}},
                {"name": "outlet", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
        "grains": {"material": "soil", "initial": {"list": [{"position": [0.001, 0.0001], "radius": 1e-4}]}},
        "contact": {"cohesive_frictional": {"normal_stiffness": {"absolute": 1e3},
        "cohesion": {"per_diameter": 0.506}}},
        "coupling": {"bounce_back": {}},
        "regions": [{"name": "left", "box": {"from": [0, 0], "to": [0.0002, 0.0016]}, "action": {"remove": {}}},
            {"name": "out", "box": {"from": [0.0038, 0], "to": [0.004, 0.0016]}, "action": {"remove": {}}}],
        "time": {"end": 1},
        "analysis": {"erosion_law": {"hole": {"from": [0.0006, 0.0004], "to": [0.0034, 0.0012]}, "every": 0.01,
        "outlet": "out"}}}"#;
    Plan::prepare(Document::read(text, &[], Path::new(".")).unwrap()).unwrap()
}

/// Returns two rows of 14 discs on either side of the hole.
fn packing(radius: f64) -> Particles<PlaneSpace> {
    let mut particles = Particles::new();
    let mut id = 0;
    for y in [1e-4, 3e-4, 1.3e-3, 1.5e-3] {
        for column in 0..14_u32 {
            let mut body = Body::uniform::<PlaneSpace>(id, radius, 2000.0, 0);
            body.kind = Kind::Fixed;
            let motion = Motion {
                position: Vector2::new(7e-4 + f64::from(column) * PITCH, y),
                ..Motion::default()
            };
            particles.insert(body, motion);
            id += 1;
        }
    }
    particles
}

fn domain() -> Domain {
    Domain::serial(SplitAxis::X, 100, false)
}

/// Solid rows with Poiseuille flow between them.
struct Channel {
    units: LatticeUnits,
    lower: f64,
    upper: f64,
    gradient: f64,
}

impl Channel {
    fn new(plan: &Plan) -> Self {
        Self {
            units: plan.units.unwrap(),
            lower: 4e-4,
            upper: 1.2e-3,
            gradient: DROP / 2.8e-3,
        }
    }
    fn coordinate(&self, cell: usize) -> f64 {
        (real(cell) + 0.5) * self.units.spacing
    }
}

impl FluidView for Channel {
    fn units(&self) -> &LatticeUnits {
        &self.units
    }
    fn cells(&self) -> [usize; 3] {
        [100, 40, 1]
    }
    fn start(&self) -> [usize; 3] {
        [0; 3]
    }
    fn state(&self, cell: [usize; 3]) -> (f64, [f64; 3]) {
        let (x, y) = (self.coordinate(cell[0]), self.coordinate(cell[1]));
        let speed = (self.gradient / 2e-3 * (y - self.lower) * (self.upper - y)).max(0.0);
        let pressure = DROP - self.gradient * (x - 6e-4);
        (
            self.units.pressure_to_density_deviation(pressure),
            [self.units.velocity_to_lattice(speed), 0.0, 0.0],
        )
    }
    fn stress(&self, _: [usize; 3]) -> [[f64; 3]; 3] {
        [[0.0; 3]; 3]
    }
    fn body_at(&self, cell: [usize; 3]) -> Option<u64> {
        let y = self.coordinate(cell[1]);
        let inside = (15..85).contains(&cell[0]);
        (inside && !(self.lower..self.upper).contains(&y)).then_some(0)
    }
    fn patches(&self) -> Vec<String> {
        Vec::new()
    }
    fn fluxes(&self) -> Vec<Flux> {
        Vec::new()
    }
}

fn view<'a>(
    plan: &'a Plan,
    domain: &'a Domain,
    fluid: &'a dyn FluidView,
    particles: &'a Particles<PlaneSpace>,
    step: u64,
) -> StateView<'a, PlaneSpace> {
    StateView {
        plan,
        domain,
        fluid: Some(fluid),
        seepage: None,
        joints: None,
        averages: None,
        particles,
        dem: None,
        step,
        time: real(step) * plan.clock.time_step,
    }
}

fn records(folder: &Path) -> Vec<ErosionRecord> {
    read_rows(&folder.join("erosion.csv"), |row: &ErosionRecord| row.step).unwrap()
}

fn late(plan: &Plan) -> u64 {
    plan.clock.every(0.01).step(10)
}

#[test]
fn three_shear_stresses_agree_for_poiseuille_flow_between_packings() {
    let plan = plan();
    let (domain, fluid) = (domain(), Channel::new(&plan));
    let shear = DROP * 8e-4 / (2.0 * 2.8e-3);
    let mut particles = packing(0.9e-4);
    particles.allocate_fluid_loads();
    for k in 0..particles.owned() {
        // Every disc carries the pressure gradient of its square, those at the hole the shear as well.
        let y = particles.motion[k].position.y;
        let at_face = (2e-4..1.4e-3).contains(&y);
        let share = if at_face { shear * PITCH } else { 0.0 };
        particles.fluid[k].force.x = fluid.gradient * PITCH * PITCH + share;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = ErosionRecorder::create(&plan, folder.path(), &domain, None).unwrap();
    let step = late(&plan);
    for step in [0, 1, step / 10, step] {
        let view = view(&plan, &domain, &fluid, &particles, step);
        recorder
            .record_due(&view, &[], Vec::new(), f64::NAN)
            .unwrap();
    }
    let rows = records(folder.path());
    assert_eq!(
        rows.iter().map(|row| row.step).collect::<Vec<_>>(),
        [0, step / 10, step]
    );
    let row = rows[2];
    for (name, found) in [
        ("gradient", row.shear_gradient),
        ("balance", row.shear_balance),
        ("traction", row.shear_traction),
    ] {
        assert!((found / shear - 1.0).abs() < 0.02, "{name}: {row:?}");
    }
    assert!((row.lower_face - 4e-4).abs() < 1e-9 && (row.upper_face - 1.2e-3).abs() < 1e-9);
    // Two thirds of the peak velocity, within the error of the midpoint rule.
    let discharge = fluid.gradient / 12e-3 * 8e-4_f64.powi(3);
    assert!((row.discharge / discharge - 1.0).abs() < 5e-3, "{row:?}");
    let peak = fluid.gradient / 8e-3 * 8e-4_f64.powi(2);
    let lattice_velocity = peak * plan.clock.time_step / 4e-5;
    assert!(
        (row.lattice_velocity / lattice_velocity - 1.0).abs() < 1e-2,
        "{row:?}"
    );
    // About half-way through the ramp.
    let ramped = DROP * rows[1].time / RAMP;
    assert!((rows[1].pressure_difference - ramped).abs() < 1e-12 && ramped < 0.6 * DROP);
    assert!((row.pressure_difference - DROP).abs() < 1e-15);

    let summary = recorder.summary(&plan).unwrap().unwrap();
    let summary: ErosionSummary = serde_json::from_value(summary).unwrap();
    let mass = 56.0 * 2000.0 * std::f64::consts::PI * 0.9e-4_f64.powi(2);
    assert!((summary.initial_mass / mass - 1.0).abs() < 1e-12);
    assert!((summary.cohesion - 0.506).abs() < 1e-15 && (summary.ramp_end - RAMP).abs() < 1e-15);
    assert!(
        (summary.hole_width - 8e-4).abs() < 1e-15 && (summary.hole_length - 2.8e-3).abs() < 1e-15
    );
}

/// Compares the traction from the momentum exchange on discs with the other two measures of the same stress, which are
/// independent of it.
#[test]
fn traction_by_momentum_exchange_agrees_with_the_velocity_gradient() {
    let plan = plan();
    let units = plan.units.unwrap();
    let domain = domain();
    let patch = |name: &str, upper, value| Patch {
        name: name.into(),
        axis: 0,
        upper,
        range: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
        rule: Box::new(pressure::PressureLinks::new(
            0,
            Ramp::constant(units.pressure_to_density_deviation(value)),
        )),
    };
    let setup = Setup {
        patches: vec![patch("inlet", false, DROP), patch("outlet", true, 0.0)],
        ..Setup::new(
            Models::new(
                VelocitySet::D2Q9,
                Operator::Trt(trt::TrtParameters { magic: 3.0 / 16.0 }),
            ),
            1.1,
            [100, 40, 1],
        )
    };
    let settings = BounceBackSettings {
        scheme: Scheme::HalfWay,
        average: true,
        rules: Rules {
            interpolated: false,
            hydraulic_radius_factor: 0.8,
            first_grain: 0,
            narrow: None,
        },
        buoyancy: [0.0; 3],
    };
    let fluid = Fluid::<f64>::new(setup, &domain).unwrap();
    let mut flow = BounceBack::<PlaneSpace, f64>::new(fluid, units, [0.0; 3], settings);
    let mut particles = packing(1e-4);
    flow.update_bodies(&mut particles, &alone()).unwrap();
    for _ in 0..6000 {
        flow.advance(&mut particles, &alone()).unwrap();
        flow.update_bodies(&mut particles, &alone()).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = ErosionRecorder::create(&plan, folder.path(), &domain, None).unwrap();
    let view = view(&plan, &domain, &flow, &particles, late(&plan));
    recorder.record_due(&view, &[], Vec::new(), 0.0).unwrap();
    let row = records(folder.path())[0];
    println!("{row:#?}");
    // Rough faces are displaced by a fraction of a cell, and the chambers take part of the pressure difference.
    let ratio = row.shear_traction / row.shear_gradient;
    assert!((ratio - 1.0).abs() < 0.15, "{ratio} {row:?}");
    assert!(row.shear_balance > row.shear_traction, "{row:?}");
    assert!(row.shear_balance < 1.6 * row.shear_traction, "{row:?}");
}

fn departed(step: u64, id: u64, region: usize) -> DepartedGrain {
    DepartedGrain {
        at: [0.0; 3],
        region,
        grain: RemovedGrain {
            step,
            time: real(step),
            id,
            mass: 1e-4,
            radius: 1e-4,
            x: 3.9e-3,
            y: 8e-4,
            z: 0.0,
        },
    }
}

fn broken(step: u64, grain: u64, x: f64, y: f64) -> BondBreak<PlaneSpace> {
    BondBreak {
        step,
        time: 0.0,
        grain,
        other: grain.is_multiple_of(2).then_some(grain + 1),
        wall: (grain % 2 == 1).then_some(2),
        position: Vector2::new(x, y),
        mode: if grain == 4 {
            Failure::Shear
        } else {
            Failure::Tension
        },
        fluid_force: 0.0,
    }
}

#[test]
fn the_ledger_is_ordered_and_says_where_bonds_broke() {
    let plan = plan();
    let (domain, fluid, particles) = (domain(), Channel::new(&plan), packing(0.7e-4));
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = ErosionRecorder::create(&plan, folder.path(), &domain, None).unwrap();
    let breaks = vec![
        // Deep in the lower packing, more than two diameters behind the face.
        broken(12, 4, 2e-3, 0.05e-3),
        // At the upper face; against wall 2.
        broken(11, 7, 2e-3, 1.25e-3),
        broken(11, 2, 2e-3, 0.35e-3),
        // At the height of the hole, but in the outlet chamber.
        broken(12, 6, 3.9e-3, 8e-4),
    ];
    recorder
        .record_due(
            &view(&plan, &domain, &fluid, &particles, 1),
            &[],
            breaks,
            0.0,
        )
        .unwrap();
    recorder.flush(&domain).unwrap();
    let rows: Vec<BreakRow> =
        read_rows(&folder.path().join("bonds.csv"), |row: &BreakRow| row.id_a).unwrap();
    let seen: Vec<_> = rows
        .iter()
        .map(|row| (row.id_a, row.id_b, row.mode, row.place))
        .collect();
    let (tension, shear) = (BreakMode::Tension, BreakMode::Shear);
    let (inside, wall) = (BreakPlace::Inside, BreakPlace::HoleWall);
    assert_eq!(
        seen,
        [
            (2, 3, tension, wall),
            (7, u64::MAX - 2, tension, wall),
            (4, 5, shear, inside),
            (6, 7, tension, inside),
        ]
    );
}

/// Returns the step of half interval `n`, where two half intervals are the interval between rows.
fn half(plan: &Plan, n: u64) -> u64 {
    let every = plan.clock.every(0.01);
    every.step(n / 2) + (n % 2) * every.step(1) / 2
}

/// Runs half intervals `from..=to`; in each, a grain leaves through either region and a bond breaks.
fn run(recorder: &mut ErosionRecorder, plan: &Plan, from: u64, to: u64) {
    let (domain, fluid, particles) = (domain(), Channel::new(plan), packing(0.7e-4));
    for step in from..=to {
        let at = half(plan, step);
        let removed = [departed(at, 2 * step, 0), departed(at, 2 * step + 1, 1)];
        // The first at the lower face, the others deep inside.
        let y = if step == 0 { 4.1e-4 } else { 0.5e-4 };
        let breaks = vec![broken(step, 2 * step, 2e-3, y)];
        let view = view(plan, &domain, &fluid, &particles, at);
        recorder.record_due(&view, &removed, breaks, 1e-9).unwrap();
    }
}

#[test]
fn a_resumed_run_leaves_the_tables_of_a_straight_one() {
    let plan = plan();
    let domain = domain();
    let tables = |folder: &Path| {
        ["erosion.csv", "removed.csv", "bonds.csv"]
            .map(|name| fs::read_to_string(folder.join(name)).unwrap())
    };
    let straight = tempfile::tempdir().unwrap();
    let mut recorder = ErosionRecorder::create(&plan, straight.path(), &domain, None).unwrap();
    recorder.set_flow_age(0.125);
    run(&mut recorder, &plan, 0, 9);
    recorder.flush(&domain).unwrap();

    let resumed = tempfile::tempdir().unwrap();
    let mut first = ErosionRecorder::create(&plan, resumed.path(), &domain, None).unwrap();
    first.set_flow_age(0.125);
    run(&mut first, &plan, 0, 5);
    let saved = serde_json::to_string(&first.state(&domain).unwrap()).unwrap();
    run(&mut first, &plan, 6, 8);
    first.flush(&domain).unwrap();
    // Killed while writing.
    let mut file = OpenOptions::new()
        .append(true)
        .open(resumed.path().join("removed.csv"))
        .unwrap();
    file.write_all(b"1,0.5,7").unwrap();

    let at = half(&plan, 5);
    let mut second = ErosionRecorder::create(&plan, resumed.path(), &domain, Some(at)).unwrap();
    second.restore(serde_json::from_str(&saved).unwrap());
    let cut = tables(resumed.path());
    assert!(!cut[1].contains("\n1,0.5,7"), "{}", cut[1]);
    run(&mut second, &plan, 6, 9);
    second.flush(&domain).unwrap();
    assert_eq!(tables(resumed.path()), tables(straight.path()));
    assert_eq!(
        second.summary(&plan).unwrap(),
        recorder.summary(&plan).unwrap()
    );

    let rows = records(straight.path());
    let last = rows.last().unwrap();
    // Ten grains in ten half intervals; only those of the outlet count, the last row is that of the ninth.
    assert_eq!((rows.len(), last.eroded_grains), (5, 9));
    assert!((last.eroded_mass - 9e-4).abs() < 1e-15);
    assert_eq!((last.bonds_broken, last.bonds_broken_inside), (9, 8));
    // A tenth of the 1.9 g/m had left with the second grain, when two bonds were broken.
    assert!((last.face_share - 0.5).abs() < 1e-15, "{last:?}");
    assert!((rows[0].face_share - 1.0).abs() < 1e-15);
    let summary = recorder.summary(&plan).unwrap().unwrap();
    assert_eq!(summary["face_share"], 0.5);
    // No contacts, and no initial positions of the grains.
    assert!(summary["bonds_per_grain"].is_null() && summary["bulk_displacement"].is_null());
}

#[test]
fn the_bulk_is_what_started_deep_behind_the_present_faces() {
    let plan = plan();
    let (domain, fluid) = (domain(), Channel::new(&plan));
    // Two diameters are 0.16 mm: the outer rows are the bulk, but for the grains at their ends.
    let mut particles = packing(4e-5);
    particles.mark_start();
    for motion in &mut particles.motion {
        let y = motion.position.y;
        let of_bulk =
            !(2e-4..1.4e-3).contains(&y) && (7.6e-4..3.24e-3).contains(&motion.position.x);
        // A face grain may have gone anywhere, also into the bulk.
        motion.position += if of_bulk {
            Vector2::new(8e-6, -6e-6)
        } else {
            Vector2::new(0.0, 2e-4)
        };
    }
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = ErosionRecorder::create(&plan, folder.path(), &domain, None).unwrap();
    let view = view(&plan, &domain, &fluid, &particles, 0);
    recorder.record_due(&view, &[], Vec::new(), 0.0).unwrap();
    let row = records(folder.path())[0];
    // 10 um over 80 um.
    assert!((row.bulk_displacement - 0.125).abs() < 1e-9, "{row:?}");
    assert!(row.face_share.is_nan());
    let summary = recorder.summary(&plan).unwrap().unwrap();
    let found = summary["bulk_displacement"].as_f64().unwrap();
    assert_eq!(found.to_bits(), row.bulk_displacement.to_bits());
}

/// Checks that a bond which broke in the relaxation before the run has a row at step and time 0, before those of the
/// run, and does not count as broken by the erosion.
#[test]
fn bonds_that_broke_before_the_run_have_rows_at_time_0() {
    let plan = plan();
    let (domain, fluid, particles) = (domain(), Channel::new(&plan), packing(0.7e-4));
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = ErosionRecorder::create(&plan, folder.path(), &domain, None).unwrap();
    let early = [EarlyBreak {
        solid_step: 40,
        ids: [3, u64::MAX - 2],
        position: [2e-3_f64, 0.05e-3].map(f64::to_bits),
        shear: true,
    }];
    let at = |step| view(&plan, &domain, &fluid, &particles, step);
    recorder.note_early_breaks(&at(0), &early);
    recorder
        .record_due(&at(1), &[], vec![broken(12, 4, 2e-3, 0.05e-3)], 0.0)
        .unwrap();
    recorder.flush(&domain).unwrap();
    let path = folder.path().join("bonds.csv");
    let rows: Vec<BreakRow> = read_rows(&path, |row: &BreakRow| row.id_a).unwrap();
    let found: Vec<_> = rows
        .iter()
        .map(|row| (row.step, row.time.to_bits(), row.id_a, row.id_b, row.mode))
        .collect();
    assert_eq!(found[0], (0, 0, 3, u64::MAX - 2, BreakMode::Shear));
    assert_eq!((found.len(), found[1].0, found[1].2), (2, 1, 4));
    assert_eq!(recorder.broken().iter().sum::<u64>(), 1);
}
