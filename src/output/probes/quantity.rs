//! The interface of a quantity that a probe samples.

use super::{Heading, Rows, Run};
use crate::view::StateView;
use base::error::Error;
use dem::space::Space;
use plan::scene::Scene;
use std::path::Path;

/// Quantity that a probe samples.
pub(super) trait Quantity {
    /// Returns the columns of the samples of a quantity with their units, without step and time.
    fn headings(&self, scene: &Scene) -> Vec<Heading>;

    /// Returns the number of rows per sample.
    fn rows(&self) -> usize {
        1
    }

    /// Returns the number of steps by which a sample precedes its step: a force from populations that cross links in a
    /// step is the mean over this step.
    fn delay(&self) -> f64 {
        0.0
    }

    /// Stores values that depend on the run. Collective.
    ///
    /// # Errors
    /// If the run lacks something that the quantity needs.
    fn begin(&mut self, _run: &Run) -> Result<(), Error> {
        Ok(())
    }

    /// Reads values on which later rows depend from the table of an earlier part of the run; called on rank 0.
    ///
    /// # Errors
    /// If the table cannot be read.
    fn remember(&mut self, _table: &Path) -> io::Result<()> {
        Ok(())
    }

    /// Appends the values of this step to the rows, which already contain the time; rank 0 has the values. Returns
    /// `false` if there is nothing to sample yet. Collective.
    ///
    /// # Errors
    /// If the scene has no fluid of the kind that is sampled.
    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error>;
}
