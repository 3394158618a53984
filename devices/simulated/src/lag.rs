//! First-order lags: exponential approach to a constant input.

use flotor_hal::math;

/// First-order lag, for example of an amplifier, a warming coil or a low-pass filter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lag {
    lag_s: f64,
    /// Last time step, s, and the fraction of the step response reached in it, cached: ticks are mostly of equal
    /// length.
    dt_s: f64,
    closed: f64,
}

impl Lag {
    /// Creates a lag with the time constant `lag_s` (s, above zero). Real-time: bounded, no allocation.
    pub(crate) fn new(lag_s: f64) -> Self {
        Self { lag_s, dt_s: 0.0, closed: 0.0 }
    }

    /// Creates a low-pass filter with the corner frequency `bandwidth_hz` (Hz, above zero). Real-time: bounded, no
    /// allocation.
    pub(crate) fn of_bandwidth(bandwidth_hz: f64) -> Self {
        Self::new(1.0 / (std::f64::consts::TAU * bandwidth_hz))
    }

    /// Returns the fraction of the step response reached after `dt_s` (s), `1 - e^(-dt / lag)`, without cancellation
    /// for short times.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn closed(&mut self, dt_s: f64) -> f64 {
        if dt_s != self.dt_s {
            (self.dt_s, self.closed) = (dt_s, -math::exp_m1(-dt_s / self.lag_s));
        }
        self.closed
    }

    /// Returns the mean remaining difference from the input during `dt_s` (s), as a fraction of the initial difference.
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn mean_open(&mut self, dt_s: f64) -> f64 {
        if dt_s > 0.0 { self.lag_s / dt_s * self.closed(dt_s) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_closes_exponentially_whatever_time_was_asked_before() {
        let mut lag = Lag::new(2.0e-3);
        for dt_s in [1.0e-3, 2.0e-3, 1.0e-3, 0.0, 1.0e-3] {
            assert_eq!(lag.closed(dt_s), -(-dt_s / 2.0e-3_f64).exp_m1());
        }
        // The integral of e^(-t / lag) over dt, per dt.
        let expected = 2.0 * (1.0 - (-0.5_f64).exp());
        assert!((lag.mean_open(1.0e-3) - expected).abs() < 1.0e-15);
        assert_eq!(lag.mean_open(0.0), 1.0);
    }
}
