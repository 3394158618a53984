//! Rules of a device: its description, its life cycle, and its stop.

use super::Seen;
use super::path::CONFIG;
use crate::wording;
use flotor_core::plausibility::{PoseBounds, is_rotation};
use flotor_hal::abi::loader::{ActiveDevice, OpenedDevice, Stopper};
use flotor_hal::{Axes, Capabilities, Conditions, Cycle, DVec3, DeviceState, Fault, Tick, Wrench};
use flotor_session::LatchGuard;
use std::time::{Duration, Instant};

/// How long a device may take for what is to happen soon: a sample, a force, its end.
const PATIENCE: Duration = Duration::from_secs(2);
/// Time between two ticks that wait for something, roughly.
const TICK: Duration = Duration::from_millis(1);

/// How often a device is asked what it can do, before it is energised and after.
const ASKED: usize = 10;

/// The loader refuses what no host can enforce, and what is not what was told before.
pub(super) fn capabilities(mut device: OpenedDevice) -> Result<(), String> {
    let ask = |device: &mut OpenedDevice| {
        (0..ASKED).try_for_each(|_| device.capabilities().map(drop)).map_err(|refusal| refusal.to_string())
    };
    ask(&mut device)?;
    // One that cannot be energised breaks another rule.
    let Ok(active) = device.activate(&CONFIG) else { return Ok(()) };
    active.deactivate().map_or(Ok(()), |mut device| ask(&mut device))
}

pub(super) fn lifecycle(mut device: OpenedDevice) -> Result<(), String> {
    const TICKS: u64 = 100;
    for _ in 0..2 {
        let mut running = Running::start(device)?;
        let started = Instant::now();
        let mut samples = 0;
        // One sample may be what the device had before; another shows that they come.
        while running.ticks < TICKS || samples < 2 || !running.takes_commands() {
            samples += u64::from(running.turn(&Wrench::ZERO)? == Cycle::Fresh);
            if running.ticks >= TICKS {
                if started.elapsed() > PATIENCE {
                    return Err(match samples {
                        0 => format!("no fresh sample within {}", wording::time(PATIENCE)),
                        1 => format!("no second sample within {}", wording::time(PATIENCE)),
                        _ => format!("no write took a command within {}", wording::time(PATIENCE)),
                    });
                }
                std::thread::sleep(TICK);
            }
        }
        if let Sampled { count: 2.., first, last } = running.sampled
            && first == last
        {
            return Err(format!("every sample says that it was taken at {first} ns"));
        }
        device = running.device.deactivate().ok_or("deactivate failed")?;
    }
    Ok(())
}

/// Times each call as a loop would feel it. A machine under load delays some of them: of reads and writes the fastest
/// quarter counts, of stops the fastest of three.
pub(super) fn time(mut device: OpenedDevice) -> Result<(), String> {
    const TICKS: u64 = 200;
    const STOP: Duration = Duration::from_millis(100);
    let stopper = device.stopper();
    let mut stops = Vec::new();
    for _ in 0..3 {
        let started = Instant::now();
        let mut running = Running::start(device)?;
        within("activate", started.elapsed(), PATIENCE)?;
        for _ in 0..TICKS {
            let _ = running.turn(&Wrench::ZERO)?;
        }
        // What is slower than 1 kHz has the time of its own rate.
        let period_s = (CONFIG.period_ns as f64 * 1.0e-9).max(1.0 / running.told.rate_hz[1]);
        let limit = Duration::from_secs_f64(period_s / 2.0);
        for (call, took) in ["read", "write"].into_iter().zip(&mut running.took) {
            took.sort_unstable();
            within(call, took.get(took.len() / 4).copied().unwrap_or_default(), limit)?;
        }
        let started = Instant::now();
        stopper.safe_stop();
        stops.push(started.elapsed());
        let started = Instant::now();
        device = running.device.deactivate().ok_or("deactivate failed")?;
        within("deactivate", started.elapsed(), PATIENCE)?;
    }
    within("safe_stop", stops.into_iter().min().unwrap_or_default(), STOP)
}

fn within(call: &str, took: Duration, limit: Duration) -> Result<(), String> {
    if took <= limit {
        return Ok(());
    }
    let [took, limit] = [took, limit].map(wording::time);
    Err(format!("{call} takes {took}, above the limit of {limit}"))
}

pub(super) fn safe_stop(mut device: OpenedDevice) -> Result<(), Seen> {
    let push = push(&device.capabilities().map_err(|refusal| refusal.to_string())?);
    // Only its description is checked: the message is for a device that has no host any more.
    let _ = device.independent_stop().map_err(|refusal| refusal.to_string())?;
    let stopper = device.stopper();
    let mut running = Running::start(device)?;
    if push != Wrench::ZERO {
        running.feel(&push)?;
    }
    let stopping = std::thread::Builder::new().spawn(move || stopper.safe_stop());
    let stopping = stopping.map_err(|cause| Seen::no_thread(&cause))?;
    stopping.join().map_err(|_| "safe_stop panicked".to_owned())?;
    Ok(running.feel_nothing(&push)?)
}

/// What to push with: no more than a newton, along the first axis that is driven; nothing where none is.
fn push(told: &Capabilities) -> Wrench {
    let axes = [(Axes::Z, DVec3::Z), (Axes::X, DVec3::X), (Axes::Y, DVec3::Y)];
    let limit_n = DVec3::from_array(told.max_force_n).min(DVec3::ONE);
    let driven =
        axes.into_iter().find(|(axis, unit)| told.actuated.contains(*axis) && limit_n.dot(*unit) > 0.0);
    driven.map_or(Wrench::ZERO, |(_, unit)| Wrench::from_force(unit * limit_n))
}

/// A device in a loop without a model.
pub(super) struct Running {
    pub(super) device: ActiveDevice,
    stopper: Stopper,
    latch: LatchGuard,
    told: Capabilities,
    state: DeviceState,
    ticks: u64,
    commands_taken: u64,
    sampled: Sampled,
    /// Of reads and of writes.
    took: [Vec<Duration>; 2],
}

/// What fresh samples say about their time.
#[derive(Clone, Copy, Default)]
struct Sampled {
    count: u64,
    first: u64,
    last: u64,
}

/// All conditions of the contract.
const KNOWN: Conditions = Conditions::SATURATED.with(Conditions::EXCESS_FORCE).with(Conditions::NOISY);

/// How far ahead of its tick a sample may be, ns: a tick is scheduled, and here no clock waits for it.
const AHEAD_NS: u64 = 60_000_000_000;

/// Why a tick could not be used.
pub(super) struct Trouble {
    fault: Option<Fault>,
    words: String,
}

impl From<Trouble> for String {
    fn from(trouble: Trouble) -> Self {
        trouble.words
    }
}

impl Running {
    pub(super) fn start(mut device: OpenedDevice) -> Result<Self, String> {
        let told = device.capabilities().map_err(|refusal| refusal.to_string())?;
        let latch = LatchGuard::of_this_user();
        latch.check().map_err(|error| error.to_string())?;
        let stopper = device.stopper();
        let device = device.activate(&CONFIG).map_err(|(_, refusal)| refusal.to_string())?;
        Ok(Self {
            device,
            stopper,
            latch,
            told,
            state: DeviceState::HOME,
            ticks: 0,
            commands_taken: 0,
            sampled: Sampled::default(),
            took: [Vec::new(), Vec::new()],
        })
    }

    /// One tick: a sample, and a wrench.
    pub(super) fn turn(&mut self, wrench: &Wrench) -> Result<Cycle, Trouble> {
        let index = self.ticks;
        let dt_ns = if index == 0 { 0 } else { CONFIG.period_ns };
        let tick = Tick { index, time_ns: index * CONFIG.period_ns, dt_ns };
        self.ticks += 1;
        // Not real-time: whoever presses the emergency stop of the machine means this device, too.
        if let Err(pressed) = self.latch.check() {
            self.stopper.safe_stop();
            return Err(Trouble { fault: None, words: pressed.to_string() });
        }
        let fault_of = |call: &str, fault: Fault| {
            let words = format!("{call} at tick {index}: {}", fault.advice());
            Trouble { fault: Some(fault), words }
        };
        let started = Instant::now();
        let sampled = self.device.read(&tick, &mut self.state);
        let read = started.elapsed();
        if let Cycle::Fault(fault) = sampled {
            return Err(fault_of("read", fault));
        }
        self.plausible(sampled, &tick)
            .map_err(|words| Trouble { fault: None, words: format!("read at tick {index} gave {words}") })?;
        let started = Instant::now();
        let taken = self.device.write(&tick, wrench);
        for (took, time) in self.took.iter_mut().zip([read, started.elapsed()]) {
            took.push(time);
        }
        if let Cycle::Fault(fault) = taken {
            return Err(fault_of("write", fault));
        }
        self.commands_taken += u64::from(taken == Cycle::Fresh);
        Ok(sampled)
    }

    /// Whether a sample can be.
    fn plausible(&mut self, sampled: Cycle, tick: &Tick) -> Result<(), String> {
        let state = &self.state;
        if !state.is_finite() || !state.delivered.is_finite() {
            return Err(format!("{} is not finite", wording::sample(state)));
        }
        // A sensor without a pose may leave it as it likes.
        if sampled != Cycle::Fresh || self.told.sensed == Axes::NONE {
            return Ok(());
        }
        let orientation = state.pose.orientation();
        if !is_rotation(orientation) {
            return Err(format!("a quaternion of length {}, not 1", orientation.length()));
        }
        if !PoseBounds::of(&self.told).contain(&state.pose) {
            let Capabilities { range_m, range_rad, .. } = self.told;
            return Err(format!(
                "{}, beyond twice its range {} m and {} rad",
                wording::pose(&state.pose),
                wording::vector(range_m.into()),
                wording::vector(range_rad.into())
            ));
        }
        if !KNOWN.contains(state.conditions) {
            return Err("`conditions` has bits that the contract does not define".to_owned());
        }
        let Sampled { count, first, last } = self.sampled;
        let now = state.sampled_ns;
        if now > tick.time_ns.saturating_add(AHEAD_NS) {
            return Err(format!("a sample of {now} ns at {} ns", tick.time_ns));
        }
        if count > 0 && now < last {
            return Err(format!("a sample of {now} ns after one of {last} ns"));
        }
        self.sampled = Sampled { count: count + 1, first: if count == 0 { now } else { first }, last: now };
        Ok(())
    }

    /// Whether it has taken a command; one that drives nothing need not.
    fn takes_commands(&self) -> bool {
        self.commands_taken > 0 || self.told.actuated == Axes::NONE
    }

    fn delivers(&self) -> bool {
        self.state.delivered != Wrench::ZERO
    }

    /// Pushes until the device says that it does. One that never says so would pass every stop.
    fn feel(&mut self, push: &Wrench) -> Result<(), String> {
        let started = Instant::now();
        while !self.delivers() {
            if started.elapsed() > PATIENCE {
                return Err(format!(
                    "commanded {} N, it reports no force for {}, so its stop cannot be checked",
                    push.force(),
                    wording::time(PATIENCE)
                ));
            }
            let _ = self.turn(push)?;
            std::thread::sleep(TICK);
        }
        Ok(())
    }

    /// Goes on pushing a device that was stopped: it has to answer, and to give nothing.
    fn feel_nothing(&mut self, push: &Wrench) -> Result<(), String> {
        const SAMPLES: u64 = 20;
        let started = Instant::now();
        let mut at_rest = 0;
        while at_rest < SAMPLES {
            if started.elapsed() > PATIENCE {
                return Err(match self.delivers() {
                    true => format!("it still delivers {}", wording::wrench(&self.state.delivered)),
                    false => format!(
                        "it has given {at_rest} samples in {} since it was stopped",
                        wording::time(PATIENCE)
                    ),
                });
            }
            match self.turn(push) {
                // A stop that says so is an answer, and gives no force.
                Err(Trouble { fault: Some(Fault::EmergencyStop), .. }) => return Ok(()),
                Err(trouble) => return Err(format!("after safe_stop, {}", trouble.words)),
                Ok(Cycle::Fresh) if !self.delivers() => at_rest += 1,
                Ok(Cycle::Fresh) => {
                    at_rest = 0;
                    std::thread::sleep(TICK);
                }
                Ok(_) => std::thread::sleep(TICK),
            }
        }
        Ok(())
    }
}
