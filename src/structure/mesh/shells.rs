//! Shells of a triangulated surface: parts connected by edges, each with one outside.
//!
//! Files of other programs wind their triangles in any order. From the first triangle of a shell the winding is
//! propagated over its edges. The shells of a closed surface have a positive total volume; a shell that is inside
//! out becomes a solid of its own, unless it lies in another one and bounds a cavity.

use super::super::{Point, cross, dot, minus};
use super::crossings;
use std::collections::HashMap;

/// Consistently wound triangles by shell.
pub(super) struct Shells {
    /// Shell index of each triangle.
    pub(super) of: Vec<usize>,
    /// Number of shells.
    pub(super) count: usize,
    /// Number of edges with only one triangle.
    pub(super) open_edges: usize,
    /// `true` if more than two triangles share an edge.
    pub(super) many_at_an_edge: bool,
}

/// Triangle at an edge, and `true` if it traverses the edge from the lower vertex to the higher one.
type Side = (usize, bool);

fn edges(triangles: &[[u32; 3]]) -> HashMap<[u32; 2], Vec<Side>> {
    let mut edges: HashMap<[u32; 2], Vec<Side>> = HashMap::new();
    for (n, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges
                .entry([a.min(b), a.max(b)])
                .or_default()
                .push((n, a < b));
        }
    }
    edges
}

/// Winds the triangles of each shell consistently, and returns the shells.
///
/// # Errors
/// If a shell is not orientable, or if triangles that share an edge do not bound a solid.
pub(super) fn wind(triangles: &mut [[u32; 3]]) -> Result<Shells, String> {
    const NONE: usize = usize::MAX;
    let edges = edges(triangles);
    let mut beside: Vec<Vec<(usize, bool)>> = vec![Vec::new(); triangles.len()];
    for sides in edges.values() {
        if let [(a, forward), (b, other)] = sides[..] {
            beside[a].push((b, forward == other));
            beside[b].push((a, forward == other));
        }
    }
    let mut of = vec![NONE; triangles.len()];
    let mut turned = vec![false; triangles.len()];
    let mut count = 0;
    for first in 0..triangles.len() {
        if of[first] != NONE {
            continue;
        }
        of[first] = count;
        let mut members = vec![first];
        let mut next = 0;
        while let Some(&triangle) = members.get(next) {
            next += 1;
            for &(other, against) in &beside[triangle] {
                let turns = turned[triangle] != against;
                if of[other] == NONE {
                    (of[other], turned[other]) = (count, turns);
                    members.push(other);
                } else if turned[other] != turns {
                    return Err(
                        "the surface has only one side, like a Möbius strip, and therefore no inside".into(),
                    );
                }
            }
        }
        // Keep the winding of most triangles of the file.
        let against = members.iter().filter(|&&n| turned[n]).count();
        if 2 * against > members.len() {
            members.iter().for_each(|&n| turned[n] = !turned[n]);
        }
        count += 1;
    }
    for (t, turns) in triangles.iter_mut().zip(&turned) {
        if *turns {
            t.swap(1, 2);
        }
    }
    let open_edges = edges.values().filter(|sides| sides.len() == 1).count();
    for (_, sides) in edges.iter().filter(|(_, sides)| sides.len() > 2) {
        let forward = |side: &&Side| side.1 != turned[side.0];
        let ahead = sides.iter().filter(forward).count();
        if 2 * ahead != sides.len() {
            return Err(format!(
                "{} triangles meet at an edge, and {ahead} of them run along it in the same direction: the \
                 surface does not bound a solid",
                sides.len()
            ));
        }
    }
    Ok(Shells {
        of,
        count,
        open_edges,
        many_at_an_edge: edges.values().any(|sides| sides.len() > 2),
    })
}

/// Reverses the shells of a closed surface that are inside out: all of them if their total volume is negative, and then
/// those that do not lie in another shell.
pub(super) fn turn_outward(shells: &Shells, vertices: &[Point], triangles: &mut [[u32; 3]]) {
    let volume = |triangles: &[[u32; 3]], shell: Option<usize>| -> f64 {
        let base = vertices[0];
        let own = |n: &usize| shell.is_none_or(|shell| shells.of[*n] == shell);
        (0..triangles.len())
            .filter(own)
            .map(|n| {
                let [a, b, c] = triangles[n].map(|v| minus(vertices[v as usize], base));
                dot(a, cross(b, c)) / 6.0
            })
            .sum()
    };
    if volume(triangles, None) < 0.0 {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    if shells.count == 1 {
        return;
    }
    for shell in 0..shells.count {
        if volume(triangles, Some(shell)) >= 0.0 {
            continue;
        }
        let of_others = (0..triangles.len()).filter(|&n| shells.of[n] != shell);
        let others: Vec<[Point; 3]> = of_others
            .map(|n| triangles[n].map(|v| vertices[v as usize]))
            .collect();
        let mut own = (0..triangles.len()).filter(|&n| shells.of[n] == shell);
        let outside = own.any(|n| {
            let [a, b, c] = triangles[n].map(|v| vertices[v as usize]);
            let middle = std::array::from_fn(|axis| (a[axis] + b[axis] + c[axis]) / 3.0);
            crossings::winding(&others, middle) <= 0
        });
        if outside {
            let own = |n: &usize| shells.of[*n] == shell;
            for n in (0..triangles.len()).filter(own) {
                triangles[n].swap(1, 2);
            }
        }
    }
}
