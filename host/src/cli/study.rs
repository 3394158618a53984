//! `flotor study`: perception experiments.

mod bias;
mod choices;
mod human;

use super::stopping::stop_on_signals;
use super::{CommandError, run, style};
use crate::registry::Registry;
use choices::{
    AveragingChoice, BoundaryChoice, FirstChoice, OrderChoice, ProcedureChoice, SideChoice, StepChoice, range,
};
use clap::{Args, Subcommand, ValueEnum};
use flotor_hal::ParameterKind;
use flotor_hal::abi::PluginKind;
use flotor_study::cohort::{Cohort, CohortError, Earlier};
use flotor_study::conduct::Nothing;
use flotor_study::dataset::{Dataset, DatasetError};
use flotor_study::observer::Population;
use flotor_study::procedure::{Procedure, QuestPlusRule, WeightedUpDownRule};
use flotor_study::protocol::{
    AtBoundary, JndDemo, JndProtocol, MagnitudeProtocol, Protocol, Stimulus, SubjectNumber,
};
use serde_json::json;
use std::path::PathBuf;

/// Perception experiments
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    flotor study jnd --out data                              16 simulated subjects, thresholds of stiffness\n  \
    flotor analyse data                                      Weber fractions, tests, effects\n  \
    flotor study magnitude --subjects 8 --seed 3 --out ratings\n  \
    flotor study jnd --bases 20,40 --target 0.8 --side random --out other\n  \
    flotor study jnd --out data --resume                     go on where it broke off\n  \
    flotor study jnd --observer human --subject 3 --scene mlhd.toml --out people    a person, in front of the viewer\n  \
    flotor study bias --runs 1000                            what is each estimator worth?")]
pub(crate) struct StudyArguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Just noticeable difference: pairs, by an adaptive procedure
    Jnd(JndArguments),
    /// Magnitude estimation: one at a time, any number
    Magnitude(MagnitudeArguments),
    /// Add a note of the experimenter to a subject's log
    Note(NoteArguments),
    /// How far each way to a threshold is off, with observers whose threshold is known
    Bias(bias::BiasArguments),
}

/// `--observer`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum ObserverOption {
    /// Signal detection with known thresholds
    #[default]
    Simulated,
    /// A person at the device, in front of the viewer
    Human,
}

/// What every experiment has.
#[derive(Args)]
struct Common {
    /// Who answers
    #[arg(long, value_enum, default_value_t)]
    observer: ObserverOption,
    /// How many subjects, numbered from 1
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u16).range(1..=i64::from(SubjectNumber::MOST)), value_name = "N")]
    subjects: u16,
    /// The subject's number (--observer human)
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=i64::from(SubjectNumber::MOST)), value_name = "N")]
    subject: Option<u16>,
    /// The scene that is felt (--observer human; default: the demo's)
    #[arg(long, value_name = "SCENE.toml")]
    scene: Option<PathBuf>,
    /// Seed of orders, presentations and simulated answers
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Folder for the data
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Go on with subjects who broke off, leave complete ones alone
    #[arg(long)]
    resume: bool,
    /// What is varied: MODEL.PARAMETER
    #[arg(long, default_value = "spring.gamma_n", value_name = "MODEL.KEY")]
    stimulus: String,
    /// Which modality comes first
    #[arg(long, value_enum, default_value_t, value_name = "MODALITY")]
    first: FirstChoice,
    /// What happens when the handle leaves its range
    #[arg(long, value_enum, default_value_t)]
    boundary: BoundaryChoice,
}

#[derive(Args)]
struct NoteArguments {
    /// Folder of the study
    #[arg(value_name = "DIR")]
    data: PathBuf,
    /// Number of the subject
    #[arg(value_name = "SUBJECT", value_parser = clap::value_parser!(u16).range(1..=i64::from(SubjectNumber::MOST)))]
    subject: u16,
    /// What is to be known; no names
    #[arg(value_name = "TEXT")]
    text: String,
}

#[derive(Args)]
struct JndArguments {
    #[command(flatten)]
    common: Common,
    /// Bases, in the stimulus's unit
    #[arg(long, value_delimiter = ',', default_values_t = [17.0, 26.0, 35.0], value_name = "LIST")]
    bases: Vec<f64>,
    /// Replications, in alternating modality
    #[arg(long, default_value_t = 4, value_name = "N")]
    replications: u32,
    /// Which difference comes next
    #[arg(long, value_enum, default_value_t)]
    procedure: ProcedureChoice,
    /// QUEST+: trials of a track
    #[arg(long, default_value_t = 18, value_name = "N")]
    trials: u32,
    /// First difference, as a share of the base
    #[arg(long, default_value_t = 0.40, value_name = "SHARE")]
    initial: f64,
    /// First step down, as a share of the base
    #[arg(long, default_value_t = 0.10, value_name = "SHARE")]
    step: f64,
    /// Share of correct answers aimed at
    #[arg(long, default_value_t = 0.75, value_name = "SHARE")]
    target: f64,
    /// Reversals that halve the step
    #[arg(long, value_delimiter = ',', default_values_t = [2, 4], value_name = "LIST")]
    halve_at: Vec<u32>,
    /// Reversal that ends a track
    #[arg(long, default_value_t = 8, value_name = "N")]
    stop_after: u32,
    /// Reversal from which differences count for the threshold
    #[arg(long, default_value_t = 4, value_name = "N")]
    average_from: u32,
    /// Whether the trials of the first and last of these reversals count
    #[arg(long, value_enum, default_value_t)]
    averaging: AveragingChoice,
    /// Which step is applied at a reversal that halves it
    #[arg(long, value_enum, default_value_t)]
    step_at_reversal: StepChoice,
    /// Smallest difference, as a share of the base
    #[arg(long, default_value_t = 0.0, value_name = "SHARE")]
    floor: f64,
    /// Largest difference, as a share of the base
    #[arg(long, default_value_t = 0.95, value_name = "SHARE")]
    ceiling: f64,
    /// On which side of the base the comparison lies
    #[arg(long, value_enum, default_value_t)]
    side: SideChoice,
    /// Which of a pair comes first
    #[arg(long, value_enum, default_value_t)]
    order: OrderChoice,
    /// No practice pairs
    #[arg(long)]
    no_demo: bool,
}

#[derive(Args)]
struct MagnitudeArguments {
    #[command(flatten)]
    common: Common,
    /// Smallest and largest stimulus, in its unit
    #[arg(long, default_value = "12-48", value_parser = range, value_name = "LEAST-MOST")]
    range: (f64, f64),
    /// Stimuli, at equal distances
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(3..=1000), value_name = "N")]
    stimuli: u32,
    /// Replications in each modality
    #[arg(long, default_value_t = 3, value_name = "N")]
    replications: u32,
    /// Stimuli shown before each modality
    #[arg(long, default_value_t = 5, value_name = "N")]
    demo: u32,
}

pub(crate) fn run(arguments: &StudyArguments) -> Result<(), CommandError> {
    match &arguments.task {
        Task::Note(arguments) => note(arguments),
        Task::Bias(arguments) => bias::run(arguments),
        Task::Jnd(arguments) => carry_out(&arguments.common, Protocol::Jnd(arguments.protocol()?)),
        Task::Magnitude(arguments) => {
            carry_out(&arguments.common, Protocol::Magnitude(arguments.protocol()?))
        }
    }
}

impl Common {
    fn stimulus(&self) -> Result<Stimulus, CommandError> {
        let (model, parameter) = self.stimulus.split_once('.').ok_or_else(|| {
            let text = &self.stimulus;
            CommandError::Usage(format!("--stimulus {text}: write MODEL.PARAMETER, like spring.gamma_n"))
        })?;
        Ok(Stimulus { model: model.to_owned(), parameter: parameter.to_owned() })
    }

    fn at_boundary(&self) -> AtBoundary {
        self.boundary.into()
    }
}

impl JndArguments {
    fn protocol(&self) -> Result<JndProtocol, CommandError> {
        let rule = WeightedUpDownRule {
            initial_delta: self.initial,
            first_step: self.step,
            target: self.target,
            halve_at: self.halve_at.clone(),
            stop_after: self.stop_after,
            average_from: self.average_from,
            averaging: self.averaging.into(),
            step_at_reversal: self.step_at_reversal.into(),
            floor: self.floor,
            ceiling: self.ceiling,
            ..WeightedUpDownRule::default()
        };
        let procedure = match self.procedure {
            ProcedureChoice::WeightedUpDown => Procedure::WeightedUpDown(rule),
            ProcedureChoice::Questplus => Procedure::QuestPlus(QuestPlusRule {
                trials: self.trials,
                target: self.target,
                ..QuestPlusRule::default()
            }),
        };
        Ok(JndProtocol {
            stimulus: self.common.stimulus()?,
            bases: self.bases.clone(),
            replications: self.replications,
            first_modality: self.common.first.into(),
            procedure,
            side: self.side.into(),
            order: self.order.into(),
            at_boundary: self.common.at_boundary(),
            demo: JndDemo { shown: !self.no_demo, ..JndDemo::default() },
        })
    }
}

impl MagnitudeArguments {
    fn protocol(&self) -> Result<MagnitudeProtocol, CommandError> {
        let (least, most) = self.range;
        Ok(MagnitudeProtocol {
            stimulus: self.common.stimulus()?,
            values: MagnitudeProtocol::evenly(least, most, self.stimuli),
            replications: self.replications,
            first_modality: self.common.first.into(),
            demo: self.demo,
            at_boundary: self.common.at_boundary(),
        })
    }
}

/// Checks everything, then carries the study out.
fn carry_out(common: &Common, protocol: Protocol) -> Result<(), CommandError> {
    protocol.check().map_err(|error| CommandError::Usage(error.to_string()))?;
    check_stimulus(&protocol)?;
    if let ObserverOption::Human = common.observer {
        return human::carry_out(common, &protocol);
    }
    let cohort = Cohort {
        seed: common.seed,
        subjects: (1..=common.subjects).filter_map(SubjectNumber::new).collect(),
        population: Population::default(),
        apparatus: json!(null),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        earlier: if common.resume { Earlier::Resume } else { Earlier::Refuse },
        protocol,
    };
    let about = u64::from(common.subjects) * cohort.protocol.presentations_about();
    let progress = run::progress_bar(about, "{wide_bar} {pos} of about {len} presentations  {elapsed}");
    let stop = stop_on_signals().stop_flag();
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let dataset = Dataset::at(&common.out);
    let watch = || progress.inc(1);
    let result = cohort.run(&dataset, threads, &|_| Ok(Box::new(Nothing)), &watch, &stop);
    progress.finish_and_clear();
    result.map_err(refused)?;
    tell(&dataset)
}

/// The stimulus is a number of a model that exists, and every value lies in its range.
fn check_stimulus(protocol: &Protocol) -> Result<(), CommandError> {
    let stimulus = protocol.stimulus();
    let plugin = Registry::search(&[]).load(&stimulus.model, PluginKind::Model)?;
    let known = || plugin.parameters().iter().filter(|known| known.kind() == ParameterKind::Real);
    let parameter = known().find(|known| known.id() == stimulus.parameter).ok_or_else(|| {
        let ids: Vec<&str> = known().map(flotor_hal::Parameter::id).collect();
        let hint = crate::scene::nearest(&stimulus.parameter, ids.iter().copied());
        let hint = hint.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
        let (model, parameter) = (&stimulus.model, &stimulus.parameter);
        CommandError::Usage(format!(
            "--stimulus {stimulus}: `{model}` has no number `{parameter}`{hint} (there are {})",
            ids.join(", ")
        ))
    })?;
    if parameter.mutability() != flotor_hal::Mutability::Live {
        return Err(CommandError::Usage(format!(
            "--stimulus {stimulus}: it can only be set when the model is made, not between trials; choose a live one \
             (`flotor plugins {}` lists them)",
            stimulus.model
        )));
    }
    let in_range = protocol.check_range(parameter.min(), parameter.max());
    in_range.map_err(|error| CommandError::Usage(error.to_string()))
}

fn note(arguments: &NoteArguments) -> Result<(), CommandError> {
    let logs = Dataset::at(&arguments.data).logs().map_err(|error| refused(error.into()))?;
    let log = logs.into_iter().find(|log| log.begin.subject.get() == arguments.subject);
    let log = log.ok_or_else(|| {
        let (data, subject) = (arguments.data.display(), arguments.subject);
        CommandError::Usage(format!("{data}: there is no subject {subject}"))
    })?;
    log.annotate(&arguments.text).map_err(|error| CommandError::Failed(error.to_string()))
}

fn tell(dataset: &Dataset) -> Result<(), CommandError> {
    let logs = dataset.logs().map_err(|error| refused(error.into()))?;
    let complete = logs.iter().filter(|log| log.complete).count();
    let presentations: usize = logs.iter().map(|log| log.trials.len()).sum();
    let root = dataset.root().display();
    say!("{}", style::title(&format!("{complete} of {} subjects complete", logs.len())));
    say!("  {presentations} presentations in {root}");
    if complete < logs.len() {
        say!("  go on with --resume");
    } else {
        say!("  flotor analyse {root}");
    }
    Ok(())
}

fn refused(error: CohortError) -> CommandError {
    match error {
        CohortError::Dataset(error @ DatasetError::File { .. }) => CommandError::Failed(error.to_string()),
        CohortError::Dataset(error) => CommandError::Usage(error.to_string()),
        sitting => CommandError::Failed(sitting.to_string()),
    }
}
