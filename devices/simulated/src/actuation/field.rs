//! The uneven field: fraction of the commanded vertical force delivered at a height.
//!
//! The thesis weighed the vertical force over the height of the handle and fitted the excess by a polynomial,
//! `p(z) = -0.00451 z^2 - 0.02583 z + 0.1915` with z in mm (Varadharajan 2007, section 3.4 and appendix A). Its
//! *shape* is used here; its size is set so that delivered over commanded force, `1 + e(z)`, varies by 10.87 %
//! between its extremes over z = -7 mm to 7 mm, the error the thesis reports before calibration.

use crate::validation::{Check, Domain, number};

/// The thesis's polynomial: coefficients of z^2, z and 1, z in mm.
const POLYNOMIAL: [f64; 3] = [-0.004_51, -0.025_83, 0.1915];

/// Half the range over which the variation is measured, mm.
const HALF_STRETCH_MM: f64 = 7.0;

/// Limit of the height in the polynomial, mm, which was fitted to a little more than half of this range.
const RANGE_MM: f64 = 12.0;

/// Relative error of the vertical force: delivered over commanded force is one plus the error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldError {
    /// Difference between the largest and the smallest ratio over z = -7 mm to 7 mm (0.1087 is 10.87 %).
    pub peak_to_peak: f64,
}

impl FieldError {
    /// Error measured in the thesis.
    pub const THESIS: Self = Self { peak_to_peak: 0.1087 };

    /// Returns the ratio of delivered to commanded vertical force at a height of `z_m` above home; constant beyond ±12
    /// mm. Real-time: bounded, no allocation.
    #[must_use]
    pub fn delivered_share(&self, z_m: f64) -> f64 {
        let z_mm = (z_m * 1.0e3).clamp(-RANGE_MM, RANGE_MM);
        1.0 + self.peak_to_peak / VARIATION * polynomial(z_mm)
    }

    pub(super) fn check(&self) -> Check {
        number("field_error_percent", self.peak_to_peak, Domain::NotNegative)
    }
}

/// Variation of the polynomial over the range, peak to peak: from its vertex down to the farther end.
const VARIATION: f64 = {
    let vertex_mm = -POLYNOMIAL[1] / (2.0 * POLYNOMIAL[0]);
    polynomial(vertex_mm) - polynomial(HALF_STRETCH_MM)
};

const fn polynomial(z_mm: f64) -> f64 {
    let [square, linear, constant] = POLYNOMIAL;
    (square * z_mm + linear) * z_mm + constant
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_varies_by_what_is_set_over_fourteen_millimetres() {
        let shares = (-7000..=7000).map(|um| FieldError::THESIS.delivered_share(f64::from(um) * 1.0e-6));
        let (least, most) = shares.fold((f64::INFINITY, 0.0_f64), |(a, b), s| (a.min(s), b.max(s)));
        // Micrometre steps miss the vertex by at most 5e-7 mm^2 of curvature.
        assert!((most - least - 0.1087).abs() < 1.0e-8, "{}", most - least);
        assert_eq!(FieldError { peak_to_peak: 0.0 }.delivered_share(3.0e-3), 1.0);
    }

    #[test]
    fn the_shape_is_the_thesis_s() {
        let error = |z_mm: f64| FieldError::THESIS.delivered_share(z_mm * 1.0e-3) - 1.0;
        // Ratios do not depend on the scale: p(5) / p(0) and p(-5) / p(0).
        assert!((error(5.0) / error(0.0) - (-0.0504 / 0.1915)).abs() < 1.0e-10);
        assert!((error(-5.0) / error(0.0) - (0.2079 / 0.1915)).abs() < 1.0e-10);
    }
}
