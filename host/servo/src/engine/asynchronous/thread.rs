//! Model on a thread of its own, at its own rate.
//!
//! Loop and thread share two latest-value cells, a queue of commands and two flags; neither waits for the other.

use super::Arrival;
use crate::engine::field_words::{FIELD_WORDS, Sent};
use crate::{Engine, Stepped, THREAD_ADVICE, enter_worker_priority};
use flotor_hal::abi::CallStatus;
use flotor_hal::{Demand, Input, LinearField, Pose, Refusal, Twist};
use flotor_sync::{Observer, Publisher, Words, latest};
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Capacity of the command queue between two fields.
const OPERATIONS: usize = 64;

/// Handle sample sent to the model thread.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HandleSample {
    pose: Pose,
    twist: Twist,
    time_ns: u64,
    tick: u64,
    buttons: u32,
}

const SAMPLE_WORDS: usize = 7 + 6 + 3;

impl Words<SAMPLE_WORDS> for HandleSample {
    fn to_words(&self) -> [u64; SAMPLE_WORDS] {
        let [px, py, pz] = self.pose.position_m.map(f64::to_bits);
        let [qx, qy, qz, qw] = self.pose.orientation_xyzw.map(f64::to_bits);
        let [vx, vy, vz] = self.twist.linear_m_per_s.map(f64::to_bits);
        let [wx, wy, wz] = self.twist.angular_rad_per_s.map(f64::to_bits);
        [px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz, self.time_ns, self.tick, self.buttons.into()]
    }

    fn from_words(words: &[u64; SAMPLE_WORDS]) -> Self {
        let [px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz, time_ns, tick, buttons] = *words;
        let three = |numbers: [u64; 3]| numbers.map(f64::from_bits);
        Self {
            pose: Pose {
                position_m: three([px, py, pz]),
                orientation_xyzw: [qx, qy, qz, qw].map(f64::from_bits),
            },
            twist: Twist { linear_m_per_s: three([vx, vy, vz]), angular_rad_per_s: three([wx, wy, wz]) },
            time_ns,
            tick,
            #[allow(clippy::cast_possible_truncation)] // the 32 bits written
            buttons: buttons as u32,
        }
    }
}

/// Command that the model executes before its next field.
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

/// Loop side of the model thread.
pub(super) struct ModelThread {
    samples: Publisher<HandleSample, SAMPLE_WORDS>,
    fields: Observer<Sent, FIELD_WORDS>,
    operations: Producer<Operation>,
    flags: Arc<Flags>,
    /// Version of the newest field taken.
    taken: u64,
    /// Time of the last reset, ns; fields of older samples are dropped.
    forgotten_ns: u64,
    now_ns: u64,
}

impl ModelThread {
    /// Starts a thread that computes a field each period while samples arrive. Not real-time.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub(super) fn start(model: Engine, period_ns: u64) -> Result<Self, Refusal> {
        let at_home = HandleSample { pose: Pose::HOME, twist: Twist::ZERO, time_ns: 0, tick: 0, buttons: 0 };
        let (samples, seen) = latest(at_home);
        let (sent, fields) = latest(Sent(LinearField::NONE));
        let (operations, pending) = RingBuffer::new(OPERATIONS);
        let flags = Arc::new(Flags::default());
        let computer = Computer {
            demand: model.serves().limited_to(Demand::WRENCH),
            model,
            samples: seen,
            fields: sent,
            operations: pending,
            flags: Arc::clone(&flags),
            looked_ns: None,
        };
        let thread = std::thread::Builder::new().name("flotor-field".to_owned());
        // Never joined: a model that hangs must not delay its owner.
        let started = thread.spawn(move || computer.run(Duration::from_nanos(period_ns)));
        started.map_err(|error| {
            Refusal::resource(format!(
                "cannot start a thread for an asynchronous model: {error}; {THREAD_ADVICE}"
            ))
        })?;
        Ok(Self { samples, fields, operations, flags, taken: 0, forgotten_ns: 0, now_ns: 0 })
    }

    /// Publishes the handle sample and takes a new field, if there is one. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn poll(&mut self, input: &Input) -> Arrival {
        let Input { pose, twist, time_ns, tick, buttons, .. } = *input;
        self.samples.publish(&HandleSample { pose, twist, time_ns, tick, buttons });
        self.now_ns = time_ns;
        if self.flags.is_broken.load(Ordering::Acquire) {
            return Arrival::Broken;
        }
        match self.fields.read() {
            Some((version, Sent(field))) if version > self.taken => {
                self.taken = version;
                if field.time_ns < self.forgotten_ns { Arrival::Nothing } else { Arrival::Field(field) }
            }
            _ => Arrival::Nothing,
        }
    }

    /// Queues a change of a live parameter. Real-time: bounded, no allocation.
    pub(super) fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        self.enqueue(Operation::Set { index, value })
    }

    /// Queues a reset and drops fields of older samples. Real-time: bounded, no allocation.
    pub(super) fn reset(&mut self) -> CallStatus {
        self.forgotten_ns = self.now_ns.saturating_add(1);
        self.enqueue(Operation::Reset)
    }

    fn enqueue(&mut self, operation: Operation) -> CallStatus {
        match self.operations.push(operation) {
            Ok(()) => CallStatus::Ok,
            Err(_) => CallStatus::Unsupported,
        }
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

/// Thread side, which computes the fields.
struct Computer {
    model: Engine,
    demand: Demand,
    samples: Observer<HandleSample, SAMPLE_WORDS>,
    fields: Publisher<Sent, FIELD_WORDS>,
    operations: Consumer<Operation>,
    flags: Arc<Flags>,
    looked_ns: Option<u64>,
}

impl Computer {
    fn run(mut self, period: Duration) {
        enter_worker_priority();
        let (mut deadline, mut seen) = (Instant::now(), 0);
        while !self.flags.is_over.load(Ordering::Acquire) {
            let executed = self.execute();
            let answered = match self.samples.read() {
                Some((version, sample)) if version > seen => {
                    seen = version;
                    self.answer(&sample)
                }
                _ => CallStatus::Ok,
            };
            if executed == CallStatus::Panicked || answered != CallStatus::Ok {
                let _ = self.flags.last_words.set(self.model.last_message());
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
                Operation::Set { index, value } => self.model.set_parameter(index, value),
                Operation::Reset => {
                    self.looked_ns = None;
                    self.model.reset()
                }
            };
            if status == CallStatus::Panicked {
                worst = status;
            }
        }
        worst
    }

    fn answer(&mut self, sample: &HandleSample) -> CallStatus {
        let HandleSample { pose, twist, time_ns, tick, buttons } = *sample;
        let dt_ns = self.looked_ns.map_or(0, |before_ns| time_ns.saturating_sub(before_ns));
        self.looked_ns = Some(time_ns);
        let input = Input { pose, twist, time_ns, dt_ns, tick, buttons, demand: self.demand };
        let mut field = LinearField::NONE;
        match self.model.linear_field(&input, &mut field) {
            Stepped::Answered => {
                field.time_ns = time_ns;
                self.fields.publish(&Sent(field));
                CallStatus::Ok
            }
            // The field may come the next time.
            Stepped::Late | Stepped::Silent => CallStatus::Ok,
            Stepped::Broken | Stepped::Gone => CallStatus::Panicked,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::Wrench;

    #[test]
    fn looks_and_fields_cross_bit_for_bit() {
        let mut number = 0.0;
        let mut next = || {
            number += 0.1;
            number
        };
        let pose = Pose {
            position_m: std::array::from_fn(|_| next()),
            orientation_xyzw: std::array::from_fn(|_| next()),
        };
        let twist = Twist {
            linear_m_per_s: std::array::from_fn(|_| next()),
            angular_rad_per_s: std::array::from_fn(|_| next()),
        };
        let sample = HandleSample { pose, twist, time_ns: u64::MAX, tick: 7, buttons: u32::MAX };
        assert_eq!(HandleSample::from_words(&sample.to_words()), sample);
        let field = LinearField {
            anchor: pose,
            wrench: Wrench {
                force_n: std::array::from_fn(|_| next()),
                torque_nm: std::array::from_fn(|_| next()),
            },
            stiffness: std::array::from_fn(|_| std::array::from_fn(|_| next())),
            valid_m: f64::INFINITY,
            valid_rad: next(),
            time_ns: 12_345,
        };
        assert_eq!(Sent::from_words(&Sent(field).to_words()), Sent(field));
    }
}
