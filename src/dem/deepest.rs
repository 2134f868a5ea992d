//! Deepest contact of a run: the largest overlap divided by the radius of the smaller body.
//!
//! Every contact of every solid step is tested by one product and one comparison; only a contact nearly as deep as
//! the deepest so far is evaluated further. The result is the maximum of quotients, so that it does not depend on
//! their order and its bits do not depend on ranks and threads. The radius of a polyhedron is the distance from its
//! centroid to the nearest face.

use super::polyhedron::Polyhedron;

/// Deepest contact of a run so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deepest {
    /// Overlap divided by the smaller radius; 0 before the first contact.
    pub part: f64,
    /// Id of the body.
    pub body: u64,
    /// Other body or wall of the contact.
    pub with: OtherSide,
}

/// Other side of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OtherSide {
    /// No contact so far, or unknown since a restart.
    #[default]
    Unknown,
    /// Body, by its id.
    Body(u64),
    /// Wall, by its index.
    Wall(u32),
}

/// Deepest contact of a part of a step, with entries instead of ids.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Record {
    /// Value slightly below `part`, so that rounding hides no contact.
    pub(super) filter: f64,
    part: f64,
    at: Option<(u32, Partner)>,
}

/// Other side of a contact, as an entry or a wall.
#[derive(Clone, Copy, Debug)]
pub(super) enum Partner {
    Entry(u32),
    Wall(u32),
}

/// Fraction of the largest quotient of overlap and radius above which a contact is compared exactly.
const NEAR: f64 = 1.0 - 1e-12;

impl Record {
    /// Returns a record that only contacts deeper than the known `part` replace.
    pub(super) fn beyond(part: f64) -> Self {
        Self {
            filter: NEAR * part,
            part,
            at: None,
        }
    }

    /// Records the overlap \[m\] of a contact of entry `first`; `smaller` is the radius of the smaller body \[m\].
    #[inline(always)]
    pub(super) fn note(&mut self, overlap: f64, smaller: f64, first: u32, other: Partner) {
        if overlap > self.filter * smaller {
            self.keep(overlap / smaller, first, other);
        }
    }

    #[cold]
    #[inline(never)]
    fn keep(&mut self, part: f64, first: u32, other: Partner) {
        if part > self.part {
            *self = Self {
                filter: NEAR * part,
                part,
                at: Some((first, other)),
            };
        }
    }

    /// Returns the overlap over the smaller radius.
    pub(super) fn part(&self) -> f64 {
        self.part
    }

    /// Returns the deeper of two records.
    pub(super) fn or(self, other: Self) -> Self {
        if other.part > self.part { other } else { self }
    }

    /// Returns the contact with the ids of the entries.
    pub(super) fn named(&self, id: impl Fn(u32) -> u64) -> Option<Deepest> {
        let (first, other) = self.at?;
        let with = match other {
            Partner::Entry(entry) => OtherSide::Body(id(entry)),
            Partner::Wall(wall) => OtherSide::Wall(wall),
        };
        Some(Deepest {
            part: self.part,
            body: id(first),
            with,
        })
    }
}

/// Returns the distance from the centroid of a polyhedron to its nearest face \[m\].
pub(super) fn inner_radius(shape: &Polyhedron) -> f64 {
    let faces = shape.half_spaces().iter();
    faces.map(|face| face.offset).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::number::to_u32;

    #[test]
    fn the_deepest_does_not_depend_on_the_order() {
        let contacts = [
            (1e-3, 0.3),
            (2e-3, 0.7),
            (1e-9, 1e-7),
            (3e-3, 0.3),
            (3e-3 + 1e-18, 0.3),
        ];
        let of = |order: &mut dyn Iterator<Item = usize>| {
            let mut record = Record::beyond(0.0);
            for n in order {
                let (overlap, smaller) = contacts[n];
                record.note(overlap, smaller, to_u32(n), Partner::Wall(4));
            }
            record.named(|entry| 10 + u64::from(entry)).unwrap()
        };
        let (up, down) = (of(&mut (0..5)), of(&mut (0..5).rev()));
        assert_eq!(up.part.to_bits(), down.part.to_bits());
        let largest = contacts[4].0 / contacts[4].1;
        assert_eq!(
            (up.part, up.body, up.with),
            (largest, 14, OtherSide::Wall(4))
        );
        let halves = [0..2, 2..5].map(|half| {
            let mut record = Record::beyond(0.0);
            for n in half {
                record.note(contacts[n].0, contacts[n].1, 0, Partner::Entry(1));
            }
            record
        });
        assert_eq!(halves[1].or(halves[0]).part, up.part);
        assert_eq!(Record::beyond(0.5).named(u64::from), None);
    }
}
