//! Options several commands share, and how they are read.

use crate::scene::{Location, ModelUse, ParameterText, Scene, nearest};
use clap::ValueEnum;
use std::path::PathBuf;
use std::str::FromStr;

/// `--clock`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ClockOption {
    /// The machine's clock
    #[default]
    Real,
    /// As fast as it goes, bit-exact
    Virtual,
}

/// `KEY=VALUE`
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct KeyValue {
    key: String,
    value: String,
}

impl FromStr for KeyValue {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((key, value)) if !key.trim().is_empty() => {
                Ok(Self { key: key.trim().to_owned(), value: value.trim().to_owned() })
            }
            _ => Err(format!("`{text}` is not KEY=VALUE")),
        }
    }
}

impl KeyValue {
    /// As a parameter of a plugin.
    pub(crate) fn parameter(&self) -> ParameterText {
        let location = Location { file: PathBuf::from(format!("--set {}", self.key)), line: 0 };
        ParameterText { key: self.key.clone(), value: self.value.clone(), location }
    }
}

/// `PLUGIN.KEY=VALUE`
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PluginKeyValue {
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

impl PluginKeyValue {
    /// Adds the setting to the plugin of a scene it names: `device`, a model's name, or a plugin's id.
    pub(crate) fn apply(&self, scene: &mut Scene) -> Result<(), String> {
        if self.plugin == "device" || self.plugin == scene.device.plugin {
            scene.device.parameters.push(self.parameter());
            return Ok(());
        }
        let device = scene.device.plugin.clone();
        self.apply_among(&mut scene.models, &["device", &device])
    }

    /// Adds the setting to the model it names: by its name in the scene, or by its plugin's id.
    pub(crate) fn apply_to_models(&self, models: &mut [ModelUse]) -> Result<(), String> {
        self.apply_among(models, &[])
    }

    fn apply_among(&self, models: &mut [ModelUse], others: &[&str]) -> Result<(), String> {
        let named = |model: &&mut ModelUse| model.name == self.plugin || model.plugin.plugin == self.plugin;
        if let Some(model) = models.iter_mut().find(named) {
            model.plugin.parameters.push(self.parameter());
            return Ok(());
        }
        let names: Vec<&str> =
            models.iter().map(|model| model.name.as_str()).chain(others.iter().copied()).collect();
        let hint =
            nearest(&self.plugin, names.iter().copied()).map(|name| format!("; did you mean `{name}`?"));
        Err(format!(
            "--set {}.{}: there is no plugin `{}`{} (there are {})",
            self.plugin,
            self.setting.key,
            self.plugin,
            hint.unwrap_or_default(),
            names.join(", ")
        ))
    }

    fn parameter(&self) -> ParameterText {
        let mut parameter = self.setting.parameter();
        parameter.location.file = PathBuf::from(format!("--set {}.{}", self.plugin, self.setting.key));
        parameter
    }
}

/// Seconds from `10`, `10s`, `500ms`, `2min` or `1h`.
pub(crate) fn duration_s(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let scale = match unit {
        "" | "s" => 1.0,
        "ms" => 1.0e-3,
        "min" | "m" => 60.0,
        "h" => 3600.0,
        other => return Err(format!("`{other}` is no unit of time; legal is ms, s, min, h")),
    };
    let number: f64 =
        number.trim().parse().map_err(|_| format!("`{text}` is no duration; write 10s or 500ms"))?;
    let seconds = number * scale;
    if (0.0..=31_536_000.0).contains(&seconds) { Ok(seconds) } else { Err("legal is 0 to a year".to_owned()) }
}

/// A loop rate in Hz.
pub(crate) fn rate_hz(text: &str) -> Result<f64, String> {
    let rate: f64 =
        text.trim().trim_end_matches("Hz").trim().parse().map_err(|_| format!("`{text}` is no rate"))?;
    if (100.0..=10_000.0).contains(&rate) { Ok(rate) } else { Err("legal is 100 to 10000 Hz".to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_units() {
        assert_eq!(duration_s("10"), Ok(10.0));
        assert_eq!(duration_s("10s"), Ok(10.0));
        assert_eq!(duration_s(" 500 ms"), Ok(0.5));
        assert_eq!(duration_s("2min"), Ok(120.0));
        assert!(duration_s("10 parsec").is_err());
        assert!(duration_s("-1s").is_err());
        assert!(duration_s("nan").is_err());
    }

    #[test]
    fn a_setting_needs_plugin_key_and_value() {
        assert!("spring.variant=energy".parse::<PluginKeyValue>().is_ok());
        for wrong in ["spring.variant", "variant=energy", ".variant=energy", "spring.=x", ""] {
            assert!(wrong.parse::<PluginKeyValue>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn an_unknown_plugin_gets_a_suggestion() {
        let mut scene = crate::scene::Scene::demo().unwrap();
        let wrong: PluginKeyValue = "sprng.variant=energy".parse().unwrap();
        assert!(wrong.apply(&mut scene).unwrap_err().contains("did you mean `spring`?"));
        let device: PluginKeyValue = "device.preset=plain".parse().unwrap();
        assert!(device.apply(&mut scene).is_ok());
    }
}
