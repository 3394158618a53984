//! Quantiles of samples.

/// Sorts the samples and returns the quantile for the fraction `share`, 0 to 1, by linear interpolation (type 7 of
/// Hyndman and Fan, as in R and NumPy); NaN without samples. Not real-time.
pub fn quantile(samples: &mut [f64], share: f64) -> f64 {
    samples.sort_by(f64::total_cmp);
    let Some(last) = samples.len().checked_sub(1) else { return f64::NAN };
    let place = share.clamp(0.0, 1.0) * last as f64;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and the last index
    let below = place as usize;
    let low = samples.get(below).copied().unwrap_or(f64::NAN);
    let high = samples.get(below + 1).copied().unwrap_or(low);
    low + place.fract() * (high - low)
}
