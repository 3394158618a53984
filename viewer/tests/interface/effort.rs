//! What a picture makes anew, and when there is none.

use super::window::{self, Window, live, recording, until};
use crate::support::{plugin_file, spring_run, tick};
use egui::{Key, vec2};
use egui_kittest::kittest::Queryable;
use flotor_core::trace::Events;
use flotor_history::{History, Retention};
use flotor_viewer::app::{Recorded, Start};
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
    let mut history = History::new(run, Retention::All);
    for number in 0..3000 {
        let mut resting = tick(number, Events::NONE);
        resting.pose = tick(250, Events::NONE).pose;
        resting.commanded = tick(250, Events::NONE).commanded;
        history.push(&resting);
    }
    let mut window = window::window(Start::Recording(Recorded {
        at_s: Some(0.0),
        ..Recorded::new(vec![history], vec![plugin_file("spring")])
    }));
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
