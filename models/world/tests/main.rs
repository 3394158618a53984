//! Tests of the world as a library: motions of bodies, and their forces on the tool.

mod laws;
