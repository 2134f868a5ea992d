//! Flow through the faces of a slab: mass and momentum of each patch, summed as integers.

use super::{Boundaries, FACES, Patch, links};
use crate::lanes::Stored;
use crate::lattice::Velocities;
use crate::populations::{Link, Populations};
use crate::quanta::quanta;
use crate::term::ClosedCells;
use base::number::to_u32;

/// Momentum and mass that crossed one patch during a step (exact sums over links).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flux {
    /// Force of the fluid on the outside of the patch, in units of 2^-56 lattice units. Along an edge of the domain the
    /// component along an axis is that on the face normal to it, without the shear stress on a wall next to an opening
    /// (`edge`).
    pub force: [i128; 3],
    /// Mass that leaves the fluid through the patch, in the same units. Along an edge it is that of the velocity
    /// normal to the patch.
    pub mass: i128,
}

/// Populations that crossed a face along one link.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exchange {
    pub(super) patch: usize,
    /// Deviation from equilibrium of the population that left, and its direction.
    out: (f64, usize),
    /// Deviation from equilibrium of the population that entered, and its direction.
    into: (f64, usize),
    /// Cells of the two populations: positions within an array.
    cells: [u32; 2],
    /// Deviation of the population that left along the link on which a mirror image enters; none for other links.
    pub(super) mirrored: Option<f64>,
}

impl Exchange {
    /// Returns the link of the population that enters, by position of the cell and direction: its cell lies in the
    /// slab, while a mirror image may have come from a ghost cell.
    pub(super) fn link(&self, velocities: &Velocities) -> (u32, u8) {
        let direction = velocities.opposite[self.into.1];
        (self.cells[1], u8::try_from(direction).unwrap_or(0))
    }
}

/// Forces on the faces of the domain, each along its axis, in quanta: lower and upper end of each axis.
pub type FaceLoads = [[i128; 2]; 3];

/// Contents of cells, by their positions within an array, and loads of solids on planes of symmetry.
pub struct Beside<'a> {
    /// Returns `true` for cells with water or solids: their populations have crossed the face in the last step.
    pub wet: &'a dyn Fn(usize) -> bool,
    /// Returns `true` for the cells of structures and of bodies with a content of their own.
    pub solid: &'a dyn Fn(usize) -> bool,
    /// Structures: links that they cut at planes of symmetry, and links at the feet of solids.
    pub structures: &'a ClosedCells,
    /// Faces that are planes of symmetry as a whole: lower and upper end of each axis.
    pub planes: [[bool; 2]; 3],
    /// Loads on these planes by water at links into mirror images of solids.
    pub loads: FaceLoads,
}

impl<S: Stored> Boundaries<S> {
    /// Returns the flow of water through each patch in the last step, `step`, on this rank. It requires a pass over the
    /// boundary links.
    ///
    /// Gas, structures and the content of bodies have the reference pressure, whatever numbers a pass leaves in their
    /// cells, and no mass of theirs counts.
    ///
    /// A plane of symmetry joins two cells. The population that enters is the one that crossed the plane: that which
    /// left the other cell, or what a free surface has put in its place. By symmetry as much leaves as enters, and the
    /// plane exerts no friction. If one of the cells is gas, the surface of the water crosses the link, and the other
    /// one exchanges momentum with the gas instead of the face. If one is solid, or a sheet is between them, the water
    /// meets the solid or its mirror image, and the loads on the plane are [`Beside::loads`]; at a plane that is only a
    /// part of a face there is no image, and the population that left counts for both cells.
    #[must_use]
    pub fn fluxes(
        &self,
        populations: &Populations<S>,
        beside: &Beside<'_>,
        step: f64,
    ) -> Vec<Flux> {
        let mut fluxes = vec![Flux::default(); self.patches.len()];
        let velocities = populations.velocities();
        let feet = beside.structures.feet();
        self.crossings(populations, |exchange| {
            let Exchange {
                patch,
                out,
                into,
                cells,
                mirrored,
            } = exchange;
            let [(mut a, i), (mut b, j)] = [out, into];
            let link = exchange.link(velocities);
            let solids = cells.map(|cell| (beside.solid)(cell as usize));
            let mut counts = solids != [true; 2] && cells.iter().all(|c| (beside.wet)(*c as usize));
            if let Some(own) = mirrored {
                a = if solids[0] { own } else { b };
                b = a;
                let has_images = (0..3).all(|axis| {
                    let c = [i, j].map(|i| velocities.c[i][axis]);
                    c[0] == c[1] || beside.planes[axis][usize::from(c[0] > 0)]
                });
                let meets = solids.contains(&true) || beside.structures.cuts(link);
                counts &= !(has_images && meets);
            }
            if !counts {
                (a, b) = (0.0, 0.0);
            }
            let (leaves, enters) = (
                i128::from(quanta(a + velocities.w[i])),
                i128::from(quanta(b + velocities.w[j])),
            );
            let key = (link.0, usize::from(link.1));
            let edge = self.edges.find(key);
            let of_axes = edge.map_or([patch; 3], |edge| edge.patches);
            let shear = self.edges.shear(key);
            let given = feet.given(link, [a, b].map(quanta));
            let at_rest = [i, j].map(|i| i128::from(quanta(velocities.w[i])));
            let both = i128::from(quanta(a)) + i128::from(quanta(b));
            for axis in 0..3 {
                // The solid has the rest of this component.
                let [leaves, enters] = match given[axis] {
                    Some(given) => [at_rest[0] + both - i128::from(given), at_rest[1]],
                    None => [leaves, enters],
                };
                let momentum = i128::from(velocities.c[i][axis]) * leaves
                    - i128::from(velocities.c[j][axis]) * enters;
                fluxes[of_axes[axis]].force[axis] += momentum;
                for half in shear.iter().filter(|half| half.axis == axis) {
                    fluxes[half.to].force[axis] += momentum / 2;
                    fluxes[half.from].force[axis] -= momentum / 2;
                }
            }
            let mass = leaves - enters;
            match edge.filter(|_| counts) {
                None => fluxes[patch].mass += mass,
                Some(edge) => {
                    let factor = |patch| self.velocity_factor(patch, step);
                    edge.divide(mass, factor, |patch, mass| fluxes[patch].mass += mass);
                }
            }
        });
        self.add_plane_loads(&beside.loads, &mut fluxes);
        fluxes
    }

    /// Adds loads on planes of symmetry to the last patch of their faces.
    fn add_plane_loads(&self, loads: &FaceLoads, fluxes: &mut [Flux]) {
        let stated = &self.patches[..self.count() - FACES];
        for (axis, ends) in loads.iter().enumerate() {
            for (upper, load) in [false, true].into_iter().zip(ends) {
                let is_there = |patch: &Patch<S>| (patch.axis, patch.upper) == (axis, upper);
                if let Some(patch) = stated.iter().rposition(is_there) {
                    fluxes[patch].force[axis] += load;
                }
            }
        }
    }

    /// Returns mass and momentum that left through all faces in the last step on this rank, in quanta: mass, then
    /// momentum. The momentum is that of the cells (positions within an array) for which `counts` is true, without that
    /// which solids receive at their feet ([`ClosedCells::feet`]). Like the
    /// loads on bodies, it is that of the deviations from the state at rest, because the pressure at rest cancels over
    /// a closed surface only.
    #[must_use]
    pub fn left(
        &self,
        populations: &Populations<S>,
        structures: &ClosedCells,
        counts: impl Fn(usize) -> bool,
    ) -> [i128; 4] {
        let velocities = populations.velocities();
        let mut sums = [0; 4];
        let feet = structures.feet();
        self.crossings(populations, |exchange| {
            let ends = [(1, exchange.out, 0), (-1, exchange.into, 1)];
            if counts(exchange.cells[1] as usize) {
                let sent = [exchange.out, exchange.into].map(|(deviation, _)| quanta(deviation));
                let given = feet.given(exchange.link(velocities), sent);
                let c = velocities.c[exchange.out.1];
                for axis in 0..3 {
                    sums[axis + 1] -= i128::from(c[axis]) * i128::from(given[axis].unwrap_or(0));
                }
            }
            for (sign, (deviation, i), n) in ends {
                let leaves = sign * i128::from(quanta(deviation));
                sums[0] += leaves;
                if counts(exchange.cells[n] as usize) {
                    for axis in 0..3 {
                        sums[axis + 1] += i128::from(velocities.c[i][axis]) * leaves;
                    }
                }
            }
        });
        sums
    }

    /// Calls `each` for every link through a face, with the populations that left and entered along it in the last
    /// step.
    pub(super) fn crossings(&self, populations: &Populations<S>, mut each: impl FnMut(Exchange)) {
        let (parity, numbers) = (populations.parity(), populations.numbers());
        let velocities = populations.velocities();
        let mut begins = [0; 27];
        for (i, begin) in begins[..velocities.q()].iter_mut().enumerate() {
            *begin = links::first(populations, i);
        }
        let straight = |patch: usize, link: Link, direction: usize| {
            let back = velocities.opposite[direction];
            Exchange {
                patch,
                out: (numbers[link.out(parity)].to_f64(), direction),
                into: (numbers[link.incoming(parity)].to_f64(), back),
                cells: [link.near - begins[back]; 2],
                mirrored: None,
            }
        };
        for w in self.walls.links() {
            each(straight(w.patch, w.link, w.direction));
        }
        for (n, patch) in self.patches.iter().enumerate() {
            for kept in patch.rule.links() {
                each(straight(n, kept.link, kept.direction));
            }
            for m in patch.rule.mirrors().iter().flat_map(|run| run.mirrors()) {
                let (from, to) = m.ends(parity);
                let own = m.sent_along_entrance(parity);
                each(Exchange {
                    patch: n,
                    out: (numbers[from].to_f64(), usize::from(m.leaves)),
                    into: (numbers[to].to_f64(), usize::from(m.enters)),
                    // Two adjacent cells, one of which a body may cover.
                    cells: m.cells(&velocities.opposite, &begins),
                    mirrored: Some(numbers[own].to_f64()),
                });
            }
        }
    }

    /// Returns the mass that left through each patch with an opening in the last step, `step`, on this rank, in quanta,
    /// of the links whose cells (positions within an array) satisfy `counts`. Walls are impermeable and are skipped.
    pub fn mass_through(
        &self,
        populations: &Populations<S>,
        counts: impl Fn(usize) -> bool,
        step: f64,
        masses: &mut Vec<i128>,
    ) {
        masses.clear();
        masses.resize(self.patches.len(), 0);
        let (parity, numbers) = (populations.parity(), populations.numbers());
        let velocities = populations.velocities();
        let mut add = |patch: usize, link: Link, direction: usize| {
            let back = velocities.opposite[direction];
            let cell = link.near as usize - populations.slot(0, back);
            if counts(cell) {
                let leaves = numbers[link.out(parity)].to_f64() + velocities.w[direction];
                let enters = numbers[link.incoming(parity)].to_f64() + velocities.w[back];
                let mass = i128::from(quanta(leaves)) - i128::from(quanta(enters));
                match self.edges.find((to_u32(cell), direction)) {
                    None => masses[patch] += mass,
                    Some(edge) => {
                        let factor = |patch| self.velocity_factor(patch, step);
                        edge.divide(mass, factor, |patch, mass| masses[patch] += mass);
                    }
                }
            }
        };
        for w in self.walls.moving() {
            add(w.patch, w.link, w.direction);
        }
        for (n, patch) in self.patches.iter().enumerate() {
            for kept in patch.rule.links() {
                add(n, kept.link, kept.direction);
            }
        }
    }
}
