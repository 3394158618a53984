//! `flotor study`: perception experiments.

mod bias;
mod check;
mod choices;
mod curve;
mod design_file;
mod designed;
mod explore;
mod front;
mod noise;
mod note;
mod options_table;
mod person;
pub(crate) mod plan;
mod power;
mod shipped;
mod space;
mod spring;

use choices::{
    BoundaryChoice, FirstChoice, ForceWay, NoiseOption, PresentationOption, ProcedureChoice, population,
    range, thresholds,
};
use clap::{Args, Subcommand, ValueEnum};
use flotor_command::options::{PluginKeyValue, SceneOptions, count, duration_s, real, seed};
use flotor_command::say;
use flotor_command::stopping::stop_on_signals;
use flotor_command::{CommandError, command_line, progress_bar, style};
use flotor_servo::RunEnd;
use flotor_session::scene::Scene;
use flotor_session::{RunError, stop_waits_with};
use flotor_study::apparatus::rig::{Rig, RunEnded, TrialFiles};
use flotor_study::apparatus::{Apparatus, ApparatusError, Kinematics};
use flotor_study::cohort::{Cohort, CohortError};
use flotor_study::conduct::{ApparatusOrFrontEndError, ConductError, NoApparatus, Presenter};
use flotor_study::dataset::{Dataset, ExistingLogPolicy};
use flotor_study::log::{Person, Plan};
use flotor_study::observer::Population;
use flotor_study::procedure::{Averaging, Procedure, QuestPlusRule, StepAtReversal, WeightedUpDownRule};
use flotor_study::protocol::{
    Checks, ComparisonSide, JndDemo, JndProtocol, MagnitudeProtocol, ObviousPairs, PresentationOrder,
    Protocol, Stimulus, SubjectNumber,
};
use flotor_study::screen::StopKey;
use serde_json::json;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Once;

/// Run a perception experiment
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    flotor study jnd --out data\n  \
    flotor analyse data\n  \
    flotor study magnitude --subjects 8 --seed 3 --out ratings\n  \
    flotor study jnd --bases 20,40 --target 0.8 --side random --out other\n  \
    flotor study jnd --out data --resume\n  \
    flotor study jnd --observer human --subject 3 --scene maglev.toml --out people\n  \
    flotor study jnd --observer human --subject 3 --out people --resume\n  \
    flotor study magnitude --stimulus spring.gamma_n --range 10-40 --out d\n  \
    flotor study bias --runs 1000")]
pub(crate) struct StudyArguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Just noticeable difference: pairs, with an adaptive procedure
    Jnd(JndArguments),
    /// Magnitude estimation: single stimuli, free numbers
    Magnitude(MagnitudeArguments),
    /// Just noticeable difference of a force, felt or exerted
    Force(ForceArguments),
    /// Run a study file: begin, or resume an interrupted study
    Run(plan::RunArguments),
    /// Preview a study file without a person: schedule, balance, length, power
    Check(check::CheckArguments),
    /// Explore a spring by hand while its dimensions and material change, without trials
    Explore(explore::ExploreArguments),
    /// Fit a spring model to the measured curve of a real spring
    Spring(spring::SpringArguments),
    /// Add a note of the experimenter to a subject's log
    Note(note::NoteArguments),
    /// Sample size of a difference experiment, by simulated studies
    Power(power::PowerArguments),
    /// Bias and error of each threshold estimator, on observers with a known threshold
    Bias(bias::BiasArguments),
}

/// Values of `--observer`.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum ObserverOption {
    /// A simulated observer of signal detection with known thresholds and a simulated hand, in virtual time
    #[default]
    Simulated,
    /// A person at the device, in real time
    Human,
}

/// Upper limit of `--jobs`.
const MOST_JOBS: NonZeroUsize = NonZeroUsize::MIN.saturating_add(1023);

/// Options common to all experiments.
#[derive(Args)]
struct Common {
    /// Kind of observer
    #[arg(long, value_enum, default_value_t)]
    observer: ObserverOption,
    /// Number of simulated subjects, who are numbered from 1; in a study file also the planned number of people
    #[arg(long, default_value_t = 16, value_parser = count(1..=SubjectNumber::MOST), value_name = "N")]
    subjects: u16,
    /// Simulated subjects in parallel (default: one per core)
    #[arg(long, value_parser = count(NonZeroUsize::MIN..=MOST_JOBS), value_name = "N")]
    jobs: Option<NonZeroUsize>,
    /// Seed of orders, presentations and simulated answers
    #[arg(long, value_parser = seed, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Folder for the data
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of the person (human; default: the first free number)
    #[arg(long, value_parser = count(1..=SubjectNumber::MOST), value_name = "N")]
    subject: Option<u16>,
    /// Scene of the stimuli: a scene file (TOML), or the name of one of Flotor's own scenes (default: the model of the stimuli on
    /// the simulated flotor)
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Set a parameter of a plugin of the scene (repeatable)
    #[arg(long = "set", value_name = "PLUGIN.KEY=VALUE")]
    sets: Vec<PluginKeyValue>,
    /// Apparatus of simulated observers; with none, --feel and --kinematics have no effect
    #[arg(long, value_enum, default_value_t)]
    apparatus: PresentationOption,
    /// Time for which a simulated observer feels each stimulus
    #[arg(long, default_value = "1s", value_parser = feel_s, allow_hyphen_values = true, value_name = "TIME")]
    feel: f64,
    /// Thresholds of simulated observers at 75 %, with vision and without, as shares of the base; no effect on ratings (default:
    /// 11.1 and 13.6 %, which the procedure of the thesis estimates as 14.2 and 17.2 %; for a force 5.9 % felt and 7 % exerted; for
    /// other stimuli required)
    #[arg(long, value_parser = thresholds, value_name = "VH,H")]
    weber: Option<[f64; 2]>,
    /// Stored movement (default: full for people, summary for simulated observers)
    #[arg(long, value_enum)]
    kinematics: Option<Kinematics>,
    /// Trials between two rests, 0: no rests (human)
    #[arg(long, default_value_t = 40, value_parser = count(0..=100_000_u32), value_name = "N")]
    rest_every: u32,
    /// Screen for questions and answers (human)
    #[arg(long, value_enum, default_value_t)]
    screen: front::ScreenOption,
    /// Consent text shown to the person before the first trial (human); its first line is a title
    #[arg(long, value_name = "FILE")]
    consent: Option<PathBuf>,
    /// Text with instructions, in the language of the person, before each sitting (human); its first line is a title
    #[arg(long, value_name = "FILE")]
    instructions: Option<PathBuf>,
    /// Age of the person, for participants.tsv (human)
    #[arg(long, value_parser = count(1..=130_u16), value_name = "YEARS")]
    age: Option<u16>,
    /// Sex of the person, one word, for participants.tsv (human)
    #[arg(long, value_name = "WORD", value_parser = word)]
    sex: Option<String>,
    /// Preferred hand of the person, for participants.tsv (human)
    #[arg(long, value_parser = ["left", "right", "ambidextrous"], value_name = "HAND")]
    handedness: Option<String>,
    /// Key of the emergency stop in the viewer's window (human)
    #[arg(long, value_enum, default_value_t, value_name = "KEY")]
    stop_key: StopKey,
    /// File (TOML) with the texts of the screens in the viewer's window, in the language of the person: a translated copy of
    /// viewer/texts/english.toml, with all its keys (human; default: English)
    #[arg(long, value_name = "FILE")]
    texts: Option<PathBuf>,
    /// Minimum time for which each stimulus must be felt (human)
    #[arg(long, default_value = "0.5s", value_parser = duration_s, allow_hyphen_values = true, value_name = "TIME")]
    least_time: f64,
    /// Minimum path length of the handle while a stimulus is felt, up and down together, mm (human)
    #[arg(long, default_value_t = 2.0, value_parser = real, allow_hyphen_values = true, value_name = "MM")]
    least_movement_mm: f64,
    /// Maximum number of times a person may feel a trial again (human; default: no limit)
    #[arg(long, value_parser = count(0..=1000_u32), value_name = "N")]
    feel_again: Option<u32>,
    /// White noise on headphones (human)
    #[arg(long, value_enum, default_value_t)]
    noise: NoiseOption,
    /// Resume incomplete subjects, skip complete simulated ones (default: refuse subjects that have data)
    #[arg(long)]
    resume: bool,
    /// Varied parameter of a model (default: spring.gamma_n; in `study force`: load.force_n)
    #[arg(long, value_name = "MODEL.PARAMETER")]
    stimulus: Option<String>,
    /// Modality that comes first: vision and haptics (vh), haptics alone (h), or by the number of the subject
    #[arg(long, value_enum, default_value_t, value_name = "MODALITY")]
    first: FirstChoice,
    /// Action when the handle leaves its range: repeat the trial (at most three times) or keep its answer
    #[arg(long, value_enum, default_value_t)]
    boundary: BoundaryChoice,
    /// Study file in use.
    #[arg(skip)]
    plan: Option<Plan>,
    #[command(flatten)]
    options: SceneOptions,
}

#[derive(Args)]
struct JndArguments {
    #[command(flatten)]
    common: Common,
    /// Bases, in the unit of the stimulus; each pair is a base and a comparison that differs from it (default: 17,26,35;
    /// in `study force`: 3,6,9)
    #[arg(long, value_delimiter = ',', value_parser = real, allow_hyphen_values = true, value_name = "LIST")]
    bases: Option<Vec<f64>>,
    /// Number of replications, in alternating modality
    #[arg(long, default_value_t = 4, value_parser = count(1..=1000_u32), value_name = "N")]
    replications: u32,
    /// Adaptive procedure, which selects the next difference
    #[arg(long, value_enum, default_value_t)]
    procedure: ProcedureChoice,
    /// QUEST+: number of trials per track
    #[arg(long, default_value_t = 18, value_parser = count(1..=1000_u32), value_name = "N")]
    trials: u32,
    /// Weighted up-down: first difference, as a share of the base
    #[arg(long, default_value_t = 0.40, value_parser = real, value_name = "SHARE")]
    initial: f64,
    /// Weighted up-down: first step down, as a share of the base
    #[arg(long, default_value_t = 0.10, value_parser = real, value_name = "SHARE")]
    step: f64,
    /// Target share of correct answers, above 0.5 and below 1; "I don't know" counts half
    #[arg(long, default_value_t = 0.75, value_parser = real, value_name = "SHARE")]
    target: f64,
    /// Weighted up-down: numbers of the reversals that halve the step
    #[arg(long, value_delimiter = ',', default_value = "2,4", value_parser = count(1..=200_u32), value_name = "LIST")]
    halve_at: Vec<u32>,
    /// Weighted up-down: number of reversals after which a track ends
    #[arg(long, default_value_t = 8, value_parser = count(1..=200_u32), value_name = "N")]
    stop_after: u32,
    /// Weighted up-down: number of the first reversal whose difference counts for the threshold
    #[arg(long, default_value_t = 4, value_parser = count(1..=1000_u32), value_name = "N")]
    average_from: u32,
    /// Weighted up-down: trials in the mean for the threshold, from the first counted reversal to the last: with both
    /// reversals, without the first, or without the last
    #[arg(long, value_enum, default_value_t)]
    averaging: Averaging,
    /// Weighted up-down: step size used at a reversal that halves the step size
    #[arg(long, value_enum, default_value_t)]
    step_at_reversal: StepAtReversal,
    /// Weighted up-down: smallest difference, as a share of the base; above 0, because equal stimuli have no correct
    /// answer
    #[arg(long, default_value_t = 0.01, value_parser = real, value_name = "SHARE")]
    floor: f64,
    /// Weighted up-down: largest difference, as a share of the base
    #[arg(long, default_value_t = 0.95, value_parser = real, value_name = "SHARE")]
    ceiling: f64,
    /// Side of the base on which the comparison lies
    #[arg(long, value_enum, default_value_t)]
    side: ComparisonSide,
    /// Order of presentation within a pair
    #[arg(long, value_enum, default_value_t)]
    order: PresentationOrder,
    /// Catch trials in each track: pairs without any difference, which do not count
    #[arg(long, default_value_t = 0, value_parser = count(0..=20_u32), value_name = "N")]
    catch_trials: u32,
    /// Pairs presented once more in each track to check the consistency of answers; they do not count
    #[arg(long, default_value_t = 0, value_parser = count(0..=20_u32), value_name = "N")]
    repeat_checks: u32,
    /// Obvious pairs in each track to check attention; they do not count
    #[arg(long, default_value_t = 0, value_parser = count(0..=20_u32), value_name = "N")]
    obvious_pairs: u32,
    /// Difference of the obvious pairs, as a share of the base: 0.4 to the largest difference of a track; no effect without
    /// --obvious-pairs
    #[arg(long, default_value_t = 0.6, value_parser = real, value_name = "SHARE")]
    obvious_difference: f64,
    /// Omit the practice pairs
    #[arg(long)]
    no_demo: bool,
}

#[derive(Args)]
struct MagnitudeArguments {
    #[command(flatten)]
    common: Common,
    /// Smallest and largest stimulus, in the unit of the stimulus
    #[arg(long, default_value = "12-48", value_parser = range, value_name = "LEAST-MOST")]
    range: (f64, f64),
    /// Number of equidistant stimuli
    #[arg(long, default_value_t = 12, value_parser = count(3..=1000_u32), value_name = "N")]
    stimuli: u32,
    /// Number of replications in each modality
    #[arg(long, default_value_t = 3, value_parser = count(1..=1000_u32), value_name = "N")]
    replications: u32,
    /// Stimuli presented once more in each replication to check the consistency of ratings; they do not count
    #[arg(long, default_value_t = 0, value_parser = count(0..=20_u32), value_name = "N")]
    repeat_checks: u32,
    /// Number of stimuli presented as practice before each modality (the smallest, the largest and random others), at most all
    /// of --stimuli; 0: no practice
    #[arg(long, default_value_t = 5, value_parser = count(0..=1000_u32), value_name = "N")]
    demo: u32,
}

#[derive(Args)]
#[command(
    after_help = "Felt: a weight that always pulls down. Exerted: a resistance that acts only while the hand pushes.\n\n\
    Examples:\n  \
    flotor study force --way felt --out felt\n  \
    flotor study force --way exerted --out exerted\n  \
    flotor study force --observer human --way exerted --out people"
)]
struct ForceArguments {
    /// Kind of force: felt or exerted
    #[arg(long, value_enum, default_value_t)]
    way: ForceWay,
    #[command(flatten)]
    jnd: JndArguments,
}

/// Default stimulus and bases of a difference experiment.
struct Subject {
    stimulus: &'static str,
    bases: [f64; 3],
}

/// Springs, with the bases of the thesis, N.
const STIFFNESS: Subject = Subject { stimulus: "spring.gamma_n", bases: [17.0, 26.0, 35.0] };
/// Forces, with three evenly spaced bases, N, within the range of the forces felt with the springs.
const FORCE: Subject = Subject { stimulus: "load.force_n", bases: [3.0, 6.0, 9.0] };

pub(crate) fn run(arguments: &StudyArguments) -> Result<(), CommandError> {
    match &arguments.task {
        Task::Run(arguments) => plan::run(arguments),
        Task::Check(arguments) => check::run(arguments),
        Task::Note(arguments) => note::run(arguments),
        Task::Power(arguments) => power::run(arguments),
        Task::Bias(arguments) => bias::run(arguments),
        Task::Explore(arguments) => explore::run(arguments),
        Task::Spring(arguments) => spring::run(arguments),
        Task::Jnd(arguments) => {
            carry_out(&arguments.common, Protocol::Jnd(arguments.protocol(&STIFFNESS)?), None)
        }
        Task::Force(arguments) => {
            let protocol = Protocol::Jnd(arguments.jnd.protocol(&FORCE)?);
            carry_out(&arguments.jnd.common, protocol, Some(arguments.way))
        }
        Task::Magnitude(arguments) => {
            carry_out(&arguments.common, Protocol::Magnitude(arguments.protocol()?), None)
        }
    }
}

/// Parses one word for a table: 1 to 20 letters or digits.
fn word(text: &str) -> Result<String, String> {
    let is_word = !text.is_empty() && text.chars().count() <= 20 && text.chars().all(char::is_alphanumeric);
    if is_word { Ok(text.to_owned()) } else { Err("write one word, 1 to 20 letters or digits".to_owned()) }
}

/// Parses a duration above 0; returns seconds.
fn feel_s(text: &str) -> Result<f64, String> {
    duration_s(text).and_then(|s| if s > 0.0 { Ok(s) } else { Err("must be above 0 s".to_owned()) })
}

impl Common {
    /// Returns the data on the person; `None` if none were given.
    fn person(&self) -> Option<Person> {
        let Self { age, sex, handedness, .. } = self;
        let person = Person { age: *age, sex: sex.clone(), handedness: handedness.clone() };
        (person != Person::default()).then_some(person)
    }

    fn existing_log(&self) -> ExistingLogPolicy {
        if self.resume { ExistingLogPolicy::Resume } else { ExistingLogPolicy::Refuse }
    }

    fn stimulus(&self, usual: &Subject) -> Result<Stimulus, CommandError> {
        let text = self.stimulus.as_deref().unwrap_or(usual.stimulus);
        let (model, parameter) = text.split_once('.').ok_or_else(|| {
            CommandError::Usage(format!("--stimulus {text}: write MODEL.PARAMETER, like spring.gamma_n"))
        })?;
        Ok(Stimulus { model: model.to_owned(), parameter: parameter.to_owned() })
    }

    /// Loads the scene, or the built-in one, and applies the command-line settings and the settings of the kind of force.
    fn scene(&self, stimulus: &Stimulus, way: Option<ForceWay>) -> Result<Scene, CommandError> {
        let (scene, hand) = match &self.scene {
            Some(path) => (Scene::load(path), None),
            None => (Scene::study(&stimulus.model), way.map(ForceWay::hand)),
        };
        let mut scene = scene.map_err(RunError::Scene)?;
        self.options.apply(&mut scene);
        set(&mut scene, hand.unwrap_or_default())?;
        self.sets.iter().try_for_each(|set| set.apply(&mut scene)).map_err(CommandError::Usage)?;
        set(&mut scene, way.map(ForceWay::load).unwrap_or_default())?;
        Ok(scene)
    }
}

impl JndArguments {
    fn protocol(&self, usual: &Subject) -> Result<JndProtocol, CommandError> {
        let rule = WeightedUpDownRule {
            initial_delta: self.initial,
            first_step: self.step,
            target: self.target,
            halve_at: self.halve_at.clone(),
            stop_after: self.stop_after,
            average_from: self.average_from,
            averaging: self.averaging,
            step_at_reversal: self.step_at_reversal,
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
            stimulus: self.common.stimulus(usual)?,
            bases: self.bases.clone().unwrap_or_else(|| usual.bases.to_vec()),
            replications: self.replications,
            first_modality: self.common.first.into(),
            procedure,
            side: self.side,
            order: self.order,
            at_boundary: self.common.boundary.into(),
            demo: JndDemo { shown: !self.no_demo, ..JndDemo::default() },
            checks: Checks {
                catch: self.catch_trials,
                repeats: self.repeat_checks,
                obvious: (self.obvious_pairs > 0)
                    .then_some(ObviousPairs { count: self.obvious_pairs, delta: self.obvious_difference }),
            },
        })
    }
}

impl MagnitudeArguments {
    fn protocol(&self) -> Result<MagnitudeProtocol, CommandError> {
        let (least, most) = self.range;
        Ok(MagnitudeProtocol {
            stimulus: self.common.stimulus(&STIFFNESS)?,
            values: MagnitudeProtocol::evenly(least, most, self.stimuli),
            replications: self.replications,
            first_modality: self.common.first.into(),
            demo: self.demo,
            repeat_checks: self.repeat_checks,
            at_boundary: self.common.boundary.into(),
        })
    }
}

/// Applies settings in command-line syntax to a scene.
fn set(scene: &mut Scene, texts: &[&str]) -> Result<(), CommandError> {
    let apply = |text: &&str| text.parse::<PluginKeyValue>()?.apply(scene);
    texts.iter().try_for_each(apply).map_err(CommandError::Usage)
}

/// Checks the configuration and runs the study; `way` is the kind of force in a force experiment.
fn carry_out(common: &Common, protocol: Protocol, way: Option<ForceWay>) -> Result<(), CommandError> {
    protocol.check().map_err(|error| CommandError::Usage(error.to_string()))?;
    if let Some(plan) = &common.plan {
        plan.exclusion
            .check(&protocol)
            .map_err(|error| CommandError::Usage(format!("{}: {error}", plan.file)))?;
    }
    let scene = common.scene(protocol.stimulus(), way)?;
    let strength = common.options.strength();
    let apparatus = Apparatus::check_with(scene, &protocol, strength).map_err(unfit)?;
    apparatus.notices().iter().for_each(flotor_command::note);
    match (common.observer, common.apparatus) {
        (ObserverOption::Human, _) => person::sit(common, &protocol, &apparatus),
        (ObserverOption::Simulated, PresentationOption::Scene) => {
            apparatus.check_hand().map_err(unfit)?;
            simulate(common, protocol, way, Some(&apparatus))
        }
        (ObserverOption::Simulated, PresentationOption::None) => simulate(common, protocol, way, None),
    }
}

/// Returns the population of the simulated subjects: with the thresholds of `--weber`, else for the judged quality. For ratings
/// the default population, because ratings need no Weber fraction.
fn people(common: &Common, protocol: &Protocol, way: Option<ForceWay>) -> Result<Population, CommandError> {
    match (common.weber, protocol) {
        (Some(thresholds), _) => Ok(Population::with_thresholds(thresholds)),
        (None, Protocol::Magnitude(_)) => Ok(Population::default()),
        (None, Protocol::Jnd(jnd)) => population(&jnd.stimulus, way).map_err(CommandError::Usage),
    }
}

/// Runs all simulated subjects, several in parallel, and prints the result. `apparatus` is `None` for answers computed from the
/// stimulus values.
fn simulate(
    common: &Common,
    protocol: Protocol,
    way: Option<ForceWay>,
    apparatus: Option<&Apparatus>,
) -> Result<(), CommandError> {
    let cohort = Cohort {
        seed: common.seed,
        subjects: (1..=common.subjects).filter_map(SubjectNumber::new).collect(),
        population: people(common, &protocol, way)?,
        apparatus: apparatus.map_or(
            json!(null),
            |apparatus| json!({ "feel_s": common.feel, "scene": apparatus.description() }),
        ),
        inputs: apparatus.map_or_else(|| Ok(Vec::new()), Apparatus::input_files).map_err(unfit)?,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        plan: common.plan.clone(),
        existing_log: common.existing_log(),
        protocol,
    };
    let about = u64::from(common.subjects) * cohort.protocol.presentations_about();
    let progress = progress_bar(about, "{wide_bar} {pos} of about {len} presentations  {elapsed}");
    let stop = stop_on_signals()?;
    stop_waits_with(&stop);
    let jobs = common.jobs.or_else(|| std::thread::available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN);
    let dataset = Dataset::at(&common.out);
    let kinematics = common.kinematics.unwrap_or(Kinematics::Summary);
    let task = cohort.protocol.task();
    let presenter =
        |subject: SubjectNumber| -> Result<Option<Box<dyn Presenter + '_>>, ApparatusOrFrontEndError> {
            let Some(apparatus) = apparatus else { return Ok(Some(Box::new(NoApparatus))) };
            let folder = dataset.source_folder(subject).join("motion");
            let files = (kinematics == Kinematics::Full)
                .then(|| TrialFiles::make(folder, format!("{subject}_task-{task}")))
                .transpose()?;
            let person = (common.seed, subject);
            match Rig::start(apparatus, person, kinematics, files, common.feel, &stop) {
                Err(error) if error.is_stopped() => Ok(None),
                started => Ok(Some(Box::new(started?))),
            }
        };
    let first = Once::new();
    let watch = || {
        progress.inc(1);
        // Without a terminal there is no progress bar: print one note instead.
        first.call_once(|| {
            if progress.is_hidden() {
                let root = dataset.root().display();
                flotor_command::note(format_args!("simulating about {about} presentations into {root}"));
            }
        });
    };
    let result = cohort.run(&dataset, jobs, &presenter, &watch, &stop.stop_flag());
    progress.finish_and_clear();
    result.map_err(refused)?;
    tell(&dataset)
}

/// Converts an apparatus error: an error of the run keeps its exit code, any other is a usage error.
fn unfit(error: ApparatusError) -> CommandError {
    match error {
        ApparatusError::Run(error) => error.into(),
        other => CommandError::Usage(other.to_string()),
    }
}

fn tell(dataset: &Dataset) -> Result<(), CommandError> {
    let logs = dataset.logs().map_err(crate::of_dataset)?;
    let complete = logs.iter().filter(|log| log.complete).count();
    let presentations: usize = logs.iter().map(|log| log.trials.len()).sum();
    let root = dataset.root().display();
    say!("{}", style::title(&format!("{complete} of {} subjects complete", logs.len())));
    say!("  {presentations} presentations in {root}");
    if complete < logs.len() {
        say!("  continue with --resume");
    } else {
        say!("  {}", command_line(["analyse", root.to_string().as_str()]));
    }
    Ok(())
}

fn refused(error: CohortError) -> CommandError {
    let message = error.to_string();
    match error {
        CohortError::Dataset(error) => crate::of_dataset(error),
        CohortError::Sitting {
            cause: ConductError::Outside(cause) | ConductError::Trial { cause, .. },
            ..
        } => outside(cause, message),
        _ => CommandError::Failed(message),
    }
}

/// Converts an apparatus error to a command error with the exit code of its cause. If a fault, an emergency stop, the watchdog
/// or an oscillation ended the run, first prints `message`, which has subject and trial, as a note.
fn outside(cause: ApparatusOrFrontEndError, message: String) -> CommandError {
    if let Some(RunEnded(
        end @ (RunEnd::DeviceFault(_)
        | RunEnd::EmergencyStop(_)
        | RunEnd::Watchdog(_)
        | RunEnd::Oscillation
        | RunEnd::Unguarded),
    )) = cause.downcast_ref()
    {
        flotor_command::note(message);
        return CommandError::RunEnded(*end);
    }
    cause.downcast().map_or(CommandError::Failed(message), |error| CommandError::Run(*error))
}
