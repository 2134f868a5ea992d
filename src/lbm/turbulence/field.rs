//! Velocity field from which the eddy viscosity is computed.
//!
//! Ghost values at faces of the domain make the central difference second-order. With the wall at half a cell,
//! u_ghost = (8 u_wall - 6 u_1 + u_2)/3 gives the derivative of the parabola through u_wall, u_1 and u_2. At open
//! faces u_ghost = 2 u_1 - u_2 gives the one-sided difference. At planes of symmetry the ghost is the mirror image.
//! The surface of a structure between the first two cells replaces u_2, with its own velocity and place:
//! no flow is computed inside the structure, and the water behind a sheet is another flow
//! ([`Field::bound_ghosts`]). The field is stored in f32: its rounding is 1e-7 of the velocity and affects the eddy
//! viscosity, not the flow directly.
//!
//! Next to bodies in the lattice the derivative is that of the parabola through the velocity of the cell and the
//! velocities u_l, u_h on both sides: of surfaces at the distances l and h along the axis, or of a wet neighbour at
//! the distance 1:
//!
//! ```text
//! du/dx = [l² (u_h - u) + h² (u - u_l)] / [l h (l + h)]
//! ```
//!
//! Links with bounce-back have their surface at 1/2. A cell with a solid fraction ε of at least 1/2 has it at 3/2 -
//! ε, so that the difference passes continuously into the central one. The coupling sets surfaces and their
//! velocities after every motion ([`Field::wall`]). An index for each cell refers to its surfaces, and only cells
//! with an index leave the vectorised path.

use crate::block::{Line, RowBlock};
use crate::boundary::{Frame, Patch, SurfaceKind, patch_at};
use crate::error::FluidError;
use crate::lanes::{Lanes, Memory, Stored, WIDEST, prefetch};
use crate::lattice::unroll;
use crate::pages::Pages;
use crate::populations::Populations;
use base::number::{real, single, to_u32};
use base::thread_pool;
use decomposition::{Domain, HaloBytes, HaloExchange};
use std::ops::Range;
use std::sync::Arc;

/// Message tag of the velocity.
const TAG: u8 = 2;

/// Velocities of the previous step, which the pass reads, and of its own step, which it writes. Positions are those
/// of [`Populations::cell`].
#[derive(Clone, Copy)]
pub(crate) struct View {
    pub(crate) read: [*const f32; 3],
    pub(crate) write: [*mut f32; 3],
    strides: [usize; 3],
    dimension: usize,
    /// Index in `adjacent` plus one for each cell, usually 0; null if no cell has adjacent bodies.
    places: *const u32,
    adjacent: *const AdjacentSurfaces,
}

/// Surfaces on both sides of a cell along each axis.
#[derive(Clone, Copy, Debug, Default)]
struct AdjacentSurfaces {
    cell: u32,
    axes: [Axis; 3],
}

/// Surfaces on both sides along an axis, and the derivative as a weighted sum of velocities.
#[derive(Clone, Copy, Debug)]
struct Axis {
    /// Distance of the surface on the low and the high side; 0 for water.
    distance: [f32; 2],
    /// Weights of the low side, of the cell and of the high side; 0 for a surface.
    weights: [f64; 3],
    /// Contributions of the surfaces to the gradient, including their weights.
    given: [f64; 3],
    velocity: [[f32; 3]; 2],
}

impl Default for Axis {
    fn default() -> Self {
        Self {
            distance: [0.0; 2],
            weights: [-0.5, 0.0, 0.5],
            given: [0.0; 3],
            velocity: [[0.0; 3]; 2],
        }
    }
}

impl Axis {
    fn wall(&mut self, upper: bool, distance: f32, velocity: [f32; 3]) {
        self.distance[usize::from(upper)] = distance;
        self.velocity[usize::from(upper)] = velocity;
        let [l, h] = self
            .distance
            .map(|d| if d > 0.0 { f64::from(d) } else { 1.0 });
        let whole = l * h * (l + h);
        self.weights = [-h * h / whole, (h * h - l * l) / whole, l * l / whole];
        self.given = [0.0; 3];
        for (side, weight) in [(0, 0), (1, 2)] {
            if self.distance[side] > 0.0 {
                for a in 0..3 {
                    self.given[a] += self.weights[weight] * f64::from(self.velocity[side][a]);
                }
                self.weights[weight] = 0.0;
            }
        }
    }
}

impl AdjacentSurfaces {
    /// Returns the gradient; `read` returns the velocity of water at an offset from the cell.
    #[inline(always)]
    fn gradient(
        &self,
        dimension: usize,
        strides: [usize; 3],
        read: impl Fn(usize, isize) -> f64,
    ) -> [[f64; 3]; 3] {
        let mut gradient = [[0.0; 3]; 3];
        for b in 0..dimension {
            let (axis, stride) = (&self.axes[b], strides[b].cast_signed());
            let [low, middle, high] = axis.weights;
            for a in 0..3 {
                gradient[a][b] = axis.given[a]
                    + (low * read(a, -stride) + (middle * read(a, 0) + high * read(a, stride)));
            }
        }
        gradient
    }
}

impl View {
    /// View of a fluid without velocity field.
    pub(crate) const NONE: Self = Self {
        read: [std::ptr::null(); 3],
        write: [std::ptr::null_mut(); 3],
        strides: [0; 3],
        dimension: 0,
        places: std::ptr::null(),
        adjacent: std::ptr::null(),
    };

    /// Prefetches the lines of the field for the cells `ahead` numbers after this one.
    #[inline(always)]
    pub(crate) fn prefetch(&self, cell: usize, ahead: usize) {
        let cell = cell + ahead;
        unroll!(axes a < 3 => {
            let read = self.read[a];
            prefetch(read.wrapping_add(cell));
            unroll!(axes b < 3 => {
                // Along the row the cache line is the same.
                if self.strides[b] > 1 {
                    prefetch(read.wrapping_add(cell + self.strides[b]));
                    prefetch(read.wrapping_add(cell.wrapping_sub(self.strides[b])));
                }
            });
            prefetch(self.write[a].wrapping_add(cell).cast_const());
        });
    }

    /// Computes the gradient of the velocity of the previous step at `N::WIDTH` cells in `dimension` dimensions.
    ///
    /// # Safety
    /// `cell` must be the position of an interior cell with capacity for whole vectors after it.
    #[inline(always)]
    pub(crate) unsafe fn gradient<N: Lanes>(&self, cell: usize, dimension: usize) -> [[N; 3]; 3]
    where
        f32: Memory<N>,
        f64: Memory<N>,
    {
        let mut gradient = [[N::splat(0.0); 3]; 3];
        unroll!(axes b < 3 => {
            if b < dimension {
                let stride = self.strides[b];
                unroll!(axes a < 3 => {
                    if a < dimension {
                        // SAFETY: neighbours of an interior cell, including ghosts, are in the array; rows have
                        // capacity for whole vectors.
                        let (high, low) = unsafe {
                            (
                                <f32 as Memory<N>>::load(self.read[a].add(cell + stride)),
                                <f32 as Memory<N>>::load(self.read[a].add(cell - stride)),
                            )
                        };
                        gradient[a][b] = (high - low) * N::splat(0.5);
                    }
                });
            }
        });
        if !self.places.is_null() {
            let mut any = 0;
            for lane in 0..N::WIDTH {
                // SAFETY: the caller's promise: rows have capacity for whole vectors.
                any |= unsafe { self.places.add(cell + lane).read() };
            }
            if any != 0 {
                // The copy keeps the gradients of all other cells in registers.
                let mut corrected = gradient;
                // SAFETY: the caller's promise.
                unsafe { self.correct::<N>(cell, &mut corrected) };
                gradient = corrected;
            }
        }
        gradient
    }

    /// Corrects the gradients of the cells with adjacent bodies.
    ///
    /// # Safety
    /// `cell` must meet the conditions of [`Self::gradient`].
    #[cold]
    #[inline(never)]
    unsafe fn correct<N: Lanes>(&self, cell: usize, gradient: &mut [[N; 3]; 3])
    where
        f64: Memory<N>,
    {
        let mut lanes = [[[0.0; WIDEST]; 3]; 3];
        for (to, from) in lanes
            .as_flattened_mut()
            .iter_mut()
            .zip(gradient.as_flattened())
        {
            // SAFETY: an array of at least the lanes' width.
            unsafe { <f64 as Memory<N>>::store(to.as_mut_ptr(), *from) };
        }
        for lane in 0..N::WIDTH {
            let here = cell + lane;
            // SAFETY: the caller's promise.
            let place = unsafe { self.places.add(here).read() } as usize;
            if place == 0 {
                continue;
            }
            // SAFETY: places are those of the list.
            let adjacent = unsafe { &*self.adjacent.add(place - 1) };
            let own = adjacent.gradient(self.dimension, self.strides, |a, by| {
                // SAFETY: neighbours of an interior cell, including ghosts, are in the array.
                f64::from(unsafe { self.read[a].offset(here.cast_signed() + by).read() })
            });
            for a in 0..3 {
                for b in 0..3 {
                    lanes[a][b][lane] = own[a][b];
                }
            }
        }
        for (to, from) in gradient
            .as_flattened_mut()
            .iter_mut()
            .zip(lanes.as_flattened())
        {
            // SAFETY: an array of at least the lanes' width.
            *to = unsafe { <f64 as Memory<N>>::load(from.as_ptr()) };
        }
    }

    /// Stores the velocity of `N::WIDTH` cells.
    ///
    /// # Safety
    /// As for [`Self::gradient`], and no other thread may write these cells.
    #[inline(always)]
    pub(crate) unsafe fn leave<N: Lanes>(&self, cell: usize, velocity: [N; 3])
    where
        f32: Memory<N>,
    {
        unroll!(axes a < 3 => {
            // SAFETY: the caller's promise.
            unsafe { <f32 as Memory<N>>::store(self.write[a].add(cell), velocity[a]) };
        });
    }
}

/// Velocity beyond a face: wall · ramp + inner · u_1 + outer · u_2, for each component.
#[derive(Clone, Copy, PartialEq)]
struct FaceVelocity {
    flow: FaceFlow,
    /// Positions of u_1 and u_2, relative to the ghost.
    first: isize,
    second: isize,
    wall: [f32; 3],
    inner: [f32; 3],
    outer: f32,
    /// Patch whose ramp multiplies the velocity of the wall; none for a stationary wall and for open faces.
    patch: Option<usize>,
}

/// Condition of the flow at a face.
#[derive(Clone, Copy, PartialEq)]
enum FaceFlow {
    /// A given velocity on the face.
    Given,
    /// No condition: the flow continues.
    Open,
    /// A plane of symmetry normal to an axis.
    Mirrored(usize),
}

impl FaceFlow {
    /// Returns the factors of the velocities on the face, in the first cell, and at the next point inwards. `nearness`
    /// is the reciprocal of the distance of that point from the first cell: 1 for a cell, 0 if there is none.
    fn factors(self, nearness: f64) -> (f64, [f64; 3], f64) {
        match self {
            Self::Given => {
                let beyond = nearness + 2.0;
                (
                    4.0 * (nearness + 1.0) / beyond,
                    [-(nearness + 1.0); 3],
                    nearness * nearness / beyond,
                )
            }
            Self::Open => (0.0, [1.0 + nearness; 3], 0.0 - nearness),
            Self::Mirrored(normal) => {
                let mut inner = [1.0; 3];
                inner[normal] = -1.0;
                (0.0, inner, 0.0)
            }
        }
    }
}

/// Source of the value of a ghost cell.
#[derive(Clone, Copy, PartialEq)]
enum GhostSource {
    /// Cells next to a face.
    Face(FaceVelocity),
    /// Offset of the source cell across a periodic axis within the slab.
    Round(isize),
}

/// Face of the domain.
#[derive(Clone, Copy)]
struct Face {
    axis: usize,
    upper: bool,
}

impl FaceVelocity {
    /// Returns the rule beyond a face at the cell `at` of the domain; `first` and `second` are the offsets of u_1
    /// and u_2 from the ghost cell.
    fn new<S: Stored>(
        patches: &[Patch<S>],
        frame: &Frame,
        Face { axis, upper }: Face,
        at: [usize; 3],
        [first, second]: [isize; 2],
    ) -> Self {
        let mut position = at.map(|k| real(k) + 0.5);
        position[axis] += 0.5 * if upper { 1.0 } else { -1.0 };
        let holder = patch_at(patches, axis, upper, position);
        let rule = holder.map(|p| &patches[p].rule);
        let given = rule.and_then(|rule| rule.velocity(position));
        // Without a patch the face is a stationary wall.
        let flow = match rule {
            None => FaceFlow::Given,
            Some(_) if given.is_some() => FaceFlow::Given,
            Some(rule) if rule.kind().surface == SurfaceKind::Symmetry => FaceFlow::Mirrored(axis),
            Some(_) => FaceFlow::Open,
        };
        let nearness = if frame.cells[axis] == 1 { 0.0 } else { 1.0 };
        let (share, inner, outer) = flow.factors(nearness);
        Self {
            flow,
            first,
            second,
            wall: given.unwrap_or_default().map(|u| single(share * u)),
            inner: inner.map(single),
            outer: single(outer),
            patch: holder.filter(|_| given.is_some()),
        }
    }

    /// Returns the rule if a stationary surface lies between the first two cells, at a distance from the first.
    fn before_surface(self, distance: f64) -> Self {
        let (cells, ..) = self.flow.factors(1.0);
        let (share, inner, _) = self.flow.factors(1.0 / distance);
        let ratio = if cells == 0.0 { 0.0 } else { share / cells };
        Self {
            second: self.first,
            wall: self.wall.map(|u| single(f64::from(u) * ratio)),
            inner: inner.map(single),
            outer: 0.0,
            ..self
        }
    }
}

/// Ghost cell beyond a face.
struct Ghost {
    /// Plane and row of the cell.
    plane: usize,
    row: u32,
    at: usize,
    follows: GhostSource,
}

/// Returns the ghost cells of a slab that depend on its own cells.
fn ghosts<S: Stored>(
    populations: &Populations<S>,
    frame: &Frame,
    patches: &[Patch<S>],
    strides: [usize; 3],
) -> Vec<Ghost> {
    let [slow, middle, _] = populations.order();
    let cells = populations.cells();
    let mut ghosts = Vec::new();
    for (local, cell) in populations.interior() {
        let at: [usize; 3] = std::array::from_fn(|a| local[a] + frame.start[a]);
        for axis in 0..populations.velocities().dimension {
            for upper in [false, true] {
                let outermost = if upper { frame.cells[axis] - 1 } else { 0 };
                if at[axis] != outermost || (frame.periodic[axis] && axis == slow) {
                    continue;
                }
                let step = if upper { 1 } else { -1 };
                let beyond =
                    |n: isize| cell.wrapping_add_signed(n * step * strides[axis].cast_signed());
                let from_ghost = |cell| position_from(beyond(1), cell);
                let follows = if frame.periodic[axis] {
                    let across = 1 - cells[axis].cast_signed();
                    GhostSource::Round(from_ghost(beyond(across)))
                } else {
                    let outer = if frame.cells[axis] == 1 {
                        cell
                    } else {
                        beyond(-1)
                    };
                    let face = Face { axis, upper };
                    let sources = [cell, outer].map(from_ghost);
                    GhostSource::Face(FaceVelocity::new(patches, frame, face, at, sources))
                };
                ghosts.push(Ghost {
                    plane: local[slow],
                    row: to_u32(local[middle]),
                    at: beyond(1),
                    follows,
                });
            }
        }
    }
    ghosts
}

/// Ghost cells of cells of a plane with the same rule, at equal distances in memory.
struct Run {
    ghost: usize,
    line: Line,
    follows: GhostSource,
}

/// Minimum number of ghost cells per thread.
const GHOSTS_PER_THREAD: usize = 500;

/// Start of the three components of a field.
struct Components([*mut f32; 3]);

// SAFETY: the user ensures that no two threads access the same number.
unsafe impl Sync for Components {}

impl Components {
    fn get(&self) -> [*mut f32; 3] {
        self.0
    }
}

/// Ghost cells of a slab that depend on its own cells.
#[derive(Default)]
pub(crate) struct Ghosts {
    runs: Vec<Run>,
    /// Index of the first run of each plane, and total.
    begins: Vec<usize>,
    /// Number of rows of a plane.
    rows: usize,
}

impl Ghosts {
    /// Joins the ghost cells of the planes of a slab to runs.
    fn new(mut all: Vec<Ghost>, rows: usize, planes: usize) -> Self {
        // Ghost cells of one kind follow each other, because their distances differ between the axes.
        let apart = |follows: &GhostSource| match follows {
            GhostSource::Face(beyond) => beyond.first,
            GhostSource::Round(source) => *source,
        };
        all.sort_unstable_by_key(|ghost| (ghost.plane, apart(&ghost.follows), ghost.at));
        let mut ghosts = Self {
            rows,
            ..Self::default()
        };
        let mut plane_of_last = 0;
        for one in all {
            let Ghost {
                plane,
                row,
                at: ghost,
                follows,
            } = one;
            let longer = ghosts.runs.last().and_then(|run| {
                let apart = u32::try_from(ghost.checked_sub(run.ghost)?).ok()?;
                let alike = plane == plane_of_last && run.follows == follows;
                run.line.with(row, apart).filter(|_| alike)
            });
            match (ghosts.runs.last_mut(), longer) {
                (Some(run), Some(longer)) => run.line = longer,
                _ => {
                    ghosts.begins.resize(plane + 1, ghosts.runs.len());
                    ghosts.runs.push(Run {
                        ghost,
                        line: Line::single(row),
                        follows,
                    });
                }
            }
            plane_of_last = plane;
        }
        ghosts.begins.resize(planes + 1, ghosts.runs.len());
        ghosts
    }

    /// Returns the number of planes.
    fn planes(&self) -> usize {
        self.begins.len() - 1
    }

    /// Returns the ghost cells of all runs.
    fn all(&self) -> impl Iterator<Item = Ghost> + '_ {
        let runs_of = |plane: usize| &self.runs[self.begins[plane]..self.begins[plane + 1]];
        let runs = (0..self.planes()).flat_map(move |plane| {
            let runs = runs_of(plane).iter();
            runs.map(move |run| (plane, run))
        });
        runs.flat_map(|(plane, run)| {
            (0..run.line.count).map(move |k| Ghost {
                plane,
                row: run.line.row(k),
                at: run.ghost + (k * run.line.stride) as usize,
                follows: run.follows,
            })
        })
    }

    /// Fills the ghost cells of a range of rows and planes, in the field that starts at `numbers` for each component.
    /// `ramp` returns the factor of a patch.
    ///
    /// # Safety
    /// `numbers` must be the field of this slab, and no other thread may write these cells and ghosts or the cells that
    /// the ghosts follow from.
    unsafe fn fill(
        &self,
        RowBlock { planes, rows }: &RowBlock,
        numbers: [*mut f32; 3],
        ramp: impl Fn(usize) -> f64,
    ) {
        for run in &self.runs[self.begins[planes.start]..self.begins[planes.end]] {
            let some = run.line.within(rows);
            if !some.is_empty() {
                // SAFETY: promised by the caller; the ghost cells and their sources are positions in the field.
                unsafe { run.fill(some, numbers, &ramp) };
            }
        }
    }

    /// Fills the ghost cells of a range of planes, on several threads if there are many cells.
    ///
    /// # Safety
    /// As for [`Self::fill`].
    unsafe fn fill_planes(
        &self,
        planes: Range<usize>,
        components: &Components,
        ramp: impl Fn(usize) -> f64 + Sync,
    ) {
        let runs = &self.runs[self.begins[planes.start]..self.begins[planes.end]];
        let count: u32 = runs.iter().map(|run| run.line.count).sum();
        let threads = thread_pool::threads().min(count as usize / GHOSTS_PER_THREAD);
        let threads = threads.max(1);
        thread_pool::each(threads, |thread| {
            let bound = |t: usize| self.rows * t / threads;
            let cells = RowBlock {
                planes: planes.clone(),
                rows: bound(thread)..bound(thread + 1),
            };
            // SAFETY: promised by the caller; each ghost cell belongs to one row, and its sources are cells of the
            // slab.
            unsafe { self.fill(&cells, components.get(), &ramp) };
        });
    }

    /// Fills the ghost cells of a block of cells in the field written by a pass, before the step is complete.
    ///
    /// # Safety
    /// `written` must be of this slab, the pass must have done these cells and those two further inside, and no other
    /// thread may access them.
    pub(crate) unsafe fn follow(
        &self,
        cells: &RowBlock,
        written: &View,
        ramp: impl Fn(usize) -> f64,
    ) {
        // SAFETY: promised by the caller.
        unsafe { self.fill(cells, written.write, ramp) };
    }
}

impl Run {
    /// # Safety
    /// As for [`Ghosts::fill`]; `some` must be of the run.
    #[inline]
    unsafe fn fill(&self, some: Range<usize>, numbers: [*mut f32; 3], ramp: impl Fn(usize) -> f64) {
        let stride = self.line.stride as usize;
        let (begin, count) = (self.ghost + some.start * stride, some.len());
        match self.follows {
            GhostSource::Round(source) => {
                for component in numbers {
                    for k in 0..count {
                        // SAFETY: both are positions in the field.
                        unsafe {
                            let ghost = component.add(begin + k * stride);
                            ghost.write(ghost.offset(source).read());
                        }
                    }
                }
            }
            GhostSource::Face(beyond) => {
                #[expect(clippy::cast_possible_truncation, reason = "the field is in f32")]
                let factor = beyond.patch.map_or(0.0, ramp) as f32;
                let FaceVelocity { first, second, .. } = beyond;
                for (a, component) in numbers.into_iter().enumerate() {
                    let (wall, inner) = (beyond.wall[a] * factor, beyond.inner[a]);
                    for k in 0..count {
                        // SAFETY: all three are positions in the field.
                        unsafe {
                            let ghost = component.add(begin + k * stride);
                            ghost.write(
                                wall + inner * ghost.offset(first).read()
                                    + beyond.outer * ghost.offset(second).read(),
                            );
                        }
                    }
                }
            }
        }
    }
}

/// Surface of a body next to a cell of the slab.
#[derive(Clone, Copy, Debug)]
pub struct BodyWall {
    /// Position of the cell.
    pub cell: usize,
    /// Axis normal to the surface, and `true` for the upper side.
    pub side: (usize, bool),
    /// Distance from the cell \[cells\].
    pub distance: f64,
    /// Velocity of the surface \[cells per step\].
    pub velocity: [f64; 3],
}

/// Returns the position of a cell relative to another.
fn position_from(from: usize, to: usize) -> isize {
    to.cast_signed() - from.cast_signed()
}

/// Velocity field of a slab, for the gradient.
pub struct Field {
    /// Velocity components of the previous step, then of this one.
    numbers: [Pages<f32>; 2],
    /// Index of the field that is read.
    old: usize,
    /// Distance between components in memory.
    array: usize,
    strides: [usize; 3],
    dimension: usize,
    ghosts: Arc<Ghosts>,
    exchange: HaloExchange,
    /// Positions of the cells of a plane relative to its first cell.
    plane: Vec<usize>,
    /// First cell of the ghost plane below, the first, the last and the ghost plane above.
    planes: [usize; 4],
    /// Index in `adjacent` plus one for each cell, usually 0; empty without bodies.
    places: Vec<u32>,
    adjacent: Vec<AdjacentSurfaces>,
    /// Surfaces found by each thread: reusable buffers.
    found: Vec<Vec<BodyWall>>,
}

impl Field {
    /// Returns the field of the slab of `populations`. Collective.
    ///
    /// # Errors
    /// If the slabs of two neighbours do not fit each other.
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        frame: &Frame,
        patches: &[Patch<S>],
        domain: &Domain,
    ) -> Result<Self, FluidError> {
        let [slow, middle, _] = populations.order();
        let cells = populations.cells();
        let zero = populations.cell([0; 3]);
        let unit = |axis: usize| {
            let mut at = [0; 3];
            at[axis] = 1;
            populations.cell(at) - zero
        };
        let strides = [unit(0), unit(1), unit(2)];
        // The components are staggered, so that the six arrays do not compete for the same cache lines.
        let array = populations.cell_positions() + 208;
        let ghosts = ghosts(populations, frame, patches, strides);
        let first = populations.interior();
        let first = first.take_while(|(local, _)| local[slow] == 0);
        let plane: Vec<usize> = first.map(|(_, cell)| cell - zero).collect();
        let at_plane = |n: isize| {
            let mut at = [0; 3];
            at[slow] = n;
            populations.cell(at)
        };
        let last = cells[slow].cast_signed() - 1;
        let bytes = 3 * plane.len() * size_of::<f32>();
        let exchange = HaloExchange::new(domain, TAG, HaloBytes::symmetric(bytes))?;
        Ok(Self {
            numbers: [Pages::new(3 * array)?, Pages::new(3 * array)?],
            old: 0,
            array,
            strides,
            dimension: populations.velocities().dimension,
            ghosts: Arc::new(Ghosts::new(ghosts, cells[middle], cells[slow])),
            exchange,
            plane,
            planes: [
                at_plane(-1),
                at_plane(0),
                at_plane(last),
                at_plane(last + 1),
            ],
            places: Vec::new(),
            adjacent: Vec::new(),
            found: Vec::new(),
        })
    }

    /// Bounds the parabolas and lines beyond faces by the stationary surfaces between the first two cells. Such
    /// surfaces never move.
    pub(crate) fn bound_ghosts(&mut self, surfaces: impl Iterator<Item = BodyWall>) {
        let mut inwards: Vec<(usize, isize, f64)> = surfaces
            .map(|wall| {
                let (axis, upper) = wall.side;
                let stride = self.strides[axis].cast_signed();
                let towards = if upper { stride } else { -stride };
                (wall.cell, towards, wall.distance)
            })
            .collect();
        inwards.sort_unstable_by_key(|&(cell, towards, _)| (cell, towards));
        let mut meets = false;
        let ghosts = self.ghosts.all().map(|mut ghost| {
            if let GhostSource::Face(face) = ghost.follows {
                let key = (ghost.at.wrapping_add_signed(face.first), face.first);
                let found = inwards.binary_search_by_key(&key, |&(cell, to, _)| (cell, to));
                if let (Ok(n), true) = (found, face.outer != 0.0) {
                    ghost.follows = GhostSource::Face(face.before_surface(inwards[n].2));
                    meets = true;
                }
            }
            ghost
        });
        let ghosts: Vec<Ghost> = ghosts.collect();
        if meets {
            let (rows, planes) = (self.ghosts.rows, self.ghosts.planes());
            self.ghosts = Arc::new(Ghosts::new(ghosts, rows, planes));
        }
    }

    /// Clears the surfaces of bodies, before they are set again.
    pub fn forget_walls(&mut self) {
        for one in &self.adjacent {
            self.places[one.cell as usize] = 0;
        }
        self.adjacent.clear();
    }

    /// Sets the surfaces found by the threads: `find` receives the number of a thread, the number of threads, and a
    /// buffer for its results.
    pub(crate) fn find_walls(&mut self, find: impl Fn(usize, usize, &mut Vec<BodyWall>) + Sync) {
        let mut found = std::mem::take(&mut self.found);
        let threads = thread_pool::threads();
        found.resize_with(threads, Vec::new);
        thread_pool::each_item(&mut found, 1, |thread, found| {
            found.clear();
            find(thread, threads, found);
        });
        for wall in found.iter().flatten() {
            self.wall(wall);
        }
        self.found = found;
    }

    /// Adds one surface of a body next to a cell.
    fn wall(&mut self, wall: &BodyWall) {
        let BodyWall {
            cell,
            side: (axis, upper),
            distance,
            velocity,
        } = *wall;
        if self.places.is_empty() {
            // Rows have capacity for whole vectors.
            self.places = vec![0; self.array];
        }
        let number = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        if self.places[cell] == 0 {
            self.adjacent.push(AdjacentSurfaces {
                cell: number(cell),
                ..AdjacentSurfaces::default()
            });
            self.places[cell] = number(self.adjacent.len());
        }
        let place = self.places[cell] as usize - 1;
        #[expect(clippy::cast_possible_truncation, reason = "the field is in f32")]
        let (distance, velocity) = (distance as f32, velocity.map(|u| u as f32));
        self.adjacent[place].axes[axis].wall(upper, distance, velocity);
    }

    /// Returns the fields that the next pass reads and writes.
    pub(crate) fn view(&mut self) -> View {
        let array = self.array;
        let [first, second] = &mut self.numbers;
        let (read, write) = if self.old == 0 {
            (first, second)
        } else {
            (second, first)
        };
        let (read, write) = (read.as_ptr(), write.as_mut_ptr());
        View {
            // SAFETY: the vectors hold three arrays of this length.
            read: std::array::from_fn(|a| unsafe { read.add(a * array) }),
            // SAFETY: as above.
            write: std::array::from_fn(|a| unsafe { write.add(a * array) }),
            strides: self.strides,
            dimension: self.dimension,
            places: if self.adjacent.is_empty() {
                std::ptr::null()
            } else {
                self.places.as_ptr()
            },
            adjacent: self.adjacent.as_ptr(),
        }
    }

    /// Swaps the fields, so that the next pass reads the field written by the last one (see [`Self::view`]).
    pub(crate) fn swap(&mut self) {
        self.old = 1 - self.old;
    }

    /// Sends the outer planes of the field; they must be complete.
    pub(crate) fn exchange_start(&mut self) {
        let numbers = &self.numbers[self.old];
        let (lower, upper) = self.exchange.send_buffers_mut::<f32>();
        let count = self.plane.len();
        for (buffer, plane) in [(lower, self.planes[1]), (upper, self.planes[2])] {
            let Some(buffer) = buffer else { continue };
            for (a, part) in buffer.chunks_exact_mut(count.max(1)).enumerate() {
                for (value, &cell) in part.iter_mut().zip(&self.plane) {
                    *value = numbers[a * self.array + plane + cell];
                }
            }
        }
        self.exchange.start();
    }

    /// Receives the planes of the neighbours and fills the ghost cells across periodic axes and beyond faces that
    /// depend on the cells of a range of planes. `ramp` returns the factor of a patch at this time.
    pub(crate) fn complete(
        &mut self,
        planes: impl Iterator<Item = Range<usize>>,
        ramp: impl Fn(usize) -> f64 + Sync,
    ) {
        self.exchange.finish();
        let count = self.plane.len();
        let numbers = &mut self.numbers[self.old];
        let (lower, upper) = self.exchange.received::<f32>();
        for (buffer, plane) in [(lower, self.planes[0]), (upper, self.planes[3])] {
            let Some(buffer) = buffer else { continue };
            for (a, part) in buffer.chunks_exact(count.max(1)).enumerate() {
                for (value, &cell) in part.iter().zip(&self.plane) {
                    numbers[a * self.array + plane + cell] = *value;
                }
            }
        }
        let start = numbers.start();
        // SAFETY: the memory holds three components of this length.
        let components = Components(std::array::from_fn(|a| unsafe {
            start.add(a * self.array)
        }));
        for planes in planes {
            // SAFETY: the field is borrowed exclusively.
            unsafe { self.ghosts.fill_planes(planes, &components, &ramp) };
        }
    }

    /// Returns the ghost cells that depend on the cells of the slab.
    pub(crate) fn ghosts(&self) -> Arc<Ghosts> {
        self.ghosts.clone()
    }

    /// Returns the velocity of a cell as stored.
    #[must_use]
    pub fn velocity(&self, cell: usize) -> [f32; 3] {
        std::array::from_fn(|a| self.numbers[self.old][a * self.array + cell])
    }

    /// Sets the velocity of a cell: at the start, at a restart, and inside bodies.
    pub fn set_velocity(&mut self, cell: usize, velocity: [f32; 3]) {
        for a in 0..3 {
            self.numbers[self.old][a * self.array + cell] = velocity[a];
        }
    }

    /// Sets the velocity of a cell to zero in this step and the next one, unless a pass writes it.
    pub(crate) fn still(&mut self, cell: usize) {
        for numbers in &mut self.numbers {
            for a in 0..3 {
                numbers[a * self.array + cell] = 0.0;
            }
        }
    }

    /// Returns the gradient at one cell.
    #[must_use]
    pub(crate) fn gradient(&self, cell: usize) -> [[f64; 3]; 3] {
        if let Some(place) = self.places.get(cell).filter(|place| **place > 0) {
            let numbers = &self.numbers[self.old];
            let adjacent = &self.adjacent[*place as usize - 1];
            return adjacent.gradient(self.dimension, self.strides, |a, by| {
                f64::from(numbers[(a * self.array + cell).wrapping_add_signed(by)])
            });
        }
        let mut gradient = [[0.0; 3]; 3];
        for b in 0..self.dimension {
            let high = self.velocity(cell + self.strides[b]);
            let low = self.velocity(cell - self.strides[b]);
            for a in 0..3 {
                gradient[a][b] = (f64::from(high[a]) - f64::from(low[a])) * 0.5;
            }
        }
        gradient
    }
}

#[cfg(test)]
mod tests;
