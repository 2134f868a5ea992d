//! Tests of the whole engine: published and independent trajectories, exact laws, and the same bits in all modes of
//! execution.

mod blocks;
mod bonds;
mod columns;
mod displacement;
mod elastic;
mod images;
mod laws;
mod ledges;
mod repeated;
mod same_bits;
mod servo;
mod spheres;
mod wall_shapes;

use super::contact::Scaled;
use super::contact::cohesive_frictional::{self, CohesiveFrictional};
use super::contact::linear::{self, Linear};
use super::state::{Contacts, NamedColumns};
use super::*;
use nalgebra::Vector3;

pub(super) fn linear<S: Space>(
    parameters: linear::LinearParameters,
    settings: DemSettings<S>,
    walls: Vec<Wall<S>>,
) -> Dem<S> {
    let law = Law::Linear(Linear {
        parameters: PairTable::uniform(1, parameters),
    });
    Dem::new(law, settings, walls).unwrap()
}

pub(super) fn cohesive<S: Space>(
    parameters: cohesive_frictional::CohesiveFrictionalParameters,
    settings: DemSettings<S>,
    walls: Vec<Wall<S>>,
) -> Dem<S> {
    let law = Law::CohesiveFrictional(CohesiveFrictional {
        parameters: PairTable::uniform(1, parameters),
    });
    Dem::new(law, settings, walls).unwrap()
}

pub(super) const SPRINGS: linear::LinearParameters = linear::LinearParameters {
    normal_stiffness: Scaled::Absolute(1e5),
    stiffness_ratio: 1.0,
    friction: 0.5,
    normal_damping_ratio: 0.0,
    shear_damping_ratio: 0.0,
    attraction: false,
};

/// Contacts of a simulation of piping erosion: k_n/d = 150e6 N/m², k_s/k_n = 0.4, 20 degrees, C/d = 0.506 N/m.
pub(super) const PAPER: cohesive_frictional::CohesiveFrictionalParameters =
    cohesive_frictional::CohesiveFrictionalParameters {
        linear: linear::LinearParameters {
            normal_stiffness: Scaled::PerDiameter(150e6),
            stiffness_ratio: 0.4,
            // The tangent of 20 degrees.
            friction: 0.363_970_234_266_202_36,
            normal_damping_ratio: 0.0,
            shear_damping_ratio: 0.0,
            attraction: false,
        },
        cohesion: Scaled::PerDiameter(0.506),
    };

/// Returns the corners of a square in z = 0 with `n` by `n` squares of two triangles, at the coordinates `place`, and
/// the triangles.
pub(super) fn triangles(n: u32, place: impl Fn(u32) -> f64) -> (Vec<Vector3<f64>>, Vec<Vec<u32>>) {
    let places: Vec<f64> = (0..=n).map(place).collect();
    let rows = places.iter();
    let vertices = rows.flat_map(|y| places.iter().map(|x| Vector3::new(*x, *y, 0.0)));
    let mut facets = Vec::new();
    for y in 0..n {
        for x in 0..n {
            let a = y * (n + 1) + x;
            facets.push(vec![a, a + 1, a + n + 2]);
            facets.push(vec![a, a + n + 2, a + n + 1]);
        }
    }
    (vertices.collect(), facets)
}

/// Appends the grains and contacts of a rank to those of all.
pub(super) fn append(
    (grains, contacts): (&mut NamedColumns, &mut Contacts),
    (more, of_rank): (&NamedColumns, Contacts),
) {
    grains.append(more).unwrap();
    contacts.grains.append(&of_rank.grains).unwrap();
    contacts.walls.append(&of_rank.walls).unwrap();
    contacts.faces = of_rank.faces;
    contacts.steps = of_rank.steps;
}

/// Returns a box of side 2 `half` about the origin.
pub(super) fn about_origin<S: Space>(half: f64) -> GrainDomain<S> {
    let (mut lower, mut upper) = (S::Vector::default(), S::Vector::default());
    for axis in 0..S::DIMENSION {
        lower.set(axis, -half);
        upper.set(axis, half);
    }
    GrainDomain::closed(lower, upper, half / 50.0)
}

/// Returns the rows of a small table: `#` comments, a line of names, numbers.
pub(super) fn rows(text: &str) -> Vec<Vec<f64>> {
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .map(|line| line.split(',').map(|word| word.parse().unwrap()).collect())
        .collect()
}
