//! `--observer human`: one person, one sitting, in real time.

use super::front::{LineFront, ScreenOption};
use super::{Common, NoiseOption, tell};
use crate::cli::stopping::stop_on_signals;
use crate::cli::{CommandError, style};
use crate::study::attend::attend;
use crate::study::live::LiveRig;
use crate::study::noise::WhiteNoise;
use crate::study::rig::TrialFiles;
use crate::study::{Apparatus, Kinematics};
use flotor_study::conduct::Ending;
use flotor_study::dataset::{Dataset, DatasetError, Progress};
use flotor_study::log::{Begin, Event, FORMAT, LogWriter};
use flotor_study::protocol::{Protocol, SubjectNumber};
use flotor_study::screen::Attended;
use flotor_study::sitting::Sitting;
use serde_json::json;

/// Presents a study to a person.
pub(super) fn sit(common: &Common, protocol: &Protocol, apparatus: &Apparatus) -> Result<(), CommandError> {
    let dataset = Dataset::at(&common.out);
    let subject = subject(common, &dataset, protocol)?;
    let begin = Begin {
        format: FORMAT,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        subject,
        seed: common.seed,
        protocol: protocol.clone(),
        observer: json!("human"),
        apparatus: apparatus.description(),
    };
    let (sitting, mut log) = open(common, &dataset, begin)?;
    let kinematics = common.kinematics().unwrap_or(Kinematics::Full);
    let files = TrialFiles::make(
        dataset.source_folder(subject).join("motion"),
        format!("{subject}_task-{}", protocol.task()),
    );
    let files = files.map_err(|cause| CommandError::file(&common.out, "cannot make the folder", cause))?;
    let stop = stop_on_signals();
    let noise = noise(common)?;
    let text = format!("white noise: {}", noise.as_ref().map_or("none", WhiteNoise::player));
    log.write(&Event::Note { text }).map_err(failed)?;

    let mut attended = Attended::new(sitting, protocol, common.seed, common.rest_every);
    let mut front = LineFront::listen(common.screen).map_err(failed)?;
    let mut rig = LiveRig::start(apparatus, kinematics, Some(files), &stop)
        .map_err(|error| super::outside(error.as_ref(), &error))?;
    let ending = attend(&mut attended, &mut log, &mut rig, &mut front, &mut |_| ());
    drop((rig, noise));
    let ending = ending.map_err(|error| super::outside(error.as_ref(), &error))?;
    dataset.write_tables().map_err(|error| super::refused(error.into()))?;
    match (ending, common.screen) {
        (_, ScreenOption::Json) => Ok(()),
        (Ending::Complete, _) => tell(&dataset),
        (Ending::Stopped, _) => {
            let presented = attended.presented();
            say!(
                "  {subject} stopped after {presented} presentations; go on with --subject {} --resume",
                subject.get()
            );
            Ok(())
        }
    }
}

fn failed(error: impl std::fmt::Display) -> CommandError {
    CommandError::Failed(error.to_string())
}

/// Who was named, or the first number that is free.
fn subject(common: &Common, dataset: &Dataset, protocol: &Protocol) -> Result<SubjectNumber, CommandError> {
    let is_new = |number: &SubjectNumber| !dataset.log_path(*number, protocol.task()).exists();
    let named = common.subject.and_then(SubjectNumber::new);
    let free = || (1..=SubjectNumber::MOST).filter_map(SubjectNumber::new).find(is_new);
    named.or_else(free).ok_or_else(|| {
        let root = dataset.root().display();
        CommandError::Usage(format!("{root}: all subject numbers are taken; use another folder"))
    })
}

/// A new sitting, or the one that broke off.
fn open(common: &Common, dataset: &Dataset, begin: Begin) -> Result<(Sitting, LogWriter), CommandError> {
    let (subject, root) = (begin.subject, dataset.root().to_path_buf());
    let progress = dataset.progress(subject, begin.protocol.task());
    let refuse = |error: DatasetError| super::refused(error.into());
    match progress.map_err(refuse)? {
        Progress::New => dataset.begin(begin).map_err(refuse),
        Progress::Complete(_) => Err(refuse(DatasetError::Duplicate { subject, root })),
        Progress::Partial(log) if !common.resume => {
            Err(refuse(DatasetError::Unfinished { subject, trials: log.trials.len(), root }))
        }
        Progress::Partial(log) => {
            if let Some(what) = begin.differs(&log.begin) {
                return Err(refuse(DatasetError::Changed { path: log.path().to_path_buf(), what }));
            }
            log.resume(&begin.version).map_err(|error| refuse(error.into()))
        }
    }
}

/// Noise if it was asked for; said plainly where there is none.
fn noise(common: &Common) -> Result<Option<WhiteNoise>, CommandError> {
    if common.noise == NoiseOption::Off {
        return Ok(None);
    }
    let noise = WhiteNoise::start();
    match (&noise, common.noise) {
        (None, NoiseOption::On) => Err(CommandError::Usage(
            "--noise on: no sound here (tried pw-cat, paplay, aplay); play white noise on headphones by other means \
             and say --noise off"
                .to_owned(),
        )),
        (None, _) => {
            eprintln!("{} no sound here: play white noise on headphones by other means", style::warning("note:"));
            Ok(noise)
        }
        _ => Ok(noise),
    }
}
