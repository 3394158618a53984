//! `flotor doctor --device ID`: diagnosis of a device from its plugin and its USB connection.

use crate::diagnosis::Diagnosis;
use crate::platform::usb::{Machine, connection};
use flotor_command::CommandError;
use flotor_command::options::{KeyValue, settings};
use flotor_core::limits::{Bound, Boundary};
use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_hal::abi::PluginKind;
use flotor_hal::{Axes, Capabilities, Refusal};
use flotor_loader::Independence;
use flotor_loader::{LoadError, OpenedDevice, Plugin};
use flotor_servo::watchdog_process;
use flotor_session::registry::Registry;
use std::io;

/// Topic of the findings on the stop of a device after the end of its host.
const WITHOUT_ITS_HOST: &str = "without its host";

/// Diagnoses a device before its first run: its USB connection, opening, axes, boundary wall and stop. Opens the device, without
/// force.
pub(super) fn diagnose(
    registry: &Registry,
    id: &str,
    sets: &[KeyValue],
    machine: &Machine,
) -> Result<Vec<Diagnosis>, CommandError> {
    let plugin = registry.load_any(id)?;
    if plugin.metadata().kind != PluginKind::Device {
        return Err(CommandError::Usage(format!(
            "--device: `{id}` is a model; `flotor plugins` lists the devices"
        )));
    }
    let sets: Vec<KeyValue> = sets.iter().map(|set| set.within("device")).collect();
    let settings = settings(&plugin, "--set", &sets)?;
    let opened = plugin.open_device(&settings);
    let mut diagnoses = connection(machine, plugin.usb_kinds(), opened.is_ok());
    match opened {
        Ok(mut device) => diagnoses.extend(abilities(&plugin, &mut device)),
        // The reason is one sentence for users: problem, place, remedy.
        Err(LoadError::Refused { refusal, .. }) => {
            diagnoses.push(Diagnosis::bad_without_remedy("opening", refusal.reason))
        }
        Err(error) => diagnoses.push(Diagnosis::bad_without_remedy("opening", error.to_string())),
    }
    Ok(diagnoses)
}

/// Returns the findings on the capabilities of an open device.
fn abilities(plugin: &Plugin, device: &mut OpenedDevice) -> Vec<Diagnosis> {
    let mut diagnoses =
        vec![Diagnosis::good("opening", format!("{} is open, without force", plugin.metadata().name))];
    match device.capabilities() {
        Ok(capabilities) => {
            diagnoses.push(Diagnosis::good("axes", axes(&capabilities)));
            diagnoses.push(Diagnosis::good("boundary wall", boundary_wall(&capabilities)));
        }
        Err(refusal) => diagnoses.push(Diagnosis::bad_without_remedy("axes", refusal.to_string())),
    }
    diagnoses.push(without_its_host(device.independent_stop()));
    diagnoses
}

/// Returns the finding on the stop of the device after the end of its host.
fn without_its_host(declared: Result<Option<Independence>, Refusal>) -> Diagnosis {
    match declared {
        Ok(Some(Independence::Itself { .. })) => Diagnosis::good(WITHOUT_ITS_HOST, "stops by itself"),
        Ok(Some(Independence::Message { .. })) => by_message(watchdog_process::is_offered()),
        Ok(None) => not_stopped("its plugin declares no stop without the host"),
        Err(refusal) => Diagnosis::bad_without_remedy(WITHOUT_ITS_HOST, refusal.to_string()),
    }
}

/// Returns the finding on a device that is stopped by a message, which the watchdog process has to send.
fn by_message(watchdog_process: io::Result<()>) -> Diagnosis {
    match watchdog_process {
        Ok(()) => Diagnosis::good(WITHOUT_ITS_HOST, "the watchdog process stops the device by a message"),
        Err(why) => {
            not_stopped(format!("a message stops the device, but the watchdog process cannot send it: {why}"))
        }
    }
}

fn not_stopped(found: impl Into<String>) -> Diagnosis {
    Diagnosis::note(
        WITHOUT_ITS_HOST,
        found,
        "keep a hand at its power switch; `[limits] require_independent_stop = true` refuses such a device",
    )
}

/// Describes the boundary wall in a scene without `[limits]` and `[boundary]`, at 1 kHz or the nearest rate of the device.
fn boundary_wall(device: &Capabilities) -> String {
    let [slowest, fastest] = device.rate_hz;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a rate of a device is not zero
    let period_ns = (1.0e9 / 1000.0_f64.min(fastest).max(slowest)).round() as u64;
    RenderedBoundary::new(&Boundary::default(), device, &Bound::NONE, period_ns).to_string()
}

fn axes(declared: &Capabilities) -> String {
    const SINGLE: [Axes; 3] = [Axes::X, Axes::Y, Axes::Z];
    let count = |axes: Axes| {
        let translations = SINGLE.into_iter().filter(|axis| axes.contains(*axis)).count();
        translations + if axes.contains(Axes::ROTATION) { 3 } else { 0 }
    };
    let most = |axes: [f64; 3]| axes.into_iter().fold(0.0, f64::max);
    format!(
        "{} sensed, {} driven; at most {} N and {} N·m along one axis",
        count(declared.sensed),
        count(declared.actuated),
        most(declared.max_force_n),
        most(declared.max_torque_nm)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::Grade;

    #[test]
    fn a_device_that_is_stopped_by_a_message_is_well_only_where_it_is_sent() {
        let sent = by_message(Ok(()));
        assert_eq!((sent.grade, sent.remedy), (Grade::Good, None));
        let not_sent = by_message(Err(io::Error::other("it is not on this system")));
        assert_eq!(not_sent.grade, Grade::Note);
        assert!(not_sent.found.ends_with("cannot send it: it is not on this system"), "{}", not_sent.found);
        assert!(not_sent.remedy.is_some_and(|remedy| remedy.contains("a hand at its power switch")));
    }
}
