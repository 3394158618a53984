//! State of a device in a tick, as Python reads it.

use flotor_core::trace::{Events, TickRecord};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// State of a device in a tick: pose, twist, forces and events. Arrays are copies; SI units, device frame.
#[pyclass(frozen, module = "flotor")]
pub(crate) struct State(TickRecord);

impl State {
    pub(crate) fn of(record: TickRecord) -> Self {
        Self(record)
    }
}

/// Array of a few numbers.
type Numbers<'py> = Bound<'py, PyArray1<f64>>;

#[pymethods]
impl State {
    /// Number of the tick.
    #[getter]
    fn tick(&self) -> u64 {
        self.0.tick
    }

    /// Scheduled time of the tick after the start of the run, ns.
    #[getter]
    fn time_ns(&self) -> u64 {
        self.0.time_ns
    }

    /// Scheduled time of the tick after the start of the run, s.
    #[getter]
    fn time_s(&self) -> f64 {
        self.0.time_ns as f64 * 1.0e-9
    }

    /// Position of the handle, (3,), m.
    #[getter]
    fn position_m<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.0.pose.position_m)
    }

    /// Orientation of the handle, quaternion x, y, z, w, (4,).
    #[getter]
    fn orientation_xyzw<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.0.pose.orientation_xyzw)
    }

    /// Velocity of the handle, (3,), m/s.
    #[getter]
    fn linear_m_per_s<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.0.twist.linear_m_per_s)
    }

    /// Angular velocity of the handle, (3,), rad/s.
    #[getter]
    fn angular_rad_per_s<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.0.twist.angular_rad_per_s)
    }

    /// Force that was sent to the device, after all limits, (3,), N.
    #[getter]
    fn commanded_force_n<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.0.commanded.force_n)
    }

    /// Torque that was sent to the device, after all limits, (3,), N m.
    #[getter]
    fn commanded_torque_nm<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.0.commanded.torque_nm)
    }

    /// Force that the device says it delivered, (3,), N.
    #[getter]
    fn delivered_force_n<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.0.delivered.force_n)
    }

    /// Torque that the device says it delivered, (3,), N m.
    #[getter]
    fn delivered_torque_nm<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.0.delivered.torque_nm)
    }

    /// Sum of the models' forces, before all limits, (3,), N.
    #[getter]
    fn model_force_n<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.0.model.force().to_array())
    }

    /// Sum of the models' torques, before all limits, (3,), N m; None if they were not computed.
    #[getter]
    fn model_torque_nm<'py>(&self, py: Python<'py>) -> Option<Numbers<'py>> {
        self.0.model.torque().map(|torque| PyArray1::from_slice(py, &torque.to_array()))
    }

    /// Net energy that the hand has put in at the port since the start of the run, J.
    #[getter]
    fn port_energy_j(&self) -> f64 {
        self.0.port_energy_j
    }

    /// Pressed buttons, a bit for each.
    #[getter]
    fn buttons(&self) -> u32 {
        self.0.buttons
    }

    /// Opening of the grip, m or rad; None without a grip.
    #[getter]
    fn grip_opening(&self) -> Option<f64> {
        self.0.grip.map(|grip| grip.state.opening)
    }

    /// Names of the events of the tick, in the order of `flotor.EVENTS`.
    #[getter]
    fn events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let bits = self.0.events.bits();
        let names = Events::NAMES.iter().enumerate().filter(|(bit, _)| bits >> bit & 1 == 1);
        PyTuple::new(py, names.map(|(_, name)| *name).collect::<Vec<_>>())
    }

    /// Lateness of the tick, ns; 0 in virtual time.
    #[getter]
    fn lateness_ns(&self) -> u64 {
        self.0.lateness_ns
    }

    fn __repr__(&self) -> String {
        let ([x, y, z], [fx, fy, fz]) =
            (self.0.pose.position_m.map(|metre| metre * 1.0e3), self.0.commanded.force_n);
        let time_s = self.time_s();
        format!(
            "State(tick {}, {time_s:.4} s, position {x:.3} {y:.3} {z:.3} mm, force {fx:.3} {fy:.3} {fz:.3} N)",
            self.0.tick
        )
    }
}
