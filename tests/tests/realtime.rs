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
use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::{Plugin, Setting};
use flotor_hal::{Cycle, Demand, DeviceState, Input, LoopConfig, Output, Pose, Tick};
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{ControlError, Controls, Observer, RunOptions, Session};
use flotor_tests::TestSize;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::process::Command;
use std::sync::atomic::{AtomicIsize, Ordering};
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

/// Notes how often the allocator was called when it sees a tick; keeps nothing that grows.
#[derive(Default)]
struct Watch {
    first: Option<u64>,
    last: u64,
    ticks: u64,
}

impl Observer for Watch {
    fn observe(&mut self, _: &TickRecord) {
        self.first.get_or_insert(CALLS.get());
        self.last = CALLS.get();
        self.ticks += 1;
    }
}

#[test]
fn the_host_allocates_nothing_in_ten_thousand_ticks() {
    let scene = Scene::demo().expect("the demo is right");
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let session = Session::prepare(&scene, &Registry::search(&[]), &options).expect("the demo starts");
    let mut watch = Watch::default();
    let outcome = session.run(&mut watch, &StopSwitch::default());
    assert!(outcome.is_ok() && watch.ticks == 10_000);
    // Between the first and the last tick seen lie ten batches of ticks, run on this thread.
    assert_eq!(watch.first, Some(watch.last));
}

#[test]
fn the_host_allocates_nothing_with_two_devices_and_a_coupling() {
    let text = include_str!("../../host/scenes/teleoperation.toml");
    let scene = Scene::parse(std::path::Path::new("teleoperation.toml"), text).expect("the scene is right");
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let session = Session::prepare(&scene, &Registry::search(&[]), &options).expect("the scene starts");
    let mut watch = Watch::default();
    let outcome = session.run(&mut watch, &StopSwitch::default());
    assert!(outcome.is_ok() && watch.ticks == 20_000);
    assert_eq!(watch.first, Some(watch.last));
}

/// The demo with a change at tick 5000 and another spring from tick 7000 on, in the middle of batches of ticks.
const CHANGED: &str = "[[change]]\nat_s = 5.0\nset = \"spring.gamma_n=20\"\n\
    [[change]]\nat_s = 7.0\nswap = \"spring\"\n";

#[test]
fn the_host_allocates_nothing_for_a_change_of_a_parameter_or_a_model() {
    /// Ticks before whose observation the allocator was called, but for the first.
    struct Calls {
        before: Option<u64>,
        ticks: Vec<u64>,
    }
    impl Observer for Calls {
        fn observe(&mut self, record: &TickRecord) {
            if self.before.replace(CALLS.get()).is_some_and(|before| before != CALLS.get()) {
                self.ticks.push(record.tick);
            }
        }
    }
    let text = format!("{}{CHANGED}", flotor_session::scene::DEMO);
    let scene = Scene::parse(std::path::Path::new("changed demo"), &text).expect("the demo is right");
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let session = Session::prepare(&scene, &Registry::search(&[]), &options).expect("the demo starts");
    let mut calls = Calls { before: None, ticks: Vec::with_capacity(16) };
    assert!(session.run(&mut calls, &StopSwitch::default()).is_ok());
    // The loop ran tick 5000 before tick 4096 was observed, and 7000 to 7100 before 6144; only telling the observer of
    // them takes memory, and giving the old spring to a thread that frees it at the end of its batch. A later batch may hear
    // of that.
    let (changes, heard) = calls.ticks.split_at(3);
    assert_eq!(changes, [5000, 7000, 7168]);
    assert!(heard.len() <= 1 && heard.iter().all(|tick| tick.is_multiple_of(1024)), "{heard:?}");
}

/// Replaces the spring as often as the loop lets it, and looks at the memory of the process.
struct Replacing<'a> {
    controls: Controls,
    registry: &'a Registry,
    replaced: usize,
    /// Live bytes when so many had been replaced.
    live: [(usize, Option<isize>); 2],
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
        if let Some(place) = self.live.iter().position(|(count, _)| *count == self.replaced) {
            self.live[place].1 = Some(self.settled());
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
    // Both after an even number: a spring is on its way.
    let live = [most / 2, most].map(|count| (count, None));
    let mut replacing = Replacing { controls: session.controls(), registry: &registry, replaced: 0, live };
    assert!(session.run(&mut replacing, &StopSwitch::default()).is_ok());
    let [Some(half), Some(all)] = replacing.live.map(|(_, live)| live) else {
        panic!("{:?}", replacing.live)
    };
    assert_eq!(half, all, "bytes after {} and after {most} replacements", most / 2);
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
