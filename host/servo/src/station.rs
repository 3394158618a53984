//! One device of a loop with its sample check and safety envelope.

use super::envelope::{Envelope, EnvelopeEffects};
use super::port::Port;
use flotor_core::demand::hand_demand;
use flotor_core::grip::GripRecord;
use flotor_core::plausibility::{
    Implausible, ImplausibleSamples, PlausibilityCheck, Trust, normalised, stale_ticks_limit,
};
use flotor_core::run_state::{Cause, Gate, RunEvent};
use flotor_core::trace::Events;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Axes, Capabilities, Conditions, Cycle, Demand, Fault, Tick};
use flotor_loader::ActiveDevice;

/// Timeout for a device that takes no commands, as a multiple of the sample timeout; the last command stays applied meanwhile.
const UNTAKEN_TIMES: u32 = 10;

/// Device with its sample check and safety envelope.
pub struct Station {
    pub(super) device: ActiveDevice,
    pub(super) envelope: Envelope,
    /// Model outputs that reach the hand at this device.
    at_hand: Demand,
    plausibility: PlausibilityCheck,
    /// Tolerated number of consecutive ticks without a usable sample; unlimited for a device that senses nothing.
    stale_ticks_limit: u32,
    stale_ticks: u32,
    untaken_ticks_limit: u32,
    untaken_ticks: u32,
    /// The first fault.
    fault: Option<Fault>,
    /// True if the device itself reported the fault.
    is_own_fault: bool,
}

/// Saved state of a station.
pub(crate) struct SavedStation {
    state: Vec<u8>,
    parameters: Vec<f64>,
    envelope: Envelope,
    plausibility: PlausibilityCheck,
    stale_ticks: u32,
    untaken_ticks: u32,
}

/// Faults, implausible samples and envelope effects of a device in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reported {
    /// First fault, reported by the device or found by the host.
    pub fault: Option<Fault>,
    /// True if the device reported the fault; if the host found it, the counts below give the reason.
    pub is_own_fault: bool,
    /// Counts of the implausible samples of the device by reason, with the tick of the first.
    pub implausible: ImplausibleSamples,
    /// Number of consecutive commands that the device had not taken when the run ended.
    pub untaken: u32,
    /// Effects of the envelope's passivity controller and slew limit.
    pub effects: EnvelopeEffects,
}

impl Reported {
    /// Describes a problem with the samples or commands of the device, for users; `None` without a problem.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        match (self.untaken, self.implausible.first_tick()) {
            (1.., _) => Some(format!("the device has not read the last {} commands", self.untaken)),
            (0, Some(_)) => Some(self.implausible.to_string()),
            (0, None) => None,
        }
    }
}

impl Station {
    /// Creates the station of a device in a loop of `period_ns`; samples are checked against the declared capabilities `told`. Not
    /// real-time.
    pub fn new(device: ActiveDevice, envelope: Envelope, told: &Capabilities, period_ns: u64) -> Self {
        let stale_ticks = stale_ticks_limit(period_ns);
        let [_, torque_nm] = envelope.most();
        let has_samples = told.sensed != Axes::NONE || envelope.grip.is_some();
        Self {
            device,
            envelope,
            at_hand: hand_demand(&torque_nm),
            plausibility: PlausibilityCheck::new(told, period_ns),
            stale_ticks_limit: if has_samples { stale_ticks } else { u32::MAX },
            stale_ticks: 0,
            untaken_ticks_limit: UNTAKEN_TIMES * stale_ticks,
            untaken_ticks: 0,
            fault: None,
            is_own_fault: true,
        }
    }

    /// Saves the state; `None` if the device has none to save, or has failed. Not real-time.
    pub(super) fn save(&mut self) -> Option<SavedStation> {
        let Self { device, envelope, plausibility, stale_ticks, untaken_ticks, fault, .. } = self;
        Some(SavedStation {
            state: fault.is_none().then(|| device.state())??.to_bytes()?,
            parameters: device.parameters(),
            envelope: envelope.clone(),
            plausibility: plausibility.clone(),
            stale_ticks: *stale_ticks,
            untaken_ticks: *untaken_ticks,
        })
    }

    /// Restores a state; `None` if the device refuses the state, or has failed. Not real-time.
    pub(super) fn restore(&mut self, saved: &SavedStation) -> Option<()> {
        let restored = self.fault.is_none().then(|| self.device.state())??.restore(&saved.state);
        for (index, (now, saved)) in self.device.parameters().iter().zip(&saved.parameters).enumerate() {
            if now.to_bits() != saved.to_bits() {
                let _ = self.device.set_parameter(index, *saved);
            }
        }
        let present = self.device.parameters();
        let is_set = present
            .iter()
            .map(|value| value.to_bits())
            .eq(saved.parameters.iter().map(|value| value.to_bits()));
        self.envelope = saved.envelope.clone();
        self.plausibility = saved.plausibility.clone();
        (self.stale_ticks, self.untaken_ticks) = (saved.stale_ticks, saved.untaken_ticks);
        (restored == CallStatus::Ok && is_set).then_some(())
    }

    /// Reads the newest sample into the port, with a normalised orientation, and returns the event for the run state. A stale or
    /// implausible sample does not change the port.
    ///
    /// Real-time: bounded by the device, no allocation.
    #[inline(always)] // in the middle of a tick
    pub(super) fn read(&mut self, tick: &Tick, port: &mut Port) -> RunEvent {
        let last = port.state;
        match self.device.read(tick, &mut port.state) {
            Cycle::Fresh => match self.check(tick, port) {
                Ok(()) => {
                    self.stale_ticks = 0;
                    port.state.pose = normalised(&port.state.pose);
                    if port.state.conditions.contains(Conditions::SATURATED) {
                        port.events.insert(Events::SATURATED);
                    }
                    if port.state.conditions.contains(Conditions::EXCESS_FORCE) {
                        port.events.insert(Events::EXCESS_FORCE);
                    }
                    return self.trust_event(port);
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
        match self.trust_event(port) {
            RunEvent::SamplesBack if self.stale_ticks > self.stale_ticks_limit => RunEvent::SamplesLost,
            RunEvent::SamplesBack => RunEvent::Time,
            withdrawn => withdrawn,
        }
    }

    /// Checks the new sample, with that of a grip.
    #[inline(always)] // in the middle of a tick
    fn check(&mut self, tick: &Tick, port: &mut Port) -> Result<(), Implausible> {
        if self.envelope.grip.is_some() {
            return self.check_with_grip(tick, port);
        }
        self.plausibility.check(tick, &port.state)
    }

    /// Checks the new sample, and reads and checks that of the grip; stores a plausible one in the port.
    #[inline(never)] // few devices have one
    fn check_with_grip(&mut self, tick: &Tick, port: &mut Port) -> Result<(), Implausible> {
        let Some(guard) = &self.envelope.grip else { return self.plausibility.check(tick, &port.state) };
        let grip = guard.check(self.device.read_grip(guard.axis().kind()));
        self.plausibility.check_both(tick, &port.state, grip.map(drop))?;
        port.grip.iter_mut().zip(grip).for_each(|(record, state)| record.state = state);
        Ok(())
    }

    /// Returns the port of the device before the first tick.
    pub(super) fn port(&self) -> Port {
        let mut port = Port::at_rest(self.at_hand);
        port.grip = self.envelope.grip.map(|guard| GripRecord::at(guard.axis().at_rest()));
        port
    }

    /// Returns the run event for the trust in the device; samples that are implausible for too long are a fault.
    #[inline]
    fn trust_event(&mut self, port: &mut Port) -> RunEvent {
        match self.plausibility.trust() {
            Trust::Full => RunEvent::SamplesBack,
            Trust::Withdrawn => RunEvent::SamplesLost,
            Trust::Lost => self.found_faulty(Fault::Protocol, port),
        }
    }

    /// Limits the port's request to the wrench that may be sent. Real-time: bounded, no allocation.
    #[inline(always)] // in the middle of a tick
    pub(super) fn limit(&mut self, tick: &Tick, gate: Gate, port: &mut Port) {
        let Port { state, requested, commanded, grip, events, .. } = port;
        *commanded = self.envelope.apply(requested, gate, state, tick, events);
        if let Some(grip) = grip {
            self.envelope.apply_grip(grip, gate, tick, events);
        }
    }

    /// Sends the command; returns a run event if the device faults or has not taken commands for too long. Real-time: bounded by
    /// the device, no allocation.
    #[inline(always)] // in the middle of a tick
    pub(super) fn write(&mut self, tick: &Tick, port: &mut Port) -> Option<RunEvent> {
        if let Some(grip) = &port.grip
            && !self.device.write_grip(grip.commanded)
        {
            return Some(self.failed(Fault::Broken, port));
        }
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

    /// Returns a report on the device. Real-time: bounded, no allocation.
    pub(super) fn reported(&self) -> Reported {
        Reported {
            fault: self.fault,
            is_own_fault: self.is_own_fault,
            implausible: self.plausibility.found(),
            untaken: self.untaken_ticks,
            effects: self.envelope.effects(),
        }
    }

    /// Records a fault found by the host, not reported by the device.
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
