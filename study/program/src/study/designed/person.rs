//! One session of one person in a study of one's own design, in real time.

use super::ending::tell;
use super::scene;
use super::simulated::steps_of;
use crate::of_dataset;
use crate::study::Common;
use crate::study::design_file::DesignFile;
use crate::study::front::{ScreenOption, Terminal};
use crate::study::person::{conditions, least_exploration, noise, outside, screen_texts, texts};
use crate::study::space::{self, Need};
use flotor_command::stopping::stop_run_on_signals;
use flotor_command::{CommandError, note, say};
use flotor_session::stop_waits_with;
use flotor_study::apparatus::Kinematics;
use flotor_study::apparatus::designed_attend::attend;
use flotor_study::apparatus::designed_person_rig::DesignedPersonRig;
use flotor_study::apparatus::rig::TrialFiles;
use flotor_study::conduct::Ending;
use flotor_study::dataset::{DatasetError, ExistingLogPolicy};
use flotor_study::designed::{AttendedCourse, Begin, DesignedData, DesignedLog, Event, FORMAT, Progress};
use flotor_study::log::Plan;
use flotor_study_design::course::{Course, Session};
use flotor_study_design::design::Design;
use flotor_study_design::subject::SubjectNumber;
use serde_json::json;
use std::path::Path;

/// Runs the next session of a person and writes the tables. Checks the configuration, starts the run and opens the front end before it
/// begins or resumes the log.
pub(super) fn sit(file: &Path, common: &Common, study: &DesignFile, plan: Plan) -> Result<(), CommandError> {
    check_screen(file, common)?;
    let design = &study.design;
    let apparatus = scene::check(common, design)?;
    if let Some(setting) = apparatus.unfit_for_people(design) {
        return Err(CommandError::Usage(format!(
            "{}: {setting} is a setting of a device, which a person's sitting changes between blocks only; write its factor to \
             `blocks.by`, or vary it between subjects",
            file.display()
        )));
    }
    let unfit = |error: flotor_study::apparatus::UnreadableFile| CommandError::Usage(error.to_string());
    let inputs = [apparatus.input_files(), apparatus.plugin_files()];
    let inputs = inputs.into_iter().collect::<Result<Vec<_>, _>>().map_err(unfit)?.concat();
    let data = DesignedData::at(&common.out);
    let subject = subject(common, &data, design)?;
    let begin = |session: u32| Begin {
        designed: FORMAT,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        session: Session { seed: common.seed, subject, session },
        plan: plan.clone(),
        design: design.clone(),
        person: common.person(),
        observer: json!("human"),
        apparatus: json!({ "scene": apparatus.description() }),
        inputs: inputs.clone(),
    };
    let (begin, earlier) = next_session(common, &data, design, begin)?;
    let session = begin.session;
    let before = earlier.as_ref().map_or(0, |log| log.steps.len());
    let texts = texts(common, before)?;
    let screen_texts = screen_texts(common)?;
    let kinematics = common.kinematics.unwrap_or(Kinematics::Full);
    let bytes_per_s = if kinematics == Kinematics::Full { apparatus.recording_bytes_per_s() } else { 0.0 };
    // As many steps as with a simulated observer. An adaptive method may need more: assume at least one.
    let steps = steps_of(design, &study.population, session).saturating_sub(before as u64).max(1);
    let stimuli = steps as f64 * design.task().intervals() as f64;
    space::check(&common.out, Need { stimuli, bytes_per_s })?;
    let stop = stop_run_on_signals()?;
    stop_waits_with(&stop);
    let noise = noise(common)?;
    let course = earlier.as_ref().map_or_else(|| Course::new(design, session), |log| log.course().clone());
    let first = course.upcoming().and_then(|trial| course.settings(&trial).into_iter().next());
    let mut rig = DesignedPersonRig::start(&apparatus, &first.unwrap_or_default(), kinematics, &stop)
        .map_err(outside)?;
    rig.warnings().iter().for_each(note);
    let mut front = Terminal::listen()?;

    let (course, mut log) = match earlier {
        None => data.begin(begin).map_err(of_dataset)?,
        Some(log) => log.resume(&begin.version).map_err(|error| of_dataset(error.into()))?,
    };
    if kinematics == Kinematics::Full {
        let (folder, prefix) = data.motion(design, session);
        rig.record_into(TrialFiles::make(folder, prefix).map_err(of_dataset)?);
    }
    let conditions = conditions(common, noise.as_ref(), screen_texts.as_deref()).into_iter();
    let noted = conditions.map(|text| Event::Note { text }).try_for_each(|note| log.write(&note));
    noted.map_err(|error| CommandError::Failed(error.to_string()))?;
    let mut attended = AttendedCourse::new(course).after_reading(texts).with_again_at_most(common.feel_again);
    let before = u32::try_from(before).unwrap_or(u32::MAX);
    let ending = attend(&mut attended, (&mut log, before), &mut rig, &mut front, least_exploration(common));
    drop(log);
    // Write the tables from the log, however the session ended.
    let tables = data.write_tables();
    let ended = ending.and_then(|ending| rig.finish_after(ending)).map_err(|error| {
        note(broken_off(session, attended.course()));
        outside(error)
    });
    let ending = ended?;
    tables.map_err(of_dataset)?;
    drop((rig, noise));
    match ending {
        Ending::Complete => tell(&data),
        Ending::Stopped => {
            say!("  {}", broken_off(session, attended.course()));
            Ok(())
        }
    }
}

/// Checks that the screen of the options can show the questions of a design.
fn check_screen(file: &Path, common: &Common) -> Result<(), CommandError> {
    if common.screen == ScreenOption::Terminal {
        return Ok(());
    }
    Err(CommandError::Usage(format!(
        "{}: the screens of a design of one's own are on the terminal only, in this version; add --screen terminal",
        file.display()
    )))
}

/// Returns the requested subject number, else the first one without a log.
fn subject(common: &Common, data: &DesignedData, design: &Design) -> Result<SubjectNumber, CommandError> {
    let first = |subject| Session { seed: common.seed, subject, session: 1 };
    let is_new = |number: &SubjectNumber| !data.log_path(design, first(*number)).exists();
    let named = common.subject.and_then(SubjectNumber::new);
    let free = || (1..=SubjectNumber::MOST).filter_map(SubjectNumber::new).find(is_new);
    named.or_else(free).ok_or_else(|| {
        let root = data.root().display();
        CommandError::Usage(format!("{root}: all subject numbers are taken; use another folder"))
    })
}

/// Returns the first session of the subject that is not complete, with its log if it has one.
fn next_session(
    common: &Common,
    data: &DesignedData,
    design: &Design,
    begin: impl Fn(u32) -> Begin,
) -> Result<(Begin, Option<Box<DesignedLog>>), CommandError> {
    for session in 1..=design.blocks().sessions {
        let begin = begin(session);
        match data.progress(&begin, ExistingLogPolicy::Resume).map_err(of_dataset)? {
            Progress::Complete => {}
            Progress::New => return Ok((begin, None)),
            Progress::Partial(log) => return Ok((begin, Some(log))),
        }
    }
    let (subject, root) = (begin(1).session.subject, common.out.clone());
    Err(of_dataset(DatasetError::Duplicate { subject, root }))
}

/// Describes the progress of an interrupted session, and the options that resume it.
fn broken_off(session: Session, course: &Course) -> String {
    let (subject, presented) = (session.subject, course.presented());
    format!("{subject} stopped after {presented} presentations; continue with --subject {}", subject.get())
}
