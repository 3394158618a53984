//! A device that keeps its last force for ever and logs it (`tests/c/post_with_log.c`), and commands that drive it.

use crate::force_log::ForceLog;
use flotor_tests::library::compile_c_file;
use flotor_tests::program::Flotor;
use flotor_tests::scratch::Scratch;
use flotor_tests::workspace_root;
use serialport::{SerialPort, TTYPort};
use std::io::{BufRead, BufReader, Read, Write};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::time::Duration;

const PATIENT: &str = "[limits]\nwatchdog_ms = 60000";
/// How long a thread here waits for a device.
const PATIENCE: Duration = Duration::from_secs(600);

/// The library of the device, its log, and a force sensor.
pub(crate) struct Post {
    scratch: Scratch,
    terminal: TTYPort,
    sensor: TTYPort,
    log: ForceLog,
}

impl Post {
    pub(crate) fn new() -> Self {
        let (terminal, log) = logged();
        let post = Self { scratch: Scratch::default(), terminal, sensor: force_sensor(), log };
        compile_c_file(&workspace_root().join("tests/c/post_with_log.c"), &[], &post.library());
        post
    }

    pub(crate) fn library(&self) -> PathBuf {
        self.scratch.path().join("libpost.so")
    }

    /// The scene of the device with these models, for any program that drives it.
    pub(crate) fn scene(&self, models: &str) -> String {
        let library = self.library();
        let scene = format!("[device]\nplugin = \"{}\"\n{PATIENT}\n{models}", library.display());
        self.scratch.file(&format!("{}.toml", models.len()), scene).display().to_string()
    }

    /// A folder of its own.
    pub(crate) fn folder(&self) -> &Path {
        self.scratch.path()
    }

    /// The variable that names the log to the device.
    pub(crate) fn variable(&self) -> (&'static str, String) {
        ("FIXTURE_FORCE_LOG", self.terminal.name().expect("a pseudo terminal has a path"))
    }

    /// A command whose devices log here.
    pub(crate) fn flotor(&self, arguments: &[&str]) -> Flotor {
        let (name, value) = self.variable();
        Flotor::with(arguments).env(name, &value).inside(self.scratch.path())
    }

    /// A calibration that pushes with 4 N, and waits for a handle that never comes.
    pub(crate) fn calibration(&self) -> Vec<String> {
        let sensor = self.sensor.name().expect("a pseudo terminal has a path");
        let library = self.library().display().to_string();
        let calibrate =
            ["calibrate", "vertical", "--force", "4,6", "--device", &library, "--sensor", &sensor];
        calibrate.map(str::to_owned).to_vec()
    }
}

impl Deref for Post {
    type Target = ForceLog;

    fn deref(&self) -> &ForceLog {
        &self.log
    }
}

/// Returns the terminal that a device logs to, and its log.
fn logged() -> (TTYPort, ForceLog) {
    let (mut ours, theirs) = TTYPort::pair().expect("the system has pseudo terminals");
    ours.set_timeout(PATIENCE).expect("it is ours");
    let log = ForceLog::default();
    let entries = log.clone();
    std::thread::spawn(move || {
        for line in BufReader::new(ours).lines() {
            let Ok(line) = line else { return };
            let force_n: f64 = line.trim().parse().expect("a force");
            entries.push(force_n.abs());
        }
    });
    (theirs, log)
}

/// Returns a port at which a sensor reads no force, until the port is dropped.
fn force_sensor() -> TTYPort {
    let (mut ours, theirs) = TTYPort::pair().expect("the system has pseudo terminals");
    ours.set_timeout(PATIENCE).expect("it is ours");
    std::thread::spawn(move || {
        let mut byte = [0];
        while ours.read(&mut byte).is_ok_and(|length| length == 1) {
            if byte == *b"R" && ours.write_all(b"F 0\n").is_err() {
                return;
            }
        }
    });
    theirs
}
