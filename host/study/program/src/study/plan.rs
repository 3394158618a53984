//! `flotor study run`: a study that is a file.
//!
//! A file `NAME.study.toml` says what the options of an experiment say, once for all subjects, and what is decided before the data are
//! seen: exclusion rules and the plan of the analysis. Its digest goes into every log, so that nobody has to ask later which version
//! of the plan a sitting followed.

use super::{StudyArguments, Task};
use clap::{Args, FromArgMatches};
use flotor_command::CommandError;
use flotor_study::exclusion::ExclusionRules;
use flotor_study::log::{Plan, digest};
use serde::Deserialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// What the name of a study file ends with.
const ENDING: &str = ".study.toml";
/// Options whose values are files or folders: relative to that of the study file.
const PATHS: [&str; 4] = ["out", "scene", "consent", "instructions"];

#[derive(Args)]
#[command(
    after_help = "A study file has the task, what was decided beforehand, and options of that task by name:\n  \
    task = \"jnd\"\n  \
      analysis = \"mixed ANOVA of the Weber fractions, Holm's correction\"\n  \
    [options]\n  \
    out = \"data\"\n  \
    bases = [17, 26, 35]\n  \
    catch_trials = 1\n  \
    [exclusion]\n  \
    most_false_alarms = 0.5\n  \
    response_time_s = [0.2, 20]\n\n\
    Exclusion rules, which `flotor analyse` applies. About a sitting, the largest or least share: most_false_alarms (of \
    catch trials), least_agreement (of repeated pairs), most_retest_deviation (of repeated ratings), most_dont_know, \
    most_missed_ticks, most_excluded_trials. About a trial: response_time_s = [shortest, longest], least_movement_mm; a \
    trial of an adaptive track takes the track with it, unless the estimator is map.\n\n\
    Examples:\n  \
    flotor study run weber.study.toml\n  \
    flotor study run weber.study.toml --observer human --subject 3\n  \
    flotor study run                              the one study file here: begins, or goes on"
)]
pub(super) struct RunArguments {
    /// Study file (default: the one NAME.study.toml in this folder)
    #[arg(value_name = "FILE", allow_hyphen_values = true)]
    file: Option<PathBuf>,
    /// Further options of the task, such as --subject 3
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "OPTIONS")]
    further: Vec<OsString>,
}

/// The file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyFile {
    /// The experiment.
    task: TaskName,
    /// When a sitting or a trial does not count, decided beforehand.
    #[serde(default)]
    exclusion: ExclusionRules,
    /// What is to be computed, decided beforehand.
    #[serde(default)]
    #[allow(dead_code)] // for people, and for the digest
    analysis: String,
    /// Options of the experiment, by their names without dashes.
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

/// Carries out what the file says: begins, or goes on with what was broken off; complete subjects are skipped.
pub(super) fn run(arguments: &RunArguments) -> Result<(), CommandError> {
    // Without a file the first word may be an option.
    let (file, mut further) = (arguments.file.clone(), arguments.further.clone());
    let file = match file {
        Some(word) if word.to_string_lossy().starts_with('-') => {
            further.insert(0, word.into());
            None
        }
        file => file,
    };
    let file = file.map_or_else(|| only_one(Path::new(".")), Ok)?;
    let text = std::fs::read_to_string(&file)
        .map_err(|cause| CommandError::Usage(format!("{}: {cause}; name a study file", file.display())))?;
    let (words, exclusion) = words(&file, &text, further)?;
    let command = clap::Command::new("study").no_binary_name(true);
    let matches = StudyArguments::augment_args(command)
        .try_get_matches_from(words)
        .map_err(|error| CommandError::Usage(of_file(&file, &error.to_string())))?;
    let mut study = StudyArguments::from_arg_matches(&matches)
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

/// The one study file of a folder.
fn only_one(folder: &Path) -> Result<PathBuf, CommandError> {
    let entries = std::fs::read_dir(folder)
        .map_err(|cause| CommandError::Usage(format!("{}: {cause}", folder.display())))?;
    let files = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut found: Vec<PathBuf> = files.filter(|file| file.to_string_lossy().ends_with(ENDING)).collect();
    found.sort();
    match found.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(CommandError::Usage(format!("there is no NAME{ENDING} in this folder; name a study file"))),
        several => {
            let names: Vec<String> = several.iter().map(|file| file.display().to_string()).collect();
            Err(CommandError::Usage(format!("several study files, name one: {}", names.join(", "))))
        }
    }
}

/// The command line that says what a study file says, from the task on, and what does not count.
fn words(
    file: &Path,
    text: &str,
    further: Vec<OsString>,
) -> Result<(Vec<OsString>, ExclusionRules), CommandError> {
    let study: StudyFile =
        toml::from_str(text).map_err(|error| CommandError::Usage(of_file(file, &error.to_string())))?;
    let task = match study.task {
        TaskName::Jnd => "jnd",
        TaskName::Magnitude => "magnitude",
        TaskName::Force => "force",
    };
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut words: Vec<OsString> = vec![task.into()];
    let is_said = |name: &str| {
        let (long, with_value) = (format!("--{name}"), format!("--{name}="));
        further.iter().any(|word| *word == *long || word.to_string_lossy().starts_with(&with_value))
    };
    for (name, value) in &study.options {
        let name = name.replace('_', "-");
        if name == "resume" || is_said(&name) {
            continue; // of the command line, which goes before
        }
        let option = || OsString::from(format!("--{name}"));
        match value {
            toml::Value::Boolean(true) => words.push(option()),
            toml::Value::Boolean(false) => {}
            toml::Value::Array(values) if name == "set" => {
                words.extend(values.iter().flat_map(|value| [option(), plain(value).into()]));
            }
            toml::Value::Array(values) => {
                let values: Vec<String> = values.iter().map(plain).collect();
                words.extend([option(), values.join(",").into()]);
            }
            value if PATHS.contains(&name.as_str()) => {
                words.extend([option(), folder.join(plain(value)).into_os_string()]);
            }
            value => words.extend([option(), plain(value).into()]),
        }
    }
    words.extend(further);
    if !words.iter().any(|word| word == "--resume") {
        words.push("--resume".into());
    }
    Ok((words, study.exclusion))
}

fn plain(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// A reason in one line, with the file it is about.
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
        words.into_iter().map(|word| word.to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn options_may_stand_without_a_file() {
        let command = RunArguments::augment_args(clap::Command::new("run").no_binary_name(true));
        for line in [&["--subject", "3"][..], &["a.study.toml", "--subject", "3"]] {
            let matches = command.clone().try_get_matches_from(line);
            let arguments =
                RunArguments::from_arg_matches(&matches.expect("it is read")).expect("it is whole");
            assert_eq!(arguments.further.len(), line.len() - 1, "{line:?}");
        }
    }

    #[test]
    fn a_file_says_what_a_command_line_says_and_the_command_line_goes_before() {
        let words = said(FILE, &["--subjects", "2"]).join(" ");
        assert_eq!(
            words,
            "jnd --bases 17,26.5 --no-demo --out here/data --set spring.wire=1 --set device.hand=hold --subjects 2 --resume"
        );
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
            assert!(error.to_string().starts_with("a.study.toml: "), "{error}");
            assert_eq!(error.to_string().lines().count(), 1, "{error}");
        }
    }
}
