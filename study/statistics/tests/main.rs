//! Every result against published tables.

mod certified;
mod ranks;
mod reference;
