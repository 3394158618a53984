//! Sitting of a person: shows screens, presents stimuli and logs each answer before the next trial begins.

use super::real_time_rig::RealTimeRig;
use super::real_time_run::RealTimeRun;
use crate::conduct::{ApparatusOrFrontEndError, Ending};
use crate::log::{Event, Incident, LogWriter, LoggedEvent, digest};
use crate::screen::{Input, May, Screen, ScreenStateMachine, Step, StimulusExploration};
use crate::trial::Trial;
use std::time::Instant;

/// Result of polling a front end.
#[derive(Clone, Debug, PartialEq)]
pub enum PollResult<I = Input> {
    /// No input yet.
    Nothing,
    /// Input of the person.
    Input(I),
    /// The window or standard input is closed: no further input is possible.
    Closed,
}

/// Minimum exploration of a stimulus before the person can proceed; prevents answers by keys pressed accidentally or too early.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MinimumExploration {
    /// Minimum time, s.
    pub time_s: f64,
    /// Minimum path length of the handle, up and down added, m.
    pub path_length_m: f64,
}

impl MinimumExploration {
    /// Usual minimum: 0.5 s and 2 mm. An exploration of this extent makes the previous answer final.
    pub const USUAL: MinimumExploration = MinimumExploration { time_s: 0.5, path_length_m: 2.0e-3 };

    /// Returns a hint for the person if a stimulus was not felt long or far enough; `None` if time and path length suffice. Without
    /// a path length, only the time counts.
    pub(super) fn is_missed(&self, time_s: f64, path_length_m: Option<f64>) -> Option<&'static str> {
        if time_s < self.time_s {
            Some("feel the stimulus a little longer")
        } else if path_length_m.is_some_and(|path_length_m| path_length_m < self.path_length_m) {
            Some("move the handle to feel the stimulus")
        } else {
            None
        }
    }
}

/// User interface of a person's sitting, with screens `S` and inputs `I`: a terminal, a pipe to a window program, or a test.
pub trait FrontEnd<S = Screen, I = Input> {
    /// Shows a screen.
    ///
    /// # Errors
    /// If the front end is gone.
    fn show(&mut self, screen: &S) -> Result<(), ApparatusOrFrontEndError>;

    /// Returns the next input of the person; waits only briefly, so that the caller can check the handle and the run between
    /// calls.
    ///
    /// # Errors
    /// If the front end is gone.
    fn poll(&mut self, screen: &S) -> Result<PollResult<I>, ApparatusOrFrontEndError>;

    /// Warns the person immediately, visibly and audibly, that the handle was pushed out of its range.
    ///
    /// # Errors
    /// If the front end is gone.
    fn warn_out_of_range(&mut self) -> Result<(), ApparatusOrFrontEndError>;

    /// Shows `why`, the reason for the rejection of an input.
    ///
    /// # Errors
    /// If the front end is gone.
    fn refuse(&mut self, why: &str) -> Result<(), ApparatusOrFrontEndError>;
}

/// Runs a sitting until it is complete or stopped, and logs each answer, note, interruption and disturbance. `least` is the
/// minimum exploration of each stimulus.
///
/// # Errors
/// Errors of apparatus, front end or log; the log stays valid and can be resumed.
pub fn attend(
    attended: &mut ScreenStateMachine,
    log: &mut LogWriter,
    rig: &mut RealTimeRig<'_>,
    front: &mut dyn FrontEnd,
    least: MinimumExploration,
) -> Result<Ending, ApparatusOrFrontEndError> {
    let result = sit(attended, log, rig, front, least);
    if let Err(error) = &result {
        // Return the error of the sitting: a failure to log this error matters less.
        let _ = log.write(&Event::Incident(rig.run().incident_of(error.as_ref())));
    }
    result
}

fn sit(
    attended: &mut ScreenStateMachine,
    log: &mut LogWriter,
    rig: &mut RealTimeRig<'_>,
    front: &mut dyn FrontEnd,
    least: MinimumExploration,
) -> Result<Ending, ApparatusOrFrontEndError> {
    loop {
        let screen = attended.screen();
        if screen == Screen::Over {
            front.show(&screen)?;
            log.write(&Event::End { trials: attended.presented() })?;
            return Ok(Ending::Complete);
        }
        let stimulus = attended.stimulus();
        if let Some((trial, value)) = stimulus {
            if let Some(reason) = rig.begin(&trial, value)? {
                log.write(&Event::Incident(Incident::NotRecorded { reason }))?;
            }
            if let Some(now) = log.now() {
                attended.record_onset(now);
            }
        }
        let felt = stimulus.map(|(trial, _)| trial);
        front.show(&screen)?;
        let shown = Instant::now();
        let step = loop {
            let out_of_range = |trial: &Trial| disturbance(trial, Incident::OutOfRange);
            let out_of_range = felt.as_ref().map(out_of_range);
            let input = match wait_for_input(rig.run(), front, &screen, out_of_range.as_ref(), log)? {
                Ok(input) => input,
                Err(incident) => {
                    log.write(&Event::Incident(incident))?;
                    break Step::Stopped;
                }
            };
            if input == Input::Stop {
                log.write(&Event::Incident(Incident::Stopped))?;
            }
            let felt_for_s = shown.elapsed().as_secs_f64();
            if may_withdraw(&screen)
                && input == Input::Withdraw
                && MinimumExploration::USUAL.is_missed(felt_for_s, rig.run().path_length_m()).is_none()
            {
                front.refuse("the next stimulus has been felt, so the previous answer is final")?;
                continue;
            }
            if let Some(trial) = felt.filter(|_| input == Input::Continue) {
                if let Some(why) = least.is_missed(felt_for_s, rig.run().path_length_m()) {
                    front.refuse(why)?;
                    continue;
                }
                attended.record_exploration(end(rig, &trial, log)?);
            }
            match attended.input(input, shown.elapsed().as_secs_f64()) {
                Ok(Step::Note(text)) => log.write(&Event::Note { text })?,
                Ok(step) => break step,
                Err(error) => front.refuse(&error.to_string())?,
            }
        };
        match step {
            Step::Answered(event) => {
                // Log the answer before closing the recording of the movement: the answer is small and cannot be repeated.
                log.write(&Event::Trial(event))?;
                close_recording(rig, log)?;
            }
            Step::Withdrawn(trial) => {
                log.write(&Event::Withdrawn { trial })?;
                // End the stimulus that has just begun: it is presented again after the new answer.
                if let Some(trial) = felt {
                    end(rig, &trial, log)?;
                    close_recording(rig, log)?;
                }
            }
            Step::Read(text) => {
                let title = text.lines().next().unwrap_or_default();
                let text = format!("read and went on: {title} (SHA-256 {})", digest(&text));
                log.write(&Event::Note { text })?;
            }
            Step::Practised(text) => log.write(&Event::Note { text })?,
            Step::Stopped => return Ok(Ending::Stopped),
            Step::Shown | Step::Note(_) => {}
        }
    }
}

/// Returns true if an answer can be withdrawn while a stimulus is felt.
fn may_withdraw(screen: &Screen) -> bool {
    matches!(screen, Screen::Feel { trial, .. } if trial.may.contains(&May::Withdraw))
}

/// Ends a stimulus and logs its missed ticks.
fn end(
    rig: &mut RealTimeRig<'_>,
    trial: &Trial,
    log: &mut LogWriter,
) -> Result<StimulusExploration, ApparatusOrFrontEndError> {
    let felt = rig.end()?;
    if felt.missed_ticks > 0 {
        log.write(&disturbance(trial, Incident::MissedTicks { ticks: felt.missed_ticks }))?;
    }
    Ok(felt)
}

/// Returns the event to log for a disturbance: an incident, or a note during practice before a resumed sitting, which is not
/// part of the sitting.
fn disturbance(trial: &Trial, incident: Incident) -> Event {
    match trial.number {
        0 => Event::Note { text: format!("practice before going on: {incident}") },
        _ => Event::Incident(incident),
    }
}

/// Closes the recording of a trial; logs a failure and continues the sitting.
fn close_recording(rig: &mut RealTimeRig<'_>, log: &mut LogWriter) -> Result<(), ApparatusOrFrontEndError> {
    if let Err(error) = rig.run().close_recording() {
        log.write(&Event::Incident(Incident::NotRecorded { reason: error.to_string() }))?;
    }
    Ok(())
}

/// Returns the next input, or the incident that stops the sitting. While a stimulus is felt, warns and logs `out_of_range` once each time
/// the handle leaves its range.
pub(super) fn wait_for_input<S, I>(
    run: &mut RealTimeRun,
    front: &mut dyn FrontEnd<S, I>,
    screen: &S,
    out_of_range: Option<&impl LoggedEvent>,
    log: &mut LogWriter,
) -> Result<Result<I, Incident>, ApparatusOrFrontEndError> {
    let mut warned = false;
    loop {
        if let Some(incident) = run.stopped_by() {
            return Ok(Err(incident));
        }
        match front.poll(screen)? {
            PollResult::Nothing => {}
            PollResult::Input(input) => return Ok(Ok(input)),
            // An emergency stop closes the window, too: report the stop.
            PollResult::Closed => return Ok(Err(run.stopped_by().unwrap_or(Incident::WindowClosed))),
        }
        let out = out_of_range.filter(|_| run.is_out_of_range());
        if let (Some(event), false) = (out, warned) {
            front.warn_out_of_range()?;
            log.write(event)?;
        }
        warned = out.is_some();
    }
}
