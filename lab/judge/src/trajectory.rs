//! Smooth motions of a handle: sums of sines in position and rotation vector.

use crate::sampling::Random;
use flotor_hal::{DVec3, Pose, math, orientation_from_rotation_vector, rotation_vector};
use std::array::from_fn;
use std::f64::consts::{SQRT_2, TAU};

/// Number of harmonics of a random motion: enough to turn in every plane of the six dimensions at once.
const HARMONICS: usize = 3;

/// Returns the pose at a position, m, and a rotation vector, rad.
pub fn at(position_m: DVec3, rotation_rad: DVec3) -> Pose {
    Pose::new(position_m, orientation_from_rotation_vector(rotation_rad))
}

/// Quantises a pose like a sensor with these steps (m, rad); zero steps leave it unchanged.
pub fn sensed(pose: Pose, quantum_m: f64, quantum_rad: f64) -> Pose {
    let step = |vector: DVec3, quantum: f64| match quantum > 0.0 {
        true => (vector / quantum).round() * quantum,
        false => vector,
    };
    at(step(pose.position(), quantum_m), step(rotation_vector(pose.orientation()), quantum_rad))
}

/// Motion over a parameter: a time, or the fraction of a lap.
pub struct Trajectory {
    /// Position, m.
    pub position: Series,
    /// Rotation vector, rad.
    pub rotation: Series,
}

/// Sum of a mean and sines, for three coordinates.
pub struct Series {
    /// Mean of the coordinates, in the unit of the series.
    pub mean: DVec3,
    terms: Vec<Term>,
    /// Angle per rate and parameter, rad: 1 for angular frequencies over time, 2π for whole periods per lap.
    scale: f64,
}

/// Sine and cosine amplitudes of each coordinate.
struct Term {
    rate: DVec3,
    sine: DVec3,
    cosine: DVec3,
}

impl Series {
    /// Creates a sine in each coordinate, of these amplitudes and angular frequencies, about zero.
    #[must_use]
    pub fn sines(sine: DVec3, rate: DVec3) -> Self {
        Self { mean: DVec3::ZERO, terms: vec![Term { rate, sine, cosine: DVec3::ZERO }], scale: 1.0 }
    }

    /// Creates an ellipse over 0 to 1, of a cosine and a sine of these amplitudes.
    #[must_use]
    pub fn ellipse(mean: DVec3, cosine: DVec3, sine: DVec3) -> Self {
        Self { mean, terms: vec![Term { rate: DVec3::ONE, sine, cosine }], scale: TAU }
    }

    /// Draws a closed motion within `reach` along each axis: half for the mean, half for the oscillation.
    fn random(random: &mut Random, reach: f64) -> Self {
        let swing = 0.5 * reach / (HARMONICS as f64 * SQRT_2);
        let mean = random.vector() * (0.5 * reach);
        let cosines: [DVec3; HARMONICS] = from_fn(|_| random.vector() * swing);
        let term = |(index, cosine)| {
            let rate = DVec3::splat((index + 1) as f64);
            Term { rate, cosine, sine: random.vector() * swing }
        };
        Self { mean, terms: cosines.into_iter().enumerate().map(term).collect(), scale: TAU }
    }

    /// Returns the value, and its derivative with respect to the parameter.
    fn at(&self, parameter: f64) -> (DVec3, DVec3) {
        let terms = self.terms.iter();
        terms.fold((self.mean, DVec3::ZERO), |(sum, slope), Term { rate, sine, cosine }| {
            let angles = *rate * (self.scale * parameter);
            let (sines, cosines) = (angles.map(math::sin), angles.map(math::cos));
            let slope = slope + (*sine * cosines - *cosine * sines) * (*rate * self.scale);
            (sum + *cosine * cosines + *sine * sines, slope)
        })
    }
}

impl Trajectory {
    /// Draws a closed motion over 0 to 1, within limits along each axis, m and rad.
    #[must_use]
    pub fn random(random: &mut Random, [position_m, rotation_rad]: [f64; 2]) -> Self {
        let position = Series::random(random, position_m);
        Self { position, rotation: Series::random(random, rotation_rad) }
    }

    /// Returns the pose at a parameter.
    pub fn pose(&self, parameter: f64) -> Pose {
        self.at(parameter).0
    }

    /// Returns the pose with derivatives with respect to the parameter: of the position, m, and of the rotation as an angular
    /// velocity, rad.
    pub fn at(&self, parameter: f64) -> (Pose, DVec3, DVec3) {
        let (position_m, shift_m) = self.position.at(parameter);
        let (rotation_rad, slope_rad) = self.rotation.at(parameter);
        (at(position_m, rotation_rad), shift_m, turning(rotation_rad, slope_rad))
    }
}

/// Returns the angular velocity of an orientation given by a rotation vector `r` that changes by `r'`: the left
/// Jacobian of the rotations, `r' + (1 - cos a)/a² r x r' + (a - sin a)/a³ r x (r x r')`.
fn turning(rotation_rad: DVec3, slope_rad: DVec3) -> DVec3 {
    let angle = rotation_rad.length();
    let square = angle * angle;
    // Below 1e-2 the closed forms cancel; the omitted terms of the series are below rounding there.
    let (first, second) = if angle < 1.0e-2 {
        (0.5 - square / 24.0 * (1.0 - square / 30.0), 1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0))
    } else {
        ((1.0 - math::cos(angle)) / square, (angle - math::sin(angle)) / (square * angle))
    };
    let across = rotation_rad.cross(slope_rad);
    slope_rad + across * first + rotation_rad.cross(across) * second
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_turn_of_a_path_is_the_derivative_of_its_orientation() {
        for (seed, rotation_rad) in [(1, 0.1), (2, 1.0e-3), (3, 1.5)] {
            let path = Trajectory::random(&mut Random::new(seed, 0), [0.01, rotation_rad]);
            for index in 0..50 {
                let (part, step) = (f64::from(index) / 50.0, 1.0e-4);
                let turn = |half: f64| {
                    let later = path.pose(part + half).orientation()
                        * path.pose(part - half).orientation().conjugate();
                    rotation_vector(later) / (2.0 * half)
                };
                // Richardson: what is left is of fourth order in a step of 1e-3 rad.
                let seen = (turn(0.5 * step) * 4.0 - turn(step)) / 3.0;
                let (_, _, said) = path.at(part);
                assert!((seen - said).length() < 1.0e-7 * rotation_rad, "{seen} {said}");
            }
        }
    }

    #[test]
    fn paths_keep_to_their_reach_and_close() {
        let [position_m, rotation_rad] = [0.02, 0.1];
        for seed in 0..20 {
            let path = Trajectory::random(&mut Random::new(seed, 0), [position_m, rotation_rad]);
            for index in 0..100 {
                let pose = path.pose(f64::from(index) / 100.0);
                assert!(pose.position().abs().max_element() <= position_m);
                assert!(rotation_vector(pose.orientation()).abs().max_element() <= rotation_rad + 1e-15);
            }
            assert!(path.pose(1.0).position().distance(path.pose(0.0).position()) < 1.0e-14 * position_m);
        }
    }
}
