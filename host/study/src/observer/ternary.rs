//! Signal detection with three answers: the indecision model of García-Pérez and Alcalá-Quintana.

use crate::random::Stream;
use crate::trial::Response;
use flotor_statistics::distribution::normal_below;

/// Somebody who compares two stimuli: evidence is the difference in units of its noise, and below a criterion there is
/// no answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TernaryObserver {
    /// Difference of one standard deviation of the noise, as a share of the base.
    pub sigma: f64,
    /// Evidence below which the answer is "I don't know".
    pub criterion: f64,
    /// Preference for the second.
    pub bias: f64,
    /// Share of trials answered by chance.
    pub lapse: f64,
}

impl TernaryObserver {
    /// Probability of naming the larger one (averaged over which comes second), and of naming the smaller one.
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

    /// The difference at which `P(correct) + P(don't know) / 2` is the target: where a weighted up-down track is in
    /// balance.
    #[must_use]
    pub fn threshold(&self, target: f64) -> f64 {
        let reached = |delta: f64| {
            let [correct, wrong] = self.correct_and_wrong(delta);
            0.5 * (1.0 + correct - wrong) >= target
        };
        let (mut low, mut high) = (0.0, self.sigma);
        // No difference reaches a target that lapses rule out.
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

    /// The answer to a pair that differs by so much, positive if the second is larger.
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
mod tests {
    use super::*;
    use crate::random::Purpose;

    const OBSERVER: TernaryObserver = TernaryObserver { sigma: 0.1, criterion: 0.5, bias: 0.0, lapse: 0.0 };

    /// Balance of the weighted up-down rule at 75 %, in units of sigma, over the criterion.
    #[test]
    fn thresholds_of_the_literature() {
        let table = [(0.0, 0.6745), (0.25, 0.6958), (0.5, 0.7622), (0.75, 0.8797), (1.0, 1.0505)];
        for (criterion, expected) in table {
            let threshold = TernaryObserver { criterion, ..OBSERVER }.threshold(0.75) / OBSERVER.sigma;
            assert!((threshold - expected).abs() < 5.0e-5, "{criterion}: {threshold}");
        }
        let inattentive = TernaryObserver { lapse: 0.9, ..OBSERVER };
        assert_eq!(inattentive.threshold(0.75), f64::INFINITY);
    }

    /// Answers come as often as the formula says, to four standard errors.
    #[test]
    fn answers_follow_the_probabilities() {
        const TRIALS: u32 = 20_000;
        for observer in [OBSERVER, TernaryObserver { bias: 0.4, lapse: 0.1, ..OBSERVER }] {
            for delta in [0.0, 0.05, 0.2] {
                let mut correct = 0.0;
                for index in 0..TRIALS {
                    let mut stream = Stream::new(3, Purpose::Answer, 1, index);
                    let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
                    let right = if sign > 0.0 { Response::Second } else { Response::First };
                    correct += f64::from(u8::from(observer.respond(sign * delta, &mut stream) == right));
                }
                let expected = observer.correct_and_wrong(delta)[0];
                let share = correct / f64::from(TRIALS);
                let bound = 4.0 * (expected * (1.0 - expected) / f64::from(TRIALS)).sqrt();
                assert!((share - expected).abs() < bound, "{share} for {expected}");
            }
        }
    }
}
