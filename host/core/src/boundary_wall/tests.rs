use super::*;
use crate::limits::{Bound, Boundary};
use flotor_hal::{Capabilities, Pose, orientation_from_rotation_vector};

/// What is surely inside meets no wall, anywhere near the edge of either range.
#[test]
fn nothing_that_meets_a_wall_is_taken_for_inside() {
    let ellipsoid = Ellipsoid::new([0.0115, 0.0095, f64::INFINITY], 1.0e4, 15.0);
    let mut outside = 0;
    for step in 0..10_000_u32 {
        let angle = f64::from(step) * 0.37;
        let direction = DVec3::new(angle.cos(), angle.sin(), 0.0) * DVec3::new(0.0115, 0.0095, 0.0);
        let at = direction * (1.0 + (f64::from(step % 41) - 20.0) * 1.0e-13);
        let pushed = ellipsoid.beyond(at).is_some();
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
        let wall = wall(&boundary, &device, 1_000_000);
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
    let ellipsoid = Ellipsoid::new([0.0495, 0.0395, f64::INFINITY], 1.0e4, 15.0);
    let beyond = ellipsoid.beyond(DVec3::new(0.0505, 0.0, 0.3)).expect("a millimetre beyond");
    let push = ellipsoid.push(&beyond, DVec3::Z * 9.0);
    assert!((push - DVec3::X * -10.0).length() < 1.0e-9, "{push}");
}

#[test]
fn a_rotation_that_meets_a_wall_is_not_taken_for_inside() {
    let boundary = Boundary::default();
    let device = Capabilities { range_m: [1.0; 3], range_rad: [0.12, 3.0, 0.5], ..CAPABILITIES };
    let wall = wall(&boundary, &device, 1_000_000);
    for step in 0..20_000_u32 {
        let turn = f64::from(step);
        let direction = DVec3::new((turn * 0.7).sin(), (turn * 1.3).cos(), (turn * 0.31).sin());
        let rotation_rad = direction.normalize() * (turn * 1.0e-4 * 1.57);
        let mut state = DeviceState::HOME;
        state.pose = Pose::new(DVec3::ZERO, orientation_from_rotation_vector(rotation_rad));
        assert_eq!(wall.push(&state), wall.push_outside(&state), "{rotation_rad}");
    }
}

fn wall(boundary: &Boundary, device: &Capabilities, period_ns: u64) -> BoundaryWall {
    BoundaryWall::new(&RenderedBoundary::new(boundary, device, &Bound::NONE, period_ns))
}

/// Force of the wall at the end of the range of a device at a rate, N.
fn push_n(device: &Capabilities, rate_hz: u64) -> f64 {
    let wall = wall(&Boundary::default(), device, 1_000_000_000 / rate_hz);
    let mut state = DeviceState::HOME;
    state.pose = Pose::new(DVec3::Z * 0.012, DeviceState::HOME.pose.orientation());
    wall.push(&state).map_or(0.0, |push| -push.force().z)
}

/// Work on the hand along random closed laps about the edge of a range with unequal axes, without and with damping: none is made,
/// beyond the error of the trapezoidal rule at the edges of the wall. A force along the ray from the centre made up to 99 % of the
/// work exchanged.
#[test]
fn no_lap_through_a_wall_of_unequal_axes_generates_energy() {
    for seed in 0..200 {
        for damping in [0.0, 15.0] {
            let wall = BoundaryWall {
                position: Ellipsoid::new([0.05, 0.03, 0.04], 2000.0, damping),
                rotation: Ellipsoid::new([0.3, 0.9, 0.6], 10.0, 1.0e-3 * damping),
            };
            for (made, exchanged) in work_of_a_lap(&wall, seed) {
                assert!(exchanged > 0.0, "lap {seed} meets no wall");
                assert!(made <= 1.0e-5 * exchanged, "lap {seed}, {damping} N s/m: {made} of {exchanged} J");
                // A spring alone loses nothing, and a damper something.
                let loses = made < -1.0e-5 * exchanged;
                assert_eq!(loses, damping > 0.0, "lap {seed}, {damping} N s/m: {made} of {exchanged} J");
            }
        }
    }
}

/// Work of the wall on the hand along a random closed lap, and the sum of its absolute values, J: of the force, and of the torque. The
/// error of the trapezoidal rule falls with the square of its step: two steps eliminate it.
fn work_of_a_lap(wall: &BoundaryWall, seed: u32) -> [(f64, f64); 2] {
    let [coarse, fine] = [10_000, 20_000].map(|steps| work_in_steps(wall, seed, steps));
    std::array::from_fn(|part| ((4.0 * fine[part].0 - coarse[part].0) / 3.0, fine[part].1))
}

/// Works of a lap by the trapezoidal rule in a number of steps.
fn work_in_steps(wall: &BoundaryWall, seed: u32, steps: u32) -> [(f64, f64); 2] {
    let number = |index: u32| {
        f64::from((seed + 1).wrapping_mul(2_654_435_761).rotate_left(index * 7) % 1999) / 999.0 - 1.0
    };
    let vector = |index: u32| DVec3::new(number(index), number(index + 1), number(index + 2));
    let around = |index: u32, turn: f64, semi_axes: DVec3| {
        let (sin, cos) = turn.sin_cos();
        let (sin2, cos2) = (2.0 * turn).sin_cos();
        let direction = vector(index) + vector(index + 3) * sin + vector(index + 6) * cos;
        // Out of the wall and into it.
        direction.normalize_or(DVec3::X) * semi_axes * (1.02 + 0.04 * sin2 * number(index + 9) + 0.04 * cos2)
    };
    let pose = |step: u32| {
        let turn = 2.0 * PI * f64::from(step % steps) / f64::from(steps);
        let rotation_rad = around(12, turn, wall.rotation.semi_axes);
        Pose::new(around(0, turn, wall.position.semi_axes), orientation_from_rotation_vector(rotation_rad))
    };
    let mut works = [(0.0, 0.0); 2];
    for step in 1..=steps {
        let (before, after) = (pose(step - 1), pose(step + 1));
        let moved = (after.position() - before.position()) / 2.0;
        let turned = rotation_vector(after.orientation() * before.orientation().conjugate()) / 2.0;
        let mut state = DeviceState::HOME;
        state.pose = pose(step);
        // A lap takes two seconds.
        let rate_hz = f64::from(steps) / 2.0;
        state.twist = flotor_hal::Twist::new(moved * rate_hz, turned * rate_hz);
        let push = wall.push(&state).unwrap_or(Wrench::ZERO);
        for (work, sum) in works.iter_mut().zip([push.force().dot(moved), push.torque().dot(turned)]) {
            *work = (work.0 + sum, work.1 + sum.abs());
        }
    }
    works
}

/// Far away and near, the nearest point is on the ellipsoid and the normal leads to it.
#[test]
fn the_nearest_point_lies_on_the_ellipsoid_along_the_normal() {
    let semi_axes = DVec3::new(0.05, 0.03, 0.4);
    let ellipsoid = Ellipsoid::new(semi_axes.to_array(), 1.0, 0.0);
    for step in 0..10_000_u32 {
        let turn = f64::from(step);
        let direction = DVec3::new((turn * 0.7).sin(), (turn * 1.3).cos(), (turn * 0.31).sin()).normalize();
        let at = direction * semi_axes * (1.0 + (turn * 0.11).sin().powi(8) * 100.0 + 1.0e-6);
        let Beyond { depth, outward } = ellipsoid.beyond(at).expect("outside");
        let nearest = at - outward * depth;
        assert!(((nearest / semi_axes).length() - 1.0).abs() < 1.0e-11, "{at}: {nearest}");
        let normal = (nearest / (semi_axes * semi_axes)).normalize();
        assert!((normal - outward).length() < 1.0e-11, "{at}: {normal} is not {outward}");
    }
}

#[test]
fn the_wall_is_as_stiff_as_device_and_rate_allow() {
    let is = |found: f64, n: f64| assert!((found - n).abs() < 1.0e-9, "{found} is not {n}");
    is(push_n(&CAPABILITIES, 1000), 10.0); // twice 5 N
    is(push_n(&CAPABILITIES, 4000), 10.0);
    is(push_n(&Capabilities { latency_s: 1.0e-3, ..CAPABILITIES }, 1000), 10.0);
    // Half of the range: 0.5 (15 N s/m / 2) / 5 ms over 6 mm.
    is(push_n(&CAPABILITIES, 100), 4.5);
    is(push_n(&Capabilities { max_stiffness_n_per_m: 450.0, ..CAPABILITIES }, 1000), 2.7);
    is(push_n(&Capabilities { max_stiffness_n_per_m: 0.0, ..CAPABILITIES }, 1000), 10.0); // unknown
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
