//! Colours, on terminals only; control characters in names and messages are escaped.
//!
//! Colours in a text are marks, noncharacters of Unicode, which are replaced by terminal escape sequences when the text is printed.

use flotor_hal::terminal::escaped;
use std::io::IsTerminal;

/// Marks in a text, each with its terminal escape sequence.
const MARKS: [(char, &str); 4] =
    [(ERROR, "\x1b[1;31m"), (WARNING, "\x1b[33m"), (TITLE, "\x1b[1m"), (PLAIN, "\x1b[0m")];
const ERROR: char = '\u{fdd0}';
const WARNING: char = '\u{fdd1}';
const TITLE: char = '\u{fdd2}';
const PLAIN: char = '\u{fdd3}';

fn painted(mark: char, text: &str, terminal: bool) -> String {
    let wanted = terminal && std::env::var_os("NO_COLOR").is_none();
    if wanted { format!("{mark}{text}{PLAIN}") } else { text.to_owned() }
}

/// Formats a text for a terminal: control characters are [escaped], and colour marks are replaced by terminal escape sequences.
#[must_use]
pub fn for_terminal(text: impl std::fmt::Display) -> String {
    let escaped = escaped(&text.to_string());
    MARKS.iter().fold(escaped, |shown, (mark, sequence)| shown.replace(*mark, sequence))
}

/// Returns a text in red and bold, for the first word of an error; unchanged if standard error is not a terminal or `NO_COLOR` is set.
#[must_use]
pub fn error(text: &str) -> String {
    painted(ERROR, text, std::io::stderr().is_terminal())
}

/// Returns a text in yellow, for the first word of a warning; unchanged if standard error is not a terminal or `NO_COLOR` is set.
#[must_use]
pub fn warning(text: &str) -> String {
    painted(WARNING, text, std::io::stderr().is_terminal())
}

/// Returns a text in bold, for titles; unchanged if standard output is not a terminal or `NO_COLOR` is set.
#[must_use]
pub fn title(text: &str) -> String {
    painted(TITLE, text, std::io::stdout().is_terminal())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_receives_no_control_character_but_those_of_a_style() {
        assert_eq!(for_terminal(painted(TITLE, "x\x1b", true)), "\x1b[1mx\\u{1b}\x1b[0m");
        assert_eq!(for_terminal("x\u{202e}"), "x\\u{202e}");
    }
}
