//! Families of models: common parts, and the list macro of the families of the seepage.
//!
//! One list of a family generates the enum of the case, its schema, and the dispatch to the model. Drag laws,
//! permeabilities and porosity methods use the macro of this file. Contact laws, collision operators, eddy viscosities,
//! boundaries, solid operators and shapes of structures have list macros of their own, next to the lists.
//! [`Description`] and `describe_choices` are shared by the families of the lattice and of structures.
//!
//! A model in the macro of this file is a type that implements the trait of its family, such as
//! `darcy::drag::DragFormula`. A model without parameters is a unit struct and appears in a case as its name; a
//! model with parameters is a struct of the same name, whose fields appear in the case below the name.
//!
//! ```text
//! family! {
//!     /// The drag law.
//!     pub enum DragLaw: DragFormula {
//!         #[default]
//!         DiFelice,               "drag": "di_felice"
//!         Toy(Toy),               "drag": {"toy": {"viscosity": 1e-3}}
//!     }
//! }
//! ```
//!
//! The trait has a function `summary`: the line of the model in the schema. `DragLaw::model` gives the model as a trait
//! object. Loops over cells or grains are provided methods of the trait: they are compiled for each model, and the
//! model is selected once, outside of the loop.

use schemars::Schema;
use serde_json::Value;

/// Model and the reason for its choice, as `plan` prints them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Description {
    /// Name of the model with its parameters.
    pub model: String,
    /// Reason for the choice of this model, or its effect.
    pub reason: String,
}

impl Description {
    /// Returns a description from two texts.
    pub fn new(model: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            model: model.into(),
            reason: reason.into(),
        }
    }
}

/// Defines the enum of a family of models from its list; see the module.
#[macro_export]
macro_rules! model_family {
    (
        $(#[$attribute:meta])*
        $visibility:vis enum $family:ident: $law:path {
            $( $(#[$mark:meta])* $model:ident $(($parameters:ident))? ),+ $(,)?
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(rename_all = "snake_case", deny_unknown_fields)]
        #[schemars(inline)]
        $visibility enum $family {
            $(
                $(#[$mark])*
                #[doc = concat!("The model [`struct@", stringify!($model), "`].")]
                #[schemars(description = <$model as $law>::summary())]
                $model $(($parameters))?
            ),+
        }

        impl $family {
            /// Returns the selected model.
            #[must_use]
            $visibility fn model(&self) -> &dyn $law {
                match self {
                    $( $crate::model_family!(@pattern $model $($parameters)? => model)
                        => $crate::model_family!(@value $model $($parameters)? => model) ),+
                }
            }
        }
    };
    (@pattern $model:ident => $bound:ident) => { Self::$model };
    (@pattern $model:ident $parameters:ident => $bound:ident) => { Self::$model($bound) };
    (@value $model:ident => $bound:ident) => { &$model };
    (@value $model:ident $parameters:ident => $bound:ident) => { $bound };
}

pub use model_family as family;

/// Sets the description of each choice of a schema to the documentation of its model: an object with one field
/// takes the description of that field.
pub fn describe_choices(schema: &mut Schema) {
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
