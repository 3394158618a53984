//! How long the process of one rule may take: so much time of a processor, or so much in which it could have run and
//! did not want to. Time in which others have the processor is nobody's violation.

use crate::platform::used;
use flotor_session::PluginProcess;
use std::io;
use std::process::ExitStatus;
use std::time::{Duration, Instant};

/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(2);
/// The longest time between two looks that is believed: a longer one says that this process had to wait as well.
const LONGEST_LOOK: Duration = Duration::from_millis(20);

/// How a process has ended.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) status: ExitStatus,
    /// Time of a processor that it took, as far as was seen.
    pub(crate) ran: Duration,
}

/// Waits for the end of a process; `None` if it took too long and was ended.
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
