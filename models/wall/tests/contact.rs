//! The wall against closed forms: depth, cone of friction, work in a loop, and what a wall never does.

use flotor_hal::DVec3;
use flotor_wall::proxy::{ContactForce, Proxy};
use flotor_wall::shape::Shape;
use flotor_wall::surface::Surface;
use proptest::prelude::*;

const SMOOTH: Surface = Surface { stiffness_n_per_m: 2000.0, damping_ns_per_m: 0.0, friction: 0.0 };
const ROUGH: Surface = Surface { friction: 0.5, ..SMOOTH };
const BALL: Shape = Shape::Sphere { radius_m: 0.02 };
const CUBE: Shape = Shape::Cube { half_m: 0.01 };

/// Takes a handle from point to point in steps of at most 10 µm; the last pull, and the work the handle got, J.
fn walk(shape: Shape, surface: Surface, points_m: &[DVec3]) -> (ContactForce, f64) {
    let (mut proxy, mut pull, mut work_j) = (Proxy::default(), ContactForce::default(), 0.0);
    for pair in points_m.windows(2) {
        let steps = ((pair[1] - pair[0]).length() / 1.0e-5).ceil().max(1.0);
        let mut before_m = pair[0];
        for step in (1..).map(f64::from).take_while(|step: &f64| *step <= steps) {
            let here_m = pair[0].lerp(pair[1], step / steps);
            let next = proxy.follow(&shape, &surface, here_m, DVec3::ZERO);
            // Trapezoidal rule: exact where the force is linear in the position.
            work_j += 0.5 * (pull.force_n + next.force_n).dot(here_m - before_m);
            (pull, before_m) = (next, here_m);
        }
    }
    (pull, work_j)
}

#[test]
fn a_smooth_surface_pushes_along_its_normal_with_stiffness_times_depth() {
    let (pull, _) = walk(Shape::Plane, SMOOTH, &[DVec3::Z * 0.001, DVec3::new(0.003, 0.001, -0.002)]);
    assert_eq!((pull.force_n, pull.energy_j), (DVec3::Z * 4.0, 0.5 * 2000.0 * 0.002 * 0.002));
    // Into the ball at 45 degrees: 2 mm below the surface, seen from the centre.
    let centre = DVec3::Z * -0.02;
    let direction = DVec3::new(1.0, 0.0, 1.0).normalize();
    let (pull, _) = walk(BALL, SMOOTH, &[centre + direction * 0.03, centre + direction * 0.018]);
    // Positions of 1e-2 m rounded to 1e-18 m, times 2000 N/m, and a normal from a difference: 1e-13 N.
    assert!((pull.force_n - direction * 4.0).length() < 1.0e-13, "{}", pull.force_n);
}

#[test]
fn friction_holds_up_to_the_cone_and_slides_on_it() {
    let pressed = DVec3::Z * -0.002;
    for (sideways_m, expected_n) in [(0.0005, -1.0), (0.001, -2.0), (0.005, -2.0)] {
        // K t as long as it is below mu K d = 2 N; then that.
        let end = pressed + DVec3::X * sideways_m;
        let (pull, _) = walk(Shape::Plane, ROUGH, &[DVec3::Z * 0.001, pressed, end]);
        assert!((pull.force_n.x - expected_n).abs() < 1.0e-12 && pull.force_n.z == 4.0, "{}", pull.force_n);
    }
}

/// A handle that leaves fast enough for damping to take all of the normal force feels no friction either.
#[test]
fn the_cone_is_that_of_the_force_that_is_felt() {
    let surface = Surface { damping_ns_per_m: 20.0, ..ROUGH };
    let mut proxy = Proxy::default();
    for position_m in [DVec3::Z * 0.001, DVec3::Z * -0.002] {
        let _ = proxy.follow(&Shape::Plane, &surface, position_m, DVec3::ZERO);
    }
    let aside = DVec3::new(0.005, 0.0, -0.002);
    for (outwards_m_per_s, normal_n) in [(0.0, 4.0), (0.1, 2.0), (0.2, 0.0), (0.5, 0.0)] {
        let pull = proxy.follow(&Shape::Plane, &surface, aside, DVec3::Z * outwards_m_per_s);
        assert!((pull.force_n - DVec3::new(-0.5 * normal_n, 0.0, normal_n)).length() < 1.0e-12, "{pull:?}");
    }
}

#[test]
fn on_a_ball_the_sliding_pull_lies_on_the_cone() {
    let path = [DVec3::Z * 0.001, DVec3::Z * -0.002, DVec3::new(0.008, 0.0, -0.004)];
    let mut proxy = Proxy::default();
    let mut pull = ContactForce::default();
    for pair in path.windows(2) {
        for step in 1..=1000 {
            pull = proxy.follow(&BALL, &ROUGH, pair[0].lerp(pair[1], f64::from(step) / 1000.0), DVec3::ZERO);
        }
    }
    let normal = proxy.contact().expect("it is inside").normal;
    let pressed_n = pull.force_n.dot(normal);
    let rubbed_n = (pull.force_n - normal * pressed_n).length();
    assert!((rubbed_n / pressed_n - 0.5).abs() < 1.0e-12, "{}", rubbed_n / pressed_n);
}

#[test]
fn damping_never_pulls() {
    let surface = Surface { damping_ns_per_m: 100.0, ..SMOOTH };
    let at = |speed: f64| {
        Proxy::default().follow(&Shape::Plane, &surface, DVec3::Z * -0.001, DVec3::Z * speed).force_n
    };
    assert_eq!((at(-0.01), at(0.01), at(1.0)), (DVec3::Z * 3.0, DVec3::Z, DVec3::ZERO));
}

#[test]
fn a_loop_on_smooth_ground_costs_nothing_and_on_rough_ground_it_costs_the_rubbing() {
    let down = DVec3::Z * -0.002;
    let ring = [DVec3::Z, down, down + DVec3::X * 0.006, DVec3::new(0.006, 0.0, 0.001), DVec3::Z];
    let (_, work_j) = walk(Shape::Plane, SMOOTH, &ring);
    let stored_j = 0.5 * 2000.0 * 0.002 * 0.002;
    assert!(work_j.abs() < 1.0e-9 * stored_j, "{work_j}");
    // Rough: the proxy slides 6 mm less the millimetre it lags, under mu K d = 2 N; the millimetre's spring energy is
    // lost when the handle comes up and the cone closes.
    let (_, work_j) = walk(Shape::Plane, ROUGH, &ring);
    let rubbed_j = 2.0 * 0.005;
    let closing_j = 0.5 * 2000.0 * 0.001 * 0.001;
    // The cone closes along a line of 300 steps of 10 µm: the trapezoidal rule errs by a few thousandths of that part.
    assert!((work_j + rubbed_j + closing_j).abs() < 0.01 * closing_j, "{work_j}");
}

/// A closed lap of straight legs, each at a speed of its own.
struct Lap {
    corners_m: Vec<DVec3>,
    speeds_m_per_s: Vec<f64>,
}

impl Lap {
    /// Returns the work that two laps do on the handle after a first one, and the work exchanged, J: the midpoint rule over
    /// the force at the moving handle, `steps` of them to a leg.
    fn work_j(&self, shape: &Shape, surface: &Surface, steps: u32) -> (f64, f64) {
        let mut proxy = Proxy::default();
        let _ = proxy.follow(shape, surface, DVec3::Z * 0.001, DVec3::ZERO);
        let (mut made_j, mut exchanged_j) = (0.0, 0.0);
        for round in 0..3 {
            for (leg, &speed_m_per_s) in self.speeds_m_per_s.iter().enumerate() {
                let from_m = self.corners_m[leg];
                let step_m = (self.corners_m[(leg + 1) % self.corners_m.len()] - from_m) / f64::from(steps);
                let velocity_m_per_s = step_m.normalize_or_zero() * speed_m_per_s;
                for step in 0..steps {
                    let here_m = from_m + step_m * (f64::from(step) + 0.5);
                    let pull = proxy.follow(shape, surface, here_m, velocity_m_per_s);
                    if round > 0 {
                        let work_j = pull.force_n.dot(step_m);
                        (made_j, exchanged_j) = (made_j + work_j, exchanged_j + work_j.abs());
                    }
                }
            }
        }
        (made_j, exchanged_j)
    }

    /// Asserts that a lap makes no more than the midpoint rule errs by: at a jump of the force by half a step's work, which
    /// halves with the step, so twice the difference between two steps bounds what is left.
    fn assert_passive(&self, shape: Shape, surface: Surface) {
        let (coarse_j, _) = self.work_j(&shape, &surface, 500);
        let (fine_j, exchanged_j) = self.work_j(&shape, &surface, 1000);
        let error_j = 2.0 * (coarse_j - fine_j).abs() + 1.0e-12 * exchanged_j;
        assert!(fine_j <= error_j, "{shape:?} {surface:?}: {fine_j} J of {exchanged_j} J, error {error_j} J");
    }
}

/// Press in, fast up and sideways while damping takes the normal force, slowly back to above the proxy, and down again.
#[test]
fn a_lap_that_leaves_fast_and_returns_slowly_gains_nothing() {
    for (stiffness_n_per_m, damping_ns_per_m, friction, depth_m, speed_m_per_s) in [
        (2000.0, 100.0, 1.0, 5.0e-3, 0.5),
        (2000.0, 20.0, 1.0, 1.0e-3, 0.5),
        (2000.0, 20.0, 1.0, 2.0e-3, 0.5),
        (2000.0, 50.0, 0.5, 2.0e-3, 0.5),
        (2000.0, 2.0, 0.3, 2.0e-3, 0.5),
        (2000.0, 15.0, 0.8, 1.0e-3, 0.3),
        (10_000.0, 30.0, 1.0, 0.5e-3, 0.3),
    ] {
        // Outwards as fast as damping needs to take all of the normal force, or over nine tenths of the depth.
        let aside_m = friction * depth_m * 0.98;
        let outwards_m_per_s: f64 = 1.02 * stiffness_n_per_m * depth_m / damping_ns_per_m;
        let up_m = (outwards_m_per_s * aside_m / speed_m_per_s).min(0.9 * depth_m);
        let aside_m = friction * (depth_m - up_m) * 0.98;
        let lap = Lap {
            corners_m: vec![
                DVec3::Z * -depth_m,
                DVec3::new(aside_m, 0.0, up_m - depth_m),
                DVec3::Z * (up_m - depth_m),
            ],
            speeds_m_per_s: vec![outwards_m_per_s.hypot(speed_m_per_s), 0.02, 0.02],
        };
        for shape in [Shape::Plane, BALL, CUBE] {
            lap.assert_passive(shape, Surface { stiffness_n_per_m, damping_ns_per_m, friction });
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Laps that stay inside, so that no sudden contact is part of them.
    #[test]
    fn no_lap_with_friction_damping_and_velocity_generates_energy(
        corners in prop::collection::vec((-0.003..0.003_f64, -0.003..0.003_f64, -0.004..-0.0005_f64), 3..7),
        speeds in prop::collection::vec(0.01..1.0_f64, 7),
        damping_ns_per_m in 1.0..100.0_f64,
        friction in 0.1..1.5_f64,
        solid in 0..3_usize,
    ) {
        let corners_m: Vec<_> = corners.into_iter().map(|(x, y, z)| DVec3::new(x, y, z)).collect();
        let speeds_m_per_s = speeds[..corners_m.len()].to_vec();
        let surface = Surface { damping_ns_per_m, friction, ..SMOOTH };
        Lap { corners_m, speeds_m_per_s }.assert_passive([Shape::Plane, BALL, CUBE][solid], surface);
    }

    /// The pull of a sliding proxy lies on the cone of the felt normal force, at any velocity.
    #[test]
    fn the_cone_is_that_of_the_felt_force_on_every_solid(
        aside_m in 0.001..0.006_f64,
        velocity in (-0.5..0.5_f64, -0.5..0.5_f64, -0.5..0.5_f64),
        damping_ns_per_m in 0.0..50.0_f64,
        friction in 0.05..1.5_f64,
        solid in 0..3_usize,
    ) {
        let shape = [Shape::Plane, BALL, CUBE][solid];
        let surface = Surface { damping_ns_per_m, friction, ..SMOOTH };
        let mut proxy = Proxy::default();
        let _ = proxy.follow(&shape, &surface, DVec3::Z * -0.003, DVec3::ZERO);
        let here_m = DVec3::new(aside_m, 0.0, -0.003);
        let pull = proxy.follow(&shape, &surface, here_m, DVec3::from(velocity));
        let normal = proxy.contact().expect("it is inside").normal;
        let pressed_n = pull.force_n.dot(normal);
        let rubbed_n = (pull.force_n - normal * pressed_n).length();
        // Lengths of 1e-2 m rounded to 1e-18 m, times 2000 N/m, through one arc sine.
        prop_assert!(rubbed_n <= friction * pressed_n + 1.0e-11, "{rubbed_n} {pressed_n}");
    }
}

proptest! {
    /// Whatever the way, the force points out of the surface, stays in the cone, and is never more than K times the
    /// distance to the proxy.
    #[test]
    fn the_pull_stays_in_the_cone(
        steps in prop::collection::vec((-0.004..0.004_f64, -0.004..0.004_f64, -0.003..0.003_f64), 1..60),
        friction in 0.0..2.0_f64,
        solid in 0..3_usize,
    ) {
        let shape = [Shape::Plane, BALL, CUBE][solid];
        let surface = Surface { friction, ..SMOOTH };
        let (mut proxy, mut at) = (Proxy::default(), DVec3::Z * 0.001);
        for (x, y, z) in steps {
            at += DVec3::new(x, y, z);
            let pull = proxy.follow(&shape, &surface, at, DVec3::ZERO);
            let Some(place) = proxy.contact() else {
                prop_assert_eq!(pull, ContactForce::default());
                continue;
            };
            let pressed_n = pull.force_n.dot(place.normal);
            let rubbed_n = (pull.force_n - place.normal * pressed_n).length();
            prop_assert!(pressed_n >= 0.0);
            prop_assert!(rubbed_n <= friction * pressed_n + 1.0e-11, "{rubbed_n} {pressed_n}");
            prop_assert!((pull.energy_j - 0.5 * pull.force_n.length_squared() / 2000.0).abs() < 1.0e-12);
        }
    }

    /// Turned about z by a right angle, the same way gives the same force, turned.
    #[test]
    fn a_turn_of_the_way_turns_the_force(x in -0.009..0.009_f64, y in -0.009..0.009_f64, z in -0.01..-0.0001_f64, solid in 0..3_usize) {
        let shape = [Shape::Plane, BALL, CUBE][solid];
        let turned = |v: DVec3| DVec3::new(-v.y, v.x, v.z);
        let end = DVec3::new(x, y, z);
        let above = DVec3::new(0.5 * x, 0.5 * y, 0.001);
        let (here, _) = walk(shape, ROUGH, &[above, end]);
        let (there, _) = walk(shape, ROUGH, &[turned(above), turned(end)]);
        prop_assert!((turned(here.force_n) - there.force_n).length() < 1.0e-10);
    }
}
