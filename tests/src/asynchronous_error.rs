//! Error of an asynchronous membrane: forces of its contact against forces of the membrane itself, at the poses of one run.

use crate::watched::watch;
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::abi::CallStatus;
use flotor_hal::{DVec3, Demand, Input, LoopConfig, Output};
use flotor_loader::Plugin;

/// Result of a run with an asynchronous membrane, and of the membrane itself stepped at each tick (`direct`).
#[derive(Clone, Debug)]
pub struct AsynchronousError {
    /// Records of the run, one per tick.
    pub records: Vec<TickRecord>,
    /// Force of the membrane itself at each tick, at the poses of the run, N.
    pub direct_n: Vec<DVec3>,
    /// Largest force of the membrane itself, N.
    pub peak_n: f64,
    /// Largest change of the contact's force from one tick to the next, N.
    pub largest_step_n: f64,
    /// Largest change of the membrane's own force from one tick to the next, N.
    pub direct_step_n: f64,
    /// Largest change of the membrane's own force over one period of the model, N: the step of a zero-order hold.
    pub held_step_n: f64,
    /// Root mean square difference between the membrane and a zero-order hold of the membrane's force that is one period late, N.
    pub held_rms_n: f64,
    /// Number of ticks in which the slew limit acted.
    pub slewed_ticks: usize,
    /// Root mean square difference between contact and membrane, N.
    pub rms_n: f64,
    /// Largest difference between contact and membrane, N.
    pub worst_n: f64,
    /// Delay of the contact against the membrane, s: the delay with the smallest difference.
    pub delay_s: f64,
    /// Root mean square difference between contact and membrane after compensation of the delay in whole ticks, N.
    pub rms_delayed_n: f64,
}

/// Oscillation of the hand in the scene of [`asynchronous_error`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude, half the distance from lowest to highest, mm.
    pub amplitude_mm: f64,
}

/// Bound of the search for the delay, ticks.
const LONGEST_DELAY: usize = 40;

/// Runs a membrane asynchronously at `rate_hz` with a loop at 1 kHz on the virtual clock and a slew limit; the hand oscillates
/// into the membrane and out of it. Returns the run, compared with the membrane itself.
///
/// # Panics
/// If the plugins are not built, or the run fails.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand ticks
pub fn asynchronous_error(
    rate_hz: f64,
    swing: Swing,
    slew_n_per_s: f64,
    duration_s: f64,
) -> AsynchronousError {
    let Swing { frequency_hz, amplitude_mm } = swing;
    let run = watch(&format!(
        "duration_s = {duration_s}\n[limits]\nforce_slew_n_per_s = {slew_n_per_s}\n\
         [device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"oscillate\"\nhand_centre_mm = -1\n\
         hand_amplitude_mm = {amplitude_mm}\nhand_frequency_hz = {frequency_hz}\n\
         [[model]]\nplugin = \"membrane\"\n[model.field]\nrate_hz = {rate_hz}\n"
    ));
    let records = run.records;
    let direct_n = direct(&records);
    let contact_n: Vec<DVec3> = records.iter().map(|record| record.model.force()).collect();
    let held = ((1000.0 / rate_hz).round() as usize).max(1);
    let steps = |forces: &[DVec3], apart: usize| {
        let apart = forces.iter().zip(forces.iter().skip(apart));
        apart.map(|(a, b)| (*b - *a).length()).fold(0.0, f64::max)
    };
    // In the first two periods of the model there is no contact.
    let begun = 2 * held;
    let difference = |delay: usize| {
        let pairs = contact_n.iter().skip(begun + delay).zip(direct_n.iter().skip(begun));
        pairs.map(|(contact, direct)| (*contact - *direct).length())
    };
    let rms = |delay: usize| {
        let (sum, count) = difference(delay).fold((0.0, 0.0), |(sum, count), e| (sum + e * e, count + 1.0));
        (sum / count).sqrt()
    };
    // A force requested at one update is available a period later, and then held for a period.
    let held_back = (begun..direct_n.len()).map(|tick| direct_n[tick] - direct_n[(tick / held - 1) * held]);
    let (held_sum, held_count) =
        held_back.fold((0.0, 0.0), |(sum, count), off| (sum + off.length_squared(), count + 1.0));
    let rms_of: Vec<f64> = (0..LONGEST_DELAY).map(rms).collect();
    let best = (0..LONGEST_DELAY).min_by(|a, b| rms_of[*a].total_cmp(&rms_of[*b])).unwrap_or(0);
    AsynchronousError {
        peak_n: direct_n.iter().map(|force| force.length()).fold(0.0, f64::max),
        largest_step_n: steps(&contact_n, 1),
        direct_step_n: steps(&direct_n, 1),
        held_step_n: steps(&direct_n, held),
        held_rms_n: (held_sum / held_count).sqrt(),
        slewed_ticks: records.iter().filter(|record| record.events.intersects(Events::SLEW_LIMITED)).count(),
        rms_n: rms_of[0],
        worst_n: difference(0).fold(0.0, f64::max),
        delay_s: between(&rms_of, best) * 1.0e-3,
        rms_delayed_n: rms_of[best],
        records,
        direct_n,
    }
}

/// Returns the position of a minimum between samples, in samples, from the parabola through the squares of three samples.
fn between(rms_of: &[f64], best: usize) -> f64 {
    let square = |index: usize| rms_of.get(index).map(|rms| rms * rms);
    let neighbours = best.checked_sub(1).and_then(square).zip(square(best)).zip(square(best + 1));
    let shift = neighbours.map_or(0.0, |((before, here), after)| {
        let curvature = before - 2.0 * here + after;
        if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 }
    });
    best as f64 + shift
}

/// Returns the force of the membrane itself, stepped at each tick of a run at the recorded pose, N.
fn direct(records: &[TickRecord]) -> Vec<DVec3> {
    let plugin = Plugin::in_process(&flotor_membrane::FLOTOR_ENTRY).expect("the membrane is a plugin");
    let mut model = plugin.create_model(&[]).expect("it has defaults");
    model.prepare(&LoopConfig { period_ns: 1_000_000, seed: 1 }).expect("it runs at 1 kHz");
    let step = |record: &TickRecord| {
        let input = Input {
            pose: record.pose,
            twist: record.twist,
            time_ns: record.time_ns,
            dt_ns: record.dt_ns,
            tick: record.tick,
            buttons: 0,
            demand: Demand::WRENCH,
        };
        let mut output = Output::default();
        assert_eq!(model.step(&input, &mut output), CallStatus::Ok);
        output.wrench.force()
    };
    records.iter().map(step).collect()
}
