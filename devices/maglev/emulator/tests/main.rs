//! The emulated controller: as a program, as a plant, and at the edge of its range.

mod attacks;
mod boundary;
mod emulator;
mod flight;
mod machine;
