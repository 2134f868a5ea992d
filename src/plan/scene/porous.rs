//! Porous zones of a resolved flow: their cells, and the quantities that a plan needs.
//!
//! A cell gets the resistance times the fraction of its volume in the zone, φ = ½ - d/h limited to [0, 1] with the
//! signed distance d of its centre. This is exact for faces of boxes, so that a zone of any thickness causes the
//! pressure loss of its own thickness. Resistances of overlapping zones add up.

use super::findings::{Findings, LATTICE_PATH as PATH, number};
use super::grid::Grid;
use super::{structures, unique};
use base::error::Remedy;
use base::number::real;
use case::Case;
use case::fluid::Fluid;
use lbm::term::porous::{Coefficients, Resistance, Resisted};
use serde::Serialize;
use std::sync::Arc;
use structure::Images;

/// Zone that resists the water.
#[derive(Clone, Debug, Serialize)]
pub struct PorousZone {
    /// Name of the zone.
    pub name: String,
    /// JSON path of the zone.
    pub path: String,
    /// Solid that the zone fills, with periodic images.
    #[serde(skip)]
    pub solid: Arc<Images>,
    /// Coefficients of its resistance.
    pub coefficients: Coefficients,
}

impl PartialEq for PorousZone {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.coefficients == other.coefficients
    }
}

/// Thickness of a zone along an axis.
struct Thickness {
    /// Smallest and largest thickness \[m\].
    smallest: f64,
    largest: f64,
    /// Fraction of the section that the zone leaves open.
    open: f64,
}

/// Maximum resistance of a step, a + b |u| in lattice units, for which the trapezoidal rule does not oscillate.
const MAX_WITHOUT_OSCILLATION: f64 = 2.0;
/// Maximum resistance of a step in a zone with an eddy viscosity: the velocity read by the model is wrong by half
/// of it.
const MAX_WITH_EDDIES: f64 = 0.2;
/// Number of columns along each transverse axis on which the thickness of a zone is sampled.
const COLUMNS: usize = 16;
/// Number of samples along a column.
const SAMPLES: usize = 256;

/// Returns the porous zones of a case.
pub(crate) fn zones(case: &Case, grid: &Grid, findings: &mut Findings) -> Vec<PorousZone> {
    let Some(Fluid::LatticeBoltzmann(lbm)) = &case.fluid else {
        return Vec::new();
    };
    let mut known = Vec::new();
    let mut zones = Vec::new();
    for (n, written) in lbm.porous_zones.iter().enumerate() {
        let path = format!("{PATH}.porous_zones[{n}]");
        unique(&mut known, &written.name, &format!("{path}.name"), findings);
        if let Resistance::Ergun { porosity, .. } = written.resistance
            && !(0.0 < porosity && porosity < 1.0)
        {
            // A negative value is refused by its range.
            continue;
        }
        let coefficients = written.resistance.coefficients(lbm.kinematic_viscosity);
        if coefficients == Coefficients::default() {
            let law = format!("{path}.resistance.darcy_forchheimer");
            findings.error(
                &law,
                "the zone has neither a permeability nor an inertial coefficient, so that it does not resist the \
                 flow",
                Remedy::from("add one of them, or remove the zone")
                    .set(format!("{law}.permeability"), 1e-8),
            );
        }
        let shape = format!("{path}.shape");
        if let Some(images) = structures::images(case, grid, &written.shape, &shape, findings) {
            zones.push(PorousZone {
                name: written.name.clone(),
                path,
                solid: Arc::new(images),
                coefficients,
            });
        }
    }
    zones
}

impl PorousZone {
    /// Returns the fraction of a cell, given by its coordinates in the domain, that the zone fills.
    fn fraction(&self, grid: &Grid, cell: [usize; 3]) -> f64 {
        let h = grid.spacing;
        let centre = std::array::from_fn(|a| {
            if a < grid.dimension {
                (real(cell[a]) + 0.5) * h
            } else {
                0.0
            }
        });
        (0.5 - self.solid.distance(centre) / h).clamp(0.0, 1.0)
    }

    /// Samples the thickness of the zone along an axis, on columns through the domain.
    fn thickness(&self, grid: &Grid, axis: usize) -> Thickness {
        let across: Vec<usize> = (0..grid.dimension).filter(|a| *a != axis).collect();
        let columns = COLUMNS.pow(u32::try_from(across.len()).unwrap_or(1));
        let step = grid.size[axis] / real(SAMPLES);
        let mut found = Thickness {
            smallest: f64::INFINITY,
            largest: 0.0,
            open: 0.0,
        };
        for column in 0..columns {
            let mut at = [0.0; 3];
            let mut place = column;
            for a in &across {
                at[*a] = (real(place % COLUMNS) + 0.5) / real(COLUMNS) * grid.size[*a];
                place /= COLUMNS;
            }
            let parts = (0..SAMPLES).map(|n| {
                at[axis] = (real(n) + 0.5) * step;
                (0.5 - self.solid.distance(at) / step).clamp(0.0, 1.0)
            });
            let thickness = step * parts.sum::<f64>();
            found.smallest = found.smallest.min(thickness);
            found.largest = found.largest.max(thickness);
            if thickness == 0.0 {
                found.open += 1.0 / real(columns);
            }
        }
        found
    }

    /// Returns name, resistance and reason, as printed in a plan.
    pub(crate) fn describe(&self) -> [String; 3] {
        let Coefficients { linear, quadratic } = self.coefficients;
        [
            format!("porous zone {}", self.name),
            format!(
                "resistance of {} 1/s and {} 1/m (Darcy and Forchheimer)",
                number(linear),
                number(quadratic)
            ),
            "requested; inside the zone the water has the inertia and viscosity of open water"
                .into(),
        ]
    }
}

/// Returns the cells of a part of the domain with a resistance, in lattice units at a time step \[s\]. `first` is
/// the first cell of the part and `cells` its size.
pub fn cells(
    zones: &[PorousZone],
    (grid, time_step): (&Grid, f64),
    first: [usize; 3],
    cells: [usize; 3],
) -> Vec<Resisted> {
    let mut found = Vec::new();
    for z in first[2]..first[2] + cells[2] {
        for y in first[1]..first[1] + cells[1] {
            for x in first[0]..first[0] + cells[0] {
                let cell = [x, y, z];
                let mut sum = Resisted {
                    cell,
                    linear: 0.0,
                    quadratic: 0.0,
                };
                for zone in zones {
                    let part = zone.fraction(grid, cell);
                    sum.linear += part * zone.coefficients.linear * time_step;
                    sum.quadratic += part * zone.coefficients.quadratic * grid.spacing;
                }
                if sum.linear > 0.0 || sum.quadratic > 0.0 {
                    found.push(sum);
                }
            }
        }
    }
    found
}

/// Returns an upper bound of the speed [m/s] that a pressure drop over the density [m²/s²] along an axis drives
/// through zones that close a section; infinite if the water can bypass all zones.
pub(crate) fn fastest(zones: &[PorousZone], grid: &Grid, axis: usize, drop: f64) -> f64 {
    let bounds = zones.iter().map(|zone| {
        let Thickness { smallest, .. } = zone.thickness(grid, axis);
        if smallest > 0.0 {
            zone.coefficients.velocity(drop / smallest)
        } else {
            f64::INFINITY
        }
    });
    bounds.fold(f64::INFINITY, f64::min)
}

/// Returns the pressure losses over the density [m²/s²] of a discharge through zones along an axis, with the paths
/// of the zones.
pub(crate) fn losses<'a>(
    zones: &'a [PorousZone],
    grid: &'a Grid,
    axis: usize,
    discharge: f64,
) -> impl Iterator<Item = (&'a str, f64)> {
    let across = (0..grid.dimension).filter(move |a| *a != axis);
    let area: f64 = across.map(|a| grid.size[a]).product();
    zones.iter().map(move |zone| {
        let Thickness { largest, open, .. } = zone.thickness(grid, axis);
        let speed = discharge / area;
        let through = zone.coefficients.deceleration(speed) * largest;
        // If the zone leaves a part of the section open, all the water may pass there: a contraction loses at most
        // (U/open)².
        let past = (speed / open).powi(2);
        (zone.path.as_str(), through.min(past))
    })
}

/// Limit of the time step by the resistance of a zone.
pub(crate) struct StepLimit<'a> {
    /// Zone with the largest resistance.
    pub(crate) zone: &'a PorousZone,
    /// Longest time step \[s\] without oscillation.
    pub(crate) stable: f64,
    /// Longest time step \[s\] for accurate velocities in an eddy-viscosity model.
    pub(crate) with_eddies: f64,
}

/// Returns the limit of the time step at a speed [m/s]; none without zones.
pub(crate) fn step_limit(zones: &[PorousZone], speed: f64) -> Option<StepLimit<'_>> {
    let rate = |zone: &PorousZone| zone.coefficients.linear + zone.coefficients.quadratic * speed;
    let zone = zones.iter().max_by(|a, b| rate(a).total_cmp(&rate(b)))?;
    Some(StepLimit {
        zone,
        stable: MAX_WITHOUT_OSCILLATION / rate(zone),
        with_eddies: MAX_WITH_EDDIES / rate(zone),
    })
}
