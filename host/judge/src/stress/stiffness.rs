//! M2 and M3: what the derivative of the wrench by the pose says.
//!
//! **M2, Lipschitz constant.** A sampled loop of period `T` stays passive on a device with damping `b` as
//! long as the stiffness does not exceed `2 b / T` (Colgate and Schenkel, J. Robotic Systems 14, 1997,
//! without virtual damping; Abbott and Okamura, IEEE T-RO 21, 2005). The share of the workspace where the
//! largest gain of the derivative, in all six degrees of freedom at the device's lever arm, keeps to that is
//! the renderable share.
//!
//! **M3, reciprocity.** Force and torque that come from one energy have a symmetric derivative (Maxwell's
//! reciprocity); `|J - J^T| / |J|` measures how far a model is from that. Only the part above the
//! uncertainty of the finite differences counts.

use super::jacobian::Jacobian;
use super::measure::{Measure, Verdict};
use super::sweep::sweep;
use super::{DAMPINGS_NS_PER_M, LEVER_M, PERIOD_S, Setup};
use crate::sampling::Sobol;
use crate::tally::{Decades, Worst, tally};
use flotor_hal::abi::loader::LoadError;

const NAME: &str = "Lipschitz constant and reciprocity";
/// Poses of one block.
const BLOCK: u64 = 32;
/// Largest asymmetry that passes. Differences resolve 1e-9; a real coupling that is forgotten makes percents.
const RECIPROCAL: f64 = 1.0e-6;
/// Relative uncertainty from which on there is no derivative to speak of: a step or a bend lies within the
/// shortest difference, and M1 is the one to tell.
const ROUGH: f64 = 0.1;

/// Share of the workspace that a device with heavy damping renders of a law that is only here and there too stiff.
const MOSTLY: f64 = 0.9;

tally! {
    struct Tally {
        poses: u64,
        unanswered: u64,
        /// Gains of the whole and of the blocks force-shift, force-turn, torque-shift, torque-turn, N/m.
        gain: Worst,
        blocks: [f64; 4],
        renderable: [u64; DAMPINGS_NS_PER_M.len()],
        gains: Decades,
        asymmetry: Worst,
        /// Largest relative uncertainty of a derivative.
        uncertain: f64,
        /// Poses where the differences do not settle: no derivative there.
        rough: u64,
    }
}

impl Tally {
    fn take(&mut self, jacobian: &Jacobian, pose: flotor_hal::Pose) {
        let norm = jacobian.norm();
        // Both the derivative and its transpose are that uncertain.
        let uncertain = 2.0 * jacobian.error;
        if uncertain > ROUGH * norm {
            self.rough += 1;
            return;
        }
        let gain = jacobian.stiffness();
        self.gain.offer(gain, pose);
        self.gains.count(gain);
        for (index, block) in self.blocks.iter_mut().enumerate() {
            *block = block.max(jacobian.block_stiffness(index / 2, index % 2));
        }
        for (count, damping) in self.renderable.iter_mut().zip(DAMPINGS_NS_PER_M) {
            *count += u64::from(gain <= stiffest_n_per_m(damping));
        }
        if norm > 0.0 {
            self.uncertain = self.uncertain.max(uncertain / norm);
            self.asymmetry.offer((jacobian.asymmetry() - uncertain).max(0.0) / norm, pose);
        }
    }

    /// Poses with a derivative.
    fn judged(&self) -> u64 {
        self.poses - self.unanswered - self.rough
    }
}

/// `2 b / T`.
fn stiffest_n_per_m(damping_ns_per_m: f64) -> f64 {
    2.0 * damping_ns_per_m / PERIOD_S
}

/// Both measures, and the gains over the workspace for the picture.
pub(super) fn measure(setup: &Setup<'_>) -> Result<(Measure, Measure, Decades), LoadError> {
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
    Ok((lipschitz(&total), reciprocity(&total), total.gains))
}

fn lipschitz(total: &Tally) -> Measure {
    let share = |index: usize| total.renderable[index] as f64 / total.judged().max(1) as f64;
    let [lightly, heavily] = DAMPINGS_NS_PER_M;
    let comment = format!(
        "renderable at 1 kHz: {:.4} of the workspace with b = {lightly} N s/m, {:.4} with {heavily}",
        share(0),
        share(1)
    );
    let bounds = DAMPINGS_NS_PER_M.map(stiffest_n_per_m);
    let measure = Measure::of(["M2", "Lipschitz constant", "N/m"], &total.gain, bounds, comment);
    let verdict = match measure.verdict {
        // Stiff here and there, as where coils touch: the device's limit, which its loop has to keep.
        Verdict::Fail if share(1) >= MOSTLY => Verdict::Note,
        verdict => verdict,
    };
    Measure { verdict, ..measure }
        .with("force by shift", total.blocks[0], "N/m")
        .with("force by turn", total.blocks[1] * LEVER_M, "N/rad")
        .with("torque by shift", total.blocks[2] * LEVER_M, "N·m/m")
        .with("torque by turn", total.blocks[3] * LEVER_M * LEVER_M, "N·m/rad")
        .with(format!("renderable share, b = {lightly} N s/m"), share(0), "")
        .with(format!("renderable share, b = {heavily} N s/m"), share(1), "")
        .count("poses", total.poses)
        .count("poses without answer", total.unanswered)
        .count("poses without derivative", total.rough)
        .unless_unanswered(total.judged())
}

fn reciprocity(total: &Tally) -> Measure {
    let comment = format!("beyond the uncertainty of finite differences, {:.0e}", total.uncertain);
    Measure::of(["M3", "reciprocity", ""], &total.asymmetry, [RECIPROCAL, RECIPROCAL], comment)
        .count("poses", total.judged())
        .with("uncertainty taken off, at most", total.uncertain, "")
        .unless_unanswered(total.judged())
}
