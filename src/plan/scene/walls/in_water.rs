//! Walls for grains at the surfaces of structures, and a check for walls that do not stop water.

use super::{SceneWall, across_periodic, periods, report_large_grains};
use crate::scene::auto::features::grain_diameters;
use crate::scene::findings::Findings;
use crate::scene::grid::Grid;
use crate::scene::structures::{NO_SHAPE, Structure};
use base::error::{Remedy, number};
use base::number::real;
use base::vector::dot;
use case::Case;
use case::darcy::Enclosure;
use case::fluid::Fluid;
use case::observe::Action;
use case::structures::Stops;
use dem::FacetSurface;
use dem::polyhedron::PlacedPolyhedron;
use nalgebra::Vector3;
use std::sync::Arc;
use structure::{Facets, Images};

/// Maximum distance between a facet and the round surface that it approximates, as a fraction of the smallest grain
/// radius.
const SAGITTA: f64 = 0.01;
/// Number of facets that the curved structures of a scene share: a million facets take seconds and 2 GB.
const FACETS: usize = 400_000;
/// Number of facets that every structure may have, however many structures share the total.
const MIN_FACETS: usize = 1_000;

/// Returns the walls of structures for grains.
pub(super) fn walls_of_structures(
    case: &Case,
    grid: &Grid,
    structures: &[Structure],
    findings: &mut Findings,
) -> Vec<SceneWall> {
    for (n, structure) in structures.iter().enumerate() {
        if structure.stops.grains() {
            check_grains(case, structure, &format!("structures[{n}]"), findings);
        }
    }
    let moving = case.grains.is_some() || case.blocks.is_some() || !case.bodies.is_empty();
    if !moving {
        return Vec::new();
    }
    let extent = grid.size[..grid.dimension]
        .iter()
        .copied()
        .fold(0.0, f64::max);
    let smallest = grain_diameters(case).map_or(0.01 * extent, |(low, _)| low);
    let share = (FACETS / structures.len().max(1)).max(MIN_FACETS);
    let mut coarsest = None;
    let mut walls = Vec::new();
    for (n, structure) in structures.iter().enumerate() {
        let Some(material) = structure.material.filter(|_| structure.stops.grains()) else {
            continue;
        };
        let bare = SceneWall {
            name: structure.name.clone(),
            point: [0.0; 3],
            normal: [0.0; 3],
            surface: None,
            velocity: [0.0; 3],
            history: None,
            servo: None,
            material,
            temporary: false,
            from: None,
            until: None,
            face: None,
            structure: Some(n),
        };
        if let Some((point, normal)) = structure.solid.solid().plane() {
            if stops_grains(structure, (n, normal), grid, findings) {
                let wall = SceneWall {
                    point,
                    normal,
                    ..bare
                };
                walls.push(wall);
            }
            continue;
        }
        if let Some(axis) = structure.solid.may_overlap()
            && case.blocks.is_some()
        {
            findings.warn(
                &format!("structures[{n}].shape"),
                format!(
                    "the structure is longer than the domain along the periodic axis {}: where it overlaps its \
                     own image, blocks touch both surfaces and the contact is twice as stiff",
                    ["x", "y", "z"][axis]
                ),
                "shorten it to the length of the domain",
            );
        }
        // In 2-D the facets are strips normal to the plane.
        let (facets, ratio) = divided(&structure.solid, 0.5 * smallest, extent, share);
        if ratio > coarsest.map_or(SAGITTA * (1.0 + 1e-9), |(_, ratio)| ratio) {
            coarsest = Some((n, ratio));
        }
        if let Some(surface) = surface_of(&facets, grid, n, findings) {
            let path = format!("structures[{n}]");
            report_large_grains(case, &surface, &path, findings);
            let surface = Some(Arc::new(surface));
            walls.push(SceneWall { surface, ..bare });
        }
    }
    if let Some((n, ratio)) = coarsest {
        findings.warn(
            &format!("structures[{n}].shape"),
            format!(
                "grains meet the facets of this surface, which lie up to {} m inside it, {} of the smallest \
                 grain radius (at most {SAGITTA} is sought): a structure of this scene has at most {share} facets",
                number(0.5 * smallest * ratio),
                number(ratio)
            ),
            "use larger grains, or a smaller or flatter structure",
        );
    }
    walls
}

/// Warns of a structure that stops grains where there are none, or that is much smaller than each of them.
fn check_grains(case: &Case, structure: &Structure, path: &str, findings: &mut Findings) {
    let generated = (case.regions.iter()).any(|r| matches!(r.action, Action::Generate { .. }));
    let moving = case.grains.is_some() || case.blocks.is_some() || !case.bodies.is_empty();
    if !moving && !generated {
        if structure.stops == Stops::Grains {
            findings.warn(
                &format!("{path}.stops"),
                "this case has no grains, blocks or bodies that the structure could stop, so that it has no effect",
                Remedy::from("write all or water for a structure that stops water, or remove it")
                    .set(format!("{path}.stops"), "all"),
            );
        }
        return;
    }
    let extent = structure.solid.solid().extent();
    warn_of_size(case, extent, &format!("{path}.shape"), findings);
}

/// Warns of a solid between two corners \[m\] that is much smaller than each grain.
pub(super) fn warn_of_size(
    case: &Case,
    [low, high]: [[f64; 3]; 2],
    path: &str,
    findings: &mut Findings,
) {
    let spheres = case.blocks.is_none() && case.bodies.is_empty();
    let Some((smallest, _)) = grain_diameters(case).filter(|_| spheres) else {
        return;
    };
    let dimension = case.domain.size.0.len();
    // An infinite solid does not count as small.
    if (0..dimension).all(|a| high[a] - low[a] < NO_SHAPE * smallest) {
        findings.warn(
            path,
            format!(
                "the solid is smaller than {NO_SHAPE} of the smallest grain, {} m, so that it stops hardly any grain",
                number(smallest)
            ),
            "check that lengths are in m (the unit of a mesh is its `scale`), or remove it",
        );
    }
}

/// Returns `true` if structure `n`, a half-space with this normal, can stop grains; reports a plane across a periodic
/// axis.
fn stops_grains(
    structure: &Structure,
    (n, normal): (usize, [f64; 3]),
    grid: &Grid,
    findings: &mut Findings,
) -> bool {
    let Some(axis) = across_periodic(grid, normal) else {
        return true;
    };
    let path = format!("structures[{n}].stops");
    let reason = format!(
        "a plane across the periodic axis {axis} cannot stop grains, because grains would be on both \
         sides of it"
    );
    let text = format!(
        "write \"water\", so that the plane stops water only, use a normal without a component along \
         {axis}, or remove {axis} from `domain.periodic`"
    );
    let remedy = if structure.stops == Stops::Grains {
        Remedy::from(text)
    } else {
        Remedy::from(text).set(&*path, "water")
    };
    findings.error(&path, reason, remedy);
    false
}

/// Returns the facets of structure `n` and of its periodic images as a surface for grains; reports a shape that has
/// none.
fn surface_of(
    facets: &Facets,
    grid: &Grid,
    n: usize,
    findings: &mut Findings,
) -> Option<FacetSurface> {
    let vertices = facets.vertices.iter().map(|at| Vector3::from(*at));
    let made = FacetSurface::new(vertices.collect(), &facets.faces)
        .and_then(|surface| surface.repeated([0.0; 3], periods(grid)));
    made.map_err(|error| {
        let path = format!("structures[{n}].shape");
        findings.error(&path, error.into_reason(), "correct the shape");
    })
    .ok()
}

/// Returns the facets of a surface, at most `share` where the tolerance has an effect, and their largest distance from
/// it as a fraction of a radius \[m\].
fn divided(solid: &Images, radius: f64, extent: f64, share: usize) -> (Facets, f64) {
    let mut tolerance = SAGITTA * radius;
    let mut facets = solid.facets(tolerance, extent);
    while facets.faces.len() > share && solid.deviation(tolerance) > 0.0 {
        tolerance *= real(facets.faces.len()) / real(share);
        let coarser = solid.facets(tolerance, extent);
        if coarser.faces.len() == facets.faces.len() {
            break;
        }
        facets = coarser;
    }
    (facets, solid.deviation(tolerance) / radius)
}

/// Maximum thickness \[cells\] of a water layer behind a wall that counts as a joint under blocks.
const JOINT: f64 = 3.0;
/// Number of points along an axis at which water behind a wall is sought.
const SEARCH_POINTS: usize = 10;

/// Half-space `normal . x <= offset` \[m\] that is filled with water, at least in part.
type Bound = ([f64; 3], f64);

/// Returns the half-spaces that bound the water of a case.
fn bounds(case: &Case, grid: &Grid) -> Vec<Bound> {
    let (mut low, mut high) = ([0.0; 3], grid.size);
    let mut all = Vec::new();
    if let Some(Fluid::Darcy(darcy)) = &case.fluid {
        if let Some(own) = &darcy.grid {
            low = own.from.as_ref().map_or(low, |from| from.to_array());
            high = own.to.as_ref().map_or(high, |to| to.to_array());
        }
        if let Enclosure::Planes(planes) = &darcy.enclosure {
            for plane in planes {
                let normal = plane.normal.to_array();
                let length = dot(normal, normal).sqrt();
                let outward = normal.map(|x| -x / length);
                all.push((outward, dot(outward, plane.point.to_array())));
            }
        }
    }
    for a in 0..grid.dimension {
        let mut up = [0.0; 3];
        up[a] = 1.0;
        all.push((up, high[a]));
        all.push((up.map(|x: f64| -x), -low[a]));
    }
    all
}

/// Checks walls in water, which act on grains only. Walls with water on both sides are reported.
pub(crate) fn walls_in_water(
    case: &Case,
    grid: &Grid,
    walls: &[SceneWall],
    (structures, fixed): (&[Structure], &[&PlacedPolyhedron]),
    findings: &mut Findings,
) {
    if case.fluid.is_none() {
        return;
    }
    let bounds = bounds(case, grid);
    let near = 1e-6
        * grid.size[..grid.dimension]
            .iter()
            .copied()
            .fold(0.0, f64::max);
    // A surface in a face of the water, or beyond it, bounds the water.
    let outside = |surface: &FacetSurface| {
        bounds.iter().any(|(normal, offset)| {
            (0..surface.len())
                .flat_map(|facet| surface.corners(facet))
                .all(|at| dot(*normal, at.into()) > offset - near)
        })
    };
    let half_spaces: Vec<_> = fixed.iter().map(|solid| solid.half_spaces()).collect();
    let solid = |at: [f64; 3]| {
        let wet = structures.iter().filter(|s| s.stops.water());
        wet.into_iter().any(|s| s.solid.distance(at) < 0.0)
            || half_spaces.iter().any(|block| {
                (block.iter()).all(|face| face.normal.dot(&Vector3::from(at)) <= face.offset)
            })
    };
    let deep = JOINT * grid.spacing;
    let behind = |wall: &SceneWall| {
        let by = |a: usize| if a < grid.dimension { SEARCH_POINTS } else { 1 };
        (0..by(0) * by(1) * by(2)).any(|n| {
            let place = [
                n % SEARCH_POINTS,
                n / SEARCH_POINTS % SEARCH_POINTS,
                n / (SEARCH_POINTS * SEARCH_POINTS),
            ];
            let at: [f64; 3] = std::array::from_fn(|a| {
                if a < grid.dimension {
                    grid.size[a] * (real(place[a]) + 0.5) / real(SEARCH_POINTS)
                } else {
                    0.0
                }
            });
            let height = dot(wall.normal, at) - dot(wall.normal, wall.point);
            let wet = bounds
                .iter()
                .all(|(normal, offset)| dot(*normal, at) < *offset);
            height < -deep && wet && !solid(at)
        })
    };
    for (n, written) in case.walls.iter().enumerate() {
        let resolved = walls.iter().find(|wall| wall.name == written.name);
        let in_water = |wall: &&SceneWall| {
            !wall.temporary
                && wall.structure.is_none()
                && match &wall.surface {
                    Some(surface) => !outside(surface),
                    None => behind(wall),
                }
        };
        let Some(wall) = resolved.filter(in_water) else {
            continue;
        };
        findings.warn(
            &format!("walls[{n}]"),
            format!(
                "the wall `{}` is for grains only: water passes through it",
                wall.name
            ),
            "use `structures` for a solid that also stops water",
        );
    }
}
