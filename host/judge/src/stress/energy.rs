//! M4 and M5: whether the model generates energy.
//!
//! **M4, loop energy.** The hand takes the handle around random closed motions in all six dimensions. The
//! work of the model's force on the hand during a lap, relative to all work exchanged, is zero for a force that
//! comes from an energy; what is not zero can be pumped. The rectangle rule on a closed smooth motion
//! converges faster than any power of the step, so 1e-9 can be told from zero; what it leaves uncertain is
//! taken off.
//!
//! **`energy_j`** of a model that reports it is compared with that work, all along the lap: what is stored may not rise
//! by more than the hand puts in, and for a model without memory not by less either. One in a thousand of the energy
//! stored on the lap is tolerated: the trapezoidal rule between two samples, which are doubled until it is met.
//!
//! **M5, sampled energy.** A loop holds each force for a period, so even an honest spring gives back a little
//! more than it took: along a hand-driven motion from home, the passivity observer of a zero-order hold, `E_n
//! = E_(n-1) - f_(n-1) . (x_n - x_(n-1))` (Ryu, Kim and Hannaford, IEEE T-RA 20, 2004), ends every lap below
//! zero. The device damping that would dissipate that energy is the demand of the model on a device; Colgate and
//! Schenkel (1997) bound it by `K T / 2` for a spring, a model that pumps needs more.

use super::measure::{Measure, PoseRecord, Verdict};
use super::sweep::sweep;
use super::{DAMPINGS_NS_PER_M, LEVER_M, Setup};
use crate::sampling::Random;
use crate::subject::Subject;
use crate::tally::{Decades, Worst, tally};
use crate::trajectory::Trajectory;
use flotor_hal::abi::loader::LoadError;
use flotor_hal::{DVec3, Memory, Pose, Twist, rotation_vector};

const LOOPS: &str = "loop energy";
/// Relative work that counts as none.
pub(super) const CONSERVATIVE: f64 = 1.0e-9;
/// Samples of a lap: doubled until the work has settled, or there are [`MOST_SAMPLES`].
const FEWEST_SAMPLES: usize = 256;
/// See [`FEWEST_SAMPLES`].
const MOST_SAMPLES: usize = 16384;
/// Relative change between two numbers of samples that counts as settled.
const SETTLED: f64 = 1.0e-12;
/// Steps a lap may cross: a motion of three harmonics meets a plane six times, and there may be two of them.
const MOST_STEPS: f64 = 12.0;

/// Difference of stored energy and work, relative to the energy stored on a lap, that counts as none.
const SAME_ENERGY: f64 = 1.0e-3;
/// Energy too small to be compared, J.
const NO_ENERGY_J: f64 = 1.0e-9;

/// One sample of a lap.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    /// Power of the model on the hand, J per lap.
    power_j: f64,
    /// The most that force and torque could do on the way, J per lap.
    pub(super) most_j: f64,
    /// What it says it stores, J; not a number where it says nothing.
    stored_j: f64,
}

/// By how much the stored energy of a lap differs from the work, relative to what is stored on it. Zero where the model
/// says nothing of its energy.
fn mismatch(samples: &[Sample], memory: Memory) -> f64 {
    let (mut most_j, mut least_j) = (f64::NEG_INFINITY, f64::INFINITY);
    // Stored energy and the work that the hand got, together: constant, or falling where something dissipates.
    let (mut total_j, mut lowest_j, mut highest_j, mut risen_j) = (0.0, 0.0, 0.0, 0.0);
    for pair in samples.windows(2) {
        let [before, here] = pair else { continue };
        let work_j = 0.5 * (before.power_j + here.power_j) / samples.len() as f64;
        total_j += here.stored_j - before.stored_j + work_j;
        (lowest_j, highest_j) = (f64::min(lowest_j, total_j), f64::max(highest_j, total_j));
        risen_j = f64::max(risen_j, total_j - lowest_j);
        (most_j, least_j) = (most_j.max(here.stored_j), least_j.min(here.stored_j));
    }
    let stored_j = most_j - least_j;
    if samples.iter().any(|sample| sample.stored_j.is_nan()) || stored_j < NO_ENERGY_J {
        return 0.0;
    }
    match memory {
        Memory::Stateless => (highest_j - lowest_j) / stored_j,
        Memory::PathDependent => risen_j / stored_j,
    }
}

/// The work of one lap.
pub(super) struct Lap {
    /// Work on the hand, J.
    net_j: f64,
    /// All work exchanged, J.
    gross_j: f64,
    /// What the samples leave uncertain about the work on the hand, J.
    uncertain_j: f64,
    /// See [`mismatch`].
    mismatch: f64,
}

impl Lap {
    /// From the power at evenly spaced samples, J per lap.
    fn from_powers(powers: &[f64]) -> Self {
        let mean =
            |numbers: &mut dyn Iterator<Item = f64>, count: usize| numbers.sum::<f64>() / count.max(1) as f64;
        let net_j = mean(&mut powers.iter().copied(), powers.len());
        let gross_j = mean(&mut powers.iter().map(|power| power.abs()), powers.len());
        let every_other_j = mean(&mut powers.iter().step_by(2).copied(), powers.len() / 2);
        let change_j = (net_j - every_other_j).abs();
        if change_j <= SETTLED * gross_j {
            return Self { net_j, gross_j, uncertain_j: 0.0, mismatch: 0.0 };
        }
        // Not smooth. Each step between two samples puts the rule off by up to its height times the interval.
        let heights = powers.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let steps_j = MOST_STEPS * heights.fold(0.0, f64::max) / powers.len() as f64;
        Self { net_j, gross_j, uncertain_j: (2.0 * change_j).max(steps_j), mismatch: 0.0 }
    }

    pub(super) fn from_samples(samples: &[Sample], memory: Memory) -> Self {
        let powers: Vec<f64> = samples.iter().map(|sample| sample.power_j).collect();
        Self { mismatch: mismatch(samples, memory), ..Self::from_powers(&powers) }
    }

    /// What it made beyond what is uncertain, J. A model with memory may eat energy (friction), never give it; one without
    /// can be run backwards.
    pub(super) fn made_j(&self, memory: Memory) -> f64 {
        let made_j = match memory {
            Memory::Stateless => self.net_j.abs(),
            Memory::PathDependent => self.net_j,
        };
        (made_j - self.uncertain_j).max(0.0)
    }

    fn is_settled(&self) -> bool {
        self.uncertain_j == 0.0
    }
}

/// At a part of a lap, from 0 to 1.
fn sample(subject: &mut Subject<'_>, path: &Trajectory, part: f64) -> Option<Sample> {
    let (pose, motion_m, turn_rad) = path.at(part);
    let answer = subject.ask(pose).ok()?;
    let power_j = answer.wrench.force().dot(motion_m) + answer.wrench.torque().dot(turn_rad);
    let (force_n, torque_nm) = (answer.wrench.force(), answer.wrench.torque());
    let most_j = force_n.length() * motion_m.length() + torque_nm.length() * turn_rad.length();
    Some(Sample { power_j, most_j, stored_j: answer.energy_j })
}

/// Along a lap, at evenly spaced samples.
pub(super) fn samples(subject: &mut Subject<'_>, path: &Trajectory, samples: usize) -> Option<Vec<Sample>> {
    (0..samples).map(|index| sample(subject, path, index as f64 / samples as f64)).collect()
}

/// Twice as many samples of a lap: those that are known, and one between each and the next, in the order of the lap.
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
    if memory == Memory::PathDependent {
        // The first lap forgets where it came from, the second counts. Steps are short as they are.
        samples(subject, path, 4096)?;
        return Some(Lap::from_samples(&samples(subject, path, 4096)?, memory));
    }
    let mut samples = samples(subject, path, FEWEST_SAMPLES)?;
    loop {
        let lap = Lap::from_samples(&samples, memory);
        // The work of a smooth lap settles long before the trapezoidal rule between its samples does.
        let is_done = lap.is_settled() && lap.mismatch <= SAME_ENERGY;
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
        beyond: u64,
        rough: u64,
        worst: Worst,
        mismatch: Worst,
        most_j: f64,
        relative: Decades,
    }
}

/// Around closed motions; with the distribution of relative work for the picture.
pub(super) fn measure_loops(setup: &Setup<'_>) -> Result<(Measure, Decades), LoadError> {
    let total = sweep(setup, LOOPS, setup.share(20_000, 10), |subject, block| {
        let mut random = Random::new(setup.options.seed, block);
        let path = Trajectory::random(&mut random, setup.options.reach.sizes());
        let mut tally = LoopTally { laps: 1, ..LoopTally::default() };
        let Some(lap) = lap(subject, &path) else {
            tally.unanswered = 1;
            return tally;
        };
        let made_j = lap.made_j(subject.memory());
        let relative = if lap.gross_j > 0.0 { made_j / lap.gross_j } else { 0.0 };
        tally.relative.count(relative);
        tally.beyond = u64::from(relative > CONSERVATIVE);
        tally.rough = u64::from(!lap.is_settled());
        tally.most_j = made_j;
        tally.worst.offer(relative, path.pose(0.0));
        tally.mismatch.offer(lap.mismatch, path.pose(0.0));
        tally
    })?;
    Ok((judge_loops(&total), total.relative))
}

fn judge_loops(total: &LoopTally) -> Measure {
    let verdict = Verdict::of(total.worst.value, CONSERVATIVE, CONSERVATIVE);
    let comment = match verdict {
        Verdict::Fail => format!(
            "{} of {} loops generate energy, up to {:.3} mJ a lap; the worst starts at this pose",
            total.beyond,
            total.laps,
            total.most_j * 1.0e3
        ),
        _ if total.mismatch.value > SAME_ENERGY => format!(
            "`energy_j` differs from the work on a lap by {:.1e} of what is stored; it starts at this pose",
            total.mismatch.value
        ),
        _ => format!("{} loops", total.laps),
    };
    let differs = total.mismatch.value > SAME_ENERGY;
    let mut measure = Measure::of(["M4", LOOPS, ""], &total.worst, [CONSERVATIVE, CONSERVATIVE], comment)
        .count("loops", total.laps)
        .count("loops beyond the bound", total.beyond)
        .count("loops where the work does not settle", total.rough)
        .count("loops without answer", total.unanswered)
        .with("largest work of a lap", total.most_j, "J")
        .with("largest difference of energy and work, of what is stored", total.mismatch.value, "");
    if differs && verdict != Verdict::Fail {
        (measure.verdict, measure.pose) = (Verdict::Fail, total.mismatch.pose.map(PoseRecord::from));
    }
    measure.unless_unanswered(total.laps - total.unanswered)
}

const OBSERVER: &str = "sampled energy";
/// Periods of the loop, ns: 4, 2 and 1 kHz.
const PERIODS_NS: [u64; 3] = [250_000, 500_000, 1_000_000];
/// A lap of the hand takes a second; with three harmonics it moves at 1 to 3 Hz, as hands do.
const LAP_NS: u64 = 1_000_000_000;
/// Laps of a motion.
const LAPS: u64 = 2;

tally! {
    /// What the observer saw along a motion at one period.
    struct Seen {
        /// Most energy given to the hand since the start, J.
        given_j: f64,
        /// Damping that would have eaten up what whole laps gave away, N s/m, and where the observer was lowest.
        damping: Worst,
    }
}

tally! {
    struct Observed {
        seen: [Seen; PERIODS_NS.len()],
        motions: u64,
        unanswered: u64,
    }
}

/// Moves the handle along a motion and sums the energy of a zero-order hold.
///
/// The sum may be below zero during a lap: the model may return the energy stored at home. Only whole laps, which end
/// where they started, show the generated energy.
fn observe(subject: &mut Subject<'_>, path: &Trajectory, period_ns: u64) -> Option<Seen> {
    subject.restart();
    let period_s = period_ns as f64 * 1.0e-9;
    let ticks_per_lap = LAP_NS / period_ns;
    let pose_at = |tick: u64| path.pose((tick % ticks_per_lap) as f64 / ticks_per_lap as f64);
    let mut before = pose_at(0);
    let mut held = subject.advance(before, Twist::ZERO, 0).ok()?.wrench;
    let mut seen = Seen::default();
    let (mut taken_j, mut motion, mut lowest) = (0.0, 0.0, before);
    for tick in 1..=LAPS * ticks_per_lap {
        let here = pose_at(tick);
        let (shift_m, turn_rad) = moved(before, here);
        taken_j -= held.force().dot(shift_m) + held.torque().dot(turn_rad);
        motion += (shift_m.length_squared() + (turn_rad * LEVER_M).length_squared()) / period_s;
        if -taken_j > seen.given_j {
            (seen.given_j, lowest) = (-taken_j, here);
        }
        if tick.is_multiple_of(ticks_per_lap) {
            seen.damping.offer(-taken_j / motion, lowest);
        }
        let twist = Twist::new(shift_m / period_s, turn_rad / period_s);
        held = subject.advance(here, twist, period_ns).ok()?.wrench;
        before = here;
    }
    Some(seen)
}

fn moved(from: Pose, to: Pose) -> (DVec3, DVec3) {
    let turn = to.orientation() * from.orientation().conjugate();
    (to.position() - from.position(), rotation_vector(turn))
}

/// Along hand-driven motions from home, at three periods.
pub(super) fn measure_observer(setup: &Setup<'_>) -> Result<Measure, LoadError> {
    let total = sweep(setup, OBSERVER, setup.share(4_000, 4), |subject, block| {
        let mut random = Random::new(setup.options.seed, block);
        let path = Trajectory::random(&mut random, setup.options.reach.sizes()).starting_at_home();
        let mut observed = Observed::default();
        for (sum, period_ns) in observed.seen.iter_mut().zip(PERIODS_NS) {
            let seen = observe(subject, &path, period_ns);
            observed.motions += 1;
            observed.unanswered += u64::from(seen.is_none());
            *sum = seen.unwrap_or_default();
        }
        observed
    })?;
    Ok(judge_observer(&total))
}

fn judge_observer(total: &Observed) -> Measure {
    let [.., slowest] = &total.seen;
    let comment = "device damping that dissipates the energy generated by the zero-order hold, 1 kHz";
    let mut measure = Measure::of(["M5", OBSERVER, "N s/m"], &slowest.damping, DAMPINGS_NS_PER_M, comment);
    for (period_ns, seen) in PERIODS_NS.iter().zip(&total.seen) {
        let period_ms = *period_ns as f64 * 1.0e-6;
        measure = measure
            .with(format!("least observed energy, T = {period_ms} ms"), 0.0 - seen.given_j, "J")
            .with(format!("damping needed, T = {period_ms} ms"), seen.damping.value, "N s/m");
    }
    measure
        .count("motions", total.motions)
        .count("motions without answer", total.unanswered)
        .unless_unanswered(total.motions - total.unanswered)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_smooth_lap_is_settled_and_a_step_is_not_mistaken_for_work() {
        let powers =
            |f: &dyn Fn(f64) -> f64| -> Vec<f64> { (0..1024).map(|i| f(f64::from(i) / 1024.0)).collect() };
        let smooth = Lap::from_powers(&powers(&|part| (TAU * part).sin() * (1.0 + (TAU * part).cos())));
        assert!(smooth.is_settled() && smooth.net_j.abs() < 1.0e-15);
        // Plus one over part of the way, minus one over as much: no net work, but no grid hits both edges
        // alike.
        let steps = |part: f64| {
            f64::from((0.1234..0.3456).contains(&part)) - f64::from((0.5..0.7222).contains(&part))
        };
        let stepped = Lap::from_powers(&powers(&steps));
        assert!(!stepped.is_settled() && stepped.net_j.abs() <= stepped.uncertain_j, "{}", stepped.net_j);
    }
}
