use super::*;
use base::number::real;

fn plan(text: &str, set: &[&str]) -> Plan {
    let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
    Document::read(text, &set, Path::new("."))
        .and_then(Plan::prepare)
        .unwrap()
}

fn example(name: &str, set: &[&str]) -> Plan {
    plan(case::examples::find(name).unwrap().text, set)
}

/// Returns the plan of a member.
fn planned(member: &Member) -> Plan {
    plan(&member.prepared.as_ref().unwrap().text, &[])
}

#[test]
fn what_the_program_chose_is_stated_on_the_same_cells() {
    // All settings of the flow are chosen automatically.
    for name in ["first-flow", "settling", "piping", "fissure-sand"] {
        let Some(found) = case::examples::find(name) else {
            continue;
        };
        let own = plan(found.text, &[]);
        let stated = grids::with_choices_stated(&own).unwrap();
        let again = plan(&stated.to_string(), &[]);
        assert_eq!(again.scene.grid, own.scene.grid, "{name}");
        assert_eq!(again.scene.contact, own.scene.contact, "{name}");
        assert_eq!(again.scene.coupling.is_some(), own.scene.coupling.is_some());
        assert_eq!(
            again.clock.solid_steps_per_step,
            own.clock.solid_steps_per_step
        );
        if let (Some(a), Some(b)) = (&again.scene.flow, &own.scene.flow) {
            assert_eq!(a.models, b.models);
            assert_eq!(a.storage, b.storage);
            approx::assert_relative_eq!(a.time_step, b.time_step, max_relative = 1e-12);
        }
    }
}

#[test]
fn coarser_grids_keep_the_relaxation_time_and_the_end() {
    let own = example("settling-disc", &[]);
    let members = Members::for_case(&own, false, false, false).unwrap();
    assert_eq!(members.scaling, Scaling::Diffusive);
    assert_eq!(members.grids.len(), 3);
    let flow = own.scene.flow.as_ref().unwrap();
    for (ratio, place) in &members.grids[1..] {
        let coarse = planned(&members.list[*place]);
        let steps = real(coarse.clock.steps);
        approx::assert_relative_eq!(
            coarse.scene.flow.as_ref().unwrap().relaxation_time - 0.5,
            flow.relaxation_time - 0.5,
            max_relative = 0.6 / steps
        );
        approx::assert_relative_eq!(
            steps * coarse.clock.time_step,
            real(own.clock.steps) * own.clock.time_step,
            max_relative = 1e-12
        );
        approx::assert_relative_eq!(coarse.scene.grid.spacing, own.scene.grid.spacing * ratio);
    }
    // A tenth of the case where its disc allows, a fifth here by cells and steps: the coarsest grid has to resolve it.
    // The map of the disc falls with the spacing alone. In so long a run the start counts little.
    let long = example("settling-disc", &["time.end=60", "output={}"]);
    let members = Members::for_case(&long, false, false, false).unwrap();
    let (costs, sum) = members.costs();
    // The cost of the cells falls with the fourth power of the ratio in this scaling, that of links and of the map of
    // the disc with the third: the ratios of 1.57 and 2.5 leave between 0.19 and 0.32 of the run of the case. The start
    // of the program and the steps of the disc, of which its contacts ask for the same number on every grid, cost the
    // same on all grids and do not depend on the cells.
    let alike = |place: &usize| {
        let seconds = planned(&members.list[*place]).estimate.seconds;
        seconds.start_and_end + seconds.grains
    };
    let alike: f64 = members.grids[1..].iter().map(|(_, n)| alike(n)).sum();
    assert!(sum - alike < 1.25 * costs[0].1, "{costs:?}, {alike} s");
    assert!(members.cost_lines().contains("times the run of the case"));
}

/// Flow that is too fast for larger cells under diffusive scaling.
const FAST: &str = r#"{
    "domain": {"size": [0.02, 0.02], "spacing": 0.001, "periodic": ["x"]},
    "fluid": {"lattice_boltzmann": {
        "density": 1000, "kinematic_viscosity": 1e-4, "reference_velocity": 0.5, "lattice_velocity": 0.2,
        "boundaries": [{"name": "lid", "face": "y_max", "condition": {"moving_wall": {"velocity": [0.5, 0]}}}]}},
    "time": {"end": 0.1}
}"#;

#[test]
fn fast_flow_keeps_its_lattice_velocity_and_halves_it_once() {
    let own = plan(FAST, &[]);
    let members = Members::for_case(&own, false, true, false).unwrap();
    assert_eq!(members.scaling, Scaling::Acoustic);
    let coarse = planned(&members.list[members.comparison]);
    let velocity = |plan: &Plan| plan.clock.time_step / plan.scene.grid.spacing;
    approx::assert_relative_eq!(velocity(&coarse), velocity(&own), max_relative = 0.02);
    let (setting, place) = &members.settings[0];
    assert_eq!(setting.name, "lattice velocity");
    let slow = planned(&members.list[*place]);
    approx::assert_relative_eq!(velocity(&slow), 0.5 * velocity(&own), max_relative = 0.02);
}

/// Seepage through loose grains.
const SEEPAGE: &str = r#"{
    "domain": {"size": [0.02, 0.02, 0.04], "spacing": 0.01}, "gravity": [0, 0, -9.81],
    "materials": {"sand": {"density": 2650}},
    "fluid": {"darcy": {"density": 1000, "viscosity": 0.001, "resistance": "kozeny_carman", "coupling_interval": 40,
        "boundaries": [
            {"name": "in", "face": "z_min", "condition": {"pressure": {"value": 500}}},
            {"name": "out", "face": "z_max", "condition": {"pressure": {"value": 0}}}]}},
    "grains": {"material": "sand", "initial": {"list": [
        {"position": [0.005, 0.005, 0.003], "radius": 0.002}, {"position": [0.015, 0.015, 0.003], "radius": 0.001}]}},
    "contact": {"linear": {"normal_stiffness": {"absolute": 1e4}, "pairs": [
        {"materials": ["sand", "sand"], "normal_stiffness": {"absolute": 2e4}}]}},
    "box_walls": ["z_min"], "box_wall_material": "sand",
    "time": {"end": 0.01}
}"#;

#[test]
fn seepage_has_one_grid_and_its_settings_one_run_each() {
    let own = plan(SEEPAGE, &[]);
    let members = Members::for_case(&own, false, true, false).unwrap();
    assert_eq!((members.grids.len(), members.comparison), (1, 0));
    let names: Vec<&str> = members.settings.iter().map(|(s, _)| s.name).collect();
    let expected = [
        "contact stiffness",
        "solid time step",
        "coupling interval",
        "law of resistance",
    ];
    // Half a cell is 5 mm, less than no grain: the cells can be halved too.
    assert_eq!(names.len(), expected.len() + 1);
    assert!(
        expected.iter().all(|name| names.contains(name)),
        "{names:?}"
    );
    for (setting, place) in &members.settings {
        assert!(members.list[*place].prepared.is_some(), "{}", setting.name);
        let other = planned(&members.list[*place]);
        let coupled = |plan: &Plan| plan.clock.time_step / own.clock.time_step;
        match setting.name {
            "contact stiffness" => {
                assert_eq!(
                    setting.case["contact"]["linear"]["pairs"][0]["normal_stiffness"]["absolute"],
                    8e4
                );
                approx::assert_relative_eq!(coupled(&other), 1.0, max_relative = 1e-9);
            }
            "solid time step" => {
                approx::assert_relative_eq!(
                    other.clock.solid_time_step,
                    0.5 * own.clock.solid_time_step
                );
                approx::assert_relative_eq!(coupled(&other), 1.0, max_relative = 1e-9);
            }
            "coupling interval" => {
                approx::assert_relative_eq!(coupled(&other), 0.5, max_relative = 1e-9);
            }
            "law of resistance" => assert_eq!(setting.change, "kozeny_carman to ergun"),
            _ => assert_eq!(
                other.scene.seepage.as_ref().unwrap().cell_count(),
                8 * own.scene.seepage.as_ref().unwrap().cell_count()
            ),
        }
    }
}

/// Checks that a seepage round a sheet pile, which has no grains and no time step, is refined by its own cells while
/// its openings keep their positions.
#[test]
fn seepage_without_grains_has_grids_of_its_own_cells() {
    let own = example("sheet-pile", &[]);
    for finer in [false, true] {
        let members = Members::for_case(&own, finer, false, false).unwrap();
        assert_eq!(members.scaling, Scaling::Steady);
        assert_eq!(members.grids.len(), 3);
        assert_eq!(members.grids[0].0 < 1.0, finer || members.grids[1].0 == 1.0);
        let written = own.scene.seepage.as_ref().unwrap();
        for (ratio, place) in &members.grids {
            let other = planned(&members.list[*place]);
            let seepage = other.scene.seepage.as_ref().unwrap();
            for axis in 0..2 {
                approx::assert_relative_eq!(
                    seepage.spacing[axis],
                    ratio * written.spacing[axis],
                    max_relative = 1e-12
                );
            }
            for (patch, before) in seepage.patches.iter().zip(&written.patches) {
                for axis in (0..2).filter(|axis| *axis != patch.face.axis()) {
                    let (from, to) = (real(patch.from[axis]), real(patch.to[axis]));
                    approx::assert_relative_eq!(
                        from * ratio,
                        real(before.from[axis]),
                        max_relative = 1e-12
                    );
                    approx::assert_relative_eq!(
                        to * ratio,
                        real(before.to[axis]),
                        max_relative = 1e-12
                    );
                }
            }
        }
    }
}

#[test]
fn cells_without_a_common_divisor_are_refined() {
    let own = plan(FAST, &["domain.size=[0.019, 0.02]"]);
    for finer in [false, true] {
        let found = Members::for_case(&own, finer, false, false).unwrap();
        assert_eq!(found.grids.len(), 2);
        assert!(found.grids[0].0 < 1.0);
    }
}

#[test]
fn the_coarsest_grid_keeps_four_cells_across_the_smallest_body() {
    // The wire of 1 mm in 16 x 8 mm: eight cells allow two coarser grids of 45 and 32 cells, six for one of 36.
    for (spacing, expected) in [
        ("0.000125", &[1.0, 64.0 / 45.0, 2.0][..]),
        ("0.00016666666666666667", &[1.0, 48.0 / 36.0]),
    ] {
        let own = example("first-flow", &[&format!("domain.spacing={spacing}")]);
        let found = Members::for_case(&own, false, false, false).unwrap();
        let ratios: Vec<f64> = found.grids.iter().map(|grid| grid.0).collect();
        approx::assert_relative_eq!(&ratios[..], expected, max_relative = 1e-12);
    }
}

/// The permitted error of a step of second order changes with h², and its largest length with h, so that the error in
/// time falls like that of the cells; no setting measures it once more.
#[test]
fn steps_of_a_transient_seepage_change_with_its_cells() {
    let own = example("infiltration", &[]);
    let members = Members::for_case(&own, false, true, false).unwrap();
    assert_eq!(members.grids.len(), 3);
    for (ratio, place) in &members.grids {
        let other = planned(&members.list[*place]);
        let seepage = other.scene.seepage.as_ref().unwrap();
        let soil = seepage.written.unsaturated.as_ref().unwrap();
        let error = soil.transient.as_ref().unwrap().content_error;
        approx::assert_relative_eq!(error, 2e-3 * ratio * ratio, max_relative = 1e-12);
        // 24 intervals on the cells of the case.
        let longest = own.clock.time_step * ratio;
        approx::assert_relative_eq!(other.clock.time_step, longest, max_relative = 1e-12);
        assert_eq!(real(other.clock.steps), 24.0 / ratio);
    }
    assert!(members.settings.is_empty(), "{:?}", members.settings);
}

#[test]
fn edges_make_a_seepage_one_of_first_order() {
    let order = |name: &str, set: &[&str]| grids::formal_order(&example(name, set).scene);
    // A column has none; a wall, a seepage face, heads on parts of a face, a drain and a layer are edges.
    assert_eq!(order("infiltration", &[]), 2.0);
    let soil =
        r#"fluid.darcy.unsaturated.retention={"gardner": {"alpha": 2, "saturated_content": 0.4}}"#;
    let layer = r#"fluid.darcy.zones[1]={"name": "layer", "region": {"layer": {"to": 0.33}},
        "permeability": {"hydraulic_conductivity": 1e-6}}"#;
    let drain = r#"fluid.darcy.drains=[{"name": "drain", "box": {"from": [0.01, 0.5], "to": [0.04, 0.51]},
        "condition": {"head": {"value": 0}}}]"#;
    for (name, set) in [
        ("sheet-pile", &[][..]),
        ("sheet-pile", &["structures=[]"]),
        ("earth-dam", &[]),
        ("earth-dam", &[soil]),
        ("infiltration", &[layer]),
        ("infiltration", &[drain]),
    ] {
        assert_eq!(order(name, set), 1.0, "{name} {set:?}");
    }
}
