//! What a whole tick costs: device, mapping, model, envelope, and the record of it through the trace ring.
//!
//! On the virtual clock, so that nothing waits, and otherwise the loop of every run. Ticks are timed a batch at a time,
//! what the clock costs being spread over the batch; the ring is emptied between batches, as observers do on a thread of
//! their own. The middle of many batches counts: a neighbour on the machine spoils some of them.

use super::scripted::{SCRIPTED, SCRIPTED_ENTRY};
use flotor_core::trace::TickRecord;
use flotor_hal::SampleWait;
use flotor_hal::abi::loader::Stopper;
use flotor_judge::call_timer::{net_ns, quantile};
use flotor_servo::{Clock, Schedule, Servo, StopSwitch, drain, queue};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{RunError, RunOptions, Session};
use rtrb::{Consumer, Producer};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// Ticks that are timed together: some 20 µs, short against a time slice of the system.
const BATCH: usize = 64;
/// Ticks before the first that is timed: the force has faded in, caches and branch predictors are warm.
const WARM_UP: usize = 2000;

/// What the model acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BenchDevice {
    /// A handle that follows a script, which costs next to nothing: what is left is the loop.
    Scripted,
    /// The simulated flotor, preset `plain`, in its hand.
    Simulated,
    /// The scripted handle, with the model in a process of its own.
    Isolated,
}

impl BenchDevice {
    /// All of them.
    pub const ALL: [BenchDevice; 3] = [BenchDevice::Scripted, BenchDevice::Simulated, BenchDevice::Isolated];

    /// Name in a table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scripted => "on a scripted device",
            Self::Simulated => "on the simulated flotor",
            Self::Isolated => "in a process of its own",
        }
    }

    /// The scene: one device, one model with its defaults.
    fn scene(self, model: &str) -> String {
        let device = match self {
            Self::Scripted | Self::Isolated => SCRIPTED,
            Self::Simulated => "simulated",
        };
        let isolation = if self == Self::Isolated { "process" } else { "none" };
        format!(
            "[device]\nplugin = \"{device}\"\n[[model]]\nplugin = \"{model}\"\nisolation = \"{isolation}\"\n"
        )
    }
}

/// What a tick takes, ns. Wall clock: compare within a run, not between machines.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TickCost {
    /// Middle of all batches.
    pub median_ns: f64,
    /// The fastest batch.
    pub fastest_ns: f64,
    /// One batch in a hundred takes longer, interruptions of the machine included.
    pub p99_ns: f64,
}

/// A loop that is advanced by hand, with its trace.
pub struct WholeTick {
    servo: Servo,
    schedule: Schedule,
    stoppers: Vec<Stopper>,
    stop: StopSwitch,
    sender: Producer<TickRecord>,
    receiver: Consumer<TickRecord>,
}

impl WholeTick {
    /// A model of the registry, by id or file, on a device. Not real-time.
    ///
    /// # Errors
    /// [`RunError`] if the model is unknown, refused, or does not fit.
    pub fn prepare(device: BenchDevice, registry: Registry, model: &str) -> Result<Self, RunError> {
        let registry = registry.with_linked(&SCRIPTED_ENTRY)?;
        let scene = Scene::parse(Path::new("bench"), &device.scene(model))?;
        let options = RunOptions { clock: Clock::Virtual, seed: 1 };
        let session = Session::prepare(&scene, &registry, &options)?;
        let period_ns = session.period_ns();
        let (servo, stoppers) = session.into_loop()?;
        let (sender, receiver) = queue(2 * BATCH);
        let schedule = Schedule::start_virtual(period_ns);
        Ok(Self { servo, schedule, stoppers, stop: StopSwitch::default(), sender, receiver })
    }

    /// Runs ticks, a batch at least; what they left behind is taken out of the ring and thrown away.
    pub fn run(&mut self, ticks: usize) {
        for _ in 0..ticks.div_ceil(BATCH) {
            self.batch();
            drain(&mut self.receiver, |_| ());
        }
    }

    /// Times so many batches.
    #[must_use]
    pub fn time(&mut self, batches: usize) -> TickCost {
        self.run(WARM_UP);
        let batch = |_| {
            let begin = Instant::now();
            self.batch();
            let tick_ns = net_ns(0.0, begin) / BATCH as f64;
            drain(&mut self.receiver, |_| ());
            tick_ns
        };
        let mut times_ns: Vec<f64> = (0..batches.max(1)).map(batch).collect();
        let [median_ns, fastest_ns, p99_ns] = [0.5, 0.0, 0.99].map(|part| quantile(&mut times_ns, part));
        TickCost { median_ns, fastest_ns, p99_ns }
    }

    /// A batch of ticks, each with its record pushed. Real-time: bounded, no allocation.
    #[inline(never)] // where a counter of instructions cuts
    fn batch(&mut self) {
        let Self { servo, schedule, stop, sender, .. } = self;
        for _ in 0..BATCH {
            let Ok(due) = schedule.wait(|_| SampleWait::NotPaced) else { return };
            servo.tick(&due, stop, |record| {
                let _ = sender.push(*record); // it has room for two batches
            });
        }
    }
}

impl Drop for WholeTick {
    fn drop(&mut self) {
        self.stoppers.iter().for_each(Stopper::safe_stop);
    }
}
