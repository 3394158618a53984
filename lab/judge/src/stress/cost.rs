//! M7, cost: duration of a call, and its slowest pose.
//!
//! One thread makes one call at a time, at cold and warm poses of the whole workspace and of the manifolds; a model
//! with memory is walked there from home, tick by tick. A shared machine interrupts: some calls in a hundred thousand
//! take milliseconds for reasons outside the model. So every call is timed three times and the shortest counts against
//! the bound, while percentiles and the maximum are reported as measured. A pose whose shortest time is above the bound
//! is timed up to ten times more: an interruption does not recur, a slow call does. Allocations of a call are not
//! visible from outside the plugin; the plugin's own tests have to check them.

use super::measure::{Measure, NO_ANSWER};
use super::poses::mixed;
use super::{Setup, WIDER};
use crate::call_timer::{net_ns, overhead_ns};
use crate::sampling::{Random, Sobol};
use crate::subject::Subject;
use crate::tally::{Decades, Worst};
use crate::watch::enter_call;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Memory, Output, Pose};
use flotor_loader::LoadError;
use hdrhistogram::Histogram;
use std::time::Instant;

const NAME: &str = "cost of a call";
/// Tenth of a 1 kHz tick, ns: threshold of a late call in `flotor run`, which leaves room for everything else in a tick.
const TENTH_OF_A_TICK_NS: f64 = 100_000.0;
/// Number of timings of each pose.
const REPEATS: usize = 3;
/// Number of further timings of a pose above the bound, and of such poses: a model that is slow everywhere shows early.
const REPEATS_ABOVE: usize = 10;
const POSES_ABOVE: u32 = 100;
/// Poses between two updates of the progress line.
const CHUNK: u64 = 1024;

/// Times calls; returns the measure and the distribution of the times for the picture, ns.
pub(super) fn measure(setup: &Setup<'_>) -> Result<(Measure, Decades), LoadError> {
    let chunks = setup.share(4_000_000, 0).div_ceil(CHUNK);
    setup.progress.begin(NAME, chunks);
    let mut subject = setup.subject()?;
    let mut stopwatch = Stopwatch::new();
    let sobol = Sobol::new(setup.options.seed);
    let mut random = Random::new(setup.options.seed, 0);
    let reach = setup.options.reach.scaled(WIDER);
    for chunk in 0..chunks {
        for index in chunk * CHUNK..(chunk + 1) * CHUNK {
            stopwatch.time(&mut subject, mixed(reach, &sobol, &mut random, index));
        }
        setup.progress.advance(1);
    }
    Ok((stopwatch.judge(), stopwatch.spread))
}

struct Stopwatch {
    overhead_ns: f64,
    calls: Histogram<u64>,
    spread: Decades,
    /// Longest of the shortest times, with its pose.
    slowest: Worst,
    /// Remaining poses above the bound that may be timed again.
    poses_above_left: u32,
}

impl Stopwatch {
    fn new() -> Self {
        // Constants that satisfy the constructor's conditions (low >= 1, high >= 2 low, digits <= 5).
        let calls = Histogram::new_with_bounds(1, 100_000_000_000, 3);
        Self {
            overhead_ns: overhead_ns(),
            calls: calls.unwrap_or_else(|_| unreachable!("constant, legal bounds")),
            spread: Decades::default(),
            slowest: Worst::default(),
            poses_above_left: POSES_ABOVE,
        }
    }

    /// Times every call on the way to a pose, several times over.
    fn time(&mut self, subject: &mut Subject<'_>, pose: Pose) {
        let mut shortest_ns: Vec<f64> = Vec::new();
        for repeat in 0..REPEATS + REPEATS_ABOVE {
            let is_above = shortest_ns.iter().any(|call_ns| *call_ns > TENTH_OF_A_TICK_NS);
            if repeat >= REPEATS && (!is_above || self.poses_above_left == 0) {
                break;
            }
            let Some(calls_ns) = self.once(subject, pose) else { return };
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at least 1 ns; saturates
            calls_ns.iter().for_each(|call_ns| self.calls.saturating_record(*call_ns as u64));
            if shortest_ns.is_empty() {
                shortest_ns = calls_ns;
            } else {
                for (shortest, call) in shortest_ns.iter_mut().zip(calls_ns) {
                    *shortest = call.min(*shortest);
                }
            }
        }
        if shortest_ns.iter().any(|call_ns| *call_ns > TENTH_OF_A_TICK_NS) {
            self.poses_above_left = self.poses_above_left.saturating_sub(1);
        }
        for call_ns in shortest_ns {
            self.spread.count(call_ns);
            self.slowest.offer(call_ns, pose);
        }
    }

    /// Times one call of a stateless model, or the ticks of a walk from home. Returns `None` if the model panics,
    /// because the cost of a panic is not that of a call.
    fn once(&self, subject: &mut Subject<'_>, pose: Pose) -> Option<Vec<f64>> {
        let net_ns = |begin| net_ns(self.overhead_ns, begin).max(1.0);
        if subject.memory() == Memory::PathDependent {
            subject.restart();
            let mut calls_ns = Vec::new();
            let mut begin = Instant::now();
            let arrival = subject.walk(pose, &mut || {
                calls_ns.push(net_ns(begin));
                begin = Instant::now();
            });
            return arrival.is_ok().then_some(calls_ns);
        }
        let input = subject.at_rest(pose);
        let mut output = Output::default();
        let _call = enter_call(&[input]);
        let begin = Instant::now();
        let call = subject.model().step(std::hint::black_box(&input), std::hint::black_box(&mut output));
        let call_ns = net_ns(begin);
        if call == CallStatus::Panicked {
            subject.restart();
            return None;
        }
        Some(vec![call_ns])
    }

    fn judge(&self) -> Measure {
        let comment = "shortest of three at the slowest pose, of up to 13 where above the bound";
        Measure::of(["M7", NAME, "ns"], &self.slowest, [TENTH_OF_A_TICK_NS; 2], comment)
            .with("p50", self.calls.value_at_quantile(0.5) as f64, "ns")
            .with("p99.9", self.calls.value_at_quantile(0.999) as f64, "ns")
            .with("p99.999", self.calls.value_at_quantile(0.99999) as f64, "ns")
            .with("max, interruptions included", self.calls.max() as f64, "ns")
            .count("calls", self.calls.len())
            .with("clock, taken off", self.overhead_ns, "ns")
            .unless_empty(self.calls.len(), NO_ANSWER)
    }
}
