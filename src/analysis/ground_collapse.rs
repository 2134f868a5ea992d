//! Collapse of ground over seepage points: measured quantities, stages, and clusters of loosened grains.
//!
//! Water drags grains out through seepage points. A hole grows, an arch forms over it for a while, the surface sinks,
//! and the depression extends along the fissure. Each step of the analysis is one file:
//!
//! | file | content |
//! |---|---|
//! | [`measure`] | volume of the voids, height of the moving ground, settlement of the surface |
//! | [`stages`] | times at which hole, arch, sinkhole and extension begin |
//! | [`clusters`] | clusters of bonded grains that have loosened |
//! | [`record`] | records of a run |
//! | `figures` | figures |
//!
//! # Quantities
//!
//! The analysis has its own frame: the first axis is the long horizontal one, the second the other horizontal one, the
//! third points up. The box is divided into cells with edges of about two mean diameters. A smaller cell would count
//! pores as voids, a larger one would miss a hole of a few grains.
//!
//! - **Ground** is every cell with a solid fraction of at least [`measure::GROUND`] at time 0. Air above, rock at
//!   the sides and the opening below are not ground.
//! - **Void** is a cell of the ground with less than `void_below` of its initial solid. The void of a point is the set
//!   of void cells that are connected through faces to the cells at its box. Its volume is the volume of the missing
//!   soil: lost solid over the packing, the median solid fraction of the ground at time 0, so that a cell half in rock
//!   counts half.
//! - **Arch height** is the height of the top of that void above the lowest ground at the point.
//! - **Front**: layer by layer upward from the point, over its footprint, the ground moves as long as its mean downward
//!   displacement exceeds a threshold or the layer is empty. The front is the height of the highest moving layer, as a
//!   fraction of the cover. Its *shape* is the moving length of the long section in the upper half below the front over
//!   that in the lower half, each part of the length by the moving part of its width: 1/3 for a triangle with its apex
//!   up, 1 for a rectangle, in a slot and in a V alike.
//! - **Surface**: the elevation of a column is the top of the highest grain with its centre in the column that has
//!   two other grains within half a mean diameter. A single grain in flight is therefore ignored, while soil that
//!   falls as a mass is included. If no grain remains, the elevation is that of the lowest ground of the column at
//!   time 0.
//! - **Settlement** of a column is the smaller of two values: the decrease of its elevation, and the downward
//!   displacement of the grains that formed its surface at time 0 (the median of the three highest). A large grain that
//!   rolls off its column lowers the elevation but does not displace its neighbours; grains that sink with the ground
//!   do both. If all of these grains have left, the settlement is the decrease of the elevation.
//! - **Extension** is the length along the long axis over which any column has settled by the threshold of the
//!   sinkhole.
//! - **Inward** is the mean displacement, towards the nearest point along the long axis, of the grains that at time 0
//!   were at the sides of the points, at a distance of at most the thickness of their cover: about the wedge that can
//!   slide in.
//!
//! # Stages
//!
//! - **t1 hidden hole** begins when n grains have left through one point, or its void has the volume of a cell. Single
//!   grains in the opening leave in any case.
//! - **t2 arch** begins when over a point with a void of the volume of a cell the front reaches half of the cover,
//!   while the surface has not sunk as at t3. The ground above the void moves as a whole, the surface does not yet.
//! - **t3 sinkhole** begins when a column of the surface over a point, or two neighbouring ones elsewhere, have settled
//!   by a mean diameter (elevation and own grains). Smaller values are the settling of grains into pores; away from the
//!   points a single column is a loose grain.
//! - **t4 extension** begins when the longest depression is 1.5 times the length or width of the sinkhole at t3, and
//!   the adjacent soil moves in. The depression grows along the fissure and not around the hole.
//!
//! A stage begins at the first of three consecutive samples that meet its criterion, and only once. t1 and t3 do
//! not depend on each other. t2 requires a void and a stationary surface: ground that sinks as a whole has no arch.
//! t4 requires t3, because it compares lengths. The shapes of the front at t2 and t3 are written with the times.
//! All thresholds are fields of the case.
//!
//! # Reproducibility
//!
//! All quantities are functions of the list of all grains in ascending order of id. They are evaluated on one
//! rank.

pub mod clusters;
pub mod measure;
pub mod record;
pub mod stages;
