//! Sitting of a person in a designed study: shows screens, presents intervals and logs each step before the next begins.

use super::attend::{FrontEnd, MinimumExploration, wait_for_input};
use super::designed_person_rig::DesignedPersonRig;
use crate::conduct::{ApparatusOrFrontEndError, Ending};
use crate::designed::screen::{Input, Screen};
use crate::designed::{AttendedCourse, Effect, Event};
use crate::log::{Incident, LogWriter, digest};
use crate::screen::StimulusExploration;
use std::time::Instant;

/// Runs a session until it is complete or stopped, and logs each step, note, interruption and disturbance. `least` is the minimum
/// exploration of each interval, `before` the number of steps in the log.
///
/// # Errors
/// Errors of apparatus, front end or log; the log stays valid and can be resumed.
pub fn attend(
    attended: &mut AttendedCourse,
    (log, before): (&mut LogWriter, u32),
    rig: &mut DesignedPersonRig<'_>,
    front: &mut dyn FrontEnd<Screen, Input>,
    least: MinimumExploration,
) -> Result<Ending, ApparatusOrFrontEndError> {
    let result = sit(attended, log, rig, front, least);
    match result {
        Ok(None) => Ok(Ending::Stopped),
        Ok(Some(steps)) => {
            log.write(&Event::End { steps: before + steps })?;
            Ok(Ending::Complete)
        }
        Err(error) => {
            // Return the error of the session: a failure to log this error matters less.
            let _ = log.write(&Event::Incident(rig.run().incident_of(error.as_ref())));
            Err(error)
        }
    }
}

/// Returns the number of answered steps of a complete session; `None` after a stop.
fn sit(
    attended: &mut AttendedCourse,
    log: &mut LogWriter,
    rig: &mut DesignedPersonRig<'_>,
    front: &mut dyn FrontEnd<Screen, Input>,
    least: MinimumExploration,
) -> Result<Option<u32>, ApparatusOrFrontEndError> {
    let mut steps = 0;
    loop {
        let screen = attended.screen();
        let interval = attended.interval();
        if let Some((trial, settings)) = &interval {
            if let Some(reason) = rig.begin(*trial, settings)? {
                log.write(&Event::Incident(Incident::NotRecorded { reason }))?;
            }
            if let Some(now) = log.now() {
                attended.record_onset(now);
            }
        }
        front.show(&screen)?;
        if screen == Screen::Over {
            return Ok(Some(steps));
        }
        let shown = Instant::now();
        let effect = loop {
            let out_of_range = interval.as_ref().map(|_| Event::Incident(Incident::OutOfRange));
            let input = match wait_for_input(rig.run(), front, &screen, out_of_range.as_ref(), log)? {
                Ok(input) => input,
                Err(incident) => {
                    log.write(&Event::Incident(incident))?;
                    break Effect::Stopped;
                }
            };
            if input == Input::Stop {
                log.write(&Event::Incident(Incident::Stopped))?;
            }
            let felt_for_s = shown.elapsed().as_secs_f64();
            if interval.is_some() && input == Input::Continue {
                if let Some(why) = least.is_missed(felt_for_s, rig.run().path_length_m()) {
                    front.refuse(why)?;
                    continue;
                }
                attended.record_exploration(end(rig, log)?);
            }
            match attended.input(input, felt_for_s) {
                Ok(Effect::Note(text)) => log.write(&Event::Note { text })?,
                Ok(effect) => break effect,
                Err(error) => front.refuse(&error.to_string())?,
            }
        };
        match effect {
            Effect::Answered(event) => {
                // Log the answer before closing the recording of the movement: the answer is small and cannot be repeated.
                log.write(&Event::Step(event))?;
                steps += 1;
                if let Err(error) = rig.run().close_recording() {
                    log.write(&Event::Incident(Incident::NotRecorded { reason: error.to_string() }))?;
                }
            }
            Effect::Read(text) => {
                let title = text.lines().next().unwrap_or_default();
                let text = format!("read and went on: {title} (SHA-256 {})", digest(&text));
                log.write(&Event::Note { text })?;
            }
            Effect::Stopped => return Ok(None),
            Effect::Shown | Effect::Note(_) => {}
        }
    }
}

/// Ends an interval and logs its missed ticks.
fn end(
    rig: &mut DesignedPersonRig<'_>,
    log: &mut LogWriter,
) -> Result<StimulusExploration, ApparatusOrFrontEndError> {
    let felt = rig.end()?;
    if felt.missed_ticks > 0 {
        log.write(&Event::Incident(Incident::MissedTicks { ticks: felt.missed_ticks }))?;
    }
    Ok(felt)
}
