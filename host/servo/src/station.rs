//! One device of a loop with the envelope that guards it.

use super::envelope::Envelope;
use super::forces::Port;
use super::state::{Cause, Gate, RunEvent};
use flotor_core::trace::Events;
use flotor_hal::abi::loader::ActiveDevice;
use flotor_hal::{Axes, Conditions, Cycle, Fault, Tick};

/// Time without a new sample after which there is no force: what is older than this is not where the hand is. In 10 ms a
/// 10 Hz movement of 5 mm goes 3 mm.
const STALE_LIMIT_NS: u64 = 10_000_000;
/// Samples in a row that may be lost at any rate: one is normal.
const STALE_TICKS_BORNE: u64 = 2;

/// A device, and what nothing gets past on its way there.
pub struct Station {
    pub(super) device: ActiveDevice,
    pub(super) envelope: Envelope,
    /// Stale ticks that are borne; without end where no hand is sensed that could be elsewhere by now.
    stale_ticks_limit: u32,
    stale_ticks: u32,
    /// The first it reported.
    pub(super) fault: Option<Fault>,
}

impl Station {
    /// A device in a loop of this period. Not real-time.
    pub fn new(device: ActiveDevice, envelope: Envelope, sensed: Axes, period_ns: u64) -> Self {
        let stale_ticks_limit = if sensed == Axes::NONE { u32::MAX } else { stale_ticks_limit(period_ns) };
        Self { device, envelope, stale_ticks_limit, stale_ticks: 0, fault: None }
    }

    /// Newest sample into the port; an old one stays, a senseless one is never used. What it means for the run.
    ///
    /// Real-time: bounded by the device, no allocation.
    pub(super) fn read(&mut self, tick: &Tick, port: &mut Port) -> RunEvent {
        let last = port.state;
        match self.device.read(tick, &mut port.state) {
            Cycle::Fresh if port.state.is_finite() => {
                self.stale_ticks = 0;
                if port.state.conditions.contains(Conditions::SATURATED) {
                    port.events.insert(Events::SATURATED);
                }
                if port.state.conditions.contains(Conditions::EXCESS_FORCE) {
                    port.events.insert(Events::EXCESS_FORCE);
                }
                return RunEvent::SamplesBack;
            }
            Cycle::Fresh => port.events.insert(Events::NOT_FINITE),
            Cycle::Stale => port.events.insert(Events::STALE_SAMPLE),
            Cycle::Fault(fault) => {
                port.state = if port.state.is_finite() { port.state } else { last };
                return self.failed(fault, port);
            }
        }
        port.state = last;
        self.stale_ticks = self.stale_ticks.saturating_add(1);
        if self.stale_ticks > self.stale_ticks_limit { RunEvent::SamplesLost } else { RunEvent::Time }
    }

    /// What of the port's request may be sent. Real-time: bounded, no allocation.
    pub(super) fn limit(&mut self, tick: &Tick, gate: Gate, port: &mut Port) {
        let Port { state, requested, commanded, events, .. } = port;
        *commanded = self.envelope.apply(requested, gate, state, tick, events);
    }

    /// Sends it. What it means for the run, if anything. Real-time: bounded by the device, no allocation.
    pub(super) fn write(&mut self, tick: &Tick, port: &mut Port) -> Option<RunEvent> {
        let Cycle::Fault(fault) = self.device.write(tick, &port.commanded) else { return None };
        Some(self.failed(fault, port))
    }

    fn failed(&mut self, fault: Fault, port: &mut Port) -> RunEvent {
        port.events.insert(Events::DEVICE_FAULT);
        self.fault.get_or_insert(fault);
        RunEvent::Failed(Cause::Device(fault))
    }
}

/// Ticks without a new sample that are borne in a loop of this period.
fn stale_ticks_limit(period_ns: u64) -> u32 {
    let ticks = (STALE_LIMIT_NS / period_ns.max(1)).max(STALE_TICKS_BORNE);
    u32::try_from(ticks).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_too_old_after_the_same_time_at_any_rate() {
        assert_eq!(stale_ticks_limit(100_000), 100); // 10 kHz: 10 ms
        assert_eq!(stale_ticks_limit(1_000_000), 10); // 1 kHz: 10 ms
        assert_eq!(stale_ticks_limit(10_000_000), 2); // 100 Hz: two, and no longer
    }
}
