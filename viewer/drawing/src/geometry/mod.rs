//! Tessellation of the scene: wire along a centreline, primitives, surfaces, end plates, ground, arrows.
//!
//! Coordinates are in metres and `f64` until a vertex is written. Frames are right-handed with z up.

mod arrow;
mod body;
mod curve;
mod detail;
mod ground;
mod mesh;
mod primitive;
mod revolve;
mod strain;
mod surface_point;
mod tube;

#[cfg(test)]
mod tests;

pub use arrow::{force_arrow, torque_arrow};
pub use body::Body;
pub use curve::{Curve, Section};
pub use detail::Detail;
pub use ground::{Ground, Shadow};
pub use mesh::{Color, MM_PER_M, Mesh, Vertex};
pub use primitive::{append_primitive, append_surface};
pub use revolve::{Frame, plate, revolve};
pub use strain::{LocalStrain, Strain, contact_strain};
pub use surface_point::{SurfacePoint, closest_surface_point};
pub use tube::append_tube;
