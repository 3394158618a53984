//! Tables of a study file, and its options as command-line arguments.

use clap::{Args, FromArgMatches};
use flotor_command::CommandError;
use flotor_core::LARGEST_SEED;
use flotor_loader::nearest;
use flotor_session::scene::OwnScene;
use flotor_study::exclusion::ExclusionRules;
use flotor_study::log::{Plan, digest};
use serde::de::DeserializeOwned;
use std::ffi::{OsStr, OsString};
use std::path::Path;

/// Options whose values are paths, relative to the folder of the study file; the name of one of Flotor's own scenes is not a path.
const PATHS: [&str; 6] = ["out", "scene", "consent", "instructions", "texts", "plugin-path"];
/// Options that are only valid on the command line of `study run`.
const OF_THE_COMMAND_LINE: [&str; 2] = ["resume", "subject"];

/// Parses a table of a study file.
pub(super) fn read_table<T: DeserializeOwned>(file: &Path, text: &str) -> Result<T, CommandError> {
    toml::from_str(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start);
        let line = 1 + text.bytes().take(start).filter(|byte| *byte == b'\n').count();
        let mut message = error.message().replace('\n', " ");
        if message.contains("too large") {
            message += &format!("; write numbers below 2^63, and a seed up to {LARGEST_SEED}");
        }
        CommandError::Usage(format!("{}:{line}: {message}", file.display()))
    })
}

/// Parses command-line arguments of a study file.
pub(super) fn parsed<T: Args + FromArgMatches>(file: &Path, words: Vec<OsString>) -> Result<T, CommandError> {
    let command = clap::Command::new("study").no_binary_name(true);
    let matches = T::augment_args(command).try_get_matches_from(words);
    matches
        .and_then(|matches| T::from_arg_matches(&matches))
        .map_err(|error| CommandError::Usage(of_file(file, &error.to_string())))
}

/// Returns what the logs say of a study file.
pub(super) fn plan(file: &Path, text: String, exclusion: ExclusionRules) -> Plan {
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Plan { file: name, sha256: digest(&text), text, exclusion }
}

/// Converts the table `[options]` of a study file and the `further` options to command-line arguments; `known` are the options of the
/// command `flotor study` with the name `task`.
pub(super) fn option_words(
    file: &Path,
    task: &str,
    known: &[&clap::Arg],
    options: &toml::Table,
    further: Vec<OsString>,
) -> Result<Vec<OsString>, CommandError> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let said = Said(&further);
    let mut words: Vec<OsString> = Vec::new();
    // Plugin folders of the file, which are searched after the plugin folders of the command line.
    let mut last: Vec<OsString> = Vec::new();
    for (key, value) in options {
        let name = key.replace('_', "-");
        let refuse = |why: String| CommandError::Usage(format!("{}: options.{key}: {why}", file.display()));
        if OF_THE_COMMAND_LINE.contains(&name.as_str()) {
            return Err(refuse("write this option only on the command line".to_owned()));
        }
        let option = known.iter().find(|option| option.get_long() == Some(&name)).ok_or_else(|| {
            let names = known.iter().filter_map(|option| option.get_long());
            let near = nearest(&name, names).map_or_else(
                || format!("; `flotor study {task} --help` lists the options"),
                |near| format!("; did you mean `{near}`?"),
            );
            refuse(format!("`flotor study {task}` has no such option{near}"))
        })?;
        let value_of = |value: &toml::Value| match plain(value) {
            Some(text) if PATHS.contains(&name.as_str()) => {
                let path = folder.join(&text);
                let is_own =
                    name == "scene" && !path.is_file() && OwnScene::named(Path::new(&text)).is_some();
                Ok(if is_own { text.into() } else { path.into_os_string() })
            }
            Some(text) => Ok(OsString::from(text)),
            None => Err(refuse(format!(
                "the option accepts no value of type {}; write a number or a text",
                kind(value)
            ))),
        };
        let values = match (value, option.get_action()) {
            (toml::Value::Boolean(is_set), clap::ArgAction::SetTrue) => {
                words.extend((*is_set && !said.has(&name)).then(|| format!("--{name}").into()));
                continue;
            }
            (_, clap::ArgAction::SetTrue) => return Err(refuse("write true or false".to_owned())),
            (toml::Value::Array(values), clap::ArgAction::Append)
                if option.get_value_delimiter().is_none() =>
            {
                values.iter().map(value_of).collect::<Result<Vec<_>, _>>()?
            }
            (toml::Value::Array(values), _) if option.get_value_delimiter().is_some() => {
                let values = values.iter().map(value_of).collect::<Result<Vec<_>, _>>()?;
                vec![values.join(OsStr::new(","))]
            }
            (value, _) => vec![value_of(value)?],
        };
        for value in values {
            let one = [OsString::from(format!("--{name}")), value];
            match name.as_str() {
                "plugin-path" => last.extend(one),
                // A setting on the command line replaces the file's setting of the same parameter; the file's other settings
                // are added.
                "set" if said.sets(&one[1]) => {}
                "set" => words.extend(one),
                _ if said.has(&name) => {}
                _ => words.extend(one),
            }
        }
    }
    words.extend(further.iter().cloned());
    words.extend(last);
    if !said.has("resume") {
        words.push("--resume".into());
    }
    Ok(words)
}

/// Options on the command line, which override the options of the file.
struct Said<'a>(&'a [OsString]);

impl Said<'_> {
    fn has(&self, name: &str) -> bool {
        let (long, with_value) = (format!("--{name}"), format!("--{name}="));
        self.0.iter().any(|word| *word == *long || word.to_string_lossy().starts_with(&with_value))
    }

    /// Returns true if the command line sets the parameter of `PLUGIN.KEY=VALUE`.
    fn sets(&self, setting: &OsStr) -> bool {
        let key = |text: &str| text.split('=').next().unwrap_or_default().to_owned();
        let wanted = key(&setting.to_string_lossy());
        self.0.iter().enumerate().any(|(place, word)| match word.to_string_lossy().strip_prefix("--set") {
            Some("") => self.0.get(place + 1).is_some_and(|next| key(&next.to_string_lossy()) == wanted),
            Some(rest) => rest.strip_prefix('=').is_some_and(|rest| key(rest) == wanted),
            None => false,
        })
    }
}

fn kind(value: &toml::Value) -> &'static str {
    match value {
        toml::Value::Array(_) => "list",
        other => other.type_str(),
    }
}

/// Formats a string or number for the command line; `None` for a table, list, boolean or date.
fn plain(value: &toml::Value) -> Option<String> {
    match value {
        toml::Value::String(text) => Some(text.clone()),
        toml::Value::Integer(_) | toml::Value::Float(_) => Some(value.to_string()),
        _ => None,
    }
}

/// Formats an error of the command-line parser as one line, with the name of the study file.
fn of_file(file: &Path, reason: &str) -> String {
    let lines = reason.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("Usage:"));
    let reason = lines.take_while(|line| !line.starts_with("For more")).collect::<Vec<_>>().join(" ");
    format!("{}: {}", file.display(), reason.trim_start_matches("error: "))
}
