//! Populations: collide, stream, moments.
