//! Stability of water with a free surface at an opening with a level.
//!
//! Water runs between the level outside and the level inside, with up to U = (2 g d)^½ for a difference d. Stability
//! depends on the cell Reynolds number U h/ν: `benches/stability/levels.csv` has runs of a tank that fills or empties.
//!
//! A level that changes slowly never differs that much from the level inside. In a basin of plan area A with this
//! opening alone, of width b and depth D, a rate r drives A r/(b D) through the opening when the water follows, and
//! twice as much while the wave runs to the other end and back (linear long waves: u = (g/D)^½ r t until t = 2 L/(g
//! D)^½). This counts for tables that start at the level inside and do not jump, without structures, whose level keeps
//! its direction for several such times, so that no sloshing adds up.
//!
//! **From one opening to another.** Water that stands higher at another opening, by d, runs to the lower level with
//! up to (2 g d)^½, and leaves with the discharge Q of the narrowest passage over the wet area A of the opening: U
//! = Q/A, at most (2 g d)^½. A column of a section passes at most a (2 g d)^½ per width through its open height a,
//! and (2/3)^1.5 g^½ H^1.5, the critical flow, below the head H over its lowest open point: the first is the limit
//! of a closed passage, the second that of a weir. `benches/stability/culverts.csv` has runs of culverts and open
//! basins: the cell Reynolds number U h/ν separates them, the lattice velocity does not. With one rate and an eddy
//! viscosity all runs up to a Froude number U/(g D)^½ of 0.14 finished, D the depth at the opening, and most of the
//! others. Two rates without an eddy viscosity failed from 10 on. The limits of the remaining operators are those of an
//! earlier law of the opening, which reflected what left. Where a tank fills or empties, the limits are of the earlier
//! law as well, except with one rate and an eddy viscosity; with the present law twice as much holds.

use super::margin::{Margin, margin};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::free_surface::{FreeSurface, Opening};
use base::error::Remedy;
use base::number::real;
use lbm::boundary::Condition;
use lbm::collision::Operator;
use serde_json::json;

/// Factor by which a value written with few digits may exceed its bound.
const BOUND_SLACK: f64 = 1.0 + 1e-6;

/// Outcome of the runs of a table with an operator, by cell Reynolds number.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    /// Largest number below `fails` with which the plan expects a run to finish.
    holds: f64,
    /// Smallest number with which a run failed.
    fails: f64,
    /// Failed runs, and all runs, from `fails` on, where most of them finished; none where higher numbers failed.
    few: Option<[u32; 2]>,
}

impl Outcome {
    /// Returns the outcome of an operator with which all runs failed from some number on.
    fn sharp(holds: f64, fails: f64) -> Self {
        Self {
            holds,
            fails,
            few: None,
        }
    }

    /// Returns `true` if most runs with a cell Reynolds number finished.
    fn mostly_holds(&self, cell: f64) -> bool {
        cell <= self.holds || self.few.is_some()
    }

    /// Returns `true` if a number is one with which runs failed.
    fn is_unstable(&self, cell: f64) -> bool {
        self.few.is_none() && cell >= self.fails
    }

    /// Returns what the runs of a table showed.
    fn told(&self, table: &str) -> String {
        let (holds, fails) = (number(self.holds), number(self.fails));
        let beyond = match self.few {
            Some([failed, all]) => format!("; from {fails} on {failed} of {all} failed"),
            None => format!(" and failed at {fails} and above"),
        };
        format!(
            "runs of `benches/stability/{table}` with this operator finished up to {holds}{beyond}"
        )
    }
}

/// Returns the outcome of the runs of `levels.csv`; none for operators that were not run.
fn of_filling(operator: &Operator, eddies: bool) -> Option<Outcome> {
    match (operator, eddies) {
        (Operator::Trt(_), false) => Some(Outcome::sharp(3.0, 4.0)),
        (Operator::Trt(_), true) => Some(Outcome::sharp(3.0, 7.0)),
        (Operator::Bgk(_), false) => Some(Outcome::sharp(7.0, 15.0)),
        (Operator::Bgk(_), true) => Some(Outcome {
            holds: 7.0,
            fails: 15.0,
            few: Some([2, 30]),
        }),
        _ => None,
    }
}

/// Returns the outcome of the runs of `culverts.csv`, whose water arrives from another opening, and the largest Froude
/// number at an opening up to which no run failed, 0 where some did.
fn of_arriving(operator: &Operator, eddies: bool) -> Option<(Outcome, f64)> {
    match (operator, eddies) {
        (Operator::Bgk(_), true) => {
            let runs = Outcome {
                holds: 500.0,
                fails: 4000.0,
                few: Some([2, 6]),
            };
            Some((runs, 0.1415))
        }
        (Operator::Trt(_), false) => Some((Outcome::sharp(5.0, 10.0), 0.0)),
        (Operator::Bgk(_) | Operator::Trt(_), _) => Some((Outcome::sharp(5.0, 12.0), 0.0)),
        _ => None,
    }
}

/// Adds the margin of each opening with a level, and a finding if similar runs failed.
pub(super) fn check(
    scene: &Scene,
    flow: &Flow,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let Some(surface) = &scene.surface else {
        return;
    };
    for (n, opening) in surface.openings.iter().enumerate() {
        let Some([low, high]) = opening.levels() else {
            continue;
        };
        let arriving = Arriving::reaching(scene, flow, surface, n);
        let judged = check_filling(
            (scene, flow, surface),
            opening,
            [low, high],
            margins,
            findings,
        );
        if let Some(arriving) = arriving.filter(|_| !judged) {
            arriving.check(scene, flow, opening, margins, findings);
        }
    }
}

/// Adds the margin of the flow between the level outside, between `low` and `high` \[m\], and the level inside; returns
/// `true` if it has a finding.
fn check_filling(
    (scene, flow, surface): (&Scene, &Flow, &FreeSurface),
    opening: &Opening,
    [low, high]: [f64; 2],
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) -> bool {
    let Some(runs) = of_filling(&flow.models.collision, flow.models.turbulence.is_some()) else {
        return false;
    };
    let inside = opening.inside;
    let difference = (high - inside).abs().max((low - inside).abs());
    let sudden = (2.0 * surface.gravity * difference).sqrt();
    let slow = filling_speed(scene, flow, surface, opening).filter(|slow| *slow < sudden);
    let speed = slow.unwrap_or(sudden);
    let cell = speed * scene.grid.spacing / flow.kinematic_viscosity;
    if speed <= 0.0 {
        return false;
    }
    let name = format!("cell Reynolds number U h/nu: the level `{}`", opening.name);
    margins.push(margin(&name, cell, runs.holds, &opening.path));
    if cell <= runs.holds * BOUND_SLACK {
        return false;
    }
    let cause = if slow.is_some() {
        format!(
            "a level that changes by up to {} m along its table gives",
            number(difference)
        )
    } else {
        format!("levels that differ by {} m give", number(difference))
    };
    let reason = format!(
        "{cause} a cell Reynolds number U h/nu of {}, with U = {} m/s: {}",
        number(cell),
        number(speed),
        runs.told("levels.csv")
    );
    let remedy = remedy(scene, flow, cell, cell / runs.holds);
    if runs.is_unstable(cell) {
        findings.unstable(&opening.path, reason, remedy);
    } else {
        findings.warn(&opening.path, reason, remedy);
    }
    true
}

/// Maximum number of samples of a section along each of its axes, and of sections.
const SAMPLES: usize = 100;
const SECTIONS: usize = 500;

/// Returns the largest discharge [m²/s in 2-D, m³/s in 3-D] that the structures let pass along an axis below a head
/// \[m\] at the speed of the whole difference, `free` [m/s]: see the head of the file.
fn narrowest(scene: &Scene, surface: &FreeSurface, axis: usize, [head, free]: [f64; 2]) -> f64 {
    let (grid, up) = (&scene.grid, surface.axis);
    let solids: Vec<_> = (scene.structures.iter())
        .filter(|structure| structure.stops.water())
        .collect();
    let side = (0..grid.dimension).find(|a| *a != axis && *a != up);
    let samples = |a: usize, most: usize| grid.cells[a].min(most);
    let (along, high) = (samples(axis, SECTIONS), samples(up, 4 * SAMPLES));
    let wide = side.map_or(1, |a| samples(a, SAMPLES));
    let middle = |n: usize, count: usize, size: f64| (real(n) + 0.5) * size / real(count);
    let (step, width) = (
        grid.size[up] / real(high),
        side.map_or(1.0, |a| grid.size[a] / real(wide)),
    );
    let critical = (2.0_f64 / 3.0).powf(1.5) * surface.gravity.sqrt();
    let column = |x: usize, y: usize| {
        let mut at = [0.0; 3];
        at[axis] = middle(x, along, grid.size[axis]);
        if let Some(a) = side {
            at[a] = middle(y, wide, grid.size[a]);
        }
        let (mut open, mut lowest) = (0.0, f64::INFINITY);
        for z in 0..high {
            let height = middle(z, high, grid.size[up]);
            at[up] = surface.above(height);
            let below = height < head;
            if below && !solids.iter().any(|one| one.solid.distance(at) < 0.0) {
                open += step;
                lowest = lowest.min(height - 0.5 * step);
            }
        }
        let fall = (head - lowest).max(0.0);
        width * (open * free).min(critical * fall.powf(1.5))
    };
    let section = |x: usize| (0..wide).map(|y| column(x, y)).sum::<f64>();
    (0..along).map(section).fold(f64::INFINITY, f64::min)
}

/// Water that runs from another opening to one with a lower level.
struct Arriving {
    /// Head over the lower level \[m\].
    difference: f64,
    /// Mean speed at the lower opening [m/s].
    speed: f64,
    /// Ratio of this speed to that of the whole head.
    share: f64,
    /// Froude number at the opening.
    froude: f64,
}

impl Arriving {
    /// Returns the water that arrives at opening `n`; none if its level is the highest.
    fn reaching(scene: &Scene, flow: &Flow, surface: &FreeSurface, n: usize) -> Option<Self> {
        let opening = &surface.openings[n];
        let [low, _] = opening.levels()?;
        let others = surface.openings.iter().enumerate();
        let heads = others.filter(|(other, _)| *other != n);
        let head = heads
            .filter_map(|(_, other)| other.head)
            .fold(0.0, f64::max);
        let (difference, depth) = (head - low, low - opening.floor);
        if difference <= 0.0 || depth <= 0.0 {
            return None;
        }
        let (grid, up) = (&scene.grid, surface.axis);
        let free = (2.0 * surface.gravity * difference).sqrt();
        let patch = flow.patches().find(|patch| patch.name == opening.name)?;
        let axis = patch.face.axis();
        let width: f64 = (0..grid.dimension)
            .filter(|a| *a != axis && *a != up)
            .map(|a| (patch.ends[a][1] - patch.ends[a][0]) * grid.spacing)
            .product();
        let passed = narrowest(scene, surface, axis, [head, free]);
        let speed = free.min(passed / (width * depth));
        let froude = speed / (surface.gravity * depth).sqrt();
        Some(Self {
            difference,
            speed,
            share: speed / free,
            froude,
        })
    }

    /// Adds the margin, and a finding if similar runs failed.
    fn check(
        &self,
        scene: &Scene,
        flow: &Flow,
        opening: &Opening,
        margins: &mut Vec<Margin>,
        findings: &mut Findings,
    ) {
        let found = of_arriving(&flow.models.collision, flow.models.turbulence.is_some());
        let Some((runs, _)) = found.filter(|(_, calm)| self.froude > *calm) else {
            return;
        };
        let cell = self.speed * scene.grid.spacing / flow.kinematic_viscosity;
        let name = format!(
            "cell Reynolds number U h/nu: the flow to the level `{}`",
            opening.name
        );
        margins.push(margin(&name, cell, runs.holds, &opening.path));
        if cell <= runs.holds * BOUND_SLACK {
            return;
        }
        let through = if self.share < 1.0 {
            format!(
                ", through a passage that limits its mean speed here to {} % of (2 g d)^1/2,",
                number(100.0 * self.share)
            )
        } else {
            String::new()
        };
        let reason = format!(
            "water from an opening with a head {} m higher{through} reaches this one with a cell Reynolds number U \
             h/nu of {}, with U = {} m/s: {}",
            number(self.difference),
            number(cell),
            number(self.speed),
            runs.told("culverts.csv")
        );
        let remedy = self.remedy(scene, flow, cell);
        if runs.is_unstable(cell) {
            findings.unstable(&opening.path, reason, remedy);
        } else {
            findings.warn(&opening.path, reason, remedy);
        }
    }

    /// Returns settings with which runs finished.
    fn remedy(&self, scene: &Scene, flow: &Flow, cell: f64) -> Remedy {
        let bgk = Operator::Bgk(lbm::collision::bgk::BgkParameters {});
        let here = of_arriving(&flow.models.collision, flow.models.turbulence.is_some());
        let factor = here.map_or(1.0, |(runs, _)| cell / runs.holds);
        let finer = format!(
            "let the water leave by an outfall (`{{\"outfall\": {{}}}}`), or use a viscosity of at least {} m2/s or a \
             spacing of at most {} m",
            number(flow.kinematic_viscosity * factor),
            number(scene.grid.spacing / factor),
        );
        let already = here.is_some_and(|(runs, _)| runs.few.is_some());
        let holds = |(runs, _): (Outcome, f64)| runs.mostly_holds(cell);
        if !already && of_arriving(&bgk, true).is_some_and(holds) {
            Remedy::from(format!(
                "use the eddy viscosity `smagorinsky` with the operator `bgk`, or {finer}"
            ))
            .set(format!("{PATH}.turbulence"), json!({"smagorinsky": {}}))
            .set(format!("{PATH}.collision"), json!({"bgk": {}}))
        } else {
            Remedy::from(finer)
        }
    }
}

/// Times of a wave along the basin and back for which a level must keep its direction.
const NO_SLOSHING: f64 = 4.0;

/// Returns the largest speed [m/s] with which water follows the table of the level outside, as the head of the file
/// says;
/// `None` where the whole difference may act at once.
fn filling_speed(
    scene: &Scene,
    flow: &Flow,
    surface: &FreeSurface,
    opening: &Opening,
) -> Option<f64> {
    let mut patches = flow.patches();
    let patch = patches.find(|patch| patch.name == opening.name)?;
    let Condition::Level(level) = &patch.condition else {
        return None;
    };
    let table = level.history.as_ref()?;
    let (up, normal) = (surface.axis, patch.face.axis());
    let structures = scene.structures.iter().any(|s| s.stops.water());
    if surface.openings.len() != 1 || structures || normal == up {
        return None;
    }
    let grid = &scene.grid;
    let start = surface.above(table.first()?[1]);
    if (start - opening.inside).abs() > 1e-6 * grid.size[up] {
        return None;
    }
    let depth = opening.levels()?[0].min(opening.inside) - opening.floor;
    let (mut rate, mut turned, mut direction) = (0.0_f64, f64::NEG_INFINITY, 0.0);
    let back = 2.0 * grid.size[normal] / (surface.gravity * depth.max(0.0)).sqrt();
    for rows in table.windows(2) {
        let [[from, low], [to, high]] = [rows[0], rows[1]];
        if to <= from && high.to_bits() != low.to_bits() {
            return None;
        }
        if high.to_bits() == low.to_bits() {
            continue;
        }
        rate = rate.max((high - low).abs() / (to - from));
        let now = (high - low).signum();
        if now * direction < 0.0 {
            if from - turned < NO_SLOSHING * back {
                return None;
            }
            turned = from;
        } else if direction == 0.0 {
            turned = from;
        }
        direction = now;
    }
    let across = |sizes: [f64; 3]| -> f64 {
        (0..grid.dimension)
            .filter(|a| *a != up && *a != normal)
            .map(|a| sizes[a])
            .product()
    };
    let width = across(patch.ends.map(|ends| (ends[1] - ends[0]) * grid.spacing));
    let area = grid.size[normal] * across(grid.size);
    (depth > 0.0 && width > 0.0).then(|| 2.0 * area * rate / (width * depth))
}

/// Returns settings with which runs finished at this cell Reynolds number, or the viscosity and the spacing that reduce
/// it by a factor.
fn remedy(scene: &Scene, flow: &Flow, cell: f64, factor: f64) -> Remedy {
    let finer = format!(
        "a viscosity of at least {} m2/s, or a spacing of at most {} m",
        number(flow.kinematic_viscosity * factor),
        number(scene.grid.spacing / factor),
    );
    let single = |eddies: bool| {
        let bgk = Operator::Bgk(lbm::collision::bgk::BgkParameters {});
        of_filling(&bgk, eddies).is_some_and(|runs| runs.mostly_holds(cell))
    };
    let here = of_filling(&flow.models.collision, flow.models.turbulence.is_some());
    let already = here.is_some_and(|runs| runs.few.is_some());
    let collision = format!("{PATH}.collision");
    let eddies = flow.models.turbulence.is_some();
    if already {
        Remedy::from(format!("use {finer}"))
    } else if single(eddies) {
        Remedy::from(format!("use the operator `bgk`, or {finer}"))
            .set(collision, json!({"bgk": {}}))
    } else if single(true) {
        Remedy::from(format!(
            "use the eddy viscosity `smagorinsky` with the operator `bgk`, or {finer}"
        ))
        .set(format!("{PATH}.turbulence"), json!({"smagorinsky": {}}))
        .set(collision, json!({"bgk": {}}))
    } else {
        Remedy::from(format!("use {finer}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plan;
    use base::error::Severity;
    use case::Document;
    use std::path::Path;

    /// Returns the findings on a level of 0.2 m in front of water of 0.1 m, at a viscosity \[m2/s\].
    fn found(viscosity: f64, set: &[String]) -> String {
        let case = serde_json::json!({
            "domain": {"size": [0.6, 0.3], "spacing": 0.005},
            "gravity": [0, -9.81],
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": viscosity, "time_step": 1e-4,
                "surface": {"water": [{"level": 0.1}]},
                "boundaries": [{"name": "in", "face": "x_min", "condition": {"level": {"value": 0.2}}}]
            }},
            "time": {"end": 1}
        });
        let document = Document::read(&case.to_string(), set, Path::new(".")).unwrap();
        let warnings = Plan::prepare(document).unwrap().warnings;
        let texts: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        texts.join("\n")
    }

    /// Checks a basin of 1 m at which the level rises by 0.1 m: the speed of linear long waves is 2 L r/D = 0.1 m/s for
    /// a rise within 20 s and 0.001 m/s within 2000 s; a rise within 0.1 s is judged as a sudden one.
    #[test]
    fn a_level_that_rises_slowly_is_judged_by_its_rate() {
        let found = |seconds: f64| {
            let case = serde_json::json!({
                "domain": {"size": [1.0, 0.4], "spacing": 0.02},
                "gravity": [0, -9.81],
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 5e-4,
                    "surface": {"water": [{"level": 0.1}]},
                    "boundaries": [{"name": "sea", "face": "x_min",
                        "condition": {"level": {"value": 0.1, "history": [[0, 0.1], [seconds, 0.2]]}}}]
                }},
                "time": {"end": 2.0 * seconds}
            });
            let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
            let plan = Plan::prepare(document).unwrap();
            let mut margins = plan.margins.iter();
            let cell = margins.find(|margin| margin.limit.contains("level `sea`"));
            (
                cell.unwrap().value,
                plan.warnings
                    .iter()
                    .any(|p| p.to_string().contains("cell Reynolds number")),
            )
        };
        for seconds in [20.0, 2000.0] {
            let (cell, judged) = found(seconds);
            approx::assert_relative_eq!(cell, 40.0 / seconds, max_relative = 1e-6);
            assert!(!judged);
        }
        let (cell, judged) = found(0.1);
        approx::assert_relative_eq!(
            cell,
            20.0 * (2.0 * 9.81 * 0.1_f64).sqrt(),
            max_relative = 1e-6
        );
        assert!(judged);
    }

    /// Returns severity and reason of the finding on the flow from a level of 0.3 m to one of 0.2 m, or to another
    /// condition, below a wall with a slot or over a sill.
    fn between(
        viscosity: f64,
        outlet: &serde_json::Value,
        walls: &serde_json::Value,
    ) -> Vec<(Severity, String)> {
        let case = serde_json::json!({
            "domain": {"size": [1.0, 0.4], "spacing": 0.01},
            "gravity": [0, -9.81],
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": viscosity, "time_step": 2e-4,
                "collision": {"bgk": {}}, "turbulence": {"smagorinsky": {}},
                "surface": {"water": [{"shape": {"box": {"from": [0, 0], "to": [0.5, 0.3]}}},
                    {"shape": {"box": {"from": [0.5, 0], "to": [1, 0.2]}}}]},
                "boundaries": [
                    {"name": "in", "face": "x_min", "condition": {"level": {"value": 0.3}}},
                    {"name": "out", "face": "x_max", "condition": outlet}
                ]
            }},
            "structures": walls,
            "time": {"end": 1}
        });
        let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
        let warnings = Plan::prepare(document).unwrap().warnings;
        let found = warnings
            .into_iter()
            .filter(|p| p.reason.contains("head 0."));
        found
            .map(|p| (p.severity, format!("{}: {p}", p.path)))
            .collect()
    }

    /// Checks that the limits are those of the table: the smallest cell Reynolds number of a failed run, the largest of
    /// a finished one below it, and the Froude number up to which no run failed.
    #[test]
    fn limits_of_arriving_water_are_those_of_the_table() {
        let table = include_str!("../../benches/stability/culverts.csv");
        let rows: Vec<Vec<&str>> = table
            .lines()
            .filter(|line| !line.starts_with('#'))
            .skip(1)
            .map(|line| line.split(',').collect())
            .collect();
        let trt: Operator = serde_json::from_value(json!({"trt": {}})).unwrap();
        let bgk: Operator = serde_json::from_value(json!({"bgk": {}})).unwrap();
        for (name, operator) in [("trt", &trt), ("bgk", &bgk)] {
            for (eddies, word) in [(false, "none"), (true, "smagorinsky")] {
                let (runs, calm) = of_arriving(operator, eddies).unwrap();
                let mine = rows.iter().filter(|row| row[0] == name && row[1] == word);
                let number = |row: &[&str], n: usize| row[n].parse::<f64>().unwrap();
                // Calm flows are not judged by the cell Reynolds number.
                let judged = mine.filter(|row| number(row, 8) > calm);
                let (finished, failed): (Vec<_>, Vec<_>) =
                    judged.partition(|row| row[9] == "finished");
                assert!(finished.len() >= 12 && !failed.is_empty());
                let least = failed
                    .iter()
                    .map(|row| number(row, 7))
                    .fold(f64::INFINITY, f64::min);
                approx::assert_relative_eq!(least, runs.fails);
                let below = finished
                    .iter()
                    .map(|row| number(row, 7))
                    .filter(|cell| *cell < least);
                let held = below.fold(0.0, f64::max);
                if (name, eddies) == ("trt", false) {
                    // Few runs lie between 5 and 10.
                    assert!(runs.holds <= held && held < runs.fails);
                } else {
                    approx::assert_relative_eq!(held, runs.holds);
                }
                let beyond = finished.iter().filter(|row| number(row, 7) >= least);
                let all = beyond.count() + failed.len();
                if let Some(few) = runs.few {
                    assert_eq!(few.map(|n| n as usize), [failed.len(), all]);
                }
            }
        }
        let calm_ones = rows
            .iter()
            .filter(|row| row[0] == "bgk" && row[1] == "smagorinsky");
        let calm = |row: &&Vec<&str>| row[8].parse::<f64>().unwrap() <= 0.1415;
        assert!(calm_ones.filter(calm).all(|row| row[9] == "finished"));
    }

    /// Checks rows of `benches/stability/culverts.csv`, whose runs have a slot of 0.08 m and a level of 0.2 m: a cell
    /// Reynolds number of 10,000 in the slot is 4000 at the opening. Neither an outfall nor a small difference of the
    /// levels has a finding.
    #[test]
    fn a_culvert_between_levels_is_judged_by_the_flow_at_the_lower_one() {
        let level = |value: f64| serde_json::json!({"level": {"value": value}});
        let slot = serde_json::json!([
            {"name": "wall", "shape": {"box": {"from": [0.4, 0.13], "to": [0.6, 2]}}},
            {"name": "sill", "shape": {"box": {"from": [0.4, -1], "to": [0.6, 0.05]}}}
        ]);
        let viscosity = |cell: f64| (2.0 * 9.81 * 0.1_f64).sqrt() * 0.01 / cell;
        assert_eq!(between(viscosity(1000.0), &level(0.2), &slot), []);
        let warned = between(viscosity(10_000.0), &level(0.2), &slot);
        assert_eq!(warned.len(), 1, "{warned:?}");
        assert_eq!(warned[0].0, Severity::Warning, "{warned:?}");
        assert!(warned[0].1.contains("boundaries[1]"), "{warned:?}");
        assert!(warned[0].1.contains("to 40 %"), "{warned:?}");
        assert!(warned[0].1.contains("2 of 6 failed"), "{warned:?}");
        assert_eq!(
            between(1e-6, &serde_json::json!({"outfall": {}}), &slot),
            []
        );
        assert_eq!(between(1e-6, &level(0.299), &serde_json::json!([])), []);
        let weir = |crest: f64| {
            let shape = serde_json::json!({"box": {"from": [0.4, -1], "to": [0.6, crest]}});
            serde_json::json!([{"name": "weir", "shape": shape}])
        };
        assert_eq!(between(1e-6, &level(0.2), &weir(0.23)), []);
        assert_eq!(between(1e-6, &level(0.2), &weir(0.1)).len(), 1);
    }

    #[test]
    fn a_level_is_unstable_where_runs_failed() {
        assert!(!found(3e-3, &[]).contains("levels that differ"));
        let problem = found(1.1e-3, &[]);
        assert!(problem.contains("levels that differ by 0.1 m"), "{problem}");
        assert!(problem.contains("use the operator `bgk`"), "{problem}");
        let bgk = r#"fluid.lattice_boltzmann.collision={"bgk": {}}"#.to_owned();
        assert!(!found(1.1e-3, &[bgk]).contains("levels that differ"));
    }

    /// Checks that no remedy of a culvert leads to another unstable case: heads of 0.1 to 1 m over the lower level, and
    /// slots of 3 to 20 cells. Each remedy is applied, and the case planned again.
    #[test]
    fn remedies_of_culverts_pass_the_same_judge() {
        let mut applied = 0;
        for head in [0.1, 0.3, 1.0] {
            for gap in [3.0, 6.0, 12.0, 20.0] {
                for cell in [20.0, 100.0, 1000.0] {
                    for collision in ["trt", "bgk"] {
                        applied += unstable_after_remedies([head, gap, cell], collision);
                    }
                }
            }
        }
        assert!(applied >= 10, "{applied}");
    }

    /// Applies the remedy of each unstable finding of a culvert with this head \[m\], gap \[cells\] and cell Reynolds
    /// number in the gap, and returns how many were applied.
    fn unstable_after_remedies([head, gap, cell]: [f64; 3], collision: &str) -> usize {
        let spacing = 0.01;
        let low = 0.3;
        let speed = (2.0 * 9.81 * head).sqrt();
        let (top, roof) = (1.5 * (low + head), 0.05 + gap * spacing);
        let height = spacing * (top / spacing).round();
        let case = json!({
            "domain": {"size": [1.0, height], "spacing": spacing},
            "gravity": [0, -9.81],
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": speed * spacing / cell, "time_step": 0.05 * spacing / speed,
                "collision": {collision: {}},
                "surface": {"water": [{"shape": {"box": {"from": [0, 0], "to": [0.5, low + head]}}},
                    {"shape": {"box": {"from": [0.5, 0], "to": [1, low]}}}]},
                "boundaries": [
                    {"name": "in", "face": "x_min", "condition": {"level": {"value": low + head}}},
                    {"name": "out", "face": "x_max", "condition": {"level": {"value": low}}}
                ]
            }},
            "structures": [
                {"name": "wall", "shape": {"box": {"from": [0.4, roof], "to": [0.6, 9]}}},
                {"name": "sill", "shape": {"box": {"from": [0.4, -1], "to": [0.6, 0.05]}}}
            ],
            "time": {"end": 1}
        });
        let unstable = |set: &[String]| -> Vec<base::error::Problem> {
            let document = Document::read(&case.to_string(), set, Path::new(".")).unwrap();
            let found = match Plan::prepare(document) {
                Ok(plan) => plan.warnings,
                Err(found) => found,
            };
            let bad = found
                .into_iter()
                .filter(|p| p.severity != Severity::Warning);
            bad.collect()
        };
        let mut applied = 0;
        for problem in unstable(&[]) {
            let proposal = problem.remedy.proposal();
            if proposal.is_empty() {
                continue;
            }
            let set: Vec<String> = (proposal.iter())
                .map(|one| format!("{}={}", one.path, one.value))
                .collect();
            let left = unstable(&set);
            assert!(
                left.is_empty(),
                "{head} {gap} {cell} {collision}: {problem}\n{left:#?}"
            );
            applied += 1;
        }
        applied
    }
}
