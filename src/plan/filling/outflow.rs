//! Upper bounds of the discharge through openings at which the flow is free.
//!
//! Water of the energy E per mass leaves into air at a potential e with at most (2 (E - e))^½ (Bernoulli), so that an
//! opening lets out at most the integral of this over its area: (2/3) (2 g)^½ H^(3/2) per width of an outfall with
//! the height H of the lid above its sill. At a level the potential is that of the level above the sill. E is that of
//! still water at the highest corner of the domain, or of the fastest water that enters or moves at the start.
//!
//! In runs, openings let out up to 1.04 times this: the pressure of the air acts on the whole opening, so that jets
//! do not contract there. Through slots below the water it was 0.84 to 0.95 of it, and 0.78 to 0.81 to a level. Over
//! an outfall that takes the whole section the flow is critical, as in the parallel flow ahead of it:
//! A (2 (E - e))^½ with the potential e of its surface and the area A below, (2/3)^(3/2) g^½ H^(3/2) per width.

use super::inflow::{Inflows, names};
use super::space::Space;
use crate::scene::Scene;
use crate::scene::boundaries::ScenePatch;
use crate::scene::flow::Flow;
use crate::scene::free_surface::FreeSurface;
use crate::scene::initial::Initial;
use base::number::{real, whole};
use lbm::boundary::Condition;

/// Maximum number of strips of an opening, each of a potential.
const STRIPS: usize = 256;

/// Largest discharge over that of Bernoulli; runs had up to 1.04.
const MOST: f64 = 1.1;
/// Likely discharge over that of Bernoulli of an opening below the water, into air and to a level.
const LIKELY: [f64; 2] = [0.9, 0.8];
/// Part of the energy above the sill of a whole section that is left at the opening.
const LEFT: f64 = 0.95;

/// Opening at which the flow is free.
struct Outlet<'a> {
    patch: &'a ScenePatch,
    /// Lowest potential [m²/s²] and area [m², in 2-D m] of strips, in ascending order.
    strips: Vec<[f64; 2]>,
    /// Potential of the top of a cell above that of a strip in it.
    rise: f64,
    /// `true` if the opening takes the whole section of the space.
    whole: bool,
}

/// Openings through which water may leave a space.
pub(super) struct Outlets<'a> {
    list: Vec<Outlet<'a>>,
    /// Names of openings that let out a stated flow.
    stated: Vec<&'a str>,
    /// Largest energy of the water per mass [m²/s²].
    pub(super) energy: f64,
    /// Largest energy of jets and of water that moves at the start [m²/s²], and kinetic energy of a discharge.
    jets: f64,
    head: f64,
    /// `true` if what leaves has no bound.
    pub(super) unbounded: bool,
}

impl<'a> Outlets<'a> {
    /// Returns the openings of a scene through which water may leave the space.
    pub(super) fn new(
        scene: &Scene,
        flow: &'a Flow,
        surface: &FreeSurface,
        (inflows, space): (&Inflows<'a>, &Space<'_>),
    ) -> Self {
        let is_outlet = |patch: &&ScenePatch| {
            matches!(patch.condition, Condition::Level(_) | Condition::Outfall(_))
        };
        let outlets = flow.patches().filter(is_outlet);
        let list = outlets.filter_map(|patch| Outlet::new(scene, surface, patch, space));
        let list: Vec<Outlet<'_>> = list.collect();
        let grid = &scene.grid;
        let (pull, constant) = Space::pull(scene, flow);
        let driven = (0..grid.dimension).any(|a| grid.periodic[a] && pull[a] != 0.0);
        let upward = |one: &Outlet<'_>| {
            one.patch.face.axis() == surface.axis && one.patch.face.is_max() == surface.rises
        };
        let leaves = inflows.list.iter().filter(|one| one.range()[0] < 0.0);
        let still = highest(space, grid.size.map(|size| [0.0, size]));
        let moving = match &flow.initial {
            Initial::Uniform { velocity, .. } => 0.5 * velocity.iter().map(|u| u * u).sum::<f64>(),
            _ => 0.0,
        };
        let [jets, head] = of_inlets(scene, (inflows, space));
        Self {
            unbounded: !list.is_empty()
                && (driven || !constant || !space.is_exact() || list.iter().any(upward)),
            energy: (still + moving).max(jets).max(still + head),
            jets: jets.max(if moving > 0.0 { still + moving } else { jets }),
            head,
            list,
            stated: leaves.map(|one| one.patch.name.as_str()).collect(),
        }
    }

    /// Returns `true` if all openings have a stated flow.
    pub(super) fn all_stated(&self) -> bool {
        self.list.is_empty()
    }

    /// Returns `true` if no opening lets water out.
    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty() && self.stated.is_empty()
    }

    /// Returns the names of the openings that let water out.
    pub(super) fn names(&self) -> String {
        let free = self.list.iter().map(|one| one.patch.name.as_str());
        names(free.chain(self.stated.iter().copied()))
    }

    /// Returns the energy of the water above a level with this potential [m²/s²].
    pub(super) fn energy_at(&self, level: f64) -> f64 {
        (level + self.head).max(self.jets)
    }

    /// Returns the largest discharge through the openings with free flow of water with an energy [m³/s, in 2-D m²/s].
    pub(super) fn most(&self, energy: f64) -> f64 {
        self.list.iter().map(|one| one.most(energy)).sum()
    }

    /// Returns the discharge through these openings that is likely.
    pub(super) fn likely(&self, energy: f64) -> f64 {
        self.list.iter().map(|one| one.likely(energy)).sum()
    }
}

impl<'a> Outlet<'a> {
    /// Returns the opening of a patch; none outside the space.
    fn new(
        scene: &Scene,
        surface: &FreeSurface,
        patch: &'a ScenePatch,
        space: &Space<'_>,
    ) -> Option<Self> {
        let grid = &scene.grid;
        let (h, up) = (grid.spacing, surface.axis);
        let levels = patch.condition.model().levels().map(|(levels, _)| levels);
        let upwards = if surface.rises { 1.0 } else { -1.0 };
        let lower = |at: [f64; 3]| {
            // Water beyond the opening stands up to its lowest level.
            let mut at = at;
            at[patch.face.axis()] = if patch.face.is_max() {
                grid.size[patch.face.axis()]
            } else {
                0.0
            };
            if let Some(levels) = levels {
                let lowest = levels.map(|level| upwards * level);
                at[up] = upwards * (upwards * at[up]).max(lowest[0].min(lowest[1]));
            }
            space.potential(at)
        };
        let upright = patch.face.axis() != up;
        let half = if upright {
            0.5 * h * surface.gravity
        } else {
            0.0
        };
        let face = h.powi(if grid.dimension == 3 { 2 } else { 1 });
        let cells = space.cells_inside(patch).into_iter();
        let potentials: Vec<f64> = cells.map(|cell| lower(grid.centre(cell))).collect();
        let [low, high] = potentials
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], one| {
                [low.min(*one), high.max(*one)]
            });
        if potentials.is_empty() {
            return None;
        }
        let step = (high - low) / real(STRIPS);
        let mut areas = vec![0.0; STRIPS];
        for potential in potentials {
            let part = (potential - low) / step.max(f64::MIN_POSITIVE);
            areas[whole(part).min(STRIPS - 1)] += face;
        }
        let strips = areas.into_iter().enumerate();
        let strips = strips.map(|(n, area)| [low + real(n) * step, area]);
        Some(Self {
            patch,
            strips: strips.filter(|[_, area]| *area > 0.0).collect(),
            rise: step + half,
            whole: space.is_whole(patch),
        })
    }

    /// Returns the largest discharge of water with an energy.
    fn most(&self, energy: f64) -> f64 {
        MOST * self.without_loss(energy)
    }

    /// Returns the discharge of Bernoulli.
    fn without_loss(&self, energy: f64) -> f64 {
        let speed = |potential: f64| (2.0 * (energy - potential)).max(0.0).sqrt();
        let strips = self.strips.iter();
        strips
            .map(|[potential, area]| area * speed(*potential))
            .sum()
    }

    /// Returns the likely discharge of water with an energy.
    fn likely(&self, energy: f64) -> f64 {
        let top = self
            .strips
            .last()
            .map_or(0.0, |[potential, _]| potential + self.rise);
        let [to_air, to_level] = LIKELY.map(|part| part * self.without_loss(energy));
        match self.patch.condition {
            Condition::Level(_) => to_level,
            _ if self.whole || energy <= top => self.parallel(energy),
            _ => to_air,
        }
    }

    /// Returns the discharge of the parallel flow ahead of the opening.
    fn parallel(&self, energy: f64) -> f64 {
        let sill = self.strips.first().map_or(0.0, |[potential, _]| *potential);
        let energy = sill + LEFT * (energy - sill);
        let mut area = 0.0;
        let mut most = 0.0_f64;
        for [potential, strip] in &self.strips {
            area += strip;
            let speed = (2.0 * (energy - potential - self.rise)).max(0.0).sqrt();
            most = most.max(area * speed);
        }
        most
    }
}

/// Returns the highest potential in a box [m²/s²].
fn highest(space: &Space<'_>, ends: [[f64; 2]; 3]) -> f64 {
    let corner = |n: usize| std::array::from_fn(|a| ends[a][n >> a & 1]);
    let potentials = (0..8).map(|n| space.potential(corner(n)));
    potentials.fold(f64::NEG_INFINITY, f64::max)
}

/// Returns the largest energy of the water of stated velocities, and the largest kinetic energy of a discharge
/// through its whole opening [m²/s²].
fn of_inlets(scene: &Scene, (inflows, space): (&Inflows<'_>, &Space<'_>)) -> [f64; 2] {
    let grid = &scene.grid;
    let (mut jets, mut head) = (f64::NEG_INFINITY, 0.0_f64);
    for one in inflows.list.iter().filter(|one| one.range()[1] > 0.0) {
        let axis = one.patch.face.axis();
        let ends = one
            .patch
            .ends
            .map(|ends| ends.map(|end| end * grid.spacing));
        let across = (0..grid.dimension).filter(|a| *a != axis);
        let area: f64 = across.map(|a| ends[a][1] - ends[a][0]).product();
        if let Some(speed) = one.speed {
            let mut ends = ends;
            ends[axis] = [if one.patch.face.is_max() {
                grid.size[axis]
            } else {
                0.0
            }; 2];
            jets = jets.max(highest(space, ends) + 0.5 * speed * speed);
        } else {
            let speed = one.range()[1] / area;
            head = head.max(0.5 * speed * speed);
        }
    }
    [jets, head]
}
