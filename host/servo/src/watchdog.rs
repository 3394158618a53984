//! The watchdog: a thread that stops all devices when the loop no longer ticks, and says where it got stuck.
//!
//! The loop leaves a heartbeat, one word that says which tick it is in and whose code is running. The watchdog
//! looks at it a few times per limit. A word that stays the same for longer than the limit means that somebody
//! does not come back; the devices are then stopped from here, without the loop's help.

use super::clock::{monotonic_ns, sleep_until};
use super::last_stop::{SignalGuard, TakenSignals, end_dying, is_dying, take_sent};
use super::realtime::enter_guard_priority;
use super::stop::StopSwitch;
use super::watchdog_process::SignOfLife;
use flotor_core::MOST_DEVICES;
use flotor_hal::abi::loader::Stopper;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering, fence};
use std::thread::JoinHandle;

/// Whose code the loop is running.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Between two ticks.
    Waiting,
    /// The wait for the next sample of a device that sets the pace, by its number.
    DeviceWait(u16),
    /// The `read` of a device, by its number.
    DeviceRead(u16),
    /// A model's `step`, by its place in the scene.
    Model(usize),
    /// The host's own code.
    Host,
    /// The `write` of a device, by its number.
    DeviceWrite(u16),
}

impl Place {
    /// Codes: 0 and 1, the waits for devices, their reads, their writes, the models.
    const FIRST_WAIT: u64 = 2;
    const FIRST_READ: u64 = Self::FIRST_WAIT + MOST_DEVICES as u64;
    const FIRST_WRITE: u64 = Self::FIRST_READ + MOST_DEVICES as u64;
    const FIRST_MODEL: u64 = Self::FIRST_WRITE + MOST_DEVICES as u64;

    /// The call that runs there, for people.
    #[must_use]
    pub const fn call(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::DeviceWait(_) => "`wait_for_sample`",
            Self::DeviceRead(_) => "`read`",
            Self::Model(_) => "`step`",
            Self::Host => "the tick",
            Self::DeviceWrite(_) => "`write`",
        }
    }

    /// Whether the code that runs there is a plugin's.
    pub(crate) const fn is_a_plugins(self) -> bool {
        !matches!(self, Self::Waiting | Self::Host)
    }

    #[inline]
    const fn code(self) -> u64 {
        match self {
            Self::Waiting => 0,
            Self::Host => 1,
            Self::DeviceWait(device) => Self::FIRST_WAIT + device as u64,
            Self::DeviceRead(device) => Self::FIRST_READ + device as u64,
            Self::DeviceWrite(device) => Self::FIRST_WRITE + device as u64,
            Self::Model(index) => Self::FIRST_MODEL + index as u64,
        }
    }

    #[allow(clippy::cast_possible_truncation)] // numbers that fitted before
    const fn from_code(code: u64) -> Self {
        match code {
            0 => Self::Waiting,
            1 => Self::Host,
            wait @ Self::FIRST_WAIT..Self::FIRST_READ => Self::DeviceWait((wait - Self::FIRST_WAIT) as u16),
            read @ Self::FIRST_READ..Self::FIRST_WRITE => Self::DeviceRead((read - Self::FIRST_READ) as u16),
            write @ Self::FIRST_WRITE..Self::FIRST_MODEL => {
                Self::DeviceWrite((write - Self::FIRST_WRITE) as u16)
            }
            model => Self::Model((model - Self::FIRST_MODEL) as usize),
        }
    }
}

/// What the loop leaves for the watchdog. Clones are the same heart.
#[derive(Clone, Debug, Default)]
pub struct Heartbeat {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    /// Low 48 bits of the tick above 16 bits of the place.
    beat: AtomicU64,
    /// The loop is over: no more beats are due.
    done: AtomicBool,
    /// The beat at which the watchdog stopped the device, plus one; 0 if it has not.
    bitten: AtomicU64,
    /// Signals of the host that were taken away while the loop ran, one bit each.
    taken: AtomicU64,
    /// Another thread stops the devices: the loop commands nothing any more.
    silenced: AtomicBool,
}

/// Bits of a beat that tell the place.
const PLACE_BITS: u32 = 16;
const PLACE_MASK: u64 = (1 << PLACE_BITS) - 1;

impl Heartbeat {
    /// Notes whose code runs next. Real-time: bounded, no allocation.
    #[inline]
    pub fn enter(&self, tick: u64, place: Place) {
        self.shared.beat.store(tick << PLACE_BITS | place.code() & PLACE_MASK, Ordering::Release);
    }

    /// Where the loop was when the watchdog stopped the device, if it has. Real-time: bounded, no allocation.
    #[inline]
    pub fn bitten(&self) -> Option<Stuck> {
        match self.shared.bitten.load(Ordering::Acquire) {
            0 => None,
            beat => Some(Stuck::at(beat - 1)),
        }
    }

    /// Tells the watchdog that the loop is over.
    pub fn finish(&self) {
        self.shared.done.store(true, Ordering::Release);
    }

    /// Whoever stops the devices from another thread calls this before: the loop commands nothing from now on, so that no force comes
    /// after a stop. Waits for a command that is under way, but not for one that hangs. Safe in a signal handler.
    pub(crate) fn silence(&self) {
        self.shared.silenced.store(true, Ordering::Relaxed);
        // The loop notes that it commands, then looks; here it is the other way round: one of both sees the other.
        fence(Ordering::SeqCst);
        let (beat, until_ns) = (self.beat(), monotonic_ns() + LONGEST_COMMAND_NS);
        let commands = matches!(Stuck::at(beat).place, Place::DeviceWrite(_));
        while commands && self.beat() == beat && monotonic_ns() < until_ns {
            sleep_until(monotonic_ns() + COMMAND_LOOK_NS);
        }
    }

    /// Whether the loop, which has just noted that it commands, may not do so. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn is_silenced(&self) -> bool {
        fence(Ordering::SeqCst);
        self.shared.silenced.load(Ordering::Relaxed)
    }

    /// Where the loop is. Real-time: bounded, no allocation.
    #[must_use]
    pub fn now(&self) -> Stuck {
        Stuck::at(self.beat())
    }

    /// Signals that a plugin took away from the host while the loop ran, and that the watchdog has taken back.
    #[must_use]
    pub fn signals_taken(&self) -> TakenSignals {
        TakenSignals::from_bits(self.shared.taken.load(Ordering::Relaxed))
    }

    pub(crate) fn is_done(&self) -> bool {
        self.shared.done.load(Ordering::Acquire)
    }

    fn beat(&self) -> u64 {
        self.shared.beat.load(Ordering::Acquire)
    }

    fn bite(&self, beat: u64) {
        self.shared.bitten.store(beat + 1, Ordering::Release);
    }
}

/// Where a loop got stuck.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stuck {
    /// In which tick.
    pub tick: u64,
    /// In whose code.
    pub place: Place,
}

impl Stuck {
    const fn at(beat: u64) -> Self {
        Self { tick: beat >> PLACE_BITS, place: Place::from_code(beat & PLACE_MASK) }
    }
}

/// How often the watchdog looks within its limit.
const LOOKS: u64 = 8;
/// Longest time between two looks, ns: an emergency stop is passed on within it even if the loop is stuck.
const LONGEST_LOOK_NS: u64 = 1_000_000;
/// Longest time a command to a device that does not hang takes, and the time between two looks at it, ns.
const LONGEST_COMMAND_NS: u64 = 1_000_000;
const COMMAND_LOOK_NS: u64 = 20_000;
/// Looks for which a process may be dying: half a second.
const DYING_LOOKS: u32 = 500;
/// Signs of life for the watchdog process within the limit: its patience ends when one is late by the limit.
const SIGNS_OF_LIFE: u64 = 4;
/// Looks between two at whether the signals are still the host's: a tenth of a second.
const SIGNAL_LOOKS: u64 = 100;

/// Starts the watchdog's thread: the `stoppers` of all devices are used when `heart` has not changed for `limit_ns`, or when the
/// emergency stop is pressed. As long as the thread runs it gives the watchdog process, if there is one, `signs` of life. Not
/// real-time; ends with [`Heartbeat::finish`].
///
/// # Errors
/// What the system says if there can be no further thread.
pub fn start(
    heart: Heartbeat,
    stoppers: Vec<Stopper>,
    stop: StopSwitch,
    limit_ns: u64,
    signs: Option<SignOfLife>,
) -> std::io::Result<JoinHandle<()>> {
    let thread = std::thread::Builder::new().name("flotor-watchdog".to_owned());
    thread.spawn(move || {
        // Above the loop, which may be what hogs the core. Without the right to it, best effort.
        enter_guard_priority();
        take_sent();
        let look_ns = (limit_ns / LOOKS).min(LONGEST_LOOK_NS);
        let sign_ns = limit_ns / SIGNS_OF_LIFE;
        let mut next_sign_ns = 0;
        let mut last = heart.beat();
        let mut changed_ns = monotonic_ns();
        let mut stopped = false;
        let mut dying_looks = 0;
        let signals = SignalGuard::take();
        for look in 1_u64.. {
            if heart.is_done() {
                return;
            }
            if look.is_multiple_of(SIGNAL_LOOKS) {
                heart.shared.taken.fetch_or(signals.put_back().bits(), Ordering::Relaxed);
            }
            sleep_until(monotonic_ns() + look_ns);
            if is_dying() {
                dying_looks += 1;
                if dying_looks > DYING_LOOKS {
                    end_dying();
                }
                continue;
            }
            let (beat, now_ns) = (heart.beat(), monotonic_ns());
            if let Some(signs) = &signs
                && now_ns >= next_sign_ns
            {
                signs.give(limit_ns + sign_ns);
                next_sign_ns = now_ns + sign_ns;
            }
            if stop.emergency().is_some() && !stopped {
                heart.silence();
                stoppers.iter().for_each(Stopper::safe_stop);
                stopped = true;
            }
            if beat != last {
                (last, changed_ns) = (beat, now_ns);
            } else if now_ns - changed_ns > limit_ns && !heart.is_done() {
                heart.silence();
                stoppers.iter().for_each(Stopper::safe_stop);
                heart.bite(beat);
                return;
            }
        }
    })
}

#[cfg(test)]
mod tests;
