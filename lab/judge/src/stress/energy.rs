//! M4: energy that the model generates on closed paths.
//!
//! **Loop energy.** The hand moves the handle around random closed paths in all six dimensions. The work of the model's
//! force on the hand during a lap, relative to all work exchanged, is zero for a force that has a potential; any other
//! energy can be pumped. The rectangle rule on a closed smooth path converges faster than any power of the step, so
//! 1e-9 can be distinguished from zero; where the power has kinks [`quadrature`](super::quadrature) replaces it. The
//! uncertainty is subtracted, and a lap whose uncertainty exceeds the bound is not resolved.
//!
//! Every path is traversed twice: at rest in each of its poses, where the work of a stateless model is zero, and in
//! [motion](super::motion), with its velocity, where damping and friction may dissipate energy but nothing may generate it.
//!
//! **`energy_j`** of a model that reports it is compared with that work, all along the lap: the stored energy may not
//! rise by more than the hand's input, and for a stateless model not by less either. A difference of 0.1 % of the
//! energy stored on the lap is tolerated; until it is met, the number of samples for the trapezoidal rule is doubled,
//! up to [`MOST_SAMPLES`].

use super::Setup;
use super::lap::{CONSERVATIVE, Dissipation, Lap, Sample};
use super::measure::{Measure, NO_ANSWER, PoseRecord, Verdict};
use super::motion::Motion;
use super::sweep::sweep;
use crate::sampling::Random;
use crate::subject::Subject;
use crate::tally::{Decades, Worst, tally};
use crate::trajectory::Trajectory;
use flotor_hal::{Memory, Pose};
use flotor_loader::LoadError;

const LOOPS: &str = "loop energy";
/// Initial number of samples of a lap: doubled until the work has converged, up to [`MOST_SAMPLES`].
const FEWEST_SAMPLES: usize = 256;
/// See [`FEWEST_SAMPLES`].
const MOST_SAMPLES: usize = 16384;
/// Number of samples at which the work of a smooth lap has converged.
const SMOOTH_SAMPLES: usize = 1024;
/// Number of samples of a lap in motion.
const MOVING_SAMPLES: usize = 1024;

/// Tolerated difference of stored energy and work, relative to the energy stored on a lap.
const SAME_ENERGY: f64 = 1.0e-3;

/// Samples power and stored energy at a fraction of a lap, from 0 to 1; `None` if the model gives no answer.
fn sample(subject: &mut Subject<'_>, path: &Trajectory, part: f64) -> Option<Sample> {
    let (pose, motion_m, turn_rad) = path.at(part);
    let answer = subject.answer_at(pose).ok()?;
    let power_j = answer.wrench.force().dot(motion_m) + answer.wrench.torque().dot(turn_rad);
    let (force_n, torque_nm) = (answer.wrench.force(), answer.wrench.torque());
    let most_j = force_n.length() * motion_m.length() + torque_nm.length() * turn_rad.length();
    Some(Sample { power_j, most_j, stored_j: answer.energy_j })
}

/// Samples a lap at evenly spaced points.
pub(super) fn samples(subject: &mut Subject<'_>, path: &Trajectory, samples: usize) -> Option<Vec<Sample>> {
    (0..samples).map(|index| sample(subject, path, index as f64 / samples as f64)).collect()
}

/// Doubles the samples of a lap: inserts one between each known one and the next, in the order of the lap.
fn doubled(subject: &mut Subject<'_>, path: &Trajectory, known: &[Sample]) -> Option<Vec<Sample>> {
    let count = 2 * known.len();
    let mut samples = Vec::with_capacity(count);
    for (index, known) in known.iter().enumerate() {
        samples.push(*known);
        samples.push(sample(subject, path, (2 * index + 1) as f64 / count as f64)?);
    }
    Some(samples)
}

fn lap(subject: &mut Subject<'_>, path: &Trajectory) -> Option<Lap> {
    let memory = subject.memory();
    let even = match memory {
        Memory::PathDependent => {
            // The first lap establishes the history, the second counts. The steps are short enough as they are.
            samples(subject, path, 4096)?;
            Lap::from_samples(&samples(subject, path, 4096)?, memory)
        }
        Memory::Stateless => sampled_as_needed(subject, path)?,
    };
    even.or_resolved(Dissipation::at_rest(memory), |parts| {
        parts.iter().map(|part| Some(sample(subject, path, *part)?.power_j)).collect()
    })
}

/// Samples a lap of a stateless model until its work has converged and its stored energy can be compared.
fn sampled_as_needed(subject: &mut Subject<'_>, path: &Trajectory) -> Option<Lap> {
    let mut samples = samples(subject, path, FEWEST_SAMPLES)?;
    loop {
        let lap = Lap::from_samples(&samples, Memory::Stateless);
        // The work of a smooth lap converges long before the trapezoidal rule does; that of any other lap never does.
        let is_done = (lap.is_settled() || samples.len() >= SMOOTH_SAMPLES) && lap.mismatch <= SAME_ENERGY;
        if is_done || samples.len() >= MOST_SAMPLES {
            return Some(lap);
        }
        samples = doubled(subject, path, &samples)?;
    }
}

tally! {
    struct LoopTally {
        laps: u64,
        unanswered: u64,
        /// Number of laps on which work was exchanged, and number of those whose net work is known to within the bound.
        comparable: u64,
        resolved: u64,
        beyond: u64,
        rough: u64,
        worst: Worst,
        mismatch: Worst,
        most_j: f64,
        relative: Decades,
    }
}

impl LoopTally {
    fn take(&mut self, lap: Option<Lap>, dissipation: Dissipation, start: Pose) {
        self.laps += 1;
        let Some(lap) = lap else {
            self.unanswered += 1;
            return;
        };
        self.mismatch.offer(lap.mismatch, start);
        self.rough += u64::from(!lap.is_settled());
        if lap.gross_j <= 0.0 {
            return;
        }
        let made_j = lap.made_j(dissipation);
        let relative = made_j / lap.gross_j;
        self.comparable += 1;
        self.resolved += u64::from(lap.is_resolved(dissipation));
        self.relative.count(relative);
        self.beyond += u64::from(relative > CONSERVATIVE);
        self.most_j = self.most_j.max(made_j);
        self.worst.offer(relative, start);
    }
}

/// Measures closed paths; returns also the distribution of relative work for the picture.
pub(super) fn measure_loops(setup: &Setup<'_>) -> Result<(Measure, Decades), LoadError> {
    let total = sweep(setup, LOOPS, setup.share(20_000, 10), |subject, block| {
        let mut random = Random::new(setup.options.seed, block);
        let path = Trajectory::random(&mut random, setup.options.reach.sizes());
        let (start, mut tally) = (path.pose(0.0), LoopTally::default());
        let at_rest = lap(subject, &path);
        tally.take(at_rest, Dissipation::at_rest(subject.memory()), start);
        let motion = Motion::random(path, &mut random);
        tally.take(motion.lap(subject, MOVING_SAMPLES), Dissipation::Allowed, start);
        tally
    })?;
    Ok((judge_loops(&total), total.relative))
}

fn judge_loops(total: &LoopTally) -> Measure {
    let verdict = Verdict::of(total.worst.value, CONSERVATIVE, CONSERVATIVE);
    let known = match total.comparable - total.resolved {
        0 => format!("{} laps, all resolved to the bound", total.laps),
        unknown => format!("{unknown} of {} laps are not resolved to the bound", total.laps),
    };
    let comment = match verdict {
        Verdict::Fail => format!(
            "{} of {} laps generate energy, up to {:.3} mJ a lap; the worst starts at this pose",
            total.beyond,
            total.laps,
            total.most_j * 1.0e3
        ),
        _ if total.mismatch.value > SAME_ENERGY => format!(
            "`energy_j` differs from the work on a lap by {:.1e} of the stored energy; the lap starts at this pose",
            total.mismatch.value
        ),
        _ => known.clone(),
    };
    let differs = total.mismatch.value > SAME_ENERGY;
    let mut measure = Measure::of(["M4", LOOPS, ""], &total.worst, [CONSERVATIVE, CONSERVATIVE], comment)
        .count("laps", total.laps)
        .count("laps beyond the bound", total.beyond)
        .count("laps where work is exchanged", total.comparable)
        .count("laps known to the bound", total.resolved)
        .count("laps where the work does not settle", total.rough)
        .count("laps without answer", total.unanswered)
        .with("largest work of a lap", total.most_j, "J")
        .with("largest difference of energy and work, of what is stored", total.mismatch.value, "");
    if differs && verdict != Verdict::Fail {
        (measure.verdict, measure.pose) = (Verdict::Fail, total.mismatch.pose.map(PoseRecord::from));
    }
    let possible = if total.resolved == total.comparable { total.worst.value } else { f64::INFINITY };
    let why = if total.unanswered == total.laps { NO_ANSWER } else { "no lap exchanges work with the hand" };
    measure.unless_uncertain(possible, || known).unless_empty(total.comparable, why)
}
