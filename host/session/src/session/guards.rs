//! Envelopes of the devices of a run, under the host's ceiling and without it, and notices about the limits.

use super::ceiling::{StrongDevice, norm_notice, under_ceiling};
use super::prepare::Opened;
use crate::scene::Scene;
use flotor_core::limits::Limits;
use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_hal::{Axes, Capabilities};
use flotor_servo::{Envelope, Guarded};

/// Guarded devices of a run.
pub(super) struct Guards {
    /// Devices in the scene's order, under the ceiling.
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
            let Opened { device, capabilities, embodiment, .. } = opened;
            let envelope = |limits: &Limits| Envelope::new(limits, &scene.boundary, &capabilities, period_ns);
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
