//! Choice between surfaces with and without tension, which are compiled separately.
//!
//! It is separate from the tension because the loops over interface cells need nothing else of it.

/// Choice of a surface with or without a jump of the pressure.
pub(super) trait Jump: Copy + Sync {
    /// `true` for a surface with tension.
    const ACTS: bool;
}

/// A surface without tension.
#[derive(Clone, Copy)]
pub(super) struct NoJump;

impl Jump for NoJump {
    const ACTS: bool = false;
}

/// A surface with tension.
#[derive(Clone, Copy)]
pub(super) struct CapillaryJump;

impl Jump for CapillaryJump {
    const ACTS: bool = true;
}

/// Returns a density with that of the tension.
#[inline(always)]
pub(super) fn pressed<J: Jump>(_: J, capillary: f64, density: f64) -> f64 {
    if J::ACTS {
        density + capillary
    } else {
        density
    }
}
