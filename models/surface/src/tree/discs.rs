//! Flat cylinders, eight at a time: a ball in contact with a smooth surface overlaps the boxes of many patches nearby, but few of
//! their discs. Stored in binary32, rounded so that a disc contains its item.

use super::{ROUNDING, WIDTH, above, narrow};
use flotor_hal::DVec3;
use std::ops::Range;

/// Flat cylinder that contains an item.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Disc {
    /// Middle, m.
    pub(crate) middle_m: DVec3,
    /// Unit vector along the axis.
    pub(crate) axis: DVec3,
    /// Radius, m.
    pub(crate) radius_m: f64,
    /// Half of the height along the axis, m.
    pub(crate) half_m: f64,
}

impl Disc {
    /// Returns a disc that contains all of `discs`, one or more.
    fn about(discs: &[Self]) -> Self {
        let sum: DVec3 = discs.iter().map(|disc| disc.axis).sum();
        let axis = sum.try_normalize().unwrap_or(discs[0].axis);
        let (mut low_m, mut high_m) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut middle_m = DVec3::ZERO;
        for disc in discs {
            let (cosine, sine) = (disc.axis.dot(axis).abs(), disc.axis.cross(axis).length());
            let (at_m, reach_m) = (disc.middle_m.dot(axis), disc.half_m * cosine + disc.radius_m * sine);
            (low_m, high_m) = (low_m.min(at_m - reach_m), high_m.max(at_m + reach_m));
            middle_m += disc.middle_m / discs.len() as f64;
        }
        middle_m += axis * (0.5 * (low_m + high_m) - middle_m.dot(axis));
        let radius_m = discs.iter().fold(0.0_f64, |most_m, disc| {
            let sine = disc.axis.cross(axis).length();
            let from_m = disc.middle_m - middle_m;
            let aside_m = (from_m - axis * from_m.dot(axis)).length();
            most_m.max(aside_m + disc.radius_m + disc.half_m * sine)
        });
        Self { middle_m, axis, radius_m, half_m: 0.5 * (high_m - low_m) }
    }
}

fn wide(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// Eight discs, as arrays by coordinate; four cache lines.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Discs {
    middle: [[f32; WIDTH]; 3],
    axis: [[f32; WIDTH]; 3],
    radius: [f32; WIDTH],
    half: [f32; WIDTH],
}

impl Discs {
    /// No discs: the distance to any point is infinite.
    pub(super) const EMPTY: Self = Self {
        middle: [[0.0; WIDTH]; 3],
        axis: [[0.0; WIDTH]; 3],
        radius: [f32::NEG_INFINITY; WIDTH],
        half: [f32::NEG_INFINITY; WIDTH],
    };

    /// Builds a node of the discs of some items.
    pub(super) fn of(items: Range<usize>, disc: impl Fn(usize) -> Option<Disc>) -> Self {
        let mut all = Self::EMPTY;
        for (place, item) in items.enumerate() {
            disc(item).iter().for_each(|disc| all.set(place, disc));
        }
        all
    }

    fn set(&mut self, i: usize, disc: &Disc) {
        let (middle, axis) = (narrow(disc.middle_m), narrow(disc.axis));
        for k in 0..3 {
            (self.middle[k][i], self.axis[k][i]) = (middle[k], axis[k]);
        }
        // Enlarge the disc by the rounding error of its middle.
        let moved_m = (wide(middle) - disc.middle_m).length();
        let turned_m = (wide(axis) - disc.axis).length() * (disc.radius_m + disc.half_m);
        self.radius[i] = above(disc.radius_m + moved_m + 2.0 * turned_m);
        self.half[i] = above(disc.half_m + moved_m + 2.0 * turned_m);
    }

    /// Returns a stored disc; `None` for an empty slot.
    fn get(&self, i: usize) -> Option<Disc> {
        let one = |all: &[[f32; WIDTH]; 3]| wide([all[0][i], all[1][i], all[2][i]]);
        let axis = one(&self.axis).try_normalize()?;
        let (radius_m, half_m) = (f64::from(self.radius[i]), f64::from(self.half[i]));
        Some(Disc { middle_m: one(&self.middle), axis, radius_m, half_m })
    }

    /// Returns a disc that contains all discs of this node.
    pub(super) fn disc(&self) -> Option<Disc> {
        let first = self.get(0)?;
        let mut all = [first; WIDTH];
        let mut count = 1;
        while let Some(disc) = (count < WIDTH).then(|| self.get(count)).flatten() {
            all[count] = disc;
            count += 1;
        }
        Some(Disc::about(&all[..count]))
    }

    /// Returns a lower bound of the squared distance of a point to each disc.
    #[inline]
    pub(super) fn squares(&self, c: [f32; 3]) -> [f32; WIDTH] {
        let (mut along, mut size) = ([0.0_f32; WIDTH], [0.0_f32; WIDTH]);
        let mut square = [0.0_f32; WIDTH];
        for k in 0..3 {
            for i in 0..WIDTH {
                let from = c[k] - self.middle[k][i];
                along[i] += from * self.axis[k][i];
                square[i] += from * from;
                size[i] += from.abs();
            }
        }
        let mut squares = [0.0_f32; WIDTH];
        for i in 0..WIDTH {
            let aside = (square[i] * (1.0 - ROUNDING) - along[i] * along[i]).max(0.0).sqrt() - self.radius[i];
            let over = along[i].abs() - self.half[i] - ROUNDING * size[i];
            let (aside, over) = (aside.max(0.0), over.max(0.0));
            squares[i] = aside * aside + over * over;
        }
        squares
    }

    /// Returns true for each disc whose bounding box may overlap a given box.
    #[inline]
    pub(super) fn meets(&self, low: [f32; 3], high: [f32; 3]) -> [bool; WIDTH] {
        let mut all = [true; WIDTH];
        for k in 0..3 {
            for i in 0..WIDTH {
                let n = self.axis[k][i];
                let aside = (1.0 - n * n + ROUNDING).max(0.0).sqrt();
                let reach = (self.radius[i] * aside + self.half[i] * n.abs()) * (1.0 + 4.0 * ROUNDING);
                all[i] &= self.middle[k][i] - reach <= high[k] && self.middle[k][i] + reach >= low[k];
            }
        }
        all
    }
}
