//! Backward erosion piping of a run: its entry in `summary.json`, its table and its messages.

use base::error::Error;
use case::backward_erosion::EquilibriumDiameter;
use coupling::seepage::Seepage;
use darcy::Piping;
use darcy::piping::{PipeOfLength, TURBULENT, across, rule};
use dem::space::Space;
use plan::scene::seepage::PipingScene;
use serde_json::{Value, json};
use std::fmt::Write;

/// Name of the table.
pub(super) const TABLE: &str = "backward_erosion.csv";

/// Columns of the table: the heads of all lengths.
const COLUMNS: &str = "length [m],head [m],tip_head [m],tip_slope [-],exit_slope [-],tip_height [m],exit_height [m],\
                       exit_width [m],discharge [m3/s],reynolds [-]\n";

/// Critical heads of the rule of Sellmeijer et al. (2011).
#[derive(Clone, Copy)]
struct RuleHeads {
    /// Head by the published formula, with its regression of d70 \[m\].
    published: f64,
    /// Head with the diameter that the equilibrium of the case has \[m\].
    of_equilibrium: f64,
}

/// Answers of a study.
pub(super) struct PipingAnswers {
    found: Piping,
    scene: PipingScene,
    /// Critical heads of the rule.
    rule: Option<RuleHeads>,
    /// Width of a cell across the pipe \[m\].
    cell_width: f64,
}

impl PipingAnswers {
    /// Computes the answers from the seepage of a run. Collective; the same on all ranks.
    ///
    /// # Errors
    /// If a solution of the pressure or an equilibrium fails.
    pub(super) fn compute<Sp: Space>(
        scene: &PipingScene,
        seepage: &Seepage<Sp>,
    ) -> Result<Self, Error> {
        let openness = seepage.openness();
        let found = Piping::study(seepage.pressure(), openness, &scene.settings)
            .map_err(|e| Error::Numerical(e.to_string()))?;
        let of_rule = |written: &case::backward_erosion::DikeOnSand| {
            let grains = &scene.settings.grains;
            let dike = rule::Dike {
                length: written.length,
                thickness: written.thickness,
                permeability: found.permeability,
            };
            RuleHeads {
                published: rule::critical_head(scene.written.d70, grains, &dike),
                of_equilibrium: rule::head_of_equilibrium(grains, &dike),
            }
        };
        Ok(Self {
            rule: scene.written.rule.as_ref().map(of_rule),
            cell_width: across(&openness.grid, &scene.settings.path),
            found,
            scene: scene.clone(),
        })
    }

    /// Returns the entry of `summary.json`.
    pub(super) fn summary(&self) -> Value {
        let critical = self.found.critical();
        let stops = self.found.stops_at(self.scene.head);
        let mut entry = json!({
            "critical_head": critical.head,
            "critical_length": critical.length,
            "tip_height": critical.tip_height,
            "exit_height": critical.exit_height,
            "exit_width": critical.exit_width,
            "discharge": critical.discharge,
            "reynolds": critical.reynolds,
            "head": self.scene.head,
            "grows_through": stops.is_none(),
            "stops_at": stops,
        });
        if let Some(rule) = self.rule {
            entry["rule_head"] = rule.published.into();
            entry["head_over_rule"] = (critical.head / rule.published).into();
            entry["head_over_rule_of_same_diameter"] = (critical.head / rule.of_equilibrium).into();
        }
        entry
    }

    /// Returns the table of the heads of all lengths.
    pub(super) fn table(&self) -> String {
        let mut text = COLUMNS.to_owned();
        for p in &self.found.pipes {
            let PipeOfLength { length, head, .. } = p;
            // Writing to memory cannot fail.
            let _ = writeln!(
                text,
                "{length},{head},{},{},{},{},{},{},{},{}",
                p.tip_head,
                p.tip_slope,
                p.exit_slope,
                p.tip_height,
                p.exit_height,
                p.exit_width,
                p.discharge,
                p.reynolds
            );
        }
        text
    }

    /// Returns the lines for the terminal.
    pub(super) fn lines(&self) -> Vec<String> {
        let critical = self.found.critical();
        let end = match self.found.stops_at(self.scene.head) {
            Some(length) => format!("the pipe stops at {length:.4} m"),
            None => "the pipe grows through".to_owned(),
        };
        let mut lines = vec![
            format!(
                "backward erosion: critical head {:.4} m at a length of {:.4} m, height of the pipe {:.2e} to {:.2e} m",
                critical.head, critical.length, critical.tip_height, critical.exit_height
            ),
            format!(
                "under the head of the case, {:.4} m, {end}",
                self.scene.head
            ),
        ];
        if let Some(rule) = self.rule {
            let same = match self.scene.written.diameter {
                EquilibriumDiameter::Sellmeijer2011 => String::new(),
                EquilibriumDiameter::D70 => format!(
                    ", and {:.3} of the rule without its factor (d70m/d70)^0.6, which the equilibrium with d70 lacks \
                     as well (`diameter`: \"sellmeijer2011\" has it)",
                    critical.head / rule.of_equilibrium
                ),
            };
            lines.push(format!(
                "rule of Sellmeijer et al. (2011): {:.4} m; the critical head is {:.3} of it{same}",
                rule.published,
                critical.head / rule.published
            ));
        }
        lines
    }

    /// Returns warnings about the validity of the answers.
    pub(super) fn warnings(&self) -> Vec<String> {
        let (critical, pipes) = (self.found.critical(), &self.found.pipes);
        let mut all = Vec::new();
        if self.found.critical + 1 == pipes.len() {
            all.push(
                "the head of the pipe still rises at the end of its line: the critical head is larger; extend \
                 `pipe.to` towards the drive"
                    .to_owned(),
            );
        }
        if self.found.critical == 0 {
            all.push(
                "the largest head is that of a pipe of one cell: it depends on the size of the cells; use smaller ones"
                    .to_owned(),
            );
        }
        if critical.reynolds > TURBULENT {
            all.push(format!(
                "the Reynolds number of the pipe reaches {:.0}; above {TURBULENT} its flow may be turbulent, and the \
                 pipe conducts less than computed",
                critical.reynolds
            ));
        }
        let diameter = self.scene.settings.grains.diameter;
        if critical.exit_height < diameter {
            all.push(format!(
                "the pipe is {:.2e} m high at the exit, less than a grain of {diameter:.2e} m, \
                 so that the model of flow between plates does not apply",
                critical.exit_height
            ));
        }
        if self.scene.settings.width.is_some() && critical.exit_width > self.cell_width {
            all.push(format!(
                "the pipe is {:.2e} m wide at the exit, a cell {:.2e} m: use cells that are wider than the pipe",
                critical.exit_width, self.cell_width
            ));
        }
        all
    }
}
