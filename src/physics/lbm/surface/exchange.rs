//! Exchange of mass between interface cells and their neighbours, and reconstruction of the populations that gas does not send.
//!
//! An interface cell gains Δm = Σ_i s_i (f_ī(x + c_i → x) - f*_i(x → x + c_i)), with s_i = 1 towards liquid, the mean of both fill levels
//! towards an interface cell and 0 towards gas and solids (Körner et al. 2005, equation 4). Between unlike interface cells only one of the
//! two terms counts, so that stray cells empty and enclosed cells fill (N. Thürey, Physically based animation of free surface flows with the
//! lattice Boltzmann method, Erlangen 2007, table 4.1).

use super::cells::Cells;
use super::kind::{EMPTIES, ENCLOSED, FILLS, GAS, LIQUID, SOLID, STRAY, SURFACE, is_surface};
use super::lists::Plane;
use crate::lbm::lanes::Stored;
use crate::lbm::populations::Populations;
use crate::thread_pool;

/// Part of the density by which a mass passes that of a full or an empty cell before the cell changes its kind (Thürey 2007, section 4.3).
const PASSED: f64 = 1e-2;

/// The most velocities of a set.
const MOST: usize = 27;

/// Numbers of a slab, shared out to threads by cell.
struct Numbers<S>(*mut S);
// SAFETY: each number belongs to one link end of one interface cell, and each cell to one thread.
unsafe impl<S: Send> Sync for Numbers<S> {}

/// Returns the velocity of an interface cell from its moments; the force counts for the wet part.
fn velocity(density: f64, momentum: [f64; 3], half_force: [f64; 3], fill: f64) -> [f64; 3] {
    std::array::from_fn(|a| fill.mul_add(half_force[a], momentum[a]) / (1.0 + density))
}

/// Notes velocities and takes the weight of the empty part from the incoming populations.
///
/// A momentum that is added along 3 w_i c_i passes a collision as it is: the cell has then the force of its wet part, to the order of u F.
pub(super) fn prepare<S: Stored>(
    cells: &Cells,
    planes: &mut [Plane],
    populations: &mut Populations<S>,
    half_force: [f64; 3],
) {
    let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
    let (numbers, populations) = (&numbers, &*populations);
    let velocities = populations.velocities();
    let q = velocities.q();
    // What a cell without water takes: -3 w_i c_i·F.
    let lift: [f64; MOST] = std::array::from_fn(|i| {
        let along = |c: [i8; 3]| (0..3).map(|a| f64::from(c[a]) * half_force[a]).sum::<f64>();
        if i < q {
            -6.0 * velocities.w[i] * along(velocities.c[i])
        } else {
            0.0
        }
    });
    let heavy = half_force.iter().any(|f| *f != 0.0);
    thread_pool::each_item_in_runs(planes, 1, |_, plane| {
        for (&cell, noted) in plane.surface.iter().zip(&mut plane.velocity) {
            let cell = cell as usize;
            let fill = cells.fill[cell].clamp(0.0, 1.0);
            let (density, momentum) = moments(numbers, populations, cell);
            *noted = velocity(density, momentum, half_force, fill);
            if !heavy {
                continue;
            }
            for (i, lift) in lift.iter().enumerate().take(q).skip(1) {
                // SAFETY: the incoming numbers of a cell are its own.
                unsafe {
                    let number = numbers.0.add(populations.incoming(cell, i));
                    let lifted = (1.0 - fill).mul_add(*lift, number.read().to_f64());
                    number.write(S::from_f64(lifted));
                }
            }
        }
    });
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
        // SAFETY: the incoming numbers of a cell lie in the slab, and nobody else writes them.
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
    thread_pool::each_item_in_runs(planes, 1, |_, plane| {
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

/// Returns the mass that a cell gains along a link to another interface cell of fill levels with this mean; `sent` and `came` are f.
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
    thread_pool::each_item_in_runs(planes, 1, |_, plane| {
        for n in 0..plane.surface.len() {
            let cell = plane.surface[n] as usize;
            let u = plane.velocity[n];
            let uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
            let own = known.kind[cell];
            let level = known.fill[cell].clamp(0.0, 1.0);
            let mut gain = 0.0;
            let mut alone = true;
            for i in super::directions(velocities) {
                let kind = known.kind_beside(cell, i);
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
                    let back = 2.0 * w * (4.5 * cu * cu - 1.5 * uu) - sent;
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
                    let other = known.fill[known.beside(cell, i)].clamp(0.0, 1.0);
                    gain += between([own, kind], 0.5 * (level + other), sent + w, came + w);
                }
            }
            gain += known.shares_beside(cell);
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
    thread_pool::each_item_in_runs(planes, 1, |_, plane| {
        for n in 0..plane.surface.len() {
            let cell = plane.surface[n] as usize;
            let (mut gas, mut liquid) = (false, false);
            for i in 1..cells.directions() {
                match cells.kind_beside(cell, i) {
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
