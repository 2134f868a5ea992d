//! Families of models: the list macro that every family uses, and what descriptions of models have in common.
//!
//! One list generates the modules of the models, the enum from which a case or the program chooses, the names in a
//! case, and the dispatch to the model:
//!
//! ```text
//! family! {
//!     /// Eddy viscosity.
//!     #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
//!     #[serde(rename_all = "snake_case")]
//!     #[schemars(transform = family::describe_choices)]
//!     pub enum EddyViscosity {
//!         wale: Wale(Wale),                 "turbulence": {"wale": {"constant": 0.5}}
//!         smagorinsky: Smagorinsky(Smagorinsky),
//!     }
//! }
//! ```
//!
//! - A line `module: Model(Parameters)` declares the module, in which the type `Parameters` is; `module: Model` is a
//!   model without parameters, a unit struct of the same name. Lines without `module:` use types that are in scope.
//! - `enum Family: dyn Law` adds the function `model`, which returns the selected model as `&dyn Law`.
//! - `, summary` before the lines takes the texts of the schema from the function `summary` of the models. Without it,
//!   [`describe_choices`] takes them from the documentation of the parameters.
//! - `, from` before the lines makes the enum from each of its models, for models that a function selects.
//! - With modules, `name` returns the name in a case: that of the module, or the text of `module: Model(..) as "text"`.
//!
//! After the list, the macro `each!(choice, model => expression)` executes an expression with the selected model of
//! concrete type; a second list in scope begins with `dispatch each_name;`, the name of its macro. The functions of a
//! family are written with it. The expression is compiled for each model, so that loops over cells or grains, as
//! provided functions of the trait of a family or in the expression, contain no selection.
//!
//! The solid collision operators (`lbm::saturation`) have a list macro of their own: their file is a source of the GPU
//! kernels, which are compiled without serde and schemars, from this package only `ball` and `number`, and which are
//! stored with the hash of their sources.

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

/// Defines a family of models from its list; see the module.
#[macro_export]
macro_rules! model_family {
    (@family $each:ident
        $(#[$attribute:meta])*
        $visibility:vis enum $family:ident $(: $law:ty)? $(, $option:ident)? {
            $(
                $(#[$mark:meta])*
                $module:ident: $model:ident $(($parameters:ident))? $(as $name:literal)?
            ),+ $(,)?
        }
    ) => {
        $($visibility mod $module;)+

        $crate::model_family! { @with [$($option)?] $each
            [$(#[$attribute])*] $visibility $family [$($law)?]
            $( [$(#[$mark])* $(#[serde(rename = $name)])?] $model [$($module::$parameters)?] [$module::$model] )+
        }

        #[allow(dead_code, reason = "not every family needs its names")]
        impl $family {
            /// Returns the name in a case.
            #[must_use]
            $visibility fn name(&self) -> &'static str {
                match self {
                    $( Self::$model { .. } => $crate::model_family!(@name $module $($name)?), )+
                }
            }
        }
    };
    (@family $each:ident
        $(#[$attribute:meta])*
        $visibility:vis enum $family:ident $(: $law:ty)? $(, $option:ident)? {
            $( $(#[$mark:meta])* $model:ident $(($parameters:ty))? ),+ $(,)?
        }
    ) => {
        $crate::model_family! { @with [$($option)?] $each
            [$(#[$attribute])*] $visibility $family [$($law)?]
            $( [$(#[$mark])*] $model [$($parameters)?] [$model] )+
        }
    };

    // Texts of the schema from the models.
    (@with [summary] $each:ident $attributes:tt $visibility:vis $family:ident $law:tt
        $( [$($mark:tt)*] $model:ident $parameters:tt [$($path:tt)+] )+
    ) => {
        $crate::model_family! { @with [] $each $attributes $visibility $family $law
            $(
                [$($mark)* #[schemars(description = <$($path)+>::summary())]] $model $parameters [$($path)+]
            )+
        }
    };
    // The enum from its models.
    (@with [from] $each:ident $attributes:tt $visibility:vis $family:ident $law:tt
        $( $mark:tt $model:ident [$parameters:ty] $path:tt )+
    ) => {
        $crate::model_family! { @with [] $each $attributes $visibility $family $law
            $( $mark $model [$parameters] $path )+
        }

        $(
            impl From<$parameters> for $family {
                fn from(model: $parameters) -> Self {
                    Self::$model(model)
                }
            }
        )+
    };
    (@with [] $each:ident [$($attribute:tt)*] $visibility:vis $family:ident [$($law:ty)?]
        $( [$($mark:tt)*] $model:ident [$($parameters:ty)?] [$($path:tt)+] )+
    ) => {
        $($attribute)*
        $visibility enum $family {
            $(
                #[allow(missing_docs, reason = "the documentation of a model is in its file")]
                $($mark)*
                $model $(($parameters))?
            ),+
        }

        #[allow(unused_macros, reason = "not every family has functions of its own")]
        macro_rules! $each {
            ($choice:expr, $bound:ident => $run:expr) => {
                match $choice {
                    $(
                        $crate::model_family!(@pattern $family $model [$($parameters)?] $bound) =>
                            $crate::model_family!(@value [$($parameters)?] [$($path)+] $bound $run),
                    )+
                }
            };
        }

        $(
            #[allow(dead_code, reason = "not every list of a test needs its models")]
            impl $family {
                /// Returns the selected model.
                #[must_use]
                $visibility fn model(&self) -> &$law {
                    $each!(self, model => model)
                }
            }
        )?
    };

    (@name $module:ident) => { stringify!($module) };
    (@name $module:ident $name:literal) => { $name };
    (@pattern $family:ident $model:ident [] $bound:ident) => { $family::$model };
    (@pattern $family:ident $model:ident [$parameters:ty] $bound:ident) => { $family::$model($bound) };
    (@value [] [$($path:tt)+] $bound:ident $run:expr) => {{
        let $bound = &$($path)+;
        $run
    }};
    (@value [$parameters:ty] [$($path:tt)+] $bound:ident $run:expr) => { $run };

    (@$($other:tt)+) => { compile_error!("the list of this family has another form than those of `base::family`"); };
    (dispatch $each:ident; $($family:tt)+) => { $crate::model_family! { @family $each $($family)+ } };
    ($($family:tt)+) => { $crate::model_family! { @family each $($family)+ } };
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
