//! The cells inside each body and the links that cross the surfaces, updated where bodies moved.
//!
//! A cell belongs to the body that contains its centre, and to the body of lowest id if several do. The *slack* of a
//! body is the smallest distance of any nearby cell centre from its surface. The cells of a body cannot change until it
//! has moved by its slack; until then it costs one comparison per step. A packing at rest therefore costs almost
//! nothing. The map is a function of the positions alone: it is the same after a restart and on any number of ranks.
//!
//! All geometry is computed in the frame of a body's raw position, so that all periodic images of a body have the same
//! bits.

mod gaps;
mod joint_cells;
mod links;
mod lookup;
mod mirrored;
mod owners;
mod rows;
mod slab;

use super::solid_fraction::faces;
use base::number::to_i32;
use base::thread_pool;
use dem::particles::{Motion, Particles};
use dem::space::{Components, Space};
pub use gaps::{GapVelocity, NarrowGaps};
use joint_cells::JointCells;
pub use joint_cells::{CellChange, JointLink};
use lbm::boundary::SolidPart;
use lbm::fluid::Fluid;
use lbm::lanes::Stored;
use lbm::links::gaps::{BodyLinks, Gaps};
use lbm::links::mirrored::MirroredLink;
use lbm::links::{BODIES_PER_THREAD as PER_THREAD, CellPlane, Load, Rigid, add_force};
use lbm::populations::Populations;
use links::{AtFaces, Direction};
use lookup::{Found, Nearest};
use nalgebra::Vector3;
use owners::Settled;
use rows::Rows;
use slab::Slab;
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicBool, Ordering};

/// Owner tag of cells outside the domain or in a structure, which belong to no body. The highest bit of owners is
/// reserved.
const OUTSIDE: u32 = u32::MAX >> 1;
/// Owner tag of cells of joints whose water a network computes.
const JOINT: u32 = OUTSIDE - 1;
/// Maximum id plus one: ids below it have tags between [`FLUID`] and [`JOINT`].
const MAX_IDS: u64 = OUTSIDE as u64 - 2;
/// Owner tag of a fluid cell.
const FLUID: u32 = 0;

/// Lattice onto which bodies are mapped.
#[derive(Clone, Debug)]
pub struct MapGrid {
    /// Cells of the whole domain.
    pub cells: [usize; 3],
    /// First cell of the slab.
    pub start: [usize; 3],
    /// Periodic axes.
    pub periodic: [bool; 3],
    /// `true` for each end of an axis that is a plane of symmetry.
    pub mirrored: [[bool; 2]; 3],
    /// Lower corner of the domain \[m\].
    pub origin: [f64; 3],
    /// Edge of a cell \[m\].
    pub spacing: f64,
}

impl MapGrid {
    /// Returns the grid of a fluid whose domain begins at `origin` \[m\], with cells of this edge \[m\].
    pub(super) fn new<S: Stored>(fluid: &Fluid<S>, origin: [f64; 3], spacing: f64) -> Self {
        Self {
            cells: fluid.domain_cells(),
            start: fluid.start(),
            periodic: fluid.periodic(),
            mirrored: fluid.planes_of_symmetry(),
            origin,
            spacing,
        }
    }

    /// Returns the cell of the domain of which a cell (local coordinates) is the image across planes of symmetry; none
    /// without such an image, and for cells of the domain.
    pub(super) fn image(&self, dimension: usize, local: [i32; 3]) -> Option<[i32; 3]> {
        let mut image = local;
        for (a, at) in image.iter_mut().enumerate().take(dimension) {
            let (start, cells) = (to_i32(self.start[a]), to_i32(self.cells[a]));
            let global = *at + start;
            if self.periodic[a] || (0..cells).contains(&global) {
                continue;
            }
            let upper = global >= cells;
            if !self.mirrored[a][usize::from(upper)] {
                return None;
            }
            *at = if upper {
                2 * cells - 1 - global - start
            } else {
                -1 - global - start
            };
        }
        (image != local).then_some(image)
    }

    /// Returns the offset in cells from the raw frame of a body to the local cells of the slab, for one of its
    /// images.
    pub(super) fn frame(&self, dimension: usize, shift: [i32; 3]) -> [i32; 3] {
        std::array::from_fn(|a| {
            if a < dimension {
                shift[a] * to_i32(self.cells[a]) - to_i32(self.start[a])
            } else {
                0
            }
        })
    }
}

/// Ghost layers around the slab: a link may end in the first, and the solid around its end is in the second. Grains
/// within this distance of a slab \[cells\] must be known to its rank.
pub const GHOSTS: i32 = 2;

/// Rules for links in addition to their geometry.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Ratio of the hydraulic radius to the radius of a grain.
    pub hydraulic_radius_factor: f64,
    /// Id of the first grain: bodies with a lower id keep their own radius.
    pub first_grain: u64,
    /// Rule for narrow gaps; none if surfaces always reflect with their own velocity.
    pub narrow: Option<NarrowGaps>,
    /// `true` if links read the cell behind their outer end, two cells from the body: interpolation needs fluid
    /// there.
    pub interpolated: bool,
}

/// Body, or periodic image of a body, near this slab.
#[derive(Clone, Debug, Default)]
struct Mapped {
    id: u64,
    shift: [i32; 3],
    /// Centre \[cells, raw frame\] and radius at the time of mapping.
    centre: [f64; 3],
    radius: f64,
    /// Quaternion of a polyhedron at the time of mapping.
    orientation: [f64; 4],
    /// Displacement below which the cells of the body cannot change; negative if the body is not mapped yet.
    slack: f64,
    nearest: Nearest,
    /// `true` if the body overlaps cells of another body: it is mapped again whenever any body is.
    shares: bool,
    /// `true` if the body must be mapped again in this update.
    again: bool,
    /// Halves of links through planes of symmetry, and their narrow gaps.
    mirrored: Vec<MirroredLink>,
    mirrored_gaps: Gaps,
    /// Cells in local coordinates, including those that belong to a body of lower id or a structure.
    rows: Rows,
    /// Buffer for the next search. After a search with a different result it contains the previous cells.
    other: Rows,
}

/// Orientation and faces of a polyhedron.
#[derive(Clone, Debug, Default)]
struct Turned {
    quaternion: [f64; 4],
    planes: Vec<CellPlane>,
}

/// Map of one slab.
pub struct BodyMap {
    slab: Slab,
    rules: Rules,
    /// Owner of each cell of the slab and of [`GHOSTS`] layers around it, x fastest.
    owner: Vec<u32>,
    bodies: Vec<Mapped>,
    entries: HashMap<u32, Vec<u32>>,
    /// Indices of the bodies that share cells.
    sharing: Vec<usize>,
    /// `true` if the entries at the last refresh are those mapped, including their images.
    adopted: bool,
    links: Vec<BodyLinks>,
    directions: Vec<Direction>,
    motion: Vec<Rigid>,
    /// Present orientation and faces of each entry; without faces for bodies that are not polyhedra, and empty if
    /// there are no polyhedra.
    blocks: Vec<Turned>,
    changes: Vec<Change>,
    again: Vec<RemapRequest>,
    relink: Vec<AtomicBool>,
    /// Results of the search for each run of bodies.
    found: Vec<Found>,
    /// Results of the threads that assign cells, and the number of rows below each layer.
    settled: Vec<Settled>,
    rows_below: Vec<usize>,
    /// Links between two fluid cells that sheets cut: index of the cell, and direction.
    sheets: HashSet<(usize, u8)>,
    joint_cells: JointCells,
    at_faces: AtFaces,
}

/// Body that is mapped again.
#[derive(Clone, Copy, Debug)]
struct RemapRequest {
    body: usize,
    /// `true` if the cells of the body have changed.
    moved: bool,
    /// `true` if the body shared cells with another body before.
    shared: bool,
}

/// Cell that changed its owner, or was returned to its previous owner.
#[derive(Clone, Copy, Debug)]
struct Change {
    cell: [i32; 3],
    before: u32,
    /// Impulse on a body by the change.
    impulse: Option<Impulse>,
}

/// Momentum in quanta that acts on a body at a point given in half cells.
#[derive(Clone, Copy, Debug)]
struct Impulse {
    entry: usize,
    momentum: [i64; 3],
    at: [i32; 3],
}

/// Minimum number of changed cells per thread.
const CHANGES_PER_THREAD: usize = 16;

#[expect(clippy::cast_possible_truncation, reason = "`refresh` checks ids")]
fn tag(id: u64) -> u32 {
    id as u32 + 1
}

impl BodyMap {
    /// Returns a map without bodies for the slab of `populations`.
    pub fn new<S: Stored>(populations: &Populations<S>, grid: MapGrid, rules: Rules) -> Self {
        let slab = Slab::new(populations, grid);
        Self {
            owner: slab.layout(FLUID, OUTSIDE),
            directions: links::directions(&slab, populations),
            slab,
            rules,
            bodies: Vec::new(),
            entries: HashMap::new(),
            sharing: Vec::new(),
            adopted: false,
            links: Vec::new(),
            motion: Vec::new(),
            blocks: Vec::new(),
            changes: Vec::new(),
            again: Vec::new(),
            relink: Vec::new(),
            found: Vec::new(),
            settled: Vec::new(),
            rows_below: Vec::new(),
            sheets: HashSet::new(),
            joint_cells: JointCells::default(),
            at_faces: AtFaces::default(),
        }
    }

    /// Excludes bodies from the cells of structures and from the links that sheets cut (index of the cell, direction).
    /// Must be called before any body is mapped.
    pub fn stand_in(
        &mut self,
        cells: impl Iterator<Item = [i32; 3]>,
        sheets: &HashSet<(usize, u8)>,
    ) {
        for cell in cells {
            let position = self.slab.layout_index(cell);
            self.owner[position] = OUTSIDE;
        }
        self.sheets.clone_from(sheets);
    }

    /// Returns `true` if neither a body nor a structure owns the cell at an index of the map.
    #[must_use]
    pub fn is_water(&self, place: u32) -> bool {
        self.owner[place as usize] == FLUID
    }

    /// Returns the links of each entry of the particles.
    #[must_use]
    pub fn links(&self) -> &[BodyLinks] {
        &self.links
    }

    /// Returns `true` if no body is mapped.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Returns `true` if the last update changed no cell and no link.
    #[must_use]
    pub fn is_as_before(&self) -> bool {
        self.again.is_empty() && self.changes.is_empty()
    }

    /// Returns the motion of each entry in lattice units, as last refreshed.
    #[must_use]
    pub fn motion(&self) -> &[Rigid] {
        &self.motion
    }

    /// Returns the faces of an entry, in the frame of its position; empty for a disc or sphere.
    #[must_use]
    pub fn faces(&self, k: usize) -> &[CellPlane] {
        self.blocks.get(k).map_or(&[], |block| &block.planes)
    }

    /// Returns the id of the body that owns a cell of the slab (local coordinates).
    #[must_use]
    pub fn body_at(&self, cell: [usize; 3]) -> Option<u64> {
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        match self.owner[self.slab.layout_index(cell)] {
            FLUID | OUTSIDE | JOINT => None,
            tag => Some(u64::from(tag) - 1),
        }
    }

    /// Returns, by their indices in the map, the cells that changed their owner in the last update, with `true` for
    /// those that lay in a body or a joint before.
    #[must_use]
    pub fn closed_before(&self) -> HashMap<usize, bool> {
        // The first of several changes of a cell has its owner before the update.
        let changes = self.changes.iter().rev();
        let closed = |owner: u32| owner != FLUID && owner != OUTSIDE;
        changes
            .map(|change| (self.slab.layout_index(change.cell), closed(change.before)))
            .collect()
    }

    /// Returns `true` if a cell of the slab or a ghost cell (local coordinates) lay in a body or a joint before the
    /// last update, whose changes are those of [`Self::closed_before`].
    #[must_use]
    pub fn was_closed(&self, cell: [isize; 3], before: &HashMap<usize, bool>) -> bool {
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        let place = self.slab.layout_index(cell);
        let closed = |owner: u32| owner != FLUID && owner != OUTSIDE;
        (before.get(&place).copied()).unwrap_or_else(|| closed(self.owner[place]))
    }

    /// Forgets the changes of the last update, where no body is left.
    pub fn forget_changes(&mut self) {
        self.changes.clear();
    }

    /// Returns the body or joint in a cell of the slab (local coordinates), with the velocity of the body there.
    #[must_use]
    pub fn solid_in(&self, cell: [usize; 3]) -> SolidPart {
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        let owner = self.owner[self.slab.layout_index(cell)];
        if owner == FLUID || owner == OUTSIDE {
            return SolidPart::at_rest(0.0);
        }
        let moves = (owner != JOINT)
            .then(|| self.nearest(owner, cell))
            .flatten();
        let Some((entry, frame)) = moves else {
            return SolidPart::at_rest(1.0);
        };
        let motion = &self.motion[entry];
        let r: [f64; 3] = std::array::from_fn(|a| {
            if a < self.slab.dimension {
                f64::from(cell[a] - frame[a]) + 0.5 - motion.position[a]
            } else {
                0.0
            }
        });
        let turns = Vector3::from(motion.spin).cross(&Vector3::from(r));
        SolidPart {
            fraction: 1.0,
            velocity: (Vector3::from(motion.velocity) + turns).into(),
        }
    }

    /// Copies positions and velocities of the bodies. `velocity` and `spin` convert to lattice units.
    pub fn refresh<Sp: Space>(
        &mut self,
        particles: &Particles<Sp>,
        velocity: f64,
        spin: f64,
    ) -> Result<(), String> {
        if let Some(body) = particles.body.iter().find(|body| body.id >= MAX_IDS) {
            return Err(format!("id {} is too large for the map of bodies", body.id));
        }
        let count = particles.len();
        self.motion.resize(count, Rigid::default());
        if particles.has_blocks() {
            self.blocks.resize_with(count, Turned::default);
        }
        let (grid, rules, mapped) = (&self.slab.grid, &self.rules, &self.bodies);
        let same = AtomicBool::new(mapped.len() == count);
        let runs = thread_pool::runs(count, PER_THREAD);
        let blocks = self.blocks.len().min(count);
        let shared = (
            thread_pool::evenly(&mut self.motion, runs),
            thread_pool::cut(&mut self.blocks, runs, |run| blocks * run / runs),
        );
        let particles = particles.view();
        thread_pool::each_run_of(runs, shared, |run, (motion, blocks)| {
            let mut blocks = blocks.iter_mut();
            for (k, rigid) in (count * run / runs..).zip(motion) {
                let body = &particles.body[k];
                let is = |old: &Mapped| old.id == body.id && old.shift == particles.shift[k];
                if !mapped.get(k).is_some_and(is) {
                    same.store(false, Ordering::Relaxed);
                }
                let factor = if body.id < rules.first_grain {
                    1.0
                } else {
                    rules.hydraulic_radius_factor
                };
                *rigid = in_cells(&particles.motion[k], grid, velocity, spin);
                rigid.radius = body.radius * factor / grid.spacing;
                let turned = blocks.next();
                if let Some((shape, state)) = particles.polyhedron(k) {
                    rigid.radius = body.radius / grid.spacing;
                    if let Some(turned) = turned {
                        turned.quaternion = state.orientation.coords.into();
                        let rotation = state.matrix();
                        faces(
                            shape,
                            &rotation,
                            rigid.position,
                            grid.spacing,
                            &mut turned.planes,
                        );
                    }
                } else if let Some(turned) = turned {
                    turned.planes.clear();
                }
            }
        });
        self.adopted = same.into_inner();
        Ok(())
    }

    /// Maps the bodies that moved. With `loads`, a body gains the momentum of fluid cells that it covers and loses
    /// that of cells that it uncovers (Aidun, Lu and Ding 1998).
    ///
    /// Must be called after [`Self::refresh`].
    pub fn update_bodies<Sp: Space, S: Stored>(
        &mut self,
        particles: &Particles<Sp>,
        populations: &Populations<S>,
        loads: Option<&mut [Load]>,
    ) {
        if self.slab.cells.contains(&0) {
            // An empty slab has no cells, but entries still have elements in the lists.
            self.links.resize_with(particles.len(), BodyLinks::default);
            return;
        }
        self.changes.clear();
        self.again.clear();
        self.clear_joint_changes();
        let reassigned = !self.adopted;
        if reassigned {
            self.assign_maps(particles);
        }
        self.recheck_moved_bodies();
        let again = !self.again.is_empty() || !self.changes.is_empty() || self.joints_changed();
        if again {
            self.map_again(populations, loads);
        }
        if again || reassigned {
            self.list_standing();
        }
        if reassigned {
            self.find_motions_in_gaps();
        }
        self.renew_gaps();
    }

    /// Assigns the cells of the bodies that moved, and finds the links near cells that changed.
    fn map_again<S: Stored>(&mut self, populations: &Populations<S>, loads: Option<&mut [Load]>) {
        self.open_joints();
        // The owners of cells shared by several bodies are determined again.
        for &body in &self.sharing {
            if !self.bodies[body].again {
                self.again.push(RemapRequest {
                    body,
                    moved: false,
                    shared: true,
                });
            }
        }
        self.settle();
        self.close_joints();
        self.apply_changes(populations, loads);
        self.link_joints(populations);
    }

    /// Computes loads from covered and uncovered cells, and new links for every body near a change.
    fn apply_changes<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        loads: Option<&mut [Load]>,
    ) {
        // All flags are cleared: each body resets its own.
        self.relink
            .resize_with(self.bodies.len(), AtomicBool::default);
        let far = self.rules.narrow.is_some() || self.rules.interpolated;
        let reach = if far { 2 } else { 1 };
        let mut changes = std::mem::take(&mut self.changes);
        thread_pool::each_item(&mut changes, CHANGES_PER_THREAD, |_, change| {
            let &mut Change { cell, before, .. } = change;
            let after = self.owner[self.slab.layout_index(cell)];
            if before != after {
                if loads.is_some() {
                    change.impulse = self.impulse(cell, before, after, populations);
                }
                self.relink_around(cell, before, reach);
            }
        });
        if let Some(loads) = loads {
            for Impulse {
                entry,
                momentum,
                at,
            } in changes.iter().filter_map(|change| change.impulse)
            {
                if self.slab.dimension == 2 {
                    add_force::<2>(&mut loads[entry], momentum, at);
                } else {
                    add_force::<3>(&mut loads[entry], momentum, at);
                }
            }
        }
        self.mirror_links(populations);
        // A change affects only neighbouring cells: with few changes, few bodies need new links.
        let few = changes.len() < PER_THREAD;
        self.changes = changes;
        let mut links = std::mem::take(&mut self.links);
        let link = |k: usize, links: &mut BodyLinks| {
            let flag = &self.relink[k];
            if flag.load(Ordering::Relaxed) {
                flag.store(false, Ordering::Relaxed);
                self.link(k, populations, links);
            }
        };
        if few {
            links
                .iter_mut()
                .enumerate()
                .for_each(|(k, links)| link(k, links));
        } else {
            thread_pool::each_item_in_runs(&mut links, PER_THREAD, link);
        }
        self.links = links;
    }

    /// Returns the impulse on the body that covers or uncovers a cell of the slab.
    fn impulse<S: Stored>(
        &self,
        cell: [i32; 3],
        before: u32,
        after: u32,
        populations: &Populations<S>,
    ) -> Option<Impulse> {
        let (body, sign) = match (before, after) {
            (FLUID, body) => (body, 1.0),
            (body, FLUID) => (body, -1.0),
            _ => return None,
        };
        if !self.slab.interior(cell) {
            return None;
        }
        let (_, momentum) = populations.moments(populations.cell(cell.map(|v| v as isize)));
        let (entry, frame) = self.nearest(body, cell)?;
        Some(Impulse {
            entry,
            momentum: momentum.map(|m| lbm::boundary::quanta(sign * m)),
            at: std::array::from_fn(|a| {
                if a < self.slab.dimension {
                    2 * (cell[a] - frame[a]) + 1
                } else {
                    0
                }
            }),
        })
    }
}

/// Returns the motion of a grain in lattice units, without its radius; `velocity` and `spin` convert to lattice
/// units.
pub(super) fn in_cells<Sp: Space>(
    motion: &Motion<Sp>,
    grid: &MapGrid,
    velocity: f64,
    spin: f64,
) -> Rigid {
    let mut rigid = Rigid::default();
    for a in 0..Sp::DIMENSION {
        rigid.position[a] = (motion.position.get(a) - grid.origin[a]) / grid.spacing;
        rigid.velocity[a] = motion.velocity.get(a) * velocity;
    }
    if Sp::DIMENSION == 2 {
        rigid.spin[2] = motion.spin.get(0) * spin;
    } else {
        for a in 0..3 {
            rigid.spin[a] = motion.spin.get(a) * spin;
        }
    }
    rigid
}

#[cfg(test)]
mod tests;
