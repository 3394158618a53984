//! The surface against closed forms and exhaustive searches.
#![allow(missing_docs, clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]
#![allow(clippy::unwrap_used)] // text into memory

mod contact;
mod edges;
mod exhaustive;
mod files;
mod search;
mod shapes;
mod smooth;
mod walls;
