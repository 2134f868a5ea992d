//! Single rows of cells, as a reference for the rows of a layer.

use super::super::{Form, LEVEL, RowIntervals};
use base::ball::{EMPTY, NormalDistances, chord};
use lbm::links::CellPlane;

/// Returns the row of cells along `axis` through the cell with this lower corner.
pub(super) fn row(form: &Form<'_>, axis: usize, lower: [f64; 3]) -> RowIntervals {
    match form {
        Form::Disc { centre, radius } => {
            let distances = NormalDistances::along_axis(centre[1 - axis], lower[1 - axis]);
            round_row(centre[axis], *radius, distances)
        }
        Form::Ball { centre, radius } => {
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            let distances = NormalDistances::along_axis(centre[b], lower[b])
                + NormalDistances::along_axis(centre[c], lower[c]);
            round_row(centre[axis], *radius, distances)
        }
        Form::Block { surface, .. } => block_row(surface.planes(), axis, lower),
    }
}

/// Returns the row of a ball or disc; `centre` along the row.
fn round_row(centre: f64, radius: f64, distances: NormalDistances) -> RowIntervals {
    let reach = |squared: f64| chord(centre, radius, squared);
    RowIntervals {
        outer: reach(distances.nearest),
        inner: reach(distances.farthest),
        deep: reach(distances.beyond),
    }
}

fn block_row(planes: &[CellPlane], axis: usize, lower: [f64; 3]) -> RowIntervals {
    let mut row = RowIntervals {
        outer: RowIntervals::ALL,
        inner: RowIntervals::ALL,
        deep: RowIntervals::ALL,
    };
    for plane in planes {
        let n = plane.normal;
        let mut least = 0.0;
        let mut most = 0.0;
        let mut distances = 0.0;
        for b in (0..3).filter(|&b| b != axis) {
            let (p, q) = (n[b] * lower[b], n[b] * (lower[b] + 1.0));
            least += p.min(q);
            most += p.max(q);
            distances += n[b].abs();
        }
        narrow(&mut row.outer, n[axis], plane.offset - least);
        narrow(&mut row.inner, n[axis], plane.offset - most);
        narrow(&mut row.deep, n[axis], plane.offset - most - distances);
    }
    row
}

/// Restricts an interval to the part with `slope * x <= room`.
fn narrow(interval: &mut [f64; 2], slope: f64, room: f64) {
    if slope > LEVEL {
        interval[1] = interval[1].min(room / slope);
    } else if slope < -LEVEL {
        interval[0] = interval[0].max(room / slope);
    } else if room < 0.0 {
        *interval = EMPTY;
    }
}
