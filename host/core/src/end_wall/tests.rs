use super::*;
use crate::mapping::MappingConfig;
use flotor_hal::DQuat;

/// Ends a millimetre below home and nowhere else.
fn wall_at(period_ns: u64) -> EndWall {
    let inf = f64::INFINITY;
    let bounds = WorkspaceBounds::between([-inf, -inf, -1.0e-3], [inf; 3]);
    let mapping = Mapping::new(&MappingConfig::default());
    let sampled = SampledLoop { period_s: period_ns as f64 * 1.0e-9, latency_s: 0.0 };
    EndWall::new(&bounds, &mapping, &sampled).expect("it ends")
}

/// The push of a wall on a handle that is and moves along z of the device.
fn push(wall: &EndWall, mapping: &Mapping, z_m: f64, speed_m_per_s: f64) -> Option<Wrench> {
    let pose = mapping.pose_to_model(&Pose::new(DVec3::Z * z_m, DQuat::IDENTITY));
    wall.push(&pose, mapping, &Twist::new(DVec3::Z * speed_m_per_s, DVec3::ZERO))
}

#[test]
fn it_pushes_back_what_is_beyond_and_nothing_else() {
    let mapping = Mapping::new(&MappingConfig::default());
    let push = |z_m: f64, speed: f64| push(&wall_at(1_000_000), &mapping, z_m, speed);
    assert_eq!(push(-0.9e-3, -1.0), None);
    assert_eq!(push(9.0, 0.0), None);
    let force = |z_m, speed| push(z_m, speed).expect("it is beyond").force();
    assert!((force(-1.2e-3, 0.0) - DVec3::Z * 1.5).length() < 1.0e-9);
    assert!((force(-1.2e-3, -0.1).z - 3.0).abs() < 1.0e-9, "damping resists going on");
    assert!((force(-1.2e-3, 10.0).z - 1.5).abs() < 1.0e-9, "and does not pull back in what comes back");
    assert_eq!(push(f64::NAN, 0.0), None);
}

/// A model frame upside down, at twice the motion: the device meets the end above, after half the way.
#[test]
fn the_mapping_says_where_it_is() {
    let config = MappingConfig {
        motion_scale: 2.0,
        rotation_xyzw: DQuat::from_rotation_x(std::f64::consts::PI).to_array(),
        ..MappingConfig::default()
    };
    let mapping = Mapping::new(&config);
    let push = |z_m: f64| push(&wall_at(1_000_000), &mapping, z_m, 0.0);
    assert_eq!(push(0.4e-3), None);
    let force = push(0.7e-3).expect("it is beyond").force();
    assert!((force - DVec3::Z * -1.5).length() < 1.0e-9, "{force}");
}

#[test]
fn a_slow_loop_gets_a_softer_wall() {
    let stiffness = [100_000, 500_000, 1_000_000, 10_000_000].map(|ns| wall_at(ns).stiffness_n_per_m);
    assert_eq!(stiffness, [7500.0, 7500.0, 7500.0, 750.0]);
}

#[test]
fn a_model_may_end_elsewhere_after_a_change() {
    let mapping = Mapping::new(&MappingConfig::default());
    let mut wall = wall_at(1_000_000);
    wall.move_to(&WorkspaceBounds::UNBOUNDED, &mapping);
    assert_eq!(push(&wall, &mapping, -1.0, 0.0), None);
}

/// A model placed two millimetres above the device's home ends a millimetre above it.
#[test]
fn an_end_above_the_home_of_the_device_is_no_wall() {
    let mapping = Mapping::new(&MappingConfig::default()).at([0.0, 0.0, 2.0e-3]);
    let mut wall = wall_at(1_000_000);
    let bounds = wall.bounds;
    assert!(pushes_at_home(&bounds, &mapping) && push(&wall, &mapping, 0.0, 0.0).is_some());
    wall.move_to(&bounds, &mapping);
    assert_eq!(push(&wall, &mapping, 0.0, 0.0), None);
    assert_eq!(push(&wall, &mapping, -9.0, 0.0), None, "not even far beyond");
}
