//! The simulation as a device plugin.

use crate::fingers::{self, FingerParameters, Fingers};
use crate::machine::{Machine, MachineParameters};
use crate::parameters::{SCHEMA, in_force, live, machine, refuse_idle, setup};
use crate::plant::Wrench;
use crate::sample_clock::SampleClock;
use crate::simulation::{Setup, Simulation};
use crate::validation::InvalidParameter;
use crate::workspace::{
    FORCE_LIMIT_N, ROTATION_RANGE_RAD, STIFFNESS_LIMIT_N_PER_M, SensorRange, TORQUE_LIMIT_NM,
    TRANSLATION_RANGE_M,
};
use flotor_hal::{
    ActiveDevice, ActiveGrip, Axes, CalibrationDevice, Capabilities, Conditions, Cycle, Damper, Device,
    DeviceInfo, DeviceState, EnergyLedger, EnergyLedgerDevice, Fault, GripAxis, GripDevice, GripState,
    IndependentStop, IndependentStopDevice, LoopConfig, PacingDevice, Parameter, Pose, Refusal, Restorable,
    SafeStop, SampleWait, SampledLoop, SetParameterError, Settings, StateBytes, StopFlag, StoppedState, Tick,
    Twist, VerticalCalibration, export_device,
};
use std::time::Duration;

/// Opened device: the parameters are checked, the simulation has not started.
pub struct SimulatedFlotor {
    setup: Setup,
    /// Actuators and sensors between controller and flotor; `None` with preset `plain`.
    machine: Option<MachineParameters>,
    /// `None` for a hand without a grip.
    fingers: Option<FingerParameters>,
    /// Values of all parameters, set or default, in the order of the schema.
    values: Vec<f64>,
    /// Correction of the vertical force; no correction until measured.
    calibration: VerticalCalibration,
    stop: StopFlag,
}

/// Active device: the simulation, with the last commanded wrench.
pub struct RunningFlotor {
    simulation: Simulation,
    machine: Option<Box<Machine>>,
    fingers: Option<Fingers>,
    opened: SimulatedFlotor,
    /// Clock of the samples, for a loop paced by the device.
    samples: SampleClock,
    /// Wrench of the last write, constant until the next one.
    held: Wrench,
    /// True if `held` was limited.
    is_limited: bool,
    /// Height of the latest sample, m, for the correction of the vertical force.
    height_m: f64,
}

/// All but the stop, the clock of the samples, and the settings of the opened phase.
impl Restorable for RunningFlotor {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        let Self { simulation, machine, fingers, opened: _, samples: _, held, is_limited, height_m } = self;
        simulation.pass(bytes);
        machine.iter_mut().for_each(|machine| machine.pass(bytes));
        fingers.iter_mut().for_each(|fingers| fingers.pass(bytes));
        held.pass(bytes);
        is_limited.pass(bytes);
        height_m.pass(bytes);
    }
}

/// Maximum slew rate of the force, N/s: full scale in a millisecond. An estimate; no value is published.
const FORCE_SLEW_N_PER_S: f64 = 55.0e3;
/// Maximum slew rate of the torque, N·m/s: full scale in a millisecond. An estimate; no value is published.
const TORQUE_SLEW_NM_PER_S: f64 = 6.3e3;
/// Period of the device's own controller, s: a loop at its nominal rate.
const NOMINAL_PERIOD_S: f64 = 1.0e-3;
/// Damping of the device's own boundary mode, N·s/m (client program of the University of Utah).
const RENDERED_DAMPING_NS_PER_M: f64 = 15.0;
/// Slowest and fastest rate of the device's controller, Hz (public client of the device's interface).
const RATE_HZ: [f64; 2] = [100.0, 10_000.0];

impl Device for SimulatedFlotor {
    const INFO: DeviceInfo =
        DeviceInfo::new("simulated", "Simulated flotor", "A 580 g levitated flotor held by a simulated hand")
            .simulated();
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Active = RunningFlotor;
    type Stop = StopFlag;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        refuse_idle(settings)?;
        let opened = Self {
            setup: setup(settings)?,
            machine: machine(settings),
            fingers: FingerParameters::of(settings),
            values: settings.values(),
            calibration: VerticalCalibration::NONE,
            stop: StopFlag::default(),
        };
        // Conditions that depend on the tick length are checked again at activation.
        opened.start(opened.setup.tick_ns, 0).map_err(Refusal::parameter)?;
        Ok(opened)
    }

    fn capabilities(&self) -> Capabilities {
        let plain = Capabilities {
            max_force_n: FORCE_LIMIT_N.to_array(),
            max_torque_nm: TORQUE_LIMIT_NM.to_array(),
            rate_hz: RATE_HZ,
            ..Capabilities::driving(Axes::ALL)
                .with_range(TRANSLATION_RANGE_M, ROTATION_RANGE_RAD)
                .with_slew(FORCE_SLEW_N_PER_S, TORQUE_SLEW_NM_PER_S)
                .with_stiffness(self.largest_stiffness_n_per_m(0.0))
        };
        let Some((machine, Ok(limits))) = self.machine.as_ref().map(|machine| (machine, machine.limits()))
        else {
            return plain;
        };
        let latency_s = machine.sensing.latency_ns as f64 * 1.0e-9;
        Capabilities {
            resolution_m: machine.sensing.step_m,
            max_force_n: limits.force_n.to_array(),
            max_torque_nm: limits.torque_nm.to_array(),
            max_stiffness_n_per_m: self.largest_stiffness_n_per_m(latency_s),
            latency_s,
            ..plain
        }
    }

    fn stopper(&self) -> StopFlag {
        self.stop.clone()
    }

    fn activate(self, config: &LoopConfig) -> Result<RunningFlotor, (Self, Refusal)> {
        match self.start(config.period_ns, config.seed) {
            Ok((simulation, machine)) => {
                self.stop.arm();
                let samples = SampleClock::new(config.period_ns);
                Ok(RunningFlotor {
                    simulation,
                    machine,
                    fingers: self.fingers.map(Fingers::new),
                    opened: self,
                    samples,
                    held: Wrench::ZERO,
                    is_limited: false,
                    height_m: 0.0,
                })
            }
            Err(error) => Err((self, Refusal::parameter(error))),
        }
    }

    fn parameter(&self, index: usize) -> f64 {
        in_force(&self.setup, &self.values, index)
    }
}

impl SimulatedFlotor {
    /// Returns the largest stable stiffness with this latency and the damping of the boundary mode in both directions,
    /// at most the published stiffness.
    fn largest_stiffness_n_per_m(&self, latency_s: f64) -> f64 {
        let sampled = SampledLoop { period_s: NOMINAL_PERIOD_S, latency_s };
        let drag_ns_per_m = self.setup.flotor.drag.translational_ns_per_m;
        let stable = sampled.largest_stiffness(drag_ns_per_m, Damper::BothWays(RENDERED_DAMPING_NS_PER_M));
        stable.min(STIFFNESS_LIMIT_N_PER_M)
    }

    /// Creates flotor, hand and machine at time 0.
    fn start(&self, tick_ns: u64, seed: u64) -> Result<(Simulation, Option<Box<Machine>>), InvalidParameter> {
        let setup = Setup { tick_ns, seed, ..self.setup.clone() };
        let machine = |parameters| Machine::new(parameters, &setup.start, seed).map(Box::new);
        let mut simulation = Simulation::new(&setup)?;
        live::begin(&mut simulation, &self.values);
        Ok((simulation, self.machine.as_ref().map(machine).transpose()?))
    }
}

impl CalibrationDevice for SimulatedFlotor {
    fn serial(&self) -> String {
        Self::INFO.id().to_owned()
    }

    fn calibrate_vertical(&mut self, calibration: &VerticalCalibration) -> Result<(), Refusal> {
        if self.machine.is_none() {
            let reason =
                "preset `plain` has an even field, so there is nothing to calibrate; set `preset` to `full`";
            return Err(Refusal::unsupported(reason));
        }
        self.calibration = *calibration;
        Ok(())
    }
}

impl ActiveDevice for RunningFlotor {
    type Opened = SimulatedFlotor;

    /// Moves the flotor under the wrench of the last write and takes a sample.
    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        if let Some(fingers) = &mut self.fingers {
            fingers.advance(tick.dt_ns, self.opened.stop.is_set());
        }
        let coils = if self.opened.stop.is_set() { &Wrench::ZERO } else { &self.held };
        if let Some(machine) = &mut self.machine {
            let cycle = machine.cycle(&mut self.simulation, tick, coils, state);
            self.height_m = state.pose.position().z;
            return cycle;
        }
        let incidents = self.simulation.advance_under(tick.dt_ns, coils);
        let flotor = self.simulation.state();
        *state = DeviceState {
            pose: Pose::new(flotor.position_m, flotor.orientation),
            twist: Twist::new(flotor.velocity_m_per_s, flotor.angular_velocity_rad_per_s),
            delivered: flotor_hal::Wrench::new(coils.force_n, coils.torque_nm),
            sampled_ns: tick.time_ns,
            conditions: if self.is_limited { Conditions::SATURATED } else { Conditions::NONE },
            ..DeviceState::HOME
        };
        let range = SensorRange::of(flotor.position_m, flotor.orientation);
        if incidents.stopped || range == SensorRange::Outside {
            return Cycle::Fault(Fault::SensorOutOfRange);
        }
        Cycle::Fresh
    }

    fn write(&mut self, _tick: &Tick, wrench: &flotor_hal::Wrench) -> Cycle {
        let asked = Wrench { force_n: wrench.force(), torque_nm: wrench.torque() };
        // The host has limited the wrench already; another caller may not have.
        self.held = match (&self.machine, asked.is_finite()) {
            (_, false) => Wrench::ZERO,
            (Some(_), true) => {
                let total_n = asked.force_n;
                let z = self.opened.calibration.command_n(total_n.z, self.height_m);
                Wrench { force_n: total_n.with_z(z), ..asked }
            }
            (None, true) => Wrench {
                force_n: asked.force_n.clamp(-FORCE_LIMIT_N, FORCE_LIMIT_N),
                torque_nm: asked.torque_nm.clamp(-TORQUE_LIMIT_NM, TORQUE_LIMIT_NM),
            },
        };
        self.is_limited = self.machine.is_none() && self.held != asked;
        Cycle::Fresh
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        live::change(&mut self.simulation, index, value)
    }

    fn deactivate(self) -> SimulatedFlotor {
        self.opened
    }
}

impl PacingDevice for RunningFlotor {
    fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait {
        self.samples.wait(Duration::from_nanos(timeout_ns))
    }
}

impl EnergyLedgerDevice for RunningFlotor {
    fn energy_ledger(&self) -> EnergyLedger {
        let ledger = self.simulation.ledger();
        let work = ledger.work();
        EnergyLedger {
            stored_j: ledger.energy().total_j(),
            initial_j: ledger.start().total_j(),
            actuators_j: work.coils_j,
            feedforward_j: work.feed_forward_j,
            hand_j: work.hand_j,
            dissipated_j: work.dissipated_j,
            peak_j: ledger.peak_j(),
        }
    }
}

impl GripDevice for SimulatedFlotor {
    fn grip_axis(&self) -> Option<GripAxis> {
        self.fingers.map(|_| fingers::AXIS)
    }
}

impl ActiveGrip for RunningFlotor {
    fn read_grip(&mut self, state: &mut GripState) {
        if let Some(fingers) = &self.fingers {
            *state = fingers.state();
        }
    }

    fn write_grip(&mut self, effort: f64) {
        if let Some(fingers) = &mut self.fingers {
            fingers.hold(effort);
        }
    }
}

impl IndependentStopDevice for SimulatedFlotor {
    /// Returns a stop to zero force without delay: the simulation is part of the host's process and ends with it.
    fn independent_stop(&self) -> IndependentStop {
        IndependentStop::by_itself(StoppedState::Zero, 0)
    }
}

export_device!(SimulatedFlotor, calibration, pacing, energy_ledger, independent_stop, grip, snapshot);
