//! Settings from environment variables, the only channel to an unmodified program.

use flotor_servo::guest::Signals;
use std::ffi::OsStr;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Variable of [`Settings::shared_control_group`].
const CONSENT: &str = "FLOTOR_SHARED_CONTROL_GROUP";

/// Clock of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The machine's clock; the program runs at its own rate.
    Real,
    /// The program's calls that command or wait: they advance the run without delay, so that a run is repeatable.
    Lockstep,
}

/// Settings of a program's run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// `FLOTOR_SCENE`: the scene; `None` for a simulated flotor with a hand.
    pub scene: Option<PathBuf>,
    /// Folders to search for plugins before those of the scene.
    pub plugin_folders: Vec<PathBuf>,
    /// `FLOTOR_RECORD`: the recording (MCAP).
    pub record: Option<PathBuf>,
    /// `FLOTOR_REPORT`: file of the summary as text; `-` is standard error. While the program runs, an intermediate summary lies
    /// beside it.
    pub report: Option<PathBuf>,
    /// `FLOTOR_JSON`: file of the summary as JSON; `-` is standard error.
    pub json: Option<PathBuf>,
    /// `FLOTOR_PACE`: `real` or `lockstep`.
    pub pace: Pace,
    /// `FLOTOR_SEED`: seed of all random numbers.
    pub seed: u64,
    /// `FLOTOR_SIGNALS`: `stop` to stop the devices when a signal ends the program.
    pub signals: Signals,
    /// `FLOTOR_SHARED_CONTROL_GROUP`: `accept` adds the consent of `--accept-shared-control-group`.
    pub shared_control_group: SharedControlGroup,
}

/// Consent to a watchdog process in the control group of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SharedControlGroup {
    /// Consent as given by the scene.
    ByScene,
    /// Consent given by the environment variable, whatever the scene says.
    Accepted,
}

/// Returns the value of an environment variable; `None` if the variable is unset, empty or not UTF-8. Not real-time.
#[must_use]
pub fn env_value(variable: &str) -> Option<String> {
    std::env::var(variable).ok().filter(|value| !value.is_empty())
}

impl Settings {
    /// Reads the settings from the environment of this process. Not real-time.
    ///
    /// # Errors
    /// The variable, its value and the permitted values.
    pub fn from_environment() -> Result<Self, String> {
        Self::read(env_value)
    }

    /// Adapts the settings to a program of Flotor's own: a fatal signal stops the devices before the program ends.
    #[must_use]
    pub fn of_own_process(self) -> Self {
        Self { signals: Signals::StopFirst, ..self }
    }

    /// Adds a suffix, the name of a library or the number of a process, to the names of all files, so that drop-ins do not overwrite each
    /// other's files.
    pub(crate) fn add_suffix(&mut self, word: &OsStr) {
        for file in [&mut self.record, &mut self.report, &mut self.json].into_iter().flatten() {
            if file.as_os_str() == "-" {
                continue;
            }
            let mut name = file.file_stem().unwrap_or_default().to_owned();
            name.push("-");
            name.push(word);
            if let Some(extension) = file.extension() {
                name.push(".");
                name.push(extension);
            }
            file.set_file_name(name);
        }
    }

    /// Adds the number of this process among the processes of one `flotor lend` to the names of all files, from the second process
    /// on. Each process reserves its number by a file in `folder`.
    pub(crate) fn keep_processes_apart(&mut self, folder: &Path) {
        let stem = self.report.as_deref().and_then(Path::file_stem).unwrap_or_default().to_owned();
        let is_free = |number: &u32| {
            let mut name = stem.clone();
            name.push(format!("-process-{number}"));
            // Where no file can be created, the names stay.
            !File::create_new(folder.join(name)).is_err_and(|error| error.kind() == ErrorKind::AlreadyExists)
        };
        match (1..).find(is_free) {
            None | Some(1) => {}
            Some(number) => self.add_suffix(number.to_string().as_ref()),
        }
    }

    fn read(env_value: impl Fn(&str) -> Option<String>) -> Result<Self, String> {
        let file = |variable| env_value(variable).map(PathBuf::from);
        let wrong =
            |variable: &str, value: &str, legal: &str| Err(format!("{variable}={value}: must be {legal}"));
        let pace = match env_value("FLOTOR_PACE").as_deref() {
            None | Some("real") => Pace::Real,
            Some("lockstep") => Pace::Lockstep,
            Some(other) => return wrong("FLOTOR_PACE", other, "`real` or `lockstep`"),
        };
        let signals = match env_value("FLOTOR_SIGNALS").as_deref() {
            None | Some("leave") => Signals::Program,
            Some("stop") => Signals::StopFirst,
            Some(other) => return wrong("FLOTOR_SIGNALS", other, "`leave` or `stop`"),
        };
        let shared_control_group = match env_value(CONSENT).as_deref() {
            None => SharedControlGroup::ByScene,
            Some("accept") => SharedControlGroup::Accepted,
            Some(other) => return wrong(CONSENT, other, "`accept`"),
        };
        let seed = match env_value("FLOTOR_SEED").map(|text| (text.parse(), text)) {
            None => 0,
            Some((Ok(seed), _)) => seed,
            Some((Err(_), text)) => return wrong("FLOTOR_SEED", &text, "a whole number from 0 to 2^64 - 1"),
        };
        Ok(Self {
            scene: file("FLOTOR_SCENE"),
            plugin_folders: Vec::new(),
            record: file("FLOTOR_RECORD"),
            report: file("FLOTOR_REPORT"),
            json: file("FLOTOR_JSON"),
            pace,
            seed,
            signals,
            shared_control_group,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(of: &str, value: &str) -> Result<Settings, String> {
        Settings::read(|variable| (variable == of).then(|| value.to_owned()))
    }

    #[test]
    fn what_is_not_said_has_a_default_and_what_is_wrong_is_named() {
        let plain = Settings::read(|_| None).expect("nothing is wrong");
        assert_eq!((plain.pace, plain.signals, plain.seed), (Pace::Real, Signals::Program, 0));
        assert_eq!(read("FLOTOR_PACE", "lockstep").map(|settings| settings.pace), Ok(Pace::Lockstep));
        assert_eq!(
            read("FLOTOR_PACE", "fast"),
            Err("FLOTOR_PACE=fast: must be `real` or `lockstep`".to_owned())
        );
        let mut recorded = read("FLOTOR_RECORD", "/tmp/run.mcap").expect("it is a file");
        recorded.add_suffix("libHD".as_ref());
        assert_eq!(recorded.record, Some(PathBuf::from("/tmp/run-libHD.mcap")));
        assert_eq!(plain.shared_control_group, SharedControlGroup::ByScene);
        let accepted = read(CONSENT, "accept").map(|settings| settings.shared_control_group);
        assert_eq!(accepted, Ok(SharedControlGroup::Accepted));
        assert_eq!(read(CONSENT, "1"), Err(format!("{CONSENT}=1: must be `accept`")));
        let folder = std::env::temp_dir().join(format!("flotor-processes-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("it can be made");
        let names = [1, 2, 3].map(|_| {
            let mut settings = read("FLOTOR_RECORD", "run.mcap").expect("it is a file");
            settings.keep_processes_apart(&folder);
            settings.record.expect("it is a file").display().to_string()
        });
        assert_eq!(names, ["run.mcap", "run-2.mcap", "run-3.mcap"]);
        std::fs::remove_dir_all(&folder).expect("it is ours");
        assert!(read("FLOTOR_SEED", "-1").is_err_and(|said| said.contains("whole number")));
    }
}
