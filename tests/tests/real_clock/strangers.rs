//! Strangers at the ports of a run: what they cost its process, its loop and its stops, compared with the same strangers at a port of this
//! process, in turn.

#[path = "../../src/attacks.rs"]
mod attacks;
#[path = "../../src/loop_lateness.rs"]
mod loop_lateness;

use crate::board::{Board, PAST, Where, children_of, dies, run_on, wait_until};
use crate::keyboard::Keyboard;
use attacks::{Listening, Place, Target};
use flotor_live::{Ask, Client, Directory, Event, Kind, Request, frame};
use flotor_tests::TestSize;
use flotor_tests::library::build_folder;
use flotor_tests::program::{Flotor, Running, exit_code};
use flotor_tests::scratch::Scratch;
use loop_lateness::{judge, stand_in, under_attack};
use rustix::process::{Pid, Signal};
use std::io::{Read, Write};
use std::net::TcpListener;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::AtomicUsize;
use std::time::{Duration, Instant};

/// A request to watch, of which attackers send parts.
fn request() -> Vec<u8> {
    let request = Request { number: 1, ask: Ask::Watch { every: 1 } };
    frame(Kind::Request, &serde_json::to_vec(&request).expect("it is JSON"))
}

/// The run folder of a run, and its socket.
fn directory(scratch: &Scratch) -> Directory {
    Directory::at(scratch.path().join("flotor"))
}

fn socket(directory: &Directory) -> PathBuf {
    let first = || directory.runs().into_iter().next();
    // The file is there before somebody listens.
    wait_until("the run has a socket", || first().is_some_and(|run| UnixStream::connect(run.path).is_ok()));
    first().expect("it is there").path
}

/// A run on the simulated device for longer than any test.
fn start(scratch: &Scratch, models: &str) -> Running {
    start_on("plugin = \"simulated\"", scratch, models)
}

/// A run on a device for longer than any test.
fn start_on(device: &str, scratch: &Scratch, models: &str) -> Running {
    let scene = format!("duration_s = 3000\n[device]\n{device}\n{models}");
    let scene = scratch.patient_scene(&scene).display().to_string();
    Flotor::with(["run", &scene]).env("XDG_RUNTIME_DIR", &scratch.path().display().to_string()).start()
}

#[test]
fn strangers_at_the_live_socket_cost_little() {
    let _turn = crate::among_idle_ones();
    let scratch = Scratch::default();
    let run = start(&scratch, "[[model]]\nplugin = \"spring\"\n");
    let place = Place::Socket(socket(&directory(&scratch)));
    let process = run.host().as_raw_nonzero().get().cast_unsigned();
    // The greeting comes by itself.
    let is_served = |place: &Place| {
        let greeted = place.connect().and_then(|mut stream| {
            stream.set_read_timeout(Some(Duration::from_secs(1)))?;
            stream.read(&mut [0; 16])
        });
        greeted.is_ok_and(|length| length > 0)
    };
    Target { process, place }.withstand(&request(), is_served);
    run.signal(Signal::INT);
    assert_eq!(run.wait().code, Some(exit_code::OK));
}

/// Sends a request by HTTP; returns whether anything is answered in time.
fn answers(place: &Place) -> bool {
    let asked = place.connect().and_then(|mut stream| {
        stream.set_read_timeout(Some(Duration::from_secs(1)))?;
        stream.write_all(HTTP)?;
        stream.read(&mut [0; 16])
    });
    asked.is_ok_and(|length| length > 0)
}

const HTTP: &[u8] = b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n";

/// The newest process under one: each process here has one child at most.
fn last_of(process: Pid) -> Pid {
    children_of(process).first().map_or(process, |child| last_of(*child))
}

#[test]
fn strangers_at_a_service_beside_a_program_cost_little() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let _turn = crate::among_idle_ones();
    let port =
        TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a free port");
    let at = port.to_string();
    let lend = ["lend", "--api", "haply", "--listen", &at, "--", "/bin/sleep", "600"];
    let run = Flotor::with(lend).start();
    let place = Place::Port(port);
    wait_until("the service listens", || answers(&place));
    let is_service = |process: &Pid| {
        let name = std::fs::read_to_string(format!("/proc/{}/comm", process.as_raw_nonzero()));
        name.is_ok_and(|name| name.starts_with("flotor-haply"))
    };
    let service = children_of(run.pid()).into_iter().find(is_service).expect("it listens");
    let process = last_of(service).as_raw_nonzero().get().cast_unsigned();
    Target { process, place }.withstand(HTTP, answers);
    run.signal(Signal::TERM);
    let _ = run.wait();
}

// ---------------------------------------------------------------- stops

/// How a run is stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stop {
    /// The space bar of the run's terminal.
    Key,
    Signal,
    /// Over a connection that is made for it.
    Socket,
    /// Over the connection of a client that watches since before the attack.
    Connected,
}

/// The time from a stop to the first command of a device without force, by the log of the device.
fn stop_time(stop: Stop, selected: usize) -> Duration {
    let (board, scratch) = (Board::start(), Scratch::default());
    let runtime = scratch.path().display().to_string();
    let mut keyboard = Keyboard::new();
    let run = run_on(&board, &scratch, dies(), Where::InTheHost).env("XDG_RUNTIME_DIR", &runtime);
    let run = run.through_shell(&keyboard.script()).start();
    let path = socket(&directory(&scratch));
    let watching = Client::connect(&path).expect("the run answers");
    let connected = watching.request_client();
    let _ = connected.ask(Ask::Watch { every: 1 }).expect("likewise");
    board.wait_for_force(PAST);
    let place = Place::Socket(path.clone());
    let places = [place.clone(), stand_in(&place, scratch.path())];
    let since = under_attack(&places, &request(), &AtomicUsize::new(selected), || {
        std::thread::sleep(Duration::from_millis(300));
        let since = Instant::now();
        match stop {
            Stop::Key => keyboard.press(b' '),
            Stop::Signal => run.signal(Signal::USR1),
            Stop::Connected => drop(connected.ask(Ask::EmergencyStop).expect("the connection is there")),
            Stop::Socket => {
                let client = Client::connect(&path).expect("the run answers");
                let _ = client.request_client().ask(Ask::EmergencyStop).expect("likewise");
            }
        }
        wait_until("there is no force", || board.force_n() == 0.0);
        since
    });
    assert_eq!(run.wait().code, Some(exit_code::DEVICE_FAULT), "{stop:?}");
    board.assert_stopped_since(since, &format!("{stop:?}"))
}

/// The bound of a stop where a machine without strangers is faster.
const IN_TIME: Duration = Duration::from_millis(50);

#[test]
fn strangers_at_the_live_socket_delay_no_stop() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let _turn = crate::alone();
    let trials = TestSize::of_this_run().pick(3, 9);
    for stop in [Stop::Key, Stop::Signal, Stop::Socket, Stop::Connected] {
        let mut times = [Vec::new(), Vec::new()];
        for _ in 0..trials {
            for (selected, times) in times.iter_mut().enumerate() {
                times.push(stop_time(stop, selected));
            }
        }
        times.iter_mut().for_each(|times| times.sort_unstable());
        let [at_the_run, elsewhere] = [0, 1].map(|place| times[place][trials / 2]);
        println!(
            "{stop:?}: {at_the_run:?} (worst {:?}), strangers elsewhere {elsewhere:?}",
            times[0][trials - 1]
        );
        assert!(at_the_run <= IN_TIME.max(2 * elsewhere), "{stop:?}: {times:?}");
    }
}

// ---------------------------------------------------------------- lateness

/// Lateness of the ticks, ns, of each window of a run in a run folder.
fn windows(
    directory: &Directory,
    place: &Place,
    scratch: &Scratch,
    request: &[u8],
    count: usize,
) -> Vec<Vec<u64>> {
    let mut client = Client::connect(&socket(directory)).expect("the run answers");
    let _ = client.request_client().ask(Ask::Watch { every: 1 }).expect("likewise");
    let next = || match client.next(Duration::from_millis(20)).expect("the run goes on") {
        Some(Event::Ticks { records, .. }) => records.iter().map(|record| record.lateness_ns).collect(),
        _ => Vec::new(),
    };
    loop_lateness::windows(place, scratch.path(), request, count, next)
}

#[test]
fn strangers_at_a_port_of_the_loops_process_do_not_make_it_later() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let _turn = crate::alone();
    let count = TestSize::of_this_run().pick(12, 80);
    let scratch = Scratch::default();
    let port =
        TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a free port");
    let run = start(
        &scratch,
        &format!("[[model]]\nplugin = \"ml-api\"\n[model.parameters]\nlisten = \"{port}\"\n"),
    );
    let here = directory(&scratch);
    let live = Place::Socket(socket(&here));
    judge("live socket", &windows(&here, &live, &scratch, &request(), count));
    let get_version =
        flotor_maglev::ml_api::Request::Plain(flotor_maglev::ml_api::Function::GetVersion).encode();
    judge("ml-api", &windows(&here, &Place::Port(port), &scratch, get_version.bytes(), count));
    run.signal(Signal::INT);
    assert_eq!(run.wait().code, Some(exit_code::OK));

    let scratch = Scratch::default();
    let program = build_folder().join("flotor-haply-service-emulator").display().to_string();
    let runtime = format!("XDG_RUNTIME_DIR={}", scratch.path().display());
    let arguments = [&*runtime, &program, "--listen", "127.0.0.1:0", "--events", "127.0.0.1:0"];
    let service = Listening::start("env", &arguments, "listening ws://");
    let here = directory(&scratch);
    judge("haply-service", &windows(&here, &service.target.place, &scratch, HTTP, count));
}

/// A stranger gets processor time of the emulator, another process than that of the loop, and takes the place of no host.
#[test]
fn strangers_at_an_emulated_device_do_not_make_the_loop_later() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let _turn = crate::alone();
    let count = TestSize::of_this_run().pick(12, 80);
    for (plugin, listening, transport, more, request) in [
        // The chip's request to empty its buffers.
        ("falcon", "listening tcp:", "tcp:", "", vec![flotor_falcon::remote::REQUEST, 0, 1, 0]),
        // Its controller bears a host that a busy machine delays.
        ("maglev", "listening tcp ", "", ", watchdog_ms = 700", description()),
    ] {
        let program = build_folder().join(format!("flotor-{plugin}-emulator")).display().to_string();
        let emulator = Listening::start(&program, &["--listen", "127.0.0.1:0"], listening);
        let place = emulator.target.place.clone();
        let Place::Port(address) = place else { panic!("it is a port: {place:?}") };
        let parameters = format!("{{ address = \"{transport}{address}\", timeout_ms = 9000{more} }}");
        let device = format!("plugin = \"{plugin}\"\nparameters = {parameters}");
        let scratch = Scratch::default();
        let run = start_on(&device, &scratch, "[[model]]\nplugin = \"spring\"\n");
        let name = format!("emulated {plugin}");
        judge(&name, &windows(&directory(&scratch), &place, &scratch, &request, count));
        run.signal(Signal::INT);
        assert_eq!(run.wait().code, Some(exit_code::OK), "{name}");
    }
}

/// A request of a host to the maglev's controller.
fn description() -> Vec<u8> {
    use flotor_maglev::protocol::{Request, RequestFrame, stream::coded};
    let request = Request::Describe { page: 0 };
    let frame = RequestFrame { sequence: 1, acknowledged: 0, time_us: 0, session: 0, request };
    let (bytes, length) = coded(&frame.encode());
    bytes.get(..length).expect("it is as long").to_vec()
}
