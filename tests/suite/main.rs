//! Integration tests in one binary.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it could not do"
)]

mod architecture;
mod automatic;
mod bed;
mod bonded_start;
mod borders;
mod broken_on_ranks;
mod case_broken;
mod case_commands;
mod case_examples;
mod case_mutants;
mod circles;
mod claims;
mod collapse;
mod cuts;
mod dams;
mod dice;
mod drawings;
mod drives;
mod element_tests;
mod estimate;
mod excavations;
mod extremes;
mod floating;
mod folders;
mod free_surface;
mod gates;
mod graded;
mod guards;
mod hostile_checkpoints;
mod input_files;
mod jointed;
mod joints;
mod language;
mod layers;
mod leaving;
mod moist;
mod mutants;
mod openings;
mod piping;
mod porous;
mod probes;
mod proposals;
mod ranks;
mod same_bits;
mod seepage;
mod side_files;
mod slip_planes;
mod slopes;
mod speaking;
mod stopping;
mod structures;
mod surface_extremes;
mod surface_tension;
mod sweep;
mod terrain;
mod threshold;
mod tutorial;
mod unsaturated;
mod usage;
mod verification;
mod wide_joints;
