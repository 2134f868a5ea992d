//! The plan as tables for a terminal.

use super::estimate::size;
use super::margin::Margin;
use super::{Plan, envelope};
use crate::scene::findings::number;
use base::units::LatticeUnits;
use std::fmt::{self, Display, Formatter};

impl Display for Plan {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let grid = &self.scene.grid;
        let graded = self.scene.seepage.as_ref().filter(|own| own.is_graded());
        let cells = graded.map_or(grid.cells, |own| own.cells);
        let cells: Vec<String> = cells[..grid.dimension]
            .iter()
            .map(usize::to_string)
            .collect();
        let widths = graded.map_or_else(
            || number(grid.spacing),
            |own| {
                let axes = 0..grid.dimension;
                let widest = axes.map(|a| own.widest(a)).fold(0.0, f64::max);
                let least = own.smallest_edge(grid.dimension);
                format!("{} to {}", number(least), number(widest))
            },
        );
        writeln!(
            f,
            "{}",
            if self.scene.title.is_empty() {
                "(no title)"
            } else {
                &self.scene.title
            }
        )?;
        writeln!(
            f,
            "{}-D, {} cells of {} m",
            grid.dimension,
            cells.join(" x "),
            widths
        )?;
        let rows = self
            .models
            .iter()
            .map(|c| [c.what.clone(), c.model.clone(), c.reason.clone()]);
        table(f, ["models", "chosen", "because"], rows)?;
        table(f, ["time and scales", "value", "unit"], self.scales())?;
        let binding = self.margins.iter().map(|m| m.used).fold(0.0, f64::max);
        let rows = tightest(&self.margins).into_iter().map(|(m, of)| {
            let mark = if m.used >= binding { " <- binds" } else { "" };
            let among = if of > 1 {
                format!(", the tightest of {of}")
            } else {
                String::new()
            };
            [
                format!("{}{among}", m.limit),
                format!("{} of {}", number(m.value), number(m.allowed)),
                format!("{:.0} %{mark}", 100.0 * m.used),
            ]
        });
        table(f, ["limits", "value of limit", "used"], rows)?;
        table(f, ["costs (estimate)", "", ""], self.costs())?;
        let rows = self
            .sources
            .iter()
            .map(|(path, s)| [path.clone(), s.source.clone(), s.note.clone()]);
        table(f, ["values with a source", "from", "note"], rows)
    }
}

/// Returns the margin with the largest use among those of one limit, and their number, in the order of the limits. A
/// limit of bodies has a margin for each of them.
fn tightest(margins: &[Margin]) -> Vec<(&Margin, usize)> {
    let mut limits: Vec<(&Margin, usize)> = Vec::new();
    for margin in margins {
        let same = |(other, _): &&mut (&Margin, usize)| other.limit == margin.limit;
        match limits.iter_mut().find(same) {
            Some((kept, of)) => {
                *of += 1;
                if margin.used > kept.used {
                    *kept = margin;
                }
            }
            None => limits.push((margin, 1)),
        }
    }
    limits
}

impl Plan {
    /// Returns the features of the promised accuracy, one per line.
    #[must_use]
    pub fn details(&self) -> String {
        let lines = self
            .scene
            .chosen
            .details
            .iter()
            .map(|line| format!("  {line}\n"));
        format!(
            "\naccuracy, feature by feature\n{}",
            lines.collect::<String>()
        )
    }

    fn scales(&self) -> Vec<[String; 3]> {
        let row = |name: &str, value: f64, unit: &str| {
            [name.to_string(), number(value), unit.to_string()]
        };
        let clock = &self.clock;
        let mut rows = vec![
            row("time step", clock.time_step, "s"),
            row("end", self.scene.time.end, "s"),
            [
                String::from("steps"),
                clock.steps.to_string(),
                String::new(),
            ],
        ];
        if clock.warm_up_steps > 0 {
            rows.push([
                "warm-up steps at most".into(),
                clock.warm_up_steps.to_string(),
                String::new(),
            ]);
        }
        if let Some(blocks) = &self.scene.blocks {
            let fixed = format!("{} fixed", blocks.fixed);
            rows.push(["blocks".into(), blocks.number.to_string(), fixed]);
            rows.push(row("volume of the blocks", blocks.volume, "m3"));
        }
        if let Some(critical) = clock.critical_solid_time_step {
            rows.push([
                "solid steps per step".into(),
                clock.solid_steps_per_step.to_string(),
                String::new(),
            ]);
            rows.push(row("solid time step", clock.solid_time_step, "s"));
            rows.push(row("critical solid time step", critical, "s"));
        }
        if let (Some(units), Some(flow)) = (&self.units, &self.scene.flow) {
            let LatticeUnits { dimension, .. } = *units;
            rows.push(row("relaxation time tau", flow.relaxation_time, ""));
            rows.push(row(
                "viscosity on the lattice",
                units.viscosity_to_lattice(flow.kinematic_viscosity),
                "",
            ));
            rows.push(row(
                "velocity scale C = h/dt",
                units.velocity_scale(),
                "m/s",
            ));
            rows.push(row(
                "speed of sound C/sqrt 3",
                units.speed_of_sound(),
                "m/s",
            ));
            rows.push(row("pressure scale rho C^2", units.pressure_scale(), "Pa"));
            rows.push(row(
                "force scale",
                units.force_scale(),
                if dimension == 2 { "N/m" } else { "N" },
            ));
            if let Some(reynolds) =
                envelope::largest_reynolds(&self.scene).filter(|r| r.is_finite())
            {
                rows.push(row(
                    "largest Reynolds number at a lattice velocity of 0.1",
                    reynolds,
                    "",
                ));
            }
        }
        rows
    }

    fn costs(&self) -> Vec<[String; 3]> {
        let e = &self.estimate;
        let mut rows = vec![[
            "memory".to_string(),
            size(e.memory_bytes),
            format!(
                "{} per cell, {} grains",
                size(e.bytes_per_cell),
                number(e.grains)
            ),
        ]];
        if e.fluid_outputs > 0.0 {
            rows.push([
                "fluid output".into(),
                size(e.fluid_output_bytes),
                format!("{} times", number(e.fluid_outputs)),
            ]);
        }
        rows.push([
            "disk".into(),
            size(e.disk_bytes),
            "outputs and the checkpoints kept".into(),
        ]);
        let e = &self.estimate;
        let phases = [
            ("preparation", e.seconds.preparation),
            ("fluid", e.seconds.fluid),
            ("seepage", e.seconds.seepage),
            ("joints", e.seconds.joints),
            ("grains", e.seconds.grains),
            ("mapping", e.seconds.mapping),
            ("output", e.seconds.output),
        ];
        // Only phases with a relevant share, the longest first.
        let mut shares: Vec<(&str, f64)> = phases
            .into_iter()
            .filter(|phase| phase.1 > 0.05 * e.seconds_on_one_core)
            .collect();
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut why: Vec<String> = shares
            .iter()
            .map(|(phase, seconds)| {
                format!("{phase} {:.0} %", 100.0 * seconds / e.seconds_on_one_core)
            })
            .collect();
        if e.mlups > 0.0 {
            why.push(format!("{:.3} MLUPS", e.mlups));
        }
        let ground = self.scene.seepage.as_ref();
        if ground.is_some_and(|ground| {
            let unsaturated = ground.written.unsaturated.as_ref();
            unsaturated.is_some_and(|one| one.transient.is_some())
        }) {
            why.push(
                "test runs of unsaturated ground took 0.4 to 3 times as long, because the adaptive steps follow the \
                 fronts"
                    .into(),
            );
        }
        why.push(format!(
            "processor time; in addition the run waits about {} for MPI to start and for its files",
            duration(e.waiting_seconds)
        ));
        rows.push([
            "time on one core".into(),
            duration(e.seconds_on_one_core),
            why.join(", "),
        ]);
        if let Some(on) = e.on_cores {
            rows.push([
                format!("time on {} x {} cores", on.ranks, on.threads),
                duration(on.seconds),
                format!(
                    "ranks x threads; each core computes at {:.2} times the speed of a single core, the largest \
                     slab has {:.2} times the mean work; communication is not included",
                    on.crowded, on.unevenness
                ),
            ]);
        }
        rows
    }
}

fn duration(seconds: f64) -> String {
    if seconds < 120.0 {
        format!("{} s", number(seconds))
    } else if seconds < 7200.0 {
        format!("{:.1} min", seconds / 60.0)
    } else {
        format!("{:.1} h", seconds / 3600.0)
    }
}

/// Returns a table with aligned columns; an empty text without rows.
fn table(
    f: &mut Formatter<'_>,
    head: [&str; 3],
    rows: impl IntoIterator<Item = [String; 3]>,
) -> fmt::Result {
    let rows: Vec<[String; 3]> = rows.into_iter().collect();
    if rows.is_empty() {
        return Ok(());
    }
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells
            .chain([head[column].chars().count()])
            .max()
            .unwrap_or(0)
    };
    let (a, b) = (width(0), width(1));
    writeln!(f)?;
    let line = format!("{:a$}  {:b$}  {}", head[0], head[1], head[2]);
    writeln!(f, "{}", line.trim_end())?;
    writeln!(f, "{}", "-".repeat(line.trim_end().chars().count()))?;
    for [x, y, z] in &rows {
        writeln!(f, "{}", format!("{x:a$}  {y:b$}  {z}").trim_end())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::tightest;
    use crate::margin::margin;

    #[test]
    fn a_limit_of_many_bodies_has_one_line() {
        let of_bodies = |n: usize, cells: f64| {
            margin("cells per diameter", 4.0, cells, &format!("bodies[{n}]"))
        };
        let margins = [
            of_bodies(0, 20.0),
            margin("density", 0.1, 0.2, "time.end"),
            of_bodies(1, 5.0),
            of_bodies(2, 9.0),
        ];
        let lines = tightest(&margins);
        let lines: Vec<_> = lines.iter().map(|(m, of)| (m.path.as_str(), *of)).collect();
        assert_eq!(lines, [("bodies[1]", 3), ("time.end", 1)]);
    }
}
