//! An emergency stop on a machine that lacks what it usually needs: room, descriptors, permissions, a folder and numbers of its own.
//!
//! Two runs; one is stopped by a signal. The other stops, too, and a later one is refused; or the first says what it has not reached.

use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools;
use std::process::Command;

/// What every run of this machine says once all are stopped.
const ALL: &str = "all runs of this machine are stopped, and none starts until `flotor release`";
/// Note of a run whose stop all runs have confirmed, but whose latch cannot be written.
const ALL_BUT_LATER: &str =
    "all runs found on this machine are stopped, but the emergency stop does not prevent a later run";
/// What a run says that knows of no other.
const ONE: &str = "the emergency stop is confirmed for this run only";
/// What a run says before it energises a device.
const UNKEPT: &str = "an emergency stop of this run is not stored and may not reach other runs";

/// Exit code and standard error of three runs: the one that is stopped, the other, and one started afterwards.
struct Three {
    first: (i32, String),
    second: (i32, String),
    later: (i32, String),
}

/// Runs two scenes in a mount namespace, waits until both have their sockets, and stops the first. `before` is a script before the
/// start, `between` one before the stop, in which `$first` is the process; both are in the run folder.
fn three(before: &str, between: &str) -> Three {
    let scratch = Scratch::default();
    let scene = scratch.patient_scene(flotor_session::scene::DEMO);
    let script = format!(
        "out=$1; shift
         cd $XDG_RUNTIME_DIR; mkdir -m 700 flotor
         {before}
         \"$@\" --duration 60s >/dev/null 2>$out/first & first=$!
         \"$@\" --duration 60s >/dev/null 2>$out/second & second=$!
         for i in $(seq 600); do [ $(ls flotor | grep -c run$) = 2 ] && break; sleep 0.1; done
         sleep 1
         {between}
         kill -USR1 $first
         wait $first; echo $?
         ( sleep 20; kill -INT $second ) >/dev/null 2>&1 & limit=$!
         wait $second; echo $?
         kill $limit
         \"$@\" --duration 0.1s >/dev/null 2>$out/later; echo $?"
    );
    let (script, out) = (scratch.file("three.sh", script), scratch.folder("out"));
    let (shell, runtime) = (
        format!("exec unshare -rm sh {} {} \"$@\"", script.display(), out.display()),
        scratch.folder("runtime"),
    );
    let arguments = ["run", &scene.display().to_string()];
    let flotor = Flotor::with(arguments).env("XDG_RUNTIME_DIR", &runtime.display().to_string());
    let ran = flotor.through_shell(&shell).run();
    let mut codes = ran.stdout.lines().map(|line| line.parse().expect("an exit code"));
    let mut of = |name: &str| {
        let code = codes.next().unwrap_or_else(|| panic!("{name}: {ran:?}"));
        (code, std::fs::read_to_string(out.join(name)).expect("the script wrote it"))
    };
    Three { first: of("first"), second: of("second"), later: of("later") }
}

/// Whether this machine gives a user namespaces of mounts and processes.
fn has_namespaces() -> bool {
    let has = Command::new("unshare").args(["-rmpf", "true"]).status().is_ok_and(|status| status.success());
    if !has {
        tools::skipped("there are no namespaces for this user");
    }
    has
}

impl Three {
    /// The second was stopped by the stop of the first, and the note of the first has this text.
    #[track_caller]
    fn assert_reached(&self, note: &str) {
        let Self { first, second, .. } = self;
        assert_eq!(first.0, exit_code::DEVICE_FAULT, "{}", first.1);
        assert!(first.1.contains(note), "{}", first.1);
        assert_eq!(second.0, exit_code::DEVICE_FAULT, "{}", second.1);
        assert!(second.1.contains("pressed at another run"), "{}", second.1);
    }

    #[track_caller]
    fn assert_later_is_refused(&self) {
        assert_eq!(self.later.0, exit_code::DEVICE_FAULT, "{}", self.later.1);
        assert!(self.later.1.contains("nothing is energised"), "{}", self.later.1);
    }
}

#[test]
fn a_stop_on_a_full_disk_reaches_every_run_and_stays() {
    if has_namespaces() {
        let stopped = three(
            "mount -t tmpfs -o size=64k,mode=700 tmpfs flotor",
            "cat /dev/zero > flotor/fill 2>/dev/null",
        );
        stopped.assert_reached(ALL);
        stopped.assert_later_is_refused();
    }
}

#[test]
fn a_run_without_a_descriptor_stops_the_others_and_claims_nothing() {
    if has_namespaces() {
        let stopped = three("", "prlimit --pid $(cat /proc/$first/task/$first/children) --nofile=3:3");
        stopped.assert_reached(ONE);
        stopped.assert_later_is_refused();
    }
}

#[test]
fn a_stop_in_a_folder_that_was_opened_to_others_reaches_every_run_and_stays() {
    if has_namespaces() {
        let stopped = three("", "chmod 755 flotor");
        stopped.assert_reached(ALL);
        stopped.assert_later_is_refused();
    }
}

#[test]
fn a_stop_whose_latch_cannot_be_written_reaches_the_others_by_their_sockets_and_is_not_kept() {
    if has_namespaces() {
        let read_only = "touch flotor/latch; chmod 600 flotor/latch; mount --bind flotor/latch flotor/latch
                         mount -o remount,bind,ro flotor/latch";
        let stopped = three(read_only, "");
        stopped.assert_reached(ALL_BUT_LATER);
        for (_, said) in [&stopped.first, &stopped.second, &stopped.later] {
            assert!(said.contains(UNKEPT), "{said}");
        }
        assert_eq!(stopped.later.0, exit_code::OK, "{}", stopped.later.1);
    }
}

#[test]
fn a_run_that_was_suspended_is_named() {
    if has_namespaces() {
        let stopped = three(
            "",
            "host=$(cat /proc/$second/task/$second/children)
                      kill -STOP $host; ( sleep 5; kill -CONT $host ) >/dev/null 2>&1 &",
        );
        stopped.assert_reached("not confirmed by process ");
        stopped.assert_later_is_refused();
    }
}

/// In the folder of another user there is neither latch nor socket.
#[test]
fn a_run_in_the_folder_of_another_user_says_before_it_starts_that_its_stop_is_its_own() {
    if !rustix::process::getuid().is_root() {
        tools::skipped("only root can give a folder to another user");
        return;
    }
    let scratch = Scratch::default();
    let folder = scratch.folder("flotor");
    std::os::unix::fs::chown(&folder, Some(65534), None).expect("root may");
    let scene = scratch.patient_scene(flotor_session::scene::DEMO);
    let arguments = ["run", &scene.display().to_string(), "--duration", "100ms"];
    let flotor = Flotor::with(arguments).env("XDG_RUNTIME_DIR", &scratch.path().display().to_string());
    let Ran { code, stderr, .. } = flotor.run();
    assert_eq!(code, Some(exit_code::OK), "{stderr}");
    assert!(stderr.contains(UNKEPT), "{stderr}");
}

/// As in two containers with one folder, both runs are process 1; each ends by itself.
#[test]
fn two_runs_of_one_process_number_both_end() {
    if !has_namespaces() {
        return;
    }
    let scratch = Scratch::default();
    let scene = scratch.patient_scene(flotor_session::scene::DEMO);
    let start = |duration: &str| {
        let arguments = ["run", &scene.display().to_string(), "--duration", duration];
        let flotor = Flotor::with(arguments).env("XDG_RUNTIME_DIR", &scratch.path().display().to_string());
        flotor.through_shell("exec timeout -k 1 60 unshare -rpf --kill-child --mount-proc \"$@\"").start()
    };
    let runs = [start("5s"), start("5s")];
    for run in runs {
        let Ran { code, stderr, .. } = run.wait();
        assert_eq!(code, Some(exit_code::OK), "{stderr}");
    }
}
