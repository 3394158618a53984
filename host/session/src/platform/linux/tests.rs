//! Tests of [`PluginProcess`] with processes that only Linux ends.

use crate::PluginProcess;
use rustix::process::{Pid, test_kill_process};
use std::io::{BufRead, BufReader, Read};
use std::process::{ChildStdout, Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

/// Timeout for the end of a process.
const FOR_EVER: Duration = Duration::from_secs(120);

/// A shell that starts a process which ignores every request to end, prints its number, and goes on with `then`.
fn shell(then: &str) -> (PluginProcess, Pid, BufReader<ChildStdout>) {
    let script = format!("(trap '' HUP INT TERM; while :; do sleep 600; done) & echo $!; {then}");
    let mut command = Command::new("sh");
    let mut process =
        PluginProcess::start(command.args(["-c", &script]).stdout(Stdio::piped())).expect("there is a shell");
    let mut output = BufReader::new(process.child.stdout.take().expect("it is piped"));
    let mut line = String::new();
    output.read_line(&mut line).expect("the shell prints a line");
    let started = line.trim().parse().ok().and_then(Pid::from_raw).expect("a number");
    (process, started, output)
}

/// Waits for the end of a process: the last that holds the pipe.
fn is_over(mut output: BufReader<ChildStdout>) -> bool {
    let (sender, over) = channel();
    std::thread::spawn(move || sender.send(output.read_to_end(&mut Vec::new()).is_ok()));
    over.recv_timeout(FOR_EVER).is_ok_and(|is_ok| is_ok)
}

#[test]
fn the_end_of_a_process_is_the_end_of_all_that_it_started() {
    let (mut ended, _, output) = shell("exit 7");
    assert_eq!(ended.wait().expect("it is ours").code(), Some(7));
    assert_eq!(ended.try_wait().expect("it is known").and_then(|status| status.code()), Some(7));
    assert!(is_over(output));
    let (mut killed, started, output) = shell("sleep 600");
    assert!(killed.try_wait().expect("it is ours").is_none() && test_kill_process(started).is_ok());
    killed.kill().expect("it is ours");
    assert!(is_over(output));
    let (dropped, _, output) = shell("sleep 600");
    drop(dropped);
    assert!(is_over(output));
}

#[test]
fn a_process_and_all_that_it_started_end_with_the_thread_that_started_it() {
    let thread = || shell("sleep 600");
    let (mut process, _, output) =
        std::thread::scope(|scope| scope.spawn(thread).join()).expect("the thread only starts it");
    assert!(is_over(output));
    assert!(process.wait().expect("it is ours").code().is_none(), "a signal ended it");
}

/// A plugin that waits for any child finds none: the guard of the group is none of its children.
#[test]
fn a_process_has_no_child_that_it_did_not_start() {
    let mut command = Command::new("python3");
    let waits = "import os\ntry: os.wait()\nexcept ChildProcessError: raise SystemExit(7)";
    match PluginProcess::start(command.args(["-c", waits])) {
        Ok(mut process) => assert_eq!(process.wait().expect("it is ours").code(), Some(7)),
        Err(error) => println!("skipped: python3: {error}"),
    }
}
