//! Study file with a design of one's own.

use super::options_table::{option_words, parsed, read_table};
use super::{Common, StudyArguments};
use clap::Args;
use flotor_command::CommandError;
use flotor_study::exclusion::ExclusionRules;
use flotor_study_design::design::{Blocks, Design, Draft};
use flotor_study_design::factor::Factor;
use flotor_study_design::form::Questionnaire;
use flotor_study_design::method::Method;
use flotor_study_design::observer::Population;
use flotor_study_design::stimulus::Stimulus;
use flotor_study_design::task::Task;
use serde::Deserialize;
use std::ffi::OsString;
use std::path::Path;

/// Options of a protocol that a design says itself.
const SAID_BY_DESIGN: [&str; 4] = ["stimulus", "first", "boundary", "weber"];

/// Study file with a design.
pub(super) struct DesignFile {
    pub(super) design: Design,
    pub(super) population: Population,
    /// Title for tables and pictures; the study's name without one.
    pub(super) title: String,
    /// Planned analysis as text.
    pub(super) analysis: String,
    exclusion: ExclusionRules,
    options: toml::Table,
}

/// Content of the file, before its checks.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    study: String,
    #[serde(default)]
    title: String,
    /// Planned analysis as text, fixed before data collection.
    #[serde(default)]
    analysis: String,
    #[serde(default, rename = "factor")]
    factors: Vec<Factor>,
    stimulus: Option<Stimulus>,
    task: Task,
    method: Method,
    #[serde(default)]
    blocks: Blocks,
    #[serde(default, rename = "questionnaire")]
    questionnaires: Vec<Questionnaire>,
    #[serde(default)]
    simulated: Population,
    #[serde(default)]
    exclusion: ExclusionRules,
    #[serde(default)]
    options: toml::Table,
}

/// Options of a study of one's own design.
#[derive(Args)]
pub(super) struct DesignArguments {
    #[command(flatten)]
    pub(super) common: Common,
}

impl DesignFile {
    /// Returns true for the text of a file with a design: `task` is a table in it, and a word in a file with a protocol.
    pub(super) fn is_in(text: &str) -> bool {
        let table = text.parse::<toml::Table>();
        table.is_ok_and(|table| {
            table.get("task").is_some_and(toml::Value::is_table) || table.contains_key("study")
        })
    }

    /// Reads the design and checks it.
    ///
    /// # Errors
    /// The first wrong line or key, with the remedy.
    pub(super) fn read(file: &Path, text: &str) -> Result<Self, CommandError> {
        let Content {
            study,
            title,
            factors,
            stimulus,
            task,
            method,
            blocks,
            questionnaires,
            simulated: population,
            exclusion,
            options,
            analysis,
        } = read_table(file, text)?;
        let wrong =
            |error: &dyn std::fmt::Display| CommandError::Usage(format!("{}: {error}", file.display()));
        let draft = Draft { study, factors, stimulus, task, method, blocks, questionnaires };
        let design = Design::try_from(draft).map_err(|error| wrong(&error))?;
        population.check(&design).map_err(|error| wrong(&error))?;
        let title = if title.is_empty() { design.study().to_owned() } else { title };
        Ok(Self { design, population, title, analysis, exclusion, options })
    }

    /// Returns a whole number among the options; `None` if the file does not set it.
    pub(super) fn option(&self, name: &str) -> Option<i64> {
        self.options.get(name).and_then(toml::Value::as_integer)
    }

    /// Returns the command-line arguments of a protocol with the options of the file, and the exclusion rules.
    pub(super) fn words(
        &self,
        file: &Path,
        task: &str,
        mut words: Vec<OsString>,
        further: Vec<OsString>,
    ) -> Result<(Vec<OsString>, ExclusionRules), CommandError> {
        let command = StudyArguments::augment_args(clap::Command::new("study"));
        let known: Vec<&clap::Arg> =
            command.find_subcommand(task).into_iter().flat_map(|task| task.get_arguments()).collect();
        words.insert(0, task.into());
        words.extend(option_words(file, task, &known, &self.options, further)?);
        Ok((words, self.exclusion.clone()))
    }

    /// Returns the options of the file and of the command line.
    pub(super) fn arguments(
        &self,
        file: &Path,
        further: Vec<OsString>,
    ) -> Result<DesignArguments, CommandError> {
        if self.exclusion != ExclusionRules::default() {
            return Err(CommandError::Usage(format!(
                "{}: exclusion: rules apply to the protocols jnd, magnitude and force; remove the table and exclude by the columns \
                 of the table of trials",
                file.display()
            )));
        }
        let command = DesignArguments::augment_args(clap::Command::new("run"));
        let is_known =
            |option: &&clap::Arg| !option.get_long().is_some_and(|name| SAID_BY_DESIGN.contains(&name));
        let known: Vec<&clap::Arg> = command.get_arguments().filter(is_known).collect();
        parsed(file, option_words(file, "run", &known, &self.options, further)?)
    }
}
