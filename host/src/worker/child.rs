//! The worker's side: the process that holds the model.

use super::Greeting;
use super::exchange::{self, Order, wait_for_change};
use super::memory::SharedMemory;
use crate::servo::enter_worker_priority;
use clap::Args;
use flotor_hal::abi::loader::{LoadError, Model, Plugin, Setting};
use flotor_hal::abi::{CallStatus, PluginKind};
use flotor_hal::{LoopConfig, Memory, Output, Refusal, RefusalKind};
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// How often a worker nobody asks anything looks whether its host is still there, ns.
const HOST_CHECK_NS: u64 = 500_000_000;

/// What a worker is started with. Standard input is the shared memory, standard output takes the greeting.
#[derive(Args, Clone, Debug)]
pub(crate) struct WorkerArguments {
    /// The plugin's shared library
    pub(super) plugin: PathBuf,
    /// Nominal time between ticks, ns
    #[arg(long)]
    pub(super) period_ns: u64,
    /// Seed of the run
    #[arg(long)]
    pub(super) seed: u64,
    /// A parameter of the model, KEY=VALUE
    #[arg(long = "set")]
    pub(super) sets: Vec<String>,
}

/// Loads the model, says so, and steps it as long as the host asks. Ends with the host.
///
/// # Errors
/// Standard input is not the memory, or standard output is closed: nobody started this as a worker.
pub(crate) fn serve(arguments: &WorkerArguments) -> io::Result<()> {
    let memory = SharedMemory::map(io::stdin().as_fd())?;
    let host = rustix::process::getppid();
    let mut model = match prepare(arguments) {
        Ok((model, parameters)) => {
            let serves = exchange::DEMANDS.map(|demand| model.serves().contains(demand));
            let remembers = model.memory() == Memory::PathDependent;
            greet(&Greeting::Ready { parameters, serves, remembers })?;
            model
        }
        Err(refusal) => {
            return greet(&Greeting::Refused { kind: refusal.kind as u32, reason: refusal.reason });
        }
    };
    enter_worker_priority();
    let mut done = 0;
    loop {
        let number = memory.request.load(Ordering::Acquire);
        if number == done {
            wait_for_change(&memory.request, done, HOST_CHECK_NS);
            if rustix::process::getppid() != host {
                return Ok(());
            }
            continue;
        }
        let status = obey(&mut model, &memory);
        if status == CallStatus::Panicked {
            memory.put_message(&model.last_message());
        }
        memory.answer(number, status);
        done = number;
    }
}

fn obey(model: &mut Model, memory: &SharedMemory) -> CallStatus {
    match memory.order() {
        Some(Order::Step) => {
            let mut output = Output::default();
            let status = model.step(&memory.input(), &mut output);
            memory.put_output(&output);
            status
        }
        Some(Order::SetParameter) => {
            let value = f64::from_bits(memory.value.load(Ordering::Relaxed));
            let index = usize::try_from(memory.parameter.load(Ordering::Relaxed)).unwrap_or(usize::MAX);
            model.set_parameter(index, value)
        }
        Some(Order::Reset) => model.reset(),
        None => CallStatus::Unsupported,
    }
}

type Prepared = (Model, Vec<Option<f64>>);

fn prepare(arguments: &WorkerArguments) -> Result<Prepared, Refusal> {
    let said_no = |error| match error {
        LoadError::Refused { refusal, .. } => refusal,
        other => Refusal { kind: RefusalKind::Broken, reason: other.to_string() },
    };
    let plugin = Plugin::load(&arguments.plugin).map_err(said_no)?;
    if plugin.metadata().kind != PluginKind::Model {
        return Err(Refusal::unsupported("only a model can be a worker"));
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

fn greet(greeting: &Greeting) -> io::Result<()> {
    let mut out = io::stdout();
    writeln!(out, "{}", serde_json::to_string(greeting)?)?;
    out.flush()
}
