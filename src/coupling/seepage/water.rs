//! Water of all cells: laws of the drag, flux, and the iteration for both.

use base::vector::norm;
use darcy::drag::BedConditions;
use darcy::open_water::{Face, OpenWater};
use darcy::{Condition, Pressure, SeepageGrid};

/// Relative change of a speed below which its response is rounding.
const NOISE: f64 = 1e-7;
/// Properties of a cell that determine the drag on a grain at a given slip.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ground {
    /// Conditions of water and bed, with the porosity of the neighbourhood.
    pub(super) bed: BedConditions,
    /// Factor of the velocity of a grain relative to the flux of the water: the porosity, or 1 in the equations as
    /// printed.
    pub(super) measure: f64,
    /// Porosity within the limits of the law of resistance, and mean diameter \[m\].
    pub(super) packing: (f64, f64),
    /// Ratio of the drag on the volume of a grain to resistance times flux: porosity over solid fraction.
    pub(super) factor: f64,
    /// Resistance \[Pa s/m²\] if a zone states it.
    pub(super) stated_resistance: Option<f64>,
    /// `true` if the forces on the grains of the cell are included in the balance of momentum.
    pub(super) counts: bool,
    /// Solid fraction of the neighbourhood; 0 without grains.
    pub(super) neighbourhood_fraction: f64,
    /// Fraction of the volume of the grains whose displacement is compensated by water of other cells: the water
    /// displaced by a lone grain returns next to it.
    pub(super) displaced: f64,
    /// Weight of the law of a bed; the remainder is that of dilute water.
    pub(super) dense: f64,
    /// Factor of the drag in dilute water, for the gradient that its reaction does not build up.
    pub(super) dilute: f64,
    /// Flux of the water at which the coefficients of drag are taken \[m/s\].
    pub(super) flux: [f64; 3],
    /// Secant iteration for this flux.
    pub(super) secant: Secant,
    /// Ratio of the drag along each axis to the mean.
    pub(super) ratios: [f64; 3],
}

/// Water of all cells.
pub(super) struct Water {
    /// Laws and porosities of the cells; none if a cell is outside the walls.
    pub(super) ground: Vec<Option<Ground>>,
    /// Fraction of the reaction of the grains of a cell that moves its water, 0 to 1.
    pub(super) coupled: Vec<f64>,
    /// Flux of the water \[m/s\].
    pub(super) flux: Vec<[f64; 3]>,
    /// Gradient of the reduced pressure \[Pa/m\].
    pub(super) gradient: Vec<[f64; 3]>,
    /// Resistance of stationary walls and zones without grains, along each axis \[Pa s/m²\].
    pub(super) still: Vec<[f64; 3]>,
    /// Friction of open water in it, for the next round.
    pub(super) friction_next: Vec<[f64; 3]>,
    /// Speed at which the friction of open water is taken \[m/s\].
    pub(super) speed: Vec<f64>,
    /// Iteration for that speed.
    pub(super) friction: Vec<Secant>,
    /// Magnitude of the gradient \[Pa/m\].
    pub(super) steepness: Vec<f64>,
    /// Weight of each cell in the change of a round, 0 to 1.
    pub(super) weight: Vec<f64>,
    /// Flux of the water without a gradient \[m/s\], and its decrease per gradient [m²/(Pa s)], along each axis.
    pub(super) flow: Vec<[(f64, f64); 3]>,
    /// Total conductivity of water and grains, its ratios along the axes, and the flux carried by the grains.
    pub(super) conductivity: Vec<f64>,
    pub(super) ratios: Vec<[f64; 3]>,
    pub(super) carried: Vec<[f64; 3]>,
    /// `true` if some cell has an anisotropic conductivity.
    pub(super) directed: bool,
    /// Channels of open water.
    pub(super) channels: OpenWater,
    /// Permeability of open water along each axis \[m2\].
    pub(super) open: Vec<[f64; 3]>,
    /// Roughness height of channels \[m\].
    pub(super) roughness: f64,
    /// `true` if there is open water.
    pub(super) has_open: bool,
}

impl Water {
    /// Returns stationary water.
    pub(super) fn new(grid: SeepageGrid, pressure: &Pressure, walls: [[bool; 2]; 3]) -> Self {
        let n = grid.count();
        let face =
            |cell: usize, axis: usize, upper: bool| match pressure.condition(cell, axis, upper) {
                Some(Condition::NoFlow {}) => Face::Wall,
                Some(Condition::Head { .. }) => Face::Reservoir,
                Some(_) => Face::Stream,
                None if walls[axis][usize::from(upper)] => Face::Wall,
                None => Face::Unstated,
            };
        Self {
            ground: vec![None; n],
            coupled: vec![0.0; n],
            flux: vec![[0.0; 3]; n],
            gradient: vec![[0.0; 3]; n],
            still: vec![[0.0; 3]; n],
            friction_next: vec![[0.0; 3]; n],
            speed: vec![0.0; n],
            friction: vec![Secant::default(); n],
            steepness: vec![0.0; n],
            weight: vec![1.0; n],
            flow: vec![[(0.0, 0.0); 3]; n],
            conductivity: vec![0.0; n],
            ratios: vec![[1.0; 3]; n],
            carried: vec![[0.0; 3]; n],
            directed: false,
            channels: OpenWater::new(grid, face),
            open: vec![[1.0; 3]; n],
            roughness: 0.0,
            has_open: false,
        }
    }

    /// Computes the magnitudes of the gradients of a restored run.
    pub(super) fn update_gradient_magnitudes(&mut self) {
        for (steepness, gradient) in self.steepness.iter_mut().zip(&self.gradient) {
            *steepness = norm(*gradient);
        }
    }
}

/// Secant iteration for the speed of a cell at which its coefficient is taken and which results from it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Secant {
    /// Logarithms of the speed used and the resulting speed in the last round.
    last: Option<(f64, f64)>,
    /// Derivative d log found/d log used: between minus the slope of the law if the gradient is given, and 0 if the
    /// flux is.
    response: Option<f64>,
}

impl Secant {
    /// Returns the speed for the next iteration, at which the used and the resulting speed agree if the response is
    /// constant. `slope` is d log R/d log u of the law.
    pub(super) fn next(&mut self, used: f64, found: f64, slope: f64) -> f64 {
        if used <= 0.0 || found <= 0.0 {
            return found;
        }
        let (used, found) = (used.ln(), found.ln());
        if let Some((used_before, found_before)) = self.last {
            let step = used - used_before;
            if step.abs() > NOISE {
                self.response = Some((found - found_before) / step);
            }
        }
        self.last = Some((used, found));
        let response = self.response.unwrap_or(-slope).clamp(-slope, 0.0);
        ((found - response * used) / (1.0 - response)).exp()
    }
}
