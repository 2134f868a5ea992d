//! Openings of water with a free surface.
//!
//! Outside a face there is water or air ([`Outside`]). The populations that enter along the links of a wet cell
//! through the face follow from a law, written with deviations g = f - w, the outward normal n of the face and the
//! velocity u of the water in the cell:
//!
//! | outside | population entering along ī for a leaving g*_i | source |
//! |---|---|---|
//! | stream | as set by the boundary: half-way bounce-back with a velocity | [`crate::boundary::velocity`] |
//! | discharge | g*_i + 6 w_i (c_i·n) Q/A, A the wet area of the face | Ladd 1994 |
//! | level | w_i (ρ_w + (1 + ρ_w) (9/2 (c·u)² - 3/2 u² - 3 c·u) + 3/2 c·F) | Mohamad and Succi 2009 |
//! | air | 2 w_i (9/2 (c·u)² - 3/2 u²) - g*_i, the pressure of the gas as at the surface | [`super::facet`] |
//! | air, low viscosity | w_i (9/2 (c·u)² - 3/2 u² - 3 c·u - ρ + 3/2 c·F), ρ of the cell | here |
//!
//! At a level the law is the equilibrium of the water outside (A. A. Mohamad, S. Succi, Eur. Phys. J. Special
//! Topics 171 (2009) 213). ρ_w is that of the depth of the centre of the cell below it. Water that leaves has the
//! velocity u outside too. Water that enters comes from rest (Bernoulli): it has its component across the face
//! alone, and ρ_w is lower by 3/2 (u_n² - U²), with the mean speed U of the water that enters through the whole
//! opening, 0 if more leaves. So the level is that at the face, and an eddy that draws water in gets no energy from
//! outside. A level that holds in a reservoir is lower at the face by U²/(2 g), with U of the present step: a wave
//! that accelerates the inflow lowers the level, and loses energy. The cells at the face are set to their
//! equilibrium in every step, a relaxation rate of one. A law that reflects what leaves, such as that of
//! [`crate::boundary::pressure`], returns noise with a change of sign, and failed from cell Reynolds numbers of 12
//! to 40 on (`benches/stability/culverts.csv`). No water enters from air: a cell with inflow bounces back.
//!
//! **Air.** An outfall reflects what leaves, so that the pressure in the middle of the links is that of the gas:
//! this is of second order. In water of a lattice viscosity below 0.01 noise would return with a change of sign,
//! and jets failed from a cell Reynolds number of 30 on. There the outfall reflects the equilibrium alone, and the
//! cells at the face are set to theirs as at a level. With a viscosity of 0.03 this would empty a box of ten cells
//! 7 % too slowly.
//!
//! **Mass.** A liquid cell gains the sum over its links of the entering minus the leaving populations; an interface
//! cell gains this sum times the wet fraction of the face. This fraction is 1 for inflow from a stream, the larger
//! of the fill levels on both sides for a discharge, and the fill level on the upstream side at a level. The mass
//! through each opening is summed in quanta, so that the balance closes up to rounding on any number of ranks.
//!
//! **Dry faces.** A gas cell at the face whose outer side is at least half full becomes an interface cell without
//! mass. Such cells count as neighbours of liquid. A discharge onto a dry bed enters at its critical depth, Q² B =
//! g A³ with B the width of the surface (V. T. Chow, Open-channel hydraulics, 1959, section 4-1), and at least half
//! a cell.
//!
//! A stream into air widens by about half a cell at each rim: it is slower by 13 % with 8 cells, by 4 % with 16,
//! and by
//! 2 % with 40.
//!
//! Links through an opening count as walls in the exchange between cells ([`super::exchange`]), so that the surface
//! meets the face at a right angle.

use super::carrier::inertia;
use super::cells::Cells;
use super::conversion::FedCell;
use super::kind::{GAS, LIQUID, SOLID, is_surface, is_wet};
use crate::lanes::Stored;
use crate::populations::{Link, Populations};
use crate::quanta::{from_quanta, quanta};
use base::history::TimeTable;
use base::number::{real, to_u32};
use base::vector::dot;
use decomposition::Communicator;

/// Minimum fill level outside at which a gas cell at the face becomes an interface cell.
const FEEDS: f64 = 0.5;

/// Minimum viscosity on the lattice at which an outfall may reflect noise.
const DAMPS_NOISE: f64 = 0.01;

/// Water or air beyond an opening, in lattice units.
#[derive(Clone, Debug, PartialEq)]
pub enum Outside {
    /// Water with the velocity imposed by the boundary, if that points into the domain.
    Stream,
    /// Discharge over the wet area.
    Discharge(TimeTable),
    /// Water with a level along the axis of gravity, which holds at the face, or in a reservoir beyond it where water
    /// that enters is at rest.
    Level {
        /// Levels outside.
        levels: TimeTable,
        /// `true` if they hold in a reservoir.
        in_reservoir: bool,
    },
    /// Air.
    Air,
}

/// Upward axis of the domain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpAxis {
    /// Index of the axis.
    pub axis: usize,
    /// `true` if upwards is the positive direction.
    pub rises: bool,
    /// Magnitude of the acceleration of gravity along the axis.
    pub gravity: f64,
    /// Number of cells of the domain along the axis.
    pub cells: usize,
}

impl UpAxis {
    /// Returns the row of a cell of the domain, counted from the lowest.
    fn row(&self, at: [usize; 3]) -> usize {
        let n = at[self.axis];
        if self.rises { n } else { self.cells - 1 - n }
    }

    /// Returns the height of a coordinate above the lowest face.
    fn height(&self, coordinate: f64) -> f64 {
        if self.rises {
            coordinate
        } else {
            real(self.cells) - coordinate
        }
    }
}

/// Mass that has passed through an opening since the start on one rank, in quanta.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Passed {
    /// Mass that entered.
    pub entered: i128,
    /// Mass that left.
    pub left: i128,
}

/// Cell at an opening.
#[derive(Clone, Debug)]
struct Face {
    cell: usize,
    row: f64,
    /// Index of the first link and number of links.
    first: usize,
    count: usize,
    /// Fraction of the face that its links represent: the sum of 6 w_i (c_i·n).
    area: f64,
    /// Velocity that a stream imposes at full speed.
    imposed: [f64; 3],
    /// Density and velocity of the water before the pass.
    density: f64,
    velocity: [f64; 3],
}

/// Link through an opening.
#[derive(Clone, Copy, Debug)]
struct Crossed {
    link: Link,
    direction: u8,
    c: [i8; 3],
    weight: f64,
}

/// State outside in a step.
#[derive(Clone, Copy, Debug, Default)]
struct OutsideState {
    /// Height of the water outside above the lowest face; infinite for a stream, below zero for air.
    level: f64,
    /// Speed of a discharge into the domain, factor of the velocity of a stream, and mean speed of the water that
    /// enters from a level, 0 if more leaves.
    speed: f64,
    /// Speed of the discharge into dry cells.
    dry: f64,
}

/// Opening of a slab.
#[derive(Debug)]
pub(crate) struct Opening {
    patch: usize,
    outside: Outside,
    axis: usize,
    /// Outward direction: 1 or -1.
    outward: f64,
    up: UpAxis,
    /// `true` if the cells at the face are set to their equilibrium in every step.
    calms: bool,
    faces: Vec<Face>,
    links: Vec<Crossed>,
    /// Area of the open faces by row, over all ranks; computed in the first step.
    rows: Vec<f64>,
    now: OutsideState,
    passed: Passed,
    /// Mass that entered in the last step, in quanta.
    last: i128,
    /// Half of the body force per volume.
    half_force: [f64; 3],
    /// Wet area of a level, and volume that enters through it in a step, before the pass, in quanta.
    wet: [i128; 2],
}

/// Populations of a link in a step: the leaving one, and the entering one so far.
struct Ends {
    out: f64,
    enters: f64,
}

impl Opening {
    /// Returns an opening without links. `face` is the axis of its face and `true` for the upper end, `viscosity`
    /// that of the water on the lattice.
    pub(crate) fn new(
        patch: usize,
        outside: Outside,
        face: (usize, bool),
        up: UpAxis,
        viscosity: f64,
    ) -> Self {
        let calms = match outside {
            Outside::Level { .. } => true,
            Outside::Air => viscosity < DAMPS_NOISE,
            Outside::Stream | Outside::Discharge(_) => false,
        };
        Self {
            calms,
            patch,
            outside,
            axis: face.0,
            outward: if face.1 { 1.0 } else { -1.0 },
            up,
            faces: Vec::new(),
            links: Vec::new(),
            rows: Vec::new(),
            now: OutsideState::default(),
            passed: Passed::default(),
            last: 0,
            half_force: [0.0; 3],
            wet: [0; 2],
        }
    }

    /// Adds links in ascending order of cell: the link from a cell along a direction, with the indices of the cell
    /// in the domain. `imposed` returns the velocity of a stream at the centre of the face of a cell.
    pub(crate) fn cross<S: Stored>(
        &mut self,
        populations: &Populations<S>,
        start: [usize; 3],
        links: &[(usize, usize)],
        imposed: impl Fn([f64; 3]) -> [f64; 3],
    ) {
        let velocities = populations.velocities();
        for &(cell, direction) in links {
            let c = velocities.c[direction];
            let crossed = Crossed {
                link: populations.link(cell, direction),
                direction: direction.to_le_bytes()[0],
                c,
                weight: velocities.w[direction],
            };
            if self.faces.last().is_none_or(|face| face.cell != cell) {
                let local = populations.coordinates(cell);
                let at: [usize; 3] = std::array::from_fn(|a| local[a].unsigned_abs() + start[a]);
                let mut middle = at.map(|n| real(n) + 0.5);
                middle[self.axis] += 0.5 * self.outward;
                self.faces.push(Face {
                    cell,
                    row: real(self.up.row(at)),
                    first: self.links.len(),
                    count: 0,
                    area: 0.0,
                    imposed: imposed(middle),
                    density: 0.0,
                    velocity: [0.0; 3],
                });
            }
            if let Some(face) = self.faces.last_mut() {
                face.count += 1;
                face.area += 6.0 * crossed.weight * f64::from(c[self.axis]).abs();
            }
            self.links.push(crossed);
        }
    }

    /// Returns the links through the opening.
    pub(super) fn crossed(&self) -> impl Iterator<Item = Link> + '_ {
        self.links.iter().map(|crossed| crossed.link)
    }

    /// Marks the links through the opening.
    pub(super) fn mark_links(&self, cells: &mut Cells) {
        for face in &self.faces {
            for crossed in &self.links[face.first..][..face.count] {
                cells.open(face.cell, crossed.direction);
            }
        }
    }

    /// Returns the number of the patch.
    pub(super) fn patch(&self) -> usize {
        self.patch
    }

    /// Returns the mass that has passed through on this rank.
    pub(super) fn passed(&self) -> Passed {
        self.passed
    }

    /// Sets the mass that has passed through, at a restart.
    pub(super) fn set_passed(&mut self, passed: Passed) {
        self.passed = passed;
    }

    /// Returns the mass that entered in the last step on this rank, in quanta.
    pub(super) fn last(&self) -> i128 {
        self.last
    }

    /// Sets the wet cells at a level, or at an outfall of low viscosity, to their equilibrium, for half of the body
    /// force; density and momentum remain up to rounding, so that this comes before the moments of cells are sent.
    pub(super) fn calm<S: Stored>(
        &self,
        cells: &Cells,
        populations: &mut Populations<S>,
        half_force: [f64; 3],
    ) {
        if !self.calms {
            return;
        }
        let wet = |face: &&Face| is_wet(cells.kind[face.cell]);
        for face in self.faces.iter().filter(wet) {
            set_equilibrium(populations, face.cell, half_force);
        }
    }

    /// Stores the velocities of the water before a pass.
    pub(super) fn remember<S: Stored>(
        &mut self,
        cells: &Cells,
        populations: &Populations<S>,
        half_force: [f64; 3],
    ) {
        self.half_force = half_force;
        self.wet = [0; 2];
        for face in &mut self.faces {
            if !is_wet(cells.kind[face.cell]) {
                continue;
            }
            let (density, momentum) = populations.moments(face.cell);
            face.density = density;
            face.velocity = velocity(density, momentum, half_force);
            let into = -self.outward * face.velocity[self.axis];
            let area = cells.fill[face.cell].clamp(0.0, 1.0) * face.area;
            self.wet[0] += i128::from(quanta(area));
            self.wet[1] += i128::from(quanta(area * into));
        }
    }

    /// Computes the state outside at a step; `factor` is the velocity factor of a stream. Collective.
    pub(super) fn measure(
        &mut self,
        cells: &Cells,
        (step, factor): (f64, f64),
        communicator: &Communicator,
    ) {
        self.now = match &self.outside {
            Outside::Stream => OutsideState {
                level: f64::INFINITY,
                speed: factor,
                dry: 0.0,
            },
            Outside::Level {
                levels,
                in_reservoir,
            } => {
                let mut wet = self.wet.map(i128::cast_unsigned);
                communicator.all_reduce_sum_u128s(&mut wet);
                let [area, entering] = wet.map(|sum| from_quanta(sum.cast_signed()));
                let speed = if entering > 0.0 { entering / area } else { 0.0 };
                let head = if *in_reservoir {
                    0.5 * speed * speed / self.up.gravity
                } else {
                    0.0
                };
                OutsideState {
                    level: self.up.height(levels.value(step)) - head,
                    speed,
                    ..OutsideState::default()
                }
            }
            Outside::Air => OutsideState {
                level: -1.0,
                ..OutsideState::default()
            },
            Outside::Discharge(discharge) => {
                let discharge = discharge.value(step);
                self.stream(cells, discharge, communicator)
            }
        };
    }

    /// Returns the level and the speed of a discharge. Collective.
    fn stream(
        &mut self,
        cells: &Cells,
        discharge: f64,
        communicator: &Communicator,
    ) -> OutsideState {
        if self.rows.is_empty() {
            self.rows = self.areas(cells, communicator);
        }
        let (level, least) = critical(&self.rows, discharge, self.up.gravity);
        let mut wet = 0;
        for face in &self.faces {
            let outside = (level - face.row).clamp(0.0, 1.0);
            let part = match cells.kind[face.cell] {
                LIQUID => 1.0,
                kind if is_surface(kind) => outside.max(cells.fill[face.cell].clamp(0.0, 1.0)),
                _ => 0.0,
            };
            wet += i128::from(quanta(part * face.area));
        }
        let wet = communicator.all_reduce_sum_u128(wet.cast_unsigned());
        let area = from_quanta(wet.cast_signed());
        let through = |area: f64| if area > 0.0 { discharge / area } else { 0.0 };
        OutsideState {
            level,
            speed: through(area),
            dry: through(if area > 0.0 { area } else { least }),
        }
    }

    /// Returns the area of the open faces by row. Collective.
    fn areas(&self, cells: &Cells, communicator: &Communicator) -> Vec<f64> {
        let mut rows = vec![0_i128; self.up.cells];
        for face in &self.faces {
            if cells.kind[face.cell] != SOLID {
                rows[base::number::whole(face.row)] += i128::from(quanta(face.area));
            }
        }
        let mut rows: Vec<u128> = rows.into_iter().map(i128::cast_unsigned).collect();
        communicator.all_reduce_sum_u128s(&mut rows);
        let areas = rows.into_iter();
        areas.map(|area| from_quanta(area.cast_signed())).collect()
    }

    /// Returns the fill level outside of the face of a cell.
    fn fill(&self, face: &Face) -> f64 {
        if self.outside == Outside::Stream {
            let into = -self.outward * self.now.speed * face.imposed[self.axis];
            return f64::from(u8::from(into > 0.0));
        }
        (self.now.level - face.row).clamp(0.0, 1.0)
    }

    /// Returns the velocity of water that enters a dry cell; `None` for that of its neighbours.
    fn entering(&self, face: &Face) -> Option<[f64; 3]> {
        match self.outside {
            Outside::Stream => Some(face.imposed.map(|u| self.now.speed * u)),
            Outside::Discharge(_) => {
                let mut velocity = [0.0; 3];
                velocity[self.axis] = -self.outward * self.now.dry;
                Some(velocity)
            }
            Outside::Level { .. } | Outside::Air => None,
        }
    }

    /// Marks the cells next to water outside.
    pub(super) fn mark(&self, cells: &mut Cells) {
        for face in &self.faces {
            if cells.kind[face.cell] != SOLID && self.fill(face) >= FEEDS {
                cells.feed(face.cell);
            }
        }
    }

    /// Clears the marks of the cells.
    pub(super) fn clear(&self, cells: &mut Cells) {
        for face in &self.faces {
            cells.clear_feed(face.cell);
        }
    }

    /// Sets the populations entering wet cells and the mass of interface cells. Appends the dry cells next to water
    /// outside to `fed`, each with its velocity, if the opening has one.
    pub(super) fn pass<S: Stored>(
        &mut self,
        cells: &mut Cells,
        populations: &mut Populations<S>,
        fed: &mut Vec<FedCell>,
    ) {
        self.last = 0;
        let (axis, now, gravity) = (self.axis, self.now, self.up.gravity);
        let mirrored = |own: f64, outside: f64, gain: f64| {
            if gain > 0.0 { own.max(outside) } else { own }
        };
        match self.outside {
            Outside::Stream => {
                let full = |own: f64, outside: f64, _: f64| own.max(outside);
                self.give(cells, populations, fed, |_, _, ends| ends.enters, full);
            }
            Outside::Discharge(_) => {
                let larger = |own: f64, outside: f64, _: f64| own.max(outside);
                let enters = |_: &Face, crossed: &Crossed, ends: &Ends| {
                    let through = f64::from(crossed.c[axis]).abs();
                    ends.out + 6.0 * crossed.weight * through * now.speed
                };
                self.give(cells, populations, fed, enters, larger);
            }
            Outside::Level { .. } => {
                let (outward, half_force) = (self.outward, self.half_force);
                let enters = |face: &Face, crossed: &Crossed, _: &Ends| {
                    let depth = now.level - face.row - 0.5;
                    let at_rest = if depth < -0.5 {
                        0.0
                    } else {
                        3.0 * gravity * depth
                    };
                    let normal = face.velocity[axis];
                    let (density, velocity) = if normal * outward > 0.0 {
                        (at_rest, face.velocity)
                    } else {
                        let mut velocity = [0.0; 3];
                        velocity[axis] = normal;
                        let head = 1.5 * (now.speed * now.speed - normal * normal);
                        (at_rest + (1.0 + at_rest) * head, velocity)
                    };
                    let c = crossed.c.map(f64::from);
                    let flow =
                        inertia(c, density, velocity) - 3.0 * (1.0 + density) * dot(c, velocity);
                    crossed.weight * (density + flow + 3.0 * dot(c, half_force))
                };
                self.give(cells, populations, fed, enters, mirrored);
            }
            Outside::Air if self.calms => {
                let half_force = self.half_force;
                let enters = |face: &Face, crossed: &Crossed, _: &Ends| {
                    let (c, velocity) = (crossed.c.map(f64::from), face.velocity);
                    let flow = inertia(c, 0.0, velocity) - 3.0 * dot(c, velocity);
                    crossed.weight * (flow - face.density + 3.0 * dot(c, half_force))
                };
                self.give(cells, populations, fed, enters, mirrored);
            }
            Outside::Air => {
                let enters = |face: &Face, crossed: &Crossed, ends: &Ends| {
                    2.0 * crossed.weight * inertia(crossed.c.map(f64::from), 0.0, face.velocity)
                        - ends.out
                };
                self.give(cells, populations, fed, enters, mirrored);
            }
        }
    }

    /// Sets populations and mass like [`Self::pass`], with the law of the opening and the wet fraction of the face
    /// of an interface cell, which is computed from its own fill level, the fill level outside and the gain of a
    /// full cell.
    fn give<S: Stored>(
        &mut self,
        cells: &mut Cells,
        populations: &mut Populations<S>,
        fed: &mut Vec<FedCell>,
        enters: impl Fn(&Face, &Crossed, &Ends) -> f64,
        part: impl Fn(f64, f64, f64) -> f64,
    ) {
        let parity = populations.parity();
        let numbers = populations.numbers_mut();
        let one_way = self.outside == Outside::Air;
        for face in &self.faces {
            let kind = cells.kind[face.cell];
            if kind == SOLID {
                continue;
            }
            let outside = self.fill(face);
            let links = &self.links[face.first..][..face.count];
            if kind == GAS {
                for crossed in links {
                    numbers[crossed.link.out(parity)] = S::from_f64(0.0);
                    numbers[crossed.link.incoming(parity)] = S::from_f64(0.0);
                }
                if outside >= FEEDS {
                    fed.push((to_u32(face.cell), self.entering(face)));
                }
                continue;
            }
            let mut gain = 0.0;
            for crossed in links {
                let incoming = crossed.link.incoming(parity);
                let ends = Ends {
                    out: numbers[crossed.link.out(parity)].to_f64(),
                    enters: numbers[incoming].to_f64(),
                };
                let value = S::from_f64(enters(face, crossed, &ends));
                numbers[incoming] = value;
                gain += value.to_f64() - ends.out;
            }
            if one_way && gain > 0.0 {
                for crossed in links {
                    numbers[crossed.link.incoming(parity)] = numbers[crossed.link.out(parity)];
                }
                gain = 0.0;
            }
            if is_surface(kind) {
                let own = cells.fill[face.cell].clamp(0.0, 1.0);
                gain *= part(own, outside, gain);
                cells.mass[face.cell] += gain;
            }
            let gain = i128::from(quanta(gain));
            self.last += gain;
            if gain > 0 {
                self.passed.entered += gain;
            } else {
                self.passed.left -= gain;
            }
        }
    }
}

/// Returns the velocity of water with a density and a momentum Σ c g before a collision, for half of the body force.
fn velocity(density: f64, momentum: [f64; 3], half_force: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|a| (momentum[a] + half_force[a]) / (1.0 + density))
}

/// Replaces the populations that enter a cell by their equilibrium with the same density and momentum.
fn set_equilibrium<S: Stored>(populations: &mut Populations<S>, cell: usize, half_force: [f64; 3]) {
    let (density, momentum) = populations.moments(cell);
    let velocity = velocity(density, momentum, half_force);
    for i in 0..populations.velocities().c.len() {
        let velocities = populations.velocities();
        let (w, c) = (velocities.w[i], velocities.c[i].map(f64::from));
        let even = density + inertia(c, density, velocity);
        let slot = populations.incoming(cell, i);
        populations.numbers_mut()[slot] = S::from_f64(w * (even + 3.0 * dot(c, momentum)));
    }
}

/// Returns the height of the water at which a discharge through the open faces of these rows is critical, at least
/// half a cell above the lowest of them, and the area below it; -1 and 0 without a discharge.
fn critical(rows: &[f64], discharge: f64, gravity: f64) -> (f64, f64) {
    if discharge <= 0.0 {
        return (-1.0, 0.0);
    }
    let mut below = 0.0;
    let mut bed = None;
    for (n, &area) in rows.iter().enumerate() {
        if area <= 0.0 {
            continue;
        }
        let lowest = *bed.get_or_insert(real(n) + 0.5);
        let wanted = (discharge * discharge * area / gravity).cbrt();
        if wanted < below + area {
            let level = real(n) + ((wanted - below) / area).max(0.0);
            let level = level.max(lowest);
            return (level, (below + area * (level - real(n))).max(0.5 * area));
        }
        below += area;
    }
    (real(rows.len()), below)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the critical depth: (q²/g)^⅓ above the bed in a rectangular section, and (2 Q²/(g m²))^⅕ in a triangular
    /// section with sides of slope m.
    #[test]
    fn a_discharge_is_critical_at_the_depth_of_its_section() {
        let gravity = 1e-4;
        let mut rows = vec![0.0; 3];
        rows.extend(vec![20.0; 40]);
        for depth in [0.6, 4.0, 7.3, 21.9] {
            let discharge = 20.0 * (gravity * f64::powi(depth, 3)).sqrt();
            let (level, area) = critical(&rows, discharge, gravity);
            assert!((level - 3.0 - depth).abs() < 1e-9, "{level} for {depth}");
            assert!((area - 20.0 * depth).abs() < 1e-9);
        }
        assert_eq!(critical(&rows, 0.0, gravity), (-1.0, 0.0));
        let (least, _) = critical(&rows, 1e-6, gravity);
        assert_eq!(least, 3.5);
        let triangle: Vec<f64> = (0..100_u64).map(|n| 2.0 * (real(n) + 0.5)).collect();
        let depth = 30.0;
        let discharge = (gravity * f64::powi(depth, 5) / 2.0).sqrt();
        let (level, _) = critical(&triangle, discharge, gravity);
        assert!((level - depth).abs() < 0.3, "{level}");
    }
}
