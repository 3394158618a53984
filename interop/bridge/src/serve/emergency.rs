//! Emergency stop from the network: presses the latch of this machine at once, and replies when every host has confirmed.

use flotor_live::{Directory, Latch};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Callback that sends the reply to a press; its argument is the reason for a refusal, `None` on success.
pub(super) type SendAnswer = Box<dyn FnOnce(Option<String>) + Send>;

/// Timeout of the hosts' confirmation; the peer's timeout is longer.
const CONFIRM_WAIT: Duration = Duration::from_millis(2000);
/// Limit on presses that wait for a reply. Further presses take effect as well, but get no reply.
const MOST_WAITING: usize = 1024;

/// Returns the name under which a member's press is stored.
pub(super) fn who(member: &str, bridge: impl std::fmt::Display) -> String {
    format!("{member} over the network (bridge {bridge})")
}

/// Latch of the emergency stop, with a thread that waits for the hosts' confirmation and sends the replies.
pub(super) struct Emergency {
    latch: Latch,
    pressed: SyncSender<(SendAnswer, Option<String>)>,
}

impl Emergency {
    pub(super) fn start(directory: &Directory) -> std::io::Result<Self> {
        let (pressed, waiting) = sync_channel(MOST_WAITING);
        let latch = directory.latch();
        let of_thread = latch.clone();
        let thread = std::thread::Builder::new().name("flotor-emergency".to_owned());
        // Ends with the last sender.
        thread.spawn(move || attend(&of_thread, &waiting))?;
        Ok(Self { latch, pressed })
    }

    pub(super) fn latch(&self) -> &Latch {
        &self.latch
    }

    /// Presses the latch; `answer` is called after the hosts have confirmed or the timeout has passed, and not at all if too many
    /// presses are pending. The latch comes first: a run that is not visible yet checks the latch before it energises a device.
    pub(super) fn press(&self, who: &str, answer: SendAnswer) {
        let problem = self.latch.press(who).err().map(|error| {
            format!("the emergency stop was not stored, so it does not prevent a later run: {error}")
        });
        let _ = self.pressed.try_send((answer, problem));
    }
}

fn attend(latch: &Latch, waiting: &Receiver<(SendAnswer, Option<String>)>) {
    while let Ok(first) = waiting.recv() {
        let together: Vec<_> = std::iter::once(first).chain(waiting.try_iter()).collect();
        let missing = match latch.stop_runs(Instant::now() + CONFIRM_WAIT) {
            Ok(unconfirmed) if unconfirmed.is_empty() => None,
            Ok(unconfirmed) => {
                let processes: Vec<String> = unconfirmed.iter().map(u32::to_string).collect();
                Some(format!(
                    "not confirmed by process {}, so a force may continue: switch the devices off",
                    processes.join(", ")
                ))
            }
            Err(error) => {
                Some(format!("the state of the runs is unknown: {error}; check that each has stopped"))
            }
        };
        for (answer, problem) in together {
            answer(missing.clone().or(problem));
        }
    }
}
