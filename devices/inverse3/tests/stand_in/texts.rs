//! Texts of a service with two arms and a grip.

use flotor_hal::DVec3;

/// Id of the arm under test.
pub(crate) const ARM: &str = "049D";
/// Id of the other arm.
pub(crate) const OTHER_ARM: &str = "0001";
/// Id of the grip.
pub(crate) const GRIP: &str = "61B8";

/// Returns a state with the cursor at a position, m, and a force on the hand, N.
#[must_use]
pub(crate) fn state(position_m: DVec3, force_n: DVec3) -> String {
    reply(position_m, force_n, "")
}

/// Returns the reply to a configuration with all required settings, for a gain of the force gate.
#[must_use]
pub(crate) fn configured(force_gate: f64) -> String {
    let config = format!(
        "\"config\":{{\"type\":\"inverse3\",\"basis\":{{\"permutation\":\"XYZ\"}},\"preset\":\"arm_front_centered\",\
         \"filters\":{{\"force_gate\":{{\"gain\":{force_gate}}},\"damping\":{{\"scalar\":0.0}}}},\
         \"gravity_compensation\":{{\"enabled\":true,\"scaling_factor\":1.0}}}},"
    );
    reply(DVec3::ZERO, DVec3::ZERO, &config)
}

fn reply(position_m: DVec3, force_n: DVec3, config: &str) -> String {
    let vector = |DVec3 { x, y, z }: DVec3| format!("{{\"x\":{x:?},\"y\":{y:?},\"z\":{z:?}}}");
    let arm = |id: &str, config: &str, position_m: DVec3, force_n: DVec3| {
        format!(
            "{{\"device_id\":\"{id}\",{config}\"state\":{{\"cursor_position\":{},\"cursor_velocity\":{},\
             \"angular_position\":{{\"a0\":1.0,\"a1\":2.0,\"a2\":3.0}},\"current_cursor_force\":{},\
             \"control_domain\":\"cartesian\",\"control_mode\":\"idle\",\"transform\":{{}}}},\
             \"status\":{{\"calibrated\":true,\"in_use\":false,\"power_supply\":true,\"ready\":true,\"started\":true}}}}",
            vector(position_m),
            vector(DVec3::ZERO),
            vector(force_n)
        )
    };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let (other, own) = (arm(OTHER_ARM, "", DVec3::ONE, DVec3::ONE), arm(ARM, config, position_m, force_n));
    format!(
        "{{\"session_id\":7,\"inverse3\":[{other},{own}],\"verse_grip\":[],\"wireless_verse_grip\":[\
         {{\"device_id\":\"{GRIP}\",\"state\":{{\"battery_level\":0.9,\"buttons\":{{\"a\":true,\"b\":false,\"c\":true}},\
         \"orientation\":{{\"w\":{half},\"x\":0.0,\"y\":0.0,\"z\":{half}}}}},\
         \"status\":{{\"ready\":true,\"connected\":true,\"awake\":true}}}}]}}"
    )
}
