//! Call times split by a detail of the answer: a model that solves for some poses and evaluates a formula for the
//! others has two speeds, and a mean of both describes neither.

use super::times::{call_ns, inputs};
use flotor_core::quantile;
use flotor_hal::{Demand, Pose};
use flotor_judge::call_timer::overhead_ns;
use flotor_loader::Model;
use serde::Serialize;

/// Times of the calls with a detail above zero, and of the other calls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SplitTimes {
    /// Fraction of the ticks with the detail above zero, 0 to 1.
    pub share: f64,
    /// Times of the ticks with the detail above zero; `None` if there are no such ticks.
    pub above: Option<Speed>,
    /// Times of the other ticks; `None` if there are no other ticks.
    pub others: Option<Speed>,
}

/// Duration of calls, ns; the fastest repetition of every tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Speed {
    /// Mean duration, ns.
    pub mean_ns: f64,
    /// 99th percentile, ns.
    pub p99_ns: f64,
}

/// Measures the duration of calls along a path, with force and torque demanded, split by the sign of a detail; `None` for a model
/// without this detail.
pub(super) fn split_times(
    model: &mut Model,
    detail: &str,
    path: &[Pose],
    rounds: usize,
) -> Option<SplitTimes> {
    let index = model.details().iter().position(|known| known.id() == detail)?;
    let mut details = vec![f64::NAN; model.details().len()];
    let inputs = inputs(path, Demand::WRENCH.limited_to(model.serves()));
    let mut ticks = vec![(f64::INFINITY, false); inputs.len()];
    let overhead_ns = overhead_ns();
    for _ in 0..rounds {
        model.reset();
        for (input, (fastest_ns, is_above)) in inputs.iter().zip(&mut ticks) {
            *fastest_ns = call_ns(overhead_ns, model, input).min(*fastest_ns);
            model.read_details(&mut details);
            *is_above = details.get(index).is_some_and(|value| *value > 0.0);
        }
    }
    let of = |kind: bool| {
        let times_ns = ticks.iter().filter(|(_, is_above)| *is_above == kind).map(|(ns, _)| *ns);
        Speed::of(&mut times_ns.collect::<Vec<_>>())
    };
    let share = ticks.iter().filter(|(_, is_above)| *is_above).count() as f64 / ticks.len().max(1) as f64;
    Some(SplitTimes { share, above: of(true), others: of(false) })
}

impl Speed {
    fn of(times_ns: &mut [f64]) -> Option<Self> {
        let mean_ns = times_ns.iter().sum::<f64>() / times_ns.len() as f64;
        (!times_ns.is_empty()).then(|| Self { mean_ns, p99_ns: quantile(times_ns, 0.99) })
    }
}
