//! Any device for programs written for the Maglev 200: the controller as a force model.
//!
//! The host runs the device, with its envelope, watchdog and recording; this model uses the handle's pose as the flotor's,
//! and the wrench commanded by the clients as its output. A tick of the loop is a servo interval; a command acts from the
//! next tick on.

use super::controller::{Commanders, Controller, ControllerConfig, ForceCommand, Silence};
use super::server::{Hub, serve};
use crate::controller::Sample;
use flotor_emulation::port::{Port, Reach};
use flotor_hal::{
    Choices, ForceModel, GripModel, GripState, Input, LoopConfig, Memory, ModelInfo, Output, Parameter,
    Refusal, Settings, StepStatus, Wrench, choices, export_model,
};
use std::io::ErrorKind;
use std::sync::Arc;

const REACHES: Choices = choices!["this-user", "this-machine", "any-machine"];
const FORCE_COMMANDS: Choices = choices!["replace", "add"];
const COMMANDERS: Choices = choices!["one", "all"];
const SILENCE: Choices = choices!["land", "ignore"];

const SCHEMA: &[Parameter] = &[
    Parameter::text(
        "listen",
        "Address for clients, as host:port (default: none, so that no client connects and the force is zero)",
    ),
    Parameter::choice(
        "reach",
        REACHES,
        0,
        "Programs that may connect: those of this user and of root, of every user of this machine, or of every machine \
         that reaches the address",
    ),
    Parameter::choice(
        "force_command",
        FORCE_COMMANDS,
        0,
        "Effect of a force command: its force replaces the force of the gains, or is added to it",
    ),
    Parameter::choice(
        "commanders",
        COMMANDERS,
        0,
        "Clients that may command: the first client that sends a command, or all",
    ),
    Parameter::choice(
        "on_silence",
        SILENCE,
        0,
        "Reaction to the loss of a client, or of its tick acknowledgements, while the flotor is levitating",
    ),
    Parameter::real(
        "watchdog_ms",
        "ms",
        1.0,
        60_000.0,
        500.0,
        "Longest time without an acknowledged tick while a client commands forces and is registered for ticks",
    ),
    Parameter::real(
        "grasp_n_per_a",
        "N/A",
        -100.0,
        100.0,
        0.0,
        "Effort at the grip of the device for the current of the grasp, in N/A or N·m/A; positive currents open the grip; 0: none",
    ),
];

/// Controller of the Maglev 200 as a force model, with a server for its clients.
pub struct MlApiModel {
    hub: Arc<Hub>,
    listen: Option<String>,
    reach: Reach,
    is_serving: bool,
    values: Vec<f64>,
    period_s: f64,
    /// Last output, repeated while a client's call holds the lock: a step never waits.
    wrench: Wrench,
    /// Effort at the grip for each ampere of the grasp, and the current of the last interval, A.
    grasp_n_per_a: f64,
    grasp_a: f64,
}

impl ForceModel for MlApiModel {
    const INFO: ModelInfo = ModelInfo::new(
        "ml-api",
        "Maglev 200 controller",
        "Programs written for the ML API of the Maglev 200 command the device, over TCP",
    )
    .with_memory(Memory::PathDependent);
    const PARAMETERS: &'static [Parameter] = SCHEMA;

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let config = ControllerConfig {
            force_command: settings.one_of("force_command", [ForceCommand::Replaces, ForceCommand::Adds]),
            commanders: settings.one_of("commanders", [Commanders::One, Commanders::All]),
            silence: settings.one_of("on_silence", [Silence::Lands, Silence::Ignored]),
            watchdog_s: settings.number_or_default("watchdog_ms") * 1.0e-3,
            ..ControllerConfig::default()
        };
        let reaches = [Reach::ThisUser, Reach::ThisMachine, Reach::AnyMachine];
        Ok(Self {
            // No log: a tick must not write lines.
            hub: Arc::new(Hub::new(Controller::new(config), Vec::new(), false, Box::new(|_| ()))),
            listen: settings.text("listen").map(str::to_owned),
            reach: settings.one_of("reach", reaches),
            is_serving: false,
            values: settings.values(),
            period_s: 1.0e-3,
            wrench: Wrench::ZERO,
            grasp_n_per_a: settings.number_or_default("grasp_n_per_a"),
            grasp_a: 0.0,
        })
    }

    fn prepare(&mut self, config: &LoopConfig) -> Result<(), Refusal> {
        self.period_s = config.period_ns as f64 * 1.0e-9;
        let (Some(listen), false) = (&self.listen, self.is_serving) else { return Ok(()) };
        let refused = |error| {
            Refusal::resource(format!(
                "cannot start the server at {listen}: {error}; end other programs of this user, or raise the limit of \
                 its threads"
            ))
        };
        let port = Port::bind(listen, self.reach).map_err(|error| match error.kind() {
            ErrorKind::InvalidInput => Refusal::parameter(error.to_string()),
            _ => Refusal::resource(error.to_string()),
        })?;
        let address = port.address().map_err(refused)?;
        serve(port, Arc::clone(&self.hub)).map_err(refused)?;
        self.is_serving = true;
        println!("listening tcp {address}");
        Ok(())
    }

    /// Runs one servo interval. One system call at most, to wake the threads of the connections.
    fn step(&mut self, input: &Input) -> Output {
        if !(input.pose.is_finite() && input.twist.is_finite()) {
            return Output::new(Wrench::ZERO, f64::NAN, StepStatus::InvalidInput);
        }
        let sample = Sample { pose: input.pose, twist: input.twist, buttons: input.buttons, ..Sample::HOME };
        let dt_s = if input.dt_ns == 0 { self.period_s } else { input.dt_s() };
        if let Some(driven) = self.hub.try_cycle(&sample, dt_s) {
            (self.wrench, self.grasp_a) = driven;
        }
        self.wrench.into()
    }

    fn parameter(&self, index: usize) -> f64 {
        self.values.get(index).copied().unwrap_or(f64::NAN)
    }

    fn reset(&mut self) {
        (self.wrench, self.grasp_a) = (Wrench::ZERO, 0.0);
    }
}

impl GripModel for MlApiModel {
    /// Returns the effort of the current of the grasp. The interface has no opening.
    fn grip(&mut self, _: &Input, _: &GripState) -> f64 {
        self.grasp_n_per_a * self.grasp_a
    }
}

export_model!(MlApiModel, grip);
