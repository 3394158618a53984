//! `flotor swap`: another plugin in place of a model of a run that somebody started, here on this machine.

use clap::Args;
use flotor_command::CommandError;
use flotor_command::options::KeyValue;
use flotor_command::say;
use flotor_live::{Answer, Ask, ChangeMessage, Client, Directory, Event, LiveError, Subject};
use flotor_session::scene::is_named;
use std::path::MAIN_SEPARATOR;
use std::time::{Duration, Instant};

/// How long a host may take to make a model.
const MAKING: Duration = Duration::from_secs(60);
/// How long a loop may take to take it in, and its observers to say so.
const TAKING_IN: Duration = Duration::from_secs(5);

/// Replace a model of a run that is on, without a jump in the force.
#[derive(Args)]
#[command(
    after_help = "The new model is made beside the loop and fades in while the old one fades out (`fade_s` of the model).\n\
    Without --plugin it is the plugin of the scene, its file read again, with the scene's settings; another plugin\n\
    starts from its own defaults. Parameters that were changed while the run was on are not kept.\n\n\
    Examples:\n  \
    flotor swap spring                                      the same plugin, built anew a moment ago\n  \
    flotor swap spring --set gamma_n=20 --set variant=rod   the same one with other settings\n  \
    flotor swap spring --plugin wall --set stiffness_n_per_m=800\n  \
    flotor swap spring --plugin ./target/release/libmine.so --run 4711"
)]
pub(crate) struct SwapArguments {
    /// Name of the model in the scene
    model: String,
    /// What comes in its place: the id of a plugin or the path of its file (default: the same plugin)
    #[arg(long, value_name = "ID|FILE")]
    plugin: Option<String>,
    /// Set a parameter of the new model (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<KeyValue>,
    /// The run of this process (default: the newest run)
    #[arg(long, value_name = "PID")]
    run: Option<u32>,
}

pub(crate) fn run(arguments: &SwapArguments) -> Result<(), CommandError> {
    let SwapArguments { model, plugin, sets, run } = arguments;
    let directory = Directory::of_this_user();
    let found = match run {
        Some(process) => Client::of_process(&directory, *process),
        None => Client::find(&directory),
    };
    let mut client = found.map_err(|error| CommandError::Usage(error.to_string()))?;
    let pair = |set: &KeyValue| {
        let (key, value) = set.pair();
        (key.to_owned(), value.to_owned())
    };
    let ask = Ask::Swap {
        model: model.clone(),
        plugin: plugin.as_deref().map(for_host).transpose()?,
        settings: sets.iter().map(pair).collect(),
    };
    match swapped(&mut client, ask, model)? {
        Some(ChangeMessage { plugin, parameter, value, tick, .. }) => {
            say!("`{plugin}` is `{parameter}` {value} from tick {tick} on");
        }
        None => say!("`{model}` is replaced as soon as the loop goes on"),
    }
    Ok(())
}

/// A plugin as the host finds it, which may have been started in another folder: a file by its whole path.
fn for_host(plugin: &str) -> Result<String, CommandError> {
    if !plugin.contains(MAIN_SEPARATOR) {
        return Ok(plugin.to_owned());
    }
    let whole = std::path::absolute(plugin)
        .map_err(|cause| CommandError::file(plugin.as_ref(), "cannot be found", cause))?;
    whole
        .into_os_string()
        .into_string()
        .map_err(|path| CommandError::Usage(format!("`{}` cannot be told: it is no text", path.display())))
}

/// Asks for it and waits for what becomes of it: the change in the loop, unless nothing is heard of that in time.
fn swapped(client: &mut Client, ask: Ask, model: &str) -> Result<Option<ChangeMessage>, CommandError> {
    let gone = |error: LiveError| CommandError::Failed(error.to_string());
    let asked = client.asker().ask(ask).map_err(gone)?;
    let (mut change, mut is_answered) = (None, false);
    let mut until = Instant::now() + MAKING;
    while change.is_none() || !is_answered {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            break;
        }
        match client.next(left).map_err(gone)? {
            Some(Event::Answer(Answer { number, refused })) if number == asked => {
                refused.map_or(Ok(()), |reason| Err(CommandError::Failed(reason)))?;
                is_answered = true;
                until = Instant::now() + TAKING_IN;
            }
            // The loop may be faster than the answer.
            Some(Event::Change(told)) if told.subject == Subject::Plugin && is_named(&told.plugin, model) => {
                change = Some(told);
            }
            Some(Event::End(end)) => return Err(CommandError::Failed(end.words)),
            _ => {}
        }
    }
    if is_answered {
        return Ok(change);
    }
    Err(CommandError::Failed(format!(
        "the host has not answered in {} s; the model may still come in",
        MAKING.as_secs()
    )))
}
