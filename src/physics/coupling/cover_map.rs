//! The solid fraction of every cell that a body covers, updated where bodies moved.
//!
//! A body that has not moved since the last update costs one comparison. A body that has moved is processed row by row. The cells inside
//! follow from where the row enters and leaves the body. Only the cells at its surface are measured ([`super::solid_fraction`]), and only
//! cells with a changed fraction are passed to the lattice ([`crate::lbm::saturation::Cover`]). The cover is a function of the positions
//! alone: it is the same after a restart and on any number of ranks, because the geometry is computed in the frame of a body's raw position.
//! A slab holds its own cells and the ghost cells around them, because the populations that leave a full cell depend on the cover of the next one.

mod alone;
mod runs;

use self::alone::{Alone, Sphere};
use self::runs::{Rows, Runs, Walk};
use super::body_map::Grid;
use super::solid_fraction::{Form, Method, Scratch, faces};
use crate::dem::particles::Particles;
use crate::dem::space::{Components, Space};
use crate::lbm::lanes::{Level, Stored};
use crate::lbm::links::{Plane, Rigid};
use crate::lbm::populations::Populations;
use crate::lbm::saturation::{Cover, DEEP, Solid};
use crate::number::{real, to_i32, to_u32};
use rayon::prelude::*;
use std::collections::HashMap;

/// Who is mapped: id, and which image.
type Name = (u64, [i32; 3]);

/// One body, or one image of a body, near this slab.
#[derive(Debug, Default)]
struct Mapped {
    name: Name,
    slot: u32,
    /// What it was mapped as; none before the first time.
    at: Option<Pose>,
    /// Its cells, and those that it has from the next update on.
    cells: Runs,
    next: Runs,
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
    alone: Alone,
    /// Cells of structures, by position: bodies do not cover them. Empty where there are none.
    closed: Vec<bool>,
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
        let cells = self.bodies.iter().flat_map(|body| body.cells.cells());
        cells
            .filter(|(_, part)| *part != 0.0 && part.abs() < DEEP)
            .map(|(position, _)| position)
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
        let spheres = (0..self.bodies.len()).map(|k| sphere(particles, k, &self.grid));
        self.alone
            .update(spheres, &self.grid, self.method, self.dimension);
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
                    alone: self.alone.is(k),
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
                rows.level.run(Walk {
                    rows: &rows,
                    form: &form,
                    frame,
                    method,
                    scratch,
                    found: &mut next,
                });
                if !closed.is_empty() {
                    next.leave_out(closed);
                }
                body.next = next;
            }
        };
        let tell = |cover: &mut Cover, body: &mut Mapped| {
            if body.moved {
                body.next.tell(cover, body.slot, &body.cells);
                std::mem::swap(&mut body.cells, &mut body.next);
            }
        };
        if rayon::current_num_threads() > 1 && self.bodies.len() > 16 {
            self.bodies
                .par_iter_mut()
                .with_min_len(8)
                .for_each_init(Scratch::default, look);
            for body in &mut self.bodies {
                tell(cover, body);
            }
        } else {
            let mut scratch = Scratch::default();
            for body in &mut self.bodies {
                look(&mut scratch, body);
                tell(cover, body);
            }
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
            Runs::default().tell(cover, gone.slot, &gone.cells);
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

/// Bounding sphere of an entry, its image included.
fn sphere<Sp: Space>(particles: &Particles<Sp>, k: usize, grid: &Grid) -> Sphere {
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

#[cfg(test)]
mod tests;
