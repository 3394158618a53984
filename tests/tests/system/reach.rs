//! A spring ends where its coils touch: there is a wall, where the mapping puts it, and it moves with the spring.

use flotor_core::trace::{Events, TickRecord};
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::watch;
use std::ffi::OsStr;

/// Motion of the model for that of the hand: brings the end well inside the range of the device.
const MOTION_SCALE: f64 = 5.0;
/// Coils lying on each other, m: 11.8 turns of 0.63 mm.
const SOLID_M: f64 = 11.8 * 0.63e-3;
/// Stiffness of hand and wall, N/m.
const HAND_N_PER_M: f64 = 2000.0;
const WALL_N_PER_M: f64 = 10_000.0;
/// Intended position of the hand, m below home.
const MEANT_M: f64 = 8.0e-3;

/// A hand that presses down and stays there, for `duration_s`; settings of the spring, further tables of the scene.
fn pressed(duration_s: f64, spring: &str, tables: &str) -> String {
    format!(
        "duration_s = {duration_s}\n[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"press\"\n\
         hand_depth_mm = 8\n[[model]]\nplugin = \"spring\"\n[model.parameters]\n{spring}\n\
         [model.mapping]\nmotion_scale = {MOTION_SCALE}\nforce_scale = 0.2\n{tables}"
    )
}

fn depth_m(record: &TickRecord) -> f64 {
    -record.pose.position().z
}

/// The end in the device frame, m below home.
fn end_m(free_length_m: f64) -> f64 {
    (free_length_m - SOLID_M) / MOTION_SCALE
}

fn is_at_the_wall(record: &TickRecord) -> bool {
    record.events.intersects(Events::BOUNDARY)
}

#[test]
fn a_hand_that_presses_meets_a_wall_where_the_coils_touch() {
    let run = watch(&pressed(3.0, "", ""));
    let end_m = end_m(25.0e-3);
    for record in &run.records {
        assert_eq!(is_at_the_wall(record), depth_m(record) > end_m, "tick {}", record.tick);
    }
    let last = run.records.last().expect("ticks");
    let depth_m = depth_m(last) - end_m;
    // The hand carries wall and spring: without the spring it would be this deep.
    let deepest_m = HAND_N_PER_M * (MEANT_M - end_m) / (HAND_N_PER_M + WALL_N_PER_M);
    assert!(depth_m > 0.5 * deepest_m && depth_m < deepest_m, "{depth_m} m of {deepest_m} m");
    let worst = run.records.iter().map(self::depth_m).fold(0.0, f64::max) - end_m;
    assert!(worst < 2.0 * deepest_m, "{worst} m on the way there");
}

#[test]
fn a_spring_whose_coils_press_on_each_other_needs_none() {
    let run = watch(&pressed(2.0, "coil_contact = \"on\"", ""));
    assert!(!run.records.iter().any(is_at_the_wall));
    assert!(depth_m(run.records.last().expect("ticks")) > end_m(25.0e-3), "it is past where they touch");
}

#[test]
fn it_moves_with_the_spring() {
    let run = watch(&pressed(4.0, "", "[[change]]\nat_s = 2\nset = \"spring.free_length_mm=30\"\n"));
    for record in run.records.iter().filter(|record| record.tick != 2000) {
        let end_m = end_m(if record.tick < 2000 { 25.0e-3 } else { 30.0e-3 });
        assert_eq!(is_at_the_wall(record), depth_m(record) > end_m, "tick {}", record.tick);
    }
    assert!(is_at_the_wall(run.records.last().expect("ticks")), "and the hand follows it there");
}

#[test]
fn a_replay_meets_the_same_wall() {
    let scratch = Scratch::default();
    let scene = scratch.file("scene.toml", pressed(2.0, "", ""));
    let recording = scratch.path().join("run.mcap");
    let [clock, kind, record] = ["--clock", "virtual", "--record"].map(OsStr::new);
    let run = [OsStr::new("run"), scene.as_ref(), clock, kind, record, recording.as_ref()];
    let ran = Flotor::with(run).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let ran = Flotor::with([OsStr::new("replay"), recording.as_ref()]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
}
