//! `flotor record`: a recording of a run that somebody else started, here or elsewhere.

use super::bridge::{BRIDGE, Way, is_elsewhere};
use clap::Args;
use flotor_command::stopping::stop_on_signals;
use flotor_command::{CommandError, first_error, report_line, style};
use flotor_core::Change;
use flotor_live::{Ask, Client, Directory, Event, LiveError};
use flotor_record::{Note, Recorder, Severity};
use flotor_servo::StopSwitch;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long to wait for news before looking whether to stop.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Record a run that is on, from now to its end.
#[derive(Args)]
#[command(
    after_help = "Nobody has to start a run with --record: this joins while it runs, and leaves at Ctrl-C.\n\n\
    Examples:\n  \
    flotor record --out run.mcap                 the run that was started last on this machine\n  \
    flotor record zenoh/lab --out run.mcap       a run elsewhere, see `flotor bridge --help`"
)]
pub(crate) struct RecordArguments {
    /// A run elsewhere: zenoh/NAME (default: the newest run of this machine)
    #[arg(value_name = "zenoh/NAME")]
    source: Option<String>,
    /// The recording
    #[arg(long, value_name = "FILE.mcap")]
    out: PathBuf,
    #[command(flatten)]
    way: Way,
}

pub(crate) fn run(arguments: &RecordArguments) -> Result<(), CommandError> {
    let RecordArguments { source, out, way } = arguments;
    match source.as_deref() {
        None => record_local(out),
        Some(remote) if is_elsewhere(remote.as_ref()) => {
            let mut arguments = way.arguments("record", remote.as_ref());
            arguments.insert(2, out.into());
            BRIDGE.become_with(&arguments)
        }
        Some(other) => Err(CommandError::Usage(format!(
            "`{other}` is no run elsewhere: write zenoh/NAME; `flotor bridge list` shows who is there"
        ))),
    }
}

fn record_local(out: &Path) -> Result<(), CommandError> {
    let stop = stop_on_signals();
    let client =
        Client::find(&Directory::of_this_user()).map_err(|error| CommandError::Usage(error.to_string()))?;
    eprintln!("recording `{}` (Ctrl-C ends)", client.greeting().title);
    let Kept { ticks, dropped, end } = keep(client, out, &stop)?;
    let lost = match dropped {
        0 => String::new(),
        dropped => format!(", {} {dropped} ticks the host could not hand over", style::warning("without")),
    };
    let (RecordingEnd::Told(words) | RecordingEnd::Cut(words)) = &end;
    let told = report_line(format_args!("{}: {ticks} ticks{lost}; {words}", out.display()));
    let whole = match end {
        RecordingEnd::Told(_) => Ok(()),
        RecordingEnd::Cut(_) => Err(CommandError::Failed(
            "the recording ends before the run has told its end; what had come is in the file".to_owned(),
        )),
    };
    first_error([whole, told])
}

/// What came of a recording.
struct Kept {
    ticks: u64,
    dropped: u64,
    end: RecordingEnd,
}

/// How a recording of somebody else's run ends, in words.
enum RecordingEnd {
    /// The run is over, or whoever recorded has stopped.
    Told(String),
    /// The host went without a word.
    Cut(String),
}

fn keep(mut client: Client, out: &Path, stop: &StopSwitch) -> Result<Kept, CommandError> {
    let mut recorder = Recorder::create(out, client.run())?;
    let gone = |error: LiveError| CommandError::Failed(error.to_string());
    client.asker().ask(Ask::Watch { every: 1 }).map_err(gone)?;
    let mut kept = Kept { ticks: 0, dropped: 0, end: RecordingEnd::Told("stopped recording".to_owned()) };
    while !stop.is_stop_asked() {
        match client.next(LOOK_PERIOD) {
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
            Ok(Some(Event::Change(change))) => recorder.change(&Change::from(&change))?,
            Ok(Some(Event::End(end))) => {
                kept.end = RecordingEnd::Told(end.words);
                break;
            }
            // What was recorded is good; that the host died belongs to it.
            Err(error) => {
                kept.end = RecordingEnd::Cut(error.to_string());
                break;
            }
        }
    }
    recorder.finish()?;
    Ok(kept)
}
