//! A person's sitting: screens shown, stimuli felt, answers logged, each before the next trial begins.

use super::real_time_rig::RealTimeRig;
use crate::conduct::{Ending, OutsideError};
use crate::log::{Event, Incident, LogWriter, TrialEvent, digest};
use crate::screen::{Attended, Felt, Input, May, Screen, Step};
use crate::trial::Trial;
use std::time::Instant;

/// What a front end has heard of a person.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// Nothing yet.
    Nothing,
    /// What the person did.
    Input(Input),
    /// The window is closed, or standard input is: nobody can be asked any more.
    Closed,
}

/// The least that a stimulus must be felt before it counts: a key pressed by accident, or ahead, is no answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Least {
    /// Time, s.
    pub time_s: f64,
    /// Way of the handle, up and down together, m.
    pub way_m: f64,
}

impl Least {
    /// Half a second, and twice a millimetre. From then on the answer before it is no longer taken back.
    pub const USUAL: Least = Least { time_s: 0.5, way_m: 2.0e-3 };

    /// Why a stimulus was not felt long or far enough, if so.
    fn is_missed(&self, time_s: f64, way_m: Option<f64>) -> Option<&'static str> {
        if time_s < self.time_s {
            Some("feel it a little longer")
        } else if way_m.is_some_and(|way_m| way_m < self.way_m) {
            Some("move the handle to feel it")
        } else {
            None
        }
    }
}

/// Where a person sees screens and answers: a terminal, a pipe to a window, a test.
pub trait FrontEnd {
    /// Shows a screen.
    ///
    /// # Errors
    /// Nobody can be shown anything any more.
    fn show(&mut self, screen: &Screen) -> Result<(), OutsideError>;

    /// What the person has done since; waits for it no longer than a moment, so that the handle can be
    /// watched meanwhile.
    ///
    /// # Errors
    /// Nobody can be asked any more.
    fn poll(&mut self, screen: &Screen) -> Result<Heard, OutsideError>;

    /// The handle has just been pushed out of its range: to be seen and heard at once.
    ///
    /// # Errors
    /// Nobody can be told any more.
    fn warn_out_of_range(&mut self) -> Result<(), OutsideError>;

    /// An input that cannot be taken, and why.
    ///
    /// # Errors
    /// Nobody can be told any more.
    fn refuse(&mut self, why: &str) -> Result<(), OutsideError>;
}

/// Carries a sitting on to its end, or to where it is stopped; whatever stops or disturbs it is in the log. `watch` is told of
/// every trial that is on disk.
///
/// # Errors
/// Apparatus, front end or log; what is in the log stays and can be resumed.
pub fn attend(
    attended: &mut Attended,
    log: &mut LogWriter,
    rig: &mut RealTimeRig<'_>,
    front: &mut dyn FrontEnd,
    least: Least,
    watch: &mut dyn FnMut(&TrialEvent),
) -> Result<Ending, OutsideError> {
    let result = sit(attended, log, rig, front, least, watch);
    if let Err(error) = &result {
        // The reason comes first; that it could not be written is the lesser trouble.
        let _ = log.write(&Event::Incident(rig.incident_of(error.as_ref())));
    }
    result
}

fn sit(
    attended: &mut Attended,
    log: &mut LogWriter,
    rig: &mut RealTimeRig<'_>,
    front: &mut dyn FrontEnd,
    least: Least,
    watch: &mut dyn FnMut(&TrialEvent),
) -> Result<Ending, OutsideError> {
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
                attended.felt_from(now);
            }
        }
        let felt = stimulus.map(|(trial, _)| trial);
        front.show(&screen)?;
        let shown = Instant::now();
        let step = loop {
            let input = match wait_for_input(rig, front, &screen, felt.as_ref(), log)? {
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
                && Least::USUAL.is_missed(felt_for_s, rig.way_m()).is_none()
            {
                front.refuse("the next one has been felt; the answer before it stays")?;
                continue;
            }
            if let Some(trial) = felt.filter(|_| input == Input::Continue) {
                if let Some(why) = least.is_missed(felt_for_s, rig.way_m()) {
                    front.refuse(why)?;
                    continue;
                }
                attended.felt(end(rig, &trial, log)?);
            }
            match attended.input(input, shown.elapsed().as_secs_f64()) {
                Ok(Step::Note(text)) => log.write(&Event::Note { text })?,
                Ok(step) => break step,
                Err(error) => front.refuse(&error.to_string())?,
            }
        };
        match step {
            Step::Answered(event) => {
                // The answer before the movement: it is small, and cannot be had again.
                log.write(&Event::Trial(event.clone()))?;
                close_recording(rig, log)?;
                watch(&event);
            }
            Step::Withdrawn(trial) => {
                log.write(&Event::Withdrawn { trial })?;
                // What had just begun comes again after the answer; of the one to be answered nothing more is felt now.
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

/// Whether an answer can be taken back while a stimulus is felt.
fn may_withdraw(screen: &Screen) -> bool {
    matches!(screen, Screen::Feel { trial, .. } if trial.may.contains(&May::Withdraw))
}

/// Ends a stimulus, and tells of the ticks that it missed.
fn end(rig: &mut RealTimeRig<'_>, trial: &Trial, log: &mut LogWriter) -> Result<Felt, OutsideError> {
    let felt = rig.end()?;
    if felt.missed_ticks > 0 {
        log.write(&disturbance(trial, Incident::MissedTicks { ticks: felt.missed_ticks }))?;
    }
    Ok(felt)
}

/// What disturbed a trial: an incident of the sitting, or a note where it is no part of that.
fn disturbance(trial: &Trial, incident: Incident) -> Event {
    match trial.number {
        0 => Event::Note { text: format!("practice before going on: {incident}") },
        _ => Event::Incident(incident),
    }
}

/// Closes the recording of a trial; that it failed is noted, and the sitting goes on.
fn close_recording(rig: &mut RealTimeRig<'_>, log: &mut LogWriter) -> Result<(), OutsideError> {
    if let Err(error) = rig.close_recording() {
        log.write(&Event::Incident(Incident::NotRecorded { reason: error.to_string() }))?;
    }
    Ok(())
}

/// The next input, or what stops the sitting. Warns once for each time the handle leaves its range, and notes it.
fn wait_for_input(
    rig: &mut RealTimeRig<'_>,
    front: &mut dyn FrontEnd,
    screen: &Screen,
    felt: Option<&Trial>,
    log: &mut LogWriter,
) -> Result<Result<Input, Incident>, OutsideError> {
    let mut warned = false;
    loop {
        if let Some(incident) = rig.stopped_by() {
            return Ok(Err(incident));
        }
        match front.poll(screen)? {
            Heard::Nothing => {}
            Heard::Input(input) => return Ok(Ok(input)),
            // The window is closed by an emergency stop, too: that is what has to be known.
            Heard::Closed => return Ok(Err(rig.stopped_by().unwrap_or(Incident::WindowClosed))),
        }
        let out = felt.filter(|_| rig.is_out_of_range());
        if let (Some(trial), false) = (out, warned) {
            front.warn_out_of_range()?;
            log.write(&disturbance(trial, Incident::OutOfRange))?;
        }
        warned = out.is_some();
    }
}
