//! Host side: a model in a worker process.

use super::Greeting;
use super::child::WHOLE;
use super::memory::{SharedMemory, create_file};
use super::shared_words::{Operation, wait_for_change};
use crate::engine::stepped::Stepped;
use crate::platform::{process_group, processes};
use crate::{THREAD_ADVICE, monotonic_ns};
use flotor_core::grip::GripRecord;
use flotor_core::lock;
use flotor_core::sent::demand_of;
use flotor_hal::abi::CallStatus;
use flotor_hal::{
    ActiveRegion, ContactSet, Demand, Input, LoopConfig, Memory, Output, Refusal, RefusalKind,
    WorkspaceBounds,
};
use std::io;
use std::io::ErrorKind::{NotFound, PermissionDenied, WouldBlock};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::Mutex;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Sender, channel};
use std::time::{Duration, Instant};

/// Start-up settings of a worker.
pub struct WorkerConfig<'a> {
    /// Path of the plugin's shared library.
    pub plugin: &'a Path,
    /// Parameters of the model, key and value as text.
    pub sets: Vec<(String, String)>,
    /// Period and seed of the loop.
    pub config: LoopConfig,
    /// Timeout of a reply, ns.
    pub timeout_ns: u64,
    /// Timeout of the plugin's `create` and `prepare` together.
    pub create_timeout: Duration,
}

/// Model in a worker process; dropping it kills the process.
pub struct Worker {
    child: Child,
    memory: SharedMemory,
    /// Number of the newest request.
    number: u32,
    /// True after a timeout, until the newest request is answered.
    is_pending: bool,
    is_gone: bool,
    timeout_ns: u64,
    parameters: Vec<Option<f64>>,
    serves: Demand,
    remembers: Memory,
    has_local_model: bool,
}

impl Worker {
    /// Starts a worker and waits until its model is ready, at most [`WorkerConfig::create_timeout`]. Not real-time.
    ///
    /// # Errors
    /// The plugin's [`Refusal`], or a refusal with the cause if the worker process cannot be started, ends, or exceeds the timeout.
    pub fn start(config: &WorkerConfig<'_>) -> Result<Self, Refusal> {
        let no_worker = |error| Refusal::resource(format!("cannot start a worker process: {error}"));
        let file = create_file().map_err(no_worker)?;
        let memory = SharedMemory::map(&file).map_err(no_worker)?;
        let mut command = Command::new(program().map_err(no_worker)?);
        command.arg("worker").arg(config.plugin);
        command.args(["--host", &std::process::id().to_string()]);
        command.args(["--period-ns", &config.config.period_ns.to_string()]);
        command.args(["--seed", &config.config.seed.to_string()]);
        command.args(config.sets.iter().map(|(key, value)| format!("--set={key}={value}")));
        // Output of the plugin goes to the host's standard error, not into results on standard output.
        command.stdin(file).stdout(io::stderr());
        // Terminal signals go to the host alone: it needs the model until the force has faded out.
        process_group::lead_until_parent_ends(&mut command);
        let child = spawn(command).map_err(no_worker)?;
        let mut worker = Self {
            child,
            memory,
            number: 0,
            is_pending: false,
            is_gone: false,
            timeout_ns: config.timeout_ns,
            parameters: Vec::new(),
            serves: Demand::FORCE,
            remembers: Memory::PathDependent,
            has_local_model: false,
        };
        let greeting = worker.greeting(config.create_timeout);
        match serde_json::from_str(&greeting) {
            Ok(Greeting::Ready { parameters, serves, remembers, has_local_model }) => {
                worker.has_local_model = has_local_model;
                worker.remembers = if remembers { Memory::PathDependent } else { Memory::Stateless };
                worker.parameters = parameters;
                worker.serves = demand_of(serves);
                Ok(worker)
            }
            Ok(Greeting::Refused { kind, reason }) => {
                Err(Refusal { kind: RefusalKind::from_code(kind), reason })
            }
            Err(_) => {
                // The worker may still be running without a valid greeting: do not wait for it.
                let is_late = greeting.is_empty() && worker.child.try_wait().is_ok_and(|end| end.is_none());
                let _ = worker.child.kill();
                let end = worker.child.wait().map_err(no_worker)?;
                if is_late {
                    let create_timeout_s = config.create_timeout.as_secs_f64();
                    return Err(Refusal::broken(format!(
                        "loading, `create` or `prepare` did not return within {create_timeout_s} s in the worker process; \
                         check the plugin with `flotor validate`, or raise the limit with the environment variable `FLOTOR_CALL_LIMIT_S`"
                    )));
                }
                Err(Refusal::broken(format!(
                    "the worker process ended before the model was created ({end}); check the plugin with \
                     `flotor validate`"
                )))
            }
        }
    }

    /// Waits for the greeting of the worker, sent once its model is ready. Empty if the process ends before or the timeout expires.
    /// Not real-time.
    fn greeting(&mut self, create_timeout: Duration) -> String {
        let (child, started) = (&mut self.child, Instant::now());
        let has_ended =
            || started.elapsed() > create_timeout || child.try_wait().is_ok_and(|end| end.is_some());
        let Some((number, text)) = receive_text(&self.memory, has_ended) else { return String::new() };
        self.number = number;
        text
    }

    /// Returns the value of a parameter: the last one that the model has confirmed, or the initial one; NaN without either.
    pub fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().flatten().unwrap_or(f64::NAN)
    }

    /// Returns the outputs that the model can compute.
    pub fn serves(&self) -> Demand {
        self.serves
    }

    /// Steps the model, also at a grip; the results are only valid for [`Stepped::Answered`]. Real-time: bounded by the timeout.
    #[inline]
    pub fn step(&mut self, input: &Input, output: &mut Output, grip: &mut Option<GripRecord>) -> Stepped {
        let asked = *grip;
        let put = |memory: &SharedMemory| {
            memory.put_input(input);
            memory.put_grip(asked);
        };
        let reply =
            self.request(Operation::Step, put, |memory| (*output, *grip) = (memory.output(), memory.grip()));
        reply.map_or_else(|missing| missing, Stepped::from)
    }

    /// Returns true if the model can run asynchronously.
    pub fn has_local_model(&self) -> bool {
        self.has_local_model
    }

    /// Computes the contacts or the linear field at an input; `set` is only valid for [`Stepped::Answered`]. Not real-time: bounded by
    /// the reply timeout.
    pub fn local_model(&mut self, input: &Input, set: &mut ContactSet) -> Stepped {
        let put = |memory: &SharedMemory| memory.put_input(input);
        let reply = self.request(Operation::LocalModel, put, |memory| *set = memory.contact_set());
        reply.map_or_else(|missing| missing, Stepped::from)
    }

    /// Returns the active region of the model; everywhere while a pending request may change it. Real-time: bounded, no allocation.
    pub fn active_region(&self) -> ActiveRegion {
        if self.is_pending { ActiveRegion::EVERYWHERE } else { self.memory.region() }
    }

    /// Returns the workspace bounds of the model. Real-time: bounded, no allocation.
    pub fn workspace_bounds(&self) -> WorkspaceBounds {
        self.memory.bounds()
    }

    /// Changes a live parameter at a tick boundary; unsupported without a reply in time. Real-time: as [`Self::step`].
    pub fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        let put = |memory: &SharedMemory| {
            memory.parameter.store(index as u64, Ordering::Relaxed);
            memory.value.store(value.to_bits(), Ordering::Relaxed);
        };
        // The next step reports a late or ended worker.
        let status = self.request(Operation::SetParameter, put, |_| ()).unwrap_or(CallStatus::Unsupported);
        if let (CallStatus::Ok, Some(present)) = (status, self.parameters.get_mut(index)) {
            *present = Some(value);
        }
        status
    }

    /// Clears the history of the model; [`CallStatus::Ok`] also without a reply. Real-time: bounded by the reply timeout, no
    /// allocation.
    pub fn reset(&mut self) -> CallStatus {
        // The next step reports a late or ended worker.
        self.request(Operation::Reset, |_| (), |_| ()).unwrap_or(CallStatus::Ok)
    }

    /// Returns the model's dependence on the path of the handle.
    pub fn memory(&self) -> Memory {
        self.remembers
    }

    /// Sends a request and waits for the reply; returns the status of the reply, or late or gone if there is no reply.
    fn request(
        &mut self,
        operation: Operation,
        put: impl FnOnce(&SharedMemory),
        take: impl FnOnce(&SharedMemory),
    ) -> Result<CallStatus, Stepped> {
        if self.is_gone {
            return Err(Stepped::Gone);
        }
        // No new request while the last one is pending: its data in the memory is still in use.
        if self.is_pending && !self.memory.is_answered(self.number) {
            return Err(self.late());
        }
        self.is_pending = false;
        put(&self.memory);
        self.number = self.number.wrapping_add(1);
        self.memory.ask(self.number, operation);
        let deadline_ns = monotonic_ns().saturating_add(self.timeout_ns);
        while !self.memory.is_answered(self.number) {
            let left_ns = deadline_ns.saturating_sub(monotonic_ns());
            if left_ns == 0 {
                self.is_pending = true;
                return Err(self.late());
            }
            wait_for_change(&self.memory.reply, self.number.wrapping_sub(1), left_ns);
        }
        take(&self.memory);
        Ok(self.memory.status())
    }

    /// Returns late or gone, after one system call that checks whether the worker has ended.
    fn late(&mut self) -> Stepped {
        self.is_gone = self.child.try_wait().is_ok_and(|end| end.is_some());
        if self.is_gone { Stepped::Gone } else { Stepped::Late }
    }

    /// Returns the last message of the model, or the exit status of its process. Not real-time.
    pub fn last_message(&mut self) -> String {
        match self.child.try_wait() {
            Ok(Some(end)) => match processes::ending_signal(end) {
                Some(signal) => format!("the worker process was ended by signal {signal}"),
                None => format!("the worker process ended ({end})"),
            },
            _ => self.memory.message(),
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // The worker may hang: kill it, and with it all processes that it has started, without a request to end. No data is lost.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Interval between checks for the worker's end while waiting for the greeting, ns.
const LOOK_NS: u64 = 20_000_000;

/// Receives the greeting of a worker piece by piece, and confirms each piece with a request under its number. Returns the last
/// number and the whole text; `None` if `has_ended` returns true before.
pub(super) fn receive_text(
    memory: &SharedMemory,
    mut has_ended: impl FnMut() -> bool,
) -> Option<(u32, String)> {
    let (mut number, mut text) = (0_u32, String::new());
    loop {
        // Checked before the memory: a piece may have been sent just before the end.
        let is_over = has_ended();
        if !memory.is_answered(number.wrapping_add(1)) {
            if is_over {
                return None;
            }
            wait_for_change(&memory.reply, number, LOOK_NS);
            continue;
        }
        number = number.wrapping_add(1);
        text.push_str(&memory.message());
        let is_whole = memory.status() == WHOLE;
        // The worker does not read the operation yet.
        memory.ask(number, Operation::Reset);
        if is_whole {
            return Some((number, text));
        }
    }
}

/// Process to start, with the channel for its handle.
type Start = (Command, Sender<io::Result<Child>>);

/// Starts a process from a thread that lives as long as this process: the system kills a worker when the *thread* that started it
/// ends, and a thread that replaces a model may end before the run.
fn spawn(command: Command) -> io::Result<Child> {
    static STARTER: Mutex<Option<Sender<Start>>> = Mutex::new(None);
    let (reply, child) = channel();
    let mut starter = lock(&STARTER);
    let sender = match &mut *starter {
        Some(sender) => sender,
        none => none.insert(start_starter().map_err(|error| cannot_start(&command, &error))?),
    };
    let _ = sender.send((command, reply)); // the thread ends after this sender
    drop(starter);
    child.recv().map_err(|_| io::Error::other("the thread that starts worker processes has ended"))?
}

/// Starts the thread that starts the worker processes, and returns the sender to it.
fn start_starter() -> io::Result<Sender<Start>> {
    let (starter, orders) = channel::<Start>();
    let thread = std::thread::Builder::new().name("flotor-starter".to_owned());
    thread.spawn(move || {
        for (mut command, reply) in orders {
            let _ = reply.send(command.spawn().map_err(|error| cannot_start(&command, &error)));
        }
    })?;
    Ok(starter)
}

/// Names the program in the error of its start, with advice.
pub(crate) fn cannot_start(command: &Command, error: &io::Error) -> io::Error {
    let said = format!("`{}` cannot be started: {error}", command.get_program().display());
    io::Error::other(match error.kind() {
        NotFound | PermissionDenied => format!("{said}; check that the file exists and is executable"),
        WouldBlock => format!("{said}; {THREAD_ADVICE}"), // `EAGAIN`: a limit of processes or threads
        _ => said,
    })
}

/// Returns the `flotor` executable for child processes: the one set in guest mode, this program, or `flotor` in this program's
/// folder or its parent.
pub(crate) fn program() -> io::Result<PathBuf> {
    if let Some(program) = crate::guest::program() {
        return Ok(program.clone());
    }
    let name = format!("flotor{}", std::env::consts::EXE_SUFFIX);
    let own = std::env::current_exe()?;
    if own.file_name().is_some_and(|own| *own == *name) {
        return Ok(own);
    }
    let folders = own.ancestors().skip(1).take(2).map(|folder| folder.join(&name));
    folders.into_iter().find(|file| file.is_file()).ok_or_else(|| {
        io::Error::other(format!(
            "the program `{name}` is neither in the folder of `{}` nor in the folder above; copy it to one of these folders",
            own.display()
        ))
    })
}
