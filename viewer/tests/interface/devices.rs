//! A run of two devices: both are drawn with their names, and either can be looked at.

use super::window::window;
use crate::support::{spring_run, tick};
use egui::Key;
use egui::accesskit::Role;
use egui_kittest::kittest::Queryable;
use flotor_core::trace::Events;
use flotor_history::{History, Retention};
use flotor_record::{Role as PluginRole, RunDescription};
use flotor_viewer::app::{Recorded, Start};

/// Two devices without a model, the second of which is pressed twice as hard.
fn two_hands() -> Vec<History> {
    let (mut run, _) = spring_run(&[]);
    run.plugins.retain(|plugin| plugin.role == PluginRole::Device);
    let mut second = run.plugins[0].clone();
    (run.plugins[0].name, second.name, second.device) = ("left".to_owned(), "right".to_owned(), 1);
    run.plugins.push(second);
    histories(&run)
}

fn histories(run: &RunDescription) -> Vec<History> {
    let mut histories = History::of_each_device(run, Retention::All);
    for number in 0..1000 {
        let mut record = tick(number, Events::NONE);
        histories.iter_mut().for_each(|history| history.push(&record));
        record.device = 1;
        record.commanded.force_n[2] *= 2.0;
        if number == 500 {
            record.events = Events::FORCE_LIMITED;
        }
        histories.iter_mut().for_each(|history| history.push(&record));
    }
    histories
}

#[test]
fn each_of_two_devices_has_its_name_and_can_be_looked_at() {
    let mut window =
        window(Start::Recording(Recorded { at_s: Some(0.5), ..Recorded::new(two_hands(), Vec::new()) }));
    window.run_steps(3);
    let force_n = |window: &super::window::Window<'_>| {
        let viewer = window.state();
        viewer.history().at(0.5).expect("a sample").force_n().z
    };
    assert_eq!(window.state().devices().names().collect::<Vec<_>>(), ["left", "right"]);
    assert_eq!(window.state().history().len(), 1000, "ticks of one device are not those of the other");
    window.get_by_label("left: Force over time, N");
    window.get_by_label_contains("Excess force: limited by the envelope; push less (right)");
    let left_n = force_n(&window);
    window.get_by_role_and_label(Role::Button, "right").click();
    window.run_steps(2);
    window.get_by_label("right: Force over time, N");
    assert!((force_n(&window) - 2.0 * left_n).abs() < 1.0e-5);
    window.key_press(Key::Num1);
    window.run_steps(2);
    window.get_by_label("left: Force over time, N");
}
