//! The states of the recorders of a run in a checkpoint.

use super::{collapse, crossings, departures, erosion, guards, removal};
use base::error::Error;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// States of the recorders and guards of a run past its preparation.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(super) struct Recorders {
    /// Counts of removed and generated grains.
    pub(super) removal: removal::RemovalState,
    /// Bodies and grains that left through openings.
    #[serde(default)]
    pub(super) departures: departures::Departures,
    /// State of the erosion recorder.
    pub(super) recorder: erosion::ErosionState,
    /// State of the collapse recorder; none without that analysis.
    #[serde(default)]
    pub(super) collapse: Option<collapse::CollapseState>,
    /// Counts of the regions that record.
    #[serde(default)]
    pub(super) crossings: Vec<crossings::CrossingCount>,
    /// Values of the guards; [`saved_guards`] reads them.
    #[serde(skip_deserializing)]
    pub(super) guards: Option<guards::GuardState>,
}

impl Recorders {
    /// Reads the states from the attributes of a checkpoint.
    ///
    /// # Errors
    /// If a state is missing or broken, [`Error::Io`].
    pub(super) fn read(attributes: &Value) -> Result<Self, Error> {
        Self::deserialize(attributes).map_err(|error| {
            Error::Io(format!(
                "the saved state of the recorders cannot be used: {error}"
            ))
        })
    }

    /// Adds the states to the attributes of a checkpoint.
    ///
    /// # Errors
    /// If a state cannot be written as JSON.
    pub(super) fn write(&self, attributes: &mut Value) -> Result<(), Error> {
        let states = serde_json::to_value(self).map_err(|e| Error::Internal(e.to_string()))?;
        if let Value::Object(states) = states {
            for (name, state) in states {
                attributes[name] = state;
            }
        }
        Ok(())
    }
}

/// Returns the values of the guards alone, which a warm-up saves too; none if there are none.
///
/// # Errors
/// If the values are malformed, [`Error::Io`].
pub(super) fn saved_guards(attributes: &Value) -> Result<Option<guards::GuardState>, Error> {
    match &attributes["guards"] {
        Value::Null => Ok(None),
        saved => guards::GuardState::deserialize(saved)
            .map(Some)
            .map_err(|error| {
                Error::Io(format!(
                    "the saved state of the guards cannot be used: {error}"
                ))
            }),
    }
}
