//! What a call takes: along the path without interruption, call by call, and cold.

use super::PERIOD_NS;
use flotor_hal::abi::loader::Model;
use flotor_hal::{Demand, Input, Output, Pose};
use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;

/// Times of an evaluation with one demand, ns. Wall clock: compare within a run, not between machines.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Times {
    /// A tick of the path, mean of the fastest walk, nothing between the calls.
    pub mean_ns: f64,
    /// Median of single calls along the path, what the clock costs taken off.
    pub warm_median_ns: f64,
    /// One call in a thousand takes longer (interruptions of the machine included).
    pub warm_p999_ns: f64,
    /// Median of single calls after a reset, each at another pose.
    pub cold_median_ns: f64,
    /// One of those in a thousand takes longer.
    pub cold_p999_ns: f64,
}

/// Cold calls are far apart on the path: a stride that shares no factor with any length used.
const COLD_STRIDE: usize = 617;

/// Times a model along a path.
pub(super) fn time(model: &mut Model, path: &[Pose], demand: Demand, rounds: usize) -> Times {
    let inputs: Vec<Input> = (0..)
        .zip(path)
        .map(|(tick, pose)| Input {
            time_ns: tick * PERIOD_NS,
            dt_ns: PERIOD_NS,
            tick,
            demand,
            ..Input::at_rest(*pose)
        })
        .collect();
    let overhead_ns = overhead_ns();
    let mut output = Output::default();
    let mut mean_ns = f64::INFINITY;
    let (mut warm, mut cold) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        model.reset();
        let begin = Instant::now();
        for input in &inputs {
            model.step(black_box(input), &mut output);
            black_box(&output);
        }
        #[allow(clippy::cast_precision_loss)] // nanoseconds of seconds
        let walk_ns = begin.elapsed().as_nanos() as f64 / inputs.len().max(1) as f64;
        mean_ns = mean_ns.min(walk_ns);

        model.reset();
        for input in &inputs {
            warm.push(net_ns(overhead_ns, || {
                model.step(black_box(input), &mut output);
            }));
        }
        for number in 0..inputs.len().div_ceil(8) {
            let Some(input) = inputs.get(number * COLD_STRIDE % inputs.len()) else { break };
            model.reset();
            cold.push(net_ns(overhead_ns, || {
                model.step(black_box(input), &mut output);
            }));
        }
    }
    Times {
        mean_ns,
        warm_median_ns: quantile(&mut warm, 0.5),
        warm_p999_ns: quantile(&mut warm, 0.999),
        cold_median_ns: quantile(&mut cold, 0.5),
        cold_p999_ns: quantile(&mut cold, 0.999),
    }
}

#[allow(clippy::cast_precision_loss)] // nanoseconds of seconds
fn net_ns(overhead_ns: f64, call: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    call();
    (begin.elapsed().as_nanos() as f64 - overhead_ns).max(0.0)
}

/// What reading the clock twice costs: the median of many.
fn overhead_ns() -> f64 {
    let mut samples: Vec<f64> = (0..1001).map(|_| net_ns(0.0, || {})).collect();
    quantile(&mut samples, 0.5)
}

/// The value a part of the samples lies below; NaN of nothing.
fn quantile(samples: &mut [f64], part: f64) -> f64 {
    samples.sort_by(f64::total_cmp);
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let index = (samples.len() as f64 * part) as usize;
    samples.get(index.min(samples.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}
