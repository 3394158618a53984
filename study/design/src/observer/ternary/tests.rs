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
                let right = Some(if sign > 0.0 { Position::Second } else { Position::First });
                correct += f64::from(u8::from(observer.respond(sign * delta, &mut stream) == right));
            }
            let expected = observer.correct_and_wrong(delta)[0];
            let share = correct / f64::from(TRIALS);
            let bound = 4.0 * (expected * (1.0 - expected) / f64::from(TRIALS)).sqrt();
            assert!((share - expected).abs() < bound, "{share} for {expected}");
        }
    }
}
