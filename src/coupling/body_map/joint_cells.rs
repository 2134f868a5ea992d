//! Cells of water that a network of joints computes instead of the lattice.
//!
//! They count as solid: the links that end there are reflected without a load on any body, so that no pressure acts
//! twice. A cell of a joint belongs to no body; where a body moves into it, the body owns it. The lattice computes
//! nothing there ([`lbm::fluid::Fluid::leave_out`]). The momentum that the water outside exchanges with them at their
//! mouths is summed for the balance of the momentum.

use super::links::Direction;
use super::{BodyMap, Change, FLUID, GHOSTS, JOINT, OUTSIDE};
use lbm::lanes::Stored;
use lbm::links::gaps::BodyLinks;
use lbm::links::mirrored::MirroredLink;
use lbm::links::{BodyLink, Load, Rigid, Scheme, bounce};
use lbm::populations::{Link, Populations};
use std::collections::HashSet;

/// Change of a cell in an update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellChange {
    /// Water that a joint has taken.
    WaterClosed,
    /// Cell of a body that a joint has taken.
    BodyClosed,
    /// Cell of a joint that contains water of the lattice now.
    WaterOpened,
    /// Cell of a joint that a body has taken.
    BodyOpened,
}

/// Cells of joints in a slab.
#[derive(Clone, Debug, Default)]
pub(super) struct JointCells {
    /// Cells in joints, in ascending order of their indices in the map.
    wanted: Vec<(usize, [i32; 3])>,
    /// Cells that the lattice does not compute now: those in joints that are in no body.
    closed: Vec<(usize, [i32; 3])>,
    /// `true` if the cells in joints are other ones than in the last update.
    changed: bool,
    /// `true` if other cells are closed than before the last update, in the slab or its ghosts.
    altered: bool,
    /// Cells of the slab that closed or opened in the last update.
    moved: Vec<([usize; 3], CellChange)>,
    /// Links from closed cells to water.
    links: [BodyLinks; 1],
    /// Halves of links through planes of symmetry.
    mirrored: Vec<MirroredLink>,
    /// Those of them whose cell of water is in the slab.
    mouths: Vec<JointLink>,
    /// Number of times that the links were found.
    found: u64,
    load: [Load; 1],
}

/// Link from a cell of water in the slab into a closed cell of a joint.
#[derive(Clone, Copy, Debug)]
pub struct JointLink {
    /// Populations of the link.
    pub link: Link,
    /// Closed cell, in local coordinates.
    pub inner: [i32; 3],
    /// Direction into the closed cell, by its index in the velocity set.
    pub direction: usize,
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

    /// Returns the closed cells of joints in the slab and its ghosts, in local coordinates.
    #[must_use]
    pub fn closed_cells(&self) -> Vec<[i32; 3]> {
        let closed = self.joint_cells.closed.iter();
        closed.map(|(_, cell)| *cell).collect()
    }

    /// Returns the cells of the slab, without its ghosts, that closed or opened in the last update.
    #[must_use]
    pub fn joint_changes(&self) -> &[([usize; 3], CellChange)] {
        &self.joint_cells.moved
    }

    /// Returns `true` if the last update changed the closed cells in the slab or its ghosts.
    #[must_use]
    pub fn joints_altered(&self) -> bool {
        self.joint_cells.altered
    }

    /// Forgets the cells that closed or opened.
    pub(super) fn clear_joint_changes(&mut self) {
        self.joint_cells.moved.clear();
        self.joint_cells.altered = false;
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
        let mut left = HashSet::new();
        for change in &mut self.changes {
            let entry = (self.slab.layout_index(change.cell), change.cell);
            if change.before == FLUID && is_in(&before, &entry) {
                change.before = JOINT;
            } else if change.before != FLUID {
                left.insert(entry.0);
            }
        }
        let slab = &self.slab;
        let mut note = |cell: [i32; 3], change: CellChange| {
            if slab.interior(cell) {
                let cell = cell.map(|v| usize::try_from(v).unwrap_or(0));
                joints.moved.push((cell, change));
            }
        };
        let wanted = joints.wanted.iter();
        joints
            .closed
            .extend(wanted.filter(|(place, _)| owner[*place] == FLUID));
        for &(place, cell) in &joints.closed {
            owner[place] = JOINT;
            if !is_in(&before, &(place, cell)) {
                note(
                    cell,
                    if left.contains(&place) {
                        CellChange::BodyClosed
                    } else {
                        CellChange::WaterClosed
                    },
                );
                self.changes.push(Change {
                    cell,
                    before: FLUID,
                    impulse: None,
                });
            }
        }
        for &(place, cell) in &before {
            if owner[place] == FLUID {
                note(cell, CellChange::WaterOpened);
                self.changes.push(Change {
                    cell,
                    before: JOINT,
                    impulse: None,
                });
            } else if owner[place] != JOINT {
                note(cell, CellChange::BodyOpened);
            }
        }
        joints.altered = joints.closed != before;
    }

    /// Finds the links between closed cells of joints and water.
    pub(super) fn link_joints<S: Stored>(&mut self, populations: &Populations<S>) {
        let mut links = std::mem::take(&mut self.joint_cells.links);
        let mut mouths = std::mem::take(&mut self.joint_cells.mouths);
        links[0].clear();
        mouths.clear();
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
                    let outer_cell = cell.wrapping_add_signed(along.lattice_offset);
                    let link = populations.link(outer_cell, along.opposite);
                    links[0].open.push(joint_link(link, along, counts));
                    if counts {
                        mouths.push(JointLink {
                            link,
                            inner,
                            direction: along.opposite,
                        });
                    }
                }
            }
        }
        let mut mirrored = std::mem::take(&mut self.joint_cells.mirrored);
        self.mirror_joints(&self.joint_cells.closed, populations, &mut mirrored);
        self.joint_cells.mirrored = mirrored;
        self.joint_cells.links = links;
        self.joint_cells.mouths = mouths;
        self.joint_cells.found += 1;
    }

    /// Returns the halves of links from closed cells of joints through planes of symmetry.
    pub(super) fn mirrored_joint_links(&self) -> &[MirroredLink] {
        &self.joint_cells.mirrored
    }

    /// Returns the links from cells of water in the slab into closed cells of joints, and the number of times that they
    /// were found, which changes whenever they may have changed.
    #[must_use]
    pub fn joint_links(&self) -> (&[JointLink], u64) {
        (&self.joint_cells.mouths, self.joint_cells.found)
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
fn joint_link(link: Link, along: &Direction, counts: bool) -> BodyLink {
    BodyLink {
        link,
        middle: [0; 3],
        direction: u8::try_from(along.opposite).unwrap_or(0),
        loads: counts,
        backed: false,
    }
}
