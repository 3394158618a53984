//! Contacts as a model publishes them: what is refused, what fades, and an author who publishes a wall only while it is touched.

mod common;

use common::{PERIOD_S, at, unlimited};
use flotor_contact::{Coupling, PublishedContacts, Replacement, Shortcoming, Solver, StableStiffness};
use flotor_hal::glam::DVec3;
use flotor_hal::{self as hal, Input};

const STIFFNESS_N_PER_M: f64 = 2000.0;

fn contacts(coupling: Coupling, stable: StableStiffness) -> PublishedContacts {
    let replacement = Replacement::Conserving { surface_power_w: 1.0 };
    let solver = Solver::new(coupling, unlimited(), replacement, PERIOD_S).expect("a period above 0");
    PublishedContacts::new(solver, stable, 0.0155)
}

fn input(z_m: f64, tick: u64) -> Input {
    Input { time_ns: tick * 1_000_000, tick, ..Input::at_rest(at(DVec3::Z * z_m)) }
}

fn wall(input: &Input) -> hal::ContactSet {
    let gap_m = input.pose.position().z;
    hal::ContactSet::at(input).with(hal::Contact::of_handle(input, DVec3::Z, gap_m, STIFFNESS_N_PER_M))
}

#[test]
fn before_the_first_contact_there_is_no_wrench() {
    let mut contacts = contacts(Coupling::RIGID, StableStiffness::UNLIMITED);
    assert!(contacts.touch(&input(-0.001, 0)).is_none());
    contacts.publish(&hal::ContactSet::at(&input(0.001, 1))).expect("an empty set is right");
    assert!(contacts.touch(&input(-0.001, 1)).is_none());
    assert!(contacts.is_idle());
}

#[test]
fn a_set_without_a_validity_of_its_own_fades_after_that_of_the_loop_and_is_forgotten() {
    let mut contacts = contacts(Coupling::RIGID, StableStiffness::UNLIMITED);
    contacts.publish(&wall(&input(1.0e-6, 0))).expect("the wall is right");
    let mut last_n = 0.0;
    for tick in 0..=40 {
        let touch = contacts.touch(&input(if tick == 0 { 1.0e-6 } else { -1.0e-3 }, tick)).expect("a set");
        let force_n = touch.wrench.force().z;
        let shortcoming = (tick > 15).then_some(Shortcoming::Aged);
        assert_eq!((touch.shortcoming, touch.is_valid), (shortcoming, tick <= 15), "tick {tick}");
        match tick {
            0 => {}
            1..=15 => assert!((force_n - 2.0).abs() < 1.0e-12, "{force_n} N in tick {tick}"),
            16..=36 => assert!((0.0..=last_n).contains(&force_n) && last_n - force_n < 0.11, "{force_n} N"),
            _ => assert_eq!(force_n, 0.0, "tick {tick}"),
        }
        last_n = force_n;
    }
    assert!(contacts.is_idle());
}

#[test]
fn a_refused_set_changes_nothing() {
    let mut contacts = contacts(Coupling::RIGID, StableStiffness::UNLIMITED);
    contacts.publish(&wall(&input(1.0e-6, 0))).expect("the wall is right");
    contacts.touch(&input(1.0e-6, 0));
    let with = |spoil: &dyn Fn(&mut hal::ContactSet)| {
        let mut set = wall(&input(-0.001, 1));
        spoil(&mut set);
        set
    };
    for wrong in [
        with(&|set| set.count = 17),
        with(&|set| set.valid_m = 0.0),
        with(&|set| set.valid_s = f64::NAN),
        with(&|set| set.anchor.position_m[1] = f64::NAN),
        with(&|set| set.contacts[0].gap_m = 0.5),
        with(&|set| set.contacts[0].normal = [0.0, 0.0, 2.0]),
        with(&|set| set.contacts[0].stiffness_n_per_m = 0.0),
    ] {
        assert!(contacts.publish(&wrong).is_err(), "{wrong:?}");
    }
    let touch = contacts.touch(&input(-0.001, 2)).expect("the set before");
    assert!((touch.wrench.force().z - 2.0).abs() < 1.0e-12, "{touch:?}");
}

#[test]
fn damping_and_coupling_reduce_a_stiffness_and_the_largest_reduction_is_kept() {
    let soft = Coupling::new(1500.0, f64::INFINITY).expect("above 0");
    let stable = StableStiffness { by_device_n_per_m: 0.0, per_damping_1_per_s: 100.0 };
    let mut contacts = contacts(soft, stable);
    let mut set = wall(&input(1.0e-6, 0));
    contacts.publish(&set).expect("the wall is right");
    contacts.touch(&input(1.0e-6, 0));
    let felt = contacts.felt_stiffness();
    assert_eq!((felt.reduced_n_per_m, felt.undamped_n_per_m), (Some([2000.0, 1500.0]), 2000.0));
    set.contacts[0].damping_ns_per_m = 5.0;
    contacts.publish(&set).expect("the wall is right");
    assert_eq!(contacts.felt_stiffness().reduced_n_per_m, Some([2000.0, 500.0]));
    set.contacts[0].damping_ns_per_m = 30.0;
    contacts.publish(&set).expect("the wall is right");
    assert_eq!(contacts.felt_stiffness().reduced_n_per_m, Some([2000.0, 500.0]));
}

/// A known damping of the device keeps a stiffness stable once in every direction, in whatever number of contacts it comes; a damper of
/// a contact adds its own.
#[test]
fn the_damping_of_the_device_is_used_once_in_every_direction() {
    let stable = StableStiffness { by_device_n_per_m: 600.0, per_damping_1_per_s: 100.0 };
    let felt_n_per_m = |normals: &[DVec3], damping_ns_per_m: f64, way: DVec3| {
        let mut contacts = contacts(Coupling::RIGID, stable);
        let set = normals.iter().fold(hal::ContactSet::at(&input(0.0, 0)), |set, normal| {
            let contact = hal::Contact::of_handle(&input(0.0, 0), *normal, 0.0, STIFFNESS_N_PER_M);
            set.with(contact.with_damping(damping_ns_per_m))
        });
        contacts.publish(&set).expect("the planes are right");
        contacts.touch(&input(0.0, 0));
        assert_eq!(contacts.felt_stiffness().undamped_n_per_m, 0.0);
        let pressed = Input { time_ns: 1_000_000, tick: 1, ..Input::at_rest(at(way * -1.0e-3)) };
        contacts.touch(&pressed).expect("a set").wrench.force().dot(way) / 1.0e-3
    };
    let slope = DVec3::new(0.6, 0.0, 0.8);
    for (normals, damping_ns_per_m, expected_n_per_m) in [
        (&[DVec3::Z][..], 0.0, 600.0),
        (&[DVec3::Z; 4], 0.0, 600.0),
        (&[DVec3::Z, DVec3::X], 0.0, 600.0),
        (&[DVec3::Z], 5.0, 1100.0),
        (&[DVec3::Z; 2], 5.0, 1600.0),
    ] {
        let felt = felt_n_per_m(normals, damping_ns_per_m, DVec3::Z);
        assert!((felt - expected_n_per_m).abs() < 1.0e-9, "{felt} N/m of {normals:?}");
    }
    // In any direction, also between two planes that meet at an angle.
    for part in 0..=16 {
        let way = DVec3::Z.lerp(slope, f64::from(part) / 16.0).normalize();
        let felt = felt_n_per_m(&[DVec3::Z, slope], 0.0, way);
        assert!(felt < 600.0 * (1.0 + 1.0e-12) && felt > 300.0, "{felt} N/m along {way}");
    }
}

/// The wall appears around the tool and vanishes beside it: its depth is withheld and paid for. It never pulls, gives no energy, and
/// changes by no more than the travel and, for a set that appears or vanishes, the depth spread over half a period.
#[test]
fn a_wall_that_is_published_only_while_it_is_touched_neither_pulls_nor_gives_energy() {
    for (ticks, latency) in [(10, 10), (5, 5), (2, 2)] {
        for frequency_hz in [1.0, 3.0, 8.0] {
            let mut contacts = contacts(Coupling::RIGID, StableStiffness::UNLIMITED);
            let z_m =
                |tick: u64| 1.5e-3 * (std::f64::consts::TAU * frequency_hz * tick as f64 * PERIOD_S).cos();
            let mut computed = None;
            let (mut last_n, mut out_j, mut felt_n) = (0.0, 0.0, 0.0_f64);
            for tick in 0..4000_u64 {
                let input = input(z_m(tick), tick);
                if let Some((ready, set)) = computed.take() {
                    if tick == ready {
                        contacts.publish(&set).expect("the wall is right");
                    } else {
                        computed = Some((ready, set));
                    }
                }
                if tick % ticks == 0 {
                    let set = if z_m(tick) < 0.0 { wall(&input) } else { hal::ContactSet::at(&input) };
                    computed = Some((tick + latency, set));
                }
                let touch = contacts.touch(&input);
                let force_n = touch.map_or(0.0, |touch| touch.wrench.force().z);
                let travel_m =
                    (z_m(tick + 1) - z_m(tick)).abs().max((z_m(tick) - z_m(tick.saturating_sub(1))).abs());
                let spread_m = 1.5e-3 / (0.5 * ticks as f64);
                assert!(force_n >= 0.0, "{force_n} N in tick {tick}");
                assert!(
                    (force_n - last_n).abs() <= 1.5 * STIFFNESS_N_PER_M * (travel_m + spread_m),
                    "tick {tick}"
                );
                out_j += force_n * (z_m(tick + 1) - z_m(tick));
                (last_n, felt_n) = (force_n, felt_n.max(force_n));
            }
            println!("{ticks} ticks, {frequency_hz} Hz: {felt_n:.3} N, {:.4} mJ out", 1.0e3 * out_j);
            let speed = std::f64::consts::TAU * frequency_hz * 1.5e-3;
            // A sampled wall gives K T / 2 times the integral of the squared speed: 4 s, half of them inside.
            let sampled_j = 0.5 * STIFFNESS_N_PER_M * PERIOD_S * 0.5 * speed * speed * 2.0;
            assert!(out_j <= 1.15 * sampled_j + 1.0e-5, "{out_j} J, sampled {sampled_j} J");
        }
    }
}
