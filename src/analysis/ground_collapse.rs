//! Ground that collapses over a hidden hole: what is measured, when a stage has begun, in what clusters grains come loose.
//!
//! Water drags grains out through seepage points; a hole grows, an arch stands over it for a while, the surface gives way,
//! and the depression grows along the fissure. Each step from a run to these claims is one file:
//!
//! | file | question |
//! |---|---|
//! | [`measure`] | how large are the voids, how far up does the ground move, how far has the surface settled |
//! | [`stages`] | when did hole, arch, sinkhole and extension begin |
//! | [`clusters`] | in what clusters of bonded grains does the ground come loose |
//! | [`record`] | what does a run write down |
//! | [`crate::figures`] | what does it look like |
//!
//! # The measures
//!
//! Everything is in a frame of its own: the first axis is the long horizontal one, the second the other horizontal one, the
//! third points up. The box is cut into cells with edges of about two mean diameters: a smaller cell takes a pore for a
//! void, a larger one hides a hole of a few grains.
//!
//! - **Ground** is every cell that held at least [`measure::GROUND`] of solid at time 0; so air above, rock beside and the
//!   opening below never count.
//! - **Void** is a cell of the ground with less than `void_below` of its initial solid left. The void of a point is what is
//!   connected through faces of void cells with the cells at its box. Its volume is the soil that is missing there: lost solid
//!   over the packing, the median of the solid fractions of the ground at time 0, so that a cell half in rock counts half.
//! - **Arch height** is how far the top of that void is above the lowest ground at the point.
//! - **Front.** From the point up, layer by layer over its footprint, the ground moves as long as the mean of its downward
//!   displacement exceeds a threshold, or the layer is empty; the front is how far up that goes, as part of the cover. Its *shape* is
//!   the number of moving cells in the upper half below the front over that in the lower half: 1/3 for a triangle with its apex
//!   up, 1 for a rectangle, which makes the triangular shape of the front measurable.
//! - **Surface.** The elevation of a column is the top of the highest grain with its centre in it that has two others within half a
//!   mean diameter: a grain in flight is no ground, soil that falls together is. Where nothing is left it is the lowest
//!   ground the column had.
//! - **Settlement** of a column is how far its elevation has fallen or how far the grains that were its surface at time 0 have gone
//!   down, the middle one of the three highest, whichever is less. A large grain that rolls off its column lowers the elevation
//!   by its own size and more while those beside it stay; grains that sink with the ground do both. Where all of them have left it
//!   is the fall of the elevation.
//! - **Extension** is the length along the long axis over which any column has settled by the threshold of the sinkhole.
//! - **Inward** is the mean displacement, towards the nearest point along the long axis, of the grains that at time 0 were beside the
//!   points and no further from them than their cover is thick: about the wedge that can slide in.
//!
//! # The stages
//!
//! | | begins when | because |
//! |---|---|---|
//! | t1 hidden hole | n grains have left through one point, or its void has the volume of a cell | single grains in the opening leave in any case |
//! | t2 arch | the front over one point reaches half of its cover | the ground above the void moves as one, and the surface does not yet |
//! | t3 sinkhole | a column of the surface has settled by a mean diameter: its elevation and its own grains | less is the settling of grains into pores |
//! | t4 extension | the longest depression is 1.5 times as long as the sinkhole was long or wide at t3, and the soil beside moves in | it grows along the fissure and not round the hole |
//!
//! A stage begins at the first of three samples in a row that show it, and once. The stages look at different things and not at each
//! other, so that their order is a result; only t4 needs t3, whose length it compares with. All thresholds are fields of the case.
//!
//! # The same bits
//!
//! Everything here is a function of the list of all grains in rising order of id. It is evaluated on one rank.

pub mod clusters;
pub mod measure;
pub mod record;
pub mod stages;
