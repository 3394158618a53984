//! What another user of the machine can do with a bridge that was started without options: nothing.
//!
//! Needs to be root, to be somebody else; says so and does nothing otherwise.

mod common;

use common::process::Owned;
use common::{FakeHost, tools, wait_until};
use flotor_live::Ask;
use std::net::TcpStream;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};

/// A user with no rights at all: `nobody`.
const NOBODY: u32 = 65534;

fn bridge(runtime: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_flotor-bridge"));
    command.env("XDG_RUNTIME_DIR", runtime).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

#[test]
fn by_default_another_user_can_do_nothing_and_this_one_can() {
    if !rustix::process::getuid().is_root() {
        return tools::skipped("only root can be somebody else");
    }
    let host = FakeHost::start_in("flotor");
    let runtime = host.directory.path().parent().unwrap().to_path_buf();
    // Only the folder of the runs keeps others out.
    std::fs::set_permissions(&runtime, std::fs::Permissions::from_mode(0o755)).unwrap();
    let _bridge = Owned::start(bridge(&runtime).args(["serve", "--name", "lab", "--allow", "own"]));
    let socket = host.directory.path().join("bridge-lab");
    wait_until("the bridge listens", || socket.exists());
    let asked = || host.asked.0.lock().unwrap().len();
    let is_done = |command: &mut Command| command.status().unwrap().success();

    // Where it would go by itself, to the socket itself, and to the port of before.
    let endpoint = format!("unixsock-stream/{}", socket.display());
    let ways: [&[&str]; 3] = [&[], &["--connect", &endpoint], &["--connect", "tcp/127.0.0.1:7447"]];
    for way in ways {
        for ask in
            [&["ask", "lab", "stop"][..], &["ask", "lab", "emergency-stop"], &["ask", "lab", "release"]]
        {
            let mut stranger = bridge(&runtime);
            stranger.args(ask).args(way).uid(NOBODY).gid(NOBODY);
            // It cannot even be started where the program's folder is closed to others: nothing is done then, either.
            let done = stranger.status().is_ok_and(|status| status.success());
            assert!(!done, "{ask:?} by {way:?}");
        }
    }
    assert_eq!(asked(), 0, "the host heard of none of it");
    assert_eq!(host.directory.latch().state().presses, 0);
    assert!(TcpStream::connect(("127.0.0.1", 7447)).is_err(), "nothing listens on a port");

    assert!(is_done(bridge(&runtime).args(["ask", "lab", "stop"])));
    assert!(is_done(bridge(&runtime).args(["ask", "lab", "emergency-stop"])));
    let asked = host.asked.0.lock().unwrap().clone();
    assert_eq!(asked, [Ask::Stop, Ask::EmergencyStop]);
}
