//! Partially saturated cells: a cell that solids fill by a fraction ε collides as water and as solid at once (B-19 … B-26).
//!
//! ```text
//! f_i* = f_i + (1 - B) (Ω_i + S_i) + B Ω^s_i
//! B(ε) = ε                                     or   ε (τ - ½) / ((1 - ε) + (τ - ½))            (E-08)
//!
//! Ω^s_i = [f_ī - f_ī^eq(u)]   - [f_i - f_i^eq(u_s)]                      non-equilibrium bounce-back (E-07)
//!       = f_i^eq(u_s) - f_i + (1 - ω) [f_i - f_i^eq(u)]                  superposition
//!       = [f_ī - f_ī^eq(u_s)] - [f_i - f_i^eq(u_s)]                      bounce-back about the solid's velocity
//!
//! force of a cell on the solid   -B Σ c_i Ω^s_i = -B (α ρ u_s + r),      α = 1, 1, 2                (E-10)
//! r = ρu - 2m,   (1 - ω)(m - ρu) - m,   -2m,     with m = Σ c f and ρu = m + F/2 (but for what leaks, below)
//! ```
//!
//! All keep the mass of a cell; the momentum that the water loses is what the solids get, to rounding. τ is that of the water
//! itself, also where eddies add to it: B is a matter of geometry and is made when a body is mapped. Sources: D. R. Noble, J. R.
//! Torczynski, Int. J. Mod. Phys. C 9 (1998) 1189; D. J. Holdych, PhD thesis, Urbana (2003); D. R. J. Owen, C. R. Leonardi, Y. T.
//! Feng, Int. J. Numer. Meth. Eng. 87 (2011) 66.
//!
//! **The matched operator.** With these the drag of a sphere depends on the relaxation time, by 10 % and more at ten cells a diameter. Steady
//! slow flow on a lattice depends on the product of the times of what is even and odd in c alone if every time of a cell scales
//! like those of the water (Ginzburg and d'Humières, Phys. Rev. E 68 (2003) 066614), so that a cell gets
//!
//! ```text
//! t⁺ = t / (1 - ε),     t⁻ = t' (1 - ε),     S = -σ (ρu - ρu_s),   σ = 2 C t ε / (1 - ε),    C = ¾
//! ```
//!
//! with t = 1/ω - ½ of what is even and t' of what is odd, u at the middle of the step, and (1 - ε) F of the body force. t⁺ is exact for
//! shear along a flat wall: a cell that is (1 - ε) water gives way as (1 - ε) of one. A full cell reverses what is odd and keeps what
//! is even: half-way bounce-back. The operator is the fluid's own, its even and odd parts scaled.
//!
//! **Several bodies in a cell** (B-26): B(ε) is taken of the sum of their fractions, at most 1, and shared in proportion, so that two
//! blocks that fill a cell together close it. The cell moves with the mean of their velocities weighted by their shares; each
//! receives its own part of the force, and the parts add up to what the water gave. The force is that at the mean velocity: at each one's
//! own, two bodies with parts a and b would exchange a b ρ (u_a - u_b) a step, a drag between them that no water gives.
//!
//! **Deep inside** a body, where no water is beside a cell, its populations are set to the equilibrium at the solid's velocity. Nothing there
//! damps what the surface sends in: without it bodies that slide on each other stir the water inside until it carries momentum
//! through them, and a cell that is uncovered shows it.
//!
//! Full cells at a surface, and between bodies that touch, keep what they reverse less 1/64 of it: an undamped exchange between two of them
//! would swing for ever, and at high Reynolds numbers grow.
//!
//! **Bodies in contact**, and a body on a wall of the domain at rest, exchange pressure but no drag through full cells ([`contact`]).
//!
//! Beside the populations a cell holds ε (f32) and its body: 8 bytes. The loop asks once for a vector of cells whether any is
//! covered; the rest of this file runs only where one is.

use super::boundary::{from_quanta, quanta};
use super::collision::along;
use super::collision::trt::AntisymmetricRate;
use super::lanes::{Lanes, Memory, Stored};
use super::lattice::{Lattice, unroll};
use super::links::{Load, Rigid, add_force, surface_velocity};
use super::populations::Populations;

/// What a solid does to the populations of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reflection {
    /// Bounce-back of what departs from equilibrium.
    NonEquilibrium,
    /// Equilibrium at the solid's velocity, the departure relaxed by the fluid's rate.
    Superposition,
    /// Bounce-back of what departs from equilibrium at the solid's velocity.
    AboutSolid,
    /// Times and a drag of the cell such that steady slow flow does not depend on the viscosity; for operators of one or two times.
    Matched,
}

/// How much a covered fraction counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighting {
    /// B = ε.
    Fraction,
    /// B = ε (τ - ½) / ((1 - ε) + (τ - ½)).
    Viscous,
}

/// How solids act on the cells that they cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Method {
    /// What a solid does to the populations.
    pub reflection: Reflection,
    /// How much a covered fraction counts.
    pub weighting: Weighting,
}

/// Whether cells may be covered, as a type.
pub trait Solids: Copy + Send + Sync + 'static {
    /// Whether the pass looks for solids.
    const ACTIVE: bool;
}

/// Water only, or bodies whose links bounce.
#[derive(Clone, Copy, Debug)]
pub struct Open;

impl Solids for Open {
    const ACTIVE: bool = false;
}

/// Cells may be covered.
#[derive(Clone, Copy, Debug)]
pub struct Covered;

impl Solids for Covered {
    const ACTIVE: bool = true;
}

/// Fraction of a cell so deep inside a body that no water is beside it.
pub const DEEP: f32 = 2.0;

/// How much a partly filled cell drags beside being stiffer: the one number of the matched operator that is fitted, to Zick and
/// Homsy's drag of a simple cubic array of spheres 8 to 12 cells across.
const DRAG: f64 = 0.75;

/// What a cell loses of what it reverses: caught between two full cells it would go to and fro for ever, and the force with it.
const LEAK: f64 = 1.0 / 64.0;

/// No body.
const NONE: u32 = u32::MAX;
/// A ghost cell behind a wall at rest.
const STILL: u32 = u32::MAX - 1;
/// Cells of several bodies are numbered from here.
const SHARED: u32 = 1 << 31;
/// Most lanes that a level has.
const WIDEST: usize = 8;

/// A body as the cells know it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solid {
    /// Id and image: they order the bodies of a cell.
    pub name: (u64, [i32; 3]),
    /// Its motion in lattice units; positions in its raw frame.
    pub motion: Rigid,
    /// From its raw frame to the cells of the slab: local = raw + frame.
    pub frame: [i32; 3],
}

impl Solid {
    /// A local cell in the raw frame.
    #[inline(always)]
    fn raw(&self, cell: [i32; 3]) -> [i32; 3] {
        [
            cell[0] - self.frame[0],
            cell[1] - self.frame[1],
            cell[2] - self.frame[2],
        ]
    }

    /// Velocity of the body at the centre of a cell of its raw frame.
    #[inline(always)]
    fn velocity<const D: usize>(&self, raw: [i32; 3]) -> [f64; 3] {
        let mut arm = [0.0; 3];
        for a in 0..D {
            arm[a] = f64::from(raw[a]) + 0.5 - self.motion.position[a];
        }
        surface_velocity::<D>(&self.motion, arm)
    }
}

/// A body's part of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Share {
    slot: u32,
    fraction: f32,
}

/// Sums of one worker.
#[derive(Debug, Default)]
struct Sums {
    loads: Vec<Load>,
    touched: Vec<u32>,
    known: Vec<bool>,
}

impl Sums {
    fn fit(&mut self, slots: usize) {
        self.loads.resize(slots, [0; 6]);
        self.known.resize(slots, false);
        self.touched
            .reserve(slots.saturating_sub(self.touched.len()));
    }

    #[inline(always)]
    fn add<const D: usize>(&mut self, slot: u32, raw: [i32; 3], force: [f64; 3]) {
        let k = slot as usize;
        if let (Some(known), Some(load)) = (self.known.get_mut(k), self.loads.get_mut(k)) {
            if !*known {
                *known = true;
                self.touched.push(slot);
            }
            let force = [quanta(force[0]), quanta(force[1]), quanta(force[2])];
            let middle = [2 * raw[0] + 1, 2 * raw[1] + 1, 2 * raw[2] + 1];
            add_force::<D>(load, force, middle);
        }
    }
}

/// What covers the cells of a slab.
#[derive(Debug)]
pub struct Cover {
    method: Method,
    /// τ - ½ of the water.
    time: f64,
    /// How the rate of the antisymmetric parts follows from that of the symmetric parts.
    antisymmetric: AntisymmetricRate,
    /// Axes from slowest to fastest.
    order: [usize; 3],
    /// ε by position of a cell; of a ghost cell its negative.
    fraction: Vec<f32>,
    /// Slot of its body, or [`SHARED`] and a place in `shared`.
    owner: Vec<u32>,
    shared: Vec<Vec<Share>>,
    /// Places in `shared` to use again.
    unused: Vec<u32>,
    solids: Vec<Solid>,
    sums: Vec<Sums>,
    /// From a cell to its neighbours.
    offsets: [isize; 27],
}

impl Cover {
    /// No body over the cells of `populations`, for passes by this many `workers`.
    #[must_use]
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        method: Method,
        relaxation_time: f64,
        antisymmetric: AntisymmetricRate,
        workers: usize,
    ) -> Self {
        let positions = populations.cell_positions();
        let mut offsets = [0; 27];
        for i in 0..populations.velocities().q() {
            offsets[i] = populations.offset(i);
        }
        Self {
            method,
            time: relaxation_time - 0.5,
            antisymmetric,
            order: populations.order(),
            fraction: vec![0.0; positions],
            owner: vec![NONE; positions],
            shared: Vec::new(),
            unused: Vec::new(),
            solids: Vec::new(),
            sums: (0..workers.max(1)).map(|_| Sums::default()).collect(),
            offsets,
        }
    }

    /// A wall at rest fills these ghost cells.
    pub fn wall_off(&mut self, ghosts: impl Iterator<Item = usize>) {
        for position in ghosts {
            self.fraction[position] = -1.0;
            self.owner[position] = STILL;
        }
    }

    /// Bytes beside the populations for each cell.
    pub const BYTES: usize = size_of::<f32>() + size_of::<u32>();

    /// Room for bodies in these many slots.
    pub fn make_room(&mut self, slots: usize) {
        self.solids.resize(slots, Solid::default());
        for sums in &mut self.sums {
            sums.fit(slots);
        }
    }

    /// Who is in a slot and how it moves.
    pub fn set(&mut self, slot: u32, solid: Solid) {
        if let Some(there) = self.solids.get_mut(slot as usize) {
            *there = solid;
        }
    }

    /// Body `slot` fills `fraction` of the cell at a position, or [`DEEP`]; 0 takes it out. Of a ghost cell give the negative.
    pub fn cover(&mut self, position: usize, slot: u32, fraction: f32) {
        let owner = self.owner[position];
        if owner == STILL {
            return;
        }
        let held = self.fraction[position];
        let sign = if held < 0.0 || fraction < 0.0 {
            -1.0
        } else {
            1.0
        };
        let fraction = fraction.abs();
        if owner == NONE || owner == slot {
            self.fraction[position] = sign * fraction;
            self.owner[position] = if fraction > 0.0 { slot } else { NONE };
            return;
        }
        let place = if owner & SHARED == 0 {
            if fraction <= 0.0 {
                return;
            }
            let first = Share {
                slot: owner,
                fraction: held.abs().min(1.0),
            };
            let place = self.unused.pop().unwrap_or_else(|| {
                self.shared.push(Vec::new());
                number(self.shared.len() - 1)
            });
            self.shared[place as usize].push(first);
            self.owner[position] = SHARED | place;
            place
        } else {
            owner & !SHARED
        };
        let solids = &self.solids;
        let shares = &mut self.shared[place as usize];
        shares.retain(|share| share.slot != slot);
        if fraction > 0.0 {
            let name = |slot: u32| solids.get(slot as usize).map(|solid| solid.name);
            let at = shares.partition_point(|share| name(share.slot) < name(slot));
            let fraction = fraction.min(1.0);
            shares.insert(at, Share { slot, fraction });
        }
        if let [only] = shares[..] {
            shares.clear();
            self.unused.push(place);
            self.owner[position] = only.slot;
            self.fraction[position] = sign * only.fraction;
        } else {
            self.fraction[position] = sign * rounded(total(shares).min(1.0));
        }
    }

    /// The part of a cell that is solid.
    #[must_use]
    pub fn fraction(&self, position: usize) -> f64 {
        f64::from(self.fraction[position].min(1.0))
    }

    /// The fraction as it is held: [`DEEP`] deep inside a body, negative in a ghost cell.
    #[cfg(test)]
    pub(crate) fn held(&self, position: usize) -> f32 {
        self.fraction[position]
    }

    /// Id of the body that fills most of a cell, if solids fill half of it.
    #[must_use]
    pub fn body_at(&self, position: usize) -> Option<u64> {
        if self.fraction[position] < 0.5 {
            return None;
        }
        let owner = self.owner[position];
        let slot = if owner & SHARED == 0 {
            owner
        } else {
            let shares = self.shared.get((owner & !SHARED) as usize)?;
            let mut most = shares.first()?;
            for share in shares {
                if share.fraction > most.fraction {
                    most = share;
                }
            }
            most.slot
        };
        self.solids.get(slot as usize).map(|solid| solid.name.0)
    }

    /// B of a cell (or ε) in quanta: how much of the body force on it the water does not feel.
    #[must_use]
    pub fn weight(&self, position: usize) -> i64 {
        let fraction = self.fraction(position);
        quanta(match self.method.reflection {
            _ if self.fraction[position] > 1.0 => 1.0,
            Reflection::Matched => fraction,
            Reflection::AboutSolid => {
                (1.0 - LEAK) * weight::<f64>(self.method.weighting, self.time, fraction)
            }
            _ => weight::<f64>(self.method.weighting, self.time, fraction),
        })
    }

    /// Velocity of the solids in a cell: `at` are its local coordinates.
    #[must_use]
    pub fn velocity<const D: usize>(&self, position: usize, at: [i32; 3]) -> [f64; 3] {
        let owner = self.owner[position];
        let single = [Share {
            slot: owner,
            fraction: 1.0,
        }];
        let shares = if owner == NONE {
            &[][..]
        } else if owner & SHARED == 0 {
            &single[..]
        } else {
            self.shared
                .get((owner & !SHARED) as usize)
                .map_or(&[][..], Vec::as_slice)
        };
        let mut mean = [0.0; 3];
        for share in shares {
            if let Some(solid) = self.solids.get(share.slot as usize) {
                let v = solid.velocity::<D>(solid.raw(at));
                let part = f64::from(share.fraction) / total(shares);
                for a in 0..D {
                    mean[a] += part * v[a];
                }
            }
        }
        mean
    }

    /// Hands out what each slot received since the last call: forces, and twice the moments about the origin of its raw frame.
    pub fn collect(&mut self, mut give: impl FnMut(u32, &Load)) {
        for sums in &mut self.sums {
            for &slot in &sums.touched {
                let k = slot as usize;
                give(slot, &sums.loads[k]);
                sums.loads[k] = [0; 6];
                sums.known[k] = false;
            }
            sums.touched.clear();
        }
    }

    /// For a pass.
    pub(crate) fn view(&mut self) -> View {
        View {
            fraction: self.fraction.as_ptr(),
            owner: self.owner.as_ptr(),
            solids: self.solids.as_ptr(),
            shared: self.shared.as_ptr(),
            sums: self.sums.as_mut_ptr(),
            method: self.method,
            time: self.time,
            antisymmetric: self.antisymmetric,
            order: self.order,
            offsets: self.offsets,
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a cell holds its fraction in f32"
)]
fn rounded(fraction: f64) -> f32 {
    fraction as f32
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "far fewer than 2^31 cells are shared"
)]
fn number(n: usize) -> u32 {
    n as u32
}

/// ε of a cell: the sum in the order of the bodies.
#[inline(always)]
fn total(shares: &[Share]) -> f64 {
    let mut sum = 0.0;
    for share in shares {
        sum += f64::from(share.fraction);
    }
    sum
}

/// B of cells filled by `fraction`.
#[inline(always)]
fn weight<N: Lanes>(weighting: Weighting, time: f64, fraction: N) -> N {
    match weighting {
        Weighting::Fraction => fraction,
        Weighting::Viscous => {
            let time = N::splat(time);
            fraction * time / ((N::splat(1.0) - fraction) + time)
        }
    }
}

/// What a pass sees of a [`Cover`].
#[derive(Clone, Copy)]
pub(crate) struct View {
    fraction: *const f32,
    owner: *const u32,
    solids: *const Solid,
    shared: *const Vec<Share>,
    sums: *mut Sums,
    method: Method,
    time: f64,
    antisymmetric: AntisymmetricRate,
    order: [usize; 3],
    offsets: [isize; 27],
}

/// Which cells a pass is at.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    /// Position of the first.
    pub(crate) cell: usize,
    /// Plane, row and place in the row of the first.
    pub(crate) at: [usize; 3],
    /// Which of the sums is this worker's.
    pub(crate) worker: usize,
}

impl View {
    /// Of a fluid without covered cells.
    pub(crate) const NONE: Self = Self {
        fraction: std::ptr::null(),
        owner: std::ptr::null(),
        solids: std::ptr::null(),
        shared: std::ptr::null(),
        sums: std::ptr::null_mut(),
        method: Method {
            reflection: Reflection::NonEquilibrium,
            weighting: Weighting::Fraction,
        },
        time: 0.0,
        antisymmetric: AntisymmetricRate::AsSymmetric,
        order: [0; 3],
        offsets: [0; 27],
    };

    /// Whether any of `N::WIDTH` cells is covered.
    ///
    /// # Safety
    /// `cell` must be the position of an interior cell with room for whole vectors after it.
    #[inline(always)]
    pub(crate) unsafe fn covers<N: Lanes>(&self, cell: usize) -> bool {
        let mut any = false;
        for lane in 0..N::WIDTH {
            // SAFETY: promised by the caller.
            any |= unsafe { self.fraction.add(cell + lane).read() } > 0.0;
        }
        any
    }

    /// Turns the outgoing populations `g` of cells that collided as water, with velocity `u`, into those of partially
    /// saturated cells, and adds the forces on the bodies. `before` are the populations that came in. Returns the velocity of
    /// water and solid together.
    ///
    /// # Safety
    /// As for [`Self::covers`]; no other thread may have the same worker.
    #[inline(always)]
    pub(crate) unsafe fn mix<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        place: Place,
        before: &[N; Q],
        g: &mut [N; Q],
        u: [N; 3],
        omega: N,
    ) -> [N; 3]
    where
        f64: Memory<N>,
    {
        let zero = N::splat(0.0);
        let one = N::splat(1.0);
        // The lanes beyond the last cell of a row are ghosts.
        let mut fraction = [0.0; WIDEST];
        for (lane, part) in fraction.iter_mut().enumerate().take(N::WIDTH) {
            // SAFETY: promised by the caller.
            *part = f64::from(unsafe { self.fraction.add(place.cell + lane).read() }.max(0.0));
        }
        // SAFETY: an array of at least the lanes' width.
        let fraction = unsafe { <f64 as Memory<N>>::load(fraction.as_ptr()) };
        // Zero deep inside.
        let shallow = fraction - N::splat(f64::from(DEEP));
        let mut velocity = [[0.0; WIDEST]; 3];
        // SAFETY: promised by the caller.
        unsafe { self.velocities::<L, N, Q>(place, &mut velocity) };
        let mut cell = Cell {
            shallow,
            fraction: shallow.where_zero(one, fraction),
            drho: before[0],
            m: [zero; 3],
            u,
            us: [zero; 3],
            ru: [zero; 3],
            rs: [zero; 3],
            uu: zero,
            ss: zero,
            omega,
        };
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            cell.drho = cell.drho + (before[i] + before[j]);
            let odd = before[i] - before[j];
            let c = L::C[i];
            unroll!(axes a < 3 => {
                match c[a] {
                    1 => cell.m[a] = cell.m[a] + odd,
                    -1 => cell.m[a] = cell.m[a] - odd,
                    _ => {}
                }
            });
        });
        let rho = cell.drho + one;
        unroll!(axes a < 3 => {
            // SAFETY: an array of at least the lanes' width.
            cell.us[a] = unsafe { <f64 as Memory<N>>::load(velocity[a].as_ptr()) };
            cell.ru[a] = rho * u[a];
            cell.rs[a] = rho * cell.us[a];
            cell.uu = cell.ru[a].mul_add(u[a], cell.uu);
            cell.ss = cell.rs[a].mul_add(cell.us[a], cell.ss);
        });
        let act = match self.method.reflection {
            Reflection::Matched => self.matched::<L, N, Q>(&cell, before, g),
            reflection => self.reflected::<L, N, Q>(reflection, &cell, before, g),
        };
        // Deep inside, all that differs from the solid's momentum.
        let mut rest = [[0.0; WIDEST]; 3];
        let mut scale = [0.0; WIDEST];
        let mut share = [0.0; WIDEST];
        // SAFETY: arrays of at least the lanes' width.
        unsafe {
            unroll!(axes a < 3 => {
                let r = shallow.where_zero(zero - cell.m[a], act.rest[a]);
                <f64 as Memory<N>>::store(rest[a].as_mut_ptr(), r);
            });
            let alpha = shallow.where_zero(rho, act.scale);
            <f64 as Memory<N>>::store(scale.as_mut_ptr(), alpha);
            let b = shallow.where_zero(one, fraction.where_zero(zero, act.share));
            <f64 as Memory<N>>::store(share.as_mut_ptr(), b);
        }
        for lane in 0..N::WIDTH {
            if share[lane] > 0.0 {
                let mut force = [0.0; 3];
                for a in 0..L::DIMENSION {
                    let lost = scale[lane] * velocity[a][lane] + rest[a][lane];
                    force[a] = -share[lane] * lost;
                }
                // SAFETY: promised by the caller.
                unsafe { self.act::<L, Q>(place, lane, force) };
            }
        }
        // SAFETY: promised by the caller.
        unsafe { self.touch::<L, N, Q>(place, &cell, g) };
        let mut mixed = u;
        unroll!(axes a < 3 => {
            mixed[a] = cell.fraction.mul_add(cell.us[a] - u[a], u[a]);
        });
        mixed
    }

    /// The operators that mix two collisions by B.
    #[inline(always)]
    fn reflected<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        reflection: Reflection,
        cell: &Cell<N>,
        before: &[N; Q],
        g: &mut [N; Q],
    ) -> Act<N> {
        let zero = N::splat(0.0);
        let shallow = cell.shallow;
        let mut b = weight::<N>(self.method.weighting, self.time, cell.fraction);
        if reflection == Reflection::AboutSolid {
            b = b * N::splat(1.0 - LEAK);
        }
        let keep = N::splat(1.0) - cell.omega;
        let half = N::splat(0.5);
        let stays = N::splat(1.0 - LEAK);
        // At rest no direction: the even part alone.
        let even_u = cell.even::<L, Q>(0, cell.uu, zero);
        let even_s = cell.even::<L, Q>(0, cell.ss, zero);
        let solid = match reflection {
            Reflection::NonEquilibrium => stays * (before[0] - even_u) + (even_s - before[0]),
            Reflection::Superposition => (even_s - before[0]) + keep * (before[0] - even_u),
            _ => zero,
        };
        g[0] = shallow.where_zero(even_s, turned(g[0], before[0], solid, b));
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let c = L::C[i];
            let three = N::splat(3.0 * L::W[i]);
            let (cu, cs) = (along(c, &cell.u), along(c, &cell.us));
            let (mu, ms) = (along(c, &cell.ru), along(c, &cell.rs));
            let even_u = cell.even::<L, Q>(i, cell.uu, mu * cu);
            let even_s = cell.even::<L, Q>(i, cell.ss, ms * cs);
            let (odd_u, odd_s) = (three * mu, three * ms);
            let (x, y) = (before[i], before[j]);
            let (on_i, on_j) = match reflection {
                Reflection::NonEquilibrium => {
                    // Departure from equilibrium, reversed, less what leaks.
                    let (even, odd) = ((x + y) * half - even_u, (x - y) * half - odd_u);
                    let (p, q) = (stays * (even - odd), stays * (even + odd));
                    ((p - x) + (even_s + odd_s), (q - y) + (even_s - odd_s))
                }
                Reflection::Superposition => (
                    ((even_s + odd_s) - x) + keep * (x - (even_u + odd_u)),
                    ((even_s - odd_s) - y) + keep * (y - (even_u - odd_u)),
                ),
                _ => {
                    let odd = (odd_s + odd_s) - (x - y);
                    (odd, zero - odd)
                }
            };
            g[i] = shallow.where_zero(even_s + odd_s, turned(g[i], x, on_i, b));
            g[j] = shallow.where_zero(even_s - odd_s, turned(g[j], y, on_j, b));
        });
        let rho = cell.drho + N::splat(1.0);
        let mut rest = [zero; 3];
        unroll!(axes a < 3 => {
            let (m, ru) = (cell.m[a], cell.ru[a]);
            rest[a] = match reflection {
                Reflection::NonEquilibrium => stays * (ru - m) - m,
                Reflection::Superposition => keep * (m - ru) - m,
                _ => zero - (m + m),
            };
        });
        Act {
            rest,
            scale: match reflection {
                Reflection::NonEquilibrium | Reflection::Superposition => rho,
                _ => rho + rho,
            },
            share: b,
        }
    }

    /// The operator whose steady slow flow does not depend on the viscosity.
    #[inline(always)]
    fn matched<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        cell: &Cell<N>,
        before: &[N; Q],
        g: &mut [N; Q],
    ) -> Act<N> {
        let zero = N::splat(0.0);
        let one = N::splat(1.0);
        let half = N::splat(0.5);
        let shallow = cell.shallow;
        let time = one / cell.omega - half;
        let leak = N::splat(LEAK) * time / (one + time);
        // Of the force, and of what resists.
        let water = one - cell.fraction;
        let open = cell.fraction.mul_add(leak, water);
        let odd_time = match self.antisymmetric {
            AntisymmetricRate::AsSymmetric => time,
            AntisymmetricRate::Magic(magic) => N::splat(magic) / time,
        };
        let of_even = open * (time + half) / open.mul_add(half, time);
        let of_odd = (odd_time + half) / odd_time.mul_add(open, half);
        let pull = N::splat(DRAG) * time * cell.fraction;
        let pull = (pull + pull) / (open + pull);
        let rho = cell.drho + one;
        let mut force = [zero; 3];
        let mut gain = [zero; 3];
        let mut rest = [zero; 3];
        unroll!(axes a < 3 => {
            force[a] = (cell.ru[a] - cell.m[a]) * N::splat(2.0);
            let own = force[a] * water;
            rest[a] = zero - pull * own.mul_add(half, cell.m[a]);
            gain[a] = own + (rest[a] + pull * cell.rs[a]);
        });
        let even_s = cell.even::<L, Q>(0, cell.ss, zero);
        let mixed = of_even.mul_add(g[0] - before[0], before[0]);
        g[0] = shallow.where_zero(even_s, cell.fraction.where_zero(g[0], mixed));
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let c = L::C[i];
            let three = N::splat(3.0 * L::W[i]);
            let (cs, ms) = (along(c, &cell.us), along(c, &cell.rs));
            let even_s = cell.even::<L, Q>(i, cell.ss, ms * cs);
            let odd_s = three * ms;
            let (x, y) = (before[i], before[j]);
            let (p, q) = (g[i] - x, g[j] - y);
            let even = of_even * ((p + q) * half);
            // What the operator does to the odd part beside adding the force.
            let odd = (p - q) * half - three * along(c, &force);
            let odd = of_odd.mul_add(odd, three * along(c, &gain));
            let (on_i, on_j) = (x + (even + odd), y + (even - odd));
            g[i] = shallow.where_zero(even_s + odd_s, cell.fraction.where_zero(g[i], on_i));
            g[j] = shallow.where_zero(even_s - odd_s, cell.fraction.where_zero(g[j], on_j));
        });
        Act {
            rest,
            scale: pull * rho,
            share: one,
        }
    }

    /// Coordinates of a cell of the slab.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "coordinates are far below 2^31"
    )]
    fn coordinates(&self, place: Place, lane: usize) -> [i32; 3] {
        let mut cell = [0; 3];
        cell[self.order[0]] = place.at[0] as i32;
        cell[self.order[1]] = place.at[1] as i32;
        cell[self.order[2]] = (place.at[2] + lane) as i32;
        cell
    }

    /// The bodies of a covered cell from its owner: one with all of it, or several with their parts.
    ///
    /// # Safety
    /// `owner` must be that of a cell that bodies cover.
    #[inline(always)]
    unsafe fn shares(&self, owner: u32) -> (u32, &[Share]) {
        if owner & SHARED == 0 {
            (owner, &[])
        } else {
            // SAFETY: `owner` was made by `Cover::cover`.
            (owner, unsafe {
                &*self.shared.add((owner & !SHARED) as usize)
            })
        }
    }

    /// Velocities of the solids in the covered ones of `N::WIDTH` cells.
    ///
    /// # Safety
    /// As for [`Self::covers`].
    #[inline(always)]
    unsafe fn velocities<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        place: Place,
        velocity: &mut [[f64; WIDEST]; 3],
    ) {
        for lane in 0..N::WIDTH {
            let cell = place.cell + lane;
            // SAFETY: promised by the caller.
            if unsafe { self.fraction.add(cell).read() } <= 0.0 {
                continue;
            }
            let at = self.coordinates(place, lane);
            // SAFETY: the cell is covered.
            let (owner, shares) = unsafe { self.shares(self.owner.add(cell).read()) };
            let mut mean = [0.0; 3];
            if shares.is_empty() {
                // SAFETY: slots were made by `Cover::make_room`.
                mean = unsafe { self.velocity::<L, Q>(owner, at) };
            } else {
                let all = total(shares);
                for share in shares {
                    // SAFETY: as above.
                    let v = unsafe { self.velocity::<L, Q>(share.slot, at) };
                    let part = f64::from(share.fraction) / all;
                    mean = [
                        mean[0] + part * v[0],
                        mean[1] + part * v[1],
                        mean[2] + part * v[2],
                    ];
                }
            }
            velocity[0][lane] = mean[0];
            velocity[1][lane] = mean[1];
            velocity[2][lane] = mean[2];
        }
    }

    /// # Safety
    /// The slot must exist.
    #[inline(always)]
    unsafe fn velocity<L: Lattice<Q>, const Q: usize>(
        &self,
        slot: u32,
        cell: [i32; 3],
    ) -> [f64; 3] {
        // SAFETY: promised by the caller.
        let solid = unsafe { &*self.solids.add(slot as usize) };
        if L::DIMENSION == 2 {
            solid.velocity::<2>(solid.raw(cell))
        } else {
            solid.velocity::<3>(solid.raw(cell))
        }
    }

    /// Adds the force of a cell to its bodies, by their parts.
    ///
    /// # Safety
    /// As for [`Self::mix`], of a covered cell.
    #[inline(always)]
    unsafe fn act<L: Lattice<Q>, const Q: usize>(
        &self,
        place: Place,
        lane: usize,
        force: [f64; 3],
    ) {
        let at = self.coordinates(place, lane);
        // SAFETY: promised by the caller; each worker has sums of its own.
        let ((owner, shares), sums) = unsafe {
            (
                self.shares(self.owner.add(place.cell + lane).read()),
                &mut *self.sums.add(place.worker),
            )
        };
        let mut give = |slot: u32, part: f64| {
            // SAFETY: slots were made by `Cover::make_room`.
            let raw = unsafe { (*self.solids.add(slot as usize)).raw(at) };
            let force = force.map(|f| part * f);
            if L::DIMENSION == 2 {
                sums.add::<2>(slot, raw, force);
            } else {
                sums.add::<3>(slot, raw, force);
            }
        };
        if shares.is_empty() {
            give(owner, 1.0);
        } else {
            let all = total(shares);
            for share in shares {
                give(share.slot, f64::from(share.fraction) / all);
            }
        }
    }
}

/// Moments of cells and their solids.
struct Cell<N> {
    /// Zero deep inside.
    shallow: N,
    /// ε
    fraction: N,
    drho: N,
    /// Momentum that came in.
    m: [N; 3],
    /// Velocity with half the force, and of the solid.
    u: [N; 3],
    us: [N; 3],
    /// Both times the density, and their squares.
    ru: [N; 3],
    rs: [N; 3],
    uu: N,
    ss: N,
    omega: N,
}

impl<N: Lanes> Cell<N> {
    /// Even part of the equilibrium of population i: `squared` is ρ v·v, `along` ρ (c·v)².
    #[inline(always)]
    fn even<L: Lattice<Q>, const Q: usize>(&self, i: usize, squared: N, along: N) -> N {
        let rest = self.drho - N::splat(1.5) * squared;
        N::splat(L::W[i]) * along.mul_add(N::splat(4.5), rest)
    }
}

/// The force on the solids of a cell: -share (scale u_s + rest).
struct Act<N> {
    rest: [N; 3],
    scale: N,
    share: N,
}

/// g* where no solid is, else f + (1 - B) (g* - f) + B Ω^s.
#[inline(always)]
fn turned<N: Lanes>(g: N, before: N, solid: N, b: N) -> N {
    let mixed = b.mul_add(solid - (g - before), g);
    b.where_zero(g, mixed)
}

/// Sum of quanta of B as a number of cells.
#[must_use]
pub fn cells(weight: i128) -> f64 {
    from_quanta(weight)
}

mod contact;
#[cfg(test)]
mod tests;
