//! Force of the fluid on a face of the domain, from the momentum that the links through it carry.
//!
//! [`Flux`](crate::lbm::boundary::Flux) counts whole populations, so that a fluid at rest presses on every patch with the
//! pressure of density one. That reference is taken off link by link, in the same integers, and the gauge pressure
//! stays; away from edges it is 1/3 per cell along the normal. A link through an edge or a corner belongs to the face with
//! the strongest condition (see [`crate::lbm::boundary`]), here as there.
//!
//! On a face through which fluid passes the force holds the momentum that it carries.

use super::face_area;
use crate::case::geometry::Face;
use crate::coupling::FluidView;
use crate::error::Error;
use crate::lbm::boundary::{Flux, from_quanta, quanta};
use crate::lbm::lattice::{D2Q9, D3Q19, D3Q27, Velocities};
use crate::scene::flow::{Condition, Flow, Lattice};
use crate::scene::grid::{Grid, count};
use decomposition::Communicator;

/// A face.
#[derive(Debug)]
pub(super) struct Wall {
    face: Face,
    /// Patches of the scene, all faces: the fluid has these, in this order, then one wall per face.
    faces: Vec<Face>,
    reference: [i128; 3],
    cells: f64,
    warm: bool,
}

impl Wall {
    pub(super) fn new(face: Face, flow: &Flow, grid: &Grid, warm: bool) -> Self {
        let velocities = match flow.lattice {
            Lattice::D2q9 => Velocities::of::<D2Q9, 9>(),
            Lattice::D3q19 => Velocities::of::<D3Q19, 19>(),
            Lattice::D3q27 => Velocities::of::<D3Q27, 27>(),
        };
        Self {
            face,
            faces: flow.patches().map(|patch| patch.face).collect(),
            reference: reference(face, flow, grid, &velocities),
            cells: (0..grid.dimension)
                .filter(|&a| a != face.axis())
                .map(|a| count(grid.cells[a]))
                .product(),
            warm,
        }
    }

    /// Nothing has crossed a face before the first step of all.
    pub(super) fn has_flux(&self, step: u64) -> bool {
        step > 0 || self.warm
    }

    /// Force, its normal part (positive towards the wall) and the size of its part along the face, both per area, mass
    /// leaving per time. Collective.
    pub(super) fn sample(
        &self,
        fluid: &dyn FluidView,
        communicator: &Communicator,
    ) -> Result<[f64; 8], Error> {
        let fluxes = fluid.fluxes();
        let whole = communicator.all_true(fluxes.len() == self.faces.len() + Face::ALL.len());
        if !whole {
            return Err(Error::Internal(
                "the fluid has other patches than the scene".into(),
            ));
        }
        let mut total = Flux::default();
        for (face, flux) in self.faces.iter().chain(&Face::ALL).zip(&fluxes) {
            if *face == self.face {
                total.mass += flux.mass;
                for (sum, force) in total.force.iter_mut().zip(flux.force) {
                    *sum += force;
                }
            }
        }
        let mut sums = [
            total.force[0].cast_unsigned(),
            total.force[1].cast_unsigned(),
            total.force[2].cast_unsigned(),
            total.mass.cast_unsigned(),
        ];
        communicator.all_reduce_sum_u128s(&mut sums);
        let [x, y, z, mass] = sums.map(u128::cast_signed);
        let units = fluid.units();
        let force: [f64; 3] = std::array::from_fn(|a| {
            units.force_to_si(from_quanta([x, y, z][a] - self.reference[a]))
        });
        let axis = self.face.axis();
        let normal = if self.face.is_max() {
            force[axis]
        } else {
            -force[axis]
        };
        let squared: f64 = (0..3)
            .filter(|&a| a != axis)
            .map(|a| force[a].powi(2))
            .sum();
        let shear = squared.sqrt();
        let area = self.cells * face_area(units);
        let mass_flux = units.rate_to_si(from_quanta(mass) * units.mass_scale());
        let [fx, fy, fz] = force;
        Ok([
            fx,
            fy,
            fz,
            normal,
            shear,
            normal / area,
            shear / area,
            mass_flux,
        ])
    }
}

/// What a fluid of density one at rest exerts on a face, in quanta.
fn reference(face: Face, flow: &Flow, grid: &Grid, velocities: &Velocities) -> [i128; 3] {
    let mut sum = [0; 3];
    let (mut from, mut to) = ([0; 3], grid.cells);
    if face.is_max() {
        from[face.axis()] = grid.cells[face.axis()] - 1;
    } else {
        to[face.axis()] = 1;
    }
    for z in from[2]..to[2] {
        for y in from[1]..to[1] {
            for x in from[0]..to[0] {
                let cell = [x, y, z];
                for (c, w) in velocities.c.iter().zip(&velocities.w) {
                    let outside: [bool; 3] = std::array::from_fn(|a| {
                        a < grid.dimension
                            && !grid.periodic[a]
                            && ((c[a] < 0 && cell[a] == 0)
                                || (c[a] > 0 && cell[a] + 1 == grid.cells[a]))
                    });
                    let owner = (0..3)
                        .filter(|&a| outside[a])
                        .map(|a| Face::ALL[2 * a + usize::from(c[a] > 0)])
                        .max_by_key(|face| strength(condition(*face, cell, flow)));
                    if owner != Some(face) {
                        continue;
                    }
                    // A population leaves with c and comes back reversed, or mirrored at the faces it crosses.
                    let mirrored = matches!(condition(face, cell, flow), Some(Condition::FreeSlip));
                    for a in 0..3 {
                        if outside[a] || !mirrored {
                            sum[a] += 2 * i128::from(c[a]) * i128::from(quanta(*w));
                        }
                    }
                }
            }
        }
    }
    sum
}

/// What holds at a face next to a cell: the last of its patches there.
fn condition(face: Face, cell: [usize; 3], flow: &Flow) -> Option<&Condition> {
    let patches = flow.faces[face.index()].iter().rev();
    patches
        .filter(|patch| {
            (0..3).all(|a| a == face.axis() || (patch.from[a]..patch.to[a]).contains(&cell[a]))
        })
        .map(|patch| &patch.condition)
        .next()
}

/// The order in which conditions take the links of an edge.
fn strength(condition: Option<&Condition>) -> u8 {
    match condition {
        Some(Condition::NoSlip) | None => 4,
        Some(Condition::MovingWall(_) | Condition::Velocity { .. }) => 3,
        Some(Condition::Pressure { .. }) => 2,
        Some(Condition::Outflow) => 1,
        Some(Condition::FreeSlip) => 0,
    }
}
