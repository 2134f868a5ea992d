//! Ranks, slabs, halos, migration and exact sums.
