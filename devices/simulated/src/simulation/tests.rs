//! Whole runs: energy balance, splitting of ticks, release of the handle, and finite results for any input.

mod guided;

use super::*;
use crate::hand::{Impedance, Pose, Script, Unsteadiness};
use crate::plant::FeedForward;
use flotor_hal::glam::{DQuat, DVec3};

const MILLISECOND_NS: u64 = 1_000_000;

/// Stiffness of spring 1 of the thesis at the handle, N/m (gamma / V = 16.97 N / 15 mm).
const SPRING_1_N_PER_M: f64 = 16.97 / 15.0e-3;

fn free() -> Setup {
    Setup { hand: Hand::AWAY, ..Setup::DEMO }
}

const LOWERED: State = State { position_m: DVec3::new(0.0, 0.0, -2.0e-3), ..State::HOME };

fn askew() -> State {
    State {
        position_m: DVec3::new(3.0e-3, -1.0e-3, -2.0e-3),
        orientation: DQuat::from_scaled_axis(DVec3::new(0.05, -0.03, 0.04)),
        ..State::HOME
    }
}

fn pose(state: &State) -> Pose {
    Pose { position_m: state.position_m, orientation: state.orientation }
}

/// A spring and a torsional spring as a servo renders them: from the pose at the tick, held until the next.
fn spring(state: &State, stiffness_n_per_m: f64, stiffness_nm_per_rad: f64) -> Wrench {
    let turn = state.orientation.xyz() * 2.0_f64.copysign(state.orientation.w);
    Wrench { force_n: state.position_m * -stiffness_n_per_m, torque_nm: turn * -stiffness_nm_per_rad }
}

fn simulation(setup: &Setup) -> Simulation {
    Simulation::new(setup).expect("physical setup")
}

#[test]
fn energy_balances_in_every_kind_of_run() {
    let hand = |impedance, trajectory| Hand { impedance, trajectory, ..Hand::EXPLORING };
    let press = Trajectory::Press { depth_m: 6.0e-3, start_s: 0.2, rise_s: 0.4 };
    let hold = Trajectory::Hold(pose(&askew()));
    let release = Trajectory::Release { from: pose(&askew()), at_ns: 700_300_000 };
    let heavy = FlotorParameters { feed_forward: FeedForward::Force(5.0), ..FlotorParameters::UTAH };
    let runs = [
        ("released from 2 mm", Setup { start: LOWERED, ..free() }),
        ("released askew", Setup { start: askew(), ..free() }),
        ("released askew, eccentric", Setup { start: askew(), flotor: FlotorParameters::UTAH, ..free() }),
        ("exploring", Setup::DEMO),
        ("exploring, eccentric", Setup { flotor: FlotorParameters::UTAH, ..Setup::DEMO }),
        ("exploring, not compensated", Setup { flotor: heavy, ..Setup::DEMO }),
        ("exploring at 100 Hz", Setup { tick_ns: 10 * MILLISECOND_NS, ..Setup::DEMO }),
        ("exploring at 3 kHz", Setup { tick_ns: 333_333, ..Setup::DEMO }),
        ("pressed by a relaxed hand", Setup { hand: hand(Impedance::RELAXED, press.clone()), ..Setup::DEMO }),
        (
            "pressed, gripped askew",
            Setup { hand: hand(Impedance::FIRM, press), start: askew(), ..Setup::DEMO },
        ),
        ("held askew", Setup { hand: hand(Impedance::FIRM, hold), ..Setup::DEMO }),
        (
            "let go by a hand without mass",
            Setup {
                hand: hand(Impedance { mass_kg: 0.0, ..Impedance::RELAXED }, release.clone()),
                ..Setup::DEMO
            },
        ),
        (
            "let go by a hand with mass",
            Setup { hand: hand(Impedance::FIRM, release), flotor: heavy, ..Setup::DEMO },
        ),
    ];
    for (name, setup) in runs {
        let mut simulation = simulation(&setup);
        let mut worst_j: f64 = 0.0;
        while simulation.time_ns() < 3_000_000_000 {
            // Soft enough that a servo of 100 Hz does not pump it up.
            let coils = spring(&simulation.state(), 0.4 * SPRING_1_N_PER_M, 1.0);
            assert!(simulation.advance(setup.tick_ns, coils).is_empty());
            worst_j = worst_j.max(simulation.ledger().imbalance_j().abs());
        }
        let peak_j = simulation.ledger().peak_j();
        assert!(worst_j <= 1.0e-9 * peak_j, "{name}: {worst_j:e} J of {peak_j:e} J");
    }
}

/// A built-in script, done by a trembling hand.
fn scripted(name: &str) -> Setup {
    let script = Script::load(name).expect("built in");
    let impedance = script.grip().expect("it says").impedance();
    let unsteadiness = Unsteadiness { tremor_m: 50.0e-6, force_share: 0.04 };
    let hand = Hand { impedance, trajectory: Trajectory::Scripted(script), unsteadiness };
    Setup { hand, seed: 7, ..Setup::DEMO }
}

#[test]
fn energy_balances_in_every_script() {
    for name in Script::NAMES {
        for flotor in [FlotorParameters::THESIS, FlotorParameters::UTAH] {
            let setup = Setup { flotor, ..scripted(name) };
            let mut simulation = simulation(&setup);
            let mut worst_j: f64 = 0.0;
            for _ in 0..9000 {
                let coils = spring(&simulation.state(), SPRING_1_N_PER_M, 1.0);
                assert!(simulation.advance(MILLISECOND_NS, coils).is_empty(), "{name}");
                worst_j = worst_j.max(simulation.ledger().imbalance_j().abs());
            }
            let peak_j = simulation.ledger().peak_j();
            assert!(worst_j <= 1.0e-9 * peak_j, "{name}: {worst_j:e} J of {peak_j:e} J");
        }
    }
}

#[test]
fn scripts_do_to_the_handle_what_their_names_say() {
    /// Largest displacement (mm) along and rotation (degrees) about each axis.
    fn reach(name: &str) -> (DVec3, DVec3) {
        let setup =
            Setup { hand: Hand { unsteadiness: Unsteadiness::NONE, ..scripted(name).hand }, ..Setup::DEMO };
        let mut simulation = simulation(&setup);
        let (mut moved_m, mut turned_rad) = (DVec3::ZERO, DVec3::ZERO);
        for _ in 0..8000 {
            let coils = spring(&simulation.state(), SPRING_1_N_PER_M, 1.0);
            simulation.advance(MILLISECOND_NS, coils);
            assert_eq!(simulation.sensor_range(), SensorRange::Inside, "{name}");
            moved_m = moved_m.max(simulation.state().position_m.abs());
            turned_rad = turned_rad.max(Pose::HOME.rotation_to(&pose(&simulation.state())).abs());
        }
        (moved_m * 1.0e3, turned_rad.map(f64::to_degrees))
    }
    // A firm hand gets 64 % of the way against this spring (2000 of 2000 + 1131 N/m), and overshoots a little.
    assert!((3.0..5.0).contains(&reach("press").0.z));
    assert!(reach("hold").0.z < 0.7, "a relaxed hand of 135 N/m gets a ninth of the way");
    assert!(reach("release").0.z > 2.0);
    let (sheared_mm, _) = reach("shear");
    assert!(sheared_mm.x > 1.5 && sheared_mm.y > 1.5 && sheared_mm.z > 1.0, "{sheared_mm}");
    let (_, tilted_deg) = reach("tilt");
    assert!(tilted_deg.x > 2.0 && tilted_deg.y > 2.0, "{tilted_deg}");
    assert!((0.5..3.0).contains(&reach("tap").0.z));
    // 5 N on 1131 N/m are 4.4 mm; the damping of the hand takes some.
    assert!((2.0..6.0).contains(&reach("push").0.z), "{}", reach("push").0.z);
}

#[test]
fn a_pushing_hand_gives_the_force_it_means() {
    let script =
        Script::parse("push", "[[step]]\npush = { force_n = [0, 0, -4], frequency_hz = 0.05, pulses = 1 }\n");
    let hand = Hand { trajectory: Trajectory::Scripted(script.expect("a script")), ..Hand::EXPLORING };
    let mut simulation = simulation(&Setup { hand, ..Setup::DEMO });
    for _ in 0..10_000 {
        let coils = spring(&simulation.state(), SPRING_1_N_PER_M, 0.0);
        simulation.advance(MILLISECOND_NS, coils);
    }
    // At the peak of a pulse of twenty seconds: the spring holds the force; what inertia (w^2 m x) adds is 1e-4.
    let held_n = -simulation.state().position_m.z * SPRING_1_N_PER_M;
    assert!((held_n / 4.0 - 1.0).abs() < 1.0e-3, "{held_n} N");
}

#[test]
fn energy_balances_to_rounding_when_nothing_turns() {
    for setup in [Setup { start: LOWERED, ..free() }, Setup::DEMO] {
        let mut simulation = simulation(&setup);
        for _ in 0..3000 {
            let coils = spring(&simulation.state(), SPRING_1_N_PER_M, 0.0);
            simulation.advance(MILLISECOND_NS, coils);
        }
        let ledger = simulation.ledger();
        // The works are sums of 3000 terms as large as the peak at most.
        assert!(ledger.relative_imbalance() <= 3000.0 * f64::EPSILON, "{:e}", ledger.relative_imbalance());
        assert!(ledger.work().dissipated_j > 0.01 * ledger.peak_j(), "there was energy to balance");
    }
}

#[test]
fn released_from_two_millimetres_it_swings_at_the_damped_frequency() {
    let mut simulation = simulation(&Setup { start: LOWERED, ..free() });
    let FlotorParameters { mass_kg, drag, .. } = simulation.setup().flotor;
    let half_damping_per_s = 0.5 * drag.translational_ns_per_m / mass_kg;
    let expected_hz =
        (SPRING_1_N_PER_M / mass_kg - half_damping_per_s * half_damping_per_s).sqrt() / std::f64::consts::TAU;
    let mut crossings_s = Vec::new();
    let mut before_m = simulation.state().position_m.z;
    for tick in 1..=1500 {
        let coils = spring(&simulation.state(), SPRING_1_N_PER_M, 0.0);
        simulation.advance(MILLISECOND_NS, coils);
        let now_m = simulation.state().position_m.z;
        if before_m < 0.0 && now_m >= 0.0 {
            crossings_s.push((f64::from(tick) - now_m / (now_m - before_m)) * 1.0e-3);
        }
        before_m = now_m;
    }
    let cycles = crossings_s.len() - 1;
    let measured_hz = cycles as f64 / (crossings_s[cycles] - crossings_s[0]);
    assert!((measured_hz / expected_hz - 1.0).abs() < 0.01, "{measured_hz} Hz, expected {expected_hz} Hz");
}

#[test]
fn the_demo_moves_the_handle_four_millimetres_up_and_down_mostly_below_home() {
    let mut simulation = simulation(&Setup::DEMO);
    let (mut lowest_m, mut highest_m) = (f64::INFINITY, f64::NEG_INFINITY);
    for tick in 0..4000 {
        let coils = spring(&simulation.state(), SPRING_1_N_PER_M, 0.0);
        simulation.advance(MILLISECOND_NS, coils);
        assert_eq!(simulation.sensor_range(), SensorRange::Inside);
        if tick > 2000 {
            lowest_m = lowest_m.min(simulation.state().position_m.z);
            highest_m = highest_m.max(simulation.state().position_m.z);
        }
    }
    let (amplitude_m, middle_m) = (0.5 * (highest_m - lowest_m), 0.5 * (highest_m + lowest_m));
    // What Trajectory::EXPLORE promises, to a twentieth.
    assert!(
        (amplitude_m - 4.0e-3).abs() < 0.2e-3 && (middle_m + 2.5e-3).abs() < 0.2e-3,
        "{amplitude_m} {middle_m}"
    );
}

/// Ends of the pieces of 200 ms, cut irregularly.
fn irregular_cuts() -> Vec<u64> {
    let mut lengths = [137_211, 1, 999_999, 2_718_281, 314_159].iter().cycle();
    let mut cuts = Vec::new();
    let mut time_ns = 0;
    while time_ns < 200 * MILLISECOND_NS {
        time_ns = (time_ns + lengths.next().expect("endless")).min(200 * MILLISECOND_NS);
        cuts.push(time_ns);
    }
    cuts
}

/// Advances under one constant wrench to each of the given times.
fn run_to(setup: &Setup, coils: Wrench, cuts: &[u64]) -> State {
    let mut simulation = simulation(setup);
    for cut_ns in cuts {
        let dt_ns = cut_ns - simulation.time_ns();
        assert!(simulation.advance(dt_ns, coils).is_empty());
    }
    simulation.state()
}

#[test]
fn where_time_is_cut_makes_no_difference() {
    let coils = Wrench { force_n: DVec3::new(0.0, 0.0, 1.5), torque_nm: DVec3::ZERO };
    let turning = Wrench { force_n: DVec3::new(0.8, -0.5, 1.5), torque_nm: DVec3::new(0.02, -0.03, 0.01) };
    let release = Trajectory::Release {
        from: Pose { position_m: LOWERED.position_m, ..Pose::HOME },
        at_ns: 77_777_777,
    };
    let let_go = Setup { hand: Hand { trajectory: release, ..Hand::EXPLORING }, ..Setup::DEMO };
    let millimetre_m = 1.0e-3;
    for (setup, coils, tolerance) in [
        // Translation: rounding of a few hundred steps.
        (Setup::DEMO, coils, 1.0e-13),
        (let_go.clone(), coils, 1.0e-13),
        // Rotation: the Runge-Kutta error of the coarser cuts.
        (Setup { flotor: FlotorParameters::UTAH, ..Setup::DEMO }, turning, 1.0e-8),
        (Setup { flotor: FlotorParameters::UTAH, ..let_go }, turning, 1.0e-8),
        (scripted("tilt"), turning, 1.0e-8),
        (scripted("tap"), coils, 1.0e-8),
    ] {
        let uniform: Vec<u64> = (1..=200).map(|tick| tick * MILLISECOND_NS).collect();
        let in_two = [99 * MILLISECOND_NS, 198 * MILLISECOND_NS, 200 * MILLISECOND_NS];
        let expected = run_to(&setup, coils, &uniform);
        for cuts in [&irregular_cuts()[..], &in_two] {
            let state = run_to(&setup, coils, cuts);
            let error_m = (state.position_m - expected.position_m).length();
            assert!(error_m <= tolerance * millimetre_m, "{error_m:e}");
            let turned = (state.orientation.conjugate() * expected.orientation).xyz().length();
            assert!(turned <= tolerance, "{turned:e}");
        }
    }
}

#[test]
fn a_run_repeats_bit_for_bit_also_after_a_reset() {
    let setup = Setup { flotor: FlotorParameters::UTAH, start: askew(), ..Setup::DEMO };
    let run = |simulation: &mut Simulation| {
        for _ in 0..500 {
            let coils = spring(&simulation.state(), SPRING_1_N_PER_M, 1.0);
            simulation.advance(MILLISECOND_NS, coils);
        }
        (simulation.state(), *simulation.ledger())
    };
    let mut first = simulation(&setup);
    let before = run(&mut first);
    assert_eq!(before, run(&mut simulation(&setup)));
    first.reset();
    assert_eq!((first.time_ns(), before), (0, run(&mut first)));
}

#[test]
fn a_wrench_that_is_not_finite_counts_as_none_and_is_reported() {
    let mut disturbed = simulation(&Setup::DEMO);
    let mut calm = simulation(&Setup::DEMO);
    for poison in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let coils = Wrench { force_n: DVec3::X, torque_nm: DVec3::new(0.0, poison, 0.0) };
        let incidents = disturbed.advance(MILLISECOND_NS, coils);
        assert_eq!(incidents, Incidents { wrench_rejected: true, ..Incidents::default() });
        assert!(calm.advance(MILLISECOND_NS, Wrench::ZERO).is_empty());
    }
    assert_eq!(disturbed.state(), calm.state());
}

#[test]
fn absurd_input_never_leaves_a_number_that_is_not_finite() {
    for flotor in [FlotorParameters::THESIS, FlotorParameters::UTAH] {
        let mut simulation = simulation(&Setup { flotor, ..Setup::DEMO });
        for exponent in 0..=308 {
            let size = 10.0_f64.powi(exponent);
            let coils = Wrench { force_n: DVec3::new(size, -size, size), torque_nm: DVec3::splat(-size) };
            let incidents = simulation.advance(MILLISECOND_NS, coils);
            assert!(incidents.stopped || exponent < 30, "1e{exponent} N is no force a flotor survives");
            assert!(simulation.state().check().is_ok(), "1e{exponent}: {:?}", simulation.state());
            assert!(simulation.ledger().imbalance_j().is_finite());
        }
    }
}

#[test]
fn a_tick_as_long_as_time_itself_is_cut_short() {
    let mut simulation = simulation(&Setup::DEMO);
    let incidents = simulation.advance(u64::MAX, Wrench::ZERO);
    assert_eq!(incidents, Incidents { cut_short: true, ..Incidents::default() });
    assert_eq!(simulation.time_ns(), MAX_ADVANCE_NS);
    assert!(simulation.advance(0, Wrench::ZERO).is_empty());
    assert_eq!(simulation.time_ns(), MAX_ADVANCE_NS);
}

#[test]
fn pushed_out_of_range_the_sensors_say_so() {
    let mut simulation = simulation(&free());
    assert_eq!(simulation.sensor_range(), SensorRange::Inside);
    let coils = Wrench { force_n: DVec3::new(5.0, 0.0, 0.0), torque_nm: DVec3::ZERO };
    for _ in 0..200 {
        simulation.advance(MILLISECOND_NS, coils);
    }
    assert_eq!(simulation.sensor_range(), SensorRange::Outside);
}

#[test]
fn a_new_hand_takes_over_without_a_jump() {
    let mut simulation = simulation(&free());
    for _ in 0..100 {
        simulation.advance(MILLISECOND_NS, Wrench { force_n: DVec3::Z, torque_nm: DVec3::ZERO });
    }
    let before = simulation.state();
    simulation.set_hand(Hand::EXPLORING).expect("a physical hand");
    assert_eq!((simulation.state(), simulation.time_ns()), (before, 100 * MILLISECOND_NS));
    assert!(simulation.aim().is_some());
    let impossible = Impedance { mass_kg: -1.0, ..Impedance::FIRM };
    assert!(simulation.set_hand(Hand { impedance: impossible, ..Hand::EXPLORING }).is_err());
    assert_eq!(simulation.setup().hand, Hand::EXPLORING, "a refused hand changes nothing");
}
