//! The body that contains each cell near a slab.

use super::{BodyMap, FLUID, GHOSTS, Look, Mapped, OUTSIDE, tag, threads};
use crate::coupling::solid_fraction::Form;
use crate::dem::particles::Particles;
use crate::dem::space::Space;
use crate::lbm::links::{BodyLink, Plane};
use crate::thread_pool;
use std::collections::HashMap;

#[expect(
    clippy::cast_possible_truncation,
    reason = "coordinates are far below 2^31"
)]
fn floor(x: f64) -> i32 {
    x.floor() as i32
}

impl BodyMap {
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
    pub(super) fn look_again(&mut self) {
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
    pub(super) fn adopt<Sp: Space>(&mut self, particles: &Particles<Sp>) {
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

    pub(super) fn clear(&mut self, k: usize) {
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
    pub(super) fn frame(&self, shift: [i32; 3]) -> [i32; 3] {
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

    pub(super) fn set(&mut self, k: usize) {
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
}
