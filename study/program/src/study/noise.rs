//! White noise on headphones, against the sound of the device (CMU-RI-TR-07-21, section 4). Flotor has no sound of its
//! own: it writes samples to a player of the system, where there is one.

use flotor_core::Random;
use flotor_servo::last_stop::spawn_unblocked;
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;

/// Samples per second and channel.
const RATE_HZ: u32 = 44_100;
/// Loudest sample, of 32767: a quarter of full scale, so that the volume of the system decides.
const LOUDEST: i16 = 8_000;

/// Players that take 16-bit samples from standard input: name and arguments.
const PLAYERS: [(&str, &[&str]); 3] = [
    ("pw-cat", &["--playback", "--rate", "44100", "--channels", "1", "--format", "s16", "-"]),
    ("paplay", &["--raw", "--rate=44100", "--channels=1", "--format=s16le"]),
    ("aplay", &["-q", "-t", "raw", "-f", "S16_LE", "-r", "44100", "-c", "1"]),
];

/// Noise, for as long as it lives.
pub(super) struct WhiteNoise {
    player: Child,
    /// Ends when the player does.
    feeder: Option<JoinHandle<()>>,
    name: &'static str,
}

impl WhiteNoise {
    /// Starts the first player there is; none if this machine has no player or no sound.
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
            // A player without a sound card ends at once.
            std::thread::sleep(std::time::Duration::from_millis(200));
            started.is_playing().then_some(started)
        })
    }

    /// The player's name.
    #[must_use]
    pub(super) fn player(&self) -> &'static str {
        self.name
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

/// A sample of noise, -`LOUDEST` to `LOUDEST`.
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
