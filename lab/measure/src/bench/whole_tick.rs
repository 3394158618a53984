//! Cost of a whole tick: device, mapping, model, envelope, and its record through the trace ring.
//!
//! The loop is that of every run, on the virtual clock, so that nothing waits. Ticks are timed in batches, over which
//! the clock's overhead is spread; the ring is emptied between batches, as observers do on their own thread. The median
//! of many batches counts, because other load on the machine delays some.

use super::scripted::{SCRIPTED, SCRIPTED_ENTRY};
use flotor_core::quantile;
use flotor_core::trace::TickRecord;
use flotor_hal::SampleWait;
use flotor_judge::call_timer::net_ns;
use flotor_loader::Stopper;
use flotor_servo::{Clock, Schedule, Servo, StopSwitch, queue};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{RunError, RunOptions, Session};
use rtrb::{Consumer, Producer};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// Number of ticks timed together: some 20 µs, short against a time slice of the system.
const BATCH: usize = 64;
/// Number of untimed ticks at the start: the force fades in, caches and branch predictors warm up.
const WARM_UP: usize = 2000;

/// Device under the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BenchDevice {
    /// Handle that follows a script at almost no cost, to isolate the cost of the loop.
    Scripted,
    /// Simulated flotor, preset `plain`, in its hand.
    Simulated,
    /// Scripted handle, with the model in its own process.
    Isolated,
}

impl BenchDevice {
    /// All devices.
    pub const ALL: [BenchDevice; 3] = [BenchDevice::Scripted, BenchDevice::Simulated, BenchDevice::Isolated];

    /// Returns the name in a table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scripted => "on a scripted device",
            Self::Simulated => "on the simulated flotor",
            Self::Isolated => "in a process of its own",
        }
    }

    /// Returns the scene: one device, one model with its defaults.
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

/// Duration of a tick, ns. Wall clock: compare within a run, not between machines.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TickCost {
    /// Median of all batches.
    pub median_ns: f64,
    /// Fastest batch.
    pub fastest_ns: f64,
    /// 99th percentile of the batches, interruptions of the machine included.
    pub p99_ns: f64,
}

/// Loop that is advanced step by step, with its trace.
pub struct WholeTick {
    servo: Servo,
    schedule: Schedule,
    stoppers: Vec<Stopper>,
    stop: StopSwitch,
    sender: Producer<TickRecord>,
    receiver: Consumer<TickRecord>,
}

impl WholeTick {
    /// Prepares a model of the registry, by id or file, on a device. Not real-time.
    ///
    /// # Errors
    /// [`RunError`] if the model cannot be loaded or created, or the run with the device cannot be prepared.
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

    /// Runs at least `ticks` ticks, in whole batches; discards their records.
    pub fn run(&mut self, ticks: usize) {
        for _ in 0..ticks.div_ceil(BATCH) {
            self.batch();
            self.discard_records();
        }
    }

    /// Times `batches` batches of ticks, after a warm-up. Not real-time.
    #[must_use]
    pub fn time(&mut self, batches: usize) -> TickCost {
        self.run(WARM_UP);
        let batch = |_| {
            let begin = Instant::now();
            self.batch();
            let tick_ns = net_ns(0.0, begin) / BATCH as f64;
            self.discard_records();
            tick_ns
        };
        let mut times_ns: Vec<f64> = (0..batches.max(1)).map(batch).collect();
        let [median_ns, fastest_ns, p99_ns] = [0.5, 0.0, 0.99].map(|part| quantile(&mut times_ns, part));
        TickCost { median_ns, fastest_ns, p99_ns }
    }

    /// Frees the slots of all records without reading one.
    fn discard_records(&mut self) {
        if let Ok(records) = self.receiver.read_chunk(self.receiver.slots()) {
            records.commit_all();
        }
    }

    /// Runs a batch of ticks, each with its record pushed. Real-time: bounded, no allocation.
    #[inline(never)] // separate function for a counter of instructions
    fn batch(&mut self) {
        let Self { servo, schedule, stop, sender, .. } = self;
        for _ in 0..BATCH {
            let Ok(due) = schedule.wait(|_| SampleWait::NotPaced) else { return };
            servo.tick(&due, stop, |record| {
                let _ = sender.push(*record); // the ring has room for two batches
            });
        }
    }
}

impl Drop for WholeTick {
    fn drop(&mut self) {
        self.stoppers.iter().for_each(Stopper::safe_stop);
    }
}
