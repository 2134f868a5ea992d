//! Means of the outputs over the members that differ only in one variation, such as the seed of a packing.
//!
//! Each group of such members is a sample: its table has the number of members that ran to the end, and for each output
//! the mean, the standard deviation of a member, and the 95 % interval of the mean by Student's t. Members that have
//! failed are left out of the mean, and their number is in the table, because they may not be a random part of the
//! sample.

use super::members::Member;
use super::record::Outcome;
use super::study::Study;
use super::table::{SweepTable, machine};
use analysis::statistics::SampleMean;
use io::csv::push_line;
use std::fmt::Write as _;

/// Means of the groups of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Ensemble {
    /// Index of the variation over which the outputs are averaged.
    varied: usize,
    /// Names of the outputs that are numbers.
    outputs: Vec<String>,
    /// Groups in the order of their first members.
    pub groups: Vec<Group>,
}

/// Members that differ in one variation only.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Values of the other variations, in their order.
    pub labels: Vec<String>,
    /// Number of members.
    pub members: usize,
    /// Number of members that ran to the end.
    pub finished: usize,
    /// Mean of each output; none where no member has the output.
    pub means: Vec<Option<SampleMean>>,
}

impl Ensemble {
    /// Groups the members of a study and averages their outputs. Members that are listed singly belong to no group.
    #[must_use]
    pub fn from_table(name: &str, study: &Study, members: &[Member], table: &SweepTable) -> Self {
        let varied = study.vary.find(name).map_or(usize::MAX, |(n, _)| n);
        let numbers: Vec<usize> = (study.outputs.0.iter().enumerate())
            .filter(|(_, (_, output))| output.over.is_none())
            .map(|(n, _)| n)
            .collect();
        let mut groups: Vec<(Vec<String>, Vec<usize>)> = Vec::new();
        for (n, member) in members.iter().enumerate() {
            if member.labels.get(varied).is_none_or(Option::is_none) {
                continue;
            }
            let labels = member.labels.iter().enumerate();
            let labels: Vec<String> = labels
                .filter(|(k, _)| *k != varied)
                .map(|(_, label)| label.clone().unwrap_or_default())
                .collect();
            match groups.iter_mut().find(|(known, _)| *known == labels) {
                Some((_, group)) => group.push(n),
                None => groups.push((labels, vec![n])),
            }
        }
        let groups = groups.into_iter().map(|(labels, group)| {
            let finished = group
                .iter()
                .filter(|n| table.rows[**n].outcome == Outcome::Finished);
            let finished: Vec<usize> = finished.copied().collect();
            let mean = |output: &usize| {
                let values = finished.iter().map(|n| table.rows[*n].outputs.get(*output));
                let values: Vec<f64> = values
                    .filter_map(|value| value.copied().flatten())
                    .collect();
                SampleMean::from_values(&values)
            };
            Group {
                labels,
                members: group.len(),
                finished: finished.len(),
                means: numbers.iter().map(mean).collect(),
            }
        });
        Self {
            varied,
            outputs: numbers
                .iter()
                .map(|n| study.outputs.0[*n].0.clone())
                .collect(),
            groups: groups.collect(),
        }
    }

    /// Returns a row for each group as CSV.
    #[must_use]
    pub fn to_csv(&self, study: &Study) -> String {
        let mut text = format!("# {}, {}\n", study.title.replace('\n', " "), machine());
        let names = study.vary.0.iter().enumerate();
        let mut header: Vec<String> = names
            .filter(|(n, _)| *n != self.varied)
            .map(|(_, (name, _))| name.clone())
            .collect();
        header.extend(["members", "finished"].map(String::from));
        for name in &self.outputs {
            header
                .extend(["mean", "scatter", "low", "high"].map(|what| format!("{what} of {name}")));
        }
        push_line(&mut text, &header);
        for group in &self.groups {
            let mut cells = group.labels.clone();
            cells.extend([group.members.to_string(), group.finished.to_string()]);
            for mean in &group.means {
                cells.extend(statistics_cells(mean.as_ref()));
            }
            push_line(&mut text, &cells);
        }
        text
    }

    /// Returns the means and intervals of all groups as lines of text.
    #[must_use]
    pub fn summary(&self) -> String {
        let mut text =
            String::from("means over the ensemble, with the 95 % interval of the mean\n");
        for group in &self.groups {
            let labels = group.labels.join(", ");
            let _ = writeln!(
                text,
                "{labels}: {} of {} members",
                group.finished, group.members
            );
            for (name, mean) in self.outputs.iter().zip(&group.means) {
                let Some(mean) = mean else {
                    let _ = writeln!(text, "  {name}: no value");
                    continue;
                };
                let width = mean
                    .half_width
                    .map_or("unknown".into(), |width| format!("{width:.3e}"));
                let _ = writeln!(text, "  {name}: {:.4e} +- {width}", mean.mean);
            }
        }
        text.truncate(text.trim_end().len());
        text
    }
}

/// Returns the mean, the standard deviation and both ends of the interval; empty where they are unknown.
fn statistics_cells(mean: Option<&SampleMean>) -> [String; 4] {
    let Some(mean) = mean else {
        return [const { String::new() }; 4];
    };
    let number = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:e}"));
    [
        number(Some(mean.mean)),
        number(mean.scatter),
        number(mean.half_width.map(|width| mean.mean - width)),
        number(mean.half_width.map(|width| mean.mean + width)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use base::error::Verdict;
    use serde_json::{Value, json};
    use std::path::Path;

    fn study(change: impl FnOnce(&mut Value)) -> Result<Study, Vec<base::error::Problem>> {
        let mut text = json!({
            "case": "case.json",
            "vary": {"pressure": [1, 2], "seed": [1, 2, 3]},
            "outputs": {"mass": {"summary": "mass"}},
            "ensemble": "seed"
        });
        change(&mut text);
        Study::read(&text.to_string())
    }

    fn member(labels: &[Option<&str>]) -> Member {
        Member {
            name: "member".into(),
            labels: labels.iter().map(|label| label.map(String::from)).collect(),
            case: Value::Null,
            verdict: Verdict::Valid,
            problems: Vec::new(),
            prepared: None,
        }
    }

    #[test]
    fn members_that_differ_in_the_seed_alone_are_averaged() {
        let study = study(|_| ()).unwrap();
        let mut members: Vec<Member> = ["1", "2"]
            .iter()
            .flat_map(|p| ["1", "2", "3"].map(|seed| member(&[Some(p), Some(seed)])))
            .collect();
        members.push(member(&[None, None]));
        let mut table = SweepTable::collect(&study, &members, Path::new("."), Path::new("none"));
        let values = [4.0, 5.0, 6.0, 10.0, 12.0, 0.0, 99.0];
        for (row, value) in table.rows.iter_mut().zip(values) {
            row.outcome = Outcome::Finished;
            row.outputs = vec![Some(value)];
        }
        table.rows[5].outcome = Outcome::Failed;
        let ensemble = Ensemble::from_table("seed", &study, &members, &table);
        let [first, second] = &ensemble.groups[..] else {
            panic!("{ensemble:?}");
        };
        assert_eq!(
            (first.labels[0].as_str(), first.members, first.finished),
            ("1", 3, 3)
        );
        let mean = first.means[0].unwrap();
        assert_relative_eq!(mean.mean, 5.0);
        assert_relative_eq!(mean.scatter.unwrap(), 1.0);
        assert_relative_eq!(mean.half_width.unwrap(), 4.303 / 3.0_f64.sqrt());
        assert_eq!((second.members, second.finished), (3, 2));
        assert_relative_eq!(second.means[0].unwrap().mean, 11.0);
        let csv = ensemble.to_csv(&study);
        let lines: Vec<&str> = csv.lines().skip(1).collect();
        assert_eq!(
            lines[0],
            "pressure,members,finished,mean of mass,scatter of mass,low of mass,high of mass"
        );
        assert!(lines[1].starts_with("1,3,3,5e0,1e0,2.51"), "{}", lines[1]);
        assert_eq!(lines.len(), 3);
        assert!(
            ensemble.summary().contains("2 of 3 members"),
            "{}",
            ensemble.summary()
        );
    }

    #[test]
    fn an_ensemble_that_no_members_can_form_is_refused() {
        let reason = |change: fn(&mut Value)| study(change).unwrap_err()[0].to_string();
        let unknown = reason(|study| study["ensemble"] = json!("sed"));
        assert!(unknown.contains("did you mean `seed`?"), "{unknown}");
        let single = reason(|study| study["vary"]["seed"] = json!([1]));
        assert!(single.contains("no scatter"), "{single}");
        let drawn = reason(|study| study["sample"] = json!({"latin_hypercube": {"members": 4}}));
        assert!(drawn.contains("crossed"), "{drawn}");
        assert!(
            study(|study| study["sample"] =
                json!({"latin_hypercube": {"members": 4, "crossed": ["seed"]}}))
            .is_ok()
        );
    }
}
