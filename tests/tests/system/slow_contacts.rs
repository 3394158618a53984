//! A wall computed asynchronously, in the whole loop with a simulated hand: it only pushes, and feels like the same wall in the loop.

use flotor_core::asynchronous::{ContactLimits, FieldTiming, StiffnessCap};
use flotor_core::health::ModelHealth;
use flotor_core::limits::{Boundary, Limits};
use flotor_core::mapping::{Blend, Mapping, MappingConfig};
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{Capabilities, LoopConfig, SampledLoop};
use flotor_loader::{Plugin, Setting};
use flotor_servo::engine::asynchronous::AsynchronousModel;
use flotor_servo::{
    Clock, Engine, Envelope, Forces, Guarded, Layer, Loop, ParameterQueue, RunConfig, Schedule, Standby,
    StopSwitch, TimeBudget, swap_queues,
};

const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 1 };
const PERIOD_S: f64 = 1.0e-3;

type Pairs<'a> = &'a [(&'a str, &'a str)];

fn settings(plugin: &Plugin, pairs: Pairs<'_>) -> Vec<Setting> {
    let setting = |(key, value): &(&str, &str)| Setting::parse(plugin.parameters(), key, value);
    pairs.iter().map(|pair| setting(pair).expect("the plugin has this parameter")).collect()
}

/// Hand that oscillates by 1.5 mm about the surface of a wall.
#[derive(Clone, Copy, Debug)]
struct Scene<'a> {
    grip: &'a str,
    frequency_hz: &'a str,
    wall: Pairs<'a>,
    /// Rate of the wall, Hz; `None`: in the loop.
    rate_hz: Option<f64>,
    contacts: ContactLimits,
    mapping: MappingConfig,
    seconds: u64,
}

impl Default for Scene<'_> {
    fn default() -> Self {
        Self {
            grip: "firm",
            frequency_hz: "3",
            wall: &[],
            rate_hz: Some(200.0),
            contacts: ContactLimits::UNKNOWN,
            mapping: MappingConfig::default(),
            seconds: 2,
        }
    }
}

/// Ticks and health of a run.
struct Run {
    records: Vec<TickRecord>,
    health: ModelHealth,
}

impl Scene<'_> {
    fn run(&self) -> Run {
        let hand = [
            ("hand", "oscillate"),
            ("hand_grip", self.grip),
            ("hand_centre_mm", "0"),
            ("hand_amplitude_mm", "1.5"),
            ("hand_frequency_hz", self.frequency_hz),
            // Above the wall, until its first answer has come.
            ("start_z_mm", "1.5"),
        ];
        let plugin = Plugin::in_process(&flotor_simulated::FLOTOR_ENTRY).expect("linked in");
        let mut device = plugin.open_device(&settings(&plugin, &hand)).expect("the settings are right");
        let capabilities = device.capabilities().expect("a simulated device has them");
        let envelope =
            Envelope::new(&Limits::default(), &Boundary::default(), &capabilities, CONFIG.period_ns);
        let device = Guarded { device, capabilities, envelope };
        let layer = self.layer(&capabilities);
        let (parameters, _sender, _reports) = ParameterQueue::new(Vec::new(), 1);
        let (swaps, _host_swaps) = swap_queues(1, Vec::new());
        let forces = Forces::new(1, vec![(vec![0], layer)], Vec::new());
        let run = RunConfig {
            period_ns: CONFIG.period_ns,
            ramp_ns: 0,
            longest_gap_ns: 100_000_000,
            emergency_buttons: 0,
        };
        let standby = Standby::new(vec![device], forces, parameters, swaps, CONFIG, run);
        let names = vec!["device".to_owned(), "wall".to_owned()];
        let servo = standby.activate(names, |_| ()).map_err(|(_, refusal)| refusal).expect("it starts");
        let schedule = Schedule::start_virtual(CONFIG.period_ns);
        let mut looped = Loop::new(servo, schedule, self.seconds * 1_000_000_000);
        let mut records = Vec::new();
        while looped.end().is_none() {
            looped.advance(&StopSwitch::default(), |record| records.push(*record));
        }
        let mut forces = looped.finish().0.dismantle().forces;
        Run { records, health: forces.health().remove(0).0 }
    }

    fn layer(&self, capabilities: &Capabilities) -> Layer {
        let plugin = Plugin::in_process(&flotor_wall::FLOTOR_ENTRY).expect("linked in");
        let model = plugin.create_model(&settings(&plugin, self.wall)).expect("the settings are right");
        let mapping = Mapping::new(&self.mapping);
        let mut engine = Engine::Here(model);
        if let Some(rate_hz) = self.rate_hz {
            let timing = FieldTiming { rate_hz, latency_s: 1.0 / rate_hz, contacts: self.contacts };
            let (count, clock) = (plugin.parameters().len(), Clock::Virtual);
            let model = AsynchronousModel::start(
                engine,
                count,
                (&timing, &[(&mapping, &timing.contacts)]),
                &CONFIG,
                clock,
            );
            engine = Engine::Asynchronous(Box::new(model.expect("the limits are above 0")));
        } else {
            engine.prepare(&CONFIG).expect("a wall needs nothing");
        }
        let sampled = SampledLoop { period_s: PERIOD_S, latency_s: capabilities.latency_s };
        Layer::new(vec![(engine, mapping)], &Blend::default(), TimeBudget::default(), &sampled)
    }
}

impl Run {
    fn forces_n(&self) -> impl Iterator<Item = f64> {
        self.records.iter().map(|record| record.commanded.force().z)
    }

    fn peak_n(&self) -> f64 {
        self.forces_n().fold(0.0, f64::max)
    }

    /// Largest energy that came out of the port up to a tick, J.
    fn out_j(&self) -> f64 {
        self.records.iter().map(|record| -record.port_energy_j).fold(0.0, f64::max)
    }

    /// Largest ratio of a step of the force to stiffness times the travel of that tick, beyond the rounding of a force.
    fn steepest(&self, stiffness_n_per_m: f64) -> f64 {
        let steps = self.records.windows(2).map(|pair| {
            let step_n = (pair[1].commanded.force().z - pair[0].commanded.force().z).abs();
            let travel_m = (pair[1].pose.position().z - pair[0].pose.position().z).abs();
            (step_n - 1.0e-9).max(0.0) / (stiffness_n_per_m * travel_m + 1.0e-12)
        });
        steps.fold(0.0, f64::max)
    }
}

#[test]
fn a_slow_wall_only_pushes_and_feels_like_the_wall_in_the_loop() {
    for (stiffness, stiffness_n_per_m) in [("500", 500.0), ("2000", 2000.0)] {
        let wall = [("stiffness_n_per_m", stiffness)];
        for grip in ["firm", "relaxed"] {
            for frequency_hz in ["1", "2", "3", "5", "8"] {
                let scene = Scene { grip, frequency_hz, wall: &wall, ..Scene::default() };
                let in_loop = Scene { rate_hz: None, ..scene }.run();
                for rate_hz in [100.0, 200.0, 500.0] {
                    let slow = Scene { rate_hz: Some(rate_hz), ..scene }.run();
                    let (peak_n, direct_n) = (slow.peak_n(), in_loop.peak_n());
                    let (out_mj, direct_mj) = (slow.out_j() * 1.0e3, in_loop.out_j() * 1.0e3);
                    let steepest = slow.steepest(stiffness_n_per_m);
                    println!(
                        "{stiffness} N/m at {rate_hz} Hz, {grip} hand of {frequency_hz} Hz: peak {peak_n:.3} N (in the \
                         loop {direct_n:.3} N), {out_mj:.4} mJ out (in the loop {direct_mj:.4} mJ), step {steepest:.3}"
                    );
                    assert!(slow.forces_n().all(|force_n| force_n >= 0.0), "it pulls");
                    assert!(out_mj <= 1.15 * direct_mj + 0.02);
                    assert!(steepest <= 1.5);
                    assert!((peak_n / direct_n - 1.0).abs() < 0.01 && direct_n > 0.01);
                    assert!(slow.records.iter().all(|record| !record.events.intersects(Events::MODEL_FAULT)));
                    assert!(slow.health.is_good() && slow.health.contacts.aged.ticks == 0);
                }
            }
        }
    }
}

#[test]
fn a_mapping_scales_contacts_as_it_scales_the_wall() {
    let wall = [("stiffness_n_per_m", "1000")];
    let mapping = MappingConfig { motion_scale: 2.0, force_scale: 0.6, ..MappingConfig::default() };
    let scene = Scene { wall: &wall, mapping, ..Scene::default() };
    let (slow, in_loop) = (scene.run(), Scene { rate_hz: None, ..scene }.run());
    assert!((slow.peak_n() / in_loop.peak_n() - 1.0).abs() < 1.0e-3, "{} N", slow.peak_n());
    assert!((slow.health.contacts.undamped_n_per_m - 1200.0).abs() < 1.0e-9);
}

#[test]
fn the_stiffness_is_what_damping_and_device_keep_stable_and_what_is_reduced_is_said() {
    let cap = StiffnessCap { stiffness_n_per_m: 800.0, by_device_n_per_m: 0.0, per_damping_1_per_s: 100.0 };
    let contacts = ContactLimits { cap: Some(cap), ..ContactLimits::UNKNOWN };
    let soft = [("stiffness_n_per_m", "800")];
    let in_loop = Scene { wall: &soft, rate_hz: None, ..Scene::default() }.run();
    // By the device: 2000 N/m without damping.
    let stiff = [("stiffness_n_per_m", "2000")];
    let by_device = Scene { wall: &stiff, contacts, ..Scene::default() }.run();
    assert!((by_device.peak_n() / in_loop.peak_n() - 1.0).abs() < 0.01, "{} N", by_device.peak_n());
    let [asked, felt] = by_device.health.contacts.reduced_n_per_m.expect("it is reduced");
    assert!((asked - 2000.0).abs() < 1.0e-9 && (felt - 800.0).abs() < 1.0e-9);
    // By its damping: 100 times 5 N s/m.
    let damped = [("stiffness_n_per_m", "2000"), ("damping_ns_per_m", "5")];
    let by_damping = Scene { wall: &damped, contacts, ..Scene::default() }.run();
    let exact = [("stiffness_n_per_m", "500"), ("damping_ns_per_m", "5")];
    let exact = Scene { wall: &exact, rate_hz: None, ..Scene::default() }.run();
    assert_eq!(by_damping.health.contacts.reduced_n_per_m, Some([2000.0, 500.0]));
    assert!((by_damping.peak_n() / exact.peak_n() - 1.0).abs() < 0.02, "{} N", by_damping.peak_n());
    // By the known damping of the device, which keeps 300 N/m stable by itself.
    let known = StiffnessCap { by_device_n_per_m: 300.0, ..cap };
    let known = ContactLimits { cap: Some(known), ..contacts };
    let by_both = Scene { wall: &damped, contacts: known, ..Scene::default() }.run();
    assert_eq!(by_both.health.contacts.reduced_n_per_m, Some([2000.0, 800.0]));
    let undamped = Scene { wall: &stiff, contacts: known, ..Scene::default() }.run();
    let contacts_felt = undamped.health.contacts;
    assert_eq!((contacts_felt.reduced_n_per_m, contacts_felt.undamped_n_per_m), (Some([2000.0, 300.0]), 0.0));
    // Not at all with `cap = false`.
    let off = ContactLimits { cap: None, ..contacts };
    let off = Scene { wall: &damped, contacts: off, ..Scene::default() }.run();
    assert_eq!(off.health.contacts.reduced_n_per_m, None);
}

#[test]
fn the_force_is_within_the_limits_of_the_device() {
    let contacts = ContactLimits { force_n: 0.5, ..ContactLimits::UNKNOWN };
    let run = Scene { contacts, ..Scene::default() }.run();
    assert!(run.peak_n() <= 0.5 && run.peak_n() > 0.49, "{} N", run.peak_n());
    assert!(run.records.iter().any(|record| record.events.intersects(Events::MODEL_DEGRADED)));
}
