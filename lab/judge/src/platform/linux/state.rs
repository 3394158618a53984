//! State of this process and thread, from the files under `/proc`.

use crate::platform::process::{May, Part};
use crate::validate::Outcome;
use rustix::io::Errno;
use rustix::process::{WaitId, WaitIdOptions, waitid};
use std::fs;
use std::path::Path;

/// Returns the finding that `/proc` is missing.
fn no_files() -> Outcome {
    Outcome::Missing("the test needs /proc; mount /proc".to_owned())
}

/// Returns the parts of the state of this process and thread that only the kernel knows.
///
/// # Errors
/// [`Outcome::Missing`] without `/proc`.
pub(crate) fn of_the_system() -> Result<Vec<Part>, Outcome> {
    let whole = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let (process, thread) = (whole("/proc/self/status"), whole("/proc/thread-self/status"));
    if process.is_empty() || thread.is_empty() {
        return Err(no_files());
    }
    let named = |text: &str, names: &[&str]| -> Vec<String> {
        let lines = text.lines().filter(|line| names.iter().any(|name| line.starts_with(name)));
        lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
    };
    let limits = whole("/proc/self/limits");
    Ok(vec![
        ("signal handlers", May::Stay, [signals(&process, "SigIgn:"), signals(&process, "SigCgt:")].into()),
        ("the blocked signals", May::Stay, vec![signals(&thread, "SigBlk:")]),
        ("the processors of the thread", May::Stay, named(&thread, &["Cpus_allowed:"])),
        ("the scheduling of the thread", May::Stay, scheduling()),
        ("the limits of the process", May::Stay, limits.lines().map(str::to_owned).collect()),
        ("umask or tracer", May::Stay, named(&process, &["Umask:", "TracerPid:"])),
        ("child processes", May::GrowInLife, children().map(str::to_owned).into_iter().collect()),
        ("timers", May::Stay, named(&whole("/proc/self/timers"), &["ID:", "signal:"])),
        ("open files", May::Grow, files()),
    ])
}

/// Returns the number of threads of this process.
///
/// # Errors
/// [`Outcome::Missing`] without `/proc`.
pub(crate) fn threads() -> Result<usize, Outcome> {
    fs::read_dir("/proc/self/task").map(Iterator::count).map_err(|_| no_files())
}

/// Checks that a library of that name is mapped in this process, as after a preload.
///
/// # Errors
/// [`Outcome::Missing`] if the library is not loaded.
pub(crate) fn is_loaded_first(library: &str) -> Result<(), Outcome> {
    let mapped = fs::read_to_string("/proc/self/maps").unwrap_or_default();
    match mapped.contains(library) {
        true => Ok(()),
        false if mapped.is_empty() => Err(no_files()),
        false => Err(Outcome::Missing(format!(
            "{library} is not loaded; build the library (package `flotor-guard`), or reinstall Flotor"
        ))),
    }
}

/// Returns "at least one" if there are child processes. An ended child stays waitable, because the plugin may wait for it.
fn children() -> Option<&'static str> {
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    (waitid(WaitId::All, options).err() != Some(Errno::CHILD)).then_some("at least one")
}

/// Formats a set of signals by their numbers, without 32 and 33: the C library uses those for its threads.
fn signals(status: &str, name: &str) -> String {
    let set = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix(name)?.trim(), 16).ok());
    let set = set.unwrap_or_default();
    let numbers = (1_u32..=64).filter(|number| !matches!(number, 32 | 33) && set >> (number - 1) & 1 == 1);
    let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
    format!("{name} {}", if numbers.is_empty() { "none".to_owned() } else { numbers.join(" ") })
}

/// Returns nice value, real-time priority and policy, by their fields in proc(5).
fn scheduling() -> Vec<String> {
    let text = fs::read_to_string("/proc/thread-self/stat").unwrap_or_default();
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let of = |(name, field): (&str, usize)| format!("{name} {}", fields.get(field - 3).unwrap_or(&"unknown"));
    [("nice", 19), ("real-time priority", 40), ("policy", 41)].map(of).to_vec()
}

/// Returns the open files. Leaves out the descriptor that reads the folder, whose name differs each time.
fn files() -> Vec<String> {
    let entries = fs::read_dir("/proc/self/fd").into_iter().flatten().flatten();
    let named = entries.filter_map(|entry| Some((entry.file_name(), fs::read_link(entry.path()).ok()?)));
    let kept = named.filter(|(_, target)| !target.starts_with(Path::new("/proc")));
    kept.map(|(number, target)| format!("{} -> {}", number.display(), target.display())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_are_told_by_their_numbers_without_those_of_the_c_library() {
        let status = "Name:\tx\nSigIgn:\t0000000180001000\nSigCgt:\t0000000000000000\n";
        assert_eq!(signals(status, "SigIgn:"), "SigIgn: 13");
        assert_eq!(signals(status, "SigCgt:"), "SigCgt: none");
    }
}
