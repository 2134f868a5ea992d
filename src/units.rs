//! SI to lattice units and back: the only conversions.
