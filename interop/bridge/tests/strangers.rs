//! Strangers at the ports of a bridge: they cost little, a new member's emergency stop arrives in time, and no loop is later.
//!
//! Lateness needs the program: `FLOTOR=target/release/flotor`, as `.ci/full` sets it; its test says so and does nothing without.

#[path = "../../../tests/src/attacks.rs"]
mod attacks;
mod common;
#[path = "../../../tests/src/loop_lateness.rs"]
mod loop_lateness;

use attacks::{Place, Target};
use common::process::Owned;
use common::{FakeHost, free_port, is_full_size, program, wait_until};
use flotor_bridge::access::{Members, VALID, write_keys};
use flotor_bridge::keys::Name;
use flotor_bridge::link::{End, LinkOptions, open};
use flotor_bridge::remote::Remote;
use flotor_bridge::request::{Request, Right};
use flotor_live::{Ask, Client, Directory, Event};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The bound for the stop of a new member under a flood; a busy machine gets twice the time that it needs without one.
const IN_TIME: Duration = Duration::from_secs(1);

/// How a bridge is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Tls,
    Tcp,
}

/// A bridge in a process of its own, beside a host.
struct Bridge {
    host: FakeHost,
    keys: tempfile::TempDir,
    way: Way,
    port: u16,
    process: Owned,
}

fn flotor_bridge(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_flotor-bridge"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Keys of a bridge at this machine and of one member.
fn keys() -> tempfile::TempDir {
    let keys = tempfile::tempdir().unwrap();
    let peers = vec![(Name::new("alan").unwrap(), Right::Watch)];
    write_keys(keys.path(), &Members { hosts: vec!["localhost".to_owned()], peers, valid: VALID }).unwrap();
    keys
}

/// Starts a bridge for the runs in a folder; returns its process and its port.
fn serve(way: Way, keys: &tempfile::TempDir, runtime: &Path) -> (Owned, u16) {
    let port = free_port();
    let mut command = flotor_bridge(&["serve", "--name", "lab"]);
    with_keys(&mut command, way, keys, "bridge");
    command.args(["--listen", &endpoint(way, port)]).stderr(Stdio::null());
    let process = Owned::start(command.env("XDG_RUNTIME_DIR", runtime));
    wait_until("the bridge listens", || TcpStream::connect(("127.0.0.1", port)).is_ok());
    (process, port)
}

/// Returns the first bytes that a member sends at a new connection.
fn first_bytes(way: Way, keys: &tempfile::TempDir) -> Vec<u8> {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut command = flotor_bridge(&["list"]);
    with_keys(&mut command, way, keys, "alan");
    let at = endpoint(way, listener.local_addr().unwrap().port());
    let _member = Owned::start(command.args(["--connect", &at]).stderr(Stdio::null()));
    let mut bytes = vec![0; 4096];
    let length = listener.accept().unwrap().0.read(&mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

impl Bridge {
    fn start(way: Way) -> Self {
        let (host, keys) = (FakeHost::start_in("flotor"), keys());
        let (process, port) = serve(way, &keys, host.directory.path().parent().unwrap());
        Self { host, keys, way, port, process }
    }

    /// Presses as a member that was not connected before, at a port; returns what the command said, and its time.
    fn ask_at(&self, port: u16) -> (Output, Duration) {
        let mut command = flotor_bridge(&["ask", "lab", "emergency-stop"]);
        with_keys(&mut command, self.way, &self.keys, "alan");
        let since = Instant::now();
        let output = Owned::start(command.args(["--connect", &endpoint(self.way, port)])).output();
        (output, since.elapsed())
    }

    /// Presses as a new member, and expects the host to be stopped; returns the time.
    #[track_caller]
    fn stop(&self) -> Duration {
        let before = self.presses();
        let (output, time) = self.ask_at(self.port);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(self.presses() > before, "the host was asked");
        time
    }

    /// Machine stops that the host has received.
    fn presses(&self) -> usize {
        self.host.asked.0.lock().unwrap().iter().filter(|ask| matches!(ask, Ask::MachineStop)).count()
    }

    fn target(&self) -> Target {
        let place = Place::Port(([127, 0, 0, 1], self.port).into());
        Target { process: self.process.pid().as_raw_nonzero().get().cast_unsigned(), place }
    }
}

fn endpoint(way: Way, port: u16) -> String {
    match way {
        Way::Tls => format!("tls/localhost:{port}"),
        Way::Tcp => format!("tcp/127.0.0.1:{port}"),
    }
}

fn with_keys(command: &mut Command, way: Way, keys: &tempfile::TempDir, who: &str) {
    if way == Way::Tls {
        command.arg("--config").arg(keys.path().join(format!("{who}.json5")));
    }
}

/// Carries out attacks without end in threads until the body returns.
fn under<T>(threads: usize, attack: impl Fn() + Sync, body: impl FnOnce() -> T) -> T {
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while !is_over.load(Ordering::Relaxed) {
                    attack();
                }
            });
        }
        let result = body();
        is_over.store(true, Ordering::Relaxed);
        result
    })
}

/// Stops as a new member without strangers, then under a flood; expects the second in time.
#[track_caller]
fn assert_stops_in_time(bridge: &Bridge, flood: impl FnOnce(&dyn Fn() -> Duration) -> Duration, name: &str) {
    let alone = bridge.stop();
    let flooded = flood(&|| bridge.stop());
    println!("{name}, {:?}: a new member's stop took {flooded:?}, {alone:?} without strangers", bridge.way);
    assert!(flooded <= IN_TIME.max(2 * alone), "{flooded:?}, alone {alone:?}");
}

#[test]
fn connections_that_fail_do_not_delay_the_stop_of_a_new_member() {
    let bridge = Bridge::start(Way::Tls);
    let connect = || {
        let _ =
            TcpStream::connect(("127.0.0.1", bridge.port)).map(|mut stream| stream.write_all(b"malformed"));
        std::thread::sleep(Duration::from_millis(20));
    };
    let flood = |stop: &dyn Fn() -> Duration| {
        // Zenoh pauses for 0.1 s after each.
        (0..200).for_each(|_| drop(TcpStream::connect(("127.0.0.1", bridge.port))));
        under(1, connect, stop)
    };
    assert_stops_in_time(&bridge, flood, "50 failed connections a second");
}

#[test]
fn held_connections_do_not_delay_the_stop_of_a_new_member() {
    for way in [Way::Tls, Way::Tcp] {
        let bridge = Bridge::start(way);
        let flood = |stop: &dyn Fn() -> Duration| {
            let _held: Vec<_> = (0..1500).map(|_| TcpStream::connect(("127.0.0.1", bridge.port))).collect();
            stop()
        };
        assert_stops_in_time(&bridge, flood, "1500 held connections");
    }
}

#[test]
fn a_flood_of_datagrams_does_not_delay_the_stop_of_a_new_member() {
    for way in [Way::Tls, Way::Tcp] {
        let bridge = Bridge::start(way);
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let bytes: Vec<u8> = (0..2000_u32).flat_map(u32::to_le_bytes).collect();
        let attack = || {
            for length in [0, 1, 31, 32, 33, 200, 2048, 2049, 8000] {
                let _ = socket.send_to(&bytes[..length], ("127.0.0.1", bridge.port));
            }
        };
        assert_stops_in_time(&bridge, |stop| under(1, attack, stop), "a flood of datagrams");
    }
}

/// The bound for the stop of a member that is connected, and the number of stops.
const CONNECTED_IN_TIME: Duration = Duration::from_millis(50);
const STOPS: usize = 5;

#[test]
fn failed_connections_do_not_delay_the_stop_of_a_member_that_is_connected() {
    for way in [Way::Tls, Way::Tcp] {
        let bridge = Bridge::start(way);
        let config = (way == Way::Tls).then(|| bridge.keys.path().join("alan.json5"));
        let link =
            LinkOptions { config, connect: vec![endpoint(way, bridge.port)], ..LinkOptions::default() };
        let remote =
            Remote::listen(&open(&link, End::Visiting).unwrap(), &Name::new("lab").unwrap()).unwrap();
        wait_until("the member is connected", || remote.status().unwrap().is_some());
        // The same strangers at a port of this process.
        let stand_in = TcpListener::bind("127.0.0.1:0").unwrap();
        let elsewhere = stand_in.local_addr().unwrap().port();
        std::thread::spawn(move || while stand_in.accept().is_ok() {});
        let [mut flooded, mut alone] = [bridge.port, elsewhere].map(|port| {
            let connect = || {
                let _ =
                    TcpStream::connect(("127.0.0.1", port)).map(|mut stream| stream.write_all(b"malformed"));
                std::thread::sleep(Duration::from_millis(20));
            };
            let stop = |_| {
                let since = Instant::now();
                assert_eq!(remote.requests().run(Request::EmergencyStop), Ok(()));
                since.elapsed()
            };
            under(1, connect, || (0..STOPS).map(stop).collect::<Vec<Duration>>())
        });
        flooded.sort_unstable();
        alone.sort_unstable();
        println!(
            "{way:?}: a connected member's stop took {flooded:?}, with the strangers elsewhere {alone:?}"
        );
        let [flooded, alone] = [flooded[STOPS / 2], alone[STOPS / 2]];
        assert!(flooded <= CONNECTED_IN_TIME.max(2 * alone), "{flooded:?}, elsewhere {alone:?}");
    }
}

/// A stranger who has read all datagrams of a press sends them again.
#[test]
fn a_press_cannot_be_replayed() {
    let bridge = Bridge::start(Way::Tls);
    // Between member and bridge; connections end here, so that the datagrams alone press.
    let (between, towards) =
        (UdpSocket::bind("127.0.0.1:0").unwrap(), UdpSocket::bind("127.0.0.1:0").unwrap());
    for socket in [&between, &towards] {
        socket.set_read_timeout(Some(Duration::from_millis(5))).unwrap();
    }
    let port = between.local_addr().unwrap().port();
    let is_over = AtomicBool::new(false);
    let read = std::thread::scope(|scope| {
        let relay = scope.spawn(|| {
            let (mut read, mut member, mut bytes) = (Vec::new(), None, [0; 4096]);
            while !is_over.load(Ordering::Relaxed) {
                if let Ok((length, from)) = between.recv_from(&mut bytes) {
                    member = Some(from);
                    read.push(bytes[..length].to_vec());
                    towards.send_to(&bytes[..length], ("127.0.0.1", bridge.port)).unwrap();
                }
                if let (Ok(length), Some(member)) = (towards.recv(&mut bytes), member) {
                    between.send_to(&bytes[..length], member).unwrap();
                }
            }
            read
        });
        let (output, _) = bridge.ask_at(port);
        is_over.store(true, Ordering::Relaxed);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        relay.join().unwrap()
    });
    let is_hello = |datagram: &Vec<u8>| datagram.windows(5).any(|bytes| bytes == b"hello");
    let presses = bridge.presses();
    assert!(presses > 0 && read.iter().any(|datagram| !is_hello(datagram)), "a press was read");
    let replay = |datagrams: &mut dyn Iterator<Item = &Vec<u8>>| {
        datagrams.for_each(|datagram| drop(towards.send_to(datagram, ("127.0.0.1", bridge.port))));
    };
    replay(&mut read.iter().filter(|datagram| !is_hello(datagram)));
    // A hello is answered after what came before it; a host would be asked within milliseconds.
    replay(&mut read.iter().filter(|datagram| is_hello(datagram)));
    wait_until("a hello is answered", || towards.recv(&mut [0; 4096]).is_ok());
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(bridge.presses(), presses);
}

/// Without the key of a member nothing is answered.
#[test]
fn a_stranger_gets_no_answer_to_a_datagram() {
    let bridge = Bridge::start(Way::Tls);
    let anyone = Bridge { way: Way::Tcp, ..Bridge::start(Way::Tcp) };
    let before = bridge.presses();
    let (output, _) = anyone.ask_at(bridge.port);
    assert!(!output.status.success(), "nobody answers whom the bridge does not know");
    assert_eq!(bridge.presses(), before);
}

#[test]
fn strangers_cost_a_bridge_little() {
    for way in [Way::Tls, Way::Tcp] {
        let bridge = Bridge::start(way);
        let request = first_bytes(way, &bridge.keys);
        bridge.target().withstand(&request, |_| bridge.ask_at(bridge.port).0.status.success());
    }
}

/// Strangers take processor time of the bridge, another process than that of the loop.
#[test]
fn strangers_at_a_bridge_do_not_make_the_loop_later() {
    let Some(flotor) = program() else { return };
    let count = if is_full_size() { 80 } else { 12 };
    for way in [Way::Tls, Way::Tcp] {
        let (folder, keys) = (tempfile::tempdir().unwrap(), keys());
        let scene = folder.path().join("scene.toml");
        let text = "duration_s = 3000\n[device]\nplugin = \"simulated\"\n[limits]\nwatchdog_ms = 60000\n";
        std::fs::write(&scene, text).unwrap();
        let mut command = Command::new(&flotor);
        command.arg("run").arg(&scene).env("XDG_RUNTIME_DIR", folder.path());
        let _run = Owned::start(command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()));
        let directory = Directory::at(folder.path().join("flotor"));
        wait_until("the run is there", || Client::find(&directory).is_ok());
        let (_bridge, port) = serve(way, &keys, folder.path());
        let request = first_bytes(way, &keys);
        let mut client = Client::find(&directory).unwrap();
        let _ = client.request_client().ask(Ask::Watch { every: 1 }).unwrap();
        let next = || match client.next(Duration::from_millis(20)).unwrap() {
            Some(Event::Ticks { records, .. }) => records.iter().map(|record| record.lateness_ns).collect(),
            _ => Vec::new(),
        };
        let place = Place::Port(([127, 0, 0, 1], port).into());
        let windows = loop_lateness::windows(&place, folder.path(), &request, count, next);
        loop_lateness::judge(&format!("bridge, {way:?}"), &windows);
    }
}
