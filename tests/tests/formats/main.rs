//! What other languages and other people's sources read is what the sources say. With the tools that make it, which take long to build:
//! `cargo test -p flotor-tests --features formats`.

mod header;
mod public_api;
mod recording_schema;
