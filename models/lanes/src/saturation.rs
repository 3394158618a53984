//! Smooth (C2) saturation that limits a quantity below a pole.
//!
//! Near buckling, formulas have poles. A hard limit would put a kink into the energy and a step into the stiffness;
//! with smooth saturation the energy is twice differentiable, so force *and* stiffness are continuous.

use crate::Real;

/// Saturated quantity, with its derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saturated<R: Real = f64> {
    /// Quantity after saturation.
    pub value: R,
    /// Derivative of `value` with respect to the quantity before saturation.
    pub slope: R,
    /// True in the lanes in which the saturation changed the quantity.
    pub saturated: R::Mask,
}

/// Limits a quantity below `knee + reach`: unchanged up to `knee`, then `knee + d / sqrt(1 + (d / reach)²)` with the excess `d` of
/// the quantity over the knee. Real-time: bounded, no allocation.
#[inline(always)]
pub fn saturate_above<R: Real>(quantity: R, knee: f64, reach: f64) -> Saturated<R> {
    let saturated = quantity.above(knee);
    let unit = quantity.like(1.0);
    if !R::any(saturated) {
        return Saturated { value: quantity, slope: unit, saturated };
    }
    // Computes d / sqrt(1 + (d / reach)²), and its derivative (1 + (d / reach)²)^(-3/2).
    let excess = quantity - knee;
    let reached = excess * (1.0 / reach);
    let square = (reached * reached + 1.0).inverse();
    let root = square.sqrt();
    Saturated {
        value: R::select(saturated, excess * root + knee, quantity),
        slope: R::select(saturated, square * root, unit),
        saturated,
    }
}

/// Limits a quantity above `knee - reach`; the mirror image of [`saturate_above`]. Real-time: bounded, no allocation.
#[inline(always)]
pub fn saturate_below<R: Real>(quantity: R, knee: f64, reach: f64) -> Saturated<R> {
    let saturated = quantity.below(knee);
    if !R::any(saturated) {
        return Saturated { value: quantity, slope: quantity.like(1.0), saturated };
    }
    let mirrored = saturate_above(-quantity, -knee, reach);
    Saturated { value: -mirrored.value, ..mirrored }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saturation_is_smooth_monotone_and_bounded() {
        let (knee, reach, h) = (8.75, 0.5, 1e-5);
        let mut last = f64::MIN;
        for step in 0..2000 {
            let x = 8.0 + 0.005 * f64::from(step);
            let here = saturate_above(x, knee, reach);
            assert!(here.value > last && here.value < knee + reach);
            last = here.value;
            let [up, down] = [h, -h].map(|offset| saturate_above(x + offset, knee, reach));
            // Central differences: h² times a third derivative of order 1 / reach².
            assert!(((up.value - down.value) / (2.0 * h) - here.slope).abs() < 1e-8, "value at {x}");
            // No step in the derivative: it changes by h times a bounded second derivative, at the knee too.
            assert!((up.slope - down.slope).abs() < 2.0 * h * 3.0 / reach, "slope at {x}");
            let mirrored = saturate_below(-x, -knee, reach);
            assert_eq!((mirrored.value, mirrored.slope), (-here.value, here.slope));
        }
        assert_eq!(saturate_above(8.0, knee, reach).value, 8.0);
        assert_eq!(saturate_above(f64::MAX, knee, reach).slope, 0.0);
    }
}
