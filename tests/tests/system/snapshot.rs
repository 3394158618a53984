//! Outputs after a restore equal those after the save to the bit, in the same instance and in another one, for every shipped model and
//! for the simulated device; bytes that are no state are refused.

use flotor_hal::abi::{CallStatus, Entry};
use flotor_hal::{
    Cycle, DVec3, Demand, DeviceState, Input, LoopConfig, Output, Pose, Tick, Twist, Wrench,
    orientation_from_rotation_vector,
};
use flotor_loader::{ActiveDevice, Model, Plugin, Setting};
use flotor_tests::TestSize;
use flotor_tests::random::Random;

const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 3 };
/// Returns the number of random ticks at which a state is saved.
fn saves() -> usize {
    match TestSize::of_this_run() {
        TestSize::Quick => 100,
        TestSize::Daily | TestSize::Full => 1000,
    }
}

/// Longest run between two of them, ticks.
const BETWEEN: usize = 20;
/// Ticks after a restore: longer than any cached matrix of the rod lives.
const AFTER: u64 = 40;

pub(super) type Settings = &'static [(&'static str, &'static str)];

/// Every shipped model, in the variants whose states differ.
pub(super) const MODELS: &[(&Entry, Settings)] = &[
    (&flotor_spring::FLOTOR_ENTRY, &[]),
    (&flotor_spring::FLOTOR_ENTRY, &[("variant", "thesis")]),
    (&flotor_spring::FLOTOR_ENTRY, &[("variant", "closed-form")]),
    (&flotor_spring::FLOTOR_ENTRY, &[("preset", "slender"), ("variant", "rod")]),
    (&flotor_spring::FLOTOR_ENTRY, &[("preset", "slender"), ("hand_over", "on")]),
    (&flotor_spring::FLOTOR_ENTRY, &[("seat", "free"), ("seat_friction", "0.2")]),
    (&flotor_spring::FLOTOR_ENTRY, &[("seat", "free"), ("coil_contact", "on"), ("wire", "on")]),
    (&flotor_wall::FLOTOR_ENTRY, &[("friction", "0.5")]),
    (&flotor_wall::FLOTOR_ENTRY, &[("friction", "0.5"), ("shape", "sphere"), ("damping_ns_per_m", "3")]),
    (&flotor_wall::FLOTOR_ENTRY, &[("friction", "0.5"), ("shape", "box"), ("size_mm", "4")]),
    (&flotor_load::FLOTOR_ENTRY, &[("kind", "exerted")]),
    (&flotor_measured::FLOTOR_ENTRY, &[]),
    (&flotor_membrane::FLOTOR_ENTRY, &[]),
    (&flotor_solid::FLOTOR_ENTRY, &[("friction", "0.4"), ("body", "half-space")]),
    (&flotor_solid::FLOTOR_ENTRY, &[("friction", "0.4"), ("body", "half-space"), ("tool_count", "3")]),
    (&flotor_surface::FLOTOR_ENTRY, &[("static_friction", "0.5"), ("kinetic_friction", "0.4")]),
    (&flotor_surface::FLOTOR_ENTRY, &[("tool_radius_mm", "0")]),
];

fn plugin(entry: &'static Entry) -> Plugin {
    Plugin::in_process(entry).expect("a shipped plugin loads")
}

fn settings(plugin: &Plugin, settings: Settings) -> Vec<Setting> {
    let parse = |(key, value): &(&str, &str)| Setting::parse(plugin.parameters(), key, value).expect("legal");
    settings.iter().map(parse).collect()
}

fn model(plugin: &Plugin, set: Settings) -> Model {
    let mut model = plugin.create_model(&settings(plugin, set)).expect("legal settings");
    model.prepare(&CONFIG).expect("it runs at 1 kHz");
    model
}

/// A handle that presses, slides, tilts and lifts off, past buckling, with frequencies without a common divisor.
fn input(tick: u64) -> Input {
    let t = tick as f64 * 1.0e-3;
    let wave = |rad_per_s: f64| (rad_per_s * t).sin();
    let slope = |rad_per_s: f64| rad_per_s * (rad_per_s * t).cos();
    let position_m = DVec3::new(2.0e-3 * wave(7.0), 1.5e-3 * wave(11.3), -2.0e-3 + 5.0e-3 * wave(5.1));
    let velocity = DVec3::new(2.0e-3 * slope(7.0), 1.5e-3 * slope(11.3), 5.0e-3 * slope(5.1));
    let turn_rad = DVec3::new(0.1 * wave(3.0), 0.08 * wave(4.7), 0.2 * wave(2.3));
    Input {
        pose: Pose::new(position_m, orientation_from_rotation_vector(turn_rad)),
        twist: Twist::new(velocity, DVec3::ZERO),
        time_ns: tick * CONFIG.period_ns,
        dt_ns: CONFIG.period_ns,
        tick,
        demand: Demand::ALL,
        ..Input::at_rest(Pose::HOME)
    }
}

fn bits(wrench: &Wrench) -> [u64; 6] {
    let ([fx, fy, fz], [tx, ty, tz]) = (wrench.force_n, wrench.torque_nm);
    [fx, fy, fz, tx, ty, tz].map(f64::to_bits)
}

/// Wrench, energy and status of each tick, as bits.
fn run(model: &mut Model, ticks: std::ops::Range<u64>) -> Vec<([u64; 6], u64, u32)> {
    let answer = |tick| {
        let mut output = Output::default();
        assert_eq!(model.step(&input(tick), &mut output), CallStatus::Ok, "{}", model.last_message());
        let status = output.status().expect("a status of the contract");
        (bits(&output.wrench), output.energy_j.to_bits(), status as u32)
    };
    ticks.map(answer).collect()
}

fn saved(model: &mut Model) -> Vec<u8> {
    let mut state = model.state().expect("every shipped model has a state that can be saved");
    let mut bytes = vec![0; usize::try_from(state.count().expect("a number of bytes")).expect("it fits")];
    assert_eq!(state.save(&mut bytes), CallStatus::Ok);
    bytes
}

fn restore(model: &mut Model, bytes: &[u8]) {
    assert_eq!(model.state().expect("as above").restore(bytes), CallStatus::Ok);
}

#[test]
fn what_follows_a_restore_is_equal_to_the_bit() {
    for (entry, set) in MODELS {
        let plugin = plugin(entry);
        let (mut main, mut other) = (model(&plugin, set), model(&plugin, set));
        let name = format!("{} {set:?}", plugin.metadata().id);
        let mut random = Random(11);
        let (mut tick, mut felt) = (0, 0);
        for _ in 0..saves() {
            let next = tick + 1 + random.below(BETWEEN) as u64;
            run(&mut main, tick..next);
            tick = next;
            let bytes = saved(&mut main);
            let after = run(&mut main, tick..tick + AFTER);
            restore(&mut main, &bytes);
            assert_eq!(run(&mut main, tick..tick + AFTER), after, "{name}: the same instance, tick {tick}");
            restore(&mut other, &bytes);
            assert_eq!(saved(&mut other), bytes, "{name}: what was restored, tick {tick}");
            assert_eq!(run(&mut other, tick..tick + AFTER), after, "{name}: another instance, tick {tick}");
            felt += usize::from(after.iter().any(|(wrench, ..)| *wrench != [0; 6]));
            restore(&mut main, &bytes);
        }
        assert!(felt > saves() / 10, "{name} was hardly touched: {felt}");
    }
}

#[test]
fn bytes_of_another_length_and_impossible_bytes_are_refused() {
    let plugin = plugin(&flotor_wall::FLOTOR_ENTRY);
    let mut wall = model(&plugin, &[]);
    run(&mut wall, 0..1000);
    let bytes = saved(&mut wall);
    let before = run(&mut wall, 1000..1010);
    restore(&mut wall, &bytes);
    let longer = [&bytes[..], &[0]].concat();
    for wrong in [&bytes[1..], &longer, &[]] {
        assert_eq!(wall.state().expect("a state").restore(wrong), CallStatus::OutOfRange);
    }
    assert_eq!(run(&mut wall, 1000..1010), before, "a refused length changes nothing");
    // The first byte says whether there is a contact.
    let impossible = [&[2], &bytes[1..]].concat();
    assert_eq!(wall.state().expect("a state").restore(&impossible), CallStatus::OutOfRange);
}

#[test]
fn a_model_without_a_history_has_an_empty_state() {
    let mut model = model(&plugin(&flotor_measured::FLOTOR_ENTRY), &[]);
    assert_eq!(saved(&mut model), Vec::<u8>::new());
    assert_eq!(model.state().expect("an empty one").restore(&[0]), CallStatus::OutOfRange);
}

/// Simulated devices: a rigid body; sensors, coils and random faults with a hand that trembles; a hand that is guided.
const DEVICES: &[Settings] = &[
    &[],
    &[("hand_script", "shear"), ("hand_tremor_um", "50")],
    &[
        ("preset", "full"),
        ("hand", "oscillate"),
        ("hand_tremor_um", "50"),
        ("fault", "dropped-sample"),
        ("fault_rate_per_s", "20"),
    ],
    &[
        ("preset", "full"),
        ("velocity", "kalman"),
        ("sensor_bandwidth_hz", "300"),
        ("hand_force_noise_percent", "4"),
    ],
    &[("hand_guide", "7"), ("hand_target_z_mm", "-3")],
];

/// Samples of a device under a spring and a damper, as bits.
fn turns(device: &mut ActiveDevice, ticks: std::ops::Range<u64>, last: &mut DeviceState) -> Vec<[u64; 15]> {
    let turn = |index: u64| {
        let dt_ns = if index == 0 { 0 } else { CONFIG.period_ns };
        let tick = Tick { index, time_ns: index * CONFIG.period_ns, dt_ns };
        let cycle = device.read(&tick, last);
        assert!(!matches!(cycle, Cycle::Fault(_)), "tick {index}: {cycle:?}");
        let (position_m, velocity) = (last.pose.position(), last.twist.linear());
        let wrench = Wrench::from_force(position_m * -300.0 - velocity * 2.0);
        assert_eq!(device.write(&tick, &wrench), Cycle::Fresh);
        let DeviceState { pose, twist, sampled_ns, .. } = *last;
        let mut bits = [0; 15];
        let numbers = pose.position_m.into_iter().chain(pose.orientation_xyzw);
        let numbers = numbers.chain(twist.linear().to_array()).chain(twist.angular().to_array());
        bits.iter_mut().zip(numbers.map(f64::to_bits)).for_each(|(bit, number)| *bit = number);
        (bits[13], bits[14]) = (sampled_ns, u64::from(cycle == Cycle::Fresh));
        bits
    };
    ticks.map(turn).collect()
}

#[test]
fn what_follows_a_restore_of_the_simulated_device_is_equal_to_the_bit() {
    let plugin = plugin(&flotor_simulated::FLOTOR_ENTRY);
    for set in DEVICES {
        let open = || {
            let opened = plugin.open_device(&settings(&plugin, set)).expect("legal settings");
            opened.activate(&CONFIG).map_err(|(_, refusal)| refusal).expect("it runs at 1 kHz")
        };
        let (mut main, mut other) = (open(), open());
        let mut random = Random(12);
        let (mut tick, mut at) = (0, DeviceState::HOME);
        for _ in 0..saves() {
            let next = tick + 1 + random.below(BETWEEN) as u64;
            turns(&mut main, tick..next, &mut at);
            tick = next;
            let mut state = main.state().expect("the simulation has a state");
            let mut bytes = vec![0; usize::try_from(state.count().expect("a number")).expect("it fits")];
            assert_eq!(state.save(&mut bytes), CallStatus::Ok);
            let (mut here, mut there) = (at, at);
            let after = turns(&mut main, tick..tick + AFTER, &mut here);
            let ledger = main.energy_ledger();
            assert_eq!(other.state().expect("as above").restore(&bytes), CallStatus::Ok);
            assert_eq!(turns(&mut other, tick..tick + AFTER, &mut there), after, "{set:?}: tick {tick}");
            assert_eq!(other.energy_ledger(), ledger, "{set:?}: tick {tick}");
            assert_eq!(main.state().expect("as above").restore(&bytes), CallStatus::Ok);
        }
    }
}
