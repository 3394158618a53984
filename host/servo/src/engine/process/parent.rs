//! The host's side: a model that lives in another process.

use super::child::WHOLE;
use super::memory::{SharedMemory, create_file};
use super::shared_words::{DEMANDS, NO_DEMAND, Order, wait_for_change};
use super::{Greeting, Reply};
use crate::last_stop::spawn_unblocked;
use crate::platform::processes;
use crate::{THREAD_ADVICE, monotonic_ns};
use flotor_hal::abi::CallStatus;
use flotor_hal::{
    ActiveRegion, Demand, Input, LinearField, LoopConfig, Memory, Output, Refusal, RefusalKind,
    WorkspaceBounds,
};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What a worker is to be.
pub struct WorkerOrder<'a> {
    /// The plugin's file.
    pub plugin: &'a Path,
    /// Parameters, as text.
    pub sets: Vec<(String, String)>,
    /// What the loop promises.
    pub config: LoopConfig,
    /// How long the loop waits for an answer, ns.
    pub patience_ns: u64,
    /// How long making the model may take.
    pub making: Duration,
}

/// A model in a process of its own.
pub struct Worker {
    child: Child,
    memory: SharedMemory,
    /// Number of the newest request.
    number: u32,
    /// That request is not answered yet.
    is_behind: bool,
    is_gone: bool,
    patience_ns: u64,
    parameters: Vec<Option<f64>>,
    serves: Demand,
    remembers: Memory,
    has_field: bool,
}

impl Worker {
    /// Starts a worker and waits until its model is made. Not real-time.
    ///
    /// # Errors
    /// The plugin's [`Refusal`], or why there is no worker.
    pub fn start(order: &WorkerOrder<'_>) -> Result<Self, Refusal> {
        let no_worker = |error: io::Error| Refusal::resource(format!("no worker process: {error}"));
        let file = create_file().map_err(no_worker)?;
        let memory = SharedMemory::map(&file).map_err(no_worker)?;
        let mut command = Command::new(program().map_err(no_worker)?);
        command.arg("worker").arg(order.plugin);
        command.args(["--host", &std::process::id().to_string()]);
        command.args(["--period-ns", &order.config.period_ns.to_string()]);
        command.args(["--seed", &order.config.seed.to_string()]);
        command.args(order.sets.iter().map(|(key, value)| format!("--set={key}={value}")));
        // What a model prints goes where it does no harm, as long as it lives: to the host's errors.
        command.stdin(file).stdout(io::stderr());
        // What a terminal sends is the host's affair: it still needs the model while the force fades out.
        processes::keep_from_terminal(&mut command);
        let child = spawn(command).map_err(|error| no_worker(with_advice(error)))?;
        let mut worker = Self {
            child,
            memory,
            number: 0,
            is_behind: false,
            is_gone: false,
            patience_ns: order.patience_ns,
            parameters: Vec::new(),
            serves: NO_DEMAND,
            remembers: Memory::PathDependent,
            has_field: false,
        };
        let greeting = worker.greeting(order.making);
        match serde_json::from_str(&greeting) {
            Ok(Greeting::Ready { parameters, serves, remembers, has_field }) => {
                worker.has_field = has_field;
                worker.remembers = if remembers { Memory::PathDependent } else { Memory::Stateless };
                worker.parameters = parameters;
                let served =
                    DEMANDS.iter().zip(serves).filter_map(|(demand, served)| served.then_some(*demand));
                worker.serves = served.fold(NO_DEMAND, Demand::with);
                Ok(worker)
            }
            Ok(Greeting::Refused { kind, reason }) => {
                Err(Refusal { kind: RefusalKind::from_code(kind), reason })
            }
            Err(_) => {
                // It may be there all the same, saying nothing that makes sense: nobody waits for that.
                let is_late = greeting.is_empty() && worker.child.try_wait().is_ok_and(|end| end.is_none());
                let _ = worker.child.kill();
                let end = worker.child.wait().map_err(no_worker)?;
                if is_late {
                    let making_s = order.making.as_secs_f64();
                    return Err(Refusal::broken(format!(
                        "`create` or `prepare` did not return within {making_s} s in its process"
                    )));
                }
                Err(Refusal::broken(format!("its process ended before the model was made ({end})")))
            }
        }
    }

    /// What the worker says first, once its model is made; nothing if its process ended before, or takes longer than it may.
    /// Not real-time.
    fn greeting(&mut self, making: Duration) -> String {
        let (child, started) = (&mut self.child, Instant::now());
        let has_ended = || started.elapsed() > making || child.try_wait().is_ok_and(|end| end.is_some());
        let Some((number, text)) = heard(&self.memory, has_ended) else { return String::new() };
        self.number = number;
        text
    }

    /// The value in force of a parameter when the model was made; NaN if it has none.
    pub fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().flatten().unwrap_or(f64::NAN)
    }

    /// Which demands the model can serve.
    pub fn serves(&self) -> Demand {
        self.serves
    }

    /// One step. Real-time: waits as long as it may, no allocation.
    #[inline]
    pub fn step(&mut self, input: &Input) -> Reply<(CallStatus, Output)> {
        let patience_ns = self.patience_ns;
        self.request(
            Order::Step,
            patience_ns,
            |memory| memory.put_input(input),
            |memory| (memory.status(), memory.output()),
        )
    }

    /// Whether it has a linear field.
    pub fn has_linear_field(&self) -> bool {
        self.has_field
    }

    /// The field at an input. Not real-time: waits as long as it may.
    pub fn linear_field(&mut self, input: &Input) -> Reply<(CallStatus, LinearField)> {
        let patience_ns = self.patience_ns;
        self.request(
            Order::Field,
            patience_ns,
            |memory| memory.put_input(input),
            |memory| (memory.status(), memory.field()),
        )
    }

    /// Where the model can act; everywhere while it is at a request whose answer may change that. Real-time: bounded, no allocation.
    pub fn active_region(&self) -> ActiveRegion {
        if self.is_behind { ActiveRegion::EVERYWHERE } else { self.memory.region() }
    }

    /// Where the model ends. Real-time: bounded, no allocation.
    pub fn workspace_bounds(&self) -> WorkspaceBounds {
        self.memory.bounds()
    }

    /// Changes a live parameter at a tick boundary. Real-time: waits as long as it may, no allocation.
    pub fn set_parameter(&mut self, index: usize, value: f64) -> Reply<CallStatus> {
        let put = |memory: &SharedMemory| {
            memory.parameter.store(index as u64, Ordering::Relaxed);
            memory.value.store(value.to_bits(), Ordering::Relaxed);
        };
        let patience_ns = self.patience_ns;
        self.request(Order::SetParameter, patience_ns, put, |memory| memory.status())
    }

    /// Forgets history. Real-time: waits as long as it may, no allocation.
    pub fn reset(&mut self) -> Reply<CallStatus> {
        let patience_ns = self.patience_ns;
        self.request(Order::Reset, patience_ns, |_| (), |memory| memory.status())
    }

    /// Whether the answer depends on the path.
    pub fn memory(&self) -> Memory {
        self.remembers
    }

    fn request<T>(
        &mut self,
        order: Order,
        patience_ns: u64,
        put: impl FnOnce(&SharedMemory),
        take: impl FnOnce(&SharedMemory) -> T,
    ) -> Reply<T> {
        if self.is_gone {
            return Reply::Gone;
        }
        // One that has not answered the last request gets no new one: its memory still belongs to the old.
        if self.is_behind && !self.memory.is_answered(self.number) {
            return self.late();
        }
        self.is_behind = false;
        put(&self.memory);
        self.number = self.number.wrapping_add(1);
        self.memory.ask(self.number, order);
        let deadline_ns = monotonic_ns().saturating_add(patience_ns);
        while !self.memory.is_answered(self.number) {
            let left_ns = deadline_ns.saturating_sub(monotonic_ns());
            if left_ns == 0 {
                self.is_behind = true;
                return self.late();
            }
            wait_for_change(&self.memory.reply, self.number.wrapping_sub(1), left_ns);
        }
        Reply::Answered(take(&self.memory))
    }

    /// Late, or never again? One system call, only when something is wrong already.
    fn late<T>(&mut self) -> Reply<T> {
        self.is_gone = self.child.try_wait().is_ok_and(|end| end.is_some());
        if self.is_gone { Reply::Gone } else { Reply::Late }
    }

    /// What the model said last, or how its process ended. Not real-time.
    pub fn last_message(&mut self) -> String {
        match self.child.try_wait() {
            Ok(Some(end)) => match processes::ending_signal(end) {
                Some(signal) => format!("its process was ended by signal {signal}"),
                None => format!("its process ended ({end})"),
            },
            _ => self.memory.message(),
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // It may hang: it is not asked to end. Nothing is lost with it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// How often a worker that says nothing is looked at, ns.
const LOOK_NS: u64 = 20_000_000;

/// Hears what a worker says before it is asked for anything, piece by piece, and takes each by asking under
/// its number. The last number, and the whole; `None` if the worker ended before.
pub(super) fn heard(memory: &SharedMemory, mut has_ended: impl FnMut() -> bool) -> Option<(u32, String)> {
    let (mut number, mut text) = (0_u32, String::new());
    loop {
        // Looked at first: what was said before the end was said.
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
        // The order is not looked at yet.
        memory.ask(number, Order::Reset);
        if is_whole {
            return Some((number, text));
        }
    }
}

/// A process to be started, and where it goes.
type Start = (Command, Sender<io::Result<Child>>);

/// Starts a process from a thread that stays as long as this process: a worker ends with the *thread* that started it, and
/// one that exchanges a model may be gone before the run is.
fn spawn(command: Command) -> io::Result<Child> {
    static STARTER: Mutex<Option<Sender<Start>>> = Mutex::new(None);
    let (reply, child) = channel();
    {
        let mut starter = STARTER.lock().unwrap_or_else(PoisonError::into_inner);
        let starter = match &mut *starter {
            Some(starter) => starter,
            none => none.insert(start_starter()?),
        };
        let _ = starter.send((command, reply)); // the thread ends after this sender
    }
    child.recv().map_err(|_| io::Error::other("the thread that starts processes is gone"))?
}

/// Starts the thread that starts processes.
fn start_starter() -> io::Result<Sender<Start>> {
    let (starter, orders) = channel::<Start>();
    let thread = std::thread::Builder::new().name("flotor-starter".to_owned());
    thread.spawn(move || {
        for (mut command, reply) in orders {
            let _ = reply.send(spawn_unblocked(&mut command));
        }
    })?;
    Ok(starter)
}

/// Adds the remedy to the system's refusal of a process or a thread.
fn with_advice(error: io::Error) -> io::Error {
    if error.kind() == io::ErrorKind::WouldBlock {
        io::Error::other(format!("{error}; {THREAD_ADVICE}"))
    } else {
        error
    }
}

/// The program that can be a worker: this one, or, for a program that only uses the library, `flotor` beside it or in the folder above.
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
        io::Error::other(format!("`{name}` is neither this program nor beside `{}`", own.display()))
    })
}
