//! Blocks in a file `BODIES.DAT` of LMGC90 (F. Dubois et al., CSMA 2011, hal-00596875): rigid bodies in
//! space (`RBDY3`) with one contactor each, a polyhedron (`POLYR`) or a plane (`PLANx`).
//!
//! ```text
//! $bdyty
//!  RBDY3      1
//! $nodty
//!  NO6xx      1                coo1= ...  coo2= ...  coo3= ...     position of the body
//!                              coo4= ...  coo5= ...  coo6= ...     its rotation, which is zero
//! $tacty
//!  POLYR      1  color  BLEUx  nb_vertex=    8      nb_face=   12
//!                              coo1= ...  coo2= ...  coo3= ...     for each corner, from the position of the body
//!                              ver1= ...  ver2= ...  ver3= ...     for each facet, the numbers of its corners from 1
//! $$$$$$
//! ```
//!
//! A plane is a cuboid with three half edges (`axe1`, `axe2`, `axe3`). It carries other bodies and is fixed.
//!
//! Behaviour laws, colours and inertia are not used: materials and contact laws are in the case. Bodies that do not
//! move are named in another file of LMGC90 (`DRV_DOF.DAT`), which is not read.

use super::error::END;
use super::{ListError, Listed, Origin, faces};
use dem::polyhedron::Polyhedron;
use nalgebra::Vector3;

/// First word of each body.
const BODY: &str = "$bdyty";

/// Returns `true` if a text begins with a body of LMGC90, or with the end of one, after comments.
pub(super) fn is_bodies(text: &str) -> bool {
    let text = text.trim_start_matches('\u{feff}');
    let mut lines = text.lines().map(str::trim);
    lines
        .find(|line| !line.is_empty() && !line.starts_with('!'))
        .is_some_and(|line| line.starts_with(BODY) || line.starts_with(END))
}

/// Returns the blocks of a text in the order of the file; the inner errors are those of single bodies.
pub(super) fn read(text: &str) -> Vec<Result<Listed, ListError>> {
    let lines = (1..).zip(text.lines().map(str::trim));
    let lines: Vec<(usize, &str)> = lines
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('!'))
        .collect();
    let bodies = lines.split(|(_, line)| line.starts_with(BODY)).skip(1);
    bodies
        .map(|body| {
            let first = body.first().map_or(0, |(number, _)| *number);
            block(body).map_err(|e| e.with_origin(Origin::Body(first)))
        })
        .collect()
}

/// Returns the block of the lines of a body, each with its number in the file.
fn block(lines: &[(usize, &str)]) -> Result<Listed, ListError> {
    let (_, head) = lines.first().ok_or(ListError::NoBody)?;
    if !head.starts_with("RBDY3") {
        return Err(ListError::NotRigid((*head).to_owned()));
    }
    if !lines.iter().any(|(_, line)| line.starts_with(END)) {
        return Err(ListError::NoEnd);
    }
    let position = position(lines)?;
    let contactors: Vec<usize> = (0..lines.len())
        .filter(|at| lines[*at].1.contains("color"))
        .collect();
    let [only] = contactors[..] else {
        return Err(ListError::Contactors(contactors.len()));
    };
    let kind = lines[only].1.split_whitespace().next().unwrap_or_default();
    match kind {
        "POLYR" => polyhedron(&lines[only..], position),
        "PLANx" => plane(&lines[only..], position),
        _ => Err(ListError::Contactor(kind.to_owned())),
    }
}

/// Returns the block of a plane, whose contactor is on the first of the lines.
fn plane(lines: &[(usize, &str)], position: Vector3<f64>) -> Result<Listed, ListError> {
    if let Some((number, line)) = lines.get(1).filter(|(_, line)| !line.starts_with(END)) {
        return Err(ListError::OfPlane((*line).to_owned()).with_origin(Origin::Line(*number)));
    }
    let axes = Vector3::from(values::<f64, 3>(lines[0])?);
    let signs = (0..8).map(|n| Vector3::from_fn(|a, _| if n >> a & 1 == 0 { -1.0 } else { 1.0 }));
    let corners: Vec<Vector3<f64>> = signs
        .map(|sign| position + axes.component_mul(&sign))
        .collect();
    Ok(Listed {
        solid: Polyhedron::from_vertices(&corners)?,
        material: None,
        fixed: true,
    })
}

/// Returns the block of a polyhedron, whose contactor is on the first of the lines.
fn polyhedron(lines: &[(usize, &str)], position: Vector3<f64>) -> Result<Listed, ListError> {
    let [vertices, facets] = values(lines[0])?;
    let following = |skip: usize, count: usize| {
        let rows = lines.get(1 + skip..)?;
        rows.get(..count)
    };
    let corners = following(0, vertices).ok_or(ListError::FewLines)?.iter();
    let corners: Result<Vec<Vector3<f64>>, ListError> = corners
        .map(|row| Ok(position + Vector3::from(values::<f64, 3>(*row)?)))
        .collect();
    let facets = following(vertices, facets)
        .ok_or(ListError::FewLines)?
        .iter();
    let facets: Result<Vec<Vec<usize>>, ListError> = facets
        .map(|row| {
            let numbers = values::<usize, 3>(*row)?;
            match numbers.iter().find(|n| !(1..=vertices).contains(*n)) {
                Some(wrong) => Err(ListError::NoCorner(*wrong).with_origin(Origin::Line(row.0))),
                None => Ok(numbers.map(|number| number - 1).to_vec()),
            }
        })
        .collect();
    faces::block(&corners?, &facets?)
}

/// Returns the position of a body \[m\].
fn position(lines: &[(usize, &str)]) -> Result<Vector3<f64>, ListError> {
    let node = lines.iter().position(|(_, line)| line.starts_with("NO6xx"));
    let node = node.ok_or(ListError::NoNode)?;
    let turned = values::<f64, 3>(*lines.get(node + 1).ok_or(ListError::NoNode)?)?;
    if turned.iter().any(|angle| angle.abs() > 0.0) {
        return Err(ListError::Turned);
    }
    Ok(values::<f64, 3>(lines[node])?.into())
}

/// Returns the numbers after the signs `=` of a line, whose exponents may be written with D.
fn values<N: std::str::FromStr, const COUNT: usize>(
    (number, line): (usize, &str),
) -> Result<[N; COUNT], ListError> {
    let words = line.split('=').skip(1);
    let words = words.map(|part| part.split_whitespace().next().unwrap_or_default());
    let numbers: Vec<N> = words
        .map_while(|word| word.replace(['D', 'd'], "e").parse().ok())
        .collect();
    let short = || ListError::FewNumbers {
        line: line.to_owned(),
        count: COUNT,
    };
    numbers
        .try_into()
        .map_err(|_| short().with_origin(Origin::Line(number)))
}
