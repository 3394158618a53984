//! Tree of boxes over the patches: four children a node, packed bottom-up over patches sorted along Hilbert's curve.
//!
//! No pointers: the children of node `i` of a level are nodes `4 i` to `4 i + 3` of the level below, and of the lowest level patches.
//! Boxes are binary32, rounded outwards; distances are computed in binary32 and compared with a margin for their rounding.

use flotor_hal::DVec3;

/// Children of a node.
const WIDTH: usize = 4;
/// Most levels: four to this power is more than the number of patches that is read.
const MOST_LEVELS: usize = 14;
/// Size of the stack of a traversal.
const STACK: usize = WIDTH * MOST_LEVELS;
/// Share of a squared distance that binary32 may round up.
const ROUNDING: f32 = 1.0e-6;

/// Four boxes, by coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
struct Node {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
}

impl Node {
    const EMPTY: Self = Self { low: [[f32::INFINITY; WIDTH]; 3], high: [[f32::NEG_INFINITY; WIDTH]; 3] };

    /// Returns a lower bound of the squared distance of a point to each box.
    #[inline]
    fn squares(&self, c: [f32; 3]) -> [f32; WIDTH] {
        let mut sum = [0.0_f32; WIDTH];
        for axis in 0..3 {
            for i in 0..WIDTH {
                let beyond = (self.low[axis][i] - c[axis]).max(c[axis] - self.high[axis][i]).max(0.0);
                sum[i] += beyond * beyond;
            }
        }
        sum
    }

    /// Returns true for each box that a segment may meet, widened by `wide`.
    #[inline]
    fn meets(&self, low: [f32; 3], high: [f32; 3]) -> [bool; WIDTH] {
        let mut all = [true; WIDTH];
        for axis in 0..3 {
            for i in 0..WIDTH {
                all[i] &= self.low[axis][i] <= high[axis] && self.high[axis][i] >= low[axis];
            }
        }
        all
    }
}

/// Tree over numbered boxes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    /// Levels from the lowest to the root.
    levels: Vec<Vec<Node>>,
    count: usize,
    /// Rounding of a coordinate of the boxes to binary32, m.
    rounding_m: f32,
}

#[allow(clippy::cast_possible_truncation)] // rounded outwards
fn below(x: f64) -> f32 {
    (x as f32).next_down()
}

#[allow(clippy::cast_possible_truncation)] // rounded outwards
fn above(x: f64) -> f32 {
    (x as f32).next_up()
}

#[allow(clippy::cast_possible_truncation)] // the margin covers it
fn narrow(v: DVec3) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// Returns the order of points along Hilbert's curve in their box. Not real-time.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 2^20, fewer than 2^32 points
pub fn hilbert_order(points_m: &[DVec3]) -> Vec<u32> {
    const BITS: u32 = 20;
    let low = points_m.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let side = (high - low).max_element().max(f64::MIN_POSITIVE);
    let scale = f64::from((1_u32 << BITS) - 1) / side;
    let mut keys: Vec<(u64, u32)> = points_m
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let cell = ((*p - low) * scale).to_array().map(|x| x as u32);
            (hilbert_key(cell, BITS), i as u32)
        })
        .collect();
    keys.sort_unstable();
    keys.into_iter().map(|(_, i)| i).collect()
}

/// Returns the place of a cell along Hilbert's curve (Skilling 2004, AIP Conf. Proc. 707, 381).
fn hilbert_key(mut x: [u32; 3], bits: u32) -> u64 {
    let mut q = 1 << (bits - 1);
    while q > 1 {
        let p = q - 1;
        for i in 0..3 {
            if x[i] & q != 0 {
                x[0] ^= p;
            } else {
                let t = (x[0] ^ x[i]) & p;
                x[0] ^= t;
                x[i] ^= t;
            }
        }
        q >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut t = 0;
    q = 1 << (bits - 1);
    while q > 1 {
        if x[2] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    x = x.map(|x| x ^ t);
    (0..bits).rev().fold(0, |key, bit| x.iter().fold(key, |key, x| (key << 1) | u64::from((x >> bit) & 1)))
}

impl Tree {
    /// Packs boxes (lower and upper corner, m) in their order. Not real-time.
    #[must_use]
    pub fn new(boxes_m: impl ExactSizeIterator<Item = [DVec3; 2]>) -> Self {
        let count = boxes_m.len();
        let mut lowest = vec![Node::EMPTY; count.div_ceil(WIDTH)];
        let mut largest = 0.0_f64;
        for (i, [low, high]) in boxes_m.enumerate() {
            let node = &mut lowest[i / WIDTH];
            for axis in 0..3 {
                node.low[axis][i % WIDTH] = below(low[axis]);
                node.high[axis][i % WIDTH] = above(high[axis]);
            }
            largest = largest.max(low.abs().max_element()).max(high.abs().max_element());
        }
        let mut levels = vec![lowest];
        while levels.last().is_some_and(|level| level.len() > 1) {
            let level = &levels[levels.len() - 1];
            let mut up = vec![Node::EMPTY; level.len().div_ceil(WIDTH)];
            for (i, node) in level.iter().enumerate() {
                for axis in 0..3 {
                    up[i / WIDTH].low[axis][i % WIDTH] =
                        node.low[axis].iter().copied().fold(f32::INFINITY, f32::min);
                    up[i / WIDTH].high[axis][i % WIDTH] =
                        node.high[axis].iter().copied().fold(f32::NEG_INFINITY, f32::max);
                }
            }
            levels.push(up);
        }
        Self { levels, count, rounding_m: above(largest * 2.4e-7) }
    }

    /// Returns the number of bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|level| level.len() * size_of::<Node>()).sum()
    }

    /// Visits the boxes nearer to `c_m` than the bound, nearest first as far as the tree knows; `visit` returns the new bound, m.
    /// Real-time: bounded, no allocation.
    pub fn nearest(&self, c_m: DVec3, bound_m: f64, mut visit: impl FnMut(usize) -> f64) {
        let c = narrow(c_m);
        let limit = |bound_m: f64| {
            let bound = above(bound_m) + self.rounding_m;
            bound * bound * (1.0 + 4.0 * ROUNDING)
        };
        if self.count == 0 || bound_m < 0.0 {
            return;
        }
        let mut most = limit(bound_m);
        let mut stack = [(0_u32, 0_u32, 0.0_f32); STACK];
        stack[0] = (u32::try_from(self.levels.len() - 1).unwrap_or(0), 0, 0.0);
        let mut used = 1;
        while used > 0 {
            used -= 1;
            let (level, index, square) = stack[used];
            if square > most {
                continue;
            }
            let squares = self.levels[level as usize][index as usize].squares(c);
            let mut order = [0_u32, 1, 2, 3];
            let mut sort = |i: usize, j: usize| {
                if squares[order[i] as usize] < squares[order[j] as usize] {
                    order.swap(i, j);
                }
            };
            // Farthest first: the stack returns the nearest.
            sort(0, 1);
            sort(2, 3);
            sort(0, 2);
            sort(1, 3);
            sort(1, 2);
            if level == 0 {
                for child in order.into_iter().rev() {
                    let item = WIDTH * index as usize + child as usize;
                    if squares[child as usize] <= most && item < self.count {
                        most = most.min(limit(visit(item)));
                    }
                }
                continue;
            }
            for child in order {
                if squares[child as usize] <= most && used < STACK {
                    stack[used] = (level - 1, index * 4 + child, squares[child as usize]);
                    used += 1;
                }
            }
        }
    }

    /// Visits the boxes that overlap the box of a segment. Real-time: bounded, no allocation.
    pub fn along(&self, from_m: DVec3, to_m: DVec3, mut visit: impl FnMut(usize)) {
        if self.count == 0 {
            return;
        }
        let low = narrow(from_m.min(to_m)).map(|x| x - self.rounding_m);
        let high = narrow(from_m.max(to_m)).map(|x| x + self.rounding_m);
        let mut stack = [(0_u32, 0_u32); STACK];
        stack[0].0 = u32::try_from(self.levels.len() - 1).unwrap_or(0);
        let mut used = 1;
        while used > 0 {
            used -= 1;
            let (level, index) = stack[used];
            let meets = self.levels[level as usize][index as usize].meets(low, high);
            for child in (0..4_u32).filter(|child| meets[*child as usize]) {
                let item = index * 4 + child;
                if level == 0 {
                    if (item as usize) < self.count {
                        visit(item as usize);
                    }
                } else if used < STACK {
                    stack[used] = (level - 1, item);
                    used += 1;
                }
            }
        }
    }
}
