//! Networks against closed solutions.

mod closed;
mod squeeze;
mod steady;
