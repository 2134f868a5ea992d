//! The initial flow.

use super::aligned_box::AlignedBox;
use super::boundaries::ScenePatch;
use super::findings::{Findings, LATTICE_PATH as PATH};
use super::grid::Grid;
use base::error::Remedy;
use base::number::real;
use case::fluid::{self, LatticeBoltzmann, UniformFlow};
use lbm::synthetic::Fluctuations;
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Initial state of the fluid, in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Initial {
    /// Uniform velocity [m/s] and pressure \[Pa\]; zero by default.
    Uniform {
        /// Velocity [m/s].
        velocity: [f64; 3],
        /// Pressure above the reference \[Pa\].
        pressure: f64,
        /// Weight of stationary water, which its pressure supports; none if gravity does not act on the water or
        /// the case states velocity and pressure.
        weight: Option<Weight>,
    },
    /// Taylor-Green vortices: u = -U cos(ax) sin(by) cos(cz), v = (a/b) U sin(ax) cos(by) cos(cz).
    TaylorGreen {
        /// Amplitude U [m/s].
        velocity: f64,
        /// Wave numbers a, b and c [1/m]; c may be zero.
        wave_numbers: [f64; 3],
    },
    /// Shear layers at y = 1/4 and 3/4 of the height, periodic along x and y.
    ShearLayers {
        /// Velocity U on either side [m/s].
        velocity: f64,
        /// Thickness of a layer \[m\].
        thickness: f64,
        /// Amplitude of the transverse velocity divided by U.
        perturbation: f64,
    },
    /// Parabolic profile between the walls of one axis.
    Channel {
        /// Axis of the flow: 0, 1 or 2.
        flow: usize,
        /// Axis from wall to wall: 0, 1 or 2.
        across: usize,
        /// Coordinates at which the flow begins and ends along that axis \[m\].
        between: [f64; 2],
        /// Velocity in the middle [m/s].
        peak: f64,
        /// Fluctuations added to the profile.
        fluctuations: Option<Fluctuations>,
    },
    /// State from a file.
    File(PathBuf),
}

/// Pressure that supports the weight of stationary water, p = p_0 + f·(x - x_0).
///
/// On the lattice the density is then linear, and the populations are w_i (δρ - 3/2 c_i·F): collision reverses the
/// sign of the part with F, and streaming adds 3 w_i c_i·F, so that these populations are stationary, also where
/// links use half-way bounce-back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Weight {
    /// Force density f [N/m³], along the axes along which gravity acts and that are not periodic.
    pub force: [f64; 3],
    /// Reference point x_0 \[m\].
    pub place: [f64; 3],
    /// Pressure p_0 at the reference point \[Pa\].
    pub pressure: f64,
}

impl Weight {
    /// Returns the pressure at a point \[Pa\].
    #[must_use]
    pub fn pressure(&self, at: [f64; 3]) -> f64 {
        let rise = |a: usize| self.force[a] * (at[a] - self.place[a]);
        self.pressure + (0..3).map(rise).sum::<f64>()
    }
}

/// Maximum deviation of openings from one hydrostatic pressure, as a fraction of the pressure of the water column.
const HYDROSTATIC_DEVIATION: f64 = 0.5;

/// Returns the hydrostatic pressure of stationary water: that of openings with a pressure, or with a mean of zero
/// if there are none. None if there is no weight to support, or if the openings contradict it, like those above and
/// below falling water.
pub(super) fn weight(
    (density, gravity): (f64, [f64; 3]),
    acts: [bool; 3],
    grid: &Grid,
    faces: &[Vec<ScenePatch>; 6],
) -> Option<Weight> {
    let bears = |a: usize| acts[a] && a < grid.dimension && !grid.periodic[a];
    let force: [f64; 3] =
        std::array::from_fn(|a| if bears(a) { density * gravity[a] } else { 0.0 });
    let column: f64 = (0..3).map(|a| force[a].abs() * grid.size[a]).sum();
    if column <= 0.0 {
        return None;
    }
    let middle: [f64; 3] = std::array::from_fn(|a| 0.5 * grid.size[a]);
    let from_middle = Weight {
        force,
        place: middle,
        pressure: 0.0,
    };
    let openings = faces.iter().flatten().filter_map(|patch| {
        let imposed = patch.condition.model().pressure()?;
        let mut at: [f64; 3] =
            std::array::from_fn(|a| 0.5 * grid.spacing * (real(patch.from[a]) + real(patch.to[a])));
        let axis = patch.face.axis();
        at[axis] = if patch.face.is_max() {
            grid.size[axis]
        } else {
            0.0
        };
        // The pressure in the middle if this opening is in equilibrium.
        Some(imposed.start() - from_middle.pressure(at))
    });
    let stated: Vec<f64> = openings.collect();
    let (low, high) = stated
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |b, p| {
            (b.0.min(*p), b.1.max(*p))
        });
    if high - low > HYDROSTATIC_DEVIATION * column {
        return None;
    }
    let mean = stated.iter().sum::<f64>() / real(stated.len().max(1));
    Some(Weight {
        pressure: mean,
        ..from_middle
    })
}

/// Returns the initial flow of a case.
pub(super) fn initial(
    lbm: &LatticeBoltzmann,
    grid: &Grid,
    directory: &Path,
    findings: &mut Findings,
) -> Initial {
    let path = format!("{PATH}.initial");
    let uniform = |velocity: [f64; 3], pressure: f64| Initial::Uniform {
        velocity,
        pressure,
        weight: None,
    };
    match &lbm.initial {
        fluid::Initial::Rest {} => uniform([0.0; 3], 0.0),
        fluid::Initial::Uniform(UniformFlow { velocity, pressure }) => {
            let path = format!("{path}.uniform.velocity");
            uniform(
                AlignedBox::vector(grid, velocity, &path, findings),
                *pressure,
            )
        }
        fluid::Initial::TaylorGreen {
            velocity,
            waves,
            waves_along_z,
        } => {
            let path = format!("{path}.taylor_green");
            Initial::TaylorGreen {
                velocity: *velocity,
                wave_numbers: wave_numbers(*waves, *waves_along_z, grid, &path, findings),
            }
        }
        fluid::Initial::ShearLayers {
            velocity,
            thickness,
            perturbation,
        } => {
            repeats("layers", grid, &format!("{path}.shear_layers"), findings);
            Initial::ShearLayers {
                velocity: *velocity,
                thickness: *thickness,
                perturbation: *perturbation,
            }
        }
        fluid::Initial::Channel {
            flow,
            across,
            from,
            to,
            peak,
            fluctuations,
        } => {
            let path = format!("{path}.channel");
            if let Some(fluctuations) = fluctuations {
                fluctuations.check(grid.spacing, &format!("{path}.fluctuations"), findings);
            }
            let (flow, across) = (flow.index(), across.index());
            let between = [from.unwrap_or(0.0), to.unwrap_or(grid.size[across])];
            check_channel([flow, across], between, grid, &path, findings);
            Initial::Channel {
                flow,
                across,
                between,
                peak: *peak,
                fluctuations: *fluctuations,
            }
        }
        fluid::Initial::File { path: file } => {
            let path = format!("{path}.file.path");
            Initial::File(checked(directory.join(file), grid, &path, findings))
        }
    }
}

/// Returns the wave numbers of vortices that are periodic with the domain.
fn wave_numbers(
    waves: [u32; 2],
    waves_along_z: u32,
    grid: &Grid,
    path: &str,
    findings: &mut Findings,
) -> [f64; 3] {
    if waves.contains(&0) {
        findings.error(
            &format!("{path}.waves"),
            "at least one wave is needed along each axis",
            Remedy::from("write for example [1, 1]").set(format!("{path}.waves"), json!([1, 1])),
        );
    }
    repeats("vortices", grid, path, findings);
    if waves_along_z > 0 && !(grid.dimension == 3 && grid.periodic[2]) {
        findings.error(
            &format!("{path}.waves_along_z"),
            "the waves repeat along z, but the domain does not",
            "make the domain 3-D and periodic along z, or omit this",
        );
    }
    let wave = |axis: usize, waves: u32| std::f64::consts::TAU * f64::from(waves) / grid.size[axis];
    let along_z = if grid.dimension == 3 {
        wave(2, waves_along_z)
    } else {
        0.0
    };
    [wave(0, waves[0]), wave(1, waves[1]), along_z]
}

/// Refuses a flow that is periodic along x and y in a domain that is not.
fn repeats(what: &str, grid: &Grid, path: &str, findings: &mut Findings) {
    if !(grid.periodic[0] && grid.periodic[1]) {
        findings.error(
            path,
            format!("the {what} repeat along x and y, but the domain does not"),
            Remedy::from("write \"periodic\": [\"x\", \"y\"] in the domain")
                .set("domain.periodic", json!(["x", "y"])),
        );
    }
}

/// Refuses axes that are not two different axes of the domain, and ends in the wrong order or outside the domain.
fn check_channel(
    [flow, across]: [usize; 2],
    [from, to]: [f64; 2],
    grid: &Grid,
    path: &str,
    findings: &mut Findings,
) {
    if flow == across || flow.max(across) >= grid.dimension {
        findings.error(
            path,
            "`flow` and `across` must be two different axes of the domain",
            "write for example \"flow\": \"x\", \"across\": \"y\"",
        );
    }
    let size = grid.size[across];
    if !(0.0 <= from && from < to && to <= size) {
        findings.error(
            path,
            format!(
                "the flow begins at {from} m and ends at {to} m, \
                 but the domain goes from 0 to {size} m along {}",
                ["x", "y", "z"][across]
            ),
            "choose `from` below `to`, both inside the domain",
        );
    }
}

/// Returns a file; reports a finding unless it has velocity and pressure of every cell.
fn checked(file: PathBuf, grid: &Grid, path: &str, findings: &mut Findings) -> PathBuf {
    if let Err(reason) = holds_fields(&file, grid) {
        findings.error(
            path,
            reason,
            "choose a field output (fluid_*.vtkhdf) of a run with the same cells; the path is relative to the \
             case",
        );
    }
    file
}

/// Returns an error unless a file has velocity and pressure of every cell; reads only its headers.
fn holds_fields(file: &Path, grid: &Grid) -> Result<(), String> {
    for (name, components) in [("velocity", 3), ("pressure", 1)] {
        let shape = io::fields::column_shape(file, name).map_err(|e| e.to_string())?;
        let numbers = shape.iter().try_fold(1_usize, |all, n| all.checked_mul(*n));
        if numbers != grid.cell_count().checked_mul(components) {
            return Err(format!(
                "{}: `{name}` has the shape {shape:?}, but the case has {:?} cells",
                file.display(),
                grid.cells
            ));
        }
    }
    Ok(())
}
