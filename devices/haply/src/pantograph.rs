//! Kinematics of the five-bar linkage: position of the handle, and torques for a force.
//!
//! Two inner arms of length `l` turn about (0, 0) and (d, 0); two outer arms of length `L` join their ends `A` and `B` to
//! the handle `E`. With `u = E - A` and `w = E - B`, both of length `L`, moving the arms by `dθ` moves the handle so
//! that neither outer arm changes its length,
//!
//! ```text
//! u . (dE - A' dθ1) = 0,    w . (dE - B' dθ2) = 0
//! ```
//!
//! so `M dE = D dθ` with the rows `u`, `w` of `M` and `D = diag(u . A', w . B')`; and by virtual work the torques for a
//! force `F` on the hand are `τ = D y` with `Mᵀ y = F`: `y` are the axial forces of the outer arms, positive in
//! compression, divided by `L`.
//!
//! The frame is the board's: x to the left of the user, y towards the user, the motors at the far side.

use flotor_hal::glam::{DMat2, DVec2};
use flotor_hal::math;

/// Five-bar linkage with its lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pantograph {
    /// Length of the inner arms, from motor to elbow, m.
    pub inner_m: f64,
    /// Length of the outer arms, from elbow to handle, m.
    pub outer_m: f64,
    /// Distance between the motors, m.
    pub base_m: f64,
}

/// Solved posture of the linkage: position of the handle, with the matrices between torques and forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posture {
    handle_m: DVec2,
    /// Inverse of the transpose of `M`, 1/m.
    pulls_per_m: DMat2,
    /// The diagonal of `D`, m².
    levers_m2: DVec2,
}

/// Smallest sine of the angle between the outer arms; with a smaller sine the forces along the arms would be unbounded.
const LEAST_SINE: f64 = 0.05;

impl Pantograph {
    /// Solves for the posture at the arm angles, rad; `None` where the outer arms cannot meet, or are nearly parallel.
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn posture(&self, angles_rad: [f64; 2]) -> Option<Posture> {
        let [first, second] = angles_rad.map(DVec2::from_angle);
        let (a, b) = (first * self.inner_m, DVec2::X * self.base_m + second * self.inner_m);
        let across = b - a;
        let height_m = (self.outer_m * self.outer_m - 0.25 * across.length_squared()).sqrt();
        let handle_m = a + 0.5 * across + across.perp().normalize_or_zero() * height_m;
        let (u, w) = (handle_m - a, handle_m - b);
        let least_m2 = LEAST_SINE * self.outer_m * self.outer_m;
        // False for NaN, the result for arms that cannot meet.
        if u.perp_dot(w).abs() >= least_m2 {
            // Columns of the transpose are the rows.
            let pulls_per_m = DMat2::from_cols(u, w).inverse();
            let elbows = [first.perp(), second.perp()].map(|direction| direction * self.inner_m);
            let levers_m2 = DVec2::new(u.dot(elbows[0]), w.dot(elbows[1]));
            return Some(Posture { handle_m, pulls_per_m, levers_m2 });
        }
        None
    }

    /// Returns the angles of the arms, rad, for a position of the handle, m, elbows outwards; `None` outside the workspace. Not
    /// real-time: for emulators.
    #[must_use]
    pub fn angles_rad(&self, handle_m: DVec2) -> Option<[f64; 2]> {
        let angle = |from_motor: DVec2, side: f64| {
            let distance_m = from_motor.length();
            let (l, outer) = (self.inner_m, self.outer_m);
            let cosine = (l * l + distance_m * distance_m - outer * outer) / (2.0 * l * distance_m);
            (cosine.abs() <= 1.0).then(|| from_motor.to_angle() + side * math::acos(cosine))
        };
        Some([angle(handle_m, 1.0)?, angle(handle_m - DVec2::X * self.base_m, -1.0)?])
    }
}

impl Posture {
    /// Returns the position of the handle in the board's frame, m.
    #[must_use]
    pub fn handle_m(&self) -> DVec2 {
        self.handle_m
    }

    /// Returns the torques of the motors, N·m, that exert a force on the hand (N, board's frame). Real-time: bounded,
    /// no allocation.
    #[must_use]
    pub fn torques_nm(&self, force_n: DVec2) -> [f64; 2] {
        (self.levers_m2 * (self.pulls_per_m * force_n)).to_array()
    }

    /// Returns the force on the hand, N, in the board's frame, exerted by torques of the motors; not finite in a singular posture
    /// (inner and outer arm in line). Not real-time: for emulators.
    #[must_use]
    pub fn force_n(&self, torques_nm: [f64; 2]) -> DVec2 {
        self.pulls_per_m.inverse() * (DVec2::from_array(torques_nm) / self.levers_m2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LINKAGES: [Pantograph; 2] = [
        Pantograph { inner_m: 0.07, outer_m: 0.09, base_m: 0.0 },
        Pantograph { inner_m: 0.07, outer_m: 0.09, base_m: 0.038 },
    ];

    fn workspace() -> impl Strategy<Value = (Pantograph, DVec2)> {
        (0..2_usize, -0.05..0.05, 0.06..0.14).prop_map(|(version, x, y)| {
            let linkage = LINKAGES[version];
            (linkage, DVec2::new(0.5 * linkage.base_m + x, y))
        })
    }

    proptest! {
        #[test]
        fn angles_lead_back_to_the_handle((linkage, handle_m) in workspace()) {
            let posture = linkage.posture(linkage.angles_rad(handle_m).unwrap()).unwrap();
            prop_assert!((posture.handle_m() - handle_m).length() < 1.0e-12);
        }

        /// Virtual work: what the motors do is what the hand gets, whatever the motion. The derivative of the place of
        /// the handle is taken numerically, which knows nothing of how torques are found.
        #[test]
        fn torques_do_the_work_of_the_force((linkage, handle_m) in workspace(), fx in -3.0..3.0, fy in -3.0..3.0) {
            const STEP_RAD: f64 = 1.0e-6;
            let angles = linkage.angles_rad(handle_m).unwrap();
            let force_n = DVec2::new(fx, fy);
            let torques = linkage.posture(angles).unwrap().torques_nm(force_n);
            for arm in 0..2 {
                let at = |step: f64| {
                    let mut angles = angles;
                    angles[arm] += step;
                    linkage.posture(angles).unwrap().handle_m()
                };
                let moved_m_per_rad = (at(STEP_RAD) - at(-STEP_RAD)) / (2.0 * STEP_RAD);
                // Cubic terms of the motion over the step, and rounding of 0.1 m over it, are some 1e-10.
                prop_assert!((torques[arm] - force_n.dot(moved_m_per_rad)).abs() < 1.0e-8);
            }
            let back_n = linkage.posture(angles).unwrap().force_n(torques);
            prop_assert!((back_n - force_n).length() < 1.0e-9);
        }
    }

    #[test]
    fn a_symmetric_posture_is_the_one_of_the_textbook() {
        // Base zero, arms at 90° ± 30°: elbows 70 mm apart, the handle 60.6 mm + 82.9 mm away.
        let [first, second] = [120.0_f64, 60.0].map(f64::to_radians);
        let posture = LINKAGES[0].posture([first, second]).unwrap();
        let expected =
            DVec2::new(0.0, 0.07 * 60.0_f64.to_radians().sin() + (0.0081_f64 - 0.035 * 0.035).sqrt());
        assert!((posture.handle_m() - expected).length() < 1.0e-15, "{posture:?}");
        // A push straight out turns both arms towards each other, alike.
        let [t1, t2] = posture.torques_nm(DVec2::Y);
        assert!((t1 + t2).abs() < 1.0e-15 && t1 < 0.0, "{t1} {t2}");
    }

    #[test]
    fn arms_that_do_not_meet_or_are_stretched_out_have_no_posture() {
        let linkage = Pantograph { base_m: 0.2, ..LINKAGES[0] };
        let straight = std::f64::consts::FRAC_PI_2;
        assert!(linkage.posture([straight, straight]).is_none(), "elbows 200 mm apart, arms of 90 mm");
        assert!(LINKAGES[0].posture([straight, straight]).is_none(), "both elbows in one place");
        assert!(LINKAGES[0].posture([f64::NAN, 0.0]).is_none());
    }
}
