//! Timing of an asynchronous model, and the limits of its contacts at its device.

use crate::limits::{Bound, Limits};
use flotor_hal::{Capabilities, Damper, SampledLoop};

/// Rate and latency of the answers of an asynchronous model, and the limits of its contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldTiming {
    /// Rate of new answers, Hz.
    pub rate_hz: f64,
    /// Time from the sample of the handle to the answer computed from it, s. Exact on the virtual clock; on the real
    /// clock, the computing time of the model.
    pub latency_s: f64,
    /// Limits of contacts.
    pub contacts: ContactLimits,
}

/// Largest stiffness of contacts that stays stable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StiffnessCap {
    /// Stiffness that the device declares, N/m; infinite if it declares none.
    pub stiffness_n_per_m: f64,
    /// Stiffness that the damping of the device keeps stable, N/m; 0: its damping is not known, and contacts without damping are not
    /// reduced.
    pub by_device_n_per_m: f64,
    /// Additional stiffness for the damping of a contact, 1/s.
    pub per_damping_1_per_s: f64,
}

impl StiffnessCap {
    /// Cap of an unknown device: no reduction.
    pub const UNKNOWN: Self =
        Self { stiffness_n_per_m: f64::INFINITY, by_device_n_per_m: 0.0, per_damping_1_per_s: f64::INFINITY };

    /// Returns the cap on a device with the damping `damping_ns_per_m`, 0 if it is not known. Not real-time.
    #[must_use]
    pub fn on(device: &Capabilities, damping_ns_per_m: f64, period_s: f64) -> Self {
        let declared = device.max_stiffness_n_per_m;
        let sampled = SampledLoop { period_s, latency_s: device.latency_s };
        Self {
            stiffness_n_per_m: if declared > 0.0 { declared } else { f64::INFINITY },
            by_device_n_per_m: sampled.largest_stiffness(damping_ns_per_m, Damper::OneWay(0.0)),
            per_damping_1_per_s: sampled.largest_stiffness(0.0, Damper::OneWay(1.0)),
        }
    }
}

/// Limits of contacts, all of them at the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLimits {
    /// Largest stiffness; `None`: the scene has switched the cap off.
    pub cap: Option<StiffnessCap>,
    /// Largest power with which the declared motion of a surface counts, W for each contact.
    pub surface_power_w: f64,
    /// Largest magnitude of the force of all contacts, N.
    pub force_n: f64,
    /// Largest magnitude of the torque of all contacts, N·m; 0 on a device without torque.
    pub torque_nm: f64,
}

impl ContactLimits {
    /// Limits of an unknown device.
    pub const UNKNOWN: Self = Self {
        cap: Some(StiffnessCap::UNKNOWN),
        surface_power_w: 1.0,
        force_n: f64::INFINITY,
        torque_nm: f64::INFINITY,
    };

    /// Returns the limits on a device whose damping is `damping_ns_per_m`, 0 if it is not known, with the limits of a scene. Not
    /// real-time.
    #[must_use]
    pub fn on(self, device: &Capabilities, damping_ns_per_m: f64, limits: &Limits, period_s: f64) -> Self {
        // The envelope shortens a wrench too. Here the largest magnitude counts that it never shortens.
        let least = |limit: Bound, axes: [f64; 3]| {
            let driven = axes.into_iter().filter(|most| *most > 0.0).fold(f64::INFINITY, f64::min);
            limit.axes().into_iter().filter(|most| *most > 0.0).fold(driven, f64::min)
        };
        let has = |axes: [f64; 3]| axes.iter().any(|most| *most > 0.0);
        let Capabilities { max_force_n, max_torque_nm, .. } = *device;
        Self {
            cap: self.cap.map(|_| StiffnessCap::on(device, damping_ns_per_m, period_s)),
            force_n: least(limits.force_n, max_force_n),
            torque_nm: if has(max_torque_nm) { least(limits.torque_nm, max_torque_nm) } else { 0.0 },
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::Axes;

    const DEVICE: Capabilities = Capabilities {
        max_force_n: [5.0, 0.0, 3.0],
        max_stiffness_n_per_m: 900.0,
        latency_s: 0.5e-3,
        ..Capabilities::driving(Axes::ALL)
    };

    #[test]
    fn the_cap_is_the_one_rule_and_what_the_device_declares() {
        let limits = ContactLimits::UNKNOWN.on(&DEVICE, 2.0, &Limits::default(), 1.0e-3);
        // Half of b over half a period and the latency, where of a wall's damper half counts.
        assert_eq!(
            limits.cap,
            Some(StiffnessCap {
                stiffness_n_per_m: 900.0,
                by_device_n_per_m: 1000.0,
                per_damping_1_per_s: 250.0
            })
        );
        assert_eq!((limits.force_n, limits.torque_nm), (3.0, 0.0));
        let off = ContactLimits { cap: None, ..ContactLimits::UNKNOWN };
        assert_eq!(off.on(&DEVICE, 2.0, &Limits::default(), 1.0e-3).cap, None);
    }

    #[test]
    fn the_limit_of_a_scene_counts_where_it_is_less() {
        let scene = Limits { force_n: Bound::ball(2.0), ..Limits::default() };
        assert_eq!(ContactLimits::UNKNOWN.on(&DEVICE, 0.0, &scene, 1.0e-3).force_n, 2.0);
    }
}
