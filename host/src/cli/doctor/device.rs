//! `flotor doctor --device ID`: what the plugin says when it is opened, and what the machine says of its connection.

use super::Diagnosis;
use crate::platform::usb::{Machine, connection};
use flotor_command::CommandError;
use flotor_command::options::{KeyValue, settings};
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::{LoadError, OpenedDevice, Plugin};
use flotor_hal::{Axes, Capabilities};
use flotor_session::registry::Registry;

/// What is to be known of a device before it runs. Opens it, without force.
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
    let settings = settings(&plugin, sets)?;
    let opened = plugin.open_device(&settings);
    let mut diagnoses = connection(machine, plugin.usb_kinds(), opened.is_ok());
    match opened {
        Ok(mut device) => diagnoses.extend(abilities(&plugin, &mut device)),
        // One sentence for people: what, where, what to do.
        Err(LoadError::Refused { refusal, .. }) => diagnoses.push(Diagnosis::told("opening", refusal.reason)),
        Err(error) => diagnoses.push(Diagnosis::told("opening", error.to_string())),
    }
    Ok(diagnoses)
}

/// What an open device says of itself.
fn abilities(plugin: &Plugin, device: &mut OpenedDevice) -> Vec<Diagnosis> {
    let mut diagnoses =
        vec![Diagnosis::good("opening", format!("{} is open, without force", plugin.metadata().name))];
    match device.capabilities() {
        Ok(capabilities) => diagnoses.push(Diagnosis::good("axes", axes(&capabilities))),
        Err(refusal) => diagnoses.push(Diagnosis::told("axes", refusal.to_string())),
    }
    diagnoses.push(match device.independent_stop() {
        Ok(Some(_)) => Diagnosis::good("without its host", "stops by itself, or is stopped"),
        Ok(None) => Diagnosis::note(
            "without its host",
            "nothing is known to stop it",
            "keep a hand at its power switch; `[limits] require_independent_stop = true` refuses such a device",
        ),
        Err(refusal) => Diagnosis::told("without its host", refusal.to_string()),
    });
    diagnoses
}

fn axes(told: &Capabilities) -> String {
    const SINGLE: [Axes; 3] = [Axes::X, Axes::Y, Axes::Z];
    let count = |axes: Axes| {
        let translations = SINGLE.into_iter().filter(|axis| axes.contains(*axis)).count();
        translations + if axes.contains(Axes::ROTATION) { 3 } else { 0 }
    };
    let most = |axes: [f64; 3]| axes.into_iter().fold(0.0, f64::max);
    format!(
        "{} sensed, {} driven; at most {} N and {} N·m along one",
        count(told.sensed),
        count(told.actuated),
        most(told.max_force_n),
        most(told.max_torque_nm)
    )
}
