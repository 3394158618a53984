//! Axis-aligned boxes, eight at a time, in binary32, rounded outwards.

use super::{WIDTH, above, below};
use flotor_hal::DVec3;

/// Eight boxes, as arrays by coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Boxes {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
}

impl Boxes {
    pub(super) const EMPTY: Self =
        Self { low: [[f32::INFINITY; WIDTH]; 3], high: [[f32::NEG_INFINITY; WIDTH]; 3] };

    /// Returns a lower bound of the squared distance of a point to each box.
    #[inline]
    pub(super) fn squares(&self, c: [f32; 3]) -> [f32; WIDTH] {
        let mut sum = [0.0_f32; WIDTH];
        for axis in 0..3 {
            for i in 0..WIDTH {
                let beyond = (self.low[axis][i] - c[axis]).max(c[axis] - self.high[axis][i]).max(0.0);
                sum[i] += beyond * beyond;
            }
        }
        sum
    }

    /// Returns true for each box that overlaps a given box.
    #[inline]
    pub(super) fn meets(&self, low: [f32; 3], high: [f32; 3]) -> [bool; WIDTH] {
        let mut all = [true; WIDTH];
        for axis in 0..3 {
            for i in 0..WIDTH {
                all[i] &= self.low[axis][i] <= high[axis] && self.high[axis][i] >= low[axis];
            }
        }
        all
    }

    /// Enlarges a box to contain two corners, m.
    pub(super) fn widen(&mut self, i: usize, [low_m, high_m]: [DVec3; 2]) {
        for k in 0..3 {
            self.low[k][i] = self.low[k][i].min(below(low_m[k]));
            self.high[k][i] = self.high[k][i].max(above(high_m[k]));
        }
    }

    /// Returns the bounding box of all eight, m.
    pub(super) fn all_m(&self) -> [DVec3; 2] {
        let end = |all: [[f32; WIDTH]; 3], of: fn(f32, f32) -> f32, start| {
            DVec3::from_array(all.map(|ends| f64::from(ends.into_iter().fold(start, of))))
        };
        [end(self.low, f32::min, f32::INFINITY), end(self.high, f32::max, f32::NEG_INFINITY)]
    }
}
