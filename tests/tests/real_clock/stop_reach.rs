//! The time in which an emergency stop of a run reaches the device of another one, by the logs of both.

use crate::board::{Board, PAST, Where, dies, run_on};
use flotor_tests::TestSize;
use flotor_tests::program::{Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools;
use rustix::process::Signal;
use std::process::Command;
use std::time::{Duration, Instant};

/// Room on the disk of the run folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Disk {
    WithRoom,
    Full,
}

/// Time of the stop in the summary of a run, ms, which names a stop that took longer than the bound.
fn reported_ms(ran: &Ran) -> f64 {
    let row = ran.stdout.lines().find_map(|line| line.trim_start().strip_prefix("stop "));
    let ms = row.and_then(|row| row.split_whitespace().next()?.parse().ok());
    let ms = ms.unwrap_or_else(|| panic!("the summary has no time of the stop: {ran:?}"));
    let is_named = ran.stdout.contains("the emergency stop took longer than 20.0 ms");
    // A row has one digit after the point.
    assert!(is_named == (ms > 20.0) || ms == 20.0, "{ran:?}");
    ms
}

/// Stops the first of two runs whose folder is on a disk of its own; returns the time from the stop to the first command without force
/// of either device.
fn stop_times(disk: Disk) -> [Duration; 2] {
    let (boards, scratches) = ([Board::start(), Board::start()], [Scratch::default(), Scratch::default()]);
    let runtime = scratches[0].folder("runtime").display().to_string();
    // Only this script sees the disk; the file tells the others where it is.
    let script = format!(
        "mount -t tmpfs -o size=64k,mode=700 tmpfs {runtime} && mkdir -m 700 {runtime}/flotor && exec \"$@\""
    );
    let first = run_on(&boards[0], &scratches[0], dies(), Where::InTheHost);
    let first = first.env("XDG_RUNTIME_DIR", &runtime);
    let first = first.through_shell(&format!("exec unshare -rm sh -c '{script}' sh \"$@\"")).start();
    boards[0].wait_for_force(PAST);
    let disk_of_first = format!("/proc/{}/root{runtime}", first.pid().as_raw_nonzero());
    let second = run_on(&boards[1], &scratches[1], dies(), Where::InTheHost);
    let second = second.env("XDG_RUNTIME_DIR", &disk_of_first).start();
    boards[1].wait_for_force(PAST);
    if disk == Disk::Full {
        let fill = std::fs::write(format!("{disk_of_first}/flotor/fill"), vec![0; 1 << 20]);
        assert!(fill.is_err(), "the disk is full");
    }
    let since = Instant::now();
    first.signal(Signal::USR1);
    let times = boards.each_ref().map(|board| board.assert_stopped_since(since, "the emergency stop"));
    let [first, second] = [first.wait(), second.wait()];
    assert_eq!(first.code, Some(exit_code::DEVICE_FAULT), "{first:?}");
    let all = "all runs of this machine are stopped, and none starts until `flotor release`";
    assert!(first.stderr.contains(all), "{first:?}");
    assert_eq!(second.code, Some(exit_code::DEVICE_FAULT), "{second:?}");
    println!(
        "{disk:?}: own run {} ms, other run {} ms by their summaries",
        reported_ms(&first),
        reported_ms(&second)
    );
    times
}

/// The bound of a stop where a machine with a disk that has room is faster.
const IN_TIME: Duration = Duration::from_millis(20);

#[test]
fn a_stop_on_a_full_disk_takes_no_longer_than_on_one_with_room() {
    let has = Command::new("unshare").args(["-rm", "true"]).status().is_ok_and(|status| status.success());
    if !has {
        tools::skipped("there are no namespaces for this user");
        return;
    }
    let _turn = crate::alone();
    let trials = TestSize::of_this_run().pick(3, 20);
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..trials {
        for (disk, times) in [Disk::WithRoom, Disk::Full].into_iter().zip(&mut times) {
            let [own, other] = stop_times(disk);
            println!("{disk:?}: own device {own:?}, other device {other:?}");
            times.push(own.max(other));
        }
    }
    times.iter_mut().for_each(|times| times.sort_unstable());
    let [with_room, full] = times.each_ref().map(|times| times[trials / 2]);
    println!(
        "median {full:?}, with room {with_room:?}; largest {:?}, {:?}",
        times[1].last(),
        times[0].last()
    );
    assert!(full <= IN_TIME.max(2 * with_room), "{times:?}");
}
