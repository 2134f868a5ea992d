//! Which cells lie inside which body, and the links that cross the surfaces: kept up to date at the cost of what moved.
//!
//! A cell belongs to the body that contains its centre, to the one of lowest id where several do. After a body was mapped
//! at some place its cells cannot change until it has moved by its *slack*, the smallest distance of any nearby cell centre
//! from its surface; until then it costs one comparison a step. So a packing at rest costs nothing, and the map is a
//! function of the positions alone, the same after a restart and on any ranks.
//!
//! All geometry is done in the frame of a body's raw position, so that every image of a body through a periodic face maps
//! with the same bits.

use super::solid_fraction::{Form, faces};
use crate::dem::particles::Particles;
use crate::dem::space::{Components, Space};
use crate::lbm::lanes::Stored;
use crate::lbm::links::{BodyLink, Load, Plane, Rigid, add_force};
use crate::lbm::populations::Populations;
use crate::thread_pool;
use std::collections::HashMap;

/// A cell outside the domain: the faces' business.
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
    /// Lower corner of the domain [m].
    pub origin: [f64; 3],
    /// Edge of a cell [m].
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

#[expect(
    clippy::cast_possible_truncation,
    reason = "coordinates are far below 2^31"
)]
fn floor(x: f64) -> i32 {
    x.floor() as i32
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
            if let Some((shape, attitude)) = particles.polyhedron(k) {
                rigid.radius = body.radius / self.grid.spacing;
                let turned = &mut self.blocks[k];
                turned.quaternion = attitude.orientation.coords.into();
                let (rotation, spacing) = (attitude.matrix(), self.grid.spacing);
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
    pub fn follow<Sp: Space, S: Stored>(
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
        self.settle(populations, loads);
    }

    /// Whether a body has moved by its slack since it was mapped, or was not mapped yet.
    fn moved(&self, k: usize) -> bool {
        let (body, now) = (&self.bodies[k], &self.motion[k]);
        let moved: f64 = (0..self.dimension)
            .map(|a| (now.position[a] - body.centre[a]).powi(2))
            .sum();
        // A point of a polyhedron moves no further than its centroid and its farthest corner by turning.
        let moved = self.block(k).map_or(moved, |block| {
            let turned: f64 = (0..4)
                .map(|a| (block.quaternion[a] - body.orientation[a]).powi(2))
                .sum();
            (moved.sqrt() + 2.1 * now.radius * turned.sqrt()).powi(2)
        });
        #[expect(
            clippy::float_cmp,
            reason = "any change of radius at all asks for a new map"
        )]
        let resized = now.radius != body.radius;
        body.slack < 0.0 || moved >= body.slack * body.slack || resized
    }

    /// Looks at the bodies that moved, by threads: most still hold the same cells, the others are to be mapped `again`.
    fn look_again(&mut self) {
        let mut looks = std::mem::take(&mut self.looks);
        looks.clear();
        looks.extend(
            (0..self.bodies.len())
                .filter(|&k| self.moved(k))
                .map(Look::at),
        );
        let threads = threads(looks.len());
        self.found
            .resize_with(threads.max(self.found.len()), Vec::new);
        let mut buffers = std::mem::take(&mut self.found);
        let shared = (
            thread_pool::evenly(&mut buffers[..threads], threads),
            thread_pool::evenly(&mut looks, threads),
        );
        thread_pool::each_of(threads, shared, |_, (found, looks)| {
            let found = &mut found[0];
            for look in looks {
                let body = &self.bodies[look.body];
                // Bodies that hold cells alone.
                let alone = body.slack >= 0.0 && !body.shares;
                look.slack = self.look(look.body, found);
                look.stays = alone && *found == body.cells && self.all_mine(look.body, found);
            }
        });
        self.found = buffers;
        for one in &looks {
            if one.stays {
                self.keep(one.body, one.slack);
            } else {
                self.again.push(u32::try_from(one.body).unwrap_or(u32::MAX));
            }
        }
        self.looks = looks;
    }

    /// Gives each entry of the particles the map of the same body and image, and clears those that went away.
    fn adopt<Sp: Space>(&mut self, particles: &Particles<Sp>) {
        let mut old: HashMap<(u64, [i32; 3]), (Mapped, Vec<BodyLink>)> = self
            .bodies
            .drain(..)
            .zip(self.links.drain(..))
            .map(|(body, links)| ((body.id, body.shift), (body, links)))
            .collect();
        let mut bodies = Vec::with_capacity(particles.len());
        let mut links = Vec::with_capacity(particles.len());
        for (body, shift) in particles.body.iter().zip(&particles.shift) {
            let (mapped, list) = old.remove(&(body.id, *shift)).unwrap_or_else(|| {
                let fresh = Mapped {
                    id: body.id,
                    shift: *shift,
                    slack: -1.0,
                    ..Mapped::default()
                };
                (fresh, Vec::new())
            });
            bodies.push(mapped);
            links.push(list);
        }
        // What is left went away; in a fixed order, though no result depends on it.
        let mut gone: Vec<Mapped> = old.into_values().map(|(body, _)| body).collect();
        gone.sort_by_key(|body| (body.id, body.shift));
        for body in gone {
            for &cell in &body.cells {
                let position = self.at(cell);
                if self.owner[position] == tag(body.id) {
                    self.note(cell, position);
                    self.owner[position] = FLUID;
                }
            }
        }
        self.bodies = bodies;
        self.links = links;
        self.entries.clear();
        for (k, body) in self.bodies.iter().enumerate() {
            let k = u32::try_from(k).unwrap_or(u32::MAX);
            self.entries.entry(tag(body.id)).or_default().push(k);
        }
    }

    /// Remembers what a cell was before this call of `follow` changed it.
    fn note(&mut self, cell: [i32; 3], position: usize) {
        if self.stamp[position] != self.now {
            self.stamp[position] = self.now;
            self.changes.push((cell, self.owner[position]));
        }
    }

    fn clear(&mut self, k: usize) {
        let mine = tag(self.bodies[k].id);
        let cells = std::mem::take(&mut self.bodies[k].cells);
        for &cell in &cells {
            let position = self.at(cell);
            if self.owner[position] == mine {
                self.note(cell, position);
                self.owner[position] = FLUID;
            }
        }
        self.bodies[k].cells = cells;
        self.bodies[k].cells.clear();
        self.bodies[k].shares = false;
    }

    /// Distance in cells from the raw frame of a body to the local cells of this slab, for its image.
    fn frame(&self, shift: [i32; 3]) -> [i32; 3] {
        std::array::from_fn(|a| {
            let cells = i32::try_from(self.grid.cells[a]).unwrap_or(i32::MAX);
            let start = i32::try_from(self.grid.start[a]).unwrap_or(i32::MAX);
            if a < self.dimension {
                shift[a] * cells - start
            } else {
                0
            }
        })
    }

    /// Finds the cells of a body by geometry alone, in `found`, and its slack.
    fn look(&self, k: usize, found: &mut Vec<[i32; 3]>) -> f64 {
        found.clear();
        match (self.dimension, self.block(k)) {
            (_, Some(block)) => self.look_in_block(k, &block.planes, found),
            (2, None) => self.look_in::<2>(k, found),
            (_, None) => self.look_in::<3>(k, found),
        }
    }

    fn look_in<const D: usize>(&self, k: usize, found: &mut Vec<[i32; 3]>) -> f64 {
        let rigid = &self.motion[k];
        let frame = self.frame(self.bodies[k].shift);
        let reach = rigid.radius + 1.5;
        let mut low = [0; 3];
        let mut high = [0; 3];
        for a in 0..D {
            low[a] = floor(rigid.position[a] - reach).max(-GHOSTS - frame[a]);
            high[a] = floor(rigid.position[a] + reach).min(self.local[a] + GHOSTS - 1 - frame[a]);
        }
        let radius2 = rigid.radius * rigid.radius;
        let square = |cell: i32, a: usize| {
            let d = f64::from(cell) + 0.5 - rigid.position[a];
            d * d
        };
        // The smallest |distance - radius|, by way of squares: |d² - R²| / (d + R) with d + R at most 2 R + reach.
        let mut slack2 = f64::INFINITY;
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                let mut beside = square(y, 1);
                if D == 3 {
                    beside += square(z, 2);
                }
                for x in low[0]..=high[0] {
                    let beyond = square(x, 0) + beside - radius2;
                    slack2 = slack2.min(beyond.abs());
                    if beyond < 0.0 {
                        found.push([x + frame[0], y + frame[1], z + frame[2]]);
                    }
                }
            }
        }
        // A little below the true slack, so that rounding cannot matter; beyond the searched box it is at least half a cell.
        if slack2.is_finite() {
            (slack2 / (2.0 * rigid.radius + 2.5) * (1.0 - 1e-6) - 1e-9).clamp(0.0, 0.4)
        } else {
            // The body does not reach this slab: it may come closer by its whole distance, but look again soon.
            0.4
        }
    }

    /// As [`Self::look_in`], of a polyhedron: the distance from its surface is at least that from the nearest plane.
    fn look_in_block(&self, k: usize, planes: &[Plane], found: &mut Vec<[i32; 3]>) -> f64 {
        let rigid = &self.motion[k];
        let frame = self.frame(self.bodies[k].shift);
        let reach = rigid.radius + 1.5;
        let low: [i32; 3] =
            std::array::from_fn(|a| floor(rigid.position[a] - reach).max(-GHOSTS - frame[a]));
        let high: [i32; 3] = std::array::from_fn(|a| {
            floor(rigid.position[a] + reach).min(self.local[a] + GHOSTS - 1 - frame[a])
        });
        let form = Form::Block {
            planes,
            centre: rigid.position,
            radius: rigid.radius,
        };
        let mut slack = 0.4_f64;
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let height = form.height([x, y, z].map(|v| f64::from(v) + 0.5));
                    slack = slack.min(height.abs());
                    if height < 0.0 {
                        found.push([x + frame[0], y + frame[1], z + frame[2]]);
                    }
                }
            }
        }
        (slack * (1.0 - 1e-6) - 1e-9).max(0.0)
    }

    /// Whether every cell that was found is this body's already, or outside.
    fn all_mine(&self, k: usize, found: &[[i32; 3]]) -> bool {
        let mine = tag(self.bodies[k].id);
        found.iter().all(|&cell| {
            let there = self.owner[self.at(cell)];
            there == mine || there == OUTSIDE
        })
    }

    /// Notes where a body was looked at.
    fn keep(&mut self, k: usize, slack: f64) {
        let orientation = self.block(k).map_or([0.0; 4], |block| block.quaternion);
        let rigid = &self.motion[k];
        let body = &mut self.bodies[k];
        body.centre = rigid.position;
        body.radius = rigid.radius;
        body.orientation = orientation;
        body.slack = slack;
    }

    fn set(&mut self, k: usize) {
        let mine = tag(self.bodies[k].id);
        self.found.resize_with(self.found.len().max(1), Vec::new);
        let mut found = std::mem::take(&mut self.found[0]);
        let slack = self.look(k, &mut found);
        let mut shares = false;
        for &cell in &found {
            let position = self.at(cell);
            let there = self.owner[position];
            if there == OUTSIDE {
                continue;
            }
            if there != FLUID && there != mine {
                shares = true;
                if let Some(others) = self.entries.get(&there) {
                    for &other in others {
                        self.bodies[other as usize].shares = true;
                    }
                }
                if there < mine {
                    continue;
                }
            }
            self.note(cell, position);
            self.owner[position] = mine;
        }
        // All of them, also those of a body of lower id or outside: the cells of the same shape are the same list.
        self.bodies[k].cells.clear();
        self.bodies[k].cells.extend_from_slice(&found);
        self.found[0] = found;
        self.bodies[k].shares |= shares;
        self.keep(k, slack);
    }

    /// Loads from covered and uncovered cells, and new links for every body near a change.
    fn settle<S: Stored>(&mut self, populations: &Populations<S>, loads: Option<&mut [Load]>) {
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

    fn flag(&mut self, owner: u32) {
        if owner != FLUID
            && owner != OUTSIDE
            && let Some(entries) = self.entries.get(&owner)
        {
            for &k in entries {
                self.relink[k as usize] = true;
            }
        }
    }

    /// The image of a body nearest to a cell, with its frame.
    fn nearest(&self, owner: u32, cell: [i32; 3]) -> Option<(usize, [i32; 3])> {
        let entries = self.entries.get(&owner)?;
        entries
            .iter()
            .map(|&k| {
                let k = k as usize;
                let frame = self.frame(self.bodies[k].shift);
                let d2: f64 = (0..self.dimension)
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
    fn link<S: Stored>(&self, k: usize, populations: &Populations<S>, links: &mut Vec<BodyLink>) {
        let mine = tag(self.bodies[k].id);
        let frame = self.frame(self.bodies[k].shift);
        links.clear();
        let velocities = populations.velocities();
        for &inner in &self.bodies[k].cells {
            if self.owner[self.at(inner)] != mine {
                continue;
            }
            for out in 1..velocities.q() {
                let c = velocities.c[out].map(i32::from);
                let outer: [i32; 3] = std::array::from_fn(|a| inner[a] + c[a]);
                if !self.held(outer) {
                    continue;
                }
                let there = self.owner[self.at(outer)];
                let between = there != FLUID;
                // A link between two bodies is the business of the one with the lower id.
                if there == mine || there == OUTSIDE || (between && there < mine) {
                    continue;
                }
                let mine_to_do = self.interior(outer);
                if !mine_to_do && !self.interior(inner) {
                    continue;
                }
                let i = velocities.opposite[out];
                let behind: [i32; 3] = std::array::from_fn(|a| outer[a] + c[a]);
                let backed = self.held(behind) && self.owner[self.at(behind)] == FLUID;
                let moves = match self.rules.isolated {
                    None => true,
                    Some(limit) => self.solid_neighbours(outer, populations) < limit,
                };
                links.push(BodyLink {
                    link: populations.link(populations.cell(outer.map(|v| v as isize)), i),
                    middle: std::array::from_fn(|a| {
                        if a < self.dimension {
                            2 * (outer[a] - frame[a]) + 1 - c[a]
                        } else {
                            0
                        }
                    }),
                    direction: u8::try_from(i).unwrap_or(0),
                    loads: mine_to_do && !between,
                    moves,
                    backed,
                });
            }
        }
    }

    /// Whether bodies, and walls beside them, hold more than half of the neighbours of a cell of the slab (local coordinates).
    #[must_use]
    pub fn encloses<S: Stored>(&self, cell: [usize; 3], populations: &Populations<S>) -> bool {
        let velocities = populations.velocities();
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        let (mut bodies, mut walls) = (0, 0);
        for c in &velocities.c[1..] {
            let near: [i32; 3] = std::array::from_fn(|a| cell[a] + i32::from(c[a]));
            match self.owner[self.at(near)] {
                FLUID => {}
                OUTSIDE => walls += 1,
                _ => bodies += 1,
            }
        }
        bodies > 0 && 2 * (bodies + walls) > velocities.q() - 1
    }

    fn solid_neighbours<S: Stored>(&self, cell: [i32; 3], populations: &Populations<S>) -> usize {
        let velocities = populations.velocities();
        (1..velocities.q())
            .filter(|&i| {
                let near: [i32; 3] =
                    std::array::from_fn(|a| cell[a] + i32::from(velocities.c[i][a]));
                self.owner[self.at(near)] != FLUID
            })
            .count()
    }
}
