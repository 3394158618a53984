//! What belongs to the host's process and a plugin has to leave alone, as the system tells it.
//!
//! What loading does to the floating-point mode is seen in the results of a few sums; what a call does, the loader counts.

use super::Seen;
use super::checks::Subject;
use super::life::live;
use crate::platform::children;
use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::time::Duration;

/// How long the process is left alone at the end: a timer or a signal that was left behind comes by then.
const REST: Duration = Duration::from_millis(300);

/// How one part of the state may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum May {
    /// Not at all.
    Stay,
    /// Lines may come, none may go.
    Grow,
}

/// The state of this process and thread.
pub(super) struct Host {
    parts: Vec<(&'static str, May, Vec<String>)>,
    threads: usize,
}

/// Lives one life of an instance, and looks after each call.
pub(super) fn untouched(subject: &Subject, before: &Host) -> Result<(), Seen> {
    before.compare("loading")?;
    live(subject, &mut |call, float_changes| match float_changes {
        0 => before.compare(call),
        _ => Err(format!("{call} changed the floating-point mode: rounding, flush-to-zero or traps")),
    })?;
    std::thread::sleep(REST);
    Ok(before.compare("what it left behind")?)
}

impl Host {
    pub(super) fn now() -> Self {
        let whole = |path: &str| fs::read_to_string(path).unwrap_or_default();
        let (process, thread) = (whole("/proc/self/status"), whole("/proc/thread-self/status"));
        let named = |text: &str, names: &[&str]| -> Vec<String> {
            let lines = text.lines().filter(|line| names.iter().any(|name| line.starts_with(name)));
            lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
        };
        let environment =
            std::env::vars_os().map(|(name, value)| format!("{}={}", name.display(), value.display()));
        let folder =
            std::env::current_dir().map_or_else(|error| error.to_string(), |dir| dir.display().to_string());
        let parts = vec![
            (
                "signal handlers",
                May::Stay,
                [signals(&process, "SigIgn:"), signals(&process, "SigCgt:")].into(),
            ),
            ("the blocked signals", May::Stay, vec![signals(&thread, "SigBlk:")]),
            ("the floating-point mode", May::Stay, arithmetic()),
            ("the environment", May::Stay, environment.collect()),
            ("the current folder", May::Stay, vec![folder]),
            ("the processors of the thread", May::Stay, named(&thread, &["Cpus_allowed:"])),
            ("the scheduling of the thread", May::Stay, scheduling()),
            (
                "the limits of the process",
                May::Stay,
                whole("/proc/self/limits").lines().map(str::to_owned).collect(),
            ),
            ("umask or tracer", May::Stay, named(&process, &["Umask:", "TracerPid:"])),
            ("child processes", May::Stay, vec![children().to_owned()]),
            ("timers", May::Stay, named(&whole("/proc/self/timers"), &["ID:", "signal:"])),
            ("open files", May::Grow, files()),
        ];
        Self { parts, threads: threads() }
    }

    /// Threads at that time.
    pub(super) const fn threads(&self) -> usize {
        self.threads
    }

    fn compare(&self, call: &str) -> Result<(), String> {
        self.difference(&Self::now()).map_or(Ok(()), |difference| Err(format!("{call} changed {difference}")))
    }

    /// The first part that is not as it was.
    fn difference(&self, now: &Self) -> Option<String> {
        let missing = |from: &[String], of: &[String]| of.iter().find(|line| !from.contains(line)).cloned();
        let mut parts = self.parts.iter().zip(&now.parts);
        parts.find_map(|((what, may, before), (_, _, after))| {
            let (gone, new) = (missing(after, before), missing(before, after));
            let has_changed = gone.is_some() || new.is_some() && *may == May::Stay;
            let [gone, new] = [gone, new].map(|line| line.unwrap_or_else(|| "nothing".to_owned()));
            has_changed.then(|| format!("{what}: `{gone}` became `{new}`"))
        })
    }
}

/// A set of signals by their numbers, without 32 and 33: the C library uses those for its threads.
fn signals(status: &str, name: &str) -> String {
    let set = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix(name)?.trim(), 16).ok());
    let set = set.unwrap_or_default();
    let numbers = (1_u32..=64).filter(|number| !matches!(number, 32 | 33) && set >> (number - 1) & 1 == 1);
    let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
    format!("{name} {}", if numbers.is_empty() { "none".to_owned() } else { numbers.join(" ") })
}

/// Threads of this process.
pub(super) fn threads() -> usize {
    fs::read_dir("/proc/self/task").map_or(0, Iterator::count)
}

/// What a few sums say about the mode of this thread.
fn arithmetic() -> Vec<String> {
    let (one, little, least) = (black_box(1.0_f64), black_box(1.0e-17_f64), black_box(f64::MIN_POSITIVE));
    let denormal = black_box(5.0e-324_f64);
    let says = |is_so: bool, yes: &str, no: &str| if is_so { yes } else { no }.to_owned();
    vec![
        says(black_box(least * 0.5) > 0.0 && denormal > 0.0, "gradual underflow", "flushes to zero"),
        says(black_box(one + little) > 1.0, "rounds up", "does not round up"),
        says(black_box(one - little) < 1.0, "rounds down", "does not round down"),
    ]
}

/// Priority, nice value, real-time priority and policy, by their fields in proc(5).
fn scheduling() -> Vec<String> {
    let text = fs::read_to_string("/proc/thread-self/stat").unwrap_or_default();
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let of = |(name, field): (&str, usize)| format!("{name} {}", fields.get(field - 3).unwrap_or(&"unknown"));
    [("nice", 19), ("real-time priority", 40), ("policy", 41)].map(of).to_vec()
}

/// Open files as the system names them; the folder that is being read is among them, under another name each time.
fn files() -> Vec<String> {
    let entries = fs::read_dir("/proc/self/fd").into_iter().flatten().flatten();
    let named = entries.filter_map(|entry| Some((entry.file_name(), fs::read_link(entry.path()).ok()?)));
    let kept = named.filter(|(_, target)| !target.starts_with(Path::new("/proc")));
    kept.map(|(number, target)| format!("{} -> {}", number.display(), target.display())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    // Made up: other tests of this program open files and start processes meanwhile.
    fn host(folder: &str, files: &[&str]) -> Host {
        let files = files.iter().map(|file| (*file).to_owned()).collect();
        let folder = vec![folder.to_owned()];
        Host { parts: vec![("the folder", May::Stay, folder), ("open files", May::Grow, files)], threads: 1 }
    }

    #[test]
    fn what_changes_is_named_and_files_may_come() {
        let before = host("/here", &["3 -> /a"]);
        assert_eq!(before.difference(&host("/here", &["3 -> /a", "4 -> /b"])), None);
        let told = before.difference(&host("/there", &["3 -> /a"]));
        assert_eq!(told.as_deref(), Some("the folder: `/here` became `/there`"));
        let told = before.difference(&host("/here", &["4 -> /b"]));
        assert_eq!(told.as_deref(), Some("open files: `3 -> /a` became `4 -> /b`"));
        assert_eq!(
            before.difference(&host("/here", &[])).as_deref(),
            Some("open files: `3 -> /a` became `nothing`")
        );
    }

    #[test]
    fn signals_are_told_by_their_numbers_without_those_of_the_c_library() {
        let status = "Name:\tx\nSigIgn:\t0000000180001000\nSigCgt:\t0000000000000000\n";
        assert_eq!(signals(status, "SigIgn:"), "SigIgn: 13");
        assert_eq!(signals(status, "SigCgt:"), "SigCgt: none");
    }

    #[test]
    fn this_thread_rounds_to_nearest_and_underflows_gradually() {
        assert_eq!(arithmetic(), ["gradual underflow", "does not round up", "does not round down"]);
    }
}
