//! Text files that people write, and where in them something is wrong.

use std::fmt;
use std::path::Path;

/// What is wrong with a text file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextProblem {
    /// Line, from 1; 0 where it is about the file as a whole.
    pub line: usize,
    /// What is wrong and what would be right.
    pub problem: String,
}

impl TextProblem {
    /// In this line, from 1. Not real-time.
    pub fn at(line: usize, problem: impl Into<String>) -> Self {
        Self { line, problem: problem.into() }
    }

    /// About the file as a whole. Not real-time.
    pub fn of_file(problem: impl Into<String>) -> Self {
        Self::at(0, problem)
    }

    /// `FILE:LINE: PROBLEM`, without the line where there is none. Not real-time.
    #[must_use]
    pub fn in_file(&self, file: impl fmt::Display) -> String {
        match self.line {
            0 => format!("{file}: {}", self.problem),
            line => format!("{file}:{line}: {}", self.problem),
        }
    }
}

/// Reads a text file; `what` names it where it cannot be read. Not real-time.
///
/// # Errors
/// What the system says, or the first line that is not UTF-8.
pub fn read_text(path: &Path, what: &str) -> Result<String, TextProblem> {
    let bytes =
        std::fs::read(path).map_err(|error| TextProblem::of_file(format!("cannot read {what}: {error}")))?;
    String::from_utf8(bytes).map_err(|error| {
        let before = error.as_bytes().iter().take(error.utf8_error().valid_up_to());
        let line = 1 + before.filter(|byte| **byte == b'\n').count();
        TextProblem::at(line, "this is not UTF-8; save the file as UTF-8")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_line_that_is_no_text_is_told() {
        let path = std::env::temp_dir().join(format!("flotor-text-{}", std::process::id()));
        std::fs::write(&path, b"one\ntwo \xff\nthree\xfe\n").expect("the folder can be written to");
        let told = read_text(&path, "it").map_err(|wrong| wrong.in_file("it.txt"));
        assert_eq!(told.unwrap_err(), "it.txt:2: this is not UTF-8; save the file as UTF-8");
        std::fs::remove_file(&path).expect("it is there");
        let told = read_text(&path, "it").map_err(|wrong| wrong.in_file("it.txt"));
        assert!(told.unwrap_err().starts_with("it.txt: cannot read it: "));
    }
}
