//! Porous zones of a resolved flow: their cells, and the quantities that a plan needs.
//!
//! A cell gets the resistance times the fraction of its volume in the zone, φ = ½ - d/h limited to [0, 1] with the
//! signed distance d of its centre. This is exact for faces of boxes, so that a zone of any thickness causes the
//! pressure loss of its own thickness. Resistances of overlapping zones add up.

use super::{FlowTerm, TermExcess, TermLoss, TermStepLimit};
use crate::scene::findings::{Findings, LATTICE_PATH as PATH, number};
use crate::scene::flow::Flow;
use crate::scene::grid::Grid;
use crate::scene::{structures, unique};
use base::error::Remedy;
use base::number::real;
use case::Case;
use case::fluid::Fluid;
use lbm::lanes::Stored;
use lbm::term::TermBuilder;
use lbm::term::porous::{Coefficients, Porous, Resistance, Resisted};
use serde::Serialize;
use std::sync::Arc;
use structure::Images;

/// Porous zones of a flow, in the order of the case.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct PorousZones(pub Vec<PorousZone>);

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
/// Largest number of cells along each axis at which it is sampled which cells a zone reaches, in 2-D and 3-D.
const PLACES: [usize; 2] = [256, 40];
/// Number of samples along a column.
const SAMPLES: usize = 256;

/// Returns the porous zones of a case, if it has any.
pub(super) fn zones(case: &Case, grid: &Grid, findings: &mut Findings) -> Option<PorousZones> {
    let Some(Fluid::LatticeBoltzmann(lbm)) = &case.fluid else {
        return None;
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
            structures::check_cells(case, grid, &images, &shape, findings);
            zones.push(PorousZone {
                name: written.name.clone(),
                path,
                solid: Arc::new(images),
                coefficients,
            });
        }
    }
    (!lbm.porous_zones.is_empty()).then_some(PorousZones(zones))
}

impl PorousZones {
    /// Returns the function that makes the term for a slab.
    pub(super) fn build<S: Stored>(&self, grid: &Grid, flow: &Flow) -> TermBuilder<S> {
        let (zones, grid, time_step) = (self.0.clone(), grid.clone(), flow.time_step);
        Box::new(move |populations, start| {
            let cells = cells(&zones, (&grid, time_step), start, populations.cells());
            Box::new(Porous::new(populations, start, &cells))
        })
    }
}

impl FlowTerm for PorousZones {
    fn name(&self) -> &'static str {
        "porous zones"
    }

    fn short_name(&self) -> &'static str {
        "zones"
    }

    fn path(&self) -> &'static str {
        "fluid.lattice_boltzmann.porous_zones"
    }

    fn describe(&self) -> Vec<[String; 3]> {
        self.0.iter().map(PorousZone::describe).collect()
    }

    fn unmeasured(&self) -> Option<String> {
        Some("flow next to porous zones".to_owned())
    }

    /// Returns the bound by zones that close a section; infinite if the water can bypass all zones.
    fn fastest(&self, grid: &Grid, axis: usize, drop: f64) -> f64 {
        let bounds = self.0.iter().map(|zone| {
            let Thickness { smallest, .. } = zone.thickness(grid, axis);
            if smallest > 0.0 {
                zone.coefficients.velocity(drop / smallest)
            } else {
                f64::INFINITY
            }
        });
        bounds.fold(f64::INFINITY, f64::min)
    }

    fn losses(&self, grid: &Grid, axis: usize, discharge: f64) -> Vec<TermLoss> {
        let across = (0..grid.dimension).filter(move |a| *a != axis);
        let area: f64 = across.map(|a| grid.size[a]).product();
        let losses = self.0.iter().map(move |zone| {
            let Thickness { largest, open, .. } = zone.thickness(grid, axis);
            let speed = discharge / area;
            let through = zone.coefficients.deceleration(speed) * largest;
            // If the zone leaves a part of the section open, all the water may pass there: a contraction loses at
            // most (U/open)².
            let past = (speed / open).powi(2);
            TermLoss {
                what: "the resistance of a porous zone",
                path: zone.path.clone(),
                loss: through.min(past),
            }
        });
        losses.collect()
    }

    fn cells(&self, grid: &Grid) -> f64 {
        let all: f64 = grid.cells.iter().map(|n| real(*n)).product();
        let filled = |zone: &PorousZone| zone.filled(grid);
        all * self.0.iter().map(filled).sum::<f64>().min(1.0)
    }

    fn step_limit(&self, speed: f64) -> Option<TermStepLimit> {
        let rate =
            |zone: &PorousZone| zone.coefficients.linear + zone.coefficients.quadratic * speed;
        let zone = self.0.iter().max_by(|a, b| rate(a).total_cmp(&rate(b)))?;
        let name = &zone.name;
        Some(TermStepLimit {
            requirement: format!("a stable resistance of the porous zone `{name}`"),
            margin: "time step for the resistance of a porous zone",
            path: format!("{}.resistance", zone.path),
            stable: MAX_WITHOUT_OSCILLATION / rate(zone),
            with_eddies: MAX_WITH_EDDIES / rate(zone),
            excess: TermExcess {
                subject: format!("the resistance of the zone `{name}` removes"),
                object: "times the momentum of its water".to_owned(),
                consequence: "above 2 the velocity oscillates from step to step".to_owned(),
                instead: "for slow flow through soil use `fluid.darcy`".to_owned(),
                surface: format!("at the surface of the zone `{name}`"),
            },
        })
    }
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

    /// Returns the fraction of the cells of the domain that the zone reaches, from samples.
    fn filled(&self, grid: &Grid) -> f64 {
        let counts: [usize; 3] = std::array::from_fn(|a| {
            if a < grid.dimension {
                grid.cells[a].min(PLACES[grid.dimension - 2])
            } else {
                1
            }
        });
        let total = counts.iter().product::<usize>();
        let reached = (0..total).filter(|&place| {
            let mut rest = place;
            let cell = std::array::from_fn(|a| {
                let index = rest % counts[a];
                rest /= counts[a];
                // The cell in the middle of the part of the axis.
                (2 * index + 1) * grid.cells[a] / (2 * counts[a])
            });
            self.fraction(grid, cell) > 0.0
        });
        real(reached.count()) / real(total)
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
    fn describe(&self) -> [String; 3] {
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
fn cells(
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
