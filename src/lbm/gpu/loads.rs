//! Loads on bodies, summed by all threads of a GPU with atomic additions of integers, so that the result does not
//! depend on the order.
//!
//! They are separate from [`crate::links::Load`], the sum of forces and moments in quanta on the processor, because
//! that needs more than 64 bits and a GPU adds at most 64 bits atomically. The upper and lower halves of each force are
//! therefore summed separately. Moments are taken about a cell inside the body, so that the arms are short: a sum over
//! fewer than 2^18 cells of a body with a diameter of up to 2^11 cells cannot overflow.

use crate::lattice::unroll;
use crate::saturation::solid::CoveringBody;
use core::sync::atomic::{AtomicU64, Ordering};

/// Load on a body. The layout is the same on the host and on the GPU.
#[derive(Debug, Default)]
#[repr(C)]
pub struct BodyLoad {
    /// Lower halves of the force, upper halves of the force, and the moments of the lower and of the upper halves;
    /// three components each.
    parts: [AtomicU64; 12],
}

/// Returns the cell, in the raw frame of the body, about which moments are taken.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "cells are far below 2^31")]
fn origin(solid: &CoveringBody) -> [i32; 3] {
    let p = solid.motion.position;
    [p[0] as i32, p[1] as i32, p[2] as i32]
}

/// Returns the moment at × f of a force at an arm.
#[inline(always)]
fn moments(at: [i64; 3], f: [i64; 3]) -> [i64; 3] {
    [
        at[1] * f[2] - at[2] * f[1],
        at[2] * f[0] - at[0] * f[2],
        at[0] * f[1] - at[1] * f[0],
    ]
}

impl BodyLoad {
    /// Number of 64-bit words of a load.
    pub const WORDS: usize = 12;

    /// Number of partial loads of each body. With several, fewer threads wait for the same address.
    pub const COPIES: u32 = 4;

    /// Returns the load with these words, in the order of memory; missing words are zero.
    #[must_use]
    pub fn from_parts(parts: &[u64]) -> Self {
        let load = Self::default();
        for (to, from) in load.parts.iter().zip(parts) {
            to.store(*from, Ordering::Relaxed);
        }
        load
    }

    /// Returns the words that a force in quanta adds; it acts at the centre of cell `raw` of the raw frame of the body.
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

    /// Adds the words of a force, or the sums of the words of several forces.
    #[inline(always)]
    pub(crate) fn add_parts(&self, parts: [i64; 12]) {
        unroll!(populations n < 12 => {
            if parts[n] != 0 {
                self.parts[n].fetch_add(parts[n].cast_unsigned(), Ordering::Relaxed);
            }
        });
    }

    /// Adds a force in quanta that acts at the centre of cell `raw` of the raw frame of the body.
    #[inline(always)]
    pub fn add<const D: usize>(&self, solid: &CoveringBody, raw: [i32; 3], force: [i64; 3]) {
        self.add_parts(Self::parts::<D>(solid, raw, force));
    }

    /// Returns the force, and twice the moment about the origin of the raw frame, in quanta.
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
