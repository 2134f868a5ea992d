//! The domain as a grid of cells.

use super::findings::{Findings, length_of, number};
use base::error::Remedy;
use base::number::{real, whole};
use case::domain::{Domain, Split};
use serde::Serialize;

/// Domain as a grid of cells; the lower corner is the origin, cell centres lie at (i + 1/2) h.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Grid {
    /// Dimension: 2 or 3.
    pub dimension: usize,
    /// Cells along each axis; 1 along z in 2-D.
    pub cells: [usize; 3],
    /// Edge lengths \[m\]; along z in 2-D one spacing, which has no effect.
    pub size: [f64; 3],
    /// Edge h of a cell \[m\].
    pub spacing: f64,
    /// `true` for each periodic axis; false along z in 2-D.
    pub periodic: [bool; 3],
    /// First plane of every slab after the first one; none if the slabs have equal cost.
    pub split_axis: usize,
    /// First plane of every slab after the first; none for slabs of equal cost.
    pub slab_bounds: Option<Vec<usize>>,
}

/// Maximum number of cells along an axis; more indicate a wrong unit.
const MAX_CELLS: f64 = 1e9;

impl Grid {
    /// Returns the number of cells.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        self.cells.iter().product()
    }

    /// Returns the centre of a cell \[m\].
    #[must_use]
    pub fn centre(&self, cell: [usize; 3]) -> [f64; 3] {
        cell.map(|i| (real(i) + 0.5) * self.spacing)
    }

    /// Returns `true` if a point is in the domain.
    #[must_use]
    pub fn contains(&self, point: [f64; 3]) -> bool {
        (0..self.dimension).all(|a| point[a] >= 0.0 && point[a] <= self.size[a])
    }

    pub(crate) fn resolve(domain: &Domain, findings: &mut Findings) -> Option<Self> {
        let dimension = domain.size.0.len();
        let spacing = domain.spacing?;
        if !((2..=3).contains(&dimension) && spacing > 0.0 && spacing.is_finite()) {
            return None;
        }
        let mut cells = [1; 3];
        let mut size = [spacing; 3];
        let mut good = true;
        for (axis, length) in domain.size.0.iter().enumerate() {
            match cells_along(axis, *length, spacing, findings) {
                Some(count) => (cells[axis], size[axis]) = (count, *length),
                None => good = false,
            }
        }
        let periodic = periodic_axes(domain, dimension, findings);
        let split_axis = match domain.split {
            Split::Auto => (0..dimension).rev().max_by_key(|a| cells[*a]).unwrap_or(0),
            Split::X => 0,
            Split::Y => 1,
            Split::Z => 2,
        };
        if split_axis >= dimension {
            findings.error(
                "domain.split",
                "there is no z in a 2-D problem",
                Remedy::from("use auto, x or y").set("domain.split", "auto"),
            );
            good = false;
        }
        let most = cells[split_axis.min(2)];
        let bounds = domain.slab_bounds.as_ref();
        let slab_bounds = bounds.map(|bounds| planes_between_slabs(bounds, most, findings));
        good.then_some(Self {
            dimension,
            cells,
            size,
            spacing,
            periodic,
            split_axis,
            slab_bounds,
        })
    }
}

/// Returns the number of cells along an axis of this length \[m\]; none with a finding if the spacing does not
/// divide it.
fn cells_along(axis: usize, length: f64, spacing: f64, findings: &mut Findings) -> Option<usize> {
    let path = format!("domain.size[{axis}]");
    let ratio = length / spacing;
    if !(length > 0.0 && ratio.is_finite()) {
        findings.error(
            &path,
            "the domain needs a positive size",
            "write a length in m",
        );
        return None;
    }
    if ratio > MAX_CELLS {
        findings.error(
            &path,
            format!(
                "this makes {} cells; at most {MAX_CELLS:e} are allowed along an axis",
                number(ratio)
            ),
            "check the units: size and spacing are in m",
        );
        return None;
    }
    if (ratio - ratio.round()).abs() > 1e-6 * ratio.max(1.0) || ratio < 0.5 {
        let cells = ratio.floor().max(1.0);
        let [below, above] = [cells, cells + 1.0].map(|n| length_of(n, spacing));
        let nearest = if ratio.round() > cells { above } else { below };
        findings.error(
            &path,
            format!(
                "the size is {} spacings; it must be a whole number of them",
                number(ratio)
            ),
            Remedy::from(format!(
                "use {below} or {above} m, or a spacing that divides it, such as {} m",
                number(length / ratio.round().max(1.0))
            ))
            .set(&*path, nearest),
        );
        return None;
    }
    Some(whole(ratio.round()))
}

/// Returns `true` for each axis along which the domain is periodic.
fn periodic_axes(domain: &Domain, dimension: usize, findings: &mut Findings) -> [bool; 3] {
    let mut periodic = [false; 3];
    for (n, axis) in domain.periodic.iter().enumerate() {
        let path = format!("domain.periodic[{n}]");
        if axis.index() >= dimension {
            findings.error(&path, "there is no z in a 2-D problem", "remove it");
        } else if std::mem::replace(&mut periodic[axis.index()], true) {
            findings.error(&path, "this axis is named twice", "remove one of them");
        }
    }
    periodic
}

/// Returns the planes between slabs, each between 0 and `most`.
fn planes_between_slabs(bounds: &[u32], most: usize, findings: &mut Findings) -> Vec<usize> {
    let plane = |bound: &u32| usize::try_from(*bound).unwrap_or(usize::MAX);
    let planes: Vec<usize> = bounds.iter().map(plane).collect();
    if planes.windows(2).any(|w| w[0] > w[1]) || planes.iter().any(|p| *p > most) {
        findings.error(
            "domain.slab_bounds",
            format!("the planes must increase and lie between 0 and {most}"),
            Remedy::take_out(
                "sort them, or omit them for slabs of equal cost",
                "domain.slab_bounds",
            ),
        );
    }
    planes
}
