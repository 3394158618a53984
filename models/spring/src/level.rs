//! Bends a quantity off its course to a value it must not reach.
//!
//! Near buckling, formulas run into poles. A hard limit would put a kink into the energy and a step into the
//! stiffness; levelling off keeps it twice differentiable, so force *and* stiffness stay continuous.

/// A quantity after levelling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Levelled {
    pub(crate) value: f64,
    /// Derivative by the quantity before levelling.
    pub(crate) slope: f64,
    /// Whether it was bent off at all.
    pub(crate) bent: bool,
}

/// The quantity itself up to `knee`; with the excess `d` beyond it, `knee + d / sqrt(1 + (d / reach)²)`, which
/// stays below `knee + reach`. Real-time: bounded, no allocation.
#[inline]
pub(crate) fn level_above(quantity: f64, knee: f64, reach: f64) -> Levelled {
    let excess = quantity - knee;
    if excess <= 0.0 {
        return Levelled { value: quantity, slope: 1.0, bent: false };
    }
    let reached = excess / reach;
    let square = 1.0 / (1.0 + reached * reached);
    let root = square.sqrt();
    Levelled { value: knee + excess * root, slope: square * root, bent: true }
}

/// The mirror image of [`level_above`]: never below `knee - reach`.
#[inline]
pub(crate) fn level_below(quantity: f64, knee: f64, reach: f64) -> Levelled {
    let mirrored = level_above(-quantity, -knee, reach);
    Levelled { value: -mirrored.value, ..mirrored }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levelling_is_smooth_monotone_and_bounded() {
        let (knee, reach, h) = (8.75, 0.5, 1e-5);
        let mut last = f64::MIN;
        for step in 0..2000 {
            let x = 8.0 + 0.005 * f64::from(step);
            let here = level_above(x, knee, reach);
            assert!(here.value > last && here.value < knee + reach);
            last = here.value;
            let [up, down] = [h, -h].map(|offset| level_above(x + offset, knee, reach));
            // Central differences: h² times a third derivative of order 1 / reach².
            assert!(((up.value - down.value) / (2.0 * h) - here.slope).abs() < 1e-8, "value at {x}");
            // No step in the derivative: it changes by h times a bounded second derivative, at the knee too.
            assert!((up.slope - down.slope).abs() < 2.0 * h * 3.0 / reach, "slope at {x}");
            let mirrored = level_below(-x, -knee, reach);
            assert_eq!((mirrored.value, mirrored.slope), (-here.value, here.slope));
        }
        assert_eq!(level_above(8.0, knee, reach).value, 8.0);
        assert_eq!(level_above(f64::MAX, knee, reach).slope, 0.0);
    }
}
