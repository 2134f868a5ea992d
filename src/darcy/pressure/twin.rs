//! Second solver for the same ground: solutions under other conditions, without a change of the state of a run.

use super::{Condition, Liquid, Pressure, head_pressure};
use crate::SeepageError;
use crate::enclosure::Openness;

impl Pressure {
    /// Returns a second solver for the same saturated ground and conditions, without a solution. Collective.
    ///
    /// # Errors
    /// If the messages between ranks cannot be set up.
    pub fn twin(&self, openness: &Openness) -> Result<Self, SeepageError> {
        let mut twin = Self::new(
            openness,
            self.patches.clone(),
            self.liquid,
            self.settings,
            &self.slab.communicator,
        )?;
        if let Some(directions) = &self.conduction.directions {
            twin.set_directions(&directions.ratios);
        }
        Ok(twin)
    }

    /// Returns the properties of the water.
    #[must_use]
    pub fn liquid(&self) -> Liquid {
        self.liquid
    }

    /// Returns the weight of a volume of water \[N/m3\]; 0 without gravity.
    #[must_use]
    pub fn unit_weight(&self) -> f64 {
        head_pressure(&self.liquid, &self.settings, 1.0)
    }

    /// Returns the conditions of the patches.
    pub fn conditions(&self) -> impl Iterator<Item = Condition> {
        self.patches.iter().map(|patch| patch.condition)
    }
}
