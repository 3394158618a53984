//! Rules of a device: its description, its life cycle, and its stop.

use super::path::CONFIG;
use flotor_hal::abi::loader::{ActiveDevice, OpenedDevice};
use flotor_hal::{Axes, Capabilities, Cycle, DVec3, DeviceState, Fault, Tick, Wrench};
use std::time::{Duration, Instant};

/// How long a device may take for what is to happen soon: a sample, a force, its end.
const PATIENCE: Duration = Duration::from_secs(2);
/// Time between two ticks that wait for something, roughly.
const TICK: Duration = Duration::from_millis(1);

/// How far the length of a quaternion may be from one: rounding in single precision, ten times.
const QUATERNION_TOLERANCE: f64 = 1.0e-6;

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
        let mut has_sampled = false;
        while running.ticks < TICKS || !has_sampled {
            has_sampled |= running.turn(&Wrench::ZERO)? == Cycle::Fresh;
            if running.ticks >= TICKS && !has_sampled {
                if started.elapsed() > PATIENCE {
                    return Err(format!("no fresh sample within {PATIENCE:?}"));
                }
                std::thread::sleep(TICK);
            }
        }
        device = running.device.deactivate().ok_or("deactivate failed")?;
    }
    Ok(())
}

pub(super) fn safe_stop(mut device: OpenedDevice) -> Result<(), String> {
    let push = push(&device.capabilities().map_err(|refusal| refusal.to_string())?);
    // Only its description is checked: the message is for a device that has no host any more.
    let _ = device.independent_stop().map_err(|refusal| refusal.to_string())?;
    let stopper = device.stopper();
    let mut running = Running::start(device)?;
    if push != Wrench::ZERO {
        running.feel(&push)?;
    }
    std::thread::spawn(move || stopper.safe_stop()).join().map_err(|_| "safe_stop panicked".to_owned())?;
    running.feel_nothing(&push)
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
struct Running {
    device: ActiveDevice,
    state: DeviceState,
    ticks: u64,
    has_pose: bool,
}

/// Why a tick could not be used.
struct Trouble {
    fault: Option<Fault>,
    words: String,
}

impl From<Trouble> for String {
    fn from(trouble: Trouble) -> Self {
        trouble.words
    }
}

impl Running {
    fn start(mut device: OpenedDevice) -> Result<Self, String> {
        // A sensor without a pose may leave it as it likes.
        let has_pose = !device.capabilities().is_ok_and(|told| told.sensed == Axes::NONE);
        let device = device.activate(&CONFIG).map_err(|(_, refusal)| refusal.to_string())?;
        Ok(Self { device, state: DeviceState::HOME, ticks: 0, has_pose })
    }

    /// One tick: a sample, and a wrench.
    fn turn(&mut self, wrench: &Wrench) -> Result<Cycle, Trouble> {
        let index = self.ticks;
        let dt_ns = if index == 0 { 0 } else { CONFIG.period_ns };
        let tick = Tick { index, time_ns: index * CONFIG.period_ns, dt_ns };
        self.ticks += 1;
        let fault_of = |call: &str, fault: Fault| {
            let words = format!("{call} at tick {index}: {}", fault.advice());
            Trouble { fault: Some(fault), words }
        };
        let sampled = self.device.read(&tick, &mut self.state);
        if let Cycle::Fault(fault) = sampled {
            return Err(fault_of("read", fault));
        }
        let state = &self.state;
        let nonsense = |words: String| Err(Trouble { fault: None, words });
        if !state.is_finite() || !state.delivered.is_finite() {
            return nonsense(format!("read at tick {index} gave {state:?}"));
        }
        let length = state.pose.orientation().length();
        if self.has_pose && sampled == Cycle::Fresh && (length - 1.0).abs() > QUATERNION_TOLERANCE {
            return nonsense(format!("read at tick {index} gave a quaternion of length {length}, not 1"));
        }
        if let Cycle::Fault(fault) = self.device.write(&tick, wrench) {
            return Err(fault_of("write", fault));
        }
        Ok(sampled)
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
                    "commanded {} N, it reports no force for {PATIENCE:?}, so its stop cannot be checked",
                    push.force()
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
                    true => format!("it still delivers {:?}", self.state.delivered),
                    false => format!("it has given {at_rest} samples in {PATIENCE:?} since it was stopped"),
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
