//! Kinematics of the delta linkage: three arms rotate in planes 120° apart; each carries the handle's platform by a
//! parallelogram.
//!
//! In the frame of one arm (u outwards from its axis, v along its axis, w along the handle's axis), with the angle θ of the
//! arm (Stamper 1997, and libnifalcon's numbers for the Falcon):
//!
//! ```text
//! u = x cos φ + y sin φ - r      v = -x sin φ + y cos φ - s      w = z
//! L = d + e + sqrt(b² - (v + f)²)                                   the parallelogram, seen from the side
//! g = (u + c - a cos θ)² + (w - a sin θ)² - L² = 0                  it joins elbow and platform
//! ```
//!
//! The angles for a position follow in closed form; the position for three angles is the root of the three `g`, by Newton's
//! method, to 1e-12 rad (1e-9 rad where rounding prevents more). With `G = ∂g/∂P` and `h = ∂g/∂θ`, `G dP + h dθ = 0`,
//! and by virtual work the torques for a force `F` on the hand are `τ = -h G⁻ᵀ F`.
//!
//! The frame is the maker's: x to the right, y up, z from the device towards the user.

use flotor_hal::glam::{DMat3, DVec3};
use flotor_hal::math;

/// Lengths of the linkage, m: arm, parallelogram, platform, its two joints, and offsets of the axes.
const A_M: f64 = 0.060;
const B_M: f64 = 0.1025;
const C_M: f64 = 0.01443;
const D_M: f64 = 0.01125;
const E_M: f64 = 0.01125;
const F_M: f64 = -0.025;
const R_M: f64 = 0.040;
const S_M: f64 = -0.02309;
/// Directions of the arms, degrees.
const ARMS_DEG: [f64; 3] = [105.0, -15.0, -135.0];

/// Centre of the handle's range in the maker's frame, m.
pub const CENTRE_M: DVec3 = DVec3::new(0.0, 0.0, 0.125);
/// Half the range along each axis, m.
pub const RANGE_M: f64 = 0.05;

/// Counts of an encoder per turn of its motor, gear ratio between motor and arm, and angle of an arm at zero counts.
const COUNTS_PER_TURN: f64 = 320.0 * 4.0;
const GEAR: f64 = 110.0 / 14.25;
const ZERO_DEG: f64 = 35.0;

/// Tolerance of Newton's method, rad.
const SOLVED_RAD: f64 = 1.0e-12;
/// Tolerance that is accepted after the last step, rad.
const ACCEPTED_RAD: f64 = 1.0e-9;
/// Limit on the steps of Newton's method: from the centre of the range four are enough anywhere.
const STEPS: u32 = 20;
/// Smallest lever of an arm, m; with smaller levers the forces would be unbounded.
const LEAST_LEVER_M: f64 = 1.0e-3;

/// Solved posture of the linkage: position of the handle, with its Jacobian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posture {
    position_m: DVec3,
    /// Jacobian of the position with respect to the angles, m/rad.
    jacobian: DMat3,
}

/// Returns the angles of the arms for encoder counts, rad. Real-time: bounded, no allocation.
#[must_use]
pub fn angles_rad(counts: [i16; 3]) -> DVec3 {
    let angle = |count: i16| (f64::from(count) * 360.0 / COUNTS_PER_TURN / GEAR + ZERO_DEG).to_radians();
    DVec3::from_array(counts.map(angle))
}

/// Returns the encoder counts nearest to angles of the arms, rad. Real-time: bounded, no allocation.
#[must_use]
pub fn counts(angles_rad: DVec3) -> [i16; 3] {
    angles_rad.to_array().map(|angle_rad| {
        let count = (angle_rad.to_degrees() - ZERO_DEG) * GEAR * COUNTS_PER_TURN / 360.0;
        #[allow(clippy::cast_possible_truncation)] // rounded, and saturated by the cast
        let count = count.round() as i16;
        count
    })
}

/// Returns the length of the arc at the end of an arm per encoder count, m.
#[must_use]
pub fn resolution_m() -> f64 {
    A_M * std::f64::consts::TAU / COUNTS_PER_TURN / GEAR
}

/// Returns sine and cosine of an arm's direction.
fn direction(arm: usize) -> (f64, f64) {
    math::sin_cos(ARMS_DEG.get(arm).copied().unwrap_or(0.0).to_radians())
}

/// Transforms a position into the frame of an arm.
fn in_arm(position_m: DVec3, (sine, cosine): (f64, f64)) -> DVec3 {
    let DVec3 { x, y, z } = position_m;
    DVec3::new(x * cosine + y * sine - R_M, y * cosine - x * sine - S_M, z)
}

/// Returns the angles of the arms, rad, for a position of the handle, m; `None` outside the reach of an arm. Real-time: bounded, no
/// allocation.
#[must_use]
pub fn inverse(position_m: DVec3) -> Option<DVec3> {
    let mut angles = [0.0; 3];
    for (arm, angle) in angles.iter_mut().enumerate() {
        let DVec3 { x: u, y: v, z: w } = in_arm(position_m, direction(arm));
        let aside = v + F_M;
        let length_m = D_M + E_M + (B_M * B_M - aside * aside).sqrt();
        let (along, distance_m) = (u + C_M, math::hypot(u + C_M, w));
        let cosine = (A_M * A_M + distance_m * distance_m - length_m * length_m) / (2.0 * A_M * distance_m);
        // False for NaN. Of both solutions, the elbow outside.
        let is_reached = cosine.abs() <= 1.0;
        if !is_reached {
            return None;
        }
        *angle = math::atan2(w, along) - math::acos(cosine);
    }
    Some(DVec3::from_array(angles))
}

/// Returns the residuals `g` of the three loop-closure equations, their Jacobian with respect to the position (one row
/// per arm), and their derivatives with respect to the arm angles.
fn closure(position_m: DVec3, angles_rad: DVec3) -> (DVec3, [DVec3; 3], DVec3) {
    let (mut g, mut rows, mut h) = ([0.0; 3], [DVec3::ZERO; 3], [0.0; 3]);
    let arms = g.iter_mut().zip(&mut rows).zip(&mut h).zip(angles_rad.to_array()).enumerate();
    for (arm, (((g, row), h), angle)) in arms {
        let (sine, cosine) = direction(arm);
        let DVec3 { x: u, y: v, z: w } = in_arm(position_m, (sine, cosine));
        let (sine_arm, cosine_arm) = math::sin_cos(angle);
        let (along, up, aside) = (u + C_M - A_M * cosine_arm, w - A_M * sine_arm, v + F_M);
        let side = (B_M * B_M - aside * aside).sqrt();
        let length = D_M + E_M + side;
        *g = along * along + up * up - length * length;
        let by_v = 2.0 * length * aside / side;
        *row = DVec3::new(2.0 * along * cosine - by_v * sine, 2.0 * along * sine + by_v * cosine, 2.0 * up);
        *h = 2.0 * A_M * (along * sine_arm - up * cosine_arm);
    }
    (g.into(), rows, h.into())
}

/// Solves for the posture at the arm angles, rad, by Newton's method with the initial guess `near_m`, m, usually the
/// previous position. `None` if the linkage does not close, or is near a singularity. Real-time: bounded, no
/// allocation.
#[must_use]
pub fn posture(angles_rad: DVec3, near_m: DVec3) -> Option<Posture> {
    let mut position_m = near_m;
    for _ in 0..STEPS {
        let (g, rows, h) = closure(position_m, angles_rad);
        // With shorter levers any position would pass as a solution. `h` is twice arm length times lever.
        if h.abs().min_element() < 2.0 * A_M * LEAST_LEVER_M {
            return None;
        }
        let by_position = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
        let inverse = by_position.inverse();
        if !inverse.is_finite() {
            return None;
        }
        let off_rad = (g / h).abs().max_element();
        if off_rad <= SOLVED_RAD {
            return Some(Posture { position_m, jacobian: inverse * DMat3::from_diagonal(-h) });
        }
        position_m -= inverse * g;
    }
    // Rounding prevented convergence to the last digits.
    let (g, rows, h) = closure(position_m, angles_rad);
    let inverse = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose().inverse();
    ((g / h).abs().max_element() <= ACCEPTED_RAD)
        .then(|| Posture { position_m, jacobian: inverse * DMat3::from_diagonal(-h) })
}

impl Posture {
    /// Returns the position of the handle, m, in the maker's frame.
    #[must_use]
    pub fn position_m(&self) -> DVec3 {
        self.position_m
    }

    /// Returns the torques of the arms, N·m, that exert a force on the hand (N, maker's frame); positive torques act
    /// towards larger angles. Real-time: bounded, no allocation.
    #[must_use]
    pub fn torques_nm(&self, force_n: DVec3) -> DVec3 {
        self.jacobian.transpose() * force_n
    }

    /// Returns the force on the hand, N, in the maker's frame, exerted by torques of the arms. Real-time: bounded, no
    /// allocation.
    #[must_use]
    pub fn force_n(&self, torques_nm: DVec3) -> DVec3 {
        self.jacobian.transpose().inverse() * torques_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Positions on a grid over the ellipsoid of the range.
    fn workspace(steps: i32) -> Vec<DVec3> {
        let along = move || (-steps..=steps).map(move |step| f64::from(step) / f64::from(steps));
        let cube = along().flat_map(|x| along().flat_map(move |y| along().map(move |z| DVec3::new(x, y, z))));
        cube.filter(|place| place.length() <= 1.0).map(|place| CENTRE_M + RANGE_M * place).collect()
    }

    #[test]
    fn the_handle_is_found_again_from_its_angles_all_over_the_range() {
        let places = workspace(20);
        let mut worst_m = 0.0_f64;
        for place_m in &places {
            let angles = inverse(*place_m).unwrap_or_else(|| panic!("no arm reaches {place_m}"));
            let found = posture(angles, CENTRE_M).unwrap_or_else(|| panic!("{place_m} is not found"));
            worst_m = worst_m.max((found.position_m() - *place_m).length());
        }
        println!("{} places, worst {worst_m:.2e} m", places.len());
        assert!(worst_m <= 1.0e-9);
    }

    /// Virtual work, with the derivative of the position taken numerically.
    #[test]
    fn torques_do_the_work_of_the_force() {
        const STEP_RAD: f64 = 1.0e-6;
        let force_n = DVec3::new(1.0, -2.0, 3.0);
        for place_m in workspace(3) {
            let angles = inverse(place_m).expect("it is in the range");
            let here = posture(angles, place_m).expect("it closes");
            let torques_nm = here.torques_nm(force_n);
            assert!((here.force_n(torques_nm) - force_n).length() < 1.0e-12);
            for (axis, torque_nm) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().zip(torques_nm.to_array()) {
                let at = |step: f64| posture(angles + axis * step, place_m).expect("it closes").position_m();
                let moved_m_per_rad = (at(STEP_RAD) - at(-STEP_RAD)) / (2.0 * STEP_RAD);
                // Cubic terms of the motion, and rounding of 0.1 m over the step, are some 1e-10.
                assert!((torque_nm - force_n.dot(moved_m_per_rad)).abs() < 1.0e-8, "{place_m}");
            }
        }
    }

    #[test]
    fn the_arms_are_alike_on_the_axis_and_turn_up_as_the_handle_comes_out() {
        let angle_deg = |z_m: f64| {
            let angles = inverse(DVec3::Z * z_m).expect("it is in the range");
            assert!((angles - DVec3::splat(angles.x)).length() < 1.0e-14, "{angles}");
            angles.x.to_degrees()
        };
        // By hand: u + c = -25.57 mm, v + f = -1.91 mm, so L = 124.982 mm; the law of cosines at 125 mm gives 27.7°.
        assert!((angle_deg(0.125) - 27.71).abs() < 0.02, "{}", angle_deg(0.125));
        assert!(angle_deg(0.10) < angle_deg(0.125) && angle_deg(0.125) < angle_deg(0.15));
        // A push towards the user turns all arms the same way.
        let posture = posture(inverse(CENTRE_M).expect("it is in the range"), CENTRE_M).expect("it closes");
        let torques = posture.torques_nm(DVec3::Z);
        assert!((torques - DVec3::splat(torques.x)).length() < 1.0e-12 && torques.x > 0.0, "{torques}");
    }

    #[test]
    fn counts_are_angles_and_what_cannot_be_has_no_posture() {
        for counts_there in [[0, 100, -1400], [1000, -1, 500]] {
            assert_eq!(counts(angles_rad(counts_there)), counts_there);
        }
        assert!((angles_rad([1, 0, 0]).x.to_degrees() - ZERO_DEG - 0.036_434).abs() < 1.0e-6);
        assert!((resolution_m() - 38.2e-6).abs() < 1.0e-7);
        assert!(posture(angles_rad([i16::MAX, i16::MIN, 0]), CENTRE_M).is_none());
        assert!(posture(DVec3::NAN, CENTRE_M).is_none() && posture(DVec3::ZERO, DVec3::NAN).is_none());
        assert!(inverse(DVec3::Z * 0.5).is_none() && inverse(DVec3::NAN).is_none());
    }
}
