//! Indicators of the erosion mechanism: bond by bond at the faces of the hole while the bulk remains
//! intact, or by failure of the bulk.
//!
//! - **Contacts and bonds per grain** at the start: each grain counts its contacts with grains and
//!   walls. A network of discs whose contacts carry no moment is rigid with at least three contacts per
//!   grain (four for spheres), and with at least four (six) without friction.
//! - **Share at the faces**: fraction of the bonds broken at the wall of the hole, among all that broke
//!   before the fraction [`FIRST`] of the mass had left.
//! - **Displacement of the bulk**: mean distance, in mean diameters, of the grains from their initial
//!   positions. The bulk
//!   consists of the grains that started next to the hole, that are more than [`DEPTH_BEHIND`] mean diameters
//!   behind its present faces and from its ends, and that are still in the packing.

use super::hole::{DEPTH_BEHIND, Hole, depth};
use crate::removal::boxed;
use crate::view::StateView;
use analysis::erosion_law::HoleFaces;
use base::number::real;
use decomposition::ExactSum;
use dem::space::{Components, Space};
use serde::{Deserialize, Serialize};

/// Fraction of the mass that leaves during the observation of the mechanism.
const FIRST: f64 = 0.1;

/// Mechanism of erosion so far; part of a checkpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Mechanism {
    /// Numbers of bonds broken inside and at the wall of the hole when the fraction [`FIRST`] of the
    /// mass had left.
    at_first: Option<[u64; 2]>,
    /// Displacement of the bulk at the last row up to that time, or the first row after it.
    displacement: Option<f64>,
    /// `true` if the row that ends the observation was written.
    complete: bool,
}

impl Mechanism {
    /// Returns `true` if the numbers of broken bonds must be recorded now: the fraction [`FIRST`] of
    /// the mass has just left.
    pub(super) fn is_due(&self, eroded_fraction: f64) -> bool {
        self.at_first.is_none() && eroded_fraction >= FIRST
    }

    /// Records the numbers of bonds broken inside and at the wall, when [`Self::is_due`] returns
    /// `true`.
    pub(super) fn note_bonds(&mut self, broken: [u64; 2]) {
        self.at_first = Some(broken);
    }

    /// Records the displacement of the bulk at a row, in mean diameters; NaN if there is none.
    pub(super) fn note_displacement(&mut self, diameters: f64) {
        if !self.complete {
            if diameters.is_finite() {
                self.displacement = Some(diameters);
            }
            self.complete = self.at_first.is_some();
        }
    }

    /// Returns the fraction of bonds broken at the faces, given the numbers `broken` so far inside and
    /// at the wall; none before a bond broke.
    pub(super) fn face_share(&self, broken: [u64; 2]) -> Option<f64> {
        let [inside, at_wall] = self.at_first.unwrap_or(broken).map(real);
        (inside + at_wall > 0.0).then(|| at_wall / (inside + at_wall))
    }

    pub(super) fn displacement(&self) -> Option<f64> {
        self.displacement
    }
}

/// Returns the mean number of contacts and bonds per grain over all `grains` of all ranks; none without
/// contacts. Collective.
pub(super) fn contacts_per_grain<S: Space>(
    view: &StateView<'_, S>,
    first_grain: u64,
    grains: u64,
) -> Option<[f64; 2]> {
    let mut ends = [0_u64; 2];
    if let Some(dem) = view.dem {
        let is_grain = |k: usize| view.particles.body[k].id >= first_grain;
        dem.for_each_contact(view.particles, |contact| {
            if !contact.touches() {
                return;
            }
            let of_grains = [Some(contact.grain), contact.other]
                .into_iter()
                .flatten()
                .filter(|k| is_grain(*k))
                .count() as u64;
            ends[0] += of_grains;
            ends[1] += if contact.bonded { of_grains } else { 0 };
        });
    }
    let communicator = view.domain.communicator();
    let ends = ends.map(|n| communicator.all_reduce_sum_u64(n));
    (view.dem.is_some() && grains > 0).then(|| ends.map(|n| real(n) / real(grains)))
}

/// Returns the displacement of the bulk in mean diameters; NaN if no grain belongs to it. Collective.
pub(super) fn bulk_displacement<S: Space>(
    view: &StateView<'_, S>,
    hole: &Hole,
    diameter: f64,
    faces: HoleFaces,
) -> f64 {
    let grid = &view.plan.scene.grid;
    let first_grain = view.plan.scene.first_grain();
    let deep = DEPTH_BEHIND * diameter;
    let between = hole.from[hole.along] + deep..hole.to[hole.along] - deep;
    let (mut sum, mut grains) = (ExactSum::new(), 0_u64);
    for k in 0..view.particles.owned() {
        let Some(moved) = view.particles.displacement(k) else {
            continue;
        };
        let began = boxed(&(view.particles.motion[k].position - moved), grid);
        if view.particles.body[k].id >= first_grain
            && depth(faces, began[hole.across]) > deep
            && between.contains(&began[hole.along])
            && hole.spans(hole.third(), began[hole.third()], grid.dimension)
        {
            sum.add(moved.length() / diameter);
            grains += 1;
        }
    }
    let communicator = view.domain.communicator();
    sum.all_reduce(communicator);
    let grains = communicator.all_reduce_sum_u64(grains);
    if grains == 0 {
        f64::NAN
    } else {
        sum.value() / real(grains)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mechanism_is_that_of_the_first_tenth() {
        let mut seen = Mechanism::default();
        assert_eq!(seen.face_share([0, 0]), None);
        assert_eq!(seen.face_share([1, 3]), Some(0.75));
        assert!(!seen.is_due(0.0999) && seen.is_due(0.1));
        seen.note_displacement(0.25);
        seen.note_displacement(f64::NAN);
        assert_eq!(seen.displacement(), Some(0.25));
        seen.note_bonds([2, 6]);
        assert!(!seen.is_due(0.2));
        // The first row at or after that time is the last that counts.
        seen.note_displacement(0.5);
        seen.note_displacement(7.0);
        assert_eq!(seen.displacement(), Some(0.5));
        assert_eq!(seen.face_share([200, 6]), Some(0.75));
    }
}
