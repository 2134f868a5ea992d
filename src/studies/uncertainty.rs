//! `solver estimate`: the numerical uncertainty of the answers of a case, measured by running it on several grids.
//!
//! | step | module |
//! |---|---|
//! | coarser or finer cells, the case on them | [`grids`] |
//! | settings of models that cells do not refine | [`settings`] |
//! | ends of a seepage further away, on request | `ends` |
//! | runs as members of a study: [`crate::sweep::runner`] | [`Members`] |
//! | the answers of a run | [`answers`] |
//! | order, extrapolated value, uncertainty | [`convergence`] |
//! | terminal, `estimate.csv`, block `estimate` in `summary.json` | [`table`] |
//!
//! A grid whose plan is refused or whose run fails is reported with the reason, and another one is run in its
//! place: the coarsest cells between those that failed and those that ran, and as the last choice finer cells than
//! those of the case. With answers from two grids the estimate uses the larger factor of safety; with answers from
//! one grid there is no estimate.
//!
//! The output folder holds a numbered folder for each run; the first is the case itself. A finished run is not
//! repeated. Settings of models are compared on the next coarser grid, if there is one.
//!
//! An estimate is a command and not a field of a case, because a case describes one run, possibly on many ranks,
//! and an estimate consists of several runs. `accuracy` remains the target of the automatic choices.

pub mod answers;
pub mod convergence;
mod ends;
pub mod grids;
pub mod pilot;
pub mod settings;
pub mod table;

use crate::sweep::members::{Member, Prepared};
use crate::sweep::record::{Outcome, Record};
use crate::sweep::runner::{Runner, solver_version};
use crate::sweep::study::Run;
use crate::sweep::{LineReport, enough_cores};
use base::error::{Error, Problem, Severity, Verdict};
use case::Document;
use case::fluid::Precision;
use grids::Scaling;
use plan::Plan;
use plan::estimate::Machine;
use plan::scene::rounding;
use serde_json::{Value, json};
use settings::Setting;
use std::path::{Path, PathBuf};
use std::time::Duration;
use table::{GridData, Noise, UncertaintyTable};

/// Options of an estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Output folder.
    pub output: PathBuf,
    /// `true` if one grid is finer than that of the case.
    pub finer: bool,
    /// `true` if settings of models are varied too.
    pub settings: bool,
    /// `true` if the closed ends of a seepage are moved away in one run.
    pub ends: bool,
    /// Number of ranks, threads and simultaneous runs.
    pub run: Run,
    /// Wall-clock time after which the runs are stopped.
    pub max_walltime: Option<Duration>,
    /// `true` if an unstable case is run.
    pub allow_unstable: bool,
}

/// Runs of an estimate.
#[derive(Clone, Debug)]
pub struct Members {
    /// Runs with their cases; the first is the case itself.
    pub list: Vec<Member>,
    /// Spacing of each grid divided by that of the case, from fine to coarse, and index of its run in the list.
    pub grids: Vec<(f64, usize)>,
    /// Settings and the indices of their runs in the list.
    pub settings: Vec<(Setting, usize)>,
    /// Index of the run with which settings are compared.
    pub comparison: usize,
    /// Scaling of the time step.
    pub scaling: Scaling,
}

impl Members {
    /// Returns the runs of the estimate of a case.
    ///
    /// # Errors
    /// If no other grid can run, [`Error::Case`].
    pub fn for_case(
        plan: &Plan,
        finer: bool,
        with_settings: bool,
        unstable: bool,
    ) -> Result<Self, Error> {
        let stated = grids::with_choices_stated(plan)?;
        let seepage = grids::refinable_seepage(&plan.scene).is_some();
        let mut ratios = Vec::new();
        if plan.scene.flow.is_some() || seepage {
            ratios = grids::ratios(&plan.scene, finer);
        }
        if plan.scene.flow.is_some() {
            grids::check(&stated)?;
        }
        let has_grid = plan.scene.flow.is_some() || !ratios.is_empty();
        let wanted = ratios.len() + 1;
        // The rule with which all grids can run, otherwise the one with which most can.
        let rules = if seepage {
            vec![Scaling::Steady]
        } else {
            vec![Scaling::Diffusive, Scaling::Acoustic]
        };
        let scaled = |rule| Self::scaled(plan, &stated, &ratios, rule, unstable);
        let mut each: Vec<Self> = rules.into_iter().map(scaled).collect();
        let all = each.iter().position(|members| members.usable() == wanted);
        let rule = all.unwrap_or_else(|| {
            for members in &mut each {
                while members.usable() < wanted && members.add_grid(plan, &stated, unstable, &[]) {}
            }
            let best = each.iter().map(Self::usable).max();
            let found = each
                .iter()
                .position(|members| Some(members.usable()) == best);
            found.unwrap_or(0)
        });
        let mut members = each
            .into_iter()
            .nth(rule)
            .ok_or_else(|| Error::Internal("the estimate has no rule for the time step".into()))?;
        if has_grid && members.usable() < 2 {
            return Err(Error::Case(members.refusals()));
        }
        if with_settings {
            members.add_settings(plan, &stated);
        }
        Ok(members)
    }

    /// Returns the grids by one rule of the time step. Grids that a plan refuses are in the list without a case to
    /// run.
    fn scaled(
        plan: &Plan,
        stated: &Value,
        ratios: &[f64],
        scaling: Scaling,
        unstable: bool,
    ) -> Self {
        let mut members = Self {
            list: vec![Member {
                name: "1-case".into(),
                labels: Vec::new(),
                case: Value::Null,
                verdict: Verdict::from_findings(&plan.warnings),
                problems: plan.warnings.clone(),
                prepared: Some(prepared(plan)),
            }],
            grids: vec![(1.0, 0)],
            settings: Vec::new(),
            comparison: 0,
            scaling,
        };
        for ratio in ratios {
            members.push_grid(plan, stated, *ratio, unstable);
        }
        members
    }

    fn push_grid(&mut self, plan: &Plan, stated: &Value, ratio: f64, unstable: bool) {
        let name = format!("{}-grid-{ratio:.3}", self.list.len() + 1);
        let case = grids::on_cells(stated, plan, ratio, self.scaling);
        self.grids.push((ratio, self.list.len()));
        self.list
            .push(member(name, case, plan.estimate.machine, unstable));
        self.grids.sort_by(|a, b| a.0.total_cmp(&b.0));
        if self.settings.is_empty() {
            let coarser = self
                .grids
                .iter()
                .find(|(ratio, place)| *ratio > 1.0 && self.list[*place].prepared.is_some());
            self.comparison = coarser.map_or(0, |(_, place)| *place);
        }
    }

    /// Adds a grid in place of one that cannot be used: one that the plan refuses, or one with its index among
    /// `failed`. Returns `true` if there was another grid to add.
    fn add_grid(&mut self, plan: &Plan, stated: &Value, unstable: bool, failed: &[usize]) -> bool {
        let (mut usable, mut lost) = (Vec::new(), Vec::new());
        for (ratio, place) in &self.grids {
            if self.list[*place].prepared.is_none() || failed.contains(place) {
                lost.push(*ratio);
            } else {
                usable.push(*ratio);
            }
        }
        let other = grids::replacement_grid(&plan.scene, &usable, &lost);
        if let Some(ratio) = other {
            self.push_grid(plan, stated, ratio, unstable);
        }
        other.is_some()
    }

    /// Returns the number of grids that the plan allows.
    fn usable(&self) -> usize {
        let allowed = |(_, place): &&(f64, usize)| self.list[*place].prepared.is_some();
        self.grids.iter().filter(allowed).count()
    }

    /// Returns the reasons for which grids are refused.
    fn refusals(&self) -> Vec<Problem> {
        let mut all = Vec::new();
        for (ratio, place) in &self.grids {
            let member = &self.list[*place];
            let problems = member.problems.iter();
            let heavy = problems.filter(|problem| problem.severity != Severity::Warning);
            if member.prepared.is_none() {
                all.extend(heavy.cloned().map(|mut problem| {
                    problem.path = format!("cells of {ratio:.3} times the size: {}", problem.path);
                    problem
                }));
            }
        }
        all
    }

    /// Returns the case on the grid that is used to compare settings.
    fn compared(&self, plan: &Plan, stated: &Value) -> Value {
        let comparison = self
            .grids
            .iter()
            .find(|(_, place)| *place == self.comparison);
        match comparison {
            Some((ratio, place)) if *place > 0 => {
                grids::on_cells(stated, plan, *ratio, self.scaling)
            }
            _ => stated.clone(),
        }
    }

    fn add_settings(&mut self, plan: &Plan, stated: &Value) {
        let case = self.compared(plan, stated);
        for setting in settings::scene_settings(&case, plan, self.scaling) {
            self.push_setting(setting, plan);
        }
    }

    fn push_setting(&mut self, setting: Setting, plan: &Plan) {
        let name = format!("{}-{}", self.list.len() + 1, setting.folder);
        let member = member(name, setting.case.clone(), plan.estimate.machine, true);
        self.settings.push((setting, self.list.len()));
        self.list.push(member);
    }

    /// Adds a run with the closed ends of the seepage further away.
    ///
    /// # Errors
    /// If the case has no such ends, [`Error::Usage`].
    pub fn add_ends(&mut self, plan: &Plan) -> Result<(), Error> {
        let mut case = self.compared(plan, &grids::with_choices_stated(plan)?);
        let change = ends::move_ends(&mut case, plan).ok_or_else(|| {
            Error::Usage(
                "--ends: the case has no ends that can be moved; they must be closed horizontal ends of seepage \
                 without grains, beyond the imposed heads, in a case without rasters and without meshes that \
                 have no `origin`"
                    .into(),
            )
        })?;
        let setting = Setting {
            name: "ends of the domain",
            folder: "ends",
            change,
            case,
        };
        self.push_setting(setting, plan);
        Ok(())
    }

    /// Returns the planned time of each run on one core and the total \[s\].
    #[must_use]
    pub fn costs(&self) -> (Vec<(&str, f64)>, f64) {
        let seconds = |member: &Member| member.prepared.as_ref().map_or(0.0, |p| p.seconds);
        let costs: Vec<(&str, f64)> = self
            .list
            .iter()
            .map(|member| (member.name.as_str(), seconds(member)))
            .collect();
        let sum = costs.iter().map(|(_, seconds)| seconds).sum();
        (costs, sum)
    }

    /// Returns the costs as lines of a plan.
    #[must_use]
    pub fn cost_lines(&self) -> String {
        let (costs, sum) = self.costs();
        let own = costs.first().map_or(0.0, |(_, seconds)| *seconds);
        let mut text = String::from("\ncosts of `solver estimate` (estimate)\n");
        for (member, (name, seconds)) in self.list.iter().zip(&costs) {
            text += &match &member.prepared {
                Some(_) => format!("  {name:24} {seconds:10.3} core-s\n"),
                None => format!("  {name:24} not possible: {}\n", refusal(member)),
            };
        }
        text + &format!(
            "  {:24} {sum:10.3} core-s, {:.2} times the run of the case; {}",
            "all",
            sum / own.max(f64::MIN_POSITIVE),
            self.meaning()
        )
    }

    /// Returns an explanation of the choice of grids.
    fn meaning(&self) -> &'static str {
        if self.grids.len() > 1 {
            self.scaling.meaning()
        } else {
            "only one grid is used: the cells of seepage through grains, or of dry grains, cannot be refined \
             independently of the grains"
        }
    }

    /// Returns the costs for a plan as JSON.
    #[must_use]
    pub fn cost_json(&self) -> Value {
        let (costs, sum) = self.costs();
        json!({
            "scaling": self.scaling,
            "runs": costs.iter().map(|(name, seconds)| json!({"name": name,
                "seconds_on_one_core": seconds})).collect::<Vec<_>>(),
            "seconds_on_one_core": sum,
        })
    }
}

/// Returns the reason why a run is not possible: the first one that is not a warning.
fn refusal(member: &Member) -> String {
    let heavy = |problem: &&Problem| problem.severity != Severity::Warning;
    let first = member.problems.iter().find(heavy);
    first.map_or_else(|| "not run".to_owned(), ToString::to_string)
}

fn prepared(plan: &Plan) -> Prepared {
    Prepared {
        text: plan.case_text.clone(),
        hash: plan.case_hash.clone(),
        seconds: plan.estimate.seconds_on_one_core,
        memory: plan.estimate.memory_bytes,
    }
}

/// Returns a run of a changed case; its time is estimated for a machine of this speed. The input files of the case
/// already have absolute paths.
fn member(name: String, case: Value, machine: Machine, unstable: bool) -> Member {
    let mut planned = Document::read(&case.to_string(), &[], Path::new("")).and_then(Plan::prepare);
    if let Ok(plan) = &mut planned {
        plan.on_machine(machine);
    }
    let problems = match &planned {
        Ok(plan) => plan.warnings.clone(),
        Err(problems) => problems.clone(),
    };
    let verdict = Verdict::from_findings(&problems);
    let planned = planned.ok().filter(|_| verdict.runs(unstable));
    Member {
        name,
        labels: Vec::new(),
        prepared: planned.as_ref().map(prepared),
        case,
        verdict,
        problems,
    }
}

/// Runs the missing members and writes the results; `report` receives the lines to print. Returns the table.
///
/// # Errors
/// If the case is invalid, the runs were stopped ([`Error::Stopped`]), or the run of the case itself failed.
pub fn command(
    plan: &Plan,
    options: &Options,
    report: LineReport<'_>,
) -> Result<UncertaintyTable, Error> {
    enough_cores(&options.run)?;
    let unstable = options.allow_unstable;
    let mut members = Members::for_case(plan, options.finer, options.settings, unstable)?;
    if options.ends {
        members.add_ends(plan)?;
    }
    let (_, sum) = members.costs();
    report(&format!(
        "{} runs, planned cost about {sum:.1} core-seconds, in {}",
        members.list.len(),
        options.output.display()
    ));
    // Settings are compared even if a plan calls them unstable; the case itself was judged before its run.
    let runner = Runner::new(
        &options.run,
        true,
        &options.output,
        options.max_walltime,
        report,
    )?;
    runner.run(&members.list)?;
    let wanted = members.grids.len().min(MAX_GRIDS);
    loop {
        // Grids whose runs failed are replaced as long as there are others.
        let failed = failures(plan, &members, &options.output);
        let case_failed = failed.contains(&0);
        let usable = members.usable() - failed.len();
        let stated = grids::with_choices_stated(plan)?;
        if case_failed || usable >= wanted || !members.add_grid(plan, &stated, unstable, &failed) {
            break;
        }
        if let Some(member) = members.list.last() {
            let seconds = member.prepared.as_ref().map_or(0.0, |p| p.seconds);
            report(&format!(
                "only {usable} of {} grids can be used: {} is added, planned cost about {seconds:.1} \
                 core-seconds",
                members.grids.len() - 1,
                member.name
            ));
        }
        runner.run(&members.list)?;
    }
    let table = collect(plan, &members, &options.output)?;
    write(&table, &options.output)?;
    report(&table.text());
    report(&format!("estimate.csv in {}", options.output.display()));
    if members.grids.len() > 1 && table.usable() < 2 {
        return Err(Error::Numerical(table.conclusion));
    }
    crate::sweep::check_ends(&members.list, &options.output)?;
    Ok(table)
}

/// Number of grids that an estimate uses.
const MAX_GRIDS: usize = 3;

/// Returns the indices in the list of the grids that were run and have no answers.
fn failures(plan: &Plan, members: &Members, output: &Path) -> Vec<usize> {
    let places = members.grids.iter().map(|(_, place)| *place);
    let failed = places.filter(|&place| {
        let member = &members.list[place];
        member.prepared.is_some() && outcome(plan, member, output).is_err()
    });
    failed.collect()
}

/// Returns the answers of a run, or the reason why there are none.
fn outcome(plan: &Plan, member: &Member, output: &Path) -> Result<answers::Answers, String> {
    let folder = output.join(&member.name);
    let record = Record::read(&folder).filter(|_| member.prepared.is_some());
    match record {
        Some(record) if record.outcome == Outcome::Finished => answers::read(plan, &folder),
        Some(record) => Err(format!("{}: {}", record.outcome.name(), record.message)),
        None => Err(refusal(member)),
    }
}

/// Reads the answers of all runs.
fn collect(plan: &Plan, members: &Members, output: &Path) -> Result<UncertaintyTable, Error> {
    let found: Vec<Result<answers::Answers, String>> = members
        .list
        .iter()
        .map(|member| outcome(plan, member, output))
        .collect();
    if let Some(Err(why)) = found.first() {
        let first = &members.list[0];
        let record = Record::read(&output.join(&first.name));
        let failed = record.is_some_and(|record| record.outcome == Outcome::NumericalRefusal);
        let reason = format!("the run of the case gives no results: {why}");
        return Err(if failed {
            Error::Numerical(reason)
        } else {
            Error::Io(reason)
        });
    }
    let of = |place: usize| found.get(place).and_then(|answers| answers.as_ref().ok());
    let core_seconds = |place: usize| {
        let record = Record::read(&output.join(&members.list[place].name));
        record.map_or(0.0, |record| record.processor_seconds)
    };
    let seepage = grids::refinable_seepage(&plan.scene);
    let edge = seepage.map_or(plan.scene.grid.spacing, |seepage| {
        seepage.smallest_edge(plan.scene.grid.dimension)
    });
    let grids: Vec<GridData> = members
        .grids
        .iter()
        .map(|(ratio, place)| GridData {
            folder: members.list[*place].name.clone(),
            spacing: edge * ratio,
            ratio: *ratio,
            core_seconds: core_seconds(*place),
            failure: found[*place].as_ref().err().cloned(),
            answers: of(*place).cloned(),
        })
        .collect();
    let at = members.grids.iter().position(|(_, place)| *place == 0);
    let formal_order = grids::formal_order(&plan.scene);
    let flow = plan.scene.flow.as_ref();
    let noise = Noise {
        units: plan.units,
        single: flow.is_some_and(|flow| flow.storage == Precision::F32),
        collisions: flow
            .filter(|flow| flow.arithmetic == Precision::F32)
            .map_or(0.0, |flow| rounding::of_single(&plan.scene, flow)),
    };
    let settings = members.settings.iter().map(|(setting, place)| {
        let folder = members.list[*place].name.as_str();
        let comparison = members.list[members.comparison].name.as_str();
        let missing = match (&found[*place], &found[members.comparison]) {
            (Ok(_), Ok(_)) => String::new(),
            (Err(why), _) => why.clone(),
            (_, Err(why)) => format!("{comparison}, the run for comparison, {why}"),
        };
        let answers = [of(members.comparison), of(*place)];
        table::sensitivity(setting, [folder, comparison], answers, &missing, noise)
    });
    Ok(UncertaintyTable {
        scaling: members.meaning().to_owned(),
        formal_order,
        conclusion: table::conclusion(&grids),
        answers: table::rows(
            &grids,
            at.unwrap_or(0),
            formal_order,
            seepage.is_some(),
            noise,
        ),
        settings: settings.collect(),
        grids,
        version: solver_version()?,
    })
}

/// Writes `estimate.csv` and the block in the summary of the case.
fn write(table: &UncertaintyTable, output: &Path) -> Result<(), Error> {
    let fail = |e: io::Error| Error::Io(e.to_string());
    io::atomic::write(&output.join("estimate.csv"), table.csv().as_bytes()).map_err(fail)?;
    let path = output.join("1-case").join("summary.json");
    let text = io::plain::text(&path, io::plain::LONGEST_CASE).map_err(fail)?;
    let mut summary: Value =
        serde_json::from_str(&text).map_err(|e| Error::Io(format!("{}: {e}", path.display())))?;
    summary["estimate"] = table.json();
    io::atomic::write_json(&path, &summary).map_err(fail)
}

#[cfg(test)]
mod tests;
