use super::*;

const LIMIT_NS: u64 = 500;

fn booked(steps_ns: &[u64]) -> TimeBudget {
    let mut budget = TimeBudget::new(Some(LIMIT_NS));
    for (tick, took_ns) in (0..).zip(steps_ns) {
        budget.book(*took_ns, LIMIT_NS, tick, tick * 1_000_000);
    }
    budget
}

#[test]
fn five_overruns_in_a_row_are_too_many_and_four_are_not() {
    assert_eq!(booked(&[501; 4]).overrun(), None);
    let overrun = Overrun { tick: 4, longest_ns: 900, limit_ns: LIMIT_NS };
    assert_eq!(booked(&[501, 501, 900, 501, 501]).overrun(), Some(overrun));
}

#[test]
fn a_step_in_time_makes_up_for_one_that_was_not() {
    let one_in_two: Vec<u64> = (0..1000).map(|tick| 500 + tick % 2).collect();
    assert_eq!(booked(&one_in_two).overrun(), None);
    // Two in three gain one in three ticks.
    let two_in_three: Vec<u64> = (0..1000).map(|tick| 500 + u64::from(tick % 3 > 0)).collect();
    assert_eq!(booked(&two_in_three).overrun().map(|overrun| overrun.tick), Some(11));
}

#[test]
fn who_is_slow_in_four_ticks_of_five_is_out_soon() {
    let steps: Vec<u64> = (0..100).map(|tick| if tick % 5 == 4 { 10 } else { 3_000_000 }).collect();
    assert_eq!(booked(&steps).overrun().map(|overrun| overrun.tick), Some(6));
}

#[test]
fn who_is_out_fades_and_is_not_asked() {
    let budget = booked(&[501; 5]); // out at 4 ms
    assert_eq!(budget.allowed(4_000_000), Allowed::Fading(1.0));
    assert_eq!(budget.allowed(29_000_000), Allowed::Fading(0.5));
    assert_eq!(budget.allowed(54_000_000), Allowed::Nothing);
}

#[test]
fn a_missing_answer_is_late_however_soon_that_was_known() {
    let mut budget = TimeBudget::new(Some(u64::MAX - 1));
    let begun_ns = monotonic_ns();
    assert!(!budget.end(begun_ns, Answer::There, 0, 0));
    assert!((1..=5).all(|tick| budget.end(begun_ns, Answer::Missing, tick, 0)));
    assert_eq!(budget.overrun().map(|overrun| overrun.tick), Some(5));
}

#[test]
fn without_a_limit_nobody_looks_at_the_clock() {
    let mut budget = TimeBudget::new(None);
    assert_eq!(budget.begin(), None);
    assert!((0..100).all(|tick| !budget.end(0, Answer::Missing, tick, tick)));
    assert_eq!(budget.allowed(u64::MAX), Allowed::Asked);
}
