//! Front end in the window of the viewer, a separate process that displays the run and the screens and sends the person's
//! inputs.

use super::{JsonLines, lines_of};
use flotor_command::CommandError;
use flotor_command::separate::{Running, SeparateProgram};
use flotor_live::process_number;
use flotor_servo::StopSwitch;
use flotor_servo::last_stop::spawn_unblocked;
use flotor_study::screen::StopKey;
use std::io::BufReader;
use std::path::Path;
use std::process::{ChildStdin, Stdio};
use std::time::Duration;

/// Poll interval for the exit of the viewer.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// Window of the viewer, for a person. Dropping it closes the window.
pub(in crate::study) struct Window {
    /// Front end that exchanges messages with the window.
    pub(in crate::study) lines: JsonLines<ChildStdin>,
    viewer: Running,
}

impl Window {
    /// Starts the viewer with a window for the run of this process, and waits until the window is visible.
    ///
    /// # Errors
    /// If the viewer cannot be started, or opens no window; the viewer then prints the reason.
    pub(in crate::study) fn open(stop_key: StopKey, texts: Option<&Path>) -> Result<Self, CommandError> {
        let mut command = SeparateProgram::VIEWER.command()?;
        command.arg("--sitting").arg("--run").arg(process_number().to_string());
        command.arg("--stop-key").arg(stop_key.word());
        if let Some(texts) = texts {
            command.arg("--texts").arg(texts);
        }
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let spawned = spawn_unblocked(&mut command);
        let failed = |cause| CommandError::file(command.get_program().as_ref(), "cannot be started", cause);
        let mut viewer = Running(spawned.map_err(failed)?);
        let (Some(input), Some(output)) = (viewer.0.stdin.take(), viewer.0.stdout.take()) else {
            return Err(CommandError::Failed(
                "cannot open the pipes of the viewer; use --screen terminal".to_owned(),
            ));
        };
        let heard = lines_of(BufReader::new(output))?;
        // The first message reports the open window; without a window, the stream ends.
        if heard.recv().is_err() {
            let why = "the viewer opened no window (its message is above); use --screen terminal";
            return Err(CommandError::Usage(why.to_owned()));
        }
        Ok(Self { lines: JsonLines::new(heard, input), viewer })
    }

    /// Waits until the person closes the window or a stop is requested.
    pub(in crate::study) fn wait_closed(mut self, stop: &StopSwitch) {
        while self.viewer.0.try_wait().is_ok_and(|status| status.is_none()) && !stop.is_stop_requested() {
            std::thread::sleep(LOOK_PERIOD);
        }
    }
}
