//! `flotor swap`: swaps a model of a running session of this machine.

use clap::Args;
use flotor_command::CommandError;
use flotor_command::options::KeyValue;
use flotor_command::say;
use flotor_live::{Answer, Ask, ChangeMessage, Client, Directory, Event, LiveError, RefusalCause, Subject};
use flotor_session::registry::Registry;
use flotor_session::scene::is_named;
use std::time::{Duration, Instant};

/// Timeout for the host's reply, which follows the creation of the model.
const CREATION_LIMIT: Duration = Duration::from_secs(60);
/// Timeout for the loop's report of the swap, after the host's reply.
const SWAP_LIMIT: Duration = Duration::from_secs(5);

/// Hot-swap a model of a running session, without a jump in the force.
#[derive(Args)]
#[command(
    after_help = "The host creates the new model outside the loop and blends it in over `fade_s` of the model.\n\
    Without --plugin, the host reads the plugin file of the scene again and keeps the scene's settings; another plugin\n\
    starts from its own defaults. Changes of parameters during the session are lost.\n\n\
    Examples:\n  \
    flotor swap spring                                      the same plugin, just rebuilt\n  \
    flotor swap spring --set gamma_n=20 --set variant=rod   the same plugin with other settings\n  \
    flotor swap spring --plugin wall --set stiffness_n_per_m=800\n  \
    flotor swap spring --plugin ./target/release/libmine.so --run 4711"
)]
pub(crate) struct SwapArguments {
    /// Name of the model in the scene; NAME@DEVICE for one of several devices
    model: String,
    /// The new plugin: its id or the path of its file (default: the same plugin)
    #[arg(long, value_name = "ID|FILE")]
    plugin: Option<String>,
    /// Set a parameter of the new model (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<KeyValue>,
    /// The session of this process (default: the newest session)
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
        None => say!("`{model}` will be swapped when the loop resumes"),
    }
    Ok(())
}

/// Converts a plugin's path to an absolute path for the host, which may have another working directory; an id stays unchanged.
fn for_host(plugin: &str) -> Result<String, CommandError> {
    if !Registry::search(&[]).is_path(plugin) {
        return Ok(plugin.to_owned());
    }
    let whole = std::path::absolute(plugin).map_err(|cause| {
        CommandError::Failed(format!(
            "`{plugin}`: cannot make the path absolute: {cause}; give the absolute path"
        ))
    })?;
    // The given path is UTF-8, so the current folder is not.
    whole.into_os_string().into_string().map_err(|path| {
        CommandError::Usage(format!(
            "`{}`: the path of the current folder is not valid UTF-8; move the plugin to a folder whose path is, and give its absolute path",
            path.display()
        ))
    })
}

/// Requests the swap and waits for its result: the change that the loop reports, or `None` if the loop does not report it in time.
fn swapped(client: &mut Client, ask: Ask, model: &str) -> Result<Option<ChangeMessage>, CommandError> {
    let lost = |error: LiveError| CommandError::Failed(error.to_string());
    let asked = client.request_client().ask(ask).map_err(lost)?;
    let (mut change, mut is_answered) = (None, false);
    let mut until = Instant::now() + CREATION_LIMIT;
    while change.is_none() || !is_answered {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            break;
        }
        match client.next(left).map_err(lost)? {
            Some(Event::Answer(Answer { number, refused, cause })) if number == asked => {
                if let Some(reason) = refused {
                    return Err(match cause {
                        RefusalCause::Request => CommandError::Usage(reason),
                        RefusalCause::Plugin => CommandError::PluginRefused(reason),
                        RefusalCause::Other => CommandError::Failed(reason),
                    });
                }
                is_answered = true;
                until = Instant::now() + SWAP_LIMIT;
            }
            // The change may arrive before the answer.
            Some(Event::Change(reported))
                if reported.subject == Subject::Plugin && is_named(&reported.plugin, model) =>
            {
                change = Some(reported);
            }
            Some(Event::End(end)) => return Err(CommandError::Failed(end.words)),
            _ => {}
        }
    }
    if is_answered {
        return Ok(change);
    }
    Err(CommandError::Failed(format!(
        "no reply from the host in {} s; the host may still swap the model: look at the session with `flotor view` before \
         you try again",
        CREATION_LIMIT.as_secs()
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_file_of_this_folder_is_named_by_its_whole_path() {
        // Tests run in the folder of their crate.
        let file = for_host("Cargo.toml").unwrap_or_else(|error| panic!("{error}"));
        assert!(Path::new(&file).is_absolute(), "{file}");
        let id = for_host("spring").unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(id, "spring");
    }
}
