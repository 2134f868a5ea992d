//! The contact law of a case: its parameters stand beside its formula in [`crate::dem::contact`].

pub use crate::dem::contact::Contact;
