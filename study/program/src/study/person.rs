//! `--observer human`: one sitting of one person, in real time.

use super::front::{JsonLines, ScreenOption, Terminal, Window, lines_of};
use super::noise::WhiteNoise;
use super::space::{self, Need};
use super::{Common, NoiseOption};
use crate::of_dataset;
use flotor_command::say;
use flotor_command::stopping::stop_run_on_signals;
use flotor_command::{CommandError, note};
use flotor_hal::read_text;
use flotor_session::stop_waits_with;
use flotor_study::apparatus::attend::{FrontEnd, MinimumExploration, attend};
use flotor_study::apparatus::real_time_rig::RealTimeRig;
use flotor_study::apparatus::rig::TrialFiles;
use flotor_study::apparatus::{Apparatus, Kinematics};
use flotor_study::conduct::{ApparatusOrFrontEndError, Ending};
use flotor_study::dataset::{Dataset, DatasetError, Progress};
use flotor_study::log::{Begin, Event, FORMAT, digest};
use flotor_study::protocol::{Protocol, SubjectNumber};
use flotor_study::screen::ScreenStateMachine;
use serde_json::json;
use std::io::{BufReader, Stdout, stdin, stdout};
use std::path::Path;

/// Runs the sitting of a person and writes the tables. Checks the configuration, starts the run and opens the front end before
/// it begins or resumes the log.
pub(super) fn sit(common: &Common, protocol: &Protocol, apparatus: &Apparatus) -> Result<(), CommandError> {
    let dataset = Dataset::at(&common.out);
    let begin = begin(common, &dataset, protocol, apparatus)?;
    let subject = begin.subject;
    let earlier = match dataset.progress(&begin, common.existing_log()).map_err(of_dataset)? {
        Progress::New => None,
        Progress::Partial(log) => Some(log),
        Progress::Complete => {
            return Err(of_dataset(DatasetError::Duplicate { subject, root: common.out.clone() }));
        }
    };
    let presented = earlier.as_ref().map_or(0, |log| log.trials.len());
    let is_answered_anew = earlier.as_ref().is_some_and(|log| log.is_answered_anew());
    let texts = texts(common, presented)?;
    let screen_texts = screen_texts(common)?;
    let kinematics = common.kinematics.unwrap_or(Kinematics::Full);
    let bytes_per_s = if kinematics == Kinematics::Full { apparatus.recording_bytes_per_s() } else { 0.0 };
    // Tracks may need more trials than expected: assume at least one.
    let trials = protocol.presentations_about().saturating_sub(presented as u64).max(1) as f64;
    space::check(&common.out, Need { stimuli: trials * protocol.stimuli_in_a_trial(), bytes_per_s })?;
    let stop = stop_run_on_signals()?;
    stop_waits_with(&stop);
    let noise = noise(common)?;
    let mut rig = RealTimeRig::start(apparatus, kinematics, &stop).map_err(outside)?;
    rig.warnings().iter().for_each(note);
    let mut front = Front::open(common, &rig)?;

    let (sitting, mut log) = match earlier {
        None => dataset.begin(begin).map_err(of_dataset)?,
        Some(log) => log.resume(&begin.version).map_err(|error| of_dataset(error.into()))?,
    };
    if kinematics == Kinematics::Full {
        let folder = dataset.source_folder(subject).join("motion");
        let files = TrialFiles::make(folder, format!("{subject}_task-{}", protocol.task()));
        rig.record_into(files.map_err(of_dataset)?);
    }
    let conditions = conditions(common, noise.as_ref(), screen_texts.as_deref()).into_iter();
    let noted = conditions.map(|text| Event::Note { text }).try_for_each(|note| log.write(&note));
    noted.map_err(|error| CommandError::Failed(error.to_string()))?;
    let mut attended = ScreenStateMachine::new(sitting, protocol, common.rest_every).after_reading(texts);
    if presented > 0 {
        attended = attended.with_practice_offered();
    }
    if is_answered_anew {
        attended = attended.with_answer_taken_back();
    }
    if let Some(times) = common.feel_again {
        attended = attended.with_again_at_most(times);
    }
    let ending = attend(&mut attended, &mut log, &mut rig, front.as_dyn(), least_exploration(common));
    // Write the tables from the log, however the sitting ended.
    let tables = dataset.write_tables();
    let ended = ending.and_then(|ending| rig.finish_after(ending)).map_err(|error| {
        note(broken_off(subject, &attended));
        outside(error)
    });
    let ending = ended?;
    tables.map_err(of_dataset)?;
    if let (Ending::Complete, Front::Window(window)) = (ending, front) {
        window.wait_closed(&stop); // the last screen thanks the person
    }
    drop((rig, noise));
    match (ending, common.screen) {
        (_, ScreenOption::Json) => Ok(()),
        (Ending::Complete, _) => super::tell(&dataset),
        (Ending::Stopped, _) => {
            say!("  {}", broken_off(subject, &attended));
            Ok(())
        }
    }
}

/// Returns the data for the first line of the sitting's log.
fn begin(
    common: &Common,
    dataset: &Dataset,
    protocol: &Protocol,
    apparatus: &Apparatus,
) -> Result<Begin, CommandError> {
    let inputs = [apparatus.input_files(), apparatus.plugin_files()];
    Ok(Begin {
        format: FORMAT,
        subject: subject(common, dataset, protocol)?,
        person: common.person(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: common.seed,
        plan: common.plan.clone(),
        protocol: protocol.clone(),
        observer: json!("human"),
        apparatus: apparatus.description(),
        inputs: inputs.into_iter().collect::<Result<Vec<_>, _>>().map_err(super::unfit)?.concat(),
    })
}

/// Returns the texts that the person reads first: the consent text before the first trial only, instructions also when the
/// sitting resumes.
pub(super) fn texts(common: &Common, presented: usize) -> Result<Vec<String>, CommandError> {
    let consent = common.consent.iter().filter(|_| presented == 0);
    let remedy = "write a title in its first line, and then the text";
    consent.chain(&common.instructions).map(|path| text_of(path, remedy)).collect()
}

/// Returns the content of the file with the texts of the window's screens; `None` without a file.
pub(super) fn screen_texts(common: &Common) -> Result<Option<String>, CommandError> {
    let remedy = "start from a copy of `viewer/texts/english.toml`, or omit --texts";
    let texts = common.texts.as_deref().map(|path| text_of(path, remedy)).transpose()?;
    if texts.is_some() && common.screen != ScreenOption::Viewer {
        let why = "--texts is for the viewer's window; omit --texts or --screen";
        return Err(CommandError::Usage(why.to_owned()));
    }
    Ok(texts)
}

pub(super) fn least_exploration(common: &Common) -> MinimumExploration {
    MinimumExploration { time_s: common.least_time, path_length_m: common.least_movement_mm * 1.0e-3 }
}

/// Describes the conditions of the sitting for its log: noise, texts, minimum exploration, repetitions.
pub(super) fn conditions(
    common: &Common,
    noise: Option<&WhiteNoise>,
    screen_texts: Option<&str>,
) -> Vec<String> {
    let notes = [
        Some(format!("white noise: {}", noise.map_or("none", |noise| noise.name))),
        screen_texts.map(|texts| format!("texts of the screens: SHA-256 {}", digest(texts))),
        Some(format!("least time {} s, least movement {} mm", common.least_time, common.least_movement_mm)),
        common.feel_again.map(|times| format!("at most {times} repetitions of a trial")),
    ];
    notes.into_iter().flatten().collect()
}

/// Reads a text file; an empty one is an error with this remedy.
fn text_of(path: &Path, remedy: &str) -> Result<String, CommandError> {
    let text =
        read_text(path, "the text").map_err(|wrong| CommandError::Usage(wrong.in_file(path.display())))?;
    let text = text.trim().to_owned();
    if text.is_empty() {
        return Err(CommandError::Usage(format!("{}: the file is empty; {remedy}", path.display())));
    }
    Ok(text)
}

/// Converts an apparatus error to a command error with the exit code of its cause.
pub(super) fn outside(cause: ApparatusOrFrontEndError) -> CommandError {
    let message = cause.to_string();
    super::outside(cause, message)
}

/// Describes the progress of an interrupted sitting, and the options that resume it.
fn broken_off(subject: SubjectNumber, attended: &ScreenStateMachine) -> String {
    let presented = attended.presented();
    format!(
        "{subject} stopped after {presented} presentations; continue with --subject {} --resume",
        subject.get()
    )
}

/// Front end for questions and answers.
enum Front {
    Window(Window),
    Terminal(Terminal),
    Json(JsonLines<Stdout>),
}

impl Front {
    fn open(common: &Common, rig: &RealTimeRig<'_>) -> Result<Self, CommandError> {
        match common.screen {
            ScreenOption::Viewer => match rig.viewer_error() {
                None => Ok(Self::Window(Window::open(common.stop_key, common.texts.as_deref())?)),
                Some(why) => Err(CommandError::Failed(format!(
                    "the viewer cannot show the session: {why}; use --screen terminal"
                ))),
            },
            ScreenOption::Terminal => Terminal::listen().map(Self::Terminal),
            ScreenOption::Json => {
                Ok(Self::Json(JsonLines::new(lines_of(BufReader::new(stdin()))?, stdout())))
            }
        }
    }

    fn as_dyn(&mut self) -> &mut dyn FrontEnd {
        match self {
            Self::Window(window) => &mut window.lines,
            Self::Terminal(terminal) => terminal,
            Self::Json(lines) => lines,
        }
    }
}

/// Returns the requested subject number, else the first one without a log.
fn subject(common: &Common, dataset: &Dataset, protocol: &Protocol) -> Result<SubjectNumber, CommandError> {
    let is_new = |number: &SubjectNumber| !dataset.log_path(*number, protocol.task()).exists();
    let named = common.subject.and_then(SubjectNumber::new);
    let free = || (1..=SubjectNumber::MOST).filter_map(SubjectNumber::new).find(is_new);
    named.or_else(free).ok_or_else(|| {
        let root = dataset.root().display();
        CommandError::Usage(format!("{root}: all subject numbers are taken; use another folder"))
    })
}

/// Starts the noise unless `--noise off`. If this machine cannot play it, returns an error for `--noise on`, else prints a note
/// and returns `None`.
pub(super) fn noise(common: &Common) -> Result<Option<WhiteNoise>, CommandError> {
    if common.noise == NoiseOption::Off {
        return Ok(None);
    }
    let noise = WhiteNoise::start();
    if noise.is_none() && common.noise == NoiseOption::On {
        return Err(CommandError::Usage(
            "--noise on: no sound player works here (tried pw-cat, paplay, aplay); play white noise on headphones by other \
             means and use --noise off"
                .to_owned(),
        ));
    }
    if noise.is_none() {
        note("no sound player works here: play white noise on headphones by other means");
    }
    Ok(noise)
}
