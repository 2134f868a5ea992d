//! Design probes of seepage: discharge between two points, heave of prisms.
//!
//! They are separate from the other probes because they are resolved on the coarse grid.

use super::ProbeAt;
use crate::scene::aligned_box::AlignedBox;
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use crate::scene::seepage::grid_of;
use case::Case;
use case::fluid::Fluid;
use case::geometry::{Extent, Face, Vector};
use darcy::Prisms;

/// Returns a point; reports a finding if it lies outside the domain.
pub(super) fn inside(
    grid: &Grid,
    point: [f64; 3],
    path: &str,
    findings: &mut Findings,
) -> [f64; 3] {
    if !grid.contains(point) {
        findings.error(path, "the probe lies outside the domain", "move it inside");
    }
    point
}

/// Returns the discharge between two points; reports a finding in 3-D, without seepage or if the points coincide.
pub(super) fn crossing(
    (case, grid): (&Case, &Grid),
    ends: [&Vector; 2],
    path: &str,
    findings: &mut Findings,
) -> ProbeAt {
    if matches!(case.fluid, Some(Fluid::LatticeBoltzmann(_))) {
        findings.error(
            path,
            "a crossing measures seepage, but this fluid is computed on a lattice",
            "use a plane",
        );
    } else if grid.dimension == 3 {
        findings.error(
            path,
            "two points can bound a discharge in 2-D only",
            "use a section with a `part`",
        );
    }
    let [from, to] = [("from", ends[0]), ("to", ends[1])].map(|(name, end)| {
        let path = format!("{path}.{name}");
        let point = AlignedBox::vector(grid, end, &path, findings);
        inside(grid, point, &path, findings)
    });
    let apart = (0..2).any(|a| from[a].total_cmp(&to[a]).is_ne());
    if !apart {
        findings.error(
            &format!("{path}.to"),
            "the two points are equal, so that no water passes between them",
            "move one of them",
        );
    }
    ProbeAt::Crossing { from, to }
}

/// Returns the prisms of a heave probe; reports a finding if they do not lie in the ground.
pub(super) fn heave(
    (case, grid): (&Case, &Grid),
    prism: &Extent,
    (at, submerged_weight): (Face, f64),
    path: &str,
    findings: &mut Findings,
) -> Option<ProbeAt> {
    let Some(Fluid::Darcy(_)) = &case.fluid else {
        findings.error(
            path,
            "heave needs ground with seepage, but this case has none",
            "add `fluid.darcy`, or remove the probe",
        );
        return None;
    };
    let gravity = (case.gravity.as_ref()).map_or([0.0; 3], Vector::to_array);
    let steepest = gravity.map(f64::abs).into_iter().fold(0.0, f64::max);
    let pulls = |a: &usize| gravity[*a].abs() > 1e-9 * steepest;
    let (Some(vertical), 1) = ((0..3).find(pulls), (0..3).filter(pulls).count()) else {
        findings.error(
            path,
            "heave needs gravity along an axis",
            "add `gravity`, such as [0, -9.81], or use points",
        );
        return None;
    };
    let block = AlignedBox::resolve(grid, prism, &format!("{path}.prism"), findings);
    let across = at.axis();
    if across == vertical || across >= grid.dimension {
        findings.error(
            &format!("{path}.at"),
            "widths are measured from a vertical face of the box",
            "choose the face at the structure, such as x_min",
        );
        return None;
    }
    if !(submerged_weight.is_finite() && submerged_weight > 0.0) {
        findings.error(
            &format!("{path}.submerged_weight"),
            format!(
                "the value is {}; it must be above 0",
                number(submerged_weight)
            ),
            "state the submerged unit weight in N/m3, such as 9500 for sand",
        );
    }
    // A wrong grid has its own finding.
    let coarse = grid_of(case, grid)?;
    let (mut first, mut end) = ([0; 3], [1; 3]);
    for a in 0..grid.dimension {
        let axis = coarse.axis(a);
        // Use planes between cells: the nearest ones along gravity, otherwise those that enclose the cells with
        // centres in the box.
        let place = |x: f64| {
            if a == vertical {
                axis.nearest_face(x)
            } else {
                axis.first_centre(x)
            }
        };
        (first[a], end[a]) = (place(block.from[a]), place(block.to[a]));
        if first[a] >= end[a] {
            findings.error(
                &format!("{path}.prism"),
                format!("the box contains no cell along {}", ["x", "y", "z"][a]),
                format!(
                    "the cells of the seepage are {} m long there",
                    number(axis.spacing)
                ),
            );
            return None;
        }
    }
    Some(ProbeAt::Heave(Prisms {
        vertical,
        rises: gravity[vertical] < 0.0,
        across,
        from_upper: at.is_max(),
        first,
        end,
        submerged_weight,
    }))
}
