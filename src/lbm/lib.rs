//! Lattice Boltzmann: populations, collision, streaming, boundaries, moments.
//!
//! All quantities are in lattice units: cells, steps, deviations of the density from one. [`fluid::Fluid::advance`] is
//! the step: one fused collide-and-stream pass ([`kernel`]), the exchange of the populations that leave the slab
//! ([`halo`]), and the boundary conditions ([`boundary`]). The package `coupling` handles moving bodies,
//! through [`populations::Link`] or through the cells that they cover ([`saturation`]).
//!
//! | file | content |
//! |---|---|
//! | `fluid` | one slab of fluid: the step, its state, wall surfaces for the eddy-viscosity model |
//! | `kernel` | the fused pass over the rows of a slab |
//! | `gpu` | the pass and the walls on a GPU, with the same operators |
//! | `populations`, `pages` | the populations of a slab and their addresses; their memory |
//! | `halo` | populations that leave a slab |
//! | `initial` | populations from density and velocity at the start |
//! | `lattice` | velocity sets |
//! | `lanes`, `single` | numbers and vectors of numbers in the pass: in f64, and in f32 |
//! | `vectors` | operations of the vector registers of x86-64, one list for both |
//! | `collision` | collision operators, one file each |
//! | `turbulence` | eddy viscosities, one file each, and the velocities from which they are computed |
//! | `boundary` | boundaries, one file each, with their parameters in a case |
//! | `surface` | free surface of water: kinds of cells, exchange of mass, conversions |
//! | `synthetic` | synthetic turbulence of inlets and initial flows |
//! | `links` | bounce-back on links that cross the surface of a body or of a structure |
//! | `feet` | momentum that solids receive at links through faces next to them |
//! | `rigid` | the motion of a body |
//! | `saturation` | partially saturated cells, solid collision operators |
//! | `term` | all terms that act on the populations in a step; porous zones |
//! | `error` | reasons why a fluid cannot be made or continued |
//! | `extremes` | largest speed and compression of each row |
//! | `quanta` | sums that are independent of the order |

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

pub mod block;
pub mod boundary;
pub mod collision;
pub mod error;
pub mod extremes;
pub mod feet;
pub mod fluid;
pub mod gpu;
pub mod halo;
pub mod initial;
pub mod instances;
pub mod kernel;
pub mod lanes;
pub mod lattice;
pub mod links;
mod pages;
pub mod populations;
pub mod quanta;
pub mod rigid;
pub mod saturation;
mod single;
pub mod surface;
pub mod synthetic;
pub mod term;
pub mod turbulence;
#[cfg(target_arch = "x86_64")]
mod vectors;
