//! Half-way bounce-back at a wall at rest, a moving wall, or a face with prescribed velocity (Ladd 1994).
//!
//! f_ī(x, t+1) = f*_i(x, t) - 6 w_i c_i·u_w with the reference density one in the last term, which so cancels exactly
//! over a closed wall. The wall lies half-way between x and x + c_i. Second order; exact for Couette flow (validation 1.2).

use crate::lbm::lanes::Stored;
use crate::lbm::populations::{Link, Populations};

/// One link that ends at a wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallLink {
    pub(crate) link: Link,
    pub(crate) patch: usize,
    pub(crate) direction: usize,
    /// 6 w_i c_i·u_w at full speed.
    pub(crate) term: f64,
}

/// 6 w_i c_i·u
pub(crate) fn term(weight: f64, c: [i8; 3], u: [f64; 3]) -> f64 {
    6.0 * weight * (f64::from(c[0]) * u[0] + f64::from(c[1]) * u[1] + f64::from(c[2]) * u[2])
}

pub(super) fn apply<S: Stored>(
    links: &[WallLink],
    speed: impl Fn(usize) -> f64,
    populations: &mut Populations<S>,
) {
    let parity = populations.parity();
    let numbers = populations.numbers_mut();
    // Links of one patch mostly stand together: ask for the ramp only when the patch changes.
    let mut patch = usize::MAX;
    let mut factor = 0.0;
    for w in links {
        if w.patch != patch {
            patch = w.patch;
            factor = speed(patch);
        }
        let value = numbers[w.link.out(parity)].to_f64() - w.term * factor;
        numbers[w.link.incoming(parity)] = S::from_f64(value);
    }
}
