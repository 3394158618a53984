//! The laws of the spring as a library: tables of higher precision, conservation, invariance, totality.

mod batch;
mod coil;
mod conservation;
mod invariance;
mod laps;
mod loops;
mod oracle;
mod rod;
mod rod_blend;
mod sample;
mod seat;
mod table;
mod thesis_vectors;
mod totality;
mod touching;
