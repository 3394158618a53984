//! The laws of the spring as a library: tables of higher precision, conservation, invariance, totality.

mod batch;
mod buckling;
mod coil;
mod conservation;
mod invariance;
mod laps;
mod loops;
mod oracle;
mod preset;
#[allow(unreachable_pub)] // shared with the other tests
#[path = "../../../tests/src/printed.rs"]
mod printed;
mod rod;
mod rod_blend;
mod sample;
mod seat;
#[path = "../../../tests/src/model_tables.rs"]
mod table;
mod thesis_vectors;
mod totality;
mod touching;
