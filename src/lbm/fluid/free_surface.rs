//! Free surface of a fluid ([`crate::surface`]).

use super::Fluid;
use crate::boundary::{OutsideOfPatch, SurfaceKind};
use crate::error::FluidError;
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::surface::{Ends, Opening, SlabSurface, SurfaceTension, UpAxis};
use decomposition::Domain;

impl<S: Stored> Fluid<S> {
    /// Adds a free surface to the fluid; its cells contain gas until [`Self::fill`]. Collective.
    ///
    /// # Errors
    /// If the slabs of two neighbours do not fit each other.
    pub fn open_surface(&mut self, domain: &Domain) -> Result<(), FluidError> {
        let (ends, half_force) = (self.ends(domain), self.force.force_at(0.0).map(|f| 0.5 * f));
        let mut surface = SlabSurface::new(&self.populations, ends, half_force, domain)
            .map_err(FluidError::Surface)?;
        surface.open(self.openings());
        surface.set_mirrored(self.boundaries.mirrored_cells(&self.populations));
        let faces = self.boundaries.straight_links(&self.populations, false);
        surface.set_walls(faces.links_at(SurfaceKind::Wall).collect());
        self.surface = Some(Box::new(surface));
        Ok(())
    }

    /// Gives the free surface a tension. Collective.
    ///
    /// # Errors
    /// If the slabs of two neighbours do not fit each other.
    pub fn add_surface_tension(
        &mut self,
        tension: SurfaceTension,
        domain: &Domain,
    ) -> Result<(), FluidError> {
        let ends = self.ends(domain);
        match &mut self.surface {
            Some(surface) => surface
                .add_tension(&self.populations, ends, domain, tension)
                .map_err(FluidError::Surface),
            None => Ok(()),
        }
    }

    /// Returns the conditions at the ends of the slab.
    fn ends(&self, domain: &Domain) -> Ends {
        let split = domain.axis().index();
        let mut mirrored = self.boundaries.mirrored();
        let local = self.populations.cells();
        for axis in 0..3 {
            let start = if axis == split {
                self.extent.start[axis]
            } else {
                0
            };
            let end = start + local[axis];
            mirrored[axis][0] &= start == 0 && !self.extent.periodic[axis];
            mirrored[axis][1] &= end == self.extent.cells[axis] && !self.extent.periodic[axis];
        }
        Ends {
            periodic: self.extent.periodic_within,
            mirrored,
        }
    }

    /// Returns the openings of the surface with the links of this slab.
    fn openings(&self) -> Vec<Opening> {
        let force = self.half_force().map(|f| 2.0 * f);
        let dimension = self.populations.velocities().dimension;
        let axes = 0..dimension;
        let axis = axes.max_by(|a, b| force[*a].abs().total_cmp(&force[*b].abs()));
        let axis = axis.unwrap_or(0);
        let up = UpAxis {
            axis,
            rises: force[axis] <= 0.0,
            gravity: force[axis].abs(),
            cells: self.extent.cells[axis],
        };
        let patches = self.boundaries.outsides();
        let opening = |open: OutsideOfPatch| {
            let links = (self.boundaries).links_of(open.patch, &self.populations);
            let viscosity = (self.relaxation_time - 0.5) / 3.0;
            let mut opening = Opening::new(open.patch, open.outside, open.face, up, viscosity);
            let imposed = |middle| self.boundaries.imposed(open.patch, middle);
            opening.cross(&self.populations, self.extent.start, &links, imposed);
            opening
        };
        patches.map(opening).collect()
    }

    /// Computes the state outside the openings. Collective.
    fn measure_outside(&mut self) {
        let Some(surface) = &mut self.surface else {
            return;
        };
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let step = self.step as f64;
        let boundaries = &self.boundaries;
        let factor = |patch| boundaries.velocity_factor(patch, step);
        surface.measure(step, factor, &self.communicator);
    }

    /// Returns the free surface, if there is one.
    #[must_use]
    pub fn surface(&self) -> Option<&SlabSurface> {
        self.surface.as_deref()
    }

    /// Returns the free surface, for changes of its state.
    pub fn surface_mut(&mut self) -> Option<&mut SlabSurface> {
        self.surface.as_deref_mut()
    }

    /// Fills the cells with water at the start; `level` returns the fill level of a cell from its indices in the
    /// domain. The populations of wet cells must have been set, and solid cells must be known. Collective.
    pub fn fill(&mut self, level: &dyn Fn([usize; 3]) -> f64) {
        self.measure_outside();
        let Some(surface) = &mut self.surface else {
            return;
        };
        let start = self.extent.start;
        surface.begin(&mut self.populations, |at| {
            level(std::array::from_fn(|a| at[a] + start[a]))
        });
        self.clear_gas();
        self.continue_velocities();
    }

    /// Restores the free surface at a restart, after the populations: kind, mass and undistributed excess of each
    /// of `cells`. Collective.
    pub fn restore_surface(&mut self, cells: &[usize], saved: &[[f64; 3]], lost: i128) {
        self.measure_outside();
        if let Some(surface) = &mut self.surface {
            surface.set_lost(lost);
            surface.restore(&mut self.populations, cells, saved);
        }
    }

    /// Moves the free surface: the last part of a step, after all populations that come from water and solids are
    /// set. Collective.
    pub fn move_surface(&mut self) {
        self.measure_outside();
        let half = self.last_force().map(|force| 0.5 * force);
        if let Some(surface) = &mut self.surface
            && !self.populations.cells().contains(&0)
        {
            if let Some(cover) = &mut self.cover {
                surface.act_on_bodies(&mut self.populations, cover, half);
            }
            let (boundaries, structures) = (&self.boundaries, &self.closed);
            let left = |populations: &Populations<S>, wet: &dyn Fn(usize) -> bool| {
                let [_, momentum @ ..] = boundaries.left(populations, structures, wet);
                momentum
            };
            surface.complete(&mut self.populations, &left);
            surface.end_balance(&self.populations, &left);
            surface.finish(&mut self.populations);
            let bodies_follow = surface.has_bodies();
            self.enter_velocities();
            if !bodies_follow {
                self.continue_velocities();
            }
        }
    }

    /// Starts or leaves out the balance of the momentum of the next step with a free surface.
    pub fn balance_surface(&mut self, wanted: bool) {
        if let Some(surface) = &mut self.surface {
            surface.balance(wanted);
        }
    }

    /// Sends the moments next to the surface again, after populations were set between two steps. Collective.
    pub fn renew_moments(&mut self) {
        if let Some(surface) = &mut self.surface
            && !self.populations.cells().contains(&0)
        {
            surface.renew_moments(&self.populations);
        }
    }

    /// Transfers the mass of the cells that bodies fill, given by position in any order, after the cover was
    /// computed. Collective.
    pub fn meet_bodies(&mut self, filled: impl Iterator<Item = usize>) {
        let (Some(surface), Some(cover)) = (&mut self.surface, &self.cover) else {
            return;
        };
        surface.meet_bodies(&mut self.populations, cover, filled, &self.communicator);
        if self.populations.cells().contains(&0) {
            return;
        }
        if let (Some(surface), Some(field)) = (&self.surface, &mut self.field) {
            for (cell, u) in surface.newly_held() {
                #[expect(clippy::cast_possible_truncation, reason = "the field is in f32")]
                field.set_velocity(cell, u.map(|u| u as f32));
            }
            self.spread_velocities();
        }
        self.continue_velocities();
    }

    /// Hides the parts of bodies in the air from the pass, or restores them.
    pub(super) fn hide_dry(&mut self, hidden: bool) {
        if let (Some(surface), Some(cover)) = (&self.surface, &mut self.cover)
            && surface.has_bodies()
        {
            for cell in surface.dry() {
                cover.hide(cell, hidden);
            }
        }
    }

    /// Sets the velocities for the eddy viscosity in cells that the surface has newly reached, and their ghosts.
    /// Collective.
    fn enter_velocities(&mut self) {
        let (Some(surface), Some(field)) = (&self.surface, &mut self.field) else {
            return;
        };
        for (cell, u) in surface.entered() {
            #[expect(clippy::cast_possible_truncation, reason = "the field is in f32")]
            field.set_velocity(cell, u.map(|u| u as f32));
        }
        self.spread_velocities();
    }

    /// Extrapolates the velocities for the eddy viscosity into the gas next to the surface, so that gradients there
    /// are those of the water. Collective.
    pub fn continue_velocities(&mut self) {
        if let (Some(surface), Some(field)) = (&mut self.surface, &mut self.field) {
            let cells = surface.shore(&self.populations, |cell| field.velocity(cell));
            for &(cell, u) in cells {
                field.set_velocity(cell, u);
            }
            self.spread_velocities();
        }
    }

    /// Returns `true` if the populations of a cell are defined: `false` for cells without water at a free surface.
    #[inline]
    #[must_use]
    pub fn holds_water(&self, cell: usize) -> bool {
        self.surface
            .as_ref()
            .is_none_or(|surface| surface.is_wet(cell))
    }

    /// Sets the populations of the cells without water to rest.
    fn clear_gas(&mut self) {
        let Some(surface) = &self.surface else { return };
        let dry: Vec<usize> = (self.populations.interior().map(|(_, cell)| cell))
            .filter(|&cell| !surface.is_wet(cell))
            .collect();
        for cell in dry {
            for i in 0..self.populations.velocities().q() {
                let position = self.populations.incoming(cell, i);
                self.populations.numbers_mut()[position] = S::from_f64(0.0);
            }
        }
    }
}
