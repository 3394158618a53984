//! The shortest and simplest run that still fails in the same way.

use crate::bound::Miss;
use crate::case::{Case, Check};
use crate::check::{Failure, run, run_arguments};
use crate::process::Flotor;
use serde_json::Value;

/// Longest run that is searched for the tick of a crash, ticks: it has no summary that says how long it was.
const LONGEST: u64 = 1 << 20;

/// The arguments of the shortest run with the fewest settings that fails as `failure`.
///
/// A number that is missed on the same side from the first tick on (a peak force is too low until the hand pushes) says nothing
/// about the length, and the run keeps it. A run that did not end in time is not repeated.
pub(crate) fn shortest(
    flotor: &Flotor,
    case: &Case<'_>,
    failure: &Failure,
    json: Option<&Value>,
) -> Vec<String> {
    let Check::Run { seed, set } = &case.check else { return Vec::new() };
    let whole = case.file.duration.as_deref();
    let mut kept = set.clone();
    if failure.expected == "an end" {
        return run_arguments(case.file, *seed, &kept, whole);
    }
    let fails = |set: &[(String, String)], duration: Option<&str>| {
        let judged = run(flotor, case, *seed, set, duration);
        judged.failures.iter().any(|other| {
            // A shorter run has another digest, and may not have come to its end.
            let is_whole = ["trace_digest", "end"].contains(&other.what.as_str());
            let is_same_word = !is_whole || other.got == failure.got;
            let same = (&other.what, &other.expected, other.miss);
            is_same_word && same == (&failure.what, &failure.expected, failure.miss)
        })
    };
    for (key, _) in set {
        let fewer: Vec<_> = kept.iter().filter(|(other, _)| other != key).cloned().collect();
        if fails(&fewer, whole) {
            kept = fewer;
        }
    }
    let number = |key: &str| json.and_then(|json| json.get(key)).and_then(Value::as_f64);
    let rate_hz = number("rate_hz").unwrap_or(1000.0);
    let duration = |ticks: u64| format!("{}s", ticks as f64 / rate_hz);
    let ticks = json.and_then(|json| json.get("ticks")).and_then(Value::as_u64);
    let says_nothing = matches!(failure.miss, Some(Miss::Below | Miss::Above)) || failure.got == "finished";
    let length = first_failing(ticks, says_nothing, |ticks| fails(&kept, Some(&duration(ticks))));
    let duration = length.map(duration);
    run_arguments(case.file, *seed, &kept, duration.as_deref().or(whole))
}

/// The number of ticks from which on it fails, if the length matters.
fn first_failing(
    whole: Option<u64>,
    first_says_nothing: bool,
    mut fails: impl FnMut(u64) -> bool,
) -> Option<u64> {
    if fails(1) {
        return (!first_says_nothing).then_some(1);
    }
    let (mut passing, mut failing) = (1, whole.unwrap_or(2));
    while whole.is_none() && !fails(failing) {
        (passing, failing) = (failing, failing * 2);
        if failing > LONGEST {
            return None;
        }
    }
    while failing - passing > 1 {
        let middle = passing + (failing - passing) / 2;
        if fails(middle) { failing = middle } else { passing = middle }
    }
    Some(failing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_failing_tick_is_found() {
        for first in [2, 3, 417, 2000] {
            assert_eq!(first_failing(Some(2000), true, |ticks| ticks >= first), Some(first));
            assert_eq!(first_failing(None, false, |ticks| ticks >= first), Some(first));
        }
        assert_eq!(first_failing(Some(2000), true, |_| true), None, "too low from the start");
        assert_eq!(first_failing(Some(2000), false, |_| true), Some(1), "a crash in the first tick");
        assert_eq!(first_failing(None, false, |_| false), None);
    }
}
