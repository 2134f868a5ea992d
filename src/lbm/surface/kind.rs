//! Kinds of cells of a free surface, one byte each.

/// Cell of a structure, or beyond a wall.
pub const SOLID: u8 = 0;
/// Cell without water.
pub const GAS: u8 = 1;
/// Cell full of water.
pub const LIQUID: u8 = 2;
/// Interface cell with liquid and gas neighbours.
pub const SURFACE: u8 = 3;
/// Interface cell without gas neighbours.
pub const ENCLOSED: u8 = 4;
/// Interface cell without liquid neighbours that no wall carries.
pub const STRAY: u8 = 5;
/// Interface cell that becomes liquid in this step.
pub const FILLS: u8 = 6;
/// Interface cell that becomes gas in this step.
pub const EMPTIES: u8 = 7;
/// Gas cell that becomes an interface cell in this step.
pub const ENTERED: u8 = 8;
/// Cell filled by a body, next to water: its populations move with the body and do not count as water.
pub const HELD: u8 = 9;

/// Returns `true` for a cell whose populations take part in the flow.
#[inline(always)]
#[must_use]
pub fn is_wet(kind: u8) -> bool {
    kind >= LIQUID
}

/// Returns `true` for an interface cell.
#[inline(always)]
#[must_use]
pub fn is_surface(kind: u8) -> bool {
    (SURFACE..HELD).contains(&kind)
}
