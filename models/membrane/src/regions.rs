//! Activity of blocks of masses: blocks at rest are skipped until the ball or a linked block activates them.
//!
//! A block is 64 consecutive masses. A block becomes inactive when all its masses have been slow in [`QUIET_LOOKS`] checks, and
//! active when the ball comes near or a mass of a linked block is faster than [`ACTIVATING_M_PER_S`]. The masses of an inactive
//! block do not move: the omitted motion is slower than [`QUIET_M_PER_S`].

use crate::ball::Ball;
use crate::vectors::Vectors;
use flotor_hal::{DVec3, restorable};
use std::ops::Range;
use std::sync::Arc;

/// Masses per block: a few vector registers, and about a row of a sheet.
pub(crate) const BLOCK: usize = 64;
/// Speed limit of rest, m/s: a micrometre per second is far below human perception.
const QUIET_M_PER_S: f64 = 1.0e-6;
/// Speed that activates the neighbours, m/s: twice the limit of rest, as hysteresis against flicker.
const ACTIVATING_M_PER_S: f64 = 2.0 * QUIET_M_PER_S;
/// Steps between two checks of a block.
const STEPS_BETWEEN_LOOKS: u64 = 8;
/// Consecutive quiet checks before a block becomes inactive: turning points of a swing are shorter.
const QUIET_LOOKS: u8 = 16;

/// Activity of the blocks of a network.
#[derive(Debug)]
pub(crate) struct Regions {
    nodes: usize,
    blocks: Vec<Block>,
    /// Blocks linked to each block.
    neighbours: Arc<[Box<[usize]>]>,
    steps: u64,
}

restorable!(Regions { blocks, steps } without { nodes, neighbours });

#[derive(Clone, Copy, Debug)]
struct Block {
    active: bool,
    quiet_looks: u8,
    /// Lowest and highest corner of the masses' bounding box when the block became inactive, m.
    lowest_m: DVec3,
    highest_m: DVec3,
}

restorable!(Block { active, quiet_looks, lowest_m, highest_m });

impl Clone for Regions {
    fn clone(&self) -> Self {
        let Self { nodes, blocks, neighbours, steps } = self;
        Self { nodes: *nodes, blocks: blocks.clone(), neighbours: Arc::clone(neighbours), steps: *steps }
    }

    /// Copies without allocation between two states of one network.
    fn clone_from(&mut self, other: &Self) {
        self.blocks.clone_from(&other.blocks);
        (self.nodes, self.steps) = (other.nodes, other.steps);
        self.neighbours = Arc::clone(&other.neighbours);
    }
}

impl Regions {
    /// Creates active blocks without links, for tests.
    #[cfg(test)]
    pub(crate) fn all_active(nodes: usize) -> Self {
        Self::new(nodes, std::iter::empty())
    }

    /// Creates active blocks for `nodes` masses; `joined`: pairs of linked blocks. Not real-time.
    pub(crate) fn new(nodes: usize, joined: impl Iterator<Item = [usize; 2]>) -> Self {
        let count = nodes.div_ceil(BLOCK);
        let mut neighbours = vec![std::collections::BTreeSet::new(); count];
        for [a, b] in joined.filter(|[a, b]| a != b) {
            neighbours[a].insert(b);
            neighbours[b].insert(a);
        }
        let active = Block { active: true, quiet_looks: 0, lowest_m: DVec3::ZERO, highest_m: DVec3::ZERO };
        let neighbours = neighbours.into_iter().map(|set| set.into_iter().collect()).collect();
        Self { nodes, blocks: vec![active; count], neighbours, steps: 0 }
    }

    /// Returns true if a block is active. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn is_active(&self, block: usize) -> bool {
        self.blocks.get(block).is_some_and(|block| block.active)
    }

    /// Returns the index range of the masses of each active block. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn active(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let active = self.blocks.iter().enumerate().filter(|(_, block)| block.active);
        active.map(|(block, _)| block * BLOCK..(block * BLOCK + BLOCK).min(self.nodes))
    }

    /// Activates all blocks. Real-time: bounded, no allocation.
    pub(crate) fn activate_all(&mut self) {
        self.blocks.iter_mut().for_each(Block::activate);
    }

    /// Activates the blocks that the ball may touch. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn activate_near(&mut self, ball: &Ball) {
        for block in self.blocks.iter_mut().filter(|block| !block.active) {
            let nearest_m = ball.centre_m.clamp(block.lowest_m, block.highest_m);
            if nearest_m.distance_squared(ball.centre_m) < ball.radius_m * ball.radius_m {
                block.activate();
            }
        }
    }

    /// Updates activity after a step: deactivates slow blocks and sets their velocities to zero, and activates the neighbours of
    /// fast blocks. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn settle(&mut self, positions_m: &Vectors, velocities_m_per_s: &mut Vectors) {
        self.steps += 1;
        let look = self.steps.is_multiple_of(STEPS_BETWEEN_LOOKS);
        let neighbours = Arc::clone(&self.neighbours);
        for (index, linked) in neighbours.iter().enumerate() {
            let range = index * BLOCK..(index * BLOCK + BLOCK).min(self.nodes);
            // Between two checks only blocks with an inactive neighbour need work.
            let frontier = || linked.iter().any(|neighbour| !self.is_active(*neighbour));
            if !self.is_active(index) || !(look || frontier()) {
                continue;
            }
            let fastest = velocities_m_per_s.longest_square(range.clone());
            if fastest > ACTIVATING_M_PER_S * ACTIVATING_M_PER_S {
                linked.iter().for_each(|neighbour| self.blocks[*neighbour].activate());
            }
            let block = &mut self.blocks[index];
            if fastest > QUIET_M_PER_S * QUIET_M_PER_S {
                block.quiet_looks = 0;
            } else if look {
                block.quiet_looks += 1;
                if block.quiet_looks >= QUIET_LOOKS {
                    block.deactivate(positions_m, range.clone());
                    velocities_m_per_s.clear(range);
                }
            }
        }
    }
}

impl Block {
    fn activate(&mut self) {
        (self.active, self.quiet_looks) = (true, 0);
    }

    fn deactivate(&mut self, positions_m: &Vectors, range: Range<usize>) {
        let [x, y, z] = positions_m.slices(range);
        let ends = |numbers: &[f64]| {
            let fold = |pick: fn(f64, f64) -> f64, start| numbers.iter().copied().fold(start, pick);
            (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY))
        };
        let (x, y, z) = (ends(x), ends(y), ends(z));
        (self.lowest_m, self.highest_m) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
        self.active = false;
    }
}
