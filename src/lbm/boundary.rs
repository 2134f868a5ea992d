//! Boundaries of the domain: a rule for each population that would enter from outside.
//!
//! Every rule acts on links half-way across the face, so that the fluid fills the domain exactly from face to face.
//! A link that leaves through an edge or a corner belongs to the face with the strongest condition ([`Strength`]),
//! in the order wall, velocity (turbulent or not), pressure, outflow (convective or not), free slip; a wall
//! therefore always closes its corners. Next to a wall that moves water passes through an opening as far as the edge
//! (`edge`).
//!
//! A boundary is one file. It contains, in this order:
//!
//! 1. the formula and its source;
//! 2. the parameters in a case, in SI units, with unit, range and default of each;
//! 3. its interface to the program ([`BoundaryModel`]): the kind of the boundary, the findings about its
//!    parameters, the imposed speed, pressure and inflow, and the rule on the lattice;
//! 4. the rule of a patch in lattice units ([`Rule`]): the links that it acts on and the populations that enter
//!    through them.
//!
//! To add a boundary, write the file and add one line to the list below. The name of the module is its name in a case.
//! `tests/toy.rs` is the smallest example.
//!
//! | file | content |
//! |---|---|
//! | `no_slip`, `moving_wall`, `free_slip`, `velocity`, `pressure`, `outflow`, `convective_outflow` | a boundary each |
//! | `discharge`, `level`, `outfall` | one opening of water with a free surface each |
//! | `model` | [`BoundaryModel`], interface of a boundary of a case |
//! | `kind`, `site` | the kind of a boundary, and the part of the domain where it is imposed |
//! | `rule`, `links` | [`Rule`], the action of a boundary on the lattice, and its links |
//! | `wall` | half-way bounce-back at walls and imposed velocities, also during the pass |
//! | `profile` | velocity profile over a face |
//! | `turbulent` | turbulent fluctuations added to an imposed velocity |
//! | `sound` | the plane wave that leaves through an opening |
//! | `covered` | openings with cells covered by solids |
//! | `flux` | mass and momentum through each patch |
//! | `edge` | links through edges of the domain: whose velocity, and which faces have their mass and force |
//! | `straight` | links along which a face returns a population to its cell |

mod covered;
mod edge;
mod flux;
mod kind;
mod links;
mod model;
pub mod profile;
mod rule;
mod site;
mod sound;
mod straight;
pub mod turbulent;
pub mod wall;

pub use super::quanta::{QUANTA, from_quanta, quanta};
pub use covered::SolidPart;
pub use flux::{Beside, FaceLoads, Flux};
pub use kind::{BoundaryKind, Inflow, Strength, SurfaceKind, WithSurface};
pub use links::{Crossing, FaceLink, Mirror, MirrorRun};
pub use model::{BoundaryModel, ImposedPressure, ImposedSpeed};
pub use rule::{Giver, Rule, RuleStep};
pub use site::{Opening, Place, Sides, Site};
pub use sound::{Sound, Sums};
pub use straight::StraightLinks;

use super::block::RowBlock;
use super::gpu::copies::Copies;
use super::lanes::Stored;
use super::populations::{Link, Parity, Populations};
use super::surface::Outside;
use base::error::{Error, Report};
use base::family::{describe_choices, family};
use base::history::TimeTable;
use base::number::{real, to_u32};
use base::units::LatticeUnits;
use decomposition::Communicator;
use profile::ReadTable;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::Range;

family! {
    /// Boundary condition of the fluid at a face.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    #[schemars(transform = describe_choices)]
    pub enum Condition: dyn BoundaryModel {
        no_slip: NoSlip(NoSlip),
        moving_wall: MovingWall(MovingWall),
        free_slip: FreeSlip(FreeSlip),
        velocity: Velocity(Velocity),
        pressure: Pressure(Pressure),
        outflow: Outflow(Outflow),
        convective_outflow: ConvectiveOutflow(ConvectiveOutflow),
        discharge: Discharge(Discharge),
        level: Level(Level),
        outfall: Outfall(Outfall),
    }
}

impl Condition {
    /// Returns the boundary with checked parameters and its tables read; findings go to the report. The path of the
    /// site is that of the condition.
    #[must_use]
    pub fn resolved(&self, site: &Site<'_>, read: ReadTable<'_>, report: &mut dyn Report) -> Self {
        let path = format!("{}.{}", site.path, self.name());
        let site = Site {
            path: &path,
            ..*site
        };
        let mut resolved = self.clone();
        each!(&mut resolved, boundary => boundary.resolve(&site, read, report));
        resolved
    }

    /// Returns the rule on the lattice.
    ///
    /// # Errors
    /// If the cells of the patch show that the parameters cannot hold.
    pub fn rule<S: Stored>(
        &self,
        place: &Place<'_>,
        units: &LatticeUnits,
    ) -> Result<Box<dyn Rule<S>>, Error> {
        each!(self, boundary => boundary.rule(place, units))
    }
}

/// Value that changes linearly from `start` to `end` during `steps`, and is constant afterwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    /// Value at step 0.
    pub start: f64,
    /// Value from `steps` on.
    pub end: f64,
    /// Number of steps of the change; 0 for a step change.
    pub steps: f64,
}

impl Ramp {
    /// Returns a ramp with a constant value.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self {
            start: value,
            end: value,
            steps: 0.0,
        }
    }

    /// Returns the value at a step.
    #[must_use]
    pub fn value_at(&self, step: f64) -> f64 {
        if step >= self.steps {
            self.end
        } else {
            self.start + (self.end - self.start) * (step / self.steps)
        }
    }
}

impl From<Ramp> for TimeTable {
    fn from(ramp: Ramp) -> Self {
        let rows = [[0.0, ramp.start], [ramp.steps, ramp.end]];
        let rows = (ramp.steps > 0.0).then_some(rows.as_slice());
        Self::new(rows, ramp.end)
    }
}

/// Named part of one face.
pub struct Patch<S: Stored = f64> {
    /// Name in outputs.
    pub name: String,
    /// Axis of the face normal.
    pub axis: usize,
    /// `true` if the face is at the upper end of the axis.
    pub upper: bool,
    /// Corners of the part in cells (the components along the axis are not used). Later patches take precedence.
    pub range: [[f64; 2]; 3],
    /// Rule of the patch.
    pub rule: Box<dyn Rule<S>>,
}

impl<S: Stored> Patch<S> {
    /// Returns `true` if water passes through the face at a point, in cells.
    fn lets_through(&self, position: [f64; 3]) -> bool {
        self.rule.kind().surface == SurfaceKind::Opening
            && self
                .rule
                .velocity(position)
                .is_none_or(|u| u[self.axis] != 0.0)
    }

    fn holds(&self, position: [f64; 3]) -> bool {
        contains(&self.range, self.axis, position)
    }
}

/// Part of a face of the domain, as solids next to it meet it. Later parts take precedence.
#[derive(Clone, Debug)]
pub struct FacePart {
    /// Axis of the face normal.
    pub axis: usize,
    /// `true` if the face is at the upper end of the axis.
    pub upper: bool,
    /// Corners of the part in cells (the components along the axis are not used).
    range: [[f64; 2]; 3],
    /// Surface of the part.
    pub surface: SurfaceKind,
    /// Velocity of a moving wall \[cells per step\]; zero for others.
    pub velocity: [f64; 3],
}

impl FacePart {
    /// Returns `true` if the part contains a point, in cells.
    #[must_use]
    pub fn holds(&self, position: [f64; 3]) -> bool {
        contains(&self.range, self.axis, position)
    }
}

/// Returns `true` if the range of a part of a face contains a point.
fn contains(range: &[[f64; 2]; 3], axis: usize, position: [f64; 3]) -> bool {
    (0..3).all(|a| a == axis || (range[a][0] <= position[a] && position[a] < range[a][1]))
}

/// Returns the last patch that contains a position on a face; `None` if only the default wall contains it.
#[must_use]
pub fn patch_at<S: Stored>(
    patches: &[Patch<S>],
    axis: usize,
    upper: bool,
    position: [f64; 3],
) -> Option<usize> {
    patches
        .iter()
        .rposition(|patch| patch.axis == axis && patch.upper == upper && patch.holds(position))
}

/// Returns points of a face around the point at which a link crosses the face: an oblique link crosses between
/// cells, where patches may meet.
fn surrounding_points(
    frame: &Frame,
    c: [i8; 3],
    outside: [bool; 3],
    middle: [f64; 3],
) -> impl Iterator<Item = [f64; 3]> {
    let oblique: [bool; 3] = std::array::from_fn(|a| c[a] != 0 && !outside[a]);
    let sides = move |a: usize| {
        if oblique[a] {
            &[-0.5, 0.5][..]
        } else {
            &[0.0][..]
        }
    };
    let frame_cells = frame.cells.map(real);
    let periodic = frame.periodic;
    sides(0).iter().flat_map(move |x| {
        sides(1).iter().flat_map(move |y| {
            sides(2).iter().map(move |z| {
                let mut point = [middle[0] + x, middle[1] + y, middle[2] + z];
                for a in 0..3 {
                    if periodic[a] {
                        point[a] = point[a].rem_euclid(frame_cells[a]);
                    }
                }
                point
            })
        })
    })
}

/// Returns the patch of a link that crosses a face between the cells `beside` with the given centres, and the
/// fraction of these cells that imposes a velocity.
///
/// Both links that cross at a point belong to one patch, so that a population that leaves along one may enter along the
/// other. At the border of a patch a velocity is imposed in part: the flow through the face is then that of the cells
/// of the patch, equal at both of its ends. Links at the border of two other patches belong to the stronger one.
fn on_border<S: Stored>(
    patches: &[Patch<S>],
    middle: [f64; 3],
    beside: impl Iterator<Item = (usize, [f64; 3])>,
) -> (usize, f64) {
    let strength = |p: usize| patches[p].rule.kind().strength;
    let (mut strongest, mut imposing) = (None, None);
    let (mut count, mut imposed) = (0.0, 0.0);
    for (p, centre) in beside {
        if strongest.is_none_or(|q| (strength(p), p) > (strength(q), q)) {
            strongest = Some(p);
        }
        count += 1.0;
        let rule = &patches[p].rule;
        if rule.kind().surface != SurfaceKind::Wall && rule.velocity(middle).is_some() {
            imposed += rule.part(centre);
            imposing = imposing.max(Some(p));
        }
    }
    match (strongest, imposing) {
        (_, Some(p)) => (p, imposed / count),
        (Some(p), None) => (p, 1.0),
        // There is always an adjacent cell.
        (None, None) => (0, 1.0),
    }
}

/// Number of faces of the domain; each has a wall of its own below all patches.
const FACES: usize = 6;

/// Returns a no-slip wall on each face of the domain.
fn no_slip_walls<S: Stored>() -> impl Iterator<Item = Patch<S>> {
    (0..FACES).map(|face| {
        let (axis, upper) = (face / 2, face % 2 == 1);
        let end = if upper { "max" } else { "min" };
        Patch {
            name: format!("{}_{end}", ["x", "y", "z"][axis]),
            axis,
            upper,
            range: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
            rule: Box::new(no_slip::NoSlipLinks),
        }
    })
}

/// Returns the midpoint of a link from a cell, in cells; the first cell spans 0..1.
fn middle_of(cell: [usize; 3], c: [i8; 3]) -> [f64; 3] {
    // Along a face that the link does not cross, the crossing point; through a face, the face.
    std::array::from_fn(|a| real(cell[a]) + 0.5 + 0.5 * f64::from(c[a]))
}

/// Patch that a link crosses along each axis along which it leaves the domain, and the fraction of the surrounding
/// cells that imposes a velocity.
type Found = [Option<(usize, f64)>; 3];

/// Returns the patches that a link crosses along the axes `outside`. The last patches are the walls of the faces.
fn crossed<S: Stored>(
    patches: &[Patch<S>],
    frame: &Frame,
    c: [i8; 3],
    outside: [bool; 3],
    middle: [f64; 3],
) -> Found {
    let defaults = patches.len() - FACES;
    std::array::from_fn(|axis| {
        outside[axis].then(|| {
            let upper = c[axis] > 0;
            let default = defaults + 2 * axis + usize::from(upper);
            let beside = surrounding_points(frame, c, outside, middle);
            let beside = beside.map(|point| {
                let holder = patch_at(&patches[..defaults], axis, upper, point);
                (holder.unwrap_or(default), point)
            });
            on_border(patches, middle, beside)
        })
    })
}

/// Opening of water with a free surface, as a patch.
pub(crate) struct OutsideOfPatch {
    pub(crate) patch: usize,
    /// Axis of the face, and `true` for the upper end.
    pub(crate) face: (usize, bool),
    /// State outside.
    pub(crate) outside: Outside,
}

/// Boundary links of one slab, sorted so that loops over them contain no branches: links at walls together, the
/// others by patch.
pub struct Boundaries<S: Stored> {
    patches: Vec<Patch<S>>,
    /// Numbers of the patches from the strongest to the weakest.
    order: Vec<usize>,
    /// Links at the edges of the domain.
    edges: edge::Edges,
    walls: wall::Walls,
    /// Second and third terms of links at edges where several faces impose velocities.
    more_terms: [wall::Walls; 2],
    open: covered::OpenCells,
    /// First cell of the slab.
    start: [usize; 3],
    /// Patches whose rules need sums over all ranks, and a buffer for the sums.
    summed: Vec<usize>,
    sums: Vec<u128>,
}

/// Position of a cell in the whole domain.
pub struct Frame {
    /// Number of cells of the whole domain.
    pub cells: [usize; 3],
    /// First cell of the slab.
    pub start: [usize; 3],
    /// Periodic axes.
    pub periodic: [bool; 3],
}

impl Frame {
    /// Returns `true` if a link from a cell leaves the domain along an axis.
    fn leaves(&self, at: [usize; 3], c: [i8; 3], a: usize) -> bool {
        !self.periodic[a] && ((c[a] < 0 && at[a] == 0) || (c[a] > 0 && at[a] + 1 == self.cells[a]))
    }
}

/// Links through faces of a slab while they are found.
#[derive(Default)]
struct FoundLinks {
    walls: Vec<wall::WallLink>,
    /// Second and third terms.
    more_terms: [Vec<wall::WallLink>; 2],
    open: covered::OpenCells,
    edges: edge::Edges,
}

impl FoundLinks {
    /// Adds a link of a cell with the indices `local` in the slab, and passes it to the patch that takes it.
    fn add<S: Stored>(
        &mut self,
        mut crossing: Crossing<'_, S>,
        local: [usize; 3],
        frame: &Frame,
        patches: &mut [Patch<S>],
        coverable: bool,
    ) {
        let (c, outside, middle) = (crossing.velocity(), crossing.outside, crossing.middle);
        let found = crossed(patches, frame, c, outside, middle);
        let (patch, share) = edge::taker(patches, &found).unwrap_or((patches.len() - FACES, 1.0));
        (crossing.share, crossing.normal) = (share, patches[patch].axis);
        crossing.counted = edge::counted(patches, &found, patch, middle);
        let mut opens = patches[patch].lets_through(middle);
        // Terms of the velocities of other patches.
        let mut others = [None; 3];
        if found.iter().flatten().count() > 1 {
            let passages = edge::passages(patches, &found, &crossing, patch);
            opens |= !passages.is_empty();
            let of_others = passages.iter().filter(|passage| passage.giver != patch);
            for (other, passage) in others.iter_mut().zip(of_others) {
                patches[passage.giver].rule.add_beside(passage.term);
                *other = Some((passage.giver, passage.term));
            }
            self.edges.add(&crossing, &found, patch, passages);
        } else {
            self.edges.add_shear(&crossing, patches, frame);
        }
        if coverable && opens {
            let taken = c.map(|c| 6.0 * crossing.weight() * f64::from(c));
            let link = crossing.link;
            (self.open).add((crossing.cell, local), covered::OpenLink { link, taken });
        }
        if let Giver::Wall { term } = patches[patch].rule.take(&crossing) {
            let [slow, across, _] = crossing.populations.order();
            let own = Some((patch, term)).filter(|_| term != 0.0 || others[0].is_none());
            let terms = own.into_iter().chain(others.into_iter().flatten());
            let lists = std::iter::once(&mut self.walls).chain(&mut self.more_terms);
            for (list, (giver, term)) in lists.zip(terms) {
                list.push(wall::WallLink {
                    link: crossing.link,
                    patch,
                    giver,
                    direction: crossing.direction,
                    plane: local[slow],
                    row: to_u32(local[across]),
                    term,
                });
            }
        }
    }
}

impl<S: Stored> Boundaries<S> {
    /// Finds the boundary links of a slab. Faces without a patch are no-slip walls. `coverable`: solids may cover
    /// cells.
    #[must_use]
    pub fn new(
        populations: &Populations<S>,
        frame: &Frame,
        mut patches: Vec<Patch<S>>,
        coverable: bool,
    ) -> Self {
        // Default walls; they are the weakest in the search below, because later patches take precedence.
        patches.extend(no_slip_walls());
        let mut found = FoundLinks::default();
        let velocities = populations.velocities();
        let dimension = velocities.dimension;
        for (local, cell) in populations.interior() {
            let at: [usize; 3] = std::array::from_fn(|a| local[a] + frame.start[a]);
            let at_face = (0..dimension)
                .any(|a| !frame.periodic[a] && (at[a] == 0 || at[a] + 1 == frame.cells[a]));
            if !at_face {
                continue;
            }
            for i in 1..velocities.q() {
                let c = velocities.c[i];
                let outside = std::array::from_fn(|a| a < dimension && frame.leaves(at, c, a));
                if outside.contains(&true) {
                    let crossing = Crossing {
                        populations,
                        cell,
                        at,
                        cells: frame.cells,
                        direction: i,
                        outside,
                        middle: middle_of(at, c),
                        share: 1.0,
                        normal: 0,
                        counted: [true; 3],
                        link: populations.link(cell, i),
                    };
                    found.add(crossing, local, frame, &mut patches, coverable);
                }
            }
        }
        found.edges.sort();
        let mut order: Vec<usize> = (0..patches.len()).collect();
        order.sort_by_key(|&p| std::cmp::Reverse(patches[p].rule.kind().strength));
        let summed: Vec<usize> = (0..patches.len())
            .filter(|&p| patches[p].rule.sums())
            .collect();
        let planes = populations.cells()[populations.order()[0]];
        Self {
            sums: vec![0; summed.len() * Sums::default().len()],
            summed,
            patches,
            order,
            edges: found.edges,
            walls: wall::Walls::new(found.walls, planes),
            more_terms: (found.more_terms)
                .map(|links| wall::Walls::new(links, planes).onto_entering()),
            open: found.open,
            start: frame.start,
        }
    }

    /// Returns the positions of the ghost cells at the ends of links to stationary walls; some occur more than
    /// once.
    pub fn behind_walls_at_rest(
        &self,
        populations: &Populations<S>,
    ) -> impl Iterator<Item = usize> {
        let first = |i: usize| populations.slot(0, i);
        self.walls
            .links()
            .filter(|wall| self.patches[wall.patch].rule.kind().surface == SurfaceKind::Wall)
            .map(move |wall| wall.link.far as usize - first(wall.direction))
    }

    /// Returns the factor of the velocity of a patch at a step, which follows from its ramp.
    #[must_use]
    pub fn velocity_factor(&self, patch: usize, step: f64) -> f64 {
        self.patches[patch].rule.factor(step)
    }

    /// Returns the links at walls as copies between array positions after a pass of this parity, with the patch of
    /// each for its velocity factor: lists that follow each other. `plane` is the distance between planes in memory.
    pub(crate) fn wall_copies(&self, parity: Parity, plane: u32) -> [Vec<Copies>; 3] {
        let [second, third] = &self.more_terms;
        [&self.walls, second, third].map(|walls| walls.copies(parity, plane))
    }

    /// Returns the openings of water with a free surface.
    pub(crate) fn outsides(&self) -> impl Iterator<Item = OutsideOfPatch> + '_ {
        let patches = self.patches.iter().enumerate();
        patches.filter_map(|(n, patch)| {
            let outside = patch.rule.outside()?;
            Some(OutsideOfPatch {
                patch: n,
                face: (patch.axis, patch.upper),
                outside,
            })
        })
    }

    /// Returns the links through a patch in ascending order of cell and direction.
    pub(crate) fn links_of(
        &self,
        patch: usize,
        populations: &Populations<S>,
    ) -> Vec<(usize, usize)> {
        let of_walls = self.walls.links().filter(|wall| wall.patch == patch);
        let of_walls = of_walls.map(|wall| (wall.link, wall.direction));
        let kept = self.patches[patch].rule.links().iter();
        let kept = kept.map(|kept| (kept.link, kept.direction));
        let opposite = &populations.velocities().opposite;
        let cell = |link: Link, direction: usize| {
            link.near as usize - populations.slot(0, opposite[direction])
        };
        let mut links: Vec<_> = of_walls
            .chain(kept)
            .map(|(link, direction)| (cell(link, direction), direction))
            .collect();
        links.sort_unstable();
        links
    }

    /// Returns the velocity imposed by a patch at a point of the face, before the factor of the step.
    pub(crate) fn imposed(&self, patch: usize, position: [f64; 3]) -> [f64; 3] {
        let rule = &self.patches[patch].rule;
        rule.velocity(position).unwrap_or_default()
    }

    /// Returns the number of patches.
    pub(crate) fn count(&self) -> usize {
        self.patches.len()
    }

    /// Returns the parts of the faces of the domain, with the velocities of walls at a step.
    pub fn face_parts(&self, step: f64) -> impl Iterator<Item = FacePart> + '_ {
        self.patches.iter().map(move |patch| {
            let surface = patch.rule.kind().surface;
            let moves = surface == SurfaceKind::MovingWall;
            let velocity = patch.rule.velocity([0.0; 3]).filter(|_| moves);
            let factor = patch.rule.factor(step);
            FacePart {
                axis: patch.axis,
                upper: patch.upper,
                range: patch.range,
                surface,
                velocity: velocity.unwrap_or_default().map(|u| factor * u),
            }
        })
    }

    /// Returns `true` for each end of an axis whose last patch is a symmetry plane over the whole face.
    #[must_use]
    pub fn mirrored(&self) -> [[bool; 2]; 3] {
        let mut mirrored = [[false; 2]; 3];
        for patch in self.patches.iter().take(self.count() - FACES) {
            let mirror = patch.rule.kind().surface == SurfaceKind::Symmetry;
            mirrored[patch.axis][usize::from(patch.upper)] = mirror;
        }
        mirrored
    }

    /// Returns `true` for each end of an axis whose face is a plane of symmetry as a whole, for a domain of `cells`.
    #[must_use]
    pub fn planes_of_symmetry(&self, cells: [usize; 3]) -> [[bool; 2]; 3] {
        let is_mirror = |patch: &Patch<S>| patch.rule.kind().surface == SurfaceKind::Symmetry;
        let covers = |patch: &Patch<S>| {
            (0..3)
                .filter(|a| *a != patch.axis)
                .all(|a| patch.range[a][0] <= 0.0 && patch.range[a][1] >= real(cells[a]))
        };
        std::array::from_fn(|axis| {
            [false, true].map(|upper| {
                let stated = self.patches.iter().take(self.count() - FACES);
                let mut own = stated.filter(|patch| patch.axis == axis && patch.upper == upper);
                own.clone().any(covers) && own.all(is_mirror)
            })
        })
    }

    /// Returns the positions of the cells and ghost cells whose populations planes of symmetry mirror into cells of the
    /// slab; some occur more than once.
    pub(crate) fn mirrored_cells<'a>(
        &'a self,
        populations: &'a Populations<S>,
    ) -> impl Iterator<Item = u32> + 'a {
        let opposite = &populations.velocities().opposite;
        let begins: Vec<u32> = (0..opposite.len())
            .map(|i| links::first(populations, i))
            .collect();
        let runs = self.patches.iter().flat_map(|patch| patch.rule.mirrors());
        let mirrors = runs.flat_map(|run| run.mirrors());
        mirrors.map(move |mirror| mirror.cells(opposite, &begins)[0])
    }

    /// Returns the names of the patches, in the order of [`Boundaries::fluxes`].
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.patches.iter().map(|p| p.name.as_str())
    }

    /// Stores the data that the rules need before a pass.
    pub fn remember(&mut self, populations: &Populations<S>, half_force: [f64; 3]) {
        for patch in &mut self.patches {
            patch.rule.remember(populations, half_force);
        }
    }

    /// Returns `true` if the wall links of a plane may be applied as soon as the cells next to it have collided.
    /// Otherwise other rules read populations that the walls set, or ghosts next to them.
    #[must_use]
    pub fn walls_stand_alone(&self) -> bool {
        self.patches
            .iter()
            .all(|patch| patch.rule.walls_stand_alone())
    }

    /// Returns `true` if all rules are walls, so that [`Self::give_walls`] is sufficient in a step.
    #[must_use]
    pub fn are_walls(&self) -> bool {
        self.patches.iter().all(|patch| patch.rule.is_wall())
    }

    /// Sets the populations that return from the walls in a range of cells, ahead of [`Self::apply`].
    ///
    /// # Safety
    /// `numbers` must be those of the slab, in the order of `parity`, and no other thread may access these cells or
    /// their neighbours.
    pub(crate) unsafe fn give_walls(
        &self,
        cells: &RowBlock,
        step: f64,
        parity: Parity,
        numbers: *mut S,
    ) {
        let speed = |patch: usize| self.velocity_factor(patch, step);
        // SAFETY: forwarded from the caller: a link's numbers lie in the row of its cell or in an adjacent row.
        unsafe {
            self.walls.give(cells, speed, parity, numbers);
            for terms in &self.more_terms {
                terms.give(cells, speed, parity, numbers);
            }
        }
    }

    /// Returns the values that the rules keep between steps, by patch.
    pub fn memories(&self) -> impl Iterator<Item = Option<f64>> + '_ {
        self.patches.iter().map(|patch| patch.rule.memory())
    }

    /// Restores the values that the rules keep between steps.
    pub fn recall(&mut self, memories: impl Iterator<Item = Option<f64>>) {
        for (patch, memory) in self.patches.iter_mut().zip(memories) {
            patch.rule.recall(memory);
        }
    }

    /// Scales the velocities of openings to the stated discharges, because some links at the rim of an opening
    /// belong to walls. Collective.
    pub(super) fn balance(&mut self, communicator: &Communicator) {
        let given = self.patches.iter().map(|patch| patch.rule.given());
        let mut given: Vec<u128> = given.map(i128::cast_unsigned).collect();
        communicator.all_reduce_sum_u128s(&mut given);
        for (patch, given) in self.patches.iter_mut().zip(given) {
            patch.rule.balance(given.cast_signed());
        }
    }

    /// Sums over all ranks for the rules that need them. Collective.
    pub fn measure(
        &mut self,
        populations: &Populations<S>,
        step: f64,
        half_force: [f64; 3],
        communicator: &Communicator,
    ) {
        if self.summed.is_empty() {
            return;
        }
        let moment = RuleStep { step, half_force };
        let count = Sums::default().len();
        for (&patch, sums) in self.summed.iter().zip(self.sums.chunks_exact_mut(count)) {
            let measured = self.patches[patch].rule.measure(populations, &moment);
            for (sum, measured) in sums.iter_mut().zip(measured) {
                *sum = measured.cast_unsigned();
            }
        }
        communicator.all_reduce_sum_u128s(&mut self.sums);
        for (&patch, sums) in self.summed.iter().zip(self.sums.chunks_exact(count)) {
            let sums = std::array::from_fn(|n| sums[n].cast_signed());
            self.patches[patch].rule.receive_sums(sums, &moment);
        }
    }

    /// Sets every population that enters through a face, after [`Self::measure`]. `half_force` is F/2 of the body
    /// force. The walls of planes other than `planes` have already been applied.
    pub fn apply(
        &mut self,
        populations: &mut Populations<S>,
        step: f64,
        half_force: [f64; 3],
        planes: impl Iterator<Item = Range<usize>>,
    ) {
        let moment = RuleStep { step, half_force };
        // Pressure rules read whole cells and therefore precede weaker rules; the others access only the two
        // numbers of their links.
        for &patch in &self.order {
            self.patches[patch].rule.apply(populations, &moment);
        }
        let speed = |patch: usize| self.patches[patch].rule.factor(step);
        for planes in planes {
            self.walls.apply(planes.clone(), speed, populations);
            for terms in &self.more_terms {
                terms.apply(planes.clone(), speed, populations);
            }
        }
        for patch in &mut self.patches {
            patch.rule.apply_over_walls(populations, &moment);
        }
    }

    /// Passes the solid fractions of cells to the rules, before [`Self::measure`]: `fraction` is the solid fraction of
    /// a cell, by its position within an array and its indices in the slab. Earlier fractions are forgotten if `anew`.
    pub fn cover(&mut self, anew: bool, fraction: impl Fn(usize, [usize; 3]) -> f64) {
        let start = self.start;
        let fraction = |cell: usize, at: [usize; 3]| {
            fraction(cell, std::array::from_fn(|a| at[a].wrapping_sub(start[a])))
        };
        for patch in &mut self.patches {
            if anew {
                patch.rule.uncover();
            }
            patch.rule.cover(&fraction);
        }
    }

    /// Closes open faces at cells covered by solids, after [`Self::apply`]: `solid` is the solid in a cell, by its
    /// position within an array and its indices in the slab.
    pub fn close_covered(
        &self,
        solid: impl Fn(usize, [usize; 3]) -> SolidPart + Sync,
        populations: &mut Populations<S>,
    ) {
        self.open.close(solid, populations);
    }

    /// Returns the last step at which the ramp of a face still changes a value.
    #[must_use]
    pub fn ramps_end(&self) -> f64 {
        let ramps = self.patches.iter().map(|patch| patch.rule.ramp_end());
        ramps.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests;
