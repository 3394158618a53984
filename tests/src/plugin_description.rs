//! Description of a plugin in a recording, for tests of the format.
//!
//! The including module (`#[path]`) provides `PluginDescription` and `Role` of `flotor_record`; one such module is in that crate.

use super::{PluginDescription, Role};
use flotor_core::asynchronous::{ContactLimits, FieldTiming, StiffnessCap};
use flotor_core::mapping::Blend;
use flotor_hal::Demand;

const CONTACTS: ContactLimits = ContactLimits {
    cap: Some(StiffnessCap {
        stiffness_n_per_m: 900.0,
        by_device_n_per_m: 120.0,
        per_damping_1_per_s: 250.0,
    }),
    surface_power_w: 0.5,
    force_n: 3.0,
    torque_nm: f64::INFINITY,
};

/// Returns a description of a plugin `name`; for a model each field has a value other than its default.
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
        shared_with: Vec::new(),
        blend: if is_device { Blend::default() } else { Blend { weight: 0.5, priority: 3, fade_s: 0.25 } },
        field: (!is_device).then_some(FieldTiming { rate_hz: 200.0, latency_s: 0.0025, contacts: CONTACTS }),
        latency_s: if is_device { 0.001 } else { 0.0 },
        at_hand: Demand::WRENCH,
        settings: vec![pair("preset", "plain")],
        parameters: vec![pair("preset", "plain"), pair("mass_kg", "0.58")],
        device: 0,
    }
}
