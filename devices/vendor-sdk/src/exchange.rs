//! Between the thread of an SDK and the loop: the newest sample one way, the newest wrench the other.
//!
//! Force goes with either side. A wrench that the loop does not renew within [`VALID`] counts as none; after
//! [`Exchange::stop`] there is none but zero; a sample that does not come is stale, then a fault.

use crate::latest::Latest;
use flotor_hal::{Conditions, DeviceState, Fault, Pose, Twist, Wrench};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long a wrench is valid without another one: longer than a loop is late, shorter than a hand is carried far.
pub const VALID: Duration = Duration::from_millis(20);
/// How long either side waits for the other in lockstep.
const PATIENCE: Duration = Duration::from_secs(1);
/// Longest sleep of the thread of the SDK in lockstep.
const SLICE: Duration = Duration::from_millis(1);
/// How long a stop waits until zero was sent.
const STOP_WITHIN: Duration = Duration::from_millis(20);
/// Pause between two looks while a stop waits.
const LOOK: Duration = Duration::from_micros(100);
/// Words of a sample: pose 7, twist 6, delivered wrench 6, buttons, conditions.
const SAMPLE_WORDS: usize = 21;

/// Who waits for whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Nobody: each takes the newest of the other.
    Real,
    /// Each waits for the other, for a second at most: for hosts on a virtual clock over a simulated device.
    Lockstep,
}

/// What the thread of an SDK measures in a cycle, in the device frame of the contract.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Pose of the handle, m and unit quaternion.
    pub pose: Pose,
    /// Its velocity, m/s and rad/s.
    pub twist: Twist,
    /// What the device says it gave, N and N·m.
    pub delivered: Wrench,
    /// Buttons, one bit each.
    pub buttons: u32,
    /// What else is to be known.
    pub conditions: Conditions,
}

/// The place where both meet.
#[derive(Debug)]
pub struct Exchange {
    pace: Pace,
    sample: Latest<SAMPLE_WORDS>,
    command: Latest<6>,
    /// Code of a [`Fault`]; 0: none.
    fault: AtomicU32,
    is_stopped: AtomicBool,
    /// Whether nothing but zero is on its way to the device.
    is_quiet: AtomicBool,
    /// Whether the thread of the SDK is to end.
    is_over: AtomicBool,
    /// Samples there were when it began.
    begun_at: AtomicU64,
    gate: Mutex<()>,
    changed: Condvar,
}

/// What the thread of an SDK knows of the loop's wrenches.
#[derive(Debug)]
pub struct Orders {
    seen: u64,
    renewed: Instant,
    wrench: Wrench,
}

impl Exchange {
    /// Without sample, wrench and fault.
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

    /// A new sample. On the thread of the SDK.
    pub fn publish(&self, sample: &Sample) {
        let mut words = [0; SAMPLE_WORDS];
        let Sample { pose, twist, delivered, buttons, conditions } = sample;
        let numbers = pose.position_m.iter().chain(&pose.orientation_xyzw);
        let numbers = numbers.chain(&twist.linear_m_per_s).chain(&twist.angular_rad_per_s);
        let numbers =
            numbers.chain(&delivered.force_n).chain(&delivered.torque_nm).map(|number| number.to_bits());
        let saturated = u64::from(conditions.contains(Conditions::SATURATED));
        words
            .iter_mut()
            .zip(numbers.chain([u64::from(*buttons), saturated]))
            .for_each(|(place, word)| *place = word);
        self.sample.put(&words);
        self.tell();
    }

    /// The device cannot go on. The first reason is kept. On the thread of the SDK.
    pub fn fail(&self, fault: Fault) {
        let _ = self.fault.compare_exchange(0, fault as u32, Ordering::AcqRel, Ordering::Acquire);
        self.tell();
    }

    /// What to send now. In lockstep, waits for the loop. On the thread of the SDK.
    pub fn next_wrench(&self, orders: &mut Orders) -> Wrench {
        if self.pace == Pace::Lockstep {
            self.wait_for_command(orders.seen);
        }
        if let Some((count, words)) = self.command.get()
            && count != orders.seen
        {
            let [x, y, z, rx, ry, rz] = words.map(f64::from_bits);
            orders.wrench = Wrench { force_n: [x, y, z], torque_nm: [rx, ry, rz] };
            (orders.seen, orders.renewed) = (count, Instant::now());
        }
        let is_expired = self.pace == Pace::Real && orders.renewed.elapsed() > VALID;
        // Whoever stops sees that force is on its way, or this sees the stop: never neither.
        self.is_quiet.store(false, Ordering::SeqCst);
        if is_expired || self.is_over() || self.is_stopped.load(Ordering::SeqCst) {
            return Wrench::ZERO;
        }
        orders.wrench
    }

    fn wait_for_command(&self, seen: u64) {
        let since = Instant::now();
        let is_due = || self.command.count() > seen || self.is_over() || self.is_stopped();
        // In slices: a stop may not take the lock to wake anybody.
        while !is_due() && since.elapsed() < PATIENCE {
            self.wait(SLICE, is_due);
        }
    }

    /// What was sent. On the thread of the SDK.
    pub fn note_sent(&self, wrench: &Wrench) {
        self.is_quiet.store(*wrench == Wrench::ZERO, Ordering::SeqCst);
    }

    /// The thread of the SDK sends nothing any more, and force is off.
    pub fn note_silence(&self) {
        self.is_quiet.store(true, Ordering::SeqCst);
    }

    /// Whether the thread of the SDK is to end.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Acquire)
    }

    // ------------------------------------------------------------ the loop and everybody else

    /// Begins anew: no wrench, no fault, not stopped; samples count on. What it returns goes to the thread of the SDK. Not
    /// real-time.
    #[must_use]
    pub fn begin(&self) -> Orders {
        self.command.put(&[0; 6]);
        self.begun_at.store(self.samples(), Ordering::Release);
        self.fault.store(0, Ordering::Release);
        self.is_stopped.store(false, Ordering::SeqCst);
        self.is_over.store(false, Ordering::Release);
        Orders { seen: self.command.count(), renewed: Instant::now(), wrench: Wrench::ZERO }
    }

    /// Asks the thread of the SDK to end.
    pub fn end(&self) {
        self.is_over.store(true, Ordering::Release);
        self.tell();
    }

    /// No force from now on, from any thread: returns when zero was sent, after 20 ms at the latest. No lock, no allocation.
    pub fn stop(&self) {
        self.is_stopped.store(true, Ordering::SeqCst);
        let since = Instant::now();
        while !self.is_quiet.load(Ordering::SeqCst) && since.elapsed() < STOP_WITHIN {
            std::thread::sleep(LOOK);
        }
    }

    /// Whether it is stopped.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::SeqCst)
    }

    /// Number of samples before it began.
    pub(crate) fn begun_at(&self) -> u64 {
        self.begun_at.load(Ordering::Acquire)
    }

    /// Number of samples so far.
    pub(crate) fn samples(&self) -> u64 {
        self.sample.count()
    }

    /// What is wrong.
    pub(crate) fn fault(&self) -> Option<Fault> {
        Fault::from_code(self.fault.load(Ordering::Acquire))
    }

    /// The newest sample, and how many there were.
    pub(crate) fn newest(&self) -> Option<(u64, DeviceState)> {
        let (count, words) = self.sample.get()?;
        let numbers = words.map(f64::from_bits);
        let [x, y, z, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz, fx, fy, fz, tx, ty, tz, ..] = numbers;
        let [.., buttons, saturated] = words;
        let state = DeviceState {
            pose: Pose { position_m: [x, y, z], orientation_xyzw: [qx, qy, qz, qw] },
            twist: Twist { linear_m_per_s: [vx, vy, vz], angular_rad_per_s: [wx, wy, wz] },
            delivered: Wrench { force_n: [fx, fy, fz], torque_nm: [tx, ty, tz] },
            sampled_ns: 0,
            buttons: u32::try_from(buttons).unwrap_or(0),
            conditions: if saturated == 1 { Conditions::SATURATED } else { Conditions::NONE },
        };
        (count > 0).then_some((count, state))
    }

    /// The wrench of the loop.
    pub(crate) fn command(&self, wrench: &Wrench) {
        let ([x, y, z], [rx, ry, rz]) = (wrench.force_n, wrench.torque_nm);
        self.command.put(&[x, y, z, rx, ry, rz].map(f64::to_bits));
        if self.pace == Pace::Lockstep {
            self.tell();
        }
    }

    /// Waits for a sample after so many, for so long; in lockstep for a second.
    pub(crate) fn wait_for_sample(&self, seen: u64, patience: Duration) {
        self.wait(patience, || self.samples() > seen || self.fault().is_some());
    }

    /// Whether nothing waits but the SDK itself: its thread must not spin then.
    #[must_use]
    pub fn runs_free(&self) -> bool {
        self.pace == Pace::Real || self.is_stopped()
    }

    pub(crate) fn lockstep_patience(&self) -> Option<Duration> {
        (self.pace == Pace::Lockstep).then_some(PATIENCE)
    }

    fn tell(&self) {
        // Whoever waits holds the lock while it looks, so that nothing changes unseen between its look and its sleep.
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

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::DVec3;

    const PUSH: Wrench = Wrench { force_n: [1.0, 2.0, 3.0], torque_nm: [0.1, 0.2, 0.3] };

    #[test]
    fn a_wrench_arrives_and_expires() {
        let exchange = Exchange::new(Pace::Real);
        let mut orders = exchange.begin();
        assert_eq!(exchange.next_wrench(&mut orders), Wrench::ZERO);
        exchange.command(&PUSH);
        assert_eq!(exchange.next_wrench(&mut orders), PUSH);
        std::thread::sleep(VALID * 2);
        assert_eq!(exchange.next_wrench(&mut orders), Wrench::ZERO, "the loop is gone");
        exchange.command(&PUSH);
        assert_eq!(exchange.next_wrench(&mut orders), PUSH, "and back");
    }

    #[test]
    fn after_a_stop_nothing_but_zero_is_sent_whoever_comes_first() {
        for round in 0..200_u64 {
            let exchange = Exchange::new(Pace::Real);
            let (sent, mut orders) = (Mutex::new(Wrench::ZERO), exchange.begin());
            let (exchange, sent) = (&exchange, &sent);
            std::thread::scope(|scope| {
                scope.spawn(move || {
                    while !exchange.is_over() {
                        let wrench = exchange.next_wrench(&mut orders);
                        *sent.lock().expect("nobody panics") = wrench;
                        exchange.note_sent(&wrench);
                    }
                });
                exchange.command(&PUSH);
                (0..round % 50).for_each(|_| std::hint::spin_loop());
                exchange.stop();
                assert_eq!(*sent.lock().expect("nobody panics"), Wrench::ZERO, "round {round}");
                exchange.end();
            });
        }
    }

    #[test]
    fn in_lockstep_each_sample_meets_the_wrench_that_answers_it() {
        const CYCLES: u32 = 2_000;
        let exchange = Exchange::new(Pace::Lockstep);
        let mut orders = exchange.begin();
        let exchange = &exchange;
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for cycle in 1..=CYCLES {
                    exchange.publish(&Sample {
                        pose: Pose::new(DVec3::X * f64::from(cycle), flotor_hal::DQuat::IDENTITY),
                        twist: Twist::ZERO,
                        delivered: Wrench::ZERO,
                        buttons: cycle,
                        conditions: Conditions::NONE,
                    });
                    let wrench = exchange.next_wrench(&mut orders);
                    assert_eq!(wrench.force_n[0], f64::from(cycle) * 2.0);
                }
            });
            let mut seen = 0;
            for cycle in 1..=CYCLES {
                exchange.wait_for_sample(seen, PATIENCE);
                let (count, state) = exchange.newest().expect("it was published");
                assert_eq!((count, state.buttons), (u64::from(cycle), cycle));
                seen = count;
                exchange.command(&Wrench::from_force(DVec3::X * state.pose.position_m[0] * 2.0));
            }
        });
    }
}
