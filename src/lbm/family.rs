//! Common parts of the model families: the description of a model for `plan`, and the schema of a list of models.

use schemars::Schema;
use serde_json::Value;

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

/// Describes each choice of a schema by the documentation of its model: an object with one field takes the description of that field.
pub(crate) fn describe_choices(schema: &mut Schema) {
    let choices = schema.get_mut("oneOf").and_then(Value::as_array_mut);
    for choice in choices.into_iter().flatten() {
        let fields = choice.get_mut("properties").and_then(Value::as_object_mut);
        let described = fields.and_then(|fields| {
            let mut fields = fields.values_mut().filter_map(Value::as_object_mut);
            fields.next()?.remove("description")
        });
        if let (Some(described), Some(choice)) = (described, choice.as_object_mut()) {
            choice.insert("description".into(), described);
        }
    }
}
