//! Force and torque of the water of a seepage on the surface of a structure in the ground.

use super::quantity::Quantity;
use super::structure::load_headings;
use super::{Heading, Rows, no_fluid, sampled_if_solved};
use crate::view::StateView;
use base::error::Error;
use darcy::WettedSurface;
use darcy::surface::Solids;
use dem::space::Space;
use plan::scene::Scene;

/// Load on the surface of a structure, which is divided by the cells at the first sample.
#[derive(Clone, Debug)]
pub(super) struct SurfaceLoad {
    solids: Solids,
    index: usize,
    about: [f64; 3],
    surface: Option<WettedSurface>,
}

impl SurfaceLoad {
    /// Returns the load on the structure of an index, with the torque about a point \[m\].
    pub(super) fn new(scene: &Scene, index: usize, about: [f64; 3]) -> Result<Self, Error> {
        let seepage = scene.seepage.as_ref().ok_or_else(no_fluid)?;
        Ok(Self {
            solids: seepage.solids.clone(),
            index,
            about,
            surface: None,
        })
    }
}

impl Quantity for SurfaceLoad {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        load_headings(scene.grid.dimension)
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        sampled_if_solved(view, |seepage| {
            let surface = self.surface.get_or_insert_with(|| {
                let wet = |cell: usize| seepage.pores().porosity()[cell] > 0.0;
                WettedSurface::new(seepage.grid(), &self.solids, self.index, &wet)
            });
            let values = seepage.pressure().load(surface, self.about);
            rows.iter_mut().for_each(|row| row.extend(values));
        })
    }
}
