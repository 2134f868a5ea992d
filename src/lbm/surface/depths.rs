//! Division of rows into parts far from the surface, where two steps are made in one sweep, and the others.
//!
//! A part of a row is far from the surface if all cells within [`REACH`] of it are liquid. Between two steps the
//! surface reads and writes the incoming populations of interface cells and of cells up to two away from them: a
//! conversion makes liquid cells next to an interface cell into interface cells, and the surface in these follows from
//! the liquid cells inside. The numbers that a far cell reads in the second step are therefore final when its
//! neighbours have made the first one.
//!
//! In each row all between the first and the last part near the surface is near. Of a row along a periodic axis, whose
//! ends are copied after its cells, all or nothing is far.

use super::lists::{Plane, TOGETHER};
use base::number::to_u32;

/// Number of cells around a far cell along each axis that are liquid.
const REACH: usize = 3;
const REACH_ALONG: u32 = 3;

/// Number of cells of a row that are near or far together: the widest vector of a pass.
const PART: u32 = 16;

const _: () = assert!(PART as usize == 2 * TOGETHER && REACH_ALONG as usize == REACH);

/// First cell of a row near the surface and the end of these cells; the first is not below the end if there are none.
type Hull = [u32; 2];

/// Hull of a row without cells near the surface, and of one without others.
const NONE: Hull = [u32::MAX, 0];
const ALL: Hull = [0, u32::MAX];

/// Returns the hull that contains both.
#[inline(always)]
fn both([a, b]: Hull, [c, d]: Hull) -> Hull {
    [a.min(c), b.max(d)]
}

/// Rows of a slab.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlabRows {
    /// Number of rows of a plane, and of cells of a row.
    pub(crate) rows: usize,
    pub(crate) cells: usize,
    /// Position of the first cell, and distances in positions between planes and between rows.
    pub(crate) first: usize,
    pub(crate) plane: usize,
    pub(crate) row: usize,
    /// `true` if the slab is periodic across the rows of a plane, and along the rows.
    pub(crate) periodic: [bool; 2],
}

impl SlabRows {
    /// Finds the hulls of the cells of a plane's rows that are not liquid.
    fn find(&self, n: usize, plane: &Plane, to: &mut [Hull]) {
        let length = to_u32(self.cells);
        if plane.is_empty() {
            to.fill([0, length]);
            return;
        }
        for (row, hull) in to.iter_mut().enumerate() {
            *hull = NONE;
            let mut end = 0;
            for &[a, b] in plane.spans(row).iter().chain(&[[length, length]]) {
                if end < a {
                    *hull = both(*hull, [end, a]);
                }
                end = b;
            }
        }
        for &cell in &plane.surface {
            let at = cell as usize - self.first - n * self.plane;
            let column = to_u32(at % self.row);
            let hull = &mut to[at / self.row];
            *hull = both(*hull, [column, column + 1]);
        }
    }

    /// Extends hulls by their reach, along rows to whole parts.
    fn extend(&self, hulls: &[Hull], to: &mut [Hull]) {
        let [across, along] = self.periodic;
        let rows = self.rows;
        if hulls.iter().all(|[first, end]| first >= end) {
            to.fill(NONE);
            return;
        }
        for (row, to) in to.iter_mut().enumerate() {
            let window = rows + row - REACH.min(rows)..rows + row + REACH.min(rows) + 1;
            let inside = window.filter(|at| across || (rows..2 * rows).contains(at));
            let [first, end] = inside.fold(NONE, |hull, at| both(hull, hulls[at % rows]));
            *to = if first >= end {
                NONE
            } else if along {
                ALL
            } else {
                [
                    first.saturating_sub(REACH_ALONG) / PART * PART,
                    (end + REACH_ALONG).div_ceil(PART) * PART,
                ]
            };
        }
    }

    /// Returns the parts of a row outside a hull.
    fn outside(&self, [first, end]: Hull) -> impl Iterator<Item = [u32; 2]> + use<> {
        let length = to_u32(self.cells);
        let parts = if first < end {
            [[0, first.min(length)], [end, length]]
        } else {
            [[0, length], [0, 0]]
        };
        parts.into_iter().filter(|[a, b]| a < b)
    }
}

/// Division of the rows of a slab.
#[derive(Debug, Default)]
pub(crate) struct Depths {
    far: Vec<Plane>,
    near: Vec<Plane>,
    /// Hulls of all rows of each plane: of the cells that are not liquid, and of the cells near them.
    own: Vec<Hull>,
    hulls: Vec<Hull>,
    /// Hulls of the rows of several planes; a reusable buffer.
    of_planes: Vec<Hull>,
}

impl Depths {
    /// Returns the parts of each plane far from the surface.
    pub(crate) fn far(&self) -> &[Plane] {
        &self.far
    }

    /// Returns the other parts with water of each plane.
    pub(crate) fn near(&self) -> &[Plane] {
        &self.near
    }

    /// Finds the parts far from the surface, from the lists of the planes; only planes for which `may` is `true` have
    /// any. Returns `true` if there are some.
    pub(crate) fn find(
        &mut self,
        planes: &[Plane],
        slab: SlabRows,
        may: impl Fn(usize) -> bool,
    ) -> bool {
        let (count, rows) = (planes.len(), slab.rows);
        let of = |n: usize| n * rows..(n + 1) * rows;
        self.own.resize(count * rows, NONE);
        self.of_planes.resize(rows, NONE);
        for (n, plane) in planes.iter().enumerate() {
            slab.find(n, plane, &mut self.own[of(n)]);
        }
        self.hulls.clear();
        self.hulls.resize(count * rows, ALL);
        for n in REACH..count.saturating_sub(REACH) {
            if may(n) && !planes[n].is_empty() {
                self.of_planes.fill(NONE);
                for n in n - REACH..=n + REACH {
                    for (hull, own) in self.of_planes.iter_mut().zip(&self.own[of(n)]) {
                        *hull = both(*hull, *own);
                    }
                }
                slab.extend(&self.of_planes, &mut self.hulls[of(n)]);
            }
        }
        self.far.resize_with(count, Plane::default);
        let mut any = false;
        for (n, plane) in self.far.iter_mut().enumerate() {
            // Planes of gas are many, and remain so.
            if planes[n].is_empty() && plane.is_made() && plane.is_empty() {
                continue;
            }
            plane.set_spans(self.hulls[of(n)].iter().map(|hull| slab.outside(*hull)));
            any |= !plane.is_empty();
        }
        any
    }

    /// Finds the parts with water that are not far, from the lists of the planes, which may have changed since
    /// [`Self::find`].
    pub(crate) fn find_near(&mut self, planes: &[Plane], slab: SlabRows) {
        let all = self.hulls.chunks_exact(slab.rows).zip(planes);
        self.near.resize_with(planes.len(), Plane::default);
        for (near, (hulls, plane)) in self.near.iter_mut().zip(all) {
            if plane.is_empty() && near.is_made() && near.is_empty() {
                continue;
            }
            near.set_spans(hulls.iter().enumerate().map(|(row, hull)| {
                let [first, end] = *hull;
                let inside = move |&[a, b]: &[u32; 2]| [a.max(first), b.min(end)];
                let parts = plane.spans(row).iter().map(inside);
                parts.filter(|[a, b]| a < b)
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the parts of the rows of planes.
    fn spans(planes: &[Plane], rows: usize) -> Vec<Vec<[u32; 2]>> {
        let rows = planes
            .iter()
            .flat_map(|plane| (0..rows).map(|row| plane.spans(row)));
        rows.map(<[_]>::to_vec).collect()
    }

    #[test]
    fn parts_near_the_surface_are_not_far() {
        // One row of 100 cells in each plane; the surface is at cell 50 in the planes from 10 on.
        let slab = |along: bool| SlabRows {
            rows: 1,
            cells: 100,
            first: 1000,
            plane: 200,
            row: 200,
            periodic: [false, along],
        };
        let planes: Vec<Plane> = (0..20_u32)
            .map(|n| {
                let wet = if n < 10 { [0, 100] } else { [0, 56] };
                let mut plane = Plane::of_spans([&[wet][..]].into_iter());
                plane
                    .surface
                    .extend((n >= 10).then_some(1000 + 200 * n + 50));
                plane
            })
            .collect();
        let mut depths = Depths::default();
        assert!(depths.find(&planes, slab(false), |n| n != 5));
        depths.find_near(&planes, slab(false));
        let (far, near) = (spans(depths.far(), 1), spans(depths.near(), 1));
        for n in 0..20 {
            let expected = match n {
                3 | 4 | 6 => (vec![[0, 100]], vec![]),
                // The surface is in cell 50, and the cells near it begin at 47.
                7..17 => (vec![[0, 32]], vec![[32, if n < 10 { 100 } else { 56 }]]),
                _ => (vec![], vec![[0, if n < 10 { 100 } else { 56 }]]),
            };
            assert_eq!((far[n].clone(), near[n].clone()), expected, "plane {n}");
        }
        assert!(depths.find(&planes, slab(true), |_| true));
        let far = spans(depths.far(), 1);
        assert!((3..7).all(|n| far[n] == [[0, 100]]));
        assert!((7..17).all(|n| far[n].is_empty()));
    }

    #[test]
    fn rows_near_the_surface_are_not_far() {
        // The surface is in row 1 of 16.
        let row = |at: usize| if at == 0 { &[][..] } else { &[[0, 32]][..] };
        let planes: Vec<Plane> = (0..7_u32)
            .map(|n| {
                let mut plane = Plane::of_spans((0..16).map(row));
                plane.surface.extend((0..32).map(|k| 640 * n + 40 + k));
                plane
            })
            .collect();
        for across in [false, true] {
            let slab = SlabRows {
                rows: 16,
                cells: 32,
                first: 0,
                plane: 640,
                row: 40,
                periodic: [across, false],
            };
            let mut depths = Depths::default();
            assert!(depths.find(&planes, slab, |_| true));
            let far = spans(depths.far(), 16);
            for (at, far) in far.iter().enumerate() {
                let (plane, row) = (at / 16, at % 16);
                let is_far = plane == 3 && row > 4 && (!across || row < 13);
                assert_eq!(!far.is_empty(), is_far, "plane {plane}, row {row}");
            }
        }
    }
}
