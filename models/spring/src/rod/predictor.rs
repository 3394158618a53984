//! Prediction of the shape from the shapes of the last ticks.
//!
//! A hand moves smoothly, so the next shape is close to the polynomial through the last shapes, sampled at the tick. But a hand
//! also stops, starts and is read through a noisy sensor, where a polynomial overshoots. The poses decide: the order that would
//! have predicted the *pose* best is used for the shape.

use super::functional::Shape;
use super::plate::Plate;

/// Highest order plus one. Each order makes the prediction of a smooth hand some thirty times more accurate; a higher
/// order would exceed the accuracy of the shapes.
const DEPTH: usize = 6;

/// Weights of the last ticks, newest first: binomial coefficients with alternating signs.
const WEIGHTS: [[f64; DEPTH]; DEPTH] = [
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [2.0, -1.0, 0.0, 0.0, 0.0, 0.0],
    [3.0, -3.0, 1.0, 0.0, 0.0, 0.0],
    [4.0, -6.0, 4.0, -1.0, 0.0, 0.0],
    [5.0, -10.0, 10.0, -5.0, 1.0, 0.0],
    [6.0, -15.0, 20.0, -15.0, 6.0, -1.0],
];

/// Last equilibria of successive ticks, newest first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct History<const N: usize> {
    plates: [Plate; DEPTH],
    shapes: [Shape<N>; DEPTH],
    length: usize,
}

flotor_hal::restorable!([const N: usize] History<N> { plates, shapes, length });

impl<const N: usize> History<N> {
    pub(crate) fn new(plate: Plate, shape: Shape<N>) -> Self {
        Self { plates: [plate; DEPTH], shapes: [shape; DEPTH], length: 1 }
    }

    /// Resets the history to one equilibrium. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn restart(&mut self, plate: &Plate, shape: &Shape<N>) {
        (self.plates[0], self.shapes[0], self.length) = (*plate, *shape, 1);
    }

    /// Returns the pose of the upper plate at the last equilibrium.
    pub(crate) fn plate(&self) -> &Plate {
        &self.plates[0]
    }

    /// Adds the equilibrium of this tick.
    #[inline]
    pub(crate) fn push(&mut self, plate: Plate, shape: &Shape<N>) {
        self.plates.rotate_right(1);
        self.shapes.rotate_right(1);
        (self.plates[0], self.shapes[0]) = (plate, *shape);
        self.length = DEPTH.min(self.length + 1);
    }

    /// Predicts the shape at a pose by extrapolation from the last ticks. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn predict(&self, plate: &Plate) -> Shape<N> {
        let (mut best, mut least) = (&WEIGHTS[0], plate.distance(&self.plates[0]));
        for weights in WEIGHTS.iter().take(self.length).skip(1) {
            let miss = plate.distance(&Plate::combination(&self.plates, weights));
            if miss < least {
                (best, least) = (weights, miss);
            }
        }
        let mut shape = [0.0; N];
        for (past, weight) in self.shapes.iter().zip(best) {
            for (coefficient, past) in shape.iter_mut().zip(past) {
                *coefficient += weight * past;
            }
        }
        shape
    }
}
