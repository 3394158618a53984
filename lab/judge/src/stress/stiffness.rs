//! M2, M3 and M5: measures of the derivative of the wrench with respect to the pose.
//!
//! **M2, Lipschitz constant.** A sampled loop of period `T` is passive on a device with damping `b` as long as the
//! stiffness does not exceed `2 b / T` (Colgate and Schenkel, J. Robotic Systems 14, 1997, without virtual damping;
//! Abbott and Okamura, IEEE T-RO 21, 2005). The renderable part is the fraction of the workspace where the largest gain
//! of the derivative, in all six degrees of freedom at the device's lever arm, is within this limit.
//!
//! **M3, reciprocity.** Force and torque with a common potential have a symmetric derivative (Maxwell's reciprocity);
//! `|J - J^T| / |J|` measures the deviation. The part above the uncertainty of the finite differences fails; where that
//! uncertainty exceeds the bound, the pose is not resolved.
//!
//! **M5, sampled energy.** A loop holds each force for a period `T`, so even a conservative spring returns more energy than it
//! received: `T/2 v.S v` per second for a motion `v`, `S` being the symmetric part of the stiffness. The device damping that
//! dissipates it for every motion is the largest eigenvalue of `S` times `T/2` (Colgate and Schenkel 1997).
//!
//! Where the answer depends on the path (friction), or has a kink within the shortest difference, there is no
//! derivative. M2 and M5 are then judged by the differences along the six coordinates; M3 has nothing to judge.

use super::jacobian::Jacobian;
use super::measure::{Measure, NO_ANSWER, Verdict};
use super::sweep::sweep;
use super::{DAMPINGS_NS_PER_M, LEVER_M, MOSTLY, PERIOD_S, Setup};
use crate::sampling::Sobol;
use crate::tally::{Decades, Worst, tally};
use flotor_loader::LoadError;

const NAME: &str = "Lipschitz constant, reciprocity and sampled energy";
/// Poses per block.
const BLOCK: u64 = 32;
/// Largest asymmetry that passes. Differences resolve 1e-9; a missing coupling term gives percents.
const RECIPROCAL: f64 = 1.0e-6;
/// Relative uncertainty above which there is no derivative: a step or a kink lies within the shortest difference.
const ROUGH: f64 = 0.1;

/// Loop periods for which M5 is reported, s; the last is judged.
const PERIODS_S: [f64; 3] = [0.25e-3, 0.5e-3, PERIOD_S];

tally! {
    struct Tally {
        poses: u64,
        unanswered: u64,
        /// Number of poses without a derivative.
        rough: u64,
        gain: Gain,
        stiffness: Gain,
        /// Gains of the blocks force-translation, force-rotation, torque-translation, torque-rotation, N/m.
        blocks: [f64; 4],
        gains: Decades,
        /// Largest asymmetry beyond the uncertainty.
        asymmetry: Worst,
        /// Largest relative uncertainty of a derivative.
        uncertain: f64,
        /// Number of poses whose wrench depends on the pose, of those with a derivative, and of those whose asymmetry
        /// is known to the bound.
        comparable: u64,
        differentiable: u64,
        resolved: u64,
    }
}

tally! {
    /// Gain over the workspace, N/m: largest measured, largest possible, and number of poses within the limit of each
    /// damping of [`DAMPINGS_NS_PER_M`].
    struct Gain {
        seen: Worst,
        possible: f64,
        allowed: [u64; DAMPINGS_NS_PER_M.len()],
    }
}

impl Gain {
    fn take(&mut self, [seen, possible]: [f64; 2], pose: flotor_hal::Pose) {
        self.seen.offer(seen, pose);
        self.possible = self.possible.max(possible);
        for (count, damping) in self.allowed.iter_mut().zip(DAMPINGS_NS_PER_M) {
            *count += u64::from(seen <= stiffest_n_per_m(damping));
        }
    }

    /// Returns the fraction of poses within the limit, by damping.
    fn shares(&self, poses: u64) -> [f64; DAMPINGS_NS_PER_M.len()] {
        self.allowed.map(|count| count as f64 / poses.max(1) as f64)
    }

    /// Judges this gain times `unit_of_gain` by the bounds of the two dampings. A gain that is too large in few places
    /// only, as where coils touch, is noted: the device's limit, which its loop has to respect.
    fn judge(&self, named: [&'static str; 3], unit_of_gain: f64, poses: u64, comment: String) -> Measure {
        let bounds = DAMPINGS_NS_PER_M.map(|damping| stiffest_n_per_m(damping) * unit_of_gain);
        let worst = Worst { value: self.seen.value * unit_of_gain, ..self.seen };
        let [_, heavily] = self.shares(poses);
        let measure = Measure::of(named, &worst, bounds, comment);
        let verdict = match measure.verdict {
            Verdict::Fail if heavily >= MOSTLY => Verdict::Note,
            verdict => verdict,
        };
        let possible = self.possible * unit_of_gain;
        Measure { verdict, ..measure }.unless_uncertain(possible, || {
            format!("differences along the coordinates give only the upper bound {possible:.4}")
        })
    }
}

impl Tally {
    fn take(&mut self, jacobian: &Jacobian, pose: flotor_hal::Pose) {
        let norm = jacobian.norm();
        // Derivative and transpose each contribute this error.
        let uncertain = 2.0 * jacobian.error;
        if uncertain > ROUGH * norm {
            let chords = jacobian.chords;
            self.rough += 1;
            self.comparable += u64::from(chords.gain() > 0.0);
            self.gain.take([chords.gain(), chords.bound()], pose);
            self.stiffness.take([chords.stiffness(), chords.bound()], pose);
            self.gains.count(chords.gain());
            return;
        }
        let (gain, stiffness) = (jacobian.gain(), jacobian.stiffness());
        self.gain.take([gain, gain + jacobian.error], pose);
        self.stiffness.take([stiffness, stiffness + jacobian.error], pose);
        self.gains.count(gain);
        for (index, block) in self.blocks.iter_mut().enumerate() {
            *block = block.max(jacobian.block_stiffness(index / 2, index % 2));
        }
        if norm > 0.0 {
            let asymmetry = jacobian.asymmetry();
            let beyond = (asymmetry - uncertain).max(0.0) / norm;
            let is_known = beyond > RECIPROCAL || asymmetry + uncertain <= RECIPROCAL * norm;
            self.comparable += 1;
            self.differentiable += 1;
            self.resolved += u64::from(is_known);
            self.uncertain = self.uncertain.max(uncertain / norm);
            self.asymmetry.offer(beyond, pose);
        }
    }

    fn answered(&self) -> u64 {
        self.poses - self.unanswered
    }
}

/// Returns the stiffness limit `2 b / T`, N/m.
fn stiffest_n_per_m(damping_ns_per_m: f64) -> f64 {
    2.0 * damping_ns_per_m / PERIOD_S
}

/// Measures M2, M3 and M5; returns also the gains over the workspace for the picture.
pub(super) fn measure(setup: &Setup<'_>) -> Result<([Measure; 3], Decades), LoadError> {
    let sobol = Sobol::new(setup.options.seed);
    let blocks = setup.share(400_000, 32).div_ceil(BLOCK);
    let total = sweep(setup, NAME, blocks, |subject, block| {
        let mut tally = Tally::default();
        for index in block * BLOCK..(block + 1) * BLOCK {
            let pose = setup.options.reach.pose(sobol.point(index));
            tally.poses += 1;
            match Jacobian::at(subject, pose) {
                Some(jacobian) => tally.take(&jacobian, pose),
                None => tally.unanswered += 1,
            }
        }
        tally
    })?;
    Ok(([lipschitz(&total), reciprocity(&total), sampled_energy(&total)], total.gains))
}

fn lipschitz(total: &Tally) -> Measure {
    let shares = total.gain.shares(total.answered());
    let [lightly, heavily] = DAMPINGS_NS_PER_M;
    let comment = format!(
        "renderable at 1 kHz: {:.4} of the workspace with b = {lightly} N s/m, {:.4} with {heavily}",
        shares[0], shares[1]
    );
    // Block gains need derivatives: unknown where there is none.
    let has_derivative = total.answered() > total.rough;
    let [force_shift, force_turn, torque_shift, torque_turn] =
        total.blocks.map(|gain| if has_derivative { gain } else { f64::NAN });
    total
        .gain
        .judge(["M2", "Lipschitz constant", "N/m"], 1.0, total.answered(), comment)
        .with("force by shift", force_shift, "N/m")
        .with("force by turn", force_turn * LEVER_M, "N/rad")
        .with("torque by shift", torque_shift * LEVER_M, "N·m/m")
        .with("torque by turn", torque_turn * LEVER_M * LEVER_M, "N·m/rad")
        .with(format!("renderable share, b = {lightly} N s/m"), shares[0], "")
        .with(format!("renderable share, b = {heavily} N s/m"), shares[1], "")
        .count("poses", total.poses)
        .count("poses without answer", total.unanswered)
        .count("poses without derivative", total.rough)
        .unless_empty(total.answered(), NO_ANSWER)
}

fn reciprocity(total: &Tally) -> Measure {
    let share = total.resolved as f64 / total.comparable.max(1) as f64;
    let uncertain = total.uncertain;
    let comment = format!(
        "resolved to the bound at {share:.4} of the poses; uncertainty of the differences \
         {uncertain:.0e}"
    );
    let possible = if share >= MOSTLY { total.asymmetry.value } else { f64::INFINITY };
    let why = match (total.answered(), total.comparable) {
        (0, _) => NO_ANSWER,
        (_, 0) => "the wrench does not depend on the pose",
        _ => "no derivative where the wrench depends on the pose: the result depends on the path to the pose",
    };
    Measure::of(["M3", "reciprocity", ""], &total.asymmetry, [RECIPROCAL, RECIPROCAL], comment.clone())
        .unless_uncertain(possible, || comment)
        .count("poses", total.comparable)
        .count("poses known to the bound", total.resolved)
        .with("uncertainty of the differences, at most", uncertain, "")
        .unless_empty(total.differentiable, why)
}

fn sampled_energy(total: &Tally) -> Measure {
    let comment =
        "device damping that dissipates the energy generated by the zero-order hold, any motion, 1 kHz";
    let named = ["M5", "sampled energy", "N s/m"];
    let measure = total.stiffness.judge(named, 0.5 * PERIOD_S, total.answered(), comment.to_owned());
    let with_periods = PERIODS_S.into_iter().fold(measure, |measure, period_s| {
        let damping = 0.5 * period_s * total.stiffness.seen.value;
        measure.with(format!("damping needed, T = {} ms", period_s * 1.0e3), damping, "N s/m")
    });
    with_periods
        .count("poses", total.poses)
        .count("poses without answer", total.unanswered)
        .count("poses without derivative", total.rough)
        .unless_empty(total.answered(), NO_ANSWER)
}
