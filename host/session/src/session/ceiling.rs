//! Envelopes of the devices, and the ceiling of the host: the largest force and torque of a device that does not declare itself
//! simulated, unless the user allows more.

use super::prepare::Opened;
use crate::scene::Scene;
use flotor_core::limits::{Bound, CEILING, Ceiling, Limits};
use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_hal::{Axes, Capabilities, Embodiment};
use flotor_servo::{Envelope, Guarded};

/// Permitted force and torque of the devices of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strength {
    /// At most the host's [ceiling](CEILING), except for simulated devices.
    #[default]
    UnderCeiling,
    /// Up to the limits of scene and device, if the user permits this; a scene cannot give the permission.
    Strong,
}

/// Environment variable that permits strong devices if its value is 1.
const VARIABLE: &str = "FLOTOR_ALLOW_STRONG";

impl Strength {
    /// Reads the permission from the environment variable: `FLOTOR_ALLOW_STRONG=1` permits strong devices. Not real-time.
    #[must_use]
    pub fn of_the_environment() -> Self {
        if std::env::var(VARIABLE).as_deref() == Ok("1") { Self::Strong } else { Self::UnderCeiling }
    }
}

/// Physical device with force or torque limits, of scene and device together, above the ceiling.
#[derive(Clone, Debug, PartialEq)]
pub struct StrongDevice {
    /// Name in the scene.
    pub name: String,
    /// Id of the plugin.
    pub plugin: String,
    /// Largest force that scene and device allow in any direction, N.
    pub force_n: f64,
    /// Largest torque that scene and device allow about any axis, N·m.
    pub torque_nm: f64,
}

impl StrongDevice {
    /// Returns the entry of a physical device that could exceed the ceiling; `None` for any other device. Not real-time.
    fn of(
        [name, plugin]: [&str; 2],
        embodiment: Embodiment,
        limits: &Limits,
        device: &Capabilities,
    ) -> Option<Self> {
        let [force_n, torque_nm] = longest(limits, device);
        let exceeds = force_n > CEILING.force_n || torque_nm > CEILING.torque_nm;
        (embodiment == Embodiment::Physical && exceeds).then(|| Self {
            name: name.to_owned(),
            plugin: plugin.to_owned(),
            force_n,
            torque_nm,
        })
    }

    /// Returns the notice on this device for the start of a run. Not real-time.
    pub(super) fn notice(&self, strength: Strength) -> String {
        let Ceiling { force_n, torque_nm } = CEILING;
        match strength {
            Strength::UnderCeiling => format!(
                "{self}; the host sends at most {force_n} N and {torque_nm} N·m in any direction. `--allow-strong` permits more"
            ),
            Strength::Strong => format!(
                "{self}, and the host sends it: `--allow-strong` lifted its ceiling of {force_n} N and {torque_nm} N·m"
            ),
        }
    }
}

impl std::fmt::Display for StrongDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, plugin, force_n, torque_nm } = self;
        write!(f, "`{name}` ({plugin}): scene and device allow {force_n:.1} N and {torque_nm:.2} N·m")
    }
}

/// Returns the largest force (N) and torque (N·m) that scene and device allow.
fn longest(limits: &Limits, device: &Capabilities) -> [f64; 2] {
    let boxes = [device.max_force_n, device.max_torque_nm].map(Bound::box_of);
    [limits.force_n.and(boxes[0]).longest(), limits.torque_nm.and(boxes[1]).longest()]
}

/// Returns the limits of a device: under the ceiling if it is physical, unchanged if it is simulated. Not real-time.
fn under_ceiling(limits: &Limits, embodiment: Embodiment) -> Limits {
    match embodiment {
        Embodiment::Physical => limits.under(CEILING),
        Embodiment::Simulated => *limits,
    }
}

/// Returns a notice if a limit given as one number restricts a device more than in earlier versions: the number now limits the norm,
/// and limited each axis before. Not real-time.
fn norm_notice(limits: &Limits, devices: &[Capabilities]) -> Option<String> {
    let forces = devices.iter().map(|device| device.max_force_n);
    let torques = devices.iter().map(|device| device.max_torque_nm);
    // No device declares a largest speed of its handle.
    let speeds = || devices.iter().map(|_| [f64::INFINITY; 3]);
    let parts = [
        changed("force_n", limits.force_n, forces, "N"),
        changed("torque_nm", limits.torque_nm, torques, "N·m"),
        changed("velocity_m_per_s", limits.velocity_m_per_s, speeds(), "m/s"),
        changed("angular_velocity_rad_per_s", limits.angular_velocity_rad_per_s, speeds(), "rad/s"),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    (!parts.is_empty()).then(|| format!("one number limits the norm, not each axis: {}", parts.join("; ")))
}

/// Returns the notice about one limit; `None` if it restricts no device more.
fn changed(key: &str, bound: Bound, devices: impl Iterator<Item = [f64; 3]>, unit: &str) -> Option<String> {
    let most = bound.norm();
    if bound != Bound::ball(most) || most.is_infinite() {
        return None;
    }
    let along_each_axis = |device| Bound::box_of([most; 3]).and(Bound::box_of(device)).longest();
    let before = devices.map(along_each_axis).fold(0.0, f64::max);
    // Tolerance for the rounding of the norm at a corner of the box.
    (before > most * (1.0 + 1.0e-12)).then(|| {
        format!(
            "in earlier versions `limits.{key} = {most}` allowed up to {before:.2} {unit}, now {most} {unit}; \
             `[{most}, {most}, {most}]` limits each axis"
        )
    })
}

/// Devices of a run with their envelopes, and notices about their limits.
pub(super) struct Guards {
    /// Devices in the scene's order, with envelopes under the ceiling.
    pub(super) devices: Vec<Guarded>,
    /// Envelopes of all devices without the ceiling.
    pub(super) strong_envelopes: Vec<Envelope>,
    pub(super) strong_devices: Vec<StrongDevice>,
    /// Notices about limits and boundary, to be shown before the run, a line each.
    pub(super) notices: Vec<String>,
}

impl Guards {
    pub(super) fn of(scene: &Scene, opened: Vec<Opened>, period_ns: u64) -> Self {
        let capabilities: Vec<Capabilities> = opened.iter().map(|opened| opened.capabilities).collect();
        let mut notices: Vec<String> = norm_notice(&scene.limits, &capabilities).into_iter().collect();
        let (mut devices, mut strong_envelopes, mut strong_devices) = (Vec::new(), Vec::new(), Vec::new());
        for (used, opened) in scene.devices.iter().zip(opened) {
            let Opened { device, capabilities, grip, embodiment, .. } = opened;
            let envelope = |limits: &Limits| {
                Envelope::new(limits, &scene.boundary, &capabilities, period_ns).with_grip(grip, limits)
            };
            let names = [used.name.as_str(), used.plugin.plugin.as_str()];
            strong_devices.extend(StrongDevice::of(names, embodiment, &scene.limits, &capabilities));
            strong_envelopes.push(envelope(&scene.limits));
            let wall =
                RenderedBoundary::new(&scene.boundary, &capabilities, &scene.limits.force_n, period_ns);
            let notice = wall.notice().filter(|_| capabilities.actuated != Axes::NONE);
            notices.extend(notice.map(|notice| format!("`{}`: {notice}", used.name)));
            let envelope = envelope(&under_ceiling(&scene.limits, embodiment));
            devices.push(Guarded { device, capabilities, envelope });
        }
        Self { devices, strong_envelopes, strong_devices, notices }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANAR: Capabilities = Capabilities {
        max_force_n: [40.0, 30.0, 0.0],
        max_torque_nm: [0.5, 0.0, 0.0],
        ..Capabilities::UNDRIVEN
    };

    fn strong(embodiment: Embodiment, limits: &Limits) -> Option<StrongDevice> {
        StrongDevice::of(["left", "arm"], embodiment, limits, &PLANAR)
    }

    #[test]
    fn a_device_that_can_exceed_the_ceiling_is_strong_unless_it_is_simulated_or_limited() {
        let found = strong(Embodiment::Physical, &Limits::default()).expect("50 N");
        assert_eq!((found.force_n, found.torque_nm), (50.0, 0.5));
        let said = found.notice(Strength::UnderCeiling);
        assert!(said.contains("`left` (arm)") && said.contains("50.0 N"), "{said}");
        assert!(said.contains("20 N and 1 N·m") && said.contains("--allow-strong"), "{said}");
        assert_eq!(strong(Embodiment::Simulated, &Limits::default()), None);
        let limited = |force_n| Limits { force_n, ..Limits::default() };
        assert_eq!(strong(Embodiment::Physical, &limited(Bound::ball(20.0))), None);
        assert_eq!(strong(Embodiment::Physical, &limited(Bound::box_of([12.0, 16.0, 9.0]))), None);
        assert!(strong(Embodiment::Physical, &limited(Bound::box_of([20.0; 3]))).is_some(), "28.3 N");
    }

    #[test]
    fn the_ceiling_is_for_what_may_push_a_hand() {
        let limits = Limits { force_n: Bound::ball(30.0), ..Limits::default() };
        let under = under_ceiling(&limits, Embodiment::Physical);
        assert_eq!((under.force_n.norm(), under.torque_nm.norm()), (20.0, 1.0));
        assert_eq!(under_ceiling(&limits, Embodiment::Simulated), limits);
    }

    #[test]
    fn one_number_that_means_less_than_before_is_told_with_the_old_way() {
        let told = |force_n| norm_notice(&Limits { force_n, ..Limits::default() }, &[PLANAR]);
        let said = told(Bound::ball(5.0)).expect("7.07 N before");
        assert!(said.contains("7.07 N") && said.contains("`[5, 5, 5]`") && !said.contains('\n'), "{said}");
        assert_eq!(told(Bound::box_of([5.0; 3])), None);
        assert_eq!(told(Bound::ball(50.0)), None, "the device's own corner");
        assert_eq!(told(Bound::NONE), None);
        let torque = Limits { torque_nm: Bound::ball(0.2), ..Limits::default() };
        assert_eq!(norm_notice(&torque, &[PLANAR]), None, "one axis has no corner");
    }
}
