//! Exchange of mass between interface cells and their neighbours, and reconstruction of the populations that
//! gas does not send.
//!
//! An interface cell gains Δm = Σ_i s_i (f_ī(x + c_i → x) - f*_i(x → x + c_i)), with s_i = 1 towards liquid,
//! the mean of both fill levels towards an interface cell and 0 towards gas and solids (Körner et al. 2005,
//! equation 4). Between unlike interface cells only one of the two terms counts, so that stray cells empty
//! and enclosed cells fill (N. Thürey, Physically based animation of free surface flows with the lattice
//! Boltzmann method, Erlangen 2007, table 4.1).

use super::cells::Cells;
use super::conversion;
use super::ghosts::{Around, Moments};
use super::kind::{EMPTIES, ENCLOSED, FILLS, GAS, LIQUID, SOLID, STRAY, SURFACE, is_surface};
use super::lists::{Facet, Plane};
use crate::lbm::lanes::Stored;
use crate::lbm::populations::Populations;
use crate::thread_pool;

/// Part of the density by which a mass passes that of a full or an empty cell before the cell changes its
/// kind (Thürey 2007, section 4.3).
const PASSED: f64 = 1e-2;

/// Bound of the ratio by which the dynamic part of the pressure inside is continued to the middle of a link.
const MOST_RATIO: f64 = 0.5;

/// Bound of the acceleration whose pressure counts, over that of the body force: that of a free fall.
const MOST_ACCELERATION: f64 = 1.0;

/// Part of its length by which a link from an interface cell to the liquid cell inside must point against the normal.
const INWARD: f64 = 0.7;

/// Least distance by which the velocities of an interface cell and of the liquid cell inside determine a
/// parabola with its vertex at the surface.
const LEAST_REACH: f64 = 0.5;

/// Interface cells of a thread from which on it is worth waking.
const CELLS_PER_THREAD: usize = 500;

/// Numbers of a slab, shared out to threads by cell.
struct Numbers<S>(*mut S);
// SAFETY: each number belongs to one link end of one interface cell, and each cell to one thread.
unsafe impl<S: Send> Sync for Numbers<S> {}

/// Returns the planes from which on another thread is worth waking.
fn least(planes: &[Plane]) -> usize {
    let cells: usize = planes.iter().map(|plane| plane.surface.len()).sum();
    let threads = 1 + cells / CELLS_PER_THREAD;
    planes.len().div_ceil(threads).max(1)
}

/// Finds velocity, normal and density inside of each interface cell from the state before the pass.
///
/// The normal is that of the fill levels round the cell, weighted as the velocity set weights its directions;
/// the surface is a plane at the distance (ε - ½) Σ|n_a| from the centre.
///
/// The incoming populations take the shear force that the water feels at the middle of a link but not at its
/// surface.
pub(super) fn prepare<S: Stored>(
    state: (&Cells, &Around),
    planes: &mut [Plane],
    populations: &mut Populations<S>,
    (half_force, viscosity): ([f64; 3], f64),
) {
    let least = least(planes);
    let known = &*populations;
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for (&cell, facet) in plane.surface.iter().zip(&mut plane.facets) {
            *facet = find(state, known, (half_force, viscosity), cell as usize);
        }
    });
    let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
    let (numbers, populations) = (&numbers, &*populations);
    let velocities = populations.velocities();
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for (&cell, facet) in plane.surface.iter().zip(&plane.facets) {
            for i in super::directions(velocities) {
                let c = velocities.c[i];
                let along = (0..3)
                    .map(|a| f64::from(c[a]) * facet.shear[a])
                    .sum::<f64>();
                // SAFETY: the incoming numbers of a cell are its own.
                unsafe {
                    let number = numbers.0.add(populations.incoming(cell as usize, i));
                    let sheared = (3.0 * velocities.w[i]).mul_add(along, number.read().to_f64());
                    number.write(S::from_f64(sheared));
                }
            }
        }
    });
}

/// Returns the moments of a liquid cell next to interface cells; 0 of other cells, which are not used.
pub(super) fn shore<S: Stored>(
    cells: &Cells,
    populations: &Populations<S>,
    cell: usize,
) -> Moments {
    if cells.kind[cell] == LIQUID && cells.count_neighbours(cell, is_surface) > 0 {
        conversion::moments(populations, cell)
    } else {
        [0.0; 4]
    }
}

/// Returns the moments of the liquid neighbour of a cell along a direction; `of_cell` gives those of a cell
/// of the slab.
fn moments_along<S: Stored>(
    around: &Around,
    populations: &Populations<S>,
    (cell, direction): (usize, usize),
    of_cell: impl Fn(usize) -> Moments,
) -> Moments {
    let at = populations.coordinates(cell);
    let c = populations.velocities().c[direction];
    let next = std::array::from_fn(|a| at[a] + isize::from(c[a]));
    let position = |at: [isize; 3]| populations.cell(at);
    around.moments(next, position, of_cell)
}

/// Returns the facet of an interface cell.
fn find<S: Stored>(
    (cells, around): (&Cells, &Around),
    populations: &Populations<S>,
    (half_force, viscosity): ([f64; 3], f64),
    cell: usize,
) -> Facet {
    let (density, momentum) = populations.moments(cell);
    let mut facet = Facet {
        velocity: std::array::from_fn(|a| (half_force[a] + momentum[a]) / (1.0 + density)),
        ..Facet::default()
    };
    let velocities = populations.velocities();
    let own = cells.fill[cell].clamp(0.0, 1.0);
    let mut normal = [0.0; 3];
    for i in super::directions(velocities) {
        let level = cells.level_along(cell, velocities.c[i], i);
        for (n, c) in normal.iter_mut().zip(velocities.c[i]) {
            *n -= velocities.w[i] * f64::from(c) * level;
        }
    }
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    if length <= 0.0 {
        return facet;
    }
    facet.normal = normal.map(|n| n / length);
    let along = |c: [i8; 3]| {
        (0..3)
            .map(|a| facet.normal[a] * f64::from(c[a]))
            .sum::<f64>()
    };
    // The liquid neighbour that lies most against the normal.
    let mut inner: Option<(f64, usize)> = None;
    for i in super::directions(velocities) {
        if cells.kind_along(cell, i) == LIQUID {
            let c = velocities.c[i];
            let size = c.iter().map(|c| f64::from(c * c)).sum::<f64>().sqrt();
            let down = -along(c) / size;
            if inner.is_none_or(|(best, _)| down > best) {
                inner = Some((down, i));
            }
        }
    }
    let Some((_, i)) = inner.filter(|(down, _)| *down > INWARD) else {
        return facet;
    };
    let sum: f64 = facet.normal.iter().map(|n| n.abs()).sum();
    facet.distance = (own - 0.5) * sum;
    facet.at_rest = 6.0 * (0..3).map(|a| half_force[a] * facet.normal[a]).sum::<f64>();
    facet.inner = -along(velocities.c[i]);
    facet.weight = 6.0
        * (0..3)
            .map(|a| half_force[a] * half_force[a])
            .sum::<f64>()
            .sqrt();
    let of_cell = |cell: usize| conversion::moments(populations, cell);
    let [inside, u @ ..] = moments_along(around, populations, (cell, i), of_cell);
    facet.inside = inside;
    facet.inward = u8::try_from(i).unwrap_or(0);
    facet.shear = shear(&facet, momentum.map(|m| m / (1.0 + density)), u, viscosity);
    facet
}

/// Returns the shear force on an interface cell at the middle of its links to gas where that at the surface
/// is zero; `own` and `inner` are the velocities of the cell and of the liquid cell inside.
///
/// A parabola through both velocities has its vertex at the surface, u = u_s - κ (s - q)²/2: the stress at ½
/// is -ν κ (½ - q). A film down a plane is exact, and a stream of one velocity is free of it.
fn shear(facet: &Facet, own: [f64; 3], inner: [f64; 3], viscosity: f64) -> [f64; 3] {
    let across: [f64; 3] = std::array::from_fn(|a| own[a] - inner[a]);
    let normal = (0..3).map(|a| across[a] * facet.normal[a]).sum::<f64>();
    let reach = (facet.inner + 2.0 * facet.distance).max(LEAST_REACH);
    let curvature = 2.0 / (facet.inner * reach);
    let factor = -viscosity * curvature * (0.5 - facet.distance).max(0.0);
    std::array::from_fn(|a| factor * (across[a] - normal * facet.normal[a]))
}

/// Returns the density half-way along a link of an interface cell; `up` is the component of the link along
/// the normal.
///
/// Static part: that of water at rest, which is the density of the gas at the surface. Dynamic part: what the
/// liquid cell inside has beyond it, continued linearly through zero at the centre of the interface cell, the
/// mean place of the surface. To continue it through the surface itself would multiply it by up to two, and
/// sound grows where the factor is above one half. It is bounded by the pressure of an acceleration, because
/// sound of impacts grows at low viscosity where the factor is one half.
#[inline(always)]
fn half_way(facet: &Facet, up: f64) -> f64 {
    if facet.inward == 0 {
        return 0.0;
    }
    let most = MOST_ACCELERATION * facet.weight * (0.5 + facet.inner);
    let excess = facet.inside + (facet.distance + facet.inner) * facet.at_rest;
    let excess = excess.clamp(-most, most);
    let ratio = (0.5 * up / facet.inner).clamp(-MOST_RATIO, MOST_RATIO);
    (0.5 * up - facet.distance) * facet.at_rest - ratio * excess
}

/// Returns the moments of a cell, as [`Populations::moments`] has them, while other threads work on other cells.
fn moments<S: Stored>(
    numbers: &Numbers<S>,
    populations: &Populations<S>,
    cell: usize,
) -> (f64, [f64; 3]) {
    let mut density = 0.0;
    let mut momentum = [0.0; 3];
    for (i, c) in populations.velocities().c.iter().enumerate() {
        // SAFETY: the incoming numbers of a cell lie in the slab, and no other thread writes them.
        let g = unsafe { numbers.0.add(populations.incoming(cell, i)).read().to_f64() };
        density += g;
        for a in 0..3 {
            momentum[a] += f64::from(c[a]) * g;
        }
    }
    (density, momentum)
}

/// Sets what the cells of gas in the vectors of the pass sent to zero.
pub(super) fn silence<S: Stored>(
    cells: &Cells,
    planes: &mut [Plane],
    populations: &mut Populations<S>,
) {
    let parity = populations.parity();
    let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
    let (numbers, populations) = (&numbers, &*populations);
    let least = least(planes);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for &cell in &plane.dry {
            let cell = cell as usize;
            for i in 0..cells.directions() {
                let out = if i == 0 {
                    populations.incoming(cell, 0)
                } else {
                    populations.link(cell, i).out(parity)
                };
                // SAFETY: what a cell sends is its own until the next pass.
                unsafe { numbers.0.add(out).write(S::from_f64(0.0)) };
            }
        }
    });
}

/// Bounces links back, given by cell and direction.
pub(super) fn bounce<S: Stored>(links: &[(u32, u8)], populations: &mut Populations<S>) {
    let parity = populations.parity();
    for &(cell, direction) in links {
        let link = populations.link(cell as usize, usize::from(direction));
        let numbers = populations.numbers_mut();
        numbers[link.incoming(parity)] = numbers[link.out(parity)];
    }
}

/// Returns the mass that a cell gains along a link to another interface cell of fill levels with this mean;
/// `sent` and `came` are f.
#[inline(always)]
fn between(kinds: [u8; 2], mean: f64, sent: f64, came: f64) -> f64 {
    let [own, other] = kinds;
    let gain = if own == other {
        came - sent
    } else if own == STRAY || other == ENCLOSED {
        -sent
    } else {
        came
    };
    mean * gain
}

/// Exchanges mass and reconstructs; leaves the new fill level and kind of each interface cell in its list.
pub(super) fn exchange<S: Stored>(
    cells: &mut Cells,
    around: &Around,
    planes: &mut [Plane],
    populations: &mut Populations<S>,
) {
    let mut mass = std::mem::take(&mut cells.mass);
    let masses = Numbers(mass.as_mut_ptr());
    let masses = &masses;
    let parity = populations.parity();
    let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
    let (numbers, populations) = (&numbers, &*populations);
    let velocities = populations.velocities();
    let known = &*cells;
    let least = least(planes);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for n in 0..plane.surface.len() {
            let cell = plane.surface[n] as usize;
            let facet = &plane.facets[n];
            let u = facet.velocity;
            // The density inside in the middle of the step, as that of what comes and goes along the links:
            // one that lags behind feeds sound.
            let mut inside = facet.inside;
            if facet.inward > 0 {
                let inward = (cell, usize::from(facet.inward));
                let of_cell = |cell: usize| [moments(numbers, populations, cell).0, 0.0, 0.0, 0.0];
                let [now, ..] = moments_along(around, populations, inward, of_cell);
                inside = 0.5 * (inside + now);
            }
            let facet = Facet { inside, ..*facet };
            let uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
            let own = known.kind[cell];
            let level = known.fill[cell].clamp(0.0, 1.0);
            let mut gain = 0.0;
            let mut alone = true;
            for i in super::directions(velocities) {
                let kind = known.kind_along(cell, i);
                if kind == SOLID {
                    continue;
                }
                let link = populations.link(cell, i);
                let (out, incoming) = (link.out(parity), link.incoming(parity));
                // SAFETY: both numbers of a link to gas are this cell's; those of other links are only read.
                let sent = unsafe { numbers.0.add(out).read().to_f64() };
                let w = velocities.w[i];
                if kind == GAS {
                    let c = velocities.c[i];
                    let cu = (0..3).map(|a| f64::from(c[a]) * u[a]).sum::<f64>();
                    let up = (0..3)
                        .map(|a| f64::from(c[a]) * facet.normal[a])
                        .sum::<f64>();
                    let density = half_way(&facet, up);
                    let even = density + (1.0 + density) * (4.5 * cu * cu - 1.5 * uu);
                    let back = 2.0 * w * even - sent;
                    // SAFETY: as above.
                    unsafe {
                        numbers.0.add(incoming).write(S::from_f64(back));
                        numbers.0.add(out).write(S::from_f64(0.0));
                    }
                    continue;
                }
                // SAFETY: as above.
                let came = unsafe { numbers.0.add(incoming).read().to_f64() };
                if kind == LIQUID {
                    gain += came - sent;
                } else {
                    alone = false;
                    let other = known.fill[known.neighbour(cell, i)].clamp(0.0, 1.0);
                    gain += between([own, kind], 0.5 * (level + other), sent + w, came + w);
                }
            }
            gain += known.shares_taken(cell);
            // SAFETY: the mass of this cell.
            let mass = unsafe {
                let mass = masses.0.add(cell);
                mass.write(mass.read() + gain);
                mass.read()
            };
            let density = 1.0 + moments(numbers, populations, cell).0;
            plane.fill[n] = mass / density;
            plane.kind[n] = match (own, alone) {
                (ENCLOSED, true) => FILLS,
                (STRAY, true) => EMPTIES,
                _ if mass > (1.0 + PASSED) * density => FILLS,
                _ if mass < -PASSED * density => EMPTIES,
                _ => own,
            };
        }
    });
    cells.mass = mass;
}

/// Finds of each interface cell in the lists its fill level and the kinds of its neighbours.
pub(super) fn classify<S: Stored>(
    cells: &Cells,
    planes: &mut [Plane],
    populations: &Populations<S>,
) {
    let least = least(planes);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for n in 0..plane.surface.len() {
            let cell = plane.surface[n] as usize;
            let (mut gas, mut liquid) = (false, false);
            for i in 1..cells.directions() {
                match cells.kind_along(cell, i) {
                    GAS => gas = true,
                    LIQUID => liquid = true,
                    _ => {}
                }
            }
            plane.kind[n] = match (gas, liquid) {
                (false, _) => ENCLOSED,
                (true, false) => STRAY,
                (true, true) => SURFACE,
            };
            debug_assert!(is_surface(cells.kind[cell]));
            plane.fill[n] = cells.mass[cell] / (1.0 + populations.moments(cell).0);
        }
    });
}
