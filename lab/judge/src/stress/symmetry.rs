//! M10, symmetry: deviation of a law from its declared symmetry.
//!
//! A law need not have a symmetry; without a declaration nothing is measured. With one, the answer at the image of a
//! pose must be the image of the answer: a mirror maps a force like a position, and a torque like a rotation, with the
//! opposite sign.

use super::jacobian::size_n;
use super::measure::{Measure, NO_ANSWER, Verdict};
use super::sweep::sweep;
use super::{Setup, WIDER};
use crate::sampling::{Random, Sobol};
use crate::subject::Subject;
use crate::tally::{Worst, tally};
use crate::trajectory::at;
use clap::ValueEnum;
use flotor_hal::{DQuat, DVec3, Memory, Pose, Wrench, rotation_vector};
use flotor_loader::LoadError;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

const NAME: &str = "symmetry";
/// Largest relative difference of the wrench that passes: that of M3.
const SYMMETRIC: f64 = 1.0e-6;
/// Smallest wrench that is compared, N.
const NOTHING_N: f64 = 1.0e-6;
/// Poses per block.
const BLOCK: u64 = 16;

/// Transformation that leaves a law unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Symmetry {
    /// The mirror x = 0
    MirrorX,
    /// The mirror y = 0
    MirrorY,
    /// The mirror z = 0
    MirrorZ,
    /// Any turn about the z axis
    AroundZ,
}

/// Map of a symmetry.
#[derive(Clone, Copy)]
enum Map {
    /// Reflection; the axis normal to the mirror.
    Mirror(DVec3),
    Turn(DQuat),
}

impl Symmetry {
    fn map(self, random: &mut Random) -> Map {
        match self {
            Self::MirrorX => Map::Mirror(DVec3::X),
            Self::MirrorY => Map::Mirror(DVec3::Y),
            Self::MirrorZ => Map::Mirror(DVec3::Z),
            Self::AroundZ => Map::Turn(DQuat::from_rotation_z(PI * random.symmetric())),
        }
    }
}

impl Map {
    /// Maps positions and forces.
    fn shift(self, vector: DVec3) -> DVec3 {
        match self {
            Self::Mirror(across) => vector - across * (2.0 * across.dot(vector)),
            Self::Turn(turn) => turn * vector,
        }
    }

    /// Maps rotations and torques.
    fn turn(self, vector: DVec3) -> DVec3 {
        match self {
            Self::Mirror(across) => across * (2.0 * across.dot(vector)) - vector,
            Self::Turn(turn) => turn * vector,
        }
    }

    fn pose(self, pose: Pose) -> Pose {
        at(self.shift(pose.position()), self.turn(rotation_vector(pose.orientation())))
    }

    fn wrench(self, wrench: Wrench) -> Wrench {
        Wrench::new(self.shift(wrench.force()), self.turn(wrench.torque()))
    }
}

tally! {
    struct Tally {
        poses: u64,
        unanswered: u64,
        /// Number of poses with a wrench there or at the image.
        comparable: u64,
        difference: Worst,
    }
}

/// Returns the answer at a pose; a model with memory comes from home each time, on the image of the path for the image.
fn answer(subject: &mut Subject<'_>, pose: Pose) -> Option<Wrench> {
    if subject.memory() == Memory::PathDependent {
        subject.restart();
    }
    subject.answer_at(pose).ok().map(|output| output.wrench)
}

/// Compares evenly spread poses with their images.
pub(super) fn measure(setup: &Setup<'_>, symmetry: Symmetry) -> Result<Measure, LoadError> {
    let sobol = Sobol::new(setup.options.seed);
    let reach = setup.options.reach.scaled(WIDER);
    let total = sweep(setup, NAME, setup.share(200_000, 64).div_ceil(BLOCK), |subject, block| {
        let mut random = Random::new(setup.options.seed, block);
        let mut tally = Tally::default();
        for index in block * BLOCK..(block + 1) * BLOCK {
            let (pose, map) = (reach.pose(sobol.point(index)), symmetry.map(&mut random));
            tally.poses += 1;
            let (Some(here), Some(there)) = (answer(subject, pose), answer(subject, map.pose(pose))) else {
                tally.unanswered += 1;
                continue;
            };
            let largest_n = size_n(&here).max(size_n(&there)).max(NOTHING_N);
            tally.comparable += u64::from(largest_n > NOTHING_N);
            tally.difference.offer(size_n(&(there + map.wrench(here) * -1.0)) / largest_n, pose);
        }
        tally
    })?;
    let why = if total.unanswered == total.poses { NO_ANSWER } else { "the wrench is zero at every pose" };
    let comment = match Verdict::of(total.difference.value, SYMMETRIC, SYMMETRIC) {
        Verdict::Pass => format!("{} poses and their images", total.poses),
        _ => "the result at the image of this pose differs from the image of the result".to_owned(),
    };
    Ok(Measure::of(["M10", NAME, ""], &total.difference, [SYMMETRIC; 2], comment)
        .count("poses", total.poses)
        .count("poses without answer", total.unanswered)
        .count("poses with a wrench", total.comparable)
        .unless_empty(total.comparable, why))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_twice_is_nothing_and_turns_the_sense_of_rotations() {
        let mut random = Random::new(1, 0);
        for symmetry in [Symmetry::MirrorX, Symmetry::MirrorY, Symmetry::MirrorZ] {
            let map = symmetry.map(&mut random);
            let (vector, turn) = (random.vector(), 0.1 * random.vector());
            assert!((map.shift(map.shift(vector)) - vector).length() < 1e-15);
            // Turning the image by the image of a rotation is the image of what was turned.
            let turned = DQuat::from_scaled_axis(turn) * vector;
            let image = DQuat::from_scaled_axis(map.turn(turn)) * map.shift(vector);
            assert!((map.shift(turned) - image).length() < 1e-15);
        }
    }
}
