//! One rule, checked in this process.

use super::Seen;
use crate::scene::KeyValue;
use flotor_hal::abi::loader::{LoadError, Model, OpenedDevice, Plugin, Setting, read_metadata};
use flotor_hal::abi::{CallStatus, PluginKind};
use flotor_hal::conformance::Rule;
use flotor_hal::{
    Cycle, DQuat, DVec3, Demand, DeviceState, Input, LoopConfig, Memory, Output, Parameter, ParameterKind,
    Pose, RefusalKind, Tick, Wrench,
};
use std::path::Path;
use std::time::Instant;

/// Checks one rule, of instances with these settings. Not real-time; runs the plugin's code in this process, which it may hang or end.
///
/// # Errors
/// What was seen that violates the rule, or what is missing to check it.
pub fn check(path: &Path, settings: &[KeyValue], rule: Rule) -> Result<(), Seen> {
    let words = |error: LoadError| error.to_string();
    if rule == Rule::Metadata {
        return read_metadata(path).map(|_| ()).map_err(|error| Seen::Violation(words(error)));
    }
    let plugin = Plugin::load(path).map_err(|error| Seen::Violation(words(error)))?;
    let parse = |set: &KeyValue| {
        let (key, value) = set.pair();
        Setting::parse(plugin.parameters(), key, value).map_err(|error| Seen::Missing(error.to_string()))
    };
    let settings = settings.iter().map(parse).collect::<Result<Vec<_>, Seen>>()?;
    let subject = Subject { plugin, settings };
    if subject.plugin.metadata().kind == PluginKind::Device && needs_the_device(rule) {
        return check_device(&subject, rule);
    }
    check_without_device(&subject, rule).map_err(Seen::Violation)
}

/// What is checked: a plugin, and how its instances are set.
struct Subject {
    plugin: Plugin,
    settings: Vec<Setting>,
}

impl Subject {
    fn model(&self) -> Result<Model, String> {
        self.plugin.create_model(&self.settings).map_err(|error| error.to_string())
    }

    fn prepared_model(&self) -> Result<Model, String> {
        let mut model = self.model()?;
        model.prepare(&CONFIG).map_err(|refusal| refusal.to_string())?;
        Ok(model)
    }
}

/// True for rules that open a device plugin.
fn needs_the_device(rule: Rule) -> bool {
    matches!(rule, Rule::Defaults | Rule::Capabilities | Rule::Lifecycle | Rule::SafeStop)
}

/// Rules of a device. One that is not there, busy or forbidden is nobody's violation.
fn check_device(subject: &Subject, rule: Rule) -> Result<(), Seen> {
    let mut device = subject.plugin.open_device(&subject.settings).map_err(|error| match error {
        LoadError::Refused { refusal, .. } if refusal.kind == RefusalKind::Resource => {
            Seen::Missing(refusal.reason)
        }
        other => Seen::Violation(other.to_string()),
    })?;
    let checked = match rule {
        Rule::Capabilities => device.capabilities().map(|_| ()).map_err(|refusal| refusal.to_string()),
        Rule::Lifecycle => lifecycle(device),
        Rule::SafeStop => safe_stop(device),
        _ => Ok(()),
    };
    checked.map_err(Seen::Violation)
}

fn check_without_device(subject: &Subject, rule: Rule) -> Result<(), String> {
    match rule {
        Rule::Metadata | Rule::Loads => Ok(()),
        Rule::Schema => schema(subject.plugin.parameters()),
        Rule::Defaults => subject.model().map(|_| ()),
        Rule::FiniteNearHome => with_model(subject, near_home),
        Rule::SurvivesNotFinite => with_model(subject, not_finite),
        Rule::SurvivesFarPoses => with_model(subject, far_poses),
        Rule::ResetRepeats => with_model(subject, reset_repeats),
        Rule::TimeBudget => with_model(subject, time_budget),
        Rule::Independent => independent(subject),
        Rule::NoThreads => with_model(subject, no_threads),
        Rule::EnergyGradient => with_model(subject, energy_gradient),
        unknown => Err(format!("this host cannot check `{}`", unknown.id())),
    }
}

/// Rate a plugin is checked at.
const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 1 };

fn with_model(subject: &Subject, check: impl FnOnce(&mut Model) -> Result<(), String>) -> Result<(), String> {
    check(&mut subject.prepared_model()?)
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

/// A walk near home that never repeats a pose, as inputs of a loop.
fn walk(steps: u64) -> impl Iterator<Item = Input> {
    (0..steps).map(|tick| {
        #[allow(clippy::cast_precision_loss)] // a few thousand
        let t = tick as f64 * 1.0e-3;
        let position = DVec3::new((7.0 * t).sin(), (11.0 * t).sin(), (5.0 * t).sin()) * 3.0e-3;
        let rotation = DVec3::new((3.0 * t).sin(), (13.0 * t).sin(), (2.0 * t).sin()) * 0.03;
        let pose = Pose::new(position, DQuat::from_scaled_axis(rotation));
        let dt_ns = if tick == 0 { 0 } else { CONFIG.period_ns };
        Input { tick, time_ns: tick * CONFIG.period_ns, dt_ns, ..Input::at_rest(pose) }
    })
}

fn time_budget(model: &mut Model) -> Result<(), String> {
    const STEPS: usize = 1000;
    let mut took_ns = Vec::with_capacity(STEPS);
    let mut output = Output::default();
    for input in walk(STEPS as u64) {
        let started = Instant::now();
        let _ = model.step(&input, &mut output);
        took_ns.push(started.elapsed().as_nanos());
    }
    took_ns.sort_unstable();
    let usual_ns = took_ns.get(STEPS * 99 / 100).copied().unwrap_or_default();
    let limit_ns = u128::from(CONFIG.period_ns / 2);
    if usual_ns <= limit_ns {
        return Ok(());
    }
    Err(format!("one step in a hundred takes more than {} µs, of {} µs", usual_ns / 1000, limit_ns / 1000))
}

/// Wrenches of a walk; two models may be walked in turns.
fn walked(models: &mut [&mut Model]) -> Result<Vec<Vec<Wrench>>, String> {
    let mut wrenches = vec![Vec::new(); models.len()];
    for input in walk(500) {
        for (model, wrenches) in models.iter_mut().zip(&mut wrenches) {
            let mut output = Output::default();
            match model.step(&input, &mut output) {
                CallStatus::Ok => wrenches.push(output.wrench),
                other => return Err(format!("tick {} was answered {other:?}", input.tick)),
            }
        }
    }
    Ok(wrenches)
}

fn independent(subject: &Subject) -> Result<(), String> {
    let make = || subject.prepared_model();
    let alone = walked(&mut [&mut make()?])?;
    let alone = alone.first().cloned().unwrap_or_default();
    let in_turns = walked(&mut [&mut make()?, &mut make()?])?;
    if in_turns.iter().any(|wrenches| *wrenches != alone) {
        return Err("two instances stepped in turns answer otherwise than one alone".to_owned());
    }
    // Made here, used there: a loop has a thread of its own.
    let elsewhere: Vec<_> = [make()?, make()?]
        .map(|mut model| std::thread::spawn(move || walked(&mut [&mut model])))
        .into_iter()
        .map(|thread| thread.join().map_err(|_| "a thread panicked".to_owned())?)
        .collect::<Result<_, String>>()?;
    if elsewhere.iter().flatten().any(|wrenches| *wrenches != alone) {
        return Err("two instances stepped on two threads answer otherwise than one alone".to_owned());
    }
    Ok(())
}

fn no_threads(model: &mut Model) -> Result<(), String> {
    let threads = || std::fs::read_dir("/proc/self/task").map_or(0, Iterator::count);
    let before = threads();
    let _ = walked(&mut [model])?;
    let after = threads();
    if after <= before { Ok(()) } else { Err(format!("{} threads more after 500 steps", after - before)) }
}

/// Compares force and energy over steps of a micrometre at poses of a walk. A kink in the law may lie between two of
/// them, so that a few may differ, but not one in ten.
fn energy_gradient(model: &mut Model) -> Result<(), String> {
    const STEP_M: f64 = 1.0e-6;
    const TOLERATED: usize = 10;
    if model.memory() != Memory::Stateless || !model.serves().contains(Demand::ENERGY) {
        return Ok(());
    }
    let mut seen: Vec<(f64, f64)> = Vec::new();
    for input in walk(2000).step_by(20) {
        for axis in DVec3::AXES {
            let at = |model: &mut Model, along: f64| {
                let position = input.pose.position() + axis * along;
                step(model, Pose::new(position, input.pose.orientation()))
            };
            let [ahead, here, behind] = [at(model, STEP_M)?, at(model, 0.0)?, at(model, -STEP_M)?];
            let gradient_n = (ahead.energy_j - behind.energy_j) / (2.0 * STEP_M);
            if gradient_n.is_finite() {
                seen.push((here.wrench.force().dot(axis), -gradient_n));
            }
        }
    }
    let largest_n = seen.iter().fold(0.0, |largest: f64, (force_n, _)| largest.max(force_n.abs()));
    // Rounding of the energy over the step, and the curvature of the law, are far below a hundredth of the force.
    let differs = |(force_n, gradient_n): &&(f64, f64)| (force_n - gradient_n).abs() > 0.01 * largest_n;
    let different = seen.iter().filter(differs).count();
    if different * TOLERATED <= seen.len() {
        return Ok(());
    }
    let example = seen.iter().find(differs).map_or(String::new(), |(force_n, gradient_n)| {
        format!(": {force_n:.4} N where the energy's gradient says {gradient_n:.4} N")
    });
    Err(format!("force and energy disagree in {different} of {} places{example}", seen.len()))
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
