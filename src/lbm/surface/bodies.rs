//! Bodies that fill cells of water with a free surface, in part or completely ([`crate::saturation`]).
//!
//! ε is the fraction of a cell filled by bodies. Water fills the free part 1 - ε of a cell, and the fill level is
//! that of the free part. The lattice stores populations of whole cells: a cell of density ρ at a body has the mass
//! ρ, of which ε, with the density 1 of water, is in the volume of the body and moves with it. The mass of the
//! water in a cell is
//!
//! | kind | mass of the water |
//! |---|---|
//! | liquid | ρ - ε |
//! | interface | m - ε, with m the mass that the links exchange |
//! | held: ε = 1 next to water | ρ - 1 |
//! | gas, with a body in it or not | 0 |
//!
//! **Held cells** are filled by bodies and touch water. They take part in the flow like any cell covered by a body.
//! Bodies have no populations further inside and in the air: the links of held cells that lead there bounce back at
//! the velocity of the body, and contribute to its load. A body in the air thus has no load at all, and the
//! pressure of the air is the reference of all loads.
//!
//! **Weight of the water.** In the pass, 1 - B of the body force acts on the fluid of a covered cell. In water at
//! rest a body then receives the pressure around its cells minus (1 - B) F for each. The force of the water on the
//! body is that pressure minus the weight of the water, so that B is replaced by the fraction of the body under
//! water: ε in liquid and held cells, ε times the fill level in interface cells. A body in water at rest thus has
//! its exact buoyancy for every weighting.
//!
//! **Mass.** A moving body sweeps over cells: ε changes, links into bodies add and remove mass, and cells become
//! held or cease to be held. Each of these changes the sum of the masses in the table by a known amount, which is
//! counted in quanta, summed over all ranks, and subtracted from the interface cells at the bodies in the same
//! step; without such cells it is subtracted from all interface cells, and without any it counts as lost. The mass
//! of the water is conserved up to rounding, and the water displaced by a body raises the surface by its volume.
//! Along the line where the surface meets a body, the part of the body that moves out of the air is added cell by
//! cell.
//!
//! **Water that is displaced.** The mass ε of a cell moves with the body. When a body enters the water, this mass is
//! accelerated from the velocity u of the water to that of the body, U, in the cells that the body reaches, and the
//! pass counts it as a load on the body. The momentum of the water alone is that of the populations minus ε U of each
//! cell, so that the force of the water on the body is the load plus U dε/dt, summed over the cells in the flow. The
//! sum is that over the links which lead out of the flow,
//!
//! dε/dt = -3 w c·U (ε(x) + ε(x + c)),
//!
//! by the gradient of ε on the lattice, which cancels between cells in the flow. It is zero for a body under water and
//! ρ U² times the width at the water line for one that enters.
//!
//! **Inertia.** Only the cells with populations resist an acceleration of the body like fluid inside it, so that
//! the compensation of [`crate::saturation`] requires their fraction of the volume and of the moment of inertia
//! ([`SlabSurface::shares_of_bodies`]).

use super::cells::Cells;
use super::conversion::{enter, leave};
use super::ghosts::{Around, Ghosts};
use super::kind::{GAS, HELD, LIQUID, SURFACE, is_surface, is_wet};
use super::moments::moments;
use super::{SlabSurface, directions};
use crate::lanes::Stored;
use crate::lattice::Velocities;
use crate::links::{Load, add_force};
use crate::populations::Populations;
use crate::quanta::{from_quanta, quanta};
use crate::saturation::Cover;
use base::number::{real, to_u32};
use base::vector::dot;
use decomposition::Communicator;

/// Solid fraction above which a cell counts as filled by bodies: the sum of several fractions, each rounded to f32.
const FULL: f64 = 1.0 - 1e-6;

/// Solid fraction of a cell that no body leaves in a step by its motion: such a body was removed.
const REMOVED_FRACTION: f64 = 0.5;

/// Position of a cell of the slab and its coordinates.
type Place = (u32, [i32; 3]);

/// Change of the kind of a cell.
#[derive(Clone, Copy, Debug)]
struct Change {
    cell: u32,
    kind: u8,
    /// `true` if the water that follows a body remains in a cell that the body leaves.
    keeps: bool,
    /// Mass that an interface cell receives from neighbours that distribute their excess.
    taken: f64,
}

/// Bodies in the cells of a slab.
#[derive(Debug, Default)]
pub(crate) struct Bodies {
    /// Cells and ghost cells that bodies fill now or filled before, in ascending order of position.
    cells: Vec<u32>,
    /// The filled cells of the slab, with their coordinates.
    own: Vec<Place>,
    /// The filled cells of the slab that take part in the flow.
    wet: Vec<Place>,
    /// Links of held cells into bodies or air: cell and direction.
    inner: Vec<(Place, u8)>,
    /// Filled cells next to the end of the flow, with the sum of -3 w c ε over the links that lead out of the flow.
    ends: Vec<(Place, [f64; 3])>,
    /// Cells that change their kind in a step.
    changes: Vec<Change>,
    /// Cells that became held in the last step, with their velocities.
    newly_held: Vec<(u32, [f64; 3])>,
    /// Loads of the last step in addition to those of the pass, by slot.
    loads: Vec<Load>,
    /// Sum of the forces among them that are weight or momentum of water in the place of bodies and no exchange with
    /// the populations, in quanta.
    weight: [i128; 3],
    /// Sum of the forces among them that return to held cells through planes of symmetry, in quanta.
    reflected: [i128; 3],
    /// Volume of the cells with populations and of all cells, and sums of r² over both, in quanta, by slot.
    shares: Vec<[i128; 4]>,
    /// Change of the mass of the water that has not been compensated yet, in quanta.
    uncompensated_mass: i128,
    known: bool,
}

impl Bodies {
    /// Returns the cells of the slab that bodies fill in part or completely and that take part in the flow.
    pub(super) fn wet(&self) -> impl Iterator<Item = &u32> {
        self.wet.iter().map(|(cell, _)| cell)
    }

    /// Returns the forces of the last step on all bodies that are weight or momentum of water in their place, and no
    /// exchange with the populations, in quanta.
    pub(super) fn weight(&self) -> [i128; 3] {
        self.weight
    }

    /// Returns the forces of the last step on all bodies that return to held cells through planes of symmetry, in
    /// quanta: the momentum through these planes contains them too.
    pub(super) fn reflected(&self) -> [i128; 3] {
        self.reflected
    }

    /// Reads the cells filled by bodies from a cover, and counts the change of those in the flow.
    fn measure<S: Stored>(
        &mut self,
        cells: &mut Cells,
        populations: &Populations<S>,
        cover: &Cover,
        filled: impl Iterator<Item = usize>,
    ) -> Vec<u32> {
        let solid = &cells.solid;
        self.cells.retain(|&cell| solid[cell as usize] > 0.0);
        self.cells.extend(filled.map(to_u32));
        self.cells.sort_unstable();
        self.cells.dedup();
        self.own.clear();
        let count = populations.cells().map(usize::cast_signed);
        let mut taken_away = Vec::new();
        for &cell in &self.cells {
            let position = cell as usize;
            let (old, new) = (cells.solid[position], cover.part(position));
            cells.solid[position] = new;
            let at = populations.coordinates(position);
            if !(0..3).all(|a| (0..count[a]).contains(&at[a])) {
                continue;
            }
            let at = at.map(|x| i32::try_from(x).unwrap_or(i32::MAX));
            self.own.push((cell, at));
            if self.known && is_wet(cells.kind[position]) {
                self.uncompensated_mass -= i128::from(quanta(new)) - i128::from(quanta(old));
            }
            if old - new > REMOVED_FRACTION {
                taken_away.push(cell);
            }
        }
        taken_away
    }

    /// Finds the cells of the slab that bodies begin or cease to fill, with their new kinds.
    fn find_filled(&mut self, cells: &Cells, taken_away: &[u32]) {
        self.changes.clear();
        for &(cell, _) in &self.own {
            let position = cell as usize;
            let kind = cells.kind[position];
            let full = cells.solid[position] >= FULL;
            let fills = full && (kind == LIQUID || is_surface(kind));
            if !fills && (full || kind != HELD) {
                continue;
            }
            let at_water = cells.count_neighbours(position, |kind| kind == LIQUID) > 0;
            let kept = taken_away.binary_search(&cell).is_err();
            let kind = if fills {
                HELD
            } else if at_water && kept && !is_next_to_gas(cells, position) {
                LIQUID
            } else if at_water || cells.count_neighbours(position, is_surface) > 0 {
                SURFACE
            } else {
                GAS
            };
            self.changes.push(Change {
                cell,
                kind,
                keeps: at_water && kept,
                taken: cells.shares_taken(position),
            });
        }
    }

    /// Adds the part of bodies that moves from the air into interface cells.
    fn push<S: Stored>(&mut self, cells: &mut Cells, populations: &Populations<S>, cover: &Cover) {
        let velocities = populations.velocities();
        for &(cell, at) in &self.own {
            let position = cell as usize;
            if !is_surface(cells.kind[position]) || cells.solid[position] <= 0.0 {
                continue;
            }
            let mut gain = 0.0;
            for i in directions(velocities) {
                let beside = cells.neighbour(position, i);
                if cells.kind_along(position, i) != GAS || cells.solid[beside] <= 0.0 {
                    continue;
                }
                let c = velocities.c[i];
                let u = velocity(cover, populations, (position, at));
                let along: f64 = (0..3).map(|a| f64::from(c[a]) * u[a]).sum();
                let part = cells.solid[position].min(cells.solid[beside]);
                gain -= 6.0 * velocities.w[i] * along * part;
            }
            if gain != 0.0 {
                let before = cells.mass[position];
                cells.mass[position] += gain;
                self.uncompensated_mass +=
                    i128::from(quanta(cells.mass[position])) - i128::from(quanta(before));
            }
        }
    }

    /// Lists the cells that take part in the flow and the links that lead out of it, and sums their fractions of
    /// the bodies.
    fn list<S: Stored>(&mut self, cells: &Cells, populations: &Populations<S>, cover: &Cover) {
        let velocities = populations.velocities();
        self.wet.clear();
        self.inner.clear();
        self.ends.clear();
        self.shares.clear();
        self.shares.resize(cover.slots(), [0; 4]);
        let shares = &mut self.shares;
        for &(cell, at) in &self.own {
            let position = cell as usize;
            let kind = cells.kind[position];
            if cells.solid[position] <= 0.0 {
                continue;
            }
            let wet = is_wet(kind);
            if wet {
                self.wet.push((cell, at));
            }
            let end = gradient_at_end(cells, velocities, position);
            if end.iter().any(|c| c.abs() > 0.0) {
                self.ends.push(((cell, at), end));
            }
            cover.each_body(position, |slot, solid, fraction, _| {
                let raw: [i32; 3] = std::array::from_fn(|a| at[a] - solid.frame[a]);
                let arm = (0..velocities.dimension)
                    .map(|a| f64::from(raw[a]) + 0.5 - solid.motion.position[a]);
                let square: f64 = arm.map(|r| r * r).sum();
                let [volume, moment] = [fraction, fraction * square].map(|x| i128::from(quanta(x)));
                let share = &mut shares[slot as usize];
                share[1] += volume;
                share[3] += moment;
                if wet {
                    share[0] += volume;
                    share[2] += moment;
                }
            });
            if kind != HELD {
                continue;
            }
            for i in directions(velocities) {
                if cells.kind_along(position, i) == GAS {
                    self.inner.push(((cell, at), u8::try_from(i).unwrap_or(0)));
                }
            }
        }
    }

    /// Applies bounce-back on the links that lead out of the flow, after a pass, and adds the loads not included in
    /// the pass. `half_force` is F/2.
    fn act<S: Stored>(
        &mut self,
        (cells, around): (&Cells, &Around),
        populations: &mut Populations<S>,
        cover: &mut Cover,
        half_force: [f64; 3],
    ) {
        self.loads.clear();
        self.loads.resize(cover.slots(), [0; 6]);
        (self.weight, self.reflected) = ([0; 3], [0; 3]);
        let parity = populations.parity();
        let flat = populations.velocities().dimension == 2;
        let loads = &mut self.loads;
        let mut give = |slot: u32, force: [f64; 3], middle: [i32; 3]| {
            let force = force.map(quanta);
            let load = &mut loads[slot as usize];
            if flat {
                add_force::<2>(load, force, middle);
            } else {
                add_force::<3>(load, force, middle);
            }
        };
        for &((cell, at), i) in &self.inner {
            let i = usize::from(i);
            let velocities = populations.velocities();
            let (c, w) = (velocities.c[i], velocities.w[i]);
            let u = velocity(cover, populations, (cell as usize, at));
            let along: f64 = (0..3).map(|a| f64::from(c[a]) * u[a]).sum();
            let link = populations.link(cell as usize, i);
            let (out, incoming) = (link.out(parity), link.incoming(parity));
            let numbers = populations.numbers_mut();
            let sent = numbers[out].to_f64();
            numbers[incoming] = S::from_f64(sent - 6.0 * w * along);
            numbers[out] = S::from_f64(0.0);
            let came = numbers[incoming].to_f64();
            self.uncompensated_mass += i128::from(quanta(came)) - i128::from(quanta(sent));
            if around.reflects(populations, cells.neighbour(cell as usize, i)) {
                for (sum, c) in self.reflected.iter_mut().zip(c) {
                    *sum += i128::from(c) * i128::from(quanta(came));
                }
            }
            cover.each_body(cell as usize, |slot, solid, _, part| {
                let raw: [i32; 3] = std::array::from_fn(|a| at[a] - solid.frame[a]);
                let middle = std::array::from_fn(|a| 2 * raw[a] + 1 + i32::from(c[a]));
                give(slot, c.map(|c| part * f64::from(c) * (sent + came)), middle);
            });
        }
        for &(cell, at) in &self.wet {
            let position = cell as usize;
            let kind = cells.kind[position];
            let under = if is_surface(kind) {
                cells.solid[position] * cells.fill[position].clamp(0.0, 1.0)
            } else {
                cells.solid[position]
            };
            let part = from_quanta(i128::from(cover.weight(position))) - under;
            cover.each_body(position, |slot, solid, _, share| {
                let raw: [i32; 3] = std::array::from_fn(|a| at[a] - solid.frame[a]);
                let force = half_force.map(|half| share * 2.0 * half * part);
                for (sum, force) in self.weight.iter_mut().zip(force) {
                    *sum += i128::from(quanta(force));
                }
                give(slot, force, raw.map(|x| 2 * x + 1));
            });
        }
        for &((cell, at), end) in &self.ends {
            let position = cell as usize;
            let u = velocity(cover, populations, (position, at));
            let rate = dot(end, u);
            cover.each_body(position, |slot, solid, _, share| {
                let raw: [i32; 3] = std::array::from_fn(|a| at[a] - solid.frame[a]);
                let force = u.map(|u| share * rate * u);
                for (sum, force) in self.weight.iter_mut().zip(force) {
                    *sum += i128::from(quanta(force));
                }
                give(slot, force, raw.map(|x| 2 * x + 1));
            });
        }
        for (slot, load) in self.loads.iter().enumerate() {
            if *load != [0; 6] {
                cover.receive(to_u32(slot), load);
            }
        }
    }
}

/// Returns the velocity of the bodies in a cell.
fn velocity<S: Stored>(
    cover: &Cover,
    populations: &Populations<S>,
    (position, at): (usize, [i32; 3]),
) -> [f64; 3] {
    if populations.velocities().dimension == 2 {
        cover.velocity::<2>(position, at)
    } else {
        cover.velocity::<3>(position, at)
    }
}

/// Returns the sum of -3 w c ε over the links of a filled cell that lead out of the flow, or of 3 w c ε over those that
/// lead into it.
fn gradient_at_end(cells: &Cells, velocities: &Velocities, position: usize) -> [f64; 3] {
    let wet = is_wet(cells.kind[position]);
    let mut sum = [0.0; 3];
    if !wet && cells.kind[position] != GAS {
        return sum;
    }
    for i in directions(velocities) {
        let kind = cells.kind_along(position, i);
        let part = match (wet, kind == GAS, is_wet(kind)) {
            (true, true, _) => -3.0 * velocities.w[i] * cells.solid[position],
            (false, _, true) => 3.0 * velocities.w[i] * cells.solid[position],
            _ => continue,
        };
        for (sum, c) in sum.iter_mut().zip(velocities.c[i]) {
            *sum += part * f64::from(c);
        }
    }
    sum
}

/// Returns `true` if a cell has air in an adjacent cell.
fn is_next_to_gas(cells: &Cells, position: usize) -> bool {
    (1..cells.directions()).any(|i| {
        cells.kind_along(position, i) == GAS && cells.solid[cells.neighbour(position, i)] < FULL
    })
}

impl SlabSurface {
    /// Returns `true` if bodies are known.
    pub(crate) fn has_bodies(&self) -> bool {
        self.bodies.is_some()
    }

    /// Returns the gas cells that the pass collides together with cells of water.
    pub(crate) fn dry(&self) -> impl Iterator<Item = usize> + '_ {
        let dry = self.planes.iter().flat_map(|plane| &plane.dry);
        dry.flat_map(|&[first, end]| first as usize..end as usize)
    }

    /// Returns, by slot, the volume and the sum of r² of the cells in the flow and of all cells of a body, in
    /// quanta: flow, all, flow, all.
    #[must_use]
    pub fn shares_of_bodies(&self) -> &[[i128; 4]] {
        self.bodies.as_ref().map_or(&[], |bodies| &bodies.shares)
    }

    /// Returns the cells that became held in the last step, with the velocities of their bodies.
    pub(crate) fn newly_held(&self) -> impl Iterator<Item = (usize, [f64; 3])> + '_ {
        let begun = self.bodies.iter().flat_map(|bodies| &bodies.newly_held);
        begun.map(|&(cell, u)| (cell as usize, u))
    }

    /// Applies bounce-back at the bodies and adds the loads not included in the pass.
    pub(crate) fn act_on_bodies<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
        cover: &mut Cover,
        half_force: [f64; 3],
    ) {
        if let Some(bodies) = &mut self.bodies {
            let state = (&self.cells, self.ghosts.around());
            bodies.act(state, populations, cover, half_force);
        }
    }

    /// Transfers the mass of the cells that bodies fill, given by position in any order. Collective.
    pub(crate) fn meet_bodies<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
        cover: &Cover,
        filled: impl Iterator<Item = usize>,
        communicator: &Communicator,
    ) {
        let mut bodies = self.bodies.take().unwrap_or_default();
        let slab = !populations.cells().contains(&0);
        if self.cells.solid.is_empty() {
            self.cells.solid = vec![0.0; self.cells.kind.len()];
        }
        if slab {
            let taken_away = bodies.measure(&mut self.cells, populations, cover, filled);
            self.ghosts.copy(&mut self.cells.solid);
            if !bodies.known && !self.restored {
                self.share_cells(populations, &bodies);
            }
            bodies.find_filled(&self.cells, &taken_away);
            self.fill_cells(populations, &mut bodies);
            self.ghosts
                .spread_kinds(&mut self.cells.kind, &self.planes, true);
            self.open_cells(populations, &mut bodies);
            self.ghosts
                .spread_kinds(&mut self.cells.kind, &self.planes, true);
            self.hold_cells(populations, cover, &mut bodies);
            self.ghosts
                .spread_kinds(&mut self.cells.kind, &self.planes, true);
            if bodies.known {
                bodies.push(&mut self.cells, populations, cover);
            } else {
                bodies.uncompensated_mass = 0;
            }
        }
        bodies.known = true;
        self.take_back(&mut bodies, communicator);
        if slab {
            self.settle(populations, false);
            bodies.list(&self.cells, populations, cover);
        }
        self.bodies = Some(bodies);
    }

    /// Restricts the water of interface cells at the start to their free part.
    fn share_cells<S: Stored>(&mut self, populations: &Populations<S>, bodies: &Bodies) {
        for &(cell, _) in &bodies.own {
            let position = cell as usize;
            if is_surface(self.cells.kind[position]) {
                let density = 1.0 + populations.moments(position).0;
                let solid = self.cells.solid[position];
                let fill = self.cells.mass[position] / density;
                self.cells.mass[position] = solid + (1.0 - solid) * fill * density;
            }
        }
    }

    /// Records that a cell has changed its kind.
    fn touch<S: Stored>(&mut self, populations: &Populations<S>, cell: usize) {
        let at = populations.coordinates(cell);
        self.planes[at[populations.order()[0]].unsigned_abs()].changed = true;
    }

    /// Changes the kinds of cells that bodies begin or cease to fill.
    fn fill_cells<S: Stored>(&mut self, populations: &mut Populations<S>, bodies: &mut Bodies) {
        for change in &bodies.changes {
            let position = change.cell as usize;
            let density = 1.0 + populations.moments(position).0;
            let whole = i128::from(quanta(density));
            let solid = self.cells.solid[position];
            let part = i128::from(quanta(solid));
            match change.kind {
                HELD if is_surface(self.cells.kind[position]) => {
                    let mass = i128::from(quanta(self.cells.mass[position]));
                    bodies.uncompensated_mass += whole - mass - i128::from(quanta(change.taken));
                    self.cells.mass[position] = 0.0;
                    self.cells.fill[position] = 1.0;
                }
                SURFACE => {
                    // Water follows the body if it is next to the body.
                    let (mass, lost) = if change.keeps {
                        (density, 0)
                    } else {
                        (solid, whole - part)
                    };
                    bodies.uncompensated_mass -= lost;
                    self.cells.mass[position] = mass - change.taken;
                }
                GAS => {
                    bodies.uncompensated_mass -= whole - part;
                    self.cells.fill[position] = 0.0;
                    leave(&self.cells, populations, position);
                }
                _ => {}
            }
            self.cells.kind[position] = change.kind;
            self.touch(populations, position);
        }
    }

    /// Converts liquid that a body has left in the air to interface cells.
    fn open_cells<S: Stored>(&mut self, populations: &Populations<S>, bodies: &mut Bodies) {
        bodies.changes.clear();
        let cells = &self.cells;
        for &(cell, _) in &bodies.own {
            let position = cell as usize;
            if cells.kind[position] == LIQUID && is_next_to_gas(cells, position) {
                bodies.changes.push(Change {
                    cell,
                    kind: SURFACE,
                    keeps: true,
                    taken: cells.shares_taken(position),
                });
            }
        }
        for change in &bodies.changes {
            let position = change.cell as usize;
            let density = 1.0 + populations.moments(position).0;
            self.cells.kind[position] = SURFACE;
            self.cells.mass[position] = density - change.taken;
            self.touch(populations, position);
        }
    }

    /// Marks the filled cells next to water as held, and no others.
    fn hold_cells<S: Stored>(
        &mut self,
        populations: &mut Populations<S>,
        cover: &Cover,
        bodies: &mut Bodies,
    ) {
        let kinds = &self.cells.kind;
        let of_flow = |cell: usize| match kinds[cell] {
            kind if is_wet(kind) => moments(populations, cell),
            _ => [0.0; 10],
        };
        // Bodies are held by water far from the surface too.
        self.ghosts.exchange_moments(true, of_flow);
        let mut changes = Vec::new();
        bodies.newly_held.clear();
        let water = |kind: u8| kind == LIQUID || is_surface(kind);
        let mut born = Vec::new();
        for &(cell, at) in &bodies.own {
            let position = cell as usize;
            let kind = self.cells.kind[position];
            if self.cells.solid[position] < FULL || !matches!(kind, GAS | HELD) {
                continue;
            }
            let wet = self.cells.count_neighbours(position, water) > 0;
            if wet && kind == GAS {
                let density = mean_density(&self.cells, &self.ghosts, populations, position);
                let [x, y, z] = velocity(cover, populations, (position, at));
                born.push([density, x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
                changes.push((cell, HELD));
                bodies.newly_held.push((cell, [x, y, z]));
            } else if !wet && kind == HELD {
                changes.push((cell, GAS));
            }
        }
        let mut born = born.iter();
        for (cell, kind) in changes {
            let position = cell as usize;
            self.cells.kind[position] = kind;
            self.cells.fill[position] = f64::from(u8::from(kind == HELD));
            let solid = i128::from(quanta(self.cells.solid[position]));
            if kind == HELD {
                if let Some(born) = born.next() {
                    enter(populations, position, born);
                }
                let density = 1.0 + populations.moments(position).0;
                bodies.uncompensated_mass += i128::from(quanta(density)) - solid;
            } else {
                let density = 1.0 + populations.moments(position).0;
                bodies.uncompensated_mass -= i128::from(quanta(density)) - solid;
                leave(&self.cells, populations, position);
            }
            self.touch(populations, position);
        }
    }

    /// Subtracts the mass that bodies have added to the water from the interface cells. Collective.
    fn take_back(&mut self, bodies: &mut Bodies, communicator: &Communicator) {
        let sum = |part: i128| {
            let all = communicator.all_reduce_sum_u128(part.cast_unsigned());
            all.cast_signed()
        };
        let cells = &self.cells;
        let at_body = |cell: usize| is_surface(cells.kind[cell]);
        let takers = bodies.own.iter().map(|(cell, _)| *cell as usize);
        let takers: Vec<usize> = takers
            .filter(|&cell| at_body(cell) && cells.solid[cell] > 0.0)
            .collect();
        let uncompensated_mass = sum(bodies.uncompensated_mass);
        bodies.uncompensated_mass = 0;
        if uncompensated_mass == 0 {
            return;
        }
        let mut count = sum(takers.len() as i128);
        let mut takers = takers;
        if count == 0 {
            takers = (0..cells.kind.len())
                .filter(|&cell| at_body(cell))
                .collect();
            takers.retain(|cell| !self.ghosts.holds(*cell));
            count = sum(takers.len() as i128);
        }
        if count == 0 {
            if communicator.rank() == 0 {
                self.lost -= uncompensated_mass;
            }
            return;
        }
        let each = from_quanta(uncompensated_mass) / real(i64::try_from(count).unwrap_or(i64::MAX));
        for cell in takers {
            self.cells.mass[cell] -= each;
        }
    }
}

/// Returns the mean density of the wet cells next to a cell.
fn mean_density<S: Stored>(
    cells: &Cells,
    ghosts: &Ghosts,
    populations: &Populations<S>,
    cell: usize,
) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for i in directions(populations.velocities()) {
        let kind = cells.kind_along(cell, i);
        if kind != LIQUID && !is_surface(kind) {
            continue;
        }
        let of_cell = |cell: usize| moments(populations, cell);
        let around = ghosts.around();
        let [density, ..] = around.moments_along(populations, (cell, i), of_cell);
        sum += density;
        count += 1;
    }
    sum / real(count.max(1))
}
