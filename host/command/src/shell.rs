//! Commands that are printed for people to repeat.

/// Returns a command line that a shell reads as these arguments of `flotor`.
pub fn command_line<W: AsRef<str>>(arguments: impl IntoIterator<Item = W>) -> String {
    let words = arguments.into_iter().map(|word| format!(" {}", quoted(word.as_ref())));
    format!("flotor{}", words.collect::<String>())
}

/// Returns a word as a shell reads it back, in quotes where it needs them.
#[must_use]
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=,:@+%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
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
