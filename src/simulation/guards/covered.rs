//! Openings that bodies cover when a run fails: the water cannot pass there.

use base::number::real;
use coupling::lattice::LatticeFlow;
use decomposition::Communicator;
use dem::space::Space;
use lbm::boundary::Inflow;
use lbm::lanes::Stored;
use plan::Plan;
use plan::scene::boundaries::ScenePatch;

/// Fraction of the cells of an opening above which bodies are said to cover it.
const COVERED: f64 = 0.5;

/// Returns the openings with a free flow that bodies cover, in words; none if there are none. Collective.
pub(super) fn covered_openings<Sp: Space, S: Stored>(
    flow: &dyn LatticeFlow<Sp, S>,
    plan: &Plan,
    communicator: &Communicator,
) -> Option<String> {
    let (scene, water) = (&plan.scene, plan.scene.flow.as_ref()?);
    let inflow = |patch: &ScenePatch| {
        let place = patch.imposed_at(&scene.grid, "");
        patch.condition.model().largest_inflow(&place)
    };
    let open = |patch: &&ScenePatch| {
        patch.condition.model().passes_water() && inflow(patch) == Inflow::Any
    };
    let mut named = Vec::new();
    for patch in water.patches().filter(open) {
        let [covered, all] =
            cells(flow, patch).map(|count| communicator.all_reduce_sum_u64(count as u64));
        if real(covered) > COVERED * real(all) {
            named.push(format!("{covered} of {all} cells of `{}`", patch.name));
        }
    }
    if named.is_empty() {
        return None;
    }
    let enters = |patch: &ScenePatch| matches!(inflow(patch), Inflow::Mean(mean) if mean > 0.0);
    let consequence = if water.patches().any(enters) {
        "the water that enters cannot leave there, so that its mass and density grow"
    } else {
        "the water cannot pass there"
    };
    Some(format!(
        "bodies cover {}: {consequence}",
        named.join(" and ")
    ))
}

/// Returns the number of cells of a patch in the slab of this rank that bodies cover, and of all its cells there.
fn cells<Sp: Space, S: Stored>(flow: &dyn LatticeFlow<Sp, S>, patch: &ScenePatch) -> [usize; 2] {
    let fluid = flow.fluid();
    let (start, own, domain) = (
        fluid.start(),
        fluid.populations().cells(),
        fluid.domain_cells(),
    );
    let (mut from, mut to) = (patch.from, patch.to);
    let axis = patch.face.axis();
    if patch.face.is_max() {
        (from[axis], to[axis]) = (domain[axis] - 1, domain[axis]);
    }
    let range = |a: usize| {
        let first = from[a].max(start[a]);
        first..to[a].min(start[a] + own[a]).max(first)
    };
    let mut counts = [0; 2];
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let cell = [x - start[0], y - start[1], z - start[2]];
                counts[0] += usize::from(flow.body_at(cell).is_some());
                counts[1] += 1;
            }
        }
    }
    counts
}
