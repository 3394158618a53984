//! Settings that override values of a scene, in command line syntax: `spring.variant=energy`.

use super::{DeviceUse, Location, ModelUse, ParameterText, Scene, did_you_mean, is_named, without_device};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Setting `KEY=VALUE`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyValue {
    key: String,
    value: String,
}

impl FromStr for KeyValue {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('=').map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()));
        let setting = parts.filter(|(key, _)| !key.is_empty()).map(|(key, value)| Self { key, value });
        setting.ok_or_else(|| format!("`{text}` is not KEY=VALUE, like preset=full"))
    }
}

impl fmt::Display for KeyValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.key, self.value)
    }
}

impl KeyValue {
    /// Returns key and value, as written.
    #[must_use]
    pub fn pair(&self) -> (&str, &str) {
        (&self.key, &self.value)
    }

    /// Returns the setting without the prefix `part` of its key, if the key has it: within `device`, `device.address=usb` becomes
    /// `address=usb`.
    #[must_use]
    pub fn within(&self, part: &str) -> Self {
        let inner = self.key.strip_prefix(part).and_then(|key| key.strip_prefix('.'));
        Self { key: inner.unwrap_or(&self.key).to_owned(), value: self.value.clone() }
    }

    /// Converts the setting to a parameter of a plugin, with its command line option as location.
    pub fn parameter(&self) -> ParameterText {
        let location = Location { file: PathBuf::from(format!("--set {}", self.key)), line: 0 };
        ParameterText { key: self.key.clone(), value: self.value.clone(), location }
    }
}

/// Setting `PLUGIN.KEY=VALUE`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginKeyValue {
    plugin: String,
    setting: KeyValue,
}

impl FromStr for PluginKeyValue {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("`{text}` is not PLUGIN.KEY=VALUE, like spring.variant=energy or device.preset=full");
        let (key, value) = text.split_once('=').ok_or_else(wrong)?;
        let (plugin, key) = key.split_once('.').ok_or_else(wrong)?;
        let (plugin, key, value) = (plugin.trim(), key.trim(), value.trim());
        if plugin.is_empty() || key.is_empty() {
            return Err(wrong());
        }
        let setting = KeyValue { key: key.to_owned(), value: value.to_owned() };
        Ok(Self { plugin: plugin.to_owned(), setting })
    }
}

impl fmt::Display for PluginKeyValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.plugin, self.setting)
    }
}

impl PluginKeyValue {
    /// Returns plugin, key and value, as written.
    pub(super) fn into_parts(self) -> (String, String, String) {
        (self.plugin, self.setting.key, self.setting.value)
    }

    /// Adds the setting to the named plugins of a scene: a device, a model (`MODEL` on all its devices, `MODEL@DEVICE` on one
    /// device), or a plugin id; `device` names every device. Not real-time.
    ///
    /// # Errors
    /// Message with the closest name, if the scene has no such plugin.
    pub fn apply(&self, scene: &mut Scene) -> Result<(), String> {
        let Scene { devices, models, .. } = scene;
        let of_name = |device: &DeviceUse| device.name == self.plugin || self.plugin == "device";
        let of_id = |device: &DeviceUse| device.plugin.plugin == self.plugin;
        let by_name = devices.iter().any(of_name);
        if by_name || devices.iter().any(of_id) {
            let is_meant = |device: &&mut DeviceUse| if by_name { of_name(device) } else { of_id(device) };
            let meant = devices.iter_mut().filter(is_meant);
            meant.for_each(|device| device.plugin.parameters.push(self.parameter()));
            return Ok(());
        }
        let names = devices.iter().flat_map(|device| [&*device.name, &*device.plugin.plugin]);
        self.apply_among(models, &names.collect::<Vec<_>>())
    }

    /// Adds the setting to the named models, by name in the scene or by plugin id. Not real-time.
    ///
    /// # Errors
    /// Message with the closest name, if no model has the name or id.
    pub fn apply_to_models(&self, models: &mut [ModelUse]) -> Result<(), String> {
        self.apply_among(models, &[])
    }

    fn apply_among(&self, models: &mut [ModelUse], others: &[&str]) -> Result<(), String> {
        let by_name = |model: &ModelUse| is_named(&model.name, &self.plugin);
        let first = models.iter().find(|model| model.plugin.plugin == self.plugin);
        let name = match (models.iter().any(by_name), first) {
            (true, _) => self.plugin.clone(),
            (false, Some(first)) => without_device(&first.name).to_owned(),
            (false, None) => return Err(self.unknown(models, others)),
        };
        for model in models.iter_mut().filter(|model| is_named(&model.name, &name)) {
            model.plugin.parameters.push(self.parameter());
        }
        Ok(())
    }

    fn unknown(&self, models: &[ModelUse], others: &[&str]) -> String {
        let names: Vec<&str> =
            models.iter().map(|model| model.name.as_str()).chain(others.iter().copied()).collect();
        let (plugin, key) = (&self.plugin, &self.setting.key);
        let hint = did_you_mean(plugin, names.iter().copied());
        format!(
            "--set {plugin}.{key}: the scene has no plugin `{plugin}`{hint} (its plugins: {})",
            names.join(", ")
        )
    }

    fn parameter(&self) -> ParameterText {
        let mut parameter = self.setting.parameter();
        parameter.location.file = PathBuf::from(format!("--set {}.{}", self.plugin, self.setting.key));
        parameter
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_needs_plugin_key_and_value() {
        assert!("spring.variant=energy".parse::<PluginKeyValue>().is_ok());
        for wrong in ["spring.variant", "variant=energy", ".variant=energy", "spring.=x", ""] {
            assert!(wrong.parse::<PluginKeyValue>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn an_unknown_plugin_gets_a_suggestion() {
        let mut scene = Scene::demo().unwrap();
        let wrong: PluginKeyValue = "sprng.variant=energy".parse().unwrap();
        assert!(wrong.apply(&mut scene).unwrap_err().contains("did you mean `spring`?"));
        let device: PluginKeyValue = "device.preset=plain".parse().unwrap();
        assert!(device.apply(&mut scene).is_ok());
    }
}
