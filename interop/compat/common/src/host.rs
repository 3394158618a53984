//! The single run of a process: prepared at the first access, started by the first open device, ended with the program.

use crate::process::{at_end, guarded, is_copy, is_first, library, notice_copies, quietly};
use crate::run::{LockstepRun, Prepared, is_emergency_stopped, report_line, report_no_thread};
use crate::settings::{Pace, Settings, SharedControlGroup, env_value};
use crate::station::{Station, Turn};
use flotor_servo::{Clock, StopSwitch, guest, monotonic_ns};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{RunOptions, Session, program};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, Once, OnceLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Scene for programs without `FLOTOR_SCENE`.
const SCENE: &str = include_str!("../scene.toml");
/// Duration of a run, s: a year, practically unlimited, as the run ends with the program.
const NO_END_S: f64 = 31_536_000.0;
/// Timeout for the first tick of all devices.
const BEGIN: Duration = Duration::from_secs(10);
/// Timeout for the end of the run, during which force fades out and plugins close their devices.
const END: Duration = Duration::from_secs(20);
/// Poll interval while waiting for the first ticks, and for the end.
const LOOK: Duration = Duration::from_millis(1);
/// Number of reads without a command after which lockstep executes a tick: far more than a program's loop has between commands.
const READS_OF_A_TICK: u64 = 100;

static HOST: OnceLock<Option<Host>> = OnceLock::new();

/// Returns the run of this process, preparing the scene at the first call; `None` in a forked copy of the process, or if the scene
/// cannot be run, which is reported once. Not real-time.
#[must_use]
pub fn host() -> Option<&'static Host> {
    if is_copy() {
        return None;
    }
    let prepare = || {
        let prepare = || Host::prepare(Settings::from_environment()?, &StopSwitch::default());
        let panicked =
            "internal error: the preparation of the run panicked; please report this error with the scene";
        let prepared = guarded(Err(panicked.to_owned()), || quietly(prepare));
        prepared.map_err(|problem| report_line(&problem)).ok()
    };
    HOST.get_or_init(prepare).as_ref()
}

/// Prepares the run of this process with given settings instead of the environment's; `stop` ends the run. Call this function once,
/// before [`host`]. Not real-time.
///
/// # Errors
/// One line: the reason why the scene cannot be run, or that this process has already prepared a run.
pub fn prepare(settings: Settings, stop: &StopSwitch) -> Result<&'static Host, String> {
    let second = || "this process has already prepared a run, or failed to; start another process".to_owned();
    if HOST.get().is_some() {
        return Err(second());
    }
    let prepared = Host::prepare(settings, stop)?;
    HOST.set(Some(prepared)).map_err(|_| second())?;
    HOST.get().and_then(Option::as_ref).ok_or_else(second)
}

/// Returns the run of this process, if prepared already. Not real-time.
fn host_so_far() -> Option<&'static Host> {
    if is_copy() { None } else { HOST.get()?.as_ref() }
}

/// Returns the devices of this process's run; empty without one.
fn stations_so_far() -> &'static [Station] {
    host_so_far().map_or(&[], Host::stations)
}

/// Run of this process, with its devices and its pace.
pub struct Host {
    stations: Vec<Station>,
    pace: Pace,
    period_ns: u64,
    stop: StopSwitch,
    stage: Mutex<Stage>,
    /// Number of the program's reads since the last tick.
    reads: AtomicU64,
}

/// Stage of the run.
enum Stage {
    Prepared(Box<Prepared>),
    Beside(JoinHandle<()>),
    Lockstep(Box<LockstepRun>),
    Over,
}

impl Stage {
    fn is_running(&self) -> bool {
        match self {
            Self::Lockstep(_) => true,
            Self::Beside(thread) => !thread.is_finished(),
            Self::Prepared(_) | Self::Over => false,
        }
    }
}

impl Host {
    fn prepare(mut settings: Settings, stop: &StopSwitch) -> Result<Self, String> {
        if !is_first() {
            settings.add_suffix(library().as_deref().and_then(Path::file_stem).unwrap_or_default());
        }
        if let Some(folder) = env_value("FLOTOR_PROCESSES") {
            settings.keep_processes_apart(Path::new(&folder));
        }
        let folder = library().and_then(|file| file.parent().map(Path::to_path_buf)).unwrap_or_default();
        guest::be_guest(settings.signals, executable(&folder));
        let scene = match &settings.scene {
            Some(path) => Scene::load(path),
            None => Scene::parse(Path::new("built-in scene of programs"), SCENE),
        };
        let mut scene = scene.map_err(|error| error.to_string())?;
        scene.plugin_folders.splice(0..0, settings.plugin_folders.iter().cloned());
        scene.plugin_folders.extend(plugin_folders(&folder));
        scene.duration_s = NO_END_S;
        if settings.shared_control_group == SharedControlGroup::Accepted {
            scene.limits.accept_shared_control_group = true;
        }
        let connected = program::connect(&mut scene);
        let (clock, pace) = match settings.pace {
            Pace::Real => (Clock::Real, Pace::Real),
            Pace::Lockstep => (Clock::Virtual, Pace::Lockstep),
        };
        let options = RunOptions { clock, seed: settings.seed };
        let registry = Registry::search(&scene.plugin_folders);
        let mut session = Session::prepare(&scene, &registry, &options).map_err(|error| error.to_string())?;
        session.warnings().iter().for_each(|warning| report_line(warning));
        let period_ns = session.period_ns();
        let limits = session.limits();
        let capabilities = session.capabilities().to_vec();
        let grips = session.grips().to_vec();
        let devices = connected.into_iter().zip(capabilities.into_iter().zip(grips));
        let stations = devices.map(|(connected, told)| {
            let number = usize::from(connected.device);
            let report = session.plugins().get(number);
            let name = report.map_or_else(String::new, |report| report.name.clone());
            let plugin = report.map_or_else(String::new, |report| report.metadata.id.clone());
            let tap = session.tap(connected.device);
            Station::new([name, plugin], connected, told, &limits, tap, period_ns)
        });
        let stations = stations.collect();
        notice_copies();
        let stage = Stage::Prepared(Box::new(Prepared { session, scene, options, settings }));
        Ok(Self {
            stations,
            pace,
            period_ns,
            stop: stop.clone(),
            stage: Mutex::new(stage),
            reads: AtomicU64::new(0),
        })
    }

    /// Returns the devices of the scene, in its order.
    #[must_use]
    pub fn stations(&self) -> &[Station] {
        &self.stations
    }

    /// Returns the device with a number, counted from 0; `None` if there is none.
    #[must_use]
    pub fn station(&self, number: usize) -> Option<&Station> {
        self.stations.get(number)
    }

    /// Returns the clock of the run: the machine's clock, or lockstep with the program's calls.
    #[must_use]
    pub fn pace(&self) -> Pace {
        self.pace
    }

    /// Returns the nominal time between ticks, ns.
    #[must_use]
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Returns the time for the program, ns: the machine's monotonic clock, or in lockstep the elapsed time of the run.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        match self.pace {
            Pace::Real => monotonic_ns(),
            Pace::Lockstep => self.stations.first().map_or(0, |station| station.ticks() * self.period_ns),
        }
    }

    /// Sleeps for a time, or in lockstep advances the run by the same time. Not real-time.
    pub fn sleep(&self, time: Duration) {
        if self.pace == Pace::Real {
            return std::thread::sleep(time);
        }
        let ticks = time.as_nanos().div_ceil(u128::from(self.period_ns.max(1)));
        for _ in 0..ticks {
            if !self.advance() {
                return;
            }
        }
    }

    /// Opens a device; the first open device starts the run. Returns true if the device exists and the run is in progress. The
    /// start takes some 50 ms; opening causes no motion. Not real-time.
    pub fn open(&self, number: usize) -> bool {
        let Some(station) = self.stations.get(number) else { return false };
        if !self.begin() {
            return false;
        }
        station.note_opened();
        true
    }

    /// Starts the run unless started already; returns true if the run is in progress.
    fn begin(&self) -> bool {
        let mut stage = self.stage();
        match std::mem::replace(&mut *stage, Stage::Over) {
            Stage::Prepared(prepared) => {
                *stage = quietly(|| self.start(*prepared));
                at_end(end_with_the_program);
            }
            begun => *stage = begun,
        }
        stage.is_running()
    }

    fn start(&self, prepared: Prepared) -> Stage {
        if self.pace == Pace::Lockstep {
            return match prepared.in_lockstep(&self.stop, stations_so_far()) {
                Ok(mut run) => {
                    run.advance(); // there is a pose from the start on
                    Stage::Lockstep(Box::new(run))
                }
                Err(problem) => {
                    report_line(&problem);
                    Stage::Over
                }
            };
        }
        let stop = self.stop.clone();
        let thread = std::thread::Builder::new().name("flotor-run".to_owned());
        let run = move || {
            guarded((), || prepared.run(&stop, stations_so_far()));
        };
        let thread = match thread.spawn(run) {
            Ok(thread) => thread,
            Err(cause) => {
                report_no_thread("the run", &cause);
                return Stage::Over;
            }
        };
        let since = Instant::now();
        while self.stations.iter().any(|station| station.ticks() == 0) {
            if thread.is_finished() || since.elapsed() > BEGIN {
                break;
            }
            std::thread::sleep(LOOK);
        }
        Stage::Beside(thread)
    }

    /// Returns true if the run is in progress, so that force can reach a hand.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.stage().is_running()
    }

    /// Returns true if the emergency stop ended the run, rather than the loss of a device.
    #[must_use]
    pub fn is_stopped_for_safety(&self) -> bool {
        is_emergency_stopped()
    }

    /// Counts a read of the program. In lockstep, every hundredth read without a command calls `before_tick` and executes a tick:
    /// otherwise a program that polls for a motion or a button would wait for ever. Not real-time.
    pub fn note_read(&self, before_tick: impl FnOnce()) {
        static WARNING: Once = Once::new();
        let reads = self.reads.fetch_add(1, Ordering::Relaxed) + 1;
        if self.pace == Pace::Lockstep && reads >= READS_OF_A_TICK {
            WARNING.call_once(|| {
                report_line(&format!(
                    "in lockstep each command of the program starts a tick; this program only reads, so each \
                     {READS_OF_A_TICK}th read starts a tick"
                ));
            });
            before_tick();
            self.advance();
        }
    }

    /// Executes one tick of a lockstep run; returns true if the run continues after the tick, false if the run has ended or is not
    /// in lockstep. Not real-time.
    pub fn advance(&self) -> bool {
        self.reads.store(0, Ordering::Relaxed);
        match &mut *self.stage() {
            Stage::Lockstep(run) => run.advance(),
            Stage::Prepared(_) | Stage::Beside(_) | Stage::Over => false,
        }
    }

    /// Waits for a tick that the caller has not seen, usually for a period and never longer than 10 ms; in lockstep executes the tick.
    /// Returns true if there was a tick. Not real-time.
    pub fn wait(&self, station: &Station) -> bool {
        self.wait_in(station, &station.turn)
    }

    /// Waits like [`Host::wait`], for one of several callers that share a device, each with its own record of seen ticks. Not real-time.
    pub fn wait_in(&self, station: &Station, turn: &Turn) -> bool {
        match self.pace {
            Pace::Real => station.wait_for_tick(turn),
            // Several devices share a tick: the first command executes it.
            Pace::Lockstep if self.stations.len() > 1 => {
                station.has_unseen_tick(turn) || self.advance() && station.has_unseen_tick(turn)
            }
            Pace::Lockstep => self.advance(),
        }
    }

    /// Ends the run normally: force fades out, the recording is closed, the summary is written. Waits at most 20 s. Not real-time.
    pub fn end(&self) {
        self.stations.iter().for_each(Station::disable);
        let stage = std::mem::replace(&mut *self.stage(), Stage::Over);
        match stage {
            Stage::Lockstep(run) => run.finish(&self.stations),
            Stage::Beside(thread) => {
                self.stop.stop();
                let since = Instant::now();
                while !thread.is_finished() && since.elapsed() < END {
                    std::thread::sleep(LOOK);
                }
            }
            Stage::Prepared(_) | Stage::Over => {}
        }
    }

    fn stage(&self) -> MutexGuard<'_, Stage> {
        flotor_core::lock(&self.stage)
    }
}

extern "C" fn end_with_the_program() {
    guarded((), || host_so_far().into_iter().for_each(Host::end));
}

/// Returns the `flotor` executable of the installation or build folder that contains this library.
fn executable(folder: &Path) -> Option<PathBuf> {
    let name = format!("flotor{}", std::env::consts::EXE_SUFFIX);
    // lib/flotor/compat/NAME is four folders below the installation.
    let installed = folder.ancestors().nth(4).map(|root| root.join("bin").join(&name));
    let beside = [folder.join(&name), folder.join("..").join(&name)];
    let configured = env_value("FLOTOR_PROGRAM").map(PathBuf::from);
    configured.into_iter().chain(beside).chain(installed).find(|file| file.is_file())
}

/// Returns the plugin folders of the installation or build folder that contains this library.
fn plugin_folders(folder: &Path) -> Vec<PathBuf> {
    let installed = folder.ancestors().nth(2).map(|root| root.join("plugins"));
    [folder.join("deps"), folder.to_path_buf(), folder.join("..")].into_iter().chain(installed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second call opened all devices a second time, and returned the first run.
    #[test]
    fn a_second_run_of_a_process_is_refused_before_its_scene_is_read() {
        HOST.get_or_init(|| None);
        let settings = Settings::from_environment().expect("nothing is set");
        let settings = Settings { scene: Some(PathBuf::from("/nosuch/scene.toml")), ..settings };
        let refused = prepare(settings, &StopSwitch::default()).err();
        assert_eq!(
            refused.as_deref(),
            Some("this process has already prepared a run, or failed to; start another process")
        );
    }
}
