//! Fabric of the grains in a box: number, solid fraction, contacts and mean stress, and the sizes of the grains
//! that left the domain.
//!
//! Grains are counted if their centre lies in the box, of volume V (2-D: area).
//!
//! - **Coordination number**: contacts of these grains with grains, bodies and walls, over their number. A capillary
//!   bridge across a gap is no contact; its force is part of the stress.
//! - **Mean stress** by Love and Weber (Weber 1966; Christoffersen, Mehrabadi, Nemat-Nasser, J. Appl. Mech. 48 (1981)
//!   339):
//!
//!   ```text
//!   sigma_ij = 1/V sum over grains, sum over their contacts: f_i r_j
//!   ```
//!
//! f is the force that the grain exerts at the contact and r the vector from its centre to the contact point, so
//! that
//! **compression is positive**, as in soil mechanics. The pressure is the mean of the diagonal. The forces are
//! those of the springs, without dashpots, and the momentum flux of moving grains is neglected: the stress is that
//! of quasi-static deformation. The symmetric part (sigma_ij + sigma_ji)/2 is written; in equilibrium sigma is
//! symmetric. It is a mean over the whole of V, pores included.
//! - **d50** is the diameter below which half of the volume lies, of the grains in the box and of those that regions
//!   removed so far, from `removed.csv`.
//!
//! Sums are exact, so that no value depends on the number of ranks.

use super::bed::{median_diameter, of_all_ranks};
use super::quantity::Quantity;
use super::{Heading, Rows, Run};
use crate::grains::space_vector;
use crate::view::StateView;
use base::error::Error;
use base::number::real;
use decomposition::ExactSum;
use dem::space::{Components, Space};
use plan::scene::Scene;
use plan::scene::aligned_box::AlignedBox;
use plan::scene::grid::Grid;
use plan::scene::observe::RegionAction;
use std::path::{Path, PathBuf};

/// Components of the stress in their order.
const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)];

/// Columns of the table.
const HEADINGS: [Heading; 13] = [
    ("number", "-"),
    ("solid_fraction", "-"),
    ("coordination_number", "-"),
    ("mean_pressure", "Pa"),
    ("stress_xx", "Pa"),
    ("stress_yy", "Pa"),
    ("stress_zz", "Pa"),
    ("stress_xy", "Pa"),
    ("stress_yz", "Pa"),
    ("stress_xz", "Pa"),
    ("d50", "m"),
    ("removed_number", "-"),
    ("removed_d50", "m"),
];

/// Probe of the grains in a box.
#[derive(Debug)]
pub(super) struct Fabric {
    block: AlignedBox,
    /// `true` if a region removes grains.
    removes: bool,
    /// Table of the removed grains, if a region removes grains, once the folder of the run is known.
    removed: Option<PathBuf>,
}

impl Fabric {
    /// Returns the grains of a scene in a box.
    pub(super) fn new(scene: &Scene, block: AlignedBox) -> Self {
        let removes = |action: &RegionAction| matches!(action, RegionAction::Remove { .. });
        Self {
            block,
            removes: scene.regions.iter().any(|region| removes(&region.action)),
            removed: None,
        }
    }

    /// Returns the values of this step without the time; rank 0 alone includes the sizes of removed grains. Collective.
    fn measure<S: Space>(&self, view: &StateView<S>) -> [f64; 13] {
        let (scene, particles) = (&view.plan.scene, view.particles);
        let grid = &scene.grid;
        let counts = |k: usize| {
            particles.body[k].id >= scene.first_grain()
                && self.holds(grid, &particles.motion[k].position)
        };
        let mut radii = Vec::new();
        let mut volume = ExactSum::new();
        for k in (0..particles.owned()).filter(|&k| counts(k)) {
            radii.push(particles.body[k].radius);
            volume.add(S::measure(particles.body[k].radius));
        }
        let mut ends = 0_u64;
        let mut stress: [ExactSum; 6] = std::array::from_fn(|_| ExactSum::new());
        if let Some(dem) = view.dem {
            dem.for_each_contact(particles, |contact| {
                let normal = space_vector(&contact.normal);
                let shear = space_vector(&contact.shear_force);
                let force: [f64; 3] =
                    std::array::from_fn(|a| contact.normal_force * normal[a] + shear[a]);
                for k in [Some(contact.grain), contact.other].into_iter().flatten() {
                    if !counts(k) {
                        continue;
                    }
                    ends += u64::from(contact.touches());
                    // For the second grain, force and arm are both reversed.
                    let arm = particles.body[k].radius - 0.5 * contact.overlap;
                    for (sum, (i, j)) in stress.iter_mut().zip(PAIRS) {
                        let both = force[i] * normal[j] + force[j] * normal[i];
                        sum.add(0.5 * arm * both);
                    }
                }
            });
        }
        let communicator = view.domain.communicator();
        let sum = |mut sum: ExactSum| {
            sum.all_reduce(communicator);
            sum.value()
        };
        let whole = self.block.measure();
        let solid = sum(volume) / whole;
        let stress = stress.map(|component| sum(component) / whole);
        let ends = communicator.all_reduce_sum_u64(ends);
        let mut all = of_all_ranks(&radii, communicator);
        let number = real(all.len());
        let trace: f64 = stress[..grid.dimension].iter().sum();
        let mut left = match &self.removed {
            Some(path) if communicator.rank() == 0 => removed_radii(path),
            _ => Vec::new(),
        };
        let [xx, yy, zz, xy, yz, xz] = stress;
        [
            number,
            solid,
            real(ends) / number,
            trace / real(grid.dimension),
            xx,
            yy,
            zz,
            xy,
            yz,
            xz,
            median_diameter(&mut all, S::measure),
            real(left.len()),
            median_diameter(&mut left, S::measure),
        ]
    }

    /// Returns `true` if a position is in the box; periodic axes are wrapped, upper ends at the domain belong to it.
    fn holds<V: Components>(&self, grid: &Grid, position: &V) -> bool {
        (0..grid.dimension).all(|axis| {
            let mut x = position.get(axis);
            if grid.periodic[axis] {
                x -= (x / grid.size[axis]).floor() * grid.size[axis];
            }
            (self.block.from[axis]..self.block.to[axis]).contains(&x)
        })
    }
}

impl Quantity for Fabric {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        HEADINGS.to_vec()
    }

    fn begin(&mut self, run: &Run) -> Result<(), Error> {
        self.removed = self.removes.then(|| run.folder.join("removed.csv"));
        Ok(())
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = self.measure(view);
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}

/// Returns the radii in the table of removed grains; none if there is no table yet.
fn removed_radii(path: &Path) -> Vec<f64> {
    let Ok(text) = io::plain::text(path, io::plain::LONGEST_TABLE) else {
        return Vec::new();
    };
    let Some(mut reader) = io::csv::Reader::new(&text) else {
        return Vec::new();
    };
    let names = reader.names();
    let Some(place) = names.iter().position(|name| name.starts_with("radius")) else {
        return Vec::new();
    };
    let mut radii = Vec::new();
    while let Some(row) = reader.row() {
        radii.extend(
            row.cells()
                .nth(place)
                .and_then(|cell| cell.parse::<f64>().ok()),
        );
    }
    radii
}
