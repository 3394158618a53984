//! Apparatus for a simulated observer: the servo loop in virtual time; the subject's simulated hand moves up and down
//! continuously.
//!
//! ```text
//! object's weight   1 ──╮        ╭── 1        between two stimuli the object fades out, changes while nobody feels
//!                       ╰── 0 ──╯             it, and fades in again: no step of force
//!                          set
//! ```

use super::watch::Watch;
use super::{Apparatus, Kinematics};
use crate::conduct::{ApparatusOrFrontEndError, Presenter};
use crate::dataset::{DatasetError, make_folder};
use crate::kinematics::KinematicsMeter;
use crate::protocol::SubjectNumber;
use crate::trial::{Exploration, Trial};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_record::Recorder;
use flotor_servo::{Clock, RunEnd, StopSwitch};
use flotor_session::scene::Scene;
use flotor_session::{ControlError, Observer, RunError, RunRecording, Steps};
use std::path::PathBuf;

/// Error: the run ended before the experiment was complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the run ended: {}; correct the cause, and continue with `--resume`", .0.cause())]
pub struct RunEnded(pub RunEnd);

/// Error: the model rejected a stimulus during the run, although the check before the first trial had accepted it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "the model rejected {}.{} = {}; choose stimuli within the range of the model", .0.plugin, .0.parameter, .0.value)]
pub struct StimulusRefused(pub Box<Change>);

/// Paths of the trial recordings, one file per trial.
#[derive(Clone, Debug)]
pub struct TrialFiles {
    folder: PathBuf,
    prefix: String,
}

impl TrialFiles {
    /// Creates the folder for the recordings; file names begin with `prefix`.
    ///
    /// # Errors
    /// If the folder cannot be created.
    pub fn make(folder: PathBuf, prefix: String) -> Result<Self, DatasetError> {
        make_folder(&folder)?;
        Ok(Self { folder, prefix })
    }

    /// Returns an unused path for a trial, so that a repetition does not overwrite the recording of an interrupted trial. After
    /// 1000 recordings of a trial, returns the path of the first recording.
    #[must_use]
    pub fn next_of(&self, trial: &Trial) -> PathBuf {
        self.next_of_number(trial.number)
    }

    /// Returns an unused path for the trial of this number, as [`Self::next_of`] does.
    #[must_use]
    pub fn next_of_number(&self, number: u32) -> PathBuf {
        let first = self.of_number(number);
        let again =
            |run: u32| self.folder.join(format!("{}_trial-{number:04}_run-{run}_motion.mcap", self.prefix));
        let mut paths = std::iter::once(first.clone()).chain((2..=1000).map(again));
        paths.find(|path| !path.exists()).unwrap_or(first)
    }

    /// Returns the path of a trial's first recording.
    #[must_use]
    pub fn of(&self, trial: &Trial) -> PathBuf {
        self.of_number(trial.number)
    }

    fn of_number(&self, number: u32) -> PathBuf {
        self.folder.join(format!("{}_trial-{number:04}_motion.mcap", self.prefix))
    }
}

/// Apparatus of one simulated subject, in virtual time.
pub struct Rig<'a> {
    apparatus: &'a Apparatus,
    scene: Scene,
    seed: u64,
    steps: Steps,
    watch: Watch,
    kinematics: Kinematics,
    files: Option<TrialFiles>,
    feel_ticks: u64,
    fade_ticks: u64,
}

impl<'a> Rig<'a> {
    /// Loads and activates the scene with the object faded in. Each stimulus is felt for `feel_s` seconds, fades excluded;
    /// `stop` ends the run.
    ///
    /// # Errors
    /// [`RunError`].
    pub fn start(
        apparatus: &'a Apparatus,
        (seed, subject): (u64, SubjectNumber),
        kinematics: Kinematics,
        files: Option<TrialFiles>,
        feel_s: f64,
        stop: &StopSwitch,
    ) -> Result<Self, RunError> {
        let scene = apparatus.stage.scene_with_hand(seed, subject);
        // A different seed for each subject, so that the tremor differs, too.
        let seed = seed.wrapping_mul(u64::from(SubjectNumber::MOST) + 1).wrapping_add(subject.get().into());
        let steps = Steps::prepare(&scene, &apparatus.stage.registry, seed, stop)?;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // minutes at most
        let ticks = |seconds: f64| (seconds * scene.rate_hz).ceil() as u64;
        Ok(Self {
            feel_ticks: ticks(feel_s),
            // One tick more: the loop applies a change at the next tick.
            fade_ticks: ticks(apparatus.fade_s) + 1,
            apparatus,
            seed,
            steps,
            watch: Watch::default(),
            kinematics,
            files,
            scene,
        })
    }

    /// Presents the stimuli of a trial one after the other, and returns the exploration. Records the movement if requested, and
    /// passes every tick to `also` as well.
    ///
    /// # Errors
    /// Errors of the apparatus; [`RunEnded`] after a stop request.
    pub fn present_watched(
        &mut self,
        trial: &Trial,
        also: &mut dyn Observer,
    ) -> Result<Exploration, ApparatusOrFrontEndError> {
        if let (Kinematics::Full, Some(files)) = (self.kinematics, &self.files) {
            let run = self.apparatus.stage.describe(&self.scene, Clock::Virtual, self.seed);
            self.watch.recording = RunRecording::new(Some(Recorder::create(&files.next_of(trial), &run)?));
        }
        let mut exploration = Exploration::default();
        for value in trial.presented.values() {
            self.change_to(value, also)?;
            self.watch.meter = Some(KinematicsMeter::default());
            self.advance(self.feel_ticks, also)?;
            if let Some(meter) = self.watch.meter.take() {
                exploration.boundary_hit |= meter.out_of_range;
                if self.kinematics != Kinematics::None {
                    exploration.kinematics.extend(meter.finish());
                }
            }
        }
        exploration.missed_ticks = std::mem::take(&mut self.watch.missed_ticks);
        self.watch.recording.finish(&[])?;
        Ok(exploration)
    }

    fn change_to(&mut self, value: f64, also: &mut dyn Observer) -> Result<(), ApparatusOrFrontEndError> {
        let apparatus = self.apparatus;
        apparatus.show(self.steps.controls(), false)?;
        self.advance(self.fade_ticks, also)?;
        // A replaced model is dropped after its fade-out; only then can another replacement start.
        let mut busy = apparatus.set(self.steps.controls(), value);
        if let Err(ControlError::Busy) = busy {
            self.advance(self.fade_ticks, also)?;
            busy = apparatus.set(self.steps.controls(), value);
        }
        busy?;
        apparatus.show(self.steps.controls(), true)?;
        self.advance(self.fade_ticks, also)?;
        self.watch.refused.take().map_or(Ok(()), |change| Err(StimulusRefused(change.into()).into()))
    }

    fn advance(&mut self, ticks: u64, also: &mut dyn Observer) -> Result<(), ApparatusOrFrontEndError> {
        let end = self.steps.advance(ticks, &mut Both(&mut self.watch, also))?;
        end.map_or(Ok(()), |end| Err(RunEnded(end).into()))
    }
}

impl Presenter for Rig<'_> {
    fn present(&mut self, trial: &Trial) -> Result<Option<Exploration>, ApparatusOrFrontEndError> {
        match self.present_watched(trial, &mut Nobody) {
            Err(error) if matches!(error.downcast_ref(), Some(RunEnded(RunEnd::Stopped))) => Ok(None),
            presented => presented.map(Some),
        }
    }
}

struct Both<'a>(&'a mut Watch, &'a mut dyn Observer);

impl Observer for Both<'_> {
    fn observe(&mut self, record: &TickRecord) {
        self.0.observe(record);
        self.1.observe(record);
    }

    fn demand(&self) -> Demand {
        self.0.demand().with(self.1.demand())
    }

    fn change(&mut self, change: &Change) {
        self.0.change(change);
        self.1.change(change);
    }
}

struct Nobody;

impl Observer for Nobody {
    fn observe(&mut self, _: &TickRecord) {}
}
