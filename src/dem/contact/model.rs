//! Interface of a resolved contact law for plan, preparation and outputs.

use serde::Serialize;

use super::Scaled;
use super::blocks::BlockLaw;
use crate::polyhedron::Polyhedron;

/// Resolved contact law as an interface for plan, preparation and outputs. Materials are indices in the order of
/// the case.
pub trait ContactModel {
    /// Returns one line for the plan.
    fn describe(&self) -> String;

    /// Returns the number of materials of the law.
    fn materials(&self) -> u32;

    /// Returns the coefficient of friction of a pair of materials.
    fn friction(&self, materials: [u32; 2]) -> f64;

    /// Returns the normal stiffness [N/m] of a pair with mean diameter `diameter` \[m\]; if springs harden, that at
    /// an overlap of 1e-4 of the diameter.
    fn normal_stiffness(&self, materials: [u32; 2], diameter: f64) -> f64;

    /// Returns the normal stiffness per diameter [N/m²] with which a packing of this material grows.
    fn growth_stiffness(&self, material: u32, diameter: f64) -> f64 {
        self.normal_stiffness([material; 2], diameter) / diameter
    }

    /// Changes the law for the preparation of grains: another normal stiffness [N/m], another coefficient of
    /// friction. Grains are bonded after their preparation. A law with another stiffness therefore has no bonds:
    /// bonds of full strength on soft springs would open so far that neighbour lists had hundreds of pairs per
    /// grain.
    fn prepare(&mut self, normal_stiffness: Option<f64>, friction: Option<f64>);

    /// Returns springs and dashpots of a contact, for stability.
    fn springs(&self, contact: &StaticContact) -> Springs;

    /// Returns the limits of the time step for a disc or sphere of this material and mass \[kg\] in contact with any
    /// body. `radii` \[m\] are its own and the largest of the bodies that it can meet.
    fn time_limits(&self, material: u32, radii: [f64; 2], mass: f64) -> TimeLimits;

    /// Returns the limits of the time step for a block of this material and mass \[kg\]; none if the law is not for
    /// blocks.
    fn time_limits_of_block(&self, _: u32, _: &Polyhedron, _mass: f64) -> Option<TimeLimits> {
        None
    }

    /// Returns the largest approach speed [m/s] for which a law with hardening springs gives its stiffness, and the
    /// JSON path that sets it.
    fn impact_speed(&self) -> Option<(f64, &'static str)> {
        None
    }

    /// Returns the JSON paths of the damping of the normal and of the shear springs; none for a law that has its own.
    fn damping_paths(&self) -> Option<[&'static str; 2]> {
        None
    }

    /// Returns `true` if contacts can be bonded.
    fn bonds(&self) -> bool {
        false
    }

    /// Returns the largest gap \[m\] across which pairs are bonded.
    fn bonding_gap(&self) -> f64 {
        0.0
    }

    /// Returns the opening at which a bond of given strength breaks.
    fn bond_opening(&self, _materials: [u32; 2], _diameter: f64) -> Option<BondOpening> {
        None
    }

    /// Returns the cohesion of bonded contacts \[N\].
    fn cohesion(&self, _materials: [u32; 2]) -> Scaled {
        Scaled::ZERO
    }

    /// Returns `true` if water forms capillary bridges between the grains, which carry its suction.
    fn bridges(&self) -> bool {
        false
    }

    /// Returns the JSON path of an option that needs the moisture of unsaturated ground, if the law has one.
    fn moisture(&self) -> Option<String> {
        None
    }

    /// Returns the law of blocks, if this is one.
    fn blocks(&self) -> Option<&BlockLaw> {
        None
    }
}

/// Upper limits of the solid time step of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeLimits {
    /// Limit 2 sqrt(m/k) \[s\] for the stiffest contact of the body, shortened by the dashpot; if springs harden,
    /// at the largest expected overlap.
    pub spring: f64,
    /// Rayleigh time of an elastic sphere \[s\].
    pub rayleigh: Option<f64>,
}

impl TimeLimits {
    /// Returns 2 sqrt(m/k) for a mass \[kg\] and the stiffest spring [N/m].
    #[must_use]
    pub fn of_spring(mass: f64, stiffness: f64) -> Self {
        Self {
            spring: 2.0 * (mass / stiffness).sqrt(),
            rayleigh: None,
        }
    }

    /// Returns the shorter limit \[s\].
    #[must_use]
    pub fn shorter(&self) -> f64 {
        self.rayleigh
            .map_or(self.spring, |time| time.min(self.spring))
    }
}

/// Contact of two discs or spheres, or of one with a wall, for a stability analysis.
#[derive(Clone, Copy, Debug)]
pub struct StaticContact {
    /// Indices of the materials of both bodies.
    pub materials: [u32; 2],
    /// Mean diameter \[m\].
    pub diameter: f64,
    /// Effective radius \[m\].
    pub radius: f64,
    /// Effective mass \[kg\].
    pub mass: f64,
    /// Overlap \[m\]; none for the largest expected one.
    pub overlap: Option<f64>,
    /// Overlap that determines the stiffness.
    pub depth: Depth,
    /// `true` if the contact is bonded.
    pub bonded: bool,
}

/// Overlap that determines the stiffness of a contact with hardening springs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Depth {
    /// Initial overlap.
    Start,
    /// Largest expected overlap, if that is larger.
    Expected,
}

/// Springs [N/m] and dashpots [N s/m] of a contact: normal, shear.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Springs {
    /// Stiffness [N/m].
    pub stiffness: [f64; 2],
    /// Dashpots [N s/m].
    pub dashpots: [f64; 2],
}

impl Springs {
    /// Returns springs with dashpots that are `fractions` of critical damping for a mass \[kg\], times `factor`. A
    /// contact with neither friction nor a bond has no shear spring.
    pub(crate) fn damped(
        stiffness: [f64; 2],
        sticks: bool,
        (fractions, factor): ([f64; 2], f64),
        mass: f64,
    ) -> Self {
        let stiffness = [stiffness[0], if sticks { stiffness[1] } else { 0.0 }];
        Self {
            stiffness,
            dashpots: [0, 1].map(|i| 2.0 * factor * fractions[i] * (mass * stiffness[i]).sqrt()),
        }
    }
}

/// Opening at which a bond breaks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BondOpening {
    /// Largest gap across which the bond was created \[m\].
    pub gap: f64,
    /// Tensile strength \[N\].
    pub strength: f64,
    /// Stiffness of its normal spring [N/m].
    pub stiffness: f64,
    /// JSON path of the strength in a case.
    pub path: &'static str,
}

impl BondOpening {
    /// Returns the gap at which the bond breaks \[m\].
    #[must_use]
    pub fn widest(&self) -> f64 {
        self.gap + self.strength / self.stiffness
    }
}
