//! Free body: a ball without weight that handles push, each with an elastic contact.
//!
//! ```text
//! F_i = k max(0, R - |h_i - c|) (h_i - c) / |h_i - c|,      m c'' = - sum F_i
//! ```
//!
//! with handles `h_i` and the centre `c` of the ball. The symplectic Euler method takes steps of at most a thirtieth of the
//! shortest period; the force of a tick is the mean over its steps, so that the impulse on the hands is the momentum that the
//! ball gives, tick by tick.

use flotor_hal::{DVec3, MAX_PORTS, restorable};

/// Largest product of step and highest angular frequency.
const STEP_RAD: f64 = 0.2;

/// Ball without weight, with the last place of the handle at each port.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeBody {
    mass_kg: f64,
    radius_m: f64,
    stiffness_n_per_m: f64,
    centre_m: DVec3,
    velocity_m_per_s: DVec3,
    /// Last place of each handle; `None` before the first tick, and of a handle without a valid pose.
    handles_m: [Option<DVec3>; MAX_PORTS],
}

restorable!(FreeBody { centre_m, velocity_m_per_s, handles_m } without { mass_kg, radius_m, stiffness_n_per_m });

/// Contact of the ball with a handle in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Push {
    /// Mean force on the handle, N.
    pub force_n: DVec3,
    /// Energy in the contact at the end of the tick, J.
    pub energy_j: f64,
}

impl FreeBody {
    /// Creates a ball at rest, with its top at home. Mass and stiffness are above 0.
    #[must_use]
    pub fn new(mass_kg: f64, radius_m: f64, stiffness_n_per_m: f64) -> Self {
        Self {
            mass_kg,
            radius_m,
            stiffness_n_per_m,
            centre_m: DVec3::Z * -radius_m,
            velocity_m_per_s: DVec3::ZERO,
            handles_m: [None; MAX_PORTS],
        }
    }

    /// Returns the centre of the ball, m.
    #[must_use]
    pub fn centre_m(&self) -> DVec3 {
        self.centre_m
    }

    /// Returns the radius of the ball, m.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Returns the mass of the ball, kg.
    #[must_use]
    pub fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// Returns the stiffness of the contacts, N/m.
    #[must_use]
    pub fn stiffness_n_per_m(&self) -> f64 {
        self.stiffness_n_per_m
    }

    /// Returns the momentum of the ball, kg·m/s.
    #[must_use]
    pub fn momentum(&self) -> DVec3 {
        self.velocity_m_per_s * self.mass_kg
    }

    /// Returns the kinetic energy of the ball, J. Real-time: bounded, no allocation.
    #[must_use]
    pub fn kinetic_j(&self) -> f64 {
        0.5 * self.mass_kg * self.velocity_m_per_s.length_squared()
    }

    /// Sets the stiffness of the contacts, N/m.
    pub fn set_stiffness(&mut self, stiffness_n_per_m: f64) {
        self.stiffness_n_per_m = stiffness_n_per_m;
    }

    /// Puts the ball back to its place at the start, at rest.
    pub fn reset(&mut self) {
        *self = Self::new(self.mass_kg, self.radius_m, self.stiffness_n_per_m);
    }

    /// Advances the ball by `duration_s`, finite, while each handle moves to its place at constant speed; `None`: the handle of this
    /// port touches nothing. Returns the contact at each port. Real-time: bounded by the duration, no allocation.
    pub fn advance(&mut self, handles_m: &[Option<DVec3>], duration_s: f64) -> [Push; MAX_PORTS] {
        let mut pushes = [Push::default(); MAX_PORTS];
        let fastest_per_s = (self.stiffness_n_per_m * handles_m.len() as f64 / self.mass_kg).sqrt();
        let steps = (duration_s * fastest_per_s / STEP_RAD).ceil().max(1.0);
        let step_s = duration_s / steps;
        for step in (1..).map(f64::from).take_while(|step: &f64| *step <= steps) {
            let mut sum_n = DVec3::ZERO;
            for ((push, from_m), to_m) in pushes.iter_mut().zip(self.handles_m).zip(handles_m) {
                let Some(to_m) = *to_m else { continue };
                let handle_m = from_m.unwrap_or(to_m).lerp(to_m, step / steps);
                let contact = self.contact(handle_m);
                push.force_n += contact.force_n / steps;
                sum_n += contact.force_n;
            }
            self.velocity_m_per_s -= sum_n * (step_s / self.mass_kg);
            self.centre_m += self.velocity_m_per_s * step_s;
        }
        self.handles_m.iter_mut().zip(handles_m).for_each(|(last_m, handle_m)| *last_m = *handle_m);
        for (push, handle_m) in pushes.iter_mut().zip(handles_m) {
            push.energy_j = handle_m.map_or(0.0, |handle_m| self.contact(handle_m).energy_j);
        }
        pushes
    }

    /// Returns force and energy of the contact with a handle now.
    fn contact(&self, handle_m: DVec3) -> Push {
        let outward_m = handle_m - self.centre_m;
        let distance_m = outward_m.length();
        let depth_m = self.radius_m - distance_m;
        // A handle at the very centre has no direction, and NaN is not a depth.
        if !(depth_m > 0.0 && distance_m > 0.0) {
            return Push::default();
        }
        let force_n = outward_m * (self.stiffness_n_per_m * depth_m / distance_m);
        Push { force_n, energy_j: 0.5 * self.stiffness_n_per_m * depth_m * depth_m }
    }
}
