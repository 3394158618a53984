//! Emulated controller: as a program, with the plugin, and at the edge of its range.

mod attacks;
mod boundary;
mod emulator;
mod flight;
mod machine;
