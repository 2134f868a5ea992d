//! The narrow phase: do two blocks touch, where, in which direction, how deep and over which area (B-06 … B-10).
//!
//! 1. The plane that separated the pair in the last step is tried first: two passes over the vertices.
//! 2. The linear program decides (`linear_program.rs`), starting from its last basis. Where it finds a plane between the
//!    blocks the vertices confirm it, and it is kept. What rounding leaves open, all separating axes decide: no contact is
//!    dropped, and none invented.
//! 3. The contact is condensed to one point, normal and depth, by one of two models:
//!
//! [`Model::Point`], the published form (Boon et al. 2012). The point is the analytic centre of the overlap. The normal is the
//! direction between the gradients of both "potential particles" there: with planes drawn in by the rounding `r`,
//!
//! ```text
//! g = sum_i <a_i . x - d_i + r> a_i,     n = g_1/|g_1| - g_2/|g_2|, normalised     <z> = max(z, 0)
//! ```
//!
//! or the nearest plane's normal where all terms are zero. The depth is the distance between both surfaces along `n` through the
//! point, and the area that of the overlap's section across `n`.
//!
//! [`Model::Patch`], for faces that rest on faces. With `V` the overlap's volume and `S` the vector area of the first's surface
//! inside the second,
//!
//! ```text
//! n = S/|S|,   area = |S|,   depth = V/|S|,   point = centroid of the overlap
//! ```
//!
//! so that `k area depth = k V` is the sum of a bed of springs of `k` (Pa/m) over the patch, and acts where that sum acts: a face that
//! tilts is turned back by exactly the moment of the bed. Against a plane this is Winkler's foundation, and conserves
//! energy. All of it is continuous in the pose, also where a vertex contact becomes one of an edge or a face (V grows from
//! zero as the third power, the square, or linearly), and there is no rounding to choose. A volume as the measure of contact:
//! S. Hasegawa, M. Sato, Computer Graphics Forum 23 (2004) 529; the vector area as normal: Y. T. Feng, K. Han, D. R. J. Owen,
//! Comput. Methods Appl. Mech. Engrg. 205-208 (2012) 169.
//!
//! Which to take: `Patch` unless the published form is asked for. Measured in frictionless elastic collisions of boxes: a patch keeps
//! energy to 3e-10 face on face, 2e-12 corner on face and 3e-5 edge on edge; a point to 1e-3, 4e-2 and 3e-2, and it
//! gains half of it face on face where the rounding is a hundred times the overlap, since then the gradient beside an edge leans
//! over by tens of degrees while the surface does not. With mass damping of 10/s ten blocks stand for a million steps, at rest to 1e-12
//! m/s, with either. A patch costs less besides: no Newton iteration.
//!
//! **Facets.** Where a block meets a surface of facets, each facet takes the points of the block that it hides from the block's centroid: the
//! part behind its plane in the cone of sight through it, with the facet's own normal. The cones of facets side by side fill space
//! without gap or overlap: a plane of triangles is the plane, an edge between them pushes nothing, and a convex edge is touched
//! from both sides in proportion. Beyond a convex edge a face also hides a sliver from a centroid that stands over the other, of the
//! order of the depth over the size of the block. A rim that meets a block edge on is not felt: facets push across themselves.
//!
//! All is computed in the frame of the first block, so that places far from the origin cost no digits. Nothing is allocated once
//! the buffers of [`Narrow`] have grown.

use nalgebra::{Matrix3, Vector3};

use super::cut::{across, count_f64};
use super::linear_program::{self, AFRESH, Verdict};
use super::separating_axes::{gap, widest_gap};
use super::shape::Polyhedron;
use super::{HalfSpace, analytic_centre};

/// How much larger the second block is taken to be where surfaces are cut (2^-36), so that faces of both in one plane are
/// apart: of two rounded answers to "which is outside" one could be counted twice, or none.
const GROWN: f64 = 1.0 / 68_719_476_736.0;

/// A vector area smaller than this over the area has no direction to trust.
const CANCELLED: f64 = 0.05;

/// A depth below this over the height of the centroid is rounding: volumes behind facets are differences of cones.
const ROUNDING: f64 = 1e-11;

/// A block as the narrow phase sees it.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// Its shape.
    pub shape: &'a Polyhedron,
    /// Turns its body frame into space.
    pub rotation: Matrix3<f64>,
}

/// How a contact is condensed: see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Model {
    /// Boon's point and normal.
    Point {
        /// Rounding r (m) of the potential particles: more than an overlap, less than half a block.
        rounding: f64,
    },
    /// Volume and vector area of the overlap.
    Patch,
}

/// A contact now, in the axes of space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// From the first's centre to the contact (m).
    pub arm: Vector3<f64>,
    /// Unit normal from the first to the second.
    pub normal: Vector3<f64>,
    /// Overlap (m) along the normal, positive.
    pub depth: f64,
    /// Area of contact (m²).
    pub area: f64,
    /// Second moments (m⁴) of the area about the contact point: the sum of `a a^T` over its arms `a` across the normal.
    pub second: Matrix3<f64>,
}

impl Geometry {
    /// Polar second moment (m⁴) of the area: what resists twisting.
    #[must_use]
    pub fn polar(&self) -> f64 {
        self.second.trace().max(0.0)
    }
}

/// What a pair remembers: plain data, 17 numbers. Lengths in m, forces in N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memory {
    /// The axis that separated the pair when it was last looked at, in the first's frame; zero where none did.
    axis: Vector3<f64>,
    /// The last contact point, in the first's frame.
    point: Vector3<f64>,
    /// The last basis of the linear program.
    basis: [u16; 4],
    /// The last normal, in space; zero where there was no contact.
    pub(super) normal: Vector3<f64>,
    /// Force of the shear spring on the second, in space.
    pub(super) shear: Vector3<f64>,
    /// Moment (N m) of the twist spring on the second about the normal.
    pub(super) twist: f64,
}

impl Default for Memory {
    fn default() -> Self {
        Self {
            axis: Vector3::zeros(),
            point: Vector3::zeros(),
            basis: AFRESH,
            normal: Vector3::zeros(),
            shear: Vector3::zeros(),
            twist: 0.0,
        }
    }
}

impl Memory {
    /// How many numbers it is.
    pub const NUMBERS: usize = 17;

    /// Whether the pair touched when it was last looked at.
    #[must_use]
    pub fn touching(&self) -> bool {
        self.normal != Vector3::zeros()
    }

    /// As numbers.
    #[must_use]
    pub fn save(&self) -> [f64; Self::NUMBERS] {
        let (a, p, n, s) = (self.axis, self.point, self.normal, self.shear);
        let b = self.basis.map(f64::from);
        [
            a.x, a.y, a.z, p.x, p.y, p.z, b[0], b[1], b[2], b[3], n.x, n.y, n.z, s.x, s.y, s.z,
            self.twist,
        ]
    }

    /// From numbers.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "names of half-spaces were u16; anything else saturates and starts afresh"
    )]
    pub fn load(numbers: &[f64; Self::NUMBERS]) -> Self {
        let at = |k: usize| Vector3::new(numbers[k], numbers[k + 1], numbers[k + 2]);
        Self {
            axis: at(0),
            point: at(3),
            basis: [6, 7, 8, 9].map(|k| numbers[k] as u16),
            normal: at(10),
            shear: at(13),
            twist: numbers[16],
        }
    }

    /// Force (N) of the shear spring on the second, in space.
    pub(in crate::dem) fn spring(&self) -> Vector3<f64> {
        self.shear
    }

    /// Keeps normal and shear spring of a contact that another force law than [`super::Law`] has acted at.
    pub(in crate::dem) fn hold(&mut self, normal: &Vector3<f64>, shear: &Vector3<f64>) {
        self.normal = *normal;
        self.shear = *shear;
    }

    /// No contact any more: springs are gone, what speeds up the search stays.
    fn release(&mut self) {
        self.normal = Vector3::zeros();
        self.shear = Vector3::zeros();
        self.twist = 0.0;
    }
}

/// How often which way was gone: for benches and tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ways {
    /// Linear programs solved.
    pub programs: u64,
    /// Pairs that the exhaustive test had to decide.
    pub exhaustive: u64,
    /// Centres that Newton's method did not reach; the best point inside was taken.
    pub off_centre: u64,
}

/// The overlap of two solids: m³, and relative to the first's centre m; the vector area (m²) of the first's surface in it.
#[derive(Clone, Copy, Debug, Default)]
struct Overlap {
    volume: f64,
    centroid: Vector3<f64>,
    area: Vector3<f64>,
    /// Areas (m²) of the first's surface inside the second, and of the second's inside the first.
    surfaces: [f64; 2],
}

/// What facets of one plane hide of a block, as sums over the facets in the block's frame: see [`Narrow::hide`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Hidden {
    /// m³, and its first moment (m⁴).
    part: Overlap,
    /// Area (m²) of the facets inside the block, its first (m³) and second (m⁴) moments about the centroid.
    area: f64,
    first: Vector3<f64>,
    second: Matrix3<f64>,
}

/// The buffers of the narrow phase: one for each thread.
#[derive(Clone, Debug, Default)]
pub struct Narrow {
    /// Half-spaces of the first, then of the second, in the first's frame.
    planes: Vec<HalfSpace>,
    own: usize,
    /// The second's vertices and half-spaces, grown by a trifle.
    vertices: Vec<Vector3<f64>>,
    grown: Vec<HalfSpace>,
    /// Planes that cut, most first.
    cutting: Vec<(usize, usize)>,
    polygon: Vec<Vector3<f64>>,
    spare: Vec<Vector3<f64>>,
    heights: Vec<f64>,
    /// Triangles of the first's surface inside the second.
    triangles: Vec<[Vector3<f64>; 3]>,
    rows: Vec<[f64; 4]>,
    /// How often which way was gone.
    pub ways: Ways,
}

/// What a block meets, as the block sees it.
enum Other<'a> {
    Block {
        shape: &'a Polyhedron,
        turn: Matrix3<f64>,
        separation: Vector3<f64>,
    },
    Plane(HalfSpace),
}

impl Narrow {
    /// Two blocks: the lower id first. `separation` (m) leads from the first's centre to the second's.
    pub fn blocks(
        &mut self,
        first: &Placed,
        second: &Placed,
        separation: &Vector3<f64>,
        model: &Model,
        memory: &mut Memory,
    ) -> Option<Geometry> {
        let reach = first.shape.radius() + second.shape.radius();
        if separation.norm_squared() >= reach * reach {
            memory.release();
            return None;
        }
        let turn = first.rotation.tr_mul(&second.rotation);
        let local = first.rotation.tr_mul(separation);
        let apart = |axis: &Vector3<f64>| gap(first.shape, second.shape, &turn, &local, axis);
        if memory.axis != Vector3::zeros() {
            if apart(&memory.axis) > 0.0 {
                memory.release();
                return None;
            }
            memory.axis = Vector3::zeros();
        }
        self.planes.clear();
        self.planes.extend_from_slice(first.shape.half_spaces());
        self.own = self.planes.len();
        for plane in second.shape.half_spaces() {
            let normal = turn * plane.normal;
            let offset = plane.offset + normal.dot(&local);
            self.planes.push(HalfSpace { normal, offset });
        }
        self.ways.programs += 1;
        let far = 4.0 * first.shape.radius();
        let verdict = linear_program::solve(&self.planes, self.own, far, &mut memory.basis);
        let other = Other::Block {
            shape: second.shape,
            turn,
            separation: local,
        };
        let found = match verdict {
            Verdict::Overlap { point, depth } if depth > 0.0 => {
                self.condense(first.shape, &other, &point, depth, model, memory)
            }
            Verdict::Apart { axis, .. } => {
                let axis = axis.try_normalize(0.0).unwrap_or_default();
                if apart(&axis) > 0.0 {
                    memory.axis = axis;
                    None
                } else {
                    self.exhaust(first.shape, &other, memory)
                }
            }
            Verdict::Overlap { .. } | Verdict::Open => self.exhaust(first.shape, &other, memory),
        };
        finish(found, first, memory)
    }

    /// A block (the first) and what fills the space behind a plane (the second): `normal` points out of that, and the block's
    /// centre stands `height` (m) above it.
    pub fn plane(
        &mut self,
        block: &Placed,
        normal: &Vector3<f64>,
        height: f64,
        model: &Model,
        memory: &mut Memory,
    ) -> Option<Geometry> {
        let plane = HalfSpace {
            normal: block.rotation.tr_mul(normal),
            offset: -height,
        };
        if height >= block.shape.radius() {
            memory.release();
            return None;
        }
        let (lowest, below) = block.shape.support(&-plane.normal);
        if below <= height {
            memory.release();
            return None;
        }
        let other = Other::Plane(plane);
        let found = match model {
            Model::Patch => {
                let near = block.shape.vertices()[lowest];
                let overlap = self.overlap(block.shape, &other, &near);
                self.patch(&other, &overlap)
                    .or_else(|| Some(touch(&near, &-plane.normal, below - height)))
            }
            Model::Point { .. } => {
                self.planes.clear();
                self.planes.extend_from_slice(block.shape.half_spaces());
                self.own = self.planes.len();
                self.planes.push(plane);
                self.ways.programs += 1;
                let far = 4.0 * block.shape.radius();
                let basis = &mut memory.basis;
                match linear_program::solve(&self.planes, self.own, far, basis) {
                    Verdict::Overlap { point, depth } if depth > 0.0 => {
                        self.condense(block.shape, &other, &point, depth, model, memory)
                    }
                    _ => self.exhaust(block.shape, &other, memory),
                }
            }
        };
        finish(found, block, memory)
    }

    /// A block (the first) and a sphere (the second) of `radius` (m) whose centre is at `separation` (m) from the block's: the
    /// block's point closest to the centre.
    #[must_use]
    pub fn sphere(
        &self,
        block: &Placed,
        separation: &Vector3<f64>,
        radius: f64,
    ) -> Option<Geometry> {
        let reach = block.shape.radius() + radius;
        if separation.norm_squared() >= reach * reach {
            return None;
        }
        let centre = block.rotation.tr_mul(separation);
        let (foot, normal, distance) = closest(block.shape, &centre);
        let depth = radius - distance;
        if depth <= 0.0 {
            return None;
        }
        // The sphere's section in the middle of the overlap.
        let half = (distance + 0.5 * depth).abs().min(radius);
        let area = std::f64::consts::PI * (radius * radius - half * half);
        let normal = block.rotation * normal;
        // Of a disc: the same about all axes across the normal.
        let moment = area * area / (4.0 * std::f64::consts::PI);
        Some(Geometry {
            arm: block.rotation * foot - normal * (0.5 * depth),
            normal,
            depth,
            area,
            second: (Matrix3::identity() - normal * normal.transpose()) * moment,
        })
    }

    /// Adds to `sum` what a convex facet hides of a block from its centroid: the points of the block whose line of sight to it the
    /// facet cuts. `corners` (m) are seen from the centroid, in the axes of space and counter-clockwise about `normal`, which
    /// points to the side of the centroid.
    pub fn hide(
        &mut self,
        block: &Placed,
        corners: impl Iterator<Item = Vector3<f64>>,
        normal: &Vector3<f64>,
        sum: &mut Hidden,
    ) {
        let normal = block.rotation.tr_mul(normal);
        self.vertices.clear();
        let corners = corners.map(|corner| block.rotation.tr_mul(&corner));
        self.vertices.extend(corners);
        let Some(corner) = self.vertices.first() else {
            return;
        };
        let offset = normal.dot(corner);
        if offset >= 0.0 {
            return;
        }
        // The facet inside the block.
        let half_spaces = block.shape.half_spaces();
        cutters(half_spaces, &self.vertices, &mut self.cutting);
        self.polygon.clear();
        self.polygon.extend_from_slice(&self.vertices);
        for k in 0..self.cutting.len() {
            let plane = self.cutting[k].1;
            if !self.cut(|_| half_spaces[plane]) {
                return;
            }
        }
        for k in 1..self.polygon.len().saturating_sub(1) {
            let triangle = [0, k, k + 1].map(|k| self.polygon[k]);
            let area = add(&mut sum.part, &triangle).dot(&normal);
            sum.area += area;
            let flat = triangle.map(|corner| corner - normal * offset);
            sum.first += (flat[0] + flat[1] + flat[2]) * (area / 3.0);
            sum.second += spread(&flat) * (area / 12.0);
        }
        // The block's faces behind it, inside the cone of sight: its sides pass through the centroid and enclose no volume.
        self.grown.clear();
        self.grown.push(HalfSpace { normal, offset });
        for (k, a) in self.vertices.iter().enumerate() {
            let b = self.vertices[(k + 1) % self.vertices.len()];
            let side = a.cross(&b).try_normalize(0.0).unwrap_or_default();
            self.grown.push(HalfSpace {
                normal: side,
                offset: 0.0,
            });
        }
        cutters(&self.grown, block.shape.vertices(), &mut self.cutting);
        for face in 0..half_spaces.len() {
            self.polygon.clear();
            let corners = block.shape.face(face).iter();
            self.polygon
                .extend(corners.map(|&v| block.shape.vertices()[v as usize]));
            for k in 0..self.cutting.len() {
                let plane = self.cutting[k].1;
                if !self.cut(|narrow| narrow.grown[plane]) {
                    break;
                }
            }
            for k in 1..self.polygon.len().saturating_sub(1) {
                add(&mut sum.part, &[0, k, k + 1].map(|k| self.polygon[k]));
            }
        }
    }

    /// The contact of an overlap whose deepest point is known.
    fn condense(
        &mut self,
        first: &Polyhedron,
        other: &Other,
        deepest: &Vector3<f64>,
        depth: f64,
        model: &Model,
        memory: &mut Memory,
    ) -> Option<Geometry> {
        match *model {
            Model::Patch => {
                let overlap = self.overlap(first, other, deepest);
                match self.patch(other, &overlap) {
                    Some(geometry) => Some(geometry),
                    None => self.exhaust(first, other, memory),
                }
            }
            Model::Point { rounding } => {
                let warm = self
                    .planes
                    .iter()
                    .all(|plane| plane.height(&memory.point) < -0.1 * depth);
                let start = if warm { &memory.point } else { deepest };
                let (point, reached) = analytic_centre::find(&self.planes, start, &mut self.rows);
                if !reached {
                    self.ways.off_centre += 1;
                }
                memory.point = point;
                let (own, others) = self.planes.split_at(self.own);
                let one = gradient(own, &point, rounding);
                let two = gradient(others, &point, rounding);
                // Gradients that nearly agree: so deep inside that they say nothing.
                let normal = match (one - two).try_normalize(1e-3) {
                    Some(normal) => normal,
                    None => return self.exhaust(first, other, memory),
                };
                let depth = exit(own, &point, &normal) + exit(others, &point, &-normal);
                let (area, second) = self.section(&point, &normal, first.radius());
                Some(Geometry {
                    arm: point,
                    normal,
                    depth,
                    area,
                    second,
                })
            }
        }
    }

    /// What the exhaustive test makes of a pair: nothing where an axis separates it, else the shortest way out.
    fn exhaust(
        &mut self,
        first: &Polyhedron,
        other: &Other,
        memory: &mut Memory,
    ) -> Option<Geometry> {
        self.ways.exhaustive += 1;
        let (axis, depth, foremost) = match other {
            Other::Block {
                shape,
                turn,
                separation,
            } => {
                let (axis, wide) = widest_gap(first, shape, turn, separation);
                if wide >= 0.0 {
                    memory.axis = axis;
                    return None;
                }
                let foot = shape.support(&-turn.tr_mul(&axis)).0;
                let foot = separation + turn * shape.vertices()[foot];
                let inside = first.half_spaces().iter().all(|p| p.height(&foot) <= -wide);
                let top = first.vertices()[first.support(&axis).0];
                (axis, -wide, if inside { foot } else { top })
            }
            Other::Plane(plane) => {
                let (lowest, below) = first.support(&-plane.normal);
                let depth = below + plane.offset;
                (-plane.normal, depth, first.vertices()[lowest])
            }
        };
        // The overlap's volume summed up about a point of its own, lest rounding be larger than it.
        self.overlap(first, other, &foremost);
        let corners = self.triangles.iter().flatten();
        let near = corners.sum::<Vector3<f64>>() / count_f64(3 * self.triangles.len());
        let near = if self.triangles.is_empty() {
            foremost
        } else {
            near
        };
        let overlap = self.overlap(first, other, &near);
        let about = overlap.centroid - near;
        let size = self
            .triangles
            .iter()
            .flatten()
            .map(|c| (c - near).norm_squared());
        let sound = overlap.volume > 0.0 && about.norm_squared() <= size.fold(0.0, f64::max);
        let (arm, volume) = if sound {
            (overlap.centroid, overlap.volume)
        } else {
            (near, 0.0)
        };
        // A block that goes through another: areas cancel, and the bed of springs is still as strong as its volume.
        let mut geometry = touch(&arm, &axis, depth);
        geometry.area = overlap.area.dot(&axis).max(volume / depth);
        geometry.second = self.second_moments(&arm, &axis);
        Some(geometry)
    }

    /// What the exhaustive test alone makes of two blocks.
    #[cfg(test)]
    pub(super) fn last_resort(
        &mut self,
        first: &Placed,
        second: &Placed,
        separation: &Vector3<f64>,
        memory: &mut Memory,
    ) -> Option<Geometry> {
        let other = Other::Block {
            shape: second.shape,
            turn: first.rotation.tr_mul(&second.rotation),
            separation: first.rotation.tr_mul(separation),
        };
        let found = self.exhaust(first.shape, &other, memory);
        finish(found, first, memory)
    }

    /// The overlap of both solids, its volume summed up about `near`.
    fn overlap(&mut self, first: &Polyhedron, other: &Other, near: &Vector3<f64>) -> Overlap {
        self.grown.clear();
        self.vertices.clear();
        match other {
            Other::Block {
                shape,
                turn,
                separation,
            } => {
                for plane in shape.half_spaces() {
                    let normal = turn * plane.normal;
                    let offset = plane.offset * (1.0 + GROWN) + normal.dot(separation);
                    self.grown.push(HalfSpace { normal, offset });
                }
                for vertex in shape.vertices() {
                    self.vertices
                        .push(separation + turn * (vertex * (1.0 + GROWN)));
                }
            }
            Other::Plane(plane) => self.grown.push(*plane),
        }
        let mut sum = Overlap::default();
        self.triangles.clear();
        // The first's faces inside the second.
        cutters(&self.grown, first.vertices(), &mut self.cutting);
        for face in 0..first.half_spaces().len() {
            self.polygon.clear();
            let corners = first.face(face).iter();
            self.polygon
                .extend(corners.map(|&v| first.vertices()[v as usize]));
            for k in 0..self.cutting.len() {
                let plane = self.cutting[k].1;
                if !self.cut(|narrow| narrow.grown[plane]) {
                    break;
                }
            }
            for k in 1..self.polygon.len().saturating_sub(1) {
                let triangle = [0, k, k + 1].map(|k| self.polygon[k] - near);
                let part = add(&mut sum, &triangle);
                sum.area += part;
                sum.surfaces[0] += part.norm();
                self.triangles.push(triangle.map(|corner| corner + near));
            }
        }
        // The second's faces inside the first.
        match other {
            Other::Block { shape, .. } => {
                cutters(first.half_spaces(), &self.vertices, &mut self.cutting);
                for face in 0..shape.half_spaces().len() {
                    self.polygon.clear();
                    let corners = shape.face(face).iter();
                    self.polygon
                        .extend(corners.map(|&v| self.vertices[v as usize]));
                    self.rest(first, near, &mut sum);
                }
            }
            Other::Plane(plane) => {
                let middle = plane.normal * plane.offset;
                square(&mut self.polygon, &middle, &plane.normal, first.radius());
                self.vertices.extend_from_slice(&self.polygon);
                cutters(first.half_spaces(), &self.vertices, &mut self.cutting);
                self.rest(first, near, &mut sum);
            }
        }
        sum.centroid = near + sum.centroid / sum.volume;
        sum
    }

    /// Adds what of the polygon is inside the first.
    fn rest(&mut self, first: &Polyhedron, near: &Vector3<f64>, sum: &mut Overlap) {
        for k in 0..self.cutting.len() {
            let plane = self.cutting[k].1;
            if !self.cut(|_| first.half_spaces()[plane]) {
                break;
            }
        }
        for k in 1..self.polygon.len().saturating_sub(1) {
            let triangle = [0, k, k + 1].map(|k| self.polygon[k] - near);
            sum.surfaces[1] += add(sum, &triangle).norm();
        }
    }

    /// Cuts the polygon down to what is inside a half-space; false where nothing is left.
    #[inline]
    fn cut(&mut self, plane: impl Fn(&Self) -> HalfSpace) -> bool {
        let plane = plane(self);
        self.heights.clear();
        let heights = self.polygon.iter().map(|corner| plane.height(corner));
        self.heights.extend(heights);
        if self.heights.iter().all(|&height| height <= 0.0) {
            return !self.polygon.is_empty();
        }
        self.spare.clear();
        let count = self.polygon.len();
        for k in 0..count {
            let next = if k + 1 == count { 0 } else { k + 1 };
            let (a, b) = (self.heights[k], self.heights[next]);
            if a <= 0.0 {
                self.spare.push(self.polygon[k]);
            }
            if (a > 0.0) != (b > 0.0) {
                // The same bits whichever way the edge runs.
                let (from, to, low, high) = if a > 0.0 {
                    (self.polygon[next], self.polygon[k], b, a)
                } else {
                    (self.polygon[k], self.polygon[next], a, b)
                };
                self.spare.push(from + (to - from) * (low / (low - high)));
            }
        }
        std::mem::swap(&mut self.polygon, &mut self.spare);
        !self.polygon.is_empty()
    }

    /// The contact of an overlap; none where its surface has no direction.
    fn patch(&self, other: &Other, overlap: &Overlap) -> Option<Geometry> {
        let area = overlap.area.norm();
        let normal = match other {
            // The plane's own normal: no rounding.
            Other::Plane(plane) => -plane.normal,
            Other::Block { .. } => overlap.area / area,
        };
        // Where both surfaces nearly cancel one block goes through the other: the vector says nothing.
        let [one, two] = overlap.surfaces;
        let sound = overlap.volume > 0.0
            && area > CANCELLED * one.min(two)
            && overlap.centroid.iter().all(|c| c.is_finite());
        sound.then(|| Geometry {
            arm: overlap.centroid,
            normal,
            depth: overlap.volume / area,
            area,
            second: self.second_moments(&overlap.centroid, &normal),
        })
    }

    /// Second moments (m⁴) about an axis of the first's surface inside the second, seen along the axis.
    fn second_moments(&self, point: &Vector3<f64>, normal: &Vector3<f64>) -> Matrix3<f64> {
        let mut sum = Matrix3::zeros();
        for triangle in &self.triangles {
            let flat = triangle.map(|corner| {
                let arm = corner - point;
                arm - normal * normal.dot(&arm)
            });
            let twice = (flat[1] - flat[0]).cross(&(flat[2] - flat[0])).dot(normal);
            sum += spread(&flat) * (twice / 24.0);
        }
        sum
    }

    /// Area and second moments of the section of all half-spaces across `normal` at `point`.
    fn section(
        &mut self,
        point: &Vector3<f64>,
        normal: &Vector3<f64>,
        radius: f64,
    ) -> (f64, Matrix3<f64>) {
        square(&mut self.polygon, point, normal, 2.0 * radius);
        for k in 0..self.planes.len() {
            if !self.cut(|narrow| narrow.planes[k]) {
                return (0.0, Matrix3::zeros());
            }
        }
        let (mut area, mut second) = (0.0, Matrix3::zeros());
        for k in 1..self.polygon.len().saturating_sub(1) {
            let triangle = [0, k, k + 1].map(|k| self.polygon[k] - point);
            let twice = (triangle[1] - triangle[0])
                .cross(&(triangle[2] - triangle[0]))
                .dot(normal);
            area += 0.5 * twice;
            second += spread(&triangle) * (twice / 24.0);
        }
        (area, second)
    }
}

impl Hidden {
    /// The contact of a block with the facets, whose plane is `height` (m) from its centroid; none where they hide nothing but
    /// rounding.
    #[must_use]
    pub fn contact(&self, block: &Placed, normal: &Vector3<f64>, height: f64) -> Option<Geometry> {
        let volume = self.part.volume;
        // A negated comparison, so that NaN is none.
        if !(self.area > 0.0 && volume > ROUNDING * height * self.area) {
            return None;
        }
        let arm = self.part.centroid / volume;
        let along = block.rotation.tr_mul(normal);
        let flat = arm - along * along.dot(&arm);
        let mixed = flat * self.first.transpose();
        let second = self.second - mixed - mixed.transpose() + flat * flat.transpose() * self.area;
        Some(Geometry {
            arm: block.rotation * arm,
            normal: -normal,
            depth: volume / self.area,
            area: self.area,
            second: block.rotation * second * block.rotation.transpose(),
        })
    }
}

/// The contact in space, and what the pair remembers of it.
fn finish(found: Option<Geometry>, first: &Placed, memory: &mut Memory) -> Option<Geometry> {
    if found.is_none() {
        memory.release();
    }
    found.map(|geometry| Geometry {
        arm: first.rotation * geometry.arm,
        normal: first.rotation * geometry.normal,
        second: first.rotation * geometry.second * first.rotation.transpose(),
        ..geometry
    })
}

/// A contact of a point.
fn touch(arm: &Vector3<f64>, normal: &Vector3<f64>, depth: f64) -> Geometry {
    Geometry {
        arm: *arm,
        normal: *normal,
        depth,
        area: 0.0,
        second: Matrix3::zeros(),
    }
}

/// The planes that cut a set of vertices, those with most outside first, and how many they have outside.
fn cutters(planes: &[HalfSpace], vertices: &[Vector3<f64>], found: &mut Vec<(usize, usize)>) {
    found.clear();
    for (k, plane) in planes.iter().enumerate() {
        let outside = vertices.iter().filter(|v| plane.height(v) > 0.0).count();
        if outside > 0 {
            found.push((outside, k));
        }
    }
    found.sort_unstable_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
}

/// Adds the tetrahedron between a triangle and the origin; returns the triangle's vector area.
#[inline]
fn add(sum: &mut Overlap, triangle: &[Vector3<f64>; 3]) -> Vector3<f64> {
    let [a, b, c] = triangle;
    let volume = a.dot(&b.cross(c)) / 6.0;
    sum.volume += volume;
    sum.centroid += (a + b + c) * (0.25 * volume);
    (b - a).cross(&(c - a)) * 0.5
}

/// Twelve times the mean of `r r^T` over a triangle of corners r.
#[inline]
fn spread(triangle: &[Vector3<f64>; 3]) -> Matrix3<f64> {
    let [a, b, c] = triangle;
    let sum = a + b + c;
    a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose()
}

/// A square across `normal`, counter-clockwise about it.
fn square(
    polygon: &mut Vec<Vector3<f64>>,
    middle: &Vector3<f64>,
    normal: &Vector3<f64>,
    half: f64,
) {
    let (s, t) = across(normal);
    polygon.clear();
    for (p, q) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        polygon.push(middle + s * (p * half) + t * (q * half));
    }
}

/// The unit gradient of a potential particle at a point, or the nearest plane's normal.
fn gradient(planes: &[HalfSpace], point: &Vector3<f64>, rounding: f64) -> Vector3<f64> {
    let mut sum = Vector3::zeros();
    let mut nearest = (f64::NEG_INFINITY, Vector3::zeros());
    for plane in planes {
        let height = plane.height(point);
        if height > nearest.0 {
            nearest = (height, plane.normal);
        }
        sum += plane.normal * (height + rounding).max(0.0);
    }
    sum.try_normalize(0.0).unwrap_or(nearest.1)
}

/// The distance (m) from a point inside to the surface, along a unit direction.
fn exit(planes: &[HalfSpace], point: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
    planes
        .iter()
        .filter_map(|plane| {
            let rate = plane.normal.dot(direction);
            (rate > 0.0).then(|| -plane.height(point) / rate)
        })
        .fold(f64::INFINITY, f64::min)
}

/// The point of a block's surface closest to a point of its frame, the unit normal from there, and the signed distance (m).
fn closest(shape: &Polyhedron, point: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>, f64) {
    let mut highest = (f64::NEG_INFINITY, Vector3::z());
    for plane in shape.half_spaces() {
        let height = plane.height(point);
        if height > highest.0 {
            highest = (height, plane.normal);
        }
    }
    if highest.0 <= 0.0 {
        return (point - highest.1 * highest.0, highest.1, highest.0);
    }
    let mut best = (f64::INFINITY, *point);
    for (face, plane) in shape.half_spaces().iter().enumerate() {
        let height = plane.height(point);
        if height <= 0.0 || height * height >= best.0 {
            continue;
        }
        let corners = shape.face(face);
        let mut inside = true;
        for (k, &corner) in corners.iter().enumerate() {
            let (a, b) = (corner, corners[(k + 1) % corners.len()]);
            // The same bits from both faces of the edge.
            let [from, to] = [a.min(b), a.max(b)].map(|v| shape.vertices()[v as usize]);
            let edge = to - from;
            let out = edge.cross(&plane.normal) * if a < b { 1.0 } else { -1.0 };
            if out.dot(&(point - from)) > 0.0 {
                inside = false;
                let along = (edge.dot(&(point - from)) / edge.norm_squared()).clamp(0.0, 1.0);
                let foot = from + edge * along;
                let squared = (point - foot).norm_squared();
                if squared < best.0 {
                    best = (squared, foot);
                }
            }
        }
        if inside {
            best = (height * height, point - plane.normal * height);
        }
    }
    let away = point - best.1;
    let distance = away.norm();
    let normal = if distance > 0.0 {
        away / distance
    } else {
        highest.1
    };
    (best.1, normal, distance)
}
