//! `flotor study run`: runs a study from a file.
//!
//! A file `NAME.study.toml` sets the options of an experiment for all subjects, and the exclusion rules and the plan of the
//! analysis, which are fixed before data collection. Every log contains text and SHA-256 of the file, so that the version of
//! the plan is documented.

use super::{StudyArguments, Task};
use crate::analyse::choices::{Choices, PlannedTable};
use clap::{Args, FromArgMatches};
use flotor_command::CommandError;
use flotor_core::LARGEST_SEED;
use flotor_hal::read_text;
use flotor_loader::nearest;
use flotor_session::scene::OwnScene;
use flotor_study::exclusion::ExclusionRules;
use flotor_study::log::{Plan, digest};
use serde::Deserialize;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// Suffix of a study file's name.
const ENDING: &str = ".study.toml";
/// Options whose values are paths, relative to the folder of the study file; the name of one of Flotor's own scenes is no path.
const PATHS: [&str; 6] = ["out", "scene", "consent", "instructions", "texts", "plugin-path"];
/// Options that are only valid on the command line of `study run`.
const OF_THE_COMMAND_LINE: [&str; 2] = ["resume", "subject"];

#[derive(Args)]
#[command(
    after_help = "A study file has the task, the planned analysis, and options of the task by name:\n  \
    task = \"jnd\"\n  \
    analysis = \"mixed ANOVA of the Weber fractions, Holm's correction\"\n  \
    [options]\n  \
    out = \"data\"\n  \
    bases = [17, 26, 35]\n  \
    catch_trials = 1\n  \
    [analyse]\n  \
    estimator = \"procedure\"\n  \
    [exclusion]\n  \
    most_false_alarms = 0.5\n  \
    response_time_s = [0.2, 20]\n\n\
    `flotor analyse` applies the exclusion rules. Rules for a sitting, each the largest or smallest valid share: \
    most_false_alarms (of \
    catch trials), most_missed_obvious (of obvious pairs), most_wrong_at_large (of answers to 40 % and more), \
    least_agreement (of repeated pairs), most_retest_deviation (of repeated ratings), most_dont_know, \
    most_missed_ticks, most_excluded_trials. Rules for a trial: response_time_s = [shortest, longest], \
    least_movement_mm; an excluded trial of an adaptive track excludes the whole track, unless the estimator is \
    map.\n\n\
    Planned options of `flotor analyse`, which reports each deviation from the plan: estimator, type, ratings.\n\n\
    Examples:\n  \
    flotor study run weber.study.toml\n  \
    flotor study run weber.study.toml --observer human --subject 3\n  \
    flotor study run --observer human weber.study.toml\n  \
    flotor study run                              the only study file of this folder: begins or resumes"
)]
pub(super) struct RunArguments {
    /// Study file (default: the only NAME.study.toml in this folder)
    #[arg(value_name = "FILE", allow_hyphen_values = true)]
    file: Option<PathBuf>,
    /// Further options of the task, such as --subject 3
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "OPTIONS")]
    further: Vec<OsString>,
}

/// Content of a study file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyFile {
    /// Experiment: `jnd`, `magnitude` or `force`.
    task: TaskName,
    /// Exclusion rules, fixed before data collection.
    #[serde(default)]
    exclusion: ExclusionRules,
    /// Planned analysis as text, fixed before data collection.
    #[serde(default)]
    analysis: String,
    /// Planned options of `flotor analyse`.
    #[serde(default)]
    analyse: PlannedTable,
    /// Options of the experiment, by long name without leading dashes; `_` stands for `-`.
    #[serde(default)]
    options: toml::Table,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum TaskName {
    Jnd,
    Magnitude,
    Force,
}

impl StudyFile {
    fn read(file: &Path, text: &str) -> Result<Self, CommandError> {
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
}

/// Analysis plan of a study file.
pub(crate) struct Planned {
    /// Description of the planned analysis.
    pub(crate) analysis: String,
    /// Planned options of `flotor analyse`.
    pub(crate) choices: Choices,
    /// Planned number of subjects; `None` if not stated.
    pub(crate) subjects: Option<usize>,
}

/// Parses the analysis plan from the text of a study file; `None` if this version cannot parse it.
pub(crate) fn planned(text: &str) -> Option<Planned> {
    let study = StudyFile::read(Path::new(""), text).ok()?;
    let choices = Choices::planned(&study.analyse).ok()?;
    let subjects = study.options.get("subjects").and_then(toml::Value::as_integer);
    let subjects = subjects.and_then(|count| usize::try_from(count).ok());
    Some(Planned { analysis: study.analysis, choices, subjects })
}

impl RunArguments {
    /// Separates the name of the study file from the options before and after it; `None` if no file is named.
    fn file_and_options(&self) -> (Option<PathBuf>, Vec<OsString>) {
        let mut words: Vec<OsString> =
            self.file.iter().map(OsString::from).chain(self.further.iter().cloned()).collect();
        let study = StudyArguments::augment_args(clap::Command::new("study"));
        let options = || study.get_subcommands().flat_map(clap::Command::get_arguments);
        let takes_value = |word: &str| {
            let name = word.strip_prefix("--");
            options().any(|option| option.get_long() == name && option.get_action().takes_values())
        };
        let mut is_value = false;
        let place = words.iter().position(|word| {
            let word = word.to_string_lossy();
            let is_file = !is_value && !word.starts_with('-');
            is_value = !is_value && word.starts_with("--") && takes_value(&word);
            is_file
        });
        let file = place.map(|place| PathBuf::from(words.remove(place)));
        (file, words)
    }
}

/// Runs the study of a study file: begins or resumes it, and skips complete subjects.
pub(super) fn run(arguments: &RunArguments) -> Result<(), CommandError> {
    let (file, further) = arguments.file_and_options();
    let file = file.map_or_else(|| only_one(Path::new(".")), Ok)?;
    let text = read_text(&file, "the study file").map_err(|wrong| {
        let advice = if wrong.line == 0 { "; name a study file" } else { "" };
        CommandError::Usage(wrong.in_file(file.display()) + advice)
    })?;
    let (words, exclusion) = words(&file, &text, further)?;
    let command = clap::Command::new("study").no_binary_name(true);
    let mut study = StudyArguments::augment_args(command)
        .try_get_matches_from(words)
        .and_then(|matches| StudyArguments::from_arg_matches(&matches))
        .map_err(|error| CommandError::Usage(of_file(&file, &error.to_string())))?;
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let plan = Plan { file: name, sha256: digest(&text), text, exclusion };
    match &mut study.task {
        Task::Jnd(task) => task.common.plan = Some(plan),
        Task::Magnitude(task) => task.common.plan = Some(plan),
        Task::Force(task) => task.jnd.common.plan = Some(plan),
        _ => {}
    }
    super::run(&study)
}

/// Returns the only study file of a folder; an error if there is none, or more than one.
fn only_one(folder: &Path) -> Result<PathBuf, CommandError> {
    let entries = std::fs::read_dir(folder).map_err(|cause| {
        CommandError::Usage(format!(
            "{}: cannot read the folder: {cause}; name a study file",
            folder.display()
        ))
    })?;
    let entries = entries.flatten().filter(|entry| {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        name.ends_with(ENDING) && !name.starts_with('.')
    });
    let mut found: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    found.sort();
    match found.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(CommandError::Usage(format!("this folder has no file NAME{ENDING}; name a study file"))),
        several => {
            let names: Vec<String> = several.iter().map(|file| file.display().to_string()).collect();
            Err(CommandError::Usage(format!(
                "there are several study files; name one of them: {}",
                names.join(", ")
            )))
        }
    }
}

/// Converts a study file and the `further` options to command-line arguments, from the task on; also returns the exclusion
/// rules of the file.
fn words(
    file: &Path,
    text: &str,
    further: Vec<OsString>,
) -> Result<(Vec<OsString>, ExclusionRules), CommandError> {
    let study = StudyFile::read(file, text)?;
    Choices::planned(&study.analyse)
        .map_err(|why| CommandError::Usage(format!("{}: {why}", file.display())))?;
    let task = match study.task {
        TaskName::Jnd => "jnd",
        TaskName::Magnitude => "magnitude",
        TaskName::Force => "force",
    };
    let study_command = StudyArguments::augment_args(clap::Command::new("study"));
    let known: Vec<&clap::Arg> =
        study_command.find_subcommand(task).into_iter().flat_map(|task| task.get_arguments()).collect();
    let folder = file.parent().unwrap_or(Path::new(""));
    let said = Said(&further);
    let mut words: Vec<OsString> = vec![task.into()];
    // Plugin folders of the file, which are searched after the plugin folders of the command line.
    let mut last: Vec<OsString> = Vec::new();
    for (key, value) in &study.options {
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
    Ok((words, study.exclusion))
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

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "task = \"jnd\"\n[options]\nout = \"data\"\nbases = [17, 26.5]\nno_demo = true\n\
                        set = [\"spring.wire=1\", \"device.hand=hold\"]\nsubjects = 4\n";

    fn said(text: &str, further: &[&str]) -> Vec<String> {
        let further = further.iter().map(OsString::from).collect();
        let (words, _) = words(Path::new("here/weber.study.toml"), text, further).expect("a study file");
        // Whatever a system has between the folders of a path.
        words.into_iter().map(|word| word.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/")).collect()
    }

    #[test]
    fn the_file_stands_before_between_or_after_the_options() {
        let command = RunArguments::augment_args(clap::Command::new("run").no_binary_name(true));
        for (line, file, options) in [
            (&["--subject", "3"][..], None, 2),
            (&["a.study.toml", "--subject", "3"], Some("a.study.toml"), 2),
            (&["--observer", "human", "a.study.toml"], Some("a.study.toml"), 2),
            (&["--no-demo", "a.study.toml", "--resume"], Some("a.study.toml"), 2),
            (&["--observer=human", "a.study.toml"], Some("a.study.toml"), 1),
            (&["--least-movement-mm", "-2", "a.study.toml", "--bases", "17"], Some("a.study.toml"), 4),
        ] {
            let matches = command.clone().try_get_matches_from(line);
            let arguments =
                RunArguments::from_arg_matches(&matches.expect("it is read")).expect("it is whole");
            let (found, rest) = arguments.file_and_options();
            assert_eq!((found, rest.len()), (file.map(PathBuf::from), options), "{line:?}");
        }
    }

    #[test]
    fn the_plan_of_an_analysis_is_checked_and_read_back() {
        let text = "task = \"jnd\"\nanalysis = \"paired t\"\n[options]\nsubjects = 4\n[analyse]\nestimator = \"map\"\n";
        let planned = planned(text).expect("a plan");
        assert_eq!((planned.analysis.as_str(), planned.subjects), ("paired t", Some(4)));
        assert_eq!(planned.choices.options().estimator, flotor_analysis::Estimator::Map);
        let wrong = text.replace("\"map\"", "\"mpa\"");
        let error = words(Path::new("a.study.toml"), &wrong, Vec::new()).expect_err("no such estimator");
        let said = "a.study.toml: analyse.estimator: `mpa` is not valid; use one of procedure, map";
        assert_eq!(error.to_string(), said);
    }

    #[test]
    fn a_file_says_what_a_command_line_says_and_the_command_line_goes_before() {
        let words = said(FILE, &["--subjects", "2"]).join(" ");
        assert_eq!(
            words,
            "jnd --bases 17,26.5 --no-demo --out here/data --set spring.wire=1 --set device.hand=hold --subjects 2 --resume"
        );
    }

    /// A setting of the command line goes before the one of the same parameter, and the others stay; folders for plugins are
    /// relative to the file and searched after those of the command line.
    #[test]
    fn repeatable_options_are_joined_by_what_they_are() {
        let words = said(FILE, &["--set", "device.hand=still", "--set=wall.size_mm=2"]).join(" ");
        assert!(words.contains("--set spring.wire=1 ") && !words.contains("hand=hold"), "{words}");
        let text = "task = \"jnd\"\n[options]\nplugin_path = [\"mine\", \"/yours\"]\n";
        let words = said(text, &["--plugin-path", "first"]).join(" ");
        assert_eq!(words, "jnd --plugin-path first --plugin-path here/mine --plugin-path /yours --resume");
    }

    /// The name of one of Flotor's own scenes is valid in every folder; any other scene is a file beside the study file.
    #[test]
    fn a_scene_of_flotor_has_no_folder() {
        for (scene, expected) in
            [("falcon", "falcon"), ("falcon.toml", "here/falcon.toml"), ("mine", "here/mine")]
        {
            let words = said(&format!("task = \"jnd\"\n[options]\nscene = \"{scene}\"\n"), &[]).join(" ");
            assert_eq!(words, format!("jnd --scene {expected} --resume"));
        }
    }

    #[test]
    fn an_option_that_is_none_is_refused_with_its_name() {
        for (options, reason) in [
            ("help = true", "options.help: `flotor study jnd` has no such option"),
            ("subjets = 3", "did you mean `subjects`?"),
            ("range = \"1-2\"", "options.range: `flotor study jnd` has no such option"),
            ("subjects = true", "options.subjects: the option accepts no value of type boolean"),
            ("subjects = [3, 4]", "options.subjects: the option accepts no value of type list"),
            ("no_demo = 1", "options.no_demo: write true or false"),
            ("resume = true", "options.resume: write this option only on the command line"),
        ] {
            let text = format!("task = \"jnd\"\n[options]\n{options}\n");
            let error = words(Path::new("a.study.toml"), &text, Vec::new()).expect_err(options).to_string();
            assert!(error.starts_with("a.study.toml: ") && error.contains(reason), "{error}");
        }
    }

    #[test]
    fn what_is_no_study_file_is_refused_with_its_name() {
        for wrong in [
            "",
            "task = \"nothing\"",
            "task = \"jnd\"\nexclusion = \"x\"",
            "task = \"jnd\"\n[exclusion]\nmost = 1",
            "task = ",
        ] {
            let error = words(Path::new("a.study.toml"), wrong, Vec::new()).expect_err("it is none");
            assert!(error.to_string().starts_with("a.study.toml:"), "{error}");
            assert!(!error.to_string().contains(['|', '^', '\n']), "{error}");
        }
        for (wrong, line) in [
            ("task = \"jnd\"\n[exclusion]\nmost = 1", 3),
            ("task = \"jnd\"\n\nmost = 1\n[exclusion]\n", 3),
            ("task = \"nothing\"", 1),
            ("task = \"jnd\"\r\n[exclusion]\r\n\r\n  most = 1\r\n", 4),
        ] {
            let error = words(Path::new("a.study.toml"), wrong, Vec::new()).expect_err("it is none");
            assert!(error.to_string().starts_with(&format!("a.study.toml:{line}: ")), "{wrong:?}: {error}");
        }
    }
}
