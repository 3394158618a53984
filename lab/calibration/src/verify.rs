//! Unevenness of the vertical force: ratio of delivered to commanded force over the height; as reported by the
//! simulated device, over z = -7 mm to 7 mm, or as read by a force sensor.

use super::CalibrationError;
use super::procedure::Reading;
use super::rig::Rig;

/// Half the measured height range, m.
const HALF_STRETCH_M: f64 = 7.0e-3;
/// Distance between two heights, m; within it a typical calibration polynomial bends by less than 1e-4 of its value.
const STEP_M: f64 = 0.25e-3;
/// Number of steps to either side of the middle.
const STEPS: u32 = 28;

/// Commanded total vertical force of an error curve, N: between the two forces of a calibration. The ratios of
/// [`ErrorCurve::measure`] refer to this force.
pub const PROBE_N: f64 = 11.0;

/// Ratio of delivered to commanded force at heights from bottom to top.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorCurve {
    /// Height, m, and ratio of delivered to commanded force (1 without error).
    pub ratios: Vec<(f64, f64)>,
}

impl ErrorCurve {
    /// Number of heights at which [`Self::measure`] measures.
    pub const HEIGHTS: u64 = 2 * STEPS as u64 + 1;

    /// Measures the curve with the present calibration of the rig's device; `command_n` returns the command, N, for a
    /// height in m. All ratios refer to [`PROBE_N`], even if a correction changes the command. `stopped` is called after each
    /// height.
    ///
    /// # Errors
    /// [`CalibrationError`], from the rig.
    pub fn measure(
        rig: &mut impl Rig,
        command_n: &dyn Fn(f64) -> f64,
        mut stopped: impl FnMut(),
    ) -> Result<Self, CalibrationError> {
        let mut ratios = Vec::new();
        for step in 0..=2 * STEPS {
            let rest = rig.rest_at((f64::from(step) - f64::from(STEPS)) * STEP_M, command_n)?;
            ratios.push((rest.height_m, rest.delivered_n / PROBE_N));
            stopped();
        }
        Ok(Self { ratios })
    }

    /// Computes the curve from a force sensor's readings: at each stop, the mean height and the mean ratio of delivered force
    /// (measured force plus `weight_n`) to commanded force, over all forces, runs and repetitions. `weight_n`: weight of the moving
    /// part, N.
    #[must_use]
    pub fn of_readings(readings: &[Reading], weight_n: f64) -> Self {
        let mut stops: Vec<u32> = readings.iter().map(|reading| reading.stop).collect();
        stops.sort_unstable();
        stops.dedup();
        let mean = |stop: &u32| {
            let at_stop = || readings.iter().filter(|reading| reading.stop == *stop);
            let count = at_stop().count() as f64;
            let height_m = at_stop().map(|reading| reading.height_m).sum::<f64>() / count;
            let ratio = |reading: &Reading| (reading.force_n + weight_n) / reading.commanded_n;
            (height_m, at_stop().map(ratio).sum::<f64>() / count)
        };
        // From bottom to top, reversed: the sensor was lowered.
        Self { ratios: stops.iter().rev().map(mean).collect() }
    }

    /// Returns the difference between the largest and the smallest ratio, percent.
    #[must_use]
    pub fn error_percent(&self) -> f64 {
        let ratios = || self.ratios.iter().map(|(_, ratio)| *ratio);
        let (least, most) =
            (ratios().fold(f64::INFINITY, f64::min), ratios().fold(f64::NEG_INFINITY, f64::max));
        (most - least) * 100.0
    }
}

/// The steps cover the height range exactly.
const _: () = assert!(STEPS as f64 * STEP_M == HALF_STRETCH_M);
