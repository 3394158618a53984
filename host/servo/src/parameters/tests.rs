use super::super::queue::drain;
use super::*;

fn change(value: f64) -> ParameterChange {
    ParameterChange {
        plugin: PluginIndex::of_device(1),
        generation: 3,
        parameter: 2,
        value,
        pace: Pace::AtOnce,
    }
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

fn gradual(value: f64) -> ParameterChange {
    ParameterChange { pace: Pace::Gradual { from: 20.0, per_s: 100.0 }, ..change(value) }
}

#[test]
fn a_number_with_a_rate_moves_there_step_by_step_and_every_step_is_reported() {
    let (mut queue, mut sender, mut reports) = ParameterQueue::new(Vec::new(), 0);
    sender.push(gradual(20.35)).unwrap();
    let values: Vec<f64> = (1..8).flat_map(|index| applied(&mut queue, index)).collect();
    let expected = [20.1, 20.2, 20.3, 20.35];
    assert_eq!(values.len(), expected.len(), "{values:?}");
    // A rounding of each step: 4e-15 at 20.
    assert!(
        values.iter().zip(expected).all(|(value, expected)| (value - expected).abs() < 1e-13),
        "{values:?}"
    );
    assert_eq!(values.last(), Some(&20.35), "the last step is the value that was requested");
    assert!(!queue.is_due(&at(9)));
    let reported: Vec<f64> =
        std::iter::from_fn(|| reports.pop().ok()).map(|report| report.change.value).collect();
    assert_eq!(reported, values);
}

#[test]
fn a_new_goal_starts_where_the_number_is_and_a_jump_of_the_scene_ends_the_way() {
    let jump = ScheduledChange { time_ns: 5_000_000, change: change(50.0) };
    let (mut queue, mut sender, _reports) = ParameterQueue::new(vec![jump], 0);
    sender.push(gradual(1000.0)).unwrap();
    let up: Vec<f64> = (1..3).flat_map(|index| applied(&mut queue, index)).collect();
    sender.push(gradual(0.0)).unwrap();
    let down: Vec<f64> = (3..5).flat_map(|index| applied(&mut queue, index)).collect();
    assert!(up[0] > 20.0 && up[1] > up[0] && down[0] < up[1] && down[1] < down[0], "{up:?} {down:?}");
    assert_eq!(applied(&mut queue, 5), [50.0]);
    assert_eq!(applied(&mut queue, 6), [0.0; 0]);
    sender.push(gradual(60.0)).unwrap();
    assert_eq!(applied(&mut queue, 7), [50.1], "from the value of the scene, not from that of the creation");
}

#[test]
fn a_refusal_ends_the_way_and_a_late_tick_takes_no_longer_step() {
    let (mut queue, mut sender, _reports) = ParameterQueue::new(Vec::new(), 0);
    sender.push(gradual(40.0)).unwrap();
    let mut steps = Vec::new();
    for index in 1..10 {
        let waiting = queue.waiting();
        let tick = Tick { index, time_ns: index * 1_000_000_000, dt_ns: 1_000_000_000 };
        queue.apply_due(&tick, waiting, |change| {
            steps.push(change.value);
            if change.value > 22.5 { CallStatus::OutOfRange } else { CallStatus::Ok }
        });
    }
    assert_eq!(steps, [21.0, 22.0, 23.0], "10 ms of a second, and nothing after the refusal");
}

/// Of a slow asynchronous model, whose orders are full for a while, and of two numbers whose values in between do not go
/// together until the other has moved on.
#[test]
fn a_number_that_is_refused_for_a_while_moves_on_and_nobody_hears_of_it() {
    let (mut queue, mut sender, mut reports) = ParameterQueue::new(Vec::new(), 0);
    sender.push(gradual(20.35)).unwrap();
    for index in 1..600 {
        let waiting = queue.waiting();
        queue.apply_due(&at(index), waiting, |_| {
            if (2..500).contains(&index) { CallStatus::Unsupported } else { CallStatus::Ok }
        });
    }
    let told: Vec<_> = std::iter::from_fn(|| reports.pop().ok()).collect();
    assert!(told.iter().all(|report| report.outcome == ChangeOutcome::Applied), "{told:?}");
    assert_eq!(told.last().map(|report| report.change.value), Some(20.35));
}

#[test]
fn a_number_that_is_refused_for_a_second_stays_and_its_sender_hears_of_it_once() {
    let (mut queue, mut sender, mut reports) = ParameterQueue::new(Vec::new(), 0);
    sender.push(gradual(40.0)).unwrap();
    for index in 1..3000 {
        let waiting = queue.waiting();
        queue.apply_due(&at(index), waiting, |_| CallStatus::OutOfRange);
    }
    let told: Vec<_> = std::iter::from_fn(|| reports.pop().ok()).map(|report| report.outcome).collect();
    assert_eq!(told, [ChangeOutcome::Refused]);
    assert!(!queue.is_due(&at(3001)));
}

#[test]
fn a_replaced_plugin_is_not_moved_any_more() {
    let (mut queue, mut sender, _reports) = ParameterQueue::new(Vec::new(), 0);
    sender.push(gradual(40.0)).unwrap();
    assert_eq!(applied(&mut queue, 1).len(), 1);
    queue.report_replaced(&at(2), PluginIndex::of_device(1), 4);
    assert_eq!(applied(&mut queue, 2), [0.0; 0]);
}
