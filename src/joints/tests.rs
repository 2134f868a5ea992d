//! Networks compared with closed-form solutions.

mod closed;
mod moving;
mod squeeze;
mod steady;
