//! Structures on a lattice: their solid cells, and the links that their surfaces intersect.
//!
//! A cell is solid if its centre is inside. A link from a fluid cell that a surface cuts reflects at the
//! intersection ([`lbm::links::fixed`]), found from the chords of the solid along the link, so that even a sheet
//! thinner than a cell blocks water. The map is built once. It is a function of the shapes alone, independent of
//! the number of ranks.
//!
//! Populations inside solid cells are not part of the fluid. They are reset to the stationary state every
//! [`CLEARED`] steps, so that no body force accelerates them without limit.

mod feet;

use super::body_map::{BodyMap, GHOSTS, MapGrid};
use base::units::LatticeUnits;
use base::vector::norm;
use feet::Foot;
use lbm::boundary::FaceLoads;
use lbm::fluid::Fluid;
use lbm::lanes::Stored;
use lbm::links::AtStructure;
use lbm::links::fixed::{FixedLink, bounce_fixed};
use lbm::links::gaps::Gaps;
use lbm::links::mirrored::{MirroredLink, MirroredLoads, bounce_mirrored};
use lbm::links::{BodyLink, Load, Rigid, Scheme, add_force};
use lbm::populations::Populations;
use std::collections::HashSet;
use std::sync::Arc;
use structure::Images;

/// Steps after which the inside of the solids is reset.
const CLEARED: u64 = 64;
/// Number of links of one group.
const GROUP: usize = 2048;
/// Owner tag of fluid cells.
const WATER: u16 = 0;
/// Distance in cells from the middle of a link, or from a surface, that is attributed to rounding.
const HALF: f64 = 1e-9;

/// Group of links of one structure, or one link whose momentum acts on several.
#[derive(Clone, Debug)]
struct Group {
    structure: usize,
    /// Structure that receives the momentum along each axis.
    of_axes: [usize; 3],
    places: Vec<Ends>,
}

/// Positions, in the map, of the ends of a link and of the cells behind them, and their state without moving
/// bodies.
#[derive(Clone, Copy, Debug)]
struct Ends {
    cells: [u32; 2],
    behind: [u32; 2],
    wet: [bool; 2],
    kappa: [f64; 2],
}

/// Link cut by a surface: from a fluid cell along a direction.
#[derive(Clone, Copy, Debug)]
struct Cut {
    cells: [[i32; 3]; 2],
    direction: usize,
    structure: usize,
    /// Distances of the surface from both ends as fractions of the link.
    parts: [f64; 2],
}

/// Link through planes of symmetry that ends in the mirror image of a solid, or behind one.
#[derive(Clone, Copy, Debug)]
struct MirroredCut {
    cell: [i32; 3],
    direction: usize,
    structure: usize,
    /// Distance of the surface from the cell as a fraction of the link.
    part: f64,
}

/// Structures of one slab.
#[derive(Debug)]
pub struct StructureMap {
    solids: Vec<Arc<Images>>,
    grid: MapGrid,
    interpolated: bool,
    local: [i32; 3],
    dimension: usize,
    /// Index of the structure plus one, for each cell of the slab and of [`GHOSTS`] layers around it, x fastest; 0
    /// for fluid.
    owner: Vec<u16>,
    groups: Vec<Group>,
    links: Vec<Vec<FixedLink>>,
    /// Links through planes of symmetry of each structure, with the positions in the map of
    /// their cells and of the cells behind them.
    mirrored: Vec<(Vec<MirroredLink>, Vec<[u32; 2]>)>,
    group_loads: Vec<Load>,
    loads: Vec<Load>,
    /// Loads of the water on planes of symmetry at links into images of structures.
    plane_loads: FaceLoads,
    /// Positions in the lattice of the solid cells of the slab.
    inside: Vec<u32>,
    /// Links between two fluid cells that a sheet cuts: index of the cell, and direction.
    sheets: HashSet<(usize, u8)>,
    /// Links through faces next to structures.
    feet: Vec<Foot>,
}

impl StructureMap {
    /// Returns the map of the slab of `populations`; with `interpolated` links reflect at the surface, otherwise
    /// half-way.
    #[must_use]
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        grid: MapGrid,
        solids: Vec<Arc<Images>>,
        interpolated: bool,
    ) -> Self {
        let dimension = populations.velocities().dimension;
        let local = populations
            .cells()
            .map(|n| i32::try_from(n).unwrap_or(i32::MAX));
        let structures = solids.len();
        let mirrors = grid.mirrored.iter().flatten().any(|plane| *plane);
        let mut map = Self {
            solids,
            grid,
            interpolated,
            local,
            dimension,
            owner: Vec::new(),
            groups: Vec::new(),
            links: Vec::new(),
            mirrored: Vec::new(),
            group_loads: Vec::new(),
            loads: vec![[0; 6]; structures + usize::from(mirrors)],
            plane_loads: FaceLoads::default(),
            inside: Vec::new(),
            sheets: HashSet::new(),
            feet: Vec::new(),
        };
        if local.contains(&0) {
            return map;
        }
        let size = |a: usize| local[a] + 2 * map.ghosts(a);
        let count: i32 = (0..3).map(size).product();
        map.owner = vec![WATER; usize::try_from(count).unwrap_or(0)];
        let near = map.classify();
        let mirrored = map.mirrored_cuts(&near, populations);
        map.cut(&near, populations);
        map.mirror(&mirrored, populations);
        for (at, position) in populations.interior() {
            let cell = at.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
            if map.owner[map.position(cell)] != WATER {
                map.inside.push(u32::try_from(position).unwrap_or(u32::MAX));
            }
        }
        map.group_loads = vec![[0; 6]; map.links.len()];
        log::debug!(
            "{structures} structures: {} solid cells, {} links",
            map.inside.len(),
            map.links.iter().map(Vec::len).sum::<usize>()
        );
        map
    }

    /// Returns the structures in a fluid and closes openings in front of them; none if there are no structures.
    pub fn in_fluid<S: Stored>(
        fluid: &mut Fluid<S>,
        units: &LatticeUnits,
        solids: Vec<Arc<Images>>,
        interpolated: bool,
    ) -> Option<Box<Self>> {
        if solids.is_empty() {
            return None;
        }
        let grid = MapGrid {
            cells: fluid.domain_cells(),
            start: fluid.start(),
            periodic: fluid.periodic(),
            mirrored: fluid.planes_of_symmetry(),
            origin: [0.0; 3],
            spacing: units.spacing,
        };
        let mut map = Self::new(fluid.populations(), grid, solids, interpolated);
        map.find_feet(fluid.populations(), &fluid.straight_links());
        fluid.share_feet(map.shared_feet());
        let closed: Vec<usize> = map.positions(fluid.populations()).collect();
        fluid.close(closed.into_iter());
        let cut: Vec<_> = map.cut_at_planes(fluid.populations()).collect();
        fluid.cut_at_planes(cut.into_iter());
        if map.dimension == 2 {
            fluid.bound_velocities::<2>(&map.links);
        } else {
            fluid.bound_velocities::<3>(&map.links);
        }
        Some(Box::new(map))
    }

    /// Registers the surfaces with the gradients of the eddy viscosity, in addition to those already registered.
    pub fn register_links<S: Stored>(&self, fluid: &mut Fluid<S>) {
        if self.dimension == 2 {
            fluid.record_fixed_links::<2>(&self.links);
        } else {
            fluid.record_fixed_links::<3>(&self.links);
        }
    }

    /// Registers the solid cells and the cut links with the free surface, if there is one.
    pub fn bound_surface<S: Stored>(&self, fluid: &mut Fluid<S>) {
        let solid: Vec<usize> = self.positions(fluid.populations()).collect();
        let populations = fluid.populations();
        let opposite = populations.velocities().opposite.clone();
        let mut cut = Vec::new();
        for link in self.links.iter().flatten() {
            let forth = usize::from(link.direction);
            let back = opposite[forth];
            let near = link.link.near as usize - populations.slot(0, back);
            let far = link.link.far as usize - populations.slot(0, forth);
            cut.extend([(near, forth), (far, back)]);
        }
        if let Some(surface) = fluid.surface_mut() {
            surface.make_solid(solid.into_iter());
            for (cell, direction) in cut {
                surface.cut(cell, direction);
            }
        }
    }

    /// Returns the positions in the lattice of the solid cells of the slab and of its ghost cells.
    pub fn positions<'a, S: Stored>(
        &'a self,
        populations: &'a Populations<S>,
    ) -> impl Iterator<Item = usize> + 'a {
        let beside = |cell: &[i32; 3]| (0..3).all(|a| (-1..=self.local[a]).contains(&cell[a]));
        let cells = self.cells().filter(beside);
        cells.map(|cell| populations.cell(cell.map(|v| v as isize)))
    }

    fn ghosts(&self, axis: usize) -> i32 {
        if axis < self.dimension { GHOSTS } else { 0 }
    }

    /// Returns the index of a cell in the map, the same as in that of bodies.
    fn position(&self, cell: [i32; 3]) -> usize {
        let size = |a: usize| self.local[a] + 2 * self.ghosts(a);
        let k = |a: usize| cell[a] + self.ghosts(a);
        usize::try_from((k(2) * size(1) + k(1)) * size(0) + k(0)).unwrap_or(usize::MAX)
    }

    fn held(&self, cell: [i32; 3]) -> bool {
        (0..3).all(|a| (-self.ghosts(a)..self.local[a] + self.ghosts(a)).contains(&cell[a]))
    }

    fn interior(&self, cell: [i32; 3]) -> bool {
        (0..3).all(|a| (0..self.local[a]).contains(&cell[a]))
    }

    fn in_domain(&self, cell: [i32; 3]) -> bool {
        (0..self.dimension).all(|a| {
            let start = i32::try_from(self.grid.start[a]).unwrap_or(i32::MAX);
            let cells = i32::try_from(self.grid.cells[a]).unwrap_or(i32::MAX);
            self.grid.periodic[a] || (0..cells).contains(&(cell[a] + start))
        })
    }

    /// Returns the centre of a cell \[m\]. Images of a periodic domain have the same bits, because cells are
    /// counted from its lower corner.
    fn centre(&self, cell: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| {
            if a < self.dimension {
                let start = base::number::real(self.grid.start[a]);
                let cells = base::number::real(self.grid.cells[a]);
                let mut place = cell[a] + start + 0.5;
                if self.grid.periodic[a] {
                    place -= cells * (place / cells).floor();
                }
                self.grid.origin[a] + place * self.grid.spacing
            } else {
                0.0
            }
        })
    }

    /// Marks solid cells; returns the cells near a surface, whose links it may cut, in ascending order of
    /// positions.
    fn classify(&mut self) -> Vec<[i32; 3]> {
        let far = 1.01 * 3.0_f64.sqrt() * self.grid.spacing;
        let mut near = HashSet::new();
        let low: [i32; 3] = std::array::from_fn(|a| -self.ghosts(a));
        let high: [i32; 3] = std::array::from_fn(|a| self.local[a] + self.ghosts(a));
        for (n, solid) in self.solids.clone().iter().enumerate() {
            let tag = u16::try_from(n + 1).unwrap_or(u16::MAX);
            let mut boxes = vec![(low, high)];
            while let Some((low, high)) = boxes.pop() {
                let size: [i32; 3] = std::array::from_fn(|a| high[a] - low[a]);
                let one = size == [1; 3];
                // Boxes across a periodic face have no unique centre.
                let middle = self.centre(std::array::from_fn(|a| {
                    0.5 * f64::from(low[a] + high[a] - 1)
                }));
                let across = (0..self.dimension).any(|a| {
                    let start = i32::try_from(self.grid.start[a]).unwrap_or(i32::MAX);
                    let cells = i32::try_from(self.grid.cells[a]).unwrap_or(i32::MAX);
                    self.grid.periodic[a]
                        && (low[a] + start).div_euclid(cells)
                            != (high[a] - 1 + start).div_euclid(cells)
                });
                let distance = solid.distance(middle);
                let reach = (0..self.dimension)
                    .map(|a| (0.5 * f64::from(size[a]) * self.grid.spacing).powi(2))
                    .sum::<f64>()
                    .sqrt();
                let uniform = !across && distance.abs() > reach + far;
                if uniform && distance > 0.0 {
                    continue;
                }
                if uniform || one {
                    if one && distance.abs() <= far {
                        near.insert(low);
                    }
                    // A centre on a surface is water, whatever the rounding: a face through centres and its mirror
                    // image have the same cells.
                    if distance < -HALF * self.grid.spacing {
                        self.fill(low, high, tag);
                    }
                    continue;
                }
                let axis = (0..3).max_by_key(|&a| size[a]).unwrap_or(0);
                let mut half = low[axis] + size[axis] / 2;
                if across {
                    // The box is cut at a periodic face.
                    let a = axis;
                    let start = i32::try_from(self.grid.start[a]).unwrap_or(i32::MAX);
                    for face in [
                        -start,
                        i32::try_from(self.grid.cells[a]).unwrap_or(i32::MAX) - start,
                    ] {
                        if low[a] < face && face < high[a] {
                            half = face;
                        }
                    }
                }
                let (mut upper, mut lower) = (low, high);
                upper[axis] = half;
                lower[axis] = half;
                boxes.push((low, lower));
                boxes.push((upper, high));
            }
        }
        let mut near: Vec<[i32; 3]> = near.into_iter().collect();
        near.sort_unstable_by_key(|cell| self.position(*cell));
        near
    }

    /// Assigns the cells of a box that belong to no structure to one.
    fn fill(&mut self, low: [i32; 3], high: [i32; 3], tag: u16) {
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                for x in low[0]..high[0] {
                    let place = self.position([x, y, z]);
                    if self.owner[place] == WATER {
                        self.owner[place] = tag;
                    }
                }
            }
        }
    }

    /// Returns the first intersection of the surfaces with a link from the centre of a cell: the structure, and the
    /// distances from both ends as fractions of the link.
    fn crossing(
        &self,
        cell: [i32; 3],
        c: [i32; 3],
        found: &mut Vec<[f64; 2]>,
    ) -> Option<(usize, [f64; 2])> {
        let from = self.centre(cell.map(f64::from));
        let along = c.map(|c| f64::from(c) * self.grid.spacing);
        self.cut_of_line(from, along, found)
    }

    /// Returns the first intersection of the surfaces with a line, like [`Self::crossing`].
    fn cut_of_line(
        &self,
        from: [f64; 3],
        along: [f64; 3],
        found: &mut Vec<[f64; 2]>,
    ) -> Option<(usize, [f64; 2])> {
        let length = norm(along);
        let mut best: Option<(usize, [f64; 2])> = None;
        for (n, solid) in self.solids.iter().enumerate() {
            if solid.distance(from) > length {
                continue;
            }
            solid.chords(from, along, found);
            if let (Some(first), Some(last)) = (found.first(), found.last()) {
                let ends = [first[0], 1.0 - last[1]];
                best = Some(match best {
                    None => (n, ends),
                    Some((other, known)) => {
                        let who = if ends[0] < known[0] { n } else { other };
                        (who, [known[0].min(ends[0]), known[1].min(ends[1])])
                    }
                });
            }
        }
        best
    }

    /// Finds the links cut by surfaces, each once; records those between two fluid cells.
    fn cuts<S: Stored>(&mut self, near: &[[i32; 3]], populations: &Populations<S>) -> Vec<Cut> {
        let velocities = populations.velocities();
        let mut found = Vec::new();
        let mut cuts = Vec::new();
        for &cell in near {
            if self.owner[self.position(cell)] != WATER || !self.in_domain(cell) {
                continue;
            }
            for i in 1..velocities.q() {
                let c = velocities.c[i].map(i32::from);
                let next: [i32; 3] = std::array::from_fn(|a| cell[a] + c[a]);
                if !self.held(next) || !self.in_domain(next) {
                    continue;
                }
                let there = self.owner[self.position(next)];
                // The bits of a cut do not depend on the end from which it is computed.
                let crossing = if there != WATER || i < velocities.opposite[i] {
                    self.crossing(cell, c, &mut found)
                } else {
                    self.crossing(next, c.map(|c| -c), &mut found)
                        .map(|(n, [a, b])| (n, [b, a]))
                };
                let (structure, parts) = match (there, crossing) {
                    (WATER, None) => continue,
                    (WATER, Some(crossing)) => {
                        let direction = u8::try_from(i).unwrap_or(0);
                        self.sheets.insert((self.position(cell), direction));
                        if velocities.opposite[i] < i {
                            continue;
                        }
                        crossing
                    }
                    (tag, crossing) => (
                        usize::from(tag) - 1,
                        crossing.map_or([0.5; 2], |(_, parts)| parts),
                    ),
                };
                if self.interior(cell) || self.interior(next) {
                    cuts.push(Cut {
                        cells: [cell, next],
                        direction: i,
                        structure,
                        parts,
                    });
                }
            }
        }
        cuts
    }

    /// Lists the links cut by surfaces.
    fn cut<S: Stored>(&mut self, near: &[[i32; 3]], populations: &Populations<S>) {
        let velocities = populations.velocities();
        // All sheets must be known first: the cell behind a link must not be cut off.
        let cuts = self.cuts(near, populations);
        let mut by_structure: Vec<(Vec<FixedLink>, Vec<Ends>)> =
            self.solids.iter().map(|_| Default::default()).collect();
        for cut in cuts {
            let i = cut.direction;
            let c = velocities.c[i].map(i32::from);
            let directions = [velocities.opposite[i], i];
            let mut ends = Ends {
                cells: (cut.cells)
                    .map(|cell| u32::try_from(self.position(cell)).unwrap_or(u32::MAX)),
                behind: [0; 2],
                wet: [false; 2],
                kappa: [0.0; 2],
            };
            for end in 0..2 {
                let own = cut.cells[end];
                if self.owner[self.position(own)] != WATER || !self.interior(own) {
                    continue;
                }
                ends.wet[end] = true;
                let away = if end == 0 { -1 } else { 1 };
                let behind: [i32; 3] = std::array::from_fn(|a| own[a] + away * c[a]);
                let direction = u8::try_from(directions[end]).unwrap_or(0);
                let open =
                    self.is_open(behind) && !self.sheets.contains(&(self.position(own), direction));
                let q = cut.parts[end].clamp(0.0, 1.0);
                if self.interpolated && open && (q - 0.5).abs() > HALF {
                    ends.kappa[end] = (1.0 - 2.0 * q) / (1.0 + 2.0 * q);
                    let water = self.grid.image(self.dimension, behind).unwrap_or(behind);
                    ends.behind[end] = u32::try_from(self.position(water)).unwrap_or(u32::MAX);
                }
            }
            let cell = cut.cells[0];
            let start = |a: usize| i32::try_from(self.grid.start[a]).unwrap_or(i32::MAX);
            let link = FixedLink {
                link: populations.link(populations.cell(cell.map(|v| v as isize)), i),
                middle: std::array::from_fn(|a| {
                    if a < self.dimension {
                        2 * (cell[a] + start(a)) + 1 + c[a]
                    } else {
                        0
                    }
                }),
                direction: u8::try_from(i).unwrap_or(0),
                wet: ends.wet,
                kappa: ends.kappa,
            };
            let of_axes = self.structures_of_axes(&cut, c);
            if of_axes == [cut.structure; 3] {
                by_structure[cut.structure].0.push(link);
                by_structure[cut.structure].1.push(ends);
            } else {
                self.links.push(vec![link]);
                self.groups.push(Group {
                    structure: cut.structure,
                    of_axes,
                    places: vec![ends],
                });
            }
        }
        for (structure, (links, ends)) in by_structure.iter().enumerate() {
            for (links, ends) in links.chunks(GROUP).zip(ends.chunks(GROUP)) {
                self.links.push(links.to_vec());
                self.groups.push(Group {
                    structure,
                    of_axes: [structure; 3],
                    places: ends.to_vec(),
                });
            }
        }
    }

    /// Returns the structures that receive the momentum along each axis of a link along `c`.
    ///
    /// In the corner between two structures a link crosses both. Like that at the foot of a structure ([`feet`]), it
    /// acts along an axis on the structure that lies there. Without one it is tangential to the structures that it
    /// meets, and acts on the first of them: on a flat face across two structures the tangential parts of the two
    /// links through the seam then cancel.
    fn structures_of_axes(&self, cut: &Cut, c: [i32; 3]) -> [usize; 3] {
        let [cell, next] = cut.cells;
        if self.owner[self.position(next)] == WATER {
            return [cut.structure; 3];
        }
        let beside = |a: usize| {
            let mut beside = cell;
            beside[a] += c[a];
            let tag = self.owner[self.position(beside)];
            (c[a] != 0 && tag != WATER).then(|| usize::from(tag) - 1)
        };
        let met = (0..self.dimension).filter_map(beside);
        let first = met.fold(cut.structure, usize::min);
        std::array::from_fn(|a| {
            let own = if a < self.dimension { beside(a) } else { None };
            own.unwrap_or(first)
        })
    }

    /// Lists the links through planes of symmetry that end in the mirror image of a solid.
    fn mirror<S: Stored>(&mut self, cuts: &[MirroredCut], populations: &Populations<S>) {
        if self.loads.len() == self.solids.len() {
            return;
        }
        let velocities = populations.velocities();
        let mut lists = vec![(Vec::new(), Vec::new()); self.solids.len()];
        for cut in cuts {
            let c = velocities.c[cut.direction].map(i32::from);
            let start = |a: usize| i32::try_from(self.grid.start[a]).unwrap_or(i32::MAX);
            // A link that a sheet cuts before the plane acts on the sheet alone. In the corner between the plane and
            // a cell of a structure it acts on both.
            let next = std::array::from_fn(|a| cut.cell[a] + c[a]);
            let image = self.grid.image(self.dimension, next);
            let sheet = image.is_none_or(|image| self.owner[self.position(image)] == WATER);
            let hits = if cut.part < 0.5 && sheet {
                c
            } else {
                self.turned(cut.cell, c)
            };
            let acts = velocities.c.iter().position(|v| v.map(i32::from) == hits);
            let number = |direction: usize| u8::try_from(direction).unwrap_or(0);
            let cell = populations.cell(cut.cell.map(|v| v as isize));
            let behind: [i32; 3] = std::array::from_fn(|a| cut.cell[a] - c[a]);
            let back = number(velocities.opposite[cut.direction]);
            let open =
                self.is_open(behind) && !self.sheets.contains(&(self.position(cut.cell), back));
            let interpolates = self.interpolated && open && (cut.part - 0.5).abs() > HALF;
            let kappa = (1.0 - 2.0 * cut.part) / (1.0 + 2.0 * cut.part);
            let half = BodyLink {
                link: populations.link(cell, cut.direction),
                middle: std::array::from_fn(|a| {
                    if a < self.dimension {
                        2 * (cut.cell[a] + start(a)) + 1 + c[a]
                    } else {
                        0
                    }
                }),
                direction: number(acts.unwrap_or(0)),
                loads: true,
                backed: interpolates,
            };
            let (links, places) = &mut lists[cut.structure];
            links.push(MirroredLink {
                half,
                leaves: number(cut.direction),
                gap: None,
                kappa: Some(if interpolates { kappa } else { 0.0 }),
            });
            let place = |cell| u32::try_from(self.position(cell)).unwrap_or(u32::MAX);
            let water = self.grid.image(self.dimension, behind).unwrap_or(behind);
            places.push([
                place(cut.cell),
                place(if interpolates { water } else { cut.cell }),
            ]);
        }
        self.mirrored = lists;
    }

    /// Reflects populations on the links through planes of symmetry and adds their loads.
    fn bounce_at_planes<S: Stored>(&mut self, populations: &mut Populations<S>) {
        let (still, gaps) = (Rigid::default(), &Gaps::default());
        let (mut planes, mut all) = ([0; 3], MirroredLoads::default());
        for ((links, _), sum) in self.mirrored.iter().zip(&mut self.loads) {
            let mut own = MirroredLoads::default();
            let scheme = Scheme::HalfWay;
            if self.dimension == 2 {
                bounce_mirrored::<S, 2>(populations, scheme, links, gaps, &still, &[], &mut own);
            } else {
                bounce_mirrored::<S, 3>(populations, scheme, links, gaps, &still, &[], &mut own);
            }
            for a in 0..6 {
                sum[a] += own.body[a];
            }
            for a in 0..3 {
                planes[a] -= own.body[a];
            }
            all.add_planes(&own.planes);
        }
        self.plane_loads = all.planes;
        // The momentum that the planes receive instead of the images of the structures.
        if let Some(last) = self.loads.get_mut(self.solids.len()) {
            last[..3].copy_from_slice(&planes);
        }
    }

    /// Returns `true` if a cell is water of the domain or the image of such a cell across planes of symmetry.
    fn is_open(&self, cell: [i32; 3]) -> bool {
        let inside = self.in_domain(cell).then_some(cell);
        let at = inside.or_else(|| self.grid.image(self.dimension, cell));
        self.held(cell)
            && at.is_some_and(|at| self.held(at) && self.owner[self.position(at)] == WATER)
    }

    /// Returns a direction from a cell with its components through planes of symmetry reversed.
    fn turned(&self, cell: [i32; 3], c: [i32; 3]) -> [i32; 3] {
        let next: [i32; 3] = std::array::from_fn(|a| cell[a] + c[a]);
        let image = self.grid.image(self.dimension, next).unwrap_or(next);
        std::array::from_fn(|a| if image[a] == next[a] { c[a] } else { -c[a] })
    }

    /// Finds the links from cells of water of the slab through planes of symmetry whose image a surface cuts; records
    /// those between two fluid cells.
    fn mirrored_cuts<S: Stored>(
        &mut self,
        near: &[[i32; 3]],
        populations: &Populations<S>,
    ) -> Vec<MirroredCut> {
        let velocities = populations.velocities();
        let (mut found, mut cuts) = (Vec::new(), Vec::new());
        for &cell in near {
            if self.owner[self.position(cell)] != WATER || !self.in_domain(cell) {
                continue;
            }
            for direction in 1..velocities.q() {
                let c = velocities.c[direction].map(i32::from);
                let next = std::array::from_fn(|a| cell[a] + c[a]);
                let Some(image) = self.grid.image(self.dimension, next) else {
                    continue;
                };
                if !self.held(image) {
                    continue;
                }
                // The line to the plane, and that from there to the image.
                let half = |c: [i32; 3]| c.map(|c| 0.5 * f64::from(c) * self.grid.spacing);
                let (from, along) = (self.centre(cell.map(f64::from)), half(c));
                let plane = std::array::from_fn(|a| from[a] + along[a]);
                let first = self.cut_of_line(from, along, &mut found);
                let first = first.map(|(n, [part, _])| (n, 0.5 * part));
                let cut = first.or_else(|| {
                    let second = self.cut_of_line(plane, half(self.turned(cell, c)), &mut found);
                    second.map(|(n, [part, _])| (n, 0.5 + 0.5 * part))
                });
                let cut = match self.owner[self.position(image)] {
                    WATER => cut,
                    tag => Some((usize::from(tag) - 1, cut.map_or(0.5, |(_, part)| part))),
                };
                if cut.is_some() && self.owner[self.position(image)] == WATER {
                    let number = u8::try_from(direction).unwrap_or(0);
                    self.sheets.insert((self.position(cell), number));
                }
                let cut = cut.filter(|_| self.interior(cell));
                cuts.extend(cut.map(|(structure, part)| MirroredCut {
                    cell,
                    direction,
                    structure,
                    part,
                }));
            }
        }
        cuts
    }

    /// Returns `true` if the centre of a cell of the slab is in a structure (local coordinates).
    #[must_use]
    pub fn holds(&self, cell: [usize; 3]) -> bool {
        let cell = cell.map(|v| i32::try_from(v).unwrap_or(i32::MAX));
        self.owner[self.position(cell)] != WATER
    }

    /// Returns the solid cells of the slab and of the ghost layers around it.
    pub fn cells(&self) -> impl Iterator<Item = [i32; 3]> + '_ {
        let range = |a: usize| -self.ghosts(a)..self.local[a] + self.ghosts(a);
        let all = range(2)
            .flat_map(move |z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z])));
        all.filter(|cell| !self.owner.is_empty() && self.owner[self.position(*cell)] != WATER)
    }

    /// Returns the links between two fluid cells that a sheet cuts, by the index of a cell in the map and the
    /// direction.
    #[must_use]
    pub fn sheets(&self) -> &HashSet<(usize, u8)> {
        &self.sheets
    }

    /// Reflects populations on all links and sums the loads of this step, without those at feet.
    pub fn bounce<S: Stored>(&mut self, populations: &mut Populations<S>) {
        self.group_loads.fill([0; 6]);
        if self.dimension == 2 {
            bounce_fixed::<S, 2>(populations, &self.links, &mut self.group_loads);
        } else {
            bounce_fixed::<S, 3>(populations, &self.links, &mut self.group_loads);
        }
        self.loads.fill([0; 6]);
        let loads = std::mem::take(&mut self.group_loads);
        for (n, load) in loads.iter().enumerate() {
            let Group {
                structure, of_axes, ..
            } = self.groups[n];
            if of_axes == [structure; 3] {
                for (sum, part) in self.loads[structure].iter_mut().zip(load) {
                    *sum += part;
                }
            } else {
                let force = std::array::from_fn(|a| i64::try_from(load[a]).unwrap_or(0));
                self.add_by_axis(of_axes, force, self.links[n][0].middle);
            }
        }
        self.group_loads = loads;
        self.bounce_at_planes(populations);
    }

    /// Adds a force, in quanta, to the load of the structure at a place that bodies share with it.
    pub(super) fn receive(&mut self, at: AtStructure, force: [i64; 3]) {
        let tags = at.places.map(|place| self.owner[place as usize]);
        let tag = tags.into_iter().filter(|tag| *tag != WATER).min();
        if let Some(tag) = tag {
            self.add_by_axis([usize::from(tag) - 1; 3], force, at.middle);
        }
    }

    /// Adds each component of a force, in quanta, at a point in half cells to the structure of its axis.
    fn add_by_axis(&mut self, of_axes: [usize; 3], force: [i64; 3], at: [i32; 3]) {
        for (a, structure) in of_axes.into_iter().enumerate() {
            let mut along = [0; 3];
            along[a] = force[a];
            let load = &mut self.loads[structure];
            if self.dimension == 2 {
                add_force::<2>(load, along, at);
            } else {
                add_force::<3>(load, along, at);
            }
        }
    }

    /// Returns the loads of the last step on each structure by the links of this slab: force, and twice the moment
    /// about the lower corner of the domain. The sum over ranks is exact. With planes of symmetry the last entry is the
    /// load on the planes in place of the images of structures, for the balance of the momentum.
    #[must_use]
    pub fn loads(&self) -> &[Load] {
        &self.loads
    }

    /// Returns the links from cells of water through planes of symmetry that structures or their images cut, by
    /// position of the cell and direction.
    fn cut_at_planes<'a, S: Stored>(
        &'a self,
        populations: &'a Populations<S>,
    ) -> impl Iterator<Item = (u32, u8)> + 'a {
        let opposite = &populations.velocities().opposite;
        self.mirrored
            .iter()
            .flat_map(|(links, _)| links)
            .map(|link| {
                let back = opposite[usize::from(link.leaves)];
                let cell = link.half.link.near as usize - populations.slot(0, back);
                (u32::try_from(cell).unwrap_or(u32::MAX), link.leaves)
            })
    }

    /// Returns the loads of the water on planes of symmetry in the last step, at links into images of structures.
    #[must_use]
    pub fn plane_loads(&self) -> FaceLoads {
        self.plane_loads
    }

    /// Updates which ends of links moving bodies cover.
    pub fn update_covered_ends(&mut self, bodies: &BodyMap) {
        for (links, group) in self.links.iter_mut().zip(&self.groups) {
            for (link, ends) in links.iter_mut().zip(&group.places) {
                for end in 0..2 {
                    let wet = ends.wet[end] && bodies.is_water(ends.cells[end]);
                    let backed = ends.behind[end] > 0 && bodies.is_water(ends.behind[end]);
                    link.wet[end] = wet;
                    link.kappa[end] = if wet && backed { ends.kappa[end] } else { 0.0 };
                }
            }
        }
        self.update_feet(|cell| bodies.is_water(cell));
        for (links, places) in &mut self.mirrored {
            for (link, [own, behind]) in links.iter_mut().zip(places) {
                link.half.loads = bodies.is_water(*own);
                link.half.backed = link.half.loads && bodies.is_water(*behind);
            }
        }
    }

    /// Resets the fluid inside the solids at intervals.
    pub fn clear<S: Stored>(&self, fluid: &mut Fluid<S>) {
        if fluid.steps().is_multiple_of(CLEARED) {
            for &cell in &self.inside {
                fluid.set_equilibrium(cell as usize, 0.0, [0.0; 3]);
            }
        }
    }
}
