//! `flotor study run` for a study of one's own design.

use super::design_file::DesignFile;
use super::options_table::plan;
use super::{Common, ObserverOption, PresentationOption, outside};
use crate::of_dataset;
use flotor_command::stopping::stop_on_signals;
use flotor_command::{CommandError, command_line, progress_bar, say, style};
use flotor_session::stop_waits_with;
use flotor_study::apparatus::designed_rig::{DesignedApparatus, DesignedApparatusError, DesignedRig};
use flotor_study::apparatus::rig::TrialFiles;
use flotor_study::apparatus::{ApparatusError, Kinematics};
use flotor_study::conduct::{ApparatusOrFrontEndError, NoApparatus};
use flotor_study::designed::{DesignedCohort, DesignedData, DesignedError, DesignedPresenter};
use flotor_study::exclusion::ExclusionRules;
use flotor_study::protocol::{Stimulus, SubjectNumber};
use flotor_study_design::course::{Course, Handle, Session};
use flotor_study_design::design::Design;
use flotor_study_design::observer::{Population, SimulatedObserver};
use flotor_study_design::value::Setting;
use serde_json::json;
use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::Path;

/// Runs the study of a design: begins or resumes it, and skips complete sessions.
pub(super) fn run(
    file: &Path,
    text: String,
    study: DesignFile,
    further: Vec<OsString>,
) -> Result<(), CommandError> {
    let common = study.arguments(file, further)?.common;
    let apparatus = match (common.observer, common.apparatus) {
        (ObserverOption::Human, _) => {
            return Err(CommandError::Usage(format!(
                "{}: people can sit in the protocols jnd, magnitude and force only, in this version; omit --observer human to \
                 simulate the study",
                file.display()
            )));
        }
        (ObserverOption::Simulated, PresentationOption::None) => None,
        (ObserverOption::Simulated, PresentationOption::Scene) => {
            let apparatus = apparatus(&common, &study.design)?;
            apparatus.check_hand().map_err(|error| CommandError::Usage(error.to_string()))?;
            Some(apparatus)
        }
    };
    let inputs = match &apparatus {
        Some(apparatus) => apparatus.input_files().map_err(|error| CommandError::Usage(error.to_string()))?,
        None => Vec::new(),
    };
    let cohort = DesignedCohort {
        seed: common.seed,
        subjects: (1..=common.subjects).filter_map(SubjectNumber::new).collect(),
        apparatus: apparatus.as_ref().map_or(
            json!(null),
            |apparatus| json!({ "feel_s": common.feel, "scene": apparatus.description() }),
        ),
        inputs,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        plan: plan(file, text, ExclusionRules::default()),
        existing_log: common.existing_log(),
        design: study.design,
        population: study.population,
    };
    simulate(&common, &cohort, apparatus.as_ref())
}

/// Checks the design on the scene of the options: the named one, or the built-in one with the model of the stimulus.
fn apparatus(common: &Common, design: &Design) -> Result<DesignedApparatus, CommandError> {
    let settings = design.stimulus().map(flotor_study_design::stimulus::Stimulus::setting);
    let settings = settings.into_iter().chain(design.factors().iter().filter_map(|one| one.setting.as_ref()));
    let found = settings.into_iter().find_map(|setting| match setting {
        Setting::Scene { part, key } if part != "device" => {
            Some(Stimulus { model: part.clone(), parameter: key.clone() })
        }
        _ => None,
    });
    let scene = common.scene(&found.unwrap_or_default(), None)?;
    let strength = common.options.strength();
    let apparatus = DesignedApparatus::check(scene, design, strength).map_err(|error| match error {
        DesignedApparatusError::Scene(ApparatusError::Run(error)) => error.into(),
        other => CommandError::Usage(other.to_string()),
    })?;
    apparatus.notices().iter().for_each(flotor_command::note);
    Ok(apparatus)
}

/// Returns the number of steps of a session of a simulated subject.
fn steps_of(design: &Design, population: &Population, session: Session) -> u64 {
    let mut course = Course::new(design, session);
    let observer = SimulatedObserver::new(population, session);
    let mut steps = 0;
    while let Some(step) = course.next() {
        // The observer gives valid answers: an error would be one of the program, and ends the count.
        if course.answer(&observer.respond(design, &step), Handle::InRange).is_err() {
            break;
        }
        steps += 1;
    }
    steps
}

/// Runs all simulated subjects, several in parallel, and prints the result.
fn simulate(
    common: &Common,
    cohort: &DesignedCohort,
    apparatus: Option<&DesignedApparatus>,
) -> Result<(), CommandError> {
    let design = &cohort.design;
    let about: u64 = cohort
        .subjects
        .first()
        .map_or(0, |subject| {
            let session = Session { seed: cohort.seed, subject: *subject, session: 1 };
            steps_of(design, &cohort.population, session)
        })
        .saturating_mul(cohort.subjects.len() as u64 * u64::from(design.blocks().sessions));
    let progress = progress_bar(about, "{wide_bar} {pos} of about {len} steps  {elapsed}");
    let stop = stop_on_signals()?;
    stop_waits_with(&stop);
    let jobs = common.jobs.or_else(|| std::thread::available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN);
    let data = DesignedData::at(&common.out);
    let kinematics = common.kinematics.unwrap_or(Kinematics::Summary);
    let presenter =
        |session: Session| -> Result<Option<Box<dyn DesignedPresenter + '_>>, ApparatusOrFrontEndError> {
            let Some(apparatus) = apparatus else { return Ok(Some(Box::new(NoApparatus))) };
            let (folder, prefix) = data.motion(design, session);
            let files =
                (kinematics == Kinematics::Full).then(|| TrialFiles::make(folder, prefix)).transpose()?;
            let rig = DesignedRig::new(apparatus, session, kinematics, files, common.feel, &stop);
            Ok(Some(Box::new(rig)))
        };
    let result = cohort.run(&data, jobs, &presenter, &|| progress.inc(1), &stop.stop_flag());
    progress.finish_and_clear();
    result.map_err(refused)?;
    tell(&data)
}

fn refused(error: DesignedError) -> CommandError {
    let message = error.to_string();
    match error {
        DesignedError::Dataset(error) => of_dataset(error),
        DesignedError::Apparatus { cause, .. } => outside(cause, message),
        _ => CommandError::Failed(message),
    }
}

/// Prints the number of complete sessions, and the next command.
fn tell(data: &DesignedData) -> Result<(), CommandError> {
    let logs = data.logs().map_err(of_dataset)?;
    let complete = logs.iter().filter(|log| log.complete).count();
    let trials: u32 = logs.iter().map(|log| log.course().presented()).sum();
    let root = data.root().display();
    say!("{}", style::title(&format!("{complete} of {} sessions complete", logs.len())));
    say!("  {trials} presentations in {root}");
    if complete < logs.len() {
        say!("  run the command again to continue");
    } else {
        say!("  {}", command_line(["analyse", root.to_string().as_str()]));
    }
    Ok(())
}
