//! Step and time of an output.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::fields::FileInfo;
use crate::hdf::{Attribute, Content};

/// Step and time of an output.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OutputTime {
    /// Step from the start of the simulation.
    pub step: u64,
    /// Time \[s\].
    pub time: f64,
}

impl OutputTime {
    pub(crate) fn describe(self, content: &mut Content) {
        content.folder(
            "/output",
            &[
                (
                    "step",
                    Attribute::Int(i64::try_from(self.step).unwrap_or(i64::MAX)),
                ),
                ("time", Attribute::Float(self.time)),
            ],
        );
    }

    pub(crate) fn read(info: &FileInfo, path: &Path) -> Result<Self> {
        let get = |name| info.attribute("/output", name);
        match (
            get("step").and_then(serde_json::Value::as_u64),
            get("time").and_then(serde_json::Value::as_f64),
        ) {
            (Some(step), Some(time)) => Ok(Self { step, time }),
            _ => Err(Error::corrupt(path, "does not contain its step and time")),
        }
    }
}
