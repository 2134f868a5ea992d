//! Networks against closed solutions.

mod closed;
mod large;
mod moving;
mod squeeze;
mod steady;
