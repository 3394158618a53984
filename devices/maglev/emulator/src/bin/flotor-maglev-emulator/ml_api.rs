//! Serves the ML API: a flotor on its stator or in a simulated hand, and the server for clients.

use super::{Arguments, TransportOption, listen};
use crate::plant::LoadedPlant;
use crate::stator::{OnStator, Press, Pressed};
use clap::{Args, ValueEnum};
use flotor_emulation::command_line::{say, within};
use flotor_hal::Refusal;
use flotor_maglev::ml_api::PORT;
use flotor_maglev_emulator::ml_api::server::{self, Hub};
use flotor_maglev_emulator::ml_api::{
    Commanders, Controller, ControllerConfig, ForceCommand, InjectedFault, Machine, Silence,
};
use flotor_maglev_emulator::{Pace, Plant};
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Settings for a free Utah flotor at rest on its stator, with the weight compensated only by the controller.
const ON_STATOR: &[(&str, &str)] =
    &[("flotor", "utah"), ("hand", "open"), ("feedforward_n", "0"), ("start_z_mm", "-9.5")];

#[derive(Args)]
#[command(next_help_heading = "ML API")]
pub(crate) struct MlApiArguments {
    /// Serve this device, by the id of its plugin, instead of the emulated device: `--set` sets its parameters; the host's
    /// envelope and watchdog stay active; no effect then: --transport, --link, --pace, --seed, --serial, --once, --hand
    #[arg(long, value_name = "ID", conflicts_with_all = ["faults", "presses", "plant", "calibration_rig"])]
    pub(crate) device: Option<String>,
    /// Recording file of the run with `--device`
    #[arg(long, default_value = "ml-api.mcap", value_name = "FILE")]
    pub(crate) record: std::path::PathBuf,
    /// With --device: watchdog limit of a tick of the host, in ms, 3 to 60000 (default: 100)
    // At least three periods of the host's loop at 1 kHz.
    #[arg(long, requires = "device", value_name = "MS", value_parser = within(3.0, 60_000.0, "ms"))]
    pub(crate) host_watchdog_ms: Option<f64>,
    /// With --device: accept a device without a watchdog of its own, although a kill of this program's control group also ends the
    /// watchdog process, so that no process stops the device (default: refuse)
    #[arg(long, requires = "device")]
    pub(crate) accept_shared_control_group: bool,
    /// Hand that holds the flotor; no effect with --device or --calibration-rig
    #[arg(long, value_enum, default_value = "none", value_name = "WHO")]
    hand: HandOption,
    /// Effect of a force command
    #[arg(long, value_enum, default_value = "replace", value_name = "WHAT")]
    force_command: ForceCommand,
    /// Clients that may command: the first client that sends a command, or all
    #[arg(long, value_enum, default_value = "one", value_name = "WHO")]
    commanders: Commanders,
    /// Reaction to the loss of a client, or of its tick acknowledgements, while the flotor is levitating
    #[arg(long, value_enum, default_value = "land", value_name = "WHAT")]
    on_silence: Silence,
    /// Longest time without an acknowledged tick while a client commands forces and is registered for ticks, in ms,
    /// 1 to 60000
    #[arg(long, default_value_t = 500.0, value_name = "MS", value_parser = within(1.0, 60_000.0, "ms"))]
    watchdog_ms: f64,
    /// Fault to inject, as KIND[@STATE][+MS], like reset@flying+200 (repeatable): silence, half-frame, close, reset, stall,
    /// wrong-length, status=CODE/N (CODE decimal, every Nth call), late-tick, out-of-range, over-temperature, over-current,
    /// over-speed; states landed, taking-off, flying, ticking, landing
    #[arg(long = "fault", value_name = "FAULT")]
    faults: Vec<InjectedFault>,
    /// Press of the left or right button, as left@1.5-2, in s from the start (repeatable)
    #[arg(long = "press", value_name = "BUTTON@FROM-TO")]
    presses: Vec<Press>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum HandOption {
    /// No hand: the flotor lies on the stator, and only the controller compensates its weight
    None,
    /// The simulated hand, configured by the parameters of the simulated flotor; there is no stator
    Simulated,
}

/// Returns the name of a value on the command line.
fn name(value: &impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

impl MlApiArguments {
    /// Returns the settings of a flotor at rest on its stator; none with the simulated hand.
    pub(crate) fn plant_defaults(&self) -> &'static [(&'static str, &'static str)] {
        match self.hand {
            HandOption::None => ON_STATOR,
            HandOption::Simulated => &[],
        }
    }

    /// Returns the parameters of the controller model for `--device`, as TOML.
    pub(crate) fn model_parameters(&self) -> String {
        let (force_command, commanders, on_silence) =
            (name(&self.force_command), name(&self.commanders), name(&self.on_silence));
        let watchdog_ms = self.watchdog_ms;
        format!(
            "force_command = \"{force_command}\"\ncommanders = \"{commanders}\"\non_silence = \"{on_silence}\"\n\
             watchdog_ms = {watchdog_ms:?}\n"
        )
    }

    fn config(&self) -> ControllerConfig {
        ControllerConfig {
            force_command: self.force_command,
            commanders: self.commanders,
            silence: self.on_silence,
            watchdog_s: self.watchdog_ms * 1.0e-3,
            ..ControllerConfig::default()
        }
    }
}

/// Serves clients until the process ends.
pub(crate) fn serve(plant: LoadedPlant, pace: Pace, arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let options = &arguments.ml_api;
    if arguments.once || !matches!(arguments.transport, TransportOption::Tcp) {
        let reason = "the ML API serves any number of clients over TCP; remove --once and --transport";
        return Err(Refusal::parameter(reason).into());
    }
    if options.hand == HandOption::None && arguments.rig.rig().is_none() {
        return run(Pressed::new(OnStator::new(plant), &options.presses), pace, false, arguments);
    }
    run(Pressed::new(plant, &options.presses), pace, pace == Pace::Lockstep, arguments)
}

fn run(
    plant: impl Plant,
    pace: Pace,
    restarts_with_ticks: bool,
    arguments: &Arguments,
) -> Result<(), Box<dyn Error>> {
    let options = &arguments.ml_api;
    let controller = Controller::new(options.config());
    let hub = Arc::new(Hub::new(
        controller,
        options.faults.clone(),
        restarts_with_ticks,
        Box::new(|line| say(&line.to_string())),
    ));
    let mut machine = Machine::new(Arc::clone(&hub), pace, plant);
    server::serve(listen(arguments, PORT)?, hub)?;
    machine.run(&AtomicBool::new(false));
    Ok(())
}
