//! One asynchronous instance at the ports of several devices: computed once a period, felt at each port with an age of its own.

use flotor_core::asynchronous::{ContactLimits, FieldTiming};
use flotor_core::mapping::{Blend, Mapping, MappingConfig};
use flotor_core::trace::Events;
use flotor_hal::{
    Contact, ContactSet, DQuat, DVec3, Demand, DeviceState, ForceModel, Input, LoopConfig, Memory, ModelInfo,
    Output, Parameter, Pose, Refusal, SampledLoop, SetParameterError, Settings, Tick, WorldContactsModel,
    Wrench,
};
use flotor_loader::{Plugin, Setting};
use flotor_servo::engine::asynchronous::AsynchronousModel;
use flotor_servo::{Clock, Engine, Forces, Heartbeat, Layer, Port, TimeBudget};
use std::time::{Duration, Instant};

/// A raft: a floor under each hand, which goes down by half of the depth of the deepest other hand, and sinks with each computation.
struct Raft {
    sink_m: f64,
    computed: f64,
    is_hanging: bool,
}

/// Stiffness of the floor, N/m.
const STIFFNESS_N_PER_M: f64 = 1000.0;
/// Parameter that makes the next computation hang.
const HANG: usize = 1;

impl ForceModel for Raft {
    const INFO: ModelInfo =
        ModelInfo::new("raft", "Raft", "A floor between the hands").with_memory(Memory::PathDependent);
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::real("sink_um", "µm", 0.0, 10.0, 0.0, "Depth by which a computation sinks the raft"),
        Parameter::real("hang", "1", 0.0, 1.0, 0.0, "1: the next computation hangs").live(),
    ];

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let sink_m = settings.number_or_default("sink_um") * 1.0e-6;
        Ok(Self { sink_m, computed: 0.0, is_hanging: false })
    }

    fn step(&mut self, _: &Input) -> Output {
        Wrench::ZERO.into()
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        self.is_hanging |= index == HANG && value > 0.5;
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        if index == HANG { f64::from(u8::from(self.is_hanging)) } else { self.sink_m * 1.0e6 }
    }

    fn reset(&mut self) {
        self.computed = 0.0;
    }
}

impl WorldContactsModel for Raft {
    fn contact_sets(&mut self, inputs: &[Input], sets: &mut [ContactSet]) {
        if self.is_hanging {
            // Far longer than the test: its process ends the thread.
            std::thread::sleep(Duration::from_secs(3600));
        }
        self.computed += 1.0;
        for (port, (input, set)) in inputs.iter().zip(sets).enumerate() {
            let others = inputs.iter().enumerate().filter(|(other, _)| *other != port);
            let lowest_m = others.map(|(_, input)| input.pose.position().z).fold(0.0, f64::min);
            let gap_m = input.pose.position().z - 0.5 * lowest_m + self.sink_m * self.computed;
            *set = ContactSet::at(input).with(Contact::of_handle(input, DVec3::Z, gap_m, STIFFNESS_N_PER_M));
        }
    }
}

flotor_hal::export_model!(Raft, world_contacts);

const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 1 };
const SAMPLED: SampledLoop = SampledLoop { period_s: 1.0e-3, latency_s: 0.0 };
/// A computation every 5 ms, with an answer 5 ms later.
const TIMING: FieldTiming =
    FieldTiming { rate_hz: 200.0, latency_s: 0.005, contacts: ContactLimits::UNKNOWN };
/// Ticks in which a contact of this model is valid, and in which its force then fades.
const VALID_TICKS: u64 = 15;
const FADING_TICKS: u64 = 20;

fn raft(clock: Clock, sink_um: f64, mappings: [&MappingConfig; 2], limits: [ContactLimits; 2]) -> Forces {
    let plugin = Plugin::in_process(&FLOTOR_ENTRY).expect("linked in");
    let setting = Setting::number(plugin.parameters(), "sink_um", sink_um).expect("legal");
    let engine = Engine::Here(plugin.create_model(&[setting]).expect("the setting is right"));
    assert!(engine.has_world_contacts() && !engine.has_ports());
    let [first, second] = mappings.map(Mapping::new);
    let ports = [(&first, &limits[0]), (&second, &limits[1])];
    let model =
        AsynchronousModel::start(engine, plugin.parameters().len(), (&TIMING, &ports), &CONFIG, clock);
    let engine = Engine::Asynchronous(Box::new(model.expect("the limits are above 0")));
    let layer =
        Layer::shared((engine, first), vec![second], &Blend::default(), TimeBudget::default(), &SAMPLED);
    Forces::new(2, vec![(vec![0, 1], layer)], Vec::new())
}

fn plain(clock: Clock) -> Forces {
    raft(clock, 0.0, [&MappingConfig::default(); 2], [ContactLimits::UNKNOWN; 2])
}

/// Steps a tick with the handles at these heights, m; returns the forces along z and the events at both ports.
fn step(forces: &mut Forces, index: u64, heights_m: [f64; 2]) -> ([f64; 2], [Events; 2]) {
    let mut ports = heights_m.map(|z_m| {
        let mut port = Port::at_rest(Demand::FORCE);
        port.state = DeviceState { pose: Pose::new(DVec3::Z * z_m, DQuat::IDENTITY), ..DeviceState::HOME };
        port
    });
    let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: if index == 0 { 0 } else { 1_000_000 } };
    forces.step(&tick, &mut ports, Demand::FORCE, &Heartbeat::default());
    (ports.each_ref().map(|port| port.requested.force().z), ports.each_ref().map(|port| port.events))
}

/// Heights of two hands: both begin above the floor; the left one goes 2 mm into it, then the right one 1 mm.
fn hands(index: u64) -> [f64; 2] {
    let ramp =
        |from: f64, to_m: f64| 0.0005 - (0.0005 - to_m) * ((index as f64 - from) / 50.0).clamp(0.0, 1.0);
    [ramp(20.0, -0.002), ramp(150.0, -0.001)]
}

#[test]
fn one_hand_feels_the_other_through_an_asynchronous_object() {
    let (mut forces, mut apart) = (plain(Clock::Virtual), plain(Clock::Virtual));
    let mut largest_n = 0.0_f64;
    for index in 0..400 {
        let heights_m = hands(index);
        let (forces_n, _) = step(&mut forces, index, heights_m);
        let (left_n, _) = step(&mut apart, index, [heights_m[0], 0.0005]);
        largest_n = largest_n.max((forces_n[0] - left_n[0]).abs());
        if index == 140 {
            // The right hand has not touched the floor yet, so the left one feels the floor at rest.
            assert!(
                (forces_n[0] - 2.0).abs() < 1.0e-9 && forces_n[1] == 0.0,
                "{} {}",
                forces_n[0],
                forces_n[1]
            );
        }
    }
    // The right hand pushes the floor 0.5 mm down under the left one.
    let (forces_n, _) = step(&mut forces, 400, hands(400));
    assert!((forces_n[0] - 1.5).abs() < 1.0e-9, "{} N", forces_n[0]);
    assert!((largest_n - 0.5).abs() < 1.0e-9, "{largest_n} N");
    let (health, _) = forces.health().remove(0);
    assert!(health.is_good());
}

#[test]
fn the_instance_is_computed_once_a_period_and_goes_on_without_one_of_its_devices() {
    let mut forces = raft(Clock::Virtual, 1.0, [&MappingConfig::default(); 2], [ContactLimits::UNKNOWN; 2]);
    for index in 0..1000 {
        // A device that has lost its handle keeps its port, and so does one whose handle is far away.
        let right_m = if index < 100 { 0.0005 } else { 5.0 };
        let left_m = 0.0005 - 0.0025 * (index as f64 / 50.0).min(1.0);
        let ([left_n, right_n], events) = step(&mut forces, index, [left_m, right_m]);
        if index >= 60 {
            // The answer of the last period: the raft has sunk by 1 µm for each computation before.
            let computed = (index / 5) as f64;
            let expected_n = STIFFNESS_N_PER_M * (0.002 - 1.0e-6 * computed);
            // Each new surface is reached within half a period.
            let between_n = STIFFNESS_N_PER_M * 1.0e-6;
            assert!(
                left_n >= expected_n - 1.0e-9 && left_n <= expected_n + between_n + 1.0e-9,
                "{index}: {left_n}"
            );
            assert_eq!(right_n, 0.0, "tick {index}");
        }
        assert!(events.iter().all(|events| !events.intersects(Events::MODEL_FAULT)), "tick {index}");
    }
    assert!(forces.health().remove(0).0.is_good());
}

#[test]
fn each_port_has_the_mapping_and_the_limits_of_its_device() {
    let scaled = MappingConfig { motion_scale: 2.0, force_scale: 0.5, ..MappingConfig::default() };
    let weak = ContactLimits { force_n: 0.25, ..ContactLimits::UNKNOWN };
    let limits = [ContactLimits::UNKNOWN, weak];
    let mut forces = raft(Clock::Virtual, 0.0, [&scaled, &MappingConfig::default()], limits);
    let mut last_n = [0.0; 2];
    for index in 0..200 {
        let depth_m = -0.001 * (index as f64 / 50.0).min(1.0);
        last_n = step(&mut forces, index, [depth_m, 0.5 * depth_m]).0;
    }
    // In the model the left hand is 2 mm deep and the right one 0.5 mm: the floors are 0.25 mm and 1 mm deep.
    assert!((last_n[0] - 0.5 * 1.75).abs() < 1.0e-9 && last_n[1] == 0.0, "{} {}", last_n[0], last_n[1]);
    for index in 200..400 {
        last_n = step(&mut forces, index, [0.001, -0.001 * ((index - 200) as f64 / 50.0).min(1.0)]).0;
    }
    assert!(last_n[0] == 0.0 && (last_n[1] - 0.25).abs() < 1.0e-9, "{} {}", last_n[0], last_n[1]);
}

#[test]
fn two_runs_on_the_virtual_clock_have_the_same_bits() {
    let run = || {
        let mut forces = plain(Clock::Virtual);
        (0..500).map(|index| step(&mut forces, index, hands(index)).0.map(f64::to_bits)).collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
}

#[test]
fn the_force_of_both_hands_is_gone_when_the_model_hangs() {
    let mut forces = plain(Clock::Real);
    let deep = [-0.002, -0.0018];
    let begun = Instant::now();
    // The hands go down with the time of the loop, which waits here for the thread.
    let mut index = 0;
    while begun.elapsed() < Duration::from_secs(20) {
        let heights_m = deep.map(|to_m| 0.0005 - (0.0005 - to_m) * (index as f64 / 100.0).min(1.0));
        let (forces_n, _) = step(&mut forces, index, heights_m);
        if index > 150 && forces_n.iter().all(|force_n| *force_n > 0.1) {
            break;
        }
        index += 1;
        std::thread::sleep(Duration::from_millis(1));
    }
    let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 };
    let _ = forces.set_parameter(0, &tick, HANG, 1.0);
    // Time for the computation in progress to end, and for the next one to hang.
    let mut answered = 0;
    for _ in 0..100 {
        index += 1;
        let _ = step(&mut forces, index, deep);
        answered = index;
        std::thread::sleep(Duration::from_millis(1));
    }
    let gone = answered + VALID_TICKS + FADING_TICKS;
    while index <= gone {
        index += 1;
        let _ = step(&mut forces, index, deep);
    }
    let (forces_n, _) = step(&mut forces, index + 1, deep);
    assert_eq!(forces_n, [0.0; 2], "{} ticks after the last answer", index - answered);
    let (health, _) = forces.health().remove(0);
    assert!(health.contacts.aged.ticks > 0);
}
