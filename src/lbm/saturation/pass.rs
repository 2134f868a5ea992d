//! Collision of covered cells, called by the pass over all cells.
//!
//! It is separate from the solid collision operators, which act on populations only: here, fractions and velocities of
//! the solids are read, and forces are added to the sums of the bodies.

#[cfg(not(target_arch = "nvptx64"))]
use super::cover::Cover;
use super::solid::{BETWEEN, CoveringBody, DEEP, SHARED, Share, Shares, total};
use super::sums::Sums;
use super::{Act, Cell, CoveredFluid, SolidOperator, Weighting};
use crate::collision::trt::AntisymmetricRate;
use crate::lanes::{Lanes, Memory, WIDEST};
use crate::lattice::{Lattice, unroll};
use crate::quanta::quanta;

/// Data of a [`Cover`] that a pass reads, by address.
#[derive(Clone, Copy)]
#[repr(C)]
pub(crate) struct View {
    /// Solid fraction and owner of each cell, by position.
    pub(super) fraction: *const f32,
    pub(super) owner: *const u32,
    /// Bodies by slot.
    pub(super) solids: *const CoveringBody,
    /// Lists of the bodies of the cells that several bodies cover.
    pub(super) shared: *const Shares,
    /// Sums of the forces, one for each worker.
    pub(super) sums: *mut Sums,
    pub(super) operator: SolidOperator,
    pub(super) fluid: CoveredFluid,
    /// Axes from slowest to fastest in memory.
    pub(super) order: [usize; 3],
    /// Distance in positions between neighbours along each axis.
    pub(super) strides: [isize; 3],
    /// Half of the body force on the fluid inside solids.
    pub(super) inside: [f64; 3],
}

/// Location of the current cells of a pass, one per lane.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    /// Position of the first cell.
    pub(crate) cell: usize,
    /// Plane, row and index in the row of the first cell.
    pub(crate) at: [usize; 3],
    /// Sums of the forces of this worker.
    pub(crate) sums: *mut Sums,
}

/// Lanes with functions for covered cells that are not inlined. They depend on the velocity set only, so that they are
/// not compiled again for the pass of each operator and storage type.
pub(crate) trait Covers: Lanes {
    /// Calls [`View::mix`].
    ///
    /// # Safety
    /// The conditions are those of [`View::mix`], and the processor must support the instructions of these lanes.
    unsafe fn mix<L: Lattice<Q>, const Q: usize>(
        view: &View,
        place: Place,
        before: &[Self; Q],
        fluid: &[Self; Q],
        g: &mut [Self; Q],
        site: ([Self; 3], Self),
    ) -> [Self; 3];

    /// Calls [`View::fill`].
    ///
    /// # Safety
    /// The conditions are those of [`View::fill`], and the processor must support the instructions of these lanes.
    unsafe fn fill<L: Lattice<Q>, const Q: usize>(
        view: &View,
        place: Place,
        before: &[Self; Q],
        g: &mut [Self; Q],
    );
}

macro_rules! covers {
    ($lanes:ty $(, $features:literal)?) => {
        impl Covers for $lanes {
            #[inline(always)]
            unsafe fn mix<L: Lattice<Q>, const Q: usize>(
                view: &View,
                place: Place,
                before: &[Self; Q],
                fluid: &[Self; Q],
                g: &mut [Self; Q],
                site: ([Self; 3], Self),
            ) -> [Self; 3] {
                $(#[target_feature(enable = $features)])?
                #[inline(never)]
                unsafe fn outlined<L: Lattice<Q>, const Q: usize>(
                    view: &View,
                    place: Place,
                    before: &[$lanes; Q],
                    fluid: &[$lanes; Q],
                    g: &mut [$lanes; Q],
                    site: &([$lanes; 3], $lanes),
                    mixed: &mut [$lanes; 3],
                ) {
                    // SAFETY: forwarded from the caller.
                    *mixed = unsafe { view.mix::<L, $lanes, Q>(place, before, fluid, g, *site) };
                }
                let mut mixed = site.0;
                // SAFETY: forwarded from the caller.
                unsafe { outlined::<L, Q>(view, place, before, fluid, g, &site, &mut mixed) };
                mixed
            }

            #[inline(always)]
            unsafe fn fill<L: Lattice<Q>, const Q: usize>(
                view: &View,
                place: Place,
                before: &[Self; Q],
                g: &mut [Self; Q],
            ) {
                $(#[target_feature(enable = $features)])?
                #[inline(never)]
                unsafe fn outlined<L: Lattice<Q>, const Q: usize>(
                    view: &View,
                    place: Place,
                    before: &[$lanes; Q],
                    g: &mut [$lanes; Q],
                ) {
                    // SAFETY: forwarded from the caller.
                    unsafe { view.fill::<L, $lanes, Q>(place, before, g) };
                }
                // SAFETY: forwarded from the caller.
                unsafe { outlined::<L, Q>(view, place, before, g) };
            }
        }
    };
}
#[cfg(not(target_arch = "nvptx64"))]
covers!(f64);
#[cfg(target_arch = "x86_64")]
covers!(crate::lanes::Avx2, "avx2,fma");
#[cfg(target_arch = "x86_64")]
covers!(
    crate::lanes::Avx512,
    "avx512f,avx512dq,avx512bw,avx512vl,avx2,fma"
);

impl View {
    /// View for a fluid without covered cells; its addresses are null and not read.
    pub(crate) const NONE: Self = Self {
        fraction: core::ptr::null(),
        owner: core::ptr::null(),
        solids: core::ptr::null(),
        shared: core::ptr::null(),
        sums: core::ptr::null_mut(),
        operator: SolidOperator::NonEquilibriumBounceBack,
        fluid: CoveredFluid {
            weighting: Weighting::Fraction,
            time: 0.0,
            antisymmetric: AntisymmetricRate::AsSymmetric,
        },
        order: [0; 3],
        strides: [0; 3],
        inside: [0.0; 3],
    };

    /// Returns the view of a cover for the next pass.
    #[cfg(not(target_arch = "nvptx64"))]
    pub(crate) fn from_cover(cover: &mut Cover) -> Self {
        let shared = cover.list_shares();
        Self {
            fraction: cover.fraction.as_ptr(),
            owner: cover.owner.as_ptr(),
            solids: cover.solids.as_ptr(),
            shared,
            sums: cover.sums.as_mut_ptr(),
            operator: cover.method.operator,
            fluid: cover.fluid,
            order: cover.order,
            strides: cover.strides,
            inside: cover.inside,
        }
    }

    /// Returns the view of a cover for a pass on a GPU. The addresses on the GPU are those of fractions, owners,
    /// bodies, and lists of bodies.
    #[cfg(not(target_arch = "nvptx64"))]
    pub(crate) fn on_gpu(cover: &Cover, addresses: [u64; 4]) -> Self {
        // A GPU has addresses of 64 bits, like any host with a GPU.
        let [fraction, owner, solids, shared] = addresses.map(|at| {
            let at = usize::try_from(at).unwrap_or(0);
            core::ptr::without_provenance::<u8>(at)
        });
        Self {
            fraction: fraction.cast(),
            owner: owner.cast(),
            solids: solids.cast(),
            shared: shared.cast(),
            sums: core::ptr::null_mut(),
            operator: cover.method.operator,
            fluid: cover.fluid,
            order: cover.order,
            strides: cover.strides,
            inside: cover.inside,
        }
    }

    /// Sets the address of the bodies on the GPU.
    #[cfg(not(target_arch = "nvptx64"))]
    pub(crate) fn move_solids(&mut self, address: u64) {
        let at = usize::try_from(address).unwrap_or(0);
        self.solids = core::ptr::without_provenance(at);
    }

    /// Sets half of the body force on the fluid inside solids.
    #[cfg(not(target_arch = "nvptx64"))]
    pub(crate) fn set_inside(&mut self, half: [f64; 3]) {
        self.inside = half;
    }

    /// Returns half of the body force on the fluid inside solids, in every lane.
    #[inline(always)]
    fn force_inside<N: Lanes>(&self) -> [N; 3] {
        let [x, y, z] = self.inside;
        [N::splat(x), N::splat(y), N::splat(z)]
    }

    /// Returns the bodies by slot.
    #[cfg(target_arch = "nvptx64")]
    pub(crate) fn solids(&self) -> *const CoveringBody {
        self.solids
    }

    /// Returns the sums of a worker, whose index must be below the number of workers of the cover.
    #[cfg(not(target_arch = "nvptx64"))]
    #[inline(always)]
    pub(crate) fn sums_of(&self, worker: usize) -> *mut Sums {
        self.sums.wrapping_add(worker)
    }

    /// Returns `true` if any of `N::WIDTH` cells is covered.
    ///
    /// # Safety
    /// `cell` must be the position of an interior cell, from which the fractions and owners of a whole vector of cells
    /// are readable.
    #[inline(always)]
    pub(crate) unsafe fn covers<N: Lanes>(&self, cell: usize) -> bool {
        // SAFETY: promised by the caller.
        unsafe { N::above(self.fraction.add(cell), 0.0) != 0 }
    }

    /// Returns `true` if all of `N::WIDTH` cells are deep inside bodies, that is, without fluid in neighbouring cells.
    ///
    /// # Safety
    /// The conditions are those of [`Self::covers`].
    #[inline(always)]
    pub(crate) unsafe fn fills<N: Lanes>(&self, cell: usize) -> bool {
        // SAFETY: promised by the caller.
        let deep = unsafe { N::above(self.fraction.add(cell), BETWEEN) };
        deep == const { u8::MAX >> (8 - N::WIDTH) }
    }

    /// Returns the slot of the only body that covers any of `N::WIDTH` cells, or `None` if there are several. At least
    /// one cell must be covered.
    ///
    /// # Safety
    /// The conditions are those of [`Self::covers`].
    #[inline(always)]
    unsafe fn sole<N: Lanes>(&self, cell: usize) -> Option<u32> {
        // SAFETY: promised by the caller.
        unsafe {
            let owner = self.owner.add(cell);
            let covered = N::above(self.fraction.add(cell), 0.0);
            let first = owner.add(covered.trailing_zeros() as usize).read();
            let others = covered & !N::equal(owner, first);
            (others == 0 && first & SHARED == 0).then_some(first)
        }
    }

    /// Returns the density deviation and the momentum Σ c f of the incoming populations.
    #[inline(always)]
    pub(crate) fn moments<L: Lattice<Q>, N: Lanes, const Q: usize>(before: &[N; Q]) -> (N, [N; 3]) {
        let mut drho = before[0];
        let mut m = [N::splat(0.0); 3];
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            drho = drho + (before[i] + before[j]);
            let odd = before[i] - before[j];
            let c = L::C[i];
            unroll!(axes a < 3 => {
                match c[a] {
                    1 => m[a] = m[a] + odd,
                    -1 => m[a] = m[a] - odd,
                    _ => {}
                }
            });
        });
        (drho, m)
    }

    /// Sets the outgoing populations `g` of cells deep inside bodies, and adds the forces on the bodies, with the same
    /// result as [`Self::mix`]. `before` are the incoming populations.
    ///
    /// # Safety
    /// The conditions are those of [`Self::mix`], and [`Self::fills`] must be `true`.
    #[inline(always)]
    pub(crate) unsafe fn fill<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        place: Place,
        before: &[N; Q],
        g: &mut [N; Q],
    ) where
        f64: Memory<N>,
    {
        let (zero, one) = (N::splat(0.0), N::splat(1.0));
        // SAFETY: promised by the caller.
        let sole = unsafe { self.sole::<N>(place.cell) };
        let (drho, m) = Self::moments::<L, N, Q>(before);
        let mut cell = Cell {
            fraction: one,
            drho,
            m,
            u: [zero; 3],
            // SAFETY: promised by the caller.
            us: unsafe { self.velocities::<L, N, Q>(place, sole) },
            ru: [zero; 3],
            rs: [zero; 3],
            uu: zero,
            ss: zero,
            omega: one,
            inside: self.force_inside(),
        };
        let rho = drho + one;
        unroll!(axes a < 3 => {
            cell.rs[a] = rho * cell.us[a];
            cell.ss = cell.rs[a].mul_add(cell.us[a], cell.ss);
        });
        cell.at_solid::<L, Q>(|i, value| g[i] = value);
        let half = &cell.inside;
        let act = Act {
            rest: [half[0] - m[0], half[1] - m[1], half[2] - m[2]],
            scale: rho,
            share: one,
        };
        // SAFETY: promised by the caller.
        unsafe { self.act_on_all::<L, N, Q>(place, sole, &cell.us, &act) };
    }

    /// Computes the outgoing populations `g` of partially saturated cells from the incoming ones, `before`, and those
    /// after the fluid collision, `fluid`, and adds the forces on the bodies. `site` is the velocity of the fluid and
    /// its relaxation rate. Returns the mean velocity of fluid and solid, weighted by volume.
    ///
    /// # Safety
    /// The conditions are those of [`Self::covers`], which must be `true`; no other thread may use the same sums.
    #[inline(always)]
    pub(crate) unsafe fn mix<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        place: Place,
        before: &[N; Q],
        fluid: &[N; Q],
        g: &mut [N; Q],
        site: ([N; 3], N),
    ) -> [N; 3]
    where
        f64: Memory<N>,
    {
        let moments = Self::moments::<L, N, Q>(before);
        // SAFETY: promised by the caller.
        unsafe { self.mix_with_moments::<L, N, Q>(place, (before, moments), fluid, g, site) }
    }

    /// Does the work of [`Self::mix`], given the density deviation and the momentum of `before`.
    ///
    /// # Safety
    /// The conditions are those of [`Self::mix`].
    #[inline(always)]
    pub(crate) unsafe fn mix_with_moments<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        place: Place,
        (before, (drho, m)): (&[N; Q], (N, [N; 3])),
        fluid: &[N; Q],
        g: &mut [N; Q],
        (u, omega): ([N; 3], N),
    ) -> [N; 3]
    where
        f64: Memory<N>,
    {
        let zero = N::splat(0.0);
        let one = N::splat(1.0);
        // The lanes beyond the last cell of a row are ghosts, whose fractions may be negative.
        let mut fraction = [0.0; WIDEST];
        for (lane, part) in fraction.iter_mut().enumerate().take(N::WIDTH) {
            // SAFETY: promised by the caller.
            *part = f64::from(unsafe { self.fraction.add(place.cell).add(lane).read() }.max(0.0));
        }
        // SAFETY: promised by the caller.
        let some_deep = unsafe { N::above(self.fraction.add(place.cell), BETWEEN) } != 0;
        // SAFETY: the array has at least as many elements as lanes.
        let fraction = unsafe { <f64 as Memory<N>>::load(fraction.as_ptr()) };
        // Zero in lanes deep inside bodies.
        let shallow = fraction - N::splat(f64::from(DEEP));
        // SAFETY: promised by the caller.
        let sole = unsafe { self.sole::<N>(place.cell) };
        let mut cell = Cell {
            fraction: shallow.where_zero(one, fraction),
            drho,
            m,
            u,
            // SAFETY: promised by the caller.
            us: unsafe { self.velocities::<L, N, Q>(place, sole) },
            ru: [zero; 3],
            rs: [zero; 3],
            uu: zero,
            ss: zero,
            omega,
            inside: self.force_inside(),
        };
        let rho = cell.drho + one;
        unroll!(axes a < 3 => {
            cell.ru[a] = rho * u[a];
            cell.rs[a] = rho * cell.us[a];
            cell.uu = cell.ru[a].mul_add(u[a], cell.uu);
            cell.ss = cell.rs[a].mul_add(cell.us[a], cell.ss);
        });
        let mut act = self
            .operator
            .collide::<L, N, Q>(&self.fluid, &cell, before, fluid, g);
        act.share = fraction.where_zero(zero, act.share);
        if some_deep {
            cell.at_solid::<L, Q>(|i, value| g[i] = shallow.where_zero(value, g[i]));
            // Deep inside, the momentum becomes that of the solid and half of the force, so that the fluid loses
            // m - ρ u_s - F/2.
            unroll!(axes a < 3 => {
                act.rest[a] = shallow.where_zero(cell.inside[a] - cell.m[a], act.rest[a]);
            });
            act.scale = shallow.where_zero(rho, act.scale);
            act.share = shallow.where_zero(one, act.share);
        }
        // SAFETY: promised by the caller.
        unsafe {
            self.act_on_all::<L, N, Q>(place, sole, &cell.us, &act);
            self.touch::<L, N, Q>(place, sole, &cell, g);
        }
        let mut mixed = u;
        unroll!(axes a < 3 => {
            mixed[a] = cell.fraction.mul_add(cell.us[a] - u[a], u[a]);
        });
        mixed
    }

    /// Adds the forces of `N::WIDTH` cells to the sums of their bodies. If there is a single body, `sole`, the forces
    /// of all lanes are added at once; the result is the same, because they are integers.
    ///
    /// # Safety
    /// The conditions are those of [`Self::mix`]; `sole` and `velocity` must be those of these cells.
    #[inline(always)]
    unsafe fn act_on_all<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        place: Place,
        sole: Option<u32>,
        velocity: &[N; 3],
        act: &Act<N>,
    ) where
        f64: Memory<N>,
    {
        /// Bound of a force in quanta below which the sum over eight lanes, weighted by indices up to 7, fits in an
        /// i64.
        const SMALL: u64 = 1 << 57;
        let mut share = [0.0; WIDEST];
        let mut forces = [[0.0; WIDEST]; 3];
        // SAFETY: the arrays have at least as many elements as lanes.
        unsafe {
            <f64 as Memory<N>>::store(share.as_mut_ptr(), act.share);
            unroll!(axes a < 3 => {
                let lost = act.scale * velocity[a] + act.rest[a];
                let force = (N::splat(0.0) - act.share) * lost;
                <f64 as Memory<N>>::store(forces[a].as_mut_ptr(), force);
            });
        }
        if let Some(slot) = sole {
            let (mut sum, mut weighted) = ([0_i64; 3], [0_i64; 3]);
            let (mut all, mut acts) = (0, false);
            for (place, lane) in (0_i64..).zip(0..N::WIDTH) {
                let counts = share[lane] > 0.0;
                acts |= counts;
                for a in 0..L::DIMENSION {
                    let f = if counts { quanta(forces[a][lane]) } else { 0 };
                    all |= f.unsigned_abs();
                    sum[a] = sum[a].wrapping_add(f);
                    weighted[a] = weighted[a].wrapping_add(place.wrapping_mul(f));
                }
            }
            if all < SMALL {
                if acts {
                    // SAFETY: promised by the caller; each worker has sums of its own.
                    unsafe {
                        let raw = (*self.solids.add(slot as usize)).raw(self.coordinates(place, 0));
                        let sums = &mut *place.sums;
                        if L::DIMENSION == 2 {
                            sums.add_row::<2>(slot, raw, self.order[2], sum, weighted);
                        } else {
                            sums.add_row::<3>(slot, raw, self.order[2], sum, weighted);
                        }
                    }
                }
                return;
            }
        }
        for lane in 0..N::WIDTH {
            if share[lane] > 0.0 {
                let force = [forces[0][lane], forces[1][lane], forces[2][lane]];
                // SAFETY: promised by the caller.
                unsafe { self.act::<L, Q>(place, lane, force) };
            }
        }
    }

    /// Returns the coordinates in the slab of the cell of a lane.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "coordinates are far below 2^31"
    )]
    pub(super) fn coordinates(&self, place: Place, lane: usize) -> [i32; 3] {
        let [slow, middle, _] = self.order;
        let [plane, row, place] = [place.at[0], place.at[1], place.at[2] + lane];
        // Branches instead of an index that depends on the order keep the values in registers: a GPU stores an array in
        // memory if an index is known only at run time.
        let along = |axis: usize| {
            if axis == slow {
                plane as i32
            } else if axis == middle {
                row as i32
            } else {
                place as i32
            }
        };
        [along(0), along(1), along(2)]
    }

    /// Returns the bodies of a covered cell, given its owner: the slot of a single body and an empty list, or the list
    /// of several bodies with their fractions.
    ///
    /// # Safety
    /// `owner` must be that of a cell that bodies cover.
    #[inline(always)]
    pub(super) unsafe fn shares(&self, owner: u32) -> (u32, &[Share]) {
        if owner & SHARED == 0 {
            (owner, &[])
        } else {
            // SAFETY: `Cover::cover` or a GPU kernel set `owner` to the index of a list.
            (owner, unsafe {
                (*self.shared.add((owner & !SHARED) as usize)).parts()
            })
        }
    }

    /// Returns the velocities of the solids in the covered ones of `N::WIDTH` cells; `sole` is the body that covers all
    /// of them, if there is one.
    ///
    /// # Safety
    /// The conditions are those of [`Self::covers`].
    #[inline(always)]
    unsafe fn velocities<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        place: Place,
        sole: Option<u32>,
    ) -> [N; 3]
    where
        f64: Memory<N>,
    {
        let Some(slot) = sole else {
            let mut velocity = [[0.0; WIDEST]; 3];
            // SAFETY: promised by the caller.
            unsafe { self.velocities_one_by_one::<L, N, Q>(place, &mut velocity) };
            // The compiler would not inline `map` of an array of lanes.
            let mut lanes = [N::splat(0.0); 3];
            for (lanes, v) in lanes.iter_mut().zip(&velocity) {
                // SAFETY: the array has at least as many elements as lanes.
                *lanes = unsafe { <f64 as Memory<N>>::load(v.as_ptr()) };
            }
            return lanes;
        };
        // SAFETY: the slot is one of `solids`, which has an entry for each slot of an owner.
        let solid = unsafe { &*self.solids.add(slot as usize) };
        let raw = solid.raw(self.coordinates(place, 0));
        let mut r = [N::splat(0.0); 3];
        unroll!(axes a < 3 => {
            if a < L::DIMENSION {
                let step = if a == self.order[2] { 1.0 } else { 0.0 };
                let at = N::count().mul_add(N::splat(step), N::splat(f64::from(raw[a])));
                r[a] = at + N::splat(0.5) - N::splat(solid.motion.position[a]);
            }
        });
        // The operations are those of `surface_velocity` in the same order, so that the bits are the same.
        let splat = |v: [f64; 3]| [N::splat(v[0]), N::splat(v[1]), N::splat(v[2])];
        let (u, w) = (splat(solid.motion.velocity), splat(solid.motion.spin));
        if L::DIMENSION == 2 {
            [u[0] - w[2] * r[1], u[1] + w[2] * r[0], N::splat(0.0)]
        } else {
            [
                u[0] + (w[1] * r[2] - w[2] * r[1]),
                u[1] + (w[2] * r[0] - w[0] * r[2]),
                u[2] + (w[0] * r[1] - w[1] * r[0]),
            ]
        }
    }

    /// Computes the velocities of the solids in `N::WIDTH` cells one by one, for cells of several bodies.
    ///
    /// # Safety
    /// The conditions are those of [`Self::covers`].
    unsafe fn velocities_one_by_one<L: Lattice<Q>, N: Lanes, const Q: usize>(
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
                // SAFETY: the slot is one of `solids`, which has an entry for each slot of an owner.
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

    /// Returns the velocity of the body in a slot at the centre of a cell.
    ///
    /// # Safety
    /// The slot must be that of a body.
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

    /// Adds the force of the cell of a lane to its bodies, in proportion to their fractions.
    ///
    /// # Safety
    /// The conditions are those of [`Self::mix`], and the cell must be covered.
    #[inline(always)]
    pub(super) unsafe fn act<L: Lattice<Q>, const Q: usize>(
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
                &mut *place.sums,
            )
        };
        let mut give = |slot: u32, part: f64| {
            // SAFETY: the slot is one of `solids`, which has an entry for each slot of an owner.
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
