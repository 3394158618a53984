//! One instance at the ports of several devices: stepped once a tick, mapped and weighed at each port, swapped at all of them at once.

use flotor_core::mapping::{Blend, Mapping, MappingConfig};
use flotor_core::trace::Events;
use flotor_hal::abi::{Entry, model_entry};
use flotor_hal::{
    DQuat, DVec3, Demand, DeviceState, ForceModel, Input, Memory, ModelInfo, Output, Parameter, Pose,
    Refusal, SampledLoop, SetParameterError, Settings, StepStatus, Tick, WorldModel, Wrench,
};
use flotor_loader::{Plugin, Setting};
use flotor_servo::{Engine, Forces, Heartbeat, Layer, Port, Replacement, TimeBudget};

/// Springs between all handles and their middle. A path-dependent model: its energy is the number of its steps so far, an equal part
/// at each port; an instance that is stepped once for each port, or is not stepped in a tick, shows in it.
struct Bar {
    stiffness_n_per_m: f64,
    steps: f64,
}

impl ForceModel for Bar {
    const INFO: ModelInfo = ModelInfo::new("bar", "Bar", "A spring between the hands")
        .serving(Demand::ALL)
        .with_memory(Memory::PathDependent);
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::real("stiffness_n_per_m", "N/m", 0.0, 1.0e4, 500.0, "Stiffness to the middle").live()];

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self { stiffness_n_per_m: settings.number_or_default("stiffness_n_per_m"), steps: 0.0 })
    }

    fn step(&mut self, _: &Input) -> Output {
        Wrench::ZERO.into()
    }

    fn set_parameter(&mut self, _: usize, value: f64) -> Result<(), SetParameterError> {
        self.stiffness_n_per_m = value;
        Ok(())
    }

    fn parameter(&self, _: usize) -> f64 {
        self.stiffness_n_per_m
    }

    fn reset(&mut self) {
        self.steps = 0.0;
    }
}

impl WorldModel for Bar {
    fn step_ports(&mut self, inputs: &[Input], outputs: &mut [Output]) {
        self.steps += 1.0;
        let ports = inputs.len() as f64;
        let middle_m = inputs.iter().map(|input| input.pose.position()).sum::<DVec3>() / ports;
        for (input, output) in inputs.iter().zip(outputs) {
            let force_n = (middle_m - input.pose.position()) * self.stiffness_n_per_m;
            *output = Output::new(Wrench::from_force(force_n), self.steps / ports, StepStatus::Ok);
        }
    }
}

/// A constant force of one newton upwards.
struct Weight;

impl ForceModel for Weight {
    const INFO: ModelInfo = ModelInfo::new("weight", "Weight", "A constant force").serving(Demand::ALL);

    fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self)
    }

    fn step(&mut self, _: &Input) -> Output {
        Output::new(Wrench::from_force(DVec3::Z), 0.0, StepStatus::Ok)
    }

    fn reset(&mut self) {}
}

flotor_hal::export_model!(Bar, world);
static WEIGHT: Entry = model_entry::<Weight>();

const SAMPLED: SampledLoop = SampledLoop { period_s: 1.0e-3, latency_s: 0.0 };

fn plain() -> Mapping {
    Mapping::new(&MappingConfig::default())
}

fn bar(stiffness_n_per_m: f64, ports: [Mapping; 2], blend: &Blend) -> Layer {
    let plugin = Plugin::in_process(&FLOTOR_ENTRY).expect("linked in");
    let setting =
        Setting::number(plugin.parameters(), "stiffness_n_per_m", stiffness_n_per_m).expect("legal");
    let model = Engine::Here(plugin.create_model(&[setting]).expect("the setting is right"));
    let [first, second] = ports;
    Layer::shared((model, first), vec![second], blend, TimeBudget::default(), &SAMPLED)
}

fn weight(blend: &Blend) -> Layer {
    let model = Plugin::in_process(&WEIGHT).expect("linked in").create_model(&[]).expect("no settings");
    Layer::new(vec![(Engine::Here(model), plain())], blend, TimeBudget::default(), &SAMPLED)
}

fn tick(index: u64) -> Tick {
    Tick { index, time_ns: index * 1_000_000, dt_ns: if index == 0 { 0 } else { 1_000_000 } }
}

/// Two devices, with their handles at these positions.
fn ports(positions_m: [DVec3; 2]) -> [Port; 2] {
    positions_m.map(|position_m| {
        let mut port = Port::at_rest(Demand::WRENCH);
        port.state = DeviceState { pose: Pose::new(position_m, DQuat::IDENTITY), ..DeviceState::HOME };
        port
    })
}

/// Steps a tick; returns the forces at both ports, and the sum of the energies.
fn step(forces: &mut Forces, index: u64, ports: &mut [Port; 2]) -> ([DVec3; 2], f64) {
    ports.iter_mut().for_each(|port| port.events = Events::NONE);
    forces.step(&tick(index), ports, Demand::ALL, &Heartbeat::default());
    let outputs = ports.each_ref().map(Port::outputs);
    let energies_j = outputs.each_ref().map(|output| output.energy_j().expect("it is computed"));
    (outputs.map(|output| output.force()), energies_j.iter().sum())
}

const APART: [DVec3; 2] = [DVec3::new(-0.002, 0.0, 0.0), DVec3::new(0.004, 0.0, 0.0)];

#[test]
fn one_instance_is_stepped_once_a_tick_with_the_mapping_of_each_port() {
    let turned = MappingConfig {
        rotation_xyzw: DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2).to_array(),
        motion_scale: 2.0,
        force_scale: 0.5,
        torque_scale: None,
    };
    let there = Mapping::new(&turned).at([0.001, 0.0, 0.0]);
    let layer = bar(500.0, [plain(), there], &Blend::default());
    let mut forces = Forces::new(2, vec![(vec![0, 1], layer)], Vec::new());
    let mut ports = ports(APART);
    for index in 0..10 {
        let (forces_n, steps) = step(&mut forces, index, &mut ports);
        // The second handle is 3 mm from its home: 6 mm along y in the model.
        let (first_m, second_m) = (APART[0], DVec3::Y * 0.006);
        let middle_m = 0.5 * (first_m + second_m);
        let (first_n, second_n) = ((middle_m - first_m) * 500.0, (middle_m - second_m) * 500.0);
        let back_n = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2).conjugate() * second_n * 0.5;
        // A few roundings of a newton.
        assert!((forces_n[0] - first_n).length() < 1.0e-15, "{} {first_n}", forces_n[0]);
        assert!((forces_n[1] - back_n).length() < 1.0e-15, "{} {back_n}", forces_n[1]);
        // The energy of the second port is scaled by 0.5 / 2.
        let expected = (index as f64 + 1.0) * 0.5 * (1.0 + 0.25);
        assert!((steps - expected).abs() < 1.0e-12, "tick {index}: {steps} {expected}");
    }
}

#[test]
fn a_parameter_and_a_weight_hold_at_all_ports() {
    let blend = Blend { fade_s: 0.01, ..Blend::default() };
    let mut forces = Forces::new(2, vec![(vec![0, 1], bar(500.0, [plain(); 2], &blend))], Vec::new());
    let mut ports = ports(APART);
    let _ = step(&mut forces, 0, &mut ports);
    let _ = forces.set_parameter(0, &tick(1), 0, 1000.0);
    let (forces_n, _) = step(&mut forces, 1, &mut ports);
    assert_eq!(forces_n.map(|force| force.x), [3.0, -3.0]);
    let _ = forces.set_weight(0, &tick(2), 0.0);
    for index in 2..20 {
        let ([left, right], _) = step(&mut forces, index, &mut ports);
        let weight = (1.0 - (index - 2) as f64 * 0.1).max(0.0);
        assert!((left.x - 3.0 * weight).abs() < 1.0e-12 && left == -right, "tick {index}: {left} {right}");
    }
    assert_eq!(forces.health().len(), 1);
}

#[test]
fn a_swap_replaces_the_instance_at_all_ports_in_one_tick_and_fades_there_as_at_one_device() {
    let blend = Blend { fade_s: 0.01, ..Blend::default() };
    let mut forces = Forces::new(2, vec![(vec![0, 1], bar(500.0, [plain(); 2], &blend))], Vec::new());
    let mut ports = ports(APART);
    for index in 0..5 {
        assert_eq!(step(&mut forces, index, &mut ports).0[0].x, 1.5);
    }
    let layer = bar(1500.0, [plain(); 2], &blend);
    assert!(forces.replace(Replacement { model: 0, generation: 1, layer }, &tick(5)).is_none());
    for index in 5..30 {
        let ([left, right], _) = step(&mut forces, index, &mut ports);
        let presence = ((index - 5) as f64 * 0.1).min(1.0);
        assert!((left.x - (1.5 + 3.0 * presence)).abs() < 1.0e-12, "tick {index}: {left}");
        assert_eq!(left, -right, "both ports blend the same two instances");
        let faded = forces.take_faded(&tick(index));
        assert_eq!(faded.is_some(), index == 15, "tick {index}");
    }
    assert_eq!(forces.generation(0), Some(1));
    // A layer on one device cannot take the place of a shared one: it comes back, and nothing changes.
    let refused = forces.replace(Replacement { model: 0, generation: 2, layer: weight(&blend) }, &tick(30));
    assert!(refused.is_some() && forces.generation(0) == Some(1) && !forces.is_fading());
    assert_eq!(forces.into_layers().count(), 1);
}

#[test]
fn a_replacement_before_the_last_has_faded_lets_no_port_jump() {
    let blend = Blend { fade_s: 0.01, ..Blend::default() };
    let mut forces = Forces::new(2, vec![(vec![0, 1], bar(500.0, [plain(); 2], &blend))], Vec::new());
    let mut ports = ports(APART);
    let mut before_n = step(&mut forces, 0, &mut ports).0;
    let mut returned = 0;
    for index in 1..60 {
        if index % 3 == 0 && index < 30 {
            let stiffness_n_per_m = if index % 2 == 0 { 500.0 } else { 1500.0 };
            let layer = bar(stiffness_n_per_m, [plain(); 2], &blend);
            let replacement = Replacement { model: 0, generation: 1, layer };
            returned += usize::from(forces.replace(replacement, &tick(index)).is_some());
        }
        let (forces_n, _) = step(&mut forces, index, &mut ports);
        for (now_n, before_n) in forces_n.iter().zip(before_n) {
            // A blend moves by a tenth of the largest difference in a tick, and a rest that fades beside it by as much.
            assert!((*now_n - before_n).length() <= 0.6 + 1.0e-9, "tick {index}: {now_n} {before_n}");
        }
        assert_eq!(forces_n[0], -forces_n[1]);
        before_n = forces_n;
        returned += usize::from(forces.take_faded(&tick(index)).is_some());
    }
    assert_eq!(returned, 9, "every layer but the last comes back once");
}

#[test]
fn a_device_that_is_silenced_or_far_away_does_not_stop_the_object() {
    let high = Blend { priority: 1, ..Blend::default() };
    let layers = vec![(vec![0, 1], bar(500.0, [plain(); 2], &Blend::default())), (vec![1], weight(&high))];
    let mut forces = Forces::new(2, layers, Vec::new());
    let mut ports = ports([DVec3::X * 5.0, DVec3::new(0.004, 0.0, 0.0)]);
    for index in 0..100 {
        let ([first, second], _) = step(&mut forces, index, &mut ports);
        assert!(first.x < -1000.0, "the first hand is not silenced: {first}");
        if index > 21 {
            assert_eq!(second, DVec3::Z, "tick {index}: the weight has priority at the second device alone");
        }
    }
    // Both handles move again: the instance has been stepped in every tick.
    let mut ports = self::ports(APART);
    let _ = forces.set_weight(1, &tick(100), 0.0);
    for index in 100..400 {
        let _ = step(&mut forces, index, &mut ports);
    }
    let (forces_n, steps) = step(&mut forces, 400, &mut ports);
    assert_eq!((forces_n.map(|force| force.x), steps), ([1.5, -1.5], 401.0));
}

#[test]
fn an_unusable_output_removes_the_force_at_its_port_only() {
    let mut forces =
        Forces::new(2, vec![(vec![0, 1], bar(500.0, [plain(); 2], &Blend::default()))], Vec::new());
    let mut ports = ports(APART);
    // The middle of a handle at infinity is infinite for both: the whole object fails in this tick, and is back in the next.
    ports[1].state.pose = Pose::new(DVec3::X * f64::MAX, DQuat::IDENTITY);
    ports[0].state.pose = Pose::new(DVec3::X * f64::MAX, DQuat::IDENTITY);
    ports.iter_mut().for_each(|port| port.events = Events::NONE);
    forces.step(&tick(0), &mut ports, Demand::FORCE, &Heartbeat::default());
    assert!(ports.iter().all(|port| port.events.intersects(Events::MODEL_FAULT)));
    assert_eq!(ports.each_ref().map(|port| port.requested.force()), [DVec3::ZERO; 2]);
    let mut ports = self::ports(APART);
    let (forces_n, _) = step(&mut forces, 1, &mut ports);
    assert_eq!(forces_n.map(|force| force.x), [1.5, -1.5]);
    let (health, _) = forces.health().remove(0);
    assert_eq!((health.rejected.ticks, health.rejected.first), (1, Some(0)));
}
