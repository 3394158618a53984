//! Measurement procedure: forces, heights, repetitions, readings.

use super::CalibrationError;
use super::rig::Rig;

/// Forces and heights of a procedure, in order of measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Commanded vertical forces, N; two or more, so that the weight can be separated from the field.
    pub forces_n: Vec<f64>,
    /// Number of runs over all heights for each force.
    pub runs: u32,
    /// Highest height, m; the sensor is lowered from there.
    pub top_m: f64,
    /// Distance between two heights, m.
    pub step_m: f64,
    /// Number of steps down.
    pub steps: u32,
    /// Number of readings of the force sensor at each height.
    pub readings: u32,
}

impl Plan {
    /// Returns the thesis's procedure (Varadharajan 2007, section 3.4): 10 N and 12 N, two runs each, 14 steps of 1 mm;
    /// here with ten readings at each height, a second of a slow force sensor.
    #[must_use]
    pub fn thesis() -> Self {
        Self { forces_n: vec![10.0, 12.0], runs: 2, top_m: 7.0e-3, step_m: 1.0e-3, steps: 14, readings: 10 }
    }

    /// Returns the heights from the top down, m.
    pub fn heights_m(&self) -> impl Iterator<Item = f64> + '_ {
        (0..=self.steps).map(|step| self.top_m - f64::from(step) * self.step_m)
    }

    /// Returns the number of stops of the sensor over all forces, runs and heights.
    #[must_use]
    pub fn stops(&self) -> u64 {
        self.forces_n.len() as u64 * u64::from(self.runs) * (u64::from(self.steps) + 1)
    }
}

/// Reading of the force sensor under a constant commanded force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Commanded vertical force, N, gravity compensation included.
    pub commanded_n: f64,
    /// Index of the run over all heights, from 0.
    pub run: u32,
    /// Index of the stop on the way down, from 0: readings of one stop are at the same height.
    pub stop: u32,
    /// Height of the handle as measured by the device, m.
    pub height_m: f64,
    /// Force of the handle on the sensor, N: delivered force less the weight of the moving part.
    pub force_n: f64,
}

/// Measures all readings of a plan; repeats the readings of a stop if the sensor moved during them. Calls `stopped`
/// after each stop. Not real-time.
///
/// # Errors
/// [`CalibrationError`], from the rig.
pub fn measure(
    rig: &mut impl Rig,
    plan: &Plan,
    mut stopped: impl FnMut(),
) -> Result<Vec<Reading>, CalibrationError> {
    let mut readings = Vec::new();
    for &commanded_n in &plan.forces_n {
        for run in 0..plan.runs {
            for (stop, target_m) in (0..).zip(plan.heights_m()) {
                let before = readings.len();
                loop {
                    let rest = rig.rest_at(target_m, &|_| commanded_n)?;
                    for _ in 0..plan.readings {
                        let force_n = rig.read_force_n(&rest)?;
                        readings.push(Reading { commanded_n, run, stop, height_m: rest.height_m, force_n });
                    }
                    if rig.still_rests(&rest)? {
                        break;
                    }
                    // The sensor moved during these readings, so their height is unknown.
                    readings.truncate(before);
                }
                stopped();
            }
        }
    }
    Ok(readings)
}
