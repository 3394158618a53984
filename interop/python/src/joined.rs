//! Run of another program, observed and changed over its socket.

use crate::error::refuse;
use crate::state::State;
use flotor_core::trace::TickRecord;
use flotor_live::{Answer, Ask, Client, Directory, End, EndKind, Event, RequestClient, SetValue};
use flotor_record::Role;
use pyo3::prelude::*;
use std::collections::HashMap;
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

/// Timeout for an answer; a swap first creates a model.
const PATIENCE: Duration = Duration::from_secs(30);
/// Poll interval for Python's signals, such as Ctrl-C, and for the end of the connection.
const LOOK: Duration = Duration::from_millis(50);

/// Run of another program; the package wraps it in `flotor.JoinedRun`.
#[pyclass(frozen, module = "flotor")]
pub(crate) struct JoinedRun {
    requests: RequestClient,
    received: Arc<Received>,
    title: String,
    process: u32,
    devices: Vec<String>,
    models: Vec<String>,
}

/// Received data of the run, shared with the receiving thread.
#[derive(Default)]
struct Received {
    now: Mutex<Now>,
    arrived: Condvar,
}

/// Newest received data of the run.
#[derive(Default)]
struct Now {
    /// Newest record of each device, by its number.
    newest: Vec<Option<TickRecord>>,
    /// Unread answers, by request number.
    answers: HashMap<u64, Option<String>>,
    /// Sentence of the end, and true if the run ended in order; the reason if the connection has ended before.
    end: Option<(String, bool)>,
    /// True if the caller has left the run.
    is_left: bool,
}

#[pymethods]
impl JoinedRun {
    /// Connects to the newest run of this user, or to the one of a process; `every`: the ticks whose index is a multiple of it arrive.
    #[new]
    fn new(py: Python<'_>, process: Option<u32>, every: u32) -> PyResult<Self> {
        py.detach(|| {
            let directory = Directory::of_this_user();
            let client = match process {
                Some(process) => Client::of_process(&directory, process),
                None => Client::find(&directory),
            };
            let client = client.map_err(refuse)?;
            let requests = client.request_client();
            let plugins = &client.greeting().plugins;
            let count = client.run().plugins.iter().filter(|plugin| plugin.role == Role::Device).count();
            let names: Vec<String> = plugins.iter().map(|plugin| plugin.name.clone()).collect();
            let (devices, models) = names.split_at(count.min(names.len()));
            let (devices, models) = (devices.to_vec(), models.to_vec());
            let (title, process) = (client.greeting().title.clone(), client.greeting().process);
            requests.ask(Ask::Watch { every }).map_err(refuse)?;
            let received = Arc::new(Received::default());
            flotor_core::lock(&received.now).newest.resize(devices.len(), None);
            let shared = Arc::clone(&received);
            let thread = std::thread::Builder::new().name("flotor-joined".to_owned());
            thread.spawn(move || receive(client, &shared)).map_err(refuse)?;
            Ok(Self { requests, received, title, process, devices, models })
        })
    }

    /// Title of the scene.
    #[getter]
    fn title(&self) -> &str {
        &self.title
    }

    /// Process of the host.
    #[getter]
    fn process(&self) -> u32 {
        self.process
    }

    /// Names of the devices, in the scene's order.
    #[getter]
    fn devices(&self) -> Vec<String> {
        self.devices.clone()
    }

    /// Names of the models, in the scene's order.
    #[getter]
    fn models(&self) -> Vec<String> {
        self.models.clone()
    }

    /// Returns the newest state of a device that has arrived, by its number; waits for the first.
    fn state(&self, py: Python<'_>, device: usize) -> PyResult<State> {
        let record =
            self.wait(py, Instant::now() + PATIENCE, |now| now.newest.get(device).copied().flatten())?;
        record.map(State::of).ok_or_else(|| refuse(self.lost("no tick has arrived")))
    }

    /// Waits up to a time, s, for the end; returns its sentence and true if it is in order, `None` while the run continues.
    fn end(&self, py: Python<'_>, timeout_s: f64) -> PyResult<Option<(String, bool)>> {
        let until = Instant::now() + Duration::from_secs_f64(timeout_s.clamp(0.0, 1.0e9));
        self.wait(py, until, |now| now.end.clone())
    }

    /// Sets live parameters, all before the same tick, as a slider of the viewer does.
    fn set(&self, py: Python<'_>, values: Vec<(String, String, String)>) -> PyResult<()> {
        let value = |(plugin, parameter, value)| SetValue { plugin, parameter, value };
        self.ask(py, Ask::Set { values: values.into_iter().map(value).collect() })
    }

    /// Sets the target weight of a model, 0 to 1.
    fn set_weight(&self, py: Python<'_>, model: String, weight: f64) -> PyResult<()> {
        self.ask(py, Ask::Weight { model, weight })
    }

    /// Replaces a model while the loop runs.
    fn swap(
        &self,
        py: Python<'_>,
        model: String,
        plugin: Option<String>,
        settings: Vec<(String, String)>,
    ) -> PyResult<()> {
        self.ask(py, Ask::Swap { model, plugin, settings })
    }

    /// Requests an end in order.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.ask(py, Ask::Stop)
    }

    /// Presses the emergency stop.
    fn emergency_stop(&self, py: Python<'_>) -> PyResult<()> {
        self.ask(py, Ask::EmergencyStop)
    }

    /// Closes the connection; the run continues.
    fn leave(&self) {
        flotor_core::lock(&self.received.now).is_left = true;
    }
}

impl JoinedRun {
    /// Sends a request and waits for its answer.
    fn ask(&self, py: Python<'_>, ask: Ask) -> PyResult<()> {
        let number = py.detach(|| self.requests.ask(ask)).map_err(refuse)?;
        match self.wait(py, Instant::now() + PATIENCE, |now| now.answers.remove(&number))? {
            Some(None) => Ok(()),
            Some(Some(refused)) => Err(refuse(refused)),
            None => Err(refuse(self.lost("the host does not answer"))),
        }
    }

    /// Polls `look` until it returns a value, the run has ended, or a deadline has passed; handles Python's signals while
    /// waiting.
    fn wait<T: Send>(
        &self,
        py: Python<'_>,
        until: Instant,
        mut look: impl FnMut(&mut Now) -> Option<T> + Send,
    ) -> PyResult<Option<T>> {
        loop {
            let (found, is_over) = py.detach(|| {
                let mut now = flotor_core::lock(&self.received.now);
                if let Some(found) = look(&mut now) {
                    return (Some(found), true);
                }
                let left = until.saturating_duration_since(Instant::now());
                if now.end.is_some() || left.is_zero() {
                    return (None, true);
                }
                let waited = self.received.arrived.wait_timeout(now, LOOK.min(left));
                drop(waited);
                (None, false)
            });
            if is_over {
                return Ok(found);
            }
            py.check_signals()?;
        }
    }

    /// Returns the error text for data that have not arrived.
    fn lost(&self, what: &str) -> String {
        match &flotor_core::lock(&self.received.now).end {
            Some((words, _)) => format!("the run has ended: {words}"),
            None => format!("{what}; check whether the run has ended"),
        }
    }
}

impl Drop for JoinedRun {
    fn drop(&mut self) {
        self.leave();
    }
}

/// Receives the events of a run until it ends, or the caller leaves it.
fn receive(mut client: Client, received: &Received) {
    loop {
        let event = client.next(LOOK);
        let mut now = flotor_core::lock(&received.now);
        if now.is_left {
            now.end.get_or_insert_with(|| ("this program has left it".to_owned(), true));
        }
        match event {
            Ok(None | Some(Event::Change(_))) => {}
            Ok(Some(Event::Ticks { records, .. })) => {
                for record in records {
                    if let Some(newest) = now.newest.get_mut(usize::from(record.device)) {
                        *newest = Some(record);
                    }
                }
            }
            Ok(Some(Event::Answer(Answer { number, refused, .. }))) => {
                now.answers.insert(number, refused);
            }
            Ok(Some(Event::End(End { words, kind }))) => now.end = Some((words, kind == EndKind::InOrder)),
            Err(error) => {
                now.end.get_or_insert_with(|| (error.to_string(), false));
            }
        }
        let is_over = now.end.is_some();
        drop(now);
        received.arrived.notify_all();
        if is_over {
            return;
        }
    }
}
