//! The solid fraction of every cell that a body covers, updated where bodies moved.
//!
//! A body that has not moved since the last update costs one comparison. A body that has moved is processed row by row. The cells inside
//! follow from where the row enters and leaves the body. Only the cells at its surface are measured ([`super::solid_fraction`]), and only
//! cells with a changed fraction are passed to the lattice ([`crate::lbm::saturation::Cover`]). The cover is a function of the positions
//! alone: it is the same after a restart and on any number of ranks, because the geometry is computed in the frame of a body's raw position.
//! A slab holds its own cells and the ghost cells around them, because the populations that leave a full cell depend on the cover of the next one.

use super::body_map::Grid;
use super::solid_fraction::{Form, Method, Scratch, faces};
use crate::dem::particles::Particles;
use crate::dem::space::{Components, Space};
use crate::lbm::lanes::Stored;
use crate::lbm::links::{Plane, Rigid};
use crate::lbm::populations::Populations;
use crate::lbm::saturation::{Cover, DEEP, Solid};
use crate::number::{floor_i32, single, to_i32, to_u32};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Who is mapped: id, and which image.
type Name = (u64, [i32; 3]);

/// A covered cell: its position in the lattice, and how much of it; of a ghost cell the negative.
type Cell = (u32, f32);

/// One body, or one image of a body, near this slab.
#[derive(Debug, Default)]
struct Mapped {
    name: Name,
    slot: u32,
    /// What it was mapped as; none before the first time.
    at: Option<Pose>,
    /// Its cells by rising position.
    cells: Vec<Cell>,
    next: Vec<Cell>,
    /// Faces of a polyhedron; none of a disc or sphere.
    planes: Vec<Plane>,
    moved: bool,
}

impl Mapped {
    fn form(&self, pose: &Pose, dimension: usize) -> Form<'_> {
        let Pose { centre, radius, .. } = *pose;
        if !self.planes.is_empty() {
            Form::Block {
                planes: &self.planes,
                centre,
                radius,
            }
        } else if dimension == 2 {
            Form::Disc { centre, radius }
        } else {
            Form::Ball { centre, radius }
        }
    }
}

/// Where a body stands, in cells, and how large it is.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pose {
    centre: [f64; 3],
    radius: f64,
    /// Quaternion of a polyhedron.
    orientation: [f64; 4],
}

/// The lattice as rows of cells.
#[derive(Clone, Copy, Debug)]
struct Rows {
    cells: [i32; 3],
    strides: [usize; 3],
    origin: usize,
    /// Axes from slowest to fastest.
    order: [usize; 3],
}

/// The map of one slab.
#[derive(Debug)]
pub struct CoverMap {
    grid: Grid,
    method: Method,
    rows: Rows,
    dimension: usize,
    bodies: Vec<Mapped>,
    unused: Vec<u32>,
    slots: u32,
    /// Entry of the particles in each slot.
    entries: Vec<u32>,
    /// Cells of structures, by position: bodies do not cover them. Empty where there are none.
    closed: Vec<bool>,
}
fn whole(n: i32) -> usize {
    usize::try_from(n).unwrap_or(0)
}
impl CoverMap {
    /// No bodies over the slab of `populations`.
    pub fn new<S: Stored>(populations: &Populations<S>, grid: Grid, method: Method) -> Self {
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
            },
            dimension: populations.velocities().dimension,
            bodies: Vec::new(),
            unused: Vec::new(),
            slots: 0,
            entries: Vec::new(),
            closed: Vec::new(),
        }
    }

    /// Keeps bodies out of the cells of structures, given by position, before any body is mapped.
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

    /// Entry of the particles that a slot stands for.
    #[must_use]
    pub fn entry(&self, slot: u32) -> Option<usize> {
        self.entries.get(slot as usize).map(|&entry| entry as usize)
    }

    /// Positions of the cells and ghost cells that bodies fill in part or whole, those deep inside left out.
    pub fn surface_cells(&self) -> impl Iterator<Item = usize> {
        let cells = self.bodies.iter().flat_map(|body| &body.cells);
        cells
            .filter(|(_, part)| (0.0..DEEP).contains(&part.abs()))
            .map(|(position, _)| *position as usize)
    }

    /// Takes over where the bodies are and how they move. `velocity` and `spin` convert to lattice units.
    pub fn update_bodies<Sp: Space>(
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
            self.adopt(particles, cover);
        }
        for (k, body) in self.bodies.iter_mut().enumerate() {
            let motion = rigid(particles, k, &self.grid, velocity, spin);
            let block = particles.polyhedron(k);
            let pose = Pose {
                centre: motion.position,
                radius: motion.radius,
                orientation: block.map_or([0.0; 4], |(_, state)| state.orientation.coords.into()),
            };
            body.moved = body.at != Some(pose);
            body.at = Some(pose);
            if let (true, Some((shape, state))) = (body.moved, block) {
                let rotation = state.matrix();
                let spacing = self.grid.spacing;
                faces(shape, &rotation, pose.centre, spacing, &mut body.planes);
            }
            let frame = frame(&self.grid, self.dimension, body.name.1);
            cover.set(
                body.slot,
                Solid {
                    name: body.name,
                    motion,
                    frame,
                },
            );
        }
        let (grid, rows, method, dimension) = (&self.grid, self.rows, self.method, self.dimension);
        let closed = &self.closed;
        let look = |scratch: &mut Scratch, body: &mut Mapped| {
            if let (true, Some(pose)) = (body.moved, body.at) {
                let frame = frame(grid, dimension, body.name.1);
                let mut next = std::mem::take(&mut body.next);
                let form = body.form(&pose, dimension);
                rows.walk(&form, frame, dimension, method, scratch, &mut next);
                if !closed.is_empty() {
                    next.retain(|(position, _)| !closed[*position as usize]);
                }
                body.next = next;
            }
        };
        if rayon::current_num_threads() > 1 && self.bodies.len() > 16 {
            self.bodies
                .par_iter_mut()
                .with_min_len(8)
                .for_each_init(Scratch::default, look);
        } else {
            let mut scratch = Scratch::default();
            for body in &mut self.bodies {
                look(&mut scratch, body);
            }
        }
        for body in self.bodies.iter_mut().filter(|body| body.moved) {
            tell(cover, body.slot, &body.cells, &body.next);
            std::mem::swap(&mut body.cells, &mut body.next);
        }
    }

    /// Gives each entry of the particles the map of the same body and image, and takes out those that went away.
    fn adopt<Sp: Space>(&mut self, particles: &Particles<Sp>, cover: &mut Cover) {
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
        for gone in old.into_values() {
            tell(cover, gone.slot, &gone.cells, &[]);
            self.unused.push(gone.slot);
        }
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

/// Motion of an entry in lattice units, its position raw.
pub fn rigid<Sp: Space>(
    particles: &Particles<Sp>,
    k: usize,
    grid: &Grid,
    velocity: f64,
    spin: f64,
) -> Rigid {
    let motion = &particles.motion[k];
    let mut rigid = Rigid {
        radius: particles.body[k].radius / grid.spacing,
        ..Rigid::default()
    };
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

/// Distance in cells from the raw frame of a body to the local cells of the slab, for its image.
fn frame(grid: &Grid, dimension: usize, shift: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|a| {
        if a < dimension {
            shift[a] * to_i32(grid.cells[a]) - to_i32(grid.start[a])
        } else {
            0
        }
    })
}

impl Rows {
    /// Lists the cells of the slab and its ghost cells that a body fills, by rising position.
    fn walk(
        &self,
        form: &Form<'_>,
        frame: [i32; 3],
        dimension: usize,
        method: Method,
        scratch: &mut Scratch,
        found: &mut Vec<Cell>,
    ) {
        found.clear();
        if self.cells.contains(&0) {
            return;
        }
        let (centre, radius) = form.bounds();
        let (mut low, mut high) = ([0; 3], [0; 3]);
        for a in 0..3 {
            if a < dimension {
                low[a] = (floor_i32(centre[a] - radius) - 1 + frame[a]).max(-1);
                high[a] = (floor_i32(centre[a] + radius) + 2 + frame[a]).min(self.cells[a] + 1);
            } else {
                high[a] = 1;
            }
        }
        if (0..3).any(|a| low[a] >= high[a]) {
            return;
        }
        // Of a ball all cells of its box at once.
        let ball = match (form, method) {
            (Form::Ball { centre, radius }, Method::Exact) => {
                let cells = std::array::from_fn(|a| whole(high[a] - low[a]));
                let first = std::array::from_fn(|a| low[a] - frame[a]);
                let order = self.order;
                scratch.ball.fill(*centre, *radius, first, cells, order);
                true
            }
            _ => false,
        };
        let [slow, middle, fast] = self.order;
        let mut cell = [0; 3];
        for i in low[slow]..high[slow] {
            cell[slow] = i;
            if ball {
                scratch.ball.layer(whole(i - low[slow]));
            }
            for j in low[middle]..high[middle] {
                cell[middle] = j;
                cell[fast] = 0;
                let lower = corner(cell, frame);
                let row = form.row(fast, lower);
                if row.misses() {
                    continue;
                }
                let first = (floor_i32(row.outer[0]) + frame[fast]).max(low[fast]);
                let last = (floor_i32(row.outer[1]) + 1 + frame[fast]).min(high[fast]);
                let beyond =
                    !(0..self.cells[slow]).contains(&i) || !(0..self.cells[middle]).contains(&j);
                let start = self
                    .origin
                    .wrapping_add_signed(self.strides[slow].cast_signed() * i as isize)
                    .wrapping_add_signed(self.strides[middle].cast_signed() * j as isize);
                let mut tell = |k: i32, fraction: f32| {
                    let position = to_u32(start.wrapping_add_signed(k as isize));
                    let ghost = beyond || !(0..self.cells[fast]).contains(&k);
                    found.push((position, if ghost { -fraction } else { fraction }));
                };
                let last = last.max(first);
                let full = within(&(first..last), row.inner, 0, frame[fast]);
                let deep = within(&full, row.deep, 1, frame[fast]);
                // Cells at the surface before those inside and behind them.
                for (part, cells) in [first..full.start, full.end..last].into_iter().enumerate() {
                    if part == 1 {
                        (full.start..deep.start).for_each(|k| tell(k, 1.0));
                        deep.clone().for_each(|k| tell(k, DEEP));
                        (deep.end..full.end).for_each(|k| tell(k, 1.0));
                    }
                    if cells.is_empty() {
                        continue;
                    }
                    if ball {
                        let range = whole(cells.start - low[fast])..whole(cells.end - low[fast]);
                        let Scratch {
                            ball, fractions, ..
                        } = scratch;
                        ball.row(whole(j - low[middle]), range, fractions);
                        for (k, &fraction) in cells.zip(&*fractions) {
                            if single(fraction) > 0.0 {
                                tell(k, single(fraction));
                            }
                        }
                    } else {
                        for k in cells {
                            cell[fast] = k;
                            let fraction =
                                single(form.fraction(method, corner(cell, frame), scratch));
                            if fraction > 0.0 {
                                tell(k, fraction);
                            }
                        }
                    }
                }
            }
        }
    }
}
/// Cells of `range` that lie, with this many cells on each side, within an interval in the raw frame; empty ranges stay in `range` too.
fn within(range: &Range<i32>, [low, high]: [f64; 2], beside: i32, frame: i32) -> Range<i32> {
    let start = floor_i32(low.ceil()) + beside + frame;
    let end = floor_i32(high) - beside + frame;
    let start = start.clamp(range.start, range.end);
    start..end.clamp(start, range.end)
}

/// Lower corner of a local cell in the raw frame.
fn corner(cell: [i32; 3], frame: [i32; 3]) -> [f64; 3] {
    std::array::from_fn(|a| f64::from(cell[a] - frame[a]))
}

/// Passes the differences between two lists, sorted by position, to the lattice.
fn tell(cover: &mut Cover, slot: u32, old: &[Cell], new: &[Cell]) {
    let (mut i, mut j) = (0, 0);
    loop {
        match (old.get(i), new.get(j)) {
            (Some(a), Some(b)) if a.0 == b.0 => {
                if a.1.to_bits() != b.1.to_bits() {
                    cover.cover(b.0 as usize, slot, b.1);
                }
                i += 1;
                j += 1;
            }
            (Some(a), b) if b.is_none_or(|b| a.0 < b.0) => {
                cover.cover(a.0 as usize, slot, 0.0);
                i += 1;
            }
            (_, Some(b)) => {
                cover.cover(b.0 as usize, slot, b.1);
                j += 1;
            }
            (_, None) => return,
        }
    }
}

#[cfg(test)]
mod tests;
