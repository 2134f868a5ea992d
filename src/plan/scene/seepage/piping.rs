//! Backward erosion piping, resolved on the coarse grid.

use super::{PATH, Seepage};
use crate::scene::aligned_box::AlignedBox;
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use base::error::Remedy;
use base::number::{real, whole};
use base::vector::dot;
use case::Case;
use case::backward_erosion::{BackwardErosion, EquilibriumDiameter, WidthOfPipe};
use case::check;
use darcy::Condition;
use darcy::piping::{
    BottomGrains, MAX_CELLS, MIN_CELLS, PipePath, PipeWidth, PipingSettings, rule,
};
use serde::Serialize;

/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];
/// Distance by which a line may deviate from its plane or its row of cells, as a fraction of the edge of a cell.
const SLACK: f64 = 1e-3;
/// Range of ratios of edges of a cell across a pipe in 3-D, in which its resistance is that of a square cell.
const SQUARE: f64 = 0.01;

/// Study of backward erosion piping.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PipingScene {
    /// Fields as written.
    pub written: BackwardErosion,
    /// Settings on the coarse grid.
    pub settings: PipingSettings,
    /// Difference of head between drive and exit in the case \[m\].
    pub head: f64,
}

impl Seepage {
    /// Returns the study of backward erosion of the case; reports a finding if something prevents it.
    pub(super) fn piping_of(
        &self,
        case: &Case,
        grid: &Grid,
        findings: &mut Findings,
    ) -> Option<PipingScene> {
        let written = self.written.backward_erosion.as_ref()?;
        let path = format!("{PATH}.backward_erosion");
        if !self.suits_piping(case, &path, findings) {
            return None;
        }
        let vertical = vertical(case, &path, findings)?;
        let drive = self.boundary_with_head(&written.drive, &format!("{path}.drive"), findings);
        let exit = self.boundary_with_head(&written.exit, &format!("{path}.exit"), findings);
        let (drive, exit) = (drive?, exit?);
        if drive.0 == exit.0 {
            findings.error(
                &format!("{path}.exit"),
                "the driving boundary and the exit are the same",
                "name two boundaries",
            );
            return None;
        }
        let row = self.row(written, grid, vertical, &path, findings)?;
        self.check_exit(&row, exit.0, &path, findings)?;
        let width = self.width(written, &row, grid, &path, findings)?;
        let water = self.written.density;
        if written.grain_density <= water {
            findings.error(
                &format!("{path}.grain_density"),
                format!(
                    "the grains ({} kg/m3) are not heavier than the water ({} kg/m3)",
                    number(written.grain_density),
                    number(water)
                ),
                Remedy::from("state the density of the grains: quartz has 2650 kg/m3")
                    .set(format!("{path}.grain_density"), 2650.0),
            );
            return None;
        }
        let [least, most] = rule::TESTED;
        if written.rule.is_some() && !(least..=most).contains(&written.d70) {
            findings.warn(
                &format!("{path}.d70"),
                format!(
                    "the rule was found by tests with d70 from {} to {} m; the value is {} m",
                    number(least),
                    number(most),
                    number(written.d70)
                ),
                "omit `rule`, or compare with care",
            );
        }
        let diameter = match written.diameter {
            EquilibriumDiameter::D70 => written.d70,
            EquilibriumDiameter::Sellmeijer2011 => rule::effective_diameter(written.d70),
        };
        Some(PipingScene {
            settings: PipingSettings {
                path: row,
                drive: drive.0,
                exit: exit.0,
                grains: BottomGrains {
                    diameter,
                    relative_density: written.grain_density / water,
                    white: written.white_coefficient,
                    bedding_angle: written.bedding_angle.to_radians(),
                },
                width,
            },
            head: drive.1 - exit.1,
            written: written.clone(),
        })
    }

    /// Returns `true` if the ground is saturated, without grains and inclined beds, and all its imposed pressures are
    /// heads.
    fn suits_piping(&self, case: &Case, path: &str, findings: &mut Findings) -> bool {
        let mut suits = true;
        let mut refuse = |reason: &str, remedy: Remedy| {
            findings.error(path, reason, remedy);
            suits = false;
        };
        let remove = || Remedy::take_out("remove `backward_erosion`", path);
        if case.grains.is_some() || !case.bodies.is_empty() {
            refuse(
                "backward erosion is computed in ground of zones, but the case has grains",
                remove(),
            );
        }
        if self.written.unsaturated.is_some() {
            refuse(
                "backward erosion needs saturated ground, but the case has `unsaturated`",
                remove(),
            );
        }
        if self.written.zones.iter().any(|zone| zone.dip.is_some()) {
            refuse(
                "backward erosion needs beds along the axes, but a zone has a `dip`",
                remove(),
            );
        }
        let held = |condition: &Condition| matches!(condition, Condition::Pressure { .. });
        if self.conditions().any(|condition| held(&condition)) {
            refuse(
                "backward erosion needs heads, but a boundary or drain imposes a pressure",
                "state it as a head: pressure/(density gravity) + elevation".into(),
            );
        }
        suits
    }

    /// Returns the index of a boundary or drain with a head, and the head \[m\].
    fn boundary_with_head(
        &self,
        name: &str,
        path: &str,
        findings: &mut Findings,
    ) -> Option<(usize, f64)> {
        let patches = self.patches.iter().map(|p| (p.name.as_str(), p.condition));
        let drains = self.drains.iter().map(|d| (d.name.as_str(), d.condition));
        let all: Vec<(&str, Condition)> = patches.chain(drains).collect();
        let found = all.iter().position(|(known, _)| *known == name);
        let Some(found) = found else {
            let known: Vec<&str> = all.iter().map(|(known, _)| *known).collect();
            let remedy = match check::nearest(name, &known) {
                Some(near) => Remedy::from(format!("did you mean `{near}`?")).set(path, near),
                None if known.is_empty() => {
                    "add a boundary or a drain with a head to `fluid.darcy`".into()
                }
                None => format!("use one of: {}", known.join(", ")).into(),
            };
            findings.error(
                path,
                format!("no boundary or drain of the seepage has the name `{name}`"),
                remedy,
            );
            return None;
        };
        let Condition::Head { value } = all[found].1 else {
            findings.error(
                path,
                format!("`{name}` imposes no head"),
                "name a boundary with {\"head\": {\"value\": ...}}",
            );
            return None;
        };
        Some((found, value))
    }

    /// Returns the row of cells below the line of the pipe.
    fn row(
        &self,
        written: &BackwardErosion,
        grid: &Grid,
        (vertical, up): (usize, f64),
        path: &str,
        findings: &mut Findings,
    ) -> Option<PipePath> {
        let from = AlignedBox::vector(
            grid,
            &written.pipe.from,
            &format!("{path}.pipe.from"),
            findings,
        );
        let to = AlignedBox::vector(grid, &written.pipe.to, &format!("{path}.pipe.to"), findings);
        let path = format!("{path}.pipe");
        let apart = |a: usize| (to[a] - from[a]).abs() > SLACK * self.spacing[a];
        let along: Vec<usize> = (0..grid.dimension).filter(|&a| apart(a)).collect();
        let &[axis] = along.as_slice() else {
            findings.error(
                &path,
                "the line of the pipe is not parallel to one axis",
                "write ends that differ in one horizontal coordinate",
            );
            return None;
        };
        if axis == vertical {
            findings.error(
                &path,
                format!("the line of the pipe is vertical (along {})", AXES[axis]),
                "a pipe runs along the lower face of a roof: write ends at one elevation",
            );
            return None;
        }
        let mut first = [0; 3];
        for a in (0..grid.dimension).filter(|&a| a != axis) {
            let upwards = (a == vertical).then_some(up);
            first[a] = self.cell_below(a, from[a], upwards, &path, findings)?;
        }
        let rises = to[axis] > from[axis];
        let (low, high) = (from[axis].min(to[axis]), from[axis].max(to[axis]));
        let bound = |x: f64| {
            let place = (x - self.origin[axis]) / self.spacing[axis];
            let centre = (place - 0.5 - 1e-9).ceil();
            whole(centre.clamp(0.0, real(self.cells[axis])))
        };
        let (begin, end) = (bound(low), bound(high));
        let count = end.saturating_sub(begin);
        if !(MIN_CELLS..=MAX_CELLS).contains(&count) {
            findings.error(
                &path,
                format!(
                    "the line contains {count} centres of cells along {}; a pipe has {MIN_CELLS} to {MAX_CELLS}",
                    AXES[axis]
                ),
                "change the ends of the line or the size of the cells",
            );
            return None;
        }
        first[axis] = if rises { begin } else { end - 1 };
        let row = PipePath {
            first,
            axis,
            rises,
            count,
            vertical,
        };
        self.check_roof(&row, up > 0.0, &path, grid, findings)
            .then_some(row)
    }

    /// Returns the cell of a coordinate across a pipe: below the plane of the roof, if the upward direction along the
    /// axis is given, otherwise the one that contains it; reports a finding if there is none.
    fn cell_below(
        &self,
        a: usize,
        x: f64,
        upwards: Option<f64>,
        path: &str,
        findings: &mut Findings,
    ) -> Option<usize> {
        let place = (x - self.origin[a]) / self.spacing[a];
        let cell = match upwards {
            None => place.floor(),
            Some(up) => {
                let plane = place.round();
                if (place - plane).abs() > SLACK {
                    findings.error(
                        path,
                        format!(
                            "the roof at {} = {} m lies between the planes of the cells, which are {} m apart",
                            AXES[a],
                            number(x),
                            number(self.spacing[a])
                        ),
                        format!(
                            "move it to {} m, or change the cells",
                            number(self.origin[a] + plane * self.spacing[a])
                        ),
                    );
                    return None;
                }
                if up > 0.0 { plane - 1.0 } else { plane }
            }
        };
        if (0.0..real(self.cells[a])).contains(&cell) {
            return Some(whole(cell));
        }
        findings.error(
            path,
            format!(
                "the line of the pipe at {} = {} m has no cell of the seepage below it",
                AXES[a],
                number(x)
            ),
            format!(
                "the grid reaches from {} to {} m there",
                number(self.origin[a]),
                number(self.end()[a])
            ),
        );
        None
    }

    /// Checks that a pipe begins at its exit: the first cell is next to a cell of the exit.
    fn check_exit(
        &self,
        row: &PipePath,
        exit: usize,
        path: &str,
        findings: &mut Findings,
    ) -> Option<()> {
        let (name, ends): (&str, [[usize; 2]; 3]) = match self.patches.get(exit) {
            Some(patch) => {
                let face = patch.face.axis();
                let last = self.cells[face] - 1;
                let end = if patch.face.is_max() { last } else { 0 };
                let ends = std::array::from_fn(|a| {
                    if a == face {
                        [end, end + 1]
                    } else {
                        [patch.from[a], patch.to[a]]
                    }
                });
                (&patch.name, ends)
            }
            None => {
                let drain = self.drains.get(exit - self.patches.len())?;
                if self.reaches(&drain.cells, row.first) {
                    return Some(());
                }
                let ends = std::array::from_fn(|a| [drain.cells.from[a], drain.cells.to[a]]);
                (&drain.name, ends)
            }
        };
        let apart = |a: usize| {
            let ([from, to], cell) = (ends[a], row.first[a]);
            from.saturating_sub(cell).max((cell + 1).saturating_sub(to))
        };
        let surface = exit.checked_sub(self.patches.len());
        let surface = surface.and_then(|n| self.drains.get(n));
        let surface = surface.is_some_and(|drain| drain.cells.only.is_some());
        if !surface && (0..3).all(|a| apart(a) <= 1) {
            return Some(());
        }
        findings.error(
            &format!("{path}.pipe"),
            format!("the line of the pipe does not begin at the exit `{name}`"),
            "write as `from` the edge of the exit, and as `to` the end towards the driving boundary",
        );
        None
    }

    /// `true` if the cells of a pipe are ground whose roof has no condition; reports a finding otherwise.
    fn check_roof(
        &self,
        row: &PipePath,
        rises: bool,
        path: &str,
        grid: &Grid,
        findings: &mut Findings,
    ) -> bool {
        let vertical = row.vertical;
        let coarse = self.coarse_grid(grid.dimension);
        let half = 0.5 * self.spacing[vertical];
        for cell in row.cells() {
            let centre = coarse.centre(cell);
            let outside =
                |(outward, offset): &([f64; 3], f64), at: [f64; 3]| dot(*outward, at) > *offset;
            let solid = self
                .solids
                .iter()
                .any(|s| s.distance(centre) < (1.0 - SLACK) * half);
            let drained = self
                .drains
                .iter()
                .any(|drain| drain.cells.contains(&coarse, cell));
            if solid || drained || self.planes.iter().any(|plane| outside(plane, centre)) {
                findings.error(
                    path,
                    format!(
                        "the cell at ({}) m on the line of the pipe is not completely ground: \
                         a structure, a drain or a plane of the enclosure lies in it",
                        centre[..grid.dimension].iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ")
                    ),
                    "move the line to the lower face of the structure, and that face to a plane between cells",
                );
                return false;
            }
            let at_end = cell[vertical] == if rises { self.cells[vertical] - 1 } else { 0 };
            // A roof may be a structure, a plane, the end of the grid, or a zone of clay above one of sand.
            let mut above = centre;
            above[vertical] += if rises { 2.0 * half } else { -2.0 * half };
            let roofed = self
                .solids
                .iter()
                .any(|s| s.distance(above) < (1.0 + SLACK) * half);
            let roofed = roofed || at_end || self.written.zones.len() > 1;
            if !roofed && !self.planes.iter().any(|plane| outside(plane, above)) {
                findings.error(
                    path,
                    format!(
                        "the ground continues above the line of the pipe at ({}) m: there is no roof",
                        centre[..grid.dimension].iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ")
                    ),
                    "move the line to the lower face of a structure, to the end of the grid, or below a zone of clay",
                );
                return false;
            }
            let on_roof = self.patches.iter().rfind(|patch| {
                let covers =
                    |a: usize| a == vertical || (patch.from[a]..patch.to[a]).contains(&cell[a]);
                patch.face.axis() == vertical && patch.face.is_max() == rises && (0..3).all(covers)
            });
            if let Some(patch) = on_roof.filter(|p| at_end && p.condition.holds()) {
                findings.error(
                    path,
                    format!(
                        "the pipe has no roof at ({}) m: the boundary `{}` lies there",
                        centre[..grid.dimension].iter().map(|x| number(*x)).collect::<Vec<_>>().join(", "),
                        patch.name
                    ),
                    "begin the line at the edge of the exit, and end it before the driving boundary",
                );
                return false;
            }
        }
        true
    }

    /// Returns the width of the pipe: `Some(None)` in 2-D, `None` if a finding was reported.
    fn width(
        &self,
        written: &BackwardErosion,
        row: &PipePath,
        grid: &Grid,
        path: &str,
        findings: &mut Findings,
    ) -> Option<Option<PipeWidth>> {
        let path = format!("{path}.width");
        let width = match (grid.dimension, written.width) {
            (2, None) => return Some(None),
            (2, Some(_)) => {
                findings.error(
                    &path,
                    "a section in 2-D has a pipe of unit width",
                    Remedy::take_out("remove the width", path.as_str()),
                );
                return None;
            }
            (_, None) => {
                findings.error(
                    &path,
                    "a pipe in 3-D needs its width",
                    "add {\"fixed\": WIDTH} in m, or {\"ratio\": WIDTH OVER HEIGHT}",
                );
                return None;
            }
            (_, Some(width)) => width,
        };
        let across = self.spacing[3 - row.axis - row.vertical];
        let down = self.spacing[row.vertical];
        if (across / down - 1.0).abs() > SQUARE {
            findings.error(
                &path,
                format!(
                    "the cells of the seepage are {} m wide and {} m high across the pipe; the resistance of a slit \
                     in a cell needs square ones",
                    number(across),
                    number(down)
                ),
                "use cells with equal edges across the pipe",
            );
            return None;
        }
        match width {
            WidthOfPipe::Fixed(width) if width > across => {
                findings.error(
                    &path,
                    format!(
                        "the pipe is {} m wide, a cell {} m; it must not be wider than a cell",
                        number(width),
                        number(across)
                    ),
                    Remedy::from(format!("use at most {} m, or larger cells", number(across)))
                        .set(format!("{path}.fixed"), across),
                );
                None
            }
            WidthOfPipe::Fixed(width) => Some(Some(PipeWidth::Fixed(width))),
            WidthOfPipe::Ratio(ratio) => Some(Some(PipeWidth::Ratio(ratio))),
        }
    }
}

/// Returns the axis of gravity and the sign of the upward direction along it; reports a finding if there is none.
fn vertical(case: &Case, path: &str, findings: &mut Findings) -> Option<(usize, f64)> {
    let gravity = (case.gravity.as_ref()).map_or([0.0; 3], |g| g.to_array());
    let pulls: Vec<usize> = (0..3).filter(|&a| gravity[a].abs() > 0.0).collect();
    if let &[axis] = pulls.as_slice() {
        return Some((axis, -gravity[axis].signum()));
    }
    findings.error(
        path,
        "backward erosion needs gravity along one axis",
        "write `gravity` such as [0, -9.81]",
    );
    None
}
