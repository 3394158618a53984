//! Escaping of control characters in text for a terminal: file names, messages and texts of plugins are untrusted.

/// Escapes control characters, except line ends and tabs, and characters that change the direction of the text. Not
/// real-time.
#[must_use]
pub fn escaped(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for character in text.chars() {
        if is_harmless(character) {
            shown.push(character);
        } else {
            shown.extend(character.escape_default());
        }
    }
    shown
}

fn is_harmless(character: char) -> bool {
    match character {
        '\n' | '\t' => true,
        // Marks, embeddings, overrides and isolates of the direction; separators of lines and paragraphs.
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => false,
        other => !other.is_control(),
    }
}

/// Returns the arguments of this process with control characters escaped. After a parse error, a parser parses the
/// escaped arguments again, so that its error message contains no control characters. Not real-time.
pub fn escaped_arguments() -> impl Iterator<Item = String> {
    std::env::args_os().map(|argument| escaped(&argument.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_controls_a_terminal_is_escaped_and_the_rest_is_not() {
        let hostile = "a\x1b]0;owned\x07b\x1b[31m\u{202e}c\u{9b}31m";
        assert_eq!(escaped(hostile), "a\\u{1b}]0;owned\\u{7}b\\u{1b}[31m\\u{202e}c\\u{9b}31m");
        assert_eq!(escaped("Größe\t1\n漢字 █┊"), "Größe\t1\n漢字 █┊");
    }
}
