//! Plugins of a run, for reports, and their names, for errors.

use crate::scene::Isolation;
use flotor_core::PluginIndex;
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::Metadata;
use flotor_hal::{Demand, Embodiment, Parameter, SoftRange};
use flotor_servo::Place;
use flotor_servo::last_stop::TakenSignals;

/// A plugin in a run, for reports and recordings.
#[derive(Clone, Debug)]
pub struct PluginReport {
    /// Name in the scene, of device or model.
    pub name: String,
    /// Metadata of the plugin.
    pub metadata: Metadata,
    /// Parameters of the plugin.
    pub schema: &'static [Parameter],
    /// Settings of scene and command line, as written, in order.
    pub settings: Vec<(String, String)>,
    /// Every parameter with its value before the run, as text.
    pub parameters: Vec<(String, String)>,
    /// Range of each parameter for changes by hand; `None` for a parameter that is no number.
    pub soft_ranges: Vec<Option<SoftRange>>,
    /// Embodiment of a device; `None` for a model.
    pub embodiment: Option<Embodiment>,
    /// Latency that a device declares, s; 0 for a model.
    pub latency_s: f64,
    /// Model outputs that reach the hand at a device.
    pub at_hand: Demand,
    /// Isolation of a model, resolved by its origin; `None` for a device.
    pub isolation: Option<Isolation>,
    /// Signals of the host that the plugin took during its creation, restored since.
    pub signals_taken: TakenSignals,
    /// Error estimates of a model ([`crate::estimates`]), by name.
    pub estimates: Vec<(String, f64)>,
}

impl PluginReport {
    /// Returns a warning if the plugin took signals of the host.
    pub(super) fn warning(&self) -> Option<String> {
        let Self { name, signals_taken, .. } = self;
        (!signals_taken.is_none()).then(|| {
            format!("`{name}` replaced {signals_taken} of the host during its creation; the host has restored them")
        })
    }
}

/// Names of the plugins of a run in its scene.
#[derive(Clone)]
pub(super) struct PluginNames {
    names: Vec<String>,
    devices: usize,
}

impl PluginNames {
    pub(super) fn of(plugins: &[PluginReport]) -> Self {
        let is_device = |plugin: &&PluginReport| plugin.metadata.kind == PluginKind::Device;
        let devices = plugins.iter().filter(is_device).count();
        Self { names: plugins.iter().map(|plugin| plugin.name.clone()).collect(), devices }
    }

    /// Returns all names: the devices, then the models.
    pub(super) fn all(&self) -> &[String] {
        &self.names
    }

    /// Returns the names of the models.
    pub(super) fn models(&self) -> &[String] {
        self.names.get(self.devices..).unwrap_or_default()
    }

    /// Returns the name of a plugin; its number, if the run has fewer plugins.
    pub(super) fn name(&self, plugin: PluginIndex) -> String {
        self.names.get(plugin.position()).cloned().unwrap_or_else(|| plugin.to_string())
    }

    /// Returns the name of a model.
    pub(super) fn model(&self, model: usize) -> String {
        self.name(PluginIndex::of_model(self.devices, model))
    }

    /// Returns the name of the plugin whose code runs at a place, or "host".
    pub(super) fn at(&self, place: Place) -> String {
        place.plugin(self.devices).map_or_else(|| "host".to_owned(), |plugin| self.name(plugin))
    }
}
