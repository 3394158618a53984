//! Simulated subjects of a study of one's own design.

use super::ending::tell;
use crate::of_dataset;
use crate::study::design_file::DesignFile;
use crate::study::{Common, outside};
use flotor_command::stopping::stop_on_signals;
use flotor_command::{CommandError, progress_bar};
use flotor_session::stop_waits_with;
use flotor_study::apparatus::Kinematics;
use flotor_study::apparatus::designed_rig::DesignedRig;
use flotor_study::apparatus::designed_setup::DesignedApparatus;
use flotor_study::apparatus::rig::TrialFiles;
use flotor_study::conduct::{ApparatusOrFrontEndError, NoApparatus};
use flotor_study::designed::{DesignedCohort, DesignedData, DesignedError, DesignedPresenter};
use flotor_study::log::Plan;
use flotor_study::protocol::SubjectNumber;
use flotor_study_design::course::{Course, Handle, Session};
use flotor_study_design::design::Design;
use flotor_study_design::observer::{Population, SimulatedObserver};
use serde_json::json;
use std::num::NonZeroUsize;

/// Returns the number of steps of a session of a simulated subject.
pub(super) fn steps_of(design: &Design, population: &Population, session: Session) -> u64 {
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
pub(super) fn run(
    common: &Common,
    study: DesignFile,
    plan: Plan,
    apparatus: Option<&DesignedApparatus>,
) -> Result<(), CommandError> {
    let cohort = cohort(common, study, plan, apparatus)?;
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

fn cohort(
    common: &Common,
    study: DesignFile,
    plan: Plan,
    apparatus: Option<&DesignedApparatus>,
) -> Result<DesignedCohort, CommandError> {
    let inputs = apparatus.map_or(Ok(Vec::new()), DesignedApparatus::input_files);
    Ok(DesignedCohort {
        seed: common.seed,
        subjects: (1..=common.subjects).filter_map(SubjectNumber::new).collect(),
        apparatus: apparatus.map_or(
            json!(null),
            |apparatus| json!({ "feel_s": common.feel, "scene": apparatus.description() }),
        ),
        inputs: inputs.map_err(|error| CommandError::Usage(error.to_string()))?,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        plan,
        existing_log: common.existing_log(),
        design: study.design,
        population: study.population,
    })
}

fn refused(error: DesignedError) -> CommandError {
    let message = error.to_string();
    match error {
        DesignedError::Dataset(error) => of_dataset(error),
        DesignedError::Apparatus { cause, .. } => outside(cause, message),
        _ => CommandError::Failed(message),
    }
}
