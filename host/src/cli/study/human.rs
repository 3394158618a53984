//! A person sits: the scene runs in a process of its own, the viewer in another, in front of the subject.

use super::{Common, refused, tell};
use crate::cli::view::VIEWER;
use crate::cli::{CommandError, stopping::stop_on_signals};
use flotor_study::dataset::{Dataset, DatasetError, Progress};
use flotor_study::log::{Begin, FORMAT};
use flotor_study::protocol::{Protocol, SubjectNumber};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::json;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// How long a sitting may last: longer than anybody can sit.
const LONGEST: &str = "12h";
/// How often the processes are looked at.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Carries one sitting out. The event log goes from hand to hand: begun here, written by the viewer, read here again.
pub(super) fn carry_out(common: &Common, protocol: &Protocol) -> Result<(), CommandError> {
    let subject = common.subject.and_then(SubjectNumber::new).ok_or_else(|| {
        CommandError::Usage("--observer human is for one person at a time: add --subject N".to_owned())
    })?;
    let dataset = Dataset::at(&common.out);
    begin(common, &dataset, subject, protocol).map_err(|error| refused(error.into()))?;
    let log = dataset.log_path(subject, protocol.task());
    sit(common, &log)?;
    dataset.write_tables().map_err(|error| refused(error.into()))?;
    tell(&dataset)
}

fn begin(
    common: &Common,
    dataset: &Dataset,
    subject: SubjectNumber,
    protocol: &Protocol,
) -> Result<(), DatasetError> {
    let scene = common.scene.as_ref().and_then(|path| std::fs::read_to_string(path).ok());
    let begin = Begin {
        format: FORMAT,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        subject,
        seed: common.seed,
        protocol: protocol.clone(),
        observer: json!("human"),
        apparatus: json!({ "scene": scene }),
    };
    let root = || dataset.root().to_path_buf();
    match dataset.progress(subject, protocol.task())? {
        Progress::New => dataset.begin(begin).map(|_| ()),
        Progress::Complete(_) => Err(DatasetError::Duplicate { subject, root: root() }),
        Progress::Partial(log) if !common.resume => {
            Err(DatasetError::Unfinished { subject, trials: log.trials.len(), root: root() })
        }
        Progress::Partial(log) => match begin.differs(&log.begin) {
            Some(what) => Err(DatasetError::Changed { path: log.path().to_path_buf(), what }),
            None => Ok(()),
        },
    }
}

/// Runs the scene as long as the viewer is open; if either ends by itself, the other does, too.
fn sit(common: &Common, log: &Path) -> Result<(), CommandError> {
    let own = std::env::current_exe().map_err(|cause| CommandError::Failed(cause.to_string()))?;
    let failed = |program: &'static str| {
        move |cause| CommandError::file(Path::new(program), "cannot be started", cause)
    };
    let mut viewer = VIEWER.command()?; // before anything moves
    let mut run = Command::new(&own);
    run.arg("run")
        .args(&common.scene)
        .args(["--duration", LONGEST])
        .stdin(Stdio::null())
        .stdout(Stdio::null());
    let mut run = run.spawn().map_err(failed("flotor"))?;
    let stop = stop_on_signals();
    viewer.arg("--sitting").arg(log).arg("--run").arg(run.id().to_string());
    let viewer = viewer.spawn().map_err(failed("flotor-viewer"));
    let ended = viewer.and_then(|mut viewer| {
        let ended = loop {
            std::thread::sleep(LOOK_PERIOD);
            if let Some(status) = viewer.try_wait().ok().flatten() {
                break if status.success() {
                    Ok(())
                } else {
                    Err("the viewer has failed; it says why above")
                };
            }
            if run.try_wait().ok().flatten().is_some() {
                break Err("the run has ended before the sitting; it says why above. Go on with --resume");
            }
            if stop.stop_flag().load(Ordering::Relaxed) {
                break Ok(());
            }
        };
        end(&mut viewer);
        ended.map_err(|why| CommandError::Failed(why.to_owned()))
    });
    end(&mut run);
    ended
}

/// Asks a process to end in order, and waits.
fn end(process: &mut Child) {
    if process.try_wait().ok().flatten().is_none() {
        let id = i32::try_from(process.id()).ok().and_then(Pid::from_raw);
        let _ = id.map(|id| kill_process(id, Signal::TERM));
    }
    let _ = process.wait();
}
