//! Moments of a wet cell.

use crate::lanes::Stored;
use crate::populations::Populations;

/// Density, velocity without the force, and the second moment less that of the equilibrium: xx, yy, zz, xy, xz, yz.
pub(super) type Moments = [f64; 10];

/// Pairs of axes of the second moments, in their order.
pub(super) const PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];

/// Returns the moments from the sums of g, c g and c c g over the populations.
///
/// With the velocity without the force, the second moment is that of the stress: the contribution of a force (Z.
/// Guo, C. Zheng, B. Shi, Phys. Rev. E 65 (2002) 046308) cancels with the force in the velocity, except for a term
/// quadratic in the force.
#[inline(always)]
pub(super) fn from_sums(
    dimension: usize,
    density: f64,
    momentum: [f64; 3],
    mut second: [f64; 6],
) -> Moments {
    let velocity = momentum.map(|m| m / (1.0 + density));
    for (sum, [a, b]) in second.iter_mut().zip(PAIRS) {
        *sum -= momentum[a] * velocity[b];
    }
    // The trace remains: a fast shear flow has a moment of higher order along itself only (I. Ginzburg, D. d'Humières,
    // Phys. Rev. E 68 (2003) 066614: the even part of third order grows with the odd relaxation time). Without the
    // trace half of it would act along the normal, as a stress and a velocity of the surface that are not there.
    for sum in &mut second[..dimension] {
        *sum -= density / 3.0;
    }
    let [x, y, z] = velocity;
    let [xx, yy, zz, xy, xz, yz] = second;
    [density, x, y, z, xx, yy, zz, xy, xz, yz]
}

/// Returns the moments of a cell.
pub(super) fn moments<S: Stored>(populations: &Populations<S>, cell: usize) -> Moments {
    let numbers = populations.numbers();
    let velocities = populations.velocities();
    let mut density = 0.0;
    let mut momentum = [0.0; 3];
    let mut second = [0.0; 6];
    for (i, c) in velocities.c.iter().enumerate() {
        let g = numbers[populations.incoming(cell, i)].to_f64();
        let c = c.map(f64::from);
        density += g;
        for (sum, c) in momentum.iter_mut().zip(c) {
            *sum += c * g;
        }
        for (sum, [a, b]) in second.iter_mut().zip(PAIRS) {
            *sum += c[a] * c[b] * g;
        }
    }
    from_sums(velocities.dimension, density, momentum, second)
}

/// Returns the moments reflected at a symmetry plane; `sign` is -1 along reversed axes.
pub(super) fn mirrored(mut moments: Moments, sign: [f64; 3]) -> Moments {
    for (moment, sign) in moments[1..4].iter_mut().zip(sign) {
        *moment *= sign;
    }
    for (moment, [a, b]) in moments[4..].iter_mut().zip(PAIRS) {
        *moment *= sign[a] * sign[b];
    }
    moments
}

/// Returns the product of the second moment with a vector.
#[inline(always)]
pub(super) fn across(moments: &Moments, v: [f64; 3]) -> [f64; 3] {
    let [_, _, _, _, xx, yy, zz, xy, xz, yz] = *moments;
    [
        xx * v[0] + xy * v[1] + xz * v[2],
        xy * v[0] + yy * v[1] + yz * v[2],
        xz * v[0] + yz * v[1] + zz * v[2],
    ]
}
