//! A run on a machine that gives it no more memory and no more threads: it ends as usual, or does not begin.

use crate::board::{Board, PAST, Where, dies, recorded_ticks, run_on};
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::side_by_side::show_each;
use rustix::process::{Pid, Resource, Rlimit, Signal, geteuid, prlimit};
use std::io::Write;
use std::os::unix::fs::{PermissionsExt, chown};
use std::process::Command;

/// A user who has no other process.
const STRANGER: u32 = 61_234;

/// Sets a limit of a running process.
fn limit(process: Pid, resource: Resource, most: u64) {
    let limit = Rlimit { current: Some(most), maximum: Some(most) };
    prlimit(Some(process), resource, limit).expect("it is ours");
}

/// Size of the address space of a process, bytes.
fn address_space(process: Pid) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.as_raw_nonzero()));
    let status = status.expect("it runs");
    let line = status.lines().find_map(|line| line.strip_prefix("VmSize:")).expect("it is in there");
    line.trim().trim_end_matches(" kB").parse::<u64>().expect("a number") * 1024
}

/// First words of the lines of a summary.
fn summary_of(ran: &Ran) -> Vec<&str> {
    ran.stdout.lines().filter_map(|line| line.split_whitespace().next()).collect()
}

/// Ends a run in order, after `prepare` has been given its host; the summary, and how many ticks are in its recording.
fn ended(prepare: impl FnOnce(Pid)) -> (Ran, usize) {
    let (board, scratch) = (Board::start(), Scratch::default());
    let running = run_on(&board, &scratch, dies(), Where::InTheHost).start();
    board.wait_for_force(PAST);
    prepare(running.host());
    running.signal(Signal::INT);
    let ran = running.wait();
    let _ = board.assert_stopped("the end");
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    (ran, recorded_ticks(&scratch))
}

#[test]
fn the_end_of_a_run_needs_no_new_memory() {
    let _turn = crate::alone();
    let (usual, _) = ended(|_| ());
    let (ran, ticks) = ended(|host| limit(host, Resource::As, address_space(host)));
    assert!(ticks > PAST, "{ticks} ticks are recorded");
    assert_eq!(summary_of(&ran), summary_of(&usual), "{ran:?}");
    assert!(summary_of(&ran).contains(&"digest"), "{ran:?}");
}

/// Takes the room for threads and for memory from a process of the stranger.
fn limit_of_stranger(process: Pid) {
    let (number, space) = (process.as_raw_nonzero(), address_space(process));
    let prlimit = format!("prlimit --pid {number} --nproc=1 --as={space}");
    let mut command = Command::new("setpriv");
    let user = format!("--reuid {STRANGER} --regid {STRANGER} --clear-groups {prlimit}");
    let status = command.args(user.split(' ')).status().expect("there is `setpriv`");
    assert!(status.success(), "{status}");
}

/// Gives a folder to the stranger; returns the start of a script that carries out a command there as this user.
pub(crate) fn become_stranger(scratch: &Scratch) -> String {
    let folder = scratch.path().display().to_string();
    chown(scratch.path(), Some(STRANGER), Some(STRANGER)).expect("root may");
    std::fs::set_permissions(scratch.path(), std::fs::Permissions::from_mode(0o700)).expect("root may");
    format!(
        "cd {folder} && export XDG_RUNTIME_DIR={folder} && exec setpriv --reuid {STRANGER} --regid {STRANGER} --clear-groups"
    )
}

/// The program as a user who may have so many processes and threads.
fn as_a_user_with(threads: u32, arguments: &[&str]) -> (Scratch, Flotor) {
    let scratch = Scratch::default();
    let user = become_stranger(&scratch);
    let flotor = Flotor::with(arguments).through_shell(&format!("{user} prlimit --nproc={threads} \"$@\""));
    (scratch, flotor)
}

pub(crate) fn may_be_another_user() -> bool {
    let may = geteuid().is_root();
    if !may {
        let _ = writeln!(std::io::stderr(), "skipped: a command as another user: needs root");
    }
    may
}

#[test]
fn a_user_without_room_for_its_threads_gets_a_refusal_and_no_panic() {
    if !may_be_another_user() {
        return;
    }
    let _turn = crate::alone();
    let run = ["run", "--duration", "0.2"];
    let mut refused = 0;
    let commands: [&[&str]; 3] = [&run, &["bench", "--tick"], &["jitter", "--duration", "2s"]];
    for command in commands {
        // Up to the room that the command needs.
        for threads in 1..20 {
            let (_scratch, flotor) = as_a_user_with(threads, command);
            let ran = flotor.run();
            assert!(!ran.stderr.contains("panicked"), "room for {threads}: {command:?}: {ran:?}");
            if ran.code == Some(exit_code::OK) {
                break;
            }
            refused += 1;
            let is_clear = |line: &str| line.starts_with("error: ") && line.contains("ulimit -u");
            assert!(ran.stderr.lines().any(is_clear), "room for {threads}: {command:?}: {ran:?}");
        }
    }
    assert!(refused > 3, "{refused}");
}

#[test]
fn the_end_of_a_run_needs_no_new_thread() {
    if !may_be_another_user() {
        return;
    }
    let _turn = crate::alone();
    show_each(&["real", "virtual"], |clock| {
        let arguments = ["run", "--duration", "1000h", "--clock", clock, "--record", "run.mcap"];
        let (scratch, flotor) = as_a_user_with(64, &arguments);
        let running = flotor.start();
        let file = scratch.path().join("run.mcap");
        crate::board::wait_until("it records", || {
            std::fs::metadata(&file).is_ok_and(|file| file.len() > 200_000)
        });
        limit_of_stranger(running.host());
        running.signal(Signal::INT);
        let ran = running.wait();
        assert_eq!(ran.code, Some(exit_code::OK), "{clock}: {ran:?}");
        let replayed = Flotor::with(["replay".as_ref(), file.as_os_str()]).run();
        assert_eq!(replayed.code, Some(exit_code::OK), "{clock}: {replayed:?}");
        assert!(!replayed.stdout.contains("truncated"), "{clock}: {replayed:?}");
    });
}
