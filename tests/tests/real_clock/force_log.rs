//! Force on the hand, as the log of a device has it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Less than a fifth of the force of every run here: there was force.
pub(crate) const FELT_N: f64 = 0.25;
/// How long anything here may take: a machine on which nothing moves for a while is no failure.
const PATIENCE: Duration = Duration::from_secs(30);

/// Force on the hand after each command, N, and when.
#[derive(Clone, Default)]
pub(crate) struct ForceLog(Arc<Mutex<Vec<(Instant, f64)>>>);

impl ForceLog {
    /// Adds the force after a command.
    pub(crate) fn push(&self, force_n: f64) {
        self.log().push((Instant::now(), force_n));
    }

    pub(crate) fn log(&self) -> MutexGuard<'_, Vec<(Instant, f64)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn force_n(&self) -> f64 {
        self.log().last().map_or(0.0, |(_, force_n)| *force_n)
    }

    /// Waits until the host has sent so many commands, and there is force.
    pub(crate) fn wait_for_force(&self, commands: usize) {
        wait_until("there is force", || self.force_n() > FELT_N);
        wait_until("the host sends commands", || self.log().len() > commands);
    }

    /// There was force, and there is none any more: time from the last command with force to the first without.
    pub(crate) fn assert_stopped(&self, what: &str) -> Duration {
        let [felt, stopped] = self.end_of_force(what);
        stopped.duration_since(felt)
    }

    /// The same from another moment.
    pub(crate) fn assert_stopped_since(&self, since: Instant, what: &str) -> Duration {
        let [_, stopped] = self.end_of_force(what);
        stopped.duration_since(since)
    }

    /// The last command with force, and the first without.
    fn end_of_force(&self, what: &str) -> [Instant; 2] {
        wait_until(&format!("{what}: the device is at rest"), || self.force_n() == 0.0);
        let log = self.log();
        let felt = log.iter().rposition(|(_, force_n)| *force_n > 0.0);
        let most_n = log.iter().map(|(_, force_n)| *force_n).fold(0.0, f64::max);
        assert!(most_n > FELT_N, "{what}: there was no force that could be taken away: {most_n} N");
        let felt = felt.expect("there was some");
        [log[felt].0, log[felt + 1].0]
    }
}

/// Looks until it is so.
pub(crate) fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}
