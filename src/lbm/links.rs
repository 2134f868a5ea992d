//! Moving bounce-back on the links that cross the surface of a body, with the load on the body (A. J. C. Ladd, J. Fluid
//! Mech. 271 (1994) 285).
//!
//! A link leaves a cell x outside the body along i and ends in a cell y = x + c_i inside. The fluid inside the
//! shell is retained (Ladd 1994), so that both ends bounce back:
//!
//! f_ī(x, t+1) = f*_i(x) - T,  f_i(y, t+1) = f*_ī(y) + T,  T = 6 w_i c_i·u_w (ρ = 1).
//!
//! This only exchanges the two numbers of the link and conserves the mass of the whole lattice up to rounding. u_w
//! is the velocity of the body's surface at the midpoint of the link. The body receives 2 f*_i - T along c_i.
//!
//! In a narrow gap between bodies all links of a cell have one velocity ([`gaps`]).
//!
//! The interpolated scheme computes the outer half by the central linear interpolation of Ginzburg, Verhaeghe and
//! d'Humières 2008 ("CLI"). It is of second order for a surface at any fraction q of the link, measured from x:
//!
//! f_ī(x, t+1) = f*_i(x) + κ [f_i(x, t+1) - f*_ī(x)] - 3 α w_i c_i·u_w,  κ = (1-2q)/(1+2q),  α = 4/(1+2q),
//!
//! if the cell behind x is fluid; otherwise the link is half-way. q is exact: the first root of a quadratic for
//! discs and spheres, the last face that the link enters for convex polyhedra.
//!
//! At the feet of bodies links leave the domain next to a body.
//!
//! A link from a cell in the corner between a face of the domain and a body leaves the domain along one or two axes and
//! leads into the body along the others. The face returns its population, but its momentum acts on both: along the axes
//! on which it leaves on the face, along the others on the body. Without these links a sixth of the pressure on the
//! lowest cell of a body that stands on a face would be missing.
//!
//! The body receives 2 f*_i - 6 w_i c_i·u_b, as if its own surface, of velocity u_b, had returned the population. The
//! difference from what a wall returns is a shear force on the wall. Along a link through an opening the body receives
//! the momentum of both populations.
//!
//! In the corner between two bodies, or between a body and a structure, a link acts in the same way by axis on both
//! ([`CornerLink`]).
//!
//! Loads are summed as integers of [`super::quanta::QUANTA`], so that the order of links, threads and ranks does not
//! affect them.

pub mod fixed;
pub mod gaps;
pub mod mirrored;

pub use super::rigid::Rigid;

use super::feet::{FootAxes, FootLoad, bounded_sum};
use super::lanes::Stored;
use super::populations::{Link, Parity, Populations};
use super::quanta::quanta;
pub(crate) use super::rigid::surface_velocity;
use base::thread_pool;
use gaps::{BodyLinks, GapLink};

/// Positions of the two numbers of a link, and the point at which it crosses the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BodyLink {
    /// Positions of the two populations.
    pub link: Link,
    /// Midpoint of the link in half cells, in the frame of the body's raw position.
    pub middle: [i32; 3],
    /// Direction from the outer to the inner cell.
    pub direction: u8,
    /// `true` if the outer cell is a fluid cell of this slab, so that the link contributes to the load.
    pub loads: bool,
    /// `true` if the cell behind the outer one is fluid.
    pub backed: bool,
}

impl AsRef<Self> for BodyLink {
    fn as_ref(&self) -> &Self {
        self
    }
}

/// Link through a face at the foot of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FootLink {
    /// Link from the cell of water through the face.
    pub link: BodyLink,
    /// Position of the cell.
    pub cell: u32,
    /// Axes along which the link leads into the body.
    pub axes: FootAxes,
    /// `true` if the body receives the momentum of both populations: at openings, and if the link leads past the body
    /// into a structure.
    pub both: bool,
    /// Structure into which the link leads past the body, which has the momentum of the link as well.
    pub structure: Option<AtStructure>,
}

/// Component along one axis of the momentum of a link in the corner between two solids.
///
/// A link that ends in one solid crosses the other one, which is next to its cell along an axis. The component along
/// this axis acts on that solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerLink {
    /// Positions of the populations.
    pub link: Link,
    /// Midpoint of the link in half cells, in the frame of the body's raw position.
    pub middle: [i32; 3],
    /// Axis.
    pub axis: usize,
    /// Component of the direction along the axis.
    pub along: i8,
    /// `true` if the body receives the component, `false` if it gives it away.
    pub receives: bool,
    /// Population that has left along the link in this step.
    pub left: f64,
}

/// Link in the corner between a body and a structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructureCorner {
    /// Link at the body.
    pub link: CornerLink,
    /// Structure that gives or receives the component.
    pub structure: AtStructure,
}

/// Point of a link at a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtStructure {
    /// Positions of cells in the map: the structure is that of the lowest index in them.
    pub places: [u32; 3],
    /// Midpoint of the link in half cells, in the frame of the domain.
    pub middle: [i32; 3],
}

/// Half-space `normal . x <= offset` of a convex polyhedron, in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellPlane {
    /// Unit normal, outwards.
    pub normal: [f64; 3],
    /// Distance from the origin along the normal.
    pub offset: f64,
}

impl CellPlane {
    /// Returns the height of a point above the plane \[cells\].
    #[inline(always)]
    #[must_use]
    pub fn height(&self, at: [f64; 3]) -> f64 {
        dot::<3>(self.normal, at) - self.offset
    }
}

/// Force, and twice the moment about the origin of the cells, in quanta.
pub type Load = [i128; 6];

/// Position of the surface on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// Midpoint of the link.
    HalfWay,
    /// Exact position of the surface.
    Interpolated,
}

/// Adds `g` quanta along direction `c` at a point given in half cells, with one product of 64 by 64 bits for each
/// moment.
#[inline(always)]
fn add_along<const D: usize>(load: &mut Load, g: i64, c: [i64; 3], at: [i32; 3]) {
    let lever = |a: usize, b: usize| {
        let (x, y) = (i64::from(at[a]), i64::from(at[b]));
        i128::from(x * c[b] - y * c[a])
    };
    for a in 0..D {
        load[a] += i128::from(c[a] * g);
    }
    load[5] += lever(0, 1) * i128::from(g);
    if D == 3 {
        load[3] += lever(1, 2) * i128::from(g);
        load[4] += lever(2, 0) * i128::from(g);
    }
}

/// Adds a force in quanta at a point given in half cells. Products of 64 by 64 bits are sufficient, because |f| is
/// below 2^63.
#[inline(always)]
pub fn add_force<const D: usize>(load: &mut Load, f: [i64; 3], at: [i32; 3]) {
    for a in 0..D {
        load[a] += i128::from(f[a]);
    }
    add_moment::<D>(load, f, at);
}

/// Adds only the moment of a force `f` at `at`; units as in [`add_force`].
#[inline(always)]
pub fn add_moment<const D: usize>(load: &mut Load, f: [i64; 3], at: [i32; 3]) {
    let moment = |a: usize, b: usize| {
        i128::from(at[a]) * i128::from(f[b]) - i128::from(at[b]) * i128::from(f[a])
    };
    load[5] += moment(0, 1);
    if D == 3 {
        load[3] += moment(1, 2);
        load[4] += moment(2, 0);
    }
}

/// Pointer to the populations, shared by the threads of one call.
struct Numbers<S>(*mut S);
// SAFETY: each link owns its two numbers, and every link is in one list only, so that threads on different lists
// never access the same number; the interpolated scheme also reads numbers that no link writes (see `bounce`).
unsafe impl<S> Sync for Numbers<S> {}

/// Minimum number of bodies per thread. Code that creates links in parallel should divide bodies in the same way,
/// so that a thread processes the links that it made.
pub const BODIES_PER_THREAD: usize = 16;

/// Prefetch distance in links: their numbers are scattered, in two cache lines each.
const AHEAD: usize = 16;

/// Prefetches a number that is needed soon.
#[inline(always)]
fn prefetch<S>(numbers: *const S, at: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch of any address is allowed and changes nothing.
        unsafe { _mm_prefetch(numbers.wrapping_add(at).cast::<i8>(), _MM_HINT_T0) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (numbers, at);
}

/// Applies bounce-back on every link of every body and computes the loads. `links[k]`, `motion[k]`, `loads[k]` and
/// `faces` of index k belong to body k; a polyhedron has faces, a disc or sphere none.
///
/// # Panics
/// Never: positions come from [`Populations::link`] of the same lattice.
pub fn bounce<'a, S: Stored, const D: usize>(
    populations: &mut Populations<S>,
    scheme: Scheme,
    links: &[BodyLinks],
    motion: &[Rigid],
    faces: impl Fn(usize) -> &'a [CellPlane] + Sync,
    loads: &mut [Load],
) {
    let parity = populations.parity();
    let table = Table::new(populations);
    let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
    let numbers = &numbers;
    thread_pool::each_item_in_runs(loads, BODIES_PER_THREAD, |k, load| {
        let (links, motion, faces) = (&links[k], &motion[k], faces(k));
        // The sum is kept in registers during the loop.
        let mut sum = [0; 6];
        let all = Along {
            numbers: numbers.0,
            parity,
            table: &table,
            motion,
        };
        let own = |r| surface_velocity::<D>(motion, r);
        let (open, narrow, gaps) = (&links.open, &links.narrow, &links.gaps);
        let in_gap = |gap| move |_| gaps.velocity(gap);
        let ball = |d, c| into_ball::<D>(d, c, motion.radius);
        let block = |d, c| into_block(d, c, motion.position, faces);
        // SAFETY: positions made by `Populations::link` lie in the array; see `Numbers` for the absence of races.
        unsafe {
            match scheme {
                Scheme::HalfWay => {
                    walk(open, &all, |link| {
                        half_way::<S, D>(&all, link, own, &mut sum)
                    });
                    walk(narrow, &all, |GapLink { link, gap }| {
                        half_way::<S, D>(&all, link, in_gap(*gap), &mut sum);
                    });
                }
                Scheme::Interpolated if faces.is_empty() => {
                    walk(open, &all, |link| {
                        interpolated::<S, D>(&all, link, own, &mut sum, ball)
                    });
                    walk(narrow, &all, |GapLink { link, gap }| {
                        interpolated::<S, D>(&all, link, in_gap(*gap), &mut sum, ball);
                    });
                }
                Scheme::Interpolated => {
                    walk(open, &all, |link| {
                        interpolated::<S, D>(&all, link, own, &mut sum, block)
                    });
                    walk(narrow, &all, |GapLink { link, gap }| {
                        interpolated::<S, D>(&all, link, in_gap(*gap), &mut sum, block);
                    });
                }
            }
        }
        *load = sum;
    });
}

/// Data common to the links of a body.
struct Along<'a, S> {
    numbers: *mut S,
    parity: Parity,
    table: &'a Table,
    motion: &'a Rigid,
}

/// Calls `each` with every link, after prefetching its numbers.
#[inline(always)]
fn walk<S, L: AsRef<BodyLink>>(links: &[L], all: &Along<S>, mut each: impl FnMut(&L)) {
    for (n, link) in links.iter().enumerate() {
        if let Some(later) = links.get(n + AHEAD) {
            let later = later.as_ref().link;
            prefetch(all.numbers, later.near as usize);
            prefetch(all.numbers, later.far as usize);
        }
        each(link);
    }
}

/// Returns the point at which the link from `d`, about the centre, along `c` enters a disc or sphere, as a fraction of
/// its length.
#[inline(always)]
fn into_ball<const D: usize>(d: [f64; 3], c: [f64; 3], radius: f64) -> f64 {
    let (cc, dc) = (dot::<D>(c, c), dot::<D>(d, c));
    let excess = dot::<D>(d, d) - radius * radius;
    let root = (dc * dc - cc * excess).max(0.0).sqrt();
    (-dc - root) / cc
}

/// Returns the point of entry, like [`into_ball`], for a convex polyhedron about `centre`: a link enters through
/// the last of the faces that have its start in front of them.
#[inline(always)]
fn into_block(d: [f64; 3], c: [f64; 3], centre: [f64; 3], faces: &[CellPlane]) -> f64 {
    let start = std::array::from_fn(|a| centre[a] + d[a]);
    let mut q = 0.0_f64;
    for face in faces {
        let height = face.height(start);
        if height > 0.0 {
            // A face with both ends of the link in front of it has been turned away by the rotation of the body
            // since the link was found.
            let descent = -dot::<3>(face.normal, c);
            q = q.max(if descent > height {
                height / descent
            } else {
                1.0
            });
        }
    }
    q
}

/// Data of a link that depend on its direction.
#[derive(Clone, Copy, Default)]
struct Direction {
    c: [f64; 3],
    /// Factor 6 w_i.
    six_weights: f64,
    ci: [i64; 3],
    /// Distance in memory from slot ī of x to slot i of x, and to slot ī of x - c_i.
    swap: isize,
    behind: isize,
}

/// Data of all directions, with as many entries as a byte has values, so that no access is out of bounds.
struct Table([Direction; 32]);

impl Table {
    fn new<S: Stored>(populations: &Populations<S>) -> Self {
        let v = populations.velocities();
        let mut table = Self([Direction::default(); 32]);
        let slot = |k: usize| populations.slot(0, k).cast_signed();
        for (i, direction) in table.0.iter_mut().enumerate().take(v.q()) {
            *direction = Direction {
                c: v.c[i].map(f64::from),
                six_weights: 6.0 * v.w[i],
                ci: v.c[i].map(i64::from),
                swap: slot(i) - slot(v.opposite[i]),
                behind: -populations.offset(i),
            };
        }
        table
    }

    #[inline(always)]
    fn direction(&self, link: &BodyLink) -> &Direction {
        &self.0[usize::from(link.direction % 32)]
    }
}

#[inline(always)]
fn dot<const D: usize>(a: [f64; 3], b: [f64; 3]) -> f64 {
    let mut sum = a[0] * b[0] + a[1] * b[1];
    if D == 3 {
        sum += a[2] * b[2];
    }
    sum
}

/// Returns the places of the numbers that leave the cell of a link and that stream into it.
///
/// # Safety
/// The numbers must be the array that the link's positions refer to.
#[inline(always)]
unsafe fn places<S: Stored>(all: &Along<S>, link: &BodyLink) -> (*mut S, *mut S) {
    let (out, incoming) = (link.link.out(all.parity), link.link.incoming(all.parity));
    // SAFETY: promised by the caller.
    unsafe { (all.numbers.add(out), all.numbers.add(incoming)) }
}

/// Reflects half-way between the cells; `velocity` is that of the surface at a point about the centre of the body.
///
/// # Safety
/// The numbers must be the array that the link's positions refer to, and no other thread may touch those two numbers.
#[inline(always)]
unsafe fn half_way<S: Stored, const D: usize>(
    all: &Along<S>,
    link: &BodyLink,
    velocity: impl Fn([f64; 3]) -> [f64; 3],
    load: &mut Load,
) {
    let &Along { table, motion, .. } = all;
    let along = table.direction(link);
    let r: [f64; 3] = std::array::from_fn(|a| 0.5 * f64::from(link.middle[a]) - motion.position[a]);
    let term = along.six_weights * dot::<D>(along.c, velocity(r));
    // SAFETY: promised by the caller.
    let (outer, inner) = unsafe { places(all, link) };
    // SAFETY: as above.
    let (leaves, streams) = unsafe { (outer.read().to_f64(), inner.read().to_f64()) };
    // SAFETY: as above.
    unsafe {
        inner.write(S::from_f64(leaves - term));
        outer.write(S::from_f64(streams + term));
    }
    if link.loads {
        add_along::<D>(load, quanta(2.0 * leaves - term), along.ci, link.middle);
    }
}

/// # Safety
/// Those of [`half_way`]; where the link is `backed`, the two numbers between x and the cell behind it must not be
/// written by any thread: both cells are fluid, so that no link lies between them.
#[inline(always)]
unsafe fn interpolated<S: Stored, const D: usize>(
    all: &Along<S>,
    link: &BodyLink,
    velocity: impl Fn([f64; 3]) -> [f64; 3],
    load: &mut Load,
    cut: impl Fn([f64; 3], [f64; 3]) -> f64,
) {
    if !(link.loads && link.backed) {
        // Links between bodies, into ghosts of the lattice, or out of gaps of one cell remain half-way. A link with
        // its outer cell in the neighbouring slab is interpolated there. SAFETY: promised by the caller.
        unsafe { half_way::<S, D>(all, link, velocity, load) };
        return;
    }
    let &Along {
        numbers,
        table,
        motion,
        ..
    } = all;
    let along = table.direction(link);
    let c = along.c;
    let d: [f64; 3] =
        std::array::from_fn(|a| 0.5 * f64::from(link.middle[a]) - 0.5 * c[a] - motion.position[a]);
    let q = cut(d, c).clamp(0.0, 1.0);
    let on_surface = std::array::from_fn(|a| d[a] + q * c[a]);
    let wall = dot::<D>(c, velocity(on_surface));
    let at_middle = std::array::from_fn(|a| d[a] + 0.5 * c[a]);
    let middle = dot::<D>(c, velocity(at_middle));
    let six_weights = along.six_weights;
    let near = link.link.near as usize;
    let home = near.wrapping_add_signed(along.swap);
    let behind = near.wrapping_add_signed(along.behind);
    let (entering, returning) = match all.parity {
        Parity::Home => (home, behind),
        Parity::Reversed => (behind, home),
    };
    // SAFETY: promised by the caller.
    let (outer, inner) = unsafe { places(all, link) };
    // SAFETY: as above.
    let (leaves, streams, entering, returning) = unsafe {
        (
            outer.read().to_f64(),
            inner.read().to_f64(),
            numbers.add(entering).read().to_f64(),
            numbers.add(returning).read().to_f64(),
        )
    };
    let kappa = (1.0 - 2.0 * q) / (1.0 + 2.0 * q);
    let alpha = 4.0 / (1.0 + 2.0 * q);
    let back = leaves + kappa * (entering - returning) - 0.5 * alpha * six_weights * wall;
    // SAFETY: as above.
    unsafe {
        inner.write(S::from_f64(back));
        outer.write(S::from_f64(streams + six_weights * middle));
    }
    add_along::<D>(load, quanta(leaves + back), along.ci, link.middle);
}

impl CornerLink {
    /// Keeps the population that leaves, before solids reflect it.
    pub fn keep<S: Stored>(&mut self, populations: &Populations<S>) {
        self.left = populations.numbers()[self.link.out(populations.parity())].to_f64();
    }

    /// Adds the component to the load on the body after the population has returned, and returns this force in quanta.
    pub fn load<S: Stored, const D: usize>(
        &self,
        populations: &Populations<S>,
        load: &mut Load,
    ) -> [i64; 3] {
        let returned = populations.numbers()[self.link.incoming(populations.parity())].to_f64();
        let both = i64::from(self.along) * bounded_sum(quanta(self.left), quanta(returned));
        let mut force = [0; 3];
        force[self.axis] = if self.receives { both } else { -both };
        add_force::<D>(load, force, self.middle);
        force
    }
}

/// Adds the loads on a body at its feet, after the faces have returned their populations, lists them, and passes those
/// that a structure loses.
pub fn load_feet<S: Stored, const D: usize>(
    populations: &Populations<S>,
    feet: &[FootLink],
    motion: &Rigid,
    load: &mut Load,
    given: &mut Vec<FootLoad>,
    mut lose: impl FnMut(AtStructure, [i64; 3]),
) {
    let (parity, numbers) = (populations.parity(), populations.numbers());
    let velocities = populations.velocities();
    for foot in feet {
        let BodyLink {
            link,
            middle,
            direction,
            ..
        } = foot.link;
        let (c, w) = (
            velocities.c[usize::from(direction)],
            velocities.w[usize::from(direction)],
        );
        let left = numbers[link.out(parity)].to_f64();
        let along = if foot.both {
            bounded_sum(
                quanta(left),
                quanta(numbers[link.incoming(parity)].to_f64()),
            )
        } else {
            let r = std::array::from_fn(|a| 0.5 * f64::from(middle[a]) - motion.position[a]);
            let u = surface_velocity::<D>(motion, r);
            quanta(2.0 * left - crate::boundary::wall::term(w, c, u))
        };
        let part = |a: usize| i64::from(foot.axes[a]) * i64::from(c[a]);
        let force: [i64; 3] = std::array::from_fn(|a| part(a) * along);
        add_force::<D>(load, force, middle);
        if let Some(structure) = foot.structure {
            lose(structure, force);
        }
        given.push(FootLoad {
            link: (foot.cell, direction),
            axes: foot.axes,
            given: along,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::random::Stream;

    /// Returns a rotated cuboid about a centre without symmetry relative to the cells.
    fn cuboid(centre: [f64; 3]) -> Vec<CellPlane> {
        let turn = nalgebra::Rotation3::new(nalgebra::Vector3::new(0.3, 0.5, 0.7));
        let edges = [5.0, 6.0, 7.0];
        (0..6)
            .map(|k| {
                let mut normal = nalgebra::Vector3::zeros();
                normal[k / 2] = if k % 2 == 0 { 1.0 } else { -1.0 };
                let normal: [f64; 3] = (turn * normal).into();
                CellPlane {
                    normal,
                    offset: 0.5 * edges[k / 2] + dot::<3>(normal, centre),
                }
            })
            .collect()
    }

    #[test]
    fn a_link_is_cut_where_it_enters_the_polyhedron() {
        let centre = [20.37, 20.14, 20.71];
        let faces = cuboid(centre);
        let height = |at: [f64; 3]| {
            let heights = faces.iter().map(|face| face.height(at));
            heights.fold(f64::NEG_INFINITY, f64::max)
        };
        let mut draw = Stream::new(3, 0, 0);
        let mut cut = 0;
        for _ in 0..200_000 {
            let cell: [f64; 3] = std::array::from_fn(|_| (41.0 * draw.uniform()).floor() + 0.5);
            let c: [f64; 3] = std::array::from_fn(|_| (3.0 * draw.uniform()).floor() - 1.0);
            let at = |q: f64| std::array::from_fn(|a| cell[a] + q * c[a]);
            if height(at(0.0)) < 0.0 || height(at(1.0)) >= 0.0 {
                continue;
            }
            let (mut outside, mut inside) = (0.0_f64, 1.0_f64);
            for _ in 0..60 {
                let middle = 0.5 * (outside + inside);
                if height(at(middle)) < 0.0 {
                    inside = middle;
                } else {
                    outside = middle;
                }
            }
            let d = std::array::from_fn(|a| cell[a] - centre[a]);
            let q = into_block(d, c, centre, &faces);
            assert!((q - outside).abs() < 1e-12, "{q} {outside}");
            cut += 1;
        }
        assert!(cut > 100, "{cut} links");
    }

    #[test]
    fn a_polyhedron_that_turned_away_keeps_its_link_within_bounds() {
        let faces = [CellPlane {
            normal: [0.0, 0.0, 1.0],
            offset: 4.0,
        }];
        let q = |z: f64, c: f64| into_block([0.0, 0.0, z], [0.0, 0.0, c], [0.0; 3], &faces);
        // The surface is beyond the end of the link; the link points away from it; the start is already inside.
        assert!((q(5.5, -1.0) - 1.0).abs() < 1e-15);
        assert!((q(4.5, 1.0) - 1.0).abs() < 1e-15);
        assert!(q(3.9, -1.0).abs() < 1e-15);
        assert!((q(4.25, -1.0) - 0.25).abs() < 1e-15);
    }
}
