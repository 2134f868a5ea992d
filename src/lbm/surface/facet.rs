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
//! A film on a wall has no liquid cell inside; its density is that of water at rest ([`super::film`]). Without a wall
//! either, the pressure is that of the gas.
//!
//! The surface is that at the middle of the step, like the populations that pass a link during it: a delay of half
//! a step would amplify a wave of frequency ω at the rate ω²/4.

use super::carrier::{Carrier, inertia};
use super::cells::Cells;
use super::jump::Jump;
use super::kind::{HELD, SOLID};
use super::moments::{Moments, across};
use super::positions::{MOST, Values};
use super::stencil::Stencil;
use crate::lattice::{Lattice, unroll};
use base::vector::{dot, norm};

/// Maximum ratio for the extrapolation of the traction inside beyond the surface: above it sound grows.
const MAX_RATIO: f64 = 0.5;

/// Maximum acceleration in the pressure bound, relative to the body force: that of a free fall.
const MAX_ACCELERATION: f64 = 1.0;

/// Largest wave number of a capillary wave in the pressure bound.
const MAX_WAVE_NUMBER: f64 = 0.5;

/// Minimum distance of the surface from the liquid cell inside for the extrapolation of the traction.
const MIN_REACH: f64 = 0.25;

/// Maximum change of velocity per cell and step at which the liquid cell inside carries an interface cell.
const SMOOTH: f64 = 3e-3;

/// Surface in an interface cell at the middle of a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Facet {
    /// Velocity of the water.
    pub(super) velocity: [f64; 3],
    /// Normal towards the gas.
    pub(super) normal: [f64; 3],
    /// Distance of the surface from the centre of the cell along the normal.
    pub(super) distance: f64,
    /// Gradient of the density along the normal in water at rest; 0 for water without a liquid cell inside or a wall.
    pub(super) at_rest: f64,
    /// Maximum density of the dynamic part inside; 0 without a liquid cell inside.
    pub(super) most: f64,
    /// 1 with a liquid cell close to the inward normal, else 0: a number like the others, so that loops over cells
    /// are vectorised.
    pub(super) has_inside: f64,
    /// Density of the normal part of the traction in that liquid cell, less that of the tension.
    pub(super) inside: f64,
    /// Density in that liquid cell.
    pub(super) density_inside: f64,
    /// Tangential part of the traction in that liquid cell; 0 without one.
    pub(super) traction: [f64; 3],
    /// Distance between the centres of that liquid cell and the interface cell, along the inward normal.
    pub(super) inner: f64,
    /// 1 for a cell whose centre lies outside the water in a smooth flow, and for a cell next to the edge of a
    /// wall: the liquid cell inside carries it; else 0.
    pub(super) is_carried: f64,
    /// Velocity of a carried cell, without the force.
    pub(super) given: [f64; 3],
}

/// Returns a number between bounds, without the check of the bounds.
#[inline(always)]
pub(super) fn bounded(x: f64, least: f64, most: f64) -> f64 {
    let x = if x < least { least } else { x };
    if x > most { most } else { x }
}

impl Facet {
    /// Returns the density of the dynamic part of the normal traction in the liquid cell inside, for a density in
    /// that cell.
    #[inline(always)]
    fn excess(&self, inside: f64) -> f64 {
        let excess = inside + (self.distance + self.inner) * self.at_rest;
        bounded(excess, -self.most, self.most)
    }

    /// Returns the density of the normal part of the traction inside in the middle of the step, for the density in
    /// the liquid cell inside at its end: the mean of both ends, because a density that lags behind feeds sound.
    #[inline(always)]
    pub(super) fn in_middle(&self, now: f64) -> f64 {
        self.inside + 0.5 * (now - self.density_inside)
    }

    /// Returns f⁺/w_i at the midpoint of a link to gas along `c`, for a density of the normal part of the traction
    /// inside.
    ///
    /// The dynamic part is bounded by the pressure of an acceleration, because sound of impacts grows at low viscosity.
    #[inline(always)]
    pub(super) fn even(&self, c: [f64; 3], inside: f64) -> f64 {
        let up = dot(c, self.normal);
        let beyond = 0.5 * up - self.distance;
        let reach = (self.inner + self.distance).max(MIN_REACH);
        let ratio = bounded(beyond / reach, -MAX_RATIO, MAX_RATIO);
        let density = beyond * self.at_rest - ratio * self.excess(inside);
        let shear = 9.0 * ratio * up * dot(c, self.traction);
        density + inertia(c, density, self.velocity) - shear
    }

    /// Returns the data of a carried cell for the links of its neighbours, with the density of the tension.
    #[inline(always)]
    pub(super) fn carrier(&self, capillary: f64) -> Carrier {
        let reach = self.inner + self.distance;
        Carrier {
            normal: self.normal,
            distance: self.distance,
            slope: self.at_rest - self.excess(self.inside) / reach,
            traction: [
                self.traction[0] / reach,
                self.traction[1] / reach,
                self.traction[2] / reach,
            ],
            velocity: self.velocity,
            capillary,
        }
    }

    /// Returns the density of a carried cell at its centre, without that of the tension.
    #[inline(always)]
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
    let length = norm(normal);
    (length > 0.0).then(|| normal.map(|n| n / length))
}

/// Conditions of the water for its facets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    /// Half of the body force.
    pub(super) half_force: [f64; 3],
    /// Relaxation time of the viscosity of the water.
    pub(super) relaxation_time: f64,
    /// Part of the second moment that is stress: -1 times that of the non-equilibrium moment.
    factor: f64,
    /// Density of the body force over one cell.
    weight: f64,
    /// Density of the smallest capillary waves.
    of_waves: f64,
}

impl Drive {
    /// Returns the conditions; `of_waves` is the density of the smallest capillary waves.
    pub(super) fn new(half_force: [f64; 3], viscosity: f64, of_waves: f64) -> Self {
        // Π = -σ = (1 - 1/(2τ)) times the non-equilibrium second moment.
        let relaxation_time = 3.0 * viscosity + 0.5;
        Self {
            half_force,
            relaxation_time,
            factor: 3.0 * viscosity / relaxation_time,
            weight: 6.0 * norm(half_force),
            of_waves,
        }
    }
}

/// Known values of an interface cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// Density and momentum.
    pub(super) density: f64,
    pub(super) momentum: [f64; 3],
    /// Normal towards the gas, and the distance of a plane with this normal from the centre of the cell.
    pub(super) normal: [f64; 3],
    pub(super) distance: f64,
    /// Direction to the liquid cell inside, and 1 with such a cell, else 0.
    pub(super) c: [f64; 3],
    pub(super) has_inside: f64,
    /// Gradient of the density along the normal in a film; 0 in other cells.
    pub(super) film: f64,
    /// Moments of the liquid cell inside.
    pub(super) found: Moments,
    /// Density that the surface tension adds.
    pub(super) capillary: f64,
    /// 1 next to the edge of a wall, else 0.
    pub(super) at_edge: f64,
}

impl Facet {
    /// Returns the facet of an interface cell.
    #[inline(always)]
    pub(super) fn new<J: Jump>(drive: &Drive, known: &Known, _: J) -> Self {
        let &Known { normal, found, .. } = known;
        let half = drive.half_force;
        let along = |v: [f64; 3]| v[0] * normal[0] + v[1] * normal[1] + v[2] * normal[2];
        let mass = 1.0 + known.density;
        let [x, y, z] = known.momentum;
        let mut facet = Self {
            velocity: [
                (half[0] + x) / mass,
                (half[1] + y) / mass,
                (half[2] + z) / mass,
            ],
            normal,
            has_inside: known.has_inside,
            inner: -dot(known.c, normal),
            ..Self::default()
        };
        facet.distance = known.distance + 0.5 * along(facet.velocity);
        let inside = known.has_inside > 0.0;
        let of_inside = 6.0 * along(half);
        facet.at_rest = if inside { of_inside } else { known.film };
        facet.most = MAX_ACCELERATION * drive.weight * (0.5 + facet.inner);
        if J::ACTS {
            let waves = MAX_WAVE_NUMBER * known.capillary.abs() + drive.of_waves;
            facet.most += MAX_ACCELERATION * waves * (0.5 + facet.inner);
        }
        facet.most *= known.has_inside;
        let [a, b, c] = across(&found, normal);
        let stress = [drive.factor * a, drive.factor * b, drive.factor * c];
        let pressed = along(stress);
        facet.density_inside = found[0];
        facet.inside = found[0] + 3.0 * pressed;
        if J::ACTS {
            facet.inside -= known.capillary;
        }
        facet.traction = [
            known.has_inside * (stress[0] - pressed * normal[0]),
            known.has_inside * (stress[1] - pressed * normal[1]),
            known.has_inside * (stress[2] - pressed * normal[2]),
        ];
        facet.carry([x / mass, y / mass, z / mass], known, drive.relaxation_time);
        facet
    }

    /// Decides if the liquid cell inside carries a cell, and computes the velocity.
    ///
    /// Next to the edge of a wall it carries every cell ([`super::carried`]).
    ///
    /// The velocity is extrapolated with the rate of strain inside, from its second moment, as in an irrotational flow.
    #[inline(always)]
    fn carry(&mut self, own: [f64; 3], known: &Known, relaxation_time: f64) {
        let found = &known.found;
        let inner = [found[1], found[2], found[3]];
        let excess = self.inside + (self.distance + self.inner) * self.at_rest;
        let change = [own[0] - inner[0], own[1] - inner[1], own[2] - inner[2]];
        let squares = change[0] * change[0] + change[1] * change[1] + change[2] * change[2];
        let smooth = (squares <= SMOOTH * SMOOTH) & (excess.abs() <= self.most);
        let carried = (self.has_inside > 0.0)
            & (self.distance + self.inner >= MIN_REACH)
            & (((self.distance < 0.0) & smooth) | (known.at_edge > 0.0));
        self.is_carried = if carried { 1.0 } else { 0.0 };
        let factor = -1.5 / (relaxation_time * (1.0 + found[0]));
        let [x, y, z] = across(found, [-known.c[0], -known.c[1], -known.c[2]]);
        self.given = [
            inner[0] + factor * x,
            inner[1] + factor * y,
            inner[2] + factor * z,
        ];
    }
}

/// Surface in the cells of a batch: the values of [`Facet`].
#[derive(Clone, Debug, Default)]
pub(super) struct Facets {
    velocity: [Values; 3],
    normal: [Values; 3],
    distance: Values,
    at_rest: Values,
    most: Values,
    has_inside: Values,
    inside: Values,
    density_inside: Values,
    traction: [Values; 3],
    inner: Values,
    pub(super) is_carried: Values,
    given: [Values; 3],
    /// Direction to the liquid cell closest to the inward normal; 0 without one.
    pub(super) inward: [u8; MOST],
    /// `true` for the cells that the liquid cell inside carries.
    pub(super) carried: [bool; MOST],
}

impl Facets {
    /// Returns the surface in a cell.
    #[inline(always)]
    pub(super) fn facet(&self, k: usize) -> Facet {
        let of = |vector: &[Values; 3]| [vector[0][k], vector[1][k], vector[2][k]];
        Facet {
            velocity: of(&self.velocity),
            normal: of(&self.normal),
            distance: self.distance[k],
            at_rest: self.at_rest[k],
            most: self.most[k],
            has_inside: self.has_inside[k],
            inside: self.inside[k],
            density_inside: self.density_inside[k],
            traction: of(&self.traction),
            inner: self.inner[k],
            is_carried: self.is_carried[k],
            given: of(&self.given),
        }
    }

    /// Sets the surface in a cell.
    #[inline(always)]
    pub(super) fn set(&mut self, k: usize, facet: &Facet) {
        let set = |vector: &mut [Values; 3], [x, y, z]: [f64; 3]| {
            (vector[0][k], vector[1][k], vector[2][k]) = (x, y, z);
        };
        set(&mut self.velocity, facet.velocity);
        set(&mut self.normal, facet.normal);
        self.distance[k] = facet.distance;
        self.at_rest[k] = facet.at_rest;
        self.most[k] = facet.most;
        self.has_inside[k] = facet.has_inside;
        self.inside[k] = facet.inside;
        self.density_inside[k] = facet.density_inside;
        set(&mut self.traction, facet.traction);
        self.inner[k] = facet.inner;
        self.is_carried[k] = facet.is_carried;
        set(&mut self.given, facet.given);
    }
}
