//! How uneven the vertical force is: delivered over commanded, over the height; as the simulated device says it, over
//! z = -7 mm to 7 mm, or as a force sensor read it.

use super::CalibrationError;
use super::procedure::Reading;
use super::rig::Rig;

/// Half the stretch the error is measured over, m.
const HALF_STRETCH_M: f64 = 7.0e-3;
/// Distance of two heights, m; between them a polynomial of the sizes met here bends by less than 1e-4 of itself.
const STEP_M: f64 = 0.25e-3;
/// Number of steps to either side of the middle.
const STEPS: u32 = 28;

/// Total vertical force that is asked for, N: between the two a calibration measures.
pub const PROBE_N: f64 = 11.0;

/// Delivered over commanded force at heights from bottom to top.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorCurve {
    /// Height in m, and the ratio there.
    pub ratios: Vec<(f64, f64)>,
}

impl ErrorCurve {
    /// Number of heights.
    pub const HEIGHTS: u64 = 2 * STEPS as u64 + 1;

    /// Measures it with what the rig's device was calibrated with; `command_n` says what is commanded, N, for a
    /// height in m (usually [`PROBE_N`]). `stopped` is called after each height.
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

    /// What a force sensor read at each height, in the mean over forces, runs and readings; what moves weighs `weight_n`.
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
        // From the bottom to the top: the sensor was lowered.
        Self { ratios: stops.iter().rev().map(mean).collect() }
    }

    /// Difference of the largest and the smallest ratio, percent.
    #[must_use]
    pub fn error_percent(&self) -> f64 {
        let ratios = || self.ratios.iter().map(|(_, ratio)| *ratio);
        let (least, most) =
            (ratios().fold(f64::INFINITY, f64::min), ratios().fold(f64::NEG_INFINITY, f64::max));
        (most - least) * 100.0
    }
}

/// The stretch is what the steps cover.
const _: () = assert!(STEPS as f64 * STEP_M == HALF_STRETCH_M);
