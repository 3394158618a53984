//! A planar device over a serial port in a scene, in real time: an emulated board at a pseudo terminal.

use flotor_core::trace::{Events, TickRecord};
use flotor_hal::DVec3;
use flotor_hal::glam::DVec2;
use flotor_haply::emulator::EmulatedBoard;
use flotor_haply::pantograph::Pantograph;
use flotor_servo::RunEnd;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, RunError, RunOptions, Session};
use flotor_tests::stand_in::assert_every_rule_holds;
use flotor_tests::workspace_root;
use serialport::{SerialPort, TTYPort};
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const LINKAGE: Pantograph = Pantograph { inner_m: 0.07, outer_m: 0.09, base_m: 0.038 };
const CENTRE_M: DVec2 = DVec2::new(0.019, 0.1);
/// The hand holds the handle here, away from the user and to the right, m in the host's frame.
pub(super) const HELD_M: DVec3 = DVec3::new(0.005, 0.004, 0.0);

/// A board on a thread of its own, until it is dropped.
pub(super) struct Board {
    pub(super) path: String,
    is_over: Arc<AtomicBool>,
}

impl Board {
    pub(super) fn start() -> Self {
        let (mut port, host_end) = TTYPort::pair().expect("the system has pseudo terminals");
        port.set_timeout(Duration::from_millis(5)).expect("it is ours");
        let path = host_end.name().expect("it has a path");
        let is_over = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&is_over);
        std::thread::spawn(move || {
            let host_end = host_end;
            let mut board = EmulatedBoard::new(LINKAGE, CENTRE_M - DVec2::new(HELD_M.x, HELD_M.y));
            let mut chunk = [0; 256];
            while !ended.load(Ordering::Acquire) {
                let length = port.read(&mut chunk).unwrap_or(0);
                if port.write_all(&board.receive(&chunk[..length])).is_err() {
                    break;
                }
            }
            drop(host_end);
        });
        Self { path, is_over }
    }

    /// The scene of the book on this board, with other limits.
    fn scene(&self, limits: &str) -> Scene {
        let file = workspace_root().join("host/scenes/haply.toml");
        let text = std::fs::read_to_string(&file).expect("the scene is there");
        // A machine that is delayed for long is no fault of the board.
        let port = format!("{}\"\ntimeout_ms = \"9000", self.path).replace("\"9000", "9000");
        let text = text.replace("/dev/ttyACM0\"", &port).replace("force_n = [3, 3, 0]", limits);
        Scene::parse(&file, &text.replace("duration_s = 20", "duration_s = 1")).expect("the scene is right")
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
    }
}

#[derive(Default)]
struct Keep(Vec<TickRecord>);

impl Observer for Keep {
    fn observe(&mut self, record: &TickRecord) {
        self.0.push(*record);
    }
}

#[test]
fn a_wall_is_felt_in_the_plane() {
    let board = Board::start();
    let options = RunOptions { clock: Clock::Real, seed: 1 };
    let limits = "force_n = [3, 3, 0]\nwatchdog_ms = 60000";
    let session = Session::prepare(&board.scene(limits), &Registry::search(&[]), &options)
        .unwrap_or_else(|error| panic!("{error}"));
    let mut keep = Keep::default();
    let outcome = session.run(&mut keep, &StopSwitch::default()).expect("it runs");
    assert_eq!(outcome.end, RunEnd::Finished);
    // The most there was: a board that was kept waiting has a force that fades in once more.
    let force_n = |record: &TickRecord| record.commanded.force().length();
    let pressed = keep.0.iter().max_by(|a, b| force_n(a).total_cmp(&force_n(b))).expect("there were ticks");
    assert!((pressed.pose.position() - HELD_M).length() < 1.0e-6, "{pressed:?}");
    // 4 mm into a wall of 300 N/m: 1.2 N towards the user, and nothing on the axis there is not.
    assert!((pressed.commanded.force() - DVec3::new(0.0, -1.2, 0.0)).length() < 0.01, "{pressed:?}");
    assert!(!pressed.events.intersects(Events::FORCE_LIMITED));
}

#[test]
fn a_scene_that_wants_more_than_the_plane_is_told_before_anything_moves() {
    let board = Board::start();
    let options = RunOptions { clock: Clock::Real, seed: 1 };
    let refused = Session::prepare(&board.scene("ramp_s = 0.1"), &Registry::search(&[]), &options);
    match refused {
        Err(error @ RunError::Mismatch { .. }) => {
            let said = error.to_string();
            assert!(said.contains("along z") && said.contains("force_n = [3, 3, 0]"), "{said}");
        }
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("z would be missing"),
    }
}

#[test]
fn with_a_board_every_rule_is_checked_and_holds() {
    let board = Board::start();
    assert_every_rule_holds("flotor-haply", &[&format!("port={}", board.path), "timeout_ms=9000"]);
}
