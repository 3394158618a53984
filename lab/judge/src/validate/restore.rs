//! Check of saved states: what follows a restore repeats to the bit.

use super::outcome::Outcome;
use super::path::{step, walk};
use super::subject::Subject;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Input, Output};
use flotor_loader::{InstanceState, Model};

/// Steps between two saved states, and after each of them: odd, so that the states lie at different places of a period.
const BETWEEN: usize = 97;
const AFTER: usize = 50;

/// Saves states along a walk, and steps on from each: once more after a restore, and in another instance.
pub(super) fn restore_repeats(subject: &Subject) -> Result<(), Outcome> {
    let (mut model, mut other) = (subject.prepared_model()?, subject.prepared_model()?);
    let inputs: Vec<Input> = walk(2000).collect();
    for (part, ahead) in inputs.chunks(BETWEEN).zip(inputs.chunks(BETWEEN).skip(1)) {
        run(&mut model, part)?;
        let ahead = ahead.get(..AFTER).unwrap_or(ahead);
        let bytes = saved(&mut state(&mut model)?)?;
        let first = run(&mut model, ahead)?;
        for (who, model) in [("another instance", &mut other), ("the instance", &mut model)] {
            restored(&mut state(model)?, &bytes)?;
            let again = run(model, ahead)?;
            if let Some((input, _)) =
                ahead.iter().zip(first.iter().zip(&again)).find(|(_, (a, b))| bits(a) != bits(b))
            {
                return Err(Outcome::Violation(format!(
                    "after a restore, {who} returned another wrench at tick {} of the same path; save every \
                     number that a step depends on",
                    input.tick
                )));
            }
        }
        restored(&mut state(&mut model)?, &bytes)?;
    }
    Ok(())
}

/// Returns the state of a model that can save its history.
fn state(model: &mut Model) -> Result<InstanceState<'_>, Outcome> {
    let why = "the model has a history and does not offer `flotor.snapshot/1`";
    model.state().ok_or_else(|| Outcome::nothing_to_judge(why))
}

/// Saves a state and restores it; nothing without the extension.
pub(super) fn saved_and_restored(state: Option<InstanceState<'_>>) -> Result<(), String> {
    let Some(mut state) = state else { return Ok(()) };
    let bytes = saved(&mut state)?;
    restored(&mut state, &bytes)
}

fn saved(state: &mut InstanceState<'_>) -> Result<Vec<u8>, String> {
    let count = state.count().and_then(|count| usize::try_from(count).ok());
    let mut bytes = vec![0; count.ok_or("snapshot does not return the number of bytes of the state")?];
    match state.save(&mut bytes) {
        CallStatus::Ok => Ok(bytes),
        other => Err(format!("save returned `{}`", other.name())),
    }
}

fn restored(state: &mut InstanceState<'_>, bytes: &[u8]) -> Result<(), String> {
    match state.restore(bytes) {
        CallStatus::Ok => Ok(()),
        other => Err(format!("restore returned `{}`", other.name())),
    }
}

fn run(model: &mut Model, inputs: &[Input]) -> Result<Vec<Output>, String> {
    inputs.iter().map(|input| step(model, input)).collect()
}

fn bits(output: &Output) -> [u64; 6] {
    let ([fx, fy, fz], [tx, ty, tz]) = (output.wrench.force_n, output.wrench.torque_nm);
    [fx, fy, fz, tx, ty, tz].map(f64::to_bits)
}
