//! Construction of the fluid with its coupling from a plan.

use base::units::LatticeUnits;
use case::coupling::{
    BounceBack as WrittenBounceBack, Coupling, GapVelocity as WrittenGapVelocity,
    Scheme as WrittenScheme, SolidFraction,
};
use coupling::body_map::{GapVelocity, NarrowGaps, Rules};
use coupling::bounce_back::{self, BounceBack};
use coupling::partially_saturated::{self, PartiallySaturated};
use coupling::solid_fraction::FractionMethod;
use coupling::water::Water;
use dem::space::Space;
use lbm::fluid::Fluid;
use lbm::lanes::Stored;
use lbm::links::Scheme;
use lbm::saturation::SaturationMethod as Saturation;
use plan::Plan;
use std::sync::Arc;
use structure::Images;

/// Returns the hydrostatic buoyancy per volume of a solid \[N/m³\] that the pressure of the lattice does not contain.
fn buoyancy(plan: &Plan) -> [f64; 3] {
    let Some(flow) = &plan.scene.flow else {
        return [0.0; 3];
    };
    // Where gravity does not act on the fluid, the lattice computes the excess over the hydrostatic
    // pressure.
    std::array::from_fn(|a| {
        if flow.gravity_acts[a] {
            0.0
        } else {
            -flow.density * plan.scene.gravity[a]
        }
    })
}

/// Returns a fluid with the coupling of the plan; half-way bounce-back if the plan names none.
#[must_use]
pub fn flow<Sp: Space, S: Stored>(
    plan: &Plan,
    fluid: Fluid<S>,
    units: LatticeUnits,
) -> Water<Sp, S> {
    let origin = [0.0; 3];
    match &plan.scene.coupling {
        Some(Coupling::PartiallySaturated(written)) => {
            let settings = partially_saturated::PartiallySaturatedSettings {
                fractions: match written.solid_fraction {
                    SolidFraction::Exact => FractionMethod::Exact,
                    SolidFraction::Samples(n) => FractionMethod::Samples(n),
                    SolidFraction::Linear => FractionMethod::Linear,
                },
                without_inner_water: written.exclude_inner_fluid,
                buoyancy: buoyancy(plan),
            };
            let flow = PartiallySaturated::new(fluid, units, origin, settings)
                .with_structures(structures(plan), plan.scene.surface.is_none());
            Water::Saturated(Box::new(flow))
        }
        Some(Coupling::BounceBack(written)) => {
            let settings = links(plan, written);
            let flow = BounceBack::new(fluid, units, origin, settings).with_structures(
                structures(plan),
                written.scheme == WrittenScheme::Interpolated,
            );
            Water::BounceBack(Box::new(flow))
        }
        None => {
            let settings = links(plan, &WrittenBounceBack::default());
            // Interpolated links read further cells, which a free surface may leave without water.
            let interpolated = plan.scene.surface.is_none();
            let flow = BounceBack::new(fluid, units, origin, settings)
                .with_structures(structures(plan), interpolated);
            Water::BounceBack(Box::new(flow))
        }
    }
}

/// Returns the structures in contact with water.
pub(super) fn structures(plan: &Plan) -> Vec<Arc<Images>> {
    let structures = plan.scene.structures.iter();
    structures
        .filter(|structure| structure.stops.water())
        .map(|structure| Arc::clone(&structure.solid))
        .collect()
}

/// Returns the collision operator of cells covered by solids; none if solids use bounce-back at links.
#[must_use]
pub fn saturation(plan: &Plan) -> Option<Saturation> {
    let Some(Coupling::PartiallySaturated(written)) = &plan.scene.coupling else {
        return None;
    };
    let flow = plan.scene.flow.as_ref()?;
    Some(Saturation {
        operator: flow.solid_operator(written),
        weighting: flow.weighting(written),
    })
}

fn links(plan: &Plan, written: &WrittenBounceBack) -> bounce_back::BounceBackSettings {
    let scene = &plan.scene;
    bounce_back::BounceBackSettings {
        scheme: match written.scheme {
            WrittenScheme::HalfWay => Scheme::HalfWay,
            WrittenScheme::Interpolated => Scheme::Interpolated,
        },
        average: written.force_average,
        rules: Rules {
            hydraulic_radius_factor: written.hydraulic_radius_factor,
            first_grain: scene.first_grain(),
            interpolated: written.scheme == WrittenScheme::Interpolated,
            narrow: written.narrow_gaps(scene.grid.dimension).map(
                |(solid_neighbours, velocity)| NarrowGaps {
                    solid_neighbours: solid_neighbours as usize,
                    velocity: match velocity {
                        WrittenGapVelocity::Mean => GapVelocity::Mean,
                        WrittenGapVelocity::Zero => GapVelocity::Zero,
                    },
                },
            ),
        },
        buoyancy: buoyancy(plan),
    }
}
