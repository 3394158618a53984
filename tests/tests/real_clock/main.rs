//! What depends on the machine's clock: in a program of its own, so that nothing else runs beside it.

mod end_of_run;
mod jitter;
