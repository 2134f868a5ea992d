//! Networks compared with closed-form solutions.

mod closed;
mod large;
mod loads;
mod moving;
mod squeeze;
mod steady;
mod takeover;
