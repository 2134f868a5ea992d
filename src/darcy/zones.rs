//! Permeability and porosity by zone: layers, boxes and rasters of values, in addition to those that follow from
//! the grains.
//!
//! Cells cut by boundaries of zones are divided into boxes, exactly. Each box has its own permeability K. The cell
//! then has one permeability along each axis:
//!
//! ```text
//! harmonic   along a: sum over columns w_bc / (sum_a w_a/K)         lower bound: no flow from column to column
//! arithmetic along a: 1 / sum_a [w_a / (sum over slices w_bc K)]    upper bound: no loss within a slice
//! K_a = sqrt(harmonic arithmetic)
//! ```
//!
//! (W. T. Cardwell and R. L. Parsons, Trans. AIME 160 (1945) 34; their geometric mean after G. Le Loc'h 1987; see
//! P. Renard and G. de Marsily, Adv. Water Resour. 20 (1997) 253.) If a cell is cut normal to one axis only, both
//! bounds agree: the harmonic mean across the layers and the arithmetic mean along them. With the harmonic mean of
//! two cells at their face the flow across and along layers is then that of J. Bear, Dynamics of Fluids in Porous
//! Media (1972), section 5.8, wherever the boundaries lie:
//!
//! ```text
//! across: H/K = sum H_i/K_i          along: H K = sum H_i K_i
//! ```

use super::Liquid;
use super::grid::SeepageGrid;
use super::resistance::{BedOfCells, Resistance, ResistanceFormula, larger};
use std::collections::BTreeMap;

/// Permeability of a zone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// Stated permeability \[m2\].
    Value(f64),
    /// Permeability of the grains times a factor.
    Factor(f64),
    /// Permeability of the grains by another law.
    Law(Resistance),
}

/// Values at the nodes of a rectangular raster. The values of a node apply to all points that are closer to it than
/// to any other along each axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Coordinates of the nodes along each axis, ascending \[m\]; one along z in 2-D.
    pub nodes: [Vec<f64>; 3],
    /// Permeability of each node \[m²\], or the factor by which it is multiplied, x fastest; empty if the raster has
    /// none.
    pub permeability: Vec<Rule>,
    /// Porosity of each node, x fastest; empty if the raster has none.
    pub porosity: Vec<f64>,
}

impl Raster {
    /// Returns the planes half way between nodes along an axis.
    fn planes(&self, axis: usize) -> impl Iterator<Item = f64> {
        let pairs = self.nodes[axis].windows(2);
        pairs.map(|pair| pair[0] + 0.5 * (pair[1] - pair[0]))
    }

    /// Returns the node whose values apply at a point.
    fn node(&self, point: [f64; 3]) -> usize {
        let place = |a: usize| {
            let nodes = &self.nodes[a];
            let middle = |n: usize| nodes[n] + 0.5 * (nodes[n + 1] - nodes[n]);
            // Binary search for the last plane at or below the point.
            let (mut low, mut high) = (0, nodes.len() - 1);
            while low < high {
                let n = usize::midpoint(low, high);
                if middle(n) <= point[a] {
                    low = n + 1;
                } else {
                    high = n;
                }
            }
            low
        };
        (place(2) * self.nodes[1].len() + place(1)) * self.nodes[0].len() + place(0)
    }
}

/// Zone with its own permeability or porosity.
#[derive(Clone, Debug, PartialEq)]
pub struct SoilZone {
    /// Lower corner \[m\]; infinite along unbounded axes.
    pub from: [f64; 3],
    /// Upper corner \[m\].
    pub to: [f64; 3],
    /// Corners of a polygon that bounds the zone in 2-D \[m\]; empty if the zone is the box.
    pub polygon: Vec<[f64; 2]>,
    /// Permeability; none if that of the grains is used.
    pub permeability: Option<Rule>,
    /// Porosity; none if that of the grains is used.
    pub porosity: Option<f64>,
    /// Values that vary within the zone.
    pub raster: Option<Raster>,
    /// Ratio of the permeability along each axis to the stated one.
    pub directions: [f64; 3],
    /// Ratio of the cross term of the permeability to the stated one, for inclined bedding in 2-D.
    pub shear: f64,
    /// `true` if the zone also applies in cells without grains.
    pub without_grains: bool,
}

impl SoilZone {
    fn contains(&self, point: [f64; 3]) -> bool {
        (0..3).all(|a| point[a] >= self.from[a] && point[a] < self.to[a])
            && (self.polygon.is_empty() || is_inside(&self.polygon, [point[0], point[1]]))
    }

    fn rule(&self, node: Option<usize>) -> Option<Rule> {
        let varies = self.raster.as_ref().zip(node);
        let there = varies.and_then(|(raster, node)| raster.permeability.get(node).copied());
        there.or(self.permeability)
    }

    fn pores(&self, node: Option<usize>) -> Option<f64> {
        let varies = self.raster.as_ref().zip(node);
        let there = varies.and_then(|(raster, node)| raster.porosity.get(node).copied());
        there.or(self.porosity)
    }
}

/// Values that zones state at a point, each with a flag that is `true` if the value applies without grains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    permeability: Option<(Rule, bool)>,
    porosity: Option<(f64, bool)>,
    directions: [f64; 3],
    shear: f64,
}

impl Default for Medium {
    fn default() -> Self {
        Self {
            permeability: None,
            porosity: None,
            directions: [1.0; 3],
            shear: 0.0,
        }
    }
}

impl Medium {
    /// Returns the porosity stated by a zone; `grains` is `true` if there are grains.
    #[must_use]
    pub fn porosity(&self, grains: bool) -> Option<f64> {
        let stated = self.porosity.filter(|(_, without)| grains || *without);
        stated.map(|(porosity, _)| porosity)
    }

    /// Returns `true` if a permeability is stated that needs no grains.
    fn fills(&self) -> bool {
        matches!(self.permeability, Some((Rule::Value(_), true)))
    }

    /// Returns `true` if the zone applies without grains.
    fn applies_without_grains(&self) -> bool {
        self.permeability.is_some_and(|(_, without)| without)
            || self.porosity.is_some_and(|(_, without)| without)
    }

    /// Returns the permeability \[m²\] of a bed with this porosity (unless the zone states one) and mean diameter
    /// \[m\], under a gradient \[Pa/m\]; `law` is the law outside zones; `grains` is `true` if there are grains.
    #[must_use]
    pub fn permeability(
        &self,
        law: &dyn ResistanceFormula,
        (porosity, diameter): (f64, f64),
        liquid: Liquid,
        gradient: f64,
        grains: bool,
    ) -> f64 {
        let porosity = self.porosity(grains).unwrap_or(porosity);
        let rule = self.permeability.filter(|(_, without)| grains || *without);
        let by =
            |law: &dyn ResistanceFormula| law.permeability(porosity, diameter, liquid, gradient);
        match rule.map(|(rule, _)| rule) {
            Some(Rule::Value(value)) => value,
            Some(Rule::Factor(factor)) => factor * by(law),
            Some(Rule::Law(own)) => by(own.model()),
            None => by(law),
        }
    }
}

/// Cell within zones, divided into boxes.
#[derive(Clone, Debug, PartialEq)]
struct Divided {
    cell: usize,
    /// Number of boxes along each axis.
    counts: [usize; 3],
    /// Start, in [`Zones::lengths`], of the lengths of the boxes along x, then y, then z, each relative to the
    /// cell.
    lengths: usize,
    /// Start, in [`Zones::media_of`], of the media of the boxes, x fastest.
    media: usize,
}

/// Zones on a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Zones {
    dimension: usize,
    cells: Vec<Divided>,
    lengths: Vec<f64>,
    media_of: Vec<u32>,
    /// Media; the first one is that of the grains.
    media: Vec<Medium>,
    cut: usize,
    /// Number of cells that each zone contains at least in part.
    reached: Vec<usize>,
}

impl Zones {
    /// Returns the zones with the cells of a grid divided at their boundaries. A later zone takes precedence in its
    /// stated values.
    #[must_use]
    pub fn new(grid: &SeepageGrid, zones: &[SoilZone]) -> Self {
        let mut all = Self {
            dimension: grid.dimension,
            cells: Vec::new(),
            lengths: Vec::new(),
            media_of: Vec::new(),
            media: vec![Medium::default()],
            cut: 0,
            reached: vec![0; zones.len()],
        };
        let planes: [Vec<f64>; 3] = std::array::from_fn(|a| planes(grid, zones, a));
        let mut known = BTreeMap::new();
        let mut edges: [Vec<f64>; 3] = Default::default();
        let mut boxes = Vec::new();
        let mut seen = vec![usize::MAX; zones.len()];
        for index in 0..grid.count() {
            let cell = grid.cell(index);
            for (a, edges) in edges.iter_mut().enumerate() {
                divide(grid, a, cell[a], &planes[a], edges);
            }
            if zones
                .iter()
                .any(|zone| edge_crosses(&zone.polygon, grid, cell))
            {
                edges[..2].iter_mut().for_each(subdivide);
            }
            let counts: [usize; 3] = std::array::from_fn(|a| edges[a].len() - 1);
            boxes.clear();
            for n in 0..counts.iter().product() {
                let place = [
                    n % counts[0],
                    n / counts[0] % counts[1],
                    n / (counts[0] * counts[1]),
                ];
                let mut centre: [f64; 3] = std::array::from_fn(|a| {
                    edges[a][place[a]] + 0.5 * (edges[a][place[a] + 1] - edges[a][place[a]])
                });
                if grid.dimension == 2 {
                    centre[2] = 0.0;
                }
                boxes.push(all.medium(zones, centre, &mut known, (&mut seen, index)));
            }
            if boxes.iter().all(|medium| *medium == 0) {
                continue;
            }
            let whole = boxes.iter().all(|medium| *medium == boxes[0]);
            all.cut += usize::from(!whole);
            let (lengths, media) = (all.lengths.len(), all.media_of.len());
            let counts = if whole { [1; 3] } else { counts };
            if whole {
                all.lengths.extend([1.0; 3]);
                all.media_of.push(boxes[0]);
            } else {
                for edges in &edges {
                    let length = edges[edges.len() - 1] - edges[0];
                    let parts = edges.windows(2).map(|pair| (pair[1] - pair[0]) / length);
                    all.lengths.extend(parts);
                }
                all.media_of.extend(&boxes);
            }
            all.cells.push(Divided {
                cell: index,
                counts,
                lengths,
                media,
            });
        }
        all
    }

    /// Returns the medium of a point.
    fn medium(
        &mut self,
        zones: &[SoilZone],
        point: [f64; 3],
        known: &mut BTreeMap<[u64; 2], u32>,
        (seen, cell): (&mut [usize], usize),
    ) -> u32 {
        let mut medium = Medium::default();
        // Key of the medium: for each value the zone that states it, and the node of its raster, counted from 1.
        let mut from = [0; 2];
        for (n, zone) in zones.iter().enumerate() {
            if !zone.contains(point) {
                continue;
            }
            if seen[n] != cell {
                seen[n] = cell;
                self.reached[n] += 1;
            }
            let node = zone.raster.as_ref().map(|raster| raster.node(point));
            let key = ((n as u64 + 1) << 40) + node.map_or(0, |node| node as u64 + 1);
            if let Some(rule) = zone.rule(node) {
                medium.permeability = Some((rule, zone.without_grains));
                medium.directions = zone.directions;
                medium.shear = zone.shear;
                from[0] = key;
            }
            if let Some(porosity) = zone.pores(node) {
                medium.porosity = Some((porosity, zone.without_grains));
                from[1] = key;
            }
        }
        if from == [0; 2] {
            return 0;
        }
        *known.entry(from).or_insert_with(|| {
            self.media.push(medium);
            base::number::to_u32(self.media.len() - 1)
        })
    }

    /// Returns the number of cells cut by a zone boundary.
    #[must_use]
    pub fn cut(&self) -> usize {
        self.cut
    }

    /// Returns the number of cells that each zone contains at least in part.
    #[must_use]
    pub fn reached(&self) -> &[usize] {
        &self.reached
    }

    /// Returns the fraction of each cell in zones that apply without grains.
    #[must_use]
    pub fn filled(&self, cells: usize) -> Vec<f64> {
        let mut filled = vec![0.0; cells];
        for divided in &self.cells {
            filled[divided.cell] = self.part(divided, Medium::fills);
        }
        filled
    }

    /// Returns the fraction of a cell whose medium satisfies `kind`.
    fn part(&self, divided: &Divided, kind: impl Fn(&Medium) -> bool) -> f64 {
        let ([x, y, z], media) = self.boxes(divided);
        let mut media = media.iter();
        let mut part = 0.0;
        for c in z {
            for b in y {
                for a in x {
                    let is = media.next().is_some_and(|m| kind(&self.media[*m as usize]));
                    part += if is { a * b * c } else { 0.0 };
                }
            }
        }
        part
    }

    /// Returns `true` if the zones state nothing except permeabilities that need no grains.
    #[must_use]
    pub fn need_no_grains(&self) -> bool {
        self.media.len() > 1 && self.media[1..].iter().all(Medium::fills)
    }

    /// Returns all media that occur on the grid, including that of the grains if a cell is outside all zones.
    pub fn media(&self, cells: usize) -> impl Iterator<Item = &Medium> {
        let outside = self.cells.len() < cells || self.media_of.contains(&0);
        self.media[usize::from(!outside)..].iter()
    }

    /// Returns `true` if some cell has an anisotropic permeability.
    fn directed(&self) -> bool {
        let differs = |medium: &Medium| medium.directions.iter().any(|d| d.total_cmp(&1.0).is_ne());
        self.cut > 0 || self.media.iter().any(differs)
    }

    /// Returns the cross term of the permeability of each cell divided by the geometric mean of those along the
    /// axes; empty without inclined bedding. In a cell cut by a boundary it is the mean over its boxes, so that
    /// layers at an angle to the grid converge with the cells.
    #[must_use]
    pub fn shears(&self, cells: usize) -> Vec<f64> {
        if self.media.iter().all(|medium| medium.shear == 0.0) {
            return Vec::new();
        }
        let mut shears = vec![0.0; cells];
        let stated = |medium: &Medium| match medium.permeability {
            Some((Rule::Value(value), _)) => value,
            _ => 0.0,
        };
        for divided in &self.cells {
            let (lengths, media) = self.boxes(divided);
            let media: Vec<&Medium> = media.iter().map(|m| &self.media[*m as usize]).collect();
            let mut along = [1.0; 3];
            for (axis, along) in along.iter_mut().enumerate().take(self.dimension) {
                let boxes = media.iter().map(|m| stated(m) * m.directions[axis]);
                *along = effective(axis, lengths, &boxes.collect::<Vec<_>>());
            }
            let [x, y, z] = lengths;
            let mut each = media.iter();
            let mut cross = 0.0;
            for c in z {
                for b in y {
                    for (a, medium) in x.iter().zip(&mut each) {
                        cross += a * b * c * stated(medium) * medium.shear;
                    }
                }
            }
            // The tensor must be positive definite.
            let most = LARGEST_CROSS * (along[0] * along[1]).sqrt();
            let mean = geometric_mean(along, self.dimension);
            if mean > 0.0 {
                shears[divided.cell] = cross.clamp(-most, most) / mean;
            }
        }
        shears
    }

    /// Returns `true` if a zone has a law that depends on the gradient.
    #[must_use]
    pub fn depend_on_the_gradient(&self) -> bool {
        self.media.iter().any(|medium| {
            matches!(medium.permeability, Some((Rule::Law(law), _)) if law.model().depends_on_the_gradient())
        })
    }

    /// Returns the boxes of a cell: their lengths along each axis and their media.
    fn boxes(&self, cell: &Divided) -> ([&[f64]; 3], &[u32]) {
        let [x, y, z] = cell.counts;
        let lengths = &self.lengths[cell.lengths..cell.lengths + x + y + z];
        let media = &self.media_of[cell.media..cell.media + x * y * z];
        let (along_x, rest) = lengths.split_at(x);
        let (along_y, along_z) = rest.split_at(y);
        ([along_x, along_y, along_z], media)
    }
}

/// Returns the planes normal to an axis at which a zone or a node may end, ascending.
fn planes(grid: &SeepageGrid, zones: &[SoilZone], axis: usize) -> Vec<f64> {
    let mut all = Vec::new();
    if axis < grid.dimension {
        for zone in zones {
            all.extend([zone.from[axis], zone.to[axis]]);
            if let Some(raster) = &zone.raster {
                all.extend(raster.planes(axis));
            }
        }
    }
    all.retain(|x| x.is_finite());
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// Number of parts into which edges are divided in a cell crossed by the boundary of a polygon.
const PARTS: usize = 8;

/// Returns `true` if a point lies in a polygon: a ray from it crosses an odd number of edges.
#[must_use]
pub fn is_inside(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let next = polygon.iter().cycle().skip(1);
    let crossings = polygon.iter().zip(next).filter(|([ax, ay], [bx, by])| {
        (*ay > y) != (*by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax
    });
    crossings.count() % 2 == 1
}

/// Returns `true` if an edge of a polygon passes through a cell.
fn edge_crosses(polygon: &[[f64; 2]], grid: &SeepageGrid, cell: [usize; 3]) -> bool {
    let low = grid.corner(cell);
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).any(|(from, to)| {
        // Part of the edge between the planes of the cell.
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for a in 0..2 {
            let along = to[a] - from[a];
            let (near, far) = (low[a] - from[a], low[a] + grid.width(a, cell) - from[a]);
            if along.abs() > 0.0 {
                let (s, t) = (near / along, far / along);
                (first, last) = (first.max(s.min(t)), last.min(s.max(t)));
            } else if near >= 0.0 || far <= 0.0 {
                return false;
            }
        }
        last - first > ON_THE_EDGE
    })
}

/// Divides the parts of an edge further.
fn subdivide(edges: &mut Vec<f64>) {
    let whole = [edges[0], edges[edges.len() - 1]];
    for n in 1..PARTS {
        let part = base::number::real(n) / base::number::real(PARTS);
        edges.push(whole[0] + part * (whole[1] - whole[0]));
    }
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|a, b| (*a - *b).abs() <= ON_THE_EDGE * (whole[1] - whole[0]));
}

/// Distance between a plane and a cell edge, in cells, below which the plane lies on the edge.
const ON_THE_EDGE: f64 = 1e-9;

/// Collects the edges of a cell along an axis, and the planes between them.
fn divide(grid: &SeepageGrid, axis: usize, cell: usize, planes: &[f64], edges: &mut Vec<f64>) {
    let (low, high) = (grid.axis(axis).face(cell), grid.axis(axis).face(cell + 1));
    let slack = ON_THE_EDGE * (high - low);
    edges.clear();
    edges.push(low);
    let first = planes.partition_point(|x| *x <= low + slack);
    let within = planes[first..].iter().take_while(|x| **x < high - slack);
    edges.extend(within.copied());
    edges.push(high);
}

/// Maximum cross term of a cut cell relative to the geometric mean of its permeabilities.
const LARGEST_CROSS: f64 = 0.999;

/// Permeabilities of cells with zones, in buffers that are reused in each iteration.
#[derive(Clone, Debug)]
pub struct ZonePermeability {
    /// Porosity from the grains, in the cells within zones.
    porosity: Vec<f64>,
    /// `true` for cells that contain grains.
    grains: Vec<bool>,
    /// `true` for cells without grains in which a zone applies: a body that the case does not resolve carries the
    /// pressure.
    bodies: Vec<bool>,
    /// `true` for cells with grains that lie within zones.
    ground: Vec<bool>,
    /// Fraction of each cell that zones without grains leave to open water.
    free: Vec<f64>,
    /// Ratio of the permeability along each axis to that of the cell; empty if no boundary cuts a cell.
    ratios: Vec<[f64; 3]>,
    /// Permeability of the boxes of a cell \[m2\].
    boxes: Vec<f64>,
    /// Permeabilities and ratios of the next iteration.
    next: Vec<f64>,
    next_ratios: Vec<[f64; 3]>,
}

impl ZonePermeability {
    /// Allocates buffers for the zones of a grid with `cells` cells.
    #[must_use]
    pub fn new(zones: &Zones, cells: usize) -> Self {
        let cut = if zones.directed() { cells } else { 0 };
        let most = zones.cells.iter().map(|c| c.counts.iter().product());
        Self {
            porosity: vec![1.0; zones.cells.len()],
            grains: vec![false; zones.cells.len()],
            bodies: vec![false; cells],
            ground: vec![false; cells],
            free: vec![1.0; cells],
            ratios: vec![[1.0; 3]; cut],
            boxes: Vec::with_capacity(most.max().unwrap_or(0)),
            next: vec![0.0; cells],
            next_ratios: vec![[1.0; 3]; cut],
        }
    }

    /// Replaces the porosity of the cells by that of the zones; a cut cell has its mean over the volume. `grains`
    /// returns `true` for a cell with grains.
    pub fn replace_porosity(
        &mut self,
        zones: &Zones,
        porosity: &mut [f64],
        grains: impl Fn(usize) -> bool,
    ) {
        for (n, divided) in zones.cells.iter().enumerate() {
            let cell = divided.cell;
            (self.porosity[n], self.grains[n]) = (porosity[cell], grains(cell));
            let (_, here) = zones.boxes(divided);
            let stands = |medium: &u32| zones.media[*medium as usize].applies_without_grains();
            self.bodies[cell] = !self.grains[n] && here.iter().any(stands);
            self.ground[cell] = self.grains[n];
            let free = 1.0 - zones.part(divided, Medium::applies_without_grains);
            // The fractions of the boxes of a full cell add up to one except for rounding.
            self.free[cell] = if free > ON_THE_EDGE { free } else { 0.0 };
            let own = |medium: u32| {
                let stated = zones.media[medium as usize].porosity(self.grains[n]);
                stated.unwrap_or(self.porosity[n])
            };
            let ([x, y, z], media) = zones.boxes(divided);
            if let [medium] = media {
                porosity[cell] = own(*medium);
                continue;
            }
            let mut mean = 0.0;
            let mut media = media.iter();
            for z in z {
                for y in y {
                    for (x, medium) in x.iter().zip(&mut media) {
                        mean += x * y * z * own(*medium);
                    }
                }
            }
            porosity[cell] = mean;
        }
    }

    /// Returns `true` if a body that the case does not resolve fills at least a part of a cell.
    #[must_use]
    pub fn is_body(&self, cell: usize) -> bool {
        self.bodies[cell]
    }

    /// Returns `true` if zones state the permeability for the grains of a cell.
    #[must_use]
    pub fn is_ground(&self, cell: usize) -> bool {
        self.ground[cell]
    }

    /// Returns the fraction of a cell that zones without grains leave to open water.
    #[must_use]
    pub fn free(&self, cell: usize) -> f64 {
        self.free[cell]
    }

    /// Replaces the permeability of the cells by that of the zones, and computes the ratios. `open` is the
    /// permeability of open water along each axis of each cell \[m2\].
    pub fn replace(
        &mut self,
        zones: &Zones,
        law: &dyn ResistanceFormula,
        (bed, open): (BedOfCells<'_>, &[[f64; 3]]),
        liquid: Liquid,
        permeability: &mut [f64],
    ) {
        for (n, divided) in zones.cells.iter().enumerate() {
            let cell = divided.cell;
            let (diameter, gradient) = (bed.diameter[cell], bed.gradient[cell]);
            let of_grains = (self.porosity[n], diameter);
            let own = |medium: u32| {
                let medium = &zones.media[medium as usize];
                medium.permeability(law, of_grains, liquid, gradient, self.grains[n])
            };
            let (lengths, media) = zones.boxes(divided);
            if let [medium] = media {
                let directions = zones.media[*medium as usize].directions;
                let mean = geometric_mean(directions, zones.dimension);
                permeability[cell] = own(*medium) * mean;
                if let Some(ratios) = self.ratios.get_mut(cell) {
                    *ratios = directions.map(|direction| direction / mean);
                }
                continue;
            }
            let mut along = [1.0; 3];
            for (axis, along) in along.iter_mut().enumerate().take(zones.dimension) {
                self.boxes.clear();
                self.boxes.extend(
                    media.iter().map(|medium| {
                        own(*medium) * zones.media[*medium as usize].directions[axis]
                    }),
                );
                if !self.grains[n] {
                    // Boxes in which no zone applies are open water.
                    for (own, medium) in self.boxes.iter_mut().zip(media) {
                        if !zones.media[*medium as usize].applies_without_grains() {
                            *own = open[cell][axis];
                        }
                    }
                }
                *along = effective(axis, lengths, &self.boxes);
            }
            // The cell has the geometric mean of its permeabilities; the ratios are those along the axes to this
            // mean.
            let mean = geometric_mean(along, zones.dimension);
            permeability[cell] = mean;
            for (ratio, along) in self.ratios[cell]
                .iter_mut()
                .zip(along)
                .take(zones.dimension)
            {
                *ratio = along / mean;
            }
        }
    }

    /// Returns the ratio of the permeability along each axis to that of the cell; none if no boundary cuts a cell.
    #[must_use]
    pub fn ratios(&self) -> Option<&[[f64; 3]]> {
        Some(&self.ratios[..]).filter(|ratios| !ratios.is_empty())
    }

    /// Computes the largest relative change, along any axis, from the given permeabilities to those of the bed,
    /// weighted as in [`ResistanceFormula::change`].
    pub fn change(
        &mut self,
        zones: &Zones,
        law: &dyn ResistanceFormula,
        (bed, open): (BedOfCells<'_>, &[[f64; 3]]),
        liquid: Liquid,
        permeability: &[f64],
    ) -> f64 {
        let mut next = std::mem::take(&mut self.next);
        self.next_ratios.copy_from_slice(&self.ratios);
        law.fill(bed, liquid, &mut next);
        self.replace(zones, law, (bed, open), liquid, &mut next);
        std::mem::swap(&mut self.ratios, &mut self.next_ratios);
        let mut change = 0.0_f64;
        let steepest = bed.steepest();
        for (cell, (next, before)) in next.iter().zip(permeability).enumerate() {
            let weight = bed.weight(cell, steepest);
            change = larger(change, weight * (next / before - 1.0).abs());
        }
        let ratios = self.next_ratios.iter().zip(&self.ratios);
        for (next, before) in ratios.flat_map(|(next, before)| next.iter().zip(before)) {
            change = larger(change, (next / before - 1.0).abs());
        }
        self.next = next;
        change
    }
}

/// Returns the geometric mean over the axes of a dimension.
fn geometric_mean(along: [f64; 3], dimension: usize) -> f64 {
    let product: f64 = along[..dimension].iter().product();
    match dimension {
        2 => product.sqrt(),
        _ => product.cbrt(),
    }
}

/// Returns the effective permeability of a cell of boxes along an axis \[m²\]: the geometric mean of the bounds
/// above. `lengths` are the relative lengths of the boxes.
fn effective(axis: usize, lengths: [&[f64]; 3], permeability: &[f64]) -> f64 {
    let strides = [1, lengths[0].len(), lengths[0].len() * lengths[1].len()];
    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut lower = 0.0;
    for (k, wc) in lengths[c].iter().enumerate() {
        for (j, wb) in lengths[b].iter().enumerate() {
            let first = j * strides[b] + k * strides[c];
            let resistances = lengths[axis].iter().enumerate();
            let sum: f64 = resistances
                .map(|(i, wa)| wa / permeability[first + i * strides[axis]])
                .sum();
            lower += wb * wc / sum;
        }
    }
    let mut resistance = 0.0;
    for (i, wa) in lengths[axis].iter().enumerate() {
        let mut slice = 0.0;
        for (k, wc) in lengths[c].iter().enumerate() {
            for (j, wb) in lengths[b].iter().enumerate() {
                let at = i * strides[axis] + j * strides[b] + k * strides[c];
                slice += wb * wc * permeability[at];
            }
        }
        resistance += wa / slice;
    }
    (lower / resistance).sqrt()
}

#[cfg(test)]
mod tests;
