//! The links through faces of the domain at the feet of bodies, and those in corners with other solids
//! ([`lbm::links::feet`]).

use super::{BodyMap, FLUID, JOINT, OUTSIDE, tag};
use crate::structure_map::StructureMap;
use base::thread_pool;
use lbm::boundary::{FacePart, StraightLinks, SurfaceKind};
use lbm::lanes::Stored;
use lbm::links::feet::{AtStructure, CornerLink, FootLink, StructureCorner, load_feet};
use lbm::links::gaps::BodyLinks;
use lbm::links::{BODIES_PER_THREAD as PER_THREAD, BodyLink, Load};
use lbm::populations::Populations;
use lbm::term::FootLoad;

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
