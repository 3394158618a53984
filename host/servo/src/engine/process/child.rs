//! Worker side: the process that runs the model.

use super::Greeting;
use super::memory::{MESSAGE_BYTES, SharedMemory};
use super::shared_words::{Operation, wait_for_change};
use crate::enter_worker_priority;
use crate::last_stop::ignore_no_signal;
use crate::platform::processes::HostProcess;
use flotor_core::grip::GripRecord;
use flotor_core::sent::DEMANDS;
use flotor_hal::abi::{CallStatus, PluginKind};
use flotor_hal::{ContactSet, LoopConfig, Memory, Output, Refusal, RefusalKind};
use flotor_loader::{LoadError, Model, Plugin, Setting};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Poll interval for host liveness while idle, ns.
const HOST_CHECK_NS: u64 = 500_000_000;

/// Start-up arguments of a worker. Standard input is the shared memory, through which the greeting is sent too: standard output is
/// left to the plugin.
#[derive(Clone, Debug)]
pub struct WorkerArguments {
    /// Process id of the host.
    pub host: i32,
    /// The plugin's shared library.
    pub plugin: PathBuf,
    /// Nominal time between ticks, ns.
    pub period_ns: u64,
    /// Seed of the run.
    pub seed: u64,
    /// Parameters of the model, `KEY=VALUE`.
    pub sets: Vec<String>,
}

/// Function that loads a plugin from its shared library; the caller guarantees that the file is trusted.
pub type LoadFile = fn(&Path) -> Result<Plugin, LoadError>;

/// Loads the model, sends the greeting and serves the requests of the host. Returns when the host has ended, or after a refusal by
/// the plugin.
///
/// # Errors
/// If standard input is not the shared memory (the process was not started as a worker), or the system cannot bind this process to
/// the host.
pub fn serve(arguments: &WorkerArguments, load: LoadFile) -> io::Result<()> {
    // Before any plugin code runs: a fatal signal raised by the plugin ends the worker even if the signal was inherited as ignored.
    ignore_no_signal();
    let host = HostProcess::new(arguments.host)?;
    let has_gone = || host.has_gone();
    if has_gone() {
        return Ok(());
    }
    let memory = SharedMemory::of_standard_input()?;
    let (greeting, model) = match prepare(arguments, load) {
        Ok((mut model, parameters)) => {
            put_extent(&mut model, &memory);
            let serves = DEMANDS.map(|demand| model.serves().contains(demand));
            let remembers = model.memory() == Memory::PathDependent;
            let has_local_model = model.has_local_model();
            (Greeting::Ready { parameters, serves, remembers, has_local_model }, Some(model))
        }
        Err(refusal) => (Greeting::Refused { kind: refusal.kind as u32, reason: refusal.reason }, None),
    };
    let greeted = greet(&memory, &serde_json::to_string(&greeting)?, has_gone);
    let (Some(mut done), Some(mut model)) = (greeted, model) else { return Ok(()) };
    enter_worker_priority();
    loop {
        let number = memory.request.load(Ordering::Acquire);
        if number == done {
            wait_for_change(&memory.request, done, HOST_CHECK_NS);
            if has_gone() {
                return Ok(());
            }
            continue;
        }
        let status = execute(&mut model, &memory);
        if status == CallStatus::Panicked {
            memory.put_message(&model.last_message());
        }
        memory.answer(number, status);
        done = number;
    }
}

fn execute(model: &mut Model, memory: &SharedMemory) -> CallStatus {
    match memory.operation() {
        Some(Operation::Step) => {
            let (input, mut output) = (memory.input(), Output::default());
            let status = model.step(&input, &mut output);
            memory.put_output(&output);
            if let Some(grip) = memory.grip() {
                memory.put_grip(Some(GripRecord { model: model.grip(&input, &grip.state), ..grip }));
            }
            status
        }
        Some(Operation::SetParameter) => {
            let value = f64::from_bits(memory.value.load(Ordering::Relaxed));
            let index = usize::try_from(memory.parameter.load(Ordering::Relaxed)).unwrap_or(usize::MAX);
            let status = model.set_parameter(index, value);
            put_extent(model, memory);
            status
        }
        Some(Operation::LocalModel) => {
            let mut set = ContactSet::NONE;
            let status = model.local_model(&memory.input(), &mut set);
            memory.put_contact_set(&set);
            status
        }
        Some(Operation::Reset) => model.reset(),
        None => CallStatus::Unsupported,
    }
}

/// Publishes active region and workspace bounds for the current parameters.
fn put_extent(model: &mut Model, memory: &SharedMemory) {
    memory.put_region(&model.active_region());
    memory.put_bounds(&model.workspace_bounds());
}

type Prepared = (Model, Vec<Option<f64>>);

fn prepare(arguments: &WorkerArguments, load: LoadFile) -> Result<Prepared, Refusal> {
    let said_no = |error| match error {
        LoadError::Refused { refusal, .. } => refusal,
        other => Refusal { kind: RefusalKind::Broken, reason: other.to_string() },
    };
    let plugin = load(&arguments.plugin).map_err(said_no)?;
    if plugin.metadata().kind != PluginKind::Model {
        return Err(Refusal::unsupported("a worker process runs models only; name a model plugin"));
    }
    let schema = plugin.parameters();
    let parse = |set: &String| {
        let (key, value) = set.split_once('=').unwrap_or((set.as_str(), ""));
        Setting::parse(schema, key, value).map_err(Refusal::parameter)
    };
    let settings: Vec<Setting> = arguments.sets.iter().map(parse).collect::<Result<_, _>>()?;
    let mut model = plugin.create_model(&settings).map_err(said_no)?;
    model.prepare(&LoopConfig { period_ns: arguments.period_ns, seed: arguments.seed })?;
    let value = |index| Some(model.parameter(index)).filter(|value| value.is_finite());
    let parameters = (0..schema.len()).map(value).collect();
    Ok((model, parameters))
}

/// Sends the greeting to the host in pieces that fit into a message. Each piece has a number; the host confirms a piece with a
/// request under its number, and only then the next piece is sent. Returns the last number, from which requests are counted; `None`
/// if the host has ended.
fn greet(memory: &SharedMemory, text: &str, has_gone: impl Fn() -> bool) -> Option<u32> {
    let (mut left, mut number) = (text, 0_u32);
    loop {
        let fits = (0..=MESSAGE_BYTES.min(left.len())).rev().find(|end| left.is_char_boundary(*end));
        let (piece, rest) = left.split_at(fits.unwrap_or(0));
        left = rest;
        number = number.wrapping_add(1);
        memory.put_message(piece);
        memory.answer(number, if left.is_empty() { WHOLE } else { MORE_TO_COME });
        loop {
            let asked = memory.request.load(Ordering::Acquire);
            // A host that has received the last piece may already have sent its first request.
            if asked.wrapping_sub(number) <= 1 {
                break;
            }
            wait_for_change(&memory.request, asked, HOST_CHECK_NS);
            if has_gone() {
                return None;
            }
        }
        if left.is_empty() {
            memory.put_message(""); // from now on: the model's last message
            return Some(number);
        }
    }
}

/// Status of the last piece of a greeting; [`MORE_TO_COME`] is the status of the earlier pieces.
pub(super) const WHOLE: CallStatus = CallStatus::Ok;
const MORE_TO_COME: CallStatus = CallStatus::WrongPhase;

#[cfg(test)]
mod tests {
    use super::super::memory::mapped;
    use super::super::parent::receive_text;
    use super::*;

    #[test]
    fn a_greeting_of_any_length_is_heard_as_it_was_said() {
        for text in [String::new(), "x".repeat(MESSAGE_BYTES), "µ is longer than m. ".repeat(200)] {
            let Some([here, there]) = mapped() else { return };
            let said = text.clone();
            let worker = std::thread::spawn(move || greet(&there, &said, || false));
            let (number, told) = receive_text(&here, || false).expect("it says something");
            assert_eq!(told, text);
            assert_eq!(worker.join().expect("it greets"), Some(number));
        }
    }

    #[test]
    fn a_host_that_asks_at_once_is_not_waited_for() {
        let Some([memory]) = mapped() else { return };
        memory.request.store(2, Ordering::Release); // it has heard the one piece, and wants a step
        assert_eq!(greet(&memory, "hello", || true), Some(1));
    }

    #[test]
    fn a_greeting_that_nobody_hears_ends_with_the_host() {
        let Some([memory]) = mapped() else { return };
        assert_eq!(greet(&memory, "hello", || true), None);
    }
}
