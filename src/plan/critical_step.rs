//! The critical solid time step: that of the lightest grain or free body with its stiffest contact.

use crate::scene::Scene;
use crate::scene::bodies::Mobility;
use crate::scene::grains::GrainSource;
use crate::scene::observe::RegionAction;
use base::number::to_u32;
use dem::contact::TimeLimits;

/// Critical time step and the grain that determines it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Critical {
    /// The shortest limit of any grain \[s\].
    pub(crate) time_step: f64,
    /// Shortest 2 sqrt(m/k) and shortest Rayleigh time \[s\].
    pub(crate) limits: TimeLimits,
}

/// Returns the material and radius \[m\] of spheres and discs that move under forces: the smallest of each source.
pub(super) fn moving(scene: &Scene) -> Vec<(usize, f64)> {
    let mut moving: Vec<(usize, f64)> = Vec::new();
    if let Some(grains) = &scene.grains {
        match &grains.source {
            GrainSource::List(list) | GrainSource::File { grains: list, .. } => {
                moving.extend(list.iter().map(|g| (g.material, g.radius)))
            }
            _ => moving.extend(
                grains
                    .materials()
                    .filter_map(|material| Some((material, grains.radii?.0))),
            ),
        }
    }
    for region in &scene.regions {
        if let RegionAction::Generate {
            radii, material, ..
        } = &region.action
        {
            moving.push((*material, radii.bounds().0));
        }
    }
    let spheres = scene.bodies.iter().filter(|b| b.solid.is_none());
    let free = spheres.filter(|b| b.mobility == Mobility::Free);
    moving.extend(free.map(|b| (b.material, b.radius)));
    moving
}

/// Returns the largest radius \[m\] of the discs and spheres of a scene; 0 without.
pub(crate) fn largest_radius(scene: &Scene) -> f64 {
    let grains = scene.grains.iter();
    let grains = grains.filter_map(|grains| Some(grains.radii?.1));
    let fed = scene
        .regions
        .iter()
        .filter_map(|region| match &region.action {
            RegionAction::Generate { radii, .. } => Some(radii.bounds().1),
            _ => None,
        });
    let bodies = scene.bodies.iter().filter(|body| body.solid.is_none());
    let bodies = bodies.map(|body| body.radius);
    grains.chain(fed).chain(bodies).fold(0.0, f64::max)
}

/// Sphere or disc whose contacts limit the solid time step.
pub(crate) struct DecisiveGrain {
    pub(crate) material: usize,
    /// Radius \[m\].
    pub(crate) radius: f64,
    /// Mass [kg; in 2-D kg/m].
    pub(crate) mass: f64,
}

/// Returns the sphere or disc with the shortest limit.
pub(crate) fn decisive(scene: &Scene) -> Option<DecisiveGrain> {
    let law = scene.contact.as_ref()?.model();
    let largest = largest_radius(scene);
    let known = moving(scene).into_iter();
    let known = known.filter(|(material, _)| *material < scene.materials.len());
    let limits = known.map(|(material, radius)| {
        let mass = scene.mass(material, radius);
        let limits = law.time_limits(to_u32(material), [radius, largest], mass);
        let grain = DecisiveGrain {
            material,
            radius,
            mass,
        };
        (limits.shorter(), grain)
    });
    limits
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, grain)| grain)
}

/// Returns 2 sqrt(m/k) of the lightest grain or free body with its stiffest contact, and for elastic spheres the
/// Rayleigh time as well; for a block with all its faces in contact.
pub(crate) fn critical_solid_time_step(scene: &Scene) -> Option<Critical> {
    let law = scene.contact.as_ref()?.model();
    let largest = largest_radius(scene);
    let of_spheres = moving(scene)
        .into_iter()
        .filter(|(material, _)| *material < scene.materials.len())
        .map(|(material, radius)| {
            let mass = scene.mass(material, radius);
            law.time_limits(to_u32(material), [radius, largest], mass)
        });
    let of_blocks = scene.polyhedra().filter(|one| one.free).filter_map(|one| {
        let mass = scene.density(one.material) * one.solid.shape.volume();
        law.time_limits_of_block(to_u32(one.material), &one.solid.shape, mass)
    });
    let mut shortest: Option<TimeLimits> = None;
    for limits in of_spheres.chain(of_blocks) {
        if !(limits.shorter().is_finite() && limits.shorter() > 0.0) {
            continue;
        }
        shortest = Some(shortest.map_or(limits, |known| TimeLimits {
            spring: known.spring.min(limits.spring),
            rayleigh: known.rayleigh.zip(limits.rayleigh).map(|(a, b)| a.min(b)),
        }));
    }
    shortest.map(|limits| Critical {
        time_step: limits.shorter(),
        limits,
    })
}
