//! Signal detection with three answers: the indecision model of García-Pérez and Alcalá-Quintana.

use crate::random::Stream;
use crate::trial::Response;
use flotor_statistics::distribution::normal_below;

/// Observer who compares two stimuli: evidence is the difference in units of its noise; below a criterion the answer is "I don't know".
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct TernaryObserver {
    /// Difference of one standard deviation of the noise, as a share of the base.
    pub sigma: f64,
    /// Evidence below which the answer is "I don't know".
    pub criterion: f64,
    /// Preference for the second stimulus, in deviations of the noise.
    pub bias: f64,
    /// Share of trials answered by chance.
    pub lapse: f64,
}

impl TernaryObserver {
    /// Returns the observer with a given threshold at a target of 75 %, without bias and lapses.
    pub fn with_threshold(threshold: f64, criterion: f64) -> Self {
        let unit = Self { sigma: 1.0, criterion, bias: 0.0, lapse: 0.0 };
        Self { sigma: threshold / unit.threshold(0.75), ..unit }
    }

    /// Returns the probabilities of naming the larger stimulus (averaged over both orders) and the smaller one.
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

    /// Returns the difference at which `P(correct) + P(don't know) / 2` equals the target: the equilibrium of a weighted up-down track.
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

    /// Draws the answer to a pair with a given relative difference, positive if the second is larger.
    pub(crate) fn respond(&self, second_minus_first: f64, stream: &mut Stream) -> Response {
        let (lapse, guess, noise) = (stream.uniform(), stream.coin(), stream.normal());
        if lapse < self.lapse {
            return if guess { Response::First } else { Response::Second };
        }
        let evidence = second_minus_first / self.sigma + self.bias + noise;
        if evidence > self.criterion {
            Response::Second
        } else if evidence < -self.criterion {
            Response::First
        } else {
            Response::DontKnow
        }
    }
}

#[cfg(test)]
mod tests;
