//! Plugin with the drivers of a real kernel: the emulated controller is attached to the kernel as a USB device, and the
//! plugin opens the device through libusb, hidraw and the tty layer.
//!
//! Attaching a device needs root and the module `vhci_hcd`, so these tests are ignored by default. `.ci/vm` runs them in
//! a virtual machine whose clock counts instructions: the measured times do not depend on the load of the machine.
#![allow(clippy::unwrap_used)] // helpers of tests

mod machine;

use flotor_hal::{Cycle, DVec3, DeviceState, Fault, LoopConfig, Pose, Tick, Twist, Wrench};
use flotor_loader::{ActiveDevice, OpenedDevice, Plugin, Setting};
use flotor_maglev::protocol::{Answer, AnswerFrame, Condition, Mode, Request, RequestFrame};
use flotor_maglev::transport::{self, Incoming, Kind, LinkLost, OpenError, Transport};
use flotor_maglev_emulator::controller::Sample;
use flotor_maglev_emulator::gadget::{Gadget, Personality};
use flotor_maglev_emulator::{Emulator, Event, Pace, Plant, controller_config};
use machine::CAPABILITIES;
use rustix::process::{Pid, Signal, kill_process};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const PERIOD: Duration = Duration::from_millis(1);
/// Longest anything here may take before a test gives up.
const PATIENCE: Duration = Duration::from_secs(20);
const ALL: [Personality; 4] =
    [Personality::Interrupt, Personality::Bulk, Personality::Hid, Personality::Serial];

// ---------------------------------------------------------------- the controller's side

/// 0.58 kg that goes where it is pushed, and a record of the pushes.
struct Mass {
    position_m: f64,
    speed_m_per_s: f64,
    pushes_n: Arc<Mutex<Vec<f64>>>,
}

impl Plant for Mass {
    fn advance(&mut self, dt_us: u64, wrench: &Wrench) -> Sample {
        let (dt_s, push_n) = (dt_us as f64 * 1.0e-6, wrench.force().z);
        self.pushes_n.lock().unwrap_or_else(PoisonError::into_inner).push(push_n);
        // A firm hand holds it well inside every wall.
        self.speed_m_per_s += dt_s / 0.58 * (push_n - 5000.0 * self.position_m - 70.0 * self.speed_m_per_s);
        self.position_m += dt_s * self.speed_m_per_s;
        let (pose, twist) = (
            Pose::new(DVec3::Z * self.position_m, Pose::HOME.orientation()),
            Twist::new(DVec3::Z * self.speed_m_per_s, DVec3::ZERO),
        );
        Sample { pose, twist, ..Sample::HOME }
    }

    fn restart(&mut self) {
        (self.position_m, self.speed_m_per_s) = (0.0, 0.0);
    }
}

/// An emulated controller on a cable, in threads of this process.
struct Controller {
    personality: Personality,
    cable: Arc<Mutex<Option<Gadget>>>,
    events: Receiver<(Instant, Event)>,
    pushes_n: Arc<Mutex<Vec<f64>>>,
    ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    fn plugged_in(personality: Personality) -> Self {
        let (cable, pushes_n) = (Arc::new(Mutex::new(None)), Arc::new(Mutex::new(Vec::new())));
        let (sender, events) = channel();
        let ending = Arc::new(AtomicBool::new(false));
        let (cables, record, end) = (Arc::clone(&cable), Arc::clone(&pushes_n), Arc::clone(&ending));
        let thread = std::thread::spawn(move || {
            let config = controller_config(&CAPABILITIES, Pace::RealTime, "K-1");
            let plant = Mass { position_m: 0.0, speed_m_per_s: 0.0, pushes_n: record };
            let mut emulator = Emulator::new(config, Pace::RealTime, plant);
            while !end.load(Ordering::Relaxed) {
                let wait = |gadget: &Gadget| gadget.wait_for_host(PERIOD);
                // A guard in a `match` would live as long as the use of the device.
                let link = cables.lock().unwrap().as_ref().and_then(wait);
                match link {
                    None => std::thread::sleep(PERIOD),
                    Some(mut link) => emulator.serve(link.as_mut(), &end, &mut |event| {
                        let _ = sender.send((Instant::now(), event));
                    }),
                }
            }
        });
        let controller = Self { personality, cable, events, pushes_n, ending, thread: Some(thread) };
        controller.plug_in();
        controller
    }

    fn plug_in(&self) {
        let gadget =
            Gadget::plug_in(self.personality, "K-1").expect("this kernel has vhci_hcd, and this is root");
        *self.cable.lock().unwrap() = Some(gadget);
    }

    /// Pulls the cable; when it is out.
    fn pull(&self) -> Instant {
        let gadget = self.cable.lock().unwrap().take();
        let now = Instant::now();
        drop(gadget);
        now
    }

    fn kind(&self) -> Kind {
        match self.personality {
            Personality::Interrupt | Personality::Bulk => Kind::Usb,
            Personality::Hid => Kind::Hid,
            Personality::Serial => Kind::Serial,
        }
    }

    fn address(&self) -> String {
        match self.personality {
            Personality::Serial => "/dev/ttyACM0".to_owned(),
            other => other.address(),
        }
    }

    /// Opens the link as the plugin would, once the kernel has bound its driver.
    fn open(&self) -> Box<dyn Transport> {
        let started = Instant::now();
        loop {
            match transport::open(self.kind(), &self.address()) {
                Ok(link) => return link,
                Err(error) => assert!(started.elapsed() < PATIENCE, "{:?}: {error}", self.personality),
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits until it is in a mode; when that was, and how long the host had been silent.
    fn wait_for(&self, wanted: Mode) -> (Instant, u64, Condition) {
        loop {
            let (when, event) = self.events.recv_timeout(PATIENCE).expect("the controller changes its mode");
            match event {
                Event::Mode { mode, silence_us, condition, .. } if mode == wanted => {
                    return (when, silence_us, condition);
                }
                _ => {}
            }
        }
    }

    /// Forgets what it has pushed so far.
    fn take_pushes_n(&self) -> Vec<f64> {
        std::mem::take(&mut *self.pushes_n.lock().unwrap())
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Relaxed);
        self.pull();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        // The kernel forgets a device in its own time; the next one gets its name only then.
        std::thread::sleep(Duration::from_millis(200));
    }
}

// ---------------------------------------------------------------- the host's side

/// The plugin behind its tables.
fn plugin() -> Plugin {
    Plugin::in_process(&flotor_maglev::FLOTOR_ENTRY).expect("it is a plugin")
}

fn opened(plugin: &Plugin, kind: Kind, address: &str) -> OpenedDevice {
    let transport = match kind {
        Kind::Usb => "usb",
        Kind::Hid => "hid",
        Kind::Serial => "serial",
        Kind::Tcp => "tcp",
    };
    let setting = |key, value| Setting::parse(plugin.parameters(), key, value).unwrap();
    let settings = [setting("transport", transport), setting("address", address)];
    let started = Instant::now();
    loop {
        match plugin.open_device(&settings) {
            Ok(device) => return device,
            Err(error) => assert!(started.elapsed() < PATIENCE, "{error}"),
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn activated(device: OpenedDevice) -> ActiveDevice {
    let config = LoopConfig { period_ns: 1_000_000, seed: 1 };
    device.activate(&config).map_err(|(_, refusal)| refusal).expect("the controller takes off")
}

/// Deadlines a millisecond apart.
struct Pacer {
    next: Instant,
    late: u32,
}

impl Pacer {
    fn start() -> Self {
        Self { next: Instant::now(), late: 0 }
    }

    fn wait(&mut self) {
        self.next += PERIOD;
        match self.next.checked_duration_since(Instant::now()) {
            Some(rest) => std::thread::sleep(rest),
            None => {
                self.late += 1;
                self.next = Instant::now();
            }
        }
    }
}

/// A servo loop of one device.
struct Loop {
    device: ActiveDevice,
    pacer: Pacer,
    index: u64,
    state: DeviceState,
}

impl Loop {
    fn new(device: ActiveDevice) -> Self {
        Self { device, pacer: Pacer::start(), index: 0, state: DeviceState::HOME }
    }

    /// One tick with this vertical force; the fault, if there is one.
    fn tick(&mut self, force_n: f64) -> Option<Fault> {
        let tick = Tick { index: self.index, time_ns: self.index * 1_000_000, dt_ns: 1_000_000 };
        self.index += 1;
        let read = self.device.read(&tick, &mut self.state);
        let written = self.device.write(&tick, &Wrench::from_force(DVec3::Z * force_n));
        self.pacer.wait();
        [read, written].into_iter().find_map(|cycle| match cycle {
            Cycle::Fault(fault) => Some(fault),
            Cycle::Fresh | Cycle::Stale => None,
        })
    }
}

/// A host in a process of its own, to be killed.
fn host(controller: &Controller, role: &str) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--ignored", "--exact", "a_process_that_is_the_host", "--nocapture"]);
    command.env(ROLE, role).env(PERSONALITY, controller.personality.address());
    command.stdout(Stdio::piped()).stderr(Stdio::inherit()).spawn().expect("this program starts again")
}

const ROLE: &str = "FLOTOR_KERNEL_ROLE";
const PERSONALITY: &str = "FLOTOR_KERNEL_PERSONALITY";

#[test]
#[ignore = "the host of the other tests, in a process of its own: they start it"]
fn a_process_that_is_the_host() {
    let told = |name: &str| std::env::var(name).expect("the other tests start it, and say what it is to be");
    let (role, address) = (told(ROLE), told(PERSONALITY));
    let personality = ALL.into_iter().find(|personality| personality.address() == address).unwrap();
    let (kind, address) = match personality {
        Personality::Hid => (Kind::Hid, address),
        Personality::Serial => (Kind::Serial, "/dev/ttyACM0".to_owned()),
        Personality::Interrupt | Personality::Bulk => (Kind::Usb, address),
    };
    if role == "open" {
        match transport::open(kind, &address) {
            Ok(_) => println!("opened"),
            Err(error) => println!("refused: {error}"),
        }
        return;
    }
    let plugin = plugin();
    let mut servo = Loop::new(activated(opened(&plugin, kind, &address)));
    loop {
        servo.tick(2.0);
    }
}

fn signal(child: &Child, signal: Signal) {
    let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw).expect("a child has an id");
    kill_process(pid, signal).expect("it is ours");
}

// ---------------------------------------------------------------- round trips

/// A link that numbers its requests.
struct Asking {
    link: Box<dyn Transport>,
    sequence: u32,
}

impl Asking {
    fn send(&mut self, request: Request) {
        self.sequence += 1;
        let frame =
            RequestFrame { sequence: self.sequence, acknowledged: 0, time_us: 0, session: 0x5e55, request };
        self.link.send(&frame.encode()).expect("the controller is there");
    }

    /// Waits for the answer to the newest request.
    fn answered(&mut self) -> Result<Mode, LinkLost> {
        let started = Instant::now();
        while started.elapsed() < PATIENCE {
            let Incoming::Packet(packet) = self.link.wait(PERIOD)? else { continue };
            let frame = AnswerFrame::decode(&packet).expect("the controller speaks the protocol");
            if let (Answer::Status(status), true) = (frame.answer, frame.acknowledged == self.sequence) {
                return Ok(status.mode);
            }
        }
        panic!("no answer to request {}", self.sequence);
    }
}

#[test]
#[ignore = "needs a kernel with vhci_hcd: .ci/vm"]
fn round_trips_at_1_khz_are_never_late() {
    let full = std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full");
    let cycles = if full { 10_000 } else { 1000 };
    println!("round trip, {cycles} cycles of 1 ms: p50 / p99 / p99.9 / max, us; late cycles");
    for personality in ALL {
        let controller = Controller::plugged_in(personality);
        let mut host = Asking { link: controller.open(), sequence: 0 };
        host.send(Request::Disarm);
        host.answered().unwrap();
        host.send(Request::Arm { period_us: 1000, watchdog_us: 8000 });
        assert_eq!(host.answered(), Ok(Mode::Armed));
        host.send(Request::TakeOff);
        assert_eq!(host.answered(), Ok(Mode::Levitating));
        let mut times_us = Vec::with_capacity(cycles);
        let mut pacer = Pacer::start();
        for _ in 0..cycles {
            pacer.wait();
            let started = Instant::now();
            host.send(Request::Command { wrench: [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], valid_us: 3000 });
            assert_eq!(host.answered(), Ok(Mode::Levitating));
            times_us.push(started.elapsed().as_secs_f64() * 1.0e6);
        }
        times_us.sort_by(f64::total_cmp);
        let quantile = |per_mille: usize| times_us[(times_us.len() - 1) * per_mille / 1000];
        let [p50, p99, p999, max] = [500, 990, 999, 1000].map(quantile);
        println!(
            "  {:<9} {p50:>5.0} / {p99:>5.0} / {p999:>5.0} / {max:>5.0}; {} late",
            format!("{personality:?}"),
            pacer.late
        );
        if matches!(personality, Personality::Interrupt | Personality::Bulk) {
            assert_eq!(pacer.late, 0);
            assert!(p99 <= 400.0, "{p99} us");
        }
    }
}

// ---------------------------------------------------------------- one side is gone

#[test]
#[ignore = "needs a kernel with vhci_hcd: .ci/vm"]
fn a_killed_host_disarms_within_10_ms() {
    for personality in ALL {
        let controller = Controller::plugged_in(personality);
        drop(controller.open());
        for _ in 0..3 {
            let mut host = host(&controller, "servo");
            controller.wait_for(Mode::Levitating);
            std::thread::sleep(Duration::from_millis(100));
            let killed = Instant::now();
            host.kill().unwrap();
            let (when, _, condition) = controller.wait_for(Mode::Disarmed);
            let after_ms = when.saturating_duration_since(killed).as_secs_f64() * 1.0e3;
            println!("  {personality:?}: disarmed {after_ms:.2} ms after SIGKILL ({condition})");
            assert!(condition.contains(Condition::LINK_LOST));
            assert!(after_ms <= 10.0, "{personality:?}: {after_ms} ms");
            host.wait().unwrap();
        }
    }
}

#[test]
#[ignore = "needs a kernel with vhci_hcd: .ci/vm"]
fn a_hung_host_loses_its_session_at_the_watchdog() {
    const WATCHDOG_US: u64 = 8000;
    for personality in ALL {
        let controller = Controller::plugged_in(personality);
        drop(controller.open());
        let mut host = host(&controller, "servo");
        controller.wait_for(Mode::Levitating);
        std::thread::sleep(Duration::from_millis(100));
        signal(&host, Signal::STOP);
        let (_, silence_us, condition) = controller.wait_for(Mode::Holding);
        println!("  {personality:?}: holding {silence_us} us after the last command");
        assert!(condition.contains(Condition::WATCHDOG));
        assert!((WATCHDOG_US..=WATCHDOG_US + 2000).contains(&silence_us), "{personality:?}: {silence_us} us");
        controller.wait_for(Mode::Landing);
        controller.wait_for(Mode::Fault);
        signal(&host, Signal::KILL);
        host.wait().unwrap();
    }
}

#[test]
#[ignore = "needs a kernel with vhci_hcd: .ci/vm"]
fn a_cable_pulled_in_mid_stroke_is_a_fault_at_once_and_nothing_is_replayed() {
    let plugin = plugin();
    for personality in ALL {
        let controller = Controller::plugged_in(personality);
        let mut device = opened(&plugin, controller.kind(), &controller.address());
        for stroke in 1..=2 {
            let force_n = 5.0 * f64::from(stroke);
            let mut servo = Loop::new(activated(device));
            controller.wait_for(Mode::Levitating);
            controller.take_pushes_n();
            for _ in 0..200 {
                assert_eq!(servo.tick(force_n), None, "{personality:?}");
            }
            let pushes_n = controller.take_pushes_n();
            assert!(pushes_n.iter().all(|push_n| *push_n == 0.0 || *push_n == force_n), "{pushes_n:?}");
            assert_eq!(pushes_n.last(), Some(&force_n), "the command arrives");
            let pulled = controller.pull();
            let ticks = (1..).find(|_| servo.tick(force_n).is_some()).unwrap();
            let after_ms = pulled.elapsed().as_secs_f64() * 1.0e3;
            println!("  {personality:?}: fault {after_ms:.2} ms after the cable was pulled, in tick {ticks}");
            assert!(after_ms <= 20.0, "{personality:?}: {after_ms} ms");
            assert_eq!(servo.tick(force_n), Some(Fault::Disconnected), "and it stays one");
            controller.wait_for(Mode::Disarmed);
            controller.take_pushes_n();
            device = servo.device.deactivate().expect("the device is given back");
            controller.plug_in();
            drop(controller.open());
            std::thread::sleep(Duration::from_millis(20));
            let replayed = controller.take_pushes_n();
            assert!(replayed.iter().all(|push_n| *push_n == 0.0), "{replayed:?}");
        }
    }
}

// ---------------------------------------------------------------- who may

#[test]
#[ignore = "needs a kernel with vhci_hcd: .ci/vm"]
fn a_device_in_use_is_busy_and_a_forbidden_one_says_what_to_do() {
    for personality in [Personality::Interrupt, Personality::Serial] {
        let controller = Controller::plugged_in(personality);
        let _first = controller.open();
        match transport::open(controller.kind(), &controller.address()) {
            Err(OpenError::Busy { .. }) => println!("  {personality:?}: busy"),
            Err(error) => panic!("{personality:?}: {error}"),
            Ok(_) => panic!("{personality:?} was opened twice"),
        }
    }
    for (personality, words) in [
        (Personality::Interrupt, "SUBSYSTEM==\"usb\", ATTR{idVendor}==\"1209\""),
        (Personality::Hid, "SUBSYSTEM==\"hidraw\", ATTRS{idVendor}==\"1209\""),
        (Personality::Serial, "dialout"),
    ] {
        let controller = Controller::plugged_in(personality);
        drop(controller.open());
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--ignored", "--exact", "a_process_that_is_the_host", "--nocapture"]);
        command.env(ROLE, "open").env(PERSONALITY, personality.address());
        // Nobody in particular.
        let output = command.uid(65_534).gid(65_534).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(said.contains("this user may not ") && said.contains(words), "{personality:?}: {said}");
    }
}
