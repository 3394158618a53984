//! `flotor repair`: completes a truncated recording in a new file.

use clap::Args;
use flotor_command::options::mcap_file;
use flotor_command::{CommandError, report_line};
use flotor_record::{RepairError, Repaired, repair};
use std::path::PathBuf;

/// Copy a truncated recording to a file that every MCAP reader accepts.
#[derive(Args)]
#[command(
    after_help = "The recording of a process that was killed has no index and no end record: Flotor reads such a \
    file up to its last complete chunk, most other readers reject it. This command copies all complete chunks, \
    message by message, writes index and end record, and reports the loss. It does not change the old file.\n\n\
    Example:\n  flotor repair cut.mcap --out whole.mcap"
)]
pub(crate) struct RepairArguments {
    /// Truncated or damaged recording
    recording: PathBuf,
    /// File to write
    #[arg(long, value_parser = mcap_file, value_name = "FILE.mcap")]
    out: PathBuf,
}

pub(crate) fn run(arguments: &RepairArguments) -> Result<(), CommandError> {
    let RepairArguments { recording, out } = arguments;
    let repaired = repair(recording, out).map_err(refused)?;
    report_line(format_args!("{}: {}", out.display(), to_text(&repaired)))
}

fn to_text(repaired: &Repaired) -> String {
    let Repaired { ticks, end_ns, planned_s, damage } = repaired;
    let end_s = *end_ns as f64 * 1.0e-9;
    let kept = format!("{ticks} ticks up to {end_s:.3} s of a run planned for {planned_s} s");
    let lost = match damage {
        None => "the ticks that the process had not written yet, at most a quarter of a second, are lost"
            .to_owned(),
        Some(damage) => format!("the later ticks are lost, because the file is damaged there: {damage}"),
    };
    format!("{kept}; {lost}")
}

fn refused(error: RepairError) -> CommandError {
    match error {
        RepairError::Read(error) => error.into(),
        RepairError::Write(error) => error.into(),
        other => CommandError::Usage(other.to_string()),
    }
}
