//! The world as a library: what bodies do, and what the tool feels of them.

mod laws;
