//! Conversion of the true motion to the controller's sample: light spots, noise, quantisation, velocity, delay.
//!
//! Three light-emitting diodes on the flotor are imaged on three position cells of the frame. Each cell measures two
//! coordinates; the pose is computed iteratively from all six:
//!
//! - [`optics`]: layout of the diodes, light spots of a pose, pose from six spot coordinates.
//! - [`velocity`]: three estimators of velocity from a sequence of poses.
//!
//! The pose solver corrects none of these errors, like the solver of the real machine. Noise and quantisation step are
//! given as displacements of the diode; the lens scales them to the cell.

pub mod optics;
pub mod velocity;

use crate::hand::Pose;
use crate::lag::Lag;
use crate::noise::{Noise, Stream};
use crate::plant::State;
use crate::validation::{Check, Domain, InvalidParameter, number};
use flotor_hal::glam::DVec3;
use flotor_hal::restorable;
use optics::{Optics, OpticsGeometry, Spots};
use velocity::{Estimator, EstimatorKind, Velocity};

/// Number of stored samples: 64 ms at 10 kHz, the newest sample, and one more for a late sample.
const KEPT_SAMPLES: usize = 642;

/// Parameters of optics, cells, converters, delay and velocity estimation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensingParameters {
    /// Layout of diodes, lenses and cells.
    pub geometry: OpticsGeometry,
    /// Noise of each coordinate, root mean square at the diode, m.
    pub noise_m: f64,
    /// Quantisation step of the converters, at the diode, m; 0 for none.
    pub step_m: f64,
    /// Position error of a cell at its edge, as a fraction of its half width; grows with the cube of the distance from
    /// the centre.
    pub edge_nonlinearity: f64,
    /// Bandwidth of the cells with their amplifiers, Hz; 0 for no limit.
    pub bandwidth_hz: f64,
    /// Time between a sample and its arrival, ns; at most 640 ticks (64 ms at 10 kHz).
    pub latency_ns: u64,
    /// Velocity estimator.
    pub estimator: EstimatorKind,
}

impl SensingParameters {
    /// Parameters of the commercial device: quantisation of 2 µm (brochure); noise of 1 µm, edge error of 1 % and one tick of
    /// delay are usual for lateral-effect cells and a bus, not published. Velocity as in the University of Utah's control program:
    /// a low-pass filter of 200 Hz.
    pub const MAGLEV: Self = Self {
        geometry: OpticsGeometry::MAGLEV,
        noise_m: 1.0e-6,
        step_m: 2.0e-6,
        edge_nonlinearity: 0.01,
        bandwidth_hz: 0.0,
        latency_ns: 1_000_000,
        estimator: EstimatorKind::UTAH,
    };

    fn check(&self) -> Check {
        number("sensor_noise_um", self.noise_m, Domain::NotNegative)?;
        number("sensor_resolution_um", self.step_m, Domain::NotNegative)?;
        number("sensor_edge_percent", self.edge_nonlinearity, Domain::NotNegative)?;
        number("sensor_bandwidth_hz", self.bandwidth_hz, Domain::NotNegative)?;
        self.estimator.check()
    }
}

/// Sample that arrives at the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Sampling time, ns since the start of the run.
    pub taken_ns: u64,
    /// Estimated pose; `None` if a spot was outside its cell or the iteration failed.
    pub pose: Option<Pose>,
    /// Estimated velocity.
    pub velocity: Velocity,
}

restorable!(Sample { taken_ns, pose, velocity });

/// Sensor model of a running device: cells, converters, pose solver, velocity estimator, delay.
#[derive(Clone, Debug)]
pub struct Sensing {
    parameters: SensingParameters,
    optics: Optics,
    noise: Noise,
    estimator: Estimator,
    /// Last estimated pose, the initial guess of the next solve.
    found: Pose,
    bandwidth: Option<Lag>,
    /// Spots after the bandwidth limit; `None` before the first sample.
    slow_spots: Option<Spots>,
    /// Ring of the last samples.
    samples: [Sample; KEPT_SAMPLES],
    newest: usize,
}

restorable!(Sensing { noise, estimator, found, slow_spots, samples, newest } without {
    parameters, optics, bandwidth
});

impl Sensing {
    /// Creates the sensors; `start` is the initial guess of the pose solver and, with zero velocity, the value of all samples
    /// before the first. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a parameter is not physical or the diodes do not determine the pose (they stand in a line).
    pub fn new(parameters: &SensingParameters, seed: u64, start: &Pose) -> Result<Self, InvalidParameter> {
        parameters.check()?;
        let empty = Sample { taken_ns: 0, pose: Some(*start), velocity: Velocity::ZERO };
        Ok(Self {
            parameters: *parameters,
            optics: Optics::new(&parameters.geometry)?,
            noise: Noise::new(seed, Stream::Sensor),
            estimator: Estimator::new(parameters.estimator),
            bandwidth: (parameters.bandwidth_hz > 0.0).then(|| Lag::of_bandwidth(parameters.bandwidth_hz)),
            found: *start,
            slow_spots: None,
            samples: [empty; KEPT_SAMPLES],
            newest: 0,
        })
    }

    /// Takes a sample of the true state, `dt_s` (s) after the previous one. Real-time: bounded, no allocation.
    pub fn sample(&mut self, state: &State, taken_ns: u64, dt_s: f64) {
        let truth = Pose { position_m: state.position_m, orientation: state.orientation };
        let pose = self.measured_spots(&truth, dt_s).and_then(|spots| self.optics.find(&spots, &self.found));
        let velocity = match &pose {
            Some(pose) => {
                self.found = *pose;
                self.estimator.update(pose, dt_s)
            }
            None => self.estimator.restart(),
        };
        self.newest = (self.newest + 1) % self.samples.len();
        if let Some(slot) = self.samples.get_mut(self.newest) {
            *slot = Sample { taken_ns, pose, velocity };
        }
    }

    /// Splits the latency into whole ticks of `dt_ns` and the remainder, ns: the time between sampling and the end of
    /// the tick. Real-time: bounded, no allocation.
    #[must_use]
    pub fn latency(&self, dt_ns: u64) -> (usize, u64) {
        let (whole, rest_ns) = match dt_ns {
            0 => (0, 0),
            dt_ns => (self.parameters.latency_ns / dt_ns, self.parameters.latency_ns % dt_ns),
        };
        (usize::try_from(whole).unwrap_or(usize::MAX), rest_ns)
    }

    /// Returns the sample `age` ticks before the newest, at most the oldest stored sample. Real-time: bounded, no
    /// allocation.
    #[must_use]
    pub fn arrived(&self, age: usize) -> Sample {
        let length = self.samples.len();
        let age = age.min(length - 1);
        let index = (self.newest + length - age) % length;
        self.samples.get(index).copied().unwrap_or(Sample {
            taken_ns: 0,
            pose: None,
            velocity: Velocity::ZERO,
        })
    }

    /// Returns true if the noise is at least one quantisation step, so that almost every sample differs. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn is_noisy(&self) -> bool {
        let SensingParameters { noise_m, step_m, .. } = self.parameters;
        noise_m > 0.0 && noise_m >= step_m
    }

    /// Returns the six coordinates after the converters; `None` if a spot is outside its cell.
    fn measured_spots(&mut self, truth: &Pose, dt_s: f64) -> Option<Spots> {
        let mut spots = self.optics.spots(truth)?;
        if let Some(bandwidth) = &mut self.bandwidth {
            let (slow, share) = (self.slow_spots.get_or_insert(spots), bandwidth.closed(dt_s));
            slow.across_m += (spots.across_m - slow.across_m) * share;
            slow.up_m += (spots.up_m - slow.up_m) * share;
            spots = *slow;
        }
        if self.parameters.edge_nonlinearity > 0.0 {
            spots = self.optics.bent(&spots, self.parameters.edge_nonlinearity);
        }
        let magnification = self.optics.magnification();
        if self.parameters.noise_m > 0.0 {
            let deviation_m = self.parameters.noise_m * magnification;
            let [a, b] = self.noise.normal_pair();
            let [c, d] = self.noise.normal_pair();
            let [e, f] = self.noise.normal_pair();
            spots.across_m += DVec3::new(a, c, e) * deviation_m;
            spots.up_m += DVec3::new(b, d, f) * deviation_m;
        }
        if self.parameters.step_m > 0.0 {
            let step_m = self.parameters.step_m * magnification;
            let rounded = |spots: DVec3| (spots / step_m).map(nearest_whole) * step_m;
            spots = Spots { across_m: rounded(spots.across_m), up_m: rounded(spots.up_m) };
        }
        Some(spots)
    }
}

/// Returns the nearest integer, for magnitudes below 2^51: adding and subtracting a number with a spacing of 1 rounds in
/// two instructions, as the processor's rounding instruction is not available in every build.
fn nearest_whole(number: f64) -> f64 {
    const STEPS_OF_ONE: f64 = 1.5 * (1_u64 << 52) as f64;
    (number + STEPS_OF_ONE) - STEPS_OF_ONE
}

impl Pose {
    /// Returns the small rotation from this orientation to `other`, rad, device frame.
    pub(crate) fn rotation_to(&self, other: &Self) -> DVec3 {
        flotor_hal::rotation_vector(other.orientation * self.orientation.conjugate())
    }
}

#[cfg(test)]
mod tests;
