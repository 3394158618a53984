//! Plant against closed forms (oscillator, free fall, ramps, spinning tops, pendulum), and order of the integrator.

mod tumbling;

use super::*;
use crate::hand::Hand;
use flotor_hal::glam::{DMat3, DQuat, DVec3};

const MILLISECOND_NS: u64 = 1_000_000;

/// Nothing but a mass: no gravity, no drag, centre of mass at the origin.
const BARE: FlotorParameters = FlotorParameters {
    mass_kg: 0.58,
    inertia_kg_m2: DVec3::new(3.2e-3, 3.9e-3, 5.1e-3),
    centre_of_mass_m: DVec3::ZERO,
    gravity_m_per_s2: 0.0,
    feed_forward: FeedForward::Weight,
    drag: Drag { translational_ns_per_m: 0.0, rotational_nms_per_rad: 0.0 },
};

/// Utah's flotor, whose centre of mass is off every axis, without drag or gravity.
const ECCENTRIC: FlotorParameters =
    FlotorParameters { drag: BARE.drag, gravity_m_per_s2: 0.0, ..FlotorParameters::UTAH };

const NO_IMPEDANCE: Impedance = Impedance {
    stiffness_n_per_m: DVec3::ZERO,
    damping_ns_per_m: DVec3::ZERO,
    rotational_stiffness_nm_per_rad: 0.0,
    rotational_damping_nms_per_rad: 0.0,
    mass_kg: 0.0,
};

const HOME_INTENTION: Intention = Intention::resting(Pose::HOME);

fn plant(flotor: &FlotorParameters, impedance: &Impedance, state: &State) -> Plant {
    Plant::new(flotor, impedance, state, MILLISECOND_NS).expect("physical parameters")
}

fn advance(plant: &mut Plant, piece_ns: u64, coils: &Wrench, hand: Option<&Intention>) -> Work {
    match plant.advance(piece_ns, coils, hand) {
        Outcome::Moved(work) => work,
        Outcome::Stopped => panic!("the plant stopped"),
    }
}

/// Displacement of a released oscillator `x'' + 2 d x' + k x = 0` from `x0`, `v0`, by the textbook formula.
fn released(d: f64, k: f64, x0: f64, v0: f64, t: f64) -> f64 {
    let discriminant = d * d - k;
    if discriminant.abs() < 1.0e-9 * d * d {
        (x0 + (v0 + d * x0) * t) * (-d * t).exp()
    } else if discriminant < 0.0 {
        let w = (-discriminant).sqrt();
        let (sin, cos) = (w * t).sin_cos();
        (-d * t).exp() * (x0 * cos + (v0 + d * x0) / w * sin)
    } else {
        let fast = d + discriminant.sqrt();
        let slow = k / fast; // the other root, without cancellation
        ((v0 + fast * x0) * (-slow * t).exp() - (v0 + slow * x0) * (-fast * t).exp()) / (fast - slow)
    }
}

#[test]
fn damped_oscillator_follows_the_closed_form_in_every_regime_for_two_seconds() {
    let mass_kg: f64 = 0.58;
    let critical_ns_per_m = 2.0 * (1131.0 * mass_kg).sqrt();
    let (x0, v0) = (DVec3::new(2.0e-3, -1.0e-3, 1.5e-3), DVec3::new(0.0, 0.05, -0.02));
    for (k, b) in [
        (1131.0, 0.0),
        (1131.0, 2.0),
        (1131.0, critical_ns_per_m),
        (1131.0, 200.0),
        (0.0, 2.0),
        (25.0e3, 15.0),
    ] {
        let impedance = Impedance {
            stiffness_n_per_m: DVec3::splat(k),
            damping_ns_per_m: DVec3::splat(0.5 * b),
            ..NO_IMPEDANCE
        };
        let drag = Drag { translational_ns_per_m: 0.5 * b, rotational_nms_per_rad: 0.0 };
        let start = State { position_m: x0, velocity_m_per_s: v0, ..State::HOME };
        let mut plant = plant(&FlotorParameters { drag, ..BARE }, &impedance, &start);
        // Without a spring the motion is bounded by v m / b.
        let amplitude_m = 2.0e-3_f64.max(if k == 0.0 { 0.05 * mass_kg / b } else { 0.0 });
        for tick in 1..=2000 {
            advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, Some(&HOME_INTENTION));
            let t = f64::from(tick) * 1.0e-3;
            let expected = DVec3::from_array(
                [0, 1, 2].map(|axis| released(0.5 * b / mass_kg, k / mass_kg, x0[axis], v0[axis], t)),
            );
            let error = (plant.state().position_m - expected).abs().max_element();
            assert!(error <= 1.0e-12 * amplitude_m, "k {k} b {b} t {t}: {error:e}");
        }
    }
}

#[test]
fn a_released_flotor_falls_along_a_parabola() {
    let falling = FlotorParameters {
        gravity_m_per_s2: STANDARD_GRAVITY_M_PER_S2,
        feed_forward: FeedForward::Force(0.0),
        ..BARE
    };
    for centre_of_mass_m in [DVec3::ZERO, FlotorParameters::UTAH.centre_of_mass_m] {
        let mut plant = plant(&FlotorParameters { centre_of_mass_m, ..falling }, &NO_IMPEDANCE, &State::HOME);
        for tick in 1..=1000 {
            advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, None);
            let t = f64::from(tick) * 1.0e-3;
            let expected_m = -0.5 * STANDARD_GRAVITY_M_PER_S2 * t * t;
            // One rounding of position and velocity per tick.
            let error = (plant.state().position_m - DVec3::new(0.0, 0.0, expected_m)).length();
            assert!(error <= 1000.0 * f64::EPSILON * expected_m.abs().max(1.0e-3), "{tick}: {error:e}");
        }
        assert_eq!(plant.state().orientation, DQuat::IDENTITY, "gravity alone turns nothing");
    }
}

#[test]
fn a_constant_force_against_drag_approaches_its_terminal_velocity() {
    let (force_n, b, m) = (3.0, 2.0, 0.58);
    let drag = Drag { translational_ns_per_m: b, rotational_nms_per_rad: 0.0 };
    let mut plant = plant(&FlotorParameters { drag, ..BARE }, &NO_IMPEDANCE, &State::HOME);
    let coils = Wrench { force_n: DVec3::new(0.0, force_n, 0.0), torque_nm: DVec3::ZERO };
    for tick in 1..=2000 {
        advance(&mut plant, MILLISECOND_NS, &coils, None);
        let t = f64::from(tick) * 1.0e-3;
        let approach = -(-b * t / m).exp_m1();
        let State { position_m, velocity_m_per_s, .. } = plant.state();
        assert!((velocity_m_per_s.y - force_n / b * approach).abs() <= 1.0e-12 * force_n / b);
        assert!(
            (position_m.y - force_n / b * (t - m / b * approach)).abs() <= 1.0e-12 * force_n / b * t.max(0.1)
        );
    }
}

#[test]
fn a_hand_that_moves_on_steadily_pulls_the_flotor_exactly() {
    let (k, b, m, pace) = (2000.0, 70.0, 0.58, 0.03);
    let impedance =
        Impedance { stiffness_n_per_m: DVec3::splat(k), damping_ns_per_m: DVec3::splat(b), ..NO_IMPEDANCE };
    let mut plant = plant(&BARE, &impedance, &State::HOME);
    for tick in 0..500 {
        let t = f64::from(tick) * 1.0e-3;
        let velocity_m_per_s = DVec3::new(0.0, 0.0, -pace);
        let intention = Intention { position_m: velocity_m_per_s * t, velocity_m_per_s, ..HOME_INTENTION };
        advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, Some(&intention));
        // Seen from the hand the flotor is an oscillator released with the opposite velocity.
        let t = t + 1.0e-3;
        let expected_m = -pace * t + released(0.5 * b / m, k / m, 0.0, pace, t);
        assert!((plant.state().position_m.z - expected_m).abs() <= 1.0e-12 * pace * t, "{tick}");
    }
}

#[test]
fn on_the_axis_nothing_turns_however_deep_the_centre_of_mass() {
    let start = State { position_m: DVec3::new(0.0, 0.0, -2.0e-3), ..State::HOME };
    let mut plant = plant(&FlotorParameters::THESIS, &Hand::EXPLORING.impedance, &start);
    for _ in 0..1000 {
        let coils = Wrench { force_n: -1131.0 * plant.state().position_m, torque_nm: DVec3::ZERO };
        advance(&mut plant, MILLISECOND_NS, &coils, None);
        let State { position_m, orientation, angular_velocity_rad_per_s, .. } = plant.state();
        assert_eq!((position_m.x, position_m.y), (0.0, 0.0));
        assert_eq!((orientation, angular_velocity_rad_per_s), (DQuat::IDENTITY, DVec3::ZERO));
    }
}

#[test]
fn the_straight_step_is_the_limit_of_the_turning_one() {
    let impedance = Impedance::FIRM;
    let hardly_turning = State { angular_velocity_rad_per_s: DVec3::Z * 1.0e-60, ..State::HOME };
    let runs = [State::HOME, hardly_turning].map(|start| {
        let mut plant = plant(&FlotorParameters::THESIS, &impedance, &start);
        let velocity_m_per_s = DVec3::new(0.0, 0.0, -0.02);
        let mut work = Work::default();
        for tick in 0..100 {
            let position_m = velocity_m_per_s * (f64::from(tick) * 1.0e-3);
            let intention = Intention { position_m, velocity_m_per_s, ..HOME_INTENTION };
            let coils = Wrench { force_n: plant.state().position_m * -1131.0, torque_nm: DVec3::ZERO };
            work += advance(&mut plant, MILLISECOND_NS, &coils, Some(&intention));
        }
        (plant.state(), work)
    });
    let [(straight, straight_work), (turning, turning_work)] = runs;
    // Rounding of 100 steps against 400 finer ones.
    assert!((straight.position_m - turning.position_m).length() <= 1.0e-13 * 2.0e-3);
    assert!((straight.velocity_m_per_s - turning.velocity_m_per_s).length() <= 1.0e-13 * 0.02);
    assert!((straight_work.hand_j - turning_work.hand_j).abs() <= 1.0e-12 * straight_work.hand_j.abs());
    assert!(
        (straight_work.dissipated_j - turning_work.dissipated_j).abs()
            <= 1.0e-12 * straight_work.dissipated_j
    );
}

#[test]
fn a_tumbling_flotor_keeps_angular_momentum_and_energy() {
    // Close to the unstable middle axis, the hardest case.
    let spin = DVec3::new(0.8, 7.9, 0.5);
    let mut plant = plant(&BARE, &NO_IMPEDANCE, &State { angular_velocity_rad_per_s: spin, ..State::HOME });
    let momentum = |state: &State| {
        let attitude = DMat3::from_quat(state.orientation);
        attitude * (BARE.inertia_kg_m2 * (attitude.transpose() * state.angular_velocity_rad_per_s))
    };
    let (momentum_before, energy_before) = (momentum(&plant.state()), plant.energy().kinetic_j);
    for second in 1..=10 {
        for _ in 0..1000 {
            advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, None);
        }
        let elapsed_s = f64::from(second);
        let now = momentum(&plant.state());
        let drift = (now.length() / momentum_before.length() - 1.0).abs();
        assert!(drift <= 1.0e-12 * elapsed_s, "|L| {drift:e} after {elapsed_s} s");
        let drift = (plant.energy().kinetic_j / energy_before - 1.0).abs();
        assert!(drift <= 1.0e-12 * elapsed_s, "energy {drift:e} after {elapsed_s} s");
        // The direction carries the attitude's error: at w h = 0.008 rounding of ten thousand steps.
        let turned = now.normalize().cross(momentum_before.normalize()).length();
        assert!(turned <= 1.0e-12, "direction {turned:e} after {elapsed_s} s");
    }
}

#[test]
fn a_symmetric_top_precesses_at_the_textbook_rate() {
    let (across, along) = (3.2e-3, 5.1e-3);
    let top = FlotorParameters { inertia_kg_m2: DVec3::new(across, across, along), ..BARE };
    let spin = DVec3::new(1.0, 0.0, 6.0);
    let mut plant = plant(&top, &NO_IMPEDANCE, &State { angular_velocity_rad_per_s: spin, ..State::HOME });
    for _ in 0..1000 {
        advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, None);
    }
    let State { orientation, angular_velocity_rad_per_s, .. } = plant.state();
    let body = orientation.conjugate() * angular_velocity_rad_per_s;
    // In the body's frame the spin circles the axis at (I3 - I1) / I1 times its axial part.
    let (sin, cos) = ((along - across) / across * spin.z).sin_cos();
    // Runge-Kutta: (3.6e-3)^7 per step is nothing; rounding of numbers of order 6 in 1000 steps.
    assert!((body - DVec3::new(cos, sin, spin.z)).length() <= 1.0e-12, "{body}");
}

#[test]
fn without_outer_forces_the_centre_of_mass_moves_in_a_straight_line() {
    let spin = DVec3::new(3.0, -2.0, 5.0);
    let start = State {
        velocity_m_per_s: DVec3::new(0.01, 0.02, -0.03),
        angular_velocity_rad_per_s: spin,
        ..State::HOME
    };
    let centre = ECCENTRIC.centre_of_mass_m;
    let mut plant = plant(&ECCENTRIC, &NO_IMPEDANCE, &start);
    let velocity = start.velocity_m_per_s + spin.cross(centre);
    for tick in 1..=1000 {
        advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, None);
        let state = plant.state();
        let now = state.position_m + state.orientation * centre;
        let expected = centre + velocity * (f64::from(tick) * 1.0e-3);
        // Rounding only: the Runge-Kutta method never touches it.
        assert!((now - expected).length() <= 1.0e-14, "{tick}: {:e}", (now - expected).length());
    }
}

#[test]
fn held_at_the_origin_the_flotor_swings_like_a_pendulum() {
    let flotor = FlotorParameters {
        drag: BARE.drag,
        feed_forward: FeedForward::Force(0.0),
        ..FlotorParameters::THESIS
    };
    // A hand that pins the handle but lets it turn; damped, so that only the swing is left.
    let impedance = Impedance {
        stiffness_n_per_m: DVec3::splat(1.0e5),
        damping_ns_per_m: DVec3::splat(200.0),
        ..NO_IMPEDANCE
    };
    let start = State { orientation: DQuat::from_rotation_x(0.01), ..State::HOME };
    let mut plant = plant(&flotor, &impedance, &start);
    let (m, g, l) = (flotor.mass_kg, flotor.gravity_m_per_s2, flotor.centre_of_mass_m.z);
    let rate_per_s = (m * g * -l / (flotor.inertia_kg_m2.x + m * l * l)).sqrt();
    let mut crossings_s = Vec::new();
    let mut before = start.orientation.x;
    for tick in 1..=5000 {
        advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, Some(&HOME_INTENTION));
        let now = plant.state().orientation.x;
        if before > 0.0 && now <= 0.0 {
            crossings_s.push((f64::from(tick) - now / (now - before)) * 1.0e-3);
        }
        before = now;
    }
    let periods = crossings_s.len() - 1;
    let period_s = (crossings_s[periods] - crossings_s[0]) / periods as f64;
    let measured_per_s = std::f64::consts::TAU / period_s;
    // Amplitude: (0.01 rad)^2 / 16 = 6e-6; give of the pin: (m l w)^2 / (2 K (I + m l^2)) = 2e-5.
    assert!((measured_per_s / rate_per_s - 1.0).abs() <= 5.0e-5, "{measured_per_s} {rate_per_s}");
}

/// Everything at once: eccentric, spinning, held by a moving hand, pushed and turned by the coils.
fn coupled_run(spin_rad_per_s: DVec3, piece_ns: u64, pieces: u64) -> State {
    let flotor = FlotorParameters { feed_forward: FeedForward::Force(7.7), ..FlotorParameters::UTAH };
    // Soft enough that a millisecond is one step.
    let impedance = Impedance { mass_kg: 0.0, ..Impedance::RELAXED };
    let start = State {
        position_m: DVec3::new(1.0e-3, -2.0e-3, 0.5e-3),
        orientation: DQuat::from_scaled_axis(DVec3::new(0.05, -0.04, 0.08)),
        velocity_m_per_s: DVec3::new(0.02, 0.01, -0.04),
        angular_velocity_rad_per_s: spin_rad_per_s,
    };
    let coils = Wrench { force_n: DVec3::new(2.0, -1.0, 4.0), torque_nm: DVec3::new(0.05, 0.03, -0.04) };
    let mut plant = Plant::new(&flotor, &impedance, &start, piece_ns).expect("physical parameters");
    let velocity_m_per_s = DVec3::new(0.01, 0.02, -0.03);
    for piece in 0..pieces {
        let t = (piece * piece_ns) as f64 * 1.0e-9;
        let intention = Intention { position_m: velocity_m_per_s * t, velocity_m_per_s, ..HOME_INTENTION };
        advance(&mut plant, piece_ns, &coils, Some(&intention));
    }
    plant.state()
}

fn distance(a: &State, b: &State) -> f64 {
    // Millimetres and milliradians count alike.
    (a.position_m - b.position_m).length() + 2.0 * (a.orientation.conjugate() * b.orientation).xyz().length()
}

#[test]
fn halving_the_step_divides_the_error_of_the_coupled_motion_by_sixty_four() {
    // Fast enough that the error shows above rounding, a quarter of a radian in a millisecond, and short enough
    // that the spring of the hand is not turned over.
    let spin_rad_per_s = DVec3::new(120.0, -200.0, 150.0);
    let duration_ns = 8_000_000;
    let run = |piece_ns| coupled_run(spin_rad_per_s, piece_ns, duration_ns / piece_ns);
    let exact = run(31_250);
    let errors = [1_000_000, 500_000].map(|ns| distance(&run(ns), &exact));
    let order = (errors[0] / errors[1]).log2();
    assert!((5.5..6.5).contains(&order), "order {order}, errors {errors:?}");
}

#[test]
fn a_hand_with_mass_makes_the_flotor_heavier_at_the_handle() {
    let impedance = Impedance { mass_kg: 0.42, ..NO_IMPEDANCE };
    let coils = Wrench { force_n: DVec3::new(0.0, 0.0, 2.0), torque_nm: DVec3::ZERO };
    let mut plant = plant(&BARE, &impedance, &State::HOME);
    for _ in 0..100 {
        advance(&mut plant, MILLISECOND_NS, &coils, Some(&HOME_INTENTION));
    }
    // 0.58 + 0.42 kg: 2 m/s^2 for 0.1 s.
    assert!((plant.state().velocity_m_per_s.z - 0.2).abs() <= 1.0e-14);
}

#[test]
fn off_centre_a_hand_with_mass_moves_as_two_rigidly_joined_masses_would() {
    let hand_kg = 0.42;
    let impedance = Impedance { mass_kg: hand_kg, ..NO_IMPEDANCE };
    let start = State { angular_velocity_rad_per_s: DVec3::new(2.0, -3.0, 1.0), ..State::HOME };
    let mut plant = plant(&ECCENTRIC, &impedance, &start);
    // Momentum and angular momentum about the device origin of flotor and hand, from first principles.
    let momenta = |state: &State| {
        let attitude = DMat3::from_quat(state.orientation);
        let arm = attitude * ECCENTRIC.centre_of_mass_m;
        let spin = state.angular_velocity_rad_per_s;
        let flotor = ECCENTRIC.mass_kg * (state.velocity_m_per_s + spin.cross(arm));
        let hand = hand_kg * state.velocity_m_per_s;
        let own = attitude * (ECCENTRIC.inertia_kg_m2 * (attitude.transpose() * spin));
        (flotor + hand, (state.position_m + arm).cross(flotor) + state.position_m.cross(hand) + own)
    };
    let (linear, angular) = momenta(&plant.state());
    for _ in 0..1000 {
        advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, Some(&HOME_INTENTION));
    }
    let (linear_after, angular_after) = momenta(&plant.state());
    assert!((linear_after - linear).length() <= 1.0e-13 * linear.length());
    // Runge-Kutta: (3.7e-3)^7 per step is nothing; rounding of 1000 steps.
    assert!((angular_after - angular).length() <= 1.0e-12 * angular.length());
}

#[test]
fn parameters_that_are_not_physical_are_refused_by_name() {
    let refused = |flotor: FlotorParameters, impedance: Impedance| {
        Plant::new(&flotor, &impedance, &State::HOME, MILLISECOND_NS).expect_err("refused")
    };
    let negative = refused(FlotorParameters { mass_kg: -0.58, ..BARE }, NO_IMPEDANCE);
    assert_eq!(negative, InvalidParameter::NotPositive { name: "mass_kg", value: -0.58 });
    let impossible =
        refused(FlotorParameters { inertia_kg_m2: DVec3::new(1.0, 1.0, 3.0), ..BARE }, NO_IMPEDANCE);
    assert!(matches!(impossible, InvalidParameter::ImpossibleInertia { .. }));
    let stiff = Impedance { stiffness_n_per_m: DVec3::splat(1.0e9), ..NO_IMPEDANCE };
    assert!(matches!(refused(BARE, stiff), InvalidParameter::TooStiff { .. }));
    let stiff = Impedance { rotational_stiffness_nm_per_rad: 1.0e9, ..NO_IMPEDANCE };
    assert!(matches!(refused(BARE, stiff), InvalidParameter::TooStiff { .. }));
}

#[test]
fn a_wrench_beyond_all_measure_stops_the_flotor_and_leaves_finite_numbers() {
    let mut plant = plant(&ECCENTRIC, &NO_IMPEDANCE, &State::HOME);
    let coils = Wrench { force_n: DVec3::splat(1.0e300), torque_nm: DVec3::splat(-1.0e300) };
    assert_eq!(plant.advance(MILLISECOND_NS, &coils, None), Outcome::Stopped);
    assert_eq!(plant.state(), State::HOME);
}
