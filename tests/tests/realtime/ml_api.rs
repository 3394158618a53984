//! The link to a Maglev 200: a tick in, a wrench out, paced by the controller; the emulated controller runs in this process.
//! At full size a minute of it, against the bare round trip of the same bytes: `cargo test --release -p flotor-tests --test
//! realtime ml_api -- --nocapture` with `FLOTOR_TEST_SIZE=full` prints the numbers.

use super::counted;
use flotor_hal::{Cycle, DVec3, DeviceState, LoopConfig, SampleWait, Tick, Wrench};
use flotor_loader::{Plugin, Setting};
use flotor_maglev_emulator::controller::Sample;
use flotor_maglev_emulator::ml_api::server::{Hub, serve};
use flotor_maglev_emulator::ml_api::{Controller, ControllerConfig, Machine};
use flotor_maglev_emulator::port::{Port, Reach};
use flotor_maglev_emulator::{Pace, Plant};
use flotor_tests::TestSize;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A flotor that somebody holds at home: what is measured is the link.
struct Held;

impl Plant for Held {
    fn advance(&mut self, _: u64, _: &Wrench) -> Sample {
        Sample::HOME
    }

    fn restart(&mut self) {}
}

/// Bytes of a force command, of its reply and of a tick; an acknowledgement has as many as a reply.
const CALL_BYTES: usize = 32;
const REPLY_BYTES: usize = 8;
const TICK_BYTES: usize = 36;
const PERIOD: Duration = Duration::from_millis(1);
/// Nagle's algorithm against delayed acknowledgements: what a frame in two pieces costs, less a margin.
const STALL: Duration = Duration::from_millis(35);

/// A controller with nothing behind its two connections: one thread answers a command's bytes with as many as its reply has, one
/// sends the bytes of a tick every millisecond and takes as many as its acknowledgement has. So the scheduler has the same threads
/// to place, and the loop comes to each command out of the same wait.
struct Bare {
    calls: TcpStream,
    ticks: TcpStream,
    bytes: [u8; TICK_BYTES],
}

impl Bare {
    /// Sends ticks from `first` on.
    fn new(first: Instant) -> Self {
        let (calls, mut far) = connection();
        std::thread::spawn(move || {
            let mut bytes = [0; CALL_BYTES];
            while far.read_exact(&mut bytes).is_ok() && far.write_all(&bytes[..REPLY_BYTES]).is_ok() {}
        });
        let (ticks, mut far) = connection();
        std::thread::spawn(move || {
            let mut bytes = [0; TICK_BYTES];
            let mut deadline = first;
            loop {
                std::thread::sleep(deadline.saturating_duration_since(Instant::now()));
                deadline += PERIOD;
                if far.write_all(&bytes).is_err() || far.read_exact(&mut bytes[..REPLY_BYTES]).is_err() {
                    break;
                }
            }
        });
        Self { calls, ticks, bytes: [0; TICK_BYTES] }
    }

    /// Waits for a tick, and returns the time of a command, its reply and the acknowledgement.
    fn round_trip(&mut self) -> Duration {
        self.ticks.read_exact(&mut self.bytes).expect("the other end sends");
        let now = Instant::now();
        self.calls.write_all(&self.bytes[..CALL_BYTES]).expect("the other end listens");
        self.calls.read_exact(&mut self.bytes[..REPLY_BYTES]).expect("the other end answers");
        self.ticks.write_all(&self.bytes[..REPLY_BYTES]).expect("the other end listens");
        now.elapsed()
    }
}

/// Both ends of a connection over loopback.
fn connection() -> (TcpStream, TcpStream) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a free port");
    let near = TcpStream::connect(listener.local_addr().expect("it is bound")).expect("it listens");
    let (far, _) = listener.accept().expect("somebody connects");
    for end in [&near, &far] {
        end.set_nodelay(true).expect("it is a connection");
    }
    (near, far)
}

fn median(times: &[Duration]) -> Duration {
    let mut times = times.to_vec();
    times.sort_unstable();
    times[times.len() / 2]
}

#[test]
fn a_minute_of_ticks_comes_at_the_controllers_rate_and_allocates_nothing() {
    let ticks = TestSize::of_this_run().pick(1000, 60_000);
    let full = ticks > 1000;
    let port = Port::bind("127.0.0.1:0", Reach::ThisUser).expect("there is a free port");
    let address = port.address().expect("it is bound").to_string();
    let stop = Arc::new(AtomicBool::new(false));
    let controller = Controller::new(ControllerConfig::default());
    let hub = Arc::new(Hub::new(controller, Vec::new(), false, Box::new(|_| ())));
    let mut machine = Machine::new(Arc::clone(&hub), Pace::RealTime, Held);
    serve(port, hub).expect("a thread starts");
    let stopped = Arc::clone(&stop);
    let machine = std::thread::spawn(move || machine.run(&stopped));

    let plugin = Plugin::in_process(&flotor_maglev::FLOTOR_ENTRY).expect("it is a plugin");
    let settings = [
        ("protocol", "ml-api"),
        ("address", &*address),
        ("gravity", "off"),
        ("fade_ms", "0"),
        ("timeout_ms", "8000"),
    ];
    let settings =
        settings.map(|(key, value)| Setting::parse(plugin.parameters(), key, value).expect("it is legal"));
    let config = LoopConfig { period_ns: 1_000_000, seed: 1 };
    let opened = plugin.open_device(&settings).expect("the controller answers");
    let mut active = opened.activate(&config).map_err(|(_, refusal)| refusal).expect("it takes off");

    assert!(matches!(active.wait_for_sample(8_000_000_000), SampleWait::Arrived { .. }));
    // Half a period after the controller's ticks.
    let mut bare = Bare::new(Instant::now() + PERIOD + PERIOD / 2);
    let (mut calls, mut trips) = (vec![Duration::ZERO; ticks], vec![Duration::ZERO; ticks]);
    let (mut unseen, mut stale) = (0, 0);
    let began = Instant::now();
    let allocations = counted(|| {
        for (index, (call, trip)) in calls.iter_mut().zip(&mut trips).enumerate() {
            match active.wait_for_sample(8_000_000_000) {
                SampleWait::Arrived { samples } => unseen += samples - 1,
                other => panic!("{other:?} in tick {index}"),
            }
            let time_ns = index as u64 * 1_000_000;
            let tick = Tick { index: index as u64, time_ns, dt_ns: 1_000_000 };
            let mut state = DeviceState::HOME;
            assert_eq!(active.read(&tick, &mut state), Cycle::Fresh, "tick {index}");
            let now = Instant::now();
            let written = active.write(&tick, &Wrench::from_force(DVec3::Z));
            *call = now.elapsed();
            assert!(!matches!(written, Cycle::Fault(_)), "{written:?} in tick {index}");
            stale += u64::from(written == Cycle::Stale);
            *trip = bare.round_trip();
        }
    });
    let rate_hz = ticks as f64 / began.elapsed().as_secs_f64();
    let stalls = calls.iter().filter(|call| **call >= STALL).count();
    let (call, trip) = (median(&calls), median(&trips));
    let ratio = call.as_secs_f64() / trip.as_secs_f64();
    println!(
        "{ticks} ticks at {rate_hz:.1} Hz, {unseen} older ones unseen, {stale} commands unconfirmed in their tick, \
         {stalls} stalls; a command and its acknowledgement {call:?} (median), the same bytes bare {trip:?}, \
         ratio {ratio:.2}; {allocations} allocations"
    );
    drop(active.deactivate());
    stop.store(true, Ordering::Relaxed);
    machine.join().expect("the machine ends");
    assert_eq!(allocations, 0);
    // How many ticks a second come, and whether one stalls, is the machine's affair as well: printed, not asserted.
    if full {
        assert!(ratio <= 1.5, "as printed");
    }
}
