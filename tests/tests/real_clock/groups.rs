//! All processes of a group killed at once, as an out-of-memory daemon, a container and a service manager do it: the watchdog
//! process has left the group, and takes the force away. Seen from a board that keeps its last torque for ever, in its own log.

use crate::board::{Board, PAST, Where, dies, run_on, run_with, wait_until};
use crate::emulated::{EMULATED, Emulated};
use crate::post::Post;
use crate::scarcity::{become_stranger, may_be_another_user};
use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

/// Tries of a kill, at full size and else.
const TRIES: [u32; 2] = [50, 4];

fn tries() -> u32 {
    let [full, quick] = TRIES;
    if TestSize::of_this_run() == TestSize::Full { full } else { quick }
}

/// A control group of the test's own in one hierarchy.
struct ControlGroup(PathBuf);

impl ControlGroup {
    /// One in each hierarchy in which this process may make one. The memory controller of version 1 is left out: nothing leaves its
    /// groups, because it kills single processes.
    fn in_each_hierarchy() -> Vec<Self> {
        let mounts = std::fs::read_to_string("/proc/mounts").unwrap_or_default();
        let folder = |line: &str| {
            let mut fields = line.split(' ').skip(1);
            let (folder, system) = (fields.next()?, fields.next()?);
            let is_memory = fields.next()?.split(',').any(|option| option == "memory");
            (system.starts_with("cgroup") && !is_memory).then(|| PathBuf::from(folder))
        };
        let made = |folder: PathBuf| {
            let group = folder.join(format!("flotor-test-{}", std::process::id()));
            std::fs::create_dir(&group).ok()?;
            let made = Self(group);
            // A group of processor sets takes processes only once it has both.
            for file in ["cpuset.cpus", "cpuset.mems"] {
                if let Ok(outer) = std::fs::read_to_string(folder.join(file)) {
                    std::fs::write(made.0.join(file), outer).ok()?;
                }
            }
            Some(made)
        };
        mounts.lines().filter_map(folder).filter_map(made).collect()
    }

    fn list(&self) -> PathBuf {
        self.0.join("cgroup.procs")
    }

    fn processes(&self) -> Vec<Pid> {
        let list = std::fs::read_to_string(self.list()).expect("it is ours");
        list.lines().filter_map(|number| Pid::from_raw(number.parse().ok()?)).collect()
    }

    /// Kills all of it, by the kernel where it can.
    fn kill(&self) {
        if std::fs::write(self.0.join("cgroup.kill"), "1").is_err() {
            for process in self.processes() {
                let _ = kill_process(process, Signal::KILL);
            }
        }
    }
}

impl Drop for ControlGroup {
    fn drop(&mut self) {
        // A process that has just been killed may be in it for a while.
        for _ in 0..100 {
            if std::fs::remove_dir(&self.0).is_ok() {
                return;
            }
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    }
}

/// A budget of zero refuses real-time priority, whatever the permissions.
#[test]
fn a_run_names_the_control_group_that_refuses_real_time_priority() {
    let _turn = crate::alone();
    let mut groups = ControlGroup::in_each_hierarchy().into_iter();
    let Some(group) = groups.find(|group| group.0.join("cpu.rt_runtime_us").exists()) else {
        let _ =
            writeln!(std::io::stderr(), "skipped: no group with a budget for real-time threads can be made");
        return;
    };
    let file = group.0.join("cpu.rt_runtime_us");
    let enter = format!("echo $$ > {}; exec \"$@\"", group.list().display());
    let run = || Flotor::with(["run", "--duration", "0.1"]).through_shell(&enter).run();
    let named = format!(
        "the control group has no budget for real-time threads, which every other permission requires: as root `echo 950000 > {}`",
        file.display()
    );
    let refused = run();
    assert!(refused.stderr.contains(&named), "{refused:?}");
    let told = Flotor::with(["doctor"]).through_shell(&enter).run().stdout;
    assert!(told.contains("RT budget") && told.contains(&named), "{told}");
    // The remedy, where the outer group gives that much.
    if std::fs::write(&file, "100000").is_ok() {
        let granted = run();
        assert!(!granted.stderr.contains("no real-time priority"), "{granted:?}");
    }
}

fn load() -> String {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    load.split(' ').next().unwrap_or("unknown").to_owned()
}

#[test]
fn a_killed_control_group_leaves_no_force() {
    EMULATED.iter().for_each(|device| assert_killed_control_groups_leave_no_force(*device));
}

/// Kills the control group of runs on a device, and prints median and largest time until the device is without force.
fn assert_killed_control_groups_leave_no_force(device: Emulated) {
    if !device.is_for_this_size() {
        return;
    }
    let _turn = crate::alone();
    let groups = ControlGroup::in_each_hierarchy();
    if groups.is_empty() {
        let _ = writeln!(std::io::stderr(), "skipped: a killed control group: this user may make none");
        return;
    }
    let lists: Vec<String> = groups.iter().map(|group| group.list().display().to_string()).collect();
    let enter = format!("for list in {}; do echo $$ > $list; done; exec \"$@\"", lists.join(" "));
    let mut times = Vec::new();
    for (attempt, group) in (1..=tries()).zip(groups.iter().cycle()) {
        let (driven, run) = device.start();
        let running = run.through_shell(&enter).start();
        driven.wait_for_force(PAST);
        let processes = [running.pid(), running.host()];
        assert_eq!(group.processes(), processes, "only the host is in it: {}", group.0.display());
        // A controller removes the force of a host that is late, until its next command.
        driven.wait_for_force(PAST);
        let since = Instant::now();
        group.kill();
        let ran = running.wait();
        assert_eq!(ran.code, None, "{ran:?}");
        assert!(!ran.stderr.contains("control group"), "it was left: {ran:?}");
        times.push((driven.assert_stopped_since(since, "the group is killed"), load()));
        println!("{device:?}, {attempt}, {}: {:?}", group.0.display(), times.last());
    }
    times.sort_unstable();
    println!(
        "{device:?}: {} of {} without force; median {:?}, largest {:?} after the kill (time, load)",
        times.len(),
        tries(),
        times[times.len() / 2],
        times.last()
    );
}

/// A way into a control group out of which none leads: its files are hidden.
struct Enclosed {
    script: String,
    _group: ControlGroup,
}

/// Makes such a group, where this user may.
fn enter_without_a_way_out() -> Option<Enclosed> {
    let Some(group) = ControlGroup::in_each_hierarchy().pop() else {
        let _ = writeln!(
            std::io::stderr(),
            "skipped: consent to a shared control group: this user may make none"
        );
        return None;
    };
    let hide = "mount -t tmpfs none /sys/fs/cgroup && PATH=/nowhere exec \"$@\"";
    let script = format!("echo $$ > {} && exec unshare -m sh -c '{hide}' sh \"$@\"", group.list().display());
    Some(Enclosed { script, _group: group })
}

#[test]
fn a_device_that_only_the_watchdog_process_stops_needs_consent_to_a_shared_control_group() {
    let _turn = crate::alone();
    let Some(enter) = enter_without_a_way_out() else { return };
    assert_consent_is_needed(|_, _| enter.script.clone());
}

/// A user who may write to no control group and has no systemd: neither root's rights nor a bus.
#[test]
fn a_user_without_systemd_is_asked_for_consent_to_a_shared_control_group() {
    if !may_be_another_user() {
        return;
    }
    let _turn = crate::alone();
    let Some(group) = ControlGroup::in_each_hierarchy().pop() else {
        let _ =
            writeln!(std::io::stderr(), "skipped: a user without systemd: root may make no control group");
        return;
    };
    assert_consent_is_needed(|board, scratch| {
        board.admit_all_users();
        let user = become_stranger(scratch);
        format!("echo $$ > {} && unset DBUS_SESSION_BUS_ADDRESS && {user} \"$@\"", group.list().display())
    });
}

/// Runs a device that only the watchdog process stops in a control group without a way out, without consent and with it. `enter` makes the
/// script that enters the group.
#[track_caller]
fn assert_consent_is_needed(enter: impl Fn(&Board, &Scratch) -> String) {
    let ends = |limits: &str| {
        let (board, scratch) = (Board::start(), Scratch::default());
        let limits = format!("watchdog_ms = 60000\n{limits}");
        let model = scratch.path().join("libdies.so");
        std::fs::copy(dies(), &model).expect("a scratch folder takes a library");
        let script = enter(&board, &scratch);
        let running =
            run_with(&board, &scratch, &model, Where::InTheHost, &limits).through_shell(&script).start();
        if !limits.contains("accept") {
            return running.wait();
        }
        board.wait_for_force(PAST);
        running.signal(Signal::INT);
        let ran = running.wait();
        let _ = board.assert_stopped("the end");
        ran
    };
    let refused = ends("");
    assert_eq!(refused.code, Some(exit_code::CONFIGURATION), "{refused:?}");
    for expected in ["the force of `device` would stay on", "--accept-shared-control-group"] {
        assert!(refused.error().contains(expected), "{expected}: {refused:?}");
    }
    let accepted = ends("accept_shared_control_group = true");
    assert_eq!(accepted.code, Some(exit_code::OK), "{accepted:?}");
    let warnings = accepted
        .stderr
        .lines()
        .filter(|line| line.contains("note: the watchdog process is in the control group"));
    assert_eq!(warnings.count(), 1, "{accepted:?}");
}

/// Commands beside `run` that drive a device, each with its arguments; a program that is lent a device waits for so many seconds.
fn other_commands(post: &Post, wait_s: &str) -> Vec<Vec<String>> {
    let (scene, program) = (post.scene(""), post.scene("[[model]]\nplugin = \"program\"\n"));
    let ports = ["--listen", "127.0.0.1:0", "--events", "127.0.0.1:0"];
    let service = [&["emulate", "haply-service", &program], &ports[..]].concat();
    let lend =
        |api, scene| ["lend", "--api", api, "--listen", "127.0.0.1:0", scene, "--", "/bin/sleep", wait_s];
    let of_words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
    let device = post.library().display().to_string();
    let emulate =
        ["emulate", "maglev", "--protocol", "ml-api", "--listen", "127.0.0.1:0", "--device", &device];
    let mut commands = vec![post.calibration(), of_words(&lend("ml-api", &scene)), of_words(&emulate)];
    // The service of Haply is built for the longer tests.
    if !TestSize::of_this_run().leaves_out_long_tests() {
        commands.extend([of_words(&service), of_words(&lend("haply", &program))]);
    }
    commands
}

#[test]
fn every_command_that_drives_a_device_needs_consent_to_a_shared_control_group() {
    let _turn = crate::alone();
    let Some(enter) = enter_without_a_way_out() else { return };
    let post = Post::new();
    for (refused, accepted) in other_commands(&post, "1").iter().zip(other_commands(&post, "60")) {
        let command = &accepted;
        let words: Vec<&str> = refused.iter().map(String::as_str).collect();
        let before = post.log().len();
        let refused = post.flotor(&words).through_shell(&enter.script).run();
        assert_eq!(post.log().len(), before, "{command:?}: nothing is energised");
        for expected in ["the force of `", "--accept-shared-control-group"] {
            assert!(refused.stderr.contains(expected), "{command:?}: {expected}: {refused:?}");
        }
        let mut words: Vec<&str> = command.iter().map(String::as_str).collect();
        let end_of_options = words.iter().position(|word| *word == "--").unwrap_or(words.len());
        words.insert(end_of_options, "--accept-shared-control-group");
        let running = post.flotor(&words).through_shell(&enter.script).start();
        wait_until("the device is driven", || post.log().len() > before);
        running.signal(Signal::INT);
        let accepted = running.wait();
        let warning = "the watchdog process is in the control group";
        assert!(accepted.stderr.contains(warning), "{command:?}: {accepted:?}");
    }
}

#[test]
fn a_killed_process_group_leaves_no_force() {
    let _turn = crate::alone();
    for attempt in 1..=tries() {
        let (board, scratch) = (Board::start(), Scratch::default());
        let run = run_on(&board, &scratch, dies(), Where::InTheHost);
        let running = run.through_shell("exec setsid \"$@\"").start();
        board.wait_for_force(PAST);
        kill_process_group(running.pid(), Signal::KILL).expect("it is ours");
        let _ = running.wait();
        let after = board.assert_stopped("the process group is killed");
        println!("{attempt}: no force {after:?} after the last request for one, load {}", load());
    }
}

#[test]
fn a_suspended_host_loses_its_force_and_ends_when_it_goes_on() {
    let _turn = crate::alone();
    let (board, scratch) = (Board::start(), Scratch::default());
    let running = run_with(&board, &scratch, dies(), Where::InTheHost, "watchdog_ms = 100").start();
    board.wait_for_force(PAST);
    running.signal_host(Signal::STOP);
    let after = board.assert_stopped("the host is suspended");
    println!("no force {after:?} after the last request for one, load {}", load());
    let before = board.log().len();
    running.signal_host(Signal::CONT);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:?}");
    assert!(
        ran.stderr.contains("flotor watchdog: the host is suspended or hangs; stopped `device`"),
        "{ran:?}"
    );
    assert!(ran.stderr.contains("the watchdog stopped all devices"), "{ran:?}");
    let _ = board.assert_stopped("the end");
    // A command that the host was about to send when it was suspended goes out.
    let commands = board.log().iter().skip(before).filter(|(_, force_n)| *force_n > 0.0).count();
    assert!(commands <= 1, "{commands}");
}

#[test]
fn a_terminal_cannot_suspend_a_run_in_the_background() {
    let _turn = crate::alone();
    let (board, scratch) = (Board::start(), Scratch::default());
    let running = run_on(&board, &scratch, dies(), Where::InTheHost).start();
    board.wait_for_force(PAST);
    for signal in [Signal::TTOU, Signal::TTIN] {
        running.signal_host(signal);
        let before = board.log().len();
        wait_until("the loop goes on", || board.log().len() > before + PAST);
    }
    running.signal(Signal::INT);
    assert_eq!(running.wait().code, Some(exit_code::OK));
    let _ = board.assert_stopped("the end");
}
