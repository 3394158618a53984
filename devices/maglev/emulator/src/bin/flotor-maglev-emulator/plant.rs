//! A device plugin as the plant: the controller takes the role of the host.

use flotor_hal::abi::PluginKind;
use flotor_hal::{Capabilities, Cycle, DeviceState, Fault, LoopConfig, Tick, Wrench};
use flotor_loader::{ActiveDevice, Plugin, Setting, read_metadata};
use flotor_maglev_emulator::Plant;
use flotor_maglev_emulator::controller::Sample;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Id of the default plant plugin, the simulated flotor.
pub(crate) const SIMULATED: &str = "simulated";
/// Period of a cycle in the loop configuration, ns.
const PERIOD_NS: u64 = 1_000_000;

/// Plugin folders, relative to the folder of the program: built by cargo, or installed.
const PLUGIN_FOLDERS: [&str; 4] = ["deps", "", "plugins", "../lib/flotor/plugins"];

/// Loads the plugin of a file, or the simulated flotor from the folders beside this program.
pub(crate) fn load(file: Option<&Path>) -> Result<Plugin, Box<dyn Error>> {
    match file {
        Some(file) => load_file(file),
        None => load_device(SIMULATED),
    }
}

/// Loads the device plugin of this id from the folders beside this program.
pub(crate) fn load_device(id: &str) -> Result<Plugin, Box<dyn Error>> {
    let program = std::env::current_exe()?;
    let own = program.parent().unwrap_or(Path::new("."));
    for folder in PLUGIN_FOLDERS.map(|folder| own.join(folder)) {
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        files.retain(|file| file.extension().is_some_and(|ending| ending == std::env::consts::DLL_EXTENSION));
        files.sort();
        let is_meant = |file: &PathBuf| {
            read_metadata(file).is_ok_and(|found| found.id == id && found.kind == PluginKind::Device)
        };
        if let Some(file) = files.into_iter().find(is_meant) {
            return load_file(&file);
        }
    }
    let folder = own.display();
    Err(format!("no plugin `{id}` in or beside {folder}; name its file with --plant, or build the plugin with `cargo build -p flotor-{id}` (`--release` for target/release)")
        .into())
}

/// Loads a plugin file; runs its code.
#[allow(unsafe_code)] // listed in tests/tests/system/architecture.rs
fn load_file(file: &Path) -> Result<Plugin, Box<dyn Error>> {
    // SAFETY: the user who runs the emulator guarantees the plugin it names, or that lies beside it.
    Ok(unsafe { Plugin::load(file) }?)
}

/// An active device plugin as the plant of the controller.
pub(crate) struct LoadedPlant {
    plugin: Plugin,
    settings: Vec<Setting>,
    seed: u64,
    /// `None` after a failed restart; every sample is then out of range.
    device: Option<ActiveDevice>,
    tick: u64,
    time_ns: u64,
    state: DeviceState,
    /// Own feed-forward minus weight of the moving part, N, and the force sensor; `None` without a sensor.
    sensor: Option<(f64, crate::rig::SensedForce)>,
}

impl LoadedPlant {
    pub(crate) fn open(
        plugin: Plugin,
        settings: Vec<Setting>,
        seed: u64,
    ) -> Result<(Self, Capabilities), Box<dyn Error>> {
        let capabilities = plugin.open_device(&settings)?.capabilities()?;
        let mut plant = Self {
            plugin,
            settings,
            seed,
            device: None,
            tick: 0,
            time_ns: 0,
            state: DeviceState::HOME,
            sensor: None,
        };
        plant.device = Some(plant.activate()?);
        Ok((plant, capabilities))
    }

    /// Attaches a force sensor, which receives the delivered vertical force plus the plant's own feed-forward less the
    /// weight; inertia is neglected.
    pub(crate) fn sense(&mut self, force: crate::rig::SensedForce) -> Result<(), Box<dyn Error>> {
        let mut opened = self.plugin.open_device(&self.settings)?;
        let mut number = |id: &str| {
            let at = opened.parameters().iter().position(|parameter| parameter.id() == id);
            at.map(|at| opened.parameter(at)).ok_or_else(|| {
                format!(
                    "the plugin of --plant has no parameter `{id}`, which --calibration-rig needs; omit \
                 --plant to use the simulated flotor"
                )
            })
        };
        let weight_n = number("mass_kg")? * number("gravity_m_per_s2")?;
        self.sensor = Some((number("feedforward_n")? - weight_n, force));
        Ok(())
    }

    fn activate(&self) -> Result<ActiveDevice, Box<dyn Error>> {
        let config = LoopConfig { period_ns: PERIOD_NS, seed: self.seed };
        let device = self.plugin.open_device(&self.settings)?;
        device.activate(&config).map_err(|(_, refusal)| refusal.into())
    }
}

impl Plant for LoadedPlant {
    fn advance(&mut self, dt_us: u64, wrench: &Wrench) -> Sample {
        let lost = Sample { in_range: false, ..Sample::HOME };
        let Some(device) = &mut self.device else { return lost };
        let dt_ns = dt_us * 1000;
        let written = device.write(&Tick { index: self.tick, time_ns: self.time_ns, dt_ns }, wrench);
        self.tick += 1;
        self.time_ns += dt_ns;
        let tick = Tick { index: self.tick, time_ns: self.time_ns, dt_ns };
        let read = device.read(&tick, &mut self.state);
        if let Some((carried_n, force)) = &self.sensor {
            force.press(self.state.delivered.force().z + carried_n);
        }
        let fault = [written, read].into_iter().find_map(|cycle| match cycle {
            Cycle::Fault(fault) => Some(fault),
            Cycle::Fresh | Cycle::Stale => None,
        });
        Sample {
            pose: self.state.pose,
            twist: self.state.twist,
            in_range: matches!(fault, None | Some(Fault::OverTemperature)),
            too_hot: fault == Some(Fault::OverTemperature),
            buttons: self.state.buttons,
        }
    }

    fn restart(&mut self) {
        (self.tick, self.time_ns, self.state) = (0, 0, DeviceState::HOME);
        self.device = self.activate().ok();
    }
}
