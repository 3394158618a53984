//! What another user of the machine can do with a bridge that was started without options: nothing.
//!
//! Needs to be root, to be somebody else; says so and does nothing otherwise.

mod common;

use common::process::Owned;
use common::{FakeHost, tools, wait_until};
use flotor_bridge::keys::Name;
use flotor_bridge::link::{End, LinkOptions, open};
use flotor_live::{Ask, LatchState};
use std::collections::BTreeSet;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use zenoh::Wait;

/// A user with no rights at all: `nobody`.
const NOBODY: u32 = 65534;
/// Where the forger of `a_stranger_forges` goes.
const ENDPOINT: &str = "FLOTOR_FORGED_ENDPOINT";

fn quiet(mut command: Command, runtime: &Path) -> Command {
    command.env("XDG_RUNTIME_DIR", runtime).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn bridge(runtime: &Path) -> Command {
    quiet(Command::new(env!("CARGO_BIN_EXE_flotor-bridge")), runtime)
}

/// Another user, with programs of its own: those under test may lie where nobody else may look.
struct Stranger {
    runtime: PathBuf,
    programs: tempfile::TempDir,
}

impl Stranger {
    fn new(runtime: &Path) -> Self {
        let programs = tempfile::tempdir().unwrap();
        std::fs::set_permissions(programs.path(), Permissions::from_mode(0o755)).unwrap();
        let tests = std::env::current_exe().unwrap();
        for (name, file) in [("bridge", Path::new(env!("CARGO_BIN_EXE_flotor-bridge"))), ("tests", &tests)] {
            let copy = programs.path().join(name);
            std::fs::copy(file, &copy).unwrap();
            std::fs::set_permissions(copy, Permissions::from_mode(0o755)).unwrap();
        }
        Self { runtime: runtime.to_path_buf(), programs }
    }

    fn command(&self, program: &str, arguments: &[&str]) -> Command {
        let mut command = quiet(Command::new(self.programs.path().join(program)), &self.runtime);
        command.args(arguments).uid(NOBODY).gid(NOBODY).current_dir("/");
        command
    }

    /// Whether it succeeds; what waits for ever has not.
    fn does(&self, program: &str, arguments: &[&str]) -> bool {
        is_done(&mut self.command(program, arguments))
    }

    fn forges(&self, endpoint: &str) -> bool {
        let forgery = ["--exact", "a_stranger_forges", "--ignored"];
        is_done(self.command("tests", &forgery).env(ENDPOINT, endpoint))
    }
}

/// Whether a program succeeds within the time in which one that is let in does.
fn is_done(command: &mut Command) -> bool {
    let (mut program, started) = (Owned::start(command), Instant::now());
    while started.elapsed() < Duration::from_secs(10) {
        if let Some(end) = program.try_wait().unwrap() {
            return end.success();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    false
}

/// The ports of this machine on which a process listens, as /proc/net names them.
fn ports(process: u32) -> Vec<String> {
    let files = std::fs::read_dir(format!("/proc/{process}/fd")).unwrap().flatten();
    let targets = files.filter_map(|file| std::fs::read_link(file.path()).ok());
    let sockets: BTreeSet<String> = targets.map(|target| target.display().to_string()).collect();
    let tables = ["tcp", "tcp6", "udp", "udp6"].map(|table| format!("/proc/{process}/net/{table}"));
    let text = tables.map(|table| std::fs::read_to_string(table).unwrap_or_default()).concat();
    // proc_net_tcp(5): the local address is the second word, the inode the tenth.
    let of_line = |line: &str| -> Option<String> {
        let words: Vec<&str> = line.split_whitespace().collect();
        sockets.contains(&format!("socket:[{}]", words.get(9)?)).then(|| words[1].to_owned())
    };
    text.lines().filter_map(of_line).collect()
}

#[test]
fn by_default_another_user_can_do_nothing_and_this_one_can() {
    if !rustix::process::getuid().is_root() {
        return tools::skipped("only root can be somebody else");
    }
    let host = FakeHost::start_in("flotor");
    let runtime = host.directory.path().parent().unwrap().to_path_buf();
    // Only the folder of the runs keeps others out.
    std::fs::set_permissions(&runtime, Permissions::from_mode(0o755)).unwrap();
    let scene = runtime.join("scene.toml");
    let serving = ["serve", "--name", "lab", "--allow", "own", "--scene", &scene.display().to_string()];
    let served = Owned::start(bridge(&runtime).args(serving));
    let socket = host.directory.path().join("bridge-lab");
    wait_until("the bridge listens", || socket.exists());
    assert_eq!(ports(served.id()), Vec::<String>::new(), "it listens where only files are");
    let asked = || host.asked.0.lock().unwrap().clone();
    let stranger = Stranger::new(&runtime);
    assert!(stranger.does("bridge", &["--version"]), "its programs run");

    // Where it would go by itself, and to the socket itself.
    let endpoint = format!("unixsock-stream/{}", socket.display());
    let record = stranger.programs.path().join("run.mcap").display().to_string();
    let attempts: [&[&str]; 7] = [
        &["record", "lab", &record],
        &["ask", "lab", "set", "spring.gamma_n=30"],
        &["ask", "lab", "stop"],
        &["ask", "lab", "emergency-stop"],
        &["ask", "lab", "start"],
        &["ask", "lab", "release"],
        &["couple", "lab"],
    ];
    std::thread::scope(|scope| {
        for attempt in attempts {
            for way in [&[][..], &["--connect", &endpoint]] {
                let (stranger, arguments) = (&stranger, [attempt, way].concat());
                scope.spawn(move || assert!(!stranger.does("bridge", &arguments), "{arguments:?}"));
            }
        }
    });
    assert!(!stranger.forges(&endpoint), "it has no session");
    assert_eq!(asked(), [], "the host heard of none of it");
    assert_eq!(host.directory.latch().state(), LatchState::default());

    let does = |ask: &[&str]| is_done(bridge(&runtime).args(["ask", "lab"]).args(ask));
    for ask in [&["set", "spring.gamma_n=30"][..], &["stop"], &["emergency-stop"]] {
        assert!(does(ask), "{ask:?}");
    }
    assert!(matches!(&asked()[..], [Ask::Set { .. }, Ask::Stop, Ask::MachineStop]), "{:?}", asked());
    // Who is let in may forge nothing either: `loopback` has that test; here, that the forger can get in at all.
    assert!(is_done(
        quiet(Command::new(std::env::current_exe().unwrap()), &runtime)
            .args(["--exact", "a_stranger_forges", "--ignored"])
            .env(ENDPOINT, &endpoint)
    ));
}

/// The socket of a bridge that was killed stays behind: it keeps neither the next bridge nor a visitor of another one out.
#[test]
fn a_socket_that_a_killed_bridge_left_is_in_nobody_s_way() {
    let host = FakeHost::start_in("flotor");
    let runtime = host.directory.path().parent().unwrap().to_path_buf();
    let serve = |name: &str| {
        let served = Owned::start(bridge(&runtime).args(["serve", "--name", name, "--allow", "operate"]));
        let does = || is_done(bridge(&runtime).args(["ask", name, "set", "spring.gamma_n=30"]));
        wait_until("the bridge answers", does);
        served
    };
    let (killed, _other) = (serve("lab0"), serve("lab1"));
    killed.signal(rustix::process::Signal::KILL);
    drop(killed);
    assert!(host.directory.path().join("bridge-lab0").exists(), "or there is nothing to see here");
    assert!(is_done(bridge(&runtime).args(["ask", "lab1", "stop"])));
    assert!(!is_done(bridge(&runtime).args(["ask", "lab0", "stop"])));
    let _again = serve("lab0");
}

/// Puts what only a bridge says on its keys; succeeds if it has a session to put it on. Started by the test above.
#[test]
#[ignore = "started by another test, as another user"]
fn a_stranger_forges() {
    let connect = vec![std::env::var(ENDPOINT).expect("who starts this names an endpoint")];
    let link = LinkOptions { connect, ..LinkOptions::default() };
    let session = open(&link, End::Visiting).unwrap();
    let started = Instant::now();
    while session.info().peers_zid().wait().count() == 0 {
        assert!(started.elapsed() < Duration::from_secs(3), "it reaches nobody");
        std::thread::sleep(Duration::from_millis(10));
    }
    let forged = serde_json::to_vec(&flotor_live::End {
        words: "FORGED".to_owned(),
        kind: flotor_live::EndKind::InOrder,
    })
    .unwrap();
    session.put(Name::new("lab").unwrap().key("end"), forged).wait().unwrap();
}
