//! Method for each joint under a lattice: the network, or the lattice itself.
//!
//! The network neglects the momentum of water at mouths and corners, and takes the flow between the faces as that of a
//! thin layer; it does not depend on the cells of the lattice. The lattice resolves the flow in a joint with enough
//! cells across it, at the cost of cells as small as a part of the narrowest joint. `auto` divides them at
//! [`TAKEOVER_CELLS`].
//!
//! Measured for a joint of a length of ten apertures with its faces on faces of cells, against the lattice with six
//! cells across (`python3 jobs/verification/wide-joint/methods.py SOLVER methods.csv 1 2 3 4 6`; its README has more):
//!
//! | cells across | moment by the network | by the lattice | cost of the network over that of the lattice |
//! |---|---|---|---|
//! | 1 | -10.6 % | no water | |
//! | 2 | -7.1 % | 2.5 % | 1.5 |
//! | 3 | -8.4 % | 1.3 % | 1.4 |
//! | 4 | -8.2 % | 0.7 % | 1.5 |
//! | 6 | -8.0 % | reference | 1.2 |
//!
//! The error of the network falls with the length of the joint, to 1.8 % at thirty apertures, and does not depend on
//! the cells. That of the lattice in the table is for faces on faces of cells. Other faces move by up to half a cell,
//! each: the discharge is off by up to `(1 + 1/n)³`, twice with four cells and a fifth with sixteen, while the
//! network takes faces where they are. With fewer than four cells the lattice may lose more than half of the section
//! of a joint, so that the limit is four.

use super::blocks::{PlacedBlocks, RockBlock};
use super::grid::Grid;
use case::Case;
use case::fluid::Fluid;
use case::joints::{JointMethod, JointSettings, LatticeJoints};
use joints::pairs::{PairLimits, Rock, joints};
use serde::Serialize;

/// Aperture up to which a joint is left to the network by `auto`, and above which the lattice takes over from the
/// network \[cells\].
pub const TAKEOVER_CELLS: f64 = 4.0;
/// Aperture above which a joint occupies cells of the lattice \[cells\].
pub const WIDE: f64 = joints::network::WIDE_CELLS;

/// Largest aperture of a network without joints \[m\]: no distance is below it.
const NO_JOINT: f64 = -1.0;

/// Number of joints, and their smallest and largest aperture \[cells\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JointShare {
    /// Number of joints.
    pub joints: usize,
    /// Smallest and largest aperture \[cells\]; infinite and 0 without a joint.
    pub cells_across: [f64; 2],
}

impl Default for JointShare {
    fn default() -> Self {
        Self {
            joints: 0,
            cells_across: [f64::INFINITY, 0.0],
        }
    }
}

impl JointShare {
    fn add(&mut self, cells_across: f64) {
        self.joints += 1;
        let [low, high] = &mut self.cells_across;
        *low = low.min(cells_across);
        *high = high.max(cells_across);
    }
}

/// Methods for the joints of a case under a lattice at the start.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointMethods {
    /// Method as written.
    pub method: JointMethod,
    /// Joints that the network computes.
    pub network: JointShare,
    /// Joints that the lattice computes.
    pub lattice: JointShare,
    /// Largest aperture of a joint in the network \[m\]; none if there is no network.
    pub limit: Option<f64>,
}

/// Returns the largest aperture of a joint in the network \[m\]; none if the method has no network. `spacing` is the
/// size of a cell of the lattice \[m\].
pub(super) fn widest(written: &LatticeJoints, spacing: f64) -> Option<f64> {
    let largest = written.joints.largest_aperture;
    match written.method {
        JointMethod::Auto => Some(largest.min(TAKEOVER_CELLS * spacing)),
        JointMethod::Network => Some(largest),
        JointMethod::Lattice => None,
    }
}

impl JointMethods {
    /// Returns the methods for the joints between these blocks.
    pub(super) fn between(written: &LatticeJoints, grid: &Grid, blocks: &PlacedBlocks) -> Self {
        let limit = widest(written, grid.spacing);
        let mut all = Self {
            method: written.method,
            network: JointShare::default(),
            lattice: JointShare::default(),
            limit,
        };
        // Faces on both sides of a block that is thinner than the aperture form no joint.
        let distance = written.joints.largest_aperture;
        if blocks
            .thinnest()
            .is_some_and(|thinnest| distance >= thinnest)
        {
            return all;
        }
        for joint in joints(&rocks(blocks), &pair_limits(&written.joints)) {
            let gap = joint.gap.constant;
            let share = if limit.is_some_and(|limit| gap.abs() <= limit) {
                &mut all.network
            } else {
                &mut all.lattice
            };
            share.add(gap.max(0.0) / grid.spacing);
        }
        all
    }

    /// Returns the methods for the joints of a case under a lattice; none if it has no such joints.
    pub(super) fn resolve(case: &Case, grid: &Grid, blocks: Option<&PlacedBlocks>) -> Option<Self> {
        match &case.fluid {
            Some(Fluid::LatticeBoltzmann(water)) => {
                Some(Self::between(water.joints.as_ref()?, grid, blocks?))
            }
            _ => None,
        }
    }

    /// Returns the largest aperture of a joint of the network \[m\]; negative if the method has no network.
    pub(super) fn limit(&self) -> f64 {
        self.limit.unwrap_or(NO_JOINT)
    }

    /// Returns the apertures above which a joint occupies cells of the lattice, and above which the lattice takes it
    /// over \[m\].
    pub(super) fn lattice_limits(&self, grid: &Grid) -> [f64; 2] {
        let takeover = TAKEOVER_CELLS * grid.spacing;
        [WIDE * grid.spacing, takeover.max(self.limit())]
    }

    /// Returns the cost of a lattice with [`TAKEOVER_CELLS`] cells across the narrowest joint of the network, relative
    /// to the present lattice: with the cells and steps of a finer spacing. At least 1.
    #[must_use]
    pub fn resolved_cost(&self) -> f64 {
        let [low, _] = self.network.cells_across;
        // A closed joint would need cells of its roughness.
        (TAKEOVER_CELLS / low.max(1e-3)).max(1.0).powi(4)
    }
}

/// Returns the blocks in the form that the network reads.
pub(super) fn rocks(blocks: &PlacedBlocks) -> Vec<Rock<'_>> {
    fn rock(block: &RockBlock) -> Rock<'_> {
        let solid = &block.solid;
        Rock {
            shape: &solid.shape,
            position: solid.position,
            orientation: solid.orientation,
        }
    }
    blocks.list.iter().map(rock).collect()
}

/// Returns the limits within which faces form joints.
pub(super) fn pair_limits(joints: &JointSettings) -> PairLimits {
    PairLimits {
        distance: joints.largest_aperture,
        angle: joints.largest_angle_degrees.to_radians(),
    }
}
