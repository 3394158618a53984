//! The rig of the vertical calibration around the emulated device: a stand that comes down step by step in place of the
//! hand, and a force sensor on a pseudo terminal that answers `R` with `F` and the force on it in N.

use serialport::{SerialPort, TTYPort};
use std::error::Error;
use std::fmt::Write as _;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Mass of flotor, plates, screws and bolts, kg: 8.58 N (Varadharajan 2007, section 3.4) at standard gravity.
const MASS_KG: f64 = 0.874_917;
/// The stand: stiff and damped, N/m and N·s/m.
const STIFFNESS_N_PER_M: f64 = 20_000.0;
const DAMPING_NS_PER_M: f64 = 250.0;
/// Highest and lowest place of the stand, mm: what the thesis measured.
const TOP_MM: f64 = 7.0;
/// Time of one step down, s: a twentieth of a millimetre's worth of hurry.
const MOVE_S: f64 = 0.15;
/// Time back up to the top, s.
const RETURN_S: f64 = 1.0;
/// Movements a script may have: the stand comes down as often as there is room for.
const MOVEMENTS: u32 = 10_000;

/// What it feels, N; shared with whoever answers.
#[derive(Clone, Default)]
pub(crate) struct SensedForce(Arc<AtomicU64>);

impl SensedForce {
    pub(crate) fn press(&self, force_n: f64) {
        self.0.store(force_n.to_bits(), Ordering::Release);
    }

    fn value_n(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Acquire))
    }
}

/// Settings of the simulated flotor in the rig; the stand's steps are written to a file beside the sensor's name.
pub(crate) fn settings(
    link: &Path,
    step_mm: f64,
    stop_s: f64,
) -> Result<Vec<(&'static str, String)>, Box<dyn Error>> {
    let script = link.with_extension("stand.toml");
    std::fs::write(&script, staircase(step_mm, stop_s))
        .map_err(|error| format!("{}: {error}", script.display()))?;
    Ok(vec![
        ("preset", "full".to_owned()),
        ("mass_kg", MASS_KG.to_string()),
        ("feedforward_n", "0".to_owned()),
        ("hand_mass_kg", "0".to_owned()),
        ("hand_stiffness_n_per_m", STIFFNESS_N_PER_M.to_string()),
        ("hand_damping_ns_per_m", DAMPING_NS_PER_M.to_string()),
        ("hand_script", script.display().to_string()),
    ])
}

/// Down from the top in equal steps, waiting at each, and up again, over and over.
fn staircase(step_mm: f64, stop_s: f64) -> String {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a handful
    let steps = (2.0 * TOP_MM / step_mm).round() as u32;
    let mut text = format!("title = \"Calibration stand\"\nrepeat = {}\n", MOVEMENTS / (2 * (steps + 1)));
    for step in 0..=steps {
        let (to_mm, move_s) = (TOP_MM - f64::from(step) * step_mm, if step == 0 { RETURN_S } else { MOVE_S });
        // Writing to a text does not fail.
        let _ = write!(
            text,
            "\n[[step]]\nmove = {{ to_mm = [0, 0, {to_mm:?}], duration_s = {move_s:?} }}\n\n\
             [[step]]\nhold = {{ duration_s = {stop_s:?} }}\n"
        );
    }
    text
}

/// Answers at a pseudo terminal, with a name as a symbolic link, for as long as the program runs.
pub(crate) fn serve(link: &Path, force: SensedForce) -> Result<PathBuf, Box<dyn Error>> {
    let (mut ours, theirs) = TTYPort::pair()?;
    ours.set_timeout(Duration::from_secs(3600))?;
    let name = PathBuf::from(theirs.name().ok_or("the pseudo terminal of the force sensor has no name")?);
    super::link_to(&name, link)?;
    std::thread::Builder::new().name("force-sensor".to_owned()).spawn(move || {
        // Held open, or the terminal hangs up whenever nobody listens.
        let _theirs = theirs;
        let mut asked = Vec::new();
        let mut byte = [0];
        loop {
            match ours.read(&mut byte) {
                Ok(1) if byte == *b"\n" => {
                    let answer = match asked.trim_ascii() {
                        b"R" => format!("F {:.4}\n", force.value_n()),
                        _ => "E only R is understood\n".to_owned(),
                    };
                    asked.clear();
                    let _ = ours.write_all(answer.as_bytes());
                }
                // A line that does not end is none: its start is forgotten.
                Ok(1) if asked.len() < 80 => asked.push(byte[0]),
                Ok(_) => asked.clear(),
                Err(error) if error.kind() == std::io::ErrorKind::TimedOut => {}
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(_) => return,
            }
        }
    })?;
    Ok(name)
}
