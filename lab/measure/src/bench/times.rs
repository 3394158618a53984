//! Duration of a call: continuously along the path, in a batch, call by call, and cold.
//!
//! A shared machine disturbs measurements. So the cases take turns: in each round, all cases run the first slice of the path one
//! after the other, then the next slice, to the end of the path. A disturbance of one slice affects its neighbours too, and
//! quotients of neighbouring slices are those of a quiet machine.

use flotor_core::quantile;
use flotor_hal::{Demand, Input, Memory, Output, Pose};
use flotor_judge::call_timer::{net_ns, overhead_ns};
use flotor_judge::subject::input_of;
use flotor_loader::Model;
use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;

/// Times of an evaluation with one demand, ns. Wall clock: compare within a run, not between machines.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Times {
    /// Mean of a tick of the path, with nothing between the calls; fastest repetition of every slice.
    pub mean_ns: f64,
    /// Ratio of the time of a slice to the time of the baseline's slice in the same turn: median of all turns.
    pub of_yardstick: f64,
    /// Mean of a pose in a batch, from the fastest repetitions; `None` for a model with memory.
    pub batch_ns: Option<f64>,
    /// Speed-up of a batch over tick by tick: median of all turns; `None` for a model with memory.
    pub batch_gain: Option<f64>,
    /// Median of single calls along the path, less the overhead of the clock.
    pub warm_median_ns: f64,
    /// 99.9th percentile of single calls (interruptions of the machine included).
    pub warm_p999_ns: f64,
    /// Median of single calls after a reset, each at another pose and after a call of every other case.
    pub cold_median_ns: f64,
    /// 99.9th percentile of calls after a reset.
    pub cold_p999_ns: f64,
}

/// Number of ticks of a turn, and of those not timed: they bring the model back into the caches.
const SLICE_TICKS: usize = 100;
const UNTIMED_TICKS: usize = 20;

/// Stride of cold calls along the path, coprime to every path length in use.
const COLD_STRIDE: usize = 617;

/// Measured durations of a case. Slices in the order of their turns, all rounds in sequence.
#[derive(Clone, Default)]
struct Clocked {
    walks_ns: Vec<f64>,
    batches_ns: Vec<f64>,
    warm_ns: Vec<f64>,
    cold_ns: Vec<f64>,
}

/// Times models along a path, all of them in turns. `done` is called after every round.
pub(super) fn in_turns(
    models: &mut [Model],
    baseline: usize,
    path: &[Pose],
    demand: Demand,
    rounds: usize,
    done: impl Fn(),
) -> Vec<Times> {
    let mut cases: Vec<_> = models
        .iter_mut()
        .map(|model| (inputs(path, demand.limited_to(model.serves())), model, Clocked::default()))
        .collect();
    let overhead_ns = overhead_ns();
    let mut outputs = [Output::default(); SLICE_TICKS];
    for _ in 0..rounds {
        cases.iter_mut().for_each(|(_, model, _)| _ = model.reset());
        for start in (0..path.len()).step_by(SLICE_TICKS) {
            for (inputs, model, clocked) in &mut cases {
                let slice = &inputs[start..inputs.len().min(start + SLICE_TICKS)];
                let (untimed, timed) = slice.split_at(UNTIMED_TICKS.min(slice.len() / 2));
                walk(model, untimed, &mut outputs);
                clocked.walks_ns.push(per_pose_ns(timed, |timed| walk(model, timed, &mut outputs)));
                if model.memory() == Memory::Stateless {
                    batch(model, untimed, &mut outputs);
                    clocked.batches_ns.push(per_pose_ns(timed, |timed| batch(model, timed, &mut outputs)));
                }
            }
        }
        cases.iter_mut().for_each(|(_, model, _)| _ = model.reset());
        for start in (0..path.len()).step_by(SLICE_TICKS) {
            for (inputs, model, clocked) in &mut cases {
                for input in &inputs[start..inputs.len().min(start + SLICE_TICKS)] {
                    clocked.warm_ns.push(call_ns(overhead_ns, model, input));
                }
            }
        }
        for number in 0..path.len().div_ceil(8) {
            for (inputs, model, clocked) in &mut cases {
                model.reset();
                let input = &inputs[number * COLD_STRIDE % inputs.len()];
                clocked.cold_ns.push(call_ns(overhead_ns, model, input));
            }
        }
        done();
    }
    let slices = path.len().div_ceil(SLICE_TICKS);
    let baseline_ns = cases.get(baseline).map_or_else(Vec::new, |(_, _, clocked)| clocked.walks_ns.clone());
    cases.into_iter().map(|(_, _, clocked)| clocked.times(slices, &baseline_ns)).collect()
}

impl Clocked {
    fn times(mut self, slices: usize, baseline_ns: &[f64]) -> Times {
        let has_batches = !self.batches_ns.is_empty();
        Times {
            mean_ns: mean_of_fastest(&self.walks_ns, slices),
            of_yardstick: median_quotient(&self.walks_ns, baseline_ns),
            batch_ns: has_batches.then(|| mean_of_fastest(&self.batches_ns, slices)),
            batch_gain: has_batches.then(|| median_quotient(&self.walks_ns, &self.batches_ns)),
            warm_median_ns: quantile(&mut self.warm_ns, 0.5),
            warm_p999_ns: quantile(&mut self.warm_ns, 0.999),
            cold_median_ns: quantile(&mut self.cold_ns, 0.5),
            cold_p999_ns: quantile(&mut self.cold_ns, 0.999),
        }
    }
}

/// Returns the inputs of consecutive ticks.
pub(super) fn inputs(path: &[Pose], demand: Demand) -> Vec<Input> {
    (0..).zip(path).map(|(tick, pose)| Input { demand, ..input_of(tick, *pose) }).collect()
}

fn walk(model: &mut Model, inputs: &[Input], outputs: &mut [Output]) {
    for (input, output) in inputs.iter().zip(&mut *outputs) {
        model.step(input, output);
    }
    black_box(outputs);
}

fn batch(model: &mut Model, inputs: &[Input], outputs: &mut [Output]) {
    model.step_batch(inputs, outputs);
    black_box(outputs);
}

fn per_pose_ns(inputs: &[Input], work: impl FnOnce(&[Input])) -> f64 {
    let begin = Instant::now();
    work(black_box(inputs));
    begin.elapsed().as_nanos() as f64 / inputs.len().max(1) as f64
}

/// Times one call, ns, less the overhead of the clock.
pub(super) fn call_ns(overhead_ns: f64, model: &mut Model, input: &Input) -> f64 {
    let mut output = Output::default();
    let begin = Instant::now();
    model.step(black_box(input), &mut output);
    let call_ns = net_ns(overhead_ns, begin);
    black_box(&output);
    call_ns
}

/// Returns the mean over the slices of a round, each from the round in which it was fastest.
fn mean_of_fastest(times_ns: &[f64], slices: usize) -> f64 {
    let fastest = |slice: usize| {
        times_ns.iter().skip(slice).step_by(slices.max(1)).copied().fold(f64::INFINITY, f64::min)
    };
    let count = slices as f64;
    (0..slices).map(fastest).sum::<f64>() / count
}

/// Returns the median of the quotients of corresponding numbers; NaN without numbers.
fn median_quotient(numbers: &[f64], by: &[f64]) -> f64 {
    let mut quotients: Vec<f64> = numbers.iter().zip(by).map(|(number, by)| number / by).collect();
    quantile(&mut quotients, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disturbed_round_does_not_count() {
        // Two slices, three rounds; the second round was disturbed throughout, the third in its last slice.
        let (alone, other) = ([1.0, 3.0, 9.0, 27.0, 2.0, 9.0], [2.0, 6.0, 18.0, 54.0, 4.0, 18.0]);
        assert_eq!(mean_of_fastest(&alone, 2), 2.0);
        assert_eq!(median_quotient(&other, &alone), 2.0);
        assert!(median_quotient(&[], &[]).is_nan());
    }
}
