//! Rules of a device: description, life cycle, stop.

use super::outcome::Outcome;
use super::path::CONFIG;
use crate::wording;
use flotor_core::plausibility::{PoseBounds, is_rotation};
use flotor_hal::{Axes, Capabilities, Conditions, Cycle, DVec3, DeviceState, Fault, Tick, Wrench};
use flotor_loader::{ActiveDevice, OpenedDevice, Stopper};
use flotor_session::LatchGuard;
use std::time::{Duration, Instant};

/// Timeout of a device for a sample, a force, or a stop.
const PATIENCE: Duration = Duration::from_secs(2);
/// Approximate time between two ticks that wait for something.
const TICK: Duration = Duration::from_millis(1);

/// Number of capability queries, before and after activation.
const ASKED: usize = 10;

/// Queries the capabilities; the loader rejects unenforceable and inconsistent capabilities.
pub(super) fn capabilities(mut device: OpenedDevice) -> Result<(), String> {
    let ask = |device: &mut OpenedDevice| {
        (0..ASKED).try_for_each(|_| device.capabilities().map(drop)).map_err(|refusal| refusal.to_string())
    };
    ask(&mut device)?;
    // A failed activation violates another rule.
    let Ok(active) = device.activate(&CONFIG) else { return Ok(()) };
    active.deactivate().map_or(Ok(()), |mut device| ask(&mut device))
}

pub(super) fn lifecycle(mut device: OpenedDevice) -> Result<(), String> {
    const TICKS: u64 = 100;
    for _ in 0..2 {
        let mut running = Running::start(device)?;
        let started = Instant::now();
        let mut samples = 0;
        // The first sample may be an old one of the device; a second proves that samples arrive.
        while running.ticks < TICKS || samples < 2 || !running.takes_commands() {
            samples += u64::from(running.turn(&Wrench::ZERO)? == Cycle::Fresh);
            if running.ticks >= TICKS {
                if started.elapsed() > PATIENCE {
                    return Err(match samples {
                        0 => format!("read returned no fresh sample within {}", wording::time(PATIENCE)),
                        1 => {
                            format!("read returned no second fresh sample within {}", wording::time(PATIENCE))
                        }
                        _ => format!("write accepted no command within {}", wording::time(PATIENCE)),
                    });
                }
                std::thread::sleep(TICK);
            }
        }
        if let Sampled { count: 2.., first, last } = running.sampled
            && first == last
        {
            return Err(format!(
                "every sample has the same `sampled_ns`, {first} ns; set `sampled_ns` to the time of the sample"
            ));
        }
        device = running.device.deactivate().ok_or("deactivate failed")?;
    }
    Ok(())
}

/// Times each call of a device. A machine under load delays some calls: of reads and writes the fastest quarter counts,
/// of stops the fastest of three.
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
        // A device slower than 1 kHz has the period of its own rate.
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

pub(super) fn safe_stop(mut device: OpenedDevice) -> Result<(), Outcome> {
    let push = push(&device.capabilities().map_err(|refusal| refusal.to_string())?);
    // Check only its description: its message is for a device without a host.
    let _ = device.independent_stop().map_err(|refusal| refusal.to_string())?;
    let stopper = device.stopper();
    let mut running = Running::start(device)?;
    if push != Wrench::ZERO {
        running.feel(&push)?;
    }
    // Reads and writes go on meanwhile: the stop comes in the middle of them.
    let stopping = std::thread::Builder::new().spawn(move || {
        std::thread::sleep(5 * TICK);
        stopper.safe_stop();
    });
    let stopping = stopping.map_err(|cause| Outcome::no_thread(&cause))?;
    let mut went_on = Ok(());
    while went_on.is_ok() && !stopping.is_finished() {
        went_on = running.push_on(&push);
    }
    stopping.join().map_err(|_| "safe_stop panicked".to_owned())?;
    went_on?;
    Ok(running.feel_nothing(&push)?)
}

/// Returns the wrench to push with: at most a newton along the first actuated axis; zero without one.
fn push(told: &Capabilities) -> Wrench {
    let axes = [(Axes::Z, DVec3::Z), (Axes::X, DVec3::X), (Axes::Y, DVec3::Y)];
    let limit_n = DVec3::from_array(told.max_force_n).min(DVec3::ONE);
    let driven =
        axes.into_iter().find(|(axis, unit)| told.actuated.contains(*axis) && limit_n.dot(*unit) > 0.0);
    driven.map_or(Wrench::ZERO, |(_, unit)| Wrench::from_force(unit * limit_n))
}

/// Active device in a loop without a model.
pub(super) struct Running {
    pub(super) device: ActiveDevice,
    stopper: Stopper,
    latch: LatchGuard,
    told: Capabilities,
    state: DeviceState,
    ticks: u64,
    commands_taken: u64,
    sampled: Sampled,
    /// Durations of reads and of writes.
    took: [Vec<Duration>; 2],
}

/// Sequence and times of fresh samples.
#[derive(Clone, Copy, Default)]
struct Sampled {
    count: u64,
    first: u64,
    last: u64,
}

/// Conditions defined by the contract.
const KNOWN: Conditions = Conditions::SATURATED.with(Conditions::EXCESS_FORCE).with(Conditions::NOISY);

/// Largest time of a sample ahead of its tick, ns: ticks are scheduled, and here none waits for the clock.
const AHEAD_NS: u64 = 60_000_000_000;

/// Reason why a tick failed.
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

    /// Runs one tick: reads a sample, writes a wrench.
    pub(super) fn turn(&mut self, wrench: &Wrench) -> Result<Cycle, Trouble> {
        let index = self.ticks;
        let dt_ns = if index == 0 { 0 } else { CONFIG.period_ns };
        let tick = Tick { index, time_ns: index * CONFIG.period_ns, dt_ns };
        self.ticks += 1;
        // Not real-time: the machine's emergency stop applies to this device too.
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
            .map_err(|words| Trouble { fault: None, words: format!("read at tick {index}: {words}") })?;
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

    /// Checks that a sample is plausible.
    fn plausible(&mut self, sampled: Cycle, tick: &Tick) -> Result<(), String> {
        let state = &self.state;
        if !state.is_finite() || !state.delivered.is_finite() {
            return Err(format!("the sample is not finite: {}", wording::sample(state)));
        }
        // A sensor without a pose need not set one.
        if sampled != Cycle::Fresh || self.told.sensed == Axes::NONE {
            return Ok(());
        }
        let orientation = state.pose.orientation();
        if !is_rotation(orientation) {
            return Err(format!("the quaternion has length {}, not 1", orientation.length()));
        }
        if !PoseBounds::of(&self.told).contain(&state.pose) {
            let Capabilities { range_m, range_rad, .. } = self.told;
            return Err(format!(
                "the pose {} is beyond twice the declared range, {} m and {} rad",
                wording::pose(&state.pose),
                wording::vector(range_m.into()),
                wording::vector(range_rad.into())
            ));
        }
        if !KNOWN.contains(state.conditions) {
            return Err(format!(
                "`conditions` is {:#x}, but the contract defines only the bits {:#x}; clear the others",
                state.conditions.bits(),
                KNOWN.bits()
            ));
        }
        let Sampled { count, first, last } = self.sampled;
        let now = state.sampled_ns;
        if now > tick.time_ns.saturating_add(AHEAD_NS) {
            return Err(format!(
                "`sampled_ns` is {now} ns, more than a minute after the tick at {} ns",
                tick.time_ns
            ));
        }
        if count > 0 && now < last {
            return Err(format!("`sampled_ns` is {now} ns, before the {last} ns of the previous sample"));
        }
        self.sampled = Sampled { count: count + 1, first: if count == 0 { now } else { first }, last: now };
        Ok(())
    }

    /// Returns true if the device has taken a command, or has no actuated axis.
    fn takes_commands(&self) -> bool {
        self.commands_taken > 0 || self.told.actuated == Axes::NONE
    }

    fn delivers(&self) -> bool {
        self.state.delivered != Wrench::ZERO
    }

    /// Pushes until the device reports a force; without a report its stop could not be checked.
    fn feel(&mut self, push: &Wrench) -> Result<(), String> {
        let started = Instant::now();
        while !self.delivers() {
            if started.elapsed() > PATIENCE {
                return Err(format!(
                    "at a commanded force of {} N the device reports no force for {}, so its stop cannot be checked; report the \
                     force in `delivered`",
                    push.force(),
                    wording::time(PATIENCE)
                ));
            }
            let _ = self.turn(push)?;
            std::thread::sleep(TICK);
        }
        Ok(())
    }

    /// Runs one tick of a device that is about to be stopped, and waits for the next.
    fn push_on(&mut self, push: &Wrench) -> Result<(), String> {
        match self.turn(push) {
            Err(Trouble { fault: Some(Fault::EmergencyStop), .. }) | Ok(_) => {}
            Err(trouble) => return Err(format!("shortly before or during safe_stop, {}", trouble.words)),
        }
        std::thread::sleep(TICK);
        Ok(())
    }

    /// Pushes on after a stop: the device has to answer, and to deliver no force.
    fn feel_nothing(&mut self, push: &Wrench) -> Result<(), String> {
        const SAMPLES: u64 = 20;
        let started = Instant::now();
        let mut at_rest = 0;
        while at_rest < SAMPLES {
            if started.elapsed() > PATIENCE {
                let (time, force) = (wording::time(PATIENCE), wording::wrench(&self.state.delivered));
                return Err(match self.delivers() {
                    true => format!("{time} after the stop the device still delivers {force}"),
                    false => format!(
                        "the device has delivered only {at_rest} of {SAMPLES} samples without force in {time} since the stop"
                    ),
                });
            }
            match self.turn(push) {
                // A fault that reports the stop is a valid answer, without force.
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
