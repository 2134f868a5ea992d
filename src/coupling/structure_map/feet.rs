//! Feet of structures: links that leave the domain next to a structure.
//!
//! A link from a cell in the corner between a face of the domain and a structure leaves the domain along one or two
//! axes and leads into the structure along the others. The face returns its population, but its momentum acts on
//! both: along the axes on which it leaves on the face, along the others on the structure. In water at rest the
//! structure then has the pressure over its whole height; without these links a sixth of that of its lowest cell is
//! missing.

use super::{StructureMap, WATER};
use lbm::boundary::{StraightLinks, SurfaceKind};
use lbm::feet::StructureFoot;
use lbm::fluid::Fluid;
use lbm::lanes::Stored;
use lbm::populations::{Link, Populations};
use lbm::quanta::quanta;

/// Link through a face at the foot of a structure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    /// Structure that receives the momentum along each axis.
    of_axes: [usize; 3],
    /// Positions of the two populations.
    link: Link,
    /// Position in the lattice of the cell, and direction.
    key: (u32, u8),
    /// Part of the direction that leads into the structure.
    into: [i8; 3],
    /// Axes of this part, and the face.
    shared: StructureFoot,
    /// Midpoint of the link in half cells, in the frame of the domain.
    middle: [i32; 3],
    /// Position in the map of the cell.
    cell: u32,
    /// `true` if the cell is water.
    wet: bool,
}

impl StructureMap {
    /// Finds the feet of the structures among the links `straight`, along which a face returns a population to the cell
    /// that sent one.
    pub(super) fn find_feet<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        straight: &StraightLinks,
    ) {
        let velocities = populations.velocities();
        let mut feet = Vec::new();
        for (links, group) in self.links.iter().zip(&self.groups) {
            for (link, ends) in links.iter().zip(&group.places) {
                let forth = usize::from(link.direction);
                let back = velocities.opposite[forth];
                let near = link.link.near as usize - populations.slot(0, back);
                let far = link.link.far as usize - populations.slot(0, forth);
                for (end, (cell, direction)) in [(near, forth), (far, back)].into_iter().enumerate()
                {
                    if ends.wet[end] {
                        let of_end = (cell, velocities.c[direction], ends.cells[end]);
                        self.feet_of(group.of_axes, of_end, populations, straight, &mut feet);
                    }
                }
            }
        }
        // A link has one part that stays in the domain, so that no foot occurs twice.
        feet.sort_unstable_by_key(|foot: &Foot| foot.key);
        self.feet = feet;
    }

    /// Adds the feet of a structure at a link along `into` from a cell, given by its positions in the lattice and
    /// in the map.
    fn feet_of<S: Stored>(
        &self,
        of_axes: [usize; 3],
        (position, into, cell): (usize, [i8; 3], u32),
        populations: &Populations<S>,
        straight: &StraightLinks,
        feet: &mut Vec<Foot>,
    ) {
        let velocities = populations.velocities();
        let at = populations.coordinates(position);
        for (j, c) in velocities.c.iter().enumerate().take(velocities.q()) {
            let along = (0..3).filter(|&a| into[a] != 0);
            if *c == into || !along.into_iter().all(|a| c[a] == into[a]) {
                continue;
            }
            let key = (
                u32::try_from(position).unwrap_or(u32::MAX),
                u8::try_from(j).unwrap_or(0),
            );
            let leaves = (0..3).all(|a| into[a] != 0 || c[a] == 0 || self.leaves(at, a, c[a]));
            let Some(surface) = straight.surface(key).filter(|_| leaves) else {
                continue;
            };
            let start = |a: usize| i32::try_from(self.grid.start[a]).unwrap_or(i32::MAX);
            feet.push(Foot {
                of_axes,
                link: populations.link(position, j),
                key,
                into,
                shared: StructureFoot {
                    axes: into.map(|c| c != 0),
                    wall_moves: surface == SurfaceKind::MovingWall,
                },
                middle: std::array::from_fn(|a| {
                    if a < self.dimension {
                        2 * (i32::try_from(at[a]).unwrap_or(i32::MAX) + start(a))
                            + 1
                            + i32::from(c[a])
                    } else {
                        0
                    }
                }),
                cell,
                wet: true,
            });
        }
    }

    /// Returns `true` if a step of one cell along an axis leaves the domain.
    fn leaves(&self, at: [isize; 3], axis: usize, step: i8) -> bool {
        let mut next = at.map(|x| i32::try_from(x).unwrap_or(i32::MAX));
        next[axis] += i32::from(step);
        !self.in_domain(next)
    }

    /// Returns the feet by position of the cell in the lattice and direction.
    pub(super) fn shared_feet(&self) -> impl Iterator<Item = ((u32, u8), StructureFoot)> + '_ {
        self.feet.iter().map(|foot| (foot.key, foot.shared))
    }

    /// Adds the loads at the feet in this step to those of [`StructureMap::bounce`], after the faces have returned
    /// their populations. Air next to a free surface exerts none, whatever numbers a pass leaves in its cells.
    pub fn load_feet<S: Stored>(&mut self, fluid: &Fluid<S>) {
        let populations = fluid.populations();
        let (parity, numbers) = (populations.parity(), populations.numbers());
        let feet = std::mem::take(&mut self.feet);
        let wet = |foot: &&Foot| foot.wet && fluid.holds_water(foot.key.0 as usize);
        for foot in feet.iter().filter(wet) {
            let [left, returned] = [foot.link.out(parity), foot.link.incoming(parity)];
            let sent = [left, returned].map(|number| quanta(numbers[number].to_f64()));
            let given = foot.shared.given(sent);
            let force = foot.into.map(|c| i64::from(c) * given);
            self.add_by_axis(foot.of_axes, force, foot.middle);
        }
        self.feet = feet;
    }

    /// Updates which feet are in water: `is_water` returns this for a cell, given by its position in the map.
    pub(super) fn update_feet(&mut self, is_water: impl Fn(u32) -> bool) {
        for foot in &mut self.feet {
            foot.wet = self.owner[foot.cell as usize] == WATER && is_water(foot.cell);
        }
    }
}
