//! Complete life of an instance: all calls of a host, in a host's order, including extensions. Three rules share it;
//! each checks something else between the calls.

use super::device::Running;
use super::outcome::Outcome;
use super::path::{CONFIG, finite, walk};
use super::restore;
use super::subject::Subject;
use crate::watch::enter_call;
use crate::wording;
use flotor_core::grip_guard::GripGuard;
use flotor_core::limits::Limits;
use flotor_hal::abi::CallStatus;
use flotor_hal::extension::linear_field::LinearField;
use flotor_hal::{ContactSet, GripKind, GripState, Input, Mutability, Output, Parameter, Pose, Wrench};
use flotor_loader::{Model, OpenedDevice};

/// Number of steps of a model, and of ticks of a device.
const STEPS: u64 = 300;
/// Number of points of a centreline: the maximum of the viewer.
const POINTS: usize = 65;

/// Callback after each call: name of the call, and number of calls so far that changed the floating-point mode, which
/// the loader restores at once.
pub(super) type After<'a> = &'a mut dyn FnMut(&str, u64) -> Result<(), String>;

/// Runs the life of an instance. Fails if a call or `after` fails.
pub(super) fn live(subject: &Subject, after: After<'_>) -> Result<(), Outcome> {
    if subject.is_device() {
        return device(subject.device()?, after);
    }
    let mut model = subject.plugin.create_model(&subject.settings)?;
    after("create", model.float_changes())?;
    model.prepare(&CONFIG).map_err(|refusal| format!("prepare refused: {refusal}"))?;
    after("prepare", model.float_changes())?;
    steps(&mut model)?;
    after("step", model.float_changes())?;
    settings(&mut model, subject.plugin.parameters())?;
    after("set_parameter", model.float_changes())?;
    extensions(&mut model, after)?;
    if let Some(problem) = model.message_problem() {
        return Err(format!("last_message returned {problem}").into());
    }
    after("last_message", model.float_changes())?;
    match model.reset() {
        CallStatus::Ok => {}
        status => return Err(format!("reset failed: {}", model.reason(status)).into()),
    }
    after("reset", model.float_changes())?;
    drop(model);
    Ok(after("destroy", 0)?)
}

/// Steps singly and as a batch. Input and output are separate blocks of memory, so that writes beside them are detected.
fn steps(model: &mut Model) -> Result<(), String> {
    for sent in walk(STEPS) {
        let (input, mut output) = (Box::new(sent), Box::<Output>::default());
        let status = {
            let _call = enter_call(std::slice::from_ref(&*input));
            model.step(&input, &mut output)
        };
        if status != CallStatus::Ok {
            return Err(format!("step {} failed: {}", sent.tick, model.reason(status)));
        }
        if *input != sent {
            return Err(format!("step {} changed its input", sent.tick));
        }
    }
    let inputs: Vec<Input> = walk(STEPS).collect();
    let mut outputs = vec![Output::default(); inputs.len()];
    let _calls = enter_call(&inputs);
    match model.step_batch(&inputs, &mut outputs) {
        CallStatus::Ok => Ok(()),
        other => Err(format!("step_batch returned `{}`", other.name())),
    }
}

fn settings(model: &mut Model, parameters: &[Parameter]) -> Result<(), String> {
    for (index, parameter) in parameters.iter().enumerate() {
        let value = model.parameter(index);
        if parameter.mutability() == Mutability::Live && value.is_finite() {
            // A value that depends on others may be rejected; `live-parameters` checks that.
            let _ = model.set_parameter(index, value);
        }
    }
    works(model, "set_parameter")
}

/// Calls each extension twice: at home, and on the path.
fn extensions(model: &mut Model, after: After<'_>) -> Result<(), String> {
    for input in [Some(Input::at_rest(Pose::HOME)), walk(100).last()].into_iter().flatten() {
        let _ = model.active_region();
        works(model, "active-region")?;
        let _ = model.workspace_bounds();
        works(model, "workspace-bounds")?;
        if model.has_linear_field() {
            let mut field = Box::new(LinearField::NONE);
            let answer = model.linear_field(&input, &mut field);
            works(model, "linear-field")?;
            let at = wording::pose(&input.pose);
            if answer != CallStatus::Ok {
                return Err(format!(
                    "linear-field returned `{}` at {at}; return ok at every pose, or do not offer flotor.linear-field/1",
                    answer.name()
                ));
            }
            if !field.is_finite() {
                let field = wording::linear_field(&field);
                return Err(format!(
                    "linear-field returned a field that is not finite at {at}: {field}; return finite numbers"
                ));
            }
        }
        for kind in [GripKind::Linear, GripKind::Angular] {
            let effort = model.grip(&input, &GripState::new(kind, 0.01, -0.1));
            works(model, "grip")?;
            if !effort.is_finite() {
                return Err(format!("grip returned the effort {effort}"));
            }
        }
        if model.has_contact_set() {
            let mut set = Box::new(ContactSet::NONE);
            let answer = model.contact_set(&input, &mut set);
            works(model, "contact-set")?;
            let at = wording::pose(&input.pose);
            if answer != CallStatus::Ok {
                return Err(format!(
                    "contact-set returned `{}` at {at}; return ok at every pose, or do not offer flotor.contact-set/1",
                    answer.name()
                ));
            }
            if !set.bilateral().is_finite() {
                let field = wording::linear_field(&set.bilateral());
                return Err(format!(
                    "the bilateral part of contact-set is not finite at {at}: {field}; return finite numbers"
                ));
            }
            // Any period: how long a set is valid does not make it right or wrong.
            flotor_contact::ContactSet::published(&set, 1.0)
                .map_err(|error| format!("contact-set: {error}"))?;
        }
        let drawn = model.centerline().map(|mut line| (line.info(), line.points(&input, POINTS)));
        works(model, "centerline")?;
        if let Some((info, points)) = drawn {
            let problem = match (info, points) {
                (None, _) => Some("no info"),
                (_, None) => Some("no points"),
                (_, Some(points)) if points.iter().all(Pose::is_finite) => None,
                _ => Some("a point that is not finite"),
            };
            if let Some(problem) = problem {
                return Err(format!("centerline returned {problem}"));
            }
        }
        if model.has_shape() {
            let shape = model.shape(&input);
            works(model, "shape")?;
            shape.map_err(|invalid| format!("shape: {invalid}"))?;
        }
        let mut values = vec![f64::NAN; model.details().len()];
        let answer = model.read_details(&mut values);
        works(model, "details")?;
        if !matches!(answer, CallStatus::Ok | CallStatus::Unsupported) {
            return Err(format!("details answered `{}`", answer.name()));
        }
        restore::saved_and_restored(model.state())?;
        works(model, "snapshot")?;
    }
    after("an extension", model.float_changes())
}

/// Checks that the instance still answers: after a panic its next step returns the message.
fn works(model: &mut Model, asked: &str) -> Result<(), String> {
    let answer = finite(model, &Input::at_rest(Pose::HOME));
    answer.map(|_| ()).map_err(|words| format!("after {asked}, {words}"))
}

fn device(mut device: OpenedDevice, after: After<'_>) -> Result<(), Outcome> {
    after("open", 0)?;
    let _ = device.capabilities().map_err(|refusal| refusal.to_string())?;
    after("capabilities", 0)?;
    for index in 0..device.parameters().len() {
        let _ = device.parameter(index);
    }
    drop(device.serial());
    let grip = device.grip_axis().map_err(|refusal| refusal.to_string())?;
    after("an extension", 0)?;
    let stopper = device.stopper();
    let mut running = Running::start(device)?;
    after("activate", running.device.float_changes())?;
    for _ in 0..STEPS {
        let _ = running.turn(&Wrench::ZERO).map_err(String::from)?;
    }
    after("read and write", running.device.float_changes())?;
    let _ = running.device.energy_ledger();
    if let Some(axis) = grip {
        let is_taken = running.device.write_grip(0.0);
        let sample = running.device.read_grip(axis.kind());
        if !is_taken || GripGuard::new(axis, &Limits::default()).check(sample).is_err() {
            return Err("the grip takes no effort, or returns no plausible sample".to_owned().into());
        }
    }
    restore::saved_and_restored(running.device.state())?;
    drop(running.device.last_message());
    after("an extension", running.device.float_changes())?;
    stopper.safe_stop();
    drop(stopper);
    after("safe_stop", running.device.float_changes())?;
    let device = running.device.deactivate().ok_or_else(|| "deactivate failed".to_owned())?;
    after("deactivate", 0)?;
    drop(device);
    Ok(after("close", 0)?)
}
