//! Quantities computed from a fluid: force, state of the cells, stress, and flux through its faces.

use super::Fluid;
use crate::boundary::{Beside, FaceLoads, Flux};
use crate::extremes::{self, Extremes};
use crate::initial;
use crate::lanes::Stored;
use crate::surface::SlabSurface;
use std::collections::HashSet;
use std::ops::Range;

impl<S: Stored> Fluid<S> {
    /// Returns F/2 at the present step: half of the force that the next collision adds (trapezoidal rule in time,
    /// Guo et al. 2002).
    #[must_use]
    pub fn half_force(&self) -> [f64; 3] {
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let now = self.step as f64;
        self.force.force_at(now).map(|f| 0.5 * f)
    }

    /// Returns the body force of the last step.
    #[must_use]
    pub fn last_force(&self) -> [f64; 3] {
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let last = self.step.saturating_sub(1) as f64;
        self.force.force_at(last)
    }

    /// Returns the incoming population of a cell along a direction for a checkpoint: zero for a cell without water
    /// at a free surface.
    #[must_use]
    pub fn saved_number(&self, cell: usize, i: usize) -> S {
        if self.holds_water(cell) {
            self.populations.numbers()[self.populations.incoming(cell, i)]
        } else {
            S::from_f64(0.0)
        }
    }

    /// Returns the density deviation and velocity of an interior cell (position from `Populations::cell`).
    #[must_use]
    pub fn state(&self, cell: usize) -> (f64, [f64; 3]) {
        if !self.holds_water(cell) {
            return (0.0, [0.0; 3]);
        }
        let (drho, momentum) = self.populations.moments(cell);
        let half = self.half_force();
        let u = std::array::from_fn(|a| (momentum[a] + half[a]) / (1.0 + drho));
        (drho, self.corrected(cell, u))
    }

    /// Returns the velocity of a cell from the velocity of momentum and body force, corrected by the terms that
    /// change it.
    fn corrected(&self, cell: usize, velocity: [f64; 3]) -> [f64; 3] {
        let terms = self.added.iter();
        terms.fold(velocity, |velocity, term| {
            term.velocity(cell, velocity, self.cover.as_ref())
        })
    }

    /// Returns the inverse of [`Self::corrected`].
    pub(super) fn of_momentum(&self, cell: usize, velocity: [f64; 3]) -> [f64; 3] {
        let terms = self.added.iter().rev();
        terms.fold(velocity, |velocity, term| {
            term.of_momentum(cell, velocity, self.cover.as_ref())
        })
    }

    /// Returns `true` if terms change the velocities in addition to momentum and body force.
    pub(crate) fn corrects_velocities(&self) -> bool {
        self.added.iter().any(|term| term.changes_velocities())
    }

    /// Computes the states of a row of `length` cells along the fastest axis from `cell` on, with the same bits:
    /// density deviation, then the three velocities.
    pub fn row_states(&self, cell: usize, length: usize, states: &mut [Vec<f64>; 4]) {
        self.populations.row_moments(cell, length, states);
        let half = self.half_force();
        let [drho, velocity @ ..] = states;
        for (u, half) in velocity.iter_mut().zip(half) {
            for (u, drho) in u.iter_mut().zip(&*drho) {
                *u = (*u + half) / (1.0 + drho);
            }
        }
        if self.corrects_velocities() {
            let [_, u, v, w] = states;
            let components = u.iter_mut().zip(v.iter_mut()).zip(w.iter_mut());
            for (position, ((u, v), w)) in (cell..).zip(components) {
                [*u, *v, *w] = self.corrected(position, [*u, *v, *w]);
            }
        }
        let Some(surface) = self.surface() else {
            return;
        };
        let [drho, velocity @ ..] = states;
        for k in (0..length).filter(|k| !surface.is_wet(cell + k)) {
            drho[k] = 0.0;
            for u in velocity.iter_mut() {
                u[k] = 0.0;
            }
        }
    }

    /// Returns the extreme values of a row of `length` cells from `cell` on; `work` is a reusable buffer.
    pub fn row_extremes(&self, cell: usize, length: usize, work: &mut [Vec<f64>; 4]) -> Extremes {
        if self.corrects_velocities() {
            self.row_states(cell, length, work);
            return extremes::of_velocities(work);
        }
        let half = self.half_force();
        self.populations.row_extremes(cell, length, half, work)
    }

    /// Computes the states of the interior cells of some planes normal to z: `density` and `velocity` in the order
    /// \[z\]\[y\]\[x\]; `row` is a buffer.
    pub fn band_states(
        &self,
        planes: Range<usize>,
        density: &mut [f64],
        velocity: &mut [[f64; 3]],
        row: &mut [Vec<f64>; 4],
    ) {
        let [nx, ny, _] = self.populations.cells();
        let extent = [0..nx, 0..ny, planes];
        let stride = [1, nx, nx * ny];
        let [a, b, along] = self.populations.order();
        for i in extent[a].clone() {
            for j in extent[b].clone() {
                let mut first = extent.each_ref().map(|cells| cells.start);
                (first[a], first[b]) = (i, j);
                let cell = self.populations.interior_cell(first);
                self.row_states(cell, extent[along].len(), row);
                let [rho, u, v, w] = &*row;
                let mut place: usize = (0..3)
                    .map(|axis| (first[axis] - extent[axis].start) * stride[axis])
                    .sum();
                for ((rho, u), (v, w)) in rho.iter().zip(u).zip(v.iter().zip(w)) {
                    density[place] = *rho;
                    velocity[place] = [*u, *v, *w];
                    place += stride[along];
                }
            }
        }
    }

    /// Returns the deviatoric viscous stress σ_ab = -(1 - ω/2) Σ c_a c_b g^neq of an interior cell in lattice
    /// units, including the subgrid stress of a turbulence model.
    #[must_use]
    pub fn stress(&self, cell: usize) -> [[f64; 3]; 3] {
        let (drho, u) = self.state(cell);
        let velocities = self.populations.velocities();
        let mut stress = [[0.0; 3]; 3];
        let time = self.relaxation_time + 3.0 * self.eddy_viscosity(cell);
        let factor = -(1.0 - 0.5 / time);
        for i in 0..velocities.q() {
            let c = velocities.c[i];
            let g = self.populations.numbers()[self.populations.incoming(cell, i)].to_f64();
            let departure = g - initial::equilibrium(velocities.w[i], c, drho, u);
            for a in 0..3 {
                for b in 0..3 {
                    stress[a][b] += factor * f64::from(c[a]) * f64::from(c[b]) * departure;
                }
            }
        }
        stress
    }

    /// Returns the flow of water through each patch during the last step, on this rank, of a fluid without bodies.
    #[must_use]
    pub fn fluxes(&self) -> Vec<Flux> {
        self.fluxes_beside(None, FaceLoads::default())
    }

    /// Returns the flow of water through each patch during the last step, on this rank. `bodies` returns `true` for the
    /// cells and ghost cells (local coordinates) that bodies with a content of their own filled in that step; `loads`
    /// are those on planes of symmetry at links into mirror images of structures and bodies.
    #[must_use]
    pub fn fluxes_beside(
        &self,
        bodies: Option<&dyn Fn([isize; 3]) -> bool>,
        loads: FaceLoads,
    ) -> Vec<Flux> {
        // Cells that water has just reached sent nothing in the pass.
        let surface = self.surface().into_iter();
        let reached: HashSet<usize> = surface.flat_map(SlabSurface::reached).collect();
        let in_body =
            |cell| bodies.is_some_and(|in_body| in_body(self.populations.coordinates(cell)));
        let solid = |cell| self.closed.holds(cell) || in_body(cell);
        let wet = |cell| solid(cell) || self.holds_water(cell) && !reached.contains(&cell);
        let beside = Beside {
            wet: &wet,
            solid: &solid,
            structures: &self.closed,
            planes: self.planes_of_symmetry(),
            loads,
        };
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let step = self.step as f64;
        let mut fluxes = self.boundaries.fluxes(&self.populations, &beside, step);
        for (patch, entered) in self.surface().iter().flat_map(|s| s.entered_in_last_step()) {
            fluxes[patch].mass = -entered;
        }
        fluxes
    }

    /// Returns mass and momentum that left through all faces during the last step on this rank, in quanta. The
    /// momentum is that of the cells for which `counts` is true (local coordinates), without the pressure at rest.
    pub fn left(&self, counts: impl Fn([usize; 3]) -> bool) -> [i128; 4] {
        let counts = |position| counts(self.interior_coordinates(position));
        self.boundaries
            .left(&self.populations, &self.closed, counts)
    }

    /// Computes the mass that left through each patch during the last step on this rank, in quanta, at the cells
    /// for which `counts` is true (local coordinates).
    pub fn mass_through(&self, counts: impl Fn([usize; 3]) -> bool, masses: &mut Vec<i128>) {
        if let Some(surface) = self.surface() {
            // Interface cells receive a fraction of the mass that passes through their links.
            masses.clear();
            masses.resize(self.boundaries.count(), 0);
            for (patch, entered) in surface.entered_in_last_step() {
                masses[patch] = -entered;
            }
            return;
        }
        let counts = |position| counts(self.interior_coordinates(position));
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let step = self.step as f64;
        self.boundaries
            .mass_through(&self.populations, counts, step, masses);
    }

    /// Returns the local coordinates of an interior cell; for a ghost cell those of the interior cell that it
    /// copies.
    fn interior_coordinates(&self, position: usize) -> [usize; 3] {
        let (at, cells) = (
            self.populations.coordinates(position),
            self.populations.cells(),
        );
        std::array::from_fn(|a| at[a].rem_euclid(cells[a].cast_signed()).cast_unsigned())
    }
}
