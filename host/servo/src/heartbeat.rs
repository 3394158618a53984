//! Heartbeat of the loop: one word with the tick and the running code, which other threads read.

use super::clock::{monotonic_ns, sleep_until};
use super::platform::last_stop::TakenSignals;
use flotor_core::{MAX_DEVICES, PluginIndex};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering, fence};

/// Time limit for a command in progress to complete, ns.
const LONGEST_COMMAND_NS: u64 = 1_000_000;
/// Poll interval while a command is in progress, ns.
const COMMAND_LOOK_NS: u64 = 20_000;

/// Code that the loop is running: host code, or a call of a plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Between two ticks.
    Waiting,
    /// Wait for the next sample of a device that sets the pace, by device number.
    DeviceWait(u16),
    /// `read` of a device, by device number.
    DeviceRead(u16),
    /// `step` of a model, by its number in the scene.
    Model(usize),
    /// Code of the host in a tick.
    Host,
    /// `write` of a device, by device number.
    DeviceWrite(u16),
}

impl Place {
    /// First codes: 0 and 1 are waiting and host, then follow waits for devices, reads, writes, and models.
    const FIRST_WAIT: u64 = 2;
    const FIRST_READ: u64 = Self::FIRST_WAIT + MAX_DEVICES as u64;
    const FIRST_WRITE: u64 = Self::FIRST_READ + MAX_DEVICES as u64;
    const FIRST_MODEL: u64 = Self::FIRST_WRITE + MAX_DEVICES as u64;

    /// Returns the running call as text for users.
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

    /// Returns the plugin whose code runs, in a run with this many devices; `None` for code of the host.
    #[must_use]
    pub const fn plugin(self, devices: usize) -> Option<PluginIndex> {
        match self {
            Self::Waiting | Self::Host => None,
            Self::DeviceWait(device) | Self::DeviceRead(device) | Self::DeviceWrite(device) => {
                Some(PluginIndex::of_device(device))
            }
            Self::Model(model) => Some(PluginIndex::of_model(devices, model)),
        }
    }

    /// Returns true for a call of a plugin.
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

/// Heartbeat of the loop, read by the watchdog. Clones share their state.
#[derive(Clone, Debug, Default)]
pub struct Heartbeat {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    /// Code of the place in the low 16 bits, low 48 bits of the tick above.
    beat: AtomicU64,
    /// True once the loop is over: no more beats are due.
    done: AtomicBool,
    /// Beat at which the watchdog stopped the device, plus one; 0: not stopped.
    fired: AtomicU64,
    /// Signals of the host that a plugin blocked, or whose action a plugin replaced, while the loop ran; one bit each.
    taken: AtomicU64,
    /// True once another thread is about to stop the devices: the loop sends no more commands.
    silenced: AtomicBool,
}

/// Number of bits of a beat for the place.
const PLACE_BITS: u32 = 16;
const PLACE_MASK: u64 = (1 << PLACE_BITS) - 1;

impl Heartbeat {
    /// Records the tick and the code that the loop runs next. Real-time: bounded, no allocation.
    #[inline]
    pub fn enter(&self, tick: u64, place: Place) {
        self.shared.beat.store(tick << PLACE_BITS | place.code() & PLACE_MASK, Ordering::Release);
    }

    /// Returns tick and running code of the loop when the watchdog stopped the devices; `None` if the watchdog has not stopped
    /// them. Real-time: bounded, no allocation.
    #[inline]
    pub fn fired_at(&self) -> Option<Stuck> {
        match self.shared.fired.load(Ordering::Acquire) {
            0 => None,
            beat => Some(Stuck::at(beat - 1)),
        }
    }

    /// Marks the loop as ended; the watchdog thread then ends too.
    pub fn finish(&self) {
        self.shared.done.store(true, Ordering::Release);
    }

    /// Prevents further commands of the loop before another thread stops the devices, so that no force follows a stop. Waits for a
    /// command in progress, up to a millisecond. Safe in a signal handler.
    pub(crate) fn silence(&self) {
        self.shared.silenced.store(true, Ordering::Relaxed);
        // The loop records its command, then reads the flag; here the flag is set first, then the record is read: at least one side
        // sees the other's store.
        fence(Ordering::SeqCst);
        let (beat, until_ns) = (self.beat(), monotonic_ns() + LONGEST_COMMAND_NS);
        let commands = matches!(Stuck::at(beat).place, Place::DeviceWrite(_));
        while commands && self.beat() == beat && monotonic_ns() < until_ns {
            sleep_until(monotonic_ns() + COMMAND_LOOK_NS);
        }
    }

    /// Returns true if the loop, which has just recorded a command, must not send the command. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn is_silenced(&self) -> bool {
        fence(Ordering::SeqCst);
        self.shared.silenced.load(Ordering::Relaxed)
    }

    /// Returns the current tick and running code of the loop. Real-time: bounded, no allocation.
    #[must_use]
    pub fn now(&self) -> Stuck {
        Stuck::at(self.beat())
    }

    /// Returns the signals of the host that a plugin blocked, or whose action a plugin replaced, while the loop ran; the watchdog
    /// has restored these signals.
    #[must_use]
    pub fn signals_taken(&self) -> TakenSignals {
        TakenSignals::from_bits(self.shared.taken.load(Ordering::Relaxed))
    }

    /// Adds signals to [`Self::signals_taken`].
    pub(crate) fn add_taken(&self, taken: TakenSignals) {
        self.shared.taken.fetch_or(taken.bits(), Ordering::Relaxed);
    }

    pub(crate) fn is_done(&self) -> bool {
        self.shared.done.load(Ordering::Acquire)
    }

    pub(crate) fn beat(&self) -> u64 {
        self.shared.beat.load(Ordering::Acquire)
    }

    pub(crate) fn fire(&self, beat: u64) {
        self.shared.fired.store(beat + 1, Ordering::Release);
    }
}

/// Snapshot of a loop: current tick and running code, for example when the watchdog found the loop stuck.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stuck {
    /// Index of the tick.
    pub tick: u64,
    /// Running code.
    pub place: Place,
}

impl Stuck {
    const fn at(beat: u64) -> Self {
        Self { tick: beat >> PLACE_BITS, place: Place::from_code(beat & PLACE_MASK) }
    }
}

#[cfg(test)]
mod tests;
