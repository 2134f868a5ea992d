//! Lattice Boltzmann: populations, collide, stream, boundaries, moments.
//!
//! Everything here is in lattice units: cells, steps, deviations of density from one. A step is one fused
//! collide-and-stream pass ([`kernel`]), the exchange of the populations that leave the slab, and the boundary rules
//! ([`boundary`]). Moving bodies are the coupling's business; it meets the lattice through [`populations::Link`], or through the cells
//! that they cover ([`saturation`]).

pub mod boundary;
pub mod collision;
pub mod extremes;
pub mod family;
pub mod fluid;
pub mod halo;
pub mod initial;
pub mod kernel;
pub mod lanes;
pub mod lattice;
pub mod links;
mod pages;
pub mod populations;
pub mod quanta;
pub mod saturation;
pub mod synthetic;
pub mod turbulence;
