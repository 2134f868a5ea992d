//! The order of generated grains: along a Z-order curve (G. M. Morton 1966).
//!
//! Grains are numbered in this order, and arrays, lists and sums follow the numbers. Neighbours in space therefore lie
//! close in memory, and few pairs cross from one thread's grains to another's.

use base::number::whole;
use dem::{Components, Space};
use plan::scene::sample::ListedGrain;

/// Number of bits of a coordinate: three coordinates fill a word.
const BITS: u32 = 21;

/// Sorts grains in the order of the curve through the box around their centres.
pub fn along_curve(grains: &mut [ListedGrain]) {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for grain in &*grains {
        for a in 0..3 {
            low[a] = low[a].min(grain.position[a]);
            high[a] = high[a].max(grain.position[a]);
        }
    }
    let edge = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
    let scale = f64::from((1_u32 << BITS) - 1) / edge.max(f64::MIN_POSITIVE);
    grains.sort_by_cached_key(|grain| {
        index_on_curve(std::array::from_fn(|a| {
            (grain.position[a] - low[a]) * scale
        }))
    });
}

/// Returns the index on the curve of a point in units of the finest cells.
fn index_on_curve(point: [f64; 3]) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cast of a float saturates, and the box bounds it"
    )]
    let cell = point.map(|x| x as u64);
    interleaved(&cell, BITS)
}

/// Returns the index on the Z-order curve of a cell, by interleaving the lowest bits of its coordinates, the first
/// axis lowest.
fn interleaved(cell: &[u64], bits: u32) -> u64 {
    let mut place = 0;
    let mut to = 0;
    for bit in 0..bits {
        for x in cell {
            place |= (x >> bit & 1) << to;
            to += 1;
        }
    }
    place
}

/// Returns the order of `places` on the curve, in cells of 1/1024 of their extent, so that grains with close ids
/// are close in space.
#[must_use]
pub fn curve_order<S: Space>(places: &[S::Vector]) -> Vec<usize> {
    let mut low = [f64::INFINITY; 3];
    let mut extent = 0.0_f64;
    for axis in 0..S::DIMENSION {
        let coordinates = || places.iter().map(|place| place.get(axis));
        low[axis] = coordinates().fold(f64::INFINITY, f64::min);
        extent = extent.max(coordinates().fold(f64::NEG_INFINITY, f64::max) - low[axis]);
    }
    let scale = if extent > 0.0 { 1024.0 / extent } else { 0.0 };
    let code = |place: &S::Vector| {
        let mut cell = [0; 3];
        for axis in 0..S::DIMENSION {
            let at = ((place.get(axis) - low[axis]) * scale).clamp(0.0, 1023.0);
            cell[axis] = whole(at) as u64;
        }
        interleaved(&cell[..S::DIMENSION], 10)
    };
    let codes: Vec<u64> = places.iter().map(code).collect();
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|&k| codes[k]);
    order
}
#[cfg(test)]
mod tests {
    use super::*;

    fn grain(position: [f64; 3]) -> ListedGrain {
        ListedGrain {
            position,
            radius: 1.0,
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            material: 0,
        }
    }

    #[test]
    fn the_curve_goes_through_octants_one_after_the_other() {
        let mut grains: Vec<ListedGrain> = (0..64)
            .map(|n| [n * 37 % 4, n * 37 / 4 % 4, n * 37 / 16 % 4].map(f64::from))
            .map(grain)
            .collect();
        along_curve(&mut grains);
        for (n, eight) in grains.chunks(8).enumerate() {
            let octant = |grain: &ListedGrain| grain.position.map(|x| x >= 2.0);
            assert!(eight.iter().all(|g| octant(g) == octant(&eight[0])), "{n}");
        }
        let first: Vec<_> = grains[..4].iter().map(|g| g.position).collect();
        assert_eq!(
            first,
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]
        );
    }

    #[test]
    fn equal_places_keep_their_order_and_none_is_fine() {
        along_curve(&mut []);
        let mut grains = [grain([2.0; 3]), grain([2.0; 3])];
        grains[1].radius = 2.0;
        along_curve(&mut grains);
        assert_eq!(grains.map(|g| g.radius), [1.0, 2.0]);
    }
}
