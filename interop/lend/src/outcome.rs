//! Summaries that the runs of a program write to the folder of `flotor lend`: one for each process that has opened a device.

use crate::guard::ProgramEnd;
use flotor_command::{CommandError, note, say, write_json};
use flotor_servo::RunEnd;
use flotor_servo::last_stop::SignalName;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};

/// Exit code if the program ended with 0, but a run ended abnormally, for example by a device fault or the watchdog.
const RUN_FAILED: i32 = 4;
/// Extension of a file of a run that has not ended.
const SO_FAR: &str = "so-far";

/// Result files of a run.
#[derive(Default)]
struct Run {
    text: Option<String>,
    summary: Option<Value>,
    /// True if the run has ended before its process did.
    is_whole: bool,
}

/// Runs of a program, by the suffix in the names of their files.
pub(crate) struct Runs<'a> {
    runs: BTreeMap<String, Run>,
    program: &'a ProgramEnd,
}

impl<'a> Runs<'a> {
    /// Returns the paths of the files that a run writes to this folder: summary as text, and as JSON.
    pub(crate) fn files(folder: &Path) -> [PathBuf; 2] {
        ["report.txt", "report.json"].map(|name| folder.join(name))
    }

    /// Reads the files of all runs at the end of the program.
    pub(crate) fn read(folder: &Path, program: &'a ProgramEnd) -> Self {
        let mut runs = BTreeMap::<String, Run>::new();
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
            // For example report-2.txt, report-2.json.so-far
            let Some((suffix, kind)) = name.strip_prefix("report").and_then(|rest| rest.split_once('.'))
            else {
                continue;
            };
            let Ok(text) = std::fs::read_to_string(&path) else { continue };
            let run = runs.entry(suffix.to_owned()).or_default();
            let (kind, is_so_far) =
                kind.strip_suffix(&format!(".{SO_FAR}")).map_or((kind, false), |kind| (kind, true));
            run.is_whole |= !is_so_far;
            match kind {
                "txt" if !is_so_far || run.text.is_none() => run.text = Some(text),
                "json" if !is_so_far || run.summary.is_none() => {
                    run.summary = serde_json::from_str(&text).ok()
                }
                _ => {}
            }
        }
        Self { runs, program }
    }

    /// Prints the summary of each run; returns true if there is a summary.
    pub(crate) fn tell(&self, program: &Path, record: Option<&Path>) -> bool {
        let name = program.display();
        for (suffix, run) in &self.runs {
            let Some(text) = &run.text else { continue };
            say!("{}", text.trim_end());
            if let Some(record) = record.filter(|_| !suffix.is_empty()) {
                note(format_args!("the recording of this run is `{}`", named(record, suffix).display()));
            }
            if !run.is_whole {
                let end = self.end();
                note(format_args!("`{name}`: {end}: this is its summary up to half a second before"));
            }
        }
        self.runs.values().any(|run| run.text.is_some())
    }

    /// Describes the end of the program, for a run that did not end before the program.
    fn end(&self) -> String {
        let status = self.program.status();
        match (status.signal(), status.code()) {
            (Some(signal), _) => format!("killed by {}", SignalName(signal)),
            (None, code) => {
                format!("ended with exit code {} before the end of its run", code.unwrap_or_default())
            }
        }
    }

    /// Writes the summary of each run as JSON: the first summary to `file`, each further summary to a file in the same folder with
    /// the suffix of the run in its name.
    pub(crate) fn write(&self, file: &Path) -> Result<(), CommandError> {
        if self.runs.is_empty() {
            let end = format!("the program opened no device: {}", self.end());
            return write_json(file, &json!({ "end": end }));
        }
        for (suffix, run) in &self.runs {
            let mut summary = run.summary.clone().unwrap_or_else(|| json!({}));
            if !run.is_whole || run.summary.is_none() {
                summary["end"] = self.end().into();
            }
            if !self.program.left_running.is_empty() {
                let left = self.program.left_running.iter().map(ToString::to_string);
                summary["left_running"] = left.collect::<Vec<_>>().into();
            }
            write_json(&named(file, suffix), &summary)?;
        }
        Ok(())
    }

    /// Returns the exit code of the command: the exit code of the program, 128 plus the signal that ended the program, or 4 if the
    /// program ended with 0 after a failed run.
    pub(crate) fn exit_code(&self) -> i32 {
        let in_order = [RunEnd::Finished, RunEnd::Stopped].map(RunEnd::word);
        let ended_early = |run: &Run| {
            let end = run.summary.as_ref().and_then(|summary| summary.get("end")).and_then(Value::as_str);
            run.is_whole && end.is_some_and(|end| !in_order.contains(&end))
        };
        let status = self.program.status();
        match (status.code(), status.signal()) {
            (Some(0), _) if self.runs.values().any(ended_early) => RUN_FAILED,
            (Some(code), _) => code,
            (None, signal) => 128 + signal.unwrap_or_default(),
        }
    }
}

/// Inserts the suffix of a run into the name of a file, before the extension.
fn named(file: &Path, suffix: &str) -> PathBuf {
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push(suffix);
    if let Some(extension) = file.extension() {
        name.push(".");
        name.push(extension);
    }
    file.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::ExitStatus;

    #[test]
    fn each_run_has_a_summary_with_its_end() {
        let folder = std::env::temp_dir().join(format!("flotor-outcome-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("it can be made");
        let write =
            |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("it can be written");
        let end = |name: &str| {
            let text = std::fs::read_to_string(folder.join(name)).expect("it was written");
            serde_json::from_str::<Value>(&text).expect("JSON")["end"].as_str().expect("an end").to_owned()
        };
        let ended = |status| ProgramEnd::of(ExitStatus::from_raw(status));
        let crashed = ended(11);
        Runs::read(&folder, &crashed).write(&folder.join("out.json")).expect("it can be written");
        assert!(end("out.json").starts_with("the program opened no device: killed by signal 11"));
        write("report.json.so-far", "{\"end\": \"watchdog\", \"ticks\": 5}");
        write("report-2.txt", "two");
        write("report-2.json", "{\"end\": \"oscillation\"}");
        let runs = Runs::read(&folder, &crashed);
        runs.write(&folder.join("out.json")).expect("it can be written");
        assert!(end("out.json").starts_with("killed by signal 11"), "{}", end("out.json"));
        assert_eq!(end("out-2.json"), "oscillation");
        assert_eq!(runs.exit_code(), 128 + 11);
        assert_eq!(Runs::read(&folder, &ended(7 << 8)).exit_code(), 7);
        assert_eq!(Runs::read(&folder, &ended(0)).exit_code(), RUN_FAILED);
        std::fs::remove_dir_all(&folder).expect("it is ours");
    }
}
