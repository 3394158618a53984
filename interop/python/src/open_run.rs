//! Run that a Python program is part of: on the real clock in a thread of its own, or in lockstep with the program.

use crate::ending::{Ended, Prepared};
use crate::error::{refuse, refuse_run};
use crate::run::EndReport;
use crate::scene::GivenScene;
use crate::state::State;
use flotor_command::{CommandError, end_words};
use flotor_hal::Wrench;
use flotor_live::{Directory, EndKind};
use flotor_servo::guest::{Signals, be_guest};
use flotor_servo::{Clock, EmergencySource, RunEnd, StopSwitch};
use flotor_session::program::{Connected, connect};
use flotor_session::registry::Registry;
use flotor_session::run_description::describe;
use flotor_session::telemetry::{ObservedRun, publish};
use flotor_session::{Controls, Lockstep, Measurements, NewValue, SavedRun, Session, Tap};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Poll interval for Python's signals, such as Ctrl-C, in ticks.
const TICKS_BETWEEN_SIGNALS: u64 = 2_000;
/// Longest sleep while the program waits for the end of a run.
const LOOK: Duration = Duration::from_millis(10);

/// Observers of a run: measurements, and the programs that watch it.
type Observed = ObservedRun<Measurements>;

/// Loop of a run.
enum Engine {
    /// In a thread of its own, on the real clock.
    Live(JoinHandle<Ended>),
    /// In the calling thread, tick by tick.
    Steps(Box<Steps>),
    /// Ended.
    Over(Ended),
}

/// Run in lockstep.
struct Steps {
    run: Lockstep,
    observed: Observed,
    notices: Vec<String>,
    /// State before the first tick, or the reason why it cannot be saved.
    start: Result<SavedRun, String>,
}

/// Tells the host that it is a guest of Python: this process's memory is not locked, fatal signals stop the devices first. `program` is the
/// packed command, for the processes that a run starts.
#[pyfunction]
pub(crate) fn enter_program(program: Option<PathBuf>) {
    be_guest(Signals::StopFirst, program);
}

/// Run that is open; the package wraps it in `flotor.Run`.
#[pyclass(frozen, module = "flotor")]
pub(crate) struct OpenRun {
    prepared: Arc<Prepared>,
    registry: Registry,
    controls: Controls,
    stop: StopSwitch,
    taps: Vec<Tap>,
    devices: Vec<String>,
    /// Ports of this program as a source of force, one for each device; none without one.
    ports: Vec<Connected>,
    engine: Mutex<Engine>,
}

/// Options of a run that is open, from a dictionary of Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct GivenOptions {
    /// Clock of the loop: `real` or `virtual`.
    clock: String,
    /// File of the recording.
    recording: Option<PathBuf>,
    /// True if other programs may watch the run.
    watched: bool,
    /// True if the program is a source of force on each device.
    program: bool,
}

/// State of a run that was saved; fits the run that saved it.
#[pyclass(frozen, module = "flotor")]
pub(crate) struct SavedState(SavedRun);

#[pymethods]
impl OpenRun {
    /// Prepares a run and starts its loop: on the real clock, where it waits for the first tick, or in lockstep.
    #[new]
    fn new(py: Python<'_>, given: GivenScene, options: GivenOptions) -> PyResult<Self> {
        let GivenOptions { clock, recording, watched, program } = options;
        let clock = match &*clock {
            "real" => Clock::Real,
            "virtual" => Clock::Virtual,
            other => return Err(refuse(format!("clock = \"{other}\": must be \"real\" or \"virtual\""))),
        };
        py.detach(|| {
            let (mut scene, registry, seed) = given.read()?;
            let ports = if program { connect(&mut scene) } else { Vec::new() };
            ports.iter().for_each(|connected| connected.port.enable());
            let devices = scene.devices.iter().map(|device| device.name.clone()).collect();
            let prepared = Prepared::new(scene, &registry, (clock, seed), recording.as_deref());
            let (prepared, mut session, measured) = prepared.map_err(refuse_run)?;
            let taps = (0..prepared.scene.devices.len()).filter_map(|device| u16::try_from(device).ok());
            let taps: Vec<Tap> = taps.map(|device| session.tap(device)).collect();
            let (stop, controls) = (StopSwitch::default(), session.controls());
            let publication = watched.then(|| {
                let description = describe(&prepared.scene, &prepared.options, &prepared.plugins);
                publish(&Directory::of_this_user(), &prepared.scene, &description, &session, &stop).ok()
            });
            let observed = ObservedRun { observer: measured, publication: publication.flatten() };
            let prepared = Arc::new(prepared);
            let engine = match clock {
                Clock::Real => {
                    let thread = live(session, observed, Arc::clone(&prepared), stop.clone())?;
                    while !thread.is_finished() && !taps.iter().any(has_ticked) {
                        std::thread::sleep(Duration::from_millis(1));
                    }
                    Engine::Live(thread)
                }
                Clock::Virtual => Engine::Steps(Box::new(Steps::start(session, observed)?)),
            };
            Ok(Self { prepared, registry, controls, stop, taps, devices, ports, engine: Mutex::new(engine) })
        })
    }

    /// Commands the wrench of this program on a device, by its number: force (N) and torque (N m) in the frame of its model `program`.
    fn push(&self, device: usize, force_n: [f64; 3], torque_nm: [f64; 3], effort: f64) -> PyResult<()> {
        let none =
            "open the run with program=True to push a device, and name one of its devices by its number";
        let connected = self.ports.get(device).ok_or_else(|| refuse(none))?;
        let wrench = Wrench { force_n, torque_nm };
        connected.port.command_with_grip(&wrench, effort).map_err(refuse)
    }

    /// Returns the newest state of a device, by its number or its name; waits for nothing.
    fn state(&self, device: &Bound<'_, PyAny>) -> PyResult<State> {
        let number = match device.extract::<usize>() {
            Ok(number) => Some(number),
            Err(_) => {
                let name: String = device.extract()?;
                self.devices.iter().position(|known| *known == name)
            }
        };
        let names = || format!("no device {device}; the devices are {}", self.devices.join(", "));
        let tap = number.and_then(|number| self.taps.get(number)).ok_or_else(|| refuse(names()))?;
        loop {
            // A loop in the middle of its publication is through in a microsecond.
            if let Some((_, record)) = tap.read() {
                return Ok(State::of(record));
            }
        }
    }

    /// Returns the names of the devices, in the scene's order.
    #[getter]
    fn devices(&self) -> Vec<String> {
        self.devices.clone()
    }

    /// Returns the names of the models, in the scene's order.
    #[getter]
    fn models(&self) -> Vec<String> {
        self.prepared.plugins.iter().skip(self.devices.len()).map(|plugin| plugin.name.clone()).collect()
    }

    /// Returns the nominal time between ticks, s.
    #[getter]
    fn period_s(&self) -> f64 {
        1.0 / self.prepared.scene.rate_hz
    }

    /// Changes live parameters, all before the same tick: gradually, or at once.
    fn set(&self, py: Python<'_>, values: Vec<(String, String, String)>, is_gradual: bool) -> PyResult<()> {
        py.detach(|| {
            let of = |(plugin, parameter, value)| NewValue { plugin, parameter, value };
            let values: Vec<NewValue<'_>> =
                values.iter().map(|(plugin, parameter, value)| of((plugin, parameter, value))).collect();
            let sent = if is_gradual {
                self.controls.set_parameters(&values)
            } else {
                self.controls.set_parameters_at_once(&values)
            };
            sent.map_err(refuse)
        })
    }

    /// Sets the target weight of a model, 0 to 1.
    fn set_weight(&self, py: Python<'_>, model: &str, weight: f64) -> PyResult<()> {
        py.detach(|| self.controls.set_weight(model, weight)).map_err(refuse)
    }

    /// Replaces a model while the loop runs.
    fn swap(
        &self,
        py: Python<'_>,
        model: &str,
        plugin: Option<&str>,
        settings: Vec<(String, String)>,
    ) -> PyResult<()> {
        let settings: Vec<(&str, &str)> = settings.iter().map(|(id, value)| (&**id, &**value)).collect();
        py.detach(|| self.controls.swap(&self.registry, model, plugin, &settings)).map_err(refuse)
    }

    /// Requests an end in order: the force fades out.
    fn stop(&self) {
        self.stop.stop();
    }

    /// Presses the emergency stop.
    fn emergency_stop(&self) {
        self.stop.press(EmergencySource::Watcher);
    }

    /// Returns true until the run has ended.
    fn is_running(&self, py: Python<'_>) -> bool {
        py.detach(|| match &*flotor_core::lock(&self.engine) {
            Engine::Live(thread) => !thread.is_finished(),
            Engine::Steps(steps) => !steps.has_ended(),
            Engine::Over(_) => false,
        })
    }

    /// Returns true unless the run has ended other than by its duration.
    fn can_go_on(&self, py: Python<'_>) -> bool {
        py.detach(|| match &*flotor_core::lock(&self.engine) {
            Engine::Steps(steps) => matches!(steps.run.end(), None | Some(RunEnd::Finished)),
            Engine::Live(thread) => !thread.is_finished(),
            Engine::Over(_) => false,
        })
    }

    /// Runs `ticks` ticks of a run in lockstep; returns false if the run ended before.
    fn step(&self, py: Python<'_>, ticks: u64) -> PyResult<bool> {
        let mut left = ticks;
        while left > 0 {
            let batch = left.min(TICKS_BETWEEN_SIGNALS);
            if py.detach(|| self.on_steps(|steps| Ok(steps.run(batch, &self.stop))))?.is_some() {
                return Ok(false);
            }
            left -= batch;
            py.check_signals()?;
        }
        Ok(true)
    }

    /// Saves the state of a run in lockstep before its next tick.
    fn save(&self, py: Python<'_>) -> PyResult<SavedState> {
        py.detach(|| self.on_steps(|steps| steps.run.save().map(SavedState).map_err(refuse)))
    }

    /// Restores a state that this run has saved.
    fn restore(&self, py: Python<'_>, saved: &SavedState) -> PyResult<()> {
        py.detach(|| self.on_steps(|steps| steps.restore(&saved.0)))
    }

    /// Restores the state before the first tick.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| {
            self.on_steps(|steps| {
                let start = std::mem::replace(&mut steps.start, Err(String::new()));
                let restored = start.as_ref().map_err(refuse).and_then(|start| steps.restore(start));
                steps.start = start;
                restored
            })
        })
    }

    /// Waits for the end of a run up to a time, s; returns summary and problem, `None` if the run has not ended.
    fn wait(&self, py: Python<'_>, timeout_s: f64) -> PyResult<Option<EndReport>> {
        let since = Instant::now();
        loop {
            let told = py.detach(|| {
                let mut engine = flotor_core::lock(&self.engine);
                engine.settle();
                match &*engine {
                    Engine::Over(Ended { summary, problem }) => Some((summary.clone(), problem.clone())),
                    Engine::Live(_) | Engine::Steps(_) => None,
                }
            });
            let left_s = timeout_s - since.elapsed().as_secs_f64();
            if told.is_some() || left_s <= 0.0 {
                return Ok(told);
            }
            py.check_signals()?;
            py.detach(|| std::thread::sleep(LOOK.min(Duration::from_secs_f64(left_s.min(1.0)))));
        }
    }

    /// Ends a run in order: on the real clock requests the end, in lockstep stops the devices. [`Self::wait`] has the summary.
    fn close(&self, py: Python<'_>) {
        self.stop.stop();
        py.detach(|| {
            let mut engine = flotor_core::lock(&self.engine);
            let over =
                match std::mem::replace(&mut *engine, Engine::Over(Ended { summary: None, problem: None })) {
                    Engine::Steps(steps) => Engine::Over(steps.finish(&self.prepared)),
                    other => other,
                };
            *engine = over;
        });
    }
}

impl OpenRun {
    /// Calls `on_steps` on a run in lockstep, and ends a run that has failed.
    fn on_steps<T>(&self, on_steps: impl FnOnce(&mut Steps) -> PyResult<T>) -> PyResult<T> {
        let mut engine = flotor_core::lock(&self.engine);
        match &mut *engine {
            Engine::Steps(steps) => on_steps(steps),
            Engine::Live(_) => Err(refuse(
                "this run is on the real clock and has a loop of its own; open it with clock=\"virtual\" to step, save and restore it",
            )),
            Engine::Over(_) => Err(refuse("the run has ended; open it again")),
        }
    }
}

impl Drop for OpenRun {
    /// Requests the end of a run that was not closed; its thread ends the run in order.
    fn drop(&mut self) {
        self.stop.stop();
    }
}

impl Engine {
    /// Takes the end of a run whose thread has ended.
    fn settle(&mut self) {
        let Self::Live(thread) = self else { return };
        if !thread.is_finished() {
            return;
        }
        let Self::Live(thread) = std::mem::replace(self, Self::Over(Ended { summary: None, problem: None }))
        else {
            return;
        };
        *self = Self::Over(thread.join().unwrap_or_else(|_| Ended {
            summary: None,
            problem: Some((
                "internal error: the thread of the run panicked; please report this error".to_owned(),
                1,
            )),
        }));
    }
}

impl Steps {
    fn start(session: Session, observed: Observed) -> PyResult<Self> {
        let notices = session.notices();
        let mut run = session.into_lockstep().map_err(refuse_run)?;
        let start = run.save().map_err(|error| error.to_string());
        Ok(Self { run, observed, notices, start })
    }

    fn run(&mut self, ticks: u64, stop: &StopSwitch) -> Option<RunEnd> {
        self.run.advance_by(ticks, &mut self.observed, stop)
    }

    fn has_ended(&self) -> bool {
        self.run.end().is_some()
    }

    fn restore(&mut self, saved: &SavedRun) -> PyResult<()> {
        if self.observed.observer.recording.is_on() {
            return Err(refuse(
                "the run is recorded, and a recording cannot go back; open it without `record`",
            ));
        }
        self.run.restore(saved).map_err(refuse)
    }

    /// Stops the devices and frees the plugins.
    fn finish(self, prepared: &Prepared) -> Ended {
        let Self { run, observed, notices, .. } = self;
        conclude(prepared, observed, Ok(run.finish()), notices)
    }
}

/// Returns true after the first tick.
fn has_ticked(tap: &Tap) -> bool {
    tap.read_after(0).is_some()
}

/// Tells the watching programs the end of a run, and concludes it.
fn conclude(
    prepared: &Prepared,
    observed: Observed,
    ran: Result<flotor_session::Outcome, flotor_session::RunError>,
    notices: Vec<String>,
) -> Ended {
    let ObservedRun { observer, publication } = observed;
    if let Some(publication) = publication {
        let rate_hz = prepared.scene.rate_hz;
        match &ran {
            Ok(outcome) if outcome.end.is_in_order() => {
                publication.end(&end_words(outcome, rate_hz), EndKind::InOrder);
            }
            Ok(outcome) => publication.end(&end_words(outcome, rate_hz), EndKind::Failed),
            Err(error) => publication.end(&error.to_string(), EndKind::Failed),
        }
    }
    prepared.conclude(observer, ran, notices)
}

/// Starts the loop of a run on the real clock, in threads of its own.
fn live(
    session: Session,
    mut observed: Observed,
    prepared: Arc<Prepared>,
    stop: StopSwitch,
) -> PyResult<JoinHandle<Ended>> {
    let notices = session.notices();
    let body = move || {
        let ran = session.run(&mut observed, &stop);
        conclude(&prepared, observed, ran, notices)
    };
    let thread = std::thread::Builder::new().name("flotor-run".to_owned()).spawn(body);
    thread.map_err(|error| {
        refuse_run(CommandError::Failed(format!("cannot start the thread of the run: {error}")))
    })
}
