//! Slabs of equal cost.
//!
//! The cost of a plane of cells is that of its cells, of the solids that cover them, and of the grains
//! whose centres lie in it. The rates are those of the plan ([`Parts`]); the rate of the lattice pass
//! is measured where the cuts depend on it. The rates determine only where the slabs are cut: no result
//! depends on them. A run that saves a checkpoint compares the rates with the times that its phases
//! took, and continues from it with other slabs where these cost clearly less.
//!
//! Costs are whole picoseconds, so that their sums over ranks are equal on all of them.

use super::{Present, calibration, setup};
use base::number::{floor_i64, real, to_i64};
use decomposition::{Communicator, Slabs};
use dem::particles::Particles;
use dem::space::{Components, Space};
use output::checkpoint::SavedNumber;
use plan::Plan;
use plan::estimate::time::Parts;
use plan::scene::Scene;
use plan::scene::free_surface::WaterCells;

/// Maximum computing time of the busiest rank relative to the mean with slabs of equal thickness; above
/// it slabs are cut by cost.
const IMBALANCE_LIMIT: f64 = 1.05;
/// Minimum fraction of the busiest rank's time that other slabs must save before a run changes to them.
const MIN_SAVING: f64 = 0.1;
/// Minimum cost of a step of all ranks together \[ps\] for which slabs are balanced: below it messages
/// dominate.
const MIN_STEP_COST: i64 = 20_000_000;
/// Minimum estimated time of a run on one core \[s\] for which the speed of the machine is measured.
const LONG_RUN: f64 = 10.0;
/// Picoseconds in a second.
const PICOSECONDS: f64 = 1e12;

/// Costs of the planes of cells along the split axis, in one step.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Costs {
    /// Costs of the fluid: cells, links, covered cells.
    fluid: Vec<i64>,
    /// Costs of the solids: contacts, motion, maps.
    solids: Vec<i64>,
}

impl Costs {
    /// Returns the costs of a scene with particles; each rank passes its own particles. `water` contains the cells with
    /// water of each plane below a free surface. Collective.
    pub(super) fn for_scene<Sp: Space>(
        plan: &Plan,
        particles: &Particles<Sp>,
        water: Option<&[WaterCells]>,
        communicator: &Communicator,
    ) -> Self {
        let (scene, mut parts) = (&plan.scene, Parts::for_scene(&plan.scene, &plan.clock));
        // The pass over the lattice depends on the width of vectors and on the memory; the work of solids hardly does.
        parts.cell /= plan.estimate.machine.fluid;
        let axis = scene.grid.split_axis;
        let planes = scene.grid.cells[axis];
        let mut all = Self {
            fluid: vec![0; planes],
            solids: vec![0; planes],
        };
        for k in 0..particles.owned() {
            all.add(scene, &parts, Solid::new(scene, particles, k));
        }
        communicator.all_reduce_sum_i64s(&mut all.fluid);
        communicator.all_reduce_sum_i64s(&mut all.solids);
        let across = real(scene.grid.cell_count()) / real(planes.max(1));
        let empty = picoseconds(across * parts.cell);
        for (n, plane) in all.fluid.iter_mut().enumerate() {
            *plane += match water {
                Some(water) => {
                    let [wet, interface] = water[n];
                    picoseconds(wet * (parts.cell + parts.wet) + interface * parts.interface)
                }
                None => empty,
            };
        }
        all
    }

    /// Adds a solid: the cost of its motion to the plane of its centre, the cost of its cells to all
    /// planes that it intersects.
    fn add(&mut self, scene: &Scene, parts: &Parts, solid: Solid) {
        let grid = &scene.grid;
        let planes = to_i64(self.fluid.len() as u64);
        let periodic = grid.periodic[grid.split_axis];
        let plane = |x: f64| {
            let plane = floor_i64(x);
            let inside = if periodic {
                plane.rem_euclid(planes)
            } else {
                plane.clamp(0, planes - 1)
            };
            usize::try_from(inside).unwrap_or(0)
        };
        let Solid {
            centre,
            radius,
            volume,
            surface,
            block,
            bed,
        } = solid;
        self.solids[plane(centre)] += picoseconds(parts.solid[usize::from(block)] + parts.porosity);
        let fluid = volume * parts.covered + surface * parts.linked;
        let map = surface * parts.mapped[usize::from(!bed)];
        if fluid + map > 0.0 {
            let (first, last) = (floor_i64(centre - radius), floor_i64(centre + radius));
            // A solid longer than the periodic domain is counted once in every plane.
            let last = last.min(first + planes - 1);
            let share = 1.0 / real(last - first + 1);
            for at in first..=last {
                let at = plane(real(at));
                self.fluid[at] += picoseconds(fluid * share);
                self.solids[at] += picoseconds(map * share);
            }
        }
    }

    /// Returns the total cost of each plane, with the ratio of solid to fluid costs corrected by
    /// measured times \[s\] of all ranks.
    #[must_use]
    pub(super) fn measured(&self, [fluid, solids]: [f64; 2]) -> Vec<i64> {
        let sum = |of: &[i64]| real(of.iter().sum::<i64>());
        let (by_plan, by_plan_too) = (sum(&self.fluid), sum(&self.solids));
        let known = fluid > 0.0 && solids > 0.0 && by_plan > 0.0 && by_plan_too > 0.0;
        let factor = if known {
            (solids / by_plan_too) / (fluid / by_plan)
        } else {
            1.0
        };
        let solids = self.solids.iter().map(|c| whole(real(*c) * factor));
        self.fluid.iter().zip(solids).map(|(f, s)| f + s).collect()
    }

    /// Returns the total cost of each plane with the rates of the plan.
    #[must_use]
    pub(super) fn planned(&self) -> Vec<i64> {
        self.measured([0.0; 2])
    }
}

/// Cost of a solid; lengths in cells along the split axis.
struct Solid {
    centre: f64,
    radius: f64,
    /// Volume in cells, and surface area in cell faces.
    volume: f64,
    surface: f64,
    block: bool,
    /// `true` for a grain among many, most of which are stationary.
    bed: bool,
}

impl Solid {
    fn new<Sp: Space>(scene: &Scene, particles: &Particles<Sp>, k: usize) -> Self {
        let (grid, axis) = (&scene.grid, scene.grid.split_axis);
        let (body, motion) = (&particles.body[k], &particles.motion[k]);
        let (radius, spacing) = (body.radius / grid.spacing, grid.spacing);
        let block = particles.polyhedron(k);
        let (volume, surface) = if let Some((shape, _)) = block {
            (
                shape.volume() / spacing.powi(3),
                shape.area() / spacing.powi(2),
            )
        } else if grid.dimension == 3 {
            let area = std::f64::consts::PI * radius * radius;
            (4.0 / 3.0 * area * radius, 4.0 * area)
        } else {
            let half = std::f64::consts::PI * radius;
            (half * radius, 2.0 * half)
        };
        Self {
            centre: motion.position.get(axis) / spacing,
            radius,
            volume,
            surface,
            block: block.is_some(),
            bed: body.id >= scene.first_grain(),
        }
    }
}

fn picoseconds(seconds: f64) -> i64 {
    whole(seconds * PICOSECONDS)
}

fn whole(x: f64) -> i64 {
    floor_i64(x.clamp(0.0, 1e15) + 0.5)
}

/// Returns the cells with water of each plane at the start, for slabs along the axis of gravity, above which the air
/// remains; `None` without a free surface and along other axes, along which the water spreads.
pub(super) fn water_at_start(scene: &Scene) -> Option<Vec<WaterCells>> {
    let (surface, axis) = (scene.surface.as_ref()?, scene.grid.split_axis);
    (surface.axis == axis).then(|| surface.cells_of_planes(scene.grid.cells, axis))
}

/// Returns the cells with water of each plane at present; `None` without a free surface. Collective.
pub(super) fn water_at_present<Sp: Space, S: SavedNumber>(
    now: &Present<Sp, S>,
) -> Option<Vec<WaterCells>> {
    let surface = now.lattice()?.fluid().surface()?;
    let grid = &now.plan.scene.grid;
    let mut counts = vec![0; 2 * grid.cells[grid.split_axis]];
    for (n, cells) in now.domain.range().zip(surface.cells_of_planes()) {
        for (count, cells) in counts[2 * n..].iter_mut().zip(cells) {
            *count = to_i64(cells as u64);
        }
    }
    now.domain.communicator().all_reduce_sum_i64s(&mut counts);
    let planes = counts.as_chunks().0.iter();
    Some(planes.map(|cells: &[i64; 2]| cells.map(real)).collect())
}

/// Returns the cost of the most expensive slab divided by the mean cost.
#[must_use]
pub(super) fn imbalance(slabs: &Slabs, planes: &[i64]) -> f64 {
    let cost = |rank| planes[slabs.range(rank)].iter().sum::<i64>();
    let dearest = (0..slabs.size()).map(cost).max().unwrap_or(0);
    let all = planes.iter().sum::<i64>();
    if all > 0 {
        real(dearest) * real(slabs.size()) / real(all)
    } else {
        1.0
    }
}

/// Returns `true` if measuring the speed of the machine is worth its time: slabs of equal thickness are
/// uneven, and the run is long.
#[must_use]
pub(super) fn depends_on_the_machine(
    plan: &Plan,
    planes: &[i64],
    communicator: &Communicator,
) -> bool {
    let equal = equal(&plan.scene, planes.len(), communicator.size());
    communicator.size() > 1
        && plan.scene.flow.is_some()
        && plan.estimate.seconds_on_one_core > LONG_RUN
        && imbalance(&equal, planes) > 1.0 + 0.5 * (IMBALANCE_LIMIT - 1.0)
}

/// Returns the measured speed of a core in its part of the lattice divided by that of the plan: the
/// mean of all ranks, which measure at the same time. Collective.
#[must_use]
pub(super) fn speed(plan: &Plan, communicator: &Communicator) -> f64 {
    communicator.barrier();
    let parts = communicator.size();
    let own = calibration::fluid(plan, parts) / real(rayon::current_num_threads());
    let sum = communicator.all_reduce_sum_i64(picoseconds(own));
    let mean = real(sum) / PICOSECONDS / real(parts);
    if mean > 0.0 { mean } else { 1.0 }
}

/// Returns slabs of equal thickness.
#[must_use]
pub(super) fn equal(scene: &Scene, planes: usize, ranks: usize) -> Slabs {
    let axis = scene.grid.split_axis;
    Slabs::even(setup::axis(axis), planes, ranks, scene.grid.periodic[axis])
}

/// Returns the message that a run prints when it replaces its slabs.
#[must_use]
pub(super) fn line(slabs: &Slabs, before: &Slabs, planes: &[i64]) -> String {
    let thickness = slabs.bounds().windows(2).map(|pair| pair[1] - pair[0]);
    let (least, most) = thickness.fold((usize::MAX, 0), |(least, most), n| {
        (least.min(n), most.max(n))
    });
    format!(
        "slabs of equal cost: {least} to {most} planes of cells; the busiest rank now has {:.2} times the mean \
         work instead of {:.2} times",
        imbalance(slabs, planes),
        imbalance(before, planes)
    )
}

/// Returns the slabs for planes of these costs: balanced by cost, or of equal thickness if these are
/// good enough.
#[must_use]
pub(super) fn cut(scene: &Scene, planes: &[i64], ranks: usize) -> Slabs {
    let equal = equal(scene, planes.len(), ranks);
    if planes.len() <= ranks || imbalance(&equal, planes) <= IMBALANCE_LIMIT {
        return equal;
    }
    let bounds = bounds(planes, ranks);
    Slabs::from_bounds(equal.axis(), bounds, equal.periodic()).unwrap_or(equal)
}

/// Returns `true` if changing from the slabs `now` to `other` is worth its cost.
#[must_use]
pub(super) fn is_worth(now: &Slabs, other: &Slabs, planes: &[i64]) -> bool {
    planes.iter().sum::<i64>() >= MIN_STEP_COST
        && imbalance(other, planes) < (1.0 - MIN_SAVING) * imbalance(now, planes)
}

/// Returns the bounds of slabs of at least one plane each with the smallest possible maximum cost.
/// Among such bounds, the cost of each slab is close to the mean of the costs that remain for it and
/// the slabs after it.
fn bounds(planes: &[i64], ranks: usize) -> Vec<usize> {
    // Minimum number of slabs with a cost of at most `most` each.
    let slabs_of = |most: i64| {
        let (mut count, mut cost) = (1, 0);
        for &plane in planes {
            if cost + plane > most {
                count += 1;
                cost = 0;
            }
            cost += plane;
        }
        count
    };
    let mut least = planes.iter().copied().max().unwrap_or(0);
    let mut enough = planes.iter().sum::<i64>();
    while least < enough {
        let middle = least + (enough - least) / 2;
        if slabs_of(middle) <= ranks {
            enough = middle;
        } else {
            least = middle + 1;
        }
    }
    // The first plane at which the slabs from each rank on can begin.
    let mut earliest = vec![planes.len(); ranks + 1];
    for rank in (0..ranks).rev() {
        let (mut first, mut cost) = (earliest[rank + 1], 0);
        while first > 0 && cost + planes[first - 1] <= enough {
            first -= 1;
            cost += planes[first];
        }
        earliest[rank] = first;
    }
    let mut all = vec![0];
    let mut left = planes.iter().sum::<i64>();
    for rank in 0..ranks {
        let first = all[rank];
        let later = ranks - rank - 1;
        let mean = real(left) / real(later + 1);
        let (mut next, mut cost) = (first, 0);
        while next < planes.len() - later {
            let more = cost + planes[next];
            let must = next < earliest[rank + 1] || next == first || later == 0;
            let nearer = (real(more) - mean).abs() < (real(cost) - mean).abs();
            if !must && (more > enough || !nearer) {
                break;
            }
            cost = more;
            next += 1;
        }
        left -= cost;
        all.push(next);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use case::Document;
    use decomposition::SplitAxis;
    use dem::polyhedron::Polyhedron;
    use dem::{Body, Motion, Volume};
    use nalgebra::{UnitQuaternion, Vector3};
    use proptest::prelude::*;
    use std::path::Path;

    fn highest_cost(planes: &[i64], bounds: &[usize]) -> i64 {
        let cost = |pair: &[usize]| planes[pair[0]..pair[1]].iter().sum();
        bounds.windows(2).map(cost).max().unwrap()
    }

    /// Returns the smallest possible maximum cost of a slab, found by trying all cuts.
    fn smallest_cost(planes: &[i64], ranks: usize) -> i64 {
        if ranks == 1 {
            return planes.iter().sum();
        }
        (1..=planes.len() - (ranks - 1))
            .map(|n| {
                planes[..n]
                    .iter()
                    .sum::<i64>()
                    .max(smallest_cost(&planes[n..], ranks - 1))
            })
            .min()
            .unwrap()
    }

    proptest! {
        #[test]
        fn no_other_cuts_are_better(
            planes in prop::collection::vec(0..50_i64, 5..12),
            ranks in 1..5_usize,
        ) {
            let bounds = bounds(&planes, ranks);
            prop_assert_eq!(bounds.len(), ranks + 1);
            prop_assert_eq!((bounds[0], bounds[ranks]), (0, planes.len()));
            prop_assert!(bounds.windows(2).all(|pair| pair[0] < pair[1]));
            prop_assert_eq!(highest_cost(&planes, &bounds), smallest_cost(&planes, ranks));
        }
    }

    /// Checks that the cost of a long block is that of the cells that it covers, a small part of its enclosing sphere.
    #[test]
    fn a_block_costs_its_own_volume_and_surface() {
        let text = r#"{"title": "block", "domain": {"size": [0.4, 0.1, 0.1], "spacing": 0.005, "split": "x"},
            "materials": {"rock": {"density": 2600}},
            "fluid": {"lattice_boltzmann": {"lattice": "d3q27", "density": 1000, "kinematic_viscosity": 1e-4,
                "reference_velocity": 0.1, "lattice_velocity": 0.05}},
            "bodies": [{"name": "slab", "shape": {"cuboid": {"edges": [0.02, 0.08, 0.02]}}, "position": [0.2, 0.05,
            0.05],
                "motion": {"free": {}}, "material": "rock"}],
            "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "normal_damping_ratio": 0.3}},
            "coupling": {"partially_saturated": {}}, "time": {"end": 0.01}}"#;
        let document = Document::read(text, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let (grid, parts) = (&plan.scene.grid, Parts::for_scene(&plan.scene, &plan.clock));
        let shape = Polyhedron::cuboid(Vector3::new(0.02, 0.08, 0.02)).unwrap();
        let mut particles = Particles::<Volume>::new();
        particles.set_shapes([shape.clone()].into()).unwrap();
        let motion = Motion {
            position: Vector3::new(0.2, 0.05, 0.05),
            ..Motion::default()
        };
        let body = Body::of_block(0, &shape, 2600.0, 0);
        let turn = UnitQuaternion::identity();
        particles.add_block(body, motion, 0, turn).unwrap();
        let all = Costs::for_scene(&plan, &particles, None, &Communicator::serial());
        let cells = real(grid.cell_count()) * parts.cell / plan.estimate.machine.fluid;
        let fluid = real(all.fluid.iter().sum::<i64>()) / PICOSECONDS - cells;
        let map = real(all.solids.iter().sum::<i64>()) / PICOSECONDS - parts.solid[1];
        // 4 x 16 x 4 cells with 2 (16 + 64 + 64) faces.
        assert!(
            (fluid / (256.0 * parts.covered) - 1.0).abs() < 1e-3,
            "{fluid}"
        );
        assert!(
            (map / (288.0 * parts.mapped[1]) - 1.0).abs() < 1e-3,
            "{map}"
        );
    }

    #[test]
    fn a_bed_in_a_fifth_is_shared() {
        let mut planes = vec![100_000; 100];
        for plane in &mut planes[40..60] {
            *plane = 2_000_000;
        }
        let equal = Slabs::even(SplitAxis::X, 100, 4, false);
        let by_cost = Slabs::from_bounds(SplitAxis::X, bounds(&planes, 4), false).unwrap();
        assert!(imbalance(&equal, &planes) > 1.6);
        assert!(imbalance(&by_cost, &planes) < 1.1, "{by_cost:?}");
        assert!(is_worth(&equal, &by_cost, &planes) && !is_worth(&by_cost, &equal, &planes));
    }

    #[test]
    fn times_of_phases_correct_the_rates() {
        let costs = Costs {
            fluid: vec![10, 10, 10, 10],
            solids: vec![0, 0, 10, 10],
        };
        assert_eq!(costs.planned(), [10, 10, 20, 20]);
        // The solids took as long as the fluid: twice what the plan says.
        assert_eq!(costs.measured([3.0, 3.0]), [10, 10, 30, 30]);
    }
}
