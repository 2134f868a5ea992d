//! Spacing of the lattice: as many cells across the smallest feature of the fluid as the accuracy requires, and a
//! whole number of cells along every edge.

use super::bound::Bound;
use super::features::{self, Feature};
use super::{Chosen, Subject, requested_accuracy, step};
use crate::scene::findings::{Findings, length_of, number};
use crate::scene::{Scene, sample};
use base::error::Remedy;
use base::number::{real, whole};
use case::Case;
use case::fluid::{Fluid, Initial, LatticeBoltzmann};
use case::grains::GrainSource;
use lbm::boundary::Condition;

/// Spacing and its reason; no reason if the case states it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spacing {
    /// Spacing h \[m\].
    pub(crate) value: f64,
    reason: Option<String>,
    /// Edges of the domain \[m\], if those of the case are not all whole numbers of cells.
    pub(crate) rounded: Option<Vec<f64>>,
}

impl Spacing {
    /// Returns a chosen spacing that divides every edge.
    pub(super) fn chosen(value: f64, reason: String) -> Self {
        Self {
            value,
            reason: Some(reason),
            rounded: None,
        }
    }

    /// Returns the spacing of another scene, which needs no reason.
    pub(crate) fn of_scene(scene: &Scene) -> Self {
        Self {
            value: scene.grid.spacing,
            reason: None,
            rounded: scene.chosen.size.clone(),
        }
    }

    /// Warns of each edge that was lengthened.
    pub(crate) fn warn_of_rounding(&self, case: &Case, findings: &mut Findings) {
        let rounded = self.rounded.iter().flatten();
        for (axis, (written, size)) in case.domain.size.0.iter().zip(rounded).enumerate() {
            if written < size {
                let path = format!("domain.size[{axis}]");
                let reason = format!(
                    "no spacing that meets the accuracy divides all edges of the domain: with cells of {} m the \
                     domain is {size} m long along {}, which is {} m more than the case states",
                    number(self.value),
                    ["x", "y", "z"][axis],
                    number(size - written)
                );
                let text = format!(
                    "write {size} m to accept this, choose edges with a larger common divisor, or set the \
                     spacing"
                );
                findings.warn(&path, reason, Remedy::from(text).set(&*path, *size));
            }
        }
    }

    pub(crate) fn note(&self, chosen: &mut Chosen) {
        if let Some(reason) = &self.reason {
            chosen.note(Subject::Spacing, reason.clone());
        }
    }
}

/// Spacing without a lattice, in largest grain diameters: the cells only divide the domain into slabs.
const SLAB_DIAMETERS: f64 = 2.0;
/// Spacing of seepage, in mean grain diameters; published models of ground fissures use 1 to 4.
const SEEPAGE_DIAMETERS: f64 = 3.0;
/// Maximum number of cells of seepage without grains: along the shortest edge, and in total.
const SEEPAGE_LAYERS: f64 = 50.0;
pub(super) const SEEPAGE_CELLS: f64 = 1e6;
/// Maximum number of parts of a fiftieth of the shortest edge that are tried as cells of a domain whose seepage has a
/// grid of its own.
const MOST_PARTS: u32 = 200;
/// Fraction of the target for the error of the spacing; the rest is for the time step.
const SPACING_SHARE: f64 = 0.75;
/// Maximum refinement factor to move bodies away from positions of symmetry.
const SHIFT_REFINEMENT: f64 = 1.05;
/// Distance from a centre, face or corner of a cell that counts as zero [half cells].
const ON_LATTICE: f64 = 0.1;
/// Maximum refinement factor to keep a fast flow stable in 2-D.
const MAX_FINER: f64 = 4.0;

/// Returns the stated spacing, or that for the features of the case, before velocities are known.
pub(crate) fn first(case: &Case, findings: &mut Findings) -> Option<Spacing> {
    if let Some(value) = case.domain.spacing {
        return Some(Spacing {
            value,
            reason: None,
            rounded: None,
        });
    }
    if let Some(GrainSource::File(file)) = case.grains.as_ref().map(|grains| &grains.initial)
        && let Err(reason) = sample::load(case, file)
    {
        findings.error(sample::PATH, reason, sample::REMEDY);
        return None;
    }
    let unknown = case
        .bodies
        .iter()
        .any(|b| features::width(&b.shape).is_none());
    if unknown || case.blocks.is_some() {
        findings.error(
            "domain.spacing",
            "the widths of blocks, meshes and half-spaces are not known in advance",
            "set the spacing to about a tenth of the smallest width",
        );
        return None;
    }
    let (wanted, reason) = match features::lattice(case) {
        Some(lbm) => {
            let need = required_spacings(case, lbm, None, None);
            need.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?
        }
        None => without_lattice(case, findings)?,
    };
    whole_cells(case, wanted, reason, findings)
}

/// Returns a finer spacing than that of the scene, if its velocities require one.
pub(crate) fn finer_spacing(case: &Case, scene: &Scene) -> Option<Spacing> {
    let lbm = features::lattice(case).filter(|_| case.domain.spacing.is_none())?;
    let flow = scene.flow.as_ref()?;
    let speed = step::fastest(scene, flow)?.value;
    let finest = |a: (f64, String), b: (f64, String)| if b.0 < a.0 { b } else { a };
    let mut wanted = required_spacings(case, lbm, Some(scene), Some(speed))
        .into_iter()
        .reduce(finest)?;
    if scene.grid.dimension == 2
        && lbm.turbulence.is_none()
        && let Some(h) =
            step::stable_spacing(scene, flow, speed, requested_accuracy(case)?.target())
        && h * MAX_FINER >= wanted.0
    {
        let reason = format!(
            "in 2-D no operator is stable on coarser cells at {} m/s",
            number(speed)
        );
        wanted = finest(wanted, (h, reason));
    }
    let (wanted, reason) = wanted;
    // Findings about the sizes were already reported for the coarser cells.
    let mut unheard = Findings::new(case);
    let found = whole_cells(case, wanted, reason, &mut unheard)?;
    (found.value < scene.grid.spacing * (1.0 - 1e-9)).then_some(found)
}

/// Returns the spacing \[m\] that each feature requires, with the reason for the plan.
fn required_spacings(
    case: &Case,
    lbm: &LatticeBoltzmann,
    scene: Option<&Scene>,
    speed: Option<f64>,
) -> Vec<(f64, String)> {
    let Some(accuracy) = requested_accuracy(case) else {
        return Vec::new();
    };
    let dimension = case.domain.size.0.len();
    let target = SPACING_SHARE * accuracy.target();
    let need = |feature: &Feature| {
        let reynolds = speed.map_or(0.0, |u| u * feature.size / lbm.kinematic_viscosity);
        let bound = Bound::for_obstacle(dimension, feature.obstacle)?;
        let cells = bound.cells_for(target, reynolds);
        let reason = format!(
            "at least {} cells across the {} of {} m, for \"{}\"",
            number(cells),
            feature.what,
            number(feature.size),
            accuracy.name()
        );
        Some((feature.size / cells, reason))
    };
    // Layers that grow in a short run do not determine the cells: the plan reports that they are not resolved.
    let mut needs: Vec<(f64, String)> = features::case_features(case, lbm, scene, None)
        .iter()
        .filter_map(need)
        .collect();
    needs.extend(eddies(lbm).map(|length| {
        let reason = format!(
            "two cells across the imposed eddies of {} m",
            number(length)
        );
        (0.5 * length, reason)
    }));
    needs
}

/// Returns the length scales of imposed eddies \[m\]: in the initial flow and at inlets.
fn eddies(lbm: &LatticeBoltzmann) -> impl Iterator<Item = f64> + '_ {
    let initial = match &lbm.initial {
        Initial::Channel { fluctuations, .. } => *fluctuations,
        _ => None,
    };
    let inlets = lbm
        .boundaries
        .iter()
        .filter_map(|boundary| match &boundary.condition {
            Condition::Velocity(velocity) => velocity.turbulence,
            _ => None,
        });
    initial
        .into_iter()
        .chain(inlets)
        .map(|eddies| eddies.length_scale)
}

/// Returns the spacing of a case without a lattice, which follows from the grains.
fn without_lattice(case: &Case, findings: &mut Findings) -> Option<(f64, String)> {
    let bodies = case.bodies.iter();
    let bodies = bodies.filter_map(|body| features::width(&body.shape));
    let widest = bodies.fold(0.0, f64::max);
    let (smallest, largest) = features::grain_diameters(case).unwrap_or((widest, widest));
    let (size, reason) = match &case.fluid {
        Some(Fluid::Darcy(darcy)) if darcy.grid.is_none() && largest > 0.0 => (
            (SEEPAGE_DIAMETERS * 0.5 * (smallest + largest)).max(largest),
            "three mean diameters: the seepage is averaged over grains",
        ),
        Some(Fluid::Darcy(darcy)) if darcy.grid.is_none() || largest <= 0.0 => {
            let edges = case.domain.size.to_array();
            let edges: Vec<f64> = edges.into_iter().filter(|x| *x > 0.0).collect();
            let shortest = edges.iter().copied().fold(f64::INFINITY, f64::min);
            let size: f64 = edges.iter().product();
            let coarsest = (size / SEEPAGE_CELLS).powf(1.0 / real(edges.len().max(1)));
            let own = darcy.grid.is_some();
            let fitting = own.then(|| common_spacing(&edges)).flatten();
            if let Some(size) = fitting {
                return Some((size, OWN_GRID.into()));
            }
            (
                (shortest / SEEPAGE_LAYERS).max(coarsest),
                "fifty cells along the shortest edge, or a million cells in total, because the case has no \
                 grains to average over",
            )
        }
        _ => (
            SLAB_DIAMETERS * largest.max(widest),
            "two of the largest diameters: without a lattice the cells only define the slabs",
        ),
    };
    if size <= 0.0 {
        findings.error(
            "domain.spacing",
            "nothing in the case determines the size of a cell",
            "set the spacing",
        );
        return None;
    }
    Some((size, reason.into()))
}

/// Reason of the spacing of a domain whose seepage has a grid of its own.
const OWN_GRID: &str = "the seepage has a grid of its own: these cells only measure the domain";

/// Returns the coarsest spacing that divides all edges, of at most [`SEEPAGE_LAYERS`] times [`MOST_PARTS`] cells along
/// the shortest one.
fn common_spacing(edges: &[f64]) -> Option<f64> {
    let shortest = edges.iter().copied().fold(f64::INFINITY, f64::min);
    let spacings = (1..=MOST_PARTS).map(|part| shortest / (SEEPAGE_LAYERS * f64::from(part)));
    let mut fitting = spacings.filter(|h| edges.iter().all(|edge| fits_one(*edge, *h)));
    fitting.next()
}

/// Returns the coarsest spacing between half the wanted one and the wanted one that divides every edge. Up to
/// [`SHIFT_REFINEMENT`] finer, a spacing is preferred that puts no round obstacle at a position of symmetry.
///
/// If there is none, the shortest edge stays as written, since the flow is resolved across it, and the others are
/// lengthened to the next whole number of cells. Among the spacings in this range, the one with the smallest
/// relative lengthening is taken. Edges are never shortened, so that everything placed in the domain stays in it.
pub(super) fn whole_cells(
    case: &Case,
    wanted: f64,
    reason: String,
    findings: &mut Findings,
) -> Option<Spacing> {
    let sizes = &case.domain.size.0;
    let shortest = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    if !(shortest > 0.0 && wanted > 0.0 && shortest.is_finite()) {
        findings.error(
            "domain.size",
            "the domain needs a positive size",
            "write lengths in m",
        );
        return None;
    }
    let least = (shortest / wanted - 1e-9).ceil().max(1.0);
    let spacings = || (0..=whole(least)).map(|more| shortest / (least + real(more)));
    let fits = |h: &f64| sizes.iter().all(|size| fits_one(*size, *h));
    if let Some(coarsest) = spacings().find(fits) {
        let mut near = spacings()
            .filter(fits)
            .take_while(|h| *h * SHIFT_REFINEMENT * (1.0 + 1e-9) >= coarsest);
        let value = near.find(|h| !symmetric(case, *h)).unwrap_or(coarsest);
        return Some(Spacing {
            value,
            reason: Some(reason),
            rounded: None,
        });
    }
    let added = |h: &f64| -> f64 {
        let longer = sizes.iter().map(|size| rounded_up(*size, *h) / size - 1.0);
        longer.sum()
    };
    let value = spacings().min_by(|a, b| added(a).total_cmp(&added(b)))?;
    Some(Spacing {
        value,
        reason: Some(reason),
        rounded: Some(sizes.iter().map(|size| rounded_up(*size, value)).collect()),
    })
}

/// Returns `true` if a round body has its centre on a cell centre, face or corner along every axis. The staircases
/// of opposite sides are then equal, and their errors add up: such discs exceeded the promised error three times as
/// often as others.
fn symmetric(case: &Case, h: f64) -> bool {
    let on_lattice = |x: f64| (2.0 * x / h - (2.0 * x / h).round()).abs() < ON_LATTICE;
    let mut round = case.bodies.iter().filter(|body| body.shape.round());
    round.any(|body| body.position.0.iter().all(|x| on_lattice(*x)))
}

/// Returns the length of the smallest number of whole cells that covers an edge.
fn rounded_up(size: f64, h: f64) -> f64 {
    if fits_one(size, h) {
        size
    } else {
        length_of((size / h).ceil(), h)
    }
}

/// Returns `true` if an edge is a whole number of cells.
pub(super) fn fits_one(size: f64, h: f64) -> bool {
    (size / h - (size / h).round()).abs() <= 1e-7 * (size / h)
}
