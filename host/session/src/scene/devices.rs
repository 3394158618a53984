//! Devices of a scene, and assignment of models to devices.

use super::reader::{Location, SceneError, Section, Value, did_you_mean};
use super::{CalibrationUse, ModelUse, PluginUse, plugin_use};
use flotor_core::MAX_DEVICES;
use std::collections::BTreeSet;

/// Separator between model name and device name, for a model on several devices.
const ON: char = '@';

/// Device of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceUse {
    /// Name in `--set NAME.KEY=VALUE` and reports; "device" by default for the only device.
    pub name: String,
    /// Plugin of the device.
    pub plugin: PluginUse,
    /// Calibration file of the vertical force; `None`: not calibrated.
    pub calibration: Option<CalibrationUse>,
    /// Viscous damping of the device along each axis, N·s/m; 0: not known.
    pub damping_ns_per_m: f64,
}

/// Reads the devices, each with a unique name.
pub(super) fn read(root: &mut Section<'_>) -> Result<Vec<DeviceUse>, SceneError> {
    let missing = root.missing("device");
    let sections = root.sections("device")?;
    if sections.is_empty() {
        return Err(missing);
    }
    let is_one = sections.len() == 1;
    let mut devices: Vec<DeviceUse> = Vec::new();
    for mut section in sections {
        let here = section.location();
        let name = match section.read("name", name)? {
            Some(name) => name,
            None if is_one => "device".to_owned(),
            None => return Err(section.missing("name")),
        };
        if devices.iter().any(|device| device.name == name) {
            return Err(
                here.problem(format!("two devices are called `{name}`; give each a different `name`"))
            );
        }
        if devices.len() >= MAX_DEVICES.into() {
            return Err(here.problem(format!(
                "the scene has more than {MAX_DEVICES} devices, the maximum; remove devices"
            )));
        }
        let plugin = plugin_use(&mut section)?;
        let calibration = section.read("calibration", |value| {
            let location = value.location.clone();
            Ok(CalibrationUse { file: value.text()?.into(), location })
        })?;
        let damping_ns_per_m = section.number_or("damping_ns_per_m", 0.0..=1.0e3, 0.0)?;
        devices.push(DeviceUse { name, plugin, calibration, damping_ns_per_m });
        section.finish()?;
    }
    Ok(devices)
}

/// Reads a name; rejects the separator of model and device.
pub(super) fn name(value: Value<'_>) -> Result<String, SceneError> {
    let wrong =
        value.problem(format!("a name must not contain `{ON}`, which separates a model from its device"));
    let name = value.text()?;
    if name.contains(ON) { Err(wrong) } else { Ok(name) }
}

/// Returns the number, from 0, of the device with this name.
pub(super) fn number(devices: &[DeviceUse], value: Value<'_>) -> Result<u16, SceneError> {
    let location = value.location.clone();
    find(devices, &value.text()?, &location)
}

fn find(devices: &[DeviceUse], name: &str, location: &Location) -> Result<u16, SceneError> {
    (0..).zip(devices).find(|(_, device)| device.name == name).map(|(number, _)| number).ok_or_else(|| {
        let names: Vec<&str> = devices.iter().map(|device| device.name.as_str()).collect();
        let hint = did_you_mean(name, names.iter().copied());
        location.problem(format!("there is no device `{name}`{hint} (devices: {})", names.join(", ")))
    })
}

/// Returns the numbers of the devices of a model: the named devices, or the only device of the scene.
pub(super) fn of_model(
    devices: &[DeviceUse],
    named: Option<Value<'_>>,
    location: &Location,
) -> Result<Vec<u16>, SceneError> {
    let Some(value) = named else {
        let problem = "the scene has several devices: name the device of the model, `device = \"NAME\"` or a list of names";
        return match devices {
            [_] => Ok(vec![0]),
            _ => Err(location.problem(problem)),
        };
    };
    let location = value.location.clone();
    let names = value.one_or_more_texts()?;
    if names.is_empty() {
        return Err(location.problem(
            "`model.device` names no device; name at least one, or omit the key if the scene has only one device",
        ));
    }
    names.iter().map(|name| find(devices, name, &location)).collect()
}

/// Returns the name of a model on one of several devices.
pub(super) fn name_on(model: &str, device: &DeviceUse) -> String {
    format!("{model}{ON}{}", device.name)
}

/// Returns true if `requested` names this model, alone or together with its copies on other devices.
#[must_use]
pub fn is_named(name: &str, requested: &str) -> bool {
    name == requested || without_device(name) == requested
}

/// Returns the name of a model without its device: `spring` for `spring@left`.
#[must_use]
pub fn without_device(name: &str) -> &str {
    name.split_once(ON).map_or(name, |(model, _)| model)
}

/// Returns an error if two models, or a model and a device, have the same name: `--set` and changes would reach only one of both.
pub(super) fn tell_apart(models: &[ModelUse], devices: &[DeviceUse]) -> Result<(), SceneError> {
    let mut names = BTreeSet::new();
    for model in models {
        let other = if !names.insert(&model.name) {
            "two models are"
        } else if devices.iter().any(|device| device.name == model.name) {
            "a device and a model are"
        } else {
            continue;
        };
        let problem = format!("{other} called `{}`; give each a different `name`", model.name);
        return Err(model.plugin.location.problem(problem));
    }
    Ok(())
}
