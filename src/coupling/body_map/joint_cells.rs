//! Cells of water that a network of joints computes instead of the lattice.
//!
//! They count as solid: the links that end there are reflected without a load on any body, so that no pressure acts
//! twice. A cell of a joint belongs to no body; where a body moves into it, the body owns it. The momentum that the
//! water outside exchanges with them at their mouths is summed for the balance of the momentum.

use super::links::Direction;
use super::{BodyMap, Change, FLUID, GHOSTS, JOINT, OUTSIDE};
use lbm::lanes::Stored;
use lbm::links::{BodyLink, Load, Rigid, Scheme, bounce};
use lbm::populations::Populations;

/// Cells of joints in a slab.
#[derive(Clone, Debug, Default)]
pub(super) struct JointCells {
    /// Cells in joints, in ascending order of their indices in the map.
    wanted: Vec<(usize, [i32; 3])>,
    /// Cells that the lattice does not compute now: those in joints that are in no body.
    closed: Vec<(usize, [i32; 3])>,
    /// `true` if the cells in joints are other ones than in the last update.
    changed: bool,
    /// Links from closed cells to water.
    links: [Vec<BodyLink>; 1],
    load: [Load; 1],
}

impl BodyMap {
    /// Sets the cells in joints, in local coordinates of the slab; cells beyond its ghosts are omitted. They are closed
    /// by the next update.
    pub fn set_joint_cells(&mut self, cells: impl Iterator<Item = [i32; 3]>) {
        let slab = &self.slab;
        let cells = cells.filter(|cell| slab.held(*cell));
        let mut wanted: Vec<_> = cells.map(|cell| (slab.layout_index(cell), cell)).collect();
        wanted.sort_unstable();
        wanted.dedup();
        self.joint_cells.changed |= wanted != self.joint_cells.wanted;
        self.joint_cells.wanted = wanted;
    }

    /// Returns the first and one past the last cell of the slab with its ghosts along an axis, in local coordinates.
    #[must_use]
    pub fn held_range(&self, axis: usize) -> [i32; 2] {
        let ghosts = if axis < self.slab.dimension {
            GHOSTS
        } else {
            0
        };
        [-ghosts, self.slab.cells[axis] + ghosts]
    }

    /// Returns `true` if a cell of the slab lies in a body or in a joint.
    #[must_use]
    pub fn is_closed(&self, cell: [usize; 3]) -> bool {
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        let owner = self.owner[self.slab.layout_index(cell)];
        owner != FLUID && owner != OUTSIDE
    }

    /// Returns the closed cells of joints in the slab without its ghosts.
    pub fn closed_cells(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        let closed = self.joint_cells.closed.iter();
        let closed = closed.filter(|(_, cell)| self.slab.interior(*cell));
        closed.map(|(_, cell)| cell.map(|v| usize::try_from(v).unwrap_or(0)))
    }

    /// Returns `true` if the cells in joints have changed since the last update.
    pub(super) fn joints_changed(&self) -> bool {
        self.joint_cells.changed
    }

    /// Opens the cells of joints while cells are assigned to bodies.
    pub(super) fn open_joints(&mut self) {
        for &(place, _) in &self.joint_cells.closed {
            self.owner[place] = FLUID;
        }
    }

    /// Closes the cells of joints that are in no body, and records the cells that opened or closed.
    pub(super) fn close_joints(&mut self) {
        let joints = &mut self.joint_cells;
        joints.changed = false;
        if joints.closed.is_empty() && joints.wanted.is_empty() {
            return;
        }
        let owner = &mut self.owner;
        let before = std::mem::take(&mut joints.closed);
        let is_in = |list: &[(usize, [i32; 3])], entry: &(usize, [i32; 3])| {
            list.binary_search(entry).is_ok()
        };
        for change in &mut self.changes {
            let entry = (self.slab.layout_index(change.cell), change.cell);
            if change.before == FLUID && is_in(&before, &entry) {
                change.before = JOINT;
            }
        }
        let wanted = joints.wanted.iter();
        joints
            .closed
            .extend(wanted.filter(|(place, _)| owner[*place] == FLUID));
        for &(place, cell) in &joints.closed {
            owner[place] = JOINT;
            if !is_in(&before, &(place, cell)) {
                self.changes.push(Change {
                    cell,
                    before: FLUID,
                    impulse: None,
                });
            }
        }
        for &(place, cell) in &before {
            if owner[place] == FLUID {
                self.changes.push(Change {
                    cell,
                    before: JOINT,
                    impulse: None,
                });
            }
        }
    }

    /// Finds the links between closed cells of joints and water.
    pub(super) fn link_joints<S: Stored>(&mut self, populations: &Populations<S>) {
        let mut links = std::mem::take(&mut self.joint_cells.links);
        links[0].clear();
        for &(place, inner) in &self.joint_cells.closed {
            let deep = self.slab.deep(inner);
            let cell = populations.cell(inner.map(|v| v as isize));
            for (out, along) in self.directions.iter().enumerate().skip(1) {
                let outer: [i32; 3] = std::array::from_fn(|a| inner[a] + along.c[a]);
                if !deep && !self.slab.held(outer) {
                    continue;
                }
                let there = self.owner[place.wrapping_add_signed(along.map_offset)];
                let counts = deep || self.slab.interior(outer);
                let needed = counts || self.slab.interior(inner);
                if there == FLUID && needed && !self.cut(place, out) {
                    links[0].push(joint_link(
                        populations.link(
                            cell.wrapping_add_signed(along.lattice_offset),
                            along.opposite,
                        ),
                        along,
                        counts,
                    ));
                }
            }
        }
        self.joint_cells.links = links;
    }

    /// Reflects the populations at the mouths of joints. Returns the momentum given to the joints by this slab.
    pub fn bounce_at_joints<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
    ) -> Option<Load> {
        let joints = &mut self.joint_cells;
        if joints.closed.is_empty() {
            return None;
        }
        let still = [Rigid::default()];
        let (links, load) = (&joints.links, &mut joints.load);
        if self.slab.dimension == 2 {
            bounce::<S, 2>(populations, Scheme::HalfWay, links, &still, |_| &[], load);
        } else {
            bounce::<S, 3>(populations, Scheme::HalfWay, links, &still, |_| &[], load);
        }
        Some(joints.load[0])
    }
}

/// Returns a link at a stationary surface half-way between two cells; the moment of its load is not used.
fn joint_link(link: lbm::populations::Link, along: &Direction, counts: bool) -> BodyLink {
    BodyLink {
        link,
        middle: [0; 3],
        direction: u8::try_from(along.opposite).unwrap_or(0),
        loads: counts,
        moves: false,
        backed: false,
    }
}
