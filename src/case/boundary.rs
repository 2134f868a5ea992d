//! Conditions of the fluid on the faces of the domain.

use super::geometry::{Extent, Face};
use lbm::boundary::Condition;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A condition on a face or on a part of it. A condition on a part takes precedence over the condition of the whole
/// face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Boundary {
    /// Name in tables and outputs.
    pub name: String,
    /// Face of the domain.
    pub face: Face,
    /// Box that selects a part of the face [m]; its extent normal to the face has no effect. Default: the whole face.
    #[serde(default)]
    pub patch: Option<Extent>,
    /// Condition of the fluid on the face.
    pub condition: Condition,
}
