//! What a machine may lack: programs, a display, a graphics adapter. A test that is skipped for it says so on standard error, also
//! where the harness keeps what tests print, and fails where `FLOTOR_REQUIRE` names the tool.
//!
//! Needs nothing of this crate: crates that cannot depend on it include this file with `#[path]`.

use std::io::Write;

/// Environment variable: the tools a machine must have, `valgrind,display`. A test never skips for lack of one of them.
pub const VARIABLE: &str = "FLOTOR_REQUIRE";

/// What tests use beyond Rust.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    /// A C compiler.
    Cc,
    /// A C++ compiler.
    Cxx,
    /// Counts instructions.
    Valgrind,
    /// A virtual display, and what pushes its mouse and keys.
    Display,
    /// Draws with a GPU or as one. No program: who looks for it calls [`lacks`].
    Adapter,
    /// A virtual machine.
    Qemu,
    /// Python, without any package.
    Python,
    /// Python with numpy, pandas and scipy. Who needs it calls [`lacks`], as it may be another Python (`FLOTOR_SCIENCE_PYTHON`).
    SciencePython,
    /// R, without any package.
    R,
    /// The formatter of Rust. A link of that name may lead nowhere: who needs it calls [`lacks`].
    Rustfmt,
}

impl Tool {
    const ALL: [Self; 10] = [
        Self::Cc,
        Self::Cxx,
        Self::Valgrind,
        Self::Display,
        Self::Adapter,
        Self::Qemu,
        Self::Python,
        Self::SciencePython,
        Self::R,
        Self::Rustfmt,
    ];

    /// Its word in [`VARIABLE`].
    const fn word(self) -> &'static str {
        match self {
            Self::Cc => "cc",
            Self::Cxx => "cxx",
            Self::Valgrind => "valgrind",
            Self::Display => "display",
            Self::Adapter => "adapter",
            Self::Qemu => "qemu",
            Self::Python => "python",
            Self::SciencePython => "science-python",
            Self::R => "r",
            Self::Rustfmt => "rustfmt",
        }
    }

    const fn programs(self) -> &'static [&'static str] {
        match self {
            Self::Cc => &["cc"],
            Self::Cxx => &["c++"],
            Self::Valgrind => &["valgrind"],
            Self::Display => &["Xvfb", "xdotool"],
            Self::Adapter | Self::SciencePython | Self::Rustfmt => &[],
            Self::Qemu => &["qemu-system-x86_64"],
            Self::Python => &["python3"],
            Self::R => &["Rscript"],
        }
    }
}

/// True if the programs of a tool are installed; else the test that asks is to return: that it is skipped has been told.
///
/// # Panics
/// As [`lacks`].
#[must_use]
pub fn required(tool: Tool) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let is_there = |name: &&str| std::env::split_paths(&path).any(|folder| folder.join(name).is_file());
    let missing: Vec<&str> = tool.programs().iter().copied().filter(|name| !is_there(name)).collect();
    if !missing.is_empty() {
        lacks(tool, &format!("{} not installed", missing.join(" and ")));
    }
    missing.is_empty()
}

/// Tells that a test is skipped because the machine lacks a tool.
///
/// # Panics
/// If [`VARIABLE`] names the tool, or holds a word that names none: a typing error must not skip a test.
pub fn lacks(tool: Tool, why: &str) {
    let named = std::env::var(VARIABLE).unwrap_or_default();
    assert!(!names(&named, tool), "{VARIABLE}={named}, and this machine has no {}: {why}", tool.word());
    skipped(why);
}

/// Tells that a test, or a part of it, is skipped: past the harness, which keeps what tests print by macros.
///
/// # Panics
/// If standard error cannot be written to.
pub fn skipped(why: &str) {
    let thread = std::thread::current();
    let line = format!("skipped: {}: {why}\n", thread.name().unwrap_or("a test"));
    std::io::stderr().write_all(line.as_bytes()).expect("standard error is open");
}

fn names(words: &str, tool: Tool) -> bool {
    let named = words.split(',').map(str::trim).filter(|word| !word.is_empty()).map(|word| {
        let known = Tool::ALL.into_iter().find(|tool| tool.word() == word);
        known.unwrap_or_else(|| {
            panic!("{VARIABLE}: no `{word}`; one of {:?} is expected", Tool::ALL.map(Tool::word))
        })
    });
    // All are looked at, for the wrong one among them.
    named.filter(|named| *named == tool).count() > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_names_its_tools_and_no_others() {
        assert!(names("valgrind, display", Tool::Display) && !names("valgrind", Tool::Display));
        assert!(!names("", Tool::Cc));
        let wrong = std::panic::catch_unwind(|| names("display,valgrnd", Tool::Display));
        assert!(wrong.is_err(), "a typing error must not skip a test");
    }
}
