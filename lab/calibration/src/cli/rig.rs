//! Selection of the rig: the simulated one, or a device with a force sensor on a serial port.

use super::refused;
use crate::rig::{DeviceRig, RigOptions, SimulatedRig, Waiting};
use crate::sensor::{ForceSensor, SERIAL_SENSOR};
use clap::{ArgGroup, Args};
use flotor_command::options::{
    ControlGroupOption, KeyValue, PluginPathOption, duration_s, number, seed, settings,
};
use flotor_command::stopping::stop_on_signals;
use flotor_command::{CommandError, Redrawn, note, progress_bar};
use flotor_core::limits::Limits;
use flotor_hal::abi::PluginKind;
use flotor_servo::StopSwitch;
use flotor_session::{LatchGuard, LatchWatch};
use indicatif::ProgressBar;
use std::ops::ControlFlow;
use std::time::Duration;

/// Device plugin of the simulated rig.
const SIMULATED: &str = "simulated";

/// Redraw period of the progress bar and the line below it.
const REDRAWN: Duration = Duration::from_millis(100);

/// Selection of the rig.
#[derive(Args)]
#[command(group = ArgGroup::new("rig").required(true))]
pub(super) struct RigArguments {
    /// Use the simulated flotor in a simulated rig
    #[arg(long, group = "rig")]
    pub(super) simulated: bool,
    /// Use the device of this plugin (id or file), with a force sensor (`--sensor`)
    #[arg(long, value_name = "ID", requires = "sensor", group = "rig")]
    device: Option<String>,
    /// Set a parameter of the device (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE", conflicts_with = "simulated")]
    sets: Vec<KeyValue>,
    /// Serial port of the force sensor
    #[arg(long, value_name = "PORT", conflicts_with = "simulated")]
    sensor: Option<String>,
    /// Plugin of the force sensor (id or file): a device with a parameter `port`
    #[arg(long, value_name = "ID", default_value = SERIAL_SENSOR, conflicts_with = "simulated")]
    sensor_plugin: String,
    /// Set a parameter of the force sensor (repeatable)
    #[arg(long = "sensor-set", value_name = "KEY=VALUE", conflicts_with = "simulated")]
    sensor_sets: Vec<KeyValue>,
    /// Largest distance of the handle from a requested height, in mm
    #[arg(long, value_name = "MM", default_value_t = 0.4, conflicts_with = "simulated", value_parser = number("mm", "length", 0.005..=1.0))]
    tolerance_mm: f64,
    /// Time limit for moving the sensor to the next height
    #[arg(long, value_name = "TIME", default_value = "10min", conflicts_with = "simulated", value_parser = duration_s, allow_hyphen_values = true)]
    patience: f64,
    /// Seed of the noise in the simulated rig
    #[arg(long, value_parser = seed, default_value_t = 1, value_name = "N", conflicts_with = "device")]
    pub(super) seed: u64,
    #[command(flatten)]
    plugin_path: PluginPathOption,
    #[command(flatten)]
    control_group: ControlGroupOption,
}

/// Callback that shows the next height of the sensor; breaks if the user stops the procedure.
pub(super) type Guide = Box<dyn FnMut(Option<Waiting>) -> ControlFlow<()>>;

impl RigArguments {
    pub(super) fn simulated_rig(&self) -> Result<SimulatedRig, CommandError> {
        let registry = self.plugin_path.registry();
        Ok(SimulatedRig::new(registry.load(SIMULATED, PluginKind::Device)?, self.seed))
    }

    /// Opens the device and its sensor; returns the rig with a progress bar of `stops` steps, which shows the next
    /// height of the sensor.
    pub(super) fn device_rig(&self, stops: u64) -> Result<(DeviceRig<Guide>, ProgressBar), CommandError> {
        // Handle signals before a plugin is loaded: a thread that a plugin starts earlier would still receive Ctrl-C.
        let stop = stop_on_signals()?;
        let registry = self.plugin_path.registry();
        let plugin = registry.load(self.device.as_deref().unwrap_or_default(), PluginKind::Device)?;
        let sensor_plugin = registry.load(&self.sensor_plugin, PluginKind::Device)?;
        let device_settings = settings(&plugin, "--set", &self.sets)?;
        if self.sensor_sets.iter().any(|set| set.parameter().key == "port") {
            return Err(CommandError::Usage(
                "--sensor-set port: omit this option; `--sensor PORT` sets the port".to_owned(),
            ));
        }
        let sensor_settings = settings(&sensor_plugin, "--sensor-set", &self.sensor_sets)?;
        let port = self.sensor.as_deref().unwrap_or_default();
        let sensor = ForceSensor::open(&sensor_plugin, port, sensor_settings).map_err(refused)?;
        let mut limits = Limits::default();
        self.control_group.apply(&mut limits);
        let options = RigOptions {
            close_m: self.tolerance_mm * 1.0e-3,
            patience: Duration::from_secs_f64(self.patience),
            limits,
        };
        let progress = progress_bar(stops, "{pos}/{len}  {wide_bar}\n{msg}");
        let latch = LatchGuard::of_this_user();
        latch.warning().iter().for_each(note);
        let guide = guide(&progress, &stop, latch.check_and_watch(&stop)?);
        let rig =
            DeviceRig::open(&plugin, &device_settings, sensor, options, stop, guide).map_err(refused)?;
        rig.warnings().iter().for_each(note);
        Ok((rig, progress))
    }
}

/// Creates the guide. The guide owns the watch of the latch, so that the watch lasts as long as the rig.
fn guide(progress: &ProgressBar, stop: &StopSwitch, watch: LatchWatch) -> Guide {
    let (progress, stop) = (progress.clone(), stop.clone());
    let redrawn = Redrawn::every(REDRAWN, &progress);
    Box::new(move |waiting| {
        let _ = (&watch, &redrawn);
        match waiting {
            Some(Waiting { target_m, height_m, command_n }) => {
                let (target_mm, height_mm) = (target_m * 1.0e3, height_m * 1.0e3);
                let at = if height_mm.is_finite() { format!("{height_mm:.2} mm") } else { "...".to_owned() };
                progress.set_message(format!(
                    "pushing with {command_n} N, handle at {at}; move the sensor to {target_mm:.1} mm"
                ));
            }
            None => progress.set_message("reading"),
        }
        if stop.is_stop_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
}
