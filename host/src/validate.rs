//! Checks a plugin against the rules of the contract, from outside, the way a host meets it.

use flotor_hal::abi::loader::{LoadError, Model, OpenedDevice, Plugin, read_metadata};
use flotor_hal::abi::{CallStatus, PluginKind};
use flotor_hal::conformance::Rule;
use flotor_hal::{
    Cycle, DQuat, DVec3, DeviceState, Input, LoopConfig, Output, Parameter, ParameterKind, Pose, Tick, Wrench,
};
use serde::Serialize;
use std::path::Path;

/// Outcome of one rule.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Short name of the rule.
    pub rule: &'static str,
    /// What it demands.
    pub text: &'static str,
    /// `None` if it holds, else what was seen.
    pub violation: Option<String>,
}

/// Checks a plugin file against every rule that applies; stops at the first that makes the rest pointless.
/// Not real-time; runs the plugin's code in this process.
#[must_use]
pub fn validate(path: &Path) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut note = |rule: Rule, result: Result<(), String>| {
        let holds = result.is_ok();
        findings.push(Finding { rule: rule.id(), text: rule.text(), violation: result.err() });
        holds
    };
    let words = |error: LoadError| error.to_string();
    if !note(Rule::Metadata, read_metadata(path).map(|_| ()).map_err(words)) {
        return findings;
    }
    let plugin = match Plugin::load(path) {
        Ok(plugin) => plugin,
        Err(error) => {
            note(Rule::Loads, Err(error.to_string()));
            return findings;
        }
    };
    note(Rule::Loads, Ok(()));
    note(Rule::Schema, schema(plugin.parameters()));
    let kind = plugin.metadata().kind;
    let defaults = match kind {
        PluginKind::Model => plugin.create_model(&[]).map(|_| ()),
        PluginKind::Device => plugin.open_device(&[]).map(|_| ()),
    };
    if !note(Rule::Defaults, defaults.map_err(words)) {
        return findings;
    }
    for rule in Rule::ALL.into_iter().filter(|rule| rule.applies_to(kind)) {
        let result = match rule {
            Rule::FiniteNearHome => with_model(&plugin, near_home),
            Rule::SurvivesNotFinite => with_model(&plugin, not_finite),
            Rule::SurvivesFarPoses => with_model(&plugin, far_poses),
            Rule::ResetRepeats => with_model(&plugin, reset_repeats),
            Rule::Capabilities => with_device(&plugin, |mut device| {
                device.capabilities().map(|_| ()).map_err(|refusal| refusal.to_string())
            }),
            Rule::Lifecycle => with_device(&plugin, lifecycle),
            Rule::SafeStop => with_device(&plugin, safe_stop),
            _ => continue, // checked above
        };
        note(rule, result);
    }
    findings
}

/// Rate a plugin is checked at.
const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 1 };

fn with_model(plugin: &Plugin, check: impl FnOnce(&mut Model) -> Result<(), String>) -> Result<(), String> {
    let mut model = plugin.create_model(&[]).map_err(|error| error.to_string())?;
    model.prepare(&CONFIG).map_err(|refusal| refusal.to_string())?;
    check(&mut model)
}

fn with_device(
    plugin: &Plugin,
    check: impl FnOnce(OpenedDevice) -> Result<(), String>,
) -> Result<(), String> {
    check(plugin.open_device(&[]).map_err(|error| error.to_string())?)
}

fn schema(parameters: &[Parameter]) -> Result<(), String> {
    for (index, parameter) in parameters.iter().enumerate() {
        let id = parameter.id();
        if id.is_empty() || parameter.doc().is_empty() {
            return Err(format!("parameter {index} (`{id}`) lacks an id or a doc"));
        }
        if parameters.iter().take(index).any(|earlier| earlier.id() == id) {
            return Err(format!("`{id}` occurs twice"));
        }
        if !matches!(parameter.kind(), ParameterKind::Text | ParameterKind::File)
            && let Err(range) = parameter.check(parameter.default())
        {
            return Err(format!("the default of `{id}`: {range}"));
        }
    }
    Ok(())
}

/// One step; the wrench, or what went wrong.
fn step(model: &mut Model, pose: Pose) -> Result<Output, String> {
    let mut output = Output::default();
    match model.step(&Input::at_rest(pose), &mut output) {
        CallStatus::Ok => Ok(output),
        CallStatus::Panicked => Err(format!("at {pose:?} it {}", model.last_message())),
        other => Err(format!("at {pose:?} it answered {other:?}")),
    }
}

fn finite(model: &mut Model, pose: Pose) -> Result<(), String> {
    let output = step(model, pose)?;
    if output.wrench.is_finite() && !output.energy_j.is_infinite() && output.status().is_some() {
        return Ok(());
    }
    Err(format!("at {pose:?} it answered {:?}", output))
}

/// Poses on a grid of `size_m` and `size_rad`, all 27 x 27 corners, edges and centres.
fn grid(size_m: f64, size_rad: f64) -> impl Iterator<Item = Pose> {
    let three = [-1.0, 0.0, 1.0];
    let corners = move || three.into_iter().flat_map(move |x| three.map(move |y| (x, y)));
    let vectors = move || corners().flat_map(move |(x, y)| three.map(move |z| DVec3::new(x, y, z)));
    vectors().flat_map(move |position| {
        vectors().map(move |rotation| {
            let orientation = DQuat::from_scaled_axis(rotation * size_rad);
            Pose::new(position * size_m, orientation)
        })
    })
}

fn near_home(model: &mut Model) -> Result<(), String> {
    finite(model, Pose::HOME)?;
    for size_m in [1.0e-12, 1.0e-6, 1.0e-3, 5.0e-3] {
        grid(size_m, size_m * 10.0).try_for_each(|pose| finite(model, pose))?;
    }
    Ok(())
}

fn not_finite(model: &mut Model) -> Result<(), String> {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for axis in 0..7 {
            let mut pose = Pose::HOME;
            let numbers = pose.position_m.iter_mut().chain(&mut pose.orientation_xyzw);
            numbers.skip(axis).take(1).for_each(|number| *number = bad);
            finite(model, pose)?;
        }
    }
    finite(model, Pose::HOME) // and it still works afterwards
}

fn far_poses(model: &mut Model) -> Result<(), String> {
    for size_m in [0.03, 1.0, 1.0e9, 1.0e300] {
        grid(size_m, 3.0).try_for_each(|pose| finite(model, pose))?;
    }
    Ok(())
}

fn reset_repeats(model: &mut Model) -> Result<(), String> {
    let run = |model: &mut Model| -> Result<Vec<Output>, String> {
        grid(2.0e-3, 0.05).map(|pose| step(model, pose)).collect()
    };
    let first = run(model)?;
    model.reset();
    let second = run(model)?;
    let differs = first.iter().zip(&second).position(|(a, b)| a.wrench != b.wrench);
    differs
        .map_or(Ok(()), |index| Err(format!("pose {index} of the same walk gave another answer after reset")))
}

fn lifecycle(device: OpenedDevice) -> Result<(), String> {
    let mut opened = device;
    for _ in 0..2 {
        let mut active = opened.activate(&CONFIG).map_err(|(_, refusal)| refusal.to_string())?;
        for index in 0..100 {
            let tick = tick(index);
            let mut state = DeviceState::HOME;
            if let Cycle::Fault(fault) = active.read(&tick, &mut state) {
                return Err(format!("read at tick {index}: {}", fault.advice()));
            }
            if !state.is_finite() {
                return Err(format!("read at tick {index} gave {state:?}"));
            }
            if let Cycle::Fault(fault) = active.write(&tick, &Wrench::ZERO) {
                return Err(format!("write at tick {index}: {}", fault.advice()));
            }
        }
        opened = active.deactivate().ok_or("deactivate failed")?;
    }
    Ok(())
}

fn safe_stop(device: OpenedDevice) -> Result<(), String> {
    let stopper = device.stopper();
    let mut active = device.activate(&CONFIG).map_err(|(_, refusal)| refusal.to_string())?;
    let mut state = DeviceState::HOME;
    let push = Wrench::from_force(DVec3::new(0.0, 0.0, 1.0));
    let _ = active.read(&tick(0), &mut state);
    let _ = active.write(&tick(0), &push);
    std::thread::spawn(move || stopper.safe_stop()).join().map_err(|_| "safe_stop panicked".to_owned())?;
    for index in 1..20 {
        let _ = active.read(&tick(index), &mut state);
        let _ = active.write(&tick(index), &push);
    }
    let _ = active.read(&tick(20), &mut state);
    let delivered_n = state.delivered.force().length();
    if delivered_n == 0.0 { Ok(()) } else { Err(format!("it still delivers {delivered_n} N")) }
}

fn tick(index: u64) -> Tick {
    let dt_ns = if index == 0 { 0 } else { CONFIG.period_ns };
    Tick { index, time_ns: index * CONFIG.period_ns, dt_ns }
}
