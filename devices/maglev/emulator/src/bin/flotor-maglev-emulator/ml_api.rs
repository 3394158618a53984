//! The ML API: a flotor on its stator or in a hand, and the server its clients connect to.

use super::{Arguments, TransportOption, listen};
use crate::plant::LoadedPlant;
use crate::stator::{OnStator, Press, Pressed};
use clap::{Args, ValueEnum};
use flotor_emulation::command_line::{say, within};
use flotor_hal::Refusal;
use flotor_maglev::ml_api::PORT;
use flotor_maglev_emulator::ml_api::server::Hub;
use flotor_maglev_emulator::ml_api::{
    Commanders, Controller, ControllerConfig, ForceCommand, Machine, Misbehavior, Server, Silence,
};
use flotor_maglev_emulator::{Pace, Plant};
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A flotor of the Utah device that nobody holds, at rest on its stator, whose weight nothing but the controller carries.
const ON_STATOR: &[(&str, &str)] =
    &[("flotor", "utah"), ("hand", "open"), ("feedforward_n", "0"), ("start_z_mm", "-9.5")];

#[derive(Args)]
#[command(next_help_heading = "ML API")]
pub(crate) struct MlApiArguments {
    /// Serve this device, by the id of its plugin, instead of the emulated one: `--set` is for its parameters, the host's
    /// envelope and watchdog stay in between
    #[arg(long, value_name = "ID", conflicts_with_all = ["faults", "presses", "plant", "calibration_rig"])]
    pub(crate) device: Option<String>,
    /// Recording of a device that is served
    #[arg(long, default_value = "ml-api.mcap", value_name = "FILE")]
    pub(crate) record: std::path::PathBuf,
    /// Longest time of a tick of the host that serves a device, in ms (default: that of every run)
    #[arg(long, requires = "device", value_name = "MS", value_parser = watchdog_ms)]
    pub(crate) host_watchdog_ms: Option<f64>,
    /// Run although a kill of this program's control group ends the watchdog process with it, which alone stops a device then
    #[arg(long, requires = "device")]
    pub(crate) accept_shared_control_group: bool,
    /// Who holds the flotor at the start
    #[arg(long, value_enum, default_value = "none", value_name = "WHO")]
    hand: HandOption,
    /// What a force command does to the gains
    #[arg(long, value_enum, default_value = "replace", value_name = "WHAT")]
    force_command: ForceOption,
    /// Who may command: the first client that does, or all
    #[arg(long, value_enum, default_value = "one", value_name = "WHO")]
    commanders: CommandersOption,
    /// What becomes of a flotor in the air whose client is gone or acknowledges no tick
    #[arg(long, value_enum, default_value = "land", value_name = "WHAT")]
    on_silence: SilenceOption,
    /// Longest time without an acknowledged tick while a client drives by forces and wants ticks, in ms
    #[arg(long, default_value_t = 500.0, value_name = "MS", value_parser = watchdog_ms)]
    watchdog_ms: f64,
    /// What goes wrong, as KIND[@STATE][+MS], like reset@flying+200 (repeatable): silence, half-frame, close, reset, stall,
    /// wrong-length, status=CODE/N (every Nth call), late-tick, out-of-range, over-temperature, over-current, over-speed;
    /// states landed, taking-off, flying, ticking, landing
    #[arg(long = "fault", value_name = "FAULT")]
    faults: Vec<Misbehavior>,
    /// When a button is pressed, as left@1.5-2, in s from the start (repeatable)
    #[arg(long = "press", value_name = "BUTTON@FROM-TO")]
    presses: Vec<Press>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum HandOption {
    /// Nobody: it lies on the stator, and nothing but the controller carries its weight
    None,
    /// The simulated hand, as the parameters of the simulated flotor say; there is no stator
    Simulated,
}

#[derive(Clone, Copy, ValueEnum)]
enum ForceOption {
    /// It takes their place
    Replace,
    /// It comes on top of them
    Add,
}

#[derive(Clone, Copy, ValueEnum)]
enum CommandersOption {
    One,
    All,
}

#[derive(Clone, Copy, ValueEnum)]
enum SilenceOption {
    /// It lands
    Land,
    /// It stays where it is
    Ignore,
}

fn watchdog_ms(text: &str) -> Result<f64, String> {
    within(text, 1.0, 60_000.0, "ms")
}

impl MlApiArguments {
    /// Settings of the plant unless others are given.
    pub(crate) fn plant_defaults(&self) -> &'static [(&'static str, &'static str)] {
        match self.hand {
            HandOption::None => ON_STATOR,
            HandOption::Simulated => &[],
        }
    }

    /// Parameters of the model that is the controller of a device that is served.
    pub(crate) fn model_parameters(&self) -> String {
        let force_command = if matches!(self.force_command, ForceOption::Add) { "add" } else { "replace" };
        let commanders = if matches!(self.commanders, CommandersOption::All) { "all" } else { "one" };
        let on_silence = if matches!(self.on_silence, SilenceOption::Ignore) { "ignore" } else { "land" };
        let watchdog_ms = self.watchdog_ms;
        format!(
            "force_command = \"{force_command}\"\ncommanders = \"{commanders}\"\non_silence = \"{on_silence}\"\n\
             watchdog_ms = {watchdog_ms:?}\n"
        )
    }

    fn config(&self) -> ControllerConfig {
        ControllerConfig {
            force_command: match self.force_command {
                ForceOption::Replace => ForceCommand::Replaces,
                ForceOption::Add => ForceCommand::Adds,
            },
            commanders: match self.commanders {
                CommandersOption::One => Commanders::One,
                CommandersOption::All => Commanders::All,
            },
            silence: match self.on_silence {
                SilenceOption::Land => Silence::Lands,
                SilenceOption::Ignore => Silence::Ignored,
            },
            watchdog_s: self.watchdog_ms * 1.0e-3,
            ..ControllerConfig::DEFAULT
        }
    }
}

/// Serves until the process is ended.
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
    let _server = Server::start(listen(arguments, PORT)?, hub)?;
    machine.run(&AtomicBool::new(false));
    Ok(())
}
