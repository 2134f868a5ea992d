//! Water that openings bring in or take out at a rate that the case states: discharges and velocities, by tables and
//! with ramps.

use super::space::Space;
use crate::scene::Scene;
use crate::scene::boundaries::ScenePatch;
use crate::scene::flow::{Flow, PATH};
use base::history::TimeTable;
use base::number::real;
use lbm::boundary::Condition;

/// Number of equal parts of a time over which flows are summed, in addition to the rows of the tables.
const PARTS: u32 = 1000;
/// Part of the cells of an inlet that must be open so that it has its discharge, to which velocities are scaled.
const MOSTLY_OPEN: f64 = 0.6;

/// Returns `true` if a patch has a stated flow.
pub(super) fn is_stated(patch: &ScenePatch) -> bool {
    matches!(
        patch.condition,
        Condition::Discharge(_) | Condition::Velocity(_)
    )
}

/// Opening with a stated flow.
pub(super) struct Inflow<'a> {
    pub(super) patch: &'a ScenePatch,
    /// JSON path of the field that determines the flow.
    pub(super) path: String,
    /// Flow into the domain at a factor of one [m³/s, in 2-D m²/s].
    full: f64,
    factors: TimeTable,
    /// Time over which the flow grows from zero \[s\].
    ramp: f64,
    /// Largest speed of the water in the opening [m/s]; none if it follows from the depth.
    pub(super) speed: Option<f64>,
}

impl<'a> Inflow<'a> {
    /// Returns the stated flow of a patch; none if the water determines it, and for an inlet that solids cover.
    fn new(scene: &Scene, patch: &'a ScenePatch, space: &Space<'_>) -> Option<Self> {
        let path = |field: &str| patch.path(field).unwrap_or_default();
        let open = real(space.cells_inside(patch).len());
        let covered = open < MOSTLY_OPEN * patch.imposed_at(&scene.grid, PATH).area();
        let found = match &patch.condition {
            Condition::Discharge(one) => Self {
                patch,
                path: path(if one.history.is_some() {
                    "history"
                } else {
                    "value"
                }),
                full: if open > 0.0 { 1.0 } else { 0.0 },
                factors: TimeTable::new(one.history.as_deref(), one.value),
                ramp: 0.0,
                speed: None,
            },
            Condition::Velocity(one) => {
                let place = patch.imposed_at(&scene.grid, PATH);
                let face = scene
                    .grid
                    .spacing
                    .powi(if scene.grid.dimension == 3 { 2 } else { 1 });
                let full = one.mean_inflow(&place)? * place.area() * face;
                let speed = patch.condition.model().speed();
                Self {
                    patch,
                    path: path(speed.map_or("profile", |speed| speed.field)),
                    // Less enters through an inlet that is mostly covered; more never leaves than stated.
                    full: if covered && full > 0.0 { 0.0 } else { full },
                    factors: TimeTable::new(one.history.as_deref(), 1.0),
                    ramp: one.ramp_time.unwrap_or(0.0),
                    speed: speed.map(|speed| speed.value),
                }
            }
            _ => return None,
        };
        (found.full != 0.0).then_some(found)
    }

    /// Returns the flow into the domain at a time [m³/s, in 2-D m²/s].
    fn rate(&self, time: f64) -> f64 {
        let grown = if time < self.ramp {
            time / self.ramp
        } else {
            1.0
        };
        self.full * self.factors.value(time) * grown
    }

    /// Returns the smallest and the largest flow into the domain.
    pub(super) fn range(&self) -> [f64; 2] {
        let [one, other] = self.factors.range().map(|factor| factor * self.full);
        [one.min(other), one.max(other)]
    }
}

/// All openings with a stated flow.
pub(super) struct Inflows<'a> {
    pub(super) list: Vec<Inflow<'a>>,
}

impl<'a> Inflows<'a> {
    /// Returns the stated flows of a scene.
    pub(super) fn new(scene: &Scene, flow: &'a Flow, space: &Space<'_>) -> Self {
        let list = flow
            .patches()
            .filter_map(|patch| Inflow::new(scene, patch, space));
        Self {
            list: list.collect(),
        }
    }

    /// Returns the sum of the flows into the domain at a time; negative if more leaves.
    pub(super) fn rate(&self, time: f64) -> f64 {
        self.list.iter().map(|one| one.rate(time)).sum()
    }

    /// Returns intervals of time up to an end, between which no table changes its slope.
    pub(super) fn intervals(&self, end: f64) -> Vec<[f64; 2]> {
        let mut times: Vec<f64> = (0..=PARTS)
            .map(|n| end * f64::from(n) / f64::from(PARTS))
            .collect();
        for one in &self.list {
            let mut time = -1.0;
            times.extend(
                [one.ramp]
                    .into_iter()
                    .filter(|ramp| (0.0..end).contains(ramp)),
            );
            while let Some(next) = one.factors.next(time).filter(|next| *next < end) {
                time = next;
                times.extend([next].into_iter().filter(|next| *next > 0.0));
            }
        }
        times.sort_by(f64::total_cmp);
        let pairs = times.windows(2).map(|pair| [pair[0], pair[1]]);
        pairs.filter(|[from, to]| to > from).collect()
    }

    /// Returns the integral of a function of the flow of each opening up to an end.
    fn sum(&self, end: f64, part: impl Fn(f64) -> f64) -> f64 {
        let intervals = self.intervals(end).into_iter();
        let of = |[from, to]: [f64; 2]| -> f64 {
            let flows = self
                .list
                .iter()
                .map(|one| part(one.rate(0.5 * (from + to))));
            flows.sum::<f64>() * (to - from)
        };
        intervals.map(of).sum()
    }

    /// Returns the volume that enters until an end, less the stated volume that leaves [m³, in 2-D m²].
    pub(super) fn volume(&self, end: f64) -> f64 {
        self.sum(end, |flow| flow)
    }

    /// Returns the volume that enters until an end [m³, in 2-D m²].
    pub(super) fn entering(&self, end: f64) -> f64 {
        self.sum(end, |flow| flow.max(0.0))
    }

    /// Returns the stated volume that leaves until an end [m³, in 2-D m²].
    pub(super) fn leaving(&self, end: f64) -> f64 {
        self.sum(end, |flow| (-flow).max(0.0))
    }

    /// Returns the opening through which most water enters until an end.
    pub(super) fn largest(&self, end: f64) -> Option<&Inflow<'a>> {
        let volume = |one: &Inflow<'_>| {
            let parts = f64::from(PARTS);
            (0..PARTS)
                .map(|n| one.rate((f64::from(n) + 0.5) * end / parts))
                .sum::<f64>()
        };
        let all = self.list.iter().map(|one| (volume(one), one));
        let largest = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(largest.1)
    }

    /// Returns the names of the openings through which water enters.
    pub(super) fn names(&self) -> String {
        let enters = self.list.iter().filter(|one| one.range()[1] > 0.0);
        names(enters.map(|one| one.patch.name.as_str()))
    }

    /// Returns the openings through which water enters.
    pub(super) fn inlets(&self) -> Vec<&'a ScenePatch> {
        let enters = self.list.iter().filter(|one| one.range()[1] > 0.0);
        enters.map(|one| one.patch).collect()
    }
}

/// Returns the names of openings in one text.
pub(super) fn names<'a>(all: impl Iterator<Item = &'a str>) -> String {
    let all: Vec<String> = all.map(|name| format!("`{name}`")).collect();
    match all.as_slice() {
        [one @ .., last] if !one.is_empty() => format!("{} and {last}", one.join(", ")),
        [one] => one.clone(),
        _ => String::new(),
    }
}
