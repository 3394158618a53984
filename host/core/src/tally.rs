//! Tick statistics of a run for its summary, from the tick records, in constant memory.

use crate::feel::Feel;
use crate::trace::{Events, TickRecord};
use flotor_hal::{DVec3, Demand, GripKind};

/// Tick statistics of a run, from the records of all its ticks.
#[derive(Default)]
pub struct Tally {
    /// Statistics of each device, by number.
    pub devices: Vec<DeviceTally>,
    event_ticks: [u64; Events::NAMES.len()],
    /// Events of the current tick, at any device.
    events: Events,
    generated_peak_j: f64,
    /// Lowest net energy put in by the hands at all ports together, J.
    pub port_lowest_j: f64,
    /// Model outputs that were computed in every tick at every device; `None` before the first tick.
    pub computed: Option<Demand>,
}

/// Tick statistics of one device, from its records.
#[derive(Default)]
pub struct DeviceTally {
    /// Largest commanded force, N.
    pub peak_force_n: f64,
    /// Largest commanded torque, N·m.
    pub peak_torque_nm: f64,
    /// Largest magnitude of the commanded effort at the grip, N or N·m.
    peak_effort: f64,
    last: Option<TickRecord>,
    balance: LoopBalance,
    /// Lowest net energy put in by the hand at the port, J.
    pub port_lowest_j: f64,
    /// Stiffness and settling time that the hand felt.
    pub feel: Feel,
}

impl DeviceTally {
    fn observe(&mut self, record: &TickRecord) {
        self.peak_force_n = self.peak_force_n.max(record.commanded.force().length());
        self.peak_torque_nm = self.peak_torque_nm.max(record.commanded.torque().length());
        let effort = record.grip.map_or(0.0, |grip| grip.commanded.abs());
        self.peak_effort = self.peak_effort.max(effort);
        self.feel.observe(record);
        self.balance.observe(self.last.as_ref(), record);
        self.port_lowest_j = self.port_lowest_j.min(record.port_energy_j);
        self.last = Some(*record);
    }

    /// Returns the largest effort at a grip of this kind; `None` without one.
    #[must_use]
    pub fn peak_effort(&self, kind: GripKind) -> Option<f64> {
        let grip = self.last.as_ref()?.grip?;
        (grip.state.kind() == kind).then_some(self.peak_effort)
    }

    /// Returns the net energy put in by the hand at the port up to the last record, J.
    #[must_use]
    pub fn port_energy_j(&self) -> f64 {
        self.last.as_ref().map_or(0.0, |record| record.port_energy_j)
    }
}

/// Energy that the sampled loop generates at a device: work on the hand beyond the decrease of the energy stored in the models. Known
/// while all model outputs are computed and finite.
#[derive(Default)]
struct LoopBalance {
    /// Energy stored in the models in the first tick, J; `None` if not computed.
    first_energy_j: Option<f64>,
    work_j: f64,
    generated_j: Option<f64>,
}

impl LoopBalance {
    /// Adds the work of the models on the hand from one tick to the next; the wrench of the last tick acts until this tick
    /// (zero-order hold), as at the device.
    fn observe(&mut self, last: Option<&TickRecord>, record: &TickRecord) {
        let energy_j = record.model.energy_j();
        if last.is_none() {
            (self.first_energy_j, self.generated_j) = (energy_j, Some(0.0));
        }
        if let Some(last) = last {
            let moved = record.pose.position() - last.pose.position();
            let turn = record.pose.orientation() * last.pose.orientation().conjugate();
            let turned: DVec3 = flotor_hal::rotation_vector(turn);
            let torque = last.model.torque().unwrap_or(DVec3::NAN);
            self.work_j += last.model.force().dot(moved) + torque.dot(turned);
        }
        let stored = self.first_energy_j.zip(energy_j).filter(|_| self.generated_j.is_some());
        let generated_j = stored.map(|(first_j, now_j)| self.work_j - (first_j - now_j));
        self.generated_j = generated_j.filter(|joule| joule.is_finite());
    }
}

impl Tally {
    /// Returns the number of ticks with each event, at any device.
    #[must_use]
    pub fn event_ticks(&self) -> [u64; Events::NAMES.len()] {
        std::array::from_fn(|bit| self.event_ticks[bit] + u64::from(self.events.bits() >> bit & 1))
    }

    /// Returns the time of the last tick, ns; 0 before the first tick.
    #[must_use]
    pub fn last_ns(&self) -> u64 {
        let last = |device: &DeviceTally| device.last.as_ref().map(|record| record.time_ns);
        self.devices.iter().filter_map(last).max().unwrap_or(0)
    }

    /// Returns the largest energy that the loops of all devices together have generated at any time, J; `None` if it is not known to
    /// the end.
    #[must_use]
    pub fn generated_peak_j(&self) -> Option<f64> {
        let is_known = self.devices.iter().all(|device| device.balance.generated_j.is_some());
        is_known.then_some(self.generated_peak_j)
    }

    /// Returns the largest value over all devices; 0 without a device.
    pub fn largest(&self, number: impl Fn(&DeviceTally) -> f64) -> f64 {
        self.devices.iter().map(number).fold(0.0, f64::max)
    }

    /// Adds the record of a tick at one device: tick after tick, and within a tick device after device. Not real-time.
    pub fn add(&mut self, record: &TickRecord) {
        if record.device == 0 {
            // The previous tick is complete.
            self.event_ticks = self.event_ticks();
            self.events = Events::NONE;
        }
        self.events.insert(record.events);
        let computed = record.model.computed();
        self.computed = Some(self.computed.map_or(computed, |all| all.limited_to(computed)));
        let device = usize::from(record.device);
        if self.devices.len() <= device {
            self.devices.resize_with(device + 1, DeviceTally::default);
        }
        self.devices[device].observe(record);
        if device + 1 == self.devices.len() {
            let generated_j = self.devices.iter().filter_map(|device| device.balance.generated_j).sum();
            self.generated_peak_j = self.generated_peak_j.max(generated_j);
            let port_j = self.devices.iter().map(DeviceTally::port_energy_j).sum();
            self.port_lowest_j = self.port_lowest_j.min(port_j);
        }
    }
}
