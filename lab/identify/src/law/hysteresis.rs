//! Prandtl's element: a spring in series with a dry friction.

/// Returns the force, N, at each sample; the element has no force before the first sample, and follows the smoothed depths.
pub(super) fn force_n(
    stiffness: f64,
    sticking: f64,
    friction_n: f64,
    depths_m: impl Iterator<Item = f64>,
    smooth_m: impl Iterator<Item = f64>,
) -> Vec<f64> {
    let (mut element_n, mut before_m) = (0.0_f64, None);
    let step = |(depth_m, smooth_m): (f64, f64)| {
        let moved_m = before_m.map_or(0.0, |before_m| smooth_m - before_m);
        before_m = Some(smooth_m);
        element_n = (element_n + sticking * moved_m).clamp(-friction_n, friction_n);
        stiffness * depth_m + element_n
    };
    depths_m.zip(smooth_m).map(step).collect()
}
