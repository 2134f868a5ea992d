//! Numbers a user came for: the erosion law, closure of mass and momentum.
