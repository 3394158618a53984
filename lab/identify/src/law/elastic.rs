//! Laws whose force depends on the depth, and on its velocity for Hunt and Crossley's.

use super::Response;
use flotor_hal::math;

/// Returns the force, N, of Hertz's law at a depth, m; odd in the depth.
pub(super) fn hertz(hertz_n_per_m_1_5: f64, depth_m: f64) -> f64 {
    hertz_n_per_m_1_5 * depth_m * depth_m.abs().sqrt()
}

/// Returns the force, N, of a spring whose coils touch at a depth of `travel_m`.
pub(super) fn spring(stiffness: f64, travel_m: f64, coil_contact: f64, depth_m: f64) -> f64 {
    stiffness * depth_m + coil_contact * (depth_m - travel_m).max(0.0)
}

/// Returns the response of Hunt and Crossley's law: level `k d^n`, impulse `k lambda d^(n+1) / (n+1)`.
pub(super) fn hunt_crossley(
    hertz: f64,
    exponent: f64,
    dissipation_s_per_m: f64,
    depths_m: impl Iterator<Item = f64>,
) -> Response {
    let exponent = exponent.clamp(0.05, 20.0);
    let (mut level_n, mut impulse_ns) = (Vec::new(), Vec::new());
    for depth_m in depths_m {
        let size_m = depth_m.abs();
        let level = if size_m > 0.0 { hertz * math::pow(size_m, exponent) } else { 0.0 };
        level_n.push(level.copysign(depth_m));
        impulse_ns.push(dissipation_s_per_m * level * size_m / (exponent + 1.0));
    }
    Response { level_n, impulse_ns }
}
