//! What a picture makes anew, when there is none, and that memory stays.

use super::window::{self, Window, live, recording, until};
use crate::support::{plugin_file, spring_run, tick};
use egui::{Key, vec2};
use egui_kittest::kittest::Queryable;
use flotor_record::trace::Events;
use flotor_viewer::app::Start;
use flotor_viewer::history::{History, Keep};
use std::time::Duration;

/// What has not changed is not made again: while the mouse moves, no sample is looked at and no corner of a triangle is made;
/// a tick that comes is looked at once for each trace; a handle that rests costs no corner, whatever the time.
#[test]
fn a_picture_makes_what_is_new_and_nothing_else() {
    let work = |window: &Window<'_>| {
        let viewer = window.state();
        (viewer.plots().visited(), viewer.view().corners_made())
    };
    let mut window = recording();
    let before = work(&window);
    let area = window.get_by_label("Force over time, N").rect();
    for step in 0..20_u8 {
        window.hover_at(area.center() + vec2(4.0 * f32::from(step), 0.0));
        window.run_steps(1);
    }
    assert_eq!(work(&window), before, "a cursor that moves over a recording");
    window.key_press(Key::D);
    window.run_steps(2);
    let (visited, corners) = work(&window);
    assert!(visited == before.0 && corners > before.1, "a view that turns");

    let (mut window, mut host, _folder) = live(&[]);
    let traces = window.state().plots().shown.len() as u64;
    for new in [16, 1, 33] {
        let (visited, _) = work(&window);
        let last = window.state().history().len() + usize::try_from(new).expect("a few");
        host.run_ticks(new, Events::NONE);
        until(&mut window, |window| window.state().history().len() == last);
        window.run_steps(5);
        assert_eq!(work(&window).0, visited + traces * new, "{new} ticks");
    }

    let (run, _) = spring_run(&[]);
    let mut history = History::new(run, Keep::All);
    for number in 0..3000 {
        let mut resting = tick(number, Events::NONE);
        resting.pose = tick(250, Events::NONE).pose;
        resting.commanded = tick(250, Events::NONE).commanded;
        history.push(&resting);
    }
    let mut window =
        window::window(Start::Recording(Box::new(history), Some(0.0), vec![plugin_file("spring")]));
    window.run_steps(3);
    let before = work(&window);
    window.key_press(Key::Space);
    window.run_steps(30);
    assert!(window.state().player().now_s > 0.3, "it plays");
    assert_eq!(work(&window), before, "a handle that rests");
}

/// A window that nobody touches makes no pictures: what costs nothing costs no processor.
#[test]
fn a_recording_that_stands_still_asks_for_no_more_pictures() {
    let mut window = recording();
    window.run_steps(10);
    let delay = window.output().viewport_output.values().map(|viewport| viewport.repaint_delay).min();
    assert!(delay.is_none_or(|delay| delay > Duration::from_secs(60)), "{delay:?}");
}

/// The window itself under a stream: pictures are made while ticks come, an hour's worth at full size, half a minute's at quick, and
/// memory stays. What waits for a picture is bounded, so a window that makes none loses ticks and not memory.
#[test]
fn a_window_that_streams_does_not_grow() {
    let seconds = if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { 3600 } else { 30 };
    const STEP_S: u64 = 5;
    let (mut window, mut host, _folder) = live(&[]);
    let (mut before, mut sent) = (0, 1500);
    // The history holds a minute, and is filled first.
    for step in 0..(60 + seconds) / STEP_S {
        host.run_ticks(1000 * STEP_S, Events::NONE);
        sent += 1000 * STEP_S;
        until(&mut window, |window| {
            window.state().history().at(f64::INFINITY).is_some_and(|sample| sample.tick + 1 >= sent)
        });
        if step == 60 / STEP_S {
            before = resident_kib();
        }
    }
    assert_eq!(window.state().history().len(), 60_000);
    let grown = resident_kib().saturating_sub(before);
    assert!(
        grown < 32 * 1024,
        "{grown} KiB more after {seconds} s; other tests of this program allocate, too"
    );
}

/// An hour of a running host at full size, two minutes at quick: the history holds a minute, and memory stays.
#[test]
fn streaming_is_bounded() {
    let minutes = if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { 60 } else { 2 };
    let (run, _) = spring_run(&[]);
    let mut history = History::new(run, Keep::Newest(60_000));
    let feed = |history: &mut History, from: u64, count: u64| {
        (from..from + count).for_each(|number| history.push(&tick(number, Events::NONE)));
    };
    feed(&mut history, 0, 70_000);
    let before = resident_kib();
    feed(&mut history, 70_000, minutes * 60_000);
    assert_eq!(history.len(), 60_000);
    let grown = resident_kib().saturating_sub(before);
    assert!(
        grown < 32 * 1024,
        "{grown} KiB more after {minutes} minutes; other tests of this program allocate, too"
    );
}

fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux tells");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("it has a size");
    line.trim().trim_end_matches("kB").trim().parse().expect("a number of KiB")
}
