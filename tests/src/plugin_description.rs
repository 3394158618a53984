//! A plugin of a recording, for tests of the format.
//!
//! Needs the names of `flotor_record` from the module that includes this file with `#[path]`: one of them is in that crate.

use super::{PluginDescription, Role};
use flotor_core::mapping::{Blend, FieldTiming};
use flotor_hal::Demand;

/// Describes a plugin of this name with a value in each field.
pub(crate) fn described(name: &str, role: Role) -> PluginDescription {
    let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
    let is_device = role == Role::Device;
    PluginDescription {
        name: name.to_owned(),
        id: format!("{name}-id"),
        version: "1.2.3".to_owned(),
        file: format!("lib{name}.so"),
        role,
        places_m: if is_device { Vec::new() } else { vec![[0.001, -0.002, 0.003], [0.25; 3]] },
        blend: if is_device { Blend::default() } else { Blend { weight: 0.5, priority: 3, fade_s: 0.25 } },
        field: (!is_device).then_some(FieldTiming { rate_hz: 200.0, latency_s: 0.0025 }),
        latency_s: if is_device { 0.001 } else { 0.0 },
        at_hand: Demand::WRENCH,
        settings: vec![pair("preset", "plain")],
        parameters: vec![pair("preset", "plain"), pair("mass_kg", "0.58")],
        device: 0,
    }
}
