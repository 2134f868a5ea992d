//! Moving bounce-back on the links that cross the surface of a body, with the load on the body (A-10 … A-15, E-03).
//!
//! A link leaves a cell x outside the body along i and ends in a cell y = x + c_i inside. The fluid inside the shell is
//! kept (Ladd 1994), so both ends bounce:
//!
//! f_ī(x, t+1) = f*_i(x) - T,  f_i(y, t+1) = f*_ī(y) + T,  T = 6 w_i c_i·u_w (ρ = 1; A-11),
//!
//! which only exchanges the two numbers of the link and keeps the mass of the whole lattice to round-off. u_w is the
//! velocity of the body's surface at the middle of the link. The body receives 2 f*_i - T along c_i (E-03).
//!
//! The interpolated scheme takes the outer half from the central linear interpolation of Ginzburg, Verhaeghe and
//! d'Humières 2008 ("CLI"), second order for a surface anywhere on the link, at q of its length from x:
//!
//! f_ī(x, t+1) = f*_i(x) + κ [f_i(x, t+1) - f*_ī(x)] - 3 α w_i c_i·u_w,  κ = (1-2q)/(1+2q),  α = 4/(1+2q),
//!
//! wherever the cell behind x is fluid; half-way elsewhere.
//!
//! Loads are summed as integers of [`super::boundary::QUANTA`]: no order of links, threads or ranks can change them.

use super::boundary::quanta;
use super::lanes::Stored;
use super::populations::{Link, Parity, Populations};
use rayon::prelude::*;

/// The two numbers of a link and where it crosses the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BodyLink {
    /// Where the two populations lie.
    pub link: Link,
    /// Middle of the link in half cells, in the frame of the body's raw position.
    pub middle: [i32; 3],
    /// Direction from the outer to the inner cell.
    pub direction: u8,
    /// The outer cell is fluid of this slab: the link counts in the load.
    pub loads: bool,
    /// The wall's velocity enters (not in narrow gaps, A-15).
    pub moves: bool,
    /// The cell behind the outer one is fluid.
    pub backed: bool,
}

/// Motion of a body in lattice units, and its size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rigid {
    /// Centre in cells.
    pub position: [f64; 3],
    /// Velocity of the centre.
    pub velocity: [f64; 3],
    /// Angular velocity.
    pub spin: [f64; 3],
    /// Radius in cells.
    pub radius: f64,
}

/// Force, and twice the moment about the origin of the cells, in quanta.
pub type Load = [i128; 6];

/// How the surface is placed on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// At the middle of the link.
    HalfWay,
    /// Where the surface is.
    Interpolated,
}

/// Adds a force in quanta at a point given in half cells: multiplications of 64 by 64 bits, as |f| stays below 2^63.
#[inline(always)]
pub fn add_force<const D: usize>(load: &mut Load, f: [i64; 3], at: [i32; 3]) {
    let moment = |a: usize, b: usize| {
        i128::from(at[a]) * i128::from(f[b]) - i128::from(at[b]) * i128::from(f[a])
    };
    for a in 0..D {
        load[a] += i128::from(f[a]);
    }
    load[5] += moment(0, 1);
    if D == 3 {
        load[3] += moment(1, 2);
        load[4] += moment(2, 0);
    }
}

/// Pointer to the populations, shared by the threads of one call.
struct Numbers<S>(*mut S);
// SAFETY: each link owns its two numbers, and every link stands in one list only, so threads that work on different
// lists never touch the same number; the interpolated scheme also reads numbers that no link writes (see `bounce`).
unsafe impl<S> Sync for Numbers<S> {}

/// Links that are fetched ahead: their numbers lie scattered, two cache lines each.
const AHEAD: usize = 8;

/// Asks for a number that is needed soon.
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

/// Bounces the populations on every link of every body and adds the loads. `links[k]`, `motion[k]`, `loads[k]` belong to
/// body k.
///
/// # Panics
/// Never: positions come from [`Populations::link`] of the same lattice.
pub fn bounce<S: Stored, const D: usize>(
    populations: &mut Populations<S>,
    scheme: Scheme,
    links: &[Vec<BodyLink>],
    motion: &[Rigid],
    loads: &mut [Load],
) {
    let parity = populations.parity();
    let table = Table::new(populations);
    let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
    let work = |((links, motion), load): ((&Vec<BodyLink>, &Rigid), &mut Load)| {
        let numbers = &numbers;
        // Kept in registers while the links pass.
        let mut sum = *load;
        for (n, link) in links.iter().enumerate() {
            if let Some(later) = links.get(n + AHEAD) {
                prefetch(numbers.0, later.link.near as usize);
                prefetch(numbers.0, later.link.far as usize);
            }
            // SAFETY: positions made by `Populations::link` lie in the array; see `Numbers` for the absence of races.
            unsafe {
                match scheme {
                    Scheme::HalfWay => {
                        half_way::<S, D>(numbers.0, parity, &table, link, motion, &mut sum);
                    }
                    Scheme::Interpolated => {
                        interpolated::<S, D>(numbers.0, parity, &table, link, motion, &mut sum);
                    }
                }
            }
        }
        *load = sum;
    };
    if rayon::current_num_threads() > 1 && links.len() > 64 {
        links
            .par_iter()
            .zip(motion)
            .zip(loads)
            .with_min_len(32)
            .for_each(work);
    } else {
        links.iter().zip(motion).zip(loads).for_each(work);
    }
}

struct Table {
    c: [[f64; 3]; 27],
    ci: [[i64; 3]; 27],
    weight: [f64; 27],
    opposite: [usize; 27],
    /// Distance from slot i of x to slot ī of x, and on to slot ī of x - c_i.
    swap: [isize; 27],
    behind: [isize; 27],
}

impl Table {
    fn new<S: Stored>(populations: &Populations<S>) -> Self {
        let v = populations.velocities();
        let mut table = Self {
            c: [[0.0; 3]; 27],
            ci: [[0; 3]; 27],
            weight: [0.0; 27],
            opposite: [0; 27],
            swap: [0; 27],
            behind: [0; 27],
        };
        for i in 0..v.q() {
            table.c[i] = v.c[i].map(f64::from);
            table.ci[i] = v.c[i].map(i64::from);
            table.weight[i] = v.w[i];
            table.opposite[i] = v.opposite[i];
            let slot = |k: usize| populations.slot(0, k).cast_signed();
            // `near` is slot ī of x; slot i of x is this far from it, and slot ī of the cell behind is -offset from it.
            table.swap[i] = slot(i) - slot(v.opposite[i]);
            table.behind[i] = -populations.offset(i);
        }
        table
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

#[inline(always)]
pub(super) fn surface_velocity<const D: usize>(motion: &Rigid, r: [f64; 3]) -> [f64; 3] {
    let (u, w) = (motion.velocity, motion.spin);
    if D == 2 {
        [u[0] - w[2] * r[1], u[1] + w[2] * r[0], 0.0]
    } else {
        [
            u[0] + (w[1] * r[2] - w[2] * r[1]),
            u[1] + (w[2] * r[0] - w[0] * r[2]),
            u[2] + (w[0] * r[1] - w[1] * r[0]),
        ]
    }
}

/// # Safety
/// `numbers` must be the array that the link's positions refer to, and no other thread may touch those two numbers.
#[inline(always)]
unsafe fn half_way<S: Stored, const D: usize>(
    numbers: *mut S,
    parity: Parity,
    table: &Table,
    link: &BodyLink,
    motion: &Rigid,
    load: &mut Load,
) {
    let i = usize::from(link.direction);
    let r: [f64; 3] = std::array::from_fn(|a| 0.5 * f64::from(link.middle[a]) - motion.position[a]);
    let u = surface_velocity::<D>(motion, r);
    let term = if link.moves {
        6.0 * table.weight[i] * dot::<D>(table.c[i], u)
    } else {
        0.0
    };
    // SAFETY: promised by the caller.
    let (outer, inner) = unsafe {
        (
            numbers.add(link.link.out(parity)),
            numbers.add(link.link.incoming(parity)),
        )
    };
    // SAFETY: as above.
    let (leaves, streams) = unsafe { (outer.read().to_f64(), inner.read().to_f64()) };
    // SAFETY: as above.
    unsafe {
        inner.write(S::from_f64(leaves - term));
        outer.write(S::from_f64(streams + term));
    }
    if link.loads {
        let g = quanta(2.0 * leaves - term);
        add_force::<D>(load, table.ci[i].map(|c| c * g), link.middle);
    }
}

/// # Safety
/// As for [`half_way`]; where the link is `backed`, the two numbers between x and the cell behind it must not be written
/// by any thread: both cells are fluid, so no link stands between them.
#[inline(always)]
unsafe fn interpolated<S: Stored, const D: usize>(
    numbers: *mut S,
    parity: Parity,
    table: &Table,
    link: &BodyLink,
    motion: &Rigid,
    load: &mut Load,
) {
    if !(link.loads && link.backed) {
        // Links between bodies, into ghosts of the lattice, or out of gaps of one cell stay half-way. A link whose outer
        // cell belongs to the neighbouring slab is interpolated there.
        // SAFETY: promised by the caller.
        unsafe { half_way::<S, D>(numbers, parity, table, link, motion, load) };
        return;
    }
    let i = usize::from(link.direction);
    let c = table.c[i];
    let d: [f64; 3] =
        std::array::from_fn(|a| 0.5 * f64::from(link.middle[a]) - 0.5 * c[a] - motion.position[a]);
    let (cc, dc) = (dot::<D>(c, c), dot::<D>(d, c));
    let excess = dot::<D>(d, d) - motion.radius * motion.radius;
    let root = (dc * dc - cc * excess).max(0.0).sqrt();
    let q = ((-dc - root) / cc).clamp(0.0, 1.0);
    let on_surface = std::array::from_fn(|a| d[a] + q * c[a]);
    let wall = dot::<D>(c, surface_velocity::<D>(motion, on_surface));
    let at_middle = std::array::from_fn(|a| d[a] + 0.5 * c[a]);
    let middle = dot::<D>(c, surface_velocity::<D>(motion, at_middle));
    let weight = if link.moves { table.weight[i] } else { 0.0 };
    let near = link.link.near as usize;
    let home = near.wrapping_add_signed(table.swap[i]);
    let behind = near.wrapping_add_signed(table.behind[i]);
    let (entering, returning) = match parity {
        Parity::Home => (home, behind),
        Parity::Reversed => (behind, home),
    };
    // SAFETY: promised by the caller.
    let (outer, inner) = unsafe {
        (
            numbers.add(link.link.out(parity)),
            numbers.add(link.link.incoming(parity)),
        )
    };
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
    let back = leaves + kappa * (entering - returning) - 3.0 * alpha * weight * wall;
    // SAFETY: as above.
    unsafe {
        inner.write(S::from_f64(back));
        outer.write(S::from_f64(streams + 6.0 * weight * middle));
    }
    let g = quanta(leaves + back);
    add_force::<D>(load, table.ci[i].map(|c| c * g), link.middle);
}
