//! Emulates a board at a pseudo terminal: the handle goes towards the user and back, once in two seconds. The argument is the path of
//! a new symbolic link to that terminal.
//!
//! ```text
//! $ cargo run -p flotor-haply --example emulated_board -- target/board
//! port /dev/pts/3
//! $ flotor run haply --set device.port=target/board
//! ```

use flotor_hal::glam::DVec2;
use flotor_haply::emulator::EmulatedBoard;
use flotor_haply::pantograph::Pantograph;
use serialport::{SerialPort, TTYPort};
use std::f64::consts::TAU;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const LINKAGE: Pantograph = Pantograph { inner_m: 0.07, outer_m: 0.09, base_m: 0.038 };
const PERIOD_S: f64 = 2.0;
/// Amplitude of the motion.
const AMPLITUDE_M: f64 = 0.02;

/// Creates a link to the port, replacing an earlier link.
fn point(link: &Path, port: &str) -> std::io::Result<()> {
    if link.is_symlink() {
        std::fs::remove_file(link)?;
    }
    symlink(port, link)
}

fn main() -> std::io::Result<()> {
    let (mut port, other_end) = TTYPort::pair()?;
    port.set_timeout(Duration::from_millis(1))?;
    let port_path = other_end.name().unwrap_or_default();
    if let Some(link) = std::env::args_os().nth(1).map(PathBuf::from) {
        point(&link, &port_path)?;
    }
    println!("port {port_path}");
    let centre_m = DVec2::new(0.5 * LINKAGE.base_m, 0.1);
    let mut board = EmulatedBoard::new(LINKAGE, centre_m);
    let (started, mut said) = (Instant::now(), Instant::now());
    let mut chunk = [0; 256];
    loop {
        let phase = TAU * started.elapsed().as_secs_f64() / PERIOD_S;
        board.move_handle(centre_m + DVec2::Y * (AMPLITUDE_M * phase.sin()));
        match port.read(&mut chunk) {
            Ok(length) => port.write_all(&board.receive(&chunk[..length]))?,
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            Err(error) => return Err(error),
        }
        if said.elapsed() > Duration::from_secs(1) {
            said = Instant::now();
            let force_n = board.force_n().unwrap_or(DVec2::ZERO);
            println!(
                "force on the hand {:+.3} N to the left, {:+.3} N towards the user",
                force_n.x, force_n.y
            );
        }
    }
}
