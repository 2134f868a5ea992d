//! Forces on bodies, summed by all threads of a GPU at once: integers, so that the order is of no account.
//!
//! A load is a sum of forces in quanta and of their moments, which need more than 64 bits ([`crate::links::Load`]). A
//! GPU adds 64 bits at a time. Upper and lower halves of each force are therefore summed apart, and moments are taken
//! about a cell inside the body, whose arms are short: no sum over fewer than 2^18 cells of a body 2^11 cells across
//! can overflow.

use crate::lattice::unroll;
use crate::saturation::solid::CoveringBody;
use core::sync::atomic::{AtomicU64, Ordering};

/// The load on a body. The same bytes on the host and on the GPU.
#[derive(Debug, Default)]
#[repr(C)]
pub struct BodyLoad {
    /// Forces: lower halves, then upper halves; moments likewise.
    parts: [AtomicU64; 12],
}

/// The cell of the body's raw frame about which moments are taken.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "cells are far below 2^31")]
fn origin(solid: &CoveringBody) -> [i32; 3] {
    let p = solid.motion.position;
    [p[0] as i32, p[1] as i32, p[2] as i32]
}

/// Moments of a force at an arm.
#[inline(always)]
fn moments(at: [i64; 3], f: [i64; 3]) -> [i64; 3] {
    [
        at[1] * f[2] - at[2] * f[1],
        at[2] * f[0] - at[0] * f[2],
        at[0] * f[1] - at[1] * f[0],
    ]
}

impl BodyLoad {
    /// Number of words of a load.
    pub const WORDS: usize = 12;

    /// Loads of each body, so that fewer threads wait for the same memory.
    pub const COPIES: u32 = 4;

    /// Returns the load of its parts as they lie in memory; missing ones are zero.
    #[must_use]
    pub fn from_parts(parts: &[u64]) -> Self {
        let load = Self::default();
        for (to, from) in load.parts.iter().zip(parts) {
            to.store(*from, Ordering::Relaxed);
        }
        load
    }

    /// Returns the parts that a force in quanta at the middle of a cell of the raw frame of the body adds.
    #[inline(always)]
    pub(crate) fn parts<const D: usize>(
        solid: &CoveringBody,
        raw: [i32; 3],
        force: [i64; 3],
    ) -> [i64; 12] {
        let origin = origin(solid);
        let mut arm = [0; 3];
        let (mut lower, mut upper) = ([0; 3], [0; 3]);
        for a in 0..D {
            arm[a] = i64::from(2 * (raw[a] - origin[a]) + 1);
            lower[a] = force[a] & 0xffff_ffff;
            upper[a] = force[a] >> 32;
        }
        let turns = [moments(arm, lower), moments(arm, upper)];
        let ([x, y, z], [p, q, r]) = (lower, upper);
        let [[a, b, c], [d, e, f]] = turns;
        [x, y, z, p, q, r, a, b, c, d, e, f]
    }

    /// Adds parts, or the sums of some.
    #[inline(always)]
    pub(crate) fn add_parts(&self, parts: [i64; 12]) {
        unroll!(populations n < 12 => {
            if parts[n] != 0 {
                self.parts[n].fetch_add(parts[n].cast_unsigned(), Ordering::Relaxed);
            }
        });
    }

    /// Adds a force in quanta at the middle of a cell of the raw frame of the body.
    #[inline(always)]
    pub fn add<const D: usize>(&self, solid: &CoveringBody, raw: [i32; 3], force: [i64; 3]) {
        self.add_parts(Self::parts::<D>(solid, raw, force));
    }

    /// Force, and twice the moment about the origin of the raw frame, in quanta.
    #[must_use]
    pub fn total(&self, solid: &CoveringBody) -> [i128; 6] {
        let whole = |lower: usize| {
            let part = |n: usize| {
                let bits = self.parts[n].load(Ordering::Relaxed);
                i128::from(bits.cast_signed())
            };
            part(lower) + (part(lower + 3) << 32)
        };
        let force = [whole(0), whole(1), whole(2)];
        let about = origin(solid).map(|x| 2 * i128::from(x));
        let turn = |a: usize, b: usize| about[a] * force[b] - about[b] * force[a];
        [
            force[0],
            force[1],
            force[2],
            whole(6) + turn(1, 2),
            whole(7) + turn(2, 0),
            whole(8) + turn(0, 1),
        ]
    }
}
