//! Stiff wall: the textbook model of haptics, and the smallest complete example of a force model.
//!
//! A *proxy* stays on the surface while the handle is inside; a spring pulls the handle towards it. Without friction
//! the proxy is the position that the handle would have if it could not penetrate (the god-object of Zilles and
//! Salisbury 1995, IROS, 146-151). With friction the proxy sticks until the tangential force leaves Coulomb's cone,
//! then slides back onto the cone.
//!
//! ```text
//! F = F_n n + K t,    F_n = max(K d - B v_n, 0),    K |t| <= mu F_n
//! ```
//!
//! with depth `d` and displacement `t` of the proxy from the handle, along and across the outward normal `n`.
//!
//! - [`surface`]: stiffness, damping, friction.
//! - [`shape`]: plane, sphere, box: normals, and sliding on the surface.
//! - [`proxy`]: contact, stick and slip.
//! - `plugin`: parameters and the contract.

mod plugin;
pub mod proxy;
pub mod shape;
pub mod surface;

pub use plugin::{FLOTOR_ENTRY, Wall};
