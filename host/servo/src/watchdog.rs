//! Watchdog: a thread that stops all devices when the loop no longer ticks, and records the tick and the code in which the loop is stuck.
//!
//! The watchdog polls the [heartbeat](Heartbeat) several times per limit. A beat unchanged for longer than the limit means that a
//! call does not return; the watchdog then stops the devices without the loop's help.

use super::clock::{monotonic_ns, sleep_until};
use super::heartbeat::Heartbeat;
use super::last_stop::{SignalGuard, end_dying, is_dying, take_sent};
use super::realtime::enter_guard_priority;
use super::stop::StopSwitch;
use super::watchdog_process::HeartbeatSender;
use flotor_loader::Stopper;
use std::thread::JoinHandle;

/// Number of polls of the watchdog per limit.
const LOOKS: u64 = 8;
/// Longest poll interval, ns: the delay of an emergency stop while the loop is stuck.
const LONGEST_LOOK_NS: u64 = 1_000_000;
/// Number of polls after which a process that is being ended is ended by the watchdog: half a second.
const DYING_LOOKS: u32 = 500;
/// Number of heartbeats for the watchdog process per limit; the timeout there expires when a heartbeat is late by the limit.
const SIGNS_OF_LIFE: u64 = 4;
/// Number of polls between two checks of the host's signals: a tenth of a second.
const SIGNAL_LOOKS: u64 = 100;

/// Starts the watchdog thread: it stops all devices with `stoppers` when `heartbeat` has not changed for `limit_ns`, or when the
/// emergency stop `stop` is triggered. The thread also sends heartbeats (`signs`) to the watchdog process, if there is one, and
/// restores signal actions that a plugin has replaced. The thread ends after [`Heartbeat::finish`], or after a stop of the devices
/// of a stuck loop. Not real-time.
///
/// # Errors
/// If the system cannot start a thread.
pub fn start(
    heartbeat: Heartbeat,
    stoppers: Vec<Stopper>,
    stop: StopSwitch,
    limit_ns: u64,
    signs: Option<HeartbeatSender>,
) -> std::io::Result<JoinHandle<()>> {
    let thread = std::thread::Builder::new().name("flotor-watchdog".to_owned());
    thread.spawn(move || {
        // Above the loop, which may be hogging the core. Best effort without the permission.
        enter_guard_priority();
        take_sent();
        let look_ns = (limit_ns / LOOKS).min(LONGEST_LOOK_NS);
        let sign_ns = limit_ns / SIGNS_OF_LIFE;
        let mut next_sign_ns = 0;
        let mut last = heartbeat.beat();
        let mut changed_ns = monotonic_ns();
        let mut stopped = false;
        let mut dying_looks = 0;
        let signals = SignalGuard::take();
        for look in 1_u64.. {
            if heartbeat.is_done() {
                return;
            }
            if look.is_multiple_of(SIGNAL_LOOKS) {
                heartbeat.add_taken(signals.put_back());
            }
            sleep_until(monotonic_ns() + look_ns);
            if is_dying() {
                dying_looks += 1;
                if dying_looks > DYING_LOOKS {
                    end_dying();
                }
                continue;
            }
            let (beat, now_ns) = (heartbeat.beat(), monotonic_ns());
            if let Some(signs) = &signs
                && now_ns >= next_sign_ns
            {
                signs.give(limit_ns + sign_ns);
                next_sign_ns = now_ns + sign_ns;
            }
            if stop.emergency().is_some() && !stopped {
                heartbeat.silence();
                stoppers.iter().for_each(Stopper::safe_stop);
                stopped = true;
            }
            if beat != last {
                (last, changed_ns) = (beat, now_ns);
            } else if now_ns - changed_ns > limit_ns && !heartbeat.is_done() {
                heartbeat.silence();
                stoppers.iter().for_each(Stopper::safe_stop);
                heartbeat.fire(beat);
                return;
            }
        }
    })
}
