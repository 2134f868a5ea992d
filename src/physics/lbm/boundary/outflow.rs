//! Outflow: the entering populations are those of the next cell upstream (zero gradient along the normal).
//!
//! First order; the pressure floats, so a domain needs its level from somewhere else (an inlet pressure, or the
//! initial state). Waves reflect less than at a prescribed pressure.

use super::links::{LINKS_PER_THREAD, each_part};
use super::{
    Crossing, FaceLink, Giver, Inflow, Model, Moment, Nature, Place, Rule, Strength, Surface,
};
use crate::error::Error;
use crate::lbm::lanes::Stored;
use crate::lbm::populations::{Parity, Populations};
use crate::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Free outflow: zero gradient along the normal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Outflow {}

/// That of every outflow.
pub(super) const NATURE: Nature = Nature {
    surface: Surface::Opening,
    strength: Strength::Outflow,
};

impl Model for Outflow {
    fn nature(&self) -> Nature {
        NATURE
    }

    fn pressure_floats(&self) -> bool {
        true
    }

    fn inflow(&self, _: &Place<'_>) -> Inflow {
        Inflow::Any
    }

    fn rule<S: Stored>(&self, _: &Place<'_>, _: &LatticeUnits) -> Result<Box<dyn Rule<S>>, Error> {
        Ok(Box::<Links>::default())
    }
}

/// Where the population that enters along a link lies in the cell upstream.
#[derive(Clone, Copy, Debug)]
pub(super) struct Upstream([usize; 2]);

impl Upstream {
    pub(super) fn new<S: Stored>(crossing: &Crossing<'_, S>) -> Self {
        let populations = crossing.populations;
        let velocities = populations.velocities();
        let (i, outside) = (crossing.direction, crossing.outside);
        let c = velocities.c[i];
        let inward: [i8; 3] = std::array::from_fn(|a| if outside[a] { -c[a] } else { 0 });
        let step = velocities.c.iter().position(|&d| d == inward).unwrap_or(0);
        let upstream = crossing.cell.wrapping_add_signed(populations.offset(step));
        let source = populations.link(upstream, i);
        Self([
            source.incoming(Parity::Home),
            source.incoming(Parity::Reversed),
        ])
    }

    /// Its position.
    pub(super) fn at(self, parity: Parity) -> usize {
        self.0[usize::from(parity == Parity::Reversed)]
    }
}

/// The links of a patch through which the fluid leaves with the state that it has.
#[derive(Debug, Default)]
pub struct Links {
    links: Vec<FaceLink>,
    /// For each link.
    upstream: Vec<Upstream>,
}

impl<S: Stored> Rule<S> for Links {
    fn nature(&self) -> Nature {
        NATURE
    }

    fn take(&mut self, crossing: &Crossing<'_, S>) -> Giver {
        self.links.push(crossing.face_link());
        self.upstream.push(Upstream::new(crossing));
        Giver::Rule
    }

    fn walls_stand_alone(&self) -> bool {
        self.links.is_empty()
    }

    fn apply(&mut self, populations: &mut Populations<S>, _: &Moment) {
        let parity = populations.parity();
        let count = self.links.len();
        each_part(count, LINKS_PER_THREAD, populations, |part, numbers| {
            for (link, upstream) in self.links[part.clone()].iter().zip(&self.upstream[part]) {
                let (from, to) = (upstream.at(parity), link.link.incoming(parity));
                // SAFETY: positions in the slab: of this link alone, and of a cell further inside, to which the rule gives nothing.
                unsafe { numbers.add(to).write(numbers.add(from).read()) };
            }
        });
    }

    fn links(&self) -> &[FaceLink] {
        &self.links
    }
}
