//! Limit of explicit drag: the longest coupling interval for which the drag of seeping water is stable.
//!
//! The force of a coupling stays constant over its interval T. With the drag `pull - rate v` at the start of the
//! interval, the velocity of a grain of mass m changes from v to v + T/m (pull - rate v). Beyond T = 2 m/rate,
//! twice the time in which drag stops it, its velocity changes sign and grows. The drag at the end of the interval
//! (`coupling::seepage`, `semi_implicit_drag`) is stable for any interval.
//!
//! In creeping flow the stopping time is longest in loose ground and shortest in the densest. A case is refused if
//! the interval is too long even for the loosest ground, at the maximum porosity of the permeability. It is
//! unstable if the interval is too long for the densest cell of the listed grains, or for the densest packing of
//! equal grains.

use super::Clock;
use super::margin::{Margin, margin};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::grains::GrainSource;
use crate::scene::seepage::Seepage;
use base::error::Remedy;
use darcy::drag::{BedConditions, GrainSize};
use darcy::porosity::measure;
use darcy::{Enclosure, Equations, Liquid, Openness, Pores};

/// Compares the interval with the shortest response time of a grain.
pub(super) fn check(
    scene: &Scene,
    clock: &Clock,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let Some(seepage) = scene
        .seepage
        .as_ref()
        .filter(|s| !s.written.semi_implicit_drag && s.written.unsaturated.is_none())
    else {
        return;
    };
    let Some((smallest, material)) = lightest(scene) else {
        return;
    };
    let mass = scene.mass(material, smallest);
    let grain = GrainSize::new(scene.grid.dimension, smallest);
    let times = |porosity: f64| stopping_times(seepage, &grain, mass, porosity);
    let shortest = times(porosity(scene, seepage)).fold(f64::INFINITY, f64::min);
    let longest = times(seepage.written.porosity_cap()).fold(shortest, f64::max);
    let path = "fluid.darcy.coupling_interval";
    let interval = clock.time_step;
    margins.push(margin(
        "coupling interval / twice the response time of a grain",
        interval,
        2.0 * shortest,
        path,
    ));
    if interval < 2.0 * shortest {
        return;
    }
    let most = (2.0 * shortest / clock.solid_time_step).ceil() - 1.0;
    let text = if most >= 1.0 {
        format!(
            "use at most {} solid steps per interval, or `semi_implicit_drag`",
            number(most)
        )
    } else {
        "use `semi_implicit_drag`".to_owned()
    };
    let remedy = Remedy::from(text).set("fluid.darcy.semi_implicit_drag", true);
    let reason = |time: f64| {
        format!(
            "explicit drag is constant for {} s, more than twice the {} s in which it stops a grain: the \
             velocity of the grain changes sign and grows",
            number(interval),
            number(time)
        )
    };
    if interval >= 2.0 * longest {
        findings.error(path, reason(longest), remedy);
    } else {
        findings.unstable(path, reason(shortest), remedy);
    }
}

/// Returns radius and material of the smallest grain.
fn lightest(scene: &Scene) -> Option<(f64, usize)> {
    let kinds = super::critical_step::moving(scene).into_iter();
    kinds
        .map(|(material, radius)| (radius, material))
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Returns the times in which drag stops a grain of this mass \[kg\] relative to the water \[s\], one for each
/// medium of the zones.
pub(super) fn stopping_times(
    seepage: &Seepage,
    grain: &GrainSize,
    mass: f64,
    porosity: f64,
) -> impl Iterator<Item = f64> {
    let written = &seepage.written;
    let porosity = porosity
        .max(written.least_porosity)
        .min(written.porosity_cap());
    let law = written.drag();
    grain_beds(seepage, porosity, grain).map(move |one| {
        law.model()
            .stopping_time(&one.bed, grain, mass, one.measure)
    })
}

/// Bed around a grain.
pub(super) struct GrainBed {
    pub(super) bed: BedConditions,
    /// Factor of the grain's velocity relative to the flux.
    pub(super) measure: f64,
}

/// Returns the bed of this porosity around a grain in stationary water, in each medium of the zones, and outside the
/// zones.
pub(super) fn grain_beds(
    seepage: &Seepage,
    porosity: f64,
    grain: &GrainSize,
) -> impl Iterator<Item = GrainBed> {
    let written = &seepage.written;
    let beds = bed_properties(seepage, (porosity, grain.diameter), written.liquid(), 0.0);
    beds.into_iter()
        .map(move |(bed_porosity, permeability)| GrainBed {
            bed: BedConditions {
                density: written.density,
                viscosity: written.viscosity,
                porosity: bed_porosity,
                solid: 1.0 - porosity,
                permeability,
            },
            measure: match written.equations {
                Equations::Paper => 1.0,
                Equations::Corrected => bed_porosity,
            },
        })
}

/// Returns the porosity and permeability \[m²\] of a bed of this porosity and mean diameter \[m\] under a gradient
/// \[Pa/m\]: in each medium of the zones, and outside the zones.
pub(super) fn bed_properties(
    seepage: &Seepage,
    (porosity, diameter): (f64, f64),
    liquid: Liquid,
    gradient: f64,
) -> Vec<(f64, f64)> {
    let resistance = seepage.written.resistance();
    let law = resistance.model();
    let Some(zones) = &seepage.zones else {
        let permeability = law.permeability(porosity, diameter, liquid, gradient);
        return vec![(porosity, permeability)];
    };
    let media = zones.media(seepage.cell_count());
    let bed = (porosity, diameter);
    media
        .map(|medium| {
            let permeability = medium.permeability(law, bed, liquid, gradient, true);
            (medium.porosity(true).unwrap_or(porosity), permeability)
        })
        .collect()
}

/// Returns the coarse grid in `dimension` dimensions, with the fraction of each cell and face inside the walls.
#[must_use]
pub fn openness(seepage: &Seepage, dimension: usize) -> Openness {
    let grid = seepage.coarse_grid(dimension);
    let enclosure = if seepage.planes.is_empty() {
        Enclosure::Everything
    } else {
        Enclosure::HalfSpaces(seepage.planes.clone())
    };
    let drains: Vec<_> = seepage
        .drains
        .iter()
        .map(|drain| drain.cells.clone())
        .collect();
    Openness::measure(&grid, &enclosure)
        .with_structures(&seepage.solids)
        .with_drains(&drains)
}

/// Returns the pores of the coarse grid without grains, with the porosity method of the case.
#[must_use]
pub fn pores(seepage: &Seepage, openness: &Openness) -> Pores {
    Pores::new(
        openness.grid.clone(),
        seepage.written.porosity,
        seepage.written.mean_diameter,
    )
}

/// Returns the porosity of the densest cell of listed grains, or that of the densest packing of equal grains for a
/// preparation.
pub(super) fn porosity(scene: &Scene, seepage: &Seepage) -> f64 {
    let dimension = scene.grid.dimension;
    let densest = if dimension == 2 { 0.0931 } else { 0.2595 };
    let list = match scene.grains.as_ref().map(|grains| &grains.source) {
        Some(GrainSource::List(list) | GrainSource::File { grains: list, .. }) => list,
        _ => return densest,
    };
    let openness = openness(seepage, dimension);
    let pores = pores(seepage, &openness);
    let mut solid = vec![0.0; openness.inside.len()];
    let mut parts = Vec::new();
    for grain in list {
        let volume = measure(dimension, grain.radius);
        pores.parts(grain.position, grain.radius, &mut parts);
        for &(cell, part) in &parts {
            solid[cell] += part * volume;
        }
    }
    let cell = openness.grid.volume([0; 3]);
    let filled = solid.iter().zip(&openness.inside);
    let fullest = filled
        .filter(|(_, inside)| **inside > 0.0)
        .map(|(solid, inside)| solid / (inside * cell))
        .fold(0.0, f64::max);
    (1.0 - fullest).clamp(densest, 1.0)
}
