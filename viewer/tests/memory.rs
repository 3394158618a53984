//! That memory stays while a run streams: a program of its own, for a process has one size, whoever in it allocates.

mod support;
#[allow(dead_code)] // the tests of the interface use the rest
#[path = "interface/window.rs"]
mod window;

use flotor_core::trace::Events;
use flotor_history::{History, Retention};
use std::sync::{Mutex, MutexGuard, PoisonError};
use support::{spring_run, tick};
use window::{live, until};

/// An hour of records is 1.1 GB; an allocator may keep some of what it was given back.
const MOST_KIB: u64 = 32 * 1024;

/// One test at a time.
fn alone() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The window itself under a stream: pictures are made while ticks come, an hour's worth at full size, half a minute's at quick, and
/// memory stays. What waits for a picture is bounded, so a window that makes none loses ticks and not memory.
#[test]
fn a_window_that_streams_does_not_grow() {
    let _turn = alone();
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
    assert!(grown < MOST_KIB, "{grown} KiB more after {seconds} s");
}

/// An hour of a running host at full size, two minutes at quick: the history holds a minute, and memory stays.
#[test]
fn streaming_is_bounded() {
    let _turn = alone();
    let minutes = if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { 60 } else { 2 };
    let (run, _) = spring_run(&[]);
    let mut history = History::new(run, Retention::Newest(60_000));
    let feed = |history: &mut History, from: u64, count: u64| {
        (from..from + count).for_each(|number| history.push(&tick(number, Events::NONE)));
    };
    feed(&mut history, 0, 70_000);
    let before = resident_kib();
    feed(&mut history, 70_000, minutes * 60_000);
    assert_eq!(history.len(), 60_000);
    let grown = resident_kib().saturating_sub(before);
    assert!(grown < MOST_KIB, "{grown} KiB more after {minutes} minutes");
}

fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux tells");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("it has a size");
    line.trim().trim_end_matches("kB").trim().parse().expect("a number of KiB")
}
