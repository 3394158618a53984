//! Contact, stick and slip: the proxy on the surface, and the pull between it and the handle.

use crate::shape::{Place, Shape};
use flotor_hal::DVec3;

/// How hard the surface is and how rough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Stiffness `K`, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping `B` of a movement along the normal, while in contact, N s/m.
    pub damping_ns_per_m: f64,
    /// Coefficient of friction `mu`.
    pub friction: f64,
}

/// What is felt.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pull {
    /// On the handle, N.
    pub force_n: DVec3,
    /// In the spring, J.
    pub energy_j: f64,
}

/// The proxy of one handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proxy {
    contact: Option<Place>,
    /// Where the handle was last outside, m.
    outside_m: DVec3,
}

impl Default for Proxy {
    /// Coming from above.
    fn default() -> Self {
        Self { contact: None, outside_m: DVec3::Z }
    }
}

impl Proxy {
    /// Where it is on the surface; `None` while the handle is outside. Real-time: bounded, no allocation.
    #[must_use]
    pub fn contact(&self) -> Option<Place> {
        self.contact
    }

    /// Follows the handle to `handle_m` (finite), moving at `velocity_m_per_s`. Real-time: bounded, no allocation.
    pub fn follow(
        &mut self,
        shape: &Shape,
        surface: &Surface,
        handle_m: DVec3,
        velocity_m_per_s: DVec3,
    ) -> Pull {
        if !shape.contains(handle_m) {
            *self = Self { contact: None, outside_m: handle_m };
            return Pull::default();
        }
        let before = self.contact.unwrap_or_else(|| shape.entry(self.outside_m, handle_m));
        let proxy = shape.slide(&before, handle_m, surface.friction);
        self.contact = Some(proxy);

        let stretch_m = proxy.point_m - handle_m;
        let depth_m = stretch_m.dot(proxy.normal);
        let along_m = stretch_m - proxy.normal * depth_m;
        // A wall never pulls: where damping would, it is left out.
        let outwards_m_per_s = velocity_m_per_s.dot(proxy.normal);
        let normal_n =
            (surface.stiffness_n_per_m * depth_m - surface.damping_ns_per_m * outwards_m_per_s).max(0.0);
        let mut along_n = along_m * surface.stiffness_n_per_m;
        if normal_n < surface.stiffness_n_per_m * depth_m {
            // Damping relieves a handle that leaves; the cone is that of the force it feels.
            along_n = along_n.clamp_length_max(surface.friction * normal_n);
        }
        Pull {
            force_n: proxy.normal * normal_n + along_n,
            energy_j: 0.5 * surface.stiffness_n_per_m * stretch_m.length_squared(),
        }
    }
}
