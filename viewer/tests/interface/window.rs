//! The window under test: on a recording, or on a host that is none.

use crate::support::{FakeHost, PATIENCE, plugin_file, spring_run, tick};
use egui::vec2;
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use flotor_core::trace::Events;
use flotor_history::{History, Retention};
use flotor_live::Ask;
use flotor_viewer::app::{Recorded, RunSelection, Start, Viewer};
use flotor_viewer::palette::Look;
use std::time::{Duration, Instant};

/// The interface as a test sees it.
pub(crate) type Window<'a> = Harness<'a, Viewer>;

/// A window of the usual size.
pub(crate) fn window<'a>(start: Start) -> Window<'a> {
    let harness = Harness::builder().with_size(vec2(1280.0, 800.0)).with_step_dt(1.0 / 60.0);
    harness.build_eframe(|creation| {
        let device = creation.wgpu_render_state.clone();
        Viewer::new(&creation.egui_ctx, device.as_ref(), start, Look::Dark)
    })
}

/// A recording of so many ticks, beginning at a moment.
pub(crate) fn recorded(ticks: u64, at_s: Option<f64>) -> Start {
    let (run, _) = spring_run(&[]);
    let mut history = History::new(run, Retention::All);
    (0..ticks).for_each(|number| history.push(&tick(number, Events::NONE)));
    Start::Recording(Recorded { at_s, ..Recorded::new(vec![history], vec![plugin_file("spring")]) })
}

/// A window on three seconds of a recording.
pub(crate) fn recording<'a>() -> Window<'a> {
    let mut window = window(recorded(3000, Some(0.5)));
    window.run_steps(3);
    window
}

/// A window on a fake host that has run for a while.
pub(crate) fn live<'a>(settings: &[(&str, &str)]) -> (Window<'a>, FakeHost, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut host = FakeHost::new(&folder, settings);
    let mut window = host.welcome(|directory| window(Start::Live(RunSelection::newest(directory.clone()))));
    assert_eq!(host.request(None), Ask::Watch { every: 1 });
    host.run_ticks(1500, Events::NONE);
    until(&mut window, |window| window.state().history().len() >= 1500);
    window.run_steps(2);
    (window, host, folder)
}

/// Makes pictures until something is true.
pub(crate) fn until(window: &mut Window<'_>, mut is_true: impl FnMut(&Window<'_>) -> bool) {
    let end = Instant::now() + PATIENCE;
    while !is_true(window) {
        if Instant::now() >= end {
            let warned: Vec<String> = window
                .query_all_by_label_contains("⚠")
                .filter_map(|node| node.accesskit_node().label())
                .collect();
            panic!("it does not happen; warned of {warned:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
        window.run_steps(1);
    }
}

/// The same while ticks come: on a machine with other things to do a second may pass between two pictures, and what is shown is then
/// rightly called old.
pub(crate) fn until_fresh(
    window: &mut Window<'_>,
    host: &mut FakeHost,
    is_true: impl Fn(&Window<'_>) -> bool,
) {
    until(window, |window| {
        let is_true = is_true(window);
        if !is_true {
            host.run_ticks(1, Events::NONE);
        }
        is_true
    });
}
