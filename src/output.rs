//! Which fields and series, when, in SI.
