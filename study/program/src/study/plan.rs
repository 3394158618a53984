//! `flotor study run`: runs a study from a file.
//!
//! A file `NAME.study.toml` sets the options of an experiment for all subjects, and the exclusion rules and the plan of the
//! analysis, which are fixed before data collection. Every log contains text and SHA-256 of the file, so that the version of
//! the plan is documented.

use super::design_file::DesignFile;
use super::options_table::{option_words, parsed, plan, read_table};
use super::{StudyArguments, Task, designed, shipped};
use crate::analyse::choices::{Choices, PlannedTable};
use clap::Args;
use flotor_command::CommandError;
use flotor_hal::read_text;
use flotor_study::exclusion::ExclusionRules;
use serde::Deserialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Suffix of a study file's name.
const ENDING: &str = ".study.toml";
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
    A file may have a design of one's own instead of a task: factors, a question, a method, questionnaires \
    (chapter \"Experiments\" of the book). People answer the questions of a design on the terminal.\n\n\
    Examples:\n  \
    flotor study run weber.study.toml\n  \
    flotor study run weber.study.toml --observer human --subject 3\n  \
    flotor study run --observer human weber.study.toml\n  \
    flotor study run delay.study.toml --observer human --screen terminal\n  \
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
        read_table(file, text)
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
    if DesignFile::is_in(text) {
        let study = DesignFile::read(Path::new(""), text).ok()?;
        let subjects = study.option("subjects").and_then(|count| usize::try_from(count).ok());
        return Some(Planned { analysis: study.analysis, choices: Choices::default(), subjects });
    }
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
    let (file, text) = file_and_text(file)?;
    if DesignFile::is_in(&text) {
        let study = DesignFile::read(&file, &text)?;
        return match shipped::task_of(&study.design) {
            Some((task, words)) => run_words(&file, text, study.words(&file, task, words, further)?),
            None => designed::run(&file, text, study, further),
        };
    }
    let (words, exclusion) = words(&file, &text, further)?;
    run_words(&file, text, (words, exclusion))
}

/// Runs a task from command-line arguments of a study file.
fn run_words(
    file: &Path,
    text: String,
    (words, exclusion): (Vec<OsString>, ExclusionRules),
) -> Result<(), CommandError> {
    let mut study = parsed::<StudyArguments>(file, words)?;
    let plan = plan(file, text, exclusion);
    match &mut study.task {
        Task::Jnd(task) => task.common.plan = Some(plan),
        Task::Magnitude(task) => task.common.plan = Some(plan),
        Task::Force(task) => task.jnd.common.plan = Some(plan),
        _ => {}
    }
    super::run(&study)
}

/// Returns name and text of a study file: the named one, one of Flotor's own studies, or the only one of this folder.
pub(super) fn file_and_text(file: Option<PathBuf>) -> Result<(PathBuf, String), CommandError> {
    let file = file.map_or_else(|| only_one(Path::new(".")), Ok)?;
    if let Some(text) = shipped::text_of(&file).filter(|_| !file.exists()) {
        return Ok((file, text.to_owned()));
    }
    let text = read_text(&file, "the study file").map_err(|wrong| {
        let advice = if wrong.line == 0 { "; name a study file" } else { "" };
        CommandError::Usage(wrong.in_file(file.display()) + advice)
    })?;
    Ok((file, text))
}

/// Returns the only study file of a folder; an error if there is none, or more than one.
pub(super) fn only_one(folder: &Path) -> Result<PathBuf, CommandError> {
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
    let mut words: Vec<OsString> = vec![task.into()];
    words.extend(option_words(file, task, &known, &study.options, further)?);
    Ok((words, study.exclusion))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::FromArgMatches;

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
