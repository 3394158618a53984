//! Function tables behind an entry, by the kind of the plugin.

use super::LoadError;
use super::extension::{DeviceExtensions, ModelExtensions};
use super::model::ModelTables;
use super::offers::Offers;
use flotor_hal::Parameter;
use flotor_hal::abi::{DeviceTable, ForceTable, PluginKind, Table};

/// Function tables of a plugin, by its kind.
#[derive(Clone, Copy)]
pub(super) enum Interface {
    Model(ModelTables),
    Device { device: &'static DeviceTable, extensions: DeviceExtensions },
}

impl Interface {
    /// Gets the tables of a plugin by its kind. Not real-time; runs the plugin's code.
    ///
    /// # Errors
    /// [`LoadError::MissingFunction`] if the interface or a required function is missing, or if a table, also of an
    /// extension, is shorter than the contract's.
    pub(super) fn find(offers: &Offers<'_>, kind: PluginKind) -> Result<Self, LoadError> {
        match kind {
            PluginKind::Device => Self::device(offers),
            PluginKind::Model => Self::model(offers),
        }
    }

    fn device(offers: &Offers<'_>) -> Result<Self, LoadError> {
        let device: &'static DeviceTable = offers.required()?;
        let functions = [
            ("has no `open`", device.open.is_some()),
            ("has no `close`", device.close.is_some()),
            ("has no `capabilities`", device.capabilities.is_some()),
            ("has no `activate`", device.activate.is_some()),
            ("has no `deactivate`", device.deactivate.is_some()),
            ("has no `read`", device.read.is_some()),
            ("has no `write`", device.write.is_some()),
            ("has no `safe_stop`", device.safe_stop.is_some()),
        ];
        offers.check_functions(DeviceTable::ID, &functions)?;
        let extensions = DeviceExtensions::of(offers)?;
        Ok(Self::Device { device, extensions })
    }

    fn model(offers: &Offers<'_>) -> Result<Self, LoadError> {
        let force: &'static ForceTable = offers.required()?;
        let functions = [
            ("has no `create`", force.create.is_some()),
            ("has no `destroy`", force.destroy.is_some()),
            ("has no `step`", force.step.is_some()),
        ];
        offers.check_functions(ForceTable::ID, &functions)?;
        Ok(Self::Model(ModelTables { force, extensions: ModelExtensions::of(offers)? }))
    }

    /// Returns id, name and description in the main table.
    pub(super) fn texts(&self) -> [&'static str; 3] {
        match self {
            Self::Model(ModelTables { force, .. }) => [force.info.id(), force.info.name(), force.info.doc()],
            Self::Device { device, .. } => [device.info.id(), device.info.name(), device.info.doc()],
        }
    }

    /// Returns the unchecked list of parameters in the main table, with its length.
    pub(super) fn parameters(&self) -> (*const Parameter, u32) {
        match self {
            Self::Model(ModelTables { force, .. }) => (force.parameters, force.parameter_count),
            Self::Device { device, .. } => (device.parameters, device.parameter_count),
        }
    }
}
