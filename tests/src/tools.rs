//! Tools that a machine may lack: programs, a display, a graphics adapter. A test without its tool is reported as skipped on
//! standard error, even if the test harness captures output; it fails if `FLOTOR_REQUIRE` names the tool.
//!
//! The file uses no other module of this crate: crates that cannot depend on the crate include it with `#[path]`.

use std::io::Write;

/// Name of the environment variable with the tools that a machine must have, such as `valgrind,display`. A test that lacks one of
/// these tools fails instead of being skipped.
pub const VARIABLE: &str = "FLOTOR_REQUIRE";

/// Tool of a test that a Rust toolchain does not provide everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    /// C compiler `cc`.
    Cc,
    /// C++ compiler `c++`.
    Cxx,
    /// Valgrind, which counts instructions.
    Valgrind,
    /// Virtual display Xvfb, and xdotool for mouse and keyboard events.
    Display,
    /// Graphics adapter, a GPU or a software renderer. [`required`] cannot detect it: the test does, and calls [`lacks`].
    Adapter,
    /// QEMU virtual machine.
    Qemu,
    /// Python without packages.
    Python,
    /// Python with numpy, pandas and scipy. [`required`] cannot detect it, because `FLOTOR_SCIENCE_PYTHON` may name another Python:
    /// the test does, and calls [`lacks`].
    SciencePython,
    /// R without packages.
    R,
    /// Rust formatter `rustfmt`. [`required`] cannot detect it, because a file `rustfmt` may belong to a missing toolchain: the
    /// test does, and calls [`lacks`].
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

    /// Returns the name of the tool in [`VARIABLE`].
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

/// Returns true if the programs of a tool are in `PATH`. Otherwise reports the calling test as skipped, and the test must return.
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

/// Reports that a test is skipped because the machine lacks a tool.
///
/// # Panics
/// If [`VARIABLE`] names the tool, or contains an unknown name: a typing error must not skip a test.
pub fn lacks(tool: Tool, why: &str) {
    let named = std::env::var(VARIABLE).unwrap_or_default();
    assert!(!names(&named, tool), "{VARIABLE}={named}, and this machine has no {}: {why}", tool.word());
    skipped(why);
}

/// Reports on standard error that a test, or a part of it, is skipped. Bypasses the test harness, which captures the output of
/// print macros only.
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
    // Counts all matches instead of stopping at the first, so that every name is checked.
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
