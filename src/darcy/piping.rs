//! Backward erosion piping at true size: a pipe of water that grows upstream at the contact of sand with an
//! impervious roof, from an exit towards the driving boundary.
//!
//! ```text
//! soil        div (k grad h) = 0                                            Darcy's law
//! pipe        Q = w a^3 rho g i/(12 mu)                                     laminar flow between plates
//! grains      a rho g i/2 = eta (pi/6) (rho_s - rho) g d tan(theta)         shear stress at the limit of White (1940)
//! hence       a = C/i,  C = (pi/3) eta (rho_s/rho - 1) d tan(theta)
//! ```
//!
//! Q is the discharge through the pipe, i the slope of the head along it, a its height, w its width, d the diameter of
//! the grains that form its bottom. This is the closure of Sellmeijer (1988) in the form of his rule of 2011 and of
//! two-dimensional programs: the grains of the bottom are everywhere at the limit of equilibrium. The height is not an
//! unknown, because it follows from the slope, and the discharge falls with the slope: `Q = w C^3 rho g/(12 mu i^2)`. A
//! shallower pipe would erode to this height, and a deeper one has grains that do not move.
//!
//! **Head of a length.** A pipe of length l has a smallest head H(l) at which this equilibrium exists along all of it.
//! Below it the shear stress at the tip is too small for the grains there, so that the pipe ends earlier. H rises with
//! l at first, because the tip moves away from the concentration of flow at the exit, and falls once the tip comes near
//! the driving boundary. The *critical head* is the maximum over l, and the length there the *critical length*: under a
//! smaller head the pipe stops, under a larger one it grows through.
//!
//! **Detachment at the tip.** No criterion acts in front of the tip; the tip advances as soon as the longer pipe has
//! an equilibrium, as in the original model. Grains whose first motion needs a larger head (a heave of the exit, or
//! a strong gradient in front of the tip in three dimensions) are outside this model.
//!
//! **Method.** The flow of the soil is linear: one solution of the pressure for the drive and one for a unit
//! withdrawal in each cell of the pipe give its response ([`influence`]). The equilibrium of any
//! length is then a small dense system ([`equilibrium`]), in which discharge and height of the pipe agree with the
//! seepage to rounding.
//!
//! **Widths.** In two dimensions the pipe has the unit depth of the section. In three dimensions it is a line of
//! cells, and a slit of width w in them: fixed, or a multiple of the height. With the latter the head per length
//! falls as the power -1/2 of the length instead of -1/3, by dimensions alone.
//!
//! Limits: steady flow, laminar pipe, grains of one diameter, no erosion of the roof, no transport along the pipe in
//! time.

pub mod equilibrium;
pub mod influence;
pub mod rule;

use crate::SeepageError;
use crate::enclosure::Openness;
use crate::grid::SeepageGrid;
use crate::pressure::Pressure;
use base::number::real;
use equilibrium::{Equilibrium, PipeState};
use nalgebra::DMatrix;
use serde::Serialize;
use std::f64::consts::PI;

/// Maximum number of cells of a pipe: each needs a solution of the pressure.
pub const MAX_CELLS: usize = 400;
/// Minimum number of cells of a pipe.
pub const MIN_CELLS: usize = 4;
/// Reynolds number of the discharge per width above which a flow between plates may be turbulent (H. Schlichting,
/// Boundary-Layer Theory, 1979).
pub const TURBULENT: f64 = 1000.0;

/// Width of a pipe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PipeWidth {
    /// Width \[m\].
    Fixed(f64),
    /// Width over height \[1\].
    Ratio(f64),
}

/// Discharge of a pipe as a function of the slope of the head along it.
pub trait Conveyance {
    /// Returns the discharge \[m3/s\] at a slope \[1\], and its derivative with respect to the logarithm of the slope.
    fn discharge(&self, slope: f64) -> [f64; 2];

    /// Returns the width at a slope \[m\], and the exponent of the slope in it.
    fn width(&self, slope: f64) -> (f64, f64);
}

/// Pipe whose bottom is at the limit of equilibrium.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LimitPipe {
    /// Height times slope, C \[m\].
    pub height_of_slope: f64,
    /// Density times gravity over 12 viscosities \[1/(m s)\].
    pub fluidity: f64,
    /// Width.
    pub width: PipeWidth,
}

/// Grains at the bottom of a pipe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BottomGrains {
    /// Diameter in the equilibrium \[m\].
    pub diameter: f64,
    /// Density over that of the water \[1\].
    pub relative_density: f64,
    /// Coefficient of White, eta \[1\].
    pub white: f64,
    /// Bedding angle, theta \[rad\].
    pub bedding_angle: f64,
}

impl BottomGrains {
    /// Returns the height of a pipe times its slope, C \[m\] (J. B. Sellmeijer et al. 2011).
    #[must_use]
    pub fn height_of_slope(&self) -> f64 {
        let submerged = self.relative_density - 1.0;
        PI / 3.0 * self.white * submerged * self.diameter * self.bedding_angle.tan()
    }
}

impl LimitPipe {
    /// Returns the height at a slope \[m\].
    #[must_use]
    pub fn height(&self, slope: f64) -> f64 {
        self.height_of_slope / slope
    }
}

impl Conveyance for LimitPipe {
    fn discharge(&self, slope: f64) -> [f64; 2] {
        let height = self.height(slope);
        let (width, power) = self.width(slope);
        let discharge = width * height.powi(3) * self.fluidity * slope;
        [discharge, (power - 2.0) * discharge]
    }

    fn width(&self, slope: f64) -> (f64, f64) {
        match self.width {
            PipeWidth::Fixed(width) => (width, 0.0),
            PipeWidth::Ratio(ratio) => (ratio * self.height(slope), -1.0),
        }
    }
}

/// Row of cells below the roof that a pipe follows, from the exit upstream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PipePath {
    /// First cell, at the exit.
    pub first: [usize; 3],
    /// Axis of the pipe.
    pub axis: usize,
    /// `true` if the pipe grows towards larger coordinates.
    pub rises: bool,
    /// Number of cells.
    pub count: usize,
    /// Axis of gravity, normal to the roof.
    pub vertical: usize,
}

impl PipePath {
    /// Returns the cells in the order of growth.
    pub fn cells(&self) -> impl Iterator<Item = [usize; 3]> {
        (0..self.count).map(|n| {
            let mut cell = self.first;
            cell[self.axis] = if self.rises {
                cell[self.axis] + n
            } else {
                cell[self.axis] - n
            };
            cell
        })
    }
}

/// Response of the soil along the path of a pipe, in heads.
#[derive(Clone, Debug, PartialEq)]
pub struct SoilResponse {
    /// Head in the cells above that of the exit if the drive has the head of the exit \[m\].
    pub background: Vec<f64>,
    /// Rise of the head in the cells for a rise of the drive by 1 m \[1\].
    pub drive: Vec<f64>,
    /// Fall of the head in a cell (row) for a withdrawal from another (column) \[s/m2\].
    pub fall: DMatrix<f64>,
    /// Resistance between the centre of a cell and the pipe \[s/m2\]: that of half the cell, or that of a slit whose
    /// width is [`Self::slit`] divided by e.
    pub entry: Vec<f64>,
    /// Width of a slit without resistance between the centre of a cell and the slit \[m\]; none for a pipe as wide
    /// as the cell.
    pub slit: Option<f64>,
    /// Length of a cell along the pipe \[m\].
    pub length: f64,
}

/// Width of a slit in the face of a square cell, over the edge of the cell, whose head is that of the cell.
///
/// A slit of width w in a plane acts as a half cylinder of radius w/4. A cell from which water is withdrawn has the
/// head at the radius 0.1985 of its edge (D. W. Peaceman 1978); the image of the cell in the impervious roof raises it
/// by the factor exp(pi/4), as the head of its neighbour exceeds its own by a quarter of the withdrawal.
pub const SLIT: f64 = 1.741;

/// Settings of a study of backward erosion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PipingSettings {
    /// Cells that the pipe may follow.
    pub path: PipePath,
    /// Index of the boundary with the driving head.
    pub drive: usize,
    /// Index of the boundary at which the pipe begins.
    pub exit: usize,
    /// Grains of the bottom.
    pub grains: BottomGrains,
    /// Width of the pipe; none for the unit depth of a section.
    pub width: Option<PipeWidth>,
}

/// Pipe of one length at the smallest head at which it is in equilibrium.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PipeOfLength {
    /// Length \[m\].
    pub length: f64,
    /// Difference of head between drive and exit \[m\].
    pub head: f64,
    /// Head in the tip above that of the exit \[m\].
    pub tip_head: f64,
    /// Slope of the head at the tip \[1\].
    pub tip_slope: f64,
    /// Slope of the head at the exit \[1\].
    pub exit_slope: f64,
    /// Height at the tip \[m\].
    pub tip_height: f64,
    /// Height at the exit \[m\].
    pub exit_height: f64,
    /// Width at the exit \[m\].
    pub exit_width: f64,
    /// Discharge at the exit \[m3/s; m2/s in 2-D\].
    pub discharge: f64,
    /// Discharge per width over the kinematic viscosity, at the exit \[1\].
    pub reynolds: f64,
}

/// Result of a study of backward erosion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Piping {
    /// Pipes of all lengths, a cell apart.
    pub pipes: Vec<PipeOfLength>,
    /// Index of the pipe with the largest head.
    pub critical: usize,
    /// Permeability of the soil around the pipe, the mean of its cells \[m2\].
    pub permeability: f64,
}

impl Piping {
    /// Returns the pipe with the largest head.
    #[must_use]
    pub fn critical(&self) -> &PipeOfLength {
        &self.pipes[self.critical]
    }

    /// Returns the length at which a pipe stops under a head \[m\]: between the lengths whose heads enclose it, and 0
    /// if the head is too small for a pipe of one cell; none if the pipe grows through.
    #[must_use]
    pub fn stops_at(&self, head: f64) -> Option<f64> {
        let next = self.pipes.iter().position(|pipe| pipe.head >= head)?;
        if next == 0 {
            return Some(0.0);
        }
        let (low, high) = (&self.pipes[next - 1], &self.pipes[next]);
        let part = (head - low.head) / (high.head - low.head);
        Some(low.length + part * (high.length - low.length))
    }

    /// Computes the heads of all lengths of a pipe. `pressure` holds the solution for the ground in `openness` and
    /// is not changed. Collective; the result is the same on all ranks.
    ///
    /// # Errors
    /// If a solution of the pressure fails, or if no equilibrium of a length was found.
    pub fn study(
        pressure: &Pressure,
        openness: &Openness,
        settings: &PipingSettings,
    ) -> Result<Self, SeepageError> {
        let soil = influence::along(pressure, openness, settings)?;
        let water = pressure.liquid();
        let weight = pressure.unit_weight();
        let grid = &openness.grid;
        let pipe = LimitPipe {
            height_of_slope: settings.grains.height_of_slope(),
            fluidity: weight / (12.0 * water.viscosity),
            width: settings
                .width
                .unwrap_or(PipeWidth::Fixed(across(grid, &settings.path))),
        };
        let mut pipes = Vec::with_capacity(settings.path.count);
        let mut last: Option<PipeState> = None;
        for count in 1..=settings.path.count {
            let lacking = SeepageError::Pipe {
                length: real(count) * soil.length,
            };
            let equilibrium = Equilibrium::new(&soil, &pipe, count);
            let found = equilibrium.smallest_head(last.as_ref()).ok_or(lacking)?;
            pipes.push(of_length(
                &soil,
                &pipe,
                &found,
                water.density,
                water.viscosity,
            ));
            last = Some(found);
        }
        let higher = |best: usize, n: usize| {
            if pipes[n].head > pipes[best].head {
                n
            } else {
                best
            }
        };
        let critical = (0..pipes.len()).fold(0, higher);
        let sum: f64 = (settings.path.cells())
            .map(|cell| pressure.conductivity(grid.index(cell)) * water.viscosity)
            .sum();
        Ok(Self {
            pipes,
            critical,
            permeability: sum / real(settings.path.count),
        })
    }
}

/// Returns the width of a cell across a pipe \[m\].
#[must_use]
pub fn across(grid: &SeepageGrid, path: &PipePath) -> f64 {
    grid.spacing[3 - path.axis - path.vertical]
}

/// Returns the row of a table for a pipe in equilibrium.
fn of_length(
    soil: &SoilResponse,
    pipe: &LimitPipe,
    state: &PipeState,
    density: f64,
    viscosity: f64,
) -> PipeOfLength {
    let slopes: Vec<f64> = state.log_slopes.iter().map(|y| y.exp()).collect();
    let (exit_slope, tip_slope) = (slopes[0], slopes[slopes.len() - 1]);
    let [discharge, _] = pipe.discharge(exit_slope);
    let (exit_width, _) = pipe.width(exit_slope);
    PipeOfLength {
        length: real(slopes.len()) * soil.length,
        head: state.head,
        tip_head: equilibrium::heads(&slopes, soil.length)
            .last()
            .unwrap_or(0.0),
        tip_slope,
        exit_slope,
        tip_height: pipe.height(tip_slope),
        exit_height: pipe.height(exit_slope),
        exit_width,
        discharge,
        reynolds: discharge / exit_width * density / viscosity,
    }
}

#[cfg(test)]
mod tests;
