//! State to named arrays and back.
