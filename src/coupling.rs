//! A fluid together with its action on grains.
