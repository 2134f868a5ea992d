//! Part of a facet for other cells: the traction of the water on the links of a carried cell ([`super::facet`]).

use base::vector::dot;

/// Number of values of a facet in a message.
pub(super) const NUMBERS: usize = 12;

/// Part of a facet for the links of its neighbours, with lengths relative to the distance from the surface.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Carrier {
    pub(super) normal: [f64; 3],
    pub(super) distance: f64,
    pub(super) slope: f64,
    pub(super) traction: [f64; 3],
    pub(super) velocity: [f64; 3],
    /// Density that the surface tension adds.
    pub(super) capillary: f64,
}

/// Returns the inertial part of f⁺/w_i for a density and a velocity.
#[inline(always)]
pub(super) fn inertia(c: [f64; 3], density: f64, u: [f64; 3]) -> f64 {
    let cu = dot(c, u);
    let uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    (1.0 + density) * (4.5 * cu * cu - 1.5 * uu)
}

impl Carrier {
    /// Returns f⁺/w_i at the midpoint of a link that leaves the cell of the facet along `c`, without the tension.
    #[inline(always)]
    pub(super) fn even(&self, c: [f64; 3]) -> f64 {
        let up = dot(c, self.normal);
        let beyond = 0.5 * up - self.distance;
        let density = beyond * self.slope;
        let shear = 9.0 * beyond * up * dot(c, self.traction);
        density + inertia(c, density, self.velocity) - shear
    }

    /// Returns the values of a message.
    pub(super) fn numbers(&self) -> [f64; NUMBERS] {
        let [a, b, c] = self.normal;
        let [d, e, f] = self.traction;
        let [u, v, w] = self.velocity;
        [
            a,
            b,
            c,
            self.distance,
            self.slope,
            d,
            e,
            f,
            u,
            v,
            w,
            self.capillary,
        ]
    }

    /// Returns the carrier from the values of a message, reflected at symmetry planes with these signs; `None` for
    /// a cell that is not carried.
    pub(super) fn received(numbers: &[f64; NUMBERS], sign: [f64; 3]) -> Option<Self> {
        let [a, b, c, distance, slope, d, e, f, u, v, w, capillary] = *numbers;
        let turned = |v: [f64; 3]| std::array::from_fn(|axis| sign[axis] * v[axis]);
        // The normal of a carried cell has the length 1.
        (a * a + b * b + c * c > 0.0).then(|| Self {
            normal: turned([a, b, c]),
            distance,
            slope,
            traction: turned([d, e, f]),
            velocity: turned([u, v, w]),
            capillary,
        })
    }
}
