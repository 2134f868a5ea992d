//! The links through faces of the domain at the feet of bodies ([`lbm::links::feet`]).

use super::{BodyMap, FLUID, tag};
use lbm::boundary::{StraightLinks, SurfaceKind};
use lbm::lanes::Stored;
use lbm::links::feet::{FootLink, load_feet};
use lbm::links::{BodyLink, Load};
use lbm::populations::Populations;
use lbm::term::FootLoad;

impl BodyMap {
    /// Sets the links along which faces return populations. Must be called before any body is mapped.
    pub fn stand_on(&mut self, faces: StraightLinks) {
        self.straight = faces;
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
        let frame = self.slab.frame(self.bodies[k].shift);
        for (direction, surface) in self.straight.of_cell(cell) {
            let c = self.directions[usize::from(direction)].c;
            let Some(axes) = self.axes_into(k, outer, inner, c) else {
                continue;
            };
            let middle = std::array::from_fn(|a| {
                if a < self.slab.dimension {
                    2 * (outer[a] - frame[a]) + 1 + c[a]
                } else {
                    0
                }
            });
            feet.push(FootLink {
                link: BodyLink {
                    link: populations.link(position, usize::from(direction)),
                    middle,
                    direction,
                    loads: true,
                    backed: false,
                },
                cell,
                axes,
                opening: surface == SurfaceKind::Opening,
            });
        }
    }

    /// Returns the axes along which a link along `c` from a water cell leads into body `k`. Each link is found at one
    /// cell `inner` of the body only; none at others.
    ///
    /// In a corner between two solids the link acts along an axis on the solid that lies there.
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
        let beside = |a: usize| {
            let mut next = outer;
            next[a] += c[a];
            next
        };
        let stays = |a: usize| c[a] != 0 && self.slab.in_domain(beside(a));
        let stays: [bool; 3] = std::array::from_fn(|a| a < self.slab.dimension && stays(a));
        let end: [i32; 3] = std::array::from_fn(|a| outer[a] + if stays[a] { c[a] } else { 0 });
        if end == outer || owner(end) == FLUID {
            return None;
        }
        let ends_here = is_mine(end);
        let axes: [bool; 3] = std::array::from_fn(|a| {
            stays[a] && (is_mine(beside(a)) || ends_here && owner(beside(a)) == FLUID)
        });
        let first = if ends_here {
            Some(end)
        } else {
            (0..3).filter(|a| axes[*a]).map(beside).next()
        };
        (first == Some(inner) && axes.contains(&true)).then_some(axes)
    }

    /// Lists the bodies with feet.
    pub(super) fn list_standing(&mut self) {
        self.standing.clear();
        let links = self.links.iter().enumerate();
        let standing = links.filter(|(_, links)| !links.feet.is_empty());
        self.standing.extend(standing.map(|(k, _)| k));
    }

    /// Adds the loads on the bodies at their feet, after the faces have returned their populations, and lists them.
    pub fn load_feet<S: Stored>(
        &self,
        populations: &Populations<S>,
        loads: &mut [Load],
        given: &mut Vec<FootLoad>,
    ) {
        for &k in &self.standing {
            let (feet, motion) = (&self.links[k].feet, &self.motion[k]);
            if self.slab.dimension == 2 {
                load_feet::<S, 2>(populations, feet, motion, &mut loads[k], given);
            } else {
                load_feet::<S, 3>(populations, feet, motion, &mut loads[k], given);
            }
        }
    }
}
