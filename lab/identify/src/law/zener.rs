//! Zener's standard linear solid.

use flotor_hal::math;

/// Returns the force, N, at each sample. The depth is linear in time between samples, for which the step of the Maxwell element
/// is exact; before the first sample the object is at rest.
pub(super) fn force_n(
    stiffness: f64,
    maxwell: f64,
    relaxation_s: f64,
    time_s: &[f64],
    depths_m: impl Iterator<Item = f64>,
) -> Vec<f64> {
    let mut element_n = 0.0;
    let mut before: Option<(f64, f64)> = None;
    // Reuse the exponentials: most measurements have one period.
    let (mut period_s, mut kept, mut gained) = (f64::NAN, 1.0, 1.0);
    let step = |(depth_m, time_s): (f64, &f64)| {
        if let Some((depth_before_m, time_before_s)) = before {
            let elapsed_s = time_s - time_before_s;
            if elapsed_s != period_s {
                period_s = elapsed_s;
                let ratio = elapsed_s / relaxation_s;
                kept = math::exp(-ratio);
                gained = if ratio > 1.0e-9 { -math::exp_m1(-ratio) / ratio } else { 1.0 };
            }
            element_n = kept * element_n + maxwell * gained * (depth_m - depth_before_m);
        }
        before = Some((depth_m, *time_s));
        stiffness * depth_m + element_n
    };
    depths_m.zip(time_s).map(step).collect()
}
