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
            let distance = wall.surface.as_ref().map_or_else(
                || {
                    (0..3)
                        .map(|a| (solid.at[a] - wall.point[a]) * wall.normal[a])
                        .sum::<f64>()
                },
                |surface| surface.clearance(&Vector3::from(solid.at)),
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
