//! The links that cross the surfaces of bodies, those through faces of the domain at the feet of bodies, and those in
//! corners with other solids ([`lbm::links`]).

use super::rows::Row;
use super::slab::Slab;
use super::{BodyMap, FLUID, JOINT, OUTSIDE, tag};
use crate::structure_map::StructureMap;
use base::thread_pool;
use lbm::boundary::{FacePart, StraightLinks, SurfaceKind};
use lbm::feet::FootLoad;
use lbm::lanes::Stored;
use lbm::links::gaps::{BodyLinks, GapLink};
use lbm::links::{
    AtStructure, BODIES_PER_THREAD as PER_THREAD, BodyLink, CornerLink, FootLink, Load,
    StructureCorner, load_feet,
};
use lbm::populations::Populations;
use std::sync::atomic::Ordering;

/// Direction of the lattice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    pub(super) c: [i32; 3],
    /// Index offset in the map, then in the lattice.
    pub(super) map_offset: isize,
    pub(super) lattice_offset: isize,
    pub(super) opposite: usize,
}

/// Returns the directions of a lattice.
pub(super) fn directions<S: Stored>(slab: &Slab, populations: &Populations<S>) -> Vec<Direction> {
    let velocities = populations.velocities();
    (0..velocities.q())
        .map(|i| Direction {
            c: velocities.c[i].map(i32::from),
            map_offset: slab.step(velocities.c[i]),
            lattice_offset: populations.offset(i),
            opposite: velocities.opposite[i],
        })
        .collect()
}

/// Faces of the domain, and bodies that meet them or other solids.
#[derive(Debug, Default)]
pub(super) struct AtFaces {
    /// Parts of the faces.
    pub(super) parts: Vec<FacePart>,
    /// Links along which faces return populations.
    straight: StraightLinks,
    /// Indices of the bodies with links through faces or in corners with structures.
    standing: Vec<usize>,
    /// `true` if there are links in corners between bodies.
    bodies_meet: bool,
}

impl BodyMap {
    /// Requests new links for every body with cells near a changed cell.
    pub(super) fn relink_around(&self, cell: [i32; 3], before: u32, reach: i32) {
        // Most neighbours belong to the same body.
        let mut last = [FLUID, OUTSIDE, FLUID];
        let mut flag = |owner: u32| {
            if last.contains(&owner) {
                return;
            }
            last[2] = owner;
            for &k in self.entries.get(&owner).into_iter().flatten() {
                self.relink[k as usize].store(true, Ordering::Relaxed);
            }
        };
        flag(before);
        let deep = if self.slab.dimension == 3 { reach } else { 0 };
        for dz in -deep..=deep {
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let near = [cell[0] + dx, cell[1] + dy, cell[2] + dz];
                    if self.slab.held(near) {
                        flag(self.owner[self.slab.layout_index(near)]);
                    }
                }
            }
        }
    }

    /// Returns the image of a body nearest to a cell, with its frame.
    pub(super) fn nearest(&self, owner: u32, cell: [i32; 3]) -> Option<(usize, [i32; 3])> {
        let entries = self.entries.get(&owner)?;
        entries
            .iter()
            .map(|&k| {
                let k = k as usize;
                let frame = self.slab.frame(self.bodies[k].shift);
                let d2: f64 = (0..self.slab.dimension)
                    .map(|a| {
                        (f64::from(cell[a] - frame[a]) + 0.5 - self.motion[k].position[a]).powi(2)
                    })
                    .sum();
                (d2, k, frame)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, k, frame)| (k, frame))
    }

    /// Finds the links of body `k`.
    pub(super) fn link<S: Stored>(
        &self,
        k: usize,
        populations: &Populations<S>,
        links: &mut BodyLinks,
    ) {
        let mine = tag(self.bodies[k].id);
        let frame = self.slab.frame(self.bodies[k].shift);
        let owner = |place: usize, along: &Direction| {
            let place = place.wrapping_add_signed(along.map_offset);
            (place, self.owner[place])
        };
        links.clear();
        let directions = &self.directions;
        // Cells beyond the ends of a row have only neighbours that belong to this body or another of lower id.
        let rows = &self.bodies[k].rows;
        let ends = rows
            .rows()
            .flat_map(|row| rows.ends(row, self.slab.dimension == 3));
        for inner in ends.flat_map(Row::cells) {
            let place = self.slab.layout_index(inner);
            if self.owner[place] != mine {
                continue;
            }
            // All cells read by the link are in the slab.
            let deep = self.slab.deep(inner);
            let cell = populations.cell(inner.map(|v| v as isize));
            let mut meets = false;
            for (out, along) in directions.iter().enumerate().skip(1) {
                let c = along.c;
                let outer: [i32; 3] = std::array::from_fn(|a| inner[a] + c[a]);
                if !deep && !self.slab.held(outer) {
                    continue;
                }
                let (outer_place, there) = owner(place, along);
                let between = there != FLUID;
                meets |= between && there != mine;
                // A link between two bodies is treated by the one with the lower id.
                if there == mine || there == OUTSIDE || (between && there < mine) {
                    continue;
                }
                if self.cut(place, out) {
                    continue;
                }
                let mine_to_do = deep || self.slab.interior(outer);
                if !mine_to_do && !self.slab.interior(inner) {
                    continue;
                }
                let behind: [i32; 3] = std::array::from_fn(|a| outer[a] + c[a]);
                let backed = (deep || self.slab.held(behind))
                    && (owner(outer_place, along).1 == FLUID || self.is_mirrored_water(behind))
                    && !self.cut(outer_place, out);
                let link = BodyLink {
                    link: populations.link(
                        cell.wrapping_add_signed(along.lattice_offset),
                        along.opposite,
                    ),
                    middle: std::array::from_fn(|a| {
                        if a < self.slab.dimension {
                            2 * (outer[a] - frame[a]) + 1 - c[a]
                        } else {
                            0
                        }
                    }),
                    direction: u8::try_from(along.opposite).unwrap_or(0),
                    loads: mine_to_do && !between,
                    backed,
                };
                match self.gap_at(outer, outer_place, [1; 3], &mut links.gaps) {
                    Some(gap) => links.narrow.push(GapLink { link, gap }),
                    None => links.open.push(link),
                }
                if mine_to_do && !between && !deep {
                    self.feet_at(k, outer, inner, populations, &mut links.feet);
                }
            }
            if meets {
                self.corners_at(k, inner, populations, links);
            }
        }
    }

    /// Returns `true` if a sheet cuts the link from the cell at an index of the map along a direction: the link
    /// then belongs to the sheet.
    pub(super) fn cut(&self, place: usize, direction: usize) -> bool {
        !self.sheets.is_empty()
            && u8::try_from(direction).is_ok_and(|d| self.sheets.contains(&(place, d)))
    }

    /// Returns `true` if bodies, and walls next to them, occupy more than half of the neighbours of a cell of the
    /// slab (local coordinates).
    #[must_use]
    pub fn encloses<S: Stored>(&self, cell: [usize; 3], populations: &Populations<S>) -> bool {
        let velocities = populations.velocities();
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        let (mut bodies, mut walls) = (0, 0);
        for c in &velocities.c[1..] {
            let near: [i32; 3] = std::array::from_fn(|a| cell[a] + i32::from(c[a]));
            match self.owner[self.slab.layout_index(near)] {
                FLUID => {}
                OUTSIDE => walls += 1,
                _ => bodies += 1,
            }
        }
        bodies > 0 && 2 * (bodies + walls) > velocities.q() - 1
    }
}

impl BodyMap {
    /// Sets the links along which faces return populations. Must be called before any body is mapped.
    pub fn stand_on(&mut self, faces: StraightLinks) {
        self.at_faces.straight = faces;
    }

    /// Adds the feet of body `k` at a link from the water cell `outer` into its cell `inner`.
    pub(super) fn feet_at<S: Stored>(
        &self,
        k: usize,
        outer: [i32; 3],
        inner: [i32; 3],
        populations: &Populations<S>,
        feet: &mut Vec<FootLink>,
    ) {
        let position = populations.cell(outer.map(|v| v as isize));
        let cell = u32::try_from(position).unwrap_or(u32::MAX);
        for (direction, surface) in self.at_faces.straight.of_cell(cell) {
            let c = self.directions[usize::from(direction)].c;
            let Some(axes) = self.axes_into(k, outer, inner, c) else {
                continue;
            };
            let into = self.part_in_domain(outer, c);
            let first = axes.iter().position(|leads| *leads).unwrap_or(0);
            let structure = self.structure_of_link(outer, into, first);
            feet.push(FootLink {
                link: BodyLink {
                    link: populations.link(position, usize::from(direction)),
                    middle: self.middle_from(self.bodies[k].shift, outer, c),
                    direction,
                    loads: true,
                    backed: false,
                },
                cell,
                axes,
                both: surface == SurfaceKind::Opening || structure.is_some(),
                structure,
            });
        }
    }

    /// Returns the midpoint of a link from a cell along `c` in half cells, in the frame of an image of a body.
    fn middle_from(&self, shift: [i32; 3], outer: [i32; 3], c: [i32; 3]) -> [i32; 3] {
        let frame = self.slab.frame(shift);
        std::array::from_fn(|a| {
            if a < self.slab.dimension {
                2 * (outer[a] - frame[a]) + 1 + c[a]
            } else {
                0
            }
        })
    }

    /// Returns the part of a direction from a cell that stays in the domain.
    fn part_in_domain(&self, outer: [i32; 3], c: [i32; 3]) -> [i32; 3] {
        std::array::from_fn(|a| {
            if self.slab.in_domain(beside(outer, c, a)) {
                c[a]
            } else {
                0
            }
        })
    }

    /// Returns `true` if a cell of the domain belongs to a structure.
    fn is_structure(&self, cell: [i32; 3]) -> bool {
        self.owner[self.slab.layout_index(cell)] == OUTSIDE && self.slab.in_domain(cell)
    }

    /// Returns `true` if two bodies are polyhedra. Corners between flat faces are long, those between round bodies are
    /// points.
    fn are_blocks(&self, one: u32, other: u32) -> bool {
        [one, other].iter().all(|tag| {
            let entry = self.entries.get(tag).and_then(|entries| entries.first());
            entry.is_some_and(|entry| !self.faces(*entry as usize).is_empty())
        })
    }

    /// Returns the structure that has the momentum of a link from a cell along `into`, along one of its axes, if there
    /// are no bodies; none if the link does not end in a structure.
    fn structure_of_link(
        &self,
        outer: [i32; 3],
        into: [i32; 3],
        axis: usize,
    ) -> Option<AtStructure> {
        let end: [i32; 3] = std::array::from_fn(|a| outer[a] + into[a]);
        if !self.is_structure(end) {
            return None;
        }
        let own = beside(outer, into, axis);
        if self.is_structure(own) {
            return Some(self.at_structures([own; 3], outer, into));
        }
        let met = std::array::from_fn(|a| {
            let cell = beside(outer, into, a);
            if self.is_structure(cell) { cell } else { end }
        });
        Some(self.at_structures(met, outer, into))
    }

    /// Returns the structure of the lowest index in some cells at a link from a cell along `c`.
    fn at_structures(&self, cells: [[i32; 3]; 3], outer: [i32; 3], c: [i32; 3]) -> AtStructure {
        let place = |cell| u32::try_from(self.slab.layout_index(cell)).unwrap_or(u32::MAX);
        AtStructure {
            places: cells.map(place),
            middle: self.middle_from([0; 3], outer, c),
        }
    }

    /// Returns the cells of the solids on which a link from the water cell `outer` along `c`, within the domain, acts
    /// along each axis; none if it ends in water.
    ///
    /// Along an axis it acts on the solid that lies there. Without one it is tangential to the solids that it meets,
    /// and acts on that with the lowest tag: on a flat face across two solids the tangential parts of the two links
    /// through the seam then cancel.
    fn receivers(&self, outer: [i32; 3], c: [i32; 3]) -> Option<[[i32; 3]; 3]> {
        let owner = |cell: [i32; 3]| self.owner[self.slab.layout_index(cell)];
        let end: [i32; 3] = std::array::from_fn(|a| outer[a] + c[a]);
        let last = owner(end);
        if last == FLUID || last == JOINT {
            return None;
        }
        let counts = |cell: &[i32; 3]| {
            let tag = owner(*cell);
            match tag {
                FLUID | JOINT => false,
                OUTSIDE => true,
                tag => last == OUTSIDE || tag == last || self.are_blocks(tag, last),
            }
        };
        let crossed = (0..3).filter(|a| c[*a] != 0);
        let met = crossed.map(|a| beside(outer, c, a)).filter(counts);
        let lowest = met.chain([end]).min_by_key(|cell| owner(*cell));
        Some(std::array::from_fn(|a| {
            let own = beside(outer, c, a);
            if c[a] != 0 && counts(&own) {
                own
            } else {
                lowest.unwrap_or(end)
            }
        }))
    }

    /// Adds the links of body `k` in corners with other solids next to its cell `inner`: those that end there and act
    /// on another solid, and those that act on the cell and end in another solid.
    pub(super) fn corners_at<S: Stored>(
        &self,
        k: usize,
        inner: [i32; 3],
        populations: &Populations<S>,
        links: &mut BodyLinks,
    ) {
        let mine = tag(self.bodies[k].id);
        let place = self.slab.layout_index(inner);
        let owner = |cell: [i32; 3]| self.owner[self.slab.layout_index(cell)];
        let mut add = |outer: [i32; 3], direction: usize, axis: usize, structure| {
            let c = self.directions[direction].c;
            let end = std::array::from_fn(|a| outer[a] + c[a]);
            let link = CornerLink {
                link: populations.link(populations.cell(outer.map(|v| v as isize)), direction),
                middle: self.middle_from(self.bodies[k].shift, outer, c),
                axis,
                along: i8::try_from(c[axis]).unwrap_or(0),
                receives: owner(end) != mine,
                left: 0.0,
            };
            match structure {
                Some(structure) => links
                    .at_structures
                    .push(StructureCorner { link, structure }),
                None => links.corners.push(link),
            }
        };
        for (out, along) in self.directions.iter().enumerate().skip(1) {
            let outer: [i32; 3] = std::array::from_fn(|a| inner[a] + along.c[a]);
            if !self.slab.interior(outer) || owner(outer) != FLUID || self.cut(place, out) {
                continue;
            }
            let c = self.directions[along.opposite].c;
            let Some(receivers) = self.receivers(outer, c) else {
                continue;
            };
            for axis in (0..3).filter(|a| c[*a] != 0) {
                let cell = receivers[axis];
                if owner(cell) != mine {
                    let structure = self.is_structure(cell);
                    let structure = structure.then(|| self.at_structures([cell; 3], outer, c));
                    add(outer, along.opposite, axis, structure);
                }
            }
            if c.iter().filter(|c| **c != 0).count() > 1 {
                continue;
            }
            // Links that pass the cell along this axis may act on it.
            let outer_place = self.slab.layout_index(outer);
            for (direction, past) in self.directions.iter().enumerate().skip(1) {
                let passes = (0..3).all(|a| c[a] == 0 || past.c[a] == c[a]);
                let end: [i32; 3] = std::array::from_fn(|a| outer[a] + past.c[a]);
                if !passes || !self.slab.in_domain(end) || owner(end) == mine {
                    continue;
                }
                let receivers = self.receivers(outer, past.c);
                let Some(receivers) = receivers.filter(|_| !self.cut(outer_place, direction))
                else {
                    continue;
                };
                for axis in (0..3).filter(|a| past.c[*a] != 0) {
                    if receivers[axis] == inner {
                        add(
                            outer,
                            direction,
                            axis,
                            self.structure_of_link(outer, past.c, axis),
                        );
                    }
                }
            }
        }
    }

    /// Returns the axes along which a link along `c` from a water cell leads into body `k`. Each link is found at one
    /// cell `inner` of the body only; none at others.
    fn axes_into(
        &self,
        k: usize,
        outer: [i32; 3],
        inner: [i32; 3],
        c: [i32; 3],
    ) -> Option<[bool; 3]> {
        let mine = tag(self.bodies[k].id);
        let rows = &self.bodies[k].rows;
        let owner = |cell: [i32; 3]| self.owner[self.slab.layout_index(cell)];
        let is_mine = |cell: [i32; 3]| {
            let [from, to] = rows.span(cell[1], cell[2]);
            owner(cell) == mine && (from..to).contains(&cell[0])
        };
        let into = self.part_in_domain(outer, c);
        if into == [0; 3] {
            return None;
        }
        let receivers = self.receivers(outer, into)?;
        let axes: [bool; 3] = std::array::from_fn(|a| into[a] != 0 && is_mine(receivers[a]));
        let first = (0..3).find(|a| axes[*a])?;
        (receivers[first] == inner).then_some(axes)
    }

    /// Lists the bodies with feet and those in corners with structures.
    pub(super) fn list_standing(&mut self) {
        let stands = |links: &BodyLinks| !links.feet.is_empty() || !links.at_structures.is_empty();
        let links = self.links.iter().enumerate();
        self.at_faces.standing.clear();
        let standing = links.filter(|(_, links)| stands(links));
        self.at_faces.standing.extend(standing.map(|(k, _)| k));
        self.at_faces.bodies_meet = self.links.iter().any(|links| !links.corners.is_empty());
    }

    /// Keeps the populations that leave along links in corners, before they are reflected.
    pub fn keep_leaving<S: Stored>(&mut self, populations: &Populations<S>) {
        for &k in &self.at_faces.standing {
            for corner in &mut self.links[k].at_structures {
                corner.link.keep(populations);
            }
        }
        if self.at_faces.bodies_meet {
            thread_pool::each_item_in_runs(&mut self.links, PER_THREAD, |_, links| {
                for corner in &mut links.corners {
                    corner.keep(populations);
                }
            });
        }
    }

    /// Adds the loads on the bodies at their feet and in corners, after faces and solids have returned their
    /// populations, and lists those at feet. `structures` receive and lose their parts.
    pub fn load_feet<S: Stored, const D: usize>(
        &self,
        populations: &Populations<S>,
        mut structures: Option<&mut StructureMap>,
        loads: &mut [Load],
        given: &mut Vec<FootLoad>,
    ) {
        if self.at_faces.bodies_meet {
            thread_pool::each_item_in_runs(loads, PER_THREAD, |k, load| {
                for corner in &self.links[k].corners {
                    corner.load::<S, D>(populations, load);
                }
            });
        }
        for &k in &self.at_faces.standing {
            let (links, motion, load) = (&self.links[k], &self.motion[k], &mut loads[k]);
            let mut lose = |at: AtStructure, force: [i64; 3]| {
                if let Some(structures) = structures.as_deref_mut() {
                    structures.receive(at, force.map(|f| -f));
                }
            };
            load_feet::<S, D>(populations, &links.feet, motion, load, given, &mut lose);
            for StructureCorner { link, structure } in &links.at_structures {
                lose(*structure, link.load::<S, D>(populations, load));
            }
        }
    }
}

/// Returns the neighbour of a cell along an axis on the side of `c`.
fn beside(cell: [i32; 3], c: [i32; 3], axis: usize) -> [i32; 3] {
    let mut next = cell;
    next[axis] += c[axis];
    next
}
