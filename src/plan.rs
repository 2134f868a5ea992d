//! Which models the scene needs, and why.
