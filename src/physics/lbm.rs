//! Lattice Boltzmann: populations, collision, streaming, boundaries, moments.
//!
//! All quantities are in lattice units: cells, steps, deviations of the density from one. A step is one fused collide-and-stream pass
//! ([`kernel`]), the exchange of the populations that leave the slab, and the boundary conditions ([`boundary`]). The module
//! [`crate::coupling`] handles moving bodies, through [`populations::Link`] or through the cells that they cover ([`saturation`]).

pub mod boundary;
pub mod collision;
pub mod extremes;
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
