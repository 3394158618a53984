//! Forces on the tool and motions of the bodies against closed forms.

use flotor_hal::{ContactSet, ContactSetModel, DQuat, DVec3, ForceModel, Input, Pose};
use flotor_world::file::{World, parse};
use flotor_world::simulation::Simulation;
use flotor_world::touch::Law;

const LAW: Law = Law { stiffness_n_per_m: 500.0, damping_ns_per_m: 4.0 };
const STEP_S: f64 = 1.0e-3;
const GRAVITY_M_PER_S2: f64 = 9.81;

fn world(text: &str) -> World {
    parse(text).expect("the world is right")
}

fn at(position_m: DVec3) -> Pose {
    Pose::new(position_m, DQuat::IDENTITY)
}

/// Moves the handle along a path for a time, and returns the forces on the hand, N.
fn run(simulation: &mut Simulation, seconds: f64, path: impl Fn(f64) -> DVec3) -> Vec<DVec3> {
    let time = |step: u32| f64::from(step) * STEP_S;
    (0_u32..)
        .take_while(|step| time(*step) < seconds + 0.5 * STEP_S)
        .map(|step| {
            simulation.advance(&[at(path(time(step)))], if step == 0 { 0.0 } else { STEP_S }, &LAW, STEP_S);
            simulation.on_hand_n(0)
        })
        .collect()
}

fn mean(forces_n: &[DVec3]) -> DVec3 {
    forces_n.iter().sum::<DVec3>() / forces_n.len() as f64
}

const TRAY: &str = "[tool]\nshape = \"box\"\nsize_mm = [50, 50, 4]\nposition_mm = [0, 0, -2]\nfriction = 0.5\n\
                    [[body]]\nname = \"box\"\nshape = \"box\"\nsize_mm = [30, 30, 30]\nmass_g = 100\n\
                    position_mm = [0, 0, 15.1]\nfriction = 0.5\n";

#[test]
fn a_box_on_a_tray_weighs_its_weight_after_half_a_second() {
    let mut simulation = Simulation::new(&world(TRAY), 1);
    let forces_n = run(&mut simulation, 2.0, |_| DVec3::ZERO);
    let weight_n = 0.1 * GRAVITY_M_PER_S2;
    for force_n in &forces_n[500..] {
        assert!((force_n.z / -weight_n - 1.0).abs() < 0.01, "{force_n}");
        assert!(force_n.truncate().length() < 1.0e-3 * weight_n, "{force_n}");
    }
    assert!(forces_n.iter().all(|force_n| force_n.z <= 0.0), "the box only pushes");
}

#[test]
fn a_tray_that_accelerates_feels_mass_times_acceleration() {
    let mut simulation = Simulation::new(&world(TRAY), 1);
    let _ = run(&mut simulation, 1.0, |_| DVec3::ZERO);
    // From rest with 2 m/s² for 0.3 s: the spring settles in the first third.
    let forces_n = run(&mut simulation, 0.3, |time_s| DVec3::Z * (time_s * time_s));
    let felt_n = -mean(&forces_n[200..]).z;
    let expected_n = 0.1 * (GRAVITY_M_PER_S2 + 2.0);
    assert!((felt_n / expected_n - 1.0).abs() < 0.02, "{felt_n} N, not {expected_n} N");
}

#[test]
fn a_box_slips_on_the_tray_where_coulomb_says() {
    // The tray tilts slowly about y: the box slips at tan(angle) = mu.
    let mut simulation = Simulation::new(&world(TRAY), 1);
    let _ = run(&mut simulation, 0.5, |_| DVec3::ZERO);
    let tilted = |angle_rad: f64| Pose::new(DVec3::ZERO, DQuat::from_axis_angle(DVec3::Y, angle_rad));
    let along_m = |simulation: &Simulation, angle_rad: f64| {
        let position_m = simulation.bodies().pose(0).expect("there is a box").position();
        (tilted(angle_rad).orientation().conjugate() * position_m).x
    };
    let mut angle_rad = 0.0;
    let start_m = along_m(&simulation, 0.0);
    while along_m(&simulation, angle_rad) - start_m < 2.5e-3 {
        angle_rad += 0.05 * STEP_S;
        assert!(angle_rad < 1.0, "it never slips");
        simulation.advance(&[tilted(angle_rad)], STEP_S, &LAW, STEP_S);
    }
    // Up to the slip the box moves by its weight over the stiffness of the friction, less than 1 mm.
    assert!((angle_rad.tan() / 0.5 - 1.0).abs() < 0.02, "tan is {}", angle_rad.tan());
}

const SLIDE: &str = "gravity_m_per_s2 = 0\n[tool]\nshape = \"ball\"\nradius_mm = 4\n[[body]]\nname = \"slider\"\n\
                     shape = \"box\"\nsize_mm = [20, 20, 20]\nmass_g = 200\nposition_mm = [0, 15, 0]\nfriction = 0\n\
                     [[joint]]\nkind = \"slide\"\nbody = \"slider\"\naxis = [0, 1, 0]\nstops_mm = [-5, 5]\n\
                     friction_n = 1\n";

#[test]
fn a_joint_rubs_with_its_friction_and_ends_at_its_stop() {
    let mut simulation = Simulation::new(&world(SLIDE), 1);
    // Up to the box at y = 1 mm, and on at 10 mm/s.
    let forces_n = run(&mut simulation, 0.5, |time_s| DVec3::Y * (0.01 * time_s));
    let felt_n = -mean(&forces_n[350..450]).y;
    assert!((felt_n - 1.0).abs() < 0.02, "{felt_n} N, not 1 N");
    // To 2 mm into the box at its stop: the spring alone.
    let forces_n = run(&mut simulation, 1.5, |time_s| DVec3::Y * (0.005 + 0.005 * time_s.min(1.0)));
    let slid_m = simulation.bodies().pose(0).expect("there is a slider").position().y - 0.015;
    assert!((slid_m - 0.005).abs() < 5.0e-5, "at {slid_m} m");
    let expected_n = LAW.stiffness_n_per_m * (0.01 + 0.004 - 0.01);
    let felt_n = -forces_n.last().expect("it ran").y;
    assert!((felt_n / expected_n - 1.0).abs() < 0.02, "{felt_n} N, not {expected_n} N");
}

#[test]
fn a_joint_holds_below_its_friction() {
    let mut simulation = Simulation::new(&world(SLIDE), 1);
    // 1.5 mm deep: 0.75 N.
    let forces_n = run(&mut simulation, 5.0, |time_s| DVec3::Y * 0.0025 * time_s.min(1.0));
    let slid_m = simulation.bodies().pose(0).expect("there is a slider").position().y - 0.015;
    assert!(slid_m.abs() < 1.0e-5, "it creeps by {slid_m} m");
    assert!((forces_n.last().expect("it ran").y + 0.75).abs() < 0.01);
}

#[test]
fn a_falling_body_keeps_its_energy() {
    let text = TRAY.replace("position_mm = [0, 0, 15.1]", "position_mm = [200, 0, 15.1]");
    let mut simulation = Simulation::new(&world(&text), 1);
    let start = simulation.energy();
    let _ = run(&mut simulation, 0.5, |_| DVec3::ZERO);
    let end = simulation.energy();
    let fallen_j = start.potential_j - end.potential_j;
    assert!((end.kinetic_j / fallen_j - 1.0).abs() < 0.005, "{} J of {fallen_j} J", end.kinetic_j);
    let expected_m = 0.5 * GRAVITY_M_PER_S2 * 0.25;
    assert!((fallen_j / (0.1 * GRAVITY_M_PER_S2) / expected_m - 1.0).abs() < 0.005);
}

fn model(pairs: &[(&str, &str)]) -> flotor_world::Touched {
    use flotor_hal::Settings;
    assert!(pairs.is_empty());
    flotor_world::Touched::create(&Settings::defaults(flotor_world::Touched::PARAMETERS))
        .expect("it is right")
}

/// Answers of the stack under a tray that swings up and down, at 250 Hz.
fn answers(model: &mut flotor_world::Touched, count: u64) -> Vec<ContactSet> {
    (0..count)
        .map(|call| {
            let time_s = call as f64 * 0.004;
            let pose = at(DVec3::Z * 0.005 * (6.0 * time_s).sin());
            let dt_ns = if call == 0 { 0 } else { 4_000_000 };
            model.contact_set(&Input { time_ns: call * 4_000_000, dt_ns, ..Input::at_rest(pose) })
        })
        .collect()
}

#[test]
fn two_worlds_and_a_reset_one_answer_the_same_to_the_bit() {
    let (mut one, mut other) = (model(&[]), model(&[]));
    let first = answers(&mut one, 500);
    assert!(first.iter().any(|set| set.contacts().iter().any(|contact| contact.gap_m < 0.0)));
    assert_eq!(first, answers(&mut other, 500));
    one.reset();
    assert_eq!(first, answers(&mut one, 500));
}

#[test]
fn a_pose_that_is_not_finite_has_no_contacts_and_the_world_goes_on() {
    let mut model = model(&[]);
    let _ = answers(&mut model, 100);
    let lost = Input { dt_ns: 4_000_000, time_ns: 400_000_000, ..Input::at_rest(at(DVec3::NAN)) };
    assert_eq!(model.contact_set(&lost).contacts(), &[]);
    let back = Input { dt_ns: 4_000_000, time_ns: 404_000_000, ..Input::at_rest(Pose::HOME) };
    assert!(!model.contact_set(&back).contacts().is_empty());
}

#[test]
fn gaps_agree_with_their_points_and_the_tool_is_near() {
    let mut model = model(&[]);
    for set in answers(&mut model, 500) {
        for contact in set.contacts() {
            let [tool_m, surface_m, normal] = [
                set.anchor.position() + set.anchor.orientation() * DVec3::from_array(contact.tool_point_m),
                DVec3::from_array(contact.surface_point_m),
                DVec3::from_array(contact.normal),
            ];
            assert!(((tool_m - surface_m).dot(normal) - contact.gap_m).abs() < 1.0e-12);
            assert!((normal.length() - 1.0).abs() < 1.0e-12);
        }
    }
}

const BEAM: &str = "[tool]\nshape = \"box\"\nsize_mm = [20, 20, 4]\nposition_mm = [0, 0, -2]\nfriction = 0.5\n\
                    [[body]]\nname = \"beam\"\nshape = \"box\"\nsize_mm = [80, 20, 10]\nmass_g = 100\n\
                    position_mm = [0, 0, 5.1]\nfriction = 0.5\n";

#[test]
fn two_hands_carry_a_weight_together_and_one_feels_the_other_leave() {
    let mut simulation = Simulation::new(&world(BEAM), 2);
    let places = |left_m: f64| [at(DVec3::new(-0.03, 0.0, left_m)), at(DVec3::new(0.03, 0.0, 0.0))];
    let weight_n = 0.1 * GRAVITY_M_PER_S2;
    for step in 0..2_000 {
        simulation.advance(&places(0.0), if step == 0 { 0.0 } else { STEP_S }, &LAW, STEP_S);
        let [left_n, right_n] = [0, 1].map(|hand| -simulation.on_hand_n(hand).z);
        if step >= 500 {
            assert!(((left_n + right_n) / weight_n - 1.0).abs() < 0.01, "{left_n} N and {right_n} N");
            assert!((left_n / right_n - 1.0).abs() < 0.01, "{left_n} N and {right_n} N");
        }
    }
    let before_n = simulation.on_hand_n(1).z;
    // The left hand goes down with 1 m/s: the other has a part of the weight within 20 ms.
    for step in 1..=20 {
        simulation.advance(&places(-1.0e-3 * f64::from(step)), STEP_S, &LAW, STEP_S);
    }
    let change = (simulation.on_hand_n(1).z / before_n - 1.0).abs();
    assert!(change > 0.05, "the right hand feels {change} of its force");
}
