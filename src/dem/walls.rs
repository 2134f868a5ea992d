//! Stationary or moving walls: infinite planes, and surfaces of convex facets ([`super::surface`]).

pub mod area;

use std::sync::Arc;

use nalgebra::Vector3;

use super::space::{Components, Space};
use super::surface::{FacetSurface, Nearest};

/// Half-space that grains cannot enter, or surface that they touch from either side.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall<S: Space> {
    /// Present position of a point of the plane \[m\]; for a surface its displacement.
    pub point: S::Vector,
    /// Unit normal of the plane, pointing into the grains; zero for a surface.
    pub normal: S::Vector,
    /// Velocity [m/s]: its tangential part only drags grains, its normal part moves the wall.
    pub velocity: S::Vector,
    /// Index in the table of contact parameters.
    pub material: u32,
    /// Facets of the wall; none for a plane.
    pub surface: Option<Arc<FacetSurface>>,
    /// `true` if grains pass through the wall.
    pub open: bool,
}

impl<S: Space> Wall<S> {
    /// Returns a stationary wall through `point` \[m\] whose `normal`, of any length, points into the grains.
    #[must_use]
    pub fn new(point: S::Vector, normal: S::Vector, material: u32) -> Self {
        let length = normal.length();
        Self {
            point,
            normal: normal * (1.0 / length),
            velocity: S::Vector::default(),
            material,
            surface: None,
            open: false,
        }
    }

    /// Returns a stationary wall of facets.
    #[must_use]
    pub fn of_surface(surface: Arc<FacetSurface>, material: u32) -> Self {
        Self {
            point: S::Vector::default(),
            normal: S::Vector::default(),
            velocity: S::Vector::default(),
            material,
            surface: Some(surface),
            open: false,
        }
    }

    /// Returns the velocity with which the wall moves [m/s]; a tangential velocity only drags.
    #[must_use]
    pub fn drift(&self) -> S::Vector {
        match &self.surface {
            None => self.velocity,
            Some(surface) => S::from_volume(&surface.moving(&S::to_volume(&self.velocity))),
        }
    }

    /// Returns a point \[m\] relative to the facets; in a periodic domain it is wrapped into the domain.
    #[inline]
    pub(super) fn local(&self, point: &S::Vector) -> Vector3<f64> {
        let at = S::to_volume(&(*point - self.point));
        self.surface
            .as_ref()
            .map_or(at, |surface| surface.in_domain(&at).0)
    }

    /// Finds the contacts of a centre \[m\] in space, like [`FacetSurface::contacts`]; contacts have the names of
    /// their facets.
    #[inline]
    pub(super) fn touched(
        &self,
        near: &[u32],
        centre: &S::Vector,
        reach: f64,
        found: &mut Vec<Nearest>,
    ) {
        found.clear();
        if let Some(surface) = &self.surface {
            let (at, by) = surface.in_domain(&S::to_volume(&(*centre - self.point)));
            surface.contacts(near, &at, reach, found);
            surface.name(found, by);
        }
    }

    /// Returns `true` if a point of space \[m\] lies on one of these facets.
    pub(super) fn stands_on(&self, near: &[u32], point: &S::Vector) -> bool {
        let surface = self.surface.as_ref();
        surface.is_some_and(|surface| surface.stands_on(near, &self.local(point)))
    }

    /// Returns the distance \[m\] of a point from the plane, positive on the side of the grains.
    #[must_use]
    #[inline(always)]
    pub fn distance(&self, point: &S::Vector) -> f64 {
        self.normal.scalar(&(*point - self.point))
    }

    /// Returns `true` if the present wall stops a ball of this radius \[m\] at a position: it reaches the facets, or
    /// the far side of the plane.
    #[must_use]
    pub fn stops(&self, at: &S::Vector, radius: f64) -> bool {
        !self.open
            && self.surface.as_ref().map_or_else(
                || self.distance(at) < radius,
                |surface| surface.is_within(&self.local(at), radius),
            )
    }

    /// Returns the walls of a box along its non-periodic `axes`: lower and upper face of each, in the order of the
    /// axes.
    #[must_use]
    pub fn of_box(
        lower: S::Vector,
        upper: S::Vector,
        closed: [bool; 3],
        material: u32,
    ) -> Vec<Self> {
        let mut walls = Vec::new();
        for axis in (0..S::DIMENSION).filter(|&axis| closed[axis]) {
            for (corner, sign) in [(lower, 1.0), (upper, -1.0)] {
                let mut normal = S::Vector::default();
                normal.set(axis, sign);
                walls.push(Self::new(corner, normal, material));
            }
        }
        walls
    }
}
