//! Acoustic warning.
//!
//! Programs that play sound are part of every desktop, and a sound library would bring C and packages of the system into
//! the build. The first such program found plays a short tone; without one, a bell character goes to the terminal. The tone
//! has three partials an octave apart, audible through white noise in headphones, and sounds at most once a second.

use std::io::{IsTerminal, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Programs that play a WAV file from standard input, with their arguments.
const PLAYERS: [(&str, &[&str]); 3] = [("pw-play", &["-"]), ("paplay", &[]), ("aplay", &["-q", "-"])];
/// Smallest interval between two tones.
const QUIET: Duration = Duration::from_secs(1);
const RATE_HZ: u32 = 48_000;
const LENGTH_S: f64 = 0.18;

/// Bell that rings at most once a second.
#[derive(Debug, Default)]
pub struct Bell {
    last: Option<Instant>,
    playing: Option<Child>,
}

impl Bell {
    /// Plays the tone, or without a player writes a bell character to the terminal; does nothing within a second of the last tone.
    pub fn ring(&mut self) {
        if self.last.is_some_and(|last| last.elapsed() < QUIET) {
            return;
        }
        self.last = Some(Instant::now());
        if let Some(mut done) = self.playing.take() {
            let _ = done.kill();
            let _ = done.wait();
        }
        self.playing = play(&tone());
        let mut terminal = std::io::stderr();
        if self.playing.is_none() && terminal.is_terminal() {
            let _ = terminal.write_all(b"\x07");
        }
    }
}

impl Drop for Bell {
    fn drop(&mut self) {
        if let Some(mut playing) = self.playing.take() {
            let _ = playing.wait(); // a fifth of a second
        }
    }
}

fn play(sound: &[u8]) -> Option<Child> {
    let path = std::env::var_os("PATH")?;
    let is_here =
        |name: &str| std::env::split_paths(&path).any(|folder| Path::new(&folder).join(name).is_file());
    let (name, arguments) = PLAYERS.into_iter().find(|(name, _)| is_here(name))?;
    let mut command = Command::new(name);
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().ok()?;
    // A pipe buffers 64 KiB without a reader, so this write does not block.
    let _ = child.stdin.take()?.write_all(sound);
    Some(child)
}

/// Returns the tone as a WAV file: 16-bit, one channel, 17 KB.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // amplitudes below one, a fifth of a second
fn tone() -> Vec<u8> {
    const PARTIALS_HZ: [f64; 3] = [880.0, 1760.0, 3520.0];
    let count = (f64::from(RATE_HZ) * LENGTH_S) as u32;
    let sample = |index: u32| {
        let time_s = f64::from(index) / f64::from(RATE_HZ);
        let fade = (time_s / 0.01).min((LENGTH_S - time_s) / 0.05).clamp(0.0, 1.0);
        let sum: f64 = PARTIALS_HZ.iter().map(|hz| (std::f64::consts::TAU * hz * time_s).sin()).sum();
        (sum / 3.0 * fade * 0.8 * f64::from(i16::MAX)) as i16
    };
    let bytes = 2 * count;
    let mut wav = Vec::with_capacity(44 + bytes as usize);
    wav.extend(b"RIFF");
    wav.extend((36 + bytes).to_le_bytes());
    wav.extend(b"WAVEfmt ");
    wav.extend(16_u32.to_le_bytes());
    wav.extend([1_u16, 1].map(u16::to_le_bytes).concat()); // PCM, one channel
    wav.extend([RATE_HZ, 2 * RATE_HZ].map(u32::to_le_bytes).concat());
    wav.extend([2_u16, 16].map(u16::to_le_bytes).concat()); // bytes and bits per sample
    wav.extend(b"data");
    wav.extend(bytes.to_le_bytes());
    wav.extend((0..count).flat_map(|index| sample(index).to_le_bytes()));
    wav
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tone_is_a_wav_file_of_the_length_it_says() {
        let wav = tone();
        assert_eq!((&wav[..4], &wav[8..16]), (b"RIFF".as_slice(), b"WAVEfmt ".as_slice()));
        let length = u32::from_le_bytes([wav[40], wav[41], wav[42], wav[43]]);
        assert_eq!(wav.len(), 44 + length as usize);
        assert!(wav.len() < 60_000, "a pipe takes it whole");
        let loudest = wav[44..].chunks(2).map(|s| i16::from_le_bytes([s[0], s[1]]).unsigned_abs()).max();
        assert!(loudest.is_some_and(|loudest| loudest > 10_000));
    }
}
