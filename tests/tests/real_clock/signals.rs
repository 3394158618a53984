//! Signals stay the host's, whatever a plugin does: the first ends a run in order, and nothing holds it up for long.

use crate::board::{Board, PAST, Where, children_of, dies, mark_in, run_on, wait_until};
use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::side_by_side::show_each;
use rustix::process::{Signal, test_kill_process};
use std::time::Duration;

#[test]
fn signals_stay_the_hosts_whatever_a_plugin_does() {
    let _turn = crate::among_idle_ones();
    let signals = [
        (Signal::INT, exit_code::OK),
        (Signal::TERM, exit_code::OK),
        (Signal::USR1, exit_code::DEVICE_FAULT),
    ];
    let takings = ["handlers-in-create", "blocks-in-create", "handlers-in-step"];
    let all = takings.iter().flat_map(|taking| signals.map(|signal| (*taking, signal)));
    // One in four: each of the three of both.
    let step = TestSize::of_this_run().pick(4, 1);
    let cases: Vec<_> = all.step_by(step).collect();
    show_each(&cases, |(taking, (signal, code))| {
        let (board, scratch) = (Board::start(), Scratch::default());
        let run = run_on(&board, &scratch, dies(), Where::InTheHost);
        let running = run.env("FIXTURE_DEATH", taking).start();
        board.wait_for_force(PAST);
        running.signal(*signal);
        let ran = running.wait();
        assert_eq!(ran.code, Some(*code), "{taking}, {signal:?}: {ran:?}");
        let _ = board.assert_stopped(taking);
        // What `create` blocks is blocked in its own thread only, which has ended.
        let who = match *taking {
            "handlers-in-create" => "`culprit` replaced ",
            "handlers-in-step" => "a plugin replaced ",
            _ => return,
        };
        let notes: Vec<&str> = ran.stderr.lines().filter(|line| line.starts_with("note: ")).collect();
        let named = |line: &&&str| line.contains(who) && line.contains("SIGINT, SIGTERM");
        assert_eq!(notes.iter().filter(named).count(), 1, "{taking}, {signal:?}: {ran:?}");
        let warned = ran.stdout.lines().any(|line| line.contains("warning") && line.contains(who));
        assert!(warned, "{taking}, {signal:?}: {ran:?}");
    });
}

#[test]
fn before_anything_is_energised_the_first_signal_ends_the_process() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let _turn = crate::among_idle_ones();
    show_each(&[Where::InTheHost, Where::InAProcess], |place| {
        let (board, scratch) = (Board::start(), Scratch::default());
        let run = run_on(&board, &scratch, dies(), *place);
        let running = run.env("FIXTURE_DEATH", "loop-in-create").start();
        wait_until("the model is being made", || mark_in(&scratch).exists());
        let children = children_of(running.host());
        running.signal(Signal::INT);
        let ran = running.wait();
        assert_eq!(ran.code, Some(130), "{ran:?}");
        for child in children {
            wait_until("its worker is gone", || test_kill_process(child).is_err());
        }
    });
}

#[test]
fn after_a_second_signal_nothing_holds_the_process_for_long() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let _turn = crate::among_idle_ones();
    let scratch = Scratch::default();
    let scene = format!(
        "duration_s = 60\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"{}\"\n",
        dies().display()
    );
    let scene = scratch.file("scene.toml", scene);
    // Without a limit of a step the loop would hang for good.
    let run = Flotor::with(["run".as_ref(), scene.as_os_str(), "--clock".as_ref(), "virtual".as_ref()]);
    let run = run.env("FIXTURE_MARK", &mark_in(&scratch).display().to_string());
    let run = run.env("FLOTOR_STEP_LIMIT_S", "600");
    let running = run.env("FIXTURE_DEATH", "loop-in-step").start();
    wait_until("the model loops", || mark_in(&scratch).exists());
    running.signal(Signal::INT);
    std::thread::sleep(Duration::from_millis(200)); // another request
    running.signal(Signal::INT);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
    assert!(ran.stderr.contains("did not return from `step`"), "{ran:#?}");
}
