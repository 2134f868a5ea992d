//! A boundary requires one file and one line: the toy is its file and its line in the list below.

#![allow(unreachable_pub, reason = "a list of models makes public items")]

use super::*;
use crate::collision::{Operator, bgk};
use crate::fluid::{Fluid, Models, Setup};
use crate::lattice::VelocitySet;
use base::error::Remedy;
use base::geometry::Face;
use decomposition::{Domain, SplitAxis};

family! {
    dispatch each_toy;
    /// Boundaries of this test.
    #[derive(Debug, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    #[schemars(transform = describe_choices)]
    enum Toys: dyn BoundaryModel {
        toy: Toy(Toy),
    }
}

const CELLS: [usize; 3] = [6, 5, 1];

fn site(path: &str) -> Site<'_> {
    Site {
        path,
        face: Face::XMax,
        dimension: 2,
        spacing: 1.0,
        cells: CELLS,
        periodic: [false, false, true],
        walls: [[true; 2]; 3],
    }
}

fn read(text: &str) -> Result<Toys, serde_json::Error> {
    serde_json::from_str(text)
}

/// Collector of the paths of all findings.
#[derive(Default)]
struct Paths(Vec<String>);

impl Report for Paths {
    fn error(&mut self, path: &str, _: String, _: Remedy) {
        self.0.push(path.into());
    }

    fn unknown_material(&mut self, path: &str, _: &str, _: &[&str]) {
        self.0.push(path.into());
    }
}

/// Returns the boundary of a text and the paths of its findings.
fn resolved(text: &str) -> (Toys, Vec<String>) {
    let no_table = |_: &std::path::Path| Err("there is no table".to_owned());
    let mut paths = Paths::default();
    let mut toy = read(text).unwrap();
    let site = site("boundaries[0].condition.toy");
    each_toy!(&mut toy, toy => toy.resolve(&site, &no_table, &mut paths));
    (toy, paths.0)
}

#[test]
fn a_boundary_is_read_and_checked_by_its_line() {
    assert!(read(r#"{"toy": {"returned": 0.5, "magic": 1}}"#).is_err());
    let (toy, findings) = resolved(r#"{"toy": {"returned": 0.5}}"#);
    assert_eq!(findings, Vec::<String>::new());
    assert_eq!(
        serde_json::to_string(&toy).unwrap(),
        r#"{"toy":{"returned":0.5}}"#
    );
    assert_eq!(toy.name(), "toy");
    assert!(toy.model().passes_water() && toy.model().pressure().is_none());
    let (_, findings) = resolved(r#"{"toy": {"returned": 2}}"#);
    assert_eq!(findings, ["boundaries[0].condition.toy.returned"]);
}

/// Checks that the schema names each boundary and describes it by the documentation of its parameters.
#[test]
fn the_schema_takes_the_texts_of_the_boundaries() {
    let schema = schemars::schema_for!(Toys).to_value();
    let choice = &schema["oneOf"][0];
    assert_eq!(
        choice["description"],
        "Boundary of this test, which returns a fraction of each population."
    );
    assert_eq!(
        choice["properties"]["toy"]["properties"]["returned"]["description"],
        "Returned fraction r, without unit."
    );
}

/// Checks leakage from a box of fluid above its reference density: the flux through the boundary of this test equals
/// the loss of mass, so that no water leaves through other faces.
fn leak<S: Stored>(returned: f64, tolerance: f64) -> f64 {
    let (toy, _) = resolved(&format!(r#"{{"toy": {{"returned": {returned}}}}}"#));
    let place = Place {
        site: site("boundaries[0].condition.toy"),
        from: [0, 1, 0],
        to: [1, 4, 1],
        ends: [[0.0, 1.0], [1.0, 4.0], [0.0, 1.0]],
        openings: &[],
        bodies_move: false,
    };
    let units = LatticeUnits {
        spacing: 1.0,
        time_step: 1.0,
        density: 1.0,
        dimension: 2,
    };
    let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
    let setup = Setup::<S> {
        periodic: [false, false, true],
        patches: vec![Patch {
            name: "toy".into(),
            axis: 0,
            upper: true,
            range: [everywhere, [1.0, 4.0], everywhere],
            rule: each_toy!(&toy, toy => toy.rule(&place, &units)).unwrap(),
        }],
        ..Setup::new(
            Models::new(VelocitySet::D2Q9, Operator::Bgk(bgk::BgkParameters {})),
            0.8,
            CELLS,
        )
    };
    let mut fluid = Fluid::new(setup, &Domain::serial(SplitAxis::X, CELLS[0], false)).unwrap();
    fluid.initialise(&|_: [f64; 3]| (0.01, [0.0; 3]));
    let mass = |fluid: &Fluid<S>| {
        let cells = fluid.populations().interior();
        let masses = cells.map(|(_, cell)| fluid.populations().moments(cell).0);
        masses.sum::<f64>()
    };
    let begun = mass(&fluid);
    for _ in 0..5 {
        let before = mass(&fluid);
        fluid.advance();
        let fluxes = fluid.fluxes();
        let lost = from_quanta(fluxes[0].mass);
        assert!((before - mass(&fluid) - lost).abs() < tolerance);
        assert!(fluxes[1..].iter().all(|flux| flux.mass == 0));
        let mut masses = Vec::new();
        fluid.mass_through(|_| true, &mut masses);
        assert_eq!(masses[0], fluxes[0].mass);
    }
    begun - mass(&fluid)
}

#[test]
fn a_boundary_acts_in_the_fluid_by_its_line() {
    assert!(leak::<f64>(0.5, 1e-15) > 1e-3);
    assert!(leak::<f32>(0.5, 1e-7) > 1e-3);
    assert!(leak::<f64>(1.0, 1e-15).abs() < 1e-15);
}

/// Checks a jet from the middle of a face, and outflow through the sides: the flow is symmetric, and the jet has the
/// velocity of its cells for any surroundings.
#[test]
fn a_patch_is_the_same_at_both_of_its_ends() {
    const WIDE: [usize; 3] = [20, 12, 1];
    let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
    let patch = |name: &str, axis, upper, along, rule| Patch::<f64> {
        name: name.into(),
        axis,
        upper,
        range: [along, everywhere, everywhere],
        rule,
    };
    let drop = |density| Ramp::constant(density);
    for surroundings in ["walls", "symmetry", "pressure"] {
        let mut patches = Vec::new();
        match surroundings {
            "symmetry" => patches.push(patch(
                "top",
                1,
                true,
                everywhere,
                Box::<free_slip::FreeSlipLinks>::default() as Box<dyn Rule<f64>>,
            )),
            "pressure" => patches.push(patch(
                "top",
                1,
                true,
                everywhere,
                Box::new(pressure::PressureLinks::new(1, drop(0.0))),
            )),
            _ => {}
        }
        let jet = velocity::VelocityLinks::uniform([0.0, -0.05, 0.0]);
        patches.push(patch("jet", 1, true, [7.0, 13.0], Box::new(jet)));
        for upper in [false, true] {
            let outlet = pressure::PressureLinks::new(0, drop(0.0));
            patches.push(patch("side", 0, upper, everywhere, Box::new(outlet)));
        }
        let drain = pressure::PressureLinks::new(1, drop(-1e-3));
        patches.push(patch("drain", 1, false, [8.0, 12.0], Box::new(drain)));
        let setup = Setup::<f64> {
            periodic: [false, false, true],
            patches,
            ..Setup::new(
                Models::new(VelocitySet::D2Q9, Operator::Bgk(bgk::BgkParameters {})),
                0.8,
                WIDE,
            )
        };
        let mut fluid = Fluid::new(setup, &Domain::serial(SplitAxis::X, WIDE[0], false)).unwrap();
        fluid.initialise(&|_: [f64; 3]| (0.0, [0.0; 3]));
        for _ in 0..200 {
            fluid.advance();
        }
        let populations = fluid.populations();
        let mut fastest = 0.0_f64;
        for ([x, y, _], cell) in populations.interior() {
            let mirrored = [(WIDE[0] - 1 - x).cast_signed(), y.cast_signed(), 0];
            let other = populations.cell(mirrored);
            let ((here, u), (there, v)) = (populations.moments(cell), populations.moments(other));
            fastest = fastest.max(u[1].abs());
            let apart = (here - there)
                .abs()
                .max((u[0] + v[0]).abs())
                .max((u[1] - v[1]).abs());
            assert!(apart < 1e-14, "{surroundings} {x} {y}: {apart}");
        }
        assert!(fastest > 0.04, "{surroundings}: {fastest}");
        let into = |names: &[&str]| {
            let named = fluid.boundaries().names().zip(fluid.fluxes());
            let named = named.filter(|(name, _)| names.contains(name));
            -named.map(|(_, flux)| from_quanta(flux.mass)).sum::<f64>()
        };
        // Six cells, of which only those next to water at an imposed pressure also exchange water elsewhere.
        if surroundings != "pressure" {
            approx::assert_relative_eq!(into(&["jet"]), 6.0 * 0.05, max_relative = 1e-12);
        }
    }
}
