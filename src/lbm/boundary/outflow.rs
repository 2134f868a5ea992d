//! Outflow: the entering populations are those of the next cell upstream (zero gradient along the normal).
//!
//! First order; the pressure floats, so a domain needs its level from somewhere else (an inlet pressure, or the
//! initial state). Waves reflect less than at a prescribed pressure.

use crate::lbm::lanes::Stored;
use crate::lbm::populations::{Link, Parity, Populations};

/// One population taken from the cell upstream.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OutflowLink {
    pub(crate) link: Link,
    from: [usize; 2],
    pub(crate) patch: usize,
    pub(crate) direction: usize,
}

impl OutflowLink {
    pub(super) fn new<S: Stored>(
        populations: &Populations<S>,
        cell: usize,
        i: usize,
        outside: [bool; 3],
        patch: usize,
    ) -> Self {
        let velocities = populations.velocities();
        let c = velocities.c[i];
        let inward: [i8; 3] = std::array::from_fn(|a| if outside[a] { -c[a] } else { 0 });
        let step = velocities.c.iter().position(|&d| d == inward).unwrap_or(0);
        let upstream = cell.wrapping_add_signed(populations.offset(step));
        let source = populations.link(upstream, i);
        Self {
            link: populations.link(cell, i),
            from: [
                source.incoming(Parity::Home),
                source.incoming(Parity::Reversed),
            ],
            patch,
            direction: i,
        }
    }

    /// Position of the same population in the cell upstream.
    pub(super) fn upstream(&self, parity: Parity) -> usize {
        self.from[usize::from(parity == Parity::Reversed)]
    }
}

pub(super) fn apply<S: Stored>(links: &[OutflowLink], populations: &mut Populations<S>) {
    let parity = populations.parity();
    let numbers = populations.numbers_mut();
    for o in links {
        numbers[o.link.incoming(parity)] = numbers[o.upstream(parity)];
    }
}
