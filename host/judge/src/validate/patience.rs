//! How long the process of one rule may take: so much time of a processor, or so much in which it could have run and
//! did not want to. Time in which others have the processor is nobody's violation.

use std::fs;
use std::io;
use std::process::{Child, ExitStatus};
use std::time::{Duration, Instant};

/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(2);
/// The longest time between two looks that is believed: a longer one says that this process had to wait as well.
const LONGEST_LOOK: Duration = Duration::from_millis(20);
/// Unit of processor times under /proc: `USER_HZ` is 100 on every Linux.
const CLOCK_TICK: Duration = Duration::from_millis(10);

/// How a process has ended.
#[derive(Debug)]
pub(super) struct Ended {
    pub(super) status: ExitStatus,
    /// Time of a processor that it took, as far as was seen.
    pub(super) ran: Duration,
}

/// Waits for the end of a process; `None` if it took too long and was ended.
pub(super) fn wait(child: &mut Child, patience: Duration) -> io::Result<Option<Ended>> {
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
            child.wait()?;
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

/// What a process did so far, and whether it would do more now.
struct Used {
    ran: Duration,
    wants: bool,
}

fn used(process: u32) -> Used {
    let fields_of = |path: String| -> Vec<String> {
        let text = fs::read_to_string(path).unwrap_or_default();
        text.rsplit(')').next().unwrap_or_default().split_whitespace().map(str::to_owned).collect()
    };
    // Fields 14 and 15 of proc(5), user and system; the state, field 3, comes first after the name.
    let fields = fields_of(format!("/proc/{process}/stat"));
    let ticks = |field: usize| fields.get(field - 3).and_then(|text| text.parse::<u32>().ok()).unwrap_or(0);
    let mut threads = fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    let wants = threads.any(|thread| {
        let state = fields_of(thread.path().join("stat").display().to_string());
        // Runs or would run; waits for a disk, or for a page.
        state.first().is_some_and(|state| matches!(state.as_str(), "R" | "D"))
    });
    Used { ran: CLOCK_TICK * ticks(14).saturating_add(ticks(15)), wants }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    fn shell(script: &str) -> Child {
        Command::new("sh").args(["-c", script]).spawn().expect("there is a shell")
    }

    #[test]
    fn one_that_runs_and_one_that_sleeps_for_ever_are_ended() {
        for endless in ["while :; do :; done", "exec sleep 600", "kill -STOP $$"] {
            let mut child = shell(endless);
            let outcome = wait(&mut child, Duration::from_millis(100)).expect("it can be ended");
            assert!(outcome.is_none(), "{endless}: {outcome:?}");
        }
    }

    #[test]
    fn one_that_ends_is_waited_for() {
        let outcome = wait(&mut shell("exit 7"), Duration::from_secs(60)).expect("it can be waited for");
        assert_eq!(outcome.and_then(|end| end.status.code()), Some(7));
    }

    #[test]
    fn the_time_of_the_processor_is_told() {
        let script = "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done";
        let outcome = wait(&mut shell(script), Duration::from_secs(60)).expect("it can be waited for");
        let ran = outcome.expect("it ends").ran;
        assert!(ran > Duration::ZERO && ran < Duration::from_secs(60), "{ran:?}");
    }
}
