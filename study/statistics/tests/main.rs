//! Every result against published tables.

mod certified;
mod reference;
