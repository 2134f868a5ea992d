//! Resolution of a bed of grains that a probe measures.

use crate::scene::aligned_box::AlignedBox;
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use base::error::Remedy;
use base::number::whole;
use case::Case;
use case::geometry::Extent;
use case::observe;
use serde::Serialize;

/// Bed of grains of a probe: see [`case::observe::Bed`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObservedBed {
    /// Axis of the stream, axis normal to the bed, and the transverse axis, which has no extent in 2-D.
    pub axes: [usize; 3],
    /// Component of gravity normal to the bed, as a magnitude [m/s²].
    pub gravity: f64,
    /// Cells of the measured part along each axis: first cell, and one past the last.
    pub cells: [[usize; 2]; 3],
    /// Solid fraction that defines the surface.
    pub threshold: f64,
    /// Diameter for the dimensionless numbers \[m\]; none for the median of the grains.
    pub diameter: Option<f64>,
    /// Height from which scour is measured \[m\]; none for that of the first sample.
    pub level: Option<f64>,
    /// Start of the time means \[s\].
    pub mean_from: f64,
}

const AXES: [&str; 3] = ["x", "y", "z"];
/// Last alternative in the remedies of findings about a bed.
const REMOVE: &str = "or remove the probe";

/// Resolves the bed of a probe; reports a finding if there is none to measure.
pub(super) fn resolve(
    case: &Case,
    grid: &Grid,
    written: &observe::Bed,
    path: &str,
    findings: &mut Findings,
) -> Option<ObservedBed> {
    let Some(grains) = &case.grains else {
        findings.error(
            path,
            "this case has no grains and therefore no bed",
            format!("add `grains`, {REMOVE}"),
        );
        return None;
    };
    let flow = written.flow_axis.index();
    if flow >= grid.dimension {
        findings.error(
            &format!("{path}.flow_axis"),
            "there is no z in a 2-D problem",
            Remedy::from("use x").set(format!("{path}.flow_axis"), "x"),
        );
        return None;
    }
    let gravity = case.gravity.as_ref().map_or([0.0; 3], |g| g.to_array());
    let across = (0..grid.dimension).filter(|&axis| axis != flow);
    let normal = across.max_by(|&a, &b| gravity[a].abs().total_cmp(&gravity[b].abs()))?;
    let pull = gravity[normal];
    if !check_pull(pull, AXES[normal], AXES[flow], path, findings) {
        return None;
    }
    if grid.periodic[normal] {
        findings.error(
            path,
            format!(
                "the axis {} is periodic, so that the stream has no top and the bed has no bottom",
                AXES[normal]
            ),
            format!("remove {} from `domain.periodic`, {REMOVE}", AXES[normal]),
        );
    }
    check_weight(case, &grains.material, path, findings);
    let part = format!("{path}.part");
    let cells = cells(written.part.as_ref(), grid, &part, findings)?;
    let height = |level: f64| (0.0..=grid.size[normal]).contains(&level);
    if written.level.is_some_and(|level| !height(level)) {
        findings.error(
            &format!("{path}.level"),
            format!(
                "this height lies outside the domain, which is 0 … {} m along {}",
                number(grid.size[normal]),
                AXES[normal]
            ),
            "use a height inside the domain, or remove the field",
        );
    }
    Some(ObservedBed {
        axes: [flow, normal, 3 - flow - normal],
        gravity: -pull,
        cells,
        threshold: (written.threshold).unwrap_or(if grid.dimension == 2 { 0.4 } else { 0.3 }),
        diameter: written.diameter,
        level: written.level,
        mean_from: super::averaging_start(case, written.mean_from, path, findings),
    })
}

/// Returns `true` if gravity points to the lower face of the bed; otherwise reports a finding.
fn check_pull(pull: f64, normal: &str, flow: &str, path: &str, findings: &mut Findings) -> bool {
    let upward = pull >= 0.0;
    if upward {
        let reason = if pull > 0.0 {
            format!(
                "gravity points to the upper face along {normal}, with {} m/s2, but the probe expects the bed at \
                 the lower face",
                number(pull)
            )
        } else {
            format!(
                "no gravity acts normal to the stream, which flows along {flow}: without weight there is no bed \
                 and no Shields number"
            )
        };
        findings.error(
            path,
            reason,
            format!(
                "use gravity with a negative component normal to the stream, choose another `flow_axis`, \
                 {REMOVE}"
            ),
        );
    }
    !upward
}

/// Refuses grains that do not sink in the fluid.
fn check_weight(case: &Case, grains: &str, path: &str, findings: &mut Findings) {
    let density = |name: &str| case.materials.get(name).and_then(|m| m.density);
    if let (Some(solid), Some(case::fluid::Fluid::LatticeBoltzmann(fluid))) =
        (density(grains), &case.fluid)
        && solid <= fluid.density
    {
        findings.error(
            path,
            format!(
                "grains of {} kg/m3 do not sink in a fluid of {} kg/m3, so that there is no Shields number",
                number(solid),
                number(fluid.density)
            ),
            format!("use a denser material, {REMOVE}"),
        );
    }
}

/// Returns the cells of a part along each axis, first cell and one past the last; reports a finding for fewer than
/// two.
fn cells(
    part: Option<&Extent>,
    grid: &Grid,
    path: &str,
    findings: &mut Findings,
) -> Option<[[usize; 2]; 3]> {
    let block = part.map(|part| AlignedBox::resolve(grid, part, path, findings));
    let cells: [[usize; 2]; 3] = std::array::from_fn(|axis| match &block {
        Some(block) if axis < grid.dimension => {
            // A cell belongs to the part if its centre does.
            let edge = |x: f64| {
                let cell = (x / grid.spacing - 0.5 - 1e-6).ceil().max(0.0);
                whole(cell).min(grid.cells[axis])
            };
            [edge(block.from[axis]), edge(block.to[axis])]
        }
        _ => [0, grid.cells[axis]],
    });
    if (0..grid.dimension).any(|axis| cells[axis][1] < cells[axis][0] + 2) {
        findings.error(
            path,
            "the part contains fewer than two cells along an axis",
            format!("make it larger; a cell is {} m wide", number(grid.spacing)),
        );
        return None;
    }
    Some(cells)
}
