//! A recording opened in the window: dropped on it, named in the field, or one of the latest.

use super::window::{Window, live, until_fresh, window};
use crate::support::display::alone;
use crate::support::plugin_file;
use egui::Key;
use egui::accesskit::Role;
use egui_kittest::kittest::Queryable;
use flotor_history::History;
use flotor_viewer::app::{RunSelection, Start};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A recording of half a second of the demo.
pub(super) fn recording(folder: &Path) -> PathBuf {
    let file = folder.join("run.mcap");
    let mut run = alone("flotor", folder, None);
    run.args(["run", "--clock", "virtual", "--duration", "500ms", "--record"]).arg(&file);
    let output = run.output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    file
}

/// A file of this machine that is dropped on a window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

pub(super) fn drop_on(window: &mut Window<'_>, file: &Path) {
    window.input_mut().dropped_files.push(Arc::new(Dropped(file.to_path_buf())));
    window.run_steps(3);
}

/// A window without a run.
fn empty<'a>(folder: &Path) -> Window<'a> {
    let wanted = RunSelection::newest(flotor_live::Directory::at(folder));
    let mut window = window(Start::Live(RunSelection { plugins: vec![plugin_file("spring")], ..wanted }));
    window.run_steps(2);
    window
}

#[test]
fn a_recording_dropped_on_an_empty_window_is_opened_and_offered_by_the_next_window() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let file = recording(folder.path());
    let mut window = empty(folder.path());
    drop_on(&mut window, &file);
    assert_eq!(window.state().history().len(), 500);
    window.get_by_label("recording");
    // A second recording lies over the first.
    assert!(window.state().compared().is_none());
    drop_on(&mut window, &file);
    let compared = window.state().compared().and_then(|compared| compared.history(0));
    assert_eq!(compared.map(History::len), Some(500));
    window.get_by_label_contains("Dashed: run.mcap, 1000 Hz, 0.499 s");
    // Its curve of force over position too, with numbers of its own.
    window.get_by_role_and_label(Role::Button, "F(x)").click();
    window.run_steps(2);
    let dashed = |window: &Window<'_>| window.query_all_by_label_contains("  ·  dashed: ").next().is_some();
    assert!(dashed(&window));
    assert_eq!(window.state().history().len(), 500);
    window.key_press(Key::Escape);
    window.run_steps(2);
    assert!(window.state().compared().is_none() && !dashed(&window));
    let saved_settings = window.state().settings();
    assert_eq!(saved_settings.latest, [file]);
    let mut next = empty(folder.path());
    let context = next.ctx.clone();
    next.state_mut().restore(&context, &saved_settings);
    next.run_steps(2);
    next.get_by_label("run.mcap").click();
    next.run_steps(3);
    assert_eq!(next.state().history().len(), 500);
}

#[test]
fn a_recording_is_opened_by_its_path_and_a_missing_one_is_a_warning() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let file = recording(folder.path());
    let mut window = empty(folder.path());
    let open = |window: &mut Window<'_>, path: &Path| {
        window.get_by_role_and_label(Role::TextInput, "Path of a recording").click();
        window.run_steps(1);
        window.key_press_modifiers(egui::Modifiers::COMMAND, Key::A);
        window.event(egui::Event::Text(path.display().to_string()));
        window.run_steps(1);
        window.key_press(Key::Enter);
        window.run_steps(3);
    };
    open(&mut window, &folder.path().join("missing.mcap"));
    window.get_by_label_contains("missing.mcap");
    assert!(window.state().history().is_empty());
    open(&mut window, &file);
    assert_eq!(window.state().history().len(), 500);
}

#[test]
fn a_running_session_stays_in_sight_whatever_is_dropped() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let file = recording(folder.path());
    let (mut window, mut host, _folder) = live(&[]);
    until_fresh(&mut window, &mut host, |window| window.query_by_label("running").is_some());
    drop_on(&mut window, &file);
    assert!(window.state().history().len() >= 1500);
    assert!(window.state().compared().is_some(), "it lies over the session");
    window.get_by_label("EMERGENCY STOP");
}
