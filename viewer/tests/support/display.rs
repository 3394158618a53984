//! A virtual display for tests of the real window, and the programs that run on it.

use super::PATIENCE;
use super::process::Owned;
use egui::accesskit::Role;
use egui::{Rect, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use flotor_live::Directory;
use flotor_viewer::app::{RunSelection, Start, Viewer};
use flotor_viewer::palette::Look;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Width and height of display and window, pixels.
pub(crate) const SIZE: [u16; 2] = [1280, 800];

/// A program of this workspace.
pub(crate) fn program(name: &str) -> PathBuf {
    let file = Path::new(env!("CARGO_BIN_EXE_flotor-viewer")).with_file_name(name);
    assert!(file.is_file(), "{} is missing: run `cargo build` first", file.display());
    file
}

/// A virtual display of the window's size.
pub(crate) struct Display {
    _server: Owned,
    /// As programs are told: `:1`.
    pub(crate) name: String,
    /// What is on it, kept by the server in a file.
    pub(crate) screen: PathBuf,
}

impl Display {
    /// Starts one; its picture goes into a file of the folder.
    pub(crate) fn start(folder: &Path) -> Self {
        let size = format!("{}x{}x24", SIZE[0], SIZE[1]);
        let mut command = Command::new("Xvfb");
        // Without resets: when its last client leaves, and that may be a look for a window not open yet, a server begins anew,
        // and turns away who comes meanwhile.
        command.args(["-displayfd", "1", "-noreset", "-nolisten", "tcp", "-screen", "0", &size, "-fbdir"]);
        command.arg(folder);
        let mut server = Owned::start(command.stdout(Stdio::piped()).stderr(Stdio::null()));
        let mut number = String::new();
        let output = server.stdout.take().expect("a pipe was requested");
        BufReader::new(output).read_line(&mut number).expect("it says its number");
        Self { _server: server, name: format!(":{}", number.trim()), screen: folder.join("Xvfb_screen0") }
    }

    /// What is on it now, as the server keeps it.
    pub(crate) fn picture(&self) -> Vec<u8> {
        std::fs::read(&self.screen).expect("the server keeps it")
    }

    /// What is on it once that does not change for a while.
    pub(crate) fn picture_at_rest(&self) -> Vec<u8> {
        patiently("a picture that stays", || {
            let picture = self.picture();
            std::thread::sleep(Duration::from_millis(300));
            (picture == self.picture()).then_some(picture)
        })
    }
}

/// A program of this workspace for a test: on this display or on none, and with no run and no choices of whoever runs the test.
pub(crate) fn alone(name: &str, folder: &Path, display: Option<&Display>) -> Command {
    let mut command = Command::new(program(name));
    command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET").env_remove("DISPLAY");
    command.envs(display.map(|display| ("DISPLAY", &display.name)));
    command.env("XDG_RUNTIME_DIR", folder).env("XDG_CONFIG_HOME", folder);
    // A software adapter takes all processors if it may; the loop needs one.
    command.env("LP_NUM_THREADS", "1").stdin(Stdio::null());
    command
}

/// A scene of the host with a watchdog that bears a machine on which nothing moves for a while: beside a window that the processor
/// draws, that is soon so.
pub(crate) fn patient_scene(folder: &Path, name: &str) -> PathBuf {
    let scene =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/scenes").join(name).with_extension("toml");
    let scene = std::fs::read_to_string(scene).expect("it is there");
    let file = folder.join("patient.toml");
    std::fs::write(&file, scene + "\n[limits]\nwatchdog_ms = 60000\n")
        .expect("a scratch folder can be written to");
    file
}

/// Tries until it works.
pub(crate) fn patiently<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let until = Instant::now() + 3 * PATIENCE;
    while Instant::now() < until {
        if let Some(value) = attempt() {
            return value;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("{what}: not within {:?}", 3 * PATIENCE);
}

/// Where a slider lies in the window: the same interface without a display, on the same run.
pub(crate) fn place_of_slider(directory: &Directory, name: &str) -> Rect {
    let size = vec2(f32::from(SIZE[0]), f32::from(SIZE[1]));
    let directory = directory.clone();
    let mut harness = Harness::builder().with_size(size).build_eframe(|creation| {
        Viewer::new(&creation.egui_ctx, None, Start::Live(RunSelection::newest(directory)), Look::Dark)
    });
    let until = Instant::now() + PATIENCE;
    while harness.state().history().is_empty() {
        assert!(Instant::now() < until, "no ticks come");
        std::thread::sleep(Duration::from_millis(20));
        harness.run_steps(1);
    }
    harness.run_steps(3);
    harness.get_by_role_and_label(Role::Slider, name).rect()
}
