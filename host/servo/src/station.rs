//! One device of a loop, with the check of its samples and the envelope that guards it.

use super::envelope::{Envelope, EnvelopeEffects};
use super::forces::Port;
use super::state::{Cause, Gate, RunEvent};
use flotor_core::demand::felt_within;
use flotor_core::plausibility::{
    Implausible, ImplausibleSamples, PlausibilityCheck, Trust, normalised, stale_ticks_limit,
};
use flotor_core::trace::Events;
use flotor_hal::abi::loader::ActiveDevice;
use flotor_hal::{Axes, Capabilities, Conditions, Cycle, Demand, Fault, Tick};

/// How much longer than samples a device may fail to take commands: what it was told last is on the hand meanwhile.
const UNTAKEN_TIMES: u32 = 10;

/// A device, and what nothing gets past on its way there or back.
pub struct Station {
    pub(super) device: ActiveDevice,
    pub(super) envelope: Envelope,
    /// Outputs of models that reach the hand here.
    pub(super) felt: Demand,
    plausibility: PlausibilityCheck,
    /// Stale ticks that are borne; without end where no hand is sensed that could be elsewhere by now.
    stale_ticks_limit: u32,
    stale_ticks: u32,
    untaken_ticks_limit: u32,
    untaken_ticks: u32,
    /// The first fault.
    fault: Option<Fault>,
    /// Whether the device itself has said so.
    is_own_fault: bool,
}

/// What a run knows of a device beside what the device says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reported {
    /// The first fault, of the device or found by the host.
    pub fault: Option<Fault>,
    /// Whether the device said so itself; if not, the numbers below are the reason.
    pub is_own_fault: bool,
    /// Its samples that cannot be.
    pub implausible: ImplausibleSamples,
    /// Commands in a row that it had not taken at the end.
    pub untaken: u32,
    /// Effects of the envelope's passivity controller and slew limit.
    pub effects: EnvelopeEffects,
}

impl Reported {
    /// What is wrong with its samples or with how it takes commands, for people; nothing if nothing is.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        match (self.untaken, self.implausible.first_tick()) {
            (1.., _) => Some(format!("it has not taken the last {} commands", self.untaken)),
            (0, Some(_)) => Some(self.implausible.to_string()),
            (0, None) => None,
        }
    }
}

impl Station {
    /// A device in a loop of this period. Not real-time.
    pub fn new(device: ActiveDevice, envelope: Envelope, told: &Capabilities, period_ns: u64) -> Self {
        let stale_ticks = stale_ticks_limit(period_ns);
        let [_, torque_nm] = envelope.most();
        Self {
            device,
            envelope,
            felt: felt_within(&torque_nm),
            plausibility: PlausibilityCheck::new(told, period_ns),
            stale_ticks_limit: if told.sensed == Axes::NONE { u32::MAX } else { stale_ticks },
            stale_ticks: 0,
            untaken_ticks_limit: UNTAKEN_TIMES * stale_ticks,
            untaken_ticks: 0,
            fault: None,
            is_own_fault: true,
        }
    }

    /// Reads the newest sample into the port, its orientation normalised, and returns the consequence for the run. A stale or
    /// implausible sample leaves the port as it was.
    ///
    /// Real-time: bounded by the device, no allocation.
    pub(super) fn read(&mut self, tick: &Tick, port: &mut Port) -> RunEvent {
        let last = port.state;
        match self.device.read(tick, &mut port.state) {
            Cycle::Fresh => match self.plausibility.check(tick, &port.state) {
                Ok(()) => {
                    self.stale_ticks = 0;
                    port.state.pose = normalised(&port.state.pose);
                    if port.state.conditions.contains(Conditions::SATURATED) {
                        port.events.insert(Events::SATURATED);
                    }
                    if port.state.conditions.contains(Conditions::EXCESS_FORCE) {
                        port.events.insert(Events::EXCESS_FORCE);
                    }
                    return self.believed(port);
                }
                Err(Implausible::NotFinite) => port.events.insert(Events::NOT_FINITE),
                Err(_) => port.events.insert(Events::IMPLAUSIBLE_SAMPLE),
            },
            Cycle::Stale => port.events.insert(Events::STALE_SAMPLE),
            Cycle::Fault(fault) => {
                port.state = if port.state.is_finite() { port.state } else { last };
                return self.failed(fault, port);
            }
        }
        port.state = last;
        self.stale_ticks = self.stale_ticks.saturating_add(1);
        match self.believed(port) {
            RunEvent::SamplesBack if self.stale_ticks > self.stale_ticks_limit => RunEvent::SamplesLost,
            RunEvent::SamplesBack => RunEvent::Time,
            withdrawn => withdrawn,
        }
    }

    /// What it means for the run how far the device is believed by now.
    #[inline]
    fn believed(&mut self, port: &mut Port) -> RunEvent {
        match self.plausibility.trust() {
            Trust::Full => RunEvent::SamplesBack,
            Trust::Withdrawn => RunEvent::SamplesLost,
            Trust::Lost => self.found_faulty(Fault::Protocol, port),
        }
    }

    /// What of the port's request may be sent. Real-time: bounded, no allocation.
    pub(super) fn limit(&mut self, tick: &Tick, gate: Gate, port: &mut Port) {
        let Port { state, requested, commanded, events, .. } = port;
        *commanded = self.envelope.apply(requested, gate, state, tick, events);
    }

    /// Sends it. What it means for the run, if anything. Real-time: bounded by the device, no allocation.
    pub(super) fn write(&mut self, tick: &Tick, port: &mut Port) -> Option<RunEvent> {
        match self.device.write(tick, &port.commanded) {
            Cycle::Fresh => {
                self.untaken_ticks = 0;
                None
            }
            Cycle::Stale => {
                self.untaken_ticks = self.untaken_ticks.saturating_add(1);
                let is_too_long = self.untaken_ticks > self.untaken_ticks_limit;
                is_too_long.then(|| self.found_faulty(Fault::Timeout, port))
            }
            Cycle::Fault(fault) => Some(self.failed(fault, port)),
        }
    }

    /// What is known of the device. Real-time: bounded, no allocation.
    pub(super) fn reported(&self) -> Reported {
        Reported {
            fault: self.fault,
            is_own_fault: self.is_own_fault,
            implausible: self.plausibility.found(),
            untaken: self.untaken_ticks,
            effects: self.envelope.effects(),
        }
    }

    /// The device has not said that it is faulty, but it is.
    #[inline(never)] // once in a run
    fn found_faulty(&mut self, fault: Fault, port: &mut Port) -> RunEvent {
        self.is_own_fault &= self.fault.is_some();
        self.failed(fault, port)
    }

    fn failed(&mut self, fault: Fault, port: &mut Port) -> RunEvent {
        port.events.insert(Events::DEVICE_FAULT);
        self.fault.get_or_insert(fault);
        RunEvent::Failed(Cause::Device(fault))
    }
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
