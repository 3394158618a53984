//! Live parameters: whether a person who moves a slider gets what the slider says.

use super::checks::Subject;
use super::path::{CONFIG, finite, walk};
use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::Model;
use flotor_hal::{Mutability, Parameter};
use std::time::{Duration, Instant};

/// How often a value is set, to tell how long that takes.
const TIMES: usize = 33;

/// Sets each live parameter to what it is, to the ends of its range and to its default. An instance of its
/// own for each: what the value of one does to the range of another is the model's business.
pub(super) fn live_parameters(subject: &Subject) -> Result<(), String> {
    let is_live = |(_, parameter): &(usize, &Parameter)| parameter.mutability() == Mutability::Live;
    let mut taken = Vec::new();
    for (index, parameter) in subject.plugin.parameters().iter().enumerate().filter(is_live) {
        let mut model = subject.prepared_model()?;
        walk(10).try_for_each(|input| finite(&mut model, &input).map(|_| ()))?;
        let own = model.parameter(index);
        let own = if own.is_finite() { own } else { parameter.default() };
        // Where a number follows from others, a model refuses it whatever its value.
        taken.push(set(&mut model, index, parameter, own)?);
        for value in [parameter.min(), parameter.max(), parameter.default()] {
            let _ = set(&mut model, index, parameter, value)?;
        }
    }
    if !taken.is_empty() && taken.iter().all(|took| *took == Took::Refused) {
        return Err("it refuses every live parameter, even the value in force".to_owned());
    }
    Ok(())
}

/// What came of a value that was set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Took {
    /// It is in force.
    Taken,
    /// It does not fit the others, and the one before stays.
    Refused,
}

fn set(model: &mut Model, index: usize, parameter: &Parameter, value: f64) -> Result<Took, String> {
    let id = parameter.id();
    let before = model.parameter(index);
    let mut took = Vec::with_capacity(TIMES);
    let mut last = CallStatus::Ok;
    for _ in 0..TIMES {
        let started = Instant::now();
        last = model.set_parameter(index, value);
        took.push(started.elapsed());
    }
    let (outcome, expected) = match last {
        CallStatus::Ok => (Took::Taken, value),
        CallStatus::OutOfRange => (Took::Refused, before),
        CallStatus::Unsupported => {
            return Err(format!("`{id}` is declared live, but there is no `set_parameter` to set it"));
        }
        CallStatus::Panicked => return Err(format!("`{id}` = {value}: it {}", model.last_message())),
        CallStatus::WrongPhase => return Err(format!("`{id}` = {value} was answered {last:?}")),
    };
    took.sort_unstable();
    // The one in the middle: what disturbs this process for a moment does not count.
    let usual = took.get(TIMES / 2).copied().unwrap_or_default();
    let limit = Duration::from_nanos(CONFIG.period_ns / 2);
    if usual > limit {
        return Err(format!("setting `{id}` to {value} takes {usual:?}, of {limit:?}"));
    }
    // A model need not tell the value in force; if it does, it is the one. A conversion of units may round.
    let told = model.parameter(index);
    let is_told = told.is_finite() && expected.is_finite();
    if is_told && (told - expected).abs() > 1.0e-9 * told.abs().max(expected.abs()) {
        return Err(format!("`{id}` was set to {value}, answered {last:?}, and is said to be {told}"));
    }
    walk(10).try_for_each(|input| {
        finite(model, &input).map(|_| ()).map_err(|words| format!("with `{id}` = {value}, {words}"))
    })?;
    Ok(outcome)
}
