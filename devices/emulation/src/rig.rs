//! Emulated rig of the vertical calibration: a stand that holds the handle and comes down step by step, and a force
//! sensor on a pseudo terminal that replies to `R` with `F` and the measured force in N.

use crate::command_line::{link_to, within};
use clap::Args;
use serialport::{SerialPort, TTYPort};
use std::error::Error;
use std::fmt::Write as _;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Height of the top of the stand's travel above the middle of the travel, and depth of the bottom below the middle, mm: the range
/// measured in the thesis (Varadharajan 2007, section 3.4).
const TOP_MM: f64 = 7.0;
/// Time of one step down, s.
const MOVE_S: f64 = 0.15;
/// Time back up to the top, s.
const RETURN_S: f64 = 1.0;
/// Limit on the movements of a script; the number of rounds follows from it.
const MOVEMENTS: u32 = 10_000;
/// Longest command line that the sensor accepts, bytes.
const LINE_BYTES: usize = 80;

/// Command line options of the rig.
#[derive(Args, Clone, Debug)]
pub struct RigArguments {
    /// Hold the handle in a calibration rig instead of a hand: a stand that moves down step by step, and a force sensor
    /// at a pseudo terminal; PATH becomes a symbolic link to the terminal
    #[arg(long, value_name = "PATH")]
    calibration_rig: Option<PathBuf>,
    /// Calibration rig: step of the stand, in mm, 0.1 to 7
    #[arg(long, default_value_t = 1.0, value_name = "MM", requires = "calibration_rig")]
    #[arg(value_parser = within(0.1, TOP_MM, "mm"))]
    rig_step_mm: f64,
    /// Calibration rig: time at each step, in s, 0.1 to 600
    #[arg(long, default_value_t = 1.0, value_name = "S", requires = "calibration_rig")]
    #[arg(value_parser = within(0.1, 600.0, "s"))]
    rig_stop_s: f64,
}

impl RigArguments {
    /// Returns the path for the link to the terminal of the force sensor, and the stand; `None` without a rig.
    #[must_use]
    pub fn rig(&self) -> Option<(&Path, Stand)> {
        let stand = Stand { step_mm: self.rig_step_mm, stop_s: self.rig_stop_s };
        self.calibration_rig.as_deref().map(|link| (link, stand))
    }
}

/// Stand that goes down from the top in equal steps, pauses at each, and returns to the top, repeatedly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stand {
    step_mm: f64,
    stop_s: f64,
}

impl Stand {
    /// Returns target, mm, and duration, s, of each movement of a round; the return from bottom to top comes first.
    fn round(self) -> impl Iterator<Item = (f64, f64)> {
        (0..=self.steps()).map(move |step| {
            (TOP_MM - f64::from(step) * self.step_mm, if step == 0 { RETURN_S } else { MOVE_S })
        })
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a handful
    fn steps(self) -> u32 {
        (2.0 * TOP_MM / self.step_mm).round() as u32
    }

    /// Returns the height of the stand above the middle of its travel at time `at`, m. The motion begins at the bottom of the
    /// travel.
    #[must_use]
    pub fn height_m(&self, at: Duration) -> f64 {
        let round_s: f64 = self.round().map(|(_, move_s)| move_s + self.stop_s).sum();
        let mut left_s = at.as_secs_f64() % round_s;
        let mut from_mm = TOP_MM - f64::from(self.steps()) * self.step_mm;
        for (to_mm, move_s) in self.round() {
            if left_s < move_s + self.stop_s {
                // Quintic blend: no jump of speed or acceleration at either end.
                let share = (left_s / move_s).min(1.0);
                let smooth = share * share * share * (share * (6.0 * share - 15.0) + 10.0);
                return (from_mm + (to_mm - from_mm) * smooth) * 1.0e-3;
            }
            left_s -= move_s + self.stop_s;
            from_mm = to_mm;
        }
        from_mm * 1.0e-3
    }

    /// Returns the motion as a TOML script for the simulated hand, with as many rounds as a script may have.
    #[must_use]
    pub fn script(&self) -> String {
        let (stop_s, repeat) = (self.stop_s, MOVEMENTS / (2 * (self.steps() + 1)));
        let mut text = format!("title = \"Calibration stand\"\nrepeat = {repeat}\n");
        for (to_mm, move_s) in self.round() {
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                "\n[[step]]\nmove = {{ to_mm = [0, 0, {to_mm:?}], duration_s = {move_s:?} }}\n\n\
                 [[step]]\nhold = {{ duration_s = {stop_s:?} }}\n"
            );
        }
        text
    }
}

/// Runs the force sensor on a pseudo terminal for the life of the process and returns the terminal's path. `link` becomes a symbolic
/// link to the terminal; `force_n` returns the force at each reading, N.
///
/// # Errors
/// If the terminal, the link or the thread cannot be created.
pub fn serve(
    link: &Path,
    mut force_n: impl FnMut() -> f64 + Send + 'static,
) -> Result<PathBuf, Box<dyn Error>> {
    let (mut ours, theirs) = TTYPort::pair()?;
    ours.set_timeout(Duration::from_secs(3600))?;
    let name = PathBuf::from(
        theirs
            .name()
            .ok_or("the pseudo terminal of the force sensor has no name; start the emulator again")?,
    );
    link_to(&name, link)?;
    std::thread::Builder::new().name("force-sensor".to_owned()).spawn(move || {
        // Hold the other end open: otherwise the terminal hangs up whenever no client has it open.
        let _theirs = theirs;
        let mut asked = Vec::new();
        let mut byte = [0];
        loop {
            match ours.read(&mut byte) {
                Ok(1) if byte == *b"\n" => {
                    let answer = match asked.trim_ascii() {
                        b"R" => format!("F {:.4}\n", force_n()),
                        _ => "E only R is supported\n".to_owned(),
                    };
                    asked.clear();
                    let _ = ours.write_all(answer.as_bytes());
                }
                // Overlong line: drop the bytes so far.
                Ok(1) if asked.len() < LINE_BYTES => asked.push(byte[0]),
                Ok(_) => asked.clear(),
                Err(error) if error.kind() == io::ErrorKind::TimedOut => {}
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(_) => return,
            }
        }
    })?;
    Ok(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stand_goes_up_and_comes_down_in_steps_over_and_over() {
        let stand = Stand { step_mm: 2.0, stop_s: 0.5 };
        let height_mm = |at_s: f64| stand.height_m(Duration::from_secs_f64(at_s)) * 1.0e3;
        // Up in a second, then seven steps of 0.15 s; half a second at each of the eight places.
        let round_s = 1.0 + 7.0 * 0.15 + 8.0 * 0.5;
        for round in [0.0, 3.0] {
            let at_mm = |at_s: f64| height_mm(round * round_s + at_s);
            // Rounding of the time, at a speed of some 25 mm/s.
            let is_at =
                |at_s: f64, mm: f64| assert!((at_mm(at_s) - mm).abs() < 1.0e-9, "{at_s}: {}", at_mm(at_s));
            is_at(1.0e-9, -7.0);
            is_at(0.5, 0.0);
            for step in 0..8 {
                let stops_s = 1.0 + f64::from(step) * 0.65;
                is_at(stops_s + 0.01, 7.0 - 2.0 * f64::from(step));
                is_at(stops_s + 0.49, 7.0 - 2.0 * f64::from(step));
            }
        }
        let fastest_m_per_s = (0..7_000)
            .map(Duration::from_millis)
            .map(|at| (stand.height_m(at + Duration::from_millis(1)) - stand.height_m(at)).abs() * 1.0e3)
            .fold(0.0, f64::max);
        // 15/8 of the mean speed up; a calibration takes a handle at 0.1 m/s for one that nobody holds.
        assert!((fastest_m_per_s - 15.0 / 8.0 * 14.0e-3).abs() < 1.0e-5, "{fastest_m_per_s}");
        let script = stand.script();
        assert_eq!(script.matches("move").count(), 8);
        assert!(script.contains("to_mm = [0, 0, -7.0], duration_s = 0.15"), "{script}");
    }

    #[test]
    fn the_sensor_answers_questions_with_the_force_of_that_moment() {
        let folder = tempfile::tempdir().expect("there is a folder for such");
        let link = folder.path().join("force");
        let mut asked = 0;
        let count = move || {
            asked += 1;
            f64::from(asked)
        };
        let name = serve(&link, count).expect("there is a pseudo terminal");
        assert_eq!(std::fs::read_link(&link).expect("it is a link"), name);
        let port = serialport::new(name.to_string_lossy(), 115_200).timeout(Duration::from_secs(20));
        let mut port = port.open().expect("the sensor is there");
        let mut answers = |question: &[u8], lines: usize| {
            port.write_all(question).expect("it listens");
            let (mut text, mut byte) = (String::new(), [0]);
            while text.matches('\n').count() < lines {
                port.read_exact(&mut byte).expect("it answers");
                text.push(char::from(byte[0]));
            }
            text
        };
        assert_eq!(answers(b"R\nR\n", 2), "F 1.0000\nF 2.0000\n");
        assert_eq!(answers(b"force?\nR\n", 2), "E only R is supported\nF 3.0000\n");
        // Somebody's file is left alone.
        let file = folder.path().join("file");
        std::fs::write(&file, "mine").expect("the folder is there");
        assert!(serve(&file, || 0.0).is_err());
        assert_eq!(std::fs::read_to_string(&file).expect("it is there"), "mine");
    }
}
