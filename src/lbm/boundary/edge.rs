//! Edges of the domain: links that leave it through two or three faces.
//!
//! The patch of the highest precedence takes such a link ([`super::BoundaryKind::precedence`]).
//!
//! **Velocity.** If this patch imposes a velocity, each face that the link crosses gives the component normal to it,
//!
//! f_ī = f*_i - 6 w_i Σ_a c_a u_a,
//!
//! u_a being that of the patch normal to a if this imposes a velocity, zero at a plane of symmetry, otherwise (at an
//! imposed pressure or an outflow) that of the taker, like the components along the edge. A wall that slides towards an
//! opening therefore takes water along through the opening, and one that slides towards a wall or a plane of symmetry
//! takes none: the domain keeps its mass.
//!
//! **Mass.** The part 6 w_i c_a u_a passes through the face normal to a. The flow through an opening is therefore that
//! of all of its cells, also next to a wall that moves. If the velocity of the corner counted at the wall, a sixth of a
//! cell would be missing at the opening, by which the scaling to a stated discharge would raise the velocity of all
//! others.
//!
//! **Force.** The momentum of the link acts by axis on the face normal to it. Between a wall and an opening that is the
//! pressure on the opening, but also the shear stress on the wall in the half cell next to the edge, because there the
//! link has no partner with the opposite component. This stress is taken to be that of the next pair of links, which
//! cross the wall at one point, one cell from the edge: half of their momentum along the wall is added to the wall and
//! subtracted from the opening, and likewise along the opening ([`ShearLink`]). In flows that are developed along the
//! wall this is exact; in water at rest it is zero. The sum over the faces does not change.

use super::{Crossing, Found, Frame, Patch, Strength, SurfaceKind, crossed};
use crate::lanes::Stored;
use crate::quanta::quanta;
use base::number::{real, to_u32};

/// Part of the mass of a link that passes through one face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Passage {
    /// Patch of the face.
    patch: usize,
    /// Patch whose velocity this is, and whose factor applies.
    pub(super) giver: usize,
    /// Term 6 w_i c_a u_a at full speed.
    pub(super) term: f64,
}

/// Link through an edge or a corner of the domain.
#[derive(Clone, Debug)]
pub(super) struct EdgeLink {
    cell: u32,
    direction: usize,
    /// Patch of the face normal to each axis that the link crosses, and the patch of the link for the other axes.
    pub(super) patches: [usize; 3],
    /// Patch through which the mass passes that does not pass through `also`.
    through: usize,
    also: Vec<Passage>,
}

impl EdgeLink {
    /// Calls `pass` for the patches through which the mass of the link has left, with the parts of each in quanta;
    /// `factor` is the velocity factor of a patch in the step.
    pub(super) fn divide(
        &self,
        mass: i128,
        factor: impl Fn(usize) -> f64,
        mut pass: impl FnMut(usize, i128),
    ) {
        let mut rest = mass;
        for passage in &self.also {
            let part = i128::from(quanta(passage.term * factor(passage.giver)));
            pass(passage.patch, part);
            rest -= part;
        }
        pass(self.through, rest);
    }
}

/// Link next to an edge, of whose momentum along an axis half counts at another patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ShearLink {
    cell: u32,
    direction: usize,
    pub(super) axis: usize,
    /// Patch that loses the half, and the one that receives it.
    pub(super) from: usize,
    pub(super) to: usize,
}

/// Links at the edges of a slab, sorted by cell and direction.
#[derive(Debug, Default)]
pub(super) struct Edges {
    links: Vec<EdgeLink>,
    shear: Vec<ShearLink>,
}

impl Edges {
    /// Adds a link through an edge, which the patch `taker` takes.
    pub(super) fn add<S: Stored>(
        &mut self,
        crossing: &Crossing<'_, S>,
        found: &Found,
        taker: usize,
        mut passages: Vec<Passage>,
    ) {
        passages.sort_by(|a, b| b.term.abs().total_cmp(&a.term.abs()));
        let through = passages.first().map_or(taker, |most| most.patch);
        self.links.push(EdgeLink {
            cell: to_u32(crossing.cell),
            direction: crossing.direction,
            patches: found.map(|found| found.map_or(taker, |(p, _)| p)),
            through,
            also: passages.into_iter().skip(1).collect(),
        });
    }

    /// Adds a link through a face for each edge between a wall and an opening that is one cell from the point at
    /// which it crosses the face.
    pub(super) fn add_shear<S: Stored>(
        &mut self,
        crossing: &Crossing<'_, S>,
        patches: &[Patch<S>],
        frame: &Frame,
    ) {
        let Some(normal) = crossing.outside.iter().position(|outside| *outside) else {
            return;
        };
        let (c, dimension) = (
            crossing.velocity(),
            crossing.populations.velocities().dimension,
        );
        let across = |axis: &usize| *axis != normal && !frame.periodic[*axis] && c[*axis] != 0;
        for axis in (0..dimension).filter(across) {
            let length = frame.cells[axis];
            let at = crossing.at[axis] + usize::from(c[axis] > 0);
            for (end, sign) in [(0, -1), (length, 1)] {
                if at.abs_diff(end) != 1 {
                    continue;
                }
                let end = real(end);
                let (mut through, mut outside, mut middle) = (c, crossing.outside, crossing.middle);
                (through[axis], outside[axis], middle[axis]) = (sign, true, end);
                let found = crossed(patches, frame, through, outside, middle);
                let (Some((own, _)), Some((other, _))) = (found[normal], found[axis]) else {
                    continue;
                };
                // The faces of the cell in the edge.
                let mut beside: [f64; 3] = std::array::from_fn(|a| real(crossing.at[a]) + 0.5);
                beside[axis] = end - 0.5 * f64::from(sign);
                let open = [(own, normal), (other, axis)].map(|(patch, face)| {
                    let mut point = beside;
                    point[face] = middle[face];
                    patches[patch].lets_through(point)
                });
                let mirrors = |p: usize| patches[p].rule.kind().surface == SurfaceKind::Symmetry;
                if open[0] == open[1] || mirrors(own) || mirrors(other) {
                    continue;
                }
                let taker = taker(patches, &found).map_or(own, |(p, _)| p);
                let (cell, direction) = (to_u32(crossing.cell), crossing.direction);
                for (along, from) in (0..3).map(|a| (a, if a == axis { other } else { taker })) {
                    if along != normal && c[along] != 0 && from != own {
                        self.shear.push(ShearLink {
                            cell,
                            direction,
                            axis: along,
                            from,
                            to: own,
                        });
                    }
                }
            }
        }
    }

    /// Sorts the links after the last one.
    pub(super) fn sort(&mut self) {
        self.links.sort_by_key(|edge| (edge.cell, edge.direction));
        self.shear.sort_unstable();
    }

    /// Returns the edge link of a cell, given by its position, along a direction; none for other links.
    pub(super) fn find(&self, link: (u32, usize)) -> Option<&EdgeLink> {
        let of_link = |edge: &EdgeLink| (edge.cell, edge.direction);
        let n = self.links.binary_search_by_key(&link, of_link).ok()?;
        Some(&self.links[n])
    }

    /// Returns the links next to edges of a cell, given by its position, along a direction.
    pub(super) fn shear(&self, link: (u32, usize)) -> &[ShearLink] {
        let key = |shear: &ShearLink| (shear.cell, shear.direction);
        let first = self.shear.partition_point(|shear| key(shear) < link);
        let count = self.shear[first..].partition_point(|shear| key(shear) == link);
        &self.shear[first..first + count]
    }
}

/// Returns the patch that takes a link, of those that it crosses along each axis, with the fraction of the surrounding
/// cells that imposes a velocity.
pub(super) fn taker<S: Stored>(patches: &[Patch<S>], found: &Found) -> Option<(usize, f64)> {
    let all = found.iter().flatten().copied();
    all.max_by_key(|&(p, _)| patches[p].rule.kind().precedence())
}

/// Returns the axes along which the velocity of the patch that takes a link counts.
pub(super) fn counted<S: Stored>(
    patches: &[Patch<S>],
    found: &Found,
    taker: usize,
    middle: [f64; 3],
) -> [bool; 3] {
    found.map(|found| {
        let Some((p, _)) = found.filter(|(p, _)| *p != taker && imposes(patches, taker)) else {
            return true;
        };
        let rule = &patches[p].rule;
        rule.kind().surface != SurfaceKind::Symmetry && rule.velocity(middle).is_none()
    })
}

/// Returns the mass of a link through an edge by the faces through which it passes; none if no velocity is imposed.
pub(super) fn passages<S: Stored>(
    patches: &[Patch<S>],
    found: &Found,
    crossing: &Crossing<'_, S>,
    taker: usize,
) -> Vec<Passage> {
    if !imposes(patches, taker) {
        return Vec::new();
    }
    let (c, middle) = (crossing.velocity(), crossing.middle);
    let of_axis = |axis: usize| {
        let (patch, share) = found[axis]?;
        let (giver, share) = if patch != taker && crossing.counted[axis] {
            (taker, crossing.share)
        } else {
            (patch, share)
        };
        let velocity = patches[giver].rule.velocity(middle)?;
        let term = 6.0 * crossing.weight() * (f64::from(c[axis]) * (share * velocity[axis]));
        (term != 0.0).then_some(Passage { patch, giver, term })
    };
    (0..3).filter_map(of_axis).collect()
}

/// Returns `true` if a patch other than a stationary wall imposes a velocity.
fn imposes<S: Stored>(patches: &[Patch<S>], patch: usize) -> bool {
    patches[patch].rule.kind().strength == Strength::Velocity
}

#[cfg(test)]
mod tests;
