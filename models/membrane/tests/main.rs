//! The membrane as a library: at rest and in motion.

mod motion;
mod statics;
