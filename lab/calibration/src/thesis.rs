//! Correction of the thesis, as a baseline (Varadharajan 2007, section 3.4 and appendix A).
//!
//! The thesis fits the excess of the sensor's reading over its mean by `p(z)` in N, z in mm, and multiplies the spring
//! force by `F / (F + p(z))`, where `F` is the feed-forward. As a ratio, `s(z) = 1 + p(z) / F`.

use flotor_hal::{InvalidCalibration, VerticalCalibration};

/// Coefficients of 1, z and z², z in mm, as printed in section 3.4, N.
pub const POLYNOMIAL_N_PER_MM: [f64; 3] = [0.191_57, -0.025_83, -0.004_51];

/// Feed-forward of the thesis's program, N (section 3.2 and appendix A).
pub const FEED_FORWARD_N: f64 = 7.7;

/// Half the height range of the thesis's measurement, m.
pub const HALF_STRETCH_M: f64 = 7.0e-3;

/// Returns the thesis's polynomial as a calibration of the total command at a feed-forward of `feed_forward_n`.
///
/// # Errors
/// [`InvalidCalibration`] if the feed-forward is too small for a valid curve.
pub fn calibration(feed_forward_n: f64) -> Result<VerticalCalibration, InvalidCalibration> {
    let [constant, linear, square] = POLYNOMIAL_N_PER_MM.map(|coefficient| coefficient / feed_forward_n);
    VerticalCalibration::new(
        [-HALF_STRETCH_M, HALF_STRETCH_M],
        &[1.0 + constant, linear * 1.0e3, square * 1.0e6],
    )
}

/// Returns the command of the thesis's program for a total force of `total_n`, N: the feed-forward without correction, plus
/// the corrected spring force.
#[must_use]
pub fn command_n(total_n: f64, height_m: f64) -> f64 {
    let z_mm = height_m * 1.0e3;
    let [constant, linear, square] = POLYNOMIAL_N_PER_MM;
    let excess_n = (square * z_mm + linear) * z_mm + constant;
    FEED_FORWARD_N + (total_n - FEED_FORWARD_N) * FEED_FORWARD_N / (FEED_FORWARD_N + excess_n)
}
