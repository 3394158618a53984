//! Live parameters: range, effect and duration of changes.

use super::outcome::Outcome;
use super::path::{CONFIG, finite, walk};
use super::subject::Subject;
use crate::platform::processor_time;
use crate::wording;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Mutability, Parameter};
use flotor_loader::Model;
use std::time::Duration;

/// Number of repetitions of a change, for its duration.
const TIMES: usize = 33;

/// Sets each live parameter to its value, to the ends of its range and to its default. Each parameter has its own instance, because
/// the value of one parameter may change the range of another.
pub(super) fn live_parameters(subject: &Subject) -> Result<(), Outcome> {
    let is_live = |(_, parameter): &(usize, &Parameter)| parameter.mutability() == Mutability::Live;
    let mut taken = Vec::new();
    for (index, parameter) in subject.plugin.parameters().iter().enumerate().filter(is_live) {
        let mut model = subject.prepared_model()?;
        walk(10).try_for_each(|input| finite(&mut model, &input).map(|_| ()))?;
        let own = model.parameter(index);
        let own = if own.is_finite() { own } else { parameter.default() };
        // A model rejects any value of a parameter that depends on others.
        taken.push(set(&mut model, index, parameter, own)?);
        for value in [parameter.min(), parameter.max(), parameter.default()] {
            let _ = set(&mut model, index, parameter, value)?;
        }
    }
    if taken.is_empty() {
        return Err(Outcome::nothing_to_judge("the model has no live parameter"));
    }
    if taken.iter().all(|took| *took == Took::Refused) {
        return Err(Outcome::Violation(
            "the model rejects every live parameter, even with its present value".to_owned(),
        ));
    }
    Ok(())
}

/// Result of setting a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Took {
    /// The value is in use.
    Taken,
    /// The value does not fit the others; the previous one stays in use.
    Refused,
}

fn set(model: &mut Model, index: usize, parameter: &Parameter, value: f64) -> Result<Took, String> {
    let id = parameter.id();
    let before = model.parameter(index);
    let mut took = Vec::with_capacity(TIMES);
    let mut last = CallStatus::Ok;
    for _ in 0..TIMES {
        let started = processor_time();
        last = model.set_parameter(index, value);
        took.push(processor_time().saturating_sub(started));
    }
    let (outcome, expected) = match last {
        CallStatus::Ok => (Took::Taken, value),
        CallStatus::OutOfRange => (Took::Refused, before),
        CallStatus::Unsupported => {
            return Err(format!(
                "`{id}` is declared live, but `set_parameter` returned `unsupported`; support the change, or \
                 do not declare `{id}` live"
            ));
        }
        CallStatus::Panicked => {
            return Err(format!("setting `{id}` = {value} failed: {}", model.reason(last)));
        }
        CallStatus::WrongPhase => {
            return Err(format!("setting `{id}` = {value} returned `{}`", last.name()));
        }
    };
    took.sort_unstable();
    // Take the median: short disturbances of this process do not count.
    let usual = took.get(TIMES / 2).copied().unwrap_or_default();
    let limit = Duration::from_nanos(CONFIG.period_ns / 2);
    if usual > limit {
        let [usual, limit] = [usual, limit].map(wording::time);
        return Err(format!("setting `{id}` to {value} takes {usual}, above the limit of {limit}"));
    }
    // A model need not report its value; if it does, the value must match, up to rounding of a unit conversion.
    let read_back = model.parameter(index);
    let is_told = read_back.is_finite() && expected.is_finite();
    if is_told && (read_back - expected).abs() > 1.0e-9 * read_back.abs().max(expected.abs()) {
        return Err(format!(
            "`set_parameter` of `{id}` to {value} returned `{}`, but then `{id}` is {read_back} instead of {expected}",
            last.name()
        ));
    }
    walk(10).try_for_each(|input| {
        finite(model, &input).map(|_| ()).map_err(|words| format!("with `{id}` = {value}, {words}"))
    })?;
    Ok(outcome)
}
