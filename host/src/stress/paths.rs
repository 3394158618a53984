//! Smooth closed motions of the handle: random Fourier series in position and rotation vector.

use super::poses::{Reach, at};
use crate::sampling::Random;
use flotor_hal::{DVec3, Pose, math};
use std::f64::consts::TAU;

/// Harmonics of a motion: enough to turn in every plane of the six dimensions at once.
const HARMONICS: usize = 3;

/// A closed motion; its parameter runs from 0 to 1.
pub(super) struct ClosedPath {
    position_m: Series,
    rotation_rad: Series,
}

struct Series {
    mean: DVec3,
    cosines: [DVec3; HARMONICS],
    sines: [DVec3; HARMONICS],
}

impl Series {
    /// Stays within `reach` along each axis: half of it for the mean, half for the swing.
    fn random(random: &mut Random, reach: f64) -> Self {
        let swing = 0.5 * reach / (HARMONICS as f64 * std::f64::consts::SQRT_2);
        Self {
            mean: random.vector() * (0.5 * reach),
            cosines: std::array::from_fn(|_| random.vector() * swing),
            sines: std::array::from_fn(|_| random.vector() * swing),
        }
    }

    fn value(&self, part: f64) -> DVec3 {
        let terms = self.cosines.iter().zip(&self.sines).enumerate();
        terms.fold(self.mean, |sum, (index, (cosine, sine))| {
            let angle = TAU * part * (index + 1) as f64;
            sum + *cosine * math::cos(angle) + *sine * math::sin(angle)
        })
    }

    /// Derivative by the parameter.
    fn slope(&self, part: f64) -> DVec3 {
        let terms = self.cosines.iter().zip(&self.sines).enumerate();
        terms.fold(DVec3::ZERO, |sum, (index, (cosine, sine))| {
            let rate = TAU * (index + 1) as f64;
            let angle = rate * part;
            sum + (*sine * math::cos(angle) - *cosine * math::sin(angle)) * rate
        })
    }
}

impl ClosedPath {
    /// A motion somewhere in the workspace.
    pub(super) fn random(random: &mut Random, reach: Reach) -> Self {
        Self {
            position_m: Series::random(random, reach.position_m),
            rotation_rad: Series::random(random, reach.rotation_rad),
        }
    }

    /// The same motion, moved so that it starts and ends at home. It keeps to the same reach.
    pub(super) fn starting_at_home(mut self) -> Self {
        for series in [&mut self.position_m, &mut self.rotation_rad] {
            series.mean = DVec3::ZERO;
            series.mean = -series.value(0.0);
        }
        self
    }

    pub(super) fn pose(&self, part: f64) -> Pose {
        at(self.position_m.value(part), self.rotation_rad.value(part))
    }

    /// Derivatives by the parameter: of the position (m), and of the rotation as the turn it makes (rad).
    pub(super) fn motion(&self, part: f64) -> (DVec3, DVec3) {
        let (rotation_rad, slope_rad) = (self.rotation_rad.value(part), self.rotation_rad.slope(part));
        (self.position_m.slope(part), turning(rotation_rad, slope_rad))
    }
}

/// Angular velocity of an orientation given by a rotation vector `r` that changes by `r'`: the left Jacobian
/// of the rotations, `r' + (1 - cos a)/a² r x r' + (a - sin a)/a³ r x (r x r')`.
fn turning(rotation_rad: DVec3, slope_rad: DVec3) -> DVec3 {
    let angle = rotation_rad.length();
    let square = angle * angle;
    // Below 1e-2 the closed forms cancel; the next terms of the series are under one rounding there.
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
    use flotor_hal::rotation_vector;

    #[test]
    fn the_turn_of_a_path_is_the_derivative_of_its_orientation() {
        for (seed, rotation_rad) in [(1, 0.1), (2, 1.0e-3), (3, 1.5)] {
            let path =
                ClosedPath::random(&mut Random::new(seed, 0), Reach { position_m: 0.01, rotation_rad });
            for index in 0..50 {
                let (part, step) = (f64::from(index) / 50.0, 1.0e-4);
                let turn = |half: f64| {
                    let later = path.pose(part + half).orientation()
                        * path.pose(part - half).orientation().conjugate();
                    rotation_vector(later) / (2.0 * half)
                };
                // Richardson: what is left is of fourth order in a step of 1e-3 rad.
                let seen = (turn(0.5 * step) * 4.0 - turn(step)) / 3.0;
                let (_, said) = path.motion(part);
                assert!((seen - said).length() < 1.0e-7 * rotation_rad, "{seen} {said}");
            }
        }
    }

    #[test]
    fn paths_keep_to_their_reach_and_close() {
        let reach = Reach { position_m: 0.02, rotation_rad: 0.1 };
        for seed in 0..20 {
            let path = ClosedPath::random(&mut Random::new(seed, 0), reach);
            for index in 0..100 {
                let pose = path.pose(f64::from(index) / 100.0);
                assert!(pose.position().abs().max_element() <= reach.position_m);
                assert!(
                    rotation_vector(pose.orientation()).abs().max_element() <= reach.rotation_rad + 1e-15
                );
            }
            assert!(path.starting_at_home().pose(1.0).position().length() < 1.0e-16);
        }
    }
}
