//! Line of text without heap memory.

/// Capacity of a line with its newline, bytes; a longer text is truncated.
const BYTES: usize = 512;

/// Line under construction.
#[derive(Clone, Copy)]
pub(super) struct Line {
    bytes: [u8; BYTES],
    len: usize,
}

impl Line {
    /// Empty line.
    pub(super) const EMPTY: Self = Self { bytes: [0; BYTES], len: 0 };

    /// Returns the text so far, up to an incomplete character at the end.
    pub(super) fn text(&self) -> &str {
        let written = self.bytes.get(..self.len).unwrap_or_default();
        written.utf8_chunks().next().map_or("", |chunk| chunk.valid())
    }

    /// Returns the line with its newline.
    pub(super) fn as_bytes(&mut self) -> &[u8] {
        let len = self.len.min(BYTES - 1);
        if let Some(end) = self.bytes.get_mut(len) {
            *end = b'\n';
        }
        self.bytes.get(..=len).unwrap_or_default()
    }
}

impl std::fmt::Write for Line {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        for byte in text.bytes() {
            // The name of a plugin must not control the terminal.
            let byte = if byte.is_ascii_control() { b'?' } else { byte };
            match self.bytes.get_mut(self.len) {
                Some(place) if self.len < BYTES - 1 => *place = byte,
                _ => return Err(std::fmt::Error),
            }
            self.len += 1;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;

    #[test]
    fn a_line_ends_and_holds_no_other_ends() {
        let mut line = Line::EMPTY;
        write!(line, "tick {}\n\u{1b}[2J", 17).expect("it fits");
        assert_eq!(line.as_bytes(), b"tick 17??[2J\n");
    }

    #[test]
    fn a_line_that_is_too_long_is_cut() {
        let mut line = Line::EMPTY;
        assert!(write!(line, "{}", "x".repeat(10_000)).is_err());
        assert_eq!(line.as_bytes().len(), BYTES);
        assert_eq!(line.as_bytes().last(), Some(&b'\n'));
    }
}
