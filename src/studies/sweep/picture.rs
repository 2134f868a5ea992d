//! `sweep.svg`: error against time and against memory, with the Pareto set connected and labelled; for a study without
//! a reference, each output against the first numerical variation. `map.svg`: the outcome of the members over two
//! varied fields, with the prediction of the plan.

use super::members::Member;
use super::record::Outcome;
use super::study::{Cost, Study};
use super::table::{MemberRow, SweepTable};
use base::error::Verdict;
use base::number::real;
use figures::plot::{
    CATEGORY, Figure, Layer, Legend, Mark, Panel, PlotAxis, PlotLabel, PlotShape, Style, sequential,
};
use io::csv::push_line;
use std::fmt::Write as _;

/// Maximum number of outputs in a picture without reference.
const ANSWERS: usize = 6;

/// Returns a figure of each output against the first numerical variation, or against the number of the member.
fn output_figures(study: &Study, members: &[Member], table: &SweepTable) -> Figure {
    let varied = study.vary.0.iter().position(|(_, v)| v.is_numeric());
    let x = varied.map_or_else(
        || PlotAxis::linear("member", ""),
        |n| PlotAxis::linear(&study.vary.0[n].0, ""),
    );
    // Members that differ in another field form a separate line.
    let group = |member: &Member| {
        let others = member.labels.iter().enumerate();
        let others = others.filter(|(n, _)| Some(*n) != varied);
        let labels: Vec<&str> = others.filter_map(|(_, label)| label.as_deref()).collect();
        labels.join(", ")
    };
    let outputs = study.outputs.0.iter().enumerate();
    let numbers = outputs.filter(|(_, (_, output))| output.over.is_none());
    let panel = |(n, name): (usize, &String)| {
        let mut lines: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
        for (k, (member, row)) in members.iter().zip(&table.rows).enumerate() {
            let at = varied.map_or(Some(real(k + 1)), |varied| member.value(varied));
            let Some(point) = at.zip(row.outputs.get(n).copied().flatten()) else {
                continue;
            };
            let label = group(member);
            match lines.iter_mut().find(|(known, _)| *known == label) {
                Some((_, points)) => points.push(point),
                None => lines.push((label, vec![point])),
            }
        }
        let mut layers = Vec::new();
        for (k, (label, mut points)) in lines.into_iter().enumerate() {
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let colour = CATEGORY[k % CATEGORY.len()];
            let marks = points
                .iter()
                .map(|(x, y)| Mark::without_bars(*x, *y))
                .collect();
            let style = Style::Filled;
            layers.push(Layer::new(
                PlotShape::Marks { marks, style },
                colour,
                &label,
            ));
            let dashed = true;
            layers.push(Layer::new(PlotShape::Line { points, dashed }, colour, ""));
        }
        Panel {
            title: name.clone(),
            x: x.clone(),
            y: PlotAxis::linear(name, ""),
            layers,
            legend: Legend::Right,
            legend_title: String::new(),
        }
    };
    let named = numbers.map(|(n, (name, _))| (n, name)).take(ANSWERS);
    Figure {
        panels: named.map(panel).collect(),
    }
}

/// Returns a figure of error against cost, with a panel for each cost; without known errors, that of the outputs.
#[must_use]
pub fn cost_figure(study: &Study, members: &[Member], table: &SweepTable) -> Figure {
    if table.rows.iter().all(|row| row.error.is_none()) {
        return output_figures(study, members, table);
    }
    let front = Front {
        study,
        members,
        table,
    };
    Figure {
        panels: vec![
            front.panel(
                &study.title,
                match study.cost {
                    Cost::CoreSeconds => PlotAxis::log("time of the steps", "core-seconds"),
                    Cost::ProcessorTime => PlotAxis::log("processor time", "s"),
                },
                |row| row.cost,
                |row| row.pareto_time,
            ),
            front.panel(
                "",
                PlotAxis::log("peak memory", "MB"),
                |row| row.memory.map(|bytes| 1e-6 * bytes),
                |row| row.pareto_memory,
            ),
        ],
    }
}

struct Front<'a> {
    study: &'a Study,
    members: &'a [Member],
    table: &'a SweepTable,
}

impl Front<'_> {
    fn panel(
        &self,
        title: &str,
        x: PlotAxis,
        cost: impl Fn(&MemberRow) -> Option<f64>,
        in_set: impl Fn(&MemberRow) -> bool,
    ) -> Panel {
        let point = |row: &MemberRow| cost(row).zip(row.error);
        let mut layers = Vec::new();
        for group in self.groups() {
            let marks = group
                .members
                .iter()
                .filter_map(|&n| point(&self.table.rows[n]));
            let marks: Vec<Mark> = marks.map(|(x, y)| Mark::without_bars(x, y)).collect();
            if !marks.is_empty() {
                let style = Style::Filled;
                let shape = PlotShape::Marks { marks, style };
                layers.push(Layer::new(shape, &group.colour, &group.label));
            }
        }
        let rows = self.members.iter().zip(&self.table.rows);
        let mut best: Vec<(&str, (f64, f64))> = rows
            .filter(|(_, row)| in_set(row))
            .filter_map(|(member, row)| Some((member.name.as_str(), point(row)?)))
            .collect();
        best.sort_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let points: Vec<(f64, f64)> = best.iter().map(|(_, point)| *point).collect();
        let line = PlotShape::Line {
            points: points.clone(),
            dashed: true,
        };
        layers.push(Layer::new(line, CATEGORY[0], "Pareto set"));
        for (n, (name, (x, y))) in best.iter().enumerate() {
            let marks = vec![Mark::without_bars(*x, *y)];
            let style = Style::Ring;
            let label = format!("{} {name}", n + 1);
            layers.push(Layer::new(
                PlotShape::Marks { marks, style },
                CATEGORY[0],
                &label,
            ));
        }
        let words = points.iter().enumerate();
        let words = words
            .map(|(n, (x, y))| PlotLabel {
                x: *x,
                y: *y,
                text: (n + 1).to_string(),
            })
            .collect();
        layers.push(Layer::new(PlotShape::Texts { words }, CATEGORY[0], ""));
        let error = self.study.error.as_ref();
        Panel {
            title: title.to_owned(),
            x,
            y: PlotAxis::log(
                &error.map_or("error".to_owned(), |name| format!("error of {name}")),
                "",
            ),
            layers,
            legend: Legend::Right,
            legend_title: self
                .study
                .vary
                .0
                .first()
                .map_or(String::new(), |(name, _)| name.clone()),
        }
    }

    /// Returns the group of each value of the first variation; without variations, each listed member is a group.
    fn groups(&self) -> Vec<Group> {
        let labels: Vec<String> = match self.study.vary.0.first() {
            Some((_, variation)) => variation.labels(),
            None => self
                .members
                .iter()
                .map(|member| member.name.clone())
                .collect(),
        };
        let numeric = self
            .study
            .vary
            .0
            .first()
            .is_some_and(|(_, v)| v.is_numeric());
        let mut groups: Vec<Group> = Vec::new();
        for (n, label) in labels.iter().enumerate() {
            let of_kind = CATEGORY.get(n + 1).filter(|_| !numeric);
            let colour = of_kind.map_or_else(|| sequential(n, labels.len()), |c| (*c).to_owned());
            groups.push(Group {
                colour,
                label: label.clone(),
                members: Vec::new(),
            });
        }
        for (n, member) in self.members.iter().enumerate() {
            let own = member.labels.first().cloned().flatten();
            let own = own.unwrap_or_else(|| member.name.clone());
            match groups.iter_mut().find(|group| group.label == own) {
                Some(group) => group.members.push(n),
                None => groups.push(Group {
                    colour: "#999999".to_owned(),
                    label: own,
                    members: vec![n],
                }),
            }
        }
        groups
    }
}

/// Members with one colour and one entry in the legend.
struct Group {
    colour: String,
    label: String,
    /// Indices of the members.
    members: Vec<usize>,
}

/// Prediction of the plan and outcome of a member, with its coordinates on the map.
#[derive(Clone, Debug)]
struct Place {
    name: String,
    x: f64,
    y: f64,
    /// Values of the other variations.
    rest: String,
    verdict: Verdict,
    outcome: Outcome,
}

/// Outcomes of the members as a function of two variations.
#[derive(Clone, Debug)]
pub struct Map {
    axes: [String; 2],
    places: Vec<Place>,
}

/// Kind of an outcome on the map.
struct Kind {
    /// Prediction of the plan.
    verdict: Verdict,
    /// `true` if the member finished.
    finished: bool,
    colour: &'static str,
    style: Style,
    /// Text of the legend.
    label: &'static str,
}

/// Returns a kind of outcomes.
const fn kind(
    verdict: Verdict,
    finished: bool,
    colour: &'static str,
    style: Style,
    label: &'static str,
) -> Kind {
    Kind {
        verdict,
        finished,
        colour,
        style,
        label,
    }
}

/// Kinds of outcomes.
#[rustfmt::skip]
const KINDS: [Kind; 6] = [
    kind(Verdict::Valid, true, "#009E73", Style::Square, "finished"),
    kind(Verdict::Unstable, true, "#E69F00", Style::Square, "unstable, finished"),
    kind(Verdict::Refused, true, "#D55E00", Style::OpenSquare, "refused by the plan, but finished"),
    kind(Verdict::Refused, false, "#D55E00", Style::Square, "refused, did not finish"),
    kind(Verdict::Unstable, false, "#222222", Style::OpenSquare, "unstable, did not finish"),
    kind(Verdict::Valid, false, "#222222", Style::Square, "did not finish, no finding"),
];

impl Map {
    /// Returns the map of the members that have been run and have a number on both axes.
    #[must_use]
    pub fn from_table(
        axes: &[String; 2],
        study: &Study,
        members: &[Member],
        table: &SweepTable,
    ) -> Self {
        let [x, y] = axes
            .each_ref()
            .map(|name| study.vary.find(name).map(|(n, _)| n));
        let (Some(x), Some(y)) = (x, y) else {
            return Self {
                axes: axes.clone(),
                places: Vec::new(),
            };
        };
        let place = |(member, row): (&Member, &MemberRow)| {
            let others = study.vary.0.iter().zip(&member.labels).enumerate();
            let others = others.filter(|(n, _)| *n != x && *n != y);
            let rest: Vec<&str> = others
                .filter_map(|(_, (_, label))| label.as_deref())
                .collect();
            Some(Place {
                name: member.name.clone(),
                x: member.value(x)?,
                y: member.value(y)?,
                rest: rest.join(", "),
                verdict: member.verdict,
                outcome: row.outcome,
            })
        };
        let is_shown = |place: &Place| {
            !matches!(
                place.outcome,
                Outcome::Missing | Outcome::Running | Outcome::Stopped
            )
        };
        let places = members
            .iter()
            .zip(&table.rows)
            .filter_map(place)
            .filter(is_shown);
        Self {
            axes: axes.clone(),
            places: places.collect(),
        }
    }

    /// Returns a figure with a panel for every combination of the other variations.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let mut rests: Vec<&str> = Vec::new();
        for place in &self.places {
            if !rests.contains(&place.rest.as_str()) {
                rests.push(&place.rest);
            }
        }
        let last = rests.len().saturating_sub(1);
        let panels = rests
            .iter()
            .enumerate()
            .map(|(n, rest)| self.panel(rest, n == last));
        Figure {
            panels: panels.collect(),
        }
    }

    fn panel(&self, rest: &str, last: bool) -> Panel {
        let layers = KINDS.iter().map(|kind| {
            let of_kind = |place: &&Place| place.is_of(kind.verdict, kind.finished);
            let all = self.places.iter().filter(of_kind).count();
            let here = self
                .places
                .iter()
                .filter(of_kind)
                .filter(|place| place.rest == rest);
            let marks = here
                .map(|place| Mark::without_bars(place.x, place.y))
                .collect();
            let shape = PlotShape::Marks {
                marks,
                style: kind.style,
            };
            Layer::new(shape, kind.colour, &format!("{}: {all}", kind.label))
        });
        let positive =
            |value: fn(&Place) -> f64| self.places.iter().all(|place| value(place) > 0.0);
        let axis = |name: &str, log: bool| {
            if log {
                PlotAxis::log(name, "")
            } else {
                PlotAxis::linear(name, "")
            }
        };
        Panel {
            title: rest.to_owned(),
            x: axis(&self.axes[0], positive(|place| place.x)),
            y: axis(&self.axes[1], positive(|place| place.y)),
            layers: layers.collect(),
            legend: if last { Legend::Right } else { Legend::None },
            legend_title: "plan and run".to_owned(),
        }
    }

    /// Returns a row for each member.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::new();
        let [x, y] = &self.axes;
        push_line(&mut text, ["member", x.as_str(), y, "plan", "outcome"]);
        for place in &self.places {
            let (x, y) = (format!("{:e}", place.x), format!("{:e}", place.y));
            let (verdict, outcome) = (place.verdict.name(), place.outcome.name());
            push_line(&mut text, [&*place.name, &x, &y, verdict, outcome]);
        }
        text
    }

    /// Returns a table of the numbers of agreements between plan and run.
    #[must_use]
    pub fn agreement_table(&self) -> String {
        let mut text = format!("{:<10} {:>10} {:>15}", "plan", "finished", "did not finish");
        for verdict in [Verdict::Valid, Verdict::Unstable, Verdict::Refused] {
            let count = |finished| {
                self.places
                    .iter()
                    .filter(|p| p.is_of(verdict, finished))
                    .count()
            };
            let _ = write!(
                text,
                "\n{:<10} {:>10} {:>15}",
                verdict.name(),
                count(true),
                count(false)
            );
        }
        text
    }
}

impl Place {
    fn is_of(&self, verdict: Verdict, finished: bool) -> bool {
        // Warnings do not predict a failure.
        let own = match self.verdict {
            Verdict::ValidWithWarnings => Verdict::Valid,
            other => other,
        };
        own == verdict && (self.outcome == Outcome::Finished) == finished
    }
}
