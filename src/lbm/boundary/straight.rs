//! Links along which a face returns a population to the cell that sent one.

use super::{Boundaries, SurfaceKind};
use crate::lanes::Stored;
use crate::populations::Populations;
use std::collections::HashMap;

/// Kinds of surfaces that return a population to its cell.
const KINDS: [SurfaceKind; 3] = [
    SurfaceKind::Wall,
    SurfaceKind::MovingWall,
    SurfaceKind::Opening,
];

/// Links at walls and openings of a slab, along which the face returns a population to the cell that sent one.
#[derive(Clone, Debug, Default)]
pub struct StraightLinks {
    /// Directions of the links of each kind, as bits, by position of the cell.
    by_cell: HashMap<u32, [u32; KINDS.len()]>,
}

impl StraightLinks {
    /// Returns the surface at which a link ends, given by position of the cell and direction; none for other links.
    #[must_use]
    pub fn surface(&self, (cell, direction): (u32, u8)) -> Option<SurfaceKind> {
        let kinds = self.by_cell.get(&cell)?;
        let of_link = |bits: &u32| bits & (1 << direction) != 0;
        kinds.iter().position(of_link).map(|kind| KINDS[kind])
    }

    /// Returns the links at surfaces of a kind, by position of the cell and direction, in no order.
    pub fn links_at(&self, surface: SurfaceKind) -> impl Iterator<Item = (u32, u8)> + '_ {
        self.by_cell.keys().flat_map(move |&cell| {
            let links = self.of_cell(cell);
            let here = links.filter(move |(_, kind)| *kind == surface);
            here.map(move |(direction, _)| (cell, direction))
        })
    }

    /// Returns the links of a cell, given by its position: directions and surfaces.
    pub fn of_cell(&self, cell: u32) -> impl Iterator<Item = (u8, SurfaceKind)> + '_ {
        let kinds = self.by_cell.get(&cell).into_iter();
        kinds.flat_map(|kinds| {
            let ends = kinds.iter().zip(KINDS);
            ends.flat_map(|(bits, kind)| {
                let directions = (0..32_u8).filter(move |direction| bits & (1 << direction) != 0);
                directions.map(move |direction| (direction, kind))
            })
        })
    }
}

impl<S: Stored> Boundaries<S> {
    /// Returns the links at walls and, with `openings`, through openings.
    #[must_use]
    pub fn straight_links(&self, populations: &Populations<S>, openings: bool) -> StraightLinks {
        let velocities = populations.velocities();
        let mut links = StraightLinks::default();
        self.crossings(populations, |exchange| {
            let surface = self.patches[exchange.patch].rule.kind().surface;
            let kind = KINDS.iter().position(|kind| *kind == surface);
            let Some(kind) = kind.filter(|_| exchange.mirrored.is_none()) else {
                return;
            };
            if surface != SurfaceKind::Opening || openings {
                let (cell, direction) = exchange.link(velocities);
                links.by_cell.entry(cell).or_default()[kind] |= 1 << direction;
            }
        });
        links
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_known_by_cell_and_direction() {
        let mut links = StraightLinks::default();
        links.by_cell.insert(7, [1 << 3, 1 << 26, (1 << 5) | 1]);
        assert_eq!(links.surface((7, 3)), Some(SurfaceKind::Wall));
        assert_eq!(links.surface((7, 26)), Some(SurfaceKind::MovingWall));
        assert_eq!(links.surface((7, 0)), Some(SurfaceKind::Opening));
        assert_eq!(links.surface((7, 4)), None);
        assert_eq!(links.surface((8, 3)), None);
        let all: Vec<_> = links.of_cell(7).collect();
        let of_seven = [
            (3, SurfaceKind::Wall),
            (26, SurfaceKind::MovingWall),
            (0, SurfaceKind::Opening),
            (5, SurfaceKind::Opening),
        ];
        assert_eq!(all, of_seven);
        assert_eq!(links.of_cell(8).count(), 0);
    }
}
