//! Solid fraction of every cell covered by a body, updated when bodies move.
//!
//! A body that has not moved since the last update costs one comparison. A body that has moved is processed row by row.
//! The inner cells follow from the intersection of the row with the body. Only the cells at its surface are
//! measured ([`super::solid_fraction`]), and only cells with a changed fraction are passed to the lattice
//! ([`lbm::saturation::Cover`]). The cover is a function of the positions alone: it is the same after a restart and
//! on any number of ranks, because the geometry is computed in the frame of a body's raw position. A slab holds its
//! own cells and the ghost cells around them, because the populations that leave a full cell depend on the cover of
//! the next one.

mod alone;
mod runs;

use self::alone::{Alone, Sphere};
use self::runs::{Rows, Runs, Walk};
use super::body_map::{MapGrid, in_cells};
use super::solid_fraction::{Form, FractionMethod, PolyhedronSurface, Scratch};
use base::number::{floor_i32, real, to_i32, to_u32};
use base::thread_pool;
use dem::particles::Particles;
use dem::space::{Components, Space};
use lbm::lanes::{Level, Stored};
use lbm::links::Rigid;
use lbm::populations::Populations;
use lbm::saturation::{Cover, CoveringBody, DEEP};
use std::collections::HashMap;
use std::ops::Range;

/// Id of a body, and its periodic image.
type Name = (u64, [i32; 3]);

/// Body, or periodic image of a body, near this slab.
#[derive(Debug, Default)]
struct Mapped {
    name: Name,
    slot: u32,
    /// Pose at the time of mapping; none before the first mapping.
    at: Option<Pose>,
    /// Cells of the body at the last update; then buffer for the cells at the next update.
    cells: Runs,
    next: Runs,
    /// Surface of a polyhedron; without faces for a disc or sphere.
    surface: PolyhedronSurface,
    /// `true` if the body has moved since its cells were marked.
    moved: bool,
}

impl Mapped {
    fn is_block(&self) -> bool {
        !self.surface.planes().is_empty()
    }

    fn form(&self, pose: &Pose, dimension: usize) -> Form<'_> {
        let Pose { centre, radius, .. } = *pose;
        if self.is_block() {
            Form::Block {
                surface: &self.surface,
                centre,
                radius,
            }
        } else if dimension == 2 {
            Form::Disc { centre, radius }
        } else {
            Form::Ball { centre, radius }
        }
    }

    /// Returns the planes of the slab that the body may cover, divided into at most `most` pieces. A ball is not
    /// divided, because all its cells share tables.
    fn cut(&self, rows: &Rows, frame: [i32; 3], most: usize) -> Vec<Range<i32>> {
        /// Minimum number of planes per piece.
        const MIN_PLANES: i32 = 2;
        let slow = rows.order[0];
        let all = -1..rows.cells[slow] + 1;
        let Some(pose) = self.at.filter(|_| self.is_block()) else {
            return vec![all];
        };
        let (low, high) = (
            floor_i32(pose.centre[slow] - pose.radius) + frame[slow],
            floor_i32(pose.centre[slow] + pose.radius) + frame[slow] + 1,
        );
        let (low, high) = (low.max(all.start), high.min(all.end));
        let count = to_i32(most).min((high - low) / MIN_PLANES).max(1);
        let cut = |k: i32| low + (high - low) * k / count;
        (0..count).map(|k| cut(k)..cut(k + 1)).collect()
    }
}

/// Position and radius of a body, in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pose {
    centre: [f64; 3],
    radius: f64,
    /// Quaternion of a polyhedron.
    orientation: [f64; 4],
}

/// Map of one slab.
#[derive(Debug)]
pub struct CoverMap {
    grid: MapGrid,
    method: FractionMethod,
    rows: Rows,
    dimension: usize,
    bodies: Vec<Mapped>,
    unused: Vec<u32>,
    slots: u32,
    /// Entry of the particles in each slot.
    entries: Vec<u32>,
    alone: Alone,
    /// `true` for cells of structures, by position: bodies do not cover these. Empty without structures.
    closed: Vec<bool>,
    /// `true` if bodies have moved since their cells were marked.
    outdated: bool,
    /// Buffers, reused between updates.
    pieces: Vec<Piece>,
    scratch: Vec<Scratch>,
}

/// Maximum number of bodies that are divided among threads by planes; larger numbers are distributed as whole bodies.
const FEW: usize = 16;

/// Planes of a body that one thread maps, and the cells covered in them.
#[derive(Debug, Default)]
struct Piece {
    body: usize,
    planes: Range<i32>,
    found: Runs,
}

impl CoverMap {
    /// Returns a map without bodies over the slab of `populations`. `sums` are the axes along which the volumes of
    /// polyhedra are summed, from slowest to fastest, a function of the domain alone.
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        grid: MapGrid,
        method: FractionMethod,
        sums: [usize; 3],
    ) -> Self {
        let origin = populations.cell([0; 3]);
        let stride = |axis: usize| {
            let mut at = [0; 3];
            at[axis] = 1;
            populations.cell(at) - origin
        };
        Self {
            grid,
            method,
            rows: Rows {
                cells: populations.cells().map(to_i32),
                strides: [stride(0), stride(1), stride(2)],
                origin,
                order: populations.order(),
                sums,
                level: Level::best(),
                dimension: populations.velocities().dimension,
            },
            dimension: populations.velocities().dimension,
            bodies: Vec::new(),
            unused: Vec::new(),
            slots: 0,
            entries: Vec::new(),
            alone: Alone::default(),
            closed: Vec::new(),
            outdated: false,
            pieces: Vec::new(),
            scratch: Vec::new(),
        }
    }

    /// Excludes bodies from the cells of structures, given by position. Must be called before any body is mapped.
    pub fn close<S: Stored>(
        &mut self,
        cells: impl Iterator<Item = usize>,
        populations: &Populations<S>,
    ) {
        self.closed = vec![false; populations.cell_positions()];
        for cell in cells {
            self.closed[cell] = true;
        }
    }

    /// Returns the entry of the particles in a slot.
    #[must_use]
    pub fn entry(&self, slot: u32) -> Option<usize> {
        self.entries.get(slot as usize).map(|&entry| entry as usize)
    }

    /// Returns the positions of the cells and ghost cells that bodies fill in part or completely, except those deep
    /// inside: the part of them that belongs to one thread.
    pub fn surface_cells(&self, thread: usize, threads: usize) -> impl Iterator<Item = usize> {
        let share = move |body| Runs::cells_of_thread(body, thread, threads);
        let cells = self.bodies.iter().flat_map(move |body| share(&body.cells));
        cells
            .filter(|(_, part)| *part != 0.0 && part.abs() < DEEP)
            .map(|(position, _)| position)
    }

    /// Returns the positions of all cells and ghost cells that bodies fill in part or completely. Cells of several
    /// bodies occur several times.
    pub fn filled_cells(&self) -> impl Iterator<Item = usize> {
        let cells = self
            .bodies
            .iter()
            .flat_map(|body| body.cells.cells_of_thread(0, 1));
        cells
            .filter(|(_, part)| *part != 0.0)
            .map(|(position, _)| position)
    }

    /// Copies the poses and motions of the bodies. `velocity` and `spin` convert to lattice units.
    /// [`Self::cover_cells`] then updates the cells.
    pub fn place_bodies<Sp: Space>(
        &mut self,
        particles: &Particles<Sp>,
        cover: &mut Cover,
        velocity: f64,
        spin: f64,
    ) {
        let same = self.bodies.len() == particles.len()
            && self
                .bodies
                .iter()
                .zip(particles.body.iter().zip(&particles.shift))
                .all(|(old, (body, shift))| old.name == (body.id, *shift));
        if !same {
            self.assign_maps(particles, cover);
        }
        let spheres = (0..self.bodies.len()).map(|k| sphere(particles, k, &self.grid));
        self.alone
            .update(spheres, &self.grid, self.method, self.dimension);
        let mut balls =
            self.dimension == 3 && self.method == FractionMethod::Exact && self.closed.is_empty();
        for (k, body) in self.bodies.iter_mut().enumerate() {
            let motion = rigid(particles, k, &self.grid, velocity, spin);
            let block = particles.polyhedron(k);
            let pose = Pose {
                centre: motion.position,
                radius: motion.radius,
                orientation: block.map_or([0.0; 4], |(_, state)| state.orientation.coords.into()),
            };
            balls &= block.is_none();
            body.moved |= body.at != Some(pose);
            self.outdated |= body.moved;
            body.at = Some(pose);
            if let (true, Some((shape, state))) = (body.moved, block) {
                let rotation = state.matrix();
                let spacing = self.grid.spacing;
                body.surface
                    .set_pose(shape, &rotation, pose.centre, spacing);
            }
            let frame = self.grid.frame(self.dimension, body.name.1);
            cover.set(
                body.slot,
                CoveringBody {
                    name: body.name.into(),
                    motion,
                    frame,
                    alone: self.alone.is_separate(k),
                },
            );
        }
        cover.set_balls(balls);
    }

    /// Copies the poses of the bodies and covers the cells.
    #[cfg(test)]
    fn update_bodies<Sp: Space>(
        &mut self,
        particles: &Particles<Sp>,
        cover: &mut Cover,
        velocity: f64,
        spin: f64,
    ) {
        self.place_bodies(particles, cover, velocity, spin);
        self.cover_cells(cover);
    }

    /// Covers the cells at the present poses of the bodies, if bodies have moved since the last call.
    pub fn cover_cells(&mut self, cover: &mut Cover) {
        if !std::mem::take(&mut self.outdated) {
            return;
        }
        let (grid, rows, method, dimension) = (&self.grid, self.rows, self.method, self.dimension);
        let closed = &self.closed;
        let find = |scratch: &mut Scratch, body: &Mapped, planes: Range<i32>, found: &mut Runs| {
            if let (true, Some(pose)) = (body.moved, body.at) {
                let form = body.form(&pose, dimension);
                rows.level.run(Walk {
                    rows: &rows,
                    form: &form,
                    frame: grid.frame(dimension, body.name.1),
                    planes,
                    method,
                    scratch,
                    found,
                });
                if !closed.is_empty() {
                    found.leave_out(closed);
                }
            }
        };
        let all = -1..rows.cells[rows.order[0]] + 1;
        let find_all = |scratch: &mut Scratch, body: &mut Mapped| {
            let mut next = std::mem::take(&mut body.next);
            find(scratch, body, all.clone(), &mut next);
            body.next = next;
        };
        let threads = thread_pool::threads();
        let mut scratch = std::mem::take(&mut self.scratch);
        if threads == 1 {
            scratch.resize_with(1, Scratch::default);
            let mut part = cover.whole();
            for body in &mut self.bodies {
                find_all(&mut scratch[0], body);
                // Written at once, while the result is in the cache.
                if body.moved {
                    body.next.write_changes(&mut part, body.slot, &body.cells);
                }
            }
        } else {
            if self.bodies.len() > FEW {
                let bodies = &mut self.bodies;
                thread_pool::each_item_when_free(bodies, 8, &mut scratch, find_all);
            } else {
                // Each piece has some planes of a body.
                let mut pieces = std::mem::take(&mut self.pieces);
                let mut count = 0;
                for (k, body) in self.bodies.iter().enumerate().filter(|(_, b)| b.moved) {
                    for planes in body.cut(&rows, grid.frame(dimension, body.name.1), 2 * threads) {
                        if count == pieces.len() {
                            pieces.push(Piece::default());
                        }
                        (pieces[count].body, pieces[count].planes) = (k, planes);
                        count += 1;
                    }
                }
                let bodies = &self.bodies;
                let pieces_of_bodies = &mut pieces[..count];
                thread_pool::each_item_when_free(
                    pieces_of_bodies,
                    1,
                    &mut scratch,
                    |scratch, piece| {
                        let (body, planes) = (&bodies[piece.body], piece.planes.clone());
                        find(scratch, body, planes, &mut piece.found);
                    },
                );
                for body in self.bodies.iter_mut().filter(|body| body.moved) {
                    body.next.clear();
                }
                for piece in &pieces[..count] {
                    self.bodies[piece.body].next.append(&piece.found);
                }
                self.pieces = pieces;
            }
            let bodies = &self.bodies;
            cover.each_part(&self.cuts(), |part| {
                for body in bodies.iter().filter(|body| body.moved) {
                    body.next.write_changes(part, body.slot, &body.cells);
                }
            });
        }
        self.scratch = scratch;
        for body in self.bodies.iter_mut().filter(|body| body.moved) {
            std::mem::swap(&mut body.cells, &mut body.next);
            body.moved = false;
        }
    }

    /// Returns the planes at which to divide the slab, with its ghosts, among threads, so that each part has about
    /// the same surface area of bodies.
    fn cuts(&self) -> Vec<usize> {
        let slow = self.rows.order[0];
        let planes = self.rows.cells[slow] + 2;
        let mut surface = vec![0.0; usize::try_from(planes).unwrap_or(0)];
        let moved = self.bodies.iter().filter(|body| body.moved);
        for (body, pose) in moved.filter_map(|body| Some((body, body.at?))) {
            // Offset from the raw frame to the planes with their ghosts.
            let to = self.grid.frame(self.dimension, body.name.1)[slow] + 1;
            let plane = |x: f64| (floor_i32(x) + to).clamp(0, planes - 1);
            let (low, high) = (
                pose.centre[slow] - pose.radius,
                pose.centre[slow] + pose.radius,
            );
            for plane in plane(low)..=plane(high) {
                // The surface area of a ball between two adjacent planes is the same everywhere.
                surface[usize::try_from(plane).unwrap_or(0)] += pose.radius;
            }
        }
        let pieces = real(thread_pool::threads());
        let each = surface.iter().sum::<f64>() / pieces;
        let mut cuts = Vec::new();
        let mut sum = 0.0;
        for (plane, surface) in surface.iter().enumerate() {
            if sum >= each * real(cuts.len() + 1) && real(cuts.len() + 1) < pieces {
                cuts.push(plane * self.rows.strides[slow]);
            }
            sum += surface;
        }
        cuts
    }

    /// Assigns to each entry of the particles the map of the same body and image, and removes the cover of bodies
    /// that are gone.
    fn assign_maps<Sp: Space>(&mut self, particles: &Particles<Sp>, cover: &mut Cover) {
        let mut old: HashMap<Name, Mapped> = self
            .bodies
            .drain(..)
            .map(|body| (body.name, body))
            .collect();
        let mut fresh = Vec::new();
        for (body, shift) in particles.body.iter().zip(&particles.shift) {
            let name = (body.id, *shift);
            let known = old.remove(&name);
            if known.is_none() {
                fresh.push(self.bodies.len());
            }
            self.bodies.push(known.unwrap_or_else(|| Mapped {
                name,
                ..Mapped::default()
            }));
        }
        let gone: Vec<Mapped> = old.into_values().collect();
        let mut part = cover.whole();
        for gone in &gone {
            Runs::default().write_changes(&mut part, gone.slot, &gone.cells);
        }
        drop(part);
        for gone in &gone {
            cover.set(gone.slot, CoveringBody::default());
        }
        self.unused.extend(gone.iter().map(|gone| gone.slot));
        for k in fresh {
            self.bodies[k].slot = self.unused.pop().unwrap_or_else(|| {
                self.slots += 1;
                self.slots - 1
            });
        }
        cover.make_room(self.slots as usize);
        self.entries.clear();
        self.entries.resize(self.slots as usize, u32::MAX);
        for (k, body) in self.bodies.iter().enumerate() {
            self.entries[body.slot as usize] = to_u32(k);
        }
    }
}

/// Returns the bounding sphere of an entry at its image.
fn sphere<Sp: Space>(particles: &Particles<Sp>, k: usize, grid: &MapGrid) -> Sphere {
    let mut centre = [0.0; 3];
    for (a, x) in centre.iter_mut().enumerate().take(Sp::DIMENSION) {
        let raw = (particles.motion[k].position.get(a) - grid.origin[a]) / grid.spacing;
        *x = raw + f64::from(particles.shift[k][a]) * real(grid.cells[a]);
    }
    Sphere {
        centre,
        radius: particles.body[k].radius / grid.spacing,
    }
}

/// Returns the motion of an entry in lattice units, with its raw position.
pub fn rigid<Sp: Space>(
    particles: &Particles<Sp>,
    k: usize,
    grid: &MapGrid,
    velocity: f64,
    spin: f64,
) -> Rigid {
    Rigid {
        radius: particles.body[k].radius / grid.spacing,
        ..in_cells(&particles.motion[k], grid, velocity, spin)
    }
}

#[cfg(test)]
mod tests;
