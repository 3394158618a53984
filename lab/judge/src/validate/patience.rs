//! Timeout of the process of one rule: a limit of its processor time, and a limit of the time in which it was idle by choice. Time
//! in which other processes have the processor does not count.

use crate::platform::used;
use flotor_session::PluginProcess;
use std::io;
use std::process::ExitStatus;
use std::time::{Duration, Instant};

/// Poll interval of a process.
const LOOK: Duration = Duration::from_millis(2);
/// Longest credible poll interval: after a longer one this process itself had to wait.
const LONGEST_LOOK: Duration = Duration::from_millis(20);

/// End of a process.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) status: ExitStatus,
    /// Processor time used, as of the last poll.
    pub(crate) ran: Duration,
}

/// Waits for the end of a process; ends it on timeout and returns `None`.
pub(crate) fn wait(child: &mut PluginProcess, patience: Duration) -> io::Result<Option<Ended>> {
    let (mut idle, mut looked) = (Duration::ZERO, Instant::now());
    let mut ran = Duration::ZERO;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(Ended { status, ran }));
        }
        let used = used(child.id());
        ran = ran.max(used.ran);
        if used.ran > patience || idle > patience {
            child.kill()?;
            return Ok(None);
        }
        std::thread::sleep(LOOK);
        let since = looked.elapsed().min(LONGEST_LOOK);
        looked = Instant::now();
        if !used.wants {
            idle += since;
        }
    }
}
