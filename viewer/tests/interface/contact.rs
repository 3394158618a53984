//! The contact of a handle with a wall: its depth as a number, over the same depth of the handle.

use super::texts::texts;
use super::window::{Window, window};
use crate::support::{model_run, plugin_file, tick};
use flotor_core::trace::Events;
use flotor_history::{History, Retention};
use flotor_viewer::app::{Recorded, Start};

/// A window on a moment, s, of a handle that dips 4 mm into a wall within half a second.
fn at_a_wall<'a>(at_s: f64) -> Window<'a> {
    let (run, _) = model_run("wall", &[]);
    let mut history = History::new(run, Retention::All);
    (0..1000).for_each(|number| history.push(&tick(number, Events::NONE)));
    let recorded = Recorded { at_s: Some(at_s), ..Recorded::new(vec![history], vec![plugin_file("wall")]) };
    let mut window = window(Start::Recording(recorded));
    window.run_steps(3);
    window
}

fn depth_text(window: &Window<'_>) -> Option<String> {
    texts(window.output()).into_iter().map(|text| text.words).find(|words| words.contains("normal, depth"))
}

#[test]
fn a_handle_in_a_wall_shows_its_depth_and_one_on_its_surface_no_contact() {
    assert_eq!(depth_text(&at_a_wall(0.5)).as_deref(), Some("point of contact and normal, depth 4.000 mm"));
    assert_eq!(depth_text(&at_a_wall(0.0)), None);
}
