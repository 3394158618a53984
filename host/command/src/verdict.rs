//! Result of a run as that of a command: the sentence for its end, with the exit code, and the notes for its recording.

use crate::{CommandError, before_advice};
use flotor_record::{Note, Severity};
use flotor_servo::RunEnd;
use flotor_session::summary::RunSummary;
use flotor_session::{Outcome, PluginReport};

/// Converts the end of a run to the result of a command. Not real-time.
///
/// # Errors
/// [`CommandError`] if the run ended other than in order, or a model failed.
pub fn verdict(
    outcome: &Outcome,
    plugins: &[PluginReport],
    summary: &RunSummary,
) -> Result<(), CommandError> {
    match outcome.end {
        RunEnd::DeviceFault(fault) => {
            let (number, words) = outcome.faulted().unwrap_or_default();
            let path = plugins.get(number).map(|device| device.metadata.path.clone()).unwrap_or_default();
            let words = words.to_owned();
            Err(CommandError::RunFault { path, fault, words })
        }
        end if end.is_in_order() => broken_plugins(outcome, summary),
        end => Err(CommandError::run_ended(end, summary.rate_hz)),
    }
}

/// Describes the end of a run for its clients. Not real-time.
#[must_use]
pub fn end_words(outcome: &Outcome, rate_hz: f64) -> String {
    match outcome.end {
        RunEnd::DeviceFault(fault) => {
            let words = outcome.faulted().map_or("", |(_, words)| words);
            format!("device fault: {}{}", before_advice(words), fault.advice())
        }
        end => CommandError::run_ended(end, rate_hz).to_string(),
    }
}

/// Returns an error for the first broken plugin, which sets the exit code: a model that failed, or a device that changed the
/// floating-point environment.
fn broken_plugins(outcome: &Outcome, summary: &RunSummary) -> Result<(), CommandError> {
    // Devices come first. A failed device has ended the run; tolerated faults of its samples are in the summary.
    let is_borne =
        |number: usize| outcome.devices.get(number).is_some_and(|device| device.float_changes == 0);
    let mut plugins = summary.plugins.iter().enumerate();
    let broken = plugins.find(|(number, plugin)| plugin.health != "ok" && !is_borne(*number));
    broken.map_or(Ok(()), |(_, plugin)| {
        let problem = format!(
            "{}: `{}` {}; run `flotor validate` for details",
            plugin.file, plugin.name, plugin.health
        );
        Err(CommandError::PluginRefused(problem))
    })
}

/// Returns notes for readers of the recording: reason of the end, failed plugins, missing ticks. Not real-time.
#[must_use]
pub fn end_notes(outcome: &Outcome, summary: &RunSummary) -> Vec<Note> {
    let note = |severity, source: &str, text: String| Note {
        time_ns: outcome.elapsed_ns,
        severity,
        source: source.to_owned(),
        text,
    };
    let mut notes = Vec::new();
    if outcome.dropped_records > 0 {
        let text = format!("{} ticks are missing: the recorder could not keep up", outcome.dropped_records);
        notes.push(note(Severity::Warning, "flotor", text));
    }
    let ill = summary.plugins.iter().filter(|plugin| plugin.health != "ok");
    notes.extend(ill.map(|plugin| note(Severity::Error, &plugin.name, plugin.health.clone())));
    if !outcome.end.is_in_order() {
        notes.push(note(Severity::Error, "flotor", end_words(outcome, summary.rate_hz)));
    }
    notes
}
