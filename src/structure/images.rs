//! Solid with its images in a periodic domain.

use super::solid::merge_parts;
use super::{Facets, Frame, Point, Solid, minus, norm, plus, times};
use std::sync::Arc;

/// Number of periods beyond a point within which the images of an inclined half-space are looked at.
const PERIODS: i32 = 4;

/// Solid with those of its periodic images that reach into the domain.
///
/// A half-space whose normal has a component along a periodic axis does not equal its images. Its part in the domain is
/// repeated, so that there is a step at the periodic face.
#[derive(Clone, Debug)]
pub struct Images {
    solid: Arc<dyn Solid>,
    /// Displacement of each image from the solid \[m\].
    shifts: Vec<Point>,
    frame: Frame,
    periodic: [bool; 3],
    /// `true` for each periodic axis across which a half-space has a step.
    stepped: [bool; 3],
}

impl Images {
    /// Returns the images that come closer than `margin` \[m\] to the domain. A solid that spans the domain along a
    /// periodic axis is infinite along this axis.
    #[must_use]
    pub fn new(solid: Arc<dyn Solid>, frame: Frame, periodic: [bool; 3], margin: f64) -> Self {
        let [low, high] = solid.extent();
        let mut shifts = vec![[0.0; 3]];
        for axis in (0..frame.dimension).filter(|&a| periodic[a]) {
            let length = frame.size[axis];
            // An infinite solid needs no image along the axis.
            if !(low[axis].is_finite() && high[axis].is_finite()) {
                continue;
            }
            let alone = std::mem::take(&mut shifts);
            for one in alone {
                for by in [-1.0, 0.0, 1.0] {
                    let mut shift = one;
                    shift[axis] += by * length;
                    shifts.push(shift);
                }
            }
        }
        let reaches = |shift: &Point| {
            (0..frame.dimension)
                .all(|a| high[a] + shift[a] > -margin && low[a] + shift[a] < frame.size[a] + margin)
        };
        shifts.retain(reaches);
        let plane = solid.plane();
        let stepped = std::array::from_fn(|a| {
            let leans = plane.is_some_and(|(_, normal)| normal[a].abs() > 0.0);
            leans && a < frame.dimension && periodic[a]
        });
        Self {
            solid,
            shifts,
            frame,
            periodic,
            stepped,
        }
    }

    /// Returns `true` if no image is near the domain.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.shifts.is_empty()
    }

    /// Returns the solid itself.
    #[must_use]
    pub fn solid(&self) -> &dyn Solid {
        &*self.solid
    }

    /// Returns the distance to the nearest image: see [`Solid::distance`].
    #[must_use]
    pub fn distance(&self, at: Point) -> f64 {
        if self.stepped.contains(&true) && !self.is_empty() {
            return self.distance_from_steps(at);
        }
        let images = self.shifts.iter();
        images
            .map(|shift| self.solid.distance(minus(at, *shift)))
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns [`Self::distance`] for a half-space that is repeated with steps: the distance from the nearest part of
    /// any period on the other side of the surface.
    fn distance_from_steps(&self, at: Point) -> f64 {
        let mut at = at;
        let periods = |a: usize| if self.stepped[a] { PERIODS } else { 0 };
        let mut bound = f64::INFINITY;
        for a in (0..3).filter(|&a| self.stepped[a]) {
            let length = self.frame.size[a];
            // A point on the upper face belongs to this period.
            if !(0.0..=length).contains(&at[a]) {
                at[a] -= length * (at[a] / length).floor();
            }
            bound = bound.min(f64::from(PERIODS) * length);
        }
        let own = self.solid.distance(at);
        let side = if own < 0.0 { -1.0 } else { 1.0 };
        let mut least = bound.min(side * own);
        let range = |a: usize| -periods(a)..=periods(a);
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    let period = [x, y, z];
                    let shift = std::array::from_fn(|a| f64::from(period[a]) * self.frame.size[a]);
                    let seen = minus(at, shift);
                    let beyond: Point = std::array::from_fn(|a| match period[a] {
                        0 => 0.0,
                        _ => (-seen[a]).max(seen[a] - self.frame.size[a]),
                    });
                    let there = side * self.solid.distance(seen);
                    least = least.min(there.max(norm(beyond)));
                }
            }
        }
        side * least
    }

    /// Finds the chords of all images, like [`Solid::chords`]; `found` is cleared first.
    pub fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        found.clear();
        if self.stepped.contains(&true) && !self.is_empty() {
            self.chords_of_steps(from, along, found);
            return;
        }
        if let [shift] = self.shifts[..] {
            self.solid.chords(minus(from, shift), along, found);
            return;
        }
        let mut one = Vec::new();
        for shift in &self.shifts {
            one.clear();
            self.solid.chords(minus(from, *shift), along, &mut one);
            found.append(&mut one);
        }
        merge_parts(found);
    }

    /// Finds [`Self::chords`] of a half-space that is repeated with steps: those of the parts of the line in each
    /// period.
    fn chords_of_steps(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        let mut ends = vec![0.0, 1.0];
        for a in (0..3).filter(|&a| self.stepped[a]) {
            let length = self.frame.size[a];
            let [low, high] = [from[a], from[a] + along[a]].map(|x| x / length);
            let (low, high) = (low.min(high), low.max(high));
            let mut face = low.floor() + 1.0;
            while face < high {
                ends.push((face * length - from[a]) / along[a]);
                face += 1.0;
            }
        }
        ends.retain(|t| (0.0..=1.0).contains(t));
        ends.sort_by(f64::total_cmp);
        let mut one = Vec::new();
        for pair in ends.windows(2) {
            let [first, last] = [pair[0], pair[1]];
            let middle = plus(from, times(along, 0.5 * (first + last)));
            let shift = std::array::from_fn(|a| {
                let length = self.frame.size[a];
                if self.stepped[a] {
                    length * (middle[a] / length).floor()
                } else {
                    0.0
                }
            });
            let start = minus(plus(from, times(along, first)), shift);
            one.clear();
            self.solid
                .chords(start, times(along, last - first), &mut one);
            let of_line = |t: f64| first * (1.0 - t) + last * t;
            found.extend(one.iter().map(|part| part.map(of_line)));
        }
        merge_parts(found);
    }

    /// Returns the bounding boxes of the images \[m\].
    pub fn extents(&self) -> impl Iterator<Item = [Point; 2]> + '_ {
        let [low, high] = self.solid.extent();
        self.shifts
            .iter()
            .map(move |shift| [plus(low, *shift), plus(high, *shift)])
    }

    /// Returns the surface of the solid without its images. In 2-D it extends along z from -`depth` to `depth`,
    /// without ends. For a box or prism that touches or overlaps its image it is the part within one period.
    #[must_use]
    pub fn facets(&self, tolerance: f64, depth: f64) -> Facets {
        let mut solid = Arc::clone(&self.solid);
        let [low, high] = solid.extent();
        for axis in (0..self.frame.dimension).filter(|&a| self.periodic[a]) {
            let period = self.frame.size[axis];
            if high[axis] - low[axis] >= period * (1.0 - 1e-9) {
                solid = solid.length(axis, [0.0, period]).unwrap_or(solid);
            }
        }
        if self.frame.dimension == 2 {
            Facets::along_z(&solid.outline(tolerance), depth)
        } else {
            solid.facets(tolerance)
        }
    }

    /// Returns the maximum distance \[m\] of [`Self::facets`] for a tolerance \[m\] from the true surface.
    #[must_use]
    pub fn deviation(&self, tolerance: f64) -> f64 {
        self.solid.deviation(tolerance)
    }

    /// Returns the axis along which the solid is longer than the period although [`Self::facets`] cannot be cut to
    /// one period, so that it may overlap its images.
    #[must_use]
    pub fn may_overlap(&self) -> Option<usize> {
        let [low, high] = self.solid.extent();
        (0..self.frame.dimension)
            .filter(|&a| self.periodic[a])
            .find(|&axis| {
                let period = self.frame.size[axis];
                high[axis] - low[axis] > period * (1.0 + 1e-6)
                    && self.solid.length(axis, [0.0, period]).is_none()
            })
    }

    /// Returns the surfaces of all images for drawing; in 2-D their areas.
    #[must_use]
    pub fn drawn(&self, tolerance: f64) -> Facets {
        let one = if self.frame.dimension == 2 {
            Facets::area(&self.solid.outline(tolerance))
        } else {
            self.solid.facets(tolerance)
        };
        let mut all = Facets::default();
        for shift in &self.shifts {
            all.add(&one, *shift);
        }
        all
    }
}
