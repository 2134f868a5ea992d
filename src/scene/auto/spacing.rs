//! The spacing: as many cells across the smallest feature in the fluid as the accuracy requires, and a whole number of cells along every edge.

use super::bound::Bound;
use super::features::{self, Feature};
use super::{Chosen, asked, step};
use crate::case::Case;
use crate::case::fluid::{Fluid, LatticeBoltzmann};
use crate::error::Remedy;
use crate::number::{real, whole};
use crate::scene::Scene;
use crate::scene::findings::{Findings, length_of, number};
use crate::scene::flow::Flow;

/// A spacing and its reason; no reason if the case states it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spacing {
    /// h \[m\].
    pub(crate) value: f64,
    reason: Option<String>,
}

impl Spacing {
    /// One that needs no reason.
    pub(crate) fn stated(value: f64) -> Self {
        Self {
            value,
            reason: None,
        }
    }

    pub(crate) fn note(&self, chosen: &mut Chosen) {
        if let Some(reason) = &self.reason {
            chosen.note("spacing", reason.clone());
        }
    }
}

/// Cells of a grid without water on a lattice: it only cuts the domain into slabs.
const SLAB_DIAMETERS: f64 = 2.0;
/// Seepage is averaged over cells of three grains, within the 1 to 4 of the paper on ground fissures.
const SEEPAGE_DIAMETERS: f64 = 3.0;
/// Part of the target that the cells may use; the time step has the rest.
const SHARE: f64 = 0.75;
/// In the plane finer cells keep a fast flow stable, up to this factor.
const MOST_FINER: f64 = 4.0;

/// The stated spacing, or that for the features of the case, before velocities are known.
pub(crate) fn first(case: &Case, findings: &mut Findings) -> Option<Spacing> {
    if let Some(value) = case.domain.spacing {
        return Some(Spacing {
            value,
            reason: None,
        });
    }
    let unknown = case
        .bodies
        .iter()
        .any(|b| features::width(&b.shape).is_none());
    if unknown || case.blocks.is_some() {
        findings.error(
            "domain.spacing",
            "the widths of blocks, meshes and half-spaces are not known in advance",
            "state the spacing: about a tenth of the smallest width",
        );
        return None;
    }
    let (wanted, reason) = match features::lattice(case) {
        Some(lbm) => {
            let need = needs(case, lbm, None, None);
            need.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?
        }
        None => without_lattice(case, findings)?,
    };
    whole_cells(case, wanted, reason, findings)
}

/// A finer spacing than that of the scene, if its velocities require one.
pub(crate) fn finer(case: &Case, scene: &Scene) -> Option<Spacing> {
    let lbm = features::lattice(case).filter(|_| case.domain.spacing.is_none())?;
    let flow = scene.flow.as_ref()?;
    let speed = step::fastest(scene, flow)?.value;
    let finest = |a: (f64, String), b: (f64, String)| if b.0 < a.0 { b } else { a };
    let mut wanted = needs(case, lbm, Some(flow), Some(speed))
        .into_iter()
        .reduce(finest)?;
    if scene.grid.dimension == 2
        && lbm.turbulence.is_none()
        && let Some(h) = step::stable_spacing(flow, speed, asked(case)?.target())
        && h * MOST_FINER >= wanted.0
    {
        let reason = format!(
            "in 2-D no operator is stable on coarser cells at {} m/s",
            number(speed)
        );
        wanted = finest(wanted, (h, reason));
    }
    let (wanted, reason) = wanted;
    // Findings about the sizes were reported with the coarser cells.
    let mut unheard = Findings::new(case);
    let found = whole_cells(case, wanted, reason, &mut unheard)?;
    (found.value < scene.grid.spacing * (1.0 - 1e-9)).then_some(found)
}

/// The spacing \[m\] that each feature requires, and a sentence.
fn needs(
    case: &Case,
    lbm: &LatticeBoltzmann,
    flow: Option<&Flow>,
    speed: Option<f64>,
) -> Vec<(f64, String)> {
    let Some(accuracy) = asked(case) else {
        return Vec::new();
    };
    let dimension = case.domain.size.0.len();
    let target = SHARE * accuracy.target();
    let need = |feature: &Feature| {
        let reynolds = speed.map_or(0.0, |u| u * feature.size / lbm.kinematic_viscosity);
        let bound = Bound::of(dimension, feature.obstacle)?;
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
    // What grows in a short run asks for no cells: the plan says that it is not resolved.
    features::of(case, lbm, flow, None)
        .iter()
        .filter_map(need)
        .collect()
}

/// Grains decide where there is no lattice.
fn without_lattice(case: &Case, findings: &mut Findings) -> Option<(f64, String)> {
    let bodies = case.bodies.iter();
    let bodies = bodies.filter_map(|body| features::width(&body.shape));
    let widest = bodies.fold(0.0, f64::max);
    let (smallest, largest) = features::grain_diameters(case).unwrap_or((widest, widest));
    let (size, reason) = match &case.fluid {
        Some(Fluid::Darcy(darcy)) if darcy.grid.is_none() => (
            (SEEPAGE_DIAMETERS * 0.5 * (smallest + largest)).max(largest),
            "three mean diameters: the seepage is averaged over grains",
        ),
        _ => (
            SLAB_DIAMETERS * largest.max(widest),
            "two of the largest diameters: without a lattice the cells only define the slabs",
        ),
    };
    if size <= 0.0 {
        findings.error(
            "domain.spacing",
            "nothing in the case determines the size of a cell",
            "state the spacing, or add grains or a fluid",
        );
        return None;
    }
    Some((size, reason.into()))
}

/// The coarsest spacing, at most the wanted one and at least half of it, of which every edge is a whole number.
fn whole_cells(
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
    let fits = |h: f64| sizes.iter().all(|size| fits_one(*size, h));
    let found = (0..=whole(least))
        .map(|more| shortest / (least + real(more)))
        .find(|h| fits(*h));
    if found.is_none() {
        let h = shortest / least;
        // Cells up to ten times as fine are worth naming, no more.
        let finer =
            (0..=whole(10.0 * least)).map(|more| length_of(1.0, shortest / (least + real(more))));
        let common = finer.into_iter().find(|h| fits(*h));
        for (axis, size) in sizes
            .iter()
            .enumerate()
            .filter(|(_, size)| !fits_one(**size, h))
        {
            let cells = (size / h).floor();
            let [below, above] = [cells, cells + 1.0].map(|n| length_of(n, h));
            let path = format!("domain.size[{axis}]");
            let text = format!("use {below} or {above} m");
            let remedy = match common {
                Some(common) => Remedy::from(format!(
                    "{text}, or state a spacing of {common} m, which divides them all"
                ))
                .set("domain.spacing", common),
                None => Remedy::from(text).set(&*path, below),
            };
            findings.error(
                &path,
                "no spacing between the required one and half of it divides all edges of the domain",
                remedy,
            );
        }
    }
    found.map(|value| Spacing {
        value,
        reason: Some(reason),
    })
}

/// Whether an edge is a whole number of cells.
fn fits_one(size: f64, h: f64) -> bool {
    (size / h - (size / h).round()).abs() <= 1e-7 * (size / h)
}
