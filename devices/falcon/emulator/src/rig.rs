//! Emulated device in the rig for vertical calibration: a stand holds the handle, the motors deliver more or less force than
//! commanded, and a force sensor measures the delivered force less the weight of handle, plate and screws.

use crate::in_process::InProcess;
use crate::machine::{Machine, Motion, Power};
use flotor_emulation::rig::{Stand, serve};
use flotor_hal::VerticalCalibration;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Ratio of delivered to commanded force: `1.04 - 0.004 z - 0.0006 z²`, z in mm; an arbitrary curve of this rig.
const SHARE_PER_M: [f64; 3] = [1.04, -4.0, -600.0];
/// Domain of the curve, m: the travel of the stand. Beyond, the ratio is constant.
const RANGE_M: [f64; 2] = [-7.0e-3, 7.0e-3];
/// Weight of handle, plate and screws on the arms, N; an arbitrary value.
pub const WEIGHT_N: f64 = 1.5;

/// Difference between the largest and the smallest ratio over the range, percent: `1.04 + 0.004²/(4 0.0006)` at -3.33
/// mm, less 0.9826 at 7 mm.
pub const ERROR_PERCENT: f64 = 6.406_666_7;

/// Creates a device in the rig and starts its force sensor at a pseudo terminal, to which `link` points; returns the
/// device and the path of the terminal.
///
/// # Errors
/// If the pseudo terminal, the link or the thread of the sensor cannot be created.
pub fn device_on(stand: Stand, link: &Path, power: Power) -> Result<(InProcess, PathBuf), Box<dyn Error>> {
    let mut machine = Machine::new(power, Motion::OnStand(stand));
    machine.delivers(VerticalCalibration::new(RANGE_M, &SHARE_PER_M)?);
    let device = InProcess::new(machine);
    let felt = device.clone();
    // No force without a posture of the arms.
    let force_n = move || felt.machine().force_n(felt.now()).map_or(0.0, |force_n| force_n.y) - WEIGHT_N;
    let name = serve(link, force_n)?;
    Ok((device, name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_the_one_that_is_told() {
        let share = VerticalCalibration::new(RANGE_M, &SHARE_PER_M).expect("it is a calibration");
        let shares = || (-7000..=7000).map(|um| share.share(f64::from(um) * 1.0e-6));
        let (least, most) = (shares().fold(f64::INFINITY, f64::min), shares().fold(0.0, f64::max));
        // A micrometre beside the largest is 6e-10 less.
        assert!(((most - least) * 100.0 - ERROR_PERCENT).abs() < 1.0e-6, "{least} {most}");
    }
}
