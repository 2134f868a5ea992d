//! Networks against closed solutions.

mod closed;
mod moving;
mod squeeze;
mod steady;
