//! White noise on headphones, which masks the sound of the device (CMU-RI-TR-07-21, section 4). Samples are piped to an audio
//! player of the system.

use flotor_core::Random;
use flotor_servo::last_stop::spawn_unblocked;
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;

/// Sample rate, Hz.
const RATE_HZ: u32 = 44_100;
/// Peak amplitude: a quarter of full scale (32767); the system volume sets the loudness.
const LOUDEST: i16 = 8_000;

/// Audio players that accept 16-bit samples on standard input: name and arguments.
const PLAYERS: [(&str, &[&str]); 3] = [
    ("pw-cat", &["--playback", "--rate", "44100", "--channels", "1", "--format", "s16", "-"]),
    ("paplay", &["--raw", "--rate=44100", "--channels=1", "--format=s16le"]),
    ("aplay", &["-q", "-t", "raw", "-f", "S16_LE", "-r", "44100", "-c", "1"]),
];

/// White noise, played until dropped.
pub(super) struct WhiteNoise {
    player: Child,
    /// Thread that writes samples to the player; ends with the player.
    feeder: Option<JoinHandle<()>>,
    /// Program name of the player.
    pub(super) name: &'static str,
}

impl WhiteNoise {
    /// Starts the noise with the first player that works; `None` without a player or sound card. Waits 200 ms per player.
    #[must_use]
    pub(super) fn start() -> Option<Self> {
        PLAYERS.iter().find_map(|(name, arguments)| {
            let mut player = Command::new(name);
            player.args(*arguments).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
            let mut player = spawn_unblocked(&mut player).ok()?;
            let mut pipe = player.stdin.take()?;
            let feeder = std::thread::Builder::new().name("flotor-noise".to_owned()).spawn(move || {
                let mut random = Random::new(0, 0);
                while pipe.write_all(&tenth_of_a_second(&mut random)).is_ok() {}
            });
            let mut started = Self { player, feeder: feeder.ok(), name };
            // A player without a sound card exits at once.
            std::thread::sleep(std::time::Duration::from_millis(200));
            started.is_playing().then_some(started)
        })
    }

    fn is_playing(&mut self) -> bool {
        matches!(self.player.try_wait(), Ok(None))
    }
}

impl Drop for WhiteNoise {
    fn drop(&mut self) {
        let _ = self.player.kill();
        let _ = self.player.wait();
        if let Some(feeder) = self.feeder.take() {
            let _ = feeder.join();
        }
    }
}

/// Draws a sample of noise, -`LOUDEST` to `LOUDEST`.
fn sample(random: &mut Random) -> i16 {
    #[allow(clippy::cast_possible_truncation)] // at most LOUDEST
    let sample = (random.symmetric() * f64::from(LOUDEST)) as i16;
    sample
}

fn tenth_of_a_second(random: &mut Random) -> Vec<u8> {
    (0..RATE_HZ / 10).flat_map(|_| sample(random).to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White: neighbours at any small distance know nothing of each other, to four standard errors.
    #[test]
    fn noise_is_white_and_not_too_loud() {
        let mut random = Random::new(0, 0);
        let samples: Vec<f64> =
            (0..100_000).map(|_| f64::from(sample(&mut random)) / f64::from(LOUDEST)).collect();
        assert!(samples.iter().all(|sample| sample.abs() <= 1.0));
        for lag in [1, 2, 3, 10, 100] {
            let products: f64 = samples.iter().zip(&samples[lag..]).map(|(a, b)| a * b).sum();
            // A product of two even numbers in -1..1 has variance 1/9.
            let bound = 4.0 * (samples.len() as f64).sqrt() / 3.0;
            assert!(products.abs() < bound, "lag {lag}: {products}");
        }
    }
}
