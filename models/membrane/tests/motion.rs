//! Networks in motion: frequency, momentum, inactive blocks, and the plane that a faster loop is given.

use flotor_hal::{DQuat, DVec3, Input, Output, Pose};
use flotor_loader::{Model, Plugin};
use flotor_membrane::ball::Ball;
use flotor_membrane::mesh::{Link, Mesh, Sheet};
use flotor_membrane::network::{Network, State, Surroundings};
use flotor_membrane::touch::Touch;
use std::f64::consts::TAU;

const FREE: Surroundings = Surroundings { gravity_m_per_s2: 0.0, damping_per_s: 0.0, contact_n_per_m: 0.0 };
const SHEET: Sheet =
    Sheet { nodes_per_side: 17, side_m: 0.04, mass_kg: 0.01, stiffness_n_per_m: 200.0, stretch: 1.25 };
const TOUCHED: Surroundings =
    Surroundings { gravity_m_per_s2: 0.0, damping_per_s: 50.0, contact_n_per_m: 400.0 };
const RADIUS_M: f64 = 0.005;

#[test]
fn a_mass_on_a_spring_swings_at_the_frequency_of_the_textbook() {
    let mesh = Mesh {
        positions_m: vec![DVec3::ZERO, DVec3::X * 0.101],
        masses_kg: vec![0.0, 0.2],
        links: vec![Link { ends: [0, 1], rest_m: 0.1, stiffness_n_per_m: 80.0 }],
        triangles: Vec::new(),
    };
    let mut network = Network::new(&mesh, FREE);
    let step_s = network.longest_step_s() / 200.0;
    let mut crossings = Vec::new();
    let mut before_m = 0.001;
    for step in 1..200_000_u32 {
        network.step(step_s, None);
        let now_m = network.positions_m().get(1).x - 0.1;
        if before_m < 0.0 && now_m >= 0.0 {
            crossings.push(f64::from(step) - now_m / (now_m - before_m));
        }
        before_m = now_m;
    }
    let swings = (crossings.len() - 1) as f64;
    let period_s = (crossings[crossings.len() - 1] - crossings[0]) / swings * step_s;
    let exact_s = TAU * (0.2_f64 / 80.0).sqrt();
    // The method's period is short by (omega h)^2 / 24, here 3e-6.
    assert!((period_s / exact_s - 1.0).abs() < 1.0e-5, "{period_s} {exact_s}");
}

#[test]
fn the_step_is_stable_as_long_as_it_says_and_not_much_longer() {
    let stays = |share: f64| {
        let mut mesh = Mesh::sheet(&SHEET);
        // The stiffest mode: neighbours against each other.
        for (index, position) in mesh.positions_m.iter_mut().enumerate() {
            let sign = if (index % 17 + index / 17).is_multiple_of(2) { 1.0 } else { -1.0 };
            position.x += 1.0e-6 * sign * f64::from(u8::from(mesh.masses_kg[index] > 0.0));
        }
        let mut network = Network::new(&mesh, FREE);
        let step_s = share * network.longest_step_s();
        for _ in 0..20_000 {
            network.step(step_s, None);
        }
        let start = Mesh::sheet(&SHEET);
        let moved_m = |node: usize| (network.positions_m().get(node) - start.positions_m[node]).length();
        (0..289).all(|node| moved_m(node) < 1.0e-4) // false for NaN
    };
    assert!(stays(1.0));
    // Gershgorin counts the springs of both axes, of which a motion along one axis feels little more than half: the true
    // limit is less than the root of two above the bound, and the longest step is 0.8 of the bound.
    assert!(!stays(2.0_f64.sqrt() / 0.8));
}

#[test]
fn what_the_ball_feels_is_what_the_masses_get() {
    let mut network = Network::new(&Mesh::sheet(&SHEET), TOUCHED);
    let ball = Ball { centre_m: DVec3::new(0.001, -0.002, 0.004), radius_m: RADIUS_M };
    // At rest in equilibrium: the border carries the force.
    let mut force_n = DVec3::ZERO;
    (0..20_000).for_each(|_| force_n = network.step(1.0e-4, Some(&ball)));
    let mut border_n = DVec3::ZERO;
    let mesh = Mesh::sheet(&SHEET);
    for link in &mesh.links {
        let held = link.ends.map(|end| mesh.masses_kg[end] == 0.0);
        let [a, b] = link.ends.map(|end| network.positions_m().get(end));
        let pull_n = (b - a) * (link.stiffness_n_per_m * (1.0 - link.rest_m / (b - a).length()));
        // What the spring does to its free end.
        border_n += if held[0] {
            -pull_n
        } else if held[1] {
            pull_n
        } else {
            DVec3::ZERO
        };
    }
    assert!(force_n.z > 0.05, "{force_n}");
    // Slow motion that is left: 1e-6 m/s within 10 g over the drag's 20 ms.
    assert!((force_n - border_n).length() < 1.0e-6, "{force_n} {border_n}");
}

#[test]
fn a_sheet_at_rest_is_inactive_a_touch_activates_it_and_inactivity_changes_nothing_that_is_felt() {
    let press = |active: bool| {
        let mut network = Network::new(&Mesh::sheet(&SHEET), TOUCHED);
        let step_s = network.longest_step_s();
        let away = Ball { centre_m: DVec3::Z * 0.1, radius_m: RADIUS_M };
        for _ in 0..5000 {
            network.step(step_s, Some(&away));
        }
        let inactive = network.active_nodes() == 0;
        let mut forces_n = Vec::new();
        for step in 0..4000_u32 {
            if active {
                network.activate();
            }
            let depth_m = 0.002 * (f64::from(step) / 4000.0 * TAU).sin().max(0.0);
            let ball = Ball { centre_m: DVec3::Z * (RADIUS_M - depth_m), radius_m: RADIUS_M };
            forces_n.push(network.step(step_s, Some(&ball)));
        }
        (inactive, forces_n)
    };
    let ((inactive, slept), (_, woken)) = (press(false), press(true));
    assert!(inactive, "nothing touched it for seconds");
    let largest_n = woken.iter().map(|force| force.length()).fold(0.0, f64::max);
    let difference_n = slept.iter().zip(&woken).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    assert!(largest_n > 0.1);
    // Left out: motion below 1e-6 m/s for the time until a neighbour activates, some 10 nm at 1 kN/m of contact springs.
    assert!(difference_n < 1.0e-4 * largest_n, "{difference_n} of {largest_n} N");
}

#[test]
fn a_plane_pushes_as_the_network_that_lives_the_period_again() {
    let at = |depth_m: f64| DVec3::new(0.0007, 0.0003, RADIUS_M - depth_m);
    let (period_s, probe_m) = (5.0e-3, 1.0e-5);
    let begun = |state: &State| {
        let mut touch =
            Touch::new(Network::new(&Mesh::sheet(&SHEET), TOUCHED), RADIUS_M, at(0.002 * 39.0 / 40.0));
        touch.network_mut().restore(state);
        touch
    };
    let mut touch = Touch::new(Network::new(&Mesh::sheet(&SHEET), TOUCHED), RADIUS_M, at(0.0));
    for step in 0..40 {
        touch.advance(at(0.002 * f64::from(step) / 40.0), period_s);
    }
    let before = touch.network().state().clone();
    let plane = touch.measure_plane(at(0.002), period_s, probe_m).expect("the ball is in the sheet");
    let after = touch.network().positions_m().get(144);
    let push_n = |height_m: f64| plane.stiffness_n_per_m * (-plane.gap_m - height_m);
    // Measuring changed nothing: the network is where one period brought it, and the plane has its force.
    let mut plain = begun(&before);
    let force_n = plain.advance(at(0.002), period_s);
    assert_eq!(plain.network().positions_m().get(144), after);
    assert!((plane.normal * push_n(0.0) - force_n).length() < 1.0e-12 * force_n.length());
    for height_m in [probe_m, -probe_m] {
        let lived_n = begun(&before).advance(at(0.002) + plane.normal * height_m, period_s).dot(plane.normal);
        let (change_n, error_n) = (lived_n - push_n(0.0), push_n(height_m) - lived_n);
        // What is left is curvature: masses at the edge of the contact come and go within a tenth of a millimetre, a
        // tenth of which is asked for here.
        assert!(error_n.abs() < 0.2 * change_n.abs(), "{height_m} m: {error_n} of {change_n} N");
    }
}

#[test]
fn a_ball_near_the_network_has_the_plane_at_the_nearest_mass() {
    let above = |clearance_m: f64| {
        let at = DVec3::Z * (RADIUS_M + clearance_m);
        let mut touch = Touch::new(Network::new(&Mesh::sheet(&SHEET), TOUCHED), RADIUS_M, at);
        touch.measure_plane(at, 5.0e-3, 3.0e-4)
    };
    let plane = above(1.0e-3).expect("a millimetre is near");
    // The mass in the middle lies there to rounding.
    assert!((plane.gap_m - 1.0e-3).abs() < 1.0e-15 && plane.normal.distance(DVec3::Z) < 1.0e-12, "{plane:?}");
    // A ball that is pressed in meets at least one mass, and never more than the masses at their full contact stiffness.
    assert!(plane.stiffness_n_per_m > 10.0 && plane.stiffness_n_per_m < 4000.0, "{plane:?}");
    assert_eq!(above(1.5 * RADIUS_M), None);
}

/// The picture depends on where the ball is and not on its history, and drawing it does not change the force.
#[test]
fn the_picture_is_the_sheet_at_rest_whatever_was_before() {
    let plugin = Plugin::in_process(&flotor_membrane::FLOTOR_ENTRY).expect("a plugin");
    let make = || plugin.create_model(&[]).expect("a membrane");
    let at = |x_m: f64, z_m: f64| Input::at_rest(Pose::new(DVec3::new(x_m, 0.001, z_m), DQuat::IDENTITY));
    let (here, there) = (at(0.002, -0.004), at(-0.006, -0.001));
    let (mut direct, mut roundabout) = (make(), make());
    let picture = |model: &mut Model, input: &Input| model.shape(input).expect("a sheet");
    let first = picture(&mut direct, &here);
    let _ = [picture(&mut roundabout, &here), picture(&mut roundabout, &there)];
    let again = picture(&mut roundabout, &here);
    assert_eq!(first.surface.triangles.len(), 2 * 16 * 16);
    let centre = DVec3::new(0.002, 0.001, -0.004 + RADIUS_M);
    let mut lowest_m: f64 = 0.0;
    for (a, b) in first.surface.vertices.iter().zip(&again.surface.vertices) {
        let [a, b] = [a, b].map(|vertex| DVec3::from_array(vertex.position_m));
        // A hundredth of the depth: what a picture of a few hundred pixels shows.
        assert!(a.distance(b) < 4.0e-5, "{a} {b}");
        // The ball pushes a mass out with 400 N/m, and none of them carries more than a quarter of a newton.
        assert!(a.distance(centre) > RADIUS_M - 0.25 / 400.0, "{a} is inside the ball");
        lowest_m = lowest_m.min(a.z);
    }
    assert!(lowest_m < -0.003, "{lowest_m}");
    // Turned in the hand of an observer, it is the same picture.
    assert_eq!(picture(&mut roundabout, &here).surface.vertices, again.surface.vertices);
    let (mut seen, mut unseen) = (make(), make());
    let _ = picture(&mut seen, &there);
    for step in 0..20 {
        let input = Input { dt_ns: 1_000_000, ..at(0.0, -1.0e-4 * f64::from(step)) };
        let mut outputs = [Output::default(), Output::default()];
        let _ = [seen.step(&input, &mut outputs[0]), unseen.step(&input, &mut outputs[1])];
        let _ = picture(&mut seen, &there);
        assert_eq!(outputs[0].wrench, outputs[1].wrench, "step {step}");
    }
}
