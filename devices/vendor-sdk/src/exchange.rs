//! Data exchange between the thread of an SDK and the loop: newest sample one way, newest wrench the other.
//!
//! If either side fails, the force is removed: a wrench that the loop does not renew within [`VALID`] counts as zero; after
//! [`Exchange::stop`] only zero is sent; a missing sample is stale, then a fault.

use crate::latest::Latest;
use flotor_hal::{Conditions, DeviceState, Fault, GripKind, GripState, Pose, Twist, Wrench};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Watchdog timeout of a wrench without renewal: longer than the delays of a loop, too short to move the hand far.
pub const VALID: Duration = Duration::from_millis(20);
/// Timeout of the wait for the other side in lockstep.
const PATIENCE: Duration = Duration::from_secs(1);
/// Longest sleep of the thread of the SDK in lockstep.
const SLICE: Duration = Duration::from_millis(1);
/// Timeout of [`Exchange::stop`], which waits until zero is sent.
const STOP_WITHIN: Duration = Duration::from_millis(20);
/// Poll interval of a stop.
const LOOK: Duration = Duration::from_micros(100);
/// Words of a sample: pose 7, twist 6, delivered wrench 6, grip 3, buttons, conditions.
const SAMPLE_WORDS: usize = 24;
/// Words of a command: wrench 6, effort.
const COMMAND_WORDS: usize = 7;
/// Conditions of a sample, in the order of their bits in the word.
const CONDITIONS: [Conditions; 3] = [Conditions::SATURATED, Conditions::EXCESS_FORCE, Conditions::NOISY];

/// Synchronisation of loop and SDK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// No waits: each side takes the newest data of the other.
    Real,
    /// Each side waits for the other, for a second at most: for hosts on a virtual clock with a simulated device.
    Lockstep,
}

/// Measurement of one cycle, in the device frame of the contract.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Pose of the handle, m and unit quaternion.
    pub pose: Pose,
    /// Velocity of the handle, m/s and rad/s.
    pub twist: Twist,
    /// Wrench delivered according to the device, N and N·m.
    pub delivered: Wrench,
    /// Grip, m and N; any sample of a device without one.
    pub grip: GripState,
    /// Buttons, one bit each.
    pub buttons: u32,
    /// Conditions of the device.
    pub conditions: Conditions,
}

/// Command of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Wrench on the hand, N and N·m.
    pub wrench: Wrench,
    /// Effort at the grip, N; 0 for a device without one.
    pub effort: f64,
}

impl Command {
    /// No wrench and no effort.
    pub const ZERO: Self = Self { wrench: Wrench::ZERO, effort: 0.0 };
}

/// Exchange of samples and commands, with stop and fault. In real pace the loop reads and writes without a lock.
#[derive(Debug)]
pub struct Exchange {
    pace: Pace,
    sample: Latest<SAMPLE_WORDS>,
    command: Latest<COMMAND_WORDS>,
    /// Code of a [`Fault`]; 0: none.
    fault: AtomicU32,
    is_stopped: AtomicBool,
    /// True if no force is pending: only zero was sent, or nothing.
    is_quiet: AtomicBool,
    /// Requests the end of the SDK's thread.
    is_over: AtomicBool,
    /// Number of samples at the last `begin`.
    begun_at: AtomicU64,
    gate: Mutex<()>,
    changed: Condvar,
}

/// Newest command of the loop, as seen by the thread of an SDK.
#[derive(Debug)]
pub struct CommandCursor {
    seen: u64,
    renewed: Instant,
    command: Command,
}

impl Exchange {
    /// Creates an exchange without sample, wrench and fault.
    #[must_use]
    pub fn new(pace: Pace) -> Self {
        Self {
            pace,
            sample: Latest::new(),
            command: Latest::new(),
            fault: AtomicU32::new(0),
            is_stopped: AtomicBool::new(false),
            is_quiet: AtomicBool::new(true),
            is_over: AtomicBool::new(false),
            begun_at: AtomicU64::new(0),
            gate: Mutex::new(()),
            changed: Condvar::new(),
        }
    }

    // ------------------------------------------------------------ the thread of the SDK

    /// Publishes a new sample. Called by the thread of the SDK.
    pub fn publish(&self, sample: &Sample) {
        let mut words = [0; SAMPLE_WORDS];
        let Sample { pose, twist, delivered, grip, buttons, conditions } = sample;
        let numbers = pose.position_m.iter().chain(&pose.orientation_xyzw);
        let numbers = numbers.chain(&twist.linear_m_per_s).chain(&twist.angular_rad_per_s);
        let grip = [grip.opening, grip.velocity, grip.delivered];
        let numbers = numbers.chain(&delivered.force_n).chain(&delivered.torque_nm).chain(&grip);
        let numbers = numbers.map(|number| number.to_bits());
        let numbers = numbers.chain([u64::from(*buttons), word_of(*conditions)]);
        words.iter_mut().zip(numbers).for_each(|(place, word)| *place = word);
        self.sample.put(&words);
        self.tell();
    }

    /// Reports a fault that ends the operation; only the first fault is stored. Called by the thread of the SDK.
    pub fn fail(&self, fault: Fault) {
        let _ = self.fault.compare_exchange(0, fault as u32, Ordering::AcqRel, Ordering::Acquire);
        self.tell();
    }

    /// Returns the command to send and marks it as pending until [`Self::note_sent`]. The command is the newest of the loop, or zero
    /// after [`Self::stop`] or [`Self::end`], and, in real pace, if the loop has not renewed the command within [`VALID`]. In
    /// lockstep, waits for the loop, a second at most. Called by the thread of the SDK.
    pub fn next_command(&self, cursor: &mut CommandCursor) -> Command {
        if self.pace == Pace::Lockstep {
            self.wait_for_command(cursor.seen);
        }
        if let Some((count, words)) = self.command.get()
            && count != cursor.seen
        {
            let [x, y, z, rx, ry, rz, effort] = words.map(f64::from_bits);
            cursor.command =
                Command { wrench: Wrench { force_n: [x, y, z], torque_nm: [rx, ry, rz] }, effort };
            (cursor.seen, cursor.renewed) = (count, Instant::now());
        }
        let is_expired = self.pace == Pace::Real && cursor.renewed.elapsed() > VALID;
        // Either the stopping thread sees pending force, or this thread sees the stop: one of both is certain.
        self.is_quiet.store(false, Ordering::SeqCst);
        if is_expired || self.is_over() || self.is_stopped.load(Ordering::SeqCst) {
            return Command::ZERO;
        }
        cursor.command
    }

    fn wait_for_command(&self, seen: u64) {
        let since = Instant::now();
        let is_due = || self.command.count() > seen || self.is_over() || self.is_stopped();
        // In slices, because a stop takes no lock and thus wakes no waiting thread.
        while !is_due() && since.elapsed() < PATIENCE {
            self.wait(SLICE, is_due);
        }
    }

    /// Records that `command` was sent; zero ends the wait in [`Self::stop`]. Called by the thread of the SDK.
    pub fn note_sent(&self, command: &Command) {
        self.is_quiet.store(*command == Command::ZERO, Ordering::SeqCst);
    }

    /// Records that the thread of the SDK sends no more wrenches and the force is disabled, which ends the wait in
    /// [`Self::stop`].
    pub fn note_silence(&self) {
        self.is_quiet.store(true, Ordering::SeqCst);
    }

    /// Returns whether the thread of the SDK must end.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Acquire)
    }

    // ------------------------------------------------------------ the loop and other threads

    /// Resets wrench, fault, stop and end for a new run; the sample count continues. Returns the cursor for the thread of the SDK.
    /// Not real-time.
    #[must_use]
    pub fn begin(&self) -> CommandCursor {
        self.command.put(&[0; COMMAND_WORDS]);
        self.begun_at.store(self.samples(), Ordering::Release);
        self.fault.store(0, Ordering::Release);
        self.is_stopped.store(false, Ordering::SeqCst);
        self.is_over.store(false, Ordering::Release);
        CommandCursor { seen: self.command.count(), renewed: Instant::now(), command: Command::ZERO }
    }

    /// Requests the end of the SDK's thread.
    pub fn end(&self) {
        self.is_over.store(true, Ordering::Release);
        self.tell();
    }

    /// Stops the force, from any thread, until the next [`Self::begin`]; returns once zero is sent, after 20 ms at the
    /// latest. No lock, no allocation.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::SeqCst);
        let since = Instant::now();
        while !self.is_quiet.load(Ordering::SeqCst) && since.elapsed() < STOP_WITHIN {
            std::thread::sleep(LOOK);
        }
    }

    /// Returns whether the force is stopped.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::SeqCst)
    }

    /// Returns the number of samples at the last `begin`.
    pub(crate) fn begun_at(&self) -> u64 {
        self.begun_at.load(Ordering::Acquire)
    }

    /// Returns the number of samples so far.
    pub(crate) fn samples(&self) -> u64 {
        self.sample.count()
    }

    /// Returns the first fault since the last `begin`.
    pub(crate) fn fault(&self) -> Option<Fault> {
        Fault::from_code(self.fault.load(Ordering::Acquire))
    }

    /// Returns the number of samples so far, the newest sample and its grip; `None` before the first sample, or if a writer was
    /// suspended while writing.
    pub(crate) fn newest(&self) -> Option<(u64, DeviceState, GripState)> {
        let (count, words) = self.sample.get()?;
        let numbers = words.map(f64::from_bits);
        let [x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz, fx, fy, fz, tx, ty, tz, g, vg, fg, ..] =
            numbers;
        let [.., buttons, conditions] = words;
        let state = DeviceState {
            pose: Pose { position_m: [x, y, z], orientation_xyzw: [qx, qy, qz, qw] },
            twist: Twist { linear_m_per_s: [vx, vy, vz], angular_rad_per_s: [wx, wy, wz] },
            delivered: Wrench { force_n: [fx, fy, fz], torque_nm: [tx, ty, tz] },
            sampled_ns: 0,
            buttons: u32::try_from(buttons).unwrap_or(0),
            conditions: conditions_of(conditions),
        };
        let grip = GripState::new(GripKind::Linear, g, vg).with_delivered(fg);
        (count > 0).then_some((count, state, grip))
    }

    /// Publishes the command of the loop.
    pub(crate) fn command(&self, Command { wrench, effort }: &Command) {
        let ([x, y, z], [rx, ry, rz]) = (wrench.force_n, wrench.torque_nm);
        self.command.put(&[x, y, z, rx, ry, rz, *effort].map(f64::to_bits));
        if self.pace == Pace::Lockstep {
            self.tell();
        }
    }

    /// Waits for more than `seen` samples or a fault, at most for `patience`.
    pub(crate) fn wait_for_sample(&self, seen: u64, patience: Duration) {
        self.wait(patience, || self.samples() > seen || self.fault().is_some());
    }

    /// Returns true if the thread of the SDK does not wait for the loop, and must limit its own rate.
    #[must_use]
    pub fn runs_free(&self) -> bool {
        self.pace == Pace::Real || self.is_stopped()
    }

    pub(crate) fn lockstep_patience(&self) -> Option<Duration> {
        (self.pace == Pace::Lockstep).then_some(PATIENCE)
    }

    fn tell(&self) {
        // The waiting thread checks its condition under the lock, so that no change falls between check and sleep.
        drop(self.gate.lock().unwrap_or_else(PoisonError::into_inner));
        self.changed.notify_all();
    }

    fn wait(&self, patience: Duration, is_there: impl Fn() -> bool) {
        if is_there() {
            return;
        }
        let gate = self.gate.lock().unwrap_or_else(PoisonError::into_inner);
        drop(self.changed.wait_timeout_while(gate, patience, |()| !is_there()));
    }
}

/// Returns the word with a bit for each of [`CONDITIONS`].
fn word_of(conditions: Conditions) -> u64 {
    let bit = |(number, condition): (usize, Conditions)| u64::from(conditions.contains(condition)) << number;
    CONDITIONS.into_iter().enumerate().map(bit).sum()
}

/// Returns the conditions of a word from [`word_of`].
fn conditions_of(word: u64) -> Conditions {
    let is_set = |(number, _): &(usize, Conditions)| (word >> number) & 1 == 1;
    let set = CONDITIONS.into_iter().enumerate().filter(is_set);
    set.fold(Conditions::NONE, |conditions, (_, condition)| conditions.with(condition))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::DVec3;

    const PUSH: Command =
        Command { wrench: Wrench { force_n: [1.0, 2.0, 3.0], torque_nm: [0.1, 0.2, 0.3] }, effort: -0.4 };

    #[test]
    fn a_wrench_arrives_and_expires() {
        let exchange = Exchange::new(Pace::Real);
        let mut cursor = exchange.begin();
        assert_eq!(exchange.next_command(&mut cursor), Command::ZERO);
        exchange.command(&PUSH);
        assert_eq!(exchange.next_command(&mut cursor), PUSH);
        std::thread::sleep(VALID * 2);
        assert_eq!(exchange.next_command(&mut cursor), Command::ZERO, "the loop is gone");
        exchange.command(&PUSH);
        assert_eq!(exchange.next_command(&mut cursor), PUSH, "and back");
    }

    /// Only saturation arrived.
    #[test]
    fn every_condition_of_a_sample_arrives() {
        let exchange = Exchange::new(Pace::Real);
        let sets = [Conditions::NONE, CONDITIONS[0].with(CONDITIONS[1]).with(CONDITIONS[2])];
        for conditions in CONDITIONS.into_iter().chain(sets) {
            let (pose, twist, delivered) = (Pose::HOME, Twist::ZERO, Wrench::ZERO);
            let grip = GripState::new(GripKind::Linear, 0.0, 0.0);
            exchange.publish(&Sample { pose, twist, delivered, grip, buttons: 0, conditions });
            assert_eq!(exchange.newest().map(|(_, state, _)| state.conditions), Some(conditions));
        }
    }

    #[test]
    fn after_a_stop_nothing_but_zero_is_sent_whoever_comes_first() {
        for round in 0..200_u64 {
            let exchange = Exchange::new(Pace::Real);
            let (sent, mut cursor) = (Mutex::new(Command::ZERO), exchange.begin());
            let (exchange, sent) = (&exchange, &sent);
            std::thread::scope(|scope| {
                scope.spawn(move || {
                    while !exchange.is_over() {
                        let command = exchange.next_command(&mut cursor);
                        *sent.lock().expect("nobody panics") = command;
                        exchange.note_sent(&command);
                    }
                });
                exchange.command(&PUSH);
                (0..round % 50).for_each(|_| std::hint::spin_loop());
                exchange.stop();
                assert_eq!(*sent.lock().expect("nobody panics"), Command::ZERO, "round {round}");
                exchange.end();
            });
        }
    }

    #[test]
    fn in_lockstep_each_sample_meets_the_wrench_that_answers_it() {
        const CYCLES: u32 = 2_000;
        let exchange = Exchange::new(Pace::Lockstep);
        let mut cursor = exchange.begin();
        let exchange = &exchange;
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for cycle in 1..=CYCLES {
                    exchange.publish(&Sample {
                        pose: Pose::new(DVec3::X * f64::from(cycle), flotor_hal::DQuat::IDENTITY),
                        twist: Twist::ZERO,
                        delivered: Wrench::ZERO,
                        grip: GripState::new(GripKind::Linear, f64::from(cycle), 0.5),
                        buttons: cycle,
                        conditions: Conditions::NONE,
                    });
                    let command = exchange.next_command(&mut cursor);
                    assert_eq!(command.wrench.force_n[0], f64::from(cycle) * 2.0);
                    assert_eq!(command.effort, f64::from(cycle) * 3.0);
                }
            });
            let mut seen = 0;
            for cycle in 1..=CYCLES {
                exchange.wait_for_sample(seen, PATIENCE);
                let (count, state, grip) = exchange.newest().expect("it was published");
                assert_eq!((count, state.buttons), (u64::from(cycle), cycle));
                seen = count;
                assert_eq!(grip, GripState::new(GripKind::Linear, f64::from(cycle), 0.5));
                let wrench = Wrench::from_force(DVec3::X * state.pose.position_m[0] * 2.0);
                exchange.command(&Command { wrench, effort: grip.opening * 3.0 });
            }
        });
    }
}
