//! Blocks of masses that rest: left out of the work until something moves beside them.
//!
//! A block is 64 masses in a row of numbers. It falls asleep when all of them have been slow for a while, and wakes when
//! the ball comes near or a mass of a block it is linked to is no longer slow. While it sleeps its masses stand still:
//! what is left out is a motion slower than [`QUIET_M_PER_S`].

use crate::network::{Ball, Vectors};
use flotor_hal::DVec3;
use std::ops::Range;
use std::sync::Arc;

/// Masses of a block: a few vector registers, and a row or so of a sheet.
pub(crate) const BLOCK: usize = 64;
/// Slower than this is at rest, m/s: a micrometre in a second is far below what a hand or an eye can tell.
const QUIET_M_PER_S: f64 = 1.0e-6;
/// Faster than this wakes the neighbours, m/s: twice, so that a block on the edge does not flicker.
const WAKING_M_PER_S: f64 = 2.0 * QUIET_M_PER_S;
/// Steps between two looks at a block.
const STEPS_BETWEEN_LOOKS: u64 = 8;
/// Quiet looks before a block falls asleep: turning points of a swing are shorter.
const QUIET_LOOKS: u8 = 16;

/// Which blocks are awake.
#[derive(Debug)]
pub(crate) struct Regions {
    nodes: usize,
    blocks: Vec<Block>,
    /// Blocks each block is linked to.
    neighbours: Arc<[Box<[usize]>]>,
    steps: u64,
}

#[derive(Clone, Copy, Debug)]
struct Block {
    awake: bool,
    quiet_looks: u8,
    /// Box around its masses when it fell asleep, m.
    lowest_m: DVec3,
    highest_m: DVec3,
}

impl Clone for Regions {
    fn clone(&self) -> Self {
        let Self { nodes, blocks, neighbours, steps } = self;
        Self { nodes: *nodes, blocks: blocks.clone(), neighbours: Arc::clone(neighbours), steps: *steps }
    }

    /// Without allocation, between two states of one network.
    fn clone_from(&mut self, other: &Self) {
        self.blocks.clone_from(&other.blocks);
        (self.nodes, self.steps) = (other.nodes, other.steps);
        self.neighbours = Arc::clone(&other.neighbours);
    }
}

impl Regions {
    /// Everything awake, nothing linked: nothing ever sleeps or wakes by another. For tests.
    #[cfg(test)]
    pub(crate) fn all_awake(nodes: usize) -> Self {
        Self::new(nodes, std::iter::empty())
    }

    /// Everything awake. Not real-time.
    pub(crate) fn new(nodes: usize, joined: impl Iterator<Item = [usize; 2]>) -> Self {
        let count = nodes.div_ceil(BLOCK);
        let mut neighbours = vec![std::collections::BTreeSet::new(); count];
        for [a, b] in joined.filter(|[a, b]| a != b) {
            neighbours[a].insert(b);
            neighbours[b].insert(a);
        }
        let awake = Block { awake: true, quiet_looks: 0, lowest_m: DVec3::ZERO, highest_m: DVec3::ZERO };
        let neighbours = neighbours.into_iter().map(|set| set.into_iter().collect()).collect();
        Self { nodes, blocks: vec![awake; count], neighbours, steps: 0 }
    }

    /// Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn is_awake(&self, block: usize) -> bool {
        self.blocks.get(block).is_some_and(|block| block.awake)
    }

    /// Masses of the blocks that are awake. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn awake(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let awake = self.blocks.iter().enumerate().filter(|(_, block)| block.awake);
        awake.map(|(block, _)| block * BLOCK..(block * BLOCK + BLOCK).min(self.nodes))
    }

    /// Wakes all. Real-time: bounded, no allocation.
    pub(crate) fn wake_all(&mut self) {
        self.blocks.iter_mut().for_each(Block::wake);
    }

    /// Wakes what the ball may touch. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn wake_near(&mut self, ball: &Ball) {
        for block in self.blocks.iter_mut().filter(|block| !block.awake) {
            let nearest_m = ball.centre_m.clamp(block.lowest_m, block.highest_m);
            if nearest_m.distance_squared(ball.centre_m) < ball.radius_m * ball.radius_m {
                block.wake();
            }
        }
    }

    /// After a step: lets slow blocks sleep, and wakes the neighbours of those that are not. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(crate) fn settle(&mut self, positions_m: &Vectors, velocities_m_per_s: &mut Vectors) {
        self.steps += 1;
        let look = self.steps.is_multiple_of(STEPS_BETWEEN_LOOKS);
        let neighbours = Arc::clone(&self.neighbours);
        for (index, linked) in neighbours.iter().enumerate() {
            let range = index * BLOCK..(index * BLOCK + BLOCK).min(self.nodes);
            // A block all of whose neighbours are awake matters to nobody between two looks.
            let frontier = || linked.iter().any(|neighbour| !self.is_awake(*neighbour));
            if !self.is_awake(index) || !(look || frontier()) {
                continue;
            }
            let fastest = velocities_m_per_s.longest_square(range.clone());
            if fastest > WAKING_M_PER_S * WAKING_M_PER_S {
                linked.iter().for_each(|neighbour| self.blocks[*neighbour].wake());
            }
            let block = &mut self.blocks[index];
            if fastest > QUIET_M_PER_S * QUIET_M_PER_S {
                block.quiet_looks = 0;
            } else if look {
                block.quiet_looks += 1;
                if block.quiet_looks >= QUIET_LOOKS {
                    block.sleep(positions_m, range.clone());
                    velocities_m_per_s.clear(range);
                }
            }
        }
    }
}

impl Block {
    fn wake(&mut self) {
        (self.awake, self.quiet_looks) = (true, 0);
    }

    fn sleep(&mut self, positions_m: &Vectors, range: Range<usize>) {
        let [x, y, z] = positions_m.slices(range);
        let ends = |numbers: &[f64]| {
            let fold = |pick: fn(f64, f64) -> f64, start| numbers.iter().copied().fold(start, pick);
            (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY))
        };
        let (x, y, z) = (ends(x), ends(y), ends(z));
        (self.lowest_m, self.highest_m) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
        self.awake = false;
    }
}
