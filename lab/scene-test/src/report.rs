//! Results as text, JSON, and JUnit XML.
//!
//! Only the times in JUnit depend on time or on the number of jobs. A result file is written atomically at the end.

use crate::check::Outcome;
use crate::platform::readable_by_all;
use flotor_command::{CommandError, report_line, style, write_json};
use flotor_plot::escape;
use serde::Serialize;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::time::Duration;

/// Results of all cases, in the order of the cases.
#[derive(Serialize)]
pub(crate) struct Report {
    pub(crate) passed: usize,
    pub(crate) failed: usize,
    pub(crate) cases: Vec<Outcome>,
}

impl Report {
    pub(crate) fn new(cases: Vec<Outcome>) -> Self {
        let passed = cases.iter().filter(|case| case.passed).count();
        Self { passed, failed: cases.len() - passed, cases }
    }

    /// Formats a line for each case, its failures below, and a summary.
    pub(crate) fn to_text(&self) -> String {
        let mut lines = Vec::new();
        for case in &self.cases {
            let word = if case.passed { "ok    ".to_owned() } else { style::error("FAILED") };
            lines.push(format!("{word}  {}", case.case));
            lines.extend(case.failures.iter().map(|failure| format!("          {}", failure.line())));
            lines.extend(case.commands().map(|command| format!("          $ {command}")));
            lines.extend(case.picture.iter().map(|file| format!("          see {}", file.display())));
        }
        let count = self.cases.len();
        lines.push(match self.failed {
            0 => format!("{count} of {count} cases passed"),
            failed => format!("{failed} of {count} cases failed"),
        });
        lines.join("\n")
    }

    /// Formats JUnit XML: a suite, and a test case for each case, with its file, its time, and on failure its commands and picture.
    pub(crate) fn to_junit(&self) -> String {
        let (tests, failures) = (self.cases.len(), self.failed);
        let seconds = |took: Duration| format!("{:.3}", took.as_secs_f64());
        let time = seconds(self.cases.iter().map(|case| case.took).sum());
        let mut text = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites tests=\"{tests}\" failures=\"{failures}\">\n  \
             <testsuite name=\"flotor\" tests=\"{tests}\" failures=\"{failures}\" errors=\"0\" skipped=\"0\" \
             time=\"{time}\">\n"
        );
        for case in &self.cases {
            let (suite, label) = case.case.split_once(": ").unwrap_or(("", &case.case));
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                "    <testcase classname=\"{}\" name=\"{}\" file=\"{}\" time=\"{}\"",
                escape(suite),
                escape(label),
                escape(&case.file.display().to_string()),
                seconds(case.took)
            );
            let Some(first) = case.failures.first() else {
                text.push_str("/>\n");
                continue;
            };
            let details: Vec<String> = case.failures.iter().map(|failure| failure.line()).collect();
            let commands = case.commands().map(|command| format!("$ {command}"));
            let picture = case.picture.iter().map(|file| format!("see {}", file.display()));
            let output = commands.chain(picture).collect::<Vec<_>>().join("\n");
            let [message, details, output] =
                [&first.line(), &details.join("\n"), &output].map(|text| escape(text));
            let _ = writeln!(
                text,
                ">\n      <failure message=\"{message}\">{details}</failure>\n      \
                 <system-out>{output}</system-out>\n    </testcase>"
            );
        }
        text + "  </testsuite>\n</testsuites>\n"
    }
}

/// Removes the result file of an earlier call, so that a killed call has no result; does nothing for a pipe or a device.
pub(crate) fn remove(path: &Path) -> Result<(), CommandError> {
    if is_special(path) {
        return Ok(());
    }
    match std::fs::remove_file(path) {
        Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
            Err(CommandError::file(path, "cannot remove the earlier result", cause))
        }
        _ => Ok(()),
    }
}

/// Returns true for a pipe or a device, such as /dev/null, which must not be replaced.
fn is_special(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|known| !known.is_file() && !known.is_dir())
}

/// Writes a file atomically; writes directly to a pipe or a device.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), CommandError> {
    if is_special(path) {
        return std::fs::write(path, text)
            .map_err(|cause| CommandError::file(path, "cannot write the file", cause));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let written = tempfile::NamedTempFile::new_in(folder).and_then(|mut file| {
        file.write_all(text.as_bytes())?;
        file.as_file().sync_all()?;
        readable_by_all(file.as_file())?;
        file.persist(path).map_err(|error| error.error)
    });
    written.map(drop).map_err(|cause| CommandError::file(path, "cannot write the file", cause))
}

/// Prints the results as text, unless the JSON goes to standard output, and writes them to the requested files.
pub(crate) fn deliver(
    report: &Report,
    json: Option<&Path>,
    junit: Option<&Path>,
) -> Result<(), CommandError> {
    let to_output = json.is_some_and(is_output);
    let printed = if to_output { Ok(()) } else { report_line(format_args!("{}", report.to_text())) };
    let json = json.map_or(Ok(()), |path| match serde_json::to_string_pretty(report) {
        _ if is_output(path) => write_json(path, report),
        Ok(text) => write_whole(path, &(text + "\n")),
        Err(error) => Err(CommandError::Failed(error.to_string())),
    });
    let junit = junit.map_or(Ok(()), |path| write_whole(path, &report.to_junit()));
    flotor_command::first_error([printed, json, junit])
}

/// Returns true if a path means standard output.
pub(crate) fn is_output(path: &Path) -> bool {
    path.as_os_str() == "-"
}
