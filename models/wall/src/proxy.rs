//! Contact, stick and slip: the proxy on the surface, and the spring between proxy and handle.

use crate::shape::{Place, Shape};
use crate::surface::Surface;
use flotor_hal::{DVec3, restorable};

/// Force on the handle, with the energy of the spring.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactForce {
    /// Force on the handle, N.
    pub force_n: DVec3,
    /// Energy in the spring, J.
    pub energy_j: f64,
}

/// Proxy of one handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proxy {
    contact: Option<Place>,
    /// Last position of the handle outside, m.
    outside_m: DVec3,
}

restorable!(Proxy { contact, outside_m });

impl Default for Proxy {
    /// Creates a proxy of a handle that comes from above.
    fn default() -> Self {
        Self { contact: None, outside_m: DVec3::Z }
    }
}

impl Proxy {
    /// Returns the place of the proxy on the surface; `None` while the handle is outside. Real-time: bounded, no allocation.
    #[must_use]
    pub fn contact(&self) -> Option<Place> {
        self.contact
    }

    /// Moves the proxy for a handle at `handle_m` (finite, from the top of the solid) with `velocity_m_per_s`; returns the force
    /// on the handle and the energy of the spring, zero while the handle is outside. Real-time: bounded, no allocation.
    pub fn follow(
        &mut self,
        shape: &Shape,
        surface: &Surface,
        handle_m: DVec3,
        velocity_m_per_s: DVec3,
    ) -> ContactForce {
        if !shape.contains(handle_m) {
            *self = Self { contact: None, outside_m: handle_m };
            return ContactForce::default();
        }
        let before = self.contact.unwrap_or_else(|| shape.entry(self.outside_m, handle_m));
        let proxy = shape.slide(&before, surface, handle_m, velocity_m_per_s);
        self.contact = Some(proxy);

        let stretch_m = proxy.point_m - handle_m;
        let depth_m = stretch_m.dot(proxy.normal);
        let along_m = stretch_m - proxy.normal * depth_m;
        let normal_n = surface.normal_force_n(depth_m, velocity_m_per_s.dot(proxy.normal));
        ContactForce {
            force_n: proxy.normal * normal_n + along_m * surface.stiffness_n_per_m,
            energy_j: 0.5 * surface.stiffness_n_per_m * stretch_m.length_squared(),
        }
    }
}
