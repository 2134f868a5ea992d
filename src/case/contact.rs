//! The contact law of a case: its parameters stand beside its formula in [`dem::contact`].

pub use dem::contact::Contact;
