//! Stop of a device after the end of the host's process, and the watchdog process that sends the stop: one rule for runs and for
//! commands that drive a device without a scene.

use super::error::RunError;
use crate::platform::NOT_CAUGHT;
use flotor_core::limits::Limits;
use flotor_hal::{Axes, Capabilities, Embodiment, Refusal};
use flotor_loader::Independence;
use flotor_loader::OpenedDevice;
use flotor_servo::watchdog_process::WatchdogProcess;

/// Means that stop an open device after the end of the host's process.
pub struct StopWithoutHost {
    device: String,
    embodiment: Embodiment,
    actuated: Axes,
    /// Means that the plugin declares; `None` if nothing stops the device.
    means: Option<Independence>,
}

impl StopWithoutHost {
    /// Queries the plugin for the means that stop its device after the end of the host's process, and returns these means; `name`
    /// is the device's name in messages. Not real-time.
    ///
    /// # Errors
    /// [`Refusal`] if the plugin declares a stop that cannot be used.
    pub fn of(
        name: &str,
        embodiment: Embodiment,
        capabilities: &Capabilities,
        device: &mut OpenedDevice,
    ) -> Result<Self, Refusal> {
        let means = device.independent_stop()?;
        Ok(Self { device: name.to_owned(), embodiment, actuated: capabilities.actuated, means })
    }

    /// Returns the reason to reject the device if an independent stop is required; `None` for a device with an independent stop or
    /// without actuated axes.
    pub(super) fn missing(&self) -> Option<String> {
        self.is_missing().then(|| {
            "no process stops the device if this program is killed: its plugin lacks the extension \
             `flotor.independent-stop/1`; remove \
             `[limits] require_independent_stop`, and keep a hand at its power switch"
                .to_owned()
        })
    }

    fn is_missing(&self) -> bool {
        self.means.is_none() && self.actuated != Axes::NONE
    }

    fn warning(&self) -> Option<String> {
        self.is_missing().then(|| {
            format!(
                "nothing stops `{}` if this program is killed: its plugin lacks the extension `flotor.independent-stop/1`; keep a \
                 hand at its power switch",
                self.device
            )
        })
    }

    /// Returns true for a physical device that only the watchdog process stops after the death of the host.
    fn needs_watchdog_process(&self) -> bool {
        self.embodiment == Embodiment::Physical
            && self.actuated != Axes::NONE
            && matches!(self.means, Some(Independence::Message { .. }))
    }
}

/// Watchdog process of open devices, and warnings about its limits.
#[derive(Default)]
pub struct WatchdogStart {
    /// Watchdog process; `None` if no device is stopped by a message, or if the process cannot be started and is not required.
    pub process: Option<WatchdogProcess>,
    /// Warnings about cases in which no process stops the devices, a sentence each.
    pub warnings: Vec<String>,
}

/// Starts the watchdog process of open devices, before the first of them is energised. Not real-time.
///
/// # Errors
/// [`RunError::WatchdogProcess`] if the process cannot be started but `limits` require it; [`RunError::SharedControlGroup`] if a
/// kill of one control group leaves the force of a device on and `limits` do not accept this.
pub fn start_watchdog_process(
    stops: &[&StopWithoutHost],
    limits: &Limits,
) -> Result<WatchdogStart, RunError> {
    let mut warnings: Vec<String> = stops.iter().filter_map(|stop| stop.warning()).collect();
    let means = stops.iter().filter_map(|stop| Some((stop.device.as_str(), stop.means.as_ref()?)));
    let started = WatchdogProcess::start(means);
    let is_guarded = started.is_ok() && !stops.iter().any(|stop| stop.is_missing());
    let process = match started {
        Ok(process) => process,
        Err(error) if limits.require_independent_stop => return Err(RunError::WatchdogProcess(error)),
        Err(error) => {
            warnings.push(format!(
                "cannot start the watchdog process ({error}), so no process stops the devices if this program is \
                 killed; keep a hand at the power switch of each device"
            ));
            None
        }
    };
    if let Some(group) = process.as_ref().and_then(WatchdogProcess::shared_group) {
        let mut unconsented = stops.iter().filter(|stop| stop.needs_watchdog_process());
        match unconsented.next().filter(|_| !limits.accept_shared_control_group) {
            Some(stop) => {
                let (device, group) = (stop.device.clone(), group.to_owned());
                return Err(RunError::SharedControlGroup { device, group });
            }
            None => warnings.push(shared_group_warning(group)),
        }
    }
    if !is_guarded {
        warnings.extend(NOT_CAUGHT.map(str::to_owned));
    }
    Ok(WatchdogStart { process, warnings })
}

/// Returns the warning that a kill of a control group ends this program and the watchdog process.
fn shared_group_warning(group: &str) -> String {
    format!(
        "the watchdog process is in the control group `{group}` of this program: nothing stops the devices if all processes of \
         the group are killed, as at the end of a service or a container, or when memory runs out; `flotor doctor` gives the remedy"
    )
}
