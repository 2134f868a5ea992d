//! Contact law of a case; its parameters are defined with its formula in [`dem::contact`].

pub use dem::contact::Contact;
