#![doc = include_str!("ARCHITECTURE.md")]

pub mod analysis;
pub mod case;
pub mod checkpoint;
pub mod cli;
pub mod coupling;
pub mod dem;
pub mod error;
pub mod lbm;
pub mod output;
pub mod plan;
pub mod random;
pub mod scene;
pub mod simulation;
pub mod units;
