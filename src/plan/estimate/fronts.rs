//! Number of adaptive steps of transient unsaturated ground.
//!
//! An interval between two outputs has a whole number of steps, half a step more on average than they need; the first
//! step is a thousandth of an interval, and a step is at most twice the one before. Otherwise its error decides: with
//! the second-order method of the seepage the error of the content of a cell is g (1 - g) dt² θ'', with g = 1 - 1/√2. A
//! cell that a front passes within the time τ changes its content by Δθ along half a cosine, so that θ'' = π²/2 Δθ/τ²,
//! and the front needs
//!
//! ```text
//! n = [g (1 - g) π²/2 Δθ/ε]^½ / 0.9
//! ```
//!
//! steps for its own width w or a cell of width h, whichever is wider; ε is the stated error of the content.
//!
//! **Path of the front.** Behind a sharp front flows K Φ/L, with Φ the integral of the relative permeability over the
//! pressure head between both sides, and from above K k_r more (W. H. Green, G. A. Ampt, J. Agric. Sci. 4 (1911) 1):
//! L = (2 K Φ t/Δθ)^½ + K k_r t/Δθ, at most the extent of the ground. Rain below K moves at rate/Δθ.
//!
//! **Width.** The part of Φ under suction keeps the front wide, w = 0.3 L Φ_u/Φ: the content of a profile whose
//! diffusivity rises by orders of magnitude falls within the last third of the path. A water table that moves by ΔH is
//! inclined by ΔH/L, and a cell of height h_z is passed while it moves by L h_z/ΔH. With w = h + b L, b the sum of
//! both, the path has ln(1 + b L/h)/b widths.
//!
//! **Several fronts.** The one with most steps counts. The largest conductivity of all zones stands for layers.

use crate::scene::Scene;
use crate::scene::seepage::{Seepage, SeepagePatch};
use base::number::real;
use base::vector::norm;
use case::darcy::{InitialState, TransientFlow, ZonePermeability};
use darcy::Condition;
use darcy::retention::RetentionLaw;

/// Steps until a step is as long as an interval: 2^10 is about 1000.
const FIRST_STEPS: f64 = 10.0;
/// Product g (1 - g) π²/2.
const CURVATURE: f64 = 1.022;
/// Ratio of a step to that with the stated error.
const SAFETY: f64 = 0.9;
/// Width of a front in unsaturated ground relative to its path, chosen by the steps of the example `infiltration`.
const WIDTH: f64 = 0.3;
/// Number of parts of an integral over the pressure head.
const PARTS: usize = 200;

/// Returns the number of adaptive steps in all intervals.
pub(super) fn adaptive_steps(
    scene: &Scene,
    seepage: &Seepage,
    flow: &TransientFlow,
    intervals: f64,
) -> f64 {
    let ground = Ground::new(scene, seepage);
    let fronts = seepage.patches.iter().flat_map(|patch| {
        let changes = ground.as_ref().map(|ground| ground.changes(flow, patch));
        changes
            .into_iter()
            .flatten()
            .map(move |change| (patch, change))
    });
    let steps = fronts.filter_map(|(patch, change)| {
        let ground = ground.as_ref()?;
        let [content, widths] = ground.front(patch, change)?;
        Some(widths * (CURVATURE * content / flow.content_error).sqrt() / SAFETY)
    });
    let fastest = steps.fold(0.0, f64::max);
    let whole = if fastest > intervals {
        fastest + 0.5 * intervals
    } else {
        intervals - 1.0
    };
    FIRST_STEPS + whole
}

/// Change at a part of the surface of the ground.
#[derive(Clone, Copy)]
struct Change {
    /// Pressure heads before and after \[m\].
    heads: [f64; 2],
    /// Change of the water table in front of the ground \[m\]; none for other changes.
    table: Option<f64>,
    /// Stated inflow \[m/s\]; none where the pressure is stated.
    inflow: Option<f64>,
}

/// Unsaturated ground.
struct Ground<'a> {
    scene: &'a Scene,
    seepage: &'a Seepage,
    soil: &'a dyn RetentionLaw,
    /// Weight of the water \[N/m3\].
    weight: f64,
    /// Largest hydraulic conductivity of a zone \[m/s\].
    conductivity: f64,
    /// Upward direction.
    up: [f64; 3],
}

impl<'a> Ground<'a> {
    /// Returns the ground; none if no zone states a permeability or nothing has a weight.
    fn new(scene: &'a Scene, seepage: &'a Seepage) -> Option<Self> {
        let written = &seepage.written;
        let strength = norm(scene.gravity);
        let weight = written.density * strength;
        let zones = written.zones.iter().filter_map(|zone| zone.permeability);
        let conductivity = zones
            .map(|stated| match stated {
                ZonePermeability::Value(k) => k * weight / written.viscosity,
                ZonePermeability::HydraulicConductivity(k) => k,
                _ => 0.0,
            })
            .fold(0.0, f64::max);
        (weight > 0.0 && conductivity > 0.0).then_some(Self {
            scene,
            seepage,
            soil: written.unsaturated.as_ref()?.retention.model(),
            weight,
            conductivity,
            up: scene.gravity.map(|g| -g / strength),
        })
    }

    /// Returns the elevation of the middle of a patch \[m\].
    fn elevation(&self, patch: &SeepagePatch) -> f64 {
        let grid = self.seepage.coarse_grid(self.scene.grid.dimension);
        let last = patch.to.map(|to| to.saturating_sub(1));
        let [first, last] = [patch.from, last].map(|cell| grid.centre(cell));
        let middle = |a: usize| 0.5 * (first[a] + last[a]);
        (0..3).map(|a| self.up[a] * middle(a)).sum()
    }

    /// Returns the changes from the initial state at a patch.
    fn changes(&self, flow: &TransientFlow, patch: &SeepagePatch) -> Vec<Change> {
        let elevation = self.elevation(patch);
        let beside = self.up[patch.face.axis()].abs() < 0.5;
        let [stated, is_head, is_rate] = match patch.condition {
            Condition::Pressure { value } => [Some(value), None, None],
            Condition::Head { value } => [None, Some(value), None],
            Condition::SeepageFace { level } => [None, level, None],
            Condition::Rain { rate: value } | Condition::Flux { value } => {
                [None, None, Some(value)]
            }
            _ => [None; 3],
        };
        let Some(first) = stated.or(is_head).or(is_rate) else {
            return Vec::new();
        };
        let values = std::iter::once(first).chain(patch.history.iter().map(|row| row[1]));
        let head = |value: f64| match (stated, is_head) {
            (Some(_), _) => value / self.weight,
            (_, Some(_)) => value - elevation,
            _ => self.head_of(value),
        };
        let before = match flow.initial {
            InitialState::PressureHead(head) => head,
            InitialState::Head(level) => level - elevation,
            InitialState::Steady => head(first),
        };
        let change = |value: f64| {
            let mut heads = [before, head(value)];
            let table = (heads[1] - heads[0]).abs();
            let moves = beside
                && is_head.is_some()
                && !matches!(flow.initial, InitialState::PressureHead(_));
            if moves {
                // Halfway between both levels the content changes most.
                heads = [-0.5 * table, 0.5 * table];
            }
            Change {
                heads,
                table: moves.then_some(table),
                inflow: is_rate
                    .map(|_| value)
                    .filter(|rate| *rate < self.conductivity),
            }
        };
        values.map(change).collect()
    }

    /// Returns the change of the content in a front, and the number of its widths along its path; none if nothing
    /// moves.
    fn front(&self, patch: &SeepagePatch, change: Change) -> Option<[f64; 2]> {
        let [low, high] = [f64::min, f64::max].map(|of| of(change.heads[0], change.heads[1]));
        let [dry, wet] = [low, high].map(|head| self.soil.state(head));
        let content = wet.content - dry.content;
        let whole = self.potential(low, high);
        if content <= 0.0 || whole <= 0.0 {
            return None;
        }
        let (axis, time) = (patch.face.axis(), self.scene.time.end);
        let above = self.up[axis] * if patch.face.is_max() { 1.0 } else { -1.0 };
        let from_above = self.conductivity * wet.log_permeability.exp() * above.max(0.0);
        let path = match change.inflow {
            Some(rate) => rate.max(0.0) * time / content,
            None => {
                let drawn = (2.0 * self.conductivity * whole * time / content).sqrt();
                drawn + from_above * time / content
            }
        };
        let spacing = &self.seepage.spacing;
        let rise: f64 = (0..3).map(|a| self.up[a].abs() * spacing[a]).sum();
        let inclined = change.table.map_or(0.0, |table| rise / table);
        let under_suction = self.potential(low, high.clamp(low, low.max(0.0)));
        let wider = WIDTH * under_suction / whole + inclined;
        let cells = path.min(self.scene.grid.size[axis]) / spacing[axis];
        let widths = if wider > 0.0 {
            (wider * cells).ln_1p() / wider
        } else {
            cells
        };
        Some([content, widths])
    }

    /// Returns the integral of the relative permeability over the pressure head \[m\], in parts that grow with the
    /// distance from saturation.
    fn potential(&self, low: f64, high: f64) -> f64 {
        let length = self.soil.capillary_length();
        let [from, to] = [low, high].map(|head| (head / length).asinh());
        let part = (to - from) / real(PARTS);
        let middle = (0..PARTS).map(|n| from + (real(n) + 0.5) * part);
        let value = |x: f64| {
            let state = self.soil.state(length * x.sinh());
            state.log_permeability.exp() * length * x.cosh()
        };
        middle.map(value).sum::<f64>() * part
    }

    /// Returns the pressure head \[m\] at which water falls at a rate \[m/s\]; 0 at saturation.
    fn head_of(&self, rate: f64) -> f64 {
        let length = self.soil.capillary_length();
        let (mut dry, mut wet) = ((-1e6_f64).asinh(), 0.0);
        for _ in 0..60 {
            let middle = 0.5 * (dry + wet);
            let relative = self
                .soil
                .state(length * middle.sinh())
                .log_permeability
                .exp();
            if self.conductivity * relative < rate {
                dry = middle;
            } else {
                wet = middle;
            }
        }
        length * wet.sinh()
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::{Document, examples};
    use std::path::Path;

    /// Compares the number of steps with that of runs: infiltration into a dry column, a drawdown, and rain that the
    /// interval of the outputs limits.
    #[test]
    fn steps_are_those_of_runs() {
        let steps = |name: &str, set: &[&str]| {
            let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
            let text = examples::find(name).unwrap().text;
            let plan = Document::read(text, &set, Path::new("."))
                .and_then(Plan::prepare)
                .unwrap();
            let seepage = plan.scene.seepage.as_ref().unwrap();
            let soil = seepage.written.unsaturated.as_ref().unwrap();
            let intervals = base::number::real(plan.clock.steps);
            super::adaptive_steps(
                &plan.scene,
                seepage,
                soil.transient.as_ref().unwrap(),
                intervals,
            )
        };
        let half = "time.end=43200";
        for (found, counted) in [
            (steps("infiltration", &[]), 144.0),
            (steps("infiltration", &[half]), 106.0),
            (steps("drawdown", &[]), 229.0),
        ] {
            let ratio = found / counted;
            assert!((0.7..1.4).contains(&ratio), "{found} for {counted}");
        }
    }
}
