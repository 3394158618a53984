use super::*;
use flotor_core::limits::Bound;

const PERIOD_S: f64 = 1.0e-3;
/// Mass of the flotor and the drag on it.
const MASS_KG: f64 = 0.58;
const DRAG_NS_PER_M: f64 = 2.0;

/// A free handle that slides along z under a limited force, for five seconds.
struct Slide {
    /// Half of the distance between highest and lowest position in each second, m.
    amplitude_m: [f64; 5],
    lowest_m: f64,
    /// Work of the limited force less that of the requested one, J.
    generated_j: f64,
}

/// Slides under `request_n` of the position and a constant `weight_n`, released at `start_m`; exact between two samples, because
/// the force is constant.
fn slide(slew_n_per_s: f64, start_m: f64, weight_n: f64, request_n: impl Fn(f64) -> f64) -> Slide {
    let mut limit = sides(slew_n_per_s);
    let (mut z_m, mut velocity, mut held) = (start_m, 0.0, Wrench::ZERO);
    let mut moved = Displacement::default();
    let mut positions = Vec::new();
    let mut generated_j = 0.0;
    for _ in 0..5000 {
        generated_j += limit.observe(&moved, &held);
        let request = Wrench::from_force(DVec3::Z * request_n(z_m));
        let twist = Twist::new(DVec3::Z * velocity, DVec3::ZERO);
        held = limited(&mut limit, &request, &held, &twist).unwrap_or(request);
        let rest_velocity = (held.force().z + weight_n) / DRAG_NS_PER_M;
        let kept = (-DRAG_NS_PER_M / MASS_KG * PERIOD_S).exp();
        let way_m =
            rest_velocity * PERIOD_S + (velocity - rest_velocity) * (1.0 - kept) * MASS_KG / DRAG_NS_PER_M;
        velocity = rest_velocity + (velocity - rest_velocity) * kept;
        z_m += way_m;
        moved = Displacement { linear: DVec3::Z * way_m, angular: DVec3::ZERO };
        positions.push(z_m);
    }
    let amplitude_m = std::array::from_fn(|second| {
        let part = &positions[1000 * second..1000 * (second + 1)];
        let [low, high] = [f64::min, f64::max].map(|of| part.iter().copied().reduce(of).expect("ticks"));
        0.5 * (high - low)
    });
    Slide { amplitude_m, lowest_m: positions.iter().copied().fold(0.0, f64::min), generated_j }
}

/// The demo's spring, released 3 and 6 mm below home: a lag of the force made its oscillation grow out of the range of the device.
#[test]
fn a_spring_that_is_faster_than_the_limit_comes_to_rest_as_without_the_limit() {
    for slew_n_per_s in [f64::INFINITY, 200.0, 100.0, 50.0, 20.0] {
        for start_m in [-3.0e-3, -6.0e-3] {
            let Slide { amplitude_m, generated_j, .. } =
                slide(slew_n_per_s, start_m, 0.0, |z_m| -1131.0 * z_m);
            let [first_m, .., last_m] = amplitude_m;
            // A quarter more than the way to home: a weak force brakes the first passage over a longer way.
            assert!(first_m < -1.25 * start_m, "{slew_n_per_s} N/s from {start_m} m: {amplitude_m:?}");
            assert!(last_m < -0.02 * start_m, "{slew_n_per_s} N/s from {start_m} m: {amplitude_m:?}");
            assert!(generated_j <= 0.0, "{slew_n_per_s} N/s from {start_m} m: {generated_j} J");
        }
    }
}

/// A wall at its stable stiffness under a handle that falls 4 mm with 4 N.
#[test]
fn a_handle_that_falls_on_a_wall_with_a_slow_force_comes_to_rest_as_without_the_limit() {
    let fall = |slew_n_per_s| slide(slew_n_per_s, 4.0e-3, -4.0, |z_m| (-4000.0 * z_m).max(0.0));
    let free = fall(f64::INFINITY);
    for slew_n_per_s in [500.0, 200.0, 100.0] {
        let slow = fall(slew_n_per_s);
        assert!(slow.lowest_m < free.lowest_m, "{slew_n_per_s} N/s: the limit acts");
        // The bounces of a held force are those of any depth, so of both to a quarter.
        assert!(
            slow.amplitude_m[4] < 1.25 * free.amplitude_m[4],
            "{slew_n_per_s} N/s: {:?}, without the limit {:?}",
            slow.amplitude_m,
            free.amplitude_m
        );
    }
}

/// Applies a limit where force and torque have none.
fn limited(limit: &mut SlewLimit, request: &Wrench, held: &Wrench, twist: &Twist) -> Option<Wrench> {
    let endless = Region::of(Bound::NONE);
    limit.limit(request, held, twist, PERIOD_S, [&endless; 2])
}

fn sides(force_n_per_s: f64) -> SlewLimit {
    let side = |most_per_s| Side { most_per_s, most_fall_per_s: f64::INFINITY, ledger: Ledger::SETTLED };
    SlewLimit { force: side(force_n_per_s), torque: side(f64::INFINITY), requested: None }
}

#[test]
fn the_part_of_a_force_that_accelerates_the_handle_falls_at_once_and_the_rest_by_the_limit() {
    let (held, twist) =
        (Wrench::from_force(DVec3::new(5.0, 0.0, 8.0)), Twist::new(DVec3::Z * 0.1, DVec3::ZERO));
    let falls = |request: DVec3| {
        let request = Wrench::from_force(request);
        limited(&mut sides(1000.0), &request, &held, &twist).unwrap_or(request).force()
    };
    assert_eq!(falls(DVec3::new(5.0, 0.0, 2.0)), DVec3::new(5.0, 0.0, 2.0), "along the motion");
    assert_eq!(falls(DVec3::new(0.0, 0.0, 8.0)), DVec3::new(4.0, 0.0, 8.0), "across it");
    assert_eq!(
        falls(DVec3::new(5.0, 0.0, -9.0)),
        DVec3::new(5.0, 0.0, -1.0),
        "to zero, and from there by the limit"
    );
    let back = Twist::new(DVec3::Z * -0.1, DVec3::ZERO);
    let request = Wrench::from_force(DVec3::new(5.0, 0.0, 2.0));
    let braking = limited(&mut sides(1000.0), &request, &held, &back).expect("a change of 6 N");
    assert_eq!(braking.force(), DVec3::new(5.0, 0.0, 7.0), "a force that brakes falls by the limit");
}

#[test]
fn a_fall_is_no_faster_than_the_device_permits() {
    let mut limit = sides(1000.0);
    limit.force.most_fall_per_s = 3000.0;
    let (held, twist) = (Wrench::from_force(DVec3::Z * 8.0), Twist::new(DVec3::Z * 0.1, DVec3::ZERO));
    let fallen = limited(&mut limit, &Wrench::ZERO, &held, &twist).expect("a change of 8 N");
    assert_eq!(fallen.force(), DVec3::Z * 5.0);
}

/// Pressed in faster than the force may rise, drawn out slowly: the spring returns what it received, and no more.
#[test]
fn what_the_limit_generates_is_paid_back_on_the_way_out() {
    let mut limit = sides(100.0);
    let (stiffness_n_per_m, mut held, mut z_m) = (1000.0, Wrench::ZERO, 0.0);
    let (mut taken_j, mut lowest_j) = (0.0_f64, 0.0_f64);
    // 6 mm in 60 ms, a rest of 50 ms, and out in 300 ms.
    let ways = [(60, -1.0e-4), (50, 0.0), (300, 2.0e-5)];
    for way_m in ways.into_iter().flat_map(|(ticks, way_m)| std::iter::repeat_n(way_m, ticks)) {
        let request = Wrench::from_force(DVec3::Z * (-stiffness_n_per_m * z_m));
        let twist = Twist::new(DVec3::Z * (way_m / PERIOD_S), DVec3::ZERO);
        held = limited(&mut limit, &request, &held, &twist).unwrap_or(request);
        let moved = Displacement { linear: DVec3::Z * way_m, angular: DVec3::ZERO };
        limit.observe(&moved, &held);
        z_m += way_m;
        taken_j -= held.force().z * way_m;
        lowest_j = lowest_j.min(taken_j);
    }
    // A held force of an ideal spring alone generates `K v² T² / 2` in each tick.
    let held_force_j = 0.5 * stiffness_n_per_m * (60.0 * 1.0e-8 + 300.0 * 4.0e-10);
    assert!(lowest_j >= -held_force_j, "{lowest_j} J, by a held force {held_force_j} J");
    assert!(held.force().length() < 0.05, "{held:?} at {z_m} m");
}

#[test]
fn a_fall_at_the_edge_of_the_limits_is_no_jump_of_the_device() {
    let mut limit = sides(10.0);
    limit.force.most_fall_per_s = 100.0;
    let region = Region::of(Bound::box_of([1.0, 10.0, 10.0]));
    // Without its part along the motion the held force is beyond the limit of x, in the other direction than the request.
    let held = Wrench::from_force(DVec3::new(-1.0, 5.0, 0.0));
    let request = Wrench::from_force(DVec3::new(1.0, 0.0, 0.0));
    let twist = Twist::new(DVec3::new(0.1, 0.1, 0.0), DVec3::ZERO);
    let sent = limit.limit(&request, &held, &twist, PERIOD_S, [&region; 2]);
    let sent = sent.expect("a change of 5 N").force();
    assert!(region.holds(sent), "{sent}");
    let step_n = (sent - held.force()).length();
    assert!((0.05..=0.1 * (1.0 + 1.0e-12)).contains(&step_n), "{step_n} N");
}
