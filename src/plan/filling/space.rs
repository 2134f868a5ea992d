//! Space that water from inlets can reach: cells outside structures and fixed solids, connected by links. Cells
//! between which a wall thinner than a cell stands count as connected, and solids that move as space, so that it is
//! not smaller than that of a run.

use crate::scene::Scene;
use crate::scene::blocked::{self, Obstacles, WaterParts};
use crate::scene::bodies::Mobility;
use crate::scene::boundaries::ScenePatch;
use crate::scene::flow::{BodyForce, Flow};
use crate::scene::free_surface::FreeSurface;
use base::number::{real, whole};
use dem::polyhedron::PlacedPolyhedron;
use std::collections::BTreeSet;
use std::f64::consts::PI;

/// Number of levels at which the volume below is known where gravity is inclined.
const LEVELS: usize = 256;

/// Space for water.
pub(super) struct Space<'a> {
    scene: &'a Scene,
    flow: &'a Flow,
    surface: &'a FreeSurface,
    /// Connected part of the water of each cell; none with too many cells.
    parts: Option<WaterParts>,
    /// Parts that water reaches; all before the inlets are known.
    reached: Option<BTreeSet<u32>>,
    /// Volume of the space [m³, in 2-D m²].
    pub(super) capacity: f64,
    /// Water in it at the start, at least.
    pub(super) water: f64,
    /// Area of its cells below the lid [m², in 2-D m].
    pub(super) lid: f64,
    /// Lowest and highest potential of the space [m²/s²], and the volume below equally spaced potentials between
    /// them.
    potentials: [f64; 2],
    below: Vec<f64>,
}

impl<'a> Space<'a> {
    /// Returns the whole space for water of a scene.
    pub(super) fn new(scene: &'a Scene, flow: &'a Flow, surface: &'a FreeSurface) -> Self {
        let solids = Obstacles {
            structures: &scene.structures,
            bodies: &scene.bodies,
            blocks: scene.blocks.as_ref(),
        };
        Self {
            scene,
            flow,
            surface,
            parts: WaterParts::new(flow, &scene.grid, &solids),
            reached: None,
            capacity: 0.0,
            water: 0.0,
            lid: 0.0,
            potentials: [0.0; 2],
            below: Vec::new(),
        }
    }

    /// Returns `true` if the space is known cell by cell.
    pub(super) fn is_exact(&self) -> bool {
        self.parts.is_some()
    }

    /// Returns the force on the water per mass along each axis, and `true` if it is constant [m/s²].
    pub(super) fn pull(scene: &Scene, flow: &Flow) -> ([f64; 3], bool) {
        let force = flow.body_force.largest();
        let is_constant = matches!(flow.body_force, BodyForce::Constant(_));
        let constant = is_constant || force.iter().all(|f| f.abs() <= 0.0);
        let pull = std::array::from_fn(|a| {
            let acts = if flow.gravity_acts[a] {
                scene.gravity[a]
            } else {
                0.0
            };
            acts + force[a] / flow.density
        });
        (pull, constant)
    }

    /// Returns the potential of a point [m²/s²].
    pub(super) fn potential(&self, at: [f64; 3]) -> f64 {
        let (pull, _) = Self::pull(self.scene, self.flow);
        let axes = 0..self.scene.grid.dimension;
        -axes.map(|a| pull[a] * at[a]).sum::<f64>()
    }

    /// Returns the cells at the face of a patch that belong to no later patch.
    fn own_cells(&self, patch: &ScenePatch) -> Vec<[usize; 3]> {
        let patches = &self.flow.faces[patch.face.index()];
        let own = patches
            .iter()
            .position(|one| std::ptr::eq(one, patch))
            .unwrap_or(0);
        let holds = |one: &ScenePatch, cell: &[usize; 3]| {
            let mut across = (0..3).filter(|a| *a != patch.face.axis());
            across.all(|a| (one.from[a]..one.to[a]).contains(&cell[a]))
        };
        let mut cells = blocked::face_cells(&self.scene.grid, patch.face);
        cells.retain(|cell| {
            holds(patch, cell) && !patches[own + 1..].iter().any(|one| holds(one, cell))
        });
        cells
    }

    /// Returns the cells of a patch in the space.
    pub(super) fn cells_inside(&self, patch: &ScenePatch) -> Vec<[usize; 3]> {
        let mut cells = self.own_cells(patch);
        cells.retain(|cell| self.holds(*cell));
        cells
    }

    /// Returns `true` if the cells of a patch are all those of the space at its face.
    pub(super) fn is_whole(&self, patch: &ScenePatch) -> bool {
        let mut all = blocked::face_cells(&self.scene.grid, patch.face);
        all.retain(|cell| self.holds(*cell));
        all.len() == self.cells_inside(patch).len()
    }

    /// Returns `true` if a cell is in the space.
    fn holds(&self, cell: [usize; 3]) -> bool {
        let Some(parts) = &self.parts else {
            return true;
        };
        let part = parts.part(&self.scene.grid, cell);
        part.is_some_and(|part| {
            self.reached
                .as_ref()
                .is_none_or(|reached| reached.contains(&part))
        })
    }

    /// Returns the space that water from these inlets reaches, with its volume and its water.
    pub(super) fn filled_by(mut self, inlets: &[&ScenePatch]) -> Self {
        let grid = &self.scene.grid;
        let volume = grid.spacing.powi(if grid.dimension == 3 { 3 } else { 2 });
        let Some(parts) = &self.parts else {
            let stops = || self.scene.structures.iter().filter(|one| one.stops.water());
            let is_solid = |at: [f64; 3]| stops().any(|one| one.solid.distance(at) < 0.0);
            self.capacity = self.surface.cells_empty(grid.cells, is_solid) * volume;
            return self;
        };
        let cells = inlets.iter().flat_map(|patch| self.own_cells(patch));
        let reached = cells.filter_map(|cell| parts.part(grid, cell)).collect();
        self.reached = Some(reached);
        self.measure(volume);
        self.water = (self.water - self.moving_in_water()).max(0.0);
        self
    }

    /// Sums the cells of the space, each of a volume.
    fn measure(&mut self, volume: f64) {
        let grid = &self.scene.grid;
        let (pull, _) = Self::pull(self.scene, self.flow);
        let half = 0.5 * grid.spacing * pull.iter().map(|g| g.abs()).sum::<f64>();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut cells = Vec::new();
        let up = self.surface.axis;
        let top = if self.surface.rises {
            grid.cells[up] - 1
        } else {
            0
        };
        for z in 0..grid.cells[2] {
            for y in 0..grid.cells[1] {
                for x in 0..grid.cells[0] {
                    let cell = [x, y, z];
                    if !self.holds(cell) {
                        continue;
                    }
                    let potential = self.potential(grid.centre(cell));
                    (low, high) = (low.min(potential - half), high.max(potential + half));
                    cells.push(potential);
                    self.water += self.surface.fill(cell) * volume;
                    self.lid += if cell[up] == top {
                        volume / grid.spacing
                    } else {
                        0.0
                    };
                }
            }
        }
        self.capacity = real(cells.len()) * volume;
        let along = (0..3).filter(|a| pull[*a] != 0.0).count() == 1;
        let levels = if along { grid.cells[up] } else { LEVELS };
        let mut below = vec![0.0; levels + 1];
        for potential in cells {
            let part = (potential - low) / (high - low).max(f64::MIN_POSITIVE);
            below[whole(part * real(levels)).min(levels - 1) + 1] += volume;
        }
        for n in 0..levels {
            below[n + 1] += below[n];
        }
        (self.potentials, self.below) = ([low, high], below);
    }

    /// Returns the potential of the surface of a level pool of a volume [m²/s²].
    pub(super) fn energy_of(&self, volume: f64) -> f64 {
        let [low, high] = self.potentials;
        let levels = self.below.len().saturating_sub(1);
        let n = self
            .below
            .partition_point(|below| *below < volume)
            .clamp(1, levels.max(1));
        let (Some(below), Some(above)) = (self.below.get(n - 1), self.below.get(n)) else {
            return low;
        };
        let part = ((volume - below) / (above - below).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        low + (real(n - 1) + part) / real(levels) * (high - low)
    }

    /// Returns the volume of the solids that may leave the water of the start.
    fn moving_in_water(&self) -> f64 {
        let scene = self.scene;
        let up = self.surface.axis;
        let meets = |centre: [f64; 3], radius: f64| {
            let mut lowest = centre;
            lowest[up] += if self.surface.rises { -radius } else { radius };
            lowest[up] = lowest[up].clamp(0.0, scene.grid.size[up]);
            self.surface.depth(centre) > 0.0 || self.surface.depth(lowest) > 0.0
        };
        let ball = |radius: f64| {
            if scene.grid.dimension == 3 {
                4.0 / 3.0 * PI * radius.powi(3)
            } else {
                PI * radius * radius
            }
        };
        let size = |solid: Option<&PlacedPolyhedron>, radius: f64| {
            solid.map_or_else(|| ball(radius), |solid| solid.shape.volume())
        };
        let bodies = scene
            .bodies
            .iter()
            .filter(|body| body.mobility != Mobility::Fixed);
        let bodies = bodies.filter(|body| meets(body.position, body.radius));
        let bodies = bodies.map(|body| size(body.solid.as_ref(), body.radius));
        let blocks = scene.blocks.iter().flat_map(|blocks| &blocks.list);
        let blocks = blocks.filter(|block| {
            !block.fixed && meets(block.solid.position.into(), block.solid.shape.radius())
        });
        bodies.sum::<f64>() + blocks.map(|block| block.solid.shape.volume()).sum::<f64>()
    }
}
