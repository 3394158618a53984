use super::super::queue::drain;
use super::*;

fn change(value: f64) -> ParameterChange {
    ParameterChange { plugin: 1, generation: 3, parameter: 2, value }
}

fn at(index: u64) -> Tick {
    Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 }
}

/// Values applied at a tick.
fn applied(queue: &mut ParameterQueue, index: u64) -> Vec<f64> {
    let mut values = Vec::new();
    let waiting = queue.waiting();
    let any = queue.apply_due(&at(index), waiting, |change| {
        values.push(change.value);
        CallStatus::Ok
    });
    assert_eq!(any, !values.is_empty());
    values
}

#[test]
fn what_is_scheduled_comes_at_its_tick_or_the_next_and_once() {
    let scheduled = |time_ns, value| ScheduledChange { time_ns, change: change(value) };
    let schedule = vec![scheduled(2_000_001, 3.0), scheduled(1_000_000, 1.0), scheduled(1_000_000, 2.0)];
    let (mut queue, _sender, mut reports) = ParameterQueue::new(schedule, 0);
    let values: Vec<Vec<f64>> = (0..5).map(|index| applied(&mut queue, index)).collect();
    assert_eq!(values, [vec![], vec![1.0, 2.0], vec![], vec![3.0], vec![]]);
    let ticks: Vec<u64> = std::iter::from_fn(|| reports.pop().ok()).map(|report| report.tick).collect();
    assert_eq!(ticks, [1, 1, 3]);
}

#[test]
fn nothing_is_applied_that_nobody_could_be_told_of() {
    let (mut queue, mut sender, mut reports) = ParameterQueue::new(Vec::new(), 0);
    let mut sent = 0;
    let mut arrived = 0;
    for index in 0..10 {
        while sender.push(change(0.0)).is_ok() {
            sent += 1;
        }
        arrived += applied(&mut queue, index).len();
    }
    let mut reported = 0;
    drain(&mut reports, |_| reported += 1);
    assert!(arrived < sent, "what nobody listens to waits: {arrived} of {sent}");
    assert_eq!(arrived, reported);
    assert_eq!(applied(&mut queue, 10).len(), sent - arrived, "and goes in when somebody listens again");
}
