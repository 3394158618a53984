//! State of the process that any plugin can change: recorded before plugin code runs, and restored after it returns.
//!
//! The state of a thread (priority, cores, floating-point environment) need not be restored: plugin code runs in a separate thread.
//! Only the main thread can be changed by other threads, through the process id.

use super::locale;
use rustix::fs::Mode;
use rustix::process::{Resource, Rlimit, chdir, getcwd, getpid, getrlimit, setrlimit};
use rustix::process::{getpriority_process, setpriority_process, umask};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::ffi::CString;

/// Resource limits that a run depends on, with their names in notices.
const LIMITS: [(Resource, &str); 6] = [
    (Resource::Nofile, "the limit of open files"),
    (Resource::Fsize, "the limit of file sizes"),
    (Resource::As, "the limit of address space"),
    (Resource::Memlock, "the limit of locked memory"),
    (Resource::Cpu, "the limit of processor time"),
    (Resource::Rttime, "the limit of real-time processor time"),
];

/// State of the process that plugins share with the host; `None` for a part that could not be read.
pub(crate) struct MachineState {
    folder: Option<CString>,
    limits: [Rlimit; LIMITS.len()],
    cores: Option<CpuSet>,
    nice: Option<i32>,
    mask: Option<Mode>,
    locale: Option<CString>,
}

impl MachineState {
    /// Reads the current state. Not real-time.
    pub(crate) fn now() -> Self {
        Self {
            folder: getcwd(Vec::new()).ok(),
            limits: LIMITS.map(|(resource, _)| getrlimit(resource)),
            cores: sched_getaffinity(Some(getpid())).ok(),
            nice: getpriority_process(Some(getpid())).ok(),
            mask: file_mask(),
            locale: locale::now(),
        }
    }

    /// Restores the changed parts and returns the names of all changed parts, also of those that the system refuses to restore. Not
    /// real-time.
    pub(crate) fn restore(&self) -> Vec<&'static str> {
        let Self { folder, limits, cores, nice, mask, locale } = self;
        let now = Self::now();
        let mut changed = Vec::new();
        if let Some(folder) = lost(folder, &now.folder) {
            let _ = chdir(folder);
            changed.push("the working folder");
        }
        for ((resource, name), (before, after)) in LIMITS.into_iter().zip(limits.iter().zip(&now.limits)) {
            if before != after {
                let _ = setrlimit(resource, *before);
                changed.push(name);
            }
        }
        if let Some(cores) = lost(cores, &now.cores) {
            let _ = sched_setaffinity(Some(getpid()), cores);
            changed.push("the cores of the main thread");
        }
        if let Some(nice) = lost(nice, &now.nice) {
            let _ = setpriority_process(Some(getpid()), *nice);
            changed.push("the priority of the main thread");
        }
        if let Some(mask) = lost(mask, &now.mask) {
            let _ = umask(*mask);
            changed.push("the mode mask of new files");
        }
        if let Some(locale) = lost(locale, &now.locale) {
            locale::set(locale);
            changed.push("the locale");
        }
        changed
    }
}

/// Returns the former value of a part; `None` if it is unknown or unchanged.
fn lost<'a, T: PartialEq>(before: &'a Option<T>, now: &Option<T>) -> Option<&'a T> {
    before.as_ref().filter(|before| now.as_ref() != Some(before))
}

/// Returns the file mode creation mask (umask) from `/proc`: the system call `umask` cannot read the mask without changing it.
fn file_mask() -> Option<Mode> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let mask = status.lines().find_map(|line| line.strip_prefix("Umask:"))?;
    u32::from_str_radix(mask.trim(), 8).ok().map(Mode::from_raw_mode)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_that_was_changed_is_put_back_and_named() {
        let before = MachineState::now();
        let files = getrlimit(Resource::Nofile);
        let fewer = Rlimit { current: Some(64), maximum: files.maximum };
        setrlimit(Resource::Nofile, fewer).expect("fewer are always allowed");
        assert_eq!(before.restore(), ["the limit of open files"]);
        assert_eq!(getrlimit(Resource::Nofile), files);
        assert_eq!(MachineState::now().restore(), Vec::<&str>::new());
    }
}
