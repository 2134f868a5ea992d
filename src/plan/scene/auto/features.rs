//! Features of a case that the lattice must resolve: bodies, grains, gaps between walls, openings, vortices.

use super::coupling_of;
use super::gaps::{self, Gap};
use super::passages::{self, AdjacentKind, NarrowPlace};
use crate::scene::Scene;
use crate::scene::flow::Flow;
use crate::scene::sample;
use case::Case;
use case::boundary::Boundary;
use case::coupling::{Coupling, PartiallySaturated, Scheme, SolidOperator, Weighting};
use case::fluid::{BodyForce, Fluid, Initial, LatticeBoltzmann};
use case::geometry::Face;
use case::grains::GrainSource;
use case::observe::Action;
use case::solids::{Body, Shape};
use case::structures::Shape as Structure;
use dem::polyhedron::{HalfSpace, Polyhedron};

/// Distance of sphere centres, in diameters, below which the rows of packed spheres apply.
const DENSE: f64 = 0.6;

/// Name of the table rows for boundary layers that grow in time by viscosity.
pub(crate) const LAYERS: &str = "layers in time";

/// Name of the table rows for passages between structures, or between a structure and a wall.
pub(crate) const STRUCTURES: &str = "passages between structures";

/// Name of the table rows for vortices away from walls.
const VORTICES: &str = "vortices";

/// Feature that the lattice must resolve.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Feature {
    /// Name of the feature: `diameter of `cylinder``.
    pub(crate) what: String,
    /// Smallest width \[m\].
    pub(crate) size: f64,
    /// Obstacle to the water, named as in the table of measured errors.
    pub(crate) obstacle: &'static str,
}

/// Returns the name of the coupling in the table. Before the relaxation time is known the flow is assumed to be
/// slow.
fn obstacle(coupling: &Coupling, flow: Option<&Flow>, round: bool) -> &'static str {
    match coupling {
        Coupling::PartiallySaturated(cells) if !round => of_blocks(cells, flow),
        Coupling::BounceBack(links) if !round && links.scheme == Scheme::HalfWay => {
            "blocks: half-way links"
        }
        Coupling::BounceBack(_) if !round => "blocks: interpolated links",
        Coupling::PartiallySaturated(_) => "partially saturated cells",
        Coupling::BounceBack(links) if links.scheme == Scheme::HalfWay => "half-way links",
        Coupling::BounceBack(_) => "interpolated links",
    }
}

fn of_blocks(cells: &PartiallySaturated, flow: Option<&Flow>) -> &'static str {
    let weighting = flow.map_or(cells.weighting, |flow| Some(flow.weighting(cells)));
    if weighting == Some(Weighting::Fraction) {
        return "blocks: weighted by fraction";
    }
    let operator = flow.map_or(cells.solid_operator, |flow| {
        Some(flow.solid_operator(cells))
    });
    let operator = operator.unwrap_or(SolidOperator::ViscosityMatched);
    operator.model().measured_rows()[0]
}

/// Returns the rows of the table for blocks in gaps narrower than the block: the displaced water has to pass through
/// the gap.
fn in_narrow_gap(obstacle: &'static str) -> &'static str {
    let mut rows = SolidOperator::ALL.iter().map(|o| o.model().measured_rows());
    match obstacle {
        "blocks: half-way links" => "blocks in gaps: half-way links",
        "blocks: interpolated links" => "blocks in gaps: interpolated links",
        _ => rows
            .find(|[alone, _]| *alone == obstacle)
            .map_or("blocks in gaps: not measured", |[_, in_gaps]| in_gaps),
    }
}

/// Returns the table row for gaps through which water flows, from the row of the adjacent solids.
fn in_gap(obstacle: &'static str) -> &'static str {
    match obstacle {
        "half-way links" => "gaps: half-way links",
        "interpolated links" => "gaps: interpolated links",
        "partially saturated cells" => "gaps: partially saturated cells",
        of_blocks => in_narrow_gap(of_blocks),
    }
}

/// Returns the table row for gaps next to moving bodies, from the row of the adjacent solids.
fn next_to_moving(obstacle: &'static str) -> &'static str {
    match obstacle {
        "half-way links" => "gaps next to moving bodies: half-way links",
        "interpolated links" => "gaps next to moving bodies: interpolated links",
        "partially saturated cells" => "gaps next to moving bodies: partially saturated cells",
        of_blocks => in_narrow_gap(of_blocks),
    }
}

/// Returns the table rows for spheres that are closer together than [`DENSE`] diameters.
fn dense_rows(obstacle: &'static str) -> &'static str {
    match obstacle {
        "half-way links" => "packed spheres: half-way links",
        "interpolated links" => "packed spheres: interpolated links",
        _ => "packed spheres: partially saturated cells",
    }
}

/// Returns all features of a case, in its order, except solids whose size is known only after they are generated.
pub(crate) fn case_features(
    case: &Case,
    lbm: &LatticeBoltzmann,
    scene: Option<&Scene>,
    speed: Option<f64>,
) -> Vec<Feature> {
    let flow = scene.and_then(|scene| scene.flow.as_ref());
    let mut list = solids(case, lbm, flow);
    list.extend(structures(case));
    if let (Some(scene), Some(flow)) = (scene, flow) {
        list.extend(
            passages::widest_passages(scene, flow)
                .into_iter()
                .filter_map(|place| passage_feature(place, case, flow)),
        );
    }
    let mut walls = |what: String, size: f64| {
        list.push(Feature {
            what,
            size,
            obstacle: "walls",
        });
    };
    for (axis, size) in gaps(case, lbm) {
        let axis = ["x", "y", "z"][axis];
        walls(format!("width of the domain along {axis}"), size);
    }
    for boundary in &lbm.boundaries {
        if let Some(size) = opening(case, boundary) {
            walls(format!("width of `{}`", boundary.name), size);
        }
    }
    for cut in case.grains.iter().flat_map(|grains| &grains.cut) {
        let (from, to) = (&cut.region.from.0, &cut.region.to.0);
        let size = (from.iter().zip(to)).map(|(a, b)| b - a);
        walls(
            format!("width of `{}`", cut.name),
            size.fold(f64::INFINITY, f64::min),
        );
    }
    for (what, size) in layers(case, lbm, speed) {
        list.push(Feature {
            what,
            size,
            obstacle: LAYERS,
        });
    }
    let mut vortices = |what: String, size: f64| {
        list.push(Feature {
            what,
            size,
            obstacle: VORTICES,
        });
    };
    if let Initial::TaylorGreen { waves, .. } = &lbm.initial {
        let lengths = (case.domain.size.0.iter().zip(waves)).map(|(l, n)| 0.5 * l / f64::from(*n));
        vortices(
            "half a wave of the vortices".into(),
            lengths.fold(f64::INFINITY, f64::min),
        );
    }
    if let Initial::ShearLayers { thickness, .. } = &lbm.initial {
        vortices(
            "twice the thickness of a shear layer".into(),
            2.0 * thickness,
        );
    }
    list.retain(|feature| feature.size.is_finite() && feature.size > 0.0);
    if list.is_empty() {
        let smallest = case.domain.size.0.iter().copied();
        list.push(Feature {
            what: "smallest edge of the domain".into(),
            size: smallest.fold(f64::INFINITY, f64::min),
            obstacle: "walls",
        });
    }
    list
}

/// Returns the diameters of bodies and grains as features.
fn solids(case: &Case, lbm: &LatticeBoltzmann, flow: Option<&Flow>) -> Vec<Feature> {
    let Some(coupling) = coupling_of(case) else {
        return Vec::new();
    };
    let factor = coupling.hydraulic_radius_factor();
    let bodies = case.bodies.iter().flat_map(|body| {
        let obstacle = obstacle(&coupling, flow, body.shape.round());
        let width = width(&body.shape).map(|size| Feature {
            what: format!("width of `{}`", body.name),
            size,
            obstacle,
        });
        let gap = narrow_gap(case, lbm, body).map(|(width, gap)| Feature {
            what: format!("mean of width and gap of `{}`", body.name),
            size: (width * gap).sqrt(),
            obstacle: in_narrow_gap(obstacle),
        });
        width.into_iter().chain(gap)
    });
    let round = obstacle(&coupling, flow, true);
    let grains = smallest_grain(case).map(|diameter| Feature {
        what: "diameter of the smallest grain".into(),
        size: diameter * factor,
        obstacle: round,
    });
    let mut list: Vec<Feature> = bodies.chain(grains).collect();
    let found = gaps::case_gaps(case, lbm, factor);
    let beside = |gap: &Gap| obstacle(&coupling, flow, !gap.faces);
    let narrow = found
        .passages
        .iter()
        .map(|(_, gap)| (gap, in_gap(beside(gap))));
    let moving = found
        .moving
        .iter()
        .map(|gap| (gap, next_to_moving(beside(gap))));
    let open = narrow.chain(moving).filter(|(gap, _)| gap.width > 0.0);
    list.extend(open.map(|(gap, obstacle)| gap_feature(gap, obstacle)));
    let dense = found
        .narrowest
        .filter(|gap| gap.width < DENSE * gap.adjacent_width && !gap.faces);
    list.extend(dense.map(|gap| Feature {
        what: format!("pores beside the {}", gap.what),
        size: gap.adjacent_width * pores(found.solid),
        obstacle: dense_rows(round),
    }));
    list
}

/// Returns the hydraulic diameter of the pores between spheres (four times the water volume divided by the surface)
/// at a solid fraction, divided by the sphere diameter; at most 1. Errors of packed spheres are a function of it:
/// those of simple, body-centred and face-centred cubic lattices from 0.216 to 0.65 lie on one curve.
fn pores(solid: f64) -> f64 {
    (2.0 / 3.0 * (1.0 - solid) / solid).min(1.0)
}

/// Returns the feature of a gap through which water flows. For gaps next to flat faces the table uses the mean of
/// width and gap.
fn gap_feature(gap: &Gap, obstacle: &'static str) -> Feature {
    Feature {
        what: gap.what.clone(),
        size: if gap.faces {
            (gap.width * gap.adjacent_width).sqrt()
        } else {
            gap.width
        },
        obstacle,
    }
}

/// Returns the feature of a narrowest passage; none if other features cover it.
fn passage_feature(place: NarrowPlace, case: &Case, flow: &Flow) -> Option<Feature> {
    let coupling = coupling_of(case);
    let beside = |round| {
        coupling
            .as_ref()
            .map(|coupling| obstacle(coupling, Some(flow), round))
    };
    let obstacle = match place.adjacent {
        // In the plane the gaps of all pairs are known, and for packed spheres the pores are used.
        AdjacentKind::Balls => return None,
        AdjacentKind::BallAndWall | AdjacentKind::Faces if case.domain.size.0.len() == 2 => {
            return None;
        }
        AdjacentKind::BallAndWall => next_to_wall(beside(true)?),
        AdjacentKind::Faces => between_faces(beside(false)?),
        AdjacentKind::Structure => STRUCTURES,
    };
    Some(Feature {
        what: place.what,
        size: place.width,
        obstacle,
    })
}

/// Returns the table rows for passages between a sphere and a wall.
fn next_to_wall(obstacle: &'static str) -> &'static str {
    match obstacle {
        "half-way links" => "passages next to spheres: half-way links",
        "interpolated links" => "passages next to spheres: interpolated links",
        _ => "passages next to spheres: partially saturated cells",
    }
}

/// Returns the table rows for passages between blocks, their periodic images and walls.
fn between_faces(obstacle: &'static str) -> &'static str {
    match obstacle {
        "blocks: half-way links" => "passages between blocks: half-way links",
        "blocks: interpolated links" => "passages between blocks: interpolated links",
        "blocks: viscosity matched" => "passages between blocks: viscosity matched",
        _ => "passages between blocks: not measured",
    }
}

/// Returns the diameters of round structures. Sheets and boxes block the water however thin they are.
fn structures(case: &Case) -> impl Iterator<Item = Feature> + '_ {
    let wet = case.structures.iter().filter(|s| s.stops.water());
    wet.filter_map(|structure| {
        let radius = match &structure.shape {
            Structure::Disc(disc) => disc.radius,
            Structure::Sphere(sphere) => sphere.radius,
            Structure::Cylinder(cylinder) => cylinder.radius,
            _ => return None,
        };
        Some(Feature {
            what: format!("diameter of `{}`", structure.name),
            size: 2.0 * radius,
            obstacle: "interpolated links",
        })
    })
}

/// Returns the width of a block, and of the water on each side of it in the middle between walls, if the gap is
/// narrower than the block. The block counts as the sphere of its volume, as it may rotate. None if it fills the
/// passage from wall to wall.
fn narrow_gap(case: &Case, lbm: &LatticeBoltzmann, body: &Body) -> Option<(f64, f64)> {
    let volume = match &body.shape {
        Shape::Cuboid { edges } => edges.iter().product(),
        Shape::Vertices(points) => {
            let points: Vec<_> = points.iter().copied().map(Into::into).collect();
            Polyhedron::from_vertices(&points).ok()?.shape.volume()
        }
        _ => return None,
    };
    let diameter = (volume * 6.0 / std::f64::consts::PI).cbrt();
    let width = width(&body.shape)?;
    let beside = |(_, length): (usize, f64)| 0.5 * (length - diameter);
    let gaps = gaps(case, lbm).into_iter().map(beside);
    let gap = gaps.filter(|gap| *gap > 0.0).reduce(f64::min)?;
    (gap < width).then_some((width, gap))
}

/// Returns the smallest width of a shape \[m\]; for a hull the smallest distance from a face to the corner farthest
/// from it. None if the shape is known only after it is generated.
pub(crate) fn width(shape: &Shape) -> Option<f64> {
    match shape {
        Shape::Disc { radius } | Shape::Sphere { radius } => Some(2.0 * radius),
        Shape::Cuboid { edges } => edges.iter().copied().reduce(f64::min),
        Shape::Vertices(points) => {
            let points: Vec<_> = points.iter().copied().map(Into::into).collect();
            let hull = Polyhedron::from_vertices(&points).ok()?.shape;
            let across = |plane: &HalfSpace| {
                let heights = hull.vertices().iter().map(|corner| plane.height(corner));
                -heights.fold(f64::INFINITY, f64::min)
            };
            hull.half_spaces().iter().map(across).reduce(f64::min)
        }
        Shape::HalfSpaces(_) | Shape::Mesh(_) => None,
    }
}

/// Returns the diameters of the smallest and the largest grain of the start or of generating regions \[m\].
pub(crate) fn grain_diameters(case: &Case) -> Option<(f64, f64)> {
    let mut radii: Vec<f64> = Vec::new();
    match case.grains.as_ref().map(|grains| &grains.initial) {
        None => {}
        Some(GrainSource::List(list)) => radii.extend(list.iter().map(|grain| grain.radius)),
        Some(GrainSource::Growth(growth)) => {
            let (low, high) = growth.radii.bounds();
            radii.extend([low, high]);
        }
        Some(GrainSource::Deposition(rain)) => {
            let (low, high) = rain.grading.bounds();
            radii.extend([low, high]);
            for layer in &rain.layers {
                let (low, high) = layer.grading.bounds();
                radii.extend([low, high]);
            }
        }
        Some(GrainSource::File(file)) => {
            // A file that cannot be read is reported with the grains.
            let grains = sample::load(case, file);
            radii.extend(grains.unwrap_or_default().iter().map(|grain| grain.radius));
        }
    }
    for region in &case.regions {
        if let Action::Generate { radii: new, .. } = &region.action {
            let (low, high) = new.bounds();
            radii.extend([low, high]);
        }
    }
    // An impossible radius is reported with the grains.
    radii.retain(|radius| *radius > 0.0);
    let low = radii.iter().copied().fold(f64::INFINITY, f64::min);
    let high = radii.iter().copied().fold(0.0, f64::max);
    (low.is_finite() && high > 0.0).then_some((2.0 * low, 2.0 * high))
}

/// Returns the layers at walls and bodies with a thickness given by viscous diffusion: (2 nu/omega)^½ for an
/// oscillating force (Stokes), and (nu t)^½ for a starting flow at the end of a run that is shorter than the
/// passage of the flow along the wall (Rayleigh). A thickness above half of the width in which the layer grows is
/// left out.
fn layers(case: &Case, lbm: &LatticeBoltzmann, speed: Option<f64>) -> Vec<(String, f64)> {
    let nu = lbm.kinematic_viscosity;
    let widths = gaps(case, lbm).into_iter().map(|(_, length)| length);
    let bodies = case.bodies.iter().filter_map(|body| width(&body.shape));
    let narrowest = widths.clone().fold(f64::INFINITY, f64::min);
    let half = 0.5
        * narrowest.min(
            case.domain
                .size
                .0
                .iter()
                .copied()
                .fold(f64::INFINITY, f64::min),
        );
    let Some(smallest) = widths.chain(bodies).reduce(f64::min) else {
        return Vec::new();
    };
    let mut list = Vec::new();
    if let Some(BodyForce::Oscillating { period, .. }) = &lbm.body_force {
        let thickness = (nu * period / std::f64::consts::PI).sqrt();
        list.push(("Stokes layer of the body force".to_owned(), thickness));
    }
    if speed.is_some_and(|speed| speed * case.time.end < smallest) {
        let what = "layer that grows at walls and bodies until the end of the run";
        list.push((what.to_owned(), (nu * case.time.end).sqrt()));
    }
    list.retain(|(_, thickness)| *thickness < half);
    list
}

fn smallest_grain(case: &Case) -> Option<f64> {
    grain_diameters(case).map(|(low, _)| low)
}

/// Returns the axes with walls at both ends, with their lengths \[m\].
fn gaps(case: &Case, lbm: &LatticeBoltzmann) -> Vec<(usize, f64)> {
    let open = |axis: usize| {
        lbm.boundaries.iter().any(|boundary| {
            boundary.patch.is_none()
                && boundary.face.axis() == axis
                && boundary.condition.model().passes_water()
        })
    };
    let periodic = |axis: usize| case.domain.periodic.iter().any(|a| a.index() == axis);
    let sizes = case.domain.size.0.iter().copied().enumerate();
    sizes
        .filter(|&(axis, _)| !periodic(axis) && !open(axis))
        .collect()
}

/// Returns the smaller side of an opening \[m\]; none if it covers the whole face.
fn opening(case: &Case, boundary: &Boundary) -> Option<f64> {
    let patch = boundary
        .patch
        .as_ref()
        .filter(|_| boundary.condition.model().passes_water())?;
    let axis = Face::axis(boundary.face);
    let (from, to) = (patch.from.0.iter(), patch.to.0.iter());
    let sides = from.zip(to).zip(&case.domain.size.0).enumerate();
    sides
        .filter(|(a, _)| *a != axis)
        .map(|(_, ((from, to), size))| to.min(*size) - from.max(0.0))
        .reduce(f64::min)
}

/// Returns the lattice Boltzmann part of a case.
pub(crate) fn lattice(case: &Case) -> Option<&LatticeBoltzmann> {
    match &case.fluid {
        Some(Fluid::LatticeBoltzmann(lbm)) => Some(lbm),
        _ => None,
    }
}
