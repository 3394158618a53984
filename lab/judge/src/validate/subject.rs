//! Checked plugin with the settings of its instances.

use super::path::CONFIG;
use crate::subject::prepared;
use flotor_hal::abi::PluginKind;
use flotor_loader::{LoadError, Model, OpenedDevice, Plugin, Setting};

/// Checked plugin with the settings of its instances.
pub(super) struct Subject {
    pub(super) plugin: Plugin,
    pub(super) settings: Vec<Setting>,
}

impl Subject {
    /// Creates and prepares an instance, as for a loop.
    pub(super) fn prepared_model(&self) -> Result<Model, String> {
        prepared(&self.plugin, &self.settings, CONFIG.seed).map_err(|error| error.to_string())
    }

    pub(super) fn is_device(&self) -> bool {
        self.plugin.metadata().kind == PluginKind::Device
    }

    pub(super) fn device(&self) -> Result<OpenedDevice, LoadError> {
        self.plugin.open_device(&self.settings)
    }
}
