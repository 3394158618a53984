//! Duration of an emergency stop, from its request until each device exerts no force.

use super::latch::LatchGuard;
use flotor_servo::{EmergencySource, StopSwitch, monotonic_ns};
use std::time::{Duration, SystemTime};

/// Longest time from the request until a device exerts no force; a longer time gives a warning.
const BOUND: Duration = Duration::from_millis(20);

/// Timer of the last tick and of the stops of the devices, in the loop's thread.
pub(super) struct StopTimer {
    tick: Duration,
    sent_ns: u64,
    stopped_ns: Vec<u64>,
}

impl StopTimer {
    /// Starts the timer right after the last tick, which took `tick`. Not real-time.
    pub(super) fn start(tick: Duration) -> Self {
        Self { tick, sent_ns: monotonic_ns(), stopped_ns: Vec::new() }
    }

    /// Records the current time for the next device, whose `safe_stop` has returned. Not real-time.
    pub(super) fn stopped(&mut self) {
        self.stopped_ns.push(monotonic_ns());
    }

    /// Returns the parts of the time since the request of the emergency stop. Not real-time: reads the latch.
    pub(super) fn since_request(self, stop: &StopSwitch, latch: Option<&LatchGuard>) -> StopTime {
        let Self { tick, sent_ns, stopped_ns } = self;
        let since = |start_ns: u64, end_ns: u64| Duration::from_nanos(end_ns.saturating_sub(start_ns));
        let seen = stop.pressed_ns().map_or(Duration::ZERO, |pressed_ns| since(pressed_ns, sent_ns));
        // Another run pressed the latch before this run noticed the press.
        let latch = latch.filter(|_| stop.emergency() == Some(EmergencySource::Latch));
        let pressed =
            latch.and_then(LatchGuard::pressed_at).and_then(|at| SystemTime::now().duration_since(at).ok());
        let elsewhere =
            pressed.map_or(Duration::ZERO, |ago| ago.saturating_sub(since(sent_ns, monotonic_ns())));
        let before_the_tick = seen.max(elsewhere).saturating_sub(tick);
        let stops = stopped_ns.into_iter().map(|stopped_ns| since(sent_ns, stopped_ns)).collect();
        StopTime { before_the_tick, tick, stops }
    }
}

/// Duration of an emergency stop, in parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StopTime {
    /// Time from the request to the start of the last tick, which commands no force.
    before_the_tick: Duration,
    /// Duration of the last tick, with the commands to all devices.
    tick: Duration,
    /// Time from the end of the last tick to the end of each device's `safe_stop`, in the scene's order: the device then exerts no
    /// force, even if it has not executed the command of the tick.
    stops: Vec<Duration>,
}

impl StopTime {
    /// Returns the time from the request until a device exerts no force, by the device's number in the scene; `None` if there is no
    /// such device.
    #[must_use]
    pub fn of_device(&self, number: usize) -> Option<Duration> {
        self.stops.get(number).map(|stop| self.before_the_tick + self.tick + *stop)
    }

    /// Returns a warning about devices that may have exerted force for longer than the bound, with the parts of the time; `None`
    /// without such a device. `names` are the names of the devices.
    pub(super) fn warning(&self, names: &[String]) -> Option<String> {
        let ms = |time: Duration| format!("{:.1} ms", time.as_secs_f64() * 1.0e3);
        let late = names.iter().zip(&self.stops).enumerate().filter_map(|(number, (name, stop))| {
            let whole = self.of_device(number).filter(|whole| *whole > BOUND)?;
            Some(format!("`{name}` {} after the request, {} of them in `safe_stop`", ms(whole), ms(*stop)))
        });
        let late: Vec<String> = late.collect();
        (!late.is_empty()).then(|| {
            format!(
                "the emergency stop took longer than {}: zero force at {}; {} passed before the last tick, {} during it",
                ms(BOUND),
                late.join(", "),
                ms(self.before_the_tick),
                ms(self.tick)
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(time_ms: u64) -> Duration {
        Duration::from_millis(time_ms)
    }

    #[test]
    fn a_device_that_has_force_for_longer_than_the_bound_is_named_with_the_parts_of_the_time() {
        let names = ["left", "right"].map(str::to_owned);
        let time = |before: u64, tick: u64, right: u64| StopTime {
            before_the_tick: ms(before),
            tick: ms(tick),
            stops: vec![Duration::ZERO, ms(right)],
        };
        assert_eq!(time(15, 5, 0).warning(&names), None);
        let one = time(15, 5, 4);
        assert_eq!([0, 1, 2].map(|number| one.of_device(number)), [Some(ms(20)), Some(ms(24)), None]);
        let warning = one.warning(&names).unwrap();
        assert!(!warning.contains("`left`"), "{warning}");
        assert!(
            warning.contains("`right` 24.0 ms after the request, 4.0 ms of them in `safe_stop`"),
            "{warning}"
        );
        let both = time(16, 5, 0).warning(&names).unwrap();
        assert!(
            both.contains("`left` 21.0 ms after the request") && both.contains("`right` 21.0 ms"),
            "{both}"
        );
        assert!(both.contains("16.0 ms passed before the last tick, 5.0 ms during it"), "{both}");
    }

    /// A run that another one stops counts from the press of the other.
    #[test]
    fn a_stop_by_the_latch_counts_from_its_press() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = flotor_live::Directory::at(scratch.path().join("runs"));
        let (stop, guard) = (StopSwitch::default(), LatchGuard::of(&directory));
        directory.latch().press("another run").unwrap();
        std::thread::sleep(ms(50));
        stop.press(EmergencySource::Latch);
        let mut timer = StopTimer::start(Duration::ZERO);
        timer.stopped();
        let time = timer.since_request(&stop, Some(&guard));
        assert!(time.of_device(0).unwrap() >= ms(50), "{time:?}");
        assert!(time.warning(&["device".to_owned()]).unwrap().contains("`device`"), "{time:?}");
    }
}
