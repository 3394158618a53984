//! Number of a plugin in a run.

use std::fmt;

/// Number of a plugin in a run, from 0: the devices come first, then the models, both in the scene's order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub struct PluginIndex(usize);

impl PluginIndex {
    /// Returns the number of the plugin at a position in a list of all plugins.
    pub const fn at(position: usize) -> Self {
        Self(position)
    }

    /// Returns the number of a device.
    pub const fn of_device(device: u16) -> Self {
        Self(device as usize)
    }

    /// Returns the number of a model in a run with this many devices.
    pub const fn of_model(devices: usize, model: usize) -> Self {
        Self(devices.saturating_add(model))
    }

    /// Returns the position in a list of all plugins.
    #[must_use]
    pub const fn position(self) -> usize {
        self.0
    }

    /// Returns the number among the models of a run with this many devices; `None` for a device.
    #[must_use]
    pub const fn among_models(self, devices: usize) -> Option<usize> {
        self.0.checked_sub(devices)
    }
}

impl fmt::Display for PluginIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "plugin {}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_devices_come_before_the_models() {
        let (last_device, first_model) = (PluginIndex::of_device(1), PluginIndex::of_model(2, 0));
        assert_eq!((last_device.position(), first_model.position()), (1, 2));
        assert_eq!((last_device.among_models(2), first_model.among_models(2)), (None, Some(0)));
    }
}
