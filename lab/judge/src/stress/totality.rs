//! M0, totality: an answer to every input.
//!
//! A model is called thousands of times a second with any sensor values. At each pose of an even coverage and of the
//! named manifolds it must return a finite wrench with a status of the contract, and report inputs that are not finite.
//! A model that panics is reported with the pose and replaced. The thesis's code gives NaN at the exact rest pose, 0/0
//! in its moments.

use super::measure::Measure;
use super::poses::MANIFOLDS;
use super::sweep::sweep;
use super::{Setup, WIDER};
use crate::PERIOD_NS;
use crate::sampling::{Random, Sobol};
use crate::subject::{Subject, Trouble, TroubleKind};
use crate::tally::{Worst, tally};
use flotor_hal::{Input, Memory, Pose, StepStatus, Twist};
use flotor_loader::LoadError;

const NAME: &str = "totality";
/// Poses per block.
const BLOCK: u64 = 256;
/// Number of failures after which a block stops: enough to judge, and a panic costs microseconds.
const ENOUGH_TROUBLES: u64 = 64;

tally! {
    /// Counts of answers and failures.
    struct Tally {
        asked: u64,
        panics: u64,
        not_finite: u64,
        other: u64,
        out_of_domain: u64,
        not_converged: u64,
        first: Option<(Trouble, &'static str)>,
    }
}

impl Tally {
    fn troubles(&self) -> u64 {
        self.panics + self.not_finite + self.other
    }

    fn ask(&mut self, subject: &mut Subject<'_>, pose: Pose, twist: Twist, place: &'static str) {
        self.asked += 1;
        let answer = match subject.memory() {
            Memory::Stateless => subject.step(&Input { twist, ..subject.at_rest(pose) }),
            Memory::PathDependent if twist == Twist::ZERO => subject.answer_at(pose),
            Memory::PathDependent => subject.advance(pose, twist, PERIOD_NS),
        };
        match answer {
            Ok(output) => match output.status() {
                Some(StepStatus::OutOfDomain) => self.out_of_domain += 1,
                Some(StepStatus::NotConverged) => self.not_converged += 1,
                _ => {}
            },
            Err(trouble) => {
                match trouble.kind {
                    TroubleKind::Panicked(_) => self.panics += 1,
                    TroubleKind::NotFinite => self.not_finite += 1,
                    _ => self.other += 1,
                }
                self.first.get_or_insert((trouble, place));
            }
        }
    }
}

/// Steps the model at poses of the manifolds and of an even coverage, also beyond the workspace, and counts the failures.
pub(super) fn measure(setup: &Setup<'_>) -> Result<Measure, LoadError> {
    let reach = setup.options.reach.scaled(WIDER);
    let sobol = Sobol::new(setup.options.seed);
    let even_blocks = setup.share(10_000_000, 0).div_ceil(BLOCK);
    let blocks_per_manifold = setup.share(160_000, 0).div_ceil(BLOCK);
    let manifolds = MANIFOLDS.len() as u64;
    // Manifolds first: they fail early.
    let manifold_blocks = blocks_per_manifold * manifolds;

    let total = sweep(setup, NAME, manifold_blocks + even_blocks, |subject, block| {
        let mut tally = Tally::default();
        let (name, sample) = MANIFOLDS[usize::try_from(block % manifolds).unwrap_or(0)];
        let mut random = Random::new(setup.options.seed, block);
        let is_even = block >= manifold_blocks;
        let from = if is_even { block - manifold_blocks } else { block / manifolds } * BLOCK;
        for index in from..from + BLOCK {
            if is_even {
                tally.ask(subject, reach.pose(sobol.point(index)), Twist::ZERO, "workspace");
            } else {
                let (pose, twist) = sample(reach, &mut random, index);
                tally.ask(subject, pose, twist, name);
            }
            if tally.troubles() >= ENOUGH_TROUBLES {
                break;
            }
        }
        tally
    })?;
    Ok(judge(&total))
}

fn judge(total: &Tally) -> Measure {
    let asked = format!("{} poses, {} of them outside the model's domain", total.asked, total.out_of_domain);
    let comment = total.first.as_ref().map_or(asked, |(trouble, place)| {
        let what = match &trouble.kind {
            TroubleKind::Panicked(words) => words.clone(),
            TroubleKind::NotFinite => "returned a number that is not finite".to_owned(),
            TroubleKind::UnknownStatus => "returned a status unknown to the contract".to_owned(),
            TroubleKind::Refused(status) => format!("rejected the call (`{}`)", status.name()),
            TroubleKind::AcceptsNonFiniteInput => "returned `ok` for a pose that is not finite".to_owned(),
        };
        format!("first at {place}: {what}")
    });
    let pose = total.first.as_ref().map(|(trouble, _)| trouble.pose);
    let troubles = Worst { value: total.troubles() as f64, pose };
    Measure::of(["M0", NAME, ""], &troubles, [0.0, 0.0], comment)
        .count("poses", total.asked)
        .count("panics", total.panics)
        .count("not finite", total.not_finite)
        .count("other troubles", total.other)
        .count("out of domain", total.out_of_domain)
        .count("not converged", total.not_converged)
}
