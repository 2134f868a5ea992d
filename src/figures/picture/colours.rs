//! Colours of water and grains as functions of the position on their scales.

use base::number::{real, whole};

/// Returns the colour at a fraction of a colour scale given by equally spaced colours.
fn along(stops: &[[f64; 3]], share: f64) -> [f64; 3] {
    let share = if share.is_finite() {
        share.clamp(0.0, 1.0)
    } else {
        0.0
    };
    let place = share * real(stops.len() - 1);
    let below = whole(place).min(stops.len() - 2);
    let t = place - real(below);
    std::array::from_fn(|c| stops[below][c] * (1.0 - t) + stops[below + 1][c] * t)
}

/// Returns a colour of water at a fraction of the scale, from white to dark blue.
pub(super) fn water_colour(share: f64) -> [f64; 3] {
    const STOPS: [[f64; 3]; 5] = [
        [247.0, 251.0, 255.0],
        [198.0, 219.0, 239.0],
        [107.0, 174.0, 214.0],
        [33.0, 113.0, 181.0],
        [8.0, 48.0, 107.0],
    ];
    along(&STOPS, share)
}

/// Returns a colour of grains at a fraction of the scale: viridis (van der Walt and Smith, SciPy 2015).
pub(super) fn grain_colour(share: f64) -> [f64; 3] {
    const STOPS: [[f64; 3]; 6] = [
        [68.0, 1.0, 84.0],
        [65.0, 68.0, 135.0],
        [42.0, 120.0, 142.0],
        [34.0, 168.0, 132.0],
        [122.0, 209.0, 81.0],
        [253.0, 231.0, 37.0],
    ];
    along(&STOPS, share)
}
