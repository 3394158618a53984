//! Colours, on terminals only.

use std::io::IsTerminal;

fn painted(code: &str, text: &str, terminal: bool) -> String {
    let wanted = terminal && std::env::var_os("NO_COLOR").is_none();
    if wanted { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
}

/// Red and bold, for the first word of an error.
#[must_use]
pub fn error(text: &str) -> String {
    painted("1;31", text, std::io::stderr().is_terminal())
}

/// Yellow, for the first word of a warning.
#[must_use]
pub fn warning(text: &str) -> String {
    painted("33", text, std::io::stderr().is_terminal())
}

/// Bold, for titles.
#[must_use]
pub fn title(text: &str) -> String {
    painted("1", text, std::io::stdout().is_terminal())
}
