//! The defaults of a case of seepage against published values.

use super::Darcy;
use base::number;
use coupling::Flow;
use coupling::seepage::{Seepage, SeepageSettings};
use darcy::{
    Condition, Enclosure, Liquid, Openness, Pores, Pressure, PressurePatch, PressureSettings,
    ResistanceSettings, SeepageGrid,
};
use decomposition::Communicator;
use dem::alone;
use dem::particles::{Body, Kind, Motion, Particles};
use dem::space::Volume;
use nalgebra::Vector3;

/// Checks that with the defaults of a case a bed of spheres lifts at Terzaghi's gradient (G_s - 1)(1 - n), and at the
/// minimum fluidisation velocity of Ergun's equation, from fine sand to gravel, from dense to loose, in water and in
/// oil.
#[test]
fn by_default_a_bed_lifts_at_the_gradient_of_terzaghi_and_the_velocity_of_ergun() {
    for diameter in [1e-4, 1e-3, 5e-3] {
        for porosity in [0.35_f64, 0.42, 0.5] {
            for viscosity in [1e-3, 0.1] {
                // A body-centred cubic array: two spheres in each cube of this edge.
                let solid = 1.0 - porosity;
                let edge = diameter * (std::f64::consts::PI / (3.0 * solid)).cbrt();
                let grid = SeepageGrid {
                    cells: [2, 2, 5],
                    // The array reaches beyond on all sides.
                    origin: [edge; 3],
                    spacing: [4.0 * edge; 3],
                    dimension: 3,
                    ..SeepageGrid::default()
                };
                let liquid = Liquid {
                    density: 1000.0,
                    viscosity,
                };
                let height = 20.0 * edge;
                let gradient = 1.65 * solid;
                let written: Darcy = serde_json::from_value(
                    serde_json::json!({"density": 1000.0, "viscosity": viscosity}),
                )
                .unwrap();
                let communicator = Communicator::serial();
                let openness = Openness::measure(&grid, &Enclosure::Everything);
                let face = |upper, head| PressurePatch {
                    axis: 2,
                    upper,
                    from: [0; 3],
                    to: grid.cells,
                    condition: Condition::Head { value: head },
                    inside: false,
                };
                let gravity = [0.0, 0.0, -9.81];
                let patches = vec![
                    face(false, edge + height * (1.0 + gradient)),
                    face(true, edge + height),
                ];
                let settings = PressureSettings {
                    equations: written.equations,
                    gravity,
                    tolerance: written.tolerance,
                    iterations: written.max_iterations,
                };
                let pressure =
                    Pressure::new(&openness, patches, liquid, settings, &communicator).unwrap();
                let pores = Pores::new(grid.clone(), written.porosity, written.mean_diameter);
                let settings = SeepageSettings {
                    liquid,
                    resistance: ResistanceSettings {
                        law: written.resistance(),
                        diameter: written.mean_diameter,
                        porosity_cap: written.porosity_cap(),
                        least_porosity: written.least_porosity,
                    },
                    drag: written.drag(),
                    equations: written.equations,
                    transient_porosity: written.transient_porosity(),
                    semi_implicit_drag: written.semi_implicit_drag,
                    gravity,
                    interval: 1e-6,
                    roughness: None,
                    bridges: false,
                    walls: Default::default(),
                };
                let mut seepage =
                    Seepage::<Volume>::new(openness, pores, pressure, settings, &communicator);
                let mut particles = Particles::<Volume>::new();
                let mut id = 0;
                for k in 0..44 {
                    for j in 0..10 {
                        for i in 0..10 {
                            let shift = if k % 2 == 0 { 0.25 } else { 0.75 };
                            let at = |n: i32, step: f64, first: f64| {
                                (f64::from(n) * step + first) * edge
                            };
                            let motion = Motion {
                                position: Vector3::new(
                                    at(i, 1.0, shift),
                                    at(j, 1.0, shift),
                                    at(k, 0.5, 0.25),
                                ),
                                ..Motion::default()
                            };
                            let mut body = Body::uniform::<Volume>(id, 0.5 * diameter, 2650.0, 0);
                            body.kind = Kind::Fixed;
                            particles.insert(body, motion);
                            id += 1;
                        }
                    }
                }
                seepage.advance(&mut particles, &alone()).unwrap();
                // The spheres at the sides are loaded in proportion to their part inside the array.
                let volume: f64 = (0..grid.count())
                    .map(|c| seepage.pores().solid_volume(c))
                    .sum();
                let place = format!("d {diameter}, n {porosity}, mu {viscosity}");
                let lift = seepage.balance().on_grains[2] / (volume * 2650.0 * 9.81);
                let counted = volume / (grid.volume([0; 3]) * number::real(grid.count()));
                let wanted =
                    (gradient / (1.65 * counted)).mul_add(1650.0 / 2650.0, 1000.0 / 2650.0);
                assert!(
                    (lift / wanted - 1.0).abs() < 1e-3,
                    "{place}: {lift} {wanted}"
                );
                assert!((counted / solid - 1.0).abs() < 0.01, "{place}: {counted}");
                assert!(seepage.balance().closure < 1e-6, "{place}");
                let q = seepage.report().inflow / (8.0 * edge).powi(2);
                let a =
                    150.0 * solid * solid * viscosity / (porosity.powi(3) * diameter * diameter);
                let b = 1.75 * solid * 1000.0 / (porosity.powi(3) * diameter);
                let loss = 1.65 * solid * 9810.0;
                let lifts = (-a + (a * a + 4.0 * b * loss).sqrt()) / (2.0 * b);
                assert!((q / lifts - 1.0).abs() < 0.03, "{place}: {q} {lifts}");
            }
        }
    }
}
