//! Command lines that are printed for users to copy.

/// Returns a command line of `flotor` with the arguments quoted for a POSIX shell.
pub fn command_line<W: AsRef<str>>(arguments: impl IntoIterator<Item = W>) -> String {
    let words = arguments.into_iter().map(|word| format!(" {}", quoted(word.as_ref())));
    format!("flotor{}", words.collect::<String>())
}

/// Quotes a word for a POSIX shell, if necessary.
#[must_use]
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=,:@+%".contains(c);
    let is_word = !word.is_empty() && word.chars().all(is_plain);
    if is_word { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_line_survives_a_shell() {
        let line = command_line(["run", "my scene.toml", "--set", "a.b=it's", ""]);
        assert_eq!(line, "flotor run 'my scene.toml' --set 'a.b=it'\\''s' ''");
    }
}
