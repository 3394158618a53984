//! Process state of the host that a plugin must not change, as reported by the system.
//!
//! A few sums reveal a change of the floating-point mode by loading; changes by calls are counted by the loader.

use super::life::live;
use super::outcome::Outcome;
use super::subject::Subject;
use crate::platform::{May, Part, state};
use std::hint::black_box;
use std::time::Duration;

/// Waiting time at the end, in which a leftover timer or signal would fire.
const REST: Duration = Duration::from_millis(300);

/// Permitted growth of the process state while an instance exists; below, after its end.
const IN_LIFE: &[May] = &[May::Grow, May::GrowInLife];
const AFTER: &[May] = &[May::Grow];

/// State of this process and thread.
pub(super) struct Host {
    parts: Vec<Part>,
    /// Reason why the rest of the state is unknown, if so.
    unknown: Option<Outcome>,
    threads: Result<usize, Outcome>,
}

/// Runs the life of an instance, and compares the state after each call.
pub(super) fn untouched(subject: &Subject, before: &Host) -> Result<(), Outcome> {
    before.compare("loading", AFTER)?;
    live(subject, &mut |call, float_changes| match float_changes {
        0 => before.compare(call, IN_LIFE),
        _ => Err(format!(
            "{call} changed the floating-point mode (rounding, flush-to-zero or traps); restore the mode before the call \
             returns"
        )),
    })?;
    std::thread::sleep(REST);
    before.compare("the plugin, after its last call,", AFTER)?;
    before.known()
}

impl Host {
    pub(super) fn now() -> Self {
        let environment =
            std::env::vars_os().map(|(name, value)| format!("{}={}", name.display(), value.display()));
        let folder =
            std::env::current_dir().map_or_else(|error| error.to_string(), |dir| dir.display().to_string());
        let mut parts = vec![
            ("the floating-point mode", May::Stay, arithmetic()),
            ("the environment", May::Stay, environment.collect()),
            ("the current folder", May::Stay, vec![folder]),
        ];
        let unknown = match state::of_the_system() {
            Ok(told) => {
                parts.extend(told);
                None
            }
            Err(why) => Some(why),
        };
        Self { parts, unknown, threads: state::threads() }
    }

    /// Returns the number of threads when this state was recorded.
    ///
    /// # Errors
    /// The reason why the number is unknown.
    pub(super) fn threads(&self) -> Result<usize, Outcome> {
        self.threads.clone()
    }

    /// Fails if a part of the state is unknown.
    fn known(&self) -> Result<(), Outcome> {
        self.unknown.clone().map_or(Ok(()), Err)
    }

    fn compare(&self, call: &str, growing: &[May]) -> Result<(), String> {
        let difference = self.difference(&Self::now(), growing);
        difference.map_or(Ok(()), |difference| Err(format!("{call} changed {difference}")))
    }

    /// Returns the first part that has changed, other than by growth of a part that may grow.
    fn difference(&self, now: &Self, growing: &[May]) -> Option<String> {
        let missing = |from: &[String], of: &[String]| of.iter().find(|line| !from.contains(line)).cloned();
        let mut parts = self.parts.iter().zip(&now.parts);
        parts.find_map(|((what, may, before), (_, _, after))| {
            let (gone, new) = (missing(after, before), missing(before, after));
            let has_changed = gone.is_some() || new.is_some() && !growing.contains(may);
            let [gone, new] = [gone, new].map(|line| line.unwrap_or_else(|| "nothing".to_owned()));
            has_changed.then(|| format!("{what}: `{gone}` became `{new}`"))
        })
    }
}

/// Describes the floating-point mode of this thread by a few sums.
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

#[cfg(test)]
mod tests {
    use super::*;

    // Made up: other tests of this program open files and start processes meanwhile.
    fn host(folder: &str, files: &[&str]) -> Host {
        let files = files.iter().map(|file| (*file).to_owned()).collect();
        let folder = vec![folder.to_owned()];
        let parts = vec![("the folder", May::Stay, folder), ("open files", May::Grow, files)];
        Host { parts, unknown: None, threads: Ok(1) }
    }

    #[test]
    fn what_changes_is_named_and_files_may_come() {
        let before = host("/here", &["3 -> /a"]);
        assert_eq!(before.difference(&host("/here", &["3 -> /a", "4 -> /b"]), AFTER), None);
        let told = before.difference(&host("/there", &["3 -> /a"]), AFTER);
        assert_eq!(told.as_deref(), Some("the folder: `/here` became `/there`"));
        let told = before.difference(&host("/here", &["4 -> /b"]), AFTER);
        assert_eq!(told.as_deref(), Some("open files: `3 -> /a` became `4 -> /b`"));
        assert_eq!(
            before.difference(&host("/here", &[]), AFTER).as_deref(),
            Some("open files: `3 -> /a` became `nothing`")
        );
    }

    #[test]
    fn a_solver_in_a_process_of_its_own_may_run_until_its_instance_ends() {
        let with = |processes: &[&str]| {
            let lines = processes.iter().map(|line| (*line).to_owned()).collect();
            Host { parts: vec![("child processes", May::GrowInLife, lines)], unknown: None, threads: Ok(1) }
        };
        assert_eq!(with(&[]).difference(&with(&["at least one"]), IN_LIFE), None);
        let left = with(&[]).difference(&with(&["at least one"]), AFTER);
        assert_eq!(left.as_deref(), Some("child processes: `nothing` became `at least one`"));
    }

    #[test]
    fn what_the_system_does_not_tell_is_not_said_to_hold() {
        let why = Outcome::UnsupportedSystem("nobody tells".to_owned());
        let unknown = Host { unknown: Some(why.clone()), threads: Err(why.clone()), ..host("/here", &[]) };
        assert_eq!((unknown.known(), unknown.threads()), (Err(why.clone()), Err(why)));
        assert_eq!(host("/here", &[]).known(), Ok(()));
        // Of this system: both, or a reason.
        let now = Host::now();
        assert_eq!(now.known().is_ok(), now.threads().is_ok());
    }

    #[test]
    fn this_thread_rounds_to_nearest_and_underflows_gradually() {
        assert_eq!(arithmetic(), ["gradual underflow", "does not round up", "does not round down"]);
    }
}
