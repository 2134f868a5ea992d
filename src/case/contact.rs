//! The contact law of a case: its parameters are defined with its formula in [`crate::dem::contact`].

pub use crate::dem::contact::Contact;
