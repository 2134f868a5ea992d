//! Surfaces of solids in the velocity gradients of the eddy viscosity: faces of covered cells, links of bodies,
//! links of structures.

use super::{Fluid, planes_of};
use crate::lanes::Stored;
use crate::links::Rigid;
use crate::links::fixed::FixedLink;
use crate::links::gaps::BodyLinks;
use crate::populations::Populations;
use crate::turbulence::field::BodyWall;

/// Minimum solid fraction at which a cell does not count as water in the gradients of adjacent cells.
const HALF: f64 = 0.5;
/// Minimum distance of a stationary surface in a gradient \[cells\]: smaller distances only amplify rounding.
const NEAREST: f64 = 0.05;

impl<S: Stored> Fluid<S> {
    /// Registers the surfaces of solids that cover cells, for the velocity gradients of the eddy viscosity.
    /// `covered` returns the part of one of several threads in the positions of all cells and ghost cells that may
    /// have fluid neighbours.
    pub fn record_covered<const D: usize, I: Iterator<Item = usize>>(
        &mut self,
        covered: impl Fn(usize, usize) -> I + Sync,
    ) {
        let (Some(field), Some(cover)) = (&mut self.field, &self.cover) else {
            return;
        };
        field.forget_walls();
        let populations = &self.populations;
        let cells = populations.cells();
        if cells.contains(&0) {
            return;
        }
        let origin = populations.cell([0; 3]);
        let strides: [isize; 3] = std::array::from_fn(|axis| {
            let mut unit = [0; 3];
            unit[axis] = 1;
            (populations.cell(unit) - origin).cast_signed()
        });
        let fast = populations.order()[2];
        field.find_walls(|thread, threads, found| {
            let (mut last, mut at) = (usize::MAX, [0; 3]);
            for position in covered(thread, threads) {
                let part = cover.part(position);
                if part < HALF {
                    continue;
                }
                // Most positions follow the previous one in their row, which avoids the divisions to compute
                // coordinates.
                if position == last.wrapping_add(1) {
                    at[fast] += 1;
                } else {
                    at = populations.coordinates(position);
                }
                last = position;
                let within = |axis: usize, n: isize| (0..cells[axis].cast_signed()).contains(&n);
                let inside = [within(0, at[0]), within(1, at[1]), within(2, at[2])];
                for axis in 0..D {
                    if !(0..3).all(|other| other == axis || inside[other]) {
                        continue;
                    }
                    for (upper, step) in [(true, -1), (false, 1)] {
                        if !within(axis, at[axis] + step) {
                            continue;
                        }
                        let water = position.wrapping_add_signed(step * strides[axis]);
                        if cover.part(water) >= HALF {
                            continue;
                        }
                        let distance = 1.5 - part;
                        let mut offset = [0.0; 3];
                        offset[axis] = if upper {
                            distance - 1.0
                        } else {
                            1.0 - distance
                        };
                        let local = at.map(|n| i32::try_from(n).unwrap_or(i32::MAX));
                        found.push(BodyWall {
                            cell: water,
                            side: (axis, upper),
                            distance,
                            velocity: cover.velocity_near::<D>(position, local, offset),
                        });
                    }
                }
            }
        });
    }

    /// Registers links for the velocity gradients of the eddy viscosity: the links and the motion of each body.
    pub fn record_links<const D: usize>(&mut self, links: &[BodyLinks], motion: &[Rigid]) {
        let Some(field) = &mut self.field else {
            return;
        };
        field.forget_walls();
        let populations = &self.populations;
        let velocities = populations.velocities();
        field.find_walls(|thread, threads, found| {
            let bodies = planes_of(&(0..links.len().min(motion.len())), threads, thread);
            for (links, motion) in links[bodies.clone()].iter().zip(&motion[bodies]) {
                let all = links.with_velocities::<D>(motion);
                for (link, velocity) in all.filter(|(link, _)| link.loads) {
                    let direction = usize::from(link.direction);
                    let c = velocities.c[direction];
                    let mut along = (0..D).filter(|a| c[*a] != 0);
                    let (Some(axis), None) = (along.next(), along.next()) else {
                        continue;
                    };
                    let back = velocities.opposite[direction];
                    found.push(BodyWall {
                        cell: link.link.near as usize - populations.slot(0, back),
                        side: (axis, c[axis] > 0),
                        distance: 0.5,
                        velocity,
                    });
                }
            }
        });
    }

    /// Registers links like [`Self::record_links`] for stationary surfaces, in addition to those registered before.
    pub fn record_fixed_links<const D: usize>(&mut self, groups: &[Vec<FixedLink>]) {
        let Some(field) = &mut self.field else {
            return;
        };
        let populations = &self.populations;
        field.find_walls(|thread, threads, found| {
            let mine = |group: &Vec<FixedLink>| planes_of(&(0..group.len()), threads, thread);
            let links = groups.iter().flat_map(|group| &group[mine(group)]);
            found.extend(links.flat_map(|link| fixed_surfaces::<S, D>(populations, link)));
        });
    }

    /// Bounds the velocities beyond faces, of which gradients are taken, by the stationary surfaces of these links.
    /// They are those of all structures, before the first step.
    pub fn bound_velocities<const D: usize>(&mut self, groups: &[Vec<FixedLink>]) {
        let Some(field) = &mut self.field else {
            return;
        };
        let populations = &self.populations;
        let links = groups.iter().flatten();
        field.bound_ghosts(links.flat_map(|link| fixed_surfaces::<S, D>(populations, link)));
    }
}

/// Returns the surfaces that a link along an axis puts next to its ends in water.
fn fixed_surfaces<S: Stored, const D: usize>(
    populations: &Populations<S>,
    link: &FixedLink,
) -> impl Iterator<Item = BodyWall> {
    let velocities = populations.velocities();
    let forth = usize::from(link.direction);
    let back = velocities.opposite[forth];
    let ends = [(link.link.near, forth, back), (link.link.far, back, forth)];
    let wet = (0..2).filter(|&end| link.wet[end]);
    wet.filter_map(move |end| {
        let (near, leaves, returns) = ends[end];
        let c = velocities.c[leaves];
        let mut along = (0..D).filter(|a| c[*a] != 0);
        let (Some(axis), None) = (along.next(), along.next()) else {
            return None;
        };
        // Distance q computed from kappa; 1/2 for half-way links.
        let kappa = link.kappa[end];
        let distance = (1.0 - kappa) / (2.0 * (1.0 + kappa));
        Some(BodyWall {
            cell: near as usize - populations.slot(0, returns),
            side: (axis, c[axis] > 0),
            distance: distance.max(NEAREST),
            velocity: [0.0; 3],
        })
    })
}
