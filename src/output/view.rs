//! Read access of outputs, probes and analyses to a running simulation.

use super::averages::Averages;
use coupling::FluidView;
use coupling::joint_water::JointWater;
use coupling::seepage::Seepage;
use decomposition::Domain;
use dem::Dem;
use dem::particles::Particles;
use dem::space::Space;
use plan::Plan;

/// State of a run between two steps. Named bodies of the case have the ids 0, 1, … in the order of the case; grains
/// follow.
#[derive(Clone, Copy)]
pub struct StateView<'a, S: Space> {
    /// Plan of the run.
    pub plan: &'a Plan,
    /// Ranks and slabs.
    pub domain: &'a Domain,
    /// Slab of fluid of this rank, if the scene has one.
    pub fluid: Option<&'a dyn FluidView>,
    /// Seepage, if the scene has one; the same on every rank.
    pub seepage: Option<&'a Seepage<S>>,
    /// Water in the joints, if it is the fluid; the same on every rank.
    pub joints: Option<&'a JointWater>,
    /// Time averages of the slab of this rank, if the scene has averages.
    pub averages: Option<&'a Averages>,
    /// Grains and bodies of this rank, with current ghosts.
    pub particles: &'a Particles<S>,
    /// Solver of contacts and motion, if anything moves.
    pub dem: Option<&'a Dem<S>>,
    /// Number of steps done, without the warm-up.
    pub step: u64,
    /// Time \[s\], 0 at the end of the warm-up.
    pub time: f64,
}
