//! Resolved analysis of a ground collapse: axes, boxes of the seepage points, and thresholds as written.

use super::aligned_box::AlignedBox;
use super::findings::{Findings, number};
use super::grid::Grid;
use super::observe::{ObservedRegion, RegionAction, due};
use super::unique;
use base::error::Remedy;
use base::number::whole;
use case::Case;
use case::check::nearest;
use case::collapse::StageThresholds;
use serde::Serialize;
use serde_json::json;

/// Maximum number of cells; more indicate a wrong unit. The state of the analysis has a number for each cell.
pub const MAX_CELLS: f64 = 1e6;

/// Analysis of ground collapse.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroundCollapse {
    /// Time between samples \[s\].
    pub every: f64,
    /// The seepage points.
    pub points: Vec<SeepagePoint>,
    /// Long horizontal axis, other horizontal axis and vertical axis, each 0, 1 or 2.
    pub axes: [usize; 3],
    /// `true` if gravity points to smaller coordinates.
    pub upright: bool,
    /// Edge of the cells \[m\]; none if it follows from the grains.
    pub cell_size: Option<f64>,
    /// Fraction of its initial solid volume below which a cell is void.
    pub void_below: f64,
    /// Displacement above which a grain is loose \[mean diameters\].
    pub loose_diameters: f64,
    /// Percentile of the settlement that is reported.
    pub settlement_percentile: f64,
    /// Thresholds as given in the case.
    pub stages: StageThresholds,
}

/// Point through which grains leave the ground.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeepagePoint {
    /// Name of the point.
    pub name: String,
    /// Box of the point.
    pub block: AlignedBox,
    /// Region of this name, whose removals count; if none, all removals within the box count.
    pub region: Option<usize>,
}

const PATH: &str = "analysis.ground_collapse";

pub(crate) fn resolve(
    case: &Case,
    grid: &Grid,
    gravity: [f64; 3],
    regions: &[ObservedRegion],
    findings: &mut Findings,
) -> Option<GroundCollapse> {
    let written = case.analysis.ground_collapse.as_ref()?;
    due(case, written.every, &format!("{PATH}.every"), findings);
    if case.grains.is_none() {
        findings.error(
            PATH,
            "there are no grains in this case",
            Remedy::take_out("add `grains`, or remove the analysis", PATH),
        );
    }
    if grid.dimension != 3 {
        findings.error(
            PATH,
            "this analysis requires a surface over two horizontal axes and therefore a 3-D domain; this one is 2-D",
            Remedy::take_out("remove it; `erosion_law` also works in 2-D", PATH),
        );
        return None;
    }
    let pulls: Vec<usize> = (0..3).filter(|&axis| gravity[axis] != 0.0).collect();
    let &[vertical] = pulls.as_slice() else {
        findings.error(
            "gravity",
            "the settlement of the ground is measured along gravity, which must point along one axis",
            Remedy::from("write for example [0, 0, -9.81], or remove `analysis.ground_collapse`")
                .set("gravity", json!([0, 0, -9.81])),
        );
        return None;
    };
    let flat: Vec<usize> = (0..3).filter(|&axis| axis != vertical).collect();
    let default = if grid.size[flat[1]] > grid.size[flat[0]] {
        flat[1]
    } else {
        flat[0]
    };
    let long = written.long_axis.map_or(default, |axis| axis.index());
    if long == vertical {
        findings.error(
            &format!("{PATH}.long_axis"),
            "this axis is vertical, parallel to gravity",
            Remedy::take_out(
                "name a horizontal axis, or omit it",
                &format!("{PATH}.long_axis"),
            ),
        );
        return None;
    }
    if let Some(size) = written.cell_size {
        let least = grid.size.iter().copied().fold(f64::INFINITY, f64::min);
        let cells: f64 = grid.size.iter().map(|length| length / size).product();
        let path = format!("{PATH}.cell_size");
        if size > least {
            findings.error(
                &path,
                format!(
                    "a cell is larger than the domain, whose shortest edge is {} m",
                    number(least)
                ),
                Remedy::take_out("use about two mean diameters, or omit it", &path),
            );
        } else if cells > MAX_CELLS {
            findings.error(
                &path,
                format!(
                    "this makes {} cells; at most {} are allowed",
                    number(cells),
                    number(MAX_CELLS)
                ),
                format!(
                    "use cells of at least {}",
                    number((grid.size.iter().product::<f64>() / MAX_CELLS).cbrt())
                ),
            );
        }
    }
    Some(GroundCollapse {
        every: written.every,
        points: points(case, grid, regions, findings),
        axes: [long, 3 - long - vertical, vertical],
        upright: gravity[vertical] < 0.0,
        cell_size: written.cell_size,
        void_below: written.void_below,
        loose_diameters: written.loose_diameters,
        settlement_percentile: written.settlement_percentile,
        stages: written.stages.clone(),
    })
}

/// Returns the named points, or one for every region that removes grains.
fn points(
    case: &Case,
    grid: &Grid,
    regions: &[ObservedRegion],
    findings: &mut Findings,
) -> Vec<SeepagePoint> {
    let Some(written) = &case.analysis.ground_collapse else {
        return Vec::new();
    };
    let removes = |region: &ObservedRegion| matches!(region.action, RegionAction::Remove { .. });
    let removing = || regions.iter().enumerate().filter(|(_, r)| removes(r));
    let of_region = |(n, region): (usize, &ObservedRegion)| SeepagePoint {
        name: region.name.clone(),
        block: region.block,
        region: Some(n),
    };
    if written.points.is_empty() {
        let all: Vec<SeepagePoint> = removing().map(of_region).collect();
        if all.is_empty() {
            findings.error(
                &format!("{PATH}.points"),
                "no region removes grains, so there is no seepage point",
                "add a region with {\"remove\": {}}, or a point with a box",
            );
        }
        return all;
    }
    let mut known = Vec::new();
    let mut found = Vec::new();
    for (n, point) in written.points.iter().enumerate() {
        let path = format!("{PATH}.points[{n}]");
        unique(&mut known, &point.name, &format!("{path}.name"), findings);
        if let Some(extent) = &point.region {
            found.push(SeepagePoint {
                name: point.name.clone(),
                block: AlignedBox::resolve(grid, extent, &format!("{path}.box"), findings),
                region: removing()
                    .find(|(_, region)| region.name == point.name)
                    .map(|(n, _)| n),
            });
            continue;
        }
        match removing().find(|(_, region)| region.name == point.name) {
            Some(one) => found.push(of_region(one)),
            None => {
                let names: Vec<&str> = removing().map(|(_, r)| r.name.as_str()).collect();
                let remedy = match nearest(&point.name, &names) {
                    Some(near) => {
                        Remedy::from(format!("did you mean `{near}`? Or give it a `box`"))
                            .set(format!("{path}.name"), near)
                    }
                    None if names.is_empty() => "give it a `box`".into(),
                    None => format!(
                        "use one of the regions that remove grains: {}; or give it a `box`",
                        names.join(", ")
                    )
                    .into(),
                };
                findings.error(
                    &format!("{path}.name"),
                    "no region with this name removes grains",
                    remedy,
                );
            }
        }
    }
    found
}

impl GroundCollapse {
    /// Returns the number of cells along each of [`Self::axes`] for a domain, with edges near `size` \[m\], limited
    /// to [`MAX_CELLS`] in total.
    #[must_use]
    pub fn cells(&self, domain: [f64; 3], size: f64) -> [usize; 3] {
        let least = (domain.iter().product::<f64>() / MAX_CELLS).cbrt();
        self.axes
            .map(|axis| whole((domain[axis] / size.max(least)).round()).max(1))
    }
}
