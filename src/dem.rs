//! Contacts, forces, motion.
