//! Reports on the plugins of a run, and their names for errors.

use crate::scene::Isolation;
use flotor_core::PluginIndex;
use flotor_core::asynchronous::FieldTiming;
use flotor_hal::abi::PluginKind;
use flotor_hal::{Demand, Embodiment, Parameter, SoftRange};
use flotor_loader::Metadata;
use flotor_servo::Place;
use flotor_servo::last_stop::TakenSignals;

/// Report on a plugin of a run: metadata, parameters and properties, for summaries and recordings.
#[derive(Clone, Debug)]
pub struct PluginReport {
    /// Name of the device or model in the scene.
    pub name: String,
    /// Metadata of the plugin: id, kind, version and file.
    pub metadata: Metadata,
    /// Descriptions of the plugin's parameters.
    pub schema: &'static [Parameter],
    /// Parameters set in the scene and on the command line, as id and value, as written and in order.
    pub settings: Vec<(String, String)>,
    /// Id of every parameter with its value before the run, as text.
    pub parameters: Vec<(String, String)>,
    /// Soft range of each parameter, which bounds the rate of its changes; `None` for a parameter that is not a number, and for all
    /// parameters of a simulated device.
    pub soft_ranges: Vec<Option<SoftRange>>,
    /// Embodiment of a device, physical or simulated; `None` for a model.
    pub embodiment: Option<Embodiment>,
    /// Latency that a device declares, s; 0 for a model.
    pub latency_s: f64,
    /// Model outputs that reach the hand: at a device force, and torque if device and scene allow any; at a model the whole wrench.
    pub at_hand: Demand,
    /// Isolation of a model, with `ByOrigin` resolved; `None` for a device.
    pub isolation: Option<Isolation>,
    /// Timing and limits of an asynchronous model, as on its device; `None` for other plugins.
    pub field: Option<FieldTiming>,
    /// Signals of the host that the plugin blocked, or whose actions the plugin replaced, during its creation; the host has
    /// restored these signals.
    pub signals_taken: TakenSignals,
    /// Error estimates of a model ([`flotor_loader::Model::estimates`]): id and value of each.
    pub estimates: Vec<(String, f64)>,
}

impl PluginReport {
    /// Returns a warning if the plugin has replaced or blocked signals of the host.
    pub(super) fn warning(&self) -> Option<String> {
        let Self { name, signals_taken, .. } = self;
        (!signals_taken.is_none()).then(|| {
            format!("`{name}` replaced {signals_taken} of the host during its creation; the host has restored them")
        })
    }
}

/// Names, in the scene, of the plugins of a run.
#[derive(Clone)]
pub(super) struct PluginNames {
    /// All names: the devices, then the models.
    pub(super) all: Vec<String>,
    devices: usize,
}

impl PluginNames {
    pub(super) fn of(plugins: &[PluginReport]) -> Self {
        let is_device = |plugin: &&PluginReport| plugin.metadata.kind == PluginKind::Device;
        let devices = plugins.iter().filter(is_device).count();
        Self { all: plugins.iter().map(|plugin| plugin.name.clone()).collect(), devices }
    }

    /// Returns the names of the models.
    pub(super) fn models(&self) -> &[String] {
        self.all.get(self.devices..).unwrap_or_default()
    }

    /// Returns the name of a plugin; `plugin N` with its index if the run has fewer plugins.
    pub(super) fn name(&self, plugin: PluginIndex) -> String {
        self.all.get(plugin.position()).cloned().unwrap_or_else(|| plugin.to_string())
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
