//! The cells inside each body and the links that cross the surfaces, updated where bodies moved.
//!
//! A cell belongs to the body that contains its centre, and to the body of lowest id if several do. The *slack* of a body is the smallest
//! distance of any nearby cell centre from its surface. The cells of a body cannot change until it has moved by its slack; until then
//! it costs one comparison per step. A packing at rest therefore costs almost nothing. The map is a function of the positions alone: it is the same
//! after a restart and on any number of ranks.
//!
//! All geometry is computed in the frame of a body's raw position, so that all periodic images of a body have the same bits.

mod links;
mod owners;

use super::solid_fraction::faces;
use crate::dem::particles::Particles;
use crate::dem::space::{Components, Space};
use crate::lbm::lanes::Stored;
use crate::lbm::links::{BodyLink, Load, Plane, Rigid, add_force};
use crate::lbm::populations::Populations;
use crate::thread_pool;
use std::collections::{HashMap, HashSet};

/// A cell outside the domain or in a structure: the business of the faces and of the structures.
const OUTSIDE: u32 = u32::MAX;
/// A cell of fluid.
const FLUID: u32 = 0;

/// The lattice that bodies are mapped to.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Cells of the whole domain.
    pub cells: [usize; 3],
    /// First cell of the slab.
    pub start: [usize; 3],
    /// Periodic axes.
    pub periodic: [bool; 3],
    /// Lower corner of the domain \[m\].
    pub origin: [f64; 3],
    /// Edge of a cell \[m\].
    pub spacing: f64,
}

/// Layers of cells known beyond the slab: a link may end in the first, and what is solid round its end is in the
/// second. Grains within this many cells of a slab must be known there.
pub const GHOSTS: i32 = 2;

/// What a link needs to know beyond geometry.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Radius that the fluid sees over the radius of a grain.
    pub hydraulic_radius_factor: f64,
    /// Bodies with an id below this keep their own radius.
    pub first_grain: u64,
    /// A fluid cell with at least this many solid neighbours does not feel the walls' velocity; none for never.
    pub isolated: Option<usize>,
    /// Links look at the cell behind their outer one, two from the body: interpolation needs water there.
    pub interpolated: bool,
}

/// One body, or one image of a body, near this slab.
#[derive(Clone, Debug, Default)]
struct Mapped {
    id: u64,
    shift: [i32; 3],
    /// Centre in cells (raw frame) and radius when it was mapped.
    centre: [f64; 3],
    radius: f64,
    /// Quaternion of a polyhedron when it was mapped.
    orientation: [f64; 4],
    /// It cannot change cells until it has moved this far; negative: not mapped yet.
    slack: f64,
    /// It shares cells with another body: mapped again whenever anything is.
    shares: bool,
    /// Its cells: local coordinates.
    cells: Vec<[i32; 3]>,
}

/// How a polyhedron stands.
#[derive(Clone, Debug, Default)]
struct Turned {
    quaternion: [f64; 4],
    planes: Vec<Plane>,
}

/// The map of one slab.
pub struct BodyMap {
    grid: Grid,
    rules: Rules,
    /// Cells of the slab.
    local: [i32; 3],
    dimension: usize,
    /// Owner of each cell of the slab and of [`GHOSTS`] layers round it, x fastest.
    owner: Vec<u32>,
    stamp: Vec<u32>,
    now: u32,
    bodies: Vec<Mapped>,
    entries: HashMap<u32, Vec<u32>>,
    links: Vec<Vec<BodyLink>>,
    motion: Vec<Rigid>,
    /// How polyhedra stand now, by entry; without faces for the others, and empty where there is none.
    blocks: Vec<Turned>,
    changes: Vec<([i32; 3], u32)>,
    again: Vec<u32>,
    relink: Vec<bool>,
    /// Cells found by the last look at a body, of each thread.
    found: Vec<Vec<[i32; 3]>>,
    /// Bodies that moved since they were mapped.
    looks: Vec<Look>,
    /// Links between two cells of water that sheets cut: place of the cell and direction.
    sheets: HashSet<(usize, u8)>,
}

/// A look at a body that moved.
#[derive(Clone, Copy, Debug)]
struct Look {
    body: usize,
    slack: f64,
    /// It holds the same cells as before, alone.
    stays: bool,
}

impl Look {
    fn at(body: usize) -> Self {
        Self {
            body,
            slack: 0.0,
            stays: false,
        }
    }
}

/// Bodies from which a thread pays.
const PER_THREAD: usize = 16;

/// Threads for work on so many bodies.
fn threads(bodies: usize) -> usize {
    thread_pool::threads().min(bodies / PER_THREAD).max(1)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "ids are checked against u32 in `refresh`"
)]
fn tag(id: u64) -> u32 {
    id as u32 + 1
}

impl BodyMap {
    /// A map without bodies for the slab of `populations`.
    pub fn new<S: Stored>(populations: &Populations<S>, grid: Grid, rules: Rules) -> Self {
        let dimension = populations.velocities().dimension;
        let local = populations
            .cells()
            .map(|n| i32::try_from(n).unwrap_or(i32::MAX));
        let ghosts = |a: usize| if a < dimension { GHOSTS } else { 0 };
        let count: usize = (0..3)
            .map(|a| usize::try_from(local[a] + 2 * ghosts(a)).unwrap_or(0))
            .product();
        let mut map = Self {
            owner: vec![OUTSIDE; count],
            stamp: vec![0; count],
            now: 0,
            grid,
            rules,
            local,
            dimension,
            bodies: Vec::new(),
            entries: HashMap::new(),
            links: Vec::new(),
            motion: Vec::new(),
            blocks: Vec::new(),
            changes: Vec::new(),
            again: Vec::new(),
            relink: Vec::new(),
            found: Vec::new(),
            looks: Vec::new(),
            sheets: HashSet::new(),
        };
        let range = |a: usize| -ghosts(a)..local[a] + ghosts(a);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    if map.inside_domain([x, y, z]) {
                        let position = map.at([x, y, z]);
                        map.owner[position] = FLUID;
                    }
                }
            }
        }
        map
    }

    /// Keeps bodies out of the cells of structures and of the links that sheets cut (place of the cell, direction), before any body is
    /// mapped.
    pub fn stand_in(
        &mut self,
        cells: impl Iterator<Item = [i32; 3]>,
        sheets: &HashSet<(usize, u8)>,
    ) {
        for cell in cells {
            let position = self.at(cell);
            self.owner[position] = OUTSIDE;
        }
        self.sheets.clone_from(sheets);
    }

    /// Whether neither body nor structure holds the cell at a place in the map.
    #[must_use]
    pub fn is_water(&self, place: u32) -> bool {
        self.owner[place as usize] == FLUID
    }

    /// The polyhedron that an entry is, if it is one.
    fn block(&self, k: usize) -> Option<&Turned> {
        self.blocks.get(k).filter(|block| !block.planes.is_empty())
    }

    fn ghosts(&self, axis: usize) -> i32 {
        if axis < self.dimension { GHOSTS } else { 0 }
    }

    /// Position of a cell in `owner`.
    fn at(&self, cell: [i32; 3]) -> usize {
        let size = |a: usize| self.local[a] + 2 * self.ghosts(a);
        let k = |a: usize| cell[a] + self.ghosts(a);
        usize::try_from((k(2) * size(1) + k(1)) * size(0) + k(0)).unwrap_or(usize::MAX)
    }

    fn inside_domain(&self, local: [i32; 3]) -> bool {
        (0..self.dimension).all(|a| {
            let global = i64::from(local[a]) + self.grid.start[a].cast_signed() as i64;
            self.grid.periodic[a] || (0..self.grid.cells[a].cast_signed() as i64).contains(&global)
        })
    }

    /// Within the slab and its ghosts.
    fn held(&self, local: [i32; 3]) -> bool {
        (0..3).all(|a| {
            let ghosts = self.ghosts(a);
            (-ghosts..self.local[a] + ghosts).contains(&local[a])
        })
    }

    fn interior(&self, local: [i32; 3]) -> bool {
        (0..3).all(|a| (0..self.local[a]).contains(&local[a]))
    }

    /// The links of each entry of the particles.
    #[must_use]
    pub fn links(&self) -> &[Vec<BodyLink>] {
        &self.links
    }

    /// Whether no body is mapped.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Whether the last update changed no cell and no link.
    #[must_use]
    pub fn is_as_before(&self) -> bool {
        self.again.is_empty() && self.changes.is_empty()
    }

    /// Motion of each entry in lattice units, as last refreshed.
    #[must_use]
    pub fn motion(&self) -> &[Rigid] {
        &self.motion
    }

    /// Faces of an entry, in the frame of its position: none of a disc or sphere.
    #[must_use]
    pub fn faces(&self, k: usize) -> &[Plane] {
        self.blocks.get(k).map_or(&[], |block| &block.planes)
    }

    /// Id of the body that holds a cell of the slab (local coordinates).
    #[must_use]
    pub fn body_at(&self, cell: [usize; 3]) -> Option<u64> {
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        match self.owner[self.at(cell)] {
            FLUID | OUTSIDE => None,
            tag => Some(u64::from(tag) - 1),
        }
    }

    /// Takes over positions and velocities. `velocity` and `spin` convert to lattice units.
    pub fn refresh<Sp: Space>(
        &mut self,
        particles: &Particles<Sp>,
        velocity: f64,
        spin: f64,
    ) -> Result<(), String> {
        self.motion.clear();
        if particles.has_blocks() {
            self.blocks.resize_with(particles.len(), Turned::default);
        }
        for (k, (body, motion)) in particles.body.iter().zip(&particles.motion).enumerate() {
            if body.id >= u64::from(u32::MAX) - 2 {
                return Err(format!("id {} is too large for the map of bodies", body.id));
            }
            let factor = if body.id < self.rules.first_grain {
                1.0
            } else {
                self.rules.hydraulic_radius_factor
            };
            let mut rigid = Rigid {
                radius: body.radius * factor / self.grid.spacing,
                ..Rigid::default()
            };
            for a in 0..Sp::DIMENSION {
                rigid.position[a] =
                    (motion.position.get(a) - self.grid.origin[a]) / self.grid.spacing;
                rigid.velocity[a] = motion.velocity.get(a) * velocity;
            }
            if Sp::DIMENSION == 2 {
                rigid.spin[2] = motion.spin.get(0) * spin;
            } else {
                for a in 0..3 {
                    rigid.spin[a] = motion.spin.get(a) * spin;
                }
            }
            if let Some((shape, state)) = particles.polyhedron(k) {
                rigid.radius = body.radius / self.grid.spacing;
                let turned = &mut self.blocks[k];
                turned.quaternion = state.orientation.coords.into();
                let (rotation, spacing) = (state.matrix(), self.grid.spacing);
                faces(
                    shape,
                    &rotation,
                    rigid.position,
                    spacing,
                    &mut turned.planes,
                );
            } else if let Some(turned) = self.blocks.get_mut(k) {
                turned.planes.clear();
            }
            self.motion.push(rigid);
        }
        Ok(())
    }

    /// Maps what moved. With `loads`, the momentum of cells that were covered goes to the body and that of uncovered cells
    /// is taken from it (Aidun, Lu and Ding 1998).
    ///
    /// Call after [`Self::refresh`].
    pub fn update_bodies<Sp: Space, S: Stored>(
        &mut self,
        particles: &Particles<Sp>,
        populations: &Populations<S>,
        loads: Option<&mut [Load]>,
    ) {
        if self.local.contains(&0) {
            // An empty slab holds no cells; entries still have a place in the lists.
            self.links.resize_with(particles.len(), Vec::new);
            return;
        }
        self.now = self.now.wrapping_add(1).max(1);
        self.changes.clear();
        self.again.clear();
        let same = self.bodies.len() == particles.len()
            && self
                .bodies
                .iter()
                .zip(particles.body.iter().zip(&particles.shift))
                .all(|(old, (body, shift))| old.id == body.id && old.shift == *shift);
        if !same {
            self.adopt(particles);
        }
        self.look_again();
        if self.again.is_empty() && self.changes.is_empty() {
            return;
        }
        // Bodies that share cells settle anew who has them.
        for k in 0..self.bodies.len() {
            let n = u32::try_from(k).unwrap_or(u32::MAX);
            if self.bodies[k].shares && !self.again.contains(&n) {
                self.again.push(n);
            }
        }
        let again = std::mem::take(&mut self.again);
        for &k in &again {
            self.clear(k as usize);
        }
        for &k in &again {
            self.set(k as usize);
        }
        self.again = again;
        self.apply_changes(populations, loads);
    }

    /// Loads from covered and uncovered cells, and new links for every body near a change.
    fn apply_changes<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        loads: Option<&mut [Load]>,
    ) {
        self.relink.clear();
        self.relink.resize(self.bodies.len(), false);
        let far = self.rules.isolated.is_some() || self.rules.interpolated;
        let reach = if far { 2 } else { 1 };
        let changes = std::mem::take(&mut self.changes);
        let mut loads = loads;
        for &(cell, before) in &changes {
            let position = self.at(cell);
            let after = self.owner[position];
            if before == after {
                continue;
            }
            if let Some(loads) = &mut loads
                && self.interior(cell)
                && (before == FLUID || after == FLUID)
            {
                let (_, momentum) = populations.moments(populations.cell(cell.map(|v| v as isize)));
                let (body, sign) = if after == FLUID {
                    (before, -1.0)
                } else {
                    (after, 1.0)
                };
                if let Some((entry, frame)) = self.nearest(body, cell) {
                    let force = momentum.map(|m| crate::lbm::boundary::quanta(sign * m));
                    let middle = std::array::from_fn(|a| {
                        if a < self.dimension {
                            2 * (cell[a] - frame[a]) + 1
                        } else {
                            0
                        }
                    });
                    if self.dimension == 2 {
                        add_force::<2>(&mut loads[entry], force, middle);
                    } else {
                        add_force::<3>(&mut loads[entry], force, middle);
                    }
                }
            }
            self.flag(before);
            self.flag(after);
            let deep = if self.dimension == 3 { reach } else { 0 };
            for dz in -deep..=deep {
                for dy in -reach..=reach {
                    for dx in -reach..=reach {
                        let near = [cell[0] + dx, cell[1] + dy, cell[2] + dz];
                        if self.held(near) {
                            self.flag(self.owner[self.at(near)]);
                        }
                    }
                }
            }
        }
        self.changes = changes;
        let mut links = std::mem::take(&mut self.links);
        let again = self.relink.iter().filter(|again| **again).count();
        // Pieces in which about as many bodies are linked again as pay for a thread.
        let least = links.len() * PER_THREAD / again.max(1);
        thread_pool::each_item(&mut links, least, |k, links| {
            if self.relink[k] {
                self.link(k, populations, links);
            }
        });
        self.links = links;
    }
}
