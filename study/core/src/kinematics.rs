//! Movement measures of an exploration, from vertical samples of handle and force: the measures that CMU-RI-TR-07-21 recorded at
//! 1000 Hz and analysed (section 4.3), and the stiffness actually presented.

use serde::{Deserialize, Serialize};

/// Sample of handle motion and force in the device frame, z up; the force acts on the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time since the previous sample, s.
    pub dt_s: f64,
    /// Height of the handle above home, m.
    pub z_m: f64,
    /// Vertical velocity of the handle, m/s.
    pub velocity_m_per_s: f64,
    /// Force on the hand along z, N.
    pub force_z_n: f64,
    /// Magnitude of the force on the hand, all three components, N.
    pub force_n: f64,
    /// True if the handle was out of its range.
    pub out_of_range: bool,
}

/// Movement measures of one stimulus.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StimulusKinematics {
    /// Duration of the exploration, s.
    pub duration_s: f64,
    /// Mean speed along the vertical, m/s.
    pub mean_speed_m_per_s: f64,
    /// Mean magnitude of the acceleration along the vertical, m/s².
    pub mean_acceleration_m_per_s2: f64,
    /// Mean magnitude of the vertical force on the hand, N.
    pub mean_force_n: f64,
    /// Largest magnitude of the force on the hand, N.
    pub peak_force_n: f64,
    /// Number of complete cycles, each one movement down and one up.
    pub cycles: u32,
    /// Stiffness felt by the hand: negative slope of the vertical force over the handle's height (least squares), N/m; positive
    /// for a spring, `None` if the standard deviation of the height is at most 0.05 mm.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub felt_stiffness_n_per_m: Option<f64>,
}

/// Dead band of the direction changes, m: above tremor (Stiles and Randall 1967: tenths of a millimetre), below the millimetres
/// of an exploration.
const SMALLEST_MOVEMENT_M: f64 = 0.5e-3;

/// Accumulator of movement measures, in constant memory.
#[derive(Clone, Debug, Default)]
pub struct KinematicsMeter {
    duration_s: f64,
    path_m: f64,
    turning_m_per_s: f64,
    impulse_ns: f64,
    peak_force_n: f64,
    /// True if the handle was out of its range in any sample so far.
    pub(crate) out_of_range: bool,
    last_velocity_m_per_s: Option<f64>,
    turns: Turns,
    line: Line,
}

impl KinematicsMeter {
    /// Adds a sample. A sample with a number that is not finite counts only for `out_of_range`.
    pub fn take(&mut self, sample: &Sample) {
        let Sample { dt_s, z_m, velocity_m_per_s, force_z_n, force_n, out_of_range } = *sample;
        self.out_of_range |= out_of_range;
        if !(dt_s + z_m + velocity_m_per_s + force_z_n + force_n).is_finite() {
            return;
        }
        self.duration_s += dt_s;
        self.path_m += velocity_m_per_s.abs() * dt_s;
        if let Some(last) = self.last_velocity_m_per_s.replace(velocity_m_per_s) {
            self.turning_m_per_s += (velocity_m_per_s - last).abs();
        }
        self.impulse_ns += force_z_n.abs() * dt_s;
        self.peak_force_n = self.peak_force_n.max(force_n);
        self.turns.take(z_m);
        self.line.take(z_m, force_z_n);
    }

    /// Returns the measures of the samples so far; `None` if they span no time.
    #[must_use]
    pub fn finish(&self) -> Option<StimulusKinematics> {
        let duration_s = self.duration_s;
        (duration_s > 0.0).then(|| StimulusKinematics {
            duration_s,
            mean_speed_m_per_s: self.path_m / duration_s,
            mean_acceleration_m_per_s2: self.turning_m_per_s / duration_s,
            mean_force_n: self.impulse_ns / duration_s,
            peak_force_n: self.peak_force_n,
            cycles: self.turns.count / 2,
            // A spring pushes up when the handle is down.
            felt_stiffness_n_per_m: self.line.slope().map(|slope| -slope),
        })
    }
}

/// Counter of direction changes, with a dead band.
#[derive(Clone, Debug, Default)]
struct Turns {
    /// Extreme position in the current direction, m.
    extreme_m: Option<f64>,
    /// Direction of the movement: 1 up, -1 down, 0 unknown.
    direction: f64,
    count: u32,
}

impl Turns {
    fn take(&mut self, z_m: f64) {
        let extreme_m = *self.extreme_m.get_or_insert(z_m);
        let way_m = z_m - extreme_m;
        if way_m * self.direction >= 0.0 && self.direction != 0.0 {
            self.extreme_m = Some(z_m);
        } else if way_m.abs() >= SMALLEST_MOVEMENT_M {
            self.count += u32::from(self.direction != 0.0);
            self.direction = way_m.signum();
            self.extreme_m = Some(z_m);
        }
    }
}

/// Slope of force over height by least squares, updated sample by sample (Welford 1962).
#[derive(Clone, Debug, Default)]
struct Line {
    count: f64,
    mean_z_m: f64,
    mean_force_n: f64,
    zz: f64,
    zf: f64,
}

impl Line {
    fn take(&mut self, z_m: f64, force_n: f64) {
        self.count += 1.0;
        let from_mean_m = z_m - self.mean_z_m;
        self.mean_z_m += from_mean_m / self.count;
        self.mean_force_n += (force_n - self.mean_force_n) / self.count;
        self.zz += from_mean_m * (z_m - self.mean_z_m);
        self.zf += from_mean_m * (force_n - self.mean_force_n);
    }

    /// Returns the slope, N/m; `None` if the height varied by less than a tenth of the dead band (standard deviation).
    fn slope(&self) -> Option<f64> {
        let deviation_m = (self.zz / self.count.max(1.0)).sqrt();
        (deviation_m > 0.1 * SMALLEST_MOVEMENT_M).then(|| self.zf / self.zz)
    }
}

#[cfg(test)]
mod tests;
