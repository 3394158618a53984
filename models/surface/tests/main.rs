//! The surface against closed forms and exhaustive searches.
#![allow(missing_docs, clippy::cast_possible_truncation)]

mod contact;
mod files;
mod shapes;
mod smooth;
