//! Stability of a wall at 200 Hz beside a loop at 1 kHz: as contacts, and as plain force one period late.

use flotor_contact::NewestAnswer;
use flotor_core::asynchronous::ContactLimits;
use flotor_core::mapping::{Mapping, MappingConfig};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{Contact, ContactSet, Input, Pose, Twist};

const TICK_NS: u64 = 1_000_000;
/// Ticks between two answers of the wall; the latency is as long.
const EVERY: u64 = 5;
/// Steps of the plant in a tick.
const SUBSTEPS: u32 = 20;

/// Handle and hand: mass, viscous damping, and a force that presses into the wall, N.
#[derive(Clone, Copy, Debug)]
struct Plant {
    mass_kg: f64,
    damping_ns_per_m: f64,
    hand_n_per_m: f64,
    press_n: f64,
}

/// The flotor, pressed by a constant force: nothing but its own damping.
const OPEN: Plant = Plant { mass_kg: 0.58, damping_ns_per_m: 2.0, hand_n_per_m: 0.0, press_n: 1.0 };
/// The same in a relaxed hand.
const RELAXED: Plant = Plant { mass_kg: 0.58, damping_ns_per_m: 7.0, hand_n_per_m: 50.0, press_n: 1.0 };

/// Way from the wall to the hand.
#[derive(Clone, Copy, Debug)]
enum Way {
    InLoop,
    PlainForce,
    Contacts,
}

/// Returns whether the amplitude of a handle that hits a wall of this stiffness does not grow over 10 s.
fn is_stable(plant: Plant, way: Way, stiffness_n_per_m: f64) -> bool {
    let limits = ContactLimits { cap: None, ..ContactLimits::UNKNOWN };
    let mapping = Mapping::new(&MappingConfig::default());
    let mut answer = NewestAnswer::new(&mapping, &limits, [TICK_NS, EVERY * TICK_NS]).expect("above 0");
    let (mut z_m, mut v_m_per_s) = (0.001, -0.01);
    let (mut computed, mut computed_n, mut held_n) = (None::<ContactSet>, 0.0, 0.0);
    let (mut early_m, mut late_m) = ([f64::MAX, f64::MIN], [f64::MAX, f64::MIN]);
    for tick in 0..10_000_u64 {
        let pose = Pose::new(DVec3::Z * z_m, DQuat::IDENTITY);
        let twist = Twist::new(DVec3::Z * v_m_per_s, DVec3::ZERO);
        let input = Input { tick, time_ns: tick * TICK_NS, twist, ..Input::at_rest(pose) };
        let wall_n = stiffness_n_per_m * (-z_m).max(0.0);
        if tick % EVERY == 0 {
            if let Some(set) = &computed {
                answer.take(set, &input).expect("the set is consistent");
            }
            held_n = computed_n;
            computed = Some(ContactSet::at(&input).with(Contact::of_handle(
                &input,
                DVec3::Z,
                z_m,
                stiffness_n_per_m,
            )));
            computed_n = wall_n;
        }
        let force_n = match way {
            Way::InLoop => wall_n,
            Way::PlainForce => held_n,
            Way::Contacts => answer.touch(&input).map_or(0.0, |touch| touch.wrench.force().z),
        };
        let step_s = 1.0e-3 / f64::from(SUBSTEPS);
        for _ in 0..SUBSTEPS {
            let Plant { mass_kg, damping_ns_per_m, hand_n_per_m, press_n } = plant;
            let sum_n = force_n - press_n - hand_n_per_m * z_m;
            v_m_per_s = (v_m_per_s + sum_n / mass_kg * step_s) / (1.0 + damping_ns_per_m / mass_kg * step_s);
            z_m += v_m_per_s * step_s;
        }
        let range = match tick {
            1000..2000 => &mut early_m,
            9000.. => &mut late_m,
            _ => continue,
        };
        *range = [range[0].min(z_m), range[1].max(z_m)];
    }
    // Below a nanometre the amplitude is that of rounding.
    late_m[1] - late_m[0] <= (early_m[1] - early_m[0]).max(1.0e-9)
}

/// Returns the largest stiffness up to which every tried wall is stable, N/m, to 2 %.
fn limit_n_per_m(plant: Plant, way: Way) -> f64 {
    let mut stiffness_n_per_m = 20.0;
    // In small steps, because a stiffer wall may be stable again beyond one that is not.
    while stiffness_n_per_m < 1.0e5 && is_stable(plant, way, 1.02 * stiffness_n_per_m) {
        stiffness_n_per_m *= 1.02;
    }
    stiffness_n_per_m
}

#[test]
fn a_slow_wall_as_contacts_is_stable_nearly_as_far_as_in_the_loop_and_five_times_as_far_as_plain_force() {
    for (hand, plant) in [("open", OPEN), ("relaxed", RELAXED)] {
        let [in_loop, plain, contacts] =
            [Way::InLoop, Way::PlainForce, Way::Contacts].map(|way| limit_n_per_m(plant, way));
        println!(
            "{hand} hand: in the loop {in_loop:.0} N/m, as plain force {plain:.0} N/m, as contacts {contacts:.0} N/m"
        );
        assert!(contacts >= 5.0 * plain, "{hand} hand: {contacts} and {plain} N/m");
        assert!(contacts >= 0.9 * in_loop, "{hand} hand: {contacts} and {in_loop} N/m");
    }
}
