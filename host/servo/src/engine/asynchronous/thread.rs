//! Model in a thread of its own, at its own rate.
//!
//! Loop and thread share two latest-value cells for each port, a queue of commands and two flags; neither waits for the other.

use super::source::Source;
use crate::{Engine, Stepped, THREAD_ADVICE, enter_worker_priority};
use flotor_core::sent::{INPUT_WORDS, SentInput, SentSet};
use flotor_core::words::CONTACT_SET_WORDS;
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, Input, MAX_PORTS, Pose, Refusal};
use flotor_sync::{Observer, Publisher, latest};
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Capacity of the command queue between two answers.
const OPERATIONS: usize = 64;

/// Command that the model executes before its next answer.
#[derive(Clone, Copy, Debug)]
enum Operation {
    Set { index: usize, value: f64 },
    Reset,
}

/// State shared by loop and model thread.
#[derive(Default)]
struct Flags {
    is_over: AtomicBool,
    is_broken: AtomicBool,
    last_words: OnceLock<String>,
}

/// Loop side of a port.
struct PortCells {
    samples: Publisher<SentInput, INPUT_WORDS>,
    sets: Observer<SentSet, CONTACT_SET_WORDS>,
    /// Version of the newest set taken.
    taken: u64,
}

/// Loop side of the model thread; dropping it ends the thread after the current answer.
pub(super) struct ModelThread {
    ports: Box<[PortCells]>,
    operations: Producer<Operation>,
    flags: Arc<Flags>,
    /// Time of the last reset, ns; sets of older samples are dropped.
    forgotten_ns: u64,
    now_ns: u64,
}

impl ModelThread {
    /// Starts a thread that computes a set for each of its ports each period while samples arrive. Not real-time.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub(super) fn start(model: Engine, ports: usize, period_ns: u64) -> Result<Self, Refusal> {
        let cells = || {
            let (samples, seen) = latest(SentInput(Input::at_rest(Pose::HOME)));
            let (sent, sets) = latest(SentSet(ContactSet::NONE));
            (PortCells { samples, sets, taken: 0 }, (seen, sent))
        };
        let (ports, computed): (Vec<_>, Vec<_>) = (0..ports.min(MAX_PORTS)).map(|_| cells()).unzip();
        let (operations, pending) = RingBuffer::new(OPERATIONS);
        let flags = Arc::new(Flags::default());
        let computer = Computer {
            source: Source::new(model),
            ports: computed,
            operations: pending,
            flags: Arc::clone(&flags),
        };
        let thread = std::thread::Builder::new().name("flotor-field".to_owned());
        // Never joined: a model that hangs must not delay its owner.
        let started = thread.spawn(move || computer.run(Duration::from_nanos(period_ns)));
        started.map_err(|error| {
            Refusal::resource(format!(
                "cannot start a thread for an asynchronous model: {error}; {THREAD_ADVICE}"
            ))
        })?;
        Ok(Self { ports: ports.into(), operations, flags, forgotten_ns: 0, now_ns: 0 })
    }

    /// Publishes the input of each port; returns [`Stepped::Broken`] for a failed model, otherwise late. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn begin(&mut self, inputs: &[Input]) -> Stepped {
        for (port, input) in self.ports.iter_mut().zip(inputs) {
            port.samples.publish(&SentInput(*input));
            self.now_ns = input.time_ns;
        }
        if self.flags.is_broken.load(Ordering::Acquire) { Stepped::Broken } else { Stepped::Late }
    }

    /// Copies a new set of a port to `set`; returns late if there is none. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn newest(&mut self, port: usize, set: &mut ContactSet) -> Stepped {
        let Some(port) = self.ports.get_mut(port) else { return Stepped::Late };
        match port.sets.read_after(port.taken) {
            Some((version, SentSet(newest))) => {
                port.taken = version;
                *set = newest;
                if newest.time_ns < self.forgotten_ns { Stepped::Late } else { Stepped::Answered }
            }
            None => Stepped::Late,
        }
    }

    /// Queues a change of a live parameter; unsupported if the queue is full. Real-time: bounded, no allocation.
    pub(super) fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        self.enqueue(Operation::Set { index, value })
    }

    /// Queues a reset and discards sets of older samples; unsupported if the queue is full. Real-time: bounded, no allocation.
    pub(super) fn reset(&mut self) -> CallStatus {
        self.forgotten_ns = self.now_ns.saturating_add(1);
        self.enqueue(Operation::Reset)
    }

    fn enqueue(&mut self, operation: Operation) -> CallStatus {
        self.operations.push(operation).map_or(CallStatus::Unsupported, |()| CallStatus::Ok)
    }

    /// Returns the last message of a failed model. Not real-time.
    pub(super) fn last_message(&self) -> String {
        self.flags.last_words.get().cloned().unwrap_or_default()
    }
}

impl Drop for ModelThread {
    fn drop(&mut self) {
        self.flags.is_over.store(true, Ordering::Release);
    }
}

/// Thread side: model and ends of the shared cells and queue.
struct Computer {
    source: Source,
    /// Newest input of each port, and the way of its sets.
    ports: Vec<(Observer<SentInput, INPUT_WORDS>, Publisher<SentSet, CONTACT_SET_WORDS>)>,
    operations: Consumer<Operation>,
    flags: Arc<Flags>,
}

impl Computer {
    fn run(mut self, period: Duration) {
        enter_worker_priority();
        let (mut deadline, mut seen) = (Instant::now(), 0);
        while !self.flags.is_over.load(Ordering::Acquire) {
            let executed = self.execute();
            let answered = self.answer(&mut seen);
            if executed == CallStatus::Panicked || answered != CallStatus::Ok {
                let _ = self.flags.last_words.set(self.source.model.last_message());
                self.flags.is_broken.store(true, Ordering::Release);
                return;
            }
            // A missed period is skipped, not caught up.
            let now = Instant::now();
            deadline = (deadline + period).max(now);
            std::thread::sleep(deadline - now);
        }
    }

    fn execute(&mut self) -> CallStatus {
        let mut worst = CallStatus::Ok;
        while let Ok(operation) = self.operations.pop() {
            let status = match operation {
                Operation::Set { index, value } => self.source.model.set_parameter(index, value),
                Operation::Reset => self.source.reset(),
            };
            if status == CallStatus::Panicked {
                worst = status;
            }
        }
        worst
    }

    /// Computes and publishes a set for each port, if the last port has a newer input than the one numbered `seen`.
    fn answer(&mut self, seen: &mut u64) -> CallStatus {
        let (mut inputs, mut newest) = ([Input::at_rest(Pose::HOME); MAX_PORTS], None);
        for ((samples, _), input) in self.ports.iter_mut().zip(&mut inputs) {
            newest = samples.read();
            if let Some((_, SentInput(sample))) = newest {
                *input = sample;
            }
        }
        // The loop publishes the last port last: every port has had an input by then.
        match newest {
            Some((version, _)) if version > *seen => *seen = version,
            _ => return CallStatus::Ok,
        }
        let mut sets = [ContactSet::NONE; MAX_PORTS];
        let count = self.ports.len();
        let (Some(inputs), Some(sets)) = (inputs.get(..count), sets.get_mut(..count)) else {
            return CallStatus::Ok; // there are at most so many ports
        };
        match self.source.compute(inputs, sets) {
            Stepped::Answered => {
                for ((_, published), set) in self.ports.iter_mut().zip(sets) {
                    published.publish(&SentSet(*set));
                }
                CallStatus::Ok
            }
            Stepped::Broken | Stepped::Gone => CallStatus::Panicked,
            // The next computation may yield a set.
            _ => CallStatus::Ok,
        }
    }
}
