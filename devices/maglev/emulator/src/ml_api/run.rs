//! The servo loop: a plant, a controller, a clock.

use super::server::Hub;
use crate::ml_api::server::TickWait;
use crate::{Pace, Plant};
use flotor_hal::Wrench;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Intervals made up for at most after a delay; what is more is lost.
const MADE_UP: u32 = 1000;
/// How long the loop waits in all for clients that answer late, and the share of an interval that it may wait longer for each
/// tick that was answered in time.
const LENIENCE: Duration = Duration::from_millis(30);
const REGAINED_SHARE: u32 = 10;
/// How long a lockstep loop waits for an acknowledgement before it looks whether it is to end.
const LOOK: Duration = Duration::from_millis(50);
/// How long a lockstep loop sleeps where nothing happens.
const NAP: Duration = Duration::from_millis(1);

/// How long the loop may still wait for a late answer. Most machines keep a client from running for some milliseconds now and
/// then: its ticks are made up for instead of dropped. A client that is slow by itself uses this time up once.
struct Lenience(Duration);

impl Lenience {
    /// After an interval of this length whose ticks were taken or not, and what was waited for that beyond its end.
    fn after(&mut self, taken: bool, waited: Duration, period: Duration) {
        let regained = if taken { period / REGAINED_SHARE } else { Duration::ZERO };
        self.0 = (self.0.saturating_sub(waited) + regained).min(LENIENCE);
    }
}

/// A plant under the controller.
pub struct Machine<P> {
    hub: Arc<Hub>,
    plant: P,
    pace: Pace,
    /// Time of the plant so far, s and, rounded, µs.
    now_s: f64,
    now_us: u64,
}

impl<P: Plant> Machine<P> {
    /// A machine at rest.
    pub fn new(hub: Arc<Hub>, pace: Pace, mut plant: P) -> Self {
        hub.observe(&plant.advance(0, &Wrench::ZERO));
        Self { hub, plant, pace, now_s: 0.0, now_us: 0 }
    }

    /// Runs until `stop`.
    pub fn run(&mut self, stop: &AtomicBool) {
        match self.pace {
            Pace::RealTime => self.run_in_real_time(stop),
            Pace::Lockstep => self.run_in_lockstep(stop),
        }
    }

    fn run_in_real_time(&mut self, stop: &AtomicBool) {
        let mut sample = self.plant.advance(0, &Wrench::ZERO);
        let mut deadline = Instant::now();
        let mut made_up = 0;
        let mut lenience = Lenience(LENIENCE);
        while !stop.load(Ordering::Relaxed) {
            let period_s = self.hub.period_s();
            let period = Duration::from_secs_f64(period_s);
            self.hub.begin(&sample, period_s);
            deadline += period;
            let now = Instant::now();
            let due = if let Some(rest) = deadline.checked_duration_since(now) {
                made_up = 0;
                std::thread::sleep(rest);
                Duration::ZERO
            } else if made_up < MADE_UP {
                // Late: the interval is made up for at once, but its tick is given a chance to be answered.
                made_up += 1;
                period
            } else {
                (deadline, made_up) = (now, 0);
                Duration::ZERO
            };
            let began = Instant::now();
            let taken = self.hub.wait_for_ticks_taken(due + lenience.0) == TickWait::Taken;
            lenience.after(taken, began.elapsed().saturating_sub(due), period);
            sample = self.advance(period_s);
        }
    }

    /// An interval for each acknowledged tick. Procedures go on as fast as they can; where nobody waits, time passes slowly.
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
        // A period need not be a whole number of µs: the plant follows within one.
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
    fn a_slow_client_is_waited_for_once_and_a_prompt_one_again() {
        let period = Duration::from_millis(1);
        let mut lenience = Lenience(LENIENCE);
        let mut waited = Duration::ZERO;
        for _ in 0..100 {
            // It takes a second for each tick: all that is left is waited for.
            waited += lenience.0;
            lenience.after(false, lenience.0, period);
        }
        assert_eq!(waited, LENIENCE);
        // Of a prompt one, every hundredth answer comes 8 ms late.
        for tick in 1..=10_000 {
            let late = Duration::from_millis(if tick % 100 == 0 { 8 } else { 0 });
            assert!(late <= lenience.0, "tick {tick}: {:?} are left", lenience.0);
            lenience.after(true, late, period);
        }
    }
}
