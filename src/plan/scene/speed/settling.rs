//! Terminal velocity of a single body in the fluid.
//!
//! The weight minus the buoyancy balances the drag C_d(Re) rho v²/2 on the cross section. For a sphere C_d = 24 (1
//! +
//! 0.15 Re^0.687)/Re, and 0.44 from Re = 1000 on (Schiller and Naumann 1933). For a disc in 2-D, which is a long
//! cylinder, C_d = 1.18 + 6.8/Re^0.89 + 1.96/Re^½ - 0.0004 Re/(1 + 3.64e-7 Re²) (Sucker and Brauer 1975). Walls and
//! neighbours reduce the velocity.

use super::super::Scene;
use super::super::bodies::{Mobility, NamedBody};
use super::super::flow::Flow;
use super::super::grains::GrainSource;
use base::vector::norm;
use std::f64::consts::PI;

/// Returns the dimensionless drag coefficient of a sphere (3-D) or a long cylinder (2-D).
fn drag_coefficient(dimension: usize, reynolds: f64) -> f64 {
    if dimension == 2 {
        1.18 + 6.8 / reynolds.powf(0.89) + 1.96 / reynolds.sqrt()
            - 4e-4 * reynolds / (1.0 + 3.64e-7 * reynolds * reynolds)
    } else if reynolds < 1000.0 {
        24.0 / reynolds * (1.0 + 0.15 * reynolds.powf(0.687))
    } else {
        0.44
    }
}

/// Returns the speed [m/s] at which the drag on a sphere (2-D: a disc, per metre of depth) of this diameter \[m\]
/// balances a force \[N\].
#[must_use]
pub(crate) fn terminal_speed(dimension: usize, force: f64, diameter: f64, flow: &Flow) -> f64 {
    let area = if dimension == 2 {
        diameter
    } else {
        PI * diameter * diameter / 4.0
    };
    let unit = flow.kinematic_viscosity / diameter;
    let drag = |reynolds: f64| {
        let speed = unit * reynolds;
        0.5 * flow.density * speed * speed * area * drag_coefficient(dimension, reynolds)
    };
    // The drag increases with the Reynolds number: bisect its logarithm.
    let (mut low, mut high) = (1e-12_f64, 1e9_f64);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if drag(middle) < force {
            low = middle;
        } else {
            high = middle;
        }
    }
    unit * (low * high).sqrt()
}

fn of_volume(volume: f64) -> f64 {
    (6.0 * volume / PI).cbrt()
}

/// Returns the diameter of a body \[m\]; for a polyhedron that of the sphere of equal volume.
pub(crate) fn diameter(body: &NamedBody) -> f64 {
    let volume = body.solid.as_ref().map(|solid| solid.shape.volume());
    volume.map_or(2.0 * body.radius, of_volume)
}

/// Freely moving body.
struct FreeBody {
    /// JSON path.
    path: String,
    /// Diameter \[m\]; for a polyhedron that of the sphere of equal volume.
    diameter: f64,
    /// Index of the material.
    material: usize,
}

/// Returns each freely moving body.
fn free_bodies(scene: &Scene) -> Vec<FreeBody> {
    let mut list = Vec::new();
    let mut add = |path: String, diameter: f64, material: usize| {
        list.push(FreeBody {
            path,
            diameter,
            material,
        });
    };
    for (n, body) in scene.bodies.iter().enumerate() {
        if body.mobility == Mobility::Free {
            let path = format!("bodies[{n}].motion.free");
            add(path, diameter(body), body.material);
        }
    }
    if let Some(grains) = &scene.grains {
        let path = || String::from("grains.initial");
        match &grains.source {
            GrainSource::List(grains) | GrainSource::File { grains, .. } => {
                for grain in grains {
                    add(path(), 2.0 * grain.radius, grain.material);
                }
            }
            _ => {
                if let Some((_, largest)) = grains.radii {
                    for material in grains.materials() {
                        add(path(), 2.0 * largest, material);
                    }
                }
            }
        }
    }
    if let Some(blocks) = &scene.blocks {
        for block in blocks.list.iter().filter(|block| !block.fixed) {
            let diameter = of_volume(block.solid.shape.volume());
            add(String::from("blocks"), diameter, block.material);
        }
    }
    list
}

/// Returns the settling or rising speed [m/s] of a sphere (2-D: a disc) of a diameter \[m\] and a material, limited
/// by a free fall through the domain or over the duration of the run.
pub(crate) fn body_settling_speed(
    scene: &Scene,
    flow: &Flow,
    diameter: f64,
    material: usize,
) -> f64 {
    let lighter = (scene.density(material) / flow.density - 1.0).abs() * norm(scene.gravity);
    let force = lighter * scene.mass(material, 0.5 * diameter) / scene.density(material);
    terminal_speed(scene.grid.dimension, flow.density * force, diameter, flow)
        .min((2.0 * lighter * norm(scene.grid.size)).sqrt())
        .min(lighter * scene.time.end)
}

/// Returns the largest settling or rising speed under gravity [m/s], and the JSON path of the body.
pub(crate) fn fastest(scene: &Scene, flow: &Flow) -> Option<(String, f64)> {
    free_bodies(scene)
        .into_iter()
        .map(|body| {
            let speed = body_settling_speed(scene, flow, body.diameter, body.material);
            (body.path, speed)
        })
        .filter(|(_, speed)| *speed > 0.0)
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Returns the speed of the water [m/s] that a force per volume [N/m³] drives through bodies in a box without
/// walls: their drag, each at least that of an isolated body, balances the force.
pub(crate) fn held_by_bodies(scene: &Scene, flow: &Flow, force: f64) -> Option<f64> {
    let dimension = scene.grid.dimension;
    let volume: f64 = scene.grid.size[..dimension].iter().product();
    let held = scene
        .bodies
        .iter()
        .filter(|body| body.mobility != Mobility::Free);
    let diameters: Vec<f64> = held.map(|body| 2.0 * body.radius).collect();
    let smallest = diameters.iter().copied().fold(f64::INFINITY, f64::min);
    let number = base::number::real(diameters.len());
    smallest
        .is_finite()
        .then(|| terminal_speed(dimension, force * volume / number, smallest, flow))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn water() -> Flow {
        let text = include_str!("../../../case/examples/first-flow.json");
        let document = case::Document::read(text, &[], std::path::Path::new("")).unwrap();
        let plan = crate::Plan::prepare(document).unwrap();
        plan.scene.flow.unwrap()
    }

    #[test]
    fn a_small_sphere_settles_as_stokes_says() {
        let mut water = water();
        (water.density, water.kinematic_viscosity) = (1000.0, 1e-6);
        // Silt of 10 micrometres and 2650 kg/m³: v = (rho_s - rho) g d²/(18 mu) = 8.99e-5 m/s, Re = 9e-4.
        let diameter = 1e-5_f64;
        let weight = 1650.0 * 9.81 * PI / 6.0 * diameter.powi(3);
        let stokes = 1650.0 * 9.81 * diameter * diameter / (18.0 * 1e-3);
        let speed = terminal_speed(3, weight, diameter, &water);
        assert_relative_eq!(speed, stokes, max_relative = 2e-3);
    }

    #[test]
    fn a_grain_of_sand_settles_as_measured() {
        let mut water = water();
        (water.density, water.kinematic_viscosity) = (1000.0, 1e-6);
        // Quartz sphere of 1 mm in water at 20 °C: 0.16 m/s (Gibbs, Matthews and Link 1971: 0.155 … 0.162).
        let diameter = 1e-3_f64;
        let weight = 1650.0 * 9.81 * PI / 6.0 * diameter.powi(3);
        let speed = terminal_speed(3, weight, diameter, &water);
        assert_relative_eq!(speed, 0.16, max_relative = 0.05);
    }
}
