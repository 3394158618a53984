//! Protection against a partner on another host whose force would drive the local handle out of the range of its
//! device.
//!
//! Even accepted energy may come from a partner with false claims, and a spring whose end is moved back and forth at
//! the right moments transfers that energy to the handle. So the position is extrapolated with the velocity: if it
//! leaves the range, no force acts outwards, and a damper slows the handle down. Inside the range both measures
//! dissipate energy. Hands do not move that fast near an edge.

use super::Reach;
use flotor_hal::{DVec3, DeviceState, Wrench, rotation_vector};

/// Time over which the position is extrapolated, s. A handle that moves straight outwards may cover the remaining
/// distance in that time; the damper, 50 N·s/m at 1 kHz, slows handle and hand (1.1 kg) to that speed with damping
/// ratio `sqrt(50 * 0.05 / (4 * 1.1)) = 0.75`.
const AHEAD_S: f64 = 0.05;
/// Mass and moment of inertia of the lightest handle and hand, kg and kg m²: the damper stops half of its motion in a period.
const LIGHTEST_KG: f64 = 0.1;
const LIGHTEST_KG_M2: f64 = 1.0e-4;

/// Brake for a handle that would leave the range of its device.
#[derive(Clone, Copy, Debug)]
pub(super) struct Brake {
    reach: Reach,
    damping_ns_per_m: f64,
    damping_nms_per_rad: f64,
}

impl Brake {
    /// Creates the brake of a device with this range. Not real-time.
    pub(super) fn new(reach: Reach, period_s: f64) -> Self {
        let half = 0.5 / period_s;
        Self { reach, damping_ns_per_m: half * LIGHTEST_KG, damping_nms_per_rad: half * LIGHTEST_KG_M2 }
    }

    /// Removes the outward part of a wrench (device frame) and adds damping, if the extrapolated pose is out of range;
    /// else returns the wrench unchanged. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn braked(&self, wrench: &Wrench, state: &DeviceState) -> Wrench {
        let Reach { range_m, range_rad } = self.reach;
        let turned = rotation_vector(state.pose.orientation());
        let (linear, angular) = (state.twist.linear(), state.twist.angular());
        let damping = [self.damping_ns_per_m, self.damping_nms_per_rad];
        Wrench::new(
            slowed(wrench.force(), state.pose.position(), linear, range_m, damping[0]),
            slowed(wrench.torque(), turned, angular, range_rad, damping[1]),
        )
    }
}

/// Returns the braked force at a position within an ellipsoid with the semi-axes `range`. An axis without a range (0)
/// is ignored.
#[inline]
fn slowed(force: DVec3, place: DVec3, speed: DVec3, range: [f64; 3], damping: f64) -> DVec3 {
    let range = DVec3::from_array(range);
    let inverse = DVec3::select(range.cmpgt(DVec3::ZERO), range.recip(), DVec3::ZERO);
    let ahead = place + speed * AHEAD_S;
    let part = (ahead * inverse).length();
    if part <= 1.0 {
        return force;
    }
    let edge = ahead / part;
    // Outward normal of the ellipsoid at `edge`. For a handle inside, the velocity along the normal is outwards, and
    // the damper only dissipates energy; for a handle outside, the damper also pushes back.
    let Some(outwards) = (edge * inverse * inverse).try_normalize() else { return force };
    let excess = outwards.dot(ahead - edge) / AHEAD_S;
    force - outwards * (outwards.dot(force).max(0.0) + damping * excess)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{Pose, Twist};

    const REACH: Reach = Reach { range_m: [0.0125, 0.0125, 0.0], range_rad: [0.1; 3] };

    fn left_of(force: DVec3, place: DVec3, speed: DVec3) -> DVec3 {
        let state = DeviceState {
            pose: Pose::new(place, Pose::HOME.orientation()),
            twist: Twist::new(speed, DVec3::ZERO),
            ..DeviceState::HOME
        };
        Brake::new(REACH, 1.0e-3).braked(&Wrench::from_force(force), &state).force()
    }

    #[test]
    fn a_handle_that_can_be_stopped_is_left_alone_and_another_is_only_slowed() {
        let (pull, place) = (DVec3::new(3.0, 1.0, 2.0), DVec3::X * 0.008);
        // A twentieth of a second of the way that is left: 20 / s * 4.5 mm = 0.09 m/s.
        for speed in [0.0, 0.089, -0.4] {
            assert_eq!(left_of(pull, place, DVec3::X * speed), pull, "{speed} m/s");
        }
        assert_eq!(left_of(pull, DVec3::ZERO, DVec3::X * 0.24), pull, "a range in a twentieth of a second");
        // Along the edge it is brought outside as well: sqrt(12.5² - 12²) = 3.5 mm in 50 ms.
        assert_eq!(left_of(pull, DVec3::X * 0.012, DVec3::Y * 0.069), pull);
        let (along, wanted) = (left_of(-pull, DVec3::X * 0.012, DVec3::Y * 0.2), -pull);
        assert!(along.x < wanted.x && along.y < wanted.y, "{along}");
        for speed in [0.091, 0.5, 2.0] {
            let left = left_of(pull, place, DVec3::X * speed);
            assert!(left.x < 0.0 && (left.y, left.z) == (1.0, 2.0), "{speed} m/s: {left}");
            let inwards = left_of(-pull, place, DVec3::X * speed);
            assert!(inwards.x < -3.0, "{speed} m/s: {inwards}");
        }
        // Nothing is known of an axis without a range; outside of the range no speed outwards is slow.
        assert_eq!(left_of(pull, DVec3::Z, DVec3::Z * 9.0), pull);
        assert!(left_of(pull, DVec3::Y * 0.02, DVec3::Y * 0.01).y < 0.0);
    }
}
