//! A plane section through a 3-D scene: the fluid of the layer of cells in the plane, circles of the grains, and
//! lines of the faces. The result is a 2-D scene in the other two axes, x before y before z.

use super::{Grains, Water};
use base::number::{real, whole};
use std::str::FromStr;

/// End points of the intersection line of a face, in the axes of the section.
pub(super) type Line = [[f64; 2]; 2];

/// Plane of a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Axis normal to the plane: 0, 1 or 2.
    pub axis: usize,
    /// Coordinate of the plane along its axis \[m\].
    pub at: f64,
}

impl FromStr for Section {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a plane; write for example y=0.08");
        let (axis, at) = text.split_once('=').ok_or_else(wrong)?;
        let axis = ["x", "y", "z"].iter().position(|name| *name == axis.trim());
        let at: f64 = at.trim().parse().map_err(|_| wrong())?;
        match axis {
            Some(axis) if at.is_finite() => Ok(Self { axis, at }),
            _ => Err(wrong()),
        }
    }
}

impl Section {
    /// Returns the plane normal to y through the middle of the water.
    pub(super) fn middle(water: &Water) -> Self {
        Self {
            axis: 1,
            at: water.origin[1] + 0.5 * real(water.cells[1]) * water.spacing[1],
        }
    }

    /// Returns the intersection line of the plane with a convex face, directed by the orientation of the face;
    /// `None` without intersection. Corners in the plane count as above it.
    pub(super) fn line(self, corners: &[[f64; 3]]) -> Option<Line> {
        let [right, up] = self.plane();
        let height = |p: &[f64; 3]| p[self.axis] - self.at;
        let mut ends = [None; 2];
        for (k, a) in corners.iter().enumerate() {
            let b = &corners[(k + 1) % corners.len()];
            let (from, to) = (height(a), height(b));
            if (from >= 0.0) == (to >= 0.0) {
                continue;
            }
            let t = from / (from - to);
            let at = [right, up].map(|axis| a[axis] + t * (b[axis] - a[axis]));
            ends[usize::from(from >= 0.0)] = Some(at);
        }
        Some([ends[0]?, ends[1]?])
    }

    /// Returns the axes to the right and upwards.
    pub(super) fn plane(self) -> [usize; 2] {
        match self.axis {
            0 => [1, 2],
            1 => [0, 2],
            _ => [0, 1],
        }
    }

    /// Returns the layer of water at the plane; `None` if the plane is outside the grid.
    pub(super) fn water(self, water: &Water) -> Option<Water> {
        let depth = (self.at - water.origin[self.axis]) / water.spacing[self.axis];
        if !(0.0..=real(water.cells[self.axis])).contains(&depth) {
            return None;
        }
        let layer = whole(depth).min(water.cells[self.axis] - 1);
        let [right, up] = self.plane();
        let place = |k: usize, l: usize| {
            let mut cell = [0; 3];
            cell[self.axis] = layer;
            cell[right] = k;
            cell[up] = l;
            (cell[2] * water.cells[1] + cell[1]) * water.cells[0] + cell[0]
        };
        let (width, height) = (water.cells[right], water.cells[up]);
        let places = || (0..height).flat_map(|l| (0..width).map(move |k| place(k, l)));
        Some(Water {
            cells: [width, height, 1],
            origin: [water.origin[right], water.origin[up], 0.0],
            spacing: [water.spacing[right], water.spacing[up], 1.0],
            values: places().map(|n| water.values[n]).collect(),
            solid: places().map(|n| water.solid[n]).collect(),
            flow: water.flow.as_ref().map(|flow| {
                let turned = |v: [f64; 3]| [v[right], v[up], v[self.axis]];
                places().map(|n| turned(flow[n])).collect()
            }),
            units: water.units.clone(),
        })
    }

    /// Replaces the grains by their intersection circles with the plane.
    pub(super) fn grains(self, grains: &mut Grains) {
        let [right, up] = self.plane();
        let away = |p: &[f64; 3]| p[self.axis] - self.at;
        let cut: Vec<bool> = (grains.positions.iter().zip(&grains.radii))
            .map(|(p, r)| away(p).abs() < *r)
            .collect();
        grains.retain(|k| cut[k]);
        for (p, r) in grains.positions.iter_mut().zip(&mut grains.radii) {
            *r = (*r * *r - away(p).powi(2)).sqrt();
            *p = [p[right], p[up], 0.0];
        }
        for v in grains
            .arrows
            .iter_mut()
            .flat_map(|arrows| &mut arrows.vectors)
        {
            *v = [v[right], v[up], 0.0];
        }
        grains.flat = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_is_read_from_its_axis_and_place() {
        let section = |text: &str| text.parse::<Section>();
        assert_eq!(section("y=0.08"), Ok(Section { axis: 1, at: 0.08 }));
        assert_eq!(section(" z = -1e-3"), Ok(Section { axis: 2, at: -1e-3 }));
        for wrong in ["0.08", "w=1", "y=", "y=inf"] {
            assert!(section(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_section_holds_the_layer_that_it_crosses() {
        // Two by three by four cells; each holds 100 x + 10 y + z.
        let mut values = Vec::new();
        for z in 0..4 {
            for y in 0..3 {
                values.extend((0..2).map(|x| f64::from(100 * x + 10 * y + z)));
            }
        }
        let flow = values.iter().map(|v| [*v, -1.0, 7.0]).collect();
        let water = Water {
            cells: [2, 3, 4],
            origin: [0.0, 1.0, 0.0],
            spacing: [0.5, 0.5, 0.5],
            solid: vec![false; values.len()],
            values,
            flow: Some(flow),
            units: String::new(),
        };
        let cut = Section { axis: 1, at: 1.7 }.water(&water).unwrap();
        assert_eq!(cut.cells, [2, 4, 1]);
        assert_eq!(
            cut.values,
            [10.0, 110.0, 11.0, 111.0, 12.0, 112.0, 13.0, 113.0]
        );
        assert_eq!(cut.flow.unwrap()[1], [110.0, 7.0, -1.0]);
        assert!(Section { axis: 1, at: 0.9 }.water(&water).is_none());
        assert_eq!(Section::middle(&water), Section { axis: 1, at: 1.75 });
    }
}
