//! `flotor record`: records a running session, local or remote.

use super::bridge::{BRIDGE, Way, is_remote};
use clap::Args;
use flotor_command::options::mcap_file;
use flotor_command::stopping::stop_on_signals;
use flotor_command::{CommandError, first_error, report_line, style};
use flotor_live::{Answer, Ask, Client, Directory, Event, LiveError};
use flotor_record::{Note, Recorder, Severity};
use flotor_servo::StopSwitch;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Poll interval of the stop switch while no event arrives.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Attach to a running session and record it until it ends.
#[derive(Args)]
#[command(
    after_help = "The session need not have been started with --record: this command attaches to it, and detaches at Ctrl-C.\n\n\
    Examples:\n  \
    flotor record --out run.mcap                 the newest session of this machine\n  \
    flotor record zenoh/lab --out run.mcap       a remote session, see `flotor bridge --help`"
)]
pub(crate) struct RecordArguments {
    /// Remote session: zenoh/NAME (default: the newest session of this machine)
    #[arg(value_name = "zenoh/NAME")]
    source: Option<String>,
    /// Recording to write
    #[arg(long, value_parser = mcap_file, value_name = "FILE.mcap")]
    out: PathBuf,
    #[command(flatten)]
    way: Way,
}

pub(crate) fn run(arguments: &RecordArguments) -> Result<(), CommandError> {
    let RecordArguments { source, out, way } = arguments;
    match source.as_deref() {
        None => record_local(out),
        Some(remote) if is_remote(remote.as_ref()) => {
            let mut arguments = way.arguments("record", remote.as_ref());
            arguments.insert(2, out.into());
            BRIDGE.become_with(&arguments)
        }
        Some(other) => Err(CommandError::Usage(format!(
            "`{other}` is not a remote session: write zenoh/NAME; `flotor bridge list` lists the names"
        ))),
    }
}

fn record_local(out: &Path) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    let client =
        Client::find(&Directory::of_this_user()).map_err(|error| CommandError::Usage(error.to_string()))?;
    eprintln!("recording `{}` (Ctrl-C ends)", client.greeting().title);
    let Kept { ticks, dropped, end } = keep(client, out, &stop)?;
    let lost = match dropped {
        0 => String::new(),
        dropped => format!(", {} {dropped} ticks dropped by the host", style::warning("without")),
    };
    let words = end.as_ref().map_or_else(ToString::to_string, Clone::clone);
    let printed = report_line(format_args!("{}: {ticks} ticks{lost}; {words}", out.display()));
    let whole = end.map(drop).map_err(|_| {
        CommandError::Failed(
            "the connection was lost, or a message was malformed, before the end of the run, so the recording is incomplete; \
             the file contains the ticks received until then. To record without a connection, use `flotor run --record`"
                .to_owned(),
        )
    });
    first_error([whole, printed])
}

/// Result of a recording.
struct Kept {
    ticks: u64,
    dropped: u64,
    /// Text on the end of the run or of the recording, or the error if the connection was lost without an end message.
    end: Result<String, LiveError>,
}

fn keep(mut client: Client, out: &Path, stop: &StopSwitch) -> Result<Kept, CommandError> {
    let mut recorder = Recorder::create(out, client.run())?;
    let lost = |error: LiveError| CommandError::Failed(error.to_string());
    client.request_client().ask(Ask::Watch { every: 1 }).map_err(lost)?;
    let mut kept = Kept { ticks: 0, dropped: 0, end: Ok("stopped recording".to_owned()) };
    while !stop.is_stop_requested() {
        match client.next(LOOK_PERIOD) {
            // The only request is the one to receive ticks.
            Ok(Some(Event::Answer(Answer { refused: Some(reason), .. }))) => {
                recorder.discard();
                return Err(CommandError::Failed(reason));
            }
            Ok(None | Some(Event::Answer(_))) => {}
            Ok(Some(Event::Ticks { records, dropped })) => {
                if let (true, Some(first)) = (dropped > kept.dropped, records.first()) {
                    let text = format!("{} ticks were dropped", dropped - kept.dropped);
                    let (time_ns, source) = (first.time_ns, "flotor record".to_owned());
                    recorder.note(&Note { time_ns, severity: Severity::Warning, source, text })?;
                    kept.dropped = dropped;
                }
                for record in &records {
                    recorder.record(record)?;
                    kept.ticks += 1;
                }
            }
            Ok(Some(Event::Change(change))) => recorder.change(&change)?,
            Ok(Some(Event::End(end))) => {
                kept.end = Ok(end.words);
                break;
            }
            // The recorded ticks are valid; the message reports that the connection was lost.
            Err(error) => {
                kept.end = Err(error);
                break;
            }
        }
    }
    recorder.finish()?;
    Ok(kept)
}
