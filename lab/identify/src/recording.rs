//! Measurement from a recording: the motion along one axis, and the force reported by the device or by a force sensor.
//!
//! The direction into the object is the direction in which the force grows, with a positive force on the object: a rendered model
//! and a real object under the handle thus give the same measurement.

use crate::measurement::{Measurement, MeasurementError, mean};
use flotor_record::{ReadError, Recording, Role, RunDescription};
use std::path::Path;

/// Plugin id of the force sensor; its force replaces that of the device.
const FORCE_SENSOR: &str = "force-sensor";

/// Axis of a recording's motion, in the device frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axis {
    /// To the right.
    X,
    /// Away from the user.
    Y,
    /// Up.
    #[default]
    Z,
}

/// Error of reading a measurement from a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Invalid samples.
    #[error("`{file}`: {cause}")]
    Samples {
        /// Path of the recording.
        file: String,
        /// Reason.
        cause: MeasurementError,
    },
}

/// Reads a recording. Not real-time.
///
/// # Errors
/// If the file cannot be read, or has no motion or no force along the axis.
pub fn read(path: &Path, axis: Axis) -> Result<Measurement, RecordingError> {
    let mut recording = Recording::open(path)?;
    let sensor = force_sensor(recording.run());
    let handle = u16::from(sensor == Some(0));
    let component = |vector: [f64; 3]| vector[axis as usize];
    let (mut time_s, mut position_m, mut force_n) = (Vec::new(), Vec::new(), Vec::new());
    for record in &mut recording {
        let record = record?;
        if record.device == handle {
            time_s.push(record.time_ns as f64 * 1.0e-9);
            position_m.push(component(record.pose.position_m));
            if sensor.is_none() {
                force_n.push(component(record.delivered.force_n));
            }
        }
        if Some(record.device) == sensor {
            // The sensor reports the force along its axis as z.
            force_n.push(record.delivered.force_n[2]);
        }
    }
    let (into, on) = directions(&position_m, &force_n);
    let samples = force_n.len().min(position_m.len());
    [&mut time_s, &mut position_m, &mut force_n].into_iter().for_each(|column| column.truncate(samples));
    position_m.iter_mut().for_each(|x| *x *= into);
    force_n.iter_mut().for_each(|force_n| *force_n *= on);
    Measurement::new(Some(time_s), position_m, force_n)
        .map_err(|cause| RecordingError::Samples { file: path.display().to_string(), cause })
}

/// Returns the index of the force sensor among the devices.
fn force_sensor(run: &RunDescription) -> Option<u16> {
    let devices = run.plugins.iter().filter(|plugin| plugin.role == Role::Device);
    devices.filter(|plugin| plugin.id == FORCE_SENSOR).map(|plugin| plugin.device).next()
}

/// Returns the signs that make displacements into the object, and forces on the object, positive.
fn directions(position_m: &[f64], force_n: &[f64]) -> (f64, f64) {
    let covariance = |forces: &[f64]| {
        let (x_mean, f_mean) = (mean(position_m), mean(forces));
        position_m.iter().zip(forces).map(|(x, f)| (x - x_mean) * (f - f_mean)).sum::<f64>()
    };
    let sizes: Vec<f64> = force_n.iter().map(|force_n| force_n.abs()).collect();
    let sign = |number: f64| if number < 0.0 { -1.0 } else { 1.0 };
    let into = sign(covariance(&sizes));
    (into, sign(into * covariance(force_n)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_push_is_positive_whatever_the_signs_of_the_device() {
        let position_m: Vec<f64> = (0..100).map(|index| f64::from(index) * 1.0e-4 - 5.0e-3).collect();
        let force_n: Vec<f64> = position_m.iter().map(|x| 800.0 * x.max(0.0)).collect();
        for (x_sign, f_sign) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
            let [x, f] = [(&position_m, x_sign), (&force_n, f_sign)]
                .map(|(values, sign)| values.iter().map(|value| sign * value).collect::<Vec<f64>>());
            assert_eq!(directions(&x, &f), (x_sign, f_sign));
        }
    }
}
