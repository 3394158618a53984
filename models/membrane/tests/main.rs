//! The membrane as a library: at rest and in motion.

mod exporters;
mod hands;
mod motion;
#[allow(unreachable_pub)] // shared with the other tests
#[path = "../../../tests/src/printed.rs"]
mod printed;
mod statics;
