//! M8, determinism: equal bits for equal poses.
//!
//! Compares a second instance, a reset instance, and the batch call. The digest of all answers is printed, to compare
//! runs on two machines or of two builds by eye.

use super::measure::{Measure, NO_ANSWER};
use super::poses::mixed;
use super::sweep::sweep;
use super::{Setup, WIDER};
use crate::PERIOD_NS;
use crate::sampling::{Random, Sobol};
use crate::subject::{Subject, call};
use crate::tally::{Worst, tally};
use crate::watch::enter_call;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Input, Memory, Output, Pose, Twist};
use flotor_loader::{LoadError, Model};
use xxhash_rust::xxh3::Xxh3;

const NAME: &str = "determinism";
/// Poses per block; each block creates a second instance.
const BLOCK: u64 = 2048;

/// Bits of an answer.
type Bits = [u64; 8];

/// Repetitions that are compared, in the order of [`Tally::differing`].
const AGAIN: [&str; 3] = ["second instance", "after reset", "batch"];

tally! {
    struct Tally {
        compared: u64,
        differing: [u64; AGAIN.len()],
        first: Option<(Pose, &'static str)>,
        /// Digest of the answers of each block.
        digests: Vec<u64>,
        refused: Option<LoadError>,
    }
}

/// Compares the bits of the answers at the same poses: of two instances, of a reset instance, and of a batch.
pub(super) fn measure(setup: &Setup<'_>) -> Result<Measure, LoadError> {
    let sobol = Sobol::new(setup.options.seed);
    let blocks = setup.share(1_000_000, 0).div_ceil(BLOCK);
    let total = sweep(setup, NAME, blocks, |subject, block| {
        let inputs = inputs(setup, &sobol, subject, block);
        let mut other = match setup.subject() {
            Ok(other) => other,
            Err(refused) => return Tally { refused: Some(refused), ..Tally::default() },
        };
        let reference = singly(subject.model(), &inputs);
        let second = singly(other.model(), &inputs);
        subject.model().reset();
        let reset = singly(subject.model(), &inputs);
        other.model().reset();
        let batch = batch(other.model(), &inputs);
        compare(&inputs, &reference, [&second, &reset, &batch])
    })?;
    match total.refused {
        Some(refused) => Err(refused),
        None => Ok(judge(&total)),
    }
}

/// Returns evenly spread poses and some of the manifolds; for a model with memory, a walk from home.
fn inputs(setup: &Setup<'_>, sobol: &Sobol, subject: &mut Subject<'_>, block: u64) -> Vec<Input> {
    let reach = setup.options.reach.scaled(WIDER);
    let mut random = Random::new(setup.options.seed, block);
    let mut input = |index: u64| {
        if subject.memory() == Memory::PathDependent {
            // Move straight to one pose per block, in as many ticks as the block has.
            let part = (index % BLOCK) as f64 / BLOCK as f64;
            let outward = sobol.point(block).map(|unit| 0.5 + (unit - 0.5) * part);
            return subject.input(reach.pose(outward), Twist::ZERO, PERIOD_NS);
        }
        subject.input(mixed(reach, sobol, &mut random, index), Twist::ZERO, PERIOD_NS)
    };
    (block * BLOCK..(block + 1) * BLOCK).map(&mut input).collect()
}

/// Bit pattern for "no answer", which no model writes.
const UNANSWERED: Bits = [0x0bad_0bad_0bad_0bad; 8];

fn singly(model: &mut Model, inputs: &[Input]) -> Vec<Bits> {
    let mut ask = |input: &Input| call(model, input).map_or(UNANSWERED, |output| bits(&output));
    inputs.iter().map(&mut ask).collect()
}

fn batch(model: &mut Model, inputs: &[Input]) -> Vec<Bits> {
    let mut outputs = vec![Output::default(); inputs.len()];
    let _calls = enter_call(inputs);
    match model.step_batch(inputs, &mut outputs) {
        CallStatus::Ok => outputs.iter().map(bits).collect(),
        _ => vec![UNANSWERED; inputs.len()],
    }
}

fn bits(output: &Output) -> Bits {
    let mut bits = [0; 8];
    let numbers = output.wrench.force_n.iter().chain(&output.wrench.torque_nm).chain([&output.energy_j]);
    for (to, number) in bits.iter_mut().zip(numbers) {
        // Ignore the payload of a NaN.
        *to = if number.is_nan() { f64::NAN.to_bits() } else { number.to_bits() };
    }
    bits[7] = output.status().map_or(u64::MAX, |status| status as u64);
    bits
}

fn compare(inputs: &[Input], reference: &[Bits], again: [&[Bits]; AGAIN.len()]) -> Tally {
    let mut tally = Tally::default();
    let mut digest = Xxh3::new();
    for (index, (input, expected)) in inputs.iter().zip(reference).enumerate() {
        // A broken model answers nothing from there on; M0 reports that.
        if *expected == UNANSWERED {
            break;
        }
        tally.compared += 1;
        expected.iter().for_each(|word| digest.update(&word.to_le_bytes()));
        for (way, (count, answers)) in tally.differing.iter_mut().zip(again).enumerate() {
            if answers.get(index) != Some(expected) && answers.get(index) != Some(&UNANSWERED) {
                *count += 1;
                tally.first.get_or_insert((input.pose, AGAIN[way]));
            }
        }
    }
    tally.digests.push(digest.digest());
    tally
}

fn judge(total: &Tally) -> Measure {
    let mut digest = Xxh3::new();
    total.digests.iter().for_each(|block| digest.update(&block.to_le_bytes()));
    let mut comment = format!("digest {:016x}", digest.digest());
    if let Some((_, way)) = total.first {
        comment = format!("first by {way}; {comment}");
    }
    let value = total.differing.iter().sum::<u64>() as f64;
    let differing = Worst { value, pose: total.first.map(|(pose, _)| pose) };
    let mut measure = Measure::of(["M8", NAME, ""], &differing, [0.0, 0.0], comment)
        .count("poses compared", total.compared);
    for (way, count) in AGAIN.iter().zip(total.differing) {
        measure = measure.count(format!("differing, {way}"), count);
    }
    measure.unless_empty(total.compared, NO_ANSWER)
}
