//! Surface in an interface cell: a plane, the traction on the water below it, and the populations on the links that
//! cross it.
//!
//! The only force at the surface is the pressure of the gas, so that the traction P = p n - n·σ (σ the viscous
//! stress), relative to that pressure, is zero there. The liquid cell inside has P from its density and from its
//! non-equilibrium second moment; P is extrapolated linearly from that cell through the surface to the midpoint of
//! each link. The pressure alone would neglect the normal stress 2 ρ ν ∂u_n/∂n, whose work is half of the damping
//! of a wave: its share in the pressure half-way is (½ - q)/(1 + q), with q the distance of the surface from the
//! centre, on any grid. The even part of the populations of a link at its middle is then, with f_i + f_ī = 2 f⁺,
//!
//! f⁺ = w_i (ρ_w + ρ (9/2 (c·u)² - 3/2 u²) + 9 (c·n)(c·Π_t)),
//!
//! with ρ_w the density of the normal part, and Π_t the tangential part of P there (S. Bogner, R. Ammer, U. Rüde, J.
//! Comput. Phys. 297 (2015) 1, for links that end at the surface). Over the links of an even surface the
//! momentum that passes is P.
//!
//! The surface is that at the middle of the step, like the populations that pass a link during it: a delay of half
//! a step would amplify a wave of frequency ω at the rate ω²/4.

use super::carrier::{Carrier, dot, inertia};
use super::cells::Cells;
use super::cut;
use super::ghosts::Around;
use super::jump::Jump;
use super::kind::{HELD, LIQUID, SOLID};
use super::moments::{Moments, across};
use super::stencil::{Numbers, Stencil};
use crate::lanes::Stored;
use crate::lattice::{Lattice, unroll};
use crate::populations::Populations;

/// Maximum ratio for the extrapolation of the traction inside beyond the surface: above it sound grows.
const MAX_RATIO: f64 = 0.5;

/// Maximum acceleration in the pressure bound, relative to the body force: that of a free fall.
const MAX_ACCELERATION: f64 = 1.0;

/// Largest wave number of a capillary wave in the pressure bound.
const MAX_WAVE_NUMBER: f64 = 0.5;

/// Minimum component against the normal, relative to its length, of a link from an interface cell to the liquid
/// cell inside.
const INWARD: f64 = 0.7;

/// Minimum distance of the surface from the liquid cell inside for the extrapolation of the traction.
const MIN_REACH: f64 = 0.25;

/// Maximum change of velocity per cell and step at which the liquid cell inside carries an interface cell.
const SMOOTH: f64 = 3e-3;

/// Surface in an interface cell at the middle of a step.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Facet {
    /// Velocity of the water.
    pub(super) velocity: [f64; 3],
    /// Normal towards the gas.
    pub(super) normal: [f64; 3],
    /// Distance of the surface from the centre of the cell along the normal.
    pub(super) distance: f64,
    /// Gradient of the density along the normal in water at rest.
    at_rest: f64,
    /// Maximum density of the dynamic part inside.
    most: f64,
    /// Direction to the liquid cell closest to the inward normal; 0 without one.
    pub(super) inward: u8,
    /// Density of the normal part of the traction in that liquid cell, less that of the tension.
    pub(super) inside: f64,
    /// Density in that liquid cell.
    pub(super) density_inside: f64,
    /// Tangential part of the traction in that liquid cell.
    traction: [f64; 3],
    /// Distance between the centres of that liquid cell and the interface cell, along the inward normal.
    inner: f64,
    /// `true` for a cell whose centre lies outside the water in a smooth flow: the liquid cell inside carries it.
    pub(super) carried: bool,
    /// Velocity of a carried cell, without the force.
    pub(super) given: [f64; 3],
}

impl Facet {
    /// Returns the density of the dynamic part of the normal traction in the liquid cell inside, for a density in
    /// that cell.
    #[inline(always)]
    fn excess(&self, inside: f64) -> f64 {
        let excess = inside + (self.distance + self.inner) * self.at_rest;
        excess.clamp(-self.most, self.most)
    }

    /// Returns f⁺/w_i at the midpoint of a link to gas along `c`, for a density of the normal part of the traction
    /// inside.
    ///
    /// The dynamic part is bounded by the pressure of an acceleration, because sound of impacts grows at low viscosity.
    #[inline(always)]
    pub(super) fn even(&self, c: [f64; 3], inside: f64) -> f64 {
        if self.inward == 0 {
            return inertia(c, 0.0, self.velocity);
        }
        let up = dot(c, self.normal);
        let beyond = 0.5 * up - self.distance;
        let reach = (self.inner + self.distance).max(MIN_REACH);
        let ratio = (beyond / reach).clamp(-MAX_RATIO, MAX_RATIO);
        let density = beyond * self.at_rest - ratio * self.excess(inside);
        let shear = 9.0 * ratio * up * dot(c, self.traction);
        density + inertia(c, density, self.velocity) - shear
    }

    /// Returns the data of a carried cell for the links of its neighbours, with the density of the tension.
    pub(super) fn carrier(&self, capillary: f64) -> Carrier {
        let reach = self.inner + self.distance;
        Carrier {
            normal: self.normal,
            distance: self.distance,
            slope: self.at_rest - self.excess(self.inside) / reach,
            traction: self.traction.map(|t| t / reach),
            velocity: self.velocity,
            capillary,
        }
    }

    /// Returns the density of a carried cell at its centre, without that of the tension.
    pub(super) fn density(&self) -> f64 {
        -self.distance * self.carrier(0.0).slope
    }
}

/// Returns the normal from the gradient of the fill levels around a cell, with the weights of the velocity set.
#[inline(always)]
pub(super) fn normal<L: Lattice<Q>, const Q: usize>(
    cells: &Cells,
    stencil: &Stencil<L, Q>,
    (cell, kinds): (usize, &[u8; Q]),
) -> Option<[f64; 3]> {
    let mut normal = [0.0; 3];
    unroll!(populations i < Q => {
        if i > 0 {
            let level = if matches!(kinds[i], SOLID | HELD) {
                cells.mirrored_level(cell, L::C[i])
            } else {
                cells.fill[stencil.neighbour(cell, i)].clamp(0.0, 1.0)
            };
            let part = L::W[i] * level;
            unroll!(axes a < 3 => {
                match L::C[i][a] {
                    1 => normal[a] -= part,
                    -1 => normal[a] += part,
                    _ => {}
                }
            });
        }
    });
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    (length > 0.0).then(|| normal.map(|n| n / length))
}

/// Returns the direction to the liquid neighbour closest to the inward normal; 0 if none is close enough.
#[inline(always)]
fn inward<L: Lattice<Q>, const Q: usize>(kinds: &[u8; Q], normal: [f64; 3]) -> usize {
    let mut best = (INWARD, 0);
    for i in 1..Q {
        if kinds[i] == LIQUID {
            let down = -dot(Stencil::<L, Q>::C[i], normal) / Stencil::<L, Q>::LENGTHS[i];
            if down > best.0 {
                best = (down, i);
            }
        }
    }
    best.1
}

/// Returns the facet of an interface cell; `half_force` is F/2, and `viscosity` that of the water. `capillary` is the
/// density of the tension, and `least` that of its smallest waves. No thread writes the numbers.
#[inline(always)]
pub(super) fn find<L: Lattice<Q>, S: Stored, J: Jump, const Q: usize>(
    (cells, around): (&Cells, &Around),
    (populations, numbers, stencil): (&Populations<S>, &Numbers<S>, &Stencil<L, Q>),
    (half_force, viscosity): ([f64; 3], f64),
    cell: usize,
    (_, [capillary, least]): (J, [f64; 2]),
) -> Facet {
    // SAFETY: an interface cell of the slab, whose numbers are only read.
    let (density, momentum) = unsafe { stencil.momentum(numbers, cell) };
    let mut facet = Facet {
        velocity: std::array::from_fn(|a| (half_force[a] + momentum[a]) / (1.0 + density)),
        ..Facet::default()
    };
    let kinds = stencil.kinds(cells, cell);
    let Some(normal) = normal(cells, stencil, (cell, &kinds)) else {
        return facet;
    };
    facet.normal = normal;
    let i = inward::<L, Q>(&kinds, normal);
    if i == 0 {
        return facet;
    }
    let c = Stencil::<L, Q>::C[i];
    let along = |v: [f64; 3]| v[0] * normal[0] + v[1] * normal[1] + v[2] * normal[2];
    facet.inner = -dot(c, normal);
    facet.distance = cut::distance(cells.fill[cell], normal) + 0.5 * along(facet.velocity);
    facet.at_rest = 6.0 * along(half_force);
    let weight = 6.0 * half_force.iter().map(|f| f * f).sum::<f64>().sqrt();
    facet.most = MAX_ACCELERATION * weight * (0.5 + facet.inner);
    if J::ACTS {
        let waves = MAX_WAVE_NUMBER * capillary.abs() + least;
        facet.most += MAX_ACCELERATION * waves * (0.5 + facet.inner);
    }
    // SAFETY: as above.
    let of_cell = |cell: usize| unsafe { stencil.moments(numbers, cell) };
    let found = around.moments_along(populations, (cell, i), of_cell);
    facet.inward = u8::try_from(i).unwrap_or(0);
    // Π = -σ = (1 - 1/(2τ)) times the non-equilibrium second moment.
    let relaxation_time = 3.0 * viscosity + 0.5;
    let factor = 3.0 * viscosity / relaxation_time;
    let stress = across(&found, normal).map(|t| factor * t);
    let pressed = along(stress);
    facet.density_inside = found[0];
    facet.inside = found[0] + 3.0 * pressed;
    if J::ACTS {
        facet.inside -= capillary;
    }
    facet.traction = std::array::from_fn(|a| stress[a] - pressed * normal[a]);
    carry(
        &mut facet,
        (momentum.map(|m| m / (1.0 + density)), &found),
        c,
        relaxation_time,
    );
    // Cells with a body take part in the flow with their own populations.
    facet.carried &= !cells.meets_body(cell);
    facet
}

/// Decides if the liquid cell inside carries a cell, and computes the velocity.
///
/// The velocity is extrapolated with the rate of strain inside, from its second moment, as in an irrotational flow.
fn carry(facet: &mut Facet, (own, found): ([f64; 3], &Moments), c: [f64; 3], relaxation_time: f64) {
    let inner = [found[1], found[2], found[3]];
    let excess = facet.inside + (facet.distance + facet.inner) * facet.at_rest;
    let change: [f64; 3] = std::array::from_fn(|a| own[a] - inner[a]);
    let smooth = change.iter().map(|u| u * u).sum::<f64>() <= SMOOTH * SMOOTH
        && excess.abs() <= facet.most
        && facet.distance + facet.inner >= MIN_REACH;
    facet.carried = facet.distance < 0.0 && smooth;
    if facet.carried {
        let factor = -1.5 / (relaxation_time * (1.0 + found[0]));
        let strained = across(found, c.map(|c| -c));
        facet.given = std::array::from_fn(|a| inner[a] + factor * strained[a]);
    }
}
