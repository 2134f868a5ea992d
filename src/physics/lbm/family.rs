//! Common parts of the model families: the description of a model for `plan`, and the schema of a list of models.

/// A model and why it is there, as `plan` prints them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Description {
    /// The model with its parameters.
    pub model: String,
    /// Why this model is used, or what it does.
    pub reason: String,
}

impl Description {
    /// A description of two texts.
    pub fn new(model: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            model: model.into(),
            reason: reason.into(),
        }
    }
}

pub(crate) use crate::family::describe_choices;
