//! M0, totality: an answer for every input.
//!
//! A model is called thousands of times a second with whatever the sensors say. At each pose of an even
//! coverage and of the named manifolds it must give a finite wrench with a status the contract knows, and say
//! so where the input was not finite. A model that panics is named with the pose and replaced. The thesis's
//! code gives NaN at the exact rest pose, 0/0 in its moments.

use super::measure::{Measure, Verdict};
use super::poses::Manifold;
use super::subject::{Subject, Trouble, TroubleKind};
use super::sweep::sweep;
use super::{Setup, WIDER};
use crate::lab::sampling::{Random, Sobol};
use flotor_hal::abi::loader::LoadError;
use flotor_hal::{Demand, Input, Memory, Pose, StepStatus, Twist};

const NAME: &str = "totality";
/// Poses of one block.
const BLOCK: u64 = 256;
/// Troubles after which a block stops asking: enough to know, and a panic costs microseconds.
const ENOUGH_TROUBLES: u64 = 64;

/// What was seen so far.
#[derive(Default)]
struct Tally {
    asked: u64,
    panics: u64,
    not_finite: u64,
    other: u64,
    out_of_domain: u64,
    not_converged: u64,
    first: Option<(Trouble, &'static str)>,
}

impl Tally {
    fn troubles(&self) -> u64 {
        self.panics + self.not_finite + self.other
    }

    fn merge(&mut self, later: Self) {
        self.asked += later.asked;
        self.panics += later.panics;
        self.not_finite += later.not_finite;
        self.other += later.other;
        self.out_of_domain += later.out_of_domain;
        self.not_converged += later.not_converged;
        self.first = self.first.take().or(later.first);
    }

    fn ask(&mut self, subject: &mut Subject<'_>, pose: Pose, twist: Twist, place: &'static str) {
        self.asked += 1;
        let answer = match subject.memory() {
            Memory::Stateless => {
                let demand = Demand::ALL.limited_to(subject.model().serves());
                subject.step(&Input { twist, demand, ..Input::at_rest(pose) })
            }
            Memory::PathDependent if twist == Twist::ZERO => subject.ask(pose),
            Memory::PathDependent => subject.advance(pose, twist, super::subject::PERIOD_NS),
        };
        match answer {
            Ok(answer) => match answer.status {
                StepStatus::OutOfDomain => self.out_of_domain += 1,
                StepStatus::NotConverged => self.not_converged += 1,
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

/// Asks for the wrench everywhere.
pub(super) fn measure(setup: &Setup<'_>) -> Result<Measure, LoadError> {
    let reach = setup.options.reach.scaled(WIDER);
    let sobol = Sobol::new(setup.options.seed);
    let even_blocks = setup.effort.sobol_poses.div_ceil(BLOCK);
    let blocks_per_manifold = setup.effort.poses_per_manifold.div_ceil(BLOCK);
    let manifolds = Manifold::ALL.len() as u64;
    // The manifolds first: what breaks there, breaks at once.
    let manifold_blocks = blocks_per_manifold * manifolds;

    let tallies = sweep(setup, NAME, manifold_blocks + even_blocks, |subject, block| {
        let mut tally = Tally::default();
        if block >= manifold_blocks {
            let from = (block - manifold_blocks) * BLOCK;
            for index in from..from + BLOCK {
                tally.ask(subject, reach.pose(sobol.point(index)), Twist::ZERO, "workspace");
                if tally.troubles() >= ENOUGH_TROUBLES {
                    break;
                }
            }
            return tally;
        }
        let manifold = Manifold::ALL[usize::try_from(block % manifolds).unwrap_or(0)];
        let mut random = Random::new(setup.options.seed, block);
        let from = block / manifolds * BLOCK;
        for index in from..from + BLOCK {
            let (pose, twist) = manifold.sample(reach, &mut random, index);
            tally.ask(subject, pose, twist, manifold.name());
            if tally.troubles() >= ENOUGH_TROUBLES {
                break;
            }
        }
        tally
    })?;
    let mut total = Tally::default();
    tallies.into_iter().for_each(|tally| total.merge(tally));
    Ok(judge(total))
}

#[allow(clippy::cast_precision_loss)] // counts below 2^53
fn judge(total: Tally) -> Measure {
    let troubles = total.troubles() as f64;
    let asked = format!("{} poses, {} of them out of the model's domain", total.asked, total.out_of_domain);
    let remark = total.first.as_ref().map_or(asked, |(trouble, place)| {
        let what = match &trouble.kind {
            TroubleKind::Panicked(words) => words.clone(),
            TroubleKind::NotFinite => "answered a number that is not finite".to_owned(),
            TroubleKind::UnknownStatus => "answered a status the contract does not know".to_owned(),
            TroubleKind::Refused(status) => format!("refused the call ({status:?})"),
            TroubleKind::CallsNonsenseSound => "answered `ok` to a pose that is not finite".to_owned(),
        };
        format!("first at {place}: {what}")
    });
    Measure {
        id: "M0",
        name: NAME,
        value: troubles,
        unit: "",
        bound: Some(0.0),
        verdict: Verdict::of(troubles, 0.0, 0.0),
        pose: total.first.map(|(trouble, _)| trouble.pose.into()),
        remark,
        values: Vec::new(),
    }
    .with("poses", total.asked as f64, "")
    .with("panics", total.panics as f64, "")
    .with("not finite", total.not_finite as f64, "")
    .with("other troubles", total.other as f64, "")
    .with("out of domain", total.out_of_domain as f64, "")
    .with("not converged", total.not_converged as f64, "")
}
