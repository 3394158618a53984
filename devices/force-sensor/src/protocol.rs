//! Serial protocol of the sensor: lines of ASCII, simple enough for a terminal program and for a microcontroller sketch
//! of twenty lines.
//!
//! | host | sensor | |
//! |---|---|---|
//! | `R` | `F 1.234` | read: the vertical force on the sensor, N, upwards positive |
//! | anything else, or out of range | `E words` | cause of the error |
//!
//! Lines end in a line feed; a carriage return before the line feed is ignored.

/// Request for a reading, with its line feed.
pub const QUESTION: &[u8] = b"R\n";
/// Limit on the length of a line, bytes: a number of any precision, or a sentence.
pub const LONGEST_LINE_BYTES: usize = 200;
/// Limit of plausible forces, N: above the range of such sensors.
pub const PLAUSIBLE_N: f64 = 500.0;

/// Parses the force of a reply, N, upwards positive; `None` for any other text, or beyond [`PLAUSIBLE_N`]. Real-time:
/// bounded, no allocation.
#[must_use]
pub fn parse(answer: &[u8]) -> Option<f64> {
    let answer = std::str::from_utf8(answer).ok()?;
    let force_n: f64 = answer.strip_prefix("F ")?.trim().parse().ok()?;
    (force_n.abs() <= PLAUSIBLE_N).then_some(force_n) // false for NaN
}

/// Parser that splits received bytes into lines.
#[derive(Clone, Debug)]
pub struct Lines {
    text: [u8; LONGEST_LINE_BYTES],
    length: usize,
    /// True if the last byte completed a line: the next byte begins a new one.
    is_whole: bool,
}

impl Default for Lines {
    fn default() -> Self {
        Self { text: [0; LONGEST_LINE_BYTES], length: 0, is_whole: false }
    }
}

impl Lines {
    /// Discards an incomplete line. Real-time: bounded, no allocation.
    pub fn clear(&mut self) {
        (self.length, self.is_whole) = (0, false);
    }

    /// Appends a byte; returns the line that the byte completes, or a line that has reached its maximum length. Real-time: bounded, no
    /// allocation.
    pub fn push(&mut self, byte: u8) -> Option<&[u8]> {
        if std::mem::take(&mut self.is_whole) {
            self.length = 0;
        }
        if byte != b'\n'
            && let Some(place) = self.text.get_mut(self.length)
        {
            *place = byte;
            self.length += 1;
        }
        self.is_whole = byte == b'\n' || self.length == LONGEST_LINE_BYTES;
        self.is_whole.then(|| self.last())
    }

    /// Returns the last line, complete or not, without its line end.
    #[must_use]
    pub fn last(&self) -> &[u8] {
        let line = self.text.get(..self.length).unwrap_or_default();
        line.strip_suffix(b"\r").unwrap_or(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_no_force_is_none() {
        for (answer, force_n) in
            [("F 1.5", Some(1.5)), ("F -2e-1", Some(-0.2)), ("F  3 ", Some(3.0)), ("F 501", None)]
        {
            assert_eq!(parse(answer.as_bytes()), force_n, "{answer}");
        }
        for answer in ["", "F", "F nan", "F inf", "E overload", "1.5", "F 1,5", "F \u{ff11}"] {
            assert_eq!(parse(answer.as_bytes()), None, "{answer}");
        }
        assert_eq!(parse(b"F \xff"), None);
    }

    #[test]
    fn lines_end_in_a_line_feed_or_where_nobody_reads_on() {
        let mut lines = Lines::default();
        let ended: Vec<Vec<u8>> =
            b"F 1\r\n\nF 2".iter().filter_map(|byte| lines.push(*byte).map(<[u8]>::to_vec)).collect();
        assert_eq!(ended, [&b"F 1"[..], b""]);
        assert_eq!(lines.last(), b"F 2");
        lines.clear();
        let long =
            (0..LONGEST_LINE_BYTES).filter_map(|_| lines.push(b'x').map(<[u8]>::len)).collect::<Vec<_>>();
        assert_eq!(long, [LONGEST_LINE_BYTES]);
        assert_eq!(lines.push(b'F'), None);
        assert_eq!(lines.last(), b"F");
    }

    proptest! {
        /// However the bytes of a force are cut, and whatever came before its line, it is read.
        #[test]
        fn a_force_is_read_after_any_noise(noise in proptest::collection::vec(any::<u8>(), 0..600), force_n in -500.0..500.0_f64) {
            let mut lines = Lines::default();
            let answer = format!("\nF {force_n}\r\n");
            let mut polled = None;
            for byte in noise.iter().copied().chain(answer.bytes()) {
                polled = lines.push(byte).map(parse);
            }
            prop_assert_eq!(polled, Some(Some(force_n)));
        }
    }
}
