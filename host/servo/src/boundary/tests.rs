use super::*;
use flotor_hal::{Pose, orientation_from_rotation_vector};

/// What is surely inside meets no wall, anywhere near the edge of either range.
#[test]
fn nothing_that_meets_a_wall_is_taken_for_inside() {
    let ellipsoid = Ellipsoid::new([0.012, 0.01, 0.0], 0.0005, 1.0e4, 15.0);
    let mut outside = 0;
    for step in 0..10_000_u32 {
        let angle = f64::from(step) * 0.37;
        let direction = DVec3::new(angle.cos(), angle.sin(), 0.0) * DVec3::new(0.0115, 0.0095, 0.0);
        let at = direction * (1.0 + (f64::from(step % 41) - 20.0) * 1.0e-13);
        let pushed = ellipsoid.push(at, DVec3::ZERO).is_some();
        assert!(!(pushed && ellipsoid.surely_holds(at)), "{at}");
        outside += u32::from(pushed);
    }
    assert!((3000..7000).contains(&outside), "{outside} of 10 000");
    assert!(!ellipsoid.surely_holds(DVec3::NAN));
}

/// Whatever a device and a scene say, the wall leaves the handle alone at home, and a little beside it, where a sensor's
/// noise puts it.
#[test]
fn a_wall_never_pushes_at_home() {
    let ranges = [0.0, 1.0e-9, 1.0e-4, 0.012, 1.0, f64::INFINITY];
    let margins = [0.0, 5.0e-4, 0.012, 0.1, 1.5];
    for (x, z, margin) in
        ranges.iter().flat_map(|x| ranges.map(|z| (*x, z))).flat_map(|(x, z)| margins.map(|m| (x, z, m)))
    {
        let device = Capabilities { range_m: [x, 0.012, z], range_rad: [z, x, 0.12], ..CAPABILITIES };
        let boundary = Boundary { margin_m: margin, margin_rad: margin, ..Boundary::default() };
        let wall = BoundaryWall::new(&boundary, &device, 1_000_000);
        let noise = |range: f64| if range > 0.0 { 0.2 * range.min(1.0) } else { 1.0e-3 };
        for share in [0.0, 1.0e-9, 1.0] {
            let mut state = DeviceState::HOME;
            let rotation = DVec3::new(noise(z), noise(x), 0.02) * share;
            let orientation = orientation_from_rotation_vector(rotation);
            state.pose = Pose::new(DVec3::new(noise(x), 0.002, noise(z)) * share, orientation);
            assert_eq!(wall.push(&state), None, "range {x} and {z}, margin {margin}, {share} of the noise");
        }
    }
}

/// A planar device that reports a height pushes in its plane only.
#[test]
fn an_axis_without_range_has_no_part_in_the_push() {
    let ellipsoid = Ellipsoid::new([0.05, 0.04, 0.0], 5.0e-4, 1.0e4, 15.0);
    let push = ellipsoid.push(DVec3::new(0.0505, 0.0, 0.3), DVec3::Z * 9.0).expect("a millimetre beyond");
    assert!((push - DVec3::X * -10.0).length() < 1.0e-9, "{push}");
}

#[test]
fn a_rotation_that_meets_a_wall_is_not_taken_for_inside() {
    let boundary = Boundary::default();
    let device = Capabilities { range_m: [1.0; 3], range_rad: [0.12, 3.0, 0.5], ..CAPABILITIES };
    let wall = BoundaryWall::new(&boundary, &device, 1_000_000);
    for step in 0..20_000_u32 {
        let turn = f64::from(step);
        let direction = DVec3::new((turn * 0.7).sin(), (turn * 1.3).cos(), (turn * 0.31).sin());
        let rotation_rad = direction.normalize() * (turn * 1.0e-4 * 1.57);
        let mut state = DeviceState::HOME;
        state.pose = Pose::new(DVec3::ZERO, orientation_from_rotation_vector(rotation_rad));
        assert_eq!(wall.push(&state), wall.push_outside(&state), "{rotation_rad}");
    }
}

/// Force of the wall half a millimetre deep in it at a device and a rate, N.
fn push_n(device: &Capabilities, rate_hz: u64) -> f64 {
    let wall = BoundaryWall::new(&Boundary::default(), device, 1_000_000_000 / rate_hz);
    let mut state = DeviceState::HOME;
    state.pose = Pose::new(DVec3::Z * 0.012, DeviceState::HOME.pose.orientation());
    wall.push(&state).map_or(0.0, |push| -push.force().z)
}

#[test]
fn the_wall_is_as_stiff_as_device_and_rate_allow() {
    let is = |found: f64, n: f64| assert!((found - n).abs() < 1.0e-9, "{found} is not {n}");
    is(push_n(&CAPABILITIES, 1000), 5.0); // the default's 10 kN/m
    is(push_n(&CAPABILITIES, 100), 0.75); // 15 N s/m / 10 ms
    is(push_n(&Capabilities { max_stiffness_n_per_m: 450.0, ..CAPABILITIES }, 1000), 0.225);
    is(push_n(&Capabilities { max_stiffness_n_per_m: 0.0, ..CAPABILITIES }, 1000), 5.0); // says nothing
}

const CAPABILITIES: Capabilities = Capabilities {
    sensed: flotor_hal::Axes::ALL,
    actuated: flotor_hal::Axes::ALL,
    range_m: [0.012; 3],
    range_rad: [0.12; 3],
    resolution_m: 0.0,
    max_force_n: [40.0; 3],
    max_torque_nm: [5.0; 3],
    max_force_slew_n_per_s: f64::INFINITY,
    max_torque_slew_nm_per_s: f64::INFINITY,
    max_stiffness_n_per_m: 25_000.0,
    rate_hz: [100.0, 10_000.0],
    latency_s: 0.0,
};
