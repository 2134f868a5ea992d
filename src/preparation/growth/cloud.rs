//! The loose cloud from which a packing grows, and the order in which its grains are numbered.

use super::{CLOUD, PLACES, PackedGrain, PackingSettings};
use base::error::Error;
use base::number::{real, whole};
use base::random::Stream;
use dem::{Components, Space};

/// Returns a position for each grain at the cloud's sizes, without overlap; the largest grain is placed first.
pub(super) fn scatter<S: Space>(
    settings: &PackingSettings<S>,
    radii: &[f64],
) -> Result<Vec<S::Vector>, Error> {
    let largest = radii.iter().copied().fold(0.0, f64::max) * CLOUD;
    let cell = 2.0 * largest;
    let mut counts = [1_usize; 3];
    for (axis, count) in counts.iter_mut().enumerate().take(S::DIMENSION) {
        let length = settings.upper.get(axis) - settings.lower.get(axis);
        if length < 2.0 * largest {
            return Err(Error::Numerical(format!(
                "the box is {length} m wide, and the largest grain has a radius of {largest} m: use a box of at \
                 least two radii"
            )));
        }
        *count = whole((length / cell).max(1.0));
    }
    let total = counts.iter().product();
    let mut cells: Vec<Vec<usize>> = vec![Vec::new(); total];
    let cell_of = |at: &S::Vector, step: [isize; 3]| -> Option<usize> {
        let mut index = 0;
        for axis in (0..S::DIMENSION).rev() {
            let length = settings.upper.get(axis) - settings.lower.get(axis);
            let part = (at.get(axis) - settings.lower.get(axis)) / length;
            let place = whole(part * real(counts[axis])).min(counts[axis] - 1);
            let place = place
                .checked_add_signed(step[axis])
                .filter(|place| *place < counts[axis]);
            let place = match (place, settings.periodic[axis]) {
                (Some(place), _) => place,
                (None, true) if step[axis] < 0 => counts[axis] - 1,
                (None, true) => 0,
                (None, false) => return None,
            };
            index = index * counts[axis] + place;
        }
        Some(index)
    };
    let mut order: Vec<usize> = (0..radii.len()).collect();
    order.sort_by(|a, b| radii[*b].total_cmp(&radii[*a]).then(a.cmp(b)));
    let mut places = vec![S::Vector::default(); radii.len()];
    for &id in &order {
        let radius = radii[id] * CLOUD;
        let mut draws = Stream::new(settings.seed, id as u64, PLACES);
        let free = (0..2000).find_map(|_| {
            let mut at = S::Vector::default();
            for axis in 0..S::DIMENSION {
                let margin = if settings.periodic[axis] { 0.0 } else { radius };
                let (low, high) = (
                    settings.lower.get(axis) + margin,
                    settings.upper.get(axis) - margin,
                );
                at.set(axis, low + (high - low) * draws.uniform());
            }
            let mut clear = true;
            for_each_step::<S>(|step| {
                for &other in cell_of(&at, step).map_or(&[][..], |index| &cells[index]) {
                    let mut between = places[other] - at;
                    for axis in (0..S::DIMENSION).filter(|&axis| settings.periodic[axis]) {
                        let length = settings.upper.get(axis) - settings.lower.get(axis);
                        let d = between.get(axis);
                        between.set(axis, d - length * (d / length).round());
                    }
                    clear &= between.length() >= radius + radii[other] * CLOUD;
                }
            });
            clear.then_some(at)
        });
        let Some(at) = free else {
            return Err(Error::Numerical(
                "the loose cloud of grains does not fit into the box: use a larger box, or fewer or smaller \
                 grains".into(),
            ));
        };
        places[id] = at;
        if let Some(index) = cell_of(&at, [0; 3]) {
            cells[index].push(id);
        }
    }
    Ok(places)
}

/// Calls `visit` with the offsets of the cell itself and of all its neighbours.
fn for_each_step<S: Space>(mut visit: impl FnMut([isize; 3])) {
    let deep = if S::DIMENSION == 3 { -1..=1 } else { 0..=0 };
    for z in deep {
        for y in -1..=1 {
            for x in -1..=1 {
                visit([x, y, z]);
            }
        }
    }
}

/// Orders grains by strips along the longest axis, so that grains with close ids are close in space.
pub(super) fn put_neighbours_together<S: Space>(
    grains: &mut [PackedGrain<S>],
    settings: &PackingSettings<S>,
    strip: f64,
) {
    let length = |axis: usize| settings.upper.get(axis) - settings.lower.get(axis);
    let longest = (0..S::DIMENSION).fold(0, |best, axis| {
        if length(axis) > length(best) {
            axis
        } else {
            best
        }
    });
    let mut axes: Vec<usize> = (0..S::DIMENSION).filter(|&axis| axis != longest).collect();
    let last = axes.pop().unwrap_or(longest);
    let place = |grain: &PackedGrain<S>, axis: usize| {
        whole(((grain.position.get(axis) - settings.lower.get(axis)) / strip).max(0.0))
    };
    grains.sort_by(|a, b| {
        let strips = |grain: &PackedGrain<S>| {
            let across: Vec<usize> = axes.iter().map(|&axis| place(grain, axis)).collect();
            (place(grain, longest), across)
        };
        strips(a)
            .cmp(&strips(b))
            .then(a.position.get(last).total_cmp(&b.position.get(last)))
            .then(a.position.get(longest).total_cmp(&b.position.get(longest)))
    });
}
