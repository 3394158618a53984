//! Signal detection with three answers: indecision model of García-Pérez and Alcalá-Quintana.

use crate::answer::Position;
use crate::random::Stream;
use flotor_statistics::distribution::normal_below;

/// Observer who compares two stimuli. The evidence is the noisy difference (second minus first) in standard deviations of the
/// noise; if its magnitude is at most the criterion, the answer is "I don't know".
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct TernaryObserver {
    /// Standard deviation of the noise, as a fraction of the base.
    pub sigma: f64,
    /// Magnitude of the evidence, in standard deviations of the noise, up to which the answer is "I don't know".
    pub criterion: f64,
    /// Bias to the second stimulus, in standard deviations of the noise.
    pub bias: f64,
    /// Lapse rate: fraction of trials answered "first" or "second" by chance.
    pub lapse: f64,
}

impl TernaryObserver {
    /// Returns the observer with a given threshold (fraction of the base) at a target of 75 %, without bias and lapses.
    pub fn with_threshold(threshold: f64, criterion: f64) -> Self {
        let unit = Self { sigma: 1.0, criterion, bias: 0.0, lapse: 0.0 };
        Self { sigma: threshold / unit.threshold(0.75), ..unit }
    }

    /// Returns the probabilities of naming the larger and the smaller stimulus of a pair with difference `delta`, averaged over
    /// both orders.
    #[must_use]
    pub fn correct_and_wrong(&self, delta: f64) -> [f64; 2] {
        let share = |sign: f64| {
            let named = |bias: f64| normal_below(sign * delta / self.sigma + bias - self.criterion);
            if self.bias == 0.0 {
                return named(0.0);
            }
            0.5 * (named(self.bias) + named(-self.bias))
        };
        [1.0, -1.0].map(|sign| (1.0 - self.lapse) * share(sign) + 0.5 * self.lapse)
    }

    /// Returns the difference at which `P(correct) + P(don't know) / 2` equals the target: the equilibrium of a weighted
    /// up-down track. Infinite if lapses make the target unreachable.
    #[must_use]
    pub fn threshold(&self, target: f64) -> f64 {
        let reached = |delta: f64| {
            let [correct, wrong] = self.correct_and_wrong(delta);
            0.5 * (1.0 + correct - wrong) >= target
        };
        let (mut low, mut high) = (0.0, self.sigma);
        // Lapses can make a target unreachable.
        while !reached(high) {
            high *= 2.0;
            if high > 1.0e6 * self.sigma {
                return f64::INFINITY;
            }
        }
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if reached(middle) { high = middle } else { low = middle }
        }
        high
    }

    /// Draws the position named in a pair with the given difference, a fraction of the base, positive if the second stimulus is
    /// larger; `None` for "I don't know".
    pub fn respond(&self, second_minus_first: f64, stream: &mut Stream) -> Option<Position> {
        let (lapse, guess, noise) = (stream.uniform(), stream.coin(), stream.normal());
        if lapse < self.lapse {
            return Some(if guess { Position::First } else { Position::Second });
        }
        let evidence = second_minus_first / self.sigma + self.bias + noise;
        if evidence > self.criterion {
            Some(Position::Second)
        } else if evidence < -self.criterion {
            Some(Position::First)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests;
