//! Grains, bodies and walls that overlap at the start.

use super::bodies::Body;
use super::findings::{Findings, number};
use super::grains::{GrainSource, Grains};
use super::grid::Grid;
use super::pairs::{self, Ball};
use super::walls::Wall;
use crate::number::real;
use nalgebra::Vector3;
use std::ops::ControlFlow;

/// Grains of a list, bodies and walls start apart: an overlap of more than a twentieth of the smaller radius is a slip
/// in the coordinates, which the springs would turn into an explosion.
pub(crate) fn overlaps(
    grid: &Grid,
    grains: Option<&Grains>,
    bodies: &[Body],
    walls: &[Wall],
    findings: &mut Findings,
) {
    const ALLOWED: f64 = 0.05;
    /// Pairs that are named, and pairs that are counted.
    const NAMED: usize = 20;
    const COUNTED: usize = 100_000;
    let listed = match grains.map(|grains| &grains.source) {
        Some(GrainSource::List(list)) => list.as_slice(),
        _ => &[],
    };
    let round = bodies.iter().enumerate().filter(|(_, b)| b.solid.is_none());
    let bodies: Vec<(usize, &Body)> = round.collect();
    let name = |solid: usize| match solid.checked_sub(listed.len()) {
        None => format!("grains.initial.list[{solid}]"),
        Some(body) => format!("bodies[{}]", bodies[body].0),
    };
    let of_grains = listed.iter().map(|g| (g.position, g.radius));
    let of_bodies = bodies.iter().map(|(_, b)| (b.position, b.radius));
    let solids: Vec<Ball> = of_grains
        .chain(of_bodies)
        .map(|(mut at, reach)| {
            at[grid.dimension..].fill(0.0);
            Ball { at, reach }
        })
        .collect();
    for (n, solid) in solids.iter().enumerate() {
        // Structures have an inside.
        for wall in walls.iter().filter(|wall| wall.structure.is_none()) {
            let allowed = (1.0 - ALLOWED) * solid.reach;
            let at = Vector3::from(solid.at);
            if let Some(surface) = &wall.surface
                && !surface.is_within(&at, allowed)
            {
                continue;
            }
            let distance = wall.surface.as_ref().map_or_else(
                || {
                    (0..3)
                        .map(|a| (solid.at[a] - wall.point[a]) * wall.normal[a])
                        .sum::<f64>()
                },
                |surface| surface.clearance(&at),
            );
            let depth = solid.reach - distance;
            if depth > ALLOWED * solid.reach {
                findings.error(
                    &format!("{}.position", name(n)),
                    format!(
                        "this overlaps the wall `{}` by {} m at the start",
                        wall.name,
                        number(depth)
                    ),
                    "move it away from the wall",
                );
            }
        }
    }
    let mut found = Vec::new();
    let all = pairs::near(&solids, [None; 3], |one, other| {
        let squared: f64 = (0..grid.dimension)
            .map(|a| (solids[one].at[a] - solids[other].at[a]).powi(2))
            .sum();
        let [a, b] = [solids[one].reach, solids[other].reach];
        let depth = a + b - squared.sqrt();
        if depth > ALLOWED * a.min(b) {
            found.push((other, one, depth));
        }
        if found.len() < COUNTED {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    found.sort_unstable_by_key(|(other, one, _)| (*other, *one));
    for (other, one, depth) in found.iter().take(NAMED) {
        findings.error(
            &format!("{}.position", name(*other)),
            format!(
                "this overlaps {} by {} m at the start",
                name(*one),
                number(*depth)
            ),
            "move them apart",
        );
    }
    if found.len() > NAMED {
        let least = if all.is_break() { "at least " } else { "" };
        findings.error(
            "grains.initial.list",
            format!(
                "{least}{} more pairs overlap",
                number(real(found.len() - NAMED))
            ),
            "move them apart",
        );
    }
}

/// A deposition knows walls and structures, but no bodies: grains that fall where a body stands would start inside it.
pub(crate) fn fallen_grains(
    grid: &Grid,
    gravity: [f64; 3],
    grains: Option<&Grains>,
    bodies: &[Body],
    findings: &mut Findings,
) {
    let Some(grains) = grains else {
        return;
    };
    let GrainSource::Deposition { clouds, .. } = &grains.source else {
        return;
    };
    let Some(down) = (0..grid.dimension).find(|&a| gravity[a].abs() > 0.0) else {
        return;
    };
    for (n, body) in bodies.iter().enumerate() {
        let below = clouds.iter().any(|cloud| {
            let mut way = cloud.block;
            if gravity[down] < 0.0 {
                way.from[down] = 0.0;
            } else {
                way.to[down] = grid.size[down];
            }
            way.touches(body.position, body.radius)
        });
        let emptied = grains.cut.iter().any(|(_, cut)| {
            (0..grid.dimension).all(|a| {
                cut.from[a] <= body.position[a] - body.radius
                    && cut.to[a] >= body.position[a] + body.radius
            })
        });
        if below && !emptied {
            findings.error(
                &format!("bodies[{n}].position"),
                format!(
                    "grains of the deposition fall where the body `{}` stands, and a deposition knows no bodies",
                    body.name
                ),
                "write it as one of `structures`, which grains fall around, empty its place with `grains.cut`, or move it",
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::case::{Document, examples};
    use crate::plan::Plan;
    use std::path::Path;

    #[test]
    fn grains_do_not_fall_through_a_body() {
        let text = examples::find("deposition").unwrap().text;
        let problems = |height: f64, cut: bool| {
            let mut set = vec![format!(
                r#"bodies=[{{"name": "ball", "material": "soil", "shape": {{"sphere": {{"radius": 0.002}}}}, "position": [0.012, 0.01, {height}], "motion": {{"fixed": {{}}}}}}]"#
            )];
            if cut {
                set.push(
                    r#"grains.cut=[{"name": "hole", "box": {"from": [0.008, 0.006, 0.01], "to": [0.016, 0.014, 0.02]}}]"#.into(),
                );
            }
            let document = Document::read(text, &set, Path::new(".")).unwrap();
            let problems = match Plan::prepare(document) {
                Ok(plan) => plan.warnings,
                Err(problems) => problems,
            };
            let about_it = problems.into_iter().filter(|problem| {
                problem.path == "bodies[0].position" && problem.reason.contains("deposition")
            });
            about_it.count()
        };
        assert_eq!(problems(0.03, false), 1, "in the cloud");
        assert_eq!(problems(0.015, false), 1, "below the cloud");
        assert_eq!(problems(0.015, true), 0, "in a hole");
    }
}
