//! Drawing without a GPU: triangles of the 3D view ([`solid`]) and of the interface ([`flat`]).
//!
//! Slower than a GPU and always there; the same bits on every machine, which pictures in documents and tests want.

pub mod flat;
pub mod solid;
