//! The servo loop over a plant, a controller and a clock.

use super::server::Hub;
use crate::ml_api::server::TickWait;
use crate::{Pace, Plant};
use flotor_hal::Wrench;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest delay to catch up; any excess is dropped.
const MADE_UP: Duration = Duration::from_secs(1);
/// Longest delay of the loop caused by waiting for slow clients.
const LENIENCE: Duration = Duration::from_millis(60);
/// Poll interval of a lockstep loop for its stop flag, while waiting for an acknowledgement.
const LOOK: Duration = Duration::from_millis(50);
/// Period of a lockstep loop without clients.
const NAP: Duration = Duration::from_millis(1);

/// Returns the timeout for tick acknowledgements, for the present delay of the loop and its period. Most machines suspend a client
/// for some milliseconds now and then: the loop is delayed as well and catches up later. Beyond [`LENIENCE`] the loop catches up
/// without waiting for slow clients, and still waits half a period for all other clients.
fn patience(late: Duration, period: Duration) -> Duration {
    LENIENCE.saturating_sub(late).max(period / 2)
}

/// Servo loop of the controller over a plant.
pub struct Machine<P> {
    hub: Arc<Hub>,
    plant: P,
    pace: Pace,
    /// Time of the plant, s, and rounded to µs.
    now_s: f64,
    now_us: u64,
}

impl<P: Plant> Machine<P> {
    /// Creates the loop and passes the first sample of the plant to the controller.
    pub fn new(hub: Arc<Hub>, pace: Pace, mut plant: P) -> Self {
        hub.observe(&plant.advance(0, &Wrench::ZERO));
        Self { hub, plant, pace, now_s: 0.0, now_us: 0 }
    }

    /// Runs the servo loop until `stop`.
    pub fn run(&mut self, stop: &AtomicBool) {
        match self.pace {
            Pace::RealTime => self.run_in_real_time(stop),
            Pace::Lockstep => self.run_in_lockstep(stop),
        }
    }

    fn run_in_real_time(&mut self, stop: &AtomicBool) {
        let mut sample = self.plant.advance(0, &Wrench::ZERO);
        let mut deadline = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            let period_s = self.hub.period_s();
            let period = Duration::from_secs_f64(period_s);
            self.hub.begin(&sample, period_s);
            deadline += period;
            std::thread::sleep(deadline.saturating_duration_since(Instant::now()));
            let now = Instant::now();
            if now.saturating_duration_since(deadline) > MADE_UP {
                deadline = now;
            }
            let _ = self.hub.wait_for_ticks_taken(patience(now.saturating_duration_since(deadline), period));
            sample = self.advance(period_s);
        }
    }

    /// Runs an interval per acknowledged tick. Procedures run as fast as possible; without clients time passes slowly.
    fn run_in_lockstep(&mut self, stop: &AtomicBool) {
        let mut sample = self.plant.advance(0, &Wrench::ZERO);
        while !stop.load(Ordering::Relaxed) {
            if self.hub.takes_restart() {
                self.plant.restart();
                (self.now_s, self.now_us) = (0.0, 0);
                sample = self.plant.advance(0, &Wrench::ZERO);
            }
            let period_s = self.hub.period_s();
            self.hub.begin(&sample, period_s);
            loop {
                match self.hub.wait_for_ticks_taken(LOOK) {
                    TickWait::Busy | TickWait::Taken => break,
                    TickWait::Unwanted => {
                        std::thread::sleep(NAP);
                        break;
                    }
                    TickWait::Open if stop.load(Ordering::Relaxed) => return,
                    TickWait::Open => {}
                }
            }
            sample = self.advance(period_s);
        }
    }

    fn advance(&mut self, period_s: f64) -> crate::controller::Sample {
        let wrench = self.hub.drive(period_s);
        self.now_s += period_s;
        // A period need not be a whole number of µs: the time of the plant is accurate to 1 µs.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a time, positive
        let until_us = (self.now_s * 1.0e6).round() as u64;
        let dt_us = until_us - self.now_us;
        self.now_us = until_us;
        self.plant.advance(dt_us, &wrench)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_that_does_not_answer_delays_the_loop_by_the_lenience_and_no_more() {
        let period = Duration::from_millis(1);
        // From a loop in time, and from one that is half a second late.
        for late in [Duration::ZERO, Duration::from_millis(500)] {
            let mut late = late;
            for _ in 0..1000 {
                late += patience(late, period);
                late = late.saturating_sub(period);
            }
            assert!(late <= LENIENCE && late >= LENIENCE - 2 * period, "{late:?}");
        }
    }
}
