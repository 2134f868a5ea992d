//! Parts of the domain as boxes that may be unbounded.

use super::aligned_box::AlignedBox;
use super::findings::{Findings, number};
use super::grid::Grid;
use case::geometry::{Axis, Region};

/// Returns the lower and upper corner of a region \[m\], infinite along unbounded axes; reports a finding for an
/// invalid region.
pub(crate) fn region(
    grid: &Grid,
    region: &Region,
    path: &str,
    findings: &mut Findings,
) -> [[f64; 3]; 2] {
    let (mut low, mut high) = ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
    match region {
        Region::Box(extent) => {
            let block = AlignedBox::resolve(grid, extent, &format!("{path}.box"), findings);
            for a in 0..grid.dimension {
                (low[a], high[a]) = (block.from[a], block.to[a]);
            }
        }
        Region::Layer(layer) => {
            let path = format!("{path}.layer");
            let upright = if grid.dimension == 2 {
                Axis::Y
            } else {
                Axis::Z
            };
            let axis = layer.axis.unwrap_or(upright);
            let a = axis.index();
            if a >= grid.dimension {
                findings.error(
                    &format!("{path}.axis"),
                    "a 2-D problem has no axis z",
                    "use x or y",
                );
                return [low, high];
            }
            (low[a], high[a]) = (layer.from.unwrap_or(low[a]), layer.to.unwrap_or(high[a]));
            let size = grid.size[a];
            if low[a] >= high[a] {
                findings.error(
                    &path,
                    format!(
                        "the layer has no thickness: from {} to {} m along {}",
                        number(low[a]),
                        number(high[a]),
                        axis.name()
                    ),
                    "make `to` larger than `from`",
                );
            } else if low[a] >= size || high[a] <= 0.0 {
                findings.error(
                    &path,
                    format!(
                        "the layer lies outside the domain, which is 0 … {} m along {}",
                        number(size),
                        axis.name()
                    ),
                    "move it into the domain",
                );
            }
        }
    }
    [low, high]
}
