//! Vectors of all masses, stored as one array per coordinate.

use flotor_hal::{DVec3, restorable};
use std::ops::Range;

/// Vectors as a structure of arrays, one array per coordinate.
#[derive(Debug)]
pub struct Vectors {
    /// Components along x.
    pub x: Vec<f64>,
    /// Components along y.
    pub y: Vec<f64>,
    /// Components along z.
    pub z: Vec<f64>,
}

restorable!(Vectors { x, y, z });

impl Clone for Vectors {
    fn clone(&self) -> Self {
        Self { x: self.x.clone(), y: self.y.clone(), z: self.z.clone() }
    }

    /// Copies without allocation if the lengths are equal.
    fn clone_from(&mut self, other: &Self) {
        self.x.clone_from(&other.x);
        self.y.clone_from(&other.y);
        self.z.clone_from(&other.z);
    }
}

impl Vectors {
    /// Returns `count` zero vectors. Not real-time.
    #[must_use]
    pub fn zero(count: usize) -> Self {
        Self { x: vec![0.0; count], y: vec![0.0; count], z: vec![0.0; count] }
    }

    pub(crate) fn from_points(points: &[DVec3]) -> Self {
        let component = |pick: fn(&DVec3) -> f64| points.iter().map(pick).collect();
        Self { x: component(|p| p.x), y: component(|p| p.y), z: component(|p| p.z) }
    }

    /// Returns the vector at an index. Real-time: bounded, no allocation.
    ///
    /// # Panics
    /// If the index is out of range.
    #[must_use]
    pub fn get(&self, index: usize) -> DVec3 {
        DVec3::new(self.x[index], self.y[index], self.z[index])
    }

    #[inline]
    pub(crate) fn slices(&self, range: Range<usize>) -> [&[f64]; 3] {
        [&self.x[range.clone()], &self.y[range.clone()], &self.z[range]]
    }

    #[inline]
    pub(crate) fn slices_mut(&mut self, range: Range<usize>) -> [&mut [f64]; 3] {
        [&mut self.x[range.clone()], &mut self.y[range.clone()], &mut self.z[range]]
    }

    #[inline]
    pub(crate) fn clear(&mut self, range: Range<usize>) {
        self.slices_mut(range).into_iter().for_each(|component| component.fill(0.0));
    }

    /// Returns the sum of the squared lengths of all vectors.
    pub(crate) fn sum_of_squares(&self) -> f64 {
        [&self.x, &self.y, &self.z].iter().map(|component| component.iter().map(|c| c * c).sum::<f64>()).sum()
    }

    /// Returns the squared length of the longest vector of a range.
    #[inline]
    pub(crate) fn longest_square(&self, range: Range<usize>) -> f64 {
        let [x, y, z] = self.slices(range);
        let mut longest = 0.0_f64;
        for ((x, y), z) in x.iter().zip(y).zip(z) {
            longest = longest.max(x * x + y * y + z * z);
        }
        longest
    }

    /// Adds the first entries of `other`, times `sign`, to a range.
    #[inline]
    pub(crate) fn add(&mut self, range: Range<usize>, other: &Vectors, sign: f64) {
        let count = range.len();
        let sums = self.slices_mut(range);
        for (sum, addend) in sums.into_iter().zip(other.slices(0..count)) {
            for i in 0..count {
                sum[i] += sign * addend[i];
            }
        }
    }
}
