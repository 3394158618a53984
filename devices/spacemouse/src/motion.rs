//! Motion of the handle from the deflection of the puck.
//!
//! Rate control: the velocity of the pose is proportional to the deflection beyond a dead zone, which suppresses the
//! noise of a released puck. Position and rotation are limited to a ball each; at its surface the motion continues
//! along the surface.

use crate::report::{FULL_DEFLECTION, Report};
use flotor_hal::{DQuat, DVec3, Pose, Twist, orientation_from_rotation_vector, rotation_vector};

/// Gains and limits of the conversion from deflection to motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Speed at full deflection, m/s.
    pub speed_m_per_s: f64,
    /// Angular speed at full deflection, rad/s.
    pub spin_rad_per_s: f64,
    /// Dead zone, as a fraction of the full deflection.
    pub dead_zone: f64,
    /// Limit on the distance from home, m.
    pub range_m: f64,
    /// Limit on the rotation from home, rad.
    pub range_rad: f64,
}

/// Deflection of the puck, as fractions of full deflection along and about the axes of the host's frame (x right, y
/// away from the user, z up), -1 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deflection {
    translation: DVec3,
    rotation: DVec3,
}

impl Deflection {
    /// Updates the deflection from a report; a report of buttons changes nothing. Real-time: bounded, no allocation.
    pub fn update(&mut self, report: &Report) {
        match report {
            Report::Translation(axes) => self.translation = share(*axes),
            Report::Rotation(axes) => self.rotation = share(*axes),
            Report::Motion { translation, rotation } => {
                (self.translation, self.rotation) = (share(*translation), share(*rotation));
            }
            Report::Buttons(_) | Report::Other => {}
        }
    }
}

/// Converts readings of the puck (y towards the user, z down) to fractions of full deflection in the host's frame,
/// rotated by half a turn about x; rotations likewise.
fn share([x, y, z]: [i16; 3]) -> DVec3 {
    let full = f64::from(FULL_DEFLECTION);
    let share = DVec3::new(f64::from(x), -f64::from(y), -f64::from(z)) / full;
    share.clamp(DVec3::splat(-1.0), DVec3::splat(1.0))
}

/// Motion requested in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotionRequest {
    /// Motion at the velocity set by the deflection.
    Follow(Deflection),
    /// Motion to home at the speed of full deflection.
    Home,
}

/// Pose of the handle, moved by the puck; at home by default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    position_m: DVec3,
    orientation: DQuat,
}

impl Default for Motion {
    fn default() -> Self {
        Self { position_m: DVec3::ZERO, orientation: DQuat::IDENTITY }
    }
}

impl Motion {
    /// Advances the pose by `dt_s` (s); returns the velocity of the actual motion, limits included, m/s and rad/s.
    /// Real-time: bounded, no allocation.
    pub fn advance(&mut self, request: &MotionRequest, gains: &Gains, dt_s: f64) -> Twist {
        if dt_s <= 0.0 {
            return Twist::ZERO;
        }
        let before = *self;
        let rotation_rad = rotation_vector(self.orientation);
        match request {
            MotionRequest::Follow(deflection) => {
                let velocity = gains.past_dead_zone(deflection.translation) * gains.speed_m_per_s;
                let spin = gains.past_dead_zone(deflection.rotation) * gains.spin_rad_per_s;
                self.position_m = (self.position_m + velocity * dt_s).clamp_length_max(gains.range_m);
                let turned = orientation_from_rotation_vector(spin * dt_s) * self.orientation;
                let limited_rad = rotation_vector(turned).clamp_length_max(gains.range_rad);
                self.orientation = orientation_from_rotation_vector(limited_rad);
            }
            MotionRequest::Home => {
                self.position_m = towards_zero(self.position_m, gains.speed_m_per_s * dt_s);
                let left_rad = towards_zero(rotation_rad, gains.spin_rad_per_s * dt_s);
                self.orientation = orientation_from_rotation_vector(left_rad);
            }
        }
        let turned_rad = rotation_vector(self.orientation * before.orientation.inverse());
        Twist::new((self.position_m - before.position_m) / dt_s, turned_rad / dt_s)
    }

    /// Returns the pose of the handle. Real-time: bounded, no allocation.
    pub fn pose(&self) -> Pose {
        Pose::new(self.position_m, self.orientation)
    }
}

impl Gains {
    /// Scales each axis from 0 at the edge of the dead zone to 1 at full deflection.
    fn past_dead_zone(&self, share: DVec3) -> DVec3 {
        let beyond = (share.abs() - self.dead_zone).max(DVec3::ZERO) / (1.0 - self.dead_zone);
        beyond * share.signum()
    }
}

fn towards_zero(from: DVec3, step: f64) -> DVec3 {
    let length = from.length();
    if length <= step { DVec3::ZERO } else { from * ((length - step) / length) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GAINS: Gains =
        Gains { speed_m_per_s: 0.02, spin_rad_per_s: 0.5, dead_zone: 0.1, range_m: 0.01, range_rad: 0.1 };

    fn pushed(translation: [i16; 3], rotation: [i16; 3]) -> MotionRequest {
        let mut deflection = Deflection::default();
        deflection.update(&Report::Motion { translation, rotation });
        MotionRequest::Follow(deflection)
    }

    #[test]
    fn full_deflection_is_full_speed_along_the_axis_of_the_host() {
        let cases = [([350, 0, 0], DVec3::X), ([0, 350, 0], DVec3::NEG_Y), ([0, 0, 350], DVec3::NEG_Z)];
        for (axes, direction) in cases {
            let mut motion = Motion::default();
            let twist = motion.advance(&pushed(axes, [0; 3]), &GAINS, 0.001);
            assert!((twist.linear() - direction * 0.02).length() < 1.0e-12, "{axes:?}: {twist:?}");
            let twist = motion.advance(&pushed([0; 3], axes), &GAINS, 0.001);
            assert!((twist.angular() - direction * 0.5).length() < 1.0e-9, "{axes:?}: {twist:?}");
        }
    }

    #[test]
    fn a_hand_that_is_off_and_a_puck_that_is_noisy_leave_it_where_it_is() {
        let mut motion = Motion::default();
        motion.advance(&pushed([350, 0, 0], [0; 3]), &GAINS, 0.1);
        let there = motion;
        for _ in 0..1000 {
            assert_eq!(motion.advance(&pushed([35, -35, 20], [-35, 1, 0]), &GAINS, 0.001), Twist::ZERO);
        }
        assert_eq!(motion.pose().position(), there.pose().position());
    }

    #[test]
    fn home_is_reached_at_full_speed_and_kept() {
        let mut motion = Motion::default();
        motion.advance(&pushed([350, -350, 0], [0, 0, 350]), &GAINS, 0.2);
        let far_m = motion.pose().position().length();
        let twist = motion.advance(&MotionRequest::Home, &GAINS, 0.001);
        assert!((twist.linear().length() - 0.02).abs() < 1.0e-12 && far_m > 0.004);
        for _ in 0..1000 {
            motion.advance(&MotionRequest::Home, &GAINS, 0.001);
        }
        assert_eq!(motion, Motion::default());
    }

    proptest! {
        /// Wherever it is pushed for however long: finite, inside its range, no faster than its speed on each axis,
        /// and a unit quaternion.
        #[test]
        fn it_stays_inside(
            pushes in prop::collection::vec((any::<[i16; 3]>(), any::<[i16; 3]>(), 0.0..0.05), 1..200)
        ) {
            let mut motion = Motion::default();
            for (translation, rotation, dt_s) in pushes {
                let twist = motion.advance(&pushed(translation, rotation), &GAINS, dt_s);
                let pose = motion.pose();
                prop_assert!(twist.is_finite() && pose.is_finite());
                prop_assert!(pose.position().length() <= 0.01 * (1.0 + 1.0e-12));
                prop_assert!(rotation_vector(pose.orientation()).length() <= 0.1 * (1.0 + 1.0e-12));
                prop_assert!((pose.orientation().length() - 1.0).abs() < 1.0e-12);
                prop_assert!(twist.linear().length() <= 0.02 * 3.0_f64.sqrt() * (1.0 + 1.0e-9));
            }
        }
    }
}
