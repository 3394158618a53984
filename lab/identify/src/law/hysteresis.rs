//! Prandtl's element: a spring in series with a dry friction.

/// Returns the force, N, at each sample; the element is without force before the first sample.
pub(super) fn force_n(
    stiffness: f64,
    sticking: f64,
    friction_n: f64,
    depths_m: impl Iterator<Item = f64>,
) -> Vec<f64> {
    let (mut element_n, mut before_m) = (0.0_f64, None);
    let step = |depth_m: f64| {
        let moved_m = before_m.map_or(0.0, |before_m| depth_m - before_m);
        before_m = Some(depth_m);
        element_n = (element_n + sticking * moved_m).clamp(-friction_n, friction_n);
        stiffness * depth_m + element_n
    };
    depths_m.map(step).collect()
}
