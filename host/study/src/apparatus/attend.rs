//! A person's sitting: screens shown, stimuli felt, answers logged, each before the next trial begins.

use super::real_time_rig::RealTimeRig;
use crate::conduct::{Ending, OutsideError};
use crate::log::{Event, LogWriter, TrialEvent};
use crate::screen::{Attended, Input, Screen, Step};
use std::time::Instant;

/// Where a person sees screens and answers: a terminal, a pipe to a window, a test.
pub trait FrontEnd {
    /// Shows a screen.
    ///
    /// # Errors
    /// Nobody can be shown anything any more.
    fn show(&mut self, screen: &Screen) -> Result<(), OutsideError>;

    /// What the person has done since, if anything; waits for it no longer than a moment, so that the handle can be
    /// watched meanwhile.
    ///
    /// # Errors
    /// Nobody can be asked any more.
    fn poll(&mut self, screen: &Screen) -> Result<Option<Input>, OutsideError>;

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

/// Carries a sitting on to its end, or to where the person stops. `watch` is told of every trial that is on disk.
///
/// # Errors
/// Apparatus, front end or log; what is in the log stays and can be resumed.
pub fn attend(
    attended: &mut Attended,
    log: &mut LogWriter,
    rig: &mut RealTimeRig<'_>,
    front: &mut dyn FrontEnd,
    watch: &mut dyn FnMut(&TrialEvent),
) -> Result<Ending, OutsideError> {
    loop {
        let screen = attended.screen();
        if screen == Screen::Over {
            front.show(&screen)?;
            log.write(&Event::End { trials: attended.presented() })?;
            return Ok(Ending::Complete);
        }
        let felt = attended.stimulus();
        if let Some((trial, value)) = felt {
            rig.begin(&trial, value)?;
        }
        front.show(&screen)?;
        let shown = Instant::now();
        let step = loop {
            let Some(input) = wait_for_input(rig, front, &screen)? else { break Step::Stopped };
            let leaves = felt.is_some() && matches!(input, Input::Continue);
            if leaves {
                attended.felt(rig.end()?);
            }
            match attended.input(input, shown.elapsed().as_secs_f64()) {
                Ok(Step::Note(text)) => log.write(&Event::Note { text })?,
                Ok(step) => break step,
                Err(error) => front.refuse(&error.to_string())?,
            }
        };
        match step {
            Step::Answered(event) => {
                rig.close_recording()?;
                log.write(&Event::Trial(event.clone()))?;
                watch(&event);
            }
            Step::Stopped => return Ok(Ending::Stopped),
            Step::Shown | Step::Note(_) => {}
        }
    }
}

/// The next input; none if the run is to end. Warns once for each time the handle leaves its range.
fn wait_for_input(
    rig: &RealTimeRig<'_>,
    front: &mut dyn FrontEnd,
    screen: &Screen,
) -> Result<Option<Input>, OutsideError> {
    let mut warned = false;
    loop {
        if let Some(input) = front.poll(screen)? {
            return Ok(Some(input));
        }
        if rig.is_stopping() {
            return Ok(None);
        }
        let out = rig.is_out_of_range() && matches!(screen, Screen::Feel { .. });
        if out && !warned {
            front.warn_out_of_range()?;
        }
        warned = out;
    }
}
