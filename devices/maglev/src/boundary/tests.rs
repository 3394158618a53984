//! Walls: start, direction of the force, and damping that acts once.

use super::{THESIS_ANGLE_LIMIT_RAD, Wall, Walls};
use flotor_hal::{DQuat, DVec3, DeviceState, Pose, SampledLoop, Twist};

fn state(position: DVec3, velocity: DVec3, turn: DVec3, spin: DVec3) -> DeviceState {
    DeviceState {
        pose: Pose::new(position, DQuat::from_scaled_axis(turn)),
        twist: Twist::new(velocity, spin),
        ..DeviceState::HOME
    }
}

#[test]
fn inside_there_is_nothing() {
    let walls = Walls::maker(11.0e-3);
    let inside = state(DVec3::new(0.006, -0.006, 0.006), DVec3::ONE, DVec3::splat(0.02), DVec3::ONE);
    let wrench = walls.wrench(&inside);
    assert_eq!((wrench.force(), wrench.torque()), (DVec3::ZERO, DVec3::ZERO));
}

#[test]
fn the_sphere_pushes_to_the_centre_and_resists_going_out_only() {
    let walls = Walls::maker(11.0e-3);
    let outward = DVec3::new(0.36, -0.48, 0.8);
    let force =
        |velocity: DVec3| walls.wrench(&state(outward * 11.5e-3, velocity, DVec3::ZERO, DVec3::ZERO)).force();
    assert!((force(DVec3::ZERO) - outward * -7.5).length() < 1.0e-9, "0.5 mm at 15 N/mm");
    assert!((force(outward * 0.1) - outward * -9.0).length() < 1.0e-9, "and 15 N s/m at 0.1 m/s");
    assert!((force(outward * -0.1) - outward * -7.5).length() < 1.0e-9);
}

#[test]
fn a_plane_nearer_than_the_sphere_limits_its_axis() {
    let mut walls = Walls::maker(11.0e-3);
    walls.planes[2].limit = 4.0e-3;
    let force = |z| walls.wrench(&state(DVec3::Z * z, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO)).force();
    assert_eq!(force(3.9e-3), DVec3::ZERO);
    assert!((force(5.0e-3) - DVec3::Z * -15.0).length() < 1.0e-9);
    assert!((force(-5.0e-3) - DVec3::Z * 15.0).length() < 1.0e-9);
}

#[test]
fn damping_of_rotation_acts_once() {
    let walls = Walls::thesis(11.0e-3, 17.0);
    let torque = |turn: f64, spin: f64| {
        walls.wrench(&state(DVec3::ZERO, DVec3::ZERO, DVec3::X * turn, DVec3::X * spin)).torque().x
    };
    let damped = -0.15 * 2.0;
    assert!((torque(0.0, 2.0) - damped).abs() < 1.0e-12);
    // 2.5 gamma beyond the limit, and the same damping, not twice (D20).
    let beyond = -42.5 * 0.01 + damped;
    assert!((torque(THESIS_ANGLE_LIMIT_RAD + 0.01, 2.0) - beyond).abs() < 1.0e-9);
    assert!((torque(-THESIS_ANGLE_LIMIT_RAD - 0.01, -2.0) + beyond).abs() < 1.0e-9);
    // The least constant is 30.
    assert_eq!(Walls::thesis(11.0e-3, 5.0).tilt.stiffness, 30.0);
}

#[test]
fn no_wall_is_stiffer_than_half_of_what_is_stable() {
    let wall = Wall { limit: 0.0, stiffness: 15_000.0, damping: 15.0 };
    let late = |latency_s| SampledLoop { period_s: 1.0e-3, latency_s };
    // (15 N s/m outwards, 7.5 N s/m in the mean) / (0.5 ms) = 15 kN/m: the makers chose the limit itself.
    assert_eq!(wall.stabilised(&late(0.0), 0.0).stiffness, 7_500.0);
    assert_eq!(wall.stabilised(&late(1.0e-3), 0.0).stiffness, 2_500.0);
    assert_eq!(wall.stabilised(&late(1.0e-3), 15.0).stiffness, 5_000.0, "a damper of both directions");
    assert_eq!(Wall { damping: 0.0, ..wall }.stabilised(&late(0.0), 0.0).stiffness, 0.0);
    // 0.15 N m s/rad outwards allow 50 N m/rad with a latency of a millisecond, 0.15 everywhere 100.
    assert_eq!(Walls::maker(11.0e-3).stabilised(&late(1.0e-3)).tilt.stiffness, 25.0);
    assert_eq!(Walls::thesis(11.0e-3, 17.0).stabilised(&late(1.0e-3)).tilt.stiffness, 42.5);
}
