//! Nothing in a tick allocates: not the host, not the plugins.
//!
//! The allocator of this test counts per thread. A plugin in a library of its own has an allocator of its own, so
//! the plugins are counted linked into this test; the host is counted with the libraries it really loads.
#![allow(unsafe_code)] // an allocator cannot be written without; tests/tests/system/architecture.rs lists it

#[path = "realtime/inverse3.rs"]
mod inverse3;
#[path = "realtime/ml_api.rs"]
mod ml_api;

use flotor_core::trace::TickRecord;
use flotor_hal::abi::{CallStatus, Entry, model_entry};
use flotor_hal::{
    Cycle, Demand, DeviceState, ForceModel, Input, LoopConfig, ModelInfo, Output, Pose, Refusal, Settings,
    Tick, Wrench,
};
use flotor_loader::{Plugin, Setting};
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{ControlError, Controls, Observer, RunOptions, Session};
use flotor_tests::TestSize;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::process::Command;
use std::sync::atomic::{AtomicIsize, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

thread_local! {
    /// Allocations and releases of this thread so far. Constant start value: using it never allocates.
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// Bytes this process has allocated and not released so far.
static LIVE: AtomicIsize = AtomicIsize::new(0);

/// The system's allocator, counting.
struct Counting;

// SAFETY: every call goes unchanged to the system's allocator, whose contract is the same; counting touches only
// numbers that need no memory of their own.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.set(CALLS.get() + 1);
        LIVE.fetch_add(layout.size().cast_signed(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        CALLS.set(CALLS.get() + 1);
        LIVE.fetch_sub(layout.size().cast_signed(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `GlobalAlloc::dealloc`.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Calls of the allocator while `body` runs.
fn counted(body: impl FnOnce()) -> u64 {
    let before = CALLS.get();
    body();
    CALLS.get() - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(counted(|| drop(std::hint::black_box(Box::new(1)))), 2);
    assert_eq!(counted(|| ()), 0);
}

/// A model without force that notes the ticks at which the allocator was called on the loop's thread since its step before.
struct Allocations {
    calls: Option<u64>,
}

/// Steps of [`Allocations`], and the ticks noted: more are not expected.
static STEPS: AtomicU64 = AtomicU64::new(0);
static ALLOCATED: [AtomicU64; 4] = [const { AtomicU64::new(NEVER) }; 4];
const NEVER: u64 = u64::MAX;
/// One run at a time has the model.
static ONE_RUN: Mutex<()> = Mutex::new(());
static ENTRY: Entry = model_entry::<Allocations>();

impl ForceModel for Allocations {
    const INFO: ModelInfo = ModelInfo::new("allocations", "Allocations", "Counts calls of the allocator");

    fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self { calls: None })
    }

    fn step(&mut self, _: &Input) -> Output {
        let tick = STEPS.fetch_add(1, Ordering::Relaxed);
        if self.calls.replace(CALLS.get()).is_some_and(|before| before != CALLS.get()) {
            let free = ALLOCATED.iter().find(|noted| noted.load(Ordering::Relaxed) == NEVER);
            free.unwrap_or(&ALLOCATED[3]).store(tick, Ordering::Relaxed);
        }
        Wrench::ZERO.into()
    }
}

/// Runs a scene of one-tick steps on the virtual clock; returns its ticks with calls of the allocator on the loop's thread.
fn ticks_with_allocations(scene: &str, device: &str, ticks: u64) -> Vec<u64> {
    let _alone = ONE_RUN.lock().unwrap_or_else(PoisonError::into_inner);
    STEPS.store(0, Ordering::Relaxed);
    ALLOCATED.iter().for_each(|noted| noted.store(NEVER, Ordering::Relaxed));
    let text = format!("{scene}\n[[model]]\nplugin = \"allocations\"\n{device}");
    let scene = Scene::parse(std::path::Path::new("scene.toml"), &text).expect("the scene is right");
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let registry = Registry::search(&[]).with_linked(&ENTRY).expect("it is a plugin");
    let session = Session::prepare(&scene, &registry, &options).expect("the scene starts");
    assert!(session.run(&mut Unseen, &StopSwitch::default()).is_ok());
    assert_eq!(STEPS.load(Ordering::Relaxed), ticks);
    ALLOCATED.iter().map(|noted| noted.load(Ordering::Relaxed)).filter(|tick| *tick != NEVER).collect()
}

/// Keeps nothing.
struct Unseen;

impl Observer for Unseen {
    fn observe(&mut self, _: &TickRecord) {}
}

#[test]
fn the_host_allocates_nothing_in_ten_thousand_ticks() {
    assert_eq!(ticks_with_allocations(flotor_session::scene::DEMO, "", 10_000), Vec::<u64>::new());
}

#[test]
fn the_host_allocates_nothing_with_two_devices_and_a_coupling() {
    let scene = include_str!("../../host/scenes/teleoperation.toml");
    assert_eq!(ticks_with_allocations(scene, "device = \"left\"\n", 10_000), Vec::<u64>::new());
}

#[test]
fn the_host_allocates_nothing_while_two_hands_share_an_object_and_it_is_swapped() {
    let scene = include_str!("../../host/scenes/two-hands.toml");
    let scene = format!("{scene}\n[[change]]\nat_s = 2.0\nswap = \"membrane\"\n");
    assert_eq!(ticks_with_allocations(&scene, "device = \"left\"\n", 4_000), Vec::<u64>::new());
}

/// The demo with a change at tick 5000 and another spring from tick 7000 on, in the middle of batches of ticks.
const CHANGED: &str = "[[change]]\nat_s = 5.0\nset = \"spring.gamma_n=20\"\n\
    [[change]]\nat_s = 7.0\nswap = \"spring\"\n";

#[test]
fn the_host_allocates_nothing_for_a_change_of_a_parameter_or_a_model() {
    let scene = format!("{}{CHANGED}", flotor_session::scene::DEMO);
    assert_eq!(ticks_with_allocations(&scene, "", 10_000), Vec::<u64>::new());
}

/// Replaces the spring as often as the loop lets it, and looks at the memory of the process.
struct Replacing<'a> {
    controls: Controls,
    registry: &'a Registry,
    replaced: usize,
    /// Replacements between two looks at the memory: an even number, so that a spring is on its way at each.
    span: usize,
    /// Live bytes at each look.
    live: Vec<isize>,
}

impl Replacing<'_> {
    /// Live bytes once all that was replaced is freed, on threads of its own.
    fn settled(&self) -> isize {
        let mut live = LIVE.load(Ordering::Relaxed);
        let mut looks = 0;
        while looks < 20 {
            // Refused; but before, what has been freed is heard of.
            let refused = self.controls.swap(self.registry, "spring", Some("nobody"), &[]);
            assert!(refused.is_err());
            drop(refused);
            std::thread::sleep(Duration::from_millis(1));
            let now = LIVE.load(Ordering::Relaxed);
            looks = if now == live { looks + 1 } else { 0 };
            live = now;
        }
        live
    }
}

impl Observer for Replacing<'_> {
    fn observe(&mut self, record: &TickRecord) {
        if !record.tick.is_multiple_of(100) {
            return;
        }
        let plugin = if self.replaced.is_multiple_of(2) { Some("wall") } else { None };
        match self.controls.swap(self.registry, "spring", plugin, &[]) {
            Err(ControlError::Busy) => return, // the one before has not come in yet
            outcome => outcome.expect("both can be made"),
        }
        self.replaced += 1;
        if self.replaced.is_multiple_of(self.span) {
            self.live.push(self.settled());
        }
    }
}

#[test]
fn models_that_are_replaced_for_ever_leave_no_memory_behind() {
    const ALONE: &str = "FLOTOR_TEST_ALONE";
    if std::env::var_os(ALONE).is_none() {
        // Only a process in which nothing else runs tells what is left.
        let mut alone = Command::new(std::env::current_exe().expect("a running test has a file"));
        alone.args([
            "--exact",
            "models_that_are_replaced_for_ever_leave_no_memory_behind",
            "--test-threads=1",
        ]);
        let ran = alone.env(ALONE, "1").output().expect("it can be started once more");
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stdout));
        return;
    }
    let most = TestSize::of_this_run().pick(40, 1000);
    // On the virtual clock observers see a second of ticks at a time: one replacement in each.
    let text = format!(
        "duration_s = {}\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n\
         [model.blend]\nfade_s = 0.05\n",
        most + most / 10
    );
    let scene = Scene::parse(std::path::Path::new("scene.toml"), &text).expect("it is right");
    let registry = Registry::search(&[]);
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let session = Session::prepare(&scene, &registry, &options).expect("it starts");
    let controls = session.controls();
    let mut replacing =
        Replacing { controls, registry: &registry, replaced: 0, span: most / 10, live: Vec::new() };
    assert!(session.run(&mut replacing, &StopSwitch::default()).is_ok());
    // A leak grows in every span. A channel whose reader first waits in one of them keeps its list of waiters.
    let live = replacing.live;
    let mut grown: Vec<isize> = live.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(grown.len() >= 9, "{live:?}");
    grown.sort_unstable();
    assert_eq!(grown[grown.len() / 2], 0, "live bytes after every {} replacements: {live:?}", most / 10);
}

#[test]
fn the_spring_allocates_nothing_in_a_step() {
    let plugin = Plugin::in_process(&flotor_spring::FLOTOR_ENTRY).expect("the spring is a plugin");
    let kinds: [&[(&str, &str)]; 10] = [
        &[("variant", "energy")],
        &[("variant", "closed-form")],
        &[("variant", "current-length")],
        &[("variant", "thesis")],
        &[("variant", "rod")],
        &[("variant", "rod"), ("accuracy", "tight")],
        &[("variant", "rod"), ("seat", "free")],
        &[("variant", "energy"), ("seat", "free")],
        &[("variant", "energy"), ("hand_over", "on"), ("preset", "thesis-3")],
        &[
            ("variant", "rod"),
            ("coil_contact", "on"),
            ("wire", "on"),
            ("seat", "free"),
            ("seat_friction", "0.1"),
        ],
    ];
    for kind in kinds {
        let settings: Vec<_> = kind
            .iter()
            .map(|(id, value)| Setting::parse(plugin.parameters(), id, value).expect("a setting"))
            .collect();
        let gamma = Setting::parse(plugin.parameters(), "gamma_n", "12").expect("a setting");
        let mut model = plugin.create_model(&settings).expect("a spring");
        let mut details = vec![0.0; model.details().len()];
        let mut output = Output::default();
        let mut input = Input { demand: Demand::ALL, ..Input::at_rest(Pose::HOME) };
        let calls = counted(|| {
            for step in 0..1000 {
                input.pose.position_m = [1.0e-6 * f64::from(step), 0.0, -1.0e-5 * f64::from(step)];
                assert_eq!(model.step(&input, &mut output), CallStatus::Ok);
            }
            input.pose.position_m[0] = f64::NAN;
            assert_eq!(model.step(&input, &mut output), CallStatus::Ok);
            assert_eq!(model.read_details(&mut details), CallStatus::Ok);
            assert_eq!(model.set_parameter(gamma.index(), gamma.value()), CallStatus::Ok);
            // A jump: the rod slides to its equilibrium over several ticks.
            input.pose.position_m = [4.0e-3, 0.0, -12.0e-3];
            for _ in 0..100 {
                assert_eq!(model.step(&input, &mut output), CallStatus::Ok);
            }
            assert_eq!(model.reset(), CallStatus::Ok);
        });
        assert_eq!(calls, 0, "{kind:?}");
    }
}

#[test]
fn the_simulated_flotor_allocates_nothing_in_a_tick() {
    let plugin = Plugin::in_process(&flotor_simulated::FLOTOR_ENTRY).expect("the flotor is a plugin");
    let device = plugin.open_device(&[]).expect("a flotor");
    let config = LoopConfig { period_ns: 1_000_000, seed: 1 };
    let Ok(mut device) = device.activate(&config) else { panic!("it can be activated") };
    let mut state = DeviceState::HOME;
    let wrench = flotor_hal::Wrench::from_force(flotor_hal::DVec3::new(0.1, 0.0, 0.2));
    let calls = counted(|| {
        for index in 0..1000 {
            // Every tenth tick comes late: an odd step length must not cost memory either.
            let dt_ns = if index % 10 == 9 { 1_234_567 } else { 1_000_000 };
            let tick = Tick { index, time_ns: index * 1_000_000, dt_ns };
            assert_eq!(device.read(&tick, &mut state), Cycle::Fresh);
            assert_eq!(device.write(&tick, &wrench), Cycle::Fresh);
        }
        assert!(device.energy_ledger().is_some());
    });
    assert_eq!(calls, 0);
}
