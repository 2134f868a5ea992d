//! Initial state of the fluid as a field on the lattice: from formulas of a case, or from a field output of an
//! earlier run.

use base::error::Error;
use base::number::{real, whole};
use base::units::LatticeUnits;
use lbm::initial::Field;
use plan::Plan;
use plan::scene::flow::Flow;
use plan::scene::free_surface::FreeSurface;
use plan::scene::grid::Grid;
use plan::scene::initial::{Initial, Weight};
use std::path::Path;

/// Returns the lengths in cells after which a field repeats; none along axes that are not periodic.
fn repeats(grid: &Grid) -> [Option<f64>; 3] {
    std::array::from_fn(|a| grid.periodic[a].then(|| real(grid.cells[a])))
}

/// Returns the initial state of the fluid by the formula of the case; none if the case names a file.
#[must_use]
pub fn formula(plan: &Plan, flow: &Flow, units: LatticeUnits) -> Option<Box<dyn Field>> {
    let cells = plan.scene.grid.cells.map(real);
    let u = |v: f64| units.velocity_to_lattice(v);
    Some(match &flow.initial {
        Initial::Uniform {
            velocity,
            pressure,
            weight,
        } => {
            let v = velocity.map(|v| units.velocity_to_lattice(v));
            let drho = units.pressure_to_density_deviation(*pressure);
            match (plan.scene.surface.clone(), weight) {
                (Some(surface), _) => below_surface(surface, flow.density, v, units),
                (None, Some(weight)) => under_weight(weight, drho, v, units),
                (None, None) => Box::new(move |_: [f64; 3]| (drho, v)),
            }
        }
        Initial::TaylorGreen {
            velocity,
            wave_numbers,
        } => {
            let wave_numbers = wave_numbers.map(|k| k * units.spacing);
            taylor_green(units.velocity_to_lattice(*velocity), wave_numbers)
        }
        Initial::ShearLayers {
            velocity,
            thickness,
            perturbation,
        } => {
            let (speed, sharp) = (u(*velocity), cells[1] * units.spacing / thickness);
            let across = perturbation * speed;
            Box::new(move |p: [f64; 3]| {
                let [x, y] = [p[0] / cells[0], p[1] / cells[1]];
                let from_layer = if y <= 0.5 { y - 0.25 } else { 0.75 - y };
                let v = across * (std::f64::consts::TAU * (x + 0.25)).sin();
                (0.0, [speed * (sharp * from_layer).tanh(), v, 0.0])
            })
        }
        Initial::Channel {
            flow,
            across,
            between,
            peak,
            fluctuations,
        } => {
            let (flow, across, peak) = (*flow, *across, u(*peak));
            let grid = &plan.scene.grid;
            let [begins, ends] = between.map(|place| place / grid.size[across] * cells[across]);
            let eddies = fluctuations.map(|written| {
                let modes = written.modes(grid.dimension, &units);
                let modes = modes.periodic(repeats(grid));
                (written.intensity, modes)
            });
            Box::new(move |p: [f64; 3]| {
                let s = ((p[across] - begins) / (ends - begins)).clamp(0.0, 1.0);
                let speed = 4.0 * peak * s * (1.0 - s);
                let mut v = [0.0; 3];
                if let Some((intensity, modes)) = &eddies {
                    v = modes.velocity_at(p).map(|u| u * intensity * speed);
                }
                v[flow] += speed;
                (0.0, v)
            })
        }
        Initial::File(_) => return None,
    })
}

/// Returns water at rest or in a uniform stream below a free surface, with the waves of the surface.
fn below_surface(
    surface: FreeSurface,
    density: f64,
    velocity: [f64; 3],
    units: LatticeUnits,
) -> Box<dyn Field> {
    let (h, force) = (units.spacing, density * surface.gravity);
    Box::new(move |p: [f64; 3]| {
        let at = p.map(|x| x * h);
        let pressure = force * surface.depth(at);
        let wave = surface.velocity(at).map(|u| units.velocity_to_lattice(u));
        let velocity = std::array::from_fn(|a| velocity[a] + wave[a]);
        (units.pressure_to_density_deviation(pressure), velocity)
    })
}

/// Returns a uniform stream whose pressure grows with its weight.
fn under_weight(
    weight: &Weight,
    drho: f64,
    velocity: [f64; 3],
    units: LatticeUnits,
) -> Box<dyn Field> {
    // The density rises by 3 F from cell to cell, with F the force that the collision adds.
    let force = weight.force.map(|f| units.force_density_to_lattice(f));
    let place = weight.place.map(|x| x / units.spacing);
    let there = drho + units.pressure_to_density_deviation(weight.pressure);
    Box::new(move |p: [f64; 3]| {
        let rise = |a: usize| 3.0 * force[a] * (p[a] - place[a]);
        (there + (0..3).map(rise).sum::<f64>(), velocity)
    })
}

/// Returns the vortices of Taylor and Green with a speed and wave numbers in lattice units.
fn taylor_green(speed: f64, [a, b, c]: [f64; 3]) -> Box<dyn Field> {
    Box::new(move |p: [f64; 3]| {
        let [x, y, z] = [a * p[0], b * p[1], c * p[2]];
        let v = [
            -speed * x.cos() * y.sin() * z.cos(),
            speed * (a / b) * x.sin() * y.cos() * z.cos(),
            0.0,
        ];
        // p/rho_0 = -U²/8 [cos 2ax (1 + A cos 2cz) + (a/b)² cos 2by (1 + B cos 2cz)] with A = a²/(a² + c²)
        // and B = b²/(b² + c²), from the divergence of the momentum equation; the density deviation is
        // three times this value.
        let along = |k: f64| 1.0 + k * k / (k * k + c * c) * (2.0 * z).cos();
        let drho = -0.375
            * speed
            * speed
            * ((2.0 * x).cos() * along(a) + (a / b).powi(2) * (2.0 * y).cos() * along(b));
        (drho, v)
    })
}

/// Returns the initial state of the fluid from a field output of the same size.
///
/// # Errors
/// If the file cannot be read or has another number of cells.
pub fn file(path: &Path, plan: &Plan, units: LatticeUnits) -> Result<Box<dyn Field>, Error> {
    let wrong = |what: String| {
        Error::Io(format!(
            "the initial state {} cannot be used: {what}",
            path.display()
        ))
    };
    let read = |name: &str| io::fields::read_column(path, name).map_err(|e| wrong(e.to_string()));
    let (velocity, pressure) = (read("velocity")?, read("pressure")?);
    let cells = plan.scene.grid.cells;
    let count = cells[0] * cells[1] * cells[2];
    if velocity.values.len() != 3 * count || pressure.values.len() != count {
        return Err(wrong(format!("it does not have {cells:?} cells")));
    }
    Ok(Box::new(move |p: [f64; 3]| {
        let at: [usize; 3] =
            std::array::from_fn(|a| whole(p[a].floor().max(0.0)).min(cells[a] - 1));
        let n = (at[2] * cells[1] + at[1]) * cells[0] + at[0];
        let u: [f64; 3] =
            std::array::from_fn(|a| units.velocity_to_lattice(velocity.values[3 * n + a]));
        (units.pressure_to_density_deviation(pressure.values[n]), u)
    }))
}
