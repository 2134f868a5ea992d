use super::*;
use approx::assert_relative_eq;
use base::units::LatticeUnits;
use case::Document;
use coupling::FluidView;
use decomposition::SplitAxis;
use dem::contact::Scaled;
use dem::contact::linear::{Linear, LinearParameters};
use dem::particles::{Body, Motion, Particles};
use dem::space::PlaneSpace;
use dem::{Dem, DemSettings, GrainDomain, Law, PairTable, Wall, alone};
use io::fields::read_column;
use lbm::boundary::Flux;
use nalgebra::Vector2;

/// Fluid that turns like a rigid body about the origin: u = w (-y, x), pressure linear in x; body 4 covers cell (1, 1).
struct Turning {
    units: LatticeUnits,
    cells: [usize; 3],
    patches: usize,
    fluxes: Vec<Flux>,
}

const RATE: f64 = 1e-3;
const SLOPE: f64 = 1e-4;

fn centre(i: usize) -> f64 {
    base::number::real(i) + 0.5
}

impl FluidView for Turning {
    fn units(&self) -> &LatticeUnits {
        &self.units
    }
    fn cells(&self) -> [usize; 3] {
        self.cells
    }
    fn start(&self) -> [usize; 3] {
        [0; 3]
    }
    fn state(&self, [x, y, _]: [usize; 3]) -> (f64, [f64; 3]) {
        let velocity = [-RATE * centre(y), RATE * centre(x), 0.0];
        (SLOPE * centre(x), velocity)
    }
    fn stress(&self, _: [usize; 3]) -> [[f64; 3]; 3] {
        [[0.0; 3]; 3]
    }
    fn body_at(&self, cell: [usize; 3]) -> Option<u64> {
        (cell == [1, 1, 0]).then_some(4)
    }
    fn patches(&self) -> Vec<String> {
        vec![String::new(); self.patches]
    }
    fn fluxes(&self) -> Vec<Flux> {
        self.fluxes.clone()
    }
}

const CASE: &str = r#"{
  "title": "turning",
  "domain": {"size": [6e-3, 4e-3], "spacing": 1e-3},
  "materials": {"glass": {"density": 2500}},
  "fluid": {"lattice_boltzmann": {
    "density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": 0.8,
    "boundaries": [
      {"name": "in", "face": "x_min", "condition": {"pressure": {"value": 1e-4}}},
      {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}},
      {"name": "top", "face": "y_max", "condition": {"free_slip": {}}}
    ]}},
  "bodies": [{"name": "ball", "shape": {"disc": {"radius": 2e-3}}, "position": [3.2e-3, 2e-3], "material": "glass",
  "motion": {"fixed": {}}}],
  "coupling": {"bounce_back": {}},
  "time": {"end": 10},
  "output": {
    "fluid": {"every": 1.0, "fields": ["velocity", "pressure", "density", "vorticity", "solid"], "precision": "f64"},
    "grains": {"every": 1.0}, "contacts": {"every": 1.0}
  },
  "probes": [
    {"name": "centre", "every": 1.0, "at": {"point": {"position": [0, 4e-3]}}},
    {"name": "middle", "every": 1.0, "at": {"line": {"from": [1e-3, 2e-3], "to": [5e-3, 2e-3], "points": 5}}},
    {"name": "cut", "every": 1.0, "at": {"plane": {"axis": "x", "position": 2e-3}}},
    {"name": "ball", "every": 1.0, "at": {"body": {"name": "ball"}}},
    {"name": "inlet", "every": 1.0, "at": {"wall": {"face": "x_min"}}}
  ]
}"#;

fn plan() -> Plan {
    let document = Document::read(CASE, &[], Path::new(".")).unwrap();
    Plan::prepare(document).unwrap_or_else(|problems| panic!("{problems:#?}"))
}

/// Returns the ball (id 0) and two grains whose only contacts are overlaps with each other; grain 2 also touches the
/// floor.
fn solids() -> (Particles<PlaneSpace>, Dem<PlaneSpace>) {
    let law = Law::Linear(Linear {
        parameters: PairTable::uniform(
            1,
            LinearParameters {
                normal_stiffness: Scaled::Absolute(1e3),
                stiffness_ratio: 1.0,
                friction: 0.0,
                normal_damping_ratio: 0.0,
                shear_damping_ratio: 0.0,
                attraction: false,
            },
        ),
    });
    let region = GrainDomain::closed(Vector2::zeros(), Vector2::new(6e-3, 4e-3), 1e-3);
    let floor = Wall::new(Vector2::zeros(), Vector2::new(0.0, 1.0), 0);
    let mut dem = Dem::new(law, DemSettings::new(region, 1e-6, 1e-4), vec![floor]).unwrap();
    let mut particles = Particles::new();
    for (id, x, y) in [(0, 3.2e-3, 1.5e-3), (2, 1e-3, 0.49e-3), (1, 1.9e-3, 0.6e-3)] {
        let motion = Motion {
            position: Vector2::new(x, y),
            velocity: Vector2::new(0.0, 0.0),
            spin: 3.0,
        };
        particles.insert(Body::uniform::<PlaneSpace>(id, 5e-4, 2500.0, 0), motion);
    }
    dem.prepare(&mut particles, &alone()).unwrap();
    particles.allocate_fluid_loads();
    particles.fluid[0].force = Vector2::new(1.0, -2.0);
    particles.fluid[0].torque = 7.0;
    (particles, dem)
}

struct Run {
    plan: Plan,
    domain: Domain,
    fluid: Turning,
    particles: Particles<PlaneSpace>,
    dem: Dem<PlaneSpace>,
    folder: tempfile::TempDir,
}

impl Run {
    fn new() -> Self {
        let plan = plan();
        let (particles, dem) = solids();
        let patches = plan.scene.flow.as_ref().unwrap().patches().count() + 6;
        Self {
            domain: Domain::serial(SplitAxis::X, 6, false),
            fluid: Turning {
                units: plan.units.unwrap(),
                cells: [6, 4, 1],
                patches,
                fluxes: vec![Flux::default(); patches],
            },
            particles,
            dem,
            plan,
            folder: tempfile::tempdir().unwrap(),
        }
    }

    fn outputs(&self, resumed_at: Option<u64>) -> Outputs {
        let provenance = vec![("version".to_owned(), "1".to_owned())];
        let (plan, folder) = (&self.plan, self.folder.path());
        Outputs::create(plan, folder, provenance, &self.domain, resumed_at).unwrap()
    }

    fn view(&self, step: u64) -> StateView<'_, PlaneSpace> {
        StateView {
            plan: &self.plan,
            domain: &self.domain,
            fluid: Some(&self.fluid),
            seepage: None,
            joints: None,
            averages: None,
            particles: &self.particles,
            dem: Some(&self.dem),
            step,
            time: base::number::real(step) * self.plan.clock.time_step,
        }
    }

    fn advance(&self, outputs: &mut Outputs, steps: std::ops::RangeInclusive<u64>) {
        for step in steps {
            outputs.write_due(&self.view(step)).unwrap();
        }
    }

    fn column(&self, file: &str, name: &str) -> Vec<f64> {
        read_column(&self.folder.path().join(file), name)
            .unwrap()
            .values
    }

    fn rows(&self, probe: &str) -> io::table::Rows {
        io::table::read(&self.folder.path().join(format!("probe_{probe}.csv"))).unwrap()
    }
}

#[test]
fn fields_are_si_and_vorticity_reaches_the_walls() {
    let run = Run::new();
    let units = run.fluid.units;
    run.advance(&mut run.outputs(None), 0..=0);
    let file = "fluid_000000000.vtkhdf";
    let vorticity = run.column(file, "vorticity");
    assert_eq!(vorticity.len(), 24);
    for w in vorticity {
        assert_relative_eq!(w, 2.0 * RATE / units.time_step, max_relative = 1e-9);
    }
    let velocity = run.column(file, "velocity");
    // Cell (2, 1).
    let k = 3 * (6 + 2);
    assert_relative_eq!(
        velocity[k],
        -RATE * 1.5 * units.velocity_scale(),
        max_relative = 1e-12
    );
    assert_relative_eq!(
        velocity[k + 1],
        RATE * 2.5 * units.velocity_scale(),
        max_relative = 1e-12
    );
    let pressure = run.column(file, "pressure");
    let scale = 1000.0 * units.velocity_scale().powi(2) / 3.0;
    assert_relative_eq!(pressure[8], SLOPE * 2.5 * scale, max_relative = 1e-12);
    assert_relative_eq!(
        run.column(file, "density")[8],
        1000.0 * (1.0 + SLOPE * 2.5),
        max_relative = 1e-12
    );
    let solid = run.column(file, "solid");
    let body = run.column(file, "body");
    assert_eq!((solid.iter().sum::<f64>(), solid[7]), (1.0, 1.0));
    assert_eq!((body[7], body[6]), (4.0, -1.0));
}

#[test]
fn grains_are_sorted_and_contacts_join_centres() {
    let run = Run::new();
    run.advance(&mut run.outputs(None), 0..=0);
    let file = "grains_000000000.vtkhdf";
    assert_eq!(run.column(file, "id"), [0.0, 1.0, 2.0]);
    let position = run.column(file, "position");
    assert_eq!(position[3..6], [1.9e-3, 0.6e-3, 0.0]);
    assert_eq!(run.column(file, "angular_velocity")[..3], [0.0, 0.0, 3.0]);
    assert_eq!(run.column(file, "fluid_force")[..3], [1.0, -2.0, 0.0]);
    let file = "contacts_000000000.vtkhdf";
    assert_eq!(run.column(file, "grain"), [1.0, 2.0]);
    assert_eq!(run.column(file, "other"), [2.0, -1.0]);
    assert_eq!(run.column(file, "wall"), [-1.0, 0.0]);
    let overlap = run.column(file, "overlap");
    let distance = 0.9e-3_f64.hypot(0.11e-3);
    assert_relative_eq!(overlap[0], 1e-3 - distance, max_relative = 1e-9);
    assert_relative_eq!(overlap[1], 1e-5, max_relative = 1e-9);
    let force = run.column(file, "normal_force");
    assert_relative_eq!(force[0], 1e3 * overlap[0], max_relative = 1e-12);
    let ends = run.column(file, "position");
    for (found, expected) in ends.iter().zip([
        1.9e-3, 0.6e-3, 0.0, 1e-3, 0.49e-3, 0.0, 1e-3, 0.49e-3, 0.0, 1e-3, -0.5e-5, 0.0,
    ]) {
        assert_relative_eq!(*found, expected, epsilon = 1e-15);
    }
}

#[test]
fn probes_measure_what_is_there() {
    let mut run = Run::new();
    let units = run.fluid.units;
    // The inlet is the first patch. Without any normal force it lacks the reference.
    run.fluid.fluxes[0] = Flux {
        force: [0, 1 << 50, 0],
        mass: 1 << 52,
    };
    let mut outputs = run.outputs(None);
    run.advance(&mut outputs, 0..=1);
    let speed = units.velocity_scale();
    let pressure = units.pressure_scale() / 3.0;

    let rows = run.rows("centre");
    assert_eq!(rows.steps, [0]);
    // Continued to the corner of the domain (0, 4 cells), where the velocity is w (-4, 0) and the pressure 0.
    assert_relative_eq!(rows.values[0][1], -4.0 * RATE * speed, max_relative = 1e-9);
    assert_relative_eq!(rows.values[0][2], 0.0, epsilon = 1e-15);
    assert_relative_eq!(rows.values[0][4], 0.0, epsilon = 1e-9);

    let rows = run.rows("middle");
    assert_eq!(rows.steps, [0; 5]);
    for (n, row) in rows.values.iter().enumerate() {
        let x = 1.0 + base::number::real(n);
        assert_relative_eq!(row[1], 1e-3 * (x - 1.0), epsilon = 1e-12);
        assert_relative_eq!(row[2], 1e-3 * x, max_relative = 1e-12);
        assert_relative_eq!(row[5], -2.0 * RATE * speed, max_relative = 1e-9);
        assert_relative_eq!(row[6], x * RATE * speed, max_relative = 1e-9);
        assert_relative_eq!(row[8], x * SLOPE * pressure, max_relative = 1e-9);
    }

    // Half-way between two planes of cells, of which one cell in eight is covered.
    let rows = run.rows("cut");
    let row = &rows.values[0];
    let discharge = -RATE * speed * 1e-3 * (8.0 - 0.5 * 1.5);
    assert_relative_eq!(row[1], discharge, max_relative = 1e-9);
    assert_relative_eq!(row[2], discharge / (3.5 * 1e-3), max_relative = 1e-9);
    assert_relative_eq!(
        row[5],
        pressure * SLOPE * (4.0 * 1.5 + 4.0 * 2.5 - 1.5) / 7.0,
        max_relative = 1e-9
    );
    assert_relative_eq!(
        row[6],
        RATE * speed * 3.5_f64.hypot(2.5),
        max_relative = 1e-9
    );
    assert_relative_eq!(row[7], 7.0 / 8.0, max_relative = 1e-12);

    let rows = run.rows("ball");
    let row = &rows.values[0];
    assert_eq!(row[1..4], [3.2e-3, 1.5e-3, 0.0]);
    assert_eq!((row[9], row[11], row[12], row[16]), (3.0, 1.0, -2.0, 7.0));

    // Nothing has crossed a face at step 0.
    assert_eq!(run.rows("inlet").steps, [] as [u64; 0]);
    let every = run.plan.clock.every(1.0).step(1);
    outputs.write_due(&run.view(every)).unwrap();
    let rows = run.rows("inlet");
    let row = &rows.values[0];
    // Four links leave straight, four upwards and four downwards. Those of the corners press along y on the walls.
    let force = [48.0 / 36.0, 1.0 / 64.0].map(|f| units.force_to_si(f));
    assert_relative_eq!(row[1], force[0], max_relative = 1e-12);
    assert_relative_eq!(row[2], force[1], max_relative = 1e-12);
    assert_relative_eq!(row[4], -force[0], max_relative = 1e-12);
    assert_relative_eq!(row[7], force[1].abs() / 4e-3, max_relative = 1e-12);
    assert_relative_eq!(
        row[8],
        2.0_f64.powi(-4) * units.mass_scale() / units.time_step,
        max_relative = 1e-12
    );
}

#[test]
fn outputs_come_when_due_and_go_on_after_a_restart() {
    let run = Run::new();
    let at = |event| run.plan.clock.every(1.0).step(event);
    let every = at(1);
    assert!(every > 2);
    let mut outputs = run.outputs(None);
    assert_eq!(outputs.next_due(), 0);
    run.advance(&mut outputs, 0..=2 * every + 1);
    assert_eq!(outputs.next_due(), at(3));
    assert_eq!(run.rows("ball").steps, [0, every, 2 * every]);
    outputs.write_all_now(&run.view(2 * every + 1)).unwrap();
    let there = |step: u64| {
        run.folder
            .path()
            .join(format!("fluid_{step:09}.vtkhdf"))
            .exists()
    };
    assert!(there(2 * every) && there(2 * every + 1) && !there(1));
    assert_eq!(run.rows("ball").steps, [0, every, 2 * every, 2 * every + 1]);

    // The run is extended: its previous end has no effect on the rows.
    let mut outputs = run.outputs(Some(2 * every + 1));
    outputs.write_all_now(&run.view(2 * every + 1)).unwrap();
    assert_eq!(run.rows("ball").steps, [0, every, 2 * every, 2 * every + 1]);
    outputs.drop_end(2 * every + 1, &run.domain).unwrap();
    assert!(there(2 * every) && !there(2 * every + 1));
    assert_eq!(run.rows("ball").steps, [0, every, 2 * every]);
    assert_eq!(run.rows("middle").steps.len(), 15);
    outputs.write_all_now(&run.view(2 * every + 1)).unwrap();
    let mut outputs = run.outputs(Some(2 * every));
    outputs.drop_end(2 * every, &run.domain).unwrap();
    assert_eq!(run.rows("ball").steps, [0, every, 2 * every]);

    // After a return to the first interval, later rows are removed, and written again once.
    let mut outputs = run.outputs(Some(every));
    assert!(there(every) && !there(2 * every) && !there(2 * every + 1));
    assert_eq!(outputs.next_due(), 2 * every);
    run.advance(&mut outputs, every..=2 * every);
    assert_eq!(run.rows("ball").steps, [0, every, 2 * every]);
    assert_eq!(run.rows("middle").steps.len(), 15);
    outputs.sync(&run.domain).unwrap();

    // A sample torn by the end of the run is taken again.
    let path = run.folder.path().join("probe_middle.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    let last = text.trim_end().rfind('\n').unwrap();
    std::fs::write(&path, &text[..=last]).unwrap();
    let mut outputs = run.outputs(Some(2 * every));
    assert_eq!(outputs.next_due(), 2 * every);
    run.advance(&mut outputs, 2 * every..=2 * every);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    assert_eq!(run.rows("ball").steps, [0, every, 2 * every]);
}

#[test]
fn info_describes_what_was_written() {
    let run = Run::new();
    run.advance(&mut run.outputs(None), 0..=0);
    let folder = run.folder.path();
    let text = info::info(folder, false).unwrap();
    assert!(
        text.contains("fluid.xmf") && text.contains("probe_ball.csv"),
        "{text}"
    );
    let all: serde_json::Value = serde_json::from_str(&info::info(folder, true).unwrap()).unwrap();
    assert_eq!(all["series"]["grains.xmf"]["outputs"], 1);
    assert_eq!(all["tables"]["probe_middle.csv"]["rows"], 5);
    let file = info::info(&folder.join("fluid_000000000.vtkhdf"), false).unwrap();
    assert!(
        file.contains("[m/s]") && file.contains("ImageData"),
        "{file}"
    );
    assert!(file.contains("version"), "{file}");
    std::fs::write(folder.join("checkpoint_000000001.json"), "{}").unwrap();
    let damaged = info::info(&folder.join("checkpoint_000000001.json"), false).unwrap();
    assert!(damaged.contains("false"), "{damaged}");
    let missing = info::info(&folder.join("nothing.xmf"), false);
    assert!(matches!(missing, Err(Error::Io(_))));
}
