//! Convex polygons in the plane of a joint: clipping, area, centroid, and integrals of linear functions.

use nalgebra::Vector2;

/// Length of an edge, divided by the size of the polygon, below which it is omitted.
const SHORT: f64 = 1e-10;

/// Convex polygon with its corners counter-clockwise; each edge has a tag of its own. Lengths are in m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polygon<T> {
    /// Corners \[m\] with the tag of the edge that begins at each.
    corners: Vec<(Vector2<f64>, T)>,
}

impl<T: Copy> Polygon<T> {
    /// Returns a polygon with these corners \[m\], counter-clockwise, and the tags of the edges that begin at them.
    #[must_use]
    pub fn new(corners: Vec<(Vector2<f64>, T)>) -> Self {
        Self { corners }
    }

    /// Returns the corners \[m\] with the tags of the edges that begin at them.
    #[must_use]
    pub fn corners(&self) -> &[(Vector2<f64>, T)] {
        &self.corners
    }

    /// Returns the edges: both ends \[m\] and the tag.
    pub fn edges(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>, T)> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        let edges = self.corners.iter().zip(next);
        edges.map(|(&(from, tag), &(to, _))| (from, to, tag))
    }

    /// Returns `true` if the polygon has no corners.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// Returns the largest distance of a corner from the origin \[m\].
    #[must_use]
    pub fn reach(&self) -> f64 {
        let corners = self.corners.iter();
        corners.fold(0.0, |most, (corner, _)| most.max(corner.norm()))
    }

    /// Returns the largest extent along an axis \[m\].
    #[must_use]
    pub fn size(&self) -> f64 {
        let [low, high] = self.bounds();
        (high - low).amax()
    }

    /// Returns the lower and the upper corner \[m\] of the bounding box; zeros for an empty polygon.
    #[must_use]
    pub fn bounds(&self) -> [Vector2<f64>; 2] {
        let mut corners = self.corners.iter().map(|(corner, _)| *corner);
        let Some(first) = corners.next() else {
            return [Vector2::zeros(); 2];
        };
        corners.fold([first; 2], |[low, high], corner| {
            [low.inf(&corner), high.sup(&corner)]
        })
    }

    /// Cuts off the part with `normal . x > offset`; the new edge has this tag.
    pub fn clip(&mut self, normal: Vector2<f64>, offset: f64, tag: T) {
        let height = |corner: &Vector2<f64>| normal.dot(corner) - offset;
        if self.corners.iter().all(|(corner, _)| height(corner) <= 0.0) {
            return;
        }
        let mut kept = Vec::with_capacity(self.corners.len() + 1);
        for (from, to, own) in self.edges() {
            let (start, end) = (height(&from), height(&to));
            let crossing = || from + (to - from) * (start / (start - end));
            match (start <= 0.0, end <= 0.0) {
                (true, true) => kept.push((from, own)),
                (true, false) => {
                    kept.push((from, own));
                    // A corner on the line itself is not duplicated.
                    if start < 0.0 {
                        kept.push((crossing(), tag));
                    } else if let Some(last) = kept.last_mut() {
                        last.1 = tag;
                    }
                }
                (false, true) => {
                    if end < 0.0 {
                        kept.push((crossing(), own));
                    }
                }
                (false, false) => {}
            }
        }
        self.corners = kept;
        self.drop_short_edges();
    }

    /// Removes edges created by rounding, and all corners of a polygon without area.
    fn drop_short_edges(&mut self) {
        let least = SHORT * self.size();
        let mut k = 0;
        while k < self.corners.len() && self.corners.len() > 2 {
            let next = (k + 1) % self.corners.len();
            if (self.corners[next].0 - self.corners[k].0).norm() <= least {
                self.corners.remove(k);
            } else {
                k += 1;
            }
        }
        if self.corners.len() < 3 {
            self.corners.clear();
        }
    }

    /// Returns the area \[m²\] and the centroid \[m\]; the first corner for an area of zero.
    #[must_use]
    pub fn area_and_centroid(&self) -> (f64, Vector2<f64>) {
        let Some(&(origin, _)) = self.corners.first() else {
            return (0.0, Vector2::zeros());
        };
        let (mut area, mut first) = (0.0, Vector2::zeros());
        for (from, to, _) in self.edges() {
            let (a, b) = (from - origin, to - origin);
            let triangle = 0.5 * a.perp(&b);
            area += triangle;
            first += (a + b) * (triangle / 3.0);
        }
        if area > 0.0 {
            (area, origin + first / area)
        } else {
            (0.0, origin)
        }
    }

    /// Returns the integral over the polygon of the maximum of a linear function `plane` and the number `least`
    /// \[m³ for lengths\].
    #[must_use]
    pub fn integral_above(&self, plane: &LinearField, least: f64) -> f64 {
        let (area, centroid) = self.area_and_centroid();
        let heights = self.corners.iter().map(|(corner, _)| plane.value(corner));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
            (low.min(h), high.max(h))
        });
        if low >= least {
            return area * plane.value(&centroid);
        }
        if high <= least || self.corners.is_empty() {
            return area * least;
        }
        // Part of the polygon in which the function is larger.
        let mut open = self.clone();
        let tag = self.corners[0].1;
        open.clip(-plane.slope, plane.constant - least, tag);
        let (part, centroid) = open.area_and_centroid();
        part * plane.value(&centroid) + (area - part) * least
    }
}

/// Linear function of the position in the plane of a joint: `constant + slope . x`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinearField {
    /// Value at the origin.
    pub constant: f64,
    /// Gradient of the field.
    pub slope: Vector2<f64>,
}

impl LinearField {
    /// Returns the value at a point \[m\].
    #[must_use]
    pub fn value(&self, at: &Vector2<f64>) -> f64 {
        self.constant + self.slope.dot(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Polygon<usize> {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let corners = corners.iter().enumerate();
        Polygon::new(
            corners
                .map(|(k, c)| (Vector2::new(c[0], c[1]), k))
                .collect(),
        )
    }

    #[test]
    fn a_cut_square_keeps_the_tags_of_its_edges() {
        let mut cut = square();
        cut.clip(Vector2::new(1.0, 0.0), 0.5, 9);
        let (area, centroid) = cut.area_and_centroid();
        assert!((area - 1.0).abs() < 1e-15);
        assert!((centroid - Vector2::new(0.25, 1.0)).norm() < 1e-15);
        let tags: Vec<usize> = cut.edges().map(|(_, _, tag)| tag).collect();
        assert_eq!(tags, [0, 9, 2, 3]);
        cut.clip(Vector2::new(1.0, 0.0), -1.0, 9);
        assert!(cut.is_empty());
        // A line through two corners adds no edge of zero length.
        let mut half = square();
        half.clip(Vector2::new(1.0, 1.0), 2.0, 9);
        assert_eq!(half.corners().len(), 3);
        assert!((half.area_and_centroid().0 - 2.0).abs() < 1e-15);
    }

    #[test]
    fn the_integral_of_an_aperture_with_a_least_value_is_exact() {
        // max(x - 1, 1/2) over the square: a width of 1.5 at 1/2, then a trapezium from 1/2 to 1.
        let plane = LinearField {
            constant: -1.0,
            slope: Vector2::new(1.0, 0.0),
        };
        let exact = 2.0 * (1.5 * 0.5 + 0.5 * 0.75);
        assert!((square().integral_above(&plane, 0.5) - exact).abs() < 1e-14);
        assert!((square().integral_above(&plane, 3.0) - 12.0).abs() < 1e-14);
        assert!(square().integral_above(&plane, -5.0).abs() < 1e-14);
    }
}
