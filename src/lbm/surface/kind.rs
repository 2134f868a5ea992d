//! Kinds of cells of a free surface, a byte each.

/// A cell of a structure, or a cell beyond a wall.
pub const SOLID: u8 = 0;
/// A cell without water.
pub const GAS: u8 = 1;
/// A cell full of water.
pub const LIQUID: u8 = 2;
/// A cell that the surface passes, with liquid and gas among its neighbours.
pub const SURFACE: u8 = 3;
/// A cell of the surface without gas among its neighbours.
pub const ENCLOSED: u8 = 4;
/// A cell of the surface without liquid among its neighbours.
pub const STRAY: u8 = 5;
/// A cell of the surface that becomes liquid in this step.
pub const FILLS: u8 = 6;
/// A cell of the surface that becomes gas in this step.
pub const EMPTIES: u8 = 7;
/// A cell of gas that the surface enters in this step.
pub const ENTERED: u8 = 8;
/// A cell that a body fills, next to water: it holds water that moves with the body and counts as none.
pub const HELD: u8 = 9;

/// Returns `true` for a cell whose populations take part in the flow.
#[inline(always)]
#[must_use]
pub fn is_wet(kind: u8) -> bool {
    kind >= LIQUID
}

/// Returns `true` for a cell that the surface passes.
#[inline(always)]
#[must_use]
pub fn is_surface(kind: u8) -> bool {
    (SURFACE..HELD).contains(&kind)
}
