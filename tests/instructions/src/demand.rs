//! Settings of the shipped models whose steps are counted by demand.

use flotor_hal::abi::PluginKind;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{Demand, Input, LoopConfig, Output, Pose};
use flotor_loader::{Model, Setting};
use flotor_session::registry::Registry;
use std::f64::consts::TAU;
use std::hint::black_box;

/// Force alone, force and torque, all.
const DEMANDS: [Demand; 3] = [Demand::FORCE, Demand::WRENCH, Demand::ALL];

/// A model and its parameters, the middle of the motion below home, m, its size as a part of a hand's, and counted ticks.
type Counted = (&'static str, &'static [(&'static str, &'static str)], f64, f64, u64);
/// Ticks before those that are counted.
const WARM_UP: u64 = 10;

/// In the order of `[demand]` in `budgets.toml`.
const SETTINGS: [Counted; 19] = [
    ("spring", &[], 4.0e-3, 1.0, 500),
    ("spring", &[("hand_over", "off")], 4.0e-3, 1.0, 500),
    ("spring", &[("wire", "on")], 4.0e-3, 1.0, 500),
    ("spring", &[("variant", "thesis")], 4.0e-3, 1.0, 500),
    ("spring", &[("variant", "closed-form")], 4.0e-3, 1.0, 500),
    ("spring", &[("variant", "current-length")], 4.0e-3, 1.0, 500),
    ("spring", &[("variant", "rod")], 4.0e-3, 1.0, 200),
    ("spring", &[("seat", "free")], 4.0e-3, 1.0, 200),
    ("spring", &[("coil_contact", "on")], 4.0e-3, 1.0, 100),
    ("load", &[("kind", "felt")], 4.0e-3, 1.0, 500),
    ("load", &[("kind", "exerted")], 4.0e-3, 1.0, 500),
    ("measured", &[], 4.0e-3, 1.0, 500),
    ("wall", &[("shape", "plane")], 4.0e-3, 1.0, 500),
    ("wall", &[("shape", "sphere")], 4.0e-3, 1.0, 500),
    ("wall", &[("shape", "box")], 4.0e-3, 1.0, 500),
    ("solid", &[("body", "half-space")], 4.0e-3, 1.0, 500),
    ("solid", &[("body", "half-space"), ("tool", "punch-round"), ("tool_radius_mm", "10")], 2.0e-3, 0.3, 500),
    ("solid", &[], 4.0e-3, 1.0, 500),
    ("membrane", &[], 4.0e-3, 1.0, 20),
];

/// A part for each demand of each setting: `count` counts it.
pub(crate) fn demands(count: fn(&mut dyn FnMut())) {
    let registry = Registry::search(&[]);
    for (id, parameters, depth_m, size, ticks) in SETTINGS {
        for demand in DEMANDS {
            let mut model = model(&registry, id, parameters);
            let inputs: Vec<Input> =
                (0..ticks + WARM_UP).map(|tick| input(tick, depth_m, size, demand)).collect();
            let mut output = Output::default();
            let mut walk = |inputs: &[Input]| {
                for input in inputs {
                    let _ = black_box(model.step(black_box(input), &mut output));
                    black_box(&output);
                }
            };
            let (first, counted): (Vec<Input>, Vec<Input>) =
                inputs.into_iter().partition(|input| input.tick < WARM_UP);
            walk(&first);
            count(&mut || walk(&counted));
        }
    }
}

fn model(registry: &Registry, id: &str, parameters: &[(&str, &str)]) -> Model {
    let plugin = registry.load(id, PluginKind::Model).expect("the plugins are built");
    let parse = |(key, value): &(&str, &str)| {
        Setting::parse(plugin.parameters(), key, value).expect("a legal setting")
    };
    let settings: Vec<Setting> = parameters.iter().map(parse).collect();
    let mut model = plugin.create_model(&settings).expect("the settings fit together");
    model.prepare(&LoopConfig { period_ns: 1_000_000, seed: 0 }).expect("1 kHz");
    model
}

/// A tick of a hand that moves smoothly, one to three times a second, by a few millimetres and degrees.
fn input(tick: u64, depth_m: f64, size: f64, demand: Demand) -> Input {
    let sines = |frequencies_hz: DVec3| (frequencies_hz * (TAU * 1.0e-3 * tick as f64)).map(f64::sin);
    let position_m = DVec3::new(1.5e-3, 1.2e-3, 3.0e-3) * size * sines(DVec3::new(1.4, 2.1, 1.0));
    let rotation_rad = DVec3::new(0.03, 0.025, 0.035) * sines(DVec3::new(1.7, 2.5, 3.0));
    let pose = Pose::new(position_m - DVec3::Z * depth_m, DQuat::from_scaled_axis(rotation_rad));
    Input { tick, time_ns: tick * 1_000_000, dt_ns: 1_000_000, demand, ..Input::at_rest(pose) }
}
