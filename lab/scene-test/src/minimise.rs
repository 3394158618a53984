//! Search for the shortest run with the same failure.

use crate::case::{Case, Check};
use crate::process::Flotor;
use crate::run::{Failure, run, run_arguments};
use serde_json::Value;

/// Longest run in the search for a crash, ticks: a crashed run has no summary with its length.
const LONGEST: u64 = 1 << 20;

/// Shortest run that has the failure of a case.
pub(crate) struct ShortestRun {
    /// Arguments of the command.
    pub(crate) arguments: Vec<String>,
    /// Length of the run; the last tick fails.
    pub(crate) ticks: u64,
}

/// Returns the shortest run of a case, with its settings, that has the same fault: the run crashed or
/// ended early, or the health of a plugin is not as expected. `None` for a failed number, which depends on the whole
/// run, and for a run that timed out, which is not repeated.
pub(crate) fn shortest(
    flotor: &Flotor,
    case: &Case<'_>,
    failure: &Failure,
    json: Option<&Value>,
) -> Option<ShortestRun> {
    let Check::Run { seed, set } = &case.check else { return None };
    if !is_fault(failure) {
        return None;
    }
    let fails = |duration: &str| {
        let judged = run(flotor, case, *seed, set, Some(duration));
        judged.failures.iter().any(|other| {
            // A shorter run may stop early for another reason.
            let is_same_word = other.what != "end" || other.got == failure.got;
            is_same_word && (&other.what, &other.expected) == (&failure.what, &failure.expected)
        })
    };
    let number = |key: &str| json.and_then(|json| json.get(key)).and_then(Value::as_f64);
    let rate_hz = number("rate_hz").unwrap_or(1000.0);
    let duration = |ticks: u64| format!("{}s", ticks as f64 / rate_hz);
    let ticks = json.and_then(|json| json.get("ticks")).and_then(Value::as_u64);
    let ticks = first_failing(ticks, |ticks| fails(&duration(ticks)))?;
    Some(ShortestRun { arguments: run_arguments(case.file, *seed, set, Some(&duration(ticks))), ticks })
}

/// Returns true if a failure appears at some instant, and is not a number of the whole run.
fn is_fault(failure: &Failure) -> bool {
    let is_of_the_run = failure.what == "the run" && failure.expected != "an end";
    let ended_early = failure.what == "end" && failure.got != "finished";
    is_of_the_run || ended_early || failure.what.starts_with("plugins.") && failure.what.ends_with(".health")
}

/// Returns the smallest number of ticks that fails, by bisection below `whole` or, without it, by doubling up to
/// [`LONGEST`].
fn first_failing(whole: Option<u64>, mut fails: impl FnMut(u64) -> bool) -> Option<u64> {
    if fails(1) {
        return Some(1);
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
            assert_eq!(first_failing(Some(2000), |ticks| ticks >= first), Some(first));
            assert_eq!(first_failing(None, |ticks| ticks >= first), Some(first));
        }
        assert_eq!(first_failing(Some(2000), |_| true), Some(1), "a crash in the first tick");
        assert_eq!(first_failing(None, |_| false), None);
    }
}
